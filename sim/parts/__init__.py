"""Parts of scenes: quantities with units, limits, errors in words, casing, sensors, oil.

It may import ``sim.brief``, ``sim.output``.
"""
