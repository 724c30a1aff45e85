"""File of a model of named conditions: its content, and checks that its parts are consistent."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..familiarity.novelty import Familiarity
from ..feature_rows.model_card import ClassCard, Strict
from ..feature_rows.physical import physical_rows
from ..wear_model.arrays import (
    BlendStructure,
    blend_arrays,
    blend_fits,
    blend_of,
    blend_structure,
    familiarity_fits,
    numbers_fit,
    part_arrays,
    part_of,
    refuse_more,
    shapes_of,
)
from ..wear_model.bundle import Bundle, ModelError, load_parts, refuse_misfits, save_bundle
from .train import ClassModel
from .votes import Votes

CLASS_MODEL = "class model"
"""Kind of such a file."""

_ROUNDING = 1e-9


class _Structure(Strict):
    blends: list[BlendStructure] = Field(min_length=2, max_length=100)


def save_class_model(model: ClassModel, path: str | Path, *, force: bool = False) -> None:
    """Write a model of named conditions; the same model gives the same bytes.

    Parameters
    ----------
    model : ClassModel
        Model from :func:`wearstate.train_classes`.
    path : str or Path
        Usually ``*.wsm``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The file exists, or its folder does not.
    ModelError
        The model could not be read back.

    Examples
    --------
    >>> import wearstate
    >>> model = wearstate.train_classes("faults.h5", "condition")  # doctest: +SKIP
    >>> wearstate.save_class_model(model, "faults.wsm")  # doctest: +SKIP
    """
    _check(model, path)
    structure = {"blends": [blend_structure(blend) for blend in model.blends]}
    bundle = Bundle(
        kind=CLASS_MODEL, card=model.card.table(), structure=structure, arrays=_arrays_of(model)
    )
    save_bundle(bundle, path, force=force)


def load_class_model(path: str | Path) -> ClassModel:
    """Read a model of named conditions; nothing in the file is executed.

    Parameters
    ----------
    path : str or Path
        File from :func:`save_class_model`.

    Returns
    -------
    ClassModel
        The saved model.

    Raises
    ------
    ModelError
        The file is missing, damaged or modified, of another kind or another version of format or
        features, or its parts are inconsistent.

    Examples
    --------
    >>> import wearstate
    >>> wearstate.load_class_model("pump.wsm")  # doctest: +IGNORE_EXCEPTION_DETAIL
    Traceback (most recent call last):
    wearstate.diagnose.wear_model.bundle.ModelError: pump.wsm is a wear model
    """
    model = load_parts(path, CLASS_MODEL, ClassCard, _Structure, _model_of)
    _check(model, path)
    return model


def _arrays_of(model: ClassModel) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for i, blend in enumerate(model.blends):
        found |= blend_arrays(blend, f"blends.{i}")
    for i, cloud in enumerate(model.familiarity):
        found |= part_arrays(cloud, f"familiarity.{i}")
    found |= part_arrays(model.votes, "votes")
    return {name: np.asarray(value) for name, value in found.items()}


def _model_of(
    structure: _Structure, arrays: Mapping[str, NDArray[Any]], card: ClassCard
) -> ClassModel:
    model = ClassModel(
        blends=tuple(
            blend_of(one, arrays, f"blends.{i}") for i, one in enumerate(structure.blends)
        ),
        votes=Votes(**part_of(arrays, "votes", Votes)),
        familiarity=tuple(
            Familiarity(**part_of(arrays, f"familiarity.{i}", Familiarity))
            for i in range(len(structure.blends))
        ),
        card=card,
    )
    refuse_more(arrays, _arrays_of(model))
    return model


def _check(model: ClassModel, path: str | Path) -> None:
    """Check that shapes are consistent, so that a forged file fails here, not in a prediction."""
    n = len(model.names)
    try:
        physical = physical_rows(model.names, np.zeros((1, n)))
    except ValueError as error:
        raise ModelError(f"{path}: features are inconsistent ({error}); retrain it") from error
    fits = {
        "blends": len(model.blends) == len(model.classes)
        and all(blend_fits(blend, n) for blend in model.blends),
        "votes": _votes_fit(model.votes, len(model.classes)),
        "familiarity": len(model.familiarity) == len(model.classes)
        and all(
            familiarity_fits(cloud, model.names, physical.shape[1]) for cloud in model.familiarity
        ),
        "numbers": numbers_fit(_arrays_of(model)),
    }
    refuse_misfits(fits, n, path)


def _votes_fit(votes: Votes, classes: int) -> bool:
    n = np.size(votes.label)
    return (
        shapes_of(votes.label, votes.group, votes.distance) == {(n,)}
        and n > 0
        and votes.shares.shape == (n, classes)
        and bool((votes.shares >= 0).all())
        and bool((np.abs(votes.shares.sum(axis=1) - 1) < _ROUNDING).all())
        and votes.blows.ndim == 2
        and len(votes.blows) == n
        and bool(((votes.label >= 0) & (votes.label < classes)).all())
    )
