"""Suction and discharge pipes: lumped or with waves, damper and relief valve, at a common node.

It may import ``sim.jit``, ``sim.scene``.
"""
