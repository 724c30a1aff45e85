"""Sweep of numbers of a scene: recordings on a grid, from several starts, and their analysis."""

import hashlib
import json
import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ...datasets.generation.machines import Truth, known_of
from ...datasets.generation.quantities import resolved
from ...datasets.generation.truths import truths_of
from ...datasets.workers.local import in_order
from ...features.catalogue.row import feature_row
from ...sim.fidelity.choose import resolved_scene
from ...sim.fidelity.runs import (
    Outcome,
    Quantity,
    QuantityError,
    Task,
    grouped,
    kind_of,
    outcomes_of,
)
from ...sim.machine.simulate import simulate
from ...sim.output.recording import Recording
from ...sim.output.status import SimulationError
from ...sim.scene.scene import Scene, SceneError
from ..pages.kept import Kept
from .axes import Axis, Point, SweepError, read_axes
from .detect import Detection, detect
from .show import Shown, choose

MOST_RUNS = 100_000
"""Largest number of runs of a sweep."""

_GOLDEN = 0.6180339887498949  # fractions of a turn: evenly spread for any number of starts
_PAUSE = 2.0  # s between two writes of the kept runs
_SEEDS = 65_537  # numbers of starts between two seeds


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Validated plan of the simulations.

    Attributes
    ----------
    name : str
        Name of the scene.
    axes : tuple of Axis
    scenes : mapping of Point to Scene
        Scene of every point of the grid, with resolved rungs.
    shown : tuple of Shown
    starts : int
        Recordings at each point, with different start angles, sensor noise and random forces.
    seed : int
    confidence : float
        As in :func:`.sweep.detect.detect`.
    truth : tuple of str or None
        Names of the truths needed for the quantities shown; None: all.
    """

    name: str
    axes: tuple[Axis, ...]
    scenes: Mapping[Point, Scene]
    shown: tuple[Shown, ...]
    starts: int
    seed: int
    confidence: float
    truth: tuple[str, ...] | None = None

    @property
    def runs(self) -> list[tuple[Point, int]]:
        """Point and start of each run: all points with the first start, then with the next."""
        return [(point, start) for start in range(self.starts) for point in self.scenes]

    def number(self, start: int) -> int:
        """Seed of a start."""
        return start + self.seed * _SEEDS

    def angle(self, start: int) -> float:
        """Start angle of a start [rad]."""
        return math.tau * (self.number(start) * _GOLDEN % 1.0)


class Row(NamedTuple):
    """One quantity along the last axis, at one setting of the others."""

    setting: Point
    shown: Shown
    means: tuple[float, ...]
    """Mean at each value of the last axis; NaN without values."""
    scatters: tuple[float, ...]
    """Standard deviations between starts."""
    counts: tuple[int, ...]
    detection: Detection


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A plan with its results.

    Attributes
    ----------
    plan : Plan
    outcomes : mapping
        (point, start) -> outcome, for the finished runs.
    """

    plan: Plan
    outcomes: Mapping[tuple[Point, int], Outcome] = field(default_factory=dict)

    @property
    def finished(self) -> bool:
        """Whether all runs are done."""
        return len(self.outcomes) == len(self.plan.runs)

    @property
    def faults(self) -> dict[str, int]:
        """Reason for missing values -> number of runs."""
        found: dict[str, int] = {}
        for each in self.outcomes.values():
            if each.fault:
                found[each.fault] = found.get(each.fault, 0) + 1
        return found

    def samples(self, point: Point, name: str) -> NDArray[np.float64]:
        """Values of a quantity at a point, for each start."""
        found = [self.outcomes.get((point, start)) for start in range(self.plan.starts)]
        values = [each.quantities[name][0] for each in found if each and name in each.quantities]
        return np.array([value for value in values if math.isfinite(value)], dtype=np.float64)

    @property
    def settings(self) -> list[Point]:
        """Values of all axes but the last."""
        return list(dict.fromkeys(point[:-1] for point in self.plan.scenes))

    def rows(self) -> list[Row]:
        """Every quantity at every setting."""
        return [self._row(setting, each) for each in self.plan.shown for setting in self.settings]

    def _row(self, setting: Point, shown: Shown) -> Row:
        axis = self.plan.axes[-1]
        found = [self.samples((*setting, i), shown.name) for i in range(len(axis.values))]
        return Row(
            setting=setting,
            shown=shown,
            means=tuple(float(v.mean()) if v.size else math.nan for v in found),
            scatters=tuple(float(v.std(ddof=1)) if v.size > 1 else math.nan for v in found),
            counts=tuple(v.size for v in found),
            detection=detect(axis.values, found, self.plan.confidence),
        )


def sweep_plan(
    subject: str,
    over: Sequence[str],
    *,
    given: Mapping[str, Any] | None = None,
    show: Sequence[str] = (),
    points: int = 5,
    starts: int = 5,
    seed: int = 0,
    confidence: float = 0.95,
) -> Plan:
    """Validate the request; a short run determines the available quantities.

    Parameters
    ----------
    subject : str
        Built-in scene, or file.
    over : sequence of str
        Axes, as in :func:`.sweep.axes.parse_axis`.
    given : mapping of str to object, optional
        Values that replace those of the scene at every point.
    show : sequence of str
        Patterns, as in :func:`.sweep.show.choose`.
    points, starts, seed, confidence
        As in :func:`.sweep.axes.parse_axis` and :class:`Plan`.

    Raises
    ------
    SceneError, SweepError
        All faults of the scene, or of axes and quantities.
    """
    axes, scenes, faults = _axes_of(subject, given or {}, over, points)
    probe, truths = _probed(scenes)
    try:
        shown = choose(show, probe, truths)
    except SweepError as error:
        faults += error.faults
    if len(scenes) * starts > MOST_RUNS:
        faults.append(
            f"{len(scenes)} points x {starts} starts must be <= {MOST_RUNS}; reduce one of them"
        )
    if faults:
        raise SweepError(faults)
    return Plan(
        name=next(iter(scenes.values())).name,
        axes=axes,
        scenes=_resolved(scenes),
        shown=shown,
        starts=starts,
        seed=seed,
        confidence=confidence,
        truth=_needed_truth(probe, next(iter(scenes.values())), shown),
    )


def _needed_truth(probe: Recording, scene: Scene, shown: Sequence[Shown]) -> tuple[str, ...] | None:
    """Truths of the quantities of interest, if all quantities shown follow from these."""
    names = known_of(scene).truth
    if names is None:
        return None
    part = {name: value for name, value in probe.truth.items() if name in names}
    known = truths_of(replace(probe, truth=part), scene)
    return names if all(each.feature or each.name in known for each in shown) else None


def _axes_of(
    subject: str, given: Mapping[str, Any], over: Sequence[str], points: int
) -> tuple[tuple[Axis, ...], dict[Point, Scene], list[str]]:
    """Axes, scenes and faults; only the scene if the axes are invalid, to report all at once."""
    from ...sim.scene.load import load_scene

    try:
        axes, scenes = read_axes(subject, given, over, points)
    except SweepError as error:
        return (), {(): load_scene(subject, given)}, list(error.faults)
    return axes, scenes, []


def _resolved(scenes: Mapping[Point, Scene]) -> dict[Point, Scene]:
    """Use the rungs chosen at the first point for all, so that points are comparable."""
    _, resolution = resolved(next(iter(scenes.values())))
    if resolution is None:
        return dict(scenes)
    return {point: resolved_scene(scene, resolution) for point, scene in scenes.items()}


def _probed(scenes: Mapping[Point, Scene]) -> tuple[Recording, dict[str, Truth]]:
    """A short run at the first point that allows one, padded to the length of the others."""
    fault: Exception | None = None
    for scene in scenes.values():
        speed = scene.drive.speed  # type: ignore[attr-defined]
        short = min(scene.duration, max(2.0 / speed, 0.1))
        for duration in (short, scene.duration):
            try:
                own = scene.model_copy(update={"duration": duration, "fidelity": "given"})
                run = simulate(own, seed=0, truth=True)
            except (SceneError, SimulationError) as error:
                fault = fault or error
                continue
            full = np.zeros((len(run.signal), round(scene.duration * scene.sample_rate)))
            return replace(run, signal=full.astype(np.float32)), truths_of(run, own)
    assert fault is not None
    raise fault


# --- runs


def values_of(solution: Recording, scene: Scene, names: Sequence[str]) -> dict[str, Quantity]:
    """Features and truths of a run, by name.

    Parameters
    ----------
    solution : Recording
        Recording with its truth.
    scene : Scene
    names : sequence of str
        Names of features with a leading ``+``, of truths without.

    Raises
    ------
    QuantityError
        A feature cannot be computed for the recording.
    """
    features = [name[1:] for name in names if name.startswith("+")]
    truths = truths_of(solution, scene)
    found = {name: truths[name].value for name in names if name in truths}
    if features:
        found |= _features(solution, features)
    return {name: (value, "", 0.0) for name, value in found.items()}


def _features(solution: Recording, names: Sequence[str]) -> dict[str, float]:
    try:
        labels, values = feature_row(solution, only=tuple(names))
    except ValueError as error:
        raise QuantityError(str(error).splitlines()[0]) from None
    return dict(zip(labels, map(float, values), strict=True))


def kept_runs(path: Path | None, plan: Plan) -> Kept[Outcome]:
    """Runs of a plan, kept in a file next to the output.

    Parameters
    ----------
    path : Path or None
        None: nothing is kept.
    plan : Plan
        Its number of starts and its confidence may change.

    Raises
    ------
    DataError
        The file is damaged, or belongs to another scene, version, axes or quantities.
    """
    return Kept(
        path,
        _key(plan),
        table_of=lambda run: [{name: each[0] for name, each in run.quantities.items()}, run.fault],
        piece_of=lambda row: Outcome({n: (float(v), "", 0.0) for n, v in row[0].items()}, row[1]),
        depends="another scene, version, axes, seed or quantities",
        pause=_PAUSE,
    )


def _key(plan: Plan) -> str:
    scenes = [scene.model_dump(mode="json") for scene in plan.scenes.values()]
    whole = [
        __version__,
        scenes,
        [(axis.path, axis.values) for axis in plan.axes],
        [each.name for each in plan.shown],
        plan.seed,
    ]
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


def measure(
    plan: Plan,
    kept: Kept[Outcome],
    *,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Run the missing runs of a plan.

    Parameters
    ----------
    plan : Plan
    kept : Kept
        From :func:`kept_runs`; each run is added when it is done.
    jobs : int
        Worker processes; the values do not depend on it.
    progress : callable, optional
        Called with (runs done, runs in all).
    """
    runs = plan.runs
    missing = [run for run in runs if _name(*run) not in kept]
    done = len(runs) - len(missing)
    groups = _groups(plan, missing)
    try:
        with closing(
            in_order(
                outcomes_of,
                (tuple(task for _, task in group) for group in groups),
                jobs=min(jobs, len(groups) or 1),
            )
        ) as found:
            for group, outcomes in zip(groups, found, strict=True):
                for (run, _), outcome in zip(group, outcomes, strict=True):
                    kept[_name(*run)] = outcome
                    done += 1
                    if progress is not None:
                        progress(done, len(runs))
    finally:
        kept.save()


def _name(point: Point, start: int) -> str:
    return f"{','.join(map(str, point))} {start}"


_Run = tuple[tuple[Point, int], Task]  # point and start, and the task


def _groups(plan: Plan, runs: Sequence[tuple[Point, int]]) -> list[tuple[_Run, ...]]:
    """Groups of runs that a worker computes together."""
    kinds: dict[Point, Hashable | None] = {}

    def kind(run: _Run) -> Hashable | None:
        (point, _), task = run
        if point not in kinds:
            kinds[point] = kind_of(task)
        return kinds[point]

    return grouped(zip(runs, _tasks(plan, runs), strict=True), kind)


def _tasks(plan: Plan, runs: Sequence[tuple[Point, int]]) -> Iterator[Task]:
    names = [f"+{each.name}" if each.feature else each.name for each in plan.shown]
    key = _key(plan)
    for point, start in runs:
        yield Task(
            scene=plan.scenes[point],
            values={"drive.start_angle": plan.angle(start), "fidelity": "given"},
            quantities=partial(values_of, names=names),
            shared=f"sweep {key} {point}",
            number=plan.number(start),
            clock=None,
            truth=plan.truth,
        )


def sweep_of(plan: Plan, kept: Mapping[str, Outcome]) -> Sweep:
    """A plan with its finished runs."""
    done = {run: kept[_name(*run)] for run in plan.runs if _name(*run) in kept}
    return Sweep(plan=plan, outcomes=done)
