"""The candidates, their flattened trees, and the choice among them."""

from itertools import pairwise

import numpy as np
import pytest
from wearstate.datasets.splits import group_folds
from wearstate.diagnose.models import (
    CANDIDATES,
    Candidate,
    Linear,
    blend_weights,
    fit_blend,
    knowing_unseen,
    least_line_error,
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
        ours = ROWS[name].fit(rows[:200], target[:200], 3).predict(rows)
        # sums of 100 to 200 leaves in another order
        np.testing.assert_allclose(ours, theirs, rtol=1e-12)
        assert np.std(ours) > 0.1


@pytest.mark.parametrize("name", ROWS)
def test_one_row_is_told_as_among_many(task, name):
    rows, target, _ = task
    part = ROWS[name].fit(rows, target, 0)
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
    def fit(_rows, target, _seed):
        zero = np.zeros(_rows.shape[1])
        return Linear(centre=zero, spread=zero + 1, weight=zero, offset=value, log=False)

    return Candidate(name=f"constant {value:g}", cost_ms=cost, fit=fit)


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
    low, high = blend.predict(np.array([-100 * np.ones(20), 100 * np.ones(20)]))
    assert (low, high) == (target.min() / 2, target.max() * 2)


def unseen_task(keep):
    """A straight target of one of five features, records of some of its range left to learn from.

    The level doubles over the range; noise of 0.01 blurs what trees and lines can tell.
    """
    rng = np.random.default_rng(5)
    target = rng.uniform(1, 2, 900)
    rows = rng.standard_normal((900, 5))
    rows[:, 0] = target + 0.01 * rng.standard_normal(900)
    learn = keep(target)
    folds = group_folds(np.arange(learn.sum()), n=5, seed=0)
    trees = [candidate for candidate in CANDIDATES if candidate.name in ("plain ridge 3", "trees")]
    fitted = fit_blend(rows[learn], target[learn], folds, candidates=trees)
    reach = 2 * least_line_error(fitted.options)
    return fitted.blend, knowing_unseen(fitted.blend, target[learn], reach), rows, target


@pytest.mark.parametrize(
    ("keep", "asked"),
    [
        (lambda y: y < 1.5, lambda y: y > 1.6),
        (lambda y: (y < 1.4) | (y > 1.6), lambda y: (y > 1.45) & (y < 1.55)),
    ],
    ids=["beyond", "between"],
)
def test_where_no_severity_was_seen_the_line_stands_alone(keep, asked):
    blend, knowing, rows, target = unseen_task(keep)
    trees = blend.parts[blend.names.index("trees")]
    there = asked(target)
    line = blend.parts[blend.names.index("plain ridge 3")]
    # the least of records asked lies farther from those known than a line errs by
    np.testing.assert_allclose(knowing.predict(rows[there]), line.predict(rows[there]), rtol=1e-12)
    error, of_trees = (
        np.abs(part.predict(rows[there]) - target[there]).mean() for part in (knowing, trees)
    )
    assert error < 0.02  # twice the mean of the noise
    assert of_trees > 2 * error
    known = keep(target) & (target > 1.05) & (np.abs(target - 1.5) > 0.15)
    np.testing.assert_array_equal(knowing.predict(rows[known]), blend.predict(rows[known]))


def test_a_line_is_kept_beside_trees_that_are_better(task):
    rows, target, groups = task
    trees = [candidate for candidate in CANDIDATES if candidate.name in ("ridge 300", "trees")]
    found = fit_blend(rows[:, 4:5], target, group_folds(groups, n=5, seed=0), candidates=trees)
    assert found.chosen == "trees"  # of |x| a line knows nothing
    assert dict(zip(found.blend.names, found.blend.weights.round(3).tolist(), strict=True)) == {
        "ridge 300": 0.02,
        "trees": 0.98,
    }
