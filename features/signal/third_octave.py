"""Third octaves on the exact base-ten frequencies of IEC 61260."""

import math

import numpy as np
from numpy.typing import NDArray


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
