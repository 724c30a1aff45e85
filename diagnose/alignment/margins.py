"""Margins of a line from its limits before and after moves, and effort of jacking."""

import math
from collections.abc import Sequence
from typing import Any

from ...sim.alignment.alignment import Check, LineState, check, influence
from ...sim.alignment.calibration import Calibration

JACKED = 0.1e-3
"""Rise of one bearing for which the effect is given [m]."""


def margin_of(limit: Check) -> float:
    """Distance of a quantity from its nearest bound, relative to the bound, negative beyond [-].

    Examples
    --------
    >>> found = Check(condition="cold", bearing="aft", quantity="reaction", value=8.0, least=10.0,
    ...               most=40.0)
    >>> margin_of(found)
    -0.2
    """
    shares = [
        side * (limit.value - bound) / abs(bound)
        for side, bound in ((1, limit.least), (-1, limit.most))
        if math.isfinite(bound) and bound != 0
    ]
    return min(shares, default=math.inf)


def margin_rows(
    before: Sequence[LineState], after: Sequence[LineState] = ()
) -> list[dict[str, Any]]:
    """Nearest limit of each bearing in any condition, before and after moves.

    Parameters
    ----------
    before, after : sequence of LineState
        One for each condition; `after` may be omitted.

    Returns
    -------
    list of dict
        ``bearing``; ``before`` and ``after``, each None or with ``quantity``, ``condition`` and
        ``margin``.
    """
    return [
        {
            "bearing": name,
            "before": _nearest(before, name),
            "after": _nearest(after, name) if after else None,
        }
        for name in before[0].line.names
    ]


def _nearest(states: Sequence[LineState], name: str) -> dict[str, Any] | None:
    limits = [limit for state in states for limit in check(state) if limit.bearing == name]
    finite = [limit for limit in limits if math.isfinite(margin_of(limit))]
    if not finite:
        return None
    worst = min(finite, key=margin_of)
    return {
        "quantity": worst.quantity,
        "condition": worst.condition,
        "margin": margin_of(worst),
    }


def jack_rows(states: Sequence[LineState], found: Calibration | None) -> list[dict[str, Any]]:
    """Effort and effect of jacking each bearing, in the first condition.

    Parameters
    ----------
    states : sequence of LineState
        States of the line as set.
    found : Calibration, optional

    Returns
    -------
    list of dict
        ``bearing``, proposed ``move_m`` and ``turn_rad``, ``load_n`` and ``stiffness_n_per_m`` that
        a jack there works against, ``work_j`` of the move, and the bearing with the largest change
        of reaction, ``most_at``, by ``most_n`` for :data:`JACKED`.

    Notes
    -----
    The work is that of the reaction along the move with the line's own stiffness,
    ``R u + A u^2 / 2``, negative if the bearing is lowered under its load.
    """
    state = states[0]
    matrix = influence(state.line, state)
    rows = []
    for i, name in enumerate(state.line.names):
        move = 0.0 if found is None else float(found.moves[i])
        others = [(abs(matrix[k, i]), k) for k in range(len(matrix)) if k != i]
        _, most = max(others)
        load = float(state.reactions[i])
        rows.append(
            {
                "bearing": name,
                "move_m": move,
                "turn_rad": 0.0 if found is None else float(found.turns[i]),
                "load_n": load,
                "stiffness_n_per_m": float(matrix[i, i]),
                "work_j": load * move + float(matrix[i, i]) * move**2 / 2,
                "most_at": state.line.names[most],
                "most_n": float(matrix[most, i]) * JACKED,
            }
        )
    return rows


def margin_cells(rows: Sequence[dict[str, Any]]) -> list[tuple[str, str, str]]:
    """Rows of :func:`margin_rows` as text."""
    return [(row["bearing"], _words(row["before"]), _words(row["after"])) for row in rows]


def _words(limit: dict[str, Any] | None) -> str:
    if limit is None:
        return "-"
    return f"{100 * limit['margin']:.0f} % ({limit['quantity']}, {limit['condition']})"


def jack_cells(rows: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Rows of :func:`jack_rows` as text, in mm, kN and J."""
    return [
        (
            row["bearing"],
            f"{1e3 * row['move_m']:+.2f}" if row["move_m"] else "0",
            f"{row['load_n'] / 1e3:.3g}",
            f"{row['stiffness_n_per_m'] / 1e6:.3g}",
            f"{row['work_j']:.3g}",
            f"{row['most_n'] / 1e3:+.3g} at {row['most_at']}",
        )
        for row in rows
    ]
