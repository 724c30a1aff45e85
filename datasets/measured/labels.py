"""Labels of measured files, from a CSV file or one value for all; and wear limits."""

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath

from ...sim.output.recording import DataError
from ...sim.parts.units import to_si
from ...sim.scene.load import load_scene
from ..recipe.severities import clearances, wear_limits
from .label_columns import (
    GRADE,
    GROUP,
    HIGHEST_GRADE,
    ROW,
    Value,
    columns_of,
    condition_faults,
    pressure_faults,
    severities_in,
)
from .label_table import LabelTable, listed, read_label_table, refusal


@dataclass(frozen=True, kw_only=True)
class Labels:
    """Labels by file.

    Attributes
    ----------
    source : str
        File of the labels, for messages; empty if all are constants.
    entries : tuple of str
        File entry of each row; empty without a table.
    lines : tuple of int
        Line of each row in its file.
    rows : tuple of int, optional
        Row number within its file for each row of the table, if rows are records.
    columns : mapping
        Values of each row, by name.
    constants : mapping
        Value for all files, by name.
    severities : tuple of str
        Columns that hold the wear of a machine [m].
    """

    source: str = ""
    entries: tuple[str, ...] = ()
    lines: tuple[int, ...] = ()
    rows: tuple[int, ...] | None = None
    columns: Mapping[str, tuple[Value, ...]]
    constants: Mapping[str, Value]
    severities: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All labels, severities first."""
        rest = [n for n in (*self.columns, *self.constants) if n not in self.severities]
        return (*self.severities, *rest)

    def numpy_types(self) -> dict[str, str]:
        """Manifest columns with their types; group and grade are stored separately."""
        return {
            name: _numpy_type(self.columns.get(name) or (self.constants[name],))
            for name in self.names
            if name not in (GROUP, GRADE)
        }

    def of_files(self, paths: Sequence[Path]) -> tuple[list[dict[str, Value]], int]:
        """Labels of each file.

        Parameters
        ----------
        paths : sequence of Path
            Absolute paths. A row applies to the file whose path ends in the row's entry.

        Returns
        -------
        rows : list of dict
            Values by name, for each file.
        unused : int
            Number of rows about files that are not among `paths`.

        Raises
        ------
        DataError
            If a file has no row or several, or a row matches several files; all at once.
        """
        if not self.source:
            return [dict(self.constants) for _ in paths], 0
        found = _matches(self.entries, paths)
        faults = [*self._ambiguous(found, paths), *self._missing_or_twice(found, paths)]
        if faults:
            raise refusal([f"{self.source}: {fault}" for fault in faults])
        row_of = {files[0]: row for row, files in enumerate(found) if files}
        rows = [self._row(row_of[i]) for i in range(len(paths))]
        return rows, sum(not files for files in found)

    def of_rows(
        self, paths: Sequence[Path], counts: Sequence[int]
    ) -> tuple[list[dict[str, Value]], int]:
        """Labels of each row of each file, one file after the other.

        Parameters
        ----------
        paths : sequence of Path
            Absolute paths.
        counts : sequence of int
            Number of rows of each file.

        Returns
        -------
        rows : list of dict
            Values by name, for each row of each file.
        unused : int
            Number of rows of the table about other files.

        Raises
        ------
        DataError
            As for :meth:`of_files`, about rows.
        """
        found = _matches(self.entries, paths)
        faults = self._ambiguous(found, paths)
        places: dict[tuple[int, int], int] = {}
        for place, (files, row) in enumerate(zip(found, self.rows or (), strict=True)):
            for i in files:
                line, name = self.lines[place], paths[i].name
                if row >= counts[i]:
                    faults.append(
                        f"line {line}: {ROW} = {row} must be < {counts[i]}, the rows of {name} "
                        "that are records; correct it, or give rows"
                    )
                elif (i, row) in places:
                    earlier = self.lines[places[i, row]]
                    faults.append(
                        f"lines {earlier}, {line} are all about row {row} of {name}, must be one; "
                        "remove the others"
                    )
                places.setdefault((i, row), place)
        wanted = [(i, row) for i, count in enumerate(counts) for row in range(count)]
        missing = [f"{paths[i].name} {row}" for i, row in wanted if (i, row) not in places]
        if missing:
            faults.append(f"has no row for {len(missing)} record(s), {listed(missing)}; add one")
        if faults:
            raise refusal([f"{self.source}: {fault}" for fault in faults])
        rows = [self._row(places[key]) for key in wanted]
        return rows, sum(not files for files in found)

    def _row(self, place: int) -> dict[str, Value]:
        return {**{name: self.columns[name][place] for name in self.columns}, **self.constants}

    def _ambiguous(self, found: Sequence[Sequence[int]], paths: Sequence[Path]) -> list[str]:
        return [
            f"line {line}: file '{entry}' fits {listed([str(paths[i]) for i in files])}, must fit "
            "one; write more of its path"
            for entry, line, files in zip(self.entries, self.lines, found, strict=True)
            if len(files) > 1
        ]

    def _missing_or_twice(self, found: Sequence[Sequence[int]], paths: Sequence[Path]) -> list[str]:
        lines: dict[int, list[int]] = {i: [] for i in range(len(paths))}
        for line, files in zip(self.lines, found, strict=True):
            for i in files:
                lines[i].append(line)
        faults = [
            f"lines {', '.join(map(str, here))} are all about {paths[i]}, must be one; remove "
            "the others"
            for i, here in lines.items()
            if len(here) > 1
        ]
        missing = [paths[i].name for i, here in lines.items() if not here]
        if missing:
            close = difflib.get_close_matches(missing[0], self.entries, n=1)
            hint = f"; is {close[0]!r} meant for {missing[0]}?" if close else ""
            faults.append(
                f"has no row for {len(missing)} file(s), {listed(missing)}; add one{hint}"
            )
        return faults


def _matches(entries: Sequence[str], paths: Sequence[Path]) -> list[list[int]]:
    """Files that each entry matches: their path ends in the parts of the entry."""
    by_name: dict[str, list[int]] = {}
    for i, path in enumerate(paths):
        by_name.setdefault(path.name, []).append(i)
    found = []
    for entry in entries:
        parts = PurePosixPath(entry.replace("\\", "/")).parts
        close = by_name.get(parts[-1], []) if parts else []
        found.append([i for i in close if paths[i].parts[-len(parts) :] == parts])
    return found


def _numpy_type(values: Sequence[Value]) -> str:
    if isinstance(values[0], str):
        return f"S{max(1, *(len(str(value).encode()) for value in values))}"
    return "?" if isinstance(values[0], bool) else "<f8"


# --- reading ------------------------------------------------------------------------------------


def read_labels(
    path: str | Path | None = None,
    constants: Mapping[str, str] | None = None,
    severities: Sequence[str] = (),
) -> Labels:
    r"""Read labels from a CSV file, from constants, or both.

    Parameters
    ----------
    path : str or Path, optional
        Table with a header; its column ``file`` holds file names, or as much of their paths as is
        needed to distinguish them. Comma, semicolon or tab; a decimal comma unless commas separate.
        A column ``row_in_file`` labels single rows of files whose rows are records, from 0.
    constants : mapping, optional
        Texts by label, the same for all files.
    severities : sequence of str
        Labels that hold the wear of a machine, in addition to those known from recipes; models are
        trained for the first one by default.

    Returns
    -------
    Labels
        Numbers in SI, texts unchanged. A name ends in the SI unit (``speed_hz``); a unit in the
        heading (``speed [rpm]``) or after the number is converted, and one in the heading adds the
        ending to the name. ``grade`` (0 to 3) and ``group`` (the machine) are known by name;
        ``confounder_`` begins a column of 0 and 1. An empty cell means unknown.

    Raises
    ------
    DataError
        If the table cannot be read or a value does not fit its name; all faults at once.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "labels.csv"
    ...     _ = file.write_text("file,scar_depth_bearing [um],fault\na.wav,40,outer\n")
    ...     labels = read_labels(file, {"speed_hz": "1500 rpm"})
    >>> labels.severities, labels.columns["fault"], labels.constants["speed_hz"]
    (('scar_depth_bearing_m',), ('outer',), 25.0)
    """
    faults: list[str] = []
    table = LabelTable() if path is None else read_label_table(Path(path), faults)
    rows = _row_numbers(table, faults)
    given = {name: [text] for name, text in (constants or {}).items()}
    columns = columns_of(table.columns, table.comma, table.place, faults)
    fixed = columns_of(given, False, lambda _: "label", faults)
    faults += [
        f"label {name} is also a column of {table.source}, must be one of them; leave one out"
        for name in fixed
        if name in columns
    ]
    faults += condition_faults(columns, table.place)
    faults += condition_faults(fixed, lambda _: "label")
    faults += pressure_faults(columns, fixed, table.place)
    found = severities_in({**columns, **fixed}, severities, faults)
    if faults:
        raise refusal(faults)
    return Labels(
        source=table.source,
        entries=tuple(table.entries),
        lines=tuple(table.lines),
        rows=rows,
        columns=columns,
        constants={name: values[0] for name, values in fixed.items()},
        severities=found,
    )


def _row_numbers(table: "LabelTable", faults: list[str]) -> tuple[int, ...] | None:
    """Row numbers in the files that a table labels, or None if it has no such column."""
    cells = table.columns.pop(ROW, None)
    if cells is None:
        return None
    wrong = [i for i, cell in enumerate(cells) if not re.fullmatch("[0-9]{1,9}", cell)]
    faults += [
        f"{table.place(i)}: {ROW} = {cells[i]!r} must be a whole number >= 0, the first row being "
        "0; correct it"
        for i in wrong
    ]
    return tuple(0 if i in wrong else int(cell) for i, cell in enumerate(cells))


# --- limits -------------------------------------------------------------------------------------

MOST_WEAR = 20.0
"""Wear over the condemning limit that no joint reaches. Millimetres taken for metres give 100 or
more: new bearings have a tenth of their limit."""


@dataclass(frozen=True, kw_only=True)
class LabelLimits:
    """Wear limits of a severity.

    Attributes
    ----------
    edges : tuple of float
        Severities at which grades 1, 2, 3 begin [m], rising; the last one condemns.
    source : str
        Source of the limits.
    """

    edges: tuple[float, ...]
    source: str


def read_limits(text: str, severities: Sequence[str]) -> LabelLimits:
    """Read wear limits as given by the user.

    Parameters
    ----------
    text : str
        Three lengths separated by commas, or a scene (built-in name or file) that has limits for
        the severity.
    severities : sequence of str
        Severities of the labels; limits are those of the first.

    Raises
    ------
    DataError
        If there is no severity, the text is not three rising lengths, or the scene has no such
        limits.
    SceneError
        If there is no such scene.

    Examples
    --------
    >>> read_limits("0.13 mm, 0.22 mm, 0.31 mm", ["diametral_clearance_crankpin_m"]).edges
    (0.00013, 0.00022, 0.00031)
    >>> read_limits("bilge-pump", ["diametral_clearance_crankpin_m"]).edges[-1]
    0.00031
    """
    if not severities:
        raise DataError(
            f"limits = {text!r} must be about a severity, the labels have none; label the wear in "
            "metres and name that label with severity"
        )
    if "," in text:
        return LabelLimits(edges=_edges(text), source="given on import")
    scene = load_scene(text)
    found = wear_limits(scene, severities[0])
    if found is None:
        own = [name for name in clearances(scene) if wear_limits(scene, name) is not None]
        raise DataError(
            f"scene {text} has no wear limits of {severities[0]}, it has those of "
            f"{listed(own) or 'none'}; name the label so, or give lengths like "
            "'0.13 mm, 0.22 mm, 0.31 mm'"
        )
    return LabelLimits(edges=tuple(found.grade_edges), source=found.source)


def _edges(text: str) -> tuple[float, ...]:
    try:
        edges = tuple(to_si(part.strip(), "length") for part in text.split(","))
    except ValueError as error:
        raise DataError(f"limits = {text!r}: a length {error}") from None
    rising = all(low < high for low, high in pairwise((0.0, *edges)))
    if len(edges) != HIGHEST_GRADE or not rising or not math.isfinite(edges[-1]):
        raise DataError(
            f"limits = {text!r} must be {HIGHEST_GRADE} lengths > 0 that rise: where grades 1, 2 "
            "and 3 begin; correct them"
        )
    return edges
