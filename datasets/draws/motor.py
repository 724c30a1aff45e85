"""Motors on the mains in recipes that draw a speed: the motor turns as fast as the label says.

A motor with ``synchronous_speed`` ignores ``drive.speed``, which is the label of a record. Where a
recipe draws ``drive.speed`` and not the motor's own, the motor is taken along, as by a converter.
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
"""Of ``drive.speed`` below ``synchronous_speed``: by so much, at most, the label can be wrong."""


def motor_speed(scene: Scene, speed: float) -> dict[str, float]:
    """Synchronous speed [Hz] by its path, at another drive.speed; empty where that governs it.

    Parameters
    ----------
    scene : Scene
    speed : float
        [Hz]

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
    """Synchronous speed of a record by its path; empty where drive.speed governs the motor.

    Parameters
    ----------
    base : mapping
        Table of the scene.
    drawn : mapping
        Dotted path -> value [SI].
    """
    if SPEED not in drawn:
        return {}
    without = {path: value for path, value in drawn.items() if path != SPEED}
    return motor_speed(scene_from_table(override(base, without)), drawn[SPEED])


def motors_to_take(
    base: Mapping[str, Any], axes: Iterable[Axis], choices: Sequence[Alternatives]
) -> list[tuple[float, float]]:
    """Speeds of the motors on the mains that a recipe takes along.

    Parameters
    ----------
    base : mapping
        Table of the scene.
    axes : iterable of Axis
        Of machines and records.
    choices : sequence of Alternatives

    Returns
    -------
    list of tuple of float
        ``drive.speed`` and ``synchronous_speed`` [Hz] of the scene and its options; empty where
        the recipe draws no speed, or that of the motor too.
    """
    options = [option for each in choices for option in each.options]
    drawn = {axis.path for axis in (*axes, *(axis for each in options for axis in each.axes))}
    if SPEED not in drawn or OWN in drawn:
        return []
    found = []
    for values in ({}, *(option.values for option in options)):
        with suppress(SceneError):  # told where the option is read
            drive: Any = getattr(scene_from_table(override(base, values)), "drive", None)
            if getattr(drive, "rung", "") == "motor" and drive.motor.synchronous_speed is not None:
                found.append((drive.speed, drive.motor.synchronous_speed))
    return list(dict.fromkeys(found))


def motor_faults(motors: Iterable[tuple[float, float]]) -> list[str]:
    """What keeps motors, of :func:`motors_to_take`, from turning as fast as the label says.

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
