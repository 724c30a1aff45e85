"""Oil films of the joints: maps, temperature, tables of the kernels, start."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bearing.heat import film_temperature, friction_power
from ..contact.asperities import asperity_scale
from ..film.impedance_map import ImpedanceMap, impedance_map
from ..film.solve import FilmGeometry
from ..mechanism.layout import FILM, JOINT_OILED, Tables
from ..mechanism.oiled_joint import OIL
from ..scene.pump import PumpScene
from ..scene.pump_joints import OILED_RUNGS, RevoluteJoint
from .contacts import PEAK_OVER_LOAD, bore_table, tangent_stiffness
from .ideal_motion import (
    LOAD_ANGLES,
    bearing_load,
    ideal_motion,
    joint_loads,
    largest_bearing_load,
)
from .joints import cached_by_scene, joint_parts

_WALL_PER_STEP = (
    0.7  # least damping of a wall behind oil, over stiffness times step: RK4 resolves it
)
_DEEPEST_START = 0.9  # largest eccentricity at the start of a film


def joint_maps(scene: PumpScene) -> dict[float, ImpedanceMap]:
    """Film maps that the joints of a scene need, by length over diameter of their lands."""
    ratios = sorted(
        {
            _land(part) / part.pin_diameter
            for throw in range(len(scene.throws))
            for part in (*joint_parts(scene, throw)[:2], scene.crank.bearing)
            if part is not None and runs_on_a_map(part)
        }
    )
    return {
        ratio: impedance_map(FilmGeometry(length_to_diameter=ratio, n_theta=_N_THETA, n_z=_N_Z))
        for ratio in ratios
    }


_N_THETA, _N_Z = 144, 33  # load capacity within half a percent of published tables up to e = 0.95


def runs_on_a_map(part: RevoluteJoint) -> bool:
    """Whether a film of finite length is used: a starved one is narrow, and counts as short."""
    if part.oil is None:
        return False
    return part.rung == "film-map" or (part.rung == "mixed" and part.oil.filled_gap is None)


def _land(part: RevoluteJoint) -> float:
    """Length of film between two unpressurised ends [m]."""
    assert part.oil is not None
    both = part.oil.length - part.oil.groove_width
    return both / 2 if part.oil.groove_width > 0 else both


def oil_table(
    scene: PumpScene, throw: int, contacts: NDArray[np.void], maps: dict[float, Any], step: float
) -> NDArray[np.void]:
    """Oil records of crank pin and wrist pin of one throw; zeros without oil.

    Parameters
    ----------
    scene : PumpScene
    throw : int
        Throw, counted from 0.
    contacts : numpy.ndarray [shape=(3,), dtype=CONTACT]
        Contacts of the throw.
    maps : dict
        Result of :func:`joint_maps`.
    step : float
        Integration step [s].

    Returns
    -------
    numpy.ndarray [shape=(2,), dtype=OIL]
    """
    table = np.zeros(2, dtype=OIL)
    loads = joint_loads(scene, throw)
    for joint, part in enumerate(joint_parts(scene, throw)[:2]):
        if isinstance(part, RevoluteJoint) and part.oil is not None and part.rung in OILED_RUNGS:
            warm = film_temperature_of(scene, throw, joint)
            values = _oil_values(part, warm, contacts[joint], loads[joint], maps, step)
            for name, value in values.items():
                table[joint][name] = value
    return table


def bore_oil_table(scene: PumpScene, maps: dict[float, Any], step: float) -> NDArray[np.void]:
    """Oil record of main bearings with play; zeros if they are dry, empty without play.

    Returns
    -------
    numpy.ndarray [shape=(0 or 1,), dtype=OIL]
    """
    part, contact = scene.crank.bearing, bore_table(scene)
    table = np.zeros(len(contact), dtype=OIL)
    if part is None or part.rung not in OILED_RUNGS:
        return table
    warm = bore_temperature(scene)
    values = _oil_values(part, warm, contact[0], largest_bearing_load(scene), maps, step)
    for name, value in values.items():
        table[name] = value
    return table


@cached_by_scene
def film_temperature_of(scene: PumpScene, throw: int, joint: int) -> float | None:
    """Film temperature of a pin, by its heat balance [K].

    Parameters
    ----------
    scene : PumpScene
    throw, joint : int
        Counted from 0; joint 0 is the crank pin, 1 the wrist pin.

    Returns
    -------
    float or None
        None if the scene has no heat balance for the pin: its oil has the scene's temperature.
    """
    part = joint_parts(scene, throw)[joint]
    if not isinstance(part, RevoluteJoint) or not _is_heated(part):
        return None
    return _heat_balance(part, *_usual_spin_and_load(scene, throw)[joint])


@cached_by_scene
def bore_temperature(scene: PumpScene) -> float | None:
    """Film temperature of the main bearings [K]; None as in :func:`film_temperature_of`."""
    part = scene.crank.bearing
    if part is None or not _is_heated(part):
        return None
    load = bearing_load(scene, np.linspace(0.0, math.tau, LOAD_ANGLES, endpoint=False))
    usual = math.sqrt(float(np.mean(np.sum(load**2, axis=0))))
    return _heat_balance(part, math.tau * scene.drive.speed, usual)


def _is_heated(part: RevoluteJoint) -> bool:
    """Whether a joint has a film with a heat balance."""
    if part.rung not in OILED_RUNGS or part.oil is None:
        return False
    return bool(part.oil.carried_per_kelvin) and part.oil.temperature is not None


def _heat_balance(part: RevoluteJoint, spin: float, load: float) -> float:
    """Temperature of a film [K] from the root mean squares of its spin [rad/s] and load [N]."""
    oil = part.oil
    assert oil is not None
    assert oil.temperature is not None
    assert oil.carried_per_kelvin
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

    return film_temperature(oil.temperature, power, oil.carried_per_kelvin)


def _usual_spin_and_load(scene: PumpScene, throw: int) -> list[tuple[float, float]]:
    """Root mean squares of the spin [rad/s] and load [N] of crank pin and wrist pin."""
    angle = np.linspace(0.0, math.tau, LOAD_ANGLES, endpoint=False)
    motion = ideal_motion(scene, angle, throw)
    turning = math.tau * scene.drive.speed
    # sin(beta) = (r / l) sin(a): the rod swings relative to crank and piston
    ratio, own = scene.crank.radius / scene.rod.length, angle + scene.throws[throw].phase
    swing = turning * ratio * np.cos(own) / np.sqrt(1 - (ratio * np.sin(own)) ** 2)

    def usual(values: NDArray[np.float64]) -> float:
        return math.sqrt(float(np.mean(values**2)))

    crank = np.hypot(motion.pin_force_x, motion.pin_force_y)
    wrist = np.hypot(motion.wrist_force_x, motion.wrist_force_y)
    return [(usual(turning + swing), usual(crank)), (usual(swing), usual(wrist))]


def _oil_values(
    part: RevoluteJoint,
    warm: float | None,
    contact: Any,
    load: float,
    maps: dict[float, Any],
    step: float,
) -> dict[str, float]:
    oil, gap, radius = part.oil, part.clearance_radial, part.pin_diameter / 2
    assert oil is not None
    viscosity = oil.dynamic_viscosity if warm is None else oil.viscosity_at(warm)
    land = _land(part)
    lands = 2 if oil.groove_width > 0 else 1
    rough = oil.roughness if part.rung == "mixed" and oil.roughness else 0.0
    peaks = (
        asperity_scale(rough, radius, lands * land, gap, oil.asperity_stiffness) if rough else 0.0
    )
    spring = tangent_stiffness(contact, PEAK_OVER_LOAD * load)
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


def deepest_start(offset: NDArray[np.float64], contact: Any) -> NDArray[np.float64]:
    """Initial film position of a pin at an offset from its eye's centre [m]."""
    most, size = _DEEPEST_START * float(contact["clearance"]), float(np.hypot(*offset))
    return offset * min(1.0, most / size) if size > 0 else offset


def start_films(
    t: Tables, bodies: NDArray[np.float64], angle: float, journal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Film positions of the pins at the start; zeros without oil.

    `journal` is the initial state of the crank's journal in its main bearing [shape=(6,)].

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
        crank = journal[:2] + q["crank_radius"] * np.array([math.cos(own), math.sin(own)])
        offsets = (
            crank - np.array([x, y]) + q["rod_arm"] * turn,
            np.array([piston - x, across - y]) - q["rod_centre"] * turn,
        )
        for joint, rung in enumerate((q["crankpin_rung"], q["wristpin_rung"])):
            if rung == JOINT_OILED:
                films[throw, 2 * joint : 2 * joint + 2] = deepest_start(
                    offsets[joint], t.contacts[throw, joint]
                )
    return films
