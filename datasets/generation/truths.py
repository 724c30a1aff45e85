"""Results of a run that no sensor measures, as single numbers with unit and description.

They include the quantities of interest of :mod:`.generation.machines`; those serve to judge rungs,
these are for people.
"""

from collections.abc import Iterator

from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from ..file.columns import describe_columns
from ..recipe.severities import clearances
from .machines import Truth, known_of
from .quantities import quantity_label


def truths_of(solution: Recording, scene: Scene) -> dict[str, Truth]:
    """All known results of a run, by name.

    Parameters
    ----------
    solution : Recording
        Recording with its truth.
    scene : Scene
        Scene of the run.

    Returns
    -------
    dict of str to Truth
        Quantities of interest of the machine; peaks, pressures and positions; wear of the scene, by
        its manifest column; guards of the run. For a machine at rest, the last two only.

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
        for name, (value, _, _) in known_of(scene).quantities(solution, scene).items():
            words, unit = quantity_label(name, scene)
            seen = name.rpartition("_")[0] in ("band", "order")
            found[name] = Truth(value, unit.replace("-", ""), words, seen)
        found |= dict(known_of(scene).truths(solution, scene))
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
    "film_temperature_k",
    "rubbing_share",
    "least_reaction_n",
    "motion_share",
    "first_resonance_hz",
    "least_damping_ratio",
    "least_damped_hz",
    "stability_margin",
    "clipped_samples",
)
"""Numerics of a run that describe the machine, or whether the run can be trusted."""


def _by_column(values: dict[str, float]) -> Iterator[tuple[str, Truth]]:
    for column in describe_columns(values):
        words = column.meaning if column.role != "other" else column.name.replace("_", " ")
        yield column.name, Truth(values[column.name], column.unit, words)
