"""Ranking of features by information on the wear, and by trend within and across machines."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import rankdata

from ..learning.information import mutual_information

Float = NDArray[np.float64]

LEAST_OF_MACHINE = 4
"""Fewest records of one machine: with fewer, a rank correlation is 1 too easily."""

LEAST_RANKED = 10  # fewest records with a value for an estimate of information
_CHANCE = 95  # percentile of features without information that defines the chance level
_SHUFFLED = 40  # fewest values for the chance level
_PER_BIT = math.log(2)  # nats


@dataclass(frozen=True, kw_only=True)
class FeatureRank:
    """Information of one feature on the target; NaN if it cannot be estimated.

    Attributes
    ----------
    name : str
    information : float
        Mutual information with the target [bits].
    grades : float
        Mutual information with the grades over their entropy, 0 to 1.
    spearman : float
        Rank correlation with the target over all records, -1 to 1.
    monotonicity : float
        Mean over machines of the magnitude of the rank correlation within a machine, 0 to 1.
    trendability : float
        Magnitude of the mean over machines of that correlation, 0 to 1: equal to the monotonicity
        if all machines agree on the direction, 0 if they contradict each other.
    """

    name: str
    information: float
    grades: float
    spearman: float
    monotonicity: float
    trendability: float


@dataclass(frozen=True, kw_only=True)
class Ranking:
    """Features, those with most information first.

    Attributes
    ----------
    features : tuple of FeatureRank
    chance : float
        95th percentile of the information [bits] with a shuffled target.
    n_records, n_machines : int
    n_followed : int
        Machines with enough records for a correlation within them.
    """

    features: tuple[FeatureRank, ...]
    chance: float
    n_records: int
    n_machines: int
    n_followed: int

    @property
    def informative(self) -> tuple[FeatureRank, ...]:
        """Features with more information than chance."""
        return tuple(each for each in self.features if each.information > self.chance)


def rank_features(
    names: Sequence[str],
    values: ArrayLike,
    target: ArrayLike,
    machines: ArrayLike,
    *,
    grades: ArrayLike | None = None,
    classes: bool = False,
    seed: int = 0,
) -> Ranking:
    """Rank features by their information on a severity or on named conditions.

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    values : array_like [shape=(n_records, n_features)]
        NaN for missing values.
    target : array_like [shape=(n_records,)]
        Severity, or label of the condition.
    machines : array_like [shape=(n_records,)]
        Machine of each record.
    grades : array_like, optional [shape=(n_records,)]
        Grade of each record; negative if unknown.
    classes : bool
        The target names conditions, which have no order: no correlations are computed.
    seed : int
        Seed of the shuffled target and of the tie breaking.

    Returns
    -------
    Ranking

    Notes
    -----
    Information is estimated from nearest neighbours of the ranks (Kraskov, Stoegbauer, Grassberger
    2004, doi:10.1103/PhysRevE.69.066138; Ross 2014, doi:10.1371/journal.pone.0087357), so that a
    monotonic scaling of a feature does not change it. Features are considered one at a time: two
    redundant ones are both high, two that are informative only together are both low. Trendability
    follows Coble and Hines 2009, with rank correlations.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> wear = rng.random(200)
    >>> table = np.column_stack([rng.random(200), wear**3])
    >>> found = rank_features(["noise", "level"], table, wear, np.arange(200) // 10)
    >>> [each.name for each in found.informative], round(found.features[0].trendability, 2)
    (['level'], 1.0)
    """
    rows = np.asarray(values, dtype=np.float64)
    aim = _numbered(target) if classes else _ranks(target)
    rng = np.random.default_rng(seed)
    shuffled = [rng.permutation(aim) for _ in range(math.ceil(_SHUFFLED / max(len(names), 1)))]
    known = None if grades is None else np.asarray(grades, dtype=np.int64)
    group = np.asarray(machines)
    monotonicity, trendability, n_followed = _within(rows, aim, group, classes=classes)
    found, chance = [], []
    for place, name in enumerate(names):
        column = rows[:, place]
        chance += [_information(column, other, classes=classes, seed=seed) for other in shuffled]
        found.append(
            FeatureRank(
                name=name,
                information=_information(column, aim, classes=classes, seed=seed),
                grades=math.nan if known is None else _grade_information(column, known, seed),
                spearman=math.nan if classes else _spearman(column, aim),
                monotonicity=float(monotonicity[place]),
                trendability=float(trendability[place]),
            )
        )
    order = sorted(found, key=lambda each: (-np.nan_to_num(each.information, nan=-1), each.name))
    finite = [value for value in chance if not math.isnan(value)]
    return Ranking(
        features=tuple(order),
        chance=float(np.percentile(finite, _CHANCE)) if finite else math.nan,
        n_records=len(rows),
        n_machines=len(np.unique(group)),
        n_followed=n_followed,
    )


def _ranks(values: ArrayLike) -> Float:
    return np.asarray(rankdata(np.asarray(values, dtype=np.float64)), dtype=np.float64)


def _numbered(labels: ArrayLike) -> Float:
    return np.unique(np.asarray(labels), return_inverse=True)[1].astype(np.float64)


def _information(column: Float, aim: NDArray[Any], *, classes: bool, seed: int) -> float:
    """Mutual information of one feature with the target [bits]; 0 for a constant feature."""
    valid = np.isfinite(column)
    if valid.sum() < LEAST_RANKED:
        return math.nan
    own = _ranks(column[valid])
    if np.ptp(own) == 0:
        return 0.0
    return mutual_information(own, aim[valid], classes=classes, seed=seed) / _PER_BIT


def _grade_information(column: Float, grades: NDArray[np.int64], seed: int) -> float:
    """Mutual information of a feature with the grades, over their entropy."""
    valid = np.isfinite(column) & (grades >= 0)
    share = np.bincount(grades[valid]) / max(valid.sum(), 1)
    entropy = -float(np.sum(share[share > 0] * np.log2(share[share > 0])))
    if entropy == 0:
        return math.nan
    known = _information(column[valid], grades[valid], classes=True, seed=seed)
    return min(known / entropy, 1.0)


def _spearman(column: Float, aim: Float) -> float:
    valid = np.isfinite(column)
    return float(_correlation(column[valid, None], aim[valid])[0]) if valid.sum() > 1 else math.nan


def _within(
    rows: Float, aim: Float, group: NDArray[Any], *, classes: bool
) -> tuple[Float, Float, int]:
    """Mean magnitude, and magnitude of the mean, of the correlations within machines."""
    found = [
        _correlation(rows[own], aim[own])
        for machine in np.unique(group)
        for own in [np.flatnonzero(group == machine)]
        if not classes and own.size >= LEAST_OF_MACHINE and np.ptp(aim[own]) > 0
    ]
    if not found:
        nothing = np.full(rows.shape[1], math.nan)
        return nothing, nothing, 0
    every = np.array(found)
    some = np.isfinite(every)
    count = np.where(some.any(axis=0), some.sum(axis=0), math.nan)
    filled = np.where(some, every, 0.0)
    return np.abs(filled).sum(axis=0) / count, np.abs(filled.sum(axis=0)) / count, len(found)


def _correlation(rows: Float, aim: Float) -> Float:
    """Rank correlation of every column with the target; 0 if constant, NaN if not finite."""
    whole = np.isfinite(rows).all(axis=0)
    ranks = rankdata(np.where(whole, rows, 0.0), axis=0)
    ranks -= ranks.mean(axis=0)
    wanted = rankdata(aim) - (len(aim) + 1) / 2
    scale = np.sqrt((ranks**2).sum(axis=0) * (wanted**2).sum())
    found = wanted @ ranks / np.where(scale > 0, scale, 1.0)
    return np.where(whole, found, math.nan)
