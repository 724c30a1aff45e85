"""Over-relaxation of the finite oil film, as the orbit paper solves it: the slow reference.

Point by point over the mesh of :mod:`.film.direct`, on the same equations, with pressures below
zero set to zero at once (which converges to the complementarity solution: Cryer 1971). It serves
to verify the direct solver, and to show the limits of the paper's method.
"""

import math

from ..jit import kernel
from .direct import DIRECT_TOUCH, clip_pressure, fill_equations, integrate_pressure, residual
from .direct_system import ITERATIONS, STATUS, WARM, DirectFilm, inflow
from .line import CAVITATED, FIXED, GUEMBEL, PRESSURISED, REYNOLDS, widest_line

PAPER_RELAXATION = 1.96
"""Ma, Lu, Chen 2010."""

RELAX_DIVERGED = 3
RELAX_STALLED = 4
RELAX_LIMIT = 5

_GROWTH = 1e6  # of a sweep's change over the first one: more than in any convergent run
_WATCH = 250  # sweeps; a convergent factor of 0.999 shrinks the change to 0.78 over them
_STALL = 0.9
_LARGE = 1e-3  # a run whose pressures still change by this much is not at rounding level


@kernel
def relaxed_force(
    work: DirectFilm,
    x: float,
    y: float,
    x_rate: float,
    y_rate: float,
    relaxation: float,
    tolerance: float,
    most_sweeps: int,
) -> tuple[float, float]:
    """Force on an aligned journal by projected over-relaxation, warm-started.

    Parameters
    ----------
    work : DirectFilm
        Any workspace; one that is not mirrored is swept over the whole length, as in the paper. Set
        ``outcome[WARM]`` to 0 to start from zero pressure.
    x, y, x_rate, y_rate : float
        As in :func:`.film.direct.direct_force`.
    relaxation : float
        Factor in (0, 2); the paper's is :data:`PAPER_RELAXATION`.
    tolerance : float
        Sum of changes in a sweep over the sum of pressures.
    most_sweeps : int
        Maximum number of sweeps.

    Returns
    -------
    tuple of float
        Non-dimensional F_X, F_Y of the last sweep; ``work.outcome`` holds the status and the
        sweeps, ``work.measure[2]`` the residual.
    """
    least = fill_equations(work, x, y, x_rate, y_rate, 0.0, 0.0, 0.0, 0.0)
    work.measure[0] = least
    work.outcome[ITERATIONS] = 0
    if not least > 0.0:
        work.outcome[STATUS] = DIRECT_TOUCH
        work.outcome[WARM] = 0
        return 0.0, 0.0
    _prepare(work, x, y)
    work.outcome[STATUS] = _sweep_until(work, relaxation, tolerance, most_sweeps)
    work.outcome[WARM] = 1 if work.outcome[STATUS] == 0 else 0
    work.measure[2] = residual(work)
    if work.condition == GUEMBEL:
        clip_pressure(work)
        work.outcome[WARM] = 0
    return integrate_pressure(work)


@kernel
def _prepare(work: DirectFilm, x: float, y: float) -> None:
    n, m = work.state.shape
    fixed_line = widest_line(work, x, y) if work.condition == REYNOLDS else -1
    for i in range(n):
        for j in range(m):
            if work.outcome[WARM] == 0:
                work.pressure[i, j + 1] = 0.0
            work.state[i, j] = CAVITATED
            if i == fixed_line:
                work.state[i, j] = FIXED
                work.pressure[i, j + 1] = 0.0
            if work.fixed[i, j + 1] != 0:
                work.state[i, j] = FIXED
                work.pressure[i, j + 1] = work.fixed_pressure[i, j + 1]


@kernel
def _sweep_until(work: DirectFilm, relaxation: float, tolerance: float, most_sweeps: int) -> int:
    """Sweep to the tolerance; return 0 or the status that ended the sweeps."""
    first = math.inf
    watched = math.inf
    for sweep in range(most_sweeps):
        change = _sweep(work, relaxation)
        work.outcome[ITERATIONS] = sweep + 1
        if change <= tolerance:
            return 0
        if sweep == 10:
            first = change
        if not change <= _GROWTH * first or not math.isfinite(change):
            return RELAX_DIVERGED
        if sweep % _WATCH == _WATCH - 1:
            if change > _STALL * watched:
                return RELAX_DIVERGED if change > _LARGE else RELAX_STALLED
            watched = change
    return RELAX_LIMIT


@kernel
def _sweep(work: DirectFilm, relaxation: float) -> float:
    """Sweep all nodes once; return the sum of changes over the sum of pressures."""
    n, m = work.state.shape
    free = work.condition == GUEMBEL
    changes = 0.0
    total = 0.0
    for i in range(n):
        for j in range(m):
            if work.state[i, j] == FIXED:
                continue
            old = work.pressure[i, j + 1]
            balance = inflow(work, i, j, 1) / work.diagonal[i, j]
            new = old + relaxation * (balance - old)
            if new < 0.0 and not free:
                new = 0.0
            work.state[i, j] = PRESSURISED if new > 0.0 else CAVITATED
            work.pressure[i, j + 1] = new
            changes += abs(new - old)
            total += abs(new)
    if total == 0.0:
        return changes
    return changes / total
