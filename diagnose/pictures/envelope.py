"""Panel of the envelope spectrum: impact rates compared with a bearing's geometry."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from numpy.typing import NDArray

from ...features.signal.envelope import FaultLine, envelope_span, envelope_spectrum, fault_line
from ...features.signal.kurtogram import Kurtogram, kurtogram, kurtogram_levels
from .panel import (
    COLOURS,
    MOST_POINTS,
    LackError,
    Panel,
    first_rows,
    from_zero,
    order_cursors,
    stack,
)
from .view import Float, Trace, View, number, thinned

_FAULT_COLOURS = {"outer": "#b02a1c", "inner": "#7a4a8c", "roller": "#4f7d3a", "cage": "#b3741e"}
_HARMONICS = 3  # of a fault


@dataclass(frozen=True, kw_only=True, eq=False)
class _Envelope:
    """Envelope spectrum of a trace in the band of its kurtogram.

    `faults` holds, by name, the fault frequency by geometry [Hz] and the fault line found there.
    """

    trace: Trace
    found: Kurtogram
    frequency: Float
    amplitude: NDArray[Any]
    faults: dict[str, tuple[float, FaultLine | None]]


def envelope_panel(view: View) -> Panel:
    """Envelope spectra with the bearing's fault lines, or the shaft's orders."""
    traces, others = first_rows(view.casing)
    if not traces:
        raise LackError("needs a channel on a casing, other than a proximity probe; record one")
    if view.bearing is not None and view.speed is None:
        raise LackError("needs the shaft speed to place the bearing's lines; give speed or tacho")
    spectra = [_envelope_of(trace, view) for trace in traces]
    highest = min(
        envelope_span(view.speed, view.bearing), *(float(item.frequency[-1]) for item in spectra)
    )
    caption = "Envelope spectrum in the band of the highest kurtosis (kurtogram)"
    if view.bearing is not None:
        caption += "; dashed lines: bearing geometry, with the line found there and its score"
    elif view.speed is not None:
        caption += f"; dotted: orders of {number(view.speed)} Hz"
    return Panel(
        kind="envelope",
        caption=caption + others,
        height=2.0 * len(spectra) + 0.8,
        draw=partial(_draw_envelopes, spectra=spectra, speed=view.speed, highest=highest),
        above=0.2,
    )


def _envelope_of(trace: Trace, view: View) -> _Envelope:
    span = envelope_span(view.speed, view.bearing)
    levels = kurtogram_levels(view.n_samples, view.rate, span)
    found = kurtogram(trace.values, view.rate, levels=levels)
    frequency, amplitude = envelope_spectrum(trace.values, view.rate, found.band, kind="plain")
    faults = {}
    if view.bearing is not None and view.speed is not None:
        for name in _FAULT_COLOURS:
            # a damaged roller strikes both races, hence twice per turn
            strikes = 2 if name == "roller" else 1
            place = strikes * getattr(view.bearing, name) * view.speed
            faults[name] = place, _sought(frequency, amplitude, place)
    return _Envelope(
        trace=trace, found=found, frequency=frequency, amplitude=amplitude, faults=faults
    )


def _sought(frequency: Float, amplitude: NDArray[Any], place: float) -> FaultLine | None:
    """Fault line near a frequency; None if band or record are too short."""
    try:
        return fault_line(frequency, amplitude, place, harmonics=_HARMONICS)
    except ValueError:
        return None


def _draw_envelopes(
    place: Any, *, spectra: Sequence[_Envelope], speed: float | None, highest: float
) -> None:
    axes = stack(place, len(spectra))
    place.subplots_adjust(hspace=0.22)
    for i, (axis, item) in enumerate(zip(axes, spectra, strict=True)):
        shown = item.frequency <= highest
        x, y = thinned(item.frequency[shown], item.amplitude[shown], MOST_POINTS)
        axis.plot(x, y, lw=0.7, color=COLOURS[i % len(COLOURS)])
        from_zero(axis, [y])
        axis.set_xlim(0, highest)
        axis.set_ylabel(f"[{item.trace.unit}]", fontsize=9)
        if item.faults:
            _fault_lines(axis, item.faults, highest)
            axis.legend(loc="upper right", fontsize=8)
        else:
            order_cursors(axis, speed, 0, highest)
        axis.set_title(_band_words(item), fontsize=8, loc="left", pad=2)
    axes[-1].set_xlabel("frequency of the envelope [Hz]")


def _band_words(item: _Envelope) -> str:
    """Text with the band, and its kurtosis compared with that of noise."""
    low, high = item.found.band
    scatter = float(item.found.deviation[item.found.best[0]])
    return (
        f"{item.trace.name}, {number(low)} … {number(high)} Hz: kurtosis "
        f"{item.found.highest:.3g}, for noise 0 ± {scatter:.2g}"
    )


def _fault_lines(
    axis: Any, faults: dict[str, tuple[float, FaultLine | None]], highest: float
) -> None:
    for name, (frequency, found) in faults.items():
        label = f"{name} {number(frequency)} Hz"
        if found is not None:
            label += f": {number(found.frequency)} Hz, score {found.score:.1f}"
        for harmonic in range(1, _HARMONICS + 1):
            if harmonic * frequency <= highest:
                axis.axvline(
                    harmonic * frequency,
                    ls="--",
                    lw=0.8,
                    color=_FAULT_COLOURS[name],
                    zorder=0.5,
                    label=label if harmonic == 1 else None,
                )
