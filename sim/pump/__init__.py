"""The reciprocating pump: crank mechanism, liquid, casing, and its recording.

It may import ``sim.jit``, ``sim.output``, ``sim.scene``, ``sim.contact``, ``sim.film``,
``sim.excitation``, ``sim.hydraulics``, ``sim.piping``, ``sim.mechanism``.
"""
