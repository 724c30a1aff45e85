"""Correction of readings for known offsets and sensitivities of the sensors."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ...sim.output.recording import Recording
from ..healthy_reference.healthy import Baseline
from ..pages.si_text import si_text
from .nameplate import Nameplate

TABLES = ("sensors", "probes")
"""Tables of a scene that hold its sensors."""


def path_of_zero(scene: Any, name: str) -> str:
    """Dotted path of a probe's offset; formed from its name if the scene has no such probe.

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


def corrected_recording(
    recording: Recording, plate: Nameplate | None, baseline: Baseline | None = None
) -> Recording:
    """Recording as read by sensors without offset and with exact sensitivity.

    Parameters
    ----------
    recording : Recording
    plate : Nameplate or None
        Known errors of a sensor with the name of a channel are removed: ``sensors.0.offset`` and
        ``sensors.0.gain``, ``probes`` of shaft lines, set by the user or in the scene given. Those
        in a data set's own scene are not removed: a model was trained with them.
    baseline : Baseline, optional
        Healthy recordings of the same machine have the same sensors: nothing is removed.

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
    >>> corrected = corrected_recording(seen, nameplate_of(None, "journal-bearing", known))
    >>> bool(abs(corrected.signal - plain.signal).max() < 1e-6)
    True
    """
    signal = recording.signal
    for row, known in _corrections(recording, plate, baseline):
        signal = signal.copy() if signal is recording.signal else signal
        gain, offset = (np.float32(known[key]) for key in ("gain", "offset"))
        signal[row] = signal[row] / gain - offset
    return recording if signal is recording.signal else replace(recording, signal=signal)


def correction_words(
    recording: Recording, plate: Nameplate | None, baseline: Baseline | None = None
) -> str:
    """Corrections made by :func:`corrected_recording`; empty if there are none.

    Examples
    --------
    >>> from wearstate.diagnose.nameplate.nameplate import nameplate_of
    >>> plate = nameplate_of(None, "journal-bearing", {"sensors.0.offset": "20 um"})
    >>> recording = Recording.from_array(np.zeros((2, 8)), 1e3, channels=["probe_1", "probe_2"])
    >>> correction_words(recording, plate)
    'offset 20 um of probe_1'
    """
    words = []
    for row, known in _corrections(recording, plate, baseline):
        channel = recording.channels[row]
        each = [f"offset {si_text(known['offset'], 'm')}"] if known["offset"] else []
        each += [f"gain {known['gain']:g}"] if known["gain"] != 1 else []
        if each:
            words.append(f"{' and '.join(each)} of {channel.name}")
    return ", ".join(words)


def _corrections(
    recording: Recording, plate: Nameplate | None, baseline: Baseline | None
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Row of each channel with known sensor data, and these data."""
    if baseline is not None:
        return
    rows = {channel.name: i for i, channel in enumerate(recording.channels)}
    yield from ((rows[name], known) for name, known in _known_sensors(plate) if name in rows)


def known_zeros(plate: Nameplate | None) -> frozenset[str]:
    """Names of probes whose offset is known."""
    return frozenset(name for name, known in _known_sensors(plate) if known["zero"])


def _known_sensors(plate: Nameplate | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Channels of each sensor with known gain or offset; what is unknown is one or zero."""
    if plate is None:
        return
    for table in TABLES:
        for i, sensor in enumerate(getattr(plate.scene, table, ())):
            known = {
                key: getattr(sensor, key)
                for key in ("gain", "offset")
                if hasattr(sensor, key)
                and (f"{table}.{i}.{key}" in plate.set_paths or _unusual(plate, sensor, key))
            }
            if known:
                known = {"gain": 1.0, "offset": 0.0, "zero": "offset" in known, **known}
                yield from ((name, known) for name in _channels_of(sensor))


def _unusual(plate: Nameplate, sensor: Any, key: str) -> bool:
    """Whether a scene given by the user differs here from a faultless sensor."""
    return plate.given and getattr(sensor, key) != {"gain": 1.0, "offset": 0.0}[key]


def _channels_of(sensor: Any) -> list[str]:
    """Names of a sensor's channels: a triaxial accelerometer has one for each axis."""
    return [f"{sensor.name}_{axis}" for axis in getattr(sensor, "axes", ())] or [sensor.name]
