"""MATLAB 5 to 7 files: every size checked before use, arrays read in place.

The layout is that of "MAT-File Format" (The MathWorks), level 5: elements with a tag of type and
size; a matrix is an element of elements; a compressed element holds one matrix.
"""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ...sim.output.recording import DataError
from ..source.part import LARGEST_INFLATED, cut, damaged
from .flat import Flat
from .mat_tree import MOST_LEAVES, Leaf, Tree, fetch_of

_HEADER = 128  # byte
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"}
_NUMBERS |= {12: "i8", 13: "u8"}
"""Code of the numbers by type of element."""

_TEXTS = {16: "utf-8", 17: "utf-16", 18: "utf-32", 4: "utf-16"}
_CELL, _STRUCT, _CHAR, _SPARSE = 1, 2, 4, 5
_FIRST_NUMERIC, _LAST_NUMERIC = 6, 15
_COMPLEX = 0x800
_DEEPEST = 32
_LONGEST_TEXT = 4096  # byte, of a text that is a condition


@dataclass(frozen=True, kw_only=True, eq=False)
class _Bytes:
    """A section of the file, or of decompressed data."""

    path: Path
    place: Path | Callable[[], memoryview]
    raw: memoryview
    offset: int
    order: str

    def part(self, start: int, size: int) -> "_Bytes":
        if size < 0 or start + size > len(self.raw):
            raise DataError(
                f"{self.path}: an element of {size} byte must fit into {len(self.raw) - start}; "
                "take an intact copy"
            )
        return _Bytes(
            path=self.path,
            place=self.place,
            raw=self.raw[start : start + size],
            offset=self.offset + start,
            order=self.order,
        )

    def integers(self) -> list[int]:
        whole = len(self.raw) // 4 * 4
        found: list[int] = np.frombuffer(self.raw[:whole], dtype=f"{self.order}i4").tolist()
        return found

    def text(self) -> str:
        return bytes(self.raw).decode("latin-1").strip("\0 ")


def mat5_tree(path: Path) -> Tree:
    """All variables of a MATLAB 5 to 7 file.

    Raises
    ------
    DataError
        If it has no such header, is truncated, decompresses beyond :data:`LARGEST_INFLATED`, or an
        element contradicts another.
    """
    size = path.stat().st_size
    with path.open("rb") as handle:
        head = handle.read(_HEADER)
    order = {b"IM": "<", b"MI": ">"}.get(head[126:_HEADER])
    if order is None:
        raise DataError(
            f"{path} has no MAT 5 header; it is cut short or no MATLAB file; take an intact copy"
        )
    found: Tree = {}
    place, inflated = _HEADER, 0
    while place < size:
        if place + 8 > size:
            raise cut(path, size, place + 8)
        kind, length = np.fromfile(path, dtype=f"{order}u4", count=2, offset=place).tolist()
        if place + 8 + length > size:
            raise cut(path, size, place + 8 + length)
        if kind == _COMPRESSED:
            element = _inflated(path, order, place + 8, length, LARGEST_INFLATED - inflated)
            inflated += len(element.raw)
            _add_first(found, element)
        elif kind == _MATRIX and length > 0:
            _add(found, _mapped(path, order, place + 8, length))
        else:
            raise DataError(
                f"{path} has an element of type {kind} and {length} byte, must be a matrix; take "
                "an intact copy"
            )
        place += 8 + length
    if not found:
        raise DataError(f"{path} holds 0 variables, must be >= 1; it is cut short")
    # MATLAB's data of function handles have no name
    return {name: leaf for name, leaf in found.items() if name and not name.startswith("__")}


def _mapped(path: Path, order: str, place: int, length: int) -> _Bytes:
    """An uncompressed element, mapped into memory and not read."""
    view = np.memmap(path, dtype=np.uint8, mode="r", offset=place, shape=(length,))
    return _Bytes(path=path, place=path, raw=view.data, offset=place, order=order)


def _inflated(path: Path, order: str, place: int, length: int, limit: int) -> _Bytes:
    """A compressed element, protected by zlib's checksum."""
    inflater, pieces, total = zlib.decompressobj(), [], 0
    with path.open("rb") as handle:
        handle.seek(place)
        rest = handle.read(length)
    try:
        while rest and not inflater.eof and total <= limit:
            pieces.append(inflater.decompress(rest, 1 << 22))
            total += len(pieces[-1])
            rest = inflater.unconsumed_tail
    except zlib.error as error:
        raise damaged(path, error) from error
    if total > limit:
        raise DataError(f"{path} holds more than {LARGEST_INFLATED} byte, too many; split it")
    if not inflater.eof:
        raise DataError(f"{path} ends within a compressed variable; take an intact copy")
    raw = memoryview(b"".join(pieces))
    return _Bytes(path=path, place=lambda: raw, raw=raw, offset=0, order=order)


def _add_first(found: Tree, inflated: _Bytes) -> None:
    """The one matrix of a compressed element."""
    for kind, content in _elements(inflated, most=1):
        if kind == _MATRIX:
            _add(found, content)


def _add(found: Tree, matrix: _Bytes) -> None:
    if len(matrix.raw) == 0:
        return
    name, leaf = _matrix(matrix, 0)
    found[name] = leaf


def _elements(content: _Bytes, most: int) -> list[tuple[int, _Bytes]]:
    """Type and content of the elements of an element, at most the given number."""
    found: list[tuple[int, _Bytes]] = []
    place = 0
    while place < len(content.raw) and len(found) < most:
        head = content.part(place, 8).integers()
        kind, size = head[0] & 0xFFFFFFFF, head[1] & 0xFFFFFFFF
        if kind >> 16:  # a small element holds its content in the tag
            found.append((kind & 0xFFFF, content.part(place + 4, kind >> 16)))
            place += 8
            continue
        found.append((kind, content.part(place + 8, size)))
        place += 8 + -(-size // 8) * 8
    return found


def _matrix(content: _Bytes, depth: int) -> tuple[str, Leaf]:
    """Name and content of one matrix."""
    if depth > _DEEPEST:
        raise DataError(
            f"{content.path}: structs are nested more than {_DEEPEST} deep; take an intact copy"
        )
    # at most: flags, dimensions, name, and the data of the class
    parts = _elements(content, most=5)
    if len(parts) < 3 or len(parts[0][1].raw) < 8:
        return "", Leaf(shape=(0,), kind="object")
    flags = parts[0][1].integers()[0]
    shape = tuple(parts[1][1].integers())
    name = parts[2][1].text()
    if not shape or min(shape) < 0:
        raise DataError(
            f"{content.path}: {name} has shape {shape}, must be >= 0; take an intact copy"
        )
    kind = flags & 0xFF
    if kind in (_CELL, _STRUCT):
        return name, _container(content, kind, shape, depth)
    if flags & _COMPLEX:
        return name, Leaf(shape=shape, kind="complex")
    if _FIRST_NUMERIC <= kind <= _LAST_NUMERIC and len(parts) > 3:
        return name, _numeric(content.path, name, shape, *parts[3])
    if kind == _CHAR and len(parts) > 3:
        return name, _char(shape, *parts[3])
    return name, Leaf(shape=shape, kind="sparse" if kind == _SPARSE else "object")


def _numeric(path: Path, name: str, shape: tuple[int, ...], kind: int, data: _Bytes) -> Leaf:
    code = _NUMBERS.get(kind)
    count = math.prod(shape)
    if code is None or len(data.raw) != count * int(code[1:]):
        raise DataError(
            f"{path} cannot be read: {name or 'an array'} of shape {shape} has {len(data.raw)} "
            f"byte of type {kind}, which do not fit; take an intact copy"
        )
    full = f"{data.order}{code}" if code[1] != "1" else f"|{code}"
    layout = Flat(
        place=data.place,
        offset=data.offset,
        code=full,
        n_channels=1,
        n_samples=count,
        interleaved=False,
    )
    return Leaf(shape=shape, kind="numeric", reader=partial(fetch_of, layout))


def _char(shape: tuple[int, ...], kind: int, data: _Bytes) -> Leaf:
    if math.prod(shape) > _LONGEST_TEXT or len(data.raw) > 4 * _LONGEST_TEXT:
        return Leaf(shape=shape, kind="text")
    suffix = "" if kind == 16 else ("-le" if data.order == "<" else "-be")
    encoding = _TEXTS.get(kind, "latin-1") + (suffix if kind in _TEXTS else "")
    return Leaf(
        shape=shape, kind="text", text=bytes(data.raw).decode(encoding, errors="replace").strip()
    )


def _container(content: _Bytes, kind: int, shape: tuple[int, ...], depth: int) -> Leaf:
    """A struct or a cell array; every member is a matrix of at least a tag."""
    count = math.prod(shape)
    fields = [""]
    before = 3
    if kind == _STRUCT:
        parts = _elements(content, most=5)
        if len(parts) < 5:
            return Leaf(shape=shape, kind="struct")
        width = max((parts[3][1].integers() or [0])[0], 1)
        raw = bytes(parts[4][1].raw)
        fields = [
            raw[i : i + width].split(b"\0")[0].decode("latin-1") for i in range(0, len(raw), width)
        ]
        before = 5
    bound = min(len(content.raw) // 8, MOST_LEAVES)
    if count * len(fields) > bound:
        raise DataError(
            f"{content.path} cannot be read: {count} x {len(fields)} members in "
            f"{len(content.raw)} byte must be <= {bound}; take an intact copy, or split it"
        )
    members = _elements(content, most=before + count * len(fields))[before:]
    if len(members) != count * len(fields):
        raise DataError(
            f"{content.path} has {len(members)} members, must have {count * len(fields)}; take an "
            "intact copy"
        )
    leaves = [
        _matrix(member, depth + 1)[1] if kind_ == _MATRIX and len(member.raw) else _EMPTY
        for kind_, member in members
    ]
    rows = [leaves[i : i + len(fields)] for i in range(0, len(leaves), max(len(fields), 1))]
    return Leaf(
        shape=shape,
        kind="struct" if kind == _STRUCT else "cell",
        members=tuple(dict(zip(fields, row, strict=True)) for row in rows),
    )


_EMPTY = Leaf(shape=(0, 0), kind="numeric")
