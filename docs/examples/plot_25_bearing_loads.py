"""
Bearing loads of a shaft line and the effect of a move
======================================================

Reactions of a propulsion shaft, and their change when one bearing is raised by 0.1 mm: the
influence numbers of an alignment calculation.
"""

import numpy as np
import wearstate
from matplotlib import pyplot as plt
from wearstate import align

line = align.alignment_line(wearstate.load_scene("propulsion-shaft"))
loads = align.reactions(line).reactions / 1e3  # [kN]
change = align.influence(line)[:, 2] * 1e-4 / 1e3  # third bearing raised by 0.1 mm [kN]

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
places = np.arange(len(loads))
axes.bar(places - 0.2, loads, 0.4, label="as set")
axes.bar(places + 0.2, loads + change, 0.4, label=f"{line.names[2]} raised by 0.1 mm")
axes.set_xticks(places, line.names, rotation=20)
axes.set(ylabel="reaction [kN]")
axes.legend()
