"""Speed against accuracy: cost and error of every choice.

One chart serves the rungs and steps of a scene (:mod:`.charts.of_scene`: wall time of a simulated
second against the error of its quantities of interest) and the diagnosis of a data set
(:mod:`.charts.of_models`: time of a recording against the error on unseen machines). Pictures and
pages of it are in :mod:`.charts.figure`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ...datasets.file.csv_cells import save_rows
from ...sim.fidelity.differences import Difference
from ...sim.fidelity.findings import Convergence

Clock = Callable[[], float]

RECOMMENDED = ("resolved", "so far", "unresolvable")
"""Statuses with which a choice is recommended."""

_GAIN = 0.95  # largest error of a slower point on the front, relative to the faster one


@dataclass(frozen=True, kw_only=True)
class Point:
    """One choice.

    Attributes
    ----------
    name : str
        Differences from the scene as written, in words.
    rungs : mapping of str to str
        Effect -> rung of the choice.
    seconds : float
        Cost used for drawing and choosing, per simulated second or recording [s]: for a scene from
        the cost tables, scaled so that the scene as written takes its measured time.
    errors : mapping of str to Difference
        Errors of every quantity [-]; empty if the choice is not valid.
    verdict : str
        ``within``, ``beyond``, ``doubtful`` or ``invalid``; ``reference``.
    reason : str
        Why it is not within.
    starts : int
        Number of starts over which the errors are averaged.
    on_front : bool
        No other point is both faster and more accurate.
    counts : str
        Quantity by which it is judged; empty for the one with the largest error.
    question : str
        Question to which it belongs if a chart answers several; errors are against the reference
        of that question.
    written : bool
        The scene as written.
    block : str
        TOML to paste into the scene or recipe; only a comment if nothing is to be changed, empty
        if the choice does not belong to a scene.
    close : bool
        Its error is nearer to the accuracy than the reference is known.
    measured_seconds : float
        Shortest measured time for what `seconds` refers to; NaN if not measured.
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
    question: str = ""
    written: bool = False
    block: str = ""
    close: bool = False
    measured_seconds: float = math.nan

    @property
    def worst(self) -> str:
        """Quantity by which the point is judged; empty if there is none."""
        if self.counts:
            return self.counts
        return max(self.errors, key=lambda name: self.errors[name].error, default="")

    @property
    def error(self) -> float:
        """Error of that quantity [-]; infinite if the point is not valid."""
        return self.errors[self.worst].error if self.errors else math.inf

    @property
    def standard_error(self) -> float:
        """Standard error of that error [-]; NaN if unknown."""
        found = self.errors[self.worst].standard_error if self.errors else math.nan
        return found if math.isfinite(found) else math.nan


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Recommendation for one question.

    Attributes
    ----------
    question : str
        As in :class:`Point`.
    name : str
        Name of the point.
    status : str
        ``resolved``, ``so far``, ``unresolvable``, ``not converged`` or ``no answer yet``.
    error, standard_error, promised : float
        Error and standard error of the worst quantity, and the largest sum of both over all
        quantities [-].
    starts : int
        Number of starts over which the error is averaged.
    seconds : float
        Cost of a simulated second [s].
    changes : mapping of str to object
        Changes to the scene as written: dotted path -> value.
    block, options : str
        The changes as TOML to paste, and as options of a command.
    reference : str
        Reference of the error, in words.
    sentence : str
        The conclusion.
    keeps : bool
        Nothing is to be changed.
    words : str
        The name, with the values of the scene as written.
    own_seconds : float
        Cost of a simulated second of the scene as written [s]; NaN if it was not timed.
    clear : bool
        It is within the accuracy by more than the error of its reference.
    optional : bool
        The scene as written is surely within the accuracy too.
    enough : bool
        False if the rungs of the scene keep it outside the accuracy even so.
    """

    question: str
    name: str
    status: str
    error: float
    standard_error: float
    promised: float
    starts: int
    seconds: float
    changes: Mapping[str, Any]
    block: str
    options: str
    reference: str
    sentence: str
    keeps: bool
    words: str = ""
    own_seconds: float = math.nan
    clear: bool = True
    optional: bool = False
    enough: bool = True


@dataclass(frozen=True, kw_only=True)
class RungCost:
    """Error of one rung of the scene as written against the best rung of its effect.

    Attributes
    ----------
    effect, written, best : str
        Effect in words, names of the rungs.
    error, standard_error : float
        Error of the worst quantity, and its standard error [-].
    worst : str
        That quantity in words.
    starts : int
        Number of starts over which the error is averaged.
    text : str
        Summary in one line.
    """

    effect: str
    written: str
    best: str
    error: float
    standard_error: float
    worst: str
    starts: int
    text: str


@dataclass(frozen=True, kw_only=True)
class Chart:
    """All choices that ran, with the front.

    Attributes
    ----------
    name, title : str
    cost_label, error_label : str
        Labels of the axes, with units.
    accuracy : float or None
        Requested accuracy; None if only the front matters.
    points : tuple of Point
        Fastest first.
    reference : str
        Name of the reference point of the errors; empty if the truth is known.
    status : str
        ``resolved``, ``unresolvable``, ``not converged`` or ``out of budget``.
    winner : str
        Name of the fastest point within the accuracy; empty if there is none.
    verdict : str
        The finding in one sentence.
    convergence : tuple of Convergence
        Convergence of the reference.
    refused, pruned : tuple of str
        Choices that did not run, and why.
    note : str
        How the chart was measured.
    conclusion : tuple of str
        For a scene: the finding in a few sentences.
    choices : tuple of Choice
        For a scene: recommendation for each question.
    raises : tuple of RungCost
        Error of each rung of the scene as written.
    labels : mapping of str to str
        Quantity -> words and unit; a quantity without a label is shown by its name.
    measured, planned : int
        Points measured, and points of interest; both 0 if nothing was left out.
    left : str
        Remaining time of an unfinished search, in words; empty if unknown.
    alike : str
        Why all questions have the same answer, of which the last is shown; empty if they differ.
    varied : mapping of str to str
        Question -> what may vary, in words.
    error_labels : mapping of str to str
        Question -> name of its error axis, if not `error_label`.
    at_best : tuple of (str, str)
        Effects of the scene as written that already have their best rung, and that rung.
    own : str
        Numerics of the scene as written, in words; empty if they were not run.
    subject : str
        ``scene``, or ``recipe`` if the errors are those of the verdict.
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
    conclusion: tuple[str, ...] = ()
    choices: tuple[Choice, ...] = ()
    raises: tuple[RungCost, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    measured: int = 0
    planned: int = 0
    left: str = ""
    alike: str = ""
    varied: Mapping[str, str] = field(default_factory=dict)
    error_labels: Mapping[str, str] = field(default_factory=dict)
    at_best: tuple[tuple[str, str], ...] = ()
    own: str = ""
    subject: str = "scene"

    @property
    def questions(self) -> tuple[str, ...]:
        """Questions of its points, in their order."""
        return tuple(dict.fromkeys(point.question for point in self.points))

    @property
    def shown(self) -> tuple[str, ...]:
        """Questions that are shown: only the last, with most points, if all have one answer."""
        return self.questions[-1:] if self.alike else self.questions

    def heading(self, question: str) -> str:
        """Heading of a question, with what may vary."""
        what = "all choices" if self.alike else question
        if question in self.varied:
            what = f"{what}: {self.varied[question]} may vary"
        return f"{what} (numerics only, against the same rungs)" if self.partial(question) else what

    def partial(self, question: str) -> bool:
        """Whether errors of a question include only those of the numerics, not of the rungs."""
        return question in self.error_labels

    def verdict_words(self, point: Point) -> str:
        """Verdict on a point, marked if it only concerns its numerics."""
        words = "at the limit" if point.close else point.verdict
        judged = self.partial(point.question) and point.verdict not in ("reference", "invalid")
        return f"numerics {words}" if judged else words

    def error_name(self, question: str) -> str:
        """Name of the error axis of a question."""
        return self.error_labels.get(question, self.error_label)

    @property
    def shown_choices(self) -> tuple[Choice, ...]:
        """Choices of the questions that are shown."""
        return self.choices[-1:] if self.alike else self.choices

    @property
    def unfinished(self) -> bool:
        """Whether something was left out for lack of time."""
        return self.status == "out of budget"

    def of(self, question: str) -> tuple[Point, ...]:
        """Points of a question."""
        return tuple(point for point in self.points if point.question == question)

    def numbered(self, question: str) -> tuple[Point, ...]:
        """Points of its front, fastest first, without those that a picture names."""
        front = [p for p in self.of(question) if p.on_front and not p.written]
        front = [p for p in front if p.verdict != "reference"]
        return tuple(sorted(front, key=lambda p: p.seconds))

    def number(self, choice: Choice) -> int | None:
        """Number of a choice in the picture of its question; None if it has none."""
        names = [point.name for point in self.numbered(choice.question)]
        return names.index(choice.name) + 1 if choice.name in names else None

    def label(self, quantity: str) -> str:
        """A quantity in words."""
        return self.labels.get(quantity, quantity)

    @property
    def front(self) -> tuple[Point, ...]:
        """Points for which no other is both faster and more accurate, fastest first."""
        return tuple(point for point in self.points if point.on_front)

    @property
    def remaining(self) -> float:
        """Remaining error of the reference itself [-]; smaller errors are unknown."""
        return max(map(remaining_error, self.convergence), default=0.0)


def remaining_error(each: Convergence) -> float:
    """Error left in the reference [-], by Richardson extrapolation with an order >= 1/2.

    Parameters
    ----------
    each : Convergence

    Returns
    -------
    float
        The last change if no order can be estimated.

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
    """Find the (cost, error) pairs that no other pair improves in one without loss in the other.

    Parameters
    ----------
    places : sequence of (float, float)
        A pair that is not finite is never on the front.

    Returns
    -------
    list of bool
        In the order given; of equal pairs only the first. A slower point must reduce the error by
        at least a twentieth, because times scatter more.

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
        "conclusion": list(chart.conclusion),
        "recommendations": [
            {**asdict(each), "changes": dict(each.changes)} for each in chart.choices
        ],
        "rungs_as_written": [asdict(each) for each in chart.raises],
        "quantities": dict(chart.labels),
        "measured_points": chart.measured,
        "planned_points": chart.planned,
        "left": chart.left,
    }


def _point_table(point: Point) -> dict[str, Any]:
    return {
        "name": point.name,
        "rungs": dict(point.rungs),
        "seconds": point.seconds,
        "measured_seconds": point.measured_seconds,
        "error": point.error,
        "worst": point.worst,
        "verdict": point.verdict,
        "at_the_limit": point.close,
        "reason": point.reason,
        "starts": point.starts,
        "on_front": point.on_front,
        "question": point.question,
        "here": point.written,
        "block": point.block,
        "errors": {
            name: {"mean": each.mean, "standard_error": each.standard_error}
            for name, each in point.errors.items()
        },
    }


CSV_HEAD = (
    "question",
    "point",
    "here",
    "on_front",
    "verdict",
    "seconds",
    "quantity",
    "error",
    "standard_error",
)


def chart_rows(chart: Chart) -> list[tuple[Any, ...]]:
    """A chart as rows of :data:`CSV_HEAD`, one for every quantity of every point.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    list of tuple
        One row without quantity for a point that is not valid.
    """
    rows: list[tuple[Any, ...]] = []
    for point in chart.points:
        head = (
            point.question,
            point.name,
            int(point.written),
            int(point.on_front),
            point.verdict,
            point.seconds,
        )
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
    lines = [chart.title, "", *(chart.conclusion or (chart.verdict,))]
    for choice in (each for each in chart.shown_choices if each.block):
        what = "settings" if chart.alike else choice.question
        head = f"{what}: paste into the {chart.subject}, or {choice.options}"
        lines += ["", head, choice.block]
    if chart.raises:
        lines += ["", "each rung of your scene by itself; errors may cancel each other"]
        lines += [f"  {each.text}" for each in chart.raises]
    for question in chart.shown:
        lines += ["", *_question_lines(chart, question)]
    if chart.convergence:
        lines += ["", "convergence of the references"]
        lines += [f"  {convergence_text(each, chart.labels)}" for each in chart.convergence]
    unusable = ("invalid",) if chart.unfinished else ("invalid", "doubtful")
    dropped = [f"{p.name}: {p.reason}" for p in chart.points if p.verdict in unusable]
    for title, texts in (
        ("not valid, or not measurable", dropped),
        ("refused", chart.refused),
        ("pruned", chart.pruned),
    ):
        lines += ["", title, *(f"  {text}" for text in texts)] if texts else []
    if chart.unfinished and chart.planned:
        left = f"; the rest takes {chart.left}" if chart.left else ""
        lines += ["", f"so far: {chart.measured} of {chart.planned} combinations measured{left}"]
    return "\n".join([*lines, "", f"measured: {chart.note}"])


def _question_lines(chart: Chart, question: str) -> list[str]:
    """Points to choose among: the scene as written, the recommendation, the front."""
    wanted = {choice.name for choice in chart.choices if choice.question == question}
    shown = [p for p in chart.of(question) if p.written or p.on_front or p.name in wanted]
    head = [
        f"{chart.heading(question) or chart.cost_label}",
        f"{'seconds':>10}  {'error':>8}  choice",
    ]
    return head + [
        f"{point.seconds:10.3g}  {_share(point.error):>8}  {point.name}"
        + (f" ({chart.label(point.worst)})" if point.error > 0 and point.errors else "")
        for point in shown
    ]


def _share(value: float) -> str:
    return f"{value:.2%}" if math.isfinite(value) else "-"


def convergence_text(each: Convergence, labels: Mapping[str, str] | None = None) -> str:
    """Convergence of the reference with one effect, in one line.

    Parameters
    ----------
    each : Convergence
    labels : mapping of str to str, optional
        Quantity -> words.

    Examples
    --------
    >>> convergence_text(Convergence(effect="step", levels=("x2", "x1", "x1/2"), quantity="peak",
    ...     steps=(0.04, 0.01), order=2.0, remaining=0.0033, converged=True))
    'step x2, x1, x1/2: peak moves by 4.00% then 1.00%, order 2.00, 0.33% left'
    """
    order = f"order {each.order:.2f}" if math.isfinite(each.order) else "no order can be estimated"
    word = "" if each.converged else "; NOT CONVERGED"
    label = (labels or {}).get(each.quantity, each.quantity)
    return (
        f"{each.effect} {', '.join(each.levels)}: {label} moves by {_steps(each)}, "
        f"{order}, {remaining_error(each):.2%} left{word}"
    )


def _steps(each: Convergence) -> str:
    return " then ".join(f"{abs(step):.2%}" for step in each.steps)


def save_chart_rows(chart: Chart, path: Path, *, force: bool = True) -> None:
    """Write :func:`chart_rows` as CSV, whole or not at all."""
    save_rows(path, CSV_HEAD, chart_rows(chart), force=force)
