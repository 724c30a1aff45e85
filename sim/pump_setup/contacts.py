"""Contacts of the joints: stiffness, damping, effective mass, frequencies."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.closed_forms import conformal_stiffness
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
from ..jit import kernel
from ..mechanism.layout import (
    CRANKPIN,
    FLEX,
    GUIDE,
    JOINT_COMPLIANT,
    JOINT_IDEAL,
    JOINT_LINK,
    WRISTPIN,
)
from ..scene.pump import PumpScene
from ..scene.pump_joints import OILED_RUNGS, Guide, RevoluteJoint
from .ideal_motion import joint_loads, largest_bearing_load
from .joints import cached_by_scene, has_main_play, joint_parts, joint_rungs
from .rods import rod_table


def contact_record(
    part: RevoluteJoint | Guide,
    clearance: float,
    load: float,
    mobility: float,
    slot: float = 0.0,
) -> NDArray[np.void]:
    """Kernel record of one contact.

    Parameters
    ----------
    part : RevoluteJoint or Guide
        Part of the scene that is not ideal.
    clearance : float
        Radial clearance, or on either side of a guide [m].
    load : float
        Largest force of the ideal joint [N], which sets the floor of the impact speed.
    mobility : float
        Largest acceleration of the contact per unit force [1/kg].
    slot : float
        Length of an eye along its rod in excess of that across [m].

    Returns
    -------
    numpy.ndarray [shape=(1,), dtype=CONTACT]
        If the scene sets no ``speed_floor``, a hysteresis law gets the speed at which the
        damping of sustained contact under `load`, ``a F / v``, is twice the critical one: slower
        impacts are overdamped for any law, and without a floor the damping is unbounded.
        The swing of a massless link is damped by half the critical damping under `load`: the
        energy that a pin loses when it slides along its eye to the other side.
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
        "slot": slot,
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
        # the film has its own drag, and squeezed oil is not part of the wall
        record["tangential_damping"] = 0.0
        given = part.oil.wall_damping
        spring = tangent_stiffness(record[0], load) if stiffness else 0.0
        record["damping"] = _WALL_DAMPING * math.sqrt(spring / mobility) if given is None else given
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

    Bisection on the law, so that new elasticities need no change here.
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


_MOST_DAMPING = 2.0  # of critical damping, for a hysteresis law without bound
_LINK_DAMPING = 0.5  # of critical damping
_WALL_DAMPING = 0.1  # of sqrt(K m): bush, bolts and rod end in series

PEAK_OVER_LOAD = 3.0  # factor on the ideal load for knocks, if the elasticity is non-linear


def _rod_jacobian(scene: PumpScene, throw: int, beta: float) -> NDArray[np.float64]:
    """Motion of pin in eye at crank and wrist pin (x, y), guide (y, two ends), main bearing (x, y).

    Columns: rod x, y, beta; piston x, y, tilt; crank x, y.
    """
    arm, centre = scene.rod.length - scene.rod.centre_of_mass, scene.rod.centre_of_mass
    s, c = math.sin(beta), math.cos(beta)
    guide = scene.joints(throw).guide
    reach = guide.length / 2 if guide else 0.0
    return np.array(
        [
            [-1.0, 0.0, -arm * s, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, -1.0, -arm * c, 0.0, 0.0, 0.0, 0.0, 1.0],
            [-1.0, 0.0, centre * s, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, -1.0, centre * c, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, reach, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, -reach, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )


def _flex_jacobian(scene: PumpScene, beta: float) -> NDArray[np.float64]:
    """The same rows per stretch and bow of an elastic rod, followed by these two coordinates."""
    modes, rod = rod_table(scene)[0], scene.rod
    s, c = math.sin(beta), math.cos(beta)
    crank, wrist = 1 - rod.centre_of_mass / rod.length, -rod.centre_of_mass / rod.length
    shapes = modes["crank_shape"], modes["wrist_shape"]
    return np.array(
        [
            [crank * c, -shapes[0] * s],
            [-crank * s, -shapes[0] * c],
            [wrist * c, -shapes[1] * s],
            [-wrist * s, -shapes[1] * c],
            *4 * [[0.0, 0.0]],
            [1.0, 0.0],
            [0.0, 1.0],
        ]
    )


def _jacobian(
    scene: PumpScene, throw: int, beta: float, modes: NDArray[np.void]
) -> NDArray[np.float64]:
    """Rows and columns of :func:`_rod_jacobian`, plus two of each if rods have modes."""
    rigid = _rod_jacobian(scene, throw, beta)
    if not len(modes):
        return rigid
    return np.hstack([np.vstack([rigid, np.zeros((2, 8))]), _flex_jacobian(scene, beta)])


_JOINT_ROWS = (slice(0, 2), slice(2, 4), slice(4, 6))


@cached_by_scene
def _compliances(scene: PumpScene, throw: int, flexing: int) -> NDArray[np.float64]:
    """Acceleration of every row of the jacobian per force along every other [1/kg].

    At five rod angles from zero to the largest: shape (5, n, n), n = 8, or 10 with an
    elastic rod that may flex (`flexing` 1). Throws that push a crank with play in the same
    direction each see a crank with their share of the mass.
    """
    rod, piston = scene.rod, scene.piston
    rungs = joint_rungs(scene, throw)
    free, modes = rungs[GUIDE] == JOINT_COMPLIANT, rod_table(scene)[:flexing]
    inverse: NDArray[np.float64] = np.diag(
        [
            1 / rod.mass,
            1 / rod.mass,
            1 / rod.inertia,
            1 / piston.mass,
            1 / piston.mass if free else 0.0,
            1 / piston.inertia if free and piston.inertia else 0.0,
            *2 * [_crank_mobility(scene)],
            *(float(row[f"inverse_{name}_mass"]) for row in modes for name in FLEX),
        ]
    )
    jacobian = np.array([_jacobian(scene, throw, beta, modes) for beta in _betas(scene)])
    ideal = [_JOINT_ROWS[j] for j in (CRANKPIN, WRISTPIN) if rungs[j] == JOINT_IDEAL]
    if ideal:
        held = np.concatenate([jacobian[:, rows] for rows in ideal], axis=1)
        through = inverse @ _transposed(held)
        inverse = inverse - through @ np.linalg.pinv(held @ through) @ _transposed(through)
    compliances = jacobian @ inverse @ _transposed(jacobian)
    compliances.flags.writeable = False
    return compliances


def _crank_mobility(scene: PumpScene) -> float:
    """Acceleration of a crank with play per force of each of its throws [1/kg]."""
    if not has_main_play(scene) or scene.crank.mass is None:
        return 0.0
    return len(scene.throws) / scene.crank.mass


def _transposed(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.swapaxes(matrices, -1, -2)


def _betas(scene: PumpScene) -> NDArray[np.float64]:
    largest = math.asin(min(1.0, scene.crank.radius / scene.rod.length))
    return np.linspace(0.0, largest, 5)


def joint_mobility(scene: PumpScene, throw: int, joint: int) -> float:
    """Largest acceleration of a joint per unit force in it, over a revolution [1/kg].

    For rigid rods: the default loss of a wall or a link must not depend on the model of the
    rod.
    """
    rows = _JOINT_ROWS[joint]
    return float(np.linalg.eigvalsh(_compliances(scene, throw, 0)[:, rows, rows]).max())


def _largest(scene: PumpScene, throw: int, weights: NDArray[np.float64]) -> float:
    """Largest eigenvalue of the mechanism with springs (or dampers) along its rows."""
    root = np.sqrt(weights)
    return float(np.linalg.eigvalsh(root[:, None] * _compliances(scene, throw, 1) * root).max())


@cached_by_scene
def _springs_and_dampers(
    scene: PumpScene, throw: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Tangent stiffness and damping along every row of :func:`_jacobian`.

    A link's own stiffness is load over length.
    """
    springs, dampers = [], []
    records = [*contact_table(scene, throw), *bore_table(scene)]
    loads = [*joint_loads(scene, throw), largest_bearing_load(scene)]
    rungs = [*joint_rungs(scene, throw), JOINT_COMPLIANT]
    for joint, (record, load, rung) in enumerate(zip(records, loads, rungs, strict=False)):
        peak = PEAK_OVER_LOAD * load
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
    nothing = [0.0] * (len(_JOINT_ROWS) + 1 - len(springs))
    modes = rod_table(scene)[:1]
    stiff = [float(row[f"{name}_stiffness"]) for row in modes for name in FLEX]
    lossy = [float(row[f"{name}_damping"]) for row in modes for name in FLEX]
    rows = np.repeat([springs + nothing, dampers + nothing], 2, axis=1)
    return np.append(rows[0], stiff), np.append(rows[1], lossy)


def contact_frequency(scene: PumpScene) -> float:
    """Largest angular frequency of the mechanism on its undamped springs [rad/s].

    The springs are its contacts, and its rods if they are elastic.

    The effective mass of a joint depends on the direction; its least value over a revolution gives
    the fastest contact, and so the step. 0 if every joint is ideal and rods are rigid.
    """
    return max(
        math.sqrt(_largest(scene, throw, _springs_and_dampers(scene, throw)[0]))
        for throw in _different_throws(scene)
    )


@cached_by_scene
def contact_rate(scene: PumpScene) -> float:
    """Fastest rate of the damped contacts [1/s]: largest root of ``s^2 + C/m s + K/m``.

    The contact's angular frequency while it oscillates; above critical damping the faster of
    its two decay rates, which limits an explicit step.
    """
    return max(_rate(scene, throw) for throw in _different_throws(scene))


def _rate(scene: PumpScene, throw: int) -> float:
    springs, dampers = _springs_and_dampers(scene, throw)
    half, square = _largest(scene, throw, dampers) / 2, _largest(scene, throw, springs)
    return half + math.sqrt(half**2 - square) if half**2 > square else math.sqrt(square)


def _different_throws(scene: PumpScene) -> list[int]:
    """Throws whose joints differ from those of earlier ones: equal ones have equal rates."""
    seen: list[Any] = []
    found = []
    for throw in range(len(scene.throws)):
        key = (scene.joints(throw), scene.pressures(throw))
        if key not in seen:
            seen.append(key)
            found.append(throw)
    return found


def _worn_room(scene: PumpScene, part: RevoluteJoint | Guide) -> tuple[float, float]:
    """Radial clearance across the rod, and the eye's additional length along it [m]."""
    if isinstance(part, Guide) or scene.wear is None:
        return part.clearance_radial, 0.0
    slot = part.one_sided * max(part.clearance_diametral - scene.wear.as_new, 0.0)
    return part.clearance_radial - slot / 2, slot


@cached_by_scene
def contact_table(scene: PumpScene, throw: int) -> NDArray[np.void]:
    """Contact records of one throw: crank pin, wrist pin, guide; an ideal joint has an empty one.

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
        clearance, slot = _worn_room(scene, part)
        mobility = joint_mobility(scene, throw, joint)
        table[joint] = contact_record(part, clearance, loads[joint], mobility, slot)[0]
    table.flags.writeable = False
    return table


@cached_by_scene
def bore_table(scene: PumpScene) -> NDArray[np.void]:
    """Contact record of a crank's journal with play in its main bearings; empty without play.

    Returns
    -------
    numpy.ndarray [shape=(0 or 1,), dtype=CONTACT]
        Read-only.
    """
    part = scene.crank.bearing
    if part is None or not has_main_play(scene):
        return np.zeros(0, dtype=CONTACT)
    load, mobility = largest_bearing_load(scene), _crank_mobility(scene)
    record = contact_record(part, part.clearance_radial, load, mobility)
    record.flags.writeable = False
    return record
