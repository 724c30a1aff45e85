"""Models that tell named conditions instead of metres of wear.

It may import ``sim.output``, ``datasets.file``, ``datasets.split``, ``diagnose.learning``,
``diagnose.feature_rows``, ``diagnose.recording_faults``, ``diagnose.familiarity``,
``diagnose.wear_model``, ``diagnose.report``.
"""
