"""Axes of a sweep: numbers of a scene by dotted path, as ranges or lists with their unit."""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from ...datasets.draws.draws import value_at
from ...sim.parts.wording import si_unit
from ...sim.scene.load import load_scene, numbered, scene_table, scene_text
from ...sim.scene.scene import Scene, SceneError
from ..charts.words import effect_words
from ..pages.si_text import plain

MOST_AXES = 3
"""Largest number of axes: the last is the change to be detected, the others are conditions."""

MOST_POINTS = 10_000
"""Largest number of points of the grid."""

_NUMBER = r"[-+]?(?:[0-9]+(?:\.(?!\.)[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_RANGE = re.compile(rf"({_NUMBER})\s*(.*?)\.\.\s*({_NUMBER})(?:/([0-9]+))?\s*(.*?)(?:/([0-9]+))?")
_ENTRY = re.compile(rf"({_NUMBER})\s*(.*)")
_FEWEST = 2


class SweepError(ValueError):
    """All faults of the request for a sweep, one line each."""

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = list(dict.fromkeys(faults))
        super().__init__("\n".join(self.faults))

    def __reduce__(self) -> tuple[type[Self], tuple[list[str]]]:
        """How it leaves a worker process."""
        return type(self), (self.faults,)


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One number of a scene, and the values that it takes.

    Attributes
    ----------
    path : str
        Dotted path in the scene.
    numbers : tuple of float
        Values as given, in `unit`.
    unit : str
        Unit as given; empty for bare numbers, which are SI.
    values : tuple of float
        Values in SI; empty until the scene has been read.
    si_unit : str
    """

    path: str
    numbers: tuple[float, ...]
    unit: str
    values: tuple[float, ...] = ()
    si_unit: str = ""

    def given(self, i: int) -> float | str:
        """Value as an override of a scene."""
        number = self.numbers[i]
        if self.unit:
            return f"{number!r} {self.unit}"
        return int(number) if number.is_integer() else number

    def text(self, number: float, digits: int = 6) -> str:
        """A number in the unit of the axis, with the unit."""
        return f"{plain(number, digits)} {self.unit or self.si_unit}".rstrip()

    @property
    def scale(self) -> float:
        """Factor from the unit as given to SI."""
        pairs = zip(self.numbers, self.values, strict=True)
        return next((value / number for number, value in pairs if number and value), 1.0)

    @property
    def words(self) -> str:
        """Name for a sentence: ``crank pin diametral clearance``.

        Examples
        --------
        >>> Axis(path="joint.crankpin.diametral_clearance", numbers=(1.0,), unit="mm").words
        'crank pin diametral clearance'
        >>> Axis(path="drive.speed", numbers=(1.0,), unit="rpm").words
        'speed'
        """
        *above, last = self.path.split(".")
        part = effect_words(above[-1]) if above and above[-1] not in _PLAIN else ""
        if len(above) > 1 and above[-1].isdecimal():
            part = f"{above[-2]}.{above[-1]}"
        return f"{part} {last.replace('_', ' ')}".strip()


_PLAIN = ("drive", "load", "pressure")  # tables that a sentence need not name


def parse_axis(text: str, points: int = 5) -> Axis:
    """Axis from ``PATH=A..B[UNIT]``, ``PATH=A..B/N[UNIT]`` or ``PATH=A,B,C[UNIT]``.

    Parameters
    ----------
    text : str
        The unit is given once at the end, or after each number.
    points : int
        Number of points of a range without its own.

    Raises
    ------
    SweepError
        The text cannot be read, has only one value, or values that neither rise nor fall.

    Examples
    --------
    >>> parse_axis("drive.speed=200..400rpm", 3).numbers, parse_axis("a.b=.1,.2,.3mm").unit
    ((200.0, 300.0, 400.0), 'mm')
    >>> parse_axis("drive.speed=200..400/2 rpm").numbers
    (200.0, 400.0)
    """
    path, sign, values = text.partition("=")
    path = path.strip()
    if not sign or not path or not values.strip():
        raise SweepError([f"'{text}' must read PATH=A..B, PATH=A..B/N or PATH=A,B,C, with a unit"])
    numbers, units = _read(path, values.strip(), points)
    named = list(dict.fromkeys(unit for unit in units if unit))
    faults = []
    if len(named) > 1:
        faults.append(f"{path} has units {', '.join(named)}, must have one; write it at the end")
    steps = np.diff(numbers)
    if len(numbers) < _FEWEST:
        faults.append(f"{path} has {len(numbers)} value, must have >= {_FEWEST}; or use --set")
    elif not ((steps > 0).all() or (steps < 0).all()):
        faults.append(f"{path} = {values.strip()} must rise or fall throughout; sort the values")
    if faults:
        raise SweepError(faults)
    return Axis(path=path, numbers=tuple(numbers), unit=named[0] if named else "")


def _read(path: str, text: str, points: int) -> tuple[list[float], list[str]]:
    if ".." in text:
        found = _RANGE.fullmatch(text)
        if found is None:
            raise SweepError([f"{path} = {text} must read A..B or A..B/N, with a unit at the end"])
        low, first, high, inside, last, at_end = found.groups()
        count = int(inside or at_end or points)
        if not _FEWEST <= count <= MOST_POINTS:
            fault = f"{path} = {text} has {count} points, must have {_FEWEST} to {MOST_POINTS}"
            raise SweepError([f"{fault}; give another number after the slash"])
        between = np.linspace(float(low), float(high), count)
        return [float(f"{number:.12g}") for number in between], [first.strip(), last.strip()]
    entries = [_ENTRY.fullmatch(entry.strip()) for entry in text.split(",")]
    bad = [raw for raw, entry in zip(text.split(","), entries, strict=True) if entry is None]
    if bad:
        raise SweepError(
            [f"{path}: {', '.join(map(repr, bad))} must be a number; a unit may follow"]
        )
    matches = [entry for entry in entries if entry is not None]
    return [float(e[1]) for e in matches], [e[2].strip() for e in matches]


Point = tuple[int, ...]
"""Index of the value of each axis."""


def grid(axes: Sequence[Axis]) -> Iterator[Point]:
    """All combinations, with the last axis varying fastest."""
    return itertools.product(*(range(len(axis.numbers)) for axis in axes))


def read_axes(
    subject: str, given: Mapping[str, Any], texts: Sequence[str], points: int
) -> tuple[tuple[Axis, ...], dict[Point, Scene]]:
    """Axes with their values in SI, and the scene of every point of their grid.

    Parameters
    ----------
    subject : str
        Built-in scene, or file.
    given : mapping of str to object
        Values that replace those of the scene at every point.
    texts : sequence of str
        As in :func:`parse_axis`.
    points : int
        Number of points of a range without its own.

    Raises
    ------
    SweepError
        An axis cannot be read, is not a number of the scene, or is rejected by it; all at once.
    SceneError
        The scene itself is invalid.
    """
    load_scene(subject, given)
    table = scene_table(scene_text(subject), subject)
    given = {numbered(table, path): value for path, value in given.items()}
    axes, faults = _parsed(texts, points)
    axes = [replace(axis, path=numbered(table, axis.path)) for axis in axes]
    faults += _clashes([axis.path for axis in axes], given)
    sound = []
    for axis in axes:
        own = _axis_faults(subject, given, axis)
        faults += own
        if not own:
            sound.append(axis)
    if faults:
        raise SweepError(faults)
    scenes, faults = {}, []
    for point in grid(axes):
        changes = {axis.path: axis.given(i) for axis, i in zip(axes, point, strict=True)}
        try:
            scenes[point] = load_scene(subject, {**given, **changes})
        except SceneError as error:
            faults += error.faults
    if faults:
        raise SweepError(faults)
    return tuple(_in_si(axis, n, scenes) for n, axis in enumerate(axes)), scenes


def _parsed(texts: Sequence[str], points: int) -> tuple[list[Axis], list[str]]:
    axes, faults = [], []
    for text in texts:
        try:
            axes.append(parse_axis(text, points))
        except SweepError as error:
            faults += error.faults
    return axes, faults


def _clashes(paths: Sequence[str], given: Mapping[str, Any]) -> list[str]:
    faults = [
        f"{path} is swept {paths.count(path)} times, must be once; leave one out"
        for path in dict.fromkeys(paths)
        if paths.count(path) > 1
    ]
    faults += [f"{path} is both set and swept; leave one out" for path in paths if path in given]
    if "drive.start_angle" in paths:
        faults.append("drive.start_angle already differs between starts; use --starts")
    if len(paths) > MOST_AXES:
        faults.append(f"{len(paths)} axes are swept, must be <= {MOST_AXES}; fix some by --set")
    return faults


def _axis_faults(subject: str, given: Mapping[str, Any], axis: Axis) -> list[str]:
    """Faults of the values of one axis."""
    faults: list[str] = []
    for i in range(len(axis.numbers)):
        try:
            value = value_at(load_scene(subject, {**given, axis.path: axis.given(i)}), axis.path)
        except SceneError as error:
            faults += error.faults
            continue
        if isinstance(value, bool) or not isinstance(value, int | float):
            faults.append(f"{axis.path} is not a number of the scene; sweep a number")
    return faults


def _in_si(axis: Axis, place: int, scenes: Mapping[Point, Scene]) -> Axis:
    """Axis with its values in SI, as read by the scene."""
    found = {point[place]: value_at(scene, axis.path) for point, scene in scenes.items()}
    return Axis(
        path=axis.path,
        numbers=axis.numbers,
        unit=axis.unit,
        values=tuple(float(found[i]) for i in range(len(axis.numbers))),
        si_unit=si_unit(type(next(iter(scenes.values()))), axis.path),
    )
