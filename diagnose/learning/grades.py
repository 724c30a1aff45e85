"""Wear grades: names, and the accuracy that an error in metres allows."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

GRADE_NAMES = ("as new", "worn", "plan renewal", "condemned")

GRADE_COLOURS = ("#3a923a", "#c8b400", "#e07b00", "#c03a2b")
"""Names of grades 0 to 3, shown with the colour wherever it is used."""

NO_GRADE_COLOUR = "#5b6470"

WARNING_GRADE = 2
ALARM_GRADE = 3


def grades_of(severity: ArrayLike, edges: ArrayLike) -> NDArray[np.intp]:
    """Grade of each severity; on an edge the higher one.

    Parameters
    ----------
    severity : array_like
        [m]
    edges : array_like
        Where grades 1, 2, … begin [m].

    Returns
    -------
    numpy.ndarray
        Integers of the same shape.

    Examples
    --------
    >>> grades_of([0.1, 0.2, 0.9], [0.2, 0.5])
    array([0, 1, 2])
    """
    return np.searchsorted(np.asarray(edges, dtype=float), np.asarray(severity), side="right")


def accuracy_bound(severity: ArrayLike, edges: Sequence[float], mean_error: float) -> float:
    """Grade accuracy to expect from an estimate with this mean absolute error.

    A machine near an edge is misgraded by any error, so accuracy has a ceiling that follows from
    the error in metres and from how many machines stand near an edge. It is the expectation for
    errors that are Laplace distributed and proportional to the severity, as those of a model of
    log severity are; other errors of the same mean can do somewhat better or worse.

    Parameters
    ----------
    severity : array_like
        True severities of the set judged [m], > 0.
    edges : sequence of float
        Grade edges [m].
    mean_error : float
        Mean absolute error of the estimate [m], >= 0.

    Returns
    -------
    float
        Expected share of right grades, 0 to 1.

    Examples
    --------
    >>> accuracy_bound([1.0, 3.0], [2.0], 0.0)
    1.0
    >>> round(accuracy_bound([2.0], [2.0], 0.5), 3)  # on the edge: a coin toss
    0.5
    """
    values = np.asarray(severity, dtype=float)
    bounds = np.concatenate([[-np.inf], np.asarray(edges, dtype=float), [np.inf]])
    if mean_error <= 0:
        return 1.0
    grade = grades_of(values, edges)
    scale = mean_error * values / values.mean()
    above = _laplace_tail((bounds[grade + 1] - values) / scale)
    below = _laplace_tail((values - bounds[grade]) / scale)
    return float(np.mean(1 - above - below))


def _laplace_tail(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of Laplace errors of mean size one beyond a distance >= 0."""
    return 0.5 * np.exp(-distance)
