"""What a wear model learns from: rows of features with their labels, and what it must refuse."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..familiarity.novelty import REACH
from ..feature_rows.physical import moved_rows
from ..healthy_reference.healthy import referenced_rows

Float = NDArray[np.float64]

FOLDS = 5
"""Number of folds of whole machines, for every out-of-fold estimate."""


@dataclass(frozen=True, kw_only=True)
class Strangers:
    """Recordings of one kind that a model must refuse.

    Attributes
    ----------
    name : str
        Name of the kind, as ``lubrication_starved``.
    rows : numpy.ndarray [shape=(n, n_features)]
    groups : numpy.ndarray [shape=(n,)]
        Machine draw of each recording, >= 0.
    signals : numpy.ndarray [shape=(n,)]
        Checksum of each recording's signal; empty where it is of no matter.
    """

    name: str
    rows: Float
    groups: NDArray[np.intp]
    signals: NDArray[np.integer[Any]] = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass(frozen=True, kw_only=True)
class TrainingRows:
    """What a model learns from.

    Attributes
    ----------
    names : tuple of str
        Feature names.
    rows : numpy.ndarray [shape=(n, n_features)]
    baseline : numpy.ndarray [shape=(n, n_features)] or None
        Healthy rows of the same machines.
    severity : numpy.ndarray [shape=(n,)]
        [m], > 0.
    groups : numpy.ndarray [shape=(n,)]
        Machine draw of each record.
    conditions : tuple of str
        Noted conditions that vary.
    notes : sequence of mapping
        Conditions noted with each record; not used without `conditions`.
    faults : dict
        Name -> presence [shape=(n,)] of each fault other than the wear.
    strangers : tuple of Strangers
        Recordings to refuse, with the same features.
    """

    names: tuple[str, ...]
    rows: Float
    baseline: Float | None
    severity: Float
    groups: NDArray[np.intp]
    conditions: tuple[str, ...] = ()
    notes: Sequence[Mapping[str, Any]] = ()
    faults: dict[str, NDArray[np.bool_]] = field(default_factory=dict)
    strangers: tuple[Strangers, ...] = ()

    @property
    def inputs(self) -> Float:
        """Inputs of the severity estimate."""
        return self.rows if self.baseline is None else referenced_rows(self.rows, self.baseline)

    @property
    def first_feature(self) -> int:
        """Column of the inputs at which the features as they are begin."""
        return 0 if self.baseline is None else len(self.names)

    def moved(self, seed: int) -> "TrainingRows":
        """The same records of machines whose resonances stand anywhere within the reach.

        Each machine has its own factor, which its healthy rows share.
        """
        machines, place = np.unique(self.groups, return_inverse=True)
        steps = np.random.default_rng(seed).uniform(-1, 1, len(machines))[place]
        factor = np.exp(steps * math.log(REACH))

        def there(rows: Float) -> Float:
            return moved_rows(self.names, rows, factor, cells=True)

        healthy = None if self.baseline is None else there(self.baseline)
        return replace(self, rows=there(self.rows), baseline=healthy)

    def part(self, columns: NDArray[np.intp]) -> "TrainingRows":
        """The same records with some of the features."""
        return replace(
            self,
            names=tuple(self.names[i] for i in columns),
            rows=self.rows[:, columns],
            baseline=None if self.baseline is None else self.baseline[:, columns],
            strangers=tuple(replace(each, rows=each.rows[:, columns]) for each in self.strangers),
        )

    def some(self, count: int, seed: int) -> "TrainingRows":
        """Rows of machines drawn at random, some `count` of them if there are more."""
        if len(self.rows) <= count:
            return self
        machine = np.unique(self.groups)
        share = count / len(self.rows)
        drawn = np.random.default_rng(seed).permutation(machine)[: round(share * len(machine))]
        here = np.isin(self.groups, drawn)
        return TrainingRows(
            names=self.names,
            rows=self.rows[here],
            baseline=None,
            severity=self.severity[here],
            groups=self.groups[here],
        )

    def with_strangers(self, strangers: Strangers) -> "TrainingRows":
        """These records, and after them strangers of other machines, as rows alone."""
        first = int(self.groups.max()) + 1
        return TrainingRows(
            names=self.names,
            rows=np.vstack([self.rows, strangers.rows]),
            baseline=None,
            severity=np.ones(len(self.rows) + len(strangers.rows)),
            groups=np.concatenate([self.groups, first + strangers.groups]),
        )
