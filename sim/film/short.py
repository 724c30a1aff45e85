"""Short oil film (Ocvirk) in closed form, for any velocity of the journal, compiled."""

import math
from typing import Any

from ..jit import half_turn_angle, kernel


@kernel
def short_force(
    length_to_diameter: float, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force of a short film on the half circle towards which the journal squeezes and drags.

    Parameters
    ----------
    length_to_diameter : float
        L / D; the force is proportional to its square. Within 5 % of the finite film up to about
        1/4 at low eccentricity, less at high.
    x, y, x_rate, y_rate : float
        Journal centre over C and its rates by tau.

    Returns
    -------
    tuple of float
        Non-dimensional F_X, F_Y; zero if the journal touches the bore.

    Notes
    -----
    Without flow along the circumference the mean pressure over the length is
    ``(L/R)^2 V.n / H^3`` with n the direction of theta and ``V = (X' + Y/2, Y' - X/2)``; the film
    reaches over the half circle where ``V.n > 0`` (Guembel). About V the gap is
    ``1 - a cos - b sin``. ``G``, the integral of 1/H over the half circle, gives those with
    ``cos^2`` and ``sin cos`` over ``H^3`` as its second derivatives by a and b.

    References
    ----------
    Ocvirk (1952), NACA TN 2808. Childs, Moes, van Leeuwen (1977), J. Lubrication Technology
    99(2), 198-210, doi:10.1115/1.3453019: any velocity.

    Examples
    --------
    >>> f_x, f_y = short_force(0.5, 0.5, 0.0, 0.0, 0.0)
    >>> round(f_x, 4), round(f_y, 4)
    (-0.4444, 0.6046)
    """
    v_x, v_y = x_rate + 0.5 * y, y_rate - 0.5 * x
    speed = math.hypot(v_x, v_y)
    rest = 1.0 - x * x - y * y
    if speed == 0.0 or rest <= 0.0:
        return 0.0, 0.0
    c, s = v_x / speed, v_y / speed
    a, b = x * c + y * s, y * c - x * s
    g = (math.pi + 2.0 * math.atan(a / math.sqrt(rest))) / math.sqrt(rest)
    g_a = (2.0 + a * g) / rest
    g_b = b * (2.0 * a / (1.0 - b * b) + g) / rest
    factor = -2.0 * length_to_diameter * length_to_diameter * speed / rest
    f_along = factor * (g + 3.0 * a * g_a)
    f_across = factor * (a * g_b + 2.0 * b * g_a)
    return f_along * c - f_across * s, f_along * s + f_across * c


@kernel
def short_resistance(
    x: float, y: float, v_x: float, v_y: float, filled: float
) -> tuple[float, float, float]:
    """Resistance of a short film to the velocity of its journal, flooded or starved.

    Parameters
    ----------
    x, y : float
        Journal centre over C, inside the circle of radius 1.
    v_x, v_y : float
        Direction of the velocity V in the frame in which both surfaces turn equally fast
        in opposite directions. At rest the film is that of a velocity along the line of centres.
    filled : float
        Thickest gap over C that holds oil; from 2 on, every gap does.

    Returns
    -------
    tuple of float
        R_xx, R_xy, R_yy: integrals of ``n n^T / H^3`` over the arc that closes (Guembel) and holds
        oil. The force on the journal is ``-eta R L^3 / C^3`` times this matrix times V; the matrix
        is also the force's derivative by V, since the integrand vanishes where the arc ends.

    Notes
    -----
    With Sommerfeld's angle g, ``cos t = (e + cos g) / (1 + e cos g)`` with t from the least gap,
    the integrands are ``(e + cos g)^2``, ``sin^2 g`` and ``(e + cos g) sin g`` over powers of
    ``1 - e^2``. The arc closes where ``w_r (e + cos g) + w_t sin g > 0`` with
    ``w = (V_r, sqrt(1 - e^2) V_t)``: at most ``arccos(-e w_r / |w|)`` from the angle of w. It holds
    oil where ``(1 - e^2) / (1 + e cos g)`` is below `filled`.

    Examples
    --------
    >>> r_xx, r_xy, r_yy = short_resistance(0.5, 0.0, 0.0, -0.25, 2.0)
    >>> round(0.25 * r_xy, 4), round(0.25 * r_yy, 4)  # of short_force: / 4 (L/D)^2
    (-0.4444, 0.6046)
    """
    eccentricity = math.sqrt(x * x + y * y)
    off_centre = eccentricity > 0.0
    distance = eccentricity if off_centre else 1.0
    n_x, n_y = x / distance if off_centre else 1.0, y / distance
    rest = 1.0 - eccentricity * eccentricity
    root = math.sqrt(rest)
    w_r = v_x * n_x + v_y * n_y
    w_t = (v_y * n_x - v_x * n_y) * root
    size = math.sqrt(w_r * w_r + w_t * w_t)
    over = size if size > 0.0 else 1.0
    c_0, s_0 = w_r / over if size > 0.0 else 1.0, abs(w_t) / over
    side = -1.0 if w_t < 0.0 else 1.0
    radial, tangential, mixed = _over_the_arc(c_0, s_0, eccentricity, rest, filled)
    thick, thin = 1.0 / rest, 1.0 / (rest * root)
    radial *= thick * thin
    tangential *= thin
    mixed *= side * thick * thick
    oil = 1.0 if filled > 1.0 - eccentricity else 0.0
    return (
        oil * (radial * n_x * n_x - 2.0 * mixed * n_x * n_y + tangential * n_y * n_y),
        oil * ((radial - tangential) * n_x * n_y + mixed * (n_x * n_x - n_y * n_y)),
        oil * (radial * n_y * n_y + 2.0 * mixed * n_x * n_y + tangential * n_x * n_x),
    )


@kernel
def filled_angle(eccentricity: float, filled: float) -> float:
    """Sommerfeld's angle up to which the gap holds oil; 0: nowhere, pi: everywhere."""
    _, _, angle = _filled_arc(eccentricity, 1.0 - eccentricity * eccentricity, filled)
    found: float = angle
    return found


@kernel
def _filled_arc(e: float, rest: float, filled: float) -> Any:
    """Cosine and sine of the angle up to which the gap holds oil, and the angle."""
    cosine = max(-1.0, min(1.0, (rest / filled - 1.0) / (e if e > 0.0 else 1.0)))
    cosine = 1.0 if filled <= 1.0 - e else cosine
    cosine = -1.0 if filled >= 1.0 + e else cosine
    sine = math.sqrt((1.0 - cosine) * (1.0 + cosine))
    return cosine, sine, half_turn_angle(cosine, sine)


@kernel
def _over_the_arc(c_0: float, s_0: float, e: float, rest: float, filled: float) -> Any:
    """Integrals of ``(e + cos g)^2``, ``sin^2 g``, ``(e + cos g) sin g`` where the arc holds oil.

    The arc's middle has the cosine c_0 and the sine s_0, its half width the cosine ``-e c_0``: it
    begins above -pi and may pass beyond pi. Oil extends to an angle on either side of the least
    gap.
    """
    c_h = -e * c_0
    s_h = math.sqrt(1.0 - c_h * c_h)
    middle, half = half_turn_angle(c_0, s_0), half_turn_angle(c_h, s_h)
    start, s_start, c_start = middle - half, s_0 * c_h - c_0 * s_h, c_0 * c_h + s_0 * s_h
    end, s_end, c_end = middle + half, s_0 * c_h + c_0 * s_h, c_0 * c_h - s_0 * s_h
    c_last, s_last, last = _filled_arc(e, rest, filled)
    flooded = filled >= 1.0 + e
    late, soon = flooded or start > -last, flooded or end < last
    first, s_first, c_first = (
        start if late else -last,
        s_start if late else -s_last,
        c_start if late else c_last,
    )
    until, s_until, c_until = (
        end if soon else last,
        s_end if soon else s_last,
        c_end if soon else c_last,
    )
    a, b, c = _between(first, s_first, c_first, until, s_until, c_until, e)
    again = 2.0 * math.pi - last
    d, f, g = _between(again, -s_last, c_last, end, s_end, c_end, e)
    own = 1.0 if until > first else 0.0
    more = 1.0 if end > again and not flooded else 0.0
    return own * a + more * d, own * b + more * f, own * c + more * g


@kernel
def _between(
    start: float, s_0: float, c_0: float, end: float, s_1: float, c_1: float, e: float
) -> Any:
    arc, double = 0.5 * (end - start), 0.5 * (s_1 * c_1 - s_0 * c_0)
    return (
        2.0 * e * e * arc + 2.0 * e * (s_1 - s_0) + arc + double,
        arc - double,
        e * (c_0 - c_1) + 0.5 * (c_0 * c_0 - c_1 * c_1),
    )
