"""The file of a wear model: what is in it, and whether its parts fit each other."""

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..feature_rows.noted import NOTED, noted_names
from ..feature_rows.physical import level_channels, physical_rows, shape_rows
from ..feature_rows.quality import Levels
from ..learning.conformal import IntervalCalibration, Scale, scale_inputs
from ..learning.experts import Experts
from ..learning.grades import GRADE_NAMES
from ..learning.heads import Head
from ..learning.regressions import Blend, Linear
from ..learning.severity import Estimator
from .arrays import (
    BlendStructure,
    ChannelCard,
    FeatureChoice,
    Portion,
    Pulses,
    RateHz,
    Strict,
    blend_arrays,
    blend_fits,
    blend_of,
    blend_structure,
    check_channels,
    familiarity_fits,
    linear_fits,
    numbers_fit,
    part_arrays,
    part_of,
    refuse_more,
    shapes_of,
    spreads_fit,
)
from .bundle import Bundle, checked, load_bundle, save_bundle
from .estimate import ModelError, WearModel
from .novelty import Familiarity

_KIND = "wear model"


def save_model(model: WearModel, path: str | Path, *, force: bool = False) -> None:
    """Write a model file: tables and arrays in a zip, each with its SHA-256. No code, no pickle.

    The same model gives the same bytes.

    Parameters
    ----------
    model : WearModel
        What :func:`wearstate.train` gives.
    path : str or Path
        Usually ``*.wsm``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The file exists, or its folder does not.
    ModelError
        The model could not be read again.

    Examples
    --------
    >>> save_model(load_model("pump.wsm"), "copy.wsm")
    """
    checked(_Card, json.loads(json.dumps(model.card)), path, "card.json")  # as it will be read
    _check_structure(model, path)
    bundle = Bundle(
        kind=_KIND, card=model.card, structure=_structure_of(model), arrays=_arrays_of(model)
    )
    save_bundle(bundle, path, force=force)


def load_model(path: str | Path) -> WearModel:
    """Read a model file; nothing in it is executed.

    Parameters
    ----------
    path : str or Path
        File of :func:`save_model`.

    Returns
    -------
    WearModel
        As it was saved.

    Raises
    ------
    ModelError
        No such file, not a wear model, damaged, changed, of another version of the format or of
        the features, or forged so that its parts do not fit each other; the text says what helps.

    Examples
    --------
    >>> load_model("pump.wsm").mode
    'cold'
    """
    bundle = load_bundle(path, _KIND)
    checked(_Card, bundle.card, path, "card.json")
    structure = checked(_Structure, bundle.structure, path, "structure.json")
    try:
        model = _model_of(structure, bundle.arrays, bundle.card)
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(f"{path}: arrays.npz cannot be read ({error}); retrain it") from error
    _check_structure(model, path)
    return model


_ARRAY_PARTS: dict[str, Any] = {"familiarity": Familiarity, "levels": Levels}
"""Parts of a model that are plain arrays and numbers."""

_ESTIMATOR_PARTS: dict[str, Any] = {
    "witness": Linear,
    "scale": Scale,
    "calibration": IntervalCalibration,
    "shifted": IntervalCalibration,
}
"""The same of an estimator."""


class _HeadStructure(Strict):
    name: str
    slope: float
    offset: float
    threshold: Portion
    blend: BlendStructure


class _ExpertsStructure(Strict):
    """Blends of an estimate by regimes, and the heads that tell these."""

    gates: list[str] = Field(min_length=2, max_length=100)
    blends: list[BlendStructure] = Field(min_length=2, max_length=100)
    first: int = Field(ge=0)
    tube: float = Field(ge=0)

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        if len(self.gates) != len(self.blends):
            raise ValueError("gates and blends must be as many")
        return self


class _Structure(Strict):
    """Which parts a model has; their numbers are in the arrays."""

    blind: BlendStructure | _ExpertsStructure
    informed: BlendStructure | _ExpertsStructure | None
    heads: list[_HeadStructure] = Field(max_length=100)


def _structure_of(model: WearModel) -> dict[str, Any]:
    return {
        "blind": _severity_structure(model.blind.severity),
        "informed": None
        if model.informed is None
        else _severity_structure(model.informed.severity),
        "heads": [
            {
                "name": head.name,
                "slope": head.slope,
                "offset": head.offset,
                "threshold": head.threshold,
                "blend": blend_structure(head.blend),
            }
            for head in model.heads
        ],
    }


def _severity_structure(severity: Blend | Experts) -> dict[str, Any]:
    if isinstance(severity, Blend):
        return blend_structure(severity)
    return {
        "gates": [gate.name for gate in severity.gates],
        "blends": [blend_structure(blend) for blend in severity.blends],
        "first": severity.first,
        "tube": severity.tube,
    }


def _severity_arrays(severity: Blend | Experts, place: str) -> dict[str, Any]:
    if isinstance(severity, Blend):
        return blend_arrays(severity, place)
    each = [blend_arrays(blend, f"{place}.{i}") for i, blend in enumerate(severity.blends)]
    return {name: array for arrays in each for name, array in arrays.items()}


def _severity_of(
    structure: BlendStructure | _ExpertsStructure,
    arrays: Mapping[str, NDArray[Any]],
    place: str,
    heads: Sequence[Head],
    features: int,
) -> Blend | Experts:
    if isinstance(structure, BlendStructure):
        return blend_of(structure, arrays, place)
    known = {head.name: head for head in heads}
    return Experts(
        gates=tuple(known[name] for name in structure.gates),
        blends=tuple(
            blend_of(blend, arrays, f"{place}.{i}") for i, blend in enumerate(structure.blends)
        ),
        first=structure.first,
        features=features,
        tube=structure.tube,
    )


def _arrays_of(model: WearModel) -> dict[str, NDArray[Any]]:
    """Every number of a model by a dotted name."""
    found: dict[str, Any] = {}
    for part in _ARRAY_PARTS:
        found |= part_arrays(getattr(model, part), part)
    for place, estimator in _estimators(model).items():
        found |= _severity_arrays(estimator.severity, f"{place}.severity")
        for part in _ESTIMATOR_PARTS:
            found |= part_arrays(getattr(estimator, part), f"{place}.{part}")
    for i, head in enumerate(model.heads):
        found |= blend_arrays(head.blend, f"heads.{i}")
    return {name: np.asarray(value) for name, value in found.items()}


def _estimators(model: WearModel) -> dict[str, Estimator]:
    """Those that a model has, by their place."""
    both = {"blind": model.blind, "informed": model.informed}
    return {place: each for place, each in both.items() if each is not None}


def _estimator_of(
    structure: BlendStructure | _ExpertsStructure,
    arrays: Mapping[str, NDArray[Any]],
    place: str,
    heads: Sequence[Head],
    features: int,
) -> Estimator:
    parts = {
        part: kind(**part_of(arrays, f"{place}.{part}", kind))
        for part, kind in _ESTIMATOR_PARTS.items()
    }
    severity = _severity_of(structure, arrays, f"{place}.severity", heads, features)
    return Estimator(severity=severity, **parts)


def _model_of(
    structure: _Structure, arrays: Mapping[str, NDArray[Any]], card: dict[str, Any]
) -> WearModel:
    heads = tuple(
        Head(
            name=head.name,
            blend=blend_of(head.blend, arrays, f"heads.{i}"),
            slope=head.slope,
            offset=head.offset,
            threshold=head.threshold,
        )
        for i, head in enumerate(structure.heads)
    )
    features = len(card["features"])
    model = WearModel(
        blind=_estimator_of(structure.blind, arrays, "blind", heads, features),
        informed=None
        if structure.informed is None
        else _estimator_of(structure.informed, arrays, "informed", heads, features),
        heads=heads,
        card=card,
        **{part: kind(**part_of(arrays, part, kind)) for part, kind in _ARRAY_PARTS.items()},
    )
    refuse_more(arrays, _arrays_of(model))
    return model


def _check_structure(model: WearModel, path: str | Path) -> None:
    """Shapes that fit each other, so that a forged file fails here and not in a prediction."""
    n = len(model.card.get("features", []))
    inputs = 2 * n if model.mode == "referenced" else n
    more = len(noted_names(model.card))
    names = model.names
    try:
        physical, shapes = (f(names, np.zeros((1, n))) for f in (physical_rows, shape_rows))
    except ValueError as error:  # a crank-angle map with holes
        raise ModelError(f"{path}: features do not fit each other ({error}); retrain it") from error
    fits = {
        "blind": _estimator_fits(model.blind, inputs),
        "informed": model.informed is None
        or (more > 0 and _estimator_fits(model.informed, inputs + more)),
        "heads": all(blend_fits(head.blend, n) for head in model.heads)
        and [h.name for h in model.heads] == [c["name"] for c in model.card["confounders"]],
        "familiarity": familiarity_fits(model.familiarity, names, physical.shape[1]),
        "levels": _levels_fit(model.levels, len(level_channels(names)), shapes.shape[1]),
        "numbers": numbers_fit(_arrays_of(model)),
    }
    bad = [name for name, good in fits.items() if not good]
    if bad:
        raise ModelError(f"{path}: {', '.join(bad)} do not fit {n} features; retrain it")


def _estimator_fits(estimator: Estimator, n: int) -> bool:
    return (
        _severity_fits(estimator.severity, n)
        and estimator.severity.low > 0
        and linear_fits(estimator.witness, n)
        and _scale_fits(estimator.scale, _regimes(estimator.severity))
        and _calibration_fits(estimator.calibration)
        and _calibration_fits(estimator.shifted)
    )


def _severity_fits(severity: Blend | Experts, n: int) -> bool:
    if isinstance(severity, Blend):
        return blend_fits(severity, n)
    return severity.first + severity.features <= n and all(
        blend_fits(blend, n) for blend in severity.blends
    )


def _regimes(severity: Blend | Experts) -> int:
    return 0 if isinstance(severity, Blend) else len(severity.gates)


def _scale_fits(scale: Scale, regimes: int) -> bool:
    n = scale_inputs([1.0], [1.0], [1.0], np.zeros((1, regimes))).shape[1]
    return (
        shapes_of(scale.centre, scale.spread, scale.weight) == {(n,)}
        and isinstance(scale.offset, float)
        and isinstance(scale.limit, float)
        and scale.limit > 0
        and spreads_fit(scale.spread)
    )


def _calibration_fits(known: IntervalCalibration) -> bool:
    arrays = (known.estimate, known.truth, known.scale, known.distance, known.group)
    return (
        len(shapes_of(*arrays)) == 1
        and np.ndim(known.group) == 1
        and np.size(known.group) > 0
        and all(spreads_fit(part) for part in arrays[:3])
    )


def _levels_fit(levels: Levels, channels: int, n: int) -> bool:
    return (
        shapes_of(levels.centre, levels.spread) == {(n,)}
        and np.shape(levels.weight) == (channels, n)
        and shapes_of(levels.offset, levels.size, levels.least) == {(channels,)}
        and spreads_fit(levels.spread)
    )


_MOST_WEAR_M = 10.0  # clearance, wear-down or offset beyond any machine

_Wear = Annotated[float, Field(gt=0, le=_MOST_WEAR_M)]
_Worn = Annotated[float, Field(ge=0, le=_MOST_WEAR_M)]


class _TrainedOn(Strict):
    records: int = Field(ge=1)
    draws: int = Field(ge=1)
    draw_identity: str
    held_out_share: Portion
    split_seed: int
    split: str = ""
    split_sha256: str = ""
    training_groups: list[int]
    training_signals: list[int]
    scene: str
    recipe: str


class _Healthy(Strict):
    mean: list[float]
    spread: list[float]


class _Condition(Strict):
    name: str
    feature: str
    unit: str
    low: float
    high: float


class _Tried(Strict):
    name: str
    cost_ms: float
    mae_m: float
    on_front: bool


class _Chosen(Strict):
    chosen: str
    members: dict[str, float]
    nested_mae_m: float
    informed_mae_m: float | None = None
    candidates: list[_Tried]


class _Rates(Strict):
    name: str
    share: Portion
    detection_rate: Portion
    false_alarm_rate: Portion
    mae_with_m: float = Field(ge=0)
    mae_without_m: float = Field(ge=0)
    visible_from_m: float | None = Field(gt=0)
    members: dict[str, float]


class _ViewCard(Strict):
    """What the recording of a view must have."""

    channels: list[ChannelCard] = Field(min_length=1)
    sample_rate_hz: RateHz
    tacho: str | None
    pulses_per_revolution: Pulses

    @model_validator(mode="after")
    def _fits_itself(self) -> Self:
        check_channels(self.channels, self.tacho)
        return self


class _Card(Strict):
    """What a card must hold, so that nothing that reads it can fail."""

    created_by: str
    origin: Literal["simulated", "measured"]
    trained_on: _TrainedOn
    severity: str = Field(pattern=r"^\w+_\w+_m$")
    severity_range_m: list[_Worn] = Field(min_length=2, max_length=2)
    grade_edges_m: list[_Wear] = Field(
        min_length=len(GRADE_NAMES) - 1, max_length=len(GRADE_NAMES) - 1
    )
    condemning_limit_m: _Wear
    limit_source: str
    sample_rate_hz: RateHz
    channels: list[ChannelCard] = Field(min_length=1)
    tacho: str | None
    pulses_per_revolution: Pulses
    views: dict[str, _ViewCard] = Field(default_factory=dict)
    features: list[str] = Field(min_length=1)
    feature_choice: FeatureChoice = FeatureChoice()
    conditions: list[_Condition]
    healthy_features: _Healthy
    mode: Literal["cold", "referenced"]
    baseline_records: int = Field(ge=0)
    budget_ms: float = Field(gt=0)
    model: _Chosen
    confounders: list[_Rates]

    @model_validator(mode="after")
    def _fits_itself(self) -> Self:
        n = len(self.features)
        if len(self.healthy_features.mean) != n or len(self.healthy_features.spread) != n:
            raise ValueError("healthy_features must have one number per feature")
        edges, limit = self.grade_edges_m, self.condemning_limit_m
        if not all(low < high for low, high in pairwise(edges)):
            raise ValueError(f"grade_edges_m = {edges} m must rise, each above the one before")
        if limit < edges[-1]:
            raise ValueError(f"condemning_limit_m = {limit:g} m must be >= the last grade edge")
        for name, (low, high) in self._ranges():
            if low > high:
                raise ValueError(f"{name} = {low:g} to {high:g} must rise")
        if not {c.feature for c in self.conditions} <= {"", *self.features}:
            raise ValueError("conditions must name features")
        if not {c.name for c in self.conditions if not c.feature} <= set(NOTED):
            raise ValueError(f"conditions that are noted must be of {', '.join(NOTED)}")
        check_channels(self.channels, self.tacho)
        return self

    def _ranges(self) -> list[tuple[str, tuple[float, float]]]:
        """What has a low and a high end."""
        low, high = self.severity_range_m
        return [
            ("severity_range_m", (low, high)),
            *((f"condition {one.name}", (one.low, one.high)) for one in self.conditions),
        ]
