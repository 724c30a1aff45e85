"""The oil film of a bearing: its solvers, its force map, its stiffness and damping.

It may import ``sim.atomic``, ``sim.jit``, ``sim.brief``.
"""
