"""Output of results: HTML pages, picture files, strict JSON, severities in words, progress.

It may import ``sim.atomic``, ``sim.output``, ``datasets.file``.
"""
