"""Deep check of a scene as a table, for people and for programs."""

import math
import textwrap
from typing import Any

from ...sim.deep_check.check import DeepCheck
from ...sim.deep_check.rows import Figure, Quantity

_MARKS = {True: "usual", False: "UNUSUAL"}
_INDENT = "    "
_WIDTH = 100
_NOTHING = 1e-9  # rounding error of a sum that is zero


def deep_check_text(name: str, found: DeepCheck) -> str:
    """Table of all figures, then the unusual ones with their cures.

    Parameters
    ----------
    name : str
        Name of the scene.
    found : DeepCheck

    Returns
    -------
    str
    """
    unusual = found.unusual
    lines = [_verdict(name, found), ""]
    lines += [f"{'quantity':36}{'value':>10} {'unit':17}{'usual':>16}  verdict"]
    for figure in found.figures:
        lines += _row(figure)
    if unusual:
        lines += ["", "unusual, and what helps:"]
        lines += [_cure(figure) for figure in unusual]
    if found.failure:
        lines += [
            "",
            f"the simulated trial of {found.turns:.3g} revolutions fails: {found.failure}",
        ]
    lines += [f"warning: {text}" for text in found.warnings]
    return "\n".join(lines)


def _verdict(name: str, found: DeepCheck) -> str:
    odd, all_of_them = len(found.unusual), len(found.figures)
    begin = "the simulated trial fails" if found.failure else "no fault"
    if not odd:
        return f"{name}: {begin}; all {all_of_them} figures are usual"
    verb = "is" if odd == 1 else "are"
    return f"{name}: {begin}; {odd} of {all_of_them} figures {verb} unusual"


def _row(figure: Figure) -> list[str]:
    place, value = figure.worst
    quantity = figure.quantity
    row = (
        f"{quantity.name:36}{number(value):>10} {quantity.unit:17}{usual_range(quantity):>16}  "
        f"{_MARKS[figure.usual]}"
    )
    return [f"{row} ({place})" if place else row]


def _cure(figure: Figure) -> str:
    place, value = figure.worst
    quantity = figure.quantity
    also = f"; also {', '.join(figure.others)}" if figure.others else ""
    where = f" ({place}{also})" if place else ""
    unit = f" {quantity.unit}" if quantity.unit else ""
    text = (
        f"{quantity.name}{where} = {number(value)}{unit}, usual {usual_range(quantity)}: "
        f"{figure.cure}. Why: {quantity.reason}"
    )
    return textwrap.fill(text, _WIDTH, initial_indent="  ", subsequent_indent=_INDENT)


def usual_range(quantity: Quantity) -> str:
    """Range of a quantity; one-sided if it has only one end.

    Examples
    --------
    >>> from ...sim.deep_check.pump import PUMP_ROWS
    >>> [usual_range(row) for row in PUMP_ROWS if row.name == "mean piston speed"]
    ['0.1 to 2']
    """
    low, high = quantity.least, quantity.most
    if low == -math.inf:
        return f"<= {number(high)}"
    return f">= {number(low)}" if high == math.inf else f"{number(low)} to {number(high)}"


def number(value: float) -> str:
    """Three digits, without an exponent if that is short.

    Examples
    --------
    >>> [number(value) for value in (0.0004, 0.7812, 12345.0, 3e7)]
    ['0.0004', '0.781', '12300', '3e+07']
    """
    if abs(value) < _NOTHING:
        return "0"
    if 1000 <= abs(value) < 1e6:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:.3g}"


def deep_check_table(found: DeepCheck) -> dict[str, Any]:
    """The same for JSON: a missing end of a range is null.

    Parameters
    ----------
    found : DeepCheck

    Returns
    -------
    dict
    """
    return {
        "figures": [_entry(figure) for figure in found.figures],
        "unusual": [figure.quantity.name for figure in found.unusual],
        "trial": {"revolutions": found.turns, "failure": found.failure},
    }


def _entry(figure: Figure) -> dict[str, Any]:
    place, value = figure.worst
    quantity = figure.quantity
    return {
        "quantity": quantity.name,
        "value": value,
        "unit": quantity.unit,
        "place": place,
        "values": dict(figure.values),
        "least": quantity.least,
        "most": quantity.most,
        "usual": figure.usual,
        "cure": figure.cure,
        "reason": quantity.reason,
    }
