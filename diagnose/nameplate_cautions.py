"""Where a nameplate is not what a model was trained on: nothing in the signals need show it."""

import math
from collections.abc import Mapping
from typing import Any

from ..datasets.recipe import CONDITIONS, condition_of
from ..sim.parts import Scene
from ..sim.scene import load_scene, scene_names
from .nameplate import Nameplate

_SAME = 0.02  # over the trained value: nameplates are rounded
_BUILT: dict[str, tuple[tuple[str, str], ...]] = {
    "journal-bearing": (
        ("bearing.diameter", "m"),
        ("bearing.length", "m"),
        ("rotor.mass", "kg"),
        ("load.static_across", "N"),
    ),
}
"""Machine -> what of its nameplate recipes leave as it is, with units."""


def nameplate_cautions(
    plate: Nameplate | None, row: Mapping[str, Any], card: Mapping[str, Any]
) -> tuple[str, ...]:
    """What a person should know before trusting a model on a machine.

    Parameters
    ----------
    plate : Nameplate or None
    row : mapping
        What was noted beside the recording; conditions in it are judged by the model itself.
    card : mapping
        Of the model.

    Returns
    -------
    tuple of str
        Of each condition or size outside what the model was trained on.
    """
    if plate is None:
        return ()
    day = plate.on_the_day(row, None)
    return (*_outside(day, plate, row, card), *_otherwise_built(day, card["trained_on"]["scene"]))


def _outside(
    day: Scene, plate: Nameplate, row: Mapping[str, Any], card: Mapping[str, Any]
) -> list[str]:
    found = []
    for condition in card["conditions"]:
        name, unit = condition["name"], condition["unit"]
        if condition["feature"] or name not in CONDITIONS or _noted(name, plate, row):
            continue
        try:
            value = condition_of(day, name)
        except (AttributeError, IndexError, KeyError, TypeError):
            continue  # the scene is of another machine
        if not condition["low"] <= value <= condition["high"]:
            found.append(
                f"{name} = {value:.4g} {unit} by the nameplate is outside the trained range "
                f"{condition['low']:.4g} to {condition['high']:.4g} {unit}: extrapolating"
            )
    return found


def _noted(name: str, plate: Nameplate, row: Mapping[str, Any]) -> bool:
    """Whether the manifest's own value holds: the model looks at it itself."""
    value = row.get(name)
    there = isinstance(value, float | int) and math.isfinite(value)
    return there and not plate.was_told(CONDITIONS[name])


def _otherwise_built(day: Any, trained: str) -> list[str]:
    """Sizes that differ from those of the scene that the model was trained on."""
    if trained not in scene_names():
        return []
    usual: Any = load_scene(trained)
    if usual.machine != day.machine:
        return [f"the nameplate is of a {day.machine}, the model of a {usual.machine}"]
    found = []
    for path, unit in _BUILT.get(day.machine, ()):
        mine, theirs = _value(day, path), _value(usual, path)
        scale = max(abs(theirs), _LEAST_FORCE if unit == "N" else 0.0)
        if abs(mine - theirs) > _SAME * scale:
            found.append(
                f"{path} = {mine:.4g} {unit} by the nameplate, the model was trained at "
                f"{theirs:.4g} {unit} and knows no other: see the film equilibrium"
            )
    return found


_LEAST_FORCE = 1e3  # N: a component that the trained scene has none of is told from 20 N on


def _value(scene: Any, path: str) -> float:
    for name in path.split("."):
        scene = getattr(scene, name)
    return float(scene)
