"""Short oil film (Ocvirk) in closed form, for any velocity of the journal, compiled."""

import math
from typing import Any

from ..jit import kernel


@kernel
def short_force(
    length_to_diameter: float, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force of a short film on the half circle towards which the journal squeezes and drags.

    Parameters
    ----------
    length_to_diameter : float
        L / D; the force goes with its square. Within 5 % of the finite film up to about 1/4 at
        low eccentricity, less at high.
    x, y, x_rate, y_rate : float
        Journal centre over C and its rates by tau.

    Returns
    -------
    tuple of float
        Non-dimensional F_X, F_Y; zero where the journal touches the bore.

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
        Direction of the velocity V in the frame in which both surfaces turn as much forth as back.
        At rest the film is that of a velocity along the line of centres.
    filled : float
        Thickest gap over C that holds oil; from 2 on every gap does.

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
    if filled <= 1.0 - eccentricity:
        return 0.0, 0.0, 0.0
    n_x, n_y = 1.0, 0.0
    if eccentricity > 0.0:
        n_x, n_y = x / eccentricity, y / eccentricity
    rest = 1.0 - eccentricity * eccentricity
    root = math.sqrt(rest)
    w_r = v_x * n_x + v_y * n_y
    w_t = (v_y * n_x - v_x * n_y) * root
    size = math.sqrt(w_r * w_r + w_t * w_t)
    c_0, s_0 = (w_r / size, abs(w_t) / size) if size > 0.0 else (1.0, 0.0)
    side = -1.0 if w_t < 0.0 else 1.0
    if filled >= 1.0 + eccentricity:
        radial, tangential, mixed = _flooded(c_0, s_0, eccentricity)
    else:
        middle, half = math.atan2(s_0, c_0), math.acos(-eccentricity * c_0)
        radial, tangential, mixed = _starved(middle - half, middle + half, eccentricity, filled)
    radial /= rest * rest * root
    tangential /= rest * root
    mixed *= side / (rest * rest)
    return (
        radial * n_x * n_x - 2.0 * mixed * n_x * n_y + tangential * n_y * n_y,
        (radial - tangential) * n_x * n_y + mixed * (n_x * n_x - n_y * n_y),
        radial * n_y * n_y + 2.0 * mixed * n_x * n_y + tangential * n_x * n_x,
    )


@kernel
def filled_angle(eccentricity: float, filled: float) -> float:
    """Sommerfeld's angle up to which the gap holds oil: 0 nowhere, pi everywhere."""
    rest = 1.0 - eccentricity * eccentricity
    if filled >= 1.0 + eccentricity:
        return math.pi
    if filled <= 1.0 - eccentricity:
        return 0.0
    return math.acos(max(-1.0, min(1.0, (rest / filled - 1.0) / eccentricity)))


@kernel
def _flooded(c_0: float, s_0: float, e: float) -> Any:
    """Integrals of ``(e + cos g)^2``, ``sin^2 g``, ``(e + cos g) sin g`` over the whole arc.

    Its middle has the cosine c_0 and the sine s_0, its half width the cosine ``-e c_0``.
    """
    c_h = -e * c_0
    s_h = math.sqrt(1.0 - c_h * c_h)
    half, double = math.acos(c_h), s_h * c_h * (2.0 * c_0 * c_0 - 1.0)
    return (
        (2.0 * e * e + 1.0) * half + 4.0 * e * c_0 * s_h + double,
        half - double,
        2.0 * s_0 * s_h * (e + c_h * c_0),
    )


@kernel
def _starved(start: float, end: float, e: float, filled: float) -> Any:
    """The same over that part of an arc that holds oil.

    The arc begins above -pi and may pass beyond pi.
    """
    last = filled_angle(e, filled)
    first = max(start, -last)
    a, b, c = 0.0, 0.0, 0.0
    if min(end, last) > first:
        a, b, c = _between(first, min(end, last), e)
    again = 2.0 * math.pi - last
    if end > again:
        more = _between(max(start, again), end, e)
        a, b, c = a + more[0], b + more[1], c + more[2]
    return a, b, c


@kernel
def _between(start: float, end: float, e: float) -> Any:
    s_0, c_0, s_1, c_1 = math.sin(start), math.cos(start), math.sin(end), math.cos(end)
    arc, double = 0.5 * (end - start), 0.5 * (s_1 * c_1 - s_0 * c_0)
    return (
        2.0 * e * e * arc + 2.0 * e * (s_1 - s_0) + arc + double,
        arc - double,
        e * (c_0 - c_1) + 0.5 * (c_0 * c_0 - c_1 * c_1),
    )
