"""Speed against accuracy of the diagnosis: features times models, on held-out machines."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.record import DataSet
from ...datasets.split.rules import group_folds
from ...features.catalogue.needs import Layout
from ...features.catalogue.row import absent_features, catalogue, feature_names, feature_row
from ...sim.fidelity.differences import Difference
from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_table import FeatureTable, Progress, feature_table, recording_layout
from ..learning.grades import GRADE_NAMES, grades_of
from .chart import Chart, Clock, Point, front_of

Float = NDArray[np.float64]

_FOLDS = 5
_RUNS = 3  # of everything that is timed; the shortest counts
_TIMED = 3  # recordings
_TREES = 100

FEATURE_GROUPS: dict[str, tuple[str, ...]] = {
    "rms": ("rms",),
    "statistics": (
        "rms",
        "peak",
        "crest_factor",
        "kurtosis",
        "skewness",
        "shape_factor",
        "impulse_factor",
    ),
    "bands": ("band_levels",),
    "bands and orders": ("band_levels", "order_levels", "speed"),
    "angle map": ("crank_angle_map", "speed"),
    "orbit": ("centreline", "largest_excursion", "filtered_orbits", "orbit_shapes", "whirl"),
    "all": (),
}
"""Group -> rows of the catalogue; an empty group stands for all rows."""


def _ridge(_seed: int) -> Any:
    from sklearn.linear_model import RidgeCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), RidgeCV(alphas=(10.0, 30.0, 100.0, 300.0, 1000.0)))


def _extra_trees(seed: int) -> Any:
    from sklearn.ensemble import ExtraTreesRegressor

    return ExtraTreesRegressor(_TREES, min_samples_leaf=2, random_state=seed)


def _boosting(seed: int) -> Any:
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(max_iter=_TREES, random_state=seed)


MODELS: dict[str, Callable[[int], Any]] = {
    "ridge": _ridge,
    "extra-trees": _extra_trees,
    "boosting": _boosting,
}
"""Regressors of log severity. A new candidate is one row."""


def model_chart(
    path: str | Path,
    *,
    seed: int = 0,
    jobs: int = 1,
    budget: float | None = None,
    clock: Clock = time.perf_counter,
    progress: Progress | None = None,
) -> Chart:
    """Measure every group of features with every model on a labelled data set.

    Parameters
    ----------
    path : str or Path
        Data set with a severity and its condemning limit.
    seed : int
        Seed of folds and models.
    jobs : int
        Worker processes for the features.
    budget : float, optional
        Time after which no further candidate is started [s].
    clock : callable
        Seconds.
    progress : callable, optional
        Called with (candidates done, candidates in all).

    Returns
    -------
    Chart
        Cost: features and estimate of one recording, the shortest of several runs. Error: mean
        absolute error of the first severity over the condemning limit, in folds of whole machine
        draws, with its standard error over draws; also for each true grade.

    Raises
    ------
    DataError
        The data set has no severity with a limit, or fewer machine draws than folds.
    """
    with DataSet(path) as data:
        head = data.attributes
        samples = [data[i] for i in range(min(_TIMED, len(data)))]
    if not head.severities or not math.isfinite(head.condemning_limit):
        raise DataError(
            f"{path}: severities = {list(head.severities)}, condemning_limit = "
            f"{head.condemning_limit} m must both be given; label the data set"
        )
    end = math.inf if budget is None else clock() + budget
    table = feature_table(path, jobs=jobs)
    judge = _Judge(table, head.severities[0], head.grade_edges, head.condemning_limit, seed)
    groups = list(_groups(samples[0], table.names))
    points: list[Point] = []
    late: list[str] = []
    for done, (name, rows, columns) in enumerate(groups):
        cost = _feature_seconds(samples, rows, clock)
        for place, (model, make) in enumerate(MODELS.items()):
            if clock() >= end:
                late.append(f"{name}, {model}: out of budget")
                continue
            points.append(judge.point(f"{name}, {model}", make, columns, cost, clock))
            if progress is not None:
                progress(done * len(MODELS) + place + 1, len(groups) * len(MODELS))
    name = Path(path).name + (" (simulated)" if head.origin == "simulated" else "")
    return _finished(name, points, late, table)


def _groups(
    sample: Recording, names: Sequence[str]
) -> Iterator[tuple[str, tuple[str, ...], NDArray[np.intp]]]:
    """Name, catalogue rows and columns of every group that a recording supports."""
    layout = recording_layout(sample)
    absent = absent_features(layout, "standard")
    present = [row["name"] for row in catalogue("standard") if row["name"] not in absent]
    seen: set[tuple[int, ...]] = set()
    for name, wanted in FEATURE_GROUPS.items():
        rows = tuple(row for row in present if row in wanted or not wanted)
        if not set(wanted[:1]) <= set(rows):
            continue
        own = set(_names_of(layout, rows))
        columns = tuple(i for i, each in enumerate(names) if each in own)
        if columns not in seen:
            seen.add(columns)
            yield name, rows, np.array(columns)


def _names_of(layout: Layout, rows: Sequence[str]) -> tuple[str, ...]:
    return feature_names(
        layout.channels,
        layout.fs,
        tacho=layout.tacho,
        pulses_per_revolution=layout.pulses_per_revolution,
        quantities=layout.quantities,
        only=rows,
    )


def _feature_seconds(samples: Sequence[Recording], rows: Sequence[str], clock: Clock) -> float:
    """Shortest time for these rows of one recording [s]."""
    return min(_once(sample, rows, clock) for sample in samples for _ in range(_RUNS))


def _once(sample: Recording, rows: Sequence[str], clock: Clock) -> float:
    begin = clock()
    layout = recording_layout(sample)
    without = absent_features(replace(layout, tacho=False), "standard")
    feature_row(
        sample.vibration,
        sample.sample_rate,
        tacho=sample.tacho_signal if set(rows) & set(without) else None,
        pulses_per_revolution=sample.pulses_per_revolution,
        channel_names=layout.channels,
        quantities=layout.quantities,
        only=rows,
    )
    return clock() - begin


class _Judge:
    """Errors of candidates on folds of whole machine draws."""

    def __init__(
        self, table: FeatureTable, column: str, edges: Sequence[float], limit: float, seed: int
    ) -> None:
        self.values, self.seed, self.limit = table.values, seed, limit
        self.truth = table.manifest[column].to_numpy(dtype=float)
        self.draws = table.manifest["group"].to_numpy()
        self.grades = grades_of(self.truth, tuple(edges))
        self.folds = group_folds(self.draws, n=_FOLDS, seed=seed)

    def point(
        self,
        name: str,
        make: Callable[[int], Any],
        columns: NDArray[np.intp],
        cost: float,
        clock: Clock,
    ) -> Point:
        """Point of one candidate."""
        found = np.empty_like(self.truth)
        values, target = self.values[:, columns], np.log(self.truth)
        model = make(self.seed)
        for train, test in self.folds:
            model = make(self.seed).fit(values[train], target[train])
            found[test] = np.exp(np.clip(model.predict(values[test]), -50, 50))
        error = np.abs(found - self.truth) / self.limit
        errors = {MEAN: _over_draws(error, self.draws)}
        for grade in np.unique(self.grades):
            part = self.grades == grade
            errors[f"true grade: {GRADE_NAMES[grade]}"] = _over_draws(error[part], self.draws[part])
        features, kind = name.split(", ")
        return Point(
            name=name,
            rungs={"features": features, "model": kind},
            seconds=cost + _predict_seconds(model, values[:1], clock),
            errors=errors,
            starts=len(self.folds),
            counts=MEAN,
        )


MEAN = "mean"
"""Quantity by which a diagnosis is judged: mean absolute error over the condemning limit."""


def _over_draws(error: Float, draws: NDArray[Any]) -> Difference:
    """Mean error, and its standard error from the means of the draws, each of one machine."""
    means = np.array([error[draws == draw].mean() for draw in np.unique(draws)])
    spread = float(means.std(ddof=1) / math.sqrt(len(means))) if len(means) > 1 else math.inf
    return Difference(mean=float(error.mean()), standard_error=spread)


def _predict_seconds(model: Any, row: Float, clock: Clock) -> float:
    def once() -> float:
        begin = clock()
        model.predict(row)
        return clock() - begin

    return min(once() for _ in range(_RUNS))


def _finished(name: str, points: list[Point], late: list[str], table: FeatureTable) -> Chart:
    chosen = front_of([(point.seconds, point.error) for point in points])
    shown = [replace(p, on_front=front) for p, front in zip(points, chosen, strict=True)]
    shown.sort(key=lambda point: point.seconds)
    best = min(shown, key=lambda point: point.error, default=None)
    fair = [] if best is None else [p for p in shown if p.error <= best.error + best.standard_error]
    verdict = "no winner: nothing ran within the budget"
    if best is not None:
        verdict = (
            f"smallest error {best.error:.1%} of the limit: {best.name}; fastest within its "
            f"standard error of {best.standard_error:.1%}: {fair[0].name}, {fair[0].error:.1%} in "
            f"{1e3 * fair[0].seconds:.3g} ms"
        )
    draws = table.manifest["group"].nunique()
    return Chart(
        name=name,
        title=f"{name}: speed against accuracy of the diagnosis",
        cost_label="features and estimate of one recording [s]",
        error_label="mean absolute error [% of the condemning limit]",
        accuracy=None,
        points=tuple(shown),
        reference="",
        status="out of budget" if late else "resolved",
        winner=fair[0].name if fair else "",
        verdict=verdict,
        pruned=tuple(late),
        note=f"{len(table.values)} records of {draws} machine draws, {_FOLDS} folds of whole draws",
    )
