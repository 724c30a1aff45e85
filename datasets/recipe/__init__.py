"""What a data set is drawn from: draws, conditions, lives, and built-in recipes.

It may import ``sim.scene``, ``sim.wear``.
"""
