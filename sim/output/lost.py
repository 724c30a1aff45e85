"""Samples that were lost: stretches in which a channel stands still though nothing came to rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LONG = 64
"""Samples of a stretch, at least: loggers lose whole blocks."""

_CUT_OFF = 4  # steps of the converter: a signal that comes to rest does it by its smallest step
_APART = 0.02  # of the swing: a signal that reaches an extreme by itself has samples next to it


@dataclass(frozen=True, kw_only=True)
class LostSamples:
    """Where a channel stands still.

    Attributes
    ----------
    count, stretches : int
        Samples in such stretches, and how many of these there are.
    start, value : int and float
        First sample of the longest, and what it repeats [unit of the channel].
    """

    count: int
    stretches: int
    start: int
    value: float


def lost_samples(row: NDArray[np.floating]) -> LostSamples | None:
    """Samples that a recorder lost and filled up with zeros or with the last value.

    Parameters
    ----------
    row : numpy.ndarray [shape=(n_samples,)]
        A vibration: of a force or a pressure, standing still is no loss.

    Returns
    -------
    LostSamples or None
        None where no value is repeated over 64 samples, where most of such stretches are entered
        by small steps (a coarse converter between two blows, a machine at rest), and where the
        signal reaches the value by itself at one of its ends (saturation).

    Examples
    --------
    >>> wave = np.sin(np.arange(1000.0))
    >>> lost_samples(wave) is None
    True
    >>> wave[300:400] = 0.0
    >>> lost_samples(wave)
    LostSamples(count=100, stretches=1, start=300, value=0.0)
    """
    few = row[:: LONG // 2]
    if not (few[1:] == few[:-1]).any():
        return None  # a long stretch holds two of these, and looking at all is slow
    step = np.abs(np.diff(row))
    moves = np.flatnonzero(step)
    edges = np.concatenate([[0], moves + 1, [row.size]])
    length = np.diff(edges)
    long = np.flatnonzero(length >= LONG)
    if not long.size or not moves.size:
        return None
    ends = [end for end in (row.min(), row.max()) if _reached(row, end)]
    # the first stretch is not entered but left
    across = step[np.where(long > 0, edges[long], 1 + edges[1]) - 1]
    cut_off = across > _CUT_OFF * step[moves].min()
    lost = long[cut_off & ~np.isin(row[edges[long]], ends)]
    if 2 * lost.size <= long.size:
        return None
    start = int(edges[lost[length[lost].argmax()]])
    return LostSamples(
        count=int(length[lost].sum()),
        stretches=int(lost.size),
        start=start,
        value=float(row[start]),
    )


def _reached(row: NDArray[np.floating], end: float) -> bool:
    """Whether a signal comes near an extreme before it is there."""
    apart = np.abs(row - end)
    return bool(((apart > 0) & (apart <= _APART * np.ptp(row))).any())
