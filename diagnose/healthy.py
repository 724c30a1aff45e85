"""Healthy recordings of the machine in question: the reference that the trade works with."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..datasets.import_rows import GROUP_NAME
from ..datasets.record import DataError, DataSet, Recording
from .quality import layout_faults, sample_faults
from .tabulate import FeatureTable, recording_features

Float = NDArray[np.float64]

_ENOUGH_FAULTS = 5  # recordings with the same fault that need not be looked beyond


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Healthy recordings of the machine in question.

    Attributes
    ----------
    features : numpy.ndarray [shape=(n_features,)]
        Mean of their feature rows.
    recordings : int
    source : str
        File or files, for messages.
    """

    features: Float
    recordings: int
    source: str


def referenced_rows(rows: Float, baseline: Float) -> Float:
    """Feature rows as a referenced model takes them.

    Parameters
    ----------
    rows : numpy.ndarray [shape=(n, n_features)]
    baseline : numpy.ndarray [shape=(n, n_features)] or [shape=(n_features,)]
        Healthy rows of the same machines.

    Returns
    -------
    numpy.ndarray [shape=(n, 2 n_features)]
        What changed since the machine was healthy (levels are logarithms: their ratio), and the
        rows as they are.

    Examples
    --------
    >>> referenced_rows(np.array([[3.0, 5.0]]), np.array([1.0, 5.0]))
    array([[2., 0., 3., 5.]])
    """
    return np.hstack([rows - baseline, rows])


def references(
    table: FeatureTable, healthy: FeatureTable, path: str | Path = "the healthy set"
) -> Float:
    """Mean healthy row of the machine of each record.

    Parameters
    ----------
    table : FeatureTable
        Records in question.
    healthy : FeatureTable
        Healthy records of the same machines: the same numbers in the column ``group``.
    path : str or Path
        Of the healthy set, for messages.

    Returns
    -------
    numpy.ndarray [shape=(n_records, n_features)]

    Raises
    ------
    DataError
        The features are others, or machines have no healthy record.
    """
    if healthy.names != table.names:
        raise DataError(
            f"{path}: its {len(healthy.names)} features are not the {len(table.names)} of the data "
            "set; use the same channels and rate"
        )
    groups = healthy.manifest["group"].to_numpy()
    wanted = table.manifest["group"].to_numpy()
    missing = np.setdiff1d(wanted, groups)
    if missing.size:
        raise DataError(
            f"{path}: {missing.size} machine draws have no healthy record, must be 0: "
            f"{_few(missing.tolist())}; generate them with the same seed and as many machines"
        )
    machines, place = np.unique(groups, return_inverse=True)
    means = np.zeros((len(machines), len(table.names)))
    np.add.at(means, place, healthy.values)
    means /= np.bincount(place)[:, None]
    return np.asarray(means[np.searchsorted(machines, wanted)])


def _few(numbers: Sequence[object]) -> str:
    return ", ".join(str(n) for n in numbers[:5]) + (", …" if len(numbers) > 5 else "")


def baseline_of(
    recordings: Iterable[Recording], card: Mapping[str, Any], source: str = "baseline"
) -> Baseline:
    """Healthy recordings of one machine, as a model takes them.

    Parameters
    ----------
    recordings : iterable of Recording
        One at a time is held.
    card : mapping
        Of the model.
    source : str
        Where they are from, for messages.

    Returns
    -------
    Baseline

    Raises
    ------
    DataError
        There is no recording, or some lack the model's inputs or are at fault; each fault once.
    """
    rows: list[Float] = []
    faults: dict[str, list[str]] = {}
    for i, recording in enumerate(recordings):
        found = [
            fault.text
            for fault in (layout_faults(recording, card) or sample_faults(recording))
            if fault.bars
        ]
        for text in found:
            faults.setdefault(text, []).append(recording.source or str(i))
        if len(next(iter(faults.values()), ())) > _ENOUGH_FAULTS:
            break  # of a thousand recordings of another layout
        if not found:
            rows.append(recording_features(recording)[1])
    if faults:
        told = [f"{source}: {text} ({_few(names)})" for text, names in faults.items()]
        raise DataError("\n".join(told))
    if not rows:
        raise DataError(f"{source}: 0 healthy recordings, must be >= 1; record some")
    if {len(row) for row in rows} != {len(card["features"])}:
        raise DataError(
            f"{source}: its {len(rows[0])} features are not the model's {len(card['features'])}; "
            "use recordings with the model's channels and rate"
        )
    return Baseline(features=np.mean(rows, axis=0), recordings=len(rows), source=source)


class Baselines:
    """Healthy recordings in a data set: of the machine in question, or of several by their names.

    Parameters
    ----------
    path : str or Path
        Data set. Simulated machines go by the column ``group``, measured ones by ``group_name``;
        measured recordings of none of its names are taken to be of the same machine as all of it.
    card : mapping
        Of the model.

    Raises
    ------
    DataError
        It is no data set, cannot be read, or a recording in it is not healthy.
    """

    def __init__(self, path: str | Path, card: Mapping[str, Any]) -> None:
        if Path(path).suffix.lower() not in (".h5", ".hdf5"):
            raise DataError(
                f"baseline = {path} must be a data set (.h5); make one of the healthy recordings: "
                "wearstate import FILES -o healthy.h5"
            )
        self.source = str(path)
        self._path, self._card = Path(path), card
        with DataSet(path) as data:
            self._rows = data.manifest[data.manifest["status"] == "ok"]
            self._simulated = data.attributes.origin == "simulated"
        worn = self._rows["grade"] > 0
        if worn.any():
            raise DataError(
                f"{path}: {int(worn.sum())} of {len(worn)} recordings have a grade above 0, must "
                "be of a healthy machine; leave them out"
            )
        self._found: dict[Any, Baseline] = {}

    def of(self, row: Mapping[str, Any]) -> Baseline:
        """That of one machine; read when it is first asked for.

        Parameters
        ----------
        row : mapping
            What its data set knows of the recording in question.

        Returns
        -------
        Baseline

        Raises
        ------
        DataError
            None of several machines is this one; as of :func:`baseline_of`.
        """
        key, records = self._machine(row)
        if key not in self._found:
            with DataSet(self._path) as data:
                healthy = (data[int(i)] for i in records)
                self._found[key] = baseline_of(healthy, self._card, self.source)
        return self._found[key]

    def _machine(self, row: Mapping[str, Any]) -> tuple[Any, NDArray[np.intp]]:
        """Name of the machine and the healthy records of it; None and all where all are of it."""
        column = "group" if self._simulated else GROUP_NAME
        names = self._rows.get(column)
        records = self._rows.index.to_numpy()
        if names is None or names.nunique() <= 1:
            return None, records
        name = row.get(column)
        mine = (names == name).to_numpy()
        if mine.any():
            return name, records[mine]
        if not self._simulated:
            return None, records
        raise DataError(
            f"{self.source} has healthy recordings of {names.nunique()} machines, must have some "
            f"of this one ({'not named' if name is None else f'{column} {name}'}); give a data set "
            "of its recordings only"
        )
