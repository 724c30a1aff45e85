"""What a study of a scene's rungs found: convergence, cost of single rungs, the cheapest choice."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .differences import Candidate


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
class Raise:
    """What one rung of the scene as written costs: its error against the best rung of its effect.

    Attributes
    ----------
    effect : str
    written, best : str
        Names of the rungs.
    candidate : Candidate
        The scene as written, against itself with that one rung raised.
    """

    effect: str
    written: str
    best: str
    candidate: Candidate


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The cheapest combination of rungs that is good enough, among those that may be chosen.

    Attributes
    ----------
    reference : Candidate
        The best of them, which all errors are taken against.
    written : Candidate or None
        The scene as it is written; None where it has not been measured.
    chosen : Candidate
        Cheapest that is within the accuracy, by the tables; the reference where nothing else is.
        Of a search that was ended before, the cheapest that may be, for all that is known, or
        else the cheapest of those that are surely off by the least.
    status : str
        ``resolved``; ``so far`` where the search was ended before; ``unresolvable`` where
        something cheaper could not be told from the reference for scatter; ``not converged``
        where the reference itself is off by more than the accuracy.
    candidates : tuple of Candidate
        All that were measured, cheapest first.
    convergence : tuple of Convergence
        Of the reference, for each numerical effect.
    changes : mapping of str to object
        Dotted path -> value that turns the scene as written into the chosen one.
    """

    reference: Candidate
    written: Candidate | None
    chosen: Candidate
    status: str
    candidates: tuple[Candidate, ...]
    convergence: tuple[Convergence, ...]
    changes: Mapping[str, Any]

    @property
    def left(self) -> float:
        """Error of the reference itself, of the effects that have not converged [-]."""
        return unconverged(self.convergence)

    @property
    def doubted(self) -> tuple[Candidate, ...]:
        """Cheaper combinations that could not be told from the reference."""
        cheaper = (c for c in self.candidates if c.cost < self.chosen.cost)
        return tuple(c for c in cheaper if c.verdict == "doubtful")


@dataclass(frozen=True, kw_only=True)
class Study:
    """Error and cost of every combination that matters.

    Attributes
    ----------
    accuracy : float
    written : mapping of str to str
        Effect -> rung of the scene as it is written.
    kept : Answer
        Where only numerics may change: against the same rungs with the finest numerics.
    raised : Answer or None
        Where rungs may change as well: against the highest admissible rung of every effect. None
        where no rung may, or the best of them were not measured.
    raises : tuple of Raise
        What each rung of the scene as written costs by itself.
    refused : tuple of str
        Rungs that the scene does not admit, with the reason.
    pruned : tuple of str
        Rungs that another is better and cheaper than.
    measured, planned : int
        Combinations measured at all, and all that are known to be of interest.
    status : str
        ``resolved``, ``unresolvable``, ``not converged``, or ``out of budget``.
    duration : float or None
        Length of the recording of each run, where it was cut [s].
    share : float
        Of the time that a run of the scene simulates: what each run did.
    seconds_left : float
        Of one core, that the known combinations still take [s]; NaN without a clock.
    """

    accuracy: float
    written: Mapping[str, str]
    kept: Answer
    raised: Answer | None
    raises: tuple[Raise, ...]
    refused: tuple[str, ...]
    pruned: tuple[str, ...]
    measured: int
    planned: int
    status: str
    duration: float | None = None
    share: float = 1.0
    seconds_left: float = math.nan

    @property
    def whole(self) -> Answer:
        """The answer of widest choice."""
        return self.raised or self.kept

    @property
    def reference(self) -> Candidate:
        """Best rungs that were compared with."""
        return self.whole.reference

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Those of the widest choice, cheapest first."""
        return self.whole.candidates

    @property
    def convergence(self) -> tuple[Convergence, ...]:
        """Of the reference of the widest choice."""
        return self.whole.convergence

    @property
    def front(self) -> tuple[Candidate, ...]:
        """Candidates that no cheaper one is better than."""
        found: list[Candidate] = []
        for one in sorted(self.candidates, key=lambda c: (c.cost, c.error)):
            if math.isfinite(one.error) and (not found or one.error < found[-1].error):
                found.append(one)
        return tuple(found)


def unconverged(levels: Sequence[Convergence]) -> float:
    """Error that effects which have not converged leave in a reference, all together [-].

    Infinite where changes do not shrink from level to level: the last of them bounds nothing.
    """
    open_ = [each for each in levels if not each.converged]
    return sum(e.remaining if math.isfinite(e.order) else math.inf for e in open_)
