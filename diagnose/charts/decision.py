"""Recommendations of a scene's chart: the choices of a study, and their certainty."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ...sim.fidelity.choose import estimated_error
from ...sim.fidelity.differences import Candidate
from ...sim.fidelity.findings import Answer, Study
from ...sim.fidelity.ladder import effects_of
from ...sim.scene.scene import Scene
from .chart import remaining_error
from .scene_edit import written_value

KEPT, RAISED = "your rungs kept", "rungs may change"
"""The two questions: only numerics may change; rungs as well."""


def best_already(found: Study) -> bool:
    """Whether the scene has its best possible rungs, so that only numerics can be better."""
    return found.raised is not None and _rungs_of(found.raised) == _rungs_of(found.kept)


def _rungs_of(answer: Answer) -> dict[str, str]:
    return dict(answer.reference.rungs)


def decided(scene: Scene, found: Study) -> Study:
    """Study whose choices stay within the accuracy despite the error of its references.

    Other rungs that save next to nothing are not chosen.
    """
    kept = _sure(scene, found, found.kept)
    if found.raised is None:
        return replace(found, kept=kept)
    raised = _sure(scene, found, found.raised)
    wanted = _fits(found, raised, raised.chosen)
    for own in (c for c in raised.candidates if c.rungs == kept.chosen.rungs):
        little = raised.chosen.cost > _NO_GAIN * own.cost
        if little and _fits(found, raised, own) >= max(wanted, 1):
            raised = replace(raised, chosen=own, changes=kept.changes)
    return replace(found, kept=kept, raised=raised)


_NO_GAIN = 0.9  # of the cost: other rungs must cost less than that


def _sure(scene: Scene, found: Study, answer: Answer) -> Answer:
    """Replace a choice that is not clear of the limit by the cheapest one that is."""
    if answer.status != "resolved" or by_default(answer):
        return answer
    clear = (c for c in answer.candidates if _fits(found, answer, c) == _CLEAR)
    chosen = next((c for c in clear if c.rungs != answer.reference.rungs), answer.chosen)
    before = values_before(scene, chosen.values)
    changes = {path: value for path, value in chosen.values.items() if before[path] != value}
    same = chosen.rungs == answer.chosen.rungs
    return answer if same else replace(answer, chosen=chosen, changes=changes)


_CLEAR = 2


def _fits(found: Study, answer: Answer, each: Candidate) -> int:
    """2 if a candidate is within the accuracy by more than the reference error, 1 if within."""
    room = found.accuracy - reference_error(answer)
    return 0 if each.verdict != "within" else _CLEAR if estimated_error(each) <= room else 1


def reference_error(answer: Answer) -> float:
    """Possible error of a reference itself [-]."""
    return max(map(remaining_error, answer.convergence), default=0.0)


def at_limit(found: Study, own: Candidate) -> bool:
    """Whether an error is nearer to the accuracy than its uncertainty, at least two digits."""
    scatter = scatter_of(own)
    if own.verdict == "doubtful" and scatter > _FAINT * found.accuracy:
        return False
    distance = abs(own.error - found.accuracy)
    unknown = reference_error(found.whole) + (scatter if math.isfinite(scatter) else 0.0)
    return distance <= max(unknown, _TWO_DIGITS * found.accuracy)


_FAINT = 1 / 3  # of the accuracy: with a larger standard error nothing counts as near the limit


_TWO_DIGITS = 0.01  # of the accuracy: resolution of an error given with two digits


def why_alike(found: Study) -> str:
    """Why both questions have the same answer; empty if they differ."""
    raised = found.raised
    if (
        raised is None
        or dict(raised.changes) != dict(found.kept.changes)
        or status_of(found, raised) != status_of(found, found.kept)
    ):
        return ""
    if best_already(found):
        known = "that this scene can run" if found.refused else "already"
        return f"your rungs are the best {known}"
    return "" if rungs_too_coarse(found) else "nothing is gained by other rungs"


def physical_effects(scene: Scene) -> set[str]:
    """Names of the effects that are physical, not numerical."""
    return {effect.name for effect in effects_of(scene) if not effect.numerical}


def scatter_of(chosen: Candidate) -> float:
    """Standard error of the worst quantity; infinite if nothing could be run."""
    worst = max(chosen.differences.values(), key=lambda each: each.error, default=None)
    return math.inf if worst is None else worst.standard_error


def status_of(found: Study, answer: Answer) -> str:
    """Status of a choice, as in :class:`.chart.Choice`."""
    if max(answer.left, reference_error(answer)) > found.accuracy:
        return "not converged"
    if answer.status == "so far" and by_default(answer) and answer.changes:
        return "no answer yet"
    return answer.status


def by_default(answer: Answer) -> bool:
    """Whether the reference itself is chosen because nothing cheaper is within the accuracy."""
    return dict(answer.chosen.rungs) == dict(answer.reference.rungs)


def rungs_too_coarse(found: Study) -> bool:
    """Whether the scene surely misses the accuracy because of its rungs, not its numerics."""
    own = found.raised.written if found.raised else None
    if own is None or own.verdict != "beyond" or not found.raises:
        return False
    numerics = found.kept.written
    by_itself = any(each.candidate.verdict == "beyond" for each in found.raises)
    return by_itself or numerics is None or numerics.verdict != "beyond"


def surely_enough(found: Study, own: Candidate | None) -> bool:
    """Whether a candidate is within the accuracy and not at the limit."""
    return own is not None and own.verdict == "within" and not at_limit(found, own)


def values_before(scene: Scene, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Present values at the paths that change."""
    return {path: written_value(scene, path) for path in changes}
