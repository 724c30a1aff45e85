"""Main results of a simulated run, in a few lines, and the same in SI."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...datasets.generation.machines import Truth
from ...datasets.generation.truths import truths_of
from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from ..machines.registry import presentation_of
from ..pages.si_text import si_text


def simulation_summary(scene: Scene, solution: Recording) -> dict[str, Any]:
    """Levels of the channels, and results known only to the simulator.

    Parameters
    ----------
    scene : Scene
    solution : Recording
        Recording with its truth.

    Returns
    -------
    dict
        ``channels``: rms and peak about the mean of each but the tacho, with mean and unit;
        ``truth``: value [SI], unit and meaning by name.
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
        Summary from :func:`simulation_summary`.

    Returns
    -------
    list of str
    """
    truth = {
        name: Truth(row["value"], row["unit"], row["meaning"])
        for name, row in summary["truth"].items()
    }
    lines = presentation_of(scene).lines(truth)
    return [f"  {what:11}{text}" for what, text in (*lines, *_channel_lines(summary["channels"]))]


def _channel_lines(channels: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for i, (name, row) in enumerate(channels.items()):
        rms, peak = si_text(row["rms"], row["unit"]), si_text(row["peak"], row["unit"])
        yield "" if i else "level", f"{name}: rms {rms}, peak {peak} about the mean"
