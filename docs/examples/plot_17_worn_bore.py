"""
Position of the journal in a worn bore
======================================

A scar in the shape of the shaft lowers the journal: eccentricity and attitude angle over the
load, round and worn.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import film

round_bore = film.FilmGeometry(length_to_diameter=0.5)
scar = film.dufrane_scar(0.3, 0.0, round_bore.n_theta)  # as deep as 0.3 C, under the load
worn = film.FilmGeometry(length_to_diameter=0.5, bore=scar)
loads = np.geomspace(0.05, 5, 10)

_, axes = plt.subplots(figsize=(5.5, 4.5), layout="constrained")
for name, geometry in (("round", round_bore), ("worn", worn)):
    places = np.array([film.equilibrium(geometry, (load, 0.0)).position for load in loads])
    axes.plot(places[:, 1], -places[:, 0], "o-", label=name)
axes.set(xlabel="across the load, over C [-]", ylabel="height, over C [-]", aspect="equal")
axes.legend()
