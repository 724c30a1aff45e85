"""Data sets converted into others: merged, or exported to other formats.

It may import ``sim.atomic``, ``sim.output``, ``datasets.file``, ``datasets.source``,
``datasets.measured``.
"""
