"""Presentation of each machine, and the assumptions that a model makes about it.

It may import ``sim.output``, ``sim.scene``, ``sim.shaft``, ``features.signal``,
``features.rotation``, ``datasets.generation``, ``diagnose.pages``, ``diagnose.pictures``.
"""
