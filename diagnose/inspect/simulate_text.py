"""What a user asks first of a simulated run, in a few lines, and the same in SI."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...datasets.generation.truths import Truth, truths_of
from ...sim.output.recording import Recording
from ...sim.scene.parts import Scene
from ..pages.si_text import plain, si_text

Truths = Mapping[str, Truth]


def simulation_summary(scene: Scene, solution: Recording) -> dict[str, Any]:
    """Levels of the channels, and what the simulator alone knows.

    Parameters
    ----------
    scene : Scene
    solution : Recording
        With its truth.

    Returns
    -------
    dict
        ``channels``: rms and peak about the mean of each but the tacho, with mean and unit;
        ``truth``: name -> value [SI], unit, meaning.
    """
    return {
        "channels": {
            channel.name: {**_levels(row), "unit": channel.unit}
            for channel, row in zip(solution.channels, solution.signal, strict=True)
            if channel.quantity != "tacho"
        },
        "truth": {
            name: {"value": each.value, "unit": each.unit, "meaning": each.words}
            for name, each in truths_of(solution, scene).items()
        },
    }


def _levels(row: Any) -> dict[str, float]:
    values = np.asarray(row, dtype=np.float64)
    about = values - values.mean()
    return {
        "mean": float(values.mean()),
        "rms": float(np.sqrt(np.mean(np.square(about)))),
        "peak": float(np.abs(about).max()),
    }


def summary_lines(scene: Scene, summary: Mapping[str, Any]) -> list[str]:
    """A summary as lines for a terminal.

    Parameters
    ----------
    scene : Scene
    summary : mapping
        Of :func:`simulation_summary`.

    Returns
    -------
    list of str
    """
    truth = {
        name: Truth(row["value"], row["unit"], row["meaning"])
        for name, row in summary["truth"].items()
    }
    told = _MACHINES[scene.machine](truth)
    return [f"  {what:11}{text}" for what, text in (*told, *_channel_lines(summary["channels"]))]


def _channel_lines(channels: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for i, (name, row) in enumerate(channels.items()):
        rms, peak = si_text(row["rms"], row["unit"]), si_text(row["peak"], row["unit"])
        yield "" if i else "level", f"{name}: rms {rms}, peak {peak} about the mean"


def _of(truth: Truths, name: str) -> str:
    return si_text(truth[name].value, truth[name].unit)


def _pump(truth: Truths) -> Iterator[tuple[str, str]]:
    if "contacts_per_turn" not in truth:
        yield "pump", "at rest"
        return
    pins = [name for name in truth if name.startswith("pin_peak")]
    for name in pins:
        throw = name.removeprefix("pin_peak")
        number = (throw.removeprefix("_") or "1") if len(pins) > 1 else ""
        force = f"peak {_of(truth, name)} (mean over revolutions), "
        force += f"rms {_of(truth, f'pin_rms{throw}')}"
        if f"wrist_peak{throw}" in truth:
            force += f"; wrist pin {_of(truth, f'wrist_peak{throw}')}"
            force += f", guide {_of(truth, f'guide_peak{throw}')} peak"
        yield f"pin {number}".strip(), force
        if f"pressure_lowest{throw}" in truth:
            low, high = (_of(truth, f"pressure_{end}{throw}") for end in ("lowest", "highest"))
            ratio = truth.get(f"pressure_ratio{throw}")
            about = f", ratio {plain(ratio.value, 3)} absolute" if ratio else ""
            yield f"pressure {number}".strip(), f"{low} to {high} gauge{about}"
    contacts = truth["contacts_per_turn"].value
    yield "contacts", f"{plain(contacts, 2)} in a revolution, all joints with clearance"


def _journal(truth: Truths) -> Iterator[tuple[str, str]]:
    place = f"mean eccentricity ratio {plain(truth['eccentricity'].value)}"
    if "attitude_angle" in truth:
        place += f", attitude angle {_of(truth, 'attitude_angle')}"
    yield "journal", place
    yield (
        "orbit",
        f"{_of(truth, 'orbit_rms')} rms, {_of(truth, 'orbit_largest')} at most from there",
    )
    pressure = f"; peak pressure {_of(truth, 'pressure_peak')}" if "pressure_peak" in truth else ""
    yield "film", f"thinnest {_of(truth, 'film_least')}{pressure}"


def _shaft(truth: Truths) -> Iterator[tuple[str, str]]:
    bearings = [
        name.removeprefix("reaction_")
        for name in truth
        if name.startswith("reaction_") and name != "reaction_sum"
    ]
    shown = ", ".join(f"{name} {_of(truth, f'reaction_{name}')}" for name in bearings)
    yield "reactions", f"{shown}; in all {_of(truth, 'reaction_sum')}"
    places = []
    for name in bearings:
        up, side = truth[f"up_{name}"].value, truth[f"side_{name}"].value
        angle = math.degrees(math.atan2(side, -up))
        places.append(f"{name} {si_text(math.hypot(up, side), 'm')} at {plain(angle)} deg")
    yield "journals", f"{', '.join(places)} from straight down"
    yield "film", f"thinnest {_of(truth, 'film_least')}"


_MACHINES = {
    "reciprocating-pump": _pump,
    "journal-bearing": _journal,
    "propulsion-shaft": _shaft,
}
"""Lines of every machine. A new machine is one row."""
