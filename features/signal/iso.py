"""Vibration severity on housings: velocity in the ISO band, and its zones.

The boundaries depend on the kind of machine, which cannot be inferred from a signal and must be
given. Parts 3 (industrial machines) and 7 (rotodynamic pumps) exclude reciprocating machines, which
have parts 6 and 8 of their own.
"""

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import fast_length, fast_length_within
from .rate import rate_fault
from .spectrum import line_weights, power_lines
from .statistics import Real, centred

Band = tuple[float, float]

ISO_BAND: Band = (10.0, 1000.0)
"""Band of the severity from 600 rpm on [Hz] (ISO 20816-3)."""

SLOW_ISO_BAND: Band = (2.0, 1000.0)
"""Band below 600 rpm, and for reciprocating machines [Hz]."""

SLOW_SPEED_HZ = 10.0
"""Speed below which a rotating machine is slow [Hz], 600 rpm."""

LINES_BELOW = 20.0
"""Lower edge of the band in line spacings if the record is long enough [-]."""

FEWEST_LINES_BELOW = 5.0
"""Smallest lower edge of the band in line spacings [-]: integration is then right to 0.1 %."""

# --- velocity


def band_rms(x: ArrayLike, fs: float, band: Band, *, integrations: int = 0) -> Real:
    """Root mean square of a signal in a band, integrated over time if requested.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    band : tuple of float
        Lower and upper edge [Hz].
    integrations : {0, 1, 2}
        Number of integrations over time: 1 turns acceleration into velocity, 2 into displacement.

    Returns
    -------
    ndarray, shape (...)
        Rms [unit of x times s^integrations]; 0 for a constant signal. NaN gives NaN.

    Raises
    ------
    ValueError
        Unless 0 < low < high <= fs / 2 and the record holds 5 periods of the lower edge.

    Notes
    -----
    The averaged Hann lines of `power_lines`, each divided by its angular frequency to the power
    ``2 integrations``, summed over the band; lines on its edges count by the share inside.

    A window of finite length spreads a tone over lines k with different divisors, which alone would
    make the mean square too large by ``1 / k^2`` (``10 / (3 k^2)`` for displacement), since the
    power of Hann's lobe has the variance 1/3 line^2. Dividing by ``k^2 + 1`` and by ``k^4 + 10 k^2
    / 3`` removes this leading term. The error left for a tone within the band, in rms: below 1e-3
    from k = 5 on, 3e-4 from 10, 6e-5 from 20.

    A tone d lines below the band leaks into it by at most the share ``sqrt(0.0135 / (d - 1/2)^5)``
    of its own rms, divided by the angular frequency of the lower edge: 4.2e-4 for d = 10.

    Examples
    --------
    >>> import numpy as np
    >>> x = 3 * np.sin(2 * np.pi * 100 * np.arange(5120) / 5120)
    >>> round(float(band_rms(x, 5120.0, (10.0, 1000.0), integrations=1)) * 1e3, 4)
    3.3762
    """
    if integrations not in (0, 1, 2):
        raise ValueError(f"integrations = {integrations} must be 0, 1 or 2; give one of them")
    signal = centred(x)
    _check(signal.shape[-1], fs, band, FEWEST_LINES_BELOW)
    wanted = 2 * fast_length(math.ceil(LINES_BELOW * fs / band[0] / 2))
    nperseg = min(wanted, fast_length_within(signal.shape[-1]))
    lines = power_lines(signal, fs, nperseg=nperseg)
    weights = line_weights(nperseg, fs, band)[:, 0] * _divisors(nperseg, fs, integrations)
    return np.asarray(np.sqrt(lines @ weights), dtype=signal.dtype)


def _divisors(nperseg: int, fs: float, integrations: int) -> NDArray[np.float64]:
    """Factors that integrate the mean square of Hann lines, corrected for the width of the lobe."""
    k = np.arange(nperseg // 2 + 1, dtype=np.float64)
    powers = (np.ones_like(k), k**2 + 1, k**4 + 10 * k**2 / 3)[integrations]
    powers[0] = np.inf if integrations else 1.0
    return np.asarray((2 * np.pi * fs / nperseg) ** (-2 * integrations) / powers)


def velocity_rms(acceleration: ArrayLike, fs: float, *, band: Band = ISO_BAND) -> Real:
    """Velocity in the ISO band: vibration severity.

    Parameters
    ----------
    acceleration : array_like, shape (..., n_samples)
        Acceleration of the housing [m/s^2].
    fs : float
        Sample rate [Hz].
    band : tuple of float
        Lower and upper edge [Hz], see `iso_band`.

    Returns
    -------
    ndarray, shape (...)
        Rms [m/s]; 0 for a constant signal. NaN gives NaN.

    Raises
    ------
    ValueError
        As for `band_rms`.

    Notes
    -----
    See `band_rms` for the method and its bounds. ISO 2954 requires of an instrument 10 % inside the
    band and half the power at its edges; here the edges are sharp to within one line.

    References
    ----------
    ISO 20816-1:2016, "Mechanical vibration: measurement and evaluation of machine vibration, part
    1: general guidelines"; ISO 2954:2012, "Requirements for instruments for measuring vibration
    severity".

    Examples
    --------
    >>> import numpy as np
    >>> tone = 2 * np.pi * 50 * 4e-3 * np.sqrt(2) * np.cos(2 * np.pi * 50 * np.arange(5120) / 5120)
    >>> round(float(velocity_rms(tone, 5120.0)), 6)
    0.004
    """
    return band_rms(acceleration, fs, band, integrations=1)


def _check(n_samples: int, fs: float, band: Band, periods: float) -> None:
    """Refuse bands that the sample rate or the duration does not allow."""
    low, high = band
    faults = []
    if fault := rate_fault(fs):
        faults.append(fault)
    if not 0 < low < high:
        faults.append(f"low = {low} Hz must be > 0 and < high = {high} Hz; lower it or raise high")
    if high > fs / 2:
        faults.append(f"high = {high} Hz must be <= fs / 2 = {fs / 2} Hz; sample faster, lower it")
    if not faults and n_samples * low < periods * fs:
        faults.append(
            f"duration = {n_samples / fs:.6g} s must be >= {periods / low:.6g} s, {periods:g} "
            f"periods of low = {low} Hz; record longer or raise low"
        )
    if faults:
        raise ValueError("; ".join(faults))


# --- zones


@dataclass(frozen=True, kw_only=True)
class MachineKind:
    """Boundaries between the zones of one kind of machine.

    Parameters
    ----------
    velocity_mm_s : tuple of float
        Rms between A and B, B and C, C and D [mm/s], as printed in the standard.
    displacement_um : tuple of float, optional
        The same for displacement [um], if the standard gives it.
    standard : str
        Source of the boundaries.
    machine : str
        Machines covered.
    reciprocating : bool
        Whether the band starts at 2 Hz at any speed.
    confidence : float
        Probability that the standard gives exactly these figures [-]: they were taken from
        secondary sources. Check those below 0.9 before relying on them in a contract.
    """

    velocity_mm_s: tuple[float, float, float]
    displacement_um: tuple[float, float, float] | None = None
    standard: str
    machine: str
    reciprocating: bool = False
    confidence: float


ZONES = "ABCD"
"""Letters of the zones 0 to 3: new; acceptable for long-term operation; acceptable for a limited
time; damaging."""

_PART_3 = "ISO 20816-3:2022 (10816-3:2009)"
_PART_6 = "ISO 10816-6:1995, read by classes"
_PART_7 = "ISO 10816-7:2009"
_PART_8 = "ISO 20816-8:2018"


def _industrial(
    group: int, support: str, velocity: tuple[float, float, float], um: tuple[float, float, float]
) -> MachineKind:
    size = {1: "above 300 kW or shaft height from 315 mm", 2: "15 to 300 kW"}[group]
    return MachineKind(
        velocity_mm_s=velocity,
        displacement_um=um,
        standard=_PART_3,
        machine=f"industrial machine, {size}, on a {support} support",
        confidence=0.95,
    )


def _pump(category: str, size: str, velocity: tuple[float, float, float]) -> MachineKind:
    return MachineKind(
        velocity_mm_s=velocity,
        standard=_PART_7,
        machine=f"rotodynamic pump of category {category}, {size} 200 kW",
        confidence=0.85,
    )


def _compressor(place: str, velocity: tuple[float, float, float]) -> MachineKind:
    return MachineKind(
        velocity_mm_s=velocity,
        standard=_PART_8,
        machine=f"reciprocating compressor, {place}",
        reciprocating=True,
        confidence=0.85,
    )


_GRADES_MM_S = (4.46, 7.07, 11.2, 17.8, 28.2, 44.6, 70.7)
_GRADES_UM = (71.0, 113.0, 178.0, 283.0, 448.0, 710.0, 1125.0)


def _reciprocating(number: int) -> MachineKind:
    """Class of part 6: three adjacent grades, starting one higher with each class."""
    velocity, um = _GRADES_MM_S[number - 1 :], _GRADES_UM[number - 1 :]
    return MachineKind(
        velocity_mm_s=(velocity[0], velocity[1], velocity[2]),
        displacement_um=(um[0], um[1], um[2]),
        standard=_PART_6,
        machine=f"reciprocating machine above 100 kW of class {number}",
        reciprocating=True,
        confidence=0.75,
    )


KINDS: Mapping[str, MachineKind] = MappingProxyType(
    {
        "industrial-1-rigid": _industrial(1, "rigid", (2.3, 4.5, 7.1), (29, 57, 90)),
        "industrial-1-flexible": _industrial(1, "flexible", (3.5, 7.1, 11.0), (45, 90, 140)),
        "industrial-2-rigid": _industrial(2, "rigid", (1.4, 2.8, 4.5), (22, 45, 71)),
        "industrial-2-flexible": _industrial(2, "flexible", (2.3, 4.5, 7.1), (37, 71, 113)),
        "pump-1-small": _pump("I", "up to", (2.5, 4.0, 6.6)),
        "pump-1-large": _pump("I", "above", (3.5, 5.0, 7.6)),
        "pump-2-small": _pump("II", "up to", (3.2, 5.1, 8.5)),
        "pump-2-large": _pump("II", "above", (4.2, 6.1, 9.5)),
        **{f"reciprocating-{number}": _reciprocating(number) for number in range(1, 6)},
        "compressor-foundation": _compressor("foundation", (2.0, 3.0, 4.5)),
        "compressor-frame": _compressor("frame", (5.3, 8.0, 12.0)),
        "compressor-cylinder-lateral": _compressor("cylinder, lateral", (8.7, 13.0, 19.5)),
        "compressor-cylinder-axial": _compressor("cylinder, along the rod", (10.7, 16.0, 24.0)),
        "compressor-piping": _compressor("dampers and piping", (12.7, 19.0, 28.5)),
    }
)
"""Kinds of machine by name. For a reciprocating pump, parts 6 and 8 apply by analogy only."""


def machine_kind(name: str) -> MachineKind:
    """Kind of machine by its name.

    Parameters
    ----------
    name : str
        Key of `KINDS`.

    Returns
    -------
    MachineKind
        Its boundaries.

    Raises
    ------
    ValueError
        If there is no kind of that name.

    Examples
    --------
    >>> machine_kind("pump-1-small").velocity_mm_s
    (2.5, 4.0, 6.6)
    """
    if name in KINDS:
        return KINDS[name]
    near = difflib.get_close_matches(name, KINDS, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    raise ValueError(f"kind = {name!r} must be one of {', '.join(KINDS)}{hint}")


def iso_band(kind: str, speed_hz: float | None = None) -> Band:
    """Band in which the severity of a kind of machine is measured.

    Parameters
    ----------
    kind : str
        Key of `KINDS`.
    speed_hz : float, optional
        Shaft speed [Hz], required for a rotating machine.

    Returns
    -------
    tuple of float
        10 to 1000 Hz; 2 to 1000 Hz below 600 rpm and for reciprocating machines.

    Raises
    ------
    ValueError
        For an unknown kind, or a rotating machine without a speed above 0.

    Examples
    --------
    >>> iso_band("industrial-2-rigid", 25.0), iso_band("industrial-2-rigid", 5.0)
    ((10.0, 1000.0), (2.0, 1000.0))
    """
    if machine_kind(kind).reciprocating:
        return SLOW_ISO_BAND
    if speed_hz is None or not speed_hz > 0:
        raise ValueError(f"speed_hz = {speed_hz} Hz must be > 0 to choose the band; give the speed")
    return SLOW_ISO_BAND if speed_hz < SLOW_SPEED_HZ else ISO_BAND


def zone(
    velocity: ArrayLike, kind: str, *, displacement: ArrayLike | None = None
) -> NDArray[np.intp]:
    """Zone of a vibration severity.

    Parameters
    ----------
    velocity : array_like, shape (...)
        Rms in the band of the kind [m/s], as from `velocity_rms`.
    kind : str
        Machine, a key of `KINDS`; it cannot be inferred from the signal.
    displacement : array_like, shape (...), optional
        Rms in the same band [m]; the worse of the two zones counts.

    Returns
    -------
    ndarray of int, shape (...)
        0 to 3, indices into `ZONES`; a value on a boundary is in the better zone.

    Raises
    ------
    ValueError
        For an unknown kind, a value that is negative or not finite, or a displacement if the
        standard gives no boundaries for it.

    References
    ----------
    ISO 20816-3:2022; ISO 10816-6:1995; ISO 10816-7:2009; ISO 20816-8:2018; see `KINDS`.

    Examples
    --------
    >>> "".join(ZONES[i] for i in zone([2e-3, 4e-3, 7e-3, 8e-3], "industrial-1-rigid"))
    'ABCD'
    """
    chosen = machine_kind(kind)
    found = _place(velocity, chosen.velocity_mm_s, 1e3, "velocity", "m/s")
    if displacement is None:
        return found
    if chosen.displacement_um is None:
        raise ValueError(f"displacement has no boundaries in {chosen.standard}; leave it out")
    return np.maximum(found, _place(displacement, chosen.displacement_um, 1e6, "displacement", "m"))


def _place(
    values: ArrayLike, boundaries: tuple[float, float, float], scale: float, name: str, unit: str
) -> NDArray[np.intp]:
    """Number of boundaries that each value exceeds."""
    size = np.asarray(values, dtype=np.float64)
    wrong = size[~((size >= 0) & (size < np.inf))]
    if wrong.size:
        raise ValueError(f"{name} = {wrong[0]} {unit} must be >= 0 and finite; repair the signal")
    # A printed boundary of 4.5 mm/s need not equal the float 0.0045: compare to six digits.
    edges = np.asarray(boundaries) / scale * (1 + 1e-6)
    return np.asarray(np.searchsorted(edges, size, side="left"))
