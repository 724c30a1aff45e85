"""
Stiffness and damping of an oil film
====================================

The eight coefficients over the eccentricity, in units of load over clearance. At small
eccentricities the two cross stiffnesses differ in sign, which makes rotors whirl.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import film

ratios = np.linspace(0.1, 0.9, 17)
geometry = film.FilmGeometry(length_to_diameter=0.5, condition="reynolds")
points = [film.at_eccentricity(geometry, e) for e in ratios]
tables = [film.coefficients(p).per_load(np.hypot(*p.load)) for p in points]

_, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for each, name in zip(axes, ("stiffness", "damping"), strict=True):
    values = np.array([getattr(table, name) for table in tables])
    for (i, k), axis in zip(np.ndindex(2, 2), ("xx", "xy", "yx", "yy"), strict=True):
        each.plot(ratios, values[:, i, k], label=axis)
    each.set(xlabel="eccentricity ratio [-]", ylabel=f"{name} [-]", ylim=(-10, 20))
    each.legend()
