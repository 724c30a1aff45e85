"""What a wear model says of one recording."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

from ...sim.output.recording import html_table
from ..feature_rows.feature_table import regime_words
from ..learning.conformal import COVERAGE
from ..learning.grades import GRADE_NAMES
from ..recording_faults.fault import QualityFault

Verdict = Literal["graded", "caution", "unfamiliar", "unusable"]
Mode = Literal["cold", "referenced"]

NO_BASELINE = (
    "the model was trained with a baseline and needs healthy recordings of this machine: give "
    "--baseline healthy.h5, or use a model that was trained cold"
)
"""Reason of a verdict that lacks nothing but the reference."""


@dataclass(frozen=True, kw_only=True)
class FaultFinding:
    """Finding of a model on a fault other than the wear.

    Attributes
    ----------
    name : str
        As the data set labels it.
    probability : float
        That it is present.
    present : bool
        The probability is above the threshold of the model.
    detection_rate, false_alarm_rate : float
        Share of present ones found, and of absent ones called present, on machines that had no
        part in the fit.
    visible_from_m : float or None
        For a regime: wear that is distinguished from as new in nine of ten machines without part in
        the fit, at 5 % false alarms [m]; less is not seen.
    """

    name: str
    probability: float
    present: bool
    detection_rate: float
    false_alarm_rate: float
    visible_from_m: float | None = None

    @property
    def unseen(self) -> str:
        """What wear a regime hides, in words; empty where that is not known."""
        return unseen_words(self.name, self.visible_from_m)


def unseen_words(name: str, visible_from_m: float | None) -> str:
    """What wear a regime hides.

    Examples
    --------
    >>> unseen_words("lubrication_flooded", 2.1e-4)
    'wear below 0.21 mm cannot be seen on a flooded pin of this kind'
    """
    if visible_from_m is None:
        return ""
    return (
        f"wear below {1e3 * visible_from_m:.2g} mm cannot be seen on a {regime_words(name)} of "
        "this kind"
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Estimate:
    """What a model says of one recording.

    Attributes
    ----------
    verdict : {"graded", "caution", "unfamiliar", "unusable"}
        Caution: graded, but read `cautions`. Unfamiliar: no grade, the machine is none of the
        trained kind. Unusable: no grade, the recording is at fault, or there is
        no healthy reference for a model that needs one.
    faults : tuple of QualityFault
        Of the data.
    reasons : tuple of str
        Why there is no grade; empty where there is one.
    cautions : tuple of str
        Conditions outside the trained range, faults that bar no verdict.
    mode : {"cold", "referenced"}
        Whether healthy recordings of the same machine were used.
    noted : tuple of str
        Conditions noted with the recording that the estimate uses.
    p_value : float or None
        Of the hypothesis that the recording is of the trained kind; None where it could not even
        be turned into the model's features.
    p_limit : float or None
        At or below it a recording is called unfamiliar.
    nearest : str
        The trained machine that is nearest; empty where unusable.
    grade : int or None
        0 to 3.
    grade_name : str
        In words; empty without a grade.
    possible_grades : tuple of int
        Those that cannot be excluded.
    grade_probabilities : tuple of float
        Probability of every grade, sum 1.
    severity, low, high : float or None
        Estimate and interval [m].
    coverage : float
        Nominal coverage of the interval, and of the set.
    confounders : tuple of FaultFinding
        Faults other than the wear that the model knows.
    evidence : tuple of (str, float, float, float)
        Feature, its value, the healthy one (of the baseline, or mean of as-new machines), distance
        in standard deviations of healthy machines; the features that moved the most.
    """

    verdict: Verdict
    faults: tuple[QualityFault, ...] = ()
    reasons: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    mode: Mode = "cold"
    noted: tuple[str, ...] = ()
    p_value: float | None = None
    p_limit: float | None = None
    nearest: str = ""
    grade: int | None = None
    grade_name: str = ""
    possible_grades: tuple[int, ...] = ()
    grade_probabilities: tuple[float, ...] = ()
    severity: float | None = None
    low: float | None = None
    high: float | None = None
    coverage: float = COVERAGE
    confounders: tuple[FaultFinding, ...] = ()
    evidence: tuple[tuple[str, float, float, float], ...] = ()

    @property
    def graded(self) -> bool:
        """Whether there is a grade, with or without caution."""
        return self.verdict in ("graded", "caution")

    @property
    def unreferenced(self) -> bool:
        """Unusable for want of the healthy reference alone: the recording itself is sound."""
        return self.reasons == (NO_BASELINE,)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def __repr__(self) -> str:
        """Verdict, and what it says: the wear with its interval, or why there is none."""
        if self.severity is None or self.low is None or self.high is None:
            return f"<Estimate {self.verdict}: {'; '.join(self.reasons) or 'no grade'}>"
        low, high = 1e3 * self.low, 1e3 * self.high
        return (
            f"<Estimate {self.verdict}: {self.grade_name}, {1e3 * self.severity:.3g} mm, "
            f"{100 * self.coverage:.0f} % within {low:.3g} to {high:.3g} mm>"
        )

    def _repr_html_(self) -> str:
        """The same for notebooks, with what must be known of it."""
        texts_of = {
            "fault": [fault.text for fault in self.faults],
            "reason": self.reasons,
            "caution": self.cautions,
            "grade": [
                f"{GRADE_NAMES[grade]}: {100 * share:.0f} %"
                for grade, share in enumerate(self.grade_probabilities)
                if grade in self.possible_grades
            ],
        }
        rows = [(name, text) for name, texts in texts_of.items() for text in texts]
        return html_table(repr(self)[1:-1], ["", "text"], rows)
