"""
Accelerance of a shaft
======================

Result of an ideal shaker test with the force at the disc, measured there and at both ends.
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

hertz = np.linspace(2, 400, 800)
places = [(0.5, "y"), (0.0, "y"), (1.5, "y")]
found = shaft.accelerance(rotor, hertz, places, places[:1])
_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for (station, _), row in zip(places, found[:, :, 0].T, strict=True):
    axes.semilogy(hertz, np.abs(row), label=f"at {station} m")
axes.set(xlabel="frequency [Hz]", ylabel="acceleration over force [1/kg]")
axes.legend()
