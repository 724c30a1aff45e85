"""A journal bearing on its film: equilibrium, coefficients, whirl threshold, heat, in SI units.

It may import ``sim.brief``, ``sim.output``, ``sim.film``.
"""
