"""
Shaft speed without a tacho
===========================

The speed of a slow run-up from the harmonics in a vibration, with its uncertainty; synthetic.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import features

fs, rng = 2560.0, np.random.default_rng(0)
t = np.arange(int(8 * fs)) / fs
turns = 24 * t + 0.25 * t**2  # 24 to 28 rev/s
signal = sum(np.cos(2 * np.pi * k * turns) / k for k in (1, 2, 3, 5))
signal = signal + 0.5 * rng.standard_normal(t.size)
found = features.tacholess_speed(signal, fs, band_hz=(20.0, 32.0))

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.errorbar(found.times, found.speed_hz, 2 * found.deviation_hz, fmt=".", ms=4)
axes.plot(t, 24 + 0.5 * t, "k--", lw=0.8)
axes.set(xlabel="time [s]", ylabel="speed [rev/s]")
