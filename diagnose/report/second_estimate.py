"""A second estimate, independent of the trained model, and whether the two agree.

A contradiction is reported first: one of the two has wrong input, or the machine is not what it is
assumed to be.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from ..film_clearance.clearance import FilmEstimate
from ..twin.opinion import TwinOpinion
from ..wear_model.verdict import Estimate


@dataclass(frozen=True, kw_only=True)
class ModelOpinion:
    """Estimate of another wear model for the same recording.

    Attributes
    ----------
    trained_on : str
        Recipe or scene of its training records.
    severity, low, high : float or None
        Wear and its interval [m]; None without an estimate.
    coverage : float
        Nominal coverage of the interval.
    grade : int or None
        Grade of the wear, 0 to 3.
    grade_name : str
        In words; empty without a grade.
    reasons : tuple of str
        Why there is no estimate.
    cautions : tuple of str
        Cautions of this model that the other one does not have.
    origin : mapping
        Origin of the model, its file's hash included, for the record.
    """

    trained_on: str
    severity: float | None = None
    low: float | None = None
    high: float | None = None
    coverage: float = 0.9
    grade: int | None = None
    grade_name: str = ""
    reasons: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    origin: Mapping[str, Any] = field(default_factory=dict)


SecondEstimate = FilmEstimate | TwinOpinion | ModelOpinion
"""All have `severity`, `low` and `high`, None without an estimate, and `coverage`."""


def disagree(estimate: Estimate, second: SecondEstimate) -> bool:
    """Whether the intervals of two estimates do not overlap."""
    if estimate.low is None or estimate.high is None or second.low is None or second.high is None:
        return False
    return second.high < estimate.low or estimate.high < second.low


def with_second(estimate: Estimate, second: SecondEstimate, who: str, cure: str) -> Estimate:
    """Put the contradiction with a second estimate before the cautions of the first.

    Parameters
    ----------
    estimate : Estimate
    second : FilmEstimate or TwinOpinion
    who : str
        Origin of the second estimate.
    cure : str
        What to check.
    """
    if not disagree(estimate, second):
        return estimate
    said = (
        f"{who} and trained model disagree: {length_words(second)} against "
        f"{length_words(estimate)}; {cure}"
    )
    return replace(estimate, verdict="caution", cautions=(said, *estimate.cautions))


def length_words(found: SecondEstimate | Estimate) -> str:
    """Wear with its interval [mm].

    Examples
    --------
    >>> length_words(TwinOpinion(severity=2.1e-4, low=1.9e-4, high=2.3e-4))
    '0.210 mm (0.190 to 0.230, 90 %)'
    """
    if found.severity is None or found.low is None or found.high is None:
        return "no estimate"
    return (
        f"{1e3 * found.severity:.3f} mm ({1e3 * found.low:.3f} to {1e3 * found.high:.3f}, "
        f"{100 * found.coverage:.0f} %)"
    )


def with_twin(estimate: Estimate, twin: TwinOpinion | None) -> Estimate:
    """Put the contradiction with the machine's twin before the cautions of an estimate.

    Examples
    --------
    >>> trained = Estimate(verdict="graded", grade=2, severity=2.4e-4, low=2.2e-4, high=2.6e-4)
    >>> twin = TwinOpinion(severity=1.5e-4, low=1.4e-4, high=1.6e-4)
    >>> with_twin(trained, twin).cautions[0][:49]
    'twin of the machine and trained model disagree: 0'
    """
    cure = (
        "check that recording and twin are of one machine, the pressures given, and by feeler gauge"
    )
    return estimate if twin is None else with_second(estimate, twin, "twin of the machine", cure)


def twin_table(twin: TwinOpinion | None, estimate: Estimate) -> dict[str, Any] | None:
    """Estimate by the twin, for JSON and pages; None without a twin."""
    if twin is None:
        return None
    agrees = None if None in (twin.severity, estimate.severity) else not disagree(estimate, twin)
    return {**twin.as_dict(), "agrees": agrees, "text": twin_words(twin)}


def twin_words(twin: TwinOpinion) -> str:
    """Estimate by the twin in a clause.

    Examples
    --------
    >>> twin_words(TwinOpinion(severity=2.1e-4, low=1.9e-4, high=2.3e-4, members=210, scene="mine"))
    '0.210 mm (0.190 to 0.230, 90 %), by 210 simulated machines like mine, without training'
    """
    if twin.severity is None:
        return f"no estimate: {twin.reason}"
    return (
        f"{length_words(twin)}, by {twin.members} simulated machines like {twin.scene}, without "
        "training"
    )


def with_other_model(estimate: Estimate, other: ModelOpinion | None) -> Estimate:
    """Put an estimate by another model first if it is outside the interval of this one.

    Intervals may overlap: a model of wider assumptions has wider intervals, and its estimate says
    what the wear is if these hold.

    Examples
    --------
    >>> trained = Estimate(verdict="graded", grade=1, severity=1.9e-4, low=1.7e-4, high=2.2e-4)
    >>> other = ModelOpinion(trained_on="bilge-pump-oiled", severity=2.9e-4, low=2e-4, high=4e-4)
    >>> with_other_model(trained, other).cautions[0][:61]
    'the model of bilge-pump-oiled estimates 0.290 mm (0.200 to 0.'
    """
    if other is None or _holds(estimate, other):
        return estimate
    said = (
        f"the model of {other.trained_on} estimates {length_words(other)}, outside the interval of "
        f"this one, {length_words(estimate)}: find out which assumptions hold, measure the wear, "
        "and rely on the larger one until then"
    )
    return replace(estimate, verdict="caution", cautions=(said, *estimate.cautions))


def _holds(estimate: Estimate, other: ModelOpinion) -> bool:
    """Whether the interval of an estimate contains the other one, or there is none of the two."""
    if estimate.low is None or estimate.high is None or other.severity is None:
        return True
    return estimate.low <= other.severity <= estimate.high


def other_model_table(other: ModelOpinion | None, estimate: Estimate) -> dict[str, Any] | None:
    """Estimate by another model, for JSON and pages; None without one."""
    if other is None:
        return None
    agrees = None if None in (other.severity, estimate.severity) else _holds(estimate, other)
    relied_on = relied_on_grade(estimate, other) is not None
    return {
        **asdict(other),
        "agrees": agrees,
        "relied_on": relied_on,
        "text": _opinion_words(other),
    }


def _opinion_words(other: ModelOpinion) -> str:
    """Estimate by another model with its own cautions, or why there is none."""
    if other.severity is None:
        return f"no estimate by the model of {other.trained_on}: {'; '.join(other.reasons)}"
    named = f" (grade {other.grade}: {other.grade_name})" if other.grade is not None else ""
    said = f"{length_words(other)}{named}, by the model of {other.trained_on}"
    return f"{said}; its own caution: {'; '.join(other.cautions)}" if other.cautions else said


def relied_on_grade(estimate: Estimate, other: ModelOpinion | None) -> int | None:
    """Grade of another model where advice and alarms must follow it instead of this one.

    Parameters
    ----------
    estimate : Estimate
    other : ModelOpinion or None

    Returns
    -------
    int or None
        None unless it is the higher grade of the two and the models disagree, so that the larger
        estimate is to be relied on.

    Examples
    --------
    >>> trained = Estimate(verdict="graded", grade=1, severity=1.9e-4, low=1.7e-4, high=2.2e-4)
    >>> other = ModelOpinion(trained_on="oiled pins", severity=2.9e-4, grade=2)
    >>> relied_on_grade(trained, other)
    2
    """
    if other is None or other.grade is None or _holds(estimate, other):
        return None
    return other.grade if estimate.grade is not None and other.grade > estimate.grade else None


def new_cautions(before: Estimate, after: Estimate) -> list[str]:
    """Disagreements that were added before the cautions of an estimate."""
    return list(after.cautions[: len(after.cautions) - len(before.cautions)])


def is_first(caution: str, table: Mapping[str, Any]) -> bool:
    """Whether a report shows a caution first, as a disagreement, and not among the others."""
    return caution in table["disagreements"]
