"""The chart of a diagnosis: groups of features, models, unseen machines, cost of a recording."""

import itertools
import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.split.rules import group_folds
from wearstate.diagnose.charts.of_models import FEATURE_GROUPS, MEAN, MODELS, model_chart
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.feature_rows.feature_table import feature_table
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

TINY = {"duration": "0.2 s", "film.n_theta": 24, "film.n_z": 5}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "data.h5"
    generate(load_recipe("journal-bearing-small", TINY), 24, path, seed=2)
    return path


@pytest.fixture(scope="module")
def chart(data):
    return model_chart(data)


def test_every_group_with_every_model(chart):
    pairs = {(point.rungs["features"], point.rungs["model"]) for point in chart.points}
    groups = {features for features, _ in pairs}
    assert {"rms", "orbit", "all"} <= groups <= set(FEATURE_GROUPS)
    assert "angle map" not in groups  # a journal's probes have none
    assert pairs == set(itertools.product(groups, MODELS))


def test_errors_are_those_of_unseen_machines(chart, data):
    table = feature_table(data)
    severity = table.manifest["diametral_clearance_bearing_m"].to_numpy()
    draws = table.manifest["group"].to_numpy()
    found = np.empty_like(severity)
    for train, test in group_folds(draws, n=5, seed=0):
        model = make_pipeline(StandardScaler(), RidgeCV(alphas=(10, 30, 100, 300, 1000)))
        model.fit(table.values[train], np.log(severity[train]))
        found[test] = np.exp(model.predict(table.values[test]))
    limit = load_recipe("journal-bearing-small").scene.wear.condemning
    error = np.abs(found - severity) / limit
    [point] = [point for point in chart.points if point.name == "all, ridge"]
    assert_allclose(point.error, error.mean(), rtol=1e-12)
    # two records a draw: the spread of the mean is that of the draws' means
    means = error.reshape(-1, 2).mean(axis=1)
    assert_allclose(point.standard_error, means.std(ddof=1) / math.sqrt(12), rtol=1e-12)
    assert point.worst == MEAN
    assert len(point.errors) >= 3  # grades beside it


def test_more_features_cost_more(chart):
    cost = {p.rungs["features"]: p.seconds for p in chart.points if p.rungs["model"] == "ridge"}
    assert 0 < cost["rms"] < cost["all"] < 10
    assert [p.seconds for p in chart.points] == sorted(p.seconds for p in chart.points)


def test_the_fastest_within_the_scatter_of_the_best_is_named(chart):
    best = min(chart.points, key=lambda point: point.error)
    winner = next(p for p in chart.points if p.error <= best.error + best.standard_error)
    assert chart.winner == winner.name
    assert f"{best.error:.1%} of the limit: {best.name}" in chart.verdict
    assert "(simulated)" in chart.title


def test_a_budget_leaves_candidates_out(data):
    ticks = itertools.count()
    chart = model_chart(data, budget=20.0, clock=lambda: float(next(ticks)))
    assert chart.status == "out of budget"
    assert 0 < len(chart.points) + len(chart.pruned) <= len(FEATURE_GROUPS) * len(MODELS)
    assert chart.pruned[-1] == "all, boosting: out of budget"


def test_what_is_not_labelled_is_refused(tmp_path):
    channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    head = Attributes(sample_rate=1000.0, channels=(channel,), origin="measured")
    path = tmp_path / "data.h5"
    with DataSetWriter(path, head, n_records=1, n_samples=100) as writer:
        writer.write(0, np.ones((1, 100)), {"record_id": "a", "status": "ok"})
        writer.finish()
    with pytest.raises(DataError, match=r"severities = \[\], condemning_limit = nan m must both"):
        model_chart(path)


def test_the_command(data, tmp_path):
    page = tmp_path / "chart.html"
    done = CliRunner().invoke(cli, ["chart", str(data), "--json", "-j", "1", "-o", str(page)])
    assert done.exit_code == 0, done.output
    table = json.loads(done.stdout)
    assert table["accuracy"] is None
    assert len(table["points"]) == page.read_text().count("<tr class=")
