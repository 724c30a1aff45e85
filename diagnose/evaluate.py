"""How good is a wear model on machines it has not seen, and against what."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..datasets.record import DataError, DataSet
from ..datasets.splits import group_folds
from .estimate import Estimate, WearModel
from .grades import accuracy_bound, grades_of
from .tabulate import FeatureTable, Progress, confounders_in, feature_table
from .train import draw_identity

Float = NDArray[np.float64]

_FOLDS = 5
_TREE_DEPTH = 4  # 15 thresholds on one rms: more than three grades need, and no more than helps


def evaluate_model(
    model: WearModel,
    path: str | Path,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Judge a model on a data set, on machine draws that it was not trained on.

    Parameters
    ----------
    model : WearModel
    path : str or Path
        Labelled data set. Where its machine draws are those of the training set, only the draws
        held out there are used.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    dict
        As :func:`score`.

    Raises
    ------
    DataError
        The severity of the model is not labelled, its features are others, or no unseen machine
        draw is left.
    """
    with DataSet(path) as data:
        head = data.attributes
    if model.card["severity"] not in head.severities:
        raise DataError(
            f"{path}: severities = {list(head.severities)}, must hold {model.card['severity']}; "
            "label the data set"
        )
    table = feature_table(path, jobs=jobs, progress=progress)
    rows = unseen_rows(model, table, draw_identity(head), path)
    return score(model, table, rows)


def unseen_rows(
    model: WearModel, table: FeatureTable, identity: str, path: str | Path
) -> NDArray[np.intp]:
    """Rows of machine draws that the model was not trained on.

    A draw is seen where recipe name and seed are those of the training set and its number was in
    training, or where any of its signals is, byte for byte, a training signal.

    Raises
    ------
    DataError
        None is left, or the features are not the model's.
    """
    if list(table.names) != model.card["features"]:
        raise DataError(
            f"{path}: its {len(table.names)} features are not the model's "
            f"{len(model.card['features'])}; use recordings with the model's channels and rate"
        )
    trained = model.card["trained_on"]
    groups = table.manifest["group"]
    known = table.manifest["signal_crc32"].isin(trained["training_signals"])
    seen = groups.isin(groups[known])
    if identity and identity == trained["draw_identity"]:
        seen |= groups.isin(trained["training_groups"])
    rows = np.flatnonzero(~seen)
    if rows.size == 0:
        raise DataError(
            f"{path}: 0 machine draws that the model has not seen, must be > 0; train with "
            "--held-out 0.25, or generate with another --seed"
        )
    return rows


def score(model: WearModel, table: FeatureTable, rows: NDArray[np.intp]) -> dict[str, Any]:
    """Errors, coverage and baselines on some rows of a table.

    Parameters
    ----------
    model : WearModel
    table : FeatureTable
        With the model's features and its severity.
    rows : numpy.ndarray
        Rows to judge on; the others serve to fit the baselines.

    Returns
    -------
    dict
        ``records``, ``draws``, ``unfamiliar`` share; ``mae_all_m`` over all records, whatever
        their familiarity; over the records called familiar, None where there is none: ``mae_m``,
        ``mae_share_of_limit``, ``accuracy`` with ``accuracy_bound`` (about what the error in
        metres allows), ``within_one_grade``, ``coverage`` with ``nominal_coverage`` and
        ``mean_set_size``, ``confusion`` (true grade by row); ``baselines`` (accuracy of the
        majority grade and of the best single rms); ``by_confounder`` as :func:`by_confounder`.
    """
    truth = table.manifest[model.card["severity"]].to_numpy(dtype=float)
    edges = model.card["grade_edges_m"]
    estimates = [model.judge(table.values[row]) for row in rows]
    graded = [(row, e) for row, e in zip(rows, estimates, strict=True) if e.verdict == "graded"]
    # an unfamiliar row may be estimated at any length: e^50 m is absurd enough to average
    raw = np.exp(np.clip(model.regressor.predict(table.values[rows]), -50, 50))
    return {
        "records": len(rows),
        "draws": int(table.manifest["group"].iloc[rows].nunique()),
        "unfamiliar": 1 - len(graded) / len(rows),
        "mae_all_m": float(np.abs(raw - truth[rows]).mean()),
        **_graded_scores(model, truth, graded),
        "baselines": baselines(table, grades_of(truth, edges), rows),
        "by_confounder": by_confounder(
            table.manifest.iloc[rows],
            error=np.abs(raw - truth[rows]),
            familiar=np.array([e.verdict == "graded" for e in estimates]),
            covered=np.array([_covers(e, t) for e, t in zip(estimates, truth[rows], strict=True)]),
        ),
    }


def _covers(estimate: Estimate, truth: float) -> bool:
    if estimate.low is None or estimate.high is None:
        return False
    return estimate.low <= truth <= estimate.high


def by_confounder(
    manifest: pd.DataFrame,
    *,
    error: Float,
    familiar: NDArray[np.bool_],
    covered: NDArray[np.bool_],
) -> dict[str, dict[str, Any]]:
    """Errors apart for records with and without faults that are not the wear.

    Parameters
    ----------
    manifest : pandas.DataFrame
        Of the records judged.
    error : numpy.ndarray [shape=(n_records,)]
        Of the severity [m], >= 0.
    familiar, covered : numpy.ndarray [shape=(n_records,)]
        Whether the record was graded, and whether its interval holds the truth.

    Returns
    -------
    dict
        ``none``, each confounder that is alone, and ``combined`` (two or more), as far as there
        are such records: ``records``, ``unfamiliar`` share, ``mae_all_m``, and over the familiar
        ones (None without any) ``mae_m`` and ``coverage``. Empty where the data set has no
        confounder.

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


def confounder_lines(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Errors by confounder as lines for a terminal; none where there are no confounders.

    Parameters
    ----------
    rows : mapping
        From :func:`by_confounder`.

    Examples
    --------
    >>> row = {"records": 8, "unfamiliar": 0.25, "mae_m": 2e-5, "coverage": 1.0}
    >>> print(*confounder_lines({"none": row}), sep=chr(10))
      confounder  records  unfamiliar  mean error  coverage
      none              8      25.0 %     20.0 um     1.000
    """
    if not rows:
        return []
    width = max(len(name) for name in (*rows, "confounder"))
    head = f"  {'confounder':{width}}  records  unfamiliar  mean error  coverage"
    return [head, *(_part_line(name, row, width) for name, row in rows.items())]


def _part_line(name: str, row: Mapping[str, Any], width: int) -> str:
    share = 100 * row["unfamiliar"]
    line = f"  {name.replace('_', ' '):{width}}  {row['records']:7}  {share:8.1f} %"
    if row["mae_m"] is None:
        return f"{line}  none is familiar"
    return f"{line}  {1e6 * row['mae_m']:7.1f} um  {row['coverage']:8.3f}"


_GRADED_SCORES = (
    "mae_m",
    "mae_share_of_limit",
    "accuracy",
    "accuracy_bound",
    "within_one_grade",
    "coverage",
    "nominal_coverage",
    "mean_set_size",
    "confusion",
)


def _graded_scores(
    model: WearModel, truth: Float, graded: list[tuple[np.intp, Estimate]]
) -> dict[str, Any]:
    if not graded:
        return dict.fromkeys(_GRADED_SCORES)
    edges, limit = model.card["grade_edges_m"], model.card["condemning_limit_m"]
    true = truth[[row for row, _ in graded]]
    found = np.array([e.severity for _, e in graded], dtype=float)
    true_grade, grade = grades_of(true, edges), grades_of(found, edges)
    error = float(np.abs(found - true).mean())
    inside = [e.low <= t <= e.high for t, (_, e) in zip(true, graded, strict=True)]
    values = (
        error,
        error / limit,
        float(np.mean(grade == true_grade)),
        accuracy_bound(true, edges, error),
        float(np.mean(np.abs(grade - true_grade) <= 1)),
        float(np.mean(inside)),
        float(np.mean([e.coverage for _, e in graded])),
        float(np.mean([len(e.possible_grades) for _, e in graded])),
        _confusion(true_grade, grade, len(edges) + 1),
    )
    return dict(zip(_GRADED_SCORES, values, strict=True))


def _confusion(true: NDArray[np.intp], found: NDArray[np.intp], n: int) -> list[list[int]]:
    counts = np.zeros((n, n), dtype=int)
    np.add.at(counts, (true, found), 1)
    return counts.tolist()


def baselines(
    table: FeatureTable, grade: NDArray[np.intp], rows: NDArray[np.intp], *, seed: int = 0
) -> dict[str, float]:
    """Accuracy of what costs nothing: the majority grade, and thresholds on one channel's rms.

    Parameters
    ----------
    table : FeatureTable
    grade : numpy.ndarray [shape=(n_records,)]
        True grades.
    rows : numpy.ndarray
        Rows judged. The thresholds are fitted on all other rows, or, where there are none, by
        folds of whole machine draws.
    seed : int
        Of the folds.

    Returns
    -------
    dict
        ``majority`` and ``single_rms`` (the best channel, which flatters the baseline).
    """
    result = {"majority": float(np.bincount(grade[rows]).max() / len(rows))}
    columns = [i for i, name in enumerate(table.names) if name.endswith(".rms")]
    sides = _baseline_sides(table.manifest["group"].to_numpy(), rows, seed)
    if sides and columns:
        result["single_rms"] = max(
            _tree_accuracy(table.values[:, [column]], grade, sides, seed) for column in columns
        )
    return result


def _baseline_sides(
    groups: NDArray[Any], rows: NDArray[np.intp], seed: int
) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    others = np.setdiff1d(np.arange(len(groups)), rows)
    if others.size:
        return [(others, rows)]
    folds = min(_FOLDS, len(np.unique(groups)))
    return list(group_folds(groups, n=folds, seed=seed)) if folds > 1 else []


def _tree_accuracy(
    column: Float,
    grade: NDArray[np.intp],
    sides: list[tuple[NDArray[np.intp], NDArray[np.intp]]],
    seed: int,
) -> float:
    from sklearn.tree import DecisionTreeClassifier

    right = 0
    for train, test in sides:
        tree = DecisionTreeClassifier(
            max_depth=_TREE_DEPTH, min_samples_leaf=5, random_state=seed
        ).fit(column[train], grade[train])
        right += int((tree.predict(column[test]) == grade[test]).sum())
    return right / sum(len(test) for _, test in sides)
