"""Figures of the journal gallery: ``python docs/figures_journal.py [FOLDER]``, all simulated.

The source paper's orbits and films under three load histories, the pressure field through a
pulse, the way from a spot to half-frequency whirl, the impedance map, the rungs, and a worn bore.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from sheets import COLOURS, label, output_folder, sheet, write
from wearstate.sim.bearing.equilibrium import equilibrium
from wearstate.sim.film.impedance_map import impedance_map
from wearstate.sim.film.map_look_up import map_force
from wearstate.sim.film.rungs import FILM_RUNGS
from wearstate.sim.film.solve import FilmGeometry, FilmState, dufrane_scar, film_gap, solve_direct
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import Recording
from wearstate.sim.scene.journal import JournalScene
from wearstate.sim.scene.load import load_scene

CASES = {
    "journal-step": "step load",
    "journal-rectangular-pulse": "rectangular pulse",
    "journal-half-sine": "half-sine pulse",
}
PAPER = FilmGeometry(length_to_diameter=2 / 3, condition="periodic")


def run(
    name: str, overrides: dict[str, Any] | None = None
) -> tuple[JournalScene, Recording, NDArray[np.float64], NDArray[np.float64]]:
    """Scene, solution, tau, and journal centre over the clearance."""
    scene = load_scene(name, overrides)
    assert isinstance(scene, JournalScene)
    solution = simulate(scene, seed=1, truth=True)
    n = solution.signal.shape[1]
    tau = 2 * np.pi * scene.drive.speed * np.arange(n) / solution.sample_rate
    return scene, solution, tau, solution.truth["journal_m"] / scene.bearing.clearance_radial


def clearance_circle(axes: Any) -> None:
    """Unit circle, X downwards along the load, Y to the right."""
    circle = np.exp(2j * np.pi * np.linspace(0, 1, 181))
    axes.plot(circle.imag, circle.real, color="black", lw=1)
    axes.set_aspect("equal", adjustable="box")
    axes.invert_yaxis()


def cases() -> Figure:
    """Orbit, coordinates, film force and peak pressure under the paper's three loads."""
    figure, axes = sheet(
        "Journal bearing of the source paper (simulated): L/D 2/3, 3000 rpm, load from τ = 16π",
        3,
        4,
        (15, 10),
    )
    for row, (name, title) in zip(axes, CASES.items(), strict=True):
        _, solution, tau, place = run(name)
        clearance_circle(row[0])
        row[0].plot(place[:, 1], place[:, 0], lw=0.8, color=COLOURS[0])
        label(row[0], "Y", "X", title)
        for column, axis in enumerate("XY"):
            row[1].plot(tau, place[:, column], lw=1, color=COLOURS[column], label=axis)
            force = solution.truth["film_force_n"][:, column] / 1e3
            row[2].plot(tau, force, lw=1, color=COLOURS[column], label=f"F_{axis}")
        label(row[1], "τ", "over the clearance", "Journal centre")
        label(row[2], "τ", "on the journal [kN]", "Film force")
        peak = solution.truth["peak_pressure_pa"]
        before = peak[np.searchsorted(tau, 15.9 * np.pi)]
        row[3].plot(tau, peak / before, lw=1, color=COLOURS[2])
        label(row[3], "τ", "over that before the load", "Peak film pressure")
    return figure


def pressure_field() -> Figure:
    """Film pressure before, during and after the rectangular pulse."""
    instants = (15.9, 16.2, 17.0, 17.95, 18.3, 24.0)  # of pi
    scene, solution, tau, place = run("journal-rectangular-pulse")
    speed = 2 * np.pi * scene.drive.speed * scene.bearing.clearance_radial
    rate = solution.truth["journal_velocity_m_s"] / speed
    fields = []
    for instant in instants:
        i = int(np.searchsorted(tau, instant * np.pi))
        state = FilmState(x=place[i, 0], y=place[i, 1], x_rate=rate[i, 0], y_rate=rate[i, 1])
        fields.append(solve_direct(PAPER, state).pressure)
    figure, axes = sheet(
        "journal-rectangular-pulse (simulated): film pressure P, pulse from 16π to 18π",
        2,
        3,
        (12, 6.5),
        sharex=True,
        sharey=True,
    )
    top = max(float(field.max()) for field in fields)
    angle = np.linspace(-180, 180, PAPER.n_theta + 1)
    z = np.linspace(-0.5, 0.5, PAPER.n_z)
    for each, instant, field in zip(axes.ravel(), instants, fields, strict=True):
        centred = np.roll(field, PAPER.n_theta // 2, axis=0)
        closed = np.vstack([centred, centred[:1]])
        shown = each.contourf(angle, z, closed.T, levels=np.linspace(0, top, 17), cmap="viridis")
        each.set_title(f"τ = {instant:g}π, largest {field.max():.1f}", fontsize=10)
        each.set_xticks(range(-180, 181, 90))
    for each in axes[-1]:
        each.set_xlabel("θ from the load's direction [deg]")
    for each in axes[:, 0]:
        each.set_ylabel("z / L")
    figure.colorbar(shown, ax=axes, label="P")
    return figure


def threshold(speeds: tuple[float, ...] = (4400, 4800, 4900, 5200, 6000)) -> Figure:
    """From a fixed point to half-frequency whirl as the speed passes the threshold."""
    figure, axes = sheet(
        "journal-whirl (simulated): through the threshold of stability", 2, len(speeds), (15, 6.2)
    )
    for column, rpm in enumerate(speeds):
        scene, _, _, place = run("journal-whirl", {"drive.speed": rpm / 60, "duration": "2 s"})
        orbit, wave = axes[0, column], axes[1, column]
        clearance_circle(orbit)
        half = place.shape[0] // 2
        orbit.plot(place[:half, 1], place[:half, 0], lw=0.3, color=COLOURS[4], label="first second")
        orbit.plot(place[half:, 1], place[half:, 0], lw=0.6, color=COLOURS[1], label="second")
        label(orbit, "Y", "X" if column == 0 else "", f"{rpm:.0f} rpm")
        if column:
            orbit.get_legend().remove()
        late = place[half:] @ np.array([1.0, 1.0j])
        spectrum = np.abs(np.fft.fft((late - late.mean()) * np.hanning(late.size))) / late.size * 2
        order = np.fft.fftfreq(late.size, 1 / 25_600) / scene.drive.speed
        keep = np.argsort(order)
        wave.semilogy(order[keep], spectrum[keep] + 1e-9, lw=0.8, color=COLOURS[1])
        wave.set(xlim=(-1.5, 1.5), ylim=(1e-7, 2))
        label(wave, "order", "radius over the clearance" if column == 0 else "", "Full spectrum")
    return figure


def impedance() -> Figure:
    """The film force as a table over two variables."""
    table = impedance_map(PAPER).table
    eccentricity = np.linspace(0.0, 0.95, 96)
    angle = np.radians(np.linspace(0, 360, 181))
    force = np.array(
        [[map_force(table, e, 0.0, *_rates(e, a)) for a in angle] for e in eccentricity]
    )
    softened = force * (1 - eccentricity[:, None, None]) ** 1.5
    figure, axes = sheet(
        "Impedance map, L/D 2/3, periodic Reynolds condition (simulated): force per |V|",
        1,
        2,
        (12, 4.8),
    )
    for column, name in enumerate(("along the line of centres", "across it")):
        most = float(np.abs(softened[..., column]).max())
        shown = axes[0, column].contourf(
            np.degrees(angle),
            eccentricity,
            softened[..., column],
            levels=np.linspace(-most, most, 25),
            cmap="RdBu_r",
        )
        figure.colorbar(shown, ax=axes[0, column], label="F (1 - ε)$^{3/2}$ / |V|")
        label(axes[0, column], "angle of V from the line of centres [deg]", "eccentricity ε", name)
        axes[0, column].set_xticks(range(0, 361, 60))
    return figure


def _rates(eccentricity: float, angle: float) -> tuple[float, float]:
    """Rates for which V has length one, at an angle from the line of centres, which is along X."""
    return np.cos(angle), np.sin(angle) + eccentricity / 2  # V = (X' + Y/2, Y' - X/2)


def rungs() -> Figure:
    """Load over eccentricity by rung, for three lengths."""
    lengths = (0.25, 1.0, 4.0)
    figure, axes = sheet(
        "Rungs of the film (simulated): force of a steady journal", 1, 3, (13, 4.6)
    )
    eccentricity = np.linspace(0.05, 0.9, 18)
    for each, length in zip(axes[0], lengths, strict=True):
        geometry = FilmGeometry(length_to_diameter=length, condition="reynolds")
        shown = (rung for rung in FILM_RUNGS if rung.bearing)
        for rung, colour in zip(shown, COLOURS, strict=False):
            force = [
                float(np.hypot(*rung.field(geometry, FilmState(x=e, y=0.0)).force))
                for e in eccentricity
            ]
            each.semilogy(eccentricity, force, lw=1.2, color=colour, label=rung.name)
        label(each, "eccentricity ε", "force [η ω R³ L / C²]" if length == 0.25 else "")
        each.set_title(f"L/D = {length:g}", fontsize=10)
    return figure


def scar() -> Figure:
    """Effect of a worn scar on gap and pressure of a bearing under steady load."""
    load, n = 1 / (np.pi * 0.18), 144
    figure, axes = sheet(
        "Worn bore after Dufrane (simulated): L/D 1, Sommerfeld number 0.18, load at 0",
        1,
        2,
        (12, 4.4),
    )
    angle = np.linspace(-180, 180, n, endpoint=False)
    for depth, colour in zip((0.0, 0.1, 0.2, 0.3), COLOURS, strict=False):
        bore = dufrane_scar(depth, 0.0, n) if depth else None
        geometry = FilmGeometry(length_to_diameter=1.0, n_theta=n, condition="periodic", bore=bore)
        found = equilibrium(geometry, (load, 0.0))
        state = FilmState(x=found.position[0], y=found.position[1])
        gap = film_gap(geometry, state)[:, geometry.n_z // 2]
        middle = solve_direct(geometry, state).pressure[:, geometry.n_z // 2]
        name = f"depth {depth:g} C: ε {np.hypot(*found.position):.2f}"
        axes[0, 0].plot(angle, np.roll(gap, n // 2), lw=1.1, color=colour, label=name)
        axes[0, 1].plot(angle, np.roll(middle, n // 2), lw=1.1, color=colour, label=name)
    label(axes[0, 0], "θ from the load [deg]", "gap H", "Gap")
    label(axes[0, 1], "θ from the load [deg]", "pressure P", "Pressure at the middle")
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "journal-cases": cases,
    "journal-field": pressure_field,
    "journal-threshold": threshold,
    "journal-map": impedance,
    "journal-rungs": rungs,
    "journal-scar": scar,
}


if __name__ == "__main__":
    write(FIGURES, output_folder())
