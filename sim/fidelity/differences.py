"""Differences of runs from those of a reference, and whether they are within an accuracy.

Contact with clearance is chaotic: differences are means over starts, and a difference below their
scatter is not significant.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtri, stdtrit

from .runs import Quantity

RESOLVED = 1.0 / 3.0
"""Standard error needed for a verdict, over the required accuracy."""

FIRST = 4
"""Least number of starts for a verdict on a scattered difference."""

STILL = 0.01
"""Scatter that counts as none, over the required accuracy."""

_SURELY_OFF = 0.99865  # confidence, by Student's distribution

_SURELY_NEAR = 0.99  # lower, as there are up to seven checks

_LEVEL = math.log(10) / 20  # relative change of an amplitude per dB


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Difference of one quantity between a candidate and the reference.

    Attributes
    ----------
    mean : float
        Mean over the starts, relative: for a level that of its amplitude, for others by their kind.
    standard_error : float
        Standard error of that mean.
    """

    mean: float
    standard_error: float

    @property
    def error(self) -> float:
        """Absolute mean difference [-]."""
        return abs(self.mean)


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A combination of rungs.

    Attributes
    ----------
    rungs : mapping of str to str
        Effect -> name of its rung.
    values : mapping of str to object
        Dotted path -> value that sets the combination in the scene.
    cost : float
        Tabulated time of one run [s].
    differences : mapping of str to Difference
        Differences of all quantities; empty if the combination is not valid.
    starts : int
        Number of starts in the differences.
    verdict : str
        ``within``, ``beyond``, ``doubtful`` (too much scatter) or ``invalid``.
    reason : str
        Reason for not being within.
    seconds : float
        Least measured time of a run [s]; NaN without a clock.
    """

    rungs: Mapping[str, str]
    values: Mapping[str, Any]
    cost: float
    differences: Mapping[str, Difference] = field(default_factory=dict)
    starts: int = 0
    verdict: str = "within"
    reason: str = ""
    seconds: float = math.nan

    @property
    def error(self) -> float:
        """Largest error of its quantities; infinite if it is not valid."""
        if not self.differences:
            return math.inf
        return max(each.error for each in self.differences.values())

    @property
    def standard_error(self) -> float:
        """Largest standard error of its quantities."""
        return max((each.standard_error for each in self.differences.values()), default=math.inf)


def differences(
    candidate: Sequence[Mapping[str, Quantity]], reference: Sequence[Mapping[str, Quantity]]
) -> dict[str, Difference]:
    """Mean difference of every quantity of the reference, over runs from the same starts.

    Parameters
    ----------
    candidate, reference : sequence of mapping
        Quantities of each start, in the same order.

    Returns
    -------
    dict of str to Difference
        Infinite if the candidate lacks a quantity. From a single start no scatter can be estimated.

    Examples
    --------
    >>> one = [{"rms": (2.02, "relative", 0.0)}] * 2
    >>> other = [{"rms": (2.0, "relative", 0.0)}] * 2
    >>> round(differences(one, other)["rms"].error, 9)
    0.01
    """
    return {
        name: _difference(name, candidate, reference)
        for name in reference[0]
        if all(name in each for each in reference)
    }


def _difference(
    name: str,
    candidate: Sequence[Mapping[str, Quantity]],
    reference: Sequence[Mapping[str, Quantity]],
) -> Difference:
    if not all(name in each for each in candidate):
        return Difference(mean=math.inf, standard_error=0.0)
    kind, scale = reference[0][name][1:]
    own = np.array([each[name][0] for each in candidate])
    other = np.array([each[name][0] for each in reference])
    deviations = (own - other) * _unit(kind, scale, float(np.mean(other)))
    if len(deviations) < 2:
        return Difference(mean=float(deviations[0]), standard_error=math.inf)
    spread = float(np.std(deviations, ddof=1)) / math.sqrt(len(deviations))
    return Difference(mean=float(np.mean(deviations)), standard_error=spread)


def _unit(kind: str, scale: float, size: float) -> float:
    """Factor from a difference to a relative error."""
    if kind == "dB":
        return _LEVEL
    least = max(abs(size), scale) if kind == "relative" else scale
    return 1.0 / least if least > 0 else 0.0


def judgement(found: Mapping[str, Difference], starts: int, accuracy: float) -> str:
    """``within``, ``beyond``, or ``more`` if further starts are needed."""
    each = found.values()
    scatter = max(d.standard_error for d in each)
    far, near = (float(stdtrit(starts - 1, chance)) for chance in (_SURELY_OFF, _SURELY_NEAR))
    if any(d.error - far * d.standard_error > accuracy for d in each):
        return "beyond"
    enough = starts >= FIRST or scatter <= STILL * accuracy
    close = all(d.error + near * d.standard_error <= accuracy for d in each)
    return "within" if close and enough and scatter <= RESOLVED * accuracy else "more"


def why(found: Mapping[str, Difference], verdict: str) -> str:
    """Reason of a verdict in words; empty for one within the accuracy."""
    if verdict == "within":
        return ""
    name, worst = max(found.items(), key=lambda item: item[1].error)
    if verdict == "beyond":
        return f"{name} is off by {worst.error:.2%}"
    name, worst = max(found.items(), key=lambda item: item[1].error + item[1].standard_error)
    return f"{name} is off by {worst.error:.2%} with a standard error of {worst.standard_error:.2%}"


def surely_within(candidate: Candidate) -> float:
    """Bound on the error of all quantities of a candidate, with 95 per cent confidence [-].

    Parameters
    ----------
    candidate : Candidate

    Returns
    -------
    float
        By Student's distribution over the starts, with Bonferroni's correction for the quantities;
        infinite for fewer than two starts, or if nothing could be run.

    Examples
    --------
    >>> known = {"rms": Difference(mean=0.01, standard_error=0.002)}
    >>> one = Candidate(rungs={}, values={}, cost=1.0, differences=known, starts=16)
    >>> round(surely_within(one), 4)
    0.0143
    """
    if candidate.starts < _FEWEST or not candidate.differences:
        return math.inf
    doubt = _DOUBT / 2 / len(candidate.differences)
    factor = float(stdtrit(candidate.starts - 1, 1 - doubt))
    return max(d.error + factor * d.standard_error for d in candidate.differences.values())


_FEWEST = 2

_DOUBT = 0.05


def starts_to_decide(candidate: Candidate, accuracy: float) -> int:
    """Number of starts for a verdict on a candidate, if its errors stay the same.

    Parameters
    ----------
    candidate : Candidate
        With at least two starts.
    accuracy : float
        Required accuracy.

    Returns
    -------
    int
        A power of two times the present number. The scatter of few starts is itself uncertain: it
        is assumed as large as that of all quantities together is in all but one case of ten. An
        error equal to the accuracy is never decided; an error from few starts is only a guess, and
        so is the result.

    Examples
    --------
    >>> known = {"rms": Difference(mean=0.01, standard_error=0.02)}
    >>> one = Candidate(rungs={}, values={}, cost=1.0, differences=known, starts=4)
    >>> starts_to_decide(one, 0.03)
    128
    """
    first, found = max(candidate.starts, _FEWEST), candidate.differences.values()
    if not found:
        return first
    doubt = math.sqrt((first - 1) / float(chdtri(first - 1, 1 - _UNLIKELY / len(found))))
    larger = [replace(d, standard_error=doubt * d.standard_error) for d in found]
    starts = first
    while starts < _ENDLESS * first:
        smaller = math.sqrt(first / starts)
        then = [replace(d, standard_error=smaller * d.standard_error) for d in larger]
        known = {str(n): d for n, d in enumerate(then)}
        if judgement(known, starts, accuracy) != "more":
            break
        starts *= 2
    return starts


_UNLIKELY = 0.1

_ENDLESS = 1024  # times the present number of starts
