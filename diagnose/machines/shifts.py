"""Plausible differences between machines that a recipe may not vary, with reasons.

A row whose path a scene lacks is left out, unless it adds the part; a value that the recipe draws
is moved beyond its range instead, see :mod:`.blindspots.rows`. All amounts are estimates of the
differences between machines or nameplates. The rows of each machine are in its presentation; a new
row is one line.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["factor", "add", "set"]


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A value of the scene, and its possible alternatives.

    Attributes
    ----------
    path : str
        Dotted path of the scene; ``*`` stands for every list entry, all changed together.
    kind : {"factor", "add", "set"}
        Whether the amounts multiply the machine's own value, are added to it [SI], or replace it.
    amounts : tuple
        One row each; text has a unit or is the name of a rung or law.
    why : str
        Cause of such a difference.
    beside : mapping
        Values to be set with it, by dotted path.
    under : mapping
        Values of the scene required for an effect, by dotted path: a rung that uses it.
    adds : bool
        Whether the row also applies to scenes without the part, which `beside` describes fully.
    """

    path: str
    kind: Kind
    amounts: tuple[Any, ...]
    why: str
    beside: Mapping[str, Any] = field(default_factory=dict)
    under: Mapping[str, Any] = field(default_factory=dict)
    adds: bool = False


def factor(path: str, low: float, high: float, why: str) -> Shift:
    """Shift that multiplies a value by one of two factors."""
    return Shift(path=path, kind="factor", amounts=(low, high), why=why)


def add(path: str, low: float, high: float, why: str) -> Shift:
    """Shift that adds one of two amounts to a value [SI]."""
    return Shift(path=path, kind="add", amounts=(low, high), why=why)


def set_to(
    path: str,
    amounts: tuple[Any, ...],
    why: str,
    *,
    beside: Mapping[str, Any] | None = None,
    under: Mapping[str, Any] | None = None,
    adds: bool = False,
) -> Shift:
    """Shift that replaces a value; `adds` creates a missing part from `beside`."""
    context: dict[str, Mapping[str, Any]] = {"beside": beside or {}, "under": under or {}}
    return Shift(path=path, kind="set", amounts=amounts, why=why, adds=adds, **context)
