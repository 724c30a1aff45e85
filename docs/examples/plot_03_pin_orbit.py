"""
The pin in its clearance circle
===============================

The centre of the pin relative to that of its eye. It rests on one side, crosses, and strikes the
other; the tail outside the circle is the contact penetration.
"""

import numpy as np
import wearstate
from matplotlib import pyplot as plt

clearance = 0.25e-3  # [m], diametral
changes = {"joint.crankpin.diametral_clearance": clearance, "duration": "1 s"}
run = wearstate.simulate(wearstate.load_scene("bilge-pump", changes), truth=True)
x, y = 1e3 * run.truth["pin_offset_m"].T  # [mm]
angle = np.linspace(0, 2 * np.pi, 200)

_, axes = plt.subplots(figsize=(5, 5), layout="constrained")
axes.plot(500 * clearance * np.cos(angle), 500 * clearance * np.sin(angle), "k--", lw=0.8)
axes.plot(x, y, lw=0.6)
axes.set(xlabel="along the crank plane [mm]", ylabel="across [mm]", aspect="equal")
