"""Figures of a scene, including a short run, compared with usual values of such machines.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.film``, ``sim.bearing``,
``sim.beam``, ``sim.alignment``, ``sim.mechanism``, ``sim.pump_setup``, ``sim.pump``,
``sim.journal``, ``sim.shaft``, ``sim.machine``, ``sim.fidelity``.
"""
