"""Clearance and wear-down of bearings from where the journal runs: the film inverted.

It may import ``sim.parts``, ``sim.scene``, ``sim.film``, ``sim.bearing``, ``sim.shaft``.
"""
