"""What is known of a machine beside its signals, and cautions that follow.

It may import ``sim.output``, ``sim.parts``, ``sim.scene``, ``datasets.file``, ``datasets.draws``,
``datasets.recipe``, ``diagnose.pages``, ``diagnose.machines``, ``diagnose.feature_rows``,
``diagnose.healthy_reference``, ``diagnose.film_clearance``.
"""
