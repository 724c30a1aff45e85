"""The data set file: one HDF5 layout for simulated and measured recordings."""

import hashlib
import json
import math
import os
import re
import shutil
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ... import __version__
from ...sim.atomic import OutputError, fresh_name, put_in_place
from ...sim.output.recording import (
    DataError,
    Recording,
    SignalLayout,
    html_table,
    missing_file,
)
from ...sim.output.sensor import Channel
from .hdf5_values import HDF5_FAULTS, fill_room, is_plain, make_room, plain_values, write_values
from .machines import machine_identities

SCHEMA_VERSION = 1

LARGEST_RECORD = 2**31
"""Largest believable record [byte]: 100 channels of 100 s at 50 kHz."""

LARGEST_TEXT = 60_000
"""Longest text of one file attribute [byte]; HDF5 holds 64 KiB."""

_LIBRARIES = ("numpy", "scipy", "numba", "h5py")

_HEAD = {
    "record_id": "S16",
    "group": "<i8",
    "seed": "<u8",
    "done": "?",
    "status": "S24",
    "grade": "i1",
}
_TAIL = {"signal_crc32": "<u4"}


class WriteError(RuntimeError):
    """A data set file cannot be written on; names file, cause and cure. What is in it stays."""


@cache  # each look-up reads a file: a sixth of the time of a small data set
def _library_versions() -> str:
    """Versions of what the records depend on, as JSON."""
    return json.dumps({name: version(name) for name in _LIBRARIES})


@dataclass(frozen=True, kw_only=True)
class Attributes(SignalLayout):
    """What holds for every record of a data set file.

    Parameters
    ----------
    sample_rate, channels, tacho, pulses_per_revolution, origin
        As of :class:`~...sim.output.recording.SignalLayout`.
    severities : tuple of str
        Manifest columns that say how worn each record is [SI].
    grade_edges : tuple of float
        Clearances at which grades 1, 2, 3 begin [m]; empty where unknown.
    condemning_limit : float
        [m]; NaN where unknown.
    limit_source : str
        Where the limits are from.
    recipe, scene : str
        Their TOML text.
    overrides : str
        JSON table of what replaced values of the recipe.
    fidelity : str
        JSON of the choice of rungs for the whole set; empty where they are as written.
    merged_from : str
        JSON of the data sets that were merged into this one; empty where it is none of those.
    seed : int
        Seed of the data set.
    truth : bool
        Hidden quantities are stored.
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
        long = [name for name, text in _texts(self).items() if len(text.encode()) > LARGEST_TEXT]
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


_TEXTS = (
    *("recipe", "scene", "overrides", "fidelity", "merged_from"),
    *("limit_source", "created_by", "libraries"),
)
_LATER_TEXTS = {"fidelity": "", "merged_from": ""}
"""Texts that older files lack."""


def _texts(attributes: Attributes) -> dict[str, str]:
    return {name: getattr(attributes, name) for name in _TEXTS}


def _file_attributes(attributes: Attributes) -> dict[str, Any]:
    """Names and values as the file holds them."""
    return {
        "schema_version": SCHEMA_VERSION,
        "origin": attributes.origin,
        "sample_rate_hz": float(attributes.sample_rate),
        "channels": json.dumps([asdict(channel) for channel in attributes.channels]),
        "tacho": attributes.tacho or "",
        "pulses_per_revolution": attributes.pulses_per_revolution,
        "severities": json.dumps(attributes.severities),
        "grade_edges_m": json.dumps(attributes.grade_edges),
        "condemning_limit_m": float(attributes.condemning_limit),
        "recipe_sha256": _sha256(attributes.recipe),
        "scene_sha256": _sha256(attributes.scene),
        "seed": str(attributes.seed),
        "truth": int(attributes.truth),
        **_texts(attributes),
    }


def _attributes_of(stored: Mapping[str, Any]) -> Attributes:
    """Inverse of :func:`_file_attributes`."""
    for name in ("recipe", "scene"):
        if _sha256(stored[name]) != stored[f"{name}_sha256"]:
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
        # a set made before rungs could be chosen has none
        **{name: str({**_LATER_TEXTS, **stored}[name]) for name in _TEXTS},
    )


def _named(path: Path, stored: Mapping[str, Any]) -> Attributes:
    """Attributes of a file; what is wrong with them names it."""
    try:
        return _attributes_of(stored)
    except DataError as error:
        faults = str(error).replace("data set: ", "").split("\n")
        raise DataError("\n".join(f"{path}: {fault}" for fault in faults)) from None


def signal_checksum(signal: NDArray[np.float32]) -> int:
    """Checksum of a record's signal, as its manifest row holds it.

    Examples
    --------
    >>> signal_checksum(np.zeros((1, 2), dtype=np.float32))
    1696784233
    """
    return zlib.crc32(signal.data)


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@contextmanager
def _refusing(path: Path, what: str) -> Iterator[None]:
    """Turn what h5py raises on damaged bytes into one message."""
    try:
        yield
    except DataError:
        raise
    except HDF5_FAULTS as error:
        text = " ".join(str(error).split())
        cure = "wait for the other program" if "lock" in text else "take an intact copy"
        raise DataError(f"{path}: {what} cannot be read ({text}); {cure}") from error


class DataSet:
    """A data set file, open for reading.

    Opens by path, once per process, so that it can be pickled and handed to loader workers.

    Parameters
    ----------
    path : str or Path
        A finished file of this program.

    Attributes
    ----------
    attributes : Attributes
        What holds for every record.
    stored : dict
        The same and the hashes, as numbers and texts by name in the file.
    rows : numpy.ndarray [shape=(n_records,)]
        Labels, conditions and numerics, structured as in the file.
    unhashed : tuple of str
        Those of `HASHES` that the file lacks: one made before there were hashes.

    Raises
    ------
    DataError
        There is no such file, it is unfinished (``.part``), truncated, damaged or altered, of
        another program, or of another schema version.

    Examples
    --------
    Signals of the first two records, one after the other::

        with DataSet("data.h5") as data:
            rms = [data[i].vibration.std(axis=1) for i in range(2)]
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path).absolute()
        self._file: Any = None
        self._signals: Any = None
        self._intact = bytearray()
        self._pid = -1
        _refuse_by_name(self.path)
        with _refusing(self.path, "file"):
            handle = self._handle()
        with _refusing(self.path, "attributes"):
            self.stored = _stored_attributes(handle, self.path)
            self.attributes = _named(self.path, self.stored)
        with _refusing(self.path, "layout"):
            _check_layout(self._handle(), self.attributes, self.path)
        with _refusing(self.path, "manifest"):
            self.rows: NDArray[np.void] = self._handle()["manifest"][:]
        _refuse_unfinished(self.rows["done"], self.path)
        _refuse_other_hashes(self.stored, self.rows, self.path)
        self.unhashed = tuple(sorted(set(HASHES) - set(self.stored)))

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        """File, records, length, rate, channels and label."""
        return f"<DataSet {self.path.name}, {', '.join(self._facts)}>"

    def _repr_html_(self) -> str:
        """For notebooks: the same and the first rows of the manifest."""
        head = self.manifest.iloc[:5]
        rows = [tuple(row) for row in head.itertuples(index=False)]
        return html_table(f"{self.path.name}, {', '.join(self._facts)}", list(head.columns), rows)

    @property
    def _facts(self) -> tuple[str, ...]:
        head = self.attributes
        records, _, samples = self.stored_shape
        label = f"label {' '.join(head.severities)}" if head.severities else "no wear label"
        length = f"{records} {head.origin} records of {samples / head.sample_rate:.4g} s"
        return length, f"{head.sample_rate:.6g} Hz", " ".join(head.names), label

    @cached_property
    def manifest(self) -> pd.DataFrame:
        """The rows as a table with texts decoded; made when first asked for."""
        with _refusing(self.path, "manifest"):
            return _decoded(self.rows)

    @cached_property
    def machines(self) -> tuple[str, ...]:
        """Identity of the machine of each record; empty where unknown."""
        head = self.attributes
        return machine_identities(self.rows, head.recipe, head.seed)

    def __getitem__(self, index: int) -> Recording:
        """Read one record.

        Raises
        ------
        IndexError
            `index` is not below the number of records.
        DataError
            The stored signal is damaged or not finite.
        """
        number = self._number(index)
        signal = self.stored_signal(number)
        row = self.row(number)
        self._refuse_damaged(number, signal)
        head = self.attributes
        return Recording(
            signal=signal,
            sample_rate=head.sample_rate,
            channels=head.channels,
            tacho=head.tacho,
            pulses_per_revolution=head.pulses_per_revolution,
            origin=head.origin,
            row=row,
            source=f"{self.path.name}[{number}]",
            machine=self.machines[number],
        )

    def _refuse_damaged(self, number: int, signal: NDArray[np.float32]) -> None:
        """Look at the checksum of a record when it is read first; it is most of the time then."""
        if self._intact[number]:
            return
        found, wanted = signal_checksum(signal), int(self.rows["signal_crc32"][number])
        if found != wanted:
            raise DataError(
                f"{self.path}: signal of record {number} has checksum {found}, must be {wanted}; "
                "take an intact copy"
            )
        self._intact[number] = True

    @property
    def stored_shape(self) -> tuple[int, int, int]:
        """Records, channels and samples of the file."""
        n_records, n_channels, n_samples = self._signal().shape
        return n_records, n_channels, n_samples

    def row(self, index: int) -> dict[str, Any]:
        """Labels, conditions and numerics of one record, without its signal.

        Raises
        ------
        IndexError
            `index` is not below the number of records.
        DataError
            They are damaged.
        """
        number = self._number(index)
        with _refusing(self.path, f"record {number}"):
            return _plain_row(self.rows[number])

    def stored_signal(self, index: int) -> NDArray[np.float32]:
        """Signal of one record as the file holds it, its checksum not looked at.

        Raises
        ------
        IndexError
            `index` is not below the number of records.
        DataError
            It cannot be read.
        """
        number = self._number(index)
        with _refusing(self.path, f"record {number}"):
            signal: NDArray[np.float32] = self._signal()[number]
            return signal

    def truth(self, index: int) -> dict[str, NDArray[np.float32]]:
        """Hidden quantities of one record, by name; empty where none are stored.

        Raises
        ------
        IndexError
            `index` is not below the number of records.
        DataError
            They are damaged.
        """
        number = self._number(index)
        with _refusing(self.path, f"truth of record {number}"):
            group = self._handle().get("truth", {})
            return {name: group[name][number] for name in group}

    @cached_property
    def splits(self) -> dict[str, dict[str, Any]]:
        """How each stored split was made, by name: ``kind``, ``text``, ``machines_apart`` and more.

        Raises
        ------
        DataError
            They are damaged.
        """
        with _refusing(self.path, "splits"):
            stored = self._handle().get("splits", {})
            about = {
                name: plain_values(self.path, stored[name], f"splits/{name}")["about"].strip()
                for name in stored
            }
            return {name: _table(text) for name, text in about.items() if text}

    def split(self, name: str) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Records of the two sides of a stored split; a record may be in neither.

        Parameters
        ----------
        name : str
            Key of `splits`.

        Returns
        -------
        train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
            Record numbers, rising.

        Raises
        ------
        DataError
            There is no such split, or it is damaged.
        """
        if name not in self.splits:
            raise DataError(
                f"{self.path}: split = {name!r} must be one of {', '.join(self.splits) or '(none)'}"
                "; choose one, or add it with wearstate splits"
            )
        with _refusing(self.path, f"split {name}"):
            sides = self._handle()["splits"][name][:]
        if sides.shape != (len(self),) or not np.isin(sides, (-1, 0, 1)).all():
            raise DataError(
                f"{self.path}: split {name} must be -1, 0 or 1 for each of {len(self)} records; "
                "add it again with wearstate splits"
            )
        return np.flatnonzero(sides == 0), np.flatnonzero(sides == 1)

    def _number(self, index: int) -> int:
        number = index + len(self) if index < 0 else index
        if not 0 <= number < len(self):
            raise IndexError(f"record {index} must be < {len(self)}, the records of {self.path}")
        return number

    def _handle(self) -> Any:
        # an HDF5 handle must not cross a fork
        if self._file is None or self._pid != os.getpid():
            self._file = h5py.File(self.path, "r")
            self._signals = None
            self._pid = os.getpid()
        return self._file

    def _signal(self) -> Any:
        # looked up once: by name takes as long as a third of reading a second of signal
        file = self._handle()
        if self._signals is None:
            self._signals = file["signal"]
            self._intact = bytearray(len(self))
        return self._signals

    def close(self) -> None:
        """Close the file; reading opens it again."""
        if self._file is not None and self._pid == os.getpid():
            self._file.close()
        self._file = self._signals = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        own = {k: v for k, v in self.__dict__.items() if k not in ("manifest", "splits")}
        return {**own, "_file": None, "_signals": None, "_pid": -1}


def _refuse_by_name(path: Path) -> None:
    if path.suffix == ".part":
        raise DataError(
            f"{path} is an unfinished data set; run the same generate command again to finish it"
        )
    if not path.is_file():
        part = _part(path)
        there = part.is_file()
        cure = f"{part.name} is there: run the same command again" if there else "check the path"
        raise DataError(missing_file(path, cure))


def _stored_attributes(file: Any, path: Path) -> dict[str, Any]:
    # of a foreign file nothing else is read
    stored = plain_values(path, file) if "created_by" in file.attrs else {}
    if not str(stored.get("created_by", "")).startswith("wearstate "):
        raise DataError(
            f"{path}: created_by = {stored.get('created_by')!r}, must begin with 'wearstate'; the "
            "file is of another program: import it, giving sample rate and unit"
        )
    if stored["schema_version"] != SCHEMA_VERSION:
        cure = (
            "update wearstate" if stored["schema_version"] > SCHEMA_VERSION else "generate it again"
        )
        raise DataError(
            f"{path}: schema_version = {stored['schema_version']} must be {SCHEMA_VERSION}; {cure}"
        )
    return stored


def _check_layout(file: Any, attributes: Attributes, path: Path) -> None:
    """Refuse a layout that the attributes contradict, before anything large is read."""
    signal, manifest = file["signal"], file["manifest"]
    beside = [node for group in ("truth", "splits") for node in file.get(group, {}).values()]
    for dataset in (signal, manifest, *beside):
        _check_storage(dataset, path)
    wanted = (len(manifest), len(attributes.channels))
    if signal.shape[:2] != wanted or signal.ndim != 3 or signal.dtype != np.float32:
        raise DataError(
            f"{path}: signal is {signal.dtype} {signal.shape}, must be float32 {wanted} and "
            "samples; take an intact copy"
        )
    missing = [
        name
        for name in (*_HEAD, *_TAIL, *attributes.severities)
        if name not in (manifest.dtype.names or ())
    ]
    if missing:
        raise DataError(f"{path}: manifest lacks {', '.join(missing)}; generate or import it again")


def _check_storage(dataset: Any, path: Path) -> None:
    """Refuse sizes that the file cannot hold, and data kept in other files."""
    if not is_plain(dataset.id.get_type()):
        raise DataError(f"{path}: {dataset.name} must hold numbers and texts; take an intact copy")
    if dataset.is_virtual or dataset.external:
        raise DataError(f"{path}: {dataset.name} is kept in other files; copy it into one file")
    record = dataset.nbytes // max(len(dataset), 1)
    stored = dataset.id.get_storage_size()
    plain = dataset.compression is None
    if record > LARGEST_RECORD or (plain and stored < dataset.nbytes):
        raise DataError(
            f"{path}: {dataset.name} declares {record} byte per record (must be <= "
            f"{LARGEST_RECORD}) and holds {stored} of {dataset.nbytes} byte; take an intact copy"
        )


def _table(text: str) -> dict[str, Any]:
    """A JSON table; anything else is damage."""
    found = json.loads(text)
    if not isinstance(found, dict):
        raise ValueError(f"{_short(found)} must be a table")
    return found


def _refuse_unfinished(done: NDArray[np.bool_], path: Path) -> None:
    if not done.all():
        raise DataError(
            f"{path}: {np.count_nonzero(done)} of {len(done)} records are done, must be all; "
            "rename it to end in .part and run the same generate command again"
        )


HASHES = ("attributes_sha256", "manifest_sha256")
"""Attributes that hold the hash of all other attributes, and of the manifest."""


def attributes_hash(stored: Mapping[str, Any]) -> str:
    """Hash of a file's attributes, the hashes left out.

    Parameters
    ----------
    stored : mapping
        As h5py gives them.

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
    return _sha256(json.dumps(plain, sort_keys=True, default=str))


def manifest_hash(rows: NDArray[np.void]) -> str:
    """Hash of a manifest: its columns with their types, and every row.

    Parameters
    ----------
    rows : numpy.ndarray [shape=(n_records,)]
        Structured, as in the file.

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
    """A file's attributes with the hashes that belong to them.

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


def _refuse_other_hashes(stored: Mapping[str, Any], rows: NDArray[np.void], path: Path) -> None:
    """Refuse altered labels; a file made before there were hashes is read as it is."""
    made = stamped(stored, rows)
    faults = [
        f"{path}: {name} is {_hex(stored[name])[:8]}…, must be {_hex(made[name])[:8]}…; take an "
        "intact copy, or delete that attribute where the change was wanted"
        for name in HASHES
        if name in stored and _hex(stored[name]) != _hex(made[name])
    ]
    if faults:
        raise DataError("\n".join(faults))


def _hex(value: Any) -> str:
    # the hash itself may be what is damaged
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _plain_row(row: np.void) -> dict[str, Any]:
    """Manifest values of one record, as Python has them."""
    return {
        name: value.decode() if isinstance(value, bytes) else value
        for name, value in zip(row.dtype.names or (), row.item(), strict=True)
    }


def _decoded(rows: NDArray[np.void]) -> pd.DataFrame:
    columns = {}
    for name in rows.dtype.names or ():
        column = rows[name]
        columns[name] = np.char.decode(column, "utf-8") if column.dtype.kind == "S" else column
    return pd.DataFrame(columns)


def _part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _identity(path: Path) -> tuple[int, int] | None:
    """What tells a file from another of its name; None where there is none."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino


def unfinished_attributes(path: str | Path) -> Attributes | None:
    """What an unfinished file of a data set says of itself; None where there is none.

    Parameters
    ----------
    path : str or Path
        Of the finished file.

    Raises
    ------
    DataError
        The unfinished file cannot be read.
    """
    part = _part(Path(path).absolute())
    if not part.is_file():
        return None
    with _refusing(part, f"unfinished file (or delete it; {part.stem})"), h5py.File(part) as file:
        return _attributes_of(_stored_attributes(file, part))


class LostError(WriteError):
    """The file being written is not where it was; the text says what became of its records."""


class DataSetWriter:
    """Writes a data set file, record by record, so that a killed run can go on.

    All space is taken before the first record, in ``<path>.part``; from then on only bytes inside
    it change, first the signal, then its manifest row with ``done``. `finish` renames. A run that
    is killed loses the records in flight. A checksum per record finds those that a power cut has
    lost; they are written again. Hidden quantities tell their shapes with the first record that
    has any: the file is then laid out anew beside itself, once.

    Parameters
    ----------
    path : str or Path
        File to write.
    attributes : Attributes
        What holds for every record.
    n_records, n_samples : int
        Both >= 1.
    columns : mapping
        Further manifest columns: name -> numpy type, in order.
    splits : sequence of str
        Names of the splits that may be written.
    force : bool
        Replace an existing file, and start an unfinished one anew.
    resumable : bool
        False: the unfinished file has a name of its own and goes where the run fails; one that
        another run left stays.

    Raises
    ------
    DataError
        The file exists, the folder does not or has no room or may not be written, or an
        unfinished file is of another run, or is being written. Nothing is left behind.

    Examples
    --------
    >>> import tempfile
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> head = Attributes(sample_rate=100.0, channels=(channel,), origin="measured")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "data.h5"
    ...     with DataSetWriter(path, head, n_records=1, n_samples=4) as writer:
    ...         writer.write(0, np.ones((1, 4)), {"record_id": "a", "status": "ok"})
    ...         writer.finish()
    ...     with DataSet(path) as data:
    ...         data[0].signal
    array([[1., 1., 1., 1.]], dtype=float32)
    """

    def __init__(
        self,
        path: str | Path,
        attributes: Attributes,
        *,
        n_records: int,
        n_samples: int,
        columns: Mapping[str, str] | None = None,
        splits: Sequence[str] = (),
        force: bool = False,
        resumable: bool = True,
    ) -> None:
        self.path = Path(path).absolute()
        self.part = _part(self.path) if resumable else fresh_name(self.path)
        self._force, self._resumable = force, resumable
        self.attributes = attributes
        self._shape = (n_records, len(attributes.channels), n_samples)
        self._dtype = np.dtype([*{**_HEAD, **(columns or {}), **_TAIL}.items()])
        self._splits = tuple(splits)
        self._file: Any = None
        refuse_output(self.path, force)
        _refuse_busy(self.part)
        if force:
            self.part.unlink(missing_ok=True)
        if not self.part.exists():
            self._lay_out()
        self._resume()

    def _lay_out(self, truth: Mapping[str, tuple[int, ...]] | None = None) -> None:
        """Make the empty ``.part`` under another name first: it is whole or it is not there."""
        hidden = sum(math.prod(shape) for shape in (truth or {}).values())
        _refuse_size(self._shape, self._dtype, hidden, self.path.parent)
        fresh = fresh_name(self.path)
        try:
            with _laying_out(self.path), h5py.File(fresh, "w") as file:
                empty = np.zeros(0, dtype=self._dtype)
                # both hashes in place from the start, so that finishing changes no structure
                write_values(file, stamped(_file_attributes(self.attributes), empty))
                _create(file, "signal", self._shape, np.dtype(np.float32), chunk=True)
                _create(file, "manifest", self._shape[:1], self._dtype, chunk=False)
                for name in self._splits:
                    lay_out_split(file, name, self._shape[0])
                for name, shape in (truth or {}).items():
                    shape = (self._shape[0], *shape)
                    _create(file, f"truth/{name}", shape, np.dtype(np.float32), chunk=True)
                self._copy_done(file)
            with _laying_out(self.path):
                _take_space(fresh)
            os.replace(fresh, self.part)
        except BaseException:
            fresh.unlink(missing_ok=True)
            raise

    def _copy_done(self, file: Any) -> None:
        """Take over what the file at hand holds, when it is laid out anew."""
        if self._file is None:
            return
        hidden = [f"truth/{name}" for name in self._file.get("truth", {})]
        for name in ("signal", *hidden, "manifest"):
            for index in np.flatnonzero(self.done):
                file[name][index] = self._file[name][index]

    def _resume(self) -> None:
        with _refusing(self.part, f"unfinished file (or delete it; {self.path.name})"):
            self._file = _opened(self.part)
        try:
            self._identity = _identity(self.part)
            with _refusing(self.part, "unfinished file"):
                self._refuse_other_run()
                self._signal, self._manifest = self._file["signal"], self._file["manifest"]
                self.done: NDArray[np.bool_] = self._intact()
        except BaseException:
            self.close()
            raise

    def _refuse_other_run(self) -> None:
        stored, wanted = plain_values(self.part, self._file), _file_attributes(self.attributes)
        for name, value in wanted.items():
            if not _same(stored.get(name), value):
                raise DataError(
                    f"{self.part}: {name} = {_short(stored.get(name))}, must be {_short(value)} "
                    "to go on with it; repeat the command that began it, or use force to restart"
                )
        found = (self._file["signal"].shape, self._file["manifest"].dtype)
        if found != (self._shape, self._dtype):
            raise DataError(
                f"{self.part}: signal has shape {found[0]}, must be {self._shape} (records, "
                "channels, samples) with the same manifest to go on with it; repeat the command "
                "that began it, or use force to restart"
            )

    def _intact(self) -> NDArray[np.bool_]:
        """Which records are done and still fit their checksum [shape=(n_records,)]."""
        rows = self.manifest()
        done = np.array(rows["done"], dtype=bool)
        for index in np.flatnonzero(done):
            signal = self._signal[index]
            done[index] = signal_checksum(signal) == rows["signal_crc32"][index]
        return done

    def write(
        self,
        index: int,
        signal: NDArray[Any],
        row: Mapping[str, Any],
        truth: Mapping[str, NDArray[Any]] | None = None,
    ) -> None:
        """Write one record and mark it done.

        Parameters
        ----------
        index : int
            Record number.
        signal : numpy.ndarray [shape=(n_channels, n_samples)]
            Stored as float32.
        row : mapping
            Manifest values by column; a column left out is NaN, -1 or empty.
        truth : mapping, optional
            Hidden quantities, the same names and shapes in every record; stored as float32.

        Raises
        ------
        DataError
            Signal or row do not fit the file, or a sample is not finite.
        WriteError
            The disk is full or failing. The records marked done are whole.
        LostError
            The unfinished file is not in its place any more.
        """
        self.refuse_lost()
        samples = np.ascontiguousarray(signal, dtype=np.float32)
        if samples.shape != self._shape[1:]:
            raise DataError(
                f"signal of record {index} has shape {samples.shape}, must be {self._shape[1:]}; "
                "one file holds records of one length"
            )
        if not np.isfinite(samples).all():
            bad = np.count_nonzero(~np.isfinite(samples))
            raise DataError(
                f"signal of record {index} has {bad} sample(s) that are not finite, must be 0; "
                "write zeros and a status that says why"
            )
        values = {**row, "done": True, "signal_crc32": signal_checksum(samples)}
        filled = _filled(self._dtype, values, index)
        self._make_place(truth or {})
        with _writing(self.part):
            _write_chunk(self._signal, index, samples)
            for name, array in (truth or {}).items():
                _write_chunk(self._file[f"truth/{name}"], index, array)
            # a row that says done must never precede its signal
            self._file.flush()
            self._manifest[index] = filled
            self._file.flush()
        self.done[index] = True

    def _make_place(self, truth: Mapping[str, NDArray[Any]]) -> None:
        """Place for hidden quantities, in a new file: a structure half changed cannot be read."""
        there = self._file.get("truth", {})
        if all(name in there for name in truth):
            return
        shapes = {name: tuple(there[name].shape[1:]) for name in there}
        self._lay_out({**shapes, **{name: np.shape(array) for name, array in truth.items()}})
        self.close()
        self._resume()

    def refuse_lost(self) -> None:
        """Refuse to go on where the unfinished file is not in its place any more.

        Raises
        ------
        LostError
            It was deleted, moved or replaced.
        """
        if _identity(self.part) != self._identity:
            written = np.count_nonzero(self.done)
            raise LostError(
                f"{self.part} is gone: it was deleted, moved or replaced during the run, and its "
                f"{written} records with it; 0 of {len(self.done)} are kept here. Repeat the "
                "command to start anew"
            )

    def manifest(self) -> NDArray[np.void]:
        """Manifest rows as they stand [shape=(n_records,)]."""
        rows: NDArray[np.void] = self._manifest[:]
        return rows

    def write_split(self, name: str, sides: NDArray[np.int8], about: str) -> None:
        """Write a split that place was laid out for.

        Parameters
        ----------
        name : str
            Of the split.
        sides : numpy.ndarray [shape=(n_records,)]
            0 train, 1 test, -1 neither.
        about : str
            How it was made, as JSON.
        """
        if f"splits/{name}" not in self._file:  # in one begun before there were splits
            lay_out_split(self._file, name, self._shape[0])
        fill_split(self._file, name, sides, about)

    def finish(self) -> None:
        """Close the file and give it its name.

        Raises
        ------
        DataError
            Not every record is done.
        WriteError
            The disk is full or failing; the unfinished file stays.
        LostError
            The unfinished file is not in its place any more.
        OutputError
            A file of its name appeared meanwhile; the unfinished file stays.
        """
        self.refuse_lost()
        _refuse_unfinished(self.done, self.part)
        with _writing(self.part):
            self._seal()

    def _seal(self) -> None:
        hashed = manifest_hash(self.manifest()).encode()
        if "manifest_sha256" in self._file.attrs:  # not in one begun before there were hashes
            fill_room(self._file, "manifest_sha256", hashed)
        self.close()
        put_in_place(self.part, self.path, force=self._force)

    def close(self) -> None:
        """Close the file; unless finished, the ``.part`` stays for the next run."""
        if self._file is not None:
            self._file.close()
        self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _kind: object, error: object, _trace: object) -> None:
        whole = error is None or isinstance(error, OutputError)  # whose text says where it is
        try:
            self.close()
        except (OSError, RuntimeError):  # the disk is still full: the first error tells it
            if error is None:
                whole = False
                raise
        finally:
            if not (whole or self._resumable):
                self.part.unlink(missing_ok=True)  # made anew, not gone on with


def refuse_output(path: Path, force: bool) -> None:
    """Refuse a file that cannot be written, or exists and may not be replaced.

    Parameters
    ----------
    path : Path
        Absolute.
    force : bool
        It may be replaced.

    Raises
    ------
    DataError
        Its name ends in ``.part``, it is a folder or in none, or it exists.
    """
    if path.suffix == ".part":
        raise DataError(f"{path}: the name must not end in .part, kept for unfinished files")
    if not path.parent.is_dir():
        raise DataError(f"{path.parent} is no folder; create it")
    if path.is_dir():
        raise DataError(f"{path} is a folder; name a file in it")
    if path.exists() and not force:
        raise DataError(f"{path} exists; choose another name or use force to replace it")


def _opened(part: Path) -> Any:
    """Open for writing without HDF5's buffer: what a full disk refuses must fail at once.

    HDF5 keeps what it could not write, fails over it again on closing, and ends the process with a
    fault of memory.
    """
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_sieve_buf_size(0)
    return h5py.File(h5py.h5f.open(os.fsencode(part), h5py.h5f.ACC_RDWR, fapl=access))


def _write_chunk(dataset: Any, index: int, values: NDArray[Any]) -> None:
    """Write a record's chunk as it is: no cache, no selection, a third of the time."""
    chunk = np.asarray(values, dtype=np.float32, order="C")
    if chunk.shape != dataset.shape[1:]:
        raise DataError(
            f"{dataset.name} of record {index} has shape {chunk.shape}, must be "
            f"{dataset.shape[1:]}; one file holds records of one shape"
        )
    dataset.id.write_direct_chunk((index, *(0,) * chunk.ndim), chunk)


def _refuse_busy(part: Path) -> None:
    """Refuse a file that another run is writing: it must not be taken from under it."""
    if not part.exists():
        return
    try:
        h5py.File(part, "r+").close()
    except OSError as error:
        if "lock" in str(error):
            raise DataError(f"{part} is being written by another run; wait for its end") from error


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn what the disk says into one message."""
    try:
        yield
    except WriteError:
        raise
    except (OSError, RuntimeError) as error:
        raise WriteError(
            f"{path} cannot be written ({_cause(error)}); mend the disk or make room"
        ) from error


@contextmanager
def _laying_out(path: Path) -> Iterator[None]:
    """The same for a file that is not there yet: another place will do."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise DataError(
            f"{path} cannot be made ({_cause(error)}); check rights and space, or choose another "
            "folder"
        ) from error


def _cause(error: Exception) -> str:
    """What the operating system said, without what HDF5 wraps around it."""
    at: BaseException | None = error
    while at is not None:  # closing fails after writing has, and says less
        if told := re.search("error message = '([^']*)'", str(at)):
            return told[1]
        at = at.__context__
    return getattr(error, "strerror", None) or str(error)


def _take_space(path: Path) -> None:
    """Claim the disk for all that will be written: HDF5 leaves holes, a full disk cannot fill them.

    A file system that copies on write, or a system without the call, can still run full.
    """
    if hasattr(os, "posix_fallocate"):
        with path.open("r+b") as handle:
            os.posix_fallocate(handle.fileno(), 0, path.stat().st_size)


def _refuse_size(
    shape: tuple[int, int, int], row: np.dtype[Any], hidden: int, folder: Path
) -> None:
    if min(shape) < 1:
        raise DataError(f"signal of shape {shape} must have >= 1 record, channel and sample")
    needed = 4 * math.prod(shape) + shape[0] * (row.itemsize + 4 * hidden)
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise DataError(
            f"{folder}: {free / 1e9:.1f} GB are free, must be >= {needed / 1e9:.1f} GB; ask for "
            "fewer records or choose another disk"
        )


def _create(
    file: Any, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], *, chunk: bool
) -> None:
    """Create a dataset with all its space, so that later writes touch no structure."""
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plan.set_obj_track_times(False)  # the same data, the same bytes
    if chunk:
        plan.set_chunk((1, *shape[1:]))
        plan.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    links = h5py.h5p.create(h5py.h5p.LINK_CREATE)
    links.set_create_intermediate_group(True)
    space = h5py.h5s.create_simple(shape)
    kind = h5py.h5t.py_create(dtype, logical=True)
    h5py.h5d.create(file.id, name.encode(), kind, space, dcpl=plan, lcpl=links)
    file.flush()


def lay_out_split(file: Any, name: str, n_records: int) -> None:
    """Make place for a split, so that filling it changes no structure; until then it has no sides.

    Parameters
    ----------
    file : h5py.File
        Of a data set, writable.
    name : str
        Of the split; one that is there is replaced.
    n_records : int
        Records of the file.
    """
    key = f"splits/{name}"
    if key in file:
        del file[key]
    _create(file, key, (n_records,), np.dtype(np.int8), chunk=False)
    file[key][:] = -1
    make_room(file[key], "about", _LONGEST_SPLIT)


def fill_split(file: Any, name: str, sides: NDArray[np.int8], about: str) -> None:
    """Write a split into the place laid out for it.

    Parameters
    ----------
    file : h5py.File
        Of a data set, writable.
    name : str
        Of the split.
    sides : numpy.ndarray [shape=(n_records,)]
        0 train, 1 test, -1 neither.
    about : str
        How it was made, as JSON.

    Raises
    ------
    DataError
        The text is too long.
    """
    text = about.encode()
    if len(text) > _LONGEST_SPLIT:
        raise DataError(
            f"split {name}: its text has {len(text)} byte, must be <= {_LONGEST_SPLIT}; bound "
            "fewer columns"
        )
    file[f"splits/{name}"][:] = sides
    fill_room(file[f"splits/{name}"], "about", text)


_LONGEST_SPLIT = 4000  # byte, as JSON: twenty columns with their bounds


def _filled(dtype: np.dtype[Any], values: Mapping[str, Any], index: int) -> NDArray[np.void]:
    """One manifest row; refuses unknown columns and texts that would be cut."""
    unknown = sorted(set(values) - set(dtype.names or ()))
    if unknown:
        raise DataError(f"row of record {index} has unknown columns {unknown}; declare them")
    row = np.zeros((), dtype=dtype)
    for name in dtype.names or ():
        kind = dtype[name]
        value = values.get(name, _UNKNOWN[kind.kind])
        encoded = value.encode() if isinstance(value, str) else value
        if kind.kind == "S" and len(encoded) > kind.itemsize:
            raise DataError(
                f"{name} = {value!r} of record {index} must be <= {kind.itemsize} byte; shorten it"
            )
        row[name] = encoded
    return row


_UNKNOWN: dict[str, Any] = {"S": b"", "i": -1, "u": 0, "b": False, "f": float("nan")}


def _same(found: Any, wanted: Any) -> bool:
    return bool(found == wanted) or (found != found and wanted != wanted)  # NaN fits NaN


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
