"""The propulsion shaft's physics, as registered for the program."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..journal.ladder import FILM_LADDER
from ..output.transfer import SceneTransfer
from ..scene.exciters import ShaftExciter
from ..scene.scene import Scene, SceneError
from ..scene.shaft import ShaftScene
from ..shaft.at_rest import shaft_state
from ..shaft.ladder import BEAM_RUNGS, shaft_cost, shaft_effects
from ..shaft.push import exciter_place
from ..shaft.recording import check_shaft, shaft_recorder, simulate_shaft
from ..shaft_response.places import Place
from ..shaft_response.receptance import accelerance
from .registry import MachinePhysics

Float = NDArray[np.float64]


def _transfer(scene: Scene, frequency: Float) -> SceneTransfer:
    line = cast(ShaftScene, scene)
    if (frequency <= 0).any():
        raise SceneError(
            scene.name, [f"frequency = {frequency.min():g} Hz must be > 0; raise the lowest"]
        )
    axes = {"up": "y", "side": "z"}
    sensors: list[Place] = [(s.bearing, axes[s.direction], "housing") for s in line.sensors]
    names = [*(b.name for b in line.bearings), *(disc.name for disc in line.discs), ""]
    known = [part for part in line.exciters if part.mounted or part.place in names]
    forces = {_key(part): exciter_place(line, part) for part in known}
    forces = forces or {f"{b.name}_up": (b.name, "y") for b in line.bearings}
    state = shaft_state(line)
    values = accelerance(
        state.rotor, frequency, sensors, list(forces.values()), speed=state.film.speed
    )
    return SceneTransfer(
        frequency=frequency,
        sensors=tuple(sensor.name for sensor in line.sensors),
        places=tuple(forces),
        values=np.ascontiguousarray(np.moveaxis(values, 0, -1)),
    )


def _key(part: ShaftExciter) -> str:
    """Name of an exciter's place: ``forward_up``, ``forward_housing_side``."""
    at = part.place or f"{part.station:g} m"
    return f"{at}{'_housing' * (part.part == 'housing')}_{part.direction}"


MACHINE = MachinePhysics(
    scene=ShaftScene,
    simulate=simulate_shaft,
    check=check_shaft,
    recorder=shaft_recorder,
    transfer=_transfer,
    ladders={"film": FILM_LADDER, "beam": BEAM_RUNGS},
    effects=shaft_effects,
    cost=shaft_cost,
)
