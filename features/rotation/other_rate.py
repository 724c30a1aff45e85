"""Knocks of another machine in a recording: at a rate that the own rotation does not have."""

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
"""Range of the search, as multiples of the shaft's own rate [-]."""

HARMONICS: Final = 14
"""Number of multiples of a rate that are searched for knocks."""

_BLOCK_S = 0.0025  # one level each; a knock lasts a few of them
_BINS = 48  # per turn
_SMOOTHED = 5  # bins, for the scatter within a turn
_LEAST_SCATTER = 0.02  # nepers^2: noise in a block of 64 samples has 0.04
_FEWEST_TURNS = 6.0
_PADDING = 4
_STEPS = 2  # per line width at the highest multiple, in the search over rates
_OWN_LINES = 1.6  # lines this near to a multiple of the own rate belong to it
_BESIDE = 0.03  # of the own rate: nearer rates cannot be distinguished from it
_SIMPLE_REACH = 0.006
_SIMPLE = sorted({n / m for m in range(1, 6) for n in range(1, 10)})  # ratios of loose pins
_BACKGROUND_ORDERS = 4.0  # on either side; their mean is the background
_LOUDEST = 6.0  # medians, the most that a line adds to the background
_NOISE = 0.6  # mean of log(1 + power over background) for noise
_LEAST_SHARE = 0.35  # of the multiples must be clear of the own ones
_SILENCE = 1e-30


class OtherRate(NamedTuple):
    """Rate of knocks that the machine's own rotation does not explain.

    Attributes
    ----------
    rate_hz : float
        Rate [Hz].
    evidence : float
        Mean over the multiples of the rate of ``log(1 + power over background)``, less that of
        noise, times the root of their number [-].
    """

    rate_hz: float
    evidence: float


NO_OTHER_RATE: Final = OtherRate(0.0, 0.0)
"""Result for a recording that is too short."""


def other_rate(x: Sequence[ArrayLike], fs: float, marks: ArrayLike) -> OtherRate:
    """Most likely rate of another machine's knocks.

    Parameters
    ----------
    x : sequence of array_like, shape (n_channels, n_samples)
        Signals [any units].
    fs : float
        Sample rate [Hz].
    marks : array_like, shape (n_turns + 1,)
        Start of each turn of the own shaft [s], increasing.

    Returns
    -------
    OtherRate
        Rate between 0.55 and 1.85 times the own; :data:`NO_OTHER_RATE` for less than six turns.

    Raises
    ------
    ValueError
        If the rate is not positive.

    Notes
    -----
    The level of the second difference is taken in blocks of 2.5 ms in nepers, so that knocks of any
    strength count with the same few nepers. The mean at every angle of the own turn is subtracted
    for each channel, and the rest divided by its scatter there, which emphasises the angles at
    which the own machine is quiet. In the spectrum of the sum of the channels, knocks appear at the
    multiples of their rate. Left out are lines next to the own multiples, rates within 3 % of the
    own, and its simple ratios (2/3, 3/2, up to fifths), at which a loose joint moves by itself.

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
        return NO_OTHER_RATE
    inside = (centres >= begins[0]) & (centres <= begins[-1])
    turn = np.interp(centres[inside], begins, np.arange(begins.size)) % 1
    rest = sum(
        (_unexplained(_levels(row, block)[inside], turn) for row in signals),
        start=np.zeros(turn.size),
    )
    own = (begins.size - 1) / float(begins[-1] - begins[0])
    return _likeliest(rest, fs / block, own)


def _levels(row: NDArray[np.floating], block: int) -> Float:
    """Level of the second difference [Np of power, shape=(n_blocks,)]."""
    bent = row[2:] - 2 * row[1:-1] + row[:-2]
    blocks = bent[: bent.size // block * block].reshape(-1, block)
    power = np.einsum("ij,ij->i", blocks, blocks) / block
    return np.asarray(np.log(power.astype(np.float64) + _SILENCE))


def _unexplained(levels: Float, turn: Float) -> Float:
    """Levels less their mean at each angle, over the scatter there."""
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
        return NO_OTHER_RATE
    length = fast_length(_PADDING * rest.size)
    power = np.abs(rfft(np.pad(rest * hann(rest.size), (0, length - rest.size)))) ** 2
    step = rate / length
    found = np.log1p(power / _background(power, own / step))
    orders = np.arange(power.size) * step / own
    free = np.abs(orders - np.round(orders)) * own >= _OWN_LINES / lasts
    rates = _rates(own, 1 / (_STEPS * HARMONICS * lasts))
    place = np.rint(np.outer(rates / step, np.arange(1, HARMONICS + 1))).astype(np.intp)
    place = np.minimum(place, power.size - 1)
    free[-1] = False  # multiples beyond the highest line refer to it
    sums = (free * (found + 1j))[place].sum(axis=1)  # sum and count in one look-up
    counted = np.maximum(sums.imag, _LEAST_SHARE * HARMONICS)
    evidence = (sums.real - _NOISE * sums.imag) / np.sqrt(counted)
    best = int(np.argmax(evidence))
    return OtherRate(float(rates[best]), float(evidence[best]))


def _background(power: Float, lines_an_order: float) -> Float:
    """Mean of the lines around each, with strong lines capped."""
    middle = float(np.median(power[: math.ceil(25 * lines_an_order)]))
    capped = np.append(0.0, np.cumsum(np.minimum(power, _LOUDEST * middle)))
    reach = math.ceil(_BACKGROUND_ORDERS * lines_an_order)
    place = np.arange(power.size)
    low, high = np.maximum(place - reach, 0), np.minimum(place + reach + 1, power.size)
    return np.asarray(np.maximum((capped[high] - capped[low]) / (high - low), _SILENCE))


def _rates(own: float, step: float) -> Float:
    """Trial rates [Hz]."""
    ratios = np.arange(RATIOS[0], RATIOS[1], step / own)
    above = np.searchsorted(_SIMPLE, ratios)
    simple = np.array(_SIMPLE)
    apart = np.minimum(np.abs(ratios - simple[above]), np.abs(ratios - simple[above - 1]))
    kept = (apart >= _SIMPLE_REACH) & (np.abs(ratios - 1) >= _BESIDE)
    return np.asarray(own * ratios[kept])
