"""A tacho whose edges are averaged and a logic level sampled as it is tell the same shaft."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.features.catalogue.row import feature_row
from wearstate.features.rotation.edges import is_logic_level, smoothest
from wearstate.features.rotation.order import pulse_times, shaft_phase
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.sensor import tacho_pulses
from wearstate.sim.scene.load import load_scene

WIDTH = 1 / 36
LOUD = (
    *(f"{probe}.order_0{k}.level_db" for probe in "xy" for k in (1, 2, 3)),
    *(f"orbit.order_1.{part}" for part in ("major_db", "forward_db", "ellipticity")),
    "orbit.order_1.inclination_cos",
    "orbit.order_1.inclination_sin",
    "orbit.mark_cos",
    "orbit.mark_sin",
)
"""Features by the phase of the shaft that stand 40 dB above the noise, or follow from those."""


def turns(speed, fs=5120.0, n=2458, start=0.321, rise=0.0):
    time = np.arange(n) / fs
    return start + speed * time + 0.5 * rise * time**2


def crossings(revolutions):
    """Samples at which whole revolutions begin, by the angle itself."""
    whole = np.arange(np.ceil(revolutions[0]), revolutions[-1])
    return np.interp(whole, revolutions, np.arange(revolutions.size))


def logic(revolutions):
    return np.where(revolutions % 1 < WIDTH, 5.0, 0.0)


SPEEDS = (42.5, 47.31, 50.0, 53.07)


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("rise", [0.0, 3.0])
def test_both_kinds_lie_where_the_angle_does(speed, rise):
    angle = turns(speed, rise=rise)
    truth = crossings(angle)
    averaged = pulse_times(tacho_pulses(angle, pulse_width=WIDTH, level=5.0), 1.0)
    sampled = pulse_times(logic(angle), 1.0)
    assert_allclose(averaged, truth, atol=1e-3)  # of float32, and speed that changes in a sample
    # a pulse alone scatters by 0.29 sample; a parabola through 20 by three times 0.29 / sqrt(20) at
    # its ends, of which twice is allowed
    assert_allclose(sampled, truth, atol=0.39)
    assert np.std(sampled - truth) < 0.29 / 2  # three parameters of 20 pulses: sqrt(3 / 20) = 0.39
    assert abs(np.mean(sampled - truth)) < 0.13


def test_no_edge_is_moved_out_of_its_sample_however_the_speed_jumps():
    rng = np.random.default_rng(2)
    truth = np.cumsum(100 + rng.uniform(-8, 8, 60))
    sampled = np.ceil(truth) - 0.5
    assert abs(smoothest(sampled) - sampled).max() <= 0.5 + 1 / np.sqrt(60)
    assert np.all(np.diff(smoothest(sampled)) > 0)


def test_few_edges_stay_as_they_are():
    edges = np.array([3.5, 105.5, 208.5, 310.5])
    assert np.array_equal(smoothest(edges), edges)


def test_an_averaged_tacho_is_not_taken_for_a_logic_level():
    for speed in SPEEDS:
        volts = tacho_pulses(turns(speed), pulse_width=WIDTH, level=5.0).astype(float)
        before = np.flatnonzero((volts[:-1] < 2.5) & (volts[1:] >= 2.5))
        exact = len(set(np.round((crossings(turns(speed)) - 0.5) % 1, 6))) == 1
        assert is_logic_level(volts[before], volts[before + 1], 5.0) is exact


@pytest.fixture(scope="module")
def record():
    scene = load_scene("journal-bearing", {"drive.speed": "2913 rpm", "film.rung": "short"})
    return scene, simulate(scene, seed=3, truth=True)


def test_features_of_one_record_do_not_depend_on_the_kind_of_its_tacho(record):
    scene, solution = record
    revolutions = solution.truth["state_angle"] / (2 * np.pi)
    probes = solution.signal[:2].astype(float)
    sampled = np.where(revolutions % 1 < scene.tacho.pulse_width / (2 * np.pi), 5.0, 0.0)
    (names, one), (_, other) = (
        feature_row(
            probes,
            scene.sample_rate,
            tacho=tacho,
            channel_names=("x", "y"),
            quantities=("displacement", "displacement"),
            feature_set="standard",
        )
        for tacho in (solution.signal[2], sampled)
    )
    averaged = dict(zip(names, one, strict=True))
    logic_level = dict(zip(names, other, strict=True))
    speed = "shaft.speed_hz"
    assert averaged[speed] == pytest.approx(scene.drive.speed, rel=1e-4)
    assert logic_level[speed] == pytest.approx(scene.drive.speed, rel=1e-4)
    # at a constant speed neither tells what single samples could make: a model sees the same
    assert averaged["shaft.speed_variation"] == logic_level["shaft.speed_variation"] == 0
    # what stands 40 dB above the noise: first orders and the orbit
    for name in LOUD:
        assert logic_level[name] == pytest.approx(averaged[name], abs=0.02), name
    phases = [
        shaft_phase(pulse_times(t, scene.sample_rate), probes.shape[1], scene.sample_rate)
        for t in (solution.signal[2], sampled)
    ]
    assert abs(np.mean(phases[0] - phases[1])) < 0.1 * scene.drive.speed / scene.sample_rate


def test_a_speed_that_does_vary_is_told_by_both_kinds():
    """A swing of 2 % once in 2 s: the intervals scatter by its rms, five times what is not told."""
    t = np.arange(20_480) / 5120.0
    angle = 0.3 + 25.0 * t + 25.0 * 0.02 / np.pi * np.sin(np.pi * t)
    for tacho in (logic(angle), tacho_pulses(angle, pulse_width=1 / 36, level=5.0)):
        _, [found] = feature_row(
            np.random.default_rng(0).standard_normal((1, t.size)),
            5120.0,
            tacho=tacho,
            only=["speed_variation"],
        )
        assert found == pytest.approx(0.02 / np.sqrt(2), rel=0.05)
