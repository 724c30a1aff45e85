"""A twin of one machine: unknown parameters of its scene, estimated from healthy recordings.

It may import ``sim.atomic``, ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.machine``,
``features.signal``, ``features.rotation``, ``features.catalogue``, ``datasets.file``,
``datasets.workers``, ``datasets.draws``, ``datasets.recipe``, ``datasets.measured``,
``diagnose.pages``.
"""
