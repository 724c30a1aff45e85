"""Requirements of features, and what a recording offers: known before a sample is read."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress, pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ..response.impact import is_impact
from ..rotation import tacholess_speed as speed
from ..signal import envelope, iso
from ..signal.rate import check_rate
from .analysis import (
    ACCELERATION,
    DISPLACEMENT,
    FEWEST_FRF_LINES,
    FORCE,
    PRESSURE,
    STANDARD,
    Settings,
    least_samples,
)


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Properties of a recording on which the catalogue depends.

    Parameters
    ----------
    channels : tuple of str
        Names of the channels but the tacho.
    quantities : tuple of str
        Quantity of each channel.
    fs : float
        Sample rate [Hz].
    tacho : bool
        Whether there is a tacho.
    pulses_per_revolution : int
        Pulses in one revolution.
    n_samples : int, optional
        Length of the record; None for a length that suffices for every feature.
    impact : bool
        Whether the force is that of a hammer: its blocks follow the record, which may be short.
    settings : Settings
        Settings, including what cannot be inferred from a signal.

    Examples
    --------
    >>> Layout(channels=("a",), quantities=("acceleration",), fs=1000.0).probes is None
    True
    >>> kinds = ("acceleration", "pressure")
    >>> Layout(channels=("a", "p"), quantities=kinds, fs=1000.0, tacho=True).pressures
    ('p',)
    """

    channels: tuple[str, ...]
    quantities: tuple[str, ...]
    fs: float
    tacho: bool = False
    pulses_per_revolution: int = 1
    n_samples: int | None = None
    impact: bool = False
    settings: Settings = STANDARD

    @property
    def cylinders(self) -> NDArray[np.bool_]:
        """Whether each channel is a cylinder pressure, read over the crank angle.

        All pressures are, if there are a tacho with one pulse per revolution and another quantity;
        otherwise none is, and pressures are treated like any other signal.
        """
        found = np.array([kind == PRESSURE for kind in self.quantities], dtype=np.bool_)
        return found & (self.tacho and self.pulses_per_revolution == 1 and not found.all())

    @property
    def pressures(self) -> tuple[str, ...]:
        """Names of the cylinder pressures."""
        return tuple(compress(self.channels, self.cylinders))

    @property
    def vibrations(self) -> tuple[str, ...]:
        """Names of all other channels, the rows of an analysis."""
        return tuple(compress(self.channels, ~self.cylinders))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Quantity of each of `vibrations`."""
        return tuple(compress(self.quantities, ~self.cylinders))

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return math.inf if self.n_samples is None else self.n_samples / self.fs

    @property
    def probes(self) -> tuple[int, int] | None:
        """Channels of the two proximity probes of an orbit; None unless there are exactly two."""
        rows = self.rows_of(DISPLACEMENT)
        return (rows[0], rows[1]) if len(rows) == 2 else None

    def rows_of(self, quantity: str) -> tuple[int, ...]:
        """Rows of a quantity among `vibrations`."""
        return tuple(i for i, kind in enumerate(self.kinds) if kind == quantity)


def struck(signals: NDArray[np.floating], quantities: Sequence[str]) -> bool:
    """Whether a record is an impact test: exactly one channel is a force, that of a hammer.

    Parameters
    ----------
    signals : ndarray, shape (n_channels, n_samples)
        Signals [any unit].
    quantities : sequence of str
        Quantity of each channel.

    Examples
    --------
    >>> blow = np.arange(200) == 50
    >>> struck(np.stack([blow, np.sin(np.arange(200))]), ("force", "acceleration"))
    True
    """
    rows = [i for i, kind in enumerate(quantities) if kind == FORCE]
    return len(rows) == 1 and is_impact(signals[rows[0]])


@dataclass(frozen=True, kw_only=True)
class Need:
    """One requirement of features.

    Parameters
    ----------
    text : str
        Name, as shown by `features --list`.
    fault : callable
        ``fault(layout)`` returns the fault and its cure, or an empty text if the requirement is
        met.

    Examples
    --------
    >>> NEEDS["tacho"].fault(Layout(channels=("a",), quantities=("acceleration",), fs=1e3))
    'tacho = none must be there; record one'
    """

    text: str
    fault: Callable[[Layout], str]


def _tacho(layout: Layout) -> str:
    return "" if layout.tacho else "tacho = none must be there; record one"


def _mark(layout: Layout) -> str:
    pulses = layout.pulses_per_revolution
    return "" if pulses == 1 else f"pulses_per_revolution = {pulses} must be 1; use a keyphasor"


def _casing(layout: Layout) -> str:
    if set(layout.kinds) == {DISPLACEMENT}:
        return "channels other than displacement = 0 must be >= 1; an orbit has no knocks"
    return crank_map_fault(layout.fs, layout.settings)


def crank_map_fault(fs: float, settings: Settings = STANDARD) -> str:
    """Reason why a sample rate is too low for the bands of the crank-angle map.

    A low rate, as for a shaft line, shows orders; its knocks do not fill the bands of a map.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].
    settings : Settings

    Returns
    -------
    str
        Value, bound and cure; empty if the rate suffices.

    Raises
    ------
    ValueError
        If the sample rate is not plausible.

    Examples
    --------
    >>> crank_map_fault(25_600.0), crank_map_fault(1280.0).split(": ")[0]
    ('', 'fs = 1280 Hz is too low')
    """
    check_rate(fs)
    return _bands_fault(settings.map_edges, fs)


def _spectrum_bands(layout: Layout) -> str:
    return _bands_fault(layout.settings.band_edges, layout.fs)


def _bands_fault(choice: Callable[[float], NDArray[np.float64]], fs: float) -> str:
    """Reason why a sample rate is too low for the bands of a row; names are in whole hertz."""
    try:
        edges = choice(fs)
    except ValueError as error:
        return _too_slow(fs, error)
    named = set(pairwise(np.rint(edges).tolist()))
    if len(named) == edges.size - 1:
        return ""
    return f"fs = {fs:.6g} Hz is too low: bands of {np.diff(edges).min():.2g} Hz; sample faster"


def _too_slow(fs: float, error: ValueError) -> str:
    """Message of refused bands, with a cure for callers who do not choose them."""
    return f"fs = {fs:.6g} Hz is too low: {str(error).split('; ')[0]}; sample faster"


def _declared(unit: str, too_many: bool = False) -> str:
    """Cure if channels of a quantity are missing or too many: files declare it by the unit."""
    if too_many:
        return "choose the channels on import: wearstate import --channels"
    return f"declare the unit {unit} on import, or quantities in Python"


def _probes(layout: Layout) -> str:
    count = len(layout.rows_of(DISPLACEMENT))
    return (
        ""
        if count == 2
        else f"displacement channels = {count} must be 2; {_declared('m', count > 2)}"
    )


def _cylinder(layout: Layout) -> str:
    if layout.pressures:
        return ""
    return f"cylinder pressures = 0 must be >= 1 besides a vibration; {_declared('Pa')}"


def _force(layout: Layout) -> str:
    count = len(layout.rows_of(FORCE))
    if count == 0:
        return f"force channels = 0 must be >= 1; {_declared('N')}"
    if len(layout.vibrations) == count:
        return "responses = 0 must be >= 1; record one besides the force"
    try:
        low, high = layout.settings.frf_band(layout.fs)
    except ValueError as error:
        return _too_slow(layout.fs, error)
    nperseg = layout.settings.frf_nperseg(layout.fs)
    if (high - low) * nperseg < FEWEST_FRF_LINES * layout.fs:
        return f"fs = {layout.fs:.6g} Hz is too low: lines up to {high:.4g} Hz; sample faster"
    if layout.impact:
        return ""
    least = least_samples(nperseg, count) / layout.fs
    return _duration(layout, least, "in Python raise frf_spacing_hz")


def _frf_bands(layout: Layout) -> str:
    return _bands_fault(layout.settings.frf_edges, layout.fs)


def _profile(layout: Layout) -> str:
    try:
        layout.settings.profile_edges(layout.fs)
    except ValueError as error:
        return _too_slow(layout.fs, error)
    nperseg = layout.settings.profile_nperseg(layout.fs)
    least = least_samples(nperseg, len(layout.rows_of(FORCE))) / layout.fs
    return _duration(layout, least, "sample faster")


def _reference(layout: Layout) -> str:
    return _given(layout.settings.reference, "reference", "measure one and give it in Python")


def _reference_modes(layout: Layout) -> str:
    known = layout.settings.reference
    return _given(known and known.modes, "reference.modes", "fit the reference in Python")


def _given(value: object, name: str, cure: str) -> str:
    return f"{name} = None must be given; {cure}" if value is None else ""


def _duration(layout: Layout, least: float, cure: str) -> str:
    # A record of exactly that length must not fail by rounding.
    if layout.duration >= least * (1 - 1e-12):
        return ""
    return f"duration = {layout.duration:.6g} s must be >= {least:.6g} s; record longer, or {cure}"


def _samples(least: int) -> Callable[[Layout], str]:
    def fault(layout: Layout) -> str:
        return _duration(layout, least / layout.fs, "sample faster")

    return fault


def _acceleration(layout: Layout) -> str:
    count = len(layout.rows_of(ACCELERATION))
    return "" if count else f"acceleration channels = 0 must be >= 1; {_declared('m/s2')}"


def _severity(layout: Layout) -> str:
    if fault := _acceleration(layout):
        return fault
    band = layout.settings.severity_band()
    return _rate(layout, band[1]) or _duration(
        layout, iso.FEWEST_LINES_BELOW / band[0], "choose another kind of machine"
    )


def _rate(layout: Layout, high: float) -> str:
    if layout.fs >= 2 * high:
        return ""
    return f"fs = {layout.fs:.6g} Hz must be >= {2 * high:.6g} Hz; sample faster"


def _machine(layout: Layout) -> str:
    settings = layout.settings
    if settings.machine is None:
        return "machine = None must be given; name its kind"
    if not iso.machine_kind(settings.machine).reciprocating and settings.speed_hz is None:
        return f"speed_hz = None must be given for {settings.machine}; give the nominal speed"
    return ""


def _bearing(layout: Layout) -> str:
    return _given(layout.settings.bearing, "bearing", "give its geometry")


def _speed(layout: Layout) -> str:
    known = layout.tacho or layout.settings.speed_hz is not None
    return "" if known else "speed_hz = None must be given without a tacho; give either"


def _speed_band(layout: Layout) -> str:
    band = layout.settings.speed_band_hz
    if band is None:
        return "speed_band_hz = None must be given; give the range of the speed"
    return _duration(
        layout, 2 * speed.FEWEST_REVOLUTIONS / band[0], "raise the lower end of speed_band_hz"
    )


def _bands(layout: Layout) -> str:
    return "" if layout.settings.bands else "bands = () must hold one or more; give them"


def _octaves(layout: Layout) -> str:
    try:
        layout.settings.octave_centres(layout.fs)
    except ValueError as error:
        return _too_slow(layout.fs, error)
    width = layout.settings.octave_low * (10**0.05 - 10**-0.05)
    return _duration(layout, 1 / width, "in Python raise octave_low")


def _spacing(layout: Layout) -> str:
    low, high = layout.settings.spacing_band_hz
    return _rate(layout, 2 * high) or _duration(layout, 2 / low, "in Python raise spacing_band_hz")


def _envelope(layout: Layout) -> str:
    low, high = layout.settings.envelope_edges(layout.fs)
    # One more line, since both edges may lie between lines.
    least = (envelope.FEWEST_LINES + 1) / (high - low) if high > low else math.inf
    return _rate(layout, high) or _duration(layout, least, "widen envelope_band")


NEEDS: Mapping[str, Need] = MappingProxyType(
    {
        "tacho": Need(text="tacho", fault=_tacho),
        "mark": Need(text="one pulse per revolution", fault=_mark),
        "casing": Need(text="a channel other than displacement, rate for its map", fault=_casing),
        "spectrum bands": Need(text="rate for the bands", fault=_spectrum_bands),
        "probes": Need(text="two displacement probes", fault=_probes),
        "acceleration": Need(text="acceleration", fault=_severity),
        "machine": Need(text="kind of machine, and speed of a rotating one", fault=_machine),
        "speed": Need(text="tacho or nominal speed", fault=_speed),
        "bearing": Need(text="bearing geometry", fault=_bearing),
        "speed band": Need(text="band of the speed", fault=_speed_band),
        "bands": Need(text="additional bands", fault=_bands),
        "octaves": Need(text="record that resolves the lowest third octave", fault=_octaves),
        "spacing": Need(text="record of two periods of the smallest spacing", fault=_spacing),
        "envelope": Need(text="band of eight lines", fault=_envelope),
        "frames": Need(text="256 samples", fault=_samples(256)),
        "cycles": Need(text="768 samples", fault=_samples(768)),
        "cylinder": Need(text="pressure channel besides a vibration", fault=_cylinder),
        "force": Need(text="force channel", fault=_force),
        "frf bands": Need(text="rate for its bands", fault=_frf_bands),
        "profile": Need(text="rate for its narrow bands", fault=_profile),
        "reference": Need(text="reference transfer function", fault=_reference),
        "reference modes": Need(text="modes of the reference", fault=_reference_modes),
    }
)
"""All requirements, by their names in `Feature.needs`."""


def shortcomings(needs: tuple[str, ...], layout: Layout) -> str:
    """Reasons why a recording cannot have a feature; empty if it can.

    Parameters
    ----------
    needs : tuple of str
        Keys of `NEEDS`.
    layout : Layout
        What the recording offers.

    Returns
    -------
    str
        All unmet requirements, separated by semicolons.

    Examples
    --------
    >>> shortcomings((), Layout(channels=("a",), quantities=("acceleration",), fs=1e3))
    ''
    """
    faults = (NEEDS[need].fault(layout) for need in needs)
    return "; ".join(fault for fault in faults if fault)
