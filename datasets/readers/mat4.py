"""MATLAB 4 files: a header of five integers before every matrix, whose numbers are read in place.

The layout is that of "MAT-File Format" (The MathWorks), level 4: type, rows, columns, imaginary
flag, length of the name; then the name, then the numbers, column by column.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...sim.output.recording import DataError
from ..source.part import cut
from .flat import Flat
from .mat_tree import MOST_LEAVES, Leaf, Tree, fetch_of

_HEADER = 20  # byte
_LARGEST_TYPE = 5000  # in the wrong byte order, a type is larger
_CODES = ("f8", "f4", "i4", "i2", "u2", "u1")
"""Code of the numbers by the tens of the type."""

_FULL, _TEXT = 0, 1
_LONGEST_NAME = 4096  # byte
_LONGEST_TEXT = 4096  # characters


def is_mat4(head: bytes) -> bool:
    """Whether a file with this beginning is of level 4: later ones begin with text.

    Examples
    --------
    >>> is_mat4(bytes(20)), is_mat4(b"MATLAB 5.0 MAT-file")
    (True, False)
    """
    return len(head) >= 4 and 0 in head[:4]


@dataclass(frozen=True, kw_only=True)
class _Matrix:
    """Header of one matrix."""

    order: str
    code: str
    kind: int
    shape: tuple[int, int]
    imaginary: bool
    name: str
    place: int

    @property
    def count(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def end(self) -> int:
        """End of its numbers [byte]."""
        return self.place + (1 + self.imaginary) * self.count * int(self.code[1:])


def mat4_tree(path: Path) -> Tree:
    """All variables of a MATLAB 4 file.

    Raises
    ------
    DataError
        If it is truncated, or a header has invalid values.
    """
    size = path.stat().st_size
    found: Tree = {}
    place, count = 0, 0
    with path.open("rb") as handle:
        while place < size:
            count += 1
            if count > MOST_LEAVES:
                raise DataError(f"{path} holds > {MOST_LEAVES} arrays, too many; split it")
            matrix = _matrix(path, handle, place, size)
            found[matrix.name] = _leaf(path, matrix)
            place = matrix.end
    return found


def _matrix(path: Path, handle: BinaryIO, place: int, size: int) -> _Matrix:
    handle.seek(place)
    raw = handle.read(_HEADER)
    if len(raw) < _HEADER:
        raise cut(path, size, place + _HEADER)
    order = "<" if 0 <= int.from_bytes(raw[:4], "little") <= _LARGEST_TYPE else ">"
    kind, rows, columns, imaginary, length = np.frombuffer(raw, dtype=f"{order}i4").tolist()
    machine, precision = kind // 1000, kind // 10 % 10
    if machine not in (0, 1) or kind // 100 % 10 or precision >= len(_CODES) or kind % 10 > 2:
        raise DataError(
            f"{path} has a matrix of type {kind} at byte {place}, must be of level 4 of MATLAB on "
            "an IEEE machine; save it with '-v7', or take an intact copy"
        )
    if min(rows, columns) < 0 or imaginary not in (0, 1) or not 0 < length <= _LONGEST_NAME:
        raise DataError(
            f"{path} has a matrix of shape {(rows, columns)} with a name of {length} byte at byte "
            f"{place}, must be >= 0 and 1 to {_LONGEST_NAME}; take an intact copy"
        )
    name = handle.read(length).split(b"\0")[0].decode("latin-1")
    found = _Matrix(
        order=order,
        code=_CODES[precision],
        kind=kind % 10,
        shape=(rows, columns),
        imaginary=bool(imaginary),
        name=name,
        place=place + _HEADER + length,
    )
    if found.end > size:
        raise cut(path, size, found.end)
    return found


def _leaf(path: Path, matrix: _Matrix) -> Leaf:
    if matrix.kind not in (_FULL, _TEXT):
        return Leaf(shape=matrix.shape, kind="sparse")
    if matrix.imaginary:
        return Leaf(shape=matrix.shape, kind="complex")
    layout = Flat(
        place=path,
        offset=matrix.place,
        code=matrix.order + matrix.code if matrix.code != "u1" else "|u1",
        n_channels=1,
        n_samples=matrix.count,
        interleaved=False,
    )
    if matrix.kind == _TEXT:
        return Leaf(shape=matrix.shape, kind="text", text=_text(layout))
    return Leaf(shape=matrix.shape, kind="numeric", reader=partial(fetch_of, layout))


def _text(layout: Flat) -> str:
    """Characters, which are stored as numbers; empty if they are too many or invalid."""
    if not 0 < layout.n_samples <= _LONGEST_TEXT:
        return ""
    codes = layout.fetch(0, layout.n_samples, (0,))[0]
    return "".join(chr(int(code)) for code in codes if 0 < code < 0x110000).strip()
