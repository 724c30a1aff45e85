"""A shaft on its oil films: beam and films balanced together, stiffness and damping about it.

It may import ``sim.brief``, ``sim.output``, ``sim.film``, ``sim.bearing``, ``sim.beam``.
"""
