"""The candidates, their flattened trees, and the choice among them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from wearstate.datasets.split.rules import group_folds
from wearstate.diagnose.learning.blends import Linear
from wearstate.diagnose.learning.nets import FEWEST_RECORDS
from wearstate.diagnose.learning.regressions import (
    CANDIDATES,
    RegressionCandidate,
    blend_weights,
    fit_blend,
)

ROWS = {candidate.name: candidate for candidate in CANDIDATES}


@pytest.fixture(scope="module")
def task():
    """300 records of 100 machines: a curved function of three of twenty features."""
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((300, 20))
    target = np.exp(0.3 * rows[:, :2].sum(axis=1) + np.abs(rows[:, 4]))
    return rows, target, np.repeat(np.arange(100), 3)


@pytest.mark.parametrize(("more", "of_trees", "of_boosting"), [(0, 1.0, 1.0), (620, 0.5, 0.25)])
def test_flattened_trees_say_what_the_library_says(task, more, of_trees, of_boosting):
    """A node chooses from 320 or 160 features, or from all where there are fewer."""
    from sklearn.ensemble import ExtraTreesRegressor, HistGradientBoostingRegressor

    rows, target, _ = task
    rows = np.hstack([rows, np.random.default_rng(1).standard_normal((300, more))])
    single = rows.astype(np.float32)
    trees = ExtraTreesRegressor(100, min_samples_leaf=2, max_features=of_trees, random_state=3)
    boosting = HistGradientBoostingRegressor(
        max_iter=200,
        learning_rate=0.08,
        max_leaf_nodes=15,
        max_features=of_boosting,
        random_state=3,
    )
    for name, model in (("trees", trees), ("boosting", boosting)):
        theirs = np.exp(model.fit(single[:200], np.log(target[:200])).predict(single))
        ours = ROWS[name].fit(rows[:200], rows[:200], target[:200], 3, 0).predict(rows)
        # sums of 100 to 200 leaves in another order
        np.testing.assert_allclose(ours, theirs, rtol=1e-12)
        assert np.std(ours) > 0.1


@pytest.mark.parametrize("name", ROWS)
def test_one_row_is_told_as_among_many(task, name):
    rows, target, _ = task
    part = ROWS[name].fit(rows, rows, target, 0, 0)
    # matrix and row products may add up in another order
    assert part.predict(rows[7:8])[0] == pytest.approx(part.predict(rows)[7], rel=1e-12)


def test_weights_of_unbiased_estimates_are_inverse_to_their_variance():
    rng = np.random.default_rng(1)
    truth = rng.uniform(1, 2, 20_000)
    table = truth[:, None] + rng.standard_normal((20_000, 2)) * [0.1, 0.2]
    # 1 / 0.01 to 1 / 0.04; the weight's standard error is about 0.006
    assert blend_weights(table, truth) == pytest.approx([0.8, 0.2], abs=0.02)


def test_an_estimate_that_only_harms_has_no_weight():
    rng = np.random.default_rng(2)
    truth = rng.uniform(1, 2, 500)
    good = truth + 0.01 * rng.standard_normal(500)
    assert blend_weights(np.column_stack([good, 3 - truth]), truth).tolist() == [1.0, 0.0]


def test_a_small_budget_leaves_the_fast_ones(task):
    rows, target, groups = task
    folds = group_folds(groups, n=5)
    cheap = fit_blend(rows, target, folds, budget_ms=0.05)
    assert all("ridge" in name for name in cheap.blend.names)
    assert max(option.cost_ms for option in cheap.options if option.name == cheap.chosen) <= 0.05
    everything = fit_blend(rows, target, folds)
    # trees see the fold at 0 that no line can follow
    assert error(everything, target) < 0.9 * error(cheap, target)
    assert error(everything, target) == pytest.approx(
        next(o.error for o in everything.options if o.name == everything.chosen), rel=0.02
    )
    with pytest.raises(ValueError, match=r"budget_ms = 0\.001 ms must be >= 0\.02 ms"):
        fit_blend(rows, target, folds, budget_ms=0.001)


def error(fitted, target):
    return np.abs(fitted.estimate - target).mean()


def test_the_front_has_no_option_that_is_dearer_and_no_better(task):
    rows, target, groups = task
    options = fit_blend(rows, target, group_folds(groups, n=5)).options
    front = sorted((o.cost_ms, o.error) for o in options if o.on_front)
    assert len(front) > 1
    assert all(b[1] < a[1] for a, b in pairwise(front))
    best = min(option.error for option in options)
    assert front[-1][1] == best


def constant(value, cost):
    def fit(_rows, _moved, target, _seed, _noted):
        zero = np.zeros(_rows.shape[1])
        ends = {"low": zero - 9, "high": zero + 9}
        return Linear(centre=zero, spread=zero + 1, weight=zero, **ends, offset=value, log=False)

    return RegressionCandidate(name=f"constant {value:g}", cost_ms=cost, fit=fit)


def test_what_is_hardly_better_is_not_worth_its_time():
    target = np.full(40, 10.0)
    folds = group_folds(np.arange(40), n=4)
    rows = np.zeros((40, 1))
    near, dear = constant(9.0, 0.1), constant(9.009, 1.0)  # errors of 1.000 and 0.991: 0.9 % less
    assert fit_blend(rows, target, folds, candidates=(near, dear)).chosen == "constant 9"
    better = constant(9.02, 1.0)  # 2 % less
    assert fit_blend(rows, target, folds, candidates=(near, better)).chosen == "constant 9.02"


def test_an_out_of_fold_estimate_does_not_know_its_target(task):
    rows, target, groups = task
    folds = group_folds(groups, n=5)
    one = CANDIDATES[:1]
    whole = fit_blend(rows, target, folds, candidates=one).estimate
    _, test = folds[2]
    changed = target.copy()
    changed[test] = target[test][::-1]
    again = fit_blend(rows, changed, folds, candidates=one).estimate
    assert np.array_equal(whole[test], again[test])
    assert not np.array_equal(whole, again)


def test_estimates_end_where_nothing_was_trained(task):
    rows, target, groups = task
    blend = fit_blend(rows, target, group_folds(groups, n=5), candidates=CANDIDATES[:1]).blend
    ends = np.array([-100 * np.ones(20), 100 * np.ones(20)])
    low, high = blend.predict(ends)
    assert (blend.low, blend.high) == (target.min() / 2, target.max() * 2)
    assert blend.low <= min(low, high) < max(low, high) <= blend.high
    assert np.array_equal(blend.predict(1e6 * ends), [low, high])
    narrow = replace(blend, low=min(low, high) + 1e-9, high=max(low, high) - 1e-9)
    assert sorted(narrow.predict(ends)) == [narrow.low, narrow.high]


def blended(rows, target):
    """A line and trees of 900 records, blended."""
    folds = group_folds(np.arange(len(target)), n=5, seed=0)
    kinds = [candidate for candidate in CANDIDATES if candidate.name in ("plain ridge 3", "trees")]
    return fit_blend(rows, target, folds, candidates=kinds)


@pytest.fixture(scope="module")
def straight():
    """A target that follows the first of five features, with a step in the second: no kind of part
    tells both as well as the blend; noise of 0.01 blurs it."""
    rng = np.random.default_rng(5)
    slope = rng.uniform(1, 2, 900)
    rows = rng.standard_normal((900, 5))
    rows[:, 0] = slope + 0.01 * rng.standard_normal(900)
    target = slope + 0.1 * (rows[:, 1] > 0.5)
    return rows, target, blended(rows, target)


def test_a_line_ends_a_little_beyond_what_it_saw(straight):
    rows, _, fitted = straight
    line = fitted.blend.parts[fitted.blend.names.index("plain ridge 3")]
    far = np.tile(rows.mean(axis=0), (3, 1))
    far[:, 0] = [2.0, 3.0, 1e6]
    near, end, runaway = line.predict(far)
    # a tenth of the feature's range beyond it
    assert end == runaway == pytest.approx(near + 0.1 * np.ptp(rows[:, 0]), abs=0.03)


def test_lines_that_part_from_the_trees_are_held_at_the_tube(straight):
    rows, _, fitted = straight
    blend = fitted.blend
    lines, trees = (blend.parts[blend.names.index(name)] for name in ("plain ridge 3", "trees"))
    share = blend.weights[blend.names.index("plain ridge 3")]
    assert 0 < blend.tube < 0.1  # ten times the noise at most
    # a contradiction that no training record held: what tells the wear says 1, the rest is far out
    odd = np.full((1, 5), 3.5)
    odd[0, 0] = rows[:, 0].min() - 1.0
    apart = float(blend.disagreement(odd)[0])
    assert apart > blend.tube
    held = trees.predict(odd) * np.exp(-blend.tube)
    assert lines.predict(odd) < held
    expected = share * held + (1 - share) * trees.predict(odd)
    np.testing.assert_allclose(blend.predict(odd), expected, rtol=1e-12)
    # where they agree the blend is the weighted mean
    usual = blend.disagreement(rows) < blend.tube
    assert usual.mean() > 0.95
    found = np.stack([part.predict(rows[usual]) for part in blend.parts], axis=1)
    np.testing.assert_allclose(blend.predict(rows[usual]), found @ blend.weights, rtol=1e-9)


def test_disagreement_is_that_of_groups_without_a_part(straight):
    rows, _, fitted = straight
    assert np.quantile(fitted.disagreement, 0.99) == pytest.approx(fitted.blend.tube)
    assert not np.allclose(fitted.disagreement, fitted.blend.disagreement(rows), rtol=0.1)


def test_a_line_is_kept_beside_trees_that_are_better(task):
    rows, target, groups = task
    trees = [candidate for candidate in CANDIDATES if candidate.name in ("ridge 300", "trees")]
    found = fit_blend(rows[:, 4:5], target, group_folds(groups, n=5, seed=0), candidates=trees)
    assert found.chosen == "trees"  # of |x| a line knows nothing
    assert dict(zip(found.blend.names, found.blend.weights.round(3).tolist(), strict=True)) == {
        "ridge 300": 0.02,
        "trees": 0.98,
    }


def test_nets_follow_a_bend_and_what_they_met_on_other_machines():
    """The first feature tells the target here and misleads elsewhere, the second tells it always:
    a net that was taught both kinds of machine goes by the second."""
    rng = np.random.default_rng(8)
    bend = rng.standard_normal((900, 6))
    target = np.exp(np.abs(bend[:, 1]))
    rows, moved = bend.copy(), bend.copy()
    rows[:, 0] = np.abs(bend[:, 1])
    rows[:, 1:3] += 0.1 * rng.standard_normal((900, 2))
    train, test = slice(0, 700), slice(700, 900)

    def errors(taught):
        part = ROWS["nets"].fit(rows[train], taught[train], target[train], 0, 0)
        return [np.abs(np.log(part.predict(each[test]) / target[test])).mean() for each in seen]

    seen = rows, moved
    alone, both = errors(rows), errors(moved)
    assert alone[0] < 0.1
    assert both[0] < 0.15
    assert both[1] < 0.25 * alone[1]


def test_a_net_sees_a_noted_condition_beside_hundreds_of_features():
    """The target hangs on one column that no principal direction holds; what is noted of the
    machines with other resonances is another value, and teaches nothing."""
    rng = np.random.default_rng(5)
    sources = rng.standard_normal((900, 10))
    features = sources @ rng.standard_normal((10, 400)) + 0.3 * rng.standard_normal((900, 400))
    condition = rng.standard_normal((900, 1))
    target = np.exp(0.3 * sources[:, 0] + 0.3 * condition[:, 0])
    rows = np.hstack([features, condition])
    moved = np.hstack([features, rng.permutation(condition)])
    train, test = slice(0, 700), slice(700, 900)

    def error(noted):
        part = ROWS["nets"].fit(rows[train], moved[train], target[train], 0, noted)
        return np.abs(np.log(part.predict(rows[test]) / target[test])).mean()

    assert error(1) < 0.05
    assert error(0) > 0.15  # most of the 0.24 that the condition makes


def test_a_net_sees_the_one_feature_that_matters_beside_hundreds():
    """Ten sources move four hundred bands, and the target hangs on one of these alone."""
    rng = np.random.default_rng(6)
    sources = 3.0 * rng.standard_normal((900, 10))
    rows = sources @ rng.standard_normal((10, 400)) + rng.standard_normal((900, 400))
    rows[:, 7] = rng.standard_normal(900)
    target = np.exp(0.3 * np.abs(rows[:, 7]))
    train, test = slice(0, 700), slice(700, 900)
    part = ROWS["nets"].fit(rows[train], rows[train], target[train], 0, 0)
    error = np.abs(np.log(part.predict(rows[test]) / target[test])).mean()
    assert error < 0.05  # it is 0.007; 0.13 for one guess, 0.15 if all features weigh the same


def test_a_net_for_a_wear_that_is_the_same_in_all_records_predicts_it():
    rows, target = np.random.default_rng(1).standard_normal((200, 5)), np.full(200, 0.3)
    part = ROWS["nets"].fit(rows, rows, target, 0, 0)
    # no training ends at exactly nothing: 3 % remain, where one bad direction would give any number
    assert part.predict(rows) == pytest.approx(target, rel=0.05)


def test_nets_learn_two_kinds_that_any_feature_separates():
    """Rounding leaves the importance of some features of such kinds just below zero."""
    kind = np.repeat([1.0, 2.0], [400, 50])
    rows = np.random.default_rng(0).standard_normal((450, 300))
    rows[:, :100] += 8 * (kind[:, None] > 1)
    part = ROWS["nets"].fit(rows, rows, kind, 0, 0)
    np.testing.assert_allclose(part.predict(rows), kind, rtol=0.2)


def test_few_records_train_no_net(task):
    rows, target, groups = (each[: FEWEST_RECORDS - 1] for each in task)
    fitted = fit_blend(rows, target, group_folds(groups, n=3, seed=0))
    assert "nets" not in {option.name for option in fitted.options}


@pytest.mark.parametrize(("n", "trees"), [(999, 200), (1000, 400)])
def test_many_records_grow_more_and_smaller_trees(n, trees):
    rows = np.random.default_rng(9).standard_normal((n, 3))
    part = ROWS["boosting"].fit(rows, rows, np.exp(rows[:, 0]), 0, 0)
    assert len(part.root) == trees
