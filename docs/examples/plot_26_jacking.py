"""
A jacking test
==============

Load on a jack over its lift. The second line, after the bearing is free, extrapolated to zero lift,
gives the reaction.
"""

import numpy as np
import wearstate
from matplotlib import pyplot as plt
from wearstate import align

line = align.alignment_line(wearstate.load_scene("propulsion-shaft"))
found = align.jacking(line, line.names[2])
_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.plot(1e3 * found.lifts, found.loads / 1e3, "o", ms=3)
free = np.array([0, found.lifts[-1]])
axes.plot(1e3 * free, (found.zero_load + found.second_slope * free) / 1e3, "--")
axes.set(xlabel="lift [mm]", ylabel="load on the jack [kN]")
axes.set_title(f"estimated {found.estimate / 1e3:.1f} kN, true {found.reaction / 1e3:.1f} kN")
