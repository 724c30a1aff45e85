"""What the machine is: validated parts without physics, built-in scenes, plausibility checks.

It may import ``sim.output``.
"""
