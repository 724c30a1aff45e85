"""Integrity of a data set file: hashes, ranges, groups and duplicates.

A fault makes a label or a signal wrong. A note is something that a user should know.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError, missing_file
from ...sim.wear.archard import grade
from ..draws.draws import Range
from ..file.attributes import signal_checksum
from ..file.record import DataSet
from ..measured.labels import MOST_WEAR
from ..recipe.load import recorded_recipe
from ..recipe.recipe import Recipe
from ..split.rules import check_no_leak
from .plausibility import doubts_of, scene_in

Flags = NDArray[np.bool_]

_ROUNDING = 1e-9  # of bounds that were converted from other units


@dataclass(frozen=True, kw_only=True)
class IntegrityFinding:
    """One finding.

    Attributes
    ----------
    severity : {"fault", "note"}
        Whether it makes the file unsound.
    check : str
        Name of the check.
    text : str
        Description of the fault, and the cure.
    records : tuple of int
        Records concerned; empty if it is about the file.
    """

    severity: Literal["fault", "note"]
    check: str
    text: str
    records: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Checked:
    """Result of the check of a file.

    Attributes
    ----------
    path : Path
        The file.
    n_records, n_failed : int
        Records in it, and those whose status is not ``ok``; 0 if it could not be opened.
    n_bytes : int
        Size of the signals read.
    findings : tuple of IntegrityFinding
        Findings, faults first.
    """

    path: Path
    n_records: int
    n_failed: int
    n_bytes: int
    findings: tuple[IntegrityFinding, ...]

    @property
    def sound(self) -> bool:
        """Whether no fault was found."""
        return all(finding.severity != "fault" for finding in self.findings)


def check_set(path: str | Path, *, progress: Callable[[int, int], None] | None = None) -> Checked:
    """Check a data set file, every record of it.

    Parameters
    ----------
    path : str or Path
        A finished file.
    progress : callable, optional
        Called with (records read, records in total).

    Returns
    -------
    Checked

    Raises
    ------
    DataError
        If there is no such file.

    Notes
    -----
    Memory holds the manifest and one record. If a file cannot be opened, that is the only finding.
    Hidden quantities (``truth``) have no checksum and are not checked.

    Examples
    --------
    >>> import tempfile
    >>> from wearstate.datasets.generation.generate import generate
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> recipe = load_recipe("journal-bearing-small", {"duration": "0.05 s"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = generate(recipe, 2, Path(folder) / "data.h5")
    ...     check_set(made.path).sound
    True
    """
    place = Path(path).absolute()
    if not place.is_file():
        raise DataError(missing_file(place))
    try:
        data = DataSet(place)
    except DataError as error:
        texts = [text.removeprefix(f"{place}: ") for text in str(error).split("\n")]
        found = tuple(IntegrityFinding(severity="fault", check="file", text=text) for text in texts)
        return Checked(path=place, n_records=0, n_failed=0, n_bytes=0, findings=found)
    with data:
        signals = _read_signals(data, progress)
        item = _Inspection(data, signals)
        findings = [finding for check in _CHECKS for finding in check(item)]
    return Checked(
        path=place,
        n_records=len(data),
        n_failed=int(np.count_nonzero(~item.ok)),
        n_bytes=signals.n_bytes,
        findings=tuple(sorted(findings, key=lambda finding: finding.severity)),
    )


def refuse_wrong_labels(path: str | Path) -> None:
    """Refuse labels that no model should learn from, or be judged by.

    Unlike :func:`check_set` it reads the manifest alone, and signals only where two records of
    different machines have one checksum.

    Parameters
    ----------
    path : str or Path
        A finished file.

    Raises
    ------
    DataError
        If a label is infinite, negative, outside the range of the recipe, far beyond the condemning
        limit, or contradicted by the grade; or a record is there under two machines; all at once.

    Examples
    --------
    >>> import tempfile
    >>> from wearstate.datasets.generation.generate import generate
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> recipe = load_recipe("journal-bearing-small", {"duration": "0.05 s"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     refuse_wrong_labels(generate(recipe, 2, Path(folder) / "data.h5").path)
    """
    with DataSet(path) as data:
        item = _Inspection(data, _unread(len(data)))
        found = [each for check in _LABEL_CHECKS for each in check(item)]
        found += [each for each in _check_equal_signals(item) if "across groups" in each.text]
    faults = [finding for finding in found if finding.severity == "fault"]
    if faults:
        raise DataError(
            "\n".join(
                f"{path}: {_records_text(each.records, len(each.records))}{each.text}"
                for each in faults
            )
        )


def refuse_shared(path: str | Path, others: Sequence[str | Path]) -> None:
    """Refuse records that are in a training set and among those that its model must refuse.

    Parameters
    ----------
    path : str or Path
        Training set.
    others : sequence of str or Path
        Data sets to be refused by the model.

    Raises
    ------
    DataError
        If a signal of any of them is in the training set.
    """
    faults = []
    with DataSet(path) as data:
        own = data.rows["signal_crc32"]
        for other in others:
            with DataSet(other) as strange:
                checksums = strange.rows["signal_crc32"]
                twins = [
                    int(index)
                    for index in np.flatnonzero(np.isin(checksums, own))
                    if _is_among(strange.stored_signal(int(index)), data, checksums[index] == own)
                ]
            if twins:
                faults.append(
                    f"{other}: {_records_text(twins, len(twins))}also in the training set {path}, "
                    "must not be: a model cannot learn to grade and to refuse the same signal; "
                    "leave them out"
                )
    if faults:
        raise DataError("\n".join(faults))


def _is_among(signal: NDArray[np.float32], data: DataSet, at: Flags) -> bool:
    """Whether one of the records has this signal: checksums of others may be equal by chance."""
    return any(np.array_equal(signal, data.stored_signal(i)) for i in np.flatnonzero(at).tolist())


# --- data of the checks -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Signals:
    """Properties of the signals [shape=(n_records,)]."""

    damaged: Flags
    infinite: Flags
    zero: Flags
    constant: Flags
    n_bytes: int
    doubts: Mapping[str, Sequence[tuple[int, str]]]  # records and their messages, by check


def _read_signals(data: DataSet, progress: Callable[[int, int], None] | None) -> _Signals:
    """Read every signal once, in the order of the file."""
    n = len(data)
    flags = np.zeros((4, n), dtype=bool)
    doubts: dict[str, list[tuple[int, str]]] = {}
    scene, speeds = scene_in(data.attributes), _speeds(data.rows)
    n_bytes = 0
    checksums = data.rows["signal_crc32"]
    for index in range(n):
        try:
            signal = data.stored_signal(index)
        except DataError:
            flags[0, index] = True
        else:
            flags[:, index] = _signal_flags(signal, int(checksums[index]))
            n_bytes += signal.nbytes
            if not flags[:2, index].any() and data.rows["status"][index] == b"ok":
                for doubt in doubts_of(signal, data.attributes, scene, speeds[index]):
                    doubts.setdefault(doubt.check, []).append((index, doubt.text))
        if progress is not None:
            progress(index + 1, n)
    damaged, infinite, zero, constant = flags
    return _Signals(
        damaged=damaged,
        infinite=infinite,
        zero=zero,
        constant=constant,
        n_bytes=n_bytes,
        doubts=doubts,
    )


def _unread(n: int) -> _Signals:
    """Signals that are taken to be as they should."""
    none = np.zeros(n, dtype=bool)
    return _Signals(damaged=none, infinite=none, zero=none, constant=none, n_bytes=0, doubts={})


def _speeds(rows: NDArray[np.void]) -> NDArray[np.float64]:
    """Speed of every record by the manifest, the measured mean if present [Hz]; NaN without."""
    found = np.full(len(rows), math.nan)
    for name in _SPEEDS:  # the last one present wins
        if name in (rows.dtype.names or ()):
            values = np.asarray(rows[name], dtype=float)
            known = np.isfinite(values) & (values > 0)
            found[known] = values[known]
    return found


def _signal_flags(signal: NDArray[np.float32], checksum: int) -> tuple[bool, bool, bool, bool]:
    low, high = signal.min(axis=1), signal.max(axis=1)  # not finite if a sample is not
    still = low == high
    return (
        signal_checksum(signal) != checksum,
        not bool(np.isfinite(low).all() and np.isfinite(high).all()),
        bool(still.all() and not low.any()),
        bool(still.any()),
    )


class _Inspection:
    """A file with the properties of its signals and its recipe."""

    def __init__(self, data: DataSet, signals: _Signals) -> None:
        self.data = data
        self.head = data.attributes
        self.signals = signals
        self.rows = data.rows
        self.columns = data.rows.dtype.names or ()
        self.ok: Flags = data.rows["status"] == b"ok"
        self.simulated = self.head.origin == "simulated"

    @cached_property
    def recipe(self) -> Recipe | str:
        """The recipe, or why the texts in the file give none; empty if there is no text."""
        if not self.head.recipe:
            return ""
        try:
            return recorded_recipe(self.head.scene, self.head.recipe, self.head.overrides)
        except ValueError as error:
            return " ".join(str(error).split())

    def numbers(self, name: str) -> NDArray[np.float64]:
        """A column as floats."""
        return np.asarray(self.rows[name], dtype=float)


def _at(flags: Any) -> tuple[int, ...]:
    return tuple(np.flatnonzero(flags).tolist())


def _fault(check: str, text: str, flags: Any) -> Iterator[IntegrityFinding]:
    """A fault of the flagged records, if there are any."""
    if np.any(flags):
        yield IntegrityFinding(severity="fault", check=check, text=text, records=_at(flags))


def _note(check: str, text: str, flags: Any) -> Iterator[IntegrityFinding]:
    if np.any(flags):
        yield IntegrityFinding(severity="note", check=check, text=text, records=_at(flags))


# --- checks -------------------------------------------------------------------------------------


def _check_hashes(item: _Inspection) -> Iterator[IntegrityFinding]:
    if item.data.unhashed:
        text = (
            f"the file has no {' and no '.join(item.data.unhashed)}, so that altered labels are "
            "not found; it was made before hashes were added: export it to .h5 to add them"
        )
        yield IntegrityFinding(severity="note", check="hash", text=text)


def _check_signals(item: _Inspection) -> Iterator[IntegrityFinding]:
    signals = item.signals
    yield from _fault(
        "checksum",
        "signal does not fit its checksum; take an intact copy",
        signals.damaged,
    )
    intact = ~signals.damaged
    yield from _fault(
        "signal", "has samples that are not finite; generate it again", signals.infinite & intact
    )
    silent = signals.zero & intact & item.ok
    yield from _fault(
        "signal", "is zero throughout while its status is ok; generate it again", silent
    )
    yield from _note(
        "signal",
        "has a channel that never changes; look at the sensor",
        signals.constant & intact & item.ok & ~silent,
    )


def _check_equal_signals(item: _Inspection) -> Iterator[IntegrityFinding]:
    """Records that are identical in every byte, whatever their labels."""
    usable = item.ok & ~item.signals.damaged & ~item.signals.zero
    first: dict[int, list[int]] = {}
    equal = np.zeros(len(usable), dtype=bool)
    apart = False
    groups = item.rows["group"]
    checksums = item.rows["signal_crc32"].tolist()
    for index in np.flatnonzero(usable).tolist():
        others = first.setdefault(checksums[index], [])
        # of 100,000 records two have the same checksum by chance: compare them
        twin = next((other for other in others if _same_signal(item.data, other, index)), None)
        if twin is None:
            others.append(index)
        else:
            equal[[twin, index]] = True
            apart |= bool(groups[twin] != groups[index])
    where = "also across groups, which leaks into every split; " if apart else ""
    yield from _fault("duplicate", f"signal is that of another record; {where}keep one", equal)


def _same_signal(data: DataSet, one: int, other: int) -> bool:
    return np.array_equal(data.stored_signal(one), data.stored_signal(other))


def _check_identities(item: _Inspection) -> Iterator[IntegrityFinding]:
    for name in ("record_id", "seed"):
        if name == "seed" and not item.simulated:
            continue  # a measured record has none
        values, inverse, counts = np.unique(
            item.rows[name], return_inverse=True, return_counts=True
        )
        del values
        yield from _fault(
            "duplicate",
            f"{name} is that of another record, must be its own; generate or import it again",
            counts[inverse] > 1,
        )


def _check_status(item: _Inspection) -> Iterator[IntegrityFinding]:
    failed = Counter(
        status.decode(errors="replace") for status in item.rows["status"][~item.ok].tolist()
    )
    if failed:
        kinds = ", ".join(f"{count} {status}" for status, count in failed.most_common())
        severity: Literal["fault", "note"] = "note" if item.ok.any() else "fault"
        text = f"not to be used, by their status: {kinds}"
        yield IntegrityFinding(severity=severity, check="status", text=text, records=_at(~item.ok))


def _check_numbers(item: _Inspection) -> Iterator[IntegrityFinding]:
    """Numbers must be finite, known if required, and of the right sign."""
    for name in item.columns:
        if item.rows.dtype[name].kind != "f":
            continue
        values = item.numbers(name)
        yield from _fault(
            "number", f"{name} is infinite; generate or import it again", np.isinf(values)
        )
        if name in _must_be_known(item):
            text = f"{name} is not a number, must be known; generate it again"
            yield from _fault("number", text, np.isnan(values) & item.ok)
    for name in [name for name in item.head.severities if name in item.columns]:
        yield from _fault("number", f"{name} must be >= 0; correct the label", item.rows[name] < 0)
    for name in [name for name in _SPEEDS if name in item.columns]:
        wrong = item.ok & (item.rows[name] <= 0)
        yield from _fault("number", f"{name} must be > 0; correct the label", wrong)


_SPEEDS = ("speed_hz", "mean_speed_hz")


def _must_be_known(item: _Inspection) -> frozenset[str]:
    """Columns without gaps in a simulated record; in a measured one anything may be unknown."""
    if not item.simulated:
        return frozenset()
    drawn = frozenset(item.recipe.columns) if isinstance(item.recipe, Recipe) else frozenset()
    return (drawn | frozenset(item.head.severities)) - _MAY_END


_MAY_END = frozenset({"remaining_life_h"})  # unknown if maintenance prevents the end of life


def _check_grades(item: _Inspection) -> Iterator[IntegrityFinding]:
    grades = np.asarray(item.rows["grade"], dtype=int)
    yield from _fault(
        "grade", "grade must be -1 to 3; correct the label", (grades < -1) | (grades > 3)
    )
    edges = item.head.grade_edges
    if not edges or not item.head.severities:
        return
    name = item.head.severities[0]
    values = item.numbers(name)
    known = np.isfinite(values) & (values >= 0)
    wanted = np.array([grade(v, edges) if k else -1 for v, k in zip(values, known, strict=True)])
    shown = ", ".join(f"{edge:g}" for edge in edges)
    text = f"grade must be what {name} and the limits {shown} m make it; correct the label"
    yield from _fault("grade", text, known & (grades != wanted))
    text = (
        f"{name} is more than {MOST_WEAR:g} times the condemning limit, {edges[-1]:g} m; labels "
        "are in metres: check the unit"
    )
    yield from _fault("grade", text, known & (values > MOST_WEAR * edges[-1]))


def _check_recipe(item: _Inspection) -> Iterator[IntegrityFinding]:
    """Every drawn value must be within the range of its recipe."""
    recipe = item.recipe
    if isinstance(recipe, str):
        if recipe:
            text = f"ranges and groups are not checked against the recipe in the file: {recipe}"
            yield IntegrityFinding(severity="note", check="range", text=text)
        return
    for column, bands in _bands(recipe).items():
        if column in item.columns:
            values = item.numbers(column)
            outside = np.isfinite(values) & ~_within(values, bands)
            text = f"{column} must be within {_bands_text(bands)} of the recipe; generate it again"
            yield from _fault("range", text, outside)
    yield from _check_confounders(item, recipe)
    yield from _check_groups(item, recipe)


Bands = Sequence[tuple[float, float]]


def _bands(recipe: Recipe) -> dict[str, Bands]:
    """Ranges from which manifest columns were drawn."""
    found: dict[str, Bands] = {wear.column: wear.axis.bands for wear in recipe.severities}
    columns = {path: column for column, path in recipe.conditions.items()}
    for axis in (*recipe.machine, *recipe.record):
        if isinstance(axis, Range) and axis.path in columns:
            found[columns[axis.path]] = axis.bands
    return found


def _within(values: NDArray[np.float64], bands: Bands) -> Flags:
    inside = np.zeros(values.shape, dtype=bool)
    for low, high in bands:
        room = _ROUNDING * max(abs(low), abs(high))
        inside |= (values >= low - room) & (values <= high + room)
    return inside


def _bands_text(bands: Bands) -> str:
    return " or ".join(f"{low:.6g} to {high:.6g}" for low, high in bands)


def _check_confounders(item: _Inspection, recipe: Recipe) -> Iterator[IntegrityFinding]:
    """The value of a fault must be in its range if present, and 0 if absent."""
    for fault in recipe.faults:
        presence, value = fault.columns
        if not {presence, value} <= set(item.columns):
            continue
        present = np.asarray(item.rows[presence], dtype=bool)
        values = item.numbers(value)
        bands = [band for axis in fault.axes for band in axis.bands]
        wrong = np.where(present, ~_within(values, bands), values != 0)
        text = (
            f"{value} must be within {_bands_text(bands)} where {presence}, else 0; repeat generate"
        )
        yield from _fault("range", text, wrong)


def _check_groups(item: _Inspection, recipe: Recipe) -> Iterator[IntegrityFinding]:
    """Values drawn per machine must be the same in all records of a machine."""
    most = recipe.table.records_per_group
    groups, inverse, counts = np.unique(item.rows["group"], return_inverse=True, return_counts=True)
    text = f"group has more than the {most} record(s) of the recipe; generate it again"
    yield from _fault("group", text, counts[inverse] > most)
    for name in _machine_columns(recipe) & set(item.columns):
        values = item.numbers(name)
        first = np.full(len(groups), math.nan)
        first[inverse[::-1]] = values[::-1]  # the first record of each group is written last
        text = f"{name} is drawn per machine, must be one in a group; generate it again"
        differs = np.isfinite(values) & (values != first[inverse])
        yield from _fault("group", text, np.isin(inverse, inverse[differs]))


def _check_lives(item: _Inspection) -> Iterator[IntegrityFinding]:
    """Records of a machine must be in order of age."""
    if _HOURS in item.columns:
        hours, groups = item.numbers(_HOURS), item.rows["group"]
        back = (groups[1:] == groups[:-1]) & (hours[1:] < hours[:-1])
        text = f"{_HOURS} must not fall from record to record of a group; generate it again"
        yield from _fault("group", text, np.append(False, back))


_HOURS = "operating_hours"


def _machine_columns(recipe: Recipe) -> set[str]:
    paths = {axis.path for axis in recipe.machine}
    conditions = {column for column, path in recipe.conditions.items() if path in paths}
    per_machine = [fault for fault in recipe.faults if fault.table.per == "machine"]
    return conditions | {column for fault in per_machine for column in fault.columns}


def _check_splits(item: _Inspection) -> Iterator[IntegrityFinding]:
    """Every split must have a side for every record, and separate machines if it claims to."""
    try:
        for name, about in item.data.splits.items():
            train, test = item.data.split(name)
            if about.get("machines_apart"):
                check_no_leak(item.rows["group"], train, test)
    except DataError as error:
        text = str(error).removeprefix(f"{item.data.path}: ")
        yield IntegrityFinding(severity="fault", check="split", text=text)


def _check_clipped(item: _Inspection) -> Iterator[IntegrityFinding]:
    if "clipped_samples" in item.columns:
        text = "holds samples at the end of the converter's range, as a real sensor would"
        yield from _note("clipped", text, item.rows["clipped_samples"] > 0)


def _check_plausible(item: _Inspection) -> Iterator[IntegrityFinding]:
    """Records that are complete but implausible; a constant one has its own note."""
    for check, found in item.signals.doubts.items():
        if check != "still":
            records, texts = zip(*found, strict=True)
            where = f"{check}, such as record {records[0]}" if len(found) > 1 else check
            text = f"{where}: {texts[0]}"
            yield IntegrityFinding(severity="note", check="plausible", text=text, records=records)


_CHECKS: tuple[Callable[[_Inspection], Iterator[IntegrityFinding]], ...] = (
    _check_hashes,
    _check_signals,
    _check_equal_signals,
    _check_identities,
    _check_status,
    _check_numbers,
    _check_grades,
    _check_recipe,
    _check_lives,
    _check_splits,
    _check_clipped,
    _check_plausible,
)
"""All checks; a new one is one function and one row."""

_LABEL_CHECKS = (_check_numbers, _check_grades, _check_recipe)
"""Checks of the manifest whose faults spoil a model."""


# --- text ---------------------------------------------------------------------------------------

_SHOWN = 5  # records of a finding in a line
_MOST_RECORDS = 1000  # records of a finding in JSON


def checked_table(checked: Checked) -> dict[str, Any]:
    """Result of a check, ready for JSON.

    Returns
    -------
    dict
        ``path``, ``sound``, counts, and ``findings``, each with ``count`` and the first 1,000 of
        its ``records``.
    """
    return {
        "path": str(checked.path),
        "sound": checked.sound,
        "records": checked.n_records,
        "failed": checked.n_failed,
        "signal_bytes": checked.n_bytes,
        "findings": [
            {
                "severity": finding.severity,
                "check": finding.check,
                "text": finding.text,
                "count": len(finding.records),
                "records": list(finding.records[:_MOST_RECORDS]),
            }
            for finding in checked.findings
        ],
    }


def checked_text(table: Mapping[str, Any]) -> str:
    """Result of a check as text: the verdict, then a line for every finding.

    Parameters
    ----------
    table : mapping
        Table from :func:`checked_table`.

    Examples
    --------
    >>> finding = {"severity": "fault", "check": "checksum", "text": "damaged", "count": 1}
    >>> table = {"path": "a.h5", "records": 3, "failed": 0, "signal_bytes": 2e6, "sound": False}
    >>> print(checked_text({**table, "findings": [{**finding, "records": [2]}]}))
    a.h5: NOT SOUND: 1 fault(s), 0 note(s) in 3 records (0 failed), 2.0 MB of signal
    fault  checksum   record 2: damaged
    """
    findings = table["findings"]
    faults = sum(finding["severity"] == "fault" for finding in findings)
    verdict = "sound" if table["sound"] else "NOT SOUND"
    head = (
        f"{table['path']}: {verdict}: {faults} fault(s), {len(findings) - faults} note(s) in "
        f"{table['records']} records ({table['failed']} failed), "
        f"{table['signal_bytes'] / 1e6:.1f} MB of signal"
    )
    return "\n".join([head, *(_finding_line(finding) for finding in findings)])


def _finding_line(finding: Mapping[str, Any]) -> str:
    where = _records_text(finding["records"], finding["count"])
    return f"{finding['severity']:5}  {finding['check']:9}  {where}{finding['text']}"


def _records_text(records: Sequence[int], count: int) -> str:
    """The first of the records that a finding is about; empty if it is about the file."""
    if not count:
        return ""
    more = count - _SHOWN
    shown = ", ".join(map(str, records[:_SHOWN]))
    return (
        f"record{'s' if count > 1 else ''} {shown}" + (f" and {more} more" if more > 0 else "")
    ) + ": "
