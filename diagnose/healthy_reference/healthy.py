"""Healthy recordings of a machine, the usual reference in condition monitoring."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...datasets.file.record import DataSet
from ...features.response.transfer import FrfReference
from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_choice import choice_in
from ..feature_rows.feature_table import (
    USUAL,
    FeatureSelection,
    FeatureTable,
    Progress,
    feature_table,
    held_against,
    recording_features,
)
from ..feature_rows.model_card import ModelCard
from ..feature_rows.resampling import at_rate
from ..recording_faults.layout import layout_faults
from ..recording_faults.samples import sample_faults
from .probe_means import ProbeMeans, probe_means
from .transfer_reference import (
    healthy_transfer,
    told_against,
    told_against_modes,
    transfer_reference,
)

Float = NDArray[np.float64]

_ENOUGH_FAULTS = 5  # recordings with the same fault after which reading stops


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Healthy recordings of a machine, as reference of its other recordings.

    Attributes
    ----------
    features : numpy.ndarray [shape=(n_features,)]
        Mean of their feature rows.
    recordings : int
    source : str
        File or files, for messages.
    transfer : FrfReference or None
        Mean of their transfer functions, if the model compares with them.
    positions : tuple of ProbeMeans
        Shaft position in each; empty without proximity probes.
    """

    features: Float
    recordings: int
    source: str
    transfer: FrfReference | None = None
    positions: tuple[ProbeMeans, ...] = ()


def referenced_rows(rows: Float, baseline: Float) -> Float:
    """Input rows of a referenced model.

    Parameters
    ----------
    rows : numpy.ndarray [shape=(n, n_features)]
    baseline : numpy.ndarray [shape=(n, n_features)] or [shape=(n_features,)]
        Healthy rows of the same machines.

    Returns
    -------
    numpy.ndarray [shape=(n, 2 n_features)]
        Change from the healthy state (for logarithmic levels a ratio), and the unchanged rows.

    Examples
    --------
    >>> referenced_rows(np.array([[3.0, 5.0]]), np.array([1.0, 5.0]))
    array([[2., 0., 3., 5.]])
    """
    return np.hstack([rows - baseline, rows])


def references(
    table: FeatureTable,
    path: str | Path,
    healthy: str | Path,
    *,
    choice: FeatureSelection = USUAL,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[Float, int]:
    """Mean healthy row of the machine of each record, matched by machine identity.

    Parameters
    ----------
    table : FeatureTable
        Records to be referenced.
    path : str or Path
        Their data set.
    healthy : str or Path
        Data set of healthy records of the same machines: drawn by the same recipe with the same
        seed, or measured with the same names. Equal numbers alone do not identify a machine.
    choice : FeatureSelection
        Features of the table, or a superset.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    rows : numpy.ndarray [shape=(n_records, n_features)]
    records : int
        Total number of healthy records.

    Raises
    ------
    DataError
        As in :func:`refuse_strangers`, or the features differ.
    """
    refuse_strangers(path, healthy)
    against = healthy_transfer(healthy, [FeatureSelection(only=table.names)])
    known = feature_table(healthy, choice=choice, healthy=against, jobs=jobs, progress=progress)
    if not set(table.names) <= set(known.names):
        raise DataError(
            f"{healthy}: its {len(known.names)} features are not the {len(table.names)} of the "
            "data set; use the same channels and rate"
        )
    known = known.named(table.names)
    return _means(known.values, _machines_in(healthy), _machines_in(path)), len(known.values)


def refuse_strangers(path: str | Path, healthy: str | Path) -> None:
    """Reject a healthy set that is not known to be of the machines of another set.

    Parameters
    ----------
    path, healthy : str or Path
        As in :func:`references`.

    Raises
    ------
    DataError
        A set does not name its machines, machines have no healthy record, or records of the
        healthy set are of worn machines; all at once.
    """
    wanted, machines = _machines_in(path), _machines_in(healthy)
    sets = ((path, wanted, healthy), (healthy, machines, path))
    faults = [_unknown_words(own, names, other) for own, names, other in sets if "" in names]
    missing = [] if faults else sorted(set(wanted.tolist()) - set(machines.tolist()))
    if missing:
        faults.append(
            f"{healthy}: {len(missing)} machines of {path} have no healthy record, must be 0: "
            f"{_few(missing)}; it has {_few(sorted(set(machines.tolist())))}; {_SAME_MACHINES}"
        )
    with DataSet(healthy) as data:
        faults += _worn_words(healthy, data.manifest[data.manifest["status"] == "ok"])
    if faults:
        raise DataError("\n".join(faults))


_SAME_MACHINES = (
    "generate it with the same seed from a recipe whose machines_of names the other's recipe, or "
    "import both with the same names of machines in the label group"
)


def _machines_in(path: str | Path) -> NDArray[np.str_]:
    """Machine of each usable record, in the order of the feature table."""
    with DataSet(path) as data:
        usable = (data.manifest["status"] == "ok").to_numpy()
        return np.array(data.machines, dtype=str)[usable]


def _unknown_words(path: str | Path, machines: NDArray[np.str_], other: str | Path) -> str:
    return (
        f"{path}: {int((machines == '').sum())} of {len(machines)} records do not name their "
        f"machine, must be 0 to pair them with those of {other} (numbers and file names are no "
        "machines); import with the label group, or --group-by folder"
    )


def _worn_words(path: str | Path, rows: pd.DataFrame) -> list[str]:
    worn = int((rows["grade"] > 0).sum())
    if not worn:
        return []
    return [
        f"{path}: {worn} of {len(rows)} recordings have a grade above 0, must be of a healthy "
        "machine; leave them out"
    ]


def _means(values: Float, machines: NDArray[np.str_], wanted: NDArray[np.str_]) -> Float:
    """Mean row of each wanted machine."""
    names, place = np.unique(machines, return_inverse=True)
    means = np.zeros((len(names), values.shape[1]))
    np.add.at(means, place, values)
    means /= np.bincount(place)[:, None]
    return np.asarray(means[np.searchsorted(names, wanted)])


def _few(numbers: Sequence[object]) -> str:
    return ", ".join(str(n) for n in numbers[:5]) + (", …" if len(numbers) > 5 else "")


def baseline_of(
    recordings: Iterable[Recording], card: ModelCard, source: str = "baseline"
) -> Baseline:
    """Baseline of a model from healthy recordings of one machine.

    Parameters
    ----------
    recordings : iterable of Recording
    card : ModelCard
        Card of the model.
    source : str
        Origin of the recordings, for messages.

    Returns
    -------
    Baseline

    Raises
    ------
    DataError
        There is no recording, or some lack the model's inputs or have faults; each fault once.
    """
    sound: list[Recording] = []
    faults: dict[str, list[str]] = {}
    for i, given in enumerate(recordings):
        recording = at_rate(given, card.sample_rate_hz)
        found = [
            fault.text
            for fault in (layout_faults(recording, card) or sample_faults(recording))
            if fault.bars
        ]
        for text in found:
            faults.setdefault(text, []).append(recording.source or str(i))
        if len(next(iter(faults.values()), ())) > _ENOUGH_FAULTS:
            break  # all others probably have the same layout
        if not found:
            sound.append(recording)
    if faults:
        lines = [f"{source}: {text} ({_few(names)})" for text, names in faults.items()]
        raise DataError("\n".join(lines))
    if not sound:
        raise DataError(f"{source}: 0 healthy recordings, must be >= 1; record some")
    named = FeatureSelection(only=tuple(card.features))
    reference = None
    if told_against(named):
        reference = transfer_reference(sound, modes=told_against_modes(named))
    choice = held_against(choice_in(card.feature_choice), reference)
    rows = [recording_features(recording, choice)[1] for recording in sound]
    if {len(row) for row in rows} != {len(card.features)}:
        raise DataError(
            f"{source}: its {len(rows[0])} features are not the model's {len(card.features)}; "
            "use recordings with the model's channels and rate"
        )
    mean = np.mean(rows, axis=0)
    positions = tuple(means for means in map(probe_means, sound) if means.names)
    return Baseline(
        features=mean,
        recordings=len(rows),
        source=source,
        transfer=reference,
        positions=positions,
    )


class Baselines:
    """Healthy recordings in a data set, of one machine or of several.

    Parameters
    ----------
    path : str or Path
        Data set. Machines are identified by
        :attr:`wearstate.datasets.file.record.DataSet.machines`, never by number. A recording
        without a machine name is matched with a set of one machine, or of files without names.
    card : ModelCard
        Card of the model.

    Raises
    ------
    DataError
        The file is not a data set, cannot be read, or contains a recording that is not healthy.
    """

    def __init__(self, path: str | Path, card: ModelCard) -> None:
        if Path(path).suffix.lower() not in (".h5", ".hdf5"):
            raise DataError(
                f"baseline = {path} must be a data set (.h5); make one of the healthy recordings: "
                "wearstate import FILES -o healthy.h5"
            )
        self.source = str(path)
        self._path, self._card = Path(path), card
        with DataSet(path) as data:
            usable = (data.manifest["status"] == "ok").to_numpy()
            self._records = np.flatnonzero(usable)
            self._machines = np.array(data.machines, dtype=str)[usable]
            worn = _worn_words(path, data.manifest[usable])
        if worn:
            raise DataError(worn[0])
        self._found: dict[str, Baseline] = {}

    def of(self, recording: Recording) -> Baseline:
        """Baseline of the machine of a recording, read on first use.

        Parameters
        ----------
        recording : Recording
            Recording to be compared.

        Returns
        -------
        Baseline

        Raises
        ------
        DataError
            Its machine is not known to be in the set; or as in :func:`baseline_of`.
        """
        machine = recording.machine
        self._refuse_unknown(machine, recording.source or "the recording")
        if machine not in self._found:
            records = self._records[self._machines == machine] if machine else self._records
            with DataSet(self._path) as data:
                healthy = (data[int(i)] for i in records)
                self._found[machine] = baseline_of(healthy, self._card, self.source)
        return self._found[machine]

    def _refuse_unknown(self, machine: str, name: str) -> None:
        known = sorted(set(self._machines.tolist()))
        if machine in known or len(known) == 0:
            return  # an empty set fails on reading
        machines = _few([one or "a machine without a name" for one in known])
        if machine:
            raise DataError(
                f"{self.source} has healthy recordings of {machines}, must have some of {machine}, "
                f"the machine of {name}; {_SAME_MACHINES}"
            )
        if len(known) > 1:
            raise DataError(
                f"{self.source} has healthy recordings of {len(known)} machines ({machines}), must "
                f"have those of one: {name} does not name its machine; give a data set of its "
                "recordings only"
            )
