"""
Force on the crank pin over a revolution
========================================

As new and worn: with clearance the pin is thrown across after the upper dead centre and ends in a
hard impact.
"""

import numpy as np
import wearstate
from matplotlib import pyplot as plt

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for clearance in ("0.08 mm", "0.30 mm"):
    changes = {"joint.crankpin.diametral_clearance": clearance, "duration": "1 s"}
    run = wearstate.simulate(wearstate.load_scene("bilge-pump", changes), truth=True)
    turns = run.truth["state_alpha"] / (2 * np.pi)
    one = (turns >= turns[0] + 1) & (turns < turns[0] + 2)
    force = np.hypot(*run.truth["pin_force_n"][one].T)
    axes.plot(360 * (turns[one] % 1), force / 1e3, ".", ms=2, label=clearance)
axes.set(xlabel="crank angle [deg]", ylabel="pin force [kN]")
axes.legend(title="diametral clearance")
