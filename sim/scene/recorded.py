"""From a scene to its recording: faults of its length, and the simulator's signals in channels."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..output.recording import Recording
from ..output.status import Status
from .scene import Scene, channels_of

MEMORY = 4e9  # byte, limit of one run: a data set runs one per core


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


def duration_faults(scene: Scene, revolution: float) -> list[str]:
    """Find a recording shorter than one revolution [s]."""
    if scene.duration >= revolution:
        return []
    return [
        f"duration = {scene.duration:g} s must be >= one revolution = {revolution:g} s; "
        "record longer"
    ]


def tacho_faults(scene: Scene, revolution: float) -> list[str]:
    """Find a tacho pulse shorter than two samples, given the time of a revolution [s]."""
    if not scene.tacho or scene.tacho.pulse_width / math.tau * revolution >= 2 / scene.sample_rate:
        return []
    return [
        f"tacho.pulse_width = {scene.tacho.pulse_width:g} rad must last >= 2 samples; "
        "widen the pulse or raise sample_rate"
    ]


def memory_faults(scene: Scene, needed: float) -> list[str]:
    """Find a recording whose memory [byte] exceeds the limit."""
    if needed <= MEMORY:
        return []
    return [
        f"duration = {scene.duration:g} s at sample_rate = {scene.sample_rate:g} Hz needs "
        f"{needed / 1e9:.3g} GB, must be <= {MEMORY / 1e9:g} GB; shorten it or lower the rate"
    ]
