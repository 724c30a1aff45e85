"""Parameter sweeps of a scene: runs over a range of values, and detectable changes.

It may import ``sim.atomic``, ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.machine``,
``sim.fidelity``, ``features.catalogue``, ``datasets.file``, ``datasets.workers``,
``datasets.draws``, ``datasets.recipe``, ``datasets.generation``, ``diagnose.pages``,
``diagnose.charts``.
"""
