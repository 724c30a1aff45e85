"""
Which band shows the impacts
============================

Kurtosis of bands of many widths: the best band of a worn pump is that in which its impacts ring and
little else does.
"""

import wearstate
from matplotlib import pyplot as plt

changes = {"joint.crankpin.diametral_clearance": "0.25 mm", "duration": "1 s"}
recording = wearstate.simulate(wearstate.load_scene("bilge-pump", changes), seed=1)
found = wearstate.features.kurtogram(recording["acc_x"], recording.sample_rate)
low, high = found.band
image = found.image()

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
extent = (0, recording.sample_rate / 2e3, len(image), 0)
picture = axes.imshow(image, aspect="auto", extent=extent, interpolation="none")
axes.set(xlabel="frequency [kHz]", ylabel="row of the tree")
axes.set_title(f"largest kurtosis from {low / 1e3:.1f} to {high / 1e3:.1f} kHz")
axes.figure.colorbar(picture, label="kurtosis [-]")
