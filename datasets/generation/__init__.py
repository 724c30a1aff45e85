"""From a recipe to a simulated data set.

It may import ``sim.atomic``, ``sim.output``, ``sim.scene``, ``sim.wear``, ``sim.machine``,
``sim.fidelity``, ``features.signal``, ``features.rotation``, ``datasets.file``,
``datasets.workers``, ``datasets.recipe``, ``datasets.split``.
"""
