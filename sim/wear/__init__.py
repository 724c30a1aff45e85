"""Wear: Archard's law, a joint over its life, the wear rate of a simulated machine.

It may import ``sim.brief``, ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.film``,
``sim.bearing``, ``sim.mechanism``, ``sim.pump``, ``sim.journal``.
"""
