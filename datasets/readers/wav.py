"""WAV: RIFF, RIFX and RF64 with integers of 1 to 64 bits, floats, mu-law or A-law."""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ..source.part import (
    DECLARED,
    MOST_CHANNELS,
    Contents,
    Fetch,
    FilePart,
    SourceOptions,
    cut,
    foreign,
)
from .flat import Flat, numbered, stem_of

_PCM, _FLOAT, _A_LAW, _MU_LAW, _EXTENSIBLE = 1, 3, 6, 7, 0xFFFE
_COMPANDED_BITS = 16  # of the integers that G.711 expands to

_UNKNOWN_SIZE = 0xFFFFFFFF
_MOST_CHUNKS = 10_000


@dataclass(frozen=True, kw_only=True)
class _Format:
    """Content of the fmt chunk."""

    kind: int
    n_channels: int
    rate: int
    frame: int
    bits: int

    @property
    def width(self) -> int:
        """Container of one sample [byte]; 0 if frames are not whole containers."""
        whole = self.n_channels > 0 and self.frame % self.n_channels == 0
        return self.frame // self.n_channels if whole else 0


def wav_contents(path: Path, options: SourceOptions) -> Contents:
    """The one recording of a WAV file.

    Integers are returned as stored, those of one byte less their midpoint, as parts of full scale.
    Samples with fewer bits than their container lie at its upper end. Mu-law and A-law are expanded
    to integers of 16 bits.

    Raises
    ------
    DataError
        If it is not a WAV file, truncated (unless `partial` is set), of another coding, or its
        header contradicts itself.

    References
    ----------
    Mu-law and A-law: ITU-T G.711.
    """
    size = path.stat().st_size
    with path.open("rb") as handle:
        head = handle.read(12)
        order = {b"RIFF": "<", b"RF64": "<", b"RIFX": ">"}.get(head[:4])
        if order is None or head[8:12] != b"WAVE":
            raise foreign(path, "WAV")
        chunks = _chunks(path, handle, order, size, options.partial)
    place, length = chunks.get(b"data", (0, 0))
    if b"fmt " not in chunks or place == 0:
        missing = "data" if b"fmt " in chunks else "fmt"
        raise DataError(f"{path} has no {missing} chunk; it is cut short, take an intact copy")
    form = _format(path, chunks[b"fmt "], order)
    _refuse_coding(path, form)
    declared = length // form.frame
    if options.partial:
        length = min(length, size - place) // form.frame * form.frame
    if length < form.frame or length % form.frame:
        raise DataError(
            f"{path}: {length} byte of samples must be a multiple >= 1 of {form.frame}, the frame; "
            "take an intact copy"
        )
    return Contents(parts=(_part(path, form, order, place, length // form.frame, declared),))


def _part(
    path: Path, form: _Format, order: str, place: int, n_samples: int, declared: int
) -> FilePart:
    letter = "f" if form.kind == _FLOAT else "i"
    code = f"{order}{letter}{form.width}" if form.width > 1 else "|u1"
    layout = Flat(
        place=path,
        offset=place,
        code=code,
        n_channels=form.n_channels,
        n_samples=n_samples,
        interleaved=True,
    )
    fetch: Fetch = layout.fetch
    bits = 8 * form.width
    if form.kind in _TABLES:
        fetch, bits = _expanded(layout.fetch, _TABLES[form.kind]), _COMPANDED_BITS
    elif code == "|u1":
        fetch = _signed(layout.fetch)
    return FilePart(
        name="",
        about=f"{(form.n_channels, n_samples)}",
        channels=numbered(stem_of(path), form.n_channels),
        named=False,
        n_samples=n_samples,
        fetch=fetch,
        sample_rate=float(form.rate),
        bits=0 if form.kind == _FLOAT else bits,
        conditions={DECLARED: float(declared)} if n_samples < declared else {},
    )


def _expanded(fetch: Fetch, table: NDArray[np.int16]) -> Fetch:
    return lambda start, stop, rows: table[fetch(start, stop, rows)]


def _mu_law() -> NDArray[np.int16]:
    """Value of every byte: sign, segment and step, all inverted."""
    byte = 255 - np.arange(256, dtype=np.int32)
    segment, step = (byte >> 4) & 7, byte & 15
    size = ((2 * step + 33) << segment) - 33
    return (4 * np.where(byte & 0x80, -size, size)).astype(np.int16)  # 14 bits at the upper end


def _a_law() -> NDArray[np.int16]:
    """The same with every second bit inverted; the first segment is as coarse as the next."""
    byte = (np.arange(256, dtype=np.uint8) ^ 0x55).astype(np.int32)
    segment, step = (byte >> 4) & 7, byte & 15
    linear = 2 * step + np.where(segment > 0, 33, 1)
    size = linear << np.maximum(segment - 1, 0)
    whole: NDArray[np.int16] = (8 * np.where(byte & 0x80, size, -size)).astype(np.int16)
    return whole  # 13 bits at the upper end


_TABLES = {_MU_LAW: _mu_law(), _A_LAW: _a_law()}


def _signed(fetch: Fetch) -> Fetch:
    """Bytes less their midpoint: only 8-bit samples are unsigned."""
    return lambda start, stop, rows: fetch(start, stop, rows).astype(np.int16) - 128


def _chunks(
    path: Path, handle: BinaryIO, order: str, size: int, partial: bool
) -> dict[bytes, tuple[int, int]]:
    """Position and length of the first chunk of every name; each must lie within the file.

    With `partial` the samples need not.
    """
    found: dict[bytes, tuple[int, int]] = {}
    place, long_data = 12, 0
    for _ in range(_MOST_CHUNKS):
        handle.seek(place)
        head = handle.read(8)
        if len(head) < 8:
            return found
        name, length = head[:4], struct.unpack(f"{order}I", head[4:])[0]
        if name == b"ds64" and length >= 24:
            long_data = struct.unpack("<Q", handle.read(24)[8:16].ljust(8, b"\0"))[0]
        if name == b"data" and length == _UNKNOWN_SIZE:
            length = long_data or length
        samples = name == b"data"
        if place + 8 + length > size and not (samples and partial):
            raise cut(path, size, place + 8 + length, partial=samples)
        found.setdefault(name, (place + 8, length))
        place += 8 + length + length % 2  # chunks begin at even positions
    raise DataError(f"{path} has > {_MOST_CHUNKS} chunks, too many; take an intact copy")


def _format(path: Path, place: tuple[int, int], order: str) -> _Format:
    """Format tag, channels, rate, bytes of a frame and bits of a sample."""
    with path.open("rb") as handle:
        handle.seek(place[0])
        raw = handle.read(min(place[1], 40))
    if len(raw) < 16:
        raise DataError(f"{path}: fmt chunk has {len(raw)} byte, must be >= 16; take another copy")
    kind, channels, rate, _, frame, bits = struct.unpack(f"{order}HHIIHH", raw[:16])
    if kind == _EXTENSIBLE and len(raw) >= 28:
        # the first field of a GUID is an integer of 32 bits in the order of the file
        kind = struct.unpack(f"{order}I", raw[24:28])[0]
    return _Format(kind=kind, n_channels=channels, rate=rate, frame=frame, bits=bits)


def _refuse_coding(path: Path, form: _Format) -> None:
    """Refuse codings without samples of their own, and containers that do not fit them."""
    fits = {
        _PCM: 1 <= form.bits <= 64,
        _FLOAT: form.bits in (32, 64),
        _A_LAW: form.bits == 8,
        _MU_LAW: form.bits == 8,
    }
    if not fits.get(form.kind, False):
        raise DataError(
            f"{path}: coding {form.kind} of {form.bits} bits must be PCM (1) of 1 to 64 bits, "
            "float (3) of 32 or 64, A-law (6) or mu-law (7) of 8; export it as one of them"
        )
    exact = form.kind != _PCM
    least = form.bits // 8 if exact else -(-form.bits // 8)
    most = least if exact else 8
    if not (1 <= form.n_channels <= MOST_CHANNELS and least <= form.width <= most):
        raise DataError(
            f"{path}: {form.n_channels} channel(s) of {form.bits} bits in frames of {form.frame} "
            f"byte must be 1 to {MOST_CHANNELS} in {least} to {most} byte each; take an intact copy"
        )
