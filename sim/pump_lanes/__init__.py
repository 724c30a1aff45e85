"""Many reciprocating pumps in parallel, each in one lane of the processor's vectors.

It may import ``sim.jit``, ``sim.output``, ``sim.scene``, ``sim.contact``, ``sim.film``,
``sim.hydraulics``, ``sim.mechanism``, ``sim.pump_setup``, ``sim.pump``.
"""
