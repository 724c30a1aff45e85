"""Presentation of a journal bearing, and the assumptions that a model makes about it."""

import math
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.orbit import full_spectrum
from ...sim.output.recording import Recording
from ...sim.scene.journal import JournalScene
from ...sim.scene.scene import Scene
from ..pages.si_text import plain
from ..pictures.panel import COLOURS
from .presentation import Presentation, Truths, Unseen, label, value_text
from .shifts import add, factor, set_to

_MOST_ORDERS = 4.0  # of a full spectrum, to either side


def _draw_journal(figure: Any, scene: Scene, solution: Recording) -> None:
    """Draw the quantities of Ma, Lu, Chen (2010) over tau, and the spectrum of the orbit."""
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
    label(panels["position"], "τ = ωt", "over the radial clearance", "Journal centre")
    _pair(panels["force"], tau, truth["film_force_n"] / 1e3, ("F_X", "F_Y"))
    label(panels["force"], "τ = ωt", "on the journal [kN]", "Film force")
    _pair(panels["load"], tau, truth["load_n"] / 1e3, ("along X", "along Y"))
    label(panels["load"], "τ = ωt", "on the journal [kN]", "Weight, load and unbalance")
    _film(panels["pressure"], tau, journal, truth)
    _full_spectrum(panels["spectrum"], journal, solution)


def _pair(axes: Any, tau: NDArray[Any], columns: NDArray[Any], names: tuple[str, str]) -> None:
    for column, name in enumerate(names):
        axes.plot(tau, columns[:, column], lw=0.8, color=COLOURS[column], label=name)


def _clearance_circle(axes: Any, place: NDArray[Any]) -> None:
    """Draw the orbit in the unit circle, X downwards along the load, Y to the right."""
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
    """Draw peak pressure, if the rung has it, and minimum film thickness on a second axis."""
    if "peak_pressure_pa" in truth:
        peak = truth["peak_pressure_pa"] / 1e6
        axes.plot(tau, peak, lw=0.8, color=COLOURS[0], label="peak pressure")
    label(axes, "τ = ωt", "peak pressure [MPa]", "Film: peak pressure, least thickness")
    second = axes.twinx()
    thin = truth["min_film_m"] / scene.bearing.clearance_radial
    second.plot(tau, thin, lw=0.8, color=COLOURS[1], label="least thickness")
    second.set_ylabel("least thickness over C")
    second.set_ylim(0, None)
    second.margins(x=0)
    second.legend(fontsize=8, loc="lower right")


def _full_spectrum(axes: Any, scene: JournalScene, solution: Recording) -> None:
    """Draw radii of forward and backward motion over the order, from the true orbit."""
    path = 1e6 * (solution.truth["journal_m"] @ np.array([1.0, 1.0j]))
    frequency, vector = full_spectrum(path, solution.sample_rate)
    order = frequency / scene.drive.speed
    axes.plot(order, np.abs(vector), lw=0.8, color=COLOURS[0], label="orbit")
    label(axes, "backward   [orders]   forward", "radius [µm]", "Full spectrum of the orbit")
    axes.set_xlim(-_MOST_ORDERS, _MOST_ORDERS)


# --- propulsion shaft


def _lines(truth: Truths) -> Iterator[tuple[str, str]]:
    place = f"mean eccentricity ratio {plain(truth['eccentricity'].value)}"
    if "attitude_angle" in truth:
        place += f", attitude angle {value_text(truth, 'attitude_angle')}"
    yield "journal", place
    yield (
        "orbit",
        f"{value_text(truth, 'orbit_rms')} rms, at most "
        f"{value_text(truth, 'orbit_largest')} from there",
    )
    pressure = ""
    if "pressure_peak" in truth:
        pressure = f"; peak pressure {value_text(truth, 'pressure_peak')}"
    yield "film", f"thinnest {value_text(truth, 'film_least')}{pressure}"


_DEGREE = math.radians(1.0)

_SHIFTS = (
    factor("load.static", 0.7, 1.4, "belt tension, gear load"),
    add("load.static_across", -1500.0, 1500.0, "the load has another direction than assumed"),
    set_to(
        "bearing.inlet_fill",
        (0.6,),
        "ring oiling, a blocked feed hole",
        beside={"film.rung": "direct"},
    ),
    factor("bearing.length", 0.85, 1.15, "chamfers, grooves, another bush"),
    factor("bearing.diameter", 0.95, 1.05, "another bush"),
    factor("oil.viscosity", 0.6, 1.6, "another grade, or 10 K"),
    factor("drive.speed", 0.8, 1.25, "another gear or motor"),
    factor("rotor.mass", 0.8, 1.25, "its share on this bearing"),
    factor("rotor.unbalance", 0.3, 3.0, "another balance quality"),
    factor("rotor.run_out.*.amplitude", 0.2, 3.0, "another track"),
    factor("rotor.dents.*.depth", 0.2, 3.0, "another track"),
    add("sensors.*.offset", -1e-5, 1e-5, "the gap of a centred shaft is unknown"),
    add("sensors.*.angle", -5 * _DEGREE, 5 * _DEGREE, "probes off their nominal position"),
    factor("sensors.*.gain", 0.9, 1.1, "another steel under the probe"),
    set_to("film.rung", ("short",), "short-bearing film"),
    set_to("film.condition", ("guembel", "reynolds", "periodic"), "rupture of the film"),
)

_UNSEEN = (  # measured: docs/evaluation.md, and docs/decisions/027-starved-inlet.md
    Unseen(
        path="bearing.inlet_fill",
        severity="diametral_clearance",
        text="a film that its inlet does not fill (a blocked feed hole, ring oiling) is read as up "
        "to a tenth of the limit more clearance; check the feed",
    ),
)

PRESENTATION = Presentation(
    draw=_draw_journal,
    lines=_lines,
    sizes=("bearing.diameter", "bearing.length", "rotor.mass", "load.static_across"),
    shifts=_SHIFTS,
    unseen=_UNSEEN,
)
