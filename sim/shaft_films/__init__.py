"""A shaft on its oil films: equilibrium of beam and films, stiffness and damping about it.

It may import ``sim.brief``, ``sim.output``, ``sim.film``, ``sim.bearing``, ``sim.beam``.
"""
