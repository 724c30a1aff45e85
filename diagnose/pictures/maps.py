"""Panels that are maps: density over time, orders over time, energy over the crank angle."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.catalogue.analysis import STANDARD
from ...features.catalogue.needs import crank_map_fault
from ...features.catalogue.row import FEWEST_SAMPLES
from ...features.rotation.angle_resample import AngleSignal, angular_resample, order_map
from ...features.rotation.order import crank_angle_map, default_window
from ...features.signal.spectrum import decibel, default_nperseg, line_frequencies, power_lines
from .panel import (
    RIGHT_OF_MAP,
    LackError,
    Panel,
    first_rows,
    log_frequency,
    name_inside,
    refuse_short,
    stack,
    turning_of,
)
from .view import Float, Trace, Turning, View, number

_COLOURS = "magma"
_DYNAMIC_DB = 60.0  # shown below the highest level
_MOST_COLUMNS = 800
_MOST_FRAMES = 160
_SHOWN_ORDERS = 20.0
_POINTS = 64  # per revolution: orders up to 25 are correct
_FEWEST_REVOLUTIONS = 8  # for an order map: two frames of the shortest


def _hertz(highest: float) -> tuple[str, float]:
    """Unit of a linear frequency axis, and its value in hertz."""
    return ("kHz", 1e3) if highest >= 5000 else ("Hz", 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Map:
    """Levels over two axes, with the edges of the cells."""

    trace: Trace
    x: Float
    y: Float
    level: Float  # [shape=(len(y) - 1, len(x) - 1)]
    unit: str


def _draw_maps(
    place: Any, *, maps: Sequence[_Map], x: str, y: str, finish: Callable[[Any], None]
) -> None:
    axes = stack(place, len(maps))
    for axis, item in zip(axes, maps, strict=True):
        highest = float(item.level.max())
        lowest = max(float(item.level.min()), highest - _DYNAMIC_DB)
        mesh = axis.pcolormesh(
            item.x,
            item.y,
            item.level,
            shading="flat",
            cmap=_COLOURS,
            vmin=lowest,
            vmax=max(highest, lowest + 10),
            rasterized=True,
        )
        bar = place.colorbar(mesh, ax=axis, pad=0.015, fraction=0.06)
        bar.set_label(item.unit, fontsize=8)
        axis.grid(visible=False)
        axis.set_ylabel(y, fontsize=9)
        name_inside(axis, item.trace)
        finish(axis)
    axes[-1].set_xlabel(x)


def _steps(middles: Float) -> Float:
    """Edges half-way between evenly spaced middles [shape=(n + 1,)]."""
    step = float(middles[1] - middles[0]) if middles.size > 1 else 1.0
    return np.append(middles - step / 2, middles[-1] + step / 2)


def _merged(level: Float, edges: Float, most: int) -> tuple[Float, Float]:
    """Adjacent columns merged if there are too many, keeping the highest values."""
    count = -(-level.shape[1] // most)
    starts = np.arange(0, level.shape[1], count)
    kept = np.append(edges[:-1][starts], edges[-1])
    return np.maximum.reduceat(level, starts, axis=1), kept


def waterfall_panel(view: View) -> Panel:
    """Power spectral density over frequency and time."""
    refuse_short(view, 16 * FEWEST_SAMPLES)
    longest = 1 << int(np.log2(view.n_samples // 8))
    nperseg = min(default_nperseg(view.rate, view.n_samples), longest)
    hop = max(nperseg // 4, -(-(view.n_samples - nperseg) // (_MOST_FRAMES - 1)))
    traces, others = first_rows(view.motions)
    if not traces:
        raise LackError("needs a channel other than a force; draw one")
    unit, scale = _hertz(view.rate / 2)
    maps = [
        _Map(trace=trace, x=x / scale, y=y, level=level, unit=f"dB re 1\n{trace.square}/Hz")
        for trace in traces
        for x, y, level in [_spectra_over_time(trace.values, view.rate, nperseg, hop)]
    ]
    return Panel(
        kind="waterfall",
        caption=(
            f"Waterfall: power spectral density over time, lines of "
            f"{number(view.rate / nperseg)} Hz, windows of {number(nperseg / view.rate)} s{others}"
        ),
        height=1.7 * len(maps) + 0.6,
        draw=partial(_draw_maps, maps=maps, x=f"frequency [{unit}]", y="time [s]", finish=_nothing),
        right=RIGHT_OF_MAP,
    )


def _spectra_over_time(
    x: NDArray[np.float32], fs: float, nperseg: int, hop: int
) -> tuple[Float, Float, Float]:
    """Edges of frequency and time, and levels of the density [dB]."""
    frames = np.lib.stride_tricks.sliding_window_view(x, nperseg)[::hop]
    lines = np.stack([power_lines(frame, fs, nperseg=nperseg) for frame in frames])
    frequency = line_frequencies(lines.shape[-1], fs)
    level, edges = _merged(decibel(lines / frequency[1]), _steps(frequency), _MOST_COLUMNS)
    middles = (np.arange(len(frames), dtype=np.float64) * hop + nperseg / 2) / fs
    return edges, _steps(middles), level


def _nothing(_axis: Any) -> None:
    """No additional limits."""


def orders_panel(view: View) -> Panel:
    """Rms over orders and time."""
    turning = turning_of(view)
    traces, others = first_rows(view.motions)
    if not traces:
        raise LackError("needs a channel other than a force; draw one")
    rows = np.stack([trace.values for trace in traces])
    angle = angular_resample(rows, turning.phase, points_per_revolution=_POINTS)
    if angle.revolutions < _FEWEST_REVOLUTIONS:
        raise LackError(
            f"needs >= {_FEWEST_REVOLUTIONS} revolutions, has {angle.revolutions}; record longer"
        )
    revolutions = min(16, max(4, angle.revolutions // 4))
    highest = min(_SHOWN_ORDERS, angle.highest_order, 0.4 / float(np.diff(turning.phase).max()))
    maps = _order_maps(traces, angle, view, revolutions, highest)
    return Panel(
        kind="orders",
        caption=(
            f"Order map: rms over orders and time, windows of {revolutions} revolutions (Hann), "
            f"speed {_speed_range(turning)}{others}"
        ),
        height=1.7 * len(maps) + 0.6,
        draw=partial(_draw_maps, maps=maps, x="order [-]", y="time [s]", finish=_finish_orders),
        right=RIGHT_OF_MAP,
    )


def _speed_range(turning: Turning) -> str:
    speeds = 1 / np.diff(turning.pulses)
    low, high = (number(float(speed)) for speed in (speeds.min(), speeds.max()))
    return f"{low} Hz" if low == high else f"{low} … {high} Hz"


def _finish_orders(axis: Any) -> None:
    axis.set_xticks(np.arange(0, axis.get_xlim()[1], 2 if axis.get_xlim()[1] > 10 else 1))


def _order_maps(
    traces: Sequence[Trace], angle: AngleSignal, view: View, revolutions: int, highest: float
) -> list[_Map]:
    found = order_map(angle, revolutions=revolutions, window="hann")
    shown = found.orders <= highest
    # the middles lie within the record, whose phase rises
    time = np.interp(found.turns, turning_of(view).phase, np.arange(view.n_samples) / view.rate)
    edges = _uneven_steps(time)
    return [
        _Map(
            trace=trace,
            x=_steps(found.orders[shown]),
            y=edges,
            level=decibel(np.square(rms[:, shown], dtype=np.float64)),
            unit=f"dB re 1 {trace.unit}",
        )
        for trace, rms in zip(traces, found.rms, strict=True)
    ]


def _uneven_steps(middles: Float) -> Float:
    """Edges half-way between middles of any spacing [shape=(n + 1,)]."""
    if middles.size == 1:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    between = (middles[:-1] + middles[1:]) / 2
    first, last = 2 * middles[0] - between[0], 2 * middles[-1] - between[-1]
    return np.concatenate(([first], between, [last]))


def angle_panel(view: View) -> Panel:
    """Energy in bins of the crank angle and bands of frequency."""
    turning = turning_of(view)
    traces, others = first_rows(view.casing)
    if not traces:
        raise LackError("needs a channel on a casing, other than a proximity probe; record one")
    if fault := crank_map_fault(view.rate):
        raise LackError(f"cannot be computed: {fault}")
    refuse_short(view, default_window(view.rate)[0])
    edges = STANDARD.map_edges(view.rate)
    maps = [
        _Map(
            trace=trace,
            x=np.linspace(0, 360, level.shape[0] + 1),
            y=edges,
            level=level.T,
            unit=f"dB re 1 {trace.square}",
        )
        for trace in traces
        for level in [decibel(crank_angle_map(trace.values, view.rate, turning.phase, edges=edges))]
    ]
    return Panel(
        kind="angle",
        caption=f"Energy over crank angle and frequency{others}",
        height=2.4 * len(maps) + 0.6,
        draw=partial(
            _draw_maps,
            maps=maps,
            x="crank angle after the tacho pulse [deg]",
            y="frequency [Hz]",
            finish=partial(_finish_angle, span=(edges[0], edges[-1])),
        ),
        right=RIGHT_OF_MAP,
    )


def _finish_angle(axis: Any, *, span: tuple[float, float]) -> None:
    log_frequency(axis, "y")
    axis.set_ylim(span)
    axis.set_xticks(np.arange(0, 361, 45))
