"""Curves of a recording for close inspection, as values: waveform, spectra, orbit.

A kind computes its curves in usual units with the public functions of
``features.catalogue.curves``, or reports what the recording lacks.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.catalogue.curves import (
    Spectrum,
    envelope_spectrum,
    orbit,
    order_spectrum,
    spectrum,
)
from ...features.signal.envelope import envelope_span
from ...features.signal.kurtogram import kurtogram, kurtogram_levels
from ...sim.output.recording import DataError
from ..pages.page import short_name, visible
from .kinds import AUTO, computed
from .orbit import probe_pairs, shown_samples
from .panel import LackError
from .view import Trace, Turning, View, thinned

MOST_CHANNELS = 8
"""Most channels in a page."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ZoomCurve:
    """One line on its own axes.

    Parameters
    ----------
    kind : str
        Key of :data:`ZOOM_KINDS`; curves of a kind share their x axis, except for orbits.
    title, x_name, y_name : str
        Title and axis names, with units.
    x, y : ndarray, shape (n,)
        Values in the units named; x rising, except for an orbit.
    unit : str
        Unit of y.
    hz : float, optional
        Frequency of one unit of x [Hz]; None if x is not a frequency.
    reach : float
        Distance on x within which only the highest and lowest point are kept, 0 if all are.
    """

    kind: str
    title: str
    x_name: str
    y_name: str
    x: NDArray[Any]
    y: NDArray[Any]
    unit: str
    hz: float | None = None
    reach: float = 0.0

    def thinned(self, most: int) -> "ZoomCurve":
        """The curve with at most about that many points, peaks kept; an orbit is cut short.

        Examples
        --------
        >>> y = np.zeros(1000)
        >>> y[321] = 7.0
        >>> names = dict(kind="spectrum", title="", x_name="", y_name="", unit="")
        >>> curve = ZoomCurve(**names, x=np.arange(1000.0), y=y).thinned(50)
        >>> len(curve.x), float(curve.x[curve.y.argmax()]), curve.reach
        (26, 321.0, 40.0)
        """
        if len(self.x) <= most:
            return self
        if self.kind == "orbit":
            return replace(self, x=self.x[:most], y=self.y[:most])
        x, y = thinned(self.x, self.y, most)
        reach = len(self.x) / (most // 2) * float(self.x[1] - self.x[0])
        return replace(self, x=x, y=y, reach=reach)


def zoom_curves(view: View, kind: str = AUTO) -> tuple[list[ZoomCurve], dict[str, str]]:
    """Curves of a recording, and why some kinds have none.

    Parameters
    ----------
    view : View
        The recording, and what to draw of it.
    kind : str
        Key of :data:`ZOOM_KINDS`, or ``auto`` for all that the recording supports.

    Returns
    -------
    curves : list of ZoomCurve
    left_out : dict
        What the recording lacks, by kind.

    Raises
    ------
    DataError
        If the kind has no interactive curve, or the recording supports none of those requested.
    """
    if kind not in (AUTO, *ZOOM_KINDS):
        known = ", ".join((AUTO, *ZOOM_KINDS))
        raise DataError(f"kind = {kind!r} cannot be interactive, must be one of {known}")
    curves: list[ZoomCurve] = []
    view, left_out = _first_channels(view)
    for name in ZOOM_KINDS if kind == AUTO else (kind,):
        try:
            curves += computed(ZOOM_KINDS[name], view)
        except LackError as lack:
            left_out[name] = str(lack)
    if not curves:
        source = view.recording.source
        raise DataError("\n".join(f"{source}: {name} {why}" for name, why in left_out.items()))
    return curves, left_out


def _first_channels(view: View) -> tuple[View, dict[str, str]]:
    """The view with no more channels than fit into a page, and text about the others."""
    names = [trace.name for trace in view.traces]
    if len(names) <= MOST_CHANNELS:
        return view, {}
    lack = f"{MOST_CHANNELS + 1} to {len(names)} have no room; name the channels to draw"
    return replace(view, channels=names[:MOST_CHANNELS]), {"channels": lack}


def _waveforms(view: View) -> list[ZoomCurve]:
    time = np.arange(view.n_samples) / view.rate
    return [
        ZoomCurve(
            kind="waveform",
            title=f"Waveform: {short_name(trace.name)}",
            x_name="time [s]",
            y_name=_unit(trace.unit),
            x=time,
            y=trace.values,
            unit=visible(trace.unit),
        )
        for trace in view.traces
    ]


def _spectra(view: View) -> list[ZoomCurve]:
    values, names = _stacked(view)
    return _of_spectrum(
        "spectrum", view.traces, spectrum(values, view.rate, channel_names=names), 1.0
    )


def _orders(view: View) -> list[ZoomCurve]:
    if not isinstance(view.turning, Turning) or view.speed is None:
        raise LackError(str(view.turning))
    values, names = _stacked(view)
    found = order_spectrum(
        values,
        view.rate,
        tacho=view.recording.tacho_signal,
        pulses_per_revolution=view.recording.pulses_per_revolution,
        channel_names=names,
    )
    return _of_spectrum("orders", view.traces, found, view.speed)


def _envelopes(view: View) -> list[ZoomCurve]:
    """Envelope spectra, each in the band of its highest kurtosis, as in the picture."""
    if not view.casing:
        raise LackError("needs a channel on a casing, other than a proximity probe; record one")
    levels = kurtogram_levels(view.n_samples, view.rate, envelope_span(view.speed, view.bearing))
    curves = []
    for trace in view.casing:
        band = kurtogram(trace.values, view.rate, levels=levels).band
        found = envelope_spectrum(trace.values, view.rate, band=band, kind="plain")
        [curve] = _of_spectrum("envelope", (trace,), found, 1.0)
        title = f"{curve.title}, {band[0]:.0f} to {band[1]:.0f} Hz"
        curves.append(replace(curve, title=title))
    return curves


def _orbits(view: View) -> list[ZoomCurve]:
    n = shown_samples(view)
    curves = []
    for first, second in probe_pairs(view):
        path = orbit([first.values, second.values], view.rate).path[:n]
        curves.append(
            ZoomCurve(
                kind="orbit",
                title=f"Orbit: {short_name(first.name, 24)}, {short_name(second.name, 24)}",
                x_name=f"x {_unit(first.unit)}",
                y_name=f"y {_unit(first.unit)}",
                x=path.real,
                y=path.imag,
                unit=visible(first.unit),
            )
        )
    return curves


ZOOM_KINDS: dict[str, Callable[[View], list[ZoomCurve]]] = {
    "waveform": _waveforms,
    "spectrum": _spectra,
    "orders": _orders,
    "envelope": _envelopes,
    "orbit": _orbits,
}
"""Function that computes the curves of each kind."""


def _stacked(view: View) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Signals in usual units [shape=(n_channels, n_samples)], and their names."""
    return np.stack([trace.values for trace in view.traces]), tuple(t.name for t in view.traces)


def _of_spectrum(
    kind: str, traces: tuple[Trace, ...], found: Spectrum, hz: float
) -> list[ZoomCurve]:
    head = found.kind[0].upper() + found.kind[1:]
    return [
        ZoomCurve(
            kind=kind,
            title=f"{head.replace('Plain envelope', 'Envelope')}: {short_name(trace.name)}",
            x_name=found.axis,
            y_name=_unit(trace.unit),
            x=found.lines,
            y=row,
            unit=visible(trace.unit),
            hz=hz,
        )
        for trace, row in zip(traces, found.amplitude, strict=True)
    ]


def _unit(unit: str) -> str:
    return f"[{visible(unit)}]" if unit else "[-]"
