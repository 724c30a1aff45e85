"""Fit a wear model to a labelled data set, with its uncertainty and its sense of the familiar."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ... import __version__
from ...datasets.file.attributes import Attributes
from ...datasets.file.machines import machine_origin
from ...datasets.file.record import DataSet
from ...datasets.file.views import MARK, JoinedSet, layout_card
from ...datasets.recipe.load import recorded_scene
from ...datasets.recipe.severities import wear_limits
from ...datasets.recipe.text import name_in
from ...datasets.split.rules import check_no_leak, group_folds, group_split
from ...datasets.split.stored import usable_sides
from ...sim.output.recording import DataError
from ...sim.output.sensor import Channel
from ..feature_rows.feature_choice import (
    Candidates,
    Selection,
    candidates_of,
    choice_card,
    select_set,
    words_of,
)
from ..feature_rows.feature_table import (
    USUAL,
    FeatureSelection,
    FeatureTable,
    Progress,
    confounders_in,
    feature_table,
    regimes_in,
)
from ..feature_rows.model_card import LayoutCard, ModelCard
from ..feature_rows.noted import NOTED, noted_ranges, notes_of
from ..feature_rows.physical import physical_rows
from ..healthy_reference.healthy import references, refuse_strangers
from ..healthy_reference.transfer_reference import healthy_transfer
from ..learning.grades import grades_of
from ..learning.regressions import BUDGET_MS
from .bundle import checked
from .estimate import WearModel
from .learn import Learnt, learn, refuse_no_wear
from .strangers import strangers_in
from .training_rows import FOLDS, Strangers, TrainingRows

Float = NDArray[np.float64]

_FEWEST_GROUPS = 10  # two a fold, so that a fold's error is no accident


def train_model(
    path: str | Path,
    *,
    target: str | None = None,
    held_out: float = 0.25,
    split: str | None = None,
    seed: int = 0,
    jobs: int = 1,
    budget_ms: float | None = None,
    baseline: str | Path | None = None,
    refuse: Sequence[str | Path] = (),
    choices: Sequence[FeatureSelection] = (USUAL,),
    progress: Progress | None = None,
) -> tuple[WearModel, FeatureTable, NDArray[np.intp]]:
    """Fit a wear model on a data set's training groups.

    Parameters
    ----------
    path : str or Path
        Labelled data set. Of its manifest, the target, the groups, the labels of other faults and
        the conditions of :data:`~.feature_rows.noted.NOTED` decide the fit.
    target : str, optional
        Severity column to train for; the first one of the data set unless given.
    held_out : float
        Share of the groups (machine draws) kept out of every fit, 0 <= share < 1.
    split : str, optional
        A split that the data set's file holds, in place of `held_out`: only its training side is
        learnt from, its test side is what is held out. The card has its name and hash.
    seed : int
        Seed of the split, the folds and the trees.
    jobs : int
        Worker processes for the features.
    budget_ms : float, optional
        Time that one prediction may take, without the features [ms].
    baseline : str or Path, optional
        Data set of healthy records of the same machines, by identity (recipe, seed and number, or
        declared name): the model is then referenced, and needs healthy recordings of every machine
        it is asked about.
    refuse : sequence of str or Path
        Data sets of the same channels that the model must refuse: regimes of lubrication, faults
        or machines that it does not learn to grade.
    choices : sequence of FeatureSelection
        Sets of features to choose from, all of the same views; records that lack a view are left
        out.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    model : WearModel
        Severity, out-of-fold behaviour, familiarity, other faults, card.
    table : FeatureTable
        All usable records, with the features of the model.
    test : numpy.ndarray
        Rows of `table` that were held out.

    Raises
    ------
    DataError
        No such severity column or split, no limits, too few machine draws, machines unknown or
        without a healthy record, a budget that no model keeps, or recordings to refuse that have
        other channels or are not distinguished from the rest.
    """
    with DataSet(path) as data:
        head, draws = data.attributes, data.manifest["group"].nunique()
        sides = None if split is None else usable_sides(data, split)
    _aim(head, target, path)  # refused before the features are computed
    _check_draws(draws, path)
    if sides is None:
        _check_held_out(draws, held_out, path)
    views = choices[0].views
    if baseline is not None:
        if views:
            raise DataError("join and baseline must not both be given; train cold to join views")
        refuse_strangers(path, baseline)
    known = healthy_transfer(baseline, choices)
    if refuse and (views or known is not None):
        raise DataError(
            "refuse needs features of one recording by itself: give no join, and no features held "
            "against a healthy transfer function"
        )
    candidates = candidates_of(path, choices, known)
    ways: dict[str, Any] = {"choice": candidates.whole, "jobs": jobs, "progress": progress}
    table = feature_table(path, healthy=known, **ways)
    healthy, count = None, 0
    if baseline is not None:
        healthy, count = references(table, path, baseline, **ways)
    groups = table.manifest["group"].to_numpy()
    whole = np.flatnonzero(table.complete)
    if sides is None:
        train, test = _split(groups, held_out, seed, path)
        check_no_leak(groups, train, test)
    else:
        train, test = sides.train, sides.test  # leaks are refused where it was read
        held_out = len(np.unique(groups[test])) / len(np.unique(groups))
        _check_kept(len(np.unique(groups[train])), draws, f"split {sides.name}", path)
    strangers = strangers_in(
        refuse, head, candidates.whole, table.names, jobs=jobs, progress=progress
    )
    train, test = np.intersect1d(train, whole), np.intersect1d(test, whole)
    _check_kept(len(np.unique(groups[train])), draws, "what lacks no view", path)
    model = fit_model(
        table,
        train,
        head,
        target=target,
        references=healthy,
        held_out=held_out,
        seed=seed,
        budget_ms=budget_ms,
        candidates=candidates,
        strangers=strangers,
        path=path,
    )
    more: dict[str, Any] = {}
    if sides is not None:
        side = {"split": sides.name, "split_sha256": sides.sha256}
        more["trained_on"] = model.card.trained_on.model_copy(update=side)
    if healthy is not None:
        more["baseline_records"] = count
    with JoinedSet(Path(path), views) as data:
        more["views"] = {
            name: LayoutCard.model_validate(layout_card(one)) for name, one in data.layouts.items()
        }
    model = replace(model, card=model.card.model_copy(update=more))
    return model, table.named(model.names), test


def fit_model(
    table: FeatureTable,
    train: NDArray[np.intp],
    head: Attributes,
    *,
    target: str | None = None,
    references: Float | None = None,
    held_out: float = 0.0,
    seed: int = 0,
    budget_ms: float | None = None,
    choice: FeatureSelection = USUAL,
    candidates: Candidates | None = None,
    strangers: tuple[Strangers, ...] = (),
    path: str | Path = "the data set",
) -> WearModel:
    """Fit a wear model on some rows of a feature table.

    Parameters
    ----------
    table : FeatureTable
    train : numpy.ndarray
        Rows that it may learn from.
    head : Attributes
        Attributes of the data set.
    target, held_out, seed, budget_ms
        As of :func:`train_model`; the share held out is for the card only.
    references : numpy.ndarray [shape=(n_records, n_features)], optional
        Healthy row of each record's machine: the model is then referenced.
    choice : Choice
        What the table is made of.
    candidates : Candidates, optional
        Sets among the columns of the table, of which one is chosen; all of `choice` by default.
    strangers : tuple of Strangers
        Recordings to refuse, with the columns of the table.
    path : str or Path
        Name of the data set, for messages.

    Returns
    -------
    WearModel

    Raises
    ------
    DataError
        As of :func:`train_model`.
    """
    aim = _aim(head, target, path)
    if candidates is None:
        columns = np.arange(len(table.names), dtype=np.intp)
        candidates = Candidates(choices=(choice,), columns=(columns,), whole=choice)
    noted = table.manifest.iloc[train]
    whole = TrainingRows(
        conditions=tuple(c["name"] for c in _noted(noted)),
        notes=notes_of(noted),
        names=table.names,
        rows=table.values[train],
        baseline=None if references is None else references[train],
        severity=table.manifest[aim.column].to_numpy(dtype=float)[train],
        groups=table.manifest["group"].to_numpy()[train],
        faults={
            name: here[train]
            for name, here in (confounders_in(table.manifest) | regimes_in(table.manifest)).items()
        },
        strangers=strangers,
    )
    candidate_rows = [whole.part(columns) for columns in candidates.columns]
    for each in candidate_rows:
        _refuse_undefined(each, path)
    selection = _selection(candidate_rows, seed)
    training = candidate_rows[selection.chosen]
    learnt = learn(
        training,
        seed=seed,
        budget_ms=budget_ms,
        selection=selection,
        among=candidate_rows,
        as_new=aim.edges[0],
    )
    mine = candidates.part(table, selection.chosen)
    card = _card(head, aim, mine, train, held_out, seed) | _model_card(learnt, budget_ms)
    card["healthy_features"] = _healthy(training, grades_of(training.severity, aim.edges))
    card["feature_choice"] = choice_card(candidates.choices[selection.chosen]).table() | {
        "candidates": [
            {"name": words_of(each), "values": len(columns), "line_mae_m": error}
            for each, columns, error in zip(
                candidates.choices, candidates.columns, selection.errors, strict=False
            )
        ]
    }
    if references is not None:
        card["mode"] = "referenced"
    shown = {int(crc) for each in strangers for crc in each.signals}
    card["trained_on"]["training_signals"] = sorted(
        shown.union(card["trained_on"]["training_signals"])
    )
    return _model(learnt, checked(ModelCard, json.loads(json.dumps(card)), path, "card.json"))


def _selection(candidate_rows: Sequence["TrainingRows"], seed: int) -> Selection:
    """Choose among sets of features; a single one is not judged."""
    if len(candidate_rows) == 1:
        return Selection(chosen=0, errors=(), by_fold=(0,) * FOLDS)
    first = candidate_rows[0]
    refuse_no_wear(first.severity)
    folds = group_folds(first.groups, n=FOLDS, seed=seed)
    inputs = [training.inputs for training in candidate_rows]
    return select_set(inputs, first.severity, first.groups, folds, seed=seed)


def _refuse_undefined(training: "TrainingRows", path: str | Path) -> None:
    """Features that some records leave undefined: the coherence of a single blow."""
    lost = np.flatnonzero(~np.isfinite(training.inputs).all(axis=0)) % len(training.names)
    if lost.size:
        names = [training.names[i] for i in np.unique(lost)]
        raise DataError(
            f"{path}: {len(names)} features are undefined in some records, must be 0, as "
            f"{names[0]}; strike more often, or leave them out: wearstate train --features"
        )
    if physical_rows(training.names, training.rows[:1]).shape[1] == 0:
        raise DataError(
            f"{path}: its {len(training.names)} features are levels alone, which do not "
            "separate familiar machines from strange ones; add others: wearstate train --features"
        )


@dataclass(frozen=True, kw_only=True)
class _Aim:
    """The severity to train for, with its wear limits [m]."""

    column: str
    edges: tuple[float, ...]
    condemning: float
    source: str


def _aim(head: Attributes, target: str | None, path: str | Path) -> _Aim:
    if target is not None and target not in head.severities:
        raise DataError(
            f"{path}: target = {target!r} must be one of its severities "
            f"{', '.join(head.severities) or '(it has none)'}; choose another"
        )
    if not head.severities:
        raise DataError(
            f"{path}: it has no severity, must have one to train for; label the wear in metres on "
            "import, or generate it from a recipe"
        )
    if not head.grade_edges:
        raise DataError(
            f"{path}: {head.severities[0]} has 0 grade edges, must have 3 to be graded; give its "
            "scene wear limits, or import with --limits"
        )
    if target in (None, head.severities[0]):
        return _Aim(
            column=head.severities[0],
            edges=head.grade_edges,
            condemning=head.condemning_limit,
            source=head.limit_source,
        )
    return _further_aim(head, str(target), path)


def _further_aim(head: Attributes, target: str, path: str | Path) -> _Aim:
    """A file holds the limits of its first severity only; those of others are the scene's."""
    scene = recorded_scene(head.scene, head.recipe, head.overrides) if head.scene else None
    limits = None if scene is None else wear_limits(scene, target)
    if limits is None:
        raise DataError(
            f"{path}: {target} has 0 grade edges, must have 3 to be graded; give the scene its "
            f"wear limits, or train for {head.severities[0]}"
        )
    return _Aim(
        column=target,
        edges=limits.grade_edges,
        condemning=limits.condemning,
        source=limits.source,
    )


def _check_draws(draws: int, path: str | Path) -> None:
    if draws < _FEWEST_GROUPS:
        raise DataError(
            f"{path}: {draws} machine draws, must be >= {_FEWEST_GROUPS}; generate more records"
        )


def _split(
    groups: NDArray[Any], held_out: float, seed: int, path: str | Path
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Training and test rows; enough draws for the folds must be left to train on."""
    _check_held_out(len(np.unique(groups)), held_out, path)
    if held_out == 0:
        return np.arange(len(groups)), np.arange(0)
    return group_split(groups, test_fraction=held_out, seed=seed)


def _check_held_out(draws: int, held_out: float, path: str | Path) -> None:
    if not 0 <= held_out < 1:
        raise DataError(f"held_out = {held_out} must be >= 0 and < 1; try 0.25")
    kept = draws - max(1, round(held_out * draws)) if held_out > 0 else draws
    _check_kept(kept, draws, f"held_out = {held_out}", path)


def _check_kept(kept: int, draws: int, what: str, path: str | Path) -> None:
    if kept < FOLDS:
        raise DataError(
            f"{path}: {what} leaves {kept} of {draws} usable machine draws to train on, must be "
            f">= {FOLDS}; hold out less or generate more records"
        )


def _model(learnt: Learnt, card: ModelCard) -> WearModel:
    return WearModel(
        blind=learnt.blind,
        informed=learnt.informed,
        familiarity=learnt.familiarity,
        levels=learnt.levels,
        heads=tuple(head for head, _ in learnt.heads),
        strangers=tuple(head for head, _ in learnt.strangers),
        card=card,
    )


def draw_identity(head: Attributes) -> str:
    """Hash of what decides the machine draws: equal groups of equal identity are one machine.

    Recipes draw machines from their name (or that of the recipe whose machines they take) and the
    data set's seed alone, so their texts, record numbers and comments do not make other machines.
    Empty for a set that no recipe made.
    """
    origin = machine_origin(head.recipe, head.seed)
    return hashlib.sha256(json.dumps(origin).encode()).hexdigest() if origin else ""


def _card(
    head: Attributes,
    aim: _Aim,
    table: FeatureTable,
    train: NDArray[np.intp],
    held_out: float,
    seed: int,
) -> dict[str, Any]:
    """Everything a reader of the model must know, as JSON."""
    manifest = table.manifest.iloc[train]
    severity = manifest[aim.column].to_numpy(dtype=float)
    return {
        "created_by": f"wearstate {__version__}",
        "origin": head.origin,
        "trained_on": {
            "records": len(train),
            "draws": int(manifest["group"].nunique()),
            "draw_identity": draw_identity(head),
            "held_out_share": held_out,
            "split_seed": seed,
            "split": "",
            "split_sha256": "",
            "training_groups": sorted({int(g) for g in manifest["group"]}),
            "training_signals": sorted({int(crc) for crc in manifest["signal_crc32"]}),
            "scene": name_in(head.scene),
            "recipe": name_in(head.recipe),
        },
        "severity": aim.column,
        "severity_range_m": [float(severity.min()), float(severity.max())],
        "grade_edges_m": list(aim.edges),
        "condemning_limit_m": aim.condemning,
        "limit_source": aim.source,
        "sample_rate_hz": head.sample_rate,
        "channels": [asdict(channel) for channel in head.channels],
        "tacho": head.tacho,
        "pulses_per_revolution": head.pulses_per_revolution,
        "features": list(table.names),
        "conditions": _conditions(table, train, head.channels),
        "mode": "cold",
        "baseline_records": 0,
    }


def _conditions(
    table: FeatureTable, train: NDArray[np.intp], channels: Sequence[Channel]
) -> list[dict[str, Any]]:
    """Trained ranges of conditions from the signal, and of those noted with it."""
    units = {f"{channel.name}.rms": channel.unit for channel in channels}
    columns = [
        {"name": name, "feature": name, "unit": units.get(name, _unit_in(name))}
        | _range(table.values[train, i])
        for i, name in enumerate(table.names)
        if name.rpartition(MARK)[2] == "shaft.speed_hz" or name.endswith(".rms")
    ]
    return columns + _noted(table.manifest.iloc[train])


def _unit_in(name: str) -> str:
    """Unit of a feature if its name ends with it; that of a view's channel is not known here."""
    return "Hz" if name.endswith("hz") else ""


def _noted(manifest: pd.DataFrame) -> list[dict[str, Any]]:
    """Conditions that vary and do not follow from the vibration, with their ranges."""
    return [
        {"name": name, "feature": "", "unit": NOTED[name].unit, "low": low, "high": high}
        for name, (low, high) in noted_ranges(manifest).items()
    ]


def _range(values: Float) -> dict[str, float]:
    return {"low": float(values.min()), "high": float(values.max())}


def _model_card(learnt: Learnt, budget_ms: float | None) -> dict[str, Any]:
    """What was tried, what was chosen, and how it errs."""
    severity = learnt.severity
    return {
        "budget_ms": BUDGET_MS if budget_ms is None else budget_ms,
        "model": {
            "chosen": severity.chosen,
            "members": severity.blend.members,
            "nested_mae_m": learnt.blind.error,
            "informed_mae_m": None if learnt.informed is None else learnt.informed.error,
            "candidates": [
                {
                    "name": option.name,
                    "cost_ms": option.cost_ms,
                    "mae_m": option.error,
                    "on_front": option.on_front,
                }
                for option in severity.options
            ],
        },
        "confounders": [rates for _, rates in learnt.heads],
    } | (
        {"strangers": [rates.table() for _, rates in learnt.strangers]} if learnt.strangers else {}
    )


def _healthy(training: TrainingRows, grade: NDArray[Any]) -> dict[str, list[float]]:
    """Mean and spread of the features of as-new machines, the reference of the evidence.

    For a referenced model the spread is that about each machine's own baseline.
    """
    kept = grade == 0 if (grade == 0).any() else np.ones(len(grade), dtype=bool)
    rows = training.rows[kept]
    apart = rows if training.baseline is None else rows - training.baseline[kept]
    return {"mean": rows.mean(axis=0).tolist(), "spread": apart.std(axis=0).tolist()}
