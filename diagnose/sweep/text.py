"""A sweep in words, as a table for a terminal, as plain values and as CSV."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...datasets.file.csv_cells import save_rows
from ..pages.si_text import plain, si_text
from .axes import Point
from .sweep import Row, Sweep

_AT_ONCE = 1e-3  # of the axis: smaller detectable changes are reported as "any change"
_NAMED = 3  # most settings named in the conclusion


def setting_words(sweep: Sweep, setting: Point, *, short: bool = False) -> str:
    """Values of all axes except the last: ``speed 320 rpm``.

    Parameters
    ----------
    sweep : Sweep
    setting : tuple of int
    short : bool
        Without the names of the axes.
    """
    axes = sweep.plan.axes
    pairs = zip(axes, setting, strict=False)
    return ", ".join(
        ("" if short else f"{axis.words} ") + axis.text(axis.numbers[i], 4) for axis, i in pairs
    )


def change_words(sweep: Sweep, row: Row) -> str:
    """Smallest detectable change, in the unit of its axis."""
    axis, change = sweep.plan.axes[-1], row.detection.change
    span = abs(axis.values[-1] - axis.values[0])
    if math.isnan(change):
        return "not known"
    if math.isinf(change):
        return f"> {axis.text(span / abs(axis.scale), 2)}"
    if change < _AT_ONCE * span:
        return "any change"
    return axis.text(change / abs(axis.scale), 2)


def best_rows(sweep: Sweep) -> list[Row]:
    """Most sensitive row of every setting, among the quantities of the sensors.

    If none of these is shown, among those of the simulator.
    """
    rows = sweep.rows()
    judged = [row for row in rows if row.shown.seen] or rows
    found = []
    for setting in sweep.settings:
        own = [r for r in judged if r.setting == setting and not math.isnan(r.detection.change)]
        if own:
            found.append(min(own, key=lambda row: row.detection.change))
    return found


def conclusion(sweep: Sweep) -> tuple[str, ...]:
    """Setting at which the change of the last axis is detected first, in one to three sentences."""
    axis, best = sweep.plan.axes[-1], best_rows(sweep)
    what = f"{axis.words[:1].upper()}{axis.words[1:]}"
    begin = axis.text(axis.numbers[0], 4)
    if not best:
        cure = "give --starts 2 or more" if sweep.plan.starts < 2 else "more runs must succeed"
        return (
            f"{what}: the smallest detectable change is unknown, because the scatter is; {cure}.",
        )
    hits = [row for row in best if row.detection.detected]
    hits.sort(key=lambda row: row.detection.change)
    lost = [row for row in best if not row.detection.detected]
    if not hits:
        far = axis.text(axis.numbers[-1], 4)
        return (f"{what}: no quantity reveals a change from {begin} up to {far}.",)
    first, rest = hits[0], hits[1:]
    where = f" at {setting_words(sweep, first.setting)}" if first.setting else ""
    verb = "shows first" if first.setting else "shows"
    lines = [
        f"{what} {verb}{where}, in {first.shown.label}: a change of "
        f"{change_words(sweep, first)} from {begin} shows in one recording"
        f"{_coarse(sweep, first)}."
    ]
    if rest:
        shown = rest if len(rest) <= _NAMED else [*rest[: _NAMED - 1], rest[-1]]
        parts = [
            f"at {setting_words(sweep, r.setting, short=True)} it takes {change_words(sweep, r)}"
            f" ({r.shown.name})"
            for r in shown
        ]
        text = "; ".join(parts)
        lines.append(f"{text[:1].upper()}{text[1:]}.")
    if lost:
        places = ", ".join(setting_words(sweep, r.setting, short=True) for r in lost)
        far = axis.text(axis.numbers[-1], 4)
        lines.append(f"At {places} no quantity reveals a change up to {far}.")
    unjudged = [s for s in sweep.settings if s not in {row.setting for row in best}]
    if unjudged:
        places = ", ".join(setting_words(sweep, setting, short=True) for setting in unjudged)
        lines.append(f"At {places} too few runs have values.")
    return tuple(lines)


def _coarse(sweep: Sweep, row: Row) -> str:
    """Warning that the first step of the axis is much wider than the detected change."""
    axis = sweep.plan.axes[-1]
    step = abs(axis.values[1] - axis.values[0])
    if not _AT_ONCE * step < row.detection.change < _WITHIN * step:
        return ""
    wide = axis.text(step / abs(axis.scale), 2)
    return f" (interpolated in a first step of {wide}: use smaller steps to confirm)"


_WITHIN = 0.25  # of the first step


def basis(sweep: Sweep) -> str:
    """Description of the simulations, and of the meaning of the numbers."""
    plan = sweep.plan
    scene = next(iter(plan.scenes.values()))
    swept = {axis.path for axis in plan.axes}
    axes = "; ".join(
        f"{axis.path} {', '.join(plain(number, 4) for number in axis.numbers)} "
        f"{axis.unit or axis.si_unit}".rstrip()
        for axis in plan.axes
    )
    length = "" if "duration" in swept else f" of {si_text(scene.duration, 's')}"
    level = f"{100 * plan.confidence:g}"
    return (
        f"Simulated: {plan.name}, {axes}; {len(plan.scenes)} points x {plan.starts} starts, which "
        f"differ in start angle, sensor noise and random forces; recordings{length}. Detected: one "
        f"recording differs from the mean of the {plan.starts} at the first value, with "
        f"{plain(100 - 100 * plan.confidence, 2)} % false alarms (two-sided), {level} % detected, "
        "each quantity separately; Student's t, scatter pooled over the last axis, monotone "
        "interpolation. Scatter between starts is for one machine; between machines it is larger."
    )


def fault_lines(sweep: Sweep) -> list[str]:
    """Numbers of runs without values, and reasons."""
    total = len(sweep.outcomes)
    return [f"{count} of {total} runs have no values: {why}" for why, count in sweep.faults.items()]


def sweep_text(sweep: Sweep) -> str:
    """A sweep as lines for a terminal.

    Parameters
    ----------
    sweep : Sweep
    """
    axis, rows = sweep.plan.axes[-1], sweep.rows()
    head = ["quantity", "at", "first value", "last value", "scatter", "slope", "smallest change"]
    cells = [head if sweep.settings != [()] else [c for c in head if c != "at"]]
    for row in rows:
        unit, found = row.shown.unit, row.detection
        line = [
            row.shown.label + ("" if row.shown.seen else " *"),
            setting_words(sweep, row.setting, short=True),
            si_text(row.means[0], unit),
            si_text(row.means[-1], unit),
            si_text(found.scatter, unit, 2),
            slope_words(sweep, row),
            change_words(sweep, row),
        ]
        cells.append(line if sweep.settings != [()] else [*line[:1], *line[2:]])
    lines = [f"{sweep.plan.name} (simulated): sweep of {axis.words}", "", *conclusion(sweep), ""]
    lines += _aligned(cells)
    if not all(row.shown.seen for row in rows):
        lines.append("* known only in simulation")
    lines += fault_lines(sweep)
    if not sweep.finished:
        lines.append(f"so far: {len(sweep.outcomes)} of {len(sweep.plan.runs)} runs are done")
    return "\n".join([*lines, "", basis(sweep)])


def slope_words(sweep: Sweep, row: Row) -> str:
    """Slope with its standard error, per unit of the last axis."""
    axis, found = sweep.plan.axes[-1], row.detection
    if not math.isfinite(found.slope):
        return ""
    scale = axis.scale
    error = ""
    if math.isfinite(found.slope_error):
        error = f" +- {plain(abs(found.slope_error * scale), 2)}"
    per = f"{row.shown.unit or '1'}/{axis.unit or axis.si_unit or '1'}"
    return f"{plain(found.slope * scale, 3)}{error} {per}"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(f"{c:{w}}" for c, w in zip(r, widths, strict=True)).rstrip() for r in rows]


def sweep_table(sweep: Sweep) -> dict[str, Any]:
    """A sweep as plain values in SI.

    Parameters
    ----------
    sweep : Sweep

    Returns
    -------
    dict
        ``conclusion``, ``axes``, ``quantities``, ``rows`` (mean, scatter and number of starts along
        the last axis; ``smallest_change`` is None if unknown (``judged`` false) or beyond the axis
        (``told`` false)), ``runs`` and ``faults``.
    """
    plan = sweep.plan
    return {
        "scene": plan.name,
        "simulated": True,
        "conclusion": list(conclusion(sweep)),
        "basis": basis(sweep),
        "confidence": plan.confidence,
        "starts": plan.starts,
        "runs": {"done": len(sweep.outcomes), "planned": len(plan.runs)},
        "axes": [{"path": a.path, "unit": a.si_unit, "values": list(a.values)} for a in plan.axes],
        "quantities": [
            {"name": s.name, "unit": s.unit, "meaning": s.words, "seen_by_sensors": s.seen}
            for s in plan.shown
        ],
        "rows": [_row_table(sweep, row) for row in sweep.rows()],
        "faults": sweep.faults,
    }


def _row_table(sweep: Sweep, row: Row) -> dict[str, Any]:
    found = row.detection
    pairs = zip(sweep.plan.axes, row.setting, strict=False)
    return {
        "quantity": row.shown.name,
        "at": {axis.path: axis.values[i] for axis, i in pairs},
        "mean": list(row.means),
        "scatter": list(row.scatters),
        "count": list(row.counts),
        "told": found.detected,
        "judged": not math.isnan(found.change),
        "smallest_change": found.change if found.detected else None,
        "threshold": found.threshold,
        "pooled_scatter": found.scatter,
        "degrees_of_freedom": found.freedom,
        "slope": found.slope,
        "slope_standard_error": found.slope_error,
    }


def save_csv(sweep: Sweep, path: Path, *, force: bool = True) -> None:
    """Write a tidy table in SI: one row for each point and start.

    Columns: paths of the axes, ``start``, ``seed``, ``start_angle_rad``, ``fault``, quantities.
    """
    plan = sweep.plan
    names = [each.name for each in plan.shown]
    head = [*(axis.path for axis in plan.axes), "start", "seed", "start_angle_rad", "fault", *names]
    rows: list[list[Any]] = []
    for (point, start), run in sweep.outcomes.items():
        places = [axis.values[i] for axis, i in zip(plan.axes, point, strict=True)]
        known = [run.quantities[n][0] if n in run.quantities else "" for n in names]
        rows.append([*places, start, plan.number(start), plan.angle(start), run.fault, *known])
    save_rows(path, head, rows, force=force)
