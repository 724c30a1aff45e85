"""The container of a model file: a zip of tables and plain arrays, checked before it is believed.

Nothing in it is code, and nothing in it may make the reader run, hang or grow.
"""

import hashlib
import io
import json
import math
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from ...features.catalogue.analysis import STANDARD
from ...features.catalogue.row import catalogue
from ...sim.atomic import replacing
from ...sim.output.recording import DataError, missing_file

BUNDLE_SCHEMA = 7

_SEAL, _CARD, _STRUCTURE, _ARRAYS = "seal.json", "card.json", "structure.json", "arrays.npz"
_LARGEST_TABLE = 2**23  # byte, of a table unpacked: the card of a million records
_LARGEST_ARRAYS = 2**28  # byte, of all arrays unpacked: 1,000 times those of 2,000 records
_BOUNDS = dict.fromkeys((_SEAL, _CARD, _STRUCTURE), _LARGEST_TABLE) | {_ARRAYS: _LARGEST_ARRAYS}
_MOST_ARRAYS = 10_000
_LONGEST_HEADER = 1024  # byte, of an array: numpy's own have 118
_FEATURES = 2  # to be raised when a feature is computed differently


class ModelError(ValueError):
    """A model file cannot be used; names what is wrong and what helps."""


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """What a model file holds.

    Attributes
    ----------
    kind : str
        What model it is of.
    card, structure : dict
        As stored; to be checked by the reader of the kind.
    arrays : dict
        Numbers by name; no other types.
    """

    kind: str
    card: dict[str, Any]
    structure: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


@cache
def feature_version() -> str:
    """Short hash of the standard features: a model of others cannot be used.

    Returns
    -------
    str
        Changes with names, units, scopes and settings of the standard features, and with
        ``_FEATURES``.
    """
    rows = [[row[key] for key in ("name", "unit", "scope")] for row in catalogue("standard")]
    identity = json.dumps([_FEATURES, rows, repr(STANDARD)])
    return hashlib.sha256(identity.encode()).hexdigest()[:12]


# --- writing


def save_bundle(bundle: Bundle, path: str | Path, *, force: bool = False) -> None:
    """Write a model file; the same bundle gives the same bytes.

    Parameters
    ----------
    bundle : Bundle
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
    with replacing(target, force=force) as fresh, zipfile.ZipFile(fresh, "w") as file:
        for name, data in _sealed(bundle).items():
            entry = zipfile.ZipInfo(name)  # of 1980: a date would make other bytes
            entry.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(entry, data)


def _sealed(bundle: Bundle) -> dict[str, bytes]:
    members = {
        _CARD: json.dumps(bundle.card, indent=1, sort_keys=True).encode(),
        _STRUCTURE: json.dumps(bundle.structure, indent=1).encode(),
        _ARRAYS: _packed(bundle.arrays),
    }
    seal = {
        "schema_version": BUNDLE_SCHEMA,
        "kind": bundle.kind,
        "features": feature_version(),
        "sha256": {name: hashlib.sha256(data).hexdigest() for name, data in members.items()},
    }
    return {_SEAL: json.dumps(seal).encode(), **members}


def _packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """As :func:`numpy.savez`, which takes objects, or before 2.1 the switch that forbids them."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as handle:
                npy.write_array(handle, np.asanyarray(array), allow_pickle=False)
    return content.getvalue()


# --- reading


def load_bundle(path: str | Path, kind: str) -> Bundle:
    """Read a model file; nothing in it is executed.

    Parameters
    ----------
    path : str or Path
        File of :func:`save_bundle`.
    kind : str
        What model it must be of.

    Returns
    -------
    Bundle
        As intact as when it was written; whether its parts fit each other is not known yet.

    Raises
    ------
    ModelError
        No such file, not a model, of another kind, damaged, changed, too large to be one, of
        another version of the format or of the features; the text says what helps.
    """
    members = _members(Path(path))
    _check_seal(_table(members, _SEAL, path), members, path, kind)
    try:
        arrays = _arrays(members[_ARRAYS])
    except _FAULTS as error:
        raise ModelError(f"{path}: {_ARRAYS} cannot be read ({error}); retrain it") from error
    return Bundle(
        kind=kind,
        card=_table(members, _CARD, path),
        structure=_table(members, _STRUCTURE, path),
        arrays=arrays,
    )


def kind_of(path: str | Path) -> str:
    """What model a file is of, by its word.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    str
        Empty where the file does not say it.

    Raises
    ------
    ModelError
        No such file, or not a model.
    """
    kind = _table(_members(Path(path)), _SEAL, path).get("kind")
    return kind if isinstance(kind, str) else ""


Table = TypeVar("Table", bound=BaseModel)


def checked(kind: type[Table], table: Mapping[str, Any], path: str | Path, name: str) -> Table:
    """A table of a model file, as it must be.

    Parameters
    ----------
    kind : type
        What it must hold.
    table : mapping
    path : str or Path
        Name of the file, for messages.
    name : str
        Name of the table in it.

    Raises
    ------
    ModelError
        In one line: where the first fault is and what must be there.
    """
    try:
        return kind.model_validate(table)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "table"
        raise ModelError(f"{path}: {name}: {place}: {first['msg']}; retrain it") from error


Model = TypeVar("Model")
Structure = TypeVar("Structure", bound=BaseModel)


def load_parts(
    path: str | Path,
    kind: str,
    card_type: type[Table],
    structure_type: type[Structure],
    assembled: Callable[[Structure, Mapping[str, NDArray[Any]], Table], Model],
) -> Model:
    """Model of a file, its tables checked; whether its parts fit each other is not known yet.

    Raises
    ------
    ModelError
        As of :func:`load_bundle` and :func:`checked`, or a part is missing.
    """
    bundle = load_bundle(path, kind)
    card = checked(card_type, bundle.card, path, _CARD)
    structure = checked(structure_type, bundle.structure, path, _STRUCTURE)
    try:
        return assembled(structure, bundle.arrays, card)
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(f"{path}: {_ARRAYS} cannot be read ({error}); retrain it") from error


def refuse_misfits(fits: Mapping[str, bool], features: int, path: str | Path) -> None:
    """Refuse a model of whose parts any does not fit; its file may be forged.

    Raises
    ------
    ModelError
    """
    bad = [name for name, good in fits.items() if not good]
    if bad:
        raise ModelError(f"{path}: {', '.join(bad)} do not fit {features} features; retrain it")


_FAULTS = (
    zipfile.BadZipFile,
    zlib.error,
    OSError,
    EOFError,
    NotImplementedError,
    RuntimeError,  # also RecursionError
    MemoryError,
    KeyError,
    TypeError,
    ValueError,
)
"""What zipfile, json and numpy raise on damaged or forged bytes."""


_HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file."""


def _members(path: Path) -> dict[str, bytes]:
    if not path.is_file():
        raise ModelError(missing_file(path, f"make one: wearstate train DATA -o {path.name}"))
    try:
        with zipfile.ZipFile(path) as file:
            return _unpacked(file, _BOUNDS)
    except _FAULTS as error:
        if path.read_bytes()[: len(_HDF5)] == _HDF5:
            raise ModelError(
                f"{path} is a data set or recording, must be a model (.wsm); make one of a "
                f"labelled data set: wearstate train {path.name} -o model.wsm"
            ) from error
        version = _schema_version(path)
        if version not in (None, BUNDLE_SCHEMA):  # its members may be others
            raise _other_version(path, "schema_version", version, BUNDLE_SCHEMA) from error
        raise ModelError(f"{path} is no intact model ({error}); take an intact copy") from error


def _schema_version(path: Path) -> Any:
    """What a file says of its version; None where that cannot be read."""
    try:
        with zipfile.ZipFile(path) as file:
            entry = file.getinfo(_SEAL)
            _check_entry(entry, _LARGEST_TABLE)
            return dict(json.loads(file.read(entry))).get("schema_version")
    except _FAULTS:
        return None


def _other_version(path: str | Path, name: str, found: Any, wanted: Any) -> ModelError:
    return ModelError(
        f"{path}: {name} = {str(found)[:40]} must be {wanted}; "
        "retrain it: wearstate train DATA -o MODEL"
    )


def _unpacked(file: zipfile.ZipFile, bounds: Mapping[str, int]) -> dict[str, bytes]:
    """Contents of exactly these members, none larger than its bound [byte] once unpacked."""
    entries = file.infolist()
    names = sorted(entry.filename for entry in entries)
    if names != sorted(bounds):
        raise ValueError(f"it holds {', '.join(names)[:200]}, must hold {', '.join(bounds)}")
    for entry in entries:
        _check_entry(entry, bounds[entry.filename])
    return {entry.filename: file.read(entry) for entry in entries}


def _check_entry(entry: zipfile.ZipInfo, most: int) -> None:
    if entry.file_size > most:  # zipfile unpacks no more than it says here
        raise ValueError(f"{entry.filename} of {entry.file_size} byte must be <= {most} byte")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{entry.filename} must be stored or deflated")  # others take memory


def _table(members: Mapping[str, bytes], name: str, path: str | Path) -> dict[str, Any]:
    try:
        parsed = json.loads(members[name])
    except _FAULTS as error:
        raise ModelError(f"{path}: {name} cannot be read; this is no intact model file") from error
    if not isinstance(parsed, dict):
        raise ModelError(f"{path}: {name} is no table; this is no intact model file")
    return parsed


def _check_seal(
    seal: Mapping[str, Any], members: Mapping[str, bytes], path: str | Path, kind: str
) -> None:
    """Check version, kind and the checksum of each member."""
    for name, wanted in (("schema_version", BUNDLE_SCHEMA), ("features", feature_version())):
        if seal.get(name) != wanted:
            raise _other_version(path, name, seal.get(name), wanted)
    if seal.get("kind") != kind:
        raise ModelError(
            f"{path} is a {str(seal.get('kind'))[:40]}, must be a {kind}; name one, or retrain it"
        )
    stated = seal.get("sha256")
    wanted_sums = stated if isinstance(stated, dict) else {}
    found = {n: hashlib.sha256(d).hexdigest() for n, d in members.items() if n != _SEAL}
    if found != wanted_sums:
        changed = sorted(n for n in {*found, *wanted_sums} if found.get(n) != wanted_sums.get(n))
        raise ModelError(
            f"{path}: checksum of {', '.join(changed)[:200]} does not fit; the file was changed "
            "or damaged: take an intact copy or retrain"
        )


def _arrays(data: bytes) -> dict[str, NDArray[Any]]:
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        entries = file.infolist()
        size = sum(entry.file_size for entry in entries)
        if len(entries) > _MOST_ARRAYS or size > _LARGEST_ARRAYS:
            raise ValueError(
                f"{len(entries)} arrays of {size} byte must be <= {_MOST_ARRAYS} of "
                f"{_LARGEST_ARRAYS} byte"
            )
        contents = _unpacked(file, {entry.filename: _LARGEST_ARRAYS for entry in entries})
    return {name.removesuffix(".npy"): _array(content) for name, content in contents.items()}


def _array(content: bytes) -> NDArray[Any]:
    """Numbers of an array, whose header is believed only where it fits what follows.

    `numpy.load` sets aside what the header asks for before it looks how much there is.
    """
    stream = io.BytesIO(content)
    if npy.read_magic(stream) != (1, 0):
        raise ValueError("an array must be of version 1.0 of its format")
    shape, by_column, kind = npy.read_array_header_1_0(stream, max_header_size=_LONGEST_HEADER)
    start = stream.tell()
    if kind.kind not in "biuf":
        raise ValueError(f"an array is of type {str(kind)[:40]}, must be numbers")
    if math.prod(shape) * kind.itemsize != len(content) - start:
        raise ValueError(f"an array has {len(content) - start} byte, must fit shape {shape}")
    numbers = np.frombuffer(content, dtype=kind, offset=start)
    return numbers.reshape(shape, order="F" if by_column else "C")
