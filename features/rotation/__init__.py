"""Rotation: tacho, speed, orders, crank angle, orbit, cylinder pressure, balancing.

May import ``features.signal``.
"""
