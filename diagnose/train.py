"""Fit a wear model to a labelled data set, with its uncertainty and its sense of the familiar."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..datasets.recipe import recorded_scene, wear_limits
from ..datasets.record import Attributes, DataError, DataSet
from ..datasets.splits import check_no_leak, group_folds, group_split
from .estimate import Calibration, LinearSeverity, WearModel
from .grades import grades_of
from .novelty import fit_familiarity
from .tabulate import FeatureTable, Progress, feature_table

Float = NDArray[np.float64]

_PENALTIES = (10.0, 30.0, 100.0, 300.0, 1000.0)  # ridge, for standardised features
_FOLDS = 5
_FEWEST_GROUPS = 10  # two a fold, so that a fold's error is no accident


def train_model(
    path: str | Path,
    *,
    target: str | None = None,
    held_out: float = 0.25,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[WearModel, FeatureTable, NDArray[np.intp]]:
    """Fit a wear model on a data set's training groups.

    Parameters
    ----------
    path : str or Path
        Labelled data set. Of its manifest, only the target and the groups decide the fit: neither
        conditions nor confounders are inputs.
    target : str, optional
        Severity column to train for; the first one of the data set unless given.
    held_out : float
        Share of the groups (machine draws) kept out of every fit, 0 <= share < 1.
    seed : int
        Of the split and the folds.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    model : WearModel
        Regression of log severity, out-of-fold errors, familiarity, card.
    table : FeatureTable
        All usable records.
    test : numpy.ndarray
        Rows of `table` that were held out.

    Raises
    ------
    DataError
        No such severity column, no limits, or too few machine draws.
    """
    with DataSet(path) as data:
        head, draws = data.attributes, data.manifest["group"].nunique()
    aim = _aim(head, target, path)
    _check_draws(draws, path)
    table = feature_table(path, jobs=jobs, progress=progress)
    groups = table.manifest["group"].to_numpy()
    train, test = _split(groups, held_out, seed, path)
    check_no_leak(groups, train, test)
    severity = table.manifest[aim.column].to_numpy(dtype=float)
    regressor, errors = fit_severity(table.values[train], severity[train], groups[train], seed)
    distances = _out_of_fold_distances(table.values[train], groups[train], seed)
    model = WearModel(
        regressor=regressor,
        calibration=Calibration(log_estimate=errors[0], log_error=errors[1], distance=distances),
        familiarity=fit_familiarity(table.values[train]),
        card=_card(head, aim, table, train, held_out, seed),
    )
    return model, table, test


@dataclass(frozen=True, kw_only=True)
class _Aim:
    """The severity to train for, with its wear limits [m]."""

    column: str
    edges: tuple[float, ...]
    condemning: float
    source: str


def _aim(head: Attributes, target: str | None, path: str | Path) -> _Aim:
    if target is not None and target not in head.severities:
        raise DataError(
            f"{path}: target = {target!r} must be one of its severities "
            f"{', '.join(head.severities) or '(it has none)'}; choose another"
        )
    if not head.severities or len(head.grade_edges) == 0:
        raise DataError(
            f"{path}: severities = {list(head.severities)}, grade_edges = {list(head.grade_edges)} "
            "must both be given; label the data set, or generate it from a recipe"
        )
    if target in (None, head.severities[0]):
        return _Aim(
            column=head.severities[0],
            edges=head.grade_edges,
            condemning=head.condemning_limit,
            source=head.limit_source,
        )
    return _further_aim(head, str(target), path)


def _further_aim(head: Attributes, target: str, path: str | Path) -> _Aim:
    """A file holds the limits of its first severity only; those of others are the scene's."""
    scene = recorded_scene(head.scene, head.recipe, head.overrides) if head.scene else None
    limits = None if scene is None else wear_limits(scene, target)
    if limits is None:
        raise DataError(
            f"{path}: {target} has 0 grade edges, must have 3 to be graded; give the scene its "
            f"wear limits, or train for {head.severities[0]}"
        )
    return _Aim(
        column=target,
        edges=limits.grade_edges,
        condemning=limits.condemning,
        source=limits.source,
    )


def _check_draws(draws: int, path: str | Path) -> None:
    if draws < _FEWEST_GROUPS:
        raise DataError(
            f"{path}: {draws} machine draws, must be >= {_FEWEST_GROUPS}; generate more records"
        )


def _split(
    groups: NDArray[Any], held_out: float, seed: int, path: str | Path
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Training and test rows; enough draws for the folds must be left to train on."""
    draws = len(np.unique(groups))
    if not 0 <= held_out < 1:
        raise DataError(f"held_out = {held_out} must be >= 0 and < 1; try 0.25")
    kept = draws - max(1, round(held_out * draws)) if held_out > 0 else draws
    if kept < _FOLDS:
        raise DataError(
            f"{path}: held_out = {held_out} leaves {kept} of {draws} usable machine draws to train "
            f"on, must be >= {_FOLDS}; hold out less or generate more records"
        )
    if held_out == 0:
        return np.arange(len(groups)), np.arange(0)
    return group_split(groups, test_fraction=held_out, seed=seed)


def fit_severity(
    features: Float, severity: Float, groups: NDArray[Any], seed: int
) -> tuple[LinearSeverity, tuple[Float, Float]]:
    """Ridge regression of log severity, its penalty chosen by folds of whole groups.

    Parameters
    ----------
    features : numpy.ndarray [shape=(n, n_features)]
    severity : numpy.ndarray [shape=(n,)]
        [m], > 0.
    groups : numpy.ndarray [shape=(n,)]
        Machine draw of each record; a draw is never in two folds.
    seed : int
        Of the folds.

    Returns
    -------
    regressor : LinearSeverity
        Fitted on all records.
    errors : tuple of numpy.ndarray
        Out-of-fold estimates of log severity, and their errors (truth minus estimate).

    Raises
    ------
    DataError
        A severity is not positive.
    """
    if not (severity > 0).all():
        raise DataError(
            f"severity = {severity.min():g} m must be > 0 in every record; label them all"
        )
    target = np.log(severity)
    folds = _folds(groups, seed)
    trials = [_out_of_fold(penalty, features, target, folds) for penalty in _PENALTIES]
    errors = [float(np.abs(np.exp(trial) - severity).mean()) for trial in trials]
    best = int(np.argmin(errors))
    regressor = _fit_ridge(_PENALTIES[best], features, target)
    return regressor, (trials[best], target - trials[best])


def _fit_ridge(penalty: float, features: Float, target: Float) -> LinearSeverity:
    from sklearn.linear_model import Ridge
    from sklearn.preprocessing import StandardScaler

    scaler = StandardScaler().fit(features)
    ridge = Ridge(penalty).fit(scaler.transform(features), target)
    return LinearSeverity(
        centre=scaler.mean_,
        spread=scaler.scale_,  # one where a feature is constant
        weight=ridge.coef_,
        offset=float(ridge.intercept_),
    )


def _folds(groups: NDArray[Any], seed: int) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    return list(group_folds(groups, n=_FOLDS, seed=seed))


def _out_of_fold(
    penalty: float,
    features: Float,
    target: Float,
    folds: list[tuple[NDArray[np.intp], NDArray[np.intp]]],
) -> Float:
    estimate = np.empty_like(target)
    for train, test in folds:
        fitted = _fit_ridge(penalty, features[train], target[train])
        estimate[test] = fitted.predict(features[test])
    return estimate


def _out_of_fold_distances(features: Float, groups: NDArray[Any], seed: int) -> Float:
    """Novelty distances of records from clouds that their machine draw had no part in."""
    distance = np.empty(len(features))
    for train, test in _folds(groups, seed):
        distance[test] = fit_familiarity(features[train]).distance(features[test])
    return distance


def draw_identity(head: Attributes) -> str:
    """Hash of what decides the machine draws: equal groups of equal identity are one machine.

    Recipes draw from their name and the data set's seed alone, so their texts, record numbers
    and comments do not make other machines. Empty for a set that no recipe made.
    """
    recipe = _name_in(head.recipe)
    return hashlib.sha256(f"{recipe} {head.seed}".encode()).hexdigest() if recipe else ""


def _card(
    head: Attributes,
    aim: _Aim,
    table: FeatureTable,
    train: NDArray[np.intp],
    held_out: float,
    seed: int,
) -> dict[str, Any]:
    """Everything a reader of the model must know, as JSON."""
    manifest = table.manifest.iloc[train]
    severity = manifest[aim.column].to_numpy(dtype=float)
    columns = {name: i for i, name in enumerate(table.names)}
    ranges = {
        name: [
            float(table.values[train, columns[name]].min()),
            float(table.values[train, columns[name]].max()),
        ]
        for name in table.names
        if name == "shaft.speed_hz" or name.endswith(".rms")
    }
    return {
        "created_by": f"wearstate {__version__}",
        "origin": head.origin,
        "trained_on": {
            "records": len(train),
            "draws": int(manifest["group"].nunique()),
            "draw_identity": draw_identity(head),
            "held_out_share": held_out,
            "split_seed": seed,
            "training_groups": sorted({int(g) for g in manifest["group"]}),
            "training_signals": sorted({int(crc) for crc in manifest["signal_crc32"]}),
            "scene": _name_in(head.scene),
            "recipe": _name_in(head.recipe),
        },
        "severity": aim.column,
        "severity_range_m": [float(severity.min()), float(severity.max())],
        "grade_edges_m": list(aim.edges),
        "condemning_limit_m": aim.condemning,
        "limit_source": aim.source,
        "sample_rate_hz": head.sample_rate,
        "channels": [asdict(channel) for channel in head.channels],
        "tacho": head.tacho,
        "pulses_per_revolution": head.pulses_per_revolution,
        "features": list(table.names),
        "condition_ranges": ranges,
        "healthy_features": _healthy(table.values[train], grades_of(severity, aim.edges)),
    }


def _healthy(values: Float, grade: NDArray[Any]) -> dict[str, list[float]]:
    """Mean and spread of the features of as-new machines, the reference of the evidence."""
    rows = values[grade == 0] if (grade == 0).any() else values
    return {"mean": rows.mean(axis=0).tolist(), "spread": rows.std(axis=0).tolist()}


def _name_in(toml_text: str) -> str:
    import tomllib

    try:
        return str(tomllib.loads(toml_text).get("name", ""))
    except tomllib.TOMLDecodeError:
        return ""
