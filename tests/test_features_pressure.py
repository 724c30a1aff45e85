"""Levels and transitions of a cylinder pressure against closed forms and a simulated chamber."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from wearstate.features.catalogue import needs
from wearstate.features.catalogue import row as table
from wearstate.features.rotation.pressure import mean_revolution, transitions
from wearstate.sim.hydraulics.parameters import hydraulic_parameters
from wearstate.sim.hydraulics.piston_pressure import two_level_pressure
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.sensor import low_pass, mounting_poles
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.pump_hydraulics import CylinderPressure

FS, SPEED = 25_600.0, 4.9  # a speed that does not repeat after whole samples
SUCTION, DISCHARGE = -0.3e5, 3e5
CUBIC = 1 - 2 * brentq(lambda u: u * u * (3 - 2 * u) - 0.1, 0, 0.5)  # 0.1 to 0.9, of its width
WIDE = {"rise_delay": 8.0, "rise_angle": 12.0, "fall_delay": 3.0, "fall_angle": 7.0}
SHARP = {"rise_delay": 0.0, "rise_angle": 1.0, "fall_delay": 11.0, "fall_angle": 1.0}


GRID = np.linspace(0, 1, 18_001)  # a fiftieth of a degree: linear between, 2e-4 of a change


def two_levels(phase, degrees):
    """The rung two-level at these phases [rev]."""
    angles = {name: math.radians(value) for name, value in degrees.items()}
    pressure = CylinderPressure(suction=SUCTION, discharge=DISCHARGE, **angles)
    h = hydraulic_parameters(pressure, area=1.0, crank_radius=0.05, rod_length=0.25, speed=30.0)[0]
    levels = [two_level_pressure(2 * np.pi * turn, SUCTION, DISCHARGE, h) for turn in GRID]
    return np.interp(phase % 1, GRID, levels)


def phases(revolutions=20.0):
    return np.arange(round(revolutions / SPEED * FS)) * SPEED / FS


def told(x, phase):
    return transitions(mean_revolution(x, phase))


@pytest.mark.parametrize("degrees", [WIDE, SHARP], ids=["wide", "sharp"])
@pytest.mark.parametrize("noise", [0.0, 5e3], ids=["quiet", "noisy"])
def test_two_levels_with_known_delay_and_width(degrees, noise):
    phase = phases()
    x = two_levels(phase, degrees) + noise * np.random.default_rng(3).standard_normal(phase.size)
    found = told(x, phase)
    # 145 samples in a cell of half a degree: noise of 420 Pa a cell, 180 cells to a level
    assert_allclose([found.suction, found.discharge], [SUCTION, DISCHARGE], atol=noise / 20 + 1e-6)
    rise = degrees["rise_delay"] + degrees["rise_angle"] / 2
    fall = degrees["fall_delay"] + degrees["fall_angle"] / 2
    # a cubic of 12 degrees climbs 41 kPa a degree: 420 Pa are 0.01; half a cell where it is sharp
    assert_allclose([found.rise, found.fall], [rise, fall], atol=0.06)
    widths = CUBIC * np.array([degrees["rise_angle"], degrees["fall_angle"]])
    # means over half a degree, and lines between them, widen what is 1 degree wide by half a cell
    assert_allclose([found.rise_width, found.fall_width], widths, atol=0.25)
    assert found.suction_ripple == pytest.approx(noise / math.sqrt(phase.size / 720), abs=60)


def test_a_line_delays_both_transitions_by_what_its_closed_form_says():
    """Second order: delay zeta / (pi f), spread of its own; both to be told from outside."""
    phase = phases()
    resonance, ratio = 400.0, 0.7
    x = low_pass(two_levels(phase, WIDE), FS, mounting_poles(resonance, ratio))
    before, after = told(two_levels(phase, WIDE), phase), told(x, phase)
    delay = 360 * SPEED * ratio / (math.pi * resonance)  # 0.98 degrees
    assert delay > 0.9
    # the line rings out within the transition: its median is its mean delay but for a tenth
    assert_allclose([after.rise - before.rise, after.fall - before.fall], delay, rtol=0.1)


def test_the_overshoot_of_a_line_is_no_second_rise():
    phase = phases()
    x = low_pass(two_levels(phase, SHARP), FS, mounting_poles(60.0, 0.1))
    found = told(x, phase)
    last = x[phase % 1 > 0.5]
    assert last.max() > DISCHARGE + 0.5 * (DISCHARGE - SUCTION)
    middle = (SUCTION + DISCHARGE) / 2
    assert np.count_nonzero((x[:-1] < middle) & (x[1:] >= middle)) > 30  # of 20 rises
    # of the undamped step, 1 - cos(2 pi f t), half is there after a sixth of the period: 4.9 deg
    assert_allclose([found.rise - 0.5, found.fall - 11.5], 360 * SPEED / 60 / 6, rtol=0.1)
    assert_allclose([found.suction, found.discharge], [SUCTION, DISCHARGE], atol=5e3)


def test_where_the_mark_is_does_not_change_levels_and_widths():
    phase = phases()
    x = two_levels(phase, WIDE)
    here = told(x, phase)
    for late in (0.01, 0.24, 0.52, 0.77, 0.98):
        there = told(x, phase - late)
        assert_allclose(there[:4], here[:4], atol=50.0)
        assert_allclose([there.rise_width, there.fall_width], [8 - 0.7, 4.26], atol=0.15)
        assert max(abs(there.rise), abs(there.fall)) <= 180
        turned = (np.array([here.rise - there.rise, here.fall - there.fall]) / 360 - late) % 1
        assert_allclose(np.minimum(turned, 1 - turned), 0, atol=2e-4)


@pytest.mark.parametrize("level", [0.0, 2.5e5])
def test_a_pressure_that_never_changes(level):
    phase = phases(3.0)
    found = told(np.full(phase.size, level), phase)
    assert found[:2] == (level, level)
    assert found[2:] == (0.0,) * 6


def test_few_samples_in_a_revolution():
    """Cells are never finer than samples; ten degrees are the coarsest."""
    slow = 40 * SPEED
    phase = np.arange(40 * 20) * SPEED / slow * 1.0003
    found = told(two_levels(phase, WIDE), phase)
    assert_allclose([found.rise, found.fall], [14.0, 6.5], atol=3.0)
    with pytest.raises(ValueError, match=r"samples in a revolution = 20 must be >= 36"):
        mean_revolution(np.zeros(200), np.arange(200) / 20)


def test_a_chamber_read_through_its_valves():
    """Against the chamber's own pressure over the crank angle, kept as truth."""
    overrides = {"pressure.rung": "chamber", "pressure.sensor.range": "20 bar"}
    overrides |= {"duration": "2.1 s", "pressure.sensor.noise": "1 kPa"}
    scene = load_scene("bilge-pump", overrides)
    run = simulate(scene, seed=5, truth=True)
    assert [channel.quantity for channel in run.channels][2:] == ["pressure", "tacho"]
    names, values = table.feature_row(
        run.signal[:3],
        run.sample_rate,
        tacho=run.signal[3],
        channel_names=["x", "y", "p"],
        quantities=["acceleration", "acceleration", "pressure"],
        only=["pressure_levels", "pressure_transitions"],
    )
    found = dict(zip(names, values, strict=True))
    turn = run.truth["state_alpha"] / (2 * np.pi) % 1
    truth = run.truth["cylinder_pressure_pa"]
    suction = np.median(truth[(turn > 0.15) & (turn < 0.35)])
    discharge = np.median(truth[(turn > 0.65) & (turn < 0.85)])
    middle = (suction + discharge) / 2
    rises = turn[:-1][(truth[:-1] < middle) & (truth[1:] >= middle) & (abs(turn[:-1] - 0.55) < 0.1)]
    falls = turn[:-1][(truth[:-1] >= middle) & (truth[1:] < middle) & (turn[:-1] < 0.2)]
    assert len(rises) >= 10
    assert len(falls) >= 10
    # windows of the level differ by a few degrees over which losses change by 2 kPa
    assert_allclose([found["p.suction"], found["p.discharge"]], [suction, discharge], atol=3e3)
    # half a cell of half a degree, and a sample of 0.07 degrees before the crossing
    assert found["p.rise_deg"] == pytest.approx(360 * rises.mean() - 180, abs=0.25)
    assert found["p.fall_deg"] == pytest.approx(360 * falls.mean(), abs=0.25)
    assert 5 < found["p.fall_deg"] < found["p.rise_deg"] < 15  # valves close late; air is squeezed


# --- in the row


KINDS = ("acceleration", "pressure")


def test_a_pressure_has_its_own_features_and_leaves_the_others_alone():
    phase = phases()
    rng = np.random.default_rng(0)
    x = rng.standard_normal(phase.size)
    tacho = np.where(phase % 1 < 0.03, 5.0, 0.0)
    p = two_levels(phase, WIDE)
    alone = table.feature_row(x[None], FS, tacho=tacho, channel_names=["a"])
    names, values = table.feature_row(
        np.stack([p, x]), FS, tacho=tacho, channel_names=["p", "a"], quantities=KINDS[::-1]
    )
    n = len(alone[0])
    assert names[:n] == alone[0]
    assert_allclose(values[:n], alone[1], rtol=0, atol=0)
    assert all(name.startswith("p.") for name in names[n:])
    assert dict(zip(names, values, strict=True))["p.rise_deg"] == pytest.approx(14.0, abs=0.1)
    assert names == table.feature_names(["p", "a"], FS, quantities=KINDS[::-1])


@pytest.mark.parametrize(
    ("kinds", "tacho", "pulses"),
    [(("pressure", "pressure"), True, 1), (KINDS, False, 1), (KINDS, True, 6)],
)
def test_without_crank_angle_or_vibration_a_pressure_is_a_signal(kinds, tacho, pulses):
    rates = {"tacho": tacho, "pulses_per_revolution": pulses}
    layout = needs.Layout(channels=("a", "p"), quantities=kinds, fs=FS, **rates)
    assert layout.pressures == ()
    absent = table.absent_features(layout)
    assert "cylinder pressures = 0 must be >= 1 beside" in absent["pressure_levels"]
    assert "p.rms" in table.feature_names(["a", "p"], FS, quantities=kinds, **rates)
