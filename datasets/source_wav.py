"""WAV: RIFF, RIFX and RF64 with integers of 8 to 32 bits or floats, read in place."""

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np

from .record import DataError
from .source_flat import Flat, numbered, stem_of
from .source_part import MOST_CHANNELS, Contents, Fetch, Part, SourceOptions, cut, foreign

_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_KINDS = {
    _PCM: {8: "|u1", 16: "i2", 24: "i3", 32: "i4"},
    _FLOAT: {32: "f4", 64: "f8"},
}
"""Code of the samples by format tag and bits."""

_UNKNOWN_SIZE = 0xFFFFFFFF
_MOST_CHUNKS = 10_000


def wav_contents(path: Path, options: SourceOptions) -> Contents:
    """The one recording of a WAV file.

    Integers are given as the file holds them, 8 bits less their midpoint, and are parts of full
    scale. Samples of fewer bits than their container lie at its upper end.

    Raises
    ------
    DataError
        It is no WAV file, cut short, of another coding, or its header contradicts itself.
    """
    del options
    size = path.stat().st_size
    with path.open("rb") as handle:
        head = handle.read(12)
        order = {b"RIFF": "<", b"RF64": "<", b"RIFX": ">"}.get(head[:4])
        if order is None or head[8:12] != b"WAVE":
            raise foreign(path, "WAV")
        chunks = _chunks(path, handle, order, size)
    form, (place, length) = chunks.get(b"fmt "), chunks.get(b"data", (0, 0))
    if form is None or place == 0:
        missing = "fmt" if form is None else "data"
        raise DataError(f"{path} has no {missing} chunk; it is cut short, take an intact copy")
    kind, n_channels, rate, frame, bits = _format(path, form, order)
    code = _code(path, kind, bits, order)
    if not 1 <= n_channels <= MOST_CHANNELS or frame != n_channels * bits // 8:
        raise DataError(
            f"{path}: {n_channels} channel(s) of {bits} bits in frames of {frame} byte must be 1 "
            f"to {MOST_CHANNELS} and fill them; take an intact copy"
        )
    if length < frame or length % frame:
        raise DataError(
            f"{path}: {length} byte of samples must be a multiple >= 1 of {frame}, the frame; take "
            "an intact copy"
        )
    layout = Flat(
        place=path,
        offset=place,
        code=code,
        n_channels=n_channels,
        n_samples=length // frame,
        interleaved=True,
    )
    part = Part(
        name="",
        about=f"{(n_channels, layout.n_samples)}",
        channels=numbered(stem_of(path), n_channels),
        named=False,
        n_samples=layout.n_samples,
        fetch=_signed(layout.fetch) if code == "|u1" else layout.fetch,
        sample_rate=float(rate),
        bits=bits if kind == _PCM else 0,
    )
    return Contents(parts=(part,))


def _signed(fetch: Fetch) -> Fetch:
    """Bytes less their midpoint: only 8-bit samples are unsigned."""
    return lambda start, stop, rows: fetch(start, stop, rows).astype(np.int16) - 128


def _chunks(path: Path, handle: BinaryIO, order: str, size: int) -> dict[bytes, tuple[int, int]]:
    """Place and length of the first chunk of every name; each must lie within the file."""
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
        if place + 8 + length > size:
            raise cut(path, size, place + 8 + length)
        found.setdefault(name, (place + 8, length))
        place += 8 + length + length % 2  # chunks begin at even places
    raise DataError(f"{path} has > {_MOST_CHUNKS} chunks, the most believed; take an intact copy")


def _format(path: Path, place: tuple[int, int], order: str) -> tuple[int, int, int, int, int]:
    """Format tag, channels, rate, bytes of a frame and bits of a sample's container."""
    with path.open("rb") as handle:
        handle.seek(place[0])
        raw = handle.read(min(place[1], 40))
    if len(raw) < 16:
        raise DataError(f"{path}: fmt chunk has {len(raw)} byte, must be >= 16; take another copy")
    kind, channels, rate, _, frame, bits = struct.unpack(f"{order}HHIIHH", raw[:16])
    if kind == _EXTENSIBLE and len(raw) >= 26:
        kind = struct.unpack(f"{order}H", raw[24:26])[0]
    return kind, channels, rate, frame, bits


def _code(path: Path, kind: int, bits: int, order: str) -> str:
    code = _KINDS.get(kind, {}).get(bits)
    if code is None:
        raise DataError(
            f"{path}: coding {kind} of {bits} bits must be PCM (1) of 8, 16, 24 or 32 bits or "
            "float (3) of 32 or 64; export it as one of them"
        )
    return code if code.startswith("|") else order + code
