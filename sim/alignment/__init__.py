"""What each bearing of a shaft line carries: alignment, load calibration, jacking.

It may import ``sim.brief``, ``sim.output``, ``sim.beam``.
"""
