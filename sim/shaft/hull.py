"""Effect of the hull on a line: it shakes the pedestals at the blade rate and at engine orders.

A foundation that moves by s exerts ``k s + c s'`` on the housing through its pedestal, the same as
on a housing at rest. This is its only effect on the line, so that hull vibration is exactly a
harmonic force on every housing; films and shaft respond as to any other force.
"""

import cmath
import math
from collections.abc import Iterator

from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import EngineTone, Housing, HullBladeTone
from ..shaft_response.places import Place
from ..shaft_response.time_response import Harmonic


def hull_forces(scene: ShaftScene) -> tuple[Harmonic, ...]:
    """Forces of the hull's vibration on the housings, with phases at the first sample.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    tuple of Harmonic
        Those of the blade rate, in phase with the shaft, then those of the engines; tones without
        velocity are omitted.

    Notes
    -----
    A tone of the complex velocity V at the angular frequency w moves the foundation of a share h by
    ``h V / (i w)`` and exerts ``(k + i w c) h V / (i w)`` on its housing.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> hull_forces(load_scene("propulsion-shaft"))
    ()
    >>> shaking = load_scene("propulsion-shaft", {"hull.blade_tones.0.up": "1 mm/s"})
    >>> force = hull_forces(shaking)[0]
    >>> force.frequency, round(abs(force.forces["stern_aft", "y", "housing"]))  # 2 GN/m x 8 um
    (20.0, 15916)
    """
    return tuple(
        Harmonic(frequency=hertz, forces=pushed)
        for hertz, start, tone in _tones(scene)
        if (pushed := _pushed(scene, hertz, start, tone))
    )


def hull_orders(scene: ShaftScene) -> tuple[int, ...]:
    """Orders of the shaft's speed at which the hull vibrates.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> hull_orders(load_scene("propulsion-shaft", {"hull.blade_tones.1.side": "1 mm/s"}))
    (8,)
    """
    if scene.propeller is None:
        return ()
    blades = scene.propeller.blades
    return tuple(t.harmonic * blades for t in scene.hull.blade_tones if t.up or t.side)


def engine_rate_faults(scene: ShaftScene) -> list[str]:
    """Engine tones at or above half the sample rate, as sentences."""
    return [
        f"hull.engines.{i}.tones.{k}: order {tone.order:g} of {engine.speed:g} Hz = "
        f"{tone.order * engine.speed:g} Hz must be < half of sample_rate = "
        f"{scene.sample_rate:g} Hz; raise the rate or leave the tone out"
        for i, engine in enumerate(scene.hull.engines)
        for k, tone in enumerate(engine.tones)
        if (tone.up or tone.side) and tone.order * engine.speed >= scene.sample_rate / 2
    ]


def _tones(scene: ShaftScene) -> Iterator[tuple[float, float, HullBladeTone | EngineTone]]:
    """Each tone with its frequency [Hz] and its angle at the first sample [rad]."""
    if scene.propeller is not None:
        for tone in scene.hull.blade_tones:
            order = tone.harmonic * scene.propeller.blades
            yield order * scene.drive.speed, order * scene.drive.start_angle, tone
    for engine in scene.hull.engines:
        for each in engine.tones:
            yield each.order * engine.speed, 0.0, each


def _pushed(
    scene: ShaftScene, hertz: float, start: float, tone: HullBladeTone | EngineTone
) -> dict[Place, complex]:
    """Amplitudes of a tone's forces on the housings [N]."""
    up, side = (
        velocity * cmath.exp(1j * (start + phase))
        for velocity, phase in ((tone.up, tone.up_phase), (tone.side, tone.side_phase))
    )
    found: dict[Place, complex] = {}
    for bearing in scene.bearings:
        over_up, over_side = _over_velocity(bearing.housing, math.tau * hertz)
        found[bearing.name, "y", "housing"] = over_up * up
        found[bearing.name, "z", "housing"] = over_side * side
    return {place: force for place, force in found.items() if force != 0}


def _over_velocity(housing: Housing, omega: float) -> tuple[complex, complex]:
    """Force on a housing per velocity of the hull, up and to the side [N s/m]."""
    return (
        housing.hull_share_up * complex(housing.damping_up, -housing.stiffness_up / omega),
        housing.hull_share_side * complex(housing.damping_side, -housing.stiffness_side / omega),
    )
