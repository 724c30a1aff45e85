"""Write values into the TOML text of a scene: as a block to paste, or into a file."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...datasets.draws.draws import value_at
from ...datasets.recipe.text import toml_text
from ...sim.atomic import write_whole
from ...sim.parts.casing import with_folder
from ...sim.scene.load import scene_from_table, scene_table, scene_text
from ...sim.scene.rungs import with_values
from ...sim.scene.scene import Scene, SceneError
from .words import short_time

_HEADER = re.compile(r"\s*(\[{1,2})\s*([^\[\]#]+?)\s*\]{1,2}\s*(#.*)?$")
_VALUE = r"(\"[^\"]*\"|'[^']*'|[^#]*?)"  # on one line


def written_value(scene: Scene, path: str) -> Any:
    """Value of a scene at a dotted path; None if it is left to the program."""
    try:
        return value_at(scene, path)
    except (AttributeError, KeyError, IndexError, ValueError):
        return None


def block_of(
    changes: Mapping[str, Any],
    before: Mapping[str, Any] | None = None,
    defaults: Mapping[str, Any] | None = None,
) -> str:
    """Values by dotted path as TOML tables.

    Parameters
    ----------
    changes : mapping of str to object
        Dotted path -> number or text; entries of lists by their number.
    before : mapping of str to object, optional
        The same paths -> present value, for a comment after each line.
    defaults : mapping of str to object, optional
        Path -> value that the program uses if none is given.

    Returns
    -------
    str
        Values in lists of tables are written as comments, because tables cannot be added there.

    Examples
    --------
    >>> print(block_of({"pressure.rung": "chamber", "numerics.step": 1e-5}))
    [pressure]
    rung = "chamber"
    <BLANKLINE>
    [numerics]
    step = 1e-05
    >>> print(block_of({"film.n_theta": 96}, {"film.n_theta": 48}))
    [film]
    n_theta = 96  # was 48
    >>> path = "numerics.step"
    >>> print(block_of({path: 1.3e-5}, {path: None}, {path: 9.8e-6}))
    [numerics]
    step = 1.3e-05  # 13 µs; was not set: 9.8 µs by default
    """
    tables: dict[str, dict[str, Any]] = {}
    for path, value in changes.items():
        table, _, key = path.rpartition(".")
        tables.setdefault(table, {})[key] = value
    blocks = [
        _lines(values, table, before, defaults or {})
        if not table
        else f"[{table}]\n{_lines(values, table, before, defaults or {})}"
        for table, values in sorted(tables.items(), key=lambda row: bool(row[0]))
        if not re.search(r"\.\d+(\.|$)", table)
    ]
    listed = [
        f"# {path}: {line}"
        for path, value in changes.items()
        if re.search(r"\.\d+\.", path)
        for line in [toml_text({path.rpartition(".")[2]: value}).strip()]
    ]
    return "\n".join([*blocks, *listed]).rstrip()


def _lines(
    values: Mapping[str, Any],
    table: str,
    before: Mapping[str, Any] | None,
    defaults: Mapping[str, Any],
) -> str:
    """Lines of a table, each with the value it replaces."""
    rows = []
    for key, value in values.items():
        line = toml_text({key: value}).strip()
        if before is not None:
            path = f"{table}.{key}".lstrip(".")
            line += f"  # {_was(path, value, before.get(path), defaults.get(path))}"
        rows.append(f"{line}\n")
    return "".join(rows)


_STEP = "numerics.step"  # [s], in the range of microseconds


def _was(path: str, value: Any, old: Any, default: Any) -> str:
    """Comment on the value that is replaced, or on the default if none was set."""
    words = short_time if path == _STEP else _plain
    if default is not None and old is None and words(default) == words(value):
        return f"{words(value)}: the default, written out because the default depends on the rungs"
    said = f"{words(value)}; " if path == _STEP else ""
    if old is not None:
        return f"{said}was {words(old)}"
    if default is None:
        return f"{said}was not set"
    return f"{said}was not set: {words(default)} by default"


def _plain(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def options_of(changes: Mapping[str, Any]) -> str:
    """Changes as options of the command line.

    Examples
    --------
    >>> options_of({"pressure.rung": "chamber", "numerics.step": 1e-5})
    '--set pressure.rung=chamber --set numerics.step=1e-05'
    """
    return " ".join(f"--set {path}={value}" for path, value in changes.items())


def with_changes(text: str, changes: Mapping[str, Any]) -> str:
    r"""Text of a scene with values replaced or added; everything else, including comments, stays.

    Parameters
    ----------
    text : str
        TOML.
    changes : mapping of str to object
        Dotted path -> number or text.

    Returns
    -------
    str

    Examples
    --------
    >>> print(with_changes("[a]\nrung = 'x'  # why", {"a.rung": "y", "b.step": 2.0}))
    [a]
    rung = "y"  # was 'x'
    <BLANKLINE>
    [b]
    step = 2.0
    """
    lines = text.rstrip("\n").split("\n")
    for path, value in changes.items():
        _put(lines, path.split("."), value)
    return "\n".join(lines) + ("\n" if text.endswith("\n") else "")


def _put(lines: list[str], path: Sequence[str], value: Any) -> None:
    """Replace an existing value, else add it to its table, else add the table."""
    places = _sections(lines)
    for split in range(len(path) - 1, -1, -1):
        for first, last in places.get(tuple(path[:split]), []):
            key = r"\s*\.\s*".join(map(re.escape, path[split:]))
            for i in range(first, last):
                found = re.match(rf"(\s*{key}\s*=\s*){_VALUE}\s*(#.*)?$", lines[i])
                if found:
                    new = toml_text({"x": value}).partition("= ")[2].strip()
                    lines[i] = f"{found[1]}{new}  # was {found[2].strip()}"
                    return
    line = toml_text({path[-1]: value}).strip()
    own = places.get(tuple(path[:-1]))
    if own is not None:
        lines.insert(own[0][0], line)
    else:
        lines += ["", f"[{'.'.join(path[:-1])}]", line]


def _sections(lines: Sequence[str]) -> dict[tuple[str, ...], list[tuple[int, int]]]:
    """Line ranges of every table by path: from below its header to the next header."""
    found: dict[tuple[str, ...], list[tuple[int, int]]] = {}
    counts: dict[tuple[str, ...], int] = {}
    begin, path = 0, ()  # type: int, tuple[str, ...]
    for i, line in enumerate(lines):
        header = _HEADER.match(line)
        if header is None or "=" in line.partition("#")[0]:
            continue
        found.setdefault(path, []).append((begin, i))
        begin, path = i + 1, _numbered(header, counts)
    found.setdefault(path, []).append((begin, len(lines)))
    return found


def _numbered(header: re.Match[str], counts: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Path of a header, with the indices of entries in lists of tables."""
    path: tuple[str, ...] = ()
    keys = [key.strip().strip("\"'") for key in header[2].split(".")]
    for depth, key in enumerate(keys, start=1):
        path = (*path, key)
        if header[1] == "[[" and depth == len(keys):
            counts[path] = counts.get(path, -1) + 1
        if path in counts:
            path = (*path, str(counts[path]))
    return path


def apply_changes(
    source: str,
    scene: Scene,
    given: Mapping[str, Any],
    changes: Mapping[str, Any],
    path: Path,
    *,
    note: str = "",
    force: bool = True,
) -> None:
    """Write the text of a scene with values replaced, atomically.

    Parameters
    ----------
    source : str
        Built-in name, or file.
    scene : Scene
        Scene as loaded from it, including `given`.
    given : mapping of str to object
        Values given in addition to the file.
    changes : mapping of str to object
        Values to write; they fix the rungs (fidelity = "given").
    path : Path
        TOML file.
    note : str
        Comment at the top of the file.
    force : bool
        Replace an existing file.

    Raises
    ------
    SceneError
        The text cannot be changed line by line.
    """
    wanted = {**changes, **({"fidelity": "given"} if scene.fidelity != "given" else {})}
    text = with_changes(scene_text(source), {**given, **wanted})
    if note:
        text = f"# {note}\n{text}"
    target = with_values(scene, wanted)
    try:
        found = scene_from_table(with_folder(scene_table(text, str(path)), path.parent))
        same = all(_same(found, target, each) for each in (*given, *wanted))
    except SceneError as error:
        raise SceneError(
            str(path), [f"{fault}; write it by hand" for fault in error.faults]
        ) from None
    if not same:
        fault = f"the text of {source} cannot be changed line by line; write it by hand: "
        raise SceneError(str(path), [fault + options_of(wanted)])
    write_whole(path, text.encode(), force=force)


def _same(one: Scene, other: Scene, path: str) -> bool:
    return bool(value_at(one, path) == value_at(other, path))
