"""Figures of each row of a list of blind spots, with intervals over machines, and their order."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..learning.scores import ScoreFigure, resampled, share
from ..wear_model.estimate import Estimate

FIGURES = (
    ("clear_error", "mean error of what is graded without caution, over the condemning limit"),
    ("error", "mean error of all that is graded, over the limit"),
    ("bias", "mean signed error of all that is graded, over the limit"),
    ("coverage", "share of the intervals that hold the severity"),
    ("refused", "share without a grade: unfamiliar or unusable"),
    ("cautioned", "share graded with caution"),
)
"""Name and meaning."""


@dataclass(frozen=True, kw_only=True)
class ShiftVerdict:
    """What a model said of one machine.

    Attributes
    ----------
    machine : int
        Number of its draw.
    truth : float
        Severity [m].
    verdict : str
        As of :class:`~.wear_model.estimate.Estimate`.
    found, low, high : float or None
        Estimate and interval [m]; None without a grade.
    """

    machine: int
    truth: float
    verdict: str
    found: float | None
    low: float | None
    high: float | None


def answer_of(estimate: Estimate, machine: int, truth: float) -> ShiftVerdict:
    """What is kept of an estimate."""
    ends = (estimate.severity, estimate.low, estimate.high) if estimate.graded else (None,) * 3
    return ShiftVerdict(
        machine=machine,
        truth=truth,
        verdict=estimate.verdict,
        found=ends[0],
        low=ends[1],
        high=ends[2],
    )


@dataclass(frozen=True, kw_only=True)
class ShiftRow:
    """One row: what was shifted, and what the model said of every machine.

    Attributes
    ----------
    name, shift, why : str
        What, by how much, and how it comes about.
    kind : {"as trained", "fixed", "drawn", "sensor"}
    said : tuple of ShiftVerdict
        Of the machines that could be simulated so.
    faults : tuple of str
        Of those that could not.
    """

    name: str
    shift: str
    kind: str
    why: str
    said: tuple[ShiftVerdict, ...]
    faults: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Tells it from every other row."""
        return f"{self.kind}: {self.name} {self.shift}"

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def row_of(stored: Mapping[str, Any]) -> ShiftRow:
    """A row from what :meth:`Row.as_dict` gave."""
    said = tuple(ShiftVerdict(**each) for each in stored["said"])
    return ShiftRow(**{**stored, "said": said, "faults": tuple(stored["faults"])})


def row_figures(row: ShiftRow, limit: float, *, seed: int = 0) -> dict[str, ScoreFigure]:
    """Every one of :data:`FIGURES`.

    Parameters
    ----------
    row : Row
    limit : float
        Condemning limit [m].
    seed : int
        Of the resamples.

    Returns
    -------
    dict
        NaN where no machine tells.

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
    draws = resampled([each.machine for each in row.said], seed=seed)
    off = _numbers((e.found, e.truth) for e in row.said) / limit
    verdicts = np.array([each.verdict for each in row.said])
    clear, cautious = verdicts == "graded", verdicts == "caution"
    graded, every = clear | cautious, np.ones(len(row.said), dtype=bool)
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


def _numbers(pairs: Iterable[tuple[float | None, float]]) -> Any:
    return np.array([math.nan if found is None else found - truth for found, truth in pairs])


def ranked(rows: Sequence[ShiftRow], limit: float) -> list[ShiftRow]:
    """Rows by the error of what is graded without caution, worst first.

    Rows of which nothing is graded so follow, by the error of all that is graded: there the model
    warns of itself. Rows that no machine could be simulated for come last.
    """

    def place(row: ShiftRow) -> tuple[int, float]:
        if not row.said:
            return 2, 0.0
        figures = row_figures(row, limit)
        clear, every = figures["clear_error"].value, figures["error"].value
        if math.isnan(clear):
            return 1, math.inf if math.isnan(every) else -every
        return 0, -clear

    return sorted(rows, key=place)
