"""Response to a force: transfer functions, impact tests, modes.

It may import ``features.signal``.
"""
