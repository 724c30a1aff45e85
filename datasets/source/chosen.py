"""The part of a file that is the recording: chosen by name or pattern, or the only one."""

import re
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ...sim.parts.wording import nearest
from .part import Contents, FilePart, PartChannel, SourceOptions


def part_of_record(file: Path, part: FilePart, options: SourceOptions, record: int) -> FilePart:
    """The part, or one of its rows if these are records."""
    if options.rows is None:
        return part
    try:
        return part.row_as_record(record)
    except DataError as error:
        raise DataError(f"{file}: {error}") from None


def chosen_part(file: Path, contents: Contents, options: SourceOptions, record: int) -> FilePart:
    """The part chosen by the options, or a DataError that lists the content."""
    names = [part.name for part in contents.parts]
    requested = options.variables or _named_by_channels(names, options)
    wanted = [_fitting(file, pattern, names) for pattern in requested]
    if wanted:
        missing = [name for name in wanted if name not in names]
        if missing:
            raise DataError(
                f"{file}: variable = {', '.join(map(repr, missing))} must be one of its arrays: "
                f"{contents.listing()}{nearest(missing[0], names) if names else ''}"
            )
        found = [contents.parts[names.index(name)] for name in wanted]
        found = [part_of_record(file, part, options, record) for part in found]
        pairs = zip(found, requested, strict=True)
        return _merged(file, [_by_pattern(part, pattern) for part, pattern in pairs])
    known = [part for part in contents.parts if part.known_as]
    if len(known) == 1:
        return part_of_record(file, known[0], options, record)
    if len(names) == 1:
        return part_of_record(file, contents.parts[0], options, record)
    if not names:
        raise DataError(
            f"{file} holds no recording that can be read: {contents.listing()}; export one"
        )
    raise DataError(
        f"{file} holds {len(names)}: variable must be one of its arrays: {contents.listing()}; "
        "choose with variable, once for each channel if each is an array"
    )


def wanted_channels(options: SourceOptions) -> Sequence[str]:
    """Channels named by the caller, or else by the profile; none for all."""
    return options.channels or (options.like.channels if options.like else ())


def _named_by_channels(names: Sequence[str], options: SourceOptions) -> tuple[str, ...]:
    """Arrays after which the requested channels are named, if every channel is one."""
    wanted = wanted_channels(options)
    arrays = [entry if entry in names else new_and_old(entry)[1] or entry for entry in wanted]
    return tuple(arrays) if len(names) > 1 and set(arrays) <= set(names) else ()


def _fitting(file: Path, pattern: str, names: Sequence[str]) -> str:
    """The one name that matches a pattern; a plain name matches itself."""
    if pattern in names:
        return pattern
    found = [name for name in names if fnmatchcase(name, pattern)]
    if len(found) > 1:
        raise DataError(
            f"{file}: variable = {pattern!r} fits {', '.join(found)}, must fit one; narrow it"
        )
    return found[0] if found else pattern


def _by_pattern(part: FilePart, pattern: str) -> FilePart:
    """A part named by the letters of the pattern, which names in other files share."""
    common = re.sub(r"\[[^\]]*\]|[*?]", "", pattern).strip("_. ")
    if part.name == pattern or not common:
        return part
    renamed = tuple(
        replace(channel, name=channel.name.replace(part.name, common)) for channel in part.channels
    )
    return replace(part, name=common, channels=renamed)


def _merged(file: Path, parts: Sequence[FilePart]) -> FilePart:
    """Several parts of one length as the channels of one recording."""
    if len(parts) == 1:
        return parts[0]
    lengths = {part.name: part.n_samples for part in parts}
    rates = {part.name: part.sample_rate for part in parts}
    counts = {part.name: part.n_records for part in parts}
    for what, values in (("samples", lengths), ("Hz", rates), ("records", counts)):
        if len(set(values.values())) > 1:
            raise DataError(
                f"{file}: {', '.join(f'{name} has {n} {what}' for name, n in values.items())}, "
                "must be the same to become one recording; choose others"
            )
    owners = [(part, row) for part in parts for row in range(len(part.channels))]

    def fetch(start: int, stop: int, rows: tuple[int, ...]) -> NDArray[np.float64]:
        pieces = [owners[row][0].fetch(start, stop, (owners[row][1],)) for row in rows]
        shortest = min(piece.shape[1] for piece in pieces)
        return np.concatenate([piece[:, :shortest] for piece in pieces], dtype=np.float64)

    return replace(
        parts[0],
        name=", ".join(lengths),
        about=f"({len(owners)}, {parts[0].n_samples})",
        channels=tuple(_qualified(part, row) for part, row in owners),
        named=True,
        fetch=fetch,
        known_as="",
        conditions={},
    )


def _qualified(part: FilePart, row: int) -> PartChannel:
    """Channel under the name of its array, or with both names if the array has several channels."""
    channel = part.channels[row]
    if part.named and len(part.channels) > 1:
        return replace(channel, name=f"{part.name}.{channel.name}")
    return channel


def new_and_old(entry: str) -> tuple[str, str]:
    """Names in an entry like new=old; without an equals sign the old one is empty."""
    new, _, old = entry.partition("=")
    return new, old
