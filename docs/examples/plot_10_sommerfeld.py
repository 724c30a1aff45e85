"""
Eccentricity over the Sommerfeld number
=======================================

The usual design chart of bearings, computed for three lengths. A small Sommerfeld number means a
heavy load.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import film

ratios = np.linspace(0.1, 0.9, 9)
_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for length in (0.25, 0.5, 1.0):
    geometry = film.FilmGeometry(length_to_diameter=length, condition="reynolds")
    points = [film.at_eccentricity(geometry, e) for e in ratios]
    axes.semilogx([p.sommerfeld_number for p in points], ratios, "o-", label=f"L/D = {length}")
axes.set(xlabel="Sommerfeld number [-]", ylabel="eccentricity ratio [-]")
axes.legend()
