"""The reciprocating pump: run of a scene, validity checks, sensors, recording.

It may import ``sim.jit``, ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.contact``,
``sim.film``, ``sim.excitation``, ``sim.hydraulics``, ``sim.piping``, ``sim.mechanism``,
``sim.casing``, ``sim.pump_setup``.
"""
