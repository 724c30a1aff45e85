"""Baselines: what they learn, what they may not see, and that none is quietly left out."""

import importlib.util
import math

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from wearstate.diagnose.evaluation import baselines
from wearstate.diagnose.evaluation import foreign_features as foreign
from wearstate.diagnose.evaluation.baselines import (
    BASELINES,
    FOLDS,
    Side,
    choose,
    compare_baselines,
    side_of,
)
from wearstate.diagnose.evaluation.foreign_features import (
    LEFT_OUT,
    PACKAGES,
    foreign_transform,
    transformed_rows,
)
from wearstate.diagnose.feature_rows.feature_table import FeatureTable
from wearstate.diagnose.learning.grades import grades_of
from wearstate.diagnose.learning.regressions import CANDIDATES
from wearstate.diagnose.learning.scores import point_judged, resampled
from wearstate.sim.output.recording import Recording
from wearstate.sim.output.sensor import Channel

EDGES = [1e-4, 2e-4, 3e-4]
LIMIT = 3e-4
ROWS = {row.name: row for row in BASELINES}


def machines(n, seed=0, columns=6):
    """Two records each; the wear lies in the first column, the rest is noise."""
    rng = np.random.default_rng(seed)
    severity = np.exp(rng.uniform(math.log(5e-5), math.log(4.5e-4), 2 * n))
    features = rng.standard_normal((2 * n, columns))
    features[:, 0] = np.log(severity) + 0.02 * rng.standard_normal(2 * n)
    return features, severity, np.repeat(np.arange(n), 2)


def side(n, seed, **sources):
    features, severity, groups = machines(n, seed)
    found = {"none": np.zeros((2 * n, 1)), "rms": features[:, :2]}
    found |= {name: features if value is None else value for name, value in sources.items()}
    return Side(features=found, severity=severity, groups=groups)


def perfect(test):
    grade = grades_of(test.severity, EDGES)
    return point_judged(test.groups, test.severity, test.severity, grade, 4)


def entries(train, test, ours=None):
    draws = resampled(test.groups, n=200)
    return compare_baselines(train, test, ours or perfect(test), EDGES, LIMIT, draws)


# -- what they learn


def test_the_majority_is_the_most_frequent_grade_and_the_median():
    severity = np.array([0.5e-4, 0.6e-4, 2.5e-4])
    fitted, tried = choose(ROWS["majority"], np.zeros((3, 1)), severity, np.arange(3), EDGES)
    told = fitted(np.zeros((2, 1)))
    assert (tried, told.grade.tolist(), told.severity.tolist()) == (1, [0, 0], [0.6e-4, 0.6e-4])


def test_one_rms_finds_the_channel_that_tells():
    features, severity, groups = machines(60)
    noise_first = features[:, [3, 0]]
    fitted, tried = choose(ROWS["single_rms"], noise_first, severity, groups, EDGES)
    unseen, truth, _ = machines(40, seed=1)
    told = fitted(unseen[:, [3, 0]])
    assert tried == 4  # two channels, two depths
    # steps of a tree of depth 4 over a range of 9:1 leave about 4 % of the wear
    assert np.mean(told.grade == grades_of(truth, EDGES)) > 0.85
    assert np.abs(told.severity - truth).mean() < 0.06 * LIMIT


@pytest.mark.parametrize("name", ["tsfel", "minirocket"])
def test_generic_features_reach_their_own_noise(name):
    features, severity, groups = machines(60)
    unseen, truth, _ = machines(40, seed=1)
    if name == "minirocket":  # its penalties are for ten thousand features
        features, unseen = np.tile(features, 1000), np.tile(unseen, 1000)
    fitted, tried = choose(ROWS[name], features, severity, groups, EDGES)
    assert tried == 10
    # a guess at the median errs by 29 % of the limit, the noise of the column alone by 0.9 %
    assert np.abs(fitted(unseen).severity - truth).mean() < 0.12 * LIMIT


def test_every_baseline_is_tuned_as_much_as_the_model():
    assert FOLDS == 5
    for name in ("tsfel", "minirocket"):
        assert len(ROWS[name].configurations(10)) >= len(CANDIDATES)


def test_a_ridge_in_the_span_of_its_rows_is_the_same_ridge():
    from sklearn.linear_model import Ridge
    from sklearn.preprocessing import StandardScaler

    rng = np.random.default_rng(2)
    rows, unseen = rng.standard_normal((30, 200)), rng.standard_normal((10, 200))
    rows[:, 5], unseen[:, 5] = 3.0, 3.0  # a constant column
    target = rng.standard_normal(30)
    change = ROWS["minirocket"].prepare(rows)
    assert change(rows).shape[1] < 30
    scaler = StandardScaler().fit(rows)
    plain = Ridge(50.0).fit(scaler.transform(rows), target).predict(scaler.transform(unseen))
    turned = Ridge(50.0).fit(change(rows), target).predict(change(unseen))
    assert_allclose(turned, plain, atol=1e-8)  # rounding of an eigenvalue problem
    wide = rng.standard_normal((300, 20))
    assert_allclose(ROWS["minirocket"].prepare(wide)(wide), StandardScaler().fit_transform(wide))


def test_no_label_of_the_test_side_is_seen():
    train, test = side(40, 0, minirocket=None), side(20, 1, minirocket=None)
    told = entries(train, test)
    # the same records under other labels: what they predict may not change, so that the error
    # against the old labels, from the new error and difference, cannot either
    shuffled = Side(features=test.features, severity=test.severity[::-1].copy(), groups=test.groups)
    other = entries(train, shuffled)
    for name in ("single_rms", "minirocket"):
        fitted, _ = choose(
            ROWS[name],
            np.asarray(train.features[ROWS[name].source]),
            train.severity,
            train.groups,
            EDGES,
        )
        found = fitted(np.asarray(test.features[ROWS[name].source])).severity
        assert_allclose(told[name]["mae_m"].value, np.abs(found - test.severity).mean())
        assert_allclose(other[name]["mae_m"].value, np.abs(found - shuffled.severity).mean())


# -- the comparison


def test_what_did_not_run_says_why(monkeypatch):
    monkeypatch.setattr(foreign, "find_spec", lambda package: None)
    told = entries(side(30, 0), side(15, 1))
    assert list(told) == ["majority", "single_rms", "tsfel", "minirocket"]
    assert told["tsfel"]["missing"] == "tsfel is not installed: pip install wearstate[baselines]"
    assert told["minirocket"]["missing"].startswith("aeon is not installed: pip install")
    assert told["majority"]["missing"] == told["single_rms"]["missing"] == ""


def test_what_was_left_out_says_so(monkeypatch):
    monkeypatch.setattr(foreign, "find_spec", lambda package: object())
    assert entries(side(30, 0), side(15, 1))["tsfel"]["missing"] == LEFT_OUT
    told = entries(side(30, 0, tsfel="no such signal"), side(15, 1, tsfel=None))
    assert told["tsfel"]["missing"] == "no such signal"
    bare = Side(
        features={"none": np.zeros((30, 1)), "rms": "no rms"},
        severity=side(15, 1).severity,
        groups=side(15, 1).groups,
    )
    assert entries(None, bare)["single_rms"]["missing"] == "no rms"


def test_a_difference_below_zero_is_a_better_model():
    train, test = side(40, 0), side(20, 1)
    told = entries(train, test)["majority"]
    assert told["difference"].high < 0
    assert_allclose(told["difference_all"].value, -told["mae_all_share_of_limit"].value)
    awful = point_judged(test.groups, test.severity, test.severity + 1e-3, np.full(40, 3), 4)
    assert entries(train, test, awful)["majority"]["difference"].low > 0


def test_the_paired_interval_is_narrower_than_either():
    """What both find hard cancels."""
    train, test = side(40, 0), side(30, 1)
    told = entries(train, test)
    found = told["single_rms"]["mae_share_of_limit"]
    fitted, _ = choose(
        ROWS["single_rms"], np.asarray(train.features["rms"]), train.severity, train.groups, EDGES
    )
    theirs = fitted(np.asarray(test.features["rms"])).severity
    ours = point_judged(
        test.groups, test.severity, theirs + 1e-7, grades_of(theirs + 1e-7, EDGES), 4
    )
    apart = entries(train, test, ours)["single_rms"]["difference"]
    assert apart.high - apart.low < 0.05 * (found.high - found.low)


def test_a_side_is_tuned_once_and_trains_for_many_contests(monkeypatch):
    train, first, second = side(40, 0), side(20, 1), side(20, 2)
    alone = entries(side(40, 0), second)["single_rms"]
    calls = []
    monkeypatch.setattr(
        baselines, "choose", lambda *given, **ways: calls.append(given) or choose(*given, **ways)
    )
    entries(train, first)
    made = len(calls)
    assert made == len(train.fitted) == 2  # majority and rms: it has no features of others
    assert entries(train, second)["single_rms"] == alone
    assert len(calls) == made


def test_without_a_training_side_folds_of_the_judged_machines_serve():
    test = side(30, 1)
    told = entries(None, test)
    assert told["single_rms"]["flattered"]
    assert not entries(side(30, 0), test)["single_rms"]["flattered"]
    # by folds: better than the majority, yet not fitted on itself
    assert told["single_rms"]["mae_m"].value < 0.5 * told["majority"]["mae_m"].value


def test_refused_records_count_in_one_difference_only():
    train, test = side(40, 0), side(20, 1)
    half = np.arange(40) % 4 < 2
    ours = point_judged(
        test.groups,
        test.severity,
        np.where(half, test.severity, 1.0),
        grades_of(test.severity, EDGES),
        4,
        graded=half,
    )
    told = entries(train, test, ours)["majority"]
    assert told["difference"].high < 0
    assert told["difference_all"].low > 0


def test_sides_take_rms_and_speed_from_the_table():
    values = np.arange(12.0).reshape(4, 3)
    table = FeatureTable(
        names=("a.rms", "shaft.speed_hz", "a.kurtosis"),
        values=values,
        manifest=pd.DataFrame({"group": [0, 0, 1, 1], "wear_m": [1.0, 2.0, 3.0, 4.0]}),
    )
    made = side_of(table, "wear_m", np.array([1, 3]), {"tsfel": np.ones((4, 2)), "x": "absent"})
    assert made.features["rms"].tolist() == [[3.0], [9.0]]
    assert made.features["tsfel"].tolist() == [[1.0, 1.0, 4.0], [1.0, 1.0, 10.0]]
    assert made.features["x"] == "absent"
    assert (made.severity.tolist(), made.groups.tolist()) == ([2.0, 4.0], [0, 1])


# -- features of others


def recording(seed, n=256):
    channels = tuple(Channel(name=c, unit="m/s^2", quantity="acceleration") for c in "xy")
    signal = np.random.default_rng(seed).standard_normal((2, n))
    return Recording(signal=signal, sample_rate=1000.0, channels=channels)


def test_features_are_kept_and_a_changed_signal_is_not_taken_for_them(tmp_path, monkeypatch):
    calls = []

    def fake(source, examples, *, seed=0):
        list(examples)

        def rows(recordings):
            calls.append(len(recordings))
            return np.array([[each.vibration.std()] for each in recordings])

        return rows

    monkeypatch.setattr(foreign, "find_spec", lambda package: object())
    monkeypatch.setattr(foreign, "version", lambda package: "1.0")
    monkeypatch.setattr(foreign, "foreign_transform", fake)
    monkeypatch.setattr(
        foreign, "recordings_of", lambda path, rows: (recording(int(i)) for i in rows)
    )
    manifest = pd.DataFrame({"signal_crc32": np.arange(20, dtype=np.uint32)})
    table = FeatureTable(names=(), values=np.zeros((20, 0)), manifest=manifest)
    rows_of = transformed_rows(tmp_path, np.arange(20), cache=tmp_path / "new")
    first = rows_of.rows(tmp_path, table)
    made = len(calls)
    assert made == 2 * 3  # 20 records, 8 at a time, two packages
    again = rows_of.rows(tmp_path, table)
    assert len(calls) == made
    # kept in single precision
    assert_allclose(again["tsfel"], first["tsfel"], rtol=1e-6)
    assert_allclose(first["tsfel"][:, 0], [recording(i).signal.std() for i in range(20)], rtol=1e-6)
    changed = FeatureTable(names=(), values=table.values, manifest=manifest + 1)
    rows_of.rows(tmp_path, changed)
    assert len(calls) == 2 * made
    quick = transformed_rows(tmp_path, np.arange(20), quick=True).rows(tmp_path, table)
    assert set(quick.values()) == {LEFT_OUT}


@pytest.mark.parametrize("source", list(PACKAGES))
def test_the_real_packages_compute_finite_rows(source):
    if importlib.util.find_spec(PACKAGES[source]) is None:
        pytest.skip(f"{PACKAGES[source]} is not installed")
    transform = foreign_transform(source, (recording(i) for i in range(5)), seed=0)
    rows = transform([recording(10), recording(11, n=300)])
    assert np.isfinite(rows).all()
    assert not np.allclose(rows[0], rows[1])
    assert_allclose(transform([recording(10)]), rows[:1], rtol=1e-6)  # single precision inside
