"""Judge a way of training where it was never trained: held-out machines, conditions, noise."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.record import Attributes, DataSet
from ...datasets.split.rules import check_no_leak, condition_split, group_split
from ...datasets.split.stored import LOADS, Drawn, drawn_of, machine_samples, usable_sides
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
from ..feature_rows.healthy import Baseline, references
from ..feature_rows.noted import notes_of
from ..feature_rows.transfer_reference import healthy_transfer
from ..learning.scores import ScoreFigure, figures, plain, resampled, smallest_found
from ..wear_model.estimate import WearModel
from ..wear_model.train import fit_model
from .baselines import BASELINES, Rival, Side, choose, side_of
from .evaluate import Background, judge_rows, refuse_other_severity, score
from .foreign_features import (
    LEFT_OUT,
    PACKAGES,
    Transform,
    absence,
    foreign_rows,
    recordings_of,
    transformed_rows,
)

Float = NDArray[np.float64]
Index = NDArray[np.intp]
Fit = Callable[[Index], WearModel]
"""Training rows -> a model that has seen no other row."""

Cut = Callable[["Case"], tuple[Index, Index]]
"""Case -> rows of its table to train on, and to judge on."""

Say = Callable[[str], None]

EVALUATION_SCHEMA = 1

TEST_SHARE = 0.25
"""Of the machines, in the random split."""

HELD_SHARE = 0.2
"""Of the records, where a condition is held out."""

NOISE_DB = (-20.0, -10.0, 0.0)
"""Rms of added white noise over the as-new rms of each channel [dB]."""

NOISY_RECORDS = 200
"""Of the random split's test side, at each level of noise: machines enough for intervals."""

CURVE_MACHINES = (50, 100, 200, 400)
"""Machines trained on, along the learning curve; all of them come last."""

HEALTHY_SHARE = 0.1
"""Of the records, those with the least wear, count as new: they must raise no alarm."""

FALSE_ALARM, DETECTION = 0.05, 0.9

_TIMED_RECORDS = 8
_FLOOR_RESAMPLES = 300  # each is a fit: their ends tell 2.5 % well enough


@dataclass(frozen=True, kw_only=True)
class Case:
    """A data set with its features, and a way of training.

    Attributes
    ----------
    path : Path
    table : FeatureTable
        Of all usable records.
    head : Attributes
    severity : str
        Column that is judged.
    edges, limit : tuple of float, float
        Grade edges and condemning limit [m].
    choice : Choice
        Features that the table holds.
    healthy : Healthy or None
        What they are told against.
    fit : callable
        Rows -> model.
    references : numpy.ndarray [shape=(n_records, n_features)] or None
        Healthy row of each record's machine, where the model is referenced.
    seed : int
        Of splits, noise and resamples.
    foreign : mapping
        Source -> features of all rows of the table by a package of others, or why there are none.
    transforms : mapping
        Source -> the same of further recordings, where there are any.
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
        """Rows of the table, to train or judge baselines on."""
        return side_of(self.table, self.severity, rows, self.foreign)

    @cached_property
    def random_side(self) -> Side:
        """Training side of the random split."""
        return self.side(self.random[0])

    @cached_property
    def model(self) -> WearModel:
        """Trained on the random split."""
        return self.fit(self.random[0])

    @cached_property
    def stored(self) -> tuple[str, ...]:
        """Splits that the file holds under names of their own."""
        with DataSet(self.path) as data:
            return tuple(name for name in data.splits if name not in ALL_SPLITS)

    @cached_property
    def noisy(self) -> dict[float, tuple[FeatureTable, dict[str, Float | str]]]:
        """Of each level of noise [dB], as :func:`noisy_table`."""
        return {level: noisy_table(self, level) for level in NOISE_DB}

    def row(self, recording: Recording) -> Float:
        """Features of a recording, as the table holds them."""
        known = None if self.healthy is None else self.healthy.of(recording.machine)
        return recording_features(recording, held_against(self.choice, known))[1]

    def recordings(self, rows: Index) -> Iterator[Recording]:
        """Recordings of rows of the table, one in memory at a time."""
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
    """A data set, to be trained on and judged as a model was trained, but on other splits.

    Parameters
    ----------
    model : WearModel
        Its severity, its budget and its mode are used; it is not judged.
    path : str or Path
        Labelled data set.
    healthy : str or Path, optional
        Healthy records of the same machines; a referenced model needs them.
    quick : bool
        Leave out the baselines that need packages of others.
    cache : Path, optional
        Folder in which features of such packages are kept.
    seed : int
        Of splits, folds, noise and resamples.
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
        The severity is not labelled, or healthy records are missing or without use.
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
        raise DataError(f"it has no column of load ({', '.join(LOADS)})")
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
    "severity-gap": ("all of the grade below condemned: wear between what was trained", _gap),
    "severity-beyond": ("all that is condemned: more wear than any trained", _beyond),
    "geometry": ("the fifth of the machines whose drawn properties are the farthest out", _unusual),
}
"""Name -> what is held out, and the rows of both sides. A new split is one row."""

NOISE = "noise"
ALL_SPLITS = (*SPLITS, NOISE)


def machine_distances(drawn: Drawn) -> dict[int, float]:
    """How far out the drawn properties of each machine lie, drawn again from the recipe.

    Parameters
    ----------
    drawn : Drawn
        Of a generated set; see :func:`wearstate.datasets.split.stored.drawn_of`.

    Returns
    -------
    dict
        Group -> root mean square over all properties of their place between the least (-1) and the
        largest (1) drawn; of a property of many components, of their root mean square.

    Raises
    ------
    DataError
        The data set has no recipe, or draws other machines with it.
    """
    if drawn.recipe is None:
        raise DataError("it has no recipe to draw its machines from again")
    paths = sorted({axis.path for axis in drawn.recipe.machine})
    machines = {sample.group: sample.drawn for sample in machine_samples(drawn)}
    squares = [_squared_places([each[path] for each in machines.values()]) for path in paths]
    return dict(zip(machines, np.sqrt(np.mean(squares, axis=0)).tolist(), strict=True))


def _squared_places(values: Sequence[float | Mapping[str, float]]) -> Float:
    """Of one property, drawn for each machine; a mapping has many components."""
    rows = [list(each.values()) if isinstance(each, Mapping) else [each] for each in values]
    table = np.array(rows, dtype=float)
    low, high = table.min(axis=0), table.max(axis=0)
    place = np.divide(2 * table - low - high, high - low, where=high > low, out=0 * table)
    return np.asarray((place**2).mean(axis=1))


# --- the protocol ---------------------------------------------------------------------------------


def evaluate_splits(
    case: Case, names: Sequence[str] = ALL_SPLITS, *, say: Say | None = None
) -> dict[str, Any]:
    """Train and judge on each split, with baselines, learning curve and detectability.

    Parameters
    ----------
    case : Case
        Of :func:`case_of`.
    names : sequence of str
        Of :data:`ALL_SPLITS`, or of the splits that the data set's file holds.
    say : callable, optional
        Called with a line about each stage.

    Returns
    -------
    dict
        Ready for JSON: ``schema_version``, the data set's name, size, limits and seed; ``splits``,
        each as :func:`wearstate.diagnose.evaluation.evaluate.score` with ``name``, ``text``,
        ``train`` and ``missing`` (why it could not be made, else empty); and, where the random
        split is among the names, ``learning_curve``, ``detectability`` and ``cost``.

    Raises
    ------
    DataError
        A name is unknown, or the data set has too few machines.
    """
    known = (*ALL_SPLITS, *case.stored)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise DataError(f"split = {unknown[0]!r} must be one of {', '.join(known)}, or all")
    tell = say or (lambda _text: None)
    splits: list[dict[str, Any]] = []
    for name in names:
        tell(f"split {name}")
        splits += _noisy(case) if name == NOISE else [_judged_split(case, name)]
    extra: dict[str, Any] = {}
    if "random" in names:
        tell("learning curve, detectability, cost")
        extra = {
            "learning_curve": learning_curve(case),
            "detectability": detectability(case, noise=NOISE in names),
            "cost": costs(case),
        }
    return {
        "schema_version": EVALUATION_SCHEMA,
        "data": case.path.name,
        "origin": case.head.origin,
        "records": len(case.truth),
        "draws": len(np.unique(case.groups)),
        "severity": case.severity,
        "grade_edges_m": list(case.edges),
        "condemning_limit_m": case.limit,
        "seed": case.seed,
        "splits": splits,
        **extra,
    }


def one_split(
    result: Mapping[str, Any], model: WearModel, path: str | Path, seed: int
) -> dict[str, Any]:
    """A finished model's judgement in the form of :func:`evaluate_splits`, for page and picture.

    Parameters
    ----------
    result : mapping
        Of :func:`wearstate.diagnose.evaluation.evaluate.evaluate_model`.
    model : WearModel
    path : str or Path
        Data set that it was judged on.
    seed : int
    """
    with DataSet(path) as data:
        origin = data.attributes.origin
    card = model.card
    return {
        "schema_version": EVALUATION_SCHEMA,
        "data": Path(path).name,
        "origin": origin,
        "records": result["records"],
        "draws": result["draws"],
        "severity": card.severity,
        "grade_edges_m": card.grade_edges_m,
        "condemning_limit_m": card.condemning_limit_m,
        "seed": seed,
        "splits": [
            {
                "name": Path(path).stem,
                "text": "machines that the model has not seen",
                **result.get("split", {}),
                "missing": "",
                **result,
            }
        ],
    }


def _judged_split(case: Case, name: str) -> dict[str, Any]:
    text = ""
    try:
        text, train, test = _cut(case, name)
        model = case.model if name == "random" else case.fit(train)
    except (DataError, KeyError) as error:
        return {"name": name, "text": text or SPLITS.get(name, ("",))[0], "missing": str(error)}
    return {
        "name": name,
        "text": text,
        "missing": "",
        "train": {"records": len(train), "draws": len(np.unique(case.groups[train]))},
        **score(
            model,
            case.table,
            test,
            references=case.references,
            background=Background(
                train=case.random_side if name == "random" else case.side(train),
                foreign=case.foreign,
            ),
            seed=case.seed,
        ),
    }


def _cut(case: Case, name: str) -> tuple[str, Index, Index]:
    """What is held out, in words, and the rows of both sides."""
    if name not in SPLITS:
        with DataSet(case.path) as data:
            sides = usable_sides(data, name)
        return sides.text, sides.train, sides.test
    text, cut = SPLITS[name]
    train, test = cut(case)
    check_no_leak(case.groups, train, test)
    return text, train, test


# --- noise ----------------------------------------------------------------------------------------


def _noisy(case: Case) -> list[dict[str, Any]]:
    train, _ = case.random
    return [
        {
            "name": f"noise {level:g} dB",
            "text": f"white noise {level:g} dB beside the as-new rms added to unseen machines",
            "missing": "",
            "train": {"records": len(train), "draws": len(np.unique(case.groups[train]))},
            **score(
                case.model,
                table,
                np.arange(len(table.values)),
                references=_noisy_references(case),
                background=Background(train=case.random_side, foreign=foreign),
                seed=case.seed,
            ),
        }
        for level, (table, foreign) in case.noisy.items()
    ]


def _noisy_references(case: Case) -> Float | None:
    """Of the records that noise is added to; the healthy ones were recorded without it."""
    return None if case.references is None else case.references[case.random[1][:NOISY_RECORDS]]


def noisy_table(case: Case, level: float) -> tuple[FeatureTable, dict[str, Float | str]]:
    """Features of test records of the random split with white noise added.

    Parameters
    ----------
    case : Case
    level : float
        Rms of the noise over the as-new rms of each channel [dB].

    Returns
    -------
    table : FeatureTable
        Of up to :data:`NOISY_RECORDS` records.
    foreign : dict
        Features by the packages of others.
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
    """A recording with white noise added to its vibration channels.

    Parameters
    ----------
    recording : Recording
    deviation : numpy.ndarray [shape=(n_vibration_channels,)]
        Standard deviation of the noise [unit of each channel].
    seed : int or sequence of int
        Of the noise.

    Returns
    -------
    Recording
        Its tacho is as it was.
    """
    signal = recording.signal.astype(np.float64)
    places = [i for i, channel in enumerate(recording.channels) if channel.name != recording.tacho]
    rng = np.random.default_rng(seed)
    signal[places] += deviation[:, None] * rng.standard_normal((len(places), signal.shape[1]))
    return replace(recording, signal=signal.astype(np.float32))


# --- what more training, less wear, less time do --------------------------------------------------


def learning_curve(case: Case) -> list[dict[str, Any]]:
    """Error on the random split's test machines against the number of machines trained on.

    Returns
    -------
    list of dict
        ``machines``, ``mae_share_of_limit``, ``accuracy`` and ``unfamiliar`` with intervals.
    """
    train, test = case.random
    known = np.unique(case.groups[train])
    order = np.random.default_rng(case.seed).permutation(known)
    draws = resampled(case.groups[test], seed=case.seed)
    curve = []
    for count in (*(n for n in CURVE_MACHINES if n < len(order)), len(order)):
        rows = train[np.isin(case.groups[train], order[:count])]
        model = case.model if count == len(order) else case.fit(rows)
        judged, _ = judge_rows(model, case.table, test, case.references)
        found = figures(judged, case.edges, case.limit, draws)
        kept = ("mae_share_of_limit", "mae_all_share_of_limit", "accuracy", "unfamiliar")
        curve.append({"machines": count, **{name: plain(found[name]) for name in kept}})
    return curve


def detectability(case: Case, *, noise: bool = True) -> list[dict[str, Any]]:
    """Smallest wear found in nine of ten cases at one false alarm in twenty, by noise and speed.

    The threshold is set on the estimates of the healthy records of the same condition: the tenth
    of the judged records with the least wear.

    Parameters
    ----------
    case : Case
    noise : bool
        Whether to add noise, too; else by speed alone.

    Returns
    -------
    list of dict
        ``condition``, ``records``, ``healthy_below_m``, ``threshold_m``, ``smallest_m`` and
        ``smallest_share_of_limit`` with intervals; None where no wear is found so often.
    """
    test = case.random[1]
    found, truth = _estimates(case, case.table, test, case.references), case.truth[test]
    rows = [_floor(case, "as recorded", truth, found, case.groups[test])]
    if "speed_hz" in case.table.manifest:
        rows += _floors_by_speed(case, test, truth, found)
    for level, (table, _) in case.noisy.items() if noise else ():
        every = np.arange(len(table.values))
        shaken = _estimates(case, table, every, _noisy_references(case))
        some = test[:NOISY_RECORDS]
        rows.append(
            _floor(case, f"noise {level:g} dB", case.truth[some], shaken, case.groups[some])
        )
    return rows


def _estimates(case: Case, table: FeatureTable, rows: Index, references: Float | None) -> Float:
    notes = notes_of(table.manifest.iloc[rows])
    healthy = None if references is None else references[rows]
    return case.model.predict(table.values[rows], healthy, notes)


def _floors_by_speed(case: Case, test: Index, truth: Float, found: Float) -> list[dict[str, Any]]:
    speed = case.table.manifest["speed_hz"].to_numpy(dtype=float)[test]
    edges = np.quantile(speed, [0, 1 / 3, 2 / 3, 1])
    floors = []
    for low, high in pairwise(edges.tolist()):
        here = (speed >= low) & (speed <= high)
        words = f"speed {low:.3g} to {high:.3g} Hz"
        floors.append(_floor(case, words, truth[here], found[here], case.groups[test][here]))
    return floors


def _floor(
    case: Case, condition: str, truth: Float, found: Float, groups: NDArray[Any]
) -> dict[str, Any]:
    below = float(np.quantile(truth, HEALTHY_SHARE))
    draws = resampled(groups, n=_FLOOR_RESAMPLES, seed=case.seed)
    threshold, smallest = smallest_found(
        truth, found, truth <= below, draws, false_alarm=FALSE_ALARM, detection=DETECTION
    )
    over = ScoreFigure(
        value=smallest.value / case.limit,
        low=smallest.low / case.limit,
        high=smallest.high / case.limit,
    )
    return {
        "condition": condition,
        "records": len(truth),
        "healthy_below_m": below,
        "threshold_m": threshold,
        "smallest_m": plain(smallest),
        "smallest_share_of_limit": plain(over),
    }


def costs(case: Case) -> list[dict[str, Any]]:
    """Milliseconds from a recording to its wear, one recording after another.

    Returns
    -------
    list of dict
        ``name``, ``ms_per_record`` (the least of some, which a busy computer disturbs least) or
        ``missing``. Features and the severity from them, ours and the baselines'; and all that an
        estimate of ours has: quality, familiarity, interval, set and evidence, too.
    """
    recordings = list(case.recordings(case.random[1][:_TIMED_RECORDS]))
    return [
        {"name": OWN, "missing": "", "ms_per_record": _own_ms(case, recordings)},
        {"name": WHOLE, "missing": "", "ms_per_record": _whole_ms(case, recordings)},
        *(_cost(case, each, recordings) for each in BASELINES if each.source in PACKAGES),
    ]


OWN, WHOLE = "wearstate", "wearstate, whole estimate"


def _own_ms(case: Case, recordings: Sequence[Recording]) -> float:
    healthy = None if case.references is None else case.references[case.random[1][:1]]

    def severity(recording: Recording) -> Float:
        return case.model.predict(case.row(recording)[None, :], healthy, [recording.row])

    return _ms(severity, recordings)


def _whole_ms(case: Case, recordings: Sequence[Recording]) -> float:
    healthy = None
    if case.references is not None:
        healthy = Baseline(features=case.references[case.random[1][0]], recordings=1, source="")
    return _ms(lambda recording: case.model.estimate(recording, healthy), recordings)


def _cost(case: Case, rival: Rival, recordings: Sequence[Recording]) -> dict[str, Any]:
    train = case.random_side
    features = train.features.get(rival.source, absence(rival.source) or LEFT_OUT)
    if isinstance(features, str) or rival.source not in case.transforms:
        why = features if isinstance(features, str) else LEFT_OUT
        return {"name": rival.name, "missing": why, "ms_per_record": None}
    transform = case.transforms[rival.source]
    fitted = train.fitted.get(rival.name, (None, 0))[0]
    if fitted is None:  # any configuration predicts as fast
        first = replace(rival, configurations=lambda columns: rival.configurations(columns)[:1])
        fitted, _ = choose(first, features, train.severity, train.groups, case.edges)
    speed = features[:1, transform(recordings[:1]).shape[1] :]
    seconds = _ms(lambda one: fitted(np.hstack([transform([one]), speed])), recordings)
    return {"name": rival.name, "missing": "", "ms_per_record": seconds}


def _ms(row: Callable[[Recording], Any], recordings: Sequence[Recording]) -> float:
    found = []
    for recording in recordings:
        start = perf_counter()
        row(recording)
        found.append(perf_counter() - start)
    return 1e3 * min(found)
