"""Fitness of a data set for training and testing: leaks, copies, splits that share machines."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...sim.output.recording import DataError
from ..file.machines import machine_origin
from ..file.record import DataSet
from .columns import cancelling_pairs, class_scaled, constant_columns
from .label import confounded, lone_machines, readable
from .records import Copy, Sketches, copies, pairs_in, sketch
from .rows import cross_copies, crossing, row_copies, shared_machines
from .table import (
    LARGEST,
    NO_ROLES,
    SHOWN,
    SMALLEST,
    AuditTable,
    Finding,
    Roles,
    Severity,
    is_data_set,
    manifest_table,
    read_table,
)

Verdict = Literal["alarm", "warning", "clean"]

CHECKS: dict[str, Callable[[AuditTable], Iterator[Finding]]] = {
    "columns constant within a class": constant_columns,
    "products, ratios, sums and differences constant within a class": cancelling_pairs,
    "columns scaled class by class": class_scaled,
    "label read from one column, the order or a name": readable,
    "conditions that follow the label": confounded,
    "classes of one machine": lone_machines,
    "copied rows": row_copies,
    "machines on both sides of a split": shared_machines,
}
"""Checks of every table, by their description. A new one is one row."""

UNSEEN = (
    "whether training and test rows were scaled with common numbers: afterwards it does not show",
    "copies that were filtered, resampled, or have noise above -25 dB added to them",
    "windows of one recording that share no sample: only their machine (group) shows it",
    "relations of three or more columns, powers, and models that combine weak columns",
    "labels that are wrong",
)
"""Faults that no check can find."""

_ORDER: dict[Severity, int] = {"alarm": 0, "warning": 1, "note": 2}


@dataclass(frozen=True, kw_only=True)
class AuditSource:
    """One file of an audit.

    Attributes
    ----------
    path : Path
        The file.
    kind : {"data set", "table"}
        With signals, or columns alone.
    side : {"train", "test", ""}
        Intended use; empty if not given.
    rows, columns : int
        Rows or usable records; columns that were checked.
    label : str
        Name of the label; empty if none is known.
    classes : dict of str to int
        Number of rows by class.
    machines : int or None
        Number of machines; None if unknown.
    splits : tuple of str
        Splits that were checked.
    """

    path: Path
    kind: Literal["data set", "table"]
    side: str
    rows: int
    columns: int
    label: str
    classes: dict[str, int]
    machines: int | None
    splits: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Audit:
    """Result of an audit.

    Attributes
    ----------
    sources : tuple of AuditSource
        Files that were audited.
    findings : tuple of Finding
        Findings, the worst first.
    checked : tuple of str
        Descriptions of the checks made.
    unchecked : tuple of str
        Checks that were impossible, and what they need.
    """

    sources: tuple[AuditSource, ...]
    findings: tuple[Finding, ...]
    checked: tuple[str, ...]
    unchecked: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """The worst severity; notes do not count."""
        found = {finding.severity for finding in self.findings}
        return "alarm" if "alarm" in found else "warning" if "warning" in found else "clean"


@dataclass
class _LoadedFile:
    """All data read from one file."""

    path: Path
    side: str
    table: AuditTable
    data: DataSet | None = None
    kept: Sketches | None = None
    findings: list[Finding] = field(default_factory=list)


def audit(
    paths: Sequence[str | Path] = (),
    roles: Roles = NO_ROLES,
    *,
    train: Sequence[str | Path] = (),
    test: Sequence[str | Path] = (),
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Audit:
    """Audit data sets and plain tables, each separately and against the others.

    Parameters
    ----------
    paths : sequence of str or Path
        Data sets (.h5) and tables (.csv, .tsv, .txt, .parquet, .h5 of columns).
    roles : Roles
        Roles of columns (label, machine, split, nuisance), the same in every file.
    train, test : sequence of str or Path
        Further files, which are the two sides of one experiment.
    jobs : int
        Worker processes that read signals; the result does not depend on it.
    progress : callable, optional
        Called with (records done, records) for each data set.

    Returns
    -------
    Audit
        Audit with its findings, the worst first.

    Raises
    ------
    DataError
        If a file cannot be read or is given twice, or a role is missing.

    Examples
    --------
    >>> import tempfile
    >>> size, state = np.tile(np.arange(1.0, 9.0), 2), np.repeat([1.0, 2.0], 8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path, rows = Path(folder) / "t.csv", np.c_[size, state / size, state]
    ...     np.savetxt(path, rows, delimiter=",", header="mean,impulse,state", comments="")
    ...     audit([path], Roles(label="state")).verdict
    'alarm'
    """
    given = [
        *((p, "") for p in paths),
        *((p, "train") for p in train),
        *((p, "test") for p in test),
    ]
    _refuse_twice([Path(path) for path, _ in given])
    with ExitStack() as stack:
        loaded = [
            _loaded(Path(path), side, roles, stack, jobs=jobs, progress=progress)
            for path, side in given
        ]
        for item in loaded:
            item.findings += table_findings(item.table)
        records = _record_findings(loaded)
        between = [*_between_tables(loaded), *_between_draws(loaded)]
    found = [*(f for item in loaded for f in item.findings), *records, *between]
    return Audit(
        sources=tuple(_source(item) for item in loaded),
        findings=tuple(sorted(found, key=lambda finding: _ORDER[finding.severity])),
        checked=tuple(_checked(loaded)),
        unchecked=tuple(text for item in loaded for text in _unchecked(item, len(loaded))),
    )


def table_findings(table: AuditTable) -> list[Finding]:
    """All findings about one table.

    Parameters
    ----------
    table : Table
        Table with or without label, machines and splits; checks that need a missing one are left
        out.

    Returns
    -------
    list of Finding
        Findings in the order of `CHECKS`.

    Examples
    --------
    >>> label = np.repeat([0, 1], 20)
    >>> size = np.random.default_rng(0).uniform(1.0, 2.0, 40)
    >>> table = AuditTable(source="t.csv", names=("mean", "impulse"), label_name="state",
    ...     values=np.c_[size, (1.0 + label) / size], label=label, classes=("new", "worn"))
    >>> [finding.code for finding in table_findings(table)][0]
    'constant-product'
    """
    return [finding for check in CHECKS.values() for finding in check(table)]


def _refuse_twice(paths: Sequence[Path]) -> None:
    if not paths:
        raise DataError("0 files are given, must be >= 1; name a data set or table")
    places = [path.resolve() for path in paths]
    twice = sorted({str(path) for path in places if places.count(path) > 1})
    if twice:
        raise DataError(f"{', '.join(twice)} is given twice, must be once; name another file")


def _loaded(
    path: Path,
    side: str,
    roles: Roles,
    stack: ExitStack,
    *,
    jobs: int,
    progress: Callable[[int, int], None] | None,
) -> _LoadedFile:
    if not is_data_set(path):
        return _LoadedFile(path=path, side=side, table=read_table(path, roles))
    data = stack.enter_context(DataSet(path))
    if not (data.manifest["status"] == "ok").any():
        raise DataError(f"{path}: 0 usable records, must be > 0; see its column 'status'")
    manifest_table(data, roles, (), np.empty((0, 0)))  # refuse wrong roles before reading all
    kept = sketch(data, jobs=jobs, progress=progress)
    table = manifest_table(data, roles, kept.names, kept.measures)
    return _LoadedFile(path=path, side=side, table=table, data=data, kept=kept)


def _source(item: _LoadedFile) -> AuditSource:
    table = item.table
    counts = () if table.label is None else np.bincount(table.label, minlength=len(table.classes))
    return AuditSource(
        path=item.path,
        kind="table" if item.data is None else "data set",
        side=item.side,
        rows=len(table.values),
        columns=len(table.names),
        label=table.label_name,
        classes={name: int(n) for name, n in zip(table.classes, counts, strict=True)},
        machines=None if table.groups is None else int(np.unique(table.groups).size),
        splits=tuple(table.sides),
    )


def _checked(loaded: Sequence[_LoadedFile]) -> Iterator[str]:
    yield from CHECKS
    if any(item.data is not None for item in loaded):
        yield "copied signals, overlapping windows"
    if len(loaded) > 1:
        yield "machines and copies in two files"


def _unchecked(item: _LoadedFile, files: int) -> Iterator[str]:
    table, name = item.table, item.path.name
    if table.label is None:
        yield f"{name}: nothing about a label, none is known; give label"
    elif len(np.unique(table.label)) < 2:
        yield f"{name}: nothing about the label, all rows have the same"
    if table.groups is None:
        yield f"{name}: no machines are known, so that copies of one cannot be found; give group"
    if not table.nuisance:
        yield f"{name}: no conditions are named that must not follow the label; give nuisance"
    if not table.sides and not item.side:
        yield f"{name}: no split is known; give split, or train and test files"
    if table.numbered and files > 1:
        yield f"{name}: no machine of another file, for its numbers hold in it alone; audit the .h5"
    gaps = int((~np.isfinite(table.values)).any(axis=0).sum())
    if gaps:
        yield (
            f"{name}: {gaps} column(s) with missing values (also beyond {SMALLEST:g} to "
            f"{LARGEST:g} in size), for anything but single columns"
        )


# --- signals


def _record_findings(loaded: Sequence[_LoadedFile]) -> Iterator[Finding]:
    """Copies and overlaps of signals, within each data set and between two."""
    sets = [item for item in loaded if item.data is not None and item.kept is not None]
    kept = [item.kept for item in sets if item.kept is not None]
    found = copies([item.data for item in sets if item.data is not None], kept) if sets else []
    for number, item in enumerate(sets):
        mine, rows = pairs_in(found, number, kept[number])
        for whole in (True, False):
            chosen = [i for i, copy in enumerate(mine) if (copy.share == 1) == whole]
            if chosen:
                yield _within(item, [mine[i] for i in chosen], rows[chosen], whole)
    for i, j in combinations(range(len(sets)), 2):
        across = [copy for copy in found if (copy.first[0], copy.second[0]) == (i, j)]
        if across:
            yield _between(sets[i], sets[j], "copied-signals", len(across), _listed(across))


def _within(item: _LoadedFile, found: Sequence[Copy], rows: Any, whole: bool) -> Finding:
    """Copies in one data set: an alarm if they lie on both sides of a split or in two machines."""
    across = crossing(item.table.sides, rows)
    groups = item.table.groups
    machines = 0 if groups is None else int((groups[rows[:, 0]] != groups[rows[:, 1]]).sum())
    what = (
        "are copies of each other"
        if whole
        else (f"overlap, by {min(c.share for c in found):.0%} to {max(c.share for c in found):.0%}")
    )
    said = [f"{count} pair(s) across split {name}" for name, count in across.items()]
    said += [f"{machines} pair(s) of two machines"] if machines else []
    return Finding(
        code="copied-signals" if whole else "overlapping-windows",
        severity="alarm" if across or machines else "warning" if whole else "note",
        where=item.table.source,
        numbers={
            "pairs": len(found),
            "exact": sum(copy.exact for copy in found),
            "across": across,
            "two_machines": machines,
            "records": _listed(found),
        },
        what=f"{len(found)} pair(s) of records {what}, first {found[0].first[1]} and "
        f"{found[0].second[1]}" + "".join(f"; {text}" for text in said),
        means="test signals were seen in training: the figures are too good"
        if across
        else "records of two machines are one recording, so that no split by machine parts them"
        if machines
        else "harmless as long as they stay on one side, as a split by machine keeps them",
        cure="give all windows and copies of a recording one group, and split by it",
    )


def _listed(found: Sequence[Copy]) -> list[list[int]]:
    return [[copy.first[1], copy.second[1], copy.shift] for copy in found[:SHOWN]]


# --- two files


def _between(one: _LoadedFile, two: _LoadedFile, code: str, count: int, shown: Any) -> Finding:
    """Identical rows, signals or machines in two files: an alarm if one trains and one tests."""
    sides = {one.side, two.side} == {"train", "test"}
    what = {"copied-signals": "record", "copied-rows": "row", "shared-machines": "machine"}[code]
    return Finding(
        code=code,
        severity="alarm" if sides else "warning",
        where=f"{one.path.name} and {two.path.name}",
        numbers={"shared": count, "first": shown},
        what=f"{count} {what}(s) are in both files",
        means="test data were seen in training: the figures are too good"
        if sides
        else "together they hold less than it seems; one must not train while the other tests",
        cure="leave them out of one file, or draw other machines with another seed",
    )


def _between_tables(loaded: Sequence[_LoadedFile]) -> Iterator[Finding]:
    """Rows and machines that two tables share."""
    tables = [item for item in loaded if item.data is None]
    for i, j, pairs in cross_copies([item.table for item in tables]):
        shown = (pairs[:SHOWN] + 1).tolist()
        yield _between(tables[i], tables[j], "copied-rows", len(pairs), shown)
    for one, two in combinations(tables, 2):
        if one.table.groups is None or two.table.groups is None:
            continue
        if one.table.numbered or two.table.numbered:
            continue  # the same number may be another machine
        both = np.intersect1d(one.table.groups, two.table.groups)
        if both.size:
            yield _between(one, two, "shared-machines", both.size, both[:SHOWN].tolist())


def _between_draws(loaded: Sequence[_LoadedFile]) -> Iterator[Finding]:
    """Machines drawn alike in two simulated sets: from one recipe, or from another's machines."""
    sets = [(item, item.data) for item in loaded if item.data is not None]
    for (one, first), (two, second) in combinations(sets, 2):
        origin, other = (
            machine_origin(data.attributes.recipe, data.attributes.seed) for data in (first, second)
        )
        if origin is None or origin != other:
            continue
        both = np.intersect1d(first.manifest["group"], second.manifest["group"])
        if both.size:
            yield _between(one, two, "shared-machines", both.size, both[:SHOWN].tolist())
