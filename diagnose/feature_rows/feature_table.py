"""Feature table of a data set, from its signals."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...datasets.file.csv_cells import safe_frame
from ...datasets.file.record import DataSet
from ...datasets.file.views import MARK, CompletingView, JoinedSet
from ...datasets.workers.local import in_order
from ...features.catalogue.analysis import STANDARD, Analysis, Settings
from ...features.catalogue.catalogue import SetName
from ...features.catalogue.needs import Layout, shortcomings, struck
from ...features.catalogue.row import absent_features, feature_row, layout_names
from ...features.response.transfer import FrfReference, Transfer
from ...features.signal.envelope import BearingFrequencies, bearing_frequencies
from ...sim.atomic import replacing
from ...sim.output.recording import DataError, Recording

_BATCH = 16  # records per task of a worker: 20 MB, few enough to balance the load

Progress = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class FeatureTable:
    """Features of the usable records of a data set.

    Attributes
    ----------
    names : tuple of str
        Feature names.
    values : numpy.ndarray [shape=(n_records, n_features)]
        One row per record.
    manifest : pandas.DataFrame
        The same records' labels, conditions and numerics.
    lacking : dict
        Name of a view -> whether each record lacks it [shape=(n_records,)]; its values are NaN
        then. Only views that some record lacks.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    manifest: pd.DataFrame
    lacking: dict[str, NDArray[np.bool_]] = field(default_factory=dict)

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Records that have every view [shape=(n_records,)]."""
        lost = [np.zeros(len(self.values), dtype=bool), *self.lacking.values()]
        return np.asarray(~np.any(lost, axis=0))

    @property
    def lacking_words(self) -> list[str]:
        """Sentences on views that records lack."""
        return [
            f"{int(flags.sum())} of {len(flags)} records have no view {name}"
            for name, flags in self.lacking.items()
        ]

    def named(self, names: Sequence[str]) -> "FeatureTable":
        """The table with a subset of its features."""
        place = {name: i for i, name in enumerate(self.names)}
        columns = [place[name] for name in names]
        return replace(self, names=tuple(names), values=self.values[:, columns])

    def frame(self) -> pd.DataFrame:
        """Manifest and features side by side."""
        features = pd.DataFrame(self.values, columns=list(self.names), index=self.manifest.index)
        return pd.concat([self.manifest, features], axis=1)


def confounders_in(manifest: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """Faults other than the wear that a manifest labels.

    Parameters
    ----------
    manifest : pandas.DataFrame
        Manifest of a data set; its columns ``confounder_<name>`` are read.

    Returns
    -------
    dict
        Name -> whether it is present [shape=(n_records,)]; empty without labels.

    Examples
    --------
    >>> confounders_in(pd.DataFrame({"grade": [0], "confounder_leak": [1]}))
    {'leak': array([ True])}
    """
    return {
        str(column).removeprefix(_CONFOUNDER): manifest[column].to_numpy(dtype=bool)
        for column in manifest.columns
        if str(column).startswith(_CONFOUNDER)
    }


_CONFOUNDER = "confounder_"

REGIMES = {"lubrication": "pin"}
"""Choices of a recipe that change the vibration caused by wear, and the part they refer to: a model
recognises them."""


def regimes_in(manifest: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """Regimes that a manifest labels, by choice and option.

    Parameters
    ----------
    manifest : pandas.DataFrame
        Manifest of a data set; its columns ``choice_<regime>`` are read.

    Returns
    -------
    dict
        ``<regime>_<option>`` -> whether each record has it [shape=(n_records,)].

    Examples
    --------
    >>> regimes_in(pd.DataFrame({"choice_lubrication": ["dry", "flooded"]}))
    {'lubrication_dry': array([ True, False]), 'lubrication_flooded': array([False,  True])}
    """
    return {
        f"{regime}_{option}": (manifest[f"choice_{regime}"] == option).to_numpy(dtype=bool)
        for regime in REGIMES
        if f"choice_{regime}" in manifest
        for option in sorted(set(manifest[f"choice_{regime}"].dropna()) - {""})
    }


def is_regime(name: str) -> bool:
    """Whether a finding names a regime, not a fault.

    Examples
    --------
    >>> is_regime("lubrication_flooded"), is_regime("stuck_valve")
    (True, False)
    """
    return name.startswith(tuple(f"{regime}_" for regime in REGIMES))


def regime_words(name: str) -> str:
    """A regime with the part it refers to.

    Examples
    --------
    >>> regime_words("lubrication_flooded")
    'flooded pin'
    """
    choice = next(regime for regime in REGIMES if name.startswith(f"{regime}_"))
    return f"{name.removeprefix(f'{choice}_')} {REGIMES[choice]}"


def kind_words(name: str) -> str:
    """A kind of recording that a model refuses, in words.

    Examples
    --------
    >>> kind_words("lubrication_starved"), kind_words("leaking-pumps")
    ('a starved pin', 'the recordings of leaking-pumps')
    """
    return f"a {regime_words(name)}" if is_regime(name) else f"the recordings of {name}"


def knows_no_oil(severity: str, findings: Sequence[str]) -> bool:
    """Whether a model of a pin's clearance was trained without lubrication regimes.

    Examples
    --------
    >>> knows_no_oil("diametral_clearance_crankpin_m", [])
    True
    >>> knows_no_oil("diametral_clearance_crankpin_m", ["lubrication_dry", "lubrication_flooded"])
    False
    """
    return "pin_" in severity and not any(is_regime(name) for name in findings)


@dataclass(frozen=True, kw_only=True)
class FeatureSelection:
    """Selected features of a recording; by default those that models are trained on.

    Attributes
    ----------
    feature_set, only, settings
        As in :func:`wearstate.features.catalogue.row.feature_row`; a name in `only` with a view
        prefix, such as ``running:rms``, selects from that view alone.
    views : tuple of CompletingView
        Data sets whose records complete each row.
    """

    feature_set: SetName = "standard"
    only: tuple[str, ...] | None = None
    settings: Settings = STANDARD
    views: tuple[CompletingView, ...] = ()

    def part(self, view: str = "") -> "FeatureSelection | None":
        """Selection for one view, or for the record itself; None if it is empty.

        Examples
        --------
        >>> FeatureSelection(only=("rms", "running:rms", "running:speed")).part("running").only
        ('rms', 'speed')
        """
        if self.only is None:
            return replace(self, views=())
        named = [name.rpartition(MARK) for name in self.only]
        mine = tuple(label for owner, _, label in named if owner == view)
        return replace(self, only=mine, views=()) if mine else None


def held_against(choice: FeatureSelection, reference: FrfReference | None) -> FeatureSelection:
    """The same features, relative to a healthy reference."""
    if reference is None:
        return choice
    return replace(choice, settings=replace(choice.settings, reference=reference))


class Healthy(Protocol):
    """Transfer functions of machines when they were healthy."""

    def of(self, machine: str) -> FrfReference | None:
        """Reference of a machine; None if there is none."""


USUAL = FeatureSelection()
"""Usual features for training."""


def choice_of(
    feature_set: SetName = "standard",
    only: Sequence[str] = (),
    *,
    machine: str | None = None,
    speed_hz: float | None = None,
    speed_band_hz: Sequence[float] | None = None,
    bearing: Sequence[float] | None = None,
    bands: Sequence[Sequence[float]] = (),
    envelope_band: Sequence[float] | None = None,
    exponential: float = 1.0,
) -> FeatureSelection:
    """Make a feature selection from plain numbers and words, as given on a command line.

    Parameters
    ----------
    feature_set : {"standard", "core", "complete"}
        Set of features.
    only : sequence of str
        Names of features or values; if empty, all of the set.
    machine : str, optional
        Kind of machine, a key of :data:`wearstate.features.signal.iso.KINDS`.
    speed_hz : float, optional
        Nominal shaft speed [Hz]; by default the one stored with each record.
    speed_band_hz : sequence of float, optional
        Search range of the speed without a tacho, low and high [Hz].
    bearing : sequence of float, optional
        Number of rollers, their diameter, pitch diameter (in the same unit) and optionally contact
        angle [deg].
    bands : sequence of sequence of float
        Additional bands, low and high [Hz].
    envelope_band : sequence of float, optional
        Low and high [Hz].
    exponential : float
        Value of an impact test's exponential window at the end of a block, 0 to 1 [-].

    Returns
    -------
    FeatureSelection
        For :func:`feature_table`.

    Raises
    ------
    DataError
        A number of values is wrong, or the geometry is invalid; all faults at once.

    Examples
    --------
    >>> choice_of("core", bearing=[8, 20.0, 120.0]).settings.bearing.outer
    3.3333333333333335
    """
    faults: list[str] = []
    pairs = [
        _pair(values, name, faults)
        for name, values in (
            ("speed_band_hz", speed_band_hz),
            ("envelope_band", envelope_band),
            *(("band", band) for band in bands),
        )
    ]
    geometry = _geometry(bearing, faults)
    if speed_hz is not None and not 0 < speed_hz < math.inf:
        faults.append(f"speed_hz = {speed_hz} Hz must be > 0 and finite; give the nominal speed")
    if not 0 < exponential <= 1:
        faults.append(f"exponential = {exponential} must be > 0 and <= 1; 1 for no window")
    if faults:
        raise DataError("\n".join(faults))
    settings = Settings(
        machine=machine,
        speed_hz=speed_hz,
        speed_band_hz=pairs[0],
        envelope_band=pairs[1],
        exponential=exponential,
        bands=tuple(pair for pair in pairs[2:] if pair is not None),
        bearing=geometry,
    )
    return FeatureSelection(feature_set=feature_set, only=tuple(only) or None, settings=settings)


def _pair(
    values: Sequence[float] | None, name: str, faults: list[str]
) -> tuple[float, float] | None:
    if values is None:
        return None
    if len(values) != 2 or not 0 <= values[0] < values[1] < math.inf:
        faults.append(f"{name} = {list(values)} Hz must be two rising numbers; give LOW,HIGH")
        return None
    return values[0], values[1]


def _geometry(values: Sequence[float] | None, faults: list[str]) -> BearingFrequencies | None:
    if values is None:
        return None
    if len(values) not in (3, 4) or values[0] != round(values[0]):
        faults.append(
            f"bearing = {list(values)} must be a whole number of rollers, their diameter, the "
            "pitch diameter and at most a contact angle [deg]; give N,d,D or N,d,D,ANGLE"
        )
        return None
    angle = math.radians(values[3]) if len(values) == 4 else 0.0
    try:
        return bearing_frequencies(int(values[0]), values[1], values[2], contact_angle=angle)
    except ValueError as error:
        faults.append(str(error))
        return None


def absent_in(path: str | Path, choice: FeatureSelection) -> dict[str, str]:
    """Features of a choice that a data set cannot have, judged by its first record.

    Parameters
    ----------
    path : str or Path
        Data set file.
    choice : FeatureSelection
        Selected features.

    Returns
    -------
    dict
        Name -> reason, with the cure; empty if single features were selected.

    Raises
    ------
    DataError
        The file cannot be read; or a feature selected by name does not exist or cannot be computed.
    """
    with DataSet(path) as data:
        if len(data) == 0:
            raise DataError(f"{path}: 0 records, must be > 0; generate or import some")
        first = data[0]
    if choice.only is not None:
        feature_table_names(path, choice)
        return {}
    try:
        return absent_features(recording_layout(first, choice.settings), choice.feature_set)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error


def recording_features(
    recording: Recording, choice: FeatureSelection = USUAL
) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Feature row of one recording and the views joined to it.

    Parameters
    ----------
    recording : Recording
        With or without tacho.
    choice : FeatureSelection
        Selected features.

    Returns
    -------
    names : tuple of str
        As in :func:`wearstate.features.catalogue.row.feature_names`; those of a view are prefixed
        with its name: ``running:acc_aft.rms``.
    values : numpy.ndarray [shape=(n_features,)]
        Finite.

    Raises
    ------
    DataError
        The features cannot be computed; the text names reason and cure.
    """
    if not recording.joined and choice.part() is choice:
        return _own_features(recording, choice)
    names: tuple[str, ...] = ()
    rows: list[NDArray[np.float64]] = []
    for view, each in {"": recording, **recording.joined}.items():
        part = choice.part(view)
        if part is not None:
            labels, values = _own_features(each, part)
            names += _of_view(view, labels)
            rows.append(values)
    return names, np.concatenate(rows) if rows else np.empty(0)


def _of_view(view: str, labels: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{view}{MARK}{label}" for label in labels) if view else labels


def _own_features(
    recording: Recording, choice: FeatureSelection
) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Feature row of one recording alone."""
    try:
        return feature_row(
            recording,
            feature_set=choice.feature_set,
            only=choice.only,
            settings=_about(recording, choice.settings),
        )
    except ValueError as error:
        raise DataError(f"{recording.source or 'recording'}: {error}") from error


def _about(recording: Recording, settings: Settings) -> Settings:
    """Settings completed by the speed stored with a record, if one is needed and none given."""
    used = settings.machine is not None or (settings.bearing and recording.tacho is None)
    if settings.speed_hz is not None or not used:
        return settings  # identical for all records, whose names are then planned only once
    return replace(settings, speed_hz=recording.declared_speed_hz)


def recording_layout(recording: Recording, settings: Settings = STANDARD) -> Layout:
    """Properties of a recording that the catalogue needs.

    Parameters
    ----------
    recording : Recording
        With or without tacho.
    settings : Settings
        Kind of machine, bearing geometry.

    Returns
    -------
    Layout
        For :func:`wearstate.features.catalogue.row.absent_features`.
    """
    layout = Layout(
        channels=recording.vibration_names,
        quantities=recording.vibration_quantities,
        fs=recording.sample_rate,
        tacho=recording.tacho is not None,
        pulses_per_revolution=recording.pulses_per_revolution,
        n_samples=recording.signal.shape[-1],
        settings=_about(recording, settings),
    )
    return replace(layout, impact=struck(_vibration(recording, layout), layout.kinds))


def _vibration(recording: Recording, layout: Layout) -> NDArray[np.float32]:
    """All channels except tacho and cylinder pressures [shape=(n_vibrations, n_samples)]."""
    cylinders = layout.cylinders
    return recording.vibration[~cylinders] if cylinders.any() else recording.vibration


def feature_table(
    path: str | Path,
    *,
    choice: FeatureSelection = USUAL,
    healthy: Healthy | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> FeatureTable:
    """Features of every usable record of a data set.

    Parameters
    ----------
    path : str or Path
        Data set file.
    choice : FeatureSelection
        Selected features.
    healthy : Healthy, optional
        Transfer functions of each machine when it was healthy.
    jobs : int
        Worker processes; the table does not depend on it.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    FeatureTable
        Records in the order of the file; failed ones are left out. The columns of a view that a
        record lacks are NaN.

    Raises
    ------
    DataError
        The file cannot be read or holds no usable record; or its records cannot be matched with
        those of a view.
    """
    _refuse_unjoined(choice, path)
    with JoinedSet(Path(path), choice.views) as data:
        usable = _usable(data)
        names = feature_table_names(path, choice, healthy) if data.missing else ()
        batches = (usable[i : i + _BATCH] for i in range(0, usable.size, _BATCH))
        rows: list[NDArray[np.float64]] = []
        for part, found in in_order(
            partial(_batch_features, data, choice, healthy, names), batches, jobs=jobs
        ):
            rows += part
            names = names or found
            _same_names(path, names, found)
            if progress is not None:
                progress(len(rows), usable.size)
        manifest = data.data.manifest.iloc[usable].reset_index(drop=True)
        lacking = {name: data.lacks(name)[usable] for name in data.missing}
    return FeatureTable(names=names, values=np.array(rows), manifest=manifest, lacking=lacking)


def _usable(data: JoinedSet) -> NDArray[np.intp]:
    """Numbers of the records whose status is ok."""
    found = np.flatnonzero((data.data.manifest["status"] == "ok").to_numpy())
    if found.size == 0:
        raise DataError(f"{data.path}: 0 usable records, must be > 0; see its column 'status'")
    return found


def feature_table_names(
    path: str | Path, choice: FeatureSelection = USUAL, healthy: Healthy | None = None
) -> tuple[str, ...]:
    """Column names of a feature table, from the first usable record.

    Parameters
    ----------
    path : str or Path
        Data set file.
    choice, healthy
        As in :func:`feature_table`.

    Raises
    ------
    DataError
        There is no usable record, or a named feature cannot be computed.
    """
    _refuse_unjoined(choice, path)
    with JoinedSet(Path(path), choice.views) as data:
        usable = _usable(data)
        whole = usable[data.complete[usable]]
        if whole.size == 0:
            raise DataError(
                f"{path}: 0 of {usable.size} records have all views, {_listed(choice.views)}, must "
                "be > 0; join others"
            )
        first = data[int(whole[0])]
    choice = held_against(choice, None if healthy is None else healthy.of(first.machine))
    names: tuple[str, ...] = ()
    for view, each in {"": first, **first.joined}.items():
        part = choice.part(view)
        if part is not None:
            names += _of_view(view, _names(recording_layout(each, part.settings), part, path))
    return names


def _refuse_unjoined(choice: FeatureSelection, path: str | Path) -> None:
    """Reject features of a view that is not joined."""
    known = {"", *(view.name for view in choice.views)}
    unknown = [name for name in choice.only or () if name.rpartition(MARK)[0] not in known]
    if unknown:
        raise DataError(
            f"{path}: feature {unknown[0]} is of a view that is not joined, must be one of "
            f"{_listed(choice.views)}; give --join"
        )


def _listed(views: Sequence[CompletingView]) -> str:
    return ", ".join(view.name for view in views) or "(none)"


def _names(layout: Layout, choice: FeatureSelection, path: str | Path) -> tuple[str, ...]:
    try:
        return layout_names(layout, choice.feature_set, choice.only)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error


def _batch_features(
    data: JoinedSet,
    choice: FeatureSelection,
    healthy: Healthy | None,
    planned: tuple[str, ...],
    indices: NDArray[np.intp],
) -> tuple[list[NDArray[np.float64]], tuple[str, ...]]:
    rows: list[NDArray[np.float64]] = []
    names: tuple[str, ...] = ()
    for index in indices:
        recording = data[int(index)]
        known = None if healthy is None else healthy.of(recording.machine)
        found, values = recording_features(recording, held_against(choice, known))
        if planned and not data.complete[index]:
            found, values = planned, _placed(found, values, planned)
        names = names or found
        _same_names(f"{data.path}[{index}]", names, found)
        rows.append(values)
    data.close()
    return rows, names


def _placed(
    names: tuple[str, ...], values: NDArray[np.float64], planned: tuple[str, ...]
) -> NDArray[np.float64]:
    """Row of the planned features, with NaN for missing ones."""
    found = dict(zip(names, values, strict=True))
    return np.array([found.get(name, np.nan) for name in planned])


def recording_transfer(recording: Recording, settings: Settings = STANDARD) -> Transfer | None:
    """Transfer functions of a test, as used for its features.

    Parameters
    ----------
    recording : Recording
    settings : Settings

    Returns
    -------
    Transfer or None
        None without a force or a response, or if the record is too short.

    Raises
    ------
    DataError
        Several forces are copies of one another.
    """
    analysis = recording_analysis(recording, settings)
    if analysis is None:
        return None
    try:
        return analysis.transfer_functions
    except ValueError as error:
        raise DataError(f"{recording.source or 'recording'}: {error}") from error


def recording_analysis(recording: Recording, settings: Settings = STANDARD) -> Analysis | None:
    """Analysis of a test; None if a recording has no transfer function.

    Parameters
    ----------
    recording : Recording
    settings : Settings
    """
    layout = recording_layout(recording, settings)
    if shortcomings(("force",), layout):
        return None
    rate, kinds = recording.sample_rate, layout.kinds
    return Analysis(_vibration(recording, layout), rate, quantities=kinds, settings=settings)


def excitation_notes(path: str | Path, settings: Settings = STANDARD) -> dict[str, int]:
    """Notes on the averaging of a data set's impact tests, and on lines lost in noise.

    Parameters
    ----------
    path : str or Path
        Data set file.
    settings : Settings

    Returns
    -------
    dict
        Text -> number of records; empty without hammer tests, if every line of every transfer
        function is usable.
    """
    notes: Counter[str] = Counter()
    lost: list[float] = []
    with DataSet(path) as data:
        for index in np.flatnonzero((data.manifest["status"] == "ok").to_numpy()):
            found = recording_transfer(data[int(index)], settings)
            if found is None:
                continue
            if found.struck:
                notes[f"impact test, {found.words}"] += 1
            if found.masked.max() >= _LEAST_LOSS:
                lost.append(float(found.masked.max()))
    if lost:
        notes[
            f"up to {100 * max(lost):.0f} % of the lines of a transfer function are lost in noise "
            "and left out; push harder, or record longer"
        ] = len(lost)
    return dict(notes)


_LEAST_LOSS = 0.1  # of the lines, to be reported: chance alone loses hardly any


def _same_names(where: str | Path, names: tuple[str, ...], found: tuple[str, ...]) -> None:
    """Reject records with different features, e.g. if one lacks the speed."""
    odd = sorted(set(names) ^ set(found))
    if odd:
        struck_only = any("frf." in name for name in odd)
        raise DataError(
            f"{where}: {len(odd)} features are not in every record, must be 0, as {odd[0]}; "
            + (
                "so short a record needs a single blow in its force: leave the others out"
                if struck_only
                else "store the speed of every record, or give speed_hz for all"
            )
        )


def save_table(table: FeatureTable, path: str | Path, *, force: bool = True) -> None:
    """Write a feature table as Parquet, CSV or HDF5, depending on the suffix.

    Parameters
    ----------
    table : FeatureTable
    path : str or Path
        ``.parquet``, ``.csv`` or ``.h5``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The suffix is none of these, the folder does not exist, or Parquet is not installed.
    """
    target = Path(path)
    if target.suffix not in _WRITERS:
        raise DataError(f"{target}: suffix must be one of {', '.join(_WRITERS)}; rename it")
    if not target.parent.is_dir():
        raise DataError(f"{target.parent} is no folder; create it")
    with replacing(target, force=force) as fresh:
        _WRITERS[target.suffix](table.frame(), fresh)


def _write_parquet(frame: pd.DataFrame, path: Path) -> None:
    try:
        frame.to_parquet(path, index=False)
    except ImportError:
        raise DataError(
            "Parquet needs pyarrow, which is not installed; pip install wearstate[parquet], "
            "or write .csv or .h5"
        ) from None


def _write_csv(frame: pd.DataFrame, path: Path) -> None:
    safe_frame(frame).to_csv(path, index=False)


def _write_hdf5(frame: pd.DataFrame, path: Path) -> None:
    """One dataset per column, the record as its only dimension."""
    import h5py

    with h5py.File(path, "w") as file:
        for name in frame.columns:
            column: Any = frame[name].to_numpy()
            text = column.dtype.kind in "OUT"
            file[str(name)] = np.char.encode(column.astype(str), "utf-8") if text else column


_WRITERS: dict[str, Callable[[pd.DataFrame, Path], None]] = {
    ".parquet": _write_parquet,
    ".csv": _write_csv,
    ".h5": _write_hdf5,
}
