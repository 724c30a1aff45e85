"""The oil film of a bearing: its solvers, its force map, the characteristics that follow.

It may import ``sim.atomic``, ``sim.jit``, ``sim.brief``.
"""
