"""Classical steppers of ``x'' = a(x, x')``, each a plain function, and their limits.

Recordings do not use them. They are compared with the machines' own methods
(:mod:`.mechanism.crank_step` cuts its Runge-Kutta steps where a contact changes,
:mod:`.journal.orbit_step` has RODAS), and show where the methods of the source papers fail.

A stepper takes arrays of one shape, so that a whole plane of steps and stiffnesses advances at
once. The limits are those of the damped oscillator ``x'' + 2 zeta omega x' + omega^2 x = 0``.
"""

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Acceleration = Callable[[Array, Array], Array]
"""``a(x, v)``, elementwise."""
Pair = tuple[Array, Array]
"""Position and velocity."""

_NEWTON_STEPS = 12  # a linear force takes one, a kink up to three; otherwise it cycles
_NEWTON_TOLERANCE = 1e-9  # of the acceleration
_GROWTH = 1e6  # of a free motion: beyond any transient growth of a stable method
_PATIENCE = 4.0  # times the longest possible contact


# --- steppers


def semi_implicit_euler(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """Velocity first, then position with the new velocity: order 1, the method of the papers.

    Parameters
    ----------
    x, v : numpy.ndarray
        Position and velocity.
    acceleration : callable
        ``a(x, v)``.
    h : numpy.ndarray
        Step.

    Returns
    -------
    tuple of numpy.ndarray
        Position and velocity after the step.
    """
    v = v + h * acceleration(x, v)
    return x + h * v, v


def explicit_midpoint(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """Slope in the middle of the step: order 2. Arguments as in :func:`semi_implicit_euler`."""
    middle = v + 0.5 * h * acceleration(x, v)
    return x + h * middle, v + h * acceleration(x + 0.5 * h * v, middle)


def velocity_verlet(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """Half kick, drift, half kick: order 2 without damping, 1 with damping.

    Damping uses the velocity before the kick. Arguments as in :func:`semi_implicit_euler`.
    """
    half = v + 0.5 * h * acceleration(x, v)
    x = x + h * half
    return x, half + 0.5 * h * acceleration(x, half)


def runge_kutta_4(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """The classical method: order 4. Arguments as in :func:`semi_implicit_euler`."""
    a1 = acceleration(x, v)
    v2 = v + 0.5 * h * a1
    a2 = acceleration(x + 0.5 * h * v, v2)
    v3 = v + 0.5 * h * a2
    a3 = acceleration(x + 0.5 * h * v2, v3)
    v4 = v + h * a3
    a4 = acceleration(x + h * v3, v4)
    return x + h * (v + 2 * v2 + 2 * v3 + v4) / 6, v + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6


def implicit_trapezoid(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """Mean of both ends (Newmark's method with 1/4 and 1/2): order 2, stable at any step.

    Newton's method for the acceleration at the end; NaN if it does not converge. Arguments as in
    :func:`semi_implicit_euler`.
    """
    start = acceleration(x, v)

    def end(a: Array) -> Pair:
        return x + h * v + 0.25 * h * h * (start + a), v + 0.5 * h * (start + a)

    a = start
    left = np.full_like(a, np.inf)
    for _ in range(_NEWTON_STEPS):
        off = acceleration(*end(a)) - a
        shift = 1e-6 * (np.abs(a) + np.abs(off)) + 1e-30
        slope = 1 - (acceleration(*end(a + shift)) - a - off) / shift
        left, a = np.abs(off), a + off / slope
        if np.all(left <= _NEWTON_TOLERANCE * np.abs(a)):
            break
    settled = np.abs(acceleration(*end(a)) - a) <= 1e-6 * (np.abs(a) + np.abs(start)) + 1e-30
    x_end, v_end = end(a)
    return np.where(settled, x_end, np.nan), np.where(settled, v_end, np.nan)


# --- limits in theory


def euler_limit(damping_ratio: float) -> float:
    """Largest stable step of :func:`semi_implicit_euler` times omega.

    Notes
    -----
    The matrix of a step has the determinant ``1 - 2 zeta z`` and the trace
    ``2 - 2 zeta z - z^2``, z the step times omega. Jury's condition ``1 + trace + determinant > 0``
    is the binding one: ``z < 2 (sqrt(1 + zeta^2) - zeta)``.

    Examples
    --------
    >>> [round(euler_limit(zeta), 4) for zeta in (0.0, 0.75, 2.0)]
    [2.0, 1.0, 0.4721]
    """
    return 2 * (math.hypot(1, damping_ratio) - damping_ratio)


def verlet_limit(damping_ratio: float) -> float:
    """Largest stable step of :func:`velocity_verlet` times omega.

    Notes
    -----
    With ``p = zeta z`` the determinant is ``(1 - p)^2`` and the trace
    ``1 + (1 - p)^2 - z^2 (2 - p) / 2``, so that ``z^2 (2 - p) < 4 (1 + (1 - p)^2)`` and ``p < 2``:
    the stricter one applies.

    Examples
    --------
    >>> round(verlet_limit(0.0), 4), round(verlet_limit(2.0), 4)
    (2.0, 1.0)
    """
    zeta = damping_ratio
    # zeta z^3 - 2 z^2 + 4 zeta^2 z^2 - 8 zeta z + 8 = 0, from the first condition
    roots = np.roots([zeta, 4 * zeta * zeta - 2, -8 * zeta, 8]) if zeta > 0 else np.array([2.0])
    rising = [float(r.real) for r in roots if abs(r.imag) < 1e-9 * abs(r) and r.real > 0]
    return min([*rising, 2 / zeta if zeta > 0 else math.inf])


def runge_kutta_limit(damping_ratio: float, order: int = 4) -> float:
    """Largest stable step of :func:`runge_kutta_4` times omega, or of the midpoint (order 2).

    Notes
    -----
    Each step multiplies a mode of rate s by ``1 + hs + ... + (hs)^order / order!``. The limit is
    where this factor leaves the unit circle on the ray of the oscillator's faster mode:
    ``2 sqrt 2`` without damping, 2.785 over the faster decay rate at damping far above critical.
    The limit of the midpoint rule is zero without damping.

    Examples
    --------
    >>> round(runge_kutta_limit(0.0), 3), round(runge_kutta_limit(1.0), 3)
    (2.828, 2.785)
    >>> round(runge_kutta_limit(1.0, order=2), 3)
    2.0
    """
    if order == 2 and damping_ratio == 0:
        return 0.0  # grows by sqrt(1 + z^4 / 4), which rounding hides
    mode = -complex(damping_ratio) - cmath.sqrt(damping_ratio**2 - 1)
    terms = [1 / math.factorial(n) for n in range(order, -1, -1)]
    z = np.linspace(0.0, 4.0, 40_001)[1:] / max(1.0, abs(mode))
    outside = np.abs(np.polyval(terms, z * mode)) > 1 + 1e-12
    return float(z[np.argmax(outside) - 1])


@dataclass(frozen=True, kw_only=True)
class Stepper:
    """One stepper.

    Attributes
    ----------
    name : str
    order : int
        Order of the error for a smooth motion without damping.
    step : callable
        ``(x, v, acceleration, h) -> (x, v)``.
    limit : callable
        Damping ratio -> largest stable step times omega.
    reference : str
    """

    name: str
    order: int
    step: Callable[[Array, Array, Acceleration, Array], Pair]
    limit: Callable[[float], float]
    reference: str


STEPPERS: tuple[Stepper, ...] = (
    Stepper(
        name="semi-implicit euler",
        order=1,
        step=semi_implicit_euler,
        limit=euler_limit,
        reference="Ma, Lu, Chen 2010",
    ),
    Stepper(
        name="explicit midpoint",
        order=2,
        step=explicit_midpoint,
        limit=lambda zeta: runge_kutta_limit(zeta, order=2),
        reference="Runge 1895, doi:10.1007/BF01446807",
    ),
    Stepper(
        name="velocity verlet",
        order=2,
        step=velocity_verlet,
        limit=verlet_limit,
        reference="Verlet 1967, doi:10.1103/PhysRev.159.98",
    ),
    Stepper(
        name="runge-kutta 4",
        order=4,
        step=runge_kutta_4,
        limit=runge_kutta_limit,
        reference="Hairer, Wanner 1996, section IV.2",
    ),
    Stepper(
        name="implicit trapezoid",
        order=2,
        step=implicit_trapezoid,
        limit=lambda _zeta: math.inf,
        reference="Newmark 1959, J. Eng. Mech. Div. ASCE 85(3), 67-94",
    ),
)
"""A new stepper is one row."""


# --- measured limits


def decays(
    stepper: Stepper, step: ArrayLike, omega: ArrayLike, damping_ratio: ArrayLike, n_steps: int
) -> NDArray[np.bool_]:
    """Whether a free damped oscillator stays bounded under a stepper.

    Parameters
    ----------
    stepper : Stepper
    step, omega, damping_ratio : array_like
        Step [s], circular frequency [rad/s] and damping ratio of each oscillator, with shapes that
        broadcast.
    n_steps : int
        Number of steps.

    Returns
    -------
    numpy.ndarray of bool
        True if the motion stays bounded.

    Examples
    --------
    >>> decays(STEPPERS[0], [1.9, 2.1], 1.0, 0.0, 500).tolist()
    [True, False]
    """
    h, w, zeta = (np.array(a, float) for a in np.broadcast_arrays(step, omega, damping_ratio))
    x, v = np.ones_like(h), np.zeros_like(h)
    size = np.ones_like(h)
    with np.errstate(all="ignore"):  # unbounded growth is the result
        for _ in range(n_steps):
            x, v = stepper.step(x, v, lambda p, u: -w * (w * p + 2 * zeta * u), h)
            size = np.hypot(x, v / w)
            if not np.any(size < _GROWTH):
                break
    # just below a limit the motion beats: it grows at most by the root of the number of steps
    return np.asarray(size < 2 * math.sqrt(n_steps))


# --- a bounce


def bounce(
    stepper: Stepper, step: ArrayLike, stiffness: ArrayLike, damping: ArrayLike, phase: ArrayLike
) -> Array:
    """Restitution (separation over approach speed) of a unit mass on a contact without tension.

    Parameters
    ----------
    stepper : Stepper
        Contact is detected at its own points only: no step is cut.
    step : array_like
        [s]
    stiffness, damping : array_like
        Stiffness and damping of a Kelvin-Voigt contact per mass [1/s^2], [1/s].
    phase : array_like
        Initial distance of the mass from the surface, in steps, in [0, 1).

    Returns
    -------
    numpy.ndarray
        NaN if the stepper finds no next point, or the mass does not return in time.

    Examples
    --------
    Without damping nothing is lost, except by steps that miss the instant of contact:

    >>> float(bounce(STEPPERS[0], 1e-3, 1.0, 0.0, 0.5).round(3))
    1.0
    """
    h, k, c, share = (
        np.array(a, dtype=float) for a in np.broadcast_arrays(step, stiffness, damping, phase)
    )

    def acceleration(x: Array, v: Array) -> Array:
        return np.where(x > 0, np.minimum(0.0, -k * x - c * v), 0.0)

    x, v = -share * h, np.ones_like(h)
    found = np.full_like(h, np.nan)
    # no contact of this law lasts longer than half a period without damping
    n_steps = math.ceil(_PATIENCE * math.pi * float(np.max(1 / (h * np.sqrt(k))))) + 8
    with np.errstate(all="ignore"):  # an unstable run overflows, which the result shows
        for _ in range(n_steps):
            x, v = stepper.step(x, v, acceleration, h)
            out = np.isnan(found) & (v < 0) & (acceleration(x, v) == 0)
            found[out] = -v[out]
            if not np.any(np.isnan(found) & np.isfinite(x)):
                break
    return found
