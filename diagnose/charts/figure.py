"""Picture of a chart: scene as written, recommendation, front, every quantity."""

import math
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from ..pages.page import visible
from ..pages.picture import (
    PAGE_WIDTH,
    PageImage,
    lay_out,
    least_width,
    picture_bytes,
    plain_numbers,
)
from .chart import RECOMMENDED, Chart, Choice, Point
from .words import few_starts, percent, with_scatter

FRONT, OTHER, DOUBTFUL, LIMIT = "#1f5a94", "#9aa3ab", "#e07b39", "#b3261e"
WINNER, SO_FAR, WRITTEN_COLOUR = "#3a923a", "#e07b39", "#111111"
FLOOR = 1e-3  # %, smallest error that is drawn; the reference is drawn on it
BEST, BEATEN = "nothing faster is as accurate", "beaten by another"
UNDECIDED, REFERENCE = "scatter too large to decide", "reference"
TOO_CLOSE = "too close to call"
_MOST_ROWS = 12  # of the front, in the table of quantities
_WIDE = 46  # characters of a name on one line
_TITLE_WIDTH = 52  # characters of a title above a panel of half a page


def chart_figure(chart: Chart) -> Any:
    """Figure of a chart: a panel of points for each question, errors by quantity.

    Parameters
    ----------
    chart : Chart
        Chart with at least one finite point.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    rows = len(_table_points(chart))
    high = _PER_ROW * rows + _LABELS
    figure = Figure(figsize=(13, _POINTS + high), layout="constrained")
    said = "" if chart.choices else f"\n{_wrapped(chart.verdict, 150)}"
    figure.suptitle(f"{chart.title}{said}", fontsize=11)
    questions = chart.shown or ("",)
    names = [f"points {i}" for i in range(len(questions))]
    mosaic: Any = [names, ["quantities"] * len(names)]
    panels = figure.subplot_mosaic(mosaic, height_ratios=(_POINTS - 1, high))
    for name, question in zip(names, questions, strict=True):
        _draw_points(panels[name], chart, question, columns=2 if len(names) > 1 else 3)
    _draw_quantities(panels["quantities"], chart)
    lay_out(figure)
    for name, question in zip(names, questions, strict=True):
        _write_names(panels[name], chart, question)
    return figure


_POINTS, _PER_ROW, _LABELS = 6.2, 0.38, 1.9  # inches: panels, a row of the table, its labels


def _wrapped(text: str, width: int) -> str:
    return "\n".join(textwrap.wrap(text, width))


def floor_of(chart: Chart) -> float:
    """Smallest error that is drawn [%]: errors far below that of the reference mean nothing."""
    if chart.accuracy is None:
        return FLOOR
    return max(FLOOR, 100 * min(chart.remaining, chart.accuracy) * _DEEP)


_DEEP = 0.1  # of the reference's own error


def shown_error(point: Point, floor: float) -> float:
    """Error in per cent, not below a floor [%]."""
    return max(100 * point.error, floor)


def _draw_points(axes: Any, chart: Chart, question: str, *, columns: int) -> None:
    points, floor = chart.of(question), floor_of(chart)
    finite = [p for p in points if math.isfinite(p.error) and math.isfinite(p.seconds)]
    front = sorted((p for p in finite if p.on_front), key=lambda p: p.seconds)
    axes.step(
        [p.seconds for p in front],
        [shown_error(p, floor) for p in front],
        where="post",
        color=FRONT,
        lw=1.2,
        zorder=1,
    )
    for number, point in enumerate(chart.points):
        if any(point is each for each in finite):
            _draw_point(axes, point, number, floor)
    _draw_levels(axes, chart, floor)
    for label, style in _KINDS.items():
        if any(kind_of(p) == label for p in finite):
            axes.plot([], [], ls="none", label=label, **style)
    _draw_ring(axes, chart, question, finite)
    axes.set(xscale="log", xlabel=chart.cost_label, ylabel=chart.error_name(question))
    if question:
        axes.set_title(_wrapped(chart.heading(question), _TITLE_WIDTH), fontsize=10)
    if chart.accuracy is not None:
        axes.set_yscale("log")
        axes.set_ylim(floor / 2, _HEADROOM * _highest(chart, points))
    axes.margins(x=_MARGIN)
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
    axes.grid(alpha=0.3, which="both")
    for point in (p for p in finite if p.written):
        place = (point.seconds, shown_error(point, floor))
        label = f"your {chart.subject}"
        axes.plot(*place, "*", ms=16, mfc="#ffd23f", mec=WRITTEN_COLOUR, label=label, zorder=5)
    _legend_below(axes, ncols=columns)


def _draw_levels(axes: Any, chart: Chart, floor: float) -> None:
    """Requested accuracy, and the error of the reference at the bottom and around the limit."""
    off = 100 * chart.remaining
    if chart.accuracy is not None:
        asked = 100 * chart.accuracy
        axes.axhline(asked, color=LIMIT, lw=1, ls="--", label="accuracy asked")
        if has_band(chart):
            low = max(asked - off, floor / 2)
            axes.axhspan(low, asked + off, color=PALE, lw=0, zorder=0, label=TOO_CLOSE)
    if off > 0:
        high = max(off, floor / 2)
        label = "error of the reference"
        axes.axhspan(floor / 2, high, color="#dfe3e8", zorder=0, label=label)


def has_band(chart: Chart) -> bool:
    """Whether the error of the reference is visible around the requested accuracy."""
    return chart.accuracy is not None and chart.remaining > _VISIBLE * chart.accuracy


_VISIBLE = 0.1  # of the accuracy


@dataclass(frozen=True, kw_only=True)
class Ring:
    """Ring around a choice: name of its point, label, colour, and whether it is final."""

    name: str
    words: str
    colour: str
    final: bool


def ring_of(chart: Chart, question: str) -> Ring | None:
    """Ring around the recommendation: green if final and enough; None without one."""
    choice = choice_of(chart, question)
    if choice is None:
        return Ring(name=chart.winner, words=winner_words(chart), colour=WINNER, final=True)
    if choice.status not in RECOMMENDED:
        return None
    final = choice.status == "resolved"
    words = winner_words(chart) if final else "may be enough, not certain"
    if not choice.enough:
        words = "best with your rungs, not enough"
    colour = WINNER if final and choice.enough else SO_FAR
    return Ring(name=choice.name, words=words, colour=colour, final=final)


def _draw_ring(axes: Any, chart: Chart, question: str, finite: list[Point]) -> None:
    ring = ring_of(chart, question)
    if ring is None:
        return
    for point in (p for p in finite if p.name == ring.name):
        axes.scatter(
            point.seconds,
            shown_error(point, floor_of(chart)),
            s=260,
            facecolors="none",
            edgecolors=ring.colour,
            linestyles="-" if ring.final else ":",
            linewidths=2.2,
            label=ring.words,
            zorder=3,
        )


def choice_of(chart: Chart, question: str) -> Choice | None:
    """Choice for a question; None if there is none."""
    return next((each for each in chart.choices if each.question == question), None)


_MARGIN = 0.09  # of the width, on either side: keeps numbers inside the frame


def _write_names(axes: Any, chart: Chart, question: str) -> None:
    """Write names next to star and reference and numbers next to the front, covering least.

    The figure has been drawn, so that its layout is final.
    """
    floor = floor_of(chart)
    finite = [p for p in chart.of(question) if math.isfinite(p.error) and math.isfinite(p.seconds)]
    texts = [(p, f"your {chart.subject}", WRITTEN_COLOUR) for p in finite if p.written]
    texts += [(p, REFERENCE, FRONT) for p in finite if kind_of(p) == REFERENCE and not p.written]
    texts += [(p, str(i), FRONT) for i, p in enumerate(chart.numbered(question), start=1)]
    ring = ring_of(chart, question)
    large = [p.written or (ring is not None and p.name == ring.name) for p in finite]
    marks = [
        _box(axes, p, floor, _STAR if more else _DOT) for p, more in zip(finite, large, strict=True)
    ]
    taken = list(marks)
    for point, text, colour in texts:
        place = (point.seconds, shown_error(point, floor))
        taken.append(_write(axes, place, text, colour, marks, taken))


_STAR, _DOT = 12.0, 4.0  # px at 100 dpi: half the width that names must not cover


def _box(axes: Any, point: Point, floor: float, half: float) -> Any:
    """Area that a point covers in the picture."""
    from matplotlib.transforms import Bbox

    centre = axes.transData.transform((point.seconds, shown_error(point, floor)))
    return Bbox.from_extents(*(centre - half), *(centre + half))


def distance_to_box(box: Any, place: Any) -> float:
    """Distance of a position from a box [px]."""
    return math.dist(_nearest_to(box, place), place)


def _write(
    axes: Any,
    place: tuple[float, float],
    text: str,
    colour: str,
    marks: list[Any],
    taken: list[Any],
) -> Any:
    """Write next to a point, on the side that covers least and is nearest to no other mark.

    If there is no such side, the text stands farther away, at the end of a thin line. Return the
    box of the text.
    """
    from matplotlib.lines import Line2D
    from matplotlib.path import Path
    from matplotlib.patheffects import withStroke

    note = axes.annotate(
        text,
        place,
        xytext=(0, 0),
        textcoords="offset points",
        fontsize=9,
        weight="bold",
        color=colour,
        path_effects=[withStroke(linewidth=3, foreground="white")],
        zorder=6,
    )
    note.set_in_layout(False)
    frame, own = axes.get_window_extent(), axes.transData.transform(place)
    centres = [0.5 * (mark.p0 + mark.p1) for mark in marks]
    numbered = text.isdecimal()  # other names explain themselves
    others = [i for i, at in enumerate(centres) if numbered and math.dist(at, own) > 1]

    def put(side: tuple[str, str], far: float) -> Any:
        note.set(ha=side[0], va=side[1])
        note.set_position((far * _ASIDE[side[0]], far * _ASIDE[side[1]]))
        return note.get_window_extent()

    def costs(at: tuple[tuple[str, str], float]) -> tuple[int, float]:
        """Number of marks that are covered or could be misread as labelled; then the distance."""
        box = put(*at)
        outside = bool(box.x0 < frame.x0 or box.x1 > frame.x1 or box.y0 < frame.y0)
        count = int(box.count_overlaps(taken)) + len(taken) * outside
        if at[1] > 1:
            line = Path([own, _nearest_to(box, own)])
            crossed = [marks[i] for i in others] + taken[len(marks) :]
            return count + sum(line.intersects_bbox(each, filled=True) for each in crossed), at[1]
        reach = _CLEARLY * distance_to_box(box, own)
        return count + sum(distance_to_box(box, centres[i]) < reach for i in others), at[1]

    side, far = min(
        ((side, far) for far in _FAR[: None if numbered else 1] for side in _SIDES), key=costs
    )
    box = put(side, far)
    if far > 1:
        ends = axes.transData.inverted().transform([own, _nearest_to(box, own)])
        axes.add_artist(Line2D(*ends.T, color=colour, lw=0.7, zorder=2))
    return box


def _nearest_to(box: Any, place: Any) -> tuple[float, float]:
    """Point of a box that is nearest to a position."""
    x, y = place
    return min(max(x, box.x0), box.x1), min(max(y, box.y0), box.y1)


_FAR = (1.0, 2.0, 3.0, 5.0)  # times the offset next to a point
_CLEARLY = 1.3  # times as far from any other point as from its own
_ASIDE = {"left": 8, "right": -8, "center": 0, "bottom": 5, "top": -5}  # points
_SIDES = [(across, up) for up in ("bottom", "top") for across in ("left", "right", "center")]


def _highest(chart: Chart, points: Sequence[Point]) -> float:
    """Largest error that is drawn, or the requested accuracy [%]."""
    errors = [shown_error(p, FLOOR) for p in points if math.isfinite(p.error)]
    return max([*errors, 100 * (chart.accuracy or 0.0), FLOOR])


_HEADROOM = 2.5  # of the error axis: keeps the highest number inside the frame


def _legend_below(axes: Any, ncols: int) -> None:
    """Draw the legend below the axes, where it covers no point; none without any points."""
    if not axes.get_legend_handles_labels()[0]:
        return
    axes.legend(
        fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=ncols, frameon=False
    )


def winner_words(chart: Chart) -> str:
    """Label of the ring around a point."""
    if chart.accuracy is None:
        return "fastest within the standard error of the best"
    return "cheapest within the accuracy"


_KINDS: dict[str, dict[str, Any]] = {
    BEST: {"marker": "o", "ms": 8, "color": FRONT},
    BEATEN: {"marker": "o", "ms": 5, "color": OTHER},
    UNDECIDED: {"marker": "s", "ms": 6, "mfc": "none", "color": DOUBTFUL},
    REFERENCE: {"marker": "o", "ms": 8, "mfc": "white", "color": FRONT},
}


def kind_of(point: Point) -> str:
    """Kind of a point, in the words of the legend."""
    if point.verdict in ("doubtful", "reference"):
        return UNDECIDED if point.verdict == "doubtful" else REFERENCE
    return BEST if point.on_front else BEATEN


def _draw_point(axes: Any, point: Point, number: int, floor: float) -> None:
    """Draw one point with its standard error, under an id to which the page adds a name."""
    error = 100 * point.standard_error
    if math.isfinite(error) and error > 0:
        value = shown_error(point, floor)
        low = max(value - error, floor)
        axes.vlines(point.seconds, low, value + error, color=OTHER, lw=0.8, zorder=1)
    (mark,) = axes.plot(
        point.seconds, shown_error(point, floor), ls="none", zorder=3, **_KINDS[kind_of(point)]
    )
    mark.set_gid(f"point-{number}")


def _draw_quantities(axes: Any, chart: Chart) -> None:
    """Draw the errors of every quantity as a coloured table."""
    points, names = _table(chart)
    if not names:
        axes.set_axis_off()
        return
    values = _errors(points, names)
    grounds = _grounds(chart, values)
    axes.imshow(grounds, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        axes.text(
            column,
            row,
            _percent(value),
            ha="center",
            va="center",
            fontsize=8,
            color=_ink_on(grounds[row, column]),
        )
    words = [chart.label(name) for name in names]
    axes.set_xticks(range(len(names)), words, rotation=35, ha="right", fontsize=8)
    labels = [_wrapped(label, _WIDE) for label, _ in points]
    axes.set_yticks(range(len(points)), labels, fontsize=8)
    what = "" if chart.choices else ", best for their time"
    red = "" if chart.accuracy is None else f"; red: above {percent(chart.accuracy)}"
    axes.set_title(f"Error of every quantity{what} [{_unit(chart)}]{red}", fontsize=10)


def _grounds(chart: Chart, values: Any) -> Any:
    """Colours of errors [%] [shape=(..., 4)]: red above a requested accuracy, else by size."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm, to_rgba

    asked, off = 100 * (chart.accuracy or 0.0), close_to(chart)
    least = asked or max(FLOOR, float(np.nanmin(values)) / 2)
    norm = LogNorm(vmin=least, vmax=max(100.0, float(np.nanmax(values))), clip=True)
    depth = norm(np.maximum(np.nan_to_num(values), FLOOR))
    if not asked:
        return colormaps["YlOrRd"](depth)
    red = colormaps["Reds"](_PALEST + _DEEPER * depth)
    pale = np.where((abs(values - asked) <= off)[..., None], to_rgba(PALE), 1.0)
    return np.where((values > asked + off)[..., None], red, pale)


def close_to(chart: Chart) -> float:
    """Distance from the accuracy that is too close to call [%]: at least two-digit resolution."""
    return 100 * max(chart.remaining, _LAST_DIGIT * (chart.accuracy or 0.0))


_LAST_DIGIT = 0.01
PALE = "#fbe8e6"  # of the band around the accuracy


_PALEST, _DEEPER = 0.2, 0.4  # of the colours: keeps numbers legible in black


def _unit(chart: Chart) -> str:
    return "%" if chart.accuracy is not None else "% of the limit"


def _table_points(chart: Chart) -> list[tuple[str, Point]]:
    """Rows of the table: scene as written and choices; else the most accurate of the front."""
    if not chart.choices:
        numbered = [(f"{i} {p.name}", p) for i, p in enumerate(chart.front, start=1)]
        return numbered[-_MOST_ROWS:]
    rows: list[tuple[str, Point]] = []
    for choice in chart.shown_choices:
        against = ", against the same rungs" if choice.question in chart.error_labels else ""
        for point in (p for p in chart.of(choice.question) if p.errors):
            known = any(point.rungs == p.rungs and point.errors == p.errors for _, p in rows)
            if not known and (point.written or point.name == choice.name):
                rows.append((f"{point.name}{against}", point))
    return rows


def _table(chart: Chart) -> tuple[list[tuple[str, Point]], list[str]]:
    """Points and quantities of the table, by decreasing error of the subject as written."""
    points = _table_points(chart)
    names = list(dict.fromkeys(name for _, point in points for name in point.errors))
    own = [point for _, point in points if point.written]
    if own:
        names.sort(key=lambda name: -own[-1].errors[name].error if name in own[-1].errors else 0.0)
    return points, names


def _percent(value: float) -> str:
    if not math.isfinite(value):
        return ""
    if value >= 100:
        return f"{value:.0f}"
    return "0" if value < FLOOR else f"{value:.1g}" if value < 10 * FLOOR else f"{value:.2g}"


@dataclass(frozen=True, kw_only=True)
class ShadedCell:
    """An error in the table of a page, with the background colour of the picture."""

    text: str
    ground: str
    ink: str
    worst: bool


def question_figure(chart: Chart, question: str) -> Any:
    """The points of one question alone, as a :class:`matplotlib.figure.Figure` for a page."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, _POINTS - 0.8), layout="constrained")
    axes = figure.subplots()
    _draw_points(axes, chart, question, columns=2)
    lay_out(figure)
    _write_names(axes, chart, question)
    return figure


def question_images(chart: Chart) -> list[PageImage]:
    """Picture of points for each question; the pointer shows the name of a point."""
    images = []
    for question in chart.shown or ("",):
        figure = question_figure(chart, question)
        svg = picture_bytes(figure, ".svg").decode()
        images.append(
            PageImage(
                svg=_pointed(chart, svg[svg.index("<svg") :]),
                least=least_width(figure),
                most=_MOST_PX,
            )
        )
    return images


_MOST_PX = 760  # largest width of a picture of points in a page


def shaded_rows(chart: Chart) -> tuple[list[str], list[tuple[str, list[ShadedCell]]]]:
    """Headings and rows of the errors by quantity, in the colours of the picture."""
    from matplotlib.colors import to_hex

    points, names = _table(chart)
    if not names:
        return [], []
    grounds = _grounds(chart, _errors(points, names))

    def cell(point: Point, name: str, ground: Any) -> ShadedCell:
        found, text = point.errors.get(name), "–"
        if found is not None and math.isfinite(found.error):
            text = with_scatter(found.error, found.standard_error, point.starts)
        return ShadedCell(
            text=text.replace(" %", ""),
            ground=to_hex(ground),
            ink=_ink_on(ground),
            worst=bool(chart.choices) and name == point.worst,
        )

    rows = [
        (label, [cell(point, *each) for each in zip(names, line, strict=True)])
        for (label, point), line in zip(points, grounds, strict=True)
    ]
    return [chart.label(name) for name in names], rows


def _ink_on(ground: Any) -> str:
    return "black" if float(np.mean(ground[:3])) > _HALF else "white"


_HALF = 0.5


def _errors(points: list[tuple[str, Point]], names: list[str]) -> Any:
    return np.array(
        [[100 * p.errors[n].error if n in p.errors else np.nan for n in names] for _, p in points]
    )


def chart_svg(chart: Chart) -> str:
    """The figure as SVG; the pointer shows the names of points.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    str
    """
    return _pointed(chart, picture_bytes(chart_figure(chart), ".svg").decode())


def _pointed(chart: Chart, text: str) -> str:
    return _PLACE.sub(lambda found: found[0] + _pointer(chart, chart.points[int(found[1])]), text)


_PLACE = re.compile(r'<g id="point-(\d+)">')


def _pointer(chart: Chart, point: Point) -> str:
    worst = chart.label(point.worst) or "none"
    few = few_starts(point.error, point.starts)
    words = f"{point.name}: {point.seconds:.3g} s, error {point.error:.2%}{few} ({worst})"
    return f"<title>{escape(visible(words))}</title>"
