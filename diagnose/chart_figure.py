"""Pictures and pages of a chart: the front, the convergence of the reference, every quantity."""

import json
import math
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from ..sim.fidelity import Convergence
from .chart import Chart, Point, chart_table, convergence_text, remaining_error, save_rows
from .page import render, visible
from .picture import picture_bytes, save_picture
from .report import save_page

_FRONT, _OTHER, _DOUBTFUL, _LIMIT = "#1f5a94", "#9aa3ab", "#e07b39", "#b3261e"
_WINNER = "#3a923a"
_FLOOR = 1e-3  # %, the least error that is drawn; the reference sits on it
_MOST_ROWS = 12  # of the front, in the table of quantities
_WIDE = 46  # characters of a name on one line


def chart_figure(chart: Chart) -> Any:
    """Figure of a chart: points with the front, convergence, errors by quantity.

    Parameters
    ----------
    chart : Chart
        With one finite point at least.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    rows = min(len(chart.front), _MOST_ROWS)
    figure = Figure(figsize=(13, 6.7 + 0.38 * rows + 1.2), layout="constrained")
    figure.suptitle(f"{chart.title}\n{_wrapped(chart.verdict, 130)}", fontsize=11)
    ratios = (5.5, 0.38 * rows + 1.2)
    right = "levels" if chart.convergence else "points"
    mosaic: Any = [["points", "points", right], ["quantities"] * 3]
    panels = figure.subplot_mosaic(mosaic, height_ratios=ratios)
    _draw_points(panels["points"], chart)
    if chart.convergence:
        _draw_convergence(panels["levels"], chart)
    _draw_quantities(figure, panels["quantities"], chart)
    return figure


def _wrapped(text: str, width: int) -> str:
    return "\n".join(textwrap.wrap(text, width))


def _shown(point: Point) -> float:
    """Error in per cent, not below the floor."""
    return max(100 * point.error, _FLOOR)


def _draw_points(axes: Any, chart: Chart) -> None:
    finite = [p for p in chart.points if math.isfinite(p.error) and math.isfinite(p.seconds)]
    front = [p for p in finite if p.on_front]
    axes.step(
        [p.seconds for p in front],
        [_shown(p) for p in front],
        where="post",
        color=_FRONT,
        lw=1.2,
        label="front",
        zorder=1,
    )
    for number, point in enumerate(chart.points):
        if point in finite:
            _draw_point(axes, point, number)
    if chart.accuracy is not None:
        axes.axhline(100 * chart.accuracy, color=_LIMIT, lw=1, ls="--", label="accuracy asked")
    if chart.remaining > 0:
        axes.axhspan(
            _FLOOR / 2,
            max(100 * chart.remaining, _FLOOR / 2),
            color="#dfe3e8",
            zorder=0,
            label="the reference's own error",
        )
    for point in (p for p in finite if p.name == chart.winner):
        place = (point.seconds, _shown(point))
        axes.plot(*place, "o", ms=15, mfc="none", mew=2, color=_WINNER, label=_fastest(chart))
    for label, style in _KINDS.items():
        if any(_kind(p) == label for p in finite):
            axes.plot([], [], ls="none", label=label, **style)
    axes.set(xscale="log", xlabel=chart.cost_label, ylabel=chart.error_label)
    if chart.accuracy is not None:
        axes.set_yscale("log")
        axes.set_ylim(bottom=_FLOOR / 2)
        axes.set_ylim(top=_HEADROOM * axes.get_ylim()[1])
    _plain_numbers(axes.xaxis)
    _plain_numbers(axes.yaxis)
    axes.grid(alpha=0.3, which="both")
    _number(axes, front)
    _legend_below(axes, ncols=3)


def _number(axes: Any, front: list[Point]) -> None:
    """Numbers above the points of the front, below where the one before is too near."""
    from matplotlib.patheffects import withStroke

    to_panel = axes.transData + axes.transAxes.inverted()
    before, below = np.array([-1.0, -1.0]), True
    for number, point in enumerate(front, start=1):
        place = (point.seconds, _shown(point))
        here = to_panel.transform(place)
        below = bool(np.all(np.abs(here - before) < _NEAR)) and not below
        before = here
        axes.annotate(
            str(number),
            place,
            xytext=(6, -6 if below else 6),
            textcoords="offset points",
            va="top" if below else "bottom",
            fontsize=9,
            weight="bold",
            color=_FRONT,
            path_effects=[withStroke(linewidth=2, foreground="white")],
            zorder=4,
        )


_HEADROOM = 2.0  # of the error axis: the highest number stays inside the frame
_NEAR = (0.03, 0.08)  # of the panel's width and height: two numbers would touch


def _legend_below(axes: Any, ncols: int) -> None:
    """Where no point can lie under it."""
    axes.legend(
        fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=ncols, frameon=False
    )


def _fastest(chart: Chart) -> str:
    if chart.accuracy is None:
        return "fastest within the standard error of the best"
    return "fastest within the accuracy"


def _plain_numbers(axis: Any) -> None:
    """0.01 rather than a power of ten, at few places."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if axis.get_scale() != "log":
        return
    low, high = axis.get_view_interval()
    narrow = high < _NARROW * low
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


_NARROW = 200.0  # of an axis, last over first: so few decades need numbers between

_KINDS: dict[str, dict[str, Any]] = {
    "on the front": {"marker": "o", "ms": 8, "color": _FRONT},
    "beaten": {"marker": "o", "ms": 5, "color": _OTHER},
    "scatter too large to tell": {"marker": "s", "ms": 6, "mfc": "none", "color": _DOUBTFUL},
}


def _kind(point: Point) -> str:
    if point.verdict == "doubtful":
        return "scatter too large to tell"
    return "on the front" if point.on_front else "beaten"


def _draw_point(axes: Any, point: Point, number: int) -> None:
    """One point with its standard error, under an id that the page gives a name to."""
    error = 100 * point.standard_error
    if math.isfinite(error) and error > 0:
        low = max(_shown(point) - error, _FLOOR)
        axes.vlines(point.seconds, low, _shown(point) + error, color=_OTHER, lw=0.8, zorder=1)
    (mark,) = axes.plot(point.seconds, _shown(point), ls="none", zorder=3, **_KINDS[_kind(point)])
    mark.set_gid(f"point-{number}")


def _draw_convergence(axes: Any, chart: Chart) -> None:
    """Changes of the reference from level to level, and what Richardson leaves."""
    for colour, each in enumerate(chart.convergence):
        sizes = [max(100 * abs(step), _FLOOR / 10) for step in each.steps]
        rest = max(100 * remaining_error(each), _FLOOR / 10)
        places = range(1, len(sizes) + 1)
        axes.plot(places, sizes, "o-", color=f"C{colour}", lw=1.2, label=_convergence_label(each))
        axes.plot(len(sizes) + 1, rest, "x", color=f"C{colour}", ms=7)
    n_steps = max(len(each.steps) for each in chart.convergence)
    labels = ["coarse\nto middle", "middle\nto fine", "left after\nRichardson"]
    axes.set_xticks(range(1, n_steps + 2), labels[: n_steps + 1])
    axes.set_yscale("log")
    _plain_numbers(axes.yaxis)
    axes.set_xlim(0.7, n_steps + 1.3)
    axes.set_ylabel("change of the quantity that moves most [%]")
    axes.set_title("Convergence of the reference", fontsize=10)
    if chart.accuracy is not None:
        axes.axhline(100 * chart.accuracy / 3, color=_LIMIT, lw=1, ls=":", label="accuracy / 3")
    axes.grid(alpha=0.3, which="both")
    _legend_below(axes, ncols=1)


def _convergence_label(each: Convergence) -> str:
    order = f"order {each.order:.1f}" if math.isfinite(each.order) else "order not told"
    return f"{each.effect} ({each.quantity}): {order}{'' if each.converged else ', NOT CONVERGED'}"


def _draw_quantities(figure: Any, axes: Any, chart: Chart) -> None:
    """Errors of every quantity for the points of the front, as a table of colours."""
    from matplotlib.colors import LogNorm

    points = _table_points(chart)
    names = list(dict.fromkeys(name for _, point in points for name in point.errors))
    if not names:
        axes.set_axis_off()
        return
    values = np.array(
        [[100 * p.errors[n].error if n in p.errors else np.nan for n in names] for _, p in points]
    )
    shown = axes.imshow(
        np.maximum(values, _FLOOR),
        aspect="auto",
        cmap="YlOrRd",
        norm=LogNorm(vmin=_palest(chart, values), vmax=max(100.0, float(np.nanmax(values)))),
    )
    for (row, column), value in np.ndenumerate(values):
        dark = value > _DARK
        axes.text(
            column,
            row,
            _percent(value),
            ha="center",
            va="center",
            fontsize=6.5,
            color="white" if dark else "black",
        )
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right", fontsize=7)
    labels = [f"{number} {_wrapped(point.name, _WIDE)}" for number, point in points]
    axes.set_yticks(range(len(points)), labels, fontsize=7)
    axes.set_title(f"Error of every quantity on the front [{_unit(chart)}]", fontsize=10)
    figure.colorbar(shown, ax=axes, pad=0.01).ax.tick_params(labelsize=7)


def _palest(chart: Chart, values: Any) -> float:
    """Of an accuracy that is asked all decades below it; else from what there is."""
    return 10 * _FLOOR if chart.accuracy is not None else max(_FLOOR, float(np.nanmin(values)) / 2)


_DARK = 20.0  # %, above it a cell is dark


def _unit(chart: Chart) -> str:
    return "%" if chart.accuracy is not None else "% of the limit"


def _table_points(chart: Chart) -> list[tuple[int, Point]]:
    """Numbered points of the front; of many the most accurate."""
    numbered = list(enumerate(chart.front, start=1))
    return numbered[-_MOST_ROWS:]


def _percent(value: float) -> str:
    if not math.isfinite(value):
        return ""
    if value >= 100:
        return f"{value:.0f}"
    return "0" if value < _FLOOR else f"{value:.1g}" if value < 10 * _FLOOR else f"{value:.2g}"


def chart_svg(chart: Chart) -> str:
    """The figure as SVG whose points tell their names under the pointer.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    str
    """
    text = picture_bytes(chart_figure(chart), ".svg").decode()
    return _PLACE.sub(lambda found: found[0] + _pointer(chart.points[int(found[1])]), text)


_PLACE = re.compile(r'<g id="point-(\d+)">')


def _pointer(point: Point) -> str:
    words = (
        f"{point.name}: {point.seconds:.3g} s, error {point.error:.2%} ({point.worst or 'none'})"
    )
    return f"<title>{escape(visible(words))}</title>"


def chart_html(chart: Chart) -> str:
    """One self-contained page: verdict, picture with named points, tables.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    str
    """
    svg = chart_svg(chart)
    numbers = {id(point): number for number, point in enumerate(chart.front, start=1)}
    return render(
        "chart.html.j2",
        chart=chart,
        svg=svg[svg.index("<svg") :],
        rows=[(numbers.get(id(point), ""), point) for point in chart.points],
        convergence=[convergence_text(each) for each in chart.convergence],
        finite=math.isfinite,
    )


def save_chart(chart: Chart, path: Path, *, force: bool = True) -> None:
    """Write a chart in the form that the suffix asks for, whole or not at all.

    Parameters
    ----------
    chart : Chart
    path : Path
        One of :data:`SUFFIXES`.
    force : bool
        Replace an existing file.

    Raises
    ------
    KeyError
        Another suffix.
    """
    if path.suffix == ".csv":
        save_rows(chart, path, force=force)
    elif path.suffix in (".png", ".pdf"):
        save_picture(chart_figure(chart), path, force=force)
    else:
        save_page(_PAGES[path.suffix](chart), path, force=force)


def _json(chart: Chart) -> str:
    return json.dumps(_strict(chart_table(chart)), indent=1, allow_nan=False)


def _strict(value: Any) -> Any:
    """What is not finite as null."""
    if isinstance(value, dict):
        return {key: _strict(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_strict(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


_PAGES: dict[str, Callable[[Chart], str]] = {
    ".svg": chart_svg,
    ".html": chart_html,
    ".json": _json,
}

SUFFIXES = (".svg", ".png", ".pdf", ".html", ".json", ".csv")
"""Forms in which a chart can be written."""
