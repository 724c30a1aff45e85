"""Votes of a class model on labelled recordings, and its accuracy."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..feature_rows.blows import blow_floors, lacks_blows
from ..learning.conformal import COVERAGE, record_weights, weighted_quantile
from ..learning.scores import ScoreFigure, resampled, share
from ..wear_model.estimate import UNFAMILIAR_SHARE

Float = NDArray[np.float64]
Index = NDArray[np.intp]

FEWEST = 3  # recordings of an evaluated class: one left out, two for training


@dataclass(frozen=True, kw_only=True)
class Votes:
    """Votes on the training records, by models fitted without their recording.

    Attributes
    ----------
    shares : numpy.ndarray [shape=(n_records, n_classes)]
        Rows with sum 1.
    label : numpy.ndarray [shape=(n_records,)]
        Index of the labelled class.
    group : numpy.ndarray [shape=(n_records,)]
        Recording, or machine, of each record.
    distance : numpy.ndarray [shape=(n_records,)]
        Distance from the nearest class, fitted to the other recordings.
    blows : numpy.ndarray [shape=(n_records, n_channels)]
        Impact score of each channel; without columns if records are too short.
    """

    shares: Float
    label: Index
    group: Index
    distance: Float
    blows: Float

    @cached_property
    def groups_of(self) -> tuple[int, ...]:
        """Number of recordings of each class."""
        return tuple(
            len(np.unique(self.group[self.label == c])) for c in range(self.shares.shape[1])
        )

    @cached_property
    def p_limit(self) -> float:
        """P-value at or below which a recording is unfamiliar."""
        return max(UNFAMILIAR_SHARE, 1 / (len(np.unique(self.group)) + 1))

    def p_value(self, distance: float) -> float:
        """Conformal p-value of "this recording is of a trained class", by recordings.

        Windows of one recording are not independent: together they count as one case, by the share
        of them that is as far.

        Examples
        --------
        >>> label = np.zeros(4, dtype=int)
        >>> votes = Votes(
        ...     shares=np.ones((4, 1)),
        ...     label=label,
        ...     group=np.array([0, 0, 0, 1]),
        ...     distance=np.array([1.0, 1.0, 1.0, 3.0]),
        ...     blows=np.zeros((4, 1)),
        ... )
        >>> round(votes.p_value(2.0), 3), round(votes.p_value(4.0), 3)
        (0.667, 0.333)
        """
        groups, place = np.unique(self.group, return_inverse=True)
        farther = np.bincount(place, weights=self.distance >= distance)
        return float((1 + (farther / np.bincount(place)).sum()) / (len(groups) + 1))

    @cached_property
    def coverages(self) -> tuple[float, ...]:
        """Nominal coverage of the sets for each class, lower with few recordings.

        With m recordings of a class no method can guarantee more than ``m / (m + 1)`` and exclude
        anything; a class with too few recordings is never excluded.
        """
        return tuple(min(COVERAGE, m / (m + 1)) if m >= FEWEST else 1.0 for m in self.groups_of)

    @cached_property
    def limits(self) -> Float:
        """Smallest share with which each class is kept in a set [shape=(n_classes,)]."""
        return np.array([self._limit(c) for c in range(self.shares.shape[1])])

    @cached_property
    def blow_floors(self) -> Float:
        """Smallest impact score of each class's recordings [shape=(n_classes, n_channels)]."""
        mine = [self.label == c for c in range(self.shares.shape[1])]
        return np.stack([blow_floors(self.blows[own], self.group[own]) for own in mine])

    def lacking(self, blows: Float) -> tuple[int, ...]:
        """Classes whose recordings all have impacts that a recording with these scores lacks."""
        return tuple(c for c, floors in enumerate(self.blow_floors) if lacks_blows(blows, floors))

    def is_unfamiliar(self, shares: Float, distance: float, blows: Float) -> bool:
        """Whether a recording belongs to no class: too far, or without their impacts."""
        kept = set_of(shares, self.limits)
        return self.p_value(distance) <= self.p_limit or set(kept) <= set(self.lacking(blows))

    def _limit(self, c: int) -> float:
        if self.groups_of[c] < FEWEST:
            return 0.0
        mine = self.label == c
        lack = 1 - self.shares[mine, c]
        found = weighted_quantile(lack, record_weights(self.group[mine]), self.coverages[c])
        return max(1 - found, 0.0)


def set_of(shares: Float, limits: Float) -> tuple[int, ...]:
    """Classes that cannot be excluded, always including the likeliest.

    Parameters
    ----------
    shares, limits : numpy.ndarray [shape=(n_classes,)]

    Examples
    --------
    >>> set_of(np.array([0.7, 0.2, 0.1]), np.array([0.8, 0.15, 0.15]))
    (0, 1)
    """
    kept = {int(shares.argmax()), *np.flatnonzero(shares >= limits).tolist()}
    return tuple(sorted(kept))


def score_votes(
    votes: Votes,
    classes: tuple[str, ...],
    *,
    trained: Votes | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """Errors and coverage of votes on unseen recordings.

    Parameters
    ----------
    votes : Votes
    classes : tuple of str
    trained : Votes, optional
        Votes of the training, which define sets and unfamiliarity; by default, for each recording,
        those of the others.
    seed : int
        Seed of the resamples.

    Returns
    -------
    dict
        Ready for JSON: ``records``, ``recordings``, ``judged`` (classes with enough recordings),
        ``accuracy``, ``coverage`` of the sets and ``mean_set_size`` over records of the judged
        classes, ``called_unfamiliar``, the share of them that is refused as unfamiliar,
        under ``intervals`` their 95 % intervals over recordings; ``recordings_right`` of
        ``recordings_judged`` by majority of their records with the exact 95 % interval
        ``recordings_interval``; ``confusion`` (true class by row, of all records),
        ``nominal_coverage`` by class, ``majority`` (share of the largest class).
    """
    enough = np.array(votes.groups_of) >= (FEWEST if trained is None else 1)
    judged = enough[votes.label]
    found = votes.shares.argmax(axis=1)
    kept, unfamiliar = _sets(votes, trained)
    draws = resampled(votes.group[judged], seed=seed)
    ones = np.ones(int(judged.sum()))
    inside = kept[np.arange(len(found)), votes.label]
    figures = {
        "accuracy": share((found == votes.label)[judged], ones, draws),
        "coverage": share(inside[judged], ones, draws),
        "mean_set_size": share(kept[judged].sum(axis=1), ones, draws),
        "called_unfamiliar": share(unfamiliar[judged], ones, draws),
    }
    right, of = _recordings_right(votes, judged)
    matrix = np.zeros((len(classes), len(classes)), dtype=int)
    np.add.at(matrix, (votes.label, found), 1)
    return {
        "records": len(found),
        "recordings": len(np.unique(votes.group)),
        "judged": [name for name, flag in zip(classes, enough, strict=True) if flag],
        **{name: figure.value for name, figure in figures.items()},
        "intervals": {name: _ends(figure) for name, figure in figures.items()},
        "recordings_right": right,
        "recordings_judged": of,
        "recordings_interval": _exact_interval(right, of),
        "classes": list(classes),
        "confusion": matrix.tolist(),
        "nominal_coverage": dict(zip(classes, votes.coverages, strict=True)),
        "majority": float(np.bincount(votes.label[judged]).max() / max(int(judged.sum()), 1)),
    }


def _ends(figure: ScoreFigure) -> list[float]:
    return [figure.low, figure.high]


def _sets(votes: Votes, trained: Votes | None) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Sets [shape=(n_records, n_classes)] and unfamiliar records [shape=(n_records,)].

    Without votes of a training, a recording is judged by those of the others.
    """
    kept = np.zeros(votes.shares.shape, dtype=bool)
    unfamiliar = np.zeros(len(kept), dtype=bool)
    for group in np.unique(votes.group):
        mine = votes.group == group
        by = _without(votes, mine) if trained is None else trained
        for i in np.flatnonzero(mine):
            kept[i, list(set_of(votes.shares[i], by.limits))] = True
            unfamiliar[i] = by.is_unfamiliar(votes.shares[i], votes.distance[i], votes.blows[i])
    return kept, unfamiliar


def _without(votes: Votes, mine: NDArray[np.bool_]) -> Votes:
    return Votes(
        shares=votes.shares[~mine],
        label=votes.label[~mine],
        group=votes.group[~mine],
        distance=votes.distance[~mine],
        blows=votes.blows[~mine],
    )


def _recordings_right(votes: Votes, judged: NDArray[np.bool_]) -> tuple[int, int]:
    """Number of recordings whose mean votes name their class, and of all."""
    groups = np.unique(votes.group[judged])
    means = np.array([votes.shares[votes.group == g].mean(axis=0) for g in groups])
    truth = np.array([votes.label[votes.group == g][0] for g in groups])
    return int((means.argmax(axis=1) == truth).sum()), len(groups)


def _exact_interval(right: int, of: int) -> list[float]:
    """Clopper-Pearson interval of a share, at 95 %.

    Examples
    --------
    >>> [round(end, 3) for end in _exact_interval(8, 8)]
    [0.631, 1.0]
    """
    from scipy.stats import binomtest

    ends = binomtest(right, of).proportion_ci(0.95)
    return [float(ends.low), float(ends.high)]
