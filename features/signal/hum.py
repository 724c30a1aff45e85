"""Hum of the mains: lines at exact multiples of 50 or 60 Hz that are no shaft order."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import fast_length_within, rfft
from .rate import check_rate

Float = NDArray[np.float64]

MAINS_HZ = (50.0, 60.0)
"""Frequencies of public supplies [Hz]."""

HARMONICS = (1, 2, 3, 4, 5, 6, 7, 9)
"""Multiples searched for hum: odd ones from an earth loop, even ones from a rectifier."""

_ENOUGH_HZ = 1600.0  # block rate: the search ends below 0.6 kHz, where averaging takes little
_LOBE = 2.0  # lines on either side that Hann's window spreads a tone over
_DRIFT = 1e-3  # of a supply's frequency: public ones keep 0.05 Hz
_REACH_HZ = 12.0  # neighbours are searched this far on either side of a line
_REACH_ORDERS = 1.6  # the same in orders, so that the next order on either side is included
_FIRST_ORDERS = 8  # of the shaft: each can stand out as hum does


def hum_power(x: ArrayLike, fs: float, *, speed_hz: float) -> dict[float, float]:
    """Mean square that stands out at the multiples of each supply's frequency.

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    speed_hz : float
        Mean shaft speed [Hz]: lines of the first eight orders do not count as hum.

    Returns
    -------
    For each of :data:`MAINS_HZ`, the mean square [unit^2] of the lines less that of the strongest
    neighbour of each within 12 Hz or 1.6 orders; 0 if the signal is too short.

    Raises
    ------
    ValueError
        A rate or speed is not positive.

    Notes
    -----
    Samples are first averaged in blocks of about 0.6 ms, and the lines are corrected for the loss:
    below 0.6 kHz a twentieth of the samples gives the same result.

    Examples
    --------
    >>> fs = 1000.0
    >>> t = np.arange(8000) / fs
    >>> hum = 3.0 * np.sin(math.tau * 50 * t) + np.sin(math.tau * 7 * t)
    >>> {mains: round(power, 1) for mains, power in hum_power(hum, fs, speed_hz=7.0).items()}
    {50.0: 4.5, 60.0: 0.0}
    """
    check_rate(fs)
    if not speed_hz > 0:
        raise ValueError(f"speed_hz = {speed_hz} Hz must be > 0")
    block = max(1, int(fs / _ENOUGH_HZ))
    samples = np.asarray(x, dtype=np.result_type(np.asarray(x), np.float32))
    blocks = samples[: samples.size // block * block].reshape(-1, block)
    signal = np.asarray(blocks @ np.full(block, 1 / block, blocks.dtype), dtype=np.float64)
    fs /= block
    reach = max(_REACH_HZ, _REACH_ORDERS * speed_hz)
    if 2 * _LOBE * fs > signal.size * min(0.5 * speed_hz, _REACH_HZ):
        return dict.fromkeys(MAINS_HZ, 0.0)
    signal = signal[: fast_length_within(signal.size)]
    step = fs / signal.size
    window = 0.5 - 0.5 * np.cos(math.tau * np.arange(signal.size) / signal.size)
    lines = np.abs(rfft((signal - signal.mean()) * window)) ** 2
    cycles = np.arange(lines.size) / signal.size  # per block
    # Averaging in blocks attenuates by the ratio of two sincs.
    lines *= (np.sinc(cycles / block) / np.sinc(cycles)) ** 2
    summed = np.append(0.0, np.cumsum(lines)) * (2 / (signal.size * float(window @ window)))
    return {
        mains: sum(
            _standing_out(summed, place / step, step, reach)
            for place in (harmonic * mains for harmonic in HARMONICS)
            if place + reach < fs / 2
            and not _is_order(place, speed_hz, (_half(place, step) + _LOBE) * step)
        )
        for mains in MAINS_HZ
    }


def _half(frequency: float, step: float) -> int:
    """Number of lines on either side that belong to a tone."""
    return math.ceil(_LOBE + _DRIFT * frequency / step)


def _standing_out(summed: Float, place: float, step: float, reach: float) -> float:
    """Mean square about a line in excess of that about its strongest neighbour."""
    half = _half(place * step, step)
    centre, width, far = round(place), 2 * half + 1, math.ceil(reach / step)
    low = max(centre - far, 0)
    sums = summed[low + width : centre + far + 1] - summed[low : centre + far + 1 - width]
    middle = low + half + np.arange(sums.size)
    others = sums[np.abs(middle - centre) >= width]
    return max(0.0, float(sums[centre - low - half] - others.max()))


def _is_order(frequency: float, speed_hz: float, apart_hz: float) -> bool:
    """Whether the frequency is too near to one of the shaft's first orders to be separated."""
    order = round(frequency / speed_hz)
    return order <= _FIRST_ORDERS and abs(frequency - order * speed_hz) <= max(
        apart_hz, 0.01 * frequency
    )
