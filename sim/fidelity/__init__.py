"""Errors of a scene's rungs, their costs, and the cheapest sufficient ones.

It may import ``sim.output``, ``sim.scene``, ``sim.machine``.
"""
