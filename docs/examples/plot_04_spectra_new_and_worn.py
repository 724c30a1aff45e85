"""
Spectra, as new and worn
========================

Impacts excite the casing modes: the worn pump vibrates more at all frequencies above a few hundred
hertz, most at its resonances.
"""

import wearstate
from matplotlib import pyplot as plt

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for clearance in ("0.08 mm", "0.30 mm"):
    changes = {"joint.crankpin.diametral_clearance": clearance, "duration": "2 s"}
    recording = wearstate.simulate(wearstate.load_scene("bilge-pump", changes), seed=1)
    found = wearstate.features.spectrum(recording, nperseg=4096)
    axes.semilogy(found.lines, found["acc_x"], lw=0.8, label=clearance)
axes.set(xlabel=found.axis, ylabel="acc_x [m/s^2], 6.25 Hz lines", xlim=(0, 12_800))
axes.legend(title="diametral clearance")
