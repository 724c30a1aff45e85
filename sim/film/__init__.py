"""The oil film of a bearing: its solvers, its force map, its slopes.

It may import ``sim.atomic``, ``sim.jit``, ``sim.brief``.
"""
