"""A journal bearing on its film: equilibrium, coefficients, whirl threshold, heat; in SI.

It may import ``sim.film``, ``sim.brief``.
"""
