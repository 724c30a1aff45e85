"""Several data sets of one kind merged into one, with machines kept apart and sources recorded."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...sim.output.recording import DataError
from ..file.attributes import Attributes, manifest_hash
from ..file.record import DataSet
from ..file.writer import DataSetWriter, refuse_output
from ..measured.label_table import listed, refusal
from ..measured.plan import RATE_TOLERANCE

SOURCE, SOURCE_GROUP, SOURCE_ID = "source", "source_group", "source_record_id"
"""Manifest columns: data set of origin of a record, and its group and id there."""

GROUP_NAME = "group_name"

Duplicates = Literal["refuse", "drop"]

_OWN = ("record_id", "group", "seed", "done", "status", "grade", "signal_crc32")
"""Columns of every data set, which the writer lays out itself."""

_LONGEST_NUMBER = 20  # digits of a group

_SAME = (
    ("channels", "channel names, units and quantities"),
    ("sample_rate", "sample rate [Hz]"),
    ("samples", "samples of a record"),
    ("tacho", "tacho and pulses per revolution"),
    ("origin", "origin"),
    ("limits", "grade limits [m]"),
)


@dataclass(frozen=True, kw_only=True)
class MergeSummary:
    """Result of a merge.

    Attributes
    ----------
    path : Path
        The file.
    n_records, n_groups : int
        Records, and machines.
    sources : dict
        Number of records taken from each data set, by its name.
    n_dropped : int
        Number of duplicates left out.
    filled : dict
        Data sets that lack a column, by column; their values are NaN or empty.
    n_joined : int
        Number of groups of different data sets that hold an identical signal and became one.
    """

    path: Path
    n_records: int
    n_groups: int
    sources: dict[str, int]
    n_dropped: int
    filled: dict[str, tuple[str, ...]]
    n_joined: int


@dataclass(frozen=True, kw_only=True)
class _Origin:
    """A record by the data set that holds it."""

    source: int
    index: int


def merge_sets(
    paths: Sequence[str | Path],
    path: str | Path,
    *,
    duplicates: Duplicates = "refuse",
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> MergeSummary:
    """Write the records of several data sets as one.

    Parameters
    ----------
    paths : sequence of str or Path
        Data sets of this program, >= 2, with the same channels, rate, record length, tacho, origin
        and limits. Records keep their order.
    path : str or Path
        File to write; ``<path>.part`` until finished.
    duplicates : {"refuse", "drop"}
        Treatment of a record whose id and signal another data set holds as well; the first one
        stays.
    force : bool
        Replace an existing file.
    progress : callable, optional
        Called with (records done, records in total).

    Returns
    -------
    MergeSummary

    Raises
    ------
    DataError
        If a data set cannot be read or is given twice, they are not of one kind, there are
        duplicates, or the output exists. Nothing is left behind.

    Notes
    -----
    Groups get new numbers: two data sets share one only if they hold an identical signal, which
    shows that it is the same machine. Record ids are kept if they are unique, otherwise numbered
    anew. Stored splits and hidden quantities are left out: they belong to the sets they were made
    for.

    Examples
    --------
    >>> import tempfile
    >>> from wearstate.datasets.measured.data_set import import_recordings
    >>> from wearstate.datasets.source.part import SourceOptions
    >>> options = SourceOptions(fs=9.0, unit="g")
    >>> with tempfile.TemporaryDirectory() as name:
    ...     folder = Path(name)
    ...     for i in range(2):
    ...         np.save(folder / "x.npy", np.full((1, 9), 1.0 + i))
    ...         _ = import_recordings([folder / "x.npy"], folder / f"{i}.h5", options=options)
    ...     made = merge_sets([folder / "0.h5", folder / "1.h5"], folder / "both.h5")
    >>> made.n_records, made.n_groups, made.sources
    (2, 2, {'0': 1, '1': 1})
    """
    target = Path(path).absolute()
    files = [Path(os.path.abspath(file)) for file in paths]
    _refuse_files(files, target, force)
    with ExitStack() as stack:
        sets = [stack.enter_context(DataSet(file)) for file in files]
        names = _names(files)
        head = _common(sets, names)
        kept, joined, dropped = _distinct(sets, names, duplicates)
        columns, filled = _columns(sets, names)
        groups = _groups(sets, joined)
        rows = _rows(sets, names, kept, columns, groups)
        _write(target, head, columns, sets, kept, rows, progress, force)
    counts = np.bincount([origin.source for origin in kept], minlength=len(sets))
    return MergeSummary(
        path=target,
        n_records=len(kept),
        n_groups=len({row["group"] for row in rows}),
        sources=dict(zip(names, counts.tolist(), strict=True)),
        n_dropped=dropped,
        filled=filled,
        n_joined=len(groups) - len(set(groups.values())),
    )


def _refuse_files(files: Sequence[Path], target: Path, force: bool) -> None:
    if len(files) < 2:
        raise DataError(f"{len(files)} data set(s), must be >= 2 to merge; name more")
    real = [os.path.realpath(file) for file in files]
    twice = sorted({name for name in real if real.count(name) > 1})
    if twice:
        raise DataError(f"{listed(twice)} given twice, must be once; leave one out")
    if os.path.realpath(target) in real:
        raise DataError(f"{target} is also an input, must be another file; choose another name")
    refuse_output(target, force)


def _names(files: Sequence[Path]) -> list[str]:
    """Name of every source: its stem, or its path below the folder that all share."""
    stems = [file.stem for file in files]
    if len(set(stems)) == len(stems):
        return stems
    base = os.path.commonpath([file.parent for file in files])
    return [file.relative_to(base).with_suffix("").as_posix() for file in files]


# --- one kind -----------------------------------------------------------------------------------


def _kind(data: DataSet) -> dict[str, Any]:
    """Properties that must be equal, by the keys of `_SAME`."""
    head = data.attributes
    return {
        "channels": [(c.name, c.unit, c.quantity) for c in head.channels],
        "sample_rate": head.sample_rate,
        "samples": data.stored_shape[2],
        "tacho": (head.tacho, head.pulses_per_revolution),
        "origin": head.origin,
        "limits": head.grade_edges,
    }


def _common(sets: Sequence[DataSet], names: Sequence[str]) -> Attributes:
    """Attributes of the merged set; all differences that prevent a merge are reported."""
    kinds = [_kind(data) for data in sets]
    faults = []
    for key, words in _SAME:
        values = [kind[key] for kind in kinds]
        # unknown limits do not contradict grades by those of the others
        known = [value for value in values if key != "limits" or value]
        if not all(_alike(key, value, known[0]) for value in known):
            each = "; ".join(f"{v} in {n}" for v, n in zip(values, names, strict=True))
            faults.append(f"{words} must be the same: {each}; make them alike, or merge others")
    if faults:
        raise refusal(faults)
    heads = [data.attributes for data in sets]
    limits = next((head for head in heads if head.grade_edges), heads[0])
    return Attributes(
        sample_rate=heads[0].sample_rate,
        channels=tuple(
            channel
            if all(head.channels[i] == channel for head in heads)
            else replace(channel, unit_in_file="", place="", direction="")
            for i, channel in enumerate(heads[0].channels)
        ),
        origin=heads[0].origin,
        tacho=heads[0].tacho,
        pulses_per_revolution=heads[0].pulses_per_revolution,
        severities=tuple(dict.fromkeys(name for head in heads for name in head.severities)),
        grade_edges=limits.grade_edges,
        condemning_limit=limits.condemning_limit,
        limit_source=limits.limit_source,
        recipe=_shared(heads, "recipe"),
        scene=_shared(heads, "scene"),
        fidelity=_shared(heads, "fidelity"),
        merged_from=json.dumps(_provenance(sets, names)),
    )


def _alike(key: str, one: Any, other: Any) -> bool:
    if key == "sample_rate":
        return bool(abs(one / other - 1) <= RATE_TOLERANCE)
    return bool(one == other)


def _shared(heads: Sequence[Attributes], name: str) -> str:
    """A text that all have, or else none: it would not be true of every record."""
    texts = {str(getattr(head, name)) for head in heads}
    return texts.pop() if len(texts) == 1 else ""


def _provenance(sets: Sequence[DataSet], names: Sequence[str]) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "file": data.path.name,
            "records": len(data),
            "created_by": data.attributes.created_by,
            "manifest_sha256": manifest_hash(data.rows),
        }
        for data, name in zip(sets, names, strict=True)
    ]


# --- the same record, the same machine ----------------------------------------------------------


_Pair = tuple[tuple[int, int], tuple[int, int]]
"""Two groups, each as (source, number there), that hold an identical signal."""


def _distinct(
    sets: Sequence[DataSet], names: Sequence[str], duplicates: Duplicates
) -> tuple[list[_Origin], list[_Pair], int]:
    """Records to keep, groups that are one machine, and the number of dropped records."""
    seen: dict[int, list[_Origin]] = {}
    kept: list[_Origin] = []
    joined: list[_Pair] = []
    twice: list[str] = []
    for source, data in enumerate(sets):
        for index, checksum in enumerate(data.rows["signal_crc32"].tolist()):
            origin = _Origin(source=source, index=index)
            twins = [
                other
                for other in seen.get(checksum, [])
                if other.source != source and _same_signal(sets, origin, other)
            ]
            joined += [(_group_of(sets, origin), _group_of(sets, other)) for other in twins]
            record_id = data.rows["record_id"][index]
            if any(sets[o.source].rows["record_id"][o.index] == record_id for o in twins):
                twice.append(f"{record_id.decode()} of {names[source]}")
                continue
            seen.setdefault(checksum, []).append(origin)
            kept.append(origin)
    if twice and duplicates == "refuse":
        raise DataError(
            f"{len(twice)} record(s) have the id and the signal of one before, must be 0: "
            f"{listed(twice)}; leave the data set out, or drop them with duplicates = drop"
        )
    return kept, joined, len(twice)


def _same_signal(sets: Sequence[DataSet], one: _Origin, other: _Origin) -> bool:
    first = sets[one.source].stored_signal(one.index)
    return np.array_equal(first, sets[other.source].stored_signal(other.index))


def _group_of(sets: Sequence[DataSet], origin: _Origin) -> tuple[int, int]:
    return origin.source, int(sets[origin.source].rows["group"][origin.index])


def _groups(sets: Sequence[DataSet], joined: Sequence[_Pair]) -> dict[tuple[int, int], int]:
    """New number of every group, equal only for groups that are joined."""
    own = [(i, int(g)) for i, data in enumerate(sets) for g in np.unique(data.rows["group"])]
    leader = {group: group for group in own}

    def first(group: tuple[int, int]) -> tuple[int, int]:
        while leader[group] != group:
            group = leader[group]
        return group

    for one, other in joined:
        low, high = sorted((first(one), first(other)))
        leader[high] = low
    numbers = {group: i for i, group in enumerate(g for g in own if first(g) == g)}
    return {group: numbers[first(group)] for group in own}


# --- manifest -----------------------------------------------------------------------------------


def _columns(
    sets: Sequence[DataSet], names: Sequence[str]
) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """Types of the columns of all sets, and the sets that lack each."""
    types = [{n: data.rows.dtype[n] for n in data.rows.dtype.names or ()} for data in sets]
    wanted = dict.fromkeys(name for own in types for name in own if name not in _OWN)
    columns: dict[str, str] = {
        SOURCE: f"S{max(len(name.encode()) for name in names)}",
        SOURCE_GROUP: "<i8",
        SOURCE_ID: "S16",
    }
    filled: dict[str, tuple[str, ...]] = {}
    faults = []
    for name in wanted:
        if name in columns:
            continue  # from an earlier merge: the nearer source is recorded
        there = [own[name] for own in types if name in own]
        lacking = tuple(n for n, own in zip(names, types, strict=True) if name not in own)
        if len({kind.kind == "S" for kind in there}) > 1:
            faults.append(f"column {name} must be of words or of numbers in all; rename one")
            continue
        if name == GROUP_NAME:  # without it, the number of the group takes its place
            width = max(_LONGEST_NUMBER, *(kind.itemsize for kind in there))
            columns[name] = f"S{width + 1 + max(len(n.encode()) for n in names)}"
            continue
        if lacking:
            filled[name] = lacking
        columns[name] = _common_type(there, whole=not lacking)
    if faults:
        raise refusal(faults)
    return columns, filled


def _common_type(kinds: Sequence[np.dtype[Any]], *, whole: bool) -> str:
    """Type that holds all values; only floats and texts can express a missing value."""
    common = np.result_type(*kinds)
    if not whole and common.kind not in "Sf":
        return "<f8"
    return str(common.str)


def _rows(
    sets: Sequence[DataSet],
    names: Sequence[str],
    kept: Sequence[_Origin],
    columns: Mapping[str, str],
    groups: Mapping[tuple[int, int], int],
) -> list[dict[str, Any]]:
    """Manifest row of every record kept."""
    found = []
    ids = [sets[o.source].rows["record_id"][o.index] for o in kept]
    unique = len(set(ids)) == len(ids)
    for number, origin in enumerate(kept):
        row = sets[origin.source].row(origin.index)
        group, name = _group_of(sets, origin), names[origin.source]
        own = {
            SOURCE: name,
            SOURCE_GROUP: group[1],
            SOURCE_ID: row["record_id"],
            "record_id": row["record_id"] if unique else str(number),
            "group": groups[group],
        }
        if GROUP_NAME in columns:
            own[GROUP_NAME] = f"{name}/{row.get(GROUP_NAME, group[1])}"
        left_out = ("done", "signal_crc32")
        found.append({**{n: v for n, v in row.items() if n not in left_out}, **own})
    return found


def _write(
    target: Path,
    head: Attributes,
    columns: Mapping[str, str],
    sets: Sequence[DataSet],
    kept: Sequence[_Origin],
    rows: Sequence[Mapping[str, Any]],
    progress: Callable[[int, int], None] | None,
    force: bool,
) -> None:
    writer = DataSetWriter(
        target,
        head,
        n_records=len(kept),
        n_samples=sets[0].stored_shape[2],
        columns=columns,
        force=force,
        resumable=False,
    )
    with writer:
        for index, (origin, row) in enumerate(zip(kept, rows, strict=True)):
            writer.write(index, sets[origin.source][origin.index].signal, row)
            if progress is not None:
                progress(index + 1, len(kept))
        writer.finish()


def merged_text(summary: MergeSummary) -> str:
    """A summary in lines."""
    parts = ", ".join(f"{count} of {name}" for name, count in summary.sources.items())
    lines = [
        f"{summary.path}: {summary.n_records} records ({parts}), {summary.n_groups} group(s)",
    ]
    if summary.n_dropped:
        lines.append(f"  {summary.n_dropped} duplicate(s) dropped")
    if summary.n_joined:
        lines.append(f"  {summary.n_joined} group(s) joined: they hold a signal of another")
    lines += [
        f"  {column} is unknown in {listed(list(lacking))}"
        for column, lacking in summary.filled.items()
    ]
    return "\n".join([*lines, "  stored splits are left out: wearstate splits --defaults"])
