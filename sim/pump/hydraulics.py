"""Cylinder pressure of a reciprocating pump, compiled, from none to a chamber with valves.

Crank angle 0 is the top dead centre, where the piston position x is largest; the piston withdraws
(suction) from 0 to pi. A gauge pressure p pushes the piston with ``-A p`` along x.

===========  ========================================  =====================================
rung         assumes                                   gives
===========  ========================================  =====================================
none         no pressure                               0
constant     a plunger against a constant pressure     `discharge`
two-level    quasi-static, lines without loss          `suction` and `discharge` by turns
heads        quasi-static, liquid without compression  energy balance of the lines, added mass
chamber      one pressure in the chamber, manifolds    compression, air, vapour, moving valves,
             at constant pressure                      leaks, stuck valves
*-lines      as chamber, on two pipes of all throws    pulsation, waves, damper, relief valve
===========  ========================================  =====================================

The first four are functions of the piston's motion (:func:`line_pressure`); the chamber has a
state of its own (:func:`chamber_step`), and so have pipes (:mod:`wearstate.sim.piping.pipe`).
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..jit import kernel, power, subroutine
from ..scene.parts import STANDARD_GRAVITY
from ..scene.pump_hydraulics import (
    BREATHING_RUNGS,
    PIPED_RUNGS,
    STANDARD_ATMOSPHERE,
    CylinderPressure,
    Line,
    Liquid,
    Valve,
)

PRESSURE_NONE = 0
PRESSURE_CONSTANT = 1
PRESSURE_TWO_LEVEL = 2
PRESSURE_HEADS = 3
PRESSURE_CHAMBER = 4

PRESSURE_CODES = {
    "none": PRESSURE_NONE,
    "constant": PRESSURE_CONSTANT,
    "two-level": PRESSURE_TWO_LEVEL,
    "heads": PRESSURE_HEADS,
    **dict.fromkeys(BREATHING_RUNGS, PRESSURE_CHAMBER),
}
"""Rung of the scene -> code of the kernels, from the cheapest to the best; pipes are told apart."""

CHAMBER_OK = 0
CHAMBER_NOT_FINITE = 1
CHAMBER_NO_VOLUME = 2

CHAMBER_TEXT = {
    CHAMBER_OK: "done",
    CHAMBER_NOT_FINITE: (
        "the cylinder pressure is no longer finite or above 10 GPa; "
        "shorten numerics.step or raise pressure.dead_volume"
    ),
    CHAMBER_NO_VOLUME: (
        "the piston has taken up the whole chamber; "
        "raise pressure.dead_volume above the piston area times the clearances of its joints"
    ),
}
"""Status of :func:`chamber_step` -> one sentence with the cure."""

CHAMBER_STATE = (
    "pressure",
    "vapour_volume",
    "suction_lift",
    "suction_lift_rate",
    "discharge_lift",
    "discharge_lift_rate",
)
"""Names of the chamber's state: [Pa], [m^3], [m], [m/s], [m], [m/s]."""

GATHERED = (1, 2, 4)
"""Columns of the chamber's state that a recording needs at every step: vapour and lifts."""

CHAMBER_FLOWS = ("suction_volume", "discharge_volume", "suction_impulse", "discharge_impulse")
"""Names of what a chamber step hands out: [m^3] twice, [N s] twice."""

_VALVE_FIELDS = (
    "gap_conductance",  # of one metre of lift [m^2/s/sqrt(Pa)]
    "leak_conductance",  # [m^3/s/sqrt(Pa)]
    "area",  # of the seat openings [m^2]
    "force_area",  # [m^2]
    "mass",  # [kg], and all below for the whole group
    "stiffness",
    "preload",  # spring force on the closed valves [N]
    "damping",
    "max_lift",
    "seat_stiffness",
    "seat_damping",
    "stuck",  # lift [m], or -1 where the valves are free
)

_NUMBERS = (
    "area",
    "crank_radius",
    "rod_length",
    "speed",
    "suction",
    "discharge",
    "rise_delay",
    "rise_angle",
    "fall_delay",
    "fall_angle",
    "density",
    "suction_head",
    "suction_resistance",
    "suction_inertance",
    "discharge_head",
    "discharge_resistance",
    "discharge_inertance",
    "outlet_area",
    "dead_volume",
    "bulk_modulus",
    "air_fraction",
    "air_power",
    "vapour",
    *(f"suction_{name}" for name in _VALVE_FIELDS),
    *(f"discharge_{name}" for name in _VALVE_FIELDS),
)

HYDRAULIC = np.dtype(
    [("rung", np.int64), ("two_harmonic", np.int64), *((name, np.float64) for name in _NUMBERS)]
)
"""One throw's hydraulics in SI, as :func:`hydraulic_parameters` makes it. Pressures are gauge;
resistance [Pa s^2/m^6] and inertance [kg/m^4] are of a line with its valves."""

_LAMINAR = 1.0  # Pa: below it a gap is viscous and its flow linear; costs 1 Pa of any drop
_NEWTON_SHARE = 1e-3  # of the smaller pressure drop: the flow's next correction is its square
_SETTLED = 1e-8  # of the absolute pressure: the next correction is its square
_MOST_ITERATIONS = 60  # bisection alone narrows 1e9 Pa to rounding in that many
_PRESSURE_LIMIT = 1e10  # Pa, beyond any liquid model
_STEP_PER_CONTACT_TIME = 0.5  # 12 substeps a period of the valve on its seat
_SERIES_REACH = 0.01  # of the absolute pressure: the series below is exact to 1e-13 there

# TR-BDF2 with equal implicit parts in both stages: Hosea and Shampine 1996.
_GAMMA = 2.0 - math.sqrt(2.0)
_IMPLICIT = _GAMMA / 2.0
_EXPLICIT = math.sqrt(2.0) / 4.0


# --- parameters


def hydraulic_parameters(
    pressure: CylinderPressure,
    *,
    area: float,
    crank_radius: float,
    rod_length: float,
    speed: float,
) -> NDArray[np.void]:
    """Kernel parameters of one cylinder.

    Parameters
    ----------
    pressure : CylinderPressure
        Validated by the scene; the kernels trust it.
    area : float
        Of the piston face [m^2].
    crank_radius, rod_length : float
        Of the crank mechanism [m]; their sum is the top dead centre.
    speed : float
        Crank speed [rad/s], used by :func:`lowest_pressure` alone.

    Returns
    -------
    numpy.ndarray [shape=(1,), dtype=HYDRAULIC]
        Its one record is what the kernels take.

    Examples
    --------
    >>> pressure = CylinderPressure(discharge=0.3e6)
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> [float(value) for value in line_pressure(4.0, 31.4, 1.0, h)]
    [300000.0, 0.0]
    """
    record = np.zeros(1, dtype=HYDRAULIC)
    liquid = pressure.liquid
    piped = pressure.rung in PIPED_RUNGS
    suction, discharge = pressure.at_pump if piped else (pressure.suction, pressure.discharge)
    values: dict[str, float] = {
        "rung": PRESSURE_CODES[pressure.rung],
        "two_harmonic": pressure.flow == "two-harmonic",
        "area": area,
        "crank_radius": crank_radius,
        "rod_length": rod_length,
        "speed": speed,
        "suction": suction,
        "discharge": discharge,
        "rise_delay": pressure.rise_delay,
        "rise_angle": pressure.rise_angle,
        "fall_delay": pressure.fall_delay,
        "fall_angle": pressure.rise_angle if pressure.fall_angle is None else pressure.fall_angle,
        "density": liquid.density,
        "dead_volume": pressure.dead_volume or 0.0,
        "bulk_modulus": liquid.bulk_modulus,
        "air_fraction": liquid.air_fraction,
        "air_power": 1.0 / liquid.air_exponent,
        "vapour": liquid.vapour_pressure - STANDARD_ATMOSPHERE,
        **_head_values(pressure),
        **_valve_values("suction", pressure.suction_valve, liquid),
        **_valve_values("discharge", pressure.discharge_valve, liquid),
    }
    for name, value in values.items():
        record[name] = value
    return record


def _head_values(pressure: CylinderPressure) -> dict[str, float]:
    density = pressure.liquid.density
    inlet, outlet = pressure.suction_line, pressure.discharge_line
    weight = density * STANDARD_GRAVITY
    return {
        "suction_head": pressure.suction - (weight * inlet.rise if inlet else 0.0),
        "suction_resistance": _resistance(inlet, pressure.suction_valve, density),
        "suction_inertance": _inertance(inlet, pressure.suction_valve, density),
        "discharge_head": pressure.discharge + (weight * outlet.rise if outlet else 0.0),
        "discharge_resistance": _resistance(outlet, pressure.discharge_valve, density),
        "discharge_inertance": _inertance(outlet, pressure.discharge_valve, density),
        "outlet_area": _circle(outlet.diameter) if outlet else math.inf,
    }


def _circle(diameter: float) -> float:
    return math.pi / 4 * diameter**2


def _resistance(line: Line | None, valve: Valve | None, density: float) -> float:
    total = 0.0
    if line is not None:
        loss = line.friction_factor * line.length / line.diameter + line.minor_loss
        total += loss / _circle(line.diameter) ** 2
    if valve is not None:
        total += valve.resistance / (valve.count * _circle(valve.diameter)) ** 2
    return 0.5 * density * total


def _inertance(line: Line | None, valve: Valve | None, density: float) -> float:
    total = 0.0
    if line is not None:
        total += line.length / _circle(line.diameter)
    if valve is not None:
        total += valve.equivalent_length / (valve.count * _circle(valve.diameter))
    return density * total


def _valve_values(side: str, valve: Valve | None, liquid: Liquid) -> dict[str, float]:
    """The group of valves of one side, as one valve; no valve is one that is stuck shut."""
    if valve is None:
        return {f"{side}_mass": 1.0, f"{side}_stuck": 0.0}
    n = valve.count
    speed = valve.discharge_coefficient * math.sqrt(2.0 / liquid.density)  # of 1 Pa
    values = {
        "gap_conductance": n * speed * math.pi * valve.diameter,
        "leak_conductance": speed * valve.leak_area,
        "area": n * _circle(valve.diameter),
        "force_area": n * valve.force_coefficient * _circle(valve.diameter),
        "mass": n * valve.mass,
        "stiffness": n * valve.stiffness,
        "preload": n * valve.stiffness * valve.preload_lift,
        "damping": n * valve.damping,
        "max_lift": valve.max_lift,
        "seat_stiffness": n * valve.seat_stiffness,
        "seat_damping": n * valve.seat_damping,
        "stuck": -1.0 if valve.stuck_lift is None else valve.stuck_lift,
    }
    return {f"{side}_{name}": value for name, value in values.items()}


# --- rungs that are functions of the piston's motion


@kernel
def two_level_pressure(angle: float, suction: float, discharge: float, h: Any) -> float:
    """Suction level while the piston withdraws, discharge level while it advances [Pa].

    Parameters
    ----------
    angle : float
        Crank angle [rad]; the piston withdraws from 0 to pi.
    suction, discharge : float
        Gauge pressures [Pa].
    h : record of dtype HYDRAULIC
        Its delays and angles [rad]: after each dead centre the level stays for the delay, then
        changes over the angle by the cubic with zero slope at both ends.

    Notes
    -----
    The delay is what a valve takes to close: its plate follows the flow and is still open at the
    dead centre, 5 to 15 degrees in plate valves. The angle is what the liquid and its air take to
    be compressed, ``dV/V = dp/K``; at the other end the dead volume expands, so rise and fall
    differ [1]_.

    References
    ----------
    .. [1] J. E. Miller, The Reciprocating Pump: Theory, Design, and Use, 2nd ed., Krieger 1995,
       chapters on valves and on volumetric efficiency.
    """
    turn = 2.0 * math.pi
    phase = angle - turn * np.floor(angle * (1.0 / turn))  # off by rounding at a dead centre
    falls = phase < math.pi
    before, after = (discharge, suction) if falls else (suction, discharge)
    since = phase - h.fall_delay if falls else phase - math.pi - h.rise_delay
    u = min(max(since / (h.fall_angle if falls else h.rise_angle), 0.0), 1.0)
    level: float = before + (after - before) * u * u * (3.0 - 2.0 * u)
    return level


@kernel
def _inflow(angle: float, crank_speed: float, piston_velocity: float, h: Any) -> Any:
    """Flow into the cylinder, its rate so far as it is not the piston's inertia, and its mass."""
    if h.two_harmonic == 0:
        return -h.area * piston_velocity, 0.0, 1.0
    ratio = h.crank_radius / h.rod_length
    flow = h.area * h.crank_radius * crank_speed
    return (
        flow * (math.sin(angle) + 0.5 * ratio * math.sin(2.0 * angle)),
        flow * crank_speed * (math.cos(angle) + ratio * math.cos(2.0 * angle)),
        0.0,
    )


@kernel
def _head_pressure(angle: float, crank_speed: float, piston_velocity: float, h: Any) -> Any:
    flow, rate, inertia = _inflow(angle, crank_speed, piston_velocity, h)
    share = two_level_pressure(angle, 0.0, 1.0, h)  # of the discharge side
    speed = flow / h.area
    outlet_speed = flow / h.outlet_area
    loss = flow * abs(flow)
    kinetic = 0.5 * h.density
    suction = (
        h.suction_head
        - kinetic * speed * speed
        - h.suction_resistance * loss
        - h.suction_inertance * rate
    )
    discharge = (
        h.discharge_head
        + kinetic * (outlet_speed * outlet_speed - speed * speed)
        - h.discharge_resistance * loss  # the flow counts inwards
        - h.discharge_inertance * rate
    )
    inertance = h.suction_inertance + share * (h.discharge_inertance - h.suction_inertance)
    return suction + share * (discharge - suction), inertia * h.area * h.area * inertance


@kernel
def line_pressure(angle: float, crank_speed: float, piston_velocity: float, h: Any) -> Any:
    """Pressure in the cylinder of the rungs without a state, and the liquid that moves along.

    Parameters
    ----------
    angle : float
        Crank angle [rad], 0 at the top dead centre.
    crank_speed : float
        [rad/s]
    piston_velocity : float
        x' [m/s], positive towards the cylinder.
    h : record of dtype HYDRAULIC
        Rung none, constant, two-level or heads.

    Returns
    -------
    pressure : float
        Gauge [Pa]; ``-A p`` is its force on the piston along x.
    added_mass : float
        Of the liquid columns, to be added to the piston's mass [kg].

    Notes
    -----
    The rung *heads* is the energy balance between the free ends of the lines and the piston face,
    whose speed is u; Q is the flow into the cylinder on the suction side, out of it on the other::

        p1 = suction   - rho g rise - rho u^2 / 2               - R Q |Q| - M dQ/dt
        p2 = discharge + rho g rise + rho (u_out^2 - u^2) / 2   + R Q |Q| + M dQ/dt

    with ``R = rho/2 ((f L / D + K) / A_line^2 + zeta / A_valve^2)`` and
    ``M = rho (L / A_line + l / A_valve)``. With the exact flow ``Q = -A x'`` the last term is
    handed out as the added mass ``A^2 M``, so no acceleration is needed; with the two-harmonic
    flow ``A r w (sin a + lambda/2 sin 2a)`` it is in the pressure, and the added mass is 0. That
    flow errs by at most ``0.163 lambda^3`` of ``A r w``. About a dead centre one side
    passes into the other as in the rung *two-level*.

    Valid while the liquid column holds together: see :func:`lowest_pressure`.

    References
    ----------
    Xia, Zhang, Yu, Zhu (2017), Ship Science and Technology 39(1), 51-55, eqs 16 to 27 with their
    misprints mended.

    Examples
    --------
    >>> pressure = CylinderPressure(
    ...     rung="heads", suction_line=Line(), discharge_line=Line(), discharge=0.3e6
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> p, mass = line_pressure(1.6, 31.4, -1.57, h)
    >>> round(p), round(mass, 3)  # 1230 Pa of speed at the piston, 4786 Pa of loss
    (-6016, 3.718)
    """
    if h.rung == PRESSURE_CONSTANT:
        return h.discharge, 0.0
    if h.rung == PRESSURE_TWO_LEVEL:
        return two_level_pressure(angle, h.suction, h.discharge, h), 0.0
    if h.rung == PRESSURE_HEADS:
        return _head_pressure(angle, crank_speed, piston_velocity, h)
    return 0.0, 0.0


def lowest_pressure(h: Any) -> float:
    """Lowest pressure of a revolution that the piston would need of the rung *heads* [Pa].

    Parameters
    ----------
    h : record of dtype HYDRAULIC
        Of the rung heads.

    Returns
    -------
    float
        Gauge [Pa], at the speed given to :func:`hydraulic_parameters`, with the motion of a crank
        without clearance. Below ``h["vapour"]`` the liquid would part from the piston: the rung
        is not valid there, the rung *chamber* is.

    Raises
    ------
    ValueError
        The record is of another rung.

    Examples
    --------
    >>> pressure = CylinderPressure(
    ...     rung="heads", suction_line=Line(length=1.5), discharge_line=Line(), suction=-3e4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> bool(lowest_pressure(h) < h["vapour"])  # 1.5 m of suction line without an air vessel
    True
    """
    if h["rung"] != PRESSURE_HEADS:
        raise ValueError(
            f"rung = {h['rung']} must be {PRESSURE_HEADS} (heads); "
            "the other rungs do not depend on the inertia of the liquid"
        )
    angle = np.linspace(0.0, 2 * math.pi, 3601)
    ratio = float(h["crank_radius"] / h["rod_length"])
    speed = float(h["speed"])
    unit = float(h["crank_radius"]) * speed
    velocity = -unit * flow_shape(angle, ratio)
    acceleration = -unit * speed * _flow_slope(angle, ratio)
    lowest = math.inf
    for a, v, acc in zip(angle, velocity, acceleration, strict=True):
        p, mass = line_pressure(float(a), speed, float(v), h)
        lowest = min(lowest, p + mass * acc / float(h["area"]))
    return float(lowest)


# --- the liquid


@kernel
def air_volume(pressure: float, h: Any) -> float:
    """Volume of the air per volume of mixture at atmospheric pressure."""
    share: float = h.air_fraction * power(
        STANDARD_ATMOSPHERE / (pressure + STANDARD_ATMOSPHERE), h.air_power
    )
    return share


@kernel
def _air_series(pressure: float, known: Any, h: Any) -> Any:
    """The same, from a known value, and whether that is near enough for this series."""
    e = (pressure - known[0]) * known[2]
    k = h.air_power
    s = 1.0 - e * (k + 4.0) * 0.2
    s = 1.0 - e * (k + 3.0) * 0.25 * s
    s = 1.0 - e * (k + 2.0) * (1.0 / 3.0) * s
    s = 1.0 - e * (k + 1.0) * 0.5 * s
    return known[1] * (1.0 - e * k * s), abs(e) <= _SERIES_REACH


@kernel
def _air_near(pressure: float, known: Any, h: Any) -> float:
    """The same: within a hundredth of a known value a series saves the power."""
    near, good = _air_series(pressure, known, h)
    volume: float = near if good else _air_far(pressure, h)
    return volume


@subroutine
def _air_far(pressure: float, h: Any) -> float:
    """A call of its own: the compiler would take the power in any case, and then choose."""
    volume: float = air_volume(pressure, h)
    return volume


@kernel
def _specific(pressure: float, air: float, h: Any) -> Any:
    """Volume per volume at atmospheric pressure, and its derivative [1/Pa]."""
    stiff, absolute = h.bulk_modulus + pressure, pressure + STANDARD_ATMOSPHERE
    inverse = 1.0 / (stiff * absolute)  # one division for two
    softness = inverse * absolute
    liquid = (1.0 - h.air_fraction) * h.bulk_modulus * softness
    return liquid + air, -liquid * softness - h.air_power * air * inverse * stiff


@kernel
def specific_volume(pressure: float, h: Any) -> Any:
    """Volume of liquid and air over their volume at atmospheric pressure, with its slope.

    Parameters
    ----------
    pressure : float
        Gauge [Pa], above vacuum.
    h : record of dtype HYDRAULIC

    Returns
    -------
    v : float
        ``(1 - a) / (1 + p / B) + a (p_a / (p_a + p))^(1/n)``, with the air fraction a at
        atmospheric pressure p_a and the polytropic exponent n.
    slope : float
        dv/dp [1/Pa]; ``-v / slope`` is the bulk modulus of the mixture.

    Notes
    -----
    Mass is counted in volumes at atmospheric pressure, so that its books are exact. Air neither
    dissolves nor comes out of solution; the liquid's density is linear in the pressure.

    References
    ----------
    Gholizadeh, Burton, Schoenau (2011), Fluid bulk modulus: a literature survey, International
    Journal of Fluid Power 12(3), 5-15, doi:10.1080/14399776.2011.10781033.

    Examples
    --------
    >>> h = hydraulic_parameters(
    ...     CylinderPressure(), area=1.0, crank_radius=0.05, rod_length=0.25, speed=0.0
    ... )[0]
    >>> v, slope = specific_volume(0.0, h)
    >>> round(v, 12), round(-v / slope / 1e6, 1)  # two per mille of air: a thirtieth of water's
    (1.0, 68.7)
    """
    return _specific(pressure, air_volume(pressure, h), h)


# --- the valves


class ValveSide(NamedTuple):
    """The valves of one side, as one valve."""

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
def _touches(lift: float, rate: float, side: Any) -> float:
    """-1 on the seat, 1 on the stop, 0 free: contact pushes and never pulls."""
    over = lift - side.max_lift
    damped = side.seat_damping * rate
    on_seat = lift < 0.0 and side.seat_stiffness * lift + damped < 0.0
    on_stop = lift >= 0.0 and over > 0.0 and side.seat_stiffness * over + damped > 0.0
    return -1.0 if on_seat else 1.0 if on_stop else 0.0


@kernel
def _seat_force(lift: float, rate: float, contact: float, side: Any) -> float:
    """Force of seat or stop on the valve, positive in the direction of opening [N]."""
    over = lift - side.max_lift if contact > 0.0 else lift
    force: float = -side.seat_stiffness * over - side.seat_damping * rate
    return force if contact != 0.0 else 0.0


@kernel
def valve_shares(dt: float, side: Any) -> Any:
    """What of a force becomes rate in an implicit stage, free and in contact; momentum factor."""
    if side.stuck >= 0.0:
        return 0.0, 0.0, 0.0
    per_dt = 1.0 / dt
    free = side.mass * per_dt + side.damping + dt * side.stiffness
    held = free + side.seat_damping + dt * side.seat_stiffness
    return 1.0 / free, 1.0 / held, side.mass * per_dt


@kernel
def _lift_line(lift: float, rate: float, contact: float, shares: Any, side: Any) -> Any:
    """Rate at the end of an implicit stage, as a line over the pressure drop: ``a + b dp``.

    `lift` and `rate` are what the stage starts from; solves ``v = rate + dt F(z, v, dp) / m`` with
    ``z = lift + dt v``.
    """
    free = rate * shares[2] - side.preload - side.stiffness * lift
    held = free - side.seat_stiffness * (lift - side.max_lift if contact > 0.0 else lift)
    share = shares[1] if contact != 0.0 else shares[0]
    return (held if contact != 0.0 else free) * share, side.force_area * share


@kernel
def _orifice(drop: float) -> Any:
    """Signed square root of a pressure drop, linear where the flow is laminar; and its slope."""
    size = abs(drop)
    inverse = 1.0 / math.sqrt(size + _LAMINAR)
    return drop * inverse, inverse * (1.0 - 0.5 * size * inverse * inverse)


@kernel
def _valve_flow(drop: float, lift: float, dt: float, line: Any, side: Any) -> Any:
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
def _flow_now(drop: float, lift: float, rate: float, side: Any) -> float:
    conductance = side.leak_conductance + side.gap_conductance * max(lift, 0.0)
    flow: float = conductance * _orifice(drop)[0] + side.area * rate
    return flow


@kernel
def _pull(drop: float, lift: float, rate: float, contact: float, side: Any) -> float:
    """Acceleration of a valve [m/s^2]."""
    force: float = _seat_force(lift, rate, contact, side) + side.force_area * drop
    force -= side.preload + side.stiffness * lift + side.damping * rate
    pull: float = force / side.mass
    return 0.0 if side.stuck >= 0.0 else pull


# --- the chamber


@kernel
def _newton(
    p: float, air: float, mass: float, volume: float, dt: float, valves: Any, h: Any
) -> Any:
    """Room that a stage's pressure leaves, Newton's change of it, flows with slopes; if it will do.

    The equation is that of :func:`_balance`.
    """
    lift_s, line_s, suction, lift_d, line_d, discharge = valves
    v, slope = _specific(p, air, h)
    q_s, s_s = _valve_flow(h.suction - p, lift_s, dt, line_s, suction)
    q_d, s_d = _valve_flow(p - h.discharge, lift_d, dt, line_d, discharge)
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

    Solves ``V = v(p) (mass + dt (Q_s(p) - Q_d(p)))``, whose right side falls with p: Newton, kept
    inside a bracket that starts at the vapour pressure. Where even that pressure leaves room, the
    room is vapour. The flows end on the tangent of the last iterate, so that the mass
    is booked exactly and the pressure follows it.
    """
    low, high, floor_open = h.vapour, _PRESSURE_LIMIT, True
    p, q_s, q_d = max(guess, low), 0.0, 0.0
    last = 2.0 * _PRESSURE_LIMIT
    for _ in range(_MOST_ITERATIONS):
        air = _air_near(p, known, h)
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
    """Pressure and vapour of a mass in a volume, from a good guess: the books are exact."""
    for _ in range(_MOST_ITERATIONS):
        change = _settling(p, _air_near(p, known, h), volume, held, h)
        p += change
        if p <= h.vapour:
            v = _specific(h.vapour, air_volume(h.vapour, h), h)[0]
            if volume >= v * held:
                return h.vapour, volume - v * held
            p = h.vapour
        elif abs(change) <= _SETTLED * (p + STANDARD_ATMOSPHERE):
            break
    return p, 0.0


@kernel
def _settling(p: float, air: float, volume: float, held: float, h: Any) -> float:
    v, slope = _specific(p, air, h)
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
    """As :func:`_balance`, in the fewest iterations that mostly do; whether they did.

    Newton twice, or once and once more for the books, and no bound had a say in it: then these
    are the same numbers in the same order, without a loop or a branch.
    """
    air, near = _air_series(guess, known, h)
    room, change, q_s, q_d, s_s, s_d, fine = _newton(guess, air, mass, volume, dt, valves, h)
    sure, p = near and guess > h.vapour, guess + change
    q_s, q_d = q_s - s_s * change, q_d + s_d * change
    if last_stage:
        air, near = _air_series(p, known, h)
        change = _settling(p, air, volume, mass + dt * (q_s - q_d), h)
        p += change
        settled = p > h.vapour and abs(change) <= _SETTLED * (p + STANDARD_ATMOSPHERE)
        return p, q_s, q_d, sure and fine and near and settled
    between = h.vapour < p and (p < guess if room > 0.0 else guess < p < _PRESSURE_LIMIT)
    air, near = _air_series(p, known, h)
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
    """Which valves touch at the end of a stage under a guessed pressure."""
    lift_s, rate_s, lift_d, rate_d = start
    suction, shares_s, discharge, shares_d = valves
    line_s = _lift_line(lift_s, rate_s, 0.0, shares_s, suction)
    line_d = _lift_line(lift_d, rate_d, 0.0, shares_d, discharge)
    v_s = line_s[0] + line_s[1] * (h.suction - guess)
    v_d = line_d[0] + line_d[1] * (guess - h.discharge)
    return _touches(lift_s + dt * v_s, v_s, suction), _touches(lift_d + dt * v_d, v_d, discharge)


@kernel
def _lines(on_s: float, on_d: float, start: Any, valves: Any) -> Any:
    """Both valves as lines over the pressure drop, as :func:`_balance` takes them."""
    lift_s, rate_s, lift_d, rate_d = start
    suction, shares_s, discharge, shares_d = valves
    return (
        lift_s,
        _lift_line(lift_s, rate_s, on_s, shares_s, suction),
        suction,
        lift_d,
        _lift_line(lift_d, rate_d, on_d, shares_d, discharge),
        discharge,
    )


@kernel
def _outcome(p: float, dt: float, on_s: float, on_d: float, lines: Any, h: Any) -> Any:
    """Rates of both valves at the end of a stage, and the contacts that agree with them."""
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
    """One implicit stage: pressure first, the valves as lines over it; contact as it turns out.

    The last value is false where a stage `at_once` did not find its end.
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
    """Contact that agrees with a stage's outcome; one that pushes is kept."""
    pushes = _seat_force(lift, rate, contact, side) * contact <= 0.0
    kept = contact if pushes else 0.0
    return kept if contact != 0.0 else _touches(lift, rate, side)


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
    """TR-BDF2 over one substep: two implicit stages with the same implicit part.

    The last value is false where a stage `at_once` did not find its end.
    """
    p0, _, z_s, v_s, z_d, v_d = state
    suction, _, discharge, _ = valves
    known = (p0, air, 1.0 / (p0 + STANDARD_ATMOSPHERE))
    drop_s, drop_d = h.suction - p0, p0 - h.discharge
    on_s, on_d = _touches(z_s, v_s, suction), _touches(z_d, v_d, discharge)
    q_s0 = _flow_now(drop_s, z_s, v_s, suction)
    q_d0 = _flow_now(drop_d, z_d, v_d, discharge)
    a_s0 = _pull(drop_s, z_s, v_s, on_s, suction)
    a_d0 = _pull(drop_d, z_d, v_d, on_d, discharge)
    f_s0 = _seat_force(z_s, v_s, on_s, suction)
    f_d0 = _seat_force(z_d, v_d, on_d, discharge)
    c = implicit_part(dt)
    start = (z_s + c * v_s, v_s + c * a_s0, z_d + c * v_d, v_d + c * a_d0)
    p1, _, q_s1, q_d1, v_s1, v_d1, on_s, on_d, sure = _stage(
        mass + c * (q_s0 - q_d0), middle, c, p0, known, start, valves, False, at_once, h
    )
    f_s1 = _seat_force(start[0] + c * v_s1, v_s1, on_s, suction)
    f_d1 = _seat_force(start[2] + c * v_d1, v_d1, on_d, discharge)
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
    f_s2 = _seat_force(z_s2, v_s2, on_s, suction)
    f_d2 = _seat_force(z_d2, v_d2, on_d, discharge)
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
    """What a volume holds, in volumes at atmospheric pressure [m^3]."""
    mass: float = volume / _specific(pressure, air, h)[0]
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
    """As :func:`chamber_step` in one substep, for chambers side by side.

    Parameters
    ----------
    state : tuple of float
        As :data:`CHAMBER_STATE`.
    air : float
        :func:`air_volume` at its pressure.
    h : record of dtype HYDRAULIC, or a tuple with its names
    valves : tuple
        :func:`suction_side`, what :func:`valve_shares` makes of it over an :func:`implicit_part` of
        the step, and both of the discharge side.
    step, x0, v0, x1, v1 : float
        As there.

    Returns
    -------
    state : tuple of float
        At the end of the step.
    suction_impulse, discharge_impulse : float
        As :data:`CHAMBER_FLOWS` [N s].
    sure : bool
        These are the very numbers of :func:`chamber_step`; else it must be asked. That is so in
        one step of a hundred: where a valve comes down on its seat, vapour fills the chamber, or
        the pressure leaps.
    """
    mass = _mass(state[0], air, _volume(x0, h) - state[1], h)
    middle, end = _volume(_hermite(_GAMMA, step, x0, v0, x1, v1), h), _volume(x1, h)
    now, q_s, _, f_s, f_d, sure = _substep(state, mass, air, step, middle, end, valves, True, h)
    total = now[3] + now[5] + q_s
    sound = middle > 0.0 and end > 0.0 and total - total == 0.0 and now[0] < _PRESSURE_LIMIT
    return now, 0.0 + f_s, 0.0 + f_d, sure and sound


@kernel
def implicit_part(step: float) -> float:
    """Of a substep: what either stage of TR-BDF2 takes implicitly [s]."""
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
        two valves in their opening directions, counted at atmospheric pressure [m^3], and the
        impulses of seat and stop on the casing [N s], positive along the closing direction of the
        valve.
    h : record of dtype HYDRAULIC
        Of the rung *chamber*.
    step : float
        [s]
    x0, v0, x1, v1 : float
        Piston position [m] and velocity [m/s] at both ends; a cubic between them.
    substeps : int
        See :func:`chamber_substeps`.

    Returns
    -------
    int
        ``CHAMBER_OK``, or why `state` was left as it was; :data:`CHAMBER_TEXT` has the cures.

    Notes
    -----
    The mass in the chamber is ``M = (V - V_vapour) / v(p)``, in volumes at atmospheric pressure,
    see :func:`specific_volume`; ``V = V_dead + A (x_top - x)``. ::

        M'  = Q_s - Q_d,                0 <= V_vapour  complementary to  p >= p_vapour
        Q   = (C_d pi D z + C_d A_leak) sqrt(2 dp / rho) + A_v z'
        m z'' + c z' + k z + F_0 = C_f A_v dp + seat and stop

    with dp over the valve in its opening direction, flow of either sign, and the plate's
    displacement after Westphal. ``sqrt(dp)`` reads ``dp / sqrt(|dp| + 1 Pa)``: under little
    pressure a gap is viscous. Seat and stop are springs with dampers that push only.

    TR-BDF2 is L-stable and of second order in the pressure as well as in the valves, on which the
    pressure depends through the plate's displacement: each stage eliminates the valves and solves
    one scalar equation for the pressure. Liquid columns in the manifolds are not part of it.

    References
    ----------
    Hosea, Shampine (1996), Analysis and implementation of TR-BDF2, Applied Numerical Mathematics
    20, 21-37, doi:10.1016/0168-9274(95)00115-8.

    Examples
    --------
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


def chamber_substeps(h: Any, step: float) -> int:
    """Substeps of a step that resolve a valve's contact with its seat.

    Parameters
    ----------
    h : record of dtype HYDRAULIC
    step : float
        Of the mechanism [s], > 0.

    Returns
    -------
    int
        At least 1; 12 substeps or more in a period of the stiffer contact. More is never needed
        for stability, only for accuracy: the method is L-stable.

    Examples
    --------
    >>> pressure = CylinderPressure(
    ...     rung="chamber", suction_valve=Valve(), discharge_valve=Valve(), dead_volume=4e-4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> chamber_substeps(h, 2e-5), chamber_substeps(h, 5e-5)
    (1, 3)
    """
    fastest = max(
        math.sqrt(h[f"{side}_seat_stiffness"] / h[f"{side}_mass"]) if h[f"{side}_stuck"] < 0 else 0
        for side in ("suction", "discharge")
    )
    return max(1, math.ceil(step * fastest / _STEP_PER_CONTACT_TIME))


def chamber_start(h: Any, x: float, v: float) -> NDArray[np.float64]:
    """Chamber in balance with a steadily moving piston: one valve open, the other on its seat.

    Parameters
    ----------
    h : record of dtype HYDRAULIC
        Of the rung *chamber*.
    x, v : float
        Piston position [m] and velocity [m/s].

    Returns
    -------
    numpy.ndarray [shape=(6,)]
        Columns as :data:`CHAMBER_STATE`.

    Examples
    --------
    >>> pressure = CylinderPressure(
    ...     rung="chamber", suction_valve=Valve(), discharge_valve=Valve(), dead_volume=4e-4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> p, vapour, lift = chamber_start(h, 0.25, -1.6)[:3]
    >>> round(float(p)), round(float(1e3 * lift), 2)  # [Pa], [mm]
    (-18080, 5.71)
    """
    flow = abs(float(h["area"]) * v)
    inward = v <= 0
    drop = _steady_drop(h, "suction" if inward else "discharge", flow)
    pressure = float(h["suction"]) - drop if inward else float(h["discharge"]) + drop
    pressure = max(pressure, float(h["vapour"]))
    suction = _steady_lift(h, "suction", float(h["suction"]) - pressure)
    discharge = _steady_lift(h, "discharge", pressure - float(h["discharge"]))
    del x  # the balance holds at any position
    return np.array([pressure, 0.0, suction, 0.0, discharge, 0.0])


def _steady_lift(h: Any, side: str, drop: float) -> float:
    """Lift at rest under a pressure drop: on the spring, pressed into the seat or the stop."""
    if h[f"{side}_stuck"] >= 0:
        return float(h[f"{side}_stuck"])
    force = float(h[f"{side}_force_area"]) * drop - float(h[f"{side}_preload"])
    soft, top = float(h[f"{side}_stiffness"]), float(h[f"{side}_max_lift"])
    hard = soft + float(h[f"{side}_seat_stiffness"])
    if force <= 0:
        return force / hard
    return force / soft if force < soft * top else top + (force - soft * top) / hard


def _steady_drop(h: Any, side: str, flow: float) -> float:
    """Pressure drop at which the valve, at rest, passes a flow [Pa]; by bisection."""
    low, high = 0.0, 1e9
    for _ in range(100):
        drop = 0.5 * (low + high)
        gap = max(_steady_lift(h, side, drop), 0.0)
        conductance = float(h[f"{side}_gap_conductance"]) * gap
        conductance += float(h[f"{side}_leak_conductance"])
        if conductance * math.sqrt(drop) < flow:
            low = drop
        else:
            high = drop
    return 0.5 * (low + high)


@dataclass(frozen=True, kw_only=True)
class ChamberRun:
    """A chamber driven by a given motion of its piston.

    Attributes
    ----------
    states : numpy.ndarray [shape=(n_steps + 1, 6)]
        Columns as :data:`CHAMBER_STATE`, at the ends of the steps.
    flows : numpy.ndarray [shape=(n_steps, 4)]
        Columns as :data:`CHAMBER_FLOWS`, of each step.
    code : int
        ``CHAMBER_OK``, or why the run ends early.
    """

    states: NDArray[np.float64]
    flows: NDArray[np.float64]
    code: int


def run_chamber(
    h: Any,
    piston: NDArray[np.float64],
    velocity: NDArray[np.float64],
    *,
    step: float,
    substeps: int | None = None,
    start: NDArray[np.float64] | None = None,
) -> ChamberRun:
    """Drive a chamber by a piston whose motion is known.

    Parameters
    ----------
    h : record of dtype HYDRAULIC
        Of the rung *chamber*.
    piston, velocity : numpy.ndarray [shape=(n_steps + 1,)]
        Position [m] and velocity [m/s] at the ends of the steps.
    step : float
        [s]
    substeps : int, optional
        As :func:`chamber_substeps` where it is not given.
    start : numpy.ndarray [shape=(6,)], optional
        As :func:`chamber_start` where it is not given.

    Returns
    -------
    ChamberRun
        Cut off before the step in which it failed where the code is not ``CHAMBER_OK``.

    Examples
    --------
    >>> pressure = CylinderPressure(
    ...     rung="chamber", suction_valve=Valve(), discharge_valve=Valve(), dead_volume=4e-4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> run = run_chamber(h, np.full(501, 0.27), np.zeros(501), step=2e-5)
    >>> abs(float(run.states[-1, 0])) < 1.0  # [Pa]: nothing moves, nothing happens
    True
    """
    if substeps is None:
        substeps = chamber_substeps(h, step)
    states = np.empty((piston.size, len(CHAMBER_STATE)))
    states[0] = chamber_start(h, float(piston[0]), float(velocity[0])) if start is None else start
    flows = np.empty((piston.size - 1, len(CHAMBER_FLOWS)))
    code, done = _march(states, flows, h, step, piston, velocity, substeps)
    return ChamberRun(states=states[: done + 1], flows=flows[:done], code=code)


@kernel
def _march(
    states: NDArray[np.float64],
    flows: NDArray[np.float64],
    h: Any,
    step: float,
    piston: NDArray[np.float64],
    velocity: NDArray[np.float64],
    substeps: int,
) -> Any:
    for i in range(flows.shape[0]):
        for column in range(states.shape[1]):
            states[i + 1, column] = states[i, column]
        code = chamber_step(
            states[i + 1],
            flows[i],
            h,
            step,
            piston[i],
            velocity[i],
            piston[i + 1],
            velocity[i + 1],
            substeps,
        )
        if code != CHAMBER_OK:
            return code, i
    return CHAMBER_OK, flows.shape[0]


def lift_left(
    angle: NDArray[np.float64],
    lift: NDArray[np.float64],
    side: str,
    max_lift: float,
    *,
    after: float = math.radians(20.0),
) -> NDArray[np.float64]:
    """Lift that a valve still has in each of its idle strokes, over its largest lift.

    A suction valve must be shut while the piston advances, a discharge valve while it withdraws.
    One whose spring is too soft for the speed is still open some time after the dead centre and
    then shut by the flow that comes back, with a blow.

    Parameters
    ----------
    angle : numpy.ndarray [shape=(n,)]
        Crank angle, rising [rad].
    lift : numpy.ndarray [shape=(n,)]
        Of the valve [m], at the same instants.
    side : str
        ``"suction"`` or ``"discharge"``.
    max_lift : float
        [m], > 0.
    after : float
        Crank angle after the dead centre at which the idle stroke begins [rad]: 0 gives the lift
        left at that dead centre, pi the one at the end of the idle stroke, where only a stuck
        valve is open.

    Returns
    -------
    numpy.ndarray [shape=(n_cycles,)]
        One value for each such instant inside the run; 0 where the valve sits on its seat. More
        than a few per cent, cycle after cycle, is a valve that does not close in time.

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


# --- closed forms of the ideal pump


def flow_shape(angle: ArrayLike, crank_to_rod: float) -> NDArray[np.float64]:
    """Flow into a cylinder without valves' delays, over ``A r w``.

    Parameters
    ----------
    angle : array_like
        Crank angle [rad], 0 at the top dead centre.
    crank_to_rod : float
        Crank radius over rod length, lambda, from 0 to below 1.

    Returns
    -------
    numpy.ndarray [shape as angle]
        ``sin a + lambda sin a cos a / sqrt(1 - lambda^2 sin^2 a)``, negative while delivering.

    Examples
    --------
    >>> float(flow_shape(1.5707963267948966, 0.2))
    1.0
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    root = np.sqrt(1.0 - (crank_to_rod * sine) ** 2)
    return np.asarray(sine * (1.0 + crank_to_rod * cosine / root))


def _flow_slope(angle: ArrayLike, crank_to_rod: float) -> NDArray[np.float64]:
    """Derivative of :func:`flow_shape` over the angle."""
    sine, cosine = np.sin(angle), np.cos(angle)
    root = np.sqrt(1.0 - (crank_to_rod * sine) ** 2)
    bend = (cosine**2 - sine**2) / root + (crank_to_rod * sine * cosine) ** 2 / root**3
    return np.asarray(cosine + crank_to_rod * bend)


def even_phases(cylinders: int, turn: float = 2 * math.pi) -> NDArray[np.float64]:
    """Crank offsets of cylinders spread evenly over a turn [rad].

    Parameters
    ----------
    cylinders : int
        Their number.
    turn : float
        Angle they share [rad].

    Returns
    -------
    numpy.ndarray [shape=(cylinders,)]
        From 0 on [rad].

    Examples
    --------
    >>> [round(float(phase), 4) for phase in even_phases(3)]
    [0.0, 2.0944, 4.1888]
    """
    return np.arange(float(cylinders)) * (turn / cylinders)


@dataclass(frozen=True, kw_only=True)
class FlowRipple:
    """Extremes of a pump's flow about its mean.

    Attributes
    ----------
    above, below, total : float
        Largest flow above the mean, smallest below it, and their sum, over the mean.
    """

    above: float
    below: float
    total: float


def flow_ripple(
    crank_to_rod: float, phases: ArrayLike, *, double_acting: bool = False
) -> FlowRipple:
    """Kinematic flow ripple of an ideal pump: incompressible, valves without delay.

    Parameters
    ----------
    crank_to_rod : float
        Crank radius over rod length, lambda, from 0 to below 1.
    phases : array_like [shape=(n_cylinders,)]
        Offsets of the cranks [rad], see :func:`even_phases`.
    double_acting : bool
        Both sides of the pistons deliver; the rod's area is neglected.

    Returns
    -------
    FlowRipple
        From the exact kinematics; the extremes are those of smooth arcs between dead centres,
        found to 1e-9 of the mean.

    Raises
    ------
    ValueError
        lambda is outside [0, 1), or there is no cylinder.

    References
    ----------
    Karassik et al., Pump Handbook, chapter on displacement pumps: its table of flow variation
    belongs to lambda = 1/6.

    Examples
    --------
    >>> ripple = flow_ripple(1 / 6, even_phases(3))
    >>> [round(100 * value, 2) for value in (ripple.above, ripple.below, ripple.total)]
    [6.17, 16.95, 23.11]
    """
    offsets = _checked_phases(crank_to_rod, phases)
    arcs = _arcs(offsets)
    flow = _delivered(arcs, offsets, crank_to_rod, double_acting, flow_shape)
    mean = offsets.size * (2.0 if double_acting else 1.0) / math.pi
    above, below = _peak(flow) / mean - 1.0, 1.0 + _peak(-flow) / mean
    return FlowRipple(above=above, below=below, total=above + below)


def acceleration_constant(
    crank_to_rod: float, phases: ArrayLike, *, double_acting: bool = False
) -> float:
    """Constant C of the acceleration head ``h = L V n C / (g K)`` of a rigid liquid column.

    Parameters
    ----------
    crank_to_rod : float
        Crank radius over rod length, lambda, from 0 to below 1.
    phases : array_like [shape=(n_cylinders,)]
        Offsets of the cranks [rad], see :func:`even_phases`.
    double_acting : bool
        Both sides of the pistons draw; the rod's area is neglected.

    Returns
    -------
    float
        [min/s]: L line length, V mean speed in the line, n crank speed in rpm, K = 1.

    Raises
    ------
    ValueError
        lambda is outside [0, 1), or there is no cylinder.

    Notes
    -----
    ``C = (2 pi / 60) max(dQ/da) / mean Q``: the steepest rise of the common flow.

    References
    ----------
    Hydraulic Institute, reciprocating pump standard: table of C, computed at lambda = 1/5.

    Examples
    --------
    >>> round(acceleration_constant(0.2, even_phases(3)), 4)
    0.0658
    """
    offsets = _checked_phases(crank_to_rod, phases)
    arcs = _arcs(offsets)
    slope = _delivered(arcs, offsets, crank_to_rod, double_acting, _flow_slope, drawn=True)
    mean = offsets.size * (2.0 if double_acting else 1.0) / math.pi
    return 2 * math.pi / 60 * _peak(slope) / mean


def _checked_phases(crank_to_rod: float, phases: ArrayLike) -> NDArray[np.float64]:
    offsets = np.atleast_1d(np.asarray(phases, dtype=float))
    if not 0 <= crank_to_rod < 1:
        raise ValueError(f"crank_to_rod = {crank_to_rod} must be in [0, 1); lengthen the rod")
    if offsets.size == 0:
        raise ValueError("phases are empty, must be one for each cylinder; give at least one")
    return offsets


_ARC_POINTS = 513


def _arcs(offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles between neighbouring dead centres [shape=(n_arcs, n_points)]: no kink inside."""
    turn = 2 * math.pi
    centres = np.concatenate([-offsets, math.pi - offsets]) % turn
    kinks = np.unique(np.round(centres, 12))
    ends = np.append(kinks[1:], kinks[0] + turn)
    share = np.arange(_ARC_POINTS) / (_ARC_POINTS - 1)
    return np.asarray(kinks[:, None] + np.multiply.outer(ends - kinks, share))


def _delivered(
    arcs: NDArray[np.float64],
    offsets: NDArray[np.float64],
    crank_to_rod: float,
    double_acting: bool,
    shape: Any,
    *,
    drawn: bool = False,
) -> NDArray[np.float64]:
    """Common flow of all cylinders over ``A r w`` on the arcs, or its slope."""
    angles = arcs + offsets[:, None, None]
    withdraws = (np.sin(angles[..., _ARC_POINTS // 2]) > 0)[..., None]
    flow = shape(angles, crank_to_rod)
    if double_acting:
        return np.asarray(np.where(withdraws, flow, -flow).sum(axis=0))
    return np.asarray(np.where(withdraws == drawn, flow if drawn else -flow, 0.0).sum(axis=0))


def _peak(values: NDArray[np.float64]) -> float:
    """Largest value of sampled smooth arcs, by the parabola through its neighbours."""
    arc, i = np.unravel_index(int(np.argmax(values)), values.shape)
    if i in (0, values.shape[1] - 1):
        return float(values[arc, i])
    before, top, after = values[arc, i - 1 : i + 2]
    bend = before - 2.0 * top + after
    return float(top - (after - before) ** 2 / (8.0 * bend)) if bend < 0 else float(top)
