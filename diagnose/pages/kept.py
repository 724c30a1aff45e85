"""What a long command has finished, kept beside its output, so that the same command goes on."""

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
"""Takes the place of the output's suffix in the name of the file."""


def part_file(output: Path | None) -> Path | None:
    """File beside an output that keeps what is finished; None without an output.

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
        None keeps nothing beyond this object.
    key : str
        Hash of all that the pieces depend on.
    table_of, piece_of : callable
        A piece as plain values, and back.
    depends : str
        What the key is of, for a message: "another model, recipe or version".
    pause : float
        Seconds between two times that the file is written; :meth:`save` writes the rest.

    Raises
    ------
    DataError
        The file is damaged, or of another key.
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
        """Piece of a name."""
        return self._pieces[name]

    def __setitem__(self, name: str, piece: Piece) -> None:
        """Keep one more, in the file as well where its time has come."""
        self._pieces[name] = piece
        self._saved = False
        if time.monotonic() - self._written >= self.pause:
            self.save()

    def __delitem__(self, name: str) -> None:
        """Forget a piece."""
        del self._pieces[name]
        self._saved = False

    def __iter__(self) -> Iterator[str]:
        """Names, in the order in which they were finished."""
        return iter(self._pieces)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._pieces)

    def save(self) -> None:
        """Write what is not in the file yet."""
        if self.path is None or self._saved:
            return
        pieces = {name: self._table_of(piece) for name, piece in self._pieces.items()}
        write_whole(self.path, json.dumps({"key": self.key, "pieces": pieces}).encode(), force=True)
        self._saved, self._written = True, time.monotonic()

    def drop(self) -> None:
        """Delete the file: all is done."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
