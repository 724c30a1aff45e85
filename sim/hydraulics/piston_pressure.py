"""Rungs that are functions of the piston's motion: constant, two levels, heads of the lines."""

import math
from typing import Any

import numpy as np

from ..jit import kernel
from .flow_ripple import flow_shape, flow_slope
from .parameters import PRESSURE_CONSTANT, PRESSURE_HEADS, PRESSURE_TWO_LEVEL


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
        changes over the angle by a cubic with zero slope at both ends.

    Notes
    -----
    The delay is the closing time of a valve: its plate follows the flow and is still open at the
    dead centre, for 5 to 15 degrees in plate valves. The angle is due to the compression of the
    liquid and its air, ``dV/V = dp/K``; at the other end the dead volume expands, so rise and fall
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
    """Flow into the cylinder, its rate without the part from the piston's inertia, and its mass."""
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
        - h.discharge_resistance * loss  # the flow is positive inwards
        - h.discharge_inertance * rate
    )
    inertance = h.suction_inertance + share * (h.discharge_inertance - h.suction_inertance)
    return suction + share * (discharge - suction), inertia * h.area * h.area * inertance


@kernel
def line_pressure(angle: float, crank_speed: float, piston_velocity: float, h: Any) -> Any:
    """Cylinder pressure of the rungs without a state, and the mass of liquid moving along.

    Parameters
    ----------
    angle : float
        Crank angle [rad], 0 at the top dead centre.
    crank_speed : float
        Crank speed [rad/s].
    piston_velocity : float
        x' [m/s], positive towards the cylinder.
    h : record of dtype HYDRAULIC
        Rung none, constant, two-level or heads.

    Returns
    -------
    pressure : float
        Gauge pressure [Pa]; ``-A p`` is its force on the piston along x.
    added_mass : float
        Mass of the liquid columns, to be added to the piston's mass [kg].

    Notes
    -----
    The rung *heads* is the energy balance between the free ends of the lines and the piston face,
    whose speed is u; Q is the flow into the cylinder on the suction side, out of it on the other::

        p1 = suction   - rho g rise - rho u^2 / 2               - R Q |Q| - M dQ/dt
        p2 = discharge + rho g rise + rho (u_out^2 - u^2) / 2   + R Q |Q| + M dQ/dt

    with ``R = rho/2 ((f L / D + K) / A_line^2 + zeta / A_valve^2)`` and
    ``M = rho (L / A_line + l / A_valve)``. With the exact flow ``Q = -A x'`` the last term is
    returned as the added mass ``A^2 M``, so no acceleration is needed; with the two-harmonic
    flow ``A r w (sin a + lambda/2 sin 2a)`` it is in the pressure, and the added mass is 0. That
    flow has an error of at most ``0.163 lambda^3`` of ``A r w``. Near a dead centre one side
    changes into the other as in the rung *two-level*.

    Valid while the liquid column holds together: see :func:`lowest_pressure`.

    References
    ----------
    Xia, Zhang, Yu, Zhu (2017), Ship Science and Technology 39(1), 51-55, eqs 16 to 27 with their
    misprints corrected.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.parameters import hydraulic_parameters
    >>> from wearstate.sim.scene.pump_hydraulics import CylinderPressure, Line
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
    """Lowest pressure of a revolution that the piston would need with the rung *heads* [Pa].

    Parameters
    ----------
    h : record of dtype HYDRAULIC
        Record with the rung heads.

    Returns
    -------
    float
        Gauge pressure at the speed given to :func:`hydraulic_parameters`, for the motion of a crank
        without clearance. Below ``h["vapour"]`` the liquid would separate from the piston: use the
        rung *chamber* instead.

    Raises
    ------
    ValueError
        The record has another rung.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.parameters import hydraulic_parameters
    >>> from wearstate.sim.scene.pump_hydraulics import CylinderPressure, Line
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
    acceleration = -unit * speed * flow_slope(angle, ratio)
    lowest = math.inf
    for a, v, acc in zip(angle, velocity, acceleration, strict=True):
        p, mass = line_pressure(float(a), speed, float(v), h)
        lowest = min(lowest, p + mass * acc / float(h["area"]))
    return float(lowest)
