"""Literature checks of a pump's liquid: ripple of the flow, acceleration head, valves, pipes."""

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np

from ...sim.hydraulics.chamber_run import run_chamber
from ...sim.hydraulics.flow_ripple import acceleration_constant, even_phases, flow_ripple
from ...sim.hydraulics.parameters import hydraulic_parameters
from ...sim.piping.pipe import drive_pipe, pipe_parameters, pipe_start
from ...sim.scene.pump_hydraulics import CylinderPressure, Damper, Line, Liquid, Valve


def _ripple(crank_to_rod: float, pump: str, quantity: str) -> float:
    phases, double_acting = _PUMPS[pump]
    ripple = flow_ripple(crank_to_rod, phases, double_acting=double_acting)
    return float(getattr(ripple, quantity))


def _acceleration(pump: str) -> float:
    phases, double_acting = _PUMPS[pump]
    return acceleration_constant(0.2, phases, double_acting=double_acting)


_PUMPS = {
    "simplex": (even_phases(1), False),
    "duplex": (even_phases(2), False),
    "triplex": (even_phases(3), False),
    "quadruplex": (even_phases(4), False),
    "quintuplex": (even_phases(5), False),
    "sextuplex": (even_phases(6), False),
    "septuplex": (even_phases(7), False),
    "nonuplex": (even_phases(9), False),
    "simplex double-acting": (even_phases(1), True),
    "duplex double-acting": (even_phases(2, math.pi), True),
}
"""Name -> crank offsets [rad], and whether both sides of the pistons deliver."""

_RIPPLES = (
    *(("1/6", 1 / 6, pump) for pump in _PUMPS if pump not in ("quintuplex", "septuplex")),
    *(("1/5", 1 / 5, pump) for pump in ("triplex", "quintuplex")),
    ("0", 0.0, "triplex"),
)

_ACCELERATED = (
    "simplex",
    "simplex double-acting",
    "duplex",
    "duplex double-acting",
    "triplex",
    "quintuplex",
    "septuplex",
    "nonuplex",
)


@cache
def _westphal() -> dict[str, float]:
    """Lift of a discharge valve under a force that does not change, by the compiled chamber.

    A valve without mass on a long soft spring keeps the pressure drop, and with it the velocity
    in the gap, constant: then the lift follows Westphal's closed form, a sine behind the piston's.
    """
    opening, diameter, turn, steps = 15e3, 0.045, 2 * math.pi, 20_000
    force = opening * math.pi / 4 * diameter**2
    valve = Valve(
        diameter=diameter,
        mass=1e-6,
        stiffness=0.3,
        preload_lift=force / 0.3,
        damping=0.0,
        seat_stiffness=9e5,
        seat_damping=0.0,
    )
    pressure = CylinderPressure(
        rung="chamber",
        discharge=3e5,
        suction_valve=valve,
        discharge_valve=valve,
        dead_volume=5e-4,
        liquid=Liquid(density=1000.0, bulk_modulus=1e12, air_fraction=0.0),
    )
    radius, speed = 0.05, 5 * turn
    h = hydraulic_parameters(
        pressure, area=math.pi / 4 * 0.01, crank_radius=radius, rod_length=0.25, speed=speed
    )[0]
    angle = 0.5 + turn * np.arange(6 * steps // 5) / steps
    piston, velocity = 0.25 + radius * np.cos(angle), -radius * speed * np.sin(angle)
    run = run_chamber(h, piston, velocity, step=turn / speed / steps)
    lift = run.states[:, 4]
    middle = (angle > 4.6) & (angle < 6.1)  # the start has died out, the dead centre is ahead
    waves = np.column_stack([-np.sin(angle), np.cos(angle)])[middle]
    in_phase, behind = np.linalg.lstsq(waves, lift[middle], rcond=None)[0]
    late = (angle > turn) & (lift <= 0.0)
    return {
        "amplitude": math.hypot(in_phase, behind),
        "phase": math.atan2(behind, in_phase),
        "left": float(np.interp(turn, angle, lift)),
        "delay": float(angle[late][0] - turn),
    }


def _westphal_value(name: str) -> float:
    return _westphal()[name]


@cache
def _pipe(quantity: str) -> float:
    """A smooth pipe of 12 m by 80 mm of water, 1200 m/s, whose flow is stopped at once."""
    vessel = Damper(gas_volume=1e-3) if quantity == "vessel" else None
    line = Line(length=12.0, wave_speed=1200.0, friction_factor=0.0, minor_loss=0.0, damper=vessel)
    step, far = 1e-4, 5e6
    pipes = pipe_parameters(
        line, Liquid(), far=far, relief_back=0.0, step=step, waves=quantity != "lumped"
    )
    start = math.pi / 4 * 0.08**2 if quantity == "surge" else 1e-4  # 1 m/s, or far from vapour
    states, nodes = pipe_start(pipes[0], start)
    pressure, entering = np.zeros(80_000), np.zeros(80_000)
    drive_pipe(pipes, states, nodes, np.zeros(80_000), step, pressure, entering)
    if quantity == "surge":
        return float(pressure[100] - far)
    rest = pressure - far
    up = np.flatnonzero((rest[:-1] < 0) & (rest[1:] >= 0))
    times = up - rest[up] / (rest[up + 1] - rest[up])
    return (len(times) - 1) / float((times[-1] - times[0]) * step)


def pump_checks() -> dict[str, Callable[[], float]]:
    """Checks of the flow, the valves and the pipes of pumps."""
    return {
        **{
            f"flow ripple {quantity}: {pump}, crank to rod {text}": partial(
                _ripple, ratio, pump, quantity
            )
            for text, ratio, pump in _RIPPLES
            for quantity in ("above", "below", "total")
        },
        **{
            f"acceleration head constant: {pump}": partial(_acceleration, pump)
            for pump in _ACCELERATED
        },
        "valve after Westphal: lift amplitude [m]": partial(_westphal_value, "amplitude"),
        "valve after Westphal: phase [rad]": partial(_westphal_value, "phase"),
        "valve after Westphal: lift at dead centre [m]": partial(_westphal_value, "left"),
        "valve after Westphal: closing delay [rad]": partial(_westphal_value, "delay"),
        "pipe: surge of a column stopped at once [Pa]": partial(_pipe, "surge"),
        "pipe: first frequency of a closed end, waves [Hz]": partial(_pipe, "waves"),
        "pipe: first frequency of a closed end, lumped [Hz]": partial(_pipe, "lumped"),
        "pipe: frequency with a gas vessel, waves [Hz]": partial(_pipe, "vessel"),
    }
