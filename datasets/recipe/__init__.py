"""Recipes from which data sets are drawn: text, faults, lives, records; built-in recipes.

It may import ``sim.parts``, ``sim.scene``, ``sim.wear``, ``datasets.draws``.
"""
