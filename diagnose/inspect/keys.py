"""All keys of a scene or a recipe: meaning, unit, range, default, rungs; and their search."""

import difflib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ...datasets.recipe.table import RecipeTable
from ...sim.parts.dimensions import Dimension
from ...sim.parts.wording import metadata_of, model_inside
from ...sim.scene.load import MACHINES, load_scene, scene_names, short_name
from ...sim.scene.rungs import Rung
from ...sim.scene.scene import Scene, SceneError
from ..pages.si_text import plain, si_text

_TABLE, TABLES, NAMED_TABLES = "table", "list of tables", "table of named tables"
_TABLE_KINDS = (_TABLE, TABLES, NAMED_TABLES)


@dataclass(frozen=True, kw_only=True)
class Key:
    """One key of a TOML file, or one of its tables.

    Attributes
    ----------
    path : str
        Dotted path; ``*`` stands for the number or name of a list entry, or for a free name.
    words : str
        Meaning.
    kind : str
        Type of the value: number, whole number, text, true or false, a list, a table.
    unit : str
        SI unit of a bare number; empty if it has none.
    units : tuple of str
        Units that a text may carry.
    bounds : str
        Bounds, as ``> 0, <= 100 m``; empty without any.
    default : str
        Default; ``required`` if it must be given.
    choices : tuple of str
        Words to choose from.
    rungs : tuple of Rung
        Models to choose from, cheapest first.
    """

    path: str
    words: str
    kind: str
    unit: str = ""
    units: tuple[str, ...] = ()
    bounds: str = ""
    default: str = ""
    choices: tuple[str, ...] = ()
    rungs: tuple[Rung, ...] = ()

    @property
    def name(self) -> str:
        """Last name of the path."""
        return self.path.removesuffix(".*").rpartition(".")[2]

    @property
    def table(self) -> bool:
        """Whether it is a table."""
        return self.kind in _TABLE_KINDS


def keys_of(model: type[BaseModel]) -> list[Key]:
    """All keys of a scene or recipe, each table before its keys.

    Parameters
    ----------
    model : type
        A scene type, or any other pydantic model.

    Returns
    -------
    list of Key

    Examples
    --------
    >>> from wearstate.sim.parts.sensors import Tacho
    >>> width = keys_of(Tacho)[1]
    >>> width.path, width.unit, width.bounds, width.default
    ('pulse_width', 'rad', '> 0, <= 180 deg', '10 deg')
    """
    ladders: Mapping[str, tuple[Rung, ...]] = {}
    if issubclass(model, Scene):
        ladders = import_module(model.physics).MACHINE.ladders
    return list(_rows(model, "", None, tuple(ladders.values())))


DIFFERING = "what differs"
"""Default of a table that is merged over the scene's table of that name."""

_Ladders = tuple[tuple[Rung, ...], ...]


def _rows(model: type[BaseModel], prefix: str, given: Any, ladders: _Ladders) -> Iterator[Key]:
    fields = {name: field for name, field in model.model_fields.items() if not field.exclude}
    tables = {name: model_inside(field.annotation) for name, field in fields.items()}
    for name, field in fields.items():
        if tables[name] is None:
            yield _leaf(f"{prefix}{name}", field, _value(field, name, given), ladders)
    for name, field in fields.items():
        inner = tables[name]
        if inner is None:
            continue
        value = _value(field, name, given)
        kind = _table_kind(field.annotation)
        path = f"{prefix}{name}" + ("" if kind == _TABLE else ".*")
        default = "required" if field.is_required() else "" if value else "optional"
        rows = _rows(inner, f"{path}.", value if isinstance(value, inner) else None, ladders)
        if _is_partial(field):
            default = DIFFERING
            rows = (replace(row, default=f"as in [{name}]") for row in rows)
        yield Key(path=path, words=_table_words(field, inner), kind=kind, default=default)
        yield from rows


def _is_partial(field: FieldInfo) -> bool:
    extra = field.json_schema_extra
    return isinstance(extra, dict) and bool(extra.get("partial"))


def _value(field: FieldInfo, name: str, given: Any) -> Any:
    """Default of a field: that of its table if the table has one, or else its own."""
    if given is not None:
        return getattr(given, name)
    return None if field.is_required() else field.get_default(call_default_factory=True)


def _table_kind(annotation: Any) -> str:
    arguments = (annotation, *get_args(annotation))
    origins = {get_origin(each) for each in arguments}
    return TABLES if tuple in origins else NAMED_TABLES if dict in origins else _TABLE


def _table_words(field: FieldInfo, inner: type[BaseModel]) -> str:
    about = " ".join((inner.__doc__ or "").partition("\n\n")[0].split()).replace("``", "`")
    return f"{field.description}. {about}" if field.description else about


def _leaf(path: str, field: FieldInfo, value: Any, ladders: _Ladders) -> Key:
    marks = list(_flat(metadata_of(field)))
    dimension = next((mark for mark in marks if isinstance(mark, Dimension)), None)
    unit = dimension.unit if dimension else ""
    choices = tuple(_choices(field.annotation))
    default = "required" if field.is_required() else _shown(value, unit)
    return Key(
        path=path,
        words=field.description or "",
        kind=_kind(field.annotation),
        unit=unit,
        units=tuple(each for each in dimension.units if each) if dimension else (),
        bounds=_bounds(marks, unit),
        default=default,
        choices=choices,
        rungs=_rungs(choices, ladders),
    )


def _flat(marks: Iterable[Any]) -> Iterator[Any]:
    """Metadata, including those of fields inside an annotation."""
    for mark in marks:
        if isinstance(mark, FieldInfo):
            yield from _flat(mark.metadata)
        else:
            yield mark


def _bounds(marks: Iterable[Any], unit: str) -> str:
    signs = (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<="))
    limits = [(s, getattr(m, n)) for n, s in signs for m in marks if hasattr(m, n)]
    return ", ".join(f"{sign} {_number(value, unit, 4) if value else 0}" for sign, value in limits)


def _number(value: float, unit: str, digits: int) -> str:
    if unit == "s" and abs(value) >= 1:  # kiloseconds are not in use
        return f"{plain(value, digits)} s"
    return si_text(value, unit, digits)


def _choices(annotation: Any) -> Iterator[str]:
    if get_origin(annotation) is Literal:
        yield from map(str, get_args(annotation))
    else:
        for inner in get_args(annotation):
            yield from _choices(inner)


def _rungs(choices: tuple[str, ...], ladders: _Ladders) -> tuple[Rung, ...]:
    """Rows of the ladder whose rungs include all the choices, if there is one."""
    for ladder in ladders:
        if choices and {*choices} <= {rung.name for rung in ladder}:
            return tuple(rung for rung in ladder if rung.name in choices)
    return ()


_KINDS = {bool: "true or false", int: "whole number", float: "number", str: "text"}


def _kind(annotation: Any) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation in _KINDS:
        return _KINDS[annotation]
    if origin is Literal:
        return "word"
    if origin is tuple:
        many = "list" if ... in arguments else f"list of {len(arguments)}:"
        return f"{many} {_kind(arguments[0])}".replace("list ", "list of ", ... in arguments)
    if origin is dict:
        return f"table of names: {_kind(arguments[1])}"
    if hasattr(annotation, "__metadata__"):
        return _kind(arguments[0])
    kinds = [_kind(each) for each in arguments if each is not type(None)]
    return " or ".join(dict.fromkeys(kinds))


def _shown(value: Any, unit: str) -> str:
    """A value as written in a file."""
    if value is None or value == () or value == {}:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return _number(value, unit, 6)
    if isinstance(value, (tuple, list)):
        return ", ".join(_shown(each, unit) for each in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_shown(each, unit)}" for name, each in value.items())
    return str(value) or "empty"


@dataclass(frozen=True, kw_only=True)
class FoundKeys:
    """Result of a search for keys.

    Attributes
    ----------
    subject : str
        Machine, or ``recipe``.
    words : str
        Description in one sentence.
    keys : tuple of Key
    values : mapping of str to str
        Value in the given scene by path.
    scene : str
        Name of the scene; empty if only the machine was given.
    single : bool
        Whether one key was requested, so that all its details are shown.
    """

    subject: str
    words: str
    keys: tuple[Key, ...]
    values: Mapping[str, str]
    scene: str = ""
    single: bool = False


def found_keys(subject: str = "", key: str = "") -> list[FoundKeys]:
    """Keys of a machine or scene, or one of them.

    Parameters
    ----------
    subject : str
        Machine (``pump`` or its full name), built-in scene or file; or, if `key` is empty, a key,
        with or without a machine before it.
    key : str
        Dotted path, its end, or a table; list entries by number, name, ``*`` or left out.

    Returns
    -------
    list of FoundKeys
        One for each machine that has the key.

    Raises
    ------
    SceneError
        If nothing has that name; the nearest names are given.

    Examples
    --------
    >>> [found.keys[0].path for found in found_keys("pump", "crank.radius")]
    ['crank.radius']
    >>> [found.subject for found in found_keys("film.rung")]
    ['journal', 'shaft']
    """
    kinds = {short_name(kind): kind for kind in MACHINES.values()} | MACHINES
    first, _, rest = subject.partition(".")
    if first in kinds and subject not in scene_names():
        return [keys_found(kinds[first], ".".join(filter(None, (rest, key))))]
    if key or subject in scene_names() or Path(subject).exists():
        return [_of_scene(load_scene(subject), subject, key)]
    every = {short_name(kind): keys_of(kind) for kind in MACHINES.values()}
    hits = [name for name, keys in every.items() if matching(keys, subject)]
    if not hits:
        names = [*every, *scene_names(), *(key.path for keys in every.values() for key in keys)]
        raise SceneError(subject, [f"{subject} is no machine, scene or key{_near(subject, names)}"])
    return [keys_found(kinds[name], subject) for name in hits]


def found_recipe_keys(key: str = "") -> FoundKeys:
    """Keys of a recipe, or one of them; see :func:`found_keys`."""
    rows = [*_EXTENDING, *keys_of(RecipeTable)]
    return _result("recipe", "What data sets are drawn from.", rows, key, {})


_EXTENDING = (
    Key(path="extends", kind="text", default="none", words="recipe that this one takes over"),
    Key(
        path="without",
        kind="list of text",
        default="none",
        words="paths and names of draws of the extended recipe that are left out",
    ),
)
"""Keys of a recipe file that disappear when it is read."""


def _of_scene(scene: Scene, name: str, key: str) -> FoundKeys:
    return replace(keys_found(type(scene), key, scene), scene=name)


def keys_found(kind: type[Scene], key: str, scene: Scene | None = None) -> FoundKeys:
    """Matching keys of a machine, with the values of a scene if there is one."""
    rows = keys_of(kind)
    values = {} if scene is None else {row.path: _written(scene, row) for row in rows}
    about = (kind.__doc__ or "").partition("\n")[0]
    return _result(short_name(kind), about, rows, key, {k: v for k, v in values.items() if v})


def _result(
    subject: str, words: str, rows: list[Key], key: str, values: Mapping[str, str]
) -> FoundKeys:
    matched = matching(rows, key) if key else rows
    if not matched:
        near = _near(key, [row.path for row in rows])
        raise SceneError(subject, [f"{key} is no key of a {subject}{near}"])
    single = bool(key) and not any(row.table for row in matched)
    return FoundKeys(
        subject=subject, words=words, keys=tuple(matched), values=values, single=single
    )


def matching(keys: list[Key], wanted: str) -> list[Key]:
    """Keys at a path, in a table, or whose paths end with the text; empty if there are none.

    Examples
    --------
    >>> from wearstate.sim.scene.shaft import ShaftScene
    >>> [key.path for key in matching(keys_of(ShaftScene), "bearings.aft.sag")]
    ['bearings.*.sag']
    """
    words = wanted.split(".")
    bare = [word for word in words if word != "*" and not word.isdecimal()]
    paths = [(key, [word for word in key.path.split(".") if word != "*"]) for key in keys]
    ways = (
        [key for key in keys if _leads(words, key.path.split("."), named=False)],
        [key for key, path in paths if path[: len(bare)] == bare],
        [key for key in keys if _leads(words, key.path.split("."), named=True)],
        [key for key, path in paths if path[-len(bare) :] == bare],
    )
    return next(filter(None, ways), []) if bare else []


def _leads(wanted: list[str], path: list[str], *, named: bool) -> bool:
    """Whether a path begins with the given one; list entries by number, optionally by name."""
    return len(wanted) <= len(path) and all(
        word == there or (there == "*" and (named or word.isdecimal()))
        for word, there in zip(wanted, path, strict=False)
    )


def _near(word: str, names: Iterable[str]) -> str:
    known = list(dict.fromkeys(names))
    ends = {name.rpartition(".")[2]: name for name in reversed(known)}
    last = word.rpartition(".")[2]
    close = difflib.get_close_matches(word, known, n=3, cutoff=0.6)
    close += [ends[each] for each in difflib.get_close_matches(last, ends, n=3, cutoff=0.7)]
    shown = " or ".join(repr(each) for each in dict.fromkeys(close[:3]))
    return f"; did you mean {shown}?" if shown else "; see them without a KEY"


def _written(scene: Scene, key: Key) -> str:
    """Value of a scene at a key, different values for lists; empty if it has none."""
    if key.table:
        return ""
    values = _reached(scene, key.path.split("."))
    shown = dict.fromkeys(_shown(value, key.unit) for value in values if value is not None)
    return " / ".join(list(shown)[:4]) + (" / …" if len(shown) > 4 else "")


def _reached(node: Any, path: list[str]) -> list[Any]:
    if not path:
        return [node]
    if path[0] == "*":
        entries = node.values() if isinstance(node, Mapping) else node
        return [value for entry in entries for value in _reached(entry, path[1:])]
    inner = getattr(node, path[0], None)
    return [] if inner is None else _reached(inner, path[1:])
