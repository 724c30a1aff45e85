"""Contact and friction laws, and closed forms that verify them.

It may import ``sim.jit``, ``sim.brief``.
"""
