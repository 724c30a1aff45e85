"""Hum of the mains: lines at exact multiples of 50 or 60 Hz that no turning part accounts for."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import fast_length_within, rfft
from .rate import check_rate

Float = NDArray[np.float64]

MAINS_HZ = (50.0, 60.0)
"""Frequencies of public supplies [Hz]."""

HARMONICS = (1, 2, 3, 4, 5, 6, 7, 9)
"""Multiples that hum is looked for at: the odd ones of a loop, the even ones of a rectifier."""

_LOBE = 2.0  # lines on either side that Hann's window spreads a tone over
_DRIFT = 1e-3  # of a supply's frequency: public ones keep 0.05 Hz
_REACH_HZ = 12.0  # to either side of a line: where its neighbours are
_REACH_ORDERS = 1.6  # the same in orders, so that the next ones on both sides are among them
_FIRST_ORDERS = 8  # of the shaft: each stands out by itself, as hum does


def hum_power(x: ArrayLike, fs: float, mains: float, *, speed_hz: float) -> float:
    """Mean square of what stands out at the multiples of a supply's frequency.

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    mains : float
        Frequency of the supply [Hz].
    speed_hz : float
        Mean shaft speed [Hz]: lines of the first eight orders are no hum.

    Returns
    -------
    float
        Mean square [unit^2] of the lines less that of the strongest neighbour of each within 12 Hz
        or 1.6 orders; 0 where the signal is too short to tell them apart.

    Raises
    ------
    ValueError
        A rate, frequency or speed is not positive.

    Examples
    --------
    >>> fs = 1000.0
    >>> t = np.arange(8000) / fs
    >>> hum = 3.0 * np.sin(math.tau * 50 * t) + np.sin(math.tau * 7 * t)
    >>> round(hum_power(hum, fs, 50.0, speed_hz=7.0), 2), hum_power(hum, fs, 60.0, speed_hz=7.0)
    (4.5, 0.0)
    """
    check_rate(fs)
    for name, value in (("mains", mains), ("speed_hz", speed_hz)):
        if not value > 0:
            raise ValueError(f"{name} = {value} Hz must be > 0")
    signal = np.asarray(x, dtype=np.float64)
    signal = signal[: fast_length_within(signal.size)]
    step = fs / signal.size
    reach = max(_REACH_HZ, _REACH_ORDERS * speed_hz)
    if 2 * _LOBE * step > min(0.5 * speed_hz, _REACH_HZ):
        return 0.0
    window = 0.5 - 0.5 * np.cos(math.tau * np.arange(signal.size) / signal.size)
    lines = np.abs(rfft((signal - signal.mean()) * window)) ** 2
    summed = np.append(0.0, np.cumsum(lines)) * (2 / (signal.size * float(window @ window)))
    places = [harmonic * mains for harmonic in HARMONICS if harmonic * mains + reach < fs / 2]
    return sum(
        _standing_out(summed, place / step, step, reach)
        for place in places
        if not _is_order(place, speed_hz, (_half(place, step) + _LOBE) * step)
    )


def _half(frequency: float, step: float) -> int:
    """Lines on either side that belong to a tone."""
    return math.ceil(_LOBE + _DRIFT * frequency / step)


def _standing_out(summed: Float, place: float, step: float, reach: float) -> float:
    """Mean square about a line beyond that about its strongest neighbour."""
    half = _half(place * step, step)
    centre, width, far = round(place), 2 * half + 1, math.ceil(reach / step)
    low = max(centre - far, 0)
    sums = summed[low + width : centre + far + 1] - summed[low : centre + far + 1 - width]
    middle = low + half + np.arange(sums.size)
    others = sums[np.abs(middle - centre) >= width]
    return max(0.0, float(sums[centre - low - half] - others.max()))


def _is_order(frequency: float, speed_hz: float, apart_hz: float) -> bool:
    """Whether one of the shaft's first orders is as good as there."""
    order = round(frequency / speed_hz)
    return order <= _FIRST_ORDERS and abs(frequency - order * speed_hz) <= max(
        apart_hz, 0.01 * frequency
    )
