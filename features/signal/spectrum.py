"""Spectra calibrated by Parseval's theorem: amplitudes, densities, tones and band levels."""

from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import rfft
from .rate import check_rate, rate_fault
from .statistics import Real, centred

LEVEL_FLOOR = 1e-20
"""Smallest mean square that differs from silence in a level [(unit of x)^2], that is -200 dB."""

HIGHEST_EDGE_HZ = 11_500.0
"""Default upper edge [Hz]: inside the flat range of a stud-mounted industrial accelerometer."""

NYQUIST_SHARE = 0.45
"""Default upper edge as a share of the sample rate, clear of the anti-alias filter's slope [-]."""

HANN_BANDWIDTH = 1.5
"""Equivalent noise bandwidth of Hann's window [lines]: the line of a tone holds 1 / 1.5 of its
power."""

LINE_SPACING_HZ = 4.0
"""Widest line spacing of the default spectrum [Hz]: four lines in the lowest default band."""


def decibel(mean_square: ArrayLike) -> NDArray[np.float64]:
    """Level of a mean square, floored so that silence has a value.

    Parameters
    ----------
    mean_square : array_like
        Mean square [(unit of x)^2].

    Returns
    -------
    ndarray
        ``10 log10(max(mean_square, 1e-20))`` [dB re 1 (unit of x)^2]; -200 dB for silence.

    Examples
    --------
    >>> decibel([100.0, 0.0]).tolist()
    [20.0, -200.0]
    """
    power = np.asarray(mean_square, dtype=np.float64)
    return np.asarray(10.0 * np.log10(np.maximum(power, LEVEL_FLOOR)))


def band_edges(
    fs: float, *, n_bands: int = 20, low: float = 50.0, high: float | None = None
) -> NDArray[np.float64]:
    """Edges of bands equally wide on a logarithmic frequency axis.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].
    n_bands : int
        Number of bands.
    low, high : float
        First and last edge [Hz]; `high` is 11.5 kHz or 0.45 fs by default, whichever is less.

    Returns
    -------
    ndarray, shape (n_bands + 1,)
        Edges [Hz], increasing.

    Raises
    ------
    ValueError
        If `n_bands` < 1, or unless 0 < low < high <= fs / 2.

    Examples
    --------
    >>> band_edges(25_600.0, n_bands=2, low=100.0, high=10_000.0).round().tolist()
    [100.0, 1000.0, 10000.0]
    """
    top = upper_edge(fs, high)
    _check_band_limits(fs, n_bands, low, top)
    return np.asarray(np.geomspace(low, top, n_bands + 1), dtype=np.float64)


def line_band_edges(
    fs: float, nperseg: int, *, n_bands: int = 20, low: float = 200.0, high: float | None = None
) -> NDArray[np.float64]:
    """Band edges half-way between lines of a short transform, with at least one line per band.

    The edges are logarithmic where the lines are dense enough; a band that would be narrower than a
    line takes a whole one, and the bands above divide the rest.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].
    nperseg : int
        Length of the transform [samples]; the line spacing is ``fs / nperseg``.
    n_bands : int
        Number of bands.
    low, high : float
        First and last edge before rounding to half lines [Hz]; default of `high` as in
        `band_edges`.

    Returns
    -------
    ndarray, shape (n_bands + 1,)
        Edges [Hz], increasing, the first at half a line spacing or above.

    Raises
    ------
    ValueError
        As for `band_edges`, or if there are fewer lines between `low` and `high` than bands.

    Examples
    --------
    >>> line_band_edges(25_600.0, 256, n_bands=4, low=200.0, high=1600.0).tolist()
    [150.0, 250.0, 450.0, 850.0, 1550.0]
    """
    top = upper_edge(fs, high)
    _check_band_limits(fs, n_bands, low, top)
    spacing = fs / nperseg
    first = max(1, round(low / spacing))
    last = int(np.floor(top / spacing + 0.5))
    if last - first < n_bands:
        raise ValueError(
            f"n_bands = {n_bands} must be <= {last - first}, the lines of {spacing:.6g} Hz between "
            f"{low:.6g} and {top:.6g} Hz; ask for fewer bands or a longer nperseg"
        )
    return (_line_counts(first, last, n_bands) - 0.5) * spacing


def _line_counts(first: int, last: int, n_bands: int) -> NDArray[np.float64]:
    """Number of the first line of each band, and one past the last [shape=(n_bands + 1,)]."""
    opening = [first]
    for remaining in range(n_bands, 0, -1):
        current = opening[-1]
        step = current * ((last / current) ** (1.0 / remaining) - 1.0)
        # Leave every band above at least one line.
        widest = last - current - (remaining - 1)
        opening.append(current + min(max(1, round(step)), widest))
    return np.asarray(opening, dtype=np.float64)


def upper_edge(fs: float, high: float | None = None) -> float:
    """Upper edge as given, or the default [Hz]: 11.5 kHz or 0.45 fs, whichever is less."""
    check_rate(fs)
    return min(NYQUIST_SHARE * fs, HIGHEST_EDGE_HZ) if high is None else high


def _check_band_limits(fs: float, n_bands: int, low: float, high: float) -> None:
    faults = []
    if fault := rate_fault(fs):
        faults.append(fault)
    if n_bands < 1:
        faults.append(f"n_bands = {n_bands} must be >= 1; ask for at least one band")
    if not 0 < low < high:
        faults.append(f"low = {low} Hz must be > 0 and < high = {high} Hz; lower it or raise high")
    if high > fs / 2:
        faults.append(f"high = {high} Hz must be <= fs / 2 = {fs / 2} Hz; lower it")
    if faults:
        raise ValueError("; ".join(faults))


def line_weights(n_samples: int, fs: float, edges: ArrayLike) -> NDArray[np.float64]:
    """Share of every spectral line that falls into every band.

    Each line stands for the cell half a spacing to either side of it and is divided at the band
    edges in proportion. Bands narrower than a line thus stay defined, and adjoining bands neither
    lose nor double-count energy.

    Parameters
    ----------
    n_samples : int
        Length of the transform.
    fs : float
        Sample rate [Hz].
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz], increasing.

    Returns
    -------
    ndarray, shape (n_samples // 2 + 1, n_bands)
        Shares between 0 and 1 [-], read only.

    Raises
    ------
    ValueError
        If there are fewer than two edges, they do not increase, or they leave 0 … fs / 2.

    Examples
    --------
    >>> line_weights(8, 8.0, [0.0, 1.0, 4.0])[:, 0].tolist()
    [1.0, 0.5, 0.0, 0.0, 0.0]
    """
    check_rate(fs)
    bounds = np.asarray(edges, dtype=np.float64)
    if bounds.ndim != 1 or bounds.size < 2 or not np.all(np.diff(bounds) > 0):
        raise ValueError(
            f"edges = {bounds.tolist()} Hz must be two or more and increase; sort them"
        )
    if bounds[0] < 0 or bounds[-1] > fs / 2:
        raise ValueError(
            f"edges = {bounds[0]:.6g} … {bounds[-1]:.6g} Hz must lie in 0 … fs / 2 = "
            f"{fs / 2:.6g} Hz; drop the bands outside"
        )
    return _shares(n_samples, fs, tuple(pairwise(bounds.tolist())))


def band_weights(n_samples: int, fs: float, bands: ArrayLike) -> NDArray[np.float64]:
    """Share of every spectral line that falls into each of any bands, which may overlap.

    Parameters
    ----------
    n_samples : int
        Length of the transform.
    fs : float
        Sample rate [Hz].
    bands : array_like, shape (n_bands, 2)
        Lower and upper edge of each [Hz].

    Returns
    -------
    ndarray, shape (n_samples // 2 + 1, n_bands)
        Shares between 0 and 1 [-], as for `line_weights`, read only.

    Raises
    ------
    ValueError
        Unless 0 <= lower < upper <= fs / 2 for every band; all faulty bands are named.

    Examples
    --------
    >>> band_weights(8, 8.0, [[0.5, 1.5], [1.0, 4.0]])[:, 1].tolist()
    [0.0, 0.5, 1.0, 1.0, 1.0]
    """
    check_rate(fs)
    pairs = np.asarray(bands, dtype=np.float64)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.shape[0] == 0:
        raise ValueError(f"bands of shape {pairs.shape} must be (n_bands >= 1, 2); give pairs")
    wrong = [pair for pair in pairs.tolist() if not 0 <= pair[0] < pair[1] <= fs / 2]
    if wrong:
        raise ValueError(
            "; ".join(
                f"band {low:.6g} … {high:.6g} Hz must rise within 0 … fs / 2 = {fs / 2:.6g} Hz"
                for low, high in wrong
            )
            + "; correct or drop it"
        )
    return _shares(n_samples, fs, tuple((low, high) for low, high in pairs.tolist()))


@lru_cache(maxsize=8)  # the same for every record of a data set, and slower than its transform
def _shares(
    n_samples: int, fs: float, bands: tuple[tuple[float, float], ...]
) -> NDArray[np.float64]:
    """Overlap of the lines' cells with the bands, over the width of the cells; read only."""
    lower, upper = np.array(bands).T
    cells = (np.arange(n_samples // 2 + 2) - 0.5) * fs / n_samples
    cells = np.clip(cells, 0.0, fs / 2)
    bottom = np.maximum(cells[:-1, np.newaxis], lower)
    top = np.minimum(cells[1:, np.newaxis], upper)
    width = np.diff(cells)[:, np.newaxis]
    shares = np.asarray(np.clip(top - bottom, 0.0, None) / width)
    shares.setflags(write=False)
    return shares


def one_sided_scale(window: Real) -> NDArray[np.float64]:
    """Factors that turn |rfft of a windowed frame|^2 into mean square per line.

    Parameters
    ----------
    window : ndarray, shape (n_samples,)
        Window [-].

    Returns
    -------
    ndarray, shape (n_samples // 2 + 1,)
        ``2 / (n_samples sum w^2)``, half that for the lines that have no mirror image.

    Notes
    -----
    Parseval: the scaled lines of a frame x sum to ``sum (w x)^2 / sum w^2``.

    Examples
    --------
    >>> import numpy as np
    >>> one_sided_scale(np.ones(4)).tolist()
    [0.0625, 0.125, 0.0625]
    """
    n = window.size
    scale = np.full(n // 2 + 1, 2.0 / (n * float(np.sum(np.square(window, dtype=np.float64)))))
    scale[0] /= 2
    if n % 2 == 0:
        scale[-1] /= 2
    return scale


def hann(n: int) -> NDArray[np.float64]:
    """Periodic Hann window.

    Parameters
    ----------
    n : int
        Length [samples].

    Returns
    -------
    ndarray, shape (n,)
        ``sin(pi k / n)**2``; its squares, shifted by n / 4, add up to exactly 3/2.

    Examples
    --------
    >>> hann(4).round(3).tolist()
    [0.0, 0.5, 1.0, 0.5]
    """
    return np.asarray(np.sin(np.pi * np.arange(n) / n) ** 2)


def default_nperseg(fs: float, n_samples: int) -> int:
    """Length of the Welch segments: the power of two with lines at most 4 Hz apart.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].
    n_samples : int
        Length of the record, which bounds the segment.

    Returns
    -------
    int
        Segment length [samples].

    Examples
    --------
    >>> default_nperseg(25_600.0, 122_880)
    8192
    """
    check_rate(fs)
    return min(n_samples - n_samples % 2, 1 << int(np.ceil(np.log2(max(fs / LINE_SPACING_HZ, 8)))))


def power_lines(x: ArrayLike, fs: float, *, nperseg: int | None = None) -> Real:
    """Mean square of a signal, line by line, averaged over half-overlapping Hann segments.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit]; its mean is removed.
    fs : float
        Sample rate [Hz].
    nperseg : int, optional
        Segment length [samples]; see `default_nperseg`.

    Returns
    -------
    ndarray, shape (..., nperseg // 2 + 1)
        Mean square per line [(unit of x)^2] at ``k fs / nperseg``; precision of `x` kept.

    Raises
    ------
    ValueError
        Unless `nperseg` is even and 8 <= nperseg <= n_samples.

    Notes
    -----
    The lines sum to the mean square of a stationary signal. Samples after the last whole segment
    (fewer than nperseg / 2) are left out.

    References
    ----------
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE
    Trans. Audio Electroacoust. 15 (1967) 70-73, doi:10.1109/TAU.1967.1161901.

    Examples
    --------
    >>> import numpy as np
    >>> x = 3 * np.sin(2 * np.pi * 100 * np.arange(4096) / 1024)
    >>> round(float(power_lines(x, 1024.0).sum()), 6)
    4.5
    """
    check_rate(fs)
    signal = centred(x)
    length = default_nperseg(fs, signal.shape[-1]) if nperseg is None else nperseg
    if length % 2 or not 8 <= length <= signal.shape[-1]:
        raise ValueError(
            f"nperseg = {length} samples must be even, >= 8 and <= n_samples = "
            f"{signal.shape[-1]}; give a longer record or another segment"
        )
    window = hann(length)
    taper = window.astype(signal.dtype)
    starts = range(0, signal.shape[-1] - length + 1, max(1, length // 2))
    total = np.zeros((*signal.shape[:-1], length // 2 + 1), dtype=np.float64)
    for start in starts:
        line = rfft(signal[..., start : start + length] * taper)
        total += np.square(line.real) + np.square(line.imag)
    return np.asarray(total * (one_sided_scale(window) / len(starts)), dtype=signal.dtype)


def band_levels(
    x: ArrayLike, fs: float, edges: ArrayLike, *, nperseg: int | None = None
) -> NDArray[np.float64]:
    """Level of a signal in every band.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz], as from `band_edges`.
    nperseg : int, optional
        Segment length [samples].

    Returns
    -------
    ndarray, shape (..., n_bands)
        Levels [dB re 1 (unit of x)^2 mean square]: a sine of amplitude A in a band gives
        ``10 log10(A**2 / 2)``; -200 dB for silence.

    Raises
    ------
    ValueError
        As for `power_lines` and `line_weights`.

    Notes
    -----
    The power of a sine nearer than two line spacings to an edge is shared with the next band,
    because Hann's main lobe is four lines wide.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sin(2 * np.pi * 200 * np.arange(8192) / 2048)
    >>> band_levels(x, 2048.0, [100.0, 300.0]).round(2).tolist()
    [-3.01]
    """
    return levels_from_lines(power_lines(x, fs, nperseg=nperseg), fs, edges)


def levels_from_lines(lines: ArrayLike, fs: float, edges: ArrayLike) -> NDArray[np.float64]:
    """Band levels of a spectrum that has already been computed.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line [(unit of x)^2], as from `power_lines` (even segment length).
    fs : float
        Sample rate [Hz].
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz].

    Returns
    -------
    ndarray, shape (..., n_bands)
        Levels [dB re 1 (unit of x)^2].

    Raises
    ------
    ValueError
        As for `line_weights`.

    Examples
    --------
    >>> levels_from_lines([0.0, 1.0, 0.0, 0.0, 0.0], 8.0, [0.5, 1.5]).tolist()
    [0.0]
    """
    check_rate(fs)
    power = np.asarray(lines)
    return decibel(power @ line_weights(2 * (power.shape[-1] - 1), fs, edges))


# --- calibrated spectra


def line_frequencies(n_lines: int, fs: float) -> NDArray[np.float64]:
    """Frequencies of the lines of a one-sided spectrum of even length.

    Parameters
    ----------
    n_lines : int
        Number of lines, >= 2.
    fs : float
        Sample rate [Hz].

    Returns
    -------
    ndarray, shape (n_lines,)
        From 0 to fs / 2 [Hz].

    Raises
    ------
    ValueError
        If there are fewer than two lines.

    Examples
    --------
    >>> line_frequencies(3, 8.0).tolist()
    [0.0, 2.0, 4.0]
    """
    check_rate(fs)
    if n_lines < 2:
        raise ValueError(f"n_lines = {n_lines} must be >= 2; give a spectrum")
    return np.asarray(np.arange(n_lines) * (fs / (2 * (n_lines - 1))), dtype=np.float64)


def amplitude_spectrum(
    x: ArrayLike, fs: float, *, nperseg: int | None = None, rms: bool = False
) -> tuple[NDArray[np.float64], Real]:
    """Spectrum that reads the amplitude of a tone, as an analyser shows it.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit]; its mean is removed.
    fs : float
        Sample rate [Hz].
    nperseg : int, optional
        Segment length [samples], even; the whole record by default.
    rms : bool
        Whether to give rms instead of peak values.

    Returns
    -------
    frequency : ndarray, shape (nperseg // 2 + 1,)
        Frequency [Hz].
    amplitude : ndarray, shape (..., nperseg // 2 + 1)
        Amplitude of the tone on each line [unit of x]; averaged as mean squares over the segments.

    Raises
    ------
    ValueError
        As for `power_lines`.

    Notes
    -----
    Corrected for Hann's coherent gain: exact for a tone on a line, up to 15.1 % (1.42 dB) low
    between two; `strongest_tone` corrects that. Noise reads as its density times 1.5 line spacings.

    Examples
    --------
    >>> import numpy as np
    >>> frequency, amplitude = amplitude_spectrum(np.sin(np.pi * np.arange(64) / 4), 64.0)
    >>> float(frequency[8]), round(float(amplitude[8]), 6)
    (8.0, 1.0)
    """
    check_rate(fs)
    lines = power_lines(x, fs, nperseg=whole_segment(x) if nperseg is None else nperseg)
    squares = lines * lines.dtype.type(HANN_BANDWIDTH * (1 if rms else 2))
    return line_frequencies(lines.shape[-1], fs), np.asarray(np.sqrt(squares))


def whole_segment(x: ArrayLike) -> int:
    """Longest even segment [samples]: it covers the whole record."""
    n = np.shape(x)[-1] if np.ndim(x) else 0
    return n - n % 2


def power_spectral_density(
    x: ArrayLike, fs: float, *, nperseg: int | None = None
) -> tuple[NDArray[np.float64], Real]:
    """Mean square per hertz, averaged over half-overlapping Hann segments.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit]; its mean is removed.
    fs : float
        Sample rate [Hz].
    nperseg : int, optional
        Segment length [samples]; see `default_nperseg`.

    Returns
    -------
    frequency : ndarray, shape (nperseg // 2 + 1,)
        Frequency [Hz].
    density : ndarray, shape (..., nperseg // 2 + 1)
        One-sided [(unit of x)^2 / Hz]; its sum times the spacing is the mean square.

    Raises
    ------
    ValueError
        As for `power_lines`.

    Notes
    -----
    Same as `scipy.signal.welch` with ``detrend=False`` of the signal less its mean.

    Examples
    --------
    >>> import numpy as np
    >>> frequency, density = power_spectral_density(np.tile([1.0, -1.0], 64), 64.0, nperseg=32)
    >>> round(float(density.sum() * frequency[1]), 6)
    1.0
    """
    check_rate(fs)
    lines = power_lines(x, fs, nperseg=nperseg)
    frequency = line_frequencies(lines.shape[-1], fs)
    return frequency, np.asarray(lines / lines.dtype.type(frequency[1]))


def strongest_tone(
    x: ArrayLike,
    fs: float,
    *,
    band: tuple[float, float] | None = None,
    nperseg: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequency and amplitude of the highest peak of a spectrum, between its lines.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    band : tuple of float, optional
        Band to search [Hz]; the whole spectrum by default.
    nperseg : int, optional
        Segment length [samples], even; the whole record by default.

    Returns
    -------
    frequency, amplitude : ndarray, shape (...)
        Frequency [Hz] and peak value [unit of x]; both 0 for a constant signal.

    Raises
    ------
    ValueError
        As for `power_lines`, or if the band holds no line between the first and the last.

    Notes
    -----
    From the ratio of the two highest neighbouring lines (Grandke), exact for one steady complex
    tone. The mirror image of a real one, k lines from 0 or fs / 2, disturbs the amplitude by
    less than ``0.02 / k^3`` of it and the frequency by less than ``0.1 / k^3`` line spacings.
    Another tone, d lines away, does so by up to ``0.4 / d^3`` and ``1.1 / d^3`` times its share
    of the amplitude, from d = 5 on (all measured, worst phase).

    References
    ----------
    T. Grandke, "Interpolation algorithms for discrete Fourier transforms of weighted signals",
    IEEE Trans. Instrum. Meas. 32 (1983) 350-355, doi:10.1109/TIM.1983.4315077.

    Examples
    --------
    >>> import numpy as np
    >>> tone = 3 * np.sin(2 * np.pi * 100.3 * np.arange(1024) / 1024)
    >>> [round(float(value), 4) for value in strongest_tone(tone, 1024.0)]
    [100.3, 3.0]
    """
    check_rate(fs)
    mean_squares = power_lines(x, fs, nperseg=whole_segment(x) if nperseg is None else nperseg)
    lines = np.asarray(mean_squares, dtype=np.float64)
    frequency = line_frequencies(lines.shape[-1], fs)
    low, high = band or (0.0, fs / 2)
    inside = (frequency >= low) & (frequency <= high)
    inside[[0, -1]] = False
    if not inside.any():
        raise ValueError(
            f"band = {low:.6g} … {high:.6g} Hz must hold a line of {frequency[1]:.6g} Hz spacing "
            f"below fs / 2 = {fs / 2:.6g} Hz; widen it or record longer"
        )
    top = np.argmax(np.where(inside, lines, -1.0), axis=-1)
    below, peak, above = (_pick(lines, top + step) for step in (-1, 0, 1))
    side = np.where(above >= below, 1, -1)
    neighbour = np.sqrt(np.maximum(above, below) / np.where(peak > 0, peak, 1))
    # A neighbour above half the peak's own amplitude pulls towards it, by half a line at most.
    shift = np.clip((2 * neighbour - 1) / (1 + neighbour), 0, 0.5)
    amplitude = np.sqrt(2 * HANN_BANDWIDTH * peak) * _hann_loss(shift)
    place = (top + side * shift) * frequency[1]
    return np.where(peak == 0, 0.0, place), np.asarray(amplitude)


def _pick(lines: NDArray[np.float64], index: NDArray[np.intp]) -> NDArray[np.float64]:
    """One line of each channel."""
    return np.asarray(np.take_along_axis(lines, index[..., np.newaxis], axis=-1)[..., 0])


def _hann_loss(shift: NDArray[np.float64]) -> NDArray[np.float64]:
    """Factor that corrects the reading of a Hann line for its distance from the tone [-]."""
    return np.asarray((1 - shift**2) / np.sinc(shift))


# --- arbitrary bands


def levels_in_bands(lines: ArrayLike, fs: float, bands: ArrayLike) -> NDArray[np.float64]:
    """Levels in arbitrary bands of a spectrum that has already been computed.

    Parameters
    ----------
    lines : array_like, shape (..., n_lines)
        Mean square per line [(unit of x)^2], as from `power_lines`.
    fs : float
        Sample rate [Hz].
    bands : array_like, shape (n_bands, 2)
        Lower and upper edge of each [Hz]; they may overlap.

    Returns
    -------
    ndarray, shape (..., n_bands)
        Levels [dB re 1 (unit of x)^2].

    Raises
    ------
    ValueError
        As for `band_weights`.

    Examples
    --------
    >>> levels_in_bands([0.0, 1.0, 1.0, 0.0, 0.0], 8.0, [[0.5, 1.5], [0.5, 2.5]]).round(2).tolist()
    [0.0, 3.01]
    """
    check_rate(fs)
    power = np.asarray(lines)
    return decibel(power @ band_weights(2 * (power.shape[-1] - 1), fs, bands))
