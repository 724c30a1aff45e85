"""Figures of merit of wear estimates, each with its interval over machines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .grades import accuracy_bound, grades_of

Float = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

RESAMPLES = 1000
"""Number of resamplings of whole machines, for every interval."""

LEVEL = 0.95
"""Nominal coverage of every interval over machines."""

FAR_SHARE = 0.08
"""Share of the condemning limit; farther than this from an edge, a grade ought to be right."""

FALSE_ALARM_GRADE = 2
"""A machine of grade 0 that is called this or more is a false alarm."""

MISSED_GRADE = 1
"""A condemned machine that is called this or less is a missed fault."""


@dataclass(frozen=True, kw_only=True)
class ScoreFigure:
    """A figure with its interval over machines.

    Attributes
    ----------
    value, low, high : float
        NaN if no record determines it.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Resamples:
    """Machines drawn with replacement, as often as there are machines, many times.

    Attributes
    ----------
    machine : numpy.ndarray [shape=(n_records,)]
        Number of each record's machine, from 0.
    weight : numpy.ndarray [shape=(n_resamples, n_machines)]
        How often each resample holds each machine.
    """

    machine: Index
    weight: Float

    def sums(self, values: Float) -> Float:
        """Sums over each resample [shape=(n_resamples, k)] of values [shape=(n_records, k)]."""
        by_machine = np.zeros((self.weight.shape[1], values.shape[1]))
        np.add.at(by_machine, self.machine, values)
        return self.weight @ by_machine

    def of_records(self) -> Float:
        """Weight of each record in each resample [shape=(n_resamples, n_records)]."""
        return self.weight[:, self.machine]


def resampled(groups: ArrayLike, *, n: int = RESAMPLES, seed: int = 0) -> Resamples:
    """Resamples of whole machines.

    Parameters
    ----------
    groups : array_like [shape=(n_records,)]
        Machine of each record.
    n : int
        Number of resamples.
    seed : int
        Seed of the resampling.

    Returns
    -------
    Resamples

    Examples
    --------
    >>> resampled([7, 7, 9], n=4).weight.sum(axis=1)
    array([2., 2., 2., 2.])
    """
    unique, machine = np.unique(np.asarray(groups), return_inverse=True)
    count = len(unique)
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), size=n)
    return Resamples(machine=machine.reshape(-1), weight=drawn.astype(float))


def share(top: ArrayLike, bottom: ArrayLike, draws: Resamples) -> ScoreFigure:
    """Ratio of two sums over records, with its percentile interval.

    Parameters
    ----------
    top, bottom : array_like [shape=(n_records,)]
        For a mean over some records: the value there and 1, elsewhere both 0.
    draws : Resamples
        Machine of each record.

    Returns
    -------
    ScoreFigure
        NaN where the sum of `bottom` is 0.

    Notes
    -----
    Percentile interval of the group bootstrap: records of one machine are drawn together, so it
    does not mistake ten records of one machine for ten machines. Below some 20 machines it is too
    narrow. A figure of exactly 0 or 1 has an interval of no width, which is no proof: with n
    machines up to 3/n is possible.

    Examples
    --------
    >>> share([1.0, 0.0, 2.0, 1.0], np.ones(4), resampled([0, 1, 2, 3])).value
    1.0
    """
    both = np.stack([np.asarray(top, dtype=float), np.asarray(bottom, dtype=float)], axis=1)
    whole, parts = both.sum(axis=0), draws.sums(both)
    if whole[1] == 0:
        return ScoreFigure(value=float("nan"), low=float("nan"), high=float("nan"))
    return _figure(whole[0] / whole[1], parts[:, 0], parts[:, 1])


def _figure(value: float, top: Float, bottom: Float) -> ScoreFigure:
    defined = bottom > 0
    return _between(value, top[defined] / bottom[defined])


def _between(value: float, found: Float) -> ScoreFigure:
    ends = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
    low, high = np.quantile(found, ends) if found.size else (np.nan, np.nan)
    return ScoreFigure(value=float(value), low=float(low), high=float(high))


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What a method said of some recordings of known wear.

    Attributes
    ----------
    groups : numpy.ndarray [shape=(n,)]
        Machine of each record.
    truth, found : numpy.ndarray [shape=(n,)]
        Severity and its estimate [m], the latter whatever the verdict.
    grade : numpy.ndarray [shape=(n,)]
        As estimated.
    graded : numpy.ndarray [shape=(n,)]
        Whether a grade was given.
    cautious : numpy.ndarray [shape=(n,)]
        Whether with caution.
    low, high : numpy.ndarray [shape=(n,)]
        Interval of the severity [m]; NaN where there is none.
    possible : numpy.ndarray [shape=(n, n_grades)]
        Set of possible grades; all False where there is none.
    """

    groups: NDArray[Any]
    truth: Float
    found: Float
    grade: Index
    graded: Mask
    cautious: Mask
    low: Float
    high: Float
    possible: Mask


def point_judged(
    groups: NDArray[Any],
    truth: Float,
    found: Float,
    grade: Index,
    n_grades: int,
    *,
    graded: Mask | None = None,
) -> Judged:
    """What a method says that gives neither interval nor set, of the records that count as graded.

    All count unless `graded` [shape=(n,)] is given.
    """
    n = len(truth)
    nothing = np.full(n, np.nan)
    return Judged(
        groups=groups,
        truth=truth,
        found=found,
        grade=grade,
        graded=np.ones(n, dtype=bool) if graded is None else graded,
        cautious=np.zeros(n, dtype=bool),
        low=nothing,
        high=nothing,
        possible=np.zeros((n, n_grades), dtype=bool),
    )


FIGURES = (
    ("mae_m", "mean error of the severity [m]"),
    ("mae_share_of_limit", "the same over the condemning limit"),
    ("accuracy", "share of right grades"),
    ("accuracy_far", "the same, farther than 8 % of the limit from a grade edge"),
    ("within_one_grade", "share within one grade of the truth"),
    ("mean_grade_error", "mean difference of the grades"),
    ("kappa", "quadratic weighted kappa of the grades"),
    ("false_alarm", "share of grade 0 that is called grade 2 or 3"),
    ("missed_fault", "share of grade 3 that is called grade 0 or 1"),
    ("coverage", "share of intervals that hold the severity"),
    ("mean_interval_share", "mean width of the intervals over the limit"),
    ("set_coverage", "share of sets that hold the grade"),
    ("mean_set_size", "mean number of grades in a set"),
    ("mae_all_m", "mean error over all records, the refused ones too [m]"),
    ("mae_all_share_of_limit", "the same over the limit"),
    ("unfamiliar", "share of records that are refused"),
    ("caution", "share of records that are graded with caution"),
)
"""Name and meaning; the first thirteen are over the records that were graded."""


def figures(
    judged: Judged, edges: Sequence[float], limit: float, draws: Resamples
) -> dict[str, ScoreFigure]:
    """All of :data:`FIGURES`.

    Parameters
    ----------
    judged : Judged
    edges : sequence of float
        Grade edges [m].
    limit : float
        Condemning limit [m].
    draws : Resamples
        Machine of each record.

    Returns
    -------
    dict
        NaN if no record determines it (no set is given, no machine is condemned).

    Notes
    -----
    Kappa is Cohen's with weights growing with the square of the difference; 1 is perfect, 0 is
    chance. J. Cohen, Psychological Bulletin 70 (1968) 213, doi:10.1037/h0026256.

    Examples
    --------
    >>> wear = np.array([1e-4, 3e-4])
    >>> records = point_judged(np.arange(2), wear, wear + 1e-5, np.array([0, 1]), 2)
    >>> found = figures(records, [2e-4], 2e-4, resampled([0, 1]))
    >>> round(found["mae_share_of_limit"].value, 3), found["kappa"].value
    (0.05, 1.0)
    """
    pairs = _pairs(judged, np.asarray(edges, dtype=float), limit)
    found = {name: share(top, bottom, draws) for name, (top, bottom) in pairs.items()}
    true = grades_of(judged.truth, edges)
    found["kappa"] = kappa(true, judged.grade, judged.graded, len(edges) + 1, draws)
    return {name: found[name] for name, _ in FIGURES}


def _pairs(judged: Judged, edges: Float, limit: float) -> dict[str, tuple[Float, Float]]:
    """Top and bottom of each figure that is a mean over some records."""
    true = grades_of(judged.truth, edges.tolist())
    error = np.abs(judged.found - judged.truth)
    off = np.abs(judged.grade - true)
    gap = np.abs(judged.truth[:, None] - edges).min(axis=1)
    width = judged.high - judged.low
    inside = (judged.low <= judged.truth) & (judged.truth <= judged.high)
    in_set = judged.possible[np.arange(len(true)), true]
    given, every = judged.graded, np.ones(len(true), dtype=bool)
    ranged, listed = given & np.isfinite(width), given & judged.possible.any(axis=1)
    means = {
        "mae_m": (error, given),
        "mae_share_of_limit": (error / limit, given),
        "accuracy": (off == 0, given),
        "accuracy_far": (off == 0, given & (gap > FAR_SHARE * limit)),
        "within_one_grade": (off <= 1, given),
        "mean_grade_error": (off, given),
        "false_alarm": (judged.grade >= FALSE_ALARM_GRADE, given & (true == 0)),
        "missed_fault": (judged.grade <= MISSED_GRADE, given & (true == len(edges))),
        "coverage": (inside, ranged),
        "mean_interval_share": (width / limit, ranged),
        "set_coverage": (in_set, listed),
        "mean_set_size": (judged.possible.sum(axis=1), listed),
        "mae_all_m": (error, every),
        "mae_all_share_of_limit": (error / limit, every),
        "unfamiliar": (~given, every),
        "caution": (judged.cautious, every),
    }
    return {
        name: (np.where(over, value, 0.0).astype(float), over.astype(float))
        for name, (value, over) in means.items()
    }


def confusion(true: Index, grade: Index, n: int) -> NDArray[np.intp]:
    """Counts by true grade (row) and estimated grade (column).

    Examples
    --------
    >>> confusion(np.array([0, 1, 1]), np.array([0, 0, 1]), 2).tolist()
    [[1, 0], [1, 1]]
    """
    return np.bincount(n * true + grade, minlength=n * n).reshape(n, n)


def kappa(true: Index, grade: Index, over: Mask, n: int, draws: Resamples) -> ScoreFigure:
    """Quadratic weighted kappa of some records, with its interval.

    Parameters
    ----------
    true, grade : numpy.ndarray [shape=(n_records,)]
    over : numpy.ndarray [shape=(n_records,)]
        Records that count.
    n : int
        Number of grades.
    draws : Resamples

    Returns
    -------
    ScoreFigure
        NaN where every true grade is the same: then it is 0 or nothing, whatever the estimates.

    Examples
    --------
    >>> grade = np.array([0, 1, 2, 3])
    >>> kappa(grade, 3 - grade, grade >= 0, 4, resampled(grade)).value
    -1.0
    """
    cell = np.eye(n * n)[n * true + grade] * over[:, None]
    value = _kappas(cell.sum(axis=0)[None, :], n)[0]
    found = _kappas(draws.sums(cell), n)
    return _between(value, found[np.isfinite(found)])


def _kappas(counts: Float, n: int) -> Float:
    """Kappa of each row of flattened confusion matrices."""
    table = counts.reshape(-1, n, n)
    weight = (np.arange(n)[:, None] - np.arange(n)) ** 2
    by_chance = np.einsum("rij,rkl,il->r", table, table, weight)
    seen = (table * weight).sum(axis=(1, 2)) * table.sum(axis=(1, 2))
    defined = (table.sum(axis=2) > 0).sum(axis=1) > 1
    share_seen = np.divide(seen, by_chance, out=np.full(len(seen), np.nan), where=defined)
    return np.asarray(1 - share_seen)


def bound_of(judged: Judged, edges: Sequence[float]) -> float | None:
    """Accuracy that the mean error over the graded records allows; None where none is graded."""
    if not judged.graded.any():
        return None
    true = judged.truth[judged.graded]
    error = float(np.abs(judged.found[judged.graded] - true).mean())
    return accuracy_bound(true, edges, error)


def smallest_found(
    truth: Float,
    found: Float,
    healthy: Mask,
    draws: Resamples,
    *,
    false_alarm: float = 0.05,
    detection: float = 0.9,
) -> tuple[float, ScoreFigure]:
    """Smallest wear that is found with a given probability at a given rate of false alarms.

    Parameters
    ----------
    truth, found : numpy.ndarray [shape=(n_records,)]
        Severity and its estimate [m].
    healthy : numpy.ndarray [shape=(n_records,)]
        Records that must raise no alarm; at least one.
    draws : Resamples
        Machine of each record.
    false_alarm : float
        Share of healthy records above the threshold, 0 < share < 1.
    detection : float
        Share of worn records above it, 0 < share < 1.

    Returns
    -------
    threshold : float
        On the estimate [m]: the (1 - false_alarm) quantile of the healthy.
    smallest : Figure
        Severity [m] at which a rising curve through the hits reaches `detection`; infinite where
        it never does. The interval takes in that of the threshold.

    Notes
    -----
    The probability of detection is fitted to hit or miss by isotonic regression: it may only rise
    with the wear, nothing else is assumed. The smallest flaw found in 90 % of cases is the figure
    that non-destructive testing states (MIL-HDBK-1823A), there by a logistic curve.

    Examples
    --------
    >>> wear = np.linspace(0, 1, 101)
    >>> threshold, smallest = smallest_found(wear, wear, wear <= 0.2, resampled(np.arange(101)))
    >>> round(threshold, 2), round(smallest.value, 2)
    (0.19, 0.2)
    """
    order = np.argsort(truth, kind="stable")
    truth, found, healthy = truth[order], found[order], healthy[order]
    rows = draws.of_records()[:, order]
    threshold = _threshold(found, healthy, np.ones(len(truth)), false_alarm)
    value = _reaches(truth, found > threshold, np.ones(len(truth)), detection)
    tried = [
        _reaches(truth, found > _threshold(found, healthy, weight, false_alarm), weight, detection)
        for weight in rows
        if weight[healthy].any()
    ]
    # sorted by hand: np.quantile makes NaN of a step between two infinities
    ends = np.sort(tried)[[int(len(tried) * (1 - LEVEL) / 2), int(len(tried) * (1 + LEVEL) / 2)]]
    return threshold, ScoreFigure(value=value, low=float(ends[0]), high=float(ends[1]))


def _threshold(found: Float, healthy: Mask, weight: Float, false_alarm: float) -> float:
    order = np.argsort(found[healthy], kind="stable")
    below = np.cumsum(weight[healthy][order])
    place = int(np.searchsorted(below, (1 - false_alarm) * below[-1] * (1 - 1e-12)))
    return float(found[healthy][order][place])


def _reaches(truth: Float, hit: Mask, weight: Float, detection: float) -> float:
    from sklearn.isotonic import isotonic_regression

    drawn = weight > 0
    if not drawn.any():
        return float("inf")
    curve = isotonic_regression(hit[drawn].astype(float), sample_weight=weight[drawn])
    enough = np.flatnonzero(curve >= detection)
    return float(truth[drawn][enough[0]]) if enough.size else float("inf")


def plain(value: Any) -> Any:
    """For JSON: figures as ``{value, low, high}``, numbers that are not finite as None.

    Examples
    --------
    >>> plain({"a": ScoreFigure(value=1.0, low=float("nan"), high=float("inf"))})
    {'a': {'value': 1.0, 'low': None, 'high': None}}
    """
    if isinstance(value, ScoreFigure):
        return plain({"value": value.value, "low": value.low, "high": value.high})
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and not np.isfinite(value) else value
