"""Figure of the page on lubrication: ``python docs/figures_oil.py [FOLDER]``, simulated.

Effect of oil in the crank pin on the vibration of a bilge pump, by clearance, speed, viscosity and
filled gap. The figure is drawn from the table of the page; ``--table`` computes and prints that
table in some minutes.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from sheets import output_folder, write
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene

CLEARANCES = (0.06e-3, 0.1e-3, 0.15e-3, 0.2e-3, 0.3e-3, 0.45e-3)  # m, diametral
SPEEDS = (200, 300)  # rpm
OIL = {
    "joint.crankpin.oil.length": "50 mm",
    "joint.crankpin.oil.roughness": "0.6 um",
    "joint.crankpin.oil.wall_damping": "3 kN s/m",
}
REGIMES: dict[str, dict[str, Any]] = {
    "dry": {},
    "starved, 5 um": {"viscosity": "0.06 Pa s", "filled_gap": "5 um"},
    "starved, 20 um": {"viscosity": "0.06 Pa s", "filled_gap": "20 um"},
    "flooded, 0.03 Pa s": {"viscosity": "0.03 Pa s"},
    "flooded, 0.1 Pa s": {"viscosity": "0.1 Pa s"},
}
"""Name -> oil of the crank pin."""

PAGE = Path(__file__).parent / "lubrication.md"

COLOURS = ("#1f5a94", "#b3541e", "#d08a3e", "#4f7d3a", "#7fae6a")


def run(clearance: float, speed: float, regime: str) -> tuple[float, float, float]:
    """Rms vibration across the stroke [m/s^2], least film [m], share of asperity contact."""
    oil = REGIMES[regime]
    changes: dict[str, Any] = {
        "joint.crankpin.diametral_clearance": clearance,
        "drive.speed": f"{speed} rpm",
        "duration": "2 s",
        **{f"sensors.{n}.noise": 0.0 for n in range(2)},
    }
    if oil:
        changes |= OIL | {f"joint.crankpin.oil.{key}": value for key, value in oil.items()}
        changes["joint.crankpin.rung"] = "mixed"
    recording = simulate(load_scene("bilge-pump", changes), seed=0)
    channel = [part.name for part in recording.channels].index("acc_y")
    signal = recording.signal[channel].astype(float)
    numerics = recording.numerics
    return (
        float(signal.std()),
        float(numerics.get("min_film_m", np.nan)),
        float(numerics.get("rubbing_share", np.nan)),
    )


def table() -> dict[tuple[int, str], list[tuple[float, float, float]]]:
    """Speed and regime -> results for each clearance."""
    return {
        (speed, regime): [run(clearance, speed, regime) for clearance in CLEARANCES]
        for speed in SPEEDS
        for regime in REGIMES
    }


def stated() -> dict[tuple[int, str], list[float]]:
    """Speed and regime -> vibration at each clearance [m/s^2], from the page's table."""
    text = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| ([^|]+) \| (.+) \| [^|]* \|$", text, re.MULTILINE)
    return {
        (int(speed), regime.replace("µm", "um")): [float(level) for level in levels.split(" | ")]
        for speed, regime, levels in rows
    }


def picture() -> Figure:
    found = stated()
    figure = Figure(figsize=(9, 3.8), layout="constrained")
    figure.suptitle("Bilge pump: vibration by the oil in its crank pin (simulated)", fontsize=11)
    for axes, speed in zip(figure.subplots(1, 2, sharey=True), SPEEDS, strict=True):
        for regime, colour in zip(REGIMES, COLOURS, strict=True):
            level = found[speed, regime]
            axes.plot(1e3 * np.array(CLEARANCES), level, "o-", ms=4, color=colour, label=regime)
        axes.set(yscale="log", xlabel="diametral clearance [mm]", title=f"{speed} rpm")
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("acc_y, rms [m/s²]")
    figure.axes[0].legend(fontsize=8)
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {"pump-oil": picture}


def print_table() -> None:
    """Compute the table and print it in the format of the page."""
    heads = " | ".join(f"{1e3 * clearance:g} mm" for clearance in CLEARANCES)
    print(f"| speed | oil | {heads} | least film |")
    print("|---" * (len(CLEARANCES) + 3) + "|")
    for (speed, regime), rows in table().items():
        levels = " | ".join(f"{row[0]:.3g}" for row in rows)
        films = [1e6 * row[1] for row in rows if np.isfinite(row[1])]
        least = f"{min(films):.2g} µm" if films else ""
        print(f"| {speed} | {regime.replace('um', 'µm')} | {levels} | {least} |")


if __name__ == "__main__":
    if sys.argv[1:] == ["--table"]:
        print_table()
    else:
        write(FIGURES, output_folder())
