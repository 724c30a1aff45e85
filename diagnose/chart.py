"""Speed against accuracy: what every choice costs, and how wrong it is.

One chart serves the rungs and steps of a scene (wall time of a simulated second against the error
of its quantities of interest) and the diagnosis of a data set (time of a recording against the
error on unseen machines). Pictures and pages of it are in :mod:`.chart_figure`.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..datasets.csv_cells import safe_cell
from ..datasets.quantities import QUANTITIES
from ..sim.assemble import simulate
from ..sim.atomic import replacing
from ..sim.fidelity import Candidate, Convergence, Difference, Study, study
from ..sim.ladder import with_values
from ..sim.parts import Scene

Progress = Callable[[int, int], None]
Clock = Callable[[], float]

_RUNS = 3  # of a point that is timed; the least counts, for others only add to it
_GAIN = 0.95  # of an error: the most of it that a slower point on the front may have
_TIMING_SHARE = 0.25  # of a budget, on top of it, for timing again what is on the front


@dataclass(frozen=True, kw_only=True)
class Point:
    """One choice.

    Attributes
    ----------
    name : str
        What it has other than the reference.
    rungs : mapping of str to str
        All of the choice, effect by effect.
    seconds : float
        Least of the measured times, of one simulated second or one recording [s]; NaN where it
        never ran.
    errors : mapping of str to Difference
        Of every quantity [-]; empty where it is not valid.
    verdict : str
        ``within``, ``beyond``, ``doubtful`` or ``invalid``; ``reference``.
    reason : str
        Why it is not within.
    starts : int
        That the errors are means of.
    on_front : bool
        No other point is both faster and more accurate.
    counts : str
        Quantity by which it is judged; the one with the largest error where none is named.
    """

    name: str
    rungs: Mapping[str, str]
    seconds: float
    errors: Mapping[str, Difference] = field(default_factory=dict)
    verdict: str = "within"
    reason: str = ""
    starts: int = 1
    on_front: bool = False
    counts: str = ""

    @property
    def worst(self) -> str:
        """Quantity by which the point is judged; empty where there is none."""
        if self.counts:
            return self.counts
        return max(self.errors, key=lambda name: self.errors[name].error, default="")

    @property
    def error(self) -> float:
        """Of that quantity [-]; infinite where it is not valid."""
        return self.errors[self.worst].error if self.errors else math.inf

    @property
    def standard_error(self) -> float:
        """Of that error [-]; NaN where it cannot be told."""
        found = self.errors[self.worst].standard_error if self.errors else math.nan
        return found if math.isfinite(found) else math.nan


@dataclass(frozen=True, kw_only=True)
class Chart:
    """Every choice that ran, with the front.

    Attributes
    ----------
    name, title : str
    cost_label, error_label : str
        Of the axes, with units.
    accuracy : float or None
        Asked; None where only the front counts.
    points : tuple of Point
        Fastest first.
    reference : str
        Name of the point that errors are taken against; empty where truth is known.
    status : str
        ``resolved``, ``unresolvable``, ``not converged`` or ``out of budget``.
    winner : str
        Name of the fastest point within the accuracy; empty where none may be named.
    verdict : str
        The finding in one sentence.
    convergence : tuple of Convergence
        Of the reference.
    refused, pruned : tuple of str
        What did not run, and why.
    note : str
        How it was measured.
    """

    name: str
    title: str
    cost_label: str
    error_label: str
    accuracy: float | None
    points: tuple[Point, ...]
    reference: str
    status: str
    winner: str
    verdict: str
    convergence: tuple[Convergence, ...] = ()
    refused: tuple[str, ...] = ()
    pruned: tuple[str, ...] = ()
    note: str = ""

    @property
    def front(self) -> tuple[Point, ...]:
        """Points that no other is both faster and more accurate than, fastest first."""
        return tuple(point for point in self.points if point.on_front)

    @property
    def remaining(self) -> float:
        """Error that the reference itself is left with [-]: below it no error is known."""
        return max(map(remaining_error, self.convergence), default=0.0)


def remaining_error(each: Convergence) -> float:
    """Error that Richardson leaves in the reference [-], an order below a half not believed.

    Parameters
    ----------
    each : Convergence

    Returns
    -------
    float
        The last change where no order can be told.

    References
    ----------
    Roache, "Quantification of uncertainty in computational fluid dynamics", Annual Review of Fluid
    Mechanics 29 (1997) 123-160, doi:10.1146/annurev.fluid.29.1.123: an extrapolation from orders
    far from theory says nothing.

    Examples
    --------
    >>> changes = dict(effect="mesh", levels=("x2", "x1", "x1/2"), quantity="rms", converged=True)
    >>> slow = Convergence(**changes, steps=(0.011, 0.01), order=0.14, remaining=0.098)
    >>> round(remaining_error(slow), 4)
    0.0241
    """
    if not math.isfinite(each.order):
        return each.remaining
    return abs(each.steps[-1]) / (2 ** max(each.order, _LEAST_ORDER) - 1)


_LEAST_ORDER = 0.5


def front_of(places: Sequence[tuple[float, float]]) -> list[bool]:
    """Which of some (cost, error) pairs no other beats in one without losing in the other.

    Parameters
    ----------
    places : sequence of (float, float)
        A pair that is not finite is on no front.

    Returns
    -------
    list of bool
        In the order given; of equal pairs the first. Slower for less than a twentieth of the error
        is no gain: times scatter more.

    Examples
    --------
    >>> front_of([(1.0, 0.5), (2.0, 0.1), (3.0, 0.2), (0.5, float("inf")), (2.1, 0.0999)])
    [True, True, False, False, False]
    """
    finite = [i for i, place in enumerate(places) if all(map(math.isfinite, place))]
    found, least = [False] * len(places), math.inf
    for i in sorted(finite, key=places.__getitem__):
        if places[i][1] < _GAIN * least:
            found[i], least = True, places[i][1]
    return found


# --- a scene


def scene_chart(
    scene: Scene,
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    clock: Clock = time.perf_counter,
    progress: Progress | None = None,
) -> Chart:
    """Measure every combination of rungs and steps of a scene that matters.

    Parameters
    ----------
    scene : Scene
        Its own fidelity plays no part; what it pins stays as written.
    accuracy : float, optional
        Error that every quantity of interest may carry; the scene's own by default.
    budget : float, optional
        Seconds after which no further combination is begun.
    clock : callable
        Seconds.
    progress : callable, optional
        Called with (combinations done, combinations in all).

    Returns
    -------
    Chart

    Raises
    ------
    SceneError
        The reference cannot be run.
    ValueError
        The accuracy is out of bounds.

    Notes
    -----
    Errors are those of :func:`wearstate.sim.fidelity.study`, against the highest admissible rung
    of every effect. What is on the front is timed again, so that the least of several runs counts.
    """
    found = study(
        scene,
        QUANTITIES[scene.machine],
        accuracy=accuracy,
        budget=budget,
        clock=clock,
        progress=progress,
    )
    spare = math.inf if budget is None else _TIMING_SHARE * budget
    return chart_of(scene, found, timed_again(scene, found, clock, spare))


def timed_again(
    scene: Scene, found: Study, clock: Clock, spare: float = math.inf
) -> dict[int, float]:
    """Least seconds of a run of every candidate; those on the front run some times more.

    Parameters
    ----------
    scene : Scene
    found : Study
        Timed.
    clock : callable
        Seconds.
    spare : float
        Seconds of `clock` after which no further run is begun.

    Returns
    -------
    dict of int to float
        Number of the candidate in the study -> seconds.
    """
    seconds = {i: each.seconds for i, each in enumerate(found.candidates)}
    chosen = front_of([(each.seconds, each.error) for each in found.candidates])
    end = clock() + spare
    for i in (i for i, front in enumerate(chosen) if front):
        for _ in range(_RUNS):
            if clock() >= end:
                return seconds
            seconds[i] = min(seconds[i], _time_of(scene, found.candidates[i], clock))
    return seconds


def _time_of(scene: Scene, candidate: Candidate, clock: Clock) -> float:
    chosen = with_values(scene, {**candidate.values, "fidelity": "given"})
    begin = clock()
    simulate(chosen, seed=0, truth=True, raise_on_failure=False)
    return clock() - begin


def chart_of(scene: Scene, found: Study, seconds: Mapping[int, float]) -> Chart:
    """Chart of a study.

    Parameters
    ----------
    scene : Scene
    found : Study
    seconds : mapping of int to float
        Number of the candidate -> least seconds of a run.

    Returns
    -------
    Chart
    """
    rates = [seconds[i] / scene.duration for i in range(len(found.candidates))]
    front = front_of(
        [(rate, each.error) for rate, each in zip(rates, found.candidates, strict=True)]
    )
    best = dict(found.reference.rungs)
    points = tuple(
        Point(
            name=difference_name(each.rungs, best),
            rungs=each.rungs,
            seconds=rate,
            errors=each.differences,
            verdict="reference" if dict(each.rungs) == best else each.verdict,
            reason=each.reason,
            starts=each.starts,
            on_front=on_front,
        )
        for each, rate, on_front in zip(found.candidates, rates, front, strict=True)
    )
    points = tuple(sorted(points, key=lambda p: (not math.isfinite(p.seconds), p.seconds)))
    winner, status, verdict = _finding(points, found)
    return Chart(
        name=scene.name,
        title=f"{scene.name} (simulated): speed against accuracy",
        cost_label="wall time of a simulated second [s/s]",
        error_label="largest error of a quantity of interest [%]",
        accuracy=found.accuracy,
        points=points,
        reference=REFERENCE,
        status=status,
        winner=winner,
        verdict=verdict,
        convergence=found.convergence,
        refused=found.refused,
        pruned=found.pruned,
        note=f"{scene.duration:g} s a run, with its settling; the least of several runs",
    )


REFERENCE = "reference"
"""Name of the point with the highest admissible rung of every effect."""


def difference_name(rungs: Mapping[str, str], best: Mapping[str, str]) -> str:
    """What a combination has other than the reference, in words.

    Examples
    --------
    >>> difference_name({"film": "map", "mesh": "x1"}, {"film": "direct", "mesh": "x1"})
    'film map'
    """
    parts = [f"{effect} {rung}" for effect, rung in rungs.items() if rung != best.get(effect)]
    return ", ".join(parts) or REFERENCE


def _finding(points: Sequence[Point], found: Study) -> tuple[str, str, str]:
    """Winner, status and sentence."""
    open_ends = [
        each
        for each in found.convergence
        if not each.converged or remaining_error(each) > found.accuracy
    ]
    if open_ends:
        text = "; ".join(f"{e.effect} moves {e.quantity} by {_steps(e)}" for e in open_ends)
        return "", "not converged", f"no winner: the reference does not converge, {text}"
    good = [p for p in points if p.verdict in ("within", "reference") and math.isfinite(p.seconds)]
    if not good:
        return "", "out of budget", "no winner: nothing ran within the budget"
    winner = good[0]
    doubted = [p for p in points if p.verdict == "doubtful" and p.seconds < winner.seconds]
    if doubted and found.status != "out of budget":  # where more starts might have told
        return (
            "",
            "unresolvable",
            f"unresolvable at {100 * found.accuracy:.3g} %: {doubted[0].name} is faster than "
            f"all that is within, but {doubted[0].reason} over {doubted[0].starts} starts; ask for "
            "less accuracy or a longer duration",
        )
    slowest = next(p for p in points if p.verdict == "reference")
    status = "out of budget" if found.status == "out of budget" else "resolved"
    late = ", of what the budget left time for" if status == "out of budget" else ""
    return (
        winner.name,
        status,
        f"within {100 * found.accuracy:.3g} % the fastest{late}: {winner.name}, "
        f"{winner.error:.2%} off, {slowest.seconds / winner.seconds:.3g} times as fast as the "
        "reference",
    )


def _steps(each: Convergence) -> str:
    return " then ".join(f"{abs(step):.2%}" for step in each.steps)


# --- showing


def chart_table(chart: Chart) -> dict[str, Any]:
    """A chart as plain values.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    dict
        ``verdict``, ``winner`` (None without one), ``status``, ``points`` fastest first, names of
        the ``front``, ``convergence``, and what did not run.
    """
    return {
        "name": chart.name,
        "verdict": chart.verdict,
        "status": chart.status,
        "winner": chart.winner or None,
        "accuracy": chart.accuracy,
        "axes": {"cost": chart.cost_label, "error": chart.error_label},
        "measured": chart.note,
        "front": [point.name for point in chart.front],
        "points": [_point_table(point) for point in chart.points],
        "reference_error": chart.remaining,
        "convergence": [
            {
                "effect": each.effect,
                "levels": list(each.levels),
                "quantity": each.quantity,
                "changes": list(each.steps),
                "observed_order": each.order,
                "remaining_error": remaining_error(each),
                "converged": each.converged,
            }
            for each in chart.convergence
        ],
        "refused": list(chart.refused),
        "pruned": list(chart.pruned),
    }


def _point_table(point: Point) -> dict[str, Any]:
    return {
        "name": point.name,
        "rungs": dict(point.rungs),
        "seconds": point.seconds,
        "error": point.error,
        "worst": point.worst,
        "verdict": point.verdict,
        "reason": point.reason,
        "starts": point.starts,
        "on_front": point.on_front,
        "errors": {
            name: {"mean": each.mean, "standard_error": each.standard_error}
            for name, each in point.errors.items()
        },
    }


CSV_HEAD = ("point", "on_front", "verdict", "seconds", "quantity", "error", "standard_error")


def chart_rows(chart: Chart) -> list[tuple[Any, ...]]:
    """A chart as rows of :data:`CSV_HEAD`, one for every quantity of every point.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    list of tuple
        Of a point that is not valid one row without quantity.
    """
    rows: list[tuple[Any, ...]] = []
    for point in chart.points:
        head = (point.name, int(point.on_front), point.verdict, point.seconds)
        rows += [(*head, name, d.mean, d.standard_error) for name, d in point.errors.items()]
        if not point.errors:
            rows.append((*head, "", math.nan, math.nan))
    return rows


def chart_text(chart: Chart) -> str:
    """A chart as lines for a terminal: verdict, front, convergence, what did not run.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    str
    """
    lines = [chart.title, chart.verdict, ""]
    lines += [f"{chart.cost_label:>40}  {'error':>9}  on the front"]
    lines += [
        f"{point.seconds:40.4g}  {point.error:9.3%}  {point.name}"
        + (f" ({point.worst})" if point.error > 0 else "")
        for point in chart.front
    ]
    if chart.convergence:
        lines += ["", "convergence of the reference"]
        lines += [f"  {convergence_text(each)}" for each in chart.convergence]
    dropped = [f"{p.name}: {p.reason}" for p in chart.points if p.verdict in _UNUSABLE]
    for title, texts in (
        ("not valid, or not to be told", dropped),
        ("refused", chart.refused),
        ("pruned", chart.pruned),
    ):
        lines += ["", title, *(f"  {text}" for text in texts)] if texts else []
    return "\n".join([*lines, "", f"measured: {chart.note}"])


_UNUSABLE = ("invalid", "doubtful")


def convergence_text(each: Convergence) -> str:
    """How the reference converges with one effect, in one line.

    Examples
    --------
    >>> convergence_text(Convergence(effect="step", levels=("x2", "x1", "x1/2"), quantity="peak",
    ...     steps=(0.04, 0.01), order=2.0, remaining=0.0033, converged=True))
    'step x2, x1, x1/2: peak moves by 4.00% then 1.00%, order 2.00, 0.33% left'
    """
    order = f"order {each.order:.2f}" if math.isfinite(each.order) else "no order to be told"
    word = "" if each.converged else "; NOT CONVERGED"
    return (
        f"{each.effect} {', '.join(each.levels)}: {each.quantity} moves by {_steps(each)}, "
        f"{order}, {remaining_error(each):.2%} left{word}"
    )


def save_rows(chart: Chart, path: Path, *, force: bool = True) -> None:
    """Write :func:`chart_rows` as CSV, whole or not at all."""
    import csv

    with (
        replacing(path, force=force) as fresh,
        fresh.open("w", newline="", encoding="utf-8") as handle,
    ):
        writer = csv.writer(handle)
        writer.writerow(CSV_HEAD)
        writer.writerows([safe_cell(cell) for cell in row] for row in chart_rows(chart))
