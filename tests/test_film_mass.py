"""Mass-conserving film against a stored field, closed forms, the other conditions, its books."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.optimize import brentq
from wearstate.sim.film import mass_conserving as film_mass
from wearstate.sim.film.mass_conserving import (
    mass_conserving,
    mass_step,
    oil_in_gap,
    oil_intake,
    oil_volume,
)
from wearstate.sim.film.rungs import FILM_RUNGS
from wearstate.sim.film.solve import (
    FilmGeometry,
    FilmState,
    FilmStatus,
    Groove,
    groove_nodes,
    solve_direct,
)

# The stored field: open code of S. Pfeil, demonstration of the finite volume Elrod solver
RADIUS, LENGTH, CLEARANCE = 0.05, 0.08, 150e-6
PRESSURE = 0.01 * 2 * math.pi * 50 * (RADIUS / CLEARANCE) ** 2
HALF = FilmState(x=0.5, y=0.0)
FINE = FilmStatus.OK, FilmStatus.COARSE
FED = Groove(angle=math.pi / 2, width=0.3, length_share=0.75, pressure=0.2)


def fed(**changes):
    return FilmGeometry(**{"length_to_diameter": 0.8, "grooves": (FED,), **changes})


# --- the stored field


@cache
def stored_case(n_theta=100, n_z=25):
    # 25 nodes put the groove's ends on nodes; the 26 of the source are not odd
    groove = Groove(
        angle=math.pi / 2, width=math.radians(15), length_share=0.75, pressure=70e3 / PRESSURE
    )
    geometry = fed(n_theta=n_theta, n_z=n_z, grooves=(groove,))
    return geometry, mass_conserving(geometry, HALF)


def stored_node(angle):
    return round(angle / 3.6)


def test_stored_force_and_volume():
    geometry, solution = stored_case()
    force = solution.force * PRESSURE * RADIUS * LENGTH  # on the journal, theirs on the shell
    # the contract of the step: 1 % and 2 %; reached are 0.12 % and 0.04 %
    assert_allclose(-force, [1055.39, -1383.30], rtol=0.003)
    assert_allclose(np.hypot(*force), 1739.93, rtol=0.003)
    volume = oil_volume(oil_in_gap(geometry, HALF, solution.fill)) * RADIUS * LENGTH * CLEARANCE
    assert_allclose(volume, 3.5355e-6, rtol=0.001)


def test_stored_pressure():
    _, solution = stored_case()
    middle = PRESSURE * solution.pressure[:, 12]
    assert_allclose(middle.max(), 523_368.0, rtol=0.003)
    assert np.argmax(middle) == stored_node(320.4)
    kilopascals = {0: 186.15, 90: 70.0, 108: 20.05, 216: 56.72, 270: 266.36, 288: 372.60}
    kilopascals |= {324: 523.18, 342: 422.42}
    for angle, expected in kilopascals.items():
        assert_allclose(middle[stored_node(angle)], 1e3 * expected, rtol=0.003, err_msg=str(angle))
    # where the film ruptures and where it forms the pressure is a small difference
    for angle, expected in {18: 9.51, 198: 10.36}.items():
        assert_allclose(middle[stored_node(angle)], 1e3 * expected, rtol=0.01, err_msg=str(angle))


def test_stored_film_fraction():
    _, solution = stored_case()
    middle = solution.fill[:, 12]
    fractions = {36: 0.89157, 72: 0.62149, 126: 0.97711, 162: 0.86227, 180: 0.85146}
    for angle, expected in fractions.items():
        # the contract's 3 %; at 72 the continuity of the ruptured film asks for .625 to .633,
        # so most of that node's 1.1 % is the source's
        rtol = 0.03 if angle == 72 else 0.003
        assert_allclose(middle[stored_node(angle)], expected, rtol=rtol, err_msg=str(angle))


def test_least_film_fraction_sits_at_the_groove_corner_and_depends_on_the_mesh():
    """Golden: the corner is a singular point; the source has 0.551 on its 100 x 26 mesh."""
    found = {}
    for n_theta, n_z in ((100, 25), (200, 49)):
        geometry, solution = stored_case(n_theta, n_z)
        i, j = np.unravel_index(np.argmin(solution.fill), solution.fill.shape)
        # beside the end of the groove, which reaches from 82.5 to 97.5 degrees
        assert math.radians(75) < 2 * math.pi * i / geometry.n_theta < math.radians(100)
        assert min(j, n_z - 1 - j) <= (n_z - 1) // 8
        found[n_z] = solution.fill[i, j]
    assert_allclose(list(found.values()), [0.559, 0.517], atol=0.01)


# --- closed form and mesh


def long_bearing_load(eccentricity, groove):
    """Force along the line of centres of an infinitely long bearing fed at a full line.

    The ruptured film carries what leaves the line. It forms again where the pressure that this
    stream builds up falls back to zero at the line.
    """

    def gap(t):
        return 1 - eccentricity * math.cos(t)

    def slope(t):
        return 6 * (gap(t) - gap(groove)) / gap(t) ** 3

    end = 2 * math.pi + groove
    begin = brentq(lambda t: quad(slope, t, end)[0], math.pi + 0.1, end - 2 * groove - 1e-3)
    # by parts, P = 0 at both ends
    return quad(lambda t: math.sin(t) * slope(t), begin, end)[0]


def test_long_bearing_reaches_the_closed_form_at_first_order():
    line = math.radians(20)
    expected = long_bearing_load(0.6, line)
    loads = []
    for n in (72, 144, 288):
        groove = Groove(angle=line, width=1e-3)
        geometry = FilmGeometry(length_to_diameter=1e4, n_theta=n, n_z=5, grooves=(groove,))
        # two of the five nodes are at the ends: the trapezoidal rule counts 3/4 of the pressure
        loads.append(4 / 3 * mass_conserving(geometry, FilmState(x=0.6, y=0.0)).force[0])
    errors = np.array(loads) - expected
    # the stream leaves the line by the face half a cell on, and this load is a small difference
    assert_allclose(np.log2(errors[:-1] / errors[1:]), [1.108, 1.057], atol=0.02)
    # Richardson leaves the second order
    assert_allclose(2 * loads[2] - loads[1], expected, rtol=0.02)


def test_order_in_the_mesh():
    forces = []
    for n, k in ((36, 9), (72, 17), (144, 33), (288, 65)):
        forces.append(mass_conserving(fed(n_theta=n, n_z=k), HALF).force)
    change = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    order = np.log2(change[:-1] / change[1:])
    # first order at rupture and formation, second in the film, which carries most; and the
    # groove's edges move by half a cell
    assert order.min() > 0.8
    assert order[-1] < 2.5
    assert change[1] / np.linalg.norm(forces[-1]) < 0.01


# --- against the other conditions


@pytest.mark.parametrize("eccentricity", [0.1, 0.4, 0.6, 0.8, 0.9])
@pytest.mark.parametrize("length_to_diameter", [0.5, 1.0])
def test_flooded_at_the_widest_gap_is_the_reynolds_condition(eccentricity, length_to_diameter):
    geometry = FilmGeometry(length_to_diameter=length_to_diameter, condition="reynolds")
    state = FilmState(x=eccentricity * math.cos(1.0), y=eccentricity * math.sin(1.0))
    pressure = solve_direct(geometry, state).pressure
    solution = mass_conserving(geometry, state)
    # nothing forms again before the line, and the meshes are the same: only rounding is left
    assert_allclose(solution.pressure, pressure, atol=1e-9 * pressure.max())


@pytest.mark.parametrize(
    ("length_to_diameter", "eccentricity", "sommerfeld", "attitude"),
    [
        (1.0, 0.1, 1.33, 79.5),
        (1.0, 0.4, 0.264, 63.10),
        (1.0, 0.6, 0.121, 50.58),
        (1.0, 0.8, 0.0446, 36.24),
        (1.0, 0.9, 0.0188, 26.45),
        (0.5, 0.2, 2.03, 74.94),
        (0.5, 0.6, 0.319, 48.14),
        (0.5, 0.9, 0.0313, 23.66),
    ],
)
def test_raimondi_boyd(length_to_diameter, eccentricity, sommerfeld, attitude):
    geometry = FilmGeometry(
        length_to_diameter=length_to_diameter, n_theta=120, n_z=25, condition="reynolds"
    )
    force = mass_conserving(geometry, FilmState(x=eccentricity, y=0.0)).force
    # 1.5 % and 0.7 degrees are what the printed charts are good for
    assert_allclose(1 / (math.pi * np.hypot(*force)), sommerfeld, rtol=0.015)
    assert_allclose(math.degrees(math.atan2(force[1], -force[0])), attitude, atol=0.7)


TILTED = FilmState(
    x=0.1, y=0.05, x_rate=0.02, y_rate=-0.03, tilt_x=0.1, tilt_y=-0.05, tilt_x_rate=0.05
)


def full_film(geometry, state):
    """Full film between ends at zero: what complementarity keeps of it with either sign."""
    guembel = replace(geometry, condition="guembel")
    there = solve_direct(guembel, state).pressure
    # the opposite film pulls where this one pushes: turn wedge and squeeze round by rates alone,
    # V = (x' + y/2, y' - x/2) -> -V, and the same at every node of the length
    back = replace(
        state,
        x_rate=-state.x_rate - state.y,
        y_rate=-state.y_rate + state.x,
        tilt_x_rate=-state.tilt_x_rate - state.tilt_y,
        tilt_y_rate=-state.tilt_y_rate + state.tilt_x,
    )
    return there - solve_direct(guembel, back).pressure


def test_flooded_film_is_the_direct_solution():
    geometry = FilmGeometry(length_to_diameter=0.5, n_theta=36, n_z=9)
    expected = 3.0 + full_film(geometry, TILTED)
    steady = mass_conserving(geometry, TILTED, end_pressure=3.0)
    assert_array_equal(steady.fill, 1.0)
    assert_allclose(steady.pressure, expected, rtol=1e-11)
    step = 1e-3
    before = replace(
        TILTED,
        x=TILTED.x - step * TILTED.x_rate,
        y=TILTED.y - step * TILTED.y_rate,
        tilt_x=TILTED.tilt_x - step * TILTED.tilt_x_rate,
    )
    oil = oil_in_gap(geometry, before, 1.0)
    moving = mass_step(geometry, TILTED, oil, step, end_pressure=3.0).solution
    # the rounding of the oil, over the step
    assert_allclose(moving.pressure, expected, rtol=1e-11)
    # written down a second time; the ends' pressure pushes evenly all round
    angle, z = 2 * math.pi * np.arange(36) / 36, np.linspace(-0.5, 0.5, 9)
    by_length = np.trapezoid((expected - 3.0) * z, z, axis=1)
    moment = [-(by_length @ wave) * math.pi / 18 for wave in (np.cos(angle), np.sin(angle))]
    assert_allclose(steady.moment, moment, rtol=1e-10)


def test_film_that_forms_late_carries_less_than_reynolds_condition_says():
    """A starved film pushes less everywhere than under the double Reynolds condition."""
    geometry, solution = stored_case()
    pressure = solve_direct(geometry, HALF).pressure
    assert np.all(solution.pressure <= pressure + 1e-9)
    # golden: the wide gap has to fill first; 56 % of the mesh is under pressure instead of 71 %
    assert_allclose(solution.pressure.sum() / pressure.sum(), 0.946, atol=0.005)
    assert (solution.pressure > 0).mean() < (pressure > 0).mean() - 0.1


# --- invariants


def assert_complementary(solution):
    assert solution.pressure.min() >= 0.0
    assert solution.fill.min() >= 0.0
    assert solution.fill.max() <= 1.0
    assert_array_equal(solution.pressure * (1.0 - solution.fill), 0.0)


def test_steady_film_takes_in_what_leaks():
    geometry, solution = stored_case()
    intake = oil_intake(geometry, HALF, solution)
    assert_complementary(solution)
    held = groove_nodes(geometry)[0] != 0
    held[:, [0, -1]] = True
    # rounding, and the film's artificial loss of 1e-13
    assert np.abs(intake[~held]).max() < 1e-12 * np.abs(intake[held]).max()
    assert solution.residual < 1e-12
    leak = intake[:, [0, -1]].sum()
    assert leak < -0.1
    assert_allclose(intake[held].sum() - leak, -leak, rtol=1e-10)


@pytest.mark.parametrize(
    ("length_to_diameter", "eccentricity", "flow", "share"),
    [(1.0, 0.4, 3.99, 0.497), (1.0, 0.8, 4.62, 0.842), (0.5, 0.6, 4.85, 0.730)],
)
def test_leakage_of_raimondi_boyd(length_to_diameter, eccentricity, flow, share):
    state = FilmState(x=eccentricity, y=0.0)
    leaks = []
    for n_z in (17, 33):
        geometry = FilmGeometry(
            length_to_diameter=length_to_diameter, n_theta=120, n_z=n_z, condition="reynolds"
        )
        intake = oil_intake(geometry, state, mass_conserving(geometry, state))
        leaks.append(-2 * math.pi * intake[:, [0, -1]].sum())  # over R C N L
    # first order in the length, so extrapolated; the table has three digits, and an independent
    # solver is within 0.5 % and 0.4 % of the two factors
    assert_allclose(2 * leaks[1] - leaks[0], flow * share, rtol=0.01)
    assert 0.95 < leaks[1] / (flow * share) < 0.98


def test_a_ring_that_nothing_feeds_is_dry():
    """Beside a short groove without pressure any film fraction would do, but only 0 stays."""
    groove = Groove(angle=math.pi / 2, width=0.3, length_share=0.1)
    geometry = FilmGeometry(length_to_diameter=8.0, n_theta=12, n_z=9, grooves=(groove,))
    cold = mass_conserving(geometry, HALF)
    empty = replace(cold, fill=np.zeros((12, 9)))
    solution = mass_conserving(geometry, HALF, empty)
    assert_complementary(solution)
    assert solution.residual < 1e-12
    assert_allclose(solution.fill, cold.fill, atol=1e-9)


def test_every_cell_keeps_its_books_in_a_squeeze_oscillation():
    geometry = FilmGeometry(length_to_diameter=0.5, n_theta=36, n_z=9)
    oil = oil_in_gap(geometry, FilmState(x=0.3, y=0.0), 0.9)
    filled, taken, last = oil_volume(oil), 0.0, None
    for k in range(1, 201):
        t = 0.05 * k
        state = FilmState(x=0.3 + 0.4 * math.sin(0.5 * t), y=0.3 * math.sin(1.3 * t))
        done = mass_step(geometry, state, oil, 0.05, last)
        assert done.solution.status in FINE
        assert_complementary(done.solution)
        # rounding of a volume of 2 pi, cell by cell and in the sum
        assert np.abs(done.intake[:, 1:-1]).max() < 1e-14
        assert abs(oil_volume(done.oil) - oil_volume(oil) - done.intake.sum()) < 1e-13
        taken += done.intake.sum()
        oil, last = done.oil, done.solution
    assert_allclose(oil_volume(oil) - filled, taken, atol=1e-12)
    assert taken < -1.0  # nothing feeds it


def test_time_ends_in_the_steady_film():
    geometry = fed()
    steady = mass_conserving(geometry, HALF)
    for share in (0.0, 1.0):
        oil, last = oil_in_gap(geometry, HALF, share), None
        for _ in range(60):
            done = mass_step(geometry, HALF, oil, 2.0, last)
            oil, last = done.oil, done.solution
        # 120 rad wash out the start to rounding
        assert_allclose(last.pressure, steady.pressure, atol=1e-11 * steady.pressure.max())
        assert_allclose(last.fill, steady.fill, atol=1e-10)


def test_first_order_in_time():
    def force(steps):
        groove = Groove(angle=3.1, width=0.3, pressure=0.1)
        geometry = FilmGeometry(length_to_diameter=0.5, n_theta=36, n_z=9, grooves=(groove,))
        times = np.linspace(0.0, 2.0, steps + 1)
        path = [FilmState(x=0.3 + 0.2 * math.sin(t), y=0.1 * t) for t in times]
        oil, last = oil_in_gap(geometry, path[0], 1.0), None
        for state in path[1:]:
            done = mass_step(geometry, state, oil, 2.0 / steps, last)
            oil, last = done.oil, done.solution
        return last.force

    change = np.linalg.norm(np.diff([force(n) for n in (20, 40, 80)], axis=0), axis=1)
    # 1.19 here, 1.01 with steps a half as long
    assert 0.8 < math.log2(change[0] / change[1]) < 1.4


def test_turning_the_bearing_turns_the_force():
    turn = 10  # nodes: the meshes coincide
    angle = 2 * math.pi * turn / 72
    reference = mass_conserving(fed(), HALF)
    groove = replace(FED, angle=FED.angle + angle)
    state = FilmState(x=0.5 * math.cos(angle), y=0.5 * math.sin(angle))
    turned = mass_conserving(fed(grooves=(groove,)), state)
    assert_allclose(turned.fill, np.roll(reference.fill, turn, axis=0), atol=1e-12)
    c, s = math.cos(angle), math.sin(angle)
    assert_allclose(turned.force, np.array([[c, -s], [s, c]]) @ reference.force, rtol=1e-12)


def test_tilt():
    state = FilmState(x=0.5, y=0.0, tilt_x=0.3, tilt_y=-0.2)
    there = mass_conserving(fed(), state)
    back = mass_conserving(fed(), replace(state, tilt_x=-0.3, tilt_y=0.2))
    assert there.status == FilmStatus.OK
    assert_allclose(back.pressure, there.pressure[:, ::-1], atol=1e-12)
    assert_allclose(back.moment, -there.moment, rtol=1e-10)
    # the end at z = 1/2 is the closer one: its pressure turns the journal back
    assert there.moment @ (0.3, -0.2) < 0.0
    barely = mass_conserving(fed(), replace(HALF, tilt_x=1e-12))  # the whole length is solved
    half = mass_conserving(fed(), HALF)
    assert_allclose(barely.pressure, half.pressure, atol=1e-10)
    assert_allclose(barely.moment, half.moment, atol=1e-10)


def test_a_velocity_pushes_against_itself():
    rest = mass_conserving(fed(), HALF)
    closing = mass_conserving(fed(), replace(HALF, x_rate=0.05))
    opening = mass_conserving(fed(), replace(HALF, x_rate=-0.05))
    assert closing.force[0] < rest.force[0] < opening.force[0] < 0.0


@pytest.mark.parametrize("rate", [0.0, 0.1])
def test_a_bore_is_gap(rate):
    """A bore of the shape of a shifted journal is a shifted journal."""
    angle = 2 * math.pi * np.arange(288) / 288
    shifted = fed(n_theta=288, n_z=9, bore=-0.2 * np.cos(angle))
    bored = mass_conserving(shifted, FilmState(x=0.3, y=0.0, x_rate=rate))
    plain = mass_conserving(fed(n_theta=288, n_z=9), replace(HALF, x_rate=rate))
    # the bore is known at nodes and straight between: d(theta)^2 / 8 of its 0.2 over the gap 0.5
    assert_allclose(bored.pressure, plain.pressure, atol=1e-3 * plain.pressure.max())
    assert_allclose(bored.force, plain.force, rtol=1e-3)


# --- where it fails, and from where it starts


@settings(max_examples=40, deadline=None)
@given(
    eccentricity=st.sampled_from([0.0, 0.3, 0.9, 0.99, 0.999]),
    length_to_diameter=st.sampled_from([0.1, 0.5, 2.0, 8.0]),
    grooves=st.integers(0, 2),
    condition=st.sampled_from(["reynolds", "periodic"]),
    end_pressure=st.sampled_from([0.0, 3.0]),
    step=st.sampled_from([None, 1e-4, 0.1, 10.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_start_ends_at_one_film(
    eccentricity, length_to_diameter, grooves, condition, end_pressure, step, seed
):
    random = np.random.default_rng(seed)
    angle = random.uniform(0, 2 * math.pi)
    state = FilmState(x=eccentricity * math.cos(angle), y=eccentricity * math.sin(angle))
    geometry = FilmGeometry(
        length_to_diameter=length_to_diameter,
        n_theta=24,
        n_z=9,
        condition=condition,
        grooves=tuple(
            Groove(
                angle=random.uniform(0, 7),
                width=random.uniform(0.02, 0.8),
                length_share=random.uniform(0.1, 1.0),
                pressure=random.choice([0.0, 0.2, 5.0]),
            )
            for _ in range(grooves)
        ),
    )
    oil = oil_in_gap(geometry, state, 1.5 * random.random((24, 9)))  # overfilled in places

    def film(start):
        if step is None:
            return mass_conserving(geometry, state, start, end_pressure=end_pressure)
        return mass_step(geometry, state, oil, step, start, end_pressure=end_pressure).solution

    cold = film(None)
    if cold.status == FilmStatus.STARVED:
        assert step is None
        assert not grooves
        return
    assert cold.status in FINE
    assert_complementary(cold)
    assert cold.residual < 1e-11
    other = film(replace(cold, fill=(random.random((24, 9)) < 0.4).astype(float)))
    assert other.status in FINE
    assert_allclose(other.pressure, cold.pressure, atol=1e-9 * max(1.0, cold.pressure.max()))


def test_sets_are_few():
    """How many solutions a film takes; golden, with room for another order of rounding."""
    _, cold = stored_case()
    assert cold.iterations <= 10
    again = mass_conserving(fed(), HALF, mass_conserving(fed(), HALF))
    assert again.iterations == 1
    near = mass_conserving(fed(), replace(HALF, x=0.501), again)
    assert near.iterations <= 3


def test_ends_without_pressure_let_nothing_in():
    dry = mass_conserving(fed(), HALF, end_fill=0.2)
    wet = mass_conserving(fed(), HALF)
    assert_array_equal(dry.pressure, wet.pressure)
    assert_array_equal(dry.fill[:, 1:-1], wet.fill[:, 1:-1])
    assert_array_equal(dry.fill[:, [0, -1]], 0.2)


def test_a_bearing_that_nothing_feeds_is_starved():
    solution = mass_conserving(FilmGeometry(length_to_diameter=0.5), HALF)
    assert solution.status == FilmStatus.STARVED
    assert "groove" in solution.status.value
    assert not solution.pressure.any()
    assert not solution.fill.any()


def test_a_narrow_gap_on_a_coarse_mesh_is_a_status():
    geometry = fed(n_theta=24)
    solution = mass_conserving(geometry, FilmState(x=0.98, y=0.0))
    assert solution.status == FilmStatus.COARSE
    assert solution.force[0] < 0.0


def test_the_rung_is_the_last_of_the_table():
    rung = FILM_RUNGS[-1]
    assert rung.name == "mass-conserving"
    assert_array_equal(rung.field(fed(), HALF).force, mass_conserving(fed(), HALF).force)


def test_touching_is_a_status():
    state = FilmState(x=0.9, y=0.0, tilt_x=0.3)
    oil = oil_in_gap(fed(), HALF, 1.0)
    for solution in (mass_conserving(fed(), state), mass_step(fed(), state, oil, 0.1).solution):
        assert solution.status == FilmStatus.TOUCH
        assert solution.min_thickness < 0.0
        assert not solution.force.any()


@pytest.mark.parametrize("rate", [1.0, -30.0])
def test_fast_rates_have_one_film(rate):
    """A squeeze a hundred times the wedge, and an opening that would have begun in the wall."""
    state = FilmState(x=0.9, y=0.0, x_rate=rate)
    solution = mass_conserving(fed(), state)
    assert solution.status in FINE
    assert_complementary(solution)
    assert solution.residual < 1e-12
    empty = replace(solution, fill=np.zeros_like(solution.fill))
    assert_allclose(mass_conserving(fed(), state, empty).force, solution.force, rtol=1e-10)
    if rate > 0:
        # but for the gap beside the narrow one that was not full, the direct solution
        share = solution.pressure.max() / solve_direct(fed(), state).pressure.max()
        assert 0.9 < share < 1.0


def test_too_few_iterations_are_a_status(monkeypatch):
    monkeypatch.setattr(film_mass, "_MOST_SETS", 2)
    solution = mass_conserving(fed(), HALF)
    assert solution.status == FilmStatus.ITERATIONS
    assert solution.iterations == 2


def test_unusable_input_is_refused():
    with pytest.raises(ValueError, match=r"end_pressure = -1 must be >= 0.*end_fill = 2 must be"):
        mass_conserving(fed(), HALF, end_pressure=-1.0, end_fill=2.0)
    with pytest.raises(ValueError, match=r"end_fill = 0.5 must be 1 at end_pressure = 0.1"):
        mass_conserving(fed(), HALF, end_pressure=0.1, end_fill=0.5)
    with pytest.raises(ValueError, match=r"oil.shape = \(3, 3\) must be \(72, 17\).*step = 0"):
        mass_step(fed(), HALF, np.ones((3, 3)), 0.0)
    with pytest.raises(ValueError, match=r"least oil = -0.1 must be >= 0"):
        mass_step(fed(), HALF, np.full((72, 17), -0.1), 1.0)
    with pytest.raises(ValueError, match="rates must be 0"):
        oil_intake(fed(), replace(HALF, x_rate=0.1), mass_conserving(fed(), HALF))
    with pytest.raises(ValueError, match=r"solution.fill = None must be"):
        oil_intake(fed(), HALF, replace(mass_conserving(fed(), HALF), fill=None))
