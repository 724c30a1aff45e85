"""
Unbalance response through the critical speeds
==============================================

Vertical and horizontal motion of the disc due to 10 kg mm of unbalance: the bearings are stiffer
sideways, so there are two peaks.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import shaft

steel = {"young": 206e9, "shear_modulus": 79e9, "density": 7850.0}
bar = shaft.Section(length=1.5, outer_diameter=0.05, **steel)
disc = shaft.Disc(station=0.5, mass=40.0, polar_inertia=0.9, diametral_inertia=0.5)
beam = shaft.assemble_beam([bar], discs=[disc], longest_element=0.1, shear_coefficient="cowper")
spring = {"stiffness": np.diag([1e6, 1.5e6]), "damping": np.diag([2000.0, 2000.0])}
ends = [shaft.Support(name=n, station=s, **spring) for n, s in (("aft", 0.0), ("fore", 1.5))]
rotor = shaft.Rotor(beam=beam, supports=ends)

rpm = np.linspace(300, 3000, 400)
mass = shaft.Unbalance(station=0.5, moment=0.01)
motion = shaft.unbalance_response(rotor, rpm * 2 * np.pi / 60, [mass])
_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for name in ("y", "z"):
    axes.semilogy(rpm, 1e3 * np.abs(motion[:, rotor.dof(0.5, name)]), label=name)
axes.set(xlabel="speed [rpm]", ylabel="amplitude of the disc [mm]")
axes.legend()
