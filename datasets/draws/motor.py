"""Mains-fed motors in recipes that draw a speed: the synchronous speed follows the label.

A motor with ``synchronous_speed`` ignores ``drive.speed``, which is the label of a record. If a
recipe draws ``drive.speed`` and not the motor's own speed, the motor is scaled with it, as with a
frequency converter.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from ...sim.scene.load import override, scene_from_table
from ...sim.scene.scene import Scene, SceneError
from .draws import Axis
from .options import Alternatives

SPEED, OWN = "drive.speed", "drive.motor.synchronous_speed"
LARGEST_SLIP = 0.05
"""Largest slip of ``drive.speed`` below ``synchronous_speed`` [-]: the largest error of the
label."""


def motor_speed(scene: Scene, speed: float) -> dict[str, float]:
    """Synchronous speed [Hz] by its path at another drive.speed; empty if that one counts.

    Parameters
    ----------
    scene : Scene
    speed : float
        Speed [Hz].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> mains = {"drive.rung": "motor", "drive.motor.synchronous_speed": "306 rpm"}
    >>> motor_speed(load_scene("bilge-pump", mains), 4.0)
    {'drive.motor.synchronous_speed': 4.08}
    >>> motor_speed(load_scene("bilge-pump", {"drive.rung": "motor"}), 4.0)
    {}
    """
    drive = getattr(scene, "drive", None)
    motor = getattr(drive, "motor", None)
    if drive is None or motor is None or motor.synchronous_speed is None:
        return {}
    return {OWN: motor.synchronous_speed / drive.speed * speed}


def taken_along(base: Mapping[str, Any], drawn: Mapping[str, Any]) -> dict[str, float]:
    """Synchronous speed of a record by its path; empty if drive.speed determines the speed.

    Parameters
    ----------
    base : mapping
        Table of the scene.
    drawn : mapping
        Drawn values [SI] by dotted path.
    """
    if SPEED not in drawn:
        return {}
    without = {path: value for path, value in drawn.items() if path != SPEED}
    return motor_speed(scene_from_table(override(base, without)), drawn[SPEED])


def motors_to_take(
    base: Mapping[str, Any], axes: Iterable[Axis], choices: Sequence[Alternatives]
) -> list[tuple[float, float]]:
    """Speeds of the mains-fed motors that a recipe scales with the drawn speed.

    Parameters
    ----------
    base : mapping
        Table of the scene.
    axes : iterable of Axis
        Draws of machines and records.
    choices : sequence of Alternatives

    Returns
    -------
    list of tuple of float
        ``drive.speed`` and ``synchronous_speed`` [Hz] of the scene and its options; empty if the
        recipe draws no speed, or that of the motor too.
    """
    options = [option for each in choices for option in each.options]
    drawn = {axis.path for axis in (*axes, *(axis for each in options for axis in each.axes))}
    if SPEED not in drawn or OWN in drawn:
        return []
    found = []
    for values in ({}, *(option.values for option in options)):
        with suppress(SceneError):  # reported where the option is read
            drive: Any = getattr(scene_from_table(override(base, values)), "drive", None)
            if getattr(drive, "rung", "") == "motor" and drive.motor.synchronous_speed is not None:
                found.append((drive.speed, drive.motor.synchronous_speed))
    return list(dict.fromkeys(found))


def motor_faults(motors: Iterable[tuple[float, float]]) -> list[str]:
    """Faults of motors (see :func:`motors_to_take`) whose speed differs from the label.

    Examples
    --------
    >>> motor_faults([(5.0, 5.1)])
    []
    """
    return [
        f"{SPEED} = {speed:g} must be >= {(1 - LARGEST_SLIP) * own:g} and <= {OWN} = {own:g} where "
        "the recipe draws it: records would be labelled with a speed that the motor does not have; "
        f"set {SPEED}, give drive.motor.rated_slip instead, or draw {OWN} too"
        for speed, own in motors
        if not (1 - LARGEST_SLIP) * own <= speed <= own
    ]
