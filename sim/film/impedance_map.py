"""The film reduced to a map: the force of any position and velocity, interpolated.

With ``V = (X' + Y/2, Y' - X/2)`` the right-hand side of Reynolds' equation for a round bore is
``-12 (V_x cos + V_y sin)``. Where neither oil is fed under pressure nor the film ruptures at
another pressure than that of the ends, every cavitation condition is homogeneous: the pressure of
``a V`` is ``a`` times that of V, a >= 0. The force is then ``|V|`` times a function of eccentricity
and the angle between V and the line of centres, and, with grooves, of the attitude of that line. A
worn bore drags oil into its own wedge whatever V is: its force is not homogeneous, and it has no
such map.

Towards the wall that function has a boundary layer: a velocity along the wall acts as much as one
towards it that is smaller by the root of the gap. Lubrication theory of a parabolic gap
``g (1 + theta^2 / 2 g)``, ``g = 1 - eccentricity``, tells the scales. The table is kept over
``sqrt(g)`` and the angle of ``(V_r, sqrt(1 - eps^2) V_t)``, and holds

    F_r / (G |V|), F_t / (G |V| sqrt(1 - eps^2)), P_max sqrt(1 - eps^2) / (G |V|)

with that stretched V and ``G = 3 sqrt(2) pi g^(-3/2) / (1 + 2 g (D/L)^2)``, the squeeze force of a
long film near the wall, joined to that of a short one (half as large times (L/D)^2 / g). All three
stay bounded and smooth up to contact. Interpolation is by cubic B-splines (C2).

Sources: Childs, Moes, van Leeuwen (1977), J. Lubrication Technology 99(2), 198-210,
doi:10.1115/1.3453019, for the reduction; the scaling is derived here.
"""

import hashlib
import io
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..atomic import sealed, unsealed, write_whole
from ..brief import brief
from ..jit import cache_folder, kernel
from .direct import DIRECT_OK, direct_force
from .direct_system import STATUS, DirectFilm
from .solve import FilmGeometry, direct_film

RADIAL, TANGENTIAL, PEAK = range(3)
"""What the table holds: components of the force in the frame of the line of centres, peak."""

LAST_ECCENTRICITY = 0.995
"""Where maps end unless told: beyond, five degrees of arc are wider than the narrow gap."""

_SAMPLES = 1000  # random states by which a map is judged
_LEVELS = 3  # counts of knots tried for a plain bore, each twice as fine
_PLAIN_KNOTS = (33, 49)  # over sqrt(g), over half a turn of V
_GROOVED_KNOTS = (17, 32)  # over sqrt(g), over a whole turn of V; twice as fine gains a third only
_ATTITUDES = 36  # knots over the attitude with grooves, at nodes of the mesh where they divide
_TINY = 1e-300  # keeps 0 / 0 from the direction of no velocity


class MapTable(NamedTuple):
    """What the kernels know of a map."""

    coefficients: NDArray[np.float64]  # (3, n_attitudes, n_gap + 2, n_angle + 2 or 3)
    mirrored: int  # 1 for a plain bore: half a turn of V, one attitude
    gap_factor: float  # 2 (D/L)^2
    least_root: float  # sqrt(g) at the last eccentricity
    per_root: float  # knots per sqrt(g)
    per_radian: float  # knots per angle of V
    per_attitude: float  # knots per angle of the line of centres


@dataclass(frozen=True, kw_only=True)
class MapError:
    """Error of the force against direct solves on the same mesh, over the direct force.

    Attributes
    ----------
    median, most, worst : float
        Of random states, even in ``sqrt(1 - eccentricity)`` and in the stretched angle of V: half
        of them, 95 % of them and all of them lie below.
    """

    median: float
    most: float
    worst: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpedanceMap:
    """The film of one geometry as a table.

    Attributes
    ----------
    table : MapTable
        For :func:`map_force` and :func:`map_peak`.
    last_eccentricity : float
        End of the table. Beyond, the kernels give the force at the end: callers must ask.
    accuracy : float
        That was asked for.
    interpolation : MapError
        With the line of centres on a node of the mesh, where the table is exact at its knots: what
        interpolation costs.
    turned : MapError
        With the line of centres anywhere: this adds what the mesh changes as the journal turns.
    """

    table: MapTable
    last_eccentricity: float
    accuracy: float
    interpolation: MapError
    turned: MapError

    __repr__ = brief("knots", "last_eccentricity", "accuracy")

    @property
    def accurate(self) -> bool:
        """Whether 95 % of the states interpolate within the accuracy that was asked for."""
        return self.interpolation.most <= self.accuracy

    @property
    def knots(self) -> tuple[int, ...]:
        """Table entries along the attitude, the root of the gap, and the angle of V."""
        return self.table.coefficients.shape[1:]

    def force(
        self, x: float, y: float, x_rate: float = 0.0, y_rate: float = 0.0
    ) -> tuple[float, float]:
        """Force on the journal, see :func:`map_force`; refuses what lies beyond the table.

        Raises
        ------
        ValueError
            The eccentricity is larger than `last_eccentricity`.
        """
        if not math.hypot(x, y) <= self.last_eccentricity:
            raise ValueError(
                f"eccentricity = {math.hypot(x, y):.6g} must be <= {self.last_eccentricity:g}, the "
                "last of this map; build the map with a larger last_eccentricity and a finer mesh"
            )
        fx, fy = map_force(self.table, x, y, x_rate, y_rate)
        return fx, fy


# --- look-up


@kernel
def stretched_angle(along: float, across: float) -> float:
    """Angle of (along, across) in [0, pi] for across >= 0, within 6e-7 rad of the arc tangent.

    Twice the arc tangent of the half angle's tangent by an odd polynomial on [0, 1] (a least
    largest error fit, exact at 0 and 1, so that the angle is continuous). Build and look-up use the
    same, hence its error does not matter.

    Examples
    --------
    >>> round(stretched_angle(-1.0, 1.0) / math.pi, 6)
    0.75
    """
    t = across / (math.sqrt(along * along + across * across) + abs(along) + _TINY)
    z = t * t
    q = z * z  # powers in pairs: the look-up waits for every operation in a row
    low = (0.9999958816524089 - 0.3331660701852026 * z) + q * (
        0.19800800206264005 - 0.13206149560785463 * z
    )
    high = (0.07911876517961397 - 0.033159434994251835 * z) + q * 0.00666251529009445
    half = t * (low + q * q * high)
    return 2.0 * half if along >= 0.0 else math.pi - 2.0 * half


@kernel
def _weights(u: float) -> tuple[float, float, float, float]:
    """Of four neighbouring cubic B-splines, at the share u of the cell in the middle."""
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
    """Cell of a position in knots, and the share of it that lies behind."""
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
    """sqrt(g), sqrt(1 - eps^2) and G of the scaling, held at their last beyond the table."""
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
        end, for the trial points of an integrator; a caller that keeps such a point must say so.
    x_rate, y_rate : float
        Its rates by tau.

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
        Of a plain bore.
    x, y : float
        Journal centre over C, as for :func:`map_force`.
    v_x, v_y : float
        Velocity V in the frame in which both surfaces turn as much forth as back; (0, 0) counts as
        one along the line of centres.

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
    """Where a state lies in the map of a plain bore, and the scales of what stands there."""

    n_x: float  # line of centres
    n_y: float
    stretch: float
    scale: float
    c: float  # of the stretched angle of V
    s: float
    side: float
    i: float  # cell, and the share of it that lies behind
    p: float
    j: float
    q: float


@kernel
def map_place(
    table: Any, roots: float, angles: float, x: float, y: float, v_x: float, v_y: float
) -> Any:
    """See :class:`MapPlace`; `roots` and `angles` are the coefficients' numbers."""
    eccentricity = math.sqrt(x * x + y * y)
    apart = eccentricity > 0.0
    distance = eccentricity if apart else 1.0
    n_x, n_y = x / distance if apart else 1.0, y / distance
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
    """As :func:`_cell`, in numbers that lie in vectors; no number is in the first cell."""
    i = min(np.floor(position if position > 0.0 else 0.0), cells - 1.0)
    return i, position - i


@kernel
def map_patches(radial: Any, tangential: Any, i: float, j: float, p: float, q: float) -> Any:
    """Both entries of the map and their derivatives by the knots of the angle."""
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
    """Resistance from what stands in the map."""
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
    """Largest non-dimensional pressure of the film, arguments as :func:`map_force`.

    The largest of a mesh's nodes has kinks where it moves from node to node: expect three times the
    error of the force.
    """
    _, _, _, size, stretch, k, i, j, u, v, w = _look_up(table, x, y, x_rate, y_rate)
    peak: float = size / stretch * _entry(table, PEAK, k, i, j, u, v, w)
    return max(0.0, peak)


# --- building


@kernel
def _solve_line(
    work: DirectFilm, x: float, y: float, n_x: float, n_y: float, velocity: Any, values: Any
) -> int:
    """F_r, F_t, P_max for velocities V (along, across the line of centres); failures."""
    failures = 0
    n, k = work.pressure.shape
    for j in range(velocity.shape[0]):
        along, across = velocity[j, 0], velocity[j, 1]
        v_x, v_y = along * n_x - across * n_y, along * n_y + across * n_x
        f_x, f_y = direct_force(work, x, y, v_x - 0.5 * y, v_y + 0.5 * x)
        failures += work.outcome[STATUS] != DIRECT_OK
        peak = 0.0
        for p in range(n):
            for q in range(k):
                peak = max(peak, work.pressure[p, q])
        values[j, 0] = f_x * n_x + f_y * n_y
        values[j, 1] = f_y * n_x - f_x * n_y
        values[j, 2] = peak
    return failures


def _scaled_solves(
    work: DirectFilm,
    table: MapTable,
    eccentricity: float,
    attitude: float,
    angles: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Table values of one place of the journal for stretched angles of V, (n, 3)."""
    n_x, n_y = math.cos(attitude), math.sin(attitude)
    _, stretch, scale = map_scales(table, eccentricity)
    velocity = np.column_stack([np.cos(angles), np.sin(angles) / stretch])
    values = np.empty((len(angles), 3))
    failures = _solve_line(work, eccentricity * n_x, eccentricity * n_y, n_x, n_y, velocity, values)
    if failures:
        raise ValueError(
            f"eccentricity = {eccentricity:.6g} at {math.degrees(attitude):.4g} deg must leave a "
            "gap that the direct solver can carry; lower last_eccentricity, or check the bore"
        )
    return values / (scale * np.array([1.0, stretch, 1.0 / stretch]))


def _spline_coefficients(values: NDArray[np.float64], axis: int, ends: str) -> NDArray[np.float64]:
    """Cubic B-splines through values at even knots along an axis.

    `ends`: ``"free"`` (not a knot), ``"even"`` or ``"odd"`` about both ends, each with one
    coefficient beyond each end; ``"periodic"`` with one before and two behind.
    """
    data = np.moveaxis(values, axis, 0)
    n = len(data)
    rows = np.arange(n)
    if ends == "periodic":
        matrix = np.zeros((n, n))
        for shift, weight in ((-1, 1 / 6), (0, 2 / 3), (1, 1 / 6)):
            np.add.at(matrix, (rows, (rows + shift) % n), weight)
        flat: Any = np.linalg.solve(matrix, data.reshape(n, -1))[np.arange(-1, n + 2) % n]
        return np.moveaxis(flat.reshape(n + 3, *data.shape[1:]), 0, axis)
    matrix = np.zeros((n + 2, n + 2))
    for shift, weight in ((0, 1 / 6), (1, 2 / 3), (2, 1 / 6)):
        matrix[rows + 1, rows + shift] = weight
    edge = {"free": (1, -4, 6, -4, 1), "even": (1, 0, -1), "odd": (1, 0, 1)}[ends]
    matrix[0, : len(edge)] = edge
    matrix[-1, -len(edge) :] = edge
    right = np.zeros((n + 2, data[0].size))
    right[1:-1] = data.reshape(n, -1)
    flat = np.linalg.solve(matrix, right)
    return np.moveaxis(flat.reshape(n + 2, *data.shape[1:]), 0, axis)


def _blank_table(
    geometry: FilmGeometry, knots: tuple[int, int, int], last_eccentricity: float
) -> MapTable:
    """Scales of a table with knots over attitude, root and angle; no coefficients yet."""
    attitudes, roots, angles = knots
    plain = attitudes == 1
    root = math.sqrt(1 - last_eccentricity)
    return MapTable(
        coefficients=np.zeros((3, 1, 4, 4)),
        mirrored=int(plain),
        gap_factor=2 / geometry.length_to_diameter**2,
        least_root=root,
        per_root=(roots - 1) / (1 - root),
        per_radian=(angles - 1) / math.pi if plain else angles / (2 * math.pi),
        per_attitude=attitudes / (2 * math.pi),
    )


def _build_table(
    geometry: FilmGeometry, knots: tuple[int, int, int], last_eccentricity: float
) -> MapTable:
    """Direct solves at all knots, warm along the angle of V, and the splines through them."""
    attitudes, roots, angles = knots
    table = _blank_table(geometry, knots, last_eccentricity)
    work = direct_film(geometry)
    values = np.empty((3, attitudes, roots, angles))
    turn = np.arange(angles) / table.per_radian
    for k in range(attitudes):
        for i in range(roots):
            root = 1 - i / table.per_root
            solved = _scaled_solves(work, table, 1 - root**2, k / table.per_attitude, turn)
            values[:, k, i] = solved.T
    if table.mirrored:
        parts = [
            _spline_coefficients(values[what], 2, "odd" if what == TANGENTIAL else "even")
            for what in range(3)
        ]
    else:
        around = _spline_coefficients(values, 1, "periodic")
        parts = list(_spline_coefficients(around, 3, "periodic"))
    coefficients = _spline_coefficients(np.array(parts), 2, "free")
    return table._replace(coefficients=np.ascontiguousarray(coefficients))


def _measure(geometry: FilmGeometry, table: MapTable, *, turned: bool) -> MapError:
    """Error of the force at random states against direct solves on the map's own mesh."""
    random = np.random.default_rng(0)
    work = direct_film(geometry)
    roots = random.uniform(table.least_root, 1, _SAMPLES)
    angles = random.uniform(0, 2 * math.pi, _SAMPLES)
    attitudes = random.uniform(0, 2 * math.pi, _SAMPLES)
    if not turned:
        step = 2 * math.pi / geometry.n_theta
        attitudes = np.zeros(_SAMPLES) if table.mirrored else np.floor(attitudes / step) * step
    errors = np.empty(_SAMPLES)
    for n in range(_SAMPLES):
        eccentricity = 1 - roots[n] ** 2
        _, stretch, scale = map_scales(table, eccentricity)
        here = _scaled_solves(work, table, eccentricity, attitudes[n], angles[n : n + 1])[0]
        n_x, n_y = math.cos(attitudes[n]), math.sin(attitudes[n])
        along, across = math.cos(angles[n]), math.sin(angles[n]) / stretch
        x, y = eccentricity * n_x, eccentricity * n_y
        v_x, v_y = along * n_x - across * n_y, along * n_y + across * n_x
        f_x, f_y = map_force(table, x, y, v_x - 0.5 * y, v_y + 0.5 * x)
        radial, tangential = scale * here[0], scale * stretch * here[1]
        true_x, true_y = radial * n_x - tangential * n_y, radial * n_y + tangential * n_x
        errors[n] = math.hypot(f_x - true_x, f_y - true_y) / math.hypot(true_x, true_y)
    median, most, worst = np.quantile(errors, [0.5, 0.95, 1.0])
    return MapError(median=float(median), most=float(most), worst=float(worst))


def _refined(
    geometry: FilmGeometry, last_eccentricity: float, accuracy: float
) -> tuple[MapTable, MapError]:
    """The coarsest table that is accurate, or the finest that is tried."""
    if geometry.grooves:
        table = _build_table(geometry, (_ATTITUDES, *_GROOVED_KNOTS), last_eccentricity)
        return table, _measure(geometry, table, turned=False)
    for level in range(_LEVELS):
        roots, angles = ((n - 1) * 2**level + 1 for n in _PLAIN_KNOTS)
        table = _build_table(geometry, (1, roots, angles), last_eccentricity)
        error = _measure(geometry, table, turned=False)
        if error.most <= accuracy:
            break
    return table, error


def impedance_map(
    geometry: FilmGeometry,
    *,
    last_eccentricity: float = LAST_ECCENTRICITY,
    accuracy: float = 5e-3,
    cached: bool = True,
) -> ImpedanceMap:
    """Map of a film, from the cache or built from direct solves.

    Parameters
    ----------
    geometry : FilmGeometry
        A round bore gives a map over two numbers, one with grooves at the pressure of the ends a
        map over three.
    last_eccentricity : float
        End of the table, in (0, 1).
    accuracy : float
        Error of the force that 95 % of the states shall keep; the knots of a plain bore are doubled
        up to twice to reach it. See :attr:`ImpedanceMap.accurate`.
    cached : bool
        Read and write the map in the cache folder of the kernels, under a hash of the arguments
        and of all sources of ``sim``.

    Returns
    -------
    ImpedanceMap
        With its measured errors.

    Raises
    ------
    ValueError
        A groove is fed under pressure, the bore is not round, an argument is out of its range, or
        the journal touches the bore within `last_eccentricity`.

    Notes
    -----
    A worn bore would add ``1 / |V|`` as a parameter, feed pressure the same, and tilt two angles
    and two rates: those maps cost more solves than the orbits that would use them. A film that
    conserves oil has a memory and no map.

    Examples
    --------
    >>> film = FilmGeometry(length_to_diameter=0.5, n_theta=36, n_z=9)
    >>> plain = impedance_map(film, last_eccentricity=0.9, cached=False)
    >>> f_x, f_y = plain.force(0.6, 0.0)
    >>> round(math.degrees(math.atan2(f_y, -f_x)))  # attitude angle
    48
    """
    _check(geometry, last_eccentricity, accuracy)
    path = _cache_path(geometry, last_eccentricity, accuracy) if cached else None
    found = _read(path) if path is not None else None
    if found is None:
        table, interpolation = _refined(geometry, last_eccentricity, accuracy)
        found = ImpedanceMap(
            table=table,
            last_eccentricity=last_eccentricity,
            accuracy=accuracy,
            interpolation=interpolation,
            turned=_measure(geometry, table, turned=True),
        )
        if path is not None:
            _write(path, found)
    return found


def _check(geometry: FilmGeometry, last_eccentricity: float, accuracy: float) -> None:
    wrong = [
        f"grooves[{n}].pressure = {groove.pressure:g} must be 0 for a map, as the force is no "
        "longer proportional to the velocity; use the direct film"
        for n, groove in enumerate(geometry.grooves)
        if groove.pressure != 0
    ]
    if geometry.bore is not None and np.ptp(geometry.bore) > 0:
        wrong.append(
            f"bore spans {np.ptp(geometry.bore):g} of the clearance and must be round for a map: "
            "the wedge of a worn bore drags oil at any velocity; use the direct film"
        )
    if geometry.inlet_fill < 1:
        wrong.append(
            f"inlet_fill = {geometry.inlet_fill:g} must be 1 for a map, as the front of a starved "
            "film hangs on the velocity; use the direct film"
        )
    if not 0 < last_eccentricity < 1:
        wrong.append(
            f"last_eccentricity = {last_eccentricity:g} must be in (0, 1); the force has no bound "
            "at 1"
        )
    if not accuracy > 0:
        wrong.append(f"accuracy = {accuracy:g} must be > 0; try 5e-3")
    if wrong:
        raise ValueError("\n".join(wrong))


# --- cache


def _cache_path(geometry: FilmGeometry, last_eccentricity: float, accuracy: float) -> Path | None:
    folder = cache_folder()  # its name is the hash of the sources
    if folder is None:
        return None
    digest = hashlib.sha256()
    numbers = (geometry.length_to_diameter, last_eccentricity, accuracy)
    grooves = [(g.angle, g.width, g.length_share) for g in geometry.grooves]
    text = (geometry.n_theta, geometry.n_z, geometry.condition, numbers, grooves)
    digest.update(repr(text).encode())
    if geometry.bore is not None:
        digest.update(np.asarray(geometry.bore, dtype="<f8").tobytes())
    return folder / f"map-{digest.hexdigest()[:24]}.npz"


def _write(path: Path, found: ImpedanceMap) -> None:
    """Whole or not at all; a cache that cannot be written is no error."""
    table = found.table._asdict()
    coefficients = table.pop("coefficients")
    content = io.BytesIO()
    np.savez(
        content,
        coefficients=coefficients,
        scales=np.array(list(table.values()), dtype=np.float64),
        ends=np.array([found.last_eccentricity, found.accuracy]),
        errors=np.array([_numbers(found.interpolation), _numbers(found.turned)]),
    )
    try:
        write_whole(path, sealed(content.getvalue()), force=True)
    except OSError:
        return


def _numbers(error: MapError) -> tuple[float, float, float]:
    return error.median, error.most, error.worst


def _read(path: Path) -> ImpedanceMap | None:
    """None where there is no such file or its content is not what was written."""
    try:
        content = unsealed(path.read_bytes())
    except OSError:
        return None
    if content is None:
        return None
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        parts = {name: stored[name] for name in stored.files}
    mirrored, *scales = (float(value) for value in parts["scales"])
    interpolation, turned = (
        MapError(median=float(a), most=float(b), worst=float(c)) for a, b, c in parts["errors"]
    )
    last, accuracy = (float(value) for value in parts["ends"])
    return ImpedanceMap(
        table=MapTable(np.ascontiguousarray(parts["coefficients"]), int(mirrored), *scales),
        last_eccentricity=last,
        accuracy=accuracy,
        interpolation=interpolation,
        turned=turned,
    )
