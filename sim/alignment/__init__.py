"""What each bearing of a shaft line carries: alignment, load calibration, jacking.

It may import ``sim.beam``, ``sim.brief``.
"""
