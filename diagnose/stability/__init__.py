"""Limits of the numerical methods: maps, theory, and the position of a scene in them.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.contact``, ``sim.film``,
``sim.bearing``, ``sim.piping``, ``sim.mechanism``, ``sim.pump_setup``, ``sim.pump``,
``sim.journal``, ``sim.shaft``, ``sim.machine``, ``diagnose.pages``.
"""
