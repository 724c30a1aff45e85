"""A hull that shakes the pedestals of a line, and films that are warmer than the oil."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse.linalg import spsolve
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError
from wearstate.sim.shaft.at_rest import film_bearings, shaft_state
from wearstate.sim.shaft.hull import hull_forces
from wearstate.sim.shaft_response.time_response import harmonic_response

SPEED = 2e-3  # m/s, of the hull
NO_SHAFT_DAMPING = {"shaft.damping_ratio": 0.0}  # which holds the shaft to a ground that stands
NAMES = [bearing.name for bearing in load_scene("propulsion-shaft").bearings]


def ship(values):
    return load_scene("propulsion-shaft", values)


def answer(scene, axis):
    """Displacement of journals and housings under the hull's only tone [shape=(2, 5)], rotor."""
    state = shaft_state(scene)
    places = [(name, axis, part) for part in ("shaft", "housing") for name in NAMES]
    turning = state.film.speed
    found = harmonic_response(state.rotor, hull_forces(scene), places, speed=turning)
    return found.reshape(-1, 2, 5)[0], state.rotor, turning


@pytest.mark.parametrize(("axis", "key"), [("y", "up"), ("z", "side")])
def test_the_line_moves_as_its_inertia_asks_in_a_frame_that_shakes(axis, key):
    """By d'Alembert: in the frame of an even hull, masses are pushed and no pedestal is."""
    scene = ship({f"hull.blade_tones.1.{key}": SPEED, **NO_SHAFT_DAMPING})
    found, rotor, turning = answer(scene, axis)
    omega = math.tau * 8 * scene.drive.speed
    moved = np.zeros(rotor.n_dof)
    moved[[rotor.dof(float(station), axis) for station in rotor.beam.stations]] = 1.0
    moved[[rotor.dof(name, axis, "housing") for name in NAMES]] = 1.0
    base = SPEED / (1j * omega)
    whole = rotor.stiffness - omega**2 * rotor.mass + 1j * omega * rotor.damping(turning)
    within = spsolve(whole.tocsc(), omega**2 * base * (rotor.mass @ moved).astype(complex))
    rows = [[rotor.dof(name, axis, part) for name in NAMES] for part in ("shaft", "housing")]
    # two ways through the same matrices: rounding times their condition
    assert_allclose(found, base + within[np.array(rows)], rtol=1e-9)


def test_a_slow_hull_takes_everything_with_it():
    slow = {
        "hull.engines.0.speed": "0.1 Hz",
        "hull.engines.0.tones.1.up": SPEED,
        **NO_SHAFT_DAMPING,
    }
    found, _, _ = answer(ship(slow), "y")
    # inertia moves it by the square of 0.1 Hz over 20 Hz, the line's lowest, films by the rest
    assert_allclose(found, SPEED / (math.tau * 0.1j), rtol=1e-4)


def test_on_stiff_pedestals_housings_have_their_share_of_the_hull():
    stiff = {f"bearings.{i}.housing.stiffness_up": 1e12 for i in range(5)}  # N/m
    shares = (1, 0.5, 0, -0.5, 2)
    shaken = {f"bearings.{i}.housing.hull_share_up": share for i, share in enumerate(shares)}
    found, _, _ = answer(ship({"hull.blade_tones.0.up": SPEED, **stiff, **shaken}), "y")
    moved = SPEED / (math.tau * 20j)
    # films and masses push a pedestal of 1e12 N/m by some 1e9 N/m: a thousandth of the motion
    assert_allclose(found[1], np.array(shares) * moved, atol=2e-3 * abs(moved))


def test_a_hull_at_rest_leaves_every_bit():
    bare = {"hull.blade_tones": [], "hull.engines": []}
    still = {
        "hull.blade_tones.0.up_phase": "40 deg",
        "hull.engines.0.speed": "610 rpm",
        "bearings.2.housing.hull_share_up": 0.3,
    }
    plain, phased = (simulate(ship(each), seed=2).signal for each in (bare, still))
    assert_array_equal(plain, phased)


def test_blade_tones_turn_with_the_shaft_and_engines_keep_their_own_time():
    tones = {"hull.blade_tones.0.up": SPEED, "hull.engines.1.tones.3.up": SPEED}
    at_0, at_30 = (
        hull_forces(ship({"drive.start_angle": angle, **tones})) for angle in ("0 deg", "30 deg")
    )
    place = ("stern_aft", "y", "housing")
    turned = [b.forces[place] / a.forces[place] for a, b in zip(at_0, at_30, strict=True)]
    assert_allclose(turned, [np.exp(4j * np.pi / 6), 1.0], rtol=1e-12)
    assert_allclose([each.frequency for each in at_0], [20.0, 30.0])


def test_an_accelerometer_hears_the_hull_as_the_response_says():
    quiet = {"sensors.2.noise": 0.0}
    plain = simulate(ship(quiet), seed=4)
    scene = ship({**quiet, "hull.engines.0.tones.4.up": SPEED})
    heard = simulate(scene, seed=4)
    more = (heard.signal[2] - plain.signal[2]).astype(float)
    found, _, _ = answer(scene, "y")
    expected = (math.tau * 36.0) ** 2 * abs(found[1, 2])
    assert np.sqrt(2 * np.mean(more**2)) == pytest.approx(expected, rel=0.01)  # 173 periods


def test_what_no_hull_can_do_is_told():
    with pytest.raises(SceneError, match=r"hull.blade_tones.1: 0.002 m/s must be 0 without a prop"):
        ship({"propeller": None, "hull.blade_tones.1.side": SPEED})
    fast = {"hull.engines.0.tones.5.order": 99, "hull.engines.0.tones.5.side": SPEED}
    with pytest.raises(SceneError, match=r"order 99 of 20 Hz = 1980 Hz must be < half of sample"):
        check(ship({**fast, "hull.engines.0.speed": "1200 rpm"}))


# --- warm films


def test_a_warm_film_is_as_thin_as_oil_of_its_temperature():
    warm = film_bearings(ship({"bearings.0.film_warming": "12 K"}))
    hot = film_bearings(ship({"oil.temperature": "325.15 K"}))
    cold = film_bearings(ship({}))
    thin = [each.bearing.viscosity for each in warm]
    assert thin[0] == pytest.approx(hot[0].bearing.viscosity, rel=1e-12)
    assert thin[1:] == [each.bearing.viscosity for each in cold[1:]]


def test_warming_needs_to_know_how_oil_thins():
    oil = {"oil": {"viscosity": "80 mPa s"}, "bearings.2.film_warming": "5 K"}
    with pytest.raises(SceneError, match=r"bearings.2.film_warming = 5 K must be 0 with oil.visc"):
        ship(oil)


def test_thicker_oil_thins_alike():
    oil = ship({}).oil
    thick = oil.thickened(1.3)
    assert thick.dynamic_viscosity == pytest.approx(1.3 * oil.dynamic_viscosity, rel=1e-12)
    assert thick.warmed(20.0) == pytest.approx(1.3 * oil.warmed(20.0), rel=1e-12)
