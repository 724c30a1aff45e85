"""Pilot runs of a scene in any combination of rungs, each start once.

Results can be stored and reused; runs may be distributed over workers, and run in parallel lanes
if that is faster. This does not change any result.
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
from typing import Any

import numpy as np

from ..scene.rungs import with_values
from ..scene.scene import Scene, SceneError
from .differences import FIRST
from .ladder import cost_of
from .runs import Group, Outcome, Quantities, Spread, Task, grouped, kind_of, outcomes_of, warm

TIMED = 3
"""Number of timed starts of a rung, each with all work of a recording."""

_GOLDEN = 0.6180339887498949  # fractions of a turn: evenly spread for any number of starts

_Start = tuple[Mapping[str, Any], int]  # values of a combination, and the number of a start


class OutOfTimeError(Exception):
    """A run was not started, because there is no time for it."""


class Pilot:
    """Runs of one scene in any combination of rungs, each start once.

    Parameters
    ----------
    scene : Scene
    quantities : callable
        See :data:`Quantities`.
    seed : int
        Determines the starts.
    truth : collection of str, optional
        Names of the truth that the quantities use, so that starts may run in parallel lanes; by
        default all truth, which needs single runs.
    clock : callable, optional
        Returns seconds; affects only reported times.
    kept : mapping, optional
        Outcomes by name: those of an earlier pilot are not run again, new ones are added.
    spread : callable, optional
        See :data:`Spread`; by default one after the other. Quantities and clock must then be
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
        self.common: Mapping[str, Any] = {}  # values common to all runs, such as their length
        self._kept: MutableMapping[str, Outcome] = {} if kept is None else kept
        self._outcomes: dict[str, list[Outcome]] = {}
        self._tabulated: dict[str, float] = {}
        self._kinds: dict[str, Hashable | None] = {}
        self._own = hashlib.sha256(pickle.dumps(scene)).hexdigest()
        self._timed_by = self

    def uncut(self) -> "Pilot":
        """The same runs without the values common to these, such as a shorter length.

        They are not timed: their expected times follow from the times of these.
        """
        whole = copy.copy(self)
        whole.clock, whole.common = None, {}
        whole._outcomes, whole._tabulated, whole._kinds = {}, {}, {}
        return whole

    def outcomes(self, values: Mapping[str, Any], starts: int) -> list[Outcome]:
        """Outcomes of the first starts, up to one that fails."""
        self.fill([values], starts)
        return self._outcomes[_key(values)][:starts]

    def fault(self, values: Mapping[str, Any]) -> str:
        """Why a combination cannot be run, from the starts made so far, at least the first."""
        self.outcomes(values, 1)
        return next((each.fault for each in self._outcomes[_key(values)] if each.fault), "")

    def fill(self, combinations: Sequence[Mapping[str, Any]], starts: int) -> None:
        """Run the missing ones among the first starts of some combinations.

        Raises
        ------
        OutOfTimeError
            ``late`` returned true before a run; earlier results are kept.
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
        times = [each.seconds for each in self._outcomes.get(_key(values), [])[:TIMED]]
        return min((each for each in times if math.isfinite(each)), default=math.nan)

    def tabulated(self, values: Mapping[str, Any], first: int, last: int) -> float:
        """Tabulated time of the starts `first` to `last` - 1 [s], less in parallel lanes."""
        timed = range(first, min(last, TIMED)) if self.clock else ()
        others = last - first - len(timed)
        together = others >= FIRST and self._kind((values, TIMED)) is not None
        return self._cost(values) * (len(timed) + others * (_FASTER if together else 1.0))

    def measured(self, tabulated: float) -> float:
        """Time on this machine for a tabulated time [s]; NaN if nothing was timed."""
        scale = self._timed_by._scale()
        return scale * tabulated if scale > 0 else math.nan

    def _missing(self, combinations: Sequence[Mapping[str, Any]], starts: int) -> list[_Start]:
        """Starts without an outcome, the first ones of all combinations first."""
        known = [self._known(values, starts) for values in combinations]
        return [
            (values, start)
            for start in range(starts)
            for values, first in zip(combinations, known, strict=True)
            if start >= first
        ]

    def _known(self, values: Mapping[str, Any], starts: int) -> int:
        """How many of the first starts need no run: they are stored, or follow a fault."""
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
        """Next runs to distribute: a group for each worker, or single runs for a second."""
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
        """Like :func:`kind_of`; None for a run that is timed."""
        values, start = run
        if self.clock is not None and start < TIMED:
            return None
        name = self._name(values)
        if name not in self._kinds:
            self._kinds[name] = kind_of(self._task(values, start))
        return self._kinds[name]

    def _expected(self, batch: Sequence[Sequence[_Start]]) -> float:
        """Expected time of a batch [s]; 0 if nothing is known."""
        if self._timed_by.clock is None:
            return 0.0
        scale = self._timed_by._scale()
        expected = {_key(values): self.seconds(values) for runs in batch for values, _ in runs}
        for values in (values for runs in batch for values, _ in runs):
            if not math.isfinite(expected[_key(values)]):
                expected[_key(values)] = scale * self._cost(values)
        each = (
            sum(expected[_key(values)] for values, _ in runs) * (_FASTER if len(runs) > 1 else 1.0)
            for runs in batch
        )
        return sum(each) / self.at_once

    def _scale(self) -> float:
        """Measured time per tabulated second, from the combinations that ran; 0 without any."""
        ratios = [
            each.seconds / self._cost(json.loads(key))
            for key, rows in self._outcomes.items()
            for each in rows[:1]
            if math.isfinite(each.seconds) and self._cost(json.loads(key)) > 0
        ]
        return float(np.median(ratios)) if ratios else 0.0

    def _cost(self, values: Mapping[str, Any]) -> float:
        """Tabulated time of a run [s]; 0 for a combination that the scene refuses."""
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
        warm.add(self.scene.machine)  # the next start also runs in this process, which is now warm
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

_FASTER = 0.5  # at least: share of the time of single runs when in parallel lanes


def _key(values: Mapping[str, Any]) -> str:
    return json.dumps(values, sort_keys=True)
