"""Fitness of a data set for training: leaks, copies, integrity, plausibility.

It may import ``sim.output``, ``sim.scene``, ``sim.wear``, ``features.rotation``, ``datasets.file``,
``datasets.workers``, ``datasets.draws``, ``datasets.recipe``, ``datasets.split``,
``datasets.measured``.
"""
