"""Figures of a scene, a short run included, beside what is usual of such machines.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.film``, ``sim.bearing``,
``sim.beam``, ``sim.alignment``, ``sim.mechanism``, ``sim.pump_setup``, ``sim.pump``,
``sim.journal``, ``sim.shaft``, ``sim.machine``, ``sim.fidelity``.
"""
