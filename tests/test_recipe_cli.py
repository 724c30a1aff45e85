"""`wearstate recipe`: what there is, whether it is sound, and what it would make."""

import json

import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from wearstate.datasets.generate import generate
from wearstate.datasets.recipe import load_recipe, sample_records
from wearstate.datasets.recipe_file import recipe_names, recipe_text
from wearstate.diagnose.cli import cli
from wearstate.diagnose.recipe_text import MOST_DRAWN, preview, preview_text
from wearstate.sim.assemble import check
from wearstate.sim.ladder import cost_of


def run(*arguments, code=0):
    result = CliRunner().invoke(cli, ["recipe", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return result


def table_of(*arguments):
    return json.loads(run("preview", *arguments, "--json").stdout)


def test_every_recipe_is_listed_with_its_description():
    found = json.loads(run("list", "--json").stdout)["recipes"]
    assert sorted(found) == recipe_names()
    assert all(found.values())
    lines = run("list").stdout.splitlines()
    assert len(lines) == len(found)
    assert "bilge-pump-small           Crank-pin wear of a bilge pump, for trials" in lines


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


def test_check_looks_at_drawn_scenes(tmp_path):
    """Sound as the scene is, but at the faster speeds the tacho's pulse is too short to sample."""
    file = tmp_path / "mine.toml"
    file.write_text(
        'name = "mine"\nextends = "journal-bearing-small"\n'
        '[fixed]\nsample_rate = "1.9 kHz"\n'  # 20 degrees are two samples up to 52.8 Hz
    )
    check(load_recipe(file).scene)
    assert "tacho.pulse_width" in run("check", file, code=2).stderr


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
        (["check", "nothing.toml"], "is no recipe and no readable text file"),
    ],
)
def test_bad_input_is_exit_two(arguments, message):
    assert message in run(*arguments, code=2).stderr
