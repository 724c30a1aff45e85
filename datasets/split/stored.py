"""Splits stored in a data set file by name, and the default splits of generated files."""

import hashlib
import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ...sim.atomic import replacing
from ...sim.output.recording import DataError
from ..draws.draws import Range
from ..file.attributes import Attributes
from ..file.lock import holding
from ..file.record import DataSet
from ..file.writer import fill_split, lay_out_split, size_words
from ..recipe.load import recorded_recipe
from ..recipe.recipe import Recipe
from ..recipe.records import Sample, sample_records
from ..recipe.text import RecipeError
from .rules import Index, check_no_leak, group_split, region_split, time_split

LOADS = ("discharge_pressure_pa", "static_load_n", "thrust_n", "hull_deflection_m")
"""Manifest columns for the load of a machine; the first one present is used."""

HOURS = "operating_hours"
"""Manifest column of a run to failure."""

BEYOND = 0.8
"""By default, records in the largest fifth of a condition, severity or geometry are held out."""

TEST_FRACTION = 0.25
"""Default share of the machines held out."""

EARLY = 0.6
"""Default share of a life used for training; the rest is tested."""

_NAME = re.compile("[a-z0-9][a-z0-9_-]{0,63}")
_ROUNDING = 1e-9  # a redrawn value goes through the same conversion to text and back


@dataclass(frozen=True, kw_only=True, eq=False)
class Split:
    """Training and test records, and how they were chosen.

    Attributes
    ----------
    name : str
        Lower-case letters, digits, ``-`` and ``_``.
    kind : str
        Key of `KINDS`, ``region`` or ``declared``.
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Record numbers; a record may be in neither.
    text : str
        Readable description.
    about : mapping
        Its parameters for programs: ``seed``, ``bounds`` by column, shares.
    machines_apart : bool
        False if machines are on both sides by design.
    """

    name: str
    kind: str
    train: Index
    test: Index
    text: str
    about: Mapping[str, Any] = field(default_factory=dict)
    machines_apart: bool = True

    def sides(self, n_records: int) -> NDArray[np.int8]:
        """0 train, 1 test, -1 neither [shape=(n_records,)]."""
        found = np.full(n_records, -1, dtype=np.int8)
        found[self.train], found[self.test] = 0, 1
        return found

    def attribute(self) -> str:
        """All but the sides, as JSON for the file."""
        return json.dumps(
            {
                "kind": self.kind,
                "text": self.text,
                "machines_apart": self.machines_apart,
                **self.about,
            }
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """Data from which splits of a data set are made.

    Attributes
    ----------
    columns : mapping of str to numpy.ndarray [shape=(n_records,)]
        The manifest, as a data frame or a structured array.
    severity : str
        Column of the primary severity; empty if there is none.
    recipe : Recipe or None
        Recipe of the set; None for a measured set.
    seed : int
        Seed of the data set.
    """

    columns: Any
    severity: str = ""
    recipe: Recipe | None = None
    seed: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        plain = getattr(self.columns, "dtype", None)
        return tuple(map(str, getattr(plain, "names", None) or self.columns))

    @property
    def usable(self) -> Index:
        """Records whose simulation did not fail [shape=(n_usable,)]."""
        return np.flatnonzero(np.asarray(self.columns["status"]).astype("U") == "ok")

    def values(self, name: str) -> NDArray[Any]:
        """Column of the usable records [shape=(n_usable,)].

        Raises
        ------
        DataError
            If there is no such column, or it holds text.
        """
        if name not in self.names:
            raise DataError(f"column = {name!r} must be one of {', '.join(self.names)}; choose one")
        found = np.asarray(self.columns[name])[self.usable]
        if found.dtype.kind not in "biuf":
            raise DataError(f"column = {name!r} holds text, must hold numbers; choose another")
        return found

    @property
    def groups(self) -> NDArray[Any]:
        """Machine of the usable records [shape=(n_usable,)]."""
        return self.values("group")


def machine_draws(drawn: Drawn) -> tuple[str, NDArray[np.float64]]:
    """A parameter of the machine that the manifest lacks, redrawn from recipe and seed.

    Parameters
    ----------
    drawn : Drawn
        Data of a generated set.

    Returns
    -------
    path : str
        Path of the first number that is drawn once per machine and is not a condition.
    values : numpy.ndarray [shape=(n_records,)]
        Values [unit of the scene's value].

    Raises
    ------
    DataError
        If nothing is drawn per machine, or the draw differs from the file.
    """
    recipe = drawn.recipe
    known = () if recipe is None else tuple(recipe.conditions.values())
    axes = [] if recipe is None else [axis for axis in recipe.machine if isinstance(axis, Range)]
    path = next((axis.path for axis in axes if axis.path not in known), None)
    if recipe is None or path is None:
        raise DataError("geometry: 0 numbers are drawn per machine, must be >= 1; use region")
    # not `sample_records`, each of whose samples holds a scene
    by_group = {sample.group: float(sample.drawn[path]) for sample in machine_samples(drawn)}
    groups = np.asarray(drawn.columns["group"]).tolist()
    return path, np.array([by_group[group] for group in groups])


def machine_samples(drawn: Drawn) -> Iterator[Sample]:
    """First record of each machine, redrawn from recipe and seed.

    Parameters
    ----------
    drawn : Drawn
        Data of a generated set.

    Yields
    ------
    Sample
        Samples in rising order of record number.

    Raises
    ------
    DataError
        If there is no recipe, or the draw differs from the file.
    """
    if drawn.recipe is None:
        raise DataError("recipe: the file has none that can draw its machines again; use region")
    groups = np.asarray(drawn.columns["group"])
    others = np.ones(groups.size, dtype=bool)
    others[np.unique(groups, return_index=True)[1]] = False
    for sample in sample_records(drawn.recipe, groups.size, seed=drawn.seed, skip=others):
        _refuse_other_draw(drawn, sample)
        yield sample


def _refuse_other_draw(drawn: Drawn, sample: Sample) -> None:
    held = float(drawn.columns[drawn.severity][sample.index])
    value, group = sample.row[drawn.severity], int(drawn.columns["group"][sample.index])
    if abs(value - held) > _ROUNDING * abs(value) or sample.group != group:
        raise DataError(
            f"geometry: record {sample.index} redrawn has {drawn.severity} = {value:g}, must be "
            f"{held:g} as in the file; it is of another version of wearstate: split with that one, "
            "or generate it again"
        )


# --- one function for each kind of split; all take a Drawn and return a split or refuse


def _machine(drawn: Drawn, *, share: float = TEST_FRACTION, seed: int | None = None) -> Split:
    seed = drawn.seed if seed is None else seed
    train, test = group_split(drawn.groups, test_fraction=share, seed=seed)
    return Split(
        name="machine",
        kind="machine",
        train=drawn.usable[train],
        test=drawn.usable[test],
        text=f"{share:.0%} of the machines, drawn at random, are tested",
        about={"seed": seed, "share": share},
    )


def _region(
    drawn: Drawn,
    bounds: Mapping[str, tuple[float, float]],
    *,
    name: str = "region",
    kind: str = "region",
    extra: Mapping[str, NDArray[Any]] | None = None,
) -> Split:
    """Records within all bounds are tested; `extra` are columns that the manifest lacks."""
    columns = {
        column: (extra or {})[column][drawn.usable]
        if column in (extra or {})
        else drawn.values(column)
        for column in bounds
    }
    train, test = region_split(columns, bounds, groups=drawn.groups)
    ranges = " and ".join(_range_text(column, *ends) for column, ends in bounds.items())
    return Split(
        name=name,
        kind=kind,
        train=drawn.usable[train],
        test=drawn.usable[test],
        text=f"records with {ranges} are tested; other records of their machines are in neither",
        about={"bounds": {c: [_finite(end) for end in ends] for c, ends in bounds.items()}},
    )


def _range_text(column: str, low: float, high: float) -> str:
    if np.isinf(high):
        return f"{column} >= {low:.6g}"
    return f"{column} <= {high:.6g}" if np.isinf(low) else f"{column} = {low:.6g} to {high:.6g}"


def _finite(end: float) -> float | None:
    return None if np.isinf(end) else float(end)  # JSON has no infinity


def _beyond(drawn: Drawn, kind: str, choices: Sequence[str]) -> Split:
    """Extrapolation: the largest values of a column are tested, all lower ones are for training."""
    column = next((name for name in choices if name in drawn.names), None)
    if column is None:
        raise DataError(f"{kind}: the manifest has none of {', '.join(choices)}; use region")
    return _region(drawn, {column: _largest(drawn.values(column))}, name=kind, kind=kind)


def _largest(values: NDArray[Any]) -> tuple[float, float]:
    """Bounds of the values to hold out."""
    if values.size == 0:
        raise DataError(
            "0 records are usable, must be >= 1: all failed; see the manifest's status for why"
        )
    return float(np.quantile(values, BEYOND)), np.inf


def _severity(drawn: Drawn) -> Split:
    if not drawn.severity:
        raise DataError("severity: the data set has no severity, must have one; use region")
    return _beyond(drawn, "severity", (drawn.severity,))


def _geometry(drawn: Drawn) -> Split:
    path, values = machine_draws(drawn)
    bounds = {path: _largest(values[drawn.usable])}
    return _region(drawn, bounds, name="geometry", kind="geometry", extra={path: values})


def _time(drawn: Drawn, *, apart: bool, share: float = EARLY, seed: int | None = None) -> Split:
    if HOURS not in drawn.names:
        raise DataError(f"time: the manifest has no {HOURS}, must be of a run to failure")
    seed = drawn.seed if seed is None else seed
    fraction = TEST_FRACTION if apart else None
    train, test = time_split(
        drawn.values(HOURS), drawn.groups, early=share, test_fraction=fraction, seed=seed
    )
    whose = "other machines'" if apart else "the same machines'"
    name = "time-other-machines" if apart else "time-same-machines"
    return Split(
        name=name,
        kind=name,
        train=drawn.usable[train],
        test=drawn.usable[test],
        text=f"the first {share:.0%} of lives train, {whose} later records are tested",
        about={"early": share, **({"seed": seed, "share": fraction} if apart else {})},
        machines_apart=apart,
    )


KINDS: dict[str, Callable[..., Split]] = {
    "machine": _machine,
    "speed": partial(_beyond, kind="speed", choices=("speed_hz",)),
    "load": partial(_beyond, kind="load", choices=LOADS),
    "severity": _severity,
    "geometry": _geometry,
    "time-same-machines": partial(_time, apart=False),
    "time-other-machines": partial(_time, apart=True),
}
"""Function that makes each kind of split. A new one is one row."""

SEEDED = ("machine", "time-same-machines", "time-other-machines")
"""Kinds that take a share and a seed."""


def split_names(recipe: Recipe) -> tuple[str, ...]:
    """Names of the splits that a data set of this recipe may have; space is reserved for them.

    Examples
    --------
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> "machine" in split_names(load_recipe("bilge-pump-small"))
    True
    """
    declared = [region.name for region in recipe.held_out]
    life = [] if HOURS in recipe.columns else [name for name in KINDS if name.startswith("time-")]
    return tuple(dict.fromkeys([*(name for name in KINDS if name not in life), *declared]))


def default_splits(drawn: Drawn) -> dict[str, Split]:
    """All splits that the data set has the records for, and those its recipe declares.

    Parameters
    ----------
    drawn : Drawn
        Manifest and recipe.

    Returns
    -------
    dict of str to Split
        Splits by name. A declared split replaces a kind of the same name. A split with an empty
        side is left out.
    """
    makers = dict(KINDS)
    for region in drawn.recipe.held_out if drawn.recipe else ():
        makers[region.name] = partial(
            _region, bounds=region.bounds, name=region.name, kind="declared"
        )
    found = {}
    for name, make in makers.items():
        try:
            found[name] = make(drawn)
        except DataError:  # too few machines, a column that does not vary, or not a run to failure
            continue
    return found


def make_split(
    drawn: Drawn,
    kind: str,
    *,
    name: str | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    share: float | None = None,
    seed: int | None = None,
) -> Split:
    """One split with given parameters.

    Parameters
    ----------
    drawn : Drawn
        Manifest and recipe.
    kind : str
        Key of `KINDS`, or ``region``.
    name : str, optional
        Name under which it is stored; by default its kind.
    bounds : mapping, optional
        Range (low, high) by column, for a region; a held-out record lies in all of them.
    share : float, optional
        Share of the machines to test, or of a life used for training.
    seed : int, optional
        Seed of the choice of machines; by default that of the data set.

    Returns
    -------
    Split

    Raises
    ------
    DataError
        If the arguments do not fit the kind, or a side would be empty.
    """
    faults = []
    if kind not in KINDS and kind != "region":
        faults.append(f"kind = {kind!r} must be one of {', '.join(KINDS)}, region; choose one")
    if bool(bounds) != (kind == "region"):
        faults.append(f"{kind}: bounds are for region, which needs them; give column, low or high")
    if kind not in SEEDED and (share is not None or seed is not None):
        faults.append(f"{kind}: share and seed are for {', '.join(SEEDED)}; leave them out")
    if not _NAME.fullmatch(name or kind):
        faults.append(f"name = {name!r} must be lower-case letters, digits, - and _; rename it")
    if faults:
        raise DataError("\n".join(faults))
    if bounds:
        made = _region(drawn, bounds)
    else:
        given = {"share": share, "seed": seed}
        made = KINDS[kind](drawn, **{key: v for key, v in given.items() if v is not None})
    return replace(made, name=name or kind)


def drawn_of(data: DataSet) -> Drawn:
    """Data for the splits of a finished file.

    Parameters
    ----------
    data : DataSet
        Simulated or measured.

    Returns
    -------
    Drawn
        Without a recipe if that of the file can no longer be read.
    """
    head = data.attributes
    return Drawn(
        columns=data.manifest,
        severity=head.severities[0] if head.severities else "",
        recipe=_recorded(head),
        seed=head.seed,
    )


def _recorded(head: Attributes) -> Recipe | None:
    """Recipe of a data set; None if there is none, or it is of another version."""
    try:
        return recorded_recipe(head.scene, head.recipe, head.overrides) if head.recipe else None
    except RecipeError:
        return None


@dataclass(frozen=True, kw_only=True, eq=False)
class Sides:
    """A stored split, as rows of the table of a data set's usable records.

    Attributes
    ----------
    name, text : str
        Name and description of the split.
    train, test : numpy.ndarray [shape=(n_train,)], [shape=(n_test,)]
        Rows, rising; each side has at least one.
    machines_apart : bool
        False if machines are on both sides by design.
    sha256 : str
        Hash of the sides and the signals' checksums: equal hashes mean equal train and test
        records.
    """

    name: str
    text: str
    train: Index
    test: Index
    machines_apart: bool
    sha256: str


def usable_sides(data: DataSet, name: str) -> Sides:
    """Usable records of a stored split.

    Parameters
    ----------
    data : DataSet
    name : str
        Name of the split.

    Returns
    -------
    Sides

    Raises
    ------
    DataError
        If there is no such split, a machine is on both sides unintentionally, or a side has no
        usable record.
    """
    train, test = data.split(name)
    about, manifest = data.splits[name], data.manifest
    apart = bool(about.get("machines_apart", True))
    if apart:
        check_no_leak(manifest["group"], train, test)
    usable = np.flatnonzero((manifest["status"] == "ok").to_numpy())
    rows = [np.flatnonzero(np.isin(usable, side)) for side in (train, test)]
    if not all(side.size for side in rows):
        raise DataError(
            f"{data.path}: split {name} trains on {rows[0].size} and tests on {rows[1].size} "
            "usable records, must be >= 1 each; add another with wearstate splits"
        )
    parts = (train, test, manifest["signal_crc32"])
    digest = b"|".join(np.asarray(part, dtype="<i8").tobytes() for part in parts)
    return Sides(
        name=name,
        text=str(about.get("text", "")) or f"as the file's split {name}",
        train=rows[0],
        test=rows[1],
        machines_apart=apart,
        sha256=hashlib.sha256(digest).hexdigest(),
    )


def store_splits(path: str | Path, splits: Sequence[Split], *, force: bool = False) -> None:
    """Add splits to a finished file; signal and manifest are not changed.

    The file is copied and the copy renamed, so that it is complete at any time. Only one run at a
    time may do so, since the other's splits would be lost.

    Parameters
    ----------
    path : str or Path
        Data set.
    splits : sequence of Split
        Splits of its records.
    force : bool
        Replace splits of the same name.

    Raises
    ------
    DataError
        If the file cannot be read, has splits of these names, another run writes it, or its folder
        has no room.
    """
    place = Path(path).absolute()
    with DataSet(place) as data:
        n_records = len(data)
    with holding(place):
        _store(place, splits, n_records, force)


def _store(place: Path, splits: Sequence[Split], n_records: int, force: bool) -> None:
    with DataSet(place) as data:
        there = data.splits
    twice = sorted(split.name for split in splits if split.name in there)
    if twice and not force:
        raise DataError(
            f"{place}: split {', '.join(twice)} is stored already; use force to replace it, or "
            "another name"
        )
    size, free = place.stat().st_size, shutil.disk_usage(place.parent).free
    if size > free:
        raise DataError(
            f"{place.parent}: {size_words(free)} are free, must be >= {size_words(size)} for a "
            "copy; make room"
        )
    with replacing(place, force=True) as fresh:
        shutil.copy(place, fresh)
        with h5py.File(fresh, "r+") as file:
            for split in splits:
                lay_out_split(file, split.name, n_records)
                fill_split(file, split.name, split.sides(n_records), split.attribute())
