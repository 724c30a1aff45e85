"""The file of a wear model: what is in it, and whether its parts fit each other."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..familiarity.novelty import Familiarity
from ..feature_rows.model_card import ModelCard, Portion, Strict
from ..feature_rows.physical import level_channels, physical_rows, shape_rows
from ..learning.blends import Blend, Linear
from ..learning.conformal import IntervalCalibration, Scale, scale_inputs
from ..learning.experts import Experts
from ..learning.heads import Head
from ..learning.severity import Estimator
from ..recording_faults.levels import Levels
from .arrays import (
    BlendStructure,
    blend_arrays,
    blend_fits,
    blend_of,
    blend_structure,
    familiarity_fits,
    linear_fits,
    numbers_fit,
    part_arrays,
    part_of,
    refuse_more,
    shapes_of,
    spreads_fit,
)
from .bundle import Bundle, ModelError, checked, load_parts, refuse_misfits, save_bundle
from .estimate import WearModel

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
    table = model.card.table()
    checked(ModelCard, json.loads(json.dumps(table)), path, "card.json")  # as it will be read
    _check_structure(model, path)
    bundle = Bundle(
        kind=_KIND, card=table, structure=_structure_of(model), arrays=_arrays_of(model)
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
    model = load_parts(path, _KIND, ModelCard, _Structure, _model_of)
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
    """Blends of an estimate by regimes, and the classifiers of these."""

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
    strangers: list[_HeadStructure] = Field(default_factory=list, max_length=100)


def _structure_of(model: WearModel) -> dict[str, Any]:
    informed = model.informed
    structure = {
        "blind": _severity_structure(model.blind.severity),
        "informed": None if informed is None else _severity_structure(informed.severity),
        "heads": [_head_structure(head) for head in model.heads],
    }
    if model.strangers:
        structure["strangers"] = [_head_structure(head) for head in model.strangers]
    return structure


_HEAD_PARTS = ("heads", "strangers")
"""Parts of a model that are heads."""


def _head_structure(head: Head) -> dict[str, Any]:
    return {
        "name": head.name,
        "slope": head.slope,
        "offset": head.offset,
        "threshold": head.threshold,
        "blend": blend_structure(head.blend),
    }


def _heads_of(
    structures: Sequence[_HeadStructure], arrays: Mapping[str, NDArray[Any]], part: str
) -> tuple[Head, ...]:
    return tuple(
        Head(
            name=head.name,
            blend=blend_of(head.blend, arrays, f"{part}.{i}"),
            slope=head.slope,
            offset=head.offset,
            threshold=head.threshold,
        )
        for i, head in enumerate(structures)
    )


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
    for part in _HEAD_PARTS:
        for i, head in enumerate(getattr(model, part)):
            found |= blend_arrays(head.blend, f"{part}.{i}")
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
    structure: _Structure, arrays: Mapping[str, NDArray[Any]], card: ModelCard
) -> WearModel:
    heads = _heads_of(structure.heads, arrays, "heads")
    features = len(card.features)
    model = WearModel(
        blind=_estimator_of(structure.blind, arrays, "blind", heads, features),
        informed=None
        if structure.informed is None
        else _estimator_of(structure.informed, arrays, "informed", heads, features),
        heads=heads,
        strangers=_heads_of(structure.strangers, arrays, "strangers"),
        card=card,
        **{part: kind(**part_of(arrays, part, kind)) for part, kind in _ARRAY_PARTS.items()},
    )
    refuse_more(arrays, _arrays_of(model))
    return model


def _check_structure(model: WearModel, path: str | Path) -> None:
    """Shapes that fit each other, so that a forged file fails here and not in a prediction."""
    n = len(model.card.features)
    inputs = 2 * n if model.mode == "referenced" else n
    more = len(model.card.noted_names)
    names = model.names
    try:
        physical, shapes = (f(names, np.zeros((1, n))) for f in (physical_rows, shape_rows))
    except ValueError as error:  # a crank-angle map with holes
        raise ModelError(f"{path}: features do not fit each other ({error}); retrain it") from error
    fits = {
        "blind": _estimator_fits(model.blind, inputs),
        "informed": model.informed is None
        or (more > 0 and _estimator_fits(model.informed, inputs + more)),
        "heads": _heads_fit(model.heads, [each.name for each in model.card.confounders], n),
        "strangers": _heads_fit(model.strangers, [each.name for each in model.card.strangers], n),
        "familiarity": familiarity_fits(model.familiarity, names, physical.shape[1]),
        "levels": _levels_fit(model.levels, len(level_channels(names)), shapes.shape[1]),
        "numbers": numbers_fit(_arrays_of(model)),
    }
    refuse_misfits(fits, n, path)


def _heads_fit(heads: Sequence[Head], names: Sequence[str], n: int) -> bool:
    return [head.name for head in heads] == names and all(
        blend_fits(head.blend, n) for head in heads
    )


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
        and isinstance(known.widened, float)
        and 1 <= known.widened < math.inf
    )


def _levels_fit(levels: Levels, channels: int, n: int) -> bool:
    return (
        shapes_of(levels.centre, levels.spread) == {(n,)}
        and np.shape(levels.weight) == (channels, n)
        and shapes_of(levels.offset, levels.size, levels.least) == {(channels,)}
        and spreads_fit(levels.spread)
    )
