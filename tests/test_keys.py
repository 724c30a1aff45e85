"""Keys of scenes and recipes in words, schemas for editors, the shortest scenes, names in --set."""

import json
import tomllib
from copy import deepcopy
from importlib import import_module
from pathlib import Path

import pytest
import wearstate
from jsonschema import Draft7Validator
from wearstate.datasets.recipe.table import RecipeTable
from wearstate.diagnose.inspect.keys import found_keys, found_recipe_keys, keys_of
from wearstate.diagnose.inspect.keys_text import explained, keys_page
from wearstate.diagnose.inspect.schema import scene_schema
from wearstate.sim.parts.units import UNITS
from wearstate.sim.scene.load import (
    MACHINES,
    load_scene,
    machine_type,
    minimal_text,
    override,
    scene_names,
    scene_table,
    scene_text,
    short_name,
)
from wearstate.sim.scene.pump import PumpScene
from wearstate.sim.scene.scene import SceneError

from .test_cli import refused, run, strict

SHORT = [short_name(kind) for kind in MACHINES.values()]
MODELS = [*MACHINES.values(), RecipeTable]


@pytest.mark.parametrize("model", MODELS)
def test_every_key_is_described(model):
    rows = keys_of(model)
    assert [row.path for row in rows if not row.words] == []
    assert [row.path for row in rows if not row.table and not row.default] == []


@pytest.mark.parametrize("kind", MACHINES.values())
def test_every_value_of_a_built_in_scene_has_its_key(kind):
    """Walked from the other side: the tables of the scenes, not the types."""
    rows = {tuple(row.path.split(".")) for row in keys_of(kind)}
    for name in scene_names():
        table = scene_table(scene_text(name))
        if MACHINES[table["machine"]] is kind:
            assert [
                path for path in leaves(table, ()) if not any(fits(path, r) for r in rows)
            ] == []


def leaves(node, path):
    if isinstance(node, dict):
        return [leaf for key, value in node.items() for leaf in leaves(value, (*path, key))]
    if isinstance(node, list) and node and isinstance(node[0], dict):
        return [leaf for value in node for leaf in leaves(value, (*path, "*"))]
    return [path]


def fits(path, row):
    """A table of names, as a mode's shape, is one key."""
    return path == row or (path[:-1] == row and row[-1] in ("shape", "pairs"))


@pytest.mark.parametrize("kind", MACHINES.values())
def test_every_rung_that_a_scene_may_choose_is_told(kind):
    text = explained(found_keys(short_name(kind))[0])
    told = {rung.name for row in keys_of(kind) for rung in row.rungs}
    ladders = import_module(kind.physics).MACHINE.ladders
    assert told == {rung.name for ladder in ladders.values() for rung in ladder}
    assert "rung" in text or "theory" in text


def test_a_rung_key_tells_assumption_validity_cost_and_reference():
    text = run("scene", "explain", "pump.pressure.rung").stdout
    for words in (
        "incompressible liquid: energy balance of the lines",
        "while the liquid stays above its vapour pressure",
        "350 ns",
        "Westphal 1893",
        "both lines and valves, pressure.dead_volume",
    ):
        assert words in text
    guide = [row for row in keys_of(PumpScene) if row.path == "joint.guide.rung"]
    assert [rung.name for rung in guide[0].rungs] == ["ideal", "compliant"]


def test_units_bounds_and_defaults_are_those_of_the_types():
    rows = {row.path: row for row in keys_of(PumpScene)}
    radius = rows["crank.radius"]
    assert (radius.unit, radius.bounds, radius.default) == ("m", "> 0, <= 100 m", "required")
    assert set(radius.units) == set(UNITS["length"])
    assert rows["pressure.rung"].default == "none"  # of the scene, not of the table's type
    assert rows["throws.*.pressure.rung"].default == "as in [pressure]"
    assert rows["sensors.*.axes"].choices == ("x", "y", "z")
    film = {row.path: row for row in keys_of(machine_type("shaft"))}["film.rung"]
    assert film.default == "direct"


def test_what_is_asked_for_is_found():
    assert [found.subject for found in found_keys("film.rung")] == ["journal", "shaft"]
    for asked in ("bearings.2.sag", "bearings.third.sag", "bearings.sag", "bearings.*.sag"):
        [found] = found_keys("shaft-rig", asked)
        assert [key.path for key in found.keys] == ["bearings.*.sag"]
        assert found.single
    [found] = found_keys("pump", "crankpin.stiffness")
    assert found.keys[0].path == "joint.crankpin.stiffness"
    [table] = found_keys("pump", "pressure.suction_valve")
    assert not table.single
    assert len(table.keys) > 10
    [single] = [found_recipe_keys("severity.low")]
    assert "as new" in explained(single)


def test_values_of_a_scene_stand_beside():
    text = run("scene", "explain", "bilge-pump", "crank").stdout
    assert "here 50 mm" in text
    assert "50 mm, in bilge-pump" in run("scene", "explain", "bilge-pump", "crank.radius").stdout
    assert "here 50" not in run("scene", "explain", "pump", "crank").stdout


@pytest.mark.parametrize(
    ("asked", "near"),
    [
        (("pump", "presure.rung"), "pressure.rung"),
        (("pump.pressure.rnug",), "pressure.rung"),
        (("pmup",), "pump"),
        (("bilge-pmp",), "bilge-pump"),
        (("shaft", "diametral_clearence"), "bearings.*.diametral_clearance"),
    ],
)
def test_an_unknown_key_names_the_nearest(asked, near):
    refused("scene", "explain", *asked, says=["did you mean", near])
    refused("recipe", "explain", "severty.low", says=["severity.*.low"])


def test_explain_alone_says_how_to_ask():
    text = run("scene", "explain").stdout
    assert [name for name in SHORT if f"{name} " not in text] == []
    found = strict(run("scene", "explain", "pump.crank.radius", "--json").stdout)
    assert found["subjects"][0]["keys"][0]["unit"] == "m"
    strict(run("recipe", "explain", "--json").stdout)


def test_the_page_is_up_to_date():
    page = Path(wearstate.__file__).parent / "docs" / "keys.md"
    assert page.read_text(encoding="utf-8") == keys_page(), (
        "run python -m wearstate.diagnose.inspect.keys_text > docs/keys.md"
    )


# --- schemas


@pytest.fixture(scope="module")
def schemas():
    return {name: Draft7Validator(scene_schema(kind)) for name, kind in MACHINES.items()}


@pytest.mark.parametrize("name", scene_names())
def test_a_built_in_scene_keeps_to_its_schema(schemas, name):
    table = tomllib.loads(scene_text(name))
    schema = schemas[table["machine"]]
    schema.check_schema(schema.schema)
    assert [fault.message for fault in schema.iter_errors(table)] == []


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("drive.speeed", "300 rpm"),
        ("crank.radius", "50 kg"),
        ("crank.radius", -0.05),
        ("crank.radius", "wide"),
        ("pressure.rung", "heds"),
        ("throws.1.pressure.sucktion", 0.0),
        ("sensors.0.bits", 3),
    ],
)
def test_a_schema_refuses_what_the_scene_refuses(schemas, path, value):
    table = override(tomllib.loads(scene_text("triplex-pump")), {path: value})
    assert list(schemas["reciprocating-pump"].iter_errors(table))
    with pytest.raises(SceneError):
        load_scene("triplex-pump", {path: value})


def test_a_throw_gives_what_differs(schemas):
    table = tomllib.loads(scene_text("triplex-pump"))
    worn = {"throws.1.joint.crankpin.diametral_clearance": "0.2 mm"}  # its pin is the scene's
    assert load_scene("triplex-pump", worn).throws[1].joint.crankpin.pin_diameter > 0
    worn_table = override(table, worn)
    assert list(schemas["reciprocating-pump"].iter_errors(worn_table)) == []
    lacking = deepcopy(worn_table)
    del lacking["rod"]["mass"]
    assert [fault.message for fault in schemas["reciprocating-pump"].iter_errors(lacking)] == [
        "'mass' is a required property"
    ]


def test_the_schema_is_written(tmp_path):
    file = tmp_path / "pump.json"
    run("scene", "schema", "pump", "-o", file)
    schema = json.loads(file.read_text())
    assert schema == strict(run("scene", "schema", "pump").stdout)
    assert schema["$defs"]["Crank"]["properties"]["radius"]["description"] == "half the stroke [m]"
    refused("scene", "schema", "pump", "-o", file, says=["exists", "--force"])


# --- the shortest scenes


@pytest.mark.parametrize("machine", SHORT)
def test_a_new_scene_is_valid_and_runs(schemas, machine, tmp_path):
    file = tmp_path / "mine.toml"
    assert "scene check" in run("scene", "new", machine, "-o", file).stdout
    checked = strict(run("scene", "check", file, "--json").stdout)
    assert (checked["faults"], checked["warnings"]) == ([], [])
    told = strict(run("simulate", file, "--json").stdout)
    assert all(value > 0 for value in told["rms"].values())
    assert told["warnings"] == []
    table = tomllib.loads(file.read_text())
    assert list(schemas[table["machine"]].iter_errors(table)) == []
    file.write_text("mine")
    refused("scene", "new", machine, "-o", file, says=["exists", "--force"])
    assert file.read_text() == "mine"
    run("scene", "new", machine, "-o", file, "--force")
    assert file.read_text() == minimal_text(machine)


@pytest.mark.parametrize("machine", SHORT)
def test_a_new_scene_says_hardly_more_than_it_must(machine):
    """A key that could be left out is one that a person must know of: speed aside, few are."""
    table = tomllib.loads(minimal_text(machine))
    needed = {row.path for row in keys_of(MACHINES[table["machine"]]) if row.default == "required"}
    extra = [path for path in leaves(table, ()) if ".".join(path) not in needed]
    assert len(extra) <= 12  # clearance, contact, pressure, unbalance, viscosity, shape


# --- names instead of numbers


def test_list_entries_by_name():
    by_name = load_scene("shaft-rig", {"bearings.third.sag": "1 mm", "sensors.acc_aft.gain": 1.1})
    assert by_name == load_scene("shaft-rig", {"bearings.2.sag": "1 mm", "sensors.0.gain": 1.1})


def test_an_unknown_name_tells_those_that_there_are():
    says = ["bearings.thrid.sag", "numbers 0 to 3", "aft, second, third, forward"]
    refused("scene", "check", "shaft-rig", "--set", "bearings.thrid.sag=1mm", says=says)
    refused(
        "scene",
        "check",
        "shaft-rig",
        "--set",
        "bearing.third.sag=1mm",
        says=["bearing", "bearings"],
    )


def test_a_sweep_and_a_chart_take_names(tmp_path):
    from wearstate.diagnose.sweep.axes import read_axes

    axes, scenes = read_axes("shaft-rig", {}, ["bearings.third.sag=0,.1mm"], 2)
    assert axes[0].path == "bearings.2.sag"
    assert axes[0].values == (0.0, pytest.approx(1e-4))
    assert [scene.bearings[2].sag for scene in scenes.values()] == [0.0, pytest.approx(1e-4)]
