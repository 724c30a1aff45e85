"""Results of a study of a scene's rungs: convergence, cost of single rungs, the cheapest choice."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .differences import Candidate


@dataclass(frozen=True, kw_only=True)
class Convergence:
    """Convergence of the reference with the level of one numerical effect.

    Attributes
    ----------
    effect : str
    levels : tuple of str
        Coarse to fine; the last is that of the reference.
    quantity : str
        Quantity with the largest change.
    steps : tuple of float
        Its changes from level to level [-].
    order : float
        Observed order, base two; NaN if it cannot be determined.
    remaining : float
        Remaining error of the reference after Richardson; the last change if there is no order [-].
    converged : bool
        The remaining error is below a third of the accuracy, or the last change is below scatter.
        Changes that shrink slowly leave a large error.
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
    """Error of one rung of the scene as written, relative to the best rung of its effect.

    Attributes
    ----------
    effect : str
    written, best : str
        Names of the rungs.
    candidate : Candidate
        The scene as written, compared with itself with that one rung raised.
    """

    effect: str
    written: str
    best: str
    candidate: Candidate


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The cheapest sufficient combination of rungs, among those that may be chosen.

    Attributes
    ----------
    reference : Candidate
        The best combination, the reference of all errors.
    written : Candidate or None
        The scene as written; None if it has not been measured.
    chosen : Candidate
        Cheapest combination within the accuracy, by the tables; the reference if there is none.
        For an unfinished search, the cheapest that may be within it by present knowledge, or
        else the cheapest of those with the least guaranteed error.
    status : str
        ``resolved``; ``so far`` if the search is unfinished; ``unresolvable`` if
        something cheaper could not be distinguished from the reference because of scatter;
        ``not converged`` if the reference itself has an error beyond the accuracy.
    candidates : tuple of Candidate
        All measured combinations, cheapest first.
    convergence : tuple of Convergence
        Convergence of the reference, for each numerical effect.
    changes : mapping of str to object
        Dotted path -> value that changes the scene as written to the chosen one.
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
        """Error of the reference itself, from the effects that have not converged [-]."""
        return unconverged(self.convergence)

    @property
    def doubted(self) -> tuple[Candidate, ...]:
        """Cheaper combinations that could not be distinguished from the reference."""
        cheaper = (c for c in self.candidates if c.cost < self.chosen.cost)
        return tuple(c for c in cheaper if c.verdict == "doubtful")


@dataclass(frozen=True, kw_only=True)
class Study:
    """Error and cost of every relevant combination.

    Attributes
    ----------
    accuracy : float
    written : mapping of str to str
        Effect -> rung of the scene as written.
    kept : Answer
        Answer if only numerics may change: relative to the same rungs with the finest numerics.
    raised : Answer or None
        Answer if rungs may change as well: relative to the highest admissible rung of every effect.
        None if no rung may change, or the best of them were not measured.
    raises : tuple of Raise
        Error of each single rung of the scene as written.
    refused : tuple of str
        Rungs that the scene does not admit, with the reason.
    pruned : tuple of str
        Rungs that are both worse and costlier than another.
    measured, planned : int
        Number of combinations measured, and number known to be relevant.
    status : str
        ``resolved``, ``unresolvable``, ``not converged``, or ``out of budget``.
    duration : float or None
        Length of each run's recording, if it was shortened [s].
    share : float
        Share of a full run's simulated time in each run.
    seconds_left : float
        Time still needed for the known combinations on one core [s]; NaN without a clock.
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
        """The answer with the widest choice."""
        return self.raised or self.kept

    @property
    def reference(self) -> Candidate:
        """Best rungs, the reference of the errors."""
        return self.whole.reference

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Candidates of the widest choice, cheapest first."""
        return self.whole.candidates

    @property
    def convergence(self) -> tuple[Convergence, ...]:
        """Convergence of the reference of the widest choice."""
        return self.whole.convergence

    @property
    def front(self) -> tuple[Candidate, ...]:
        """Candidates that no cheaper one surpasses."""
        found: list[Candidate] = []
        for one in sorted(self.candidates, key=lambda c: (c.cost, c.error)):
            if math.isfinite(one.error) and (not found or one.error < found[-1].error):
                found.append(one)
        return tuple(found)


def unconverged(levels: Sequence[Convergence]) -> float:
    """Sum of the errors left in a reference by effects that have not converged [-].

    Infinite if changes do not shrink from level to level: the last of them bounds nothing.
    """
    open_ = [each for each in levels if not each.converged]
    return sum(e.remaining if math.isfinite(e.order) else math.inf for e in open_)
