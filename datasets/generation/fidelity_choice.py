"""Cheapest sufficient models for a data set, chosen once on drawn records before the first is made.

A severity or confounder pins the effect it acts on: a rung that ignores the clearance that a data
set is about must not be chosen, however good it is on average.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from typing import Any

from ...sim.fidelity.choose import Resolution, resolve
from ...sim.fidelity.ladder import cost_of, effects_of
from ...sim.scene.load import override, scene_from_table
from ...sim.scene.rungs import Effect, with_values
from ...sim.scene.scene import Scene
from ..recipe.recipe import Recipe
from ..recipe.records import STRATA, Sample, sample_records
from .machines import known_of

ACTS_ON = {
    "joint.crankpin": "crankpin",
    "joint.wristpin": "wristpin",
    "joint.guide": "guide",
    "pressure": "pressure",
    "drive.motor": "drive",
    "bearing": "film",
    "bearings": "film",
    "film": "film",
}
"""Effect by table of the scene: its rungs take that table into account, for one throw or all."""

_SAMPLED = 64  # records whose step limits are checked


@dataclass(frozen=True, kw_only=True)
class FidelityChoice:
    """Models chosen for a data set.

    Attributes
    ----------
    values : mapping of str to object
        Values by dotted path of the scene.
    rungs : mapping of str to str
        Rung by effect.
    pinned : tuple of str
        Effects that stay as written.
    accuracy : float
        Accuracy required [-].
    estimated_error : float
        Largest estimate of the pilots [-].
    status : str
        As in :class:`~wearstate.sim.fidelity.choose.Resolution`; the worst of the pilots'.
    cost, cost_of_reference, cost_as_written : float
        Tabulated cost of one record [s].
    runs : int
        Number of simulations needed for the choice.
    """

    values: Mapping[str, Any]
    rungs: Mapping[str, str]
    pinned: tuple[str, ...]
    accuracy: float
    estimated_error: float
    status: str
    cost: float
    cost_of_reference: float
    cost_as_written: float
    runs: int

    @property
    def text(self) -> str:
        """The choice and its savings, in one line."""
        chosen = ", ".join(f"{effect} {rung}" for effect, rung in self.rungs.items()) or "nothing"
        kept = f" ({', '.join(self.pinned)} as written)" if self.pinned else ""
        return (
            f"{self.status} for {100 * self.accuracy:.3g} %: {chosen}{kept}; error "
            f"{self.estimated_error:.2%}, {self.saved}"
        )

    @property
    def saved(self) -> str:
        """Cost relative to the best rungs and to those written, in words."""
        best, written = self.cost_of_reference / self.cost, self.cost_as_written / self.cost
        more = "as cheap as" if written > 1 else "the cost of"
        factor = written if written > 1 else 1 / written
        return (
            f"{best:.3g} times as cheap as the best rungs, "
            f"{factor:.3g} times {more} what is written"
        )

    def dump(self) -> str:
        """The choice as JSON, for the file."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def load(cls, text: str) -> "FidelityChoice":
        """Inverse of :meth:`dump`."""
        table = json.loads(text)
        return cls(**{**table, "pinned": tuple(table["pinned"])})


def pinned_by(recipe: Recipe) -> tuple[str, ...]:
    """Effects that a recipe needs as written.

    Parameters
    ----------
    recipe : Recipe

    Returns
    -------
    tuple of str
        Those that a severity or a confounder acts on, those whose rung the recipe fixes or draws,
        and those pinned by the scene.

    Examples
    --------
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> pinned_by(load_recipe("bilge-pump-small"))
    ('crankpin',)
    >>> pinned_by(load_recipe("bilge-pump-standard"))
    ('crankpin', 'wristpin', 'guide', 'pressure', 'drive', 'casing')
    >>> pinned_by(load_recipe("journal-scar-small"))
    ('film',)
    """
    faulty = [wearing.axis.path for wearing in recipe.severities]
    faulty += [axis.path for fault in recipe.faults for axis in fault.axes]
    written = {*recipe.table.fixed, *recipe.overrides}
    written |= {axis.path for axis in (*recipe.machine, *recipe.record)}
    written |= {path for each in recipe.choices for path in each.paths}
    effects = effects_of(recipe.scene)
    names = {effect for path in faulty for effect in _acted_on(path)}
    names |= {e.name for e in effects for rung in e.rungs if written & set(rung.values)}
    known = [effect.name for effect in effects]
    return tuple(name for name in known if name in {*names, *recipe.scene.pinned})


def _acted_on(path: str) -> Iterator[str]:
    """Effects whose tables contain a value."""
    keys = path.split(".")
    inner = ".".join(keys[2:] if keys[0] == "throws" else keys)
    return (effect for table, effect in ACTS_ON.items() if f"{inner}.".startswith(f"{table}."))


def choose(
    recipe: Recipe,
    *,
    seed: int = 0,
    accuracy: float | None = None,
    say: Callable[[str], None] | None = None,
) -> FidelityChoice:
    """The cheapest rungs and numerics that suffice for the records of a recipe.

    Parameters
    ----------
    recipe : Recipe
    seed : int
        Seed of the data set, which determines the pilots.
    accuracy : float, optional
        Accuracy [-]; by default that of the scene.
    say : callable, optional
        Called with a line about every pilot.

    Returns
    -------
    FidelityChoice
        The same on every machine.

    Raises
    ------
    SceneError
        If the reference of a pilot cannot be run.

    Notes
    -----
    Pilots are the records of smallest and largest primary severity among the first sixteen, which
    hold one of each sixteenth of its range. For each effect the higher of their rungs is taken. If
    the step is not the one required by the contact, it is the smallest over the first records.
    """
    pinned = pinned_by(recipe)
    samples = list(islice(sample_records(recipe, _SAMPLED, seed=seed), _SAMPLED))
    found = []
    for sample in _pilots(recipe, samples):
        known = known_of(sample.scene)
        found.append(resolve(sample.scene, known.quantities, accuracy, pinned, truth=known.truth))
        if say is not None:
            say(f"pilot, record {sample.index}: {found[-1].text}")
    effects = [e for e in effects_of(recipe.scene) if e.name not in pinned]
    rungs = {effect.name: _highest(effect, found) for effect in effects}
    values = _values(effects, rungs, [sample.scene for sample in samples])
    chosen = with_values(recipe.scene, {**values, "fidelity": "given"})
    return FidelityChoice(
        values=values,
        rungs=rungs,
        pinned=pinned,
        accuracy=found[0].accuracy,
        estimated_error=max(each.estimated_error for each in found),
        status=max((each.status for each in found), key=_STATUSES.index),
        cost=cost_of(chosen),
        cost_of_reference=max(each.cost_of_reference for each in found),
        cost_as_written=cost_of(recipe.scene),
        runs=sum(each.runs for each in found),
    )


_STATUSES = ("resolved", "reference", "unresolvable")


def _pilots(recipe: Recipe, samples: Sequence[Sample]) -> list[Sample]:
    column = recipe.severity_columns[0]
    ranked = sorted(samples[:STRATA], key=lambda sample: float(sample.row[column]))
    return [ranked[0], ranked[-1]]


def _highest(effect: Effect, found: Sequence[Resolution]) -> str:
    """The higher rung; a level that the recipe's own scene lacks is coarser than those it has."""
    names = [rung.name for rung in effect.rungs]
    chosen = [each.rungs[effect.name] for each in found]
    return max(chosen, key=lambda name: names.index(name) if name in names else -1)


def _values(
    effects: Sequence[Effect], rungs: Mapping[str, str], scenes: Sequence[Scene]
) -> dict[str, Any]:
    """Values of the rungs; for a step the smallest that any record needs."""
    values: dict[str, Any] = {}
    for effect in effects:
        level = rungs[effect.name]
        if effect.name != "step":
            values |= effect.rung(level).values
        elif level != _OWN_STEP:  # otherwise every record determines its own step
            [path] = effect.rungs[-1].values
            values[path] = min(_step_of(s, level) for s in scenes)
    return values


_OWN_STEP = "x1"


def _step_of(scene: Scene, level: str) -> float:
    """Step at the level, or at the coarsest of the scene if it has none so coarse."""
    [effect] = [each for each in effects_of(scene) if each.name == "step"]
    rung = {each.name: each for each in effect.rungs}.get(level, effect.rungs[0])
    [step] = rung.values.values()
    return float(step)


def with_choice(recipe: Recipe, choice: FidelityChoice | None) -> Recipe:
    """The recipe with the choice written over its scene, as an override that the file keeps.

    Parameters
    ----------
    recipe : Recipe
    choice : Choice or None
        The choice; None for rungs as written.

    Returns
    -------
    Recipe
        Recipe whose scene has ``fidelity = "given"``.
    """
    if choice is None and recipe.scene.fidelity == "given":
        return recipe
    values = {**(choice.values if choice else {}), "fidelity": "given"}
    base = override(recipe.base, values)
    scene_from_table(base)
    return replace(recipe, base=base, overrides={**recipe.overrides, **values})
