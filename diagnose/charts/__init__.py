"""Speed against accuracy, for the rungs of a scene and for features and models.

It may import ``sim.atomic``, ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.machine``,
``sim.fidelity``, ``features.catalogue``, ``datasets.file``, ``datasets.workers``,
``datasets.draws``, ``datasets.recipe``, ``datasets.split``, ``datasets.generation``,
``diagnose.pages``, ``diagnose.learning``, ``diagnose.feature_rows``.
"""
