"""Pictures of a simulated recording. Always says that it is simulated."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.orbit import full_spectrum
from ...features.signal.spectrum import decibel, power_spectral_density
from ...sim.output.recording import Recording
from ...sim.scene.journal import JournalScene
from ...sim.scene.parts import Scene
from ...sim.scene.pump import PumpScene
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.recording import ShaftState, shaft_state
from ..pages.page import short_name
from ..pages.picture import save_picture
from .panel import COLOURS

_REVOLUTIONS = 2
_MOST_ORDERS = 4.0  # of a full spectrum, to either side


def plot_simulation(scene: Scene, solution: Recording, path: Path, *, force: bool = True) -> None:
    """Draw a simulated recording with what its sensors do not see: forces, pressures, orbits.

    Parameters
    ----------
    scene : Scene
    solution : Recording
        With truth.
    path : Path
        ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        Another suffix.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7), layout="constrained")
    figure.suptitle(f"{short_name(scene.name, 90)} (simulated)")
    _DRAWERS[scene.machine](figure, scene, solution)
    save_picture(figure, path, force=force)


def _draw_pump(figure: Any, scene: Scene, solution: Recording) -> None:
    pump = cast(PumpScene, scene)
    if not pump.running:
        _draw_rest(figure, solution)
        return
    rate = solution.sample_rate
    n = min(solution.signal.shape[1], round(_REVOLUTIONS / pump.drive.speed * rate))
    turns = np.arange(n) / rate * pump.drive.speed + pump.drive.start_angle / (2 * np.pi)
    panels = figure.subplot_mosaic([["wave", "wave", "orbit"], ["force", "pressure", "spectrum"]])
    accelerations = [
        (short_name(channel.name), row)
        for channel, row in zip(solution.channels, solution.signal, strict=True)
        if channel.quantity == "acceleration"
    ]
    for (name, row), colour in zip(accelerations, COLOURS, strict=False):
        panels["wave"].plot(turns, row[:n], lw=0.5, color=colour, label=name)
        frequency, level = _density(row, rate)
        panels["spectrum"].plot(frequency / 1e3, level, lw=0.6, color=colour, label=name)
    _label(panels["wave"], "crank revolutions", "acceleration [m/s²]", "Casing acceleration")
    _label(panels["spectrum"], "frequency [kHz]", "PSD [dB re 1 (m/s²)²/Hz]", "Spectrum")
    panels["spectrum"].set_xscale("log")
    for column, name in enumerate("xy"):
        force = solution.truth["pin_force_n"][:n, column] / 1e3
        panels["force"].plot(turns, force, lw=0.6, color=COLOURS[column], label=name)
    _label(panels["force"], "crank revolutions", "pin on rod [kN]", "Crank-pin force")
    _pressures(panels["pressure"], pump, solution, turns)
    _orbit(panels["orbit"], pump, solution.truth["pin_offset_m"][:n])


def _draw_rest(figure: Any, solution: Recording) -> None:
    """A test of the casing at rest: forces and accelerations over time, and their spectra."""
    rate = solution.sample_rate
    time = np.arange(solution.signal.shape[1]) / rate
    panels = figure.subplots(2, 2, sharex="col")
    rows = (("force", "force [N]", "N²/Hz"), ("acceleration", "acceleration [m/s²]", "(m/s²)²/Hz"))
    for (quantity, told, density), (wave, spectrum) in zip(rows, panels, strict=True):
        shown = [
            (short_name(channel.name), row)
            for channel, row in zip(solution.channels, solution.signal, strict=True)
            if channel.quantity == quantity
        ]
        for (name, row), colour in zip(shown, COLOURS, strict=False):
            wave.plot(time, row, lw=0.5, color=colour, label=name)
            frequency, level = _density(row, rate)
            spectrum.plot(frequency / 1e3, level, lw=0.6, color=colour, label=name)
        _label(wave, "time [s]", told, f"{quantity.capitalize()} of the test")
        _label(spectrum, "frequency [kHz]", f"PSD [dB re 1 {density}]", "Spectrum")
        spectrum.set_xscale("log")


def _pressures(
    axes: Any, scene: PumpScene, solution: Recording, turns: NDArray[np.float64]
) -> None:
    """Cylinder pressure of every throw, and what sensors make of it."""
    area = np.pi / 4 * scene.piston.diameter**2
    for throw in range(len(scene.throws)):
        suffix = f"_{throw + 1}" if throw else ""
        force = solution.truth[f"piston_pressure_force_n{suffix}"][: turns.size]
        colour = COLOURS[throw % len(COLOURS)]
        if area > 0:
            axes.plot(turns, force / area / 1e6, lw=0.8, color=colour, label=f"{throw + 1}")
    for channel, row in zip(solution.channels, solution.signal, strict=True):
        if channel.quantity == "pressure":
            told = {"label": short_name(channel.name), "color": "black", "ls": ":"}
            axes.plot(turns, row[: turns.size] / 1e6, lw=0.9, **told)
    _label(axes, "crank revolutions", "gauge pressure [MPa]", "Cylinder pressure")


def _label(axes: Any, x: str, y: str, title: str) -> None:
    axes.set(xlabel=x, ylabel=y, title=title)
    axes.grid(alpha=0.3)
    axes.margins(x=0)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, loc="upper right")


def _density(row: NDArray[np.float32], rate: float) -> tuple[NDArray[Any], NDArray[Any]]:
    frequency, density = power_spectral_density(row, rate)
    return frequency[1:], decibel(density[1:])


def _orbit(axes: Any, scene: PumpScene, offset: NDArray[np.float64]) -> None:
    """Path of the pin's centre in its clearance circle."""
    circle = np.exp(2j * np.pi * np.linspace(0, 1, 181)) * scene.joint.crankpin.clearance_radial
    axes.plot(1e3 * circle.real, 1e3 * circle.imag, color="black", lw=1)
    axes.plot(1e3 * offset[:, 0], 1e3 * offset[:, 1], lw=0.5, color=COLOURS[0])
    axes.set(xlabel="x, along the stroke [mm]", ylabel="y [mm]", title="Pin in its clearance")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)


# --- journal bearing


def _draw_journal(figure: Any, scene: Scene, solution: Recording) -> None:
    """What the figures of Ma, Lu, Chen (2010) show, over tau, and the spectrum of the orbit."""
    journal = cast(JournalScene, scene)
    truth = solution.truth
    panels = figure.subplot_mosaic(
        [["orbit", "position", "force"], ["load", "pressure", "spectrum"]]
    )
    tau = 2 * np.pi * journal.drive.speed * np.arange(solution.signal.shape[1])
    tau /= solution.sample_rate
    place = truth["journal_m"] / journal.bearing.clearance_radial
    _clearance_circle(panels["orbit"], place)
    _pair(panels["position"], tau, place, ("X", "Y"))
    _label(panels["position"], "τ = ωt", "over the radial clearance", "Journal centre")
    _pair(panels["force"], tau, truth["film_force_n"] / 1e3, ("F_X", "F_Y"))
    _label(panels["force"], "τ = ωt", "on the journal [kN]", "Film force")
    _pair(panels["load"], tau, truth["load_n"] / 1e3, ("along X", "along Y"))
    _label(panels["load"], "τ = ωt", "on the journal [kN]", "Weight, load and unbalance")
    _film(panels["pressure"], tau, journal, truth)
    _full_spectrum(panels["spectrum"], journal, solution)


def _pair(axes: Any, tau: NDArray[Any], columns: NDArray[Any], names: tuple[str, str]) -> None:
    for column, name in enumerate(names):
        axes.plot(tau, columns[:, column], lw=0.8, color=COLOURS[column], label=name)


def _clearance_circle(axes: Any, place: NDArray[Any]) -> None:
    """Orbit in the unit circle, X downwards as the load points, Y to the right."""
    circle = np.exp(2j * np.pi * np.linspace(0, 1, 181))
    axes.plot(circle.real, circle.imag, color="black", lw=1)
    axes.plot(place[:, 1], place[:, 0], lw=0.6, color=COLOURS[0])
    axes.plot(*place[0, ::-1], "o", ms=4, color=COLOURS[2], label="first sample")
    axes.plot(*place[-1, ::-1], "s", ms=4, color=COLOURS[1], label="last")
    axes.set(xlabel="Y", ylabel="X, along the load", title="Journal in its clearance")
    axes.set_aspect("equal", adjustable="box")
    axes.invert_yaxis()
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper right")


def _film(
    axes: Any,
    tau: NDArray[Any],
    scene: JournalScene,
    truth: dict[str, NDArray[Any]],
) -> None:
    """Peak pressure, where the rung knows it, and the thinnest film on an axis of its own."""
    if "peak_pressure_pa" in truth:
        peak = truth["peak_pressure_pa"] / 1e6
        axes.plot(tau, peak, lw=0.8, color=COLOURS[0], label="peak pressure")
    _label(axes, "τ = ωt", "peak pressure [MPa]", "Film: peak pressure, least thickness")
    beside = axes.twinx()
    thin = truth["min_film_m"] / scene.bearing.clearance_radial
    beside.plot(tau, thin, lw=0.8, color=COLOURS[1], label="least thickness")
    beside.set_ylabel("least thickness over C")
    beside.set_ylim(0, None)
    beside.margins(x=0)
    beside.legend(fontsize=8, loc="lower right")


def _full_spectrum(axes: Any, scene: JournalScene, solution: Recording) -> None:
    """Radii of forward and backward motion over the order, from the true orbit."""
    path = 1e6 * (solution.truth["journal_m"] @ np.array([1.0, 1.0j]))
    frequency, vector = full_spectrum(path, solution.sample_rate)
    order = frequency / scene.drive.speed
    axes.plot(order, np.abs(vector), lw=0.8, color=COLOURS[0], label="orbit")
    _label(axes, "backward   [orders]   forward", "radius [µm]", "Full spectrum of the orbit")
    axes.set_xlim(-_MOST_ORDERS, _MOST_ORDERS)


# --- propulsion shaft


def _draw_shaft(figure: Any, scene: Scene, solution: Recording) -> None:
    """The line with what it carries, its journals in their bores, and what its sensors see."""
    shaft = cast(ShaftScene, scene)
    state = shaft_state(shaft)
    panels = figure.subplot_mosaic(
        [["line", "line", "line"], ["bores", "force", "spectrum"]], height_ratios=(1, 1.3)
    )
    _shaft_line(panels["line"], shaft, state)
    _bores(panels["bores"], state, solution.truth["journal_m"])
    turns = np.arange(solution.signal.shape[1]) / solution.sample_rate * shaft.drive.speed
    n = int(np.searchsorted(turns, _REVOLUTIONS))
    for i in range(len(shaft.bearings)):
        up = solution.truth["film_force_n"][:n, i, 0] / 1e3
        panels["force"].plot(turns[:n], up, lw=0.8, color=f"C{i}")
    _label(panels["force"], "revolutions", "film on the shaft, up [kN]", "Bearing forces")
    names = [bearing.name for bearing in shaft.bearings]
    for sensor, row in zip(shaft.sensors, solution.signal, strict=False):
        frequency, level = _density(row, solution.sample_rate)
        colour = f"C{names.index(sensor.bearing)}"
        panels["spectrum"].plot(frequency, level, lw=0.6, color=colour)
    unit = "PSD [dB re 1 (m/s²)²/Hz]"
    _label(panels["spectrum"], "frequency [Hz]", unit, "Housing acceleration")
    panels["spectrum"].set_xscale("log")


def _shaft_line(axes: Any, scene: ShaftScene, state: ShaftState) -> None:
    """Heights of the shaft over the length, and the reaction of every bearing."""
    film = state.film
    height = 1e3 * film.deflection[0::4]
    axes.plot(state.beam.stations, height, lw=1, color=COLOURS[0])
    room = float(np.ptp(height)) or 1.0
    for bearing, reaction in zip(scene.bearings, film.reactions[:, 0], strict=True):
        at = height[state.beam.node(bearing.station)]
        ends = [bearing.station - bearing.length / 2, bearing.station + bearing.length / 2]
        axes.plot(ends, [at, at], lw=5, color="black", alpha=0.4)
        axes.annotate(
            f"{short_name(bearing.name, 24)}\n{reaction / 1e3:.1f} kN",
            (bearing.station, at + 0.08 * room),
            ha="center",
            va="bottom",
            fontsize=8,
        )
    for disc in scene.discs:
        axes.plot(disc.station, height[state.beam.node(disc.station)], "o", ms=4, color="black")
    axes.set_ylim(height.min() - 0.15 * room, height.max() + 0.45 * room)
    _label(axes, "station from aft [m]", "height [mm]", "Deflected line, running")


def _bores(axes: Any, state: ShaftState, path: NDArray[Any]) -> None:
    """Paths of the journals over their clearances, seen from aft; tells the colours for all."""
    circle = np.exp(2j * np.pi * np.linspace(0, 1, 181))
    axes.plot(circle.real, circle.imag, color="black", lw=1)
    for i, bearing in enumerate(state.film.bearings):
        place = path[:, i] / bearing.worn.clearance
        name = short_name(bearing.name, 24)
        axes.plot(place[:, 1], place[:, 0], lw=0.6, color=f"C{i}", label=name)
        middle = place.mean(axis=0)
        axes.plot(middle[1], middle[0], "+", ms=6, color=f"C{i}")
    axes.set(xlabel="to starboard", ylabel="up", title="Journals over their clearances")
    axes.set_aspect("equal", adjustable="box")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6, loc="upper right")


_DRAWERS: dict[str, Callable[[Any, Scene, Recording], None]] = {
    "reciprocating-pump": _draw_pump,
    "journal-bearing": _draw_journal,
    "propulsion-shaft": _draw_shaft,
}
