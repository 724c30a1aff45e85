"""Columns and pairs of columns that were made with the label: constant or scaled by class."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .table import BY_CHANCE, FEWEST, SHOWN, AuditTable, Finding, Float, has, named

Bool = NDArray[np.bool_]
Pairs = NDArray[np.intp]

EXACT = 1e-6
"""Variation within a class, relative to size, below which a column counts as constant [-]."""

_ONE_EXTREME = "largest magnitude"
_UNLESS_BOUND = "unless that value is a floor or ceiling of the column, "
_MOSTLY = 0.9  # of the rows have a distinct value in a measured column
_COARSEST = 4  # significant digits: a column with fewer is not checked for cancelling
_CANCELLED = 1 / 30  # of the variation of either column: the largest remainder of a constant pair
_PROBES = 4  # random projections in which a pair must agree before it is fully compared


@dataclass(frozen=True)
class _Labelled:
    """Finite columns of the rows whose class has enough rows."""

    names: tuple[str, ...]
    values: Float
    classes: tuple[str, ...]
    rows: tuple[NDArray[np.intp], ...]  # of each class
    rounding: Float  # relative, of each column

    @property
    def tolerance(self) -> Float:
        """Relative tolerance of each column."""
        return np.maximum(EXACT, 2 * self.rounding)

    def spread(self, values: Float) -> Float:
        """Range within each class [shape=(n_classes, n_columns)]."""
        return np.array([np.ptp(values[rows], axis=0) for rows in self.rows])

    def means(self, values: Float) -> Float:
        """Mean of each class [shape=(n_classes, n_columns)]."""
        return np.array([values[rows].mean(axis=0) for rows in self.rows])


def _labelled(table: AuditTable) -> _Labelled | None:
    """Labelled columns; None if fewer than two classes have enough rows."""
    if table.label is None:
        return None
    counts = np.bincount(table.label, minlength=len(table.classes))
    kept = np.flatnonzero(counts >= FEWEST)
    finite = np.isfinite(table.values).all(axis=0)
    if kept.size < 2 or not finite.any():
        return None
    chosen = np.isin(table.label, kept)
    values, label = table.values[chosen][:, finite], table.label[chosen]
    return _Labelled(
        names=tuple(np.array(table.names)[finite].tolist()),
        values=values,
        classes=tuple(table.classes[k] for k in kept),
        rows=tuple(np.flatnonzero(label == k) for k in kept),
        rounding=resolution(values),
    )


def resolution(values: Float) -> Float:
    """Relative rounding of each column, as from text with few digits; 0 if none is visible.

    Parameters
    ----------
    values : numpy.ndarray [shape=(n_rows, n_columns)]
        Columns, finite.

    Returns
    -------
    numpy.ndarray [shape=(n_columns,)]

    Examples
    --------
    >>> resolution(np.array([[1.2345, 3.0], [2.3456, 4.0], [1 / 3, 5.0]])[:2])
    array([0.0001, 0.    ])
    """
    probe = values[:: max(1, len(values) // 200)]
    whole = (probe == np.rint(probe)).all(axis=0)  # counts are exact
    size = np.abs(np.where(probe == 0, 1.0, probe))
    power = np.floor(np.log10(size))
    found = np.zeros(values.shape[1])
    for digits in range(8, _COARSEST - 1, -1):
        scaled = size * 10.0 ** (digits - 1 - power)
        rounded = (np.abs(scaled - np.rint(scaled)) < 1e-6).all(axis=0)
        found[rounded & ~whole] = 10.0 ** (1 - digits)
    return found


def constant_columns(table: AuditTable) -> Iterator[Finding]:
    """Columns with one value per class, or with a value in some class that others do not have."""
    data = _labelled(table)
    if data is None:
        return
    size = np.abs(data.values).max(axis=0, initial=0.0)
    still = data.spread(data.values) <= data.tolerance * size
    differs = np.ptp(data.values, axis=0) > 10 * data.tolerance * size
    leaks: list[int] = np.flatnonzero(still.all(axis=0) & differs).tolist()
    if leaks:
        yield _leak(table, data, "constant-column", [(i,) for i in leaks], data.values, "{}")
    some: list[int] = np.flatnonzero(still.any(axis=0) & ~still.all(axis=0) & differs).tolist()
    own = [i for i in some if _is_own_value(data, i, still[:, i], data.tolerance[i] * size[i])]
    if own:
        names = [data.names[i] for i in own]
        yield Finding(
            code="constant-in-a-class",
            severity="warning",
            where=table.source,
            columns=tuple(names[:SHOWN]),
            numbers={"columns": len(own)},
            what=f"{named(names)} {has(own)} one fixed value in at least one class of "
            f"{table.label_name}, which other classes do not have",
            means="the class can be read from the value; this may be physics (a count of zero) "
            "or a trace of how the class was recorded",
            cure="check the origin of the value; leave the column out unless physics explains it",
        )


def _is_own_value(data: _Labelled, column: int, still: Bool, tolerance: float) -> bool:
    """Whether the only value of a class is almost absent from the others."""
    for number in np.flatnonzero(still):
        rows = data.rows[number]
        others = np.concatenate([r for k, r in enumerate(data.rows) if k != number])
        near = np.abs(data.values[others, column] - data.values[rows[0], column]) <= tolerance
        if rows.size >= 10 and near.mean() <= 0.01:  # ten equal rows are no coincidence
            return True
    return False


def cancelling_pairs(table: AuditTable) -> Iterator[Finding]:
    """Products, ratios, sums and differences of two columns that are constant in every class."""
    data = _labelled(table)
    if data is None:
        return
    size = np.abs(data.values).max(axis=0, initial=0.0)
    positive = (data.values != 0).all(axis=0)
    logarithm = np.log(np.abs(np.where(positive, data.values, 1.0)))
    for sign, code, form in ((-1, "constant-product", "{} × {}"), (1, "constant-ratio", "{} / {}")):
        pairs = _cancelling(data, logarithm, data.tolerance, positive, sign)
        if pairs:
            value = np.exp(logarithm)
            yield _leak(table, data, code, pairs, value, form)
    for sign, code, form in (
        (-1, "constant-sum", "{} + {}"),
        (1, "constant-difference", "{} - {}"),
    ):
        scale = data.tolerance * size
        pairs = _cancelling(data, data.values, scale, np.ones(size.size, bool), sign)
        if pairs:
            yield _leak(table, data, code, pairs, data.values, form)


def _cancelling(
    data: _Labelled, values: Float, tolerance: Float, allowed: Bool, sign: int
) -> list[tuple[int, int]]:
    """Pairs whose class means differ while the variation within the classes cancels."""
    means = data.means(values)
    left = np.empty_like(values)
    for mean, rows in zip(means, data.rows, strict=True):
        left[rows] = values[rows] - mean
    own = np.abs(left).max(axis=0, initial=0.0)
    varied = np.flatnonzero(allowed & (own > 10 * tolerance))
    found = []
    for a, b in close_pairs(left[:, varied].T, tolerance[varied], sign=sign):
        i, j = int(varied[a]), int(varied[b])
        rest = np.abs(left[:, i] - sign * left[:, j]).max()
        step = np.ptp(means[:, i] - sign * means[:, j])
        bound = tolerance[i] + tolerance[j]
        if rest <= _CANCELLED * own[i] and step > 10 * bound:
            found.append((i, j))
    return found


def close_pairs(vectors: Float, tolerance: Float, *, sign: int = 1) -> Pairs:
    """Pairs of vectors that are equal, or opposite, to a tolerance in every element.

    Sorting by random projections finds them without comparing all pairs: the time grows about in
    proportion to the number of vectors if few are close.

    Parameters
    ----------
    vectors : numpy.ndarray [shape=(n_vectors, n_elements)]
    tolerance : numpy.ndarray [shape=(n_vectors,)]
        Tolerance of each vector's elements [unit of `vectors`]; those of a pair add up.
    sign : {1, -1}
        1 for equal, -1 for opposite.

    Returns
    -------
    numpy.ndarray [shape=(n_pairs, 2)]
        Indices of the vectors, the lower first.

    Notes
    -----
    An error of `tolerance` in every element moves a projection on average by `tolerance` times the
    root of the number of elements; six times that is allowed.

    Examples
    --------
    >>> x = np.array([[1.0, 2.0], [5.0, 1.0], [-1.0, -2.0]])
    >>> close_pairs(x, np.full(3, 1e-9), sign=-1).tolist()
    [[0, 2]]
    """
    if len(vectors) < 2:
        return np.empty((0, 2), dtype=np.intp)
    rng = np.random.default_rng(0)
    probes = vectors @ rng.standard_normal((vectors.shape[1], _PROBES))
    reach = 6 * np.sqrt(vectors.shape[1]) * tolerance
    found = []
    for first, second in _neighbours(probes[:, 0], reach, sign):
        apart = np.abs(probes[first] - sign * probes[second]).max(axis=1)
        near = apart <= reach[first] + reach[second]
        for i, j in zip(first[near], second[near], strict=True):
            bound = tolerance[i] + tolerance[j]
            if np.abs(vectors[i] - sign * vectors[j]).max() <= bound:
                found.append((min(i, j), max(i, j)))
    return np.array(sorted(set(found)), dtype=np.intp).reshape(-1, 2)


def _neighbours(
    values: Float, reach: Float, sign: int
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Pairs of numbers that are equal, or opposite, within reach, by distance in the list."""
    n = values.size
    # with both signs of each number in the list, opposite ones are adjacent
    listed = values if sign == 1 else np.concatenate([values, -values])
    order = np.argsort(listed)
    far = 2 * reach.max()
    for step in range(1, listed.size):
        first, second = order[:-step], order[step:]
        gap = listed[second] - listed[first]
        if not (gap <= far).any():
            return
        near = gap <= reach[first % n] + reach[second % n]
        if sign == -1:
            near &= (first < n) != (second < n)
        near &= first % n != second % n
        yield first[near] % n, second[near] % n


def _leak(
    table: AuditTable,
    data: _Labelled,
    code: str,
    groups: Sequence[Sequence[int]],
    values: Float,
    form: str,
) -> Finding:
    """Finding about columns, or pairs, that have one value per class."""
    shown = []
    for members in groups[:SHOWN]:
        name = form.format(*(data.names[i] for i in members))
        combined = _combine(code, [values[:, i] for i in members])
        shown.append({"name": name, "values": _by_class(data, combined)})
    kind = code.removeprefix("constant-")
    many = "every one of them" if len(groups) > 1 else "it"
    return Finding(
        code=code,
        severity="alarm",
        where=table.source,
        columns=tuple(dict.fromkeys(data.names[i] for members in groups for i in members)),
        numbers={"found": len(groups), "examples": shown},
        what=f"{len(groups)} {kind}{'s' * (len(groups) > 1)}"
        + (" of two columns" if len(groups[0]) > 1 else "")
        + f": constant within each class of {table.label_name}, different between them",
        means=f"{many} gives the class without any physics: something was computed over a whole "
        "class, so that the label was used to make the columns",
        cure="leave these columns out, or compute them for each recording separately",
    )


def _combine(code: str, columns: Sequence[Float]) -> Float:
    if len(columns) == 1:
        return columns[0]
    a, b = columns
    return {
        "constant-product": lambda: a * b,
        "constant-ratio": lambda: a / b,
        "constant-sum": lambda: a + b,
        "constant-difference": lambda: a - b,
    }[code]()


def _by_class(data: _Labelled, column: Float) -> dict[str, float]:
    pairs = zip(data.classes, data.rows, strict=True)
    return {name: float(column[rows].mean()) for name, rows in pairs}


# --- normalised class by class


def class_scaled(table: AuditTable) -> Iterator[Finding]:
    """Columns whose mean and deviation, extremes, rms or peak are the same in every class."""
    data = _labelled(table)
    if data is None:
        return
    found: dict[str, list[str]] = {}
    for i in np.flatnonzero(_is_measured(data)).tolist():
        how = _scaling(data, i)
        if how:
            found.setdefault(how, []).append(data.names[i])
    for how, names in found.items():
        yield Finding(
            code="class-normalised",
            # a floor may be reached once in each of a few classes
            severity="warning" if how == _ONE_EXTREME else "alarm",
            where=table.source,
            columns=tuple(names[:SHOWN]),
            numbers={"columns": len(names), "same": how},
            what=f"{named(names)} {has(names)} the same {how} in every class of {table.label_name}",
            means=_UNLESS_BOUND
            * (how == _ONE_EXTREME)
            + "each class was scaled by itself: the scaling used the label, and a recording whose "
            "class is not known cannot be scaled so",
            cure="scale all rows alike, with numbers from the training rows only",
        )


def _is_measured(data: _Labelled) -> Bool:
    """Columns with a distinct value in almost every row.

    A value that belongs to a machine recurs in each class of that machine.
    """
    distinct = np.array([np.unique(column).size for column in data.values.T])
    return distinct > _MOSTLY * len(data.values)


def _scaling(data: _Labelled, column: int) -> str:
    """Statistics that are the same in every class beyond chance; empty if there are none."""
    parts = [data.values[rows, column] for rows in data.rows]
    spread = float(np.sqrt(np.mean([part.var() for part in parts])))
    if spread == 0:
        return ""
    size = float(np.abs(data.values[:, column]).max())
    coarse = float(data.rounding[column]) * size / spread
    rows = min(part.size for part in parts)
    for name, measures in _MEASURES:
        # statistics of n rows agree to a share d of their deviation with probability <= d sqrt(n)
        chance = float((BY_CHANCE / len(data.names)) ** (1 / len(measures)) / np.sqrt(rows))
        if coarse > chance and name.endswith(("value", "magnitude")):
            continue  # with rounding, two extremes may be equal by chance
        bound = min(max(EXACT, coarse), chance)
        numbers = np.array([[measure(part) for measure in measures] for part in parts])
        if (np.ptp(numbers, axis=0) <= bound * spread).all() and _alone(parts, name, bound, spread):
            return name
    return ""


def _alone(parts: Sequence[Float], name: str, bound: float, spread: float) -> bool:
    """False if the extremes are a bound that many values approach, as in a saturation."""
    if not name.endswith(("value", "magnitude")):
        return True
    gaps = []
    for part in parts:
        rising = np.sort(np.abs(part) if name.endswith("magnitude") else part)
        gaps.append(rising[-1] - rising[-2])
        if name.endswith("value"):
            gaps.append(rising[1] - rising[0])
    return bool(min(gaps) > 10 * bound * spread)


def _deviation(part: Float) -> float:
    return float(np.std(part))


def _sample_deviation(part: Float) -> float:
    return float(np.std(part, ddof=1))


def _rms(part: Float) -> float:
    return float(np.sqrt(np.mean(part**2)))


def _peak(part: Float) -> float:
    return float(np.abs(part).max())


def _mean(part: Float) -> float:
    return float(np.mean(part))


def _least(part: Float) -> float:
    return float(np.min(part))


def _most(part: Float) -> float:
    return float(np.max(part))


_MEASURES: tuple[tuple[str, tuple[Callable[[Float], float], ...]], ...] = (
    ("mean and standard deviation", (_mean, _deviation)),
    ("mean and standard deviation", (_mean, _sample_deviation)),
    ("smallest and largest value", (_least, _most)),
    ("rms", (_rms,)),
    (_ONE_EXTREME, (_peak,)),
)
"""Statistics that a scaling equalises in every class, and the functions that compute them."""
