"""Text in the cells of CSV files: a spreadsheet must not take it for a formula."""

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ...sim.atomic import replacing

_FORMULA = re.compile(r"[=+\-@\t\r\n]")
_ESCAPED = re.compile(r"'[=+\-@\t\r\n]")


def save_rows(
    path: Path, head: Sequence[str], rows: Iterable[Iterable[Any]], *, force: bool = True
) -> None:
    """Write a table of safe cells as CSV, completely or not at all."""
    with (
        replacing(path, force=force) as fresh,
        fresh.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file,
    ):
        writer = csv.writer(file)
        writer.writerow(head)
        writer.writerows(map(safe_cell, row) for row in rows)


def safe_cell(value: Any) -> Any:
    """Cell in a safe form: text that begins like a formula gets a leading apostrophe.

    Numbers stay as they are, even as text.

    Parameters
    ----------
    value : object
        Value of the cell.

    Examples
    --------
    >>> [safe_cell(value) for value in ("=1+2", "-0.5", -0.5, "a", "@x")]
    ["'=1+2", '-0.5', -0.5, 'a', "'@x"]
    """
    if not isinstance(value, str) or not _FORMULA.match(value) or _is_number(value):
        return value
    return f"'{value}"


def plain_cell(text: str) -> str:
    """Inverse of :func:`safe_cell`, for reading what it wrote.

    Parameters
    ----------
    text : str
        Cell as written.

    Examples
    --------
    >>> plain_cell("'=1+2"), plain_cell("'quoted'")
    ('=1+2', "'quoted'")
    """
    return text[1:] if _ESCAPED.match(text) else text


def safe_frame(frame: Any) -> Any:
    """Table (pandas.DataFrame) whose names and texts may be written as CSV.

    Parameters
    ----------
    frame : pandas.DataFrame
        Table; not modified.
    """
    texts = [name for name, kind in frame.dtypes.items() if kind.kind in "OUT" or kind == "str"]
    changed = {name: [safe_cell(value) for value in frame[name]] for name in texts}
    return frame.assign(**changed).rename(columns=safe_cell)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return text == text.strip()
