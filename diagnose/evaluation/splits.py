"""Splits to evaluate a training method: held-out machines, held-out conditions, added noise."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.attributes import Attributes
from ...datasets.file.record import DataSet
from ...datasets.split.rules import condition_split, group_split
from ...datasets.split.stored import LOADS, Drawn, drawn_of, machine_samples
from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_choice import choice_in
from ..feature_rows.feature_table import (
    FeatureSelection,
    FeatureTable,
    Healthy,
    Progress,
    feature_table,
    held_against,
    recording_features,
)
from ..healthy_reference.healthy import references
from ..healthy_reference.transfer_reference import healthy_transfer
from ..wear_model.estimate import WearModel
from ..wear_model.train import fit_model
from .baselines import Side, side_of
from .evaluate import refuse_other_severity
from .foreign_features import Transform, foreign_rows, recordings_of, transformed_rows

Float = NDArray[np.float64]
Index = NDArray[np.intp]

Fit = Callable[[Index], WearModel]
"""Training rows -> a model trained on these rows only."""

Cut = Callable[["Case"], tuple[Index, Index]]
"""Case -> rows of its table for training and for judging."""

Say = Callable[[str], None]

TEST_SHARE = 0.25
"""Share of the machines held out in the random split."""

HELD_SHARE = 0.2
"""Share of the records held out by a condition."""

NOISE_DB = (-20.0, -10.0, 0.0)
"""Rms of added white noise over the as-new rms of each channel [dB]."""

NOISY_RECORDS = 200
"""Test records of the random split at each noise level: enough machines for intervals."""

HEALTHY_SHARE = 0.1
"""Share of the records, those with the least wear, that count as healthy."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A data set with its features, and a training method.

    Attributes
    ----------
    path : Path
    table : FeatureTable
        Features of all usable records.
    head : Attributes
    severity : str
        Judged severity column.
    edges, limit : tuple of float, float
        Grade edges and condemning limit [m].
    choice : Choice
        Features that the table holds.
    healthy : Healthy or None
        Healthy reference of the features.
    fit : callable
        Rows -> model.
    references : numpy.ndarray [shape=(n_records, n_features)] or None
        Healthy row of each record's machine, if the model is referenced.
    seed : int
        Seed of splits, noise and resamples.
    foreign : mapping
        Source -> third-party features of all rows of the table, or the reason for their absence.
    transforms : mapping
        Source -> transform that computes such features for further recordings.
    """

    path: Path
    table: FeatureTable
    head: Attributes
    severity: str
    edges: tuple[float, ...]
    limit: float
    choice: FeatureSelection
    healthy: Healthy | None
    fit: Fit
    references: Float | None
    seed: int
    foreign: Mapping[str, Float | str]
    transforms: Mapping[str, Transform]

    @cached_property
    def groups(self) -> NDArray[Any]:
        """Machine of each record."""
        return self.table.manifest["group"].to_numpy()

    @cached_property
    def truth(self) -> Float:
        """Severity of each record [m]."""
        return self.table.manifest[self.severity].to_numpy(dtype=float)

    @cached_property
    def random(self) -> tuple[Index, Index]:
        """Rows of the random split."""
        return group_split(self.groups, test_fraction=TEST_SHARE, seed=self.seed)

    def side(self, rows: Index) -> Side:
        """Rows of the table as a side to train or judge baselines."""
        return side_of(self.table, self.severity, rows, self.foreign)

    @cached_property
    def random_side(self) -> Side:
        """Training side of the random split."""
        return self.side(self.random[0])

    @cached_property
    def model(self) -> WearModel:
        """Model trained on the random split."""
        return self.fit(self.random[0])

    @cached_property
    def stored(self) -> tuple[str, ...]:
        """Names of the splits stored in the file."""
        with DataSet(self.path) as data:
            return tuple(name for name in data.splits if name not in ALL_SPLITS)

    @cached_property
    def noisy(self) -> dict[float, tuple[FeatureTable, dict[str, Float | str]]]:
        """Noise level [dB] -> result of :func:`noisy_table`."""
        return {level: noisy_table(self, level) for level in NOISE_DB}

    def row(self, recording: Recording) -> Float:
        """Features of a recording, as in the table."""
        known = None if self.healthy is None else self.healthy.of(recording.machine)
        return recording_features(recording, held_against(self.choice, known))[1]

    def recordings(self, rows: Index) -> Iterator[Recording]:
        """Recordings of rows of the table, with one in memory at a time."""
        return recordings_of(self.path, rows)


def case_of(
    model: WearModel,
    path: str | Path,
    *,
    healthy: str | Path | None = None,
    quick: bool = False,
    cache: Path | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Case:
    """Data set for training and evaluation with the settings of a model, on other splits.

    Parameters
    ----------
    model : WearModel
        Its severity, budget and mode are used; it is not evaluated itself.
    path : str or Path
        Labelled data set.
    healthy : str or Path, optional
        Healthy records of the same machines; a referenced model needs them.
    quick : bool
        Leave out the baselines that need third-party packages.
    cache : Path, optional
        Folder in which features of these packages are kept.
    seed : int
        Seed of splits, folds, noise and resamples.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    Case

    Raises
    ------
    DataError
        The severity is not labelled, or healthy records are missing or superfluous.
    """
    card = model.card
    with DataSet(path) as data:
        head = data.attributes
    refuse_other_severity(model, head, path)
    if (model.mode == "referenced") != (healthy is not None):
        raise DataError(
            f"{path}: the model is {model.mode}, and healthy recordings are "
            f"{'not ' if healthy is None else ''}given; give --baseline for a referenced model only"
        )
    choice = choice_in(card.feature_choice)
    ways: dict[str, Any] = {"choice": choice, "jobs": jobs, "progress": progress}
    known = healthy_transfer(healthy, [FeatureSelection(only=tuple(card.features))])
    table = feature_table(path, healthy=known, **ways)
    reference = None
    if healthy is not None:
        reference, _ = references(table, path, healthy, **ways)
    train, _ = group_split(table.manifest["group"].to_numpy(), test_fraction=TEST_SHARE, seed=seed)
    rows_of = transformed_rows(
        Path(path), train, seed=seed, quick=quick, cache=cache, progress=progress
    )

    def fit(rows: Index) -> WearModel:
        return fit_model(
            table,
            rows,
            head,
            target=card.severity,
            references=reference,
            seed=seed,
            budget_ms=card.budget_ms,
            choice=choice,
            path=path,
        )

    return Case(
        path=Path(path),
        table=table,
        head=head,
        severity=card.severity,
        edges=tuple(card.grade_edges_m),
        limit=card.condemning_limit_m,
        choice=choice,
        healthy=known,
        fit=fit,
        references=reference,
        seed=seed,
        foreign=rows_of.rows(Path(path), table),
        transforms=rows_of.transforms,
    )


# --- the splits -----------------------------------------------------------------------------------


def _random(case: Case) -> tuple[Index, Index]:
    return case.random


def _fast(case: Case) -> tuple[Index, Index]:
    return _highest(case, case.table.manifest["speed_hz"].to_numpy(dtype=float))


def _loaded(case: Case) -> tuple[Index, Index]:
    known = [column for column in LOADS if column in case.table.manifest]
    if not known:
        raise DataError(f"it has no load column ({', '.join(LOADS)})")
    return _highest(case, case.table.manifest[known[0]].to_numpy(dtype=float))


def _highest(case: Case, values: Float) -> tuple[Index, Index]:
    edge = float(np.quantile(values, 1 - HELD_SHARE))
    return condition_split(values, edge, np.inf, groups=case.groups)


def _gap(case: Case) -> tuple[Index, Index]:
    low, high = case.edges[-2], np.nextafter(case.edges[-1], 0)
    return condition_split(case.truth, low, high, groups=case.groups)


def _beyond(case: Case) -> tuple[Index, Index]:
    return condition_split(case.truth, case.limit, np.inf, groups=case.groups)


def _unusual(case: Case) -> tuple[Index, Index]:
    with DataSet(case.path) as data:
        distance = machine_distances(drawn_of(data))
    return _highest(case, np.array([distance[group] for group in case.groups.tolist()]))


SPLITS: dict[str, tuple[str, Cut]] = {
    "random": ("a quarter of the machines, at random", _random),
    "speed": ("the fastest fifth of the records", _fast),
    "load": ("the most loaded fifth of the records", _loaded),
    "severity-gap": ("the grade below condemned: wear between the trained values", _gap),
    "severity-beyond": ("condemned: more wear than in the training", _beyond),
    "geometry": ("the fifth of the machines with the most extreme drawn properties", _unusual),
}
"""Name -> description of the held-out part, and rows of both sides. A new split is one row."""

NOISE = "noise"
ALL_SPLITS = (*SPLITS, NOISE)


def machine_distances(drawn: Drawn) -> dict[int, float]:
    """Extremeness of the drawn properties of each machine, drawn again from the recipe.

    Parameters
    ----------
    drawn : Drawn
        Draws of a generated set; see :func:`wearstate.datasets.split.stored.drawn_of`.

    Returns
    -------
    dict
        Group -> rms over all properties of their position between the smallest (-1) and the largest
        (1) drawn; a property with many components counts with the rms of these.

    Raises
    ------
    DataError
        The data set has no recipe, or draws other machines with it.
    """
    if drawn.recipe is None:
        raise DataError("it has no recipe to draw its machines again")
    paths = sorted({axis.path for axis in drawn.recipe.machine})
    machines = {sample.group: sample.drawn for sample in machine_samples(drawn)}
    squares = [_squared_places([each[path] for each in machines.values()]) for path in paths]
    return dict(zip(machines, np.sqrt(np.mean(squares, axis=0)).tolist(), strict=True))


def _squared_places(values: Sequence[float | Mapping[str, float]]) -> Float:
    """Squared positions of one property of each machine; a mapping has many components."""
    rows = [list(each.values()) if isinstance(each, Mapping) else [each] for each in values]
    table = np.array(rows, dtype=float)
    low, high = table.min(axis=0), table.max(axis=0)
    place = np.divide(2 * table - low - high, high - low, where=high > low, out=0 * table)
    return np.asarray((place**2).mean(axis=1))


# --- noise ----------------------------------------------------------------------------------------


def noisy_table(case: Case, level: float) -> tuple[FeatureTable, dict[str, Float | str]]:
    """Features of test records of the random split with added white noise.

    Parameters
    ----------
    case : Case
    level : float
        Rms of the noise over the as-new rms of each channel [dB].

    Returns
    -------
    table : FeatureTable
        Features of up to :data:`NOISY_RECORDS` records.
    foreign : dict
        Features by third-party packages.
    """
    rows = case.random[1][:NOISY_RECORDS]
    deviation = 10 ** (level / 20) * _as_new_rms(case)
    noisy = [
        with_noise(recording, deviation, seed=[case.seed, int(row)])
        for row, recording in zip(rows, case.recordings(rows), strict=True)
    ]
    table = FeatureTable(
        names=case.table.names,
        values=np.array([case.row(recording) for recording in noisy]),
        manifest=case.table.manifest.iloc[rows].reset_index(drop=True),
    )
    foreign: dict[str, Float | str] = {
        source: foreign_rows(case.transforms[source], noisy, len(noisy), None)
        if source in case.transforms
        else str(found if isinstance(found, str) else "left out: no noisy features were computed")
        for source, found in case.foreign.items()
    }
    return table, foreign


def _as_new_rms(case: Case) -> Float:
    """Median rms of each vibration channel over the least worn tenth of the training records."""
    train = case.random[0]
    count = max(1, round(HEALTHY_SHARE * len(train)))
    rows = train[np.argsort(case.truth[train], kind="stable")[:count]]
    levels = [recording.vibration.std(axis=1) for recording in case.recordings(rows)]
    return np.asarray(np.median(levels, axis=0), dtype=float)


def with_noise(recording: Recording, deviation: Float, *, seed: Any) -> Recording:
    """Add white noise to the vibration channels of a recording.

    Parameters
    ----------
    recording : Recording
    deviation : numpy.ndarray [shape=(n_vibration_channels,)]
        Standard deviation of the noise [unit of each channel].
    seed : int or sequence of int
        Seed of the noise.

    Returns
    -------
    Recording
        The tacho is unchanged.
    """
    signal = recording.signal.astype(np.float64)
    places = [i for i, channel in enumerate(recording.channels) if channel.name != recording.tacho]
    rng = np.random.default_rng(seed)
    signal[places] += deviation[:, None] * rng.standard_normal((len(places), signal.shape[1]))
    return replace(recording, signal=signal.astype(np.float32))
