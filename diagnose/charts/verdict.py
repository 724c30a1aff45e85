"""Chart of a recipe: time saved by training on cheaper rungs, and loss of accuracy.

The waveform may be far off while the verdict is not, and vice versa. Both are measured on the same
simulated machines (:mod:`.charts.across`): trained on each choice of rungs, judged on the best.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...sim.fidelity.differences import Difference
from ...sim.scene.rungs import admissible
from ..feature_rows.feature_table import FeatureTable
from .across import Loss, PairedJudge, RungSets, loss_of
from .chart import Chart, Choice, Point, front_of
from .scene_edit import block_of, options_of
from .words import effect_words, percent

QUESTION = "for the verdict"
LOSS, ERROR = "loss of the verdict", "error of the verdict"
_SURE = 2.0  # standard errors between a loss and the accuracy, for a choice to be sure


@dataclass(frozen=True, kw_only=True)
class _Trial:
    rungs: Mapping[str, str]
    name: str
    loss: Loss
    level_change: float  # dB


def verdict_chart(sets: RungSets, accuracy: float) -> Chart:
    """Measure how much training on cheaper rungs degrades the wear estimate.

    Parameters
    ----------
    sets : RungSets
        Data sets of a recipe.
    accuracy : float
        Largest rise of the mean error on unseen machines, over the condemning limit [-].

    Returns
    -------
    Chart
        Cost: of one record by the tables. Error: rise of the mean absolute error over the
        condemning limit, trained on the point's rungs and judged on the best, against training on
        the best; paired by machine draws. The recipe as written, each rung by itself, and the
        cheapest combination of sufficient rungs are measured.

    Raises
    ------
    DataError
        There are too few machine draws, or the best rungs cannot be simulated.
    """
    judge = sets.judge()
    measured = _Measured(sets, judge)
    measured.trial(sets.best)
    singles = [
        measured.trial({**sets.best, effect.name: rung.name})
        for effect in sets.effects
        for rung in admissible(effect, sets.plain.scene)[:-1]
    ]
    written = measured.trial(sets.written)
    chosen = _chosen(measured, singles, accuracy)
    return _chart(measured, written, chosen, accuracy)


class _Measured:
    """Trials of one recipe, each run once."""

    def __init__(self, sets: RungSets, judge: PairedJudge) -> None:
        self.sets, self.judge = sets, judge
        self.trials: dict[tuple[str, ...], _Trial] = {}

    def trial(self, rungs: Mapping[str, str]) -> _Trial:
        key = tuple(rungs.values())
        if key not in self.trials:
            self.trials[key] = self._made(rungs)
        return self.trials[key]

    def _made(self, rungs: Mapping[str, str]) -> _Trial:
        lower = {e: r for e, r in rungs.items() if r != self.sets.best[e]}
        name = ", ".join(f"{effect_words(e)} {r}" for e, r in lower.items()) or "best rungs"
        loss = loss_of(self.sets, self.judge, "", name, rungs)
        change = math.nan if loss.reason else self._level_change(self.sets.table(rungs))
        return _Trial(rungs=dict(rungs), name=name, loss=loss, level_change=change)

    def _level_change(self, table: FeatureTable) -> float:
        """Mean change of the levels of bands and orders relative to the best rungs [dB]."""
        best = self.judge.best
        shared, mine, theirs = np.intersect1d(
            table.manifest["record_id"], best.manifest["record_id"], return_indices=True
        )
        levels = np.flatnonzero([name.endswith(".level_db") for name in best.names])
        if not len(shared) or not levels.size or table.names != best.names:
            return math.nan
        change = table.values[np.ix_(mine, levels)] - best.values[np.ix_(theirs, levels)]
        return float(np.nanmean(np.abs(change)))


def _within(trial: _Trial, accuracy: float) -> bool:
    """Whether the loss is within the accuracy with certainty, given its scatter."""
    loss = trial.loss.loss
    return bool(
        not trial.loss.reason and loss.mean + _SURE * loss.standard_error <= accuracy
    )  # NaN: no


def _chosen(measured: _Measured, singles: Sequence[_Trial], accuracy: float) -> _Trial:
    """Combine the cheapest rungs that suffice alone; raise them until they suffice together."""
    best, cost = measured.sets.best, measured.sets.cost
    usable = [each for each in singles if _within(each, accuracy)]
    rungs = dict(best)
    for effect in best:
        own = [each for each in usable if each.rungs[effect] != best[effect]]
        if own:
            cheapest = min(own, key=lambda each: cost(each.rungs))
            if cost(cheapest.rungs) < cost(best):
                rungs[effect] = cheapest.rungs[effect]
    while not _within(found := measured.trial(rungs), accuracy):
        lowered = [each for each in usable if _is_part(each, rungs, best)]
        if not lowered:
            return measured.trial(best)
        worst = max(lowered, key=lambda each: each.loss.loss.mean)
        rungs |= {effect: best[effect] for effect in best if worst.rungs[effect] != best[effect]}
    return found


def _is_part(single: _Trial, rungs: Mapping[str, str], best: Mapping[str, str]) -> bool:
    return all(single.rungs[effect] in (best[effect], rungs[effect]) for effect in best)


# --- as a chart


def _chart(measured: _Measured, written: _Trial, chosen: _Trial, accuracy: float) -> Chart:
    trials = list(measured.trials.values())
    points = [_point(measured, trial, written, accuracy) for trial in trials]
    front = front_of([(point.seconds, max(point.error, _NOTHING)) for point in points])
    shown = [replace(p, on_front=f) for p, f in zip(points, front, strict=True)]
    shown.sort(key=lambda point: point.seconds)
    choice = _choice(measured, chosen)
    name = measured.sets.plain.name
    judge = measured.judge
    draws = len(np.unique(judge.draws))
    best = judge.mean(judge.own)
    return Chart(
        name=name,
        title=f"{name} (simulated): which rungs the verdict needs",
        cost_label="cost of one record by the tables [s]",
        error_label="rise of the error [% of the condemning limit]",
        accuracy=accuracy,
        subject="recipe",
        points=tuple(shown),
        reference="best rungs",
        status="resolved",
        winner=chosen.name,
        verdict=choice.sentence,
        conclusion=(choice.sentence, _own_sentence(written, chosen), _waveform_sentence(trials)),
        choices=(choice,),
        labels={LOSS: LOSS, ERROR: f"{ERROR} on the best rungs"},
        note=(
            f"{len(judge.best.values)} records of {draws} machine draws on every choice of rungs, "
            f"the same machines; ridge regression on five folds of whole draws; trained and judged "
            f"on the best rungs the error is {best.mean:.1%} (standard error "
            f"{best.standard_error:.1%}) of the limit"
        ),
    )


_NOTHING = 1e-5  # of the limit: less than any measurable loss


def _point(measured: _Measured, trial: _Trial, written: _Trial, accuracy: float) -> Point:
    loss = trial.loss
    found = {} if loss.reason else {LOSS: _rise(loss.loss), ERROR: loss.error}
    verdict = _verdict(trial, measured, accuracy)
    words = loss.reason or f"levels of bands and orders are {trial.level_change:.2g} dB off"
    if verdict == "doubtful":
        words = (
            f"{percent(_rise(loss.loss).mean)}, standard error "
            f"{percent(loss.loss.standard_error)}, cannot be distinguished from "
            f"{percent(accuracy)}: more records (-n); {words}"
        )
    return Point(
        name=f"{trial.name} (the recipe as written)" if trial is written else trial.name,
        rungs=trial.rungs,
        seconds=measured.sets.cost(trial.rungs),
        errors=found,
        verdict=verdict,
        reason=words,
        counts=LOSS if found else "",
        question=QUESTION,
        written=trial is written,
        block=f"# scene values: {trial.name}\n{block_of(measured.sets.values(trial.rungs))}",
    )


def _rise(loss: Difference) -> Difference:
    """Rise of the error; a gain is attributed to chance and counts as zero."""
    return replace(loss, mean=max(loss.mean, 0.0))


def _verdict(trial: _Trial, measured: _Measured, accuracy: float) -> str:
    if trial.loss.reason:
        return "invalid"
    if trial.rungs == measured.sets.best:
        return "reference"
    if _within(trial, accuracy):
        return "within"
    sure = trial.loss.loss.mean - _SURE * trial.loss.loss.standard_error > accuracy
    return "beyond" if sure else "doubtful"


def _choice(measured: _Measured, chosen: _Trial) -> Choice:
    sets, loss = measured.sets, chosen.loss.loss
    keeps = chosen.rungs == sets.written
    changes = sets.values(chosen.rungs)
    saved = sets.cost(sets.best) / sets.cost(chosen.rungs)
    at_best = chosen.rungs == sets.best
    sentence = (
        "Train on the best rungs: nothing cheaper is certain to preserve the verdict."
        if at_best
        else f"Train with {chosen.name}: cost {saved:.2g} times below that of the best rungs, the "
        f"error of the wear estimate rises by {percent(max(loss.mean, 0.0))} of the condemning "
        f"limit (standard error {percent(loss.standard_error)})."
    )
    return Choice(
        question=QUESTION,
        name=chosen.name,
        status="resolved",
        error=loss.mean,
        standard_error=loss.standard_error,
        promised=loss.mean + _SURE * loss.standard_error,
        starts=chosen.loss.records,
        seconds=sets.cost(chosen.rungs),
        changes=changes,
        block="" if keeps else block_of(changes),
        options="" if keeps else options_of(changes),
        reference="trained on the best rungs, on the same machines",
        sentence=sentence,
        keeps=keeps,
    )


def _own_sentence(written: _Trial, chosen: _Trial) -> str:
    if written.loss.reason:
        return f"The recipe as written has no figure: {written.loss.reason}."
    if written is chosen:
        return "The recipe is written this way already."
    loss = written.loss.loss
    return (
        f"The recipe as written ({written.name}) costs {percent(max(loss.mean, 0.0))} of the limit "
        f"(standard error {percent(loss.standard_error)})."
    )


def _waveform_sentence(trials: Sequence[_Trial]) -> str:
    """Rung with the largest effect on the signal, and its effect on the verdict."""
    usable = [each for each in trials if not each.loss.reason and math.isfinite(each.level_change)]
    most = max(usable, key=lambda each: each.level_change, default=None)
    if most is None or most.level_change == 0:
        return "No rung moves the levels of bands and orders."
    return (
        f"The waveform changes most with {most.name}, by {most.level_change:.2g} dB in bands and "
        f"orders; the verdict loses {percent(max(most.loss.loss.mean, 0.0))}."
    )
