"""Intervals and sets with a guarantee, calibrated on machines that had no part in the fit.

What is asked for: the next record of a machine not seen before. Machines are exchangeable, their
records are not: each machine therefore has the same weight, shared by its records, and the machine
in question has one more.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .grades import grades_of

Float = NDArray[np.float64]

COVERAGE = 0.9
"""Nominal coverage of interval and set."""

_LEAST_APART = 1e-2  # disagreement below which parts agree
_LEAST_SCALE = 1e-6  # relative error below which errors are not distinguished
_OUTER = 0.1  # share of the records at either end of a value
_FEWEST_MACHINES = 20  # of a part: of fewer, one more or less decides
_PENALTY = 1.0  # of the scale's slopes, for standardised inputs: a few records decide nothing


# --- how large an error is to be expected


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Size of the relative error to expect of an estimate.

    Attributes
    ----------
    centre, spread, weight : numpy.ndarray [shape=(n_inputs,)]
        ``log scale = offset + sum(weight * (input - centre) / spread)`` of the inputs of
        :func:`scale_inputs`.
    offset : float
    limit : float
        Inputs are kept within this many spreads: beyond, nothing was learnt.
    """

    centre: Float
    spread: Float
    weight: Float
    offset: float
    limit: float = 3.0

    def predict(self, inputs: Float) -> Float:
        """Scale [-, shape=(n,)] of inputs [shape=(n, n_inputs)] as of :func:`scale_inputs`."""
        standard = np.clip((inputs - self.centre) / self.spread, -self.limit, self.limit)
        return np.asarray(np.exp(standard @ self.weight + self.offset))


def scale_inputs(
    estimate: ArrayLike,
    distance: ArrayLike,
    disagreement: ArrayLike,
    shares: Float | None = None,
) -> Float:
    """Inputs from which the expected size of an error is predicted.

    Parameters
    ----------
    estimate : array_like [shape=(n,)]
        Estimate of the severity [m], > 0.
    distance : array_like [shape=(n,)]
        From the cloud of familiar recordings [-].
    disagreement : array_like [shape=(n,)]
        Disagreement of the parts of the blend, as a logarithm.
    shares : numpy.ndarray [shape=(n, n_regimes)], optional
        Probability of each regime: in some of them wear shows less. No regimes by default.

    Returns
    -------
    numpy.ndarray [shape=(n, 4 + n_regimes)]
        Log estimate and its square, log distance, log disagreement, shares.

    Examples
    --------
    >>> scale_inputs([1.0], [1.0], [1.0], np.array([[0.5]])).tolist()
    [[0.0, 0.0, 0.0, 0.0, 0.5]]
    """
    log = np.log(np.asarray(estimate, dtype=float))
    far = np.log(np.maximum(np.asarray(distance, dtype=float), _LEAST_SCALE))
    apart = np.log(np.maximum(np.asarray(disagreement, dtype=float), _LEAST_APART))
    return np.column_stack([log, log**2, far, apart, *([] if shares is None else [shares])])


def fit_scale(inputs: Float, log_error: Float) -> Scale:
    """Learn how the size of the error depends on the estimate and on how familiar it is.

    Parameters
    ----------
    inputs : numpy.ndarray [shape=(n, n_inputs)]
        Result of :func:`scale_inputs`.
    log_error : numpy.ndarray [shape=(n,)]
        Log truth minus log estimate, of records that the model had no part in.

    Returns
    -------
    Scale

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> inputs = rng.standard_normal((4000, 1))
    >>> scale = fit_scale(inputs, np.exp(inputs[:, 0]) * rng.standard_normal(4000))
    >>> small, large = scale.predict(np.array([[0.0], [1.0]]))
    >>> round(float(np.log(large / small)), 1)
    1.0
    """
    from sklearn.linear_model import Ridge

    centre, spread = inputs.mean(axis=0), inputs.std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    size = np.log(np.maximum(np.abs(log_error), _LEAST_SCALE))
    ridge = Ridge(_PENALTY).fit((inputs - centre) / spread, size)
    return Scale(
        centre=centre,
        spread=spread,
        weight=np.asarray(ridge.coef_, dtype=float),
        offset=float(ridge.intercept_),
    )


# --- the calibration


@dataclass(frozen=True, kw_only=True)
class IntervalCalibration:
    """Behaviour of a model on machine draws that it had not seen.

    Attributes
    ----------
    estimate, truth : numpy.ndarray [shape=(n,)]
        Severities [m].
    scale : numpy.ndarray [shape=(n,)]
        Expected size of the relative error.
    distance : numpy.ndarray [shape=(n,)]
        Novelty distances.
    group : numpy.ndarray [shape=(n,)]
        Machine draw of each record.
    widened : float
        Factor on the intervals with which they also hold on parts of the machines, as of
        :func:`widening`.
    """

    estimate: Float
    truth: Float
    scale: Float
    distance: Float
    group: NDArray[np.intp]
    widened: float = 1.0

    @cached_property
    def scores(self) -> Float:
        """Relative errors in units of their expected size: log(truth / estimate) / scale."""
        return np.asarray(np.log(self.truth / self.estimate) / self.scale)

    @cached_property
    def weights(self) -> Float:
        """Weight of each record, of sum ``n_machines / (n_machines + 1)``."""
        return record_weights(self.group)


def record_weights(group: NDArray[np.intp]) -> Float:
    """Weights of records such that each machine and one unseen machine have the same share.

    Parameters
    ----------
    group : numpy.ndarray [shape=(n,)]
        Machine of each record.

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Sum ``n_machines / (n_machines + 1)``.

    References
    ----------
    Y. Lee, R. F. Barber, R. Willett, "Distribution-free inference with hierarchical data",
    arXiv:2306.06342 (2023).

    Examples
    --------
    >>> record_weights(np.array([7, 7, 9])).round(3).tolist()
    [0.167, 0.167, 0.333]
    """
    _, place, count = np.unique(group, return_inverse=True, return_counts=True)
    return np.asarray(1 / ((len(count) + 1) * count[place]))


def weighted_quantile(values: Float, weights: Float, level: float) -> float:
    """Least value below or on which a share `level` of the weight lies.

    Parameters
    ----------
    values, weights : numpy.ndarray [shape=(n,)]
        The weights may add up to less than 1: the rest lies at infinity.
    level : float
        0 to 1.

    Returns
    -------
    float
        Infinite where the weight does not reach the level.

    Examples
    --------
    >>> weighted_quantile(np.array([3.0, 1.0, 2.0]), np.full(3, 0.25), 0.75)
    3.0
    >>> weighted_quantile(np.array([3.0, 1.0, 2.0]), np.full(3, 0.25), 0.9)
    inf
    """
    order = np.argsort(values, kind="stable")
    place = int(np.searchsorted(np.cumsum(weights[order]), level - 1e-12))
    return float(values[order[place]]) if place < len(values) else float("inf")


@dataclass(frozen=True, kw_only=True)
class Tails:
    """How far truths lie below and above their estimates, in expected sizes of the error.

    Attributes
    ----------
    low, high : float
        ``estimate * exp(-scale * low)`` and ``estimate * exp(scale * high)`` bracket the truth.
    coverage : float
        With this probability.
    """

    low: float
    high: float
    coverage: float


def tails(calibration: IntervalCalibration, coverage: float = COVERAGE) -> Tails:
    """Tails of the errors of unseen machines.

    Parameters
    ----------
    calibration : Calibration
    coverage : float
        Asked for.

    Returns
    -------
    Tails
        With the coverage asked for, or the ``(m - 1) / (m + 1)`` between the extremes of m
        machines where they are too few for it.

    Notes
    -----
    Each tail is missed with half of what is allowed, before both are widened. Finite-sample for
    scores exchangeable with the calibration's; as those are of models fitted on four fifths of
    the machines, the interval is slightly wide.

    Examples
    --------
    >>> one = np.ones(39)
    >>> known = IntervalCalibration(estimate=one, truth=np.exp(np.linspace(-1.9, 1.9, 39)),
    ...     scale=one, distance=one, group=np.arange(39))
    >>> found = tails(known)
    >>> round(found.low, 1), round(found.high, 1), found.coverage
    (1.8, 1.8, 0.9)
    """
    scores, weights = calibration.scores, calibration.weights
    machines = len(np.unique(calibration.group))
    reached = min(coverage, (machines - 1) / (machines + 1))
    level = (1 + reached) / 2
    wide = calibration.widened
    return Tails(
        low=wide * min(weighted_quantile(-scores, weights, level), float(-scores.min())),
        high=wide * min(weighted_quantile(scores, weights, level), float(scores.max())),
        coverage=reached,
    )


def outer_tenths(values: Float) -> tuple[NDArray[np.bool_], ...]:
    """Records with the least and the largest tenth of each value.

    Parameters
    ----------
    values : numpy.ndarray [shape=(n, n_values)]
        NaN where unknown.

    Returns
    -------
    tuple of numpy.ndarray [shape=(n,)]
        The least of each value, then the largest of each.

    Examples
    --------
    >>> low, high = outer_tenths(np.arange(21.0)[:, None])
    >>> np.flatnonzero(low).tolist(), np.flatnonzero(high).tolist()
    ([0, 1, 2], [18, 19, 20])
    """
    low, high = np.nanquantile(values, [_OUTER, 1 - _OUTER], axis=0)
    return (*(values <= low).T, *(values >= high).T)


def widening(calibration: IntervalCalibration, parts: Sequence[NDArray[np.bool_]]) -> float:
    """How much wider intervals must be to hold on every part of the machines as on all.

    An interval that holds on nine machines of ten may fail on most of those at the edge of what
    is known, and the machine in question may be one of these, or beyond.

    Parameters
    ----------
    calibration : IntervalCalibration
    parts : sequence of numpy.ndarray [shape=(n,)]
        Records of each part, from :func:`outer_tenths`. Parts of fewer than 20 machines say
        nothing.

    Returns
    -------
    float
        At least 1. A part may fall short by one standard error of its share; as the weakest part
        counts, chance alone gives 1.02 for 6,000 machines and ten parts, 1.09 for 900.

    References
    ----------
    I. Gibbs, J. J. Cherian, E. J. Candès, "Conformal prediction with conditional guarantees",
    arXiv:2305.12616 (2023): coverage on groups that overlap; here by one factor for all.

    Examples
    --------
    >>> one = np.ones(200)
    >>> errors = np.linspace(-1, 1, 200) * np.where(np.arange(200) % 2, 1.0, 2.0)
    >>> known = IntervalCalibration(estimate=one, truth=np.exp(errors), scale=one, distance=one,
    ...     group=np.arange(200))
    >>> round(widening(known, [np.arange(200) % 2 == 0]), 2)
    1.07
    """
    known, scores = tails(calibration), calibration.scores
    low, high = (max(end, _LEAST_SCALE) for end in (known.low, known.high))
    needed = np.maximum(-scores / low, scores / high)
    factors = [1.0]
    for part in parts:
        machines = len(np.unique(calibration.group[part]))
        if machines >= _FEWEST_MACHINES:
            chance = math.sqrt(COVERAGE * (1 - COVERAGE) / machines)
            weights = record_weights(calibration.group[part])
            factors.append(weighted_quantile(needed[part], weights, COVERAGE - chance))
    return max(factors)


def interval(estimate: float, scale: float, known: Tails) -> tuple[float, float]:
    """Interval of the severity.

    Parameters
    ----------
    estimate : float
        [m]
    scale : float
        Expected size of its relative error.
    known : Tails

    Returns
    -------
    low, high : float
        [m]

    Examples
    --------
    >>> low, high = interval(1.0, 0.1, Tails(low=1.0, high=2.0, coverage=0.9))
    >>> round(low, 3), round(high, 3)
    (0.905, 1.221)
    """
    return estimate * math.exp(-scale * known.low), estimate * math.exp(scale * known.high)


def grade_probabilities(
    estimate: float, scale: float, calibration: IntervalCalibration, edges: ArrayLike
) -> Float:
    """Probability of each grade, from the errors of the calibration round the estimate.

    Parameters
    ----------
    estimate, scale
        As of :func:`interval`.
    calibration : Calibration
    edges : array_like
        Where grades 1, 2, … begin [m].

    Returns
    -------
    numpy.ndarray [shape=(n_grades,)]
        Sum 1.

    Examples
    --------
    >>> one = np.ones(4)
    >>> known = IntervalCalibration(estimate=one, truth=np.exp([-2, -1, 1, 2]), scale=one,
    ...     distance=one, group=np.arange(4))
    >>> grade_probabilities(1.0, 1.0, known, [2.0]).round(2).tolist()
    [0.5, 0.5]
    """
    possible = estimate * np.exp(scale * calibration.scores)
    n_grades = len(np.atleast_1d(np.asarray(edges))) + 1
    weights = calibration.weights
    share = np.bincount(grades_of(possible, _edges(edges)), weights=weights, minlength=n_grades)
    return np.asarray(share / share.sum())


def grade_limits(
    calibration: IntervalCalibration, edges: ArrayLike, coverage: float = COVERAGE
) -> Float:
    """How far outside its true grade an estimate may lie, each grade by its own machines.

    Parameters
    ----------
    calibration : Calibration
    edges : array_like
        Where grades 1, 2, … begin [m].
    coverage : float
        Coverage of every grade by itself.

    Returns
    -------
    numpy.ndarray [shape=(n_grades,)]
        In expected sizes of the error; infinite for a grade of too few machines to exclude it.

    Notes
    -----
    The score of a grade is how far the estimate lies outside its range: 0 inside. Mondrian
    conformal sets: every grade is judged by the calibration's machines of that very grade.

    References
    ----------
    V. Vovk, A. Gammerman, G. Shafer, Algorithmic Learning in a Random World, 2nd ed. (2022),
    section 4.6, doi:10.1007/978-3-031-06649-8.
    """
    bounds = _edges(edges)
    true = grades_of(calibration.truth, bounds)
    apart = _outside(calibration.estimate, calibration.scale, bounds)[np.arange(len(true)), true]
    parts = [true == grade for grade in range(len(bounds) + 1)]
    return np.array(
        [
            weighted_quantile(apart[part], record_weights(calibration.group[part]), coverage)
            for part in parts
        ]
    )


def grade_set(estimate: float, scale: float, limits: Float, edges: ArrayLike) -> tuple[int, ...]:
    """Grades that cannot be excluded.

    Parameters
    ----------
    estimate, scale
        As of :func:`interval`.
    limits : numpy.ndarray [shape=(n_grades,)]
        Result of :func:`grade_limits`.
    edges : array_like
        Where grades 1, 2, … begin [m].

    Returns
    -------
    tuple of int
        Rising, without gaps, never empty: the grade of the estimate is always there, and those
        between two that are.

    Examples
    --------
    >>> grade_set(1.1, 0.1, np.array([0.5, 0.0]), [1.0]), grade_set(1.1, 0.1, np.ones(2), [1.0])
    ((1,), (0, 1))
    """
    bounds = _edges(edges)
    apart = _outside(np.array([estimate]), np.array([scale]), bounds)[0]
    kept = np.flatnonzero(apart <= limits)
    inside = [*kept.tolist(), int(grades_of(estimate, bounds))]
    return tuple(range(min(inside), max(inside) + 1))


def _edges(edges: ArrayLike) -> Float:
    return np.atleast_1d(np.asarray(edges, dtype=float))


def _outside(estimate: Float, scale: Float, edges: Float) -> Float:
    """How far estimates lie outside each grade, in sizes of the error [shape=(n, n_grades)]."""
    lower = np.log(np.concatenate([[np.finfo(float).tiny], edges]))
    upper = np.log(np.concatenate([edges, [np.finfo(float).max]]))
    place = np.log(estimate)[:, None]
    apart = np.maximum(np.maximum(lower - place, place - upper), 0.0)
    return np.asarray(apart / scale[:, None])
