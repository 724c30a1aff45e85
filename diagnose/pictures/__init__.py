"""Pictures of a recording, measured or simulated, and of transfer functions.

It may import ``sim.atomic``, ``sim.output``, ``sim.scene``, ``sim.machine``, ``features.signal``,
``features.response``, ``features.rotation``, ``features.catalogue``, ``datasets.file``,
``diagnose.pages``.
"""
