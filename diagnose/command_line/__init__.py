"""The command line: a file of commands for each topic, and its entry point.

It may import ``sim.atomic``, ``sim.parts``, ``sim.scene``, ``sim.machine``, ``sim.fidelity``,
``sim.deep_check``, ``features.catalogue``, ``datasets.file``, ``datasets.recipe``,
``datasets.split``, ``datasets.measured``, ``datasets.generation``, ``datasets.audit``,
``datasets.convert``, ``diagnose.pages``, ``diagnose.pictures``, ``diagnose.machines``,
``diagnose.learning``, ``diagnose.feature_rows``, ``diagnose.healthy_reference``,
``diagnose.wear_model``, ``diagnose.nameplate``, ``diagnose.twin``, ``diagnose.report``,
``diagnose.class_model``, ``diagnose.evaluation``, ``diagnose.blindspots``, ``diagnose.charts``,
``diagnose.stability``, ``diagnose.shaft_tests``, ``diagnose.alignment``, ``diagnose.literature``,
``diagnose.sweep``, ``diagnose.inspect``, ``diagnose.workflow``, ``diagnose.options``.
"""
