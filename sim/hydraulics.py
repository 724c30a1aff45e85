"""Cylinder pressure of a pump, compiled."""

import math

from .jit import kernel

PRESSURE_NONE = 0
PRESSURE_TWO_LEVEL = 1


@kernel
def two_level_pressure(angle: float, suction: float, discharge: float, rise_angle: float) -> float:
    """Suction level while the piston withdraws, discharge level while it advances [Pa].

    Parameters
    ----------
    angle : float
        Crank angle [rad]; the piston withdraws from 0 to pi.
    suction, discharge : float
        Gauge pressures [Pa].
    rise_angle : float
        After each dead centre the level changes over this angle [rad], by the cubic with zero
        slope at both ends: liquid with a little air is compressed, valves close late.
    """
    turn = 2.0 * math.pi
    phase = angle - turn * math.floor(angle / turn)
    if phase < math.pi:
        before, after = discharge, suction
    else:
        before, after = suction, discharge
        phase -= math.pi
    if phase >= rise_angle:
        return after
    u = phase / rise_angle
    return before + (after - before) * u * u * (3.0 - 2.0 * u)
