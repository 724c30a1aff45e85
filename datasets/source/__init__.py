"""What all readers share: parts of a file, units, time stamps, resampling.

It may import ``sim.output``, ``sim.scene``, ``features.rotation``, ``datasets.file``.
"""
