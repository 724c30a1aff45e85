"""Fit a wear model to a labelled data set, with its uncertainty and its sense of the familiar."""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ... import __version__
from ...datasets.file.machines import machine_origin
from ...datasets.file.record import Attributes, DataSet
from ...datasets.file.views import MARK, JoinedSet, layout_card
from ...datasets.recipe.recipe import recorded_scene, wear_limits
from ...datasets.split.rules import check_no_leak, group_folds, group_split
from ...datasets.split.stored import usable_sides
from ...sim.output.recording import DataError
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
    is_regime,
    regimes_in,
)
from ..feature_rows.healthy import referenced_rows, references, refuse_strangers
from ..feature_rows.noted import NOTED, doubted, noted_values, notes_of, strayed
from ..feature_rows.physical import moved_rows, physical_rows
from ..feature_rows.quality import Levels, fit_levels
from ..feature_rows.transfer_reference import healthy_transfer
from ..learning.conformal import IntervalCalibration, fit_scale, scale_inputs
from ..learning.detection import visible_from
from ..learning.experts import FEWEST_RECORDS, Experts, better_of, fit_experts, regime_shares
from ..learning.grades import grades_of
from ..learning.heads import PRESENT, FittedHead, Head, fit_head
from ..learning.regressions import (
    BUDGET_MS,
    CANDIDATES,
    WITNESSES,
    Blend,
    Fitted,
    Folds,
    RegressionCandidate,
    fit_blend,
    fit_line,
)
from ..learning.severity import Estimator
from .estimate import WearModel
from .noise_floor import usual_excess
from .novelty import REACH, Familiarity, fit_familiarity
from .quietness import CAUTIONED_SHARE, REFUSED_SHARE, most_lacking

Float = NDArray[np.float64]

_FOLDS = 5
_FEWEST_GROUPS = 10  # two a fold, so that a fold's error is no accident
_FEWEST_FAULTS = 20  # records with and without a fault, for an error rate to within a tenth
_RARE = 0.99  # of the records: as far, or with as many features out of range, as 1 in 100 is
_WORTH = 0.1  # of the error: conditions that bring less are not worth a person's asking

SeverityFit = Fitted[Blend] | Fitted[Experts]


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
        Of the split, the folds and the trees.
    jobs : int
        Worker processes for the features.
    budget_ms : float, optional
        Time that one prediction may take, beside the features [ms].
    baseline : str or Path, optional
        Data set of healthy records of the same machines, by identity (recipe, seed and number, or
        declared name): the model is then referenced, and needs healthy recordings of every machine
        it is asked about.
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
        without a healthy record, or a budget that no model keeps.
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
        path=path,
    )
    if sides is not None:
        model.card["trained_on"].update(split=sides.name, split_sha256=sides.sha256)
    if healthy is not None:
        model.card.update(baseline_records=count)
    with JoinedSet(Path(path), views) as data:
        model.card["views"] = {name: layout_card(one) for name, one in data.layouts.items()}
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
    path: str | Path = "the data set",
) -> WearModel:
    """Fit a wear model on some rows of a feature table.

    Parameters
    ----------
    table : FeatureTable
    train : numpy.ndarray
        Rows that it may learn from.
    head : Attributes
        Of the data set.
    target, held_out, seed, budget_ms
        As of :func:`train_model`; the share held out is for the card only.
    references : numpy.ndarray [shape=(n_records, n_features)], optional
        Healthy row of each record's machine: the model is then referenced.
    choice : Choice
        What the table is made of.
    candidates : Candidates, optional
        Sets among the columns of the table, of which one is chosen; all of `choice` by default.
    path : str or Path
        Of the data set, for messages.

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
    card["feature_choice"] = choice_card(candidates.choices[selection.chosen]) | {
        "candidates": [
            {"name": words_of(each), "values": len(columns), "line_mae_m": error}
            for each, columns, error in zip(
                candidates.choices, candidates.columns, selection.errors, strict=False
            )
        ]
    }
    if references is not None:
        card["mode"] = "referenced"
    return _model(learnt, card)


def _selection(candidate_rows: Sequence["TrainingRows"], seed: int) -> Selection:
    """Of one set there is nothing to choose."""
    if len(candidate_rows) == 1:
        return Selection(chosen=0, errors=(), by_fold=(0,) * _FOLDS)
    first = candidate_rows[0]
    _refuse_no_wear(first.severity)
    folds = group_folds(first.groups, n=_FOLDS, seed=seed)
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
            f"{path}: its {len(training.names)} features are levels alone, which tell no familiar "
            "machine from a strange one; add others: wearstate train --features"
        )


def _refuse_no_wear(severity: Float) -> None:
    if not (severity > 0).all():
        raise DataError(
            f"severity = {severity.min():g} m must be > 0 in every record; label them all"
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
    if kept < _FOLDS:
        raise DataError(
            f"{path}: {what} leaves {kept} of {draws} usable machine draws to train on, must be "
            f">= {_FOLDS}; hold out less or generate more records"
        )


@dataclass(frozen=True, kw_only=True)
class TrainingRows:
    """What a model learns from.

    Attributes
    ----------
    names : tuple of str
        Of the features.
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
        What was noted beside each record; of no matter without conditions.
    faults : dict
        Name -> presence [shape=(n,)] of each fault beside the wear.
    """

    names: tuple[str, ...]
    rows: Float
    baseline: Float | None
    severity: Float
    groups: NDArray[np.intp]
    conditions: tuple[str, ...] = ()
    notes: Sequence[Mapping[str, Any]] = ()
    faults: dict[str, NDArray[np.bool_]] = field(default_factory=dict)

    @property
    def inputs(self) -> Float:
        """What the severity is told from."""
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
        )


@dataclass(frozen=True, kw_only=True)
class Learnt:
    """All that is fitted, with its behaviour on groups that it had not seen.

    Attributes
    ----------
    severity : Fitted
        By the features alone.
    blind : Estimator
        The same, with its uncertainty.
    informed : Estimator or None
        By the features and the noted conditions; None where these tell no more.
    familiarity : Familiarity
    levels : Levels
    heads : tuple of (Head, dict)
        With their error rates, for the card.
    """

    severity: SeverityFit
    blind: Estimator
    informed: Estimator | None
    familiarity: Familiarity
    levels: Levels
    heads: tuple[tuple[Head, dict[str, Any]], ...]


def learn(
    training: TrainingRows,
    *,
    seed: int = 0,
    budget_ms: float | None = None,
    selection: Selection | None = None,
    among: Sequence[TrainingRows] = (),
    as_new: float | None = None,
) -> Learnt:
    """Fit everything, by folds of whole groups.

    Parameters
    ----------
    training : TrainingRows
    seed : int
        Of the folds and the trees.
    budget_ms : float, optional
        Of :func:`wearstate.diagnose.learning.regressions.fit_blend`.
    selection : Selection, optional
        How the features were chosen: the estimates of a fold are then those of the set that its
        training records ask for, so that the calibration knows what the choice costs.
    among : sequence of TrainingRows
        The sets that it was chosen from.
    as_new : float, optional
        Severity up to which a machine counts as new [m], to tell from which wear on each regime
        shows it.

    Returns
    -------
    Learnt

    Raises
    ------
    DataError
        A severity is not positive, or no model is within the budget.
    """
    _refuse_no_wear(training.severity)
    folds = group_folds(training.groups, n=_FOLDS, seed=seed)
    other = training.moved(seed)
    heads = _heads(training, other, folds, seed)
    try:
        severity = _severity(training, training.inputs, other.inputs, folds, heads, seed, budget_ms)
        others: dict[int, Fitted[Blend]] = {}
        if selection is not None:
            others = _fits_of_others(selection, among, folds, seed, budget_ms)
    except ValueError as error:
        raise DataError(str(error)) from error
    if selection is not None:
        estimate = severity.estimate.copy()
        for place, (_, left) in zip(selection.by_fold, folds, strict=True):
            if place in others:
                estimate[left] = others[place].estimate[left]
        severity = replace(severity, estimate=estimate)
    (distance, far), limits = _out_of_fold_distances(training, other, folds)
    apart = distance, far
    return Learnt(
        severity=severity,
        blind=_estimator(training, training.inputs, severity, apart, heads, seed),
        informed=_informed(training, other, severity, folds, apart, heads, seed),
        familiarity=fit_familiarity(training.names, training.rows, training.groups, **limits),
        levels=fit_levels(training.names, training.rows, folds),
        heads=tuple((one.head, _rates(one, training, severity.estimate, as_new)) for one in heads),
    )


def _heads(
    training: TrainingRows, other: TrainingRows, folds: Folds, seed: int
) -> list[FittedHead]:
    """What tells each fault and regime that enough records have, and enough have not.

    A line tells a regime from hundreds of features as well as trees do: 96 % of 2,000 pumps.
    """
    lines = [each for each in CANDIDATES if each.name in WITNESSES]
    return [
        fit_head(
            name,
            training.rows,
            here,
            folds,
            seed=seed,
            candidates=lines if is_regime(name) else CANDIDATES,
            shifted=other.rows,
        )
        for name, here in training.faults.items()
        if min(here.sum(), (~here).sum()) >= _FEWEST_FAULTS
    ]


def _severity(
    training: TrainingRows,
    inputs: Float,
    moved: Float,
    folds: Folds,
    heads: Sequence[FittedHead],
    seed: int,
    budget_ms: float | None,
    candidates: Sequence[RegressionCandidate] = CANDIDATES,
) -> SeverityFit:
    """One fit for all records, or one for each regime where that errs less."""
    limit = BUDGET_MS if budget_ms is None else budget_ms

    def fit(records: NDArray[np.intp] | None, parts: int) -> Fitted[Blend]:
        return fit_blend(
            inputs,
            training.severity,
            folds,
            seed=seed,
            budget_ms=limit / parts,
            candidates=candidates,
            shifted=moved,
            learnt_from=records,
        )

    one = fit(None, 1)
    gates = _gates(training, heads)
    if not gates or limit / len(gates) < min(each.cost_ms for each in candidates):
        return one
    present = [training.faults[gate.head.name] for gate in gates]
    first, features = training.first_feature, len(training.names)
    experts = fit_experts(gates, present, training.severity, fit, first=first, features=features)
    return better_of(one, experts, limit)


def _gates(training: TrainingRows, heads: Sequence[FittedHead]) -> list[FittedHead]:
    """Heads that tell the regimes, where each has records enough; else none."""
    gates = [one for one in heads if is_regime(one.head.name)]
    records = [int(here.sum()) for name, here in training.faults.items() if is_regime(name)]
    return gates if records and min(records) >= FEWEST_RECORDS else []


def _estimator(
    training: TrainingRows,
    inputs: Float,
    fitted: SeverityFit,
    apart: tuple[Float, Float],
    heads: Sequence[FittedHead],
    seed: int,
) -> Estimator:
    """A fit with its uncertainty, from how it did on machines that it had not seen."""
    distance, far = apart
    gates = _gates(training, heads) if isinstance(fitted.blend, Experts) else []
    usual, there = np.empty((2, len(training.rows), 0))
    if gates:
        usual = regime_shares([gate.probability for gate in gates])
        there = regime_shares([gate.shifted for gate in gates])
    sizes = scale_inputs(fitted.estimate, distance, fitted.disagreement, usual)
    strange = scale_inputs(fitted.shifted_estimate, far, fitted.shifted_disagreement, there)
    scale = fit_scale(sizes, np.log(training.severity / fitted.estimate))

    def calibration(estimate: Float, sizes: Float, distance: Float) -> IntervalCalibration:
        return IntervalCalibration(
            estimate=estimate,
            truth=training.severity,
            scale=scale.predict(sizes),
            distance=distance,
            group=training.groups,
        )

    return Estimator(
        severity=fitted.blend,
        witness=fit_line(inputs, training.severity, fitted.options, seed=seed),
        scale=scale,
        calibration=calibration(fitted.estimate, sizes, distance),
        shifted=calibration(fitted.shifted_estimate, strange, far),
    )


def _informed(
    training: TrainingRows,
    other: TrainingRows,
    blind: SeverityFit,
    folds: Folds,
    apart: tuple[Float, Float],
    heads: Sequence[FittedHead],
    seed: int,
) -> Estimator | None:
    """The kinds of parts that do well without the conditions, fitted again with them.

    They are as uncertain as people know them. None where they are not worth the asking.
    """
    if not training.conditions:
        return None
    noted = noted_values(training.conditions, training.notes)
    if not np.isfinite(noted).all():
        return None
    noted = doubted(training.conditions, noted, seed)
    inputs = np.hstack([training.inputs, noted])
    moved = np.hstack([other.inputs, strayed(training.conditions, noted, seed, REACH)])
    kept = {*blind.blend.names, *WITNESSES}
    kinds = [each for each in CANDIDATES if each.name in kept]
    fitted = _severity(training, inputs, moved, folds, heads, seed, None, kinds)
    errors = [np.abs(each.estimate - training.severity).mean() for each in (fitted, blind)]
    if errors[0] > (1 - _WORTH) * errors[1]:
        return None
    return _estimator(training, inputs, fitted, apart, heads, seed)


def _fits_of_others(
    selection: Selection,
    among: Sequence[TrainingRows],
    folds: Folds,
    seed: int,
    budget_ms: float | None,
) -> dict[int, Fitted[Blend]]:
    """Fits on the sets that some fold asks for and all records do not."""
    places = sorted(set(selection.by_fold) - {selection.chosen})
    return {
        place: fit_blend(
            among[place].inputs, among[place].severity, folds, seed=seed, budget_ms=budget_ms
        )
        for place in places
    }


def _out_of_fold_distances(
    training: TrainingRows, other: TrainingRows, folds: Folds
) -> tuple[Float, dict[str, float]]:
    """Novelty distances of records, as they are and moved, from clouds without their machine draw.

    And the weight of the share outside the ranges, which makes its rare values as far as those of
    the distance itself: of both together no more are refused than of one. And how far peaks may
    be below the usual ones, and noise floors above them.
    """
    names = training.names
    apart, outside = np.empty((2, 2, len(training.rows)))
    lacking, noise = np.empty((2, len(training.rows)))
    for train, test in folds:
        cloud = fit_familiarity(names, training.rows[train], training.groups[train])
        for i, each in enumerate((training, other)):
            apart[i, test] = cloud.distance(names, each.rows[test])
            outside[i, test] = cloud.outside(each.rows[test])
        lacking[test] = cloud.lacking(names, training.rows[test])
        noise[test] = cloud.noise(names, training.rows[test])
    rare = max(float(np.quantile(outside[0], _RARE)), 1 / len(names))
    weight = float(np.quantile(apart[0], _RARE)) / rare
    limits = {
        "weight": weight,
        "most_lacking": most_lacking(lacking, REFUSED_SHARE),
        "seldom_lacking": most_lacking(lacking, CAUTIONED_SHARE),
        "most_noise": usual_excess(noise),
    }
    return np.maximum(apart, weight * outside), limits


def _rates(
    one: FittedHead, training: TrainingRows, estimate: Float, as_new: float | None
) -> dict[str, Any]:
    """How often a head is right, and how the severity is told with and without what it finds."""
    name, found = one.head.name, one.probability > PRESENT
    here = training.faults[name]
    error = np.abs(estimate - training.severity)
    visible = None
    if as_new is not None and is_regime(name):
        visible = visible_from(training.severity[here], estimate[here], as_new)
    return {
        "name": name,
        "share": float(here.mean()),
        "detection_rate": float(found[here].mean()),
        "false_alarm_rate": float(found[~here].mean()),
        "members": one.members,
        "mae_with_m": float(error[here].mean()),
        "mae_without_m": float(error[~here].mean()),
        "visible_from_m": visible,
    }


def _model(learnt: Learnt, card: dict[str, Any]) -> WearModel:
    return WearModel(
        blind=learnt.blind,
        informed=learnt.informed,
        familiarity=learnt.familiarity,
        levels=learnt.levels,
        heads=tuple(head for head, _ in learnt.heads),
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
            "scene": _name_in(head.scene),
            "recipe": _name_in(head.recipe),
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
        "conditions": _conditions(table, train),
        "mode": "cold",
        "baseline_records": 0,
    }


def _conditions(table: FeatureTable, train: NDArray[np.intp]) -> list[dict[str, Any]]:
    """Trained ranges: of what the signal tells, and of what was noted beside it."""
    columns = [
        {"name": name, "feature": name, "unit": "Hz" if name.endswith("hz") else ""}
        | _range(table.values[train, i])
        for i, name in enumerate(table.names)
        if name.rpartition(MARK)[2] == "shaft.speed_hz" or name.endswith(".rms")
    ]
    return columns + _noted(table.manifest.iloc[train])


def _noted(manifest: pd.DataFrame) -> list[dict[str, Any]]:
    """Conditions that vary and that no vibration tells, with their ranges."""
    return [
        {"name": name, "feature": "", "unit": noted.unit}
        | _range(manifest[name].to_numpy(dtype=float))
        for name, noted in NOTED.items()
        if name in manifest and np.ptp(manifest[name].to_numpy(dtype=float)) > 0
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
    }


def _healthy(training: TrainingRows, grade: NDArray[Any]) -> dict[str, list[float]]:
    """Mean and spread of the features of as-new machines, the reference of the evidence.

    Of a referenced model the spread is that about each machine's own baseline.
    """
    kept = grade == 0 if (grade == 0).any() else np.ones(len(grade), dtype=bool)
    rows = training.rows[kept]
    apart = rows if training.baseline is None else rows - training.baseline[kept]
    return {"mean": rows.mean(axis=0).tolist(), "spread": apart.std(axis=0).tolist()}


def _name_in(toml_text: str) -> str:
    import tomllib

    try:
        return str(tomllib.loads(toml_text).get("name", ""))
    except (ValueError, RecursionError):  # ValueError: no TOML, or a number too long
        return ""
