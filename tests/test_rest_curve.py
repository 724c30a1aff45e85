"""The table of static equilibria against the equilibria themselves."""

import math

import numpy as np
import pytest
from wearstate.sim.bearing.equilibrium import equilibrium
from wearstate.sim.bearing.rest_curve import rest_curve
from wearstate.sim.bearing.short_bearing import short_attitude, short_eccentricity
from wearstate.sim.film.solve import FilmGeometry, Groove, dufrane_scar

SHORT = FilmGeometry(length_to_diameter=0.6)


@pytest.mark.parametrize("load", [0.002, 0.07, 1.3, 40.0])
def test_a_short_film_has_its_closed_form(load):
    """Ocvirk: eccentricity by the load over (L/D)^2, attitude by the eccentricity."""
    x, y = rest_curve(SHORT, "short").position([load, 0.0])
    eccentricity = short_eccentricity(load / 0.6**2)
    # between seven knots a decade the spline is this near
    assert math.hypot(x, y) == pytest.approx(eccentricity, abs=3e-4)
    assert math.atan2(y, x) == pytest.approx(short_attitude(eccentricity), abs=1e-3)


def test_a_film_solved_over_its_length_has_its_own_equilibria():
    film = FilmGeometry(length_to_diameter=0.8, n_theta=36, n_z=9)
    curve = rest_curve(film)
    for load in (0.02, 0.9, 11.0):
        # the mesh of 36 nodes makes the places uneven by this much
        assert (
            np.abs(curve.position([load, 0.0]) - equilibrium(film, [load, 0.0]).position).max()
            < 4e-3
        )


def test_the_place_turns_with_the_load_and_goes_on_straight_below_the_table():
    curve = rest_curve(SHORT, "short")
    plain = curve.position([0.4, 0.0])
    turn = np.array([[math.cos(0.7), -math.sin(0.7)], [math.sin(0.7), math.cos(0.7)]])
    assert np.abs(curve.position(turn @ [0.4, 0.0]) - turn @ plain).max() < 1e-12
    # the film is linear near the middle: a tenth of the load is a tenth of the way
    light, lighter = curve.position([1e-4, 0.0]), curve.position([1e-5, 0.0])
    assert np.hypot(*light) / np.hypot(*lighter) == pytest.approx(10, rel=2e-3)


@pytest.mark.parametrize("turned", [0.0, -0.3])
def test_a_scar_lets_the_journal_sink_beyond_the_round_bore(turned):
    size = {"length_to_diameter": 0.6, "n_theta": 72, "n_z": 9}
    curve = rest_curve(FilmGeometry(**size), scar=0.3, turned=turned)
    worn = FilmGeometry(**size, bore=dufrane_scar(0.3, turned, 72))
    # by the begin of its run the journal crosses the middle, where an angle changes fast
    for load, apart in ((0.05, 6e-3), (0.9, 3e-3), (20.0, 3e-3)):
        rest = equilibrium(worn, [load, 0.0]).position
        assert np.abs(curve.position([load, 0.0]) - rest).max() < apart
    assert np.hypot(*curve.position([20.0, 0.0])) > 1.0
    # the scar turns with the load that made it
    across, along = curve.position([0.0, 0.9]), curve.position([0.9, 0.0])
    assert np.abs(across - [-along[1], along[0]]).max() < 1e-12
    assert np.abs(along - rest_curve(FilmGeometry(**size)).position([0.9, 0.0])).max() > 0.1


def test_a_short_film_knows_no_scar():
    with pytest.raises(ValueError, match="rung = 'short' does not support a scar"):
        rest_curve(SHORT, "short", scar=0.2)


def test_grooves_are_refused():
    grooved = FilmGeometry(length_to_diameter=0.6, grooves=(Groove(angle=0.0, width=0.3),))
    with pytest.raises(ValueError, match="grooves must be absent"):
        rest_curve(grooved)
