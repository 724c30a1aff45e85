"""Error and cost of the rungs of a scene, cheapest information first.

A study answers two questions about a scene as written. Which numerics (step, tolerance and mesh)
are sufficient for its rungs? And which rungs would be sufficient? It can be stopped at any time and
then returns the present knowledge with its uncertainty.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from ..scene.rungs import STEP_LEVELS, Rung, level_name
from ..scene.scene import Scene
from .choose import (
    affordable_starts,
    checked_accuracy,
    combinations,
    descent,
    dropped_text,
    estimated_error,
    first_cured,
    free_effects,
    largest_sum,
    refusals,
    refuse_bad_reference,
)
from .comparison import Comparison, names
from .convergence import convergence_of
from .differences import FIRST, Candidate, surely_within
from .findings import Answer, Convergence, Raise, Study, unconverged
from .front import SPARED, by_cost, cheapest_numerics, single_changes, undominated
from .pilot import OutOfTimeError, Pilot
from .runs import Quantities
from .time_left import seconds_of_doubts, seconds_of_front
from .written import ladder, value_at, written_rung

_CAPS = (4, 16)  # starts of the first rounds; the last takes as many as the accuracy needs

_LEVELS_SHOWN = 3

_SHORTLIST = 2  # predicted combinations measured before the search continues

_NO_BOUND = 1.0  # an error that may be as large as the quantity itself is unknown

_EXPENSIVE = 0.8  # s by the tables: longer runs of the reference are shortened, if possible


class Search:
    """Measures the errors of a scene's rungs, cheapest information first.

    Parameters
    ----------
    scene : Scene
    quantities : callable
        See :data:`wearstate.sim.fidelity.runs.Quantities`.
    accuracy : float, optional
        By default the scene's own; determines when scatter is small enough.
    pinned : sequence of str
        Effects that stay as in the scene, in addition to those pinned in the scene.
    starts : int, optional
        Most starts in a mean difference; by default as in
        :func:`wearstate.sim.fidelity.choose.resolve`.
    pilot : Pilot, optional
        Runs already made of the same scene.
    report : callable, optional
        Called with a description of the next measurement.

    Raises
    ------
    SceneError, ValueError
        As in :func:`wearstate.sim.fidelity.choose.resolve`.
    """

    def __init__(
        self,
        scene: Scene,
        quantities: Quantities,
        *,
        accuracy: float | None = None,
        pinned: Sequence[str] = (),
        starts: int | None = None,
        pilot: Pilot | None = None,
        report: Callable[[str], None] | None = None,
    ) -> None:
        self.scene, self.accuracy = scene, checked_accuracy(accuracy, scene)
        self.effects = free_effects(scene, sorted({*pinned, *scene.pinned}))
        self.pilot = pilot or Pilot(scene, quantities)
        self.report = report or (lambda _what: None)
        self.numerical = {each.name for each in self.effects if each.numerical}
        self.written = {each.name: written_rung(each, scene) for each in self.effects}
        self.ladders = {each.name: ladder(each, scene) for each in self.effects}
        self._starts = starts
        self._cap = math.inf  # present limit of starts
        self.share = 1.0  # share of a full run's simulated time
        self.kept = self._comparison(
            {n: r if n in self.numerical else (self.written[n],) for n, r in self.ladders.items()}
        )
        self.best = self._whole()
        self.raises = {n: self._raise(n) for n in self.ladders if self._low(n)}
        self.fault = ""  # of the best rungs
        self._dropped: list[str] = []  # rungs that fail on this machine
        self._pruned: list[str] = []
        self._done: set[int] = set()  # comparisons with a final answer
        self._cut_alone: dict[int, str] = {}  # comparisons that fail on whole recordings: why
        self._convergence: dict[int, list[Convergence]] = {}
        self._complete = False
        self.duration: float | None = None  # length of a run's recording, if it is shortened [s]

    def shorten(self, fewest_turns: int) -> None:
        """Shorten the recordings of future runs if the reference is expensive.

        Means are over correspondingly more starts: results come sooner, with the same confidence
        after the same time. Lengths are from tabulated cost, the same on every machine.

        Parameters
        ----------
        fewest_turns : int
            Least number of revolutions of a recording.
        """
        scene, speed = self.scene, float(value_at(self.scene, "drive.speed"))
        settling = scene.settling_revolutions / speed
        whole = scene.duration + settling
        widest = self.best or self.kept
        affordable = whole * _EXPENSIVE / widest.cost(widest.top) - settling
        turns = max(fewest_turns, math.ceil(affordable * speed))
        if turns / speed >= scene.duration:
            return
        self.duration = turns / speed
        self.share = (self.duration + settling) / whole
        self.pilot.common = {"duration": self.duration}
        for each in self._all():
            each.starts <<= self._more_starts()

    def _more_starts(self) -> int:
        """Doublings of the starts that compensate for shorter runs."""
        return math.ceil(math.log2(1 / self.share))

    def _comparison(self, ladders: Mapping[str, Sequence[Rung]]) -> Comparison:
        found = Comparison(self.pilot, ladders, self.accuracy, self._starts or 1)
        if self._starts is None:
            found.starts = affordable_starts(found.cost(found.top))
        found.starts <<= self._more_starts()
        found.cap = self._cap
        return found

    def _whole(self) -> Comparison | None:
        """Comparison of all rungs with the best; None if there is no rung to choose."""
        if all(n in self.numerical or len(r) == 1 for n, r in self.ladders.items()):
            return None
        best = self._comparison(self.ladders)
        if names(best.top) == names(self.kept.top):
            best.share(self.kept)
        return best

    def _low(self, name: str) -> bool:
        """Whether an effect has a better rung than the scene's."""
        best = self.ladders[name][-1].name
        return name not in self.numerical and self.written[name].name != best

    def _raise(self, name: str) -> Comparison:
        """Comparison of the scene with itself with one rung raised, at numerics fit for both."""
        base = level_name(1.0)
        rungs = {
            each: (next((r for r in self.ladders[each] if r.name == base), own),)
            if each in self.numerical
            else (own,)
            for each, own in self.written.items()
        }
        return self._comparison({**rungs, name: (self.written[name], self.ladders[name][-1])})

    def measure(self, late: Callable[[float], bool] | None = None) -> None:
        """Measure until everything is decided, or there is no time.

        Parameters
        ----------
        late : callable, optional
            Whether a run of so many seconds must no longer be started. The scene as written is
            compared with its own finest numerics in any case.

        Raises
        ------
        SceneError
            The finest numerics of the scene as written cannot be run.
        KeyboardInterrupt
            Measurements so far are kept: :meth:`result` returns them.
        """
        self.report("the scene as written")
        self.pilot.late = lambda _expected: False
        at_once, self.pilot.at_once = self.pilot.at_once, 1  # workers take longer to start
        refuse_bad_reference(self.kept)
        self.kept.cap = 2
        self.kept.judge(self.written)
        self.pilot.at_once = at_once
        if late is not None:
            self.pilot.late = late
        try:
            for cap in (*_CAPS, math.inf):
                self._round(cap)
            self._rest()
            for each in self._answers():
                self._confirmed(each)
        except OutOfTimeError:
            return
        self._complete = True

    def _all(self) -> list[Comparison]:
        return [self.kept, *self.raises.values(), *([self.best] if self.best else [])]

    def _answers(self) -> list[Comparison]:
        """Comparisons from which something is chosen."""
        return [self.kept, *([self.best] if self.best and not self.fault else [])]

    def _round(self, cap: float) -> None:
        self._cap = cap
        for each in self._all():
            each.cap = cap
        self.report("numerics of the scene as written")
        self._answered(self.kept)
        for name in list(self.raises):
            self.report(f"error of the rung of {name}")
            self._charge(name)
        while self.best is not None and not self._faulty():
            best = self.best
            self._compare(best, cap)
            if not self.pilot.fault(best.values(best.top)):  # a later start would not run either
                break

    def _compare(self, best: Comparison, cap: float) -> None:
        self.report("the scene as written against the best rungs")
        best.judge(self.written)
        best.judge({**best.top, **{n: r for n, r in self.written.items() if n in self.numerical}})
        for rungs in self._shortlist(best):
            if best.judge(rungs).verdict == "within":
                break
        if cap > _CAPS[0]:
            self.report("combinations of rungs")
            self._answered(best)

    def _charge(self, name: str) -> None:
        """Error of a rung of the scene as written, relative to the best working one."""
        while name in self.raises:
            pair = self.raises[name]
            pair.judge(pair.lowest)
            fault = self.pilot.fault(pair.values(pair.top))
            if not fault:
                return
            self._drop(name, fault)

    def _faulty(self) -> bool:
        """Whether the best rungs cannot be run, even without those that fail together."""
        while self.best is not None:
            best = self.best
            best.judge(best.top)
            self.fault = self.pilot.fault(best.values(best.top))
            raised = [name for name in best.rungs if self._low(name)]
            if not self.fault or not raised:
                break
            lower = {n: best.values({**best.top, n: best.rungs[n][-2]}) for n in raised}
            cured = first_cured(self.pilot, lower)
            self._drop(cured, f"with the other best rungs, {self.fault}")
        return bool(self.fault)

    def _drop(self, name: str, fault: str) -> None:
        """Remove the best rung of an effect: the next below becomes the reference."""
        *lower, bad = self.ladders[name]
        self.ladders = {**self.ladders, name: tuple(lower)}
        self._dropped.append(dropped_text(name, bad, lower[-1], fault))
        if self.raises.pop(name, None) and self._low(name):
            self.raises[name] = self._raise(name)
        if self.best is not None:
            self._done.discard(id(self.best))
            self._convergence.pop(id(self.best), None)
            self.best = self._whole()

    def _answered(self, comparison: Comparison) -> None:
        """Search a comparison for its cheapest sufficient combination."""
        if id(comparison) in self._done:
            return
        while self._decide(comparison):
            if self._confirmed(comparison):
                if id(comparison) not in self._cut_alone:
                    self._done.add(id(comparison))
                return

    def _decide(self, comparison: Comparison) -> bool:
        """Measure up to the cheapest sufficient one; whether more starts would change nothing."""
        comparison.judge(self.written)
        singles = descent(comparison)
        chosen = next(
            (each for each in combinations(comparison, singles) if each.verdict == "within"),
            comparison.judge(comparison.top),
        )
        for each in comparison.judged():  # short lists leave doubts from few starts
            if each.cost < chosen.cost and not comparison.decided(each):
                comparison.judge_again(each)
        self._convergence[id(comparison)] = list(self._convergences(comparison))
        return all(comparison.decided(e) for e in comparison.judged() if e.cost <= chosen.cost)

    def _confirmed(self, comparison: Comparison) -> bool:
        """Check the choice on whole recordings, if the search used shortened ones.

        A motion may change over seconds: agreement over four revolutions may not last for forty.

        Returns
        -------
        bool
            Whether nothing that would have been chosen was refuted.
        """
        if self.duration is None:
            return True
        self.report("the choice on whole recordings")
        starts = comparison.starts >> self._more_starts()
        whole = Comparison(self.pilot.uncut(), comparison.rungs, self.accuracy, starts)
        fault = whole.pilot.fault(whole.values(whole.top))
        if fault:  # nothing can be confirmed or refuted: no answer is final
            self._cut_alone[id(comparison)] = fault
            return True
        confirmed = True
        while (found := self._cheapest(comparison)) and not comparison.settled(found):
            on_whole = whole.judge_again(found)
            comparison.settle(on_whole)
            confirmed &= on_whole.verdict == "within"
        return confirmed

    def _cheapest(self, comparison: Comparison) -> Candidate | None:
        """Present choice; None if it is the reference."""
        room = self._room(comparison)
        judged = sorted(comparison.judged(), key=lambda c: (c.cost, c.error))
        found = next((c for c in judged if c.verdict == "within" and self._fits(c, room)), None)
        return None if found is None or comparison.is_top(found) else found

    def _room(self, comparison: Comparison) -> float:
        """Accuracy left after the reference's own error."""
        return max(self.accuracy - unconverged(self._convergence.get(id(comparison), ())), 0.0)

    def _shortlist(self, best: Comparison) -> Iterator[dict[str, Rung]]:
        """Combinations that may suffice, as predicted from single rungs of the scene as written."""
        choices = [self._predicted(best, name) for name in best.rungs]
        rows: list[tuple[float, int, dict[str, Rung]]] = []
        for combination in product(*choices):
            if largest_sum([added for _, added in combination]) <= self.accuracy:
                rungs = dict(zip(best.rungs, (rung for rung, _ in combination), strict=True))
                rows.append((best.cost(rungs), len(rows), rungs))
        yield from (rungs for _, _, rungs in sorted(rows, key=lambda row: row[:2])[:_SHORTLIST])

    def _predicted(self, best: Comparison, name: str) -> list[tuple[Rung, dict[str, float]]]:
        """Rungs of an effect with their expected additional differences."""
        rows: list[tuple[Rung, dict[str, float]]] = [(best.top[name], {})]
        if name in self.raises:
            pair = self.raises[name]
            own = pair.judge(pair.lowest)
            if own.differences:
                rows.append((self.written[name], {n: d.mean for n, d in own.differences.items()}))
        elif name in self.numerical:
            singles = [(r, self.kept.known({**self.kept.top, name: r})) for r in best.rungs[name]]
            rows += [
                (rung, {n: d.mean for n, d in single.differences.items()})
                for rung, single in singles
                if single is not None and single.differences and rung is not best.top[name]
            ]
        return rows

    def _rest(self) -> None:
        """Measure the front beyond the answers."""
        self.report("the rest of the front")
        widest = self._widest
        widest.judge(cheapest_numerics(widest, self.numerical))
        kept, self._pruned = undominated(widest, self.numerical)
        for rungs in by_cost(widest, self.numerical, kept):
            widest.judge(rungs)

    @property
    def _widest(self) -> Comparison:
        """The comparison with the widest choice that can be run."""
        return self.kept if self.best is None or self.fault else self.best

    def _convergences(self, comparison: Comparison) -> Iterator[Convergence]:
        """Convergence of each numerical effect that has enough regular levels."""
        levels = {level_name(factor) for factor in STEP_LEVELS}
        for name in comparison.rungs:
            rungs = [r for r in comparison.rungs[name] if r.name in levels][-_LEVELS_SHOWN:]
            if name in self.numerical and len(rungs) == _LEVELS_SHOWN:
                found = convergence_of(comparison, name, rungs)
                if found is not None:
                    yield found

    # -- results

    def progress(self, *, at_all: bool = False) -> tuple[int, int]:
        """Number of combinations decided, or measured at all, and of those known to be relevant."""
        done, known = 0, 0
        for each in self._all():
            singles = single_changes(each, self.numerical) if id(each) not in self._done else []
            if each not in self.raises.values():
                singles.append(self.written)
            wanted = {names(rungs): each.known(rungs) for rungs in singles}
            wanted |= {tuple(sorted(c.rungs.items())): c for c in each.judged()}
            known += len(wanted) + self._unconfirmed(each)
            done += sum(c is not None and (at_all or each.decided(c)) for c in wanted.values())
        return (known, known) if self._complete else (done, known)

    def remaining(self) -> float:
        """Estimated time of the remaining runs by the tables [s].

        From the known combinations, with present scatter and errors; others may be added on the
        way, and an error estimated from few starts may prove wrong.
        """
        widest = self._widest
        open_ = [each for each in self._all() if each is widest or id(each) not in self._done]
        known = sum(
            seconds_of_doubts(each, self.numerical) + self._confirmation_left(each)
            for each in open_
        )
        return known + seconds_of_front(widest, self.numerical)

    def _unconfirmed(self, comparison: Comparison) -> bool:
        """Whether the present choice is known only from shortened recordings."""
        if self.duration is None or comparison not in self._answers():
            return False
        found = self._cheapest(comparison)
        return found is not None and not comparison.settled(found)

    def _confirmation_left(self, comparison: Comparison) -> float:
        """Tabulated time of whole recordings of the present choice [s]."""
        found = self._cheapest(comparison)
        if found is None or not self._unconfirmed(comparison):
            return 0.0
        runs, starts = self.pilot.uncut(), max(FIRST, found.starts >> self._more_starts())
        both = (found.values, comparison.values(comparison.top))
        return sum(runs.tabulated(values, 0, starts) for values in both)

    def result(self) -> Study:
        """Results so far, without further runs."""
        raised = None
        if self.best is not None and not self.fault and self.best.known(self.best.top):
            raised = self._answer(self.best)
        kept = self._answer(self.kept)
        done, known = self.progress(at_all=True)
        return Study(
            accuracy=self.accuracy,
            written={name: rung.name for name, rung in self.written.items()},
            kept=kept,
            raised=raised,
            raises=tuple(self._raises()),
            refused=tuple(self._refused()),
            pruned=tuple(self._pruned),
            measured=done,
            planned=known,
            status=self._status(raised or kept),
            duration=self.duration,
            share=self.share,
            seconds_left=0.0 if self._complete else self.pilot.measured(self.remaining()),
        )

    def _refused(self) -> Iterator[str]:
        yield from refusals(self.scene, self.effects)
        yield from self._dropped
        for each in self._answers():
            if id(each) in self._cut_alone:
                why = self._cut_alone[id(each)]
                yield f"whole recordings of the reference, which would confirm a choice: {why}"
        if self.fault:
            yield f"the best rungs of every effect together: {self.fault}"

    def _raises(self) -> Iterator[Raise]:
        for name, pair in self.raises.items():
            found = pair.known(pair.lowest)
            if found is not None:
                own, best = self.written[name].name, pair.top[name].name
                yield Raise(effect=name, written=own, best=best, candidate=found)

    def _answer(self, comparison: Comparison) -> Answer:
        judged = [self._with_seconds(c) for c in comparison.judged()]
        judged.sort(key=lambda c: (c.cost, c.error))
        measured = (c for c in judged if comparison.is_top(c))
        reference = next(measured, self._with_seconds(comparison.reference()))
        convergence = tuple(self._convergence.get(id(comparison), ()))
        left = unconverged(convergence)
        status = self._answer_status(comparison, left)
        unsure = ("within", "doubtful") if status == "so far" else ("within",)
        room = self._room(comparison)
        likely = [c for c in judged if c.verdict in unsure and self._fits(c, room)]
        chosen = next(iter(likely), reference)
        if status == "so far" and comparison.is_top(chosen):
            chosen = _best_bet(judged, reference) or reference
        doubted = [c for c in comparison.doubted() if c.cost < chosen.cost]
        own = comparison.known(self.written)
        return Answer(
            reference=reference,
            written=None if own is None else self._with_seconds(own),
            chosen=chosen,
            status="unresolvable" if doubted and status == "resolved" else status,
            candidates=tuple(judged),
            convergence=convergence,
            changes=self._changes(chosen),
        )

    def _fits(self, candidate: Candidate, room: float) -> bool:
        """Whether a candidate fits the accuracy left by the reference."""
        if candidate.verdict == "doubtful":
            return candidate.error <= room
        return room == self.accuracy or estimated_error(candidate) <= room

    def _answer_status(self, comparison: Comparison, left: float) -> str:
        if left > self.accuracy:
            return "not converged"
        if id(comparison) not in self._done:
            return "so far"
        return "resolved"

    def _status(self, answer: Answer) -> str:
        if not self._complete:
            return "out of budget"
        if unconverged(answer.convergence):
            return "not converged"
        doubtful = any(each.verdict == "doubtful" for each in answer.candidates)
        return "unresolvable" if doubtful else "resolved"

    def _changes(self, chosen: Candidate) -> dict[str, Any]:
        if dict(chosen.rungs) == {name: rung.name for name, rung in self.written.items()}:
            return {}
        return {
            path: value
            for path, value in chosen.values.items()
            if value_at(self.scene, path) != value
        }

    def _with_seconds(self, candidate: Candidate) -> Candidate:
        return replace(candidate, seconds=self.pilot.seconds(candidate.values))


def _best_bet(judged: Sequence[Candidate], reference: Candidate) -> Candidate | None:
    """The cheapest with a small guaranteed error, of those cheaper and not ruled out."""
    open_ = [c for c in judged if c.verdict == "doubtful" and c.cost < reference.cost]
    least = min(map(surely_within, open_), default=math.inf)
    most = min(SPARED * least, _NO_BOUND)  # bounds from few starts scatter themselves
    return min((c for c in open_ if surely_within(c) <= most), key=lambda c: c.cost, default=None)
