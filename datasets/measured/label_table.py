"""The CSV file of labels as written: every row has as many cells as the header."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

from ...sim.output.recording import DataError, missing_file
from ..file.csv_cells import plain_cell
from ..file.machines import FILE

LARGEST_TABLE = 2**26
"""Largest plausible table of labels [byte]."""

_SHOWN = 5  # items of a list shown in a message
_MOST_FAULTS = 20  # in one message; the others are counted


def refusal(faults: Sequence[str]) -> DataError:
    """One error for many faults: the first ones, and the number of others."""
    more = len(faults) - _MOST_FAULTS
    last = [f"and {more} more faults"] if more > 0 else []
    return DataError("\n".join([*faults[:_MOST_FAULTS], *last]))


def listed(words: Sequence[str]) -> str:
    """The first few items of a list, and the number of others.

    Examples
    --------
    >>> listed(["a", "b"]), listed(list("abcdefgh"))
    ('a, b', 'a, b, c, d, e and 3 more')
    """
    more = len(words) - _SHOWN
    return ", ".join(words[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


class LabelTable:
    """Cells of a table by column, with their line numbers."""

    def __init__(self, source: str = "", comma: bool = False) -> None:
        self.source = source
        self.comma = comma
        self.entries: list[str] = []
        self.lines: list[int] = []
        self.columns: dict[str, list[str]] = {}

    def place(self, row: int) -> str:
        """Text with the place of a row, for messages."""
        return f"{self.source} line {self.lines[row]}"


def read_label_table(path: Path, faults: list[str]) -> LabelTable:
    """Cells of a table of labels by column, with line numbers; the delimiter is detected."""
    text = _table_text(path)
    ways = [d for d in ",;\t" if FILE in next(_rows(path, text, d), (0, [""]))[1]]
    if not ways:
        raise DataError(
            f"{path}: its first line has no column '{FILE}', must have it before the labels: "
            f"{text.lstrip()[:60].partition(chr(10))[0].strip()!r}; name it so"
        )
    rows = _rows(path, text, ways[0])
    headings = next(rows)[1]
    wrong = [
        f"{path}: column {name!r} is there {headings.count(name)} times, must be once; rename one"
        for name in sorted(set(headings))
        if name and headings.count(name) > 1
    ]
    if "" in headings:
        wrong.append(f"{path}: column {headings.index('') + 1} has no name; give it one")
    if wrong:
        raise refusal(wrong)
    return _filled_table(LabelTable(str(path), comma=ways[0] != ","), headings, rows, faults)


def _filled_table(
    table: "LabelTable",
    headings: Sequence[str],
    rows: Iterator[tuple[int, list[str]]],
    faults: list[str],
) -> LabelTable:
    table.columns = {name: [] for name in headings}
    for line, cells in rows:
        if len(cells) != len(headings):
            faults.append(
                f"{table.source} line {line}: has {len(cells)} cells, must have {len(headings)}; "
                "correct it"
            )
            continue
        table.lines.append(line)
        for name, cell in zip(headings, cells, strict=True):
            table.columns[name].append(cell)
    table.entries = table.columns.pop(FILE)
    if not table.entries and not faults:
        faults.append(
            f"{table.source} has 0 rows below its header, must have one for every file; add them"
        )
    return table


def _table_text(path: Path) -> str:
    if not path.is_file():
        raise DataError(missing_file(path, "check the path of the labels"))
    size = path.stat().st_size
    if size > LARGEST_TABLE:
        raise DataError(f"{path} has {size} byte, must be <= {LARGEST_TABLE}; is it the labels?")
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path} is not UTF-8 at byte {error.start}, must be; save it as CSV UTF-8"
        ) from None


def _rows(path: Path, text: str, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Non-blank lines with their numbers."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield reader.line_num, [plain_cell(cell.strip()) for cell in cells]
    except csv.Error as error:
        raise DataError(f"{path} line {reader.line_num}: {error}; correct it") from None
