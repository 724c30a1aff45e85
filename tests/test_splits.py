"""Splits keep a machine on one side."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from wearstate.datasets.splits import check_no_leak, condition_split, group_folds, group_split

MANY = st.lists(st.integers(-3, 9), min_size=2, max_size=60).filter(lambda g: len(set(g)) > 1)


@given(MANY, st.floats(0.01, 0.99), st.integers(0, 99))
def test_a_split_parts_all_records_and_no_group(groups, fraction, seed):
    train, test = group_split(groups, test_fraction=fraction, seed=seed)
    assert_array_equal(np.sort(np.r_[train, test]), np.arange(len(groups)))
    labels = np.array(groups)
    assert not set(labels[train]) & set(labels[test])
    n_groups = len(set(groups))
    # half a group from rounding, one from keeping both sides occupied
    assert abs(len(set(labels[test])) - fraction * n_groups) <= 1
    check_no_leak(groups, train, test)


@given(MANY, st.integers(0, 99))
def test_folds_test_every_record_once(groups, seed):
    n = min(3, len(set(groups)))
    folds = group_folds(groups, n=n, seed=seed)
    assert_array_equal(np.sort(np.concatenate([test for _, test in folds])), range(len(groups)))
    labels = np.array(groups)
    sizes = [len(set(labels[test])) for _, test in folds]
    assert max(sizes) - min(sizes) <= 1
    for train, test in folds:
        check_no_leak(groups, train, test)
        assert len(train) + len(test) == len(groups)


def test_the_seed_decides():
    groups = np.repeat(np.arange(50), 2)
    first, again, other = (group_split(groups, seed=s)[1] for s in (0, 0, 1))
    assert_array_equal(first, again)
    assert set(first) != set(other)
    # 25 % of 50 groups is 12 (even rounding), two records each
    assert len(first) == 24


def test_held_out_conditions():
    values, groups = [4.0, 5.0, 6.0, 4.5], [0, 0, 1, 1]
    train, test = condition_split(values, 4.5, 5.0)
    assert (train.tolist(), test.tolist()) == ([0, 2], [1, 3])
    train, test = condition_split(values, 5.5, 9.0, groups=groups)
    # record 3 is of the held-out machine 1
    assert (train.tolist(), test.tolist()) == ([0, 1], [2])
    check_no_leak(groups, train, test)


def test_a_leak_is_named():
    with pytest.raises(ValueError, match=r"1 group\(s\) are on both sides, must be 0: \[7\]"):
        check_no_leak([7, 7, 8], [0], [1, 2])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: group_split([1, 2], test_fraction=1.0), "test_fraction = 1.0 must be > 0 and < 1"),
        (lambda: group_split([1, 1]), r"1 group\(s\), must be >= 2"),
        (lambda: group_split([[1], [2]]), "groups has 2 dimensions"),
        (lambda: group_folds([1, 2, 3], n=4), r"3 group\(s\), must be >= 4"),
        (lambda: group_folds([1, 2, 3], n=1), "n = 1 folds must be >= 2"),
        (lambda: condition_split([1.0, 2.0], 3, 4), "holds out 0 and keeps 2 of 2"),
        (lambda: condition_split([1.0, 2.0], 0, 4), "holds out 2 and keeps 0 of 2"),
        (lambda: condition_split([1.0, np.nan], 0, 1), r"1 condition value\(s\) are not finite"),
    ],
)
def test_splits_that_cannot_be_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
