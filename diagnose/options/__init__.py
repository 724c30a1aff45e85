"""Shared by all commands: options, arguments, outputs, progress, help.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``datasets.workers``,
``datasets.source``, ``datasets.recipe``, ``datasets.measured``, ``diagnose.pages``,
``diagnose.wear_model``.
"""
