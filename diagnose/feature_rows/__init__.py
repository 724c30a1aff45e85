"""From recordings to rows for learning: quality checks, reference, choice of features.

It may import ``sim.atomic``, ``sim.output``, ``features.signal``, ``features.response``,
``features.rotation``, ``features.catalogue``, ``datasets.file``, ``datasets.workers``,
``datasets.split``, ``diagnose.learning``.
"""
