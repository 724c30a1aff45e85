"""Response to a force: transfer functions, impact tests, modes.

May import ``features.signal``.
"""
