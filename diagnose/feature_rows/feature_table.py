"""A data set's signals turned into its feature table."""

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

_BATCH = 16  # records a worker reads at a time: 20 MB, and few enough to keep both cores busy

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
        Name of a view -> records that lack it [shape=(n_records,)]: its values are NaN there.
        Views that no record lacks are left out.
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
        """Views that records lack, as sentences."""
        return [
            f"{int(flags.sum())} of {len(flags)} records have no view {name}"
            for name, flags in self.lacking.items()
        ]

    def named(self, names: Sequence[str]) -> "FeatureTable":
        """The table with some of its features."""
        place = {name: i for i, name in enumerate(self.names)}
        columns = [place[name] for name in names]
        return replace(self, names=tuple(names), values=self.values[:, columns])

    def frame(self) -> pd.DataFrame:
        """Manifest and features side by side."""
        features = pd.DataFrame(self.values, columns=list(self.names), index=self.manifest.index)
        return pd.concat([self.manifest, features], axis=1)


def confounders_in(manifest: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """Faults beside the wear that a manifest labels.

    Parameters
    ----------
    manifest : pandas.DataFrame
        Of a data set; its columns ``confounder_<name>`` are read.

    Returns
    -------
    dict
        Name -> whether it is present [shape=(n_records,)]; empty where nothing is labelled.

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
"""Choices of a recipe that change what wear sounds like, and what they are of: a model tells which
one it hears."""


def regimes_in(manifest: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """Regimes that a manifest labels, by choice and option.

    Parameters
    ----------
    manifest : pandas.DataFrame
        Of a data set; its columns ``choice_<regime>`` are read.

    Returns
    -------
    dict
        ``<regime>_<option>`` -> whether a record has it [shape=(n_records,)].

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
    """Whether a finding is of a regime, and not of a fault.

    Examples
    --------
    >>> is_regime("lubrication_flooded"), is_regime("stuck_valve")
    (True, False)
    """
    return name.startswith(tuple(f"{regime}_" for regime in REGIMES))


def regime_words(name: str) -> str:
    """A regime with what it is of.

    Examples
    --------
    >>> regime_words("lubrication_flooded")
    'flooded pin'
    """
    choice = next(regime for regime in REGIMES if name.startswith(f"{regime}_"))
    return f"{name.removeprefix(f'{choice}_')} {REGIMES[choice]}"


def kind_words(name: str) -> str:
    """A kind of recordings that a model refuses.

    Examples
    --------
    >>> kind_words("lubrication_starved"), kind_words("leaking-pumps")
    ('a starved pin', 'the recordings of leaking-pumps')
    """
    return f"a {regime_words(name)}" if is_regime(name) else f"the recordings of {name}"


def knows_no_oil(severity: str, findings: Sequence[str]) -> bool:
    """Whether a model of the clearance of a pin was trained without regimes of lubrication.

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
    """Which features of a recording are wanted; by default those that models are trained on.

    Attributes
    ----------
    feature_set, only, settings
        As of :func:`wearstate.features.catalogue.row.feature_row`; a name in `only` with a view
        before it, as ``running:rms``, is of that view alone.
    views : tuple of CompletingView
        Data sets whose records complete each row.
    """

    feature_set: SetName = "standard"
    only: tuple[str, ...] | None = None
    settings: Settings = STANDARD
    views: tuple[CompletingView, ...] = ()

    def part(self, view: str = "") -> "FeatureSelection | None":
        """The choice among the features of one view, or of the record itself; None: none.

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
    """The same features, told against a healthy reference."""
    if reference is None:
        return choice
    return replace(choice, settings=replace(choice.settings, reference=reference))


class Healthy(Protocol):
    """Transfer functions of machines when they were healthy."""

    def of(self, machine: str) -> FrfReference | None:
        """Those of a machine; None where there are none."""


USUAL = FeatureSelection()
"""What models are trained on."""


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
    """FeatureSelection of features from plain numbers and words, as a command line has them.

    Parameters
    ----------
    feature_set : {"standard", "core", "complete"}
        Which rows.
    only : sequence of str
        Names of features or values; all of the set if empty.
    machine : str, optional
        Kind of machine, a key of :data:`wearstate.features.signal.iso.KINDS`.
    speed_hz : float, optional
        Nominal shaft speed [Hz]; the one stored with each record by default.
    speed_band_hz : sequence of float, optional
        Where the speed is looked for without a tacho, low and high [Hz].
    bearing : sequence of float, optional
        Rollers, their diameter, pitch diameter (one unit for both) and, if it is not 0, contact
        angle [deg].
    bands : sequence of sequence of float
        Bands of your own, low and high [Hz].
    envelope_band : sequence of float, optional
        Low and high [Hz].
    exponential : float
        What the exponential window of an impact test has sunk to at the end of a block, 0 to 1 [-].

    Returns
    -------
    FeatureSelection
        For :func:`feature_table`.

    Raises
    ------
    DataError
        A number of values is wrong, or the geometry is none; all faults at once.

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
    """Features of a choice that a data set cannot have, told by its first record.

    Parameters
    ----------
    path : str or Path
        Data set file.
    choice : FeatureSelection
        Which features.

    Returns
    -------
    dict
        Name -> why, with what helps; empty where single features were asked for.

    Raises
    ------
    DataError
        The file cannot be read; or a feature that was asked for by name does not exist, or is not
        to be had of it.
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
        Which features.

    Returns
    -------
    names : tuple of str
        As :func:`wearstate.features.catalogue.row.feature_names`; those of a view have its name in
        front: ``running:acc_aft.rms``.
    values : numpy.ndarray [shape=(n_features,)]
        Finite.

    Raises
    ------
    DataError
        The signal cannot be turned into features; the text says why and what helps.
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
    """Settings with the speed that is stored with a record, where none is given and one is used."""
    used = settings.machine is not None or (settings.bearing and recording.tacho is None)
    if settings.speed_hz is not None or not used:
        return settings  # one and the same for all records: their plan of names is made once
    return replace(settings, speed_hz=recording.declared_speed_hz)


def recording_layout(recording: Recording, settings: Settings = STANDARD) -> Layout:
    """What a recording offers the catalogue.

    Parameters
    ----------
    recording : Recording
        With or without tacho.
    settings : Settings
        Kind of machine, geometry of a bearing.

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
    """All channels but tacho and cylinder pressures [shape=(n_vibrations, n_samples)]."""
    aside = layout.cylinders
    return recording.vibration[~aside] if aside.any() else recording.vibration


def feature_table(
    path: str | Path,
    *,
    choice: FeatureSelection = USUAL,
    healthy: Healthy | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> FeatureTable:
    """Features of every record of a data set that was simulated without failure.

    Parameters
    ----------
    path : str or Path
        Data set file.
    choice : FeatureSelection
        Which features.
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
        The file cannot be read, or holds no usable record; its records and those of a view do not
        tell which belong together, or none do.
    """
    _refuse_strange(choice, path)
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
    """Names of the columns of a feature table, told by the first usable record.

    Parameters
    ----------
    path : str or Path
        Data set file.
    choice, healthy
        As of :func:`feature_table`.

    Raises
    ------
    DataError
        There is no usable record, or a feature that is named is not to be had.
    """
    _refuse_strange(choice, path)
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


def _refuse_strange(choice: FeatureSelection, path: str | Path) -> None:
    """Features of a view that nobody joined."""
    known = {"", *(view.name for view in choice.views)}
    strange = [name for name in choice.only or () if name.rpartition(MARK)[0] not in known]
    if strange:
        raise DataError(
            f"{path}: feature {strange[0]} is of a view that is not joined, must be one of "
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
    """A row with NaN for what it lacks."""
    found = dict(zip(names, values, strict=True))
    return np.array([found.get(name, np.nan) for name in planned])


def recording_transfer(recording: Recording, settings: Settings = STANDARD) -> Transfer | None:
    """Transfer functions of a test, as its features are told from them.

    Parameters
    ----------
    recording : Recording
    settings : Settings

    Returns
    -------
    Transfer or None
        None where there is no force, no response, or too short a record.

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
    """Transforms of a test; None where a recording has no transfer function to tell.

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
    """How the blows of a data set's impact tests were averaged, and what is lost in noise.

    Parameters
    ----------
    path : str or Path
        Data set file.
    settings : Settings

    Returns
    -------
    dict
        Text -> records it holds for; empty where no force is that of a hammer, and every line of
        every transfer function is heard.
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
            if found.masked.max() >= _TOLD_LOSS:
                lost.append(float(found.masked.max()))
    if lost:
        notes[
            f"up to {100 * max(lost):.0f} % of the lines of a transfer function are lost in noise "
            "and left out; push harder, or record longer"
        ] = len(lost)
    return dict(notes)


_TOLD_LOSS = 0.1  # of the lines: chance alone leaves out hardly any


def _same_names(where: str | Path, names: tuple[str, ...], found: tuple[str, ...]) -> None:
    """Refuse records whose rows differ: one lacks the speed that the others have."""
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
    """Write a feature table as Parquet, CSV or HDF5, by the suffix.

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
        The suffix is none of them, the folder does not exist, or Parquet is not installed.
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
