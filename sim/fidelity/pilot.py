"""Pilot runs: error of a combination of rungs against a reference, on as few starts as tell.

Errors are those of quantities of interest, which reach this file as a callable from above. Contact
with clearance is chaotic: differences are means over starts, and a difference below their scatter
is none. What was measured can be kept and taken up again; runs may be spread over workers, and lie
side by side where that is faster. None of it changes a result.
"""

import copy
import hashlib
import json
import math
import pickle
from collections.abc import (
    Callable,
    Collection,
    Hashable,
    Iterable,
    Mapping,
    MutableMapping,
    Sequence,
)
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from ..machine.simulate import (
    alike,
    recorder,
    simulate,
    simulate_many,
    simulates_together,
)
from ..output.recording import Recorder, Recording
from ..scene.rungs import Rung, with_values
from ..scene.scene import Scene, SceneError
from .ladder import VALIDITY, cost_of

Quantity = tuple[float, str, float]
"""Value, kind ("dB", "relative" or "absolute") and scale: the least size a relative error is taken
of, the size an absolute one is taken of; of no meaning to a level."""

Quantities = Callable[[Recording, Scene], Mapping[str, Quantity]]
"""Quantities of interest of a run with its truth, by name."""

Float = NDArray[np.float64]

RESOLVED = 1.0 / 3.0
"""Of the accuracy asked: standard error that a judgement needs."""

FIRST = 4
"""Starts that a scattered difference is judged on at the earliest."""

STILL = 0.01
"""Of the accuracy asked: scatter below it is none."""

TIMED = 3
"""Starts of a rung that are timed, each of which does all that a recording takes."""

_LEAST_TIMED = 0.3  # s: a run that takes less is repeated until so much has gone by
_MOST_COLD = 3.0  # s: the first run of a process, which loads its kernels, is repeated up to here
_SURELY_OFF = 0.99865  # chance of as much, by Student's distribution
_SURELY_NEAR = 0.99  # as one looks up to seven times
_TOLD = 1.0 / 6.0  # of the accuracy: a standard error that takes up two fifths of it by itself
_HOPELESS = 2.0  # a standard error of few starts is itself uncertain by half
_GOLDEN = 0.6180339887498949  # fractions of a turn: evenly spread for any number of starts
_LEVEL = math.log(10) / 20  # relative change of an amplitude for a dB


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Of one quantity between a candidate and the reference.

    Attributes
    ----------
    mean : float
        Over the starts, relative: of a level that of its amplitude, of others as their kind says.
    standard_error : float
        Of that mean.
    """

    mean: float
    standard_error: float

    @property
    def error(self) -> float:
        """Size of the mean difference [-]."""
        return abs(self.mean)


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One combination of rungs.

    Attributes
    ----------
    rungs : mapping of str to str
        Effect -> name of its rung.
    values : mapping of str to object
        Dotted path -> value that puts the combination into the scene.
    cost : float
        Tabulated, of one run [s].
    differences : mapping of str to Difference
        Of every quantity; empty where the combination is not valid.
    starts : int
        That the differences are means of.
    verdict : str
        ``within``, ``beyond``, ``doubtful`` (scatter too large to tell) or ``invalid``.
    reason : str
        Why it is not within.
    seconds : float
        Least time of a run that was measured [s]; NaN without a clock.
    """

    rungs: Mapping[str, str]
    values: Mapping[str, Any]
    cost: float
    differences: Mapping[str, Difference] = field(default_factory=dict)
    starts: int = 0
    verdict: str = "within"
    reason: str = ""
    seconds: float = math.nan

    @property
    def error(self) -> float:
        """Largest of its quantities' errors; infinite where it is not valid."""
        if not self.differences:
            return math.inf
        return max(each.error for each in self.differences.values())

    @property
    def standard_error(self) -> float:
        """Largest of its quantities' standard errors."""
        return max((each.standard_error for each in self.differences.values()), default=math.inf)


# --- runs


class Outcome(NamedTuple):
    """Quantities of one run, or why there are none."""

    quantities: Mapping[str, Quantity]
    fault: str
    seconds: float = math.nan
    """Least time of the run, where it was timed [s]."""


class OutOfTimeError(Exception):
    """A run was not begun, as there is no time for it."""


class Task(NamedTuple):
    """One run, for a worker: of a scene with the values of its rungs and its start."""

    scene: Scene
    values: Mapping[str, Any]
    quantities: Quantities
    shared: str
    """Same for runs that differ in their start alone."""
    number: int
    clock: Callable[[], float] | None
    truth: tuple[str, ...] | None = None
    """Names of the truth that the quantities read; None: any of it."""


class QuantityError(ValueError):
    """A run has no such quantity, which is its fault."""


Group = tuple[Task, ...]
"""Tasks that a worker makes together."""

Spread = Callable[[Callable[[Group], list[Outcome]], Iterable[Group]], Iterable[list[Outcome]]]
"""Applies a function to groups and gives the results in order; by workers, say."""


def outcomes_of(tasks: Group) -> list[Outcome]:
    """Make runs, side by side where that is faster.

    Parameters
    ----------
    tasks : tuple of Task
        With a clock a run does all that a recording takes, by itself; without, what its like have
        done before in this process is taken over.

    Returns
    -------
    list of Outcome
        In the order of the tasks, with the quantities of each run alone.
    """
    beside = [task for task in tasks if _may_be_many(task)]
    if not beside:
        return [_outcome_of(task) for task in tasks]
    scenes = [with_values(task.scene, task.values) for task in beside]
    runs = [(scene, task.number) for scene, task in zip(scenes, beside, strict=True)]
    truth = {name for task in beside for name in task.truth or ()}
    found = {
        id(beside[n]): Outcome({}, run.faults[0])
        if isinstance(run, SceneError)
        else _told(beside[n], scenes[n], run)
        for n, run in simulate_many(runs, truth=truth)
    }
    return [found[id(task)] if id(task) in found else _outcome_of(task) for task in tasks]


def _may_be_many(task: Task) -> bool:
    """Whether a run needs no more than one of many has; it is faster then even by itself."""
    if task.clock is not None or task.truth is None or not simulates_together(task.scene):
        return False
    try:
        with_values(task.scene, task.values)
    except SceneError:
        return False
    return True


def kind_of(task: Task) -> Hashable:
    """What tasks must have in common to be made faster together; None of one that runs alone."""
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
    """Runs in groups to be made together.

    Parameters
    ----------
    items : iterable
        Runs in any form.
    kind : callable
        What those must have in common that are faster together; None of one that runs alone.

    Returns
    -------
    list of tuple
        What runs alone first. Then groups of a kind, then what is left of all of them.

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
    """Make a run by itself."""
    seconds = math.nan
    try:
        scene = with_values(task.scene, task.values)
        if task.clock is None:
            solution = _recorder_of(task.shared, scene)(scene, task.number, True, False)
        else:
            solution, seconds = _timed(scene, task.number, task.clock)
    except SceneError as error:
        return Outcome({}, error.faults[0])
    return _told(task, scene, solution, seconds)


def _told(task: Task, scene: Scene, solution: Recording, seconds: float = math.nan) -> Outcome:
    fault = _fault(solution)
    if fault:
        return Outcome({}, fault, seconds)
    try:
        return Outcome(task.quantities(solution, scene), "", seconds)
    except QuantityError as error:
        return Outcome({}, str(error), seconds)


def _timed(scene: Scene, number: int, clock: Callable[[], float]) -> tuple[Recording, float]:
    """A run and its least time; one that takes next to nothing is repeated."""
    least, begin, first = math.inf, clock(), scene.machine not in _warm
    while True:
        before = clock()
        solution = simulate(scene, seed=number, truth=True, raise_on_failure=False)
        now = clock()
        _warm.add(scene.machine)
        least = min(least, now - before)
        cold = first and now - begin < _MOST_COLD
        if now - begin >= _LEAST_TIMED and not cold:
            return solution, least
        first = False


_warm: set[str] = set()  # machines that this process has run: the first loads its kernels


_recorders: dict[str, Recorder] = {}
_MOST_RECORDERS = 64


def _recorder_of(shared: str, scene: Scene) -> Recorder:
    if shared not in _recorders:
        if len(_recorders) >= _MOST_RECORDERS:
            _recorders.clear()
        _recorders[shared] = recorder(scene)
    return _recorders[shared]


_Start = tuple[Mapping[str, Any], int]  # values of a combination, and the number of a start


class Pilot:
    """Runs of one scene in any combination of rungs, each start once.

    Parameters
    ----------
    scene : Scene
    quantities : callable
        Of :data:`Quantities`.
    seed : int
        Other starts for another one.
    truth : collection of str, optional
        Names of the truth that the quantities read, so that starts may run side by side; by default
        any of it, which takes a run of its own.
    clock : callable, optional
        Seconds; only what is reported as measured depends on it.
    kept : mapping, optional
        Outcomes by name: those of an earlier pilot are not run again, new ones are added.
    spread : callable, optional
        As :data:`Spread`; one after the other by default. Quantities and clock must then be
        importable by name.
    """

    def __init__(
        self,
        scene: Scene,
        quantities: Quantities,
        *,
        seed: int = 0,
        truth: Collection[str] | None = None,
        clock: Callable[[], float] | None = None,
        kept: MutableMapping[str, Outcome] | None = None,
        spread: Spread = map,
        at_once: int = 1,
    ) -> None:
        self.scene, self.quantities, self.seed, self.clock = scene, quantities, seed, clock
        self._truth = None if truth is None else tuple(sorted(truth))
        self.runs = 0
        self.late: Callable[[float], bool] = lambda _expected: False
        self._spread, self.at_once = spread, at_once
        self.common: Mapping[str, Any] = {}  # values of every run besides, such as its length
        self._kept: MutableMapping[str, Outcome] = {} if kept is None else kept
        self._outcomes: dict[str, list[Outcome]] = {}
        self._tabulated: dict[str, float] = {}
        self._kinds: dict[str, Hashable | None] = {}
        self._own = hashlib.sha256(pickle.dumps(scene)).hexdigest()
        self._timed_by = self

    def uncut(self) -> "Pilot":
        """The same runs without the values common to these, such as a shorter length.

        They are not timed themselves: what they are expected to take is by the times of these.
        """
        whole = copy.copy(self)
        whole.clock, whole.common = None, {}
        whole._outcomes, whole._tabulated, whole._kinds = {}, {}, {}
        return whole

    def outcomes(self, values: Mapping[str, Any], starts: int) -> list[Outcome]:
        """Outcomes of the first so many starts, up to one that fails."""
        self.fill([values], starts)
        return self._outcomes[_key(values)][:starts]

    def fault(self, values: Mapping[str, Any]) -> str:
        """Why a combination cannot be run, by the starts made so far and the first at least."""
        self.outcomes(values, 1)
        return next((each.fault for each in self._outcomes[_key(values)] if each.fault), "")

    def fill(self, combinations: Sequence[Mapping[str, Any]], starts: int) -> None:
        """Make what is missing of the first so many starts of some combinations.

        Raises
        ------
        OutOfTimeError
            ``late`` said so before a run; what was made by then is kept.
        """
        different = [*{_key(values): values for values in combinations}.values()]
        while missing := self._missing(different, starts):
            batch = self._batch(missing)
            if self.late(self._expected(batch)):
                batch = [each[:1] for each in batch[: self.at_once]]
                if self.late(self._expected(batch)):
                    raise OutOfTimeError
            for runs, outcomes in zip(batch, self._made(batch), strict=True):
                for (values, start), found in zip(runs, outcomes, strict=True):
                    self._add(values, start, found)

    def seconds(self, values: Mapping[str, Any]) -> float:
        """Least time of a run so far [s]; NaN without a clock."""
        told = [each.seconds for each in self._outcomes.get(_key(values), [])[:TIMED]]
        return min((each for each in told if math.isfinite(each)), default=math.nan)

    def tabulated(self, values: Mapping[str, Any], first: int, last: int) -> float:
        """Time of the starts from `first` to before `last` by the tables [s], less side by side."""
        timed = range(first, min(last, TIMED)) if self.clock else ()
        others = last - first - len(timed)
        together = others >= FIRST and self._kind((values, TIMED)) is not None
        return self._cost(values) * (len(timed) + others * (_FASTER if together else 1.0))

    def measured(self, tabulated: float) -> float:
        """Time that so much by the tables takes here [s]; NaN where nothing was timed."""
        scale = self._timed_by._scale()
        return scale * tabulated if scale > 0 else math.nan

    def _missing(self, combinations: Sequence[Mapping[str, Any]], starts: int) -> list[_Start]:
        """Starts that no outcome is known of, the first ones of all combinations first."""
        known = [self._known(values, starts) for values in combinations]
        return [
            (values, start)
            for start in range(starts)
            for values, first in zip(combinations, known, strict=True)
            if start >= first
        ]

    def _known(self, values: Mapping[str, Any], starts: int) -> int:
        """How many of the first so many starts need no run: they are kept, or past a fault."""
        rows = self._outcomes.setdefault(_key(values), [])
        name = self._name(values)
        while len(rows) < starts and not (rows and rows[-1].fault):
            kept = self._kept.get(f"{name} {len(rows)}")
            if kept is None:
                return len(rows)
            rows.append(kept)
        return starts

    def _add(self, values: Mapping[str, Any], start: int, found: Outcome) -> None:
        self._kept[f"{self._name(values)} {start}"] = found
        self._known(values, start + 1)

    def _name(self, values: Mapping[str, Any]) -> str:
        return _key({**values, **self.common})

    def _batch(self, missing: Sequence[_Start]) -> list[tuple[_Start, ...]]:
        """What is handed out together: a group for each worker, or runs alone for a second."""
        groups = grouped(missing, self._kind)
        seconds = self.seconds(groups[0][0][0])
        each = max(1, min(int(1.0 / seconds), _MOST_AT_ONCE)) if seconds > 0 else 1
        alone = self.at_once * (each if self.at_once > 1 else 1)
        batch: list[tuple[_Start, ...]] = []
        for group in groups:
            if len(batch) >= (alone if len(group) == 1 else self.at_once):
                break
            batch.append(group)
        return batch

    def _kind(self, run: _Start) -> Hashable | None:
        """As :func:`kind_of`; None of a run that is timed."""
        values, start = run
        if self.clock is not None and start < TIMED:
            return None
        name = self._name(values)
        if name not in self._kinds:
            self._kinds[name] = kind_of(self._task(values, start))
        return self._kinds[name]

    def _expected(self, batch: Sequence[Sequence[_Start]]) -> float:
        """Time that a batch is expected to take [s]; 0 where nothing is known."""
        if self._timed_by.clock is None:
            return 0.0
        scale = self._timed_by._scale()
        told = {_key(values): self.seconds(values) for runs in batch for values, _ in runs}
        for values in (values for runs in batch for values, _ in runs):
            if not math.isfinite(told[_key(values)]):
                told[_key(values)] = scale * self._cost(values)
        each = (
            sum(told[_key(values)] for values, _ in runs) * (_FASTER if len(runs) > 1 else 1.0)
            for runs in batch
        )
        return sum(each) / self.at_once

    def _scale(self) -> float:
        """Measured time for a tabulated second, as the combinations that ran tell; 0 of none."""
        told = [
            each.seconds / self._cost(json.loads(key))
            for key, rows in self._outcomes.items()
            for each in rows[:1]
            if math.isfinite(each.seconds) and self._cost(json.loads(key)) > 0
        ]
        return float(np.median(told)) if told else 0.0

    def _cost(self, values: Mapping[str, Any]) -> float:
        """Tabulated time of a run [s]; 0 of a combination that the scene refuses."""
        key = _key(values)
        if key not in self._tabulated:
            try:
                cost = cost_of(with_values(self.scene, {**values, **self.common}))
            except SceneError:
                cost = 0.0
            self._tabulated[key] = cost
        return self._tabulated[key]

    def _made(self, batch: Sequence[tuple[_Start, ...]]) -> Iterable[list[Outcome]]:
        if self.at_once == 1:
            return [self._together(runs) for runs in batch]
        self.runs += sum(map(len, batch))
        return self._spread(outcomes_of, [self._tasks(runs) for runs in batch])

    def _together(self, runs: tuple[_Start, ...]) -> list[Outcome]:
        if len(runs) == 1:
            return [self._run(*runs[0])]
        self.runs += len(runs)
        return outcomes_of(self._tasks(runs))

    def _tasks(self, runs: tuple[_Start, ...]) -> Group:
        return tuple(self._task(values, start) for values, start in runs)

    def _run(self, values: Mapping[str, Any], start: int) -> Outcome:
        self.runs += 1
        _warm.add(self.scene.machine)  # the next start is of this process too, and warm
        return outcomes_of((self._task(values, start),))[0]

    def _task(self, values: Mapping[str, Any], start: int) -> Task:
        number = start + self.seed * 65_537
        turn = math.tau * (number * _GOLDEN % 1.0)
        return Task(
            scene=self.scene,
            values={**values, **self.common, "drive.start_angle": turn, "fidelity": "given"},
            quantities=self.quantities,
            shared=f"{self._own} {self._name(values)}",
            number=number,
            clock=self.clock if start < TIMED else None,
            truth=self._truth,
        )


_MOST_AT_ONCE = 8
_FASTER = 0.5  # at least: share of the time that runs side by side take


def _key(values: Mapping[str, Any]) -> str:
    return json.dumps(values, sort_keys=True)


def _fault(solution: Recording) -> str:
    """Why a run is outside the validity of its rungs; empty where it is not."""
    if not solution.status.ok:
        return solution.status.text
    for name, most in VALIDITY.items():
        value = float(solution.numerics.get(name, 0.0))
        if value > most:
            return f"{name} = {value:.3g} must be <= {most:g}, or a rung is not valid"
    return ""


def differences(
    candidate: Sequence[Mapping[str, Quantity]], reference: Sequence[Mapping[str, Quantity]]
) -> dict[str, Difference]:
    """Mean difference of every quantity of the reference, over runs from the same starts.

    Parameters
    ----------
    candidate, reference : sequence of mapping
        Quantities of each start, in the same order.

    Returns
    -------
    dict of str to Difference
        Infinite where the candidate lacks a quantity. One start alone has no scatter to be told.

    Examples
    --------
    >>> one = [{"rms": (2.02, "relative", 0.0)}] * 2
    >>> other = [{"rms": (2.0, "relative", 0.0)}] * 2
    >>> round(differences(one, other)["rms"].error, 9)
    0.01
    """
    return {
        name: _difference(name, candidate, reference)
        for name in reference[0]
        if all(name in each for each in reference)
    }


def _difference(
    name: str,
    candidate: Sequence[Mapping[str, Quantity]],
    reference: Sequence[Mapping[str, Quantity]],
) -> Difference:
    if not all(name in each for each in candidate):
        return Difference(mean=math.inf, standard_error=0.0)
    kind, scale = reference[0][name][1:]
    own = np.array([each[name][0] for each in candidate])
    other = np.array([each[name][0] for each in reference])
    apart = (own - other) * _unit(kind, scale, float(np.mean(other)))
    if len(apart) < 2:
        return Difference(mean=float(apart[0]), standard_error=math.inf)
    spread = float(np.std(apart, ddof=1)) / math.sqrt(len(apart))
    return Difference(mean=float(np.mean(apart)), standard_error=spread)


def _unit(kind: str, scale: float, size: float) -> float:
    """Factor from a difference to a relative error."""
    if kind == "dB":
        return _LEVEL
    least = max(abs(size), scale) if kind == "relative" else scale
    return 1.0 / least if least > 0 else 0.0


# --- judgement


def _judgement(found: Mapping[str, Difference], starts: int, accuracy: float) -> str:
    """``within``, ``beyond``, or ``more``: further starts are needed to tell."""
    each = found.values()
    scatter = max(d.standard_error for d in each)
    far, near = (float(stdtrit(starts - 1, chance)) for chance in (_SURELY_OFF, _SURELY_NEAR))
    if any(d.error - far * d.standard_error > accuracy for d in each):
        return "beyond"
    enough = starts >= FIRST or scatter <= STILL * accuracy
    close = all(d.error + near * d.standard_error <= accuracy for d in each)
    return "within" if close and enough and scatter <= RESOLVED * accuracy else "more"


def surely_within(candidate: Candidate) -> float:
    """Error that no quantity of a candidate exceeds, with 95 per cent confidence [-].

    Parameters
    ----------
    candidate : Candidate

    Returns
    -------
    float
        By Student's distribution of the starts, Bonferroni's share of the doubt to each quantity;
        infinite of fewer than two starts, or where nothing could be run.

    Examples
    --------
    >>> told = {"rms": Difference(mean=0.01, standard_error=0.002)}
    >>> one = Candidate(rungs={}, values={}, cost=1.0, differences=told, starts=16)
    >>> round(surely_within(one), 4)
    0.0143
    """
    if candidate.starts < _FEWEST or not candidate.differences:
        return math.inf
    doubt = _DOUBT / 2 / len(candidate.differences)
    factor = float(stdtrit(candidate.starts - 1, 1 - doubt))
    return max(d.error + factor * d.standard_error for d in candidate.differences.values())


_FEWEST = 2
_DOUBT = 0.05


def starts_to_tell(candidate: Candidate, accuracy: float) -> int:
    """Starts after which a candidate would be judged, if its errors stay as they are.

    Parameters
    ----------
    candidate : Candidate
        Of two starts at least.
    accuracy : float
        That is asked.

    Returns
    -------
    int
        Doubled as a comparison doubles them. The scatter of few starts is uncertain itself: it is
        taken as large as that of all quantities together is in all but one case of ten. An error
        at the accuracy is never told; that of few starts is then no more than a guess, and so is
        what is returned.

    Examples
    --------
    >>> told = {"rms": Difference(mean=0.01, standard_error=0.02)}
    >>> one = Candidate(rungs={}, values={}, cost=1.0, differences=told, starts=4)
    >>> starts_to_tell(one, 0.03)
    128
    """
    first, found = max(candidate.starts, _FEWEST), candidate.differences.values()
    if not found:
        return first
    doubt = math.sqrt((first - 1) / float(chdtri(first - 1, 1 - _UNLIKELY / len(found))))
    larger = [replace(d, standard_error=doubt * d.standard_error) for d in found]
    starts = first
    while starts < _ENDLESS * first:
        smaller = math.sqrt(first / starts)
        then = [replace(d, standard_error=smaller * d.standard_error) for d in larger]
        known = {str(n): d for n, d in enumerate(then)}
        if _judgement(known, starts, accuracy) != "more":
            break
        starts *= 2
    return starts


_UNLIKELY = 0.1
_ENDLESS = 1024  # times the starts that there are


class Comparison:
    """Judges combinations of rungs against the best of them, with as few starts as tell.

    Parameters
    ----------
    pilot : Pilot
    ladders : mapping of str to sequence of Rung
        Effect -> rungs that it may take, cheapest first; the reference has the last of each.
    accuracy : float
        Error that every quantity may carry.
    starts : int
        Most starts that a difference is averaged over.
    """

    def __init__(
        self,
        pilot: Pilot,
        ladders: Mapping[str, Sequence[Rung]],
        accuracy: float,
        starts: int,
    ) -> None:
        self.pilot, self.accuracy, self.starts = pilot, accuracy, starts
        self.rungs = ladders
        self.top = {name: rungs[-1] for name, rungs in ladders.items() if rungs}
        self.cap = math.inf  # starts of the time being
        self._kept: dict[tuple[tuple[str, str], ...], Candidate] = {}
        self._settled: dict[tuple[tuple[str, str], ...], Candidate] = {}

    def share(self, other: "Comparison") -> None:
        """Judge together with another of the same reference: what one knows the other knows."""
        self._kept, self._settled = other._kept, other._settled

    def settle(self, candidate: Candidate) -> None:
        """Take over a judgement that was made on better runs than these, for good."""
        self._settled[_names_of(candidate)] = candidate

    def settled(self, candidate: Candidate) -> bool:
        """Whether a judgement is one that was taken over."""
        return _names_of(candidate) in self._settled

    def values(self, rungs: Mapping[str, Rung]) -> dict[str, Any]:
        """Values of a combination."""
        return {path: value for rung in rungs.values() for path, value in rung.values.items()}

    def judge(self, rungs: Mapping[str, Rung]) -> Candidate:
        """Candidate of a combination, with its verdict: anew where more starts may tell."""
        known = self.known(rungs)
        if known is None or self._open(known):
            self._kept[names(rungs)] = known = self._judged(rungs)
        return known

    def judge_again(self, candidate: Candidate) -> Candidate:
        """A candidate of an earlier judgement, on more starts where they may tell."""
        rungs = {
            name: next(rung for rung in self.rungs[name] if rung.name == own)
            for name, own in candidate.rungs.items()
        }
        return self.judge(rungs)

    def known(self, rungs: Mapping[str, Rung]) -> Candidate | None:
        """Candidate of a combination that has been judged."""
        name = names(rungs)
        return self._settled.get(name) or self._kept.get(name)

    def told(self, candidate: Candidate) -> bool:
        """Whether more starts would change nothing of a verdict, or are too many."""
        if candidate.verdict != "doubtful" or 2 * candidate.starts > self.starts:
            return True
        if self.settled(candidate):
            return True
        return self._hopeless(candidate.differences, candidate.starts)

    def reference(self) -> Candidate:
        """The reference against itself: its errors are none."""
        return self._judged(self.top)

    def judged(self) -> tuple[Candidate, ...]:
        """Every combination of its rungs that was judged."""
        own = {name: [rung.name for rung in rungs] for name, rungs in self.rungs.items()}
        known = {**self._kept, **self._settled}.values()
        return tuple(c for c in known if all(c.rungs[n] in rungs for n, rungs in own.items()))

    def doubted(self) -> list[Candidate]:
        """Combinations whose scatter stayed too large to tell, not those near the limit itself."""
        most = _TOLD * self.accuracy
        return [c for c in self.judged() if c.verdict == "doubtful" and c.standard_error > most]

    def _judged(self, rungs: Mapping[str, Rung]) -> Candidate:
        values, reference = self.values(rungs), self.values(self.top)
        starts = 2
        while True:
            self.pilot.fill([values, reference], starts)
            own, other = (self.pilot.outcomes(v, starts) for v in (values, reference))
            fault = next((o.fault for o in (*own, *other) if o.fault), "")
            if fault:
                return self._candidate(rungs, {}, len(own), "invalid", fault)
            found = differences([o.quantities for o in own], [o.quantities for o in other])
            verdict = _judgement(found, starts, self.accuracy)
            if verdict != "more":
                return self._candidate(rungs, found, starts, verdict, _why(found, verdict))
            if not self._more(found, starts):
                return self._candidate(rungs, found, starts, "doubtful", _why(found, "doubtful"))
            starts *= 2

    def _open(self, known: Candidate) -> bool:
        """Whether a doubt was only that of few starts, and more are admitted now."""
        return not self.told(known) and 2 * known.starts <= self.cap

    def _more(self, found: Mapping[str, Difference], starts: int) -> bool:
        most = min(self.starts, self.cap)
        return 2 * starts <= most and not self._hopeless(found, starts)

    def _hopeless(self, found: Mapping[str, Difference], starts: int) -> bool:
        """Scatter that even the most starts would not average away: no need to run them."""
        scatter = max(each.standard_error for each in found.values())
        in_the_end = scatter * math.sqrt(starts / self.starts)
        return starts > FIRST and in_the_end > _HOPELESS * RESOLVED * self.accuracy

    def _candidate(
        self,
        rungs: Mapping[str, Rung],
        found: Mapping[str, Difference],
        starts: int,
        verdict: str,
        reason: str,
    ) -> Candidate:
        values = self.values(rungs)
        try:
            cost = cost_of(with_values(self.pilot.scene, values))
        except SceneError:
            cost = math.inf
        return Candidate(
            rungs={name: rung.name for name, rung in rungs.items()},
            values=values,
            cost=cost,
            differences=found,
            starts=starts,
            verdict=verdict,
            reason=reason,
            seconds=self.pilot.seconds(values),
        )


def _names_of(candidate: Candidate) -> tuple[tuple[str, str], ...]:
    return tuple(sorted(candidate.rungs.items()))


def names(rungs: Mapping[str, Rung]) -> tuple[tuple[str, str], ...]:
    """A combination by the names of its rungs, in a fixed order."""
    return tuple(sorted((name, rung.name) for name, rung in rungs.items()))


def _why(found: Mapping[str, Difference], verdict: str) -> str:
    if verdict == "within":
        return ""
    name, worst = max(found.items(), key=lambda item: item[1].error)
    if verdict == "beyond":
        return f"{name} is off by {worst.error:.2%}"
    name, worst = max(found.items(), key=lambda item: item[1].error + item[1].standard_error)
    return f"{name} is off by {worst.error:.2%} with a standard error of {worst.standard_error:.2%}"
