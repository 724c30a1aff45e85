"""The ladders of models, what they cost, how wrong they are, and the cheapest that will do.

It may import ``sim.output``, ``sim.scene``, ``sim.pump``, ``sim.journal``, ``sim.shaft``,
``sim.machine``.
"""
