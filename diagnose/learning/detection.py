"""Least wear whose estimates differ from those of as-new machines."""

import math

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

FALSE_ALARMS = 0.05
"""Share of as-new machines whose estimate lies above the threshold."""

DETECTED = 0.9
"""Share of machines with the wear in question whose estimate does."""

_FEWEST = 20  # as-new machines: for a share of 5 % one of them


def visible_from(severity: Float, estimate: Float, as_new: float) -> float | None:
    """Least wear that nine of ten estimates distinguish from as new, at 5 % false alarms.

    Parameters
    ----------
    severity, estimate : numpy.ndarray [shape=(n,)]
        True and estimated wear, of machines that had no part in the fit [m].
    as_new : float
        Wear up to which a machine counts as new [m].

    Returns
    -------
    float or None
        [m], within `as_new` and the largest severity, which is returned where more would be needed;
        None with fewer than 20 as-new or 20 worn machines.

    Notes
    -----
    The logarithm of the estimate is taken as a straight line over that of the severity, with equal
    normal scatter; it crosses the threshold with the probability asked where
    ``b0 + b1 ln(a) - z s = ln(threshold)``. If the estimate does not rise with the wear, there is
    none.

    References
    ----------
    MIL-HDBK-1823A, "Nondestructive evaluation system reliability assessment" (2009), appendix G:
    probability of detection from signal against size.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> wear = np.exp(rng.uniform(np.log(1e-5), np.log(1e-3), 4000))
    >>> read = 1e-4 + wear  # adds what hides small wear
    >>> noisy = read * np.exp(0.1 * rng.standard_normal(4000))
    >>> sharp = wear * np.exp(0.01 * rng.standard_normal(4000))
    >>> visible_from(wear, noisy, 5e-5) > 1.3 * visible_from(wear, sharp, 5e-5)
    True
    """
    from scipy.stats import norm

    new = severity <= as_new
    if min(new.sum(), (~new).sum()) < _FEWEST:
        return None
    threshold = float(np.quantile(estimate[new], 1 - FALSE_ALARMS))
    x, y = np.log(severity), np.log(estimate)
    slope, level = np.polyfit(x, y, 1)
    largest = float(severity.max())
    if slope <= 0:
        return largest
    scatter = float(np.std(y - level - slope * x, ddof=2))
    found = (math.log(threshold) + float(norm.ppf(DETECTED)) * scatter - level) / slope
    return float(np.exp(np.clip(found, math.log(as_new), math.log(largest))))
