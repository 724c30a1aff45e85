"""Third octaves on the exact base-ten frequencies of IEC 61260."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import fast_length
from .rate import check_rate
from .spectrum import band_levels, upper_edge, whole_segment


def third_octave_centres(low: float, high: float) -> NDArray[np.float64]:
    """Exact mid-band frequencies of third octaves.

    Parameters
    ----------
    low, high : float
        First and last mid-band frequency [Hz], exact or nominal; the nearest bands are taken.

    Returns
    -------
    ndarray, shape (n_bands,)
        ``1000 * 10^(i / 10)`` [Hz].

    Raises
    ------
    ValueError
        Unless 0 < low <= high.

    References
    ----------
    IEC 61260-1:2014, "Electroacoustics: octave-band and fractional-octave-band filters", 5.2 and
    5.3: octave ratio 10^(3/10), reference 1000 Hz.

    Examples
    --------
    >>> third_octave_centres(800.0, 1250.0).round(2).tolist()
    [794.33, 1000.0, 1258.93]
    """
    if not 0 < low <= high < math.inf:
        raise ValueError(f"low = {low} Hz must be > 0 and <= high = {high} Hz; lower it")
    first, last = (round(10 * math.log10(f / 1000.0)) for f in (low, high))
    return 1000.0 * 10 ** (np.arange(first, last + 1) / 10)


def third_octave_edges(low: float, high: float) -> NDArray[np.float64]:
    """Exact edges of adjoining third octaves.

    Parameters
    ----------
    low, high : float
        First and last mid-band frequency [Hz], as for `third_octave_centres`.

    Returns
    -------
    ndarray, shape (n_bands + 1,)
        ``1000 * 10^((2 i ± 1) / 20)`` [Hz]: the upper edge of a band is the lower of the next.

    Raises
    ------
    ValueError
        Unless 0 < low <= high.

    References
    ----------
    IEC 61260-1:2014, 5.4.

    Examples
    --------
    >>> third_octave_edges(1000.0, 1000.0).round(3).tolist()
    [891.251, 1122.018]
    """
    centres = third_octave_centres(low, high)
    return np.append(centres, centres[-1] * 10**0.1) * 10**-0.05


def third_octave_levels(
    x: ArrayLike,
    fs: float,
    *,
    low: float = 25.0,
    high: float | None = None,
    nperseg: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Levels of a signal in third octaves.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    low, high : float
        First and last mid-band frequency [Hz]; `high` is by default the last band below 0.45 fs
        or 11.5 kHz, whichever is less.
    nperseg : int, optional
        Segment length [samples]; by default four lines or more lie in the lowest band, if the
        record is long enough.

    Returns
    -------
    centres : ndarray, shape (n_bands,)
        Exact mid-band frequencies [Hz].
    levels : ndarray, shape (..., n_bands)
        [dB re 1 (unit of x)^2 mean square]; -200 dB for silence.

    Raises
    ------
    ValueError
        If the bands leave 0 … fs / 2, or the lowest is narrower than a line.

    Notes
    -----
    Spectral lines are added up, those on an edge by their share, so the bands hold all of the mean
    square between them. The filters of the standard have slopes instead: a tone in the middle of a
    band reads the same, a tone near an edge does not.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sqrt(2) * np.sin(2 * np.pi * 1000 * np.arange(8192) / 8192)
    >>> centres, levels = third_octave_levels(x, 8192.0, low=800.0, high=1250.0)
    >>> abs(levels[1]).round(3).tolist()
    0.0
    """
    check_rate(fs)
    if high is None:
        high = 1000.0 * 10 ** (math.floor(10 * math.log10(upper_edge(fs) / 1122.02)) / 10)
    centres, edges = third_octave_centres(low, high), third_octave_edges(low, high)
    width = float(edges[1] - edges[0])
    if nperseg is None:
        nperseg = min(2 * fast_length(math.ceil(2 * fs / width)), whole_segment(x))
    if nperseg * width < fs:
        raise ValueError(
            f"low = {low:.6g} Hz gives a band of {width:.4g} Hz, which must be >= the line spacing "
            f"{fs / max(nperseg, 1):.4g} Hz; record longer or raise low"
        )
    return centres, band_levels(x, fs, edges, nperseg=nperseg)
