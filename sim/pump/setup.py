"""From a pump scene to the crank mechanism: tables, start, contact rates, and the closed form."""

import math
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..casing.modes import casing_inputs, exact_oscillator
from ..contact.asperities import asperity_scale
from ..contact.closed_forms import IdealCrank, conformal_stiffness, ideal_crank
from ..contact.law import (
    CONTACT,
    ELASTIC_CONFORMAL,
    ELASTIC_HERTZ,
    ELASTIC_LINEAR,
    FRICTION_RAMP,
    FRICTION_SMOOTH,
    LAW_CONSTANT_LOSS,
    LAW_HYSTERESIS,
    LAW_KELVIN_VOIGT,
    RELEASE_AT_ZERO_FORCE,
    RELEASE_AT_ZERO_PENETRATION,
    elastic_force,
    elastic_stiffness,
    hysteresis,
)
from ..film.heat import film_temperature, friction_power
from ..film.impedance_map import ImpedanceMap, impedance_map
from ..film.solve import FilmGeometry
from ..hydraulics.chamber_run import chamber_start, chamber_substeps
from ..hydraulics.parameters import HYDRAULIC, PRESSURE_CHAMBER, hydraulic_parameters
from ..hydraulics.piston_pressure import line_pressure
from ..jit import kernel
from ..mechanism.crank_run import CrankRun, run_mechanism
from ..mechanism.layout import (
    AT_REST,
    CRANKPIN,
    FILM,
    FORCES,
    GUIDE,
    JOINT_COMPLIANT,
    JOINT_IDEAL,
    JOINT_LINK,
    JOINT_OILED,
    PUSHES,
    THROW,
    WRISTPIN,
    LinePair,
    Machine,
    Tables,
    Yielding,
)
from ..mechanism.oiled_joint import OIL
from ..mechanism.throw_motion import seal_drag
from ..piping.pipe import pipe_parameters, pipe_start
from ..scene.pump import (
    GUIDE_PLACES,
    OILED_RUNGS,
    VALVE_PLACES,
    Guide,
    PumpScene,
    RevoluteJoint,
)
from ..scene.pump_hydraulics import BREATHING_RUNGS, PIPED_RUNGS, CylinderPressure

STEP_PER_CONTACT_TIME = 0.3
"""Default step times the contact's fastest angular frequency: 21 steps a contact period."""

STEP_PER_STARVED_CONTACT_TIME = 0.15
"""The same where a pin flies into a thin film, which no event locates."""

STEP_PER_CONTACT_DECAY = 0.7
"""Default step times the contact's fastest decay, where damping is beyond critical."""

LARGEST_STEP_PER_CONTACT_TIME = 1.0
"""A step longer than this over the contact's rate is refused: Runge-Kutta 4 stays stable to 2.8
but is no longer accurate."""

_BAUMGARTE_PER_RADIAN = 30.0
"""Decay rate of constraint drift over the crank speed. Not over the step: a rate that grew as the
step shrinks would feed the stages' own drift back as a force that never shrinks, order 1."""

_BAUMGARTE_PER_STEP = 0.1
"""Most of that rate times the step, far from RK4's limit of 2.8."""

JOINT_CODES = {
    "ideal": JOINT_IDEAL,
    "link": JOINT_LINK,
    "compliant": JOINT_COMPLIANT,
    **dict.fromkeys(OILED_RUNGS, JOINT_OILED),
}
"""Rung of a joint in the scene -> code of the kernels, from the cheapest to the best."""

_ANGLES = 360  # of a revolution, for the forces an ideal mechanism would carry

Result = TypeVar("Result")


def _kept(function: Callable[..., Result]) -> Callable[..., Result]:
    """Keep the last results of a function of a scene, and of a throw where it has one.

    Scenes are frozen, and several checks of one run ask for the same of them; what is kept cannot
    be written to. A scene is known by its identity: a hash of all its values takes as long as
    most of these functions.
    """
    found: OrderedDict[tuple[int, ...], tuple[PumpScene, Result]] = OrderedDict()

    @wraps(function)
    def kept(scene: PumpScene, *throw: int) -> Result:
        key = (id(scene), *throw)
        _, result = found.get(key) or (scene, function(scene, *throw))
        found[key] = scene, result  # no other scene takes the identity of one that is held
        while len(found) > _MOST_KEPT:
            found.popitem(last=False)
        return result

    return kept


_MOST_KEPT = 64


def joint_parts(
    scene: PumpScene, throw: int
) -> tuple[RevoluteJoint, RevoluteJoint | None, Guide | None]:
    """Crank pin, wrist pin and guide of a throw, in the order of the contact table."""
    joint = scene.joints(throw)
    return joint.crankpin, joint.wristpin, joint.guide


def joint_rungs(scene: PumpScene, throw: int) -> tuple[int, int, int]:
    """Codes of crank pin, wrist pin and guide of a throw; an absent joint is ideal."""
    first, second, third = (
        JOINT_IDEAL if part is None else JOINT_CODES[part.rung]
        for part in joint_parts(scene, throw)
    )
    return first, second, third


def hydraulics_of(scene: PumpScene, throw: int) -> NDArray[np.void]:
    """Hydraulics of one throw, one record."""
    return _hydraulics(scene, scene.pressures(throw))


def _hydraulics(scene: PumpScene, pressure: CylinderPressure) -> NDArray[np.void]:
    return hydraulic_parameters(
        pressure,
        area=piston_area(scene),
        crank_radius=scene.crank.radius,
        rod_length=scene.rod.length,
        speed=2 * math.pi * scene.drive.speed,
    )


def piston_area(scene: PumpScene) -> float:
    """Area that the liquid pushes on [m^2]."""
    return math.pi / 4 * scene.piston.diameter**2


def _gravity(scene: PumpScene) -> tuple[float, float]:
    return (
        scene.gravity * math.sin(scene.stroke_inclination),
        scene.gravity * math.cos(scene.stroke_inclination),
    )


# --- what the mechanism does to the casing


def throw_on_casing(scene: PumpScene, throw: int) -> list[tuple[str, str, float]]:
    """Places of the casing, the force of the mechanism behind each, and its sign there."""
    reactions = [
        ("bearing_x", "pin_x", -1.0),
        ("bearing_y", "pin_y", -1.0),
        ("guide_y", "guide_y", -1.0),
        ("cylinder_x", "piston_x", -1.0),
    ]
    if scene.piston.seal_friction or scene.piston.seal_friction_share:
        reactions.append(("cylinder_x", "seal_x", -1.0))
    if rubs_in_guide(scene, throw):
        reactions += [(place, place, -1.0) for place in GUIDE_PLACES]
    if scene.pressures(throw).rung in BREATHING_RUNGS:
        reactions += [(place, place, 1.0) for place in VALVE_PLACES]
    return reactions


def rubs_in_guide(scene: PumpScene, throw: int) -> bool:
    """Whether the piston of a throw rubs in a guide with clearance."""
    return joint_rungs(scene, throw)[GUIDE] == JOINT_COMPLIANT


def yielding_of(scene: PumpScene, step: float) -> Yielding:
    """Casing that carries the main bearing along, of the rung `yielding`; else one at rest.

    Its modes are those of the casing on its feet as they are, and exact for a force that is even
    over a step [s]; a mode of more than half a turn in it is left out, as is the unbalance of the
    crank itself, far below the first of them.
    """
    if scene.casing.rung != "yielding":
        return AT_REST
    moving = [step * mode.frequency < 0.5 for mode in scene.casing.modes]
    modes = [mode for mode, moves in zip(scene.casing.modes, moving, strict=True) if moves]
    throws = range(len(scene.throws))
    feet = 1.0 if scene.casing.feet is None else scene.casing.feet.stiffness_ratio
    push = np.zeros((len(modes), len(throws), len(PUSHES)))
    for throw in throws:
        for place, name, sign in throw_on_casing(scene, throw):
            column = PUSHES.index(FORCES.index(name))
            push[:, throw, column] += [
                sign * casing_inputs(m.shape, place, throw + 1) for m in modes
            ]
    react, reach = step_of_modes([mode.on_feet(feet) for mode in modes], step)
    give, held = bearing_shapes(scene)[moving], _held(scene)[moving]
    gain = give.T @ (react[:, :1] * held)
    return Yielding(
        push=push,
        react=react,
        reach=reach,
        give=give,
        held=held,
        blend=np.asarray(np.linalg.solve(np.eye(2) + gain, gain), np.float64),
    )


def step_of_modes(
    modes: Sequence[tuple[float, float]], step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean acceleration of modes over a step, and their place after it.

    Parameters
    ----------
    modes : sequence of (float, float)
        Frequency [Hz] and damping ratio.
    step : float
        [s]

    Returns
    -------
    react, reach : ndarray of shape (n_modes, 3)
        Per force, which is even over the step, and per place and speed before it; unit modal mass.
    """
    react, reach = np.empty((len(modes), 3)), np.empty((len(modes), 3))
    for row, (frequency, damping_ratio) in enumerate(modes):
        turned, gain = exact_oscillator(frequency, damping_ratio, step)
        place, speed = gain.sum(axis=1)
        react[row] = speed / step, turned[1, 0] / step, (turned[1, 1] - 1) / step
        reach[row] = place, turned[0, 0], turned[0, 1]
    return react, reach


def _held(scene: PumpScene) -> NDArray[np.float64]:
    """Force on each mode per acceleration of what is held to the bearing [kg^0.5], (n_modes, 2).

    A rigid crank pin takes piston and rod along the stroke; across it pin and guide share them,
    the rod as its mass lies. Past a crank pin with play the guide has the piston and what a free
    rod leaves to it; what the pin's contact makes of it within a step is little.
    """
    held = np.zeros((len(scene.casing.modes), 2))
    for k in range(len(scene.throws)):
        at = np.array(
            [
                [casing_inputs(mode.shape, place, k + 1) for place in (*_BEARING, "guide_y")]
                for mode in scene.casing.modes
            ]
        )
        along, at_pin, at_guide = _held_masses(scene, k)
        held[:, 0] += along * at[:, 0]
        held[:, 1] += at_pin * at[:, 1] + at_guide * at[:, 2]
    return held


def guide_gain(scene: PumpScene) -> float:
    """Acceleration of a bearing across the stroke by what its guides carry, per that of these.

    Examples
    --------
    >>> from ..scene.load import load_scene
    >>> round(guide_gain(load_scene("bilge-pump")), 3)
    0.06
    """
    across = bearing_shapes(scene)[:, 1]
    guides = [
        _held_masses(scene, k)[2]
        * np.array([casing_inputs(m.shape, "guide_y", k + 1) for m in scene.casing.modes])
        for k in range(len(scene.throws))
    ]
    return float(across @ np.sum(guides, axis=0))


def _held_masses(scene: PumpScene, throw: int) -> tuple[float, float, float]:
    """Masses that a bearing feels along the stroke, and across it at pin and guide [kg]."""
    piston, rod = scene.piston.mass, scene.rod.mass
    if joint_rungs(scene, throw)[CRANKPIN] < JOINT_COMPLIANT:
        at_pin = rod * scene.rod.centre_of_mass / scene.rod.length
        return piston + rod, at_pin, piston + rod - at_pin
    about_wrist = scene.rod.inertia + rod * scene.rod.centre_of_mass**2
    swung = scene.rod.inertia / about_wrist if about_wrist > 0 else 1.0
    return 0.0, 0.0, piston + rod * swung


def bearing_shapes(scene: PumpScene) -> NDArray[np.float64]:
    """Shapes of the casing's modes at the main bearing, the mean of all throws'.

    Returns
    -------
    ndarray of shape (n_modes, 2)
        Mass-normalised, along the stroke and across it [kg^-0.5].
    """
    throws = range(1, len(scene.throws) + 1)
    return np.array(
        [
            [np.mean([casing_inputs(mode.shape, place, k) for k in throws]) for place in _BEARING]
            for mode in scene.casing.modes
        ]
    )


def bearing_mass_ratios(scene: PumpScene) -> dict[str, float]:
    """Apparent mass of the casing at its main bearing above all its modes, over one throw's masses.

    A force there that is shorter than any mode's period moves it as ``1 / sum(shape^2)`` would.

    Returns
    -------
    dict of str to float
        Way -> ratio, of those in which the casing moves there.
    """
    if not scene.casing.modes:
        return {}
    moving = scene.piston.mass + scene.rod.mass
    given_way = np.sum(bearing_shapes(scene) ** 2, axis=0)
    return {way: 1 / (float(g) * moving) for way, g in zip(WAYS, given_way, strict=True) if g > 0}


WAYS = ("along the stroke", "across it")
_BEARING = ("bearing_x", "bearing_y")


# --- the closed form


def ideal_motion(scene: PumpScene, angle: NDArray[np.float64], throw: int = 0) -> IdealCrank:
    """Inverse dynamics of a throw without clearance at constant speed.

    Parameters
    ----------
    scene : PumpScene
    angle : numpy.ndarray
        Crank angle of the first throw [rad].
    throw : int
        Counted from 0.

    Returns
    -------
    IdealCrank
        With the pressure of the scene's rung; a chamber, which has a memory, is stood in for by
        its two levels.
    """
    speed = 2 * math.pi * scene.drive.speed
    gravity_x, gravity_y = _gravity(scene)
    own = np.asarray(angle, dtype=float) + scene.throws[throw].phase
    known: dict[str, Any] = {
        "speed": speed,
        "crank_radius": scene.crank.radius,
        "rod_length": scene.rod.length,
        "rod_mass": scene.rod.mass,
        "rod_centre": scene.rod.centre_of_mass,
        "rod_inertia": scene.rod.inertia,
        "piston_mass": scene.piston.mass,
        "gravity_x": gravity_x,
        "gravity_y": gravity_y,
    }
    motion = ideal_crank(own, **known)
    liquid, seal = _on_piston(scene, motion, own, throw)
    return ideal_crank(own, piston_force=-(liquid + seal), **known)


def _on_piston(
    scene: PumpScene, motion: IdealCrank, own: NDArray[np.float64], throw: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Forces of liquid and seal along x on the piston of a motion without clearance [N].

    `own` are the crank angles of the throw itself [rad].
    """
    speed, acceleration = 2 * math.pi * scene.drive.speed, motion.piston_acceleration
    pressure, added, drag = np.empty((3, own.size))
    _in_cylinder(
        np.ravel(own),
        speed,
        np.ravel(motion.piston_velocity),
        _without_memory(scene, throw),
        _seal_record(scene),
        pressure,
        added,
        drag,
    )
    force = piston_area(scene) * pressure + added * np.ravel(acceleration)
    return -force.reshape(own.shape), drag.reshape(own.shape)


@kernel
def _in_cylinder(
    angle: Any,
    speed: float,
    velocity: Any,
    liquid: Any,
    seal: Any,
    pressure: Any,
    added: Any,
    drag: Any,
) -> None:
    for i in range(angle.size):
        pressure[i], added[i] = line_pressure(angle[i], speed, velocity[i], liquid[0])
        drag[i] = seal_drag(velocity[i], pressure[i], seal[0])


def _seal_record(scene: PumpScene) -> NDArray[np.void]:
    record = np.zeros(1, dtype=THROW)
    for name, value in _seal(scene).items():
        record[name] = value
    return record


def _seal(scene: PumpScene) -> dict[str, float]:
    piston = scene.piston
    return {
        "seal_friction": piston.seal_friction,
        "seal_friction_area": piston.seal_friction_share * piston_area(scene),
        "seal_friction_speed": piston.seal_friction_speed,
    }


def _without_memory(scene: PumpScene, throw: int) -> NDArray[np.void]:
    pressure = scene.pressures(throw)
    if pressure.rung in BREATHING_RUNGS:
        suction, discharge = pressure.suction, pressure.discharge
        if pressure.rung in PIPED_RUNGS:
            suction, discharge = pressure.at_pump
        levels = {"rung": "two-level", "suction": suction, "discharge": discharge}
        pressure = pressure.model_copy(update=levels)
    return _hydraulics(scene, pressure)


@_kept
def joint_loads(scene: PumpScene, throw: int) -> tuple[float, float, float]:
    """Largest forces of crank pin, wrist pin and guide over a revolution, without clearance [N]."""
    motion = ideal_motion(scene, np.linspace(0.0, 2 * math.pi, _ANGLES, endpoint=False), throw)
    return (
        float(np.hypot(motion.pin_force_x, motion.pin_force_y).max()),
        float(np.hypot(motion.wrist_force_x, motion.wrist_force_y).max()),
        float(np.abs(motion.guide_force).max()),
    )


# --- contacts


def contact_record(
    part: RevoluteJoint | Guide, clearance: float, load: float, mobility: float
) -> NDArray[np.void]:
    """Kernel record of one contact.

    Parameters
    ----------
    part : RevoluteJoint or Guide
        Of the scene, not ideal.
    clearance : float
        Radial, or on either side of a guide [m].
    load : float
        Largest force of the ideal joint [N], which places the floor of the impact speed.
    mobility : float
        Largest acceleration of the contact per unit force [1/kg].

    Returns
    -------
    numpy.ndarray [shape=(1,), dtype=CONTACT]
        Where the scene sets no ``speed_floor``, a hysteresis law gets the speed at which the
        damping of sustained contact under `load`, ``a F / v``, is twice the critical one: slower
        impacts are swallowed whatever the law says, and without a floor the damping has no bound.
        The swing of a massless link is damped by half the critical damping under `load`: what a
        pin loses that slides along its eye to the other side.
    """
    record = np.zeros(1, dtype=CONTACT)
    kelvin_voigt = part.law == "kelvin-voigt"
    hysteretic = LAW_HYSTERESIS if part.restitution_speed is None else LAW_CONSTANT_LOSS
    code, stiffness = {
        "linear": (ELASTIC_LINEAR, part.stiffness),
        "hertz": (ELASTIC_HERTZ, part.hertz_stiffness),
        "conformal": (
            ELASTIC_CONFORMAL,
            conformal_stiffness(part.effective_modulus or 0.0, part.contact_length or 0.0)
            if part.elasticity == "conformal"
            else None,
        ),
    }[part.elasticity]
    values = {
        "law": LAW_KELVIN_VOIGT if kelvin_voigt else hysteretic,
        "elasticity": code,
        "stiffness": stiffness or 0.0,
        "damping": part.damping,
        "hysteresis": 0.0 if kelvin_voigt else hysteresis(part.law, part.restitution or 0.0),
        "clearance": clearance,
        "release": RELEASE_AT_ZERO_FORCE if kelvin_voigt else RELEASE_AT_ZERO_PENETRATION,
        "friction_law": FRICTION_RAMP if part.friction_law == "ramp" else FRICTION_SMOOTH,
        "friction": part.friction,
        "friction_speed": part.friction_speed,
        "friction_dead_speed": part.friction_dead_speed,
        "tangential_damping": part.tangential_damping,
        "speed_floor": part.restitution_speed or part.speed_floor or 1.0,
    }
    for name, value in values.items():
        record[name] = value
    if isinstance(part, RevoluteJoint) and part.oil is not None and part.rung in OILED_RUNGS:
        # the film drags by itself, and squeezed oil is no part of the wall
        record["tangential_damping"] = 0.0
        told = part.oil.wall_damping
        spring = tangent_stiffness(record[0], load) if stiffness else 0.0
        record["damping"] = _WALL_DAMPING * math.sqrt(spring / mobility) if told is None else told
        record["hysteresis"] = 0.0
    elif part.rung == "link":
        record["damping"] = _LINK_DAMPING * 2 * math.sqrt(load / max(clearance, 1e-12) / mobility)
    elif record["law"] == LAW_HYSTERESIS and part.speed_floor is None and stiffness:
        spring = tangent_stiffness(record[0], load)
        most = _MOST_DAMPING * 2 * math.sqrt(spring / mobility)
        record["speed_floor"] = max(float(record["hysteresis"][0]) * load / most, 1e-9)
    return record


@kernel
def penetration_under(contact: Any, force: float) -> float:
    """Penetration at which the elastic force of a contact record is `force` [m].

    Bisection on the law, so that a further elasticity needs nothing here.
    """
    high = 1e-9
    while elastic_force(high, contact) < force and high < 1.0:
        high *= 2.0
    low = 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if elastic_force(middle, contact) < force:
            low = middle
        else:
            high = middle
    return high


def tangent_stiffness(contact: Any, force: float) -> float:
    """Stiffness of a contact record at a given force [N/m]."""
    return float(elastic_stiffness(penetration_under(contact, force), contact))


_MOST_DAMPING = 2.0  # of the critical one, where a hysteresis law would have no bound
_LINK_DAMPING = 0.5  # of the critical one
_WALL_DAMPING = 0.1  # of sqrt(K m): bush, bolts and rod end in a row

_WALL_PER_STEP = (
    0.7  # least damping of a wall behind oil over stiffness times step: RK4 resolves it
)
_DEEPEST_START = 0.9  # eccentricity from which a film starts

_PEAK_OVER_LOAD = 3.0  # what a knock may add to the ideal load, where the elasticity is not linear


def _rod_jacobian(scene: PumpScene, throw: int, beta: float) -> NDArray[np.float64]:
    """Relative motion of pin and eye at crank pin (x, y), wrist pin (x, y), guide (y, two ends).

    Columns: rod x, y, beta; piston x, y, tilt.
    """
    arm, centre = scene.rod.length - scene.rod.centre_of_mass, scene.rod.centre_of_mass
    s, c = math.sin(beta), math.cos(beta)
    guide = scene.joints(throw).guide
    reach = guide.length / 2 if guide else 0.0
    return np.array(
        [
            [-1.0, 0.0, -arm * s, 0.0, 0.0, 0.0],
            [0.0, -1.0, -arm * c, 0.0, 0.0, 0.0],
            [-1.0, 0.0, centre * s, 1.0, 0.0, 0.0],
            [0.0, -1.0, centre * c, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, reach],
            [0.0, 0.0, 0.0, 0.0, 1.0, -reach],
        ]
    )


_JOINT_ROWS = (slice(0, 2), slice(2, 4), slice(4, 6))


@_kept
def _compliances(scene: PumpScene, throw: int) -> NDArray[np.float64]:
    """Acceleration of every row of the jacobian per force along every other [1/kg].

    At five swings of the rod, from none to its largest: shape (5, 6, 6).
    """
    rod, piston = scene.rod, scene.piston
    rungs = joint_rungs(scene, throw)
    free = rungs[GUIDE] == JOINT_COMPLIANT
    inverse: NDArray[np.float64] = np.diag(
        [
            1 / rod.mass,
            1 / rod.mass,
            1 / rod.inertia,
            1 / piston.mass,
            1 / piston.mass if free else 0.0,
            1 / piston.inertia if free and piston.inertia else 0.0,
        ]
    )
    jacobian = np.array([_rod_jacobian(scene, throw, beta) for beta in _betas(scene)])
    ideal = [_JOINT_ROWS[j] for j in (CRANKPIN, WRISTPIN) if rungs[j] == JOINT_IDEAL]
    if ideal:
        held = np.concatenate([jacobian[:, rows] for rows in ideal], axis=1)
        through = inverse @ _transposed(held)
        inverse = inverse - through @ np.linalg.pinv(held @ through) @ _transposed(through)
    compliances = jacobian @ inverse @ _transposed(jacobian)
    compliances.flags.writeable = False
    return compliances


def _transposed(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.swapaxes(matrices, -1, -2)


def _betas(scene: PumpScene) -> NDArray[np.float64]:
    largest = math.asin(min(1.0, scene.crank.radius / scene.rod.length))
    return np.linspace(0.0, largest, 5)


def joint_mobility(scene: PumpScene, throw: int, joint: int) -> float:
    """Largest acceleration of a joint per unit force in it, over a revolution [1/kg]."""
    rows = _JOINT_ROWS[joint]
    return float(np.linalg.eigvalsh(_compliances(scene, throw)[:, rows, rows]).max())


def _largest(scene: PumpScene, throw: int, weights: tuple[float, ...]) -> float:
    """Largest eigenvalue of the mechanism on springs (or dampers) in its joints."""
    root = np.sqrt(np.repeat(weights, 2))
    return float(np.linalg.eigvalsh(root[:, None] * _compliances(scene, throw) * root).max())


@_kept
def _springs_and_dampers(
    scene: PumpScene, throw: int
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Tangent stiffness and damping of every joint: a link's own stiffness is load over length."""
    springs, dampers = [], []
    records = contact_table(scene, throw)
    loads = joint_loads(scene, throw)
    rungs = joint_rungs(scene, throw)
    for joint, (record, load, rung) in enumerate(zip(records, loads, rungs, strict=True)):
        peak = _PEAK_OVER_LOAD * load
        if rung >= JOINT_COMPLIANT:
            linear = record["elasticity"] == ELASTIC_LINEAR
            springs.append(
                float(record["stiffness"]) if linear else tangent_stiffness(record, peak)
            )
            loss = record["hysteresis"] * load / max(record["speed_floor"], 1e-12)
            dampers.append(float(max(record["damping"], loss)))
        elif rung == JOINT_LINK and joint != GUIDE:
            springs.append(load / max(float(record["clearance"]), 1e-12))
            dampers.append(float(record["damping"]))
        else:
            springs.append(0.0)
            dampers.append(0.0)
    return tuple(springs), tuple(dampers)


def contact_frequency(scene: PumpScene) -> float:
    """Largest angular frequency of the mechanism on its undamped contact springs [rad/s].

    The mass felt at a joint depends on the direction; its least value over a revolution sets the
    fastest contact, and so the step. 0 where every joint is ideal.
    """
    return max(
        math.sqrt(_largest(scene, throw, _springs_and_dampers(scene, throw)[0]))
        for throw in _different_throws(scene)
    )


@_kept
def contact_rate(scene: PumpScene) -> float:
    """Fastest rate of the damped contacts [1/s]: largest root of ``s^2 + C/m s + K/m``.

    The contact's angular frequency while it oscillates; beyond critical damping the faster of
    its two decays, which is what limits an explicit step.
    """
    return max(_rate(scene, throw) for throw in _different_throws(scene))


def _rate(scene: PumpScene, throw: int) -> float:
    springs, dampers = _springs_and_dampers(scene, throw)
    half, square = _largest(scene, throw, dampers) / 2, _largest(scene, throw, springs)
    return half + math.sqrt(half**2 - square) if half**2 > square else math.sqrt(square)


def _different_throws(scene: PumpScene) -> list[int]:
    """Throws that differ in their joints from those before: equal ones have equal rates."""
    seen: list[Any] = []
    found = []
    for throw in range(len(scene.throws)):
        key = (scene.joints(throw), scene.pressures(throw))
        if key not in seen:
            seen.append(key)
            found.append(throw)
    return found


@_kept
def contact_table(scene: PumpScene, throw: int) -> NDArray[np.void]:
    """Contact records of one throw: crank pin, wrist pin, guide; an ideal joint's is empty.

    Returns
    -------
    numpy.ndarray [shape=(3,), dtype=CONTACT]
        Read-only.
    """
    table = np.zeros(3, dtype=CONTACT)
    table["friction_speed"] = table["speed_floor"] = 1.0  # an unused record divides by neither
    loads = joint_loads(scene, throw)
    for joint, part in enumerate(joint_parts(scene, throw)):
        if part is None or part.rung == "ideal":
            continue
        clearance = part.clearance_radial
        mobility = joint_mobility(scene, throw, joint)
        table[joint] = contact_record(part, clearance, loads[joint], mobility)[0]
    table.flags.writeable = False
    return table


# --- oil


def joint_maps(scene: PumpScene) -> dict[float, ImpedanceMap]:
    """Film maps that the joints of a scene need, by length over diameter of their lands."""
    ratios = sorted(
        {
            _land(part) / part.pin_diameter
            for throw in range(len(scene.throws))
            for part in joint_parts(scene, throw)[:2]
            if part is not None and runs_on_a_map(part)
        }
    )
    return {
        ratio: impedance_map(FilmGeometry(length_to_diameter=ratio, n_theta=_N_THETA, n_z=_N_Z))
        for ratio in ratios
    }


_N_THETA, _N_Z = 144, 33  # carry within half a percent of published tables up to e = 0.95


def runs_on_a_map(part: RevoluteJoint) -> bool:
    """Whether a film of finite length is asked for: a starved one is narrow, and short."""
    if part.oil is None:
        return False
    return part.rung == "film-map" or (part.rung == "mixed" and part.oil.filled_gap is None)


def _land(part: RevoluteJoint) -> float:
    """Length of film between two ends without pressure [m]."""
    assert part.oil is not None
    both = part.oil.length - part.oil.groove_width
    return both / 2 if part.oil.groove_width > 0 else both


def oil_table(
    scene: PumpScene, throw: int, contacts: NDArray[np.void], maps: dict[float, Any], step: float
) -> NDArray[np.void]:
    """Records of the oil in crank pin and wrist pin of one throw; zeros where there is none.

    Parameters
    ----------
    scene : PumpScene
    throw : int
        Counted from 0.
    contacts : numpy.ndarray [shape=(3,), dtype=CONTACT]
        Of the throw.
    maps : dict
        As :func:`joint_maps` gives them.
    step : float
        [s]

    Returns
    -------
    numpy.ndarray [shape=(2,), dtype=OIL]
    """
    table = np.zeros(2, dtype=OIL)
    loads = joint_loads(scene, throw)
    for joint, part in enumerate(joint_parts(scene, throw)[:2]):
        if isinstance(part, RevoluteJoint) and part.oil is not None and part.rung in OILED_RUNGS:
            warm = film_temperature_of(scene, throw, joint)
            oil = part.oil
            viscosity = oil.dynamic_viscosity if warm is None else oil.viscosity_at(warm)
            values = _oil_values(part, viscosity, contacts[joint], loads[joint], maps, step)
            for name, value in values.items():
                table[joint][name] = value
    return table


@_kept
def film_temperature_of(scene: PumpScene, throw: int, joint: int) -> float | None:
    """Temperature at which the film of a pin runs, by its heat balance [K].

    Parameters
    ----------
    scene : PumpScene
    throw, joint : int
        Counted from 0; joint 0 is the crank pin, 1 the wrist pin.

    Returns
    -------
    float or None
        None of a pin that is not asked for one: its oil is as warm as the scene says.
    """
    part = joint_parts(scene, throw)[joint]
    if not isinstance(part, RevoluteJoint) or part.rung not in OILED_RUNGS or part.oil is None:
        return None
    oil, carried = part.oil, part.oil.carried_per_kelvin
    if not carried or oil.temperature is None:
        return None
    spin, load = _usual_spin_and_load(scene, throw)[joint]
    lands = 2 if oil.groove_width > 0 else 1

    def power(temperature: float) -> float:
        return lands * friction_power(
            oil.viscosity_at(temperature),
            spin=spin,
            load=load / lands,
            radius=part.pin_diameter / 2,
            length=_land(part),
            gap=part.clearance_radial,
        )

    return film_temperature(oil.temperature, power, carried)


def _usual_spin_and_load(scene: PumpScene, throw: int) -> list[tuple[float, float]]:
    """Root mean squares of the spin [rad/s] and load [N] of crank pin and wrist pin."""
    angle = np.linspace(0.0, math.tau, _ANGLES, endpoint=False)
    motion = ideal_motion(scene, angle, throw)
    turning = math.tau * scene.drive.speed
    # sin(beta) = (r / l) sin(a): the rod swings against crank and piston
    ratio, own = scene.crank.radius / scene.rod.length, angle + scene.throws[throw].phase
    swing = turning * ratio * np.cos(own) / np.sqrt(1 - (ratio * np.sin(own)) ** 2)

    def usual(values: NDArray[np.float64]) -> float:
        return math.sqrt(float(np.mean(values**2)))

    crank = np.hypot(motion.pin_force_x, motion.pin_force_y)
    wrist = np.hypot(motion.wrist_force_x, motion.wrist_force_y)
    return [(usual(turning + swing), usual(crank)), (usual(swing), usual(wrist))]


def _oil_values(
    part: RevoluteJoint,
    viscosity: float,
    contact: Any,
    load: float,
    maps: dict[float, Any],
    step: float,
) -> dict[str, float]:
    oil, gap, radius = part.oil, part.clearance_radial, part.pin_diameter / 2
    assert oil is not None
    land = _land(part)
    lands = 2 if oil.groove_width > 0 else 1
    rough = oil.roughness if part.rung == "mixed" and oil.roughness else 0.0
    peaks = (
        asperity_scale(rough, radius, lands * land, gap, oil.asperity_stiffness) if rough else 0.0
    )
    spring = tangent_stiffness(contact, _PEAK_OVER_LOAD * load)
    values = {
        "shear": lands * viscosity * radius**3 * land / gap,
        "filled": 2.0 if oil.filled_gap is None else oil.filled_gap / gap,
        "radius": radius + gap / 2,
        "wall_damping": float(contact["damping"]),
        "relaxing": max(0.0, _WALL_PER_STEP * spring * step - float(contact["damping"])),
        "roughness": rough,
        "peaks": peaks,
        "step": step,
    }
    if not runs_on_a_map(part):
        return values | {"short": lands * viscosity * radius * (land / gap) ** 3}
    ratio = land / part.pin_diameter
    table = maps[ratio].table
    before = [maps[other] for other in maps if other < ratio]
    return values | {
        "map": lands * viscosity * (radius / gap) ** 3 * land,
        "offset": 1 + sum(other.table.coefficients.size for other in before),
        "roots": table.coefficients.shape[2],
        "angles": table.coefficients.shape[3],
        "gap_factor": table.gap_factor,
        "least_root": table.least_root,
        "per_root": table.per_root,
        "per_radian": table.per_radian,
    }


def start_films(t: Tables, bodies: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Where the films let the pins be at the start, by the scene's own pins; zeros without oil.

    Returns
    -------
    numpy.ndarray [shape=(n_throws, 4)]
        Columns as ``FILM`` [m].
    """
    films = np.zeros((len(t.throws), len(FILM)))
    for throw, q in enumerate(t.throws):
        x, y, beta, piston, across = bodies[throw, :5]
        own = angle + q["phase"]
        turn = np.array([math.cos(beta), -math.sin(beta)])
        crank = q["crank_radius"] * np.array([math.cos(own), math.sin(own)])
        offsets = (
            crank - np.array([x, y]) + q["rod_arm"] * turn,
            np.array([piston - x, across - y]) - q["rod_centre"] * turn,
        )
        for joint, rung in enumerate((q["crankpin_rung"], q["wristpin_rung"])):
            if rung == JOINT_OILED:
                size = float(np.hypot(*offsets[joint]))
                most = _DEEPEST_START * t.contacts[throw, joint]["clearance"]
                films[throw, 2 * joint : 2 * joint + 2] = offsets[joint] * min(1.0, most / size)
    return films


# --- tables and start


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
    breathing = int(liquid["rung"]) == PRESSURE_CHAMBER
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
        "substeps": chamber_substeps(liquid, step) if breathing else 1,
    }
    for name, value in (values | _seal(scene)).items():
        record[name] = value
    return record


def tables(scene: PumpScene, step: float) -> Tables:
    """Everything the mechanism's kernel needs of a scene, at this step [s]."""
    throws = range(len(scene.throws))
    contacts = [contact_table(scene, throw) for throw in throws]
    maps = joint_maps(scene)
    gravity_x, gravity_y = _gravity(scene)
    motor = scene.drive.motor if scene.drive.rung == "motor" else None
    return Tables(
        throws=np.concatenate([throw_record(scene, throw, step) for throw in throws]),
        contacts=np.stack(contacts),
        liquid=np.concatenate([hydraulics_of(scene, throw) for throw in throws]).astype(HYDRAULIC),
        oils=np.stack([oil_table(scene, throw, contacts[throw], maps, step) for throw in throws]),
        maps=np.concatenate([np.zeros(1), *(m.table.coefficients.ravel() for m in maps.values())]),
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
    """State of every throw in which its pins rest in their eyes under the ideal joint's forces.

    Parameters
    ----------
    scene : PumpScene
    angle : float
        Crank angle [rad].
    t : Tables
        Of the scene.

    Returns
    -------
    numpy.ndarray [shape=(n_throws, 12)]
        Columns as ``BODY``, then their rates. Pins and eyes move together.
    """
    rows = [_throw_start(scene, angle, throw, t) for throw in range(len(scene.throws))]
    return np.array(rows)


def _rest(contact: Any, rung: int, force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a pin rests from its eye's centre under a force on the rod."""
    size = float(np.hypot(*force))
    if rung == JOINT_IDEAL:
        return np.zeros(2)
    direction = force / size if size > 0 else np.array([1.0, 0.0])
    pressed = penetration_under(contact, size) if rung >= JOINT_COMPLIANT else 0.0
    return np.asarray((float(contact["clearance"]) + pressed) * direction)


def _throw_start(scene: PumpScene, angle: float, throw: int, t: Tables) -> NDArray[np.float64]:
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
    pin = radius * np.array([math.cos(own), math.sin(own)])
    eye = pin - at_pin
    # out of reach only where the contact is far too soft: the run then says so by its status
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
    """State of every chamber at the start; zeros where there is none.

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
    """Suction and discharge line of a scene, with the pump's mean flow in them; None without.

    Parameters
    ----------
    scene : PumpScene
    step : float
        [s]

    Examples
    --------
    >>> from ..scene.load import load_scene
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


# --- runs


def needs_integration(scene: PumpScene) -> bool:
    """False where the closed form says all: ideal joints, pressure by angle, all else driven."""
    ideal = all(
        rung == JOINT_IDEAL
        for throw in range(len(scene.throws))
        for rung in joint_rungs(scene, throw)
    )
    breathing = any(scene.pressures(k).rung in BREATHING_RUNGS for k in range(len(scene.throws)))
    answered = scene.drive.rung != "constant-speed" or scene.casing.rung == "yielding"
    return not ideal or breathing or answered


class Start(NamedTuple):
    """Where a mechanism begins; as :func:`run_mechanism` is told it."""

    angle: float
    speed: float
    bodies: NDArray[np.float64]
    chambers: NDArray[np.float64]


def begun(scene: PumpScene, step: float, start_angle: float) -> tuple[Tables, Start]:
    """Tables of a scene for a step [s], and where its mechanism begins at a crank angle [rad]."""
    t = tables(scene, step)
    bodies = start_state(scene, start_angle, t)
    speed = 2 * math.pi * scene.drive.speed
    chambers = start_chambers(t, bodies)
    return t, Start(angle=start_angle, speed=speed, bodies=bodies, chambers=chambers)


def run_scene(
    scene: PumpScene, *, step: float, n_steps: int, start_angle: float, keep_states: bool = False
) -> CrankRun:
    """Run the mechanism of a scene: in closed form where that says all, else step by step.

    Parameters
    ----------
    scene : PumpScene
    step : float
        [s], at most ``LARGEST_STEP_PER_CONTACT_TIME`` over :func:`contact_rate`.
    n_steps : int
        Steps to take.
    start_angle : float
        Crank angle at the start [rad].
    keep_states : bool
        Keep bodies and chambers at the ends of all steps.

    Returns
    -------
    CrankRun
        Cut off at the step in which it failed where the status is not OK.
    """
    if not needs_integration(scene):
        return _run_ideal(scene, step=step, n_steps=n_steps, start_angle=start_angle)
    t, start = begun(scene, step, start_angle)
    return run_mechanism(
        t,
        angle=start.angle,
        speed=start.speed,
        bodies=start.bodies,
        chambers=start.chambers,
        films=start_films(t, start.bodies, start_angle),
        lines=lines_of(scene, step),
        casing=yielding_of(scene, step),
        step=step,
        n_steps=n_steps,
        keep_states=keep_states,
    )


def _run_ideal(scene: PumpScene, *, step: float, n_steps: int, start_angle: float) -> CrankRun:
    """The closed form as a run: forces at the middle of each step."""
    speed = 2 * math.pi * scene.drive.speed
    angle = start_angle + speed * step * np.arange(n_steps + 1.0)
    middle = 0.5 * (angle[:-1] + angle[1:])
    bodies, columns, moment, peak = [], [], np.zeros(n_steps), 0.0
    for throw in range(len(scene.throws)):
        motion = ideal_motion(scene, middle, throw)
        pull = scene.piston.mass * (motion.piston_acceleration + _gravity(scene)[0])
        own = middle + scene.throws[throw].phase
        nothing, (_, seal) = np.zeros(n_steps), _on_piston(scene, motion, own, throw)
        columns += [
            motion.pin_force_x,
            motion.pin_force_y,
            -motion.wrist_force_x,
            -motion.wrist_force_y,
            nothing,
            motion.guide_force,
            pull - motion.wrist_force_x - seal,
            seal,
            nothing,
            nothing,
        ]
        moment += motion.crank_moment
        peak = max(peak, float(np.hypot(motion.pin_force_x, motion.pin_force_y).max()))
        bodies.append(_ideal_bodies(scene, ideal_motion(scene, angle, throw)))
    weight_x, weight_y = _gravity(scene)
    first = middle + scene.throws[0].phase
    moment -= scene.crank.unbalance * (weight_x * np.sin(first) - weight_y * np.cos(first))
    return CrankRun(
        steps=n_steps,
        turns=np.column_stack([angle, np.full(n_steps + 1, speed)]),
        forces=np.column_stack([moment, *columns]),
        bodies=np.stack(bodies, axis=1),
        chambers=None,
        step=step,
        peak_normal_force=peak,
    )


def _ideal_bodies(scene: PumpScene, motion: IdealCrank) -> NDArray[np.float64]:
    centre = scene.rod.centre_of_mass
    sin_b, cos_b = np.sin(motion.beta), np.cos(motion.beta)
    nothing = np.zeros_like(motion.beta)
    return np.column_stack(
        [
            motion.piston - centre * cos_b,
            centre * sin_b,
            motion.beta,
            motion.piston,
            nothing,
            nothing,
            motion.piston_velocity + centre * sin_b * motion.beta_rate,
            centre * cos_b * motion.beta_rate,
            motion.beta_rate,
            motion.piston_velocity,
            nothing,
            nothing,
        ]
    )


def pin_offsets(
    scene: PumpScene, angle: NDArray[np.float64], bodies: NDArray[np.float64], throw: int = 0
) -> NDArray[np.float64]:
    """Position of the pins' centres from those of their eyes [m].

    Parameters
    ----------
    scene : PumpScene
    angle : numpy.ndarray [shape=(n,)]
        Of the crank [rad].
    bodies : numpy.ndarray [shape=(n, 12)]
        Of the throw, columns as ``BODY``, then their rates.
    throw : int
        Counted from 0.

    Returns
    -------
    numpy.ndarray [shape=(n, 4)]
        Crank pin x (along the stroke) and y (across it), wrist pin x and y. The length exceeds
        the radial clearance by the penetration where there is contact.
    """
    x, y, beta, piston, across = bodies[:, :5].T
    angle = angle + scene.throws[throw].phase
    centre = scene.rod.centre_of_mass
    arm = scene.rod.length - centre
    sin_b, cos_b = np.sin(beta), np.cos(beta)
    return np.column_stack(
        [
            scene.crank.radius * np.cos(angle) - x + arm * cos_b,
            scene.crank.radius * np.sin(angle) - y - arm * sin_b,
            piston - x - centre * cos_b,
            across - y + centre * sin_b,
        ]
    )
