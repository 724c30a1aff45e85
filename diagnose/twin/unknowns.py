"""Unknowns of a machine: the coordinates of a recipe, and the scene at a point in them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ...datasets.draws.draws import KINDS, Axis, Range, has_value, value_at
from ...datasets.draws.options import Alternatives
from ...datasets.draws.twin import coordinate_names, inside, machine_values
from ...datasets.recipe.recipe import Recipe
from ...sim.output.recording import DataError
from ...sim.scene.load import override, scene_from_table
from ...sim.scene.scene import Scene

Float = NDArray[np.float64]

MODE = r"casing\.modes\.\d+\.frequency"
WEAR = "wear"
"""Coordinate of the wear: log-uniform over its range."""


@dataclass(frozen=True, kw_only=True)
class TwinUnknowns:
    """Numbers that a recipe draws of a machine, and its wear within a range.

    Attributes
    ----------
    recipe : Recipe
        The prior: a normal score of 0 is the median of what it draws.
    wear : Range
        Range of the wear [m].
    kept : tuple of str
        Unknown coordinates; all others stay as in the scene.
    """

    recipe: Recipe
    wear: Range
    kept: tuple[str, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all coordinates, the wear last."""
        return (*self.kept, WEAR)

    def values(self, scores: Float) -> dict[str, Any]:
        """Dotted path -> scene value [SI] at normal scores [shape=(n_names,)]."""
        at = dict(zip(self.names, inside(scores).tolist(), strict=True))
        drawn, _ = machine_values(self._axes, self._choices, lambda name: at[name])
        return {**drawn, self.wear.path: self.wear.value([at[WEAR]])}

    def options(self, scores: Float) -> dict[str, str]:
        """Column of every choice -> selected option."""
        at = dict(zip(self.names, inside(scores).tolist(), strict=True))
        return machine_values((), self._choices, lambda name: at[name])[1]

    def scene(self, scores: Float, conditions: Mapping[str, float]) -> Scene:
        """Scene of the machine at normal scores, under conditions by dotted path."""
        return scene_from_table(override(self.recipe.base, {**self.values(scores), **conditions}))

    @property
    def frequencies(self) -> tuple[str, ...]:
        """Paths of the unknown frequencies of casing modes."""
        return tuple(name for name in self.kept if re.fullmatch(MODE, name))

    def numbers(self, name: str, scores: Float) -> Float:
        """Values [SI] of one number at many scores [scores: shape=(n, n_names)]."""
        axis = self._ranges[name]
        column = inside(scores[:, self.names.index(name)])
        return np.array([axis.value([each]) for each in column.tolist()])

    def scores(self, name: str, values: Float) -> Float:
        """Normal scores of one uniform number at values [SI], limited to 2.6."""
        low, high = self.ends(name)
        found: Float = ndtri(np.clip((values - low) / (high - low), 0.005, 0.995))
        return found

    def ends(self, name: str) -> tuple[float, float]:
        """Smallest and largest value [SI] of one number."""
        return self._ranges[name].extremes()

    @property
    def named(self) -> tuple[str, ...]:
        """Coordinates that correspond to one number of the scene each."""
        return tuple(self._ranges)

    def path_of(self, name: str) -> str:
        """Dotted path of the number of a coordinate."""
        return self._ranges[name].path

    def holds(self, name: str, scene: Scene) -> bool:
        """Whether a scene has the number: options have numbers of their own."""
        path = self.path_of(name)
        return has_value(scene, path) and isinstance(value_at(scene, path), float)

    @cached_property
    def _ranges(self) -> dict[str, Range]:
        found = {axis.path: axis for axis in self._axes if isinstance(axis, Range)}
        for choice in self._choices:
            for axis in (axis for option in choice.options for axis in option.axes):
                if isinstance(axis, Range):
                    found.setdefault(f"{choice.name}.{axis.path}", axis)
        return {**found, WEAR: self.wear}

    @cached_property
    def _axes(self) -> list[Axis]:
        return [a for a in self.recipe.machine if set(a.entries) <= set(self.kept)]

    @cached_property
    def _choices(self) -> list[Alternatives]:
        return [c for c in self.recipe.choices if c.per == "machine" and c.name in self.kept]


def unknowns_of(
    recipe: Recipe, wear: tuple[float, float], only: Sequence[str] = ()
) -> TwinUnknowns:
    """All that a recipe draws once per machine, or a subset of it.

    Parameters
    ----------
    recipe : Recipe
    wear : tuple of float
        Smallest and largest wear [m].
    only : sequence of str
        Paths or choices of the recipe, ``*`` for any; by default all.

    Raises
    ------
    DataError
        A name is not drawn by the recipe.
    """
    names = coordinate_names(recipe.machine, recipe.choices)
    axis = Range(recipe.severity.path, KINDS["log-uniform"], (wear,))
    if not only:
        return TwinUnknowns(recipe=recipe, wear=axis, kept=names)
    groups = _groups(recipe)
    wanted = [group for group in groups if any(fnmatchcase(group, name) for name in only)]
    lost = [name for name in only if not any(fnmatchcase(group, name) for group in groups)]
    if lost:
        raise DataError(
            f"unknown = {', '.join(lost)} must be drawn by the recipe {recipe.name}: "
            f"{', '.join(sorted(set(map(_starred, groups))))}; name one of these"
        )
    kept = [name for group in wanted for name in groups[group]]
    return TwinUnknowns(recipe=recipe, wear=axis, kept=tuple(n for n in names if n in kept))


def _groups(recipe: Recipe) -> dict[str, tuple[str, ...]]:
    """Path or choice -> its coordinates."""
    choices = {c.name: c.coordinates for c in recipe.choices if c.per == "machine"}
    return {**{axis.path: axis.entries for axis in recipe.machine}, **choices}


def _starred(path: str) -> str:
    return ".".join("*" if key.isdigit() else key for key in path.split("."))
