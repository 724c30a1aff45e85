"""Physics of each machine, and the functions common to all: recording, transfer functions.

It may import ``sim.output``, ``sim.scene``, ``sim.pump``, ``sim.pump_lanes``, ``sim.journal``,
``sim.shaft_response``, ``sim.shaft``.
"""
