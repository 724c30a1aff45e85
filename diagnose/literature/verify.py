"""Literature checks: what the physics must give, what it gives, and whether that is close enough.

Expected values, tolerances and sources stand in ``literature/*.csv``, one line per check; the
function that obtains the value stands in a table here under the same name.
"""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.optimize import brentq

from ...sim.alignment.alignment import AlignmentLine, Seat, influence, reactions, seat_stations
from ...sim.beam.beam import Disc, Section, assemble_beam
from ...sim.beam.rotor import Rotor, RotorModes, Support, modes
from ...sim.contact.closed_forms import IdealCrank, effective_modulus, hertz_sphere_stiffness
from ...sim.contact.law import (
    CONTACT,
    ELASTIC_HERTZ,
    HYSTERESIS,
    LAW_HYSTERESIS,
    RELEASE_AT_ZERO_FORCE,
    RELEASE_AT_ZERO_PENETRATION,
    hysteresis,
    normal_force,
)
from ...sim.film.bearing import (
    coefficients,
    equilibrium,
    flow,
    friction,
    short_coefficients,
    short_eccentricity,
    sommerfeld_number,
    stability,
)
from ...sim.film.mass_conserving import mass_conserving, oil_in_gap, oil_volume
from ...sim.film.solve import (
    FilmGeometry,
    FilmSolution,
    FilmState,
    Groove,
    dufrane_scar,
    solve_direct,
    solve_long,
)
from ...sim.jit import kernel
from ...sim.piping.pipe import drive_pipe, pipe_parameters, pipe_start
from ...sim.pump.hydraulics import (
    HYDRAULIC,
    acceleration_constant,
    even_phases,
    flow_ripple,
    hydraulic_parameters,
    run_chamber,
)
from ...sim.pump.oiled_joint import OIL
from ...sim.pump.setup import ideal_motion
from ...sim.pump.slider_crank import (
    BODY,
    CRANKPIN,
    GUIDE,
    JOINT_COMPLIANT,
    THROW,
    CrankRun,
    Machine,
    Tables,
    run_mechanism,
)
from ...sim.scene.load import load_scene
from ...sim.scene.pump import PumpScene
from ...sim.scene.pump_hydraulics import CylinderPressure, Damper, Line, Liquid, Valve
from .verify_bearing import finite_bearing_checks

LITERATURE_FOLDER = Path(__file__).parent

_ANGLES = 36_001  # steps of 0.01 degree: a maximum is missed by less than 1e-7 of itself
_APPROACH_SPEED = 0.3  # m/s, an impact speed of a worn pump; the law is linear, any would do
_LONGEST_DROP = 1000.0  # contact times; the slowest rebound of the table is over after thirty


@dataclass(frozen=True, kw_only=True)
class LiteratureCheck:
    """One value of the literature and how to obtain it here.

    Attributes
    ----------
    name : str
        What is checked, with its unit.
    expected : float
        The value of the source, in SI.
    tolerance : float
        Largest difference that passes; of the expected value where `kind` is ``"relative"``.
    kind : str
        ``"absolute"`` or ``"relative"``.
    trust : str
        How far the expected value can be trusted: ``R`` read at the source, ``H`` computed by
        an independent implementation, ``M`` recalled, ``V`` verified; combined with ``+``.
    source : str
        Where it is from.
    obtain : callable
        () -> the value that this program gives.
    """

    name: str
    expected: float
    tolerance: float
    kind: str
    trust: str
    source: str
    obtain: Callable[[], float]


@dataclass(frozen=True, kw_only=True)
class Result:
    """Outcome of one check; the check's fields, the value obtained, and the verdict."""

    name: str
    expected: float
    obtained: float
    tolerance: float
    kind: str
    passed: bool
    trust: str
    source: str


def checks() -> tuple[LiteratureCheck, ...]:
    """Every literature check, in the order of the tables.

    Raises
    ------
    ValueError
        A table's lines and its functions do not name the same checks, or a tolerance is unusable.

    Examples
    --------
    >>> checks()[0].name
    'ideal crank: stroke [m]'
    """
    return tuple(check for file, table in _TABLES.items() for check in _read(file, table))


def run_checks() -> list[Result]:
    """Obtain every value and compare it with the literature.

    Returns
    -------
    list of Result
        In the order of :func:`checks`. A value that is not finite does not pass.

    Examples
    --------
    >>> all(result.passed for result in run_checks())
    True
    """
    return [_judge(check) for check in checks()]


def _judge(check: LiteratureCheck) -> Result:
    obtained = check.obtain()
    scale = abs(check.expected) if check.kind == "relative" else 1.0
    return Result(
        name=check.name,
        expected=check.expected,
        obtained=obtained,
        tolerance=check.tolerance,
        kind=check.kind,
        passed=abs(obtained - check.expected) <= check.tolerance * scale,
        trust=check.trust,
        source=check.source,
    )


def _read(file: str, table: dict[str, Callable[[], float]]) -> list[LiteratureCheck]:
    with (LITERATURE_FOLDER / file).open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    named = [row["name"] for row in rows]
    if sorted(named) != sorted(table):
        odd = ", ".join(sorted(set(named) ^ set(table))) or "one given twice"
        raise ValueError(f"{file} and its functions differ: {odd}; give each check once in both")
    return [_check(file, row, table[row["name"]]) for row in rows]


def _check(file: str, row: dict[str, str], obtain: Callable[[], float]) -> LiteratureCheck:
    tolerance = float(row["tolerance"])
    if not 0 < tolerance < math.inf:
        raise ValueError(
            f"{file}: tolerance of '{row['name']}' = {tolerance:g} must be > 0 and finite; "
            "half a unit of the last printed digit will do"
        )
    if row["kind"] not in ("absolute", "relative"):
        raise ValueError(
            f"{file}: kind of '{row['name']}' = '{row['kind']}' must be 'absolute' or 'relative'"
        )
    return LiteratureCheck(
        name=row["name"],
        expected=float(row["expected"]),
        tolerance=tolerance,
        kind=row["kind"],
        trust=row["trust"],
        source=row["source"],
        obtain=obtain,
    )


@cache
def _benchmark_crank() -> IdealCrank:
    scene = load_scene("slider-crank-benchmark")
    assert isinstance(scene, PumpScene)  # a built-in scene of that machine
    return ideal_motion(scene, np.linspace(0.0, 2 * math.pi, _ANGLES))


def _stroke() -> float:
    return float(np.ptp(_benchmark_crank().piston))


def _largest_piston_speed() -> float:
    return float(np.abs(_benchmark_crank().piston_velocity).max())


def _least_piston_acceleration() -> float:
    return float(_benchmark_crank().piston_acceleration.min())


def _largest_piston_acceleration() -> float:
    return float(_benchmark_crank().piston_acceleration.max())


def _largest_crank_pin_force() -> float:
    crank = _benchmark_crank()
    return float(np.hypot(crank.pin_force_x, crank.pin_force_y).max())


def _largest_wrist_pin_force() -> float:
    crank = _benchmark_crank()
    return float(np.hypot(crank.wrist_force_x, crank.wrist_force_y).max())


def _largest_guide_force() -> float:
    return float(np.abs(_benchmark_crank().guide_force).max())


def _largest_crank_moment() -> float:
    return float(np.abs(_benchmark_crank().crank_moment).max())


def _one_throw(numbers: dict[str, float], contacts: dict[int, np.void], **machine: float) -> Tables:
    """Tables of one throw without pressure; what is not given is zero."""
    throws, table = np.zeros(1, THROW), np.zeros((1, 3), CONTACT)
    table["friction_speed"] = table["speed_floor"] = 1.0  # an unused record divides by neither
    for name, value in numbers.items():
        throws[name] = value
    for joint, contact in contacts.items():
        table[0, joint] = contact
    shared = Machine(**{**dict.fromkeys(Machine._fields, 0.0), **machine})
    return Tables(
        throws=throws,
        contacts=table,
        liquid=np.zeros(1, HYDRAULIC),
        oils=np.zeros((1, 2), OIL),
        maps=np.zeros(1),
        machine=shared,
    )


def impact(
    contact: np.void, *, speed: float = _APPROACH_SPEED, step: float, duration: float
) -> float:
    """Coefficient of restitution that the mechanism itself gives for one straight impact.

    The rod lies along the stroke with the crank at rest, without gravity, pressure or friction,
    so that rod and piston are one mass of 9 kg which runs against the pin.

    Parameters
    ----------
    contact : record of sim.contact.CONTACT
        Of the crank pin, with a clearance above zero [m].
    speed : float
        Of approach [m/s], > 0.
    step : float
        Integration step [s].
    duration : float
        From a hundredth of the clearance before first touch [s].

    Returns
    -------
    float
        Speed of separation over speed of approach, at the first rebound; NaN where it does not
        come within the duration.

    Examples
    --------
    >>> contact = np.zeros(1, CONTACT)[0]
    >>> contact["law"], contact["stiffness"], contact["hysteresis"] = LAW_HYSTERESIS, 2e8, 0.75
    >>> contact["clearance"], contact["friction_speed"] = 4e-5, 1.0
    >>> round(impact(contact, step=1e-6, duration=2e-3), 5)
    0.66296
    """
    clearance = float(contact["clearance"])
    t = _one_throw(_STRAIGHT, {CRANKPIN: contact})
    reach = _STRAIGHT["crank_radius"] + _STRAIGHT["rod_centre"] + _STRAIGHT["rod_arm"]
    bodies = np.zeros((1, 2 * len(BODY)))
    bodies[0, 3] = reach - 0.99 * clearance
    bodies[0, 0] = bodies[0, 3] - _STRAIGHT["rod_centre"]
    bodies[0, 6] = bodies[0, 9] = -speed
    n_steps = math.ceil(duration / step)
    run = run_mechanism(t, angle=0.0, speed=0.0, bodies=bodies, step=step, n_steps=n_steps)
    return _first_free_speed(run, reach - clearance) / speed


_STRAIGHT = {
    "crank_radius": 0.05,
    "rod_centre": 0.165,
    "rod_arm": 0.085,
    "rod_mass": 3.0,
    "inverse_rod_mass": 1 / 3.0,
    "inverse_rod_inertia": 1 / 0.025,
    "piston_mass": 6.0,
    "crankpin_rung": JOINT_COMPLIANT,
    "crankpin_radius": 0.03,
    "guide_half_height": 1.0,
}
"""A pump of 300 rpm in size; a law's restitution does not depend on it."""


def rebound(damping_ratio: float, release: int, *, step_per_contact_time: float = 0.03) -> float:
    """Coefficient of restitution of a spring and dashpot, by :func:`impact`.

    Parameters
    ----------
    damping_ratio : float
        Of rod and piston on the contact spring, 0 <= zeta < 1.
    release : int
        ``RELEASE_AT_ZERO_FORCE`` or ``RELEASE_AT_ZERO_PENETRATION``.
    step_per_contact_time : float
        Integration step times the angular frequency of that mass on the spring.

    Returns
    -------
    float
        Speed of separation over speed of approach, at the first rebound.

    Raises
    ------
    ValueError
        The damping ratio is outside [0, 1), where a rebound need not come.

    Examples
    --------
    >>> round(rebound(0.2, RELEASE_AT_ZERO_FORCE), 5)
    0.57174
    """
    if not 0 <= damping_ratio < 1:
        raise ValueError(f"damping_ratio = {damping_ratio} must be in [0, 1); lower the damping")
    stiffness, mass = 2e8, _STRAIGHT["rod_mass"] + _STRAIGHT["piston_mass"]
    contact = np.zeros(1, CONTACT)[0]
    contact["stiffness"], contact["release"] = stiffness, release
    contact["damping"] = 2 * damping_ratio * math.sqrt(stiffness * mass)
    contact["clearance"], contact["friction_speed"] = 4e-5, 1.0
    step = step_per_contact_time / math.sqrt(stiffness / mass)
    # approach over a hundredth of the clearance, then at most half a contact period
    duration = 0.01 * 4e-5 / _APPROACH_SPEED + 2 * math.pi * step / step_per_contact_time
    return impact(contact, step=step, duration=duration)


def _first_free_speed(run: CrankRun, touch: float) -> float:
    """Piston velocity once it moves away and has cleared the side it ran against [m/s]."""
    assert run.bodies is not None  # kept by default
    piston, velocity = run.bodies[:, 0, 3], run.bodies[:, 0, 9]
    free = np.flatnonzero((velocity > 0) & (piston > touch))
    return float(velocity[free[0]]) if free.size else math.nan


@cache
def _loose_slider() -> CrankRun:
    """Slider-crank whose slider has clearance in its guide, for the 2 ms before it touches."""
    half_rod = 0.153
    numbers = {
        "crank_radius": 0.153,
        "rod_centre": half_rod,
        "rod_arm": half_rod,
        "rod_mass": 0.038,
        "inverse_rod_mass": 1 / 0.038,
        "inverse_rod_inertia": 1 / 5.9e-4,
        "piston_mass": 0.076,
        "inverse_piston_across": 1 / 0.076,
        "inverse_piston_tilt": 1 / 2.7e-6,
        "guide_rung": JOINT_COMPLIANT,
        "guide_half_length": 0.05,
        "guide_half_height": 0.025,
    }
    guide = np.zeros(1, CONTACT)[0]
    guide["stiffness"], guide["clearance"], guide["friction_speed"] = 1e6, 1e-3, 1.0
    crank_mass, crank_centre, step = 0.038, 0.0765, 1e-5
    t = _one_throw(
        numbers,
        {GUIDE: guide},
        gravity_y=9.81,
        inverse_inertia=1 / (7.4e-5 + crank_mass * crank_centre**2),
        static_moment=crank_mass * crank_centre,
        baumgarte=1000.0,  # 1/s, of drift: slow to the steps, fast to the run
    )
    crank_speed, rod_rate = 150.0, 75.0  # the published rod angle is minus ours
    bodies = np.zeros((1, 2 * len(BODY)))
    bodies[0, 0], bodies[0, 3] = 0.153 + half_rod, 0.153 + 2 * half_rod
    bodies[0, 7], bodies[0, 8] = 0.153 * crank_speed - half_rod * rod_rate, rod_rate
    return run_mechanism(t, angle=0.0, speed=crank_speed, bodies=bodies, step=step, n_steps=200)


def _loose_slider_value(step: int, quantity: str) -> float:
    run = _loose_slider()
    assert run.bodies is not None  # kept by default
    values = {
        "revolutions": run.turns[step, 0] / (2 * math.pi),
        "rod angle": -run.bodies[step, 0, 2],
        "crank speed": run.turns[step, 1],
        "rod rate": -run.bodies[step, 0, 8],
    }
    return float(values[quantity])


@kernel
def _slowing(penetration: float, velocity: float, speed: float, contact: Any) -> float:
    return -normal_force(penetration, velocity, speed, contact)


@kernel
def _drop(speed: float, h: float, n_steps: int, contact: Any) -> float:
    """Velocity at which a unit mass leaves, by Runge-Kutta 4; NaN where it does not.

    Order 4 with a linear elasticity, 2.5 with those that start as d^(3/2).
    """
    d, v = 0.0, speed
    for _ in range(n_steps):
        k1 = _slowing(d, v, speed, contact)
        v2 = v + 0.5 * h * k1
        k2 = _slowing(d + 0.5 * h * v, v2, speed, contact)
        v3 = v + 0.5 * h * k2
        k3 = _slowing(d + 0.5 * h * v2, v3, speed, contact)
        v4 = v + h * k3
        k4 = _slowing(d + h * v3, v4, speed, contact)
        after = d + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        if after <= 0.0:
            return v - 0.5 * d * k1 / v  # the force falls to zero over the rest
        d = after
        v += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return math.nan


def drop(contact: np.void, *, speed: float = 1.0, step: float = 1e-3) -> float:
    """Coefficient of restitution of a mass of 1 kg thrown on a hysteresis contact, integrated.

    Parameters
    ----------
    contact : record of sim.contact.CONTACT
        With a hysteresis law.
    speed : float
        Of approach [m/s], > 0.
    step : float
        Integration step [s]. With a stiffness and a speed of one the contact lasts from two to
        thirty seconds and the default is within 1e-8, whatever the elasticity.

    Returns
    -------
    float
        Speed of separation over speed of approach; NaN where the mass does not come back.

    Examples
    --------
    >>> contact = np.zeros(1, CONTACT)[0]
    >>> contact["law"], contact["stiffness"], contact["hysteresis"] = LAW_HYSTERESIS, 1.0, 0.75
    >>> round(drop(contact), 5)
    0.66296
    """
    leaving: float = _drop(speed, step, math.ceil(_LONGEST_DROP / step), contact)
    return -leaving / speed


def _hertz_drop(law: str, restitution: float) -> float:
    contact = np.zeros(1, CONTACT)[0]
    contact["law"], contact["elasticity"], contact["stiffness"] = LAW_HYSTERESIS, ELASTIC_HERTZ, 1.0
    contact["hysteresis"] = hysteresis(law, restitution)
    return drop(contact)


def _benchmark_hertz(clearance: float) -> float:
    steel = effective_modulus(207e9, 0.3, 207e9, 0.3)
    return hertz_sphere_stiffness(steel, 10e-3 - clearance, 10e-3)


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


# --- journal bearing


def _friswell_value(quantity: str) -> float:
    """Example 5.5.1: D 100 mm, L 30 mm, C 0.1 mm, 0.1 Pa s, 525 N, 1500 rpm."""
    load, clearance, speed = 525.0, 1e-4, 2 * math.pi * 25
    unit = 0.1 * speed * 0.05**3 * 0.03 / clearance**2
    e = short_eccentricity(load / unit / 0.3**2)
    c = short_coefficients(e)
    stiffness, damping = c.stiffness * load / clearance, c.damping * load / (clearance * speed)
    values = {
        "eccentricity ratio": e,
        "stiffness along the load [N/m]": stiffness[0, 0],
        "stiffness along by across [N/m]": stiffness[0, 1],
        "stiffness across by along [N/m]": stiffness[1, 0],
        "stiffness across the load [N/m]": stiffness[1, 1],
        "damping along the load [N s/m]": damping[0, 0],
        "damping coupled [N s/m]": damping[0, 1],
        "damping across the load [N s/m]": damping[1, 1],
    }
    return float(values[quantity])


_FRISWELL = (
    "eccentricity ratio",
    "stiffness along the load [N/m]",
    "stiffness along by across [N/m]",
    "stiffness across by along [N/m]",
    "stiffness across the load [N/m]",
    "damping along the load [N s/m]",
    "damping coupled [N s/m]",
    "damping across the load [N s/m]",
)


def _short_threshold(eccentricity: float, quantity: str) -> float:
    threshold = stability(short_coefficients(eccentricity))
    return threshold.whirl_ratio if quantity == "whirl ratio" else threshold.speed


@cache
def _grooved_bearing(length_to_diameter: float, s: float, width: float) -> dict[str, float]:
    """Two axial grooves across the load.

    Error of the mesh: 0.2 % of the largest coefficient of its kind. Small ones beside it are less
    sure of themselves: Cyy at S 0.042, an eleventh of Cxx, is 0.6 % low.
    """
    grooves = tuple(Groove(angle=angle, width=width) for angle in (math.pi / 2, -math.pi / 2))
    geometry = FilmGeometry(
        length_to_diameter=length_to_diameter, n_theta=144, n_z=25, grooves=grooves
    )
    found = equilibrium(geometry, [sommerfeld_number(s), 0.0])
    c = coefficients(found).per_load(found.load[0])
    return {
        "eccentricity ratio": found.eccentricity_ratio,
        "attitude angle [deg]": math.degrees(found.attitude_angle),
        **dict(zip(("Kxx", "Kxy", "Kyx", "Kyy"), c.stiffness.ravel().tolist(), strict=True)),
        **dict(zip(("Cxx", "Cxy", "Cyx", "Cyy"), c.damping.ravel().tolist(), strict=True)),
    }


def _grooved_value(length_to_diameter: float, s: float, degrees: float, quantity: str) -> float:
    return _grooved_bearing(length_to_diameter, s, math.radians(degrees))[quantity]


@cache
def _plain_bearing(length_to_diameter: float, s: float) -> dict[str, float]:
    geometry = FilmGeometry(
        length_to_diameter=length_to_diameter, n_theta=144, n_z=25, condition="reynolds"
    )
    found = equilibrium(geometry, [sommerfeld_number(s), 0.0])
    oil = flow(found)
    return {
        "attitude angle [deg]": math.degrees(found.attitude_angle),
        "friction variable": friction(found) / float(found.load[0]),
        "flow variable": oil.through,
        "side flow over flow": oil.side / oil.through,
    }


def _plain_value(length_to_diameter: float, s: float, quantity: str) -> float:
    return _plain_bearing(length_to_diameter, s)[quantity]


_LUND_THOMSEN = ((0.5, 6.43), (0.5, 1.656), (0.5, 0.378), (0.5, 0.042), (1.0, 0.635))
_RAIMONDI_BOYD = (
    (1.0, 0.631),
    (1.0, 0.121),
    (1.0, 0.0188),
    (0.5, 2.03),
    (0.5, 0.319),
    (0.5, 0.0313),
)
_SOMEYA = ((0.5, 1.24), (0.5, 0.517))


@cache
def _cavitated() -> dict[str, float]:
    """The stored mass-conserving field, in SI; 25 nodes over the length, so the groove ends on one.

    The force is that on the shell.
    """
    radius, length, clearance = 0.05, 0.08, 150e-6
    scale = 0.01 * 2 * math.pi * 50 * (radius / clearance) ** 2
    groove = Groove(
        angle=math.pi / 2, width=math.radians(15), length_share=0.75, pressure=70e3 / scale
    )
    geometry = FilmGeometry(length_to_diameter=0.8, n_theta=100, n_z=25, grooves=(groove,))
    state = FilmState(x=0.5, y=0.0)
    film = mass_conserving(geometry, state)
    fill = np.zeros_like(film.pressure) if film.fill is None else film.fill
    right, up = -film.force * (scale * radius * length)
    volume = radius * length * clearance * oil_volume(oil_in_gap(geometry, state, fill))
    values = {
        "highest pressure [Pa]": scale * film.pressure.max(),
        "force on the shell [N]": math.hypot(right, up),
        "horizontal force on the shell [N]": right,
        "vertical force on the shell [N]": up,
        "oil volume [m^3]": volume,
    }
    for angle in _CAVITATED_AT:
        node = round(angle / 3.6)
        values[f"mid pressure at {angle} degrees [Pa]"] = scale * film.pressure[node, 12]
        values[f"mid film fraction at {angle} degrees"] = fill[node, 12]
    return values


def _cavitated_value(name: str) -> float:
    return float(_cavitated()[name])


_CAVITATED_AT = (0, 18, 36, 90, 108, 126, 162, 180, 198, 216, 270, 288, 324, 342)
"""Angles of the stored field from the journal's eccentricity [degrees], nodes of its mesh."""

_FILLED_AT = (36, 126, 162, 180)
"""Those in the ruptured film."""

# --- oil film

_FILM_LINES, _FILM_NODES = 144, 33  # mesh error of the force below 0.3 %
_LONG_LINES = 360
_FINITE = {
    "Sommerfeld number": "number",
    "attitude [deg]": "attitude",
    "friction variable": "friction",
    "flow variable": "flow",
    "mean over peak pressure": "share",
}
_CARRIED = {
    "Sommerfeld number": "number",
    "attitude [deg]": "attitude",
    "peak pressure": "peak",
    "moment over load": "moment",
}
_ECCENTRICITIES = (0.1, 0.2, 0.4, 0.6, 0.8, 0.9)
_SCARS = ((1.0, 0.5, 0.4), (1.0, 0.7, 0.3), (0.5, 0.5, 0.4))  # L/D, eccentricity, deepest
_TILTS = (0.0, 0.2, 0.4)  # of the gap at an end, over C


def _film_geometry(
    length_to_diameter: float,
    *,
    condition: str = "periodic",
    bore: NDArray[np.float64] | None = None,
) -> FilmGeometry:
    return FilmGeometry(
        length_to_diameter=length_to_diameter,
        n_theta=_FILM_LINES,
        n_z=_FILM_NODES,
        condition=condition,
        bore=bore,
    )


def _carried(film: FilmSolution, direction: float) -> dict[str, float]:
    """What a film carries; its journal centre lies in the given direction [rad]."""
    force = math.hypot(*film.force)
    attitude = direction - math.atan2(-film.force[1], -film.force[0])
    peak = float(film.pressure.max())
    return {
        "number": sommerfeld_number(force),
        "attitude": math.degrees(math.remainder(attitude, 2 * math.pi)),
        "peak": peak,
        "share": 0.5 * force / peak,  # the load is on L D, the force on L R
        "moment": 2 * math.hypot(*film.moment) / force,  # of the half length
    }


@cache
def _finite_bearing(length_to_diameter: float, eccentricity: float) -> dict[str, float]:
    geometry = _film_geometry(length_to_diameter, condition="reynolds")
    film = solve_direct(geometry, FilmState(x=eccentricity, y=0.0))
    found = equilibrium(geometry, -film.force, start=(eccentricity, 0.0))
    rubbed = friction(found) / math.hypot(*film.force)
    return {**_carried(film, 0.0), "friction": rubbed, "flow": flow(found).through}


@cache
def _infinite_bearing(eccentricity: float) -> dict[str, float]:
    """Friction and flow by hand: the bearing's own functions are of a film on a mesh."""
    geometry = FilmGeometry(length_to_diameter=1.0, n_theta=_LONG_LINES, condition="reynolds")
    film = solve_long(geometry, FilmState(x=eccentricity, y=0.0))
    step = 2 * math.pi / _LONG_LINES
    pressure, angle = film.pressure[:, 0], step * np.arange(_LONG_LINES)
    shear = 2 * math.pi / math.sqrt(1 - eccentricity**2)
    shear -= 0.5 * step * float(np.sum(pressure * eccentricity * np.sin(angle)))
    widest = _LONG_LINES // 2
    gap = 1 - eccentricity * math.cos(angle[widest] + 0.5 * step)
    rise = float(pressure[widest + 1] - pressure[widest]) / step
    return {
        **_carried(film, 0.0),
        "friction": shear / math.hypot(*film.force),
        "flow": 2 * math.pi * (gap / 2 - gap**3 * rise / 12),
    }


@cache
def _worn_bearing(length_to_diameter: float, eccentricity: float, depth: float) -> dict[str, float]:
    """With the scar where the load points to: turned until it is so."""
    geometry = _film_geometry(length_to_diameter, bore=dufrane_scar(depth, 0.0, _FILM_LINES))

    def at(direction: float) -> dict[str, float]:
        x, y = eccentricity * math.cos(direction), eccentricity * math.sin(direction)
        return _carried(solve_direct(geometry, FilmState(x=x, y=y)), direction)

    def beside(direction: float) -> float:
        return math.radians(at(direction)["attitude"]) - direction

    return at(float(brentq(beside, 0.1, 1.5, xtol=1e-5)))


@cache
def _tilted_journal(tilt: float) -> dict[str, float]:
    """Ends at 1 + (0.5 +- tilt) cos(theta): twice that tilt over the length."""
    geometry = _film_geometry(1.0)
    film = solve_direct(geometry, FilmState(x=-0.5, y=0.0, tilt_x=-2 * tilt))
    return _carried(film, math.pi)


def _film_value(case: Callable[..., dict[str, float]], quantity: str, *args: float) -> float:
    return case(*args)[quantity]


def _film_checks() -> dict[str, Callable[[], float]]:
    table: dict[str, Callable[[], float]] = {}
    for quantity, key in _FINITE.items():
        for e in _ECCENTRICITIES:
            for ratio in (1.0, 0.5):
                name = f"Raimondi-Boyd: L/D {ratio:g}, eccentricity {e:g}, {quantity}"
                table[name] = partial(_film_value, _finite_bearing, key, ratio, e)
            name = f"infinite bearing: eccentricity {e:g}, {quantity}"
            table[name] = partial(_film_value, _infinite_bearing, key, e)
    for quantity, key in _CARRIED.items():
        for tilt in _TILTS:
            if tilt > 0 or key != "moment":
                name = f"tilted journal: L/D 1, eccentricity 0.5, tilt {tilt:g}, {quantity}"
                table[name] = partial(_film_value, _tilted_journal, key, tilt)
        for ratio, e, deepest in _SCARS if key != "moment" else ():
            for depth in (step / 10 for step in range(round(10 * deepest) + 1)):
                where = f"L/D {ratio:g}, eccentricity {e:g}, wear {depth:g}"
                name = f"worn bearing: {where}, {quantity}"
                table[name] = partial(_film_value, _worn_bearing, key, ratio, e, depth)
    return table


@dataclass(frozen=True, kw_only=True)
class _PublishedRotor:
    """Steel shaft of 1.5 m, 50 mm thick, with discs of (station, outer diameter), 70 mm thick."""

    stiffness: tuple[tuple[float, float], tuple[float, float]]  # y, z [N/m]
    damping: float = 0.0  # along y and z [N s/m]
    discs: tuple[tuple[float, float], ...] = ((0.5, 0.28), (1.0, 0.35))  # [m]
    stations: tuple[float, float] = (0.0, 1.5)  # of the supports [m]
    unit: str = "rad/s"  # of its printed frequencies
    rows: tuple[tuple[int, str, tuple[int, ...]], ...]  # speed [rpm], quantity, modes


_ROTORS = {
    "5.9.1": _PublishedRotor(
        stiffness=((1e6, 0.0), (0.0, 1e6)),
        rows=((0, "frequency", (1, 3, 5)), (4000, "frequency", (1, 2, 3, 4, 5))),
    ),
    "5.9.2": _PublishedRotor(
        stiffness=((0.8e6, 0.0), (0.0, 1e6)), rows=((0, "frequency", (1, 2, 3, 4, 5)),)
    ),
    "5.9.3": _PublishedRotor(
        stiffness=((0.2e6, 0.0), (0.0, 1e6)),
        unit="Hz",
        rows=((4000, "frequency", (1, 2, 3, 4, 5, 6)),),
    ),
    "5.9.4": _PublishedRotor(
        stiffness=((1e6, 0.5e6), (0.5e6, 1e6)),
        unit="Hz",
        rows=((0, "frequency", (1, 2, 3, 4, 5, 6)),),
    ),
    "5.9.5": _PublishedRotor(
        stiffness=((1e6, 0.0), (0.0, 1e6)),
        damping=3e3,
        unit="Hz",
        rows=(
            (0, "undamped frequency", (1, 3, 5)),
            (0, "frequency", (1, 3)),
            (4000, "undamped frequency", (1, 2, 3, 4, 5)),
        ),
    ),
    "5.9.9": _PublishedRotor(
        stiffness=((1e7, 0.0), (0.0, 1e7)),
        discs=((1.5, 0.35),),
        stations=(0.0, 1.0),
        rows=((0, "frequency", (1, 3, 5)), (4000, "frequency", (1, 2, 3, 4, 5, 6))),
    ),
}
"""Examples of Friswell et al. 2010, six elements each."""

_BEAM_ROOTS = {"pinned-pinned": 3, "clamped-free": 4, "clamped-clamped": 3, "clamped-pinned": 3}
"""Ends -> modes compared."""

_BEAM_ELEMENTS = 120  # (11 / 120)^4 / 2880 = 3e-8 of the last root


def _published_disc(station: float, outer: float) -> Disc:
    width, inner, density = 0.07, 0.05, 7810.0
    mass = density * math.pi / 4 * (outer**2 - inner**2) * width
    square = outer**2 + inner**2
    return Disc(
        station=station,
        mass=mass,
        polar_inertia=mass / 8 * square,
        diametral_inertia=mass / 48 * (3 * square + 4 * width**2),
    )


@cache
def _published_modes(name: str, speed_rpm: int) -> RotorModes:
    rotor = _ROTORS[name]
    shaft = Section(
        length=1.5, outer_diameter=0.05, young=211e9, shear_modulus=81.2e9, density=7810.0
    )
    beam = assemble_beam(
        [shaft],
        discs=[_published_disc(*disc) for disc in rotor.discs],
        longest_element=0.25,
        shear_coefficient="cowper",
    )
    supports = tuple(
        Support(
            name=f"{station:g} m",
            station=station,
            stiffness=rotor.stiffness,
            damping=rotor.damping * np.eye(2),
        )
        for station in rotor.stations
    )
    return modes(Rotor(beam=beam, supports=supports), speed_rpm * math.pi / 30)


def _published_frequency(name: str, speed_rpm: int, quantity: str, mode: int) -> float:
    found = _published_modes(name, speed_rpm)
    undamped = quantity == "undamped frequency"
    hertz = (found.undamped_frequency_hz if undamped else found.frequency_hz)[mode - 1]
    return float(hertz if _ROTORS[name].unit == "Hz" else 2 * math.pi * hertz)


@cache
def _beam_roots(ends: str) -> NDArray[np.float64]:
    """Roots beta L of a thin bar of 1 m [shape=(4,)]."""
    bar = Section(length=1.0, outer_diameter=0.01, young=2e11, shear_modulus=8e10, density=8e3)
    beam = assemble_beam([bar], longest_element=1 / _BEAM_ELEMENTS, theory="euler-bernoulli")
    first, last = ends.split("-")
    held = {"pinned": ["y"], "clamped": ["y", "slope_y"], "free": []}
    fixed = [beam.dof(0.0, c) for c in held[first]] + [beam.dof(1.0, c) for c in held[last]]
    plane = np.flatnonzero(np.arange(beam.n_dof) % 4 < 2)
    free = np.setdiff1d(plane, fixed)
    stiffness, mass = (m.toarray()[np.ix_(free, free)] for m in (beam.stiffness, beam.mass))
    highest = (free.size - 4, free.size - 1)
    inverse = linalg.eigh(mass, stiffness, eigvals_only=True, subset_by_index=highest)[::-1]
    roots: NDArray[np.float64] = (bar.density * bar.area / bar.bending_stiffness / inverse) ** 0.25
    return roots


def _beam_root(ends: str, mode: int) -> float:
    return float(_beam_roots(ends)[mode - 1])


@cache
def _equal_spans(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reactions over a span's load and influence over E I / L^3, ten elements in a span."""
    bar = Section(length=n - 1.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=8e3)
    seats = tuple(Seat(name=f"{i}", station=float(i)) for i in range(n))
    beam = assemble_beam(
        [bar], stations=seat_stations(seats), longest_element=0.1, theory="euler-bernoulli"
    )
    line = AlignmentLine(beam=beam, seats=seats)
    span = beam.weight / (n - 1)
    return reactions(line).reactions / span, influence(line) / bar.bending_stiffness


def _equal_reaction(n: int, i: int) -> float:
    return float(_equal_spans(n)[0][i - 1])


def _equal_influence(n: int, i: int, j: int) -> float:
    return float(_equal_spans(n)[1][i - 1, j - 1])


def _alignment_checks() -> dict[str, Callable[[], float]]:
    table: dict[str, Callable[[], float]] = {}
    for n, half in ((3, 2), (4, 2), (5, 3), (6, 3)):  # the other half is the mirror
        for i in range(1, half + 1):
            name = f"equal spans: {n} supports, "
            table[f"{name}reaction {i} over the load of a span"] = partial(_equal_reaction, n, i)
            for j in range(1, n + 1):
                row = f"{name}influence of {j} on {i} times L^3/EI"
                table[row] = partial(_equal_influence, n, i, j)
    return table


def _shaft_checks() -> dict[str, Callable[[], float]]:
    table: dict[str, Callable[[], float]] = {
        f"beam {ends}: root {mode}": partial(_beam_root, ends, mode)
        for ends, count in _BEAM_ROOTS.items()
        for mode in range(1, count + 1)
    }
    for name, rotor in _ROTORS.items():
        for speed_rpm, quantity, numbers in rotor.rows:
            for mode in numbers:
                row = f"rotor after Friswell, {name}, {speed_rpm} rpm: {quantity} {mode}"
                table[f"{row} [{rotor.unit}]"] = partial(
                    _published_frequency, name, speed_rpm, quantity, mode
                )
    return table


_TABLES: dict[str, dict[str, Callable[[], float]]] = {
    "slider_crank.csv": {
        "ideal crank: stroke [m]": _stroke,
        "ideal crank: largest piston speed [m/s]": _largest_piston_speed,
        "ideal crank: least piston acceleration [m/s^2]": _least_piston_acceleration,
        "ideal crank: largest piston acceleration [m/s^2]": _largest_piston_acceleration,
        "ideal crank: largest crank-pin force [N]": _largest_crank_pin_force,
        "ideal crank: largest wrist-pin force [N]": _largest_wrist_pin_force,
        "ideal crank: largest guide force [N]": _largest_guide_force,
        "ideal crank: largest crank moment [N m]": _largest_crank_moment,
        **{
            f"loose slider: {quantity} after {after} ms [{unit}]": partial(
                _loose_slider_value, 100 * after, quantity
            )
            for after in (1, 2)
            for quantity, unit in (
                ("revolutions", "-"),
                ("rod angle", "rad"),
                ("crank speed", "rad/s"),
                ("rod rate", "rad/s"),
            )
        },
    },
    "restitution.csv": {
        f"restitution: damping ratio {ratio:g}, release at zero {name}": partial(
            rebound, ratio, code
        )
        for ratio in (0.05, 0.2, 0.5)
        for name, code in (
            ("force", RELEASE_AT_ZERO_FORCE),
            ("penetration", RELEASE_AT_ZERO_PENETRATION),
        )
    },
    "contact.csv": {
        **{
            f"impact by {law}, asked for {restitution:g}": partial(_hertz_drop, law, restitution)
            for law in HYSTERESIS
            for restitution in (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95)
            if law != "carvalho-martins" or restitution >= 1 / 3  # its validity
        },
        **{
            f"Hertz contact: stiffness at {clearance * 1e3:g} mm clearance [N/m^1.5]": partial(
                _benchmark_hertz, clearance
            )
            for clearance in (0.5e-3, 0.25e-3, 0.1e-3)
        },
    },
    "pump.csv": {
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
    },
    "cavitation.csv": {
        f"mass-conserving film: {name}": partial(_cavitated_value, name)
        for name in (
            "highest pressure [Pa]",
            "force on the shell [N]",
            "horizontal force on the shell [N]",
            "vertical force on the shell [N]",
            "oil volume [m^3]",
            *(f"mid pressure at {a} degrees [Pa]" for a in _CAVITATED_AT if a not in _FILLED_AT),
            *(f"mid film fraction at {a} degrees" for a in _FILLED_AT),
        )
    },
    "bearing.csv": {
        **{
            f"short bearing after Friswell: {quantity}": partial(_friswell_value, quantity)
            for quantity in _FRISWELL
        },
        **{
            f"short bearing, eccentricity {e:g}: {quantity}": partial(_short_threshold, e, quantity)
            for e in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75)
            for quantity in ("whirl ratio", "threshold speed")
        },
        **{
            f"Lund-Thomsen, L/D {ratio:g}, S {s:g}: {quantity}": partial(
                _grooved_value, ratio, s, 20.0, quantity
            )
            for ratio, s in _LUND_THOMSEN
            for quantity in (
                "eccentricity ratio",
                "attitude angle [deg]",
                *("Kxx", "Kxy", "Kyx", "Kyy", "Cxx", "Cxy", "Cyy"),
            )
        },
        **{
            f"Raimondi-Boyd, L/D {ratio:g}, S {s:g}: {quantity}": partial(
                _plain_value, ratio, s, quantity
            )
            for ratio, s in _RAIMONDI_BOYD
            for quantity in (
                "attitude angle [deg]",
                "friction variable",
                "flow variable",
                "side flow over flow",
            )
        },
        **{
            f"Someya, L/D {ratio:g}, S {s:g}: {quantity}": partial(
                _grooved_value, ratio, s, 10.0, quantity
            )
            for ratio, s in _SOMEYA
            for quantity in ("attitude angle [deg]", "Cxx", "Cxy", "Cyy")
        },
    },
    "film.csv": _film_checks(),
    "finite_bearing.csv": finite_bearing_checks(),
    "shaft_line.csv": _shaft_checks(),
    "alignment.csv": _alignment_checks(),
}
"""File of the literature -> name of each of its checks -> what obtains it."""
