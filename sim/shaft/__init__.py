"""The propulsion shaft: from its scene to beam and forces, its state at rest, its recording.

It may import ``sim.brief``, ``sim.output``, ``sim.scene``, ``sim.film``, ``sim.bearing``,
``sim.excitation``, ``sim.beam``, ``sim.alignment``, ``sim.journal``, ``sim.shaft_films``,
``sim.shaft_response``.
"""
