"""The reciprocating pump's physics, as registered for the program."""

import math
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..output.transfer import SceneTransfer
from ..pump.gathering import casing_modes, measured_casing, measured_places
from ..pump.ladder import PUMP_LADDERS, pump_cost, pump_effects, sample_step
from ..pump.recording import check_pump, simulate_pump
from ..pump_lanes.many import pumps_alike, simulate_pumps
from ..scene.pump import FORCE_PLACES, PumpScene
from ..scene.scene import Scene
from .registry import MachinePhysics

Float = NDArray[np.float64]


def _transfer(scene: Scene, frequency: Float) -> SceneTransfer:
    pump = cast(PumpScene, scene)
    sensors = tuple(sensor.name for sensor in pump.accelerometers)
    measured = measured_casing(pump)
    if measured is not None:
        inside = (measured.frequency >= frequency[0]) & (measured.frequency <= frequency[-1])
        return SceneTransfer(
            frequency=measured.frequency[inside],
            sensors=sensors,
            places=measured_places(pump),
            values=measured.values[..., inside],
        )
    places = _places(pump)
    modes = casing_modes(pump, places)
    omega, natural = math.tau * frequency, math.tau * modes.frequency[:, None]
    receptance = 1 / (natural**2 - omega**2 + 2j * modes.damping_ratio[:, None] * natural * omega)
    values = np.einsum("mo,mi,ml->oil", modes.outputs, modes.inputs, -(omega**2) * receptance)
    return SceneTransfer(frequency=frequency, sensors=sensors, places=places, values=values)


def _places(scene: PumpScene) -> tuple[str, ...]:
    """Places of forces in the modes, then those of exciters."""
    known = {key: None for mode in scene.casing.modes for key in mode.shape}
    forces = [key for key in known if key.startswith(FORCE_PLACES)]
    pushed = [part.place for part in scene.exciters if part.place in known]
    return tuple(dict.fromkeys([*forces, *pushed]))


MACHINE = MachinePhysics(
    scene=PumpScene,
    simulate=simulate_pump,
    many=simulate_pumps,
    alike=pumps_alike,
    check=check_pump,
    transfer=_transfer,
    ladders=PUMP_LADDERS,
    effects=pump_effects,
    cost=pump_cost,
    step=sample_step,
)
