"""Numbers stored in a file without structure: headerless binary, NPY, NPZ."""

import io
import math
import re
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ..source.part import (
    LARGEST_INFLATED,
    MOST_CHANNELS,
    MOST_ROWS,
    Contents,
    FilePart,
    PartChannel,
    SourceOptions,
    cut,
    damaged,
    foreign,
)
from ..source.rate_name import RateNote, is_rate_name, rate_note

_NAMES = {
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int24": "i3",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "float32": "f4",
    "float64": "f8",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Flat:
    """Location of the numbers of one array, and how to read some of them.

    Attributes
    ----------
    place : Path or callable
        The file, or a function that returns the decompressed bytes.
    offset : int
        Position of the first number [byte].
    code : str
        Numpy code, or ``<i3``, ``>i3`` for 24 bits, ``<i5`` to ``>i7`` for 40 to 56.
    n_channels, n_samples : int
        Shape.
    interleaved : bool
        Sample by sample; otherwise channel by channel.
    """

    place: Path | Callable[[], memoryview]
    offset: int
    code: str
    n_channels: int
    n_samples: int
    interleaved: bool

    @property
    def width(self) -> int:
        """Size of one number [byte]."""
        return int(self.code[2:])

    @property
    def end(self) -> int:
        """End of the array [byte]."""
        return self.offset + self.n_channels * self.n_samples * self.width

    def fetch(self, start: int, stop: int, rows: tuple[int, ...]) -> NDArray[Any]:
        """Numbers [shape=(n_rows, stop - start)]; fewer samples if the file has shrunk."""
        count = stop - start
        if self.interleaved:
            raw = self._run(start * self.n_channels, count * self.n_channels)
            whole = len(raw) // self.n_channels
            table = raw[: whole * self.n_channels].reshape(whole, self.n_channels)
            return table[:, list(rows)].T
        runs = [self._run(row * self.n_samples + start, count) for row in rows]
        shortest = min(len(run) for run in runs)
        return np.stack([run[:shortest] for run in runs])

    def _run(self, first: int, count: int) -> NDArray[Any]:
        """Consecutive numbers."""
        place, size = self.offset + first * self.width, count * self.width
        if isinstance(self.place, Path):
            with self.place.open("rb") as handle:
                handle.seek(place)
                raw: Any = handle.read(size)
        else:
            raw = self.place()[place : place + size]
        whole = len(raw) // self.width * self.width
        if self.code[1] == "i" and self.width not in (1, 2, 4, 8):
            bytes_ = np.frombuffer(raw, dtype=np.uint8, count=whole)
            return _widened(bytes_, self.code[0], self.width)
        return np.frombuffer(raw, dtype=self.code, count=whole // self.width)


def _widened(raw: NDArray[np.uint8], order: str, width: int) -> NDArray[Any]:
    """Integers of 3 byte as integers of 4, of 5 to 7 byte as integers of 8."""
    size = 4 if width == 3 else 8
    wide = np.zeros((len(raw) // width, size), dtype=np.uint8)
    # the bytes become the upper ones; the shift extends the sign
    if order == "<":
        wide[:, size - width :] = raw.reshape(-1, width)
    else:
        wide[:, :width] = raw.reshape(-1, width)
    return wide.view(f"{order}i{size}")[:, 0].astype(f"=i{size}") >> 8 * (size - width)


def flat_code(text: str) -> str:
    """Code of a declared type of numbers.

    Parameters
    ----------
    text : str
        ``"<int16"``, ``">f4"``, ``"uint8"``: byte order, then name or numpy code.

    Raises
    ------
    DataError
        If there is no such type, or the byte order of several bytes is missing.

    Examples
    --------
    >>> flat_code("<int16"), flat_code("uint8"), flat_code(">f8")
    ('<i2', '|u1', '>f8')
    """
    match = re.fullmatch(r"([<>|]?)([a-z]+[0-9]+)", text.strip())
    code = _NAMES.get(match.group(2), match.group(2)) if match else ""
    if match is None or code not in _NAMES.values():
        raise DataError(
            f"dtype = {text!r} must be one of {', '.join(_NAMES)} behind '<' (little-endian) or "
            "'>' (big-endian); write it like '<int16'"
        )
    if code[1] == "1":
        return f"|{code}"
    if match.group(1) not in ("<", ">"):
        raise DataError(
            f"dtype = {text!r} must include its byte order; write '<{match.group(2)}' "
            f"(little-endian, as on PCs) or '>{match.group(2)}' (big-endian)"
        )
    return match.group(1) + code


def numbered(stem: str, count: int) -> tuple[PartChannel, ...]:
    """Channels that the file does not name: the stem, with a number if there are several."""
    names = [stem] if count == 1 else [f"{stem}_{i}" for i in range(count)]
    return tuple(PartChannel(name=name) for name in names)


def stem_of(path: Path) -> str:
    """Name for unnamed content of a file."""
    return re.sub(r"\W+", "_", path.stem).strip("_") or "channel"


# --- headerless binary


def raw_contents(path: Path, options: SourceOptions) -> Contents:
    """Headerless binary by its declared layout.

    Raises
    ------
    DataError
        If the layout is not declared, or the file's size does not fit it.
    """
    if options.dtype is None or options.n_channels is None:
        raise DataError(
            f"{path}: dtype = {options.dtype} and n_channels = {options.n_channels} must both be "
            "given; a headerless file does not declare them"
        )
    code, count = flat_code(options.dtype), options.n_channels
    size = path.stat().st_size - options.offset
    frame = count * int(code[2:])
    # channel by channel, missing samples would shift all channels but the first
    if options.partial and options.order != "blocks":
        size = size // frame * frame
    if size < frame or size % frame:
        raise DataError(
            f"{path}: {size} byte behind offset {options.offset} must be a multiple >= 1 of "
            f"{frame}, {count} channel(s) of {code[1:]}; check dtype, n_channels and offset"
        )
    layout = Flat(
        place=path,
        offset=options.offset,
        code=code,
        n_channels=count,
        n_samples=size // frame,
        interleaved=(options.order or "interleaved") == "interleaved",
    )
    if count > 1 and options.order is None:
        raise DataError(
            f"{path}: order must be 'interleaved' (sample by sample) or 'blocks' (channel by "
            f"channel) for {count} channels; give it"
        )
    part = FilePart(
        name="",
        about=f"{(count, layout.n_samples)}",
        channels=numbered(stem_of(path), count),
        named=False,
        n_samples=layout.n_samples,
        fetch=layout.fetch,
    )
    return Contents(parts=(part,))


# --- arrays


@dataclass(frozen=True, kw_only=True)
class Axes:
    """Assignment of the axes of an array."""

    record: int | None
    channels_first: bool
    n_channels: int
    n_samples: int


def array_axes(shape: Sequence[int], options: SourceOptions, name: str) -> Axes:
    """Meaning of the axes of an array: one channel, or time along the longer side.

    Parameters
    ----------
    shape : sequence of int
        One axis; two of channels and samples, in either order; three with the record first.
    options : SourceOptions
        `order` decides if the sides are equal, `record` selects along the first of three axes.
    name : str
        Name of the array, for messages.

    Raises
    ------
    DataError
        If the number of axes is wrong, one is empty, the sides are equal, there are too many
        channels, or there is no such record.

    Examples
    --------
    >>> array_axes((2, 50), SourceOptions(), "x")
    Axes(record=None, channels_first=True, n_channels=2, n_samples=50)
    """
    if not 1 <= len(shape) <= 3 or 0 in shape:
        raise DataError(
            f"{name} has shape {tuple(shape)}, must have 1 to 3 axes and no empty one; choose "
            "another variable"
        )
    if options.rows is not None and len(shape) == 3:
        raise DataError(
            f"{name} has shape {tuple(shape)}, must have 2 axes for rows = {options.rows}; leave "
            "rows out and choose one with record"
        )
    n_records = shape[0] if len(shape) == 3 else 1
    if options.rows is None and options.record >= n_records:
        raise DataError(
            f"{name}: record = {options.record} must be >= 0 and < {n_records}; choose another"
        )
    # one axis is one channel
    first, last = (1, *shape)[-2:]
    order = "blocks" if options.rows is not None and options.order is None else options.order
    if first == last != 1 and order is None:
        raise DataError(
            f"{name} has shape {tuple(shape)}, whose sides are equal; give order, 'interleaved' "
            "(time down the rows) or 'blocks' (a row is a channel)"
        )
    blocks = first <= last if order is None else order == "blocks"
    channels_first = blocks or len(shape) == 1
    n_channels, n_samples = (first, last) if channels_first else (last, first)
    if n_channels > (MOST_CHANNELS if options.rows is None else MOST_ROWS):
        raise DataError(
            f"{name} has {n_channels} channels, must have <= {MOST_CHANNELS}; give order or "
            "choose another variable"
        )
    return Axes(
        record=options.record if len(shape) == 3 else None,
        channels_first=channels_first,
        n_channels=n_channels,
        n_samples=n_samples,
    )


def npy_contents(path: Path, options: SourceOptions) -> Contents:
    """One array of real numbers, read in place; never a pickle.

    Raises
    ------
    DataError
        If it is not an NPY file, damaged, shorter than its header says, or holds no real numbers.
    """
    with path.open("rb") as handle:
        if handle.read(6) != b"\x93NUMPY":
            raise foreign(path, "NPY")
        handle.seek(0)
        shape, fortran, dtype = _npy_header(path, str(path), handle)
        offset = handle.tell()
    part = _npy_part(path, path, "", stem_of(path), (shape, fortran, dtype), offset, options)
    size, needed = path.stat().st_size, offset + math.prod(shape) * dtype.itemsize
    if size != needed:
        raise DataError(
            f"{path} has {size} byte, must be {needed} for its shape {shape}; take an intact copy"
        )
    return Contents(parts=(part,))


_Header = tuple[tuple[int, ...], bool, np.dtype[Any]]


def _npy_header(path: Path, name: str, handle: Any) -> _Header:
    """Shape, Fortran order and type; real numbers only."""
    try:
        version = np.lib.format.read_magic(handle)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }.get(version)
        if read is None:
            raise DataError(f"{name} has NPY version {version}, must be 1.0 or 2.0; save it again")
        shape, fortran, dtype = read(handle)
    except DataError:
        raise
    # a forged header is Python text, and the parser raises many types of errors
    except Exception as error:
        raise damaged(path, error) from error
    if dtype.hasobject:
        raise DataError(f"{name} holds pickled objects, which could run code; save numbers")
    if dtype.kind not in "iuf" or dtype.itemsize > 8:
        raise DataError(f"{name} holds {dtype}, must be real numbers of <= 64 bits; save those")
    if min(shape, default=1) < 0:
        raise DataError(f"{name} has shape {shape}, must be >= 0; take an intact copy")
    return shape, fortran, dtype


def _npy_part(
    path: Path,
    place: Path | Callable[[], memoryview],
    name: str,
    stem: str,
    header: _Header,
    offset: int,
    options: SourceOptions,
) -> FilePart:
    shape, fortran, dtype = header
    axes = array_axes(shape, options, f"{path}: {name or 'array'}")
    if fortran and len(shape) == 3:
        raise DataError(
            f"{path}: {name or 'array'} has 3 axes in Fortran order, must be C order; save it with "
            "np.ascontiguousarray"
        )
    skipped = (axes.record or 0) * axes.n_channels * axes.n_samples
    layout = Flat(
        place=place,
        offset=offset + skipped * dtype.itemsize,
        code=dtype.str,
        n_channels=axes.n_channels,
        n_samples=axes.n_samples,
        interleaved=axes.channels_first == (fortran and len(shape) > 1),
    )
    return FilePart(
        name=name,
        about=f"{shape}",
        channels=numbered(stem, axes.n_channels),
        named=False,
        n_samples=axes.n_samples,
        fetch=layout.fetch,
    )


def npz_contents(path: Path, options: SourceOptions) -> Contents:
    """Arrays of an NPZ archive; stored ones are read in place, compressed ones decompressed whole.

    Raises
    ------
    DataError
        If it is not an archive or damaged, or the requested array holds no real numbers or
        decompresses beyond :data:`LARGEST_INFLATED`.
    """
    with path.open("rb") as handle:
        if handle.read(4) != b"PK\x03\x04":
            raise foreign(path, "NPZ")
    try:
        archive = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise damaged(path, error) from error
    with archive:
        found = [_npz_member(path, archive, info, options) for info in archive.infolist()]
        rate = _npz_rate(archive)
    return Contents(
        parts=tuple(
            replace(part, sample_rate=rate.declared, rate_note=rate.note, rate_seen=rate.seen)
            for part in found
            if isinstance(part, FilePart)
        ),
        others=tuple(item for item in found if isinstance(item, str)),
    )


def _npz_rate(archive: zipfile.ZipFile) -> RateNote:
    """Rate from a single number under the name of a rate."""
    for info in archive.infolist():
        name = info.filename.removesuffix(".npy")
        if not is_rate_name(name) or info.file_size > _LONGEST_HEADER:
            continue
        try:
            value = np.load(io.BytesIO(archive.read(info)), allow_pickle=False)
            return rate_note(name, float(value.item()))
        except (*_NO_NUMBER, zipfile.BadZipFile, zlib.error):  # anything else is not a rate
            continue
    return RateNote()


_NO_NUMBER = (ValueError, TypeError, EOFError, OSError, NotImplementedError, MemoryError)


def _npz_member(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, options: SourceOptions
) -> FilePart | str:
    """A part, or why it is none; the reason is an error if this member is requested."""
    name = info.filename.removesuffix(".npy")
    try:
        return _npz_part(path, archive, info, name, options)
    except DataError as error:
        if name in options.variables:
            raise
        return f"{name}: {str(error).partition(': ')[2] or error}".partition(";")[0]


def _npz_part(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str, options: SourceOptions
) -> FilePart:
    label = f"{path}: {name}"
    if not info.filename.endswith(".npy"):
        raise DataError(f"{label} is no array; choose another variable")
    if info.compress_type != zipfile.ZIP_STORED and info.file_size > LARGEST_INFLATED:
        raise DataError(
            f"{label} inflates to {info.file_size} byte, must be <= {LARGEST_INFLATED}; save it "
            "with numpy.save"
        )
    try:
        with archive.open(info) as member:
            head = io.BytesIO(member.read(_LONGEST_HEADER))
    # zipfile raises many types of errors on damaged or foreign archives
    except Exception as error:
        raise damaged(path, error) from error
    header = _npy_header(path, label, head)
    offset = head.tell()
    shape, _, dtype = header
    needed = offset + math.prod(shape) * dtype.itemsize
    if needed != info.file_size:
        raise DataError(
            f"{label} has {info.file_size} byte, must be {needed} for its shape {shape}; take an "
            "intact copy"
        )
    if info.compress_type == zipfile.ZIP_STORED:
        start = _stored_at(path, info)
        return _npy_part(path, path, name, name, header, start + offset, options)
    return _npy_part(path, _inflater(path, info), name, name, header, offset, options)


def _inflater(path: Path, info: zipfile.ZipInfo) -> Callable[[], memoryview]:
    """Content of a member, decompressed on first use; its size has been checked."""

    @cache
    def content() -> memoryview:
        try:
            with zipfile.ZipFile(path) as archive:
                return memoryview(archive.read(info))
        except Exception as error:  # as above
            raise damaged(path, error) from error

    return content


def _stored_at(path: Path, info: zipfile.ZipInfo) -> int:
    """Start of the bytes of a stored member, after its local header."""
    with path.open("rb") as handle:
        handle.seek(info.header_offset)
        head = handle.read(_LOCAL_HEADER)
    if len(head) < _LOCAL_HEADER:
        raise cut(path, path.stat().st_size, info.header_offset + _LOCAL_HEADER)
    names, extra = np.frombuffer(head, dtype="<u2", count=2, offset=26).tolist()
    start = info.header_offset + _LOCAL_HEADER + int(names) + int(extra)
    if start + info.file_size > path.stat().st_size:
        raise cut(path, path.stat().st_size, start + info.file_size)
    return start


_LOCAL_HEADER = 30  # byte, of a ZIP member, before its name
_LONGEST_HEADER = 2**16  # byte, of an NPY array
