"""One step of a chamber: pressure, vapour and both valves together, implicit, of second order."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from ..scene.pump_hydraulics import STANDARD_ATMOSPHERE
from .liquid import air_near, air_series, air_volume, mixture_volume
from .valves import (
    discharge_side,
    flow_now,
    lift_line,
    seat_force,
    suction_side,
    touches,
    valve_acceleration,
    valve_flow,
    valve_shares,
)

CHAMBER_OK = 0
CHAMBER_NOT_FINITE = 1
CHAMBER_NO_VOLUME = 2

CHAMBER_STATE = (
    "pressure",
    "vapour_volume",
    "suction_lift",
    "suction_lift_rate",
    "discharge_lift",
    "discharge_lift_rate",
)
"""Columns of the chamber's state: [Pa], [m^3], [m], [m/s], [m], [m/s]."""

GATHERED = (1, 2, 4)
"""Columns of the chamber's state that a recording needs at every step: vapour and lifts."""

CHAMBER_FLOWS = ("suction_volume", "discharge_volume", "suction_impulse", "discharge_impulse")
"""Results of a chamber step: [m^3] twice, [N s] twice."""

_NEWTON_SHARE = 1e-3  # of the smaller pressure drop: the next correction of the flow is its square
_SETTLED = 1e-8  # of the absolute pressure: the next correction is its square
_MOST_ITERATIONS = 60  # bisection alone narrows 1e9 Pa to rounding in as many
_PRESSURE_LIMIT = 1e10  # Pa, beyond any liquid model

# TR-BDF2 with equal implicit parts in both stages: Hosea and Shampine 1996.
_GAMMA = 2.0 - math.sqrt(2.0)
_IMPLICIT = _GAMMA / 2.0
_EXPLICIT = math.sqrt(2.0) / 4.0


@kernel
def _newton(
    p: float, air: float, mass: float, volume: float, dt: float, valves: Any, h: Any
) -> Any:
    """Volume error of a stage's pressure, its Newton change, flows with slopes; whether acceptable.

    The equation is that of :func:`_balance`.
    """
    lift_s, line_s, suction, lift_d, line_d, discharge = valves
    v, slope = mixture_volume(p, air, h)
    q_s, s_s = valve_flow(h.suction - p, lift_s, dt, line_s, suction)
    q_d, s_d = valve_flow(p - h.discharge, lift_d, dt, line_d, discharge)
    held = mass + dt * (q_s - q_d)
    room = volume - v * held
    change = room / (slope * held - v * dt * (s_s + s_d))
    fine = abs(change) <= 1e-9 * (p + STANDARD_ATMOSPHERE) + _NEWTON_SHARE * min(
        abs(h.suction - p), abs(p - h.discharge)
    )
    return room, change, q_s, q_d, s_s, s_d, fine and p + change > h.vapour


@kernel
def _balance(
    mass: float,
    volume: float,
    dt: float,
    guess: float,
    known: Any,
    valves: Any,
    last_stage: bool,
    h: Any,
) -> Any:
    """Pressure at the end of an implicit stage; flows; volume of the vapour.

    Solves ``V = v(p) (mass + dt (Q_s(p) - Q_d(p)))``, whose right side falls with p: Newton's
    method inside a bracket that starts at the vapour pressure. If even that pressure does not fill
    the volume, the rest is vapour. The flows are taken on the tangent of the last iterate, so that
    the mass is booked exactly and the pressure follows it.
    """
    low, high, floor_open = h.vapour, _PRESSURE_LIMIT, True
    p, q_s, q_d = max(guess, low), 0.0, 0.0
    last = 2.0 * _PRESSURE_LIMIT
    for _ in range(_MOST_ITERATIONS):
        air = air_near(p, known, h)
        room, change, q_s, q_d, s_s, s_d, fine = _newton(p, air, mass, volume, dt, valves, h)
        if p <= h.vapour:
            if room >= 0.0:
                return p, q_s, q_d, room
            floor_open = False
        q_s -= s_s * change
        q_d += s_d * change
        if room > 0.0:
            high = p
        else:
            low = p
        after = p + change
        if fine:
            p = after
            break
        if floor_open and after <= h.vapour:
            after = h.vapour
        elif not (low < after < high) or abs(change) > 0.5 * last:
            after = 0.5 * (low + high) if high < _PRESSURE_LIMIT else min(after, high)
        last = abs(after - p)
        p = after
    vapour = 0.0
    if last_stage:
        p, vapour = _settled(p, volume, mass + dt * (q_s - q_d), known, h)
    return p, q_s, q_d, vapour


@kernel
def _settled(p: float, volume: float, held: float, known: Any, h: Any) -> Any:
    """Pressure and vapour of a mass in a volume, from a good guess: mass is conserved exactly."""
    for _ in range(_MOST_ITERATIONS):
        change = _settling(p, air_near(p, known, h), volume, held, h)
        p += change
        if p <= h.vapour:
            v = mixture_volume(h.vapour, air_volume(h.vapour, h), h)[0]
            if volume >= v * held:
                return h.vapour, volume - v * held
            p = h.vapour
        elif abs(change) <= _SETTLED * (p + STANDARD_ATMOSPHERE):
            break
    return p, 0.0


@kernel
def _settling(p: float, air: float, volume: float, held: float, h: Any) -> float:
    v, slope = mixture_volume(p, air, h)
    change: float = (volume - v * held) / (slope * held)
    return change


@kernel
def _balance_at_once(
    mass: float,
    volume: float,
    dt: float,
    guess: float,
    known: Any,
    valves: Any,
    last_stage: bool,
    h: Any,
) -> Any:
    """Like :func:`_balance` in the usual number of iterations; and whether these were enough.

    Two Newton steps, or one and one more for the mass, without touching a bound: if that suffices,
    the numbers and their order are the same, without a loop or a branch.
    """
    air, near = air_series(guess, known, h)
    room, change, q_s, q_d, s_s, s_d, fine = _newton(guess, air, mass, volume, dt, valves, h)
    sure, p = near and guess > h.vapour, guess + change
    q_s, q_d = q_s - s_s * change, q_d + s_d * change
    if last_stage:
        air, near = air_series(p, known, h)
        change = _settling(p, air, volume, mass + dt * (q_s - q_d), h)
        p += change
        settled = p > h.vapour and abs(change) <= _SETTLED * (p + STANDARD_ATMOSPHERE)
        return p, q_s, q_d, sure and fine and near and settled
    between = h.vapour < p and (p < guess if room > 0.0 else guess < p < _PRESSURE_LIMIT)
    air, near = air_series(p, known, h)
    _, change, r_s, r_d, s_s, s_d, finer = _newton(p, air, mass, volume, dt, valves, h)
    sure = sure and (fine or (between and near and finer))
    return (
        p if fine else p + change,
        q_s if fine else r_s - s_s * change,
        q_d if fine else r_d + s_d * change,
        sure,
    )


@kernel
def _expected_contacts(dt: float, guess: float, start: Any, valves: Any, h: Any) -> Any:
    """Contacts of both valves at the end of a stage, expected under a guessed pressure."""
    lift_s, rate_s, lift_d, rate_d = start
    suction, shares_s, discharge, shares_d = valves
    line_s = lift_line(lift_s, rate_s, 0.0, shares_s, suction)
    line_d = lift_line(lift_d, rate_d, 0.0, shares_d, discharge)
    v_s = line_s[0] + line_s[1] * (h.suction - guess)
    v_d = line_d[0] + line_d[1] * (guess - h.discharge)
    return touches(lift_s + dt * v_s, v_s, suction), touches(lift_d + dt * v_d, v_d, discharge)


@kernel
def _lines(on_s: float, on_d: float, start: Any, valves: Any) -> Any:
    """Both valves as lines over the pressure drop, for :func:`_balance`."""
    lift_s, rate_s, lift_d, rate_d = start
    suction, shares_s, discharge, shares_d = valves
    return (
        lift_s,
        lift_line(lift_s, rate_s, on_s, shares_s, suction),
        suction,
        lift_d,
        lift_line(lift_d, rate_d, on_d, shares_d, discharge),
        discharge,
    )


@kernel
def _outcome(p: float, dt: float, on_s: float, on_d: float, lines: Any, h: Any) -> Any:
    """Rates of both valves at the end of a stage, and the contacts consistent with them."""
    lift_s, line_s, suction, lift_d, line_d, discharge = lines
    v_s = line_s[0] + line_s[1] * (h.suction - p)
    v_d = line_d[0] + line_d[1] * (p - h.discharge)
    return (
        v_s,
        v_d,
        _touches_still(lift_s + dt * v_s, v_s, on_s, suction),
        _touches_still(lift_d + dt * v_d, v_d, on_d, discharge),
    )


@kernel
def _stage(
    mass: float,
    volume: float,
    dt: float,
    guess: float,
    known: Any,
    start: Any,
    valves: Any,
    last_stage: bool,
    at_once: bool,
    h: Any,
) -> Any:
    """Take one implicit stage: pressure first, then the valves as lines over it, then contacts.

    The last value is false if a stage with `at_once` did not converge.
    """
    on_s, on_d = _expected_contacts(dt, guess, start, valves, h)
    if at_once:
        lines = _lines(on_s, on_d, start, valves)
        p, q_s, q_d, sure = _balance_at_once(mass, volume, dt, guess, known, lines, last_stage, h)
        v_s, v_d, then_s, then_d = _outcome(p, dt, on_s, on_d, lines, h)
        sure = sure and then_s == on_s and then_d == on_d
        return p, 0.0, q_s, q_d, v_s, v_d, on_s, on_d, sure
    p, q_s, q_d, vapour, v_s, v_d, was_s, was_d = guess, 0.0, 0.0, 0.0, 0.0, 0.0, on_s, on_d
    for _ in range(3):
        was_s, was_d = on_s, on_d
        lines = _lines(was_s, was_d, start, valves)
        p, q_s, q_d, vapour = _balance(mass, volume, dt, p, known, lines, last_stage, h)
        v_s, v_d, on_s, on_d = _outcome(p, dt, was_s, was_d, lines, h)
        if on_s == was_s and on_d == was_d:
            break
    return p, vapour, q_s, q_d, v_s, v_d, was_s, was_d, True


@kernel
def _touches_still(lift: float, rate: float, contact: float, side: Any) -> float:
    """Contact consistent with a stage's outcome; one that pushes is kept."""
    pushes = seat_force(lift, rate, contact, side) * contact <= 0.0
    kept = contact if pushes else 0.0
    return kept if contact != 0.0 else touches(lift, rate, side)


@kernel
def _hermite(s: float, step: float, x0: float, v0: float, x1: float, v1: float) -> float:
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * x0 + s * step * v0) + s * s * (
        (1.0 + 2.0 * r) * x1 - r * step * v1
    )


@kernel
def _volume(x: float, h: Any) -> float:
    volume: float = h.dead_volume + h.area * (h.crank_radius + h.rod_length - x)
    return volume


@kernel
def _substep(
    state: Any,
    mass: float,
    air: float,
    dt: float,
    middle: float,
    end: float,
    valves: Any,
    at_once: bool,
    h: Any,
) -> Any:
    """Take one substep of TR-BDF2: two implicit stages with the same implicit part.

    The last value is false if a stage with `at_once` did not converge.
    """
    p0, _, z_s, v_s, z_d, v_d = state
    suction, _, discharge, _ = valves
    known = (p0, air, 1.0 / (p0 + STANDARD_ATMOSPHERE))
    drop_s, drop_d = h.suction - p0, p0 - h.discharge
    on_s, on_d = touches(z_s, v_s, suction), touches(z_d, v_d, discharge)
    q_s0 = flow_now(drop_s, z_s, v_s, suction)
    q_d0 = flow_now(drop_d, z_d, v_d, discharge)
    a_s0 = valve_acceleration(drop_s, z_s, v_s, on_s, suction)
    a_d0 = valve_acceleration(drop_d, z_d, v_d, on_d, discharge)
    f_s0 = seat_force(z_s, v_s, on_s, suction)
    f_d0 = seat_force(z_d, v_d, on_d, discharge)
    c = implicit_part(dt)
    start = (z_s + c * v_s, v_s + c * a_s0, z_d + c * v_d, v_d + c * a_d0)
    p1, _, q_s1, q_d1, v_s1, v_d1, on_s, on_d, sure = _stage(
        mass + c * (q_s0 - q_d0), middle, c, p0, known, start, valves, False, at_once, h
    )
    f_s1 = seat_force(start[0] + c * v_s1, v_s1, on_s, suction)
    f_d1 = seat_force(start[2] + c * v_d1, v_d1, on_d, discharge)
    w, per_c = _EXPLICIT * dt, 1.0 / c
    start = (
        z_s + w * (v_s + v_s1),
        v_s + w * (a_s0 + (v_s1 - start[1]) * per_c),
        z_d + w * (v_d + v_d1),
        v_d + w * (a_d0 + (v_d1 - start[3]) * per_c),
    )
    guess = p0 + (p1 - p0) / _GAMMA
    held = mass + w * (q_s0 - q_d0 + q_s1 - q_d1)
    p2, vapour, q_s2, q_d2, v_s2, v_d2, on_s, on_d, surer = _stage(
        held, end, c, guess, known, start, valves, True, at_once, h
    )
    z_s2, z_d2 = start[0] + c * v_s2, start[2] + c * v_d2
    f_s2 = seat_force(z_s2, v_s2, on_s, suction)
    f_d2 = seat_force(z_d2, v_d2, on_d, discharge)
    return (
        (p2, vapour, z_s2, v_s2, z_d2, v_d2),
        w * (q_s0 + q_s1) + c * q_s2,
        w * (q_d0 + q_d1) + c * q_d2,
        w * (f_s0 + f_s1) + c * f_s2,
        w * (f_d0 + f_d1) + c * f_d2,
        sure and surer,
    )


@kernel
def _mass(pressure: float, air: float, volume: float, h: Any) -> float:
    """Mass in a volume, as volume at atmospheric pressure [m^3]."""
    mass: float = volume / mixture_volume(pressure, air, h)[0]
    return mass


@kernel
def chamber_at_once(
    state: Any,
    air: float,
    h: Any,
    valves: Any,
    step: float,
    x0: float,
    v0: float,
    x1: float,
    v1: float,
) -> Any:
    """Like :func:`chamber_step` in one substep, for chambers in parallel.

    Parameters
    ----------
    state : tuple of float
        Fields of :data:`CHAMBER_STATE`.
    air : float
        :func:`air_volume` at the state's pressure.
    h : record of dtype HYDRAULIC, or a tuple with its names
    valves : tuple
        :func:`suction_side`, its :func:`valve_shares` over an :func:`implicit_part` of
        the step, and both for the discharge side.
    step, x0, v0, x1, v1 : float
        As in :func:`chamber_step`.

    Returns
    -------
    state : tuple of float
        State at the end of the step.
    suction_impulse, discharge_impulse : float
        As in :data:`CHAMBER_FLOWS` [N s].
    sure : bool
        Whether these are exactly the numbers of :func:`chamber_step`; if not, use that function.
        This occurs in one step of a hundred: when a valve closes, vapour fills the chamber, or
        the pressure jumps.
    """
    mass = _mass(state[0], air, _volume(x0, h) - state[1], h)
    middle, end = _volume(_hermite(_GAMMA, step, x0, v0, x1, v1), h), _volume(x1, h)
    now, q_s, _, f_s, f_d, sure = _substep(state, mass, air, step, middle, end, valves, True, h)
    total = now[3] + now[5] + q_s
    sound = middle > 0.0 and end > 0.0 and total - total == 0.0 and now[0] < _PRESSURE_LIMIT
    return now, 0.0 + f_s, 0.0 + f_d, sure and sound


@kernel
def implicit_part(step: float) -> float:
    """Implicit part of a substep in either stage of TR-BDF2 [s]."""
    return _IMPLICIT * step


@kernel
def chamber_step(
    state: NDArray[np.float64],
    flows: NDArray[np.float64],
    h: Any,
    step: float,
    x0: float,
    v0: float,
    x1: float,
    v1: float,
    substeps: int,
) -> int:
    """Advance chamber and valves over one step of the mechanism.

    Parameters
    ----------
    state : numpy.ndarray [shape=(6,)]
        Columns as :data:`CHAMBER_STATE`; replaced by the state at the end of the step.
    flows : numpy.ndarray [shape=(4,)]
        Columns as :data:`CHAMBER_FLOWS`, replaced by those of this step: the volumes through the
        two valves in their opening directions, at atmospheric pressure [m^3], and the
        impulses of seat and stop on the casing [N s], positive along the closing direction of the
        valve.
    h : record of dtype HYDRAULIC
        Record with the rung *chamber*.
    step : float
        Step of the mechanism [s].
    x0, v0, x1, v1 : float
        Piston position [m] and velocity [m/s] at both ends; interpolated by a cubic.
    substeps : int
        See :func:`chamber_substeps`.

    Returns
    -------
    int
        ``CHAMBER_OK``, or why `state` was left unchanged.

    Notes
    -----
    The mass in the chamber is ``M = (V - V_vapour) / v(p)``, in volumes at atmospheric pressure,
    see :func:`mixture_volume`; ``V = V_dead + A (x_top - x)``. ::

        M'  = Q_s - Q_d,                0 <= V_vapour  complementary to  p >= p_vapour
        Q   = (C_d pi D z + C_d A_leak) sqrt(2 dp / rho) + A_v z'
        m z'' + c z' + k z + F_0 = C_f A_v dp + seat and stop

    with dp over the valve in its opening direction, flow of either sign, and the plate's
    displacement after Westphal. ``sqrt(dp)`` is computed as ``dp / sqrt(|dp| + 1 Pa)``: at low
    pressure a gap is viscous. Seat and stop are springs with dampers that only push.

    TR-BDF2 is L-stable and of second order in the pressure and in the valves, on which the
    pressure depends through the plate's displacement: each stage eliminates the valves and solves
    one scalar equation for the pressure. Liquid columns in the manifolds are not included.

    References
    ----------
    Hosea, Shampine (1996), Analysis and implementation of TR-BDF2, Applied Numerical Mathematics
    20, 21-37, doi:10.1016/0168-9274(95)00115-8.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.chamber_run import chamber_start
    >>> from wearstate.sim.hydraulics.parameters import hydraulic_parameters
    >>> from wearstate.sim.scene.pump_hydraulics import CylinderPressure, Valve
    >>> pressure = CylinderPressure(
    ...     rung="chamber", suction_valve=Valve(), discharge_valve=Valve(), dead_volume=4e-4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> state, flows = chamber_start(h, 0.25, -1.6), np.zeros(4)
    >>> chamber_step(state, flows, h, 2e-5, 0.25, -1.6, 0.25 - 3.2e-5, -1.6, 1)
    0
    >>> f"{flows[0]:.3g}"  # what the piston makes room for: 7.9e-3 * 3.2e-5
    '2.53e-07'
    """
    inlet, outlet = suction_side(h), discharge_side(h)
    now = (state[0], state[1], state[2], state[3], state[4], state[5])
    share = 1.0 / substeps
    dt = step * share
    c = implicit_part(dt)
    valves = (inlet, valve_shares(c, inlet), outlet, valve_shares(c, outlet))
    air = air_volume(now[0], h)
    mass = _mass(now[0], air, _volume(x0, h) - now[1], h)
    suction, discharge, impulse_s, impulse_d = 0.0, 0.0, 0.0, 0.0
    for i in range(substeps):
        middle = _volume(_hermite((i + _GAMMA) * share, step, x0, v0, x1, v1), h)
        end = _volume(
            x1 if i + 1 == substeps else _hermite((i + 1.0) * share, step, x0, v0, x1, v1), h
        )
        if not (middle > 0.0 and end > 0.0):
            return CHAMBER_NO_VOLUME
        now, q_s, q_d, f_s, f_d, _ = _substep(now, mass, air, dt, middle, end, valves, False, h)
        mass += q_s - q_d
        suction += q_s
        discharge += q_d
        impulse_s += f_s
        impulse_d += f_d
        if not (math.isfinite(now[3] + now[5] + suction) and now[0] < _PRESSURE_LIMIT):
            return CHAMBER_NOT_FINITE
        if i + 1 < substeps:
            air = air_volume(now[0], h)
    for column in range(6):
        state[column] = now[column]
    flows[0] = suction
    flows[1] = discharge
    flows[2] = impulse_s
    flows[3] = impulse_d
    return CHAMBER_OK
