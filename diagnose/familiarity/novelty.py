"""Does a recording look like anything the model was trained on? A calibrated answer.

The distance is measured in the space of :mod:`wearstate.diagnose.feature_rows.physical`, where
speed, load and the casing's resonances hardly count: another machine of the kind is near, another
kind is far. It is the mean of a distance for each way of looking at a recording, so that a machine
with one odd trait is nearer than one that is moderately odd in all of them.
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
"""Another machine of the kind has its resonances within this factor of the known ones."""

NEVER_DB = 1e4
"""No signal is so far below another."""

_RARE = 0.99  # of familiar recordings
_FEW = 0.03  # of the features: so many outside the trained range are not strange by themselves

_LEAST_SPREAD = 1e-6  # of the largest: a feature that never moves says nothing
_CLIP = 10.0  # standard deviations: one wild feature must not stand for a strange recording
_PROFILE = "profile"
_ODD_PROFILE, _LESS_ODD = 1.2, 0.45
"""Distance of a profile from which on other marks of the turn are tried, and how much nearer one
must bring it. Of 340 unseen pumps a tenth lie as far, and another mark brings one of them nearer by
0.33 at most; with a mark 20 degrees or more beside the dead centre it does by 0.5 to 3.3."""

_FREE = ("profile", "orders", "spiky", "orbit", "other")  # kinds that know of no hertz


@dataclass(frozen=True, kw_only=True)
class Familiarity:
    """The cloud of the training recordings in physical space.

    Attributes
    ----------
    centre, spread : numpy.ndarray [shape=(n_physical,)]
        Mean and standard deviation of each coordinate.
    whiten : numpy.ndarray [shape=(n_physical, n_physical)]
        Turns the standardised coordinates of each kind into independent ones of variance one over
        their number; kinds stay apart.
    machines : numpy.ndarray [shape=(n_machines, n_physical)]
        Mean of each machine draw in these.
    groups : numpy.ndarray [shape=(n_machines,)]
        Numbers of these draws.
    low, high : numpy.ndarray [shape=(n_features,)]
        Least and largest value of each feature in training.
    weight : float
        Distance that stands for all features outside that range: a machine may be near in all
        coordinates and still show cells of its map that no training machine ever did.
    seldom_outside : float
        Share of the features outside that range that few familiar recordings exceed.
    usual_peak, peak_slope : numpy.ndarray [shape=(n_channels,)]
        Of :class:`~.quietness.UsualPeaks`.
    most_lacking : float
        How far familiar peaks may be below the usual ones [dB]; :data:`NEVER_DB` where that was
        not asked.
        A machine that does not knock is near in shape, and still none of the trained ones.
    seldom_lacking : float
        How far few familiar peaks are below the usual ones [dB].
    floor_ceiling : numpy.ndarray [shape=(n_channels * n_bands,)]
        Of :func:`~.noise_floor.fit_ceiling` [dB].
    most_noise : float
        How far the noise floor of few familiar recordings is above that ceiling [dB].
    least_noise : numpy.ndarray [shape=(n_levels,)]
        Of :func:`~.noise_floor.fit_least` [dB].
    top_offset, top_slope, most_top_lacking : numpy.ndarray [shape=(n_channels,)]
        Of :class:`~.bandwidth.UsualTops`.
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
        """What the highest band of a channel is to be."""
        return UsualTops(self.top_offset, self.top_slope, self.most_top_lacking)

    def lacking(self, names: Sequence[str], rows: Float) -> Float:
        """How far peaks are below the usual ones [dB, shape=(n_recordings,)]."""
        return shortfall(names, rows, UsualPeaks(self.usual_peak, self.peak_slope))

    def noise(self, names: Sequence[str], rows: Float) -> Float:
        """How far noise floors are above the loudest usual ones [dB, shape=(n_recordings,)]."""
        return loudest_floor(names, rows, self.floor_ceiling)

    def outside(self, rows: Float) -> Float:
        """Share of the features outside what was trained on [shape=(n_recordings,)]."""
        return np.asarray(((rows < self.low) | (rows > self.high)).mean(axis=1))

    def farthest_outside(self, row: Float) -> NDArray[np.intp]:
        """Features of one recording outside the trained range, in spans of it the farthest first.

        Parameters
        ----------
        row : numpy.ndarray [shape=(n_features,)]

        Returns
        -------
        numpy.ndarray of int
            Their places.
        """
        beyond = np.maximum(self.low - row, row - self.high)
        least = _LEAST_SPREAD * np.maximum(np.abs(self.high), 1.0)  # of one that never moves
        span = np.maximum(self.high - self.low, least)
        order = np.argsort(-beyond / span, kind="stable")
        return order[beyond[order] > 0]

    def distance(self, names: Sequence[str], rows: Float) -> Float:
        """Distance of recordings from the cloud: about 1 for a training recording.

        Parameters
        ----------
        names : sequence of str
            Of the features.
        rows : numpy.ndarray [shape=(n_recordings, n_features)]

        Returns
        -------
        numpy.ndarray [shape=(n_recordings,)]
            Mean over the kinds of coordinates of the root mean square in each, every coordinate in
            the spread it has once the others of its kind are known (Mahalanobis); or the weighted
            share of features outside the trained range, where that is more.
        """
        near = self.by_kind(names, rows).mean(axis=1)
        return np.asarray(np.maximum(near, self.weight * self.outside(rows)))

    def by_kind(self, names: Sequence[str], rows: Float) -> Float:
        """Distance of recordings in each kind of coordinates, of :func:`kinds_of`.

        Returns
        -------
        numpy.ndarray [shape=(n_recordings, n_kinds)]
        """
        return _lengths(names, self._place(names, rows))

    def nearest(self, names: Sequence[str], row: Float) -> tuple[int, float]:
        """Machine draw nearest to a recording, and how far it is, as :meth:`distance`."""
        apart = _lengths(names, self.machines - self._place(names, row[None, :])).mean(axis=1)
        best = int(np.argmin(apart))
        return int(self.groups[best]), float(apart[best])

    def late_mark(self, names: Sequence[str], row: Float, limit: float) -> float | None:
        """By how much the mark of the turn comes late in a recording that is familiar but for that.

        Parameters
        ----------
        names : sequence of str
            Of the features.
        row : numpy.ndarray [shape=(n_features,)]
        limit : float
            Distance at which the familiar ends.

        Returns
        -------
        float or None
            [deg], from -180 on; None where the energy lies in the turn about where it does in
            training, or no other mark brings it there.
        """
        kinds = list(kinds_of(tuple(names)))
        if _PROFILE not in kinds or self._odd(names, row[None, :])[0] < _ODD_PROFILE:
            return None
        turned = turned_rows(names, row)
        odd = self._odd(names, turned)
        best = int(np.argmin(odd))
        near = odd[0] - odd[best] > _LESS_ODD and self.distance(names, turned[[best]])[0] < limit
        return math.remainder(360 * best / len(turned), 360) if near else None

    def _odd(self, names: Sequence[str], rows: Float) -> Float:
        """Distance of recordings by where their energy lies in the turn."""
        return self.by_kind(names, rows)[:, list(kinds_of(tuple(names))).index(_PROFILE)]

    def _place(self, names: Sequence[str], rows: Float) -> Float:
        values = physical_rows(names, rows)
        return _standardised(values, self.centre, self.spread) @ self.whiten


def free_distance(names: Sequence[str], by_kind: Float) -> float:
    """Distance of one recording by what hangs on no sample rate.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    by_kind : numpy.ndarray [shape=(n_kinds,)]
        Of :meth:`Familiarity.by_kind`.

    Returns
    -------
    float
        As :meth:`Familiarity.distance`, but for the bands, which are lost where a rate was too low;
        NaN where the model has nothing else.

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
    """One where a coordinate is of a kind [shape=(n_physical, n_kinds)]."""
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
    """Learn the cloud of training recordings.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n_recordings, n_features)]
        At least three recordings.
    groups : numpy.ndarray [shape=(n_recordings,)]
        Machine draw of each.
    weight : float
        Of the share of features outside the trained range; 0: it does not count.
    seldom_outside : float
        Share of the features outside the trained range that few familiar recordings exceed.
    most_lacking, seldom_lacking : float
        How far familiar peaks may be, and few are, below the usual ones [dB].
    most_noise : float
        How far noise floors of few familiar recordings are above the loudest usual ones [dB].

    Returns
    -------
    Familiarity
        The covariance of each kind of coordinates, shrunk as far as so few recordings ask for, and
        widened by what the spectra of the same machines would show with their resonances anywhere
        up to a fifth off.

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
    for here in kinds_of(tuple(names)).values():
        block = np.ix_(here, here)
        scale = np.outer(spread[here], spread[here])
        whiten[block] = _whitening(standard[:, here], tolerance[block] / scale)
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


def outside_weight(apart: Float, outside: Float) -> tuple[float, float]:
    """What features outside the trained range count beside the distance in the others.

    Parameters
    ----------
    apart, outside : numpy.ndarray [shape=(n_recordings,)]
        Distance, and share of the features outside, of familiar recordings whose machines had no
        part in the cloud.

    Returns
    -------
    weight : float
        Of the share: where one recording in a hundred has more outside, it makes so much as far as
        the hundredth is in distance. Three per cent of the features count no more than that: of
        more training records familiar ones have fewer outside, while other machines of the kind
        have as many as before, and are estimated no worse.
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
    far, seldom = (float(np.quantile(each, _RARE)) for each in (apart, outside))
    return far / max(seldom, _FEW), seldom


def _tolerance(names: Sequence[str], rows: Float, values: Float) -> Float:
    """Covariance of what moving the spectra does, each by a factor uniform within the reach."""
    moves = [
        physical_rows(names, moved_rows(names, rows, factor)) - values
        for factor in (1 / REACH, REACH)
    ]
    owner = coordinates_of(names).owner
    alone = owner[:, None] == owner  # every place has resonances of its own
    # of a uniform distribution the variance is a third of the square at its ends
    return np.asarray(alone * sum(move.T @ move for move in moves) / (3 * len(moves) * len(rows)))


def _whitening(standard: Float, tolerance: Float) -> Float:
    from sklearn.covariance import LedoitWolf

    shrunk = LedoitWolf(assume_centered=True).fit(standard).covariance_
    return np.linalg.cholesky(np.linalg.inv(shrunk + tolerance) / standard.shape[1])


def novelty_p_value(distance: float, calibration: Float) -> float:
    """Conformal p-value of "this recording comes from the training population".

    Parameters
    ----------
    distance : float
        Of the recording in question.
    calibration : numpy.ndarray [shape=(n,)]
        Distances of recordings that the cloud was not fitted on.

    Returns
    -------
    float
        ``(1 + #{calibration >= distance}) / (n + 1)``. For a recording exchangeable with the
        calibration it is at most alpha with probability alpha, whatever the distribution.

    Notes
    -----
    Here the calibration is out of fold: its clouds were fitted on four fifths of the machine
    draws, the recording's on all of them, which makes p slightly too large, so that a few less
    familiar recordings are refused than alpha says.

    Examples
    --------
    >>> novelty_p_value(5.0, np.arange(9.0))
    0.5
    """
    return float((1 + np.count_nonzero(calibration >= distance)) / (len(calibration) + 1))
