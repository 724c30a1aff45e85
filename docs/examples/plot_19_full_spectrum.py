"""
Full spectrum of a whirling journal
===================================

Forward motion is at positive frequencies, backward motion at negative ones. Whirl is forward,
near half the shaft speed.
"""

import numpy as np
import wearstate
from matplotlib import pyplot as plt

recording = wearstate.simulate("journal-whirl", seed=1)
path = wearstate.features.orbit(recording).path
frequency, vector = wearstate.features.full_spectrum(path, recording.sample_rate)
orders = frequency / recording.declared_speed_hz

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.semilogy(orders, 1e6 * np.abs(vector))
axes.set(xlim=(-2, 2), ylim=(1e-3, None), xlabel="order [-]", ylabel="amplitude [um]")
