"""Pictures of a recording, measured or simulated: a table of kinds.

A kind first computes its data and makes a panel of them, or reports what the recording lacks; only
then is anything drawn.
"""

import difflib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from ...sim.output.recording import DataError
from .envelope import envelope_panel
from .frf import frf_panel
from .maps import angle_panel, orders_panel, waterfall_panel
from .orbit import orbit_panel
from .panel import LackError, Panel, columns_of, sheet
from .spectrum import spectrum_panel, waveform_panel
from .view import View

AUTO = "auto"
"""Kind that stands for all kinds that the recording supports, on one sheet."""

KINDS: dict[str, Callable[[View], Panel]] = {
    "waveform": waveform_panel,
    "spectrum": spectrum_panel,
    "waterfall": waterfall_panel,
    "orders": orders_panel,
    "angle": angle_panel,
    "envelope": envelope_panel,
    "frf": frf_panel,
    "orbit": orbit_panel,
}
"""Function that computes each kind; a new kind is one function and one row."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """A figure of one or more panels.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    panels : tuple of Panel
        Its panels.
    drawn : tuple of str
        Kinds drawn.
    left_out : dict
        Reason for each kind that is left out.
    """

    figure: Any
    panels: tuple[Panel, ...]
    drawn: tuple[str, ...]
    left_out: dict[str, str]


def plot_recording(view: View, kind: str = AUTO) -> Picture:
    """Draw a recording.

    Parameters
    ----------
    view : View
        The recording, and what to draw of it.
    kind : str
        Key of :data:`KINDS`, or ``auto`` for all that the recording supports on one sheet.

    Returns
    -------
    Picture

    Raises
    ------
    DataError
        If the kind is unknown, or the recording lacks what it needs.

    Examples
    --------
    >>> import numpy as np
    >>> from wearstate.sim.output.recording import Recording
    >>> from wearstate.sim.output.sensor import Channel
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> wave = np.sin(np.arange(4096))[np.newaxis]
    >>> view = View(recording=Recording(signal=wave, sample_rate=1e3, channels=(channel,)))
    >>> picture = plot_recording(view)
    >>> picture.drawn
    ('waveform', 'spectrum', 'waterfall', 'envelope')
    >>> picture.left_out["orbit"]
    'needs 2 displacement channels, has 0; record two proximity probes at right angles'
    """
    if kind != AUTO:
        panel = make_panel(view, kind)
        figure = sheet(view.heading, [[panel]])
        return Picture(figure=figure, panels=(panel,), drawn=(kind,), left_out={})
    panels, left_out = [], {}
    for name in KINDS:
        try:
            panels.append(computed(KINDS[name], view))
        except LackError as lack:
            left_out[name] = str(lack)
    if not panels:
        reasons = "\n".join(f"{view.recording.source}: {k} {why}" for k, why in left_out.items())
        raise DataError(reasons)
    figure = sheet(view.heading, columns_of(panels))
    drawn = tuple(panel.kind for panel in panels)
    return Picture(figure=figure, panels=tuple(panels), drawn=drawn, left_out=left_out)


def make_panel(view: View, kind: str) -> Panel:
    """Compute one kind.

    Raises
    ------
    DataError
        If the kind is unknown, or the recording lacks what it needs.
    """
    if kind not in KINDS:
        near = difflib.get_close_matches(kind, KINDS, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"must be of {', '.join((AUTO, *KINDS))}"
        raise DataError(f"kind = {kind!r} is not known; {hint}")
    try:
        return computed(KINDS[kind], view)
    except LackError as lack:
        raise DataError(f"{view.recording.source}: {kind} {lack}") from None


Shown = TypeVar("Shown")


def computed(kind: Callable[[View], Shown], view: View) -> Shown:
    """Data of a kind; a refusal by the features counts as a lack of the recording, too."""
    if not view.traces:
        raise LackError("needs a channel besides the tacho, has 0; record one")
    try:
        return kind(view)
    except LackError:
        raise
    except ValueError as error:
        raise LackError(f"cannot be computed: {error}") from error
