"""Time march of a journal: acceleration, steps, samples, wall; one loop for all integrators."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.law import CONTACT, friction_force, normal_force
from ..film.direct import DIRECT_OK
from ..film.direct_system import STATUS
from ..jit import kernel
from .load import Load, load_and_rates
from .orbit_film import FILM_DIRECT, OrbitFilm, film_force
from .orbit_step import (
    ADAPTIVE,
    ATTEMPT,
    CALL,
    CALLS,
    FAILED,
    JUMP,
    POINT,
    REJECTED,
    RK4,
    SAMPLE,
    STAGE,
    STAGES,
    STATE,
    STEP,
    STEPS,
    TAU,
    MarchWork,
    Tableau,
    copy_row,
    explicit_finish,
    first_stage,
    keep_stage,
    largest_damping,
    rodas_error,
    rodas_point,
    rodas_solve,
    runge_kutta_point,
    spacing,
    take_difference,
)

OVERLAP_LIMIT = 0.1  # of the clearance
_EDGE = 1e-9  # distance of a stage from a jump of the load [rad]
_MOST_SPLITS = 40  # shortest adaptive step over the first: 2^-40


class Wall(NamedTuple):
    """Contact of journal and bearing, in units of C, 1/omega and M C omega^2."""

    present: int
    contact: NDArray[Any]  # (1,) of CONTACT
    surface_speed: float  # R / C


def no_wall() -> Wall:
    """No wall: a run ends when the journal reaches it."""
    return Wall(0, np.zeros(1, CONTACT), 0.0)


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


class MarchSettings(NamedTuple):
    """Settings of a march."""

    method: int
    step: float  # fixed, or the first
    tolerance: float
    max_steps: int
    sample_step: float
    stable: float  # largest step times damping
    safe: float  # eccentricity up to which that is always kept


_MORE, _TAKEN = -2, -1  # results of a call other than a status code


@kernel
def _acceleration(work: MarchWork, tau: float, film: OrbitFilm, q: Load, wall: Wall) -> None:
    """Acceleration at the point, stored in work.rate with the load and its rates."""
    x, y, u, v = work.y[POINT, 0], work.y[POINT, 1], work.y[POINT, 2], work.y[POINT, 3]
    f_x, f_y = film_force(film, x, y, u, v)
    if film.code == FILM_DIRECT:
        work.counts[FAILED] = film.work.outcome[STATUS] != DIRECT_OK
    q_x, q_y, x_slope, y_slope = load_and_rates(q, tau, work.cursor)
    a_x, a_y = q.alpha * f_x + q_x, q.alpha * f_y + q_y
    if wall.present == 1:
        w_x, w_y = wall_force(wall, work.held[0], x, y, u, v)
        a_x, a_y = a_x + w_x, a_y + w_y
    work.counts[CALLS] += 1
    work.rate[0], work.rate[1] = a_x, a_y
    work.rate[2], work.rate[3], work.rate[4], work.rate[5] = q_x, q_y, x_slope, y_slope


@kernel
def _hermite(share: float, h: float, p: float, v: float, a: float, end: Any) -> Any:
    """Position and rate at a share, by the quintic through both ends with two derivatives."""
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
def _fill_samples(work: MarchWork, q: Load, sample_step: float, record: Any) -> None:
    """Fill the samples between the start of the last step and the state.

    At a jump of the load, the acceleration at the end is that before the jump.
    """
    b, y, tau, sample = work.before, work.y, work.clock[TAU], work.counts[SAMPLE]
    if sample == 0:
        for c in range(4):
            record[0, c] = y[STATE, c]
        work.counts[SAMPLE] = 1
        return
    h = tau - b[0]
    q_x, q_y, _, _ = load_and_rates(q, tau - _EDGE, work.cursor)
    a_x = work.first[0] - work.first[2] + q_x
    a_y = work.first[1] - work.first[3] + q_y
    while sample < record.shape[0] and sample * sample_step <= tau + _EDGE:
        share = (sample * sample_step - b[0]) / h
        x, u = _hermite(share, h, b[1], b[3], b[5], (y[STATE, 0], y[STATE, 2], a_x))
        z, v = _hermite(share, h, b[2], b[4], b[6], (y[STATE, 1], y[STATE, 3], a_y))
        record[sample, 0], record[sample, 1] = x, z
        record[sample, 2], record[sample, 3] = u, v
        sample += 1
    work.counts[SAMPLE] = sample


@kernel
def _next_jump(q: Load, tau: float) -> float:
    """First jump of the history after tau; infinity if there is none."""
    for n in range(q.time.size - 1):
        if q.time[n] > tau + _EDGE and q.time[n + 1] == q.time[n]:
            return float(q.time[n])
    return math.inf


@kernel
def _hold_contact(work: MarchWork, wall: Wall) -> None:
    """Save the speed at first contact with the wall."""
    if wall.present == 0:
        return
    y = work.y
    x, z = y[STATE, 0], y[STATE, 1]
    distance = math.sqrt(x * x + z * z)
    if distance > wall.contact[0].clearance:
        return
    outward = 0.0
    if distance > 0.0:
        outward = (x * y[STATE, 2] + z * y[STATE, 3]) / distance
    work.held[0] = max(outward, wall.contact[0].speed_floor)


@kernel
def _fault(work: MarchWork, film: OrbitFilm, wall: Wall) -> int:
    """Status code of the state."""
    y = work.y
    square = y[STATE, 0] ** 2 + y[STATE, 1] ** 2
    if not math.isfinite(square + y[STATE, 2] + y[STATE, 3]):
        return 1
    if wall.present == 1:
        return 6 if square > (wall.contact[0].clearance + OVERLAP_LIMIT) ** 2 else 0
    if square >= 1.0:
        return 5
    return 3 if square > film.last_eccentricity**2 else 0


@kernel
def _place(work: MarchWork, s: MarchSettings, t: Tableau) -> float:
    """Set the point of the next acceleration call; return its instant.

    Call 0 of a step is at the state. Then follow the explicit stages, or the four difference
    quotients of the Jacobian and the other stages of RODAS. A fixed step that may be unstable adds
    two difference quotients after its stages.
    """
    call, clock = work.counts[CALL], work.clock
    if s.method == ADAPTIVE and call > 4:
        rodas_point(work, call - 4, t)
        return float(clock[TAU] + t.instant[call - 4] * clock[ATTEMPT] - _EDGE)
    if s.method == RK4 and 0 < call < 4:
        runge_kutta_point(work, call, s.step)
        return float(clock[TAU] + (s.step if call == 3 else 0.5 * s.step) - _EDGE)
    copy_row(work.y, STATE, POINT)
    if call > 0:
        c = _column(s.method, call)
        work.y[POINT, c] += spacing(work, c)
    return float(clock[TAU] + _EDGE)


@kernel
def _column(method: int, call: int) -> int:
    """Coordinate of a call's difference quotient; 2 and 3 are the rates."""
    return call - 1 if method == ADAPTIVE else call - (2 if method == RK4 else -1)


@kernel
def _begin_step(work: MarchWork, q: Load, s: MarchSettings, record: Any) -> int:
    """After call 0: save its result, fill samples, check whether the run is over."""
    counts, clock = work.counts, work.clock
    if counts[FAILED] == 1:  # it would not matter at a trial point
        return 7
    for c in range(6):
        work.first[c] = work.rate[c]
    if s.method == ADAPTIVE:
        _fill_samples(work, q, s.sample_step, record)
    elif clock[TAU] >= counts[SAMPLE] * s.sample_step - _EDGE:
        for c in range(4):
            record[counts[SAMPLE], c] = work.y[STATE, c]
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
def _fixed_call(work: MarchWork, s: MarchSettings) -> int:
    """After a call of a fixed step: the stage, then the stability check if it is due."""
    call, y = work.counts[CALL], work.y
    stages = 4 if s.method == RK4 else 1
    work.counts[CALL] = call + 1
    if call < stages:
        if s.method == RK4:
            keep_stage(work, call)
        if call < stages - 1:
            return _MORE
        # at the centre too, where no step is known to be safe
        if y[STATE, 0] ** 2 + y[STATE, 1] ** 2 >= s.safe * s.safe:
            return _MORE
    else:
        take_difference(work, _column(s.method, call))
        if call < stages + 1:
            return _MORE
        if s.step * largest_damping(work) > s.stable:
            return 2
    explicit_finish(work, s.method, s.step)
    work.clock[TAU] = (work.counts[STEPS] + 1) * s.step
    return _TAKEN


@kernel
def _adaptive_call(
    work: MarchWork, film: OrbitFilm, wall: Wall, s: MarchSettings, t: Tableau
) -> int:
    """After a call of an adaptive step: Jacobian, stages, then acceptance or rejection."""
    call, clock = work.counts[CALL], work.clock
    work.counts[CALL] = call + 1
    if call <= 4:
        if call > 0:
            take_difference(work, call - 1)
        if call == 4:
            first_stage(work, t)
        return _MORE
    rodas_solve(work, call - 4, clock[ATTEMPT], t)
    if call < 3 + STAGES:
        return _MORE
    for c in range(4):  # stiffly accurate: the last stage corrects its own point
        work.y[POINT, c] += work.y[STAGE + STAGES - 1, c]
    error = rodas_error(work, s.tolerance)
    x, y = work.y[POINT, 0], work.y[POINT, 1]
    beyond = wall.present == 0 and x * x + y * y > film.last_eccentricity**2
    # a step that would leave the film is shortened until it ends at its edge
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
    first_stage(work, t)
    work.counts[CALL] = 5
    return _MORE


@kernel
def _accept(work: MarchWork, error: float) -> None:
    """Save the start of the step, advance, and choose the next step."""
    clock, before = work.clock, work.before
    attempt = clock[ATTEMPT]
    grown = attempt * min(5.0, 0.9 * max(error, 1e-8) ** -0.25)
    # a step shortened by a jump or the end keeps the planned step
    clock[STEP] = max(grown, clock[STEP]) if attempt < clock[STEP] else grown
    before[0] = clock[TAU]
    for c in range(4):
        before[1 + c] = work.y[STATE, c]
    before[5], before[6] = work.first[0], work.first[1]
    clock[TAU] += attempt


@kernel
def march(
    film: OrbitFilm, q: Load, wall: Wall, s: MarchSettings, t: Tableau, work: MarchWork, record: Any
) -> int:
    """March to the last sample; return the status code.

    All integrators share one loop with one call of the acceleration, so that the film is compiled
    into it only once.
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
            copy_row(work.y, POINT, STATE)
            _hold_contact(work, wall)
            code = _fault(work, film, wall)
            if code == 0:
                continue
        if code != _MORE:
            return code
