"""Force to housing acceleration: the casing as a set of modes, or as it was measured; decimation.

It may import ``sim.jit``, ``sim.output``, ``sim.parts``, ``sim.scene``.
"""
