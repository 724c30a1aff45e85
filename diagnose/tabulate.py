"""A data set's signals turned into its feature table."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..datasets.record import DataError, DataSet, Recording
from ..datasets.workers import in_order
from ..features.table import feature_row

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
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    manifest: pd.DataFrame

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


def recording_features(recording: Recording) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Feature row of one recording.

    Parameters
    ----------
    recording : Recording
        With or without tacho.

    Returns
    -------
    names : tuple of str
        As :func:`wearstate.features.table.feature_names`.
    values : numpy.ndarray [shape=(n_features,)]
        Finite.

    Raises
    ------
    DataError
        The signal cannot be turned into features; the text says why and what helps.
    """
    try:
        return feature_row(
            recording.vibration,
            recording.sample_rate,
            tacho=recording.tacho_signal,
            pulses_per_revolution=recording.pulses_per_revolution,
            channel_names=recording.vibration_names,
            quantities=[channel.quantity for channel in recording.vibration_channels],
        )
    except ValueError as error:
        raise DataError(f"{recording.source or 'recording'}: {error}") from error


def feature_table(
    path: str | Path, *, jobs: int = 1, progress: Progress | None = None
) -> FeatureTable:
    """Features of every record of a data set that was simulated without failure.

    Parameters
    ----------
    path : str or Path
        Data set file.
    jobs : int
        Worker processes; the table does not depend on it.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    FeatureTable
        Records in the order of the file; failed ones are left out.

    Raises
    ------
    DataError
        The file cannot be read, or holds no usable record.
    """
    with DataSet(path) as data:
        usable = np.flatnonzero((data.manifest["status"] == "ok").to_numpy())
        if usable.size == 0:
            raise DataError(f"{path}: 0 usable records, must be > 0; see its column 'status'")
        batches = (usable[i : i + _BATCH] for i in range(0, usable.size, _BATCH))
        rows: list[NDArray[np.float64]] = []
        names: tuple[str, ...] = ()
        for part, found in in_order(partial(_batch_features, data), batches, jobs=jobs):
            rows += part
            names = names or found
            if progress is not None:
                progress(len(rows), usable.size)
        manifest = data.manifest.iloc[usable].reset_index(drop=True)
    return FeatureTable(names=names, values=np.array(rows), manifest=manifest)


def _batch_features(
    data: DataSet, indices: NDArray[np.intp]
) -> tuple[list[NDArray[np.float64]], tuple[str, ...]]:
    rows: list[NDArray[np.float64]] = []
    names: tuple[str, ...] = ()
    for index in indices:
        names, values = recording_features(data[int(index)])
        rows.append(values)
    data.close()
    return rows, names


def save_table(table: FeatureTable, path: str | Path) -> None:
    """Write a feature table as Parquet, CSV or HDF5, by the suffix.

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
    part = target.with_name(target.name + ".part")
    try:
        _WRITERS[target.suffix](table.frame(), part)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)


def _write_parquet(frame: pd.DataFrame, path: Path) -> None:
    try:
        frame.to_parquet(path, index=False)
    except ImportError:
        raise DataError(
            "Parquet needs pyarrow, which is not installed; pip install wearstate[parquet], "
            "or write .csv or .h5"
        ) from None


def _write_csv(frame: pd.DataFrame, path: Path) -> None:
    frame.to_csv(path, index=False)


def _write_hdf5(frame: pd.DataFrame, path: Path) -> None:
    """One dataset per column, the record as its only dimension."""
    import h5py

    with h5py.File(path, "w") as file:
        for name in frame.columns:
            column: Any = frame[name].to_numpy()
            text = column.dtype.kind in "OUT"
            file[str(name)] = np.array(column.astype(str), dtype="S") if text else column


_WRITERS: dict[str, Callable[[pd.DataFrame, Path], None]] = {
    ".parquet": _write_parquet,
    ".csv": _write_csv,
    ".h5": _write_hdf5,
}
