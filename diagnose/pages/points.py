"""Points on axes that show their values under the pointer, and their settings when tapped.

A page of a chart, a sweep or a trend passes its points to this module and gets the HTML that shows
them; for printing, the page uses its own picture.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ...sim.output.recording import DataError
from .embed import (
    MOST_BYTES,
    SPARE_BYTES,
    bokeh_script,
    item_text,
    plain_figure,
    require_bokeh,
)
from .page import visible

_HEIGHT = 430  # [px]
_DATE_SPAN = 14 * 86_400_000  # [ms]
_PICKED = "#b02a1c"
_PLAIN_TICKS = "return String(parseFloat(tick.toPrecision(4)))"
_HOVER = '<div style="white-space: pre-line; max-width: 19rem">@hover</div>'

_PICK = """
const at = cb_obj.indices[0]  // the nearest of those that were hit
if (at === undefined) return
for (const other of others) if (other.selected !== cb_obj) other.selected.indices = []
const text = document.getElementById("point-text")
text.value = source.data.block[at]
text.rows = Math.min(text.value.split("\\n").length + 1, 16)
document.getElementById("point").hidden = false
"""


@dataclass(frozen=True, kw_only=True)
class Mark:
    """One point.

    Parameters
    ----------
    x, y : float
        Coordinates; on a time axis milliseconds since 1970.
    low, high : float
        Ends of the error bar; NaN without one.
    hover : str
        Lines shown under the pointer.
    block : str
        Text shown after a tap, to be copied.
    """

    x: float
    y: float
    low: float = math.nan
    high: float = math.nan
    hover: str
    block: str


@dataclass(frozen=True, kw_only=True)
class Series:
    """Points of the same appearance.

    Parameters
    ----------
    name : str
        Name in the legend; empty for none.
    marks : tuple of Mark
    colour : str
    marker : str
        Bokeh marker.
    size : float
        Size [px].
    filled : bool
    """

    name: str
    marks: tuple[Mark, ...]
    colour: str
    marker: str = "circle"
    size: float = 8.0
    filled: bool = True


@dataclass(frozen=True, kw_only=True)
class DrawnLine:
    """A line without points.

    Parameters
    ----------
    name : str
        Name in the legend.
    x, y : tuple of float
    colour : str
    steps : bool
        Whether the line is level from each point to the next.
    dash : str
        Bokeh dash pattern.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    colour: str
    steps: bool = False
    dash: str = "solid"


@dataclass(frozen=True, kw_only=True)
class PointAxes:
    """One pair of axes.

    Parameters
    ----------
    title, x_name, y_name : str
        Title and axis names, with units.
    series : tuple of Series
    lines : tuple of DrawnLine
    level : tuple of (str, float)
        Name and height of a limit; empty without one.
    band : tuple of (x, low, high)
        Band around a line; empty without one.
    band_name : str
        Name of the band in the legend.
    moments : tuple of float
        Positions of vertical lines, as x.
    moments_name : str
        Name of these lines in the legend.
    x_kind, y_kind : str
        ``linear`` or ``log``; for x also ``datetime``.
    """

    title: str
    x_name: str
    y_name: str
    series: tuple[Series, ...]
    lines: tuple[DrawnLine, ...] = ()
    level: tuple[str, float] | tuple[()] = ()
    band: tuple[tuple[float, ...], ...] = ()
    band_name: str = ""
    moments: tuple[float, ...] = ()
    moments_name: str = ""
    x_kind: Literal["linear", "log", "datetime"] = "linear"
    y_kind: Literal["linear", "log"] = "linear"


@dataclass(frozen=True, kw_only=True)
class PointBlock:
    """Part of a page with points.

    Parameters
    ----------
    script : str
        Script of the library as HTML.
    item : str
        PointAxes and tools as JSON that can be placed in HTML.
    left_out : tuple of str
        Titles of axes left out for lack of room.
    """

    script: str
    item: str
    left_out: tuple[str, ...] = ()


def point_block(panels: Sequence[PointAxes], *, taken: int = 0) -> PointBlock:
    """Points as a part of a page; the last axes are left out if the page would become too large.

    Parameters
    ----------
    panels : sequence of PointAxes
        Axes, the most important first.
    taken : int
        Size of the rest of the page [byte].

    Returns
    -------
    PointBlock

    Raises
    ------
    DataError
        If Bokeh is not installed, or the first axes alone have too many points for a page.
    """
    require_bokeh()
    script = bokeh_script()
    room = MOST_BYTES - SPARE_BYTES - taken - len(script.encode())
    for count in range(len(panels), 0, -1):
        item = item_text(_column(panels[:count]))
        if len(item.encode()) <= room:
            left_out = tuple(visible(each.title) for each in panels[count:])
            return PointBlock(script=script, item=item, left_out=left_out)
    n = sum(len(each.marks) for each in panels[0].series) if panels else 0
    raise DataError(
        f"{n} points in one picture make the page larger than {MOST_BYTES / 1e6:.3g} MB; ask for "
        "fewer, or leave --interactive out"
    )


def _column(panels: Sequence[PointAxes]) -> Any:
    """Axes one below the other, with one selected point among all."""
    from bokeh.layouts import column
    from bokeh.models import CustomJS

    figures, sources = [], []
    for panel in panels:
        plot = _axes(panel)
        _draw_lines(plot, panel)
        sources += list(_draw_series(plot, panel.series))
        _label_limits(plot, panel)
        figures.append(plot)
    for source in sources:
        pick = CustomJS(args={"source": source, "others": sources}, code=_PICK)
        source.selected.js_on_change("indices", pick)
    return column(*figures, sizing_mode="stretch_width")


def _axes(panel: PointAxes) -> Any:
    from bokeh.models import BoxZoomTool, HoverTool, TapTool, WheelZoomTool

    plot = plain_figure(
        visible(panel.title),
        visible(panel.x_name),
        visible(panel.y_name),
        x_axis_type=panel.x_kind,
        y_axis_type=panel.y_kind,
        height=_HEIGHT,
        tools=(BoxZoomTool(), WheelZoomTool(modifiers="ctrl"), TapTool()),
    )
    plot.add_tools(HoverTool(mode="mouse", tooltips=_HOVER, renderers=[]))
    if panel.x_kind == "datetime":
        across: Any = plot.x_range
        across.default_span = _DATE_SPAN  # around a single date; Bokeh's own is 2 ms
    return plot


def _draw_lines(plot: Any, panel: PointAxes) -> None:
    if panel.band:
        x, low, high = panel.band
        ways = {"fill_color": "#1f5a94", "fill_alpha": 0.2, "legend_label": panel.band_name}
        plot.varea(x=list(x), y1=list(low), y2=list(high), **ways)
    for line in panel.lines:
        ways = {"line_color": line.colour, "line_width": 1.4, "line_dash": line.dash}
        draw = plot.step if line.steps else plot.line
        if line.steps:
            ways["mode"] = "after"
        draw(list(line.x), list(line.y), legend_label=visible(line.name), **ways)
    if panel.level:
        name, height = panel.level
        plot.hspan(y=[height], line_color="#b3261e", line_dash="dashed", legend_label=visible(name))
    if panel.moments:
        ways = {"line_color": "#666666", "line_dash": "dashed"}
        plot.vspan(x=list(panel.moments), legend_label=visible(panel.moments_name), **ways)


def _draw_series(plot: Any, series: Sequence[Series]) -> Iterator[Any]:
    """Draw points with error bars; yield the data source of each series."""
    from bokeh.models import ColumnDataSource, HoverTool

    hover = plot.select_one(HoverTool)
    for each in series:
        columns = ("x", "y", "low", "high")
        data: dict[str, Any] = {n: [getattr(m, n) for m in each.marks] for n in columns}
        data |= {n: [visible(getattr(m, n)) for m in each.marks] for n in ("hover", "block")}
        source = ColumnDataSource(data)
        plot.segment("x", "low", "x", "high", source=source, line_color=each.colour)
        named = {"legend_label": visible(each.name)} if each.name else {}
        drawn = plot.scatter(
            "x",
            "y",
            source=source,
            marker=each.marker,
            size=each.size,
            line_color=each.colour,
            fill_color=each.colour if each.filled else None,
            hit_dilation=2.0,  # as wide as a finger
            nonselection_alpha=1.0,
            selection_line_color=_PICKED,
            selection_line_width=4,
            **named,
        )
        hover.renderers = [*hover.renderers, drawn]
        yield source


def _label_limits(plot: Any, panel: PointAxes) -> None:
    """Plain numbers on logarithmic axes; the legend below, where it covers no point."""
    from bokeh.models import CustomJSTickFormatter

    for axis, kind in ((plot.xaxis, panel.x_kind), (plot.yaxis, panel.y_kind)):
        if kind == "log":
            axis.formatter = CustomJSTickFormatter(code=_PLAIN_TICKS)
    if plot.legend:
        plot.legend.orientation = "horizontal"
        plot.legend.ncols = 2
        plot.legend.location = "top_left"
        plot.legend.margin, plot.legend.padding, plot.legend.border_line_color = 0, 2, None
        plot.legend.glyph_width = 14  # two columns fit a phone
        plot.legend.label_text_font_size = "11px"
        plot.add_layout(plot.legend[0], "below")
