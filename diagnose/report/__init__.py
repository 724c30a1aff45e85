"""The verdict on recordings: advice, trend, text and page.

It may import ``sim.output``, ``sim.scene``, ``sim.bearing``, ``sim.journal``, ``features.signal``,
``datasets.file``, ``datasets.source``, ``datasets.readers``, ``datasets.measured``,
``diagnose.pages``, ``diagnose.pictures``, ``diagnose.learning``, ``diagnose.feature_rows``,
``diagnose.healthy_reference``, ``diagnose.wear_model``, ``diagnose.film_clearance``,
``diagnose.nameplate``, ``diagnose.twin``.
"""
