"""How each machine is shown, and what of it a model takes for granted.

It may import ``sim.output``, ``sim.scene``, ``sim.shaft``, ``features.signal``,
``features.rotation``, ``datasets.generation``, ``diagnose.pages``, ``diagnose.pictures``.
"""
