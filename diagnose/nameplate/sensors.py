"""Readings without what a person told of the sensors: known offsets and sensitivities."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ...sim.output.recording import Recording
from ..healthy_reference.healthy import Baseline
from ..pages.si_text import si_text
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
        and ``sensors.0.gain``, ``probes`` of shaft lines, set or in the scene that was given. The
        numbers of a data set's own scene are not: a model learnt with them.
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
    signal = recording.signal
    for row, told in _taken_out(recording, plate, baseline):
        signal = signal.copy() if signal is recording.signal else signal
        gain, offset = (np.float32(told[key]) for key in ("gain", "offset"))
        signal[row] = signal[row] / gain - offset
    return recording if signal is recording.signal else replace(recording, signal=signal)


def taken_out_words(
    recording: Recording, plate: Nameplate | None, baseline: Baseline | None = None
) -> str:
    """What :func:`as_told` takes out, empty where that is nothing.

    Examples
    --------
    >>> from wearstate.diagnose.nameplate.nameplate import nameplate_of
    >>> plate = nameplate_of(None, "journal-bearing", {"sensors.0.offset": "20 um"})
    >>> recording = Recording.from_array(np.zeros((2, 8)), 1e3, channels=["probe_1", "probe_2"])
    >>> taken_out_words(recording, plate)
    'offset 20 um of probe_1'
    """
    words = []
    for row, told in _taken_out(recording, plate, baseline):
        channel = recording.channels[row]
        each = [f"offset {si_text(told['offset'], 'm')}"] if told["offset"] else []
        each += [f"gain {told['gain']:g}"] if told["gain"] != 1 else []
        if each:
            words.append(f"{' and '.join(each)} of {channel.name}")
    return ", ".join(words)


def _taken_out(
    recording: Recording, plate: Nameplate | None, baseline: Baseline | None
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Row of each channel of which something was told, and what."""
    if baseline is not None:
        return
    rows = {channel.name: i for i, channel in enumerate(recording.channels)}
    yield from ((rows[name], told) for name, told in _told(plate) if name in rows)


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
                if hasattr(sensor, key)
                and (f"{table}.{i}.{key}" in plate.told or _unusual(plate, sensor, key))
            }
            if told:
                known = {"gain": 1.0, "offset": 0.0, "zero": "offset" in told, **told}
                yield from ((name, known) for name in _channels_of(sensor))


def _unusual(plate: Nameplate, sensor: Any, key: str) -> bool:
    """Whether a scene that a person gave has another number than a sensor without faults."""
    return plate.given and getattr(sensor, key) != {"gain": 1.0, "offset": 0.0}[key]


def _channels_of(sensor: Any) -> list[str]:
    """Names of a sensor's channels: a triaxial accelerometer has one for each axis."""
    return [f"{sensor.name}_{axis}" for axis in getattr(sensor, "axes", ())] or [sensor.name]
