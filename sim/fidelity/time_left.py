"""Estimated time of the remaining runs of a search, by the tables."""

from collections.abc import Set
from statistics import median_high

from .comparison import Comparison, names
from .differences import Candidate, starts_to_decide
from .front import by_cost, single_changes, undominated

_FEWEST = 2  # starts of a comparison


def seconds_of_doubts(comparison: Comparison, numerical: Set[str]) -> float:
    """Tabulated time of the runs that would decide single changes of rungs [s]."""
    singles = [
        r for r in single_changes(comparison, numerical) if names(r) != names(comparison.top)
    ]
    found = {names(rungs): (rungs, comparison.known(rungs)) for rungs in singles}
    open_ = [(r, c) for r, c in found.values() if c is None or not comparison.decided(c)]
    done = max((c.starts for c in comparison.judged()), default=0)
    needed = [_needed(c, comparison) for _, c in open_ if c is not None]
    most, total = max([done, _FEWEST, *needed]), 0.0
    for rungs, known in open_:  # combinations not run at all: as many starts as the others
        first = 0 if known is None else known.starts
        last = most if known is None else _needed(known, comparison)
        total += comparison.pilot.tabulated(comparison.values(rungs), first, last)
    top = comparison.values(comparison.top)
    return total + comparison.pilot.tabulated(top, done, most) if open_ else 0.0


def seconds_of_front(comparison: Comparison, numerical: Set[str]) -> float:
    """Tabulated time of combinations for the rest of the front [s], once they are known."""
    if any(comparison.known(rungs) is None for rungs in single_changes(comparison, numerical)):
        return 0.0
    cap, comparison.cap = comparison.cap, 0.0  # nothing is run
    ahead = by_cost(comparison, numerical, undominated(comparison, numerical)[0])
    comparison.cap = cap
    usual = median_high(c.starts for c in comparison.judged())
    return sum(
        comparison.pilot.tabulated(comparison.values(rungs), 0, usual)
        for rungs in ahead
        if comparison.known(rungs) is None
    )


def _needed(candidate: Candidate, comparison: Comparison) -> int:
    """Starts to decide a doubt: doubled, so at least twice as many."""
    needed = max(starts_to_decide(candidate, comparison.accuracy), 2 * candidate.starts)
    return max(min(comparison.starts, needed), candidate.starts)
