"""Where numerical methods fail: maps, theory, and where a scene lies in them.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.contact``, ``sim.film``,
``sim.bearing``, ``sim.piping``, ``sim.mechanism``, ``sim.pump_setup``, ``sim.pump``,
``sim.journal``, ``sim.shaft``, ``sim.machine``, ``diagnose.pages``.
"""
