"""Fitted parts of models as plain arrays, and back; whether arrays make such a part."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..familiarity.bandwidth import tops_in
from ..familiarity.noise_floor import floors_in, noise_levels_in
from ..familiarity.novelty import Familiarity
from ..familiarity.quietness import peak_channels
from ..feature_rows.model_card import Strict
from ..learning.blends import Blend, Forest, Linear, Part
from ..learning.nets import Nets

_LARGEST_NUMBER = 1e60  # of an array: products of a few are still finite
_LEAST_SPREAD = 1e-60
_DEEPEST = 256  # steps down a tree: four times what 10^5 records grow

_PART_KINDS: dict[str, Any] = {"linear": Linear, "forest": Forest, "nets": Nets}
"""Kinds of the parts of a blend."""


class BlendStructure(Strict):
    """Which parts a blend has; their numbers are in the arrays."""

    names: list[str] = Field(min_length=1, max_length=100)
    kinds: list[Literal["linear", "forest", "nets"]] = Field(min_length=1, max_length=100)
    low: float
    high: float
    tube: float = Field(ge=0)

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        if len(self.names) != len(self.kinds):
            raise ValueError("names and kinds must be as many")
        return self


def blend_structure(blend: Blend) -> dict[str, Any]:
    """Table of a blend, as :class:`BlendStructure`."""
    kinds = {kind: name for name, kind in _PART_KINDS.items()}
    return {
        "names": list(blend.names),
        "kinds": [kinds[type(part)] for part in blend.parts],
        "low": blend.low,
        "high": blend.high,
        "tube": blend.tube,
    }


def blend_arrays(blend: Blend, place: str) -> dict[str, Any]:
    """Every number of a blend by a dotted name under `place`."""
    found: dict[str, Any] = {f"{place}.weights": blend.weights}
    for i, part in enumerate(blend.parts):
        found |= part_arrays(part, f"{place}.{i}")
    return found


def part_arrays(part: Any, place: str) -> dict[str, Any]:
    """Every number of a part (a dataclass of arrays and numbers) by a dotted name."""
    return {f"{place}.{field.name}": getattr(part, field.name) for field in fields(part)}


def blend_of(structure: BlendStructure, arrays: Mapping[str, NDArray[Any]], place: str) -> Blend:
    """Blend of its table and of the arrays under `place`.

    Raises
    ------
    KeyError, ValueError
        Arrays are missing, or hold no such numbers.
    """
    kinds = [_PART_KINDS[kind] for kind in structure.kinds]
    return Blend(
        names=tuple(structure.names),
        parts=tuple(kind(**part_of(arrays, f"{place}.{i}", kind)) for i, kind in enumerate(kinds)),
        weights=_number_array(arrays[f"{place}.weights"], "weights"),
        low=structure.low,
        high=structure.high,
        tube=structure.tube,
    )


def refuse_more(arrays: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    """Refuse arrays of a file that its model has no part for.

    Raises
    ------
    ValueError
    """
    more = sorted(set(arrays) - set(known))
    if more:
        raise ValueError(f"{', '.join(more)} belong to no part")


_WHOLE = {"feature", "left", "right", "root", "depth", "group", "groups", "label"}
"""Fields that hold whole numbers."""

_WHOLE_END = 2.0**53  # up to here floats hold every one


def part_of(arrays: Mapping[str, NDArray[Any]], part: str, kind: Any) -> dict[str, Any]:
    """Fields of one part; a single number comes back as a Python one.

    Parameters
    ----------
    arrays : mapping
        Name of the file, for messages.
    part : str
        Its dotted name.
    kind : type
        A dataclass of arrays and numbers.

    Returns
    -------
    dict
        Field -> array or number, of the type that the field has.

    Raises
    ------
    ValueError
        One is missing, or holds no such numbers.
    """
    names = [f"{part}.{field.name}" for field in fields(kind)]
    missing = [name for name in names if name not in arrays]
    if missing:
        raise ValueError(f"{', '.join(missing)} missing")
    found = {
        name.removeprefix(f"{part}."): _number_array(arrays[name], name.rpartition(".")[2])
        for name in names
    }
    return {name: array if array.ndim else array.item() for name, array in found.items()}


def _number_array(array: NDArray[Any], name: str) -> NDArray[Any]:
    """An array of the type its field has; whatever is no such number is refused."""
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} is of type {array.dtype}, must be numbers")
    if name == "log":
        return array.astype(bool)
    if name not in _WHOLE:
        return array.astype(np.float64)
    whole = np.clip(np.floor(array), -_WHOLE_END, _WHOLE_END)
    if array.dtype.kind == "f" and not np.array_equal(array, whole):
        raise ValueError(f"{name} holds fractions, must hold whole numbers")
    return array.astype(np.intp)


# --- checks


def numbers_fit(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether every number is one, and small enough to be reckoned with."""
    return all(bool((np.abs(value) <= _LARGEST_NUMBER).all()) for value in arrays.values())


def blend_fits(blend: Blend, n: int) -> bool:
    """Whether a blend can be asked about rows of n features, and ends."""
    weights = blend.weights
    return (
        weights.shape == (len(blend.parts),)
        and bool((weights > 0).all())
        and abs(float(weights.sum()) - 1) < _ROUNDING
        and blend.low < blend.high
        and all(_part_fits(part, n) for part in blend.parts)
    )


def _part_fits(part: Part, n: int) -> bool:
    if isinstance(part, Linear):
        return linear_fits(part, n)
    return _nets_fit(part, n) if isinstance(part, Nets) else _forest_fits(part, n)


_ROUNDING = 1e-9


def spreads_fit(values: NDArray[np.float64]) -> bool:
    """Whether one can divide by them."""
    return bool((values > _LEAST_SPREAD).all())


def linear_fits(part: Linear, n: int) -> bool:
    """Whether a line can be asked about rows of n features."""
    return (
        shapes_of(part.centre, part.spread, part.weight, part.low, part.high) == {(n,)}
        and bool((part.low <= part.high).all())
        and isinstance(part.offset, float)
        and isinstance(part.log, bool)
        and spreads_fit(part.spread)
    )


def _nets_fit(part: Nets, n: int) -> bool:
    shapes = [np.shape(weights) for weights in (part.direction, part.first, part.second)]
    if [len(shape) for shape in shapes] != [2, 3, 3]:
        return False
    (_, seen), (count, _, first), (_, _, second) = shapes
    return (
        shapes_of(part.centre, part.spread) == {(n,)}
        and shapes == [(n, seen), (count, seen, first), (count, first, second)]
        and np.shape(part.first_bias) == (count, first)
        and shapes_of(part.second_bias, part.last) == {(count, second)}
        and np.shape(part.last_bias) == (count,)
        and count > 0
        and isinstance(part.scale, float)
        and isinstance(part.offset, float)
        and spreads_fit(part.spread)
    )


def _forest_fits(part: Forest, n: int) -> bool:
    nodes = np.size(part.value)
    return (
        shapes_of(part.feature, part.threshold, part.left, part.right, part.value) == {(nodes,)}
        and np.ndim(part.root) == 1
        and np.size(part.root) > 0
        and isinstance(part.depth, int)
        and 0 <= part.depth <= _DEEPEST
        and isinstance(part.offset, float)
        and isinstance(part.log, bool)
        and all(_within(i, nodes) for i in (part.left, part.right, part.root))
        and _within(part.feature, n)
        and _are_trees(part, nodes)
    )


def _are_trees(part: Forest, nodes: int) -> bool:
    """Whether every way from a root ends in a leaf after `depth` steps at most, and none meet."""
    itself = np.arange(nodes)
    inner = (part.left != itself) | (part.right != itself)
    children = np.concatenate([part.left[inner], part.right[inner], part.root])
    if not (np.bincount(children, minlength=nodes) == 1).all():
        return False  # two ways to a node, or none: a ring, or a node that nothing leads to
    level, reached = part.root, 0
    for _ in range(part.depth + 1):
        reached += len(level)
        below = level[inner[level]]
        level = np.concatenate([part.left[below], part.right[below]])
    return reached == nodes


def _within(index: NDArray[np.intp], n: int) -> bool:
    return bool((index >= 0).all() and (index < n).all())


def familiarity_fits(cloud: Familiarity, names: Sequence[str], n: int) -> bool:
    """Whether a cloud is one of features of these names, with n coordinates."""
    peaks, floors = len(peak_channels(names)), floors_in(names)
    return (
        shapes_of(cloud.centre, cloud.spread) == {(n,)}
        and shapes_of(cloud.low, cloud.high) == {(len(names),)}
        and isinstance(cloud.weight, float)
        and cloud.weight >= 0
        and isinstance(cloud.seldom_outside, float)
        and 0 <= cloud.seldom_outside <= 1
        and isinstance(cloud.most_lacking, float)
        and isinstance(cloud.seldom_lacking, float)
        and 0 <= cloud.seldom_lacking <= cloud.most_lacking
        and shapes_of(cloud.usual_peak, cloud.peak_slope) == {(peaks,)}
        and np.shape(cloud.floor_ceiling) == (floors,)
        and isinstance(cloud.most_noise, float)
        and np.shape(cloud.least_noise) == (noise_levels_in(names),)
        and shapes_of(*cloud.tops) == {(tops_in(names),)}
        and np.shape(cloud.whiten) == (n, n)
        and np.ndim(cloud.groups) == 1
        and np.size(cloud.groups) > 0
        and np.shape(cloud.machines) == (np.size(cloud.groups), n)
        and spreads_fit(cloud.spread)
    )


def shapes_of(*arrays: Any) -> set[tuple[int, ...]]:
    """Shapes that arrays have; one where all are alike."""
    return {np.shape(array) for array in arrays}
