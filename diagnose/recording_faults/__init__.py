"""Faults of a recording that must be known before anything is said about the machine.

It may import ``sim.output``, ``features.signal``, ``features.rotation``, ``datasets.file``,
``diagnose.feature_rows``.
"""
