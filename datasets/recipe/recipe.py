"""What a data set is drawn from: the recipe, validated, and its records, lazily.

Record `i` depends on the recipe's name, the seed and `i` alone: not on how many records there
are, in which order or where they are made. Nor does a draw depend on which severities and
confounders stand beside it: each is randomised by its own name.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ...sim.scene.journal import ScarLimits
from ...sim.scene.load import (
    MACHINES,
    all_condition_places,
    all_wear_places,
    override,
    scene_folder,
    scene_from_table,
    scene_table,
    scene_text,
)
from ...sim.scene.parts import Part, Ratio, Scene, SceneError, Wear, validate_table
from ...sim.scene.parts import beside as files_beside
from ...sim.wear.archard import grade
from .correlation import Copula, Correlation, copula_of
from .draws import Axis, Bound, Draw, Range, axes_of, has_value, matches, value_at
from .held_out import HeldOut, Region, regions_of
from .life import LIFE_COLUMNS, LifeTable, Lives, Moment, life_faults
from .motor import motor_faults, motors_to_take, taken_along
from .options import Alternatives, OptionSet, alternatives_of
from .sampling import BLOCK, SET, CubeAxis, Points, Sampling, number_of
from .text import RecipeError, beside, merged, read_recipe
from .twin import Twin, TwinTable, coordinate_names
from .wear_bounds import bound_of_limits

IS_TWIN = "twin"
"""Manifest column that says whether a record is of the calibrated machine."""

VIEW = "view"
"""Manifest column that names which test of its machine state a record is."""

STRATA = BLOCK
"""Severities of each run of this many records fall in as many equal parts of the range."""

MOST_RECORDS = 10**8
"""Records of one data set: a decade of recordings, one every three seconds."""

LARGEST_SEED = 2**63 - 1
"""Seed of a data set: fits a signed integer in every file format."""

RESERVED = ("none", "combined")
"""Names that no confounder may have: tables use them for records without any and with several."""

# independent random streams of one data set; their numbers decide the records of every recipe
(
    _MACHINE,
    _RECORD,
    _NOISE,
    _PRESENCE,
    _CONFOUNDER,
    _LIFE,
    _MOMENT,
    _MACHINE_CHOICE,
    _RECORD_CHOICE,
    _TWIN,
) = range(10)

_SEVERITIES_OF_SET = 1
"""Dimensions of a Sobol sequence kept for severities: the first one is even together with the first
two draws of its record, speed and load; one more of either moves none of the other."""


class Severity(Part):
    """What wears, log-uniform and continuous between two bounds."""

    path: str = Field(description="dotted path of the scene's value that wears")
    low: Bound = Field(description="a length, or 'as new' by the limits of the scene")
    high: Bound = Field(description="a length, or '150 % of limit', which is the custom")


class Confounder(Draw):
    """A fault that is not the wear to be estimated, present in a share of machines or records."""

    name: str = Field(
        pattern="^[a-z][a-z0-9_]*$", max_length=48, description="of its manifest columns"
    )
    probability: Ratio = Field(ge=0, le=1, description="share of the machines or records")
    per: Literal["machine", "record"] = Field(
        default="machine", description="whether it belongs to a machine, or to single records"
    )
    exclusive: str = Field(
        default="", description="of all confounders with this word, one at a time at most"
    )

    @model_validator(mode="after")
    def _a_number(self) -> Self:
        if self.name in RESERVED:
            raise ValueError(f"name = '{self.name}' must be none of {RESERVED}; rename it")
        if self.distribution == "relative-normal":
            raise ValueError(
                f"{self.name}: distribution = 'relative-normal' draws no single number; use uniform"
            )
        return self


ViewName = Annotated[str, Field(pattern="^[a-z][a-z0-9_-]*$", max_length=32)]
"""Of one of several tests of the same machine states."""


class RecipeTable(Part):
    """The tables of a recipe file."""

    name: str = Field(
        min_length=1, max_length=64, description="of the recipe, kept in the data set"
    )
    description: str = Field(default="", description="one sentence for lists")
    scene: str = Field(min_length=1, description="a built-in scene or a file")
    records: int = Field(ge=1, le=MOST_RECORDS, description="records made unless told otherwise")
    fidelity: Literal["given", "auto"] | None = Field(
        default=None, description="rungs as written or as the accuracy needs; as the scene says"
    )
    records_per_group: int = Field(
        default=1, ge=1, le=MOST_RECORDS, description="records of each machine drawn"
    )
    sampling: Sampling = Field(default="sobol", description="how even the draws are")
    machines_of: str = Field(
        default="", max_length=64, description="recipe whose machines these are, under one seed"
    )
    fixed: dict[str, Bound | bool] = Field(
        default={}, description="scene values replaced in every record, by dotted path in quotes"
    )
    views: dict[ViewName, dict[str, Bound | bool]] = Field(
        default={},
        description="other tests of the same machine states: by name, what each sets beside fixed",
    )
    severity: tuple[Severity, ...] = Field(
        min_length=1, description="what wears; the first is graded and trained for"
    )
    machine: tuple[Draw, ...] = Field(default=(), description="drawn once per group")
    record: tuple[Draw, ...] = Field(default=(), description="drawn for every record")
    choice: tuple[OptionSet, ...] = Field(default=(), description="one of several, by chance")
    confounder: tuple[Confounder, ...] = Field(default=(), description="faults beside the wear")
    correlation: tuple[Correlation, ...] = Field(default=(), description="draws that go together")
    held_out: tuple[Region, ...] = Field(default=(), description="to test on, not to train on")
    life: LifeTable | None = Field(
        default=None, description="machines over their lives: their wear gives the first severity"
    )
    twin: TwinTable | None = Field(
        default=None,
        description="a calibrated machine among those drawn; in a file, the name of its scene",
    )


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One record to make.

    Attributes
    ----------
    index, group : int
        Record and machine number.
    seed : int
        Of the sensor noise, 64 bit.
    row : dict
        Manifest values known before the simulation.
    drawn : dict
        Dotted path of the scene -> value drawn [SI]; of confounders, those present.
    scene : Scene
        Validated.
    """

    index: int
    group: int
    seed: int
    row: dict[str, Any]
    drawn: dict[str, Any]
    scene: Scene


@dataclass(frozen=True, kw_only=True)
class Wearing:
    """A severity with its manifest columns.

    Attributes
    ----------
    axis : Range
        One band, log-uniform [m].
    column : str
        Manifest column of the value.
    grade_column : str
        Manifest column of its grade: ``grade`` for the first severity; empty for a further one
        that the scene has no wear limits for.
    edges : tuple of float
        Where grades 1, 2 and 3 begin [m]; empty without wear limits.
    """

    axis: Range
    column: str
    grade_column: str
    edges: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class RecipeFault:
    """A confounder with its place in the scene.

    Attributes
    ----------
    table : Confounder
        What the recipe says.
    axes : tuple of Range
        One for every value that its path stands for; all take the same random number.
    """

    table: Confounder
    axes: tuple[Range, ...]

    @property
    def columns(self) -> tuple[str, str]:
        """Manifest columns of presence and value."""
        return f"confounder_{self.table.name}", f"{self.table.name}_value"


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A validated recipe with the scene it varies; see `load_recipe`.

    Attributes
    ----------
    table : RecipeTable
        What the file says, with what it extends.
    text, scene_text : str
        TOML of recipe and scene; that of a recipe which extends another holds both.
    overrides : mapping
        What replaced values of the recipe file, by dotted path.
    base : dict
        Scene table with the fixed values in place.
    severities : tuple of Wearing
        The first is graded and trained for.
    machine, record : tuple of Range or Vector
        Nuisance and conditions, in the order in which they are drawn.
    choices : tuple of Alternatives
        Discrete draws.
    confounders : mapping
        Name of a random stream -> confounders that share it because they exclude each other.
    copulas : mapping
        Level, ``severity``, ``machine`` or ``record`` -> correlation of its draws.
    held_out : tuple of HeldOut
        Regions to test on.
    view : str
        Which of the recipe's tests of each machine state; empty of the one that needs no name.
    """

    table: RecipeTable
    text: str
    scene_text: str
    overrides: Mapping[str, Any]
    base: dict[str, Any]
    severities: tuple[Wearing, ...]
    machine: tuple[Axis, ...]
    record: tuple[Axis, ...]
    choices: tuple[Alternatives, ...]
    confounders: Mapping[str, tuple[RecipeFault, ...]]
    copulas: Mapping[str, Copula]
    held_out: tuple[HeldOut, ...]
    view: str = ""

    @property
    def name(self) -> str:
        """Name of the recipe; part of every seed."""
        return self.table.name

    @property
    def machine_name(self) -> str:
        """Name of the recipe whose machines are drawn; part of their seed."""
        return self.table.machines_of or self.name

    @property
    def severity(self) -> Range:
        """What is graded and trained for."""
        return self.severities[0].axis

    @property
    def severity_columns(self) -> tuple[str, ...]:
        """Manifest columns of the severities, the primary one first."""
        return tuple(wearing.column for wearing in self.severities)

    @cached_property
    def scene(self) -> Scene:
        """The scene before anything is drawn."""
        return scene_from_table(self.base)

    @cached_property
    def conditions(self) -> dict[str, str]:
        """Operating conditions that this scene has: manifest column -> dotted path."""
        return _conditions(self.scene)

    @cached_property
    def columns(self) -> dict[str, str]:
        """Manifest columns of labels and conditions -> numpy type, in order."""
        further = [wearing.grade_column for wearing in self.severities[1:] if wearing.grade_column]
        presence = [fault.columns[0] for fault in self.faults]
        values = [fault.columns[1] for fault in self.faults]
        return {
            **({VIEW: f"S{len(self.view)}"} if self.view else {}),
            **dict.fromkeys(self.severity_columns, "<f8"),
            **dict.fromkeys(further, "i1"),
            **dict.fromkeys([each.column for each in self.choices], "S32"),
            **dict.fromkeys(presence, "?"),
            **dict.fromkeys(values, "<f8"),
            **({} if self.table.life is None else LIFE_COLUMNS),
            **({} if self.table.twin is None else {IS_TWIN: "?"}),
            **dict.fromkeys(self.conditions, "<f8"),
        }

    @cached_property
    def lives(self) -> Lives | None:
        """Lives of the machines; None where severities are drawn."""
        if self.table.life is None:
            return None
        low, high = self.severity.bands[0]
        return Lives(
            table=self.table.life,
            base=self.base,
            path=self.severity.path,
            low=low,
            high=high,
            limit=self.severities[0].edges[-1],
            recordings=self.table.records_per_group,
        )

    @cached_property
    def twin(self) -> Twin | None:
        """The calibrated machine among those drawn."""
        return None if self.table.twin is None else Twin(self.table.twin)

    @cached_property
    def takes_motors_along(self) -> bool:
        """Whether a drawn speed takes motors on the mains along."""
        return bool(motors_to_take(self.base, (*self.machine, *self.record), self.choices))

    @property
    def faults(self) -> tuple[RecipeFault, ...]:
        """All confounders."""
        return tuple(fault for members in self.confounders.values() for fault in members)

    def rng(self, seed: int, stream: int, *key: int) -> np.random.Generator:
        """Random stream of one group or record, its own whatever else is drawn."""
        return np.random.default_rng(self._sequence(seed, stream, *key))

    def _sequence(self, seed: int, stream: int, *key: int) -> np.random.SeedSequence:
        # the name keeps two recipes with one seed from drawing the same machines
        of_machine = stream in (_MACHINE, _MACHINE_CHOICE)
        name = self.machine_name if of_machine else self.name
        return np.random.SeedSequence([seed, number_of(name)], spawn_key=(stream, *key))

    def noise_seed(self, seed: int, index: int) -> int:
        """Seed of the sensor noise of one record, another in each view."""
        view = (number_of(self.view),) if self.view else ()
        state = self._sequence(seed, _NOISE, index, *view).generate_state(1, np.uint64)
        return int(state[0])


def condition_of(scene: Scene, column: str) -> float:
    """Operating condition of a scene by its manifest column [SI]; the speed at rest is zero.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> condition_of(load_scene("bilge-pump"), "speed_hz")
    5.0
    """
    if column == "speed_hz" and not getattr(scene, "running", True):
        return 0.0
    return float(value_at(scene, all_condition_places()[column].path))


def _conditions(scene: Scene) -> dict[str, str]:
    return {
        each.column: each.path for each in scene.condition_places if has_value(scene, each.path)
    }


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
        Dotted path of the scene -> value; set in every record like the recipe's ``[fixed]``.
    view : str
        Which of its ``[views]``, further tests of the same machine states; what the view sets is
        set like an override, and an override of the same path wins.
    scene : str or Path, optional
        Built-in scene or file in place of the one that the recipe names.
    twin : str or Path, optional
        Calibrated scene, of ``wearstate calibrate``: a share of the machines is drawn from what
        is known of it, beside those that the recipe draws.

    Returns
    -------
    Recipe
        Validated, with every bound in SI.

    Raises
    ------
    RecipeError
        Every fault at once: of the tables, of paths the scene does not have, of bounds the scene
        refuses, of correlations and held-out regions, of a recipe with other machines, of a view
        that it does not have.

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
        base = dict(files_beside(scene_table(text, str(place)), scene_folder(place)))
    except SceneError as error:
        raise RecipeError(str(name_or_path), error.faults) from None
    faults = [*source.foreign, *_machine_faults(table, source.machines_folder)]
    texts = {"text": source.text, "scene_text": text}
    changes = {**_view_values(table, view), **(overrides or {})}
    return replace(_resolved(table, base, changes, texts, faults), view=view)


def _view_values(table: RecipeTable, view: str) -> Mapping[str, Any]:
    """What a view sets, by dotted path; nothing of the test that needs no name."""
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
    """A recipe against the table of its scene; raises every fault, those found before as well."""
    n_before = len(faults)
    base = _with_fixed(scene, {**table.fixed, **overrides}, faults)
    if len(faults) > n_before:
        raise RecipeError(table.name, _told_once(faults))
    in_metres = _with_limits(table, scene_from_table(base), faults)
    places = _places(in_metres)
    unbounded = [place for place in places if any(f.startswith(f"{place}.") for f in faults)]
    sound = {place: draw for place, draw in places.items() if place not in unbounded}
    axes = axes_of(sound, _with_lists(base), faults)
    faults += _severity_faults(table.severity)
    choices = alternatives_of(table.choice, _with_lists(base), faults)
    paths = [axis.path for found in axes.values() for axis in found]
    faults += _path_clashes([*paths, *(path for each in choices for path in each.paths)])
    faults += _confounder_faults(table.confounder)
    copulas = copula_of(table.correlation, _levels(places, axes), faults)
    held_out = _held_out(in_metres, axes, base, faults) if len(axes) == len(places) else ()
    faults += _life_faults(table, axes, base)
    faults += _twin_faults(table, _of(axes, "machine"), choices)
    drawn = [axis for found in axes.values() for axis in found]
    faults += motor_faults(motors_to_take(base, drawn, choices))
    if faults:
        raise RecipeError(table.name, _told_once(faults))
    return Recipe(
        table=table,
        **texts,
        overrides=overrides,
        base=base,
        severities=_wearing(table.severity, _of(axes, "severity"), scene_from_table(base)),
        machine=tuple(_of(axes, "machine")),
        record=tuple(_of(axes, "record")),
        choices=choices,
        confounders=_fault_sets(table.confounder, axes),
        copulas=copulas,
        held_out=held_out,
    )


_PLACED = re.compile(
    r"(?P<place>(?:severity|machine|record|choice|confounder|fixed)\.[^\s:]+)"
    r"(?P<about> \([^)]*\))?: (?P<fault>.+)"
)


_UNLIMITED = re.compile(r"(?P<place>.+ = .+)(?P<fault> of \S+ needs wear limits, .+)")


def _told_once(faults: Sequence[str]) -> list[str]:
    """Faults with those that several draws share told once, behind the places of all.

    Examples
    --------
    >>> _told_once(["machine.0 (a.b): a.c is missing", "machine.1 (a.d): a.c is missing", "other"])
    ['machine.0 (a.b), machine.1: a.c is missing', 'other']
    """
    places: dict[str, list[str]] = {}
    for text in dict.fromkeys(faults):
        if limits := _UNLIMITED.fullmatch(text):
            places.setdefault(limits["fault"], []).append(limits["place"])
            continue
        match = _PLACED.fullmatch(text)
        told = places.setdefault(match["fault"] if match else text, [])
        if match:
            told.append(match["place"] if told else match["place"] + (match["about"] or ""))
    return [
        f"{', '.join(told)}{'' if fault.startswith(' of ') else ': '}{fault}" if told else fault
        for fault, told in places.items()
    ]


def _with_lists(base: Mapping[str, Any]) -> dict[str, Any]:
    """Table of a scene with the lists that it leaves out, empty: a ``*`` there draws nothing."""
    fields = MACHINES[base["machine"]].model_fields
    return {**{name: [] for name, field in fields.items() if field.default == ()}, **base}


def _with_limits(table: RecipeTable, scene: Scene, faults: list[str]) -> RecipeTable:
    """Bounds of wear that are told by limits in metres, by those of the scene."""

    def metres(bound: Bound | None, column: str | None, place: str) -> Bound | None:
        if bound is None or column is None:
            return bound
        try:
            return bound_of_limits(bound, wear_limits(scene, column))
        except ValueError as error:
            faults.append(f"{place} = {bound!r} of {column} {error}")
            return 1.0  # a length, so that what else is wrong is found

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
    """What keeps the records of a recipe from being graded.

    Parameters
    ----------
    recipe : Recipe

    Returns
    -------
    list of str
        Empty where the first severity has limits.

    Examples
    --------
    >>> limit_faults(load_recipe("bilge-pump-small"))
    []
    """
    first = recipe.severities[0]
    if first.edges:
        return []
    table = all_wear_places()[_pattern(first.axis.path)].limits
    cure = f"add its table [{table}]" if table else "put a severity that has limits first"
    return [
        f"severity.0: the scene {recipe.table.scene} has no wear limits of {first.column}, must "
        f"have: every grade would be -1, and no wear model could be trained; {cure}"
    ]


def _life_faults(
    table: RecipeTable, axes: Mapping[str, list[Axis]], base: Mapping[str, Any]
) -> list[str]:
    """What of a life does not fit the first severity, where that is sound itself."""
    worn = next(iter(axes.get("severity.0", ())), None)
    column = severity_column(table.severity[0].path)
    if table.life is None or not isinstance(worn, Range) or column is None:
        return []
    limits = wear_limits(scene_from_table(base), column)
    condemning = None if limits is None else limits.condemning
    low, high = worn.bands[0]
    return life_faults(table.life, worn.path, low, high, condemning)


def _twin_faults(
    table: RecipeTable, machine: Sequence[Axis], choices: Sequence[Alternatives]
) -> list[str]:
    """Numbers of a twin that the recipe does not draw."""
    if table.twin is None:
        return []
    lost = sorted(set(table.twin.names) - set(coordinate_names(machine, choices)))
    if not lost:
        return []
    return [
        f"twin: {', '.join(lost[:3])} ({len(lost)} in all) must be drawn by the recipe; use the "
        "one that it was calibrated with"
    ]


def _machine_faults(table: RecipeTable, folder: Path) -> list[str]:
    """Machines are another recipe's only if all that decides them is the same there."""
    if not table.machines_of:
        return []
    file = folder / f"{table.machines_of}.toml"
    try:
        source = read_recipe(file if file.is_file() else table.machines_of)
        other = validate_table(RecipeTable, source.table, table.machines_of)
    except SceneError as error:
        return [f"machines_of: {fault}" for fault in error.faults]
    if other.machines_of or other.name != table.machines_of:
        told = other.machines_of or other.name
        return [
            f"machines_of = '{table.machines_of}' must be the recipe that draws them; name '{told}'"
        ]
    return [
        f"machines_of = '{other.name}': {name} must be as it is there; extend that recipe and "
        "leave it"
        for name in ("scene", "sampling", "machine", "choice", "correlation")
        if getattr(other, name) != getattr(table, name)
    ]


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
    columns |= _conditions(scene_from_table(base))
    drawn = [axis for name in ("severity", "machine", "record") for axis in _of(axes, name)]
    return regions_of(table.held_out, columns, drawn, _of(axes, "confounder"), base, faults)


def _with_fixed(
    base: dict[str, Any], fixed: Mapping[str, Any], faults: list[str]
) -> dict[str, Any]:
    """Scene table with values replaced; limits that are changed lose their source."""
    return _with_own_sources(base, _replaced(base, fixed, faults))


_NO_SOURCE = "given by the recipe in place of those of the scene"


def _with_own_sources(before: Mapping[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    """Limits that are no longer those of their source must not cite it."""
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
    with suppress(SceneError):  # values may need each other: a rung and what it asks for
        for pattern, value in fixed.items():
            together = override(together, dict.fromkeys(matches(together, pattern), value))
        scene_from_table(together)
        return together
    own = _faults_of(base)  # told as such where no value mends them
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


def _faults_of(table: Mapping[str, Any]) -> list[str]:
    try:
        scene_from_table(table)
    except SceneError as error:
        return error.faults
    return []


def _places(table: RecipeTable) -> dict[str, Draw]:
    """Every draw of a recipe by its place in the file, for messages."""
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


def _severity_faults(severities: Sequence[Severity]) -> list[str]:
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
    found = all_wear_places().get(_pattern(path))
    numbers = [int(number) + 1 for number in re.findall(_ENTRY, path)]
    return None if found is None or "*" in path else found.column.format(*numbers)


_ENTRY = r"(?<=\.)[0-9]+(?=\.)"
"""Number of a list entry inside a dotted path."""


def _pattern(path: str) -> str:
    return re.sub(_ENTRY, "*", path)


def _path_clashes(paths: Sequence[str]) -> list[str]:
    held = [path for path in paths if path in ("duration", "sample_rate")]
    return [f"{path} is drawn, must be one for all records; put it in [fixed]" for path in held] + [
        f"{path} is drawn {paths.count(path)} times, must be once; remove the others"
        for path in sorted(set(paths))
        if paths.count(path) > 1
    ]


def _confounder_faults(confounders: Sequence[Confounder]) -> list[str]:
    names = [confounder.name for confounder in confounders]
    faults = [
        f"confounder name '{name}' is given {names.count(name)} times, must be unique; rename one"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]
    for word, members in _exclusive_sets(confounders).items():
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


def _exclusive_sets(confounders: Sequence[Confounder]) -> dict[str, list[Confounder]]:
    """Confounders that exclude each other, by their word; a free one is alone under its name."""
    sets: dict[str, list[Confounder]] = {}
    for confounder in confounders:
        word = f"exclusive = '{confounder.exclusive}'" if confounder.exclusive else confounder.name
        sets.setdefault(word, []).append(confounder)
    return sets


def _fault_sets(
    confounders: Sequence[Confounder], axes: Mapping[str, list[Axis]]
) -> dict[str, tuple[RecipeFault, ...]]:
    """Confounders with their axes, those that exclude each other together."""
    faults = {
        confounder.name: RecipeFault(
            table=confounder,
            axes=tuple(axis for axis in axes[f"confounder.{i}"] if isinstance(axis, Range)),
        )
        for i, confounder in enumerate(confounders)
    }
    return {
        word: tuple(faults[member.name] for member in members)
        for word, members in _exclusive_sets(confounders).items()
    }


def _wearing(
    severities: Sequence[Severity], axes: Sequence[Axis], scene: Scene
) -> tuple[Wearing, ...]:
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
    """Every severity of a scene that acts, by its manifest column [m].

    None of an ideal joint; those of one throw only where they are not those of all; of the bearings
    of a shaft the first, and those with a fault.

    Parameters
    ----------
    scene : Scene
        Of any machine.

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


def _rung_of(scene: Scene, path: str) -> str:
    """Rung of the part at a path; empty of one that has none, or of a plain number."""
    return str(getattr(value_at(scene, path), "rung", ""))


def wear_limits(scene: Scene, column: str) -> Wear | ScarLimits | None:
    """Wear limits that a scene has for a severity, None where it has none.

    Parameters
    ----------
    scene : Scene
        Of any machine.
    column : str
        Manifest column of the severity, see :class:`wearstate.sim.scene.parts.WearPlace`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> wear_limits(load_scene("bilge-pump"), "diametral_clearance_crankpin_m").condemning_diametral
    0.00031
    """
    kind = re.sub(r"_[0-9]+_m$", "_{}_m", column)
    tables = (each.limits for each in scene.wear_places if each.column == kind and each.limits)
    return next((getattr(scene, table, None) for table in tables), None)


def sample_records(
    recipe: Recipe, n: int | None = None, *, seed: int = 0, skip: NDArray[np.bool_] | None = None
) -> Iterator[Sample]:
    """Draw records one after the other, without simulating them.

    Parameters
    ----------
    recipe : Recipe
        See `load_recipe`.
    n : int, optional
        How many; the recipe's own number unless given.
    seed : int
        Of the data set, >= 0. A larger `n` with the same seed begins with the same records.
    skip : numpy.ndarray [shape=(n,)], optional
        Records to leave out.

    Yields
    ------
    Sample
        In rising order of record number.

    Raises
    ------
    RecipeError
        `n` or `seed` is out of bounds.
    SceneError
        A drawn combination is no valid scene.

    Notes
    -----
    The recipe's ``sampling`` says how even the draws are, see :class:`~.recipe.sampling.Points`:
    those of machines over the machines, those of records, severities among them, over the records.
    Machine and record are paired at random. Severities are log-uniform; whatever the sampling,
    every block of `STRATA` records holds one value of each severity in each of that many equal
    parts of its (logarithmic) range, in shuffled order, so that small sets are balanced.

    With a ``life`` the first severity is not drawn: a group is one machine over its life, its
    records in the order of time, see :class:`~.recipe.life.Lives`.

    Confounders come and go with their probabilities, independently of each other but for those
    that exclude each other. Where one is absent, the scene's own value stays.

    Examples
    --------
    >>> sample = next(sample_records(load_recipe("bilge-pump-small"), seed=3))
    >>> sample.group, sorted(sample.row)[:2]
    (0, ['diametral_clearance_crankpin_m', 'discharge_pressure_pa'])
    """
    count = recipe.table.records if n is None else n
    if count < 1 or seed < 0:
        raise RecipeError(recipe.name, [f"n = {count} must be >= 1 and seed = {seed} must be >= 0"])
    sources = _sources(recipe, seed)
    for index in range(count):
        if skip is None or not skip[index]:
            yield _sample(recipe, sources, index, seed)


@dataclass(frozen=True)
class _Source:
    """Where the draws of one level come from."""

    axes: Sequence[Axis]
    points: Points
    copula: Copula | None

    def coordinates(self, number: int) -> dict[str, float]:
        """Numbers in (0, 1) that one machine or record is drawn by."""
        point = self.points.at(number)
        names = [entry for axis in self.axes for entry in axis.entries]
        return dict(
            zip(names, (point if self.copula is None else self.copula(point)).tolist(), strict=True)
        )

    def values(self, number: int, known: Mapping[str, float] | None = None) -> dict[str, Any]:
        """Values of one machine or record by path, at coordinates that are known or drawn."""
        at = {**self.coordinates(number), **(known or {})}
        return {axis.path: axis.value([at[entry] for entry in axis.entries]) for axis in self.axes}


def _sources(recipe: Recipe, seed: int) -> dict[str, _Source]:
    method = recipe.table.sampling
    # free draws of a severity would leave a small set without a grade
    balanced: Sampling = "latin-hypercube" if method == "random" else method
    machine, record = (partial(recipe.rng, seed, stream) for stream in (_MACHINE, _RECORD))
    worn = [wearing.axis for wearing in recipe.severities]
    points = {
        "machine": Points(method, machine, _dimensions(recipe.machine, range(SET))),
        "record": Points(
            method, record, _dimensions(recipe.record, range(_SEVERITIES_OF_SET, SET))
        ),
        "severity": Points(balanced, record, _dimensions(worn, range(_SEVERITIES_OF_SET))),
    }
    axes: dict[str, Sequence[Axis]] = {
        "machine": recipe.machine,
        "record": recipe.record,
        "severity": worn,
    }
    return {name: _Source(axes[name], points[name], recipe.copulas.get(name)) for name in points}


def _dimensions(axes: Sequence[Axis], places: range) -> list[CubeAxis]:
    """Dimensions of some draws, in these places of one Sobol sequence after the other."""
    names = [entry for axis in axes for entry in axis.entries]
    return [
        CubeAxis(name=name, slot=SET * (k // len(places)) + places[k % len(places)])
        for k, name in enumerate(names)
    ]


def _sample(recipe: Recipe, sources: Mapping[str, _Source], index: int, seed: int) -> Sample:
    group = index // recipe.table.records_per_group
    known = _known(recipe, group, seed)
    drawn = sources["machine"].values(group, known)
    drawn |= sources["record"].values(index)
    drawn |= sources["severity"].values(index)
    taken = _choices(recipe, group, index, seed, known)
    drawn |= {path: value for _, values in taken.values() for path, value in values.items()}
    life = _moment(recipe, group, index, seed)
    if life is not None:
        drawn[recipe.severity.path] = life.severity
    faults = _confounded(recipe, group, index, seed)
    drawn |= {path: value for values in faults.values() for path, value in values.items()}
    along = taken_along(recipe.base, drawn) if recipe.takes_motors_along else {}
    scene = scene_from_table(override(recipe.base, {**drawn, **along}))
    noise_seed = recipe.noise_seed(seed, index)
    row = {
        "record_id": f"{index:08d}",
        "group": group,
        "seed": noise_seed,
        **({VIEW: recipe.view} if recipe.view else {}),
        **_severity_labels(recipe, drawn),
        **{column: name for column, (name, _) in taken.items()},
        **({} if life is None else life.labels),
        **({} if recipe.twin is None else {IS_TWIN: bool(known)}),
        **_confounder_labels(recipe, faults),
        **{name: condition_of(scene, name) for name in recipe.conditions},
    }
    return Sample(index=index, group=group, seed=noise_seed, row=row, drawn=drawn, scene=scene)


def _known(recipe: Recipe, group: int, seed: int) -> dict[str, float]:
    """Coordinates of a machine that is the twin; none of one that the recipe draws."""
    if recipe.twin is None:
        return {}
    rng = recipe.rng(seed, _TWIN, group)
    return recipe.twin.draw(rng) if rng.random() < recipe.twin.table.share else {}


def _choices(
    recipe: Recipe, group: int, index: int, seed: int, known: Mapping[str, float]
) -> dict[str, tuple[str, dict[str, Any]]]:
    """Option and scene values of every choice, by its manifest column."""
    streams = {"machine": (_MACHINE_CHOICE, group), "record": (_RECORD_CHOICE, index)}

    def at(per: str, word: str) -> float:
        if per == "machine" and word in known:
            return known[word]
        stream, number = streams[per]
        return float(recipe.rng(seed, stream, number, number_of(word)).random())

    return {each.column: each.take(partial(at, each.per)) for each in recipe.choices}


def _moment(recipe: Recipe, group: int, index: int, seed: int) -> Moment | None:
    """Where in the life of its machine a record is; None where severities are drawn."""
    if recipe.lives is None:
        return None
    place = index - group * recipe.table.records_per_group
    machine, record = recipe.rng(seed, _LIFE, group), recipe.rng(seed, _MOMENT, index)
    return recipe.lives.moment(machine, record, place)


def _confounded(recipe: Recipe, group: int, index: int, seed: int) -> dict[str, dict[str, float]]:
    """Values of the confounders that are present, by name and path."""
    found = {}
    for word, members in recipe.confounders.items():
        which = group if members[0].table.per == "machine" else index
        left = recipe.rng(seed, _PRESENCE, number_of(word), which).random()
        for member in members:
            if 0 <= left < member.table.probability:
                key = (_CONFOUNDER, number_of(member.table.name), which)
                # the same number at every place that the path stands for
                place = recipe.rng(seed, *key).random()
                found[member.table.name] = {axis.path: axis.value([place]) for axis in member.axes}
            left -= member.table.probability
    return found


def _severity_labels(recipe: Recipe, drawn: Mapping[str, Any]) -> dict[str, float | int]:
    labels: dict[str, float | int] = {}
    for wearing in recipe.severities:
        labels[wearing.column] = value = drawn[wearing.axis.path]
        if wearing.grade_column:
            labels[wearing.grade_column] = grade(value, wearing.edges) if wearing.edges else -1
    return labels


def _confounder_labels(
    recipe: Recipe, present: Mapping[str, Mapping[str, float]]
) -> dict[str, bool | float]:
    labels: dict[str, bool | float] = {}
    for fault in recipe.faults:
        values = present.get(fault.table.name, {})
        presence, value = fault.columns
        labels |= {presence: bool(values), value: next(iter(values.values()), 0.0)}
    return labels


def overrides_text(recipe: Recipe) -> str:
    """Overrides as JSON, for the file."""
    return json.dumps(dict(recipe.overrides), sort_keys=True)


def recorded_scene(scene: str, recipe: str, overrides: str) -> Scene:
    """Scene of a data set before anything was drawn, from the texts in its file.

    Parameters
    ----------
    scene, recipe, overrides : str
        As `Attributes` has them; recipe and overrides may be empty.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        The texts are no scene, as those of a measured data set.

    Examples
    --------
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
        As `Attributes` has them.

    Returns
    -------
    Recipe

    Raises
    ------
    RecipeError
        The texts are no recipe and its scene, as those of a measured data set.

    Examples
    --------
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
