"""Look-up in an impedance map: force, resistance and peak pressure of a film from its table."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel

RADIAL, TANGENTIAL, PEAK = range(3)
"""Entries of the table: components of the force in the frame of the line of centres, peak."""

_TINY = 1e-300  # avoids 0 / 0 at zero velocity


class MapTable(NamedTuple):
    """Table of a map, as the kernels use it."""

    coefficients: NDArray[np.float64]  # (3, n_attitudes, n_gap + 2, n_angle + 2 or 3)
    mirrored: int  # 1 for a plain bore: half a turn of V, one attitude
    gap_factor: float  # 2 (D/L)^2
    least_root: float  # sqrt(g) at the last eccentricity
    per_root: float  # knots per sqrt(g)
    per_radian: float  # knots per angle of V
    per_attitude: float  # knots per angle of the line of centres


@kernel
def stretched_angle(along: float, across: float) -> float:
    """Angle of (along, across) in [0, pi] for across >= 0, within 6e-7 rad of the arc tangent.

    Twice the arc tangent of the half angle's tangent by an odd polynomial on [0, 1], a minimax fit
    that is exact at 0 and 1, so that the angle is continuous. Table and look-up use the same
    function, hence its error does not matter.

    Examples
    --------
    >>> round(stretched_angle(-1.0, 1.0) / math.pi, 6)
    0.75
    """
    t = across / (math.sqrt(along * along + across * across) + abs(along) + _TINY)
    z = t * t
    q = z * z  # paired powers shorten the chain of dependent operations
    low = (0.9999958816524089 - 0.3331660701852026 * z) + q * (
        0.19800800206264005 - 0.13206149560785463 * z
    )
    high = (0.07911876517961397 - 0.033159434994251835 * z) + q * 0.00666251529009445
    half = t * (low + q * q * high)
    return 2.0 * half if along >= 0.0 else math.pi - 2.0 * half


@kernel
def _weights(u: float) -> tuple[float, float, float, float]:
    """Weights of four neighbouring cubic B-splines at the share u of the middle cell."""
    v = 1.0 - u
    third = 1.0 / 6.0
    return (
        v * v * v * third,
        (u * u * (3.0 * u - 6.0) + 4.0) * third,
        (v * v * (3.0 * v - 6.0) + 4.0) * third,
        u * u * u * third,
    )


@kernel
def _cell(position: float, cells: int) -> tuple[int, float]:
    """Cell of a position in knots, and the share of the cell before it."""
    i = min(int(position), cells - 1)
    return i, position - i


@kernel
def _row(c: Any, i: int, j: int, w: Any) -> float:
    value: float = (c[i, j] * w[0] + c[i, j + 1] * w[1]) + (c[i, j + 2] * w[2] + c[i, j + 3] * w[3])
    return value


@kernel
def _patch(c: Any, i: int, j: int, v: Any, w: Any) -> float:
    value: float = (_row(c, i, j, w) * v[0] + _row(c, i + 1, j, w) * v[1]) + (
        _row(c, i + 2, j, w) * v[2] + _row(c, i + 3, j, w) * v[3]
    )
    return value


@kernel
def _entry(table: MapTable, what: int, k: int, i: int, j: int, u: Any, v: Any, w: Any) -> float:
    c = table.coefficients[what]
    value: float = 0.0
    if table.mirrored == 1:
        value = _patch(c[0], i, j, v, w)
    else:
        value = _patch(c[k], i, j, v, w) * u[0] + _patch(c[k + 1], i, j, v, w) * u[1]
        value += _patch(c[k + 2], i, j, v, w) * u[2] + _patch(c[k + 3], i, j, v, w) * u[3]
    return value


@kernel
def map_scales(table: MapTable, eccentricity: float) -> tuple[float, float, float]:
    """sqrt(g), sqrt(1 - eps^2) and G of the scaling, constant beyond the end of the table."""
    gap = max(1.0 - eccentricity, table.least_root * table.least_root)
    root = math.sqrt(gap)
    stretch = math.sqrt(gap * (2.0 - gap))
    return root, stretch, 13.328648814475097 / (gap * root * (1.0 + table.gap_factor * gap))


@kernel
def _look_up(table: MapTable, x: float, y: float, x_rate: float, y_rate: float) -> Any:
    """Direction of the line of centres, side of V, factors of the entries, cells and weights."""
    eccentricity = math.sqrt(x * x + y * y)
    if eccentricity > 0.0:
        inverse = 1.0 / eccentricity
        n_x, n_y = x * inverse, y * inverse
    else:
        n_x, n_y = 1.0, 0.0
    v_x, v_y = x_rate + 0.5 * y, y_rate - 0.5 * x
    root, stretch, scale = map_scales(table, eccentricity)
    along = v_x * n_x + v_y * n_y
    across = (v_y * n_x - v_x * n_y) * stretch
    size = scale * math.sqrt(along * along + across * across)
    side = 1.0 if across >= 0.0 else -1.0
    angle = stretched_angle(along, side * across)
    shape = table.coefficients.shape
    k, u = 0, _weights(0.0)
    if table.mirrored == 0:
        angle = angle if across >= 0.0 else 2.0 * math.pi - angle
        side = 1.0
        attitude = math.atan2(n_y, n_x)
        attitude = attitude if attitude >= 0.0 else attitude + 2.0 * math.pi
        k, share = _cell(attitude * table.per_attitude, shape[1] - 3)
        u = _weights(share)
    i, share = _cell((1.0 - root) * table.per_root, shape[2] - 3)
    v = _weights(share)
    j, share = _cell(angle * table.per_radian, shape[3] - 3)
    return n_x, n_y, side, size, stretch, k, i, j, u, v, _weights(share)


@kernel
def map_force(
    table: MapTable, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force on the journal from the map.

    Parameters
    ----------
    table : MapTable
    x, y : float
        Journal centre over C. Beyond the last eccentricity of the table the force is that at its
        end, meant for trial points of an integrator; a caller that accepts such a point must report
        it.
    x_rate, y_rate : float
        Velocity of the centre: derivatives by tau.

    Returns
    -------
    tuple of float
        Non-dimensional F_X, F_Y, as :func:`.film.direct.direct_force` within the map's error.
    """
    n_x, n_y, side, size, stretch, k, i, j, u, v, w = _look_up(table, x, y, x_rate, y_rate)
    radial = size * _entry(table, RADIAL, k, i, j, u, v, w)
    tangential = side * size * stretch * _entry(table, TANGENTIAL, k, i, j, u, v, w)
    return radial * n_x - tangential * n_y, radial * n_y + tangential * n_x


@kernel
def _rates(u: float) -> tuple[float, float, float, float]:
    """Derivatives of :func:`_weights` by the share u."""
    v = 1.0 - u
    return (-0.5 * v * v, u * (1.5 * u - 2.0), -v * (1.5 * v - 2.0), 0.5 * u * u)


@kernel
def map_resistance(
    table: MapTable, x: float, y: float, v_x: float, v_y: float
) -> tuple[float, float, float, float]:
    """Resistance of the film of a plain bore to the velocity of its journal, from the map.

    Parameters
    ----------
    table : MapTable
        Map of a plain bore.
    x, y : float
        Journal centre over C, as for :func:`map_force`.
    v_x, v_y : float
        Velocity V in the frame in which both surfaces turn equally fast in opposite directions; (0,
        0) counts as one along the line of centres.

    Returns
    -------
    tuple of float
        R_xx, R_xy, R_yx, R_yy: minus the derivative of the force by V. As the force is homogeneous,
        it is also ``-R V``.
    """
    _, _, roots, angles = table.coefficients.shape
    m = map_place(table, roots, angles, x, y, v_x, v_y)
    found = map_patches(
        table.coefficients[RADIAL, 0], table.coefficients[TANGENTIAL, 0], m.i, m.j, m.p, m.q
    )
    return map_tensor(m, table.per_radian, *found)


class MapPlace(NamedTuple):
    """Position of a state in the map of a plain bore, and the scales of its entries."""

    n_x: float  # line of centres
    n_y: float
    stretch: float
    scale: float
    c: float  # cosine and sine of the scaled angle of V
    s: float
    side: float
    i: float  # cell, and the share of it before the state
    p: float
    j: float
    q: float


@kernel
def map_place(
    table: Any, roots: float, angles: float, x: float, y: float, v_x: float, v_y: float
) -> Any:
    """See :class:`MapPlace`; `roots` and `angles` are the numbers of coefficients."""
    eccentricity = math.sqrt(x * x + y * y)
    off_centre = eccentricity > 0.0
    distance = eccentricity if off_centre else 1.0
    n_x, n_y = x / distance if off_centre else 1.0, y / distance
    root, stretch, scale = map_scales(table, eccentricity)
    along, across = v_x * n_x + v_y * n_y, (v_y * n_x - v_x * n_y) * stretch
    size = math.sqrt(along * along + across * across)
    over = size if size > 0.0 else 1.0
    c, s = along / over if size > 0.0 else 1.0, abs(across) / over
    side = -1.0 if across < 0.0 else 1.0
    i, p = _cell_of((1.0 - root) * table.per_root, roots - 3.0)
    j, q = _cell_of(stretched_angle(c, s) * table.per_radian, angles - 3.0)
    return MapPlace(n_x, n_y, stretch, scale, c, s, side, i, p, j, q)


@kernel
def _cell_of(position: float, cells: float) -> Any:
    """Vectorisable :func:`_cell`, in floats; NaN falls into the first cell."""
    i = min(np.floor(position if position > 0.0 else 0.0), cells - 1.0)
    return i, position - i


@kernel
def map_patches(radial: Any, tangential: Any, i: float, j: float, p: float, q: float) -> Any:
    """Both entries of the map and their derivatives by the angle in knots."""
    row, column, v, w, rate = int(i), int(j), _weights(p), _weights(q), _rates(q)
    return (
        _patch(radial, row, column, v, w),
        _patch(tangential, row, column, v, w),
        _patch(radial, row, column, v, rate),
        _patch(tangential, row, column, v, rate),
    )


@kernel
def map_tensor(
    m: Any, per_radian: float, f_r: float, f_t: float, g_r: float, g_t: float
) -> tuple[float, float, float, float]:
    """Resistance from the entries of the map."""
    c, s, n_x, n_y, stretch, scale = m.c, m.s, m.n_x, m.n_y, m.stretch, m.scale
    g_r *= per_radian
    g_t *= per_radian
    across_scale = m.side * stretch * scale
    r_rr, r_rt = -scale * (f_r * c - g_r * s), -across_scale * (f_r * s + g_r * c)
    r_tr, r_tt = (
        -across_scale * (f_t * c - g_t * s),
        -stretch * stretch * scale * (f_t * s + g_t * c),
    )
    return (
        (r_rr * n_x - r_rt * n_y) * n_x - (r_tr * n_x - r_tt * n_y) * n_y,
        (r_rr * n_y + r_rt * n_x) * n_x - (r_tr * n_y + r_tt * n_x) * n_y,
        (r_rr * n_x - r_rt * n_y) * n_y + (r_tr * n_x - r_tt * n_y) * n_x,
        (r_rr * n_y + r_rt * n_x) * n_y + (r_tr * n_y + r_tt * n_x) * n_x,
    )


@kernel
def map_peak(table: MapTable, x: float, y: float, x_rate: float, y_rate: float) -> float:
    """Largest non-dimensional pressure of the film, with the arguments of :func:`map_force`.

    The largest node of a mesh has kinks where it moves to the next node: expect three times the
    error of the force.
    """
    _, _, _, size, stretch, k, i, j, u, v, w = _look_up(table, x, y, x_rate, y_rate)
    peak: float = size / stretch * _entry(table, PEAK, k, i, j, u, v, w)
    return max(0.0, peak)
