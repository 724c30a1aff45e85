"""Contact and friction laws, and the closed forms that they are tested against.

It may import ``sim.jit``, ``sim.brief``.
"""
