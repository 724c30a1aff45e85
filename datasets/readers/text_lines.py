"""Lines of a text file by an index: where each begins, in pieces, whatever its length."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError

BLOCK = 4096
"""Lines between two places of the index."""

_LONGEST_LINE = 2**16  # byte
LONGEST_ROW = 2**23  # byte, where a line is a record

MOST_HEADER = 200  # lines
_PIECE = 2**22  # byte, read at once


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
    for _ in range(MOST_HEADER):
        start = _start_of_comment(path, begin, end)
        if start is None:
            break
        end = _end_of_ink(path, begin, start)
    return end


COMMENT_MARKS = (b"#", b"%")


def _start_of_comment(path: Path, begin: int, end: int) -> int | None:
    """Place of the last line where it is a comment and not the only one."""
    with path.open("rb") as handle:
        place = max(begin, end - _LONGEST_LINE)
        handle.seek(place)
        rest, feed, line = handle.read(end - place).rpartition(b"\n")
    comment = feed and line.lstrip(b" \t").startswith(COMMENT_MARKS)
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
