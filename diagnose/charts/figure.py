"""Picture of a chart: where one stands, what to take, the front, every quantity."""

import math
import re
import textwrap
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from ..pages.page import visible
from ..pages.picture import (
    PAGE_WIDTH,
    PageImage,
    least_width,
    picture_bytes,
    plain_numbers,
)
from .chart import RECOMMENDED, Chart, Choice, Point

FRONT, OTHER, DOUBTFUL, LIMIT = "#1f5a94", "#9aa3ab", "#e07b39", "#b3261e"
WINNER, SO_FAR, HERE_COLOUR = "#3a923a", "#e07b39", "#111111"
FLOOR = 1e-3  # %, the least error that is drawn; the reference sits on it
BEST, BEATEN = "best for its time", "another is better"
UNTOLD = "scatter too large to tell"
_MOST_ROWS = 12  # of the front, in the table of quantities
_WIDE = 46  # characters of a name on one line


def chart_figure(chart: Chart) -> Any:
    """Figure of a chart: a panel of points for each question, errors by quantity.

    Parameters
    ----------
    chart : Chart
        With one finite point at least.

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
    for name in names[1:]:
        panels[name].sharey(panels[names[0]])
    for name, question in zip(names, questions, strict=True):
        _draw_points(panels[name], chart, question, columns=2 if len(names) > 1 else 3)
    _draw_quantities(figure, panels["quantities"], chart)
    return figure


_POINTS, _PER_ROW, _LABELS = 6.2, 0.38, 1.9  # inches: panels, a row of the table, its words


def _wrapped(text: str, width: int) -> str:
    return "\n".join(textwrap.wrap(text, width))


def floor_of(chart: Chart) -> float:
    """Least error that is drawn [%]: what lies deep in the reference's own error tells nothing."""
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
        label="the best",
        zorder=1,
    )
    for number, point in enumerate(chart.points):
        if any(point is each for each in finite):
            _draw_point(axes, point, number, floor)
    if chart.accuracy is not None:
        axes.axhline(100 * chart.accuracy, color=LIMIT, lw=1, ls="--", label="accuracy asked")
    if chart.remaining > 0:
        axes.axhspan(
            floor / 2,
            max(100 * chart.remaining, floor / 2),
            color="#dfe3e8",
            zorder=0,
            label="the reference's own error",
        )
    for label, style in _KINDS.items():
        if any(kind_of(p) == label for p in finite):
            axes.plot([], [], ls="none", label=label, **style)
    _mark_choice(axes, chart, question, finite)
    axes.set(xscale="log", xlabel=chart.cost_label, ylabel=chart.error_label)
    if question:
        axes.set_title(chart.heading(question), fontsize=10)
    if chart.accuracy is not None:
        axes.set_yscale("log")
        axes.set_ylim(floor / 2, _HEADROOM * _highest(chart))
    axes.margins(x=_MARGIN)
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
    axes.grid(alpha=0.3, which="both")
    _mark_here(axes, finite, chart.subject, floor)
    _number(axes, front, floor)
    _legend_below(axes, ncols=columns)


def _mark_choice(axes: Any, chart: Chart, question: str, finite: list[Point]) -> None:
    """Ring round what to take: green where that is final."""
    choice = choice_of(chart, question)
    name = chart.winner if choice is None else choice.name
    final = choice is None or choice.status == "resolved"
    if choice is not None and choice.status not in RECOMMENDED:
        return
    for point in (p for p in finite if p.name == name):
        style = {"color": WINNER, "ls": "-"} if final else {"color": SO_FAR, "ls": ":"}
        label = winner_words(chart) if final else "may be enough, not certain"
        axes.scatter(
            point.seconds,
            shown_error(point, floor_of(chart)),
            s=260,
            facecolors="none",
            edgecolors=style["color"],
            linestyles=style["ls"],
            linewidths=2.2,
            label=label,
            zorder=3,
        )


def choice_of(chart: Chart, question: str) -> Choice | None:
    """What to take for a question; None where nothing is recommended."""
    return next((each for each in chart.choices if each.question == question), None)


def _mark_here(axes: Any, finite: list[Point], subject: str, floor: float) -> None:
    """A star with its name beside it, on the side of the panel's middle, above lines."""
    from matplotlib.patheffects import withStroke

    for point in (p for p in finite if p.here):
        place = (point.seconds, shown_error(point, floor))
        axes.plot(
            *place, "*", ms=16, mfc="#ffd23f", mec=HERE_COLOUR, label=f"your {subject}", zorder=5
        )
        right = axes.transAxes.inverted().transform(axes.transData.transform(place))[0] > _RIGHT
        axes.annotate(
            f"your {subject}",
            place,
            xytext=(-9 if right else 9, 5),
            textcoords="offset points",
            ha="right" if right else "left",
            va="bottom",
            fontsize=9,
            weight="bold",
            color=HERE_COLOUR,
            path_effects=[withStroke(linewidth=4, foreground="white")],
            zorder=5,
        )


_MARGIN = 0.09  # of the width at either side: numbers stay inside the frame
_RIGHT = 0.7  # of the panel: further right words stand left of their mark


def _number(axes: Any, front: list[Point], floor: float) -> None:
    """Numbers above the points of the front, below where the one before is too near.

    That of the scene as written is on the other side of its star than the name.
    """
    from matplotlib.patheffects import withStroke

    to_panel = axes.transData + axes.transAxes.inverted()
    before, below = np.array([-1.0, -1.0]), True
    for number, point in enumerate(front, start=1):
        place = (point.seconds, shown_error(point, floor))
        here = to_panel.transform(place)
        below = bool(np.all(np.abs(here - before) < _NEAR)) and not below
        before = here
        left = point.here and here[0] <= _RIGHT
        axes.annotate(
            str(number),
            place,
            xytext=(-7 if left else 6, -6 if below else 6),
            textcoords="offset points",
            ha="right" if left else "left",
            va="top" if below else "bottom",
            fontsize=9,
            weight="bold",
            color=FRONT,
            path_effects=[withStroke(linewidth=2, foreground="white")],
            zorder=4,
        )


def _highest(chart: Chart) -> float:
    """Largest error that is drawn, or the accuracy asked [%]."""
    errors = [shown_error(p, FLOOR) for p in chart.points if math.isfinite(p.error)]
    return max([*errors, 100 * (chart.accuracy or 0.0), FLOOR])


_HEADROOM = 2.5  # of the error axis: the highest number stays inside the frame
_NEAR = (0.03, 0.08)  # of the panel's width and height: two numbers would touch


def _legend_below(axes: Any, ncols: int) -> None:
    """Where no point can lie under it."""
    axes.legend(
        fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=ncols, frameon=False
    )


def winner_words(chart: Chart) -> str:
    """What the ring round a point says."""
    if chart.accuracy is None:
        return "fastest within the standard error of the best"
    return "cheapest within the accuracy"


_KINDS: dict[str, dict[str, Any]] = {
    BEST: {"marker": "o", "ms": 8, "color": FRONT},
    BEATEN: {"marker": "o", "ms": 5, "color": OTHER},
    UNTOLD: {"marker": "s", "ms": 6, "mfc": "none", "color": DOUBTFUL},
}


def kind_of(point: Point) -> str:
    """How a point is drawn, in the words of the legend."""
    if point.verdict == "doubtful":
        return UNTOLD
    return BEST if point.on_front else BEATEN


def _draw_point(axes: Any, point: Point, number: int, floor: float) -> None:
    """One point with its standard error, under an id that the page gives a name to."""
    error = 100 * point.standard_error
    if math.isfinite(error) and error > 0:
        value = shown_error(point, floor)
        low = max(value - error, floor)
        axes.vlines(point.seconds, low, value + error, color=OTHER, lw=0.8, zorder=1)
    (mark,) = axes.plot(
        point.seconds, shown_error(point, floor), ls="none", zorder=3, **_KINDS[kind_of(point)]
    )
    mark.set_gid(f"point-{number}")


def _draw_quantities(figure: Any, axes: Any, chart: Chart) -> None:
    """Errors of every quantity for the points of the front, as a table of colours."""
    from matplotlib.colors import LogNorm

    points = _table_points(chart)
    if not points:
        axes.set_axis_off()
        return
    names = list(dict.fromkeys(name for _, point in points for name in point.errors))
    if not names:
        axes.set_axis_off()
        return
    values = _errors(points, names)
    shown = axes.imshow(
        np.maximum(values, FLOOR),
        aspect="auto",
        cmap="YlOrRd",
        norm=LogNorm(vmin=_palest(chart, values), vmax=_reddest(values)),
    )
    for (row, column), value in np.ndenumerate(values):
        axes.text(
            column,
            row,
            _percent(value),
            ha="center",
            va="center",
            fontsize=8,
            color=_ink_on(value),
        )
    words = [chart.label(name) for name in names]
    axes.set_xticks(range(len(names)), words, rotation=35, ha="right", fontsize=8)
    labels = [_wrapped(label, _WIDE) for label, _ in points]
    axes.set_yticks(range(len(points)), labels, fontsize=8)
    what = "" if chart.choices else ", best for their time"
    axes.set_title(f"Error of every quantity{what} [{_unit(chart)}]", fontsize=10)
    figure.colorbar(shown, ax=axes, pad=0.01).ax.tick_params(labelsize=8)


def _palest(chart: Chart, values: Any) -> float:
    """Of an accuracy that is asked all decades below it; else from what there is."""
    return 10 * FLOOR if chart.accuracy is not None else max(FLOOR, float(np.nanmin(values)) / 2)


_DARK = 20.0  # %, above it a cell is dark


def _unit(chart: Chart) -> str:
    return "%" if chart.accuracy is not None else "% of the limit"


def _table_points(chart: Chart) -> list[tuple[str, Point]]:
    """Rows of the table: where one stands and what to take; else the front, its most accurate."""
    if not chart.choices:
        numbered = [(f"{i} {p.name}", p) for i, p in enumerate(chart.front, start=1)]
        return numbered[-_MOST_ROWS:]
    rows = []
    for choice in chart.shown_choices:
        for point in (p for p in chart.of(choice.question) if p.errors):
            if point.here or point.name == choice.name:
                where = "" if chart.alike else f"{choice.question}: "
                rows.append((f"{where}{point.name}", point))
    return rows


def _percent(value: float) -> str:
    if not math.isfinite(value):
        return ""
    if value >= 100:
        return f"{value:.0f}"
    return "0" if value < FLOOR else f"{value:.1g}" if value < 10 * FLOOR else f"{value:.2g}"


@dataclass(frozen=True, kw_only=True)
class ShadedCell:
    """An error in the table of a page, on the colour that the picture gives it."""

    text: str
    ground: str
    ink: str


def question_figure(chart: Chart, question: str) -> Any:
    """The points of one question alone, as a :class:`matplotlib.figure.Figure` for a page."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, _POINTS - 0.8), layout="constrained")
    _draw_points(figure.subplots(), chart, question, columns=2)
    return figure


def question_images(chart: Chart) -> list[PageImage]:
    """A picture of points for each question; a point tells its name under the pointer."""
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


_MOST_PX = 760  # width of points in a page


def shaded_rows(chart: Chart) -> tuple[list[str], list[tuple[str, list[ShadedCell]]]]:
    """Heads and rows of the errors by quantity, in the colours of the picture."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm, to_hex

    points = _table_points(chart)
    names = list(dict.fromkeys(name for _, point in points for name in point.errors))
    if not names:
        return [], []
    values = _errors(points, names)
    norm = LogNorm(vmin=_palest(chart, values), vmax=_reddest(values), clip=True)

    def cell(value: float) -> ShadedCell:
        if not math.isfinite(value):
            return ShadedCell(text="–", ground="#ffffff", ink=_INK)
        ground = to_hex(colormaps["YlOrRd"](norm(max(value, FLOOR))))
        return ShadedCell(text=_percent(value), ground=ground, ink=_ink_on(value))

    rows = [
        (label, [cell(float(value)) for value in line])
        for (label, _), line in zip(points, values, strict=True)
    ]
    return [chart.label(name) for name in names], rows


_INK = "#1c232b"


def _ink_on(value: float) -> str:
    return "white" if value > _DARK else "black"


def _errors(points: list[tuple[str, Point]], names: list[str]) -> Any:
    return np.array(
        [[100 * p.errors[n].error if n in p.errors else np.nan for n in names] for _, p in points]
    )


def _reddest(values: Any) -> float:
    return max(100.0, float(np.nanmax(values)))


def chart_svg(chart: Chart) -> str:
    """The figure as SVG whose points tell their names under the pointer.

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
    words = f"{point.name}: {point.seconds:.3g} s, error {point.error:.2%} ({worst})"
    return f"<title>{escape(visible(words))}</title>"
