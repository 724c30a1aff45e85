"""Sensitivity of a wear model to its assumptions: the same machines with one property changed.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.machine``,
``datasets.file``, ``datasets.source``, ``datasets.draws``, ``datasets.recipe``,
``datasets.measured``, ``diagnose.pages``, ``diagnose.machines``, ``diagnose.learning``,
``diagnose.feature_rows``, ``diagnose.wear_model``, ``diagnose.nameplate``.
"""
