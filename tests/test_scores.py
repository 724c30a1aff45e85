"""Figures of merit against closed forms, and their intervals against what statistics expects."""

import json
import math

import numpy as np
from numpy.testing import assert_allclose
from wearstate.diagnose.learning.grades import grades_of
from wearstate.diagnose.learning.scores import (
    FIGURES,
    Judged,
    bound_of,
    confusion,
    figures,
    kappa,
    plain,
    point_judged,
    resampled,
    share,
    smallest_found,
)

EDGES = [1.0, 2.0, 3.0]
LIMIT = 3.0


def judged(truth, found, **changes):
    truth, found = np.asarray(truth, float), np.asarray(found, float)
    n = len(truth)
    fields = {
        "groups": np.arange(n),
        "truth": truth,
        "found": found,
        "grade": grades_of(found, EDGES),
        "graded": np.ones(n, bool),
        "cautious": np.zeros(n, bool),
        "low": found - 0.1,
        "high": found + 0.1,
        "possible": np.eye(4, dtype=bool)[grades_of(found, EDGES)],
    }
    return Judged(**{**fields, **changes})


def found_in(told):
    return figures(told, EDGES, LIMIT, resampled(told.groups))


# -- intervals


def test_the_interval_of_a_mean_is_that_of_the_central_limit():
    values = np.random.default_rng(1).standard_normal(400)
    found = share(values, np.ones(400), resampled(np.arange(400), n=4000))
    half = 1.96 * values.std() / math.sqrt(400)
    assert_allclose(found.value, values.mean())
    # an end is a 2.5 % quantile of 4,000: its deviation is 0.04 of the half width; three of them
    assert_allclose(
        [found.low, found.high], [values.mean() - half, values.mean() + half], atol=0.12 * half
    )


def test_records_of_one_machine_are_not_many_machines():
    values = np.random.default_rng(2).standard_normal(50)
    once = share(values, np.ones(50), resampled(np.arange(50)))
    # ten equal records of each machine: nothing more is known
    ten = share(np.repeat(values, 10), np.ones(500), resampled(np.repeat(np.arange(50), 10)))
    assert_allclose([ten.low, ten.high], [once.low, once.high], rtol=1e-12)
    mistaken = share(np.repeat(values, 10), np.ones(500), resampled(np.arange(500)))
    assert mistaken.high - mistaken.low < 0.4 * (ten.high - ten.low)  # 1 / sqrt(10) = 0.32


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(3)
    held = 0
    for trial in range(300):
        machine = np.repeat(rng.standard_normal(60), 2) + 0.3 * rng.standard_normal(120)
        found = share(
            machine, np.ones(120), resampled(np.repeat(np.arange(60), 2), n=300, seed=trial)
        )
        held += found.low <= 0 <= found.high
    # 0.95 with deviation 0.0126 of 300 trials, three of them; the percentile interval of 60
    # machines is about 0.01 too optimistic
    assert 0.90 <= held / 300 <= 0.99


def test_the_same_seed_gives_the_same_interval():
    values = np.random.default_rng(4).standard_normal(30)
    groups = np.repeat(np.arange(10), 3)
    first, again, other = (share(values, np.ones(30), resampled(groups, seed=s)) for s in (5, 5, 6))
    assert first == again
    assert first != other


def test_a_share_of_nothing_is_nothing():
    found = share([0.0, 0.0], [0.0, 0.0], resampled([0, 1]))
    assert math.isnan(found.value)
    assert plain(found) == {"value": None, "low": None, "high": None}


# -- figures


def test_figures_of_a_case_by_hand():
    truth = [0.5, 0.5, 1.5, 2.5, 3.5, 3.5]
    told = judged(
        truth,
        [0.6, 2.1, 1.5, 2.2, 3.6, 1.9],
        graded=np.array([True, True, True, True, True, True]),
        cautious=np.array([False, True, False, False, False, False]),
    )
    found = {name: figure.value for name, figure in found_in(told).items()}
    assert_allclose(found["mae_m"], (0.1 + 1.6 + 0 + 0.3 + 0.1 + 1.6) / 6)
    assert_allclose(found["mae_share_of_limit"], found["mae_m"] / 3)
    assert_allclose(found["accuracy"], 4 / 6)
    assert_allclose(found["within_one_grade"], 4 / 6)
    assert_allclose(found["mean_grade_error"], (0 + 2 + 0 + 0 + 0 + 2) / 6)
    assert found["false_alarm"] == 0.5
    assert found["missed_fault"] == 0.5
    assert_allclose(found["coverage"], 3 / 6)  # off by 0.1, 1.6, 0, 0.3, 0.1, 1.6, bounds inside
    assert_allclose(found["mean_interval_share"], 0.2 / 3)
    assert_allclose(found["set_coverage"], 4 / 6)
    assert found["mean_set_size"] == 1
    assert_allclose(found["caution"], 1 / 6)
    assert found["unfamiliar"] == 0


def test_what_is_refused_counts_in_no_figure_but_its_own():
    graded = np.array([True, True, False, False])
    told = judged([0.5, 1.5, 3.5, 0.5], [0.5, 1.6, 0.1, 3.9], graded=graded)
    found = {name: figure.value for name, figure in found_in(told).items()}
    assert_allclose(found["mae_m"], 0.05)
    assert_allclose(found["mae_all_m"], (0.1 + 3.4 + 3.4) / 4)
    assert (found["false_alarm"], found["unfamiliar"]) == (0, 0.5)
    assert math.isnan(found["missed_fault"])  # the only condemned one is refused
    nothing = found_in(judged([0.5], [0.5], graded=np.array([False])))
    assert math.isnan(nothing["accuracy"].value)
    assert bound_of(judged([0.5], [0.5], graded=np.array([False])), EDGES) is None


def test_near_an_edge_is_nearer_than_a_share_of_the_limit():
    # 8 % of 3 is 0.24: the first is 0.25 off the edge and wrong, the second 0.23 off and wrong
    told = judged([0.75, 0.77, 1.5], [1.1, 1.1, 1.5])
    assert_allclose(found_in(told)["accuracy_far"].value, 1 / 2)


def test_a_method_without_intervals_has_no_figures_of_them():
    told = point_judged(
        np.arange(2), np.array([0.5, 1.5]), np.array([0.5, 1.5]), np.array([0, 1]), 4
    )
    found = found_in(told)
    assert list(found) == [name for name, _ in FIGURES]
    assert all(math.isnan(found[name].value) for name in ("coverage", "set_coverage"))


def test_kappa_is_that_of_scikit_learn():
    from sklearn.metrics import cohen_kappa_score

    rng = np.random.default_rng(5)
    true = rng.integers(0, 4, 300)
    grade = np.clip(true + rng.integers(-1, 2, 300), 0, 3)
    over = rng.random(300) < 0.8
    found = kappa(true, grade, over, 4, resampled(np.arange(300)))
    assert_allclose(found.value, cohen_kappa_score(true[over], grade[over], weights="quadratic"))
    assert found.low < found.value < found.high
    for told in ([0, 0, 0], [0, 1, 3]):  # of one true grade nothing is told by chance or by skill
        same = kappa(np.zeros(3, int), np.array(told), np.ones(3, bool), 4, resampled(np.arange(3)))
        assert all(math.isnan(each) for each in (same.value, same.low, same.high))


def test_confusion_counts_by_true_grade():
    assert confusion(np.array([0, 0, 1, 3]), np.array([0, 1, 1, 0]), 4).tolist() == [
        [1, 1, 0, 0],
        [0, 1, 0, 0],
        [0, 0, 0, 0],
        [1, 0, 0, 0],
    ]


# -- the smallest wear found


def normal_case(n, seed):
    """Wear from 0 to 10, estimated with a normal error of deviation 1."""
    rng = np.random.default_rng(seed)
    truth = np.concatenate([np.zeros(n), rng.uniform(0, 10, n)])
    return truth, truth + rng.standard_normal(2 * n)


def test_the_smallest_wear_found_of_a_normal_error():
    truth, found = normal_case(4000, 6)
    groups = np.arange(len(truth))
    threshold, smallest = smallest_found(truth, found, truth == 0, resampled(groups, n=200))
    # quantile of 4,000 has deviation 0.033; that of the curve about 0.1 near its 90 % point
    assert_allclose(threshold, 1.6449, atol=0.1)
    assert_allclose(smallest.value, 1.6449 + 1.2816, atol=0.3)
    assert smallest.low < 2.9264 < smallest.high


def test_fewer_false_alarms_cost_sensitivity():
    truth, found = normal_case(2000, 7)
    draws = resampled(np.arange(len(truth)), n=50)
    floors = [
        smallest_found(truth, found, truth == 0, draws, false_alarm=rate)[1].value
        for rate in (0.2, 0.05, 0.01)
    ]
    assert floors == sorted(floors)
    assert floors[2] - floors[0] > 1  # 2.33 - 0.84 = 1.48 of a normal error


def test_wear_that_is_never_found_is_infinite():
    truth = np.linspace(0, 1, 50)
    _, smallest = smallest_found(truth, np.zeros(50), truth < 0.2, resampled(np.arange(50), n=20))
    assert smallest.value == math.inf
    assert plain(smallest) == {"value": None, "low": None, "high": None}


def test_plain_is_strict_json():
    value = {
        "a": np.float64(1.5),
        "b": np.arange(2),
        "c": [np.int64(3), float("nan")],
        "d": (True,),
    }
    assert json.loads(json.dumps(plain(value), allow_nan=False)) == {
        "a": 1.5,
        "b": [0, 1],
        "c": [3, None],
        "d": [True],
    }
