"""
Forces of a slider-crank without clearance
==========================================

Inverse dynamics in closed form: the force of the rod on the crank pin, at three speeds.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import crank

angle = np.linspace(0, 2 * np.pi, 361)
pump = {"crank_radius": 0.05, "rod_length": 0.25, "rod_mass": 3.0, "rod_centre": 0.165}
pump |= {"rod_inertia": 0.025, "piston_mass": 6.0, "gravity_y": 9.81}
pressure = np.where(np.sin(angle) > 0, -240.0, 2400.0)  # suction, then discharge [N]

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for rpm in (150, 300, 450):
    speed = rpm * 2 * np.pi / 60
    found = crank.ideal_crank(angle, speed=speed, piston_force=pressure, **pump)
    axes.plot(np.degrees(angle), found.pin_force_x, label=f"{rpm} rpm")
axes.set(xlabel="crank angle [deg]", ylabel="pin force along the stroke [N]")
axes.legend()
