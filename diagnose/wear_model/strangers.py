"""Recordings that a model must refuse: read from their files, and distinguished from familiar ones.

A distance from the training recordings cannot see a regime whose recordings lie among them: a
starved pin knocks like a dry one. Shown some of its recordings, a straight line can.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...datasets.file.attributes import Attributes
from ...datasets.file.record import DataSet
from ...datasets.recipe.text import name_in
from ...datasets.split.rules import group_folds
from ...sim.output.recording import DataError
from ..feature_rows.feature_table import (
    FeatureSelection,
    FeatureTable,
    Progress,
    feature_table,
    regimes_in,
)
from ..feature_rows.model_card import StrangerRates
from ..learning.heads import Head, fit_head, told_apart
from ..learning.regressions import CANDIDATES, SMOOTH
from .training_rows import FOLDS, Strangers, TrainingRows

REFUSED_AS_STRANGER = 0.01
"""Share of familiar recordings, left out of the fit, that may be taken for any of the strangers."""

_FAMILIAR = 4000  # recordings that a classifier learns: enough for the one in 300 it may mistake
_FEWEST = 20  # of a kind, for a rate to within a tenth
_LEAST_DETECTED = 0.5  # of a kind: if fewer are recognised, it is not another kind


def strangers_in(
    paths: Sequence[str | Path],
    head: Attributes,
    choice: FeatureSelection,
    names: Sequence[str],
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[Strangers, ...]:
    """Read what a model must refuse.

    Parameters
    ----------
    paths : sequence of str or Path
        Data sets, labelled or not, of the channels and the sample rate of the training set.
    head : Attributes
        Attributes of the training set.
    choice : FeatureSelection
        Selection of the training set's features.
    names : sequence of str
        Names of these features.
    jobs, progress
        As of :func:`~.feature_rows.feature_table.feature_table`.

    Returns
    -------
    tuple of Strangers
        One for each regime of lubrication that a set draws; else one for each file, by the name of
        its recipe or of the file.

    Raises
    ------
    DataError
        Other channels or another sample rate, or fewer than 20 recordings of a kind; all at once.
    """
    faults = [text for path in paths for text in _other_layout(path, head)]
    if faults:
        raise DataError("\n".join(faults))
    found: dict[str, list[tuple[FeatureTable, NDArray[np.bool_]]]] = {}
    for path in dict.fromkeys(paths):
        table = feature_table(path, choice=choice, jobs=jobs, progress=progress).named(names)
        if not np.isfinite(table.values).all():
            faults.append(
                f"{path}: features are undefined in some records, must be defined in all; leave "
                "such records out"
            )
        for name, here in _kinds(path, table.manifest).items():
            found.setdefault(name, []).append((table, here))
    kinds = tuple(_strangers(name, parts) for name, parts in found.items())
    faults += [text for each in kinds for text in _too_few(each)]
    if faults:
        raise DataError("\n".join(faults))
    return kinds


def _too_few(kind: Strangers) -> list[str]:
    counts = {
        "recordings": (len(kind.rows), _FEWEST),
        "machines": (len(np.unique(kind.groups)), FOLDS),
    }
    return [
        f"refuse: {count} {what} of {kind.name}, must be >= {fewest}; add others"
        for what, (count, fewest) in counts.items()
        if count < fewest
    ]


def _other_layout(path: str | Path, head: Attributes) -> list[str]:
    with DataSet(path) as data:
        other = data.attributes
    pairs = {
        "channels": (_told(other), _told(head)),
        "sample_rate": (other.sample_rate, head.sample_rate),
        "pulses_per_revolution": (other.pulses_per_revolution, head.pulses_per_revolution),
    }
    return [
        f"{path}: {name} = {found} must be {wanted}, as of the training set; record or generate "
        "it alike"
        for name, (found, wanted) in pairs.items()
        if found != wanted
    ]


def _told(head: Attributes) -> str:
    return ", ".join(f"{channel.name} [{channel.unit}]" for channel in head.channels)


def _kinds(path: str | Path, manifest: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """Kinds of strangers in a file, and which of its recordings they are."""
    regimes = regimes_in(manifest)
    if regimes:
        return regimes
    with DataSet(path) as data:
        recipe = name_in(data.attributes.recipe)
    return {recipe or Path(path).stem: np.ones(len(manifest), dtype=bool)}


def _strangers(name: str, parts: Sequence[tuple[FeatureTable, NDArray[np.bool_]]]) -> Strangers:
    rows, groups, signals, first = [], [], [], 0
    for table, here in parts:
        rows.append(table.values[here])
        groups.append(first + table.manifest["group"].to_numpy()[here])
        signals.append(table.manifest["signal_crc32"].to_numpy()[here])
        first += int(table.manifest["group"].max()) + 1  # machines of one file are none of another
    signal, once = np.unique(np.concatenate(signals), return_index=True)
    return Strangers(
        name=name,
        rows=np.vstack(rows)[once],
        groups=np.concatenate(groups)[once].astype(np.intp),
        signals=signal,
    )


def fit_strangers(training: TrainingRows, seed: int) -> tuple[tuple[Head, StrangerRates], ...]:
    """Fit a classifier of each kind of strangers against the familiar recordings.

    Parameters
    ----------
    training : TrainingRows
        Familiar ones, with the strangers.
    seed : int
        Seed of the folds.

    Returns
    -------
    tuple of (Head, StrangerRates)
        The threshold of a head lets pass all familiar recordings but a share of
        :data:`REFUSED_AS_STRANGER`, of which each kind has its part; rates are of machines without
        part in the fit.

    Raises
    ------
    DataError
        Less than half the recordings of a kind are recognised: they may be familiar ones.
    """
    kinds = training.strangers
    found = tuple(_fit(training, each, REFUSED_AS_STRANGER / len(kinds), seed) for each in kinds)
    alike = [rates for _, rates in found if rates.detection_rate < _LEAST_DETECTED]
    if alike:
        raise DataError(
            "\n".join(
                f"refuse: {rates.detection_rate:.0%} of {rates.records} recordings of {rates.name} "
                f"differ from those of the training set, must be >= {_LEAST_DETECTED:.0%}; "
                "leave them out, or train on them"
                for rates in alike
            )
        )
    return found


def _fit(
    training: TrainingRows, strangers: Strangers, share: float, seed: int
) -> tuple[Head, StrangerRates]:
    familiar = training.some(_FAMILIAR, seed)
    both = familiar.with_strangers(strangers)
    here = np.arange(len(both.rows)) >= len(familiar.rows)
    fitted = fit_head(
        strangers.name,
        both.rows,
        here,
        group_folds(both.groups, n=FOLDS, seed=seed),
        seed=seed,
        candidates=[each for each in CANDIDATES if each.name in SMOOTH],
        shifted=both.moved(seed).rows,
    )
    head = told_apart(fitted, here, share)
    called = fitted.probability > head.threshold
    rates = StrangerRates(
        name=head.name,
        records=int(here.sum()),
        detection_rate=float(called[here].mean()),
        false_alarm_rate=float(called[~here].mean()),
    )
    return head, rates
