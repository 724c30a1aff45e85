"""Validated scenes without physics, built-in scenes, rungs and plausibility checks.

It may import ``sim.brief``, ``sim.output``, ``sim.parts``.
"""
