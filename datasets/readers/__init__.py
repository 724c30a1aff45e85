"""One reader per file format, and one function that opens them all.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``datasets.file``, ``datasets.source``.
"""
