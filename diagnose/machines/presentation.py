"""Machine-specific parts of pages, pictures and texts."""

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
    """Label axes and curves."""
    axes.set(xlabel=x, ylabel=y, title=title)
    axes.grid(alpha=0.3)
    axes.margins(x=0)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, loc="upper right")


def density(row: NDArray[np.float32], rate: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Frequency [Hz] and level [dB] of a row's spectrum."""
    frequency, density = power_spectral_density(row, rate)
    return frequency[1:], decibel(density[1:])


def value_text(truth: Truths, name: str) -> str:
    """A number of a run with its unit."""
    return si_text(truth[name].value, truth[name].unit)


def draw_signals(figure: Any, _scene: Scene, solution: Recording) -> None:
    """Draw signals over time and their spectra, for a machine without a picture of its own."""
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
    """No lines, for a machine without texts of its own."""
    yield from ()


@dataclass(frozen=True, kw_only=True)
class Unseen:
    """An effect that misleads a model without a warning, unless its recipe varies it.

    Attributes
    ----------
    path : str
        Path of the value in the scene; models trained on a recipe that sets or draws it know it.
    severity : str
        Beginning of the severity names of the models that it misleads.
    text : str
        The effect, and how to check for it.
    shown : str
        Recipe of such machines: a model trained to refuse them does so.
    """

    path: str
    severity: str
    text: str
    shown: str = ""


@dataclass(frozen=True, kw_only=True)
class Presentation:
    """Presentation of a machine, and the assumptions that a model makes about it.

    Attributes
    ----------
    draw : callable
        (figure, scene, solution): draws the picture of a simulated run.
    lines : callable
        Truths of a run -> pairs of a subject and a line of text.
    sizes : tuple of str
        Dotted paths of nameplate data that recipes do not vary.
    shifts : tuple of Shift
        Possible differences between machines.
    unseen : tuple of Unseen
        Differences that mislead without a warning.
    """

    draw: Callable[[Any, Scene, Recording], None] = draw_signals
    lines: Callable[[Truths], Iterator[tuple[str, str]]] = no_lines
    sizes: tuple[str, ...] = ()
    shifts: tuple[Shift, ...] = ()
    unseen: tuple[Unseen, ...] = ()
