"""`wearstate recipe`: what there is, whether it is sound, and what it would make."""

import json
import re
from functools import partial

import pytest
from numpy.testing import assert_allclose
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe, recorded_recipe, recorded_scene
from wearstate.datasets.recipe.records import overrides_text, sample_records
from wearstate.datasets.recipe.severities import wear_limits
from wearstate.datasets.recipe.text import recipe_names, recipe_text
from wearstate.diagnose.inspect.recipe_preview import MOST_DRAWN, preview, preview_text
from wearstate.sim.fidelity.ladder import cost_of
from wearstate.sim.machine.simulate import check
from wearstate.sim.scene.load import scene_text

from .command_line import run as command

CLEARANCE = "diametral_clearance_crankpin_m"


run = partial(command, "recipe")


def table_of(*arguments):
    return json.loads(run("preview", *arguments, "--json").stdout)


def test_every_recipe_is_listed_with_its_description():
    found = json.loads(run("list", "--json").stdout)["recipes"]
    assert sorted(found) == recipe_names()
    assert all(found.values())
    lines = run("list").stdout.splitlines()
    assert len(lines) == len(found)
    assert "bilge-pump-small                Crank-pin wear of a bilge pump, for trials" in lines


def test_a_recipe_is_shown_as_written_or_whole(tmp_path):
    assert run("show", "bilge-pump-small").stdout == recipe_text("bilge-pump-small")
    whole = run("show", "bilge-pump-small", "--whole").stdout
    assert "extends" not in whole
    copy = tmp_path / "copy.toml"
    copy.write_text(whole)
    one, other = (next(sample_records(load_recipe(name))) for name in (copy, "bilge-pump-small"))
    assert one.drawn == other.drawn
    error = run("show", "bilge-pump-smal", code=2).stderr
    assert "did you mean 'bilge-pump-small'?" in error


def test_check_tells_every_fault_at_once(tmp_path):
    file = tmp_path / "mine.toml"
    text = 'name = "mine"\nextends = "journal-bearing-small"\n'
    file.write_text(text)
    assert run("check", file).stdout == "mine: no fault\n"
    assert json.loads(run("check", file, "--json").stdout)["faults"] == []
    file.write_text(
        text + '[[record]]\npath = "drive.speed"\ndistribution = "factor"\nlow = 1.1\nhigh = 0.9\n'
        '[[machine]]\npath = "rotor.mas"\ndistribution = "factor"\nlow = 0.9\nhigh = 1.1\n'
        '[[correlation]]\npaths = ["load.static", "oil.visc"]\nrank = 0.5\n'
    )
    error = run("check", file, code=2).stderr
    assert "3 fault(s)" in error
    for fault in ("must rise and not overlap", "did you mean 'mass'", "oil.visc is not drawn"):
        assert fault in error


def scene_beside(folder, name, *changes):
    """The bilge pump with some of its text replaced."""
    text = scene_text("bilge-pump")
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / name).write_text(text)


NARROWER = (
    ('condemning_diametral = "0.31 mm"', 'condemning_diametral = "0.25 mm"'),
    ('"0.31 mm"]', '"0.25 mm"]'),
)


def test_limits_follow_the_scene_of_a_recipe_that_extends_another(tmp_path):
    scene_beside(tmp_path, "narrow.toml", *NARROWER)
    file = tmp_path / "mine.toml"
    text = 'name = "mine"\nextends = "bilge-pump-narrow"\nscene = "narrow.toml"\n'
    file.write_text(text)
    found = load_recipe(file)
    assert_allclose(found.severity.bands, [[5e-5, 1.5 * 2.5e-4]])
    [beyond] = [r.bounds[CLEARANCE] for r in found.held_out if r.name == "beyond_limit"]
    assert_allclose(beyond[0], 2.5e-4)
    assert found.severities[0].edges[-1] == 2.5e-4
    again = recorded_recipe(found.scene_text, found.text, overrides_text(found))
    assert again.severity.bands == found.severity.bands


def test_lengths_of_another_scene_are_faults_of_check(tmp_path):
    scene_beside(tmp_path, "narrow.toml", *NARROWER)
    (tmp_path / "first.toml").write_text(
        'name = "first"\nextends = "bilge-pump-narrow"\n[[severity]]\n'
        'path = "joint.crankpin.diametral_clearance"\nlow = "as new"\nhigh = "0.4 mm"\n'
        f'[[held_out]]\nname = "beyond_limit"\nbounds.{CLEARANCE} = {{ low = "0.31 mm" }}\n'
    )
    file = tmp_path / "mine.toml"
    text = 'name = "mine"\nextends = "first.toml"\nscene = "narrow.toml"\n'
    file.write_text(text)
    said = run("check", file, code=2).stderr
    assert "2 fault(s)" in said
    assert "high = '0.4 mm' is of the scene bilge-pump, must be of narrow.toml" in said
    assert f"held_out beyond_limit: {CLEARANCE}, low = '0.31 mm' is of" in said
    file.write_text(
        text + 'without = ["beyond_limit"]\n[[severity]]\n'
        'path = "joint.crankpin.diametral_clearance"\nlow = "as new"\nhigh = "0.3 mm"\n'
    )
    assert run("check", file).stdout == "mine: no fault\n"


def test_numbers_drawn_for_the_parts_of_another_scene_are_warned_of(tmp_path):
    """Friction of 0.02 to 0.08 is that of the scene before; factors follow this one."""
    scene_beside(
        tmp_path, "dry.toml", ("friction = 0.05               # bou", "friction = 0.2 # bou")
    )
    file = tmp_path / "mine.toml"
    own = 'name = "mine"\nextends = "bilge-pump-narrow"\nscene = "dry.toml"\n'
    file.write_text(own)
    said = run("check", file).stdout.splitlines()
    assert said[0] == "mine: no fault, 1 warning(s)"
    assert said[1].startswith(
        "warning: joint.crankpin.friction: 0.02 to 0.08 (SI) is of the scene bilge-pump, dry.toml "
        "has 0.2; give it again"
    )
    draw = '[[machine]]\npath = "joint.crankpin.friction"\ndistribution = "factor"\n'
    for answer in (
        own + 'without = ["joint.crankpin.friction"]\n',
        own + draw + "low=0.5\nhigh=1.5\n",
    ):
        file.write_text(answer)
        assert run("check", file).stdout == "mine: no fault\n"
    # also where the next recipe of the chain names no scene
    file.write_text(own)
    (tmp_path / "next.toml").write_text('name = "next"\nextends = "mine.toml"\n')
    assert "dry.toml has 0.2" in run("check", tmp_path / "next.toml").stdout
    own = own.replace("-narrow", "-faults")
    file.write_text(own + 'without = ["joint.wristpin.diametral_clearance"]\n')
    said = run("check", file).stdout
    assert "warning: confounder leaking_suction_valve: 3e-06 to 5e-05 (SI) is of the scene" in said


def test_a_scene_without_limits_is_told_before_anything_is_made(tmp_path):
    text = scene_text("bilge-pump")
    begin = text.index("[wear]")
    end = text.index("[wear_wristpin]")
    (tmp_path / "bare.toml").write_text(text[:begin] + text[end:])
    file = tmp_path / "mine.toml"
    own = 'name = "mine"\nextends = "bilge-pump-small"\nscene = "bare.toml"\n'
    file.write_text(own)
    said = run("check", file, code=2).stderr
    assert "low = 'as new', " in said
    assert f" of {CLEARANCE} needs wear limits" in said
    file.write_text(
        own + 'without = ["beyond_limit"]\n[[severity]]\n'
        'path = "joint.crankpin.diametral_clearance"\nlow = "0.05 mm"\nhigh = "0.3 mm"\n'
    )
    wanted = f"the scene bare.toml has no wear limits of {CLEARANCE}, must have"
    assert wanted in run("check", file, code=2).stderr
    assert f"  no grades: severity.0: {wanted}" in run("preview", file, "-n", 31).stdout
    assert wanted in table_of(file, "-n", 31)["ungraded"][0]


def test_limits_that_a_recipe_changes_do_not_cite_the_source_of_others(tmp_path):
    """What the data card prints as the source of the limits."""
    file = tmp_path / "mine.toml"
    file.write_text(
        'name = "mine"\nextends = "bilge-pump-small"\n[fixed]\n'
        '"wear.condemning_diametral" = "0.35 mm"\n"wear.grade_edges_diametral.2" = "0.35 mm"\n'
    )
    found = load_recipe(file)
    limits = wear_limits(found.scene, CLEARANCE)
    assert limits.condemning == found.severities[0].edges[-1] == 3.5e-4
    assert limits.source == "given by the recipe in place of those of the scene"
    assert recorded_scene(found.scene_text, found.text, overrides_text(found)) == found.scene
    kept = wear_limits(load_recipe("bilge-pump-small").scene, CLEARANCE)
    assert "given by" not in kept.source


def test_check_looks_at_drawn_scenes(tmp_path):
    """Sound as the scene is, but at the faster speeds the tacho's pulse is too short to sample."""
    file = tmp_path / "mine.toml"
    file.write_text(
        'name = "mine"\nextends = "journal-bearing-small"\n'
        '[fixed]\nsample_rate = "1.9 kHz"\n'  # 20 degrees are two samples up to 52.8 Hz
    )
    check(load_recipe(file).scene)
    assert "tacho.pulse_width" in run("check", file, code=2).stderr


def test_a_preview_names_the_options_that_are_drawn():
    """One in six pumps of this recipe has an oval eye, which no range of it says."""
    table = table_of("bilge-pump-standard", "-n", 16)
    (eye,) = [each for each in table["choices"] if each["name"] == "eye"]
    assert eye["per"] == "machine"
    shares = {each["name"]: round(each["share"], 3) for each in eye["options"]}
    assert shares == {"round": 0.833, "oval": 0.167}
    draw = {"path": "joint.crankpin.one_sided", "distribution": "uniform"}
    assert eye["options"][1]["draws"] == [draw | {"as_written": "0.1 to 0.9"}]
    assert eye["options"][1]["values"] == {"joint.crankpin.one_sided": 0.5}
    text = preview_text(preview(load_recipe("bilge-pump-standard"), 16).table)
    lines = [" ".join(line.split()) for line in text.splitlines()]
    assert "choice eye = round 83.3%" in lines
    assert "choice eye = oval 16.7% joint.crankpin.one_sided uniform 0.1 to 0.9" in lines
    assert table_of("bilge-pump-small", "-n", 16)["choices"] == []


def test_a_preview_counts_what_generate_makes(tmp_path):
    table = table_of("journal-bearing-small", "-n", 31, "--seed", 3)
    path = tmp_path / "data.h5"
    summary = generate("journal-bearing-small", 31, path, seed=3)
    assert (table["records"], table["machines"]) == (summary.n_records, summary.n_groups)
    assert table["labels"]["grade"] == {str(g): n for g, n in summary.grades.items()}
    assert table["signal_s"] == pytest.approx(31 * 0.48)
    # texts of recipe and scene and the file's own tables beside the signal
    assert table["size_bytes"] == pytest.approx(path.stat().st_size, abs=80_000)
    assert table["drawn_records"] == 31


def test_time_is_cost_by_the_tables_over_cores():
    recipe = load_recipe("journal-bearing-small")
    one, two, few = (
        preview(recipe, n, cores=cores).table["estimated_time_s"]
        for n, cores in ((100, 1), (100, 2), (1, 8))
    )
    assert one == pytest.approx(2 * two)
    assert few == pytest.approx(cost_of(next(sample_records(recipe)).scene))
    # speeds differ by 15 %, and the number of steps with them
    assert one == pytest.approx(100 * cost_of(recipe.scene), rel=0.15)


def test_a_large_set_is_drawn_in_part():
    table = table_of("journal-bearing-small", "-n", 10**6)
    assert (table["records"], table["drawn_records"]) == (10**6, MOST_DRAWN)
    assert table["machines"] == 500_000


def test_ranges_regions_confounders_and_correlations_are_told(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'name = "mine"\nextends = "bilge-pump-faults"\n[[correlation]]\n'
        'paths = ["drive.speed", "pressure.discharge"]\nrank = 0.4\n'
    )
    table = table_of(file, "-n", 64)
    draws = {draw["path"]: draw for draw in table["draws"]}
    assert_allclose(draws["drive.speed"]["values"]["drive.speed"], [[4.25, 5.75]])
    assert len(draws["casing.modes.*.frequency"]["values"]) == 8
    assert draws["casing.modes.*.shape"]["as_written"] == "norm changed by 5 %"
    assert {draw["level"] for draw in table["draws"]} == {
        "severity", "machine", "record", "confounder",
    }  # fmt: skip
    rows = [sample.row for sample in sample_records(load_recipe(file), 64)]
    leak = sum(row["confounder_leaking_discharge_valve"] for row in rows) / 64
    assert table["confounders"]["leaking_discharge_valve"] == pytest.approx(leak)
    fast = sum(row["speed_hz"] >= 5.5 for row in rows) / 64
    assert table["held_out"]["fast"]["share"] == pytest.approx(fast)
    assert table["held_out"]["fast"]["bounds"] == {"speed_hz": [5.5, None]}
    assert table["rungs"]["pressure"] == "chamber"
    text = run("preview", file, "-n", 64).stdout
    for line in (
        "correlation +0.4: drive.speed, pressure.discharge",
        f"held out 'fast': {fast:.1%}, speed_hz >= 5.5",
        f"confounder leaking_discharge_valve: {leak:.1%}",
        "grade_wristpin: ",
        "casing.modes.*.damping_ratio        factor 0.6 to 1.4 (8 values)",
    ):
        assert line in text


def test_machines_of_another_recipe_are_named():
    text = preview_text(preview(load_recipe("journal-bearing-healthy"), 6).table)
    assert "6 records of 2 machines (those of journal-bearing-standard)" in text


def test_an_estimate_tells_what_is_not_in_it():
    table = preview(load_recipe("journal-bearing-small"), 6).table
    given, chosen = (preview_text({**table, "fidelity": word}) for word in ("given", "auto"))
    assert "by tabulated cost, without compiling" in given
    assert "pilots" not in given
    assert "pilots that choose the rungs" in chosen


def test_a_picture_of_the_draws(tmp_path):
    path = tmp_path / "draws.png"
    first = run("preview", "journal-bearing-small", "-n", 64, "--plot", path)
    assert first.stdout.splitlines()[-1] == str(path)
    size = path.stat().st_size
    assert size > 20_000
    assert "exists" in run("preview", "journal-bearing-small", "--plot", path, code=2).stderr
    run("preview", "journal-bearing-small", "-n", 64, "--plot", path, "--force")
    assert path.stat().st_size == size
    other = run("preview", "journal-bearing-small", "--plot", tmp_path / "a.txt", code=2)
    assert "suffix '.txt' must be one of .png" in other.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["preview", "journal-bearing-small", "-n", "0"], "0 is not in the range"),
        (["preview", "journal-bearing-small", "--seed", "-1"], "-1 is not in the range"),
        (["preview", "journal-baring-small"], "did you mean 'journal-bearing-small'?"),
        (["check", "nothing.toml"], "nothing.toml: no such file"),
    ],
)
def test_bad_input_is_exit_two(arguments, message):
    assert message in run(*arguments, code=2).stderr


def test_a_recipe_may_extend_one_whose_lists_its_own_scene_leaves_out(tmp_path):
    """A propulsion shaft without proximity probes draws what is left of the shipped recipe."""
    tables = re.split(r"(?m)(?=^\[)", scene_text("propulsion-shaft"))
    kept = [table for table in tables if not table.startswith(("[[probes]]", "[[run_out]]"))]
    (tmp_path / "plain.toml").write_text("".join(kept))
    recipe = tmp_path / "mine.toml"
    recipe.write_text(
        'name = "mine"\nextends = "propulsion-shaft-small"\nscene = "plain.toml"\nrecords = 2\n'
        'without = ["ballast"]\n' + _OWN
    )
    assert run("check", recipe).stdout == "mine: no fault\n"
    sample = next(sample_records(load_recipe(recipe)))
    assert sample.scene.probes == ()
    assert not any("probe" in path or "run_out" in path for path in sample.drawn)
    recipe.write_text(recipe.read_text() + _LOST)
    assert "'*' stands where the scene has no list" in run("check", recipe, code=2).stderr


_OWN = """
[[severity]]
path = "bearings.0.wear_down"
low = "0.03 mm"
high = "1.35 mm"
[[severity]]
path = "bearings.2.sag"
low = "0.05 mm"
high = "1.8 mm"
[[severity]]
path = "coupling.parallel_offset"
low = "0.05 mm"
high = "2.25 mm"
"""
_LOST = """
[[machine]]
path = "prods.*.gain"
distribution = "factor"
low = 0.9
high = 1.1
"""
