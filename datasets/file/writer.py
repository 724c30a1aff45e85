"""Writing of a data set file: laid out once, filled record by record, resumed after a stop."""

import json
import math
import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from ...sim.atomic import OutputError, fresh_name, put_in_place
from ...sim.output.recording import DataError
from .attributes import Attributes, manifest_hash, signal_checksum, stamped, text_hash, texts_of
from .hdf5_values import fill_room, make_room, plain_values, write_values
from .record import HEAD, SCHEMA_VERSION, TAIL, part_of, refuse_unfinished, refusing, short_text

_LONGEST_SPLIT = 4000  # byte, as JSON: twenty columns with their bounds
_UNKNOWN: dict[str, Any] = {"S": b"", "i": -1, "u": 0, "b": False, "f": float("nan")}


class WriteError(RuntimeError):
    """A data set file cannot be written further; names file, cause and cure. Its content stays."""


def _file_attributes(attributes: Attributes) -> dict[str, Any]:
    """Names and values as stored in the file."""
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
        "recipe_sha256": text_hash(attributes.recipe),
        "scene_sha256": text_hash(attributes.scene),
        "seed": str(attributes.seed),
        "truth": int(attributes.truth),
        **texts_of(attributes),
    }


def _identity(path: Path) -> tuple[int, int] | None:
    """Identity of a file, to distinguish it from another of the same name; None without a file."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino


class LostError(WriteError):
    """The file being written is no longer in its place; the text gives the fate of its records."""


class DataSetWriter:
    """Writes a data set file record by record, so that an interrupted run can be resumed.

    All space is reserved before the first record, in ``<path>.part``; afterwards only bytes inside
    it change, first the signal, then its manifest row with ``done``. `finish` renames the file. A
    killed run loses the records in flight. A checksum per record finds those lost by a power
    failure; they are written again. The shapes of hidden quantities are known from the first record
    that has any: the file is then laid out again in a second file, once.

    Parameters
    ----------
    path : str or Path
        File to write.
    attributes : Attributes
        Properties common to all records.
    n_records, n_samples : int
        Both >= 1.
    columns : mapping
        Further manifest columns with their numpy types, in order.
    splits : sequence of str
        Names of the splits that may be written.
    force : bool
        Replace an existing file, and restart an unfinished one.
    resumable : bool
        If False, the unfinished file has a unique name and is deleted if the run fails; one left by
        another run stays.

    Raises
    ------
    DataError
        If the file exists, the folder does not, has no room or is not writable, or an unfinished
        file belongs to another run or is being written. Nothing is left behind.

    Examples
    --------
    >>> from wearstate.datasets.file.record import DataSet
    >>> from wearstate.sim.output.sensor import Channel
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
        self.part = part_of(self.path) if resumable else fresh_name(self.path)
        self._force, self._resumable = force, resumable
        self.attributes = attributes
        self._shape = (n_records, len(attributes.channels), n_samples)
        self._dtype = np.dtype([*{**HEAD, **(columns or {}), **TAIL}.items()])
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
        """Create the empty ``.part`` under another name first, so that it is complete or absent."""
        hidden = sum(math.prod(shape) for shape in (truth or {}).values())
        _refuse_size(self._shape, self._dtype, hidden, self.path.parent)
        fresh = fresh_name(self.path)
        try:
            with _laying_out(self.path), h5py.File(fresh, "w") as file:
                empty = np.zeros(0, dtype=self._dtype)
                # both hashes exist from the start, so that finishing changes no structure
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
        """Copy the records of the present file into the newly laid out one."""
        if self._file is None:
            return
        hidden = [f"truth/{name}" for name in self._file.get("truth", {})]
        for name in ("signal", *hidden, "manifest"):
            for index in np.flatnonzero(self.done):
                file[name][index] = self._file[name][index]

    def _resume(self) -> None:
        with refusing(self.part, f"unfinished file (or delete it; {self.path.name})"):
            self._file = _opened(self.part)
        try:
            self._identity = _identity(self.part)
            with refusing(self.part, "unfinished file"):
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
                there = short_text(stored.get(name))
                raise DataError(
                    f"{self.part}: {name} = {there}, must be {short_text(value)} "
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
        """Whether each record is done and matches its checksum [shape=(n_records,)]."""
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
            Manifest values by column; a missing column becomes NaN, -1 or empty.
        truth : mapping, optional
            Hidden quantities, the same names and shapes in every record; stored as float32.

        Raises
        ------
        DataError
            If signal or row do not fit the file, or a sample is not finite.
        WriteError
            If the disk is full or failing. The records marked done are complete.
        LostError
            If the unfinished file is no longer in its place.
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
            # a row marked done must never precede its signal
            self._file.flush()
            self._manifest[index] = filled
            self._file.flush()
        self.done[index] = True

    def _make_place(self, truth: Mapping[str, NDArray[Any]]) -> None:
        """Create datasets for hidden quantities in a new file; a half-changed one is unreadable."""
        there = self._file.get("truth", {})
        if all(name in there for name in truth):
            return
        shapes = {name: tuple(there[name].shape[1:]) for name in there}
        self._lay_out({**shapes, **{name: np.shape(array) for name, array in truth.items()}})
        self.close()
        self._resume()

    def refuse_lost(self) -> None:
        """Refuse to continue if the unfinished file is no longer in its place.

        Raises
        ------
        LostError
            If it was deleted, moved or replaced.
        """
        if _identity(self.part) != self._identity:
            written = np.count_nonzero(self.done)
            raise LostError(
                f"{self.part} is gone: it was deleted, moved or replaced during the run, and its "
                f"{written} records with it; 0 of {len(self.done)} are kept here. Repeat the "
                "command to start again"
            )

    def manifest(self) -> NDArray[np.void]:
        """Manifest rows in their present state [shape=(n_records,)]."""
        rows: NDArray[np.void] = self._manifest[:]
        return rows

    def write_split(self, name: str, sides: NDArray[np.int8], about: str) -> None:
        """Write a split that was laid out at the start.

        Parameters
        ----------
        name : str
            Name of the split.
        sides : numpy.ndarray [shape=(n_records,)]
            0 train, 1 test, -1 neither.
        about : str
            Description of the split, as JSON.
        """
        if f"splits/{name}" not in self._file:  # in a file begun before there were splits
            lay_out_split(self._file, name, self._shape[0])
        fill_split(self._file, name, sides, about)

    def finish(self) -> None:
        """Close the file and give it its final name.

        Raises
        ------
        DataError
            If not every record is done.
        WriteError
            If the disk is full or failing; the unfinished file stays.
        LostError
            If the unfinished file is no longer in its place.
        OutputError
            If a file of that name has appeared meanwhile; the unfinished file stays.
        """
        self.refuse_lost()
        refuse_unfinished(self.done, self.part)
        with _writing(self.part):
            self._seal()

    def _seal(self) -> None:
        hashed = manifest_hash(self.manifest()).encode()
        if "manifest_sha256" in self._file.attrs:  # not in a file begun before there were hashes
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
        whole = error is None or isinstance(error, OutputError)  # names the complete file
        try:
            self.close()
        except (OSError, RuntimeError):  # the disk is still full: the first error is reported
            if error is None:
                whole = False
                raise
        finally:
            if not (whole or self._resumable):
                self.part.unlink(missing_ok=True)  # laid out again, not resumed


def refuse_output(path: Path, force: bool) -> None:
    """Refuse a file that cannot be written, or exists and may not be replaced.

    Parameters
    ----------
    path : Path
        Absolute path.
    force : bool
        Whether it may be replaced.

    Raises
    ------
    DataError
        If its name ends in ``.part``, it is a folder or in none, or it exists.
    """
    if path.suffix == ".part":
        raise DataError(f"{path}: the name must not end in .part, kept for unfinished files")
    if not path.parent.is_dir():
        raise DataError(f"{path.parent} is not a folder; create it")
    if path.is_dir():
        raise DataError(f"{path} is a folder; name a file in it")
    if path.exists() and not force:
        raise DataError(f"{path} exists; choose another name or use force to replace it")


def _opened(part: Path) -> Any:
    """Open for writing without HDF5's buffer, so that a full disk raises an error at once.

    HDF5 keeps what it could not write, fails again on closing, and ends the process with a memory
    fault.
    """
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_sieve_buf_size(0)
    return h5py.File(h5py.h5f.open(os.fsencode(part), h5py.h5f.ACC_RDWR, fapl=access))


def _write_chunk(dataset: Any, index: int, values: NDArray[Any]) -> None:
    """Write a record's chunk directly: without cache and selection, in a third of the time."""
    chunk = np.asarray(values, dtype=np.float32, order="C")
    if chunk.shape != dataset.shape[1:]:
        raise DataError(
            f"{dataset.name} of record {index} has shape {chunk.shape}, must be "
            f"{dataset.shape[1:]}; one file holds records of one shape"
        )
    dataset.id.write_direct_chunk((index, *(0,) * chunk.ndim), chunk)


def _refuse_busy(part: Path) -> None:
    """Refuse a file that another run is writing."""
    if not part.exists():
        return
    try:
        h5py.File(part, "r+").close()
    except OSError as error:
        if "lock" in str(error):
            raise DataError(f"{part} is being written by another run; wait for its end") from error


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn write errors into one message."""
    try:
        yield
    except WriteError:
        raise
    except (OSError, RuntimeError) as error:
        raise WriteError(
            f"{path} cannot be written ({_cause(error)}); repair the disk or make room"
        ) from error


@contextmanager
def _laying_out(path: Path) -> Iterator[None]:
    """The same for a file that does not exist yet, whose cure is another place."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise DataError(
            f"{path} cannot be made ({_cause(error)}); check rights and space, or choose another "
            "folder"
        ) from error


def _cause(error: Exception) -> str:
    """Message of the operating system, without HDF5's text around it."""
    at: BaseException | None = error
    while at is not None:  # the error on closing follows the one on writing, and says less
        if found := re.search("error message = '([^']*)'", str(at)):
            return found[1]
        at = at.__context__
    return getattr(error, "strerror", None) or str(error)


def _take_space(path: Path) -> None:
    """Reserve the disk space of all later writes: HDF5 leaves holes, which a full disk cannot fill.

    On a copy-on-write file system, or a system without this call, the disk can still run full.
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
            f"{folder}: {size_words(free)} are free, must be >= {size_words(needed)}; ask for "
            "fewer records or choose another disk"
        )


def size_words(count: int) -> str:
    """Number of bytes in readable units.

    Examples
    --------
    >>> size_words(1_474_560), size_words(23 * 10**9)
    ('1.47 MB', '23 GB')
    """
    units = (("GB", 1e9), ("MB", 1e6), ("kB", 1e3))
    unit, scale = next((each for each in units if count >= each[1]), units[-1])
    return f"{count / scale:.3g} {unit}"


def _create(
    file: Any, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], *, chunk: bool
) -> None:
    """Create a dataset with all its space, so that later writes change no structure."""
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plan.set_obj_track_times(False)  # the same data give the same bytes
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
    """Reserve space for a split, so that filling it changes no structure; it has no sides yet.

    Parameters
    ----------
    file : h5py.File
        Data set file, writable.
    name : str
        Name of the split; an existing one is replaced.
    n_records : int
        Number of records of the file.
    """
    key = f"splits/{name}"
    if key in file:
        del file[key]
    _create(file, key, (n_records,), np.dtype(np.int8), chunk=False)
    file[key][:] = -1
    make_room(file[key], "about", _LONGEST_SPLIT)


def fill_split(file: Any, name: str, sides: NDArray[np.int8], about: str) -> None:
    """Write a split into the space reserved for it.

    Parameters
    ----------
    file : h5py.File
        Data set file, writable.
    name : str
        Name of the split.
    sides : numpy.ndarray [shape=(n_records,)]
        0 train, 1 test, -1 neither.
    about : str
        Description of the split, as JSON.

    Raises
    ------
    DataError
        If the text is too long.
    """
    text = about.encode()
    if len(text) > _LONGEST_SPLIT:
        raise DataError(
            f"split {name}: its text has {len(text)} byte, must be <= {_LONGEST_SPLIT}; bound "
            "fewer columns"
        )
    file[f"splits/{name}"][:] = sides
    fill_room(file[f"splits/{name}"], "about", text)


def _filled(dtype: np.dtype[Any], values: Mapping[str, Any], index: int) -> NDArray[np.void]:
    """One manifest row; refuses unknown columns and texts that would be truncated."""
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


def _same(found: Any, wanted: Any) -> bool:
    return bool(found == wanted) or (found != found and wanted != wanted)  # NaN equals NaN here
