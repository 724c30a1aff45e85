"""Films, margins and jacks of the align page against the line itself."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.diagnose.alignment.align import align
from wearstate.diagnose.alignment.films import (
    FILM_HEAD,
    film_cells,
    film_rows,
    film_states,
    moved_scene,
    resting,
)
from wearstate.diagnose.alignment.films import _curves as curves
from wearstate.diagnose.alignment.films import _plan as plan_of
from wearstate.diagnose.alignment.films import _pressure_unit as pressure_unit
from wearstate.diagnose.alignment.films import _response_figure as response_figure
from wearstate.diagnose.alignment.margins import jack_rows, margin_of, margin_rows
from wearstate.diagnose.alignment.page import align_html
from wearstate.diagnose.alignment.table import align_table
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.alignment.alignment import Check, check, reactions
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.at_rest import shaft_state

MOVES = {"third": 0.25e-3}


@pytest.fixture(scope="module")
def rig():
    return load_scene("shaft-rig")


@pytest.fixture(scope="module")
def states(rig):
    return film_states(rig, MOVES)


def rows_of(states, bearing, **wanted):
    return [
        row
        for row in film_rows(states)
        if row["bearing"] == bearing and all(row[k] == v for k, v in wanted.items())
    ]


def test_films_are_those_of_the_running_line(rig, states):
    state = shaft_state(rig).film
    for i, bearing in enumerate(rig.bearings):
        [row] = rows_of(states, bearing.name, after=False, speed_hz=10.0)
        assert row["stiffness_up_n_per_m"] == pytest.approx(state.stiffness[i, 0, 0], rel=1e-6)
        assert row["tilt_up_rad"] == pytest.approx(state.slopes[i, 0], rel=1e-6)
        assert row["least_film_m"] == pytest.approx(state.least_film[i], rel=1e-6)


def test_the_moves_shift_load_and_stiffness_to_the_bearing_that_rises(states):
    """Section 2.1 of the source paper: what carries more has the stiffer film."""
    for speed in (7.5, 10.0, 12.5):
        [before] = rows_of(states, "third", after=False, speed_hz=speed)
        [after] = rows_of(states, "third", after=True, speed_hz=speed)
        assert after["load_n"] > 2 * before["load_n"]
        assert after["stiffness_up_n_per_m"] > 2 * before["stiffness_up_n_per_m"]
        assert after["least_film_m"] < before["least_film_m"]
    thickness = [row["least_film_m"] for row in rows_of(states, "third", after=False)]
    assert thickness == sorted(thickness)  # faster, thicker


def test_pressures_carry_the_load(states):
    """The integral of the drawn pressure over the bore is the reaction."""
    film = states[1].film
    for i, bearing in enumerate(film.bearings):
        pressure = np.asarray(film.films[i].pressure) * pressure_unit(bearing.worn, film.speed)
        angle = 2 * math.pi * np.arange(pressure.shape[0]) / pressure.shape[0]
        own = bearing.bearing
        along = np.trapezoid(pressure, dx=own.length / (pressure.shape[1] - 1), axis=1)
        ring = own.diameter / 2 * 2 * math.pi / pressure.shape[0]
        up = float(ring * (along @ np.cos(angle)))  # on the journal, from below
        # to the rule of the mesh: a kilopascal of the rim is shared between nodes
        assert up == pytest.approx(film.reactions[i, 0], rel=0.01)


def test_table_for_people_says_before_and_after(states):
    cells = film_cells(states)
    assert len(cells) == 4 * 3
    assert all(len(row) == len(FILM_HEAD) for row in cells)
    assert cells[0][:2] == ("aft", "450")
    assert all("→" in cell for row in cells for cell in row[2:])
    assert not resting(states)


def test_a_line_that_finds_no_rest_is_told():
    found = film_states(moved_scene(load_scene("shaft-rig"), {}, {"second": 0.02}), speeds=(1.0,))
    assert found[0].film is None
    assert "has no equilibrium on its films" in resting(found)[0]


# --- margins and jacks


def test_a_margin_is_the_distance_from_the_nearer_bound():
    both = {"condition": "cold", "bearing": "aft", "quantity": "slope"}
    assert margin_of(Check(**both, value=-2.0, least=-4.0, most=4.0)) == pytest.approx(0.5)
    assert margin_of(Check(**both, value=5.0, least=-4.0, most=4.0)) == pytest.approx(-0.25)
    assert margin_of(Check(**both, value=1.0, least=-math.inf, most=math.inf)) == math.inf


def test_margins_before_and_after_are_those_of_the_states(rig):
    found = align(load_scene("shaft-rig", {"bearings.2.offset": "-0.4 mm"}))
    rows = margin_rows(found.states, found.calibration.after)
    for row in rows:
        for states, key in ((found.states, "before"), (found.calibration.after, "after")):
            own = [c for s in states for c in check(s) if c.bearing == row["bearing"]]
            assert row[key]["margin"] == pytest.approx(min(margin_of(c) for c in own))
    assert min(row["before"]["margin"] for row in rows) < 0
    assert min(row["after"]["margin"] for row in rows) > -1e-6


def test_work_of_a_jack_is_that_of_the_reactions_on_the_way():
    """By small steps of the line solved anew, all bearings in contact."""
    found = align(load_scene("shaft-rig"), target="even")
    row = max(jack_rows(found.states, found.calibration), key=lambda one: abs(one["move_m"]))
    assert abs(row["move_m"]) > 1e-5
    line, condition = found.line, found.states[0].condition
    number = line.seat(row["bearing"])
    steps = np.linspace(0, row["move_m"], 9)
    loads = [
        reactions(line.moved({row["bearing"]: u}), condition, unilateral=False).reactions[number]
        for u in steps
    ]
    assert row["work_j"] == pytest.approx(np.trapezoid(loads, steps), rel=1e-6)


# --- page and JSON


def test_page_and_json_hold_films_margins_and_jacks(rig):
    found = align(rig)
    table = align_table(found)
    assert len(table["films"]) == 2 * 3 * 4
    assert [row["bearing"] for row in table["jacks"]] == [b.name for b in rig.bearings]
    json.dumps(table, allow_nan=False)
    page = align_html(found)
    for text in (
        "Oil films by speed, as set → after the moves",
        "Distance from the nearest limit",
        "Moves and jacking effort, cold",
        "Film pressure (computed), over length and angle",
        "Accelerance of the housings from the model",
    ):
        assert text in page


def test_a_picture_of_transfer_functions_shows_what_moves_do(rig):
    plan = plan_of(rig, None)

    def levels(moves):
        figure = response_figure(plan, curves(rig, moves, {}, plan), None, 2)
        return [line.get_ydata() for line in figure.axes[0].get_lines()]

    before, after = levels(MOVES)
    assert 1 < np.abs(after - before).max() < 3  # dB, of the bearing that rises by .25 mm
    [alone] = levels({})
    np.testing.assert_allclose(alone, before)


@pytest.mark.slow  # a search for a rest that there is not, six times
def test_a_line_that_bends_into_its_bores_still_has_a_page(tmp_path):
    page = tmp_path / "page.html"
    arguments = ["align", "shaft-rig", "--set", "bearings.1.slope=0.02 rad", "-o", str(page)]
    told = CliRunner().invoke(cli, arguments)
    assert told.exit_code == 0, told.output
    assert "has no equilibrium on its films" in page.read_text(encoding="utf-8")
