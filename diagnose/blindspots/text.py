"""Blind spots as a table for JSON and as text."""

import math
from collections.abc import Mapping
from typing import Any

from ..feature_rows.model_card import ModelCard
from ..learning.scores import ScoreFigure
from .blindspots import BlindSpots
from .scores import FIGURES, ShiftRow, ranked, row_figures, usual_cautions

Table = dict[str, Any]

FEW = 20
"""Machines below which intervals over machines are too narrow."""


def blind_spots_table(found: BlindSpots, card: ModelCard) -> Table:
    """Blind spots, ready for JSON.

    Parameters
    ----------
    found : BlindSpots
    card : ModelCard
        Card of the model.

    Returns
    -------
    dict
        ``recipe``, ``severity``, ``condemning_limit_m``, ``machines``; ``baseline`` and ``rows``,
        the worst first, each with name, shift, kind, why, machines, figures (value, low, high; None
        if no machine contributes), the verdict on every machine, and the faults of those that could
        not be simulated; ``usual_cautions``, which every machine has without a change and which do
        not count; ``left`` names rows for which time did not suffice.
    """
    limit, usual = float(card.condemning_limit_m), usual_cautions(found.baseline)
    return {
        "recipe": found.recipe,
        "severity": card.severity,
        "condemning_limit_m": limit,
        "machines": len(found.baseline.said),
        "usual_cautions": sorted(usual),
        "baseline": _row_table(found.baseline, limit, usual),
        "rows": [_row_table(row, limit, usual) for row in ranked(found.rows, limit, usual)],
        "left": list(found.left),
    }


def _row_table(row: ShiftRow, limit: float, usual: frozenset[str]) -> Table:
    figures = row_figures(row, limit, usual)
    stored = row.as_dict()
    return {
        **{name: stored[name] for name in ("name", "shift", "kind", "why")},
        "machines": len(row.said),
        **{name: _plain(figures[name]) for name, _ in FIGURES},
        "said": list(stored["said"]),
        "faults": list(row.faults),
    }


def _plain(figure: ScoreFigure) -> dict[str, float | None]:
    ends = {"value": figure.value, "low": figure.low, "high": figure.high}
    return {name: None if math.isnan(end) else end for name, end in ends.items()}


def conclusion(table: Table) -> list[str]:
    """Conclusion in a sentence or two."""
    usual = table["baseline"]["clear_error"]["value"]
    clear = [row for row in table["rows"] if row["clear_error"]["value"] is not None]
    shown = (
        "As trained, no verdict is without a caution"
        if usual is None
        else f"As trained, the error without a caution is {percent(usual)} % of the "
        "condemning limit"
    )
    lines = [f"{shown} ({table['machines']} simulated machines of {table['recipe']})."]
    if clear:
        worst = clear[0]
        lines.append(
            f"Largest error without a caution: {worst['name']} {worst['shift']}, "
            f"{percent(worst['clear_error']['value'])} %."
        )
    lines += [
        f"Every verdict has this caution, which is not counted: {caution}."
        for caution in table["usual_cautions"]
    ]
    if table["machines"] < FEW:
        lines.append(f"With fewer than {FEW} machines the intervals are too narrow: increase -n.")
    return lines


def percent(value: float | None) -> str:
    """A share in per cent, as text."""
    return "none" if value is None else f"{100 * value:.1f}"


def with_ends(figure: Mapping[str, float | None]) -> str:
    """A share in per cent with its interval."""
    if figure["low"] is None or figure["high"] is None:
        return percent(figure["value"])
    return f"{percent(figure['value'])} ({percent(figure['low'])} to {percent(figure['high'])})"


_HEAD = ("no caution", "all graded", "bias", "covered", "refused", "cautioned", "machines")


def blind_spots_text(table: Table) -> str:
    """Blind spots for a terminal: per cent of the condemning limit, or of the machines."""
    rows = [table["baseline"], *(row for row in table["rows"] if row["machines"])]
    names = [f"{row['name']} {row['shift']}".strip() for row in rows]
    wide = max(map(len, names))
    head = f"{'':{wide}}  {_HEAD[0]:>22}" + "".join(f"{word:>11}" for word in _HEAD[1:])
    lines = [*conclusion(table), "", head]
    for name, row in zip(names, rows, strict=True):
        first = f"{with_ends(row['clear_error']):>22}"
        others = "".join(f"{percent(row[key]['value']):>11}" for key, _ in FIGURES[1:])
        lines.append(f"{name:{wide}}  {first}{others}{row['machines']:>11}")
    lines += [
        "",
        "Error, bias: % of the condemning limit, 95 % interval over machines; rest: % of them.",
    ]
    lines += [
        f"Not simulated: {row['name']} {row['shift']}: {row['faults'][0]}"
        for row in table["rows"]
        if row["faults"] and not row["machines"]
    ]
    if table["left"]:
        paths = dict.fromkeys(key.partition(": ")[2].partition(" ")[0] for key in table["left"])
        lines.append(
            f"Out of time, {len(table['left'])} rows not run: {', '.join(paths)}; with -o, "
            "repeat the command to run them"
        )
    return "\n".join(lines)
