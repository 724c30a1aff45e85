"""Frequency response functions of several simultaneous forces: shakers, or shafts."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.fft import rfft
from ..signal.rate import check_rate
from ..signal.spectrum import hann
from ..signal.statistics import Real, centred
from .frf import blocks_of, effective_averages

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

MOST_CONDITION = 1e6
"""Largest condition number of the coherence matrix of the forces: above it they are copies of one
another, and double-precision spectra lose too many digits of their difference."""


@dataclass(frozen=True, kw_only=True)
class MultiFrf:
    """Frequency response functions of several forces.

    Attributes
    ----------
    frequency : ndarray, shape (n_lines,)
        Frequency of the lines [Hz].
    value : ndarray, shape (n_channels, n_forces, n_lines)
        H1: response per unit of each force, with the others absent [unit of response / N].
    coherence : ndarray, shape (n_channels, n_lines)
        Multiple coherence: share of the response caused by all forces together, 0 to 1 [-].
    partial : ndarray, shape (n_channels, n_forces, n_lines)
        Partial coherence: that between a response and one force after removing the contribution of
        the other forces from both, 0 to 1 [-]; for a single force the ordinary coherence.
    condition : ndarray, shape (n_lines,)
        Condition number of the matrix of coherences among the forces, >= 1 [-]: compared with
        independent forces, the noise of a function grows by at most its square root.
    averages : float
        Number of independent averages [-].
    """

    frequency: Float
    value: Complex
    coherence: Float
    partial: Float
    condition: Float
    averages: float


def multiple_h1(
    force: ArrayLike,
    response: ArrayLike,
    fs: float,
    *,
    nperseg: int,
    overlap: float = 0.5,
) -> MultiFrf:
    """H1 for several forces, from records under independent random excitation.

    Parameters
    ----------
    force : array_like, shape (n_forces, n_samples)
        Forces [N]; transforms of float32 stay single if the responses are float32, too.
    response : array_like, shape (n_samples,) or (n_channels, n_samples)
        Responses [any unit].
    fs : float
        Sample rate [Hz].
    nperseg : int
        Block length [samples]; the blocks get a periodic Hann window, and their mean is removed.
    overlap : float
        Share of a block that is repeated in the next one, 0 <= overlap < 1 [-].

    Returns
    -------
    MultiFrf
        Functions on the lines above 0 Hz and below half the sample rate.

    Raises
    ------
    ValueError
        If shapes do not agree, samples are not finite, there are too few blocks, or the forces
        are not independent on a line.

    Notes
    -----
    ``H1 = Gyx Gxx^-1`` line by line, with the matrices of the averaged spectra: noise on the
    responses leaves it unbiased, noise on the forces does not. More averages than forces are
    needed: for unrelated signals, n_forces and n averages give a coherence of ``n_forces / n``.

    Force k, after removing the other forces, has the power ``1 / [Gxx^-1]kk``. With N the noise
    that no force explains, the partial coherence is ``|Hk|^2 / (|Hk|^2 + N [Gxx^-1]kk)``. Removing
    the others costs ``n_forces - 1`` averages.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, chapter 7,
    doi:10.1002/9781118032428.

    Examples
    --------
    >>> force = np.random.default_rng(0).standard_normal((2, 4096))
    >>> found = multiple_h1(force, 3 * force[0] - force[1], 1024.0, nperseg=256)
    >>> found.value[0, :, 7].real.round(9).tolist()
    [3.0, -1.0]
    """
    x, y = _records(force, response)
    check_rate(fs)
    if not 0 <= overlap < 1:
        raise ValueError(f"overlap = {overlap} must be >= 0 and < 1; 0.5 suits Hann")
    step = nperseg - round(overlap * nperseg)
    rows = blocks_of(np.concatenate([x, y]), nperseg, step)
    window = hann(nperseg).astype(rows.dtype)
    averages = effective_averages(window, step, rows.shape[1])
    if averages <= x.shape[0]:
        raise ValueError(
            f"averages = {averages:.3g} must be > n_forces = {x.shape[0]}; record longer, or "
            "shorten the blocks"
        )
    lines = rfft(centred(rows) * window)[..., 1 : (nperseg + 1) // 2]
    frequency = np.arange(1, lines.shape[-1] + 1) * (fs / nperseg)
    # Matrices line by line (n_lines, n_rows, n_rows): element (i, k) is the mean of Zi conj(Zk).
    stacked = np.ascontiguousarray(np.moveaxis(lines, -1, 0))
    products = stacked @ np.swapaxes(stacked, -1, -2).conj()
    spectra = products.astype(np.complex128) / rows.shape[1]
    count = x.shape[0]
    size, condition = _sizes(spectra[:, :count, :count], frequency)
    scaled = spectra[:, :count, :count] / (size[:, :, np.newaxis] * size[:, np.newaxis])
    cross = spectra[:, count:, :count] / size[:, np.newaxis]
    solved: Complex = np.linalg.solve(scaled.swapaxes(-1, -2), cross.swapaxes(-1, -2))
    solved = solved.swapaxes(-1, -2)
    explained = np.sum(solved * cross.conj(), axis=-1).real
    power = np.diagonal(spectra, axis1=-2, axis2=-1).real[:, count:]
    share = np.divide(explained, power, out=np.zeros_like(power), where=power > 0)
    share = np.clip(share, 0.0, 1.0)  # rounding
    return MultiFrf(
        frequency=frequency,
        value=np.asarray(np.moveaxis(solved / size[:, np.newaxis], 0, -1), dtype=np.complex128),
        coherence=share.T,
        partial=np.moveaxis(_partial(solved, scaled, power * (1 - share)), 0, -1),
        condition=condition,
        averages=averages,
    )


def _partial(value: Complex, forces: Complex, noise: Float) -> Float:
    """Partial coherences (n_lines, n_channels, n_forces) of functions of unit-power forces."""
    inverse = np.diagonal(np.linalg.inv(forces), axis1=-2, axis2=-1).real
    explained = np.square(value.real) + np.square(value.imag)
    whole = explained + noise[..., np.newaxis] * inverse[:, np.newaxis]
    share: Float = np.divide(explained, whole, out=np.zeros_like(whole), where=whole > 0)
    return share


def _records(force: ArrayLike, response: ArrayLike) -> tuple[Real, Real]:
    x, y = np.asarray(force), np.atleast_2d(np.asarray(response))
    if not x.dtype == y.dtype == np.float32:
        x, y = x.astype(np.float64, copy=False), y.astype(np.float64, copy=False)
    if x.ndim != 2 or y.ndim != 2 or x.shape[-1] != y.shape[-1] or x.shape[0] == 0:
        raise ValueError(
            f"force has shape {x.shape} and response {np.shape(response)}, must be (n_forces, "
            "n_samples) and (n_channels, n_samples); use channels of one record"
        )
    wrong = {"force": np.count_nonzero(~np.isfinite(x)), "response": np.sum(~np.isfinite(y))}
    faults = [f"{name} has {n} non-finite samples, must have 0" for name, n in wrong.items() if n]
    if faults:
        raise ValueError("; ".join(faults) + "; cut or repair the recording")
    return x, y


def _sizes(spectra: Complex, frequency: Float) -> tuple[Float, Float]:
    """Rms of the forces (n_lines, n_forces) and condition number of their coherence matrix."""
    size = np.sqrt(np.diagonal(spectra, axis1=-2, axis2=-1).real)
    silent = np.flatnonzero(~np.all(size > 0, axis=-1))
    if silent.size:
        raise ValueError(
            f"force = 0 at {silent.size} lines, the first at {frequency[silent[0]]:.6g} Hz, must "
            "be > 0; connect the sensor, or leave that force out"
        )
    values = np.linalg.eigvalsh(spectra / (size[:, :, np.newaxis] * size[:, np.newaxis]))
    least = np.maximum(values[:, 0], np.finfo(float).tiny)
    condition = np.asarray(values[:, -1] / least)
    copies = np.flatnonzero(condition > MOST_CONDITION)
    if copies.size:
        raise ValueError(
            f"condition of the forces = {condition[copies[0]]:.3g} at {frequency[copies[0]]:.6g} "
            f"Hz must be <= {MOST_CONDITION:.0e}; drive the shakers by independent noise"
        )
    return size, condition
