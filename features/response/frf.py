"""Frequency response functions from a measured force and the responses to it, with confidence.

One force, any number of responses: blocks of samples are averaged to spectra, which give H1 or H2,
the coherence, and a confidence disc for each line.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from ..signal.fft import rfft
from ..signal.rate import check_rate
from ..signal.spectrum import hann
from ..signal.statistics import Real, centred

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]
Estimator = Literal["h1", "h2"]

TRIGGER_SHARE = 0.1
"""Default trigger level of a blow, as a share of the largest force in the record [-]: blows by hand
scatter by a factor of about three, and the noise of a force cell is far lower."""

DECIBEL_PER_NEPER = 20 / np.log(10)
"""Level in decibels of a relative change in amplitude, to first order [dB]."""


@dataclass(frozen=True, kw_only=True)
class Spectra:
    """Averaged one-sided spectra of one force and the responses to it.

    Attributes
    ----------
    frequency : ndarray, shape (n_lines,)
        Frequency of the lines [Hz].
    force : ndarray, shape (n_lines,)
        Mean of ``|X|^2``: a density [N^2/Hz] from `welch_spectra`, an energy density per blow
        [N^2 s/Hz] from `block_spectra`.
    response : ndarray, shape (n_channels, n_lines)
        Mean of ``|Y|^2``, scaled as the force.
    cross : ndarray, shape (n_channels, n_lines)
        Mean of ``conj(X) Y``, scaled as the force.
    blocks : int
        Blocks averaged.
    averages : float
        Equivalent number of independent blocks, <= `blocks`; see `effective_averages`.
    nyquist : float
        Half the sample rate [Hz].
    decay : float
        Rate of the exponential window on both force and response [1/s]; the response function then
        belongs to ``s = decay + 2j pi f``.
    """

    frequency: Float
    force: Float
    response: Float
    cross: Complex
    blocks: int
    averages: float
    nyquist: float
    decay: float = 0.0

    @property
    def real_lines(self) -> NDArray[np.bool_]:
        """Lines without an imaginary part: zero frequency and half the sample rate."""
        return np.asarray((self.frequency == 0) | (self.frequency == self.nyquist))

    def between(self, low: float, high: float) -> "Spectra":
        """Same spectra with only the lines from `low` to `high` [Hz], ends included.

        Raises
        ------
        ValueError
            If no line lies in that range.
        """
        kept = (self.frequency >= low) & (self.frequency <= high)
        if not kept.any():
            raise ValueError(
                f"low = {low} Hz … high = {high} Hz must hold a line of 0 … "
                f"{self.frequency[-1]:.6g} Hz; widen the band or lengthen the blocks"
            )
        return replace(
            self,
            frequency=self.frequency[kept],
            force=self.force[kept],
            response=self.response[:, kept],
            cross=self.cross[:, kept],
        )


@dataclass(frozen=True, kw_only=True)
class Frf:
    """Estimated frequency response functions of one force.

    Attributes
    ----------
    frequency : ndarray, shape (n_lines,)
        Frequency of the lines [Hz].
    value : ndarray, shape (n_channels, n_lines)
        Complex, response over force for ``exp(+j w t)`` [unit of response / N].
    coherence : ndarray, shape (n_channels, n_lines)
        Ordinary coherence ``gamma^2``, 0 to 1 [-].
    radius : ndarray, shape (n_channels, n_lines)
        Radius of the confidence disc about `value` [unit of value].
    averages : float
        Number of independent averages [-].
    estimator : str
        ``h1`` or ``h2``.
    confidence : float
        Probability that the disc of a single line holds the true value [-].
    decay : float
        Rate of the exponential window, as in `Spectra` [1/s].
    """

    frequency: Float
    value: Complex
    coherence: Float
    radius: Float
    averages: float
    estimator: Estimator
    confidence: float
    decay: float = 0.0

    @property
    def magnitude_interval(self) -> tuple[Float, Float]:
        """Smallest and largest magnitude in the disc [unit of value], (n_channels, n_lines)."""
        size = np.abs(self.value)
        return np.maximum(size - self.radius, 0.0), size + self.radius


def blocks_of(x: ArrayLike, nperseg: int, step: int) -> Real:
    """Cut a record into blocks, overlapping where `step` < `nperseg`.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Record [any unit].
    nperseg, step : int
        Length of a block and distance to the next one [samples].

    Returns
    -------
    ndarray, shape (..., n_blocks, nperseg)
        A view if `x` is float32 or float64, otherwise a float64 copy; samples after the last whole
        block are left out.

    Raises
    ------
    ValueError
        Unless 8 <= nperseg <= n_samples and 1 <= step <= nperseg.

    Examples
    --------
    >>> blocks_of(range(16), 8, 4)[:, 0].tolist()
    [0.0, 4.0, 8.0]
    """
    signal = np.asarray(x)
    if signal.dtype != np.float32:
        signal = signal.astype(np.float64, copy=False)
    n_samples = signal.shape[-1] if signal.ndim else 0
    if not 8 <= nperseg <= n_samples:
        raise ValueError(
            f"nperseg = {nperseg} samples must be >= 8 and <= n_samples = {n_samples}; "
            "give a longer record or shorter blocks"
        )
    if not 1 <= step <= nperseg:
        raise ValueError(
            f"step = {step} samples must be >= 1 and <= nperseg = {nperseg}; "
            "choose an overlap of 0 … 0.9"
        )
    windows = np.lib.stride_tricks.sliding_window_view(signal, nperseg, axis=-1)
    return np.asarray(windows[..., ::step, :])


def effective_averages(window: ArrayLike, step: int, n_blocks: int) -> float:
    """Number of independent blocks whose average has the same variance as that of overlapping ones.

    Parameters
    ----------
    window : array_like, shape (nperseg,)
        Window of a block [-].
    step : int
        Distance of neighbouring blocks [samples].
    n_blocks : int
        Blocks averaged.

    Returns
    -------
    float
        ``n / (1 + 2 sum_j (1 - j / n) rho_j^2)`` with
        ``rho_j = sum_k w[k] w[k + j step] / sum_k w[k]^2`` [-].

    Notes
    -----
    Exact for the variance of a periodogram of white Gaussian noise; holds where the spectrum
    varies little over the width of a line.

    References
    ----------
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE
    Trans. Audio Electroacoust. 15 (1967) 70-73, doi:10.1109/TAU.1967.1161901.

    Examples
    --------
    A boxcar without overlap loses nothing; Hann overlapping by half loses one part in eighteen.

    >>> effective_averages([1.0] * 64, 64, 10)
    10.0
    >>> round(effective_averages(hann(64), 32, 1000) / 1000, 4)
    0.9474
    """
    taper = np.asarray(window, dtype=np.float64)
    spread = 1.0
    for j in range(1, min(n_blocks, -(-taper.size // step))):
        overlap = taper[j * step :] @ taper[: taper.size - j * step] / (taper @ taper)
        spread += 2 * (1 - j / n_blocks) * float(overlap) ** 2
    return n_blocks / spread


def welch_spectra(
    force: ArrayLike,
    response: ArrayLike,
    fs: float,
    *,
    nperseg: int,
    overlap: float = 0.5,
    window: ArrayLike | None = None,
    detrend: bool = True,
) -> Spectra:
    """Averaged spectra of a continuous random excitation.

    Parameters
    ----------
    force : array_like, shape (n_samples,)
        Force [N].
    response : array_like, shape (n_samples,) or (n_channels, n_samples)
        Responses [any unit].
    fs : float
        Sample rate [Hz].
    nperseg : int
        Block length [samples]; lines ``fs / nperseg`` apart.
    overlap : float
        Share of a block that is repeated in the next one, 0 <= overlap < 1 [-].
    window : array_like, shape (nperseg,), optional
        Window [-]; periodic Hann by default.
    detrend : bool
        Remove the mean of every block.

    Returns
    -------
    Spectra
        Densities [unit^2/Hz], as `scipy.signal.csd` gives them.

    Raises
    ------
    ValueError
        If shapes do not agree, samples are not finite, or block and overlap do not fit the record.

    Notes
    -----
    Leakage biases the result if a resonance is narrower than about four lines; a burst that has
    decayed within its block causes none, see `block_spectra`.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, chapters 6, 9 and 11,
    doi:10.1002/9781118032428.

    Examples
    --------
    >>> import numpy as np
    >>> force = np.random.default_rng(0).standard_normal(4096)
    >>> spectra = welch_spectra(force, 3 * force, fs=1024.0, nperseg=256)
    >>> spectra.blocks, abs(h1(spectra)[0, 7]).round(12).item()
    (31, 3.0)
    """
    check_rate(fs)
    x, y = _pair(force, response)
    if not 0 <= overlap < 1:
        raise ValueError(f"overlap = {overlap} must be >= 0 and < 1; 0.5 suits Hann")
    step = nperseg - round(overlap * nperseg)
    taper = hann(nperseg) if window is None else np.asarray(window, dtype=np.float64)
    if taper.shape != (nperseg,):
        raise ValueError(f"window has shape {taper.shape}, must have ({nperseg},); give one row")
    rows = [blocks_of(signal, nperseg, step) for signal in (x, y)]
    if detrend:
        rows = [np.asarray(centred(row), dtype=np.float64) for row in rows]
    lines_x, lines_y = (rfft(row * taper) for row in rows)
    return _averaged(
        lines_x,
        lines_y,
        fs,
        nperseg,
        scale=1 / (fs * float(taper @ taper)),
        averages=effective_averages(taper, step, lines_x.shape[0]),
    )


def block_spectra(
    force: ArrayLike,
    response: ArrayLike,
    fs: float,
    *,
    force_window: ArrayLike | None = None,
    decay: float = 0.0,
) -> Spectra:
    """Averaged spectra of blocks that each hold a whole event: a blow, a burst, a sweep.

    Parameters
    ----------
    force : array_like, shape (n_blocks, nperseg)
        Force, one event per block [N].
    response : array_like, shape (n_blocks, nperseg) or (n_blocks, n_channels, nperseg)
        Responses [any unit].
    fs : float
        Sample rate [Hz].
    force_window : array_like, shape (nperseg,), optional
        Window of the force alone, see `force_window`: it cuts off the noise after the blow.
    decay : float
        Rate of an exponential window applied to force and response, >= 0 [1/s]; see `window_decay`.

    Returns
    -------
    Spectra
        Energy densities per block [unit^2 s/Hz].

    Raises
    ------
    ValueError
        If shapes do not agree, samples are not finite, or `decay` is negative.

    Notes
    -----
    With h the impulse response, ``exp(-d t) (h * x)`` is ``(exp(-d t) h) * (exp(-d t) x)``: with
    the exponential on force AND response the estimate is exactly the transfer function at ``s = d +
    2j pi f``. Every pole moves left by d; `modal_fit` moves it back if given `decay`. A response
    that has not died away at the end of its block is cut off, which causes an error of the size of
    the tail.

    References
    ----------
    W. G. Halvorsen, D. L. Brown, "Impulse technique for structural frequency response testing",
    Sound and Vibration 11 (1977) 8-21.

    Examples
    --------
    >>> import numpy as np
    >>> force = np.zeros((3, 64))
    >>> force[:, 2] = [1.0, 2.0, 1.5]
    >>> spectra = block_spectra(force, np.roll(force, 1, axis=-1), fs=64.0)
    >>> np.angle(h1(spectra)[0, 16], deg=True).round(6).item()
    -90.0
    """
    check_rate(fs)
    x = np.asarray(force, dtype=np.float64)
    y = np.asarray(response, dtype=np.float64)
    y = y[:, np.newaxis] if y.ndim == 2 else y
    if x.ndim != 2 or y.ndim != 3 or (y.shape[0], y.shape[2]) != x.shape:
        raise ValueError(
            f"force has shape {x.shape} and response {np.shape(response)}, must be (n_blocks, "
            "nperseg) and (n_blocks, n_channels, nperseg); cut both at the same samples"
        )
    _check_finite(x, y)
    if not (np.isfinite(decay) and decay >= 0):
        raise ValueError(f"decay = {decay} 1/s must be >= 0 and finite; 0 for no window")
    taper = np.exp(-decay * np.arange(x.shape[-1]) / fs)
    lines_x = rfft(x * taper * _force_taper(force_window, x.shape[-1]))
    lines_y = rfft(np.moveaxis(y, 1, 0) * taper)
    n_blocks, nperseg = x.shape
    spectra = _averaged(lines_x, lines_y, fs, nperseg, scale=1 / fs**2, averages=float(n_blocks))
    return replace(spectra, decay=decay)


def _force_taper(window: ArrayLike | None, nperseg: int) -> Float:
    taper = np.ones(nperseg) if window is None else np.asarray(window, dtype=np.float64)
    if taper.shape != (nperseg,):
        raise ValueError(
            f"force_window has shape {taper.shape}, must have ({nperseg},); give one block's"
        )
    return taper


def _pair(force: ArrayLike, response: ArrayLike) -> tuple[Float, Float]:
    x = np.asarray(force, dtype=np.float64)
    y = np.atleast_2d(np.asarray(response, dtype=np.float64))
    if x.ndim != 1 or y.ndim != 2 or y.shape[-1] != x.size:
        raise ValueError(
            f"force has shape {x.shape} and response {np.shape(response)}, must be (n_samples,) "
            "and (n_channels, n_samples); use channels of one record"
        )
    _check_finite(x, y)
    return x, y


def _check_finite(force: Float, response: Float) -> None:
    for name, values in (("force", force), ("response", response)):
        wrong = np.count_nonzero(~np.isfinite(values))
        if wrong:
            raise ValueError(
                f"{name} has {wrong} non-finite samples, must have 0; cut or repair the recording"
            )


def _averaged(
    x: NDArray[np.complexfloating],
    y: NDArray[np.complexfloating],
    fs: float,
    nperseg: int,
    *,
    scale: float,
    averages: float,
) -> Spectra:
    """Means over the blocks of transforms x (blocks, lines) and y (channels, blocks, lines)."""
    check_rate(fs)
    frequency = np.arange(nperseg // 2 + 1, dtype=np.float64) * (fs / nperseg)
    nyquist = fs / 2
    if nperseg % 2 == 0:
        frequency[-1] = nyquist
    sides = np.where((frequency == 0) | (frequency == nyquist), scale, 2 * scale)
    return Spectra(
        frequency=frequency,
        force=np.mean(_square(x), axis=0) * sides,
        response=np.mean(_square(y), axis=1) * sides,
        cross=np.asarray(np.mean(np.conj(x) * y, axis=1) * sides),
        blocks=x.shape[0],
        averages=averages,
        nyquist=nyquist,
    )


def _square(z: NDArray[np.complexfloating]) -> Float:
    return np.asarray(np.square(z.real) + np.square(z.imag))


def h1(spectra: Spectra) -> Complex:
    """Estimate ``Sxy / Sxx``, unbiased by noise on the responses.

    Parameters
    ----------
    spectra : Spectra

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        Response function [unit of response / N].

    Raises
    ------
    ValueError
        If a line has no force at all.

    Notes
    -----
    With noise on the force, r times as strong as the force, the expectation is ``H / (1 + r)``.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, section 9.1,
    doi:10.1002/9781118032428.

    Examples
    --------
    >>> spectra = block_spectra([[1.0, 0, 0, 0]] * 2, [[0.0, 2, 0, 0]] * 2, fs=4.0)
    >>> h1(spectra)[0, :2].round(12).tolist()
    [(2+0j), -2j]
    """
    _check_power(spectra.frequency, spectra.force, "force")
    return np.asarray(spectra.cross / spectra.force)


def h2(spectra: Spectra) -> Complex:
    """Estimate ``Syy / Syx``, unbiased by noise on the force.

    Parameters
    ----------
    spectra : Spectra

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        Response function [unit of response / N]; ``|h2| >= |h1|``, and their ratio is the
        coherence.

    Raises
    ------
    ValueError
        If a line has no response correlated with the force.

    Notes
    -----
    With noise on the response, r times as strong as the response to the force, the expectation is
    ``H (1 + r)`` for many averages.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, section 9.1,
    doi:10.1002/9781118032428.

    Examples
    --------
    >>> spectra = block_spectra([[1.0, 0, 0, 0]] * 2, [[0.0, 2, 0, 0]] * 2, fs=4.0)
    >>> h2(spectra)[0, :2].round(12).tolist()
    [(2+0j), -2j]
    """
    _check_power(spectra.frequency, np.abs(spectra.cross), "response to the force")
    return np.asarray(spectra.response / np.conj(spectra.cross))


def hv(spectra: Spectra, *, noise_ratio: ArrayLike | None = None) -> Complex:
    """Total least squares estimate, for noise on the force and on the responses.

    Parameters
    ----------
    spectra : Spectra
    noise_ratio : array_like, optional
        Power of the noise on a response over that on the force, > 0 [(unit of response / N)^2]; one
        number, one per line, or in the shape of the result. By default ``Syy / Sxx``: noise in
        proportion to the signals.

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        Response function [unit of response / N]; ``|h1| <= |hv| <= |h2|``, all with the same phase.

    Raises
    ------
    ValueError
        If a line has no force or no response correlated with it, or `noise_ratio` is not > 0 or has
        a wrong shape.

    Notes
    -----
    With k the noise ratio, the estimate minimises ``sum |Y - H X|^2 / (k + |H|^2)``::

        Hv = (Syy - k Sxx + sqrt((Syy - k Sxx)^2 + 4 k |Sxy|^2)) / (2 Syx)

    It is unbiased for many averages if k is right. Large k leads to H1, small k to H2; the default
    is their geometric mean, ``|Hv| = sqrt(Syy / Sxx)``, which does not depend on the units. (A k of
    1, as in other programs, does.) There is no confidence disc: with noise on both sides the blocks
    alone do not determine it.

    References
    ----------
    K. Shin, J. K. Hammond, "Fundamentals of Signal Processing for Sound and Vibration Engineers",
    Wiley 2008, chapter 9.

    Examples
    --------
    >>> spectra = block_spectra([[1.0, 0, 0, 0]] * 2, [[0.0, 2, 0, 0]] * 2, fs=4.0)
    >>> hv(spectra)[0, :2].round(12).tolist()
    [(2+0j), -2j]
    """
    force, cross = spectra.force, spectra.cross
    _check_power(spectra.frequency, force, "force")
    _check_power(spectra.frequency, np.abs(cross), "response to the force")
    if noise_ratio is None:
        return np.asarray(cross / np.abs(cross) * np.sqrt(spectra.response / force))
    ratio = np.asarray(noise_ratio, dtype=np.float64)
    if ratio.shape not in ((), force.shape, cross.shape) or not np.all(
        np.isfinite(ratio) & (ratio > 0)
    ):
        raise ValueError(
            f"noise_ratio (shape {ratio.shape}) must be > 0 and finite and have shape (), "
            f"{force.shape} or {cross.shape}; use h1 for noise on the responses alone, h2 for "
            "noise on the force alone"
        )
    excess = spectra.response - ratio * force
    root = np.hypot(excess, 2 * np.sqrt(ratio) * np.abs(cross))
    # The form of the root without cancellation.
    above = np.where(excess > 0, excess + root, 2 * ratio * np.abs(cross))
    below = np.where(excess > 0, 2 * np.abs(cross), root - excess)
    return np.asarray(above / below * (cross / np.abs(cross)))


def _check_power(frequency: Float, power: Float, name: str) -> None:
    silent = np.flatnonzero(~np.all(np.atleast_2d(power) > 0, axis=0))
    if silent.size:
        raise ValueError(
            f"{name} = 0 at {silent.size} lines, the first at {frequency[silent[0]]:.6g} Hz, must "
            "be > 0; cut these lines with Spectra.between, or connect the sensor"
        )


def coherence(spectra: Spectra) -> Float:
    """Ordinary coherence: the share of the response that is linear in the force.

    Parameters
    ----------
    spectra : Spectra
        Spectra of two blocks or more.

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        ``|Sxy|^2 / (Sxx Syy)``, 0 to 1 [-]; 0 if force or response is silent.

    Raises
    ------
    ValueError
        If there is only one block: its coherence is 1 at any noise level.

    Notes
    -----
    Noise on one side, r times as strong as the signal, lowers it to ``1 / (1 + r)``. If the true
    value is 0, the mean of the estimate is ``1 / averages``.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, section 9.2,
    doi:10.1002/9781118032428.

    Examples
    --------
    >>> spectra = block_spectra([[1.0, 0, 0, 0]] * 2, [[0.0, 2, 0, 0]] * 2, fs=4.0)
    >>> coherence(spectra)[0].round(12).tolist()
    [1.0, 1.0, 1.0]
    """
    if spectra.blocks < 2:
        raise ValueError(
            f"n_blocks = {spectra.blocks} must be >= 2, the coherence of one block is identically "
            "1; record more blows, or shorten the blocks"
        )
    power = spectra.force * spectra.response
    both = _square(spectra.cross)
    share = np.divide(both, power, out=np.zeros_like(power), where=power > 0)
    return np.minimum(share, 1.0)  # rounding


def random_error(coherence: ArrayLike, averages: float) -> Float:
    """Normalised standard deviation of the magnitude, and of the phase in radians.

    Parameters
    ----------
    coherence : array_like
        ``gamma^2``, 0 to 1 [-].
    averages : float
        Independent averages, > 0 [-].

    Returns
    -------
    ndarray
        ``sqrt(1 - gamma^2) / (|gamma| sqrt(2 averages))`` [-]; infinite if the coherence is 0.

    Raises
    ------
    ValueError
        If a coherence lies outside 0 … 1 or `averages` is not > 0.

    Notes
    -----
    First order in the error: accurate below about 0.2. With an estimated coherence the result is an
    estimate, too, good from about ten averages on.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, table 9.6,
    doi:10.1002/9781118032428.

    Examples
    --------
    >>> random_error([0.5, 1.0], averages=8).round(6).tolist()
    [0.25, 0.0]
    """
    share = np.asarray(coherence, dtype=np.float64)
    if not np.all((share >= 0) & (share <= 1)):
        raise ValueError("coherence must lie in 0 … 1; give gamma^2, not decibels or per cent")
    if not averages > 0:
        raise ValueError(f"averages = {averages} must be > 0; count the blocks")
    noise = np.sqrt((1 - share) / (2 * averages))
    return np.divide(noise, np.sqrt(share), out=np.full_like(noise, np.inf), where=share > 0)


def confidence_radius(
    spectra: Spectra, *, confidence: float = 0.95, estimator: Estimator = "h1"
) -> Float:
    """Radius of the disc about H1 or H2 that holds the true value of a line.

    Parameters
    ----------
    spectra : Spectra
        Spectra of two blocks or more.
    confidence : float
        Probability for one line, between 0 and 1 [-].
    estimator : str
        ``h1`` (noise on the responses) or ``h2`` (noise on the force).

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        Radius [unit of response / N]; infinite for ``h2`` if the noise leaves no bound.

    Raises
    ------
    ValueError
        If there are fewer than two averages, or `confidence` lies outside 0 … 1.

    Notes
    -----
    For H1 let ``Y_k = H X_k + N_k`` in block k = 1 … n, the force known without noise, the N_k
    independent and circular complex normal of one variance s. Then ``H1 - H`` is circular normal
    of variance ``s / sum |X|^2``, and independent of it the residual
    ``sum |Y - H1 X|^2 = n Syy (1 - g^2)`` is s/2 times a chi-square of ``2 n - 2`` degrees of
    freedom, g^2 being the estimated coherence. Their ratio is an F, which gives::

        |H1 - H|^2 <= 2 / (2 n - 2) F(2, 2 n - 2) (1 - g^2) Syy / Sxx

    exactly. The quantile of F with 2 numerator degrees of freedom has the closed form ``(n - 1) ((1
    - confidence)^(-1 / (n - 1)) - 1)``. The strength of the blows may vary freely. On the two real
    lines (0 and half the sample rate) F(1, n - 1) is used instead. With overlap, n is the effective
    number of averages and the statement approximate; with noise on the force it does not hold,
    because H1 is then biased.

    For H2 the same holds for ``1 / H2`` as an estimate of ``1 / H``, with noise on the force alone;
    the radius is that of the smallest disc about H2 that covers the image of that disc.

    Bias from leakage, a cut-off tail or a non-linear system is not included, and the probability is
    per line: of 100 lines about 5 lie outside at 95 %.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, section 9.2.3 (the same
    region for several inputs), doi:10.1002/9781118032428.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> force = np.zeros((10, 64))
    >>> force[:, 0] = 1.0
    >>> noisy = 2 * force + 0.01 * rng.standard_normal(force.shape)
    >>> spectra = block_spectra(force, noisy, fs=64.0)
    >>> inside = np.abs(h1(spectra) - 2) <= confidence_radius(spectra)
    >>> int(inside.sum()), inside.size
    (32, 33)
    """
    if not 0 < confidence < 1:
        raise ValueError(f"confidence = {confidence} must be > 0 and < 1; 0.95 is usual")
    share = coherence(spectra)
    freedom = spectra.averages - 1
    if not freedom > 0:
        raise ValueError(
            f"averages = {spectra.averages:.6g} must be > 1 for a confidence disc; "
            "record more, or shorten the blocks"
        )
    bound = np.where(spectra.real_lines, _real(confidence, freedom), _disc(confidence, freedom))
    if estimator == "h1":
        _check_power(spectra.frequency, spectra.force, "force")
        return np.asarray(np.sqrt(bound * (1 - share) * spectra.response / spectra.force))
    # In units of |1 / H2| the disc of 1 / H has radius rho; its image extends to rho / (1 - rho).
    rho = np.sqrt(bound) * np.sqrt(2.0) * random_error(share, 1.0)
    reach = np.divide(rho, 1 - rho, out=np.full_like(rho, np.inf), where=rho < 1)
    return np.asarray(np.abs(h2(spectra)) * reach)


def _disc(confidence: float, freedom: float) -> float:
    """``F(2, 2 freedom) / freedom``, in closed form."""
    return float((1 - confidence) ** (-1 / freedom) - 1)


def _real(confidence: float, freedom: float) -> float:
    """``F(1, freedom) / freedom``, the square of Student's t."""
    return float(stdtrit(freedom, (1 + confidence) / 2) ** 2 / freedom)


def estimate_frf(spectra: Spectra, *, estimator: Estimator = "h1", confidence: float = 0.95) -> Frf:
    """Frequency response functions with coherence and confidence.

    Parameters
    ----------
    spectra : Spectra
        Spectra of two blocks or more, see `block_spectra` and `welch_spectra`.
    estimator : str
        ``h1``: noise is on the responses, as with a hammer. ``h2``: noise is on the force, as when
        a shaker's force drops at a resonance.
    confidence : float
        Probability for the disc of each line [-].

    Returns
    -------
    Frf

    Raises
    ------
    ValueError
        If the estimator is unknown, or as for `coherence`, `confidence_radius`, `h1` and `h2`.

    Examples
    --------
    >>> import numpy as np
    >>> force = np.random.default_rng(0).standard_normal(2048)
    >>> frf = estimate_frf(welch_spectra(force, 3 * force, fs=512.0, nperseg=128))
    >>> bool(frf.coherence.min() > 0.999999), frf.estimator
    (True, 'h1')
    """
    functions = {"h1": h1, "h2": h2}
    if estimator not in functions:
        raise ValueError(f"estimator = {estimator!r} must be one of {', '.join(functions)}")
    return Frf(
        frequency=spectra.frequency,
        coherence=coherence(spectra),
        value=functions[estimator](spectra),
        radius=confidence_radius(spectra, confidence=confidence, estimator=estimator),
        averages=spectra.averages,
        estimator=estimator,
        confidence=confidence,
        decay=spectra.decay,
    )


def level_deviation(frf: Frf) -> Float:
    """Standard deviation of the level ``20 log10 |H|``.

    Parameters
    ----------
    frf : Frf

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        Standard deviation [dB]; the variance rests on ``2 averages - 2`` degrees of freedom.
        Infinite if the coherence is 0.

    Notes
    -----
    First order in the error, as for `random_error`, but with ``averages - 1`` in place of
    `averages`: the coherence is estimated from the same blocks, whose residual has lost a degree of
    freedom.

    Examples
    --------
    >>> import numpy as np
    >>> one = np.array([[1.0]])
    >>> frf = Frf(frequency=one[0], value=one + 0j, coherence=0.5 * one, radius=one, averages=9.0,
    ...     estimator="h1", confidence=0.95)
    >>> level_deviation(frf).round(4).item()
    2.1715
    """
    return np.asarray(DECIBEL_PER_NEPER * random_error(frf.coherence, frf.averages - 1))


# --- hammer


@dataclass(frozen=True, kw_only=True)
class Blows:
    """Blocks of a hammer test.

    Attributes
    ----------
    starts : ndarray, shape (n_blows,)
        First sample of each accepted block.
    nperseg : int
        Samples of a block.
    rejected : tuple of str
        One message for each blow left out.
    """

    starts: NDArray[np.intp]
    nperseg: int
    rejected: tuple[str, ...]

    def cut(self, x: ArrayLike) -> Float:
        """Blocks of a record (..., n_samples) [shape=(n_blows, ..., nperseg)]."""
        signal = np.asarray(x, dtype=np.float64)
        return np.stack([signal[..., start : start + self.nperseg] for start in self.starts])


def find_blows(
    force: ArrayLike, fs: float, *, nperseg: int, pretrigger: int = 0, level: float | None = None
) -> Blows:
    """Find the blows of a hammer in its force signal; leave out double hits and cut-off blocks.

    Parameters
    ----------
    force : array_like, shape (n_samples,)
        Force, pressing counted positive [N].
    fs : float
        Sample rate [Hz].
    nperseg : int
        Samples of a block.
    pretrigger : int
        Samples of a block before the force reaches `level`.
    level : float, optional
        Trigger level [N]; a tenth of the largest force by default.

    Returns
    -------
    Blows

    Raises
    ------
    ValueError
        If the force has no pulse, or no blow is left; the message gives the reasons.

    Notes
    -----
    A block is a double hit if the force, after falling below half the level, reaches the level
    again before the block ends. The second hit distorts the smooth spectrum of the first, and the
    response belongs to both.

    Examples
    --------
    >>> import numpy as np
    >>> force = np.zeros(400)
    >>> force[[50, 150, 170, 300]] = 1.0
    >>> blows = find_blows(force, fs=100.0, nperseg=80, pretrigger=10)
    >>> blows.starts.tolist(), blows.rejected
    ([40, 290], ('blow at 1.5 s: hits 2 times, must hit once',))
    """
    check_rate(fs)
    pulse = np.asarray(force, dtype=np.float64)
    if pulse.ndim != 1 or not np.all(np.isfinite(pulse)):
        raise ValueError(f"force (shape {pulse.shape}) must be one row of finite samples")
    trigger = TRIGGER_SHARE * float(pulse.max(initial=0.0)) if level is None else level
    if not 0 < trigger <= pulse.max(initial=0.0):
        raise ValueError(
            f"level = {trigger:.6g} N must be > 0 and <= the largest force, "
            f"{pulse.max(initial=0.0):.6g} N; lower it, turn the sign, or connect the force cell"
        )
    hits = onsets(pulse, trigger)
    starts: list[int] = []
    rejected: list[str] = []
    free = 0
    for onset in hits:
        if onset < free:
            continue
        start = int(onset) - pretrigger
        free = start + nperseg
        fault = _fault(hits, start, int(onset), free, pulse.size)
        if fault:
            rejected.append(f"blow at {onset / fs:.6g} s: {fault}")
        else:
            starts.append(start)
    if not starts:
        raise ValueError("n_blows = 0 must be >= 1; " + "; ".join(rejected))
    return Blows(starts=np.array(starts, dtype=np.intp), nperseg=nperseg, rejected=tuple(rejected))


def onsets(force: Float, level: float) -> NDArray[np.intp]:
    """Samples at which a force rises to a level after being below half of it.

    Parameters
    ----------
    force : ndarray, shape (n_samples,)
        Force [N].
    level : float
        Level, > 0 [N].

    Returns
    -------
    ndarray of int, shape (n_onsets,)

    Examples
    --------
    >>> onsets(np.array([0.0, 2.0, 1.0, 2.0, 0.0, 3.0]), 2.0).tolist()
    [1, 5]
    """
    state = (force >= level).astype(np.int8) - (force < level / 2)
    decided = np.flatnonzero(state)
    high = state[decided] > 0
    rise = high & np.concatenate(([True], ~high[:-1]))
    return np.asarray(decided[rise])


def _fault(onsets: NDArray[np.intp], start: int, onset: int, end: int, n_samples: int) -> str:
    hits = int(np.count_nonzero((onsets >= onset) & (onsets < end)))
    if start < 0:
        return f"block starts {-start} samples before the record, must start in it"
    if end > n_samples:
        return f"block ends {end - n_samples} samples after the record, must end in it"
    if hits > 1:
        return f"hits {hits} times, must hit once"
    return ""


def force_window(nperseg: int, fs: float, *, end: float, fall: float) -> Float:
    """Window that passes a blow and cuts off the noise after it.

    Parameters
    ----------
    nperseg : int
        Length [samples].
    fs : float
        Sample rate [Hz].
    end : float
        Duration of the part equal to one, from the first sample, > 0 [s].
    fall : float
        Duration of the half cosine from one to zero after that, >= 0 [s].

    Returns
    -------
    ndarray, shape (nperseg,)
        Window [-].

    Raises
    ------
    ValueError
        If `end` is not > 0 or `fall` is negative.

    Examples
    --------
    >>> force_window(6, 1.0, end=2.0, fall=2.0).round(3).tolist()
    [1.0, 1.0, 1.0, 0.5, 0.0, 0.0]
    """
    check_rate(fs)
    if not end > 0 or not fall >= 0:
        raise ValueError(
            f"end = {end} s must be > 0 and fall = {fall} s must be >= 0; "
            "let the window end after the blow"
        )
    time = np.arange(nperseg) / fs
    share = np.clip((time - end) / max(fall, 1e-3 / fs), 0.0, 1.0)
    return np.asarray(0.5 * (1 + np.cos(np.pi * share)))


def window_decay(duration: float, *, last: float = 0.01) -> float:
    """Rate of the exponential window that has decayed to `last` at the end of a block.

    Parameters
    ----------
    duration : float
        Length of the block, > 0 [s].
    last : float
        Value of the window at the end, 0 < last <= 1 [-].

    Returns
    -------
    float
        ``-ln(last) / duration`` [1/s].

    Raises
    ------
    ValueError
        If an argument is out of range.

    Examples
    --------
    >>> round(window_decay(2.0, last=0.01), 6)
    2.302585
    """
    if not duration > 0 or not 0 < last <= 1:
        raise ValueError(
            f"duration = {duration} s must be > 0 and last = {last} must be > 0 and <= 1"
        )
    return float(-np.log(last) / duration)
