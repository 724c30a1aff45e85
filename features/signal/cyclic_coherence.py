"""Cyclic coherence: carriers whose power varies at a cyclic frequency."""

import math
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from .envelope import checked_signal
from .fft import fft, rfft
from .kurtogram import CHUNK, LINE_SILENCE
from .spectrum import hann
from .statistics import Real

Float = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

OVERLAP = 4
"""Number of Hann frames that cover each sample [-]: fewer alias the cyclic frequency with the frame
rate."""


def cyclic_coherence(
    x: ArrayLike, fs: float, cyclic_hz: ArrayLike, *, nperseg: int = 256
) -> tuple[Float, Float]:
    """Cyclic spectral coherence of a signal at given cyclic frequencies.

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Signal [any unit]; its mean is removed. For a signal resampled over the shaft angle, `fs` is
        samples per revolution, and both frequencies below are orders.
    fs : float
        Sample rate [Hz].
    cyclic_hz : array_like, shape (n_cyclic,)
        Cyclic frequencies alpha [Hz], > 0 and < fs / 2. The resolution is ``fs / n_samples``:
        search around a bearing's frequency in steps of that.
    nperseg : int
        Length of the Hann frames, three quarters overlapping [samples].

    Returns
    -------
    frequency : ndarray, shape (nperseg // 2 + 1,)
        Spectral frequency f [Hz].
    coherence : ndarray, shape (n_cyclic, nperseg // 2 + 1)
        ``|<X(f) X*(f - alpha)>|^2 / (<|X(f)|^2> <|X(f - alpha)|^2>)``, between 0 and 1 [-]; 0 for
        silence. Its mean over f is the enhanced envelope spectrum at alpha.

    Raises
    ------
    ValueError
        As for `checked_signal`, or if `x` is not one row, `nperseg` is not a multiple of 4 from 16
        up to a third of the record, a cyclic frequency is out of bounds, or the record is shorter
        than one period of it.

    Notes
    -----
    Averaged cyclic periodogram. Compare with `coherence_threshold`: noise has about one over the
    number of independent frames. Two stationary tones that differ by the cyclic frequency are
    coherent too, and so is a tone with its own mirror image, at twice its frequency: remove the
    orders of the shaft first. Lines narrower than the cyclic frequency (a longer `nperseg`) resolve
    the sidebands of a modulated tone; wider ones suit impacts.

    References
    ----------
    J. Antoni, "Cyclic spectral analysis in practice", Mech. Syst. Signal Process. 21 (2007)
    597-630, doi:10.1016/j.ymssp.2006.08.007.

    Examples
    --------
    Noise whose power varies 40 times a second, and not 50 times:

    >>> t = np.arange(32_768) / 8192
    >>> x = np.random.default_rng(0).standard_normal(t.size) * (1 + np.cos(2 * np.pi * 40 * t))
    >>> _, coherence = cyclic_coherence(x, 8192.0, [40.0, 50.0])
    >>> bool(coherence[0].mean() > 0.3), bool(coherence[1].mean() < 0.01)
    (True, True)
    """
    signal = checked_signal(x, fs, least=64)
    cycles = np.atleast_1d(np.asarray(cyclic_hz, dtype=np.float64))
    _check_frames(signal.shape, nperseg)
    _check_cycles(cycles, fs, signal.size)
    rms = math.sqrt(float(np.mean(np.square(signal, dtype=np.float64)))) or 1.0
    window = hann(nperseg) / rms
    hop = nperseg // OVERLAP
    # The shift by alpha within a frame is one window for all frames; their positions add a factor.
    turning = window * np.exp(2j * np.pi / fs * np.outer(cycles, np.arange(nperseg)))
    frames = sliding_window_view(signal, nperseg)[::hop]
    power, shifted, cross = _sums(frames, window, turning, cycles * (hop / fs))
    below = power * shifted
    heard = np.sqrt(below) > LINE_SILENCE * power.sum()
    above = np.square(cross.real) + np.square(cross.imag)
    coherence = np.divide(above, below, out=np.zeros_like(below), where=heard)
    frequency = np.arange(power.size, dtype=np.float64) * (fs / nperseg)
    # Rounding must not lift a perfect coherence above 1.
    return frequency, np.minimum(coherence, 1.0)


def _sums(
    frames: Real, window: Float, turning: Complex, drift: Float
) -> tuple[Float, Float, NDArray[np.complex128]]:
    """Sums over the frames of |X(f)|^2, |X(f - alpha)|^2 and X(f) X*(f - alpha).

    `drift` is the phase that each cyclic frequency gains per frame [rev, shape=(n_cyclic,)].
    """
    n_lines = window.size // 2 + 1
    power, shifted = np.zeros(n_lines), np.zeros((drift.size, n_lines))
    cross = np.zeros((drift.size, n_lines), dtype=np.complex128)
    step = max(1, CHUNK // window.size)
    for start in range(0, len(frames), step):
        part = frames[start : start + step]
        lines = rfft(part * window)
        power += _power(lines)
        for i, turns in enumerate(drift):
            others = fft(part * turning[i])[:, :n_lines]
            shifted[i] += _power(others)
            place = np.exp(-2j * np.pi * turns * np.arange(start, start + len(part)))
            cross[i] += np.einsum("f,fk,fk->k", place, lines, others.conj())
    return power, shifted, cross


def _power(lines: Complex) -> Real:
    return np.asarray((np.square(lines.real) + np.square(lines.imag)).sum(axis=0))


def coherence_threshold(n_samples: int, *, nperseg: int = 256, probability: float = 0.01) -> float:
    """Cyclic coherence that stationary noise exceeds with a given probability.

    Parameters
    ----------
    n_samples : int
        Length of the record.
    nperseg : int
        Length of the frames, as in `cyclic_coherence` [samples].
    probability : float
        Probability of a false alarm at one line and one cyclic frequency [-]; for the largest of
        many, divide it by their number.

    Returns
    -------
    float
        ``1 - probability**(1 / (n - 1))`` for n independent frames [-].

    Raises
    ------
    ValueError
        If `nperseg` is not valid for `cyclic_coherence`, or unless 0 < probability < 1.

    Notes
    -----
    Distribution of the squared coherence of n independent pairs of complex Gaussian numbers. K
    frames that overlap by three quarters count as ``n = K / (1 + 2 sum_j (1 - j / K) r_j^2)``, with
    r_j the correlation of the window with itself shifted by j frames; a Hann window gives K / 1.92.

    References
    ----------
    G. C. Carter, "Coherence and time delay estimation", Proc. IEEE 75 (1987) 236-255,
    doi:10.1109/PROC.1987.13723. Overlap: P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967)
    70-73, doi:10.1109/TAU.1967.1161901.

    Examples
    --------
    >>> round(coherence_threshold(32_768), 4)
    0.0173
    """
    _check_frames((n_samples,), nperseg)
    if not 0 < probability < 1:
        raise ValueError(f"probability = {probability} must be > 0 and < 1; 0.01 is usual")
    hop = nperseg // OVERLAP
    n_frames = (n_samples - nperseg) // hop + 1
    window = hann(nperseg)
    lags = np.arange(1, OVERLAP)
    likeness = np.array([window[j * hop :] @ window[: nperseg - j * hop] for j in lags])
    likeness /= window @ window
    independent = n_frames / (1 + 2 * float(np.sum((1 - lags / n_frames) * likeness**2)))
    return float(1 - probability ** (1 / (independent - 1)))


def _check_frames(shape: tuple[int, ...], nperseg: int) -> None:
    if len(shape) != 1:
        raise ValueError(f"x has shape {shape}, must be (n_samples,); give one channel")
    most = shape[0] // 3  # 8 frames or more
    if nperseg % OVERLAP or not 16 <= nperseg <= most:
        raise ValueError(
            f"nperseg = {nperseg} samples must be a multiple of {OVERLAP}, >= 16 and <= {most}, a "
            "third of n_samples; choose another or record longer"
        )


def _check_cycles(cycles: Float, fs: float, n_samples: int) -> None:
    least = fs / n_samples
    if cycles.ndim != 1 or not np.all((cycles >= least) & (cycles < fs / 2)):
        raise ValueError(
            f"cyclic_hz = {cycles.tolist()} Hz must be one row, >= {least:.6g}, one period in the "
            f"record, and < fs / 2 = {fs / 2:.6g}; drop the others or record longer"
        )
