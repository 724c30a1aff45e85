"""Readings without what a person told of the sensors: known offsets and sensitivities."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ...sim.output.recording import Recording
from ..feature_rows.healthy import Baseline
from .nameplate import Nameplate

TABLES = ("sensors", "probes")
"""Of a scene, that hold what senses it."""


def path_of_zero(scene: Any, name: str) -> str:
    """Dotted path of a probe's offset; the name stands for itself where the scene has no such.

    Examples
    --------
    >>> from wearstate import load_scene
    >>> path_of_zero(load_scene("propulsion-shaft"), "probe_2")
    'probes.1.offset'
    """
    found = (
        f"{table}.{i}.offset"
        for table in TABLES
        for i, sensor in enumerate(getattr(scene, table, ()))
        if sensor.name == name
    )
    return next(found, f"sensors.{name}.offset")


def as_told(
    recording: Recording, plate: Nameplate | None, baseline: Baseline | None = None
) -> Recording:
    """A recording as sensors without offset and of exact sensitivity would have read it.

    Parameters
    ----------
    recording : Recording
    plate : Nameplate or None
        What a person told of a sensor whose name a channel has is taken out: ``sensors.0.offset``
        and ``sensors.0.gain``, ``probes`` of shaft lines. A scene's own numbers are not: a model
        learnt with them.
    baseline : Baseline, optional
        Healthy recordings of the same machine have the same sensors: nothing is taken out.

    Returns
    -------
    Recording

    Examples
    --------
    >>> from wearstate import load_scene, simulate
    >>> from wearstate.diagnose.nameplate.nameplate import nameplate_of
    >>> known = {"sensors.0.offset": "20 um", "sensors.0.gain": 1.25}
    >>> short = {"duration": 0.05, "settling_revolutions": 1, "film.rung": "short"}
    >>> seen = simulate(load_scene("journal-bearing", {**short, **known}), seed=1)
    >>> plain = simulate(load_scene("journal-bearing", short), seed=1)
    >>> told = as_told(seen, nameplate_of(None, "journal-bearing", known))
    >>> bool(abs(told.signal - plain.signal).max() < 1e-6)
    True
    """
    if plate is None or baseline is not None:
        return recording
    signal = recording.signal
    for name, told in _told(plate):
        rows = [i for i, channel in enumerate(recording.channels) if channel.name == name]
        if rows:
            signal = signal.copy() if signal is recording.signal else signal
            gain, offset = (np.float32(told[key]) for key in ("gain", "offset"))
            signal[rows] = signal[rows] / gain - offset
    return recording if signal is recording.signal else replace(recording, signal=signal)


def known_zeros(plate: Nameplate | None) -> frozenset[str]:
    """Names of probes whose offset a person told."""
    return frozenset(name for name, told in _told(plate) if told["zero"])


def _told(plate: Nameplate | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each sensor of which something was told: its gain and offset, one and zero where not told."""
    if plate is None:
        return
    for table in TABLES:
        for i, sensor in enumerate(getattr(plate.scene, table, ())):
            told = {
                key: getattr(sensor, key)
                for key in ("gain", "offset")
                if f"{table}.{i}.{key}" in plate.told
            }
            if told:
                known = {"gain": 1.0, "offset": 0.0, "zero": "offset" in told, **told}
                yield from ((name, known) for name in _channels_of(sensor))


def _channels_of(sensor: Any) -> list[str]:
    """Names of a sensor's channels: a triaxial accelerometer has one for each axis."""
    return [f"{sensor.name}_{axis}" for axis in getattr(sensor, "axes", ())] or [sensor.name]
