"""One reader per file format, and one way to open them all.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``datasets.file``,
``datasets.source``.
"""
