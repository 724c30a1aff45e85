"""Duplicate rows, and machines on both sides of a split."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .columns import close_pairs
from .table import BY_CHANCE, FEW_DISTINCT, SHOWN, AuditTable, Finding, Float

Pairs = NDArray[np.intp]


def row_copies(table: AuditTable) -> Iterator[Finding]:
    """Rows that occur twice, exactly or nearly."""
    pairs = copied_rows(table.values)
    if len(pairs) == 0:
        return
    other = np.zeros(len(pairs), dtype=bool)
    if table.label is not None:
        other = table.label[pairs[:, 0]] != table.label[pairs[:, 1]]
    across = crossing(table.sides, pairs)
    named = "; ".join(f"{count} across split {name}" for name, count in across.items())
    yield Finding(
        code="copied-rows",
        severity="alarm" if across else "warning",
        where=table.source,
        numbers={
            "pairs": len(pairs),
            "across": across,
            "other_label": int(other.sum()),
            "rows": (pairs[:SHOWN] + 1).tolist(),
        },
        what=f"{len(pairs)} pair(s) of rows are equal to their last digits, first rows "
        f"{pairs[0][0] + 1} and {pairs[0][1] + 1}"
        + (f"; {named}" if named else "")
        + (f"; {int(other.sum())} with different labels" if other.any() else ""),
        means="a model is tested on what it was trained on"
        if across
        else "a random split would put one on either side",
        cure="keep one row of each, or give copies one group and split by it",
    )


def copied_rows(values: Float) -> Pairs:
    """Pairs of rows that agree in every measured column, beyond chance.

    Parameters
    ----------
    values : numpy.ndarray [shape=(n_rows, n_columns)]
        Columns; those with a gap or with few values are ignored.

    Returns
    -------
    numpy.ndarray [shape=(n_pairs, 2)]
        Row numbers; for n equal rows, the first with each other one.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal((9, 3))
    >>> x[7] = x[2]
    >>> copied_rows(x).tolist()
    [[2, 7]]
    """
    finite = values[:, np.isfinite(values).all(axis=0)]
    first, repeats = _first_of_equal(finite)
    fewest = max(1.0, FEW_DISTINCT * first.size)
    kept = np.array([np.unique(c).size > fewest for c in finite[first].T], bool)
    if not kept.any():
        return repeats
    measured = finite[first][:, kept]
    measured = measured / np.abs(measured).max(axis=0)  # squares of the largest would be infinite
    scaled = (measured - measured.mean(axis=0)) / measured.std(axis=0)
    rank = _rank(scaled)
    # n rows in q independent columns agree to t deviations by chance n^2 t^q / 2 times
    reach = min(1e-4, float((BY_CHANCE**2 / first.size**2) ** (1 / rank)))
    near = first[close_pairs(scaled, np.full(len(scaled), reach / 2))]
    return np.concatenate([repeats, near])


def _first_of_equal(values: Float) -> tuple[NDArray[np.intp], Pairs]:
    """First of each set of equal rows, paired with every other one of the set."""
    if values.shape[1] == 0:
        return np.arange(len(values)), np.empty((0, 2), dtype=np.intp)
    _, first, inverse = np.unique(values, axis=0, return_index=True, return_inverse=True)
    origin = first[inverse.ravel()]
    later = np.flatnonzero(origin != np.arange(len(values)))
    measured = [c for c in values.T if np.unique(c).size > FEW_DISTINCT * first.size]
    if not measured:  # counts alone: equal rows are no copies
        later = later[:0]
    return np.sort(first), np.c_[origin[later], later]


def _rank(scaled: Float) -> int:
    """Approximate number of independent columns, from at most 64 of them."""
    probe = scaled[:, :: max(1, scaled.shape[1] // 64)]
    try:
        weights = np.linalg.svd(probe, compute_uv=False) ** 2
    except np.linalg.LinAlgError:  # LAPACK's iteration may fail; the symmetric one does not
        weights = np.clip(np.linalg.eigvalsh(probe.T @ probe), 0.0, None)
    return max(1, int(weights.sum() ** 2 / (weights**2).sum()))


def crossing(sides: Mapping[str, NDArray[np.int8]], pairs: Pairs) -> dict[str, int]:
    """Number of pairs of rows on different sides, by split; splits without any are left out.

    Parameters
    ----------
    sides : mapping of str to numpy.ndarray [shape=(n_rows,)]
        0 train, 1 test, -1 neither.
    pairs : numpy.ndarray [shape=(n_pairs, 2)]
        Row numbers.
    """
    found = {}
    for name, side in sides.items():
        left, right = side[pairs[:, 0]], side[pairs[:, 1]]
        count = int(np.count_nonzero((left >= 0) & (right >= 0) & (left != right)))
        if count:
            found[name] = count
    return found


def shared_machines(table: AuditTable) -> Iterator[Finding]:
    """Machines that are on both sides of a split."""
    if table.groups is None:
        return
    for name, side in table.sides.items():
        both = np.intersect1d(table.groups[side == 0], table.groups[side == 1])
        if not both.size:
            continue
        meant = name in table.shared
        yield Finding(
            code="shared-machines",
            severity="note" if meant else "alarm",
            where=table.source,
            numbers={"split": name, "machines": int(both.size), "first": both[:SHOWN].tolist()},
            what=f"{both.size} machine(s) are on both sides of split {name}"
            + (", by design" if meant else ""),
            means="figures hold for machines that were trained on, not for new ones"
            if meant
            else "machines in the test were seen in training: the figures are too good",
            cure="state it with every figure" if meant else "split by machine",
        )


def cross_copies(tables: Sequence[AuditTable]) -> Iterator[tuple[int, int, Pairs]]:
    """Rows that two tables with common columns share.

    Parameters
    ----------
    tables : sequence of AuditTable
        Tables to compare.

    Yields
    ------
    first, second : int
        Indices of the tables.
    pairs : numpy.ndarray [shape=(n_pairs, 2)]
        Row in the first and row in the second.
    """
    for i, j in combinations(range(len(tables)), 2):
        one, two = tables[i], tables[j]
        common = [name for name in one.names if name in two.names]
        if not common:
            continue
        stacked = [t.values[:, [t.names.index(name) for name in common]] for t in (one, two)]
        pairs = copied_rows(np.concatenate(stacked))
        n = len(one.values)
        across = pairs[(pairs[:, 0] < n) & (pairs[:, 1] >= n)]
        if len(across):
            yield i, j, across - np.array([0, n])
