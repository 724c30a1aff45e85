"""Valves of a chamber: flow through the gap, force on the plate, contact with seat and stop."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel

_LAMINAR = 1.0  # Pa: below it a gap is viscous and its flow linear; a loss of 1 Pa at any drop


class ValveSide(NamedTuple):
    """Valves of one side, lumped into one."""

    gap_conductance: float
    leak_conductance: float
    area: float
    force_area: float
    mass: float
    stiffness: float
    preload: float
    damping: float
    max_lift: float
    seat_stiffness: float
    seat_damping: float
    stuck: float


@kernel
def suction_side(h: Any) -> Any:
    """Suction valves of a record of dtype HYDRAULIC."""
    return ValveSide(
        h.suction_gap_conductance,
        h.suction_leak_conductance,
        h.suction_area,
        h.suction_force_area,
        h.suction_mass,
        h.suction_stiffness,
        h.suction_preload,
        h.suction_damping,
        h.suction_max_lift,
        h.suction_seat_stiffness,
        h.suction_seat_damping,
        h.suction_stuck,
    )


@kernel
def discharge_side(h: Any) -> Any:
    """Discharge valves of a record of dtype HYDRAULIC."""
    return ValveSide(
        h.discharge_gap_conductance,
        h.discharge_leak_conductance,
        h.discharge_area,
        h.discharge_force_area,
        h.discharge_mass,
        h.discharge_stiffness,
        h.discharge_preload,
        h.discharge_damping,
        h.discharge_max_lift,
        h.discharge_seat_stiffness,
        h.discharge_seat_damping,
        h.discharge_stuck,
    )


@kernel
def touches(lift: float, rate: float, side: Any) -> float:
    """Contact: -1 on the seat, 1 on the stop, 0 free; it only pushes."""
    over = lift - side.max_lift
    damped = side.seat_damping * rate
    on_seat = lift < 0.0 and side.seat_stiffness * lift + damped < 0.0
    on_stop = lift >= 0.0 and over > 0.0 and side.seat_stiffness * over + damped > 0.0
    return -1.0 if on_seat else 1.0 if on_stop else 0.0


@kernel
def seat_force(lift: float, rate: float, contact: float, side: Any) -> float:
    """Force of seat or stop on the valve, positive in the direction of opening [N]."""
    over = lift - side.max_lift if contact > 0.0 else lift
    force: float = -side.seat_stiffness * over - side.seat_damping * rate
    return force if contact != 0.0 else 0.0


@kernel
def valve_shares(dt: float, side: Any) -> Any:
    """Factors from force to rate in an implicit stage, free and in contact; momentum factor."""
    if side.stuck >= 0.0:
        return 0.0, 0.0, 0.0
    per_dt = 1.0 / dt
    free = side.mass * per_dt + side.damping + dt * side.stiffness
    held = free + side.seat_damping + dt * side.seat_stiffness
    return 1.0 / free, 1.0 / held, side.mass * per_dt


@kernel
def lift_line(lift: float, rate: float, contact: float, shares: Any, side: Any) -> Any:
    """Rate at the end of an implicit stage, as a line over the pressure drop: ``a + b dp``.

    `lift` and `rate` are the stage's initial values; solves ``v = rate + dt F(z, v, dp) / m`` with
    ``z = lift + dt v``.
    """
    free = rate * shares[2] - side.preload - side.stiffness * lift
    held = free - side.seat_stiffness * (lift - side.max_lift if contact > 0.0 else lift)
    share = shares[1] if contact != 0.0 else shares[0]
    return (held if contact != 0.0 else free) * share, side.force_area * share


@kernel
def _orifice(drop: float) -> Any:
    """Signed square root of a pressure drop, linear if the flow is laminar; and its slope."""
    size = abs(drop)
    inverse = 1.0 / math.sqrt(size + _LAMINAR)
    return drop * inverse, inverse * (1.0 - 0.5 * size * inverse * inverse)


@kernel
def valve_flow(drop: float, lift: float, dt: float, line: Any, side: Any) -> Any:
    """Flow through a valve in its opening direction at the end of a stage, and its slope.

    Gap, leak, and the displacement of the plate: ``C_d pi D z sqrt(2 dp / rho) + ... + A v``.
    """
    rate = line[0] + line[1] * drop
    gap = lift + dt * rate
    wide = side.leak_conductance + side.gap_conductance * gap
    conductance = wide if gap > 0.0 else side.leak_conductance
    opening = side.gap_conductance * dt * line[1] if gap > 0.0 else 0.0
    flow, slope = side.area * rate, side.area * line[1]
    if conductance > 0.0:
        root, root_slope = _orifice(drop)
        flow += conductance * root
        slope += conductance * root_slope + opening * root
    return flow, slope


@kernel
def flow_now(drop: float, lift: float, rate: float, side: Any) -> float:
    """Flow through a valve at a known lift, including its plate's displacement [m^3/s]."""
    conductance = side.leak_conductance + side.gap_conductance * max(lift, 0.0)
    flow: float = conductance * _orifice(drop)[0] + side.area * rate
    return flow


@kernel
def valve_acceleration(drop: float, lift: float, rate: float, contact: float, side: Any) -> float:
    """Acceleration of a valve [m/s^2]."""
    force: float = seat_force(lift, rate, contact, side) + side.force_area * drop
    force -= side.preload + side.stiffness * lift + side.damping * rate
    pull: float = force / side.mass
    return 0.0 if side.stuck >= 0.0 else pull


def lift_left(
    angle: NDArray[np.float64],
    lift: NDArray[np.float64],
    side: str,
    max_lift: float,
    *,
    after: float = math.radians(20.0),
) -> NDArray[np.float64]:
    """Remaining lift of a valve in each of its idle strokes, over its largest lift.

    A suction valve must be closed while the piston advances, a discharge valve while it withdraws.
    A valve whose spring is too soft for the speed is still open some time after the dead centre,
    and is then closed by the reversed flow, with an impact.

    Parameters
    ----------
    angle : numpy.ndarray [shape=(n,)]
        Crank angle, increasing [rad].
    lift : numpy.ndarray [shape=(n,)]
        Lift of the valve [m], at the same instants.
    side : str
        ``"suction"`` or ``"discharge"``.
    max_lift : float
        Largest lift [m], > 0.
    after : float
        Crank angle after the dead centre at which the idle stroke begins [rad]: 0 gives the lift
        at that dead centre, pi that at the end of the idle stroke, where only a stuck
        valve is open.

    Returns
    -------
    numpy.ndarray [shape=(n_cycles,)]
        One value for each such instant in the run; 0 for a closed valve. More than a few
        per cent, cycle after cycle, means a valve that does not close in time.

    Raises
    ------
    ValueError
        `side` is neither of the two.

    Examples
    --------
    >>> angle = np.linspace(0.1, 13.0, 500)
    >>> lift = 5e-3 * np.maximum(np.sin(angle - 0.1), 0.0)  # open from 0.1 to pi + 0.1
    >>> [float(left) for left in lift_left(angle, lift, "suction", 8e-3)]
    [0.0, 0.0]
    >>> [round(float(left), 3) for left in lift_left(angle, lift, "suction", 8e-3, after=0.0)]
    [0.062, 0.062]
    """
    begins = {"suction": math.pi, "discharge": 0.0}
    if side not in begins:
        raise ValueError(f"side = '{side}' must be 'suction' or 'discharge'; name the valve")
    turn, at = 2 * math.pi, begins[side] + after
    first = math.ceil((angle[0] - at) / turn)
    last = math.floor((angle[-1] - at) / turn)
    instants = at + turn * np.arange(first, last + 1)
    return np.asarray(np.maximum(np.interp(instants, angle, lift), 0.0) / max_lift)
