"""A validated recipe: distribution of the records, and the seeds of their random streams."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...sim.scene.load import all_condition_places, scene_from_table
from ...sim.scene.scene import Scene
from ..draws.correlation import Copula
from ..draws.draws import Axis, Range, has_value, value_at
from ..draws.held_out import HeldOut
from ..draws.motor import motors_to_take
from ..draws.options import Alternatives
from ..draws.sampling import number_of
from ..draws.twin import Twin
from .life import LIFE_COLUMNS, Lives
from .table import Confounder, RecipeTable

IS_TWIN = "twin"
"""Manifest column: whether a record is of the calibrated machine."""

VIEW = "view"
"""Manifest column: test of its machine state that a record belongs to."""

# independent random streams of one data set; their numbers determine the records of every recipe
(
    MACHINE_STREAM,
    RECORD_STREAM,
    NOISE_STREAM,
    PRESENCE_STREAM,
    CONFOUNDER_STREAM,
    LIFE_STREAM,
    MOMENT_STREAM,
    MACHINE_CHOICE_STREAM,
    RECORD_CHOICE_STREAM,
    TWIN_STREAM,
) = range(10)


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
        without wear limits in the scene.
    edges : tuple of float
        Severities at which grades 1, 2 and 3 begin [m]; empty without wear limits.
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
        Table in the recipe.
    axes : tuple of Range
        One axis for every value that its path matches; all take the same random number.
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
        Tables of the file, including those it extends.
    text, scene_text : str
        TOML of recipe and scene; for a recipe that extends another, both in one.
    overrides : mapping
        Values that replace those of the recipe file, by dotted path.
    base : dict
        Scene table with the fixed values set.
    severities : tuple of Wearing
        Severities; the first is graded and used for training.
    machine, record : tuple of Range or Vector
        Nuisance parameters and conditions, in the order in which they are drawn.
    choices : tuple of Alternatives
        Discrete draws.
    confounders : mapping
        Confounders by the random stream that they share because they exclude each other.
    copulas : mapping
        Correlation of the draws of each level: ``severity``, ``machine`` or ``record``.
    held_out : tuple of HeldOut
        Regions for testing.
    view : str
        Test of each machine state; empty for the one without a name.
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
        """The severity that is graded and used for training."""
        return self.severities[0].axis

    @property
    def severity_columns(self) -> tuple[str, ...]:
        """Manifest columns of the severities, the primary one first."""
        return tuple(wearing.column for wearing in self.severities)

    @cached_property
    def scene(self) -> Scene:
        """The scene before any draws."""
        return scene_from_table(self.base)

    @cached_property
    def conditions(self) -> dict[str, str]:
        """Dotted path of each operating condition of this scene, by manifest column."""
        return conditions_of(self.scene)

    @cached_property
    def columns(self) -> dict[str, str]:
        """Manifest columns of labels and conditions with their numpy types, in order."""
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
        """Lives of the machines; None if severities are drawn."""
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
        """Whether mains-fed motors follow a drawn speed."""
        return bool(motors_to_take(self.base, (*self.machine, *self.record), self.choices))

    @property
    def faults(self) -> tuple[RecipeFault, ...]:
        """All confounders."""
        return tuple(fault for members in self.confounders.values() for fault in members)

    def rng(self, seed: int, stream: int, *key: int) -> np.random.Generator:
        """Random stream of one group or record, independent of all other draws."""
        return np.random.default_rng(self._sequence(seed, stream, *key))

    def _sequence(self, seed: int, stream: int, *key: int) -> np.random.SeedSequence:
        # the name keeps two recipes with one seed from drawing the same machines
        of_machine = stream in (MACHINE_STREAM, MACHINE_CHOICE_STREAM)
        name = self.machine_name if of_machine else self.name
        return np.random.SeedSequence([seed, number_of(name)], spawn_key=(stream, *key))

    def noise_seed(self, seed: int, index: int) -> int:
        """Seed of the sensor noise of one record, different in each view."""
        view = (number_of(self.view),) if self.view else ()
        state = self._sequence(seed, NOISE_STREAM, index, *view).generate_state(1, np.uint64)
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


def conditions_of(scene: Scene) -> dict[str, str]:
    """Dotted path of each operating condition of a scene, by manifest column."""
    return {
        each.column: each.path for each in scene.condition_places if has_value(scene, each.path)
    }
