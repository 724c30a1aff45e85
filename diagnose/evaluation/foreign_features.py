"""Features computed by third-party packages, for the baselines of a model."""

import hashlib
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.record import DataSet
from ...sim.output.recording import Recording
from ..feature_rows.feature_table import FeatureTable, Progress

Float = NDArray[np.float64]
Index = NDArray[np.intp]

PACKAGES = {"tsfel": "tsfel", "minirocket": "aeon"}
"""Source of features -> package that computes them."""

LEFT_OUT = "left out: requested without third-party packages"

_KERNEL_EXAMPLES = 200  # recordings from which MiniRocket draws its thresholds
_BATCH = 8  # recordings whose samples are in memory at once


def absence(source: str) -> str:
    """Why the features of a source cannot be computed, with the cure; empty if they can."""
    package = PACKAGES[source]
    if find_spec(package) is not None:
        return ""
    return f"{package} is not installed: pip install wearstate[baselines]"


Transform = Callable[[Sequence[Recording]], Float]
"""Recordings of equal rate and channels -> feature rows."""


def foreign_transform(source: str, examples: Iterable[Recording], *, seed: int = 0) -> Transform:
    """Features of the unprocessed vibration channels, computed by a third-party package.

    Parameters
    ----------
    source : {"tsfel", "minirocket"}
    examples : iterable of Recording
        Training recordings. MiniRocket takes its thresholds from the first 200 of them, and cuts
        every recording to the length of the shortest of these; TSFEL needs no training.
    seed : int
        Seed of MiniRocket.

    Returns
    -------
    callable
        Recordings -> features [shape=(n_recordings, n_features)], finite.

    Raises
    ------
    ModuleNotFoundError
        The package is not installed.
    """
    return _tsfel() if source == "tsfel" else _minirocket(examples, seed)


def _tsfel() -> Transform:
    import tsfel

    settings = tsfel.get_features_by_domain()

    def row(recording: Recording) -> Float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # from pandas and numpy inside TSFEL
            table = tsfel.time_series_features_extractor(
                settings, recording.vibration.T.astype(float), fs=recording.sample_rate, verbose=0
            )
        return np.asarray(np.nan_to_num(table.to_numpy(dtype=float)[0]))

    return lambda recordings: np.array([row(recording) for recording in recordings])


def _minirocket(examples: Iterable[Recording], seed: int) -> Transform:
    from aeon.transformations.collection.convolution_based import MiniRocket

    known = [recording.vibration for recording in islice(examples, _KERNEL_EXAMPLES)]
    length = min(signal.shape[-1] for signal in known)
    kernels = MiniRocket(random_state=seed).fit(_stack(known, length))

    def rows(recordings: Sequence[Recording]) -> Float:
        signals = [recording.vibration for recording in recordings]
        return np.asarray(kernels.transform(_stack(signals, length)), dtype=float)

    return rows


def _stack(signals: Sequence[NDArray[Any]], length: int) -> NDArray[np.float32]:
    return np.stack([signal[:, :length] for signal in signals]).astype(np.float32)


def foreign_rows(
    transform: Transform, recordings: Iterable[Recording], count: int, progress: Progress | None
) -> Float:
    """Feature rows of many recordings, with a few in memory at a time.

    Parameters
    ----------
    transform : callable
        From :func:`foreign_transform`.
    recordings : iterable of Recording
    count : int
        Number of recordings, for `progress`.
    progress : callable, optional
        Called with (recordings done, recordings).

    Returns
    -------
    numpy.ndarray [shape=(n_recordings, n_features)]
    """
    rows: list[Float] = []
    left = iter(recordings)
    while batch := list(islice(left, _BATCH)):
        rows += list(transform(batch))
        if progress is not None:
            progress(len(rows), count)
    return np.array(rows)


@dataclass(frozen=True, kw_only=True)
class TransformedRows:
    """Features by third-party packages, computed once and kept.

    Attributes
    ----------
    examples : numpy.ndarray
        Rows of the training data set from which MiniRocket takes its thresholds.
    transforms : mapping
        Source -> transform of recordings into features, for the installed packages.
    seed : int
        Seed of the choice of examples, and of MiniRocket.
    cache : Path or None
        Folder in which features are kept: these packages take up to seconds per recording.
    progress : callable or None
        Called with (recordings done, recordings).
    """

    examples: Index
    transforms: Mapping[str, Transform]
    seed: int
    cache: Path | None
    progress: Progress | None

    def rows(self, path: Path, table: FeatureTable) -> dict[str, Float | str]:
        """Source -> features of all rows of a table, or the reason for their absence."""
        return {source: absence(source) or self._kept(source, path, table) for source in PACKAGES}

    def _kept(self, source: str, path: Path, table: FeatureTable) -> Float | str:
        if source not in self.transforms:
            return LEFT_OUT
        place = self.cache and self.cache / self._name(source, table)
        if place is not None and place.is_file():
            return np.asarray(np.load(place, allow_pickle=False), dtype=float)
        count = len(table.values)
        recordings = recordings_of(path, np.arange(count))
        rows = foreign_rows(self.transforms[source], recordings, count, self.progress)
        if place is not None:
            place.parent.mkdir(parents=True, exist_ok=True)
            np.save(place, rows.astype(np.float32))
        return rows

    def _name(self, source: str, table: FeatureTable) -> str:
        """File name that depends on the package, the signals and the trained transform."""
        signals = table.manifest["signal_crc32"].to_numpy(dtype=np.int64)
        parts = [version(PACKAGES[source]).encode(), signals.tobytes()]
        if source == "minirocket":
            parts += [str(self.seed).encode(), self.examples.astype(np.int64).tobytes()]
        return f"{source}-{hashlib.sha256(b'|'.join(parts)).hexdigest()[:16]}.npy"


def transformed_rows(
    path: Path,
    train: Index,
    *,
    seed: int = 0,
    quick: bool = False,
    cache: Path | None = None,
    progress: Progress | None = None,
) -> TransformedRows:
    """Fit the transforms of the installed packages to a training data set.

    Parameters
    ----------
    path : Path
        Training data set.
    train : numpy.ndarray
        Rows of its feature table that may be used for training.
    seed, cache, progress
        As in :class:`TransformedRows`.
    quick : bool
        Leave out third-party packages.
    """
    examples = np.random.default_rng(seed).permutation(train)[:_KERNEL_EXAMPLES]
    return TransformedRows(
        examples=examples,
        transforms={
            source: foreign_transform(source, recordings_of(path, examples), seed=seed)
            for source in PACKAGES
            if not absence(source) and not quick
        },
        seed=seed,
        cache=cache,
        progress=progress,
    )


def recordings_of(path: Path, rows: Index) -> Iterator[Recording]:
    """Recordings of rows of a data set's feature table, with one in memory at a time."""
    with DataSet(path) as data:
        usable = np.flatnonzero((data.manifest["status"] == "ok").to_numpy())
        for row in rows:
            yield data[int(usable[row])]
