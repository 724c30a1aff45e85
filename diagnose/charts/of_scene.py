"""Chart of a scene: where it stands, and what would be enough, with and without other rungs."""

import hashlib
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from threadpoolctl import threadpool_limits

from ... import __version__
from ...datasets.generation.machines import known_of
from ...datasets.generation.quantities import quantity_label
from ...datasets.workers.local import in_order
from ...sim.fidelity.choose import estimated_error
from ...sim.fidelity.ladder import effects_of
from ...sim.fidelity.pilot import Candidate, Outcome, Pilot, starts_to_tell, surely_within
from ...sim.fidelity.study import Answer, Search, Study
from ...sim.scene.parts import Scene
from ..pages.kept import Kept
from .chart import RECOMMENDED, Chart, Choice, Clock, Point, RungCost, front_of, remaining_error
from .scene_edit import block_of, default_step, options_of, written_value
from .words import (
    HERE,
    combination_words,
    effect_words,
    error_words,
    faster_words,
    is_faster,
    percent,
    raise_words,
    rung_words,
    time_words,
    two_digits,
)

KEPT, RAISED = "your rungs kept", "rungs may change"
"""The two questions: only numerics may change; rungs as well."""

_PAUSE = 2.0  # s between two writings of the runs that are kept
_SLACK = 0.9  # of the budget: what runs may take, the rest is for the page


def kept_runs(path: Path | None, scene: Scene) -> Kept[Outcome]:
    """Runs of a scene in a file beside the output.

    Parameters
    ----------
    path : Path or None
        None keeps nothing.
    scene : Scene

    Raises
    ------
    DataError
        The file is damaged, or of another scene or version.
    """
    table = json.dumps(scene.model_dump(mode="json"), sort_keys=True)
    return Kept(
        path,
        hashlib.sha256(f"{__version__} {table}".encode()).hexdigest(),
        table_of=lambda run: [dict(run.quantities), run.fault, run.seconds],
        piece_of=_outcome_of,
        depends="another scene or version",
        pause=_PAUSE,
    )


def _outcome_of(table: Any) -> Outcome:
    quantities, fault, seconds = table
    return Outcome({name: tuple(each) for name, each in quantities.items()}, fault, seconds)


def scene_search(
    scene: Scene,
    *,
    accuracy: float | None = None,
    jobs: int = 1,
    clock: Clock = time.perf_counter,
    kept: Kept[Outcome] | None = None,
    tell: Callable[[str], None] | None = None,
) -> Search:
    """Search over the rungs of a scene, nothing measured yet.

    Parameters
    ----------
    scene : Scene
        Its own fidelity plays no part; what it pins stays as written.
    accuracy : float, optional
        Error that every quantity of interest may carry; the scene's own by default.
    jobs : int
        Worker processes; the errors do not depend on it.
    clock : callable
        Seconds; importable by name where there are workers.
    kept : Kept, optional
        Runs of an earlier search; new ones are added.
    tell : callable, optional
        Called with what is measured next.

    Raises
    ------
    SceneError
        A pinned name is no effect.
    ValueError
        The accuracy is out of bounds.
    """
    known = known_of(scene)
    pilot = Pilot(
        scene,
        known.quantities,
        truth=known.truth,
        clock=clock,
        kept=kept,
        spread=partial(in_order, jobs=jobs),
        at_once=jobs,
    )
    search = Search(scene, known.quantities, accuracy=accuracy, pilot=pilot, tell=tell)
    if known.fewest_turns is not None:
        search.shorten(known.fewest_turns)
    return search


def measure(
    search: Search, *, budget: float | None = None, clock: Clock = time.perf_counter
) -> None:
    """Let a search measure, for so many seconds at most.

    Parameters
    ----------
    search : Search
    budget : float, optional
        Seconds; the first answer is measured in any case.
    clock : callable
        Seconds.
    """
    end = math.inf if budget is None else clock() + _SLACK * budget
    with threadpool_limits(1):  # as in a worker: the same sums in the same order
        search.measure(lambda expected: clock() + expected > end)


def scene_chart(
    scene: Scene,
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    jobs: int = 1,
    clock: Clock = time.perf_counter,
) -> Chart:
    """Measure where a scene stands, and what would be enough.

    Parameters
    ----------
    scene, accuracy, jobs, clock
        As :func:`scene_search`.
    budget : float, optional
        As :func:`measure`.

    Returns
    -------
    Chart

    Raises
    ------
    SceneError
        The scene as written cannot be run with the finest numerics.
    ValueError
        The accuracy is out of bounds.
    """
    search = scene_search(scene, accuracy=accuracy, jobs=jobs, clock=clock)
    measure(search, budget=budget, clock=clock)
    return chart_of(scene, search.found())


def chart_of(scene: Scene, found: Study) -> Chart:
    """Chart of a study.

    Parameters
    ----------
    scene : Scene
    found : Study

    Returns
    -------
    Chart
    """
    found = _decided(scene, found)
    answers = {KEPT: found.kept, **({RAISED: found.raised} if found.raised else {})}
    points = tuple(p for name, a in answers.items() for p in _points(scene, found, a, name))
    choices = tuple(_choice(scene, found, a, name) for name, a in answers.items())
    final = [c for c in choices if c.status == "resolved"]
    where = (_standing(scene, found), *filter(None, [_costly_rungs(scene, found)]))
    alike, best = _alike(found), _best_already(found)
    told = [choices[-1]] if alike else choices
    conclusion = (*where, *(c.sentence for c in told))
    return Chart(
        name=scene.name,
        title=f"{scene.name} (simulated): how much model does this scene need?",
        cost_label="time to compute one simulated second [s]",
        error_label="largest error of a quantity of interest [%]",
        accuracy=found.accuracy,
        points=points,
        reference=REFERENCE,
        status=found.status,
        winner=final[-1].name if len(final) == len(choices) else "",
        verdict=" ".join(conclusion),
        conclusion=conclusion,
        choices=choices,
        raises=tuple(_rung_costs(scene, found)),
        labels=_labels(scene, points),
        convergence=tuple(
            e for a in answers.values() if a is found.whole or not best for e in a.convergence
        ),
        refused=found.refused,
        pruned=found.pruned,
        measured=found.measured,
        planned=found.planned,
        left=_left_words(found),
        alike=alike,
        varied={name: _varied(answer) for name, answer in answers.items()},
        error_labels=_numerical(found),
        at_best=_at_best(scene, found),
        note=_note(scene, found),
    )


def _best_already(found: Study) -> bool:
    """Whether the scene's rungs are the best that it can have: only numerics can be better."""
    return found.raised is not None and _rungs_of(found.raised) == _rungs_of(found.kept)


def _rungs_of(answer: Answer) -> dict[str, str]:
    return dict(answer.reference.rungs)


def _decided(scene: Scene, found: Study) -> Study:
    """A study whose choices stay within the accuracy whatever its references are off by.

    Other rungs that gain next to nothing are not chosen.
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


_NO_GAIN = 0.9  # of the cost: other rungs must save more


def _sure(scene: Scene, found: Study, answer: Answer) -> Answer:
    """The cheapest choice that is clear of the limit instead of one that is not."""
    if answer.status != "resolved" or _by_default(answer):
        return answer
    clear = (c for c in answer.candidates if _fits(found, answer, c) == _CLEAR)
    chosen = next((c for c in clear if c.rungs != answer.reference.rungs), answer.chosen)
    before = _before(scene, chosen.values)
    changes = {path: value for path, value in chosen.values.items() if before[path] != value}
    same = chosen.rungs == answer.chosen.rungs
    return answer if same else replace(answer, chosen=chosen, changes=changes)


_CLEAR = 2


def _fits(found: Study, answer: Answer, each: Candidate) -> int:
    """2 where a candidate is within the accuracy by more than its reference is off; 1 if within."""
    room = found.accuracy - _own_error(answer)
    return 0 if each.verdict != "within" else _CLEAR if estimated_error(each) <= room else 1


def _own_error(answer: Answer) -> float:
    """What a reference may itself be off by [-]."""
    return max(map(remaining_error, answer.convergence), default=0.0)


def _at_limit(found: Study, own: Candidate) -> bool:
    """Whether an error lies nearer to the accuracy than it is known, by two digits at the best."""
    scatter = _scatter(own)
    if own.verdict == "doubtful" and scatter > _FAINT * found.accuracy:
        return False
    apart = abs(own.error - found.accuracy)
    unknown = _own_error(found.whole) + (scatter if math.isfinite(scatter) else 0.0)
    return apart <= max(unknown, _TWO_DIGITS * found.accuracy)


_FAINT = 1 / 3  # of the accuracy: a standard error with which nothing is near anything
_TWO_DIGITS = 0.01  # of the accuracy: what is seen of an error told with two digits


def _alike(found: Study) -> str:
    """Why both questions have one answer, the same settings; empty where they have two."""
    raised = found.raised
    if (
        raised is None
        or dict(raised.changes) != dict(found.kept.changes)
        or _status(found, raised) != _status(found, found.kept)
    ):
        return ""
    if _best_already(found):
        return "your rungs are the best already"
    return "" if _rungs_too_coarse(found) else "nothing is gained by other rungs"


def _varied(answer: Answer) -> str:
    """What differs among the candidates of an answer, in words."""
    rungs = [each.rungs.items() for each in answer.candidates]
    pairs = dict.fromkeys(pair for each in rungs for pair in each)
    names = [effect for effect, _ in pairs]
    return ", ".join(effect_words(e) for e in dict.fromkeys(names) if names.count(e) > 1)


def _numerical(found: Study) -> dict[str, str]:
    """The error axis of what is not against the best rungs."""
    if found.raised is None or _best_already(found):
        return {}
    return {KEPT: "numerical error, against the same rungs [%]"}


def _physical(scene: Scene) -> set[str]:
    return {effect.name for effect in effects_of(scene) if not effect.numerical}


def _at_best(scene: Scene, found: Study) -> tuple[tuple[str, str], ...]:
    best = found.whole.reference.rungs
    physical = _physical(scene)
    return tuple(
        (effect_words(effect), rung)
        for effect, rung in found.written.items()
        if effect in physical and best[effect] == rung
    )


def _left_words(found: Study) -> str:
    """What an unfinished search still takes; empty where that is not known."""
    if found.status != "out of budget" or not found.seconds_left > 0:
        return ""
    return f"some {time_words(found.seconds_left)} more of one processor core"


def _note(scene: Scene, found: Study) -> str:
    """How it was measured."""
    cut = "" if found.duration is None else f", cut from {scene.duration:g} s for more starts"
    return (
        f"{found.duration or scene.duration:.3g} s a run{cut}, with its settling. Times are by "
        "the cost tables, as is the choice, scaled so that the scene as written takes its measured "
        "time; the measured ones, which scatter, are in the JSON"
    )


def _rate(seconds: float, scene: Scene, found: Study) -> float:
    """Time of a simulated second of a scene, by the measured time of a run [s]."""
    return seconds / found.share / scene.duration


def _cost_rate(each: Candidate, scene: Scene, found: Study) -> float:
    """The same by the tables, in measured times of the scene as written [s]."""
    own = found.kept.written
    scale = math.nan if own is None else own.seconds / own.cost
    return _rate(scale * each.cost, scene, found)


REFERENCE = "reference"
"""Name of the point with the best rungs that a question admits, and the finest numerics."""


def _points(scene: Scene, found: Study, answer: Answer, question: str) -> Iterator[Point]:
    """The scene as written first, then the cheapest first."""
    rates = [_cost_rate(each, scene, found) for each in answer.candidates]
    errors = [math.inf if c.verdict == "doubtful" else c.error for c in answer.candidates]
    front = front_of(list(zip(rates, errors, strict=True)))
    rows = list(zip(answer.candidates, rates, front, strict=True))
    rows.sort(key=lambda row: row[0].rungs != found.written)
    for each, rate, on_front in rows:
        best = each.rungs == answer.reference.rungs
        here = each.rungs == found.written
        name = combination_words(each, found.written)
        yield Point(
            name=name,
            rungs=each.rungs,
            seconds=rate,
            errors=each.differences,
            verdict="reference" if best else each.verdict,
            reason=_reason(scene, found, each),
            starts=each.starts,
            on_front=on_front or (each.rungs == answer.chosen.rungs and each.verdict == "within"),
            question=question,
            here=here,
            block=f"# {scene.name}: {name}" if here else _point_block(scene, each, name),
            measured_seconds=_rate(each.seconds, scene, found),
        )


def _words(scene: Scene, found: Study, each: Candidate) -> str:
    """What a candidate has other than the scene, and what the scene has."""
    return combination_words(each, found.written, _before(scene, each.values))


def _point_block(scene: Scene, each: Candidate, name: str) -> str:
    """What a scene must change to be this point."""
    before = _before(scene, each.values)
    changes = {path: value for path, value in each.values.items() if before[path] != value}
    head = f"# {scene.name}: {name}"
    if not changes:
        return head
    return f"{head}\n{block_of(changes, before, {_STEP: default_step(scene)})}"


def _reason(scene: Scene, found: Study, each: Candidate) -> str:
    """Why a candidate is not within, in words."""
    if each.verdict not in ("beyond", "doubtful"):
        return each.reason
    return f"{'at the limit: ' if _at_limit(found, each) else ''}{error_words(each, scene)}"


def where_it_stands(scene: Scene, found: Study) -> str:
    """What is known of the error of a scene as written, in a sentence or two.

    Parameters
    ----------
    scene : Scene
    found : Study
        Finished or not.
    """
    return " ".join(filter(None, [_standing(scene, found), _costly_rungs(scene, found)]))


def _standing(scene: Scene, found: Study) -> str:
    """Error of a scene as written, as far as it is known."""
    whole = found.whole
    own = whole.written
    if own is None or (found.raised is None and found.raises):
        own, against = found.kept.written, "its own finest numerics"
    else:
        against = "the best rungs" if found.raised else "its finest numerics"
    if own is None:
        return "Your scene as written has not been measured."
    off = _own_error(found.whole)
    if _at_limit(found, own):
        close = f"{error_words(own, scene, two_digits(own.error))}, against {against}"
        if off > _NO_SMALL_PART * found.accuracy:
            close += f", and the reference may itself be off by {percent(off)}"
        return (
            f"Your scene as written is at the limit of {percent(found.accuracy)}: {close}: too "
            "close to call."
        )
    known = {"within": "within", "beyond": "not within"}
    word = known.get(own.verdict, "not yet known to be within")
    beside = f" (the reference itself may be {percent(off)} off)"
    return (
        f"Your scene as written is {word} {percent(found.accuracy)} of {against}: "
        f"{error_words(own, scene)}{beside if off > _NO_SMALL_PART * found.accuracy else ''}"
        f"{_cause(found)}."
    )


_NO_SMALL_PART = 0.1


def _cause(found: Study) -> str:
    """Which numerics are to blame, where the rungs are the best and better numerics do."""
    own, chosen = found.whole.written, found.kept.chosen
    if own is None or own.verdict != "beyond" or not _best_already(found):
        return ""
    changed = [e for e, rung in chosen.rungs.items() if rung != found.written.get(e)]
    if chosen.verdict != "within" or not changed:
        return ""
    *first, last = map(effect_words, changed)
    names, verb = (f"{', '.join(first)} and {last}", "are") if first else (last, "is")
    best = "" if _alike(found) else "rungs are the best already, but its "
    return f". Its {best}{names} {verb} too coarse"


def _costly_rungs(scene: Scene, found: Study) -> str:
    """Which rungs of the scene as written cost most, or that none does."""
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
        f"changes the result by {percent(most.candidate.error)} in {worst}"
    )
    if not over:
        return f"No rung of it needs to change. {text}, no other rung by more."
    more = f"; {len(over) - 1} more of your rungs by over {asked} each" if over[1:] else ""
    return f"{text}{more}. Errors of single rungs may cancel each other."


def _choice(scene: Scene, found: Study, answer: Answer, question: str) -> Choice:
    """What to take for a question, with its certainty."""
    chosen = answer.chosen
    name = combination_words(chosen, found.written)
    same_changes = not answer.changes
    status = _status(found, answer)
    return Choice(
        question=question,
        name=name,
        words=_words(scene, found, chosen),
        status=status,
        error=chosen.error,
        standard_error=_scatter(chosen),
        promised=estimated_error(chosen),
        starts=chosen.starts,
        seconds=_cost_rate(chosen, scene, found),
        changes=answer.changes,
        block=_commented(scene, found, answer) if status in RECOMMENDED else "",
        options=options_of(answer.changes) if status in RECOMMENDED else "",
        reference=_reference_words(answer),
        sentence=_sentence(scene, found, answer, question, status),
        keeps=same_changes,
        own_seconds=math.nan
        if answer.written is None
        else _cost_rate(answer.written, scene, found),
        clear=_by_default(answer) or not _at_limit(found, chosen),
        optional=answer.changes != {} and _surely_enough(found, answer.written),
        enough=not (answer is found.kept and _rungs_too_coarse(found)),
    )


def _scatter(chosen: Candidate) -> float:
    """Standard error of the worst quantity; infinite where nothing could be run."""
    worst = max(chosen.differences.values(), key=lambda each: each.error, default=None)
    return math.inf if worst is None else worst.standard_error


def _status(found: Study, answer: Answer) -> str:
    if max(answer.left, _own_error(answer)) > found.accuracy:
        return "not converged"
    if answer.status == "so far" and _by_default(answer) and answer.changes:
        return "no answer yet"
    return answer.status


def _by_default(answer: Answer) -> bool:
    """Whether the reference itself is taken, for want of anything cheaper."""
    return dict(answer.chosen.rungs) == dict(answer.reference.rungs)


def _reference_words(answer: Answer) -> str:
    rungs = answer.reference
    return ", ".join(rung_words(e, r, rungs.values) for e, r in rungs.rungs.items())


_OPENING = {KEPT: "With your rungs kept", RAISED: "If rungs may change"}


def _sentence(scene: Scene, found: Study, answer: Answer, question: str, status: str) -> str:
    """Conclusion about a question."""
    opening, chosen, asked = _OPENING[question], answer.chosen, percent(found.accuracy)
    alike = _alike(found)
    if status == "not converged":
        worst = max(answer.convergence, key=remaining_error)
        label = quantity_label(worst.quantity, scene)[0]
        return (
            f"{opening}, nothing can be recommended: the reference itself still moves with the "
            f"{worst.effect}, by {percent(abs(worst.steps[-1]))} in {label} at the finest level."
        )
    name, faster = _words(scene, found, chosen), _faster(answer, chosen)
    if status == "no answer yet":
        return (
            f"{opening}: {name} is the safe choice ({faster}); whether anything cheaper does, "
            f"there is no answer yet: nothing else is known to be within {asked}"
            f"{_nearest(scene, found, answer)}; more --budget goes on."
        )
    what = "change nothing" if name == HERE else f"take {name}"
    errs = error_words(chosen, scene)
    if _by_default(answer):
        errs = f"nothing cheaper {'looks' if status == 'so far' else 'is'} within {asked}"
    if answer.left:
        both = chosen.verdict == "within" and not _by_default(answer)
        errs += f", the reference itself up to {percent(answer.left)}"
        errs += f", both within {asked}" if both else ""
    faster = "" if name == HERE else f", {faster}"
    certain = _certainty(scene, found, answer, status)
    if answer is found.kept and _rungs_too_coarse(found):
        fine, but = _how_fine(found, answer, status)
        if not _by_default(answer):
            errs += ", against the finest numerics of the same rungs"
        numerics = f"your numerics {fine}" if name == HERE else f"{what}; then your numerics {fine}"
        return (
            f"{opening}, no numerical setting reaches {asked}: {numerics} ({errs}{faster}), {but} "
            f"your rungs are not ({_rungs_off(scene, found)}){certain}."
        )
    own = answer.written
    if name != HERE and _surely_enough(found, own):
        faster_too = is_faster(chosen.cost, cast(Candidate, own).cost)
        spare = f"to run faster, {what}" if faster_too else f"{name} would do too"
        what = f"nothing needs to change; {spare}"
    elif name != HERE and own is not None and _at_limit(found, own):
        what = f"to be on the safe side, {what}"
    lead = _lead(found, answer, question)
    why = f"; {alike}" if alike else ""
    return f"{lead}{what} ({errs}{faster}){why}{certain}.{_one_fewer(scene, found, answer)}"


def _lead(found: Study, answer: Answer, question: str) -> str:
    """How the sentence of a choice begins: one of them is what is recommended, unless in doubt."""
    coarse = any(each.candidate.verdict == "beyond" for each in found.raises)
    unsure = answer.status == "so far" and answer.chosen.verdict == "doubtful"
    if not unsure and (_alike(found) or (question == RAISED and _rungs_too_coarse(found))):
        return "We recommend: "
    if unsure or question == RAISED or (coarse and found.raised is None):
        return f"{_OPENING[question]}: "
    return "We recommend: with your rungs kept, "


def _faster(answer: Answer, each: Candidate) -> str:
    """How its time compares with that of the scene as written."""
    return faster_words(each.cost, math.nan if answer.written is None else answer.written.cost)


def _one_fewer(scene: Scene, found: Study, answer: Answer) -> str:
    """What becomes of a choice of several rungs with one of them as written."""
    changed = _changed_rungs(scene, found, answer.chosen)
    rows = [
        (each.error, changed - own)
        for each in answer.candidates
        for own in [_changed_rungs(scene, found, each)]
        if own < changed and len(own) == len(changed) - 1 and each.verdict == "beyond"
    ]
    if len(changed) == 1 or not rows:
        return ""
    error, [(effect, rung)] = min(rows)
    return (
        f" With one change fewer (without {effect_words(effect)}: {rung}) the best is "
        f"{percent(error)} off."
    )


def _changed_rungs(scene: Scene, found: Study, each: Candidate) -> set[tuple[str, str]]:
    """Rungs of a candidate that the scene as written has not, without its numerics."""
    physical = _physical(scene)
    return {pair for pair in each.rungs.items() if pair[0] in physical} - set(found.written.items())


def _how_fine(found: Study, answer: Answer, status: str) -> tuple[str, str]:
    """What is known of numerics whose rungs are not fine, and the word between both."""
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
    """What of the cheaper errs least, with its scatter; empty where nothing could be run."""
    cheaper = [c for c in answer.candidates if c.cost < answer.reference.cost and c.differences]
    if not cheaper:
        return ""
    least = min(cheaper, key=lambda each: each.error)
    name = _words(scene, found, least)
    return f" ({name}, the nearest, is {error_words(least, scene)})"


def _rungs_too_coarse(found: Study) -> bool:
    """Whether the scene as written surely misses the accuracy for its rungs, not its numerics."""
    own = found.raised.written if found.raised else None
    if own is None or own.verdict != "beyond" or not found.raises:
        return False
    numerics = found.kept.written
    by_itself = any(each.candidate.verdict == "beyond" for each in found.raises)
    return by_itself or numerics is None or numerics.verdict != "beyond"


def _surely_enough(found: Study, own: Candidate | None) -> bool:
    return own is not None and own.verdict == "within" and not _at_limit(found, own)


def _certainty(scene: Scene, found: Study, answer: Answer, status: str) -> str:
    doubted = answer.doubted
    if status == "so far":
        if answer.chosen.verdict != "doubtful":
            return f". So far {_named(found, answer)[1]} enough"
        return f". So far {_likelihood(scene, found, answer)}"
    if status == "unresolvable" and doubted:
        name = _words(scene, found, doubted[0])
        return (
            f"; cheaper, but scatter hides whether it is good enough: {name} "
            f"({error_words(doubted[0], scene)} over {doubted[0].starts} starts); a longer "
            "duration, more settling_revolutions or less accuracy would show it"
        )
    return ""


def _named(found: Study, answer: Answer) -> tuple[str, str, str]:
    """What is or seems enough: the choice, or its numerics where its rungs are too coarse."""
    if answer is found.kept and _rungs_too_coarse(found):
        return "the numerics look", "the numerics are", "the numerics may be"
    return "this looks", "this is", "this may be"


def _likelihood(scene: Scene, found: Study, answer: Answer) -> str:
    """How sure it is that a choice of few starts is enough, and what it takes to know."""
    chosen = answer.chosen
    looks, _, may = _named(found, answer)
    word = looks if chosen.error <= found.accuracy else may
    most, needed = surely_within(chosen), starts_to_tell(chosen, found.accuracy)
    known = f"only an error under {percent(most)}" if most < 1 else "nothing"
    text = f"{word} enough, but after {chosen.starts} starts {known} is certain (at 95 %)"
    if needed > chosen.starts:
        text += f"; to be sure of {percent(found.accuracy)} takes some {needed} starts"
    if chosen.error > found.accuracy:
        safe = _words(scene, found, answer.reference)
        text += f"; {safe} is the safe choice, {_faster(answer, answer.reference)}"
    return text


def _commented(scene: Scene, found: Study, answer: Answer) -> str:
    """Block to paste, with what it is above it."""
    if not answer.changes:
        return ""
    name = _words(scene, found, answer.chosen)
    return f"# {scene.name}: {name}; {error_words(answer.chosen, scene)} (simulated)\n" + block_of(
        answer.changes, _before(scene, answer.changes), {_STEP: default_step(scene)}
    )


def _before(scene: Scene, changes: Mapping[str, Any]) -> dict[str, Any]:
    """What stands at the paths that change."""
    return {path: written_value(scene, path) for path in changes}


_STEP = "numerics.step"


def _rung_costs(scene: Scene, found: Study) -> Iterator[RungCost]:
    """The largest error first; what could not be compared last."""
    known = [math.isfinite(each.candidate.error) for each in found.raises]
    order = [-e.candidate.error if k else 1.0 for e, k in zip(found.raises, known, strict=True)]
    for i in sorted(range(len(order)), key=order.__getitem__):
        each = found.raises[i]
        candidate = each.candidate
        worst = max(candidate.differences, key=lambda n: candidate.differences[n].error, default="")
        yield RungCost(
            effect=effect_words(each.effect),
            written=each.written,
            best=each.best,
            error=candidate.error,
            standard_error=_scatter(candidate),
            worst=quantity_label(worst, scene)[0] if worst else "",
            starts=candidate.starts,
            text=raise_words(each, scene),
        )


def _labels(scene: Scene, points: tuple[Point, ...]) -> Mapping[str, str]:
    names = dict.fromkeys(name for point in points for name in point.errors)
    return {name: quantity_label(name, scene)[0] for name in names}
