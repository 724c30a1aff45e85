"""Calibrated test of whether a recording resembles the training data.

The distance is measured in the coordinates of :mod:`wearstate.diagnose.feature_rows.physical`,
where speed, load and casing resonances matter little: another machine of the same kind is near,
another kind is far. It is the mean of the distances in each kind of coordinates, so that a machine
with one unusual property is nearer than one that is moderately unusual in all.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..feature_rows.physical import coordinates_of, moved_rows, physical_rows, turned_rows
from .bandwidth import UsualTops, fit_tops
from .noise_floor import fit_ceiling, fit_least, loudest_floor
from .quietness import UsualPeaks, fit_usual_peaks, shortfall

Float = NDArray[np.float64]

REACH = 1.2
"""Factor within which other machines of the kind have their resonances."""

NEVER_DB = 1e4
"""More than any level difference."""

_RARE = 0.99  # of familiar recordings
_FEW = 0.03  # share of features outside the trained range that is not suspicious

_LEAST_SPREAD = 1e-6  # of the largest: bounds the spread of a constant feature
_CLIP = 10.0  # standard deviations: limits the influence of a single feature
_PROFILE = "profile"
_ODD_PROFILE, _LESS_ODD = 1.2, 0.45
"""Distance of a profile from which other mark positions are tried, and the required reduction. Of
340 unseen pumps a tenth lie as far, and another mark reduces the distance by at most 0.33; if the
mark is 20 degrees or more off the dead centre, by 0.5 to 3.3."""

_FREE = ("profile", "orders", "spiky", "orbit", "other")  # kinds without absolute frequencies


@dataclass(frozen=True, kw_only=True)
class Familiarity:
    """Distribution of the training recordings in physical coordinates.

    Attributes
    ----------
    centre, spread : numpy.ndarray [shape=(n_physical,)]
        Mean and standard deviation of each coordinate.
    whiten : numpy.ndarray [shape=(n_physical, n_physical)]
        Transforms the standardised coordinates of each kind into uncorrelated ones with variance
        one over their number, separately for each kind.
    machines : numpy.ndarray [shape=(n_machines, n_physical)]
        Mean of each machine draw in the whitened coordinates.
    groups : numpy.ndarray [shape=(n_machines,)]
        Numbers of these draws.
    low, high : numpy.ndarray [shape=(n_features,)]
        Smallest and largest value of each feature in training.
    weight : float
        Distance assigned to all features outside that range: a machine may be near in all
        coordinates and yet have cells of its map that no training machine has.
    seldom_outside : float
        Share of the features outside that range that few familiar recordings exceed.
    usual_peak, peak_slope : numpy.ndarray [shape=(n_channels,)]
        As in :class:`~.quietness.UsualPeaks`.
    most_lacking : float
        Limit of the shortfall of peaks [dB]; :data:`NEVER_DB` if not applied. A machine that does
        not knock may be near in shape, and is still unlike the trained ones.
    seldom_lacking : float
        Shortfall of peaks that few familiar recordings exceed [dB].
    floor_ceiling : numpy.ndarray [shape=(n_channels * n_bands,)]
        From :func:`~.noise_floor.fit_ceiling` [dB].
    most_noise : float
        Excess of the noise floor over that ceiling that few familiar recordings exceed [dB].
    least_noise : numpy.ndarray [shape=(n_levels,)]
        From :func:`~.noise_floor.fit_least` [dB].
    top_offset, top_slope, most_top_lacking : numpy.ndarray [shape=(n_channels,)]
        As in :class:`~.bandwidth.UsualTops`.
    """

    centre: Float
    spread: Float
    whiten: Float
    machines: Float
    groups: NDArray[np.intp]
    low: Float
    high: Float
    weight: float
    seldom_outside: float
    usual_peak: Float
    peak_slope: Float
    most_lacking: float
    seldom_lacking: float
    floor_ceiling: Float
    most_noise: float
    least_noise: Float
    top_offset: Float
    top_slope: Float
    most_top_lacking: Float

    @property
    def tops(self) -> UsualTops:
        """Expected level of the highest band of each channel."""
        return UsualTops(self.top_offset, self.top_slope, self.most_top_lacking)

    def lacking(self, names: Sequence[str], rows: Float) -> Float:
        """Shortfall of peaks relative to the usual ones [dB, shape=(n_recordings,)]."""
        return shortfall(names, rows, UsualPeaks(self.usual_peak, self.peak_slope))

    def noise(self, names: Sequence[str], rows: Float) -> Float:
        """Excess of noise floors over the highest usual ones [dB, shape=(n_recordings,)]."""
        return loudest_floor(names, rows, self.floor_ceiling)

    def outside(self, rows: Float) -> Float:
        """Share of the features outside the trained range [shape=(n_recordings,)]."""
        return np.asarray(((rows < self.low) | (rows > self.high)).mean(axis=1))

    def farthest_outside(self, row: Float) -> NDArray[np.intp]:
        """Features of one recording outside the trained range, the farthest first in units of it.

        Parameters
        ----------
        row : numpy.ndarray [shape=(n_features,)]

        Returns
        -------
        numpy.ndarray of int
            Indices of the features.
        """
        beyond = np.maximum(self.low - row, row - self.high)
        least = _LEAST_SPREAD * np.maximum(np.abs(self.high), 1.0)  # for a constant feature
        span = np.maximum(self.high - self.low, least)
        order = np.argsort(-beyond / span, kind="stable")
        return order[beyond[order] > 0]

    def distance(self, names: Sequence[str], rows: Float) -> Float:
        """Distance of recordings from the training data: about 1 for a training recording.

        Parameters
        ----------
        names : sequence of str
            Names of the features.
        rows : numpy.ndarray [shape=(n_recordings, n_features)]

        Returns
        -------
        numpy.ndarray [shape=(n_recordings,)]
            Mean over the kinds of coordinates of the rms Mahalanobis distance in each; or the
            weighted share of features outside the trained range, if larger.
        """
        near = self.by_kind(names, rows).mean(axis=1)
        return np.asarray(np.maximum(near, self.weight * self.outside(rows)))

    def by_kind(self, names: Sequence[str], rows: Float) -> Float:
        """Distance of recordings in each kind of coordinates, in the order of :func:`kinds_of`.

        Returns
        -------
        numpy.ndarray [shape=(n_recordings, n_kinds)]
        """
        return _lengths(names, self._place(names, rows))

    def nearest(self, names: Sequence[str], row: Float) -> tuple[int, float]:
        """Machine draw nearest to a recording, and its distance as in :meth:`distance`."""
        distances = _lengths(names, self.machines - self._place(names, row[None, :])).mean(axis=1)
        best = int(np.argmin(distances))
        return int(self.groups[best]), float(distances[best])

    def late_mark(self, names: Sequence[str], row: Float, limit: float) -> float | None:
        """Delay of the once-per-turn mark in a recording that is otherwise familiar.

        Parameters
        ----------
        names : sequence of str
            Names of the features.
        row : numpy.ndarray [shape=(n_features,)]
        limit : float
            Distance beyond which a recording is unfamiliar.

        Returns
        -------
        float or None
            [deg], >= -180; None if the energy over the revolution is distributed as in training,
            or no other mark achieves this.
        """
        kinds = list(kinds_of(tuple(names)))
        if _PROFILE not in kinds or self._profile_distance(names, row[None, :])[0] < _ODD_PROFILE:
            return None
        turned = turned_rows(names, row)
        odd = self._profile_distance(names, turned)
        best = int(np.argmin(odd))
        near = odd[0] - odd[best] > _LESS_ODD and self.distance(names, turned[[best]])[0] < limit
        return math.remainder(360 * best / len(turned), 360) if near else None

    def _profile_distance(self, names: Sequence[str], rows: Float) -> Float:
        """Distance of recordings in the distribution of energy over the revolution."""
        return self.by_kind(names, rows)[:, list(kinds_of(tuple(names))).index(_PROFILE)]

    def _place(self, names: Sequence[str], rows: Float) -> Float:
        values = physical_rows(names, rows)
        return _standardised(values, self.centre, self.spread) @ self.whiten


def free_distance(names: Sequence[str], by_kind: Float) -> float:
    """Distance of one recording in coordinates that do not depend on the sample rate.

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    by_kind : numpy.ndarray [shape=(n_kinds,)]
        From :meth:`Familiarity.by_kind`.

    Returns
    -------
    float
        As :meth:`Familiarity.distance`, without the bands, which are missing if a rate was too low;
        NaN if the model has no other coordinates.

    Examples
    --------
    >>> free_distance(["a.order_01.level_db", "a.kurtosis"], np.array([1.0, 2.0]))
    1.5
    """
    free = [kind in _FREE for kind in kinds_of(tuple(names))]
    return float(by_kind[free].mean()) if any(free) else math.nan


@lru_cache(maxsize=16)
def kinds_of(names: tuple[str, ...]) -> dict[str, NDArray[np.intp]]:
    """Physical coordinates of each kind.

    Examples
    --------
    >>> list(kinds_of(("a.order_01.level_db", "a.kurtosis")))
    ['orders', 'spiky']
    """
    kinds = coordinates_of(names).kind
    return {str(kind): np.flatnonzero(kinds == kind) for kind in dict.fromkeys(kinds.tolist())}


@lru_cache(maxsize=16)
def _members(names: tuple[str, ...]) -> Float:
    """Indicator of the kind of each coordinate [shape=(n_physical, n_kinds)]."""
    kinds = coordinates_of(names).kind
    return np.asarray(kinds[:, None] == list(kinds_of(names)), dtype=np.float64)


def _lengths(names: Sequence[str], place: Float) -> Float:
    """Length of whitened coordinates in each kind [shape=(n, n_kinds)]."""
    return np.sqrt(place**2 @ _members(tuple(names)))


def _standardised(values: Float, centre: Float, spread: Float) -> Float:
    return np.asarray(np.clip((values - centre) / spread, -_CLIP, _CLIP))


def fit_familiarity(
    names: Sequence[str],
    rows: Float,
    groups: NDArray[np.intp],
    *,
    weight: float = 0.0,
    seldom_outside: float = 1.0,
    most_lacking: float = NEVER_DB,
    seldom_lacking: float = NEVER_DB,
    most_noise: float = NEVER_DB,
) -> Familiarity:
    """Fit the distribution of training recordings.

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    rows : numpy.ndarray [shape=(n_recordings, n_features)]
        At least three recordings.
    groups : numpy.ndarray [shape=(n_recordings,)]
        Machine draw of each recording.
    weight : float
        Weight of the share of features outside the trained range; 0: not used.
    seldom_outside : float
        Share of the features outside the trained range that few familiar recordings exceed.
    most_lacking, seldom_lacking : float
        Limit of the shortfall of peaks, and shortfall that few familiar recordings exceed [dB].
    most_noise : float
        Excess of noise floors over the highest usual ones that few familiar recordings exceed [dB].

    Returns
    -------
    Familiarity
        Covariance of each kind of coordinates, shrunk according to the number of recordings, and
        widened by the effect of shifting the resonances of the same machines by up to a fifth.

    References
    ----------
    O. Ledoit, M. Wolf, "A well-conditioned estimator for large-dimensional covariance matrices",
    J. Multivariate Anal. 88 (2004) 365-411, doi:10.1016/S0047-259X(03)00096-4.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> names, groups = ["a.skewness", "b.skewness"], np.arange(100)
    >>> cloud = fit_familiarity(names, rng.standard_normal((100, 2)), groups)
    >>> far, near = cloud.distance(names, np.array([[9.0, 9.0], [0.1, 0.2]]))
    >>> bool(far > 10 * near)
    True
    """
    values = physical_rows(names, rows)
    centre, tolerance = values.mean(axis=0), _tolerance(names, rows, values)
    spread = np.sqrt(values.var(axis=0) + np.diag(tolerance))
    spread = np.maximum(spread, _LEAST_SPREAD * max(float(spread.max()), 1.0))
    standard = _standardised(values, centre, spread)
    whiten = np.zeros_like(tolerance)
    for own in kinds_of(tuple(names)).values():
        block = np.ix_(own, own)
        scale = np.outer(spread[own], spread[own])
        whiten[block] = _whitening(standard[:, own], tolerance[block] / scale)
    machines, place = np.unique(groups, return_inverse=True)
    means = np.zeros((len(machines), standard.shape[1]))
    np.add.at(means, place, standard @ whiten)
    usual, tops = fit_usual_peaks(names, rows), fit_tops(names, rows)
    return Familiarity(
        centre=centre,
        spread=spread,
        whiten=whiten,
        machines=means / np.bincount(place)[:, None],
        groups=machines.astype(np.intp),
        low=rows.min(axis=0),
        high=rows.max(axis=0),
        weight=weight,
        seldom_outside=seldom_outside,
        usual_peak=usual.level,
        peak_slope=usual.slope,
        most_lacking=most_lacking,
        seldom_lacking=seldom_lacking,
        floor_ceiling=fit_ceiling(names, rows),
        most_noise=most_noise,
        least_noise=fit_least(names, rows),
        top_offset=tops.offset,
        top_slope=tops.slope,
        most_top_lacking=tops.most,
    )


def outside_weight(distance: Float, outside: Float) -> tuple[float, float]:
    """Weight of features outside the trained range, relative to the distance in the others.

    Parameters
    ----------
    distance, outside : numpy.ndarray [shape=(n_recordings,)]
        Distance, and share of the features outside, of familiar recordings whose machines were not
        used in the fit.

    Returns
    -------
    weight : float
        Ratio of the 99th percentiles of distance and share, with a share of at least three per
        cent: with more training records, familiar ones have fewer features outside, while other
        machines of the kind have as many as before and are estimated as well.
    seldom : float
        Share that one familiar recording in a hundred exceeds.

    Examples
    --------
    >>> apart = np.linspace(0.0, 2.0, 101)
    >>> for share in (0.06, 0.01):
    ...     print([round(each, 3) for each in outside_weight(apart, share * apart / 1.98)])
    [33.0, 0.06]
    [66.0, 0.01]
    """
    far, seldom = (float(np.quantile(each, _RARE)) for each in (distance, outside))
    return far / max(seldom, _FEW), seldom


def _tolerance(names: Sequence[str], rows: Float, values: Float) -> Float:
    """Covariance of the effect of shifting spectra by a factor that is uniform within REACH."""
    moves = [
        physical_rows(names, moved_rows(names, rows, factor)) - values
        for factor in (1 / REACH, REACH)
    ]
    owner = coordinates_of(names).owner
    same_owner = owner[:, None] == owner  # every position has resonances of its own
    # the variance of a uniform distribution is a third of the square at its ends
    total = sum(move.T @ move for move in moves)
    return np.asarray(same_owner * total / (3 * len(moves) * len(rows)))


def _whitening(standard: Float, tolerance: Float) -> Float:
    from sklearn.covariance import LedoitWolf

    shrunk = LedoitWolf(assume_centered=True).fit(standard).covariance_
    return np.linalg.cholesky(np.linalg.inv(shrunk + tolerance) / standard.shape[1])


def novelty_p_value(distance: float, calibration: Float) -> float:
    """Conformal p-value of "this recording comes from the training population".

    Parameters
    ----------
    distance : float
        Distance of the recording to be tested.
    calibration : numpy.ndarray [shape=(n,)]
        Distances of recordings not used in the fit.

    Returns
    -------
    float
        ``(1 + #{calibration >= distance}) / (n + 1)``. For a recording exchangeable with the
        calibration it is at most alpha with probability alpha, whatever the distribution.

    Notes
    -----
    The calibration is out of fold: it uses fits to four fifths of the machine draws, the recording
    a fit to all of them. This makes p slightly too large, so that slightly fewer familiar
    recordings are refused than alpha.

    Examples
    --------
    >>> novelty_p_value(5.0, np.arange(9.0))
    0.5
    """
    return float((1 + np.count_nonzero(calibration >= distance)) / (len(calibration) + 1))
