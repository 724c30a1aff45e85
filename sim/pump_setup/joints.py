"""Joints and cylinder of every throw of a scene, as codes of the kernels."""

import math
from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.parameters import hydraulic_parameters
from ..mechanism.layout import JOINT_COMPLIANT, JOINT_IDEAL, JOINT_LINK, JOINT_OILED
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import CylinderPressure
from ..scene.pump_joints import OILED_RUNGS, Guide, RevoluteJoint

JOINT_CODES = {
    "ideal": JOINT_IDEAL,
    "link": JOINT_LINK,
    "compliant": JOINT_COMPLIANT,
    **dict.fromkeys(OILED_RUNGS, JOINT_OILED),
}
"""Rung of a joint in the scene -> code of the kernels, from the cheapest to the best."""

Result = TypeVar("Result")


def cached_by_scene(function: Callable[..., Result]) -> Callable[..., Result]:
    """Cache the latest results of a function of a scene, and of a throw if it takes one.

    Scenes are frozen, and several checks of one run need the same results; the cached ones are
    read-only. A scene is identified by its id: hashing all its values takes as long as
    most of these functions.
    """
    found: OrderedDict[tuple[int, ...], tuple[PumpScene, Result]] = OrderedDict()

    @wraps(function)
    def kept(scene: PumpScene, *throw: int) -> Result:
        key = (id(scene), *throw)
        _, result = found.get(key) or (scene, function(scene, *throw))
        found[key] = scene, result  # the cached scene keeps its id from being reused
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


def has_main_play(scene: PumpScene) -> bool:
    """Whether the crank has play in its main bearings, and so moves as a body."""
    return scene.crank.bearing is not None and scene.crank.bearing.rung != "ideal"


def hydraulics_of(scene: PumpScene, throw: int) -> NDArray[np.void]:
    """Hydraulics of one throw, as one record."""
    return hydraulics_under(scene, scene.pressures(throw))


def hydraulics_under(scene: PumpScene, pressure: CylinderPressure) -> NDArray[np.void]:
    """Hydraulics for one pressure of the scene, as one record."""
    return hydraulic_parameters(
        pressure,
        area=piston_area(scene),
        crank_radius=scene.crank.radius,
        rod_length=scene.rod.length,
        speed=2 * math.pi * scene.drive.speed,
    )


def piston_area(scene: PumpScene) -> float:
    """Area of the piston under the liquid's pressure [m^2]."""
    return math.pi / 4 * scene.piston.diameter**2


def gravity_along_and_across(scene: PumpScene) -> tuple[float, float]:
    """Gravity along the stroke and across it [m/s^2]."""
    return (
        scene.gravity * math.sin(scene.stroke_inclination),
        scene.gravity * math.cos(scene.stroke_inclination),
    )
