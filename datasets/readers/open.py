"""Measured recordings in files of many formats: one reader per suffix, one way to open them all.

A reader lists the content of a file (:class:`~.source.part.Contents`); here one part is chosen, and
rate, channels and units are determined from file and caller. Units are declared by the file or by
the caller and converted, or refused; they are never guessed from the numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path

from ...sim.output.recording import DataError, missing_file
from ..source.chosen import chosen_part, part_of_record
from ..source.empty import without_empty
from ..source.part import Contents, Source, SourceOptions
from ..source.resampled import resampled
from ..source.settled import refuse_unread, settled_source
from .flat import npy_contents, npz_contents, raw_contents
from .hdf5 import hdf5_contents
from .mat import mat_contents
from .tdms import tdms_contents
from .text import text_contents
from .uff import uff_contents
from .wav import wav_contents


@dataclass(frozen=True, kw_only=True)
class Reader:
    """Reader of one format.

    Attributes
    ----------
    name : str
        Name of the format.
    contents : callable
        Lists the content of a file.
    options : frozenset of str
        Options that it supports beyond those common to all.
    """

    name: str
    contents: Callable[[Path, SourceOptions], Contents]
    options: frozenset[str] = frozenset()


_EVERY = {"channels", "fs", "unit", "sensitivity", "resample_to", "tacho", "like"}
_ARRAY = frozenset({"variable", "order", "record", "rows"})
_TEXT = Reader(
    name="text",
    contents=text_contents,
    options=frozenset({"delimiter", "decimal", "header", "time_column", "rows", "record"}),
)
_RAW = Reader(
    name="headerless binary",
    contents=raw_contents,
    options=frozenset({"dtype", "n_channels", "offset", "order", "partial"}),
)
_HDF5 = Reader(name="HDF5", contents=hdf5_contents, options=_ARRAY)
_UFF = Reader(name="UFF", contents=uff_contents, options=frozenset({"variable"}))

READERS: dict[str, Reader] = {
    ".wav": Reader(name="WAV", contents=wav_contents, options=frozenset({"full_scale", "partial"})),
    ".mat": Reader(name="MATLAB", contents=mat_contents, options=_ARRAY),
    ".csv": _TEXT,
    ".tsv": _TEXT,
    ".txt": _TEXT,
    ".h5": _HDF5,
    ".hdf5": _HDF5,
    ".npy": Reader(name="NPY", contents=npy_contents, options=_ARRAY - {"variable"}),
    ".npz": Reader(name="NPZ", contents=npz_contents, options=_ARRAY),
    ".uff": _UFF,
    ".unv": _UFF,
    ".uf": _UFF,
    ".tdms": Reader(
        name="TDMS", contents=tdms_contents, options=frozenset({"variable", "partial"})
    ),
    ".bin": _RAW,
    ".raw": _RAW,
}
"""Readers by suffix; a declared ``dtype`` makes any file headerless binary."""


def open_source(path: str | Path, options: SourceOptions | None = None) -> Source:
    r"""Open the only recording of a file, or the one chosen by the options.

    Parameters
    ----------
    path : str or Path
        WAV, MATLAB 4 to 7.3, CSV/TSV, HDF5, NPY, NPZ, UFF58, TDMS, or headerless binary.
    options : SourceOptions, optional
        Declarations that the file lacks, and the selection to read.

    Returns
    -------
    Source
        Source, which must be closed. A rate printed with few digits, as a step or as times, is
        rounded to a whole number of hertz if the digits allow just one. Undeclared rate and units
        are None and listed in `undeclared`.

    Raises
    ------
    DataError
        If the file is missing, damaged or of unknown format; it holds several recordings and none
        is chosen (the message lists the content); or an option does not fit it, contradicts its
        declarations, or names something that it does not hold.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "pump.csv"
    ...     _ = file.write_text("time [s],acc [g]\n0.00,1\n0.01,2\n0.02,3\n")
    ...     with open_source(file) as source:
    ...         source.sample_rate, source.channels[0].unit, source.read(1, 3)
    (100.0, 'm/s^2', array([[19.6133 , 29.41995]]))
    """
    given = options or SourceOptions()
    file = Path(path)
    contents = _contents(file, given)
    try:
        return _opened(file, contents, given, given.record)
    except BaseException:
        contents.close()
        raise


def open_records(path: str | Path, options: SourceOptions | None = None) -> tuple[Source, ...]:
    """Open all records of a file: its rows if they are records, or else its only recording.

    Parameters
    ----------
    path, options
        As for :func:`open_source`; `record` is ignored if rows are records.

    Returns
    -------
    tuple of Source
        Closing one closes all: they share the file.

    Raises
    ------
    DataError
        As for :func:`open_source`.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(Path(folder) / "x.npy", np.ones((3, 50)))
    ...     found = open_records(Path(folder) / "x.npy", SourceOptions(rows="records", fs=9.0))
    ...     len(found), found[0].n_samples, found[0].channels[0].name
    (3, 50, 'x')
    """
    given = options or SourceOptions()
    if given.rows is None:
        return (open_source(path, given),)
    file = Path(path)
    contents = _contents(file, given)
    try:
        first = _opened(file, contents, given, 0)
        rest = range(1, first.n_records)
        return (first, *(_opened(file, contents, given, record) for record in rest))
    except BaseException:
        contents.close()
        raise


def _opened(file: Path, contents: Contents, given: SourceOptions, record: int) -> Source:
    part = without_empty(chosen_part(file, contents, given, record))
    refuse_unread(file, part, given)
    source = settled_source(file, part, given, contents.close)
    return resampled(source, given.resample_to, given.tacho)


def list_sources(path: str | Path, options: SourceOptions | None = None) -> tuple[Source, ...]:
    """All possible recordings of a file, for listings; they must be closed.

    Parameters
    ----------
    path, options
        As for :func:`open_source`; `channels`, `variable` and options per channel are ignored.

    Returns
    -------
    tuple of Source
        May be empty. Closing one closes all: they share the file.

    Raises
    ------
    DataError
        If the file is missing, damaged or of unknown format.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "two.npz"
    ...     np.savez(file, a=np.ones(5), b=np.ones((3, 7)))
    ...     [(source.part, len(source.channels)) for source in list_sources(file)]
    [('a', 1), ('b', 3)]
    """
    given = options or SourceOptions()
    file = Path(path)
    plain = replace(
        given, like=None, variable=None, channels=(), unit=None, sensitivity=None, full_scale=None
    )
    contents = _contents(file, given)
    try:
        parts = [part_of_record(file, part, given, 0) for part in contents.parts]
        return tuple(settled_source(file, part, plain, contents.close) for part in parts)
    except BaseException:
        contents.close()
        raise


def _contents(file: Path, options: SourceOptions) -> Contents:
    reader = _RAW if options.dtype is not None else READERS.get(file.suffix.lower())
    if reader is None:
        if not file.exists():
            raise DataError(missing_file(file))
        raise DataError(
            f"{file}: suffix '{file.suffix}' must be one of {', '.join(READERS)}; convert the "
            "file, or give dtype and n_channels of headerless binary"
        )
    _refuse_options(file, reader, options)
    if not file.is_file():
        raise DataError(missing_file(file))
    if file.stat().st_size == 0:
        raise DataError(f"{file} has 0 byte, must be a {reader.name} file; take an intact copy")
    return reader.contents(file, options)


def _refuse_options(file: Path, reader: Reader, options: SourceOptions) -> None:
    default = SourceOptions()
    known = _EVERY | reader.options
    wrong = [
        f"{file}: {field.name} = {getattr(options, field.name)!r} does not fit {reader.name} "
        "files; leave it out"
        for field in fields(SourceOptions)
        if field.name not in known and getattr(options, field.name) != getattr(default, field.name)
    ]
    if wrong:
        raise DataError("\n".join(wrong))
