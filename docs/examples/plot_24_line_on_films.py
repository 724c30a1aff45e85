"""
A shaft line on its oil films
=============================

Positions of the journals of a shaft rig in their bearings, from 60 to 480 rpm: the films lift them
and move them sideways.
"""

import numpy as np
import wearstate
from matplotlib import pyplot as plt

_, axes = plt.subplots(figsize=(6, 5), layout="constrained")
speeds = (60, 120, 240, 480)  # [rpm]
scenes = [wearstate.load_scene("shaft-rig", {"drive.speed": f"{rpm} rpm"}) for rpm in speeds]
films = [wearstate.shaft.shaft_state(scene).film for scene in scenes]
for i, bearing in enumerate(films[0].bearings):
    places = np.array([found.positions[i] for found in films]) / (bearing.bearing.clearance)
    axes.plot(places[:, 1], places[:, 0], "o-", label=bearing.name)
axes.set(xlabel="to the side, over C [-]", ylabel="up, over C [-]")
axes.legend()
