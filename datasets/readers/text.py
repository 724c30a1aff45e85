"""CSV, TSV and other columns of numbers, read in pieces through an index of their lines."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ...sim.parts.units import UNITS
from ...sim.parts.wording import nearest
from ..file.csv_cells import plain_cell
from ..source.channel_units import known_unit
from ..source.clock import is_stamp, is_stamp_pattern, months_first, stamp_resolution, stamp_seconds
from ..source.number_notation import unknown_notation
from ..source.part import MOST_CHANNELS, MOST_ROWS, Contents, FilePart, PartChannel, SourceOptions
from ..source.time_column import even_rate, printed_resolution
from .flat import numbered, stem_of
from .text_dialect import (
    BYTES,
    NUMBER_TEXT,
    SAMPLE_LINES,
    Dialect,
    byte_order_mark,
    dialect_of,
    head_of,
    header_words,
    split_cells,
)
from .text_lines import LONGEST_ROW, Lines, index_lines

_HEAD = 2**18  # byte, examined for header and separators

_FEWEST_ROWS = 3  # needed for the detection, with or without header

_TIME_NAME = re.compile(r"(?:time|t|zeit|timestamp)(?:_(s|ms|us))?", re.IGNORECASE)
_UNIT_BEHIND = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")


def text_contents(path: Path, options: SourceOptions) -> Contents:
    """Columns of numbers with or without a header.

    Separators, decimal mark, header, units ("acc [g]") and the time column are detected if only one
    reading is possible; otherwise an error asks for them. Columns of words are left out; numbers in
    an unknown notation are reported, and refused if they are requested.

    Raises
    ------
    DataError
        If it is binary or empty, has no or several readings, lines of different length, a cell that
        is not a number, or uneven times.
    """
    records = options.rows is not None
    head = head_of(path, LONGEST_ROW if records else _HEAD)
    lines = head.split("\n")
    if records:  # long ones: a few show the layout
        fits = np.cumsum([len(line) for line in lines]) <= _HEAD
        lines = lines[: max(_FEWEST_ROWS, int(np.count_nonzero(fits)))]
    dialect = dialect_of(path, lines, options)
    columns = _columns(path, lines, dialect, options)
    begin = len("\n".join(lines[: dialect.first]).encode(BYTES)) + (dialect.first > 0)
    begin += byte_order_mark(path)
    index = index_lines(path, begin, dialect.first, records=records)
    table = TextTable(lines=index, dialect=dialect)
    if records:
        return _line_records(path, table, options)
    time = _time_column(path, columns, _stamp_columns(table), options)
    rate, doubt, note = _rate(path, table, columns, time, options)
    kept = [c for c in dialect.numeric if c != time]
    if not kept:
        raise DataError(f"{path} has no column of numbers besides the time; add one")
    if len(kept) > MOST_CHANNELS:
        raise DataError(f"{path} has {len(kept)} columns, must have <= {MOST_CHANNELS}; split it")
    named = any(column.named for column in columns)
    part = FilePart(
        name="",
        about=f"({len(kept)}, {index.count})",
        channels=tuple(PartChannel(name=columns[c].name, unit=columns[c].unit) for c in kept),
        named=named,
        n_samples=index.count,
        fetch=partial(_fetch, table, kept),
        sample_rate=rate,
        rate_doubt=doubt,
        rate_note=note,
        extras=() if time is None else (columns[time].name,),
        unread=_unread(table, columns, time),
    )
    words = [c.name for i, c in enumerate(columns) if i not in dialect.numeric]
    return Contents(parts=(part,), others=tuple(words))


def _unread(table: "TextTable", columns: Sequence["_Column"], time: int | None) -> dict[str, str]:
    """Columns whose last cells are numbers in an unsupported notation, and the cure."""
    first = max(0, table.lines.count - SAMPLE_LINES)
    found = {}
    for index, column in enumerate(columns):
        if index in table.dialect.numeric or index == time:
            continue
        known = unknown_notation(table.cells(first, table.lines.count, index))
        if known:
            cell, kind, cure = known
            found[column.name] = (
                f"column {column.name!r} holds {cell!r}, {kind}, which is not read; {cure}, or "
                "choose channels without it"
            )
    return found


def _line_records(path: Path, table: "TextTable", options: SourceOptions) -> Contents:
    """Lines as recordings of one channel; columns of words are left out."""
    if options.time_column:
        raise DataError(
            f"{path}: time_column = {options.time_column!r} must not be given with rows = "
            f"{options.rows}; leave it out"
        )
    columns, count = table.dialect.numeric, table.lines.count
    if count > MOST_ROWS:
        raise DataError(f"{path} has {count} rows, must have <= {MOST_ROWS}; split it")

    def fetch(start: int, stop: int, rows: tuple[int, ...]) -> NDArray[Any]:
        wanted = columns[start:stop]
        return np.stack([table.read(row, row + 1, wanted)[:, 0] for row in rows])

    part = FilePart(
        name="",
        about=f"({count}, {len(columns)})",
        channels=numbered(stem_of(path), count),
        named=False,
        n_samples=len(columns),
        fetch=fetch,
    )
    return Contents(parts=(part,))


# --- names and units


@dataclass(frozen=True, kw_only=True)
class _Column:
    name: str
    unit: str | None
    named: bool


def _columns(
    path: Path, lines: list[str], dialect: Dialect, options: SourceOptions
) -> list[_Column]:
    """Name and unit of every column, from the last one or two header lines."""
    del path, options
    above = [i for i in range(dialect.first) if lines[i].strip(" \t\r")]
    alone = dialect.n_columns == 1  # then a blank belongs to the name
    rows = [
        [
            plain_cell(header_words(cell).strip())
            for cell in split_cells(lines[i].lstrip("#%"), "\n" if alone else dialect.delimiter)
        ]
        for i in above[-2:]
    ]
    rows = [row for row in rows if len(row) == dialect.n_columns]
    if not rows:
        return [
            _Column(name=f"column_{i + 1}", unit=None, named=False)
            for i in range(dialect.n_columns)
        ]
    units = _unit_row(rows[-1]) if len(rows) == 2 else None
    names = rows[0] if units is not None else rows[-1]
    found = [_named(cell, i) for i, cell in enumerate(names)]
    if units is None:
        return found
    return [
        _Column(name=c.name, unit=unit or c.unit, named=True)
        for c, unit in zip(found, units, strict=True)
    ]


def _unit_row(cells: Sequence[str]) -> list[str | None] | None:
    """Units in a line that holds nothing else."""
    # a dash is not a unit, as in the cell of a counter
    bare = ["" if text == "-" else text for text in (cell.strip("[]() ") for cell in cells)]
    if not any(bare) or not all(_is_unit(cell) for cell in bare if cell):
        return None
    return [cell or None for cell in bare]


def _is_unit(text: str) -> bool:
    return text in UNITS["time"] or known_unit(text) or is_stamp_pattern(text)


def _named(cell: str, index: int) -> _Column:
    match = _UNIT_BEHIND.fullmatch(cell)
    name, unit = cell, None
    if match is not None:
        square, round_ = match.group(2), match.group(3)
        # round brackets may be part of the name
        if square is not None or (round_ is not None and _is_unit(round_.strip())):
            name, unit = match.group(1), (square or round_ or "").strip()
    return _Column(name=name or f"column_{index + 1}", unit=unit or None, named=True)


# --- the time


def _stamp_columns(table: "TextTable") -> list[int]:
    """Columns that begin and end with a time stamp."""
    ends = (0, table.lines.count - 1)
    return [
        column
        for column in range(table.dialect.n_columns)
        if column not in table.dialect.numeric
        and all(is_stamp(table.cells(at, at + 1, column)[0]) for at in ends)
    ]


def _time_column(
    path: Path, columns: Sequence[_Column], stamped: Sequence[int], options: SourceOptions
) -> int | None:
    wanted, names = options.time_column, [column.name for column in columns]
    if wanted == 0:
        return None
    if isinstance(wanted, int):
        if wanted > len(names):
            raise DataError(
                f"{path}: time_column = {wanted} must be <= {len(names)}, its columns; correct it"
            )
        return wanted - 1
    if wanted is not None:
        if wanted not in names:
            raise DataError(
                f"{path}: time_column = {wanted!r} is no column{nearest(wanted, names)}"
            )
        return names.index(wanted)
    found = [i for i, c in enumerate(columns) if c.named and _TIME_NAME.fullmatch(c.name)]
    # if date and time have separate columns, the latter is so named
    found = found if len(found) == 1 else list(stamped)
    return found[0] if len(found) == 1 else None


def _rate(
    path: Path,
    table: "TextTable",
    columns: Sequence[_Column],
    time: int | None,
    options: SourceOptions,
) -> tuple[float | None, float, str]:
    """Sample rate, its relative uncertainty, and why there is none."""
    if time is None:
        return None, 0.0, ""
    column = columns[time]
    if time not in table.dialect.numeric:
        return *_stamped_rate(path, table, column, time, options), ""
    tail = table.cells(max(0, table.lines.count - SAMPLE_LINES), table.lines.count, time)
    clock = even_rate(
        path,
        column.name,
        lambda start, stop: table.read(start, stop, (time,))[0],
        table.lines.count,
        printed_resolution(tail),
        place=partial(_place, table, time),
    )
    match = _TIME_NAME.fullmatch(column.name)
    # a unit for all other channels does not apply to the times
    named = isinstance(options.unit, Mapping) and column.name in list(options.unit)
    given = options.per_channel("unit", column.name) if named else None
    unit = given or column.unit or (match and match.group(1))
    if unit is None and options.fs is not None:
        _refuse_other_step(path, column.name, clock.step, options.fs)
    if unit is None:
        return None, 0.0, f"column {column.name!r} has no unit; give it one, like 's', or fs"
    if unit not in UNITS["time"]:
        raise DataError(
            f"{path}: unit {unit!r} of column {column.name!r} must be one of "
            f"{', '.join(UNITS['time'])}; correct it"
        )
    return 1.0 / (clock.step * UNITS["time"][unit]), clock.doubt, ""


def _stamped_rate(
    path: Path, table: "TextTable", column: _Column, time: int, options: SourceOptions
) -> tuple[float, float]:
    """Sample rate from time stamps, and its relative uncertainty."""
    if isinstance(options.unit, Mapping) and column.name in list(options.unit):
        raise DataError(
            f"{path}: unit {options.unit[column.name]!r} of column {column.name!r} must not be "
            "given; it holds time stamps; leave it out"
        )

    def refuse(index: int, text: str) -> DataError:
        return DataError(
            f"{path}: column {column.name!r} is {text[:40]!r} in line "
            f"{table.lines.before + index + 1}, must be a number or a time stamp like "
            "'2024-05-01T12:00:00.123' or '12:00:00.123' to give the time; correct it, or give "
            "time_column = 0 and fs"
        )

    count = table.lines.count
    cells = partial(table.cells, column=time)
    [first], [last] = cells(0, 1), cells(count - 1, count)
    month_first = months_first(first, last)
    if month_first is None:
        raise DataError(
            f"{path}: dates of column {column.name!r} can begin with day or month: {first} to "
            f"{last}; write them as 2026-11-23, or give time_column = 0 and fs"
        )
    clock = even_rate(
        path,
        column.name,
        stamp_seconds(cells, refuse, month_first),
        count,
        stamp_resolution(cells(max(0, count - SAMPLE_LINES), count)),
        place=partial(_place, table, time),
    )
    return 1.0 / clock.step, clock.doubt


def _place(table: "TextTable", time: int, index: int) -> str:
    """A time as printed, and its line."""
    [text] = table.cells(index, index + 1, time)
    return f"{text} (line {table.lines.before + index + 1})"


def _refuse_other_step(path: Path, name: str, step: float, fs: float) -> None:
    """Refuse a rate that contradicts times without a unit, in any unit."""
    rates = {unit: 1.0 / (step * factor) for unit, factor in UNITS["time"].items()}
    if any(abs(rate / fs - 1) <= _RATE_DOUBT for rate in rates.values()):
        return
    fitting = ", ".join(f"{rate:.6g} Hz if in {unit}" for unit, rate in rates.items())
    raise DataError(
        f"{path}: fs = {fs:.10g} Hz must fit the times of column {name!r}, whose step {step:.6g} "
        f"means {fitting}; correct fs, or give time_column = 0 if the times are wrong"
    )


_RATE_DOUBT = 0.01  # of a rate against times that may be printed coarsely

# --- the numbers


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """Lines and their layout."""

    lines: Lines
    dialect: Dialect

    def read(self, start: int, stop: int, columns: Sequence[int]) -> NDArray[np.float64]:
        """Numbers of some lines [shape=(n_columns, stop - start)].

        Raises
        ------
        DataError
            If a line has another number of cells, or one that is not a number.
        """
        rows = self.lines.read(start, stop)
        decimal_comma = self.dialect.decimal == ","
        text = [(row.replace(b",", b".") if decimal_comma else row).decode(BYTES) for row in rows]
        try:
            _refuse_widths(text, self.dialect)
            numbers = np.loadtxt(
                text,
                delimiter=None if self.dialect.delimiter == " " else self.dialect.delimiter,
                usecols=tuple(columns),
                comments=None,
                quotechar='"',
                ndmin=2,
            )
        except ValueError:
            raise self._fault(text, start, columns) from None
        if len(numbers) != len(text):
            raise self._fault(text, start, columns)
        return np.asarray(numbers.T, dtype=np.float64)

    def cells(self, start: int, stop: int, column: int) -> list[str]:
        """Texts of one column.

        Raises
        ------
        DataError
            If a line has another number of cells.
        """
        text = [row.decode(BYTES) for row in self.lines.read(start, stop)]
        rows = [split_cells(line, self.dialect.delimiter) for line in text]
        if len(rows) != stop - start or any(len(row) != self.dialect.n_columns for row in rows):
            raise self._fault(text, start, ())
        return [row[column] for row in rows]

    def _fault(self, text: Sequence[str], start: int, columns: Sequence[int]) -> DataError:
        path, width = self.lines.path, self.dialect.n_columns
        for number, line in enumerate(text, start=self.lines.before + start + 1):
            cells = split_cells(line, self.dialect.delimiter)
            if len(cells) != width:
                return DataError(
                    f"{path}: line {number} has {len(cells)} cell(s), must have {width}; correct it"
                )
            for column in columns:
                if not NUMBER_TEXT.fullmatch(cells[column]):
                    return DataError(
                        f"{path}: column {column + 1} of line {number} is {cells[column][:40]!r}, "
                        "must be a number; correct it"
                    )
        first = self.lines.before + start + 1
        last = first + len(text) - 1
        return DataError(f"{path}: lines {first} to {last} cannot be read; correct them")


def _refuse_widths(text: Sequence[str], dialect: Dialect) -> None:
    """Refuse lines that are too long, which would go unnoticed if only some columns are read."""
    if not all(line.strip() for line in text):  # if skipped, all following lines would shift
        raise ValueError
    if dialect.delimiter == " ":
        bad = any(len(line.split()) != dialect.n_columns for line in text)
    elif any('"' in line for line in text):
        bad = any(len(split_cells(line, dialect.delimiter)) != dialect.n_columns for line in text)
    else:
        bad = any(line.count(dialect.delimiter) != dialect.n_columns - 1 for line in text)
    if bad:
        raise ValueError


def _fetch(
    table: TextTable, kept: Sequence[int], start: int, stop: int, rows: tuple[int, ...]
) -> NDArray[Any]:
    return table.read(start, stop, [kept[row] for row in rows])
