"""Finished pieces of a long command, stored with its output so that it can be resumed."""

import json
import math
import time
from collections.abc import Callable, Iterator, MutableMapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from ...sim.atomic import write_whole
from ...sim.output.recording import DataError

Piece = TypeVar("Piece")

ENDING = ".part.json"
"""Ending that replaces the suffix of the output in the name of the file."""


def part_file(output: Path | None) -> Path | None:
    """File next to an output that stores finished pieces; None without an output.

    Examples
    --------
    >>> part_file(Path("folder/chart.html")).name
    'chart.part.json'
    """
    return None if output is None else output.with_suffix(ENDING)


class Kept(MutableMapping[str, Piece], Generic[Piece]):
    """Finished pieces of a command by name, in a file.

    Parameters
    ----------
    path : Path or None
        File; None to keep the pieces in this object only.
    key : str
        Hash of all inputs of the pieces.
    table_of, piece_of : callable
        Conversions of a piece to plain values and back.
    depends : str
        Inputs behind the key, for a message: "another model, recipe or version".
    pause : float
        Shortest time between two writes of the file [s]; :meth:`save` writes the rest.

    Raises
    ------
    DataError
        If the file is damaged, or has another key.
    """

    def __init__(
        self,
        path: Path | None,
        key: str,
        *,
        table_of: Callable[[Piece], Any],
        piece_of: Callable[[Any], Piece],
        depends: str,
        pause: float = 0.0,
    ) -> None:
        self.path, self.key, self.pause = path, key, pause
        self._table_of, self._piece_of = table_of, piece_of
        self._pieces: dict[str, Piece] = {}
        self._saved, self._written = True, -math.inf
        if path is not None and path.exists():
            self._read(path, depends)

    def _read(self, path: Path, depends: str) -> None:
        try:
            stored = json.loads(path.read_bytes())
            same = stored["key"] == self.key
            self._pieces = (
                {name: self._piece_of(each) for name, each in stored["pieces"].items()}
                if same
                else {}
            )
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise DataError(f"{path} is damaged ({error}); delete it") from None
        if not same:
            raise DataError(f"{path} is of {depends}; delete it, or use --force")

    def __getitem__(self, name: str) -> Piece:
        """Piece of that name."""
        return self._pieces[name]

    def __setitem__(self, name: str, piece: Piece) -> None:
        """Add a piece, and write the file if it is due."""
        self._pieces[name] = piece
        self._saved = False
        if time.monotonic() - self._written >= self.pause:
            self.save()

    def __delitem__(self, name: str) -> None:
        """Remove a piece."""
        del self._pieces[name]
        self._saved = False

    def __iter__(self) -> Iterator[str]:
        """Names, in the order in which they were finished."""
        return iter(self._pieces)

    def __len__(self) -> int:
        """Number of pieces."""
        return len(self._pieces)

    def save(self) -> None:
        """Write all pieces not yet in the file."""
        if self.path is None or self._saved:
            return
        pieces = {name: self._table_of(piece) for name, piece in self._pieces.items()}
        write_whole(self.path, json.dumps({"key": self.key, "pieces": pieces}).encode(), force=True)
        self._saved, self._written = True, time.monotonic()

    def drop(self) -> None:
        """Delete the file after all is done."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
