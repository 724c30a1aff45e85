"""File attributes of a data set, and the hashes that protect them, its manifest and its signals."""

import hashlib
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ...sim.output.recording import DataError, SignalLayout
from ...sim.output.sensor import Channel

LARGEST_TEXT = 60_000
"""Longest text of one file attribute [byte]; HDF5 allows 64 KiB."""

_LIBRARIES = ("numpy", "scipy", "numba", "h5py")
_TEXTS = (
    *("recipe", "scene", "overrides", "fidelity", "merged_from"),
    *("limit_source", "created_by", "libraries"),
)

_LATER_TEXTS = {"fidelity": "", "merged_from": ""}
"""Texts that older files lack."""

HASHES = ("attributes_sha256", "manifest_sha256")
"""Attributes holding the hash of all other attributes, and that of the manifest."""


@cache  # each look-up reads a file, which takes a sixth of the time of a small data set
def _library_versions() -> str:
    """Versions of the libraries that the records depend on, as JSON."""
    return json.dumps({name: version(name) for name in _LIBRARIES})


@dataclass(frozen=True, kw_only=True)
class Attributes(SignalLayout):
    """Properties common to all records of a data set file.

    Parameters
    ----------
    sample_rate, channels, tacho, pulses_per_revolution, origin
        As in :class:`~...sim.output.recording.SignalLayout`.
    severities : tuple of str
        Manifest columns that hold the wear of each record [SI].
    grade_edges : tuple of float
        Clearances at which grades 1, 2, 3 begin [m]; empty if unknown.
    condemning_limit : float
        Wear at which the part must be renewed [m]; NaN if unknown.
    limit_source : str
        Source of the limits.
    recipe, scene : str
        TOML text of the recipe and of the scene.
    overrides : str
        JSON table of the replaced values of the recipe.
    fidelity : str
        JSON of the choice of rungs for the whole set; empty if they are those of the scene.
    merged_from : str
        JSON of the data sets that were merged into this one; empty if it was not merged.
    seed : int
        Seed of the data set.
    truth : bool
        Whether hidden quantities are stored.
    created_by, libraries : str
        Program and libraries, with versions.
    """

    severities: tuple[str, ...] = ()
    grade_edges: tuple[float, ...] = ()
    condemning_limit: float = float("nan")
    limit_source: str = ""
    recipe: str = ""
    scene: str = ""
    overrides: str = "{}"
    fidelity: str = ""
    merged_from: str = ""
    seed: int = 0
    truth: bool = False
    created_by: str = f"wearstate {__version__}"
    libraries: str = field(default_factory=_library_versions)

    def __post_init__(self) -> None:
        self.refuse_contradictions("data set")
        _check_wear(self)
        long = [name for name, text in texts_of(self).items() if len(text.encode()) > LARGEST_TEXT]
        if long:
            raise DataError(
                f"data set: text of {', '.join(long)} must be <= {LARGEST_TEXT} byte; shorten it"
            )


def _check_wear(item: Attributes) -> None:
    """Refuse severities and limits that contradict each other."""
    faults = []
    if len(set(item.severities)) != len(item.severities):
        faults.append(f"severities {list(item.severities)} must be unique; name each once")
    edges = item.grade_edges
    if any(not low < high for low, high in pairwise((0.0, *edges))):
        faults.append(f"grade_edges = {list(edges)} m must be > 0 and rise; correct the limits")
    if edges and not item.condemning_limit >= edges[-1]:
        faults.append(
            f"condemning_limit = {item.condemning_limit:g} m must be >= {edges[-1]:g} m, the last "
            "grade edge; correct the limits"
        )
    if faults:
        raise DataError("\n".join(f"data set: {fault}" for fault in faults))


def texts_of(attributes: Attributes) -> dict[str, str]:
    """Long texts among the attributes, which the file stores unchanged."""
    return {name: getattr(attributes, name) for name in _TEXTS}


def attributes_of(stored: Mapping[str, Any]) -> Attributes:
    """Inverse of :func:`_file_attributes`."""
    for name in ("recipe", "scene"):
        if text_hash(stored[name]) != stored[f"{name}_sha256"]:
            raise DataError(f"text of the {name} does not fit its hash; take an intact copy")
    return Attributes(
        sample_rate=float(stored["sample_rate_hz"]),
        channels=tuple(Channel(**entry) for entry in json.loads(stored["channels"])),
        origin=stored["origin"],
        tacho=stored["tacho"] or None,
        pulses_per_revolution=int(stored["pulses_per_revolution"]),
        severities=tuple(json.loads(stored["severities"])),
        grade_edges=tuple(json.loads(stored["grade_edges_m"])),
        condemning_limit=float(stored["condemning_limit_m"]),
        seed=int(stored["seed"]),
        truth=bool(stored["truth"]),
        # absent in a set made before rungs could be chosen
        **{name: str({**_LATER_TEXTS, **stored}[name]) for name in _TEXTS},
    )


def named(path: Path, stored: Mapping[str, Any]) -> Attributes:
    """Attributes of a file, whose path is named in error messages."""
    try:
        return attributes_of(stored)
    except DataError as error:
        faults = str(error).replace("data set: ", "").split("\n")
        raise DataError("\n".join(f"{path}: {fault}" for fault in faults)) from None


def signal_checksum(signal: NDArray[np.float32]) -> int:
    """Checksum of a record's signal, as in its manifest row.

    Examples
    --------
    >>> signal_checksum(np.zeros((1, 2), dtype=np.float32))
    1696784233
    """
    return zlib.crc32(signal.data)


def text_hash(text: str) -> str:
    """SHA-256 of a text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def attributes_hash(stored: Mapping[str, Any]) -> str:
    """Hash of a file's attributes without the hashes themselves.

    Parameters
    ----------
    stored : mapping
        Attributes as read by h5py.

    Examples
    --------
    >>> attributes_hash({"seed": "1"}) == attributes_hash({"seed": "1", "manifest_sha256": "x"})
    True
    """
    plain = {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in stored.items()
        if name not in HASHES
    }
    return text_hash(json.dumps(plain, sort_keys=True, default=str))


def manifest_hash(rows: NDArray[np.void]) -> str:
    """Hash of a manifest: its columns with their types, and every row.

    Parameters
    ----------
    rows : numpy.ndarray [shape=(n_records,)]
        Manifest, structured as in the file.

    Examples
    --------
    >>> one = np.zeros(1, dtype=[("grade", "i1")])
    >>> manifest_hash(one) == manifest_hash(one.view([("group", "i1")]))
    False
    """
    columns = [(name, rows.dtype[name].str) for name in rows.dtype.names or ()]
    digest = hashlib.sha256(json.dumps(columns).encode())
    digest.update(np.ascontiguousarray(rows).view(np.uint8).data)
    return digest.hexdigest()


def stamped(stored: Mapping[str, Any], rows: NDArray[np.void]) -> dict[str, Any]:
    """A file's attributes with matching hashes.

    Parameters
    ----------
    stored : mapping
        Attributes; hashes among them are replaced.
    rows : numpy.ndarray [shape=(n_records,)]
        Manifest, structured.
    """
    found = {name: value for name, value in stored.items() if name not in HASHES}
    hashes = zip(HASHES, (attributes_hash(found), manifest_hash(rows)), strict=True)
    return {**found, **{name: np.bytes_(value) for name, value in hashes}}


def refuse_other_hashes(stored: Mapping[str, Any], rows: NDArray[np.void], path: Path) -> None:
    """Refuse altered attributes or labels; a file made before there were hashes is accepted."""
    made = stamped(stored, rows)
    faults = [
        f"{path}: {name} is {_hex(stored[name])[:8]}…, must be {_hex(made[name])[:8]}…; take an "
        "intact copy, or delete that attribute if the change is intended"
        for name in HASHES
        if name in stored and _hex(stored[name]) != _hex(made[name])
    ]
    if faults:
        raise DataError("\n".join(faults))


def _hex(value: Any) -> str:
    # the hash itself may be what is damaged
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
