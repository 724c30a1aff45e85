"""Accuracy of a wear model on unseen machines, compared with baselines.

It may import ``sim.output``, ``datasets.file``, ``datasets.split``, ``diagnose.pages``,
``diagnose.learning``, ``diagnose.feature_rows``, ``diagnose.healthy_reference``,
``diagnose.wear_model``.
"""
