"""Values drawn around a scene, as specified in a recipe and resolved against the scene."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, NoReturn, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.special import ndtri

from ...sim.parts.dimensions import Ratio
from ...sim.parts.part import Part
from ...sim.scene.load import numbered, override, scene_from_table
from ...sim.scene.rungs import with_values
from ...sim.scene.scene import Scene, SceneError

Bound = float | str
"""A number in SI, or a text with a unit."""


class Draw(Part):
    """One scene value, or every value that ``*`` matches, drawn independently."""

    path: str = Field(description="dotted path of the scene; * stands for every list entry")
    distribution: Literal["uniform", "log-uniform", "factor", "log-factor", "relative-normal"] = (
        Field(description="what is drawn: the value itself, a factor on the scene's, or a change")
    )
    low: Bound | None = Field(default=None, description="lower end, or smallest factor")
    high: Bound | None = Field(default=None, description="upper end, or largest factor")
    bands: tuple[tuple[Bound, Bound], ...] = Field(
        default=(), description="several ranges instead of low and high, weighted by their width"
    )
    scale: Ratio | None = Field(
        default=None,
        gt=0,
        le=10,
        description="relative-normal: norm of the change over the value's norm",
    )

    @model_validator(mode="after")
    def _consistent_bounds(self) -> Self:
        vector = self.distribution == "relative-normal"
        ends = [self.low is not None, self.high is not None]
        if vector and (self.scale is None or any(ends) or self.bands):
            raise ValueError(f"{self.path}: relative-normal takes scale and nothing else")
        if not vector and self.scale is not None:
            raise ValueError(f"{self.path}: scale is for relative-normal; give low and high")
        if not vector and (any(ends) == bool(self.bands) or any(ends) != all(ends)):
            raise ValueError(f"{self.path}: give low and high, or bands, and not both")
        return self

    @property
    def ranges(self) -> tuple[tuple[Bound, Bound], ...]:
        """Bands as written in the recipe."""
        if self.low is not None and self.high is not None:
            return ((self.low, self.high),)
        return self.bands


@dataclass(frozen=True)
class Kind:
    """Meaning of the bounds of a distribution, which is uniform in `scale` of the value.

    Attributes
    ----------
    relative : bool
        Whether bounds multiply the scene's own value.
    scale, back : callable
        Transformation to the scale, and its inverse.
    """

    relative: bool
    scale: Callable[[float], float]
    back: Callable[[float], float]


KINDS = {
    "uniform": Kind(False, float, float),
    "log-uniform": Kind(False, math.log, math.exp),
    "factor": Kind(True, float, float),
    "log-factor": Kind(True, math.log, math.exp),
}
"""Distributions of a number."""


@dataclass(frozen=True)
class Range:
    """A number drawn from bands, uniform in the scale of its kind.

    Attributes
    ----------
    path : str
        Path in the scene.
    kind : Kind
        Kind of distribution.
    bands : tuple of (float, float)
        Bands, rising [SI].
    """

    path: str
    kind: Kind
    bands: tuple[tuple[float, float], ...]

    @property
    def entries(self) -> tuple[str, ...]:
        """Name of its one coordinate."""
        return (self.path,)

    def value(self, coordinates: Sequence[float]) -> float:
        """Value at a coordinate in (0, 1), rising with it [coordinates: shape=(1,)]."""
        scaled = [(self.kind.scale(low), self.kind.scale(high)) for low, high in self.bands]
        [left] = coordinates
        left *= sum(high - low for low, high in scaled)
        for low, high in scaled:
            if left <= high - low:
                return self.kind.back(low + left)
            left -= high - low
        return self.bands[-1][1]

    def extremes(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return self.bands[0][0], self.bands[-1][1]


@dataclass(frozen=True)
class Vector:
    """A table of numbers plus a random vector of given norm.

    Attributes
    ----------
    path : str
        Path in the scene.
    base : mapping
        The scene's own numbers.
    scale : float
        Norm of the change over that of `base`.
    """

    path: str
    base: Mapping[str, float]
    scale: float

    @property
    def entries(self) -> tuple[str, ...]:
        """Names of its coordinates, one for each number."""
        return tuple(f"{self.path}.{key}" for key in self.base)

    def value(self, coordinates: Sequence[float]) -> dict[str, float]:
        """Table at coordinates in (0, 1) [shape=(n_numbers,)], with no preferred direction."""
        centre = np.array(list(self.base.values()))
        change = ndtri(np.asarray(coordinates))  # normal, so that no direction is preferred
        change *= self.scale * np.linalg.norm(centre) / np.linalg.norm(change)
        return dict(zip(self.base, (centre + change).tolist(), strict=True))

    def extremes(self) -> tuple[Mapping[str, float], Mapping[str, float]]:
        """The scene's own numbers: a norm has no corners."""
        return self.base, self.base


Axis = Range | Vector


def axes_of(
    places: Mapping[str, Draw], base: Mapping[str, Any], faults: list[str]
) -> dict[str, list[Axis]]:
    """Resolve draws against the scene; a fault of one does not hide those of the next.

    Parameters
    ----------
    places : mapping
        Draws by their place in the recipe, for messages.
    base : mapping
        Table of the scene.
    faults : list of str
        List to which faults are added: paths that the scene lacks, bounds that it refuses.

    Returns
    -------
    dict
        By place: one axis for every value that the draw's path matches; none if it is faulty.
    """
    axes: dict[str, list[Axis]] = {}
    whole = _Whole(base, scene_from_table(base))
    for place, draw in places.items():
        try:
            found = [_axis(draw, path, whole) for path in matches(base, draw.path)]
            _try_extremes(found, whole)
            axes[place] = found
        except SceneError as error:
            faults += [f"{place} ({draw.path}): {fault}" for fault in error.faults]
    return axes


def matches(base: Mapping[str, Any], pattern: str) -> list[str]:
    """All paths of the scene that a pattern with ``*`` matches.

    Raises
    ------
    SceneError
        If a ``*`` stands where the scene has no list.

    Examples
    --------
    >>> matches({"sensors": [{}, {}]}, "sensors.*.gain")
    ['sensors.0.gain', 'sensors.1.gain']
    """
    found = [""]
    for key in pattern.split("."):
        if key != "*":
            found = [f"{path}.{key}".lstrip(".") for path in found]
            continue
        lists = {path: _node(base, path) for path in found}
        if not all(isinstance(node, list) for node in lists.values()):
            raise SceneError("path", [f"{pattern}: '*' stands where the scene has no list"])
        found = [f"{path}.{i}" for path, node in lists.items() for i in range(len(node))]
    return found


def _node(base: Any, path: str) -> Any:
    for key in path.split("."):
        inside = isinstance(base, list) and key.isdigit() and int(key) < len(base)
        base = base[int(key)] if inside else base.get(key) if isinstance(base, dict) else None
    return base


class _Whole(NamedTuple):
    """A scene as a table and validated: unchanged parts need not be validated again."""

    base: Mapping[str, Any]
    scene: Scene

    def changed(self, values: Mapping[str, Any]) -> Scene:
        """The scene with values replaced by dotted path, or its own error if it refuses them."""
        try:
            return with_values(self.scene, values)
        except (SceneError, AttributeError):  # tables that are not parts, such as mode shapes
            return scene_from_table(override(self.base, values))


def _axis(draw: Draw, path: str, whole: _Whole) -> Axis:
    if draw.distribution == "relative-normal":
        vector = _own_value(whole, path)
        if not isinstance(vector, Mapping) or not any(vector.values()):
            raise SceneError(path, [f"{path} is no table of numbers, as relative-normal needs"])
        return Vector(path, vector, draw.scale or 0.0)
    kind = KINDS[draw.distribution]
    if kind.relative:
        bands = _relative_bands(draw, path, whole)
    else:
        bands = tuple((_in_si(whole, path, a), _in_si(whole, path, b)) for a, b in draw.ranges)
    _refuse_bands(path, bands, positive=kind.scale is math.log)
    return Range(path, kind, bands)


def _relative_bands(draw: Draw, path: str, whole: _Whole) -> tuple[tuple[float, float], ...]:
    value = _own_value(whole, path)
    if not isinstance(value, float) or value == 0:
        raise SceneError(path, [f"{path} = {value!r} must not be 0 to be multiplied; use uniform"])
    if any(isinstance(factor, str) for band in draw.ranges for factor in band):
        raise SceneError(path, [f"{path}: a factor takes plain numbers, like low = 0.9"])
    factors = tuple((float(low), float(high)) for low, high in draw.ranges)
    _refuse_bands(path, factors, positive=False)
    if value > 0:
        return tuple((value * low, value * high) for low, high in factors)
    return tuple((value * high, value * low) for low, high in reversed(factors))


def _refuse_bands(path: str, bands: tuple[tuple[float, float], ...], *, positive: bool) -> None:
    flat = [end for band in bands for end in band]
    rising = all(low < high for low, high in bands) and flat == sorted(flat)
    if not rising:
        shown = ", ".join(f"{low:g} to {high:g}" for low, high in bands)
        raise SceneError(path, [f"{path}: {shown} must rise and not overlap; reorder the bounds"])
    if positive and flat[0] <= 0:
        raise SceneError(path, [f"{path}: low = {flat[0]:g} must be > 0 for a logarithm; raise it"])


def _in_si(whole: _Whole, path: str, value: Bound) -> float:
    """Bound in SI, parsed by the scene itself."""
    values = {path: value}
    scene = whole.changed(values)
    if not has_value(scene, path):
        _refuse_path(override(whole.base, values), path)
    number = value_at(scene, path)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        raise SceneError(path, [f"{path} = {number!r} is no number; draw one that is"])
    return float(number)


def _own_value(whole: _Whole, path: str) -> Any:
    """Value of the scene at a dotted path."""
    if not has_value(whole.scene, path):
        _refuse_path(whole.base, path)
    return value_at(whole.scene, path)


def _refuse_path(base: Mapping[str, Any], path: str) -> NoReturn:
    """Refuse a path that a scene lacks, with the scene's own message."""
    scene_from_table(override(base, {path: 0.0}))  # names the nearest key
    by_number = numbered(base, path)
    cure = (
        "see the scene's own tables"
        if by_number == path
        else f"a recipe counts the entries of a list: {by_number}"
    )
    raise SceneError(path, [f"{path} does not lead to a value; {cure}"])


def value_at(node: Any, path: str) -> Any:
    """Value of a scene at a dotted path; list entries by number.

    Raises
    ------
    AttributeError, KeyError, IndexError, ValueError
        If the scene has no such path.
    """
    for key in path.split("."):
        if isinstance(node, Mapping):
            node = node[key]
        elif isinstance(node, tuple):
            node = node[int(key)]
        else:
            node = getattr(node, key)
    return node


def has_value(scene: Scene, path: str) -> bool:
    """Whether the scene has a value at a dotted path."""
    try:
        value_at(scene, path)
    except (AttributeError, KeyError, IndexError, ValueError):
        return False
    return True


def _try_extremes(axes: Sequence[Axis], whole: _Whole) -> None:
    """Let the scene refuse bounds now rather than in the middle of a run."""
    for end in (0, 1):
        whole.changed({axis.path: axis.extremes()[end] for axis in axes})
