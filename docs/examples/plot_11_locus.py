"""
Path of the journal centre as the load grows
============================================

From the centre of an unloaded bearing to the wall under the load, along nearly half a circle.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import film

ratios = np.linspace(0.02, 0.95, 20)
axes = plt.figure(figsize=(5, 5), layout="constrained").add_subplot(projection="polar")
for length in (0.25, 1.0):
    geometry = film.FilmGeometry(length_to_diameter=length)
    points = [film.at_eccentricity(geometry, e) for e in ratios]
    axes.plot([p.attitude_angle for p in points], ratios, ".-", label=f"L/D = {length}")
axes.set_theta_zero_location("S")  # the load points down
axes.set(thetamin=-10, thetamax=100, rmax=1)
axes.legend(loc="upper right")
