"""The least model for a whole data set: chosen once, on drawn records, before the first is made.

What wears and what confounds pins the effect it acts on: a rung that does not know the clearance
that a data set is about may not be chosen, however well it does on average.
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
"""Table of a scene -> effect whose rungs know what is in it, of one throw or of all."""

_SAMPLED = 64  # records whose step limits are looked at


@dataclass(frozen=True, kw_only=True)
class FidelityChoice:
    """What was chosen for a data set.

    Attributes
    ----------
    values : mapping of str to object
        Dotted path of the scene -> value.
    rungs : mapping of str to str
        Effect -> its rung.
    pinned : tuple of str
        Effects that stay as they are written.
    accuracy : float
        That was asked [-].
    estimated_error : float
        Largest of the pilots' [-].
    status : str
        As of :class:`~wearstate.sim.fidelity.choose.Resolution`; the worst of the pilots'.
    cost, cost_of_reference, cost_as_written : float
        Tabulated, of one record [s].
    runs : int
        Simulations that the choice took.
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
        """What was chosen and what it saves, in one line."""
        chosen = ", ".join(f"{effect} {rung}" for effect, rung in self.rungs.items()) or "nothing"
        kept = f" ({', '.join(self.pinned)} as written)" if self.pinned else ""
        return (
            f"{self.status} for {100 * self.accuracy:.3g} %: {chosen}{kept}; error "
            f"{self.estimated_error:.2%}, {self.saved}"
        )

    @property
    def saved(self) -> str:
        """Cost against that of the best rungs and of what is written, in words."""
        best, written = self.cost_of_reference / self.cost, self.cost_as_written / self.cost
        more = "as cheap as" if written > 1 else "the cost of"
        factor = written if written > 1 else 1 / written
        return (
            f"{best:.3g} times as cheap as the best rungs, "
            f"{factor:.3g} times {more} what is written"
        )

    def dump(self) -> str:
        """As JSON, for the file."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def load(cls, text: str) -> "FidelityChoice":
        """Inverse of :meth:`dump`."""
        table = json.loads(text)
        return cls(**{**table, "pinned": tuple(table["pinned"])})


def pinned_by(recipe: Recipe) -> tuple[str, ...]:
    """Effects that a recipe needs as they are written.

    Parameters
    ----------
    recipe : Recipe

    Returns
    -------
    tuple of str
        Those that a severity or a confounder acts on, those whose rung the recipe fixes or draws,
        and those that the scene pins.

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
    """Effects whose tables a value is in."""
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
    """The cheapest rungs and numerics that do for the records of a recipe.

    Parameters
    ----------
    recipe : Recipe
    seed : int
        Of the data set, which decides the pilots.
    accuracy : float, optional
        The scene's own by default.
    say : callable, optional
        Called with a line about every pilot.

    Returns
    -------
    FidelityChoice
        The same on every machine.

    Raises
    ------
    SceneError
        The reference of a pilot cannot be run.

    Notes
    -----
    Pilots are the records of least and greatest primary severity among the first sixteen, which
    hold one of each sixteenth of its range. Of each effect the higher of their rungs is taken. A
    step other than the one that the contact itself asks for is the least over the first records.
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
    """The higher rung; a level that the recipe's own scene has not is coarser than those it has."""
    names = [rung.name for rung in effect.rungs]
    chosen = [each.rungs[effect.name] for each in found]
    return max(chosen, key=lambda name: names.index(name) if name in names else -1)


def _values(
    effects: Sequence[Effect], rungs: Mapping[str, str], scenes: Sequence[Scene]
) -> dict[str, Any]:
    """Values of the rungs; of a step the least that any record asks for."""
    values: dict[str, Any] = {}
    for effect in effects:
        level = rungs[effect.name]
        if effect.name != "step":
            values |= effect.rung(level).values
        elif level != _OWN_STEP:  # else every record finds its own
            [path] = effect.rungs[-1].values
            values[path] = min(_step_of(s, level) for s in scenes)
    return values


_OWN_STEP = "x1"


def _step_of(scene: Scene, level: str) -> float:
    """Of the level, or of the coarsest where a scene has none so coarse."""
    [effect] = [each for each in effects_of(scene) if each.name == "step"]
    rung = {each.name: each for each in effect.rungs}.get(level, effect.rungs[0])
    [step] = rung.values.values()
    return float(step)


def with_choice(recipe: Recipe, choice: FidelityChoice | None) -> Recipe:
    """The recipe with what was chosen written over its scene, as an override that the file keeps.

    Parameters
    ----------
    recipe : Recipe
    choice : Choice or None
        None: what is written is taken as it is.

    Returns
    -------
    Recipe
        Whose scene says ``fidelity = "given"``.
    """
    if choice is None and recipe.scene.fidelity == "given":
        return recipe
    values = {**(choice.values if choice else {}), "fidelity": "given"}
    base = override(recipe.base, values)
    scene_from_table(base)
    return replace(recipe, base=base, overrides={**recipe.overrides, **values})
