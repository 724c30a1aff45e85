"""What to do about a verdict and how soon: a table of grade and confidence."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ..learning.grades import ALARM_GRADE, WARNING_GRADE, grades_of
from ..wear_model.verdict import Estimate
from .trend import Outlook, span_words

Action = Literal["none", "watch", "confirm", "plan", "stop", "check"]
Confidence = Literal[
    "sure",
    "maybe_better",
    "maybe_worse",
    "maybe_condemned",
    "caution",
    "unfamiliar",
    "unusable",
    "unreferenced",
]

RULE_OF_THUMB = "rule of thumb, not from a standard"
"""Basis of the horizons in the table: intervals are usually shortened as a part wears."""

FROM_TREND = "from the trend"


@dataclass(frozen=True, kw_only=True)
class Advice:
    """What to do, and how soon.

    Attributes
    ----------
    action : {"none", "watch", "confirm", "plan", "stop", "check"}
        ``confirm``: measure the part before acting; ``check``: inspect the recording.
    sentence : str
        Advice to the engineer.
    days : float or None
        Time within which to act or to record again [d]; None if waiting changes nothing.
    horizon : str
        The same in words.
    basis : str
        Basis of the horizon.
    """

    action: Action
    sentence: str
    days: float | None
    horizon: str
    basis: str


@dataclass(frozen=True, kw_only=True)
class _Rule:
    action: Action
    sentence: str
    days: float | None  # [d]


_RULES: dict[tuple[int | None, Confidence], _Rule] = {
    (0, "sure"): _Rule(
        action="none", sentence="No action; keep the usual interval of recording.", days=90
    ),
    (0, "maybe_worse"): _Rule(
        action="watch",
        sentence="No action; first wear cannot be excluded, so record again sooner than usual.",
        days=30,
    ),
    (0, "maybe_condemned"): _Rule(
        action="confirm",
        sentence="Record again and measure at the next stop: the estimate is as new, but so "
        "uncertain that the condemning limit may be passed.",
        days=7,
    ),
    (0, "caution"): _Rule(
        action="watch",
        sentence="No action now, but do not rely on it: fix what the cautions name and record "
        "again.",
        days=30,
    ),
    (1, "sure"): _Rule(
        action="watch",
        sentence="No action now; shorten the interval between recordings and watch the trend.",
        days=30,
    ),
    (1, "maybe_worse"): _Rule(
        action="confirm",
        sentence="Record again soon and measure at the next stop: {work} may already be due for "
        "planning.",
        days=14,
    ),
    (1, "maybe_condemned"): _Rule(
        action="confirm",
        sentence="Record again and measure at the next opportunity: the condemning limit may "
        "already be passed, and {work} be due.",
        days=7,
    ),
    (1, "maybe_better"): _Rule(
        action="watch", sentence="No action now; record again and watch the trend.", days=30
    ),
    (1, "caution"): _Rule(
        action="confirm",
        sentence="Attend to what the cautions name and record again; measure at the next stop if "
        "it stays so.",
        days=14,
    ),
    (2, "sure"): _Rule(
        action="plan",
        sentence="Plan {work} for the next stop and order what it needs; record weekly until then.",
        days=7,
    ),
    (2, "maybe_worse"): _Rule(
        action="plan",
        sentence="Prepare {work} now and measure at the next opportunity: it may already be beyond "
        "the condemning limit.",
        days=2,
    ),
    (2, "maybe_better"): _Rule(
        action="plan",
        sentence="Plan {work}, but measure before anything is renewed: it may be less worn.",
        days=7,
    ),
    (2, "caution"): _Rule(
        action="confirm",
        sentence="Attend to what the cautions name and record again; measure before {work} is "
        "ordered.",
        days=7,
    ),
    (3, "sure"): _Rule(
        action="stop",
        sentence="It is beyond the condemning limit: stop; {work} is due.",
        days=0,
    ),
    (3, "maybe_better"): _Rule(
        action="stop",
        sentence="It is probably beyond the condemning limit: stop at the first safe moment and "
        "measure; have {work} ready.",
        days=1,
    ),
    (3, "caution"): _Rule(
        action="stop",
        sentence="The estimate is beyond the condemning limit, with cautions: stop at the "
        "first safe moment and measure before {work}.",
        days=1,
    ),
    (None, "unfamiliar"): _Rule(
        action="check",
        sentence="No grade is given, which does not mean that the machine is sound. Check that it "
        "is the machine the model was trained for, and channels, units and tacho; "
        "else train a model on this machine.",
        days=None,
    ),
    (None, "unusable"): _Rule(
        action="check",
        sentence="No grade is given, which does not mean that the machine is sound. Fix what is "
        "named and record again.",
        days=None,
    ),
    (None, "unreferenced"): _Rule(
        action="check",
        sentence="No grade is given, which does not mean that the machine is sound. The recording "
        "need not be repeated: assess it with healthy recordings of the machine (--baseline).",
        days=None,
    ),
}
"""Grade and confidence -> what to do. Grade 0 cannot be better, grade 3 cannot be worse."""

_LARGER: dict[int, _Rule] = {
    1: _Rule(
        action="confirm",
        sentence="The larger estimate is of a worn machine: record again, and measure at the next "
        "stop if it stays so.",
        days=14,
    ),
    2: _Rule(
        action="confirm",
        sentence="By the larger estimate {work} is to be planned: measure before it is ordered.",
        days=7,
    ),
    3: _Rule(
        action="stop",
        sentence="The larger estimate is beyond the condemning limit: stop at the first safe "
        "moment and measure before {work}.",
        days=1,
    ),
}
"""Grade of a larger second estimate that is relied on -> what to do."""

_WORDS = {
    0: "now",
    1: "within a day",
    2: "within 2 days",
    7: "within a week",
    14: "within 2 weeks",
    30: "within a month",
    90: "within 3 months",
}
_REALIGNED = ("sag", "parallel offset", "angular offset")
"""Kinds of severity that a new part does not cure."""


def touched_grades(estimate: Estimate, edges: Sequence[float]) -> tuple[int, ...]:
    """Grades that the interval of the severity reaches.

    Parameters
    ----------
    estimate : Estimate
    edges : sequence of float
        Lower bounds of grades 1, 2, … [m].

    Returns
    -------
    tuple of int
        Empty without an interval. It may hold grades that `possible_grades` does not, because the
        two are calibrated separately.

    Examples
    --------
    >>> touched_grades(Estimate(verdict="graded", low=1.5e-4, high=2.1e-4), (1e-4, 2e-4, 3e-4))
    (1, 2)
    """
    if estimate.low is None or estimate.high is None:
        return ()
    low, high = grades_of([estimate.low, estimate.high], edges).tolist()
    return tuple(range(low, high + 1))


def brief_words(action: str, horizon: str) -> str:
    """What to do and how soon, for a row of a table.

    Examples
    --------
    >>> brief_words("none", "within 3 months"), brief_words("plan", "within a week")
    ('none; record within 3 months', 'plan within a week')
    >>> brief_words("check", "")
    'check'
    """
    waits = action in ("none", "watch")
    return f"{action}; record {horizon}" if waits else f"{action} {horizon}".rstrip()


def confidence_of(estimate: Estimate, edges: Sequence[float]) -> Confidence:
    """Confidence in a verdict, from the verdict, its cautions and the grades not excluded.

    Parameters
    ----------
    estimate : Estimate
    edges : sequence of float
        Lower bounds of grades 1, 2, … [m]. The advice has to allow for an interval that reaches
        beyond a limit.

    Returns
    -------
    str
        The worse if grades on both sides are possible; a caution takes precedence over both.
    """
    if estimate.unreferenced:
        return "unreferenced"
    if estimate.verdict == "graded" and estimate.grade is not None:
        return _doubt(estimate, estimate.grade, edges)
    return "caution" if estimate.verdict == "graded" else estimate.verdict


def _doubt(estimate: Estimate, grade: int, edges: Sequence[float]) -> Confidence:
    """Confidence in a grade, given the grades that its set and its interval leave open."""
    grades = (*estimate.possible_grades, *touched_grades(estimate, edges))
    if max(grades) > grade:
        far = max(grades) >= ALARM_GRADE and grade < WARNING_GRADE
        return "maybe_condemned" if far else "maybe_worse"
    return "maybe_better" if min(grades) < grade else "sure"


def work_words(quantity: str) -> str:
    """Maintenance work that a worn quantity requires.

    Parameters
    ----------
    quantity : str
        Kind and place, from :func:`wearstate.diagnose.pages.words.quantity_name`.

    Examples
    --------
    >>> work_words("diametral clearance, crankpin")
    'renewal of the crankpin bearing'
    >>> work_words("wear down, bearing 1"), work_words("parallel offset, coupling")
    ('renewal of bearing 1', 'realignment of the coupling')
    """
    kind, _, place = quantity.partition(", ")
    numbered = place[-1:].isdigit() and place.startswith("bearing")
    part = place if numbered or "bearing" in place else f"{place} bearing"
    if kind in _REALIGNED:
        return f"realignment of {place if numbered else f'the {place}'}"
    return f"renewal of {part if numbered else f'the {part}'}"


def advise(
    estimate: Estimate,
    quantity: str,
    edges: Sequence[float],
    outlook: Outlook | None = None,
    larger: int | None = None,
) -> Advice:
    """What to do about an estimate, and how soon.

    Parameters
    ----------
    estimate : Estimate
    quantity : str
        What wears: kind and place.
    edges : sequence of float
        Lower bounds of grades 1, 2, … [m].
    outlook : Outlook, optional
        Outlook of the machine's trend. The early end of the remaining life replaces the rule of
        thumb if it comes sooner.
    larger : int, optional
        Higher grade of a second estimate that is to be relied on.

    Returns
    -------
    Advice

    Notes
    -----
    The intervals are rules of thumb and marked as such: they shorten as wear grows, so that several
    recordings lie between the first sign and the limit.

    Examples
    --------
    >>> found = Estimate(verdict="graded", grade=2, possible_grades=(2, 3), severity=3e-4)
    >>> advice = advise(found, "diametral clearance, crankpin", (1e-4, 2e-4, 4e-4))
    >>> advice.action, advice.horizon
    ('plan', 'within 2 days')
    """
    rule = _RULES[estimate.grade, confidence_of(estimate, edges)]
    days = _days(rule, estimate, edges)
    if larger is not None:
        rule = _LARGER[larger]
        days = min(each for each in (days, rule.days) if each is not None)
    plain = Advice(
        action=rule.action,
        sentence=rule.sentence.format(work=work_words(quantity)),
        days=days,
        horizon="" if days is None else _WORDS[int(days)],
        basis="" if days is None else RULE_OF_THUMB,
    )
    return plain if outlook is None else _with_outlook(plain, outlook)


def _days(rule: _Rule, estimate: Estimate, edges: Sequence[float]) -> float | None:
    """Horizon [d]: a caution never makes it longer than the doubt alone would."""
    if rule.days is None or estimate.grade is None:
        return None
    doubt = _doubt(estimate, estimate.grade, edges)
    worse = doubt in ("maybe_worse", "maybe_condemned")
    return min(rule.days, _RULES[estimate.grade, doubt].days or 0) if worse else rule.days


def _with_outlook(plain: Advice, outlook: Outlook) -> Advice:
    """Shorten the horizon by the trend; a long remaining life does not lengthen it."""
    early = outlook.remaining_low_h
    if early is None or plain.days is None or early / 24 >= plain.days:
        return plain
    return Advice(
        action=plain.action if plain.action in ("plan", "stop") else "plan",
        sentence=f"{plain.sentence} By the trend the condemning limit can be reached before the "
        "usual interval is over.",
        days=early / 24,
        horizon=f"within {span_words(early)}" if early > 0 else "now",
        basis=FROM_TREND,
    )
