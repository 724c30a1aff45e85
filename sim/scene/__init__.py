"""What the machine is: validated scenes without physics, built-in scenes, rungs, plausibility.

It may import ``sim.brief``, ``sim.output``, ``sim.parts``.
"""
