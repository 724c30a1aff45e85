"""Starved film: closed form of the long bearing, limits, an own mass-conserving film, refusals."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve
from wearstate.sim.bearing.coefficients import coefficients
from wearstate.sim.bearing.equilibrium import equilibrium
from wearstate.sim.bearing.rest_curve import rest_curve
from wearstate.sim.bearing.whirl import whirl
from wearstate.sim.film.direct import direct_force
from wearstate.sim.film.impedance_map import impedance_map
from wearstate.sim.film.mass_conserving import mass_conserving
from wearstate.sim.film.solve import (
    FilmGeometry,
    FilmState,
    FilmStatus,
    Groove,
    direct_film,
    dufrane_scar,
    solve_direct,
    solve_finite,
    solve_short,
)
from wearstate.sim.film.starved import FRONT, solved_force, starved_force

TWO_PI = 2 * math.pi
HERE = FilmState(x=0.6 * math.cos(0.7), y=0.6 * math.sin(0.7))


def bearing(fill, length_to_diameter=0.6, **changes):
    return FilmGeometry(length_to_diameter=length_to_diameter, inlet_fill=fill, **changes)


def polar(force, place=HERE):
    """Size, and angle from the place's own direction, in [0, 2 pi)."""
    turn = math.atan2(force[1], force[0]) - math.atan2(place.y, place.x)
    return math.hypot(*force), turn % TWO_PI


# --- limits


def test_a_full_inlet_is_the_film_as_ever():
    motion = (HERE.x, HERE.y, 0.03, -0.02)
    full, plain = direct_film(bearing(1.0)), direct_film(FilmGeometry(length_to_diameter=0.6))
    assert solved_force(full, *motion) == direct_force(plain, *motion)
    assert_array_equal(full.pressure, plain.pressure)


def test_an_inlet_that_brings_what_is_taken_begins_at_the_widest_gap():
    """On a node of the mesh it is the condition of Reynolds, to rounding."""
    reynolds = FilmGeometry(length_to_diameter=0.6, condition="reynolds")
    for rates in ((0.0, 0.0), (0.01, 0.02)):
        along = FilmState(x=0.6, y=0.0, x_rate=rates[0], y_rate=rates[1])
        starved = solve_direct(bearing(0.999), along)
        assert_allclose(starved.force, solve_direct(reynolds, along).force, rtol=1e-12)


def test_a_layer_thinner_than_the_narrowest_gap_carries_nothing():
    least = 0.4 / 1.6  # narrowest over widest
    assert_array_equal(solve_direct(bearing(0.99 * least), HERE).force, 0.0)
    weak = math.hypot(*solve_direct(bearing(1.05 * least), HERE).force)
    full = math.hypot(*solve_direct(FilmGeometry(length_to_diameter=0.6), HERE).force)
    assert 0 < weak < 0.06 * full


def test_load_and_attitude_fall_with_the_fill():
    forces = [polar(solve_direct(bearing(fill), HERE).force) for fill in (0.8, 0.65, 0.5, 0.35)]
    for (strong, aside), (weak, behind) in pairwise(forces):
        assert weak < strong
        assert aside < behind < math.pi  # nearer to straight against the journal


def test_what_is_squeezed_is_not_lost():
    """A journal that falls fills its inlet: the film begins earlier and is stiffer."""
    work = direct_film(bearing(0.5))
    still = math.hypot(*starved_force(work, HERE.x, HERE.y, 0.0, 0.0))
    front = work.inlet[FRONT]
    falling = math.hypot(*starved_force(work, HERE.x, HERE.y, 0.05, 0.04))
    assert falling > 1.1 * still
    assert work.inlet[FRONT] < front


# --- closed form and an independent film


def long_force(eccentricity, fill):
    """Of a bearing without flow to the ends: one flow 6 t from the front to the rupture."""
    layer = fill * (1 + eccentricity)

    def gap(angle):
        return 1 - eccentricity * math.cos(angle)

    def slope(angle):
        return 6 * (gap(angle) - layer) / gap(angle) ** 3

    rupture = math.acos((1 - layer) / eccentricity)  # of the narrowest gap at 0
    front = brentq(lambda a: quad(slope, a, rupture)[0], -math.pi, -rupture)
    # by parts: the pressure is zero at both ends
    force_x = quad(lambda a: slope(a) * math.sin(a), front, rupture)[0]
    force_y = -quad(lambda a: slope(a) * math.cos(a), front, rupture)[0]
    return force_x, force_y


def test_the_long_bearing_in_closed_form():
    """In half a cell at either end nothing holds the oil back: an error of first order there.

    Extrapolated from cells of 1/64 and 1/128 of the length it is gone, 0.6 % measured.
    """
    expected = np.array(long_force(0.3, 0.58))
    coarse, fine = (
        solve_direct(bearing(0.58, 1000.0, n_theta=144, n_z=n_z), FilmState(x=0.3, y=0.0)).force
        for n_z in (65, 129)
    )
    size = math.hypot(*expected)
    assert math.hypot(*(fine - expected)) < 0.08 * size
    assert math.hypot(*(2 * fine - coarse - expected)) < 0.01 * size


def mass_conserving_force(length_to_diameter, place, fill, n=72, k=17):
    """Steady film with its oil kept, the line of the widest gap filled to a share.

    Cells with upwind film fraction (Elrod), written anew: full cells have a pressure, others a
    fraction, exchanged until they stay.
    """
    theta, m = TWO_PI * np.arange(n) / n, k - 2
    step, length_step = TWO_PI / n, 1 / (k - 1)
    face = theta + step / 2
    gap = 1 - place.x * np.cos(theta) - place.y * np.sin(theta)
    face_gap = 1 - place.x * np.cos(face) - place.y * np.sin(face)
    along = face_gap**3 / step**2
    across = gap**3 / (2 * length_to_diameter * length_step) ** 2
    widest = round((math.atan2(place.y, place.x) / TWO_PI + 0.5) * n) % n
    full = np.zeros((n, m), bool)
    full[(widest + n // 4 + np.arange(n // 4)) % n] = True
    number = np.arange(n * m).reshape(n, m)
    for _ in range(100):
        rows, columns, values, right = [], [], [], np.zeros((n, m))
        for i in range(n):
            for j in range(m):
                here = number[i, j]
                if i == widest:
                    terms, right[i, j] = [(here, 1.0)], fill
                else:
                    terms = []
                    flows = (
                        (i, j, along[i] + along[i - 1] + 2 * across[i]),
                        ((i + 1) % n, j, -along[i]),
                        (i - 1, j, -along[i - 1]),
                        (i, j + 1, -across[i]),
                        (i, j - 1, -across[i]),
                    )
                    for a, b, flow in flows:
                        if 0 <= b < m and full[a, b]:
                            terms.append((number[a, b], flow))
                    for a, carried in ((i, 6 * face_gap[i]), (i - 1, -6 * face_gap[i - 1])):
                        if full[a, j]:
                            right[i, j] -= carried / step
                        else:
                            terms.append((number[a, j], carried / step))
                rows += [here] * len(terms)
                columns += [column for column, _ in terms]
                values += [value for _, value in terms]
        matrix = csr_matrix((values, (rows, columns)), shape=(n * m, n * m))
        found = spsolve(matrix, right.ravel()).reshape(n, m)
        new = np.where(full, found > 0, found > 1 + 1e-12)
        new[widest] = False
        if np.array_equal(new, full):
            break
        full = new
    else:
        raise AssertionError("the sets did not settle")
    pressure = np.where(full, found, 0.0).sum(axis=1) * step * length_step
    return -float(pressure @ np.cos(theta)), -float(pressure @ np.sin(theta))


@pytest.mark.parametrize(("eccentricity", "fill"), [(0.6, 0.6), (0.6, 0.8), (0.8, 0.5)])
def test_load_and_attitude_of_a_mass_conserving_film(eccentricity, fill):
    """Oil that leaves sideways into the unfilled corners is lost to a film with a straight front.

    Measured: 1.7 % of the load and 0.9 degrees at a fill of 0.6, less at more; without the starved
    inlet the first and the last are off by 5.7 % and 7.5 degrees, 2 % and 3.
    """
    place = FilmState(x=eccentricity * math.cos(0.7), y=eccentricity * math.sin(0.7))
    size, angle = polar(mass_conserving_force(0.6, place, fill), place)
    own, aside = polar(solve_direct(bearing(fill), place).force, place)
    assert own == pytest.approx(size, rel=0.02)
    assert math.degrees(abs(aside - angle)) < 1.1


# --- as an integrator needs it


def test_the_force_has_no_jumps_where_the_front_crosses_a_line():
    """Slopes of a smooth path change by 4 % at the most; by 40 % with the ends left out."""
    work = direct_film(bearing(0.35))
    way = np.linspace(0, 0.02, 401)
    force = np.array(
        [
            starved_force(
                work, (0.56 + d) * math.cos(0.4 + d), (0.56 + d) * math.sin(0.4 + d), 0.003, 0.002
            )
            for d in way
        ]
    )
    slope = np.diff(force[:, 0]) / np.diff(way)
    assert np.abs(np.diff(slope)).max() < 0.08 * np.abs(slope).mean()


def test_the_call_before_does_not_matter():
    warm = direct_film(bearing(0.5, bore=dufrane_scar(0.3, 0.2, 72)))
    for place in ((0.3, 0.5), (0.7, 0.1), (-0.2, -0.4), (0.75, 0.5)):
        cold = direct_film(bearing(0.5, bore=dufrane_scar(0.3, 0.2, 72)))
        expected = starved_force(cold, *place, 0.01, 0.0)
        assert_allclose(starved_force(warm, *place, 0.01, 0.0), expected, rtol=1e-7, atol=1e-9)


# --- a bearing


def test_a_starved_bearing_lies_deeper_and_nearer_to_its_load():
    load = [0.5, 0.0]
    full = equilibrium(FilmGeometry(length_to_diameter=0.6), load)
    starved = equilibrium(bearing(0.5), load)
    assert starved.eccentricity_ratio > full.eccentricity_ratio + 0.05
    assert starved.attitude_angle < full.attitude_angle - math.radians(20)
    assert_allclose(starved.film.force, [-0.5, 0.0], atol=1e-8)
    assert_allclose(rest_curve(bearing(0.5)).position(load), starved.position, atol=3e-3)


def test_coefficients_and_threshold_by_displacement():
    found = equilibrium(bearing(0.7), [0.5, 0.0])
    with pytest.raises(ValueError, match=r"method = 'analytic' of inlet_fill = 0\.7"):
        coefficients(found)
    own = coefficients(found, method="displacement")
    push = 1e-4
    moved = replace(found.state, x=found.state.x + push)
    fall = (found.film.force - solve_direct(bearing(0.7), moved).force) / push
    assert_allclose(own.stiffness[:, 0], fall, rtol=0.02)
    assert whirl(found).threshold.speed > 0


# --- refusals


@pytest.mark.parametrize("fill", [0.0, -0.1, 1.01, math.nan])
def test_a_fill_out_of_bounds(fill):
    with pytest.raises(ValueError, match=r"inlet_fill = .* must be in \(0, 1\]"):
        bearing(fill)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bearing(0.5, grooves=(Groove(angle=0.0, width=0.1),)), "must be 1 with grooves"),
        (lambda: bearing(0.5, condition="guembel"), "must be 1 with 'guembel'"),
        (
            lambda: solve_direct(bearing(0.5), replace(HERE, tilt_x=0.1)),
            "must be 1 for a tilted journal",
        ),
        (lambda: solve_short(bearing(0.5), HERE), "has no starved inlet"),
        (lambda: solve_finite(bearing(0.5), HERE), "has no starved inlet"),
        (lambda: impedance_map(bearing(0.5)), "inlet_fill = 0.5 must be 1 for a map"),
        (lambda: mass_conserving(bearing(0.5), HERE), "works with the direct film only"),
    ],
)
def test_films_that_know_no_starved_inlet(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_a_journal_that_touches_has_no_film():
    assert solve_direct(bearing(0.5), FilmState(x=1.1, y=0.0)).status is FilmStatus.TOUCH
