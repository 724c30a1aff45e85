"""Shortfall of a recording's peaks relative to those of the trained machines at its speed."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

REFUSED_SHARE, CAUTIONED_SHARE = 0.005, 0.02
"""Share of familiar recordings that may be refused as too quiet, half of it due to their distance,
and share that may get a caution."""

_PEAK, _SPEED = ".peak", "shaft.speed_hz"
_SILENCE = 1e-30  # of a channel without any signal
_LEAST_SPAN = 0.01  # of the logarithm of the speed: smaller spans count as constant speed


class UsualPeaks(NamedTuple):
    """Usual peak of each channel as a line over the logarithm of the speed.

    Attributes
    ----------
    level : numpy.ndarray [shape=(n_channels,)]
        Level at 1 Hz, or at any speed if the slope is 0 [dB re 1 x].
    slope : numpy.ndarray [shape=(n_channels,)]
        Increase when the speed grows by a factor e [dB].
    """

    level: Float
    slope: Float


def peak_channels(names: Sequence[str]) -> tuple[str, ...]:
    """Channels whose peak is among the features.

    Examples
    --------
    >>> peak_channels(["a.rms", "a.peak", "b.kurtosis"])
    ('a',)
    """
    return tuple(name.removesuffix(_PEAK) for name in names if name.endswith(_PEAK))


def fit_usual_peaks(names: Sequence[str], rows: Float) -> UsualPeaks:
    """Fit the median of the peaks as a function of the speed.

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    rows : numpy.ndarray [shape=(n, n_features)]

    Returns
    -------
    UsualPeaks
        Least absolute deviations, robust against a few outliers.

    References
    ----------
    R. Koenker, G. Bassett, "Regression quantiles", Econometrica 46 (1978) 33-50,
    doi:10.2307/1913643.

    Examples
    --------
    >>> speed = np.array([1.0, 2.0, 4.0, 8.0])
    >>> found = fit_usual_peaks(["a.peak", "shaft.speed_hz"], np.stack([speed**2, speed], axis=1))
    >>> (found.level + found.slope * np.log(4.0)).round(6)  # 20 log10(16)
    array([24.0824])
    """
    from sklearn.linear_model import QuantileRegressor

    peaks, speed = _peaks(names, rows), _log_speed(names, rows)
    if np.ptp(speed) < _LEAST_SPAN:
        return UsualPeaks(np.median(peaks, axis=0), np.zeros(peaks.shape[1]))
    level, slope = np.zeros((2, peaks.shape[1]))
    for i, column in enumerate(peaks.T):
        line = QuantileRegressor(quantile=0.5, alpha=0.0).fit(speed[:, None], column)
        level[i], slope[i] = line.intercept_, line.coef_[0]
    return UsualPeaks(level, slope)


def shortfall(names: Sequence[str], rows: Float, usual: UsualPeaks) -> Float:
    """Shortfall of the quietest channel relative to its usual peak, >= 0 [dB, shape=(n,)].

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
    usual : UsualPeaks

    Examples
    --------
    >>> usual = UsualPeaks(np.array([20.0]), np.array([0.0]))
    >>> shortfall(["a.peak"], np.array([[1.0], [100.0]]), usual).tolist()
    [20.0, 0.0]
    """
    speed = _log_speed(names, rows)
    below = usual.level + np.outer(speed, usual.slope) - _peaks(names, rows)
    return np.asarray(below.max(axis=1, initial=0.0))


def most_lacking(lacking: Float, share: float) -> float:
    """Limit of the shortfall of peaks of familiar machines [dB].

    Parameters
    ----------
    lacking : numpy.ndarray [shape=(n,)]
        Shortfall of machines not used in the fit [dB].
    share : float
        Share of familiar machines that may exceed the limit.

    Returns
    -------
    float
        The largest shortfall if there are too few machines for such a small share.

    Examples
    --------
    >>> most_lacking(np.arange(1000.0), 0.005), most_lacking(np.arange(50.0), 0.005)
    (995.0, 49.0)
    """
    rank = max(math.floor(share * (len(lacking) + 1)), 1)
    return float(np.sort(lacking)[-rank])


def _peaks(names: Sequence[str], rows: Float) -> Float:
    """Peak levels [dB re 1 x, shape=(n, n_channels)]."""
    columns = [i for i, name in enumerate(names) if name.endswith(_PEAK)]
    return np.asarray(20 * np.log10(np.maximum(rows[:, columns], _SILENCE)))


def _log_speed(names: Sequence[str], rows: Float) -> Float:
    """Logarithm of the speed of every row; 0 without a speed."""
    if _SPEED not in names:
        return np.zeros(len(rows))
    return np.asarray(np.log(np.maximum(rows[:, list(names).index(_SPEED)], _SILENCE)))
