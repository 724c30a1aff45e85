"""
Campbell diagram
================

Natural frequencies of a rotor over its speed: gyroscopic moments separate forward from backward
modes. Where a mode meets the dashed line, unbalance excites it.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import shaft

steel = {"young": 206e9, "shear_modulus": 79e9, "density": 7850.0}
bar = shaft.Section(length=1.5, outer_diameter=0.05, **steel)
disc = shaft.Disc(station=0.5, mass=40.0, polar_inertia=0.9, diametral_inertia=0.5)
beam = shaft.assemble_beam([bar], discs=[disc], longest_element=0.1, shear_coefficient="cowper")
spring = {"stiffness": np.diag([1e6, 1.5e6]), "damping": np.diag([200.0, 200.0])}
ends = [shaft.Support(name=n, station=s, **spring) for n, s in (("aft", 0.0), ("fore", 1.5))]
rotor = shaft.Rotor(beam=beam, supports=ends)

speeds = np.linspace(0, 600, 25)  # [rad/s]
found = shaft.campbell(rotor, speeds, count=6)
rpm = speeds * 60 / (2 * np.pi)
_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.plot(rpm, found.frequency_hz)
axes.plot(rpm, rpm / 60, "k--", lw=0.8)
axes.set(xlabel="speed [rpm]", ylabel="frequency [Hz]", ylim=(0, 150))
