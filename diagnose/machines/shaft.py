"""Presentation of a propulsion shaft, and the assumptions that a model makes about it."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene
from ..pages.page import short_name
from ..pages.si_text import plain, si_text
from ..pictures.panel import COLOURS
from .presentation import Presentation, Truths, Unseen, density, label, value_text
from .shifts import add, factor, set_to

if TYPE_CHECKING:
    from ...sim.shaft.at_rest import ShaftState

_REVOLUTIONS = 2  # drawn


def _draw_shaft(figure: Any, scene: Scene, solution: Recording) -> None:
    """Draw the line with its loads, the journals in their bores, and the sensor signals."""
    shaft = cast(ShaftScene, scene)
    from ...sim.shaft.at_rest import shaft_state  # kernels, which a nameplate needs none of

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
    label(panels["force"], "revolutions", "film on the shaft, up [kN]", "Bearing forces")
    names = [bearing.name for bearing in shaft.bearings]
    for sensor, row in zip(shaft.sensors, solution.signal, strict=False):
        frequency, level = density(row, solution.sample_rate)
        colour = f"C{names.index(sensor.bearing)}"
        panels["spectrum"].plot(frequency, level, lw=0.6, color=colour)
    unit = "PSD [dB re 1 (m/s²)²/Hz]"
    label(panels["spectrum"], "frequency [Hz]", unit, "Housing acceleration")
    panels["spectrum"].set_xscale("log")


def _shaft_line(axes: Any, scene: ShaftScene, state: "ShaftState") -> None:
    """Draw the height of the shaft over the length, and the reaction of every bearing."""
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
    label(axes, "station from aft [m]", "height [mm]", "Deflected line, running")


def _bores(axes: Any, state: "ShaftState", path: NDArray[Any]) -> None:
    """Draw the journal paths over their clearances, seen from aft, with the legend of colours."""
    circle = np.exp(2j * np.pi * np.linspace(0, 1, 181))
    axes.plot(circle.real, circle.imag, color="black", lw=1)
    for i, bearing in enumerate(state.film.bearings):
        own = bearing.worn
        place = path[:, i] / own.clearance
        if (bore := own.geometry.bore) is not None:
            axes.plot(*_touching(bore), ":", color=f"C{i}", lw=0.8)
        name = short_name(bearing.name, 24)
        axes.plot(place[:, 1], place[:, 0], lw=0.6, color=f"C{i}", label=name)
        middle = place.mean(axis=0)
        axes.plot(middle[1], middle[0], "+", ms=6, color=f"C{i}")
    axes.set(xlabel="to starboard", ylabel="up", title="Journals over their clearances")
    axes.set_aspect("equal", adjustable="box")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _touching(bore: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Limit of the positions of a journal's centre, seen from aft, at which it touches the bore.

    `bore` is the extra gap over the clearance, as in
    :class:`wearstate.sim.film.solve.FilmGeometry`, whose angle counts from straight down.
    """
    angle = 2 * np.pi * np.arange(len(bore)) / len(bore)
    way = np.linspace(0, 2 * np.pi, 361)
    share = np.cos(way[:, np.newaxis] - angle)
    with np.errstate(divide="ignore"):
        reach = np.where(share > 0, (1 + bore) / share, np.inf).min(axis=1)
    return -reach * np.sin(way), -reach * np.cos(way)


def _lines(truth: Truths) -> Iterator[tuple[str, str]]:
    bearings = [
        name.removeprefix("reaction_")
        for name in truth
        if name.startswith("reaction_") and name != "reaction_sum"
    ]
    shown = ", ".join(f"{name} {value_text(truth, f'reaction_{name}')}" for name in bearings)
    yield "reactions", f"{shown}; in all {value_text(truth, 'reaction_sum')}"
    places = []
    for name in bearings:
        up, side = truth[f"up_{name}"].value, truth[f"side_{name}"].value
        angle = math.degrees(math.atan2(side, -up))
        places.append(f"{name} {si_text(math.hypot(up, side), 'm')} at {plain(angle)} deg")
    yield "journals", f"{', '.join(places)} from straight down"
    yield "film", f"thinnest {value_text(truth, 'film_least')}"


_DEGREE = math.radians(1.0)

_SHIFTS = (
    add("probes.*.offset", -6e-5, 6e-5, "the gap of a centred shaft is unknown"),
    add("probes.*.angle", -5 * _DEGREE, 5 * _DEGREE, "probes off their nominal position"),
    factor("probes.*.gain", 0.9, 1.1, "another steel under the probe"),
    factor("oil.viscosity_40", 0.68, 1.5, "one ISO grade down or up"),
    add("oil.temperature", -10.0, 10.0, "cold water, or the tropics"),
    set_to("propeller.blades", (3, 5), "another propeller"),
    factor("propeller.thrust", 0.7, 1.4, "draught, tow"),
    factor("propeller.thrust_height", 0.3, 2.0, "another wake"),
    factor("propeller.blade_rate.*.up", 0.3, 3.0, "another wake"),
    factor("propeller.blade_rate.*.side", 0.3, 3.0, "another wake"),
    set_to("hull.deflection", ("-0.8 mm", "0.8 mm"), "loaded, in ballast"),
    factor("drive.speed", 0.8, 1.25, "another operating point"),
    factor("bearings.*.diametral_clearance", 0.75, 1.3, "another maker's clearance"),
    set_to("bearings.*.worn_shape", ("arc",), "a journal wears its own arc into the bush"),
    set_to("bearings.*.groove_width", ("30 deg",), "axial grooves at the sides"),
    factor("bearings.*.length", 0.85, 1.15, "chamfers, grooves, another bush"),
    factor("bearings.*.rise", 0.3, 2.0, "pedestals colder or hotter"),
    add("bearings.*.offset", -1e-4, 1e-4, "datum of the alignment"),
    add("bearings.*.slope", -1e-4, 1e-4, "bores not in line"),
    factor("bearings.*.housing.mass", 0.8, 1.25, "what moves with the bearing"),
    factor("bearings.*.housing.stiffness_up", 0.7, 1.4, "another foundation"),
    factor("bearings.*.housing.stiffness_side", 0.7, 1.4, "another foundation"),
    factor("bearings.*.housing.damping_up", 0.4, 2.5, "bolts, chocks"),
    factor("bearings.*.housing.damping_side", 0.4, 2.5, "bolts, chocks"),
    add("sensors.*.modes.*.share", -0.3, 0.3, "webs and covers that swing under a sensor"),
    factor("discs.*.mass", 0.9, 1.1, "estimated from drawings"),
    factor("discs.*.entrained_mass", 0.5, 1.5, "water that moves with the propeller"),
    factor("discs.*.buoyancy", 0.5, 1.5, "propeller half out of the water"),
    factor("discs.*.unbalance", 0.3, 3.0, "another balance quality, fouling"),
    factor("run_out.*.amplitude", 0.2, 3.0, "another track"),
    factor("dents.*.depth", 0.2, 3.0, "another track"),
    factor("turbulence.*.force", 0.3, 3.0, "sea state"),
    factor("coupling.stiffness", 0.5, 2.0, "age of the rubber"),
    factor("coupling.bending_stiffness", 0.5, 2.0, "age of the rubber"),
    factor("coupling.torque", 0.7, 1.3, "load of the engine"),
    set_to("coupling.angle", ("0.0005 rad",), "faces not parallel"),
    factor("shaft.young", 0.97, 1.03, "another steel"),
    set_to("film.condition", ("guembel", "periodic"), "rupture of the film"),
)


_UNSEEN = (  # measured: docs/decisions/028-hull-and-warm-films.md
    Unseen(
        path="bearings.0.film_warming",
        severity="wear_down",
        text="a film that is warmer than the oil noted is read as 3 to 5 % of the limit more wear; "
        "note the bearing's temperature, and use a model of propulsion-shaft-warm",
    ),
)

PRESENTATION = Presentation(
    draw=_draw_shaft,
    lines=_lines,
    sizes=("propeller.blades",),
    shifts=_SHIFTS,
    unseen=_UNSEEN,
)
