"""Every pair of choices of a scene runs, or is refused in words: no combination surprises.

A pairwise cover: whatever two rungs, laws or switches are taken together, one row has them so.
"""

import itertools
import typing
from random import Random

import pytest
from pydantic import BaseModel
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.output.status import SimulationError
from wearstate.sim.scene.load import load_scene, scene_names
from wearstate.sim.scene.scene import SceneError

SHORT = {
    "bilge-pump": {"duration": "0.21 s", "settling_revolutions": 1},
    "triplex-pump": {"duration": "0.14 s", "settling_revolutions": 1},
    "slider-crank-benchmark": {"duration": "0.03 s", "settling_revolutions": 1},
    "propulsion-shaft": {"duration": "0.4 s"},
    "shaft-rig": {"duration": "0.4 s"},
}
"""A little more than a revolution; scenes of journals are the rest."""

JOURNAL = {"duration": "0.05 s", "film.n_theta": 36, "film.n_z": 9}

NOT_TRIED = {"fidelity", "machine"}  # resolved above this floor; one value for a scene
NEEDS_A_FILE = "file"

CHAMBER = {
    "pressure.dead_volume": 1e-4,
    "pressure.suction_valve": {},
    "pressure.discharge_valve": {},
}
HEADS = {"pressure.suction_line": {}, "pressure.discharge_line": {}}
LINES = {f"{line}.wave_speed": 260 for line in HEADS}
NEEDED = {
    ("drive.rung", "motor"): {
        "drive.motor.breakdown_moment": 500,
        "drive.motor.inertia": 2,
        "drive.motor.rated_slip": 0.03,
    },
    ("pressure.rung", "chamber"): CHAMBER,
    ("pressure.rung", "lumped-lines"): CHAMBER | LINES,
    ("pressure.rung", "wave-lines"): CHAMBER | LINES,
    ("pressure.rung", "heads"): HEADS,
}
"""What a rung needs and a scene may lack."""

SAMPLED = {"journal-bearing": 6, "shaft-rig": 2, "slider-crank-benchmark": 8, "bilge-pump": 9}
"""Rows of the cover that every run of the tests takes; all of them are a campaign."""


def choices(node, path=""):
    """Dotted path and values of every field that is a choice, in a scene as it is written."""
    if isinstance(node, (tuple, list)):
        for index, each in enumerate(node):
            yield from choices(each, f"{path}{index}.")
    if not isinstance(node, BaseModel):
        return
    for name, field in type(node).model_fields.items():
        values = values_of(field.annotation)
        if len(values) > 1 and name not in NOT_TRIED:
            yield path + name, values
        elif not values:
            yield from choices(getattr(node, name), f"{path}{name}.")


def values_of(annotation):
    if annotation is bool:
        return [False, True]
    if typing.get_origin(annotation) is typing.Literal:
        return [value for value in typing.get_args(annotation) if value != NEEDS_A_FILE]
    return []


def cover(fields, random):
    """Rows of values so that every pair of values of two fields stands in one of them."""
    todo = {
        ((a, x), (b, y))
        for (a, left), (b, right) in itertools.combinations(fields, 2)
        for x in left
        for y in right
    }
    rows = []
    while todo:
        row = max((drawn(fields, todo, random) for _ in range(10)), key=lambda r: len(met(r, todo)))
        todo -= met(row, todo)
        rows.append(row)
    return rows


def drawn(fields, todo, random):
    row = {path: random.choice(values) for path, values in fields}
    return row | dict(random.choice(sorted(todo, key=str)))


def met(row, todo):
    return {pair for pair in todo if all(row[path] == value for path, value in pair)}


def settings(name, row):
    """What a scene needs beside its choices: the numbers that a law or a history is made of."""
    found = {**SHORT.get(name, JOURNAL), **row}
    for joint in ("crankpin", "wristpin", "guide"):
        path = f"joint.{joint}"
        if row.get(f"{path}.law", "kelvin-voigt") != "kelvin-voigt":
            found |= {f"{path}.restitution": 0.6, f"{path}.damping": 0}
        if row.get(f"{path}.elasticity") == "hertz":
            found[f"{path}.hertz_stiffness"] = 2e10
        if row.get(f"{path}.elasticity") == "conformal":
            found |= {f"{path}.effective_modulus": "60 GPa", f"{path}.contact_length": "50 mm"}
    for path, value in row.items():
        if path.endswith(".anti_alias") and value != "none":
            found |= {f"{path}_cutoff": "10 kHz", f"{path}_order": 4}
    for path, rung in NEEDED:
        if row.get(path) == rung:
            found = lacking(name, NEEDED[path, rung]) | found
    if row.get("load.history", "none") != "none":
        found |= {"load.amplitude": 2000, "load.begin": "0.02 s", "load.length": "0.01 s"}
    if row.get("load.history") == "none":
        found["load.amplitude"] = 0
    return found


def lacking(name, needed):
    """Of what a rung needs: what the scene has not."""
    scene = load_scene(name)
    return {path: value for path, value in needed.items() if value_at(scene, path) is None}


def value_at(scene, path):
    found = scene
    for key in path.split("."):
        found = getattr(found, key, None)
    return found


def rows_of(name):
    fields = list(choices(load_scene(name)))
    return cover(fields, Random(1))


def outcome(name, row):
    """How a combination ends, and what was said; what else is raised is a defect."""
    try:
        scene = load_scene(name, settings(name, row))
        check(scene)
    except SceneError as error:
        return "refused", error.faults
    try:
        solution = simulate(scene, seed=1)
    except SimulationError as error:
        return error.status.name.lower(), [error.status.text]
    return solution.status.name.lower() if abs(solution.signal).max() > 0 else "silent", []


def judge(name, rows):
    """Every row ran, or was told why not and what to do; one at least ran."""
    ends = [(row, *outcome(name, row)) for row in rows]
    assert [(row, end) for row, end, _ in ends if end == "silent"] == []
    mute = [(row, texts) for row, end, texts in ends if end != "ok" and not all(map(said, texts))]
    assert mute == []
    assert all(texts for _, end, texts in ends if end != "ok")
    assert "ok" in {end for _, end, _ in ends}


def said(text):
    """A fault in words: longer than a name, and not the text of a traceback."""
    return len(text.split()) > 4 and "Traceback" not in text


def test_the_cover_has_every_pair_once():
    fields = [("a", [1, 2, 3]), ("b", [True, False]), ("c", ["x", "y"])]
    rows = cover(fields, Random(0))
    for (a, left), (b, right) in itertools.combinations(fields, 2):
        pairs = {(row[a], row[b]) for row in rows}
        assert pairs == set(itertools.product(left, right))
    assert len(rows) < 12  # of all products


def test_the_choices_of_a_scene_are_found():
    found = dict(choices(load_scene("bilge-pump")))
    assert {"ideal", "link", "compliant"} <= set(found["joint.crankpin.rung"])
    assert {"joint.guide.law", "pressure.flow", "drive.rung", "sensors.1.anti_alias"} <= set(found)
    assert "film.rung" in dict(choices(load_scene("journal-bearing")))
    assert "shaft.theory" in dict(choices(load_scene("shaft-rig")))


@pytest.mark.parametrize("name", SAMPLED)
def test_a_sample_of_the_pairs_runs_or_is_refused_in_words(name):
    rows = rows_of(name)
    judge(name, rows[:: max(1, len(rows) // SAMPLED[name])])


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_every_pair_runs_or_is_refused_in_words(name):
    judge(name, rows_of(name))
