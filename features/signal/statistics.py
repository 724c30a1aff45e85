"""Amplitude statistics of a signal about its mean: size, peakedness, asymmetry."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .rate import check_rate

Real = NDArray[np.floating[Any]]

ENTROPY_BINS = 64
"""Bins of the amplitude distribution behind the entropy: at most 6 bit."""


def centred(x: ArrayLike) -> Real:
    """Signal minus its mean; exactly zero for a constant signal.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit]. float32 stays float32; integers become float64.

    Returns
    -------
    ndarray, shape (..., n_samples)
        Zero-mean signal [unit of x].

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> centred([0.1, 0.1, 0.1]).tolist()
    [0.0, 0.0, 0.0]
    """
    signal = np.asarray(x)
    if not np.issubdtype(signal.dtype, np.floating):
        signal = signal.astype(np.float64)
    if signal.ndim == 0 or signal.shape[-1] == 0:
        raise ValueError(f"n_samples = 0 (shape {signal.shape}) must be >= 1; give a signal")
    # Subtracting one sample first leaves exact zeros for a constant, whose mean would be rounded.
    shifted: Real = signal - signal[..., :1]
    shifted -= shifted.mean(axis=-1, keepdims=True)
    return shifted


class Amplitude:
    """The amplitude statistics of one array, each computed at most once.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Raises
    ------
    ValueError
        If there is no sample.

    Notes
    -----
    Powers are taken of the signal divided by its peak, so float32 neither overflows nor
    underflows. Every ratio of a constant signal (0/0) is 0 by convention. Results have shape
    (...) and the dtype of `x`. Samples are assumed finite: NaN gives NaN.

    Examples
    --------
    >>> shape = Amplitude([1.0, -1.0, 1.0, -1.0])
    >>> float(shape.rms), float(shape.kurtosis)
    (1.0, 1.0)
    """

    def __init__(self, x: ArrayLike) -> None:
        self.centred = centred(x)

    @cached_property
    def peak(self) -> Real:
        """Largest departure from the mean [unit of x]."""
        return np.asarray(np.maximum(self._highest, -self._lowest))

    @cached_property
    def peak_to_peak(self) -> Real:
        """Highest minus lowest sample [unit of x]."""
        return np.asarray(self._highest - self._lowest)

    @cached_property
    def rms(self) -> Real:
        """Root mean square about the mean [unit of x]."""
        return np.asarray(self.peak * self._relative_rms)

    @cached_property
    def crest_factor(self) -> Real:
        """Peak over rms [-]."""
        return _ratio(np.ones_like(self.peak), self._relative_rms)

    @cached_property
    def shape_factor(self) -> Real:
        """Rms over mean absolute value [-]."""
        return _ratio(self._relative_rms, self._relative_mean)

    @cached_property
    def impulse_factor(self) -> Real:
        """Peak over mean absolute value [-]."""
        return _ratio(np.ones_like(self.peak), self._relative_mean)

    @cached_property
    def clearance_factor(self) -> Real:
        """Peak over the squared mean root of the absolute value [-]."""
        root = np.asarray(np.sqrt(np.abs(self._relative)).mean(axis=-1))
        return _ratio(np.ones_like(self.peak), root**2)

    @cached_property
    def k_factor(self) -> Real:
        """Peak times rms [(unit of x)^2]."""
        return np.asarray(self.peak * self.rms)

    @cached_property
    def zero_crossings(self) -> Real:
        """Changes of sign about the mean, per interval between samples [-]."""
        signs = _signs(self.centred)
        changes = np.count_nonzero(signs[..., 1:] != signs[..., :-1], axis=-1)
        share = changes / max(1, signs.shape[-1] - 1)
        known = np.where(np.isfinite(self.peak), share, np.nan)
        return np.asarray(known, dtype=self.centred.dtype)

    @cached_property
    def entropy(self) -> Real:
        """Shannon entropy of 64 equal bins from the lowest to the highest sample [bit]."""
        highest, lowest = self._relative.max(axis=-1), self._relative.min(axis=-1)
        width = np.where(highest > lowest, highest - lowest, 1)[..., np.newaxis]
        place = (self._relative - lowest[..., np.newaxis]) * (ENTROPY_BINS / width)
        bins = np.minimum(place.astype(np.intp), ENTROPY_BINS - 1).reshape(-1, place.shape[-1])
        counts = np.stack([np.bincount(row, minlength=ENTROPY_BINS) for row in bins])
        share = counts / place.shape[-1]
        bits = -np.sum(share * np.log2(np.where(share > 0, share, 1)), axis=-1)
        return np.asarray(np.abs(bits).reshape(highest.shape), dtype=self.centred.dtype)

    @cached_property
    def skewness(self) -> Real:
        """Third standardised moment [-]."""
        third = np.vecdot(self._square, self._relative) / self._relative.shape[-1]
        return _ratio(third, self._relative_rms**3)

    @cached_property
    def kurtosis(self) -> Real:
        """Fourth standardised moment, 3 for a Gaussian [-]."""
        fourth = np.vecdot(self._square, self._square) / self._relative.shape[-1]
        return _ratio(fourth, self._relative_rms**4)

    @cached_property
    def _highest(self) -> Real:
        return np.asarray(self.centred.max(axis=-1))

    @cached_property
    def _lowest(self) -> Real:
        return np.asarray(self.centred.min(axis=-1))

    @cached_property
    def _relative(self) -> Real:
        scale = np.where(self.peak > 0, self.peak, np.ones_like(self.peak))
        return np.asarray(self.centred / scale[..., np.newaxis])

    @cached_property
    def _square(self) -> Real:
        return np.asarray(np.square(self._relative))

    @cached_property
    def _relative_rms(self) -> Real:
        return np.asarray(np.sqrt(self._square.mean(axis=-1)))

    @cached_property
    def _relative_mean(self) -> Real:
        return np.asarray(np.abs(self._relative).mean(axis=-1))


def _signs(signal: Real) -> NDArray[np.bool_]:
    """Whether each sample is above 0; a sample at 0 goes with the one before it."""
    above = signal > 0
    zero = signal == 0
    if zero.any():
        latest = np.where(zero, 0, np.arange(signal.shape[-1]))
        latest = np.maximum.accumulate(latest, axis=-1)
        above = np.take_along_axis(above, latest, axis=-1)
        # Samples before the first nonzero one take its sign, so that no crossing is counted there.
        first = np.argmin(zero, axis=-1)[..., np.newaxis]
        begun = np.arange(signal.shape[-1]) >= first
        above = np.where(begun, above, np.take_along_axis(above, first, axis=-1))
    return np.asarray(above)


def _ratio(above: Real, below: Real) -> Real:
    """Quotient; 0 if the denominator is 0, as for a constant signal."""
    out: Real = np.zeros_like(np.asarray(below))
    return np.asarray(np.divide(above, below, out=out, where=np.asarray(below) != 0))


def rms(x: ArrayLike) -> Real:
    """Root mean square about the mean.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``sqrt(mean((x - mean(x))**2))`` [unit of x]; 0 for a constant signal.

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> float(rms([3.0, 1.0, 3.0, 1.0]))
    1.0
    """
    return Amplitude(x).rms


def peak(x: ArrayLike) -> Real:
    """Largest departure from the mean.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``max |x - mean(x)|`` [unit of x]; 0 for a constant signal. It grows with the length of
        a random record: compare records of equal length.

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> float(peak([0.0, 0.0, 0.0, 4.0]))
    3.0
    """
    return Amplitude(x).peak


def peak_to_peak(x: ArrayLike) -> Real:
    """Distance between the highest and the lowest sample.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``max(x) - min(x)`` [unit of x]; 0 for a constant signal.

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> float(peak_to_peak([0.0, 0.0, 0.0, 4.0]))
    4.0
    """
    return Amplitude(x).peak_to_peak


def crest_factor(x: ArrayLike) -> Real:
    """Peak over rms: how far the largest event stands out.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``peak(x) / rms(x)`` [-], 1.414 for a sine; 0 for a constant signal, by convention.

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> float(crest_factor([1.0, -1.0, 1.0, -1.0]))
    1.0
    """
    return Amplitude(x).crest_factor


def shape_factor(x: ArrayLike) -> Real:
    """Rms over mean absolute value.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``rms(x) / mean |x - mean(x)|`` [-], pi / (2 sqrt 2) = 1.111 for a sine; 0 for a
        constant signal, by convention.

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> float(shape_factor([1.0, -1.0, 1.0, -1.0]))
    1.0
    """
    return Amplitude(x).shape_factor


def impulse_factor(x: ArrayLike) -> Real:
    """Peak over mean absolute value.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``peak(x) / mean |x - mean(x)|`` [-], pi / 2 for a sine; 0 for a constant signal, by
        convention.

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> float(impulse_factor([1.0, -1.0, 1.0, -1.0]))
    1.0
    """
    return Amplitude(x).impulse_factor


def skewness(x: ArrayLike) -> Real:
    """Third standardised moment: the asymmetry of the amplitude distribution.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``mean(z**3)`` with ``z = (x - mean(x)) / rms(x)`` [-], biased (divided by n_samples);
        0 for a symmetric signal, and for a constant one by convention.

    Raises
    ------
    ValueError
        If there is no sample.

    Examples
    --------
    >>> round(float(skewness([0.0, 0.0, 0.0, 4.0])), 6)
    1.154701
    """
    return Amplitude(x).skewness


def kurtosis(x: ArrayLike) -> Real:
    """Fourth standardised moment in Pearson's sense: a Gaussian has 3.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``mean(z**4)`` with ``z = (x - mean(x)) / rms(x)`` [-], biased (divided by n_samples);
        1.5 for a sine, 1 for a square wave; 0 for a constant signal, by convention (no
        varying signal goes below 1).

    Raises
    ------
    ValueError
        If there is no sample.

    References
    ----------
    D. Dyer, R. M. Stewart, "Detection of rolling element bearing damage by statistical vibration
    analysis", J. Mech. Design 100 (1978) 229-235, doi:10.1115/1.3453905.

    Examples
    --------
    >>> float(kurtosis([1.0, -1.0, 1.0, -1.0]))
    1.0
    """
    return Amplitude(x).kurtosis


def clearance_factor(x: ArrayLike) -> Real:
    """Peak over the squared mean root of the absolute value: very sensitive to single impacts.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``peak(x) / mean(sqrt |x - mean(x)|)**2`` [-], 1.719 for a sine; 0 for a constant signal,
        by convention. NaN gives NaN.

    Raises
    ------
    ValueError
        If there is no sample.

    References
    ----------
    Y. Lei, Z. He, Y. Zi, "A new approach to intelligent fault diagnosis of rotating machinery",
    Expert Syst. Appl. 35 (2008) 1593-1600, doi:10.1016/j.eswa.2007.08.072.

    Examples
    --------
    >>> float(clearance_factor([1.0, -1.0, 1.0, -1.0]))
    1.0
    """
    return Amplitude(x).clearance_factor


def k_factor(x: ArrayLike) -> Real:
    """Peak times rms: grows with the largest events and with the overall level.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``peak(x) rms(x)`` [(unit of x)^2], A^2 / sqrt 2 for a sine; 0 for a constant signal. Like
        the peak, it grows with the length of a random record. NaN gives NaN.

    Raises
    ------
    ValueError
        If there is no sample.

    References
    ----------
    A. Sturm, R. Foerster, N. Hippmann, D. Kinsky, "Waelzlagerdiagnostik an Maschinen und Anlagen"
    (1986), whose index K(t) is this product in new condition over the present one.

    Examples
    --------
    >>> float(k_factor([2.0, -2.0, 2.0, -2.0]))
    4.0
    """
    return Amplitude(x).k_factor


def zero_crossing_rate(x: ArrayLike, fs: float) -> Real:
    """Sign changes about the mean per second.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].

    Returns
    -------
    ndarray, shape (...)
        Crossings over the duration from the first to the last sample [1/s]: 2 f for a sine of
        frequency f, ``2 sqrt(m2 / m0)`` for Gaussian noise, with the moments
        ``m_i = integral f^i S(f) df`` (Rice), less the crossings that come in pairs between two
        samples. A sample at the mean counts with the one before it, so that touching the mean is no
        crossing. 0 for a constant signal and for one sample.

    Raises
    ------
    ValueError
        If there is no sample, or fs is not above 0.

    References
    ----------
    S. O. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 23 (1944) 282-332,
    doi:10.1002/j.1538-7305.1944.tb00874.x.

    Examples
    --------
    >>> float(zero_crossing_rate([1.0, -1.0, 1.0, -1.0], 100.0))
    100.0
    """
    check_rate(fs)
    rate = Amplitude(x).zero_crossings
    return np.asarray(rate * rate.dtype.type(fs))


def entropy(x: ArrayLike) -> Real:
    """Shannon entropy of the amplitude distribution.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].

    Returns
    -------
    ndarray, shape (...)
        ``-sum_i p_i log2 p_i`` over 64 bins of equal width from the lowest to the highest sample
        [bit]: 6 for a uniform distribution, 5.72 for a sine, 1 for a square wave, 0 for a constant
        signal. A few large events lower it, since they widen the bins.

    Raises
    ------
    ValueError
        If there is no sample, or a sample is not finite.

    Notes
    -----
    Each bin includes its lower edge, so that a change of sign can move samples on the edges. The
    estimate is low by about ``63 / (2 ln 2 n_samples)`` bit (Miller), 0.002 bit at 25,600 samples.

    References
    ----------
    C. E. Shannon, "A mathematical theory of communication", Bell Syst. Tech. J. 27 (1948)
    379-423, doi:10.1002/j.1538-7305.1948.tb01338.x.

    Examples
    --------
    >>> float(entropy([1.0, -1.0, 1.0, -1.0]))
    1.0
    """
    amplitude = Amplitude(x)
    if not np.isfinite(amplitude.peak).all():
        raise ValueError("x has non-finite samples, must have 0; cut or repair the recording")
    return amplitude.entropy
