"""Figures of the shaft gallery: ``python docs/figures_shaft.py [FOLDER]``, all simulated.

The line with its loads, influence lines, the films of two alignment states, transfer functions
before and after load calibration from model and rig test, and the Campbell diagram.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from scipy.signal import find_peaks
from sheets import COLOURS, label, output_folder, sheet, write
from wearstate.diagnose.machines.registry import presentation_of
from wearstate.diagnose.shaft_tests.before_after import calibrated_test
from wearstate.diagnose.shaft_tests.next_test import rank_tests, usual_responses
from wearstate.diagnose.shaft_tests.rig_figure import rig_figure
from wearstate.diagnose.shaft_tests.rig_setup import ShakerTest
from wearstate.diagnose.shaft_tests.sag_model import Prior
from wearstate.sim.alignment.alignment import AlignmentLine, influence, reactions
from wearstate.sim.alignment.calibration import Calibration, calibrate
from wearstate.sim.beam.campbell import campbell
from wearstate.sim.beam.rotor import Rotor
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.shaft import ShaftScene
from wearstate.sim.shaft.at_rest import ShaftState, shaft_state
from wearstate.sim.shaft.changed import free_line, line_model, rest, unit_change
from wearstate.sim.shaft.changed import transfer as transfer_of
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line
from wearstate.sim.shaft_response.receptance import accelerance

MISALIGNED = {"bearings.2.offset": "-1.0 mm", "bearings.3.offset": "1.4 mm"}
"""The line before calibration: chocks of the two intermediate bearings misaligned."""


@cache
def scene() -> ShaftScene:
    found = load_scene("propulsion-shaft", MISALIGNED)
    assert isinstance(found, ShaftScene)
    return found


@cache
def straight() -> ShaftScene:
    found = load_scene("propulsion-shaft")
    assert isinstance(found, ShaftScene)
    return found


@cache
def calibration() -> Calibration:
    """Least moves that bring the line within its limits, cold, hot and running."""
    return calibrate(alignment_line(scene()), tuple(alignment_conditions(scene()).values()))


@cache
def states() -> Mapping[str, ShaftState]:
    """Beam and films solved together, before and after calibration."""
    found = calibration()
    moves = dict(zip(found.line.names, found.moves.tolist(), strict=True))
    return {"before": shaft_state(scene()), "after calibration": shaft_state(scene(), moves)}


def words(name: str) -> str:
    return name.replace("_", " ")


def outline(axes: Any, model: ShaftScene) -> None:
    """Sections to scale lengthwise, bearings as triangles, discs as bars."""
    at = 0.0
    for section in model.sections:
        size = (section.length, section.outer_diameter)
        axes.add_patch(Rectangle((at, -size[1] / 2), *size, fc="#d5dde6", ec="black", lw=0.8))
        at += section.length
    for disc, row in zip(model.discs, rows(model), strict=True):
        half = 0.12 + 0.5 * math.sqrt(disc.polar_inertia / disc.mass)
        axes.plot([disc.station] * 2, [-half, half], color=COLOURS[1], lw=4, solid_capstyle="butt")
        axes.annotate(
            words(disc.name), (disc.station, 0.45 + 0.11 * row), ha="center", fontsize=7.5
        )
    for bearing in model.bearings:
        foot = -bearing.diameter / 2
        axes.plot(bearing.station, foot - 0.06, marker="^", ms=11, color=COLOURS[0])
        axes.annotate(
            words(bearing.name), (bearing.station, foot - 0.34), ha="center", fontsize=7.5
        )
    axes.set(xlim=(-0.5, at + 0.7), ylim=(-0.65, 0.8), yticks=[])


def rows(model: ShaftScene) -> list[int]:
    """Row of the name of each disc: the next one up where the last is near."""
    found: list[int] = []
    before = -math.inf
    for disc in model.discs:
        found.append(found[-1] + 1 if found and disc.station - before < 0.9 else 0)
        before = disc.station
    return found


def model() -> Figure:
    """The line, its load, bending moment, deflection and reactions, cold."""
    figure, axes = sheet(
        "propulsion-shaft (simulated): model, load, and what it does, set straight and cold",
        4,
        1,
        (12, 10),
        sharex=True,
        height_ratios=(1.2, 1, 1, 1),
    )
    outline(axes[0, 0], straight())
    axes[0, 0].set_title("Model", fontsize=10)
    line = alignment_line(straight())
    rest = reactions(line, alignment_conditions(straight())["cold"])
    at = 0.0
    for section in straight().sections:
        ends = [at, at + section.length]
        axes[1, 0].fill_between(ends, [_weight(straight(), section) / 1e3] * 2, color="#d5dde6")
        at += section.length
    for disc, row in zip(straight().discs, rows(straight()), strict=True):
        newton = disc.mass * straight().gravity - disc.buoyancy
        axes[1, 0].annotate(
            f"{newton / 1e3:.1f} kN",
            xy=(disc.station, 0),
            xytext=(disc.station, 6.2 + 0.7 * row),
            ha="center",
            fontsize=8,
            arrowprops={"arrowstyle": "-|>", "color": COLOURS[1]},
        )
    axes[1, 0].set(ylim=(0, 8.4))
    label(axes[1, 0], "", "weight [kN/m]", "Load")
    axes[2, 0].plot(rest.cut_stations, rest.moments / 1e3, color=COLOURS[0], lw=1.3)
    label(axes[2, 0], "", "bending moment [kN m]", "Moment, positive where the shaft sags")
    axes[3, 0].plot(line.beam.stations, rest.deflections * 1e3, color=COLOURS[0], lw=1.3)
    for bearing, force in zip(straight().bearings, rest.reactions, strict=True):
        axes[3, 0].annotate(
            f"{force / 1e3:.1f} kN",
            xy=(bearing.station, 0),
            xytext=(bearing.station, 0.11),
            ha="center",
            fontsize=8,
            arrowprops={"arrowstyle": "<|-", "color": COLOURS[0]},
        )
    axes[3, 0].set(ylim=(None, 0.14))
    label(axes[3, 0], "station [m]", "deflection [mm]", "Deflection and reactions")
    return figure


def _weight(model: ShaftScene, section: Any) -> float:
    area = math.pi / 4 * (section.outer_diameter**2 - section.inner_diameter**2)
    return float(model.shaft.density * model.gravity * area)


def influence_lines() -> Figure:
    """Effect of raising each bearing on the line and on all reactions."""
    line = alignment_line(straight())
    names = [words(bearing.name) for bearing in straight().bearings]
    figure, axes = sheet(
        "propulsion-shaft (simulated): influence of raising one bearing",
        1,
        2,
        (13, 5),
        width_ratios=(1.5, 1),
    )
    level = reactions(line, unilateral=False)
    for i, name in enumerate(names):
        raised = reactions(_raised(line, i), unilateral=False)
        change = raised.deflections - level.deflections
        axes[0, 0].plot(line.beam.stations, change / 1e-3, lw=1.2, color=COLOURS[i], label=name)
    for bearing in straight().bearings:
        axes[0, 0].axvline(bearing.station, color="#8a8a8a", lw=0.6, ls=":")
    label(axes[0, 0], "station [m]", "deflection [mm per mm]", "Influence lines", "upper left")
    axes[0, 0].set_ylim(-0.6, 2.2)
    table = influence(line) / 1e6
    most = np.abs(table).max()
    axes[0, 1].imshow(table, cmap="RdBu_r", vmin=-most, vmax=most)
    for (i, j), value in np.ndenumerate(table):
        colour = "white" if abs(value) > 0.6 * most else "black"
        axes[0, 1].annotate(
            f"{value:.2f}", (j, i), ha="center", va="center", fontsize=8, color=colour
        )
    axes[0, 1].set_xticks(range(len(names)), names, rotation=30, ha="right", fontsize=8)
    axes[0, 1].set_yticks(range(len(names)), names, fontsize=8)
    axes[0, 1].set_title("Change of reaction (row) by raising (column) [kN/mm]", fontsize=10)
    return figure


def _raised(line: AlignmentLine, i: int) -> AlignmentLine:
    return line.moved(1e-3 * np.eye(len(line.seats))[i])


def films() -> Figure:
    """Pressure on every bearing's unrolled bore, misaligned and calibrated."""
    cases = states()
    count = len(cases["before"].film.bearings)
    figure, axes = sheet(
        "propulsion-shaft (simulated): oil films in two alignment states, 300 rpm",
        2,
        count,
        (16, 6.6),
    )
    for row, (name, case) in zip(axes, cases.items(), strict=True):
        film = case.film
        for i, (each, bearing) in enumerate(zip(row, film.bearings, strict=True)):
            _field(figure, each, film, i)
            each.set_title(
                f"{words(bearing.name)}, {name}\n{film.reactions[i, 0] / 1e3:.1f} kN, least film "
                f"{film.least_film[i] * 1e6:.0f} µm, slope {film.slopes[i, 0] * 1e3:.2f} mm/m",
                fontsize=8.5,
            )
        row[0].set_ylabel("along the bearing, z / L")
    for each in axes[-1]:
        each.set_xlabel("angle from the bottom [deg]")
    return figure


def _field(figure: Figure, axes: Any, film: Any, i: int) -> None:
    pressure = film.films[i].pressure
    scale = film.peak_pressure[i] / max(float(pressure.max()), 1e-30) / 1e6
    half = pressure.shape[0] // 2
    turned = np.roll(pressure, half, axis=0)
    angle = np.linspace(-180, 180, pressure.shape[0] + 1)
    z = np.linspace(-0.5, 0.5, pressure.shape[1])
    closed = np.vstack([turned, turned[:1]]) * scale
    shown = axes.contourf(angle, z, closed.T, levels=14, cmap="viridis")
    bar = figure.colorbar(shown, ax=axes, orientation="horizontal", aspect=30)
    bar.set_label("MPa", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    axes.set_xticks(range(-180, 181, 90))


def transfer() -> Figure:
    """Accelerance of every housing for a force at the propeller, before and after."""
    hertz = np.linspace(2.0, 250.0, 2000)
    names = [bearing.name for bearing in scene().bearings]
    figure, axes = sheet(
        "propulsion-shaft (simulated): acceleration of the housings by a vertical force at the "
        "propeller",
        len(names),
        2,
        (14, 12),
        sharex=True,
        sharey="row",
    )
    force, speed = scene().discs[0].station, math.tau * scene().drive.speed
    places = [(bearing, "y", "housing") for bearing in names]
    for (name, case), colour in zip(states().items(), COLOURS, strict=False):
        for column, rotor in enumerate((case.rotor, springs_alone(case.rotor))):
            h = accelerance(rotor, hertz, places, [(force, "y")], speed=speed)
            for each, values in zip(axes[:, column], np.abs(h[:, :, 0]).T, strict=True):
                level = 20 * np.log10(values / 1e-6)
                each.plot(hertz, level, lw=1.1, color=colour, label=name)
    for row, bearing in zip(axes, names, strict=True):
        last = "frequency [Hz]" if bearing == names[-1] else ""
        label(row[0], last, "dB re 1 µm/s²/N", f"{words(bearing)}: complete films")
        label(row[1], last, "", f"{words(bearing)}: films as springs without damping")
        for each in row:
            each.get_legend().remove()
    axes[0, 0].legend(fontsize=8, loc="lower right")
    return figure


def springs_alone(rotor: Rotor) -> Rotor:
    """The films' stiffness between vertical forces and motions only, as in the source paper."""
    bare = np.zeros((4, 4))
    upright = bare.copy()
    upright[0, 0] = 1.0
    upright[1, 1] = 1.0
    supports = tuple(
        replace(support, stiffness=support.stiffness * upright, damping=bare)
        for support in rotor.supports
    )
    return replace(rotor, supports=supports)


def campbell_diagram() -> Figure:
    """Damped frequencies and damping over the speed, with the films solved at each speed."""
    speeds = np.linspace(60, 480, 29) / 60

    def rotor(speed: float) -> Any:
        turning = load_scene("propulsion-shaft", {"drive.speed": speed / math.tau})
        assert isinstance(turning, ShaftScene)
        return shaft_state(turning).rotor

    table = campbell(rotor, math.tau * speeds, count=22)
    figure, axes = sheet(
        "propulsion-shaft (simulated): Campbell diagram, films in balance at every speed",
        1,
        2,
        (13, 5.5),
    )
    rpm = 60 * speeds
    for track in range(table.frequency_hz.shape[1]):
        if np.nanmin(table.damping_ratio[:, track]) > 0.4:
            continue  # whirl of journals in their films, no resonance
        axes[0, 0].plot(rpm, table.frequency_hz[:, track], lw=1.2, color=COLOURS[track % 6])
        axes[0, 1].plot(rpm, 100 * table.damping_ratio[:, track], lw=1.2, color=COLOURS[track % 6])
    for order, name in (
        (0.5, "half the speed"),
        (1, "1X"),
        (2, "2X"),
        (4, "blade rate"),
        (8, "2 × blade rate"),
    ):
        axes[0, 0].plot(rpm, order * speeds, color="#8a8a8a", lw=0.8, ls="--")
        axes[0, 0].annotate(
            name, (rpm[-1], order * speeds[-1]), fontsize=8, ha="right", va="bottom"
        )
    axes[0, 0].set(ylim=(0, 80))
    label(axes[0, 0], "speed [rpm]", "frequency [Hz]", "Damped natural frequencies")
    axes[0, 1].set(ylim=(0, 40))
    label(axes[0, 1], "speed [rpm]", "damping ratio [%]", "Damping")
    return figure


def rig() -> Figure:
    """A simulated shaker test of the laboratory rig, its third bearing another 0.2 mm lower."""
    bench = load_scene("shaft-rig", {"bearings.2.sag": "0.2 mm"})
    assert isinstance(bench, ShaftScene)
    found = calibrate(alignment_line(bench), tuple(alignment_conditions(bench).values()))
    result = calibrated_test(bench, found, "shaker", push="forward", seed=1)
    assert result is not None
    print(result.summary)
    figure = rig_figure(result)
    assert isinstance(figure, Figure)
    return figure


ALIGNED = {
    "shaft-rig": ({"bearings.2.offset": "0 mm"}, "third", 300.0, ("aft", "forward")),
    "propulsion-shaft": ({}, "intermediate_aft", 200.0, ("stern_aft", "thrust_block")),
}
"""Scene -> overrides that make it straight, sagging bearing, upper frequency [Hz], force places."""

SAGS = {"shaft-rig": (0.1, 0.2, 0.3, 0.4, 0.5), "propulsion-shaft": (0.3, 0.6, 1.2, 1.8, 2.4)}
"""Sags [mm]; the last two of each leave the bearing without load or with an upward load."""

SPEED_SHARES = (0.7, 1.0, 1.3)
AUDIBLE_DB = 1.0


@cache
def aligned_peaks(name: str, push: str, axis: str) -> tuple[tuple[int, int, float], ...]:
    """Numbers of peaks of the sagged line that fall and rise by alignment, largest fall [dB].

    Ordered by speed, then by sag.
    """
    overrides, bearing, high, _ = ALIGNED[name]
    bench = load_scene(name, overrides)
    assert isinstance(bench, ShaftScene)
    base = line_model(bench)
    sag = -1e-3 * unit_change(len(base.names), base.names.index(bearing), "bore")
    hertz = np.linspace(8.0, high, 240)
    seen = [(own, axis, "housing") for own in base.names]
    found = []
    for share in SPEED_SHARES:
        speed = math.tau * share * bench.drive.speed
        line = free_line(base, hertz, speed=speed, forces=[(push, axis)], responses=seen)
        film = rest(base, speed)
        after = _decibels(transfer_of(base, film, line).value[..., 0])
        for size in SAGS[name]:
            sagged = base.changed(size * sag)
            film = rest(sagged, speed, start=film)
            before = _decibels(transfer_of(sagged, film, line).value[..., 0])
            changes = [
                c for k in range(len(seen)) for c in _peak_changes(before[:, k], after[:, k])
            ]
            fell, rose = (sum(side * c > AUDIBLE_DB for c in changes) for side in (-1, 1))
            found.append((fell, rose, min([*changes, 0.0])))
    return tuple(found)


def _decibels(value: Any) -> Any:
    return 20 * np.log10(np.abs(value))


def _peak_changes(before: Any, after: Any) -> list[float]:
    """Change of each peak of at least 3 dB to the highest one within a tenth of its frequency."""
    tops, _ = find_peaks(before, prominence=3.0)
    others, _ = find_peaks(after, prominence=1.0)
    changes = []
    for top in tops:
        near = others[np.abs(others - top) <= max(2, top // 10)]
        level = after[near].max() if near.size else after[top]
        changes.append(float(level - before[top]))
    return changes


def contradiction() -> Figure:
    """Where alignment lowers peaks: by sag, speed, place and direction of the force."""
    figure, panels = sheet("Peaks that alignment lowers (↓) and raises (↑) by a decibel", 2, 4,
                           (13, 6.2))  # fmt: skip
    for row, (name, (_, bearing, _, pushes)) in zip(panels, ALIGNED.items(), strict=True):
        cases = [(push, axis) for push in pushes for axis in "yz"]
        for axes, (push, axis) in zip(row, cases, strict=True):
            cells = aligned_peaks(name, push, axis)
            shape = len(SPEED_SHARES), len(SAGS[name])
            fall = np.array([cell[2] for cell in cells]).reshape(shape)
            image = axes.imshow(fall, cmap="Blues_r", vmin=-9, vmax=0, aspect="auto",
                                origin="lower")  # fmt: skip
            for k, (fell, rose, most) in enumerate(cells):
                place = k % shape[1], k // shape[1]
                axes.annotate(f"{fell}↓\n{rose}↑", place, ha="center", va="center", fontsize=9,
                              color="white" if most < -4.5 else "black")  # fmt: skip
            axes.set_xticks(range(shape[1]), [f"{sag:g}" for sag in SAGS[name]])
            axes.set_yticks(range(shape[0]), [f"{100 * share:.0f} %" for share in SPEED_SHARES])
            way = "up" if axis == "y" else "sideways"
            axes.set_title(f"{name}: push {push} {way}", fontsize=9)
            axes.set_xlabel(f"sag of {bearing} [mm]")
        row[0].set_ylabel("speed")
    figure.colorbar(image, ax=panels, label="largest fall of a peak [dB]", shrink=0.8)
    return figure


BURSTS = (3, 10, 30, 100, 300)
DETECTABLE = 2 * 1.645
"""Standard deviations of a sag that 95 % of the tests detect at 5 % false alarms."""


@cache
def detectable_sags(push: str, axis: str, sensors: int, film: float) -> tuple[float, ...]:
    """Smallest detectable sag of the rig's third bearing for each number of bursts [mm].

    One sensor is that of the third bearing, more are those of all; `film` is the films' error.
    """
    bench = load_scene("shaft-rig", {"bearings.2.offset": "0 mm"})
    assert isinstance(bench, ShaftScene)
    places = [place for place in usual_responses(bench) if sensors > 1 or place[0] == "third"]
    found = []
    for bursts in BURSTS:
        [test] = rank_tests(
            bench,
            prior=Prior(film=film),
            setup=ShakerTest(force=25.0, bursts=bursts),
            places=[(push, axis)],
            responses=places,
        )
        found.append(1e3 * DETECTABLE * test.deviations[1])
    return tuple(found)


def detectability() -> Figure:
    """Smallest sag that a shaker test of the rig detects, over its length."""
    figure, panels = sheet("Smallest detectable sag of the rig's third bearing", 1, 2, (10, 3.8))
    cases = [("third", "y"), ("forward", "y"), ("aft", "y"), ("aft", "z")]
    for axes, sensors, title in zip(
        np.ravel(panels), (4, 1), ("four accelerometers", "one, on the third bearing"), strict=True
    ):
        for (push, axis), colour in zip(cases, COLOURS, strict=False):
            name = f"push {push} {'up' if axis == 'y' else 'sideways'}"
            sags = {film: detectable_sags(push, axis, sensors, film) for film in (0.03, 0.01)}
            axes.loglog(BURSTS, sags[0.03], "o-", color=colour, label=name)
            axes.loglog(BURSTS, sags[0.01], "--", color=colour, lw=0.8)
        label(axes, "bursts of 4 s", "sag [mm]", title)
    return figure


def recording() -> Figure:
    """Recording of a line with a worn stern bearing, and quantities that no sensor measures."""
    worn = load_scene("propulsion-shaft", {"bearings.0.wear_down": "0.9 mm"})
    figure = Figure(figsize=(11, 7), layout="constrained")
    figure.suptitle(f"{worn.name} (simulated)")
    presentation_of(worn).draw(figure, worn, simulate(worn, seed=1, truth=True))
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "shaft-model": model,
    "shaft-influence": influence_lines,
    "shaft-films": films,
    "shaft-transfer": transfer,
    "shaft-campbell": campbell_diagram,
    "shaft-rig": rig,
    "shaft-contradiction": contradiction,
    "shaft-detectability": detectability,
    "shaft-recording": recording,
}


if __name__ == "__main__":
    write(FIGURES, output_folder())
