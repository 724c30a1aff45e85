"""The classical steppers of ``x'' = a(x, x')``, each a plain function, and where they end.

No recording is computed with them: they are measured beside the machines' own methods
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

_NEWTON_STEPS = 12  # a straight force takes one, a kink up to three; what takes more cycles
_NEWTON_TOLERANCE = 1e-9  # of the acceleration
_GROWTH = 1e6  # of a free motion: beyond any that a stable method shows on its way down
_PATIENCE = 4.0  # times the longest contact that there is


# --- steppers


def semi_implicit_euler(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """Velocity first, then position with the new velocity: order 1, the papers' method.

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
        Position and velocity a step later.
    """
    v = v + h * acceleration(x, v)
    return x + h * v, v


def explicit_midpoint(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """Slope in the middle of the step: order 2. Arguments as :func:`semi_implicit_euler`."""
    middle = v + 0.5 * h * acceleration(x, v)
    return x + h * middle, v + h * acceleration(x + 0.5 * h * v, middle)


def velocity_verlet(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """Half a kick, a drift, half a kick: order 2 without damping, 1 with.

    Damping takes the velocity before the kick. Arguments as :func:`semi_implicit_euler`.
    """
    half = v + 0.5 * h * acceleration(x, v)
    x = x + h * half
    return x, half + 0.5 * h * acceleration(x, half)


def runge_kutta_4(x: Array, v: Array, acceleration: Acceleration, h: Array) -> Pair:
    """The classical method: order 4. Arguments as :func:`semi_implicit_euler`."""
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

    Newton's method for the acceleration at the end; NaN where it does not settle. Arguments as
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
    A step multiplies by a matrix of determinant ``1 - 2 zeta z`` and trace
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
    whichever ends first.

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
    A mode of rate s is multiplied by ``1 + hs + ... + (hs)^order / order!`` a step. The limit is
    where that leaves the unit circle on the ray of the oscillator's faster mode: ``2 sqrt 2``
    without damping, 2.785 over the faster decay where damping is far beyond critical. The
    midpoint's is zero without damping.

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
        Of the error of a smooth motion without damping.
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


# --- limits as measured


def decays(
    stepper: Stepper, step: ArrayLike, omega: ArrayLike, damping_ratio: ArrayLike, n_steps: int
) -> NDArray[np.bool_]:
    """Whether a free damped oscillator stays bounded under a stepper.

    Parameters
    ----------
    stepper : Stepper
    step, omega, damping_ratio : array_like
        Step [s], circular frequency [rad/s] and damping ratio of each oscillator, of shapes that
        broadcast.
    n_steps : int
        Steps to watch.

    Returns
    -------
    numpy.ndarray of bool
        True where the motion ends bounded.

    Examples
    --------
    >>> decays(STEPPERS[0], [1.9, 2.1], 1.0, 0.0, 500).tolist()
    [True, False]
    """
    h, w, zeta = (np.array(a, float) for a in np.broadcast_arrays(step, omega, damping_ratio))
    x, v = np.ones_like(h), np.zeros_like(h)
    size = np.ones_like(h)
    with np.errstate(all="ignore"):  # what grows without bound is the answer
        for _ in range(n_steps):
            x, v = stepper.step(x, v, lambda p, u: -w * (w * p + 2 * zeta * u), h)
            size = np.hypot(x, v / w)
            if not np.any(size < _GROWTH):
                break
    # close below a limit the motion beats: it rises at most by the root of the steps watched
    return np.asarray(size < 2 * math.sqrt(n_steps))


# --- a bounce


def bounce(
    stepper: Stepper, step: ArrayLike, stiffness: ArrayLike, damping: ArrayLike, phase: ArrayLike
) -> Array:
    """Speed of separation over speed of approach, of a unit mass on a contact that never pulls.

    Parameters
    ----------
    stepper : Stepper
        Contact is looked for at its own points only: no step is cut.
    step : array_like
        [s]
    stiffness, damping : array_like
        Of Kelvin's and Voigt's contact, per mass [1/s^2], [1/s].
    phase : array_like
        Part of a step before the surface at which the mass starts, in [0, 1).

    Returns
    -------
    numpy.ndarray
        NaN where the stepper finds no next point, or the mass does not come back in time.

    Examples
    --------
    Without damping nothing is lost, but for the steps that miss the touch:

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
    with np.errstate(all="ignore"):  # what is unstable overflows, and is told by its result
        for _ in range(n_steps):
            x, v = stepper.step(x, v, acceleration, h)
            out = np.isnan(found) & (v < 0) & (acceleration(x, v) == 0)
            found[out] = -v[out]
            if not np.any(np.isnan(found) & np.isfinite(x)):
                break
    return found
