"""Channels of NaN only: inputs that were not connected."""

from dataclasses import replace

import numpy as np

from .part import FilePart

_PIECE = 2**16  # samples of a channel checked in one read


def without_empty(part: FilePart) -> FilePart:
    """The part without its channels of NaN only, which it names; unchanged if none would be left.

    Parameters
    ----------
    part : Part
        Part to check. Most channels cost one sample; those that begin and end with NaN are read
        whole.

    Examples
    --------
    >>> from wearstate.datasets.source.part import PartChannel
    >>> rows = np.array([[1.0, np.nan], [np.nan, np.nan]])
    >>> names = (PartChannel(name="a"), PartChannel(name="b"))
    >>> part = FilePart(
    ...     name="x",
    ...     about="",
    ...     channels=names,
    ...     named=True,
    ...     n_samples=2,
    ...     fetch=lambda start, stop, wanted: rows[list(wanted), start:stop],
    ... )
    >>> kept = without_empty(part)
    >>> [channel.name for channel in kept.channels], kept.empty
    (['a'], ('b',))
    """
    count = len(part.channels)
    if part.n_samples < 1 or count < 2:
        return part
    suspects = tuple(range(count))
    for at in (0, part.n_samples - 1):
        suspects = _still_empty(part, at, at + 1, suspects)
    for start in range(0, part.n_samples, _PIECE):
        suspects = _still_empty(part, start, min(start + _PIECE, part.n_samples), suspects)
    kept = [row for row in range(count) if row not in suspects]
    if not suspects or not kept:
        return part
    fetch = part.fetch
    return replace(
        part,
        channels=tuple(part.channels[row] for row in kept),
        fetch=lambda start, stop, rows: fetch(start, stop, tuple(kept[row] for row in rows)),
        empty=tuple(part.channels[row].name for row in suspects),
    )


def _still_empty(part: FilePart, start: int, stop: int, rows: tuple[int, ...]) -> tuple[int, ...]:
    """Those of some channels that are NaN throughout."""
    if not rows:
        return ()
    numbers = part.fetch(start, stop, rows)
    if numbers.dtype.kind != "f":
        return ()
    return tuple(row for row, own in zip(rows, numbers, strict=True) if np.isnan(own).all())
