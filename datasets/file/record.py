"""The data set file: one HDF5 layout for simulated and measured recordings."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError, Recording, html_table, missing_file
from .attributes import (
    HASHES,
    Attributes,
    attributes_of,
    named,
    refuse_other_hashes,
    signal_checksum,
)
from .hdf5_values import HDF5_FAULTS, is_plain, plain_values
from .machines import machine_identities

if TYPE_CHECKING:
    import pandas as pd

SCHEMA_VERSION = 1

LARGEST_RECORD = 2**31
"""Largest plausible record [byte]: 100 channels of 100 s at 50 kHz."""

HEAD = {
    "record_id": "S16",
    "group": "<i8",
    "seed": "<u8",
    "done": "?",
    "status": "S24",
    "grade": "i1",
}
TAIL = {"signal_crc32": "<u4"}


@contextmanager
def refusing(path: Path, what: str) -> Iterator[None]:
    """Turn h5py's errors on damaged bytes into one message."""
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

    The file is opened by path, once per process, so that the object can be pickled and passed to
    loader workers.

    Parameters
    ----------
    path : str or Path
        A finished file of this program.

    Attributes
    ----------
    attributes : Attributes
        Properties common to all records.
    stored : dict
        Attributes and hashes, as numbers and texts by name in the file.
    rows : numpy.ndarray [shape=(n_records,)]
        Labels, conditions and numerics, structured as in the file.
    unhashed : tuple of str
        Members of `HASHES` missing in the file, which was made before there were hashes.

    Raises
    ------
    DataError
        If the file does not exist, is unfinished (``.part``), truncated, damaged or altered, was
        made by another program, or has another schema version.

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
        with refusing(self.path, "file"):
            handle = self._handle()
        with refusing(self.path, "attributes"):
            self.stored = _stored_attributes(handle, self.path)
            self.attributes = named(self.path, self.stored)
        with refusing(self.path, "layout"):
            _check_layout(self._handle(), self.attributes, self.path)
        with refusing(self.path, "manifest"):
            self.rows: NDArray[np.void] = self._handle()["manifest"][:]
        refuse_unfinished(self.rows["done"], self.path)
        refuse_other_hashes(self.stored, self.rows, self.path)
        self.unhashed = tuple(sorted(set(HASHES) - set(self.stored)))

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        """File, records, length, rate, channels and label."""
        return f"<DataSet {self.path.name}, {', '.join(self._facts)}>"

    def _repr_html_(self) -> str:
        """HTML for notebooks: the same and the first rows of the manifest."""
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
    def manifest(self) -> "pd.DataFrame":
        """Rows as a table with texts decoded; computed on first use."""
        with refusing(self.path, "manifest"):
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
            If `index` is not below the number of records.
        DataError
            If the stored signal is damaged or not finite.
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
        """Check the checksum of a record on its first read, since it takes most of the time."""
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
            If `index` is not below the number of records.
        DataError
            If they are damaged.
        """
        number = self._number(index)
        with refusing(self.path, f"record {number}"):
            return _plain_row(self.rows[number])

    def stored_signal(self, index: int) -> NDArray[np.float32]:
        """Signal of one record as stored, without a check of its checksum.

        Raises
        ------
        IndexError
            If `index` is not below the number of records.
        DataError
            If it cannot be read.
        """
        number = self._number(index)
        with refusing(self.path, f"record {number}"):
            signal: NDArray[np.float32] = self._signal()[number]
            return signal

    def truth(self, index: int) -> dict[str, NDArray[np.float32]]:
        """Hidden quantities of one record, by name; empty if none are stored.

        Raises
        ------
        IndexError
            If `index` is not below the number of records.
        DataError
            If they are damaged.
        """
        number = self._number(index)
        with refusing(self.path, f"truth of record {number}"):
            group = self._handle().get("truth", {})
            return {name: group[name][number] for name in group}

    @cached_property
    def splits(self) -> dict[str, dict[str, Any]]:
        """Description of each stored split by name: ``kind``, ``text``, ``machines_apart``, ….

        Raises
        ------
        DataError
            If they are damaged.
        """
        with refusing(self.path, "splits"):
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
            If there is no such split, or it is damaged.
        """
        if name not in self.splits:
            raise DataError(
                f"{self.path}: split = {name!r} must be one of {', '.join(self.splits) or '(none)'}"
                "; choose one, or add it with wearstate splits"
            )
        with refusing(self.path, f"split {name}"):
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
        # cached: a look-up by name takes a third of the time of reading a second of signal
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
        part = part_of(path)
        there = part.is_file()
        cure = f"{part.name} is there: run the same command again" if there else "check the path"
        raise DataError(missing_file(path, cure))
    if path.suffix.lower() not in (".h5", ".hdf5") and not h5py.is_hdf5(path):
        raise DataError(
            f"{path} is not a data set; make one of measured files: wearstate import {path.name} "
            "-o data.h5, with their units"
        )


def _stored_attributes(file: Any, path: Path) -> dict[str, Any]:
    # nothing else is read of a foreign file
    stored = plain_values(path, file) if "created_by" in file.attrs else {}
    if not str(stored.get("created_by", "")).startswith("wearstate "):
        raise DataError(
            f"{path}: created_by = {stored.get('created_by')!r}, must begin with 'wearstate'; the "
            "file is of another program: wearstate import makes it a data set, given rate and units"
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
    further = [node for group in ("truth", "splits") for node in file.get(group, {}).values()]
    for dataset in (signal, manifest, *further):
        _check_storage(dataset, path)
    wanted = (len(manifest), len(attributes.channels))
    if signal.shape[:2] != wanted or signal.ndim != 3 or signal.dtype != np.float32:
        raise DataError(
            f"{path}: signal is {signal.dtype} {signal.shape}, must be float32 {wanted} and "
            "samples; take an intact copy"
        )
    missing = [
        name
        for name in (*HEAD, *TAIL, *attributes.severities)
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
    """A JSON table; anything else is refused as damage."""
    found = json.loads(text)
    if not isinstance(found, dict):
        raise ValueError(f"{short_text(found)} must be a table")
    return found


def refuse_unfinished(done: NDArray[np.bool_], path: Path) -> None:
    """Raise a DataError unless every record is done."""
    if not done.all():
        raise DataError(
            f"{path}: {np.count_nonzero(done)} of {len(done)} records are done, must be all; "
            "rename it to end in .part and run the same generate command again"
        )


def _plain_row(row: np.void) -> dict[str, Any]:
    """Manifest values of one record, as Python objects."""
    return {
        name: value.decode() if isinstance(value, bytes) else value
        for name, value in zip(row.dtype.names or (), row.item(), strict=True)
    }


def _decoded(rows: NDArray[np.void]) -> "pd.DataFrame":
    import pandas as pd  # takes a quarter of a second; not needed by processes that simulate

    columns = {}
    for name in rows.dtype.names or ():
        column = rows[name]
        columns[name] = np.char.decode(column, "utf-8") if column.dtype.kind == "S" else column
    return pd.DataFrame(columns)


def part_of(path: Path) -> Path:
    """Name of the unfinished file of a data set."""
    return path.with_name(path.name + ".part")


def unfinished_attributes(path: str | Path) -> Attributes | None:
    """Attributes of a data set's unfinished file; None if there is none.

    Parameters
    ----------
    path : str or Path
        Path of the finished file.

    Raises
    ------
    DataError
        If the unfinished file cannot be read.
    """
    part = part_of(Path(path).absolute())
    if not part.is_file():
        return None
    with refusing(part, f"unfinished file (or delete it; {part.stem})"), h5py.File(part) as file:
        return attributes_of(_stored_attributes(file, part))


def short_text(value: Any) -> str:
    """Text of a value for a message, 60 characters at most."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
