"""The cepstrum: what repeats along a spectrum, harmonics and sidebands, as one peak."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import ifft, irfft
from .rate import check_rate
from .spectrum import hann, line_frequencies, power_lines

Float = NDArray[np.float64]

DEEPEST_LINE = 1e-12
"""Smallest line, over the largest, that enters the logarithm [-]: -120 dB."""


def cepstrum_of_lines(lines: ArrayLike, fs: float) -> tuple[Float, Float]:
    """Real cepstrum of a spectrum that has already been computed.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line, as from `power_lines` (even segment length).
    fs : float
        Sample rate [Hz].

    Returns
    -------
    quefrency : ndarray, shape (n_lines,)
        From 0 to half the segment [s].
    cepstrum : ndarray, shape (..., n_lines)
        Inverse transform of ``ln sqrt(P)`` [-]; 0 for a constant signal, by convention.

    Raises
    ------
    ValueError
        If there are fewer than three lines, or one is below 0 or not finite.

    Notes
    -----
    An echo of strength a < 1 after the time t adds ``a / 2`` at t, ``-a^2 / 4`` at 2 t, and so on:
    ``(-1)^(m + 1) a^m / (2 m)`` at m t. A gain changes the value at quefrency 0 only. Line 0, of
    which the mean has been removed, is replaced by line 1; lines more than 120 dB below the
    largest are raised to that.

    References
    ----------
    R. B. Randall, "A history of cepstrum analysis and its application to mechanical problems",
    Mech. Syst. Signal Process. 97 (2017) 3-19, doi:10.1016/j.ymssp.2016.12.026.

    Examples
    --------
    >>> import numpy as np
    >>> echo = np.abs(1 + 0.5 * np.exp(-2j * np.pi * 8 * np.arange(65) / 128)) ** 2
    >>> quefrency, cepstrum = cepstrum_of_lines(echo, 128.0)
    >>> float(quefrency[8]), round(float(cepstrum[8]), 3)
    (0.0625, 0.25)
    """
    check_rate(fs)
    logarithm = _logarithm(lines)
    count = logarithm.shape[-1]
    whole = irfft(logarithm.astype(np.complex128), 2 * (count - 1))
    return np.arange(count) / fs, np.asarray(whole[..., :count])


def _logarithm(lines: ArrayLike) -> Float:
    """``ln sqrt P`` with line 0 replaced and a floor; 0 for a spectrum without power."""
    power = np.array(lines, dtype=np.float64)
    if power.ndim == 0 or power.shape[-1] < 3:
        raise ValueError(f"lines of shape {power.shape} must be three or more; give a spectrum")
    if not (np.isfinite(power) & (power >= 0)).all():
        raise ValueError("lines must be finite and >= 0; cut or repair the recording")
    power[..., 0] = power[..., 1]
    largest = power.max(axis=-1, keepdims=True)
    relative = power / np.where(largest > 0, largest, 1)
    # The gain is added separately, so that the floor stays at the same depth below the largest
    # line.
    gain = np.log(np.where(largest > 0, largest, 1)) / 2
    logarithm = np.log(np.maximum(relative, DEEPEST_LINE)) / 2 + gain
    return np.where(largest > 0, logarithm, 0.0)


def cepstrum(x: ArrayLike, fs: float, *, nperseg: int | None = None) -> tuple[Float, Float]:
    """Real cepstrum of the averaged spectrum of a signal.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    nperseg : int, optional
        Segment length [samples]; see `default_nperseg`. It must hold several periods of the spacing
        sought.

    Returns
    -------
    quefrency : ndarray, shape (nperseg // 2 + 1,)
        Quefrency [s].
    cepstrum : ndarray, shape (..., nperseg // 2 + 1)
        Real cepstrum [-]; 0 for a constant signal, by convention.

    Raises
    ------
    ValueError
        As for `power_lines` and `cepstrum_of_lines`.

    Notes
    -----
    See `cepstrum_of_lines`. An echo later than a small part of the segment reads low, by about the
    autocorrelation of Hann's window at that lag.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(0).standard_normal(65_536)
    >>> quefrency, real = cepstrum(noise + 0.5 * np.roll(noise, 40), 1000.0, nperseg=4096)
    >>> round(float(quefrency[20 + np.argmax(real[20:200])]), 6)
    0.04
    """
    check_rate(fs)
    return cepstrum_of_lines(power_lines(x, fs, nperseg=nperseg), fs)


def harmonic_spacing(
    x: ArrayLike,
    fs: float,
    *,
    low: float,
    high: float,
    band: tuple[float, float] | None = None,
    nperseg: int | None = None,
) -> tuple[Float, Float]:
    """Spacing of the strongest family of harmonics or sidebands.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    low, high : float
        Smallest and largest spacing [Hz]. With ``high`` below ``2 low``, a family cannot be
        mistaken for every second line of another.
    band : tuple of float, optional
        Band that holds the family [Hz]; the whole spectrum by default. A few sidebands about a
        carrier need a narrow band around them.
    nperseg : int, optional
        Segment length [samples]; by default eight periods of `low` or more, if the record is
        long enough.

    Returns
    -------
    spacing : ndarray, shape (...)
        Spacing [Hz]; 0 for a constant signal.
    height : ndarray, shape (...)
        Height of the peak above the median of the envelope, in robust standard deviations of the
        envelope [-]; noise alone reaches 3, one time in a hundred 5.

    Raises
    ------
    ValueError
        Unless 0 < low < high <= fs / 4, a segment holds two periods of `low`, and the band lies
        within 0 … fs / 2 and is wider than 2 high.

    Notes
    -----
    The logarithm between the edges of the band, less its mean and tapered, is transformed back; its
    absolute value is the envelope of the real cepstrum. The cepstrum itself is not used: sidebands
    about a carrier that is no multiple of their spacing leave a ripple in it with the carrier's
    period, whose crest is next to their own peak. The highest line between the quefrencies 1 / high
    and 1 / low is refined with a parabola through its neighbours. For a family that fills the
    spectrum, the period is right within half a sample, the spacing within the share ``spacing / (2
    fs)``.

    References
    ----------
    R. B. Randall, "Cepstrum analysis and gearbox fault diagnosis", Bruel & Kjaer application note
    233-80 (1980).

    Examples
    --------
    >>> import numpy as np
    >>> clicks = np.zeros(16_384)
    >>> clicks[::160] = 1.0
    >>> noise = 0.05 * np.random.default_rng(0).standard_normal(16_384)
    >>> spacing, _ = harmonic_spacing(clicks + noise, 16_000.0, low=60.0, high=150.0)
    >>> round(float(spacing))
    100
    """
    check_rate(fs)
    if not 0 < low < high <= fs / 4:
        raise ValueError(
            f"low = {low} Hz must be > 0 and < high = {high} Hz, and that <= fs / 4 = {fs / 4} Hz; "
            "narrow the search"
        )
    n = np.shape(x)[-1] if np.ndim(x) else 0
    wanted = 1 << math.ceil(math.log2(8 * fs / low))
    length = min(wanted, n - n % 2) if nperseg is None else nperseg
    if length * low < 2 * fs:
        raise ValueError(
            f"nperseg = {length} samples must be >= {2 * fs / low:.0f}, two periods of low = {low} "
            "Hz; record longer or raise low"
        )
    low_edge, high_edge = band or (0.0, fs / 2)
    if not 0 <= low_edge < low_edge + 2 * high < high_edge <= fs / 2:
        raise ValueError(
            f"band = {low_edge:.6g} … {high_edge:.6g} Hz must lie in 0 … fs / 2 = {fs / 2:.6g} Hz "
            f"and be wider than 2 high = {2 * high:.6g} Hz; widen it or lower high"
        )
    quefrency = np.arange(length // 2 + 1) / fs
    frequency = line_frequencies(quefrency.size, fs)
    of_band = (frequency >= low_edge) & (frequency <= high_edge)
    logarithm = _logarithm(power_lines(x, fs, nperseg=length))[..., of_band]
    ripple = logarithm - logarithm.mean(axis=-1, keepdims=True)
    height = np.abs(ifft((ripple * hann(ripple.shape[-1])).astype(np.complex128), length))
    inside = (quefrency >= 1 / high) & (quefrency <= 1 / low)
    first = int(np.argmax(inside))
    part = height[..., : inside.size][..., inside]
    top = first + np.argmax(part, axis=-1)
    before, peak, behind = (
        np.take_along_axis(height, (top + step)[..., np.newaxis], axis=-1)[..., 0]
        for step in (-1, 0, 1)
    )
    bend = before - 2 * peak + behind
    shift = np.where(bend < 0, 0.5 * (before - behind) / np.where(bend < 0, bend, -1), 0.0)
    middle = np.median(part, axis=-1)
    # 1.4826: from median absolute deviation to the standard deviation of a Gaussian.
    scatter = 1.4826 * np.median(np.abs(part - middle[..., np.newaxis]), axis=-1)
    moves = scatter > 0
    above = np.where(moves, (peak - middle) / np.where(moves, scatter, 1), 0.0)
    spacing = fs / (top + np.clip(shift, -0.5, 0.5))
    return np.where(moves, spacing, 0.0), above
