"""Lost samples: stretches in which a channel is constant although the machine runs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LONG = 64
"""Least length of a stretch in samples: loggers lose whole blocks."""

_CUT_OFF = 4  # steps of the converter: a signal that comes to rest ends in small steps
_CLOSE = 0.02  # of the swing: an extreme of the signal itself has close samples next to it


@dataclass(frozen=True, kw_only=True)
class LostSamples:
    """Stretches in which a channel is constant.

    Attributes
    ----------
    count, stretches : int
        Number of samples in such stretches, and number of stretches.
    start, value : int and float
        First sample of the longest stretch, and its value [unit of the channel].
    """

    count: int
    stretches: int
    start: int
    value: float


def lost_samples(row: NDArray[np.floating]) -> LostSamples | None:
    """Find samples that a recorder lost and replaced by zeros or the last value.

    Parameters
    ----------
    row : numpy.ndarray [shape=(n_samples,)]
        A vibration; a constant force or pressure is no loss.

    Returns
    -------
    LostSamples or None
        None if no value is repeated over 64 samples, if most of such stretches are entered
        by small steps (a coarse converter between two blows, a machine at rest), and if the
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
        return None  # a long stretch has two of these; checking all is slow
    step = np.abs(np.diff(row))
    moves = np.flatnonzero(step)
    edges = np.concatenate([[0], moves + 1, [row.size]])
    length = np.diff(edges)
    long = np.flatnonzero(length >= LONG)
    if not long.size or not moves.size:
        return None
    ends = [end for end in (row.min(), row.max()) if _reached(row, end)]
    # the first stretch has an end but no entry
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
    """Whether a signal has values close to an extreme before it reaches it."""
    distance = np.abs(row - end)
    return bool(((distance > 0) & (distance <= _CLOSE * np.ptp(row))).any())
