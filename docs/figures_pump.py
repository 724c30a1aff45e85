"""Figures of the pump gallery: ``python docs/figures_pump.py [FOLDER]``, all simulated.

The source paper's four figures (combined cylinder pressure, piston velocity with and without
clearance, casing modes, transfer function), the pins in their clearance circles, a map of contact,
flight and impact, the signatures of other faults, the triplex pump, and lives of crank pins.
"""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from sheets import COLOURS, label, output_folder, sheet, write
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.sim.hydraulics.flow_ripple import even_phases, flow_ripple
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.machine.transfer import scene_transfer
from wearstate.sim.pump.scene_run import pin_offsets, run_scene
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.pump import PumpScene
from wearstate.sim.wear.rate import joint_wear

STEP = 1 / 51_200  # s
SETTLING = 2  # revolutions
CHAMBER = {"pressure.rung": "chamber"}
WORN = {"joint.crankpin.diametral_clearance": "0.31 mm"}


def pump(overrides: dict[str, Any] | None = None, name: str = "bilge-pump") -> PumpScene:
    scene = load_scene(name, overrides)
    assert isinstance(scene, PumpScene)
    return scene


def turn(scene: PumpScene, revolutions: float = 1.0) -> dict[str, NDArray[np.float64]]:
    """Crank angle [deg] and signals of the last revolutions of a run, from top dead centre."""
    period = 1 / scene.drive.speed
    n = round(period / STEP * revolutions)
    before = SETTLING * round(period / STEP)
    start = -2 * np.pi * scene.drive.speed * before * STEP
    run = run_scene(scene, step=STEP, n_steps=before + n, start_angle=start, keep_states=True)
    run.status.ok or sys.exit(f"{scene.name}: {run.status.text}")
    assert run.bodies is not None
    angle = np.degrees(run.turns[before:, 0])
    bodies = run.bodies[before:, 0]
    found = {
        "angle": angle,
        "piston_velocity": bodies[:, 9],
        "pressure": -run.force("piston_x")[before - 1 :] / (np.pi / 4 * scene.piston.diameter**2),
        "pin_force": np.hypot(run.force("pin_x"), run.force("pin_y"))[before - 1 :],
        "wrist_force": np.hypot(run.force("wrist_x"), run.force("wrist_y"))[before - 1 :],
        "offset": pin_offsets(scene, run.turns[before:, 0], bodies),
        "speed": run.turns[before:, 1] / (2 * np.pi),
        "moment": run.forces[before - 1 :, 0],
    }
    if run.chambers is not None:
        found["pressure"] = run.chambers[before:, 0, 0]
        found["lifts"] = run.chambers[before:, 0][:, [2, 4]]
        found["chambers"] = run.chambers[before:]
    return found


def degrees(axes: Any) -> None:
    axes.set(xlim=(0, 360), xticks=range(0, 361, 60))


def pressure() -> Figure:
    """Combined cylinder pressure by rung, and with two faults."""
    figure, axes = sheet(
        "bilge-pump (simulated): cylinder pressure over a revolution, 300 rpm", 3, size=(9, 9)
    )
    rungs = {
        "two-level": {},
        "heads, exact flow": {"pressure.rung": "heads"},
        "heads, two harmonics": {"pressure.rung": "heads", "pressure.flow": "two-harmonic"},
        "chamber": CHAMBER,
    }
    top, middle, bottom = axes[:, 0]
    for (name, change), colour in zip(rungs.items(), COLOURS, strict=False):
        r = turn(pump({**change, "joint.crankpin.rung": "ideal"}))
        style = "--" if "two harm" in name else "-"
        top.plot(r["angle"], r["pressure"] / 1e3, style, lw=1.2, color=colour, label=name)
        if "lifts" in r:
            for column, side in enumerate(("suction valve", "discharge valve")):
                lift = 1e3 * r["lifts"][:, column]
                middle.plot(r["angle"], lift, lw=1.2, color=COLOURS[column], label=side)
    faults = {
        "healthy": {},
        "discharge valve leaks 50 mm²": {"pressure.discharge_valve.leak_area": "50 mm^2"},
        "suction at -85 kPa: cavitates": {"pressure.suction": "-85 kPa"},
        "suction valve stuck open 3 mm": {"pressure.suction_valve.stuck_lift": "3 mm"},
    }
    for (name, change), colour in zip(faults.items(), COLOURS, strict=False):
        r = turn(pump({**CHAMBER, **change}))
        bottom.plot(r["angle"], r["pressure"] / 1e3, lw=1.1, color=colour, label=name)
    label(top, "", "gauge pressure [kPa]", "Rungs of the cylinder pressure, without clearance")
    label(middle, "", "lift [mm]", "Valves of the chamber")
    label(
        bottom,
        "crank angle after top dead centre [deg]",
        "gauge pressure [kPa]",
        "Faults (chamber)",
    )
    for each in axes[:, 0]:
        degrees(each)
    return figure


def velocity() -> Figure:
    """Piston axial velocity with and without clearance."""
    figure, axes = sheet(
        "bilge-pump (simulated): piston along the stroke, 300 rpm", 3, size=(9, 8), sharex=True
    )
    ideal, worn = turn(pump({"joint.crankpin.rung": "ideal"})), turn(pump(WORN))
    first, second, third = axes[:, 0]
    first.plot(
        ideal["angle"], ideal["piston_velocity"], color=COLOURS[4], lw=2.5, label="no clearance"
    )
    first.plot(worn["angle"], worn["piston_velocity"], color=COLOURS[1], lw=0.9, label="0.31 mm")
    difference = 1e3 * (worn["piston_velocity"] - ideal["piston_velocity"])
    second.plot(worn["angle"], difference, color=COLOURS[1], lw=0.9)
    for r, name, colour, width in (
        (ideal, "no clearance", COLOURS[4], 2.5),
        (worn, "0.31 mm", COLOURS[1], 0.7),
    ):
        acceleration = np.gradient(r["piston_velocity"], STEP)
        third.plot(r["angle"], acceleration, color=colour, lw=width, label=name)
    label(first, "", "velocity [m/s]", "Velocity")
    label(
        second,
        "",
        "difference [mm/s]",
        "Effect of the clearance: the pin crosses, strikes, bounces",
    )
    label(third, "crank angle after top dead centre [deg]", "acceleration [m/s²]", "Acceleration")
    degrees(third)
    return figure


def modes() -> Figure:
    """Casing mode shapes at every place."""
    scene = pump()
    figure, axes = sheet(
        "bilge-pump (simulated): casing modes, mass-normalised shapes", 2, 4, (12, 5.5), sharey=True
    )
    places = ["bearing_x", "bearing_y", "guide_y", "cylinder_x", "acc_x", "acc_y"]
    for mode, each in zip(scene.casing.modes, axes.ravel(), strict=True):
        values = [mode.shape.get(place, 0.0) for place in places]
        colours = [COLOURS[0] if value >= 0 else COLOURS[1] for value in values]
        each.bar(range(len(places)), values, color=colours)
        each.axhline(0, color="black", lw=0.8)
        each.set_xticks(
            range(len(places)), [p.replace("_", " ") for p in places], rotation=90, fontsize=8
        )
        each.set_title(f"{mode.frequency:.0f} Hz, ζ = {mode.damping_ratio:.1%}", fontsize=10)
        each.grid(alpha=0.3, axis="y")
    for each in axes[:, 0]:
        each.set_ylabel("shape [kg$^{-1/2}$]")
    return figure


def transfer() -> Figure:
    """Accelerance of the casing, magnitude and phase."""
    scene = pump()
    figure, axes = sheet(
        "bilge-pump (simulated): accelerance of the casing", 2, 2, (11, 6.5), sharex=True
    )
    found = scene_transfer(scene, np.geomspace(50, 11_500, 4000))
    f = found.frequency
    for column, place in enumerate(("bearing_x", "guide_y")):
        for row, (sensor, colour) in enumerate(zip(found.sensors, COLOURS, strict=False)):
            h = found.values[row, found.places.index(place)]
            axes[0, column].semilogx(f, 20 * np.log10(np.abs(h)), color=colour, lw=1, label=sensor)
            axes[1, column].semilogx(f, np.degrees(np.angle(h)), color=colour, lw=0.9, label=sensor)
        name = f"force at {place.replace('_', ' ')}"
        label(axes[0, column], "", "magnitude [dB re 1 (m/s²)/N]", name, "lower right")
        label(axes[1, column], "frequency [Hz]", "phase [deg]", "", "lower left")
        axes[1, column].set_yticks(range(-180, 181, 90))
    return figure


def orbit() -> Figure:
    """Pins in their clearance circles, coloured by force."""
    figure, axes = sheet(
        "bilge-pump (simulated): pin in its clearance circle over two revolutions", 1, 4, (14, 4.2)
    )
    wrist = {"joint.wristpin.rung": "compliant", "joint.wristpin.diametral_clearance": "0.20 mm"}
    cases = [
        ("crank pin, as new: 0.08 mm", {}, 0, "pin_force"),
        (
            "crank pin, worn: 0.22 mm",
            {"joint.crankpin.diametral_clearance": "0.22 mm"},
            0,
            "pin_force",
        ),
        ("crank pin, condemned: 0.31 mm", WORN, 0, "pin_force"),
        ("wrist pin, condemned: 0.20 mm", wrist, 2, "wrist_force"),
    ]
    for each, (name, change, column, force) in zip(axes[0], cases, strict=True):
        scene = pump(change)
        r = turn(scene, 2.0)
        joint = scene.joint.wristpin if column else scene.joint.crankpin
        assert joint is not None
        circle = joint.clearance_radial * 1e6 * np.exp(2j * np.pi * np.linspace(0, 1, 181))
        each.plot(circle.real, circle.imag, color="black", lw=1)
        x, y = 1e6 * r["offset"][:, column], 1e6 * r["offset"][:, column + 1]
        dots = each.scatter(
            x, y, c=r[force] / 1e3, s=1.5, cmap="viridis", vmin=0, vmax=4, rasterized=True
        )
        each.set_aspect("equal", adjustable="datalim")
        label(each, "along the stroke [µm]", "across [µm]" if each is axes[0, 0] else "", name)
    figure.colorbar(dots, ax=axes[0, -1], label="force on the rod [kN]")
    return figure


def contact_map(
    changes: list[dict[str, Any]], bins: int = 120
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Share of free flight, and peak force of landings [kN], by angle, for a list of scenes."""
    flight, strike = np.zeros((len(changes), bins)), np.zeros((len(changes), bins))
    for row, change in enumerate(changes):
        r = turn(pump(change), 4.0)
        where = ((r["angle"] % 360) / 360 * bins).astype(int)
        free = r["pin_force"] == 0
        count = np.bincount(where, minlength=bins)
        flight[row] = np.bincount(where, free, minlength=bins) / count
        for landing in np.flatnonzero(free[:-1] & ~free[1:]):
            after = r["pin_force"][landing + 1 : landing + 1 + round(1e-3 / STEP)]
            strike[row, where[landing]] = max(strike[row, where[landing]], after.max() / 1e3)
    return flight, strike


def flight_map(cells: int = 24) -> Figure:
    """Contact, flight and impact over a revolution against clearance and against speed."""
    figure, axes = sheet(
        "bilge-pump (simulated): flight and landing of the crank pin, four revolutions each",
        2,
        2,
        (12, 7.5),
    )
    clearances, speeds = np.geomspace(0.05e-3, 0.465e-3, cells), np.linspace(180, 480, cells)
    key = "joint.crankpin.diametral_clearance"
    sweeps = [
        ("diametral clearance [mm]", 1e3 * clearances, [{key: c} for c in clearances]),
        ("speed [rpm], at 0.31 mm", speeds, [{**WORN, "drive.speed": s / 60} for s in speeds]),
    ]
    for column, (name, values, changes) in enumerate(sweeps):
        flight, strike = contact_map(changes)
        angle = np.linspace(0, 360, flight.shape[1] + 1)
        edges = np.interp(np.arange(cells + 1) - 0.5, np.arange(cells), values)
        shown = axes[0, column].pcolormesh(angle, edges, flight, cmap="Blues", vmin=0, vmax=1)
        figure.colorbar(shown, ax=axes[0, column], label="share of time in flight")
        hit = np.ma.masked_equal(strike, 0)
        shown = axes[1, column].pcolormesh(angle, edges, hit, cmap="inferno_r", vmin=0)
        figure.colorbar(shown, ax=axes[1, column], label="peak within 1 ms of landing [kN]")
        for each in axes[:, column]:
            label(each, "crank angle after top dead centre [deg]", name)
            degrees(each)
    return figure


FAULTS = {
    "as new": {},
    "crank pin 0.31 mm": WORN,
    "wrist pin 0.20 mm": {
        "joint.wristpin.rung": "compliant",
        "joint.wristpin.diametral_clearance": "0.20 mm",
    },
    "discharge valve leaks 50 mm²": {"pressure.discharge_valve.leak_area": "50 mm^2"},
    "suction at -85 kPa": {"pressure.suction": "-85 kPa"},
}


def faults() -> Figure:
    """Acceleration by crank angle for wear and for faults that must not be mistaken for it."""
    figure, axes = sheet(
        "bilge-pump with valves (simulated): casing acceleration acc_x over a revolution",
        len(FAULTS),
        size=(9, 9.5),
        sharex=True,
        sharey=True,
    )
    for each, (name, change), colour in zip(
        axes[:, 0], FAULTS.items(), COLOURS[: len(FAULTS)], strict=True
    ):
        scene = pump({**CHAMBER, **change, "duration": "0.6 s"})
        signal = simulate(scene, seed=1).signal[0]
        n = round(scene.sample_rate / scene.drive.speed)
        angle = 360 * np.arange(n) / n
        for k in range(3):
            each.plot(angle, signal[k * n : (k + 1) * n], lw=0.5, color=colour, alpha=0.6)
        rms = signal[: 3 * n].std()
        label(each, "", "[m/s²]", f"{name}: {rms:.1f} m/s² rms, three revolutions")
    axes[-1, 0].set_xlabel("crank angle after top dead centre [deg]")
    degrees(axes[-1, 0])
    return figure


def triplex() -> Figure:
    """Pressures, moment, speed ripple and flow ripple of the triplex pump."""
    figure, axes = sheet("triplex-pump (simulated), 450 rpm, 10 MPa", 4, size=(9, 10), sharex=True)
    scene = pump({}, "triplex-pump")
    r = turn(scene)
    motor = turn(pump({"drive.rung": "motor"}, "triplex-pump"))
    angle = r["angle"]
    for k in range(3):
        name = f"throw {k + 1}"
        axes[0, 0].plot(angle, r["chambers"][:, k, 0] / 1e6, lw=1, color=COLOURS[k], label=name)
    axes[1, 0].plot(angle, r["moment"], lw=0.9, color=COLOURS[0], label="constant speed")
    axes[1, 0].plot(motor["angle"], motor["moment"], lw=1.2, color=COLOURS[1], label="motor")
    ripple = 100 * (motor["speed"] / motor["speed"].mean() - 1)
    axes[2, 0].plot(motor["angle"], ripple, lw=1.2, color=COLOURS[1])
    flow = kinematic_flow(scene, np.radians(angle))
    ripple_of = flow_ripple(scene.crank.radius / scene.rod.length, even_phases(3))
    axes[3, 0].plot(angle, 100 * (flow / flow.mean() - 1), lw=1.2, color=COLOURS[2])
    label(
        axes[0, 0],
        "",
        "pressure [MPa]",
        "Chambers: compression takes a part of the stroke",
        "upper right",
    )
    label(axes[1, 0], "", "moment [N m]", "Drive moment at the crank", "upper right")
    label(axes[2, 0], "", "speed [% of mean]", "Speed ripple with motor and flywheel")
    name = (
        f"Kinematic flow: +{ripple_of.above:.1%}, -{ripple_of.below:.1%}, "
        f"together {ripple_of.total:.1%} of the mean"
    )
    label(axes[3, 0], "crank angle of throw 1 [deg]", "flow [% of mean]", name)
    degrees(axes[3, 0])
    return figure


def kinematic_flow(scene: PumpScene, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Kinematic flow of all throws, over piston area, crank radius and speed."""
    ratio = scene.crank.radius / scene.rod.length
    total = np.zeros_like(angle)
    for throw in scene.throws:
        a = angle + throw.phase
        speed = np.sin(a) * (1 + ratio * np.cos(a) / np.sqrt(1 - (ratio * np.sin(a)) ** 2))
        total += np.maximum(-speed, 0.0)
    return total


MACHINES = 6


def life() -> Figure:
    """Clearance and remaining life against operating time, place and power of the wear."""
    recipe = load_recipe("bilge-pump-life")
    each = recipe.table.records_per_group
    rows = [sample.row for sample in sample_records(recipe, MACHINES * each, seed=1)]
    figure, axes = sheet("Crank pins of bilge pumps over their lives (simulated)", 2, 2, (11, 7.5))
    worn, left, scar, rate = axes.flat
    for group, colour in zip(range(MACHINES), COLOURS, strict=True):
        own = rows[each * group : each * (group + 1)]
        hours = [row["operating_hours"] / 1000 for row in own]
        clearance = [1e3 * row["diametral_clearance_crankpin_m"] for row in own]
        worn.plot(hours, clearance, ".-", color=colour, lw=0.8)
        left.plot(
            hours, [row["remaining_life_h"] / 1000 for row in own], ".-", color=colour, lw=0.8
        )
    worn.axhline(1e3 * recipe.severities[0].edges[-1], color="k", lw=0.8, ls="--")
    label(worn, "operating time [1000 h]", "clearance [mm]", "Clearance; dashed: condemned", "")
    label(left, "operating time [1000 h]", "remaining life [1000 h]", "Hours to the limit", "")
    clearances = (0.05, 0.13, 0.22, 0.31, 0.465)  # mm
    found = [
        joint_wear(pump({"joint.crankpin.diametral_clearance": f"{c} mm"}), "crankpin")
        for c in clearances
    ]
    angle = np.arange(found[0].eye.size)
    scar.plot(angle, 2 * np.pi * found[0].eye, color=COLOURS[0], label="eye, from the rod's end")
    scar.plot(angle, 2 * np.pi * found[0].pin, color=COLOURS[1], label="pin, from the crank")
    label(scar, "angle [deg]", "depth over its mean", "Where they wear", "upper left")
    rate.plot(clearances, [wear.power for wear in found], "o-", color=COLOURS[2])
    rate.set_ylim(0, 1500)
    label(rate, "clearance [mm]", "force times sliding speed [W]", "Sliding power by clearance", "")
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "pump-pressure": pressure,
    "pump-velocity": velocity,
    "pump-modes": modes,
    "pump-transfer": transfer,
    "pump-orbit": orbit,
    "pump-map": flight_map,
    "pump-faults": faults,
    "pump-triplex": triplex,
    "bilge-pump-life": life,
}


if __name__ == "__main__":
    write(FIGURES, output_folder())
