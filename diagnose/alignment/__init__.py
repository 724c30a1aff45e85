"""The alignment of a shaft line: table, text, pictures, page, moves, films, margins, quiet running.

It may import ``sim.scene``, ``sim.bearing``, ``sim.alignment``, ``sim.shaft``, ``diagnose.pages``,
``diagnose.shaft_tests``, ``sim.brief``.
"""
