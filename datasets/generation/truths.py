"""What the simulator knows of a run and no sensor tells, as single numbers with unit and words.

The quantities of interest of :mod:`.generation.quantities` are among them; these are for people,
those judge rungs.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from ...sim.scene.journal import JournalScene
from ...sim.scene.parts import Scene
from ...sim.scene.pump import PumpScene
from ...sim.scene.pump_hydraulics import STANDARD_ATMOSPHERE
from ..file.columns import describe_columns
from ..recipe.recipe import clearances
from .quantities import QUANTITIES, quantity_label

Float = NDArray[np.float64]


class Truth(NamedTuple):
    """One number of a run."""

    value: float
    unit: str
    """SI; ``dB`` of levels, empty of ratios."""
    words: str
    seen: bool = False
    """Computed from the signals of the sensors; the others are known to the simulator alone."""


def truths_of(solution: Recording, scene: Scene) -> dict[str, Truth]:
    """Everything that is known of a run, by name.

    Parameters
    ----------
    solution : Recording
        With its truth.
    scene : Scene
        Of the run.

    Returns
    -------
    dict of str to Truth
        Quantities of interest of the machine; peaks, pressures and positions; wear as it is in the
        scene, by its manifest column; guards of the run. Of a machine at rest the last two alone.

    Examples
    --------
    >>> from wearstate.sim.machine.simulate import simulate
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("bilge-pump", {"duration": "0.4 s"})
    >>> found = truths_of(simulate(scene, seed=1, truth=True), scene)
    >>> round(found["pressure_highest"].value, -4), found["band_2"].seen, found["pin_peak"].unit
    (300000.0, True, 'N')
    """
    found: dict[str, Truth] = {}
    if {"state_alpha", "state_angle"} & set(solution.truth):
        for name, (value, _, _) in QUANTITIES[scene.machine](solution, scene).items():
            words, unit = quantity_label(name, scene)
            seen = name.rpartition("_")[0] in ("band", "order")
            found[name] = Truth(value, unit.replace("-", ""), words, seen)
        found |= dict(_FURTHER[scene.machine](solution, scene))
    found |= dict(_by_column(clearances(scene)))
    numbers = {name: solution.numerics[name] for name in _GUARDS if name in solution.numerics}
    return found | dict(_by_column({name: float(value) for name, value in numbers.items()}))


_GUARDS = (
    "mean_speed_hz",
    "peak_normal_force_n",
    "lowest_pressure_pa",
    "cavitating_share",
    "tension_share",
    "peak_eccentricity",
    "min_film_m",
    "least_reaction_n",
    "motion_share",
    "first_resonance_hz",
    "least_damping_ratio",
    "least_damped_hz",
    "stability_margin",
    "clipped_samples",
)
"""Numerics of a run that say something about the machine, or about whether to believe it."""


def _by_column(values: dict[str, float]) -> Iterator[tuple[str, Truth]]:
    for column in describe_columns(values):
        words = column.meaning if column.role != "other" else column.name.replace("_", " ")
        yield column.name, Truth(values[column.name], column.unit, words)


# --- of each machine


def _pump(solution: Recording, scene: Scene) -> Iterator[tuple[str, Truth]]:
    pump, truth, numbers = cast(PumpScene, scene), solution.truth, solution.numerics
    turns = float(numbers["steps"]) * float(numbers["step_s"]) * float(numbers["mean_speed_hz"])
    contacts = float(numbers["contact_changes"]) / 2 / turns
    yield "contacts_per_turn", Truth(contacts, "", "contacts made in a revolution, all joints")
    for name in sorted(name for name in truth if name.startswith("wrist_force_n")):
        suffix = name.removeprefix("wrist_force_n")
        about = f", throw {suffix[1:]}" if suffix else ""
        wrist = float(np.hypot(*truth[name].T).max())
        yield f"wrist_peak{suffix}", Truth(wrist, "N", f"wrist pin force, peak{about}")
        guide = float(np.abs(truth[f"guide_force_n{suffix}"]).max())
        yield f"guide_peak{suffix}", Truth(guide, "N", f"guide force, peak{about}")
        yield from _pressures(pump, truth, suffix, about)


def _pressures(
    scene: PumpScene, truth: dict[str, Float], suffix: str, about: str
) -> Iterator[tuple[str, Truth]]:
    """Range of the gauge pressure in a cylinder, and the ratio of its absolute ends."""
    if scene.pressure.rung == "none":
        return
    area = math.pi / 4 * scene.piston.diameter**2
    pressure = truth.get(
        f"cylinder_pressure_pa{suffix}", truth[f"piston_pressure_force_n{suffix}"] / area
    )
    low, high = float(pressure.min()), float(pressure.max())
    yield f"pressure_lowest{suffix}", Truth(low, "Pa", f"cylinder pressure, lowest, gauge{about}")
    yield f"pressure_highest{suffix}", Truth(high, "Pa", f"cylinder pressure, highest{about}")
    if low + STANDARD_ATMOSPHERE > 0:
        ratio = (high + STANDARD_ATMOSPHERE) / (low + STANDARD_ATMOSPHERE)
        yield f"pressure_ratio{suffix}", Truth(ratio, "", f"pressure ratio, absolute{about}")


def _journal(solution: Recording, scene: Scene) -> Iterator[tuple[str, Truth]]:
    truth, clearance = solution.truth, cast(JournalScene, scene).bearing.clearance_radial
    place = complex(*truth["journal_m"].mean(axis=0))
    load = complex(*truth["load_n"].mean(axis=0))
    ratio = abs(place) / clearance
    yield "eccentricity", Truth(ratio, "", "eccentricity ratio of the mean position")
    if load != 0 and place != 0:
        angle = float(np.angle(place / load))
        yield "attitude_angle", Truth(angle, "rad", "attitude angle of the mean position")
    if "peak_pressure_pa" in truth:
        peak = float(truth["peak_pressure_pa"].max())
        yield "pressure_peak", Truth(peak, "Pa", "film pressure, peak")


def _shaft(solution: Recording, _scene: Scene) -> Iterator[tuple[str, Truth]]:
    total = float(solution.truth["film_force_n"].mean(axis=0)[:, 0].sum())
    yield "reaction_sum", Truth(total, "N", "sum of the vertical reactions")


_FURTHER: dict[str, Callable[[Recording, Scene], Iterator[tuple[str, Truth]]]] = {
    "reciprocating-pump": _pump,
    "journal-bearing": _journal,
    "propulsion-shaft": _shaft,
}
"""What is told of every machine beside its quantities of interest. A new machine is one row."""
