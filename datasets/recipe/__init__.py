"""What a data set is drawn from: recipes as text, their faults, lives, records; built-in recipes.

It may import ``sim.parts``, ``sim.scene``, ``sim.wear``, ``datasets.draws``.
"""
