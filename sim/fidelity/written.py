"""Rungs and values of a scene as written."""

import math
from typing import Any

from ..machine.registry import machine_of
from ..scene.rungs import Effect, Rung, admissible, with_values
from ..scene.scene import Scene
from .ladder import cost_of

_SAME = 1e-9  # relative tolerance of equal values


def written_rung(effect: Effect, scene: Scene) -> Rung:
    """Rung of an effect in a scene as written.

    Parameters
    ----------
    effect : Effect
        Effect of this scene.
    scene : Scene

    Returns
    -------
    Rung
        Rung of the ladder with the same values, else one that changes nothing.

    Examples
    --------
    >>> from wearstate.sim.fidelity.ladder import effects_of
    >>> from wearstate.sim.scene.load import load_scene
    >>> pump = load_scene("bilge-pump")  # writes no step: its contact needs no more than x2
    >>> [written_rung(effect, pump).name for effect in effects_of(pump)][-3:]
    ['constant-speed', 'driven', 'x2']
    """
    for rung in effect.rungs:
        if all(_has(scene, path, value) for path, value in rung.values.items()):
            return rung
    return Rung(name=effect.current(scene), assumes="as written")


def _has(scene: Scene, path: str, value: Any) -> bool:
    own = default_step(scene) if path == "numerics.step" else value_at(scene, path)
    if isinstance(value, float) and own is not None:
        return math.isclose(own, value, rel_tol=_SAME)
    return bool(own == value)


def value_at(scene: Scene, path: str) -> Any:
    """Value of a scene at a dotted path; None if there is none."""
    node: Any = scene
    for key in path.split("."):
        node = node[int(key)] if isinstance(node, tuple) else getattr(node, key, None)
    return node


def default_step(scene: Scene) -> float | None:
    """Step of a scene's run [s]; None for a machine without steps."""
    step = machine_of(scene).step
    return None if step is None else step(scene)


def ladder(effect: Effect, scene: Scene) -> tuple[Rung, ...]:
    """Admissible rungs, including the scene's own, cheapest first."""
    rungs = list(admissible(effect, scene))
    written = written_rung(effect, scene)
    if written.name not in [rung.name for rung in rungs]:
        own = cost_of(scene)
        costlier = (i for i, r in enumerate(rungs) if cost_of(with_values(scene, r.values)) > own)
        rungs.insert(next(costlier, len(rungs)), written)
    return tuple(rungs)
