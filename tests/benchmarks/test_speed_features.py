"""Speed of a feature row. Results are asserted, times and ratios are printed.

The aims, of a record of 1 s and three channels at 25.6 kHz on one core: 15 ms for the core set,
60 ms for the complete one; 20 times TSFEL per sample; time linear in the length of the record.
"""

import time
from functools import partial

import numpy as np
import pytest
from wearstate.features.catalogue.analysis import Settings
from wearstate.features.catalogue.row import feature_row
from wearstate.features.signal.envelope import bearing_frequencies
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene

FS = 25_600.0
BEARING = bearing_frequencies(9, 0.3126, 1.537)
AIM_S = {"core": 0.015, "complete": 0.060}

KINDS = {
    "three accelerations": {},
    "and a tacho": {"tacho": True},
    "and bearing, machine, speed": {
        "tacho": True,
        "settings": Settings(bearing=BEARING, machine="pump-1-small", speed_hz=25.0),
    },
    "force and two responses": {"quantities": ("force", "acceleration", "acceleration")},
}


def record(duration=1.0):
    """Noise and orders of 25 rev/s on three channels, and a tacho."""
    n = round(duration * FS)
    phase = 0.3 + 25.0 * np.arange(n) / FS
    vibration = np.random.default_rng(0).normal(0, 0.2, (3, n))
    vibration += np.cos(2 * np.pi * phase) + 0.3 * np.cos(4 * np.pi * phase)
    return vibration.astype(np.float32), (5.0 * (phase % 1 < 0.1)).astype(np.float32)


def processor_time(function, repeats=25):
    """Least processor time of one call [s]: other programs count as little as may be."""
    function()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def row(signals, feature_set, *, tacho=False, **options):
    vibration, pulses = signals
    return feature_row(
        vibration, FS, tacho=pulses if tacho else None, feature_set=feature_set, **options
    )


def test_speed_of_a_feature_row(benchmark):
    solution = simulate(load_scene("bilge-pump"), seed=1)
    vibration, tacho = solution.signal[:2], solution.signal[2]
    names = ("acc_x", "acc_y")
    found, values = benchmark(
        feature_row, vibration, solution.sample_rate, tacho=tacho, channel_names=names
    )
    if benchmark.enabled:
        print(f"\n{1e3 * benchmark.stats.stats.median:.1f} ms for {len(values)} values")
    row = dict(zip(found, values, strict=True))
    # The tacho of a machine at constant speed gives that speed to a sample in 4.6 s.
    assert abs(row["shaft.speed_hz"] - 5.0) < 5e-5
    rms = vibration.std(axis=1, dtype=float)
    assert np.allclose([row["acc_x.rms"], row["acc_y.rms"]], rms, rtol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("feature_set", AIM_S)
def test_speed_of_the_sets(benchmark, feature_set, kind):
    signals = record()
    names, values = benchmark(row, signals, feature_set, **KINDS[kind])
    if benchmark.enabled:
        least = processor_time(lambda: row(signals, feature_set, **KINDS[kind]))
        share = least / AIM_S[feature_set]
        print(
            f"\n{feature_set}, {kind}: {1e3 * least:.1f} ms, {share:.2f} of the aim, "
            f"for {len(values)} values"
        )
    found = dict(zip(names, values, strict=True))
    assert found["ch_1.tone.frequency_hz"] == pytest.approx(25.0, abs=1e-3)
    assert ("ch_1.kurtogram.kurtosis" in found) == (feature_set == "complete")


def test_time_grows_with_the_length(benchmark):
    """Four times the record takes about four times as long, however long it is."""
    short, long = record(2.0), record(8.0)
    names, _ = benchmark(row, short, "complete", **KINDS["and a tacho"])
    if benchmark.enabled:
        times = [
            processor_time(partial(row, signals, "complete", tacho=True), repeats=9)
            for signals in (short, long)
        ]
        print(f"\n2 s: {1e3 * times[0]:.0f} ms, 8 s: {1e3 * times[1]:.0f} ms, ", end="")
        print(f"{times[1] / times[0]:.2f} times as long")
    assert names == row(long, "complete", **KINDS["and a tacho"])[0]


SAME = {
    "kurtosis": "Kurtosis",
    "peak_to_peak": "Peak to peak distance",
    "rms": "Root mean square",
    "skewness": "Skewness",
    "spectral_centroid": "Spectral centroid",
    "spectral_entropy": "Spectral entropy",
    "spectral_spread": "Spectral spread",
    "strongest_tone": "Fundamental frequency",
    "zero_crossing_rate": "Zero crossing rate",
}
"""Feature -> what TSFEL calls it."""


def test_against_tsfel(benchmark):
    """TSFEL's own row, and the features that both have, per sample."""
    tsfel = pytest.importorskip("tsfel")
    import pandas as pd

    signals = record()
    frame = pd.DataFrame(signals[0].T.astype(float))
    whole = tsfel.get_features_by_domain()
    shared = {
        domain: {name: entry for name, entry in entries.items() if name in SAME.values()}
        for domain, entries in whole.items()
    }

    def theirs(configuration):
        return tsfel.time_series_features_extractor(configuration, frame, fs=FS, verbose=0)

    both = tuple(SAME)
    names, values = benchmark(row, signals, "core", only=both)
    found, other = dict(zip(names, values, strict=True)), theirs(shared)
    # The same definition, in double precision there.
    for ours, name in (("kurtosis", "Kurtosis"), ("peak_to_peak", "Peak to peak distance")):
        excess = 3.0 if ours == "kurtosis" else 0.0
        assert found[f"ch_0.{ours}"] == pytest.approx(other[f"0_{name}"][0] + excess, rel=1e-5)
    if benchmark.enabled:
        for text, ours, configuration in (
            ("the whole core row against all of TSFEL", None, whole),
            (f"the {len(both)} features of both", both, shared),
        ):
            own = processor_time(lambda only=ours: row(signals, "core", only=only))
            rival = processor_time(lambda what=configuration: theirs(what), repeats=4)
            print(f"\n{text}: {1e3 * own:.2f} ms, {1e3 * rival:.0f} ms, {rival / own:.0f} times")


@pytest.mark.parametrize("only", [("frf_profile",), None], ids=["profile", "standard"])
def test_speed_of_a_test_with_two_forces(benchmark, only):
    """60 s at 2.56 kHz, two forces and four accelerations: at most 50 ms for the profile."""
    fs, n = 2560.0, 60 * 2560
    rng = np.random.default_rng(0)
    force = rng.standard_normal((2, n))
    gains = np.array([[1.0, 0.5], [0.2, 3.0], [-1.0, 1.0], [0.3, 0.1]])
    rows = np.vstack([force, gains @ force]).astype(np.float32)
    kinds = ("force",) * 2 + ("acceleration",) * 4
    names, values = benchmark(feature_row, rows, fs, quantities=kinds, only=only)
    if benchmark.enabled:
        least = processor_time(partial(feature_row, rows, fs, quantities=kinds, only=only))
        print(f"\n{1e3 * least:.1f} ms of 50 for {len(values)} values")
    found = dict(zip(names, values, strict=True))
    levels = [value for name, value in found.items() if name.startswith("ch_3_per_ch_1.frf.prof")]
    assert np.allclose(levels, 20 * np.log10(3.0), atol=1e-3)
