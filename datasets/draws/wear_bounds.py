"""Bounds of wear relative to the limits of the scene, to follow it: ``150 % of limit``."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from ...sim.parts.units import to_si
from .draws import Bound

AS_NEW = "as new"
"""Bound that stands for the smallest wear of a new part."""

_OF_LIMIT = re.compile(r"(.+%)\s*of (?:the )?limit")


class Limits(Protocol):
    """Wear limits of a scene."""

    @property
    def as_new(self) -> float:
        """Smallest wear of a new part [m]."""

    @property
    def condemning(self) -> float:
        """Wear above which the part must be renewed [m]."""


def follows_limits(bound: Bound | None) -> bool:
    """Whether a bound is relative to wear limits.

    Examples
    --------
    >>> follows_limits("150 % of limit"), follows_limits("as new"), follows_limits("0.4 mm")
    (True, True, False)
    """
    text = bound.strip() if isinstance(bound, str) else ""
    return text == AS_NEW or _OF_LIMIT.fullmatch(text) is not None


def bound_of_limits(bound: Bound, limits: Limits | None) -> Bound:
    """Bound in metres if it is relative to wear limits; otherwise unchanged.

    Parameters
    ----------
    bound : float or str
        ``as new``, or a share of the condemning limit such as ``150 % of limit``.
    limits : Limits or None
        Wear limits of the scene for the severity; None if it has none.

    Returns
    -------
    float or str
        Bound [m].

    Raises
    ------
    ValueError
        If there are no limits, or the share is invalid.
    """
    if not follows_limits(bound):
        return bound
    if limits is None:
        raise ValueError("needs wear limits, which the scene does not have; give a length")
    share = _OF_LIMIT.fullmatch(str(bound).strip())
    return limits.as_new if share is None else to_si(share[1], "ratio") * limits.condemning


def foreign_bounds(
    inherited: Mapping[str, Sequence[Mapping[str, Any]]], scene: str, other: str
) -> list[str]:
    """Faults of bounds inherited from a recipe of another scene that do not follow its limits.

    Parameters
    ----------
    inherited : mapping
        ``severity`` and ``held_out`` of the extended recipe, without those given again.
    scene, other : str
        Scene of this recipe and of the extended one.

    Returns
    -------
    list of str
        Faults, one message each.
    """
    cure = (
        f"is of the scene {other}, must be of {scene}; give it again, name it in without, or give "
        "it by the limits ('150 % of limit', 'as new')"
    )
    faults = [
        f"severity {entry.get('path')}: {name} = {entry[name]!r} {cure}"
        for entry in inherited.get("severity", ())
        for name in ("low", "high")
        if name in entry and not follows_limits(entry[name])
    ]
    return faults + [
        f"held_out {entry.get('name')}: {column}, {name} = {value!r} {cure}"
        for entry in inherited.get("held_out", ())
        for column, ends in _tables(entry.get("bounds"))
        for name, value in ends.items()
        if not str(value).rstrip().endswith("%") and not follows_limits(value)
    ]


def _tables(value: Any) -> list[tuple[str, Mapping[str, Any]]]:
    """Entries that are tables; others are refused when the recipe is validated."""
    if not isinstance(value, Mapping):
        return []
    return [(str(key), entry) for key, entry in value.items() if isinstance(entry, Mapping)]
