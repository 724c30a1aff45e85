"""A tacho at another sample rate: its pulses are redrawn from the times of their edges.

A filter would ring at every edge and move it by part of a sample; a tacho carries no information
but the times of its edges.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.edges import placed_edges
from ...features.rotation.order import HYSTERESIS_SHARE
from ...sim.output.recording import DataError

Read = Callable[[int, int], NDArray[np.float64]]
"""Samples [start, stop) of the tacho in the file."""

_PIECE = 2**20  # samples read at once
_RAMP = 1.0  # new samples on either side of an edge: the two around it then lie on one line
_LEAST = 3.0  # new samples that a pulse, and the gap after it, must last to reach its level


class ResampledTacho:
    """Pulses at a new rate, each edge a ramp of two samples through the time of the old one.

    :func:`~..features.order.pulse_times` finds the rising edges at the same times as at the rate of
    the file: those of a sampled logic level are smoothed here, and no longer tied to the samples of
    the file. A pulse shorter than three new samples is lengthened to three.

    Parameters
    ----------
    path : Path
        Path for messages.
    read : callable
        Reads samples of the file.
    n_samples : int
        Number of samples of the file.
    ratio : float
        New rate over that of the file.
    """

    def __init__(self, path: Path, read: Read, n_samples: int, ratio: float) -> None:
        self.path, self.read = path, read
        self.n_samples, self.ratio = n_samples, ratio

    def __call__(self, start: int, stop: int) -> NDArray[np.float64]:
        """New samples [shape=(stop - start,)].

        Raises
        ------
        DataError
            If pulses follow one another too fast for the rate.
        """
        times, levels = self._corners
        return np.interp(np.arange(start, stop), times, levels)

    @cached_property
    def _corners(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times [new samples] and levels of the corners of the piecewise linear signal."""
        low, high = self._extremes
        middle = (low + high) / 2
        if not low < middle < high:
            return np.array([0.0]), np.array([low])
        margin = HYSTERESIS_SHARE * (high - low) / 2
        rise = self.ratio * self._edges(middle, margin, 1.0)
        fall = self.ratio * self._edges(-middle, margin, -1.0)
        first_high = fall.size > 0 and (rise.size == 0 or fall[0] < rise[0])
        ends = self._ends(rise, fall[int(first_high) :])
        lead = np.minimum(fall[: int(first_high)], np.append(rise, np.inf)[0] - _LEAST)
        edges = np.sort(np.concatenate([lead, rise, ends]))
        before = np.arange(len(edges)) % 2 == (0 if first_high else 1)  # high before the edge
        if not edges.size:
            return np.array([0.0]), np.array([low])
        times = np.column_stack([edges - _RAMP, edges + _RAMP]).reshape(-1)
        steps = np.column_stack([before, ~before]).reshape(-1)
        return times, np.where(steps, high, low)

    def _ends(self, rise: NDArray[np.float64], fall: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ends of the pulses that begin at `rise`; a pulse without an end has none."""
        gaps = np.diff(rise)
        if gaps.size and gaps.min() < 2 * _LEAST:
            raise DataError(
                f"{self.path}: pulses of the tacho are {gaps.min():.3g} samples apart at the rate "
                f"of resample_to, must be >= {2 * _LEAST:g}; choose a higher rate"
            )
        latest = np.append(rise[1:] - _LEAST, np.inf)[: len(fall)]
        return np.asarray(np.minimum(np.maximum(fall, rise[: len(fall)] + _LEAST), latest))

    @cached_property
    def _extremes(self) -> tuple[float, float]:
        pieces = [self.read(a, b) for a, b in self._spans(0)]
        return min(float(p.min()) for p in pieces), max(float(p.max()) for p in pieces)

    def _spans(self, overlap: int) -> list[tuple[int, int]]:
        starts = range(0, self.n_samples, _PIECE)
        return [(max(0, a - overlap), min(a + _PIECE, self.n_samples)) for a in starts]

    def _edges(self, level: float, margin: float, sign: float) -> NDArray[np.float64]:
        """Rising edges of the signal times `sign` [samples of the file], as in a whole record."""
        found: list[_Crossings] = []
        state, last = 0, _Crossings(before=np.array([-1]), around=np.full((1, 4), np.nan))
        for start, stop in self._spans(1):
            crossings, volts = self._crossings(start, stop, level, sign)
            crossings = last.and_then(crossings)
            sides = (volts >= level + margin).astype(np.int8) - (volts <= level - margin)
            places = np.flatnonzero(sides)
            known = np.concatenate([[state], sides[places]])
            arrived = start + places[(known[:-1] < 0) & (known[1:] > 0)]
            # each rise has a crossing before it, perhaps in the previous piece
            found.append(crossings[np.searchsorted(crossings.before[1:], arrived, side="left")])
            state, last = int(known[-1]), crossings[-1:]
        low, high = sorted(sign * extreme for extreme in self._extremes)
        edges = reduce(_Crossings.and_then, found)
        line = edges.around[:, 1:3].T
        fraction = (level - line[0]) / (line[1] - line[0])
        share = (edges.around - low) / (high - low)
        placed = placed_edges(edges.before, share, edges.before + fraction)
        return np.asarray(np.clip(placed, 0.0, self.n_samples - 1))

    def _crossings(
        self, start: int, stop: int, level: float, sign: float
    ) -> tuple["_Crossings", NDArray[np.float64]]:
        """Upward crossings of a level by samples [start, stop) times `sign`, and the samples."""
        first, past = max(0, start - 1), min(stop + 2, self.n_samples)
        wide = np.full(stop - start + 3, np.nan)
        wide[first - start + 1 : past - start + 1] = sign * self.read(first, past)
        volts = wide[1 : stop - start + 1]
        below = np.flatnonzero((volts[:-1] < level) & (volts[1:] >= level))
        around = wide[below[:, np.newaxis] + np.arange(4)]
        return _Crossings(before=start + below, around=around), volts


@dataclass(frozen=True, kw_only=True, eq=False)
class _Crossings:
    """Upward crossings of a level.

    Attributes
    ----------
    before : numpy.ndarray [shape=(n,)]
        Last sample below the level.
    around : numpy.ndarray [shape=(n, 4)]
        Samples from the one before that to the two after it, NaN outside the file.
    """

    before: NDArray[np.intp]
    around: NDArray[np.float64]

    def __getitem__(self, key: "slice | NDArray[np.intp]") -> "_Crossings":
        return _Crossings(before=self.before[key], around=self.around[key])

    def and_then(self, other: "_Crossings") -> "_Crossings":
        """Both sets of crossings, one after the other."""
        return _Crossings(
            before=np.concatenate([self.before, other.before]),
            around=np.concatenate([self.around, other.around]),
        )
