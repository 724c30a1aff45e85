"""Panel of the shaft's orbit between proximity probes, and its full spectrum."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...features.catalogue.analysis import DISPLACEMENT
from ...features.rotation import orbit
from ..pages.page import short_name
from .panel import COLOURS, MOST_POINTS, WIDTH, LackError, Panel
from .view import Float, Trace, Turning, View

_SHOWN_REVOLUTIONS = 10
_MOST_ORDERS = 4.0  # of the full spectrum, on either side
_SECOND_LINE = 0.15  # inch: in a narrow picture the names of the probes have a separate line


@dataclass(frozen=True, kw_only=True, eq=False)
class _Orbit:
    """Path of a shaft between two probes, and its two-sided spectrum."""

    title: str
    unit: str
    path: orbit.Complex
    first_order: orbit.Complex
    marks: orbit.Complex
    place: Float
    radius: Float
    axis: str
    most: float | None


def orbit_panel(view: View) -> Panel:
    """Path between each pair of probes, and its full spectrum."""
    orbits = [_orbit_of(view, first, second) for first, second in probe_pairs(view)]
    caption = "Shaft orbit"
    if isinstance(view.turning, Turning):
        caption += ", with dots at the tacho pulses and its first order,"
    return Panel(
        kind="orbit",
        caption=caption + " and full spectrum",
        height=3.6 * len(orbits),
        draw=partial(_draw_orbits, orbits=orbits),
        below=_SECOND_LINE,
    )


def probe_pairs(view: View) -> list[tuple[Trace, Trace]]:
    """Two probes of the recording, or two at each place if there are more."""
    probes = [trace for trace in view.traces if trace.quantity == DISPLACEMENT]
    if len(probes) == 2:
        return [(probes[0], probes[1])]
    places = list(dict.fromkeys(trace.place for trace in probes if trace.place))
    groups = [[trace for trace in probes if trace.place == place] for place in places]
    pairs = [(group[0], group[1]) for group in groups if len(group) == 2]
    if not pairs:
        cure = (
            "name the two to draw"
            if len(probes) > 2
            else ("record two proximity probes at right angles")
        )
        raise LackError(f"needs 2 displacement channels, has {len(probes)}; {cure}")
    return pairs


def shown_samples(view: View) -> int:
    """Number of samples of an orbit that are drawn: a few distinguishable revolutions."""
    n = view.n_samples if view.speed is None else round(_SHOWN_REVOLUTIONS / view.speed * view.rate)
    return min(view.n_samples, max(n, 2), MOST_POINTS)


def _orbit_of(view: View, first: Trace, second: Trace) -> _Orbit:
    z = orbit.displacement(first.values, second.values)
    frequency, vector = orbit.full_spectrum(z, view.rate)
    speed = view.speed
    n = shown_samples(view)
    first_order = marks = np.empty(0, dtype=np.complex128)
    if isinstance(view.turning, Turning):
        turning = view.turning
        marks = orbit.keyphasor_marks(z, view.rate, turning.pulses[turning.pulses < n / view.rate])
        ahead, behind = orbit.filtered_orbits(z, turning.phase, [1.0])
        around = np.linspace(0, 2 * np.pi, 181)
        first_order = orbit.centreline(z) + orbit.orbit_path(ahead[0], behind[0], around)
    return _Orbit(
        title=f"{short_name(first.name, 24)}, {short_name(second.name, 24)}",
        unit=first.unit,
        path=z[:n],
        first_order=first_order,
        marks=marks,
        place=frequency if speed is None else frequency / speed,
        radius=np.abs(vector),
        axis="Hz" if speed is None else "orders",
        most=None if speed is None else _MOST_ORDERS,
    )


def _draw_orbits(place: Any, *, orbits: Sequence[_Orbit]) -> None:
    panels = place.subplots(len(orbits), 2, width_ratios=(1, 1.4), squeeze=False)
    narrow = place.bbox.width / place.dpi < WIDTH
    place.subplots_adjust(wspace=0.6 if narrow else 0.3, hspace=0.5 if narrow else 0.3)
    for (path, lines), item in zip(panels, orbits, strict=True):
        path.plot(item.path.real, item.path.imag, lw=0.6, color=COLOURS[0], label="path")
        if item.first_order.size:
            path.plot(
                item.first_order.real, item.first_order.imag, lw=1.2, color=COLOURS[1], label="1×"
            )
            path.plot(item.marks.real, item.marks.imag, ".", ms=4, color="black", label="tacho")
            path.legend(loc="upper right", fontsize=8)
        path.set_aspect("equal", adjustable="datalim")
        between = f"x [{item.unit}], between" + ("\n" if narrow else " ") + item.title
        path.set_xlabel(between, fontsize=8 if narrow else 10)
        path.set_ylabel(f"y [{item.unit}]")
        shown = slice(None) if item.most is None else np.abs(item.place) <= item.most
        lines.plot(item.place[shown], item.radius[shown], lw=0.8, color=COLOURS[0])
        lines.set_xlabel(f"backward   [{item.axis}]   forward", fontsize=8 if narrow else 10)
        lines.set_ylabel(f"radius [{item.unit}]")
        lines.margins(x=0)
        lines.set_ylim(0, None)
        for axes in (path, lines):
            axes.grid(alpha=0.3)
