"""Train, evaluate and report, one call each: what the commands of these names do.

It may import ``sim.output``, ``datasets.file``, ``datasets.measured``, ``diagnose.pages``,
``diagnose.feature_rows``, ``diagnose.wear_model``, ``diagnose.nameplate``, ``diagnose.twin``,
``diagnose.report``, ``diagnose.class_model``, ``diagnose.evaluation``.
"""
