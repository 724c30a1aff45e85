"""Impacts in a recording: one without impacts does not belong to a class that always has some.

A damaged bearing causes impacts, a sound one noise. The score of noise is known without training,
so that a few recordings suffice to detect missing impacts, whereas a distance in feature space
would need many.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...features.catalogue.row import absent_features
from ...sim.output.recording import Recording
from .feature_table import (
    FeatureSelection,
    absent_in,
    feature_table,
    recording_features,
    recording_layout,
)

Float = NDArray[np.float64]

NOISE_SCORE: Final = 7.0
"""Kurtogram score that noise reaches in one of a hundred records [-]."""

FEWEST_SHOWING: Final = 3
"""Fewest recordings of a class from which to conclude that it always has impacts."""

_FEATURE = "kurtogram"
_ROW = FeatureSelection(only=(_FEATURE,))
_WEAK_SHARE = 0.05  # of the windows may be weaker: a window can fall between impacts


def blow_scores(recording: Recording) -> Float:
    """Impact score of every channel of a recording.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    numpy.ndarray [shape=(n_channels,)]
        :attr:`wearstate.features.signal.kurtogram.Kurtogram.score` [-]; empty if the
        recording is too short for it.

    Raises
    ------
    DataError
        The signal cannot be turned into features.
    """
    if _FEATURE in absent_features(recording_layout(recording), "complete"):
        return np.empty(0)
    return _scores_in(*recording_features(recording, _ROW))


def blow_table(path: str | Path, n_records: int, *, jobs: int = 1) -> Float:
    """:func:`blow_scores` of every usable record of a data set.

    Parameters
    ----------
    path : str or Path
        Data set file.
    n_records : int
        Number of usable records.
    jobs : int
        Worker processes; the result does not depend on it.

    Returns
    -------
    numpy.ndarray [shape=(n_records, n_channels)]
        Without columns if the records are too short.

    Raises
    ------
    DataError
        As in :func:`wearstate.diagnose.feature_rows.feature_table.feature_table`.
    """
    if _FEATURE in absent_in(path, FeatureSelection(feature_set="complete")):
        return np.empty((n_records, 0))
    table = feature_table(path, choice=_ROW, jobs=jobs)
    return _scores_in(table.names, table.values)


def _scores_in(names: tuple[str, ...], values: Float) -> Float:
    return values[..., [name.endswith(".kurtogram.score") for name in names]]


def blow_floors(scores: Float, groups: NDArray[np.intp]) -> Float:
    """Smallest score of the recordings of one class.

    Parameters
    ----------
    scores : numpy.ndarray [shape=(n_records, n_channels)]
        Scores of the records of the class.
    groups : numpy.ndarray [shape=(n_records,)]
        Recording of each.

    Returns
    -------
    numpy.ndarray [shape=(n_channels,)]
        Score of the weakest recording, without a twentieth of its records; 0 for fewer than three
        recordings, which allow no conclusion.

    Examples
    --------
    >>> blow_floors(np.array([[30.0], [50.0], [40.0]]), np.arange(3)).tolist()
    [30.0]
    >>> blow_floors(np.array([[30.0], [50.0], [40.0]]), np.array([0, 1, 1])).tolist()
    [0.0]
    """
    names = np.unique(groups)
    if len(names) < FEWEST_SHOWING:
        return np.zeros(scores.shape[1])
    weakest = [
        np.quantile(scores[groups == one], _WEAK_SHARE, axis=0, method="lower") for one in names
    ]
    return np.asarray(np.min(weakest, axis=0), dtype=np.float64)


def lacks_blows(scores: Float, floors: Float) -> bool:
    """Whether a recording lacks the impacts that every recording of a class has.

    Parameters
    ----------
    scores : numpy.ndarray [shape=(n_channels,)]
        Scores of the recording; empty if unknown.
    floors : numpy.ndarray [shape=(n_channels,)]
        Scores of the class, from :func:`blow_floors`.

    Returns
    -------
    bool
        True if the class exceeds the score of noise in some channels, and the recording in none of
        these.

    Examples
    --------
    >>> floors = np.array([30.0, 2.0])
    >>> [lacks_blows(np.array(row), floors) for row in ([4.0, 9.0], [8.0, 1.0], [])]
    [True, False, False]
    """
    shown = floors > NOISE_SCORE
    if scores.size == 0 or not shown.any():
        return False
    return bool((scores[shown] <= NOISE_SCORE).all())
