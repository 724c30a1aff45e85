"""Features for training a model: given in words, selected in folds, kept in its card."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.views import JoinedSet
from ...datasets.split.rules import group_folds
from ...features.catalogue.catalogue import SetName
from ...sim.output.recording import DataError
from ..learning.regressions import CANDIDATES, Folds
from .feature_table import (
    USUAL,
    FeatureSelection,
    FeatureTable,
    Healthy,
    feature_table_names,
    held_against,
    recording_features,
)
from .model_card import FeatureChoice

Float = NDArray[np.float64]
Index = NDArray[np.intp]

SELECT = "select"
"""Word for a selection among all sets."""

_SETS: tuple[SetName, ...] = get_args(SetName)
_LINES = tuple(each for each in CANDIDATES if each.cost_ms < 0.1)
_TIE = 0.01  # of the error: a later set must be better by more to be worth its time
_TIMED = 3  # records whose features are timed


def choices_of(words: Sequence[str]) -> tuple[FeatureSelection, ...]:
    """Candidates for the features of a model, from words of a command line.

    Parameters
    ----------
    words : sequence of str
        Each a set, several sets separated by commas, ``select`` for all sets, names of features or
        values separated by commas, or a text file with such names and `#` comments.

    Returns
    -------
    tuple of FeatureSelection
        In the order given; without words the usual set.

    Raises
    ------
    DataError
        A word mixes sets and names, or names nothing.

    Examples
    --------
    >>> [choice.feature_set for choice in choices_of(["standard,core"])]
    ['standard', 'core']
    >>> choices_of(["frf_profile, speed"])[0].only
    ('frf_profile', 'speed')
    """
    found = [choice for word in words for choice in _choices(word)]
    return tuple(dict.fromkeys(found)) or (USUAL,)


def _choices(word: str) -> list[FeatureSelection]:
    names = _names_in(word)
    sets = [name for name in names if name in _SETS]
    if names == [SELECT]:
        sets = list(_SETS)
    elif sets and len(sets) < len(names):
        raise DataError(
            f"features = {word!r} must hold sets or names, holds both; give each by an "
            "option of its own, to choose among them"
        )
    if not names:
        raise DataError(f"features = {word!r} names 0 features, must name >= 1; name some")
    if sets:
        return [FeatureSelection(feature_set=name) for name in _SETS if name in sets]
    return [FeatureSelection(only=tuple(dict.fromkeys(names)))]


def _names_in(word: str) -> list[str]:
    """Names separated by commas, or on the lines of a file."""
    file = Path(word)
    text = word
    if file.suffix and file.is_file():
        text = ",".join(line.partition("#")[0] for line in file.read_text("utf-8").splitlines())
    return [name for name in (part.strip() for part in text.split(",")) if name]


def words_of(choice: FeatureSelection) -> str:
    """A choice in words.

    Examples
    --------
    >>> words_of(FeatureSelection(only=("rms", "speed")))
    'rms, speed'
    """
    return choice.feature_set if choice.only is None else ", ".join(choice.only)


def choice_in(kept: FeatureChoice) -> FeatureSelection:
    """The features that a model was trained on.

    Parameters
    ----------
    kept : FeatureChoice
        Entry of the model's card.

    Examples
    --------
    >>> choice_in(FeatureChoice(set="core")).feature_set
    'core'
    """
    return FeatureSelection(feature_set=kept.set, only=tuple(kept.only) or None)


def choice_card(choice: FeatureSelection) -> FeatureChoice:
    """Entry of a card for a choice."""
    return FeatureChoice(set=choice.feature_set, only=list(choice.only or ()))


# --- candidates of one data set


@dataclass(frozen=True, kw_only=True)
class Candidates:
    """Sets of features to choose from, as columns of one table.

    Attributes
    ----------
    choices : tuple of FeatureSelection
    columns : tuple of numpy.ndarray
        Columns of each, in the table of all.
    whole : FeatureSelection
        Features of the table of all.
    """

    choices: tuple[FeatureSelection, ...]
    columns: tuple[Index, ...]
    whole: FeatureSelection

    def part(self, table: FeatureTable, place: int) -> FeatureTable:
        """A table of one candidate's columns alone."""
        return table.named([table.names[i] for i in self.columns[place]])


def candidates_of(
    path: str | Path, choices: Sequence[FeatureSelection], healthy: Healthy | None = None
) -> Candidates:
    """Columns of each candidate, from the first usable record of a data set.

    Parameters
    ----------
    path : str or Path
        Data set file.
    choices : sequence of FeatureSelection
        At least one, all with the same views.
    healthy : Healthy, optional
        As in :func:`wearstate.diagnose.feature_rows.feature_table.feature_table`.

    Returns
    -------
    Candidates

    Raises
    ------
    DataError
        The data set has no usable record, a named feature does not exist or cannot be computed, or
        two candidates have the same features here.
    """
    each = [feature_table_names(path, choice, healthy) for choice in choices]
    if len(set(each)) < len(each):
        twice = next(i for i, names in enumerate(each) if names in each[:i])
        raise DataError(
            f"{path}: {words_of(choices[twice])} has the same {len(each[twice])} features as "
            f"{words_of(choices[each.index(each[twice])])} here, must have others; leave it out"
        )
    if len(each) == 1:
        columns = np.arange(len(each[0]), dtype=np.intp)
        return Candidates(choices=tuple(choices), columns=(columns,), whole=choices[0])
    union = tuple(dict.fromkeys(name for names in each for name in names))
    whole = FeatureSelection(only=union, views=choices[0].views)
    place = {name: i for i, name in enumerate(feature_table_names(path, whole, healthy))}
    return Candidates(
        choices=tuple(choices),
        columns=tuple(np.array(sorted(place[name] for name in names)) for names in each),
        whole=whole,
    )


def costs_ms(
    path: str | Path, choices: Sequence[FeatureSelection], healthy: Healthy | None = None
) -> list[float]:
    """Computing time of the features of one recording, for each choice [ms].

    Parameters
    ----------
    path : str or Path
        Data set; the shortest time of its first few usable records counts, after a first call.
    choices : sequence of FeatureSelection
    healthy : Healthy, optional
        As in :func:`wearstate.diagnose.feature_rows.feature_table.feature_table`; its own time is
        not counted.
    """
    with JoinedSet(Path(path), choices[0].views) as data:
        sound = (data.data.manifest["status"] == "ok").to_numpy() & data.complete
        usable = np.flatnonzero(sound)[:_TIMED]
        recordings = [data[int(index)] for index in usable]
    found = []
    for choice in choices:
        seconds = []
        for recording in recordings[:1] + recordings:
            known = None if healthy is None else healthy.of(recording.machine)
            mine = held_against(choice, known)
            start = perf_counter()
            recording_features(recording, mine)
            seconds.append(perf_counter() - start)
        found.append(1e3 * min(seconds[1:]))
    return found


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Selected set, by folds of whole machines.

    Attributes
    ----------
    chosen : int
        Index of the set selected from all records.
    errors : tuple of float
        Out-of-fold mean absolute error of linear models on each set [unit of the target].
    by_fold : tuple of int
        Index of the set selected from the training records of each outer fold.
    """

    chosen: int
    errors: tuple[float, ...]
    by_fold: tuple[int, ...]


def select_set(
    inputs: Sequence[Float],
    target: Float,
    groups: NDArray[Any],
    folds: Folds,
    *,
    seed: int = 0,
) -> Selection:
    """Select one of several feature sets, from all records and within each outer fold.

    Parameters
    ----------
    inputs : sequence of numpy.ndarray, each [shape=(n, n_features)]
        Rows of each set, the cheapest first.
    target : numpy.ndarray [shape=(n,)]
        > 0.
    groups : numpy.ndarray [shape=(n,)]
        Machine of each record.
    folds : sequence of (numpy.ndarray, numpy.ndarray)
        Outer folds.
    seed : int
        Seed of the inner folds.

    Returns
    -------
    Selection

    Notes
    -----
    In an outer fold the selection uses inner folds of its training records alone, so that the error
    of the selected set on the left-out records is that of unseen machines, selection included. Only
    linear models are used: they take a hundredth of the time of the trees. The first set within one
    per cent of the smallest error is selected.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> good, idle = rng.standard_normal((2, 60, 2))
    >>> groups = np.arange(60)
    >>> folds = group_folds(groups, n=3, seed=0)
    >>> select_set([idle, good], np.exp(good[:, 0]), groups, folds).by_fold
    (1, 1, 1)
    """
    errors = [_line_error(rows, target, folds) for rows in inputs]
    by_fold = []
    for train, _ in folds:
        inner = group_folds(groups[train], n=len(folds), seed=seed)
        by_fold.append(_first([_line_error(rows[train], target[train], inner) for rows in inputs]))
    return Selection(chosen=_first(errors), errors=tuple(errors), by_fold=tuple(by_fold))


def _line_error(rows: Float, target: Float, folds: Folds) -> float:
    """Smallest out-of-fold mean absolute error of a linear model."""
    errors = np.zeros(len(_LINES))
    for train, test in folds:
        for i, line in enumerate(_LINES):
            found = line.fit(rows[train], rows[train], target[train], 0, 0).predict(rows[test])
            errors[i] += np.abs(np.clip(found, 0.0, 2 * target.max()) - target[test]).sum()
    return float(errors.min() / len(target))


def _first(errors: Sequence[float]) -> int:
    least = min(errors)
    return next(i for i, error in enumerate(errors) if error <= least * (1 + _TIE))


def feature_words(name: str) -> str:
    """Feature name in words.

    Examples
    --------
    >>> feature_words("acc_x.angle_040_050.band_4350_5250.level_db")
    'acc_x, 40 to 50°, 4350 to 5250 Hz, level'
    >>> feature_words("acc_y.kurtosis")
    'acc_y, kurtosis'
    >>> feature_words("orbit.order_0.5.major_db")
    'orbit, order 0.5, major'
    >>> feature_words("pressure.rise_width_deg")
    'pressure, rise width'
    """
    owner, *parts = re.split(r"\.(?![0-9])", name)  # an order may be 0.5
    words = [owner]
    for part in parts:
        span = re.fullmatch(r"(angle|band)_(\d+)_(\d+)", part)
        if span:
            unit = "°" if span[1] == "angle" else " Hz"
            words.append(f"{int(span[2])} to {int(span[3])}{unit}")
        else:
            bare = re.sub(r"_(db|hz|deg)$", "", part).replace("_", " ")
            words.append(re.sub(r"^order 0*(?=\d)", "order ", bare))
    return ", ".join(words)


def value_words(name: str, value: float) -> str:
    """Value of a feature with its unit.

    Examples
    --------
    >>> value_words("acc_x.order_02.level_db", -8.04), value_words("acc_y.kurtosis", 3.0)
    ('-8.04 dB', '3')
    """
    unit = _SUFFIXES.get(name.rpartition("_")[2], "")
    return f"{value:.3g} {unit}".rstrip()


_SUFFIXES = {"db": "dB", "hz": "Hz", "deg": "°"}
