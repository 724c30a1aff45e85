"""Force to housing acceleration: the casing as modes or measured functions; decimation.

It may import ``sim.jit``, ``sim.output``, ``sim.parts``, ``sim.scene``.
"""
