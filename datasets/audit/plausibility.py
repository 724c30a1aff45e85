"""Implausible properties of records: the checks of :mod:`.plausibility`, for files."""

import json
import math

from ...features.rotation.order import pulse_times
from ...sim.output.recording import Recording
from ...sim.scene.load import scene_from_table
from ...sim.scene.plausibility import (
    Doubt,
    Seen,
    Signal,
    record_doubts,
    scene_doubts,
    sensor_limits,
)
from ...sim.scene.scene import Scene
from ..file.attributes import Attributes
from ..recipe.load import recorded_scene


def scene_in(head: Attributes) -> Scene | None:
    """Scene of a file before any draws; None if it holds none.

    Examples
    --------
    >>> from wearstate.sim.output.sensor import Channel
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> scene_in(Attributes(sample_rate=1e3, channels=(channel,), origin="measured")) is None
    True
    """
    if not head.scene:
        return None
    try:
        if head.scene.startswith("{"):  # one recording, with its scene as it was run
            return scene_from_table(json.loads(head.scene))
        return recorded_scene(head.scene, head.recipe, head.overrides)
    except ValueError:  # of another version; reported by the check of the recipe
        return None


def doubts_of(
    signal: Signal, head: Attributes | Recording, scene: Scene | None, speed_hz: float
) -> tuple[Doubt, ...]:
    """Implausible properties of one record.

    Parameters
    ----------
    signal : numpy.ndarray [shape=(n_channels, n_samples)]
        Signal, finite.
    head : Attributes or Recording
        Source of rate, channels and tacho.
    scene : Scene or None
        Scene whose sensors recorded the signal.
    speed_hz : float
        Shaft speed by the manifest; NaN if unknown, then it is determined from the tacho.

    Returns
    -------
    tuple of Doubt
    """
    full_scale, noise = sensor_limits(scene) if scene is not None else ({}, {})
    turns = speed_hz * signal.shape[1] / head.sample_rate
    if not math.isfinite(turns) or turns <= 0:
        turns = _counted_turns(signal, head)
    return record_doubts(
        Seen(
            signal=signal,
            sample_rate=head.sample_rate,
            channels=head.channels,
            tacho=head.tacho,
            turns=turns,
            full_scale=full_scale,
            noise=noise,
        )
    )


def _tacho_row(head: Attributes | Recording) -> int:
    return [channel.name for channel in head.channels].index(str(head.tacho))


def _counted_turns(signal: Signal, head: Attributes | Recording) -> float:
    """Revolutions by the tacho; NaN without one, or if it has too few pulses."""
    if head.tacho is None:
        return math.nan
    try:
        pulses = pulse_times(signal[_tacho_row(head)], head.sample_rate)
    except ValueError:  # no swing: reported elsewhere
        return math.nan
    speed = (len(pulses) - 1) / head.pulses_per_revolution / float(pulses[-1] - pulses[0])
    return float(speed * signal.shape[1] / head.sample_rate)


def recording_doubts(
    recording: Recording, scene: Scene | None = None, *, scene_too: bool = False
) -> tuple[Doubt, ...]:
    """Implausible properties of a recording.

    Parameters
    ----------
    recording : Recording
    scene : Scene, optional
        Scene whose sensors recorded the signal.
    scene_too : bool
        Whether the scene was run without further draws: doubts about it then apply to the
        recording.

    Returns
    -------
    tuple of Doubt

    Examples
    --------
    >>> import numpy as np
    >>> from wearstate.sim.output.sensor import Channel
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> short = Recording(
    ...     signal=np.sin(np.arange(100.0))[None], sample_rate=100.0, channels=(channel,),
    ...     row={"speed_hz": 6.0},
    ... )
    >>> [doubt.check for doubt in recording_doubts(short)]
    ['few revolutions']
    """
    speed = recording.declared_speed_hz
    found = doubts_of(recording.signal, recording, scene, math.nan if speed is None else speed)
    if scene is None or not scene_too:
        return found
    reported = {doubt.check for doubt in found}
    return (*found, *(doubt for doubt in scene_doubts(scene) if doubt.check not in reported))
