"""Healthy recordings of a machine as the reference that its other recordings are compared with.

It may import ``sim.output``, ``features.response``, ``features.rotation``, ``features.catalogue``,
``datasets.file``, ``diagnose.feature_rows``, ``diagnose.recording_faults``.
"""
