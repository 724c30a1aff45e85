"""Rows of the blind spots: which properties of a recipe's scene are changed, and by how much.

A value that the recipe draws is moved beyond its range, by a factor of 1.3 for a logarithmic
distribution, otherwise by 30 % of the range; a fixed value is changed by the amount in the table.
Severities, and angles drawn over the full circle, are not changed.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Literal

from ...datasets.draws.draws import Axis, Vector, has_value, matches, value_at
from ...datasets.draws.options import Alternatives, Taken
from ...datasets.recipe.recipe import Recipe
from ...datasets.recipe.records import Sample
from ...sim.parts.wording import si_unit
from ...sim.scene.load import override, scene_from_table
from ...sim.scene.scene import Scene, SceneError
from ..machines.registry import presentation_of
from ..machines.shifts import Shift
from ..pages.si_text import si_text

BEYOND = 1.3
"""Factor beyond the edge of a logarithmic range; for others 30 % of the range is added."""

_ALL_ROUND = 0.999 * math.tau

Kind = Literal["as trained", "fixed", "drawn", "sensor"]


@dataclass(frozen=True, kw_only=True)
class SceneRow:
    """One property of the scene, changed on every machine.

    Attributes
    ----------
    name : str
        Dotted path, ``*`` for every list entry.
    shift : str
        The change in words.
    kind : {"fixed", "drawn"}
        Whether the recipe keeps it fixed or draws it.
    why : str
        Cause of such a difference; empty if unknown.
    changes : callable
        Machine's scene -> new values by dotted path.
    option : optional
        Option of the recipe that draws the value; every machine gets it.
    """

    name: str
    shift: str
    kind: Kind
    why: str
    changes: Callable[[Scene], Mapping[str, Any]]

    option: "_Option | None" = None

    def applied(self, recipe: Recipe, sample: Sample) -> Scene:
        """Scene of a machine with this one property changed.

        Raises
        ------
        SceneError
            The machine lacks the value, or its scene rejects the change.
        """
        drawn = sample.drawn if self.option is None else self.option.taken_by(sample)
        machine = scene_from_table(override(recipe.base, drawn))
        changes = self.changes(machine)
        if not changes:
            fault = f"{self.name} has no value on this machine; there is nothing to change"
            raise SceneError(machine.name, [fault])
        return scene_from_table(override(recipe.base, {**drawn, **changes}))


@dataclass(frozen=True)
class _Option:
    """One option of a recipe's choice, applied to every machine."""

    choice: Alternatives
    option: Taken

    def taken_by(self, sample: Sample) -> dict[str, Any]:
        """Draws of a machine with this option: its own if it has it, else medians."""
        if sample.row[self.choice.column] == self.option.name:
            return sample.drawn
        others = {p: v for p, v in sample.drawn.items() if p not in self.choice.paths}
        middle = {axis.path: axis.value([0.5] * len(axis.entries)) for axis in self.option.axes}
        return {**others, **self.option.values, **middle}


def scene_rows(recipe: Recipe, shifts: Sequence[Shift] | None = None) -> list[SceneRow]:
    """All rows of a recipe's scene, fixed values first.

    Parameters
    ----------
    recipe : Recipe
    shifts : sequence of Shift, optional
        By default those of the machine.

    Returns
    -------
    list of SceneRow

    Examples
    --------
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> rows = scene_rows(load_recipe("bilge-pump-narrow"))
    >>> [(row.kind, row.shift) for row in rows if row.name == "pressure.rise_delay"]
    [('fixed', '= 6 deg'), ('fixed', '= 12 deg')]
    """
    table = presentation_of(recipe.scene).shifts if shifts is None else shifts
    drawn = _drawn(recipe)
    names = {each.path for each in drawn}
    worn = {_pattern(wearing.axis.path) for wearing in recipe.severities}
    known = list(chain.from_iterable(_expanded(shift, recipe) for shift in table))
    fixed = [
        row
        for shift in known
        if shift.path not in worn | names
        for row in _fixed_rows(shift, recipe)
    ]
    by_path = {shift.path: shift for shift in known}
    beyond = [
        row
        for each in drawn
        if each.path not in worn
        for row in _beyond_rows(each, by_path.get(each.path), type(recipe.scene))
    ]
    return [*fixed, *beyond]


def _pattern(path: str) -> str:
    return re.sub(r"(?<=\.)[0-9]+(?=\.|$)", "*", path)


@dataclass(frozen=True)
class _Drawn:
    """All that a recipe draws at one path with ``*``, in general or with an option."""

    path: str
    axes: tuple[Axis, ...]
    option: _Option | None = None


def _drawn(recipe: Recipe) -> list[_Drawn]:
    options = [_Option(each, option) for each in recipe.choices for option in each.options]
    parts = [
        _by_pattern((*recipe.machine, *recipe.record), None),
        *(_by_pattern(each.option.axes, each) for each in options),
    ]
    return list(chain.from_iterable(parts))


def _by_pattern(axes: Sequence[Axis], option: _Option | None) -> list[_Drawn]:
    found: dict[str, list[Axis]] = {}
    for axis in axes:
        found.setdefault(_pattern(axis.path), []).append(axis)
    return [_Drawn(path, tuple(each), option) for path, each in found.items()]


def _expanded(shift: Shift, recipe: Recipe) -> Iterator[Shift]:
    """The shift itself if the scene has its path, and the same for every throw that has it."""
    for prefix in ("", "throws.*."):
        path = prefix + shift.path
        if _paths(path, recipe.scene, recipe.base) or (shift.adds and not prefix):
            beside = {prefix + key: value for key, value in shift.beside.items()}
            yield replace(shift, path=path, beside=beside)


def _paths(pattern: str, scene: Scene, table: Mapping[str, Any]) -> list[str]:
    """Paths of a pattern at which a scene has a value."""
    try:
        found = matches(table, pattern)
    except SceneError:
        return []
    return [path for path in found if has_value(scene, path)]


# --- fixed values ---------------------------------------------------------------------------------


def _fixed_rows(shift: Shift, recipe: Recipe) -> Iterator[SceneRow]:
    taken = _taken(shift.path, recipe)
    for amount in shift.amounts:
        if shift.kind == "set" and amount in taken:
            continue
        yield SceneRow(
            name=shift.path,
            shift=_words(shift, amount, type(recipe.scene)),
            kind="fixed",
            why=shift.why,
            changes=_changer(shift, amount, recipe),
        )


def _taken(path: str, recipe: Recipe) -> set[Any]:
    """Values of a path without a change: that of the scene and those of options."""
    options = [option.values for each in recipe.choices for option in each.options]
    values = {v for each in options for p, v in each.items() if _pattern(p) == path}
    values |= {value_at(recipe.scene, p) for p in _paths(path, recipe.scene, recipe.base)}
    return values


def _words(shift: Shift, amount: Any, machine: type[Scene]) -> str:
    sign = {"factor": "x ", "add": "", "set": "= "}[shift.kind]
    if not isinstance(amount, (int, float)):
        return f"{sign}{amount}"
    if shift.kind == "add":
        return f"{'+' if amount >= 0 else ''}{_with_unit(amount, shift.path, machine)}"
    return f"{sign}{amount:g}"


def _with_unit(value: float, path: str, machine: type[Scene]) -> str:
    return si_text(value, si_unit(machine, path.replace("*", "0")))


def _changer(shift: Shift, amount: Any, recipe: Recipe) -> Callable[[Scene], Mapping[str, Any]]:
    def changes(scene: Scene) -> Mapping[str, Any]:
        _refuse_unread(shift, scene)
        found = {}
        paths = _paths(shift.path, scene, recipe.base)
        for path in paths or ([shift.path] if shift.adds else []):
            value = None if shift.adds else value_at(scene, path)
            if shift.kind == "set":
                found[path] = amount
            elif value is not None and not (shift.kind == "factor" and value == 0):
                found[path] = value * amount if shift.kind == "factor" else value + amount
        beside = {
            path: value
            for pattern, value in shift.beside.items()
            for path in matches(recipe.base, pattern)
        }
        return {**beside, **found} if found else {}

    return changes


def _refuse_unread(shift: Shift, scene: Scene) -> None:
    for path, needed in shift.under.items():
        value = value_at(scene, path)
        if value != needed:
            fault = f"{shift.path} only matters if {path} = {needed!r}, and it is {value!r}"
            raise SceneError(scene.name, [fault])


# --- drawn values ---------------------------------------------------------------------------------


def _beyond_rows(drawn: _Drawn, known: Shift | None, machine: type[Scene]) -> Iterator[SceneRow]:
    axes = drawn.axes
    if any(_all_round(axis) for axis in axes):
        return
    for side in _sides(axes[0]):
        ends = {axis.path: _beyond(axis, side) for axis in axes}
        where = f", with {drawn.option.option.name}" if drawn.option else ""
        yield SceneRow(
            name=drawn.path,
            shift=f"{side}, {_shown(axes, ends, side, machine)}{where}",
            kind="drawn",
            why=known.why if known else "beyond the range that the recipe draws from",
            changes=_mover(ends),
            option=drawn.option,
        )


def _sides(axis: Axis) -> tuple[str, ...]:
    """Sides of a range; only the upper one if it begins at zero."""
    if isinstance(axis, Vector):
        return ("outward",)
    return ("above",) if axis.extremes()[0] == 0 else ("below", "above")


def _all_round(axis: Axis) -> bool:
    if isinstance(axis, Vector) or not re.search(r"(angle|phase)$", axis.path):
        return False
    low, high = axis.extremes()
    return high - low >= _ALL_ROUND


_Move = Callable[[Any], Any]


def _beyond(axis: Axis, side: str) -> _Move:
    """Function from the machine's own value to one beyond the range."""
    if isinstance(axis, Vector):
        centre = axis.base
        return lambda own: {
            key: value + BEYOND * (own[key] - value) for key, value in centre.items()
        }
    value = _edge(axis.extremes(), side, logarithmic=axis.kind.scale is math.log)
    return lambda _own: value


def _edge(ends: tuple[float, float], side: str, *, logarithmic: bool) -> float:
    """Value beyond a range; the sign never changes."""
    low, high = ends
    step = (BEYOND - 1) * (high - low)
    if logarithmic:
        return low / BEYOND if side == "below" else high * BEYOND
    if side == "below":
        return low - step if low - step > 0 or low <= 0 else low / BEYOND
    return high + step if high + step < 0 or high >= 0 else high / BEYOND


def _shown(axes: Sequence[Axis], ends: Mapping[str, _Move], side: str, machine: type[Scene]) -> str:
    if isinstance(axes[0], Vector):
        return f"{BEYOND:g} x the distance from the scene's values"
    values = {ends[axis.path](None) for axis in axes}
    if len(values) == 1:
        return f"= {_with_unit(next(iter(values)), axes[0].path, machine)}"
    edge = axes[0].extremes()[0 if side == "below" else 1]
    ratio = ends[axes[0].path](None) / edge if edge else math.nan
    return f"{ratio:.3g} x the edge" if math.isfinite(ratio) else "30 % of the range"


def _mover(ends: Mapping[str, _Move]) -> Callable[[Scene], Mapping[str, Any]]:
    def changes(scene: Scene) -> Mapping[str, Any]:
        return {path: move(value_at(scene, path)) for path, move in ends.items()}

    return changes
