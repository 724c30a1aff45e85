"""Text summaries of files, data sets, scenes and recipes: info, card, audit, keys, ranking.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.fidelity``, ``sim.deep_check``,
``features.signal``, ``datasets.file``, ``datasets.source``, ``datasets.draws``,
``datasets.recipe``, ``datasets.measured``, ``datasets.generation``, ``datasets.audit``,
``diagnose.pages``, ``diagnose.pictures``, ``diagnose.machines``, ``diagnose.learning``,
``diagnose.feature_rows``, ``diagnose.recording_faults``, ``diagnose.wear_model``,
``diagnose.class_model``.
"""
