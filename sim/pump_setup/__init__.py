"""From a pump's scene to what the kernels of its mechanism are told: joints, films, tables, start.

It may import ``sim.jit``, ``sim.scene``, ``sim.contact``, ``sim.film``, ``sim.bearing``,
``sim.hydraulics``, ``sim.piping``, ``sim.mechanism``, ``sim.casing``.
"""
