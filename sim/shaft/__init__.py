"""The propulsion shaft: beam and forces of a scene, its equilibrium, its recording.

It may import ``sim.brief``, ``sim.output``, ``sim.scene``, ``sim.film``, ``sim.bearing``,
``sim.excitation``, ``sim.beam``, ``sim.alignment``, ``sim.journal``, ``sim.shaft_films``,
``sim.shaft_response``.
"""
