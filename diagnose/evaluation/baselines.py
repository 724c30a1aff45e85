"""Baselines of a wear model: the majority, one rms, and two generic third-party methods."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.split.rules import group_folds
from ..feature_rows.feature_table import FeatureTable
from ..learning.grades import grades_of
from ..learning.scores import Judged, Resamples, figures, point_judged, share
from .foreign_features import LEFT_OUT, absence

Float = NDArray[np.float64]
Index = NDArray[np.intp]

FOLDS = 5
"""Number of folds of whole machines for each configuration of each baseline."""

_SEED = 0


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Predictions of a baseline.

    Attributes
    ----------
    severity : numpy.ndarray [shape=(n,)]
        [m]
    grade : numpy.ndarray [shape=(n,)]
    """

    severity: Float
    grade: Index


Fitted = Callable[[Float], Prediction]
Fit = Callable[[Float, Float, Index, Sequence[float]], Fitted]
"""Features, severity [m], grade, grade edges [m] -> a fitted baseline."""

Change = Callable[[Float], Float]
"""Features -> inputs of the regression."""


@dataclass(frozen=True, kw_only=True)
class BaselineMethod:
    """One row of :data:`BASELINES`.

    Attributes
    ----------
    name : str
    text : str
        Method and settings, in words.
    source : {"none", "rms", "tsfel", "minirocket"}
        Source of its features.
    configurations : callable
        Number of feature columns -> fits, to be selected in folds of whole machines.
    prepare : callable
        Training features, without labels -> transform of features before every fit.
    """

    name: str
    text: str
    source: str
    configurations: Callable[[int], list[Fit]]
    prepare: Callable[[Float], Change]


def choose(
    baseline: BaselineMethod,
    features: Float,
    severity: Float,
    groups: NDArray[Any],
    edges: Sequence[float],
    *,
    seed: int = 0,
) -> tuple[Fitted, int]:
    """Fit a baseline, with its configuration selected in folds of whole machines.

    Parameters
    ----------
    baseline : BaselineMethod
    features : numpy.ndarray [shape=(n, n_features)]
    severity : numpy.ndarray [shape=(n,)]
        [m], > 0.
    groups : numpy.ndarray [shape=(n,)]
        Machine of each record; with fewer than two, the first configuration is used.
    edges : sequence of float
        Grade edges [m].
    seed : int
        Seed of the folds.

    Returns
    -------
    fitted : callable
        Features -> :class:`Prediction`.
    configurations : int
        Number of configurations compared by their out-of-fold mean absolute error.

    Examples
    --------
    >>> wear = np.linspace(1e-4, 4e-4, 40)
    >>> fitted, tried = choose(BASELINES[0], wear[:, None], wear, np.arange(40), [2e-4])
    >>> tried, fitted(wear[:2, None]).grade.tolist()
    (1, [1, 1])
    """
    fits = baseline.configurations(features.shape[1])
    grade = grades_of(severity, edges)
    change = baseline.prepare(features)
    features = change(features)
    if len(fits) == 1 or len(np.unique(groups)) < 2:
        return _after(change, fits[0](features, severity, grade, edges)), 1
    folds = group_folds(groups, n=min(FOLDS, len(np.unique(groups))), seed=seed)
    errors = [_out_of_fold_error(fit, features, severity, grade, edges, folds) for fit in fits]
    best = fits[int(np.argmin(errors))]
    return _after(change, best(features, severity, grade, edges)), len(fits)


def _after(change: Change, fitted: Fitted) -> Fitted:
    return lambda rows: fitted(change(rows))


def _out_of_fold_error(
    fit: Fit,
    features: Float,
    severity: Float,
    grade: Index,
    edges: Sequence[float],
    folds: list[tuple[Index, Index]],
) -> float:
    error = np.empty_like(severity)
    for train, test in folds:
        fitted = fit(features[train], severity[train], grade[train], edges)
        error[test] = np.abs(fitted(features[test]).severity - severity[test])
    return float(error.mean())


# --- the methods ----------------------------------------------------------------------------------


def _majority(_columns: int) -> list[Fit]:
    def fit(_features: Float, severity: Float, grade: Index, _edges: Sequence[float]) -> Fitted:
        common, middle = int(np.bincount(grade).argmax()), float(np.median(severity))
        return lambda rows: Prediction(
            severity=np.full(len(rows), middle), grade=np.full(len(rows), common)
        )

    return [fit]


def _single_rms(columns: int) -> list[Fit]:
    # three thresholds separate four grades; more allow an rms that is not monotonic in the wear
    return [_rms_fit(column, depth) for column in range(columns) for depth in (2, 4)]


def _rms_fit(column: int, depth: int) -> Fit:
    from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor

    settings = {"max_depth": depth, "min_samples_leaf": 5, "random_state": _SEED}

    def fit(features: Float, severity: Float, grade: Index, _edges: Sequence[float]) -> Fitted:
        mine = features[:, [column]]
        size = DecisionTreeRegressor(**settings).fit(mine, severity)
        kind = DecisionTreeClassifier(**settings).fit(mine, grade)
        return lambda rows: Prediction(
            severity=size.predict(rows[:, [column]]), grade=kind.predict(rows[:, [column]])
        )

    return fit


_TREES = 100  # doubling the number changes the error by less than its interval


def _trees(_columns: int) -> list[Fit]:
    from sklearn.ensemble import ExtraTreesRegressor

    def forest(share: float, leaf: int) -> Any:
        return ExtraTreesRegressor(
            _TREES, max_features=share, min_samples_leaf=leaf, random_state=_SEED
        )

    return [
        _regression(
            partial(forest, share, leaf),
            logarithmic=True,
        )
        for share in (0.03, 0.1, 0.2, 0.35, 0.5)
        for leaf in (1, 3)
    ]


def _ridge(_columns: int) -> list[Fit]:
    from sklearn.linear_model import Ridge

    return [
        _regression(partial(Ridge, penalty), logarithmic=logarithmic)
        for penalty in (3e1, 3e2, 3e3, 3e4, 3e5)
        for logarithmic in (True, False)
    ]


def _unchanged(_features: Float) -> Change:
    return lambda rows: rows


def _rotated(features: Float) -> Change:
    """Standardise features and rotate them into the space that the training rows span.

    A ridge regression is the same there, up to rounding, and takes a tenth of the time if there
    are many more features than rows.
    """
    centre, spread = features.mean(axis=0), features.std(axis=0)
    scale = np.divide(1.0, spread, out=np.zeros_like(spread), where=spread > 0)
    standard = (features - centre) * scale
    if features.shape[1] <= features.shape[0]:
        return lambda rows: (rows - centre) * scale
    square, left = np.linalg.eigh(standard @ standard.T)
    kept = square > _ROUNDING * square[-1]
    axes = standard.T @ (left[:, kept] / np.sqrt(square[kept]))
    return lambda rows: ((rows - centre) * scale) @ axes


_ROUNDING = 1e-10  # of the largest eigenvalue: smaller ones are due to rounding


def _regression(make: Callable[[], Any], *, logarithmic: bool) -> Fit:
    def fit(features: Float, severity: Float, _grade: Index, edges: Sequence[float]) -> Fitted:
        target = np.log(severity) if logarithmic else severity / severity.max()
        model = make().fit(features, target)

        def predict(rows: Float) -> Prediction:
            found = np.asarray(model.predict(rows), dtype=float)
            # a wear beyond twice the largest in training is not credible
            found = np.exp(found) if logarithmic else found * severity.max()
            found = np.clip(found, 0, 2 * severity.max())
            return Prediction(severity=found, grade=grades_of(found, edges))

        return predict

    return fit


BASELINES = (
    BaselineMethod(
        name="majority",
        text="the most frequent grade and the median severity of the training records",
        source="none",
        configurations=_majority,
        prepare=_unchanged,
    ),
    BaselineMethod(
        name="single_rms",
        text="thresholds on the rms of one channel, channel and depth (2, 4) chosen by folds",
        source="rms",
        configurations=_single_rms,
        prepare=_unchanged,
    ),
    BaselineMethod(
        name="tsfel",
        text="all default TSFEL features of every channel and the speed, 100 extra-trees; share of "
        "features (.03, .1, .2, .35, .5) and least leaf (1, 3) chosen by folds",
        source="tsfel",
        configurations=_trees,
        prepare=_unchanged,
    ),
    BaselineMethod(
        name="minirocket",
        text="MiniRocket of aeon, 9,996 kernels over all channels, and the speed; ridge, penalty "
        "(3e1 to 3e5) and target (severity or its logarithm) chosen by folds",
        source="minirocket",
        configurations=_ridge,
        prepare=_rotated,
    ),
)
"""All baselines. A new one is one row."""


# --- the contest ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Side:
    """Records to train or to judge baselines on.

    Attributes
    ----------
    features : mapping
        Source -> features [shape=(n, n_features)], or the reason for their absence.
    severity : numpy.ndarray [shape=(n,)]
        [m]
    groups : numpy.ndarray [shape=(n,)]
        Machine of each record.
    fitted : dict
        Fitted baselines with the number of configurations tried, by name: tuning one takes
        minutes, and a side may be used in many comparisons.
    """

    features: Mapping[str, Float | str]
    severity: Float
    groups: NDArray[Any]
    fitted: dict[str, tuple[Fitted, int]] = field(default_factory=dict)


def side_of(
    table: FeatureTable,
    severity: str,
    rows: Index,
    foreign: Mapping[str, Float | str] | None = None,
) -> Side:
    """Make a side from rows of a feature table.

    Parameters
    ----------
    table : FeatureTable
    severity : str
        Severity column of its manifest.
    rows : numpy.ndarray
    foreign : mapping, optional
        Source -> features of all rows of the table [shape=(n_records, n_features)], or the reason
        for their absence. The shaft speed is added as a column if the table has it.

    Returns
    -------
    Side
    """
    speed = table.values[:, [name == "shaft.speed_hz" for name in table.names]]
    levels = table.values[:, [name.endswith(".rms") for name in table.names]]
    found: dict[str, Float | str] = {"none": np.zeros((len(rows), 1))}
    found["rms"] = levels[rows] if levels.size else "no channel has an rms among its features"
    for source, values in (foreign or {}).items():
        whole = values if isinstance(values, str) else np.hstack([values, speed])[rows]
        found[source] = whole
    manifest = table.manifest.iloc[rows]
    return Side(
        features=found,
        severity=manifest[severity].to_numpy(dtype=float),
        groups=manifest["group"].to_numpy(),
    )


def compare_baselines(
    train: Side | None,
    test: Side,
    ours: Judged,
    edges: Sequence[float],
    limit: float,
    draws: Resamples,
    *,
    seed: int = 0,
) -> dict[str, dict[str, Any]]:
    """Evaluate every baseline on the records used for a model.

    Parameters
    ----------
    train : Side or None
        None: every baseline is trained and judged in folds of whole machines of `test`, which
        favours it. A side can be reused with the same edges and seed.
    test : Side
    ours : Judged
        Results of the model on the same records.
    edges : sequence of float
        Grade edges [m].
    limit : float
        Condemning limit [m].
    draws : Resamples
        Resamples of the records of `test`.
    seed : int
        Seed of the folds.

    Returns
    -------
    dict
        Name -> ``text``, and either ``missing`` (why it did not run) or those figures of
        :func:`wearstate.diagnose.learning.scores.figures` that need no intervals,
        ``configurations``, ``folds``, ``flattered`` and the difference of the mean error, model
        minus baseline, over the limit: ``difference`` over the records that the model graded,
        ``difference_all`` over all.
    """
    return {
        baseline.name: {
            "text": baseline.text,
            **_entry(baseline, train, test, ours, edges, limit, draws, seed),
        }
        for baseline in BASELINES
    }


def _entry(
    baseline: BaselineMethod,
    train: Side | None,
    test: Side,
    ours: Judged,
    edges: Sequence[float],
    limit: float,
    draws: Resamples,
    seed: int,
) -> dict[str, Any]:
    sides = [side for side in (train, test) if side is not None]
    why = [_absence(baseline, side) for side in sides]
    if any(why):
        return {"missing": next(filter(None, why))}
    if train is None and len(np.unique(test.groups)) < 2:
        return {"missing": "nothing to train it on: one machine only"}
    predicted, tried = _predicted(baseline, train, test, edges, seed)
    judged = point_judged(
        test.groups,
        test.severity,
        predicted.severity,
        predicted.grade,
        len(edges) + 1,
        graded=ours.graded,
    )
    difference = np.abs(ours.found - ours.truth) - np.abs(judged.found - judged.truth)
    return {
        "missing": "",
        **{k: v for k, v in figures(judged, edges, limit, draws).items() if k in _POINT_FIGURES},
        "configurations": tried,
        "folds": FOLDS,
        "flattered": train is None,
        "difference": share(difference * ours.graded / limit, ours.graded, draws),
        "difference_all": share(difference / limit, np.ones(len(difference)), draws),
    }


_POINT_FIGURES = (
    "mae_m",
    "mae_share_of_limit",
    "accuracy",
    "accuracy_far",
    "within_one_grade",
    "mean_grade_error",
    "kappa",
    "false_alarm",
    "missed_fault",
    "mae_all_m",
    "mae_all_share_of_limit",
)


def _absence(baseline: BaselineMethod, side: Side) -> str:
    """Why a side has no features for a baseline; empty if it has."""
    found = side.features.get(baseline.source)
    if found is None:
        return absence(baseline.source) or LEFT_OUT
    return found if isinstance(found, str) else ""


def _predicted(
    baseline: BaselineMethod, train: Side | None, test: Side, edges: Sequence[float], seed: int
) -> tuple[Prediction, int]:
    """Predictions of the test side, and the number of configurations tried."""
    rows = np.asarray(test.features[baseline.source])
    if train is not None:
        if baseline.name not in train.fitted:
            known = np.asarray(train.features[baseline.source])
            mine = train.severity, train.groups
            train.fitted[baseline.name] = choose(baseline, known, *mine, edges, seed=seed)
        fitted, tried = train.fitted[baseline.name]
        return fitted(rows), tried
    severity, grade, tried = np.empty(len(rows)), np.empty(len(rows), dtype=np.intp), 0
    folds = min(FOLDS, len(np.unique(test.groups)))
    for known, held in group_folds(test.groups, n=folds, seed=seed):
        mine = test.severity[known], test.groups[known]
        fitted, tried = choose(baseline, rows[known], *mine, edges, seed=seed)
        predicted = fitted(rows[held])
        severity[held], grade[held] = predicted.severity, predicted.grade
    return Prediction(severity=severity, grade=grade), tried
