"""From a labelled data set to a wear model, or to a model of named conditions."""

from collections.abc import Sequence, Sized
from dataclasses import replace
from pathlib import Path

from ...datasets.audit.integrity import refuse_shared, refuse_wrong_labels
from ...datasets.file.views import views_of
from ...sim.output.recording import DataError
from ..class_model.train import ClassModel
from ..class_model.train import train_classes as fit_class_model
from ..feature_rows.feature_choice import choices_of
from ..feature_rows.feature_table import Progress
from ..wear_model.estimate import WearModel
from ..wear_model.train import train_model


def train(
    data: str | Path,
    *,
    target: str | None = None,
    held_out: float = 0.25,
    split: str | None = None,
    baseline: str | Path | None = None,
    refuse: Sequence[str | Path] = (),
    features: Sequence[str] = (),
    budget_ms: float | None = None,
    joined: Sequence[str] = (),
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> WearModel:
    """Train a wear model on a labelled data set.

    Parameters
    ----------
    data : str or Path
        File from :func:`wearstate.generate` or :func:`wearstate.import_recordings`, with a wear
        label [m].
    target : str, optional
        Column of the wear; the first one of the data set by default.
    held_out : float
        Share of the machine draws kept out of every fit to judge the model, >= 0 and < 1.
    split : str, optional
        Split stored in the data set, in place of `held_out`: only its training side is used.
    baseline : str or Path, optional
        Data set of healthy records of the same machines: the model then compares each machine with
        its new state, and needs healthy records of every machine that it judges.
    refuse : sequence of str or Path
        Data sets that the model must refuse, like `data` but of other kinds: another lubrication
        regime, another fault, another machine. One kind each, or one for each regime that a set
        draws; at least 20 recordings of a kind.
    features : sequence of str
        Feature sets (standard, core, complete) or names; among several, cross-validation chooses.
        The standard set by default.
    budget_ms : float, optional
        Largest time of a prediction, without its features [ms]; 5 by default.
    joined : sequence of str
        ``NAME=FILE`` of data sets that add other tests of the same machine to each record.
    seed : int
        Seed of the split, the folds and the trees.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    WearModel
        Fitted model; :func:`wearstate.save_model` writes it, :func:`wearstate.evaluate` judges it.

    Raises
    ------
    DataError
        If there is no such column or split, there are no limits, too few machine draws, machines
        unknown or without a healthy record, a budget that no model meets, labels that contradict
        grades, limits or recipe, a record under two machines, or recordings to refuse that are in
        the data set, have other channels or cannot be distinguished from the rest.

    Examples
    --------
    >>> import wearstate
    >>> model = wearstate.train("pump.h5", features=["core"])
    >>> model.card.severity, model.mode, model.card.trained_on.records
    ('diametral_clearance_crankpin_m', 'cold', 18)
    """
    _refuse_recordings(data)
    refuse_wrong_labels(data)
    refuse_shared(data, refuse)
    views = views_of(joined)
    model, _, _ = train_model(
        data,
        target=target,
        held_out=held_out,
        split=split,
        seed=seed,
        jobs=jobs,
        budget_ms=budget_ms,
        baseline=baseline,
        refuse=refuse,
        choices=tuple(replace(choice, views=views) for choice in choices_of(features)),
        progress=progress,
    )
    return model


def train_classes(
    data: str | Path,
    target: str,
    *,
    features: Sequence[str] = (),
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> ClassModel:
    """Train a model that names conditions, such as healthy, unbalance, looseness.

    Parameters
    ----------
    data : str or Path
        File from :func:`wearstate.generate` or :func:`wearstate.import_recordings`, with a text
        label. Its groups (by default files) determine every split.
    target : str
        Column of the label.
    features : sequence of str
        One feature set (standard, core, complete), or names; the standard set by default.
    seed : int
        Seed of folds, trees and resamples.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    ClassModel
        Fitted on all recordings; its ``scores`` judge it by recordings left out,
        :func:`wearstate.save_class_model` writes it.

    Raises
    ------
    DataError
        No such label, a label that differs within a recording, fewer than two classes of enough
        recordings, or more than one set of features.

    Examples
    --------
    >>> import wearstate
    >>> model = wearstate.train_classes("faults.h5", "condition")  # doctest: +SKIP
    >>> model.estimate(recording).verdict  # doctest: +SKIP
    'named'

    A label that differs within the records of a machine is none of a machine:

    >>> wearstate.train_classes("pump.h5", "grade")  # doctest: +IGNORE_EXCEPTION_DETAIL
    Traceback (most recent call last):
    wearstate.sim.output.recording.DataError: pump.h5: grade differs
    """
    _refuse_recordings(data)
    choices = choices_of(features)
    if len(choices) > 1:
        raise DataError(f"features = {len(choices)} sets must be 1 for classes; name one")
    model, _ = fit_class_model(
        data, target=target, choice=choices[0], seed=seed, jobs=jobs, progress=progress
    )
    return model


def _refuse_recordings(data: object) -> None:
    """A model is trained on a file, whose labels and machines decide what is learnt and split."""
    if isinstance(data, (str, Path)):
        return
    given = f"{len(data)} items" if isinstance(data, Sized) else "no path"
    raise DataError(
        f"data = {type(data).__name__} of {given} must be the file of a labelled data set: labels "
        "and machines decide every split; make one of recordings' files with "
        'wearstate.import_recordings(files, "data.h5", labels=...), or of a recipe with '
        "wearstate.generate"
    )
