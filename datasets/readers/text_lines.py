"""Index of the lines of a text file: their positions, found in pieces, for any file length."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError

BLOCK = 4096
"""Number of lines between two entries of the index."""

_LONGEST_LINE = 2**16  # byte
LONGEST_ROW = 2**23  # byte, if a line is a record

MOST_HEADER = 200  # lines
_PIECE = 2**22  # byte, read at once


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Positions of every :data:`BLOCK`-th line of numbers in a file.

    Attributes
    ----------
    path : Path
        The file.
    places : numpy.ndarray
        Positions of line 0, BLOCK, … and of the end [byte].
    count : int
        Number of lines.
    before : int
        Number of preceding lines in the file, for messages.
    block : int
        Number of lines between two positions.
    """

    path: Path
    places: NDArray[np.int64]
    count: int
    before: int
    block: int = BLOCK

    def read(self, start: int, stop: int) -> list[bytes]:
        """Lines [start, stop), fewer if the file has shrunk."""
        first = start // self.block
        last = min(-(-stop // self.block), len(self.places) - 1)
        with self.path.open("rb") as handle:
            handle.seek(int(self.places[first]))
            raw = handle.read(int(self.places[last] - self.places[first]))
        return raw.split(b"\n")[start - first * self.block : stop - first * self.block]


def index_lines(
    path: Path, begin: int, before: int, end: int | None = None, *, records: bool = False
) -> Lines:
    """Index the lines of a file from a position on; blank ones at its end are left out.

    If lines are `records`, they are long, and every line has an entry.

    Raises
    ------
    DataError
        If a line is too long for a table.
    """
    stop = _end_of_text(path, begin) if end is None else end
    block, longest = (1, LONGEST_ROW) if records else (BLOCK, _LONGEST_LINE)
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
        count += 1  # the last line has no line end
    if places[-1] == stop and len(places) > 1:
        places.pop()
    return Lines(
        path=path, places=np.array([*places, stop]), count=count, before=before, block=block
    )


def _refuse_long(path: Path, number: int, lengths: NDArray[np.int64], longest: int) -> None:
    if lengths.max(initial=0) > longest:
        raise DataError(
            f"{path}: a line after line {number} has more than {longest} byte, too long; is it "
            "text with line feeds, or are its rows records (rows)?"
        )


def _end_of_text(path: Path, begin: int) -> int:
    """Position after the last line that is neither blank nor a comment."""
    end = _end_of_ink(path, begin, path.stat().st_size)
    for _ in range(MOST_HEADER):
        start = _start_of_comment(path, begin, end)
        if start is None:
            break
        end = _end_of_ink(path, begin, start)
    return end


COMMENT_MARKS = (b"#", b"%")


def _start_of_comment(path: Path, begin: int, end: int) -> int | None:
    """Position of the last line if it is a comment and not the only line."""
    with path.open("rb") as handle:
        place = max(begin, end - _LONGEST_LINE)
        handle.seek(place)
        rest, feed, line = handle.read(end - place).rpartition(b"\n")
    comment = feed and line.lstrip(b" \t").startswith(COMMENT_MARKS)
    return place + len(rest) + 1 if comment else None


def _end_of_ink(path: Path, begin: int, end: int) -> int:
    """Position after the last non-blank line before an end."""
    with path.open("rb") as handle:
        while end > begin:
            size = min(_PIECE, end - begin)
            handle.seek(end - size)
            kept = len(handle.read(size).rstrip(b" \t\r\n\x1a"))
            if kept:
                return end - size + kept
            end -= size
    return begin
