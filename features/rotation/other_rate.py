"""Knocks of another machine in the recording of one: at a rate that its own turn does not have."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.fft import fast_length, rfft
from ..signal.rate import check_rate
from ..signal.spectrum import hann

Float = NDArray[np.float64]

RATIOS: Final = (0.55, 1.85)
"""Rates that are looked for, over the shaft's own [-]."""

HARMONICS: Final = 14
"""Multiples of a rate that knocks are looked for at."""

_BLOCK_S = 0.0025  # of one level: a knock is a few of them long
_BINS = 48  # of a turn
_SMOOTHED = 5  # bins, of the scatter in a turn
_LEAST_SCATTER = 0.02  # nepers^2: noise in a block of 64 samples has 0.04
_FEWEST_TURNS = 6.0
_PADDING = 4
_STEPS = 2  # of the rate, to a line at the highest multiple
_OWN_LINES = 1.6  # lines about a multiple of the own rate: it belongs to that
_BESIDE = 0.03  # of the own rate: the same speed cannot be told
_SIMPLE_REACH = 0.006
_SIMPLE = sorted({n / m for m in range(1, 6) for n in range(1, 10)})  # loose pins turn in them
_BACKGROUND_ORDERS = 4.0  # to either side, whose mean is the background
_LOUDEST = 6.0  # medians, that a line may add to the background
_NOISE = 0.6  # mean of log(1 + power over background) of noise
_LEAST_SHARE = 0.35  # of the multiples must be free of the own ones
_SILENCE = 1e-30


class OtherRate(NamedTuple):
    """Rate of knocks that the own turn does not explain.

    Attributes
    ----------
    rate_hz : float
        [Hz]
    evidence : float
        Mean over its multiples of ``log(1 + power over background)``, less that of noise, times
        the root of their number [-].
    """

    rate_hz: float
    evidence: float


UNHEARD: Final = OtherRate(0.0, 0.0)
"""Of a recording too short to tell."""


def other_rate(x: Sequence[ArrayLike], fs: float, marks: ArrayLike) -> OtherRate:
    """Likeliest rate of another machine's knocks.

    Parameters
    ----------
    x : sequence of array_like, shape (n_channels, n_samples)
        Signals [any units].
    fs : float
        Sample rate [Hz].
    marks : array_like, shape (n_turns + 1,)
        When each turn of the own shaft begins [s], increasing.

    Returns
    -------
    OtherRate
        Between 0.55 and 1.85 times the own; :data:`UNHEARD` of less than six turns.

    Raises
    ------
    ValueError
        The rate is not positive.

    Notes
    -----
    The level of the second difference, in nepers, in blocks of 2.5 ms, which turns knocks of any
    strength into the same few nepers. From each channel's the mean at every angle of the own turn
    is taken, and the rest divided by its scatter there: where the own machine is quiet, another is
    heard. In the spectrum of their sum, knocks stand at the multiples of their rate. Left out are
    what is beside the own multiples, rates within 3 % of the own, and its simple ratios (2/3, 3/2,
    up to fifths), in which a loose joint moves by itself.

    Examples
    --------
    >>> rng, fs = np.random.default_rng(0), 10_000.0
    >>> t = np.arange(60_000) / fs
    >>> def knocks(rate):
    ...     return np.exp(-300 * ((t * rate) % 1) / rate) * rng.standard_normal(t.size)
    >>> own, other, noise = knocks(5.0), knocks(6.1), rng.standard_normal(t.size)
    >>> marks = np.arange(0, 6, 0.2)
    >>> round(other_rate([own + 0.1 * other + 0.01 * noise], fs, marks).rate_hz, 2)
    6.1
    >>> other_rate([own + 0.01 * noise], fs, marks).evidence < 4
    True
    """
    check_rate(fs)
    begins = np.asarray(marks, dtype=np.float64)
    signals = [np.asarray(row) for row in x]
    block = max(4, round(_BLOCK_S * fs))
    n_blocks = (signals[0].size - 2) // block
    centres = ((np.arange(n_blocks) + 0.5) * block + 1) / fs
    if begins.size < _FEWEST_TURNS + 1:
        return UNHEARD
    inside = (centres >= begins[0]) & (centres <= begins[-1])
    turn = np.interp(centres[inside], begins, np.arange(begins.size)) % 1
    rest = sum(
        (_unexplained(_levels(row, block)[inside], turn) for row in signals),
        start=np.zeros(turn.size),
    )
    own = (begins.size - 1) / float(begins[-1] - begins[0])
    return _likeliest(rest, fs / block, own)


def _levels(row: NDArray[np.floating], block: int) -> Float:
    """Of the second difference [Np of power, shape=(n_blocks,)]."""
    bent = row[2:] - 2 * row[1:-1] + row[:-2]
    blocks = bent[: bent.size // block * block].reshape(-1, block)
    power = np.einsum("ij,ij->i", blocks, blocks) / block
    return np.asarray(np.log(power.astype(np.float64) + _SILENCE))


def _unexplained(levels: Float, turn: Float) -> Float:
    """Without the mean at each angle, over the scatter there."""
    cell = np.minimum((turn * _BINS).astype(np.intp), _BINS - 1)
    count = np.maximum(np.bincount(cell, minlength=_BINS), 1)
    rest = levels - (np.bincount(cell, levels, minlength=_BINS) / count)[cell]
    scatter = np.bincount(cell, rest * rest, minlength=_BINS) / count
    half = _SMOOTHED // 2
    around = np.pad(scatter, half, mode="wrap")
    smooth = np.convolve(around, np.full(_SMOOTHED, 1 / _SMOOTHED), mode="valid")
    return np.asarray(rest / np.sqrt(np.maximum(smooth, _LEAST_SCATTER))[cell])


def _likeliest(rest: Float, rate: float, own: float) -> OtherRate:
    lasts = rest.size / rate
    if lasts * own < _FEWEST_TURNS:
        return UNHEARD
    length = fast_length(_PADDING * rest.size)
    power = np.abs(rfft(np.pad(rest * hann(rest.size), (0, length - rest.size)))) ** 2
    step = rate / length
    found = np.log1p(power / _background(power, own / step))
    orders = np.arange(power.size) * step / own
    free = np.abs(orders - np.round(orders)) * own >= _OWN_LINES / lasts
    rates = _rates(own, 1 / (_STEPS * HARMONICS * lasts))
    place = np.rint(np.outer(rates / step, np.arange(1, HARMONICS + 1))).astype(np.intp)
    place = np.minimum(place, power.size - 1)
    free[-1] = False  # where those beyond the highest line are looked up
    sums = (free * (found + 1j))[place].sum(axis=1)  # one look-up for both
    counted = np.maximum(sums.imag, _LEAST_SHARE * HARMONICS)
    evidence = (sums.real - _NOISE * sums.imag) / np.sqrt(counted)
    best = int(np.argmax(evidence))
    return OtherRate(float(rates[best]), float(evidence[best]))


def _background(power: Float, lines_an_order: float) -> Float:
    """Mean of the lines around each, strong ones cut down."""
    middle = float(np.median(power[: math.ceil(25 * lines_an_order)]))
    capped = np.append(0.0, np.cumsum(np.minimum(power, _LOUDEST * middle)))
    reach = math.ceil(_BACKGROUND_ORDERS * lines_an_order)
    place = np.arange(power.size)
    low, high = np.maximum(place - reach, 0), np.minimum(place + reach + 1, power.size)
    return np.asarray(np.maximum((capped[high] - capped[low]) / (high - low), _SILENCE))


def _rates(own: float, step: float) -> Float:
    """Rates that are tried [Hz]."""
    ratios = np.arange(RATIOS[0], RATIOS[1], step / own)
    above = np.searchsorted(_SIMPLE, ratios)
    simple = np.array(_SIMPLE)
    apart = np.minimum(np.abs(ratios - simple[above]), np.abs(ratios - simple[above - 1]))
    kept = (apart >= _SIMPLE_REACH) & (np.abs(ratios - 1) >= _BESIDE)
    return np.asarray(own * ratios[kept])
