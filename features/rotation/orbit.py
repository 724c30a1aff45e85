"""Shaft orbits from two displacement probes: filtered orbits, full spectrum, whirl, centreline.

The two probes are read as one complex displacement ``z = x + j y``. The first probe looks at the
shaft 45 degrees ahead of the x axis and the second one 45 degrees behind it, ahead meaning in the
direction of rotation: forward precession then turns the way the shaft does.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.fft import fft
from ..signal.rate import check_rate
from .angle_resample import angular_resample, synchronous_average, synchronous_residual
from .order import order_amplitudes

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

PROBE_ANGLES = (math.pi / 4, -math.pi / 4)
"""Of the first and the second probe, from the x axis in the direction of rotation [rad]."""

WHIRL_BAND = (0.25, 0.75)
"""Where oil whirl is looked for [orders]: it turns at a little less than half the speed."""

PROXIMITY_SENSITIVITY = -7874.0
"""Change of the gap voltage of a usual eddy-current probe with its gap [V/m]: -200 mV a mil, API
670."""

_LEAST_ANGLE = math.radians(5.0)  # between probes: a smaller one multiplies their noise by 11


def displacement(
    first: ArrayLike, second: ArrayLike, *, angles: tuple[float, float] = PROBE_ANGLES
) -> Complex:
    """Displacement of the shaft from the readings of two probes.

    Parameters
    ----------
    first, second : array_like, shape (..., n_samples)
        Motion towards each probe [any unit of length].
    angles : tuple of float
        Directions of the probes, from the x axis in the direction of rotation [rad].

    Returns
    -------
    ndarray, shape (..., n_samples)
        ``x + j y`` [unit of the probes].

    Raises
    ------
    ValueError
        If the probes look along nearly the same line, or their shapes differ.

    Notes
    -----
    Solves ``x cos(a_i) + y sin(a_i) = d_i``. Exact for a shaft of large radius compared with its
    motion; the curvature adds ``|z|^2 / (2 R)``, below 0.1 % in any bearing.

    Examples
    --------
    >>> first, second = displacement([1.0], [1.0]), displacement([1.0], [-1.0])
    >>> complex(first[0].round(6)), complex(second[0].round(6))
    ((1.414214+0j), 1.414214j)
    """
    one, other = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if one.shape != other.shape:
        raise ValueError(f"probes have shapes {one.shape} and {other.shape}, must be equal; cut")
    between = math.remainder(angles[0] - angles[1], math.pi)
    if abs(between) < _LEAST_ANGLE:
        raise ValueError(
            f"angle between the probes = {math.degrees(between):.3g} deg must be >= "
            f"{math.degrees(_LEAST_ANGLE):.3g} deg off one line; choose probes at right angles"
        )
    turn = math.sin(angles[1] - angles[0])
    x = (one * math.sin(angles[1]) - other * math.sin(angles[0])) / turn
    y = (other * math.cos(angles[0]) - one * math.cos(angles[1])) / turn
    return np.asarray(x + 1j * y)


def probe_angles(
    first_deg: float, second_deg: float, *, clockwise: bool = False
) -> tuple[float, float]:
    """Directions of two probes as drawings give them, for `displacement`.

    Parameters
    ----------
    first_deg, second_deg : float
        Where the probes are mounted, from the top to the right, seen from the driver [deg]: 45
        for "45 degrees right", -45 for "45 degrees left".
    clockwise : bool
        Whether the shaft turns clockwise, seen from the driver.

    Returns
    -------
    tuple of float
        Angles from the x axis in the direction of rotation [rad], y being up: x points to the
        right of a shaft that turns counter-clockwise, to the left of one that turns clockwise.

    Raises
    ------
    ValueError
        If an angle is not finite.

    References
    ----------
    API Standard 670, "Machinery Protection Systems", 5th ed. (2014), section on radial probes.

    Examples
    --------
    >>> [round(math.degrees(angle), 6) for angle in probe_angles(-45, 45)]
    [135.0, 45.0]
    >>> [round(math.degrees(angle), 6) for angle in probe_angles(-45, 45, clockwise=True)]
    [45.0, 135.0]
    """
    sign = 1.0 if clockwise else -1.0
    if not (math.isfinite(first_deg) and math.isfinite(second_deg)):
        raise ValueError(f"probe angles = {first_deg}, {second_deg} deg must be finite; give both")
    return math.radians(90 + sign * first_deg), math.radians(90 + sign * second_deg)


def gap_displacement(
    gap_v: ArrayLike, *, rest_v: float, sensitivity: float = PROXIMITY_SENSITIVITY
) -> Float:
    """Motion of the shaft towards a proximity probe, from its gap voltage.

    Parameters
    ----------
    gap_v : array_like
        Voltage of the probe, its direct part included [V].
    rest_v : float
        Voltage with the shaft at the reference position [V], say at rest in the bearing.
    sensitivity : float
        Change of the voltage with a growing gap [V/m]: negative for an eddy-current probe on a
        negative supply.

    Returns
    -------
    ndarray
        ``(rest_v - gap_v) / sensitivity`` [m], positive towards the probe.

    Raises
    ------
    ValueError
        If the sensitivity is 0 or not finite.

    Examples
    --------
    >>> gap_displacement([-9.0, -10.0], rest_v=-9.0, sensitivity=-8000.0).tolist()
    [0.0, -0.000125]
    """
    if not (math.isfinite(sensitivity) and sensitivity != 0):
        raise ValueError(
            f"sensitivity = {sensitivity} V/m must be finite and not 0; -7874 is usual"
        )
    volts = np.asarray(gap_v, dtype=np.float64)
    # Zero minus something, not minus zero.
    return np.asarray((rest_v - volts) / sensitivity + 0.0)


# --- one order


def filtered_orbits(
    z: ArrayLike,
    phase: ArrayLike,
    orders: ArrayLike,
    *,
    slow_roll: tuple[ArrayLike, ArrayLike] | None = None,
) -> tuple[Complex, Complex]:
    """Forward and backward vectors of the orbits filtered at shaft orders.

    Parameters
    ----------
    z : array_like, shape (n_samples,)
        ``x + j y`` [any unit].
    phase : array_like, shape (n_samples,)
        Shaft phase [rev], as from `order.shaft_phase`; 0 at the keyphasor mark.
    orders : array_like, shape (n_orders,)
        Orders [-], > 0.
    slow_roll : tuple of array_like, shape (n_orders,) each, optional
        Forward and backward vectors of the same orders while the shaft turns so slowly that it
        does not vibrate (below a tenth of its first critical speed), from this function and the
        same pulses: the run-out of the surface, taken off.

    Returns
    -------
    forward, backward : ndarray, shape (n_orders,)
        ``R+`` and ``R-`` of ``z = R+ exp(2j pi k phase) + R- exp(-2j pi k phase)`` [unit of z].

    Raises
    ------
    ValueError
        As `order.order_amplitudes`, or if `slow_roll` has other orders.

    Notes
    -----
    With the complex amplitudes A_x and A_y of the two coordinates, ``R+ = (A_x + j A_y) / 2`` and
    ``R- = conj(A_x - j A_y) / 2``.

    References
    ----------
    D. E. Bently, C. T. Hatch, B. Grissom, "Fundamentals of Rotating Machinery Diagnostics",
    Bently Pressurized Bearing Press (2002), chapters 5 and 8.

    Examples
    --------
    >>> phase = np.arange(400) / 100
    >>> z = 3 * np.cos(2 * np.pi * phase) + 1j * np.sin(2 * np.pi * phase)
    >>> forward, backward = filtered_orbits(z, phase, [1.0])
    >>> abs(forward).round(6).tolist(), abs(backward).round(6).tolist()
    ([2.0], [1.0])
    """
    path = np.asarray(z, dtype=np.complex128)
    amplitudes = order_amplitudes(np.stack([path.real, path.imag]), phase, orders)
    along, across = amplitudes.astype(np.complex128)
    forward, backward = (along + 1j * across) / 2, np.conj(along - 1j * across) / 2
    if slow_roll is None:
        return forward, backward
    ahead, behind = (np.asarray(vector, dtype=np.complex128) for vector in slow_roll)
    if not ahead.shape == behind.shape == forward.shape:
        raise ValueError(
            f"slow_roll has shapes {ahead.shape} and {behind.shape}, must be {forward.shape}; "
            "filter the slow roll at the same orders"
        )
    return forward - ahead, backward - behind


def orbit_path(forward: complex, backward: complex, angle: ArrayLike) -> Complex:
    """Points of a filtered orbit.

    Parameters
    ----------
    forward, backward : complex
        From `filtered_orbits` [any unit].
    angle : array_like, shape (n,)
        Order times shaft angle [rad].

    Returns
    -------
    ndarray, shape (n,)
        ``x + j y`` [unit of the vectors].

    Examples
    --------
    >>> orbit_path(2, 1, [0.0, np.pi / 2]).round(6).tolist()
    [(3+0j), 1j]
    """
    turn = np.exp(1j * np.asarray(angle, dtype=np.float64))
    return np.asarray(forward * turn + backward / turn)


def semi_axes(forward: ArrayLike, backward: ArrayLike) -> tuple[Float, Float]:
    """Semi-axes of elliptic orbits.

    Parameters
    ----------
    forward, backward : array_like
        Complex, from `filtered_orbits` [any unit].

    Returns
    -------
    major, minor : ndarray
        ``|R+| + |R-|`` and ``||R+| - |R-||`` [unit of the vectors].

    Examples
    --------
    >>> [float(axis) for axis in semi_axes(2 + 0j, 1j)]
    [3.0, 1.0]
    """
    ahead, behind = np.abs(forward), np.abs(backward)
    return np.asarray(ahead + behind), np.asarray(np.abs(ahead - behind))


def inclination(forward: ArrayLike, backward: ArrayLike) -> Float:
    """Direction of the major axis of elliptic orbits.

    Parameters
    ----------
    forward, backward : array_like
        Complex, from `filtered_orbits`.

    Returns
    -------
    ndarray
        From the x axis in the direction of rotation [rad], in (-pi/2, pi/2]; meaningless for a
        circle, where one of the vectors is 0.

    Examples
    --------
    >>> round(float(inclination(2j, 1j)), 6)
    1.570796
    """
    return np.asarray(np.angle(np.asarray(forward) * np.asarray(backward)) / 2)


def ellipticity(forward: ArrayLike, backward: ArrayLike) -> Float:
    """Minor over major axis: 1 of a circle, 0 of a line, 0 of a point.

    Parameters
    ----------
    forward, backward : array_like
        Complex, from `filtered_orbits`.

    Examples
    --------
    >>> round(float(ellipticity(2, 1)), 6)
    0.333333
    """
    major, minor = semi_axes(forward, backward)
    return np.asarray(minor / np.where(major > 0, major, 1.0))


def precession(forward: ArrayLike, backward: ArrayLike) -> Float:
    """Shape and direction index of elliptic orbits.

    Parameters
    ----------
    forward, backward : array_like
        Complex, from `filtered_orbits`.

    Returns
    -------
    ndarray
        ``(|R+| - |R-|) / (|R+| + |R-|)``: 1 a forward circle, 0 a line (or a point), -1 a
        backward circle.

    References
    ----------
    C.-W. Lee, Y.-S. Han, "The directional Wigner distribution and its applications",
    J. Sound Vib. 216 (1998) 585-600.

    Examples
    --------
    >>> precession([2, 1, 0], [0, 1, 2]).tolist()
    [1.0, 0.0, -1.0]
    """
    ahead, behind = np.abs(forward), np.abs(backward)
    total = ahead + behind
    return np.asarray((ahead - behind) / np.where(total > 0, total, 1.0))


# --- run-out


def runout(
    readings: ArrayLike, phase: ArrayLike, *, points_per_revolution: int = 128
) -> NDArray[Any]:
    """What a probe reads of the surface alone: shape and electrical faults, over one revolution.

    Parameters
    ----------
    readings : array_like, shape (..., n_samples)
        Probes, or ``x + j y``, while the shaft turns too slowly to vibrate [any unit].
    phase : array_like, shape (n_samples,)
        Shaft phase [rev]; 0 at the keyphasor mark.
    points_per_revolution : int
        Points in a revolution; orders up to 0.4 of it are kept.

    Returns
    -------
    ndarray, shape (..., points_per_revolution)
        Mean over the revolutions, its own mean removed so that positions stay [unit of readings].

    Raises
    ------
    ValueError
        As `resample.angular_resample`, or if less than one revolution is left.

    Notes
    -----
    Noise falls with the root of the number of revolutions.

    References
    ----------
    API Standard 670, "Machinery Protection Systems", 5th ed. (2014): run-out and its compensation.

    Examples
    --------
    >>> phase = np.arange(1000) / 200
    >>> scratch = runout(3 + np.cos(4 * np.pi * phase), phase)
    >>> bool(abs(scratch - np.cos(4 * np.pi * np.arange(128) / 128)).max() < 1e-4)
    True
    """
    angle = angular_resample(readings, phase, points_per_revolution=points_per_revolution)
    average = synchronous_average(angle)
    return np.asarray(average - average.mean(axis=-1, keepdims=True))


def subtract_runout(readings: ArrayLike, phase: ArrayLike, waveform: ArrayLike) -> NDArray[Any]:
    """Readings of a probe without the run-out of the surface below it.

    Parameters
    ----------
    readings : array_like, shape (..., n_samples)
        Probes, or ``x + j y`` [any unit].
    phase : array_like, shape (n_samples,)
        Shaft phase [rev], counted from the same mark as that of the run-out.
    waveform : array_like, shape (..., points_per_revolution)
        From `runout` of the same probes [unit of readings].

    Returns
    -------
    ndarray, shape (..., n_samples)
        Motion of the shaft [unit of readings].

    Raises
    ------
    ValueError
        If lengths differ.

    Notes
    -----
    Assumes that the probe sees the same track of the shaft: an axial float moves it.

    Examples
    --------
    >>> phase = np.arange(1000) / 200
    >>> scratch = np.cos(4 * np.pi * np.arange(128) / 128)
    >>> rest = subtract_runout(3 + np.cos(4 * np.pi * phase), phase, scratch)
    >>> bool(abs(rest - 3).max() < 1e-4)
    True
    """
    return synchronous_residual(readings, phase, waveform)


# --- the whole record


def centreline(z: ArrayLike, *, rest: complex = 0.0) -> complex:
    """Mean position of the shaft, the point of a shaft centreline plot.

    Parameters
    ----------
    z : array_like, shape (n_samples,)
        ``x + j y`` [any unit].
    rest : complex
        Where in the bearing the shaft was when the probes read 0 [unit of z], from the middle:
        ``-1j * radial_clearance`` for a shaft at rest at the bottom, with y up.

    Returns
    -------
    complex
        Its absolute value is the mean eccentricity [unit of z], its argument the attitude, from
        the x axis in the direction of rotation.

    Examples
    --------
    >>> centreline([1 + 2j, 3 + 2j])
    (2+2j)
    >>> centreline([1 + 2j, 3 + 2j], rest=-5j)
    (2-3j)
    """
    return complex(np.mean(np.asarray(z, dtype=np.complex128)) + rest)


def largest_excursion(z: ArrayLike) -> float:
    """Largest distance of the orbit from its mean position, S_max of ISO 20816-1.

    Parameters
    ----------
    z : array_like, shape (n_samples,)
        ``x + j y`` [any unit].

    Examples
    --------
    >>> largest_excursion([1, 1j, -1, -1j])
    1.0
    """
    path = np.asarray(z, dtype=np.complex128)
    return float(np.abs(path - path.mean()).max())


def full_spectrum(z: ArrayLike, fs: float) -> tuple[Float, Complex]:
    """Two-sided spectrum of an orbit: forward at positive, backward at negative frequencies.

    Parameters
    ----------
    z : array_like, shape (n_samples,)
        ``x + j y`` [any unit].
    fs : float
        Sample rate [Hz].

    Returns
    -------
    frequency : ndarray, shape (n_samples,)
        Rising [Hz].
    vector : ndarray, shape (n_samples,)
        Two-sided coefficients [unit of z]: ``x = a cos wt, y = b sin wt`` gives
        ``R+ = (a + b) / 2`` and ``R- = (a - b) / 2`` where w is a line.

    Raises
    ------
    ValueError
        If there is no sample.

    Notes
    -----
    Mean removed, Hann window divided by its mean. A tone between two lines reads up to 15 % low
    (1.4 dB), as with any Hann window.

    References
    ----------
    P. Goldman, A. Muszynska, "Application of full spectrum to rotating machinery diagnostics",
    Orbit 20 (1) (1999) 17-21.

    Examples
    --------
    >>> t = np.arange(100) / 100
    >>> z = 3 * np.cos(20 * np.pi * t) + 1j * np.sin(20 * np.pi * t)
    >>> frequency, vector = full_spectrum(z, 100)
    >>> [round(float(abs(vector[frequency == f][0])), 6) for f in (10, -10)]
    [2.0, 1.0]
    """
    check_rate(fs)
    path = np.asarray(z, dtype=np.complex128)
    if path.ndim != 1 or path.size == 0:
        raise ValueError(f"z has shape {path.shape}, must be (n_samples >= 1,); give one orbit")
    window = _hann(path.size)
    vector = fft((path - path.mean()) * window) / window.sum()
    frequency = np.fft.fftfreq(path.size, 1 / fs)
    return np.fft.fftshift(frequency), np.fft.fftshift(vector)


def _hann(n: int) -> Float:
    """Periodic Hann window; of one sample, one."""
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n) if n > 1 else np.ones(1)


def whirl(
    z: ArrayLike, fs: float, speed_hz: float, *, band: tuple[float, float] = WHIRL_BAND
) -> tuple[float, float]:
    """Strongest forward motion below the shaft speed.

    Parameters
    ----------
    z : array_like, shape (n_samples,)
        ``x + j y`` [any unit].
    fs : float
        Sample rate [Hz].
    speed_hz : float
        Shaft speed [Hz].
    band : tuple of float
        Where it is looked for [orders].

    Returns
    -------
    ratio : float
        Its frequency over the speed [-]; that of the loudest noise where nothing whirls. 0 of an
        orbit that stands still.
    radius : float
        Of its circle [unit of z].

    Raises
    ------
    ValueError
        If the record has no two spectral lines within the band.

    Notes
    -----
    Frequency and radius from the ratio of the two largest lines of a Hann window: exact for a
    steady tone alone (Grandke). The record should hold 20 revolutions, so that the leakage of the
    synchronous orbit, which falls with the third power of the distance in lines, is below 0.3 % at
    the edge of the band and below 0.04 % at half the speed.

    References
    ----------
    T. Grandke, "Interpolation algorithms for discrete Fourier transforms of weighted signals",
    IEEE Trans. Instrum. Meas. 32 (1983) 350-355, doi:10.1109/TIM.1983.4315077.

    Examples
    --------
    >>> t = np.arange(2000) / 2000
    >>> ratio, radius = whirl(0.3 * np.exp(2j * np.pi * 23.7 * t), 2000.0, 50.0)
    >>> round(ratio, 4), round(radius, 4)
    (0.474, 0.3)
    """
    check_rate(fs)
    frequency, vector = full_spectrum(z, fs)
    inside = np.flatnonzero((frequency >= band[0] * speed_hz) & (frequency <= band[1] * speed_hz))
    if inside.size < 2:
        raise ValueError(
            f"record has {inside.size} spectral lines between {band[0] * speed_hz:.4g} and "
            f"{band[1] * speed_hz:.4g} Hz, must have >= 2; record longer"
        )
    size = np.abs(vector)
    top = int(inside[np.argmax(size[inside])])
    if size[top] == 0:
        return 0.0, 0.0
    side = 1 if size[(top + 1) % size.size] >= size[top - 1] else -1
    beside = size[(top + side) % size.size] / size[top]
    shift = (2 * beside - 1) / (1 + beside)  # lines, of a Hann window
    shift = min(max(shift, 0.0), 0.5)
    spacing = fs / size.size
    return float(frequency[top] + side * shift * spacing) / speed_hz, float(
        size[top] * _hann_loss(shift)
    )


def _hann_loss(shift: float) -> float:
    """What a Hann line reads low `shift` lines off a tone, as the factor that mends it."""
    if shift == 0:
        return 1.0
    return math.pi * shift * (1 - shift**2) / math.sin(math.pi * shift)


def keyphasor_marks(z: ArrayLike, fs: float, pulses: ArrayLike) -> Complex:
    """Where the shaft is at each tacho pulse: the dots on an orbit plot.

    Parameters
    ----------
    z : array_like, shape (n_samples,)
        ``x + j y`` [any unit].
    fs : float
        Sample rate [Hz].
    pulses : array_like, shape (n_pulses,)
        Times of the pulses [s], as from `order.pulse_times`.

    Returns
    -------
    ndarray, shape (n_pulses,)
        Interpolated linearly [unit of z].

    Examples
    --------
    >>> keyphasor_marks([0, 2, 4j], 1.0, [0.5, 1.0]).tolist()
    [(1+0j), (2+0j)]
    """
    check_rate(fs)
    path = np.asarray(z, dtype=np.complex128)
    time = np.arange(path.size) / fs
    return np.asarray(np.interp(np.asarray(pulses, dtype=np.float64), time, path))
