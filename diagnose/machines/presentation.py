"""What the pages, pictures and texts of any machine ask of it."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.generation.machines import Truth
from ...features.signal.spectrum import decibel, power_spectral_density
from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from ..pages.page import short_name
from ..pages.si_text import si_text
from ..pictures.panel import COLOURS
from .shifts import Shift

Truths = Mapping[str, Truth]


def label(axes: Any, x: str, y: str, title: str) -> None:
    """Name axes and curves."""
    axes.set(xlabel=x, ylabel=y, title=title)
    axes.grid(alpha=0.3)
    axes.margins(x=0)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, loc="upper right")


def density(row: NDArray[np.float32], rate: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Frequency [Hz] and level [dB] of a row's spectrum."""
    frequency, density = power_spectral_density(row, rate)
    return frequency[1:], decibel(density[1:])


def told(truth: Truths, name: str) -> str:
    """One number of a run with its unit."""
    return si_text(truth[name].value, truth[name].unit)


def draw_signals(figure: Any, _scene: Scene, solution: Recording) -> None:
    """Signals over time and their spectra, of a machine that says nothing of what to draw."""
    time = np.arange(solution.signal.shape[1]) / solution.sample_rate
    shown = {c.name: (c, row) for c, row in zip(solution.channels, solution.signal, strict=True)}
    units = dict.fromkeys(c.unit for c, _ in shown.values() if c.quantity != "tacho")
    panels = figure.subplots(len(units), 2, squeeze=False)
    for unit, (wave, spectrum) in zip(units, panels, strict=True):
        alike = [(c, row) for c, row in shown.values() if c.unit == unit and c.quantity != "tacho"]
        for (channel, row), colour in zip(alike, COLOURS, strict=False):
            wave.plot(time, row, lw=0.5, color=colour, label=short_name(channel.name))
            spectrum.plot(*density(row, solution.sample_rate), lw=0.6, color=colour)
        label(wave, "time [s]", unit, "Signals")
        label(spectrum, "frequency [Hz]", f"PSD [dB re 1 ({unit})²/Hz]", "Spectrum")


def no_lines(_truth: Truths) -> Iterator[tuple[str, str]]:
    """Of a machine of which the simulator alone knows nothing worth a line."""
    yield from ()


@dataclass(frozen=True, kw_only=True)
class Unseen:
    """What misleads a model without a warning, unless its recipe draws it.

    Attributes
    ----------
    path : str
        Of the value in the scene; a recipe that sets or draws it trains models that know it.
    severity : str
        Of the models that it misleads: what its name begins with.
    text : str
        What it does, and what a person can check instead.
    shown : str
        Recipe of such machines: a model that was shown them refuses them.
    """

    path: str
    severity: str
    text: str
    shown: str = ""


@dataclass(frozen=True, kw_only=True)
class Presentation:
    """How a machine is shown, and what of it a model takes for granted.

    Attributes
    ----------
    draw : callable
        Figure, scene, solution -> the picture of a simulated run.
    lines : callable
        What the simulator knows of a run -> what it is about, and a line of text.
    sizes : tuple of str
        What of a nameplate recipes leave as it is, as dotted paths of the scene.
    shifts : tuple of Shift
        What may differ from one machine to the next.
    unseen : tuple of Unseen
        Of that, what misleads without a warning.
    """

    draw: Callable[[Any, Scene, Recording], None] = draw_signals
    lines: Callable[[Truths], Iterator[tuple[str, str]]] = no_lines
    sizes: tuple[str, ...] = ()
    shifts: tuple[Shift, ...] = ()
    unseen: tuple[Unseen, ...] = ()
