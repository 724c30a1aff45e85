"""Speed of one recording of the bilge pump. Results are asserted, times are only printed."""

import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import signal
from wearstate.sim.casing.decimation import decimate, decimation_filter, edge_samples
from wearstate.sim.machine.simulate import simulate, simulate_many
from wearstate.sim.output.status import Status
from wearstate.sim.scene.load import load_scene


def test_speed_of_the_low_pass_against_scipy(benchmark):
    """Two sensors, 4.8 s at 400 kHz down to 25 kHz; the opponent is ``scipy.signal.upfirdn``."""
    factor = 16
    means = np.random.default_rng(0).normal(size=(4_800 * 25 * factor, 2))
    begin = time.perf_counter()
    theirs = signal.upfirdn(decimation_filter(factor), means, down=factor, axis=0)
    took = time.perf_counter() - begin
    own = benchmark(decimate, means, factor)
    if benchmark.enabled:
        print(f"\nupfirdn takes {took / benchmark.stats.stats.min:.1f} times as long")
    edge = edge_samples(factor)
    assert_allclose(own, theirs[edge : edge + len(own)], atol=1e-13)


def test_speed_of_a_recording(benchmark):
    scene = load_scene("bilge-pump")
    if benchmark.enabled:
        simulate(scene, seed=0)  # compile, or read the cache
    result = benchmark(simulate, scene, seed=1)
    if benchmark.enabled:
        rate = scene.duration / benchmark.stats.stats.median
        print(f"\n{rate:.1f} simulated seconds per second on one core")
    assert result.status is Status.OK
    assert result.signal.shape == (3, 122_880)
    assert result.numerics["clipped_samples"] == 0
    rms = np.sqrt(np.mean(np.square(result.signal[:2], dtype=float), axis=1))
    # Reversals of a few kilonewtons within a contact time of 0.6 ms on 60 kg of casing, ten a
    # second: knocks of 50 m/s^2 for some 20 ms of each 100 give 5 to 25 m/s^2. A pump without
    # knocks has 0.5.
    assert np.all((rms > 5) & (rms < 25))


@pytest.mark.parametrize(
    "overrides",
    [{}, {"joint.wristpin.rung": "compliant"}, {"pressure.rung": "chamber"}],
    ids=["crank pin", "two pins", "valves"],
)
def test_speed_of_many_records(benchmark, overrides):
    """Thirty-two clearances side by side; the opponent is `simulate`, one after the other.

    Where nothing is timed the records are short: their bytes are all that is asked.
    """
    if not benchmark.enabled:
        overrides = {**overrides, "duration": "1 s"}
    clearances = [f"{0.05 + 0.01 * n} mm" for n in range(32)]
    path = "joint.crankpin.diametral_clearance"
    scenes = [load_scene("bilge-pump", {**overrides, path: each}) for each in clearances]
    jobs = [(scene, seed) for seed, scene in enumerate(scenes)]

    def together():
        return {number: recording.signal for number, recording in simulate_many(jobs)}

    if benchmark.enabled:
        together(), simulate(scenes[0], seed=0)  # compile, or read the cache
    begin = time.perf_counter()
    alone = [simulate(scene, seed=seed).signal for scene, seed in jobs[:8]]
    took = (time.perf_counter() - begin) / 8
    found = benchmark.pedantic(together, rounds=3)
    if benchmark.enabled:
        each = benchmark.stats.stats.min / len(jobs)
        print(
            f"\n{4.8 / each:.0f} simulated seconds per second, {took / each:.1f} times of one alone"
        )
    assert all(np.array_equal(found[n], signal) for n, signal in enumerate(alone))


@pytest.mark.parametrize(
    ("scene", "overrides"),
    [
        ("bilge-pump", {"pressure.rung": "chamber"}),
        ("bilge-pump", {"pressure.rung": "chamber", "joint.wristpin.rung": "compliant"}),
        ("triplex-pump", {}),
    ],
)
def test_speed_with_valves(benchmark, scene, overrides):
    """One throw with valves, eight casing modes; the same with two worn pins; three throws."""
    pump = load_scene(scene, overrides)
    if benchmark.enabled:
        simulate(pump, seed=0)  # compile, or read the cache
    result = benchmark(simulate, pump, seed=1)
    if benchmark.enabled:
        rate = pump.duration * len(pump.throws) / benchmark.stats.stats.median
        print(f"\n{rate:.1f} simulated throw-seconds per second on one core")
    assert result.status is Status.OK
    assert result.numerics["clipped_samples"] == 0
    assert result.numerics["cavitating_share"] == 0
    assert result.numerics["lift_left"] == 0
