"""Speed of a feature row. Results are asserted, times are only printed."""

import numpy as np
from wearstate.features.table import feature_row
from wearstate.sim.assemble import simulate
from wearstate.sim.scene import load_scene


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
