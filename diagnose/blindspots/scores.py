"""Figures of each row of the blind spots, with intervals over machines, and their ranking."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..learning.scores import ScoreFigure, resampled, share
from ..wear_model.verdict import Estimate

FIGURES = (
    ("clear_error", "mean error of records graded without a caution that counts, over the limit"),
    ("error", "mean error of all graded records, over the condemning limit"),
    ("bias", "mean signed error of all graded records, over the limit"),
    ("coverage", "share of the intervals that contain the severity"),
    ("refused", "share without a grade: unfamiliar or unusable"),
    ("cautioned", "share graded with a caution that counts"),
)
"""Name and meaning. A caution counts unless every machine has it as trained."""


@dataclass(frozen=True, kw_only=True)
class ShiftVerdict:
    """Verdict of a model on one machine.

    Attributes
    ----------
    machine : int
        Number of its draw.
    truth : float
        Severity [m].
    verdict : str
        As in :class:`~.wear_model.verdict.Estimate`.
    found, low, high : float or None
        Estimate and interval [m]; None without a grade.
    cautions : tuple of str
        Cautions of the estimate.
    """

    machine: int
    truth: float
    verdict: str
    found: float | None
    low: float | None
    high: float | None
    cautions: tuple[str, ...] = ()


def answer_of(estimate: Estimate, machine: int, truth: float) -> ShiftVerdict:
    """Part of an estimate that is kept."""
    ends = (estimate.severity, estimate.low, estimate.high) if estimate.graded else (None,) * 3
    return ShiftVerdict(
        machine=machine,
        truth=truth,
        verdict=estimate.verdict,
        found=ends[0],
        low=ends[1],
        high=ends[2],
        cautions=estimate.cautions,
    )


@dataclass(frozen=True, kw_only=True)
class ShiftRow:
    """One row: a change, and the verdicts of the model on every machine.

    Attributes
    ----------
    name, shift, why : str
        What was changed, by how much, and the cause in practice.
    kind : {"as trained", "fixed", "drawn", "sensor"}
    said : tuple of ShiftVerdict
        Verdicts on the machines that could be simulated.
    faults : tuple of str
        Faults of those that could not.
    """

    name: str
    shift: str
    kind: str
    why: str
    said: tuple[ShiftVerdict, ...]
    faults: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Unique name of the row."""
        return f"{self.kind}: {self.name} {self.shift}"

    def as_dict(self) -> dict[str, Any]:
        """Row for JSON."""
        return asdict(self)


def row_of(stored: Mapping[str, Any]) -> ShiftRow:
    """Row from the result of :meth:`ShiftRow.as_dict`."""
    said = tuple(
        ShiftVerdict(**{**each, "cautions": tuple(each["cautions"])}) for each in stored["said"]
    )
    return ShiftRow(**{**stored, "said": said, "faults": tuple(stored["faults"])})


def usual_cautions(baseline: ShiftRow) -> frozenset[str]:
    """Cautions that every machine has without a change, so that they do not distinguish rows.

    Examples
    --------
    >>> wear = {"truth": 2e-4, "verdict": "caution", "found": 2e-4, "low": 1e-4, "high": 3e-4}
    >>> said = [ShiftVerdict(machine=i, cautions=("offsets", f"{i}"), **wear) for i in (0, 1)]
    >>> row = ShiftRow(name="", shift="", kind="as trained", why="", said=tuple(said))
    >>> sorted(usual_cautions(row))
    ['offsets']
    """
    graded = [frozenset(each.cautions) for each in baseline.said if each.found is not None]
    return frozenset.intersection(*graded) if graded else frozenset()


def row_figures(
    row: ShiftRow, limit: float, usual: frozenset[str] = frozenset()
) -> dict[str, ScoreFigure]:
    """All :data:`FIGURES` of a row.

    Parameters
    ----------
    row : ShiftRow
    limit : float
        Condemning limit [m].
    usual : frozenset of str
        Cautions that do not count, from :func:`usual_cautions`.

    Returns
    -------
    dict
        NaN if no machine contributes.

    Examples
    --------
    >>> wear = {"verdict": "graded", "low": 1e-4, "high": 3e-4}
    >>> said = [ShiftVerdict(machine=i, truth=2e-4, found=2e-4 + i * 1e-5, **wear) for i in (0, 2)]
    >>> row = ShiftRow(name="", shift="", kind="fixed", why="", said=tuple(said))
    >>> round(row_figures(row, 2e-4)["clear_error"].value, 9)
    0.05
    """
    if not row.said:
        nothing = ScoreFigure(value=math.nan, low=math.nan, high=math.nan)
        return {name: nothing for name, _ in FIGURES}
    draws = resampled([each.machine for each in row.said])
    off = _numbers((e.found, e.truth) for e in row.said) / limit
    graded = np.array([each.found is not None for each in row.said])
    warned = np.array([_warned(each, usual) for each in row.said])
    clear, cautious = graded & ~warned, graded & warned
    every = np.ones(len(row.said), dtype=bool)
    inside = [
        e.low is not None and e.high is not None and e.low <= e.truth <= e.high for e in row.said
    ]
    means = {
        "clear_error": (np.abs(off), clear),
        "error": (np.abs(off), graded),
        "bias": (off, graded),
        "coverage": (np.array(inside, dtype=float), graded),
        "refused": (~graded, every),
        "cautioned": (cautious, every),
    }
    return {
        name: share(np.where(over, value, 0.0), over, draws)
        for name, (value, over) in means.items()
    }


def _warned(said: ShiftVerdict, usual: frozenset[str]) -> bool:
    """Whether a verdict has a caution that counts; one without text does."""
    return said.verdict == "caution" and (not said.cautions or not usual.issuperset(said.cautions))


def _numbers(pairs: Iterable[tuple[float | None, float]]) -> Any:
    return np.array([math.nan if found is None else found - truth for found, truth in pairs])


def ranked(
    rows: Sequence[ShiftRow], limit: float, usual: frozenset[str] = frozenset()
) -> list[ShiftRow]:
    """Rows by the error of records graded without a caution that counts, worst first.

    Rows without such records follow, by the error of all graded ones: there the model warns by
    itself. Rows without any simulated machine come last.
    """

    def place(row: ShiftRow) -> tuple[int, float]:
        if not row.said:
            return 2, 0.0
        figures = row_figures(row, limit, usual)
        clear, every = figures["clear_error"].value, figures["error"].value
        if math.isnan(clear):
            return 1, math.inf if math.isnan(every) else -every
        return 0, -clear

    return sorted(rows, key=place)
