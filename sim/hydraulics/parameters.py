"""Parameters of one cylinder's hydraulics for the kernels: rung, lines, liquid and valves."""

import math

import numpy as np
from numpy.typing import NDArray

from ..parts.units import STANDARD_GRAVITY
from ..scene.pump_hydraulics import (
    CHAMBER_RUNGS,
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
    **dict.fromkeys(CHAMBER_RUNGS, PRESSURE_CHAMBER),
}
"""Rung of the scene -> code of the kernels, from the cheapest to the best; pipes are separate."""

_VALVE_FIELDS = (
    "gap_conductance",  # for one metre of lift [m^2/s/sqrt(Pa)]
    "leak_conductance",  # [m^3/s/sqrt(Pa)]
    "area",  # of the seat openings [m^2]
    "force_area",  # [m^2]
    "mass",  # [kg], like the following for the whole group
    "stiffness",
    "preload",  # spring force on the closed valves [N]
    "damping",
    "max_lift",
    "seat_stiffness",
    "seat_damping",
    "stuck",  # lift [m], or -1 for free valves
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
"""Hydraulics of one throw in SI, from :func:`hydraulic_parameters`. Pressures are gauge;
resistance [Pa s^2/m^6] and inertance [kg/m^4] include a line and its valves."""


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
        Validated by the scene, not checked again.
    area : float
        Area of the piston [m^2].
    crank_radius, rod_length : float
        Dimensions of the crank mechanism [m]; their sum is the top dead centre.
    speed : float
        Crank speed [rad/s], used only by :func:`lowest_pressure`.

    Returns
    -------
    numpy.ndarray [shape=(1,), dtype=HYDRAULIC]
        One record, the argument of the kernels.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.piston_pressure import line_pressure
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
    """Valves of one side lumped into one; no valve counts as one stuck shut."""
    if valve is None:
        return {f"{side}_mass": 1.0, f"{side}_stuck": 0.0}
    n = valve.count
    speed = valve.discharge_coefficient * math.sqrt(2.0 / liquid.density)  # at 1 Pa
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
