"""From recordings to feature rows for learning: tables, choice and ranking of features.

It may import ``sim.atomic``, ``sim.output``, ``features.signal``, ``features.response``,
``features.catalogue``, ``datasets.file``, ``datasets.workers``, ``datasets.split``,
``diagnose.learning``.
"""
