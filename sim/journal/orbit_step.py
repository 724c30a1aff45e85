"""Stages of one step: explicit integrators and RODAS, and the damping that limits explicit steps.

Source: Hairer, Wanner (1996), Solving Ordinary Differential Equations II, section IV.10 (RODAS and
its coefficients).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel

EULER, RK4, ADAPTIVE = range(3)

STATE, POINT, STAGE, _ERROR = 0, 1, 2, 10  # rows of MarchWork.y; stages take eight rows

_A = np.zeros((6, 6))
_A[1, :1] = [1.544]
_A[2, :2] = [0.9466785280815826, 0.2557011698983284]
_A[3, :3] = [3.314825187068521, 2.896124015972201, 0.9986419139977817]
_A[4, :4] = [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950]
_A[5, :5] = [*_A[4, :4], 1.0]
_C = np.zeros((6, 6))
_C[1, :1] = [-5.6688]
_C[2, :2] = [-2.430093356833875, -0.2063599157091915]
_C[3, :3] = [-0.1073529058151375, -9.594562251023355, -20.47028614809616]
_C[4, :4] = [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160]
_C[5, :5] = [
    8.083246795921522,
    -7.981132988064893,
    -31.52159432874371,
    16.31930543123136,
    -6.058818238834054,
]
_INSTANT = np.array([0.0, 0.386, 0.21, 0.63, 1.0, 1.0])
_SLOPE = np.array([0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0])
_GAMMA = 0.25
STAGES = 6


class Tableau(NamedTuple):
    """Coefficients of RODAS in the form without products with the Jacobian."""

    a: NDArray[np.float64]
    c: NDArray[np.float64]
    instant: NDArray[np.float64]
    slope: NDArray[np.float64]


class MarchWork(NamedTuple):
    """Scratch memory of the march."""

    y: NDArray[np.float64]  # (11, 4): state, point, eight stages, error
    rate: NDArray[np.float64]  # (6,): acceleration, load and its rates at the point
    first: NDArray[np.float64]  # (6,): the same at the start of the step
    jacobian: NDArray[np.float64]  # derivatives of the acceleration
    before: NDArray[np.float64]  # tau, state and acceleration at the start of the last step
    cursor: NDArray[np.int64]  # index into the load history
    held: NDArray[np.float64]  # speed at first contact
    clock: NDArray[np.float64]  # (4,)
    counts: NDArray[np.int64]  # (6,)


TAU, STEP, ATTEMPT, JUMP = range(4)
"""Indices of the clock: instant, step planned, step tried, next jump of the load [rad]."""

CALL, SAMPLE, STEPS, REJECTED, CALLS, FAILED = range(6)
"""Indices of the counts: call within the step, next sample, steps taken, steps rejected,
calls of the film, 1 if the last of them gave no pressure."""


@kernel
def copy_row(y: Any, source: int, target: int) -> None:
    """Copy a row of four numbers."""
    for c in range(4):
        y[target, c] = y[source, c]


@kernel
def spacing(work: MarchWork, c: int) -> float:
    """Step of a difference quotient of the acceleration along a coordinate of the state.

    A position moves towards the centre by a millionth of the gap, a rate by a millionth of the
    velocity that loads the film.
    """
    y = work.y
    x, z = y[STATE, 0], y[STATE, 1]
    if c < 2:
        gap = max(1.0 - math.sqrt(x * x + z * z), 1e-4)
        return -1e-6 * gap if y[STATE, c] > 0.0 else 1e-6 * gap
    v_x, v_y = y[STATE, 2] + 0.5 * z, y[STATE, 3] - 0.5 * x
    return 1e-6 * math.sqrt(v_x * v_x + v_y * v_y) + 1e-9


@kernel
def take_difference(work: MarchWork, c: int) -> None:
    """Fill one column of the Jacobian from the acceleration at the shifted point."""
    width = spacing(work, c)
    for r in range(2):
        work.jacobian[r, c] = (work.rate[r] - work.first[r]) / width


@kernel
def rodas_point(work: MarchWork, stage: int, t: Tableau) -> None:
    """Set the point of a RODAS stage."""
    copy_row(work.y, STATE, POINT)
    for j in range(stage):
        for c in range(4):
            work.y[POINT, c] += t.a[stage, j] * work.y[STAGE + j, c]


@kernel
def rodas_solve(work: MarchWork, stage: int, h: float, t: Tableau) -> None:
    """Increment of one stage; position and velocity are eliminated from each other."""
    y, first, jac = work.y, work.first, work.jacobian
    rate = first if stage == 0 else work.rate
    r0, r1 = y[POINT, 2], y[POINT, 3]
    r2, r3 = rate[0], rate[1]
    slope = t.slope[stage] * h
    r2, r3 = r2 + slope * first[4], r3 + slope * first[5]
    for j in range(stage):
        f = t.c[stage, j] / h
        r0 += f * y[STAGE + j, 0]
        r1 += f * y[STAGE + j, 1]
        r2 += f * y[STAGE + j, 2]
        r3 += f * y[STAGE + j, 3]
    s = 1.0 / (_GAMMA * h)
    m00 = s - jac[0, 2] - jac[0, 0] / s
    m01 = -jac[0, 3] - jac[0, 1] / s
    m10 = -jac[1, 2] - jac[1, 0] / s
    m11 = s - jac[1, 3] - jac[1, 1] / s
    b0 = r2 + (jac[0, 0] * r0 + jac[0, 1] * r1) / s
    b1 = r3 + (jac[1, 0] * r0 + jac[1, 1] * r1) / s
    det = m00 * m11 - m01 * m10
    k = STAGE + stage
    y[k, 2] = (b0 * m11 - b1 * m01) / det
    y[k, 3] = (b1 * m00 - b0 * m10) / det
    y[k, 0] = (r0 + y[k, 2]) / s
    y[k, 1] = (r1 + y[k, 3]) / s


@kernel
def rodas_error(work: MarchWork, tolerance: float) -> float:
    """Error of the step over the tolerance: a share of the gap, and of gap and speed."""
    y = work.y
    x, z = y[POINT, 0], y[POINT, 1]
    e, x0, z0 = STAGE + 5, y[STATE, 0], y[STATE, 1]
    gap = max(min(1.0 - math.sqrt(x * x + z * z), 1.0 - math.sqrt(x0 * x0 + z0 * z0)), 1e-3)
    speed = gap + math.sqrt(y[POINT, 2] ** 2 + y[POINT, 3] ** 2)
    position = math.sqrt(y[e, 0] ** 2 + y[e, 1] ** 2) / gap
    velocity = math.sqrt(y[e, 2] ** 2 + y[e, 3] ** 2) / speed
    return max(position, velocity) / tolerance


@kernel
def runge_kutta_point(work: MarchWork, stage: int, h: float) -> None:
    """Set the point of a stage of the classical method."""
    copy_row(work.y, STATE, POINT)
    for c in range(4):
        work.y[POINT, c] += (h if stage == 3 else 0.5 * h) * work.y[STAGE + stage - 1, c]


@kernel
def keep_stage(work: MarchWork, stage: int) -> None:
    """Save the rates at the point, for the classical method."""
    y = work.y
    y[STAGE + stage, 0], y[STAGE + stage, 1] = y[POINT, 2], y[POINT, 3]
    y[STAGE + stage, 2], y[STAGE + stage, 3] = work.rate[0], work.rate[1]


@kernel
def explicit_finish(work: MarchWork, method: int, h: float) -> None:
    """Put the new state at the point."""
    y = work.y
    copy_row(y, STATE, POINT)
    if method == EULER:
        y[POINT, 2] += h * work.first[0]
        y[POINT, 3] += h * work.first[1]
        y[POINT, 0] += h * y[POINT, 2]
        y[POINT, 1] += h * y[POINT, 3]
        return
    for c in range(4):
        middle = y[STAGE + 1, c] + y[STAGE + 2, c]
        y[POINT, c] += h / 6.0 * (y[STAGE, c] + 2.0 * middle + y[STAGE + 3, c])


@kernel
def largest_damping(work: MarchWork) -> float:
    """Largest eigenvalue (by magnitude) of the damping matrix from the Jacobian."""
    jac = work.jacobian
    mean: float = 0.5 * (jac[0, 2] + jac[1, 3])
    det: float = jac[0, 2] * jac[1, 3] - jac[0, 3] * jac[1, 2]
    rest = mean * mean - det
    return abs(mean) + math.sqrt(rest) if rest > 0.0 else math.sqrt(max(det, 0.0))


@kernel
def first_stage(work: MarchWork, t: Tableau) -> None:
    """First stage of RODAS, at the state."""
    copy_row(work.y, STATE, POINT)
    rodas_solve(work, 0, work.clock[ATTEMPT], t)


RODAS = Tableau(_A, _C, _INSTANT, _SLOPE)


def new_work(state: tuple[float, float, float, float]) -> MarchWork:
    """Scratch memory for a march from a position and its rates."""
    work = MarchWork(
        y=np.zeros((11, 4)),
        rate=np.zeros(6),
        first=np.zeros(6),
        jacobian=np.zeros((2, 4)),
        before=np.zeros(7),
        cursor=np.zeros(1, np.int64),
        held=np.zeros(1),
        clock=np.zeros(4),
        counts=np.zeros(6, np.int64),
    )
    work.y[STATE] = state
    return work
