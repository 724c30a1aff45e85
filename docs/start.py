"""From a simulated machine to a verdict, in Python: run it in an empty folder, half a minute."""

import numpy as np
import wearstate
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

# A pump whose crank pin has worn to 0.25 mm of clearance: what its sensors record.
pump = wearstate.load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.25 mm"})
recording = wearstate.simulate(pump, seed=1, truth=True)
recording.plot()[0].figure.savefig("recording.png")
print(recording, f"largest pin force {np.abs(recording.truth['pin_force_n']).max():.0f} N")

# Forty records of twenty different pumps; scikit-learn estimates the clearance from features.
wearstate.generate("bilge-pump-small", 40, "pump.h5", seed=0, force=True)
with wearstate.DataSet("pump.h5") as data:
    clearance = 1e3 * data.manifest["diametral_clearance_crankpin_m"].to_numpy()  # [mm]
    steps = make_pipeline(wearstate.features.SignalFeatures(), StandardScaler(), Ridge())
    choices = {"signalfeatures__only": [["rms"], ["rms", "kurtosis", "band_levels"]]}
    apart = GroupKFold(4).split(data, groups=data.manifest["group"])  # whole machines held out
    search = GridSearchCV(steps, choices, cv=list(apart), scoring="neg_mean_absolute_error")
    search.fit(data, clearance)
print(f"{search.best_params_}, mean error {-search.best_score_:.3f} mm")

# The model of this package adds an interval, a grade, and a test whether the machine is familiar.
model = wearstate.train("pump.h5", seed=0)
report = wearstate.report(recording, model)
print(report)
report.save("report.html", force=True)
