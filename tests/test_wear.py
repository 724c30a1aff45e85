"""Archard wear: volume whatever the pressure, scars where the joint presses, rates of scenes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from wearstate.sim.bearing.operate import JournalBearing, operate
from wearstate.sim.film.solve import dufrane_scar
from wearstate.sim.journal.recording import film_geometry
from wearstate.sim.pump_setup.ideal_motion import ideal_motion
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError
from wearstate.sim.wear.archard import (
    dufrane_depth,
    dufrane_volume,
    scar_shape,
    sliding_work,
    wear_volume,
    widening,
)
from wearstate.sim.wear.rate import joint_wear, turning_wear

RADIUS, WIDTH = 0.03, 0.05
TURN = np.linspace(0, 2 * np.pi, 360, endpoint=False)

# -- volume -------------------------------------------------------------------------------------


def test_a_bush_under_steady_load_wears_by_rate_times_load_times_way():
    # PTFE bush on a steel pin of 19 mm at 30 rpm under 100 N, 21,400 turns
    speed = math.pi * 0.019 * 0.5
    seconds = 21_400 / 0.5
    work = sliding_work(np.full(1000, 100.0), np.full(1000, speed), seconds / 1000)
    volume = wear_volume(5.05e-4 * 1e-9, work)  # 5.05e-4 mm^3/(N m)
    assert volume * 1e9 == pytest.approx(5.05e-4 * 100 * math.pi * 0.019 * 21_400, rel=1e-12)
    assert 60 < volume * 1e9 < 70  # mm^3: a tenth of a gram, not ten


def test_a_rate_in_another_unit_is_refused():
    with pytest.raises(ValueError, match=r"wear_rate = 0.000505 m\^2/N must be .* 1e-9 m\^2/N"):
        wear_volume(5.05e-4, 1.0)
    with pytest.raises(ValueError, match=r"wear_rate = -1.0.*; work = nan N m"):
        wear_volume(-1.0, math.nan)
    with pytest.raises(ValueError, match="step = 0 s must be > 0"):
        sliding_work([1.0], [1.0], 0)


def test_work_counts_both_directions_of_force_and_slip():
    time = (np.arange(10_000) + 0.5) / 10_000
    work = sliding_work(np.cos(2 * np.pi * time), np.cos(2 * np.pi * time), 1e-4)
    assert work == pytest.approx(0.5, rel=1e-9)  # mean of cos^2; the midpoint rule is exact on it
    # forces that reverse faster than they slide still wear
    assert sliding_work(np.tile([1.0, -1.0], 50), np.ones(100), 0.01) == pytest.approx(1.0)


# -- scars --------------------------------------------------------------------------------------


@given(
    st.lists(
        st.tuples(st.floats(-20, 20), st.floats(0.01, 10)),
        min_size=1,
        max_size=30,
    ),
    st.floats(0.05, math.pi / 2),
)
def test_the_volume_does_not_depend_on_how_the_pressure_is_spread(loads, half_angle):
    direction, work = np.array(loads).T
    shape = scar_shape(direction, work, bed_half_angle=half_angle)
    assert shape.min() >= 0
    # depth times radius times width, summed over the circle: 1 but for rounding
    assert shape.sum() * 2 * np.pi / shape.size == pytest.approx(1, rel=1e-12)


def test_a_force_that_stays_wears_a_cosine():
    for n, bound in ((360, 1e-4), (720, 2.5e-5)):  # error falls as the square of the places
        angle = 2 * np.pi * np.arange(n) / n
        shape = scar_shape([1.0], [3.0], n_angles=n)
        expected = np.maximum(0, np.cos(angle - 1.0)) / 2
        inside = np.abs(np.angle(np.exp(1j * (angle - 1.0)))) < 1.5  # the kink itself is linear
        assert np.abs(shape - expected)[inside].max() < bound


def test_a_narrow_bed_wears_deeper_in_proportion():
    deep = [scar_shape([0.0], [1.0], bed_half_angle=half)[0] for half in (0.4, 0.8)]
    assert deep[0] / deep[1] == pytest.approx(2, rel=1e-3)  # places of 1 degree


def test_the_turning_part_wears_evenly_and_the_still_one_locally():
    # a pin turns under a force that is fixed in its eye: directions seen from each
    work = np.ones(360)
    on_pin, on_eye = scar_shape(-TURN, work), scar_shape(np.zeros(360), work)
    assert_allclose(on_pin, 1 / (2 * np.pi), rtol=1e-12)
    assert on_eye[0] == pytest.approx(0.5, rel=1e-4)  # of a cosine, places of 1 degree
    assert on_eye[90:271].max() < 1e-9
    even, local = (widening(shape, RADIUS, WIDTH) for shape in (on_pin, on_eye))
    assert even == pytest.approx(1 / (math.pi * RADIUS * WIDTH), rel=1e-12)
    assert local / even == pytest.approx(math.pi / 2, rel=1e-4)


def test_play_adds_up_over_opposite_scars():
    # the same volume, on one end of a diameter or shared by both
    ends = scar_shape([0.0, math.pi], [1.0, 3.0])
    one = scar_shape([0.0], [1.0])
    assert widening(ends, RADIUS, WIDTH) == pytest.approx(widening(one, RADIUS, WIDTH), rel=1e-12)
    crossed = scar_shape([0.0, math.pi / 2], [1.0, 1.0])
    assert widening(crossed, RADIUS, WIDTH) < 0.75 * widening(one, RADIUS, WIDTH)


def test_faults_of_a_scar_come_together():
    with pytest.raises(ValueError, match=r"work adds .*; bed_half_angle = 0 .*; n_angles = 4"):
        scar_shape([0.0], [0.0], bed_half_angle=0, n_angles=4)


# -- the shaft's own circle ---------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.01, 0.4, 1.0, 1.9])
def test_the_scar_of_a_shaft_has_the_volume_of_its_depth_profile(share):
    gap, n = 70e-6, 200_000
    profile = gap * dufrane_scar(share, 0.7, n)
    expected = profile.sum() * 2 * np.pi / n * RADIUS * WIDTH
    # the sum over a profile with kinks is off by the square of its step over the scar
    assert dufrane_volume(share * gap, gap, RADIUS, WIDTH) == pytest.approx(expected, rel=1e-7)


@given(st.floats(1e-9, 1.99))
def test_depth_and_volume_of_a_scar_are_inverse(share):
    gap = 70e-6
    volume = dufrane_volume(share * gap, gap, RADIUS, WIDTH)
    # rounding of sin(a) - a cos(a) at the end of its series, 0.03 rad
    assert dufrane_depth(volume, gap, RADIUS, WIDTH) == pytest.approx(share * gap, rel=1e-11)


def test_a_shallow_scar_grows_as_its_depth_to_three_halves():
    gap = 70e-6
    first, second = (dufrane_volume(share * gap, gap, RADIUS, WIDTH) for share in (1e-6, 4e-6))
    assert second / first == pytest.approx(8, rel=1e-5)


def test_a_scar_round_the_bore_is_refused():
    with pytest.raises(ValueError, match=r"depth = 0.00014 m must be >= 0 and < twice"):
        dufrane_volume(140e-6, 70e-6, RADIUS, WIDTH)
    with pytest.raises(ValueError, match=r"volume = 1 m\^3 must be"):
        dufrane_depth(1, 70e-6, RADIUS, WIDTH)


# -- joints of a pump ---------------------------------------------------------------------------

IDEAL = {"joint.crankpin.rung": "ideal"}


def mean_work(force, speed):
    return float(np.mean(np.abs(force * speed)))


def test_ideal_joints_wear_as_the_closed_form_says():
    scene = load_scene("bilge-pump", IDEAL)
    motion = ideal_motion(scene, np.linspace(0, 2 * np.pi, 20_000, endpoint=False))
    turning = 2 * np.pi * scene.drive.speed
    crank, wrist = scene.joint.crankpin, scene.joint.wristpin
    expected = {
        # sliding of pin in eye: the pin turns with the crank, the eye against beta
        "crankpin": mean_work(
            np.hypot(motion.pin_force_x, motion.pin_force_y),
            crank.pin_diameter / 2 * turning
            + (crank.pin_diameter / 2 + crank.clearance_radial) * motion.beta_rate,
        ),
        "wristpin": mean_work(
            np.hypot(motion.wrist_force_x, motion.wrist_force_y),
            (wrist.pin_diameter / 2 + wrist.clearance_radial) * motion.beta_rate,
        ),
        "guide": mean_work(motion.guide_force, motion.piston_velocity),
    }
    for joint, power in expected.items():
        # the ramps of the pressure between steps of 0.07 degrees
        assert joint_wear(scene, joint, revolutions=1).power == pytest.approx(power, rel=1e-4)


def test_a_narrow_clearance_wears_as_an_ideal_joint_does():
    close = load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.02 mm"})
    wide = load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.31 mm"})
    ideal = joint_wear(load_scene("bilge-pump", IDEAL), "crankpin").power
    # friction alone parts them: it turns the force by up to 0.05 rad and takes some of the load
    assert joint_wear(close, "crankpin", revolutions=3).power == pytest.approx(ideal, rel=0.003)
    # a knock has the impulse of the load that it catches: worn or new, the mean is the same
    assert joint_wear(wide, "crankpin", revolutions=3).power == pytest.approx(ideal, rel=0.02)


def test_twice_the_load_wears_twice_as_fast():
    base = load_scene("bilge-pump", IDEAL)
    doubled = load_scene(
        "bilge-pump",
        {
            **IDEAL,
            "rod.mass": 2 * base.rod.mass,
            "rod.inertia": 2 * base.rod.inertia,
            "piston.mass": 2 * base.piston.mass,
            "pressure.suction": 2 * base.pressure.suction,
            "pressure.discharge": 2 * base.pressure.discharge,
        },
    )
    for joint in ("crankpin", "wristpin", "guide"):
        once, twice = (joint_wear(s, joint, revolutions=1).power for s in (base, doubled))
        assert twice == pytest.approx(2 * once, rel=1e-10)  # linear: rounding only


def test_an_eye_wears_where_the_thrust_presses_and_the_pin_all_round():
    found = joint_wear(load_scene("bilge-pump"), "crankpin", revolutions=4)
    assert abs(int(found.eye.argmax()) - 180) < 10  # on the rod's side
    pushed = scar_shape([math.pi], [1.0])
    # nearly all of it in one bed; what inertia pulls at the far end counts for the play as well
    assert widening(found.eye, RADIUS, WIDTH) > 0.97 * widening(pushed, RADIUS, WIDTH)
    assert found.eye[150:210].sum() > 4 * found.eye[[*range(30), *range(330, 360)]].sum()
    # the pin turns under the thrust, which lasts for half a turn: worn all round, most on one side
    assert 0 < found.pin.min() < found.pin.max() < 0.75 * found.eye.max()
    assert widening(found.pin, RADIUS, WIDTH) < 0.85 * widening(found.eye, RADIUS, WIDTH)
    assert found.per_revolution.sum() / 4 == pytest.approx(found.power / 5.0, rel=1e-9)  # 5 rev/s


def test_a_throw_is_its_own_whatever_its_phase():
    changes = {**IDEAL, "throws": [{"phase": "0 deg"}, {"phase": "120 deg"}]}
    scene = load_scene("bilge-pump", changes)
    first, second = (joint_wear(scene, "crankpin", throw=k, revolutions=2) for k in (0, 1))
    # the start lies 120 degrees apart: steps meet the ramps of the pressure elsewhere
    assert second.power == pytest.approx(first.power, rel=1e-4)
    assert_allclose(second.pin, first.pin, atol=1e-4)


def test_an_unknown_joint_is_named():
    with pytest.raises(SceneError, match=r"joint = 'crank' is no joint of a pump.*'crankpin'"):
        joint_wear(load_scene("bilge-pump"), "crank")


# -- a journal bearing --------------------------------------------------------------------------


def turned(film="2 um", **changes):
    scene = load_scene("journal-bearing", {"film.rung": "direct", **changes})
    return turning_wear(scene, speed=0.05, least_film=float(film.split()[0]) * 1e-6), scene


@pytest.mark.parametrize("depth", ["0 mm", "0.02 mm"])
def test_at_lift_off_the_film_is_as_thin_as_told(depth):
    found, scene = turned(**{"bearing.scar_depth": depth, "film.n_theta": 360})
    bearing = JournalBearing(
        diameter=scene.bearing.diameter,
        length=scene.bearing.length,
        clearance=scene.bearing.clearance_radial,
        viscosity=scene.oil.dynamic_viscosity,
        film=film_geometry(scene),
    )
    load = scene.rotor.mass * scene.gravity + scene.load.static
    point = operate(bearing, speed=2 * np.pi * found.lift_off_hz, load=[load, 0.0])
    # the speed is sought to 1e-5, the film follows it nearly in proportion
    assert point.least_film == pytest.approx(2e-6, rel=1e-4)
    assert found.boundary_share == pytest.approx(1 - 0.05 / found.lift_off_hz)
    sliding = np.pi * scene.bearing.diameter * 0.05
    assert found.power == pytest.approx(found.boundary_share * load * sliding, rel=1e-12)


def test_twice_the_viscosity_lifts_off_at_half_the_speed():
    thin, thick = (turned(**{"oil.viscosity": f"{eta} mPa s"})[0] for eta in (30, 60))
    # only their product enters; the root is sought to 1e-5
    assert thick.lift_off_hz == pytest.approx(thin.lift_off_hz / 2, rel=1e-4)


def test_above_lift_off_nothing_wears():
    scene = load_scene("journal-bearing")
    assert turning_wear(scene, speed=1.0, least_film=2e-6).power == 0


def test_faults_of_the_turning_gear_come_together():
    scene = load_scene("journal-bearing")
    with pytest.raises(SceneError, match=r"speed = 0 rev/s(.|\n)*least_film = 0.001 m must be"):
        turning_wear(scene, speed=0.0, least_film=1e-3)
    with pytest.raises(SceneError, match=r"must be the film of a speed between 0.001 and 100"):
        turning_wear(scene, speed=0.05, least_film=69e-6)
