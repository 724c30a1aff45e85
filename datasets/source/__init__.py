"""What all readers share: parts of a file, units, time stamps, resampling.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``features.rotation``,
``datasets.file``.
"""
