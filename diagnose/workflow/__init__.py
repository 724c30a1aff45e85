"""Train, evaluate and report, one call each, and a demonstration of all three.

It may import ``sim.output``, ``datasets.file``, ``datasets.measured``, ``datasets.audit``,
``datasets.generation``,
``diagnose.pages``, ``diagnose.feature_rows``, ``diagnose.healthy_reference``,
``diagnose.wear_model``, ``diagnose.nameplate``, ``diagnose.twin``, ``diagnose.report``,
``diagnose.class_model``, ``diagnose.evaluation``.
"""
