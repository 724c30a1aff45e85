"""Film with a starved inlet: the oil supply determines where the film begins.

Behind the widest gap the oil covers the journal as a layer of the thickness ``t = fill (1 + e)``
over C, the share `fill` of the widest gap, and is carried along without pressure until it fills the
narrowing gap. From that line on the film is that of :mod:`.film.direct`. The line is straight along
the length and lies where the film takes in just what the layer brings,

    mean over z of (6 H - H^3 dP/dtheta) = 6 t

so that it begins before the gap has narrowed to t: the pressure behind it holds oil back. If the
film at the widest gap takes in no more than that, it begins there (the condition *reynolds*); if
the narrowest gap is wider than the layer, there is no pressure. The line lies anywhere
between the nodes; the cell behind it is cut, so that the force has no jumps. The oil in the layer
does not move relative to the front: oil left there by a moving journal for part of a turn is not
modelled (:mod:`.journal.mass_orbit` does so).

Artiles, Heshmat (1985), J. Tribology 107(1), 1-13; Etsion, Pinkus (1975), J. Lubrication
Technology 97(1), 89-95.
"""

import math

from ..jit import kernel
from .direct import (
    DIRECT_ITERATIONS,
    DIRECT_OK,
    DIRECT_TOUCH,
    direct_force,
    fill_equations,
    hold_lines,
    integrate_pressure,
    solve_sets,
)
from .direct_system import ITERATIONS, STATUS, WARM, DirectFilm

FRONT, SLOPE, LINE, CUT = 0, 1, 2, 3  # indices into DirectFilm.inlet

_LEAST_CUT = 1e-6  # least part of a cell between the front and its first node
_TOLERANCE = 1e-8  # of the flow: the force then jumps by a 400th of an integrator's difference
_MOST_FRONTS = 60
_SLOW = 6  # fronts after which every third step bisects
_NEAR = 1e-13  # rad


@kernel
def solved_force(
    work: DirectFilm, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force on an aligned journal by the solver that fits its inlet.

    :func:`starved_force` for a starved inlet, else :func:`.film.direct.direct_force`.
    """
    if work.inlet_fill < 1.0:
        return starved_force(work, x, y, x_rate, y_rate)
    return direct_force(work, x, y, x_rate, y_rate)


@kernel
def starved_force(
    work: DirectFilm, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force on an aligned journal whose film begins where its inlet fills it.

    Parameters
    ----------
    work : DirectFilm
        With an ``inlet_fill`` below 1 and without grooves.
    x, y : float
        Journal centre over C.
    x_rate, y_rate : float
        Velocity of the centre: derivatives by tau.

    Returns
    -------
    tuple of float
        Non-dimensional F_X, F_Y; zero if the journal touches the bore (``work.outcome[STATUS]``)
        or the gap is nowhere filled.
    """
    work.outcome[STATUS] = DIRECT_OK
    work.outcome[ITERATIONS] = 0
    least = fill_equations(work, x, y, x_rate, y_rate, 0.0, 0.0, 0.0, 0.0)
    work.measure[0] = least
    work.inlet[LINE] = -1.0
    if not least > 0.0:
        work.outcome[STATUS] = DIRECT_TOUCH
        work.outcome[WARM] = 0
        return 0.0, 0.0
    if work.outcome[WARM] == 0:
        work.inlet[FRONT] = 0.5 * math.pi
        work.inlet[SLOPE] = 0.0
    if not _find_front(work, x, y, x_rate, y_rate):
        work.outcome[STATUS] = DIRECT_ITERATIONS
    work.outcome[WARM] = 1
    return _cut_force(work)


@kernel
def _cut_force(work: DirectFilm) -> tuple[float, float]:
    """Force of the film, with the first line's pressure weighted by its cut cell."""
    n, m = work.state.shape
    f_x, f_y = integrate_pressure(work)
    line = int(work.inlet[LINE])
    total = 0.0
    for j in range(m):
        total += work.length_weights[j] * work.pressure[line, j + 1]
    more = 0.5 * (1.0 - work.inlet[CUT]) * total * 2.0 * math.pi
    more /= n * (work.pressure.shape[1] - 1)
    return f_x + more * work.cosine[line], f_y + more * work.sine[line]


@kernel
def _find_front(work: DirectFilm, x: float, y: float, x_rate: float, y_rate: float) -> bool:
    """Find the front that takes in just the supply, by safeguarded secants."""
    low, high = 0.0, math.pi
    front, slope = work.inlet[FRONT], work.inlet[SLOPE]
    before, lacked = 0.0, 0.0
    for trial in range(_MOST_FRONTS):
        lacks = _lack(work, x, y, x_rate, y_rate, front)
        if work.outcome[STATUS] != DIRECT_OK:
            return False
        if trial > 0 and front != before:
            slope = (lacks - lacked) / (front - before)
        before, lacked = front, lacks
        work.inlet[FRONT], work.inlet[SLOPE] = front, slope
        if lacks > 0.0:
            low = front
        else:
            high = front
        if abs(lacks) <= _TOLERANCE or high - low <= _NEAR:
            return True
        if (front == 0.0 and lacks <= 0.0) or (front == math.pi and lacks > 0.0):
            return True
        front = _next_front(front, lacks, slope, low, high, trial)
    return False


@kernel
def _next_front(
    front: float, lacks: float, slope: float, low: float, high: float, trial: int
) -> float:
    """Next front by the secant; an untried end or the middle if it leaves the bracket."""
    middle = 0.5 * (low + high)
    if not slope < 0.0 or (trial >= _SLOW and trial % 3 == 0):
        return middle
    ahead = front - lacks / slope
    if ahead <= low:
        return 0.0 if low == 0.0 else middle
    if ahead >= high:
        return math.pi if high == math.pi else middle
    return ahead


@kernel
def _lack(
    work: DirectFilm, x: float, y: float, x_rate: float, y_rate: float, front: float
) -> float:
    """Flow that a film from a front on (angle from the widest gap) takes in beyond the supply."""
    n, m = work.state.shape
    step = 2.0 * math.pi / n
    widest = (math.atan2(y, x) + math.pi) / step
    place = widest + front / step
    behind = math.floor(place) + 1.0  # index of the first node of the film
    cut = max(behind - place, _LEAST_CUT)
    line = int(behind) % n
    hold_lines(work, int(widest) % n, (line - 1) % n)
    _cut_cell(work, line, cut, x, y, x_rate, y_rate)
    solve_sets(work)
    held_back = 0.0
    before = (line - 1) % n
    for j in range(m):
        held_back += work.along[before, j] * work.pressure[line, j + 1]
    if work.mirrored == 1:
        held_back *= 2.0
    ends = 1.0 / (work.pressure.shape[1] - 1)  # the two half cells without unknowns
    at_front = (line - cut) * step
    between = (line - 0.5 * cut) * step
    ds, dc = math.sin(between) - math.sin(at_front), math.cos(between) - math.cos(at_front)
    inside = 6.0 * _gap(work, line, 0.5 * cut, x, y) - 12.0 * (x_rate * ds - y_rate * dc)
    layer = 6.0 * work.inlet_fill * (1.0 + math.hypot(x, y))
    drawn = (1.0 - ends) * inside + ends * 6.0 * _gap(work, line, cut, x, y)
    return float(drawn - layer - held_back)


@kernel
def _gap(work: DirectFilm, line: int, ahead: float, x: float, y: float) -> float:
    """Gap at a fraction of a cell ahead of a line."""
    n = work.state.shape[0]
    angle = (line - ahead) * (2.0 * math.pi / n)
    bore = ahead * work.bore[(line - 1) % n] + (1.0 - ahead) * work.bore[line]
    return float(1.0 - x * math.cos(angle) - y * math.sin(angle) + bore)


@kernel
def _cut_cell(
    work: DirectFilm, line: int, cut: float, x: float, y: float, x_rate: float, y_rate: float
) -> None:
    """Restore the line of the last front, and set the equations of the film's first line."""
    n, m = work.state.shape
    length_step = 1.0 / (work.pressure.shape[1] - 1)
    step = 2.0 * math.pi / n
    _mend(work)
    _keep(work, line)
    before = (line - 1) % n
    work.inlet[CUT] = cut
    near = 0.5 * cut
    angle = (line - near) * step
    fc, fs = math.cos(angle), math.sin(angle)
    gap = _gap(work, line, near, x, y)
    dc, ds = work.face_cosine[line] - fc, work.face_sine[line] - fs
    leaving = 1.0 - x * work.face_cosine[line] - y * work.face_sine[line] + work.face_bore[line]
    source = 6.0 * (gap - leaving) + 12.0 * (x_rate * ds - y_rate * dc)
    for j in range(m):
        half = 0.5 if work.mirrored == 1 and j == m - 1 else 1.0
        work.along[before, j] = half * gap * gap * gap * (length_step / (cut * step))
        work.source[line, j] = half * source * length_step
        work.across[line, j] *= 0.5 + near
    work.across[line, m] *= 0.5 + near
    for j in range(m):
        faces = work.along[before, j] + work.along[line, j]
        work.diagonal[line, j] = faces + work.across[line, j] + work.across[line, j + 1]


@kernel
def _keep(work: DirectFilm, line: int) -> None:
    """Save the equations of a line before they are cut."""
    n, m = work.state.shape
    work.inlet[LINE] = float(line)
    for j in range(m):
        work.inlet_rows[0, j] = work.along[(line - 1) % n, j]
        work.inlet_rows[1, j] = work.source[line, j]
        work.inlet_rows[2, j] = work.diagonal[line, j]
    for j in range(m + 1):
        work.inlet_rows[3, j] = work.across[line, j]


@kernel
def _mend(work: DirectFilm) -> None:
    """Restore the equations of the line that was cut last."""
    n, m = work.state.shape
    line = int(work.inlet[LINE])
    if line < 0:
        return
    for j in range(m):
        work.along[(line - 1) % n, j] = work.inlet_rows[0, j]
        work.source[line, j] = work.inlet_rows[1, j]
        work.diagonal[line, j] = work.inlet_rows[2, j]
    for j in range(m + 1):
        work.across[line, j] = work.inlet_rows[3, j]
