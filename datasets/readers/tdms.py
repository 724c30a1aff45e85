"""TDMS (LabVIEW) through the extra ``wearstate[tdms]``: metadata first, samples in pieces."""

import importlib
import io
import logging
import math
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ..source.part import (
    DECLARED,
    Contents,
    FilePart,
    PartChannel,
    SourceOptions,
    closed_on_failure,
    cut,
    damaged,
    foreign,
)

_LEAD_IN = 28  # byte
_UNFINISHED = 0xFFFFFFFFFFFFFFFF
_BIG_ENDIAN = 1 << 6
_MOST_CHANNELS = 10_000
_UNITS = ("unit_string", "NI_UnitDescription")
_SHORT = ("Last segment ", "Data size ", "Cropping data ")
"""Beginnings of the library's warnings that are only about missing samples."""


def tdms_contents(path: Path, options: SourceOptions) -> Contents:
    """Groups of a TDMS file; channels of one length and step in a group are one recording.

    Raises
    ------
    DataError
        If the library is not installed; the file is not TDMS or damaged; or it is truncated,
        unfinished or holds fewer samples than declared, unless `partial` is set.
    """
    try:
        nptdms: Any = importlib.import_module("nptdms")
    except ImportError:
        raise DataError(
            f"{path} needs nptdms, which is not installed; pip install 'wearstate[tdms]'"
        ) from None
    _walk_segments(path, options.partial)
    # opened here: the library would use an index file next to it, which may belong to another
    handle = _Bounded(io.FileIO(path))
    # the library raises errors of any type on damaged bytes
    with closed_on_failure(path, handle, Exception), _no_warning(path, options.partial):
        file = nptdms.TdmsFile.open(handle)
        contents = _groups(path, file, path.stat().st_size, options.partial)
    return Contents(parts=contents.parts, others=contents.others, close=handle.close)


class _Bounded(io.BufferedReader):
    """A file that never reserves memory for more than it holds, whatever length is declared."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Bytes from the current position, at most to the end."""
        if size is None or size < 0:
            return super().read()
        left = os.fstat(self.fileno()).st_size - self.tell()
        return super().read(min(size, max(left, 0)))


@contextmanager
def _no_warning(path: Path, partial: bool) -> Iterator[None]:
    """Treat the library's console warnings as damage, or else as missing samples."""
    console = importlib.import_module("nptdms.log").log_manager.console_handler

    def refuse(record: logging.LogRecord) -> bool:
        if str(record.msg).startswith(_SHORT):
            if partial:
                return False  # and is not printed
            raise DataError(
                f"{path} holds fewer samples than it declares ({record.getMessage()}); take an "
                "intact copy, or read what is there with partial"
            )
        # at the first one: a forged length would cause a million warnings, all kept in memory
        raise damaged(path, ValueError(record.getMessage()))

    console.addFilter(refuse)
    try:
        yield
    finally:
        console.removeFilter(refuse)


def _walk_segments(path: Path, partial: bool) -> None:
    """Every segment must lie within the file and end where the next begins; the last may be cut."""
    size, place = path.stat().st_size, 0
    with path.open("rb") as handle:
        if handle.read(4) != b"TDSm":
            raise foreign(path, "TDMS")
        while place < size:
            handle.seek(place)
            head = handle.read(_LEAD_IN)
            if len(head) < _LEAD_IN or head[:4] != b"TDSm":
                raise DataError(f"{path} has no segment at byte {place}; take an intact copy")
            order = ">" if struct.unpack("<I", head[4:8])[0] & _BIG_ENDIAN else "<"
            length, raw = struct.unpack(f"{order}QQ", head[12:28])
            open_end = length == _UNFINISHED
            if partial and (open_end or place + _LEAD_IN + length > size):
                return
            if open_end:
                raise DataError(
                    f"{path} ends with an unfinished segment; the recording was not closed, record "
                    "again, repair it in the program that wrote it, or read what is there with "
                    "partial"
                )
            if place + _LEAD_IN + length > size:
                raise cut(path, size, place + _LEAD_IN + length, partial=True)
            if raw > length:
                raise DataError(
                    f"{path}: samples begin {raw} byte into a segment of {length}, must be <=; "
                    "take an intact copy"
                )
            place += _LEAD_IN + length


def _groups(path: Path, file: Any, size: int, partial: bool) -> Contents:
    missing = _missing(file) if partial else {}
    parts: list[FilePart] = []
    others: list[str] = []
    total = 0
    for group in file.groups():
        channels = []
        for channel in group.channels():
            dtype = _dtype(channel)
            if dtype is None or len(channel) == 0:
                others.append(f"{group.name}/{channel.name}")
                continue
            total += len(channel) * dtype.itemsize
            channels.append(channel)
        if total > size or len(channels) > _MOST_CHANNELS:
            raise DataError(
                f"{path} declares {total} byte of samples and has {size}, must hold all; take an "
                "intact copy"
            )
        parts += _group_parts(path, str(group.name), channels, missing)
    return Contents(parts=tuple(parts), others=tuple(others))


def _dtype(channel: Any) -> np.dtype[Any] | None:
    """Type of stored real numbers, None for anything else."""
    stored = getattr(channel.data_type, "nptype", None)
    if stored is None or channel.data_type.__name__ == "DaqMxRawData":
        return np.dtype("f8") if channel.data_type.__name__ == "DaqMxRawData" else None
    return np.dtype(stored) if np.dtype(stored).kind in "iuf" else None


def _missing(file: Any) -> dict[str, int]:
    """Number of samples missing in the last segment, by path of the channel."""
    lacking = file.file_status.channel_statuses or {}
    return {path: max(s.expected_length - s.read_length, 0) for path, s in lacking.items()}


def _group_parts(
    path: Path, group: str, channels: Sequence[Any], missing: Mapping[str, int]
) -> list[FilePart]:
    """One part of channels that fit together; otherwise one for each.

    They fit if they declare the same number of samples; if truncated, the shortest gives the
    length.
    """
    rates = [_rate(path, channel) for channel in channels]
    whole = [len(channel) + missing.get(channel.path, 0) for channel in channels]
    alike = len(set(zip(whole, rates, strict=True))) == 1
    sets = [list(channels)] if alike else [[channel] for channel in channels]
    return [
        _group_part(path, group if alike else f"{group}/{members[0].name}", members, declared)
        for members, declared in zip(sets, whole, strict=False)
    ]


def _group_part(path: Path, name: str, members: Sequence[Any], declared: int) -> FilePart:
    n_samples = min(len(channel) for channel in members)
    return FilePart(
        name=name,
        about=f"({len(members)}, {n_samples})",
        channels=tuple(PartChannel(name=str(c.name), unit=_unit(c)) for c in members),
        named=True,
        n_samples=n_samples,
        fetch=partial(_fetch, path, tuple(members), n_samples < declared),
        sample_rate=_rate(path, members[0]),
        # the step is a double, its inverse need not be representable
        rate_doubt=4 * float(np.finfo(float).eps),
        conditions={DECLARED: float(declared)} if n_samples < declared else {},
    )


def _rate(path: Path, channel: Any) -> float | None:
    step = channel.properties.get("wf_increment")
    if step is None:
        return None
    if not isinstance(step, (int, float)) or not (math.isfinite(step) and step > 0):
        raise DataError(
            f"{path}: wf_increment of {channel.name} is {step!r}, must be a number > 0; take an "
            "intact copy"
        )
    return 1.0 / float(step)


def _unit(channel: Any) -> str | None:
    found = (channel.properties.get(name) for name in _UNITS)
    return next((str(unit).strip() for unit in found if unit and str(unit).strip()), None)


def _fetch(
    path: Path,
    members: Sequence[Any],
    short: bool,
    start: int,
    stop: int,
    rows: tuple[int, ...],
) -> NDArray[np.float64]:
    try:
        with _no_warning(path, short):
            found = [
                np.asarray(
                    members[row].read_data(offset=start, length=stop - start), dtype=np.float64
                )
                for row in rows
            ]
    except DataError:
        raise
    except Exception as error:  # as above
        raise damaged(path, error) from error
    shortest = min(len(row) for row in found)
    return np.stack([row[:shortest] for row in found])
