"""One recording prepared for drawing: signals in usual units, and the rotation of its shaft."""

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.catalogue.analysis import DISPLACEMENT, FORCE
from ...features.rotation.order import pulse_times, shaft_phase
from ...features.signal.envelope import BearingFrequencies
from ...sim.output.recording import DataError, Recording
from ...sim.output.sensor import Channel

Float = NDArray[np.float64]

_SHOWN = {
    "m": ("µm", 1e6),
    "m/s": ("mm/s", 1e3),
    "m/s^2": ("m/s²", 1.0),
    "Pa": ("kPa", 1e-3),
}
"""Usual unit of a signal and factor to it, by SI unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """One channel as shown in a picture.

    Parameters
    ----------
    name, quantity, place : str
        Name, quantity and place of the channel.
    unit : str
        Usual unit of `values`.
    values : ndarray, shape (n_samples,)
        Signal [`unit`].
    """

    name: str
    quantity: str
    place: str
    unit: str
    values: NDArray[np.float32]

    @property
    def square(self) -> str:
        """Unit of the mean square as text: ``(m/s²)²``, ``µm²``."""
        return f"({self.unit})²" if set(self.unit) & set("/²^ ") else f"{self.unit}²"


@dataclass(frozen=True, kw_only=True, eq=False)
class Turning:
    """Rotation of the shaft, from its tacho.

    Parameters
    ----------
    pulses : ndarray, shape (n_pulses,)
        Pulse times, one per revolution [s].
    phase : ndarray, shape (n_samples,)
        Shaft phase [rev], 0 at the first pulse.
    """

    pulses: Float
    phase: Float


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A recording and what to draw of it.

    Parameters
    ----------
    recording : Recording
    channels : sequence of str
        Names of those to draw; all but the tacho by default.
    force : str, optional
        Name of the force channel of a transfer function; by default the only channel in N.
    speed_hz : float, optional
        Shaft speed if the recording has no tacho [Hz]; it takes precedence over the declared one.
    bearing : BearingFrequencies, optional
        Fault frequencies of a rolling bearing at one revolution per second, that is in orders.
    exponential : float
        Value of the exponential window of an impact test at the end of a block [-].

    Raises
    ------
    DataError
        If a channel is not in the recording, or the speed is not > 0; all faults at once.

    Examples
    --------
    >>> signal = np.ones((1, 64))
    >>> channel = Channel(name="probe", unit="m", quantity="displacement")
    >>> view = View(recording=Recording(signal=signal, sample_rate=8.0, channels=(channel,)))
    >>> view.traces[0].unit, float(view.traces[0].values[0]), view.speed
    ('µm', 1000000.0, None)
    """

    recording: Recording
    channels: Sequence[str] = ()
    force: str | None = None
    speed_hz: float | None = None
    bearing: BearingFrequencies | None = None
    exponential: float = 1.0

    def __post_init__(self) -> None:
        known = self.recording.vibration_names
        requested = [*self.channels, *([] if self.force is None else [self.force])]
        faults = [
            f"{self.recording.source} has no channel {name!r}{_nearest(name, known)}"
            for name in requested
            if name not in known
        ]
        if self.speed_hz is not None and not 0 < self.speed_hz < math.inf:
            faults.append(f"speed = {self.speed_hz} Hz must be > 0 and finite; correct it")
        if faults:
            raise DataError("\n".join(faults))

    @property
    def rate(self) -> float:
        """Sample rate [Hz]."""
        return self.recording.sample_rate

    @property
    def n_samples(self) -> int:
        """Number of samples per channel."""
        return int(self.recording.signal.shape[1])

    @cached_property
    def traces(self) -> tuple[Trace, ...]:
        """Channels to draw, in the recording's order."""
        return tuple(
            _trace(channel, row)
            for channel, row in zip(
                self.recording.vibration_channels, self.recording.vibration, strict=True
            )
            if not self.channels or channel.name in self.channels
        )

    @cached_property
    def excitation(self) -> Trace | None:
        """The force; None if no channel is named and not exactly one is in N."""
        items = zip(self.recording.vibration_channels, self.recording.vibration, strict=True)
        found = [
            _trace(channel, row)
            for channel, row in items
            if channel.name == self.force or (self.force is None and channel.quantity == FORCE)
        ]
        return found[0] if len(found) == 1 else None

    @property
    def motions(self) -> tuple[Trace, ...]:
        """Channels to draw, except forces."""
        return tuple(
            trace for trace in self.traces if trace.quantity != FORCE and trace.name != self.force
        )

    @property
    def casing(self) -> tuple[Trace, ...]:
        """Members of `motions` other than proximity probes, which show impacts and ringing."""
        return tuple(trace for trace in self.motions if trace.quantity != DISPLACEMENT)

    @cached_property
    def turning(self) -> Turning | str:
        """Rotation of the shaft, or the reason why it is unknown."""
        recording = self.recording
        if recording.tacho_signal is None:
            return "needs a tacho, which the recording does not name; name its channel with tacho"
        per_turn = recording.pulses_per_revolution
        try:
            pulses = pulse_times(recording.tacho_signal, self.rate)
            phase = shaft_phase(pulses, self.n_samples, self.rate, pulses_per_revolution=per_turn)
        except ValueError as error:
            return f"needs a regular tacho: {error}"
        return Turning(pulses=pulses[::per_turn], phase=phase)

    @cached_property
    def speed(self) -> float | None:
        """Mean shaft speed [Hz]: by the tacho, as given, or as declared; None if unknown."""
        if isinstance(self.turning, Turning):
            phase = self.turning.phase
            return float((phase[-1] - phase[0]) / (self.n_samples - 1) * self.rate)
        return self.recording.declared_speed_hz if self.speed_hz is None else self.speed_hz

    @property
    def heading(self) -> str:
        """Source, origin and extent of the recording, for the title of a picture."""
        recording = self.recording
        speed = "" if self.speed is None else f", {number(self.speed)} rev/s"
        return (
            f"{recording.source} ({recording.origin}): {number(recording.duration)} s at "
            f"{number(self.rate)} Hz{speed}"
        )


def _trace(channel: Channel, row: NDArray[np.float32]) -> Trace:
    unit, factor = _SHOWN.get(channel.unit, (channel.unit, 1.0))
    return Trace(
        name=channel.name,
        quantity=channel.quantity,
        place=channel.place,
        unit=unit,
        values=row * np.float32(factor),
    )


def _nearest(name: str, known: Sequence[str]) -> str:
    found = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {found[0]!r}?" if found else f", must be of {', '.join(known)}"


def number(value: float) -> str:
    """A number with four significant digits, without exponent up to a million.

    Examples
    --------
    >>> number(25600.0), number(97656.0), number(0.48008)
    ('25600', '97656', '0.4801')
    """
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.4g}"


def thinned(
    x: NDArray[Any], y: NDArray[Any], most: int, *, logarithmic: bool = False
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Enough points of a curve to draw it: the extremes of short pieces.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Curve; x rising, above 0 if `logarithmic`.
    most : int
        Number of points that can be distinguished.
    logarithmic : bool
        Whether the pieces are equally long on a logarithmic axis.

    Returns
    -------
    x, y : ndarray, shape (at most about `most`,)
        Some of the points, in order: no peak is lost or moved.

    Examples
    --------
    >>> x, y = thinned(np.arange(6), np.array([0, 1, 0, 5, 2, 3]), 4)
    >>> x.tolist(), y.tolist()
    ([0, 1, 3, 4], [0, 1, 5, 2])
    """
    if len(y) <= most:
        return x, y
    cells = most // 2 + 1
    if logarithmic:
        bounds = np.searchsorted(x, np.geomspace(x[0], x[-1], cells))
        bounds = np.unique([*bounds[:-1], len(y)])
    else:
        bounds = np.linspace(0, len(y), cells).astype(int)
    kept = []
    for first, past in pairwise(bounds.tolist()):
        piece = y[first:past]
        kept += sorted({first + int(np.argmin(piece)), first + int(np.argmax(piece))})
    return x[kept], y[kept]
