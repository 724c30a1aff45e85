"""Keys of scenes and recipes: as text, as a table, as a page of all keys.

``python -m wearstate.diagnose.inspect.keys_text`` prints ``docs/keys.md``.
"""

import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from typing import Any

from ...sim.scene.load import MACHINES, short_name
from ...sim.scene.rungs import Rung
from ..pages.si_text import si_text
from .keys import DIFFERING, NAMED_TABLES, TABLES, FoundKeys, Key, found_recipe_keys, keys_found

_WIDTH = 100  # characters of a line
_NO_BREAK = "\N{NO-BREAK SPACE}"


def subjects_text() -> str:
    """The machines, and how to show their keys."""
    names = {
        short_name(kind): (kind.__doc__ or "").partition("\n")[0] for kind in MACHINES.values()
    }
    lines = [f"{name:8} {words}" for name, words in names.items()]
    return "\n".join(
        [
            *lines,
            "",
            "wearstate scene explain pump                  every key of a pump's scene",
            "wearstate scene explain pump pressure         the keys of one table",
            "wearstate scene explain pump pressure.rung    one key with its rungs",
            "wearstate scene explain bilge-pump            with the values of that scene",
        ]
    )


def explained(found: FoundKeys) -> str:
    """Keys as text: one with all its details, several as one line each.

    Parameters
    ----------
    found : FoundKeys

    Returns
    -------
    str
    """
    if found.single:
        return "\n\n".join(_whole(key, found) for key in found.keys)
    head = f"{found.subject}: {found.words}"
    lines = [head, *_listed(found)]
    if any(key.rungs for key in found.keys):
        lines += ["", "A rung is a model of one effect; name its key to see what each assumes."]
    return "\n".join(lines)


def _listed(found: FoundKeys) -> Iterator[str]:
    rows = _once(found.keys)
    width = max((len(row.name) for row, _ in rows if not row.table), default=0)
    for row, twin in rows:
        if row.table:
            need = f" ({row.default})" if row.default else ""
            same = f" Keys as in {_header(twin)}." if twin else ""
            yield ""
            yield from _wrapped(f"{_header(row)}{need} {row.words}{same}", 0)
            continue
        text = f"{row.words} [{_spec(row, found.values)}]"
        yield from _wrapped(f"  {row.name:{width}}  {text}", width + 4)


def _wrapped(text: str, indent: int) -> list[str]:
    """Lines of a text; a number stays with its unit (`_NO_BREAK`)."""
    lines = textwrap.wrap(text, _WIDTH, subsequent_indent=" " * indent, break_on_hyphens=False)
    return [line.replace(_NO_BREAK, " ") for line in lines]


def _once(keys: Iterable[Key]) -> list[tuple[Key, Key | None]]:
    """Keys, with a table whose keys equal those of an earlier one given without them."""
    rows = list(keys)
    own = {row.path: row for row in rows}
    first_with: dict[str, Key] = {}  # a rung cannot be hashed
    result: list[tuple[Key, Key | None]] = []
    skipped = "\0"
    for row in rows:
        if row.path.startswith(skipped):
            continue
        inside = [
            replace(each, path=each.path.removeprefix(row.path))
            for each in rows
            if row.table and each.path.startswith(f"{row.path}.")
        ]
        twin = first_with.setdefault(repr(inside), row) if inside else row
        if row.default == DIFFERING:
            twin = own.get(row.name, row)
        result.append((row, None if twin is row else twin))
        if twin is not row:
            skipped = f"{row.path}."
    return result


def _header(key: Key) -> str:
    """Header as in TOML; for a table of a list entry only the names."""
    inside = key.path.removesuffix(".*")
    name = inside.replace(".*", "")
    if key.kind == TABLES:
        return f"[[{name}]]"
    return f"[{name}.NAME]" if key.kind == NAMED_TABLES else f"[{name}]"


def _spec(key: Key, values: Mapping[str, str]) -> str:
    """Kind, unit, range, choices and default."""
    kind = key.unit if key.kind == "number" and key.unit else key.kind
    if key.kind != "number" and key.unit:
        kind += f" in {key.unit}"
    if key.choices:
        kind = " | ".join(key.choices)
    default = key.default if key.default == "required" else f"default {key.default}"
    here = [f"here {values[key.path]}"] if key.path in values else []
    numbers = [key.bounds, default, *here]
    return "; ".join(filter(None, [kind, *(text.replace(" ", _NO_BREAK) for text in numbers)]))


def _whole(key: Key, found: FoundKeys) -> str:
    """All details of one key."""
    here = found.values.get(key.path, "not given")
    rows = [
        ("", key.words),
        ("written as", key.kind + (f", bare in {key.unit}" if key.unit else "")),
        ("units", ", ".join(key.units)),
        ("one of", "" if key.rungs else ", ".join(key.choices)),
        ("range", key.bounds),
        ("default", key.default),
        ("here", f"{here}, in {found.scene}" if found.scene else ""),
    ]
    lines = [f"{key.path}  ({found.subject})"]
    for name, text in rows:
        if text:
            lines += _wrapped(f"  {name:11} {text}" if name else f"  {text}", 14 if name else 2)
    if key.rungs:
        lines.append(f"  rungs, cheapest first ({_COST}):")
        for rung in key.rungs:
            lines += _rung_lines(rung)
    return "\n".join(lines)


_COST = "cost: tabulated time of a step of one throw or of one solve of a film, to rank them"


def _rung_rows(rung: Rung) -> list[tuple[str, str]]:
    """Details of a rung."""
    cost = si_text(1e-9 * rung.nanoseconds_per_step, "s") if rung.nanoseconds_per_step else "none"
    rows = [
        ("assumes", rung.assumes),
        ("valid", rung.valid),
        ("needs", rung.needs),
        ("cost", cost),
        ("reference", rung.reference),
    ]
    return [(name, text) for name, text in rows if text]


def _rung_lines(rung: Rung) -> Iterator[str]:
    yield f"    {rung.name}"
    for name, text in _rung_rows(rung):
        yield from _wrapped(f"      {name:10} {text}", 17)


def keys_table(found: Iterable[FoundKeys]) -> dict[str, Any]:
    """Keys as plain values, for JSON."""
    return {
        "subjects": [
            {
                "subject": each.subject,
                "scene": each.scene,
                "keys": [{**asdict(key), "value": each.values.get(key.path)} for key in each.keys],
            }
            for each in found
        ]
    }


def keys_page() -> str:
    """``docs/keys.md``: all keys of all machines and of a recipe."""
    parts = [_PAGE_HEAD]
    for kind in MACHINES.values():
        parts.append(_section(keys_found(kind, "")))
    parts.append(_section(found_recipe_keys()))
    return "\n\n".join(parts) + "\n"


_PAGE_HEAD = """# Keys of scenes and recipes

Written by `python -m wearstate.diagnose.inspect.keys_text`. The same on the command line:
`wearstate scene explain pump`, `wearstate scene explain pump.pressure.rung`,
`wearstate recipe explain`.

A bare number is SI; a text carries its unit, such as `"0.25 mm"`. On the command line a key is its
dotted path, with entries of lists by number (from 0) or by name:
`wearstate simulate shaft-rig --set bearings.aft.sag="1 mm"`. Rungs are ordered by cost,
cheapest first; the cost is the tabulated time of a step of one throw or of one film solve."""


def _section(found: FoundKeys) -> str:
    lines = [f"## {found.subject}", "", found.words, *_page_rows(found)]
    return "\n".join(lines)


def _page_rows(found: FoundKeys) -> Iterator[str]:
    open_table = False
    for row, twin in _once(found.keys):
        if row.table:
            need = f" ({row.default})" if row.default else ""
            yield from ("", f"### `{_header(row)}`{need}", "", row.words)
            yield from ("", f"Keys as in `{_header(twin)}`.") if twin else ()
            open_table = False
            continue
        if not open_table:
            yield from ("", "| key | meaning | value |", "|---|---|---|")
            open_table = True
        spec = _spec(row, {}).replace(_NO_BREAK, " ")
        yield f"| `{row.name}` | {_cell(row.words)} | {_cell(spec)} |"
    for row, twin in _once(found.keys):
        if row.rungs and twin is None:
            yield from ("", f"### Rungs of `{row.path}`", "", *_RUNG_HEAD)
            yield from map(_rung_row, row.rungs)


def _rung_row(rung: Rung) -> str:
    texts = dict(_rung_rows(rung))
    names = ("assumes", "valid", "needs", "cost", "reference")
    return f"| {rung.name} | " + " | ".join(_cell(texts.get(name, "")) for name in names) + " |"


_RUNG_HEAD = ("| rung | assumes | valid | needs | cost | reference |", "|---|---|---|---|---|---|")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    print(keys_page(), end="")
