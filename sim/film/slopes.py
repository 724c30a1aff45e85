"""Stiffness and damping of a solved film, from its own equations.

With the equations ``A(x) P = b(x, x')`` on the pressurised nodes and a force ``-w . P``, the
stiffness is ``(A^-1 w) . (db/dx - dA/dx P)``: A is symmetric, so one factorisation with a
right-hand side for each force gives all. Where the film ruptures P and its slope vanish, so that a
displacement of its rim is of second order: the rim may be held, provided that it is in the right
place:

===============  =================================================================================
rim              held
===============  =================================================================================
of the mesh      at the first node without pressure: the exact derivatives of the mesh's own
                 force, which a Newton search needs. The rim jumps from node to node, and with it
                 the coefficients of a small motion: an uneven error of first order
between nodes    where the wedge has taken up what flows over the last face; a node beyond that
                 face but within the rim counts, and the conductance to the rim goes with the
                 distance left (Shortley and Weller): an even error of second order
===============  =================================================================================

References
----------
Lund, Thomsen (1978), A calculation method and data for the dynamic coefficients of oil-lubricated
journal bearings, Topics in Fluid Film Bearing and Rotor Bearing System Design and Optimization,
ASME, 1-28. Shortley, Weller (1938), J. Applied Physics 9, 334-348, doi:10.1063/1.1710426.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from .direct_system import DirectFilm
from .line import CAVITATED, FIXED, GUEMBEL, PRESSURISED
from .solve import FilmState

Vector = NDArray[np.float64]

_LEAST_CUT = 1e-3  # of a cell: a node nearer to the rim than this counts as on it
_LEAST_SIDE = 0.05  # the same along the length, where the rim is known by interpolation
_NEAR = 9  # cells to either side of the rim whose distance from it is noted


class Coefficients(NamedTuple):
    """Stiffness and damping of a film [shape=(2, 2) or (4, 4)]."""

    stiffness: Vector
    damping: Vector

    def per_load(self, load: float) -> "Coefficients":
        """Coefficients in the usual tabulated form: ``K C / W`` and ``C C omega / W``."""
        return Coefficients(self.stiffness / load, self.damping / load)


class _Rim(NamedTuple):
    """Pressurised region with its rim, and the steady flow in it."""

    state: NDArray[np.int8]  # PRESSURISED within the rim (n, m)
    volume: Vector  # share of each node's cell in its balance (n, m)
    along: Vector  # conductance to the next line, or to a rim before it (n, m)
    across: Vector  # (n, m + 1)
    flow: Vector  # steady, to the next line or to the rim, there at half the distance (n, m)
    ahead: Vector  # cells from the last node to the rim downstream, else 0 (n, m)
    back: Vector  # the same upstream
    depth: Vector  # cells to the nearest rim of the line, negative outside, 0 far off (n, m)


def perturbation(work: DirectFilm, state: FilmState, *, resolved: bool = False) -> Coefficients:
    """Stiffness and damping of a solved film.

    Parameters
    ----------
    work : DirectFilm
        As :func:`.film.direct.direct_tilted_force` left it.
    state : FilmState
        Its state, at rest.
    resolved : bool
        Whether the rim lies between nodes. If not, the result is the exact derivative of the mesh's
        own force, up to rounding.

    Returns
    -------
    Coefficients [shape=(2, 2), or (4, 4) of a workspace that is not mirrored]
    """
    pressure = _unclipped(work)
    place = (state.x, state.y, state.tilt_x, state.tilt_y)
    rim = _rim_of_mesh(work, pressure)
    if resolved and work.condition != GUEMBEL:
        _draw_rim(work, *place, rim)
        _close_sides(work, rim)
    shares = _pressed_shares(pressure) if resolved else (pressure[:, 1:-1] > 0).astype(float)
    counted = shares if work.condition == GUEMBEL else rim.volume
    influence = _solve(rim, _force_weights(work, counted * (rim.state == PRESSURISED)))
    count = influence.shape[2]
    stiffness, damping = np.zeros((count, count)), np.zeros((count, count))
    _add_changes(work, *place, rim, pressure, influence, stiffness, damping)
    cell = 2 * math.pi / (work.pressure.shape[0] * (work.pressure.shape[1] - 1))
    return Coefficients(cell * stiffness, cell * damping)


def _rim_of_mesh(work: DirectFilm, pressure: Vector) -> _Rim:
    own = pressure[:, 1:-1]
    return _Rim(
        state=work.state.copy(),
        volume=np.ones(work.state.shape),
        along=work.along.copy(),
        across=work.across.copy(),
        flow=work.along * (own - np.roll(own, -1, axis=0)),
        ahead=np.zeros(work.state.shape),
        back=np.zeros(work.state.shape),
        depth=np.zeros(work.state.shape),
    )


# --- the rim between nodes


@kernel
def _draw_rim(
    work: DirectFilm, x: float, y: float, tilt_x: float, tilt_y: float, rim: _Rim
) -> None:
    """Place the rim in every line along the circumference, and cut the faces that it crosses."""
    n, m = work.state.shape
    for j in range(m):
        for i in range(n):
            for way in (1, -1):
                if work.state[i, j] != PRESSURISED or work.state[(i + way) % n, j] == PRESSURISED:
                    continue
                reach = _reach(work, i, j, way)
                if reach < 0.0:
                    continue
                nodes = math.floor(reach + 0.5)
                for further in range(1, nodes + 1):
                    rim.state[(i + way * further) % n, j] = PRESSURISED
                rest = max(reach + 0.5 - nodes, _LEAST_CUT)
                if way == 1:
                    rim.ahead[(i + nodes) % n, j] = rest
                else:
                    rim.back[(i - nodes) % n, j] = rest
    for j in range(m):
        z = (j + 1) / (work.pressure.shape[1] - 1) - 0.5
        for i in range(n):
            for way in (1, -1):
                rest = rim.ahead[i, j] if way == 1 else rim.back[i, j]
                other = (i + way) % n
                if rest == 0.0 or rim.state[other, j] == PRESSURISED:
                    continue
                face = i if way == 1 else other
                own = _node_gap(work, i, z, x, y, tilt_x, tilt_y)
                gap = own + 0.5 * rest * (_node_gap(work, other, z, x, y, tilt_x, tilt_y) - own)
                share = gap / _face_gap(work, face, z, x, y, tilt_x, tilt_y)
                rim.along[face, j] = work.along[face, j] * share * share * share / rest
                rim.flow[face, j] = -0.5 * way * rest * work.source[i, j]
                rim.volume[i, j] += 0.5 * rest - 0.5
                _measure_depth(rim, i, j, way, rest)


@kernel
def _reach(work: DirectFilm, i: int, j: int, way: int) -> float:
    """Cells by which the film extends past the last face of a line.

    At the rim the wedge has taken up the inflow over that face and from the adjacent lines. The rim
    may lie in the cell before a groove; -1 if the film reaches the groove.
    """
    n = work.state.shape[0]
    cells = 0
    place = (i + way) % n
    fall = work.pressure[i, j + 1] - work.pressure[place, j + 1]
    inflow = work.along[i if way == 1 else place, j] * fall
    if work.state[place, j] == FIXED:
        taken = -work.source[place, j]
        short = work.pressure[place, j + 1] == 0.0 and inflow < 0.5 * taken
        return inflow / taken if short else -1.0
    while cells < n and work.state[place, j] == CAVITATED:
        sideways = _inflow_beside(work, place, j)
        if cells > 0 and sideways == 0.0:
            break
        cells += 1
        place = (place + way) % n
        if work.state[place, j] == PRESSURISED:
            inflow += 0.5 * sideways  # the other half goes to the film behind the gap
            break
        inflow += sideways
    place = i
    for filled in range(cells):
        place = (place + way) % n
        taken = -work.source[place, j]
        if inflow < taken:
            return filled + _filled_part(work, place, j, way, inflow, taken)
        inflow -= taken
    return float(cells)


@kernel
def _inflow_beside(work: DirectFilm, i: int, j: int) -> float:
    """Flow into a cavitated cell from its neighbours along the length."""
    total = 0.0
    if j > 0 and work.state[i, j - 1] == PRESSURISED:
        total += work.across[i, j] * work.pressure[i, j]
    if j < work.state.shape[1] - 1 and work.state[i, j + 1] == PRESSURISED:
        total += work.across[i, j + 1] * work.pressure[i, j + 2]
    return total


@kernel
def _filled_part(work: DirectFilm, i: int, j: int, way: int, inflow: float, taken: float) -> float:
    """Share of a cell in which a wedge that changes linearly takes up the inflow."""
    n = work.state.shape[0]
    slope = 0.5 * (work.source[(i - way) % n, j] - work.source[(i + way) % n, j])
    first = taken - 0.5 * slope
    root = first + math.sqrt(max(0.0, first * first + 2.0 * slope * inflow))
    return min(1.0, 2.0 * inflow / root) if root > 0.0 else 1.0


@kernel
def _measure_depth(rim: _Rim, i: int, j: int, way: int, rest: float) -> None:
    """Record the distance of the line's nodes from this rim."""
    n = rim.state.shape[0]
    for cells in range(_NEAR):
        place = (i - way * cells) % n
        if rim.state[place, j] != PRESSURISED:
            break
        if rim.depth[place, j] <= 0.0 or rest + cells < rim.depth[place, j]:
            rim.depth[place, j] = rest + cells
    for cells in range(1, _NEAR):
        place = (i + way * cells) % n
        if rim.state[place, j] != CAVITATED:
            break
        if rim.depth[place, j] == 0.0 or rest - cells > rim.depth[place, j]:
            rim.depth[place, j] = rest - cells


@kernel
def _close_sides(work: DirectFilm, rim: _Rim) -> None:
    """Conductance to a rim that passes between two nodes of a line across the rotation."""
    n, m = work.state.shape
    for i in range(n):
        for j in range(m - 1):
            low, high = rim.state[i, j], rim.state[i, j + 1]
            one = low == PRESSURISED and high == CAVITATED
            if not (one or (low == CAVITATED and high == PRESSURISED)):
                continue
            inner = max(rim.depth[i, j], rim.depth[i, j + 1])
            outer = min(rim.depth[i, j], rim.depth[i, j + 1])
            if inner > 0.0 and outer < 0.0:
                rim.across[i, j + 1] /= max(inner / (inner - outer), _LEAST_SIDE)


def _pressed_shares(pressure: Vector) -> Vector:
    """Weights of the nodes in the integral of the positive pressure, for Guembel's condition.

    P is linear between nodes and crosses zero somewhere; a node's contribution ends there.
    """
    own = pressure[:, 1:-1]
    shares: Vector = np.zeros_like(own)
    for way in (1, -1):
        other = np.roll(own, -way, axis=0)
        crossing = (own > 0) != (other > 0)
        fall = np.where(crossing, own - other, 1.0)
        at = own / fall  # from the own node
        inner = np.where(crossing, at - 0.5 * at**2, 0.5) * (own > 0)
        shares += inner + np.where(crossing & (own <= 0), 0.5 * (1 - at) ** 2, 0.0)
    return shares


# --- changes of the equations


@kernel
def _add_changes(
    work: DirectFilm,
    x: float,
    y: float,
    tilt_x: float,
    tilt_y: float,
    rim: _Rim,
    pressure: Vector,
    influence: Vector,
    stiffness: Vector,
    damping: Vector,
) -> None:
    """Add (A^-1 w) . (db/dx - dA/dx P) and (A^-1 w) . db/dx' over all cells.

    A movement lowers the gap by a cosine or a sine of the angle, a tilt by that times z; the
    conductances go with H^3.
    """
    n, m = work.state.shape
    count = stiffness.shape[0]
    step = 1.0 / (work.pressure.shape[1] - 1)
    arc = 2.0 * math.sin(math.pi / n)
    for i in range(n):
        before = i - 1 if i > 0 else n - 1
        middle = 1.0 + work.bore[i] - x * work.cosine[i] - y * work.sine[i]
        tilt = tilt_x * work.cosine[i] + tilt_y * work.sine[i]
        for j in range(m):
            if rim.state[i, j] != PRESSURISED:
                continue
            z = (j + 1) * step - 0.5
            own = pressure[i, j + 1]
            to_next = 3.0 * rim.flow[i, j] / _face_gap(work, i, z, x, y, tilt_x, tilt_y)
            to_last = -3.0 * rim.flow[before, j]
            to_last /= _face_gap(work, before, z, x, y, tilt_x, tilt_y)
            low, high = z - 0.5 * step, z + 0.5 * step
            to_low = 3.0 * work.across[i, j] * (own - pressure[i, j]) / (middle - tilt * low)
            to_high = 3.0 * work.across[i, j + 1] * (own - pressure[i, j + 2])
            to_high /= middle - tilt * high
            length = step * rim.volume[i, j]
            if work.mirrored == 1 and j == m - 1:
                length *= 0.5
            for k in range(count):
                node, face, last = work.cosine[i], work.face_cosine[i], work.face_cosine[before]
                if k % 2 == 1:
                    node, face, last = work.sine[i], work.face_sine[i], work.face_sine[before]
                here, there, beyond = 1.0, 1.0, 1.0
                if k >= 2:
                    here, there, beyond = z, low, high
                imbalance = here * (face * to_next + last * to_last)
                imbalance += node * (there * to_low + beyond * to_high)
                imbalance += 6.0 * (face - last) * length * here
                squeeze = 12.0 * arc * node * length * here
                for force in range(count):
                    stiffness[force, k] += influence[i, j, force] * imbalance
                    damping[force, k] += influence[i, j, force] * squeeze


@kernel
def _node_gap(
    work: DirectFilm, i: int, z: float, x: float, y: float, tilt_x: float, tilt_y: float
) -> float:
    gap: float = 1.0 + work.bore[i]
    gap -= (x + z * tilt_x) * work.cosine[i] + (y + z * tilt_y) * work.sine[i]
    return gap


@kernel
def _face_gap(
    work: DirectFilm, i: int, z: float, x: float, y: float, tilt_x: float, tilt_y: float
) -> float:
    gap: float = 1.0 + work.face_bore[i]
    gap -= (x + z * tilt_x) * work.face_cosine[i] + (y + z * tilt_y) * work.face_sine[i]
    return gap


def _outflow(along: Vector, across: Vector, pressure: Vector) -> Vector:
    """A P with P at the unknown nodes and those next to them (n, m + 2)."""
    own = pressure[:, 1:-1]
    to_next = along * (own - np.roll(own, -1, axis=0))
    to_side = across * np.diff(-pressure, axis=1)
    return to_next - np.roll(to_next, 1, axis=0) + np.diff(to_side, axis=1)


def _unclipped(work: DirectFilm) -> Vector:
    """Pressure that solves the equations (n, m + 2), before *guembel* drops what is negative."""
    m = work.state.shape[1]
    pressure = work.pressure[:, : m + 2].copy()
    if work.condition != GUEMBEL:
        return pressure
    known = work.state != PRESSURISED
    pressure[:, 1:-1] *= known
    right = work.source - _outflow(work.along, work.across, pressure)
    pressure[:, 1:-1] += _solve(_rim_of_mesh(work, pressure), right[:, :, None])[:, :, 0]
    return pressure


def _force_weights(work: DirectFilm, counted: Vector) -> Vector:
    """Weight of every unknown pressure in F_X, F_Y and the moments (n, m, 2 or 4)."""
    m = work.state.shape[1]
    z = np.arange(1, m + 1) / (work.pressure.shape[1] - 1) - 0.5
    sides = np.full(m, 2.0 if work.mirrored else 1.0)
    if work.mirrored:
        sides[-1] = 1.0
    lengths = [sides] if work.mirrored else [sides, z]
    shares = [np.outer(turn, length) for length in lengths for turn in (work.cosine, work.sine)]
    return np.stack([share * counted for share in shares], axis=-1)


def _solve(rim: _Rim, right: Vector) -> Vector:
    """A^-1 of several right-hand sides within the rim, zero elsewhere (n, m, count)."""
    n, m, count = right.shape
    unknown = rim.state == PRESSURISED
    order, width = _line_order(unknown.any(axis=1))
    place = np.full(n, -1)
    place[order] = np.arange(order.size)
    band = np.zeros((order.size * m, width * m + 1))
    solved = (right * unknown[:, :, None])[order].reshape(-1, count)
    _fill_band(rim, order, place, band)
    _solve_band(band, solved)
    result = np.zeros_like(right)
    result[order] = solved.reshape(order.size, m, count)
    return result


@kernel
def _fill_band(rim: _Rim, order: NDArray[np.int64], place: NDArray[np.int64], band: Vector) -> None:
    """Upper half of A line by line, the diagonal first; a known node has a unit row."""
    n, m = rim.state.shape
    for p in range(order.size):
        i = order[p]
        before = i - 1 if i > 0 else n - 1
        behind = i + 1 if i < n - 1 else 0
        q = place[behind]
        for j in range(m):
            if rim.state[i, j] != PRESSURISED:
                band[p * m + j, 0] = 1.0
                continue
            faces = rim.along[before, j] + rim.along[i, j]
            band[p * m + j, 0] = faces + rim.across[i, j] + rim.across[i, j + 1]
            if j < m - 1 and rim.state[i, j + 1] == PRESSURISED:
                band[p * m + j, 1] -= rim.across[i, j + 1]
            if q >= 0 and rim.state[behind, j] == PRESSURISED:
                band[min(p, q) * m + j, abs(p - q) * m] -= rim.along[i, j]


@kernel
def _solve_band(band: Vector, right: Vector) -> None:
    """Gauss elimination of a symmetric band; the solutions replace the right-hand sides."""
    rows, count = right.shape
    most = band.shape[1] - 1
    for r in range(rows):
        inverse = 1.0 / band[r, 0]
        last = min(most, rows - 1 - r)
        for b in range(1, last + 1):
            factor = band[r, b] * inverse
            if factor != 0.0:
                for c in range(b, last + 1):
                    band[r + b, c - b] -= factor * band[r, c]
                for k in range(count):
                    right[r + b, k] -= factor * right[r, k]
    for back in range(rows):
        r = rows - 1 - back
        for k in range(count):
            value = right[r, k]
            for b in range(1, min(most, back) + 1):
                value -= band[r, b] * right[r + b, k]
            right[r, k] = value / band[r, 0]


def _line_order(occupied: NDArray[np.bool_]) -> tuple[NDArray[np.intp], int]:
    """Order lines with unknowns so that neighbours are close; also the largest distance.

    Behind a line without unknowns the circle is open. If every line has some, the circle is folded
    like a belt: 0, n - 1, 1, n - 2 and so on.
    """
    n = occupied.size
    if not occupied.all():
        gap = int(np.flatnonzero(~occupied)[0])
        order = (gap + 1 + np.arange(n)) % n
        return order[occupied[order]], 1
    order = np.empty(n, dtype=np.intp)
    order[0::2] = np.arange((n + 1) // 2)
    order[1::2] = np.arange(n - 1, (n + 1) // 2 - 1, -1)
    return order, 2
