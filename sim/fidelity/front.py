"""Combinations of rungs worth running besides the answer: those not ruled out by single errors.

`numerical` names the effects whose finer rungs only add cost: steps, tolerances and meshes.
"""

import math
from collections.abc import Mapping, Set
from itertools import product

from ..scene.rungs import Rung
from .choose import added_differences, largest_sum, leaves_room
from .comparison import Comparison

SPARED = 1.5  # a predicted error up to this factor behind the front is run, as sums are estimates


def cheapest_numerics(comparison: Comparison, numerical: Set[str]) -> dict[str, Rung]:
    """The best rungs with the cheapest numerics that use no more than half the accuracy."""
    found = dict(comparison.top)
    for name in numerical & set(comparison.rungs):
        for rung in comparison.rungs[name]:
            known = comparison.known({**comparison.top, name: rung})
            if known is not None and leaves_room(known, comparison.accuracy):
                found[name] = rung
                break
    return found


def single_changes(comparison: Comparison, numerical: Set[str]) -> list[dict[str, Rung]]:
    """The best rungs with each rung of one effect in turn."""
    each = comparison.rungs.items()
    return [_single(comparison, numerical, name, rung) for name, rungs in each for rung in rungs]


def _single(comparison: Comparison, numerical: Set[str], name: str, rung: Rung) -> dict[str, Rung]:
    base = comparison.top if name in numerical else _base(comparison, numerical)
    return {**base, name: rung}


def _base(comparison: Comparison, numerical: Set[str]) -> dict[str, Rung]:
    """Rungs in which physical rungs are tried singly: the best rungs, with cheap numerics."""
    lowered = cheapest_numerics(comparison, numerical)
    known = comparison.known(lowered)
    cheap = known is not None and leaves_room(known, comparison.accuracy)
    return lowered if cheap else dict(comparison.top)


def undominated(
    comparison: Comparison, numerical: Set[str]
) -> tuple[dict[str, list[Rung]], list[str]]:
    """Rungs of each effect that no cheaper one equals, by their single errors; and the others."""
    kept: dict[str, list[Rung]] = {}
    pruned = []
    for name, rungs in comparison.rungs.items():
        kept[name] = [comparison.top[name]]
        ahead = [(r, comparison.judge(_single(comparison, numerical, name, r))) for r in rungs[:-1]]
        ahead.reverse()
        for i, (rung, single) in enumerate(ahead):
            cheaper = [other for _, other in ahead[i + 1 :] if other.cost <= single.cost]
            best = min((other.error for other in cheaper), default=math.inf)
            if single.verdict == "invalid":
                continue  # its reason is listed as invalid
            if best <= single.error:
                pruned.append(f"{name} = {rung.name}: a cheaper one has no larger error")
            else:
                kept[name].append(rung)
    return kept, pruned


def by_cost(
    comparison: Comparison, numerical: Set[str], kept: Mapping[str, list[Rung]]
) -> list[dict[str, Rung]]:
    """Combinations, cheapest first, without those that single errors place behind others."""
    before = {
        name: comparison.judge(_single(comparison, numerical, name, comparison.top[name]))
        for name in kept
    }
    rows: list[tuple[float, float, int, dict[str, Rung]]] = []
    for combination in product(*kept.values()):
        rungs = dict(zip(kept, combination, strict=True))
        alone = [
            added_differences(
                comparison.judge(_single(comparison, numerical, name, rung)), before[name]
            )
            for name, rung in rungs.items()
            if rung is not comparison.top[name]
        ]
        rows.append((comparison.cost(rungs), largest_sum(alone), len(rows), rungs))
    front, least = [], math.inf
    for _, error, _, rungs in sorted(rows, key=lambda row: row[:3]):
        if error < least * SPARED:
            front.append(rungs)
            least = min(least, error)
    return front
