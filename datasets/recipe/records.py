"""Records of a recipe, one at a time: values drawn for each from its own random streams.

Record `i` depends on the recipe's name, the seed and `i` alone: not on the number of records or on
where and in which order they are made. Nor does a draw depend on the other severities and
confounders: each is randomised by its own name.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.scene.load import override, scene_from_table
from ...sim.scene.scene import Scene
from ...sim.wear.archard import grade
from ..draws.correlation import Copula
from ..draws.draws import Axis
from ..draws.motor import taken_along
from ..draws.sampling import BLOCK, SET, CubeAxis, Points, Sampling, number_of
from .life import Moment
from .recipe import (
    CONFOUNDER_STREAM,
    IS_TWIN,
    LIFE_STREAM,
    MACHINE_CHOICE_STREAM,
    MACHINE_STREAM,
    MOMENT_STREAM,
    PRESENCE_STREAM,
    RECORD_CHOICE_STREAM,
    RECORD_STREAM,
    TWIN_STREAM,
    VIEW,
    Recipe,
    condition_of,
)
from .text import RecipeError

STRATA = BLOCK
"""In each run of this many records, the severities fill as many equal parts of their range."""

LARGEST_SEED = 2**63 - 1
"""Largest seed of a data set: fits a signed integer in every file format."""

_SEVERITIES_OF_SET = 1
"""Dimensions of a Sobol sequence reserved for severities: the first one is even together with the
first two draws of its record, speed and load; one more of either does not change the others."""


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One record to make.

    Attributes
    ----------
    index, group : int
        Record and machine number.
    seed : int
        Seed of the sensor noise, 64 bit.
    row : dict
        Manifest values known before the simulation.
    drawn : dict
        Drawn values [SI] by dotted path of the scene; for confounders, those present.
    scene : Scene
        Validated scene.
    """

    index: int
    group: int
    seed: int
    row: dict[str, Any]
    drawn: dict[str, Any]
    scene: Scene


def sample_records(
    recipe: Recipe, n: int | None = None, *, seed: int = 0, skip: NDArray[np.bool_] | None = None
) -> Iterator[Sample]:
    """Draw records one after the other, without simulating them.

    Parameters
    ----------
    recipe : Recipe
        See `load_recipe`.
    n : int, optional
        Number of records; by default the recipe's own.
    seed : int
        Seed of the data set, >= 0. A larger `n` with the same seed begins with the same records.
    skip : numpy.ndarray [shape=(n,)], optional
        Records to leave out.

    Yields
    ------
    Sample
        Samples in rising order of record number.

    Raises
    ------
    RecipeError
        If `n` or `seed` is out of bounds.
    SceneError
        If a drawn combination is not a valid scene.

    Notes
    -----
    The recipe's ``sampling`` determines how even the draws are, see
    :class:`~.recipe.sampling.Points`: those of machines over the machines, those of records,
    including severities, over the records. Machine and record are paired at random. Severities are
    log-uniform; with any sampling, every block of `STRATA` records holds one value of each severity
    in each of that many equal parts of its (logarithmic) range, in shuffled order, so that small
    sets are balanced.

    With a ``life`` the first severity is not drawn: a group is one machine over its life, its
    records in the order of time, see :class:`~.recipe.life.Lives`.

    Confounders occur with their probabilities, independently of each other except those that
    exclude each other. If one is absent, the scene keeps its own value.

    Examples
    --------
    >>> from wearstate.datasets.recipe.load import load_recipe
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
    """Source of the draws of one level."""

    axes: Sequence[Axis]
    points: Points
    copula: Copula | None

    def coordinates(self, number: int) -> dict[str, float]:
        """Coordinates in (0, 1) of one machine or record."""
        point = self.points.at(number)
        names = [entry for axis in self.axes for entry in axis.entries]
        return dict(
            zip(names, (point if self.copula is None else self.copula(point)).tolist(), strict=True)
        )

    def values(self, number: int, known: Mapping[str, float] | None = None) -> dict[str, Any]:
        """Values of one machine or record by path, at known or drawn coordinates."""
        at = {**self.coordinates(number), **(known or {})}
        return {axis.path: axis.value([at[entry] for entry in axis.entries]) for axis in self.axes}


def _sources(recipe: Recipe, seed: int) -> dict[str, _Source]:
    method = recipe.table.sampling
    # independent draws of a severity would leave a small set without some grades
    balanced: Sampling = "latin-hypercube" if method == "random" else method
    machine, record = (
        partial(recipe.rng, seed, stream) for stream in (MACHINE_STREAM, RECORD_STREAM)
    )
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
    """Dimensions of some draws, at these places in one Sobol sequence after the other."""
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
    """Coordinates of a machine that is the twin; none for one drawn by the recipe."""
    if recipe.twin is None:
        return {}
    rng = recipe.rng(seed, TWIN_STREAM, group)
    return recipe.twin.draw(rng) if rng.random() < recipe.twin.table.share else {}


def _choices(
    recipe: Recipe, group: int, index: int, seed: int, known: Mapping[str, float]
) -> dict[str, tuple[str, dict[str, Any]]]:
    """Option and scene values of every choice, by its manifest column."""
    streams = {"machine": (MACHINE_CHOICE_STREAM, group), "record": (RECORD_CHOICE_STREAM, index)}

    def at(per: str, word: str) -> float:
        if per == "machine" and word in known:
            return known[word]
        stream, number = streams[per]
        return float(recipe.rng(seed, stream, number, number_of(word)).random())

    return {each.column: each.take(partial(at, each.per)) for each in recipe.choices}


def _moment(recipe: Recipe, group: int, index: int, seed: int) -> Moment | None:
    """Moment in the life of its machine for a record; None if severities are drawn."""
    if recipe.lives is None:
        return None
    place = index - group * recipe.table.records_per_group
    machine, record = recipe.rng(seed, LIFE_STREAM, group), recipe.rng(seed, MOMENT_STREAM, index)
    return recipe.lives.moment(machine, record, place)


def _confounded(recipe: Recipe, group: int, index: int, seed: int) -> dict[str, dict[str, float]]:
    """Values of the confounders that are present, by name and path."""
    found = {}
    for word, members in recipe.confounders.items():
        which = group if members[0].table.per == "machine" else index
        left = recipe.rng(seed, PRESENCE_STREAM, number_of(word), which).random()
        for member in members:
            if 0 <= left < member.table.probability:
                key = (CONFOUNDER_STREAM, number_of(member.table.name), which)
                # the same number for every match of the path
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
