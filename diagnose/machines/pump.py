"""Presentation of a reciprocating pump, and the assumptions that a model makes about it."""

from collections.abc import Iterator
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from ...sim.scene.pump import PumpScene
from ...sim.scene.scene import Scene
from ..pages.page import short_name
from ..pages.si_text import plain
from ..pictures.panel import COLOURS
from .presentation import Presentation, Truths, Unseen, density, label, value_text
from .shifts import factor, set_to

_REVOLUTIONS = 2  # drawn
_CELSIUS = 273.15  # K at 0 degrees Celsius


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
        frequency, level = density(row, rate)
        panels["spectrum"].plot(frequency / 1e3, level, lw=0.6, color=colour, label=name)
    label(panels["wave"], "crank revolutions", "acceleration [m/s²]", "Casing acceleration")
    label(panels["spectrum"], "frequency [kHz]", "PSD [dB re 1 (m/s²)²/Hz]", "Spectrum")
    panels["spectrum"].set_xscale("log")
    for column, name in enumerate("xy"):
        force = solution.truth["pin_force_n"][:n, column] / 1e3
        panels["force"].plot(turns, force, lw=0.6, color=COLOURS[column], label=name)
    label(panels["force"], "crank revolutions", "pin on rod [kN]", "Crank-pin force")
    _pressures(panels["pressure"], pump, solution, turns)
    _orbit(panels["orbit"], pump, solution.truth["pin_offset_m"][:n])


def _draw_rest(figure: Any, solution: Recording) -> None:
    """Draw a test of the casing at rest: forces and accelerations over time, and their spectra."""
    rate = solution.sample_rate
    time = np.arange(solution.signal.shape[1]) / rate
    panels = figure.subplots(2, 2, sharex="col")
    rows = (("force", "force [N]", "N²/Hz"), ("acceleration", "acceleration [m/s²]", "(m/s²)²/Hz"))
    for (quantity, shown_as, unit), (wave, spectrum) in zip(rows, panels, strict=True):
        shown = [
            (short_name(channel.name), row)
            for channel, row in zip(solution.channels, solution.signal, strict=True)
            if channel.quantity == quantity
        ]
        for (name, row), colour in zip(shown, COLOURS, strict=False):
            wave.plot(time, row, lw=0.5, color=colour, label=name)
            frequency, level = density(row, rate)
            spectrum.plot(frequency / 1e3, level, lw=0.6, color=colour, label=name)
        label(wave, "time [s]", shown_as, f"{quantity.capitalize()} of the test")
        label(spectrum, "frequency [kHz]", f"PSD [dB re 1 {unit}]", "Spectrum")
        spectrum.set_xscale("log")


def _pressures(
    axes: Any, scene: PumpScene, solution: Recording, turns: NDArray[np.float64]
) -> None:
    """Draw the cylinder pressure of every throw, and the sensor signals."""
    area = np.pi / 4 * scene.piston.diameter**2
    for throw in range(len(scene.throws)):
        suffix = f"_{throw + 1}" if throw else ""
        force = solution.truth[f"piston_pressure_force_n{suffix}"][: turns.size]
        colour = COLOURS[throw % len(COLOURS)]
        if area > 0:
            axes.plot(turns, force / area / 1e6, lw=0.8, color=colour, label=f"{throw + 1}")
    for channel, row in zip(solution.channels, solution.signal, strict=True):
        if channel.quantity == "pressure":
            style = {"label": short_name(channel.name), "color": "black", "ls": ":"}
            axes.plot(turns, row[: turns.size] / 1e6, lw=0.9, **style)
    label(axes, "crank revolutions", "gauge pressure [MPa]", "Cylinder pressure")


def _orbit(axes: Any, scene: PumpScene, offset: NDArray[np.float64]) -> None:
    """Draw the path of the pin's centre in its clearance circle."""
    circle = np.exp(2j * np.pi * np.linspace(0, 1, 181)) * scene.joint.crankpin.clearance_radial
    axes.plot(1e3 * circle.real, 1e3 * circle.imag, color="black", lw=1)
    axes.plot(1e3 * offset[:, 0], 1e3 * offset[:, 1], lw=0.5, color=COLOURS[0])
    axes.set(xlabel="x, along the stroke [mm]", ylabel="y [mm]", title="Pin in its clearance")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)


# --- journal bearing


def _lines(truth: Truths) -> Iterator[tuple[str, str]]:
    if "contacts_per_turn" not in truth:
        yield "pump", "at rest"
        return
    pins = [name for name in truth if name.startswith("pin_peak")]
    for name in pins:
        throw = name.removeprefix("pin_peak")
        number = (throw.removeprefix("_") or "1") if len(pins) > 1 else ""
        force = f"peak {value_text(truth, name)} (mean over revolutions), "
        force += f"rms {value_text(truth, f'pin_rms{throw}')}"
        if f"wrist_peak{throw}" in truth:
            force += f"; wrist pin {value_text(truth, f'wrist_peak{throw}')}"
            force += f", guide {value_text(truth, f'guide_peak{throw}')} peak"
        yield f"pin {number}".strip(), force
        if f"pressure_lowest{throw}" in truth:
            ends = (f"pressure_{end}{throw}" for end in ("lowest", "highest"))
            low, high = (value_text(truth, end) for end in ends)
            ratio = truth.get(f"pressure_ratio{throw}")
            about = f", ratio {plain(ratio.value, 3)} absolute" if ratio else ""
            yield f"pressure {number}".strip(), f"{low} to {high} gauge{about}"
    contacts, oiled = truth["contacts_per_turn"].value, "min_film_m" in truth
    if oiled:
        touching = truth["rubbing_share"].value
        rub = f", rough peaks touch {100 * touching:.2g} % of the time" if touching else ""
        warm = truth.get("film_temperature_k")
        heat = f", the warmest at {warm.value - _CELSIUS:.3g} degrees Celsius" if warm else ""
        yield "oil", f"least film of the pins {value_text(truth, 'min_film_m')}{heat}{rub}"
    if contacts or not oiled:  # pins in oil never lose contact with it
        yield "contacts", f"{plain(contacts, 2)} in a revolution, dry joints with clearance"


_PIN = "joint.crankpin"
_LOSSY = {f"{_PIN}.damping": 0.0, f"{_PIN}.restitution": 0.3}
_HERTZ = {f"{_PIN}.hertz_stiffness": 5e10}  # as stiff as the linear one at some kN
_OIL = {  # an eye 50 mm long in oil of a warm gearbox
    f"{_PIN}.oil.viscosity": "0.06 Pa s",
    f"{_PIN}.oil.length": "50 mm",
    f"{_PIN}.oil.roughness": "0.6 um",
}
_STARVED = _OIL | {f"{_PIN}.oil.filled_gap": "10 um"}
_DRY = {f"{_PIN}.rung": "compliant"}
_LEVELS = {"pressure.rung": "two-level"}  # other rungs find these angles themselves
_WRIST = {"joint.wristpin.rung": "compliant"}
_GUIDE = {"joint.guide.rung": "compliant"}
_MAIN_BEARING = {  # both together; crank and flywheel
    "crank.mass": "60 kg",
    "crank.bearing.pin_diameter": "70 mm",
    "crank.bearing.stiffness": "400 MN/m",
    "crank.bearing.damping": "60 kN s/m",
    "crank.bearing.friction": 0.02,
}
_SECTION = {"rod.section_area": "8 cm^2", "rod.section_radius": "8 mm"}  # a bar of 28 mm

_SHIFTS = (
    set_to(
        "pressure.rise_delay", ("6 deg", "12 deg"), "the delivery valve opens late", under=_LEVELS
    ),
    set_to(
        "pressure.fall_delay", ("6 deg", "12 deg"), "the suction valve opens late", under=_LEVELS
    ),
    set_to("pressure.rise_angle", ("2 deg", "12 deg"), "stiff liquid, or air in it", under=_LEVELS),
    set_to("pressure.fall_angle", ("2 deg", "12 deg"), "stiff liquid, or air in it", under=_LEVELS),
    set_to("pressure.rung", ("heads", "chamber"), "valves that move, instead of two levels"),
    factor("pressure.suction", 0.5, 1.5, "level of the bilge"),
    factor("pressure.discharge", 0.7, 1.4, "head of the line"),
    factor("drive.speed", 0.8, 1.25, "another gear or motor"),
    set_to("drive.rung", ("motor",), "a motor whose speed gives way under the load"),
    factor(f"{_PIN}.stiffness", 0.5, 2.0, "oil film, bush and rod end in series"),
    factor(f"{_PIN}.damping", 0.4, 2.5, "squeezed oil, cold or hot"),
    factor(f"{_PIN}.friction", 0.4, 2.0, "from full film to dry metal"),
    factor(f"{_PIN}.tangential_damping", 0.3, 3.0, "viscosity of the oil"),
    set_to(f"{_PIN}.one_sided", (0.5,), "an eye worn oval where the load presses", under=_DRY),
    set_to(
        f"{_PIN}.law",
        ("hunt-crossley", "flores", "exact"),
        "no contact law is known to hold in a worn bearing",
        beside=_LOSSY,
    ),
    set_to(
        f"{_PIN}.restitution_speed",
        ("0.15 m/s", "0.6 m/s"),
        "a loss as Hunt and Crossley measured it, larger in faster impacts",
        beside=_LOSSY | {f"{_PIN}.law": "exact"},
    ),
    set_to("piston.seal_friction", ("50 N", "150 N"), "tension of rings or packing"),
    set_to("piston.seal_friction_share", (0.01, 0.04), "rings pressed on by the liquid"),
    set_to(f"{_PIN}.elasticity", ("hertz",), "a pin that touches on a narrow strip", beside=_HERTZ),
    set_to(f"{_PIN}.rung", ("film-map",), "a pin fed with oil under pressure", beside=_OIL),
    set_to(f"{_PIN}.rung", ("mixed",), "a pin that splash or grease reaches", beside=_STARVED),
    set_to("joint.wristpin.rung", ("compliant",), "a wrist pin with the play of a new one"),
    set_to(
        "joint.wristpin.diametral_clearance",
        ("0.12 mm",),
        "a wrist pin worn as well",
        beside=_WRIST,
    ),
    set_to("joint.guide.rung", ("compliant",), "a crosshead with the play of a new one"),
    set_to("joint.guide.diametral_clearance", ("0.25 mm",), "a worn crosshead", beside=_GUIDE),
    set_to(
        "crank.bearing.diametral_clearance",
        ("0.06 mm", "0.16 mm"),
        "main bearings with play, as new and worn",
        beside=_MAIN_BEARING,
        adds=True,
    ),
    set_to("rod.rung", ("elastic",), "steel stretches and bends", beside=_SECTION, adds=True),
    factor("casing.modes.*.frequency", 0.85, 1.15, "another foundation or pattern"),
    factor("casing.modes.*.damping_ratio", 0.4, 2.5, "joints, paint, pipes"),
    factor("rod.mass", 0.8, 1.25, "another drawing"),
    factor("rod.length", 0.85, 1.2, "another drawing"),
    factor("rod.inertia", 0.8, 1.25, "estimated from the mass"),
    factor("piston.mass", 0.8, 1.25, "another drawing"),
    factor("piston.diameter", 0.93, 1.07, "another liner"),
    factor("crank.radius", 0.9, 1.1, "another stroke"),
)

_UNSEEN = (  # measured: docs/decisions/029-oval-eye.md and 031-loose-main-bearings.md
    Unseen(
        path=f"{_PIN}.one_sided",
        severity="diametral_clearance_crankpin",
        text="a crank-pin eye that has worn on its loaded side only is read as wide as it is "
        "across the rod, a third of the limit too low; measure its clearance along the rod, or "
        "use a model of bilge-pump-standard, which has learnt such eyes",
    ),
    Unseen(
        path="crank.bearing.diametral_clearance",
        severity="diametral_clearance_crankpin",
        text="a crank that moves in its main bearings, with play or in oil, misleads the estimate "
        "by a fifth to two thirds of the limit; lift it against a dial gauge, or show the model "
        "records of bilge-pump-loose to refuse (train --refuse)",
        shown="bilge-pump-loose",
    ),
)

PRESENTATION = Presentation(
    draw=_draw_pump,
    lines=_lines,
    sizes=("crank.radius", "rod.length", "piston.diameter", "piston.mass", "rod.mass"),
    shifts=_SHIFTS,
    unseen=_UNSEEN,
)
