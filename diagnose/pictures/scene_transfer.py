"""Transfer functions of a scene as text, table and picture."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import find_peaks

from ...sim.atomic import write_whole
from ...sim.machine.transfer import scene_transfer
from ...sim.output.transfer import SceneTransfer
from ...sim.scene.scene import Scene
from ..pages.page import short_name
from ..pages.picture import save_picture

LINES = 4000
"""Lines of a transfer function, evenly spaced; the closest spacing that a picture can show."""

PASS_SHARE = 0.45
"""Default highest frequency, over the sample rate of the scene."""

LOW_SHARE = 1 / 300
"""Default lowest frequency, over the highest: two and a half decades."""

_PROMINENCE_DB = 3.0
_SHOWN = 5  # peaks of a path that are listed
_COLOURS = ("#1f5a94", "#b3541e", "#4f7d3a", "#7a4fa0", "#8a8a8a", "#a0306a")
_TINY = 1e-300  # avoids the logarithm of zero


def transfer_of(scene: Scene, low: float | None = None, high: float | None = None) -> SceneTransfer:
    """Transfer functions between two frequencies.

    Parameters
    ----------
    scene : Scene
        A pump or a shaft line.
    low, high : float, optional
        Band [Hz]; by default up to 0.45 of the sample rate, from a three-hundredth of that.

    Returns
    -------
    SceneTransfer

    Raises
    ------
    ValueError
        If the band is empty.
    SceneError
        As for :func:`wearstate.sim.machine.transfer.scene_transfer`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> transfer_of(load_scene("bilge-pump"), 100.0, 200.0).frequency[[0, -1]].tolist()
    [100.0, 200.0]
    """
    last = PASS_SHARE * scene.sample_rate if high is None else high
    first = LOW_SHARE * last if low is None else low
    if not 0 < first < last < np.inf:
        raise BandError(
            f"low = {first:g} Hz and high = {last:g} Hz must be 0 < low < high and finite; correct "
            "them"
        )
    return scene_transfer(scene, np.linspace(first, last, LINES))


class BandError(ValueError):
    """A band without a frequency in it."""


def peaks_of(found: SceneTransfer) -> dict[str, list[dict[str, float]]]:
    """Peaks of every path, by ``sensor/place``, the highest first.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> peaks = peaks_of(transfer_of(load_scene("bilge-pump")))["acc_x/bearing_x"]
    >>> round(peaks[0]["frequency_hz"] / 10)
    137
    """
    result = {}
    for s, sensor in enumerate(found.sensors):
        for p, place in enumerate(found.places):
            level = _level(found.values[s, p])
            lines, _ = find_peaks(level, prominence=_PROMINENCE_DB)
            ranked = sorted(lines, key=lambda line: -level[line])
            result[f"{sensor}/{place}"] = [
                {"frequency_hz": float(found.frequency[k]), "level_db": float(level[k])}
                for k in ranked
            ]
    return result


def _level(values: Any) -> Any:
    return 20 * np.log10(np.abs(values) + _TINY)


def transfer_text(scene: Scene, found: SceneTransfer) -> str:
    """The peaks of every path, one line each, for a terminal."""
    lines = [f"{scene.name} (simulated): accelerance [dB re 1 (m/s²)/N], highest peaks"]
    for path, peaks in peaks_of(found).items():
        text = ", ".join(f"{p['frequency_hz']:.4g} Hz {p['level_db']:+.1f}" for p in peaks[:_SHOWN])
        lines.append(f"  {path:32} {text or 'no peak'}")
    return "\n".join(lines)


def transfer_table(scene: Scene, found: SceneTransfer) -> dict[str, Any]:
    """The same, ready for JSON."""
    return {
        "scene": scene.name,
        "low_hz": float(found.frequency[0]),
        "high_hz": float(found.frequency[-1]),
        "peaks": peaks_of(found),
    }


def save_csv(found: SceneTransfer, path: Path, *, force: bool = False) -> None:
    """Write real and imaginary part of every path, in the format that ``casing.frf`` reads.

    Parameters
    ----------
    found : Transfer
    path : Path
    force : bool
        Replace an existing file.
    """
    names, columns = ["frequency_hz"], [found.frequency]
    for s, sensor in enumerate(found.sensors):
        for p, place in enumerate(found.places):
            names += [f"{sensor}/{place} real", f"{sensor}/{place} imag"]
            columns += [found.values[s, p].real, found.values[s, p].imag]
    rows = [",".join(f"{value:.9g}" for value in row) for row in np.column_stack(columns)]
    write_whole(path, ("\n".join([",".join(names), *rows]) + "\n").encode(), force=force)


def transfer_figure(scene: Scene, found: SceneTransfer) -> Any:
    """Magnitude and phase of every path: one column for each excited place.

    Parameters
    ----------
    scene : Scene
    found : Transfer

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    across = len(found.places)
    figure = Figure(figsize=(1.5 + 3.8 * across, 6.0), layout="constrained")
    figure.suptitle(f"{short_name(scene.name, 60)}: accelerance (simulated)")
    panels = figure.subplots(2, across, sharex=True, sharey="row", squeeze=False)
    for p, place in enumerate(found.places):
        for s, sensor in enumerate(found.sensors):
            colour = _COLOURS[s % len(_COLOURS)]
            value = found.values[s, p]
            panels[0, p].semilogx(found.frequency, _level(value), color=colour, lw=1, label=sensor)
            panels[1, p].semilogx(
                found.frequency, np.degrees(np.angle(value)), color=colour, lw=0.8
            )
        panels[0, p].set_title(f"force at {short_name(place, 30)}", fontsize=10)
        panels[1, p].set(xlabel="frequency [Hz]", yticks=range(-180, 181, 90))
    panels[0, 0].set_ylabel("magnitude [dB re 1 (m/s²)/N]")
    panels[1, 0].set_ylabel("phase [deg]")
    panels[0, -1].legend(fontsize=8, loc="lower right")
    highest = float(_level(found.values).max())
    panels[0, 0].set_ylim(highest - 90, highest + 6)
    for each in panels.ravel():
        each.grid(alpha=0.3)
        each.margins(x=0)
    return figure


def save_figure(scene: Scene, found: SceneTransfer, path: Path, *, force: bool = False) -> None:
    """Write the picture, see :func:`.pages.picture.save_picture`."""
    save_picture(transfer_figure(scene, found), path, force=force)
