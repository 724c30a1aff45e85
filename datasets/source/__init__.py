"""Shared by all readers: parts of a file, their choice and meaning, time stamps, resampling.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``features.rotation``,
``datasets.file``.
"""
