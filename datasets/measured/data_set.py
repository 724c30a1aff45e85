"""Many measured files into one data set, laid out like a simulated one."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.order import pulse_times
from ...sim.output.recording import DataError
from ...sim.output.sensor import Channel
from ...sim.parts.wording import nearest
from ..file.attributes import Attributes
from ..file.machines import FILE, GROUP_NAME
from ..file.record import DataSet
from ..file.writer import DataSetWriter, refuse_output
from ..readers.open import open_records
from ..source.part import SourceOptions
from ..workers.local import in_order
from .label_columns import ROW
from .label_table import refusal
from .labels import LabelLimits, Labels
from .plan import Header, ImportPlan, plan_records, read_headers, sparing_tacho, worth_workers
from .recording import read_window
from .rows import MEAN_SPEED, START, FileRows, GroupBy, file_rows

NO_PULSES = "no_tacho_pulses"
"""Status of a record whose tacho has less than a revolution between its pulses."""

_BATCH = 2**23  # numbers that a worker reads before it passes them on: 32 MB


@dataclass(frozen=True, kw_only=True)
class ImportSummary:
    """Result of an import.

    Attributes
    ----------
    path : Path
        The file.
    n_records, n_files, n_groups : int
        Numbers of records, of their files, and of machines.
    sample_rate : float
        Sample rate [Hz].
    duration : float
        Length of a record [s].
    channels : tuple of str
        Names with units.
    severities, labels : tuple of str
        Manifest columns of wear, and further labels and conditions.
    grades, statuses : dict
        Number of records by grade (-1 unknown) and by status.
    left_over : dict
        Time at the end of a file that fills no record [s], by file; only if it is not zero.
    speeds : tuple of float
        Smallest and largest mean speed by the tacho [Hz]; empty without one.
    unused_rows : int
        Number of label rows about other files.
    twins : tuple of (str, str)
        Pairs of files of different groups that hold an identical record.
    empty : dict
        Channels of NaN only by file, which are left out.
    """

    path: Path
    n_records: int
    n_files: int
    n_groups: int
    sample_rate: float
    duration: float
    channels: tuple[str, ...]
    severities: tuple[str, ...]
    labels: tuple[str, ...]
    grades: dict[int, int]
    statuses: dict[str, int]
    left_over: dict[str, float]
    speeds: tuple[float, ...]
    unused_rows: int
    twins: tuple[tuple[str, str], ...]
    empty: dict[str, tuple[str, ...]]


def import_recordings(
    files: Sequence[str | Path],
    path: str | Path,
    *,
    options: SourceOptions | None = None,
    tacho: str | None = None,
    pulses_per_revolution: int = 1,
    labels: Labels | None = None,
    limits: LabelLimits | None = None,
    group_by: GroupBy | None = None,
    segment: float | None = None,
    overlap: float = 0.0,
    places: Mapping[str, str] | None = None,
    directions: Mapping[str, str] | None = None,
    jobs: int = 1,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> ImportSummary:
    """Write measured files as a data set, laid out like a simulated one.

    Parameters
    ----------
    files : sequence of str or Path
        Files of any formats, with one sample rate and the same channels. Records are sorted by file
        name.
    path : str or Path
        File to write, completely or not at all.
    options : SourceOptions, optional
        Declarations that the files lack.
    tacho : str, optional
        Name of the tacho channel.
    pulses_per_revolution : int
        Pulses of the tacho in one revolution.
    labels : Labels, optional
        From :func:`~.measured.labels.read_labels`.
    limits : Limits, optional
        Limits of the first severity; they determine the grade.
    group_by : {"file", "folder", "column"}, optional
        What counts as one machine: groups determine every split, so that windows of one file are
        never on both sides. By default the column ``group`` of the labels if there is one, or else
        the file.
    segment : float, optional
        Length of a record [s]; by default whole files, which must then be of one length. The
        remainder at the end of a file is reported and left out, never padded.
    overlap : float
        Share of a record that the next one repeats, 0 <= overlap < 1.
    places, directions : mapping of str to str, optional
        Place and direction by channel; for a force cell, the point and the direction of the force.
    jobs : int
        Number of reading processes, >= 1; the result does not depend on it.
    force : bool
        Replace an existing file.
    progress : callable, optional
        Called with (records done, records in total).

    Returns
    -------
    ImportSummary
        Counts, and what was left out.

    Raises
    ------
    DataError
        If a file cannot be read, lacks rate, unit, tacho or label, or differs from the others; no
        record has tacho pulses; or the output exists. Nothing is left behind.

    Notes
    -----
    Memory holds one record, and a few tens of megabytes per process. A record whose tacho has less
    than a revolution between pulses has the status :data:`NO_PULSES`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(Path(folder) / "x.npy", np.ones((2, 9)))
    ...     options = SourceOptions(fs=3.0, unit="g", channels=("a", "b"))
    ...     file = Path(folder) / "data.h5"
    ...     summary = import_recordings(
    ...         [Path(folder) / "x.npy"], file, options=options, segment=1.0
    ...     )
    ...     with DataSet(file) as data:
    ...         data[2].vibration[0], summary.n_groups
    (array([9.80665, 9.80665, 9.80665], dtype=float32), 1)
    """
    target = Path(path)
    refuse_output(target.absolute(), force)
    reading = _Reading(
        options=sparing_tacho(options or SourceOptions(), tacho),
        tacho=tacho,
        pulses_per_revolution=pulses_per_revolution,
    )
    _refuse_chosen_row(reading.options)
    _refuse_counts(tacho, pulses_per_revolution, jobs)
    headers = read_headers(files, reading.options, tacho, jobs=jobs)
    plan = plan_records(headers, segment, overlap)
    plan = replace(plan, channels=_placed(plan.channels, places or {}, directions or {}))
    known = labels or Labels(columns={}, constants={})
    table = file_rows(headers, known, limits=limits, group_by=group_by, tacho=tacho)
    writer = DataSetWriter(
        target,
        _attributes(plan, reading, known, limits),
        n_records=plan.n_records,
        n_samples=plan.n_samples,
        columns=table.columns,
        force=force,
        resumable=False,
    )
    with writer:
        records = _all_records(reading, plan, jobs)
        _write(writer, records, table, plan.n_records, progress)
        _refuse_silent(writer.manifest(), tacho)
        writer.finish()
    return _summary(target, plan, known, table)


def _placed(
    channels: tuple[Channel, ...], places: Mapping[str, str], directions: Mapping[str, str]
) -> tuple[Channel, ...]:
    """Channels with the given places and directions."""
    names = [channel.name for channel in channels]
    faults = [
        f"{what}: no channel {name!r} is imported{nearest(name, names)}"
        for what, given in (("place", places), ("direction", directions))
        for name in given
        if name not in names
    ]
    if faults:
        raise DataError("\n".join(faults))
    return tuple(
        replace(
            channel,
            place=places.get(channel.name, channel.place),
            direction=directions.get(channel.name, channel.direction),
        )
        for channel in channels
    )


def _refuse_chosen_row(options: SourceOptions) -> None:
    if options.rows is not None and options.record:
        raise DataError(
            f"record = {options.record} must not be given with rows = {options.rows}, all of which "
            "are imported; leave it out"
        )


def _refuse_counts(tacho: str | None, pulses_per_revolution: int, jobs: int) -> None:
    faults = [
        f"{name} = {value} must be >= 1; give a whole number"
        for name, value in (("pulses_per_revolution", pulses_per_revolution), ("jobs", jobs))
        if value < 1
    ]
    if tacho is None and pulses_per_revolution > 1:
        faults.append(
            f"pulses_per_revolution = {pulses_per_revolution} must be those of a tacho; name it "
            "with tacho"
        )
    if faults:
        raise refusal(faults)


def _attributes(
    plan: ImportPlan, reading: "_Reading", labels: Labels, limits: LabelLimits | None
) -> Attributes:
    head = Attributes(
        sample_rate=plan.sample_rate,
        channels=plan.channels,
        origin="measured",
        tacho=reading.tacho,
        pulses_per_revolution=reading.pulses_per_revolution,
        severities=labels.severities,
    )
    if limits is None:
        return head
    return replace(
        head,
        grade_edges=limits.edges,
        condemning_limit=limits.edges[-1],
        limit_source=limits.source,
    )


# --- records ------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Reading:
    """Settings for reading every file."""

    options: SourceOptions
    tacho: str | None
    pulses_per_revolution: int


@dataclass(frozen=True)
class _Record:
    """Data of one record."""

    signal: NDArray[np.float32]
    row: dict[str, Any]


def _records(
    reading: _Reading, n_samples: int, header: Header, starts: Sequence[int]
) -> Iterator[_Record]:
    """Records of one file, one after the other."""
    sources = open_records(header.path, reading.options)
    with sources[0]:
        for number, start in product(range(header.n_records), starts):
            signal = read_window(sources[number], start, n_samples)
            row = {START: start / header.sample_rate, ROW: number, "status": "ok"}
            if reading.tacho is not None:
                names = [channel.name for channel in header.channels]
                speed = _speed(signal[names.index(reading.tacho)], header.sample_rate, reading)
                row |= {MEAN_SPEED: speed, "status": "ok" if speed > 0 else NO_PULSES}
            yield _Record(signal, row)


def _speed(tacho: NDArray[np.float32], rate: float, reading: _Reading) -> float:
    """Mean speed between the first and the last pulse [Hz], NaN below a revolution."""
    try:
        pulses = pulse_times(tacho, rate)
    except ValueError:
        return math.nan
    turns = (len(pulses) - 1) / reading.pulses_per_revolution
    return float(turns / (pulses[-1] - pulses[0])) if turns >= 1 else math.nan


_Files = list[tuple[Header, range]]


def _batch(reading: _Reading, n_samples: int, files: _Files) -> list[_Record]:
    """Records of some small files; runs in a worker."""
    return [r for header, starts in files for r in _records(reading, n_samples, header, starts)]


def _batches(plan: ImportPlan) -> Iterator[_Files]:
    """Files in order, small ones grouped up to a batch, a large one by itself."""
    frame = plan.n_samples * len(plan.channels)
    waiting: _Files = []
    size = 0
    for header, starts in zip(plan.headers, plan.starts, strict=True):
        own = frame * header.n_records * len(starts)
        if waiting and size + own > _BATCH:
            yield waiting
            waiting, size = [], 0
        waiting.append((header, starts))
        size += own
    yield waiting


def _all_records(
    reading: _Reading, plan: ImportPlan, jobs: int
) -> Iterator[tuple[Header, _Record]]:
    """Records in order; workers read the small files, this process the large ones."""
    frame = plan.n_samples * len(plan.channels)
    batches = list(_batches(plan))
    large = [
        frame * sum(header.n_records * len(starts) for header, starts in files) > _BATCH
        for files in batches
    ]
    small = [files for files, big in zip(batches, large, strict=True) if not big]
    workers = worth_workers([header.path for header in plan.headers], jobs)
    read = partial(_batch, reading, plan.n_samples)
    pieces = in_order(read, small, jobs=max(1, min(workers, len(small))))
    for files, big in zip(batches, large, strict=True):
        owners = (header for header, starts in files for _ in range(header.n_records * len(starts)))
        records = _records(reading, plan.n_samples, *files[0]) if big else next(pieces)
        yield from zip(owners, records, strict=True)


def _write(
    writer: DataSetWriter,
    records: Iterator[tuple[Header, _Record]],
    table: FileRows,
    n_records: int,
    progress: Callable[[int, int], None] | None,
) -> None:
    for index, (header, record) in enumerate(records):
        labels = table.rows[header.name, int(record.row[ROW])]
        row = {**labels, **record.row, "record_id": str(index)}
        if ROW not in table.columns:
            del row[ROW]
        writer.write(index, record.signal, row)
        if progress is not None:
            progress(index + 1, n_records)


def _refuse_silent(rows: NDArray[np.void], tacho: str | None) -> None:
    if (rows["status"] == NO_PULSES.encode()).all():
        raise DataError(
            f"tacho '{tacho}' has a revolution between its pulses in 0 of {len(rows)} records, "
            "must have in >= 1; check that it is the tacho, its pulses per revolution, and that "
            "the records are longer than a revolution"
        )


# --- summary ------------------------------------------------------------------------------------


def _summary(path: Path, plan: ImportPlan, labels: Labels, table: FileRows) -> ImportSummary:
    with DataSet(path) as data:
        manifest = data.manifest
        twins = _twins(data)
    ends = zip(plan.headers, plan.left_over, strict=True)
    own = {FILE, GROUP_NAME, START, ROW, *labels.severities}
    return ImportSummary(
        path=path,
        n_records=plan.n_records,
        n_files=len(plan.headers),
        n_groups=int(manifest["group"].nunique()),
        sample_rate=plan.sample_rate,
        duration=plan.n_samples / plan.sample_rate,
        channels=tuple(channel.label for channel in plan.channels),
        severities=labels.severities,
        labels=tuple(name for name in table.columns if name not in own),
        grades=dict(sorted(Counter(manifest["grade"].tolist()).items())),
        statuses=dict(sorted(Counter(manifest["status"].tolist()).items())),
        left_over={header.name: rest for header, rest in ends if rest > 0},
        speeds=_range(manifest[MEAN_SPEED]) if MEAN_SPEED in manifest else (),
        unused_rows=table.unused,
        twins=twins,
        empty={header.name: header.empty for header in plan.headers if header.empty},
    )


def _range(values: Any) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _twins(data: DataSet) -> tuple[tuple[str, str], ...]:
    """Files of different groups that hold an identical record; one pair for every such record."""
    first: dict[int, int] = {}
    found: dict[tuple[str, str], None] = {}
    groups, files = data.manifest["group"].to_numpy(), data.manifest[FILE].to_numpy()
    for index, checksum in enumerate(data.manifest["signal_crc32"].tolist()):
        other = first.setdefault(checksum, index)
        # of 100,000 records two have the same checksum by chance: compare them
        if groups[other] != groups[index] and np.array_equal(
            data[other].signal, data[index].signal
        ):
            found[(str(files[other]), str(files[index]))] = None
    return tuple(found)
