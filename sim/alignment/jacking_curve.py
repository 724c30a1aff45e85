"""Evaluation of a measured jacking curve: load on the jack over the lift of the shaft.

Sources: the usual practice of jack-up tests, as in class societies' guides to shaft alignment: the
line on which the bearing is free, extrapolated to zero lift, times the correction factor.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]

FEWEST = 8
"""Least number of points: a line through each part, with some left to estimate the scatter."""

_FEWEST_FREE = 4  # points with the bearing free
_KNEES = 200  # lifts tried
_CLEAR = 1.15  # times the knee: closer, some points of a long bearing still carry load
_SHARPEST = 0.9  # slope free over slope before: closer to 1 no knee is visible


class CurveError(ValueError):
    """A jacking curve from which no reaction can be determined."""


@dataclass(frozen=True, kw_only=True)
class CurveFit:
    """Straight line of a jacking curve with the bearing free.

    Attributes
    ----------
    zero_load : float
        Extrapolation of that line to zero lift [N].
    zero_load_deviation : float
        Standard deviation from the scatter of its points [N].
    slope, slope_deviation : float
        Slope of the line [N/m].
    first_slope : float
        Slope before the bearing comes free [N/m].
    free_lift : float
        Intersection of the two lines [m].
    friction : float or None
        Increase of the load when lifting, decrease when lowering [N]; None if the curve has only
        one direction.
    """

    zero_load: float
    zero_load_deviation: float
    slope: float
    slope_deviation: float
    first_slope: float
    free_lift: float
    friction: float | None


def fit_curve(lifts: ArrayLike, loads: ArrayLike) -> CurveFit:
    """Fit the two lines of a jacking curve.

    Parameters
    ----------
    lifts : array_like [shape=(n,)]
        Lift of the shaft at the jack from its rest, in the order of reading [m].
    loads : array_like [shape=(n,)]
        Load on the jack [N].

    Returns
    -------
    CurveFit
        Line with standard deviations.

    Raises
    ------
    CurveError
        Points are too few, not finite, or show no bearing that comes free.

    Notes
    -----
    Two lines that meet are fitted by least squares, to find the lift where they meet; then the
    second alone through the points clear of it. If the curve goes up and down, friction of jack
    and seals is a constant with the sign of the direction, fitted with the line.

    Examples
    --------
    >>> lifts = np.linspace(0, 1e-3, 11)
    >>> found = fit_curve(lifts, np.minimum(5e8 * lifts, 8e4 + 1e8 * lifts))
    >>> round(found.zero_load), round(1e3 * found.free_lift, 3)
    (80000, 0.2)
    """
    at, load = np.asarray(lifts, dtype=float), np.asarray(loads, dtype=float)
    _refuse_points(at, load)
    way = _ways(at)
    both = bool((way < 0).sum() >= _FEWEST_FREE - 1)
    knee, start, before, after = _knee(at, load, way if both else None)
    if not after < _SHARPEST * before:
        raise CurveError(
            f"slope of the last points = {after:.3g} N/m must be < {_SHARPEST:g} of that of the "
            f"first, {before:.3g} N/m: the bearing does not come free; lift on, or give more points"
        )
    free = at > _CLEAR * knee
    if free.sum() < _FEWEST_FREE:
        raise CurveError(
            f"points with the bearing free = {free.sum()} must be >= {_FEWEST_FREE}; lift on "
            f"beyond {1e3 * _CLEAR * knee:.3g} mm"
        )
    two_way = both and bool((way[free] < 0).sum() >= 2 and (way[free] > 0).sum() >= 2)
    design = _design(at[free], way[free] if two_way else None)
    value, spread = _least_squares(design, load[free])
    return CurveFit(
        zero_load=float(value[0]),
        zero_load_deviation=math.sqrt(spread[0, 0]),
        slope=float(value[1]),
        slope_deviation=math.sqrt(spread[1, 1]),
        first_slope=before,
        free_lift=float((value[0] - start) / (before - value[1])),
        friction=float(value[2]) if two_way else None,
    )


def _refuse_points(at: Vector, load: Vector) -> None:
    if at.shape != load.shape or at.ndim != 1 or at.size < FEWEST:
        raise CurveError(
            f"points = {min(at.size, load.size)} must be >= {FEWEST}, a load for each lift; read "
            "more lifts"
        )
    if not (np.isfinite(at).all() and np.isfinite(load).all() and (at >= 0).all()):
        raise CurveError("lifts and loads must be finite and lifts >= 0; count lifts from rest")


def _ways(at: Vector) -> Vector:
    """Direction of each point: 1 if reached by lifting, -1 by lowering."""
    step = np.sign(np.diff(at))
    for i in range(1, step.size):
        step[i] = step[i] or step[i - 1]
    return np.concatenate([[1.0], np.where(step == 0, 1.0, step)])


def _design(at: Vector, way: Vector | None, *more: Vector) -> Vector:
    columns = [np.ones_like(at), at, *([] if way is None else [way]), *more]
    return np.stack(columns, axis=1)


def _least_squares(design: Vector, load: Vector) -> tuple[Vector, Vector]:
    """Coefficients, and their covariance from the scatter about the fit."""
    value = np.linalg.lstsq(design, load, rcond=None)[0]
    left = load - design @ value
    freedom = load.size - design.shape[1]
    if freedom < 1:
        raise CurveError(
            "points with the bearing free are too few to estimate their scatter; lift on"
        )
    spread = np.asarray(float(left @ left) / freedom * np.linalg.inv(design.T @ design))
    return np.asarray(value), spread


def _knee(at: Vector, load: Vector, way: Vector | None) -> tuple[float, float, float, float]:
    """Best intersection of two lines, load at zero lift, slope before and after."""
    low, high = (float(end) for end in np.sort(at)[[1, -2]])
    best = (math.inf, 0.0, 0.0, 0.0, 0.0)
    for knee in np.linspace(low, high, _KNEES):
        design = _design(at, way, np.maximum(at - knee, 0.0))
        value = np.linalg.lstsq(design, load, rcond=None)[0]
        left = float(np.sum((load - design @ value) ** 2))
        start, before, more = float(value[0]), float(value[1]), float(value[-1])
        best = min(best, (left, float(knee), start, before, before + more))
    return best[1:]
