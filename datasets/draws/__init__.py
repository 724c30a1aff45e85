"""Random draws of a data set, key by key: distributions, options, correlation, sampling, twins.

It may import ``sim.parts``, ``sim.scene``.
"""
