"""Smallest change that stands out of the scatter between recordings."""

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

_ROUNDING = 1e-9  # of the values: no scatter is smaller


@dataclass(frozen=True, kw_only=True)
class Detection:
    """How a quantity answers to one number of the scene.

    Attributes
    ----------
    change : float
        Smallest change from the first value that is told [unit of x]; infinite where the whole
        axis is not enough, NaN where scatter is not known.
    threshold : float
        Difference of the quantity that is told [unit of y]; NaN where scatter is not known.
    scatter : float
        Standard deviation between recordings at one value, pooled [unit of y].
    freedom : int
        Degrees of freedom of that.
    slope, slope_error : float
        Of the straight line by least squares through all recordings [unit of y / unit of x], and
        its standard error.
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
    def told(self) -> bool:
        """Whether a change within the axis is told."""
        return math.isfinite(self.change)


def detect(x: Sequence[float], samples: Sequence[ArrayLike], confidence: float = 0.95) -> Detection:
    """Smallest change of `x` that one recording tells against those at the first value.

    Parameters
    ----------
    x : sequence of float, length n
        Values of an axis, rising or falling.
    samples : sequence of array_like, length n
        Values of the quantity in the recordings at each; a value without any is left out.
    confidence : float
        A share of ``1 - confidence`` of unchanged machines is wrongly called changed (two-sided),
        and `confidence` of those with the change are found, 0.5 to 1.

    Returns
    -------
    Detection

    Notes
    -----
    A recording stands out where it differs from the mean of the n recordings at the first value by
    more than ``t(1 - a/2) s sqrt(1 + 1/n)``, with `s` pooled over the axis and Student's t of its
    degrees of freedom; a change is found with probability ``1 - a`` where the mean differs by
    ``t(1 - a) s sqrt(1 + 1/n)`` more. Means are interpolated by monotone cubics (Fritsch, Carlson),
    and the change counts from which on every larger one stands out in the same direction. Scatter
    is taken as normal and the same along the axis. The noncentral distribution is approximated by
    the shifted one, which is good from some six degrees of freedom.

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
    """Slope and its standard error; the latter NaN of two values."""
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
    """Where differences pass a threshold for good: infinite where they do not."""
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
