"""From a labelled data set to a wear model."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ...datasets.file.views import views_of
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
        File of :func:`wearstate.generate` or :func:`wearstate.import_recordings`, with a wear
        label [m].
    target : str, optional
        Column of the wear; the first one of the data set by default.
    held_out : float
        Share of the machine draws kept out of every fit, to judge the model on, >= 0 and < 1.
    split : str, optional
        A split that the data set holds, in place of `held_out`: only its training side is used.
    baseline : str or Path, optional
        Data set of healthy records of the same machines: the model is then told how each was when
        new, and needs that of every machine it is asked about.
    features : sequence of str
        Sets of features (standard, core, complete) or names; of several, folds choose. The
        standard set by default.
    budget_ms : float, optional
        Time that a prediction may take, beside its features [ms]; 5 by default.
    joined : sequence of str
        ``NAME=FILE`` of data sets that complete each record by other tests of the same machine.
    seed : int
        Of the split, the folds and the trees.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    WearModel
        Fitted; :func:`wearstate.save_model` writes it, :func:`wearstate.evaluate` judges it.

    Raises
    ------
    DataError
        No such column or split, no limits, too few machine draws, machines unknown or without a
        healthy record, or a budget that no model keeps.

    Examples
    --------
    >>> import wearstate
    >>> model = wearstate.train("pump.h5", features=["core"])
    >>> model.card["severity"], model.mode, model.card["trained_on"]["records"]
    ('diametral_clearance_crankpin_m', 'cold', 90)
    """
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
        choices=tuple(replace(choice, views=views) for choice in choices_of(features)),
        progress=progress,
    )
    return model
