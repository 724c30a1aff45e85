"""Band levels from a spectrum calibrated by Parseval's theorem."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import rfft
from .statistics import Real, centred

LEVEL_FLOOR = 1e-20
"""Smallest mean square a level distinguishes from silence [(unit of x)^2], that is -200 dB."""

HIGHEST_EDGE_HZ = 11_500.0
"""Default upper edge [Hz]: inside the flat range of a stud-mounted industrial accelerometer."""

NYQUIST_SHARE = 0.45
"""Default upper edge as a share of the sample rate, clear of the anti-alias filter's slope [-]."""

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
    top = _upper_edge(fs, high)
    _check_band_limits(fs, n_bands, low, top)
    return np.asarray(np.geomspace(low, top, n_bands + 1), dtype=np.float64)


def line_band_edges(
    fs: float, nperseg: int, *, n_bands: int = 20, low: float = 200.0, high: float | None = None
) -> NDArray[np.float64]:
    """Band edges half-way between lines of a short transform, one whole line or more per band.

    Logarithmic where the lines are dense enough; a band that would be narrower than a line takes
    a whole one, and the bands above share what is left.

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
        As `band_edges`, or if there are fewer lines between `low` and `high` than bands.

    Examples
    --------
    >>> line_band_edges(25_600.0, 256, n_bands=4, low=200.0, high=1600.0).tolist()
    [150.0, 250.0, 450.0, 850.0, 1550.0]
    """
    top = _upper_edge(fs, high)
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
    """Line number opening each band, and the one past the last [shape=(n_bands + 1,)]."""
    opening = [first]
    for remaining in range(n_bands, 0, -1):
        current = opening[-1]
        step = current * ((last / current) ** (1.0 / remaining) - 1.0)
        # Leave every band above at least one line.
        widest = last - current - (remaining - 1)
        opening.append(current + min(max(1, round(step)), widest))
    return np.asarray(opening, dtype=np.float64)


def _upper_edge(fs: float, high: float | None) -> float:
    return min(NYQUIST_SHARE * fs, HIGHEST_EDGE_HZ) if high is None else high


def _check_band_limits(fs: float, n_bands: int, low: float, high: float) -> None:
    faults = []
    if not (np.isfinite(fs) and fs > 0):
        faults.append(f"fs = {fs} Hz must be > 0 and finite; give the sample rate")
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

    Each line stands for the cell half a spacing to either side of it, and is divided at the
    band edges in proportion, so that bands narrower than a line stay defined and adjoining bands
    neither lose nor count energy twice.

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
        Shares between 0 and 1 [-].

    Raises
    ------
    ValueError
        If there are fewer than two edges, they do not increase, or they leave 0 … fs / 2.

    Examples
    --------
    >>> line_weights(8, 8.0, [0.0, 1.0, 4.0])[:, 0].tolist()
    [1.0, 0.5, 0.0, 0.0, 0.0]
    """
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
    cells = (np.arange(n_samples // 2 + 2) - 0.5) * fs / n_samples
    cells = np.clip(cells, 0.0, fs / 2)
    lower = np.maximum(cells[:-1, np.newaxis], bounds[:-1])
    upper = np.minimum(cells[1:, np.newaxis], bounds[1:])
    width = np.diff(cells)[:, np.newaxis]
    return np.asarray(np.clip(upper - lower, 0.0, None) / width)


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
        As `power_lines` and `line_weights`.

    Notes
    -----
    A sine nearer than two line spacings to an edge is shared with the next band, because Hann's
    main lobe is four lines wide.

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
        As `line_weights`.

    Examples
    --------
    >>> levels_from_lines([0.0, 1.0, 0.0, 0.0, 0.0], 8.0, [0.5, 1.5]).tolist()
    [0.0]
    """
    power = np.asarray(lines)
    return decibel(power @ line_weights(2 * (power.shape[-1] - 1), fs, edges))
