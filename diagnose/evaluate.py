"""How good is a wear model on machines it has not seen, and against what."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..datasets.record import DataError, DataSet
from ..datasets.splits import group_folds
from .estimate import WearModel
from .grades import accuracy_bound, grades_of
from .tabulate import FeatureTable, Progress, feature_table
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
    if identity != model.card["trained_on"]["draw_identity"]:
        return np.arange(len(table.values))
    seen = np.isin(table.manifest["group"], model.card["trained_on"]["training_groups"])
    rows = np.flatnonzero(~seen)
    if rows.size == 0:
        raise DataError(
            f"{path}: 0 machine draws that the model has not seen, must be > 0; train with "
            "--held-out 0.25, or generate with another --seed"
        )
    return rows


def score(model: WearModel, table: FeatureTable, rows: NDArray[np.intp]) -> dict[str, Any]:
    """Errors, coverage and baselines on some rows of a table.

    Returns
    -------
    dict
        ``records``, ``draws``; over the records called familiar: ``mae_m``,
        ``mae_share_of_limit``, ``accuracy`` with ``accuracy_bound`` (what the error in metres
        allows), ``within_one_grade``, ``coverage`` with ``mean_set_size``; ``unfamiliar`` share;
        ``confusion`` (true grade by row); ``baselines`` (accuracy of the majority grade and of
        the best single rms, by folds of whole groups over the whole table).
    """
    truth = table.manifest[model.card["severity"]].to_numpy(dtype=float)
    edges, limit = model.card["grade_edges_m"], model.card["condemning_limit_m"]
    estimates = [model.judge(table.values[row]) for row in rows]
    graded = [(row, e) for row, e in zip(rows, estimates, strict=True) if e.verdict == "graded"]
    if not graded:
        raise DataError("every recording is unfamiliar to the model; train on this machine")
    true = truth[[row for row, _ in graded]]
    found = np.array([e.severity for _, e in graded], dtype=float)
    true_grade, grade = grades_of(true, edges), grades_of(found, edges)
    error = float(np.abs(found - true).mean())
    inside = [e.low <= t <= e.high for t, (_, e) in zip(true, graded, strict=True)]
    return {
        "records": len(rows),
        "draws": int(table.manifest["group"].iloc[rows].nunique()),
        "unfamiliar": 1 - len(graded) / len(rows),
        "mae_m": error,
        "mae_share_of_limit": error / limit,
        "accuracy": float(np.mean(grade == true_grade)),
        "accuracy_bound": accuracy_bound(true, edges, error),
        "within_one_grade": float(np.mean(np.abs(grade - true_grade) <= 1)),
        "coverage": float(np.mean(inside)),
        "nominal_coverage": graded[0][1].coverage,
        "mean_set_size": float(np.mean([len(e.possible_grades) for _, e in graded])),
        "confusion": _confusion(true_grade, grade, len(edges) + 1),
        "baselines": baselines(table, grades_of(truth, edges)),
    }


def _confusion(true: NDArray[np.intp], found: NDArray[np.intp], n: int) -> list[list[int]]:
    counts = np.zeros((n, n), dtype=int)
    np.add.at(counts, (true, found), 1)
    return counts.tolist()


def baselines(table: FeatureTable, grade: NDArray[np.intp], *, seed: int = 0) -> dict[str, float]:
    """Accuracy of what costs nothing: the majority grade, and thresholds on one channel's rms.

    Parameters
    ----------
    table : FeatureTable
    grade : numpy.ndarray [shape=(n_records,)]
        True grades.
    seed : int
        Of the folds.

    Returns
    -------
    dict
        ``majority`` and ``single_rms`` (the best channel, flattering the baseline).
    """
    from sklearn.tree import DecisionTreeClassifier

    groups = table.manifest["group"].to_numpy()
    folds = min(_FOLDS, len(np.unique(groups)))
    result = {"majority": float(np.bincount(grade).max() / len(grade))}
    columns = [i for i, name in enumerate(table.names) if name.endswith(".rms")]
    if folds < 2 or not columns:
        return result
    accuracies = []
    for column in columns:
        right = 0
        for train, test in group_folds(groups, n=folds, seed=seed):
            tree = DecisionTreeClassifier(
                max_depth=_TREE_DEPTH, min_samples_leaf=5, random_state=seed
            ).fit(table.values[train][:, [column]], grade[train])
            right += int((tree.predict(table.values[test][:, [column]]) == grade[test]).sum())
        accuracies.append(right / len(grade))
    return {**result, "single_rms": max(accuracies)}
