"""What a data set is drawn from: the recipe, validated, and its records, lazily.

Record `i` depends on the recipe's name, the seed and `i` alone: not on how many records there
are, in which order or where they are made.
"""

import difflib
import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..sim.parts import Part, Ratio, Scene, SceneError, validate_table
from ..sim.scene import override, scene_from_table, scene_table, scene_text
from ..sim.wear import grade

RECIPE_FOLDER = Path(__file__).parent / "recipes"

SEVERITIES = {"joint.crankpin.diametral_clearance": "diametral_clearance_crankpin_m"}
"""Manifest column of every scene value that says how worn a machine is. A new one is one row."""

CONDITIONS = {
    "speed_hz": "drive.speed",
    "discharge_pressure_pa": "pressure.discharge",
    "suction_pressure_pa": "pressure.suction",
    "start_angle_rad": "drive.start_angle",
}
"""Manifest column of every operating condition -> its place in the scene."""

STRATA = 16
"""Severities of each run of this many records fall in as many equal parts of the range."""

MOST_RECORDS = 10**8
"""Records of one data set: a decade of recordings, one every three seconds."""

LARGEST_SEED = 2**63 - 1
"""Seed of a data set: fits a signed integer in every file format."""

_MACHINE, _RECORD, _NOISE, _SEVERITY = range(4)  # independent random streams of one data set

Bound = float | str


class RecipeError(SceneError):
    """Every fault of one recipe, one line each."""


class Severity(Part):
    """What wears, log-uniform and continuous between two bounds."""

    path: str = Field(description="dotted path of the scene's value that wears")
    low: Bound = Field(description="as new")
    high: Bound = Field(description="1.5 times the condemning limit is the custom")


class Draw(Part):
    """One scene value, or every value that ``*`` matches, drawn independently."""

    path: str = Field(description="dotted path of the scene; * stands for every list entry")
    distribution: Literal["uniform", "log-uniform", "factor", "log-factor", "relative-normal"]
    low: Bound | None = None
    high: Bound | None = None
    bands: tuple[tuple[Bound, Bound], ...] = Field(
        default=(), description="several ranges instead of low and high, likely as they are wide"
    )
    scale: Ratio | None = Field(
        default=None,
        gt=0,
        le=10,
        description="relative-normal: norm of the change over the value's norm",
    )

    @model_validator(mode="after")
    def _one_way_to_say_it(self) -> Self:
        vector = self.distribution == "relative-normal"
        ends = [self.low is not None, self.high is not None]
        if vector and (self.scale is None or any(ends) or self.bands):
            raise ValueError(f"{self.path}: relative-normal takes scale and nothing else")
        if not vector and self.scale is not None:
            raise ValueError(f"{self.path}: scale is for relative-normal; give low and high")
        if not vector and (any(ends) == bool(self.bands) or any(ends) != all(ends)):
            raise ValueError(f"{self.path}: give low and high, or bands, and not both")
        return self

    @property
    def ranges(self) -> tuple[tuple[Bound, Bound], ...]:
        """Bands as written."""
        if self.low is not None and self.high is not None:
            return ((self.low, self.high),)
        return self.bands


class RecipeTable(Part):
    """The tables of a recipe file."""

    name: str = Field(min_length=1, max_length=64)
    description: str = ""
    scene: str = Field(min_length=1, description="a built-in scene or a file")
    records: int = Field(ge=1, le=MOST_RECORDS, description="records made unless told otherwise")
    records_per_group: int = Field(
        default=1, ge=1, le=MOST_RECORDS, description="records of each machine drawn"
    )
    fixed: dict[str, Bound | bool] = Field(
        default={}, description="scene values replaced in every record, by dotted path in quotes"
    )
    severity: Severity
    machine: tuple[Draw, ...] = Field(default=(), description="drawn once per group")
    record: tuple[Draw, ...] = Field(default=(), description="drawn for every record")


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
        Dotted path of the scene -> value drawn [SI].
    scene : Scene
        Validated.
    """

    index: int
    group: int
    seed: int
    row: dict[str, Any]
    drawn: dict[str, Any]
    scene: Scene


@dataclass(frozen=True)
class _Kind:
    """How a distribution reads its bounds."""

    relative: bool  # bounds multiply the scene's own value
    scale: Callable[[float], float]
    back: Callable[[float], float]


_KINDS = {
    "uniform": _Kind(False, float, float),
    "log-uniform": _Kind(False, math.log, math.exp),
    "factor": _Kind(True, float, float),
    "log-factor": _Kind(True, math.log, math.exp),
}


@dataclass(frozen=True)
class _Range:
    """A value drawn from bands, uniform in the scale of its kind."""

    path: str
    kind: _Kind
    bands: tuple[tuple[float, float], ...]  # [SI]

    def value(self, rng: np.random.Generator) -> float:
        scaled = [(self.kind.scale(low), self.kind.scale(high)) for low, high in self.bands]
        left = rng.random() * sum(high - low for low, high in scaled)
        for low, high in scaled:
            if left <= high - low:
                return self.kind.back(low + left)
            left -= high - low
        return self.bands[-1][1]

    def extremes(self) -> tuple[float, float]:
        return self.bands[0][0], self.bands[-1][1]


@dataclass(frozen=True)
class _Vector:
    """A table of numbers plus a random vector of given norm."""

    path: str
    base: Mapping[str, float]
    scale: float

    def value(self, rng: np.random.Generator) -> dict[str, float]:
        centre = np.array(list(self.base.values()))
        change = rng.standard_normal(centre.size)
        change *= self.scale * np.linalg.norm(centre) / np.linalg.norm(change)
        return dict(zip(self.base, (centre + change).tolist(), strict=True))

    def extremes(self) -> tuple[Mapping[str, float], Mapping[str, float]]:
        return self.base, self.base


_Axis = _Range | _Vector


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A validated recipe with the scene it varies; see `load_recipe`.

    Attributes
    ----------
    table : RecipeTable
        What the file says.
    text, scene_text : str
        TOML of recipe and scene.
    overrides : mapping
        What replaced values of the recipe file, by dotted path.
    base : dict
        Scene table with the fixed values in place.
    """

    table: RecipeTable
    text: str
    scene_text: str
    overrides: Mapping[str, Any]
    base: dict[str, Any]
    severity: _Range
    machine: tuple[_Axis, ...]
    record: tuple[_Axis, ...]

    @property
    def name(self) -> str:
        """Name of the recipe; part of every seed."""
        return self.table.name

    @property
    def severity_column(self) -> str:
        """Manifest column of the severity."""
        return SEVERITIES[self.table.severity.path]

    @cached_property
    def scene(self) -> Scene:
        """The scene before anything is drawn."""
        return scene_from_table(self.base)

    @cached_property
    def conditions(self) -> dict[str, str]:
        """Rows of `CONDITIONS` that this scene has."""
        return {name: path for name, path in CONDITIONS.items() if _has(self.scene, path)}

    def rng(self, seed: int, stream: int, index: int) -> np.random.Generator:
        """Random stream of one group or record, its own whatever else is drawn."""
        return np.random.default_rng(self._sequence(seed, stream, index))

    def _sequence(self, seed: int, stream: int, index: int) -> np.random.SeedSequence:
        # the name keeps two recipes with one seed from drawing the same machines
        name = int.from_bytes(hashlib.sha256(self.name.encode()).digest()[:8], "big")
        return np.random.SeedSequence([seed, name], spawn_key=(stream, index))

    def noise_seed(self, seed: int, index: int) -> int:
        """Seed of the sensor noise of one record."""
        state = self._sequence(seed, _NOISE, index).generate_state(1, np.uint64)
        return int(state[0])


def recipe_names() -> list[str]:
    """Names of the built-in recipes, sorted.

    Examples
    --------
    >>> "bilge-pump-standard" in recipe_names()
    True
    """
    return sorted(path.stem for path in RECIPE_FOLDER.glob("*.toml"))


def recipe_text(name_or_path: str | Path) -> str:
    """TOML text of a built-in recipe or of a file.

    Raises
    ------
    RecipeError
        There is neither; the nearest built-in one is named.
    """
    built_in = RECIPE_FOLDER / f"{name_or_path}.toml"
    path = built_in if built_in.is_file() else Path(name_or_path)
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):  # ValueError: no UTF-8, or a NUL in the name
        near = difflib.get_close_matches(str(name_or_path), recipe_names(), n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else f"choose one of {recipe_names()}"
        fault = f"{name_or_path} is no recipe and no readable text file; {hint}"
        raise RecipeError(str(name_or_path), [fault]) from None


def load_recipe(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> Recipe:
    """Load a built-in recipe or a TOML file, and check it against its scene.

    Parameters
    ----------
    name_or_path : str or Path
        A name of `recipe_names`, or a file.
    overrides : mapping, optional
        Dotted path of the scene -> value; set in every record like the recipe's ``[fixed]``.

    Returns
    -------
    Recipe
        Validated, with every bound in SI.

    Raises
    ------
    RecipeError
        Every fault at once: of the tables, of paths the scene does not have, of bounds the scene
        refuses.

    Examples
    --------
    >>> recipe = load_recipe("bilge-pump-small", {"duration": "1 s"})
    >>> recipe.table.records, recipe.scene.duration
    (120, 1.0)
    """
    text = recipe_text(name_or_path)
    try:
        table = validate_table(RecipeTable, scene_table(text), str(name_or_path))
        scene = scene_text(_beside(name_or_path, table.scene))
        base = scene_table(scene, table.scene)
    except SceneError as error:
        raise RecipeError(str(name_or_path), error.faults) from None
    faults: list[str] = []
    base = _with_fixed(base, {**table.fixed, **(overrides or {})}, faults)
    if faults:
        raise RecipeError(table.name, faults)
    severity = _severity(table.severity, base, faults)
    machine = _axes("machine", table.machine, base, faults)
    record = _axes("record", table.record, base, faults)
    faults += _path_clashes([severity, *machine, *record])
    if faults:
        raise RecipeError(table.name, faults)
    return Recipe(
        table=table,
        text=text,
        scene_text=scene,
        overrides=dict(overrides or {}),
        base=base,
        severity=severity,
        machine=tuple(machine),
        record=tuple(record),
    )


def _beside(recipe: str | Path, scene: str) -> str | Path:
    """A scene file is looked for beside the recipe file first."""
    path = Path(recipe).parent / scene
    return path if path.is_file() else scene


def _with_fixed(
    base: dict[str, Any], fixed: Mapping[str, Any], faults: list[str]
) -> dict[str, Any]:
    for pattern, value in fixed.items():
        try:
            base = override(base, dict.fromkeys(_matches(base, pattern), value))
            scene_from_table(base)
        except SceneError as error:
            faults += [f"fixed.{pattern}: {fault}" for fault in error.faults]
    return base


def _matches(base: Mapping[str, Any], pattern: str) -> list[str]:
    """Every path of the scene that a pattern with ``*`` stands for.

    Raises
    ------
    SceneError
        A ``*`` stands where the scene has no list.
    """
    found = [""]
    for key in pattern.split("."):
        if key != "*":
            found = [f"{path}.{key}".lstrip(".") for path in found]
            continue
        lists = {path: _node(base, path) for path in found}
        if not all(isinstance(node, list) for node in lists.values()):
            raise SceneError("path", [f"{pattern}: '*' stands where the scene has no list"])
        found = [f"{path}.{i}" for path, node in lists.items() for i in range(len(node))]
    return found


def _node(base: Any, path: str) -> Any:
    for key in path.split("."):
        inside = isinstance(base, list) and key.isdigit() and int(key) < len(base)
        base = base[int(key)] if inside else base.get(key) if isinstance(base, dict) else None
    return base


def _severity(table: Severity, base: dict[str, Any], faults: list[str]) -> _Range:
    draw = Draw(path=table.path, distribution="log-uniform", low=table.low, high=table.high)
    axes = _axes("severity", [draw], base, faults)
    if table.path not in SEVERITIES:
        known = ", ".join(SEVERITIES)
        faults.append(f"severity.path = {table.path!r} is no known severity; choose one of {known}")
    # a placeholder where the path itself is at fault, which is then reported
    return next((axis for axis in axes if isinstance(axis, _Range)), _NO_RANGE)


_NO_RANGE = _Range("", _KINDS["uniform"], ((0.0, 1.0),))


def _axes(
    where: str, draws: Sequence[Draw], base: dict[str, Any], faults: list[str]
) -> list[_Axis]:
    """Resolve draws against the scene; a fault of one does not hide those of the next."""
    axes: list[_Axis] = []
    for number, draw in enumerate(draws):
        place = where if where == "severity" else f"{where}.{number}"
        try:
            found = [_axis(draw, path, base) for path in _matches(base, draw.path)]
            _try_extremes(found, base)
            axes += found
        except SceneError as error:
            faults += [f"{place} ({draw.path}): {fault}" for fault in error.faults]
    return axes


def _axis(draw: Draw, path: str, base: dict[str, Any]) -> _Axis:
    if draw.distribution == "relative-normal":
        vector = _scene_value(base, path)
        if not isinstance(vector, Mapping) or not any(vector.values()):
            raise SceneError(path, [f"{path} is no table of numbers, as relative-normal needs"])
        return _Vector(path, vector, draw.scale or 0.0)
    kind = _KINDS[draw.distribution]
    if kind.relative:
        bands = _relative_bands(draw, path, base)
    else:
        bands = tuple((_in_si(base, path, a), _in_si(base, path, b)) for a, b in draw.ranges)
    _refuse_bands(path, bands, positive=kind.scale is math.log)
    return _Range(path, kind, bands)


def _relative_bands(draw: Draw, path: str, base: dict[str, Any]) -> tuple[tuple[float, float], ...]:
    value = _scene_value(base, path)
    if not isinstance(value, float) or value == 0:
        raise SceneError(path, [f"{path} = {value!r} must not be 0 to be multiplied; use uniform"])
    if any(isinstance(factor, str) for band in draw.ranges for factor in band):
        raise SceneError(path, [f"{path}: a factor takes plain numbers, like low = 0.9"])
    factors = tuple((float(low), float(high)) for low, high in draw.ranges)
    _refuse_bands(path, factors, positive=False)
    if value > 0:
        return tuple((value * low, value * high) for low, high in factors)
    return tuple((value * high, value * low) for low, high in reversed(factors))


def _refuse_bands(path: str, bands: tuple[tuple[float, float], ...], *, positive: bool) -> None:
    flat = [end for band in bands for end in band]
    rising = all(low < high for low, high in bands) and flat == sorted(flat)
    if not rising:
        shown = ", ".join(f"{low:g} to {high:g}" for low, high in bands)
        raise SceneError(path, [f"{path}: {shown} must rise and not overlap; reorder the bounds"])
    if positive and flat[0] <= 0:
        raise SceneError(path, [f"{path}: low = {flat[0]:g} must be > 0 for a logarithm; raise it"])


def _in_si(base: dict[str, Any], path: str, value: Bound) -> float:
    """Bound in SI, by letting the scene itself read it."""
    number = _scene_value(override(base, {path: value}), path)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        raise SceneError(path, [f"{path} = {number!r} is no number; draw one that is"])
    return float(number)


def _scene_value(base: dict[str, Any], path: str) -> Any:
    """Validated value at a dotted path; a path the scene lacks is refused in the scene's words."""
    scene = scene_from_table(base)
    if not _has(scene, path):
        scene_from_table(override(base, {path: 0.0}))  # names the nearest key
        raise SceneError(path, [f"{path} does not lead to a value; see the scene's own tables"])
    return _walk(scene, path)


def _walk(node: Any, path: str) -> Any:
    for key in path.split("."):
        if isinstance(node, Mapping):
            node = node[key]
        elif isinstance(node, tuple):
            node = node[int(key)]
        else:
            node = getattr(node, key)
    return node


def _has(scene: Scene, path: str) -> bool:
    try:
        _walk(scene, path)
    except (AttributeError, KeyError, IndexError, ValueError):
        return False
    return True


def _try_extremes(axes: Sequence[_Axis], base: dict[str, Any]) -> None:
    """Let the scene refuse bounds now rather than in the middle of a run."""
    for end in (0, 1):
        scene_from_table(override(base, {axis.path: axis.extremes()[end] for axis in axes}))


def _path_clashes(axes: Sequence[_Axis]) -> list[str]:
    paths = [axis.path for axis in axes]
    held = [path for path in paths if path in ("duration", "sample_rate")]
    return [f"{path} is drawn, must be one for all records; put it in [fixed]" for path in held] + [
        f"{path} is drawn {paths.count(path)} times, must be once; remove the others"
        for path in sorted(set(paths))
        if paths.count(path) > 1
    ]


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
    Severity is log-uniform. Every block of `STRATA` records holds one severity of each of that
    many equal parts of the (logarithmic) range, in random order and at a random place within its
    part, so that small sets are balanced. A golden-ratio sequence would be as even, but fixes
    the step between the records of one machine; here it is as good as random.

    Examples
    --------
    >>> sample = next(sample_records(load_recipe("bilge-pump-small"), seed=3))
    >>> sample.group, sorted(sample.row)[:2]
    (0, ['diametral_clearance_crankpin_m', 'discharge_pressure_pa'])
    """
    count = recipe.table.records if n is None else n
    if count < 1 or seed < 0:
        raise RecipeError(recipe.name, [f"n = {count} must be >= 1 and seed = {seed} must be >= 0"])
    for index in range(count):
        if skip is None or not skip[index]:
            yield _sample(recipe, index, seed)


def _sample(recipe: Recipe, index: int, seed: int) -> Sample:
    group = index // recipe.table.records_per_group
    machine, record = recipe.rng(seed, _MACHINE, group), recipe.rng(seed, _RECORD, index)
    drawn: dict[str, Any] = {axis.path: axis.value(machine) for axis in recipe.machine}
    drawn |= {axis.path: axis.value(record) for axis in recipe.record}
    drawn[recipe.severity.path] = _severity_value(recipe, index, seed)
    scene = scene_from_table(override(recipe.base, drawn))
    noise_seed = recipe.noise_seed(seed, index)
    row = {
        "record_id": f"{index:08d}",
        "group": group,
        "seed": noise_seed,
        "grade": _grade(scene, drawn[recipe.severity.path]),
        recipe.severity_column: drawn[recipe.severity.path],
        **{name: _walk(scene, path) for name, path in recipe.conditions.items()},
    }
    return Sample(index=index, group=group, seed=noise_seed, row=row, drawn=drawn, scene=scene)


def _severity_value(recipe: Recipe, index: int, seed: int) -> float:
    block, place = divmod(index, STRATA)
    rng = recipe.rng(seed, _SEVERITY, block)
    fraction = (rng.permutation(STRATA)[place] + rng.random(STRATA)[place]) / STRATA
    low, high = recipe.severity.bands[0]
    return math.exp(math.log(low) + fraction * math.log(high / low))


def _grade(scene: Scene, severity: float) -> int:
    wear = getattr(scene, "wear", None)
    return -1 if wear is None else grade(severity, wear.grade_edges_diametral)


def overrides_text(recipe: Recipe) -> str:
    """Overrides as JSON, for the file."""
    return json.dumps(dict(recipe.overrides), sort_keys=True)
