"""Evaluation of a model on every split, with learning curve, detectability and cost."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.record import DataSet
from ...datasets.split.rules import check_no_leak
from ...datasets.split.stored import usable_sides
from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_table import FeatureTable
from ..feature_rows.noted import notes_of
from ..healthy_reference.healthy import Baseline
from ..learning.scores import ScoreFigure, figures, plain, resampled, smallest_found
from ..wear_model.estimate import WearModel
from .baselines import BASELINES, BaselineMethod, choose
from .evaluate import Background, judge_rows, score
from .foreign_features import LEFT_OUT, PACKAGES, absence
from .splits import ALL_SPLITS, HEALTHY_SHARE, NOISE, NOISY_RECORDS, SPLITS, Case, Say

Float = NDArray[np.float64]
Index = NDArray[np.intp]

EVALUATION_SCHEMA = 1

CURVE_MACHINES = (50, 100, 200, 400)
"""Numbers of training machines along the learning curve, before that of all machines."""

FALSE_ALARM, DETECTION = 0.05, 0.9

_TIMED_RECORDS = 8
_FLOOR_RESAMPLES = 300  # each is a fit: enough for the 2.5 % quantiles

OWN, WHOLE = "wearstate", "wearstate, whole estimate"


# --- the protocol ---------------------------------------------------------------------------------


def evaluate_splits(
    case: Case, names: Sequence[str] = ALL_SPLITS, *, say: Say | None = None
) -> dict[str, Any]:
    """Train and evaluate on each split, with baselines, learning curve and detectability.

    Parameters
    ----------
    case : Case
        From :func:`case_of`.
    names : sequence of str
        Names from :data:`ALL_SPLITS`, or of splits stored in the data set.
    say : callable, optional
        Called with a line for each stage.

    Returns
    -------
    dict
        Ready for JSON: ``schema_version``, the data set's name, size, limits and seed; ``splits``,
        each as :func:`wearstate.diagnose.evaluation.evaluate.score` with ``name``, ``text``,
        ``train`` and ``missing`` (why it could not be made, else empty); and, if the random split
        is among the names, ``learning_curve``, ``detectability`` and ``cost``.

    Raises
    ------
    DataError
        A name is unknown, or the data set has too few machines.
    """
    known = (*ALL_SPLITS, *case.stored)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise DataError(f"held-out part {unknown[0]!r} must be one of {', '.join(known)}, or all")
    report = say or (lambda _text: None)
    splits: list[dict[str, Any]] = []
    for name in names:
        report(f"split {name}")
        splits += _noisy(case) if name == NOISE else [_judged_split(case, name)]
    extra: dict[str, Any] = {}
    if "random" in names:
        report("learning curve, detectability, cost")
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
    """Evaluation of a finished model in the form of :func:`evaluate_splits`, for page and picture.

    Parameters
    ----------
    result : mapping
        From :func:`wearstate.diagnose.evaluation.evaluate.evaluate_model`.
    model : WearModel
    path : str or Path
        Data set of the evaluation.
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
    """Description of the held-out part, and the rows of both sides."""
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
            "text": f"white noise at {level:g} dB re as-new rms added to unseen machines",
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
    """Healthy features of the records with added noise; they were recorded without it."""
    return None if case.references is None else case.references[case.random[1][:NOISY_RECORDS]]


# --- learning curve, detectability, cost ----------------------------------------------------------


def learning_curve(case: Case) -> list[dict[str, Any]]:
    """Error on the random split's test machines against the number of training machines.

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
    """Smallest wear detected in 9 of 10 cases at one false alarm in 20, by noise and speed.

    The threshold is set on the estimates of the healthy records of the same condition, the tenth of
    the judged records with the least wear.

    Parameters
    ----------
    case : Case
    noise : bool
        Whether to include added noise; otherwise by speed alone.

    Returns
    -------
    list of dict
        ``condition``, ``records``, ``healthy_below_m``, ``threshold_m``, ``smallest_m`` and
        ``smallest_share_of_limit`` with intervals; None if no wear is detected so often.
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
        part = (speed >= low) & (speed <= high)
        words = f"speed {low:.3g} to {high:.3g} Hz"
        floors.append(_floor(case, words, truth[part], found[part], case.groups[test][part]))
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
    """Time from a recording to its wear, for single recordings [ms].

    Returns
    -------
    list of dict
        ``name``, ``ms_per_record`` (shortest of several, which is least affected by load) or
        ``missing``. Features and severity, of the model and the baselines; also the whole estimate
        of the model, with quality, familiarity, interval, set and evidence.
    """
    recordings = list(case.recordings(case.random[1][:_TIMED_RECORDS]))
    return [
        {"name": OWN, "missing": "", "ms_per_record": _own_ms(case, recordings)},
        {"name": WHOLE, "missing": "", "ms_per_record": _whole_ms(case, recordings)},
        *(_cost(case, each, recordings) for each in BASELINES if each.source in PACKAGES),
    ]


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


def _cost(case: Case, rival: BaselineMethod, recordings: Sequence[Recording]) -> dict[str, Any]:
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
