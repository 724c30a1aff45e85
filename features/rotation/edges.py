"""Edges of a logic level between two samples, located to a fraction of a sample.

If a converter averages over each sample, or a filter rounds the pulse, the slope shows where
between two samples the edge lies. A logic level that is sampled instantaneously shows only between
which two samples: the edge is anywhere within that interval, on average in its middle. A shaft's
speed changes little from one pulse to the next, so that the smoothest row of edges within those
intervals is much more accurate than their middles.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Float = NDArray[np.float64]

_LEVEL_SHARE = 0.02
"""Largest distance of a logic level's samples from either level, as a share of the swing [-]."""

_LOGIC_SHARE = 0.9
"""Smallest share of edges without a sample on the slope in a logic level [-]. If each sample is
averaged over its interval, one edge in 25 has none."""

_HALF_SAMPLE = 0.5
_STIFFEST, _SOFTEST = 1e9, 1e-6
_HALVINGS = 24
_FEWEST = 5  # edges: four always lie on a cubic, and nearly on a parabola


def is_logic_level(before: NDArray[np.float64], after: NDArray[np.float64], swing: float) -> bool:
    """Whether a pulse train has two levels and nothing between them.

    Parameters
    ----------
    before, after : ndarray, shape (n_edges,)
        Samples on either side of every edge, above the lowest sample [any unit].
    swing : float
        Highest minus lowest sample [same unit].

    Examples
    --------
    >>> is_logic_level(np.zeros(3), np.full(3, 5.0), 5.0)
    True
    >>> is_logic_level(np.array([0.0, 0.0, 2.0]), np.array([3.0, 4.0, 5.0]), 5.0)
    False
    """
    sharp = (before <= _LEVEL_SHARE * swing) & (after >= (1 - _LEVEL_SHARE) * swing)
    return bool(np.mean(sharp) >= _LOGIC_SHARE)


def placed_edges(before: NDArray[np.intp], around: Float, otherwise: Float) -> Float:
    """Positions of the rising edges of a pulse train, by the method that suits the train.

    Parameters
    ----------
    before : ndarray, shape (n_edges,)
        Last sample of each edge below the level, increasing.
    around : ndarray, shape (n_edges, 4)
        Samples from the one before that to the two after it, scaled so that the lowest of the
        record is 0 and its highest 1 [-]; NaN outside the record.
    otherwise : ndarray, shape (n_edges,)
        Positions of the edges that take longer than two samples [samples].

    Returns
    -------
    ndarray, shape (n_edges,)
        Positions [samples]. For a sampled logic level those of `smoothest`. Otherwise a step
        averaged over a sample is located by its area: each sample is the mean over the interval
        around it, so that the sum of the four gives the part after the edge.

    Examples
    --------
    >>> placed_edges(np.array([2]), np.array([[0.0, 0.2, 1.0, 1.0]]), np.array([2.4])).round(9)
    array([2.3])
    """
    if before.size and is_logic_level(around[:, 1], around[:, 2], 1.0):
        return smoothest(before.astype(np.float64) + 0.5)
    flat = (abs(around[:, 0]) <= _LEVEL_SHARE) & (around[:, 3] >= 1 - _LEVEL_SHARE)
    return np.where(flat, before + 2.5 - around.sum(axis=1), otherwise)


def smoothest(edges: Float) -> Float:
    """Smoothest row of edges that is consistent with the sampled ones.

    Parameters
    ----------
    edges : ndarray, shape (n_edges,)
        Middles of the samples within which the edges lie [samples], increasing.

    Returns
    -------
    ndarray, shape (n_edges,)
        Positions of the edges [samples]; fewer than five are returned unchanged.

    Notes
    -----
    Whittaker's smoother, ``(I + s D'D) t = edges`` with the third differences D: a steady
    acceleration is not penalised. The stiffness s is the largest that moves no edge by more than
    half a sample plus the uncertainty of a fit of n edges, ``1 / sqrt(n)`` of a sample.

    References
    ----------
    P. H. C. Eilers, "A perfect smoother", Analytical Chemistry 75 (2003) 3631-3636,
    doi:10.1021/ac034173t.

    Examples
    --------
    >>> truth = 3.21 + 102.4003 * np.arange(40)
    >>> sampled = np.ceil(truth) - 0.5
    >>> float(abs(sampled - truth).max()) > 0.4, float(abs(smoothest(sampled) - truth).max()) < 0.15
    (True, True)
    """
    if edges.size < _FEWEST:
        return edges
    most = _HALF_SAMPLE + 1 / np.sqrt(edges.size)
    number = np.linspace(-1.0, 1.0, edges.size)
    steady = np.polynomial.polynomial.polyval(
        number, np.polynomial.polynomial.polyfit(number, edges, 2)
    )
    rest = edges - steady  # a parabola is not penalised; removing it saves digits
    low, high = np.log(_SOFTEST), np.log(_STIFFEST)
    best = rest
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        found = _whittaker(rest, float(np.exp(middle)))
        if np.abs(found - rest).max() <= most:
            low, best = middle, found
        else:
            high = middle
    return np.asarray(steady + best)


def _whittaker(x: Float, stiffness: float) -> Float:
    """Solution of ``(I + s D'D) t = x``, with D the third differences."""
    n = x.size
    bands = np.zeros((4, n))  # upper form: row 3 - k holds diagonal k
    weights = np.array([-1.0, 3.0, -3.0, 1.0])
    for i in range(4):
        for j in range(i, 4):
            bands[3 - (j - i), j : n - 3 + j] += stiffness * weights[i] * weights[j]
    bands[3] += 1.0
    return np.asarray(solveh_banded(bands, x))
