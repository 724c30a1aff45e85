"""CSV, TSV and other columns of numbers, read in pieces by an index of their lines."""

import csv
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
from ..source.part import (
    MOST_CHANNELS,
    MOST_ROWS,
    Contents,
    FilePart,
    PartChannel,
    SourceOptions,
    foreign,
)
from ..source.time_column import even_rate, printed_resolution
from .flat import numbered, stem_of

BLOCK = 4096
"""Lines between two places of the index."""

_HEAD = 2**18  # byte, looked at to find header and separators
_LONGEST_LINE = 2**16  # byte
_LONGEST_ROW = 2**23  # byte, where a line is a record
_FEWEST_ROWS = 3  # that are looked at, header or not
_SAMPLE = 64  # lines of numbers that must agree on the layout
_MOST_HEADER = 200  # lines
_PIECE = 2**22  # byte, read at once

_NUMBER = re.compile(
    r"\s*[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?\s*"
    r"|\s*[-+]?(?:nan|inf|infinity)\s*",
    re.IGNORECASE,
)
_COMMA_NUMBER = re.compile(
    r"\s*[-+]?(?:[0-9]+(?:,[0-9]+)?|,[0-9]+)(?:[eE][-+]?[0-9]+)?\s*"
    r"|\s*[-+]?(?:nan|inf|infinity)\s*",
    re.IGNORECASE,
)
_DELIMITERS = {
    "comma": ",",
    "semicolon": ";",
    "tab": "\t",
    "\\t": "\t",
    "pipe": "|",
    "space": " ",
    "whitespace": " ",
}
_TIME_NAME = re.compile(r"(?:time|t|zeit|timestamp)(?:_(s|ms|us))?", re.IGNORECASE)
_UNIT_BEHIND = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How a line is cut into numbers.

    Attributes
    ----------
    delimiter : str
        One character; a space stands for any run of blanks.
    decimal : str
        ``.`` or ``,``.
    n_columns : int
        Cells of every line.
    numeric : tuple of int
        Columns that hold numbers.
    first : int
        Index of the first line of numbers.
    """

    delimiter: str
    decimal: str
    n_columns: int
    numeric: tuple[int, ...]
    first: int


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Places of every :data:`BLOCK`-th line of numbers in a file.

    Attributes
    ----------
    path : Path
        The file.
    places : numpy.ndarray
        Of line 0, BLOCK, … and of the end [byte].
    count : int
        Lines.
    before : int
        Lines of the file that precede, for messages.
    block : int
        Lines between two places.
    """

    path: Path
    places: NDArray[np.int64]
    count: int
    before: int
    block: int = BLOCK

    def read(self, start: int, stop: int) -> list[bytes]:
        """Lines [start, stop), fewer where the file has shrunk."""
        first = start // self.block
        last = min(-(-stop // self.block), len(self.places) - 1)
        with self.path.open("rb") as handle:
            handle.seek(int(self.places[first]))
            raw = handle.read(int(self.places[last] - self.places[first]))
        return raw.split(b"\n")[start - first * self.block : stop - first * self.block]


def index_lines(
    path: Path, begin: int, before: int, end: int | None = None, *, records: bool = False
) -> Lines:
    """Index the lines of a file from a place on; blank ones at its end are left out.

    Where lines are `records` they are long, and each has its place.

    Raises
    ------
    DataError
        A line is longer than any table's.
    """
    stop = _end_of_text(path, begin) if end is None else end
    block, longest = (1, _LONGEST_ROW) if records else (BLOCK, _LONGEST_LINE)
    places, count, place, last = [begin], 0, begin, begin
    with path.open("rb") as handle:
        handle.seek(begin)
        while place < stop:
            raw = handle.read(min(_PIECE, stop - place))
            if not raw:
                break
            ends = place + 1 + np.flatnonzero(np.frombuffer(raw, dtype=np.uint8) == 10)
            lengths = np.diff(np.concatenate([[last], ends, [place + len(raw)]]))
            _refuse_long(path, before + count, lengths, longest)
            # line k begins where line k - 1 ends
            skip = -(count + 1) % block
            places.extend(ends[skip::block].tolist())
            count += len(ends)
            last = int(ends[-1]) if len(ends) else last
            place += len(raw)
    if last < stop:
        count += 1  # the last line has no end
    if places[-1] == stop and len(places) > 1:
        places.pop()
    return Lines(
        path=path, places=np.array([*places, stop]), count=count, before=before, block=block
    )


def _refuse_long(path: Path, number: int, lengths: NDArray[np.int64], longest: int) -> None:
    if lengths.max(initial=0) > longest:
        raise DataError(
            f"{path}: a line behind line {number} has more than {longest} byte, the longest "
            "believed; is it text with line feeds, or are its rows records (rows)?"
        )


def _end_of_text(path: Path, begin: int) -> int:
    """Behind the last line that is neither blank nor a comment."""
    end = _end_of_ink(path, begin, path.stat().st_size)
    for _ in range(_MOST_HEADER):
        start = _start_of_comment(path, begin, end)
        if start is None:
            break
        end = _end_of_ink(path, begin, start)
    return end


_COMMENTS = (b"#", b"%")


def _start_of_comment(path: Path, begin: int, end: int) -> int | None:
    """Place of the last line where it is a comment and not the only one."""
    with path.open("rb") as handle:
        place = max(begin, end - _LONGEST_LINE)
        handle.seek(place)
        rest, feed, line = handle.read(end - place).rpartition(b"\n")
    comment = feed and line.lstrip(b" \t").startswith(_COMMENTS)
    return place + len(rest) + 1 if comment else None


def _end_of_ink(path: Path, begin: int, end: int) -> int:
    """Behind the last line before an end that is not blank."""
    with path.open("rb") as handle:
        while end > begin:
            size = min(_PIECE, end - begin)
            handle.seek(end - size)
            kept = len(handle.read(size).rstrip(b" \t\r\n\x1a"))
            if kept:
                return end - size + kept
            end -= size
    return begin


def text_contents(path: Path, options: SourceOptions) -> Contents:
    """Columns of numbers under a header or none.

    Separators, decimal sign, header, units ("acc [g]") and the column of times are found where
    only one reading is possible, and asked for where there are several. Columns that hold words
    are left out; numbers in an unknown notation are named, to be refused where they are wanted.

    Raises
    ------
    DataError
        It is binary, empty, has no or several readings, lines of different length, a cell that is
        no number, or times that are not even.
    """
    records = options.rows is not None
    head = _head(path, _LONGEST_ROW if records else _HEAD)
    lines = head.split("\n")
    if records:  # long ones: a few tell the layout
        fits = np.cumsum([len(line) for line in lines]) <= _HEAD
        lines = lines[: max(_FEWEST_ROWS, int(np.count_nonzero(fits)))]
    dialect = _dialect(path, lines, options)
    columns = _columns(path, lines, dialect, options)
    begin = len("\n".join(lines[: dialect.first]).encode(_BYTES)) + (dialect.first > 0)
    begin += _bom(path)
    index = index_lines(path, begin, dialect.first, records=records)
    table = TextTable(lines=index, dialect=dialect)
    if records:
        return _line_records(path, table, options)
    time = _time_column(path, columns, _stamp_columns(table), options)
    rate, doubt, note = _rate(path, table, columns, time, options)
    kept = [c for c in dialect.numeric if c != time]
    if not kept:
        raise DataError(f"{path} has no column of numbers beside the time; add one")
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
    """Columns whose last cells are numbers in a notation that is not read, and what to do."""
    first = max(0, table.lines.count - _SAMPLE)
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
    """Lines as recordings of one channel; columns that hold words are left out."""
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


# --- the head


_BYTES = "latin-1"  # every byte is a character: nothing is lost, nothing fails


_BOMS = re.compile("(?:\xef\xbb\xbf){0,8}")  # some programs put another one before it


def _bom(path: Path) -> int:
    with path.open("rb") as handle:
        return _boms(handle.read(24).decode(_BYTES))


def _boms(text: str) -> int:
    """Byte of the marks that a text begins with."""
    match = _BOMS.match(text)
    return match.end() if match else 0


def _head(path: Path, size: int) -> str:
    """First lines, one character a byte; the last one is whole or left out."""
    with path.open("rb") as handle:
        raw = handle.read(size)
        whole = not handle.read(1)
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        code = "UTF-32" if raw[2:4] == b"\0\0" else "UTF-16"
        raise DataError(f"{path} is {code}, must be UTF-8 or ASCII; save it as CSV UTF-8")
    if re.search(rb"\r[^\n]", raw):
        raise DataError(
            f"{path} ends lines by CR alone, must be LF or CR LF; save it with other line ends"
        )
    if b"\0" in raw or _looks_binary(raw):
        raise foreign(path, "text")
    text = raw.decode(_BYTES)
    text = text[_boms(text) :]
    if not whole:
        text = text.rpartition("\n")[0]
    if not text.strip():
        raise DataError(f"{path} has no line that ends within {size} byte, must have; check it")
    return _without_comments(text)


def _without_comments(text: str) -> str:
    """Lines up to the last one that is neither blank nor a comment."""
    for _ in range(_MOST_HEADER):
        text = text.rstrip(" \t\r\n\x1a")
        above, feed, line = text.rpartition("\n")
        if not feed or not line.encode(_BYTES).lstrip(b" \t").startswith(_COMMENTS):
            break
        text = above
    return text


def _looks_binary(raw: bytes) -> bool:
    controls = sum(raw[:4096].count(code) for code in range(32) if code not in (9, 10, 13, 26, 12))
    return controls > 0


def _words(text: str) -> str:
    """A header in the encoding it is in: UTF-8, else that of old Windows programs."""
    raw = text.encode(_BYTES)
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace")


def split_cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without quotation marks."""
    line = line.rstrip("\r")
    cells = line.split() if delimiter == " " else line.split(delimiter)
    if '"' in line and delimiter != " ":
        cells = _quoted(line, delimiter)
    return [cell.strip().strip('"') for cell in cells]


def _quoted(line: str, delimiter: str) -> list[str]:
    """Cells of a line whose quotation marks may hold the delimiter."""
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a cell longer than any name
        return line.split(delimiter)


def _dialect(path: Path, lines: list[str], options: SourceOptions) -> Dialect:
    found, broken = [], []
    for delimiter in _delimiters(path, lines, options):
        for decimal in (options.decimal,) if options.decimal else (".", ","):
            try:
                dialect = _tried(path, lines, delimiter, decimal, options)
            except DataError as error:  # of this reading; another may fit
                broken.append(error)
                continue
            if decimal != delimiter and dialect is not None:
                found.append(dialect)
    if not found and broken:
        raise broken[0]
    clean = [d for d in found if len(d.numeric) == d.n_columns] or found
    clean = [d for d in clean if _may_be(lines, d, options)]
    top = min((d.first for d in clean), default=0)
    clean = _distinct(lines, [d for d in clean if d.first == top])
    if len(clean) > 1:
        clean = [d for d in clean if _fits_header(lines, d)] or clean
    if not clean:
        raise DataError(
            f"{path} has no columns of numbers that all of its lines share; give delimiter, "
            "decimal and header, or mend it"
        )
    if len(clean) > 1:
        ways = " or ".join(
            f"{d.n_columns} column(s) by {d.delimiter!r} with decimal {d.decimal!r}" for d in clean
        )
        raise DataError(f"{path} can be read as {ways}; give delimiter or decimal")
    _refuse_broken(path, lines, clean[0], options)
    _refuse_numbered(path, lines, clean[0], options)
    return clean[0]


def _may_be(lines: list[str], dialect: Dialect, options: SourceOptions) -> bool:
    """One column with decimal commas may as well be two, unless a header of one name is there."""
    if options.decimal is not None or dialect.decimal == "." or dialect.n_columns > 1:
        return True
    comma = any("," in line for line in lines[dialect.first :])
    return not comma or (_fits_header(lines, dialect) or _all_pairs(lines[dialect.first :]))


def _all_pairs(lines: list[str]) -> bool:
    """Every line can be read both ways: the error that follows names them."""
    return all(line.count(",") == 1 for line in lines)


def _distinct(lines: list[str], dialects: Sequence[Dialect]) -> list[Dialect]:
    """Readings of which no two give the same numbers."""
    found: dict[str, Dialect] = {}
    for d in dialects:
        cells = [split_cells(line, d.delimiter) for line in lines[d.first :][-_SAMPLE:]]
        numbers = str([[_plain(row[c], d.decimal) for c in d.numeric] for row in cells])
        found.setdefault(numbers, d)
    return list(found.values())


def _plain(cell: str, decimal: str) -> float:
    return float(cell.replace(",", ".") if decimal == "," else cell)


def _fits_header(lines: list[str], dialect: Dialect) -> bool:
    """Whether the line above the numbers has a name for every column, and none left over."""
    above = next((line for line in reversed(lines[: dialect.first]) if line.strip()), "")
    # a comma between names says what commas are for
    clear = not (dialect.decimal == "," and dialect.delimiter == " " and "," in above)
    return clear and len(split_cells(above, dialect.delimiter)) == dialect.n_columns


def _refuse_broken(path: Path, lines: list[str], dialect: Dialect, options: SourceOptions) -> None:
    """A line of numbers that is broken must not pass as the end of the header."""
    if options.header is not None:
        return
    for number, line in enumerate(lines[: dialect.first], start=1):
        if line.lstrip().startswith(("#", "%")):
            continue
        cells = [cell for cell in split_cells(line, dialect.delimiter) if cell]
        count = sum(_is_number(cell, dialect.decimal) for cell in cells)
        if count and 2 * count >= len(cells):
            raise DataError(
                f"{path}: line {number} holds numbers but reads unlike those below line "
                f"{dialect.first}; mend it, or give header, the lines before the numbers"
            )
    for number, line in enumerate(lines[dialect.first :], start=dialect.first + 1):
        cells = split_cells(line, dialect.delimiter)
        for column, cell in enumerate(cells):
            if column not in dialect.numeric and _is_number(cell, dialect.decimal):
                raise DataError(
                    f"{path}: column {column + 1} is {cell!r} in line {number} and no number in "
                    f"line {len(lines)}, must be one kind; mend it"
                )


def _refuse_numbered(
    path: Path, lines: list[str], dialect: Dialect, options: SourceOptions
) -> None:
    """A first line that counts the columns may name them, or be the first sample."""
    if options.header is not None or options.rows or dialect.first or dialect.n_columns < 2:
        return
    cells = [split_cells(line, dialect.delimiter) for line in lines[:_SAMPLE]]
    counted = [[str(i + k) for i in range(dialect.n_columns)] for k in (0, 1)]
    if cells[0] not in counted or len(cells) < 4:
        return
    if all(re.fullmatch(r"[-+]?\d+", cell) for cell in cells[1]):
        return  # whole numbers like those below
    steps = np.diff([_plain(row[0], dialect.decimal) for row in cells[:4]])
    if steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-3):
        return  # times that go on from the first line
    told = dialect.delimiter.join(cells[0])[:40]
    raise DataError(
        f"{path}: line 1, {told!r}, may name the columns by number or be a sample; give header, "
        "the lines before the numbers: 1 or 0"
    )


def _delimiters(path: Path, lines: list[str], options: SourceOptions) -> Sequence[str]:
    if options.delimiter is not None:
        delimiter = _DELIMITERS.get(options.delimiter, options.delimiter)
        if len(delimiter) != 1 or delimiter in '"\n\r.+-0123456789eE':
            raise DataError(
                f"{path}: delimiter = {options.delimiter!r} must be one character or one of "
                f"{', '.join(_DELIMITERS)}; correct it"
            )
        return (delimiter,)
    tail = "\n".join(lines[-_SAMPLE:])
    # blanks separate only where nothing clearer does
    return [d for d in (";", "\t", "|", ",") if d in tail] + [" "] * (
        not any(d in tail for d in ";\t|")
    )


def _is_number(cell: str, decimal: str) -> bool:
    return (_NUMBER if decimal == "." else _COMMA_NUMBER).fullmatch(cell) is not None


def _tried(
    path: Path, lines: list[str], delimiter: str, decimal: str, options: SourceOptions
) -> Dialect | None:
    """One reading, where the last lines of the head share it."""
    begin = 0 if options.header is None else options.header
    if begin >= len(lines):
        raise DataError(
            f"{path}: header = {begin} lines must be < {len(lines)}, its lines; correct it"
        )
    tail = [split_cells(line, delimiter) for line in lines[max(begin, len(lines) - _SAMPLE) :]]
    width = len(tail[-1])
    same = [cells for cells in tail if len(cells) == width]
    flags = np.array([[_is_number(cell, decimal) for cell in cells] for cells in same])
    # words may be a header that is still within the sample; the last line decides
    numeric = tuple(np.flatnonzero(flags[-1]).tolist())
    if not numeric:
        return None
    first = begin
    if options.header is None:
        first = _first_line(path, lines, delimiter, decimal, width, numeric)
    return Dialect(
        delimiter=delimiter, decimal=decimal, n_columns=width, numeric=numeric, first=first
    )


def _first_line(
    path: Path, lines: list[str], delimiter: str, decimal: str, width: int, numeric: Sequence[int]
) -> int:
    """Index of the first line of numbers, upwards from the last one of the head."""
    first = len(lines)
    while first > 0:
        cells = split_cells(lines[first - 1], delimiter)
        if len(cells) != width or not all(_is_number(cells[c], decimal) for c in numeric):
            break
        first -= 1
    if first > _MOST_HEADER:
        raise DataError(
            f"{path}: line {first} does not read like those below it, and {first} lines are no "
            f"header, must be <= {_MOST_HEADER}; mend the line, or give header"
        )
    return first


# --- names and units


@dataclass(frozen=True, kw_only=True)
class _Column:
    name: str
    unit: str | None
    named: bool


def _columns(
    path: Path, lines: list[str], dialect: Dialect, options: SourceOptions
) -> list[_Column]:
    """Name and unit of every column, by the header's last line or two."""
    del path, options
    above = [i for i in range(dialect.first) if lines[i].strip(" \t\r")]
    alone = dialect.n_columns == 1  # then a blank belongs to the name
    rows = [
        [
            plain_cell(_words(cell).strip())
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
    """Units of a line that holds nothing else."""
    # a dash is no unit, as in the cell of a counter
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
        # what stands in round brackets may be a part of the name
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
    # of a date and a time each in its column, the latter has the name
    found = found if len(found) == 1 else list(stamped)
    return found[0] if len(found) == 1 else None


def _rate(
    path: Path,
    table: "TextTable",
    columns: Sequence[_Column],
    time: int | None,
    options: SourceOptions,
) -> tuple[float | None, float, str]:
    """Sample rate, its relative doubt, and why there is none."""
    if time is None:
        return None, 0.0, ""
    column = columns[time]
    if time not in table.dialect.numeric:
        return *_stamped_rate(path, table, column, time, options), ""
    tail = table.cells(max(0, table.lines.count - _SAMPLE), table.lines.count, time)
    clock = even_rate(
        path,
        column.name,
        lambda start, stop: table.read(start, stop, (time,))[0],
        table.lines.count,
        printed_resolution(tail),
        place=partial(_place, table, time),
    )
    match = _TIME_NAME.fullmatch(column.name)
    # a unit for all other channels is none for the times
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
    """Sample rate by time stamps, and its relative doubt."""
    if isinstance(options.unit, Mapping) and column.name in list(options.unit):
        raise DataError(
            f"{path}: unit {options.unit[column.name]!r} of column {column.name!r} must not be "
            "given; it holds time stamps; leave it out"
        )

    def refuse(index: int, text: str) -> DataError:
        return DataError(
            f"{path}: column {column.name!r} is {text[:40]!r} in line "
            f"{table.lines.before + index + 1}, must be a number or a time stamp like "
            "'2024-05-01T12:00:00.123' or '12:00:00.123' to give the time; mend it, or give "
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
        stamp_resolution(cells(max(0, count - _SAMPLE), count)),
        place=partial(_place, table, time),
    )
    return 1.0 / clock.step, clock.doubt


def _place(table: "TextTable", time: int, index: int) -> str:
    """A time as it is printed, and its line."""
    [text] = table.cells(index, index + 1, time)
    return f"{text} (line {table.lines.before + index + 1})"


def _refuse_other_step(path: Path, name: str, step: float, fs: float) -> None:
    """Refuse a rate that times without a unit fit in none."""
    rates = {unit: 1.0 / (step * factor) for unit, factor in UNITS["time"].items()}
    if any(abs(rate / fs - 1) <= _RATE_DOUBT for rate in rates.values()):
        return
    told = ", ".join(f"{rate:.6g} Hz if in {unit}" for unit, rate in rates.items())
    raise DataError(
        f"{path}: fs = {fs:.10g} Hz must fit the times of column {name!r}, whose step {step:.6g} "
        f"says {told}; correct fs, or give time_column = 0 if the times are wrong"
    )


_RATE_DOUBT = 0.01  # of a rate against times that may be printed coarsely

# --- the numbers


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """Lines and how to read them."""

    lines: Lines
    dialect: Dialect

    def read(self, start: int, stop: int, columns: Sequence[int]) -> NDArray[np.float64]:
        """Numbers of some lines [shape=(n_columns, stop - start)].

        Raises
        ------
        DataError
            A line has another number of cells, or one that is no number.
        """
        rows = self.lines.read(start, stop)
        decimal_comma = self.dialect.decimal == ","
        text = [(row.replace(b",", b".") if decimal_comma else row).decode(_BYTES) for row in rows]
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
            A line has another number of cells.
        """
        text = [row.decode(_BYTES) for row in self.lines.read(start, stop)]
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
                    f"{path}: line {number} has {len(cells)} cell(s), must have {width}; mend it"
                )
            for column in columns:
                if not _NUMBER.fullmatch(cells[column]):
                    return DataError(
                        f"{path}: column {column + 1} of line {number} is {cells[column][:40]!r}, "
                        "must be a number; mend it"
                    )
        first = self.lines.before + start + 1
        last = first + len(text) - 1
        return DataError(f"{path}: lines {first} to {last} cannot be read; mend them")


def _refuse_widths(text: Sequence[str], dialect: Dialect) -> None:
    """Lines that are too long would pass unseen where only some columns are read."""
    if not all(line.strip() for line in text):  # skipped, it would shift all that follow
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
