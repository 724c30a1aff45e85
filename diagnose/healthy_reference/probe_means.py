"""Shaft position in a recording: mean readings of its proximity probes, and its speed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.order import pulse_times
from ...sim.output.recording import Recording

Float = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ProbeMeans:
    """Measured input of a static equilibrium.

    Attributes
    ----------
    names : tuple of str
        Displacement channels, in the order of the recording.
    means, swings : numpy.ndarray [shape=(n_probes,)]
        Mean reading and rms about it [m].
    speed_hz : float or None
        Speed of the shaft, from the tacho, else as noted.
    row : mapping
        Conditions noted with the recording.
    """

    names: tuple[str, ...]
    means: Float
    swings: Float
    speed_hz: float | None
    row: Mapping[str, Any]


def probe_means(recording: Recording) -> ProbeMeans:
    """Mean readings in a recording; empty without probes.

    Examples
    --------
    >>> from ...sim.output.sensor import Channel
    >>> probe = Channel(name="probe_1", unit="m", quantity="displacement")
    >>> still = Recording(signal=np.full((1, 8), 1e-5), sample_rate=8.0, channels=(probe,))
    >>> found = probe_means(still)
    >>> found.names, float(found.means[0].round(9)), found.speed_hz
    (('probe_1',), 1e-05, None)
    """
    channels = recording.vibration_channels
    rows = [i for i, channel in enumerate(channels) if channel.quantity == "displacement"]
    readings = recording.vibration[rows].astype(np.float64)
    return ProbeMeans(
        names=tuple(channels[i].name for i in rows),
        means=readings.mean(axis=-1),
        swings=readings.std(axis=-1),
        speed_hz=_speed(recording),
        row=recording.row,
    )


def _speed(recording: Recording) -> float | None:
    tacho = recording.tacho_signal
    if tacho is None:
        return recording.declared_speed_hz
    try:
        pulses = pulse_times(tacho, recording.sample_rate)
    except ValueError:
        return None
    turns = (len(pulses) - 1) / recording.pulses_per_revolution
    return float(turns / (pulses[-1] - pulses[0]))
