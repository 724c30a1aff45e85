"""Convergence of a reference with the levels of its numerics."""

import math
from collections.abc import Sequence
from itertools import pairwise

from ..scene.rungs import Rung
from .comparison import Comparison
from .differences import FIRST, RESOLVED, STILL, Difference, differences
from .findings import Convergence

_SIGMAS = 3.0  # standard errors above which a difference is significant

_ROUNDING = 1e-9  # of relative changes: signals are single, truth is double precision


def convergence_of(comparison: Comparison, name: str, rungs: Sequence[Rung]) -> Convergence | None:
    """Convergence over the starts of its levels' verdicts, or more while they scatter."""
    judged = [comparison.judge({**comparison.top, name: rung}) for rung in rungs]
    starts, found = min(c.starts for c in judged[:-1]), None
    most = min(comparison.starts, comparison.cap)
    while True:
        comparison.pilot.fill([c.values for c in judged], starts)
        runs = [comparison.pilot.outcomes(c.values, starts) for c in judged]
        if any(outcome.fault for row in runs for outcome in row):
            return found
        levels = [[outcome.quantities for outcome in row] for row in runs]
        first, last = (differences(a, b) for a, b in pairwise(levels))
        quantity = max(last, key=lambda each: last[each].error)
        found = _order(
            name, rungs, quantity, first[quantity].mean, last[quantity], comparison.accuracy
        )
        scatter = max(each.standard_error for each in last.values()) / comparison.accuracy
        if scatter <= (RESOLVED if starts >= FIRST else STILL):
            return found
        if 2 * starts > most:  # too few scattered starts
            return found if 2 * starts > comparison.starts else None
        starts *= 2


def _order(
    effect: str,
    rungs: Sequence[Rung],
    quantity: str,
    before: float,
    last: Difference,
    accuracy: float,
) -> Convergence:
    """Order and remaining error from the last two changes of a quantity."""
    silent = last.error <= max(_SIGMAS * last.standard_error, _ROUNDING)
    order = math.log2(abs(before / last.mean)) if before and last.mean else math.nan
    resolved = not silent and math.isfinite(order) and order > 0
    remaining = last.error / (2**order - 1) if resolved else last.error
    return Convergence(
        effect=effect,
        levels=tuple(rung.name for rung in rungs),
        quantity=quantity,
        steps=(before, last.mean),
        order=order if resolved else math.nan,
        remaining=remaining,
        converged=silent or remaining <= RESOLVED * accuracy,
    )
