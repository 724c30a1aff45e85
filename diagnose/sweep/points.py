"""Interactive curves of a sweep: means over starts, and the settings of each."""

import math
from collections.abc import Iterator

from ..charts.scene_edit import block_of
from ..pages.page import short_name
from ..pages.points import DrawnLine, Mark, PointAxes, Series
from ..pages.si_text import si_text
from .figure import panel_names
from .sweep import Row, Sweep
from .text import setting_words

_COLOURS = ("#1f5a94", "#e07b39", "#3a923a", "#b3261e", "#7b5ea7", "#8c6d31", "#49535e")


def sweep_points(sweep: Sweep) -> list[PointAxes]:
    """Axes of the most sensitive quantities along the last axis of the sweep.

    Parameters
    ----------
    sweep : Sweep

    Returns
    -------
    list of PointAxes
    """
    rows = sweep.rows()
    return [
        _points(sweep, [row for row in rows if row.shown.name == name])
        for name in panel_names(sweep, rows)
    ]


def _points(sweep: Sweep, rows: list[Row]) -> PointAxes:
    last, shown = sweep.plan.axes[-1], rows[0].shown
    unit = f" [{shown.unit}]" if shown.unit else ""
    drawn = list(_series(sweep, rows))
    return PointAxes(
        title=short_name(shown.words or shown.name, 60) + ("" if shown.seen else " *"),
        x_name=f"{last.words} [{last.unit or last.si_unit or '-'}]",
        y_name=f"{short_name(shown.name)}{unit}",
        series=tuple(drawn),
        lines=tuple(
            DrawnLine(
                name=each.name or "mean over the starts",
                x=tuple(mark.x for mark in each.marks),
                y=tuple(mark.y for mark in each.marks),
                colour=each.colour,
            )
            for each in drawn
        ),
    )


def _series(sweep: Sweep, rows: list[Row]) -> Iterator[Series]:
    for number, row in enumerate(rows):
        marks = tuple(_mark(sweep, row, i) for i, n in enumerate(row.counts) if n)
        if marks:
            name = setting_words(sweep, row.setting) if row.setting else ""
            yield Series(name=name, marks=marks, colour=_COLOURS[number % len(_COLOURS)])


def _mark(sweep: Sweep, row: Row, i: int) -> Mark:
    mean, scatter, axes = row.means[i], row.scatters[i], sweep.plan.axes
    places = (*row.setting, i)
    set_to = [axis.text(axis.numbers[k], 4) for axis, k in zip(axes, places, strict=True)]
    value = si_text(mean, row.shown.unit)
    if math.isfinite(scatter):
        value += f" ± {si_text(scatter, row.shown.unit, 2)}"
    lines = [f"{axis.words}: {text}" for axis, text in zip(axes, set_to, strict=True)]
    lines.append(f"{row.shown.words}: {value}, {row.counts[i]} starts")
    changes = {axis.path: axis.given(k) for axis, k in zip(axes, places, strict=True)}
    return Mark(
        x=axes[-1].numbers[i],
        y=mean,
        low=mean - scatter,
        high=mean + scatter,
        hover="\n".join(lines),
        block=f"# {sweep.plan.name}\n{block_of(changes)}\n# {lines[-1]}",
    )
