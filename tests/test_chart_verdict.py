"""The chart of a recipe: the cheapest rungs that keep the verdict."""

import json
import tomllib

import pytest
from click.testing import CliRunner
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.charts import verdict as module
from wearstate.diagnose.charts.across import Loss
from wearstate.diagnose.charts.verdict import LOSS, verdict_chart
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.fidelity.differences import Difference

SMALL = ("--set", "duration=0.1", "--set", "film.n_theta=24", "--set", "film.n_z=5")


def run(*arguments):
    return CliRunner().invoke(cli, ["chart", *map(str, arguments)])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("verdict")
    arguments = ("journal-bearing-small", *SMALL, "--effect", "film", "-n", "24", "-j", "1")
    files = ("--folder", folder / "sets", "--apply", folder / "mine.toml", "-o", folder / "p.html")
    done = run(*arguments, "--accuracy", "verdict=20%", *files, "--json")
    assert done.exit_code == 0, done.output
    return folder, arguments, json.loads(done.stdout)


def test_the_cheapest_rung_that_surely_keeps_the_verdict_is_recommended(made):
    _, _, told = made
    points = {point["rungs"]["film"]: point for point in told["points"]}
    assert set(points) == {"short", "map", "direct"}
    [choice] = told["recommendations"]
    within = [p for p in points.values() if p["verdict"] in ("within", "reference")]
    assert choice["seconds"] == min(p["seconds"] for p in within)
    assert points["direct"]["errors"][LOSS]["mean"] == 0
    assert [p["here"] for p in points.values() if p["rungs"]["film"] == "map"] == [True]


def test_the_recipe_written_is_the_recommended_one(made):
    folder, _, told = made
    [choice] = told["recommendations"]
    text = (folder / "mine.toml").read_text()
    assert tomllib.loads(text)["extends"] == "journal-bearing-small"
    assert load_recipe(folder / "mine.toml").scene.film.rung == choice["changes"]["film.rung"]


def test_page_and_sets_that_are_kept(made):
    folder, arguments, told = made
    page = (folder / "p.html").read_text()
    assert "which rungs the verdict needs" in page
    assert "your recipe" in page
    assert "your scene" not in page
    before = {path: path.stat().st_mtime_ns for path in (folder / "sets").glob("*.h5")}
    again = run(*arguments, "--accuracy", "verdict=20%", "--folder", folder / "sets", "--json")
    assert json.loads(again.stdout)["points"] == told["points"]
    assert before == {path: path.stat().st_mtime_ns for path in before}


class Sets:
    """Three effects of two rungs each."""

    def __init__(self):
        self.best = {"a": "good", "b": "good", "c": "good"}

    def table(self, rungs):
        return None

    def cost(self, rungs):
        return 1.0 + 3.0 * sum(rung == "good" for rung in rungs.values())


def court(monkeypatch, losses, together=0.0, scatter=0.001):
    def loss_of(sets, judge, effect, rung, rungs):
        low = [e for e, r in rungs.items() if r == "bad"]
        mean = sum(losses[e] for e in low) + together * (len(low) > 1)
        found = Difference(mean=mean, standard_error=scatter if low else 0.0)
        return Loss(effect="", rung="", cost=1.0, error=found, loss=found, p_value=1.0, records=9)

    monkeypatch.setattr(module, "loss_of", loss_of)
    monkeypatch.setattr(module._Measured, "_level_change", lambda *_: 0.0)
    sets = Sets()
    measured = module._Measured(sets, None)
    return measured, [measured.trial({**sets.best, e: "bad"}) for e in sets.best]


@pytest.mark.parametrize(
    ("losses", "together", "scatter", "low"),
    [
        ({"a": 0.001, "b": 0.002, "c": 0.5}, 0.0, 0.001, {"a", "b"}),  # c alone is too much
        ({"a": 0.011, "b": 0.012, "c": 0.5}, 0.0, 0.001, {"a"}),  # together they are too much
        ({"a": 0.0, "b": 0.0, "c": 0.0}, 0.05, 0.001, {"a"}),  # something beside their sum
        ({"a": 0.001, "b": 0.001, "c": 0.001}, 0.0, 0.02, set()),  # nothing can be told
        ({"a": -0.01, "b": 0.5, "c": 0.5}, 0.0, 0.001, {"a"}),  # a gain is chance, and no loss
    ],
)
def test_rungs_are_lowered_as_far_as_they_do_together(monkeypatch, losses, together, scatter, low):
    measured, singles = court(monkeypatch, losses, together, scatter)
    chosen = module._chosen(measured, singles, 0.02)
    found = {effect for effect, rung in chosen.rungs.items() if rung == "bad"}
    assert len(found) == len(low)
    assert found == low or together  # which one stays is no matter where all are alike


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bilge-pump", "-n", "60"], "need --accuracy verdict"),
        (["journal-bearing-small", "--accuracy", "verdict=x%"], "try 0.02, 2% or verdict=2%"),
        (["journal-bearing-small", "--accuracy", "verdict=90%"], "is not in the range"),
        (["journal-bearing-smal", "--accuracy", "verdict=2%"], "did you mean"),
        (["journal-bearing-small", "--accuracy", "verdict=2%", "--budget", "9"], "for a scene"),
    ],
)
def test_usage(arguments, message):
    done = run(*arguments)
    assert done.exit_code == 2
    assert message in done.output


def test_an_accuracy_in_per_cent_is_that_of_a_scene(monkeypatch):
    from wearstate.diagnose.command_line import chart_run

    seen = {}
    monkeypatch.setattr(
        chart_run, "scene_chart_command", lambda *_, **more: seen.update(more) or 1 / 0
    )
    run("bilge-pump", "--accuracy", "5%")
    assert seen["accuracy"] == 0.05
    assert callable(verdict_chart)
