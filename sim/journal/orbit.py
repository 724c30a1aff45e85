"""A journal of one mass in its oil film: the time march, for every film that gives a force.

With lengths over the radial clearance C and time ``tau = omega t``,

    X'' = alpha F_X + q_X(tau),  Y'' = alpha F_Y + q_Y(tau),  alpha = eta R^3 L / (M C^3 omega),

where F is the film's non-dimensional force and q the load over ``M C omega^2``: a constant (weight
``g / (C omega^2)`` and static load), an unbalance that turns with the shaft (``u`` is the
eccentricity of the mass over C), and any history of time. The film is chosen by an integer code;
a wall may be added, a contact law that takes over where the film ends.

Three integrators. *euler*: velocity first, then position with the new velocity, at a fixed step,
as in the source paper (first order). *rk4*: the classical fourth-order method at a fixed step.
*adaptive*: the Rosenbrock method RODAS, order 4 with an embedded third, L-stable and stiffly
accurate, with a step that follows the error. The film is a damper whose strength grows with
``(1 - eccentricity)^(-5/2)``: an explicit step is bound by it wherever the journal comes near the
wall, and a run that breaks the bound ends with a status.

Sources: Ma, Lu, Chen (2010), J. Vibration, Measurement & Diagnosis 30(1), 7-10; Hairer, Wanner
(1996), Solving Ordinary Differential Equations II, section IV.10 (RODAS and its coefficients).
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.law import CONTACT, friction_force, normal_force
from ..film.direct import DIRECT_OK
from ..film.direct_system import STATUS, DirectFilm
from ..film.impedance_map import ImpedanceMap, MapTable, map_force, map_peak
from ..film.short import short_force
from ..film.solve import FilmGeometry, direct_film
from ..film.starved import solved_force
from ..jit import kernel, sine_cosine

FILM_NONE, FILM_SHORT, FILM_MAP, FILM_DIRECT = range(4)

EULER, RK4, ADAPTIVE = range(3)

INTEGRATORS = {"euler": EULER, "rk4": RK4, "adaptive": ADAPTIVE}
"""Name -> code: the paper's semi-implicit Euler, classical Runge-Kutta, RODAS."""


class OrbitStatus(IntEnum):
    """How a run ended. Everything but OK carries a cure."""

    OK = 0
    DIVERGED = 1
    STEP = 2
    THIN = 3
    OVERLOAD = 4
    CONTACT = 5
    OVERLAP = 6
    FILM = 7
    STEPS = 8
    UNSETTLED = 9

    @property
    def ok(self) -> bool:
        """True where the run can be used."""
        return self is OrbitStatus.OK

    @property
    def text(self) -> str:
        """One sentence with the cure."""
        return _STATUS_TEXT[self]


_STATUS_TEXT = {
    OrbitStatus.OK: "done",
    OrbitStatus.DIVERGED: "the state is no longer finite; shorten the step",
    OrbitStatus.STEP: (
        "the step is too long for the squeeze stiffness of the film, which an explicit integrator "
        "feels; shorten the step, or choose the integrator 'adaptive'"
    ),
    OrbitStatus.THIN: (
        "the journal came nearer to the wall than the film's mesh or map resolves; refine the mesh "
        "and raise last_eccentricity, or add a wall"
    ),
    OrbitStatus.OVERLOAD: (
        "the load that rests on the journal is more than the film carries at its last "
        "eccentricity; lower the load, raise speed, viscosity or length, or add a wall"
    ),
    OrbitStatus.CONTACT: (
        "the journal touches its bearing; add a wall with a contact law, or lower the load"
    ),
    OrbitStatus.OVERLAP: (
        "the journal sinks into the wall by more than a tenth of the clearance, beyond the contact "
        "law; raise the stiffness of the wall"
    ),
    OrbitStatus.FILM: (
        "the direct solver of the film found no pressure where the journal went, as where it "
        "touches a bump of the bore; check bore and grooves, or lower the load"
    ),
    OrbitStatus.STEPS: (
        "the adaptive integrator used up its steps; raise max_steps, or loosen the tolerance"
    ),
    OrbitStatus.UNSETTLED: (
        "where a step ends was not found, as where film and journal change too much in it; shorten "
        "the step, or refine the mesh"
    ),
}

OVERLAP_LIMIT = 0.1  # of the clearance
_EDGE = 1e-9  # about a jump of the load, on either side of which a stage stands [rad]
_MOST_SPLITS = 40  # shortest adaptive step over the first: 2^-40
_STABLE = (2.0, 2.785, math.inf)  # step times damping, on the negative real axis


# --- what a run is told


class OrbitFilm(NamedTuple):
    """A film behind an integer code; parts that the code does not use are empty."""

    code: int  # FILM_*
    length_to_diameter: float
    last_eccentricity: float
    table: MapTable
    work: DirectFilm


class Wall(NamedTuple):
    """Contact of journal and bearing, in units of C, 1/omega and M C omega^2."""

    present: int
    contact: NDArray[Any]  # (1,) of CONTACT
    surface_speed: float  # R / C


class Load(NamedTuple):
    """Everything that pushes the journal, over M C omega^2, and alpha."""

    alpha: float
    static_x: float
    static_y: float
    unbalance: float  # of the mass centre over C
    phase: float  # of the unbalance at tau = 0 [rad]
    time: NDArray[np.float64]  # (n,) of the history [rad]
    history: NDArray[np.float64]  # (n, 2)
    orders: NDArray[np.float64]  # (n, 4): order, phase at tau = 0 [rad], peak along X, Y


_NO_TABLE = MapTable(np.zeros((3, 1, 4, 4)), 1, 1.0, 0.5, 1.0, 1.0, 1.0)
_NO_HISTORY = (np.zeros(1), np.zeros((1, 2)))


def _no_work() -> DirectFilm:
    return direct_film(FilmGeometry(length_to_diameter=1.0, n_theta=8, n_z=5))


def no_film() -> OrbitFilm:
    """No film at all: the absent effect."""
    return OrbitFilm(FILM_NONE, 1.0, math.inf, _NO_TABLE, _no_work())


def short_film(length_to_diameter: float, *, last_eccentricity: float = 0.9999) -> OrbitFilm:
    """Short-bearing film in closed form (Ocvirk, half film).

    Parameters
    ----------
    length_to_diameter : float
        L / D; the form overstates the force of bearings longer than about 1/2.
    last_eccentricity : float
        Where a run ends with a status, < 1.
    """
    return OrbitFilm(FILM_SHORT, length_to_diameter, last_eccentricity, _NO_TABLE, _no_work())


def map_film(impedance: ImpedanceMap, length_to_diameter: float) -> OrbitFilm:
    """Film of an impedance map of a bearing of that L / D."""
    return OrbitFilm(
        FILM_MAP, length_to_diameter, impedance.last_eccentricity, impedance.table, _no_work()
    )


def solved_film(geometry: FilmGeometry, *, last_eccentricity: float = 0.995) -> OrbitFilm:
    """Film solved anew at every call, started from the call before.

    The workspace belongs to this value: one run at a time.
    """
    return OrbitFilm(
        FILM_DIRECT,
        geometry.length_to_diameter,
        last_eccentricity,
        _NO_TABLE,
        direct_film(geometry),
    )


def no_wall() -> Wall:
    """No wall: a journal that reaches it ends the run."""
    return Wall(0, np.zeros(1, CONTACT), 0.0)


def load(
    *,
    alpha: float,
    static: tuple[float, float] = (0.0, 0.0),
    unbalance: float = 0.0,
    phase: float = 0.0,
    time: ArrayLike | None = None,
    history: ArrayLike | None = None,
    orders: ArrayLike = (),
) -> Load:
    """Load of a run, validated.

    Parameters
    ----------
    alpha : float
        Film force over inertia, > 0.
    static : tuple of float
        Constant part along X and Y, over M C omega^2: weight and static load.
    unbalance : float
        Eccentricity of the mass over C, >= 0; its force turns with the shaft.
    phase : float
        Its angle from X at tau = 0 [rad].
    time : array_like [shape=(n,)], optional
        Instants of the history [rad], not falling; one that stands twice is a jump. Before the
        first and after the last the history keeps their value.
    history : array_like [shape=(n, 2)], optional
        Load along X and Y at those instants, linear between them.
    orders : array_like [shape=(n, 4)], optional
        Loads that repeat: cycles per revolution, phase at tau = 0 [rad], peaks along X and Y.

    Returns
    -------
    Load
        For :func:`run_orbit` and :func:`.mass_orbit.mass_orbit`.

    Raises
    ------
    ValueError
        With everything that is wrong.

    Examples
    --------
    A step of the source paper at tau = 16 pi:

    >>> step = load(alpha=0.83537, static=(0.3972, 0.0), **step_history(16 * math.pi, (1.0, 0.0)))
    >>> load_at(step, 50.0), load_at(step, 51.0)
    ((0.3972, 0.0), (1.3972, 0.0))
    """
    instants, values = _NO_HISTORY
    if time is not None and history is not None:
        instants = np.ascontiguousarray(time, dtype=np.float64)
        values = np.ascontiguousarray(history, dtype=np.float64)
    wrong = []
    if not alpha > 0 or not math.isfinite(alpha):
        wrong.append(f"alpha = {alpha:g} must be > 0 and finite; without a film use no_film()")
    if not unbalance >= 0:
        wrong.append(f"unbalance = {unbalance:g} must be >= 0; turn it by its phase")
    if (time is None) != (history is None):
        wrong.append("time and history must both be given, or neither")
    if values.shape != (len(instants), 2):
        wrong.append(f"history.shape = {values.shape} must be ({len(instants)}, 2) as time has")
    if not len(instants) or not np.all(np.isfinite(instants)) or not np.all(np.isfinite(values)):
        wrong.append("time and history must be finite and not empty; leave out missing samples")
    elif np.any(np.diff(instants) < 0):
        n = int(np.argmax(np.diff(instants) < 0))
        wrong.append(
            f"time[{n + 1}] = {instants[n + 1]:g} must be >= time[{n}] = {instants[n]:g}; sort them"
        )
    if wrong:
        raise ValueError("\n".join(wrong))
    repeated = np.ascontiguousarray(orders, dtype=np.float64).reshape(-1, 4)
    return Load(alpha, static[0], static[1], unbalance, phase, instants, values, repeated)


def step_history(start: float, size: tuple[float, float]) -> dict[str, NDArray[np.float64]]:
    """History for :func:`load`: nothing, from `start` [rad] on `size`."""
    return {
        "time": np.array([start, start]),
        "history": np.array([(0.0, 0.0), size]),
    }


def rectangular_history(
    start: float, end: float, size: tuple[float, float]
) -> dict[str, NDArray[np.float64]]:
    """History for :func:`load`: `size` from `start` to `end` [rad], nothing before and after."""
    return {
        "time": np.array([start, start, end, end]),
        "history": np.array([(0.0, 0.0), size, size, (0.0, 0.0)]),
    }


def half_sine_history(
    start: float, end: float, size: tuple[float, float], n: int = 257
) -> dict[str, NDArray[np.float64]]:
    """History for :func:`load`: half a sine of that peak from `start` to `end` [rad].

    Sampled at n instants: straight lines miss the sine by ``(pi / (n - 1))^2 / 8`` of its peak,
    2e-5 as it is.
    """
    share = np.linspace(0.0, 1.0, n)
    return {
        "time": start + share * (end - start),
        "history": np.sin(np.pi * share)[:, None] * np.asarray(size, dtype=np.float64),
    }


# --- right-hand side


@kernel
def film_force(
    film: OrbitFilm, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force of any film.

    Beyond its last eccentricity the journal is taken as at that: trial points of an integrator lie
    there, and contact at a wall.
    """
    square = x * x + y * y
    if square > film.last_eccentricity * film.last_eccentricity:
        back = film.last_eccentricity / math.sqrt(square)
        x, y = x * back, y * back
    f_x = f_y = 0.0
    if film.code == FILM_MAP:
        f_x, f_y = map_force(film.table, x, y, x_rate, y_rate)
    elif film.code == FILM_SHORT:
        f_x, f_y = short_force(film.length_to_diameter, x, y, x_rate, y_rate)
    elif film.code == FILM_DIRECT:
        f_x, f_y = solved_force(film.work, x, y, x_rate, y_rate)
    return f_x, f_y


@kernel
def _interval(time: Any, tau: float, first: int) -> int:
    """Last instant not after tau, looked for from `first` on; -1 before all."""
    n = first
    while n >= 0 and time[n] > tau:
        n -= 1
    while n + 1 < time.size and time[n + 1] <= tau:
        n += 1
    return n


@kernel
def _load(q: Load, tau: float, cursor: Any) -> tuple[float, float, float, float]:
    """Load along X and Y, and its rates."""
    x, y, x_slope, y_slope = q.static_x, q.static_y, 0.0, 0.0
    if q.unbalance != 0.0:
        s, c = sine_cosine(tau + q.phase)
        y_slope, x_slope = q.unbalance * c, -q.unbalance * s
        x, y = x + y_slope, y - x_slope
    for k in range(len(q.orders)):
        order, along, across = q.orders[k, 0], q.orders[k, 2], q.orders[k, 3]
        s, c = sine_cosine(order * tau + q.orders[k, 1])
        x, y = x + along * c, y + across * c
        x_slope, y_slope = x_slope - order * along * s, y_slope - order * across * s
    n = _interval(q.time, tau, cursor[0])
    cursor[0] = n
    if n < 0 or n + 1 == q.time.size:
        n = max(n, 0)
        return x + q.history[n, 0], y + q.history[n, 1], x_slope, y_slope
    span = q.time[n + 1] - q.time[n]
    share = (tau - q.time[n]) / span
    dx, dy = q.history[n + 1, 0] - q.history[n, 0], q.history[n + 1, 1] - q.history[n, 1]
    return (
        x + q.history[n, 0] + share * dx,
        y + q.history[n, 1] + share * dy,
        x_slope + dx / span,
        y_slope + dy / span,
    )


def load_at(q: Load, tau: float) -> tuple[float, float]:
    """Load along X and Y at an instant [rad]; at a jump, the value after it."""
    x, y, _, _ = _load(q, tau, np.zeros(1, np.int64))
    return x, y


@kernel
def wall_force(
    wall: Wall, impact: float, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force of the wall on the journal, over M C omega^2; `impact` is the speed at first touch."""
    c = wall.contact[0]
    distance = math.sqrt(x * x + y * y)
    if distance <= c.clearance:
        return 0.0, 0.0
    n_x, n_y = x / distance, y / distance
    push = max(0.0, normal_force(distance - c.clearance, x_rate * n_x + y_rate * n_y, impact, c))
    drag = friction_force(y_rate * n_x - x_rate * n_y + wall.surface_speed, push, c)
    return -push * n_x + drag * n_y, -push * n_y - drag * n_x


# --- march

_STATE, _POINT, _STAGE, _ERROR = 0, 1, 2, 10  # rows of _Work.y; stages take eight rows

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
_STAGES = 6


class _Tableau(NamedTuple):
    """Coefficients of RODAS in the form that needs no products with the Jacobian."""

    a: NDArray[np.float64]
    c: NDArray[np.float64]
    instant: NDArray[np.float64]
    slope: NDArray[np.float64]


class _Work(NamedTuple):
    """Scratch of the march."""

    y: NDArray[np.float64]  # (11, 4): state, point, eight stages, error
    rate: NDArray[np.float64]  # (6,): acceleration, load and its rates at the point
    first: NDArray[np.float64]  # (6,): the same at the start of the step
    jacobian: NDArray[np.float64]  # (2, 4): of the acceleration
    before: NDArray[np.float64]  # (7,): tau, state and acceleration where the last step began
    cursor: NDArray[np.int64]  # (1,): place in the load history
    held: NDArray[np.float64]  # (1,): speed at first touch
    clock: NDArray[np.float64]  # (4,)
    counts: NDArray[np.int64]  # (6,)


class _Settings(NamedTuple):
    method: int
    step: float  # fixed, or the first
    tolerance: float
    max_steps: int
    sample_step: float
    stable: float  # largest step times damping
    safe: float  # eccentricity up to which it is kept in any case


TAU, STEP, ATTEMPT, JUMP = range(4)
"""Places of the clock: instant, step planned, step tried, next jump of the load [rad]."""

CALL, SAMPLE, STEPS, REJECTED, CALLS, FAILED = range(6)
"""Places of the counts: call within the step, next sample, steps taken and tried in vain,
calls of the film, 1 where the last of them gave no pressure."""

_MORE, _TAKEN = -2, -1  # what a call may say besides a status code


@kernel
def _acceleration(work: _Work, tau: float, film: OrbitFilm, q: Load, wall: Wall) -> None:
    """Acceleration at the point, into work.rate with the load and its rates."""
    x, y, u, v = work.y[_POINT, 0], work.y[_POINT, 1], work.y[_POINT, 2], work.y[_POINT, 3]
    f_x, f_y = film_force(film, x, y, u, v)
    if film.code == FILM_DIRECT:
        work.counts[FAILED] = film.work.outcome[STATUS] != DIRECT_OK
    q_x, q_y, x_slope, y_slope = _load(q, tau, work.cursor)
    a_x, a_y = q.alpha * f_x + q_x, q.alpha * f_y + q_y
    if wall.present == 1:
        w_x, w_y = wall_force(wall, work.held[0], x, y, u, v)
        a_x, a_y = a_x + w_x, a_y + w_y
    work.counts[CALLS] += 1
    work.rate[0], work.rate[1] = a_x, a_y
    work.rate[2], work.rate[3], work.rate[4], work.rate[5] = q_x, q_y, x_slope, y_slope


@kernel
def _copy_row(y: Any, source: int, target: int) -> None:
    for c in range(4):
        y[target, c] = y[source, c]


@kernel
def _spacing(work: _Work, c: int) -> float:
    """Step of a difference quotient of the acceleration along a coordinate of the state.

    A position moves towards the centre by a millionth of the gap, a rate by a millionth of the
    velocity that loads the film.
    """
    y = work.y
    x, z = y[_STATE, 0], y[_STATE, 1]
    if c < 2:
        gap = max(1.0 - math.sqrt(x * x + z * z), 1e-4)
        return -1e-6 * gap if y[_STATE, c] > 0.0 else 1e-6 * gap
    v_x, v_y = y[_STATE, 2] + 0.5 * z, y[_STATE, 3] - 0.5 * x
    return 1e-6 * math.sqrt(v_x * v_x + v_y * v_y) + 1e-9


@kernel
def _difference(work: _Work, c: int) -> None:
    """One column of the Jacobian from the acceleration at the shifted point."""
    spacing = _spacing(work, c)
    for r in range(2):
        work.jacobian[r, c] = (work.rate[r] - work.first[r]) / spacing


@kernel
def _rodas_point(work: _Work, stage: int, t: _Tableau) -> None:
    _copy_row(work.y, _STATE, _POINT)
    for j in range(stage):
        for c in range(4):
            work.y[_POINT, c] += t.a[stage, j] * work.y[_STAGE + j, c]


@kernel
def _rodas_solve(work: _Work, stage: int, h: float, t: _Tableau) -> None:
    """Increment of one stage; position and velocity are eliminated from each other."""
    y, first, jac = work.y, work.first, work.jacobian
    rate = first if stage == 0 else work.rate
    r0, r1 = y[_POINT, 2], y[_POINT, 3]
    r2, r3 = rate[0], rate[1]
    slope = t.slope[stage] * h
    r2, r3 = r2 + slope * first[4], r3 + slope * first[5]
    for j in range(stage):
        f = t.c[stage, j] / h
        r0 += f * y[_STAGE + j, 0]
        r1 += f * y[_STAGE + j, 1]
        r2 += f * y[_STAGE + j, 2]
        r3 += f * y[_STAGE + j, 3]
    s = 1.0 / (_GAMMA * h)
    m00 = s - jac[0, 2] - jac[0, 0] / s
    m01 = -jac[0, 3] - jac[0, 1] / s
    m10 = -jac[1, 2] - jac[1, 0] / s
    m11 = s - jac[1, 3] - jac[1, 1] / s
    b0 = r2 + (jac[0, 0] * r0 + jac[0, 1] * r1) / s
    b1 = r3 + (jac[1, 0] * r0 + jac[1, 1] * r1) / s
    det = m00 * m11 - m01 * m10
    k = _STAGE + stage
    y[k, 2] = (b0 * m11 - b1 * m01) / det
    y[k, 3] = (b1 * m00 - b0 * m10) / det
    y[k, 0] = (r0 + y[k, 2]) / s
    y[k, 1] = (r1 + y[k, 3]) / s


@kernel
def _rodas_error(work: _Work, tolerance: float) -> float:
    """Error of the step over what is allowed: a share of the gap, and of gap and speed."""
    y = work.y
    x, z = y[_POINT, 0], y[_POINT, 1]
    e, x0, z0 = _STAGE + 5, y[_STATE, 0], y[_STATE, 1]
    gap = max(min(1.0 - math.sqrt(x * x + z * z), 1.0 - math.sqrt(x0 * x0 + z0 * z0)), 1e-3)
    speed = gap + math.sqrt(y[_POINT, 2] ** 2 + y[_POINT, 3] ** 2)
    position = math.sqrt(y[e, 0] ** 2 + y[e, 1] ** 2) / gap
    velocity = math.sqrt(y[e, 2] ** 2 + y[e, 3] ** 2) / speed
    return max(position, velocity) / tolerance


@kernel
def _runge_kutta_point(work: _Work, stage: int, h: float) -> None:
    _copy_row(work.y, _STATE, _POINT)
    for c in range(4):
        work.y[_POINT, c] += (h if stage == 3 else 0.5 * h) * work.y[_STAGE + stage - 1, c]


@kernel
def _keep_stage(work: _Work, stage: int) -> None:
    y = work.y
    y[_STAGE + stage, 0], y[_STAGE + stage, 1] = y[_POINT, 2], y[_POINT, 3]
    y[_STAGE + stage, 2], y[_STAGE + stage, 3] = work.rate[0], work.rate[1]


@kernel
def _explicit_finish(work: _Work, method: int, h: float) -> None:
    """New state at the point."""
    y = work.y
    _copy_row(y, _STATE, _POINT)
    if method == EULER:
        y[_POINT, 2] += h * work.first[0]
        y[_POINT, 3] += h * work.first[1]
        y[_POINT, 0] += h * y[_POINT, 2]
        y[_POINT, 1] += h * y[_POINT, 3]
        return
    for c in range(4):
        middle = y[_STAGE + 1, c] + y[_STAGE + 2, c]
        y[_POINT, c] += h / 6.0 * (y[_STAGE, c] + 2.0 * middle + y[_STAGE + 3, c])


def _safe_eccentricity(film: OrbitFilm, alpha: float, step: float, stable: float) -> float:
    """Eccentricity up to which a fixed step is stable in any case; beyond, the march asks.

    The short film damps more than any other of its length, by at most the squeeze of a full circle:
    ``4 (L/D)^2`` times the integral of ``cos^2 / H^3``, ``pi (1 + 2 eps^2) / (1 - eps^2)^2.5``.
    """
    if film.code == FILM_NONE:
        return math.inf
    squares = np.linspace(0.0, 1.0, 1001)[:-1] ** 2
    strength = 4 * math.pi * film.length_to_diameter**2 * alpha
    damping = strength * (1 + 2 * squares) / (1 - squares) ** 2.5
    last = int(np.searchsorted(step * damping, stable)) - 1
    return math.sqrt(squares[max(last, 0)])


@kernel
def _damping(work: _Work) -> float:
    """Largest eigenvalue (by size) of the damping matrix from the Jacobian."""
    jac = work.jacobian
    mean: float = 0.5 * (jac[0, 2] + jac[1, 3])
    det: float = jac[0, 2] * jac[1, 3] - jac[0, 3] * jac[1, 2]
    rest = mean * mean - det
    return abs(mean) + math.sqrt(rest) if rest > 0.0 else math.sqrt(max(det, 0.0))


@kernel
def _hermite(share: float, h: float, p: float, v: float, a: float, end: Any) -> Any:
    """Quintic through place, rate and acceleration at both ends; place and rate at the share."""
    p1, v1, a1 = end
    d = p1 - p - h * (v + 0.5 * h * a)
    e = h * (v1 - v - h * a)
    f = h * h * (a1 - a)
    c3 = 10.0 * d - 4.0 * e + 0.5 * f
    c4 = -15.0 * d + 7.0 * e - f
    c5 = 6.0 * d - 3.0 * e + 0.5 * f
    s = share
    place = p + s * (h * v + s * (0.5 * h * h * a + s * (c3 + s * (c4 + s * c5))))
    rate = v + (s * (h * h * a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h
    return place, rate


@kernel
def _fill_samples(work: _Work, q: Load, sample_step: float, record: Any) -> None:
    """Samples between the start of the last step and the state.

    The acceleration at the end is that before a jump of the load.
    """
    b, y, tau, sample = work.before, work.y, work.clock[TAU], work.counts[SAMPLE]
    if sample == 0:
        for c in range(4):
            record[0, c] = y[_STATE, c]
        work.counts[SAMPLE] = 1
        return
    h = tau - b[0]
    q_x, q_y, _, _ = _load(q, tau - _EDGE, work.cursor)
    a_x = work.first[0] - work.first[2] + q_x
    a_y = work.first[1] - work.first[3] + q_y
    while sample < record.shape[0] and sample * sample_step <= tau + _EDGE:
        share = (sample * sample_step - b[0]) / h
        x, u = _hermite(share, h, b[1], b[3], b[5], (y[_STATE, 0], y[_STATE, 2], a_x))
        z, v = _hermite(share, h, b[2], b[4], b[6], (y[_STATE, 1], y[_STATE, 3], a_y))
        record[sample, 0], record[sample, 1] = x, z
        record[sample, 2], record[sample, 3] = u, v
        sample += 1
    work.counts[SAMPLE] = sample


@kernel
def _next_jump(q: Load, tau: float) -> float:
    """First jump of the history after tau; infinity where there is none."""
    for n in range(q.time.size - 1):
        if q.time[n] > tau + _EDGE and q.time[n + 1] == q.time[n]:
            return float(q.time[n])
    return math.inf


@kernel
def _hold_contact(work: _Work, wall: Wall) -> None:
    """Remember the speed at which the wall was touched first."""
    if wall.present == 0:
        return
    y = work.y
    x, z = y[_STATE, 0], y[_STATE, 1]
    distance = math.sqrt(x * x + z * z)
    if distance > wall.contact[0].clearance:
        return
    outward = 0.0
    if distance > 0.0:
        outward = (x * y[_STATE, 2] + z * y[_STATE, 3]) / distance
    work.held[0] = max(outward, wall.contact[0].speed_floor)


@kernel
def _fault(work: _Work, film: OrbitFilm, wall: Wall) -> int:
    """Status code of the state."""
    y = work.y
    square = y[_STATE, 0] ** 2 + y[_STATE, 1] ** 2
    if not math.isfinite(square + y[_STATE, 2] + y[_STATE, 3]):
        return 1
    if wall.present == 1:
        return 6 if square > (wall.contact[0].clearance + OVERLAP_LIMIT) ** 2 else 0
    if square >= 1.0:
        return 5
    return 3 if square > film.last_eccentricity**2 else 0


@kernel
def _place(work: _Work, s: _Settings, t: _Tableau) -> float:
    """Put the point where the next call wants the acceleration; its instant.

    Call 0 of a step stands at the state. Then the explicit stages come, or the four difference
    quotients of the Jacobian and the other stages of RODAS. A fixed step that may be unstable asks
    for two difference quotients after its stages.
    """
    call, clock = work.counts[CALL], work.clock
    if s.method == ADAPTIVE and call > 4:
        _rodas_point(work, call - 4, t)
        return float(clock[TAU] + t.instant[call - 4] * clock[ATTEMPT] - _EDGE)
    if s.method == RK4 and 0 < call < 4:
        _runge_kutta_point(work, call, s.step)
        return float(clock[TAU] + (s.step if call == 3 else 0.5 * s.step) - _EDGE)
    _copy_row(work.y, _STATE, _POINT)
    if call > 0:
        c = _column(s.method, call)
        work.y[_POINT, c] += _spacing(work, c)
    return float(clock[TAU] + _EDGE)


@kernel
def _column(method: int, call: int) -> int:
    """Coordinate along which a call takes a difference quotient; 2 and 3 are the rates."""
    return call - 1 if method == ADAPTIVE else call - (2 if method == RK4 else -1)


@kernel
def _begin_step(work: _Work, q: Load, s: _Settings, record: Any) -> int:
    """After call 0: keep what it found, fill samples, see whether the run is over."""
    counts, clock = work.counts, work.clock
    if counts[FAILED] == 1:  # at a trial point it would not matter
        return 7
    for c in range(6):
        work.first[c] = work.rate[c]
    if s.method == ADAPTIVE:
        _fill_samples(work, q, s.sample_step, record)
    elif clock[TAU] >= counts[SAMPLE] * s.sample_step - _EDGE:
        for c in range(4):
            record[counts[SAMPLE], c] = work.y[_STATE, c]
        counts[SAMPLE] += 1
    if counts[SAMPLE] == record.shape[0]:
        return 0
    if s.method == ADAPTIVE:
        if counts[STEPS] + counts[REJECTED] >= s.max_steps:
            return 8
        if clock[TAU] + _EDGE >= clock[JUMP]:
            clock[JUMP] = _next_jump(q, clock[TAU])
            clock[STEP] = min(clock[STEP], s.step)
        end = min(s.sample_step * (record.shape[0] - 1), clock[JUMP])
        clock[ATTEMPT] = min(clock[STEP], end - clock[TAU])
    return _MORE


@kernel
def _fixed_call(work: _Work, s: _Settings) -> int:
    """After a call of a fixed step: the stage, then the test of stability where it is due."""
    call, y = work.counts[CALL], work.y
    stages = 4 if s.method == RK4 else 1
    work.counts[CALL] = call + 1
    if call < stages:
        if s.method == RK4:
            _keep_stage(work, call)
        if call < stages - 1:
            return _MORE
        # at the centre too, where nothing is safe
        if y[_STATE, 0] ** 2 + y[_STATE, 1] ** 2 >= s.safe * s.safe:
            return _MORE
    else:
        _difference(work, _column(s.method, call))
        if call < stages + 1:
            return _MORE
        if s.step * _damping(work) > s.stable:
            return 2
    _explicit_finish(work, s.method, s.step)
    work.clock[TAU] = (work.counts[STEPS] + 1) * s.step
    return _TAKEN


@kernel
def _adaptive_call(work: _Work, film: OrbitFilm, wall: Wall, s: _Settings, t: _Tableau) -> int:
    """After a call of an adaptive step: Jacobian, stages, and the verdict."""
    call, clock = work.counts[CALL], work.clock
    work.counts[CALL] = call + 1
    if call <= 4:
        if call > 0:
            _difference(work, call - 1)
        if call == 4:
            _first_stage(work, t)
        return _MORE
    _rodas_solve(work, call - 4, clock[ATTEMPT], t)
    if call < 3 + _STAGES:
        return _MORE
    for c in range(4):  # stiffly accurate: the last stage corrects its own point
        work.y[_POINT, c] += work.y[_STAGE + _STAGES - 1, c]
    error = _rodas_error(work, s.tolerance)
    x, y = work.y[_POINT, 0], work.y[_POINT, 1]
    beyond = wall.present == 0 and x * x + y * y > film.last_eccentricity**2
    # a step that would leave the film is cut until it ends at its edge
    if error <= 1.0 and not (beyond and clock[ATTEMPT] > 1e-6 * s.step):
        _accept(work, error)
        return _TAKEN
    work.counts[REJECTED] += 1
    clock[ATTEMPT] *= max(0.2, 0.9 * error**-0.25) if 1.0 < error < math.inf else 0.25
    clock[STEP] = clock[ATTEMPT]
    if work.counts[STEPS] + work.counts[REJECTED] >= s.max_steps:
        return 8
    if clock[ATTEMPT] < s.step * 2.0**-_MOST_SPLITS:
        return 1
    _first_stage(work, t)
    work.counts[CALL] = 5
    return _MORE


@kernel
def _first_stage(work: _Work, t: _Tableau) -> None:
    _copy_row(work.y, _STATE, _POINT)
    _rodas_solve(work, 0, work.clock[ATTEMPT], t)


@kernel
def _accept(work: _Work, error: float) -> None:
    """Remember where the step began, go on, and choose the next step."""
    clock, before = work.clock, work.before
    attempt = clock[ATTEMPT]
    grown = attempt * min(5.0, 0.9 * max(error, 1e-8) ** -0.25)
    # a step cut short by a jump or the end says nothing against the one that was planned
    clock[STEP] = max(grown, clock[STEP]) if attempt < clock[STEP] else grown
    before[0] = clock[TAU]
    for c in range(4):
        before[1 + c] = work.y[_STATE, c]
    before[5], before[6] = work.first[0], work.first[1]
    clock[TAU] += attempt


@kernel
def _march(
    film: OrbitFilm, q: Load, wall: Wall, s: _Settings, t: _Tableau, work: _Work, record: Any
) -> int:
    """March to the last sample; status code.

    All integrators share one loop with one call of the acceleration, so that the film is compiled
    into it once.
    """
    work.clock[STEP] = s.step
    work.clock[JUMP] = _next_jump(q, -1.0)
    _hold_contact(work, wall)
    while True:
        _acceleration(work, _place(work, s, t), film, q, wall)
        code = _MORE
        if work.counts[CALL] == 0:
            code = _begin_step(work, q, s, record)
        if code == _MORE:
            if s.method == ADAPTIVE:
                code = _adaptive_call(work, film, wall, s, t)
            else:
                code = _fixed_call(work, s)
        if code == _TAKEN:
            work.counts[STEPS] += 1
            work.counts[CALL] = 0
            _copy_row(work.y, _POINT, _STATE)
            _hold_contact(work, wall)
            code = _fault(work, film, wall)
            if code == 0:
                continue
        if code != _MORE:
            return code


# --- what a run gives


@dataclass(frozen=True, kw_only=True, eq=False)
class OrbitRun:
    """A run of the journal.

    Attributes
    ----------
    tau : numpy.ndarray [shape=(n,)]
        Instants [rad].
    position, velocity : numpy.ndarray [shape=(n, 2)]
        Journal centre along X and Y over C, and its rates by tau.
    status : OrbitStatus
        How the run ended; cut off there where it is not OK.
    end : float
        tau reached.
    steps, rejected, calls : int
        Steps taken, adaptive steps tried in vain, evaluations of the film.
    """

    tau: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    status: OrbitStatus
    end: float
    steps: int
    rejected: int
    calls: int

    @property
    def eccentricity(self) -> NDArray[np.float64]:
        """Distance of the journal from the centre of its bearing over C [shape=(n,)]."""
        return np.hypot(self.position[:, 0], self.position[:, 1])


def run_orbit(
    film: OrbitFilm,
    q: Load,
    *,
    duration: float,
    start: tuple[float, float] = (0.0, 0.0),
    start_velocity: tuple[float, float] = (0.0, 0.0),
    integrator: str = "adaptive",
    step: float = 0.02,
    sample_step: float | None = None,
    tolerance: float = 1e-5,
    max_steps: int = 10_000_000,
    wall: Wall | None = None,
) -> OrbitRun:
    """Path of the journal under its load.

    Parameters
    ----------
    film : Film
        Of :func:`short_film`, :func:`map_film`, :func:`solved_film` or :func:`no_film`.
    q : Load
        Of :func:`load`.
    duration : float
        [rad]; the last sample lies at the last multiple of `sample_step` within.
    start, start_velocity : tuple of float
        Place of the journal over C, rates by tau.
    integrator : str
        One of :data:`INTEGRATORS`.
    step : float
        Fixed step, or the first of the adaptive integrator [rad].
    sample_step : float, optional
        Of the samples kept [rad]; by default `step`. A fixed step is shortened until it divides it.
    tolerance : float
        Of one adaptive step: error of the position over the gap that is left, of the rates over gap
        plus speed.
    max_steps : int
        Most adaptive steps.
    wall : Wall, optional
        Contact law at the wall; without, the run ends there.

    Returns
    -------
    OrbitRun

    Raises
    ------
    ValueError
        With everything that is wrong with the arguments.

    Examples
    --------
    A journal that rests on its film, started in the centre:

    >>> run = run_orbit(short_film(0.25), load(alpha=10.0, static=(0.5, 0.0)), duration=200.0)
    >>> run.status.text, run.position[-1].round(3).tolist()
    ('done', [0.064, 0.217])
    """
    kept = step if sample_step is None else sample_step
    _check_run(film, duration, start, integrator, (step, kept, tolerance), wall)
    method = INTEGRATORS[integrator]
    fixed = step if method == ADAPTIVE else kept / math.ceil(kept / step * (1 - 1e-9))
    stable = _STABLE[method]
    safe = _safe_eccentricity(film, q.alpha, fixed, stable)
    settings = _Settings(method, fixed, tolerance, max_steps, kept, stable, safe)
    record = np.empty((int(duration / kept * (1 + 1e-12)) + 1, 4))
    work = _new_work((*start, *start_velocity))
    code = _march(film, q, no_wall() if wall is None else wall, settings, _TABLEAU, work, record)
    status, filled, end = OrbitStatus(code), int(work.counts[SAMPLE]), float(work.clock[TAU])
    if status in (OrbitStatus.THIN, OrbitStatus.CONTACT) and _overloaded(
        film, q, work.y[_STATE], end
    ):
        status = OrbitStatus.OVERLOAD
    return OrbitRun(
        tau=kept * np.arange(filled, dtype=np.float64),
        position=record[:filled, :2].copy(),
        velocity=record[:filled, 2:].copy(),
        status=status,
        end=end,
        steps=int(work.counts[STEPS]),
        rejected=int(work.counts[REJECTED]),
        calls=int(work.counts[CALLS]),
    )


_TABLEAU = _Tableau(_A, _C, _INSTANT, _SLOPE)


def _new_work(state: tuple[float, float, float, float]) -> _Work:
    work = _Work(
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
    work.y[_STATE] = state
    return work


def _check_run(
    film: OrbitFilm,
    duration: float,
    start: tuple[float, float],
    integrator: str,
    positive: tuple[float, float, float],
    wall: Wall | None,
) -> None:
    wrong = []
    if integrator not in INTEGRATORS:
        wrong.append(f"integrator = '{integrator}' must be one of {', '.join(INTEGRATORS)}")
    for name, value in zip(("step", "sample_step", "tolerance"), positive, strict=True):
        if not value > 0 or not math.isfinite(value):
            wrong.append(f"{name} = {value:g} must be > 0 and finite")
    if not duration >= 0 or not math.isfinite(duration):
        wrong.append(f"duration = {duration:g} rad must be >= 0 and finite")
    last = film.last_eccentricity if wall is None else math.inf
    if not math.hypot(*start) <= last:
        wrong.append(
            f"start = {start} has eccentricity {math.hypot(*start):.6g} and must lie within "
            f"{last:g}, the last of this film; start nearer to the centre"
        )
    if wrong:
        raise ValueError("\n".join(wrong))


def _overloaded(film: OrbitFilm, q: Load, state: NDArray[np.float64], tau: float) -> bool:
    """Whether the load is, now and in the end, more than the turning film carries at its edge.

    Unbalance and orders do not count: they pass.
    """
    if film.code == FILM_NONE:
        return False
    place = state[:2] * (film.last_eccentricity / math.hypot(state[0], state[1]))
    capacity = q.alpha * math.hypot(*film_force(film, place[0], place[1], 0.0, 0.0))
    resting = q._replace(unbalance=0.0, orders=np.zeros((0, 4)))
    return all(math.hypot(*load_at(resting, t)) > capacity for t in (tau, q.time[-1]))


@kernel
def _trace(film: OrbitFilm, states: Any, trace: Any) -> None:
    for n in range(states.shape[0]):
        x, y, u, v = states[n, 0], states[n, 1], states[n, 2], states[n, 3]
        trace[n, 0], trace[n, 1] = film_force(film, x, y, u, v)
        peak = math.nan
        if film.code == FILM_MAP:
            peak = map_peak(film.table, x, y, u, v)
        elif film.code == FILM_DIRECT:
            peak = 0.0
            for i in range(film.work.pressure.shape[0]):
                for j in range(film.work.pressure.shape[1]):
                    peak = max(peak, film.work.pressure[i, j])
        trace[n, 2] = peak


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmTrace:
    """What the film did along a run.

    Attributes
    ----------
    force : numpy.ndarray [shape=(n, 2)]
        Non-dimensional F on the journal.
    peak_pressure : numpy.ndarray [shape=(n,)] or None
        Largest non-dimensional P; None for films that know none.
    """

    force: NDArray[np.float64]
    peak_pressure: NDArray[np.float64] | None


def film_trace(film: OrbitFilm, run: OrbitRun) -> FilmTrace:
    """Force and largest pressure of the film at the samples of a run."""
    states = np.ascontiguousarray(np.hstack([run.position, run.velocity]))
    trace = np.empty((len(states), 3))
    _trace(film, states, trace)
    known = film.code in (FILM_MAP, FILM_DIRECT)
    return FilmTrace(force=trace[:, :2], peak_pressure=trace[:, 2] if known else None)
