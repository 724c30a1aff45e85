"""Models that recognise named conditions instead of estimating wear in metres.

It may import ``sim.output``, ``datasets.file``, ``datasets.split``, ``diagnose.learning``,
``diagnose.feature_rows``, ``diagnose.recording_faults``, ``diagnose.familiarity``,
``diagnose.wear_model``, ``diagnose.report``.
"""
