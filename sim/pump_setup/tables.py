"""Tables of the crank mechanism, and its initial state: bodies, chambers, lines."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.chamber_run import chamber_start, chamber_substeps
from ..hydraulics.parameters import HYDRAULIC, PRESSURE_CHAMBER
from ..mechanism.layout import (
    CRANKPIN,
    GUIDE,
    JOINT_COMPLIANT,
    JOINT_IDEAL,
    MAIN_BEARING,
    THROW,
    WRISTPIN,
    LinePair,
    Machine,
    Tables,
)
from ..piping.pipe import pipe_parameters, pipe_start
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import PIPED_RUNGS
from .contacts import bore_table, contact_table, penetration_under
from .films import bore_oil_table, deepest_start, joint_maps, oil_table
from .ideal_motion import bearing_load, ideal_motion, seal_numbers
from .joints import (
    JOINT_CODES,
    gravity_along_and_across,
    has_main_play,
    hydraulics_of,
    joint_rungs,
    piston_area,
)
from .rods import rod_table

_BAUMGARTE_PER_RADIAN = 30.0
"""Decay rate of constraint drift over the crank speed. It does not scale with the step: a rate that
grows as the step shrinks would turn the stages' own drift into a force of first order."""

_BAUMGARTE_PER_STEP = 0.1
"""Largest product of that rate and the step, far below RK4's limit of 2.8."""


def throw_record(scene: PumpScene, throw: int, step: float) -> NDArray[np.void]:
    """Kernel record of one throw.

    Returns
    -------
    numpy.ndarray [shape=(1,), dtype=THROW]
    """
    rod, piston, joint = scene.rod, scene.piston, scene.joints(throw)
    crankpin, wristpin, guide = joint_rungs(scene, throw)
    free = guide == JOINT_COMPLIANT
    liquid = hydraulics_of(scene, throw)[0]
    chambered = int(liquid["rung"]) == PRESSURE_CHAMBER
    record = np.zeros(1, dtype=THROW)
    values = {
        "phase": scene.throws[throw].phase,
        "crank_radius": scene.crank.radius,
        "rod_centre": rod.centre_of_mass,
        "rod_arm": rod.length - rod.centre_of_mass,
        "rod_mass": rod.mass,
        "inverse_rod_mass": 1 / rod.mass,
        "inverse_rod_inertia": 1 / rod.inertia,
        "piston_mass": piston.mass,
        "inverse_piston_across": 1 / piston.mass if free else 0.0,
        "inverse_piston_tilt": 1 / piston.inertia if free and piston.inertia else 0.0,
        "piston_area": piston_area(scene),
        "crankpin_rung": crankpin,
        "wristpin_rung": wristpin,
        "guide_rung": guide,
        "crankpin_radius": joint.crankpin.pin_diameter / 2,
        "wristpin_radius": joint.wristpin.pin_diameter / 2 if joint.wristpin else 0.0,
        "guide_half_length": joint.guide.length / 2 if joint.guide else 0.0,
        "guide_half_height": joint.guide.height / 2 if joint.guide else 1.0,
        "pressure_rung": liquid["rung"],
        "substeps": chamber_substeps(liquid, step) if chambered else 1,
    }
    for name, value in (values | seal_numbers(scene)).items():
        record[name] = value
    return record


def bearing_record(scene: PumpScene) -> NDArray[np.void]:
    """Kernel record of main bearings with play, empty if there are none.

    Returns
    -------
    numpy.ndarray [shape=(0 or 1,), dtype=MAIN_BEARING]
    """
    crank = scene.crank
    if crank.bearing is None or crank.mass is None or not has_main_play(scene):
        return np.zeros(0, MAIN_BEARING)
    rung, radius = JOINT_CODES[crank.bearing.rung], crank.bearing.pin_diameter / 2
    return np.array([(1 / crank.mass, crank.unbalance / crank.mass, radius, rung)], MAIN_BEARING)


def tables(scene: PumpScene, step: float) -> Tables:
    """All inputs of the mechanism's kernel from a scene, at this step [s]."""
    throws = range(len(scene.throws))
    contacts = [contact_table(scene, throw) for throw in throws]
    maps = joint_maps(scene)
    gravity_x, gravity_y = gravity_along_and_across(scene)
    motor = scene.drive.motor if scene.drive.rung == "motor" else None
    return Tables(
        throws=np.concatenate([throw_record(scene, throw, step) for throw in throws]),
        contacts=np.stack(contacts),
        liquid=np.concatenate([hydraulics_of(scene, throw) for throw in throws]).astype(HYDRAULIC),
        oils=np.stack([oil_table(scene, throw, contacts[throw], maps, step) for throw in throws]),
        maps=np.concatenate([np.zeros(1), *(m.table.coefficients.ravel() for m in maps.values())]),
        bearing=bearing_record(scene),
        bore=bore_table(scene).copy(),  # a read-only array would cause another compilation
        bore_oil=bore_oil_table(scene, maps, step),
        flex=rod_table(scene).copy(),
        machine=Machine(
            gravity_x=gravity_x,
            gravity_y=gravity_y,
            inverse_inertia=1 / motor.inertia if motor else 0.0,
            static_moment=scene.crank.unbalance,
            drive_moment=0.0,
            synchronous_speed=2 * math.pi * scene.drive.synchronous_speed if motor else 0.0,
            breakdown_moment=motor.breakdown_moment if motor else 0.0,
            breakdown_slip=motor.breakdown_slip if motor else 0.0,
            baumgarte=min(
                _BAUMGARTE_PER_RADIAN * 2 * math.pi * scene.drive.speed, _BAUMGARTE_PER_STEP / step
            ),
        ),
    )


def start_state(scene: PumpScene, angle: float, t: Tables) -> NDArray[np.float64]:
    """State of every throw with its pins at rest in their eyes under the ideal joints' forces.

    Parameters
    ----------
    scene : PumpScene
    angle : float
        Crank angle [rad].
    t : Tables
        Tables of the scene.

    Returns
    -------
    numpy.ndarray [shape=(n_throws, 12)]
        Columns as ``BODY``, then their rates. Pins and eyes move together.
    """
    journal = start_journal(scene, angle, t)[:2]
    rows = [_throw_start(scene, angle, throw, t, journal) for throw in range(len(scene.throws))]
    return np.array(rows)


def start_journal(scene: PumpScene, angle: float, t: Tables) -> NDArray[np.float64]:
    """Position of the journal at rest in its bore under the ideal joints' forces, and velocity.

    Returns
    -------
    numpy.ndarray [shape=(6,)]
        From the centre of its bore (x, y) [m], velocity [m/s], and film position [m]; 0 without
        play.
    """
    if not len(t.bearing):
        return np.zeros(6)
    on_bore = bearing_load(scene, np.array([angle]))[:, 0]
    place = _rest(t.bore[0], JOINT_COMPLIANT, on_bore)
    return np.array([*place, 0.0, 0.0, *deepest_start(place, t.bore[0])])


def _rest(contact: Any, rung: int, force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rest position of a pin from its eye's centre under a force on the rod."""
    size = float(np.hypot(*force))
    if rung == JOINT_IDEAL:
        return np.zeros(2)
    direction = force / size if size > 0 else np.array([1.0, 0.0])
    pressed = penetration_under(contact, size) if rung >= JOINT_COMPLIANT else 0.0
    return np.asarray((float(contact["clearance"]) + pressed) * direction)


def _throw_start(
    scene: PumpScene, angle: float, throw: int, t: Tables, journal: NDArray[np.float64]
) -> NDArray[np.float64]:
    ideal = ideal_motion(scene, np.array([angle]), throw)
    rungs = joint_rungs(scene, throw)
    contacts = t.contacts[throw]
    radius, length, centre = scene.crank.radius, scene.rod.length, scene.rod.centre_of_mass
    own = angle + scene.throws[throw].phase
    turn = 2 * math.pi * scene.drive.speed
    on_pin = np.array([ideal.pin_force_x[0], ideal.pin_force_y[0]])
    on_wrist = -np.array([ideal.wrist_force_x[0], ideal.wrist_force_y[0]])
    at_pin = _rest(contacts[CRANKPIN], rungs[CRANKPIN], on_pin)
    at_wrist = _rest(contacts[WRISTPIN], rungs[WRISTPIN], on_wrist)
    across = 0.0
    if rungs[GUIDE] == JOINT_COMPLIANT:  # two corners carry the guide's force
        force = float(ideal.guide_force[0])
        pressed = penetration_under(contacts[GUIDE], abs(force) / 2)
        across = -math.copysign(float(contacts[GUIDE]["clearance"]) + pressed, force)
    pin = journal + radius * np.array([math.cos(own), math.sin(own)])
    eye = pin - at_pin
    # out of reach only if the contact is far too soft: the run's status then reports it
    sin_b = min(1.0, max(-1.0, (eye[1] - across + at_wrist[1]) / length))
    beta = math.asin(sin_b)
    cos_b = math.cos(beta)
    piston = eye[0] + at_wrist[0] + length * cos_b
    beta_rate = radius * turn * math.cos(own) / (length * cos_b)
    piston_rate = -radius * turn * math.sin(own) - length * beta_rate * sin_b
    small = np.array([piston, across]) - at_wrist
    return np.array(
        [
            small[0] - centre * cos_b,
            small[1] + centre * sin_b,
            beta,
            piston,
            across,
            0.0,
            piston_rate + centre * sin_b * beta_rate,
            centre * cos_b * beta_rate,
            beta_rate,
            piston_rate,
            0.0,
            0.0,
        ]
    )


def start_chambers(t: Tables, bodies: NDArray[np.float64]) -> NDArray[np.float64]:
    """State of every chamber at the start; zeros without chambers.

    Returns
    -------
    numpy.ndarray [shape=(n_throws, 6)]
    """
    chambers = np.zeros((len(t.throws), 6))
    for throw, liquid in enumerate(t.liquid):
        if liquid["rung"] == PRESSURE_CHAMBER:
            chambers[throw] = chamber_start(liquid, bodies[throw, 3], bodies[throw, 9])
    return chambers


def lines_of(scene: PumpScene, step: float) -> LinePair | None:
    """Suction and discharge line of a scene, with the pump's mean flow in them; None without lines.

    Parameters
    ----------
    scene : PumpScene
    step : float
        Integration step [s].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> lines_of(load_scene("bilge-pump"), 2e-5) is None
    True
    """
    pressure = scene.pressures(0)
    inlet, outlet = pressure.suction_line, pressure.discharge_line
    if pressure.rung not in PIPED_RUNGS or inlet is None or outlet is None:
        return None
    suction, discharge = pressure.at_pump
    known: dict[str, Any] = {
        "liquid": pressure.liquid,
        "relief_back": suction,
        "step": step,
        "waves": pressure.rung == "wave-lines",
    }
    flow = 2 * piston_area(scene) * scene.crank.radius * scene.drive.speed * len(scene.throws)
    pipes = [
        pipe_parameters(inlet, far=suction, **known),
        pipe_parameters(outlet, far=discharge, **known),
    ]
    starts = [pipe_start(pipes[0][0], flow), pipe_start(pipes[1][0], -flow)]
    return LinePair(
        pipes=np.concatenate(pipes),
        states=np.concatenate([state for state, _ in starts]),
        suction_nodes=starts[0][1],
        discharge_nodes=starts[1][1],
    )


class Start(NamedTuple):
    """Initial state of a mechanism, as passed to :func:`run_mechanism`."""

    angle: float
    speed: float
    bodies: NDArray[np.float64]
    chambers: NDArray[np.float64]
    journal: NDArray[np.float64]


def tables_and_start(scene: PumpScene, step: float, start_angle: float) -> tuple[Tables, Start]:
    """Tables of a scene for a step [s], and the state at a crank angle [rad]."""
    t = tables(scene, step)
    bodies = start_state(scene, start_angle, t)
    speed = 2 * math.pi * scene.drive.speed
    chambers = start_chambers(t, bodies)
    return t, Start(
        angle=start_angle,
        speed=speed,
        bodies=bodies,
        chambers=chambers,
        journal=start_journal(scene, start_angle, t),
    )
