"""Draws of one particular machine: distribution of its numbers as estimated from recordings.

Every number that a recipe draws once per machine has a coordinate in (0, 1). A recipe draws them
evenly and independently; a twin draws them by a Gaussian copula with narrower margins. It thus
agrees with the recipe on all that the recordings leave undetermined.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.special import ndtr

from ...sim.parts.dimensions import Ratio
from ...sim.parts.part import Part
from .draws import Axis
from .options import Alternatives

Float = NDArray[np.float64]

_LEAST_EIGENVALUE = -1e-3  # of a correlation matrix written with four digits
FARTHEST = 6.0
"""Normal scores beyond this are set to it, so that a coordinate stays inside (0, 1)."""


class TwinTable(Part):
    """Distribution of the numbers drawn by a recipe, as estimated for one machine."""

    share: Ratio = Field(
        default=0.5, gt=0, le=0.9, description="share of machines that are the twin"
    )
    scene: str = Field(default="", description="scene that was calibrated, for reports")
    recipe: str = Field(default="", description="recipe of such machines, in the same folder")
    base: str = Field(default="", description="scene before calibration, built in or in the folder")
    unknown: tuple[str, ...] = Field(
        default=(), description="what was to be estimated; if empty, all that the recipe draws"
    )
    names: tuple[str, ...] = Field(min_length=1, description="coordinates, named as in the recipe")
    mean: tuple[Ratio, ...] = Field(description="means in normal scores: 0 is the middle")
    sd: tuple[Ratio, ...] = Field(description="deviations in normal scores: 1 is as in the recipe")
    correlation: tuple[tuple[Ratio, ...], ...] = Field(
        description="correlation of the scores, lower triangle, row by row"
    )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        count = len(self.names)
        rows = [len(row) for row in self.correlation]
        if len(set(self.names)) < count:
            raise ValueError("names must differ; calibrate again")
        if {len(self.mean), len(self.sd)} != {count} or rows != list(range(1, count + 1)):
            raise ValueError(
                f"mean, sd and correlation must have {count} entries, as names; calibrate again"
            )
        if min(self.sd) <= 0 or np.linalg.eigvalsh(self.matrix)[0] < _LEAST_EIGENVALUE:
            raise ValueError("sd must be > 0 and correlation that of something; calibrate again")
        return self

    @property
    def matrix(self) -> Float:
        """Correlation [shape=(n, n)]."""
        lower = np.zeros((len(self.names), len(self.names)))
        for i, row in enumerate(self.correlation):
            lower[i, : i + 1] = row
        full: Float = lower + np.tril(lower, -1).T
        return full


@dataclass(frozen=True)
class Twin:
    """Joint distribution of the coordinates of one machine.

    Attributes
    ----------
    table : TwinTable
        Table of the file.
    """

    table: TwinTable

    @property
    def covariance(self) -> Float:
        """Covariance of the normal scores [shape=(n, n)]."""
        sd = np.array(self.table.sd)
        return np.asarray(self.table.matrix * np.outer(sd, sd))

    @cached_property
    def _factor(self) -> Float:
        values, vectors = np.linalg.eigh(self.covariance)
        factor: Float = vectors * np.sqrt(np.maximum(values, 0.0))
        return factor

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """Coordinates in (0, 1) of one machine, by name.

        Examples
        --------
        >>> table = TwinTable(names=("a",), mean=(1.0,), sd=(0.1,), correlation=((1.0,),))
        >>> 0.7 < Twin(table).draw(np.random.default_rng(0))["a"] < 0.95
        True
        """
        scores = np.array(self.table.mean) + self._factor @ rng.standard_normal(len(self._factor))
        return dict(zip(self.table.names, inside(scores).tolist(), strict=True))


def inside(scores: Float) -> Float:
    """Coordinates in (0, 1) of normal scores."""
    found: Float = ndtr(np.clip(scores, -FARTHEST, FARTHEST))
    return found


def coordinate_names(machine: Sequence[Axis], choices: Sequence[Alternatives]) -> tuple[str, ...]:
    """Names of all coordinates that determine one machine of a recipe.

    Parameters
    ----------
    machine : sequence of Axis
    choices : sequence of Alternatives
        Option sets of a :class:`~.recipe.recipe.Recipe`.
    """
    of_choices = [name for each in choices if each.per == "machine" for name in each.coordinates]
    return (*(entry for axis in machine for entry in axis.entries), *of_choices)


def machine_values(
    machine: Sequence[Axis], choices: Sequence[Alternatives], at: Callable[[str], float]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Scene values of a machine, and its options by manifest column.

    Parameters
    ----------
    machine, choices
        As for :func:`coordinate_names`.
    at : callable
        Returns the coordinate in (0, 1) of a name.

    Returns
    -------
    values : dict
        Scene values [SI] by dotted path.
    options : dict
        Option by column of the choice.
    """
    values = {axis.path: axis.value([at(entry) for entry in axis.entries]) for axis in machine}
    options = {}
    for each in choices:
        if each.per == "machine":
            options[each.column], drawn = each.take(at)
            values |= drawn
    return values, options
