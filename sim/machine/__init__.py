"""Any machine, whatever its kind: from a scene to a recording or to transfer functions.

It may import ``sim.output``, ``sim.scene``, ``sim.pump``, ``sim.journal``, ``sim.shaft``.
"""
