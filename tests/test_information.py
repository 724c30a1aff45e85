"""Mutual information against closed forms, scikit-learn, and neighbours counted one by one."""

import numpy as np
import pytest
from scipy.special import digamma
from scipy.stats import rankdata
from sklearn.feature_selection import mutual_info_classif, mutual_info_regression
from wearstate.diagnose.learning.information import mutual_information


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_two_normal_variables_have_the_information_of_their_correlation(correlation):
    rng = np.random.default_rng(3)
    x, other = rng.standard_normal((2, 4000))
    y = correlation * x + np.sqrt(1 - correlation**2) * other
    expected = -0.5 * np.log(1 - correlation**2)
    # the estimate scatters by about 1 / sqrt(n) = 0.016 nat; three of them
    assert mutual_information(x, y) == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("n", [10, 37, 300])
def test_numbers_and_conditions_are_those_of_scikit_learn(n):
    """Also of equal values, which the same noise parts; conditions of irregular values."""
    rng = np.random.default_rng(n)
    y = rng.random(n)
    for x in (rng.random(n), y + 0.1 * rng.random(n), np.round(y, 1), rankdata(y)):
        for target in (y, np.round(y, 1)):
            [expected] = mutual_info_regression(x[:, None], target, random_state=4)
            # sums of n numbers of the order of 1
            assert mutual_information(x, target, seed=4) == pytest.approx(expected, abs=1e-12)
    for conditions in (rng.integers(0, 3, n), np.array(["one", *["many"] * (n - 1)])):
        [expected] = mutual_info_classif(y[:, None], conditions, random_state=4)
        found = mutual_information(y, conditions, classes=True, seed=4)
        assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("sizes", [(20, 20), (3, 4, 5), (1, 2, 9)])
def test_conditions_of_few_records_are_counted_one_by_one(sizes):
    """scikit-learn rounds distances of less than seven records by more than what parts ranks."""
    rng = np.random.default_rng(7)
    label = np.repeat(np.arange(len(sizes)), sizes)
    x = rng.random(label.size)
    terms = []
    shared = [i for i in range(x.size) if sizes[label[i]] > 1]
    for i in shared:
        own = sorted(abs(x[i] - x[j]) for j in shared if label[j] == label[i] and j != i)
        k = min(3, len(own))
        closer = sum(abs(x[i] - x[j]) < own[k - 1] for j in shared)  # the record itself too
        terms.append(digamma(k) - digamma(len(own) + 1) - digamma(closer))
    expected = max(0.0, digamma(len(shared)) + np.mean(terms))
    assert mutual_information(x, label, classes=True) == pytest.approx(expected, abs=1e-12)


def test_nothing_is_known_where_every_condition_has_one_record():
    assert mutual_information(np.arange(5.0), np.arange(5), classes=True) == 0.0
