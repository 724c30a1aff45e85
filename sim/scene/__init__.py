"""What the machine is: validated parts without physics, built-in scenes, rungs, plausibility.

It may import ``sim.output``, ``sim.brief``.
"""
