"""Rotation: tacho, speed, orders, crank angle, orbit, cylinder pressure, balancing.

It may import ``features.signal``.
"""
