"""A data set in other programs' formats, and compressed; what they cannot hold is reported."""

import json
import math
import shlex
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ...sim.atomic import replacing
from ...sim.output.recording import DataError, Recording
from ..file.attributes import Attributes, stamped
from ..file.csv_cells import safe_frame
from ..file.hdf5_values import write_values
from ..file.machines import FILE
from ..file.record import DataSet
from ..file.writer import fill_split, lay_out_split, refuse_output
from ..measured.label_columns import GRADE, RESERVED
from ..source.channel_units import known_unit

ABOUT = "export.json"
"""File that describes an exported folder; only a folder with it is ever replaced."""

LABELS = "labels.csv"
"""File of an exported folder from which ``import`` reads the labels."""

GZIP_LEVEL = 1
"""Level of compressed copies. Higher levels gain 2 to 3 % and take up to six times as long."""

_HIGHEST_RATE = 2**32 - 1  # Hz, in a WAV header
_ROWS = 64  # records in a row group of Parquet with signals
_MANY_ROWS = 2**16  # in one with labels only


@dataclass(frozen=True, kw_only=True)
class Exported:
    """Result of an export.

    Attributes
    ----------
    path : Path
        File or folder.
    kind : str
        Key of `FORMATS`.
    n_records, n_left_out : int
        Records exported, and failed ones left out because the format cannot mark them.
    n_bytes : int
        Size of all its files.
    import_command : str
        Command that imports the export; empty for a format that holds everything.
    """

    path: Path
    kind: str
    n_records: int
    n_left_out: int
    n_bytes: int
    import_command: str


def export_set(
    path: str | Path,
    output: str | Path,
    *,
    kind: str | None = None,
    signals: bool = False,
    compress: bool = False,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Exported:
    """Write a data set in another format.

    Parameters
    ----------
    path : str or Path
        A finished data set file.
    output : str or Path
        File, whose suffix determines the format, or folder.
    kind : {"h5", "parquet", "npz", "wav", "csv"}, optional
        Required for a folder; otherwise by the suffix.
    signals : bool
        Parquet: include signals, as a column of lists for every channel.
    compress : bool
        HDF5 and npz: lossless compression.
    force : bool
        Replace an existing file, or a folder that an export made.
    progress : callable, optional
        Called with (records written, records in total).

    Returns
    -------
    Exported

    Raises
    ------
    DataError
        If the file cannot be read or a signal is damaged, an option does not fit the format, the
        output exists, or Parquet is not installed. Nothing is left behind.

    Notes
    -----
    ========  ==================================================================================
    format    holds
    ========  ==================================================================================
    h5        everything: a copy, compressed or not, that every command reads
    npz       ``signal``, the manifest's columns, ``truth.*``, and the attributes as JSON
    parquet   the manifest's columns, with `signals` also the channels; attributes as metadata
    wav, csv  a file for every usable record, the labels, and the command that imports them
    ========  ==================================================================================

    Memory holds the manifest and one record, for Parquet with signals 64 records. WAV and CSV leave
    out records whose status is not ``ok``, since their files cannot mark them.

    Examples
    --------
    >>> import tempfile
    >>> from wearstate.datasets.generation.generate import generate
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> recipe = load_recipe("journal-bearing-small", {"duration": "0.05 s"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = generate(recipe, 2, Path(folder) / "data.h5")
    ...     export_set(made.path, Path(folder) / "labels.parquet").n_records
    2
    """
    target = Path(output).absolute()
    way = _format_of(target, kind)
    _refuse_options(way, signals=signals, compress=compress)
    with DataSet(path) as data:
        _refuse_target(target, data.path, way, force)
        job = _Job(
            data=data,
            way=way,
            target=target,
            signals=signals,
            compress=compress,
            progress=progress,
        )
        _refuse_rate(job)
        _write_whole(target, job, force)
        return Exported(
            path=target,
            kind=way.name,
            n_records=len(job.indices),
            n_left_out=len(data) - len(job.indices),
            n_bytes=sum(f.stat().st_size for f in [target, *target.rglob("*")] if f.is_file()),
            import_command=job.import_command(target) if way.folder else "",
        )


# --- formats ------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Format:
    """One format.

    Attributes
    ----------
    name : str
    suffixes : tuple of str
        Suffixes of the file; for a folder, of the files in it.
    folder : bool
        Whether it has a file for every usable record instead of one for all.
    compressible, signals_optional : bool
        Supported options.
    write : callable
        ``write(job, path)``.
    """

    name: str
    suffixes: tuple[str, ...]
    folder: bool
    write: Callable[["_Job", Path], None]
    compressible: bool = False
    signals_optional: bool = False


@dataclass(frozen=True, kw_only=True)
class _Job:
    """One export and its progress."""

    data: DataSet
    way: _Format
    target: Path
    signals: bool
    compress: bool
    progress: Callable[[int, int], None] | None

    @property
    def head(self) -> Attributes:
        """Attributes of the data set."""
        return self.data.attributes

    @cached_property
    def indices(self) -> list[int]:
        """Records to write: a folder's files cannot mark those that failed."""
        ok = self.data.rows["status"] == b"ok"
        found: list[int] = np.flatnonzero(ok | (not self.way.folder)).tolist()
        return found

    def records(self) -> Iterator[tuple[int, Recording]]:
        """Every record to write, with its checksum verified."""
        if not self.indices:
            raise DataError(f"{self.data.path}: 0 usable records, must be > 0; see status")
        for done, index in enumerate(self.indices, start=1):
            yield index, self.data[index]
            if self.progress is not None:
                self.progress(done, len(self.indices))

    def file_name(self, index: int) -> str:
        """File name of one record in a folder."""
        return f"{index:08d}{self.way.suffixes[0]}"

    def import_command(self, folder: Path) -> str:
        """Command that imports a folder."""
        files = f"{shlex.quote(str(folder))}/[0-9]*{self.way.suffixes[0]}"  # without the labels
        return " ".join(
            ["wearstate import", files, *map(shlex.quote, self._import_options(folder))]
        )

    def _import_options(self, folder: Path) -> Iterator[str]:
        head = self.head
        yield from ("--fs", repr(head.sample_rate))
        if self.way.name == "wav":  # which has no channel names
            yield from ("--channels", ",".join(channel.name for channel in head.channels))
        for channel in head.channels:
            if known_unit(channel.unit):
                yield from ("--unit", f"{channel.name}={channel.unit}")
        if head.tacho is not None:
            yield from ("--tacho", head.tacho)
            yield from ("--pulses-per-revolution", str(head.pulses_per_revolution))
        yield from ("--labels", str(folder / LABELS))
        for severity in head.severities:
            yield from ("--severity", severity)
        if len(head.grade_edges) == 3:
            yield from ("--limits", ", ".join(f"{edge!r} m" for edge in head.grade_edges))
        yield from ("-o", f"{folder.name}.h5")


def _format_of(target: Path, kind: str | None) -> _Format:
    if kind is not None and kind not in FORMATS:
        raise DataError(f"kind = {kind!r} must be one of {', '.join(FORMATS)}; choose one")
    found = [
        way
        for way in FORMATS.values()
        if way.name == kind or (kind is None and not way.folder and target.suffix in way.suffixes)
    ]
    if not found:
        files = [suffix for way in FORMATS.values() if not way.folder for suffix in way.suffixes]
        raise DataError(
            f"{target}: suffix {target.suffix!r} must be one of {', '.join(files)}; rename it, or "
            "give kind wav or csv for a folder"
        )
    [way] = found
    if not way.folder and target.suffix not in way.suffixes:
        raise DataError(
            f"{target}: suffix {target.suffix!r} must be {way.suffixes[0]} for kind {way.name}; "
            "rename it"
        )
    return way


def _refuse_options(way: _Format, *, signals: bool, compress: bool) -> None:
    faults = []
    if compress and not way.compressible:
        faults.append(f"compress must be left out of {way.name}: it is for .h5 and .npz")
    if signals and not way.signals_optional:
        faults.append(f"signals must be left out of {way.name}, which always has them")
    if faults:
        raise DataError("\n".join(faults))


def _refuse_target(target: Path, source: Path, way: _Format, force: bool) -> None:
    """Refuse to replace anything beyond what `force` allows, and always the input or a folder."""
    if target.exists() and target.samefile(source):
        raise DataError(f"{target} is also the input, must be another file; choose another name")
    if not way.folder:
        refuse_output(target, force)
        return
    if not target.parent.is_dir():
        raise DataError(f"{target.parent} is not a folder; create it")
    if target.exists() and not target.is_dir():
        raise DataError(f"{target} is a file, must be a folder for {way.name}; choose another name")
    if not target.is_dir() or not any(target.iterdir()):
        return
    if not (target / ABOUT).is_file():
        raise DataError(
            f"{target} holds files and no {ABOUT}, so that no export made it: it is never "
            "replaced; choose another name"
        )
    if not force:
        raise DataError(f"{target} exists; choose another name or use force to replace it")


def _refuse_rate(job: _Job) -> None:
    rate = job.head.sample_rate
    if job.way.name == "wav" and not (rate == round(rate) and rate <= _HIGHEST_RATE):
        raise DataError(
            f"{job.data.path}: sample_rate = {rate:.17g} Hz must be a whole number <= "
            f"{_HIGHEST_RATE} in a WAV file; export as csv, npz or parquet"
        )


def _write_whole(target: Path, job: _Job, force: bool) -> None:
    """Write under another name, then rename: the output is complete or absent."""
    with replacing(target, force=force) as fresh:
        if job.way.folder:
            fresh.mkdir()
        job.way.write(job, fresh)
        if force:  # the replaceable output may have changed
            _refuse_target(target, job.data.path, job.way, force)


# --- HDF5 ---------------------------------------------------------------------------------------


def _write_hdf5(job: _Job, path: Path) -> None:
    """A copy with the same values in every dataset; hashes are added if they were missing."""
    with h5py.File(job.data.path, "r") as old, h5py.File(path, "w") as new:
        write_values(new, stamped(job.data.stored, job.data.rows))
        new.create_dataset("manifest", data=job.data.rows)
        _copy_records(new, "signal", old["signal"], job, (r.signal for _, r in job.records()))
        for name in old.get("truth", {}):
            source = old["truth"][name]
            rows = (source[i] for i in job.indices)
            _copy_records(new, f"truth/{name}", source, job, rows)
        for name, about in job.data.splits.items():
            lay_out_split(new, name, len(job.data))
            train, test = job.data.split(name)
            sides = np.full(len(job.data), -1, dtype=np.int8)
            sides[train], sides[test] = 0, 1
            fill_split(new, name, sides, json.dumps(about))


def _copy_records(new: Any, name: str, source: Any, job: _Job, rows: Iterator[Any]) -> None:
    small = source.ndim == 1  # one number per record: nothing to compress
    packed = {"compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True}
    target = new.create_dataset(
        name,
        source.shape,
        source.dtype,
        chunks=None if small else (1, *source.shape[1:]),
        **(packed if job.compress and not small else {}),
    )
    for index, row in enumerate(rows):
        target[index] = row


# --- numpy --------------------------------------------------------------------------------------


def _write_npz(job: _Job, path: Path) -> None:
    """A zip of ``.npy`` files, with the signals written one after the other."""
    way = zipfile.ZIP_DEFLATED if job.compress else zipfile.ZIP_STORED
    shape = job.data.stored_shape
    with zipfile.ZipFile(path, "w", way) as file, h5py.File(job.data.path, "r") as old:
        for name, values in _plain_arrays(job).items():
            _add_array(file, name, values.shape, values.dtype, iter([values]))
        _add_array(file, "signal", shape, np.dtype("<f4"), (r.signal for _, r in job.records()))
        for name in old.get("truth", {}):
            node = old["truth"][name]
            rows = (node[i] for i in job.indices)
            _add_array(file, f"truth.{name}", node.shape, node.dtype, rows)


def _plain_arrays(job: _Job) -> dict[str, NDArray[Any]]:
    texts = {name: column.to_numpy() for name, column in job.data.manifest.items()}
    columns = {
        f"manifest.{name}": np.array(values.tolist(), dtype=np.str_)
        if values.dtype.kind in "OUT"
        else values
        for name, values in texts.items()
    }
    return {
        "sample_rate_hz": np.array(job.head.sample_rate),
        "channels": np.array([channel.name for channel in job.head.channels]),
        "units": np.array([channel.unit for channel in job.head.channels]),
        "attributes": np.array(_attributes_json(job)),
        **columns,
    }


def _add_array(
    file: zipfile.ZipFile,
    name: str,
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
    pieces: Iterator[Any],
) -> None:
    head = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    # a member's time would be the present: the same export must give the same bytes
    member = zipfile.ZipInfo(f"{name}.npy")
    member.compress_type = file.compression
    with file.open(member, "w", force_zip64=True) as handle:
        np.lib.format.write_array_header_2_0(handle, head)
        for piece in pieces:
            handle.write(np.ascontiguousarray(piece, dtype=dtype).tobytes())


def _attributes_json(job: _Job) -> str:
    """The file's attributes as plain JSON."""
    plain = {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in sorted(job.data.stored.items())
        if not name.endswith(("attributes_sha256", "manifest_sha256"))
    }
    known = {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in plain.items()}
    return json.dumps(known, allow_nan=False)


# --- Parquet ------------------------------------------------------------------------------------


def _write_parquet(job: _Job, path: Path) -> None:
    """Columns of the manifest; with signals, row groups limited by memory."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        raise DataError(
            "Parquet needs pyarrow, which is not installed; pip install wearstate[parquet], "
            "or export .npz"
        ) from None
    table = pa.Table.from_pandas(job.data.manifest, preserve_index=False)
    table = table.replace_schema_metadata({b"wearstate": _attributes_json(job).encode()})
    if not job.signals:
        parquet.write_table(table, path, compression="zstd", row_group_size=_MANY_ROWS)
        return
    schema = table.schema
    names = [channel.name for channel in job.head.channels]
    for name in names:
        schema = schema.append(pa.field(name, pa.list_(pa.float32())))
    plain = [f"{name}.list.element" for name in names]
    with parquet.ParquetWriter(
        path,
        schema,
        compression="zstd",
        use_dictionary=[str(name) for name in table.column_names],
        column_encoding=dict.fromkeys(plain, "BYTE_STREAM_SPLIT"),
    ) as writer:
        for first, signals in _row_groups(job):
            part = table.slice(first, len(signals))
            for i, name in enumerate(names):
                lists = pa.array([signal[i] for signal in signals], pa.list_(pa.float32()))
                part = part.append_column(schema.field(name), lists)
            writer.write_table(part)


def _row_groups(job: _Job) -> Iterator[tuple[int, list[NDArray[np.float32]]]]:
    """Signals of some records at a time, with the number of the first."""
    waiting: list[NDArray[np.float32]] = []
    for index, record in job.records():
        waiting.append(record.signal)
        if len(waiting) == _ROWS or index == job.indices[-1]:
            yield index + 1 - len(waiting), waiting
            waiting = []


# --- folders ------------------------------------------------------------------------------------


def _write_wav(job: _Job, folder: Path) -> None:
    from scipy.io import wavfile

    for index, record in job.records():
        wavfile.write(folder / job.file_name(index), int(record.sample_rate), record.signal.T)
    _write_labels(job, folder)


def _write_csv(job: _Job, folder: Path) -> None:
    import pandas as pd

    heads = ["time [s]"] + [
        f"{channel.name} [{channel.unit}]" if known_unit(channel.unit) else channel.name
        for channel in job.head.channels
    ]
    for index, record in job.records():
        time = np.arange(record.signal.shape[1]) / record.sample_rate
        table = pd.DataFrame({heads[0]: time})  # with every digit
        for head, row in zip(heads[1:], record.signal, strict=True):
            table[head] = row
        safe_frame(table).to_csv(folder / job.file_name(index), index=False)
    _write_labels(job, folder)


def _write_labels(job: _Job, folder: Path) -> None:
    """Labels in the form that ``import`` reads, and the description of the folder."""
    import pandas as pd

    rows = [job.data.row(index) for index in job.indices]
    cells = {
        name: [_cell(name, row[name]) for row in rows]
        for name in job.data.rows.dtype.names or ()
        if name not in (*RESERVED, FILE)
    }
    table = {FILE: [job.file_name(index) for index in job.indices]}
    table |= {name: column for name, column in cells.items() if any(column)}
    safe_frame(pd.DataFrame(table)).to_csv(folder / LABELS, index=False)
    about = {
        "attributes": json.loads(_attributes_json(job)),
        "import": job.import_command(Path(job.target.name)),  # same bytes anywhere
        "left_out": len(job.data) - len(job.indices),
    }
    (folder / ABOUT).write_text(json.dumps(about, indent=1), encoding="utf-8")


def _cell(name: str, value: Any) -> str:
    """A label as text; empty if unknown."""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(value)
    return "" if name == GRADE and value < 0 else str(value)


FORMATS: dict[str, _Format] = {
    way.name: way
    for way in (
        _Format(
            name="h5",
            suffixes=(".h5", ".hdf5"),
            folder=False,
            write=_write_hdf5,
            compressible=True,
        ),
        _Format(
            name="parquet",
            suffixes=(".parquet",),
            folder=False,
            write=_write_parquet,
            signals_optional=True,
        ),
        _Format(name="npz", suffixes=(".npz",), folder=False, write=_write_npz, compressible=True),
        _Format(name="wav", suffixes=(".wav",), folder=True, write=_write_wav),
        _Format(name="csv", suffixes=(".csv",), folder=True, write=_write_csv),
    )
}
"""All formats; a new one is one function and one row."""


def exported_text(made: Exported) -> str:
    """Summary of an export.

    Examples
    --------
    >>> made = Exported(
    ...     path=Path("a.npz"),
    ...     kind="npz",
    ...     n_records=3,
    ...     n_left_out=0,
    ...     n_bytes=2_500_000,
    ...     import_command="",
    ... )
    >>> exported_text(made)
    'a.npz: 3 records, 2.5 MB'
    """
    lines = [f"{made.path}: {made.n_records} records, {made.n_bytes / 1e6:.1f} MB"]
    if made.n_left_out:
        lines.append(
            f"  {made.n_left_out} left out: their status is not ok, which {made.kind} files "
            "cannot say"
        )
    if made.import_command:
        lines.append(f"  back: {made.import_command}")
    return "\n".join(lines)
