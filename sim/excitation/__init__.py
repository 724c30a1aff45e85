"""Forces of shakers and hammers.

It may import ``sim.output``, ``sim.scene``.
"""
