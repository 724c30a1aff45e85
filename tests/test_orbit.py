"""The journal in its film: closed forms, orders, the source paper, thresholds, and failures."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from wearstate.sim.contact.law import CONTACT, LAW_HYSTERESIS, hysteresis
from wearstate.sim.film.direct import direct_force
from wearstate.sim.film.impedance_map import impedance_map
from wearstate.sim.film.short import short_force
from wearstate.sim.film.solve import FilmGeometry, direct_film
from wearstate.sim.journal.load import (
    half_sine_history,
    load,
    load_at,
    loads_at,
    rectangular_history,
    step_history,
)
from wearstate.sim.journal.orbit import INTEGRATORS, film_trace, run_orbit
from wearstate.sim.journal.orbit_film import film_force, map_film, no_film, short_film, solved_film
from wearstate.sim.journal.orbit_march import Wall
from wearstate.sim.journal.orbit_status import OrbitStatus

TURN = 2 * math.pi
PAPER = {"alpha": 0.83537, "static": (0.3972, 0.0)}
SEED_CASE = FilmGeometry(length_to_diameter=2 / 3)
FIRST = (0.1192, 0.3007)  # converged equilibria on the paper's mesh
SECOND = (0.4121, 0.4606)


@pytest.fixture(scope="module")
def film():
    return map_film(impedance_map(SEED_CASE), 2 / 3)


def paper_run(film, history, **options):
    chosen = {"duration": 140.0, "tolerance": 1e-6, **options}
    return run_orbit(film, load(**PAPER, **history), **chosen)


def reference(q, span, *, film_ratio, start=(0.0, 0.0, 0.0, 0.0)):
    """The short film by an independent integrator."""

    def rate(tau, s):
        f_x, f_y = short_force(film_ratio, *s)
        q_x, q_y = load_at(q, tau)
        return s[2], s[3], q.alpha * f_x + q_x, q.alpha * f_y + q_y

    return solve_ivp(rate, (0, span), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]


# --- the load, and a free mass


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_unbalance_of_a_free_mass(integrator):
    """X'' = u cos(tau + phase): the journal turns on a circle as large as the unbalance."""
    q = load(alpha=1.0, unbalance=0.2, phase=0.7)
    on_circle = -0.2 * np.exp(0.7j)
    run = run_orbit(
        no_film(),
        q,
        duration=3 * TURN,
        start=(on_circle.real, on_circle.imag),
        start_velocity=((1j * on_circle).real, (1j * on_circle).imag),
        integrator=integrator,
        step=0.01,
        tolerance=1e-9,
    )
    expected = on_circle * np.exp(1j * run.tau)
    # RK4 h^4/120 per radian: 2e-9; adaptive 1e-9 a step over some 300 steps
    assert_allclose(run.position @ [1, 1j], expected, atol=2e-7)
    assert run.status is OrbitStatus.OK
    assert run.tau[-1] == pytest.approx(3 * TURN, abs=0.01)


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_orders_of_a_free_mass(integrator):
    """X'' = a cos(n tau + p), each order by itself: X = -a cos(n tau + p) / n^2."""
    orders = [(0.4, 0.3, 0.02, 0.0), (2.0, -1.0, 0.1, -0.2)]
    n, phase, *peak = np.transpose(orders)
    along = np.array(peak) / n**2
    run = run_orbit(
        no_film(),
        load(alpha=1.0, orders=orders),
        duration=3 * TURN,
        start=tuple(-along @ np.cos(phase)),
        start_velocity=tuple((along * n) @ np.sin(phase)),
        integrator=integrator,
        step=0.01,
        tolerance=1e-9,
    )
    # RK4: n^4 h^4 / 120 per radian, 2e-8, of 0.2; adaptive as for the unbalance
    expected = -np.cos(np.outer(run.tau, n) + phase) @ along.T
    assert_allclose(run.position, expected, atol=1e-6)


def test_a_jump_of_the_load_between_samples():
    """Free fall from the jump on: a parabola, to rounding, wherever the samples lie."""
    q = load(alpha=1.0, **step_history(1.2345, (0.1, -0.2)))
    run = run_orbit(no_film(), q, duration=3.0, sample_step=0.1, tolerance=1e-6)
    fall = 0.5 * np.maximum(run.tau - 1.2345, 0.0) ** 2
    # the instants of the stages keep 1e-9 away from jumps
    assert_allclose(run.position, np.outer(fall, (0.1, -0.2)), atol=2e-9)
    assert_allclose(run.velocity[:, 0], 0.1 * np.maximum(run.tau - 1.2345, 0.0), atol=2e-9)
    assert run.steps < 30


def test_a_fixed_step_meets_a_jump_on_its_grid():
    q = load(alpha=1.0, **step_history(1.0, (0.1, 0.0)))
    for integrator in ("euler", "rk4"):
        run = run_orbit(no_film(), q, duration=2.0, integrator=integrator, step=0.01)
        # exact velocities: the load is constant within each step
        assert_allclose(run.velocity[:, 0], 0.1 * np.maximum(run.tau - 1, 0), atol=1e-12)


def test_history_is_linear_between_its_instants():
    q = load(alpha=1.0, static=(1.0, 0.0), time=[1.0, 2.0, 2.0, 4.0], history=np.eye(4)[:, :2])
    for tau, expected in (
        (0.5, (2.0, 0.0)),
        (1.25, (1.75, 0.25)),
        (2.0, (1.0, 0.0)),
        (3.0, (1.0, 0.0)),
        (9.0, (1.0, 0.0)),
    ):
        assert_allclose(load_at(q, tau), expected, atol=1e-15)
    many = np.array([0.5, 9.0, 3.0, 1.25, 2.0])
    assert loads_at(q, many).tolist() == [[*load_at(q, tau)] for tau in many]


def test_the_papers_histories():
    pulse = load(alpha=1.0, **rectangular_history(1.0, 2.0, (0.0, 3.0)))
    assert [load_at(pulse, t)[1] for t in (0.9, 1.0, 1.9, 2.0)] == [0.0, 3.0, 3.0, 0.0]
    sine = load(alpha=1.0, **half_sine_history(1.0, 3.0, (2.0, 0.0)))
    tau = np.linspace(0.5, 3.5, 301)
    expected = 2 * np.sin(math.pi / 2 * np.clip(tau - 1, 0, 2))
    # 256 straight lines: (pi / 256)^2 / 8 of the peak
    assert_allclose([load_at(sine, t)[0] for t in tau], expected, atol=4e-5)


# --- orders


def test_orders_of_the_integrators():
    q = load(alpha=2.0, static=(0.3, 0.0), unbalance=0.1)
    span = 6.0
    exact = reference(q, span, film_ratio=0.5)[:2]

    def error(integrator, step):
        run = run_orbit(short_film(0.5), q, duration=span, integrator=integrator, step=step)
        assert run.tau[-1] == pytest.approx(span)
        return np.hypot(*(run.position[-1] - exact))

    # the leading term of both at steps well below the damping's 1 / 4
    assert math.log2(error("euler", 0.01) / error("euler", 0.005)) == pytest.approx(1, abs=0.1)
    assert math.log2(error("rk4", 0.04) / error("rk4", 0.02)) == pytest.approx(4, abs=0.4)


def test_adaptive_error_follows_the_tolerance():
    q = load(alpha=2.0, static=(0.3, 0.0), unbalance=0.1)
    exact = reference(q, 20.0, film_ratio=0.5)[:2]
    errors, calls = [], []
    for tolerance in (1e-3, 1e-5, 1e-7, 1e-9):
        run = run_orbit(short_film(0.5), q, duration=20.0, sample_step=20.0, tolerance=tolerance)
        errors.append(np.hypot(*(run.position[-1] - exact)))
        calls.append(run.calls)
    # damped: the errors of single steps do not add up
    assert np.all(errors < np.array([1e-3, 1e-5, 1e-7, 1e-8]))
    # an error per step of fourth order: a hundredth of it for 10^(2/4) = 3.2 times the calls
    assert calls[3] / calls[2] == pytest.approx(3.2, rel=0.15)


def test_samples_between_adaptive_steps_are_as_good_as_the_steps():
    q = load(alpha=2.0, static=(0.3, 0.0), unbalance=0.1)
    fine = run_orbit(short_film(0.5), q, duration=12.0, sample_step=0.01, tolerance=1e-6)
    truth = run_orbit(short_film(0.5), q, duration=12.0, sample_step=0.01, tolerance=1e-10)
    assert fine.steps < len(fine.tau) / 4
    # a few times what the ends of steps are allowed
    assert_allclose(fine.position, truth.position, atol=3e-6)
    assert_allclose(fine.velocity, truth.velocity, atol=2e-5)


def test_euler_is_the_papers():
    """Velocity first, position with the new velocity (its equations 10 and 11)."""
    q = load(**PAPER, **step_history(1.0, (1.0, 0.0)))
    run = run_orbit(short_film(2 / 3), q, duration=4.0, integrator="euler", step=0.02)
    place, speed = np.zeros(2), np.zeros(2)
    for n in range(len(run.tau)):
        assert_allclose(run.position[n], place, atol=1e-13)
        force = np.array(short_force(2 / 3, *place, *speed))
        speed = speed + 0.02 * (q.alpha * force + load_at(q, n * 0.02 + 1e-9))
        place = place + 0.02 * speed


# --- the source paper


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_step_load(film, integrator):
    run = paper_run(film, step_history(16 * math.pi, (1.0, 0.0)), integrator=integrator)
    before = run.position[run.tau < 16 * math.pi][-1]
    # the paper's own figures within what its coarse stop and step leave open
    assert_allclose(before, (0.1147, 0.3029), atol=0.006)
    assert_allclose(run.position[-1], (0.411, 0.4654), atol=0.006)
    # converged, on its mesh: it still swings by 4e-4 when the step comes
    assert_allclose(before, FIRST, atol=5e-4)
    assert_allclose(run.position[-1], SECOND, atol=2e-4)


def test_equilibria_on_finer_meshes():
    """What the paper's mesh leaves open: a few tenths of a thousandth."""
    fine = impedance_map(FilmGeometry(length_to_diameter=2 / 3, n_theta=144, n_z=33))
    run = paper_run(map_film(fine, 2 / 3), step_history(60 * TURN, (1.0, 0.0)), duration=120 * TURN)
    before = run.position[run.tau < 60 * TURN][-1]
    assert_allclose(before, FIRST, atol=1e-3)
    assert_allclose(run.position[-1], SECOND, atol=1e-3)
    # and those of an independent run
    assert_allclose(before, (0.1192, 0.3006), atol=1e-3)
    assert_allclose(run.position[-1], (0.4121, 0.4607), atol=1e-3)


@pytest.mark.parametrize("kind", ["map", "direct"])
def test_rectangular_pulse(film, kind):
    chosen = film if kind == "map" else solved_film(SEED_CASE)
    run = paper_run(chosen, rectangular_history(16 * math.pi, 18 * math.pi, (1.0, 0.0)))
    trace = film_trace(chosen, run)
    n = np.searchsorted(run.tau, 16 * math.pi) - 1
    assert trace.peak_pressure.max() / trace.peak_pressure[n] == pytest.approx(4.6, rel=0.02)
    assert trace.force[:, 0].min() / trace.force[n, 0] == pytest.approx(3.9, rel=0.02)
    # back at the first equilibrium, but for a swing that is left
    assert_allclose(run.position[-1], FIRST, atol=5e-4)
    # a force is the film's where it is asked for
    expected = film_force(chosen, *run.position[n], *run.velocity[n])
    assert_allclose(trace.force[n], expected, rtol=1e-9)


def test_half_sine_disturbs_less(film):
    runs = [
        paper_run(film, history)
        for history in (
            rectangular_history(16 * math.pi, 18 * math.pi, (1.0, 0.0)),
            half_sine_history(16 * math.pi, 17 * math.pi, (1.0, 0.0)),
        )
    ]
    away = [np.hypot(*(run.position[2514:] - run.position[2513]).T).max() for run in runs]
    assert away[1] < 0.9 * away[0]
    peaks = [film_trace(film, run).peak_pressure.max() for run in runs]
    assert peaks[1] < 0.95 * peaks[0]
    assert_allclose(runs[1].position[-1], FIRST, atol=5e-4)


@pytest.mark.parametrize("eccentricity", [0.5, 0.9, 0.99])
def test_every_start_ends_at_the_same_point(film, eccentricity):
    for angle in np.arange(0, TURN, TURN / 12):
        start = (eccentricity * math.cos(angle), eccentricity * math.sin(angle))
        run = run_orbit(film, load(**PAPER), duration=400.0, start=start, sample_step=1.0)
        assert run.status is OrbitStatus.OK
        # swings die out by exp(-0.036 tau) or faster: 1e-6 is left
        assert_allclose(run.position[-1], FIRST, atol=2e-4)
        assert run.calls < 8000


def test_map_orbit_is_the_direct_orbit(film):
    history = step_history(16 * math.pi, (1.0, 0.0))
    for options in ({"integrator": "euler", "duration": 80.0}, {"integrator": "adaptive"}):
        ours = paper_run(film, history, **options)
        solved = paper_run(solved_film(SEED_CASE), history, **options)
        away = np.hypot(*(ours.position - solved.position).T)
        assert away.max() < 1e-3
        assert away.max() > 1e-6  # they are two computations


# --- thresholds and whirl


def matched(force, eccentricity, speed):
    """Load of a rigid rotor, per bearing, at an eccentricity and at speed sqrt(C / g) omega.

    Its equilibrium is at the first place returned: the film carries weight 1 / speed^2 along X.
    """
    f_x, f_y = force(eccentricity, 0.0, 0.0, 0.0)
    weight = speed**-2
    turn = math.pi - math.atan2(f_y, f_x)
    place = (eccentricity * math.cos(turn), eccentricity * math.sin(turn))
    return load(alpha=weight / math.hypot(f_x, f_y), static=(weight, 0.0)), place


def growth(film, force, eccentricity, speed):
    """Rate at which a disturbance of 1e-4 grows, per radian, and the run."""
    q, place = matched(force, eccentricity, speed)
    run = run_orbit(
        film,
        q,
        duration=120 * TURN,
        start=(place[0] + 1e-4, place[1]),
        sample_step=TURN / 64,
        tolerance=1e-7,
    )
    tail = run.position[64 * 20 :] - place
    tail = tail - tail.mean(axis=0)
    turns = np.hypot(*tail.T)[: len(tail) // 256 * 256].reshape(-1, 256).max(axis=1)
    return np.polyfit(4 * TURN * np.arange(len(turns)), np.log(turns), 1)[0], run


def crossing(film, force, eccentricity, near):
    """Speed at which disturbances stop decaying, from the two sides of `near`."""
    speeds = near * np.array([0.97, 1.03])
    rates = [growth(film, force, eccentricity, speed)[0] for speed in speeds]
    assert rates[0] < 0 < rates[1]
    return speeds[0] + (speeds[1] - speeds[0]) * -rates[0] / (rates[1] - rates[0])


# Rigid rotor in short bearings, an independent computation from closed-form coefficients
@pytest.mark.parametrize(
    ("eccentricity", "threshold"), [(0.1, 2.741), (0.3, 2.606), (0.5, 2.542), (0.6, 2.701)]
)
def test_threshold_of_the_short_film(eccentricity, threshold):
    found = crossing(short_film(0.25), lambda *s: short_force(0.25, *s), eccentricity, threshold)
    # rates are straight lines over 6 % of speed within a hundredth of that, at most
    assert found == pytest.approx(threshold, rel=0.01)


def linear_threshold(force, eccentricity):
    """From the Routh-Hurwitz criterion on central differences of the force."""
    h = 1e-4
    f = np.hypot(*force(eccentricity, 0.0, 0.0, 0.0))
    here = np.array([eccentricity, 0.0, 0.0, 0.0])
    slopes = np.array(
        [np.subtract(force(*(here + d)), force(*(here - d))) / (2 * h) for d in h * np.eye(4)]
    ).T
    k, b = -slopes[:, :2] / f, -slopes[:, 2:] / f
    kappa = k[0, 0] * b[1, 1] + k[1, 1] * b[0, 0] - k[0, 1] * b[1, 0] - k[1, 0] * b[0, 1]
    kappa /= b[0, 0] + b[1, 1]
    whirl = (k[0, 0] - kappa) * (k[1, 1] - kappa) - k[0, 1] * k[1, 0]
    whirl /= b[0, 0] * b[1, 1] - b[0, 1] * b[1, 0]
    return math.sqrt(kappa / whirl), math.sqrt(whirl)


def test_the_criterion_gives_the_table():
    threshold, whirl = linear_threshold(lambda *s: short_force(0.25, *s), 0.3)
    assert (threshold, whirl) == pytest.approx((2.606, 0.5194), abs=6e-4)


@pytest.mark.parametrize("eccentricity", [0.2, 0.5])
def test_threshold_of_the_map(film, eccentricity):
    """The threshold is from direct solves, the run from the map."""
    work = direct_film(SEED_CASE)
    threshold, _ = linear_threshold(lambda *s: direct_force(work, *s), eccentricity)

    def force(*s):
        return film_force(film, *s)

    assert crossing(film, force, eccentricity, threshold) == pytest.approx(threshold, rel=0.03)


def test_whirl_near_half_speed():
    def force(*s):
        return short_force(0.25, *s)

    _, small = growth(short_film(0.25), force, 0.3, 0.9 * 2.606)
    assert np.hypot(*(small.position[-640:] - small.position[-1]).T).max() < 1e-6
    q, place = matched(force, 0.3, 1.1 * 2.606)
    run = run_orbit(
        short_film(0.25),
        q,
        duration=320 * TURN,
        start=(place[0] + 1e-3, place[1]),
        sample_step=TURN / 32,
    )
    tail = run.position[-32 * 128 :] @ [1, 1j]
    spectrum = np.abs(np.fft.fft((tail - tail.mean()) * np.hanning(len(tail))))
    order = np.fft.fftfreq(len(tail), 1 / 32)[spectrum.argmax()]
    assert 0.45 < order < 0.53  # forward, near half speed
    assert np.abs(tail - tail.mean()).max() > 0.3  # a large limit cycle
    assert run.status is OrbitStatus.OK


# --- symmetries


@pytest.mark.parametrize("kind", ["short", "map", "direct"])
def test_turned_load_turned_orbit(film, kind):
    """Exact for a quarter turn, which maps the mesh onto itself."""

    # away from the direct film's mesh nothing is exact: its quarter is 18 nodes
    def path(turns):
        chosen = {
            "short": lambda: short_film(0.5),
            "map": lambda: film,
            "direct": lambda: solved_film(SEED_CASE),
        }[kind]()
        c, s = round(math.cos(turns)), round(math.sin(turns))

        def turned(x, y):
            return (c * x - s * y, s * x + c * y)

        q = load(
            alpha=0.8,
            static=turned(0.4, 0.1),
            unbalance=0.1,
            phase=turns,
            **step_history(5.0, turned(0.3, -0.2)),
        )
        run = run_orbit(
            chosen, q, duration=12.0, start=turned(0.2, 0.3), integrator="rk4", step=0.02
        )
        return run.position @ np.array([[c, -s], [s, c]])

    straight = path(0.0)
    # rounding, amplified a little by the way
    assert_allclose(path(math.pi / 2), straight, atol=1e-10)
    assert np.ptp(straight) > 0.1


def test_same_run_same_bytes(film):
    history = step_history(16 * math.pi, (1.0, 0.0))
    first, second = paper_run(film, history), paper_run(film, history)
    assert_array_equal(first.position, second.position)
    assert (first.calls, first.steps) == (second.calls, second.steps)


# --- failures


def test_step_too_long_for_the_squeeze_stiffness(film):
    # towards the wall at 0.95: the film damps by some 400 per radian
    towards = {"start": (0.95, 0.0), "start_velocity": (0.1, 0.475), "duration": 20.0}
    q = load(**PAPER)
    for integrator in ("euler", "rk4"):
        run = run_orbit(film, q, integrator=integrator, step=0.02, **towards)
        assert run.status is OrbitStatus.STEP
        assert "adaptive" in run.status.text
        shorter = run_orbit(film, q, integrator=integrator, step=0.002, **towards)
        assert shorter.status is OrbitStatus.OK
    assert run_orbit(film, q, **towards).status is OrbitStatus.OK


def test_the_stability_bound_is_where_it_bites(film):
    """At the bound's own step: 5 % below it a run is smooth, 30 % above it ends with the status."""
    start = {"start": (0.9, 0.0), "start_velocity": (0.02, 0.45)}
    h = 1e-6
    here = np.array([0.9, 0.0, 0.02, 0.45])
    b = [
        np.subtract(film_force(film, *(here + d)), film_force(film, *(here - d))) / (2 * h)
        for d in h * np.eye(4)[2:]
    ]
    damping = 0.83537 * np.abs(np.linalg.eigvals(np.array(b))).max()
    for factor, status in ((0.95, OrbitStatus.OK), (1.3, OrbitStatus.STEP)):
        step = factor * 2 / damping
        run = run_orbit(film, load(**PAPER), duration=step, integrator="euler", step=step, **start)
        assert run.status is status


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_a_load_that_no_film_carries(film, integrator):
    q = load(alpha=0.5, static=(4000.0, 0.0))
    run = run_orbit(film, q, duration=20.0, integrator=integrator, step=1e-4, sample_step=0.01)
    assert run.status is OrbitStatus.OVERLOAD
    assert run.end < 20
    assert len(run.tau) == int(run.end / 0.01 + 1e-6) + 1
    assert np.all(np.isfinite(run.position))
    assert np.all(run.eccentricity <= film.last_eccentricity)


def test_a_blow_to_the_end_of_the_map():
    coarse = map_film(impedance_map(SEED_CASE, last_eccentricity=0.8), 2 / 3)
    q = load(**PAPER, **rectangular_history(1.0, 1.5, (30.0, 0.0)))
    assert run_orbit(coarse, q, duration=20.0).status is OrbitStatus.THIN
    q = load(**PAPER, **rectangular_history(1.0, 1.5, (3.0, 0.0)))
    assert run_orbit(coarse, q, duration=20.0).status is OrbitStatus.OK


def test_no_film_and_no_wall_is_contact():
    run = run_orbit(no_film(), load(alpha=1.0), duration=5.0, start_velocity=(0.5, 0.0))
    assert run.status is OrbitStatus.CONTACT
    assert run.end >= 2.0


def test_too_many_steps(film):
    run = run_orbit(film, load(**PAPER), duration=50.0, max_steps=20)
    assert run.status is OrbitStatus.STEPS
    assert 0 < run.end < 50


def test_a_state_that_is_not_finite():
    run = run_orbit(
        no_film(),
        load(alpha=1.0, static=(1e300, 0.0)),
        duration=9.0,
        integrator="euler",
        step=1e9,
        sample_step=1e9,
    )
    assert run.status is OrbitStatus.OK  # no step was asked for
    q = load(alpha=1.0, static=(1e308, 0.0))
    run = run_orbit(no_film(), q, duration=3e2, integrator="euler", step=1e2)
    assert run.status is OrbitStatus.DIVERGED


def test_direct_film_without_a_pressure():
    bore = np.zeros(72)
    bore[30:40] = -0.5  # a bump that the journal runs into
    film = solved_film(FilmGeometry(length_to_diameter=2 / 3, bore=bore))
    # within the clearance circle, but on the bump
    run = run_orbit(film, load(**PAPER), duration=20.0, start=(-0.6, 0.0))
    assert run.status is OrbitStatus.FILM
    assert run.end == 0
    assert "bore" in run.status.text


def test_refusals(film):
    with pytest.raises(ValueError, match="alpha = 0 must be > 0") as caught:
        load(alpha=0.0, unbalance=-1.0, time=[1.0, 0.5], history=[(0, 0), (0, 0)])
    assert "unbalance = -1 must be >= 0" in str(caught.value)
    assert "time[1] = 0.5 must be >= time[0] = 1" in str(caught.value)
    with pytest.raises(ValueError, match=r"history\.shape = \(1, 2\) must be \(2, 2\)"):
        load(alpha=1.0, time=[0.0, 1.0], history=[(0, 0)])
    with pytest.raises(ValueError, match="both be given"):
        load(alpha=1.0, time=[0.0])
    with pytest.raises(ValueError, match="must be finite"):
        load(alpha=1.0, time=[0.0], history=[(math.nan, 0.0)])
    q = load(**PAPER)
    with pytest.raises(ValueError, match="integrator = 'leapfrog' must be one of euler") as caught:
        run_orbit(film, q, duration=-1.0, start=(0.9, 0.5), integrator="leapfrog", step=0.0)
    assert "duration = -1 rad must be >= 0" in str(caught.value)
    assert "step = 0 must be > 0" in str(caught.value)
    assert "eccentricity 1.02956 and must lie within 0.995" in str(caught.value)


# --- wall


def wall(**fields):
    contact = np.zeros(1, CONTACT)
    usual = {"stiffness": 1e4, "clearance": 1.0, "speed_floor": 1e-6, "friction_speed": 1e-3}
    for name, value in {**usual, **fields}.items():
        contact[name] = value
    return Wall(1, contact, 1000.0)


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_bounce_off_the_wall(integrator):
    """A radial impact without film returns with the restitution of its law."""
    law = wall(law=LAW_HYSTERESIS, hysteresis=hysteresis("exact", 0.6))
    run = run_orbit(
        no_film(),
        load(alpha=1.0),
        duration=4.0,
        start_velocity=(0.6, 0.8),
        integrator=integrator,
        step=1e-4,
        sample_step=0.01,
        tolerance=1e-6,
        wall=law,
    )
    assert run.status is OrbitStatus.OK
    # a contact of pi / 100 in some 300 steps; its speed at first touch is the flight's
    assert_allclose(run.velocity[-1], (-0.36, -0.48), atol=2e-4)
    assert 1.0 < run.eccentricity.max() < 1.02


def test_rest_on_the_wall(film):
    """What the film does not carry at its end, the wall does; friction leans against the turn."""
    q = load(alpha=0.05, static=(200.0, 0.0))
    lean = wall(damping=200.0, friction=0.1)
    run = run_orbit(film, q, duration=60.0, sample_step=0.1, wall=lean)
    assert run.status is OrbitStatus.OK
    x, y = run.position[-1]
    distance = math.hypot(x, y)
    push = 1e4 * (distance - 1)
    film_x, film_y = np.multiply(0.05, film_force(film, x, y, 0.0, 0.0))
    n_x, n_y = x / distance, y / distance
    balance_x = 200 + film_x - push * n_x + 0.1 * push * n_y
    balance_y = film_y - push * n_y - 0.1 * push * n_x
    # at rest within what the last steps leave of the velocity times the damping
    assert_allclose([balance_x, balance_y], 0, atol=0.2)
    assert push > 100
    assert run_orbit(film, q, duration=60.0).status is OrbitStatus.OVERLOAD


def test_a_soft_wall_is_left_with_a_status(film):
    q = load(alpha=0.05, static=(200.0, 0.0))
    run = run_orbit(film, q, duration=60.0, wall=wall(stiffness=1000.0, damping=50.0))
    assert run.status is OrbitStatus.OVERLAP


def test_friction_brakes_the_surface():
    """At rest against the turning surface: the wall pushes the journal against the rotation."""

    def lean(friction):
        q = load(alpha=1.0, static=(1.0, 0.0))
        law = wall(damping=20.0, friction=friction)
        run = run_orbit(no_film(), q, duration=0.5, start=(1.0, 0.0), sample_step=0.01, wall=law)
        return run.position[-1, 1]

    assert lean(0.0) == pytest.approx(0.0, abs=1e-12)
    # -mu g tau^2 / 2 for as long as the angle is small
    assert lean(0.1) == pytest.approx(-0.0125, rel=0.05)


def test_equilibrium_by_roots_is_where_the_orbit_ends():
    """The short film at rest, from its load-carrying alone."""
    q = load(alpha=2.0, static=(0.0, -0.5))
    e = brentq(lambda e: 2 * math.hypot(*short_force(0.5, e, 0.0, 0.0, 0.0)) - 0.5, 0.01, 0.9)
    run = run_orbit(short_film(0.5), q, duration=600.0, sample_step=10.0, tolerance=1e-8)
    assert run.eccentricity[-1] == pytest.approx(e, abs=1e-6)
