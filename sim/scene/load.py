"""Load scenes: frozen, validated, without physics.

A scene is a TOML file. Numbers are SI; a string carries its unit (``"0.25 mm"``, ``"300 rpm"``).
Validation happens here, once. It reports all errors together, each as a dotted path with value,
bound and cure, and suggests the nearest match of an unknown key. Kernels trust validated scenes.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..output.recording import missing_file
from ..parts.casing import with_folder
from ..parts.part import without_twin
from ..parts.wording import nearest
from .journal import JournalScene
from .pump import PumpScene
from .scene import (
    MOST_FAULTS,
    ConditionPlace,
    Scene,
    SceneError,
    WearPlace,
    machine_name,
    validate_table,
)
from .shaft import ShaftScene

SCENE_FOLDER = Path(__file__).parent / "built_in"

MINIMAL_FOLDER = Path(__file__).parent / "minimal"
"""Shortest scene of each machine, as a starting point: ``pump.toml`` and so on."""

LARGEST_TEXT = 2**18
"""Longest plausible text of a scene or recipe; built-in ones have at most 20,000 characters.

The parser takes some 50 microseconds per key, so that any text is refused or read within a second.
"""

DEEPEST = 32
"""Largest depth of nested tables and lists; built-in texts have six."""

# possessive from the start of a word: a long word must not take quadratic time
_WORD = r"""(?:(?<![\w-])[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"{_WORD}(?:[ \t]*+\.[ \t]*+{_WORD}){{{2 * DEEPEST}}}")
_LONG_NUMBER = "must have <= 64 bit; write it with a point or an exponent"


MACHINES: dict[str, type[Scene]] = {
    machine_name(kind): kind for kind in (PumpScene, JournalScene, ShaftScene)
}
"""Scene type of every machine. A new machine is one entry; its type holds all else."""


def short_name(kind: type[Scene]) -> str:
    """Common name of the machine of a scene type.

    Examples
    --------
    >>> [short_name(kind) for kind in MACHINES.values()]
    ['pump', 'journal', 'shaft']
    """
    return kind.physics.rpartition(".")[2]


def machine_type(name: str) -> type[Scene]:
    """Scene type of a machine, by its common or its full name.

    Raises
    ------
    SceneError
        There is no such machine; the message suggests the nearest name.

    Examples
    --------
    >>> machine_type("pump").__name__, machine_type("journal-bearing").__name__
    ('PumpScene', 'JournalScene')
    """
    known = {**{short_name(kind): kind for kind in MACHINES.values()}, **MACHINES}
    if name not in known:
        raise SceneError(name, [f"{name} is no known machine{nearest(name, known)}"])
    return known[name]


def minimal_text(machine: str) -> str:
    """TOML text of the shortest scene of a machine.

    Parameters
    ----------
    machine : str
        As for :func:`machine_type`.

    Raises
    ------
    SceneError
        There is no such machine.

    Examples
    --------
    >>> scene_from_table(scene_table(minimal_text("journal"))).name
    'my-journal'
    """
    path = MINIMAL_FOLDER / f"{short_name(machine_type(machine))}.toml"
    return path.read_text(encoding="utf-8")


def all_wear_places() -> dict[str, WearPlace]:
    """Wear quantities of all machines' scenes, by dotted path.

    Examples
    --------
    >>> all_wear_places()["bearings.*.sag"].column
    'sag_bearing_{}_m'
    """
    return {each.path: each for kind in MACHINES.values() for each in kind.wear_places}


def all_condition_places() -> dict[str, ConditionPlace]:
    """Every operating condition of any machine, by its manifest column.

    Examples
    --------
    >>> all_condition_places()["thrust_n"].path
    'propeller.thrust'
    """
    return {each.column: each for kind in MACHINES.values() for each in kind.condition_places}


def scene_names() -> list[str]:
    """Names of the built-in scenes, sorted.

    Returns
    -------
    list of str
        Accepted by :func:`load_scene` and ``wearstate.simulate``.

    Examples
    --------
    >>> "bilge-pump" in scene_names()
    True
    """
    return sorted(path.stem for path in SCENE_FOLDER.glob("*.toml"))


def scene_text(name_or_path: str | Path) -> str:
    """TOML text of a built-in scene or of a file.

    Raises
    ------
    SceneError
        There is no built-in scene or file of that name; the message suggests the nearest.
    """
    built_in = SCENE_FOLDER / f"{name_or_path}.toml"
    path = built_in if built_in.is_file() else Path(name_or_path)
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        fault = unread_text(name_or_path, "scene", scene_names(), error)
        raise SceneError(str(name_or_path), [fault]) from None


def unread_text(name_or_path: str | Path, what: str, names: Sequence[str], error: Exception) -> str:
    """Why a scene or recipe cannot be read; suggests the nearest built-in one.

    Examples
    --------
    >>> unread_text("bilge-pmp", "scene", ["bilge-pump"], FileNotFoundError())
    "bilge-pmp is no scene; did you mean 'bilge-pump'?"
    >>> unread_text("bilge-pump.toml", "scene", ["bilge-pump"], FileNotFoundError())
    "bilge-pump.toml: no such file; check the path, or name the built-in scene 'bilge-pump'"
    """
    path = Path(name_or_path)
    if isinstance(error, UnicodeDecodeError):
        return f"{path} is no UTF-8 text, must be a {what} (.toml), not a data set or model"
    if path.is_dir():
        return f"{path} is a folder, must be a {what} (.toml); name a file in it"
    if isinstance(error, PermissionError):
        return f"{path} cannot be read ({error.strerror}); check rights"
    if path.suffix or len(path.parts) > 1:
        stem = path.stem if path.stem in names else ""
        near = f", or name the built-in {what} '{stem}'" if stem else ""
        return missing_file(path, f"check the path{near}")
    return f"{name_or_path} is no {what}{nearest(str(name_or_path), names)}"


def scene_folder(name_or_path: str | Path) -> Path:
    """Folder searched first for the files that a scene names.

    Examples
    --------
    >>> scene_folder("bilge-pump").name
    'built_in'
    """
    built_in = (SCENE_FOLDER / f"{name_or_path}.toml").is_file()
    return SCENE_FOLDER if built_in else Path(name_or_path).parent


def scene_table(text: str, name: str = "scene") -> dict[str, Any]:
    """Parse TOML text into a plain table.

    Raises
    ------
    SceneError
        The text is not TOML; the message gives line and column.
    """
    if len(text) > LARGEST_TEXT:
        fault = f"{len(text)} characters must be <= {LARGEST_TEXT}; keep tables in separate files"
        raise SceneError(name, [fault])
    try:
        if _LONG_KEY.search(text):  # the parser takes quadratic time in its length
            raise RecursionError
        table, faults = _parsed(text)
    except RecursionError:
        raise SceneError(name, ["not TOML: lists or tables nested too deep; flatten it"]) from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(name, [f"not TOML: {error}; correct that line"]) from None
    except ValueError:  # a whole number that Python does not convert
        raise SceneError(name, [f"a whole number {_LONG_NUMBER}"]) from None
    if faults:
        raise SceneError(name, [*faults])
    copied: dict[str, Any] = _copy(table)
    return copied


@lru_cache(maxsize=32)
def _parsed(text: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Parse a text and find its faults; cached, as several recipes may read one scene."""
    table = tomllib.loads(text)
    return table, tuple(_unlike_toml(table))


def _unlike_toml(table: Mapping[str, Any]) -> list[str]:
    """Find whole numbers too long for TOML; raises RecursionError if nested too deep."""
    faults: list[str] = []
    queue: list[tuple[tuple[str, ...], Any]] = [((), table)]
    while queue:
        path, node = queue.pop()
        if len(path) > DEEPEST:
            raise RecursionError
        if isinstance(node, int) and node.bit_length() > 64:
            faults.append(f"{'.'.join(path)}: a whole number {_LONG_NUMBER}")
        if isinstance(node, Mapping):
            queue += [((*path, key), value) for key, value in node.items()]
        elif isinstance(node, list):
            queue += [((*path, str(i)), value) for i, value in enumerate(node)]
    return faults[:MOST_FAULTS]


def scene_from_table(table: Mapping[str, Any]) -> Scene:
    """Validate a plain table (numbers SI, or strings with units) into a scene.

    Parameters
    ----------
    table : mapping
        Nested tables, as parsed from TOML.

    Returns
    -------
    Scene
        Frozen scene of the type named by ``machine``.

    Raises
    ------
    SceneError
        All faults together, each as dotted path, value, bound and cure.
    """
    name = str(table.get("name", "scene"))
    machine = table.get("machine")
    if machine is None or isinstance(machine, list):  # a recipe has a list
        raise SceneError(name, [f"machine is missing{_unlike_scene(table)}"])
    if not isinstance(machine, str) or machine not in MACHINES:
        hint = nearest(str(machine), MACHINES)
        raise SceneError(name, [f"machine = {machine!r} is no known machine{hint}"])
    return validate_table(MACHINES[machine], table, name)


def _unlike_scene(table: Mapping[str, Any]) -> str:
    """End of a message about a table without a machine."""
    if {"severity", "extends", "scene", "machine"} & {*table}:
        return ", as this is a recipe, not a scene; wearstate generate takes it, or name its scene"
    return f", must be one of {', '.join(MACHINES)}; add it"


def load_scene(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> Scene:
    """Load a built-in scene or a TOML file, optionally with values replaced by dotted path.

    Parameters
    ----------
    name_or_path : str or Path
        A name of :func:`scene_names`, or a file.
    overrides : mapping, optional
        Dotted path -> number or string with unit, e.g. ``{"drive.speed": "250 rpm"}``. Setting
        one of the two clearances of a joint, or one of the two speeds of a motor, removes the
        other.

    Returns
    -------
    Scene
        The validated scene.

    Raises
    ------
    SceneError
        All faults together.

    Examples
    --------
    >>> load_scene("bilge-pump", {"drive.speed": "240 rpm"}).drive.speed
    4.0
    """
    table = scene_table(scene_text(name_or_path), str(name_or_path))
    return scene_from_table(
        with_folder(override(table, overrides or {}), scene_folder(name_or_path))
    )


def override(table: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Copy a table with values replaced by dotted path (list entries by number or name).

    Raises
    ------
    SceneError
        A path leads through something that is not a table, past the end of a list, or to a name
        that is not in the list.

    Examples
    --------
    >>> override({"rod": {"mass": 1.0}}, {"rod.mass": 2.0})
    {'rod': {'mass': 2.0}}
    >>> override({"bearings": [{"name": "aft"}]}, {"bearings.aft.sag": "1 mm"})
    {'bearings': [{'name': 'aft', 'sag': '1 mm'}]}
    """
    result: dict[str, Any] = _copy(table)
    faults = []
    for path, value in values.items():
        try:
            _replace(result, path.split("."), value)
        except _NoEntryError as error:
            faults.append(f"{path} does not lead to a value: {error}")
        except (KeyError, TypeError, ValueError):
            faults.append(f"{path} does not lead to a value; see the scene's own tables")
    if faults:
        raise SceneError(str(table.get("name", "scene")), faults)
    return result


def numbered(table: Mapping[str, Any], path: str) -> str:
    """Dotted path with list entries by number instead of name.

    Entries that the table does not have stay unchanged.

    Examples
    --------
    >>> numbered({"bearings": [{"name": "aft"}, {"name": "forward"}]}, "bearings.forward.sag")
    'bearings.1.sag'
    """
    node: Any = table
    keys = path.split(".")
    for place, key in enumerate(keys):
        try:
            if isinstance(node, list):
                keys[place] = str(_index(node, key))
                node = node[int(keys[place])]
            else:
                node = node[key]
        except (LookupError, TypeError):
            break
    return ".".join(keys)


_PLAIN = frozenset({str, float, int, bool})


def _copy(node: Any) -> Any:
    if type(node) in _PLAIN:  # most of a table; checking against the abstract class is slow
        return node
    if isinstance(node, Mapping):
        return {key: _copy(value) for key, value in node.items()}
    return [_copy(value) for value in node] if isinstance(node, (list, tuple)) else node


def _replace(node: Any, keys: list[str], value: Any) -> None:
    for key in keys[:-1]:
        node = node[_index(node, key)] if isinstance(node, list) else node.setdefault(key, {})
    if isinstance(node, list):
        node[_index(node, keys[-1])] = _copy(value)
        return
    if not isinstance(node, dict):
        raise TypeError(keys)
    without_twin(node, keys[-1])
    node[keys[-1]] = _copy(value)


class _NoEntryError(LookupError):
    """A list has no such entry; the message lists the existing ones."""


def _index(entries: list[Any], key: str) -> int:
    """Index in a list: counted from 0 in plain digits, or that of the entry's name."""
    if re.fullmatch("[0-9]{1,9}", key) and int(key) < len(entries):
        return int(key)
    names = [entry.get("name") if isinstance(entry, Mapping) else None for entry in entries]
    if key in names:
        return names.index(key)
    numbers = f"numbers 0 to {len(entries) - 1}" if entries else "no entry"
    known = ", ".join(str(name) for name in names if name is not None)
    named = f" and names {known}" if known else ""
    raise _NoEntryError(f"no entry {key!r}, the list has {numbers}{named}")
