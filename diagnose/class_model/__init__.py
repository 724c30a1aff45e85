"""Models that tell named conditions instead of metres of wear.

It may import ``sim.output``, ``datasets.file``, ``datasets.split``, ``diagnose.learning``,
``diagnose.feature_rows``, ``diagnose.familiarity``, ``diagnose.wear_model``, ``diagnose.report``.
"""
