"""A twin of one machine: unknown numbers of its scene, estimated from healthy recordings.

It may import ``sim.output``, ``sim.scene``, ``sim.machine``, ``sim.atomic``,
``features.catalogue``, ``features.rotation``, ``features.signal``, ``datasets.file``,
``datasets.measured``, ``datasets.recipe``, ``datasets.workers``, ``diagnose.pages``.
"""
