"""Clearance and wear-down of bearings from where the journal runs: the film inverted.

It may import ``sim.scene``, ``sim.bearing``, ``sim.shaft_films``, ``sim.shaft``.
"""
