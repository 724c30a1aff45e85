"""Picture of a test before and after: transfer functions and peaks that changed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..pages.page import short_name
from .before_after import BeforeAfter
from .peak_changes import PeakChange, level_db
from .rig_setup import RigError

_COLOURS = ("#1f5a94", "#b3541e")
_DARK = {"before": "#0c2742", "after": "#4d2209"}
_SHOWN_DB = 80.0  # of a picture, from the highest peak down


def rig_figure(
    result: BeforeAfter,
    *,
    channels: Sequence[str] | None = None,
    title: bool = True,
) -> Any:
    """Accelerance at the bearings before and after, with confidence, model and coherence.

    Parameters
    ----------
    result : BeforeAfter
    channels : sequence of str, optional
        Channels to draw; by default all.
    title : bool
        Write a title above the picture; a page has its own.

    Returns
    -------
    matplotlib.figure.Figure
        One column per channel: level with confidence band and model, coherence below.

    Raises
    ------
    RigError
        A channel is unknown.
    """
    from matplotlib.figure import Figure

    names = list(result.before.channels if channels is None else channels)
    unknown = sorted(set(names) - set(result.before.channels))
    if unknown:
        known = ", ".join(result.before.channels)
        raise RigError(f"channels = {', '.join(unknown)} must be of {known}")
    figure = Figure(figsize=(1 + 3.6 * len(names), 5.6), layout="constrained")
    if title:
        name = short_name(result.scene, 60)
        figure.suptitle(f"{name}: accelerance before and after the moves (simulated test)")
    panels = figure.subplots(
        2, len(names), sharex=True, sharey="row", height_ratios=[3, 1], squeeze=False
    )
    highest = max(float(level_db(t.model).max()) for t in (result.before, result.after))
    for name, pair in zip(names, panels.T, strict=True):
        _draw_channel(pair, result, name)
    level, coherence = panels[:, 0]
    level.set_ylim(highest - _SHOWN_DB, highest + _SHOWN_DB / 10)
    level.set_ylabel("accelerance [dB re 1 (m/s²)/N]")
    coherence.set_ylabel("coherence")
    panels[0, -1].legend(fontsize=8, loc="lower right")
    return figure


def _draw_channel(column: Any, result: BeforeAfter, name: str) -> None:
    row = result.before.channels.index(name)
    for test, colour, label in (
        (result.before, _COLOURS[0], "before"),
        (result.after, _COLOURS[1], "after"),
    ):
        frf = test.frf
        low, high = (level_db(side[row]) for side in frf.magnitude_interval)
        level = level_db(frf.value[row])
        # A disc that contains zero has no lower bound in dB: cut 20 dB below the estimate.
        low = np.maximum(low, level - 20)
        column[0].fill_between(frf.frequency, low, high, color=colour, alpha=0.25, lw=0)
        column[0].plot(frf.frequency, level, color=colour, lw=0.9, label=f"{label}, test")
        column[0].plot(
            frf.frequency,
            level_db(test.model[row]),
            color=_DARK[label],
            lw=0.7,
            ls=(0, (4, 3)),
            label=f"{label}, model",
        )
        column[1].plot(frf.frequency, frf.coherence[row], color=colour, lw=0.7)
    _mark(column[0], [peak for peak in result.changes if peak.channel == name])
    column[0].set_title(short_name(name, 30), fontsize=10)
    column[1].set(xlabel="frequency [Hz]", ylim=(0, 1.02))
    for axes in column:
        axes.grid(alpha=0.3)
        axes.margins(x=0)


def _mark(axes: Any, changes: Sequence[PeakChange]) -> None:
    """Write the change next to each peak that changed significantly."""
    for peak in changes:
        if peak.verdict == "unchanged":
            continue
        axes.annotate(
            f"{peak.change:+.1f} dB",
            (peak.frequency_before, peak.level_before),
            xytext=(0, 6),
            textcoords="offset points",
            ha="left",
            rotation=60,
            fontsize=8,
        )
