"""Whether a recording has the channels, units, tacho and sample rate that a model needs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from ...sim.output.sensor import Channel
from ..feature_rows.model_card import LayoutCard, ModelCard
from .fault import QualityFault
from .samples import sample_faults

Float = NDArray[np.float64]

RATE_TOLERANCE = 1e-3
"""Relative tolerance of the sample rate [-]: band edges move by the same factor."""


def recording_faults(recording: Recording, card: ModelCard) -> tuple[QualityFault, ...]:
    """Find everything that makes a recording and its views unusable as inputs of a model.

    Parameters
    ----------
    recording : Recording
    card : ModelCard
        Card of the model.

    Returns
    -------
    tuple of QualityFault
        Layout faults if there are any, else faults of the samples; a missing view is a fault.
    """
    faults = [*(layout_faults(recording, card) or sample_faults(recording))]
    views = card.views
    for view, layout in views.items():
        if view not in recording.joined:
            text = f"view {view} is missing, which the model needs; give --join {view}=FILE"
            faults.append(QualityFault(kind="layout", channel="", text=text))
            continue
        other = recording.joined[view]
        found = layout_faults(other, layout) or sample_faults(other)
        faults += [replace(fault, text=f"view {view}: {fault.text}") for fault in found]
    strange = sorted(set(recording.joined) - set(views))
    if strange:
        known = ", ".join(views) or "none"
        text = f"views {', '.join(strange)} are joined, the model knows {known}: leave them out"
        faults.append(QualityFault(kind="layout", channel="", text=text))
    return tuple(faults)


def layout_faults(recording: Recording, card: LayoutCard) -> tuple[QualityFault, ...]:
    """Compare channels, units, tacho and rate of a recording with what a model needs.

    Parameters
    ----------
    recording : Recording
    card : LayoutCard
        Inputs of the model.

    Returns
    -------
    tuple of QualityFault
        All differences; empty if the recording fits.
    """
    unnamed = _unnamed_tacho(recording, card)
    vibration = [c for c in recording.vibration_channels if c.name != unnamed]
    return (
        *_channel_faults(vibration, card),
        *_tacho_layout_faults(recording, card),
        *_rate_faults(recording.sample_rate, card.sample_rate_hz),
    )


def _unnamed_tacho(recording: Recording, card: LayoutCard) -> str | None:
    """Channel with the name of the model's tacho, in a recording that declares no tacho."""
    there = recording.tacho is None and card.tacho in recording.names
    return card.tacho if there else None


def _channel_faults(found: Sequence[Channel], card: LayoutCard) -> list[QualityFault]:
    wanted = [c for c in card.channels if c.name != card.tacho]
    units = {c.name: c.unit for c in wanted}
    names = ", ".join(c.name for c in wanted)
    faults = []
    if len(found) != len(wanted):
        text = f"it has {len(found)} vibration channel(s), the model needs {len(wanted)}: {names}"
        text += _mapping([c.name for c in found], [c.name for c in wanted])
        faults.append(QualityFault(kind="layout", channel="", text=text))
    elif [c.name for c in found] != [c.name for c in wanted]:
        here = ", ".join(c.name for c in found)
        text = f"its channels are {here}, the model needs {names}, in this order"
        text += _mapping([c.name for c in found], [c.name for c in wanted])
        faults.append(QualityFault(kind="layout", channel="", text=text))
    for c in found:
        # a channel of unknown name may have any unit that the model uses
        unit = units.get(c.name, c.unit if c.unit in units.values() else next(iter(units.values())))
        if c.unit != unit:
            text = f"channel {c.name} is in {c.unit or 'an unknown unit'}, the model needs {unit}"
            faults.append(QualityFault(kind="unit", channel=c.name, text=text))
    return faults


def _mapping(found: Sequence[str], wanted: Sequence[str]) -> str:
    """Name the missing channels, and the option that maps others to them.

    Examples
    --------
    >>> _mapping(["ch1", "ch2", "z"], ["x", "y", "z"])
    '; missing x, y: if ch1, ch2 are these, give --channels x=ch1,y=ch2,z'
    >>> _mapping(["x"], ["x", "y"])
    '; missing y'
    """
    missing = [name for name in wanted if name not in found]
    spare = [name for name in found if name not in wanted]
    if not missing:
        return f": give --channels {','.join(wanted)}"
    lacking = f"; missing {', '.join(missing)}"
    if len(spare) < len(missing):
        return lacking
    stand = dict(zip(missing, spare, strict=False))
    names = ",".join(f"{name}={stand[name]}" if name in stand else name for name in wanted)
    return f"{lacking}: if {', '.join(stand.values())} are these, give --channels {names}"


def _tacho_layout_faults(recording: Recording, card: LayoutCard) -> list[QualityFault]:
    if (recording.tacho is None) != (card.tacho is None):
        needs = "it has no tacho, the model needs one; record one, or name it: --tacho CHANNEL"
        if unnamed := _unnamed_tacho(recording, card):
            needs = f"its channel {unnamed} is not named as its tacho; give --tacho {unnamed}"
        text = needs if card.tacho else "it has a tacho, the model was trained without"
        return [QualityFault(kind="tacho" if card.tacho else "layout", channel="", text=text)]
    if recording.pulses_per_revolution != card.pulses_per_revolution:
        text = (
            f"its tacho gives {recording.pulses_per_revolution} pulses per revolution, the model "
            f"needs {card.pulses_per_revolution}"
        )
        return [QualityFault(kind="layout", channel=recording.tacho or "", text=text)]
    return []


def _rate_faults(found: float, wanted: float) -> list[QualityFault]:
    if abs(found / wanted - 1) <= RATE_TOLERANCE:
        return []
    cure = "resample" if found > wanted else "record faster, or train a model on such recordings"
    text = f"it is sampled at {found:g} Hz, the model needs {wanted:g} Hz: {cure}"
    return [QualityFault(kind="rate", channel="", text=text)]
