"""Train and test splits: their rules, and splits stored in a file.

It may import ``sim.atomic``, ``sim.output``, ``datasets.file``, ``datasets.draws``,
``datasets.recipe``.
"""
