"""Maps of :mod:`.method_map` as pictures: regions as colours and symbols, theory as lines.

No two verdicts share a symbol, so that a map can be read without colours. Strokes mark a numerical
cause, closed shapes a physical one. The scene itself is a diamond, or a line if it has a value on
one axis only.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.scene.scene import Scene
from ..pages.page import short_name
from ..pages.picture import PAGE_WIDTH, PageImage, page_image, save_picture
from .method_map import MapAxis, MapPlan, StabilityMap, Verdict

COLOUR = {
    Verdict.NOT_RUN: "#ffffff",
    Verdict.ACCURATE: "#bfe3c0",
    Verdict.INACCURATE: "#f2c14e",
    Verdict.UNSTABLE: "#b3261e",
    Verdict.NOT_CONVERGED: "#e07b39",
    Verdict.REFUSED: "#9aa3ab",
    Verdict.LOST: "#9cc9e3",
    Verdict.CHAOTIC: "#5b8fc7",
    Verdict.WHIRL: "#7a4fa0",
    Verdict.FAILS: "#3c3457",
}

SYMBOL = {
    Verdict.NOT_RUN: "",
    Verdict.ACCURATE: "",
    Verdict.INACCURATE: "_",
    Verdict.UNSTABLE: "x",
    Verdict.NOT_CONVERGED: "+",
    Verdict.REFUSED: "|",
    Verdict.LOST: "^",
    Verdict.CHAOTIC: "*",
    Verdict.WHIRL: "o",
    Verdict.FAILS: "s",
}
"""Marker of every verdict; the two without a marker differ by colour, white and green."""

_DARK = {Verdict.UNSTABLE, Verdict.WHIRL, Verdict.FAILS}  # have white symbols
_INK = "#1c232b"

COLUMNS = 3
"""Panels in a row."""

_PANEL = (3.3, 3.0)  # inches
_HEAD, _FOOT = 0.5, 0.75  # inches for title and legend of a map
_NARROWEST = 7.5
_DECADES = 300
"""Ratio of the ends of an axis below which 1, 2 and 5 are marked in each decade."""

_LINES: tuple[dict[str, Any], ...] = (
    {"color": "black", "lw": 1.8},
    {"color": "black", "lw": 1.4, "ls": "--"},
    {"color": "black", "lw": 1.2, "ls": ":"},
)


def save_figure(
    scene: Scene, maps: Sequence[StabilityMap], path: Path, *, force: bool = True
) -> None:
    """Draw maps on one sheet.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap
    path : Path
        ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The suffix is none of these.
    """
    save_picture(atlas_figure(scene, maps), path, force=force)


def atlas_figure(scene: Scene, maps: Sequence[StabilityMap]) -> Any:
    """Figure of maps: a panel per method, that of the scene first, and a legend per map.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap
        At least one.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    heights = [_HEAD + _FOOT + _PANEL[1] * _rows(found) for found in maps]
    columns = max(min(COLUMNS, len(found.verdicts)) for found in maps)
    width = max(_NARROWEST, _PANEL[0] * columns + 0.6)
    figure = Figure(figsize=(width, sum(heights)), layout="constrained")
    sheets = figure.subfigures(len(maps), 1, squeeze=False, height_ratios=heights)[:, 0]
    for sheet, found in zip(sheets, maps, strict=True):
        _draw(sheet, scene, found)
    return figure


def map_images(found: StabilityMap) -> list[tuple[str, PageImage]]:
    """Panels of a map as pictures for a page, each with its method; the last is the legend."""
    from matplotlib.figure import Figure

    images = []
    lines: dict[str, Any] = {}
    for method in found.methods:
        figure = Figure(figsize=_PANEL, layout="constrained")
        panel = figure.subplots()
        _fill(panel, found, method, lines)
        panel.set_xlabel(found.plan.x.label, fontsize=9)
        panel.set_ylabel(found.plan.y.label, fontsize=9)
        images.append((method, page_image(figure)))
    return [*images, ("legend", page_image(_legend_figure(found, lines)))]


def _legend_figure(found: StabilityMap, lines: Mapping[str, Any]) -> Any:
    """Legend of colours, symbols and lines, in two columns."""
    from matplotlib.figure import Figure

    handles, labels = _meanings(found, lines)
    figure = Figure(figsize=(PAGE_WIDTH, 0.15 + 0.19 * math.ceil(len(labels) / 2)))
    style: dict[str, Any] = {"loc": "center", "ncols": 2, "fontsize": 8, "frameon": False}
    figure.legend(handles, labels, handler_map=_together(), **style)
    return figure


def _rows(found: StabilityMap) -> int:
    return math.ceil(len(found.verdicts) / COLUMNS)


def _draw(sheet: Any, scene: Scene, found: StabilityMap) -> None:
    plan, methods = found.plan, found.methods
    sheet.suptitle(f"{short_name(scene.name, 60)} (simulated): {plan.title}", fontsize=11)
    columns = min(COLUMNS, len(methods))
    grid = sheet.subplots(_rows(found), columns, squeeze=False, sharex=True, sharey=True)
    for panel in grid.flat[len(methods) :]:
        panel.remove()
    lines: dict[str, Any] = {}
    for panel, method in zip(grid.flat, methods, strict=False):
        _fill(panel, found, method, lines)
    _label(grid, plan, len(methods))
    _legend(sheet, found, lines)


def _fill(panel: Any, found: StabilityMap, method: str, lines: dict[str, Any]) -> None:
    """Draw one method: verdicts, scene and theory, whose lines are added to `lines` by name."""
    plan = found.plan
    _draw_panel(panel, plan, found.verdicts[method])
    _draw_own(panel, plan)
    _name(panel, plan, method)
    for number, curve in enumerate(plan.theory(method)):
        (line,) = panel.plot(curve.x, curve.y, **_LINES[number % len(_LINES)])
        lines.setdefault(curve.name, line)


def _name(panel: Any, plan: MapPlan, method: str) -> None:
    """Set the title of a panel; that of the scene's own method is bold, with a heavy frame."""
    if plan.own is None or plan.own.method != method:
        panel.set_title(method, fontsize=9)
        return
    panel.set_title(f"{method} (this scene)", fontsize=9, fontweight="bold")
    for spine in panel.spines.values():
        spine.set_linewidth(2.2)


def _label(grid: Any, plan: MapPlan, count: int) -> None:
    columns = grid.shape[1]
    for place, panel in enumerate(grid.flat[:count]):
        if place + columns >= count:
            panel.set_xlabel(plan.x.label, fontsize=9)
            panel.tick_params(labelbottom=True)
        if place % columns == 0:
            panel.set_ylabel(plan.y.label, fontsize=9)


def _draw_panel(panel: Any, plan: MapPlan, codes: NDArray[np.int64]) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap

    colours = ListedColormap([COLOUR[verdict] for verdict in Verdict])
    norm = BoundaryNorm(np.arange(len(Verdict) + 1) - 0.5, len(Verdict))
    x, y = _bounds(plan.x), _bounds(plan.y)
    panel.pcolormesh(x, y, codes, cmap=colours, norm=norm, edgecolors="white", linewidth=0.3)
    panel.set_xscale("log" if plan.x.log else "linear")
    panel.set_yscale("log" if plan.y.log else "linear")
    panel.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    _draw_symbols(panel, plan, codes)
    for axis, ticks in ((plan.x, panel.xaxis), (plan.y, panel.yaxis)):
        if axis.log:
            _decade_ticks(axis, ticks)
    panel.tick_params(labelsize=8)


def _draw_symbols(panel: Any, plan: MapPlan, codes: NDArray[np.int64]) -> None:
    size = min(5.0, 120.0 / max(codes.shape))
    for verdict in Verdict:
        rows, columns = np.nonzero(codes == verdict)
        if SYMBOL[verdict] and rows.size:
            x = np.asarray(plan.x.values)[columns]
            y = np.asarray(plan.y.values)[rows]
            panel.plot(x, y, **_symbol_style(verdict, size))


def _symbol_style(verdict: Verdict, size: float) -> dict[str, Any]:
    ink = "white" if verdict in _DARK else _INK
    style = {"ls": "none", "marker": SYMBOL[verdict], "ms": size, "mew": 0.8, "color": ink}
    return {**style, "mfc": "none"} if SYMBOL[verdict] in "o^" else style


def _draw_own(panel: Any, plan: MapPlan) -> None:
    """Draw a diamond at the scene's cell, or a line at its only value, with a label."""
    own = plan.own
    if own is None:
        return
    if own.x is not None and own.y is not None:
        style = {"marker": "D", "ms": 8, "mfc": "white", "mec": "black", "mew": 1.8, "zorder": 5}
        panel.plot([own.x], [own.y], ls="none", **style)
        _tag(panel, own.x, own.y, plan)
    elif own.y is not None:
        panel.axhline(own.y, **_OWN_LINE)
        _tag(panel, plan.x.values[0], own.y, plan)
    elif own.x is not None:
        panel.axvline(own.x, **_OWN_LINE)
        _tag(panel, own.x, plan.y.values[0], plan)


_OWN_LINE: dict[str, Any] = {"color": "black", "lw": 1.6, "ls": "-.", "zorder": 5}


def _tag(panel: Any, x: float, y: float, plan: MapPlan) -> None:
    """Write the label of the scene next to its marker, towards the middle of the map."""
    right = plan.x.values.index(x) < len(plan.x.values) / 2
    below = plan.y.values.index(y) >= len(plan.y.values) / 2
    panel.annotate(
        "this scene",
        (x, y),
        xytext=(7 if right else -7, -7 if below else 7),
        textcoords="offset points",
        ha="left" if right else "right",
        va="top" if below else "bottom",
        fontsize=8,
        fontweight="bold",
        zorder=6,
        bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "black", "lw": 0.6},
    )


def _decade_ticks(axis: MapAxis, ticks: Any) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ticks.set_major_formatter(FuncFormatter(lambda value, _: _decade(value)))
    ticks.set_minor_formatter(NullFormatter())  # several decades need no further labels
    if axis.values[-1] < _DECADES * axis.values[0]:
        ticks.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ticks.set_major_formatter("{x:g}")


def _decade(value: float) -> str:
    """A power of ten without superscript, which would be too small to read.

    Examples
    --------
    >>> _decade(1e-5), _decade(0.1), _decade(20000.0)
    ('1e-5', '0.1', '2e4')
    """
    if 1e-3 < value < 1e4:
        return f"{value:g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def _bounds(axis: MapAxis) -> NDArray[np.float64]:
    """Edges of the cells around the values of an axis."""
    values = np.log(axis.values) if axis.log else np.asarray(axis.values)
    middle = 0.5 * (values[1:] + values[:-1])
    edges = np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])
    return np.asarray(np.exp(edges) if axis.log else edges)


def _legend(sheet: Any, found: StabilityMap, lines: Mapping[str, Any]) -> None:
    handles, labels = _meanings(found, lines)
    style = {"loc": "outside lower center", "ncols": 3, "fontsize": 8, "frameon": False}
    sheet.legend(handles, labels, handler_map=_together(), **style)


def _together() -> dict[type, Any]:
    """Legend handler that merges a patch and its symbol into one entry."""
    from matplotlib.legend_handler import HandlerTuple

    return {tuple: HandlerTuple(ndivide=1)}


def _meanings(found: StabilityMap, lines: Mapping[str, Any]) -> tuple[list[Any], list[str]]:
    """Entries of the legend: occurring verdicts, then lines of theory."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    seen = sorted({int(code) for codes in found.verdicts.values() for code in np.unique(codes)})
    handles: list[Any] = []
    for verdict in map(Verdict, seen):
        patch = Patch(facecolor=COLOUR[verdict], edgecolor="grey")
        symbol = Line2D([], [], **_symbol_style(verdict, 5.0)) if SYMBOL[verdict] else None
        handles.append((patch, symbol) if symbol else patch)
    return [*handles, *lines.values()], [*(Verdict(code).text for code in seen), *lines]
