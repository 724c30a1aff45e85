"""Parts of scenes: quantities with units, limits, error messages, casing, sensors, oil.

It may import ``sim.brief``, ``sim.output``.
"""
