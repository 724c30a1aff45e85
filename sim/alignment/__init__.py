"""Bearing loads of a shaft line: alignment, load calibration, jacking.

It may import ``sim.brief``, ``sim.output``, ``sim.beam``.
"""
