"""Clearance and wear-down of bearings from the journal position, by inverting the film model.

It may import ``sim.scene``, ``sim.bearing``, ``sim.shaft_films``, ``sim.shaft``.
"""
