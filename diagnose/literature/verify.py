"""Literature checks: expected values, computed values, and whether they agree.

Expected values, tolerances and sources stand in ``literature/*.csv``, one line per check; the
function that obtains the value stands under the same name in a table of ``verify_*.py``.
"""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .verify_bearing import finite_bearing_checks
from .verify_contact import contact_checks, restitution_checks
from .verify_crank import crank_checks
from .verify_film import cavitation_checks, film_checks
from .verify_journal import journal_checks
from .verify_pump import pump_checks
from .verify_shaft import alignment_checks, shaft_checks

LITERATURE_FOLDER = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class LiteratureCheck:
    """One value of the literature and how to compute it.

    Attributes
    ----------
    name : str
        What is checked, with its unit.
    expected : float
        The value of the source, in SI.
    tolerance : float
        Largest difference that passes; of the expected value where `kind` is ``"relative"``.
    kind : str
        ``"absolute"`` or ``"relative"``.
    trust : str
        How far the expected value can be trusted: ``R`` read at the source, ``H`` computed by
        an independent implementation, ``M`` recalled, ``V`` verified; combined with ``+``.
    source : str
        Where it is from.
    obtain : callable
        () -> the value that this program gives.
    """

    name: str
    expected: float
    tolerance: float
    kind: str
    trust: str
    source: str
    obtain: Callable[[], float]


@dataclass(frozen=True, kw_only=True)
class Result:
    """Outcome of one check: its fields, the computed value and the verdict."""

    name: str
    expected: float
    obtained: float
    tolerance: float
    kind: str
    passed: bool
    trust: str
    source: str


def checks() -> tuple[LiteratureCheck, ...]:
    """Every literature check, in the order of the tables.

    Raises
    ------
    ValueError
        A table's lines and its functions do not name the same checks, or a tolerance is unusable.

    Examples
    --------
    >>> checks()[0].name
    'ideal crank: stroke [m]'
    """
    return tuple(check for file, table in _TABLES.items() for check in _read(file, table))


def run_checks() -> list[Result]:
    """Compute every value and compare it with the literature.

    Returns
    -------
    list of Result
        In the order of :func:`checks`. A value that is not finite does not pass.

    Examples
    --------
    >>> all(result.passed for result in run_checks())
    True
    """
    return [_judge(check) for check in checks()]


def _judge(check: LiteratureCheck) -> Result:
    obtained = check.obtain()
    scale = abs(check.expected) if check.kind == "relative" else 1.0
    return Result(
        name=check.name,
        expected=check.expected,
        obtained=obtained,
        tolerance=check.tolerance,
        kind=check.kind,
        passed=abs(obtained - check.expected) <= check.tolerance * scale,
        trust=check.trust,
        source=check.source,
    )


def _read(file: str, table: dict[str, Callable[[], float]]) -> list[LiteratureCheck]:
    with (LITERATURE_FOLDER / file).open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    named = [row["name"] for row in rows]
    if sorted(named) != sorted(table):
        odd = ", ".join(sorted(set(named) ^ set(table))) or "one given twice"
        raise ValueError(f"{file} and its functions differ: {odd}; give each check once in both")
    return [_check(file, row, table[row["name"]]) for row in rows]


def _check(file: str, row: dict[str, str], obtain: Callable[[], float]) -> LiteratureCheck:
    tolerance = float(row["tolerance"])
    if not 0 < tolerance < math.inf:
        raise ValueError(
            f"{file}: tolerance of '{row['name']}' = {tolerance:g} must be > 0 and finite; "
            "half a unit of the last printed digit will do"
        )
    if row["kind"] not in ("absolute", "relative"):
        raise ValueError(
            f"{file}: kind of '{row['name']}' = '{row['kind']}' must be 'absolute' or 'relative'"
        )
    return LiteratureCheck(
        name=row["name"],
        expected=float(row["expected"]),
        tolerance=tolerance,
        kind=row["kind"],
        trust=row["trust"],
        source=row["source"],
        obtain=obtain,
    )


_TABLES: dict[str, dict[str, Callable[[], float]]] = {
    "slider_crank.csv": crank_checks(),
    "restitution.csv": restitution_checks(),
    "contact.csv": contact_checks(),
    "pump.csv": pump_checks(),
    "cavitation.csv": cavitation_checks(),
    "bearing.csv": journal_checks(),
    "film.csv": film_checks(),
    "finite_bearing.csv": finite_bearing_checks(),
    "shaft_line.csv": shaft_checks(),
    "alignment.csv": alignment_checks(),
}
"""File of the literature -> name of each of its checks -> function that computes it."""
