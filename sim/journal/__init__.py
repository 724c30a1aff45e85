"""A journal in its oil film: its orbit and its recording.

It may import ``sim.jit``, ``sim.output``, ``sim.scene``, ``sim.contact``, ``sim.film``,
``sim.brief``.
"""
