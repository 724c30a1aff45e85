"""
Speed at which a rigid rotor begins to whirl
============================================

Above the line a rotor on two such bearings whirls at about half its speed. The lines end at the
eccentricity above which a journal never whirls.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import film

ratios = np.linspace(0.05, 0.9, 18)
_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for length in (0.25, 0.5, 1.0):
    geometry = film.FilmGeometry(length_to_diameter=length)
    points = [film.at_eccentricity(geometry, e) for e in ratios]
    tables = [film.coefficients(p).per_load(np.hypot(*p.load)) for p in points]
    axes.plot(ratios, [film.stability(c).speed for c in tables], label=f"L/D = {length}")
axes.set(xlabel="eccentricity ratio [-]", ylabel="threshold, speed times sqrt(C / g) [-]")
axes.set_ylim(0, 10)
axes.legend()
