"""Alignment of a shaft line: table, text, pictures, page, moves, films, margins, quiet running.

It may import ``sim.brief``, ``sim.scene``, ``sim.bearing``, ``sim.alignment``, ``sim.shaft_films``,
``sim.shaft_response``, ``sim.shaft``, ``diagnose.pages``, ``diagnose.shaft_tests``.
"""
