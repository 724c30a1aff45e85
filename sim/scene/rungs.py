"""Rungs of a scene's effects: setting a rung, and why a scene does not admit one.

A rung is one row: a name, what it assumes, where it is valid, its source, its cost,
and the values that set it in a scene. Steps, tolerances and meshes are effects as well, with
levels that are factors of the value in the scene. Alternatives without an order (contact laws,
friction laws, modes or a measured casing) are choices of a scene and not rungs. Each machine's
rungs are next to its physics, in ``ladder.py``.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from .scene import Scene, SceneError, validate_table

AnyScene = TypeVar("AnyScene", bound=Scene)

Beyond = Callable[[Scene], list[str]]
"""Why a scene is beyond the validity of its rungs, as sentences."""

_ROUNDING = 1e-9  # tolerance for a whole number of steps


@dataclass(frozen=True, kw_only=True)
class Rung:
    """One rung of an effect.

    Attributes
    ----------
    name : str
        Name in the scene; for a numerical effect, the factor on the scene's value, such as ``x2``.
    assumes : str
        Model in one line.
    valid : str
        Range of validity.
    needs : str
        Data that the scene must give.
    reference : str
        Source.
    nanoseconds_per_step : float
        Tabulated cost of the effect on one throw, or of one solve of a film, on one core of a
        2020s server, for ranking only.
    values : mapping of str to object
        Dotted path -> value that sets the rung in the scene it was made for.
    """

    name: str
    assumes: str
    reference: str = ""
    nanoseconds_per_step: float = 0.0
    valid: str = "always"
    needs: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)


def price(table: Iterable[Rung], name: str) -> float:
    """Tabulated cost of a table's rung [ns]."""
    return next(rung.nanoseconds_per_step for rung in table if rung.name == name)


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One effect of one scene, with its rungs.

    Attributes
    ----------
    name : str
        Name in ``pinned``.
    machine : str
    rungs : tuple of Rung
        Cheapest first, each with the values that set it in the scene.
    current : callable
        Scene -> name of its present rung.
    refusal : callable
        Scene, name of a rung -> why the scene does not admit it, or None.
    numerical : bool
        Whether it is a step, tolerance or mesh, whose error goes to zero with the level.
    """

    name: str
    machine: str
    rungs: tuple[Rung, ...]
    current: Callable[[Scene], str]
    refusal: Callable[[Scene, str], str | None]
    numerical: bool = False

    def rung(self, name: str) -> Rung:
        """Return the rung of that name.

        Raises
        ------
        KeyError
            There is no such rung.
        """
        return {rung.name: rung for rung in self.rungs}[name]


def admissible(effect: Effect, scene: Scene) -> tuple[Rung, ...]:
    """Rungs of an effect that the scene admits, cheapest first.

    Examples
    --------
    >>> from wearstate.sim.fidelity.ladder import effects_of
    >>> from wearstate.sim.scene.load import load_scene
    >>> worn = load_scene("journal-bearing", {"bearing.scar_depth": "5 um", "film.rung": "direct"})
    >>> [rung.name for rung in admissible(effects_of(worn)[0], worn)]
    ['direct']
    """
    return tuple(rung for rung in effect.rungs if effect.refusal(scene, rung.name) is None)


def with_values(scene: AnyScene, values: Mapping[str, Any]) -> AnyScene:
    """Copy of the scene with values replaced by dotted path, validated again.

    Parameters
    ----------
    scene : Scene
    values : mapping of str to object
        Dotted path -> value, list entries by number.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        All faults of the new scene together.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> with_values(load_scene("bilge-pump"), {"pressure.rung": "none"}).pressure.rung
    'none'
    """
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *above, last = path.split(".")
        node = tree
        for key in above:
            node = node.setdefault(key, {})
        node[last] = value
    return validate_table(type(scene), _grafted(scene, tree), scene.name)


def _grafted(node: Any, tree: Mapping[str, Any]) -> Any:
    """Fields of a part as a table, with a tree of new values; unchanged parts stay validated."""
    if isinstance(node, tuple):
        return [
            _grafted(entry, tree[str(i)]) if str(i) in tree else entry
            for i, entry in enumerate(node)
        ]
    own = {
        name: getattr(node, name)
        for name, part in cast(type[BaseModel], type(node)).model_fields.items()
        if getattr(node, name) is not None or part.default is not None
    }
    for key, value in tree.items():
        own[key] = _grafted(getattr(node, key), value) if isinstance(value, Mapping) else value
    return own


def _refused(rungs: tuple[Rung, ...], beyond: Beyond, scene: Scene, name: str) -> str | None:
    """Why a scene does not admit a rung: the first fault that some other rung avoids."""
    found = _faults_of(next(rung for rung in rungs if rung.name == name), beyond, scene)
    if not found:
        return None
    shared = set(found).intersection(*(_faults_of(rung, beyond, scene) for rung in rungs))
    return next((fault for fault in found if fault not in shared), None)


def _faults_of(rung: Rung, beyond: Beyond, scene: Scene) -> tuple[str, ...]:
    """Faults of a scene with a rung; the latest are cached, as every rung needs all others'.

    A scene is identified by its id, which stays unique while the scene is kept here.
    """
    key = (id(scene), beyond, tuple(rung.values.items()))
    _, faults = _KEPT.get(key) or (scene, _found_in(rung, beyond, scene))
    _KEPT[key] = scene, faults
    while len(_KEPT) > _MOST_KEPT:
        _KEPT.popitem(last=False)
    return faults


_KEPT: OrderedDict[tuple[Any, ...], tuple[Scene, tuple[str, ...]]] = OrderedDict()
_MOST_KEPT = 256


def _found_in(rung: Rung, beyond: Beyond, scene: Scene) -> tuple[str, ...]:
    try:
        return tuple(beyond(with_values(scene, rung.values)))
    except SceneError as error:
        return tuple(error.faults)


def effect(
    name: str,
    scene: Scene,
    rungs: Iterable[Rung],
    current: Callable[[Any], str],
    *,
    beyond: Beyond,
    numerical: bool = False,
) -> Effect:
    """Create an effect of a scene.

    Parameters
    ----------
    name : str
    scene : Scene
    rungs : iterable of Rung
        Cheapest first, each with the values that set it in the scene.
    current : callable
        Scene -> name of its present rung.
    beyond : callable
        Why a scene is beyond the validity of its rungs, as sentences.
    numerical : bool
        See :class:`Effect`.
    """
    rows = tuple(rungs)
    return Effect(
        name=name,
        machine=scene.machine,
        rungs=rows,
        current=current,
        refusal=partial(_refused, rows, beyond),
        numerical=numerical,
    )


def written(table: tuple[Rung, ...], paths: Iterable[str]) -> Iterator[Rung]:
    """Rows of a table of rungs, each with the values that set it at the paths."""
    places = tuple(paths)
    for rung in table:
        yield replace(rung, values=dict.fromkeys(places, rung.name))


STEP_LEVELS = (4.0, 2.0, 1.0, 0.5, 0.25)
"""Factors on the step in the scene; the last is the finest."""


def level_name(factor: float) -> str:
    """Name of a level of a numerical effect.

    Examples
    --------
    >>> [level_name(factor) for factor in (2.0, 4 / 3, 1.0, 0.25)]
    ['x2', 'x4/3', 'x1', 'x1/4']
    """
    return f"x{Fraction(factor).limit_denominator(16)}"


def levels(
    what: str, factors: Iterable[float], values: Callable[[float], Mapping[str, Any] | None]
) -> Iterator[Rung]:
    """Levels of a numerical effect; a factor that cannot be set has no values."""
    for factor in factors:
        found = values(factor)
        if found is not None:
            assumes = f"{what} of {factor:.3g} times the scene's value"
            yield Rung(name=level_name(factor), assumes=assumes, values=found)


def whole_steps(
    path: str, scene: Scene, longest: float, fewest: int
) -> Callable[[float], Mapping[str, Any] | None]:
    """Values of a step's levels, each a whole fraction of a sample.

    Halves are exact. Twice and four times are rounded to the next whole number of steps, and are
    omitted below the fewest steps per sample or where they repeat another level. An intermediate
    level exists only if it is exact.
    """
    of_sample = math.ceil(1 / (scene.sample_rate * longest) - _ROUNDING)

    def steps(factor: float) -> int:
        return math.ceil(of_sample / factor - _ROUNDING)

    def values(factor: float) -> Mapping[str, Any] | None:
        count = steps(factor)
        between = factor not in STEP_LEVELS and not math.isclose(count * factor, of_sample)
        if count < fewest or between or (factor > 1 and count == steps(factor / 2)):
            return None
        return {path: 1 / (scene.sample_rate * count)}

    return values


def as_written(_scene: Scene) -> str:
    """Level of the scene's own value."""
    return level_name(1.0)
