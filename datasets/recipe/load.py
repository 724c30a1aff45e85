"""From a recipe's text to the recipe: its scene, fixed values, all faults at once."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...sim.parts.casing import with_folder
from ...sim.scene.load import (
    MACHINES,
    all_wear_places,
    override,
    scene_folder,
    scene_from_table,
    scene_table,
    scene_text,
)
from ...sim.scene.scene import Scene, SceneError, validate_table
from ..draws.correlation import copula_of
from ..draws.draws import Axis, Draw, Range, axes_of, matches
from ..draws.held_out import HeldOut, regions_of
from ..draws.motor import motor_faults, motors_to_take
from ..draws.options import alternatives_of
from .faults import (
    confounder_faults,
    exclusive_sets,
    faults_of,
    faults_of_life,
    machine_faults,
    merged_faults,
    path_clashes,
    twin_faults,
)
from .recipe import Recipe, RecipeFault, conditions_of
from .severities import (
    severity_column,
    severity_faults,
    silent_faults,
    wearing_of,
    with_wear_limits,
)
from .table import Confounder, RecipeTable
from .text import RecipeError, beside, merged, read_recipe


def load_recipe(
    name_or_path: str | Path,
    overrides: Mapping[str, Any] | None = None,
    *,
    view: str = "",
    scene: str | Path | None = None,
    twin: str | Path | None = None,
) -> Recipe:
    """Load a built-in recipe or a TOML file, and check it against its scene.

    Parameters
    ----------
    name_or_path : str or Path
        A name of `recipe_names`, or a file.
    overrides : mapping, optional
        Values by dotted path of the scene; set in every record like the recipe's ``[fixed]``.
    view : str
        Name of one of its ``[views]``, further tests of the same machine states; its values are set
        like overrides, and an override of the same path takes precedence.
    scene : str or Path, optional
        Built-in scene or file in place of that named in the recipe.
    twin : str or Path, optional
        Calibrated scene, made by ``wearstate calibrate``: a share of the machines is drawn from its
        distribution, in addition to those of the recipe.

    Returns
    -------
    Recipe
        Validated recipe, with every bound in SI.

    Raises
    ------
    RecipeError
        All faults at once: of the tables, of paths that the scene lacks, of bounds it refuses, of
        correlations and held-out regions, of a recipe with other machines, of an unknown view.

    Examples
    --------
    >>> recipe = load_recipe("bilge-pump-small", {"duration": "1 s"})
    >>> recipe.table.records, recipe.scene.duration
    (120, 1.0)
    >>> load_recipe("shaft-rig-small", view="running").scene.exciters[0].mounted
    False
    """
    source = read_recipe(name_or_path, twin=twin)
    if isinstance(source.table.get("machine"), str):
        fault = (
            "machine is a text, as this is a scene, not a recipe; name it in a recipe by "
            f"scene = '{name_or_path}', with what varies: wearstate recipe explain"
        )
        raise RecipeError(str(name_or_path), [fault])
    try:
        table = validate_table(RecipeTable, source.table, str(name_or_path))
        place = beside(source.folder, table.scene) if scene is None else scene
        text = scene_text(place)
        base = dict(with_folder(scene_table(text, str(place)), scene_folder(place)))
    except SceneError as error:
        raise RecipeError(str(name_or_path), error.faults) from None
    faults = [*source.foreign, *machine_faults(table, source.machines_folder)]
    texts = {"text": source.text, "scene_text": text}
    changes = {**_view_values(table, view), **(overrides or {})}
    return replace(_resolved(table, base, changes, texts, faults), view=view)


def _view_values(table: RecipeTable, view: str) -> Mapping[str, Any]:
    """Values set by a view, by dotted path; none for the test without a name."""
    if view and view not in table.views:
        known = ", ".join(table.views) or "(it has none)"
        fault = f"view = {view!r} must be one of {known}; choose one, or add a table [views.{view}]"
        raise RecipeError(table.name, [fault])
    return table.views[view] if view else {}


def _resolved(
    table: RecipeTable,
    scene: dict[str, Any],
    overrides: Mapping[str, Any],
    texts: Mapping[str, str],
    faults: list[str],
) -> Recipe:
    """A recipe resolved against the table of its scene; raises all faults, earlier ones too."""
    n_before = len(faults)
    base = _with_fixed(scene, {**table.fixed, **overrides}, faults)
    if len(faults) > n_before:
        raise RecipeError(table.name, merged_faults(faults))
    in_metres = with_wear_limits(table, scene_from_table(base), faults)
    places = _places(in_metres)
    unbounded = [place for place in places if any(f.startswith(f"{place}.") for f in faults)]
    sound = {place: draw for place, draw in places.items() if place not in unbounded}
    axes = axes_of(sound, _with_lists(base), faults)
    faults += severity_faults(table.severity)
    choices = alternatives_of(table.choice, _with_lists(base), faults)
    faults += silent_faults(table.severity, scene_from_table(base), choices)
    paths = [axis.path for found in axes.values() for axis in found]
    faults += path_clashes([*paths, *(path for each in choices for path in each.paths)])
    faults += confounder_faults(table.confounder)
    copulas = copula_of(table.correlation, _levels(places, axes), faults)
    held_out = _held_out(in_metres, axes, base, faults) if len(axes) == len(places) else ()
    faults += faults_of_life(table, axes, base)
    faults += twin_faults(table, _of(axes, "machine"), choices)
    drawn = [axis for found in axes.values() for axis in found]
    faults += motor_faults(motors_to_take(base, drawn, choices))
    if faults:
        raise RecipeError(table.name, merged_faults(faults))
    return Recipe(
        table=table,
        **texts,
        overrides=overrides,
        base=base,
        severities=wearing_of(table.severity, _of(axes, "severity"), scene_from_table(base)),
        machine=tuple(_of(axes, "machine")),
        record=tuple(_of(axes, "record")),
        choices=choices,
        confounders=_fault_sets(table.confounder, axes),
        copulas=copulas,
        held_out=held_out,
    )


def _with_lists(base: Mapping[str, Any]) -> dict[str, Any]:
    """Table of a scene with its missing lists added, empty: a ``*`` there draws nothing."""
    fields = MACHINES[base["machine"]].model_fields
    return {**{name: [] for name, field in fields.items() if field.default == ()}, **base}


def _levels(
    places: Mapping[str, Draw], axes: Mapping[str, list[Axis]]
) -> dict[str, list[tuple[Draw, Sequence[Axis]]]]:
    """Draws that may be correlated, with their axes, by list of the recipe."""
    levels: dict[str, list[tuple[Draw, Sequence[Axis]]]] = {
        "severity": [],
        "machine": [],
        "record": [],
    }
    for place, draw in places.items():
        level = place.split(".")[0]
        if level in levels:
            levels[level].append((draw, axes.get(place, ())))
    return levels


def _held_out(
    table: RecipeTable, axes: Mapping[str, list[Axis]], base: Mapping[str, Any], faults: list[str]
) -> tuple[HeldOut, ...]:
    paths = [severity.path for severity in table.severity]
    columns = {column: path for path in paths if (column := severity_column(path))}
    columns |= conditions_of(scene_from_table(base))
    drawn = [axis for name in ("severity", "machine", "record") for axis in _of(axes, name)]
    return regions_of(table.held_out, columns, drawn, _of(axes, "confounder"), base, faults)


def _with_fixed(
    base: dict[str, Any], fixed: Mapping[str, Any], faults: list[str]
) -> dict[str, Any]:
    """Scene table with values replaced; changed limits lose their source."""
    return _with_own_sources(base, _replaced(base, fixed, faults))


_NO_SOURCE = "given by the recipe in place of those of the scene"


def _with_own_sources(before: Mapping[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    """Remove the source of limits that were changed."""
    own = {
        name: {**after[name], "source": _NO_SOURCE}
        for name in sorted({each.limits for each in all_wear_places().values()})
        if name in before
        and after[name] != before[name]
        and after[name].get("source") == before[name].get("source")
    }
    return {**after, **own}


def _replaced(base: dict[str, Any], fixed: Mapping[str, Any], faults: list[str]) -> dict[str, Any]:
    together = base
    with suppress(SceneError):  # values may depend on each other: a rung and its needs
        for pattern, value in fixed.items():
            together = override(together, dict.fromkeys(matches(together, pattern), value))
        scene_from_table(together)
        return together
    own = faults_of(base)  # reported as such unless the values correct them
    for pattern, value in fixed.items():
        try:
            base = override(base, dict.fromkeys(matches(base, pattern), value))
            scene_from_table(base)
        except SceneError as error:
            faults += [
                f"the scene itself: {fault}" if fault in own else f"fixed.{pattern}: {fault}"
                for fault in error.faults
            ]
    return base


def _places(table: RecipeTable) -> dict[str, Draw]:
    """All draws of a recipe by their place in the file, for messages."""
    worn = [
        Draw(path=severity.path, distribution="log-uniform", low=severity.low, high=severity.high)
        for severity in table.severity
    ]
    lists: dict[str, Sequence[Draw]] = {
        "severity": worn,
        "machine": table.machine,
        "record": table.record,
        "confounder": table.confounder,
    }
    return {f"{name}.{i}": draw for name, draws in lists.items() for i, draw in enumerate(draws)}


def _of(axes: Mapping[str, list[Axis]], name: str) -> list[Axis]:
    """Axes of one list of the recipe, in order."""
    return [axis for place, found in axes.items() if place.split(".")[0] == name for axis in found]


def _fault_sets(
    confounders: Sequence[Confounder], axes: Mapping[str, list[Axis]]
) -> dict[str, tuple[RecipeFault, ...]]:
    """Confounders with their axes, mutually exclusive ones together."""
    faults = {
        confounder.name: RecipeFault(
            table=confounder,
            axes=tuple(axis for axis in axes[f"confounder.{i}"] if isinstance(axis, Range)),
        )
        for i, confounder in enumerate(confounders)
    }
    return {
        word: tuple(faults[member.name] for member in members)
        for word, members in exclusive_sets(confounders).items()
    }


def recorded_scene(scene: str, recipe: str, overrides: str) -> Scene:
    """Scene of a data set before any draws, from the texts in its file.

    Parameters
    ----------
    scene, recipe, overrides : str
        As in `Attributes`; recipe and overrides may be empty.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        If the texts are not a scene, as in a measured data set.

    Examples
    --------
    >>> from wearstate.datasets.recipe.records import overrides_text
    >>> recipe = load_recipe("bilge-pump-small")
    >>> recorded_scene(recipe.scene_text, recipe.text, overrides_text(recipe)) == recipe.scene
    True
    """
    faults: list[str] = []
    fixed = scene_table(recipe, "recipe").get("fixed", {})
    table = _with_fixed(scene_table(scene), {**fixed, **json.loads(overrides)}, faults)
    if faults:
        raise SceneError("scene", faults)
    return scene_from_table(table)


def recorded_recipe(scene: str, recipe: str, overrides: str) -> Recipe:
    """Recipe of a data set, from the texts in its file: draws the records again.

    Parameters
    ----------
    scene, recipe, overrides : str
        As in `Attributes`.

    Returns
    -------
    Recipe

    Raises
    ------
    RecipeError
        If the texts are not a recipe and its scene, as in a measured data set.

    Examples
    --------
    >>> from wearstate.datasets.recipe.records import overrides_text, sample_records
    >>> recipe = load_recipe("bilge-pump-small")
    >>> again = recorded_recipe(recipe.scene_text, recipe.text, overrides_text(recipe))
    >>> next(sample_records(again)).drawn == next(sample_records(recipe)).drawn
    True
    """
    try:
        # as when it was read: a single [severity] is a list of one
        table = validate_table(RecipeTable, merged({}, scene_table(recipe, "recipe")), "recipe")
        base = scene_table(scene)
    except SceneError as error:
        raise RecipeError("recipe", error.faults) from None
    texts = {"text": recipe, "scene_text": scene}
    return _resolved(table, base, json.loads(overrides or "{}"), texts, [])
