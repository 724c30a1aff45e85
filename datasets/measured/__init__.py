"""From measured files to a data set: labels, plan, rows, import.

It may import ``sim.atomic``, ``sim.output``, ``sim.parts``, ``sim.scene``, ``sim.wear``,
``features.rotation``, ``datasets.file``, ``datasets.workers``, ``datasets.source``,
``datasets.readers``, ``datasets.recipe``.
"""
