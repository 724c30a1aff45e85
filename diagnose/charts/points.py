"""Points of a chart for an interactive page: marks, tooltips and texts on tapping."""

import math
from collections.abc import Iterator

from ..pages.points import DrawnLine, Mark, PointAxes, Series
from .chart import Chart, Point
from .figure import (
    BEATEN,
    BEST,
    DOUBTFUL,
    FRONT,
    OTHER,
    REFERENCE,
    UNDECIDED,
    WRITTEN_COLOUR,
    floor_of,
    kind_of,
    ring_of,
    shown_error,
)
from .words import with_scatter

_LOOKS = {
    BEST: (FRONT, 10.0, True),
    BEATEN: (OTHER, 8.0, True),
    UNDECIDED: (DOUBTFUL, 8.0, False),
    REFERENCE: (FRONT, 10.0, False),
}
"""Colour, size [px] and filling of each kind."""


def chart_points(chart: Chart) -> list[PointAxes]:
    """Axes of a chart, one for each question.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    list of PointAxes
        Points that did not run or have no error are left out.
    """
    return [_points(chart, question) for question in chart.shown]


def _points(chart: Chart, question: str) -> PointAxes:
    finite = [p for p in chart.of(question) if math.isfinite(p.error) and math.isfinite(p.seconds)]
    front = sorted((p for p in finite if p.on_front), key=lambda p: p.seconds)
    line = DrawnLine(
        name=BEST,
        x=tuple(p.seconds for p in front),
        y=tuple(shown_error(p, floor_of(chart)) for p in front),
        colour=FRONT,
        steps=True,
    )
    asked = chart.accuracy
    return PointAxes(
        title=chart.heading(question) or chart.title,
        x_name=chart.cost_label,
        y_name=chart.error_name(question),
        x_kind="log",
        y_kind="linear" if asked is None else "log",
        lines=(line,),
        level=() if asked is None else ("accuracy asked", 100 * asked),
        series=tuple(_series(chart, question, finite)),
    )


def _series(chart: Chart, question: str, finite: list[Point]) -> Iterator[Series]:
    """Plain points by kind, with rings below and a star above them."""
    ring = ring_of(chart, question)
    for name, (colour, size, filled) in _LOOKS.items():
        marks = tuple(_mark(chart, p) for p in finite if kind_of(p) == name and not p.written)
        if marks:
            yield Series(name=name, marks=marks, colour=colour, size=size, filled=filled)
    taken = tuple(_mark(chart, p) for p in finite if ring is not None and p.name == ring.name)
    if ring is not None and taken:
        yield Series(name=ring.words, marks=taken, colour=ring.colour, size=22.0, filled=False)
    written = tuple(_mark(chart, p) for p in finite if p.written)
    if written:
        words = f"your {chart.subject}"
        yield Series(name=words, marks=written, colour=WRITTEN_COLOUR, marker="star", size=18.0)


def _mark(chart: Chart, point: Point) -> Mark:
    floor = floor_of(chart)
    error, value = 100 * point.standard_error, shown_error(point, floor)
    known = math.isfinite(error) and error > 0
    lines = _lines(chart, point)
    plain = "\n".join(f"# {line}" for text in lines[1:] for line in text.splitlines())
    return Mark(
        x=point.seconds,
        y=value,
        low=max(value - error, floor) if known else math.nan,
        high=value + error if known else math.nan,
        hover="\n".join(lines),
        block=f"{point.block or f'# {point.name}'}\n{plain}",
    )


def _lines(chart: Chart, point: Point) -> list[str]:
    """Name and figures of a point."""
    error = with_scatter(point.error, point.standard_error, point.starts)
    worst = chart.label(point.worst)
    cost, _, unit = chart.cost_label.partition(" [")
    return [
        point.name,
        f"{cost}: {point.seconds:.3g} {unit.rstrip(']')}",
        f"error: {error} ({worst})",
        f"verdict: {chart.verdict_words(point)}",
    ]
