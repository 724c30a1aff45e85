"""A panel of a picture: computed first, then drawn; shared helpers, and the sheet of panels.

Figures use matplotlib without pyplot, in fixed margins.
"""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..pages.page import short_name
from ..pages.picture import PAGE_WIDTH
from .view import Trace, Turning, View

COLOURS = ("#1f5a94", "#b3541e", "#4f7d3a", "#7a4a8c", "#8a7a14", "#2a8a8a", "#a0405f", "#5b6470")
"""Colours of successive channels."""

WIDTH = 8.0
"""Width of a panel on a sheet [inch]."""

RIGHT_OF_MAP = 0.7
"""Margin for the unit next to a colour bar [inch]."""

MOST_ROWS = 4
"""Most channels drawn by kinds that give each its own row, except for the waveform."""

MOST_POINTS = 4000
"""Most points of a curve; more cannot be distinguished."""

CURSOR_ORDERS = 20
"""Number of orders marked in a spectrum."""

_NAMED_CURSORS = (1, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20)  # those with room for a number
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.85, 0.25, 0.5, 0.12  # inch, around a panel
_LINE_HEIGHT = 0.17  # inch, of a line of a caption
_LETTERS = 118  # of a caption, per line
_HEAD = 0.45  # inch, of the sheet's heading
_HEADING_LETTERS = 80  # of the heading, in the width of a panel


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """One picture of a recording, computed and ready to be drawn.

    Parameters
    ----------
    kind : str
        Key of the table of kinds.
    caption : str
        Description of what it shows and how it was computed.
    height : float
        Height needed, without caption [inch].
    draw : callable
        ``draw(place)`` draws it into an empty figure or subfigure.
    right : float
        Margin [inch].
    above : float
        Room for titles above the axes [inch].
    below : float
        Room for a second label line below them [inch].
    """

    kind: str
    caption: str
    height: float
    draw: Callable[[Any], None]
    right: float = _RIGHT
    above: float = 0.0
    below: float = 0.0


class LackError(ValueError):
    """Something that a recording lacks for a kind."""


def panel_figure(panel: Panel) -> Any:
    """A single panel, as wide as a phone, without caption: a page has its own."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, panel.height))
    panel.draw(figure)
    _set_margins(figure, panel, panel.height, _TOP, width=PAGE_WIDTH)
    return figure


def columns_of(panels: Sequence[Panel]) -> list[list[Panel]]:
    """Panels in two columns of about equal height; a single panel in one."""
    if len(panels) == 1:
        return [list(panels)]
    columns: list[list[Panel]] = [[], []]
    heights = [0.0, 0.0]
    for panel in panels:
        shorter = int(heights[1] < heights[0])
        columns[shorter].append(panel)
        heights[shorter] += _full_height(panel)
    return columns


def _full_height(panel: Panel) -> float:
    return panel.height + _caption_height(panel)


def _caption_height(panel: Panel) -> float:
    return _LINE_HEIGHT * (len(_wrapped(panel)) + 0.5)


def _wrapped(panel: Panel) -> list[str]:
    return textwrap.wrap(panel.caption, _LETTERS)


def sheet(heading: str, columns: Sequence[Sequence[Panel]]) -> Any:
    """Panels with captions below a heading, in fixed margins."""
    from matplotlib.figure import Figure

    height = max(sum(map(_full_height, column)) for column in columns)
    figure = Figure(figsize=(WIDTH * len(columns), _HEAD + height))
    head, body = np.ravel(figure.subfigures(2, 1, height_ratios=[_HEAD, height], squeeze=False))
    room = _HEADING_LETTERS * len(columns)
    head.text(
        0.15 / (WIDTH * len(columns)),
        0.45,
        short_name(heading, room),
        va="center",
        fontsize=12,
        weight="bold",
    )
    halves = np.ravel(body.subfigures(1, len(columns), squeeze=False))
    for half, column in zip(halves, columns, strict=True):
        heights = [_full_height(panel) for panel in column]
        rest = height - sum(heights)
        ratios = [*heights, rest] if rest > 0 else heights
        places = np.ravel(half.subfigures(len(ratios), 1, height_ratios=ratios, squeeze=False))
        for place, panel, tall in zip(places, column, heights, strict=False):
            panel.draw(place)
            caption = _caption_height(panel)
            _set_margins(place, panel, tall, caption)
            place.text(
                0.15 / WIDTH,
                1 - 0.3 * _LINE_HEIGHT / tall,
                "\n".join(_wrapped(panel)),
                va="top",
                fontsize=9,
            )
    return figure


def _set_margins(
    place: Any, panel: Panel, height: float, top: float, *, width: float = WIDTH
) -> None:
    """Fixed margins: fitting them to the labels would take half of the time of a report."""
    place.subplots_adjust(
        left=_LEFT / width,
        right=1 - panel.right / width,
        bottom=(_BOTTOM + panel.below) / height,
        top=1 - (top + panel.above) / height,
    )


def stack(place: Any, n: int, **options: Any) -> NDArray[Any]:
    """Axes below each other, sharing the x axis by default."""
    axes = place.subplots(n, 1, squeeze=False, **{"sharex": True} | options)[:, 0]
    place.subplots_adjust(hspace=0.12)
    for each in axes:
        each.grid(alpha=0.3)
        each.margins(x=0)
    return np.asarray(axes)


def name_inside(axes: Any, trace: Trace) -> None:
    """Name of a channel inside its axes, where a long one has room."""
    axes.text(
        0.008,
        0.96,
        short_name(trace.name, 90),
        transform=axes.transAxes,
        va="top",
        fontsize=8,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
    )


def first_rows(traces: Sequence[Trace]) -> tuple[list[Trace], str]:
    """As many traces as have room, and text about the others."""
    if len(traces) <= MOST_ROWS:
        return list(traces), ""
    return list(traces[:MOST_ROWS]), f"; first {MOST_ROWS} of {len(traces)} channels"


def log_frequency(axes: Any, which: str) -> None:
    """Logarithmic axis in Hz with a few plain ticks: matplotlib's own take a second to draw."""
    ticks = [step * 10.0**power for power in range(-1, 5) for step in (1, 2, 5)]
    labels = [f"{tick / 1000:g}k" if tick >= 1000 else f"{tick:g}" for tick in ticks]
    axes.set(**{f"{which}scale": "log"})
    axes.minorticks_off()
    axes.set(**{f"{which}ticks": ticks, f"{which}ticklabels": labels})


def order_cursors(axes: Any, speed: float | None, low: float, high: float) -> None:
    """Dotted lines at the shaft's orders, some with a number at the top."""
    if speed is None:
        return
    for order in range(1, CURSOR_ORDERS + 1):
        if low <= order * speed <= high:
            axes.axvline(order * speed, ls=":", lw=0.8, color="0.35", zorder=0.5)
            if order in _NAMED_CURSORS and order * speed < 0.97 * high:
                _at_top(axes, order * speed, f"{order}×", "0.25")


def _at_top(axes: Any, x: float, text: str, colour: str) -> None:
    """A text inside the upper edge, at x."""
    axes.annotate(
        text,
        (x, 1),
        xycoords=("data", "axes fraction"),
        xytext=(2, -2),
        textcoords="offset points",
        va="top",
        fontsize=8,
        color=colour,
    )


def refuse_short(view: View, least: int) -> None:
    """LackError for recordings below a number of samples."""
    if view.n_samples < least:
        raise LackError(f"needs >= {least} samples, has {view.n_samples}; record longer")


def turning_of(view: View) -> Turning:
    """Rotation of the shaft; LackError if it is unknown."""
    if isinstance(view.turning, str):
        raise LackError(view.turning)
    return view.turning


def from_zero(axes: Any, curves: Sequence[NDArray[Any]]) -> None:
    """Limits from 0 to above the highest point, with room for the text at the top."""
    highest = max(float(np.max(curve)) for curve in curves)
    axes.set_ylim(0, 1.2 * highest if highest > 0 else 1.0)
