"""
A rolling bearing with a fault in its outer race
================================================

Synthetic: noise and a resonance excited at every passage of a roller. The envelope spectrum shows
the fault frequency and its harmonics (dashed).
"""

import numpy as np
from wearstate import features

fs, rng = 25_600.0, np.random.default_rng(1)
fault = features.bearing_frequencies(9, 0.0079, 0.0385, speed_hz=25.0).outer  # [Hz]
t = np.arange(int(2 * fs)) / fs
blows = np.diff(np.floor(fault * t), prepend=0.0)
ringing = np.exp(-1500 * t[:512]) * np.sin(2 * np.pi * 4000 * t[:512])
signal = np.convolve(blows, ringing)[: t.size] + 0.3 * rng.standard_normal(t.size)

axes = features.envelope_spectrum(signal, fs, band=(3000.0, 5000.0)).plot(high=500)
for harmonic in range(1, 5):
    axes[0].axvline(harmonic * fault, color="black", ls="--", lw=0.7)
