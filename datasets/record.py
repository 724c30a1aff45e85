"""The data set file: one HDF5 layout for simulated and measured recordings."""

import hashlib
import json
import math
import os
import shutil
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import h5py
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .. import __version__
from ..sim.sensor import Channel

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

_READ_FAULTS = (OSError, RuntimeError, KeyError, TypeError, ValueError, AttributeError, MemoryError)
"""What h5py raises on damaged bytes."""


class DataError(ValueError):
    """A data set or recording cannot be used; names quantity, value, bound and cure."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """One recording with everything needed to interpret it.

    Parameters
    ----------
    signal : numpy.ndarray [shape=(n_channels, n_samples)]
        Finite, in the unit of each channel; stored as float32.
    sample_rate : float
        [Hz]
    channels : tuple of Channel
        One per row of `signal`, names unique.
    tacho : str, optional
        Name of the tacho channel.
    pulses_per_revolution : int
        Of the tacho.
    origin : {"simulated", "measured"}
        Where the signal is from.
    row : mapping
        Manifest values: conditions, severities, grade, numerics; may be empty.
    source : str
        File name, for messages and reports.

    Raises
    ------
    DataError
        Shape, sample rate, names or tacho do not fit, or a sample is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> Recording(signal=np.zeros((1, 8)), sample_rate=100.0, channels=(channel,)).duration
    0.08
    """

    signal: NDArray[np.float32]
    sample_rate: float
    channels: tuple[Channel, ...]
    tacho: str | None = None
    pulses_per_revolution: int = 1
    origin: Literal["simulated", "measured"] = "measured"
    row: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        shape = np.shape(self.signal)
        if len(shape) != 2 or shape[0] != len(self.channels) or 0 in shape:
            raise DataError(
                f"{self.source or 'recording'}: signal has shape {shape}, must be "
                f"({len(self.channels)} channels, >= 1 samples); transpose it or name its channels"
            )
        _check_header(self, self.source or "recording")
        with np.errstate(over="ignore"):  # too large for float32 becomes inf, refused below
            object.__setattr__(self, "signal", np.asarray(self.signal, dtype=np.float32))
        _refuse_gaps(self)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.signal.shape[1] / self.sample_rate)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every channel."""
        return tuple(channel.name for channel in self.channels)

    @property
    def units(self) -> dict[str, str]:
        """Unit of every channel, by name."""
        return {channel.name: channel.unit for channel in self.channels}

    @property
    def vibration_channels(self) -> tuple[Channel, ...]:
        """Every channel but the tacho."""
        return tuple(channel for channel in self.channels if channel.name != self.tacho)

    @property
    def vibration_names(self) -> tuple[str, ...]:
        """Name of every channel but the tacho."""
        return tuple(channel.name for channel in self.vibration_channels)

    @property
    def vibration(self) -> NDArray[np.float32]:
        """Every channel but the tacho [shape=(n_vibration, n_samples)]."""
        rows = [i for i, name in enumerate(self.names) if name != self.tacho]
        return self.signal[rows]

    @property
    def tacho_signal(self) -> NDArray[np.float32] | None:
        """Signal of the tacho [shape=(n_samples,)], None without one."""
        return None if self.tacho is None else self.signal[self.names.index(self.tacho)]


def _check_header(item: "Recording | Attributes", where: str) -> None:
    """Refuse a sample rate, channel names or a tacho that contradict each other."""
    names = [channel.name for channel in item.channels]
    faults = []
    if not (np.isfinite(item.sample_rate) and item.sample_rate > 0):
        faults.append(f"sample_rate = {item.sample_rate} Hz must be > 0 and finite; give fs")
    if not names or len(set(names)) != len(names):
        faults.append(f"channel names {names} must be unique and at least one; rename them")
    if item.tacho is not None and item.tacho not in names:
        faults.append(f"tacho = {item.tacho!r} must be one of the channels {names}; rename it")
    if item.pulses_per_revolution < 1:
        faults.append(f"pulses_per_revolution = {item.pulses_per_revolution} must be >= 1")
    if item.origin not in ("simulated", "measured"):
        faults.append(f"origin = {item.origin!r} must be 'simulated' or 'measured'")
    if faults:
        raise DataError("\n".join(f"{where}: {fault}" for fault in faults))


def _refuse_gaps(recording: Recording) -> None:
    if np.isfinite(recording.signal).all():
        return
    faults = []
    for name, row in zip(recording.names, recording.signal, strict=True):
        bad = np.flatnonzero(~np.isfinite(row))
        if bad.size:
            faults.append(
                f"{recording.source or 'recording'}: channel '{name}' has {bad.size} sample(s) "
                f"that are not finite, must be 0, first at index {bad[0]}; cut or mend the gap"
            )
    raise DataError("\n".join(faults))


@dataclass(frozen=True, kw_only=True)
class Attributes:
    """What holds for every record of a data set file.

    Parameters
    ----------
    sample_rate : float
        [Hz]
    channels : tuple of Channel
        One per row of a record's signal.
    origin : {"simulated", "measured"}
        Where the signals are from.
    tacho : str, optional
        Name of the tacho channel.
    pulses_per_revolution : int
        Of the tacho.
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
    seed : int
        Seed of the data set.
    truth : bool
        Hidden quantities are stored.
    created_by, libraries : str
        Program and libraries, with versions.
    """

    sample_rate: float
    channels: tuple[Channel, ...]
    origin: Literal["simulated", "measured"]
    tacho: str | None = None
    pulses_per_revolution: int = 1
    severities: tuple[str, ...] = ()
    grade_edges: tuple[float, ...] = ()
    condemning_limit: float = float("nan")
    limit_source: str = ""
    recipe: str = ""
    scene: str = ""
    overrides: str = "{}"
    fidelity: str = ""
    seed: int = 0
    truth: bool = False
    created_by: str = f"wearstate {__version__}"
    libraries: str = field(
        default_factory=lambda: json.dumps({name: version(name) for name in _LIBRARIES})
    )

    def __post_init__(self) -> None:
        _check_header(self, "data set")
        long = [name for name, text in _texts(self).items() if len(text.encode()) > LARGEST_TEXT]
        if long:
            raise DataError(
                f"data set: text of {', '.join(long)} must be <= {LARGEST_TEXT} byte; shorten it"
            )


_TEXTS = ("recipe", "scene", "overrides", "fidelity", "limit_source", "created_by", "libraries")


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
        **{name: str({"fidelity": "", **stored}[name]) for name in _TEXTS},
    )


def _checksum(signal: NDArray[np.float32]) -> int:
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
    except _READ_FAULTS as error:
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

    Raises
    ------
    DataError
        There is no such file, it is unfinished (``.part``), truncated or damaged, of another
        program, or of another schema version.

    Examples
    --------
    Signals of the first two records, one after the other::

        with DataSet("data.h5") as data:
            rms = [data[i].vibration.std(axis=1) for i in range(2)]
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path).absolute()
        self._file: Any = None
        self._pid = -1
        _refuse_by_name(self.path)
        with _refusing(self.path, "file"):
            stored = _stored_attributes(self._handle(), self.path)
        with _refusing(self.path, "attributes"):
            self.attributes = _attributes_of(stored)
        with _refusing(self.path, "layout"):
            _check_layout(self._handle(), self.attributes, self.path)
        with _refusing(self.path, "manifest"):
            self.manifest = _decoded(self._handle()["manifest"][:])
        _refuse_unfinished(self.manifest["done"].to_numpy(), self.path)

    def __len__(self) -> int:
        return len(self.manifest)

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
        with _refusing(self.path, f"record {number}"):
            signal = self._handle()["signal"][number]
        row = {str(key): value for key, value in self.manifest.iloc[number].items()}
        if _checksum(signal) != row["signal_crc32"]:
            raise DataError(
                f"{self.path}: signal of record {number} has checksum {_checksum(signal)}, must "
                f"be {row['signal_crc32']}; take an intact copy"
            )
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
        )

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

    def _number(self, index: int) -> int:
        number = index + len(self) if index < 0 else index
        if not 0 <= number < len(self):
            raise IndexError(f"record {index} must be < {len(self)}, the records of {self.path}")
        return number

    def _handle(self) -> Any:
        # an HDF5 handle must not cross a fork
        if self._file is None or self._pid != os.getpid():
            self._file = h5py.File(self.path, "r")
            self._pid = os.getpid()
        return self._file

    def close(self) -> None:
        """Close the file; reading opens it again."""
        if self._file is not None and self._pid == os.getpid():
            self._file.close()
        self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_file": None, "_pid": -1}


def _refuse_by_name(path: Path) -> None:
    if path.suffix == ".part":
        raise DataError(
            f"{path} is an unfinished data set; run the same generate command again to finish it"
        )
    if not path.is_file():
        part = _part(path)
        hint = f"; {part.name} is there: run the same command again" if part.is_file() else ""
        raise DataError(f"{path} is no file{hint or '; check the path'}")


def _stored_attributes(file: Any, path: Path) -> dict[str, Any]:
    stored = dict(file.attrs)
    if not str(stored.get("created_by", "")).startswith("wearstate "):
        raise DataError(
            f"{path}: created_by = {stored.get('created_by')!r}, must begin with 'wearstate'; the "
            "file is of another program: import it, giving sample rate and unit"
        )
    if stored["schema_version"] != SCHEMA_VERSION:
        cure = "update wearstate" if stored["schema_version"] > SCHEMA_VERSION else "generate anew"
        raise DataError(
            f"{path}: schema_version = {stored['schema_version']} must be {SCHEMA_VERSION}; {cure}"
        )
    return stored


def _check_layout(file: Any, attributes: Attributes, path: Path) -> None:
    """Refuse a layout that the attributes contradict, before anything large is read."""
    signal, manifest = file["signal"], file["manifest"]
    _check_storage(signal, path)
    _check_storage(manifest, path)
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
        raise DataError(f"{path}: manifest lacks {', '.join(missing)}; generate or import anew")


def _check_storage(dataset: Any, path: Path) -> None:
    """Refuse sizes that the file cannot hold, and data kept in other files."""
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


def _refuse_unfinished(done: NDArray[np.bool_], path: Path) -> None:
    if not done.all():
        raise DataError(
            f"{path}: {np.count_nonzero(done)} of {len(done)} records are done, must be all; "
            "rename it to end in .part and run the same generate command again"
        )


def _decoded(rows: NDArray[np.void]) -> pd.DataFrame:
    columns = {}
    for name in rows.dtype.names or ():
        column = rows[name]
        columns[name] = np.char.decode(column, "utf-8") if column.dtype.kind == "S" else column
    return pd.DataFrame(columns)


def _part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


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


class DataSetWriter:
    """Writes a data set file, record by record, so that a killed run can go on.

    All space is laid out before the first record, in ``<path>.part``; from then on only bytes
    inside it change, first the signal, then its manifest row with ``done``. `finish` renames.
    A run that is killed loses the records in flight. A checksum per record finds those that a
    power cut has lost; they are written again.

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
    force : bool
        Replace an existing file, and start an unfinished one anew.

    Raises
    ------
    DataError
        The file exists, the folder does not or has no room, or an unfinished file is of another
        run. Nothing is left behind.

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
        force: bool = False,
    ) -> None:
        self.path = Path(path).absolute()
        self.part = _part(self.path)
        self.attributes = attributes
        self._shape = (n_records, len(attributes.channels), n_samples)
        self._dtype = np.dtype([*{**_HEAD, **(columns or {}), **_TAIL}.items()])
        self._file: Any = None
        refuse_output(self.path, force)
        if force:
            self.part.unlink(missing_ok=True)
        if not self.part.exists():
            self._lay_out()
        self._resume()

    def _lay_out(self) -> None:
        """Make the empty ``.part`` under another name first: it is whole or it is not there."""
        _refuse_size(self._shape, self._dtype, self.path.parent)
        fresh = self.part.with_name(self.part.name + ".new")
        try:
            with h5py.File(fresh, "w") as file:
                file.attrs.update(_file_attributes(self.attributes))
                _create(file, "signal", self._shape, np.dtype(np.float32), chunk=True)
                _create(file, "manifest", self._shape[:1], self._dtype, chunk=False)
            os.replace(fresh, self.part)
        except BaseException:
            fresh.unlink(missing_ok=True)
            raise

    def _resume(self) -> None:
        with _refusing(self.part, f"unfinished file (or delete it; {self.path.name})"):
            self._file = h5py.File(self.part, "r+")
        try:
            with _refusing(self.part, "unfinished file"):
                self._refuse_other_run()
                self._signal, self._manifest = self._file["signal"], self._file["manifest"]
                self.done: NDArray[np.bool_] = self._intact()
        except BaseException:
            self.close()
            raise

    def _refuse_other_run(self) -> None:
        stored, wanted = dict(self._file.attrs), _file_attributes(self.attributes)
        for name, value in wanted.items():
            if not _same(stored.get(name), value):
                raise DataError(
                    f"{self.part}: {name} = {_short(stored.get(name))}, must be {_short(value)} "
                    "to go on with it; repeat the command that began it, or use force to start anew"
                )
        found = (self._file["signal"].shape, self._file["manifest"].dtype)
        if found != (self._shape, self._dtype):
            raise DataError(
                f"{self.part}: signal has shape {found[0]}, must be {self._shape} (records, "
                "channels, samples) with the same manifest to go on with it; repeat the command "
                "that began it, or use force to start anew"
            )

    def _intact(self) -> NDArray[np.bool_]:
        """Which records are done and still fit their checksum [shape=(n_records,)]."""
        rows = self.manifest()
        done = np.array(rows["done"], dtype=bool)
        for index in np.flatnonzero(done):
            signal = self._signal[index]
            done[index] = _checksum(signal) == rows["signal_crc32"][index]
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
        """
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
        values = {**row, "done": True, "signal_crc32": _checksum(samples)}
        filled = _filled(self._dtype, values, index)
        # the chunk as it is: no selection, no conversion, a third of the time
        self._signal.id.write_direct_chunk((index, 0, 0), samples)
        for name, array in (truth or {}).items():
            self._hidden(name, array)[index] = array
        # a row that says done must never precede its signal
        self._file.flush()
        self._manifest[index] = filled
        self._file.flush()
        self.done[index] = True

    def _hidden(self, name: str, array: NDArray[Any]) -> Any:
        key = f"truth/{name}"
        if key not in self._file:
            shape = (self._shape[0], *np.shape(array))
            _create(self._file, key, shape, np.dtype(np.float32), chunk=True)
        return self._file[key]

    def manifest(self) -> NDArray[np.void]:
        """Manifest rows as they stand [shape=(n_records,)]."""
        rows: NDArray[np.void] = self._manifest[:]
        return rows

    def finish(self) -> None:
        """Close the file and give it its name.

        Raises
        ------
        DataError
            Not every record is done.
        """
        _refuse_unfinished(self.done, self.part)
        self.close()
        with self.part.open("rb") as handle:
            os.fsync(handle.fileno())
        os.replace(self.part, self.path)

    def close(self) -> None:
        """Close the file; unless finished, the ``.part`` stays for the next run."""
        if self._file is not None:
            self._file.close()
        self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


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


def _refuse_size(shape: tuple[int, int, int], row: np.dtype[Any], folder: Path) -> None:
    if min(shape) < 1:
        raise DataError(f"signal of shape {shape} must have >= 1 record, channel and sample")
    needed = 4 * math.prod(shape) + shape[0] * row.itemsize
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
    if chunk:
        plan.set_chunk((1, *shape[1:]))
        plan.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    links = h5py.h5p.create(h5py.h5p.LINK_CREATE)
    links.set_create_intermediate_group(True)
    space = h5py.h5s.create_simple(shape)
    kind = h5py.h5t.py_create(dtype, logical=True)
    h5py.h5d.create(file.id, name.encode(), kind, space, dcpl=plan, lcpl=links)
    file.flush()


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
