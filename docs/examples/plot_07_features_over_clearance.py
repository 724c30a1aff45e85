"""
Features over clearance
=======================

Rms, kurtosis and crest factor of one machine as its clearance grows; each is divided by its value
as new. No single one suffices to estimate the wear.
"""

import wearstate
from matplotlib import pyplot as plt

wear = [0.08, 0.12, 0.16, 0.2, 0.25, 0.31]  # [mm]
scenes = [
    wearstate.load_scene(
        "bilge-pump", {"joint.crankpin.diametral_clearance": f"{c} mm", "duration": "2 s"}
    )
    for c in wear
]
recordings = [wearstate.simulate(scene, seed=1) for scene in scenes]
names = ["rms", "kurtosis", "crest_factor"]
table = wearstate.features.SignalFeatures(only=names).fit_transform(recordings)

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.plot(wear, table / table.iloc[0], "o-", label=list(table.columns))
axes.set(xlabel="diametral clearance [mm]", ylabel="over the value at 0.08 mm")
axes.legend()
