"""
Pressure in an oil film
=======================

The film of a loaded journal, unrolled. Where the gap opens the oil ruptures and the pressure is
that of the surroundings.
"""

from matplotlib import pyplot as plt
from wearstate import film

geometry = film.FilmGeometry(length_to_diameter=0.5, n_theta=144, n_z=33)
found = film.at_eccentricity(geometry, 0.7)
_, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
image = axes.imshow(found.film.pressure.T, aspect="auto", extent=(0, 360, -0.5, 0.5))
axes.set(xlabel="angle from the eccentricity [deg]", ylabel="place over the length [-]")
axes.figure.colorbar(image, label="pressure over eta omega (R/C)^2 [-]")
