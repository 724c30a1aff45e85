"""The verdict on many recordings: a folder, or every record of a data set, and their trends.

Only one recording is in memory at a time; for the others a row is kept. A recording that cannot be
read becomes a row that names its fault.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...datasets.file.machines import GROUP_NAME
from ...datasets.file.record import DataSet
from ...datasets.file.views import CompletingView, JoinedSet
from ...datasets.measured.recording import chosen_channels, read_recording
from ...datasets.readers.open import READERS
from ...datasets.source.part import SourceOptions
from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_table import Progress, is_regime, regime_words
from ..film_clearance.clearance import FilmEstimate
from ..healthy_reference.healthy import Baseline, Baselines
from ..learning.grades import GRADE_NAMES, WARNING_GRADE
from ..nameplate.cautions import recording_context
from ..nameplate.nameplate import Nameplate
from ..nameplate.sensors import corrected_recording
from ..pages.words import quantity_name
from ..wear_model.bundle import ModelError
from ..wear_model.estimate import WearModel
from ..wear_model.verdict import Estimate
from .advice import Advice, advise
from .film import film_estimate, film_table, with_film
from .trend import Growth, Outlook, Trend, date_in, fit_trend, hours_of, read_dates
from .verdict import NO_REFERENCE, REPORT_SCHEMA, headline, limits_table, model_table

HOURS = "operating_hours"
"""Default manifest column and condition for the time of a recording [h]."""

_DATA_SETS = (".h5", ".hdf5")
_NO_RECORDINGS = (".txt",)  # read if named; in a folder usually notes


@dataclass(frozen=True, kw_only=True)
class Item:
    """A recording that has not been read yet.

    Attributes
    ----------
    name : str
        File name, and record number in it.
    machine : str
        Machine of the recording; empty if all are from one machine.
    path : Path
    row : mapping
        Its manifest row; empty if the file is no data set.
    load : callable
        Reads it; raises DataError.
    """

    name: str
    machine: str
    path: Path
    row: Mapping[str, Any]
    load: Callable[[], Recording]


@dataclass(frozen=True, kw_only=True)
class BatchRow:
    """Row of one recording in the table.

    Attributes
    ----------
    number : int
        Index of its item.
    name, machine : str
    time_h : float or None
        Operating hours, or calendar hours since 1970 [h].
    estimate : Estimate
    advice : Advice
    current : bool
        It shows the present state: only the latest recording of a machine if times are known.
    """

    number: int
    name: str
    machine: str
    time_h: float | None
    estimate: Estimate
    advice: Advice
    current: bool = True

    @property
    def headline(self) -> str:
        """The verdict in a few words."""
        found = self.estimate
        if found.grade is None:
            return headline(found).split(":")[0]
        sign = "?" if found.verdict == "caution" else ""
        return f"{found.grade} {found.grade_name}{sign}"

    @property
    def point(self) -> tuple[float | None, ...]:
        """Time [h], wear and its interval [m], as the trend needs them; None if unknown."""
        return self.time_h, self.estimate.severity, self.estimate.low, self.estimate.high

    @property
    def note(self) -> str:
        """Faults that are present, and the first reason or caution."""
        found = self.estimate
        present = [
            regime_words(f.name) if is_regime(f.name) else f"{f.name.replace('_', ' ')} present"
            for f in found.confounders
            if f.present
        ]
        return "; ".join([*present, *(*found.reasons, *found.cautions)[:1]])

    @property
    def urgency(self) -> tuple[bool, int, float, float]:
        """Sort key: action needed, then not judged, then healthy, then past recordings.

        Among those that need action the shortest horizon comes first, then the most worn.
        """
        past = not self.current
        if past:
            return (past, 0, 0.0, -(self.time_h or 0.0))
        found = self.estimate
        if found.grade is None:
            return (past, 1 if found.verdict == "unusable" else 2, 0.0, 0.0)
        group = 0 if found.grade >= WARNING_GRADE else 3
        return (past, group, self.advice.days or 0.0, -(found.severity or 0.0))


@dataclass(frozen=True, kw_only=True)
class Batch:
    """The verdicts on many recordings.

    Attributes
    ----------
    source : str
        Folder or file.
    rows : tuple of BatchRow
        The most urgent first.
    items : tuple of Item
        In the order of `BatchRow.number`.
    trends : dict
        Machine -> Trend.
    limits, provenance : dict
        As in :func:`wearstate.diagnose.report.verdict.report_table`.
    notice : str
    """

    source: str
    rows: tuple[BatchRow, ...]
    items: tuple[Item, ...]
    trends: dict[str, Trend]
    limits: dict[str, Any]
    provenance: dict[str, Any]
    notice: str

    @property
    def current(self) -> tuple[BatchRow, ...]:
        """Rows that show the present state of the machines; the worst first."""
        return tuple(row for row in self.rows if row.current)

    @property
    def undated(self) -> str:
        """Message on recordings in no trend for lack of a time; empty if all or none have one."""
        names = [row.name for row in self.rows if row.time_h is None]
        if not names or len(names) == len(self.rows):
            return ""
        shown = ", ".join(sorted(names)[:_SHOWN_UNDATED])
        more = f" and {len(names) - _SHOWN_UNDATED} more" if len(names) > _SHOWN_UNDATED else ""
        return (
            f"{len(names)} of {len(self.rows)} recordings have no time that can be read and are in "
            f"no trend: {shown}{more}; begin the date in a name with the year, as 2026-11-23, or "
            "give --dates CSV"
        )

    def outlook_of(self, row: BatchRow) -> Outlook | None:
        """Outlook of the machine's trend; None unless the row is its latest recording."""
        trend = self.trends.get(row.machine)
        return trend.outlook if trend and row.current and row.time_h is not None else None

    def counts(self) -> dict[str, int]:
        """Number of current recordings of each grade, worst first, and of those without a grade."""
        words = [(grade, GRADE_NAMES[grade]) for grade in reversed(range(len(GRADE_NAMES)))]
        estimates = [row.estimate for row in self.current]
        found = {name: sum(each.grade == grade for each in estimates) for grade, name in words}
        alone = sum(row.headline == NO_REFERENCE for row in self.current)
        for verdict in ("unusable", "unfamiliar"):
            found[verdict] = sum(each.verdict == verdict for each in estimates)
        found["unusable"] -= alone
        return found | {"without healthy reference": alone}

    def summary(self) -> str:
        """Number of recordings, and verdicts on the current ones."""
        verdicts = ", ".join(f"{count} {name}" for name, count in self.counts().items() if count)
        past = len(self.rows) - len(self.current)
        whole = f"{len(self.rows)} recordings"
        if all(row.estimate.grade is None for row in self.current):
            whole = f"no grade is given, {whole}"
        return f"{whole}; now: {verdicts}" if past else f"{whole}: {verdicts}"


_SHOWN_UNDATED = 4


# --- which recordings


@contextmanager
def recordings_in(
    path: Path,
    options: SourceOptions | None = None,
    *,
    tacho: str | None = None,
    pulses_per_revolution: int = 1,
    leave_out: Sequence[Path] = (),
    views: Sequence[CompletingView] = (),
) -> Iterator[tuple[Item, ...]]:
    """Recordings of a folder (without its subfolders), or records of a data set.

    Parameters
    ----------
    path : Path
    options, tacho, pulses_per_revolution
        As in :func:`wearstate.datasets.measured.recording.read_recording`.
    leave_out : sequence of Path
        Files of the folder that are not recordings: dates, baseline.
    views : sequence of CompletingView
        Data sets that complete the records of a data set.

    Yields
    ------
    tuple of Item
        Sorted by name; a data set stays open while the context is.

    Raises
    ------
    DataError
        The folder has no recordings, or the data set cannot be read or contradicts the options.
    """
    read = partial(
        read_recording, options=options, tacho=tacho, pulses_per_revolution=pulses_per_revolution
    )
    chosen = options.channels if options else ()
    if not path.is_dir():
        read(path)  # refuses options that contradict what the data set declares
        with JoinedSet(path, tuple(views)) as data:
            yield tuple(_records(path, data, chosen))
        return
    spared = {file.resolve() for file in leave_out}
    files = [file for file in _recording_files(path) if file.resolve() not in spared]
    items = tuple(item for file in files for item in _items_of(file, read, chosen))
    if not items:
        known = ", ".join(sorted(set(READERS) - set(_NO_RECORDINGS)))
        raise DataError(f"{path} holds 0 recordings, must hold >= 1; put in {known}")
    yield items


def _recording_files(folder: Path) -> list[Path]:
    return sorted(
        file
        for file in folder.iterdir()
        if file.is_file()
        and not file.name.startswith(".")
        and file.suffix.lower() in READERS
        and file.suffix.lower() not in _NO_RECORDINGS
    )


def _items_of(file: Path, read: Callable[[Path], Recording], chosen: Sequence[str]) -> list[Item]:
    """Every record of a data set; one item for any other file, readable or not."""
    if file.suffix.lower() in _DATA_SETS:
        try:
            with JoinedSet(file) as data:  # closed: the number of open files is limited
                return _records(file, data, chosen, close=True)
        except DataError:
            pass  # from another program, or damaged: reading it raises the right error
    return [Item(name=file.name, machine="", path=file, row={}, load=partial(read, file))]


def _records(
    file: Path, data: JoinedSet, chosen: Sequence[str], *, close: bool = False
) -> list[Item]:
    several = data.data.manifest["group"].nunique() > 1
    return [
        Item(
            name=file.name if len(data.data) == 1 else f"{file.name}[{i}]",
            machine=str(row.get(GROUP_NAME, row["group"])) if several else "",
            path=file,
            row=row,
            load=partial(_read_record, data, i, chosen, close=close),
        )
        for i, row in enumerate(_manifest_rows(data.data))
    ]


def _read_record(data: JoinedSet, index: int, chosen: Sequence[str], *, close: bool) -> Recording:
    """One record with the channels chosen; a closed data set opens by itself."""
    try:
        return chosen_channels(data[index], chosen)
    finally:
        if close:
            data.close()


def _manifest_rows(data: DataSet) -> Iterator[dict[str, Any]]:
    for row in data.manifest.to_dict("records"):
        yield {str(key): value for key, value in row.items()}


def record_count(path: Path) -> int:
    """Number of records of a data set; 1 for any other file, readable or not."""
    if path.suffix.lower() not in _DATA_SETS:
        return 1
    try:
        with DataSet(path) as data:
            return len(data)
    except DataError:
        return 1


# --- when they were made


def times_of(items: Sequence[Item], dates: str) -> tuple[float | None, ...]:
    """Time of each recording.

    Parameters
    ----------
    items : sequence of Item
    dates : str
        ``names`` (dates in the file names), ``mtime`` (of the files), a CSV file with columns
        ``file,date`` or ``file,hours``, or a column of the data set that counts hours.

    Returns
    -------
    tuple of (float or None)
        [h]; None for a recording without a time.

    Raises
    ------
    DataError
        `dates` is none of these, or no recording has a time.
    """
    if dates == "names":
        moments = [date_in(item.name) for item in items]
        found = [None if moment is None else hours_of(moment) for moment in moments]
    elif dates == "mtime":
        found = [item.path.stat().st_mtime / 3600 for item in items]
    elif Path(dates).suffix.lower() == ".csv":
        table = read_dates(Path(dates))
        found = [table.get(item.name, table.get(item.path.name)) for item in items]
    else:
        found = [_hours_in(item.row, dates) for item in items]
    if all(time is None for time in found):
        raise DataError(
            f"dates = {dates!r} gives a time to 0 of {len(items)} recordings, must give >= 1; use "
            f"names, mtime, a CSV file with columns file,date that names recordings as "
            f"{items[0].name!r}, or a column such as {HOURS}"
        )
    return tuple(found)


def _hours_in(row: Mapping[str, Any], column: str) -> float | None:
    value = row.get(column)
    return float(value) if isinstance(value, (int, float)) and value == value else None


def clock_is_operating(dates: str) -> bool:
    """Whether times are operating hours, not calendar dates."""
    if dates in ("names", "mtime"):
        return False
    if Path(dates).suffix.lower() != ".csv":
        return True
    with Path(dates).open(encoding="utf-8-sig") as handle:
        return "hours" in handle.readline().lower()


# --- the verdicts


def judge_all(
    source: Path,
    items: Sequence[Item],
    model: WearModel,
    *,
    model_file: Path | None = None,
    baselines: Baselines | None = None,
    plate: Nameplate | None = None,
    dates: str | None = None,
    growth: Growth = "linear",
    seed: int = 0,
    on_result: Callable[[dict[str, Any]], None] | None = None,
    progress: Progress | None = None,
) -> Batch:
    """Judge recordings one after the other.

    Parameters
    ----------
    source : Path
        Folder or file of the recordings.
    items : sequence of Item
    model : WearModel
    model_file : Path, optional
        Its file, to be hashed.
    baselines : Baselines, optional
        Healthy recordings of the machines.
    plate : Nameplate, optional
        Nameplate of the machines, for the estimate by film equilibrium.
    dates : str, optional
        Source of the times, as in :func:`times_of`; required for a trend.
    growth : {"linear", "log"}
        Assumed growth of the wear, for the trend.
    seed : int
        Seed of the trend's band.
    on_result : callable, optional
        Called with a table for each recording as soon as it is judged, then with one for each
        trend.
    progress : callable, optional
        Called with (recordings done, recordings).

    Returns
    -------
    Batch

    Raises
    ------
    ModelError
        The features of this program are not those of the model.
    DataError
        A trend is requested but no recording has a time.
    """
    times = (None,) * len(items) if dates is None else times_of(items, dates)
    rows = []
    for number, (item, time) in enumerate(zip(items, times, strict=True)):
        estimate, film = _judged(item, model, baselines, plate)
        advice = _advice(estimate, model)
        rows.append(
            BatchRow(
                number=number,
                name=item.name,
                machine=item.machine,
                time_h=time,
                estimate=estimate,
                advice=advice,
            )
        )
        if on_result is not None:
            line = _line(item, time, estimate, advice)
            on_result(line | {"film": film_table(film, plate, item.row)})
        if progress is not None:
            progress(number + 1, len(items))
    clock = dates is not None and clock_is_operating(dates)
    trends = {} if dates is None else _trends(rows, model, growth, clock, seed)
    if on_result is not None:
        for machine, trend in trends.items():
            on_result(trend_table(machine, trend))
    rows = _with_past(rows)
    rows = [_hastened(row, trends.get(row.machine), model) for row in rows]
    return Batch(
        source=source.name or str(source),
        rows=tuple(sorted(rows, key=lambda row: row.urgency)),
        items=tuple(items),
        trends=trends,
        limits=limits_table(model.card),
        provenance={
            "program": f"wearstate {__version__}",
            "model": model_table(model, model_file),
            "baseline": None if baselines is None else baselines.source,
        },
        notice=model.notice,
    )


def _judged(
    item: Item, model: WearModel, baselines: Baselines | None, plate: Nameplate | None
) -> tuple[Estimate, FilmEstimate | None]:
    """Estimate of a recording; one that cannot be read is unusable and does not stop the others."""
    try:
        recording = item.load()
        baseline = None if baselines is None else baselines.of(recording)
        film = film_estimate(recording, model.card.severity, plate, baseline)
        return with_film(informed_estimate(recording, model, baseline, plate), film), film
    except ModelError:
        raise  # applies to every recording
    except (ValueError, OSError) as error:
        reasons = (fault_of(item, error),)
        return Estimate(verdict="unusable", reasons=reasons, mode=model.mode), None


def informed_estimate(
    recording: Recording, model: WearModel, baseline: Baseline | None, plate: Nameplate | None
) -> Estimate:
    """Estimate of a model for a recording, with all that is known of the machine."""
    return model.estimate(
        corrected_recording(recording, plate, baseline),
        baseline,
        **recording_context(plate, recording, model.card, baseline),
    )


def fault_of(item: Item, error: Exception) -> str:
    """Why a recording could not be read."""
    return str(error).replace(f"{item.path}: ", "", 1)  # the row has its name


def _line(item: Item, time: float | None, estimate: Estimate, advice: Advice) -> dict[str, Any]:
    return {
        "schema_version": REPORT_SCHEMA,
        "kind": "recording",
        "name": item.name,
        "machine": item.machine,
        "time_h": time,
        "headline": headline(estimate),
        "estimate": estimate.as_dict(),
        "advice": asdict(advice),
    }


def trend_table(machine: str, trend: Trend) -> dict[str, Any]:
    """A trend for JSON."""
    return {
        "schema_version": REPORT_SCHEMA,
        "kind": "trend",
        "machine": machine,
        "recordings": len(trend.time_h),
        "maintenance_before": [trend.time_h[i] for i in trend.starts[1:]],
        "outlook": None if trend.outlook is None else asdict(trend.outlook),
        "reason": trend.reason,
    }


def _trends(
    rows: Sequence[BatchRow], model: WearModel, growth: Growth, operating: bool, seed: int
) -> dict[str, Trend]:
    """Trend of every machine that has a graded recording with a time."""
    usable: dict[str, list[tuple[float, ...]]] = {}
    for row in rows:
        known = tuple(value for value in row.point if value is not None)
        if len(known) == len(row.point):
            usable.setdefault(row.machine, []).append(known)
    return {
        machine: fit_trend(
            *np.transpose(points),
            limit=model.card.condemning_limit_m,
            clock="operating" if operating else "calendar",
            growth=growth,
            seed=seed,
        )
        for machine, points in usable.items()
    }


def _with_past(rows: Sequence[BatchRow]) -> list[BatchRow]:
    """Mark all but the latest row of each machine as past; a row without a time stays current."""
    latest: dict[str, float] = {}
    for row in rows:
        if row.time_h is not None:
            latest[row.machine] = max(row.time_h, latest.get(row.machine, row.time_h))
    return [
        replace(row, current=row.time_h is None or row.time_h == latest[row.machine])
        for row in rows
    ]


def _hastened(row: BatchRow, trend: Trend | None, model: WearModel) -> BatchRow:
    """Add the trend to the advice on a machine's latest recording; return other rows unchanged."""
    usable = row.current and row.time_h is not None and row.estimate.grade is not None
    if not usable or trend is None or trend.outlook is None:
        return row
    return replace(row, advice=_advice(row.estimate, model, trend.outlook))


def _advice(estimate: Estimate, model: WearModel, outlook: Outlook | None = None) -> Advice:
    card = model.card
    return advise(estimate, quantity_name(card.severity), card.grade_edges_m, outlook)


def machine_heading(machine: str) -> str:
    """Name of a machine in a heading."""
    return f"machine {machine}" if machine else "the machine"
