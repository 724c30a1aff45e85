"""Train and test splits that keep every machine on one side."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .record import DataError

Index = NDArray[np.intp]


def group_split(
    groups: ArrayLike, *, test_fraction: float = 0.25, seed: int = 0
) -> tuple[Index, Index]:
    """Split records at random, whole groups at a time.

    Parameters
    ----------
    groups : array_like [shape=(n_records,)]
        Machine of each record.
    test_fraction : float
        Share of the groups that goes to the test side, 0 < share < 1; at least one on each side.
    seed : int
        Of the choice.

    Returns
    -------
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Record numbers, rising.

    Raises
    ------
    DataError
        The fraction is out of bounds, or there is only one group.

    Examples
    --------
    >>> train, test = group_split([0, 0, 1, 1, 2, 2], test_fraction=0.3, seed=0)
    >>> len(train), len(test)
    (4, 2)
    """
    if not 0 < test_fraction < 1:
        raise DataError(f"test_fraction = {test_fraction} must be > 0 and < 1; try 0.25")
    labels = _labels(groups)
    order = _shuffled_groups(labels, 2, seed)
    n_test = min(max(round(test_fraction * len(order)), 1), len(order) - 1)
    return _sides(labels, order[:n_test])


def group_folds(groups: ArrayLike, *, n: int = 5, seed: int = 0) -> list[tuple[Index, Index]]:
    """Folds of a cross-validation, whole groups at a time.

    Parameters
    ----------
    groups : array_like [shape=(n_records,)]
        Machine of each record.
    n : int
        Number of folds, 2 <= n <= number of groups.
    seed : int
        Of the choice.

    Returns
    -------
    list of (train, test)
        Record numbers, rising; each record is in one test side. The numbers of groups in two
        test sides differ by one at most.

    Raises
    ------
    DataError
        There are fewer groups than folds, or `n` is below two.

    Examples
    --------
    >>> [test.tolist() for _, test in group_folds([7, 7, 8, 8], n=2, seed=0)]
    [[0, 1], [2, 3]]
    """
    if n < 2:
        raise DataError(f"n = {n} folds must be >= 2; try 5")
    labels = _labels(groups)
    order = _shuffled_groups(labels, n, seed)
    return [_sides(labels, part) for part in np.array_split(order, n)]


def condition_split(
    values: ArrayLike, low: float, high: float, *, groups: ArrayLike | None = None
) -> tuple[Index, Index]:
    """Hold out the records whose operating condition lies in a range.

    Parameters
    ----------
    values : array_like [shape=(n_records,)]
        Condition of each record, for example ``speed_hz``; finite.
    low, high : float
        Held out where ``low <= value <= high`` [unit of `values`].
    groups : array_like [shape=(n_records,)], optional
        Machine of each record: other records of held-out machines are in neither side.

    Returns
    -------
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Record numbers, rising.

    Raises
    ------
    DataError
        A value is not finite, the range is reversed, or a side is empty.

    Examples
    --------
    >>> train, test = condition_split([4.0, 5.0, 6.0], 5.5, 7.0)
    >>> train.tolist(), test.tolist()
    ([0, 1], [2])
    """
    condition = np.asarray(values, dtype=float)
    if not np.isfinite(condition).all():
        bad = int(np.count_nonzero(~np.isfinite(condition)))
        raise DataError(f"{bad} condition value(s) are not finite, must be 0; leave them out")
    held = (condition >= low) & (condition <= high)
    kept = ~held
    if groups is not None:
        labels = np.asarray(groups)
        kept &= ~np.isin(labels, labels[held])
    if not (held.any() and kept.any()):
        raise DataError(
            f"range {low:g} to {high:g} holds out {np.count_nonzero(held)} and keeps "
            f"{np.count_nonzero(kept)} of {condition.size} records, must be >= 1 each; values run "
            f"from {condition.min(initial=np.inf):g} to {condition.max(initial=-np.inf):g}"
        )
    return np.flatnonzero(kept), np.flatnonzero(held)


def check_no_leak(groups: ArrayLike, train: Sequence[int] | Index, test: Any) -> None:
    """Refuse a split that has a group on both sides.

    Parameters
    ----------
    groups : array_like [shape=(n_records,)]
        Machine of each record.
    train, test : array_like of int
        Record numbers.

    Raises
    ------
    DataError
        A group is on both sides; the first few are named.

    Examples
    --------
    >>> check_no_leak([0, 0, 1], [0, 1], [2])
    """
    labels = np.asarray(groups)
    shared = np.intersect1d(labels[np.asarray(train)], labels[np.asarray(test)])
    if shared.size:
        raise DataError(
            f"{shared.size} group(s) are on both sides, must be 0: {shared[:5].tolist()}; split "
            "with group_split or group_folds"
        )


def _labels(groups: ArrayLike) -> NDArray[Any]:
    labels = np.asarray(groups)
    if labels.ndim != 1:
        raise DataError(f"groups has {labels.ndim} dimensions, must be 1; give one per record")
    return labels


def _shuffled_groups(labels: NDArray[Any], fewest: int, seed: int) -> NDArray[Any]:
    unique = np.unique(labels)
    if unique.size < fewest:
        raise DataError(
            f"{unique.size} group(s), must be >= {fewest}; record or generate more machines"
        )
    return np.random.default_rng(seed).permutation(unique)


def _sides(labels: NDArray[Any], test_groups: NDArray[Any]) -> tuple[Index, Index]:
    inside = np.isin(labels, test_groups)
    return np.flatnonzero(~inside), np.flatnonzero(inside)
