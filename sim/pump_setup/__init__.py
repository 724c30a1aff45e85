"""Input of the mechanism's kernels from a pump's scene: joints, films, tables, start.

It may import ``sim.jit``, ``sim.scene``, ``sim.contact``, ``sim.film``, ``sim.bearing``,
``sim.hydraulics``, ``sim.piping``, ``sim.mechanism``, ``sim.casing``.
"""
