"""Curves with zoom and cursors in a page that works offline.

They are drawn by Bokeh, an optional library whose script is embedded from the installed package.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..pages.embed import (
    MOST_BYTES,
    SPARE_BYTES,
    bokeh_script,
    item_text,
    plain_figure,
    require_bokeh,
)
from ..pages.page import render, visible
from ..pages.picture import PageImage
from .panel import COLOURS
from .zoom_curves import ZoomCurve

STILL_COLOURS = 128
"""Colours of the picture that replaces the curves in print."""

_FEWEST_POINTS = 200  # of a curve
_POINT_BYTES = 2 * 4 * 4 / 3  # x and y as single floats in base64
_CURVE_BYTES = 9_000  # axes and tools
_HARMONICS, _SIDEBANDS = 10, 3
_MARGIN = 0.05  # of the range of values, above and below
_HEIGHT, _ORBIT_HEIGHT = 240, 420  # [px]

_CLEAR = """
cursor.data = {hz: [], order: [], width: [], colour: []}
cursor.tags = [0, 0]
document.getElementById("readout").replaceChildren()
"""

_CURSOR = """
const plot = cb_obj.origin, range = plot.x_range, [hz, reach, title, unit] = plot.tags
const { x, y } = plot.renderers.find(each => each.name == "curve").data_source.data
const highest = (middle, reach) => {
  let best = -1
  for (let i = 0; i < x.length; i++)
    if (Math.abs(x[i] - middle) <= reach && (best < 0 || y[i] > y[best])) best = i
  return best
}
const near = highest(cb_obj.x, Math.max(reach, 0.005 * (range.end - range.start)))
if (near < 0 || x[near] <= 0) return
let [base, spacing] = cursor.tags
const shift = cb_obj.modifiers && cb_obj.modifiers.shift
if (shift && base > 0) spacing = Math.abs(x[near] * hz - base)
else { base = x[near] * hz; spacing = 0 }
const rows = []
for (let k = 1; k <= harmonics; k++) rows.push([k + "\u00d7", k * base, k == 1 ? 2 : 1, "#b02a1c"])
if (spacing > 0)
  for (let k = -sidebands; k <= sidebands; k++)
    if (k && base + k * spacing > 0)
      rows.push([(k > 0 ? "+" : "\u2212") + Math.abs(k), base + k * spacing, 1, "#4f7d3a"])
cursor.tags = [base, spacing]
cursor.data = {
  hz: rows.map(row => row[1]), order: rows.map(row => row[1] / (speed || 1)),
  width: rows.map(row => row[2]), colour: rows.map(row => row[3]),
}
const cells = (row, tag) => {
  const line = document.createElement("tr")
  for (const text of row) line.appendChild(document.createElement(tag)).textContent = text
  return line
}
const step = x.length > 1 ? (x[x.length - 1] - x[0]) / (x.length - 1) : 0
const table = document.createElement("table")
table.createCaption().textContent =
  title + (spacing > 0 ? ", sidebands at " + spacing.toPrecision(5) + " Hz"
    + (speed ? " (" + (spacing / speed).toPrecision(4) + " orders)" : "") : "")
table.append(cells(["", "Hz", ...(speed ? ["order"] : []), "level [" + (unit || "-") + "]"], "th"))
for (const [name, f] of rows) {
  const at = highest(f / hz, Math.max(reach, step))
  const level = at < 0 ? "\u2013" : y[at].toPrecision(4)
  const order = speed ? [(f / speed).toPrecision(5)] : []
  table.append(cells([name, f.toPrecision(6), ...order, level], "td"))
}
document.getElementById("readout").replaceChildren(table)
"""


@dataclass(frozen=True, kw_only=True)
class ZoomBlock:
    """Part of a page with curves.

    Parameters
    ----------
    script : str
        Script of the library as HTML.
    item : str
        Curves and tools as JSON that can be placed in HTML.
    shares : tuple of tuple
        For every thinned curve: title, points drawn, points computed.
    """

    script: str
    item: str
    shares: tuple[tuple[str, int, int], ...]


def zoom_block(curves: Sequence[ZoomCurve], *, speed: float | None, taken: int = 0) -> ZoomBlock:
    """Curves as a part of a page.

    Parameters
    ----------
    curves : sequence of ZoomCurve
    speed : float, optional
        Speed of the shaft, for orders [Hz].
    taken : int
        Size of the rest of the page, which reduces the room for points [byte].

    Returns
    -------
    ZoomBlock

    Raises
    ------
    DataError
        If Bokeh is not installed.
    """
    require_bokeh()
    script = bokeh_script()
    room = MOST_BYTES - SPARE_BYTES - taken - len(script.encode()) - _CURVE_BYTES * len(curves)
    most = max(_share([len(each.x) for each in curves], int(room / _POINT_BYTES)), _FEWEST_POINTS)
    drawn = [each.thinned(most) for each in curves]
    return ZoomBlock(
        script=script,
        item=item_text(_column(drawn, speed)),
        shares=tuple(
            (thin.title, len(thin.x), len(curve.x))
            for thin, curve in zip(drawn, curves, strict=True)
            if len(thin.x) < len(curve.x)
        ),
    )


def _share(sizes: Sequence[int], total: int) -> int:
    """Points of a long curve if all share a total; what short ones leave goes to long ones.

    Examples
    --------
    >>> _share([100, 500, 900], 1000), _share([100, 50], 1000)
    (450, 100)
    """
    for done, size in enumerate(sorted(sizes)):
        most = total // (len(sizes) - done)
        if size > most:
            return most
        total -= size
    return max(sizes)


def zoom_page(
    curves: Sequence[ZoomCurve],
    stills: Sequence[tuple[str, PageImage]],
    *,
    heading: str,
    speed: float | None,
    missing: Any = (),
) -> str:
    """A page of curves, with pictures for printing and for readers without scripts.

    Parameters
    ----------
    curves : sequence of ZoomCurve
    stills : sequence of (str, PageImage)
        Captions and pictures.
    heading : str
        Title of the recording.
    speed : float, optional
        Speed of the shaft [Hz].
    missing : mapping
        What the recording lacks, by kind.

    Returns
    -------
    str
        HTML page.
    """
    block = zoom_block(curves, speed=speed, taken=sum(len(image.address) for _, image in stills))
    return render(
        "zoom.html.j2", heading=heading, stills=stills, block=block, missing=dict(missing)
    )


def _column(curves: Sequence[ZoomCurve], speed: float | None) -> Any:
    """Figures one below the other; those of a kind share axis and crosshair, all the cursor."""
    from bokeh.events import DoubleTap, Tap
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, CustomJS, Range1d
    from bokeh.models.annotations.geometry import Span

    cursor = ColumnDataSource({"hz": [], "order": [], "width": [], "colour": []}, tags=[0, 0])
    arguments = {"cursor": cursor, "speed": speed, "harmonics": _HARMONICS, "sidebands": _SIDEBANDS}
    place, clear = CustomJS(args=arguments, code=_CURSOR), CustomJS(args=arguments, code=_CLEAR)
    shared: dict[str, tuple[Any, Any]] = {}
    figures = []
    for number, curve in enumerate(curves):
        key = f"{curve.kind} {number}" if curve.kind == "orbit" else curve.kind
        if key not in shared:
            low, high = _extent(curve.x, _MARGIN if curve.kind == "orbit" else 0.0)
            across = Span(dimension="height", line_dash="dotted", line_color="#49535e")
            shared[key] = Range1d(start=low, end=high), across
        figures.append(_figure(curve, *shared[key], COLOURS[number % len(COLOURS)]))
        _add_hover(figures[-1], curve, speed)
        if curve.hz is not None:
            _draw_cursor(figures[-1], curve, cursor)
            figures[-1].js_on_event(Tap, place)
            figures[-1].js_on_event(DoubleTap, clear)
    return column(*figures, sizing_mode="stretch_width")


def _extent(values: Any, margin: float) -> tuple[float, float]:
    """Smallest and largest finite value with a margin; an extent of 1 if they are equal."""
    finite = np.asarray(values)[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    room = margin * (high - low) if high > low else 0.5
    return low - room, high + room


def _figure(curve: ZoomCurve, x_range: Any, across: Any, colour: str) -> Any:
    """One curve on axes with tools to zoom and read it."""
    from bokeh.models import (
        BoxZoomTool,
        ColumnDataSource,
        CrosshairTool,
        Range1d,
        WheelZoomTool,
    )
    from bokeh.models.annotations.geometry import Span

    around = curve.kind == "orbit"
    low, high = _extent(curve.y, _MARGIN)
    along = Span(dimension="width", line_dash="dotted", line_color="#49535e")
    wheel = WheelZoomTool(dimensions="both" if around else "width", modifiers="ctrl")
    zoom = BoxZoomTool(dimensions="both" if around else "auto", match_aspect=around)
    plot = plain_figure(
        curve.title,
        curve.x_name,
        curve.y_name,
        x_range=x_range,
        y_range=Range1d(start=low if curve.hz is None else 0.0, end=high),
        height=_ORBIT_HEIGHT if around else _HEIGHT,
        match_aspect=around,
        tools=(zoom, wheel, CrosshairTool(overlay=(across, along))),
        tags=[curve.hz, curve.reach, visible(curve.title), curve.unit],
    )
    points = ColumnDataSource(
        {"x": np.asarray(curve.x, dtype=np.float32), "y": np.asarray(curve.y, dtype=np.float32)}
    )
    plot.line("x", "y", source=points, line_width=1, line_color=colour, name="curve")
    return plot


def _draw_cursor(plot: Any, curve: ZoomCurve, cursor: Any) -> None:
    """Lines at the harmonics and sidebands selected by a tap."""
    plot.vspan(
        x="order" if curve.kind == "orders" else "hz",
        source=cursor,
        line_width="width",
        line_color="colour",
        line_alpha=0.7,
        level="overlay",
    )


def _add_hover(plot: Any, curve: ZoomCurve, speed: float | None) -> None:
    """Values of the point under the pointer: for a spectrum frequency, order and level."""
    from bokeh.models import CustomJSHover, HoverTool

    def times(factor: float) -> Any:
        return CustomJSHover(args={"by": factor}, code="return (value * by).toPrecision(6)")

    formats: dict[str, Any] = {"@x": "printf", "@y": "printf"}
    level = ("level", "@y{%.4g}")
    if curve.kind == "orbit":
        rows = [("x", "@x{%.4g}"), ("y", "@y{%.4g}")]
    elif curve.hz is None:
        rows = [("s", "@x{%.6g}"), level]
    elif curve.kind == "orders":
        formats["$snap_x"] = times(curve.hz)
        rows = [("Hz", "$snap_x{custom}"), ("order", "@x{%.5g}"), level]
    elif speed is None:
        rows = [("Hz", "@x{%.6g}"), level]
    else:
        formats["$snap_x"] = times(1 / speed)
        rows = [("Hz", "@x{%.6g}"), ("order", "$snap_x{custom}"), level]
    plot.add_tools(
        HoverTool(
            renderers=[plot.select_one({"name": "curve"})],
            mode="mouse" if curve.kind == "orbit" else "vline",
            tooltips=rows,
            formatters=formats,
        )
    )
