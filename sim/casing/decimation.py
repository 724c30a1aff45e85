"""Decimation of signals at the step rate: a linear-phase low-pass, in blocks."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special

from ..jit import kernel

PASS_BAND = 0.45
"""Upper edge of the flat band over the sample rate; 11.5 kHz at 25.6 kHz."""

_STOP_ATTENUATION_DB = 80.0

BLOCK = 576  # steps
_KEPT = 512  # samples per block of the decimation
PIECE = 16 * BLOCK  # steps processed together: intermediate results stay in the cache
_AT_ONCE = 8  # taps


@kernel
def write_rows(total: Any, first: int, n: int, row: Any) -> None:
    """Copy the first n values of a block to a position in a row."""
    for i in range(n):
        row[np.uint64(first + i)] = total[i]


def pieces(rows: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Rows in pieces of `PIECE` steps."""
    for first in range(0, rows.shape[1], PIECE):
        yield rows[:, first : first + PIECE]


@lru_cache(maxsize=8)
def decimation_filter(factor: int) -> NDArray[np.float64]:
    """Linear-phase low-pass at the step rate, before one sample in `factor` is kept.

    The mean over a step is itself a low-pass (a sinc); the filter compensates its droop, so
    that the result is flat to :data:`PASS_BAND` of the final rate. Half its length is a whole
    number of kept samples.
    """
    width = (1 - 2 * PASS_BAND) * 2 / factor  # of the fine Nyquist: 0.45 to 0.55 of the rate
    taps = math.ceil((_STOP_ATTENUATION_DB - 7.95) / 2.285 / (math.pi * width) + 1)  # Kaiser
    half = factor * math.ceil(taps / 2 / factor)
    edge = 1.0 / factor
    grid = np.linspace(0, edge, 129)
    gain = 1 / np.sinc(grid / 2)
    if factor == 1:
        return _windowed(2 * half + 1, grid, gain)
    grid[-1], after = edge - _STEP, edge + _STEP
    return _windowed(2 * half + 1, np.append(grid, [after, 1.0]), np.append(gain, [0.0, 0.0]))


_STEP = float(np.finfo(np.float64).eps)  # half the width of the transition


def _windowed(
    n: int, frequency: NDArray[np.float64], gain: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Linear-phase taps for a gain over the Nyquist frequency, by Kaiser's window.

    Same as ``scipy.signal.firwin2``, whose import takes as long as most simulations.
    """
    fine = np.linspace(0.0, 1.0, 2**15 + 1)
    turned = np.exp(-(n - 1) / 2.0 * 1j * np.pi * fine)
    beta = 0.1102 * (_STOP_ATTENUATION_DB - 8.7)
    middle = (n - 1) / 2
    root = np.sqrt(1 - ((np.arange(n) - middle) / middle) ** 2.0)
    window = special.i0(beta * root) / special.i0(beta)
    taps: NDArray[np.float64] = fft.irfft(np.interp(fine, frequency, gain) * turned)[:n] * window
    return taps


def decimate(means: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    """Low-pass signals with one value per step and keep one in `factor`, without delay.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_columns)]
        Means over steps, or the casing's response to them.
    factor : int
        Steps per sample, >= 1.

    Returns
    -------
    numpy.ndarray [shape=(n_steps // factor, n_columns)]
        Row k belongs to the middle of step ``k * factor``. Within :func:`edge_samples` of either
        end the filter includes zeros.
    """
    low = Decimation(means.shape[1], len(means), factor)
    low.add(means.T)
    return np.ascontiguousarray(low.finish().T)


class Decimation:
    """:func:`decimate` for rows that arrive in pieces; the same bytes.

    Parameters
    ----------
    n_rows, n_steps : int
        Total shape of all pieces.
    factor : int
        Steps per sample, >= 1.
    """

    def __init__(self, n_rows: int, n_steps: int, factor: int) -> None:
        self._phases = _filter_phases(factor)
        self._kept = np.empty((n_rows, n_steps // factor))
        self._done = 0
        self._advance = _KEPT * factor
        self._span = self._phases.size + self._advance  # steps that a block of samples depends on
        self._window = np.zeros((n_rows, self._span + max(PIECE + BLOCK, self._advance)))
        self._filled = edge_samples(factor) * factor  # zeros before the first step
        self._scratch = np.empty(_KEPT + self._phases.shape[1]), np.empty(_KEPT)

    def add(self, rows: NDArray[np.float64]) -> None:
        """Add the next steps [shape=(n_rows, n)]."""
        for piece in pieces(rows):
            n = piece.shape[1]
            self.room(n)[:] = piece
            self.take(n)

    def room(self, n: int) -> NDArray[np.float64]:
        """Buffer for the next n steps, at most ``PIECE + BLOCK`` [shape=(n_rows, n)]."""
        return self._window[:, self._filled : self._filled + n]

    def take(self, n: int) -> None:
        """Like :meth:`add`, for n steps already written into :meth:`room`."""
        self._filled += n
        self._keep()

    def _keep(self) -> None:
        blocks = max(0, (self._filled - self._span) // self._advance + 1)
        if not blocks:
            return
        begin, end = self._done, min(self._done + blocks * _KEPT, self._kept.shape[1])
        _low_pass(self._window, self._phases, *self._scratch, self._kept[:, begin:end])
        self._done, gone = end, blocks * self._advance
        self._filled -= gone
        self._window[:, : self._filled] = self._window[:, gone : gone + self._filled]

    def finish(self) -> NDArray[np.float64]:
        """Return the kept values [shape=(n_rows, n_steps // factor)], after the last step."""
        while self._done < self._kept.shape[1]:
            self._window[:, self._filled : self._span] = 0.0
            self._filled = max(self._filled, self._span)
            self._keep()
        return self._kept


@lru_cache(maxsize=8)
def _filter_phases(factor: int) -> NDArray[np.float64]:
    """Polyphase components of the filter, zero-padded."""
    taps = decimation_filter(factor)
    columns = _AT_ONCE * math.ceil(len(taps) / factor / _AT_ONCE)
    padded = np.zeros(columns * factor)
    padded[: len(taps)] = taps
    return np.ascontiguousarray(padded.reshape(columns, factor).T)


@kernel
def _pick(row: Any, first: int, factor: int, picked: Any) -> None:
    """Pick every factor-th value."""
    for i in range(picked.size):
        picked[i] = row[np.uint64(first + i * factor)]


@kernel
def _add_taps(total: Any, taps: Any, first: int, x: Any) -> None:
    """Add eight taps from the first on."""
    t0, t1, t2, t3 = taps[first], taps[first + 1], taps[first + 2], taps[first + 3]
    t4, t5, t6, t7 = taps[first + 4], taps[first + 5], taps[first + 6], taps[first + 7]
    for i in range(_KEPT):
        k = np.uint64(first + i)
        early = (t0 * x[k] + t1 * x[k + _ONE]) + (t2 * x[k + _TWO] + t3 * x[k + _THREE])
        late = (t4 * x[k + _FOUR] + t5 * x[k + _FIVE]) + (t6 * x[k + _SIX] + t7 * x[k + _SEVEN])
        total[i] += early + late


_ONE, _TWO, _THREE, _FOUR, _FIVE, _SIX, _SEVEN = (np.uint64(i) for i in range(1, 8))


@kernel
def _low_pass(rows: Any, phases: Any, picked: Any, total: Any, kept: Any) -> None:
    """Filter and keep one in `factor`, by polyphase components of filter and rows."""
    factor, columns = phases.shape
    n_kept = kept.shape[1]
    for c in range(len(rows)):
        for first in range(0, n_kept, _KEPT):
            total[:] = 0.0
            for phase in range(factor):
                _pick(rows[c], first * factor + phase, factor, picked)
                for tap in range(0, columns, _AT_ONCE):
                    _add_taps(total, phases[phase], tap, picked)
            write_rows(total, first, min(_KEPT, n_kept - first), kept[c])


def edge_samples(factor: int) -> int:
    """Samples at either end of a decimated record that are affected by the filter's length."""
    return (len(decimation_filter(factor)) // 2) // factor
