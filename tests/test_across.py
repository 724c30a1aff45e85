"""Trained on a cheap rung, judged on the best: the paired loss and its test."""

import json
import math
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from wearstate.datasets.split.rules import group_folds
from wearstate.diagnose.charts import across as module
from wearstate.diagnose.charts.across import (
    RungSets,
    across_table,
    across_text,
    sign_flip_test,
)
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.feature_rows.feature_table import FeatureTable
from wearstate.diagnose.learning.regressions import CANDIDATES, fit_blend
from wearstate.sim.output.recording import DataError

LIMIT = 1e-4
COLUMN = "diametral_clearance_bearing_m"


def table(shift, *, noise=0.02, n=80, drop=()):
    """Two records a draw whose features tell the log severity, off by a shift of their model."""
    rng = np.random.default_rng(1)
    severity = np.exp(rng.uniform(np.log(2e-5), np.log(1.5e-4), n))
    draws = np.arange(n) // 2
    values = np.log(severity)[:, None] * [1.0, -0.5, 0.25] + noise * rng.standard_normal((n, 3))
    values[:, 0] += shift
    manifest = pd.DataFrame(
        {COLUMN: severity, "group": draws, "record_id": [f"{i:08d}" for i in range(n)]}
    )
    kept = ~np.isin(np.arange(n), drop)
    return FeatureTable(
        names=("a", "b", "c"),
        values=values[kept],
        manifest=manifest[kept].reset_index(drop=True),
    )


@pytest.fixture
def judge():
    return module.PairedJudge(table(0.0), LIMIT, COLUMN, 0)


def test_the_same_model_loses_nothing(judge):
    loss = judge.loss("film", "map", 0.1, table(0.0))
    assert loss.loss.mean == 0
    assert loss.p_value == 1
    assert loss.error == judge.mean(judge.own)


def test_a_shifted_model_loses_what_the_shift_is_worth(judge):
    loss = judge.loss("film", "map", 0.1, table(0.3))
    # scaled to one spread, the three features share the estimate evenly; one carries the shift
    folds = group_folds(judge.draws, n=5, seed=0)
    model = fit_blend(table(0.3).values, judge.truth, folds, candidates=CANDIDATES[:3]).blend
    found = np.log(model.predict(table(0.0).values))
    offset = float(found.mean() - np.log(judge.truth).mean())
    assert_allclose(offset, -0.3 / 3, rtol=0.2)  # their noise: a weak penalty shares less evenly
    expected = abs(math.expm1(offset)) * judge.truth.mean() / LIMIT
    # what ridge takes off both ends of the range adds a tenth of it
    assert_allclose(loss.error.mean, expected, rtol=0.15)
    assert loss.loss.mean > 0.5 * loss.error.mean
    assert loss.p_value < 1e-3


def test_records_that_one_model_cannot_make_are_trained_on_by_neither(judge):
    dropped = judge.loss("film", "map", 0.1, table(0.0, drop=range(0, 20)))
    assert dropped.records == 60
    assert dropped.loss.mean == 0
    few = judge.loss("film", "map", 0.1, table(0.0, drop=range(8, 80)))
    assert few.reason == "4 machine draws could be simulated"
    assert math.isnan(few.loss.mean)


def test_too_few_draws_are_refused():
    with pytest.raises(DataError, match="9 machine draws, must be >= 10"):
        module.PairedJudge(table(0.0, n=18), LIMIT, COLUMN, 0)


# -- the paired test


def test_all_signs_of_a_small_sample():
    values = np.array([0.3, -0.1, 0.25, 0.4, 0.05])
    means = [abs(np.dot(signs, values)) for signs in product((-1, 1), repeat=5)]
    share = np.mean(np.array(means) >= abs(values.sum()) - 1e-12)
    assert sign_flip_test(values) == share


def test_p_values_without_an_effect_are_even():
    rng = np.random.default_rng(3)
    found = np.array([sign_flip_test(rng.standard_normal(16), seed=k) for k in range(300)])
    # share below p has deviation sqrt(p (1 - p) / 300): 0.0173 at 0.1, of which three
    for level in (0.1, 0.5):
        assert abs(np.mean(found <= level) - level) < 3 * math.sqrt(level * (1 - level) / 300)


def test_a_plain_effect_is_found():
    assert sign_flip_test(np.random.default_rng(4).standard_normal(40) + 2) == 1 / 5000


# -- real recipes


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("across") / "new"
    done = CliRunner().invoke(
        cli,
        [
            *("evaluate", "journal-bearing-small", "--across-fidelity", "-n", "24"),
            *("--set", "duration=0.1", "--set", "film.n_theta=24", "--set", "film.n_z=5"),
            *("--effect", "film", "--folder", str(folder), "-j", "1", "--json"),
        ],
    )
    assert done.exit_code == 0, done.output
    return folder, json.loads(done.stdout)


def test_the_map_costs_the_verdict_nothing(found):
    _, told = found
    losses = {loss["rung"]: loss for loss in told["losses"]}
    assert told["judged_on"] == {"film": "direct"}
    assert list(losses) == ["short", "map"]
    # the map is the direct film to 4e-4 of the clearance
    assert abs(losses["map"]["loss"]["mean"]) < 0.01
    assert losses["map"]["records"] == 24
    assert 0 < losses["map"]["cost"] < 1
    # Ocvirk costs less than the map, which is less than the direct film; twelve draws tell no more
    assert losses["short"]["cost"] < losses["map"]["cost"]
    assert 0 < losses["short"]["p_value"] <= 1


def test_records_of_one_number_are_one_machine(found):
    from wearstate.datasets.file.record import DataSet

    folder, _ = found
    paths = sorted(folder.glob("*.h5"))
    assert len(paths) == 3
    columns = []
    for path in paths:
        with DataSet(path) as data:
            columns.append(data.manifest[[COLUMN, "speed_hz", "group"]])
    assert all(each.equals(columns[0]) for each in columns)


def test_a_rung_that_cannot_be_made_is_told():
    nothing = module._no_loss("film", "short", 0.1, "0 of 24 records are simulated\nmore")
    told = module.Across(
        recipe="r",
        best={"film": "direct"},
        error=module.Difference(mean=0.05, standard_error=0.01),
        losses=(nothing, replace(nothing, reason="", p_value=0.5)),
        records=24,
        draws=12,
    )
    text = across_text(told)
    assert "film short                       0.1  none: 0 of 24 records are simulated" in text
    assert "more" not in text
    assert across_table(told)["draws"] == 12


def test_unknown_effects_are_refused(tmp_path):
    with pytest.raises(DataError, match=r"effect = 'flim' is none .* did you mean 'film'"):
        RungSets("journal-bearing-small", 24, tmp_path, effects=["flim"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["journal-bearing-small"], "Missing argument 'DATA'"),
        (["journal-bearing-small", "d.h5", "--across-fidelity"], "makes its own data"),
        (["m.wsm", "d.h5", "--effect", "film"], "need --across-fidelity"),
    ],
)
def test_usage(arguments, message):
    done = CliRunner().invoke(cli, ["evaluate", *arguments])
    assert done.exit_code == 2
    assert message in done.output
