"""Mutual information of one column with a target, from the distances of nearest neighbours."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from scipy.special import digamma
from sklearn.utils import check_random_state

Float = NDArray[np.float64]

_JITTER = 1e-10  # of the size of the values: parts equal ones, far below any other distance


def mutual_information(
    values: ArrayLike,
    target: ArrayLike,
    *,
    classes: bool = False,
    neighbours: int = 3,
    seed: int = 0,
) -> float:
    """Estimate the mutual information of two variables.

    Parameters
    ----------
    values : array_like of shape (n_records,)
        Finite numbers.
    target : array_like of shape (n_records,)
        Finite numbers, or labels of conditions.
    classes : bool
        `target` names conditions, which have no order.
    neighbours : int
        Which neighbour's distance is the scale of the estimate; of a condition with fewer records,
        its farthest.
    seed : int
        Seed of the noise that separates equal values, 1e-10 of their size.

    Returns
    -------
    float
        Information [nat]; 0 where the estimate is negative.

    Notes
    -----
    Kraskov, Stoegbauer and Grassberger 2004, doi:10.1103/PhysRevE.69.066138, eq. 8, and for
    conditions Ross 2014, doi:10.1371/journal.pone.0087357. The same numbers as
    ``mutual_info_regression`` and ``mutual_info_classif`` of scikit-learn, which check and prepare
    every call for milliseconds; a table of features needs thousands of calls.

    Examples
    --------
    >>> x = np.linspace(0, 1, 200)
    >>> round(mutual_information(x, x > 0.5, classes=True) / float(np.log(2)), 2)  # [bits]
    0.99
    """
    noise = _noise(seed, np.size(values))
    column = _parted(values, noise[0])
    if classes:
        return _with_conditions(column, np.asarray(target), neighbours)
    return _with_numbers(column, _parted(target, noise[1]), neighbours)


@lru_cache(maxsize=8)
def _noise(seed: int, size: int) -> Float:
    """For values and target [shape=(2, size)]; kept, as every feature of a table needs the same."""
    found: Float = check_random_state(seed).standard_normal((2, size))
    found.flags.writeable = False
    return found


def _parted(values: ArrayLike, noise: Float) -> Float:
    """Values over their standard deviation, equal ones parted by noise."""
    column = np.asarray(values, dtype=np.float64)
    deviation = column.std()
    scaled = column / deviation if deviation > 0 else column
    size = max(1.0, float(np.abs(scaled).mean()))
    return np.asarray(scaled + _JITTER * size * noise)


def _with_numbers(x: Float, y: Float, neighbours: int) -> float:
    """Kraskov's first estimator: balls of the joint space counted in both of its axes."""
    both = np.column_stack([x, y])
    distance = cKDTree(both).query(both, k=neighbours + 1, p=np.inf)[0][:, -1]  # first: itself
    near = sum(float(np.mean(digamma(_closer(axis, distance)))) for axis in (x, y))
    return max(0.0, float(digamma(x.size)) + float(digamma(neighbours)) - near)


def _with_conditions(x: Float, labels: NDArray[np.generic], neighbours: int) -> float:
    """Ross's estimator: balls of a condition's own records counted among all of them."""
    _, condition, counts = np.unique(labels, return_inverse=True, return_counts=True)
    kept = counts[condition] > 1  # a condition of one record has no neighbour
    x, condition = x[kept], condition[kept]
    if x.size == 0:
        return 0.0
    size = counts[condition]
    distance = np.empty(x.size)
    for each in np.unique(condition):
        own = condition == each
        distance[own] = _to_neighbour(x[own], min(neighbours, counts[each] - 1))
    local = digamma(np.minimum(neighbours, size - 1)) - digamma(size)
    local = local - digamma(_closer(x, distance))
    return max(0.0, float(digamma(x.size)) + float(np.mean(local)))


def _to_neighbour(x: Float, nth: int) -> Float:
    """Distance of each value to its nth nearest [shape=(n,)]."""
    order = np.argsort(x)
    ends = np.full(nth, np.inf)
    line = np.concatenate([-ends, x[order], ends])
    # the nth nearest bounds one of the windows of nth + 1 values that hold the value itself
    lower = [line[nth - below : nth - below + x.size] for below in range(nth + 1)]
    upper = [line[2 * nth - below : 2 * nth - below + x.size] for below in range(nth + 1)]
    found = np.empty(x.size)
    found[order] = np.min(np.maximum(x[order] - lower, np.subtract(upper, x[order])), axis=0)
    return found


def _closer(x: Float, distance: Float) -> Float:
    """Number of values that are closer to each than a distance, itself among them."""
    line = np.sort(x)
    first = np.searchsorted(line, x - distance, side="right")
    end = np.searchsorted(line, x + distance, side="left")
    # x - d and x + d are rounded: the neighbour at just that distance may have come in or the
    # one before it stayed out, so that the differences themselves decide
    first -= (first > 0) & (x - line[np.maximum(first - 1, 0)] < distance)
    first += x - line[np.minimum(first, x.size - 1)] >= distance
    end += (end < x.size) & (line[np.minimum(end, x.size - 1)] - x < distance)
    end -= line[np.maximum(end - 1, 0)] - x >= distance
    return np.asarray(np.maximum(end - first, 1), dtype=np.float64)
