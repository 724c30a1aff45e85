"""One measured recording from a file, and the content of files."""

import logging
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError, Recording
from ..file.hdf5_values import HDF5_FAULTS
from ..file.record import LARGEST_RECORD, DataSet
from ..file.views import CompletingView, JoinedSet, joined_recordings
from ..readers.open import list_sources, open_source
from ..source.chosen import new_and_old
from ..source.part import Source, SourceOptions
from .label_table import refusal
from .plan import channels_of_source, sparing_tacho

_LOG = logging.getLogger(__name__)
_PIECE = 2**20  # numbers read at once
_DATA_SETS = (".h5", ".hdf5")


def read_recording(
    path: str | Path,
    options: SourceOptions | None = None,
    *,
    tacho: str | None = None,
    pulses_per_revolution: int = 1,
) -> Recording:
    """Read one recording from a file.

    Parameters
    ----------
    path : str or Path
        Data set of this program, or any format that :func:`~.readers.open.open_source` reads.
    options : SourceOptions, optional
        Declarations that the file lacks; ``record`` chooses one of a data set. Units are declared
        or refused, never guessed.
    tacho : str, optional
        Name of the tacho channel; a data set knows its own.
    pulses_per_revolution : int
        Pulses of the tacho in one revolution.

    Returns
    -------
    Recording
        Recording in SI units.

    Raises
    ------
    DataError
        If the file is missing, truncated, damaged or of unknown format; its sample rate or a unit
        is not declared; its declarations contradict the caller; or it is too long.

    Examples
    --------
    >>> import tempfile
    >>> from scipy.io import savemat
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "pump.mat"
    ...     savemat(file, {"x": np.ones(16)})
    ...     item = read_recording(file, SourceOptions(fs=1000.0, unit="g"))
    ...     item.signal[0, 0]
    np.float32(9.80665)
    """
    file, given = Path(path), options or SourceOptions()
    if file.suffix.lower() in _DATA_SETS and given.dtype is None and _is_ours(file):
        return _of_data_set(file, given, tacho)
    with open_source(file, sparing_tacho(given, tacho)) as source:
        channels = channels_of_source(source, tacho)
        if source.empty:
            _LOG.warning("%s: left out, nothing but NaN: %s", source.path, ", ".join(source.empty))
        _refuse_long(source)
        return Recording(
            signal=read_window(source, 0, source.n_samples),
            sample_rate=float(source.sample_rate or 0.0),
            channels=channels,
            tacho=tacho,
            pulses_per_revolution=pulses_per_revolution,
            origin="measured",
            row=dict(source.conditions),
            source=file.name,
        )


def with_views(
    recording: Recording, path: str | Path, record: int, views: Sequence[CompletingView]
) -> Recording:
    """A recording with its views: for data sets by machine and state, for other files as given.

    Parameters
    ----------
    recording : Recording
        Recording from :func:`read_recording`.
    path : str or Path
        File of the recording.
    record : int
        Its number, if that is a data set.
    views : sequence of CompletingView
        Files of the views; those that are not data sets must contain all declarations.

    Raises
    ------
    DataError
        As for :func:`read_recording`, :class:`~.file.views.JoinedSet` and
        :func:`~.file.views.joined_recordings`.
    """
    if not views:
        return recording
    files = [Path(path), *(view.path for view in views)]
    if all(file.suffix.lower() in _DATA_SETS and _is_ours(file) for file in files):
        with JoinedSet(files[0], tuple(views)) as data:
            return data[record]
    return joined_recordings(recording, {view.name: read_recording(view.path) for view in views})


def _is_ours(file: Path) -> bool:
    """Whether an HDF5 file claims to be a data set; also True if it cannot be read at all."""
    try:
        with h5py.File(file, "r") as handle:
            return bool({"created_by", "schema_version"} & set(handle.attrs))
    except HDF5_FAULTS:
        return True  # the reader of data sets reports it


def _of_data_set(file: Path, options: SourceOptions, tacho: str | None) -> Recording:
    default = SourceOptions()
    wrong = [
        field.name
        for field in fields(SourceOptions)
        if field.name not in ("record", "fs", "channels")
        and getattr(options, field.name) != getattr(default, field.name)
    ]
    with DataSet(file) as data:
        head = data.attributes
        faults = [f"{', '.join(wrong)} must not be given; it declares its own"] if wrong else []
        if options.fs not in (None, head.sample_rate):
            faults.append(f"fs = {options.fs:.10g} Hz must be {head.sample_rate:.10g} Hz; leave it")
        if tacho not in (None, head.tacho):
            faults.append(f"tacho = {tacho!r} must be {head.tacho!r}, as declared; leave it out")
        if not 0 <= options.record < len(data):
            faults.append(
                f"record = {options.record} must be >= 0 and < {len(data)}; choose another"
            )
        if faults:
            raise DataError("\n".join(f"{file}: {fault}" for fault in faults))
        return chosen_channels(data[options.record], options.channels)


def chosen_channels(recording: Recording, entries: Sequence[str]) -> Recording:
    """Some channels of a recording in a given order, and its tacho.

    Parameters
    ----------
    recording : Recording
    entries : sequence of str
        Names, or ``NEW=OLD`` to rename a channel; none for all.

    Raises
    ------
    DataError
        A channel does not exist, or two get the same name.

    Examples
    --------
    >>> three = Recording.from_array(np.zeros((3, 8)), 1e3, channels=["x", "p", "key"], tacho="key")
    >>> chosen_channels(three, ["acc=x"]).names
    ('acc', 'key')
    """
    if not entries:
        return recording
    old = {new: before or new for new, before in map(new_and_old, entries)}
    if recording.tacho is not None and recording.tacho not in old.values():
        old.setdefault(recording.tacho, recording.tacho)
    names = recording.names
    faults = [
        f"{recording.source}: has no channel '{name}'; choose one of {', '.join(names)}"
        for name in old.values()
        if name not in names
    ]
    if len({*map(new_and_old, entries)}) < len(entries) or len(old) < len(entries):
        faults.append(
            f"{recording.source}: channels = {', '.join(entries)} must differ; rename one"
        )
    if faults:
        raise DataError("\n".join(faults))
    rows = [names.index(name) for name in old.values()]
    new = {before: name for name, before in old.items()}
    return replace(
        recording,
        signal=recording.signal[rows],
        channels=tuple(replace(recording.channels[i], name=new[names[i]]) for i in rows),
        tacho=None if recording.tacho is None else new[recording.tacho],
    )


def _refuse_long(source: Source) -> None:
    size = 4 * len(source.channels) * source.n_samples
    if size > LARGEST_RECORD:
        raise DataError(
            f"{source.path}: its {len(source.channels)} x {source.n_samples} samples have {size} "
            f"byte, must be <= {LARGEST_RECORD}; cut it: wearstate import --segment"
        )


def read_window(source: Source, start: int, n_samples: int) -> NDArray[np.float32]:
    """Read some samples of all channels, in pieces, so that only their float32 is kept in memory.

    Parameters
    ----------
    source : Source
    start, n_samples : int
        First sample and number of samples, within the source.

    Returns
    -------
    numpy.ndarray [shape=(n_channels, n_samples)]
        Samples in the units of the source.

    Raises
    ------
    DataError
        If a sample is not finite or beyond single precision, or the file is damaged there.
    """
    window = np.empty((len(source.channels), n_samples), dtype=np.float32)
    step = max(1, _PIECE // len(source.channels))
    for first in range(0, n_samples, step):
        last = min(first + step, n_samples)
        with np.errstate(over="ignore"):  # becomes inf, refused below
            window[:, first:last] = source.read(start + first, start + last)
    if not np.isfinite(window).all():
        row, at = np.argwhere(~np.isfinite(window))[0].tolist()
        raise DataError(
            f"{source.path}: channel '{source.channels[row].name}' is beyond 3.4e38 at index "
            f"{start + at}, must fit single precision; check its unit"
        )
    return window


def list_contents(
    files: Sequence[str | Path], options: SourceOptions | None = None
) -> list[dict[str, Any]]:
    """Content of files, ready for JSON; no signals are read.

    Parameters
    ----------
    files : sequence of str or Path
    options : SourceOptions, optional
        Layout and declarations; the selection (variable, channels) is ignored.

    Returns
    -------
    list of dict
        One entry per file: ``file``, ``recordings`` (each with ``variable``, ``channels``,
        ``sample_rate_hz``, ``samples``, ``duration_s``, ``conditions``, ``undeclared``), ``fault``
        (why it cannot be read, or empty).

    Raises
    ------
    DataError
        If no file can be read; the faults of all at once.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(Path(folder) / "x.npy", np.ones((2, 9)))
    ...     [found] = list_contents([Path(folder) / "x.npy"], SourceOptions(fs=9.0))
    >>> [(part["samples"], part["duration_s"]) for part in found["recordings"]]
    [(9, 1.0)]
    """
    found, faults = [], []
    for file in files:
        parts: Sequence[Source] = ()
        fault = ""
        try:
            parts = list_sources(file, options)
        except DataError as error:
            faults += str(error).split("\n")
            fault = str(error).replace(f"{file}: ", "")  # the entry has its name
        described = [_described(part) for part in parts]
        found.append({"file": str(file), "recordings": described, "fault": fault})
        for part in parts:
            part.close()
    if found and all(each["fault"] for each in found):
        raise refusal(faults)
    return found


def _described(source: Source) -> dict[str, Any]:
    rate = source.sample_rate
    return {
        "variable": source.part,
        "channels": [
            {"name": c.name, "unit": c.unit, "quantity": c.quantity, "unit_in_file": c.unit_in_file}
            for c in source.channels
        ],
        "sample_rate_hz": rate,
        "samples": source.n_samples,
        "records": source.n_records,
        "duration_s": None if rate is None else source.n_samples / rate,
        "conditions": dict(source.conditions),
        "undeclared": list(source.undeclared),
    }
