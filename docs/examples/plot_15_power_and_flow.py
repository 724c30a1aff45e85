"""
Power loss and oil flow of a bearing
====================================

A bearing of 100 mm at 1500 rpm under increasing load.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import film

bearing = film.JournalBearing(diameter=0.1, length=0.05, clearance=75e-6, viscosity=0.02)
loads = np.array([0.5, 1, 2, 4, 8])  # [kN]
points = [film.operate(bearing, speed=157.1, load=(0, -1e3 * load)) for load in loads]

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.plot(loads, [p.power_loss for p in points], "o-", label="power loss [W]")
axes.plot(loads, [1e6 * p.side_flow for p in points], "s-", label="side flow [ml/s]")
axes.plot(loads, [1e6 * p.least_film for p in points], "^-", label="thinnest film [um]")
axes.set(xlabel="load [kN]", yscale="log")
axes.legend()
