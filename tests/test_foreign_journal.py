"""The second independent journal of tests/benchmarks/foreign.py is physical."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(
    0, str(Path(__file__).parent / "benchmarks")
)  # its files import one another by name

import foreign_journal as foreign
from foreign_records import Job

CLEARANCE, OMEGA, VISCOSITY = 70e-6, 314.0, 0.03
ALL = foreign.Built(oval=5e-6, tilt=(0.2e-3, -0.1e-3), groove=np.radians(20), feed=1e5, warm=0.4)


@pytest.mark.parametrize(
    ("ratio", "eccentricity", "sommerfeld", "attitude"),
    [
        (1.0, 0.4, 0.264, 63.10),
        (1.0, 0.6, 0.121, 50.58),
        (0.5, 0.6, 0.319, 48.14),
        (0.5, 0.8, 0.0923, 33.31),
    ],
)
def test_a_round_bearing_carries_the_load_of_raimondi_and_boyd(
    ratio, eccentricity, sommerfeld, attitude
):
    """Trans. ASLE 1 (1958) 159-209, tables for 360 degrees; they print three digits."""
    length = ratio * foreign.DIAMETER
    pressure = (foreign.RADIUS / CLEARANCE) ** 2 * VISCOSITY * OMEGA / (2 * np.pi) / sommerfeld
    film = foreign.Film(CLEARANCE, OMEGA, VISCOSITY, foreign.Built(), length=length)
    x, y = film.rest(np.array([pressure * length * foreign.DIAMETER, 0.0]))
    assert np.hypot(x, y) / CLEARANCE == pytest.approx(eccentricity, abs=0.005)
    # where little load lies beside the line of centres their coarse mesh tells the angle worse
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(attitude, abs=2.5)


def test_a_bearing_as_built_is_what_the_draw_says():
    film = foreign.Film(CLEARANCE, OMEGA, VISCOSITY, ALL)
    load = np.array([6000.0, 0.0])
    place = film.rest(load)
    assert film.force(*place) == pytest.approx(-load, abs=3.0)  # settled within 1e-4 of the load
    gap = film.gap(0.0, 0.0)
    along, across = gap[[0, foreign.N_THETA // 4]].mean(axis=1)
    assert across - along == pytest.approx(2 * ALL.oval, rel=1e-9)
    assert gap[0, 0] - gap[0, -1] == pytest.approx(ALL.tilt[0] * foreign.LENGTH, rel=1e-9)
    assert np.ptp(film.viscosity) == pytest.approx(ALL.warm * VISCOSITY, rel=0.01)
    assert film.pressure[film.groove == 1] == pytest.approx(ALL.feed)


def test_a_small_orbit_is_the_linear_one():
    """Of an unbalance so small that the film's curvature does not matter."""
    run = foreign.conditions_draw(1, 0)
    machine = foreign.journal_draw(1, 0)
    film = foreign.Film(CLEARANCE, 2 * np.pi * run.speed_hz, run.viscosity, foreign.Built())
    places, angle = foreign.moved(film, machine, run, 1024)
    found = np.linalg.lstsq(
        np.stack([np.ones(1024), np.cos(angle), -np.sin(angle)], axis=1), places, rcond=None
    )[0]
    omega, step = film.omega, 1e-8 * np.array([1.0, 1.0, film.omega, film.omega])
    slopes = film.slopes(found[0], step)
    mass = foreign.MASS * np.eye(2)
    dynamic = -slopes[:, :2] - omega**2 * mass - 1j * omega * slopes[:, 2:]
    turning = np.exp(1j * machine.unbalance_angle) * np.array([1.0, -1j])
    wanted = np.linalg.solve(dynamic, machine.unbalance * omega**2 * turning)
    assert found[1] + 1j * found[2] == pytest.approx(wanted, rel=0.03)


def test_a_record_has_the_same_machine_whatever_is_switched_on():
    job = Job(seed=1, machine=0, record=0, healthy=False, on=frozenset())
    plain, values = foreign.record(job)
    other, same = foreign.record(
        Job(seed=1, machine=0, record=0, healthy=False, on=frozenset(foreign.DIFFERENCES))
    )
    assert values == same
    assert plain.shape == other.shape == (3, foreign.JOURNAL.n_samples)
    assert (plain[2] == other[2]).all()
    apart = np.abs(plain[:2].mean(axis=1) - other[:2].mean(axis=1)).max()
    assert 0.2e-6 < apart < 0.2 * values["diametral_clearance_bearing_m"]
