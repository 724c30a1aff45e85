"""Known data of a machine and its operation, and the cautions that follow from them.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``datasets.file``, ``datasets.draws``,
``datasets.recipe``, ``diagnose.pages``, ``diagnose.machines``, ``diagnose.feature_rows``,
``diagnose.healthy_reference``, ``diagnose.film_clearance``.
"""
