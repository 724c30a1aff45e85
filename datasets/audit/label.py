"""Labels that can be read without physics: from one column, the order, a name, a condition."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .table import BY_CHANCE, FEWEST, SHOWN, AuditTable, Finding, Float, named

Bool = NDArray[np.bool_]

READABLE = 0.95
"""Share of the rows beyond the commonest class that a column must get right to be reported."""

_BLOCK = 64  # columns sorted at a time: 50 MB for 100,000 rows
_PERIODS = 64  # longest cycle of labels in the row order that is searched


def readable(table: AuditTable) -> Iterator[Finding]:
    """Single columns, the row order or words in names that predict the label."""
    if table.label is None or len(np.unique(table.label)) < 2:
        return
    columns = _skilled_columns(table)
    if columns:
        best = max(columns.values())
        yield Finding(
            code="readable-column",
            severity="warning",
            where=table.source,
            columns=tuple(list(columns)[:SHOWN]),
            numbers={"columns": len(columns), "accuracy": dict(list(columns.items())[:SHOWN])},
            what=f"{named(list(columns))} alone "
            f"{'gives away' if len(columns) == 1 else 'give away'} {table.label_name} "
            f"in up to {best:.1%} of the rows"
            + (" of other machines" if table.groups is not None else ""),
            means="either physics is that plain, and the data say nothing about a hard case, or "
            "the column holds the label in another form",
            cure="explain each by physics or leave it out; judge models on a harder set as well",
        )
    yield from _readable_order(table)
    yield from _readable_text(table)


def _skilled_columns(table: AuditTable) -> dict[str, float]:
    """Accuracy of each column that predicts the label, the best first."""
    assert table.label is not None
    values, names = table.values, list(table.names)
    gaps = ~np.isfinite(values)
    partly = np.logical_and(gaps.any(axis=0), ~gaps.all(axis=0))
    filled = np.where(gaps, np.inf, values)
    everything = np.concatenate([filled, gaps[:, partly].astype(float)], axis=1)
    names += [f"missing {name}" for name, gap in zip(table.names, partly, strict=True) if gap]
    accuracy = neighbour_accuracy(everything, table.label, table.groups)
    good = np.flatnonzero(_skill(accuracy, table.label) >= READABLE)
    good = good[np.argsort(-accuracy[good], kind="stable")]
    return {names[i]: float(accuracy[i]) for i in good}


def _skill(accuracy: Any, label: NDArray[np.intp]) -> Any:
    """0 for always naming the commonest class, 1 for no error."""
    base = np.bincount(label).max() / label.size
    return (accuracy - base) / (1 - base)


def neighbour_accuracy(
    values: Float, label: NDArray[np.intp], groups: NDArray[Any] | None = None
) -> Float:
    """Share of rows whose label equals that of the row with the nearest value in one column.

    Parameters
    ----------
    values : numpy.ndarray [shape=(n_rows, n_columns)]
    label : numpy.ndarray [shape=(n_rows,)]
        Class of each row.
    groups : numpy.ndarray [shape=(n_rows,)], optional
        Machine of each row: if given, the nearest row of another machine counts.

    Returns
    -------
    numpy.ndarray [shape=(n_columns,)]
        Share of the rows, for each column.

    Examples
    --------
    >>> neighbour_accuracy(np.array([[1.0], [2.0], [8.0], [9.0]]), np.array([0, 0, 1, 1]))
    array([1.])
    """
    # rows of equal value must not keep the order of the file, which may be that of the classes
    mixed = np.random.default_rng(0).permutation(len(label))
    label = label[mixed]
    machine = np.arange(len(label)) if groups is None else np.unique(groups, return_inverse=True)[1]
    machine = machine[mixed] if groups is not None else machine
    furthest = 1 if groups is None else min(int(np.bincount(machine).max()), len(label) - 1)
    found = np.zeros(values.shape[1])
    for start in range(0, values.shape[1], _BLOCK):
        block = values[mixed, start : start + _BLOCK]
        order = np.argsort(block, axis=0, kind="stable")
        ranked = np.take_along_axis(block, order, axis=0)
        hits = [
            _nearest_label(ranked[:, i], label[order[:, i]], machine[order[:, i]], furthest)
            for i in range(block.shape[1])
        ]
        found[start : start + _BLOCK] = [np.mean(hit) for hit in hits]
    return found


def _nearest_label(
    ranked: Float, label: NDArray[np.intp], machine: NDArray[np.intp], furthest: int
) -> Bool:
    """Whether the nearest row of another machine has the row's label, for rows in rising order."""
    n = ranked.size
    best = np.full(n, np.inf)
    hit = np.zeros(n, dtype=bool)
    with np.errstate(invalid="ignore"):  # infinity stands for a missing value
        for step in range(1, furthest + 1):
            gap = np.nan_to_num(ranked[step:] - ranked[:-step], nan=0.0, posinf=np.inf)
            apart = machine[step:] != machine[:-step]
            same = label[step:] == label[:-step]
            for here in (slice(step, None), slice(None, -step)):
                nearer = apart & ((gap < best[here]) | (np.isinf(best[here]) & np.isinf(gap)))
                hit[here] = np.where(nearer, same, hit[here])
                best[here] = np.where(nearer, gap, best[here])
    return hit


def _readable_order(table: AuditTable) -> Iterator[Finding]:
    assert table.label is not None
    place = np.arange(table.label.size, dtype=float)[:, None]
    accuracy = float(neighbour_accuracy(place, table.label, table.groups)[0])
    how = "stand in blocks"
    if _skill(accuracy, table.label) < READABLE:
        accuracy, period = max(_cycles(table.label), key=lambda c: c[0], default=(0.0, 0))
        how = f"repeat every {period} rows"
    if _skill(accuracy, table.label) >= READABLE:
        yield Finding(
            code="readable-order",
            severity="warning",
            where=table.source,
            numbers={"accuracy": accuracy},
            what=f"the classes of {table.label_name} {how}: the position of a row gives away its "
            f"class in {accuracy:.1%} of the rows",
            means="anything that drifts along the file (time, temperature, a row number kept as a "
            "column) looks like the label, and a split that is not shuffled holds one class",
            cure="keep no row number as a column; record the classes in mixed order next time",
        )


def _cycles(label: NDArray[np.intp]) -> Iterator[tuple[float, int]]:
    """Accuracy of naming the commonest class of each position in a cycle, for every length."""
    for period in range(2, min(_PERIODS, label.size // 20) + 1):
        table = np.zeros((period, label.max() + 1))
        np.add.at(table, (np.arange(label.size) % period, label), 1)
        yield float(table.max(axis=1).sum() / label.size), period


def _readable_text(table: AuditTable) -> Iterator[Finding]:
    """Words of file names and identifiers that predict the class."""
    assert table.label is not None
    for name, texts in table.texts.items():
        words = [re.findall(r"[0-9]+|[^\W\d_]+", text) for text in texts.tolist()]
        for place in range(min(max(map(len, words)), 20)):
            tokens = np.array([row[place] if place < len(row) else "" for row in words])
            accuracy = _word_accuracy(tokens, table.label, table.groups)
            if _skill(accuracy, table.label) >= READABLE:
                yield Finding(
                    code="readable-name",
                    severity="warning",
                    where=table.source,
                    columns=(name,),
                    numbers={"accuracy": accuracy, "place": place + 1},
                    what=f"word {place + 1} of {name} gives away {table.label_name} in "
                    f"{accuracy:.1%} "
                    "of the rows",
                    means="harmless as long as no model sees the name",
                    cure="keep the column out of the inputs",
                )
                break


def _word_accuracy(
    tokens: NDArray[np.str_], label: NDArray[np.intp], groups: NDArray[Any] | None
) -> float:
    """Accuracy of naming the class that a word has in the rows of other machines."""
    unique, word = np.unique(tokens, return_inverse=True)
    if unique.size < 2 or unique.size > label.size / 5:
        return 0.0
    machine = np.arange(label.size) if groups is None else np.unique(groups, return_inverse=True)[1]
    count = np.zeros((unique.size, label.max() + 1))
    np.add.at(count, (word, label), 1)
    pair, own_row = np.unique(np.c_[word, machine], axis=0, return_inverse=True)
    own = np.zeros((len(pair), label.max() + 1))
    np.add.at(own, (own_row.ravel(), label), 1)
    others = count[word] - own[own_row.ravel()]
    hit = (others.argmax(axis=1) == label) & (others.max(axis=1) > 0)
    return float(hit.mean())


# --- conditions that follow the label


def confounded(table: AuditTable) -> Iterator[Finding]:
    """Nuisance columns whose rank correlation with the label is beyond chance."""
    if table.label is None or len(np.unique(table.label)) < 2:
        return
    found: dict[str, tuple[float, float]] = {}
    varied = {n: v for n, v in table.nuisance.items() if np.isfinite(v).all() and np.ptp(v) > 0}
    for name, values in varied.items():
        strength, chance = _association(table, values)
        if chance * len(varied) < BY_CHANCE:
            found[name] = (strength, chance)
    if found:
        worst = max(found, key=lambda name: found[name][0])
        yield Finding(
            code="confounded",
            severity="warning",
            where=table.source,
            columns=tuple(found),
            numbers={
                name: {"rank_correlation": strength, "by_chance": chance}
                for name, (strength, chance) in found.items()
            },
            what=f"{', '.join(found)} {'follows' if len(found) == 1 else 'follow'} "
            f"{table.label_name} beyond chance (rank correlation up to {found[worst][0]:.2f}, "
            f"{worst})",
            means="a model can learn the condition instead of the wear, and fail if the two are no "
            "longer related",
            cure="draw or record the conditions independently of the wear; or judge within narrow "
            "ranges of them",
        )


def _association(table: AuditTable, values: Float) -> tuple[float, float]:
    """Size of the rank correlation with the label, and its probability by chance."""
    from scipy import stats

    assert table.label is not None
    label = table.label.astype(float) if table.graded is None else table.graded
    if table.groups is not None and _one_per_machine(table.groups, values, label):
        # records of one machine are not independent
        _, machine = np.unique(table.groups, return_inverse=True)
        count = np.bincount(machine)
        values = np.bincount(machine, values) / count
        label = np.bincount(machine, label) / count
    if values.size < 5 or np.ptp(values) == 0 or np.ptp(label) == 0:
        return 0.0, 1.0
    if table.graded is not None or np.unique(label).size > len(table.classes):
        result = stats.spearmanr(values, label)
        return abs(float(result.statistic)), float(result.pvalue)
    parts = [values[label == k] for k in np.unique(label)]
    result = stats.kruskal(*parts)
    # the share of the ranks' variance between classes is the square of a correlation
    return float(np.sqrt(result.statistic / (values.size - 1))), float(result.pvalue)


def _one_per_machine(groups: NDArray[Any], values: Float, label: Float) -> bool:
    """Whether condition or label is the same in all records of a machine."""
    _, machine = np.unique(groups, return_inverse=True)
    first = np.unique(machine, return_index=True)[1]
    return any(np.array_equal(v[first][machine], v) for v in (values, label))


def lone_machines(table: AuditTable) -> Iterator[Finding]:
    """Classes represented by one or two machines, if each machine has one class only."""
    if table.label is None or table.groups is None:
        return
    pairs = np.unique(np.c_[np.unique(table.groups, return_inverse=True)[1], table.label], axis=0)
    if len(pairs) > np.unique(table.groups).size:
        return  # machines change class, so that both effects can be separated
    machines = np.bincount(pairs[:, 1], minlength=len(table.classes))
    few = [k for k in range(len(table.classes)) if 0 < machines[k] < FEWEST]
    if few:
        names = ", ".join(f"{table.classes[k]} ({machines[k]})" for k in few)
        yield Finding(
            code="lone-machines",
            severity="warning",
            where=table.source,
            numbers={"machines": {table.classes[k]: int(machines[k]) for k in few}},
            what=f"classes of {table.label_name} with fewer than {FEWEST} machines: {names}; no "
            "machine has two classes",
            means="effects of the machine cannot be separated from those of the class",
            cure=f"record >= {FEWEST} machines of every class, or the same machines in several",
        )
