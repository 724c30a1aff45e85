"""The reciprocating pump: from its scene to tables and start, its checks, its recording.

It may import ``sim.jit``, ``sim.output``, ``sim.scene``, ``sim.contact``, ``sim.film``,
``sim.excitation``, ``sim.hydraulics``, ``sim.piping``, ``sim.mechanism``, ``sim.casing``.
"""
