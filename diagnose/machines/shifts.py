"""What a recipe may take for granted: plausible shifts of every machine's scene, with reasons.

A row whose path a scene lacks is left out, unless it adds the part; one that the recipe draws is
shifted beyond its range instead, see :mod:`.blindspots.rows`. All amounts are estimates of what
differs from one machine, or one nameplate, to the next. The rows of each machine are beside how it
is shown; a new row is one line.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["factor", "add", "set"]


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A value of the scene, and what it may be instead.

    Attributes
    ----------
    path : str
        Dotted path of the scene; ``*`` stands for every list entry, all shifted together.
    kind : {"factor", "add", "set"}
        Whether the amounts multiply the machine's own value, are added to it [SI], or replace it.
    amounts : tuple
        One row each; text has a unit or is the name of a rung or law.
    why : str
        How such a difference comes about.
    beside : mapping
        What has to be set with it, by dotted path.
    under : mapping
        What the scene must say for the value to count, by dotted path: a rung that reads it.
    adds : bool
        Whether the row holds for scenes that lack the part too: `beside` describes all of it.
    """

    path: str
    kind: Kind
    amounts: tuple[Any, ...]
    why: str
    beside: Mapping[str, Any] = field(default_factory=dict)
    under: Mapping[str, Any] = field(default_factory=dict)
    adds: bool = False


def factor(path: str, low: float, high: float, why: str) -> Shift:
    """A value times one of two factors."""
    return Shift(path=path, kind="factor", amounts=(low, high), why=why)


def add(path: str, low: float, high: float, why: str) -> Shift:
    """A value with one of two amounts added [SI]."""
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
    """A value replaced; of a part that a scene may lack, `adds` makes it with what is `beside`."""
    with_it: dict[str, Mapping[str, Any]] = {"beside": beside or {}, "under": under or {}}
    return Shift(path=path, kind="set", amounts=amounts, why=why, adds=adds, **with_it)
