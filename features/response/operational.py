"""Transfer paths of a running machine without a measured force.

A transmissibility relates one channel to another: if both respond to the same source, the source
cancels and the path between them remains. A deflection shape does the same for each order, with
phase.
"""

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.fft import rfft
from ..signal.rate import check_rate
from ..signal.spectrum import decibel, default_nperseg, hann, line_weights
from ..signal.statistics import Real, centred

Float = NDArray[np.float64]


def channel_pairs(n_channels: int) -> NDArray[np.intp]:
    """Pairs of channels, the response first and its reference second.

    Parameters
    ----------
    n_channels : int

    Returns
    -------
    ndarray, shape (2, n_pairs)
        Rows of the channels, in the order of `itertools.combinations`.

    Examples
    --------
    >>> channel_pairs(3).tolist()
    [[0, 0, 1], [1, 2, 2]]
    """
    pairs = list(combinations(range(n_channels), 2))
    return np.array(pairs, dtype=np.intp).reshape(-1, 2).T


def transmissibility(x: ArrayLike, fs: float, edges: ArrayLike) -> tuple[Float, Float]:
    """Transmissibility between every pair of channels, band by band.

    Parameters
    ----------
    x : array_like, shape (n_channels, n_samples)
        Signals [any units].
    fs : float
        Sample rate [Hz].
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz].

    Returns
    -------
    level : ndarray, shape (n_pairs, n_bands)
        Power of the first channel that is coherent with the second, over the power of the second
        [dB]; -200 dB if either is silent.
    coherence : ndarray, shape (n_pairs, n_bands)
        Share of the first channel's power that is coherent with the second [-].

    Raises
    ------
    ValueError
        If signals are not finite, or as for `spectrum.line_weights`.

    Notes
    -----
    Line by line the estimate is ``|Sba|^2 / Sbb^2``, weighted with the power of the reference.
    Noise on the first channel alone leaves the level unchanged and lowers the coherence; for n
    independent averages of unrelated signals the coherence is 1/n, not 0. Several simultaneous
    sources give a mixture of their paths: suitable for comparing conditions, but no property of the
    structure.

    References
    ----------
    C. Devriendt, P. Guillaume, "Identification of modal parameters from transmissibility
    measurements", J. Sound Vib. 314 (2008) 343-356.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(4096)
    >>> level, coherence = transmissibility([10 * noise, noise], 1024.0, [100.0, 200.0, 400.0])
    >>> level.round(6).tolist(), coherence.round(6).tolist()
    ([[20.0, 20.0]], [[1.0, 1.0]])
    """
    check_rate(fs)
    signals = centred(x)
    nperseg = default_nperseg(fs, signals.shape[-1])
    weights = line_weights(nperseg, fs, edges)
    first, second = channel_pairs(len(signals))
    power, cross = _cross_lines(signals, nperseg, first, second)
    heard = np.where(power > 0, power, 1.0)
    common = np.square(np.abs(cross)) / heard[second] @ weights
    whole = power @ weights
    return decibel(_share(common, whole[second])), _share(common, whole[first])


def _cross_lines(
    signals: Real, nperseg: int, first: NDArray[np.intp], second: NDArray[np.intp]
) -> tuple[Float, NDArray[np.complex128]]:
    """Sums over half-overlapped Hann segments: power of each channel, cross power of each pair."""
    taper = hann(nperseg).astype(signals.dtype)
    power = np.zeros((len(signals), nperseg // 2 + 1))
    cross = np.zeros((first.size, nperseg // 2 + 1), dtype=np.complex128)
    for start in range(0, signals.shape[-1] - nperseg + 1, max(1, nperseg // 2)):
        lines = rfft(signals[:, start : start + nperseg] * taper)
        power += np.square(lines.real) + np.square(lines.imag)
        cross += lines[first] * np.conj(lines[second])
    return power, cross


def _share(part: Float, whole: Float) -> Float:
    """Part over whole; 0 for silence."""
    return np.where(whole > 0, part / np.where(whole > 0, whole, 1.0), 0.0)


def deflection_shape(vectors: ArrayLike) -> Float:
    """Operating deflection of every pair of channels at each order.

    Parameters
    ----------
    vectors : array_like, shape (n_channels, n_orders)
        Complex amplitudes of the orders [any units], as from `order.order_amplitudes`.

    Returns
    -------
    ndarray, shape (n_pairs, n_orders, 3)
        Ratio of the amplitudes, first to second [dB], and cosine and sine of the phase lead of the
        first [-]; -200 dB, 0 and 0 if either is silent.

    References
    ----------
    M. H. Richardson, "Is it a mode shape, or an operating deflection shape?", Sound and Vibration
    31 (1997) 54-61.

    Examples
    --------
    >>> deflection_shape([[2j], [0.2]]).round(6).tolist()
    [[[20.0, 0.0, 1.0]]]
    """
    amplitudes = np.asarray(vectors, dtype=np.complex128)
    first, second = channel_pairs(len(amplitudes))
    cross = amplitudes[first] * np.conj(amplitudes[second])
    power = np.square(np.abs(amplitudes))
    level = decibel(_share(power[first], power[second]))
    turn = cross / np.where(cross != 0, np.abs(cross), 1.0)
    return np.stack([level, turn.real, turn.imag], axis=-1)
