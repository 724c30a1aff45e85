"""The shape of a spectrum: position and spread of its power, and its noise floor."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv

from .rate import check_rate
from .spectrum import line_frequencies

Float = NDArray[np.float64]

FLOOR_QUANTILE = 0.25
"""Quantile of the lines used for the noise level [-]: the lines above it may hold tones."""


def spectral_centroid(lines: ArrayLike, fs: float) -> Float:
    """Mean frequency of the power of a spectrum.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line, as from `power_lines`.
    fs : float
        Sample rate [Hz].

    Returns
    -------
    ndarray, shape (...)
        ``sum f P / sum P`` [Hz]; 0 for a constant signal, by convention. NaN gives NaN.

    Raises
    ------
    ValueError
        If there are fewer than two lines, or one is below 0.

    Notes
    -----
    Exact for a tone away from the ends: Hann's lobe is symmetric about a tone on a line, and its
    power has the tone's frequency as mean between lines, too.

    Examples
    --------
    >>> float(spectral_centroid([0.0, 1.0, 3.0, 0.0, 0.0], 8.0))
    1.75
    """
    check_rate(fs)
    power = _shares(lines)
    return np.asarray(power @ line_frequencies(power.shape[-1], fs))


def spectral_spread(lines: ArrayLike, fs: float) -> Float:
    """Standard deviation of the power of a spectrum about its centroid.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line, as from `power_lines`.
    fs : float
        Sample rate [Hz].

    Returns
    -------
    ndarray, shape (...)
        ``sqrt(sum (f - centroid)^2 P / sum P)`` [Hz]; 0 for a constant signal, by convention.
        NaN gives NaN.

    Raises
    ------
    ValueError
        If there are fewer than two lines, or one is below 0.

    Notes
    -----
    Hann's window widens it: a tone has a spread of ``sqrt(1/3)`` of a line spacing, not 0.

    Examples
    --------
    >>> float(spectral_spread([0.0, 1.0, 0.0, 1.0, 0.0], 8.0))
    1.0
    """
    check_rate(fs)
    power = _shares(lines)
    frequency = line_frequencies(power.shape[-1], fs)
    away = frequency - (power @ frequency)[..., np.newaxis]
    return np.asarray(np.sqrt(np.vecdot(power, away**2)))


def spectral_entropy(lines: ArrayLike) -> Float:
    """Evenness of the power over the lines: normalised spectral entropy.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line, as from `power_lines`; line 0, whose mean is removed, is left out.

    Returns
    -------
    ndarray, shape (...)
        ``-sum p ln p / ln(n_lines - 1)`` with the shares p [-]: 1 for equal lines, 0 for a single
        one; 0 for a constant signal, by convention. NaN gives NaN.

    Raises
    ------
    ValueError
        If there are fewer than three lines, or one is below 0.

    Notes
    -----
    A tone on a line of a Hann spectrum has ``0.868 / ln(n_lines - 1)``. White noise approaches 1
    with many averages; with one segment its lines scatter, which lowers it by ``(1 - 0.5772) /
    ln(n_lines - 1)``.

    References
    ----------
    G. E. Powell, I. C. Percival, "A spectral entropy method for distinguishing regular and
    irregular motion of Hamiltonian systems", J. Phys. A 12 (1979) 2053-2071,
    doi:10.1088/0305-4470/12/11/017.

    Examples
    --------
    >>> float(spectral_entropy([9.0, 1.0, 1.0, 1.0, 1.0]))
    1.0
    """
    power = _shares(_without_mean(lines))
    logarithm = np.log(np.where(power > 0, power, 1))
    return np.asarray(np.abs(np.vecdot(power, logarithm)) / math.log(power.shape[-1]))


def spectral_flatness(lines: ArrayLike) -> Float:
    """Geometric over arithmetic mean of the lines: 1 for white noise, 0 for tones.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line, as from `power_lines`; line 0, whose mean is removed, is left out.

    Returns
    -------
    ndarray, shape (...)
        Between 0 and 1 [-]; 0 if a line is 0, as for a constant signal. NaN gives NaN.

    Raises
    ------
    ValueError
        If there are fewer than three lines, or one is below 0.

    Notes
    -----
    White noise of K independent averages has ``exp(psi(K)) / K``: 0.561 for one, 0.95 for ten.

    References
    ----------
    J. D. Johnston, "Transform coding of audio signals using perceptual noise criteria", IEEE J.
    Sel. Areas Commun. 6 (1988) 314-323, doi:10.1109/49.608.

    Examples
    --------
    >>> round(float(spectral_flatness([0.0, 1.0, 4.0])), 6)
    0.8
    """
    power = _shares(_without_mean(lines))
    some = np.all((power > 0) | np.isnan(power), axis=-1)
    mean = np.exp(np.log(np.where(power > 0, power, 1)).mean(axis=-1)) * power.shape[-1]
    return np.where(np.isnan(power).any(axis=-1), np.nan, np.where(some, mean, 0.0))


def noise_floor(
    lines: ArrayLike,
    fs: float,
    *,
    n_averages: float,
    band: tuple[float, float] | None = None,
) -> Float:
    """Density of the noise under the tones of a spectrum.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line [(unit of x)^2], as from `power_lines`.
    fs : float
        Sample rate [Hz].
    n_averages : float
        Independent averages behind each line [-], as from `frf.effective_averages`.
    band : tuple of float, optional
        Band of the search [Hz], in which the noise must be white; by default from line 2 to the
        last but one.

    Returns
    -------
    ndarray, shape (...)
        One-sided density [(unit of x)^2 / Hz]; 0 for a constant signal.

    Raises
    ------
    ValueError
        If n_averages is below 1, the band holds fewer than 8 lines, or a line is below 0 or not
        finite.

    Notes
    -----
    The lower quartile of the lines over that of the mean of K squared Gaussian pairs,
    ``gammaincinv(K, 1/4) / K`` (0.288 for one average, 0.77 for ten): without that division the
    quartile of one average would read 5.4 dB low. Tones on a share e of the lines raise the floor
    to that of the quantile ``0.25 / (1 - e)``: for e = 0.2 by 1.1 dB with one average, 0.3 dB
    with ten. N lines scatter it by about ``1.5 / sqrt(N K)`` of its value, 2.0 if K = 1.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.random.default_rng(0).standard_normal(65_536)
    >>> lines = np.abs(np.fft.rfft(x)) ** 2 * 2 / 65_536**2
    >>> abs(float(noise_floor(lines, 2.0, n_averages=1.0)) - 1.0) < 0.05
    True
    """
    check_rate(fs)
    power = _checked(lines)
    frequency = line_frequencies(power.shape[-1], fs)
    low, high = band or (frequency[2] if frequency.size > 2 else 0.0, frequency[-2])
    inside = (frequency >= low) & (frequency <= high)
    faults = []
    if not 1 <= n_averages < math.inf:
        faults.append(f"n_averages = {n_averages} must be >= 1 and finite; use effective_averages")
    if np.count_nonzero(inside) < 8:
        faults.append(
            f"band = {low:.6g} … {high:.6g} Hz holds {np.count_nonzero(inside)} lines, must hold "
            ">= 8; widen it or record longer"
        )
    if not np.isfinite(power).all():
        faults.append("lines hold non-finite values, must have 0; cut or repair the recording")
    if faults:
        raise ValueError("; ".join(faults))
    quartile = np.quantile(power[..., inside], FLOOR_QUANTILE, axis=-1)
    bias = float(gammaincinv(n_averages, FLOOR_QUANTILE)) / n_averages
    return np.asarray(quartile / (bias * frequency[1]))


def _checked(lines: ArrayLike) -> Float:
    power = np.asarray(lines, dtype=np.float64)
    if power.ndim == 0 or power.shape[-1] < 2:
        raise ValueError(f"lines of shape {power.shape} must be two or more; give a spectrum")
    if (power < 0).any():
        raise ValueError(f"lines = {power.min():.6g} must be >= 0; give mean squares, not levels")
    return power


def _without_mean(lines: ArrayLike) -> Float:
    power = np.asarray(lines, dtype=np.float64)
    if power.ndim == 0 or power.shape[-1] < 3:
        raise ValueError(f"lines of shape {power.shape} must be three or more; give a spectrum")
    return np.asarray(power[..., 1:])


def _shares(lines: ArrayLike) -> Float:
    """Lines over their sum; zeros for a spectrum without power."""
    power = _checked(lines)
    total = power.sum(axis=-1, keepdims=True)
    return np.asarray(power / np.where(total == 0, 1, total))
