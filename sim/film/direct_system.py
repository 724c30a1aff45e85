"""Linear system of the direct film: its storage, and its elimination with an optional border."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from .line import PRESSURISED, finite_factor

STATUS = 0  # indices into DirectFilm.outcome
ITERATIONS = 1
WARM = 2
BREAK_LINE = 3
START = 4  # line behind which the elimination starts
CHANGED = 5  # first line whose set is new, counted from START
_1, _2, _3, _4, _5, _6, _7 = (np.uint64(i) for i in range(1, 8))


class DirectFilm(NamedTuple):
    """Workspace of one film on one mesh; created by :func:`direct_film`.

    ``n`` nodes along the circumference, ``k`` along the length with both ends, ``m`` unknowns in
    each line: if the film is mirrored, half of the length including the middle.
    """

    condition: int
    mirrored: int
    length_factor: float  # (R / L)^2
    line_share: float  # factor of the flow round the circle in one dimension, see film_line
    line_leak: float  # flow to the ends over line_share
    cosine: NDArray[np.float64]  # at nodes (n,)
    sine: NDArray[np.float64]
    face_cosine: NDArray[np.float64]  # at the face behind each node (n,)
    face_sine: NDArray[np.float64]
    bore: NDArray[np.float64]  # (n,)
    face_bore: NDArray[np.float64]
    length_weights: NDArray[np.float64]  # of the unknown nodes' pressure in the force (m,)
    fixed: NDArray[np.int8]  # nodes of a groove (n, k)
    fixed_pressure: NDArray[np.float64]  # (n, k)
    state: NDArray[np.int8]  # CAVITATED, PRESSURISED or FIXED (n, m)
    pressure: NDArray[np.float64]  # (n, k)
    along: NDArray[np.float64]  # conductance of the face to the next line (n, m)
    across: NDArray[np.float64]  # to the next node of the line; column 0 from the end (n, m + 1)
    source: NDArray[np.float64]  # (n, m)
    diagonal: NDArray[np.float64]  # sum of a cell's conductances (n, m)
    band: NDArray[np.float64]  # upper half, its first column the diagonal (n m, >= 2 m)
    flat_band: NDArray[np.float64]  # same memory as band
    inverse: NDArray[np.float64]  # of the diagonal (n m,)
    right: NDArray[np.float64]  # (n m,)
    solution: NDArray[np.float64]  # (n m,)
    border: NDArray[np.float64]  # (n m, m)
    schur: NDArray[np.float64]  # (m, m + 1)
    row: NDArray[np.int64]  # first row of each line, -1 where it has no unknown (n,)
    unknowns: NDArray[np.int64]  # pressurised nodes of each line (n,)
    line: NDArray[np.float64]  # the film of one dimension, see solve_line (n, 8)
    inlet_fill: float  # of the widest gap; below 1 the film is that of :mod:`.film.starved`
    inlet: NDArray[
        np.float64
    ]  # its front [rad from the widest gap], slope, line and share that is cut (4,)
    inlet_rows: NDArray[np.float64]  # equations of that line before it was cut (4, m + 1)
    outcome: NDArray[np.int64]  # status, iterations, warm, break line
    measure: NDArray[np.float64]  # least gap, cavitated share, residual, moment x, moment y


def empty_direct_film(
    length_to_diameter: float,
    bore: NDArray[np.float64],
    fixed: NDArray[np.int8],
    fixed_pressure: NDArray[np.float64],
    *,
    condition: int,
    mirrored: bool,
    inlet_fill: float = 1.0,
) -> DirectFilm:
    """Create the workspace of a mesh, without a starting point.

    Parameters
    ----------
    length_to_diameter : float
        L / D > 0.
    bore : numpy.ndarray [shape=(n,)]
        Extra gap at the nodes, over C.
    fixed : numpy.ndarray [shape=(n, k)]
        Non-zero at the nodes of a groove.
    fixed_pressure : numpy.ndarray [shape=(n, k)]
        Non-dimensional pressure there.
    condition : int
        One of :data:`CONDITION_CODES`.
    mirrored : bool
        Whether both halves of the length are alike: no tilt, grooves in the middle.
    inlet_fill : float
        Share of the widest gap that the oil brought in fills, in (0, 1].
    """
    n, k = fixed.shape
    m = (k - 1) // 2 if mirrored else k - 2
    angle = 2 * math.pi * np.arange(n) / n
    face = angle + math.pi / n
    share = finite_factor(length_to_diameter)
    band = np.zeros((n * m, m + 8 * -(-m // 8)))
    return DirectFilm(
        condition=condition,
        mirrored=int(mirrored),
        length_factor=0.25 / length_to_diameter**2,
        line_share=share,
        line_leak=3.0 / (share * length_to_diameter**2),
        cosine=np.cos(angle),
        sine=np.sin(angle),
        face_cosine=np.cos(face),
        face_sine=np.sin(face),
        bore=np.ascontiguousarray(bore, dtype=np.float64),
        face_bore=0.5 * (bore + np.roll(bore, -1)),
        length_weights=_length_weights(k, m, mirrored),
        fixed=fixed,
        fixed_pressure=fixed_pressure,
        state=np.zeros((n, m), dtype=np.int8),
        pressure=np.zeros((n, k)),
        along=np.zeros((n, m)),
        across=np.zeros((n, m + 1)),
        source=np.zeros((n, m)),
        diagonal=np.zeros((n, m)),
        band=band,
        flat_band=band.reshape(-1),
        inverse=np.zeros(n * m),
        right=np.zeros(n * m),
        solution=np.zeros(n * m),
        border=np.zeros((n * m, m)),
        schur=np.zeros((m, m + 1)),
        row=np.zeros(n, dtype=np.int64),
        unknowns=np.zeros(n, dtype=np.int64),
        line=np.zeros((n, 8)),
        inlet_fill=inlet_fill,
        inlet=np.zeros(4),
        inlet_rows=np.zeros((4, m + 1)),
        outcome=np.zeros(6, dtype=np.int64),
        measure=np.zeros(5),
    )


def _length_weights(k: int, m: int, mirrored: bool) -> NDArray[np.float64]:
    """Weights of the trapezoidal rule in cells, with both halves added if the film is mirrored.

    This rule matches the work of the cells' own balance, so that damping stays symmetric on any
    mesh; Simpson's rule has at most a third of the mesh error but loses that symmetry.
    """
    weights = np.ones(k)
    if mirrored:
        weights[1 : k // 2] *= 2.0
    return weights[1 : m + 1]


# --- two dimensions: equations and sets


@kernel
def solve_set(work: DirectFilm) -> None:
    """Pressure at all pressurised nodes for the present set.

    Lines before the first one whose set has changed keep their factors.
    """
    n, m = work.state.shape
    start = _choose_start(work)
    bordered = start < 0
    if bordered:
        start = 0
        work.outcome[START] = -1
        work.outcome[CHANGED] = 0
    rows = 0
    first = 0
    work.row[start] = -1
    for position in range(1, n):
        i = start + position if start + position < n else start + position - n
        if position <= work.outcome[CHANGED] - 1:
            first = rows
        if work.unknowns[i] > 0:
            work.row[i] = rows
            rows += m
        else:
            work.row[i] = -1
    for position in range(max(1, work.outcome[CHANGED] - 1), n):
        i = start + position if start + position < n else start + position - n
        if work.row[i] >= 0:
            _fill_line(work, i)
    _eliminate(work, first, rows)
    _substitute(work, rows)
    if bordered:
        _solve_bordered(work, start, rows)
    for i in range(n):
        r = work.row[i]
        if r >= 0:
            for j in range(m):
                if work.state[i, j] == PRESSURISED:
                    work.pressure[i, j + 1] = work.solution[r + j]


@kernel
def _choose_start(work: DirectFilm) -> int:
    """Find a line without unknowns, preferably that of the last solve; -1 if there is none."""
    start: int = work.outcome[START]
    if start >= 0 and work.unknowns[start] == 0:
        return start
    work.outcome[CHANGED] = 0
    for i in range(work.unknowns.shape[0]):
        if work.unknowns[i] == 0:
            work.outcome[START] = i
            return i
    return -1


@kernel
def inflow(work: DirectFilm, i: int, j: int, unknowns: int) -> float:
    """Source plus inflow from known neighbours, and from unknown ones if `unknowns` is 1."""
    n, m = work.state.shape
    before = i - 1 if i > 0 else n - 1
    behind = i + 1 if i < n - 1 else 0
    total: float = work.source[i, j]
    if unknowns == 1 or work.state[before, j] != PRESSURISED:
        total += work.along[before, j] * work.pressure[before, j + 1]
    if unknowns == 1 or work.state[behind, j] != PRESSURISED:
        total += work.along[i, j] * work.pressure[behind, j + 1]
    if j > 0 and (unknowns == 1 or work.state[i, j - 1] != PRESSURISED):
        total += work.across[i, j] * work.pressure[i, j]
    if j < m - 1 and (unknowns == 1 or work.state[i, j + 1] != PRESSURISED):
        total += work.across[i, j + 1] * work.pressure[i, j + 2]
    return total


@kernel
def _fill_line(work: DirectFilm, i: int) -> None:
    """Fill one line's rows of the band; a known node gets a trivial row."""
    n, m = work.state.shape
    behind = i + 1 if i < n - 1 else 0
    r = work.row[i]
    coupled = work.row[behind] > r
    for j in range(m):
        for b in range(m + 1):
            work.band[r + j, b] = 0.0
        if work.state[i, j] == PRESSURISED:
            work.band[r + j, 0] = work.diagonal[i, j]
            work.right[r + j] = inflow(work, i, j, 0)
            if coupled and work.state[behind, j] == PRESSURISED:
                work.band[r + j, m] = -work.along[i, j]
            if j < m - 1 and work.state[i, j + 1] == PRESSURISED:
                work.band[r + j, 1] -= work.across[i, j + 1]
        else:
            work.band[r + j, 0] = 1.0
            work.right[r + j] = 0.0


@kernel
def _eliminate(work: DirectFilm, first: int, rows: int) -> None:
    """Factorise the band from a given row on as U^T D^-1 U, together with the right-hand side.

    Eight entries of a row stay in registers while the rows above are subtracted, the newest
    last because it is ready last; the band is wide enough that entries past its edge read as zero.
    Unsigned indices avoid the test for negative ones, which would cost half of the time.
    """
    band, inverse, right = work.flat_band, work.inverse, work.right
    m = work.state.shape[1]
    width = work.band.shape[1]
    for r in range(first, rows):
        value = right[r]
        for b in range(min(m, r), 0, -1):
            q = np.uint64(r - b)
            value -= band[q * np.uint64(width) + np.uint64(b)] * right[q]
        for base in range(0, m, 8):
            own = np.uint64(r * width + base)
            a0, a1, a2, a3 = band[own], band[own + _1], band[own + _2], band[own + _3]
            a4, a5, a6, a7 = band[own + _4], band[own + _5], band[own + _6], band[own + _7]
            half = max(0, m - base - 4)  # above the band ends within four entries
            for b in range(min(m - base, r), half, -1):
                q = np.uint64(r - b)
                p = q * np.uint64(width) + np.uint64(b)
                factor = band[p] * inverse[q]
                p += np.uint64(base)
                a0 -= factor * band[p]
                a1 -= factor * band[p + _1]
                a2 -= factor * band[p + _2]
                a3 -= factor * band[p + _3]
            for b in range(min(half, r), 0, -1):
                q = np.uint64(r - b)
                p = q * np.uint64(width) + np.uint64(b)
                factor = band[p] * inverse[q]
                p += np.uint64(base)
                a0 -= factor * band[p]
                a1 -= factor * band[p + _1]
                a2 -= factor * band[p + _2]
                a3 -= factor * band[p + _3]
                a4 -= factor * band[p + _4]
                a5 -= factor * band[p + _5]
                a6 -= factor * band[p + _6]
                a7 -= factor * band[p + _7]
            band[own], band[own + _1], band[own + _2], band[own + _3] = a0, a1, a2, a3
            band[own + _4], band[own + _5], band[own + _6], band[own + _7] = a4, a5, a6, a7
        inverse[r] = 1.0 / band[np.uint64(r * width)]
        right[r] = value * inverse[r]


@kernel
def _substitute(work: DirectFilm, rows: int) -> None:
    m = work.state.shape[1]
    band, solution = work.band, work.solution
    for back in range(rows):
        r = rows - 1 - back
        value = 0.0
        for b in range(min(m, back), 0, -1):
            value += band[r, b] * solution[r + b]
        solution[r] = work.right[r] - value * work.inverse[r]


@kernel
def _solve_bordered(work: DirectFilm, line: int, rows: int) -> None:
    """Solve with one line kept as a border: its unknowns follow from a small dense system."""
    n, m = work.state.shape
    before = line - 1 if line > 0 else n - 1
    behind = line + 1 if line < n - 1 else 0
    for r in range(rows):
        for c in range(m):
            work.border[r, c] = 0.0
    for j in range(m):
        if work.state[line, j] == PRESSURISED:
            if work.state[behind, j] == PRESSURISED:
                work.border[work.row[behind] + j, j] = -work.along[line, j]
            if work.state[before, j] == PRESSURISED:
                work.border[work.row[before] + j, j] = -work.along[before, j]
    _eliminate_border(work, rows)
    for c in range(m):
        for j in range(m):
            work.schur[j, c] = 0.0
    for j in range(m):
        work.schur[j, m] = 0.0
        if work.state[line, j] != PRESSURISED:
            work.schur[j, j] = 1.0
            continue
        work.schur[j, j] = work.diagonal[line, j]
        work.schur[j, m] = inflow(work, line, j, 0)
        if j < m - 1 and work.state[line, j + 1] == PRESSURISED:
            work.schur[j, j + 1] -= work.across[line, j + 1]
        if j > 0 and work.state[line, j - 1] == PRESSURISED:
            work.schur[j, j - 1] -= work.across[line, j]
        for side in range(2):
            other = before if side == 0 else behind
            if work.state[other, j] == PRESSURISED:
                conductance = work.along[before, j] if side == 0 else work.along[line, j]
                r = work.row[other] + j
                for c in range(m):
                    work.schur[j, c] += conductance * work.border[r, c]
                work.schur[j, m] += conductance * work.solution[r]
    _solve_dense(work.schur)
    for j in range(m):
        if work.state[line, j] == PRESSURISED:
            work.pressure[line, j + 1] = work.schur[j, m]
    for r in range(rows):
        for c in range(m):
            work.solution[r] -= work.border[r, c] * work.schur[c, m]


@kernel
def _eliminate_border(work: DirectFilm, rows: int) -> None:
    """Solve for all columns of the border with the current factors."""
    m = work.state.shape[1]
    band, border = work.band, work.border
    for r in range(rows):
        for b in range(1, min(m, rows - 1 - r) + 1):
            factor = band[r, b] * work.inverse[r]
            if factor != 0.0:
                for c in range(m):
                    border[r + b, c] -= factor * border[r, c]
    for back in range(rows):
        r = rows - 1 - back
        for b in range(1, min(m, back) + 1):
            factor = band[r, b]
            if factor != 0.0:
                for c in range(m):
                    border[r, c] -= factor * border[r + b, c]
        for c in range(m):
            border[r, c] *= work.inverse[r]


@kernel
def _solve_dense(system: NDArray[np.float64]) -> None:
    """Gauss elimination of a diagonally dominant system; the solution replaces the last column."""
    m = system.shape[0]
    for p in range(m):
        inverse = 1.0 / system[p, p]
        for q in range(p + 1, m):
            factor = system[q, p] * inverse
            for c in range(p + 1, m + 1):
                system[q, c] -= factor * system[p, c]
    for back in range(m):
        p = m - 1 - back
        value = system[p, m]
        for c in range(p + 1, m):
            value -= system[p, c] * system[c, m]
        system[p, m] = value / system[p, p]
