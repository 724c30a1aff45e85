"""Do intervals and sets cover what they claim, on machines that were not trained on?

For each of so many random splits of a data set's machines: train on three quarters, judge the rest.
Prints coverage and size of intervals and grade sets, the shares of each grade, the error, and the
share called unfamiliar; then their means.

    python tests/benchmarks/conformal_coverage.py DATA [--splits 20] [--budget-ms 5] [--target NAME]
"""

import argparse
from dataclasses import dataclass

import numpy as np
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.split.rules import group_split
from wearstate.diagnose.familiarity.novelty import novelty_p_value
from wearstate.diagnose.feature_rows.feature_table import feature_table
from wearstate.diagnose.learning.conformal import (
    grade_limits,
    grade_set,
    interval,
    scale_inputs,
    tails,
)
from wearstate.diagnose.learning.grades import grades_of
from wearstate.diagnose.wear_model.learn import learn
from wearstate.diagnose.wear_model.training_rows import TrainingRows


@dataclass(frozen=True, kw_only=True)
class Task:
    """Labelled feature rows with the limits of their severity [m]."""

    names: tuple[str, ...]
    rows: np.ndarray
    severity: np.ndarray
    groups: np.ndarray
    edges: tuple[float, ...]
    limit: float


def figures_of(task, seed, budget_ms=None):
    """Figures of merit of one split.

    Returns
    -------
    dict
        Name -> share, or size.
    """
    train, test = group_split(task.groups, test_fraction=0.25, seed=seed)
    training = TrainingRows(
        names=task.names,
        rows=task.rows[train],
        baseline=None,
        severity=task.severity[train],
        groups=task.groups[train],
    )
    learnt = learn(training, seed=seed, budget_ms=budget_ms)
    found = learnt.blind
    rows, truth = task.rows[test], task.severity[test]
    estimate, apart = found.severity.predict(rows), found.severity.disagreement(rows)
    distance = learnt.familiarity.distance(task.names, rows)
    scale = found.scale.predict(scale_inputs(estimate, distance, apart))
    ends, limits = tails(found.calibration), grade_limits(found.calibration, task.edges)
    pairs = list(zip(estimate.tolist(), scale.tolist(), strict=True))
    low, high = np.array([interval(*pair, ends) for pair in pairs]).T
    sets = [grade_set(*pair, limits, task.edges) for pair in pairs]
    grade = grades_of(truth, task.edges)
    held = np.array([g in told for g, told in zip(grade, sets, strict=True)])
    p_value = np.array([novelty_p_value(d, found.calibration.distance) for d in distance])
    return {
        "interval": np.mean((low <= truth) & (truth <= high)),
        "width_of_limit": np.mean(high - low) / task.limit,
        "set": held.mean(),
        "set_size": np.mean([len(told) for told in sets]),
        "smallest_set": min(len(told) for told in sets),
        **{f"set_grade_{g}": held[grade == g].mean() for g in range(len(task.edges) + 1)},
        "mae_of_limit": np.abs(estimate - truth).mean() / task.limit,
        "unfamiliar": np.mean(p_value <= 0.01),
    }


def task_of(path, target=None, jobs=2):
    """Features and labels of a data set."""
    with DataSet(path) as data:
        head = data.attributes
    table = feature_table(path, jobs=jobs)
    return Task(
        names=table.names,
        rows=table.values,
        severity=table.manifest[target or head.severities[0]].to_numpy(dtype=float),
        groups=table.manifest["group"].to_numpy(),
        edges=head.grade_edges,
        limit=head.condemning_limit,
    )


def campaign(task, splits, budget_ms=None):
    """Mean of every figure over the splits; each is printed as it comes."""
    rows = []
    for seed in range(splits):
        rows.append(figures_of(task, seed, budget_ms))
        print(seed, *(f"{name} {value:.3f}" for name, value in rows[-1].items()), flush=True)
    means = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
    print("mean", *(f"{name} {value:.3f}" for name, value in means.items()), flush=True)
    return means


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data")
    parser.add_argument("--splits", type=int, default=20)
    parser.add_argument("--budget-ms", type=float)
    parser.add_argument("--target")
    given = parser.parse_args()
    campaign(task_of(given.data, given.target), given.splits, given.budget_ms)


if __name__ == "__main__":
    main()
