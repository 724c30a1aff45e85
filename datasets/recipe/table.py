"""Tables of a recipe as written: severities, confounders, records, views."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ...sim.parts.dimensions import Ratio
from ...sim.parts.part import Part
from ..draws.correlation import Correlation
from ..draws.draws import Bound, Draw
from ..draws.held_out import Region
from ..draws.options import OptionSet
from ..draws.sampling import Sampling
from ..draws.twin import TwinTable
from .life import LifeTable

MOST_RECORDS = 10**8
"""Largest number of records of a data set: one every three seconds for a decade."""

RESERVED = ("none", "combined")
"""Names that no confounder may have: tables use them for records without any and with several."""


class Severity(Part):
    """Wear, log-uniform and continuous between two bounds."""

    path: str = Field(description="dotted path of the scene's value that wears")
    low: Bound = Field(description="a length, or 'as new' by the limits of the scene")
    high: Bound = Field(description="a length, or usually '150 % of limit'")


class Confounder(Draw):
    """A fault other than the wear to be estimated, present in a share of machines or records."""

    name: str = Field(
        pattern="^[a-z][a-z0-9_]*$", max_length=48, description="name of its manifest columns"
    )
    probability: Ratio = Field(ge=0, le=1, description="share of the machines or records")
    per: Literal["machine", "record"] = Field(
        default="machine", description="whether it belongs to a machine, or to single records"
    )
    exclusive: str = Field(
        default="", description="of all confounders with this word, at most one at a time"
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
"""Name of one of several tests of the same machine states."""


class RecipeTable(Part):
    """The tables of a recipe file."""

    name: str = Field(
        min_length=1, max_length=64, description="name of the recipe, kept in the data set"
    )
    description: str = Field(default="", description="one sentence for lists")
    scene: str = Field(min_length=1, description="a built-in scene or a file")
    records: int = Field(ge=1, le=MOST_RECORDS, description="number of records by default")
    fidelity: Literal["given", "auto"] | None = Field(
        default=None, description="rungs as written or as the accuracy needs; default: the scene's"
    )
    records_per_group: int = Field(
        default=1, ge=1, le=MOST_RECORDS, description="records of each machine drawn"
    )
    sampling: Sampling = Field(default="sobol", description="evenness of the draws")
    machines_of: str = Field(
        default="", max_length=64, description="recipe whose machines these are, under one seed"
    )
    fixed: dict[str, Bound | bool] = Field(
        default={}, description="scene values replaced in every record, by dotted path in quotes"
    )
    views: dict[ViewName, dict[str, Bound | bool]] = Field(
        default={},
        description="other tests of the same machine states, by name, and the values each sets",
    )
    severity: tuple[Severity, ...] = Field(
        min_length=1, description="wear; the first is graded and used for training"
    )
    machine: tuple[Draw, ...] = Field(default=(), description="drawn once per group")
    record: tuple[Draw, ...] = Field(default=(), description="drawn for every record")
    choice: tuple[OptionSet, ...] = Field(default=(), description="one of several, at random")
    confounder: tuple[Confounder, ...] = Field(default=(), description="faults other than wear")
    correlation: tuple[Correlation, ...] = Field(default=(), description="correlated draws")
    held_out: tuple[Region, ...] = Field(default=(), description="regions for testing only")
    life: LifeTable | None = Field(
        default=None, description="machines over their lives: their wear gives the first severity"
    )
    twin: TwinTable | None = Field(
        default=None,
        description="a calibrated machine among those drawn; in a file, the name of its scene",
    )
