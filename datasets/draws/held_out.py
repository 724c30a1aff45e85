"""Regions of conditions or severities that a recipe reserves for testing."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from pydantic import Field, model_validator

from ...sim.parts.part import Part
from ...sim.parts.units import to_si
from ...sim.scene.load import override, scene_from_table
from ...sim.scene.scene import SceneError
from .draws import Axis, Bound, Range, value_at

DIMENSIONS = {
    "_pa_s": "viscosity",
    "_kg_m": "unbalance",
    "_hz": "rotation speed",
    "_pa": "pressure",
    "_rad": "angle",
    "_k": "temperature",
    "_n": "force",
    "_m": "length",
}
"""Dimension of the bounds of a manifest column by its ending; the first match counts."""


class Bounds(Part):
    """A range of one manifest column; without a bound it is open on that side.

    A bound is a number in SI, a text with a unit, or a share of the scene's own value: ``110 %``.
    """

    low: Bound | None = Field(default=None, description="lower end; open if left out")
    high: Bound | None = Field(default=None, description="upper end; open if left out")

    @model_validator(mode="after")
    def _an_end(self) -> Self:
        if self.low is None and self.high is None:
            raise ValueError("no bound is given, must be low, high or both; add one")
        return self


class Region(Part):
    """A region in a recipe: the records within all bounds are held out."""

    name: str = Field(pattern="^[a-z][a-z0-9_]*$", max_length=48, description="name of the split")
    bounds: dict[str, Bounds] = Field(min_length=1, description="bounds by manifest column")


@dataclass(frozen=True)
class HeldOut:
    """A held-out region.

    Attributes
    ----------
    name : str
        Name, unique in the recipe.
    bounds : mapping of str to (float, float)
        Smallest and largest value [SI] by manifest column, inclusive; infinite if open. A record
        lies in the region if it is within all of them.
    """

    name: str
    bounds: Mapping[str, tuple[float, float]]


def regions_of(
    regions: Sequence[Region],
    columns: Mapping[str, str],
    axes: Sequence[Axis],
    sometimes: Sequence[Axis],
    base: Mapping[str, Any],
    faults: list[str],
) -> tuple[HeldOut, ...]:
    """Resolve regions against the draws.

    Parameters
    ----------
    regions : sequence of Region
        Regions as in the recipe.
    columns : mapping
        Scene value of each manifest column that may be bounded.
    axes : sequence of Axis
        Draws for every record or machine.
    sometimes : sequence of Axis
        Draws that apply if a confounder is present.
    base : mapping
        Table of the scene.
    faults : list of str
        List to which faults are added: names given twice, unknown columns, bounds of another
        dimension or in the wrong order, regions that contain no record or every record.

    Returns
    -------
    tuple of HeldOut
        The valid regions.
    """
    names = [region.name for region in regions]
    faults += [
        f"held_out name '{name}' is given {names.count(name)} times, must be unique; rename one"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]
    found = []
    for region in regions:
        try:
            bounds = _bounds(region, columns, base)
            spans = {name: _spans(columns[name], axes, sometimes, base) for name in bounds}
            _refuse_all_or_none(bounds, spans)
            found.append(HeldOut(region.name, bounds))
        except SceneError as error:
            faults += [f"held_out '{region.name}': {fault}" for fault in error.faults]
    return tuple(found)


def _bounds(
    region: Region, columns: Mapping[str, str], base: Mapping[str, Any]
) -> dict[str, tuple[float, float]]:
    faults, found = [], {}
    scene = scene_from_table(base)
    for column, ends in region.bounds.items():
        if column not in columns:
            faults.append(f"{column} is no column of it, must be one of {', '.join(columns)}")
            continue
        own = float(value_at(scene, columns[column]))
        try:
            low = -math.inf if ends.low is None else _in_si(ends.low, column, own)
            high = math.inf if ends.high is None else _in_si(ends.high, column, own)
        except ValueError as error:
            faults.append(f"{column}: a bound {error}")
            continue
        if not low < high:
            faults.append(f"{column}: low = {low:g} must be < high = {high:g}; swap them")
        found[column] = low, high
    if faults:
        raise SceneError("held_out", faults)
    return found


def _in_si(bound: Bound, column: str, own: float) -> float:
    if isinstance(bound, str) and bound.rstrip().endswith("%"):
        return to_si(bound, "ratio") * own
    dimension = next(name for ending, name in DIMENSIONS.items() if column.endswith(ending))
    return to_si(bound, dimension)


_Spans = Sequence[tuple[float, float]]


def _refuse_all_or_none(
    bounds: Mapping[str, tuple[float, float]], spans: Mapping[str, _Spans]
) -> None:
    """A split needs both of its sides."""
    empty = [c for c, ends in bounds.items() if not any(_meet(ends, s) for s in spans[c])]
    whole = [c for c, ends in bounds.items() if all(_inside(s, ends) for s in spans[c])]
    faults = [
        f"{column} from {bounds[column][0]:g} to {bounds[column][1]:g} holds no record, drawn is "
        f"{_shown(spans[column])}; move the bounds"
        for column in empty
    ]
    if len(whole) == len(bounds):
        drawn = ", ".join(f"{column} is {_shown(spans[column])}" for column in whole)
        faults.append(f"every record lies in it, {drawn}; narrow the bounds")
    if faults:
        raise SceneError("held_out", faults)


def _meet(ends: tuple[float, float], span: tuple[float, float]) -> bool:
    """Whether they share more than an edge, unless the span is a single value."""
    low, high = max(ends[0], span[0]), min(ends[1], span[1])
    return low < high or (span[0] == span[1] and low == high)


def _inside(span: tuple[float, float], ends: tuple[float, float]) -> bool:
    return ends[0] <= span[0] and span[1] <= ends[1]


def _shown(spans: _Spans) -> str:
    return " or ".join(f"{low:g}" if low == high else f"{low:g} to {high:g}" for low, high in spans)


def _spans(
    path: str, axes: Sequence[Axis], sometimes: Sequence[Axis], base: Mapping[str, Any]
) -> _Spans:
    """Ranges of a scene value: as drawn, or its own value and those of its faults."""
    always = _bands(path, axes) or [_span_beside(path, axes, base)]
    return [*always, *_bands(path, sometimes)]


def _bands(path: str, axes: Sequence[Axis]) -> list[tuple[float, float]]:
    drawn = [axis for axis in axes if isinstance(axis, Range) and axis.path == path]
    return [band for axis in drawn for band in axis.bands]


def _span_beside(path: str, axes: Sequence[Axis], base: Mapping[str, Any]) -> tuple[float, float]:
    """Range of a value that is not drawn itself but may follow from draws of its table.

    For example a viscosity from a temperature; it is assumed to be monotonic in each of them.
    """

    def value(changes: Mapping[str, Any]) -> float:
        return float(value_at(scene_from_table(override(base, changes)), path))

    table = path.rpartition(".")[0]
    least: dict[str, Any] = {}
    greatest: dict[str, Any] = {}
    for axis in axes:
        if axis.path.rpartition(".")[0] == table:
            rising = sorted(axis.extremes(), key=lambda end: value({axis.path: end}))
            least[axis.path], greatest[axis.path] = rising
    return value(least), value(greatest)
