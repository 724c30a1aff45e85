"""The propulsion shaft: beam and oil films solved together, its response, its recording.

It may import ``sim.output``, ``sim.scene``, ``sim.film``, ``sim.bearing``, ``sim.excitation``,
``sim.beam``, ``sim.alignment``, ``sim.journal``, ``sim.brief``.
"""
