"""Runs of a scene for a worker: tasks, outcomes, and grouping into parallel lanes.

Quantities of interest are passed in as a callable. Grouping and distribution over workers do not
change any result.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

from ..machine.simulate import alike, recorder, simulate, simulate_many, simulates_together
from ..output.recording import Recorder, Recording
from ..scene.rungs import with_values
from ..scene.scene import Scene, SceneError
from .ladder import VALIDITY

Quantity = tuple[float, str, float]
"""Value, kind ("dB", "relative" or "absolute") and scale: the least reference size of a relative
error, the reference size of an absolute one; ignored for a level."""

Quantities = Callable[[Recording, Scene], Mapping[str, Quantity]]
"""Quantities of interest of a run with its truth, by name."""

_LEAST_TIMED = 0.3  # s: a shorter run is repeated for at least this time

_MOST_COLD = 3.0  # s: limit for repeating a process' first run, which loads its kernels


class Outcome(NamedTuple):
    """Quantities of a run, or why there are none."""

    quantities: Mapping[str, Quantity]
    fault: str
    seconds: float = math.nan
    """Least time of the run, if it was timed [s]."""


class Task(NamedTuple):
    """A run for a worker: a scene with the values of its rungs and its start."""

    scene: Scene
    values: Mapping[str, Any]
    quantities: Quantities
    shared: str
    """Equal for runs that differ only in their start."""
    number: int
    clock: Callable[[], float] | None
    truth: tuple[str, ...] | None = None
    """Names of the truth that the quantities use; None: all."""


class QuantityError(ValueError):
    """A run lacks a quantity, which is its fault."""


Group = tuple[Task, ...]
"""Tasks that a worker runs together."""

Spread = Callable[[Callable[[Group], list[Outcome]], Iterable[Group]], Iterable[list[Outcome]]]
"""Applies a function to groups and returns the results in order, for example by workers."""


def outcomes_of(tasks: Group) -> list[Outcome]:
    """Run tasks, in parallel lanes if that is faster.

    Parameters
    ----------
    tasks : tuple of Task
        With a clock, a run does all work of a recording by itself; without, work that similar runs
        have done in this process is reused.

    Returns
    -------
    list of Outcome
        In the order of the tasks, with the quantities of each run alone.
    """
    together = [task for task in tasks if _may_be_many(task)]
    if not together:
        return [_outcome_of(task) for task in tasks]
    scenes = [with_values(task.scene, task.values) for task in together]
    runs = [(scene, task.number) for scene, task in zip(scenes, together, strict=True)]
    truth = {name for task in together for name in task.truth or ()}
    found = {
        id(together[n]): Outcome({}, run.faults[0])
        if isinstance(run, SceneError)
        else _outcome(together[n], scenes[n], run)
        for n, run in simulate_many(runs, truth=truth)
    }
    return [found[id(task)] if id(task) in found else _outcome_of(task) for task in tasks]


def _may_be_many(task: Task) -> bool:
    """Whether a run can be one of many in lanes, which is faster even for a single one."""
    if task.clock is not None or task.truth is None or not simulates_together(task.scene):
        return False
    try:
        with_values(task.scene, task.values)
    except SceneError:
        return False
    return True


def kind_of(task: Task) -> Hashable:
    """Key of tasks that are faster together; None for one that runs alone."""
    if task.truth is None:
        return None
    try:
        return alike(with_values(task.scene, task.values))
    except SceneError:
        return None


Item = TypeVar("Item")


def grouped(
    items: Iterable[Item], kind: Callable[[Item], Hashable | None]
) -> list[tuple[Item, ...]]:
    """Group runs that are made together.

    Parameters
    ----------
    items : iterable
        Runs in any form.
    kind : callable
        Key of runs that are faster together; None for one that runs alone.

    Returns
    -------
    list of tuple
        Single runs first, then full groups of a kind, then the remaining ones.

    Examples
    --------
    >>> [len(group) for group in grouped(range(41), lambda n: n % 2 or None)]
    [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 16, 4]
    """
    kinds: dict[Hashable, list[Item]] = {}
    for item in items:
        kinds.setdefault(kind(item), []).append(item)
    alone, left, groups = kinds.pop(None, []), [], []
    for same in kinds.values():
        whole = len(same) // TOGETHER * TOGETHER
        groups += [tuple(same[n : n + TOGETHER]) for n in range(0, whole, TOGETHER)]
        left += same[whole:]
    groups += [tuple(left[n : n + TOGETHER]) for n in range(0, len(left), TOGETHER)]
    return [*((item,) for item in alone), *groups]


TOGETHER = 16
"""Runs of a group."""


def _outcome_of(task: Task) -> Outcome:
    """Run a task by itself."""
    seconds = math.nan
    try:
        scene = with_values(task.scene, task.values)
        if task.clock is None:
            solution = _recorder_of(task.shared, scene)(scene, task.number, True, False)
        else:
            solution, seconds = _timed(scene, task.number, task.clock)
    except SceneError as error:
        return Outcome({}, error.faults[0])
    return _outcome(task, scene, solution, seconds)


def _outcome(task: Task, scene: Scene, solution: Recording, seconds: float = math.nan) -> Outcome:
    fault = _fault(solution)
    if fault:
        return Outcome({}, fault, seconds)
    try:
        return Outcome(task.quantities(solution, scene), "", seconds)
    except QuantityError as error:
        return Outcome({}, str(error), seconds)


def _fault(solution: Recording) -> str:
    """Why a run is outside the validity of its rungs; empty if it is inside."""
    if not solution.status.ok:
        return solution.status.text
    for name, most in VALIDITY.items():
        value = float(solution.numerics.get(name, 0.0))
        if value > most:
            return f"{name} = {value:.3g} must be <= {most:g}, or a rung is not valid"
    return ""


def _timed(scene: Scene, number: int, clock: Callable[[], float]) -> tuple[Recording, float]:
    """A run and its least time; a very short one is repeated."""
    least, begin, first = math.inf, clock(), scene.machine not in warm
    while True:
        before = clock()
        solution = simulate(scene, seed=number, truth=True, raise_on_failure=False)
        now = clock()
        warm.add(scene.machine)
        least = min(least, now - before)
        cold = first and now - begin < _MOST_COLD
        if now - begin >= _LEAST_TIMED and not cold:
            return solution, least
        first = False


warm: set[str] = set()  # machines already run in this process: the first run loads the kernels

_recorders: dict[str, Recorder] = {}

_MOST_RECORDERS = 64


def _recorder_of(shared: str, scene: Scene) -> Recorder:
    if shared not in _recorders:
        if len(_recorders) >= _MOST_RECORDERS:
            _recorders.clear()
        _recorders[shared] = recorder(scene)
    return _recorders[shared]
