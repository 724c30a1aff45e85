"""How wrong the rungs of a scene are, what they cost, and the cheapest that will do.

It may import ``sim.output``, ``sim.scene``, ``sim.machine``.
"""
