"""Comparison of combinations of rungs with the best one, on as few starts as necessary."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..scene.rungs import Rung, with_values
from ..scene.scene import SceneError
from .differences import FIRST, RESOLVED, Candidate, Difference, differences, judgement, why
from .ladder import cost_of
from .pilot import Pilot

_DECISIVE = 1.0 / 6.0  # of the accuracy: a standard error that alone takes two fifths of it

_HOPELESS = 2.0  # the standard error from few starts is itself uncertain by half


class Comparison:
    """Compares combinations of rungs with the best one, with as few starts as necessary.

    Parameters
    ----------
    pilot : Pilot
    ladders : mapping of str to sequence of Rung
        Effect -> rungs that it may take, cheapest first; the reference has the last of each.
    accuracy : float
        Largest error of every quantity.
    starts : int
        Most starts in a mean difference.
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
        self.lowest = {name: rungs[0] for name, rungs in ladders.items() if rungs}
        self.top = {name: rungs[-1] for name, rungs in ladders.items() if rungs}
        self.cap = math.inf  # present limit of starts
        self._kept: dict[tuple[tuple[str, str], ...], Candidate] = {}
        self._settled: dict[tuple[tuple[str, str], ...], Candidate] = {}

    def share(self, other: "Comparison") -> None:
        """Share results with another comparison with the same reference."""
        self._kept, self._settled = other._kept, other._settled

    def settle(self, candidate: Candidate) -> None:
        """Adopt a verdict from better runs than these, permanently."""
        self._settled[_names_of(candidate)] = candidate

    def settled(self, candidate: Candidate) -> bool:
        """Whether a verdict is an adopted one."""
        return _names_of(candidate) in self._settled

    def values(self, rungs: Mapping[str, Rung]) -> dict[str, Any]:
        """Values of a combination."""
        return {path: value for rung in rungs.values() for path, value in rung.values.items()}

    def cost(self, rungs: Mapping[str, Rung]) -> float:
        """Time of a run of a combination by the tables [s]."""
        return cost_of(with_values(self.pilot.scene, self.values(rungs)))

    def is_top(self, candidate: Candidate) -> bool:
        """Whether a candidate is the reference."""
        return _names_of(candidate) == names(self.top)

    def judge(self, rungs: Mapping[str, Rung]) -> Candidate:
        """Candidate of a combination, with its verdict; evaluated again if more starts may help."""
        known = self.known(rungs)
        if known is None or self._open(known):
            self._kept[names(rungs)] = known = self._evaluated(rungs)
        return known

    def judge_again(self, candidate: Candidate) -> Candidate:
        """Candidate of an earlier verdict, with more starts if they may help."""
        rungs = {
            name: next(rung for rung in self.rungs[name] if rung.name == own)
            for name, own in candidate.rungs.items()
        }
        return self.judge(rungs)

    def known(self, rungs: Mapping[str, Rung]) -> Candidate | None:
        """Candidate of a combination that has been evaluated."""
        name = names(rungs)
        return self._settled.get(name) or self._kept.get(name)

    def decided(self, candidate: Candidate) -> bool:
        """Whether more starts would not change a verdict, or are too many."""
        if candidate.verdict != "doubtful" or 2 * candidate.starts > self.starts:
            return True
        if self.settled(candidate):
            return True
        return self._hopeless(candidate.differences, candidate.starts)

    def reference(self) -> Candidate:
        """The reference compared with itself, without errors."""
        return self._evaluated(self.top)

    def judged(self) -> tuple[Candidate, ...]:
        """All combinations of its rungs that were evaluated."""
        own = {name: [rung.name for rung in rungs] for name, rungs in self.rungs.items()}
        known = {**self._kept, **self._settled}.values()
        return tuple(c for c in known if all(c.rungs[n] in rungs for n, rungs in own.items()))

    def doubted(self) -> list[Candidate]:
        """Combinations whose scatter stayed too large, except those near the limit itself."""
        most = _DECISIVE * self.accuracy
        return [c for c in self.judged() if c.verdict == "doubtful" and c.standard_error > most]

    def _evaluated(self, rungs: Mapping[str, Rung]) -> Candidate:
        values, reference = self.values(rungs), self.values(self.top)
        starts = 2
        while True:
            self.pilot.fill([values, reference], starts)
            own, other = (self.pilot.outcomes(v, starts) for v in (values, reference))
            fault = next((o.fault for o in (*own, *other) if o.fault), "")
            if fault:
                return self._candidate(rungs, {}, len(own), "invalid", fault)
            found = differences([o.quantities for o in own], [o.quantities for o in other])
            verdict = judgement(found, starts, self.accuracy)
            if verdict != "more":
                return self._candidate(rungs, found, starts, verdict, why(found, verdict))
            if not self._more(found, starts):
                return self._candidate(rungs, found, starts, "doubtful", why(found, "doubtful"))
            starts *= 2

    def _open(self, known: Candidate) -> bool:
        """Whether a verdict is open only for lack of starts, and more are now allowed."""
        return not self.decided(known) and 2 * known.starts <= self.cap

    def _more(self, found: Mapping[str, Difference], starts: int) -> bool:
        most = min(self.starts, self.cap)
        return 2 * starts <= most and not self._hopeless(found, starts)

    def _hopeless(self, found: Mapping[str, Difference], starts: int) -> bool:
        """Whether even the most starts would not average the scatter away, so that none is run."""
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
            cost = self.cost(rungs)
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
    """A combination as the names of its rungs, in a fixed order."""
    return tuple(sorted((name, rung.name) for name, rung in rungs.items()))
