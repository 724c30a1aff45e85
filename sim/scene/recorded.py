"""Recording of a scene: the simulator's signals under the names given in the scene."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..output.recording import Recording
from ..output.status import Status
from .scene import Scene, channels_of


def recorded(scene: Scene, signal: NDArray[np.float32], **about: Any) -> Recording:
    """Create the recording of a simulated scene.

    Parameters
    ----------
    scene : Scene
        Gives the channels, the sample rate and the tacho.
    signal : ndarray of shape (n_channels, n_samples)
        Signal in the unit of each channel.
    **about
        Status, warnings, truth and numerics, see :class:`~..output.recording.Recording`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("bilge-pump", {"duration": "1 s"})
    >>> recorded(scene, np.zeros((3, 25600), dtype=np.float32))
    <Recording bilge-pump 1 s, 25.6 kHz, acc_x acc_y tacho>
    """
    return Recording(
        signal=signal,
        sample_rate=scene.sample_rate,
        channels=channels_of(scene),
        tacho=None if scene.tacho is None else scene.tacho.name,
        origin="simulated",
        source=scene.name,
        **about,
    )


def failed(scene: Scene, status: Status, numerics: dict[str, float | int | str]) -> Recording:
    """Create the recording of a failed run: zeros, and the status with the cure.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> failed(load_scene("bilge-pump"), Status.OVERLAP, {}).status.name
    'OVERLAP'
    """
    n_samples = round(scene.duration * scene.sample_rate)
    silence = np.zeros((len(channels_of(scene)), n_samples), dtype=np.float32)
    return recorded(scene, silence, status=status, numerics=numerics)
