"""Content of a MATLAB file of any kind, and the parts made of it: names, shapes, layouts."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from ...sim.output.recording import DataError
from ..source.part import Contents, Fetch, FilePart, PartChannel, SourceOptions
from ..source.rate_name import RateNote, is_rate_name, rate_note
from .flat import Axes, Flat, array_axes, numbered

POUND_FORCE = 4.4482216152605
"""[N], exact: international pound times standard gravity."""

UNIT_NAMES = ("unit", "units", "Unit", "Units")
"""Names under which files keep the unit of an array."""

MOST_LEAVES = 10_000
"""Largest number of arrays, fields and cells in one file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Leaf:
    """A variable, a field or a cell.

    Attributes
    ----------
    shape : tuple of int
        Shape as in MATLAB.
    kind : str
        Kind of content.
    reader : callable, optional
        For an array: function that reads it, given the assignment of its axes.
    text : str
        Content of a short text.
    members : tuple of mapping
        Fields of every element of a struct; for a cell array, one nameless field.
    """

    shape: tuple[int, ...]
    kind: Literal["numeric", "struct", "cell", "text", "complex", "sparse", "object"]
    reader: Callable[[Axes], Fetch] | None = None
    text: str = ""
    members: tuple[Mapping[str, "Leaf"], ...] = field(default=())

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)

    def scalar(self) -> float | None:
        """One number, also if stored as text; None for anything else."""
        try:
            if self.kind == "text":
                return float(self.text)
            if self.reader is None or self.size != 1:
                return None
            one = Axes(record=None, channels_first=True, n_channels=1, n_samples=1)
            return float(self.reader(one)(0, 1, (0,))[0, 0])
        except ValueError:
            return None


Tree = dict[str, Leaf]
"""Variables by name."""


def fetch_of(column_major: Flat, axes: Axes) -> Fetch:
    """Function that reads an array whose first index runs fastest.

    Parameters
    ----------
    column_major : Flat
        All its numbers, one after the other.
    axes : Axes
        Assignment of its axes.
    """
    return replace(
        column_major,
        n_channels=axes.n_channels,
        n_samples=axes.n_samples,
        interleaved=axes.channels_first,
    ).fetch


@dataclass(frozen=True, kw_only=True)
class MatLayout:
    """Layout of a known data set whose numbers are all fields of one struct.

    Attributes
    ----------
    name : str
        Name of the data set, for messages.
    struct, signal, sample_rate : str
        Names of the struct and its fields.
    unit : str
        Unit of the signal, by the documentation of the data set.
    conditions : dict
        Manifest column and factor to SI, by field.
    """

    name: str
    struct: str
    signal: str
    sample_rate: str
    unit: str
    conditions: Mapping[str, tuple[str, float]]


MAT_LAYOUTS = (
    MatLayout(
        name="MFPT bearing fault data set",
        struct="bearing",
        signal="gs",
        sample_rate="sr",
        unit="g",
        conditions={"rate": ("speed_hz", 1.0), "load": ("load_n", POUND_FORCE)},
    ),
)
"""A new layout is one row."""


def tree_contents(path: Path, tree: Tree, options: SourceOptions) -> Contents:
    """Parts of a MATLAB file: its arrays of real numbers, a known layout first.

    Raises
    ------
    DataError
        If a known layout has impossible values, or the requested array is not a single recording.
    """
    named = dict(_named(path, tree))
    known = None if options.variables else _known(path, tree, options)
    structs = _by_struct(named)
    parts, others = [], []
    for name, leaf in named.items():
        if known is not None and name == known.name:
            continue
        found = _part(path, name, leaf, options)
        if isinstance(found, FilePart):
            parts.append(_with_sibling_fields(found, structs))
        elif found:
            others.append(found)
    return Contents(parts=tuple([known, *parts] if known else parts), others=tuple(others))


def _named(path: Path, tree: Tree) -> Iterator[tuple[str, Leaf]]:
    """Leaves under their MATLAB names: ``a``, ``s.a``, ``s(2).a``, ``c{3}``."""
    count = 0
    queue = list(reversed(tree.items()))
    while queue:
        name, leaf = queue.pop()
        count += 1
        if count > MOST_LEAVES:
            raise DataError(f"{path} holds > {MOST_LEAVES} arrays, too many; split it")
        if not leaf.members:
            yield name, leaf
        inner = [
            (_member(name, leaf, i, key), value)
            for i, row in enumerate(leaf.members, start=1)
            for key, value in row.items()
        ]
        queue += reversed(inner)


def _by_struct(named: Mapping[str, Leaf]) -> dict[str, dict[str, Leaf]]:
    """Leaves by the struct to which they belong as fields, and by field name."""
    found: dict[str, dict[str, Leaf]] = {}
    for name, leaf in named.items():
        struct, _, key = name.rpartition(".")
        found.setdefault(struct, {})[key] = leaf
    return found


def _with_sibling_fields(part: FilePart, structs: Mapping[str, Mapping[str, Leaf]]) -> FilePart:
    """An array with the unit of its struct, if it is the only array there, and the nearest rate."""
    struct = part.name.rpartition(".")[0]
    fields = structs[struct]
    arrays = [leaf for leaf in fields.values() if leaf.kind == "numeric" and leaf.size > 1]
    if struct and len(arrays) == 1:
        texts = [fields[key].text for key in UNIT_NAMES if key in fields]
        unit = next(filter(None, texts), None)
        part = replace(part, channels=tuple(replace(c, unit=unit) for c in part.channels))
    rate = _nearest_rate(struct, structs)
    return replace(part, sample_rate=rate.declared, rate_note=rate.note, rate_seen=rate.seen)


def _nearest_rate(struct: str, structs: Mapping[str, Mapping[str, Leaf]]) -> RateNote:
    """Rate of the struct, or else of the one that contains it, and so on."""
    while True:
        for key, leaf in structs.get(struct, {}).items():
            note = rate_note(key, leaf.text or leaf.scalar()) if is_rate_name(key) else RateNote()
            if note.declared is not None or note.seen is not None:
                return note
        if not struct:
            return RateNote()
        struct = struct.rpartition(".")[0]


def _member(name: str, leaf: Leaf, index: int, key: str) -> str:
    if leaf.kind == "cell":
        return f"{name}{{{index}}}"
    return f"{name}.{key}" if len(leaf.members) == 1 else f"{name}({index}).{key}"


def _part(path: Path, name: str, leaf: Leaf, options: SourceOptions) -> FilePart | str:
    """A part; or a description of what it is instead, empty for single numbers and texts."""
    requested = name in options.variables
    if leaf.kind != "numeric" or leaf.size <= 1:
        if requested:
            raise DataError(
                f"{path}: {name} is {leaf.kind} {leaf.shape}, must be real numbers (samples, "
                "channels); choose another variable"
            )
        return "" if leaf.size <= 1 or leaf.kind == "text" else f"{name} {leaf.kind} {leaf.shape}"
    try:
        return array_part(path, name, leaf, options)
    except DataError:
        if requested:
            raise
        return f"{name} {leaf.shape}"


def array_part(path: Path, name: str, leaf: Leaf, options: SourceOptions) -> FilePart:
    """An array of real numbers as a recording.

    Raises
    ------
    DataError
        If its shape is not that of a recording.
    """
    # trailing axes of one element do not count
    shape = leaf.shape[:2] + tuple(n for n in leaf.shape[2:] if n != 1)
    if len(shape) != 2:
        raise DataError(
            f"{path}: {name} has shape {leaf.shape}, must be (samples, channels); choose another"
        )
    axes = array_axes(shape, options, f"{path}: {name}")
    if leaf.reader is None:
        raise DataError(f"{path}: {name} holds no numbers, must hold some; choose another")
    return FilePart(
        name=name,
        about=f"{leaf.shape}",
        channels=numbered(name, axes.n_channels),
        named=axes.n_channels == 1,
        n_samples=axes.n_samples,
        fetch=leaf.reader(axes),
    )


# --- known layouts


def _known(path: Path, tree: Tree, options: SourceOptions) -> FilePart | None:
    for layout in MAT_LAYOUTS:
        struct = tree.get(layout.struct)
        fields = struct.members[0] if struct and len(struct.members) == 1 else {}
        if {layout.signal, layout.sample_rate} <= set(fields):
            return _by_layout(path, layout, fields, options)
    return None


def _by_layout(
    path: Path, layout: MatLayout, fields: Mapping[str, Leaf], options: SourceOptions
) -> FilePart:
    numbers = {
        name: (fields[name].scalar(), fields[name])
        for name in (layout.sample_rate, *layout.conditions)
        if name in fields
    }
    faults = [
        f"{path}: {name} = {leaf.text or leaf.shape!r} must be one number; correct the file"
        for name, (value, leaf) in numbers.items()
        if value is None
    ]
    signal = fields[layout.signal]
    if signal.kind != "numeric" or signal.size == 0:
        faults.append(
            f"{path}: {layout.signal} is {signal.kind} {signal.shape}, must be real numbers "
            "(samples, channels); choose another variable"
        )
    if faults:
        raise DataError("\n".join(faults))
    values = {name: value for name, (value, _) in numbers.items() if value is not None}
    part = array_part(path, f"{layout.struct}.{layout.signal}", signal, options)
    return replace(
        part,
        channels=tuple(
            PartChannel(name=c.name.removeprefix(f"{layout.struct}."), unit=layout.unit)
            for c in part.channels
        ),
        sample_rate=values[layout.sample_rate],
        conditions={
            column: factor * values[name]
            for name, (column, factor) in layout.conditions.items()
            if name in values
        },
        known_as=layout.name,
    )
