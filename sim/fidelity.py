"""The least model that a scene needs: errors of its rungs measured on a pilot, the cheapest chosen.

Errors are those of quantities of interest, which reach this file as a callable from above, against
the highest admissible rung of every effect. Contact with clearance is chaotic: differences are
means over starts, and a difference below their scatter is none. Cost is tabulated, not timed, so
that the choice is the same on every machine.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from .assemble import recorder, simulate
from .integrate import Recorder, Solution
from .ladder import (
    STEP_LEVELS,
    VALIDITY,
    Effect,
    Rung,
    admissible,
    cost_of,
    effects_of,
    level_name,
    with_values,
)
from .parts import Scene, SceneError, pinned_faults

Quantity = tuple[float, str, float]
"""Value, kind ("dB", "relative" or "absolute") and scale: the least size a relative error is taken
of, the size an absolute one is taken of; of no meaning to a level."""

Quantities = Callable[[Solution, Scene], Mapping[str, Quantity]]
"""Quantities of interest of a run with its truth, by name."""

Float = NDArray[np.float64]

STARTS = 32
"""Most starts that a difference is averaged over, where they are not cheap."""

MOST_STARTS = 512
"""The same where they are."""

PILOT = 128.0
"""Tabulated time that the starts of the reference may take all together, beyond STARTS [s]."""

_TIMED = 8  # starts of a rung that are timed, each of which does all that a recording takes
_FIRST = 4  # starts that a scattered difference is judged on at the earliest
_SIGMAS = 3.0  # beyond so many standard errors a difference is one
_SURELY_OFF = 0.99865  # chance of as much, by Student's distribution
_SURELY_NEAR = 0.99  # as one looks up to seven times
_STILL = 0.01  # of the accuracy asked: scatter below it is none
_RESOLVED = 1.0 / 3.0  # of the accuracy asked: standard error that a judgement needs
_TOLD = 1.0 / 6.0  # of the accuracy: a standard error that takes up two fifths of it by itself
_HOPELESS = 2.0  # a standard error of few starts is itself uncertain by half
_LEAST_ACCURACY = 1e-6
_GOLDEN = 0.6180339887498949  # fractions of a turn: evenly spread for any number of starts
_LEVEL = math.log(10) / 20  # relative change of an amplitude for a dB


# --- results


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


@dataclass(frozen=True, kw_only=True)
class Convergence:
    """How the reference converges with the level of one numerical effect.

    Attributes
    ----------
    effect : str
    levels : tuple of str
        Coarse to fine, the last is that of the reference.
    quantity : str
        The one that moves most.
    steps : tuple of float
        Its changes from level to level [-].
    order : float
        Observed, base two; NaN where it cannot be told.
    remaining : float
        Error left in the reference after Richardson; the last change where there is no order [-].
    converged : bool
        What remains is below the accuracy's third, or the last change is below scatter. Changes
        that shrink slowly leave much.
    """

    effect: str
    levels: tuple[str, ...]
    quantity: str
    steps: tuple[float, ...]
    order: float
    remaining: float
    converged: bool


@dataclass(frozen=True, kw_only=True)
class Study:
    """Error and cost of every combination that matters.

    Attributes
    ----------
    accuracy : float
    reference : Candidate
        Highest admissible rung of every effect.
    candidates : tuple of Candidate
        Those that ran, cheapest first, the reference among them.
    convergence : tuple of Convergence
        Of the reference, for each numerical effect.
    refused : tuple of str
        Rungs that the scene does not admit, with the reason.
    pruned : tuple of str
        Rungs that another is better and cheaper than, and what a budget left out.
    status : str
        ``resolved``, ``unresolvable``, ``not converged``, or ``out of budget``.
    """

    accuracy: float
    reference: Candidate
    candidates: tuple[Candidate, ...]
    convergence: tuple[Convergence, ...]
    refused: tuple[str, ...]
    pruned: tuple[str, ...]
    status: str

    @property
    def front(self) -> tuple[Candidate, ...]:
        """Candidates that no cheaper one is better than."""
        found: list[Candidate] = []
        for one in sorted(self.candidates, key=lambda c: (c.cost, c.error)):
            if math.isfinite(one.error) and (not found or one.error < found[-1].error):
                found.append(one)
        return tuple(found)


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """The combination that was chosen.

    Attributes
    ----------
    values : mapping of str to object
        Dotted path -> value, of everything that is not pinned.
    rungs : mapping of str to str
        Effect -> name of its rung.
    estimated_error : float
        Largest mean difference to the reference, and its standard error on top [-].
    cost, cost_of_reference : float
        Tabulated [s].
    status : str
        ``resolved``; ``unresolvable`` where something cheaper could not be told from the reference
        for its scatter; ``reference`` where nothing cheaper is good enough.
    reasons : tuple of str
        Why each rung below the chosen one was not taken.
    accuracy : float
        That was asked.
    runs : int
        Simulations that the choice took.
    """

    values: Mapping[str, Any]
    rungs: Mapping[str, str]
    estimated_error: float
    cost: float
    cost_of_reference: float
    status: str
    reasons: tuple[str, ...]
    accuracy: float
    runs: int

    @property
    def text(self) -> str:
        """What was chosen, in one line."""
        chosen = ", ".join(f"{name} {rung}" for name, rung in self.rungs.items())
        return (
            f"{self.status} for {self.accuracy:.3g}: {chosen}; error {self.estimated_error:.2%}, "
            f"cost {self.cost / self.cost_of_reference:.3g} of the best rungs'"
        )


def resolved_scene(scene: Scene, resolution: Resolution) -> Scene:
    """The scene with what was chosen written into it, its fidelity as given.

    Parameters
    ----------
    scene : Scene
    resolution : Resolution
        Of :func:`resolve`.

    Returns
    -------
    Scene
    """
    return with_values(scene, {**resolution.values, "fidelity": "given"})


# --- runs


class Outcome(NamedTuple):
    """Quantities of one run, or why there are none."""

    quantities: Mapping[str, Quantity]
    fault: str


class Bench:
    """Runs of one scene in any combination of rungs, each start once.

    Parameters
    ----------
    scene : Scene
    quantities : callable
        Of :data:`Quantities`.
    seed : int
        Other starts for another one.
    clock : callable, optional
        Seconds; only what is reported as measured depends on it.
    """

    def __init__(
        self,
        scene: Scene,
        quantities: Quantities,
        *,
        seed: int = 0,
        clock: Callable[[], float] | None = None,
    ) -> None:
        self.scene, self.quantities, self.seed, self.clock = scene, quantities, seed, clock
        self.runs = 0
        self._kept: dict[tuple[tuple[str, Any], ...], list[Outcome]] = {}
        self._seconds: dict[tuple[tuple[str, Any], ...], float] = {}
        self._recorders: dict[tuple[tuple[str, Any], ...], Recorder] = {}

    def outcomes(self, values: Mapping[str, Any], starts: int) -> list[Outcome]:
        """Outcomes of the first so many starts."""
        kept = self._kept.setdefault(_key(values), [])
        while len(kept) < starts and not (kept and kept[-1].fault):
            kept.append(self._run(values, len(kept)))
        return kept[:starts]

    def seconds(self, values: Mapping[str, Any]) -> float:
        """Least time of a run so far [s]; NaN without a clock."""
        return self._seconds.get(_key(values), math.nan)

    def _run(self, values: Mapping[str, Any], start: int) -> Outcome:
        self.runs += 1
        number = start + self.seed * 65_537
        turn = math.tau * (number * _GOLDEN % 1.0)
        try:
            scene = with_values(
                self.scene, {**values, "drive.start_angle": turn, "fidelity": "given"}
            )
            solution = self._solution(scene, _key(values), number, start)
        except SceneError as error:
            return Outcome({}, error.faults[0])
        fault = _fault(solution)
        return Outcome({} if fault else self.quantities(solution, scene), fault)

    def _solution(
        self, scene: Scene, key: tuple[tuple[str, Any], ...], number: int, start: int
    ) -> Solution:
        if self.clock and start < _TIMED:
            begin = self.clock()
            solution = simulate(scene, seed=number, truth=True, raise_on_failure=False)
            took = self.clock() - begin
            self._seconds[key] = min(took, self._seconds.get(key, took))
            return solution
        if key not in self._recorders:
            self._recorders[key] = recorder(scene)
        return self._recorders[key](scene, number, True, False)


def _key(values: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    return tuple(sorted(values.items()))


def _fault(solution: Solution) -> str:
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
    enough = starts >= _FIRST or scatter <= _STILL * accuracy
    close = all(d.error + near * d.standard_error <= accuracy for d in each)
    return "within" if close and enough and scatter <= _RESOLVED * accuracy else "more"


class _Court:
    """Judges combinations against the reference, with as few starts as tell."""

    def __init__(
        self, bench: Bench, effects: Sequence[Effect], accuracy: float, starts: int
    ) -> None:
        self.bench, self.effects, self.accuracy, self.starts = bench, effects, accuracy, starts
        self.late: Callable[[], bool] = lambda: False
        self.cut = False  # a judgement went without the starts that it was too late for
        scene = bench.scene
        self.rungs = {effect.name: admissible(effect, scene) for effect in effects}
        self.top = {name: rungs[-1] for name, rungs in self.rungs.items() if rungs}
        self._kept: dict[tuple[tuple[str, str], ...], Candidate] = {}

    def values(self, rungs: Mapping[str, Rung]) -> dict[str, Any]:
        """Values of a combination."""
        return {path: value for rung in rungs.values() for path, value in rung.values.items()}

    def judge(self, rungs: Mapping[str, Rung]) -> Candidate:
        """Candidate of a combination, with its verdict."""
        key = tuple(sorted((name, rung.name) for name, rung in rungs.items()))
        if key not in self._kept:
            self._kept[key] = self._judged(rungs)
        return self._kept[key]

    def _judged(self, rungs: Mapping[str, Rung]) -> Candidate:
        values, reference = self.values(rungs), self.values(self.top)
        starts = 2
        while True:
            own, other = (self.bench.outcomes(v, starts) for v in (values, reference))
            fault = next((o.fault for o in (*own, *other) if o.fault), "")
            if fault:
                return self._candidate(rungs, {}, len(own), "invalid", fault)
            found = differences([o.quantities for o in own], [o.quantities for o in other])
            verdict = _judgement(found, starts, self.accuracy)
            if verdict != "more":
                return self._candidate(rungs, found, starts, verdict, _why(found, verdict))
            more = 2 * starts <= self.starts and not self._hopeless(found, starts)
            late = more and self.late()
            self.cut |= late
            if late or not more:
                return self._candidate(rungs, found, starts, "doubtful", _why(found, "doubtful"))
            starts *= 2

    def knows(self, rungs: Mapping[str, Rung]) -> bool:
        """Whether a combination has been judged."""
        return tuple(sorted((name, rung.name) for name, rung in rungs.items())) in self._kept

    def judged(self) -> tuple[Candidate, ...]:
        """Every combination that was judged."""
        return tuple(self._kept.values())

    def doubted(self) -> list[Candidate]:
        """Combinations whose scatter stayed too large to tell, not those near the limit itself."""
        most = _TOLD * self.accuracy
        return [c for c in self.judged() if c.verdict == "doubtful" and c.standard_error > most]

    def _hopeless(self, found: Mapping[str, Difference], starts: int) -> bool:
        """Scatter that even the most starts would not average away: no need to run them."""
        scatter = max(each.standard_error for each in found.values())
        in_the_end = scatter * math.sqrt(starts / self.starts)
        return starts > _FIRST and in_the_end > _HOPELESS * _RESOLVED * self.accuracy

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
            cost = cost_of(with_values(self.bench.scene, values))
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
            seconds=self.bench.seconds(values),
        )


def _why(found: Mapping[str, Difference], verdict: str) -> str:
    if verdict == "within":
        return ""
    name, worst = max(found.items(), key=lambda item: item[1].error)
    if verdict == "beyond":
        return f"{name} is off by {worst.error:.2%}"
    name, worst = max(found.items(), key=lambda item: item[1].error + item[1].standard_error)
    return f"{name} is off by {worst.error:.2%} with a standard error of {worst.standard_error:.2%}"


def _free_effects(scene: Scene, pinned: Sequence[str]) -> tuple[Effect, ...]:
    faults = pinned_faults(scene.machine, pinned)
    if faults:
        raise SceneError(scene.name, faults)
    return tuple(effect for effect in effects_of(scene) if effect.name not in pinned)


def _checked(accuracy: float | None, scene: Scene) -> float:
    asked = scene.accuracy if accuracy is None else accuracy
    if not _LEAST_ACCURACY <= asked < 1:
        raise ValueError(
            f"accuracy = {asked:g} must be >= {_LEAST_ACCURACY:g} and < 1; choose 0.02"
        )
    return asked


def resolve(
    scene: Scene,
    quantities: Quantities,
    accuracy: float | None = None,
    pinned: Sequence[str] = (),
    *,
    starts: int | None = None,
    seed: int = 0,
    bench: Bench | None = None,
) -> Resolution:
    """Choose the cheapest rungs and numerics whose error is within the accuracy asked.

    Parameters
    ----------
    scene : Scene
        Its own ``fidelity`` plays no part.
    quantities : callable
        Quantities of interest of a run; see :data:`Quantities`.
    accuracy : float, optional
        Error that each of them may carry; the scene's own by default.
    pinned : sequence of str
        Effects that stay as they are written, besides those that the scene pins.
    starts : int, optional
        Most starts that a difference is averaged over; by default 32, and up to 512 of a scene
        whose reference costs so little that they take no more than 128 s by the tables.
    seed : int
        Of the starts.
    bench : Bench, optional
        Runs already made of the same scene.

    Returns
    -------
    Resolution
        Without any wall time in it: the same on every machine.

    Raises
    ------
    SceneError
        A pinned name is no effect, or the reference itself cannot be run.
    ValueError
        The accuracy is not between 1e-6 and 1.

    Notes
    -----
    Each effect is lowered first by itself, from the best rung down, until what it adds is beyond
    the accuracy. Combinations of what is left are tried from the cheapest whose differences add up
    to less, each against the reference. Whatever cannot be told from it for scatter is not taken:
    doubts fall up.
    """
    asked = _checked(accuracy, scene)
    names = {*pinned, *scene.pinned}
    court = _Court(
        bench or Bench(scene, quantities, seed=seed),
        _free_effects(scene, sorted(names)),
        asked,
        STARTS if starts is None else starts,
    )
    _refuse_bad_reference(court)
    if starts is None:
        court.starts = affordable_starts(cost_of(with_values(scene, court.values(court.top))))
    singles = _descent(court)
    chosen = next(
        (found for found in _tries(court, singles) if found.verdict == "within"),
        court.judge(court.top),
    )
    cost_of_reference = court.judge(court.top).cost
    doubted = [c for c in court.doubted() if c.cost < chosen.cost]
    status = "resolved" if chosen.rungs != court.judge(court.top).rungs else "reference"
    return Resolution(
        values=chosen.values,
        rungs=chosen.rungs,
        estimated_error=_estimate(chosen),
        cost=chosen.cost,
        cost_of_reference=cost_of_reference,
        status="unresolvable" if doubted else status,
        reasons=_reasons(court, singles),
        accuracy=asked,
        runs=court.bench.runs,
    )


def affordable_starts(cost: float) -> int:
    """Most starts of a reference of that cost [s]: a power of two, as they are doubled.

    Examples
    --------
    >>> [affordable_starts(cost) for cost in (0.1, 1.0, 60.0)]
    [512, 128, 32]
    """
    most = min(MOST_STARTS, max(STARTS, PILOT / cost))
    return 1 << math.floor(math.log2(most))


def _estimate(chosen: Candidate) -> float:
    found = chosen.differences.values()
    return max((d.error + d.standard_error for d in found if d.error > 0), default=0.0)


def _refuse_bad_reference(court: _Court) -> None:
    outcome = court.bench.outcomes(court.values(court.top), 1)[0]
    if outcome.fault:
        rungs = ", ".join(f"{name} = {rung.name}" for name, rung in court.top.items())
        fault = f"the reference ({rungs}) cannot be run: {outcome.fault}; pin the effect at fault"
        raise SceneError(court.bench.scene.name, [fault])


class _Single(NamedTuple):
    """A rung of one effect tried with the others held, and what it adds to their differences."""

    rung: Rung
    candidate: Candidate
    added: Mapping[str, float]


def _descent(court: _Court) -> dict[str, list[_Single]]:
    """For each effect its rungs below the best that may do, and the first that fails.

    What saves most is lowered first and stays low while the others are tried, as far as it costs
    no more than half of the accuracy: the rest is then cheap to run. A doubtful rung is not gone
    below: what is coarser still could not be told either.
    """
    found: dict[str, list[_Single]] = {}
    held = dict(court.top)
    for name in sorted(court.rungs, key=lambda each: _lowest_cost(court, each)):
        found[name] = []
        before = court.judge(held)
        for rung in reversed(court.rungs[name][:-1]):
            single = court.judge({**held, name: rung})
            added = _added(single, before)
            found[name].append(_Single(rung, single, added))
            if single.verdict == "doubtful" or _sum_of([added]) > court.accuracy:
                break
        low = [s.rung for s in found[name] if _leaves_room(s.candidate, court.accuracy)]
        held[name] = low[-1] if low else court.top[name]
    return found


def _lowest_cost(court: _Court, name: str) -> float:
    """Cost of the best combination with the cheapest rung of one effect."""
    scene = court.bench.scene
    values = (court.values({**court.top, name: rung}) for rung in court.rungs[name])
    return min(cost_of(with_values(scene, each)) for each in values)


def _leaves_room(candidate: Candidate, accuracy: float) -> bool:
    return candidate.verdict == "within" and candidate.error <= _ROOM * accuracy


_ROOM = 0.5  # of the accuracy: what effects that are held low may use up


def _added(single: Candidate, before: Candidate) -> dict[str, float]:
    """Mean differences of a candidate over those of the one that it was lowered from."""
    if single.verdict == "invalid":
        return {}
    return {
        name: each.mean - before.differences[name].mean for name, each in single.differences.items()
    }


def _tries(court: _Court, singles: Mapping[str, list[_Single]]) -> Iterator[Candidate]:
    """Combinations of rungs that may do, cheapest first, judged as they are asked for."""
    choices = []
    for name, top in court.top.items():
        good = [s for s in singles[name] if s.candidate.verdict in ("within", "beyond")]
        choices.append([(name, top, None), *((name, s.rung, s.added) for s in good)])
    ranked: list[tuple[float, int, dict[str, Rung]]] = []
    for combination in product(*choices):
        added = [each for _, _, each in combination if each is not None]
        if _sum_of(added) <= court.accuracy:
            rungs = {name: rung for name, rung, _ in combination}
            cost = cost_of(with_values(court.bench.scene, court.values(rungs)))
            ranked.append((cost, len(ranked), rungs))
    for _, _, rungs in sorted(ranked, key=lambda row: row[:2]):
        yield court.judge(rungs)


def _sum_of(added: Sequence[Mapping[str, float]]) -> float:
    """Largest error of any quantity if differences add up."""
    names = {name for each in added for name in each}
    return max((abs(sum(each.get(name, 0.0) for each in added)) for name in names), default=0.0)


def _reasons(court: _Court, singles: Mapping[str, list[_Single]]) -> tuple[str, ...]:
    refused = [
        f"{effect.name} = {rung.name}: {effect.refusal(court.bench.scene, rung.name)}"
        for effect in court.effects
        for rung in effect.rungs
        if rung not in court.rungs[effect.name]
    ]
    failed = [
        f"{name} = {single.rung.name}: {single.candidate.verdict}, {single.candidate.reason}"
        for name, rows in singles.items()
        for single in rows
        if single.candidate.verdict != "within"
    ]
    return (*refused, *failed)


# --- study


def study(
    scene: Scene,
    quantities: Quantities,
    *,
    accuracy: float | None = None,
    pinned: Sequence[str] = (),
    starts: int | None = None,
    budget: float | None = None,
    clock: Callable[[], float] | None = None,
    progress: Callable[[int, int], None] | None = None,
    seed: int = 0,
    bench: Bench | None = None,
) -> Study:
    """Measure error and cost of every combination of rungs that matters.

    Parameters
    ----------
    scene : Scene
    quantities : callable
        See :data:`Quantities`.
    accuracy : float, optional
        The scene's own by default; says when scatter is small enough.
    pinned : sequence of str
        Effects that stay as they are written, besides those that the scene pins.
    starts : int, optional
        Most starts that a difference is averaged over; by default as :func:`resolve`.
    budget : float, optional
        Seconds of `clock` after which no further combination is begun, nor more starts of one.
    clock : callable, optional
        Seconds, such as ``time.perf_counter``; without, nothing is timed.
    progress : callable, optional
        Called with (combinations done, combinations in all).
    seed : int
        Of the starts.
    bench : Bench, optional
        Runs already made of the same scene; its clock and seed hold.

    Returns
    -------
    Study

    Raises
    ------
    SceneError
        As :func:`resolve`.
    ValueError
        As :func:`resolve`.
    """
    asked = _checked(accuracy, scene)
    effects = _free_effects(scene, sorted({*pinned, *scene.pinned}))
    own = bench or Bench(scene, quantities, seed=seed, clock=clock)
    court = _Court(own, effects, asked, STARTS if starts is None else starts)
    _refuse_bad_reference(court)
    if starts is None:
        court.starts = affordable_starts(cost_of(with_values(scene, court.values(court.top))))
    end = clock() + budget if clock and budget is not None else math.inf

    court.late = lambda: clock is not None and clock() >= end
    kept, pruned = _undominated(court)
    convergence = tuple(_convergences(court, pruned))
    combinations = _by_cost(court, kept)
    found, late = [court.judge(court.top)], False
    for done, rungs in enumerate(combinations):
        late = court.late()
        if late:
            break
        found.append(court.judge(rungs))
        if progress:
            progress(done + 1, len(combinations))
    unique = {tuple(sorted(c.rungs.items())): c for c in (*court.judged(), *found)}
    candidates = sorted(unique.values(), key=lambda c: (c.cost, c.error))
    return Study(
        accuracy=asked,
        reference=court.judge(court.top),
        candidates=tuple(candidates),
        convergence=convergence,
        refused=tuple(
            f"{e.name} = {r.name}: {e.refusal(scene, r.name)}"
            for e in effects
            for r in e.rungs
            if r not in court.rungs[e.name]
        ),
        pruned=tuple(pruned),
        status=_study_status(candidates, convergence, late or court.cut),
    )


def _study_status(
    candidates: Sequence[Candidate], convergence: Sequence[Convergence], late: bool
) -> str:
    if not all(each.converged for each in convergence):
        return "not converged"
    if late:
        return "out of budget"
    doubtful = any(each.verdict == "doubtful" for each in candidates)
    return "unresolvable" if doubtful else "resolved"


def _undominated(court: _Court) -> tuple[dict[str, list[Rung]], list[str]]:
    """Rungs of each effect that no cheaper one is as good as, by their errors alone.

    The cheapest are judged first: a budget is then spent on what a user is after.
    """
    kept: dict[str, list[Rung]] = {}
    pruned: list[str] = []
    for name, rungs in court.rungs.items():
        kept[name] = [court.top[name]]
        best = 0.0
        ahead: list[tuple[Rung, Candidate]] = []
        for rung in rungs[:-1]:
            if court.late():
                pruned.append(f"{name} = {rung.name}: out of budget")
                continue
            ahead.insert(0, (rung, court.judge({**court.top, name: rung})))
        for i, (rung, single) in enumerate(ahead):
            cheaper = [other for _, other in ahead[i + 1 :] if other.cost <= single.cost]
            best = min((other.error for other in cheaper), default=math.inf)
            if single.verdict == "invalid":
                pruned.append(f"{name} = {rung.name}: {single.reason}")
            elif best <= single.error:
                pruned.append(f"{name} = {rung.name}: a cheaper one errs no more")
            else:
                kept[name].append(rung)
    return kept, pruned


def _by_cost(court: _Court, kept: Mapping[str, list[Rung]]) -> list[dict[str, Rung]]:
    """Combinations of rungs, cheapest first; those that errors alone put behind others left out."""
    rows: list[tuple[float, float, int, dict[str, Rung]]] = []
    for combination in product(*kept.values()):
        rungs = dict(zip(kept, combination, strict=True))
        best = court.judge(court.top)
        alone = [
            _added(court.judge({**court.top, name: rung}), best)
            for name, rung in rungs.items()
            if rung is not court.top[name]
        ]
        cost = cost_of(with_values(court.bench.scene, court.values(rungs)))
        rows.append((cost, _sum_of(alone), len(rows), rungs))
    front, least = [], math.inf
    for _, error, _, rungs in sorted(rows, key=lambda row: row[:3]):
        if error < least * _SPARED:
            front.append(rungs)
            least = min(least, error)
    return front


_SPARED = 1.5
"""Predicted errors up to this factor behind the front are run all the same: sums are guesses."""


def _convergences(court: _Court, pruned: list[str]) -> Iterator[Convergence]:
    """Of every numerical effect with three levels or more; rungs between two are left out.

    What a budget left no time for is added to `pruned`.
    """
    levels = {level_name(factor) for factor in STEP_LEVELS}
    for effect in court.effects:
        rungs = [rung for rung in court.rungs[effect.name] if rung.name in levels][-3:]
        if effect.numerical and len(rungs) == len(_LEVELS_SHOWN):
            found = _convergence(court, effect.name, rungs)
            if found is not None:
                yield found
            elif court.late():
                pruned.append(f"convergence over {effect.name}: out of budget")


_LEVELS_SHOWN = range(3)
_ROUNDING = 1e-9  # of relative changes: signals have single precision, truth has double


def _convergence(court: _Court, name: str, rungs: Sequence[Rung]) -> Convergence | None:
    """Convergence over the starts that its levels were judged on, or more while they scatter."""
    combinations = [{**court.top, name: rung} for rung in rungs]
    if court.late() and not all(court.knows(each) for each in combinations[:-1]):
        return None  # a budget that is spent begins no further combination
    judged = [court.judge(each) for each in combinations]
    starts, found = min(c.starts for c in judged[:-1]), None
    while True:
        runs = [court.bench.outcomes(c.values, starts) for c in judged]
        if any(outcome.fault for row in runs for outcome in row):
            return found
        levels = [[outcome.quantities for outcome in row] for row in runs]
        first, last = (differences(a, b) for a, b in pairwise(levels))
        quantity = max(last, key=lambda each: last[each].error)
        found = _order(name, rungs, quantity, first[quantity].mean, last[quantity], court.accuracy)
        scatter = max(each.standard_error for each in last.values()) / court.accuracy
        settled = scatter <= (_RESOLVED if starts >= _FIRST else _STILL)
        if settled or 2 * starts > court.starts:
            return found
        if court.late():  # few scattered starts show nothing
            court.cut = True
            return None
        starts *= 2


def _order(
    effect: str,
    rungs: Sequence[Rung],
    quantity: str,
    before: float,
    last: Difference,
    accuracy: float,
) -> Convergence:
    """What the last two changes of a quantity say of the finest level."""
    silent = last.error <= max(_SIGMAS * last.standard_error, _ROUNDING)
    order = math.log2(abs(before / last.mean)) if before and last.mean else math.nan
    told = not silent and math.isfinite(order) and order > 0
    remaining = last.error / (2**order - 1) if told else last.error
    return Convergence(
        effect=effect,
        levels=tuple(rung.name for rung in rungs),
        quantity=quantity,
        steps=(before, last.mean),
        order=order if told else math.nan,
        remaining=remaining,
        converged=silent or remaining <= _RESOLVED * accuracy,
    )
