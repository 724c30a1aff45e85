"""Closed form of an ideal mechanism: motion, pressure and seal, loads of the joints."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.closed_forms import IdealCrank, ideal_crank
from ..hydraulics.piston_pressure import line_pressure
from ..jit import kernel
from ..mechanism.layout import THROW
from ..mechanism.throw_motion import seal_drag
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import CHAMBER_RUNGS, PIPED_RUNGS
from .joints import cached_by_scene, gravity_along_and_across, hydraulics_under, piston_area

LOAD_ANGLES = 360  # per revolution, for the forces of an ideal mechanism


def ideal_motion(scene: PumpScene, angle: NDArray[np.float64], throw: int = 0) -> IdealCrank:
    """Inverse dynamics of a throw without clearance at constant speed.

    Parameters
    ----------
    scene : PumpScene
    angle : numpy.ndarray
        Crank angle of the first throw [rad].
    throw : int
        Throw, counted from 0.

    Returns
    -------
    IdealCrank
        With the pressure of the scene's rung; a chamber, which has a memory, is replaced by its two
        levels.
    """
    speed = 2 * math.pi * scene.drive.speed
    gravity_x, gravity_y = gravity_along_and_across(scene)
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
    liquid, seal = forces_on_piston(scene, motion, own, throw)
    return ideal_crank(own, piston_force=-(liquid + seal), **known)


def bearing_load(scene: PumpScene, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force of the crank on its main bearings without play at constant speed (x, y) [N].

    Includes its own weight, if ``crank.mass`` is given, and its unbalance.

    Parameters
    ----------
    scene : PumpScene
    angle : numpy.ndarray [shape=(n,)]
        Crank angle of the first throw [rad].

    Returns
    -------
    numpy.ndarray [shape=(2, n)]
    """
    weight, first = gravity_along_and_across(scene), angle + scene.throws[0].phase
    flung = scene.crank.unbalance * (2 * math.pi * scene.drive.speed) ** 2
    load = flung * np.stack([np.cos(first), np.sin(first)])
    load -= (scene.crank.mass or 0.0) * np.array(weight)[:, None]
    for throw in range(len(scene.throws)):
        motion = ideal_motion(scene, angle, throw)
        load -= np.stack([motion.pin_force_x, motion.pin_force_y])
    return np.asarray(load)


@cached_by_scene
def largest_bearing_load(scene: PumpScene) -> float:
    """Largest of :func:`bearing_load` over a revolution [N]."""
    load = bearing_load(scene, np.linspace(0.0, 2 * math.pi, LOAD_ANGLES, endpoint=False))
    return float(np.hypot(*load).max())


def forces_on_piston(
    scene: PumpScene, motion: IdealCrank, own: NDArray[np.float64], throw: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Forces of liquid and seal along x on the piston of a mechanism without clearance [N].

    `own` are the throw's own crank angles [rad].
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
    for name, value in seal_numbers(scene).items():
        record[name] = value
    return record


def seal_numbers(scene: PumpScene) -> dict[str, float]:
    """Friction of the seal, by its fields in the table of throws."""
    piston = scene.piston
    return {
        "seal_friction": piston.seal_friction,
        "seal_friction_area": piston.seal_friction_share * piston_area(scene),
        "seal_friction_speed": piston.seal_friction_speed,
    }


def _without_memory(scene: PumpScene, throw: int) -> NDArray[np.void]:
    pressure = scene.pressures(throw)
    if pressure.rung in CHAMBER_RUNGS:
        suction, discharge = pressure.suction, pressure.discharge
        if pressure.rung in PIPED_RUNGS:
            suction, discharge = pressure.at_pump
        levels = {"rung": "two-level", "suction": suction, "discharge": discharge}
        pressure = pressure.model_copy(update=levels)
    return hydraulics_under(scene, pressure)


@cached_by_scene
def joint_loads(scene: PumpScene, throw: int) -> tuple[float, float, float]:
    """Largest forces of crank pin, wrist pin and guide over a revolution, without clearance [N]."""
    motion = ideal_motion(scene, np.linspace(0.0, 2 * math.pi, LOAD_ANGLES, endpoint=False), throw)
    return (
        float(np.hypot(motion.pin_force_x, motion.pin_force_y).max()),
        float(np.hypot(motion.wrist_force_x, motion.wrist_force_y).max()),
        float(np.abs(motion.guide_force).max()),
    )
