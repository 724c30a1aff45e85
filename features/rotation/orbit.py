"""Shaft orbits from two displacement probes: filtered orbits, full spectrum, whirl, centreline.

The two probes are read as one complex displacement ``z = x + j y``. The first probe is 45 degrees
ahead of the x axis and the second one 45 degrees behind it, ahead meaning in the direction of
rotation: forward precession then turns in the direction of the shaft.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.fft import fft
from ..signal.rate import check_rate
from .order import order_amplitudes

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

PROBE_ANGLES = (math.pi / 4, -math.pi / 4)
"""Angles of the first and second probe from the x axis, in the direction of rotation [rad]."""

WHIRL_BAND = (0.25, 0.75)
"""Band searched for oil whirl [orders]: whirl turns at a little less than half the speed."""

_LEAST_ANGLE = math.radians(5.0)  # between probes: a smaller angle multiplies their noise by 11


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
        If the probes are nearly parallel, or their shapes differ.

    Notes
    -----
    Solves ``x cos(a_i) + y sin(a_i) = d_i``. Exact if the radius of the shaft is large compared
    with its motion; the curvature adds ``|z|^2 / (2 R)``, below 0.1 % in any bearing.

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
        Forward and backward vectors of the same orders, from this function and the same pulses,
        while the shaft turns so slowly that it does not vibrate (below a tenth of its first
        critical speed). They are the run-out of the surface, and are subtracted.

    Returns
    -------
    forward, backward : ndarray, shape (n_orders,)
        ``R+`` and ``R-`` of ``z = R+ exp(2j pi k phase) + R- exp(-2j pi k phase)`` [unit of z].

    Raises
    ------
    ValueError
        As for `order.order_amplitudes`, or if `slow_roll` has other orders.

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
        Vectors from `filtered_orbits` [any unit].
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
        Complex vectors from `filtered_orbits` [any unit].

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
        Complex vectors from `filtered_orbits`.

    Returns
    -------
    ndarray
        Angle from the x axis in the direction of rotation [rad], in (-pi/2, pi/2]; meaningless for
        a circle, for which one of the vectors is 0.

    Examples
    --------
    >>> round(float(inclination(2j, 1j)), 6)
    1.570796
    """
    return np.asarray(np.angle(np.asarray(forward) * np.asarray(backward)) / 2)


def ellipticity(forward: ArrayLike, backward: ArrayLike) -> Float:
    """Minor over major axis: 1 for a circle, 0 for a line or a point.

    Parameters
    ----------
    forward, backward : array_like
        Complex vectors from `filtered_orbits`.

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
        Complex vectors from `filtered_orbits`.

    Returns
    -------
    ndarray
        ``(|R+| - |R-|) / (|R+| + |R-|)``: 1 for a forward circle, 0 for a line (or a point), -1 for
        a backward circle.

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


# --- the whole record


def centreline(z: ArrayLike, *, rest: complex = 0.0) -> complex:
    """Mean position of the shaft, the point of a shaft centreline plot.

    Parameters
    ----------
    z : array_like, shape (n_samples,)
        ``x + j y`` [any unit].
    rest : complex
        Position of the shaft, from the middle of the bearing, at which the probes read 0 [unit of
        z]: ``-1j * radial_clearance`` for a shaft at rest at the bottom, with y up.

    Returns
    -------
    complex
        Mean position: its absolute value is the mean eccentricity [unit of z], its argument the
        attitude angle from the x axis in the direction of rotation.

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
        Frequency, rising [Hz].
    vector : ndarray, shape (n_samples,)
        Two-sided coefficients [unit of z]: ``x = a cos wt, y = b sin wt`` gives
        ``R+ = (a + b) / 2`` and ``R- = (a - b) / 2`` if w is a line.

    Raises
    ------
    ValueError
        If there is no sample.

    Notes
    -----
    The mean is removed; the Hann window is divided by its mean. A tone between two lines reads up
    to 15 % (1.4 dB) low, as with any Hann window.

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
    """Periodic Hann window; 1 for a single sample."""
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
        Band to search [orders].

    Returns
    -------
    ratio : float
        Frequency of the motion over the speed [-]; without whirl, that of the loudest noise; 0 for
        a constant position.
    radius : float
        Radius of its circle [unit of z].

    Raises
    ------
    ValueError
        If the record has no two spectral lines within the band.

    Notes
    -----
    Frequency and radius follow from the ratio of the two largest lines of a Hann window: exact for
    a single steady tone (Grandke). The record should hold 20 revolutions, so that the leakage of
    the synchronous orbit, which falls with the third power of the distance in lines, is below 0.3 %
    at the edge of the band and below 0.04 % at half the speed.

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
    neighbour = size[(top + side) % size.size] / size[top]
    shift = (2 * neighbour - 1) / (1 + neighbour)  # lines, for a Hann window
    shift = min(max(shift, 0.0), 0.5)
    spacing = fs / size.size
    return float(frequency[top] + side * shift * spacing) / speed_hz, float(
        size[top] * _hann_loss(shift)
    )


def _hann_loss(shift: float) -> float:
    """Factor that corrects the reading of a Hann line `shift` lines away from the tone [-]."""
    if shift == 0:
        return 1.0
    return math.pi * shift * (1 - shift**2) / math.sin(math.pi * shift)


def keyphasor_marks(z: ArrayLike, fs: float, pulses: ArrayLike) -> Complex:
    """Position of the shaft at each tacho pulse: the dots on an orbit plot.

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
        Positions, interpolated linearly [unit of z].

    Examples
    --------
    >>> keyphasor_marks([0, 2, 4j], 1.0, [0.5, 1.0]).tolist()
    [(1+0j), (2+0j)]
    """
    check_rate(fs)
    path = np.asarray(z, dtype=np.complex128)
    time = np.arange(path.size) / fs
    return np.asarray(np.interp(np.asarray(pulses, dtype=np.float64), time, path))
