"""The wear model: training, estimate, cautions, and the model file.

It may import ``sim.atomic``, ``sim.output``, ``features.response``, ``features.catalogue``,
``datasets.file``, ``datasets.source``, ``datasets.recipe``, ``datasets.split``,
``diagnose.learning``, ``diagnose.feature_rows``, ``diagnose.recording_faults``,
``diagnose.healthy_reference``, ``diagnose.familiarity``.
"""
