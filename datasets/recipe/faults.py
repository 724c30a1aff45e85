"""Faults of a recipe: lives, twins, confounders, one place drawn twice."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...sim.scene.load import scene_from_table
from ...sim.scene.scene import SceneError, validate_table
from ..draws.draws import Axis, Range
from ..draws.options import Alternatives
from ..draws.twin import coordinate_names
from .life import life_faults
from .severities import severity_column, wear_limits
from .table import Confounder, RecipeTable
from .text import read_recipe

_PLACED = re.compile(
    r"(?P<place>(?:severity|machine|record|choice|confounder|fixed)\.[^\s:]+)"
    r"(?P<about> \([^)]*\))?: (?P<fault>.+)"
)

_UNLIMITED = re.compile(r"(?P<place>.+ = .+)(?P<fault> of \S+ needs wear limits, .+)")


def merged_faults(faults: Sequence[str]) -> list[str]:
    """Faults, with one shared by several draws given once, after the places of all.

    Examples
    --------
    >>> merged_faults(["machine.0 (a.b): a.c is missing", "machine.1 (a.d): a.c is missing", "b"])
    ['machine.0 (a.b), machine.1: a.c is missing', 'b']
    """
    places: dict[str, list[str]] = {}
    for text in dict.fromkeys(faults):
        if limits := _UNLIMITED.fullmatch(text):
            places.setdefault(limits["fault"], []).append(limits["place"])
            continue
        match = _PLACED.fullmatch(text)
        named = places.setdefault(match["fault"] if match else text, [])
        if match:
            named.append(match["place"] if named else match["place"] + (match["about"] or ""))
    return [
        f"{', '.join(named)}{'' if fault.startswith(' of ') else ': '}{fault}" if named else fault
        for fault, named in places.items()
    ]


def faults_of_life(
    table: RecipeTable, axes: Mapping[str, list[Axis]], base: Mapping[str, Any]
) -> list[str]:
    """Faults of a life with regard to the first severity, if that is valid itself."""
    worn = next(iter(axes.get("severity.0", ())), None)
    column = severity_column(table.severity[0].path)
    if table.life is None or not isinstance(worn, Range) or column is None:
        return []
    limits = wear_limits(scene_from_table(base), column)
    condemning = None if limits is None else limits.condemning
    low, high = worn.bands[0]
    return life_faults(table.life, worn.path, low, high, condemning)


def twin_faults(
    table: RecipeTable, machine: Sequence[Axis], choices: Sequence[Alternatives]
) -> list[str]:
    """Faults of a twin: numbers that the recipe does not draw."""
    if table.twin is None:
        return []
    lost = sorted(set(table.twin.names) - set(coordinate_names(machine, choices)))
    if not lost:
        return []
    return [
        f"twin: {', '.join(lost[:3])} ({len(lost)} in all) must be drawn by the recipe; use the "
        "one that it was calibrated with"
    ]


def machine_faults(table: RecipeTable, folder: Path) -> list[str]:
    """Refuse the machines of another recipe unless all that determines them is the same there."""
    if not table.machines_of:
        return []
    file = folder / f"{table.machines_of}.toml"
    try:
        source = read_recipe(file if file.is_file() else table.machines_of)
        other = validate_table(RecipeTable, source.table, table.machines_of)
    except SceneError as error:
        return [f"machines_of: {fault}" for fault in error.faults]
    if other.machines_of or other.name != table.machines_of:
        made = other.machines_of or other.name
        return [
            f"machines_of = '{table.machines_of}' must be the recipe that draws them; name '{made}'"
        ]
    return [
        f"machines_of = '{other.name}': {name} must be as it is there; extend that recipe and "
        "leave it"
        for name in ("scene", "sampling", "machine", "choice", "correlation")
        if getattr(other, name) != getattr(table, name)
    ]


def faults_of(table: Mapping[str, Any]) -> list[str]:
    """Faults of a scene given as a table."""
    try:
        scene_from_table(table)
    except SceneError as error:
        return error.faults
    return []


def path_clashes(paths: Sequence[str]) -> list[str]:
    """Paths that are drawn more than once, or must be the same for all records."""
    held = [path for path in paths if path in ("duration", "sample_rate")]
    return [f"{path} is drawn, must be one for all records; put it in [fixed]" for path in held] + [
        f"{path} is drawn {paths.count(path)} times, must be once; remove the others"
        for path in sorted(set(paths))
        if paths.count(path) > 1
    ]


def confounder_faults(confounders: Sequence[Confounder]) -> list[str]:
    """Repeated names, and probabilities that do not fit together."""
    names = [confounder.name for confounder in confounders]
    faults = [
        f"confounder name '{name}' is given {names.count(name)} times, must be unique; rename one"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]
    for word, members in exclusive_sets(confounders).items():
        total = sum(member.probability for member in members)
        if total > 1 + _ROUNDING:
            faults.append(
                f"probabilities of the confounders with {word} add up to {total:g}, must be <= 1; "
                "lower them"
            )
        if len({member.per for member in members}) > 1:
            faults.append(
                f"confounders with {word} are drawn per machine and per record, must be one of "
                "them; change per"
            )
    return faults


_ROUNDING = 1e-12  # thirds and tenths add up to a little more than one


def exclusive_sets(confounders: Sequence[Confounder]) -> dict[str, list[Confounder]]:
    """Groups of mutually exclusive confounders, by their word; a free one is alone by name."""
    sets: dict[str, list[Confounder]] = {}
    for confounder in confounders:
        word = f"exclusive = '{confounder.exclusive}'" if confounder.exclusive else confounder.name
        sets.setdefault(word, []).append(confounder)
    return sets
