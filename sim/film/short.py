"""Short oil film (Ocvirk) in closed form, for any velocity of the journal, compiled."""

import math

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
