"""Oil film of one dimension, compiled: the circumference, with a given shape over z.

With a parabola along the length, ``P = 3/2 p (1 - 4 z^2)``, the equation times a weight and
averaged over the length is

    s (H^3 p')' - 12 (R/L)^2 H^3 p = 6 H' + 12 dH/dtau

for the mean pressure p. The factor s makes it exact if the gap is uniform and the load varies as
the ``1.5``-th harmonic (:func:`finite_factor`): 6/5 in a short bearing, as in Galerkin's method,
and 1 in a long one. Without the second term the film is long.
"""

import math
from typing import Any

from ..jit import kernel

GUEMBEL = 0
REYNOLDS = 1
PERIODIC = 2

CONDITION_CODES = {"guembel": GUEMBEL, "reynolds": REYNOLDS, "periodic": PERIODIC}
"""Cavitation condition of the geometry -> code of the kernels."""

CAVITATED = 0
PRESSURISED = 1
FIXED = 2
DROPPED = 3  # marks while the set is revised
ADDED = 4

MOST_SETS = 200
"""Maximum number of sets tried; cold starts from one dimension settle within 10."""

_HARMONIC = 1.5  # balances eccentricities up to 0.9: lower ones vary slower, higher ones faster


def finite_factor(length_to_diameter: float) -> float:
    """Factor s of the flow round the circle in the film of one dimension.

    Over a uniform gap a source ``cos k theta`` gives the mean pressure of a long bearing times
    ``1 - tanh(q) / q`` with ``q = k L / D``; s is chosen so that the parabola gives the same at
    k = 1.5. The force is then within 0.2 % of the direct solve up to L/D = 1/4 and eccentricity
    0.95, within 2 % up to L/D = 1 and 6 % up to L/D = 4, each up to 0.9 (measured).

    Examples
    --------
    >>> [round(finite_factor(ratio), 3) for ratio in (0.01, 1.0, 100.0)]
    [1.2, 1.188, 1.007]
    """
    q = _HARMONIC * length_to_diameter
    if q < 0.05:  # series expansion: beyond its first term 1e-5
        return 1.2
    return 1.0 / (1.0 - math.tanh(q) / q) - 3.0 / (q * q)


@kernel
def solve_line(work: Any) -> int:
    """Solve for the mean pressure of each line after :func:`fill_lines`; see ``work.line[:, 3]``.

    Returns
    -------
    int
        Number of solves; 0 if the set of pressurised lines did not settle.
    """
    for iteration in range(MOST_SETS):
        _solve_line_set(work)
        if work.condition == GUEMBEL:
            for i in range(work.line.shape[0]):
                work.line[i, 3] = max(0.0, work.line[i, 3])
            return 1
        if not _update_lines(work):
            return iteration + 1
    return 0


@kernel
def line_force(
    work: Any, x: float, y: float, x_rate: float, y_rate: float, long: int
) -> tuple[float, float]:
    """Force of the film of one dimension.

    Parameters
    ----------
    work : DirectFilm
        Aligned; its mesh over the length does not matter.
    x, y, x_rate, y_rate : float
        Journal centre over C and its rates by tau.
    long : int
        1 for the film without flow to the ends, 0 for that of finite length.

    Returns
    -------
    tuple of float
        Non-dimensional F_X, F_Y; zero if the journal touches the bore or the set of pressurised
        lines did not settle (a long film that is only squeezed may have none).
    """
    share = 1.0 if long == 1 else work.line_share
    leak = 0.0 if long == 1 else work.line_leak
    fill_lines(work, x, y, x_rate, y_rate, leak)
    if not math.hypot(x, y) < 1.0 or solve_line(work) == 0:
        return 0.0, 0.0
    n = work.line.shape[0]
    fx = fy = 0.0
    for i in range(n):
        fx -= work.line[i, 3] * work.cosine[i]
        fy -= work.line[i, 3] * work.sine[i]
    cell = 2.0 * math.pi / (n * share)
    return fx * cell, fy * cell


@kernel
def _update_lines(work: Any) -> bool:
    """Drop lines that pull and add lines that would be filled; return whether any changed."""
    line = work.line
    n = line.shape[0]
    changed = False
    for i in range(n):
        if line[i, 4] == PRESSURISED and line[i, 3] < 0.0:
            line[i, 4] = DROPPED
            changed = True
        elif line[i, 4] == CAVITATED:
            before = i - 1 if i > 0 else n - 1
            behind = i + 1 if i < n - 1 else 0
            inflow = line[before, 0] * line[before, 3]
            inflow += line[i, 0] * line[behind, 3] + line[i, 2]
            if inflow > 1e-12 * line[i, 1]:
                line[i, 4] = ADDED
                changed = True
    for i in range(n):
        if line[i, 4] == ADDED:
            line[i, 4] = PRESSURISED
        elif line[i, 4] == DROPPED:
            line[i, 4] = CAVITATED
            line[i, 3] = 0.0
    return changed


@kernel
def fill_lines(work: Any, x: float, y: float, x_rate: float, y_rate: float, leak: float) -> None:
    """Set up the film of one dimension in the columns of ``work.line``.

    Columns 0 conductance to the next line, 1 diagonal, 2 source, 3 pressure, 4 state; the others
    are scratch space. All pressures are multiplied by the factor of :func:`finite_factor`.
    """
    n = work.line.shape[0]
    middle = work.fixed.shape[1] // 2
    step = 2.0 * math.pi / n
    widest = -1
    if work.condition == REYNOLDS or (work.condition == GUEMBEL and leak == 0.0):
        widest = widest_line(work, x, y)
    for i in range(n):
        face = 1.0 - x * work.face_cosine[i] - y * work.face_sine[i] + work.face_bore[i]
        work.line[i, 0] = face * face * face / step
    for i in range(n):
        before = i - 1 if i > 0 else n - 1
        gap = 1.0 - x * work.cosine[i] - y * work.sine[i] + work.bore[i]
        dc = work.face_cosine[i] - work.face_cosine[before]
        ds = work.face_sine[i] - work.face_sine[before]
        wedge = -6.0 * (work.face_bore[i] - work.face_bore[before] - x * dc - y * ds)
        source = wedge + 12.0 * (x_rate * ds - y_rate * dc)
        work.line[i, 1] = work.line[i, 0] + work.line[before, 0] + leak * gap * gap * gap * step
        work.line[i, 2] = source
        work.line[i, 3] = 0.0
        work.line[i, 4] = PRESSURISED if work.condition == GUEMBEL or source > 0.0 else CAVITATED
        if i == widest:
            work.line[i, 4] = FIXED
        if work.fixed[i, middle] != 0:
            work.line[i, 4] = FIXED
            work.line[i, 3] = work.fixed_pressure[i, middle]


@kernel
def _solve_line_set(work: Any) -> None:
    """Tridiagonal elimination round the circle; columns 5 to 7 hold factors and border."""
    line = work.line
    n = line.shape[0]
    start = 0
    for i in range(n):
        if line[i, 4] != PRESSURISED:
            start = i
            break
    closed = line[start, 4] == PRESSURISED
    before = start
    for step in range(1, n):  # forward: pressure = column 5 * next + column 6 + column 7 * start
        i = start + step if start + step < n else start + step - n
        if line[i, 4] == PRESSURISED:
            linked = line[before, 4] == PRESSURISED and step > 1
            inverse = line[i, 1]
            right = line[i, 2]
            border = 0.0
            if linked:
                inverse -= line[before, 0] * line[before, 5]
                right += line[before, 0] * line[before, 6]
                border = line[before, 0] * line[before, 7]
            elif step == 1 and closed:
                border = line[before, 0]
            else:
                right += line[before, 0] * line[before, 3]
            inverse = 1.0 / inverse
            line[i, 5] = line[i, 0] * inverse
            line[i, 6] = right * inverse
            line[i, 7] = border * inverse
        before = i
    behind = start
    for step in range(1, n):
        i = start - step if start - step >= 0 else start - step + n
        if line[i, 4] == PRESSURISED:
            if step == 1 and closed:
                line[i, 7] += line[i, 5]
            elif line[behind, 4] == PRESSURISED and step > 1:
                line[i, 6] += line[i, 5] * line[behind, 6]
                line[i, 7] += line[i, 5] * line[behind, 7]
            else:
                line[i, 6] += line[i, 5] * line[behind, 3]
            line[i, 3] = line[i, 6]
        behind = i
    if closed:
        _close_line(work, start)


@kernel
def _close_line(work: Any, start: int) -> None:
    line = work.line
    n = line.shape[0]
    before = start - 1 if start > 0 else n - 1
    behind = start + 1 if start < n - 1 else 0
    diagonal = line[start, 1]
    right = line[start, 2]
    for side in range(2):
        other = before if side == 0 else behind
        conductance = line[before, 0] if side == 0 else line[start, 0]
        if line[other, 4] == PRESSURISED:
            diagonal -= conductance * line[other, 7]
            right += conductance * line[other, 6]
        else:
            right += conductance * line[other, 3]
    value = right / diagonal
    for i in range(n):
        if i == start:
            line[i, 3] = value
        elif line[i, 4] == PRESSURISED:
            line[i, 3] = line[i, 6] + line[i, 7] * value


@kernel
def widest_line(work: Any, x: float, y: float) -> int:
    """Line at the widest gap."""
    n = work.bore.shape[0]
    line = 0
    widest = -math.inf
    for i in range(n):
        gap = 1.0 - x * work.cosine[i] - y * work.sine[i] + work.bore[i]
        if gap > widest:
            widest = gap
            line = i
    return line
