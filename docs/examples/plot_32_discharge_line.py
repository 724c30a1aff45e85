"""
Pulsation in a discharge line, and a damper
===========================================

Ten metres of pipe behind a triplex pump: the pressure at its valves varies with the flow of all
throws and rings at the natural frequencies of the pipe. Two litres of gas at the valves damp it.
"""

import numpy as np
import wearstate
from matplotlib import pyplot as plt

lines = {
    "pressure.rung": "wave-lines",
    "pressure.suction_line": {"length": 1.0, "diameter": 0.05, "wave_speed": 1000.0},
    "pressure.discharge_line": {"length": 10.0, "diameter": 0.03, "wave_speed": 1300.0},
    "duration": "0.5 s",
}
damper = {"pressure.discharge_line.damper": {"gas_volume": 2e-3}}

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
swing = {}
for name, changes in {"bare pipe": lines, "with damper": lines | damper}.items():
    scene = wearstate.load_scene("triplex-pump", changes)
    truth = wearstate.simulate(scene, seed=1, truth=True).truth
    pressure = truth["discharge_line_pressure_pa"] / 1e6
    turns = (truth["state_alpha"] - truth["state_alpha"][0]) / (2 * np.pi)
    swing[name] = np.ptp(pressure)
    axes.plot(turns, pressure, lw=0.8, label=f"{name}: {swing[name]:.2f} MPa peak to peak")
axes.set(xlabel="crank revolutions", ylabel="gauge pressure at the valves [MPa]", xlim=(0, 2))
axes.set_title("discharge line of 10 m behind a triplex pump (simulated)")
axes.legend()
