"""What each machine registers, and what is asked of any: a recording, transfer functions.

It may import ``sim.output``, ``sim.scene``, ``sim.pump``, ``sim.pump_lanes``, ``sim.journal``,
``sim.shaft_response``, ``sim.shaft``.
"""
