"""Discrete draws of a recipe: one option among several, with its own values and draws."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from ...sim.parts.dimensions import Ratio
from ...sim.parts.part import Part
from ...sim.scene.load import override, scene_from_table
from ...sim.scene.scene import SceneError
from .draws import Axis, Bound, Draw, axes_of, matches

_WORD = "^[a-z][a-z0-9_-]*$"
_LONGEST = 32  # characters of an option's name, in the manifest


class Option(Part):
    """One variant of a machine: scene values that belong together."""

    name: str = Field(pattern=_WORD, max_length=_LONGEST, description="name in the manifest")
    weight: Ratio = Field(
        default=1.0, gt=0, description="probability relative to the other options"
    )
    values: dict[str, Bound | bool] = Field(
        default={}, description="scene values it sets, by dotted path in quotes"
    )
    draw: tuple[Draw, ...] = Field(default=(), description="scene values drawn with this option")


class OptionSet(Part):
    """A choice that cannot be settled for the machine: a law, a rung, a condition."""

    name: str = Field(pattern="^[a-z][a-z0-9_]*$", max_length=48, description="name of its column")
    per: Literal["machine", "record"] = Field(
        default="machine",
        description="whether a machine keeps its option, or every record draws its own",
    )
    option: tuple[Option, ...] = Field(
        min_length=2, description="the alternatives, each with its weight"
    )

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [option.name for option in self.option]
        if len(set(names)) < len(names):
            raise ValueError(f"options of {self.name} = {', '.join(names)} must differ; rename one")
        return self


@dataclass(frozen=True, kw_only=True)
class Taken:
    """An option resolved against its scene.

    Attributes
    ----------
    name : str
    share : float
        Probability.
    values : mapping
        Scene values by dotted path.
    axes : tuple of Axis
        Draws of the option.
    """

    name: str
    share: float
    values: Mapping[str, Any]
    axes: tuple[Axis, ...]

    @property
    def paths(self) -> set[str]:
        """Paths of the scene values that it determines."""
        return {*self.values, *(axis.path for axis in self.axes)}


@dataclass(frozen=True, kw_only=True)
class Alternatives:
    """An option set resolved against its scene.

    Attributes
    ----------
    name : str
    per : str
        ``machine`` or ``record``.
    options : tuple of Taken
    """

    name: str
    per: str
    options: tuple[Taken, ...]

    @property
    def column(self) -> str:
        """Manifest column of the option's name."""
        return f"choice_{self.name}"

    @property
    def paths(self) -> set[str]:
        """Paths of the scene values that any option determines."""
        return {path for option in self.options for path in option.paths}

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of its coordinates: that of the option, then those of the options' draws."""
        entries = [e for option in self.options for axis in option.axes for e in axis.entries]
        return (self.name, *dict.fromkeys(f"{self.name}.{entry}" for entry in entries))

    def take(self, at: Callable[[str], float]) -> tuple[str, dict[str, Any]]:
        """Name and scene values of the option of one machine or record.

        Parameters
        ----------
        at : callable
            Number in (0, 1) for every name in `coordinates`. An option's draws do not depend on the
            other options.
        """
        left = at(self.name)
        chosen = self.options[-1]
        for option in self.options:
            if left < option.share:
                chosen = option
                break
            left -= option.share
        drawn = {
            axis.path: axis.value([at(f"{self.name}.{entry}") for entry in axis.entries])
            for axis in chosen.axes
        }
        return chosen.name, {**chosen.values, **drawn}


def alternatives_of(
    sets: Sequence[OptionSet], base: Mapping[str, Any], faults: list[str]
) -> tuple[Alternatives, ...]:
    """Resolve option sets against the scene.

    Parameters
    ----------
    sets : sequence of OptionSet
    base : mapping
        Table of the scene.
    faults : list of str
        List to which faults are added: options that the scene refuses, with their draws; values
        determined twice.

    Returns
    -------
    tuple of Alternatives
    """
    found = tuple(_resolved(each, f"choice.{i}", base, faults) for i, each in enumerate(sets))
    names = [each.name for each in sets]
    faults += [
        f"choice name '{name}' is given {names.count(name)} times, must be unique; rename one"
        for name in sorted({name for name in names if names.count(name) > 1})
    ]
    return found


def _resolved(
    given: OptionSet, place: str, base: Mapping[str, Any], faults: list[str]
) -> Alternatives:
    total = sum(option.weight for option in given.option)
    options = []
    for i, option in enumerate(given.option):
        here = f"{place}.option.{i}"
        try:
            values = _values(option, base)
            with_it = override(base, values)
            scene_from_table(with_it)
        except SceneError as error:
            faults += [f"{here} ({option.name}): {fault}" for fault in error.faults]
            continue
        draws = {f"{here}.draw.{k}": draw for k, draw in enumerate(option.draw)}
        axes = axes_of(draws, with_it, faults)
        flat = tuple(axis for found in axes.values() for axis in found)
        options.append(
            Taken(name=option.name, share=option.weight / total, values=values, axes=flat)
        )
    return Alternatives(name=given.name, per=given.per, options=tuple(options))


def _values(option: Option, base: Mapping[str, Any]) -> dict[str, Any]:
    return {
        path: value for pattern, value in option.values.items() for path in matches(base, pattern)
    }
