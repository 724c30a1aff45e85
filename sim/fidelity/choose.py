"""Choice of the cheapest sufficient model of a scene, from errors of its rungs measured on a pilot.

Errors are relative to the highest admissible rung of every effect. Costs are tabulated, not timed,
so that the choice is the same on every machine.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

from ..scene.rungs import Effect, Rung, admissible, with_values
from ..scene.scene import Scene, SceneError, pinned_faults
from .comparison import Comparison
from .differences import Candidate
from .ladder import effects_of
from .pilot import Pilot
from .runs import Quantities

STARTS = 32
"""Most starts in a mean difference, unless they are cheap."""

MOST_STARTS = 512
"""Most starts in a mean difference if they are cheap."""

PILOT = 128.0
"""Tabulated time for all starts of the reference together, beyond STARTS [s]."""

_LEAST_ACCURACY = 1e-6
_ROOM = 0.5  # of the accuracy: share for effects held at low rungs
_FAR = 3.0  # times the accuracy: beyond it a rung fails whatever the scatter


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """The chosen combination.

    Attributes
    ----------
    values : mapping of str to object
        Dotted path -> value, for everything that is not pinned.
    rungs : mapping of str to str
        Effect -> name of its rung.
    estimated_error : float
        Largest mean difference from the reference, plus its standard error [-].
    cost, cost_of_reference : float
        Tabulated time of a run [s].
    status : str
        ``resolved``; ``unresolvable`` if something cheaper could not be distinguished from the
        reference because of scatter; ``reference`` if nothing cheaper is accurate enough.
    reasons : tuple of str
        Why each rung below the chosen one was rejected.
    accuracy : float
        Required accuracy.
    runs : int
        Number of simulations for the choice.
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
        """The choice in one line."""
        chosen = ", ".join(f"{name} {rung}" for name, rung in self.rungs.items())
        return (
            f"{self.status} for {self.accuracy:.3g}: {chosen}; error {self.estimated_error:.2%}, "
            f"cost {self.cost / self.cost_of_reference:.3g} of the best rungs'"
        )


def resolved_scene(scene: Scene, resolution: Resolution) -> Scene:
    """Copy of the scene with the choice applied and its fidelity set to given.

    Parameters
    ----------
    scene : Scene
    resolution : Resolution
        Result of :func:`resolve`.

    Returns
    -------
    Scene
    """
    return with_values(scene, {**resolution.values, "fidelity": "given"})


def free_effects(scene: Scene, pinned: Sequence[str]) -> tuple[Effect, ...]:
    """Effects of a scene except those pinned.

    Raises
    ------
    SceneError
        A pinned name is no effect.
    """
    faults = pinned_faults(type(scene), pinned)
    if faults:
        raise SceneError(scene.name, faults)
    return tuple(effect for effect in effects_of(scene) if effect.name not in pinned)


def checked_accuracy(accuracy: float | None, scene: Scene) -> float:
    """Required accuracy, by default the scene's own.

    Raises
    ------
    ValueError
        It is not between 1e-6 and 1.
    """
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
    truth: Collection[str] | None = None,
    pilot: Pilot | None = None,
) -> Resolution:
    """Choose the cheapest rungs and numerics with an error within the required accuracy.

    Parameters
    ----------
    scene : Scene
        Its own ``fidelity`` is ignored.
    quantities : callable
        Quantities of interest of a run; see :data:`Quantities`.
    accuracy : float, optional
        Largest error of each of them; by default the scene's own.
    pinned : sequence of str
        Effects that stay as in the scene, in addition to those pinned in the scene.
    starts : int, optional
        Most starts in a mean difference; by default 32, and up to 512 for a scene
        whose reference is so cheap that they take no more than 128 s by the tables.
    seed : int
        Seed of the starts.
    truth : collection of str, optional
        See :class:`Pilot`.
    pilot : Pilot, optional
        Runs already made of the same scene.

    Returns
    -------
    Resolution
        Contains no measured time: the same on every machine.

    Raises
    ------
    SceneError
        A pinned name is no effect, or the reference itself cannot be run.
    ValueError
        The accuracy is not between 1e-6 and 1.

    Notes
    -----
    Each effect is first lowered by itself, from the best rung down, until the additional error
    exceeds the accuracy. Combinations of the remaining rungs are tried from the cheapest whose
    differences sum to less, each against the reference. A combination that scatter makes
    indistinguishable is rejected: in doubt, the better rung is taken.
    """
    asked = checked_accuracy(accuracy, scene)
    names = {*pinned, *scene.pinned}
    effects = free_effects(scene, sorted(names))
    comparison = Comparison(
        pilot or Pilot(scene, quantities, seed=seed, truth=truth),
        {effect.name: admissible(effect, scene) for effect in effects},
        asked,
        STARTS if starts is None else starts,
    )
    comparison, dropped = _without_failing_rungs(comparison, effects)
    refuse_bad_reference(comparison)
    if starts is None:
        comparison.starts = affordable_starts(comparison.cost(comparison.top))
    singles = descent(comparison)
    chosen = next(
        (found for found in combinations(comparison, singles) if found.verdict == "within"),
        comparison.judge(comparison.top),
    )
    cost_of_reference = comparison.judge(comparison.top).cost
    doubted = [c for c in comparison.doubted() if c.cost < chosen.cost]
    status = "resolved" if chosen.rungs != comparison.judge(comparison.top).rungs else "reference"
    return Resolution(
        values=chosen.values,
        rungs=chosen.rungs,
        estimated_error=estimated_error(chosen),
        cost=chosen.cost,
        cost_of_reference=cost_of_reference,
        status="unresolvable" if doubted else status,
        reasons=(*refusals(scene, effects), *dropped, *_failures(singles)),
        accuracy=asked,
        runs=comparison.pilot.runs,
    )


def _without_failing_rungs(
    comparison: Comparison, effects: Sequence[Effect]
) -> tuple[Comparison, tuple[str, ...]]:
    """Comparison without the best rungs that fail on this machine, and which those are.

    No rung below that of the scene is dropped: a joint could lose its play unnoticed.
    If this does not cure the reference, the comparison is returned unchanged.
    """
    pilot, held, notes = comparison.pilot, comparison, []
    own = {each.name: each.current(pilot.scene) for each in effects if not each.numerical}
    while fault := pilot.fault(held.values(held.top)):
        better = [n for n in own if own[n] in {rung.name for rung in held.rungs[n][:-1]}]
        lower = {n: held.values({**held.top, n: held.rungs[n][-2]}) for n in better}
        if not lower:
            return comparison, ()
        name = first_cured(pilot, lower)
        *rest, bad = held.rungs[name]
        notes.append(dropped_text(name, bad, rest[-1], fault))
        held = Comparison(pilot, {**held.rungs, name: rest}, comparison.accuracy, comparison.starts)
    return held, tuple(notes)


def first_cured(pilot: Pilot, lowered: Mapping[str, Mapping[str, Any]]) -> str:
    """Effect whose next lower rung lets the reference run; the first effect if none does alone."""
    return next(
        (n for n, values in lowered.items() if not pilot.fault(values)), next(iter(lowered))
    )


def dropped_text(name: str, bad: Rung, instead: Rung, fault: str) -> str:
    """Sentence about a best rung that fails."""
    return (
        f"{name} = {bad.name}: fails on this machine, {fault}; errors are relative to "
        f"{name} = {instead.name}"
    )


def affordable_starts(cost: float) -> int:
    """Most starts for a reference of that cost [s]: a power of two, as they are doubled.

    Examples
    --------
    >>> [affordable_starts(cost) for cost in (0.1, 1.0, 60.0)]
    [512, 128, 32]
    """
    most = min(MOST_STARTS, max(STARTS, PILOT / cost))
    return 1 << math.floor(math.log2(most))


def estimated_error(chosen: Candidate) -> float:
    """Largest mean difference of a candidate, plus its standard error [-]."""
    found = chosen.differences.values()
    return max((d.error + d.standard_error for d in found if d.error > 0), default=0.0)


def refuse_bad_reference(comparison: Comparison) -> None:
    """Raise SceneError if the reference of a comparison cannot be run."""
    outcome = comparison.pilot.outcomes(comparison.values(comparison.top), 1)[0]
    if outcome.fault:
        rungs = ", ".join(f"{name} = {rung.name}" for name, rung in comparison.top.items())
        fault = f"the reference ({rungs}) cannot be run: {outcome.fault}; pin the effect at fault"
        raise SceneError(comparison.pilot.scene.name, [fault])


class Single(NamedTuple):
    """A rung of one effect tried with the others fixed, and its additional differences."""

    rung: Rung
    candidate: Candidate
    added: Mapping[str, float]


def descent(comparison: Comparison) -> dict[str, list[Single]]:
    """Rungs of each effect below the best that may suffice, and the first that fails.

    The effect that saves most is lowered first and stays low while the others are tried, if that
    takes no more than half of the accuracy: the remaining runs are then cheap. Below a doubtful
    rung the search stops, as coarser rungs would be doubtful too. Below a rung that narrowly fails
    it goes on: of many scattered quantities one may fail by chance, but hardly again at the next
    rung.
    """
    found: dict[str, list[Single]] = {}
    held = dict(comparison.top)
    for name in sorted(comparison.rungs, key=lambda each: _lowest_cost(comparison, each)):
        found[name] = []
        before = comparison.judge(held)
        for rung in reversed(comparison.rungs[name][:-1]):
            single = comparison.judge({**held, name: rung})
            added = added_differences(single, before)
            found[name].append(Single(rung, single, added))
            if single.verdict == "doubtful" or largest_sum([added]) > _FAR * comparison.accuracy:
                break
        low = [s.rung for s in found[name] if leaves_room(s.candidate, comparison.accuracy)]
        held[name] = low[-1] if low else comparison.top[name]
    return found


def _lowest_cost(comparison: Comparison, name: str) -> float:
    """Cost of the best combination with the cheapest rung of one effect."""
    return min(comparison.cost({**comparison.top, name: r}) for r in comparison.rungs[name])


def leaves_room(candidate: Candidate, accuracy: float) -> bool:
    """Whether a candidate may stay low while others are tried."""
    return candidate.verdict == "within" and candidate.error <= _ROOM * accuracy


def added_differences(single: Candidate, before: Candidate) -> dict[str, float]:
    """Mean differences of a candidate in excess of the one that it was lowered from."""
    if single.verdict == "invalid":
        return {}
    return {
        name: each.mean - before.differences[name].mean for name, each in single.differences.items()
    }


def combinations(
    comparison: Comparison, singles: Mapping[str, list[Single]]
) -> Iterator[Candidate]:
    """Combinations of rungs that may suffice, cheapest first, evaluated on demand."""
    choices = []
    for name, top in comparison.top.items():
        good = [s for s in singles[name] if s.candidate.verdict in ("within", "beyond")]
        choices.append([(name, top, None), *((name, s.rung, s.added) for s in good)])
    ranked: list[tuple[float, int, dict[str, Rung]]] = []
    for combination in product(*choices):
        added = [each for _, _, each in combination if each is not None]
        if largest_sum(added) <= comparison.accuracy:
            rungs = {name: rung for name, rung, _ in combination}
            ranked.append((comparison.cost(rungs), len(ranked), rungs))
    for _, _, rungs in sorted(ranked, key=lambda row: row[:2]):
        yield comparison.judge(rungs)


def largest_sum(added: Sequence[Mapping[str, float]]) -> float:
    """Largest error of any quantity if differences add up."""
    names = {name for each in added for name in each}
    return max((abs(sum(each.get(name, 0.0) for each in added)) for name in names), default=0.0)


def refusals(scene: Scene, effects: Sequence[Effect]) -> tuple[str, ...]:
    """Rungs that a scene does not admit, each with the reason."""
    return tuple(
        f"{effect.name} = {rung.name}: {fault}"
        for effect in effects
        for rung in effect.rungs
        if (fault := effect.refusal(scene, rung.name)) is not None
    )


def _failures(singles: Mapping[str, list[Single]]) -> list[str]:
    return [
        f"{name} = {single.rung.name}: {single.candidate.verdict}, {single.candidate.reason}"
        for name, rows in singles.items()
        for single in rows
        if single.candidate.verdict != "within"
    ]
