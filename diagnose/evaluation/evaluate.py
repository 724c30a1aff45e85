"""Accuracy of a wear model on unseen machines, compared with baselines."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...datasets.file.attributes import Attributes
from ...datasets.file.record import DataSet
from ...datasets.file.views import CompletingView
from ...datasets.split.stored import Sides, usable_sides
from ...sim.output.recording import DataError
from ..feature_rows.feature_choice import choice_in
from ..feature_rows.feature_table import (
    FeatureSelection,
    FeatureTable,
    Progress,
    confounders_in,
    feature_table,
)
from ..feature_rows.noted import notes_of
from ..healthy_reference.healthy import references, refuse_strangers
from ..healthy_reference.transfer_reference import healthy_transfer
from ..learning.conformal import grade_limits, grade_set, interval
from ..learning.grades import grades_of
from ..learning.scores import (
    Judged,
    Mask,
    Resamples,
    bound_of,
    confusion,
    figures,
    plain,
    resampled,
    share,
)
from ..learning.severity import Estimator
from ..wear_model.estimate import WearModel
from ..wear_model.train import draw_identity
from ..wear_model.verdict import Estimate
from .baselines import Side, compare_baselines, side_of
from .foreign_features import transformed_rows

Float = NDArray[np.float64]
Index = NDArray[np.intp]

P_LEVELS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)
"""Levels at which novelty p-values are compared with a uniform distribution."""

LEVELS = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
"""Nominal coverages at which intervals and sets are compared with the truth."""


@dataclass(frozen=True, kw_only=True)
class Background:
    """Data for the baselines, in addition to the judged records.

    Attributes
    ----------
    train : Side or None
        Training records of the baselines; None: the records of the table that are not judged, or,
        without any, folds of the judged ones.
    foreign : mapping
        Source -> features by third-party packages for all rows of the judged table, or the reason
        for their absence; see :func:`wearstate.diagnose.evaluation.baselines.side_of`.
    """

    train: Side | None = None
    foreign: Mapping[str, Float | str] | None = None


NO_BACKGROUND = Background()
"""Only the cheap baselines, trained on the rest of the judged table."""


def evaluate_model(
    model: WearModel,
    path: str | Path,
    *,
    views: Sequence[CompletingView] = (),
    trained_on: str | Path | None = None,
    healthy: str | Path | None = None,
    split: str | None = None,
    quick: bool = False,
    cache: Path | None = None,
    jobs: int = 1,
    seed: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Judge a model on a data set, using machine draws that it was not trained on.

    Parameters
    ----------
    model : WearModel
    path : str or Path
        Labelled data set. If its machine draws are those of the training set, only the draws held
        out there are used.
    views : sequence of CompletingView
        Data sets that complete the records, as the model needs them; incomplete records are left
        out.
    trained_on : str or Path, optional
        The model's training set, for the baselines. By default they are trained on its records in
        `path`, or, without any, in folds of the judged machines, which favours them.
    healthy : str or Path, optional
        Healthy records of the same machines, for a referenced model.
    split : str, optional
        A split stored in the data set: all of its test side is judged. If the model was trained on
        none of its records, the baselines are trained on its training side.
    quick : bool
        Leave out the baselines that need third-party packages, which take seconds per recording.
    cache : Path, optional
        Folder in which features of these packages are kept.
    jobs : int
        Worker processes for the features.
    seed : int
        Seed of the resamples and of the baselines.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    dict
        As from :func:`score`; for a split also ``split``: its ``name``, ``text`` and ``sha256``,
        and whether the model was ``trained_with_it``.

    Raises
    ------
    DataError
        The severity of the model is not labelled, its features differ, no unseen machine draw is
        left, `trained_on` is not its training set, or it was trained on the test side of the split.
    """
    sides = None if split is None else _sides(path, split)
    if healthy is not None:
        refuse_strangers(path, healthy)
    if views and trained_on is not None:
        raise DataError("join and trained_on must not both be given; leave the training set out")
    table, rows = judged_rows(
        model, path, views=views, sides=sides, healthy=healthy, jobs=jobs, progress=progress
    )
    reference = None
    if healthy is not None:
        reference, _ = references(
            table,
            path,
            healthy,
            choice=choice_in(model.card.feature_choice),
            jobs=jobs,
            progress=progress,
        )
    home, home_table = (path, table) if trained_on is None else (trained_on, None)
    if home_table is None:
        home_table = feature_table(
            home, choice=choice_in(model.card.feature_choice), jobs=jobs, progress=progress
        )
    train = trained_rows(model, home_table)
    if trained_on is not None and train.size == 0:
        raise DataError(
            f"{trained_on}: 0 records that the model was trained on, must be > 0; name its "
            "training set"
        )
    if sides is not None and trained_on is None and train.size == 0:
        train = sides.train
    examples = train if train.size else rows
    rows_of = transformed_rows(
        Path(home), examples, seed=seed, quick=quick, cache=cache, progress=progress
    )
    known = rows_of.rows(Path(home), home_table) if train.size else None
    background = Background(
        train=side_of(home_table, model.card.severity, train, known) if train.size else None,
        foreign=rows_of.rows(Path(path), table),
    )
    result = score(model, table, rows, references=reference, background=background, seed=seed)
    return result if sides is None else {**result, "split": _split_card(model, sides)}


def _sides(path: str | Path, name: str) -> Sides:
    with DataSet(path) as data:
        return usable_sides(data, name)


def _split_card(model: WearModel, sides: Sides) -> dict[str, Any]:
    return {
        "name": sides.name,
        "text": sides.text,
        "sha256": sides.sha256,
        "trained_with_it": model.card.trained_on.split_sha256 == sides.sha256,
    }


def trained_rows(model: WearModel, table: FeatureTable) -> Index:
    """Rows of a table whose signals are identical to training signals of a model."""
    known = table.manifest["signal_crc32"].isin(model.card.trained_on.training_signals)
    return np.flatnonzero(known)


def judged_rows(
    model: WearModel,
    path: str | Path,
    *,
    views: Sequence[CompletingView] = (),
    sides: Sides | None = None,
    healthy: str | Path | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[FeatureTable, Index]:
    """Feature table of a data set, and the rows on which a model can be judged.

    With a split, these are its test side.

    Raises
    ------
    DataError
        As in :func:`evaluate_model`.
    """
    with DataSet(path) as data:
        head = data.attributes
    refuse_other_severity(model, head, path)
    known = healthy_transfer(healthy, [FeatureSelection(only=model.names)])
    choice = replace(choice_in(model.card.feature_choice), views=_views_of(model, views, path))
    table = feature_table(path, choice=choice, healthy=known, jobs=jobs, progress=progress)
    identity = draw_identity(head)
    rows = (
        unseen_rows(model, table, identity, path)
        if sides is None
        else tested_rows(model, table, sides, identity, path)
    )
    whole = rows[table.complete[rows]]
    if whole.size == 0:
        raise DataError(f"{path}: {'; '.join(table.lacking_words)}, must be 0; join other sets")
    return table, whole


def _views_of(
    model: WearModel, views: Sequence[CompletingView], path: str | Path
) -> tuple[CompletingView, ...]:
    """Views in the order of the model; raise if they are not those of the model."""
    known = {view.name: view for view in views}
    wanted = model.card.views
    if set(known) != set(wanted):
        raise DataError(
            f"{path}: joined views = {', '.join(known) or 'none'}, the model needs "
            f"{', '.join(wanted) or 'none'}; give --join NAME=FILE for each of them"
        )
    return tuple(known[name] for name in wanted)


def unseen_rows(
    model: WearModel, table: FeatureTable, identity: str, path: str | Path
) -> NDArray[np.intp]:
    """Rows of machine draws on which the model was not trained.

    A draw counts as seen if recipe name and seed are those of the training set and its number was
    in training, or if any of its signals is identical to a training signal.

    Raises
    ------
    DataError
        None is left, or the features are not those of the model.
    """
    _check_features(model, table, path)
    rows = np.flatnonzero(~_seen_machines(model, table, identity))
    if rows.size == 0:
        raise DataError(
            f"{path}: 0 machine draws that the model has not seen, must be > 0; train with "
            "--held-out 0.25, or generate with another --seed"
        )
    return rows


def tested_rows(
    model: WearModel, table: FeatureTable, sides: Sides, identity: str, path: str | Path
) -> Index:
    """Rows of a split's test side, whose records and machines must be unseen by the model.

    If machines are on both sides by design, only the records must be unseen.

    Raises
    ------
    DataError
        Some have been seen, or the features are not those of the model.
    """
    _check_features(model, table, path)
    seen = np.isin(np.arange(len(table.values)), trained_rows(model, table))
    if sides.machines_apart:
        seen |= _seen_machines(model, table, identity)
    leaked = sides.test[seen[sides.test]]
    if leaked.size:
        machines = table.manifest["group"].iloc[leaked].nunique()
        raise DataError(
            f"{path}: split {sides.name} tests {leaked.size} records of {machines} machines that "
            f"the model was trained on, must be 0; train with --split {sides.name}, or judge "
            "without --split on the machines that the model has not seen"
        )
    return sides.test


def refuse_other_severity(model: WearModel, head: Attributes, path: str | Path) -> None:
    """Reject a data set that is not labelled with the severity of a model.

    Raises
    ------
    DataError
        The severities differ; the message names both.
    """
    wanted = model.card.severity
    if wanted not in head.severities:
        raise DataError(
            f"{path}: severities = {', '.join(head.severities) or 'none'}, must hold that of the "
            f"model, {wanted}; if one of them is the same wear, import it under that name: "
            f"--severity {wanted}"
        )


def _check_features(model: WearModel, table: FeatureTable, path: str | Path) -> None:
    if list(table.names) != model.card.features:
        raise DataError(
            f"{path}: {_difference(table.names, model.card.features)}; use recordings with the "
            "model's channels and rate"
        )


def _difference(names: Sequence[str], wanted: Sequence[str]) -> str:
    """Differences between the features of a data set and those that a model needs."""
    sides = [("lacks", wanted, names), ("additionally has", names, wanted)]
    differences = [
        f"{verb} {len(odd)}, such as {odd[0]}"
        for verb, some, others in sides
        if (odd := [name for name in some if name not in set(others)])
    ]
    what = " and ".join(differences) or "has another order"
    return f"of the model's {len(wanted)} features it {what}"


def _seen_machines(model: WearModel, table: FeatureTable, identity: str) -> NDArray[np.bool_]:
    """Records of machines on which the model was trained."""
    trained = model.card.trained_on
    groups = table.manifest["group"].to_numpy()
    seen = np.isin(groups, groups[trained_rows(model, table)])
    if identity and identity == trained.draw_identity:
        seen |= np.isin(groups, trained.training_groups)
    return seen


def score(
    model: WearModel,
    table: FeatureTable,
    rows: Index,
    *,
    references: Float | None = None,
    background: Background = NO_BACKGROUND,
    seed: int = 0,
) -> dict[str, Any]:
    """Errors, coverage and baselines on some rows of a table.

    Parameters
    ----------
    model : WearModel
    table : FeatureTable
        Table with the model's features and its severity.
    rows : numpy.ndarray
        Rows to judge on.
    references : numpy.ndarray [shape=(n_records, n_features)], optional
        Healthy features of each row's machine, for a referenced model.
    background : Background
        Training data and features of the baselines.
    seed : int
        Seed of the resamples and of the baselines' folds.

    Returns
    -------
    dict
        Ready for JSON, None for a figure without records: ``records``, ``draws``; every figure of
        :data:`wearstate.diagnose.learning.scores.FIGURES` by name, and under ``intervals`` its 95 %
        interval over machines; ``accuracy_bound`` (about the best at that error in metres),
        ``nominal_coverage``, ``confusion`` (true grade by row, of the graded), ``reliability`` as
        :func:`reliability`, ``familiarity`` as :func:`p_value_shares`, ``baselines`` as
        :func:`wearstate.diagnose.evaluation.baselines.compare_baselines`, ``by_confounder`` as
        :func:`by_confounder`, ``by_choice`` as :func:`by_choice`.
    """
    edges, limit = model.card.grade_edges_m, model.card.condemning_limit_m
    judged, estimates = judge_rows(model, table, rows, references)
    draws = resampled(judged.groups, seed=seed)
    found = figures(judged, edges, limit, draws)
    mine = judged.graded
    true = grades_of(judged.truth, edges)
    column, foreign = model.card.severity, background.foreign
    others = np.setdiff1d(np.arange(len(table.values)), rows)
    train = background.train or (side_of(table, column, others, foreign) if others.size else None)
    test = side_of(table, column, rows, foreign)
    given = [estimate.coverage for estimate in estimates if estimate.graded]
    parts = {
        "error": np.abs(judged.found - judged.truth),
        "familiar": mine,
        "covered": (judged.low <= judged.truth) & (judged.truth <= judged.high),
    }
    result = {
        "records": len(rows),
        "draws": draws.weight.shape[1],
        **{name: figure.value for name, figure in found.items()},
        "intervals": {name: [figure.low, figure.high] for name, figure in found.items()},
        "accuracy_bound": bound_of(judged, edges),
        "nominal_coverage": float(np.mean(given)) if given else None,
        "confusion": confusion(true[mine], judged.grade[mine], len(edges) + 1),
        "reliability": reliability(model, judged, estimates, draws),
        "familiarity": p_value_shares(estimates, draws),
        "baselines": compare_baselines(train, test, judged, edges, limit, draws, seed=seed),
        "by_confounder": by_confounder(table.manifest.iloc[rows], **parts),
        "by_choice": by_choice(table.manifest.iloc[rows], **parts),
    }
    return dict(plain(result))


def judge_rows(
    model: WearModel, table: FeatureTable, rows: Index, references: Float | None = None
) -> tuple[Judged, list[Estimate]]:
    """Apply a model to rows of a table.

    Parameters
    ----------
    model : WearModel
    table : FeatureTable
    rows : numpy.ndarray
    references : numpy.ndarray [shape=(n_records, n_features)], optional
        Healthy features of each row's machine, for a referenced model.

    Returns
    -------
    judged : Judged
        Contains the estimate of the model whatever the verdict.
    estimates : list of Estimate
    """
    card = model.card
    manifest = table.manifest.iloc[rows]
    healthy = None if references is None else references[rows]
    notes = notes_of(manifest)
    estimates = [
        model.judge(row, None if healthy is None else healthy[i], conditions=noted)
        for i, (row, noted) in enumerate(zip(table.values[rows], notes, strict=True))
    ]
    found = model.predict(table.values[rows], healthy, notes)
    n_grades = len(card.grade_edges_m) + 1
    judged = Judged(
        groups=manifest["group"].to_numpy(),
        truth=manifest[card.severity].to_numpy(dtype=float),
        found=found,
        grade=grades_of(found, card.grade_edges_m),
        graded=np.array([each.graded for each in estimates]),
        cautious=np.array([each.verdict == "caution" for each in estimates]),
        low=_numbers(each.low for each in estimates),
        high=_numbers(each.high for each in estimates),
        possible=np.array(
            [[grade in each.possible_grades for grade in range(n_grades)] for each in estimates]
        ),
    )
    return judged, estimates


def _numbers(values: Iterable[float | None]) -> Float:
    return np.array([np.nan if value is None else value for value in values])


def reliability(
    model: WearModel, judged: Judged, estimates: Sequence[Estimate], draws: Resamples
) -> list[dict[str, Any]]:
    """Coverage of intervals and sets against the nominal one, over the graded records.

    Returns
    -------
    list of dict
        ``nominal``, and ``interval`` and ``set``: shares that contain the truth.
    """
    found = []
    informed = np.array([bool(each.noted) for each in estimates])
    estimators = [(model.blind, ~informed)]
    if model.informed is not None:
        estimators.append((model.informed, informed))
    for nominal in LEVELS:
        held = np.zeros((2, len(judged.truth)), dtype=bool)
        for estimator, rows in estimators:
            for cautious, those in ((False, ~judged.cautious), (True, judged.cautious)):
                held |= _held(estimator, cautious, judged, rows & those, model, nominal)
        shares = [share(each.astype(np.float64), judged.graded, draws) for each in held]
        found.append({"nominal": nominal, "interval": shares[0], "set": shares[1]})
    return found


def _held(
    estimator: Estimator,
    cautious: bool,
    judged: Judged,
    rows: Mask,
    model: WearModel,
    nominal: float,
) -> Mask:
    """Whether interval and set contain the truth, for graded records in `rows` [shape=(2, n)]."""
    edges = model.card.grade_edges_m
    held = np.zeros((2, len(judged.truth)), dtype=bool)
    given = estimator.ends(cautious=cautious)
    ends = estimator.ends(cautious=cautious, coverage=nominal)
    limits = grade_limits(estimator.known(cautious=cautious), edges, nominal)
    for row in np.flatnonzero(judged.graded & rows):
        # the given interval determines the size of the expected error
        size = float(np.log(judged.high[row] / judged.low[row]) / (given.low + given.high))
        low, high = interval(judged.found[row], size, ends)
        true = int(grades_of(judged.truth[row], edges))
        held[0, row] = low <= judged.truth[row] <= high
        held[1, row] = true in grade_set(judged.found[row], size, limits, edges)
    return held


def p_value_shares(estimates: Sequence[Estimate], draws: Resamples) -> list[dict[str, Any]]:
    """Share of records with a novelty p-value at or below each of :data:`P_LEVELS`.

    For familiar records the share is at most the level; for records recognised as unfamiliar it is
    near one.

    Returns
    -------
    list of dict
        ``p`` and ``share``; a record without features counts as p = 0.
    """
    found = np.array([each.p_value or 0.0 for each in estimates])
    return [
        {"p": level, "share": share(found <= level, np.ones(len(found)), draws)}
        for level in P_LEVELS
    ]


def by_confounder(
    manifest: pd.DataFrame,
    *,
    error: Float,
    familiar: NDArray[np.bool_],
    covered: NDArray[np.bool_],
) -> dict[str, dict[str, Any]]:
    """Errors for records with and without faults other than the wear.

    Parameters
    ----------
    manifest : pandas.DataFrame
        Manifest of the judged records.
    error : numpy.ndarray [shape=(n_records,)]
        Error of the severity [m], >= 0.
    familiar, covered : numpy.ndarray [shape=(n_records,)]
        Whether the record was graded, and whether its interval contains the truth.

    Returns
    -------
    dict
        ``none``, each single confounder, and ``combined`` (two or more), if there are such
        records: ``records``, ``unfamiliar`` share, ``mae_all_m``, and over the familiar ones (None
        without any) ``mae_m`` and ``coverage``. Empty if the data set has no confounder.

    Examples
    --------
    >>> manifest = pd.DataFrame({"confounder_leak": [False, True]})
    >>> yes = np.array([True, True])
    >>> rows = by_confounder(manifest, error=np.array([1e-5, 3e-5]), familiar=yes, covered=yes)
    >>> {name: row["mae_m"] for name, row in rows.items()}
    {'none': 1e-05, 'leak': 3e-05}
    """
    present = confounders_in(manifest)
    count = np.sum(list(present.values()), axis=0)
    if not present:
        return {}
    parts = {name: here & (count == 1) for name, here in present.items()}
    parts = {"none": count == 0, **parts, "combined": count > 1}
    return {
        name: _part_scores(error[part], familiar[part], covered[part])
        for name, part in parts.items()
        if part.any()
    }


def by_choice(
    manifest: pd.DataFrame,
    *,
    error: Float,
    familiar: NDArray[np.bool_],
    covered: NDArray[np.bool_],
) -> dict[str, dict[str, Any]]:
    """Errors for each option of the recipe's choices, such as laws and lubrication.

    Parameters
    ----------
    manifest : pandas.DataFrame
        Manifest of the judged records.
    error : numpy.ndarray [shape=(n_records,)]
        Error of the severity [m], >= 0.
    familiar, covered : numpy.ndarray [shape=(n_records,)]
        Whether the record was graded, and whether its interval contains the truth.

    Returns
    -------
    dict
        ``choice: option`` -> as in :func:`by_confounder`; empty if the recipe has no choice.

    Examples
    --------
    >>> manifest = pd.DataFrame({"choice_oil": ["dry", "flooded"]})
    >>> yes = np.array([True, True])
    >>> rows = by_choice(manifest, error=np.array([1e-5, 3e-5]), familiar=yes, covered=yes)
    >>> {name: row["mae_m"] for name, row in rows.items()}
    {'oil: dry': 1e-05, 'oil: flooded': 3e-05}
    """
    found = {}
    for column in (name for name in manifest if str(name).startswith(_CHOICE)):
        taken = manifest[column].fillna("").astype(str).to_numpy()
        for option in sorted(set(taken) - {""}):
            part = taken == option
            name = f"{str(column).removeprefix(_CHOICE)}: {option}"
            found[name] = _part_scores(error[part], familiar[part], covered[part])
    return found


_CHOICE = "choice_"


def _part_scores(
    error: Float, familiar: NDArray[np.bool_], covered: NDArray[np.bool_]
) -> dict[str, Any]:
    graded = bool(familiar.any())
    return {
        "records": len(error),
        "unfamiliar": float(1 - familiar.mean()),
        "mae_all_m": float(error.mean()),
        "mae_m": float(error[familiar].mean()) if graded else None,
        "coverage": float(covered[familiar].mean()) if graded else None,
    }
