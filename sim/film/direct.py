"""Direct solution of the finite oil film on a mesh, compiled: active sets and banded elimination.

The flow over the faces of a cell balances, with the face's own ``H^3`` and the wedge and the
squeeze integrated exactly along the circumference. Cavitation (P >= 0) is a linear
complementarity problem with an M-matrix; it is solved by policy iteration (the primal-dual active
set method): take a set of pressurised nodes, solve there, drop nodes that pull, add those that
would be filled, until the set no longer changes. This ends after finitely many solves, in an orbit
mostly after one or two. Each solve eliminates line by line along the circumference, starting behind
a line without unknowns so that the circle need not be closed; if there is none, one line is kept
back as a border.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from .direct_system import (
    BREAK_LINE,
    CHANGED,
    ITERATIONS,
    START,
    STATUS,
    WARM,
    DirectFilm,
    inflow,
    solve_set,
)
from .line import (
    ADDED,
    CAVITATED,
    DROPPED,
    FIXED,
    GUEMBEL,
    MOST_SETS,
    PRESSURISED,
    REYNOLDS,
    fill_lines,
    solve_line,
    widest_line,
)

DIRECT_OK = 0
DIRECT_TOUCH = 1
DIRECT_ITERATIONS = 2


@kernel
def direct_force(
    work: DirectFilm, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force on an aligned journal, starting from the cavitated region of the last call.

    Parameters
    ----------
    work : DirectFilm
    x, y : float
        Journal centre over C.
    x_rate, y_rate : float
        Velocity of the centre: derivatives by tau.

    Returns
    -------
    tuple of float
        Non-dimensional F_X, F_Y; zero if the journal touches the bore (``work.outcome[STATUS]``).
    """
    return direct_tilted_force(work, x, y, x_rate, y_rate, 0.0, 0.0, 0.0, 0.0)


@kernel
def direct_tilted_force(
    work: DirectFilm,
    x: float,
    y: float,
    x_rate: float,
    y_rate: float,
    tilt_x: float,
    tilt_y: float,
    tilt_x_rate: float,
    tilt_y_rate: float,
) -> tuple[float, float]:
    """Force on a journal that may be tilted; a mirrored workspace ignores the tilt."""
    work.outcome[STATUS] = DIRECT_OK
    work.outcome[ITERATIONS] = 0
    least = fill_equations(work, x, y, x_rate, y_rate, tilt_x, tilt_y, tilt_x_rate, tilt_y_rate)
    work.measure[0] = least
    if not least > 0.0:
        work.outcome[STATUS] = DIRECT_TOUCH
        work.outcome[WARM] = 0
        return 0.0, 0.0
    _set_out(work, x, y, x_rate, y_rate)
    if work.condition == GUEMBEL:
        solve_set(work)
        work.outcome[ITERATIONS] = 1
        work.measure[2] = residual(work)
        clip_pressure(work)
    else:
        solve_sets(work)
    work.outcome[WARM] = 1
    return integrate_pressure(work)


@kernel
def solve_sets(work: DirectFilm) -> None:
    """Find the pressure and its set for the current equations; the solves count as iterations."""
    work.outcome[STATUS] = DIRECT_ITERATIONS
    for _ in range(MOST_SETS):
        solve_set(work)
        work.outcome[ITERATIONS] += 1
        if _update_set(work) == 0:
            work.outcome[STATUS] = DIRECT_OK
            break


@kernel
def hold_lines(work: DirectFilm, first: int, last: int) -> None:
    """Hold a range of lines at zero pressure and release all others; for films without grooves.

    A cold film starts filled wherever wedge and squeeze fill it.
    """
    n, m = work.state.shape
    for i in range(n):
        held = (i - first) % n <= (last - first) % n
        for j in range(m):
            if held:
                work.state[i, j] = FIXED
                work.pressure[i, j + 1] = 0.0
            elif work.outcome[WARM] == 0 or work.state[i, j] == FIXED:
                work.state[i, j] = PRESSURISED if work.source[i, j] > 0.0 else CAVITATED
                work.pressure[i, j + 1] = 0.0
    work.outcome[WARM] = 1
    work.outcome[START] = first
    work.outcome[CHANGED] = 0
    _settle(work)


@kernel
def fill_equations(
    work: DirectFilm,
    x: float,
    y: float,
    x_rate: float,
    y_rate: float,
    tilt_x: float,
    tilt_y: float,
    tilt_x_rate: float,
    tilt_y_rate: float,
) -> float:
    """Fill in all conductances and sources; return the least gap of the mesh."""
    n, m = work.state.shape
    k = work.pressure.shape[1]
    step = 2.0 * math.pi / n
    length_step = 1.0 / (k - 1)
    least = math.inf
    for i in range(n):
        before = i - 1 if i > 0 else n - 1
        c, s = work.cosine[i], work.sine[i]
        fc, fs = work.face_cosine[i], work.face_sine[i]
        bc, bs = work.face_cosine[before], work.face_sine[before]
        tilt_here = tilt_x * c + tilt_y * s
        tilt_face = tilt_x * fc + tilt_y * fs
        middle = 1.0 - x * c - y * s + work.bore[i]
        least = min(least, middle - 0.5 * abs(tilt_here))
        face = 1.0 - x * fc - y * fs + work.face_bore[i]
        bore_step = work.face_bore[i] - work.face_bore[before]
        dc, ds = fc - bc, fs - bs
        wedge = -6.0 * (bore_step - x * dc - y * ds) + 12.0 * (x_rate * ds - y_rate * dc)
        twist = 6.0 * (tilt_x * dc + tilt_y * ds) + 12.0 * (tilt_x_rate * ds - tilt_y_rate * dc)
        gap = middle + tilt_here * (0.5 - 0.5 * length_step)
        work.across[i, 0] = gap * gap * gap * (work.length_factor * step / length_step)
        for j in range(m):
            z = (j + 1) * length_step - 0.5
            gap = face - tilt_face * z
            work.along[i, j] = gap * gap * gap * (length_step / step)
            gap = middle - tilt_here * (z + 0.5 * length_step)
            work.across[i, j + 1] = gap * gap * gap * (work.length_factor * step / length_step)
            work.source[i, j] = (wedge + twist * z) * length_step
        if work.mirrored == 1:
            work.along[i, m - 1] *= 0.5
            work.source[i, m - 1] *= 0.5
            work.across[i, m] = 0.0
    for i in range(n):
        before = i - 1 if i > 0 else n - 1
        for j in range(m):
            faces = work.along[before, j] + work.along[i, j]
            work.diagonal[i, j] = faces + work.across[i, j] + work.across[i, j + 1]
    for side in (-0.5, 0.5):
        narrow = _narrowest(work, x + side * tilt_x, y + side * tilt_y)
        least = min(least, narrow)
    return least


@kernel
def _narrowest(work: DirectFilm, x: float, y: float) -> float:
    """Gap on the line of centres, which need not pass through a node."""
    n = work.bore.shape[0]
    turn = math.atan2(y, x) * (0.5 / math.pi)
    place = (turn - math.floor(turn)) * n
    i = int(place) % n
    share = place - math.floor(place)
    bore = (1.0 - share) * work.bore[i] + share * work.bore[(i + 1) % n]
    gap: float = 1.0 - math.hypot(x, y) + bore
    return gap


# --- two dimensions: equations and sets


@kernel
def _set_out(work: DirectFilm, x: float, y: float, x_rate: float, y_rate: float) -> None:
    """Set the initial nodes: those of the last call, or all that the wedge and squeeze fill."""
    n, m = work.state.shape
    if work.condition == REYNOLDS:
        _move_fixed_line(work, widest_line(work, x, y))
    work.outcome[CHANGED] = 0
    if work.outcome[WARM] == 1:
        return
    if work.condition != GUEMBEL:
        fill_lines(work, x, y, x_rate, y_rate, work.line_leak)
        solve_line(work)
    for i in range(n):
        for j in range(m):
            pressurised = work.condition == GUEMBEL or work.line[i, 4] == PRESSURISED
            work.state[i, j] = PRESSURISED if pressurised else CAVITATED
            work.pressure[i, j + 1] = 0.0
            if work.condition == REYNOLDS and i == work.outcome[BREAK_LINE]:
                work.state[i, j] = FIXED
            if work.fixed[i, j + 1] != 0:
                work.state[i, j] = FIXED
                work.pressure[i, j + 1] = work.fixed_pressure[i, j + 1]
    work.outcome[START] = -1
    _settle(work)


@kernel
def _move_fixed_line(work: DirectFilm, line: int) -> None:
    """Hold another line at zero pressure and release the old one."""
    m = work.state.shape[1]
    old = work.outcome[BREAK_LINE]
    work.outcome[BREAK_LINE] = line
    if work.outcome[WARM] == 0 or line == old:
        return
    for j in range(m):
        if old >= 0 and work.fixed[old, j + 1] == 0:
            work.state[old, j] = PRESSURISED if work.source[old, j] > 0.0 else CAVITATED
        work.state[line, j] = FIXED
        work.pressure[line, j + 1] = 0.0
        if work.fixed[line, j + 1] != 0:
            work.pressure[line, j + 1] = work.fixed_pressure[line, j + 1]
    _settle(work)


@kernel
def start_from(work: DirectFilm, pressure: NDArray[np.float64]) -> None:
    """Start the next call from the cavitated region of a pressure field [shape=(n, k)]."""
    n, m = work.state.shape
    for i in range(n):
        for j in range(m):
            work.pressure[i, j + 1] = pressure[i, j + 1]
            work.state[i, j] = PRESSURISED if pressure[i, j + 1] > 0.0 else CAVITATED
            if work.fixed[i, j + 1] != 0:
                work.state[i, j] = FIXED
                work.pressure[i, j + 1] = work.fixed_pressure[i, j + 1]
    _settle(work)
    work.outcome[BREAK_LINE] = -1
    work.outcome[START] = -1
    work.outcome[WARM] = 1


@kernel
def _update_set(work: DirectFilm) -> int:
    """Drop nodes that pull and add nodes that would be filled; return their number."""
    n, m = work.state.shape
    strongest = 0.0
    for i in range(n):
        strongest = max(strongest, abs(work.source[i, 0]))
    threshold = 1e-12 * strongest
    total = 0
    earliest = n
    for i in range(n):
        changed = 0
        for j in range(m):
            if work.state[i, j] == PRESSURISED:
                if work.pressure[i, j + 1] < 0.0:
                    work.state[i, j] = DROPPED
                    changed += 1
            elif work.state[i, j] == CAVITATED and inflow(work, i, j, 1) > threshold:
                work.state[i, j] = ADDED
                changed += 1
        if changed > 0:
            total += changed
            earliest = min(earliest, (i - work.outcome[START]) % n)
    if total > 0:
        _settle(work)
    work.outcome[CHANGED] = earliest
    return total


@kernel
def _settle(work: DirectFilm) -> None:
    """Turn marks into states, and count the unknowns of each line."""
    n, m = work.state.shape
    for i in range(n):
        count = 0
        for j in range(m):
            state = work.state[i, j]
            if state == ADDED:
                work.state[i, j] = PRESSURISED
                count += 1
            elif state == PRESSURISED:
                count += 1
            elif state == DROPPED:
                work.state[i, j] = CAVITATED
                work.pressure[i, j + 1] = 0.0
        work.unknowns[i] = count


@kernel
def clip_pressure(work: DirectFilm) -> None:
    """Drop negative pressure (Guembel)."""
    n, m = work.state.shape
    for i in range(n):
        for j in range(m):
            work.pressure[i, j + 1] = max(0.0, work.pressure[i, j + 1])


@kernel
def residual(work: DirectFilm) -> float:
    """Residual of the current pressure, relative to the largest pressure.

    At each node the smaller of two numbers: the pressure, and its excess over the mean of its
    neighbours and source. Both are >= 0, and one of them is zero at the solution. With the Guembel
    condition, whose equations are solved before negative pressure is dropped, only the second.
    """
    n, m = work.state.shape
    largest = 0.0
    worst = 0.0
    for i in range(n):
        for j in range(m):
            pressure = work.pressure[i, j + 1]
            largest = max(largest, abs(pressure))
            if work.state[i, j] != FIXED:
                excess = pressure - inflow(work, i, j, 1) / work.diagonal[i, j]
                if work.condition != GUEMBEL:
                    excess = min(pressure, excess)
                worst = max(worst, abs(excess))
    return worst / largest if largest > 0.0 else worst


@kernel
def integrate_pressure(work: DirectFilm) -> tuple[float, float]:
    """Force and moment by the trapezoidal rule, over both halves of a mirrored film."""
    n, m = work.state.shape
    k = work.pressure.shape[1]
    cell = 2.0 * math.pi / (n * (k - 1))
    fx = fy = moment_x = moment_y = 0.0
    for i in range(n):
        total = first = 0.0
        for j in range(m):
            share = work.length_weights[j] * work.pressure[i, j + 1]
            total += share
            first += share * ((j + 1) / (k - 1) - 0.5)
            if work.mirrored == 1:
                work.pressure[i, k - 2 - j] = work.pressure[i, j + 1]
        fx -= total * work.cosine[i]
        fy -= total * work.sine[i]
        moment_x -= first * work.cosine[i]
        moment_y -= first * work.sine[i]
    if work.mirrored == 1:  # the other half has the opposite moment arm
        moment_x = moment_y = 0.0
    work.measure[3] = moment_x * cell
    work.measure[4] = moment_y * cell
    return fx * cell, fy * cell
