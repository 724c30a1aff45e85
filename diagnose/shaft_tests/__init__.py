"""Tests of a shaft line: rig test, jacking, transfer functions; sags; the next test.

It may import ``sim.output``, ``sim.scene``, ``sim.excitation``, ``sim.beam``, ``sim.alignment``,
``sim.shaft_films``, ``sim.shaft_response``, ``sim.shaft``, ``features.response``,
``features.rotation``, ``datasets.file``, ``diagnose.pages``.
"""
