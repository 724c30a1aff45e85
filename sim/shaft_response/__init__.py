"""Response of a rotor about its equilibrium: transfer functions, reduction to modes, time signals.

It may import ``sim.beam``.
"""
