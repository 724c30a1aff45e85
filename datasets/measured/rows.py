"""Manifest values of every imported file: labels, conditions, machine and grade."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, Literal

from ...sim.wear.archard import grade
from ..file.machines import FILE, GROUP_NAME
from .label_columns import GRADE, GROUP, ROW, Value
from .label_table import refusal
from .labels import MOST_WEAR, LabelLimits, Labels
from .plan import Header

GroupBy = Literal["file", "folder", "column"]

START, MEAN_SPEED = "start_s", "mean_speed_hz"

_LARGEST_GROUP = 2**63 - 1  # of the manifest's integers


@dataclass(frozen=True, kw_only=True)
class FileRows:
    """Manifest values by file, or by row of a file if rows are labelled.

    Attributes
    ----------
    columns : mapping
        Columns in addition to those of every data set, with numpy types, in order.
    rows : mapping
        Values by name and row of a file; only start and speed of a record are missing.
    unused : int
        Number of label rows about other files.
    """

    columns: Mapping[str, str]
    rows: Mapping[tuple[str, int], Mapping[str, Any]]
    unused: int


def file_rows(
    headers: Sequence[Header],
    labels: Labels,
    *,
    limits: LabelLimits | None = None,
    group_by: GroupBy | None = None,
    tacho: str | None = None,
) -> FileRows:
    """Combine labels and declarations of files.

    Parameters
    ----------
    headers : sequence of Header
        Headers of the files, sorted.
    labels : Labels
        Labels of these files, and possibly of others.
    limits : Limits, optional
        Limits of the first severity; they determine the grade.
    group_by : {"file", "folder", "column"}, optional
        As for :func:`~.measured.data_set.import_recordings`.
    tacho : str, optional
        Name of the tacho channel: if given, the speed it shows is a column.

    Raises
    ------
    DataError
        If a file has no labels or contradicts them, the grade contradicts the limits, or labels
        required by grouping or limits are missing; all at once.
    """
    places = [(header.name, row) for header in headers for row in range(header.n_records)]
    given, unused = _labelled(headers, labels)
    headers = [header for header in headers for _ in range(header.n_records)]
    faults: list[str] = []
    names = _group_names(headers, given, labels, group_by, faults)
    grades = _grades(headers, given, labels, limits, faults)
    declared = _conditions(headers, given, faults)
    if faults:
        raise refusal(list(dict.fromkeys(faults)))
    numbers = _numbers(names)
    rows = {
        place: {
            **{name: value for name, value in own.items() if name not in (GROUP, GRADE)},
            **declared[i],
            FILE: headers[i].name,
            GROUP_NAME: names[i],
            "group": numbers[names[i]],
            "grade": grades[i],
        }
        for i, (place, own) in enumerate(zip(places, given, strict=True))
    }
    columns = {
        FILE: _text_type([header.name for header in headers]),
        GROUP_NAME: _text_type(names),
        START: "<f8",
        **({ROW: "<i8"} if any(header.n_records > 1 for header in headers) else {}),
        **labels.numpy_types(),
        **dict.fromkeys(sorted({name for own in declared for name in own}), "<f8"),
        **({MEAN_SPEED: "<f8"} if tacho is not None else {}),
    }
    return FileRows(columns=columns, rows=rows, unused=unused)


def _labelled(headers: Sequence[Header], labels: Labels) -> tuple[list[Mapping[str, Value]], int]:
    """Labels of every row that is a record; labels of a file apply to all its rows."""
    paths, counts = [header.path for header in headers], [header.n_records for header in headers]
    if labels.rows is not None:
        rows, unused = labels.of_rows(paths, counts)
        return list(rows), unused
    files, unused = labels.of_files(paths)
    return [own for own, count in zip(files, counts, strict=True) for _ in range(count)], unused


def _text_type(texts: Sequence[str]) -> str:
    return f"S{max(len(text.encode()) for text in texts)}"


# --- groups -------------------------------------------------------------------------------------


def _group_names(
    headers: Sequence[Header],
    given: Sequence[Mapping[str, Value]],
    labels: Labels,
    group_by: GroupBy | None,
    faults: list[str],
) -> list[str]:
    """Machine of every file."""
    labelled = GROUP in labels.names
    way = group_by or ("column" if labelled else "file")
    if way == "column" and not labelled:
        faults.append(
            f"group_by = 'column' needs the label '{GROUP}', given are "
            f"{', '.join(labels.names) or 'none'}; add it, or group by file or folder"
        )
    elif way == "column":
        return [str(own[GROUP]) for own in given]
    elif way == "folder":
        return [PurePosixPath(header.name).parent.as_posix() for header in headers]
    return [header.name for header in headers]


def _numbers(names: Sequence[str]) -> dict[str, int]:
    """Number of every group: its name if all names are numbers, or else its position."""
    distinct = sorted(set(names))
    plain = all(name.isascii() and name.isdecimal() for name in distinct)
    own = {name: int(name) for name in distinct} if plain else {}
    if plain and len(set(own.values())) == len(own) and max(own.values()) <= _LARGEST_GROUP:
        return own
    return {name: number for number, name in enumerate(distinct)}


# --- grades and conditions ----------------------------------------------------------------------


def _grades(
    headers: Sequence[Header],
    given: Sequence[Mapping[str, Value]],
    labels: Labels,
    limits: LabelLimits | None,
    faults: list[str],
) -> list[int]:
    """Grade by the limits, or as labelled; -1 if neither is known."""
    labelled = [int(own.get(GRADE, -1)) for own in given]
    if limits is None:
        return labelled
    if not labels.severities:
        faults.append(
            f"limits must be about a severity, the labels have none: "
            f"{', '.join(labels.names) or 'no label'}; label the wear in metres and name that "
            "label with severity"
        )
        return labelled
    column = labels.severities[0]
    faults.extend(_unit_faults(headers, column, [float(own[column]) for own in given], limits))
    found = [_grade(own[column], limits) for own in given]
    for header, by_limits, by_label in zip(headers, found, labelled, strict=True):
        if by_label >= 0 and by_limits >= 0 and by_label != by_limits:
            faults.append(
                f"{header.name}: grade = {by_label} must be {by_limits} by {column} and the "
                "limits; correct the label, or leave grade or limits out"
            )
    return [a if a >= 0 else b for a, b in zip(found, labelled, strict=True)]


def _unit_faults(
    headers: Sequence[Header], column: str, values: Sequence[float], limits: LabelLimits
) -> list[str]:
    """A sentence on wear far beyond the condemning limit, as of labels in millimetres."""
    condemning = limits.edges[-1]
    wrong = [
        (header.name, value)
        for header, value in zip(headers, values, strict=True)
        if value > MOST_WEAR * condemning
    ]
    if not wrong:
        return []
    first, value = wrong[0]
    more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
    return [
        f"{first}{more}: {column} = {value:g} m must be at most {MOST_WEAR:g} times the condemning "
        f"limit, {condemning:g} m; labels are in metres unless the heading of their column names "
        f"another unit, as in '{column.removesuffix('_m')} [mm]'"
    ]


def _grade(severity: Value, limits: LabelLimits) -> int:
    value = float(severity)
    return -1 if math.isnan(value) else grade(value, limits.edges)


def _conditions(
    headers: Sequence[Header], given: Sequence[Mapping[str, Value]], faults: list[str]
) -> list[dict[str, float]]:
    """Conditions declared by files; a label may repeat one, but not contradict it."""
    for header, own in zip(headers, given, strict=True):
        for name, value in header.conditions.items():
            label = own.get(name, math.nan)
            known = not (isinstance(label, float) and math.isnan(label))
            if known and not (
                isinstance(label, float) and math.isclose(label, value, rel_tol=1e-6)
            ):
                faults.append(
                    f"{header.name}: label {name} = {label} must be {value:.10g}, as the file "
                    "declares; correct the label, or leave it out"
                )
    return [dict(header.conditions) for header in headers]
