"""Train and test splits that keep every machine on one side."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...sim.output.recording import DataError

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
        Share of the groups on the test side, 0 < share < 1; at least one group on each side.
    seed : int
        Seed of the choice.

    Returns
    -------
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Record numbers, rising.

    Raises
    ------
    DataError
        If the fraction is out of bounds, or there is only one group.

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
        Seed of the choice.

    Returns
    -------
    list of (train, test)
        Record numbers, rising; each record is in one test side. The numbers of groups in two test
        sides differ by at most one.

    Raises
    ------
    DataError
        If there are fewer groups than folds, or `n` is below two.

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
        Range held out: ``low <= value <= high`` [unit of `values`].
    groups : array_like [shape=(n_records,)], optional
        Machine of each record: other records of held-out machines are in neither side.

    Returns
    -------
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Record numbers, rising.

    Raises
    ------
    DataError
        If a value is not finite, the range is reversed, or a side is empty.

    Examples
    --------
    >>> train, test = condition_split([4.0, 5.0, 6.0], 5.5, 7.0)
    >>> train.tolist(), test.tolist()
    ([0, 1], [2])
    """
    return region_split({"value": values}, {"value": (low, high)}, groups=groups)


def region_split(
    columns: Mapping[str, ArrayLike],
    bounds: Mapping[str, tuple[float, float]],
    *,
    groups: ArrayLike | None = None,
) -> tuple[Index, Index]:
    """Hold out the records that lie in every one of several ranges.

    Parameters
    ----------
    columns : mapping of str to array_like [shape=(n_records,)]
        Conditions or severities of each record, finite if they are bounded.
    bounds : mapping of str to (float, float)
        Ranges of one or more of `columns`; records with ``low <= value <= high`` in all of them are
        held out [unit of the column]; a bound may be infinite.
    groups : array_like [shape=(n_records,)], optional
        Machine of each record: other records of held-out machines are in neither side.

    Returns
    -------
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Record numbers, rising.

    Raises
    ------
    DataError
        If a bounded value is not finite, a range is reversed, or a side is empty.

    Examples
    --------
    >>> both = {"speed_hz": [4.0, 6.0, 6.0], "load_n": [9.0, 1.0, 9.0]}
    >>> train, test = region_split(both, {"speed_hz": (5.0, 7.0), "load_n": (5.0, 10.0)})
    >>> train.tolist(), test.tolist()
    ([0, 1], [2])
    """
    values = {name: np.asarray(columns[name], dtype=float) for name in bounds}
    bad = sum(int(np.count_nonzero(~np.isfinite(column))) for column in values.values())
    if bad:
        raise DataError(f"{bad} condition value(s) are not finite, must be 0; leave them out")
    inside = [
        (values[name] >= low) & (values[name] <= high) for name, (low, high) in bounds.items()
    ]
    held = np.logical_and.reduce(inside)
    kept = ~held
    if groups is not None:
        labels = np.asarray(groups)
        kept &= ~np.isin(labels, labels[held])
    if not (held.any() and kept.any()):
        raise DataError(_empty_region(values, bounds, held, kept))
    return np.flatnonzero(kept), np.flatnonzero(held)


def _empty_region(
    values: Mapping[str, NDArray[np.float64]],
    bounds: Mapping[str, tuple[float, float]],
    held: NDArray[np.bool_],
    kept: NDArray[np.bool_],
) -> str:
    ranges = " and ".join(
        f"{low:g} to {high:g}" + (f" of {name}" if len(bounds) > 1 or name != "value" else "")
        for name, (low, high) in bounds.items()
    )
    found = "; ".join(
        (f"{name}" if name != "value" else "values")
        + f" run from {column.min(initial=np.inf):g} to {column.max(initial=-np.inf):g}"
        for name, column in values.items()
    )
    return (
        f"range {ranges} holds out {np.count_nonzero(held)} and keeps {np.count_nonzero(kept)} of "
        f"{held.size} records, must be >= 1 each; {found}"
    )


def time_split(
    hours: ArrayLike,
    groups: ArrayLike,
    *,
    early: float = 0.6,
    test_fraction: float | None = None,
    seed: int = 0,
) -> tuple[Index, Index]:
    """Train on the early part of lives and test on the late part, for runs to failure.

    A record is early up to `early` times the operating hours of its machine's last record.

    Parameters
    ----------
    hours : array_like [shape=(n_records,)]
        Operating hours of each record's machine, >= 0 and finite [any unit].
    groups : array_like [shape=(n_records,)]
        Machine of each record.
    early : float
        Share of each life that is early, 0 < share < 1.
    test_fraction : float, optional
        Share of the machines to test, as for :func:`group_split`: then only the late records of
        these are tested, and only the early records of the others are used for training. Without
        it, every machine is on both sides: early records train, late ones test.
    seed : int
        Seed of the choice of machines.

    Returns
    -------
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Record numbers, rising.

    Raises
    ------
    DataError
        If hours are negative or not finite, a share is out of bounds, or a side is empty.

    Examples
    --------
    >>> hours, groups = [0.0, 50.0, 100.0, 0.0, 10.0, 20.0], [0, 0, 0, 1, 1, 1]
    >>> [side.tolist() for side in time_split(hours, groups)]
    [[0, 1, 3, 4], [2, 5]]
    >>> [side.tolist() for side in time_split(hours, groups, test_fraction=0.5)]
    [[3, 4], [2]]
    """
    age, labels = np.asarray(hours, dtype=float), _labels(groups)
    if not 0 < early < 1:
        raise DataError(f"early = {early} must be > 0 and < 1; try 0.6")
    if not (np.isfinite(age) & (age >= 0)).all():
        bad = int(np.count_nonzero(~(np.isfinite(age) & (age >= 0))))
        raise DataError(
            f"{bad} operating hours are negative or not finite, must be 0; correct them"
        )
    _, machine = np.unique(labels, return_inverse=True)
    last = np.zeros(machine.max(initial=-1) + 1)
    np.maximum.at(last, machine, age)
    is_early = age <= early * last[machine]
    train, test = is_early, ~is_early
    if test_fraction is not None:
        mine, others = group_split(labels, test_fraction=test_fraction, seed=seed)
        train = train & np.isin(np.arange(age.size), mine)
        test = test & np.isin(np.arange(age.size), others)
    if not (train.any() and test.any()):
        raise DataError(
            f"early = {early} trains on {np.count_nonzero(train)} and tests on "
            f"{np.count_nonzero(test)} of {age.size} records, must be >= 1 each; change it"
        )
    return np.flatnonzero(train), np.flatnonzero(test)


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
        If a group is on both sides; the first few are named.

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
