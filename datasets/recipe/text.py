"""The text of a recipe: built-in or a file, with all that it takes from another recipe."""

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...sim.scene.load import scene_table, unread_text
from ...sim.scene.scene import SceneError
from ..draws.wear_bounds import foreign_bounds

RECIPE_FOLDER = Path(__file__).parent / "built_in"

LONGEST_CHAIN = 8
"""Longest chain of ``extends``; a longer one would be unreadable."""

_OWN = ("name", "description", "extends", "without")  # keys that are never inherited
_LISTS = {
    "severity": "path",
    "machine": "path",
    "record": "path",
    "choice": "name",
    "confounder": "name",
    "held_out": "name",
}
"""Identifying key of the entries of each list of a recipe."""


class RecipeError(SceneError):
    """All faults of one recipe, one line each."""


@dataclass(frozen=True, kw_only=True)
class RecipeSource:
    """A recipe as written, with every ``extends`` followed.

    Attributes
    ----------
    table : dict
        Plain tables, not yet validated.
    text : str
        TOML: the file's own, or, if it extends another, all of it in one.
    folder : Path
        Folder searched first for its scene.
    machines_folder : Path
        Folder searched first for the recipe named by ``machines_of``.
    foreign : tuple of str
        Faults: bounds of wear inherited from a recipe of another scene.
    inherited : mapping
        Scene of origin of each draw (by path) and confounder (by name) inherited from a recipe of
        another scene.
    """

    table: dict[str, Any]
    text: str
    folder: Path
    machines_folder: Path
    foreign: tuple[str, ...] = ()
    inherited: Mapping[str, str] = field(default_factory=dict)


def recipe_names() -> list[str]:
    """Names of the built-in recipes, sorted.

    Examples
    --------
    >>> "bilge-pump-standard" in recipe_names()
    True
    """
    return sorted(path.stem for path in RECIPE_FOLDER.glob("*.toml"))


def recipe_text(name_or_path: str | Path) -> str:
    """TOML text of a built-in recipe or of a file, as written.

    Raises
    ------
    RecipeError
        If there is neither; the nearest built-in one is named.
    """
    try:
        return _location(name_or_path).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a NUL in the name
        fault = unread_text(name_or_path, "recipe", recipe_names(), error)
        raise RecipeError(str(name_or_path), [fault]) from None


def _location(name_or_path: str | Path) -> Path:
    built_in = RECIPE_FOLDER / f"{name_or_path}.toml"
    return built_in if built_in.is_file() else Path(name_or_path)


def read_recipe(name_or_path: str | Path, *, twin: str | Path | None = None) -> RecipeSource:
    """Read a recipe with all that it extends, and its twin.

    Parameters
    ----------
    name_or_path : str or Path
        A name of `recipe_names`, or a file.
    twin : str or Path, optional
        Calibrated scene in place of the twin named in the recipe.

    Returns
    -------
    RecipeSource
        See `merged` for how the tables are combined.

    Raises
    ------
    RecipeError
        If a recipe of the chain is missing or not TOML, the chain is circular or longer than
        `LONGEST_CHAIN`, ``without`` names a missing entry, or the twin has no file.

    Examples
    --------
    >>> source = read_recipe("bilge-pump-small")
    >>> source.table["records"], "extends" in source.table
    (120, False)
    """
    chain = list(_chain(name_or_path))
    table: dict[str, Any] = {}
    folders = {"scene": Path(), "machines_of": Path()}
    foreign: list[str] = []
    inherited: dict[str, str] = {}
    for place, own in reversed(chain):
        _refuse_without(own, table, place)
        foreign = _foreign(own, table, foreign)
        inherited = _inherited(own, table, inherited)
        folders |= {key: place.parent for key in folders if key in own}
        table = merged(table, own)
    plain = len(chain) == 1 and twin is None and not isinstance(table.get("twin"), str)
    table = _with_twin(table, str(name_or_path), chain[0][0].parent, twin)
    text = recipe_text(name_or_path) if plain else toml_text(table)
    return RecipeSource(
        table=table,
        text=text,
        folder=folders["scene"],
        machines_folder=folders["machines_of"],
        foreign=tuple(foreign),
        inherited=inherited,
    )


def _with_twin(
    table: dict[str, Any], name: str, folder: Path, twin: str | Path | None
) -> dict[str, Any]:
    """A table with the numbers of its twin in place of the name of the file that holds them."""
    given = table.get("twin") if twin is None else str(twin)
    if not isinstance(given, str):
        return table
    place = twin_path(given) if twin is not None else folder / twin_path(given)
    try:
        text = place.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        fault = f"twin = {given!r}: {place} cannot be read ({error}); make it: wearstate calibrate"
        raise RecipeError(name, [fault]) from None
    return {**table, "twin": scene_table(text, str(place))}


def twin_path(scene: str | Path) -> Path:
    """File of the posterior that belongs to a calibrated scene.

    Examples
    --------
    >>> twin_path("mine.toml").name
    'mine.twin.toml'
    """
    path = Path(scene)
    return path if path.name.endswith(".twin.toml") else path.with_suffix(".twin.toml")


def _foreign(own: Mapping[str, Any], base: Mapping[str, Any], before: list[str]) -> list[str]:
    """Bounds of wear still relative to the previous scene, if a recipe names another."""
    scene, other = own.get("scene", base.get("scene")), base.get("scene")
    if other is None or scene == other:
        return before
    kept = {name: _kept(own, base, name) for name in ("severity", "held_out")}
    return foreign_bounds(kept, str(scene), str(other))


def _kept(own: Mapping[str, Any], base: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    """Entries of a list that a recipe takes over unchanged."""
    key = _LISTS[name]
    anew = {*(_key_of(e, key) for e in _tables(own.get(name))), *map(str, own.get("without", []))}
    return [entry for entry in _tables(base.get(name)) if _key_of(entry, key) not in anew]


def _inherited(
    own: Mapping[str, Any], base: Mapping[str, Any], before: Mapping[str, str]
) -> dict[str, str]:
    """Draws inherited from a previous scene, by path or name."""
    other = base.get("scene")
    changed = other is not None and own.get("scene", other) != other
    lists = ("machine", "record", "choice", "confounder")
    kept = [str(_key_of(e, _LISTS[name])) for name in lists for e in _kept(own, base, name)]
    return {key: before.get(key, str(other)) for key in kept if changed or key in before}


def _tables(value: Any) -> list[Mapping[str, Any]]:
    """Entries of a list that are tables."""
    entries = _entries(value)
    if not isinstance(entries, list):
        return []
    return [entry for entry in entries if isinstance(entry, Mapping)]


def _chain(name_or_path: str | Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """A recipe, the one it extends, and so on: place and table of each."""
    reference: str | Path | None = name_or_path
    seen: list[Path] = []
    while reference is not None:
        text = recipe_text(reference)
        place = _location(reference).resolve()
        if place in seen or len(seen) == LONGEST_CHAIN:
            shown = " -> ".join(path.stem for path in (*seen, place))
            bound = "must not come back" if place in seen else f"must be <= {LONGEST_CHAIN} long"
            fault = f"extends: {shown} {bound}; write the draws out in one of them"
            raise RecipeError(str(name_or_path), [fault])
        seen.append(place)
        try:
            table = scene_table(text, str(reference))
        except SceneError as error:
            raise RecipeError(str(reference), error.faults) from None
        yield place, table
        reference = _parent(table, place)


def _parent(table: Mapping[str, Any], place: Path) -> str | Path | None:
    """The recipe that a recipe extends: a file in its folder, or else a built-in one or a path."""
    parent = table.get("extends")
    if parent is None:
        return None
    if not isinstance(parent, str) or not parent:
        fault = f"extends = {parent!r} must be the name of a recipe or file; put it in quotes"
        raise RecipeError(place.stem, [fault])
    return beside(place.parent, parent)


def _refuse_without(own: Mapping[str, Any], base: Mapping[str, Any], place: Path) -> None:
    """Refuse ``without`` unless it is a list of paths and names that the extended recipe has."""
    left_out = own.get("without", [])
    if not isinstance(left_out, list):
        fault = f"without = {left_out!r} must be a list of paths and names; put it in brackets"
        raise RecipeError(place.stem, [fault])
    there = [_key_of(e, key) for name, key in _LISTS.items() for e in _entries(base.get(name, []))]
    faults = [
        f"without: {entry!r} is no path and no name of the recipe extended; remove it"
        for entry in left_out
        if entry not in there
    ]
    if faults:
        raise RecipeError(place.stem, faults)


def name_in(toml_text: str) -> str:
    """Name given in a recipe or scene; empty if its text has none.

    Examples
    --------
    >>> name_in('name = "bilge-pump"'), name_in("")
    ('bilge-pump', '')
    """
    try:
        return str(tomllib.loads(toml_text).get("name", ""))
    except (ValueError, RecursionError):  # ValueError: not TOML, or a number too long
        return ""


def beside(folder: Path, name: str) -> str | Path:
    """A file of that name in the folder, or the name itself."""
    path = folder / name
    return path if path.is_file() else name


def merged(base: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of a recipe over those of the recipe that it extends.

    Parameters
    ----------
    base, own : mapping
        Plain tables, not yet validated.

    Returns
    -------
    dict
        Name and description are those of `own`. ``fixed`` is merged key by key. Draws, severities
        (by path), confounders and held-out regions (by name) that `own` lists in ``without`` are
        left out; one that `own` gives replaces that of `base` completely and in its place; new ones
        follow in their order. Everything else in `own` replaces, correlations as one list.

    Notes
    -----
    The order determines which random number a draw receives: replacing in place leaves the numbers
    of all other draws as in `base`.

    Examples
    --------
    >>> merged({"record": [{"path": "a"}, {"path": "b"}]}, {"record": [{"path": "a", "low": 1}]})
    {'record': [{'path': 'a', 'low': 1}, {'path': 'b'}]}
    """
    result = {key: own[key] for key in ("name", "description") if key in own}
    result |= {key: value for key, value in base.items() if key not in _OWN}
    for name in [name for name in _LISTS if name in result]:
        result[name] = _remaining(_entries(result[name]), own.get("without", []), _LISTS[name])
    for key, value in own.items():
        if key in ("extends", "without"):
            continue
        if key in _LISTS:
            result[key] = _joined(_entries(result.get(key, [])), _entries(value), _LISTS[key])
        elif isinstance(value, Mapping) and isinstance(result.get(key), Mapping):
            result[key] = {**result[key], **value}
        else:
            result[key] = value
    return result


def _entries(value: Any) -> Any:
    """A list of tables; ``[severity]``, a single table, is a list of one."""
    return [value] if isinstance(value, Mapping) else value


def _remaining(entries: Any, left_out: Sequence[str], key: str) -> Any:
    if not isinstance(entries, list):
        return entries  # refused when it is validated
    return [entry for entry in entries if _key_of(entry, key) not in left_out]


def _joined(base: Any, own: Any, key: str) -> Any:
    """Entries of `base`, each replaced by that of `own` with the same key, then the new ones."""
    if not all(isinstance(entries, list) for entries in (base, own)):
        return own  # refused when it is validated
    left = list(own)
    result = []
    for entry in base:
        same = [other for other in left if _key_of(other, key) == _key_of(entry, key)]
        result += same or [entry]
        left = [other for other in left if other not in same]
    return result + left


def _key_of(entry: Any, key: str) -> Any:
    """Value of an entry's identifying key; None if it is not a table."""
    return entry.get(key) if isinstance(entry, Mapping) else None


def toml_text(table: Mapping[str, Any]) -> str:
    """A recipe's table as TOML text.

    Parameters
    ----------
    table : mapping
        Numbers, booleans, texts, lists, tables of these, lists of tables.

    Examples
    --------
    >>> print(toml_text({"records": 3, "fixed": {"a.b": "1 m"}, "machine": [{"low": 0.5}]}))
    records = 3
    <BLANKLINE>
    [fixed]
    "a.b" = "1 m"
    <BLANKLINE>
    [[machine]]
    low = 0.5
    <BLANKLINE>
    """
    blocks = {key: _entries(value) for key, value in table.items() if _is_block(value)}
    plain = {key: value for key, value in table.items() if key not in blocks}
    text = _lines(plain)
    for key, entries in blocks.items():
        header = f"[{_key(key)}]" if isinstance(table[key], Mapping) else f"[[{_key(key)}]]"
        text += "".join(f"\n{header}\n{_lines(entry)}" for entry in entries)
    return text


def _is_block(value: Any) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, list)
        and bool(value)
        and all(isinstance(entry, Mapping) for entry in value)
    )


def _lines(table: Mapping[str, Any]) -> str:
    return "".join(f"{_key(key)} = {_inline(value)}\n" for key, value in table.items())


def _key(key: str) -> str:
    return key if key.isascii() and key.isidentifier() else _quoted(key)


def _quoted(text: str) -> str:
    # JSON escapes all that TOML requires, except for one control character
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _inline(value: Any) -> str:
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(k)} = {_inline(v)}' for k, v in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    return str(value)  # a number, or a date: TOML writes them as Python does
