"""Intervals and sets: exact ranks, coverage over many trials, machines rather than records."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wearstate.diagnose.learning.conformal import (
    IntervalCalibration,
    fit_scale,
    grade_limits,
    grade_probabilities,
    grade_set,
    interval,
    outer_tenths,
    record_weights,
    scale_inputs,
    tails,
    weighted_quantile,
    widening,
)
from wearstate.diagnose.learning.grades import grades_of


def known(log_error, *, estimate=None, scale=None, group=None):
    """Calibration of given errors of log severity."""
    n = len(log_error)
    estimate = np.ones(n) if estimate is None else estimate
    return IntervalCalibration(
        estimate=estimate,
        truth=estimate * np.exp(log_error),
        scale=np.ones(n) if scale is None else scale,
        distance=np.ones(n),
        group=np.arange(n) if group is None else group,
    )


@pytest.mark.parametrize("n", [3, 8, 39, 60, 199])
def test_ranks_are_those_of_split_conformal(n):
    """One record a machine: the textbook's rank, each tail with half of what may be missed."""
    error = np.random.default_rng(n).standard_normal(n)
    found = tails(known(error))
    rank = min(math.ceil(0.95 * (n + 1)), n)
    assert found.high == pytest.approx(np.sort(error)[rank - 1])
    assert found.low == pytest.approx(-np.sort(error)[n - rank])
    assert found.coverage == pytest.approx(min(0.9, (n - 1) / (n + 1)))


@pytest.mark.parametrize("n", [3, 16, 60])
def test_the_interval_keeps_what_it_claims_however_few_machines_there_are(n):
    rng = np.random.default_rng(9)
    covered = []
    for _ in range(3000):
        found = tails(known(rng.standard_normal(n)))
        low, high = interval(1.0, 1.0, found)
        covered.append(low <= math.exp(rng.standard_normal()) <= high)
    # 3,000 trials: four standard errors are 0.037 at one half, 0.022 at 0.9; a whole rank on
    # either side is 2 / (n + 1) more than asked.
    assert found.coverage - 0.037 < np.mean(covered) < found.coverage + 0.037 + 2 / (n + 1)


def test_machines_with_many_records_do_not_drown_the_others():
    """One machine in two has a large error, and one record against nine of the others."""
    rng = np.random.default_rng(4)
    group = np.concatenate([np.arange(20), np.repeat(np.arange(20, 40), 9)])
    covered = []
    for _ in range(300):
        error = np.where(group < 20, 1.0, 0.1) * rng.standard_normal(group.size)
        found = tails(known(error, group=group))
        new = (1.0 if rng.random() < 0.5 else 0.1) * rng.standard_normal()
        covered.append(-found.low <= new <= found.high)
    # 300 trials at 0.9: three standard errors are 0.052. Records of equal weight give 0.73.
    assert np.mean(covered) > 0.9 - 0.052


def test_every_machine_weighs_the_same():
    weights = record_weights(np.array([5, 1, 1, 1, 5, 8]))
    assert weights[[0, 4]].sum() == pytest.approx(0.25)
    assert weights[1:4].sum() == pytest.approx(0.25)
    assert weights[5] == pytest.approx(0.25)


@settings(deadline=None)
@given(st.lists(st.integers(-9, 9), min_size=1, max_size=30), st.floats(0.01, 1.0))
def test_quantile_of_equal_weights_is_the_inverse_of_the_distribution(values, level):
    array = np.array(values, dtype=float)
    found = weighted_quantile(array, np.full(array.size, 1 / array.size), level)
    assert found in values
    # the share below or on it reaches the level, the share strictly below does not
    assert np.mean(array <= found) >= level - 1e-9
    assert np.mean(array < found) < level + 1e-9


def test_intervals_follow_the_expected_size_of_the_error():
    """Errors that grow with the estimate: coverage at a narrow and at a wide place."""
    rng = np.random.default_rng(2)
    covered = {0.5: [], 2.0: []}
    for _ in range(300):
        estimate = np.exp(rng.uniform(np.log(0.3), np.log(3), 300))
        error = 0.1 * estimate * rng.standard_normal(300)
        distance = np.exp(0.2 * rng.standard_normal(300))
        inputs = scale_inputs(estimate, distance, np.full(300, 0.1))
        scale = fit_scale(inputs, error)
        found = tails(known(error, estimate=estimate, scale=scale.predict(inputs)))
        for place, told in covered.items():
            size = float(scale.predict(scale_inputs([place], [1.0], [0.1]))[0])
            low, high = interval(place, size, found)
            told.append(low <= place * np.exp(0.1 * place * rng.standard_normal()) <= high)
    for told in covered.values():
        # 300 trials at 0.9: three standard errors are 0.052; the line through the log sizes of
        # the errors is right here, so nothing is added
        assert np.mean(told) == pytest.approx(0.9, abs=0.052)


def test_the_farther_from_the_familiar_and_the_more_parts_differ_the_wider():
    rng = np.random.default_rng(3)
    distance = np.exp(0.3 * rng.standard_normal(3000))
    apart = np.exp(0.3 * rng.standard_normal(3000)) / 10
    inputs = scale_inputs(np.exp(rng.standard_normal(3000)), distance, apart)
    scale = fit_scale(inputs, apart * distance**2 * rng.standard_normal(3000))
    near, far, torn = scale.predict(scale_inputs(np.ones(3), [1.0, 1.5, 1.0], [0.1, 0.1, 0.15]))
    # the slope of 3,000 log sizes of spread 1.1 over a spread of 0.3 is known to 0.07
    assert np.log(far / near) == pytest.approx(2 * np.log(1.5), abs=4 * 0.07 * np.log(1.5))
    assert np.log(torn / near) == pytest.approx(np.log(1.5), abs=4 * 0.07 * np.log(1.5))


def test_widened_intervals_hold_at_the_end_of_a_condition_too():
    """Errors twice as large at the upper end of a load: nine of ten, and there fewer."""
    rng = np.random.default_rng(4)
    load = rng.uniform(0, 1, 4000)

    def errors(load):
        return np.where(load > 0.9, 2.0, 1.0) * rng.standard_normal(len(load))

    plain = known(errors(load))
    wide = replace(plain, widened=widening(plain, outer_tenths(load[:, None])))
    fresh = rng.uniform(0.9, 1, 4000)
    held = {}
    for name, each in (("plain", plain), ("wide", wide)):
        ends = tails(each)
        held[name] = np.mean((-ends.low <= (e := errors(fresh))) & (e <= ends.high))
    # at the end one standard error of a tenth, 0.015, may lack; plain ones hold 0.63 there
    assert held["plain"] < 0.7
    assert 0.86 < held["wide"] < 0.92


@pytest.mark.parametrize(("machines", "most"), [(300, 1.18), (3000, 1.06)])
def test_intervals_of_equal_parts_are_widened_by_chance_alone(machines, most):
    """The widest of ten tenths lies 1.5 standard errors above the mean, and one is allowed.

    A standard error of a tenth's quantile is 0.16 of it with 300 machines, 0.05 with 3,000: half of
    it is expected, and twice that the most.
    """
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        parts = outer_tenths(rng.standard_normal((machines, 5)))
        found.append(widening(known(rng.standard_normal(machines)), parts))
    assert min(found) >= 1
    assert 1 < np.mean(found) < most


def test_few_machines_of_a_part_tell_nothing():
    error = np.ones(200)
    error[:8] = 100
    group = np.arange(200)
    assert widening(known(error, group=group), [group < 19]) == 1
    assert widening(known(error, group=group), [group < 20]) > 1
    unknown = np.full((200, 1), np.nan)
    unknown[50:] = np.arange(150.0)[:, None]
    low, high = outer_tenths(unknown)
    assert low.sum() == high.sum() == 15
    assert not low[:50].any()


EDGES = [1.0, 2.0, 3.0]


def test_every_grade_keeps_its_own_coverage():
    """Nine machines in ten are new and far from an edge; the worn ones are covered no less."""
    rng = np.random.default_rng(5)
    held, sizes = {g: [] for g in range(4)}, []

    def machines(n):
        worn = rng.random(n) < 0.1
        return np.where(worn, rng.uniform(1.0, 4.0, n), rng.uniform(0.2, 0.5, n))

    for _ in range(60):
        truth, error = machines(1000), 0.25 * rng.standard_normal(1000)
        limits = grade_limits(known(error, estimate=truth * np.exp(-error)), EDGES)
        for new in machines(300):
            told = grade_set(new * np.exp(-0.25 * rng.standard_normal()), 1.0, limits, EDGES)
            held[int(grades_of(new, EDGES))].append(int(grades_of(new, EDGES)) in told)
            sizes.append(len(told))
    for told in held.values():
        # some 600 trials of a worn grade: three standard errors are 0.037. One limit for all
        # grades covers the narrow second one in 0.6.
        assert np.mean(told) > 0.9 - 0.037
    assert min(sizes) >= 1
    assert np.mean(sizes) < 1.5  # of four


def test_a_grade_that_no_machine_had_cannot_be_excluded():
    truth = np.array([0.5, 0.6, 1.5, 1.6])
    limits = grade_limits(known(np.zeros(4), estimate=truth), EDGES)
    assert np.isinf(limits[2:]).all()
    assert grade_set(0.5, 1.0, limits, EDGES) == (0, 1, 2, 3)


@settings(deadline=None)
@given(st.floats(0.01, 10), st.floats(0.001, 2), st.lists(st.floats(0, 3), min_size=4, max_size=4))
def test_sets_have_no_gap_and_hold_the_grade_of_the_estimate(estimate, scale, limits):
    told = grade_set(estimate, scale, np.array(limits), EDGES)
    assert int(grades_of(estimate, EDGES)) in told
    assert list(told) == list(range(told[0], told[-1] + 1))


def test_grade_probabilities_are_those_of_the_error():
    from scipy.stats import norm

    error = norm.ppf((np.arange(2000) + 0.5) / 2000)
    found = grade_probabilities(1.5, 0.3, known(error), EDGES)
    ends = norm.cdf(np.log(np.array(EDGES) / 1.5) / 0.3)
    # 2,000 steps of the distribution
    np.testing.assert_allclose(found, np.diff(ends, prepend=0, append=1), atol=1e-3)
    assert found.sum() == pytest.approx(1.0)
