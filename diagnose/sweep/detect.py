"""Smallest change that is detectable in the scatter between recordings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.special import stdtrit

Float = NDArray[np.float64]

_ROUNDING = 1e-9  # of the values: lower bound of the threshold


@dataclass(frozen=True, kw_only=True)
class Detection:
    """Response of a quantity to one number of the scene.

    Attributes
    ----------
    change : float
        Smallest detectable change from the first value [unit of x]; infinite if beyond the axis,
        NaN if the scatter is unknown.
    threshold : float
        Detectable difference of the quantity [unit of y]; NaN if the scatter is unknown.
    scatter : float
        Standard deviation between recordings at one value, pooled [unit of y].
    freedom : int
        Degrees of freedom of the scatter.
    slope, slope_error : float
        Least-squares slope through all recordings [unit of y / unit of x], and its standard error.
    rises : bool
        Whether the quantity is larger at the last value than at the first.
    """

    change: float
    threshold: float
    scatter: float
    freedom: int
    slope: float
    slope_error: float
    rises: bool

    @property
    def detected(self) -> bool:
        """Whether a change within the axis is detectable."""
        return math.isfinite(self.change)


def detect(x: Sequence[float], samples: Sequence[ArrayLike], confidence: float = 0.95) -> Detection:
    """Smallest change of `x` that one recording reveals, compared with those at the first value.

    Parameters
    ----------
    x : sequence of float, length n
        Values of an axis, rising or falling.
    samples : sequence of array_like, length n
        Values of the quantity in the recordings at each value; empty ones are left out.
    confidence : float
        Share of changed machines that is detected, 0.5 to 1; ``1 - confidence`` is the share of
        false alarms (two-sided).

    Returns
    -------
    Detection

    Notes
    -----
    A change is detected if a recording differs from the mean of the n recordings at the first value
    by more than ``t(1 - a/2) s sqrt(1 + 1/n)``, with `s` pooled over the axis and Student's t for
    its degrees of freedom. This happens with probability ``1 - a`` if the mean differs by
    ``t(1 - a) s sqrt(1 + 1/n)`` more. Means are interpolated by monotone cubics (Fritsch, Carlson);
    the result is the change from which all larger ones are detectable in the same direction.
    Scatter is assumed normal and constant along the axis. The noncentral distribution is
    approximated by the shifted one, accurate from about six degrees of freedom.

    References
    ----------
    Currie, Anal. Chem. 40 (1968) 586-593, doi:10.1021/ac60259a007. Fritsch, Carlson, SIAM J. Numer.
    Anal. 17 (1980) 238-246, doi:10.1137/0717021.

    Examples
    --------
    >>> found = detect([0.0, 1.0, 2.0], [[-1, 0, 1], [9, 10, 11], [19, 20, 21]])
    >>> round(found.scatter, 3), found.freedom, round(found.threshold, 3), round(found.change, 3)
    (1.0, 6, 5.069, 0.507)
    """
    rows = [np.asarray(row, dtype=np.float64) for row in samples]
    kept = [i for i, row in enumerate(rows) if row.size]
    lost = Detection(
        change=math.nan,
        threshold=math.nan,
        scatter=math.nan,
        freedom=0,
        slope=math.nan,
        slope_error=math.nan,
        rises=False,
    )
    if not rows[0].size or len(kept) < 2:
        return lost
    away = np.abs(np.array([x[i] - x[0] for i in kept]))
    means = np.array([rows[i].mean() for i in kept])
    scatter, freedom = _pooled([rows[i] for i in kept])
    slope, slope_error = _line(np.array([x[i] for i in kept]), [rows[i] for i in kept])
    threshold = math.nan
    if freedom:
        sides = stdtrit(freedom, (1 + confidence) / 2) + stdtrit(freedom, confidence)
        threshold = float(sides) * scatter * math.sqrt(1 + 1 / rows[0].size)
        threshold = max(threshold, _ROUNDING * float(np.abs(means).max()))
    return Detection(
        change=_crossing(away, means - means[0], threshold),
        threshold=threshold,
        scatter=scatter,
        freedom=freedom,
        slope=slope,
        slope_error=slope_error,
        rises=bool(means[-1] > means[0]),
    )


def _pooled(rows: Sequence[Float]) -> tuple[float, int]:
    freedom = sum(row.size - 1 for row in rows)
    if freedom < 1:
        return math.nan, 0
    squares = sum(float(np.square(row - row.mean()).sum()) for row in rows)
    return math.sqrt(squares / freedom), freedom


def _line(x: Float, rows: Sequence[Float]) -> tuple[float, float]:
    """Slope and its standard error, which is NaN for two values."""
    places = np.repeat(x, [row.size for row in rows])
    values = np.concatenate(rows)
    about = places - places.mean()
    spread = float(np.square(about).sum())
    slope = float(about @ values) / spread
    if values.size < 3:
        return slope, math.nan
    left = values - values.mean() - slope * about
    return slope, math.sqrt(float(left @ left) / (values.size - 2) / spread)


def _crossing(away: Float, differences: Float, threshold: float) -> float:
    """Change from which differences stay above a threshold; infinite if they do not."""
    if not math.isfinite(threshold):
        return math.nan
    size = np.sign(differences[-1]) * differences  # grows towards the far end
    below = np.flatnonzero(size <= threshold)
    last = int(below[-1])  # the first value is always below
    if last == len(away) - 1:
        return math.inf
    curve: Any = PchipInterpolator(away, size) if len(away) > 2 else None
    if curve is None:
        return float(away[0] + threshold / size[1] * (away[1] - away[0]))
    return float(brentq(lambda h: float(curve(h)) - threshold, away[last], away[last + 1]))
