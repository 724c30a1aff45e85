"""Chart of a scene: its accuracy, and sufficient settings with and without other rungs."""

import hashlib
import json
import math
import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from ... import __version__
from ...datasets.generation.machines import known_of
from ...datasets.generation.quantities import quantity_label
from ...datasets.workers.local import in_order
from ...sim.fidelity.choose import estimated_error
from ...sim.fidelity.differences import Candidate
from ...sim.fidelity.findings import Answer, Study
from ...sim.fidelity.pilot import Pilot
from ...sim.fidelity.runs import Outcome
from ...sim.fidelity.study import Search
from ...sim.fidelity.written import default_step
from ...sim.scene.scene import Scene
from ..pages.kept import Kept
from .chart import RECOMMENDED, Chart, Choice, Point, RungCost, front_of
from .decision import (
    KEPT,
    RAISED,
    at_limit,
    best_already,
    by_default,
    decided,
    physical_effects,
    rungs_too_coarse,
    scatter_of,
    status_of,
    surely_enough,
    values_before,
    why_alike,
)
from .scene_edit import block_of, options_of
from .sentences import change_words, choice_sentence, costly_rungs, standing
from .words import (
    combination_words,
    effect_words,
    error_words,
    raise_words,
    rung_words,
    time_words,
)

_PAUSE = 2.0  # s between two writes of the kept runs
_SLACK = 0.9  # share of the budget for runs; the rest is for the page


def kept_runs(path: Path | None, scene: Scene) -> Kept[Outcome]:
    """Runs of a scene, kept in a file next to the output.

    Parameters
    ----------
    path : Path or None
        None: nothing is kept.
    scene : Scene

    Raises
    ------
    DataError
        The file is damaged, or belongs to another scene or version.
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
    kept: Kept[Outcome] | None = None,
) -> Search:
    """Search over the rungs of a scene; nothing is measured yet.

    Parameters
    ----------
    scene : Scene
        Its fidelity setting is ignored; pinned rungs stay as written.
    accuracy : float, optional
        Largest error of any quantity of interest; by default that of the scene.
    jobs : int
        Worker processes; the errors do not depend on it.
    kept : Kept, optional
        Runs of an earlier search; new ones are added.

    Raises
    ------
    SceneError
        A pinned name is not an effect.
    ValueError
        The accuracy is out of bounds.
    """
    known = known_of(scene)
    pilot = Pilot(
        scene,
        known.quantities,
        truth=known.truth,
        clock=time.perf_counter,
        kept=kept,
        spread=partial(in_order, jobs=jobs),
        at_once=jobs,
    )
    search = Search(scene, known.quantities, accuracy=accuracy, pilot=pilot)
    if known.fewest_turns is not None:
        search.shorten(known.fewest_turns)
    return search


def measure(search: Search, *, budget: float | None = None) -> None:
    """Let a search measure within a time budget.

    Parameters
    ----------
    search : Search
    budget : float, optional
        Time [s]; the first answer is measured in any case.
    """
    end = math.inf if budget is None else time.perf_counter() + _SLACK * budget
    with threadpool_limits(1):  # as in a worker: the same sums in the same order
        search.measure(lambda expected: time.perf_counter() + expected > end)


def scene_chart(
    scene: Scene,
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    jobs: int = 1,
) -> Chart:
    """Measure the accuracy of a scene, and find sufficient settings.

    Parameters
    ----------
    scene, accuracy, jobs
        As in :func:`scene_search`.
    budget : float, optional
        As in :func:`measure`.

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
    search = scene_search(scene, accuracy=accuracy, jobs=jobs)
    measure(search, budget=budget)
    return chart_of(scene, search.result())


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
    found = decided(scene, found)
    answers = {KEPT: found.kept, **({RAISED: found.raised} if found.raised else {})}
    points = tuple(p for name, a in answers.items() for p in _points(scene, found, a, name))
    choices = tuple(_choice(scene, found, a, name) for name, a in answers.items())
    final = [c for c in choices if c.status == "resolved"]
    present = (standing(scene, found), *filter(None, [costly_rungs(scene, found)]))
    alike, best = why_alike(found), best_already(found)
    distinct = [choices[-1]] if alike else choices
    conclusion = (*present, *(c.sentence for c in distinct))
    return Chart(
        name=scene.name,
        title=f"{scene.name} (simulated): how much model does this scene need?",
        cost_label="estimated time per simulated second [s]",
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
        own=_own_words(scene, found),
        note=_note(scene, found),
    )


def _varied(answer: Answer) -> str:
    """Effects that differ among the candidates of an answer, in words."""
    rungs = [each.rungs.items() for each in answer.candidates]
    pairs = dict.fromkeys(pair for each in rungs for pair in each)
    names = [effect for effect, _ in pairs]
    return ", ".join(effect_words(e) for e in dict.fromkeys(names) if names.count(e) > 1)


def _numerical(found: Study) -> dict[str, str]:
    """Labels of error axes whose reference is not the best rungs."""
    if found.raised is None or best_already(found):
        return {}
    return {KEPT: "numerical error, against the same rungs [%]"}


def _at_best(scene: Scene, found: Study) -> tuple[tuple[str, str], ...]:
    best = found.whole.reference.rungs
    physical = physical_effects(scene)
    return tuple(
        (effect_words(effect), rung)
        for effect, rung in found.written.items()
        if effect in physical and best[effect] == rung
    )


def _own_words(scene: Scene, found: Study) -> str:
    """Numerics of the scene as written."""
    own, physical = found.kept.written, physical_effects(scene)
    if own is None:
        return ""
    numerics = [(e, rung) for e, rung in own.rungs.items() if e not in physical]
    return ", ".join(rung_words(e, rung, own.values) for e, rung in numerics)


def _left_words(found: Study) -> str:
    """Remaining time of an unfinished search; empty if unknown."""
    if found.status != "out of budget" or not found.seconds_left > 0:
        return ""
    return f"some {time_words(found.seconds_left)} more of one processor core"


def _note(scene: Scene, found: Study) -> str:
    """How it was measured."""
    cut, slow = "", ""
    if found.duration is not None:
        cut = f", cut from {scene.duration:g} s for more starts"
        slow = "; a choice is confirmed on whole ones, because motion may change over seconds"
    return (
        f"{found.duration or scene.duration:.3g} s per run{cut}, plus settling{slow}. "
        "Times and choices are based on the cost tables, scaled so that the scene as written takes "
        "its measured time; the measured times, which scatter, are in the JSON"
    )


def _rate(seconds: float, scene: Scene, found: Study) -> float:
    """Time per simulated second of a scene, from the measured time of a run [s]."""
    return seconds / found.share / scene.duration


def _cost_rate(each: Candidate, scene: Scene, found: Study) -> float:
    """Time per simulated second by the cost tables, scaled to the scene as written [s]."""
    own = found.kept.written
    scale = math.nan if own is None else own.seconds / own.cost
    return _rate(scale * each.cost, scene, found)


REFERENCE = "reference"
"""Name of the point with the best rungs that a question allows and the finest numerics."""


def _points(scene: Scene, found: Study, answer: Answer, question: str) -> Iterator[Point]:
    """Points of an answer: the scene as written, then by increasing cost."""
    rates = [_cost_rate(each, scene, found) for each in answer.candidates]
    errors = [math.inf if c.verdict == "doubtful" else c.error for c in answer.candidates]
    front = front_of(list(zip(rates, errors, strict=True)))
    rows = list(zip(answer.candidates, rates, front, strict=True))
    rows.sort(key=lambda row: row[0].rungs != found.written)
    for each, rate, on_front in rows:
        best = each.rungs == answer.reference.rungs
        written = each.rungs == found.written
        name = combination_words(each, found.written)
        yield Point(
            name=name,
            rungs=each.rungs,
            seconds=rate,
            errors=each.differences,
            verdict="reference" if best else each.verdict,
            reason=_reason(each, scene),
            close=not best and at_limit(found, each),
            starts=each.starts,
            on_front=on_front or (each.rungs == answer.chosen.rungs and each.verdict == "within"),
            question=question,
            written=written,
            block=f"# {scene.name}: {name}" if written else _point_block(scene, each, name),
            measured_seconds=_rate(each.seconds, scene, found),
        )


def _point_block(scene: Scene, each: Candidate, name: str) -> str:
    """TOML block that turns the scene into this point."""
    before = values_before(scene, each.values)
    changes = {path: value for path, value in each.values.items() if before[path] != value}
    head = f"# {scene.name}: {name}"
    if not changes:
        return head
    return f"{head}\n{block_of(changes, before, {_STEP: default_step(scene)})}"


def _reason(each: Candidate, scene: Scene) -> str:
    """Why a candidate is not within, in words."""
    return error_words(each, scene) if each.verdict in ("beyond", "doubtful") else each.reason


def _choice(scene: Scene, found: Study, answer: Answer, question: str) -> Choice:
    """Recommendation for a question, with its certainty."""
    chosen = answer.chosen
    name = combination_words(chosen, found.written)
    same_changes = not answer.changes
    status = status_of(found, answer)
    return Choice(
        question=question,
        name=name,
        words=change_words(scene, found, chosen),
        status=status,
        error=chosen.error,
        standard_error=scatter_of(chosen),
        promised=estimated_error(chosen),
        starts=chosen.starts,
        seconds=_cost_rate(chosen, scene, found),
        changes=answer.changes,
        block=_commented(scene, found, answer) if status in RECOMMENDED else "",
        options=options_of(answer.changes) if status in RECOMMENDED else "",
        reference=_reference_words(answer),
        sentence=choice_sentence(scene, found, answer, question, status),
        keeps=same_changes,
        own_seconds=math.nan
        if answer.written is None
        else _cost_rate(answer.written, scene, found),
        clear=by_default(answer) or not at_limit(found, chosen),
        optional=answer.changes != {} and surely_enough(found, answer.written),
        enough=not (answer is found.kept and rungs_too_coarse(found)),
    )


def _reference_words(answer: Answer) -> str:
    rungs = answer.reference
    return ", ".join(rung_words(e, r, rungs.values) for e, r in rungs.rungs.items())


def _commented(scene: Scene, found: Study, answer: Answer) -> str:
    """Block to paste, headed by a comment that describes it."""
    if not answer.changes:
        return ""
    name = change_words(scene, found, answer.chosen)
    return f"# {scene.name}: {name}; {error_words(answer.chosen, scene)} (simulated)\n" + block_of(
        answer.changes, values_before(scene, answer.changes), {_STEP: default_step(scene)}
    )


_STEP = "numerics.step"


def _rung_costs(scene: Scene, found: Study) -> Iterator[RungCost]:
    """Errors of the rungs, the largest first; those without comparison last."""
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
            standard_error=scatter_of(candidate),
            worst=quantity_label(worst, scene)[0] if worst else "",
            starts=candidate.starts,
            text=raise_words(each, scene),
        )


def _labels(scene: Scene, points: tuple[Point, ...]) -> Mapping[str, str]:
    names = dict.fromkeys(name for point in points for name in point.errors)
    return {name: quantity_label(name, scene)[0] for name in names}
