"""
A journal under a step of load
==============================

Released at the centre of its bearing, the journal settles; after the load step it moves to a second
equilibrium.
"""

import wearstate
from matplotlib import pyplot as plt

run = wearstate.simulate("journal-step", truth=True)
x, y = 1e6 * run.truth["journal_m"].T  # [um]
_, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
axes[0].plot(x, y, lw=0.8)
axes[0].set(xlabel="x [um]", ylabel="y [um]", aspect="equal")
axes[1].plot(run.time, 1e6 * run.truth["min_film_m"])
axes[1].set(xlabel="time [s]", ylabel="thinnest film [um]")
