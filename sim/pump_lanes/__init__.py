"""Many reciprocating pumps at once, a lane of the processor's vectors each.

It may import ``sim.jit``, ``sim.output``, ``sim.scene``, ``sim.contact``, ``sim.film``,
``sim.hydraulics``, ``sim.mechanism``, ``sim.pump_setup``, ``sim.pump``.
"""
