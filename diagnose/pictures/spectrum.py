"""Panels over time and over frequency: waveform, density, amplitudes about the shaft's orders."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...features.catalogue.row import FEWEST_SAMPLES
from ...features.signal.spectrum import (
    amplitude_spectrum,
    decibel,
    default_nperseg,
    power_spectral_density,
)
from ..pages.page import short_name
from .panel import (
    COLOURS,
    CURSOR_ORDERS,
    MOST_POINTS,
    MOST_ROWS,
    Panel,
    from_zero,
    log_frequency,
    name_inside,
    order_cursors,
    refuse_short,
    stack,
)
from .view import Float, Trace, Turning, View, number, thinned

_SHOWN_REVOLUTIONS = 2  # of a waveform
_LOWEST_SHOWN = 10.0  # Hz, of a density
_LINES_PER_ORDER = 5  # spectral lines between orders, to separate them
_LEGEND_COLUMNS = 4

# --- waveform


def waveform_panel(view: View) -> Panel:
    """The first two revolutions, or the whole record if the speed is unknown."""
    n = view.n_samples
    if view.speed is not None:
        n = max(2, min(n, round(_SHOWN_REVOLUTIONS / view.speed * view.rate)))
    until = n / view.rate
    caption = f"Waveform: first {number(until)} of {number(view.recording.duration)} s"
    marks: Float = np.empty(0)
    if isinstance(view.turning, Turning):
        marks = view.turning.pulses[view.turning.pulses < until]
        caption += "; dashed: tacho pulses"
    curves = [
        thinned(np.arange(n) / view.rate, trace.values[:n], MOST_POINTS) for trace in view.traces
    ]
    return Panel(
        kind="waveform",
        caption=caption if n < view.n_samples else "Waveform: the whole record",
        height=(1.6 if len(curves) <= MOST_ROWS else 1.0) * len(curves) + 0.6,
        draw=partial(_draw_waveform, traces=view.traces, curves=curves, marks=marks, until=until),
    )


def _draw_waveform(
    place: Any,
    *,
    traces: Sequence[Trace],
    curves: Sequence[tuple[Float, Float]],
    marks: Float,
    until: float,
) -> None:
    axes = stack(place, len(traces))
    for i, (trace, (time, values)) in enumerate(zip(traces, curves, strict=True)):
        colour, name = COLOURS[i % len(COLOURS)], short_name(trace.name)
        axes[i].plot(time, values, lw=0.6, color=colour, label=name)
        axes[i].set_ylabel(f"[{trace.unit}]", fontsize=9)
        name_inside(axes[i], trace)
        for mark in marks:
            axes[i].axvline(mark, ls="--", lw=0.7, color="0.5", zorder=0.5)
    axes[-1].set(xlabel="time [s]", xlim=(0, until))


# --- spectrum


@dataclass(frozen=True, kw_only=True, eq=False)
class _Spectra:
    """Density, and if the speed is known the lines about the orders, for channels of one unit."""

    traces: list[tuple[int, Trace]]
    density: list[tuple[Float, Float]]  # frequency [Hz], level [dB]
    orders: list[tuple[Float, Float]]  # frequency [Hz], amplitude

    @property
    def unit(self) -> Trace:
        """Any of the traces: they share the unit."""
        return self.traces[0][1]


def spectrum_panel(view: View) -> Panel:
    """Power spectral density, and the amplitudes about the shaft's orders."""
    refuse_short(view, FEWEST_SAMPLES)
    nperseg = default_nperseg(view.rate, view.n_samples)
    fine, highest = _order_lines(view)
    units: dict[str, list[tuple[int, Trace]]] = {}
    for i, trace in enumerate(view.traces):
        units.setdefault(trace.unit, []).append((i, trace))
    groups = [
        _Spectra(
            traces=traces,
            density=[_density(trace, view.rate, nperseg) for _, trace in traces],
            orders=[_amplitudes(trace, view.rate, fine, highest) for _, trace in traces if fine],
        )
        for traces in units.values()
    ]
    caption = f"Spectrum: power spectral density, lines of {number(view.rate / nperseg)} Hz"
    if fine:
        caption += (
            f"; amplitude, lines of {number(view.rate / fine)} Hz; dotted: orders of "
            f"{number(view.speed or 0)} Hz"
        )
    # a slow recording has nothing above 10 Hz
    low = min(max(_LOWEST_SHOWN, view.rate / nperseg), view.rate / 8)
    return Panel(
        kind="spectrum",
        caption=caption,
        height=(4.8 if fine else 2.6) * len(groups) + 0.6,
        draw=partial(_draw_spectra, groups=groups, speed=view.speed, span=(low, view.rate / 2)),
    )


def _order_lines(view: View) -> tuple[int, float]:
    """Length of segments that separate the orders [samples], and the highest frequency shown [Hz].

    (0, 0) if the speed is unknown or the record too short.
    """
    if view.speed is None:
        return 0, 0.0
    wanted = 1 << int(np.ceil(np.log2(_LINES_PER_ORDER * view.rate / view.speed)))
    if wanted > view.n_samples:
        return 0, 0.0
    # longer if three segments, overlapped by half, still fit: sharper lines
    longest = 1 << int(np.log2(view.n_samples // 2))
    highest = min((CURSOR_ORDERS + 0.5) * view.speed, view.rate / 2)
    return max(wanted, min(longest, default_nperseg(view.rate, view.n_samples))), highest


def _density(trace: Trace, fs: float, nperseg: int) -> tuple[Float, Float]:
    frequency, density = power_spectral_density(trace.values, fs, nperseg=nperseg)
    return thinned(frequency[1:], decibel(density[1:]), MOST_POINTS, logarithmic=True)


def _amplitudes(trace: Trace, fs: float, nperseg: int, highest: float) -> tuple[Float, Float]:
    frequency, amplitude = amplitude_spectrum(trace.values, fs, nperseg=nperseg)
    shown = frequency <= highest
    return thinned(frequency[shown], amplitude[shown], MOST_POINTS)


def _draw_spectra(
    place: Any, *, groups: Sequence[_Spectra], speed: float | None, span: tuple[float, float]
) -> None:
    each = 2 if groups[0].orders else 1
    axes = stack(place, each * len(groups), sharex=False)
    place.subplots_adjust(hspace=0.28)
    for group, wide in zip(groups, axes[::each], strict=True):
        _draw_density(wide, group, span)
    for group, narrow in zip(groups, axes[1::2] if each == 2 else [], strict=False):
        _draw_orders(narrow, group, speed)
    axes[-1].set_xlabel("frequency [Hz]")


def _draw_density(axes: Any, group: _Spectra, span: tuple[float, float]) -> None:
    shown = []
    for (i, trace), (frequency, level) in zip(group.traces, group.density, strict=True):
        colour = COLOURS[i % len(COLOURS)]
        axes.plot(frequency, level, lw=0.7, color=colour, label=short_name(trace.name))
        shown.append(level[frequency >= span[0]])
    lowest = min(float(level.min()) for level in shown)
    highest = max(float(level.max()) for level in shown)
    room = max(highest - lowest, 10.0)  # a silent channel has no range
    legend_rows = -(-len(shown) // _LEGEND_COLUMNS)
    axes.set_ylim(lowest - 0.05 * room, highest + (0.06 + 0.1 * legend_rows) * room)
    axes.set_ylabel(f"PSD\n[dB re 1 {group.unit.square}/Hz]", fontsize=9)
    axes.legend(loc="upper right", fontsize=8, ncols=min(_LEGEND_COLUMNS, len(shown)))
    log_frequency(axes, "x")
    axes.set_xlim(span)


def _draw_orders(axes: Any, group: _Spectra, speed: float | None) -> None:
    for (i, trace), (frequency, amplitude) in zip(group.traces, group.orders, strict=True):
        colour = COLOURS[i % len(COLOURS)]
        axes.plot(frequency, amplitude, lw=0.7, color=colour, label=short_name(trace.name))
    highest = float(axes.get_lines()[0].get_xdata()[-1])
    from_zero(axes, [amplitude for _, amplitude in group.orders])
    axes.set_xlim(0, highest)
    axes.set_ylabel(f"amplitude\n[{group.unit.unit}]", fontsize=9)
    order_cursors(axes, speed, 0, highest)
