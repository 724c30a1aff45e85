"""Sentences of a scene's chart: its accuracy, the recommendation and its certainty."""

import math
from typing import cast

from ...datasets.generation.quantities import quantity_label
from ...sim.fidelity.differences import Candidate, starts_to_decide, surely_within
from ...sim.fidelity.findings import Answer, Study
from ...sim.scene.scene import Scene
from .chart import remaining_error
from .decision import (
    KEPT,
    RAISED,
    at_limit,
    best_already,
    by_default,
    physical_effects,
    reference_error,
    rungs_too_coarse,
    surely_enough,
    values_before,
    why_alike,
)
from .words import (
    AS_WRITTEN,
    combination_words,
    effect_words,
    error_words,
    faster_words,
    few_starts,
    is_faster,
    percent,
    two_digits,
)


def change_words(scene: Scene, found: Study, each: Candidate) -> str:
    """Differences of a candidate from the scene, with the values of the scene."""
    return combination_words(each, found.written, values_before(scene, each.values))


def where_it_stands(scene: Scene, found: Study) -> str:
    """Known error of a scene as written, in a sentence or two.

    Parameters
    ----------
    scene : Scene
    found : Study
        Finished or unfinished study.
    """
    return " ".join(filter(None, [standing(scene, found), costly_rungs(scene, found)]))


def standing(scene: Scene, found: Study) -> str:
    """Error of a scene as written, as far as known."""
    whole = found.whole
    own = whole.written
    if own is None or (found.raised is None and found.raises):
        own, against = found.kept.written, "its own finest numerics"
    else:
        against = _best_words(scene, found) if found.raised else "its finest numerics"
    if own is None:
        return "Your scene as written has not been measured."
    off = reference_error(found.whole)
    if at_limit(found, own):
        error = f"{two_digits(own.error)}{few_starts(own.error, own.starts)}"
        close = f"{error_words(own, scene, error)}, against {against}"
        if off > _NOTABLE * found.accuracy:
            close += f", and the reference may itself be off by {percent(off)}"
        return (
            f"Your scene as written is at the limit of {percent(found.accuracy)}: {close}: too "
            "close to call."
        )
    known = {"within": "within", "beyond": "not within"}
    word = known.get(own.verdict, "not yet known to be within")
    doubt = f" (the reference itself may be {percent(off)} off)"
    return (
        f"Your scene as written is {word} {percent(found.accuracy)} of {against}: "
        f"{error_words(own, scene)}{doubt if off > _NOTABLE * found.accuracy else ''}"
        f"{_cause(found)}."
    )


_NOTABLE = 0.1


def _best_words(scene: Scene, found: Study) -> str:
    """Reference of the error: the best rungs, or the finer numerics if the rungs are the best."""
    physical, listed = physical_effects(scene), [each.rungs for each in found.whole.candidates]
    finer = [
        effect_words(effect)
        for effect in found.whole.reference.rungs
        if effect not in physical and len({rungs.get(effect) for rungs in listed}) > 1
    ]
    return (
        f"the finest {' and '.join(finer)}" if best_already(found) and finer else "the best rungs"
    )


def _cause(found: Study) -> str:
    """Numerics that cause the error, if the rungs are the best and finer numerics suffice."""
    own, chosen = found.whole.written, found.kept.chosen
    if own is None or own.verdict != "beyond" or not best_already(found):
        return ""
    changed = [e for e, rung in chosen.rungs.items() if rung != found.written.get(e)]
    if chosen.verdict != "within" or not changed:
        return ""
    *first, last = map(effect_words, changed)
    names, verb = (f"{', '.join(first)} and {last}", "are") if first else (last, "is")
    best = "" if why_alike(found) else "rungs are the best already, but its "
    return f". Its {best}{names} {verb} too coarse"


def costly_rungs(scene: Scene, found: Study) -> str:
    """Rungs of the scene as written with the largest errors, or that none matters."""
    known = [e for e in found.raises if math.isfinite(e.candidate.error)]
    costly = sorted(known, key=lambda each: -each.candidate.error)
    over = [e for e in costly if found.accuracy < e.candidate.error]
    if not costly or (not over and len(known) < len(found.raises)):
        return ""
    most, asked = costly[0], percent(found.accuracy)
    error = most.candidate.differences
    worst = quantity_label(max(error, key=lambda name: error[name].error), scene)[0]
    text = (
        f"Modelling the {effect_words(most.effect)} as {most.written} rather than {most.best} "
        f"changes the result by {percent(most.candidate.error)}"
        f"{few_starts(most.candidate.error, most.candidate.starts)} in {worst}"
    )
    if not over:
        return f"No rung of it needs to change. {text}, no other rung by more."
    more = f"; {len(over) - 1} more of your rungs by over {asked} each" if over[1:] else ""
    return f"{text}{more}. Errors of single rungs may cancel each other."


_OPENING = {KEPT: "With your rungs kept", RAISED: "If rungs may change"}


def choice_sentence(scene: Scene, found: Study, answer: Answer, question: str, status: str) -> str:
    """Conclusion for a question."""
    opening, chosen, asked = _OPENING[question], answer.chosen, percent(found.accuracy)
    alike = why_alike(found)
    if status == "not converged":
        worst = max(answer.convergence, key=remaining_error)
        label = quantity_label(worst.quantity, scene)[0]
        return (
            f"{opening}, nothing can be recommended: the reference itself still moves with the "
            f"{worst.effect}, by {percent(abs(worst.steps[-1]))} in {label} at the finest level."
        )
    name, faster = change_words(scene, found, chosen), _faster(answer, chosen)
    if status == "no answer yet":
        return (
            f"{opening}: {name} is the safe choice ({faster}); whether anything cheaper suffices, "
            f"is not known yet: nothing else is known to be within {asked}"
            f"{_nearest(scene, found, answer)}; continue with more --budget."
        )
    what = "change nothing" if name == AS_WRITTEN else f"take {name}"
    errs = error_words(chosen, scene)
    if by_default(answer):
        errs = f"nothing cheaper {'looks' if status == 'so far' else 'is'} within {asked}"
    if answer.left:
        both = chosen.verdict == "within" and not by_default(answer)
        errs += f", the reference itself up to {percent(answer.left)}"
        errs += f", both within {asked}" if both else ""
    faster = "" if name == AS_WRITTEN else f", {faster}"
    certain = _certainty(scene, found, answer, status)
    if answer is found.kept and rungs_too_coarse(found):
        fine, but = _how_fine(found, answer, status)
        if not by_default(answer):
            errs += ", against the finest numerics of the same rungs"
        numerics = f"your numerics {fine}"
        if name != AS_WRITTEN:
            numerics = f"{what}; then {numerics}"
        return (
            f"{opening}, no numerical setting reaches {asked}: {numerics} ({errs}{faster}), {but} "
            f"your rungs are not ({_rungs_off(scene, found)}){certain}."
        )
    own = answer.written
    if name != AS_WRITTEN and surely_enough(found, own):
        faster_too = is_faster(chosen.cost, cast(Candidate, own).cost)
        spare = f"to run faster, {what}" if faster_too else f"{name} is sufficient too"
        what = f"nothing needs to change; {spare}"
    elif name != AS_WRITTEN and own is not None and at_limit(found, own):
        what = f"to be on the safe side, {what}"
    lead = _lead(found, answer, question)
    why = f"; {alike}" if alike else ""
    return f"{lead}{what} ({errs}{faster}){why}{certain}.{_one_fewer(scene, found, answer)}"


def _lead(found: Study, answer: Answer, question: str) -> str:
    """Beginning of the sentence on a choice: one of them is recommended, unless in doubt."""
    coarse = any(each.candidate.verdict == "beyond" for each in found.raises)
    unsure = answer.status == "so far" and answer.chosen.verdict == "doubtful"
    if not unsure and (why_alike(found) or (question == RAISED and rungs_too_coarse(found))):
        return "We recommend: "
    if unsure or question == RAISED or (coarse and found.raised is None):
        return f"{_OPENING[question]}: "
    return "We recommend: with your rungs kept, "


def _faster(answer: Answer, each: Candidate) -> str:
    """Time of a candidate compared with that of the scene as written."""
    return faster_words(each.cost, math.nan if answer.written is None else answer.written.cost)


def _one_fewer(scene: Scene, found: Study, answer: Answer) -> str:
    """Error of a choice of several rungs if one of them stays as written."""
    changed = _changed_rungs(scene, found, answer.chosen)
    rows = [
        (each.error, changed - own, each.starts)
        for each in answer.candidates
        for own in [_changed_rungs(scene, found, each)]
        if own < changed and len(own) == len(changed) - 1 and each.verdict == "beyond"
    ]
    if len(changed) == 1 or not rows:
        return ""
    error, [(effect, rung)], starts = min(rows, key=lambda row: row[0])
    return (
        f" With one change fewer (without {effect_words(effect)}: {rung}) the best is "
        f"{percent(error)}{few_starts(error, starts)} off."
    )


def _changed_rungs(scene: Scene, found: Study, each: Candidate) -> set[tuple[str, str]]:
    """Physical rungs of a candidate that differ from the scene as written."""
    physical = physical_effects(scene)
    return {pair for pair in each.rungs.items() if pair[0] in physical} - set(found.written.items())


def _how_fine(found: Study, answer: Answer, status: str) -> tuple[str, str]:
    """Assessment of the numerics if the rungs are not fine, and the conjunction."""
    if status != "so far":
        return "are fine", "but"
    if answer.chosen.error <= found.accuracy:
        return "look fine", "but"
    return "are not known to be fine", "and"


def _rungs_off(scene: Scene, found: Study) -> str:
    """Error of the scene as written, against the best rungs."""
    own = cast(Candidate, found.whole.written)
    return f"{error_words(own, scene)}, against the best rungs"


def _nearest(scene: Scene, found: Study, answer: Answer) -> str:
    """Cheaper candidate with the smallest error, and its scatter; empty if none could be run."""
    cheaper = [c for c in answer.candidates if c.cost < answer.reference.cost and c.differences]
    if not cheaper:
        return ""
    least = min(cheaper, key=lambda each: each.error)
    name = change_words(scene, found, least)
    return f" ({name}, the nearest, is {error_words(least, scene)})"


def _certainty(scene: Scene, found: Study, answer: Answer, status: str) -> str:
    doubted = answer.doubted
    if status == "so far":
        if answer.chosen.verdict != "doubtful":
            return f". So far {_named(found, answer)[1]} enough"
        return f". So far {_likelihood(scene, found, answer)}"
    if status == "unresolvable" and doubted:
        name = change_words(scene, found, doubted[0])
        return (
            f"; cheaper, but scatter hides whether it is good enough: {name} "
            f"({error_words(doubted[0], scene)} over {doubted[0].starts} starts); a longer "
            "duration, more settling_revolutions or less accuracy would show it"
        )
    return ""


def _named(found: Study, answer: Answer) -> tuple[str, str, str]:
    """Subject of the verdict: the choice, or its numerics if the rungs are too coarse."""
    if answer is found.kept and rungs_too_coarse(found):
        return "the numerics look", "the numerics are", "the numerics may be"
    return "this looks", "this is", "this may be"


def _likelihood(scene: Scene, found: Study, answer: Answer) -> str:
    """Certainty of a choice based on few starts, and the number of starts needed."""
    chosen = answer.chosen
    looks, _, may = _named(found, answer)
    word = looks if chosen.error <= found.accuracy else may
    most, needed = surely_within(chosen), starts_to_decide(chosen, found.accuracy)
    known = f"only an error under {percent(most)}" if most < 1 else "nothing"
    text = f"{word} enough, but after {chosen.starts} starts {known} is certain (at 95 %)"
    if needed > chosen.starts:
        text += f"; certainty at {percent(found.accuracy)} takes some {needed} starts"
    if chosen.error > found.accuracy:
        safe = change_words(scene, found, answer.reference)
        text += f"; {safe} is the safe choice, {_faster(answer, answer.reference)}"
    return text
