"""Pin in oil: film, asperities and yielding wall of one joint, compiled.

The pin lies at d from the centre of its eye. The wall yields by ``d - s``, where s is the film
position of the pin, a state of the joint. In a frame that turns with the mean of both surfaces'
angular velocities, W, a film is squeezed but not dragged; the velocity there is ``V = s' - W x s``,
and

    R(s, V) V + N(s) n = K (d - s) + C (u - V),    u = d' - W x d,

with the film's resistance R, the force N of asperities along the line of centres, and the
wall's stiffness K and damping C. The right-hand side is the force on the rod. R depends only on the
direction of V (the film closes on one half of its circle), and ``R V`` is the gradient of a
convex dissipation, so that Newton's method finds V from any start in a few steps. This holds at
rest, at the centre, for counter-rotating surfaces, and without any oil: then R is zero and
the wall follows the pin in free flight.

The wall relaxes at ``K / (R + C)``, which stays moderate at any gap. Without oil only C limits it:
there a share of K times the step is added, so that the wall needs at least some steps to spring
back; the added damping exerts no force on the rod. Asperities are integrated implicitly. A flooded
film thus never reduces the step of the mechanism.

Moments: shear couples pin and eye by M; pressure acts on the pin through its own centre and
on the eye through another, so each also bears half of ``d x F``. The power lost is then
``V R V + M w`` plus that of the wall, for any W.

Sources: Booker (1965), J. Basic Engineering 87(3), 537-546, for a film under a moving load in the
frame of the mean rotation; Childs, Moes, van Leeuwen (1977), J. Lubrication Technology 99(2),
198-210. Series of film and wall, and the implicit step, are derived here.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ..contact.asperities import asperity_force
from ..contact.law import elastic_force, friction_force
from ..film.map_look_up import MapTable, map_resistance
from ..film.short import filled_angle, short_resistance
from ..jit import kernel

OIL = np.dtype(
    [
        ("short", "f8"),  # eta R L^3 / C^3, of the lands [N s/m]; 0 if the map is used
        ("map", "f8"),  # eta R^3 L / C^3 of the same [N s/m]; 0 if the short film is used
        ("shear", "f8"),  # eta R^3 L / C [N m s]
        ("filled", "f8"),  # thickest gap over C that holds oil
        ("radius", "f8"),  # in the middle of the gap [m]
        ("wall_damping", "f8"),  # C [N s/m]
        ("relaxing", "f8"),  # added to C where the wall springs back [N s/m]
        ("roughness", "f8"),  # of both surfaces [m]; 0: smooth
        ("peaks", "f8"),  # scale of the asperity force [N]
        ("step", "f8"),  # of the mechanism [s]
        ("offset", "i8"),  # of the map's coefficients
        ("roots", "i8"),  # their shape
        ("angles", "i8"),
        ("gap_factor", "f8"),
        ("least_root", "f8"),
        ("per_root", "f8"),
        ("per_radian", "f8"),
    ]
)
"""Oil of one joint, in SI."""

DEEPEST = 1.0 - 1e-5
"""Eccentricity limit of the film, whose surface finish is no thinner; beyond it the film stays."""

NEWTON_STEPS = 12
_SETTLED = 1e-3  # of the velocity in the last step; the remaining error is its square
_IMPLICIT = 0.5  # of a step: implicit share of the asperity stiffness
_MOST_CLOSED = 0.7  # of the gap: largest closing in one step


@kernel
def _resistance(x: float, y: float, v_x: float, v_y: float, o: Any, maps: Any) -> Any:
    """Resistance of the film at s, over C, to velocities in a direction [N s/m]."""
    if o.map > 0.0:
        n = 3 * o.roots * o.angles
        c = maps[o.offset : o.offset + n].reshape(3, 1, o.roots, o.angles)
        table = MapTable(c, 1, o.gap_factor, o.least_root, o.per_root, o.per_radian, 0.0)
        xx, xy, yx, yy = map_resistance(table, x, y, v_x, v_y)
        return o.map * xx, o.map * xy, o.map * yx, o.map * yy
    xx, xy, yy = short_resistance(x, y, v_x, v_y, o.filled)
    return o.short * xx, o.short * xy, o.short * xy, o.short * yy


class FilmPull(NamedTuple):
    """Forces on a film, its position, and additional resistance."""

    x: float  # over C, limited by the surface finish
    y: float
    n_x: float  # line of centres
    n_y: float
    u_x: float  # velocity of the pin in the film's frame [m/s]
    u_y: float
    spring_x: float  # force of the wall [N]
    spring_y: float
    pull_x: float  # [N]
    pull_y: float
    wall_xx: float  # damping of the wall and the asperities [N s/m]
    wall_xy: float
    wall_yy: float


@kernel
def film_pull(
    s_x: float,
    s_y: float,
    d_x: float,
    d_y: float,
    v_x: float,
    v_y: float,
    mean: float,
    peaks: float,
    stiff: float,
    c: Any,
    o: Any,
) -> Any:
    """See :class:`FilmPull`; `stiff` is the damping added by the asperities [N s/m]."""
    u_x, u_y = v_x + mean * d_y, v_y - mean * d_x
    yield_x, yield_y = d_x - s_x, d_y - s_y
    deep = math.sqrt(yield_x * yield_x + yield_y * yield_y)
    spring = elastic_force(deep, c) / (deep if deep > 0.0 else 1.0)
    wall = o.wall_damping + o.relaxing
    pull_x, pull_y = spring * yield_x + wall * u_x, spring * yield_y + wall * u_y
    distance = math.sqrt(s_x * s_x + s_y * s_y)
    off_centre = distance > 0.0
    over = distance if off_centre else 1.0
    n_x, n_y = s_x / over if off_centre else 1.0, s_y / over
    most = 1.0 - max(1.0 - DEEPEST, o.roughness / c.clearance)  # asperities keep the surfaces apart
    share = min(1.0 / c.clearance, most / over)
    return FilmPull(
        s_x * share,
        s_y * share,
        n_x,
        n_y,
        u_x,
        u_y,
        spring * yield_x,
        spring * yield_y,
        pull_x - peaks * n_x,
        pull_y - peaks * n_y,
        wall + stiff * n_x * n_x,
        stiff * n_x * n_y,
        wall + stiff * n_y * n_y,
    )


@kernel
def newton_step(
    r_xx: float,
    r_xy: float,
    r_yx: float,
    r_yy: float,
    f: Any,
    v_x: float,
    v_y: float,
    damped: float,
) -> Any:
    """Next estimate of the velocity V in equilibrium with the pull; whether it has converged."""
    a, b, c, d = r_xx + f.wall_xx, r_xy + f.wall_xy, r_yx + f.wall_xy, r_yy + f.wall_yy
    inverse = 1.0 / (a * d - b * c)
    new_x, new_y = (
        (d * f.pull_x - b * f.pull_y) * inverse,
        (a * f.pull_y - c * f.pull_x) * inverse,
    )
    change = abs(new_x - v_x) + abs(new_y - v_y)
    settled = r_xx + r_yy == 0.0 or change <= _SETTLED * (abs(new_x) + abs(new_y))
    return v_x + damped * (new_x - v_x), v_y + damped * (new_y - v_y), settled


@kernel
def newton_damping(step: int) -> float:
    """Damping factor of a Newton step: smaller if the steps alternate between two branches."""
    return 1.0 if step < NEWTON_STEPS // 2 else 0.5


@kernel
def _film_velocity(f: Any, v_x: float, v_y: float, o: Any, maps: Any) -> Any:
    """Velocity V in equilibrium with the pull, from an initial guess."""
    for step in range(NEWTON_STEPS):
        r_xx, r_xy, r_yx, r_yy = _resistance(f.x, f.y, v_x, v_y, o, maps)
        v_x, v_y, settled = newton_step(r_xx, r_xy, r_yx, r_yy, f, v_x, v_y, newton_damping(step))
        if settled:
            break  # without oil the first step is exact
    return v_x, v_y


@kernel
def oiled_joint(
    s_x: float,
    s_y: float,
    d_x: float,
    d_y: float,
    v_x: float,
    v_y: float,
    pin_turn: float,
    eye_turn: float,
    guess: Any,
    c: Any,
    o: Any,
    maps: Any,
) -> Any:
    """Force of an oiled pin on its rod, and the motion of the film.

    Parameters
    ----------
    s_x, s_y : float
        Film position of the pin, from the eye's centre [m].
    d_x, d_y, v_x, v_y : float
        Pin position from the eye's centre [m], and velocity [m/s].
    pin_turn, eye_turn : float
        Angular velocities, counter-clockwise [rad/s].
    guess : numpy.ndarray of shape (2,)
        V of the last call; replaced by that of this call [m/s].
    c, o : record of CONTACT, record of OIL
        Wall and its friction; the film.
    maps : numpy.ndarray
        Coefficients of all maps, concatenated.

    Returns
    -------
    tuple of float
        Force on the rod x, y [N]; moments on pin and eye, counter-clockwise [N m]; rate of s x, y
        [m/s]; least gap [m]; force of the asperities [N].
    """
    mean, slip = 0.5 * (pin_turn + eye_turn), pin_turn - eye_turn
    gap = film_gap(s_x, s_y, c)
    peaks, stiff = peaks_of(gap, o)
    f = film_pull(s_x, s_y, d_x, d_y, v_x, v_y, mean, peaks, stiff, c, o)
    f_x, f_y = _film_velocity(f, guess[0], guess[1], o, maps)
    guess[0], guess[1] = f_x, f_y
    return film_load(s_x, s_y, d_x, d_y, mean, slip, f_x, f_y, gap, peaks, stiff, f, c, o)


@kernel
def film_gap(s_x: float, s_y: float, c: Any) -> float:
    """Least gap of a film [m]."""
    least: float = c.clearance - math.sqrt(s_x * s_x + s_y * s_y)
    return least


@kernel
def peaks_of(gap: float, o: Any) -> Any:
    """Force of the asperities [N], and the damping equivalent to their stiffness [N s/m]."""
    peaks, stiff = asperity_force(gap, o.roughness, o.peaks)
    return peaks, stiff * (_IMPLICIT * o.step)


@kernel
def film_load(
    s_x: float,
    s_y: float,
    d_x: float,
    d_y: float,
    mean: float,
    slip: float,
    f_x: float,
    f_y: float,
    gap: float,
    peaks: float,
    stiff: float,
    f: Any,
    c: Any,
    o: Any,
) -> Any:
    """Result of :func:`oiled_joint`, once the velocity of the film is known."""
    n_x, n_y = f.n_x, f.n_y
    closing = f_x * n_x + f_y * n_y - _MOST_CLOSED * max(0.0, gap) / o.step
    crossing = max(0.0, closing)  # the film cannot be crossed between two evaluations
    f_x -= crossing * n_x
    f_y -= crossing * n_y
    force_x = f.spring_x + o.wall_damping * (f.u_x - f_x)
    force_y = f.spring_y + o.wall_damping * (f.u_y - f_y)
    eccentricity = math.sqrt(f.x * f.x + f.y * f.y)
    angle = filled_angle(eccentricity, o.filled)
    rest = math.sqrt(1.0 - eccentricity * eccentricity)
    drag = o.shear * 2.0 * angle / rest * slip
    # as the implicit step left it: asperities carry no more than the wall exerts
    peaks = max(0.0, peaks + stiff * (f_x * n_x + f_y * n_y))
    sliding = friction_force(f_y * n_x - f_x * n_y + o.radius * slip, peaks, c)
    rub = sliding if peaks > 0.0 else 0.0
    force_x -= rub * n_y
    force_y += rub * n_x
    drag += o.radius * rub
    couple = 0.5 * (d_x * force_y - d_y * force_x)
    return (
        force_x,
        force_y,
        couple - drag,
        couple + drag,
        f_x - mean * s_y,
        f_y + mean * s_x,
        gap,
        peaks,
    )
