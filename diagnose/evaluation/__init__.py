"""How good a wear model is on machines it has not seen, and against what.

It may import ``sim.output``, ``datasets.file``, ``datasets.split``, ``diagnose.pages``,
``diagnose.learning``, ``diagnose.feature_rows``, ``diagnose.healthy_reference``,
``diagnose.wear_model``.
"""
