"""Checks of the physics against the literature, with the expected values.

It may import ``sim.jit``, ``sim.scene``, ``sim.contact``, ``sim.film``, ``sim.bearing``,
``sim.beam``, ``sim.alignment``, ``sim.hydraulics``, ``sim.piping``, ``sim.mechanism``,
``sim.pump_setup``, ``sim.pump``.
"""
