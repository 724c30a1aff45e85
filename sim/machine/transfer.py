"""Transfer functions of a scene's model, as a perfect test would measure them."""

import numpy as np
from numpy.typing import NDArray

from ..output.transfer import SceneTransfer
from ..scene.scene import Scene, SceneError
from .registry import machine_of


def scene_transfer(scene: Scene, frequency: NDArray[np.float64]) -> SceneTransfer:
    """Accelerance of a scene from the places of its forces or exciters.

    Parameters
    ----------
    scene : Scene
        A pump: its casing, from the places of the mechanism's forces and of its exciters. A
        shaft line, running: from the places of its exciters, mounted or not; without any, from
        every bearing's journal, upwards.
    frequency : ndarray, shape (n_lines,)
        Frequencies [Hz]; for a measured casing, the lines of its file within their range.

    Returns
    -------
    SceneTransfer

    Raises
    ------
    SceneError
        The machine has neither casing nor line; a file of the casing cannot be used; or a frequency
        of a shaft line is at or below 0 Hz.
    ShaftFilmError
        Beam and films have no equilibrium.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = scene_transfer(load_scene("bilge-pump"), np.array([142.0, 388.0]))
    >>> found.sensors, found.places[:2], found.values.shape
    (('acc_x', 'acc_y'), ('bearing_x', 'bearing_y'), (2, 4, 2))
    """
    transfer = machine_of(scene).transfer
    if transfer is None:
        fault = f"machine = '{scene.machine}' has no transfer function; measure it"
        raise SceneError(scene.name, [fault])
    return transfer(scene, np.asarray(frequency, dtype=np.float64))
