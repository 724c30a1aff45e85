"""Combinations of rungs judged against the best of them, on as few starts as decide."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..scene.rungs import Rung, with_values
from ..scene.scene import SceneError
from .differences import FIRST, RESOLVED, Candidate, Difference, differences, judgement, why
from .ladder import cost_of
from .pilot import Pilot

_TOLD = 1.0 / 6.0  # of the accuracy: a standard error that takes up two fifths of it by itself

_HOPELESS = 2.0  # a standard error of few starts is itself uncertain by half


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
            verdict = judgement(found, starts, self.accuracy)
            if verdict != "more":
                return self._candidate(rungs, found, starts, verdict, why(found, verdict))
            if not self._more(found, starts):
                return self._candidate(rungs, found, starts, "doubtful", why(found, "doubtful"))
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
