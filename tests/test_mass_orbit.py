"""A journal in a film that keeps its mass."""

import math

import numpy as np
import pytest
from wearstate.sim.film.impedance_map import impedance_map
from wearstate.sim.film.mass_conserving import mass_conserving, oil_intake
from wearstate.sim.film.solve import FilmGeometry, FilmState
from wearstate.sim.journal.load import Load, load
from wearstate.sim.journal.mass_orbit import mass_orbit
from wearstate.sim.journal.orbit import run_orbit
from wearstate.sim.journal.orbit_film import map_film
from wearstate.sim.journal.orbit_status import OrbitStatus

# Ausas, Jai, Buscaglia (2009), section 5: lengths over the circumference, time over a period of
# the load, in which the shaft turns once; gap 1 + X cos 2 pi x, so that X and Y point the other way
LENGTH, MASS, FEED = 0.1, 1e-6, 0.0075
PER_FORCE = LENGTH / (24 * math.pi**2)  # their force in one of ours, since P = 12 pi p
PER_INERTIA = MASS * 4 * math.pi**2
TURN = 2 * math.pi


def ausas_load(periods: int) -> Load:
    """Two knocks a period, at a quarter and at half of it, and next to nothing between."""
    tau = np.linspace(0.0, TURN * periods, 2000 * periods + 1)
    time = tau / TURN % 1.0
    first, second = np.exp(-400 * (time - 0.25) ** 2), np.exp(-400 * (time - 0.5) ** 2)
    force = np.column_stack([0.01 * (first + 0.95534 * second), 0.0029552 * second])
    return load(alpha=PER_FORCE / PER_INERTIA, time=tau, history=-force / PER_INERTIA)


def ausas_run(n_theta: int, n_z: int, steps: int):
    bearing = FilmGeometry(length_to_diameter=math.pi * LENGTH, n_theta=n_theta, n_z=n_z)
    return mass_orbit(
        bearing,
        ausas_load(1),
        duration=TURN,
        step=TURN / steps,
        start=(-0.5, -0.5),
        end_pressure=(12 * math.pi * FEED, 0.0),
    )


def test_the_benchmark_of_ausas_against_the_force_map():
    run = ausas_run(60, 7, 250)
    assert run.status is OrbitStatus.OK
    ratio = math.pi * LENGTH
    bearing = FilmGeometry(length_to_diameter=ratio, n_theta=60, n_z=7)
    film = map_film(impedance_map(bearing), ratio)
    other = run_orbit(
        film, ausas_load(1), duration=TURN, start=(-0.5, -0.5), step=TURN / 250, tolerance=1e-4
    )
    apart = np.hypot(*(run.position - other.position).T)
    knock = slice(62, 146)  # from the top of the first knock to the end of the second
    # a map knows neither the oil that is missing nor the pressure at one end: median 0.009 and at
    # most 0.015 at 200 x 20 cells and 1000 steps; a step of 1/250 doubles that
    assert np.median(apart[knock]) < 0.02
    assert apart[knock].max() < 0.035
    # and where nothing loads the journal these two decide: 0.08 to 0.15 of C at 200 x 20
    assert apart[210:].max() > 0.05
    # what the knock opens stays empty for a while; then the feed has filled it again
    assert run.filled[50:65].min() < 0.9 < 0.98 < run.filled[-1]
    # the thinnest film of a period is not that under the highest load, but that of the journal
    # which rolls along the wall with nothing to push it
    at = np.argmax(run.eccentricity)
    assert run.tau[at] > 0.6 * TURN


def test_the_step_is_of_first_order():
    ends = [ausas_run(40, 5, steps).position[steps // 4 * 2] for steps in (120, 240, 480)]
    coarse, fine = ends[0] - ends[1], ends[1] - ends[2]
    # first order halves what a halved step changes; the film's edge jumps from cell to cell
    assert 1.5 < np.linalg.norm(coarse) / np.linalg.norm(fine) < 2.8


def test_a_steady_load_is_carried_by_the_steady_film():
    bearing = FilmGeometry(length_to_diameter=0.5, n_theta=60, n_z=9)
    feed, q = 0.5, load(alpha=10.0, static=(20.0, 0.0))
    run = mass_orbit(bearing, q, duration=120.0, step=0.2, end_pressure=feed)
    assert run.status is OrbitStatus.OK
    x, y = run.position[-1]
    steady = mass_conserving(bearing, FilmState(x=x, y=y), end_pressure=feed)
    # the journal stands still to a thousandth of C in a radian
    assert np.allclose(steady.force, (-2.0, 0.0), atol=0.005)
    assert run.filled[-1] == pytest.approx(1.0, abs=0.2)


def test_without_oil_the_journal_falls_freely():
    bearing = FilmGeometry(length_to_diameter=0.5, n_theta=20, n_z=5)
    run = mass_orbit(bearing, load(alpha=1.0, static=(0.01, 0.0)), duration=8.0, step=0.1, fill=0.0)
    n = np.arange(len(run.tau))
    assert np.allclose(run.position[:, 0], 0.01 * 0.1**2 * n * (n + 1) / 2, atol=1e-9)


def test_what_is_wrong_is_told_at_once():
    bearing = FilmGeometry(length_to_diameter=0.5, condition="guembel")
    with pytest.raises(
        ValueError, match=r"guembel(.|\n)*duration(.|\n)*step(.|\n)*start(.|\n)*fill"
    ):
        mass_orbit(bearing, load(alpha=1.0), duration=-1.0, step=0.0, start=(1.0, 0.0), fill=2.0)


def test_a_journal_that_nothing_holds_touches():
    bearing = FilmGeometry(length_to_diameter=0.5, n_theta=20, n_z=5)
    run = mass_orbit(bearing, load(alpha=1e-9, static=(1.0, 0.0)), duration=5.0, step=0.5)
    assert run.status is OrbitStatus.CONTACT
    # 0.5^2 n (n + 1) / 2 passes 1 at the third step
    assert len(run.tau) == 3


def test_a_step_whose_end_is_not_found_has_its_status(monkeypatch):
    monkeypatch.setattr("wearstate.sim.journal.mass_orbit._MOST_TRIALS", 1)
    bearing = FilmGeometry(length_to_diameter=0.5, n_theta=20, n_z=5)
    run = mass_orbit(bearing, load(alpha=10.0, static=(1.0, 0.0)), duration=5.0, step=0.5)
    assert run.status is OrbitStatus.UNSETTLED
    assert "shorten the step" in run.status.text


def test_pressure_at_one_end_flows_to_the_other():
    bearing = FilmGeometry(length_to_diameter=0.4, n_theta=24, n_z=9)
    rest = FilmState(x=0.0, y=0.0)
    film = mass_conserving(bearing, rest, end_pressure=(0.3, 0.0))
    assert np.allclose(film.pressure, np.linspace(0.3, 0.0, 9), atol=1e-12)
    intake = oil_intake(bearing, rest, film, end_pressure=(0.3, 0.0)).sum(axis=0)
    # H^3 dP/dz (R/L)^2 / 12 round the circle
    flow = TURN * 0.3 / (4 * 0.4**2) / 12
    assert intake[0] == pytest.approx(flow, rel=1e-9)
    assert intake[-1] == pytest.approx(-flow, rel=1e-9)
