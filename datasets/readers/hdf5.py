"""HDF5 of other programs, and MATLAB 7.3, which is HDF5 inside; read in pieces."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ..file.hdf5_values import HDF5_FAULTS, Place, is_loose_text, plain_value, texts_by_subprocess
from ..source.part import (
    LARGEST_INFLATED,
    Contents,
    Fetch,
    FilePart,
    PartChannel,
    SourceOptions,
    closed_on_failure,
    damaged,
    foreign,
)
from ..source.rate_name import RateNote, is_rate_name, rate_note
from .flat import Axes, array_axes, numbered
from .mat_tree import MOST_LEAVES, UNIT_NAMES, Leaf, Tree, tree_contents

_DEEPEST = 32
_LONGEST_TEXT = 4096


def hdf5_contents(path: Path, options: SourceOptions) -> Contents:
    """Data sets of real numbers in an HDF5 file.

    An attribute ``unit`` or ``units`` declares the unit; one like ``sample_rate_hz``, or
    ``sample_rate`` as a text with its unit, declares the rate.

    Raises
    ------
    DataError
        If it is not an HDF5 file, damaged, or a data set of this program; or the requested data set
        is not a single recording, is kept in other files, or declares more than it holds.
    """
    file = _opened(path)
    with closed_on_failure(path, file, HDF5_FAULTS):
        if {"schema_version", "sample_rate_hz", "channels"} <= set(file.attrs):
            raise DataError(
                f"{path} is a data set of this program already; use it directly, without importing"
            )
        arrays: list[tuple[str, Any, Axes]] = []
        others: list[str] = []
        for name, item in _walk(path, file):
            axes = _recording_axes(path, name, item, options)
            if isinstance(axes, str):
                others.append(axes)
            else:
                arrays.append((name, item, axes))
        texts = _loose_texts(path, [(name, item) for name, item, _ in arrays])
        parts = [_hdf5_part(path, name, item, axes, texts) for name, item, axes in arrays]
    return Contents(parts=tuple(parts), others=tuple(others), close=file.close)


def _opened(path: Path) -> Any:
    try:
        return h5py.File(path, "r")
    except HDF5_FAULTS as error:
        if not h5py.is_hdf5(path):
            raise foreign(path, "HDF5") from None
        raise damaged(path, error) from error


def _walk(path: Path, file: Any) -> Iterator[tuple[str, Any]]:
    """Data sets by path, and links, which are not followed; loops are cut."""
    queue, seen, count = [("", file["/"], 0)], {file["/"].id.__hash__()}, 0
    while queue:
        prefix, group, depth = queue.pop()
        for key in group:
            count += 1
            if count > MOST_LEAVES:
                raise DataError(f"{path} holds > {MOST_LEAVES} data sets, too many; split it")
            name = f"{prefix}/{key}".lstrip("/")
            link = group.get(key, getlink=True)
            if not isinstance(link, h5py.HardLink):
                yield name, link
                continue
            item = group[key]
            if isinstance(item, h5py.Dataset):
                yield name, item
            elif isinstance(item, h5py.Group) and depth < _DEEPEST and hash(item.id) not in seen:
                seen.add(hash(item.id))
                queue.append((name, item, depth + 1))


def _recording_axes(path: Path, name: str, item: Any, options: SourceOptions) -> Axes | str:
    """Assignment of the axes, or why it is no recording; an error if it is the one requested."""
    try:
        if not isinstance(item, h5py.Dataset):
            raise DataError(f"{path}: {name} is a link, which is not followed; copy what it names")
        if item.dtype.kind not in "iuf" or item.dtype.itemsize > 8 or item.size in (None, 0, 1):
            raise DataError(
                f"{path}: {name} is {item.dtype} {item.shape}, must be real numbers (samples, "
                "channels); choose another variable"
            )
        refuse_storage(path, name, item)
        return array_axes(item.shape, options, f"{path}: {name}")
    except DataError as error:
        if name in options.variables:
            raise
        return str(error).removeprefix(f"{path}: ").partition("; ")[0]


def _hdf5_part(path: Path, name: str, item: Any, axes: Axes, texts: "_Texts") -> FilePart:
    own = {key: text for (owner, key), text in texts.items() if owner == name}
    unit = next((text for key in UNIT_NAMES if (text := own.get(key) or _text(item, key))), None)
    names = numbered(name.rpartition("/")[2], axes.n_channels)
    rate = _rate_of(item, own)
    return FilePart(
        name=name,
        about=f"{item.shape}",
        channels=tuple(PartChannel(name=c.name, unit=unit) for c in names),
        named=False,
        n_samples=axes.n_samples,
        fetch=partial(_fetch, path, item, axes),
        sample_rate=rate.declared,
        rate_note=rate.note,
        rate_seen=rate.seen,
    )


_Texts = dict[Place, str]
"""Texts by data set and attribute."""


def _loose_texts(path: Path, arrays: Sequence[tuple[str, Any]]) -> _Texts:
    """Texts of variable length that may declare unit or rate, read by another process.

    They lie in a heap that the HDF5 library trusts: if damaged, it crashes or never returns.

    Raises
    ------
    DataError
        If that happens.
    """
    wanted = [
        (name, key)
        for name, item in arrays
        for key in item.attrs
        if (key in UNIT_NAMES or is_rate_name(key)) and is_loose_text(item.attrs.get_id(key))
    ]
    try:
        texts = texts_by_subprocess(path, wanted)
    except ValueError as error:
        raise DataError(f"{path}: {error}; take an intact copy") from error
    return {place: text.strip() for place, text in texts.items()}


def refuse_storage(path: Path, name: str, item: Any) -> None:
    """Refuse data that are kept elsewhere, not written, or in pieces too large to read.

    Raises
    ------
    DataError
        In any of these cases.
    """
    label = f"{path}: {name}"
    if item.is_virtual or item.external:
        raise DataError(f"{label} is kept in other files; copy it into one file")
    if item.chunks is None:
        if item.id.get_storage_size() < item.nbytes:
            raise DataError(
                f"{label} declares {item.nbytes} byte and holds {item.id.get_storage_size()}, must "
                "hold all; take an intact copy"
            )
        return
    chunk = math.prod(item.chunks) * item.dtype.itemsize
    if chunk > LARGEST_INFLATED:
        raise DataError(
            f"{label} lies in pieces of {chunk} byte, must be <= {LARGEST_INFLATED}; repack it"
        )
    pieces = math.prod(-(-n // c) for n, c in zip(item.shape, item.chunks, strict=True))
    written = item.id.get_num_chunks()
    if written < pieces:
        raise DataError(
            f"{label} holds {written} of {pieces} pieces, must hold all; take an intact copy"
        )


def _fetch(
    path: Path, item: Any, axes: Axes, start: int, stop: int, rows: tuple[int, ...]
) -> NDArray[Any]:
    lead = () if axes.record is None else (axes.record,)
    span = slice(start, stop)
    try:
        if item.ndim == 1:
            return np.asarray(item[span])[None]
        if axes.channels_first and len(rows) == 1:
            return np.asarray(item[(*lead, rows[0], span)])[None]
        raw = item[(*lead, slice(None), span) if axes.channels_first else (*lead, span)]
    except HDF5_FAULTS as error:
        raise damaged(path, error) from error
    table = np.asarray(raw) if axes.channels_first else np.asarray(raw).T
    return table[list(rows)]


def _text(item: Any, key: str) -> str:
    """An attribute as text, empty if it is not a text."""
    value = plain_value(item, key)
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace").strip()
    return value.strip() if isinstance(value, str) else ""


def _rate_of(item: Any, texts: Mapping[str, str]) -> RateNote:
    """Rate from an attribute whose name or value contains Hz, or else a number without a unit."""
    found = RateNote()
    for key in filter(is_rate_name, item.attrs):
        value = plain_value(item, key)
        number = float(value) if isinstance(value, (int, float, np.number)) else None
        note = rate_note(key, texts.get(key) or _text(item, key) or number)
        if note.declared is not None:
            return note
        found = note if found.seen is None else found
    return found


# --- MATLAB 7.3


def mat73_contents(path: Path, options: SourceOptions) -> Contents:
    """Arrays, structs and cells of a MATLAB 7.3 file, under MATLAB's names and shapes.

    Raises
    ------
    DataError
        If it is damaged, or the requested array is not a single recording.
    """
    file = _opened(path)
    with closed_on_failure(path, file, HDF5_FAULTS):
        contents = tree_contents(path, _Mat73(path, file).tree(), options)
    return replace(contents, close=file.close)


class _Mat73:
    """Walk through a MATLAB 7.3 file; objects are counted, since references may form loops."""

    def __init__(self, path: Path, file: Any) -> None:
        self.path, self.file, self.count = path, file, 0

    def tree(self) -> Tree:
        names = [name for name in self._members(self.file) if not name.startswith("#")]
        return {name: self._leaf(self.file[name], 0) for name in names}

    def _members(self, group: Any) -> list[str]:
        """Names of the members stored in this file itself."""
        return [name for name in group if isinstance(group.get(name, getlink=True), h5py.HardLink)]

    def _leaf(self, item: Any, depth: int) -> Leaf:
        self.count += 1
        if depth > _DEEPEST or self.count > MOST_LEAVES:
            raise DataError(
                f"{self.path} holds > {MOST_LEAVES} arrays or structs > {_DEEPEST} deep, too "
                "many; split it"
            )
        if isinstance(item, h5py.Group):
            return self._struct(item, depth)
        if not isinstance(item, h5py.Dataset) or item.shape is None:
            return Leaf(shape=(0,), kind="object")
        return self._array(item, depth)

    def _array(self, item: Any, depth: int) -> Leaf:
        shape = tuple(reversed(item.shape))  # the file holds rows where MATLAB has columns
        if "MATLAB_empty" in item.attrs:
            return Leaf(shape=(0, 0), kind="numeric")
        if _is_reference(item):
            cells = tuple({"": self._leaf(inner, depth + 1)} for inner in self._followed(item))
            return Leaf(shape=shape, kind="cell", members=cells)
        if item.dtype.names:
            return Leaf(shape=shape, kind="complex")
        if item.dtype.kind not in "iuf" or item.dtype.itemsize > 8 or len(shape) != 2:
            return Leaf(shape=shape, kind="object")
        refuse_storage(self.path, item.name, item)
        if _text(item, "MATLAB_class") == "char":
            return Leaf(shape=shape, kind="text", text=_characters(item))
        return Leaf(shape=shape, kind="numeric", reader=partial(_transposed, self.path, item))

    def _struct(self, group: Any, depth: int) -> Leaf:
        """Fields of a struct; in an array of structs, every field is an array of references."""
        items = {name: group[name] for name in self._members(group)}
        columns = {
            name: self._followed(item) for name, item in items.items() if _holds_elements(item)
        }
        if not columns or len(columns) < len(items):
            fields = {name: self._leaf(item, depth + 1) for name, item in items.items()}
            return Leaf(shape=(1, 1), kind="struct", members=(fields,))
        rows = tuple(
            {name: self._leaf(column[i], depth + 1) for name, column in columns.items()}
            for i in range(min(len(column) for column in columns.values()))
        )
        return Leaf(shape=(1, len(rows)), kind="struct", members=rows)

    def _followed(self, item: Any) -> list[Any]:
        """Targets of the references of a data set."""
        if item.size > MOST_LEAVES:
            raise DataError(
                f"{self.path}: {item.name} holds {item.size} cells, must be <= {MOST_LEAVES}"
            )
        refuse_storage(self.path, item.name, item)
        references = np.asarray(item[()]).reshape(-1)
        return [self.file[r] for r in references if isinstance(r, h5py.Reference) and r]


def _is_reference(item: Any) -> bool:
    return h5py.check_ref_dtype(item.dtype) is h5py.Reference


def _holds_elements(item: Any) -> bool:
    """Whether it is a cell array, which is marked as such; the elements of a field are not."""
    return (
        isinstance(item, h5py.Dataset) and _is_reference(item) and "MATLAB_class" not in item.attrs
    )


def _characters(item: Any) -> str:
    if item.size > _LONGEST_TEXT:
        return ""
    codes = np.asarray(item[()]).T.reshape(-1)
    return "".join(map(chr, codes.astype(np.uint16).tolist())).strip()


def _transposed(path: Path, item: Any, axes: Axes) -> Fetch:
    return partial(_fetch, path, item, replace(axes, channels_first=not axes.channels_first))
