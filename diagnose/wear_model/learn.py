"""Fit everything that a wear model holds, by folds of whole machines."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.split.rules import group_folds
from ...sim.output.recording import DataError
from ..familiarity.noise_floor import usual_excess
from ..familiarity.novelty import REACH, Familiarity, fit_familiarity, outside_weight
from ..familiarity.quietness import CAUTIONED_SHARE, REFUSED_SHARE, most_lacking
from ..feature_rows.feature_choice import Selection
from ..feature_rows.feature_table import is_regime
from ..feature_rows.model_card import StrangerRates
from ..feature_rows.noted import doubted, noted_values, strayed
from ..learning.blends import Blend
from ..learning.conformal import (
    IntervalCalibration,
    fit_scale,
    outer_tenths,
    scale_inputs,
    widening,
)
from ..learning.detection import visible_from
from ..learning.experts import FEWEST_RECORDS, Experts, better_of, fit_experts
from ..learning.heads import PRESENT, FittedHead, Head, fit_head
from ..learning.regressions import (
    BUDGET_MS,
    CANDIDATES,
    WITNESSES,
    Fitted,
    Folds,
    fit_blend,
    fit_line,
)
from ..learning.severity import Estimator
from ..recording_faults.levels import Levels, fit_levels
from .strangers import fit_strangers
from .training_rows import FOLDS, TrainingRows

Float = NDArray[np.float64]

_FEWEST_FAULTS = 20  # records with and without a fault, for an error rate to within a tenth
_WORTH = 0.05  # of the error: conditions that bring less are not worth asking for
_CERTAIN = 2.0  # standard errors that their gain must exceed

SeverityFit = Fitted[Blend] | Fitted[Experts]


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
        By the features and the noted conditions; None if these add nothing.
    familiarity : Familiarity
    levels : Levels
    heads : tuple of (Head, dict)
        With their error rates, for the card.
    strangers : tuple of (Head, StrangerRates)
        Classifiers of the recordings to refuse.
    """

    severity: SeverityFit
    blind: Estimator
    informed: Estimator | None
    familiarity: Familiarity
    levels: Levels
    heads: tuple[tuple[Head, dict[str, Any]], ...]
    strangers: tuple[tuple[Head, StrangerRates], ...] = ()


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
        Seed of the folds and the trees.
    budget_ms : float, optional
        As for :func:`wearstate.diagnose.learning.regressions.fit_blend`.
    selection : Selection, optional
        How the features were chosen: the estimates of a fold are then those of the set that its
        training records ask for, so that the calibration knows what the choice costs.
    among : sequence of TrainingRows
        The sets that it was chosen from.
    as_new : float, optional
        Severity up to which a machine counts as new [m], to determine from which wear on each
        regime shows it.

    Returns
    -------
    Learnt

    Raises
    ------
    DataError
        A severity is not positive, no model is within the budget, or what is to be refused is
        not distinguished from the rest.
    """
    refuse_no_wear(training.severity)
    strangers = fit_strangers(training, seed)
    folds = group_folds(training.groups, n=FOLDS, seed=seed)
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
        blind=_estimator(training, training.inputs, severity, apart, seed),
        informed=_informed(training, other, severity, folds, apart, heads, seed, budget_ms),
        familiarity=fit_familiarity(training.names, training.rows, training.groups, **limits),
        levels=fit_levels(training.names, training.rows, folds),
        heads=tuple((one.head, _rates(one, training, severity.estimate, as_new)) for one in heads),
        strangers=strangers,
    )


def _heads(
    training: TrainingRows, other: TrainingRows, folds: Folds, seed: int
) -> list[FittedHead]:
    """Fit a classifier of each fault and regime that enough records have, and enough lack.

    A line recognises a regime from hundreds of features as well as trees do: 96 % of 2,000 pumps.
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
    noted: int = 0,
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
            shifted=moved,
            learnt_from=records,
            noted=noted,
        )

    one = fit(None, 1)
    gates = _gates(training, heads)
    if not gates or limit / len(gates) < min(each.cost_ms for each in CANDIDATES):
        return one
    present = [training.faults[gate.head.name] for gate in gates]
    first, features = training.first_feature, len(training.names)
    experts = fit_experts(gates, present, training.severity, fit, first=first, features=features)
    return better_of(one, experts, limit)


def _gates(training: TrainingRows, heads: Sequence[FittedHead]) -> list[FittedHead]:
    """Classifiers of the regimes if each has enough records; else none."""
    gates = [one for one in heads if is_regime(one.head.name)]
    records = [int(here.sum()) for name, here in training.faults.items() if is_regime(name)]
    return gates if records and min(records) >= FEWEST_RECORDS else []


def _estimator(
    training: TrainingRows,
    inputs: Float,
    fitted: SeverityFit,
    apart: tuple[Float, Float],
    seed: int,
) -> Estimator:
    """A fit with its uncertainty, from how it did on machines that it had not seen."""
    distance, far = apart
    sizes = scale_inputs(fitted.estimate, distance, fitted.disagreement, fitted.shares)
    strange = scale_inputs(
        fitted.shifted_estimate, far, fitted.shifted_disagreement, fitted.shifted_shares
    )
    scale = fit_scale(sizes, np.log(training.severity / fitted.estimate))

    def calibration(estimate: Float, sizes: Float, distance: Float) -> IntervalCalibration:
        return IntervalCalibration(
            estimate=estimate,
            truth=training.severity,
            scale=scale.predict(sizes),
            distance=distance,
            group=training.groups,
        )

    known = calibration(fitted.estimate, sizes, distance)
    return Estimator(
        severity=fitted.blend,
        witness=fit_line(inputs, training.severity, fitted.options, seed=seed),
        scale=scale,
        calibration=replace(known, widened=widening(known, _parts(training))),
        shifted=calibration(fitted.shifted_estimate, strange, far),
    )


def _parts(training: TrainingRows) -> tuple[NDArray[np.bool_], ...]:
    """Records on which intervals must hold by themselves: ends of wear and of each condition."""
    values = [training.severity]
    if training.conditions:
        values += [*noted_values(training.conditions, training.notes).T]
    return outer_tenths(np.column_stack(values))


def _informed(
    training: TrainingRows,
    other: TrainingRows,
    blind: SeverityFit,
    folds: Folds,
    apart: tuple[Float, Float],
    heads: Sequence[FittedHead],
    seed: int,
    budget_ms: float | None,
) -> Estimator | None:
    """The estimate with the conditions, as uncertain as people know them.

    None where they are not worth the asking. Which parts do well without the conditions says little
    of those that do well with them: only then the error is small enough to tell parts apart.
    """
    if not training.conditions:
        return None
    noted = noted_values(training.conditions, training.notes)
    if not np.isfinite(noted).all():
        return None
    noted = doubted(training.conditions, noted, seed)
    inputs = np.hstack([training.inputs, noted])
    moved = np.hstack([other.inputs, strayed(training.conditions, noted, seed, REACH)])
    count = len(training.conditions)
    fitted = _severity(training, inputs, moved, folds, heads, seed, budget_ms, noted=count)
    if not _worth_asking(training, fitted.estimate, blind.estimate):
        return None
    return _estimator(training, inputs, fitted, apart, seed)


def _worth_asking(training: TrainingRows, informed: Float, blind: Float) -> bool:
    """Whether conditions lower the mean error noticeably, of all records or of those of a regime.

    A pin that floats in oil errs three times as much as a dry one, and hides what a dry one gains.
    """
    regimes = [here for name, here in training.faults.items() if is_regime(name)]
    parts = [np.ones(len(blind), dtype=bool), *(r for r in regimes if r.sum() >= FEWEST_RECORDS)]
    before, after = (np.abs(each - training.severity) for each in (blind, informed))
    return any(
        _noticeable((before - after)[part], before[part], training.groups[part]) for part in parts
    )


def _noticeable(gain: Float, error: Float, groups: NDArray[np.intp]) -> bool:
    """Whether a gain is a part of the error that counts, and not by chance over machines."""
    _, place = np.unique(groups, return_inverse=True)
    machine = np.bincount(place, gain) / len(gain)  # parts of the mean gain
    uncertain = machine.std() * math.sqrt(len(machine))
    return bool(gain.mean() >= max(_WORTH * error.mean(), _CERTAIN * uncertain))


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

    And what the share outside the ranges counts, how far peaks may be below the usual ones, and
    noise floors above them.
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
    weight, rare = outside_weight(apart[0], outside[0])
    limits = {
        "weight": weight,
        "seldom_outside": rare,
        "most_lacking": most_lacking(lacking, REFUSED_SHARE),
        "seldom_lacking": most_lacking(lacking, CAUTIONED_SHARE),
        "most_noise": usual_excess(noise),
    }
    return np.maximum(apart, weight * outside), limits


def _rates(
    one: FittedHead, training: TrainingRows, estimate: Float, as_new: float | None
) -> dict[str, Any]:
    """Error rates of a classifier, and severity errors with and without what it finds."""
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


def refuse_no_wear(severity: Float) -> None:
    """Refuse severities of which one is not positive: their logarithms are fitted.

    Raises
    ------
    DataError
    """
    if not (severity > 0).all():
        raise DataError(
            f"severity = {severity.min():g} m must be > 0 in every record; label them all"
        )
