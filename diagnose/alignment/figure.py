"""The alignment of a shaft line as pictures: deflection, moment, reactions, jacking."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...sim.alignment.alignment import LineState
from ...sim.alignment.jacking import Jacking
from ..pages.page import short_name
from ..pages.picture import PageImage, drawn_alone, save_picture
from .align import Alignment

_BEFORE, _AFTER, _LIMIT = "#1f5a94", "#b3541e", "#7a828b"


def align_figure(found: Alignment) -> Any:
    """Deflection with the bearings, bending moment and reactions, as set and after the moves.

    Returns
    -------
    matplotlib.figure.Figure
        Pictures of the first condition; reactions of all conditions.
    """
    from matplotlib.figure import Figure

    rows = 4 if found.jacking is not None else 3
    figure = Figure(figsize=(10, 3 * rows), layout="constrained")
    names = ", ".join(state.condition.name for state in found.states)
    figure.suptitle(f"{short_name(found.name, 60)}: alignment (computed), {names}")
    axes = figure.subplots(rows, 1)
    _draw_deflection(axes[0], found)
    _draw_moment(axes[1], found)
    _draw_reactions(axes[2], found)
    if found.jacking is not None:
        _draw_jacking(axes[3], found.jacking)
    return figure


def align_images(found: Alignment) -> list[PageImage]:
    """The panels of :func:`align_figure` as pictures of a page."""
    draws = [_draw_deflection, _draw_moment, _draw_reactions]
    images = [drawn_alone(partial(draw, found=found), height=3.4) for draw in draws]
    if found.jacking is not None:
        images.append(drawn_alone(partial(_draw_jacking, found=found.jacking), height=3.4))
    return images


def save_figure(found: Alignment, path: Path, *, force: bool = True) -> None:
    """Draw :func:`align_figure` into a .png, .svg or .pdf file."""
    save_picture(align_figure(found), path, force=force)


def _drawn(found: Alignment) -> list[tuple[LineState, str, str]]:
    """States of the first condition with label and colour: as set, and after the moves."""
    name = found.states[0].condition.name
    drawn = [(found.states[0], f"{name}, as set", _BEFORE)]
    if found.calibration is not None and found.calibration.moved:
        drawn.append((found.calibration.after[0], f"{name}, after the moves", _AFTER))
    return drawn


def _draw_deflection(axes: Any, found: Alignment) -> None:
    for state, label, colour in _drawn(found):
        axes.plot(state.line.beam.stations, 1e3 * state.deflections, color=colour, label=label)
        for seat, rise in zip(state.line.seats, _rises(state), strict=True):
            half = max(seat.length / 2, 0.01 * state.line.beam.length)
            height = np.array([seat.offset + rise - seat.slope * half])
            ends = 1e3 * np.concatenate([height, height + 2 * half * seat.slope])
            middle = np.array([seat.station - half, seat.station + half])
            axes.plot(middle, ends, color=colour, lw=4, alpha=0.5, solid_capstyle="butt")
    for seat in found.line.seats:
        name, place = short_name(seat.name, 20), (seat.station, 1.02)
        axes.annotate(name, place, color=_NAMES, **_above(axes))
    # leave room for names below the title
    pad = 62.0 if _is_narrow(axes) else 18.0
    _finish(axes, "height [mm]", "Shaft and bottoms of the bores", pad=pad)


def _is_narrow(axes: Any) -> bool:
    """Whether names of bearings side by side would overlap."""
    return bool(axes.get_figure().get_figwidth() < _ROOM_FOR_NAMES)


_ROOM_FOR_NAMES = 8.0  # [inch]
_NAMES = "#49535e"


def _above(axes: Any) -> dict[str, Any]:
    """Style of names above the axes, slanted if there is no room."""
    place = {"xycoords": ("data", "axes fraction"), "fontsize": 8}
    return place | ({"rotation": 35, "ha": "left"} if _is_narrow(axes) else {"ha": "center"})


def _rises(state: LineState) -> Sequence[float]:
    return state.condition.rises or [0.0] * len(state.line.seats)


def _draw_moment(axes: Any, found: Alignment) -> None:
    for state, label, colour in _drawn(found):
        axes.plot(state.cut_stations, state.moments / 1e3, color=colour, label=label)
    axes.axhline(0, color="black", lw=0.6)
    _finish(axes, "moment [kN m]", "Bending moment, positive where the shaft sags")


def _draw_reactions(axes: Any, found: Alignment) -> None:
    """Draw bars for every condition, as set and after the moves, with dashes at the limits."""
    n, mended = len(found.line.seats), found.calibration
    pairs = [(state, _BEFORE) for state in found.states]
    if mended is not None and mended.moved:
        pairs = [p for old, new in zip(mended.before, mended.after, strict=True)
                 for p in ((old, _BEFORE), (new, _AFTER))]  # fmt: skip
    width = 0.8 / len(pairs)
    for k, (state, colour) in enumerate(pairs):
        at = np.arange(n) - 0.4 + (k + 0.5) * width
        axes.bar(at, state.reactions / 1e3, 0.9 * width, color=colour)
        for x, load in zip(at, state.reactions / 1e3, strict=True):
            axes.annotate(f" {state.condition.name}", (x, load), **_ABOVE)
    for i, seat in enumerate(found.line.seats):
        for bound in (seat.least_load, seat.highest_load):
            if 0 < bound < math.inf:
                axes.hlines(bound / 1e3, i - 0.45, i + 0.45, color=_LIMIT, ls="--", lw=1)
    highest = max(float(state.reactions.max()) for state, _ in pairs)
    axes.set_ylim(0, 1.35 * highest / 1e3)  # limits far above are not shown
    axes.legend(handles=_meanings(pairs), fontsize=8, loc="upper right", ncols=3)
    slant = {"rotation": 25, "ha": "right"} if _is_narrow(axes) else {}
    names = [short_name(name, 20) for name in found.line.names]
    axes.set_xticks(range(n), names, fontsize=9, **slant)
    axes.set(ylabel="reaction [kN]", title="Reactions")
    axes.grid(axis="y", alpha=0.3)


def _meanings(pairs: Sequence[tuple[LineState, str]]) -> list[Any]:
    """Legend of the bars and dashes."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    names = {_BEFORE: "as set", _AFTER: "after the moves"}
    colours = dict.fromkeys(colour for _, colour in pairs)
    bars = [Patch(color=colour, label=names[colour]) for colour in colours]
    return [*bars, Line2D([], [], color=_LIMIT, ls="--", lw=1, label="limit")]


_ABOVE = {"rotation": 90, "fontsize": 8, "ha": "center", "va": "bottom"}


def _draw_jacking(axes: Any, found: Jacking) -> None:
    lift = 1e3 * found.lifts
    axes.plot(lift, found.loads / 1e3, color=_BEFORE, label=f"jack at {found.station:.3g} m")
    second = found.zero_load + found.second_slope * found.lifts
    axes.plot(lift, second / 1e3, "--", color=_LIMIT, label="second line, extrapolated")
    axes.plot(1e3 * found.free_lift, found.free_load / 1e3, "o", color=_AFTER, label="comes free")
    axes.set(
        xlabel="lift [mm]", ylabel="load [kN]", title=f"Jacking of {short_name(found.bearing)}"
    )
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


def _finish(axes: Any, label: str, title: str, *, pad: float = 6.0) -> None:
    axes.set(xlabel="station from aft [m]", ylabel=label)
    axes.set_title(title, pad=pad)
    axes.grid(alpha=0.3)
    axes.margins(x=0.02)
    axes.legend(fontsize=8)
