"""The rungs of any scene, and what a run of it costs: both as its machine registers them."""

from ..machine.registry import machine_of
from ..scene.rungs import Effect
from ..scene.scene import Scene


def effects_of(scene: Scene) -> tuple[Effect, ...]:
    """Effects of a scene, each with its rungs; an effect that is absent has no entry.

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
    """Time that a run takes by the tables: predicted steps times tabulated cost [s].

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
"""Numerics of a run -> most of it within the validity of its rungs."""
