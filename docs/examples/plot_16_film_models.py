"""
Error of the cheap film models
==============================

Load of the short, the long and the one-dimensional film over that of the film solved on a mesh,
at an eccentricity of 0.6.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import film

lengths = np.array([0.1, 0.2, 0.4, 0.8, 1.6, 3.2])
geometries = [film.FilmGeometry(length_to_diameter=each) for each in lengths]


def load(geometry, rung):
    return np.hypot(*film.at_eccentricity(geometry, 0.6, rung=rung).load)


_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for rung in ("short", "finite", "long"):
    error = [load(each, rung) / load(each, "direct") for each in geometries]
    axes.loglog(lengths, error, "o-", label=rung)
axes.axhline(1, color="black", lw=0.8)
axes.set(xlabel="length over diameter [-]", ylabel="load over that of the mesh [-]", ylim=(0.5, 20))
axes.legend()
