"""Transfer functions of a scene as the model has them: what a perfect test would measure."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..pump.recording import casing_modes, measured_casing, measured_places
from ..scene.parts import Scene, SceneError
from ..scene.pump import FORCE_PLACES, PumpScene
from ..scene.shaft import ShaftExciter, ShaftScene
from ..shaft.push import exciter_place
from ..shaft.recording import shaft_state
from ..shaft.response import Place, accelerance

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class SceneTransfer:
    """Accelerance from places that are pushed to accelerometers.

    Attributes
    ----------
    frequency : ndarray, shape (n_lines,)
        [Hz]
    sensors, places : tuple of str
    values : ndarray, shape (n_sensors, n_places, n_lines)
        Complex, ``exp(+j w t)`` [(m/s^2)/N].
    """

    frequency: Float
    sensors: tuple[str, ...]
    places: tuple[str, ...]
    values: Complex


def scene_transfer(scene: Scene, frequency: Float) -> SceneTransfer:
    """Accelerance of a scene from every place of its forces, or of its exciters.

    Parameters
    ----------
    scene : Scene
        A pump: its casing, from the forces of the mechanism and from the places of its exciters. A
        shaft line, running: from the places of its exciters, mounted or not; without any, from
        every bearing's journal, up.
    frequency : ndarray, shape (n_lines,)
        [Hz]; of a measured casing the lines of its file between the first and the last of these.

    Returns
    -------
    SceneTransfer

    Raises
    ------
    SceneError
        The machine has neither casing nor line; a file of the casing cannot be used; or a line of
        a shaft was asked for at or below 0 Hz.
    ShaftFilmError
        Beam and films find no balance.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = scene_transfer(load_scene("bilge-pump"), np.array([142.0, 388.0]))
    >>> found.sensors, found.places[:2], found.values.shape
    (('acc_x', 'acc_y'), ('bearing_x', 'bearing_y'), (2, 4, 2))
    """
    for kind, function in _TRANSFERS:
        if isinstance(scene, kind):
            return function(scene, np.asarray(frequency, dtype=np.float64))
    raise SceneError(
        scene.name,
        [
            f"machine = '{scene.machine}' has no transfer function here, must be one of "
            "reciprocating-pump and propulsion-shaft"
        ],
    )


def _of_pump(scene: Scene, frequency: Float) -> SceneTransfer:
    assert isinstance(scene, PumpScene)
    sensors = tuple(sensor.name for sensor in scene.accelerometers)
    measured = measured_casing(scene)
    if measured is not None:
        inside = (measured.frequency >= frequency[0]) & (measured.frequency <= frequency[-1])
        return SceneTransfer(
            frequency=measured.frequency[inside],
            sensors=sensors,
            places=measured_places(scene),
            values=measured.values[..., inside],
        )
    places = _pump_places(scene)
    modes = casing_modes(scene, places)
    omega, natural = math.tau * frequency, math.tau * modes.frequency[:, None]
    receptance = 1 / (natural**2 - omega**2 + 2j * modes.damping_ratio[:, None] * natural * omega)
    values = np.einsum("mo,mi,ml->oil", modes.outputs, modes.inputs, -(omega**2) * receptance)
    return SceneTransfer(frequency=frequency, sensors=sensors, places=places, values=values)


def _pump_places(scene: PumpScene) -> tuple[str, ...]:
    """Places of forces that the modes know, then those of exciters."""
    known = {key: None for mode in scene.casing.modes for key in mode.shape}
    forces = [key for key in known if key.startswith(FORCE_PLACES)]
    pushed = [part.place for part in scene.exciters if part.place in known]
    return tuple(dict.fromkeys([*forces, *pushed]))


def _of_shaft(scene: Scene, frequency: Float) -> SceneTransfer:
    assert isinstance(scene, ShaftScene)
    if (frequency <= 0).any():
        raise SceneError(
            scene.name, [f"frequency = {frequency.min():g} Hz must be > 0; raise the lowest"]
        )
    axes = {"up": "y", "side": "z"}
    sensors: list[Place] = [(s.bearing, axes[s.direction], "housing") for s in scene.sensors]
    names = [*(b.name for b in scene.bearings), *(disc.name for disc in scene.discs), ""]
    known = [part for part in scene.exciters if part.mounted or part.place in names]
    forces = {_key(part): exciter_place(scene, part) for part in known}
    forces = forces or {f"{b.name}_up": (b.name, "y") for b in scene.bearings}
    state = shaft_state(scene)
    values = accelerance(
        state.rotor, frequency, sensors, list(forces.values()), speed=state.film.speed
    )
    return SceneTransfer(
        frequency=frequency,
        sensors=tuple(sensor.name for sensor in scene.sensors),
        places=tuple(forces),
        values=np.ascontiguousarray(np.moveaxis(values, 0, -1)),
    )


def _key(part: ShaftExciter) -> str:
    """Name of a place that is pushed: ``forward_up``, ``forward_housing_side``."""
    at = part.place or f"{part.station:g} m"
    return f"{at}{'_housing' * (part.part == 'housing')}_{part.direction}"


_TRANSFERS: tuple[tuple[type[Scene], Callable[[Scene, Float], SceneTransfer]], ...] = (
    (PumpScene, _of_pump),
    (ShaftScene, _of_shaft),
)
"""Transfer functions of every machine that has any. A new machine is one row."""
