"""First contact: what is shown without a command, help, wrong but natural commands, completion."""

import os
import shlex
import subprocess
import sys

import click
import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.text import RecipeError, recipe_names
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.options.help import _GROUPS, EXAMPLES
from wearstate.diagnose.options.names import built_in
from wearstate.sim.parts.units import UNITS, to_si
from wearstate.sim.scene.load import load_scene, minimal_text, scene_names

from .test_cli import refused, run, strict

ALL = {
    f"{name} {inner}" if inner else name: command
    for name, outer in cli.commands.items()
    for inner, command in (
        outer.commands.items() if isinstance(outer, click.Group) else [("", outer)]
    )
}


def help_of(name):
    return run(*name.split(), "--help").stdout.splitlines()


def test_without_a_command_three_uses_are_shown():
    lines = run().stdout.splitlines()
    assert len(lines) <= 20
    for words in ("wearstate report", "wearstate train", "wearstate chart", "wearstate demo"):
        assert any(words in line for line in lines)
    assert [line for line in lines if len(line) > 100] == []


@pytest.mark.parametrize("name", ALL)
def test_help_has_examples_and_groups_and_begins_on_one_screen(name):
    lines = help_of(name)
    headings = [line for line in lines if line.endswith(":") and not line.startswith(" ")]
    assert headings[0] == "Examples:"
    assert lines.index(headings[1]) < 24
    known = {"Options:", *(f"{heading}:" for heading in _GROUPS)}
    assert set(headings[1:]) <= known
    assert sum("--help" in line for line in lines) == 1
    assert not any(line.split()[:1] in (["SCENE"], ["DATA"]) for line in lines)


def test_every_command_has_two_examples_and_no_other_has():
    assert set(EXAMPLES) == set(ALL)
    for name, lines in EXAMPLES.items():
        assert len(lines) - sum(line.endswith("\\") for line in lines) == 2, name


@pytest.mark.parametrize("name", ALL)
def test_examples_are_read_as_they_stand(name):
    text = "\n".join(EXAMPLES[name]).replace("\\\n", "").replace('eval "$(', "").replace(')"', "")
    for line in text.splitlines():
        words = shlex.split(line.partition(">")[0])[1:]
        assert words[: len(name.split())] == name.split()
        context = ALL[name].make_context(name, words[len(name.split()) :])
        assert context.params


def test_grouped_parameters_exist():
    there = {param.name for command in ALL.values() for param in command.params}
    assert {name for names in _GROUPS.values() for name in names} <= there


# --- wrong but natural


def test_names_are_read_from_the_folders_alone():
    assert built_in("scene") == scene_names()
    assert built_in("recipe") == recipe_names()


def test_a_scene_for_a_recipe_names_its_recipes(tmp_path):
    out = tmp_path / "x.h5"
    for command in (("generate", "-o", out), ("recipe", "check"), ("recipe", "preview")):
        refused(*command, "triplex-pump", says=["is a scene", "triplex-pump-small"])
    refused("generate", "journal-whirl", "-o", out, says=["no built-in recipe varies it"])


def test_a_recipe_for_a_scene_names_its_scene():
    for command in (("simulate",), ("scene", "check"), ("stability",), ("scene", "explain")):
        refused(*command, "bilge-pump-small", says=["is a recipe", "the scene bilge-pump:"])
    refused("chart", "bilge-pump-small", says=["is a recipe", "--accuracy verdict=2%"])


def test_a_file_of_the_other_kind_is_told_so(tmp_path):
    (tmp_path / "recipe.toml").write_text('extends = "bilge-pump-small"\nname = "mine"\n')
    refused("simulate", tmp_path / "recipe.toml", says=["is a recipe, not a scene"])
    (tmp_path / "drawn.toml").write_text('name = "mine"\n[[machine]]\npath = "crank.radius"\n')
    refused("simulate", tmp_path / "drawn.toml", says=["is a recipe, not a scene"])
    (tmp_path / "scene.toml").write_text(minimal_text("pump"))
    refused("recipe", "check", tmp_path / "scene.toml", says=["is a scene, not a recipe"])


def test_swapped_arguments(small_set, small_model, tmp_path):
    said = refused("evaluate", small_set, small_model, says=["is a data set", "MODEL [DATA]"])
    assert "wearstate train" not in said  # there is a model, in the other place
    refused("report", small_model, "--model", small_set, says=["must be a model (.wsm)"])
    refused("train", small_model, "-o", tmp_path / "x.wsm", says=["is a model, must be a data set"])
    other = tmp_path / "data.wsm"  # by its bytes, whatever its name
    other.write_bytes(small_set.read_bytes())
    refused("report", small_set, "--model", other, says=["is a data set or recording, must be"])


def test_a_name_for_data_tells_what_makes_data(tmp_path):
    says = ["is a recipe", "wearstate generate bilge-pump-small -o bilge-pump-small.h5"]
    refused("train", "bilge-pump-small", "-o", tmp_path / "x.wsm", says=says)
    refused("info", "bilge-pump", says=["is a scene", "wearstate simulate bilge-pump -o"])
    refused("info", tmp_path / "mine.toml", says=["is a scene or recipe"])


@pytest.mark.parametrize(
    "command",
    [
        ("simulate",),
        ("scene", "check"),
        ("recipe", "check"),
        ("generate", "-o", "x.h5"),
        ("train", "-o", "x.wsm"),
        ("info",),
        ("audit",),
        ("features", "-o", "x.csv"),
    ],
)
def test_a_missing_file_and_a_folder_are_told_apart(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    suffix = ".toml" if command[0] in ("simulate", "scene", "recipe", "generate") else ".h5"
    refused(*command, f"none{suffix}", says=[f"none{suffix}: no such file"])
    refused(*command, ".", says=["is a folder, must be"])


def test_a_built_in_name_with_a_suffix():
    refused("simulate", "bilge-pump.toml", says=["no such file", "the built-in scene 'bilge-pump'"])


def test_an_output_without_its_option_is_told_it(small_set):
    says = ["the output is named by its option: -o x.h5"]
    refused("generate", "bilge-pump-small", "x.h5", says=says)
    refused("simulate", "bilge-pump", "x.h5", says=says)
    refused("export", small_set, "x.npz", says=["-o x.npz"])
    refused("report", small_set, says=["Missing option '--model'", "wearstate train DATA"])


@pytest.fixture
def closed(tmp_path):
    """A folder in which even root cannot write, where the system has one."""
    folder = tmp_path / "closed"
    folder.mkdir()
    folder.chmod(0o500)
    if os.access(folder, os.W_OK):
        if not os.path.isdir("/proc/self"):
            pytest.skip("root writes everywhere here")
        return "/proc"
    return folder


def test_where_nothing_can_be_written_is_told_before_the_work(closed, small_set, monkeypatch):
    from wearstate.sim.machine import simulate

    monkeypatch.setattr(simulate, "simulate", lambda *_, **__: pytest.fail("it worked"))
    refused("simulate", "bilge-pump", "-o", f"{closed}/x.h5", says=["cannot be written"])
    refused("generate", "bilge-pump-small", "-o", f"{closed}/x.h5", says=["cannot be written"])
    refused("export", small_set, "-o", f"{closed}/x.npz", says=["cannot be written"])


def test_errors_as_json_are_the_last_line_of_stderr():
    done = run("simulate", "bilge-pump", "--set", "drive.speed=0", "--set", "crank.radius=0",
               "--json", code=2)  # fmt: skip
    assert done.stdout == ""
    told = strict(done.stderr.splitlines()[-1])
    assert told["exit_code"] == 2
    assert len(told["error"]["faults"]) == 2
    assert told["error"]["faults"][0].startswith("drive.speed = 0 rev/s must be > 0")
    for arguments in (("simulat",), ("simulate",), ("generate", "none")):
        last = run(*arguments, "--json", code=2).stderr.splitlines()[-1]
        assert strict(last)["error"]["message"]


def test_bare_numbers_are_told_with_their_unit():
    text = run("scene", "check", "bilge-pump", "--set", "drive.speed=5").stderr
    assert "drive.speed = 5 rev/s = 300 rpm" in text
    done = CliRunner().invoke(cli, ["simulate", "bilge-pump", "--set", "drive.speed=300"])
    assert done.stderr.startswith("drive.speed = 300 rev/s = 18,000 rpm\n")  # before the refusal
    assert done.exit_code == 2
    told = run("scene", "check", "shaft-rig", "--set", "bearings.third.sag=0.001").stderr
    assert "bearings.third.sag = 0.001 m = 1 mm" in told
    for given in ("drive.speed=300 rpm", "accuracy=0.05", "settling_revolutions=5"):
        assert run("scene", "check", "bilge-pump", "--set", given).stderr == ""


def test_a_bare_number_of_a_nameplate_is_told(small_set, small_model):
    given = ("--scene", "bilge-pump", "--set", "drive.speed=5")
    done = run("report", small_set, "--record", 0, "--model", small_model, *given)
    assert "drive.speed = 5 rev/s = 300 rpm" in done.stderr


def test_stiffness_in_units_of_people():
    assert to_si("0.2 GN/m", "stiffness") == 2e8
    assert to_si("200 N/mm", "stiffness") == 2e5
    assert UNITS["stiffness"]["N/m"] == 1.0


def test_a_fault_that_several_draws_share_is_told_once(tmp_path):
    (tmp_path / "line.toml").write_text(minimal_text("shaft"))
    recipe = tmp_path / "recipe.toml"
    recipe.write_text('name = "mine"\nscene = "line.toml"\nextends = "propulsion-shaft-standard"\n')
    with pytest.raises(RecipeError) as caught:
        load_recipe(recipe)
    faults = caught.value.faults
    station = [fault for fault in faults if "coupling.station is missing" in fault]
    assert len(station) == 1
    assert station[0].startswith("severity.2 (coupling.parallel_offset), machine.20, machine.21")
    assert not any("1.00012 m" in fault for fault in faults)  # of a bound that is not known


def test_limits_that_a_scene_lacks_are_told_once(tmp_path):
    (tmp_path / "pump.toml").write_text(minimal_text("pump"))
    recipe = tmp_path / "recipe.toml"
    recipe.write_text('name = "mine"\nscene = "pump.toml"\nextends = "bilge-pump-small"\n')
    with pytest.raises(RecipeError) as caught:
        load_recipe(recipe)
    assert len(caught.value.faults) == 1
    assert caught.value.faults[0].startswith("severity.0.low = 'as new', severity.0.high = '150 %")


def test_a_fault_of_the_scene_is_not_put_on_the_recipe(tmp_path):
    text = "".join(
        line for line in minimal_text("pump").splitlines(True) if not line.startswith("radius")
    )
    (tmp_path / "pump.toml").write_text(text)
    recipe = tmp_path / "recipe.toml"
    recipe.write_text('name = "mine"\nscene = "pump.toml"\nextends = "bilge-pump-small"\n')
    refused("recipe", "check", recipe, says=["the scene itself: crank.radius is missing"])


# --- completion


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts(shell):
    assert "_WEARSTATE_COMPLETE" in run("completion", shell).stdout


@pytest.mark.parametrize(
    ("words", "place", "offered"),
    [
        ("wearstate sim", 1, "plain,simulate"),
        ("wearstate simulate bil", 2, "plain,bilge-pump"),
        ("wearstate generate bilge-pump-s", 2, "plain,bilge-pump-small"),
        ("wearstate scene explain shaft", 3, "plain,shaft-rig"),
        ("wearstate simulate bilge-pump --tr", 3, "plain,--truth"),
    ],
)
def test_completion_offers_commands_scenes_recipes_and_options(words, place, offered):
    told = {
        **os.environ,
        "COMP_WORDS": words,
        "COMP_CWORD": str(place),
        "_WEARSTATE_COMPLETE": "bash_complete",
    }
    code = "from wearstate.diagnose.command_line.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code], env=told, capture_output=True, text=True, timeout=60
    )
    assert offered in done.stdout.splitlines()


def test_a_decimal_comma_is_named_with_its_cure():
    with pytest.raises(ValueError, match=r"has a decimal comma; write '3\.5 bar'"):
        to_si(" 3,5 bar ", "pressure")
    with pytest.raises(ValueError, match=r"has unit ', bar', not one of pressure"):
        to_si("3, bar", "pressure")


@pytest.mark.parametrize("number", [np.float32(0.5), np.float64(0.5), np.int64(2), 2])
def test_numbers_of_numpy_are_numbers(number):
    """A value from a table of float32 is no text without a unit."""
    assert to_si(number, "pressure") == float(number)
    assert load_scene("bilge-pump", {"pressure.suction": number}).pressure.suction == float(number)
    with pytest.raises(ValueError, match="is not a number"):
        to_si(np.bool_(True), "pressure")
