"""Severities of a recipe and their wear limits: columns, paths, clearances."""

import re
from collections.abc import Sequence

from ...sim.scene.journal import ScarLimits
from ...sim.scene.load import all_wear_places
from ...sim.scene.scene import Scene, Wear
from ..draws.draws import Axis, Bound, Range, has_value, value_at
from ..draws.options import Alternatives
from ..draws.wear_bounds import bound_of_limits
from .recipe import Recipe, Wearing
from .table import RecipeTable, Severity


def with_wear_limits(table: RecipeTable, scene: Scene, faults: list[str]) -> RecipeTable:
    """The table with bounds of wear relative to limits converted to metres."""

    def metres(bound: Bound | None, column: str | None, place: str) -> Bound | None:
        if bound is None or column is None:
            return bound
        try:
            return bound_of_limits(bound, wear_limits(scene, column))
        except ValueError as error:
            faults.append(f"{place} = {bound!r} of {column} {error}")
            return 1.0  # a valid length, so that further faults are found

    ends = ("low", "high")
    worn = tuple(
        each.model_copy(
            update={
                end: metres(getattr(each, end), severity_column(each.path), f"severity.{i}.{end}")
                for end in ends
            }
        )
        for i, each in enumerate(table.severity)
    )
    regions = tuple(
        region.model_copy(
            update={
                "bounds": {
                    column: bounds.model_copy(
                        update={
                            end: metres(
                                getattr(bounds, end), column, f"held_out '{region.name}': {end}"
                            )
                            for end in ends
                        }
                    )
                    for column, bounds in region.bounds.items()
                }
            }
        )
        for region in table.held_out
    )
    return table.model_copy(update={"severity": worn, "held_out": regions})


def limit_faults(recipe: Recipe) -> list[str]:
    """Reasons why the records of a recipe cannot be graded.

    Parameters
    ----------
    recipe : Recipe

    Returns
    -------
    list of str
        Faults; empty if the first severity has limits.

    Examples
    --------
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> limit_faults(load_recipe("bilge-pump-small"))
    []
    """
    first = recipe.severities[0]
    if first.edges:
        return []
    table = all_wear_places()[pattern_of(first.axis.path)].limits
    cure = f"add its table [{table}]" if table else "put a severity that has limits first"
    return [
        f"severity.0: the scene {recipe.table.scene} has no wear limits of {first.column}, must "
        f"have: every grade would be -1, and no wear model could be trained; {cure}"
    ]


def severity_faults(severities: Sequence[Severity]) -> list[str]:
    """Paths that are no known severity."""
    known = ", ".join(all_wear_places())
    return [
        f"severity.{i}.path = {severity.path!r} is no known severity; choose one of {known}, "
        "with a number from 0 for each *"
        for i, severity in enumerate(severities)
        if severity_column(severity.path) is None
    ]


def severity_column(path: str) -> str | None:
    """Manifest column of a scene value that wears; None for any other.

    Examples
    --------
    >>> severity_column("throws.0.joint.crankpin.diametral_clearance")
    'diametral_clearance_crankpin_1_m'
    """
    found = all_wear_places().get(pattern_of(path))
    numbers = [int(number) + 1 for number in re.findall(_ENTRY, path)]
    return None if found is None or "*" in path else found.column.format(*numbers)


_ENTRY = r"(?<=\.)[0-9]+(?=\.)"
"""Number of a list entry inside a dotted path."""


def pattern_of(path: str) -> str:
    """A dotted path with every list index replaced by a star."""
    return re.sub(_ENTRY, "*", path)


def wearing_of(
    severities: Sequence[Severity], axes: Sequence[Axis], scene: Scene
) -> tuple[Wearing, ...]:
    """Severities with their axes, columns and grade edges."""
    result: list[Wearing] = []
    for severity, axis in zip(severities, axes, strict=True):
        column = severity_column(severity.path)
        assert column is not None  # checked before
        assert isinstance(axis, Range)
        limits = wear_limits(scene, column)
        place = column.removeprefix("diametral_clearance_").removesuffix("_m")
        further = f"grade_{place}" if limits is not None else ""
        result.append(
            Wearing(
                axis=axis,
                column=column,
                grade_column=further if result else "grade",
                edges=() if limits is None else limits.grade_edges,
            )
        )
    return tuple(result)


def clearances(scene: Scene) -> dict[str, float]:
    """All severities of a scene that have an effect, by manifest column [m].

    Ideal joints have none; those of a single throw are included only if they differ from those of
    all; for the bearings of a shaft, the first one and those with a fault.

    Parameters
    ----------
    scene : Scene
        Scene of any machine.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> clearances(load_scene("bilge-pump"))["diametral_clearance_crankpin_m"]
    8e-05
    """
    found: dict[str, float] = {}
    columns = {each.path: each.column for each in scene.wear_places}
    for pattern in columns:
        before, star, _ = pattern.partition("*")
        entries = getattr(scene, before.rstrip("."), ()) if star else ("",)
        for number in range(len(entries)):
            path = pattern.replace("*", str(number))
            joint = path.removesuffix(".diametral_clearance")
            if not has_value(scene, path) or _rung_of(scene, joint) == "ideal":
                continue
            value = getattr(value_at(scene, joint), "clearance_diametral", value_at(scene, path))
            twin = columns.get(pattern.partition("*.")[2])
            own = value != found.get(twin) if twin else number == 0 or value != 0
            if not star or own:
                found[str(severity_column(path))] = float(value)
    return found


def silent_faults(
    severities: Sequence[Severity], scene: Scene, choices: Sequence[Alternatives]
) -> list[str]:
    """Clearances drawn for a joint that is ideal, always or with some option.

    An ideal joint has no clearance: records would have a wear label without any effect.
    """
    faults = []
    for i, severity in enumerate(severities):
        joint = severity.path.removesuffix(".diametral_clearance")
        if not has_value(scene, severity.path) or joint == severity.path:
            continue
        faults += [
            f"severity.{i}.path = {severity.path!r}: {joint}.rung = 'ideal' has no clearance, "
            f"{where}; set {joint}.rung = 'compliant' there"
            for where, rung in _rungs(joint, scene, choices)
            if rung == "ideal"
        ]
    return faults


def _rungs(joint: str, scene: Scene, choices: Sequence[Alternatives]) -> list[tuple[str, str]]:
    """The cases in which a recipe determines the rung of a joint, and the rung."""
    path, own = f"{joint}.rung", _rung_of(scene, joint)
    found = [
        (f"with option {option.name!r} of choice {choice.name!r}", option.values.get(path, own))
        for choice in choices
        if path in choice.paths
        for option in choice.options
    ]
    return found or [("in the scene with what the recipe fixes", own)]


def _rung_of(scene: Scene, path: str) -> str:
    """Rung of the part at a path; empty for one without rungs, or for a plain number."""
    return str(getattr(value_at(scene, path), "rung", ""))


def wear_limits(scene: Scene, column: str) -> Wear | ScarLimits | None:
    """Wear limits that a scene has for a severity, None if it has none.

    Parameters
    ----------
    scene : Scene
        Scene of any machine.
    column : str
        Manifest column of the severity, see :class:`wearstate.sim.scene.scene.WearPlace`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> wear_limits(load_scene("bilge-pump"), "diametral_clearance_crankpin_m").condemning_diametral
    0.00031
    """
    kind = re.sub(r"_[0-9]+_m$", "_{}_m", column)
    tables = (each.limits for each in scene.wear_places if each.column == kind and each.limits)
    return next((getattr(scene, table, None) for table in tables), None)
