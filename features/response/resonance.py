"""Resonances of response functions, found by their prominence."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.spectrum import decibel
from .modal_model import (
    checked_functions,
    squared_size,
)

Integer = NDArray[np.intp]

PROMINENCE = 6.0
"""Rise of a resonance above the valleys on either side [dB]: with ten averages at a coherence of
0.9, lines scatter by 0.65 dB and hardly ever form one."""


def find_resonances(
    frequency: ArrayLike, value: ArrayLike, *, prominence: float = PROMINENCE
) -> Integer:
    """Lines of the resonance peaks that all response functions show together.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Frequency of the lines [Hz].
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions of one quantity and unit.
    prominence : float
        Rise above the higher of the two adjacent valleys, > 0 [dB].

    Returns
    -------
    ndarray of int, shape (n_peaks,)
        Indices of the lines, ascending; empty if nothing stands out.

    Raises
    ------
    ValueError
        If shapes do not agree, a line is not finite, a channel is silent or `prominence` is not
        > 0.

    Notes
    -----
    Peaks of ``10 log10 sum |H|^2`` over the channels: a channel at a node of a mode misses it, the
    sum does not. Two modes closer than their half-power width form one peak; `stable_modes`
    separates them.

    Examples
    --------
    >>> f = np.arange(100.0)
    >>> value = 1 / (30**2 - f**2 + 1.2j * f) + 1 / (70**2 - f**2 + 2.8j * f)
    >>> find_resonances(f, value).tolist()
    [30, 70]
    """
    from scipy.signal import find_peaks  # import takes half a second, and reports do not need it

    _, functions = checked_functions(frequency, value)
    if not prominence > 0:
        raise ValueError(f"prominence = {prominence} dB must be > 0; 6 dB is usual")
    level = decibel(np.sum(squared_size(functions / np.abs(functions).max()), axis=0))
    peaks, _ = find_peaks(level, prominence=prominence)
    return np.asarray(peaks, dtype=np.intp)
