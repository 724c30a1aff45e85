"""Layout of a text of columns: encoding, header, delimiter, decimal comma."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...sim.output.recording import DataError
from ..source.part import SourceOptions, foreign
from .text_lines import COMMENT_MARKS, MOST_HEADER

SAMPLE_LINES = 64  # lines of numbers that must agree on the layout

NUMBER_TEXT = re.compile(
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


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How to split a line into numbers.

    Attributes
    ----------
    delimiter : str
        One character; a space stands for any run of blanks.
    decimal : str
        ``.`` or ``,``.
    n_columns : int
        Number of cells in every line.
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


BYTES = "latin-1"  # every byte is a character: nothing is lost, nothing fails

_BOMS = re.compile("(?:\xef\xbb\xbf){0,8}")  # some programs write several


def byte_order_mark(path: Path) -> int:
    """Number of bytes of the encoding mark at the beginning of a file."""
    with path.open("rb") as handle:
        return _boms(handle.read(24).decode(BYTES))


def _boms(text: str) -> int:
    """Number of bytes of the marks at the beginning of a text."""
    match = _BOMS.match(text)
    return match.end() if match else 0


def head_of(path: Path, size: int) -> str:
    """First lines, one character per byte; the last one is complete or left out."""
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
    text = raw.decode(BYTES)
    text = text[_boms(text) :]
    if not whole:
        text = text.rpartition("\n")[0]
    if not text.strip():
        raise DataError(f"{path} has no line that ends within {size} byte, must have; check it")
    return _without_comments(text)


def _without_comments(text: str) -> str:
    """Lines up to the last one that is neither blank nor a comment."""
    for _ in range(MOST_HEADER):
        text = text.rstrip(" \t\r\n\x1a")
        above, feed, line = text.rpartition("\n")
        if not feed or not line.encode(BYTES).lstrip(b" \t").startswith(COMMENT_MARKS):
            break
        text = above
    return text


def _looks_binary(raw: bytes) -> bool:
    controls = sum(raw[:4096].count(code) for code in range(32) if code not in (9, 10, 13, 26, 12))
    return controls > 0


def header_words(text: str) -> str:
    """A header in its encoding: UTF-8, or else that of old Windows programs."""
    raw = text.encode(BYTES)
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


def dialect_of(path: Path, lines: list[str], options: SourceOptions) -> Dialect:
    """Delimiter, decimal mark and first row of a text, or an error if they are ambiguous."""
    found, broken = [], []
    for delimiter in _delimiters(path, lines, options):
        for decimal in (options.decimal,) if options.decimal else (".", ","):
            try:
                dialect = _tried(path, lines, delimiter, decimal, options)
            except DataError as error:  # in this reading; another may fit
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
            "decimal and header, or correct it"
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
    """Whether one column with decimal commas may also be two; not with a header of one name."""
    if options.decimal is not None or dialect.decimal == "." or dialect.n_columns > 1:
        return True
    comma = any("," in line for line in lines[dialect.first :])
    return not comma or (_fits_header(lines, dialect) or _all_pairs(lines[dialect.first :]))


def _all_pairs(lines: list[str]) -> bool:
    """Whether every line can be read both ways: the error that follows names them."""
    return all(line.count(",") == 1 for line in lines)


def _distinct(lines: list[str], dialects: Sequence[Dialect]) -> list[Dialect]:
    """Readings, with only one of those that give the same numbers."""
    found: dict[str, Dialect] = {}
    for d in dialects:
        cells = [split_cells(line, d.delimiter) for line in lines[d.first :][-SAMPLE_LINES:]]
        numbers = str([[_plain(row[c], d.decimal) for c in d.numeric] for row in cells])
        found.setdefault(numbers, d)
    return list(found.values())


def _plain(cell: str, decimal: str) -> float:
    return float(cell.replace(",", ".") if decimal == "," else cell)


def _fits_header(lines: list[str], dialect: Dialect) -> bool:
    """Whether the line above the numbers has exactly one name for every column."""
    above = next((line for line in reversed(lines[: dialect.first]) if line.strip()), "")
    # a comma between names shows the meaning of commas
    clear = not (dialect.decimal == "," and dialect.delimiter == " " and "," in above)
    return clear and len(split_cells(above, dialect.delimiter)) == dialect.n_columns


def _refuse_broken(path: Path, lines: list[str], dialect: Dialect, options: SourceOptions) -> None:
    """Refuse a broken line of numbers that would pass as the end of the header."""
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
                f"{dialect.first}; correct it, or give header, the lines before the numbers"
            )
    for number, line in enumerate(lines[dialect.first :], start=dialect.first + 1):
        cells = split_cells(line, dialect.delimiter)
        for column, cell in enumerate(cells):
            if column not in dialect.numeric and _is_number(cell, dialect.decimal):
                raise DataError(
                    f"{path}: column {column + 1} is {cell!r} in line {number} and no number in "
                    f"line {len(lines)}, must be one kind; correct it"
                )


def _refuse_numbered(
    path: Path, lines: list[str], dialect: Dialect, options: SourceOptions
) -> None:
    """Refuse a first line of column numbers, which may be names or the first sample."""
    if options.header is not None or options.rows or dialect.first or dialect.n_columns < 2:
        return
    cells = [split_cells(line, dialect.delimiter) for line in lines[:SAMPLE_LINES]]
    counted = [[str(i + k) for i in range(dialect.n_columns)] for k in (0, 1)]
    if cells[0] not in counted or len(cells) < 4:
        return
    if all(re.fullmatch(r"[-+]?\d+", cell) for cell in cells[1]):
        return  # whole numbers like those below
    steps = np.diff([_plain(row[0], dialect.decimal) for row in cells[:4]])
    if steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-3):
        return  # times that continue from the first line
    shown = dialect.delimiter.join(cells[0])[:40]
    raise DataError(
        f"{path}: line 1, {shown!r}, may name the columns by number or be a sample; give header, "
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
    tail = "\n".join(lines[-SAMPLE_LINES:])
    # blanks separate only if nothing clearer does
    return [d for d in (";", "\t", "|", ",") if d in tail] + [" "] * (
        not any(d in tail for d in ";\t|")
    )


def _is_number(cell: str, decimal: str) -> bool:
    return (NUMBER_TEXT if decimal == "." else _COMMA_NUMBER).fullmatch(cell) is not None


def _tried(
    path: Path, lines: list[str], delimiter: str, decimal: str, options: SourceOptions
) -> Dialect | None:
    """One reading, if the last lines of the head agree with it."""
    begin = 0 if options.header is None else options.header
    if begin >= len(lines):
        raise DataError(
            f"{path}: header = {begin} lines must be < {len(lines)}, its lines; correct it"
        )
    tail = [split_cells(line, delimiter) for line in lines[max(begin, len(lines) - SAMPLE_LINES) :]]
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
    """Index of the first line of numbers, searched upwards from the last one of the head."""
    first = len(lines)
    while first > 0:
        cells = split_cells(lines[first - 1], delimiter)
        if len(cells) != width or not all(_is_number(cells[c], decimal) for c in numeric):
            break
        first -= 1
    if first > MOST_HEADER:
        raise DataError(
            f"{path}: line {first} does not read like those below it, and {first} lines are no "
            f"header, must be <= {MOST_HEADER}; correct the line, or give header"
        )
    return first
