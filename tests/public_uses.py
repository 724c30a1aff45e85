"""Right and wrong uses of the public names, as mypy must see them; tests/test_public.py runs it.

A comment ``# error: CODE`` is the error that the line must have; no other line may have one.
"""

from pathlib import Path

import numpy as np
import wearstate
from numpy.typing import NDArray

scene: wearstate.Scene = wearstate.load_scene("bilge-pump", {"duration": "1 s"})
recording: wearstate.Recording = wearstate.simulate(scene, seed=1, truth=True)
time: NDArray[np.float64] = recording.time
acceleration: NDArray[np.float32] = recording["acc_x"]
also: wearstate.Recording = wearstate.simulate("bilge-pump")
names, values = wearstate.feature_row(recording)
first: str = names[0]
wearstate.feature_row(acceleration, 25_600.0, channel_names=["acc_x"])
measured = wearstate.read_recording(Path("pump.wav"), wearstate.SourceOptions(unit="g"))
length: float = measured.duration
with wearstate.DataSet("data.h5") as data:
    record: wearstate.Recording = data[0]
estimate = wearstate.load_model("model.wsm").estimate(record)
low: float | None = estimate.low
spectrum: wearstate.features.Spectrum = wearstate.features.spectrum(recording)
x_axis: NDArray[np.float64] = wearstate.features.orbit(acceleration, 25_600.0).path.real
table = wearstate.features.SignalFeatures(only=["rms"]).fit_transform([recording])
bearing = wearstate.film.JournalBearing(diameter=0.1, length=0.05, clearance=1e-4, viscosity=0.02)
ratio: float = wearstate.film.operate(bearing, speed=50.0, load=(0.0, -1e3)).eccentricity_ratio
model: wearstate.WearModel = wearstate.train("data.h5", seed=1)
limit: float = model.card.condemning_limit_m
records: int = model.card.trained_on.records
page: str = wearstate.report(recording, model).html()
wearstate.report(acceleration, model, fs=25_600.0).plot()
text: str = wearstate.evaluate(model, "data.h5", quick=True).text
verdict: str = wearstate.align.align(scene).verdict

wearstate.simulat(scene, seed=1)  # error: attr-defined
wearstate.simulate(scene, sed=1)  # error: call-arg
wearstate.simulate(scene, seed="1")  # error: arg-type
wearstate.simulate(1)  # error: arg-type
print(wearstate.simulate(scene).signals)  # error: attr-defined
wearstate.load_scene("bilge-pump").duration = 2.0  # error: misc
wearstate.features.spectrums(recording)  # error: attr-defined
wearstate.film.operate(bearing, speed="50")  # error: arg-type
grade: str = estimate.grade  # error: assignment
print(model.card.limit)  # error: attr-defined
wearstate.report(acceleration, model, fs="25.6 kHz")  # error: arg-type
print(model.card["severity"])  # error: index
print(model.card.trained_on.recipee)  # error: attr-defined
model.card.mode = "cold"  # error: misc
