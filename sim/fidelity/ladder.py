"""Rungs of any scene and cost of a run, as registered by its machine."""

from ..machine.registry import machine_of
from ..scene.rungs import Effect
from ..scene.scene import Scene


def effects_of(scene: Scene) -> tuple[Effect, ...]:
    """Effects of a scene, each with its rungs; absent effects are omitted.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    tuple of Effect

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> pump = load_scene("bilge-pump")
    >>> [(effect.name, effect.current(pump)) for effect in effects_of(pump)][:3]
    [('crankpin', 'compliant'), ('wristpin', 'ideal'), ('guide', 'ideal')]
    """
    return tuple(effect for effect in machine_of(scene).effects(scene) if effect.rungs)


def cost_of(scene: Scene) -> float:
    """Time of a run by the tables: predicted steps times tabulated cost [s].

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    float
        For ranking: the same on every machine.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> cheap = load_scene("bilge-pump", {"joint.crankpin.rung": "ideal"})
    >>> cost_of(cheap) < cost_of(load_scene("bilge-pump"))
    True
    """
    return machine_of(scene).cost(scene)


VALIDITY = {"tension_share": 0.0}
"""Numerics of a run -> largest value within the validity of its rungs."""
