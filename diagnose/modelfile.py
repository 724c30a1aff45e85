"""The file of a wear model: a zip of a card and plain arrays, checked before it is believed."""

import hashlib
import io
import json
import os
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..datasets.record import DataError
from .estimate import Calibration, LinearSeverity, ModelError, WearModel
from .grades import GRADE_NAMES
from .novelty import Familiarity

Float = NDArray[np.float64]

MODEL_SCHEMA = 1

_LARGEST_MEMBER = 2**28  # byte, of a model file's parts once unpacked


def save_model(model: WearModel, path: str | Path, *, force: bool = False) -> None:
    """Write a model file: card and arrays in a zip, each with its SHA-256. No code, no pickle.

    Parameters
    ----------
    model : WearModel
    path : str or Path
        Usually ``*.wsm``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The file exists, or its folder does not.
    """
    target = Path(path)
    if target.exists() and not force:
        raise DataError(f"{target} exists; choose another name or use force to replace it")
    if not target.parent.is_dir():
        raise DataError(f"{target.parent} is no folder; create it")
    arrays = io.BytesIO()
    np.savez(
        arrays,
        **{
            f"{part}.{name}": value
            for part in _ARRAY_PARTS
            for name, value in asdict(getattr(model, part)).items()
        },
    )
    members = {
        "card.json": json.dumps(model.card, indent=1, sort_keys=True).encode(),
        "arrays.npz": arrays.getvalue(),
    }
    seal = {
        "schema_version": MODEL_SCHEMA,
        "sha256": {name: hashlib.sha256(data).hexdigest() for name, data in members.items()},
    }
    part = target.with_name(target.name + ".part")
    try:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as bundle:
            for name, data in {"seal.json": json.dumps(seal).encode(), **members}.items():
                bundle.writestr(name, data)
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def load_model(path: str | Path) -> WearModel:
    """Read a model file; nothing in it is executed.

    Parameters
    ----------
    path : str or Path
        File of :func:`save_model`.

    Returns
    -------
    WearModel

    Raises
    ------
    ModelError
        No such file, not a model, damaged, changed, of another version of the model format, or
        forged so that its parts do not fit each other; the text says what helps.
    """
    members = _members(Path(path))
    _check_seal(_parsed(members, "seal.json", path), members, path)
    card = _parsed(members, "card.json", path)
    _check_card(card, path)
    try:
        with np.load(io.BytesIO(members["arrays.npz"]), allow_pickle=False) as stored:
            arrays = {name: np.asarray(stored[name], dtype=float) for name in stored.files}
        parts = {part: kind(**_part(arrays, part)) for part, kind in _ARRAY_PARTS.items()}
    except (KeyError, TypeError, ValueError, *_ZIP_FAULTS) as error:
        raise ModelError(f"{path}: arrays.npz cannot be read ({error}); retrain it") from error
    model = WearModel(**parts, card=card)
    _check_structure(model, path)
    return model


_ARRAY_PARTS: dict[str, Any] = {
    "regressor": LinearSeverity,
    "calibration": Calibration,
    "familiarity": Familiarity,
}


def _part(arrays: Mapping[str, Float], part: str) -> dict[str, Any]:
    """Fields of one part; a single number comes back as a float."""
    names = [f"{part}.{name}" for name in _ARRAY_PARTS[part].__dataclass_fields__]
    missing = [name for name in names if name not in arrays]
    if missing:
        raise ValueError(f"{', '.join(missing)} missing")
    found = {name.removeprefix(f"{part}."): arrays[name] for name in names}
    return {name: array if array.ndim else float(array) for name, array in found.items()}


def _members(path: Path) -> dict[str, bytes]:
    if not path.is_file():
        raise ModelError(f"{path} is no file; make one: wearstate train DATA -o {path.name}")
    try:
        with zipfile.ZipFile(path) as bundle:
            too_large = [i.filename for i in bundle.infolist() if i.file_size > _LARGEST_MEMBER]
            if too_large:
                raise ModelError(f"{path}: {too_large[0]} is over 256 MiB; this is no model file")
            return {name: bundle.read(name) for name in bundle.namelist()}
    except ModelError:
        raise
    except _ZIP_FAULTS as error:
        raise ModelError(f"{path} is no intact model ({error}); take an intact copy") from error


def _parsed(members: dict[str, bytes], name: str, path: str | Path) -> dict[str, Any]:
    try:
        parsed = json.loads(members[name])
    except (KeyError, ValueError) as error:
        raise ModelError(f"{path}: {name} cannot be read; this is no intact model file") from error
    if not isinstance(parsed, dict):
        raise ModelError(f"{path}: {name} is no table; this is no intact model file")
    return parsed


def _check_seal(seal: Mapping[str, Any], members: dict[str, bytes], path: str | Path) -> None:
    if seal.get("schema_version") != MODEL_SCHEMA:
        raise ModelError(
            f"{path}: schema_version = {seal.get('schema_version')} must be {MODEL_SCHEMA}; "
            "retrain it: wearstate train DATA -o MODEL"
        )
    sums = seal.get("sha256")
    wanted = sums if isinstance(sums, dict) else {}
    found = {n: hashlib.sha256(d).hexdigest() for n, d in members.items() if n != "seal.json"}
    if found != wanted:
        changed = sorted(n for n in {*found, *wanted} if found.get(n) != wanted.get(n))
        raise ModelError(
            f"{path}: checksum of {', '.join(changed)} does not fit; the file was changed or "
            "damaged: take an intact copy or retrain"
        )


def _check_structure(model: WearModel, path: str | Path) -> None:
    """Shapes that fit each other, so that a forged file fails here and not in a prediction."""
    n = len(model.card.get("features", []))
    r, f, c = model.regressor, model.familiarity, model.calibration
    fits = {
        "regressor": _shapes(r.centre, r.spread, r.weight) == {(n,)}
        and isinstance(r.offset, float)
        and bool((r.spread > 0).all()),
        "familiarity": _shapes(f.centre, f.spread, f.shift) == {(n,)}
        and f.directions.shape == (np.size(f.variance), n)
        and isinstance(f.residual, float)
        and bool((f.spread > 0).all() and np.all(f.variance > 0) and f.residual > 0),
        "calibration": len(_shapes(c.log_error, c.log_estimate, c.distance)) == 1
        and np.ndim(c.log_error) == 1
        and np.size(c.log_error) > 0,
        "numbers": all(
            np.isfinite(value).all() for part in (r, f, c) for value in vars(part).values()
        ),
    }
    bad = [name for name, good in fits.items() if not good]
    if bad:
        raise ModelError(f"{path}: {', '.join(bad)} do not fit {n} features; retrain it")


def _shapes(*arrays: Any) -> set[tuple[int, ...]]:
    return {np.shape(array) for array in arrays}


_ZIP_FAULTS = (
    zipfile.BadZipFile,
    zlib.error,
    OSError,
    EOFError,
    NotImplementedError,
    RuntimeError,
    ValueError,
)
"""What zipfile raises on damaged bytes."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)


class _TrainedOn(_Strict):
    records: int
    draws: int
    draw_identity: str
    held_out_share: float
    split_seed: int
    training_groups: list[int]
    training_signals: list[int]
    scene: str
    recipe: str


class _Healthy(_Strict):
    mean: list[float]
    spread: list[float]


class _Card(_Strict):
    """What a card must hold, so that nothing that reads it can fail."""

    created_by: str
    origin: Literal["simulated", "measured"]
    trained_on: _TrainedOn
    severity: str = Field(pattern=r"^\w+_\w+_m$")
    severity_range_m: list[float] = Field(min_length=2, max_length=2)
    grade_edges_m: list[float] = Field(
        min_length=len(GRADE_NAMES) - 1, max_length=len(GRADE_NAMES) - 1
    )
    condemning_limit_m: float = Field(gt=0)
    limit_source: str
    sample_rate_hz: float = Field(gt=0)
    channels: list[dict[str, str]] = Field(min_length=1)
    tacho: str | None
    pulses_per_revolution: int = Field(ge=1)
    features: list[str] = Field(min_length=1)
    condition_ranges: dict[str, list[float]]
    healthy_features: _Healthy

    @model_validator(mode="after")
    def _fits_itself(self) -> Self:
        n = len(self.features)
        if len(self.healthy_features.mean) != n or len(self.healthy_features.spread) != n:
            raise ValueError("healthy_features must have one number per feature")
        if sorted(self.grade_edges_m) != self.grade_edges_m:
            raise ValueError("grade_edges_m must rise")
        if not set(self.condition_ranges) <= set(self.features):
            raise ValueError("condition_ranges must name features")
        if any(len(bounds) != 2 for bounds in self.condition_ranges.values()):
            raise ValueError("condition_ranges must be pairs")
        if any(not {"name", "unit"} <= set(channel) for channel in self.channels):
            raise ValueError("channels must have a name and a unit")
        return self


def _check_card(card: Mapping[str, Any], path: str | Path) -> None:
    try:
        _Card.model_validate(card)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "card"
        raise ModelError(f"{path}: card.json: {place}: {first['msg']}; retrain it") from error
