"""Pieces of files that become the records of a data set: all must be of one kind."""

import os
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ...sim.output.recording import DataError
from ...sim.output.sensor import Channel
from ...sim.parts.wording import nearest
from ..file.record import LARGEST_RECORD
from ..readers.flat import numbered
from ..readers.open import open_source
from ..source.part import Source, SourceOptions
from ..workers.local import in_order
from .label_table import listed, refusal

RATE_TOLERANCE = 1e-5
"""Relative difference of sample rates that count as equal: rates from a printed time column differ
in their last digit. It shifts a spectrum by a tenth of a line in 10,000 lines."""

_WORTH_WORKERS = 2**26  # byte of files; below it workers take longer to start than to read


class EachChannel(Mapping[str, str]):
    """A declaration by name of channel, and one for the others.

    Parameters
    ----------
    named : mapping
        Declarations by channel.
    others : str, optional
        Declaration for every channel not in `named`.
    but : str, optional
        A channel to which `others` does not apply.

    Examples
    --------
    >>> unit = EachChannel({"x": "g"}, others="mm/s", but="tacho")
    >>> unit["x"], unit.get("y"), unit.get("tacho"), list(unit)
    ('g', 'mm/s', None, ['x'])
    """

    def __init__(
        self, named: Mapping[str, str], *, others: str | None = None, but: str | None = None
    ) -> None:
        self.named = dict(named)
        self.others = others
        self.but = but

    def __getitem__(self, name: str) -> str:
        if name in self.named:
            return self.named[name]
        if self.others is None or name == self.but:
            raise KeyError(name)
        return self.others

    def __iter__(self) -> Iterator[str]:
        return iter(self.named)

    def __len__(self) -> int:
        return len(self.named)


def sparing_tacho(options: SourceOptions, tacho: str | None) -> SourceOptions:
    """The options with unit and sensitivity of all channels not applied to the tacho.

    Parameters
    ----------
    options : SourceOptions
    tacho : str, optional
        Name of the tacho channel.
    """
    return replace(
        options,
        tacho=tacho,
        unit=_sparing(options.unit, tacho),
        sensitivity=_sparing(options.sensitivity, tacho),
    )


def _sparing(
    given: str | Mapping[str, str] | None, tacho: str | None
) -> str | Mapping[str, str] | None:
    if isinstance(given, str):
        return EachChannel({}, others=given, but=tacho)
    if isinstance(given, EachChannel):
        return EachChannel(given.named, others=given.others, but=tacho)
    return given


def channels_of_source(source: Source, tacho: str | None) -> tuple[Channel, ...]:
    """Channels of a source in the form of a data set.

    A tacho needs no unit, since only its edges count: without one its unit is "-".

    Raises
    ------
    DataError
        If rate or a unit is not declared, or there is no such tacho; all faults at once.
    """
    names = [channel.name for channel in source.channels]
    spared = f"channel '{tacho}': "
    faults = [text for text in source.undeclared if tacho is None or not text.startswith(spared)]
    if tacho is not None and tacho not in names:
        faults.append(f"has no channel {tacho!r} to be the tacho{nearest(tacho, names)}")
    if faults:
        raise DataError("\n".join(f"{source.path}: {fault}" for fault in _gathered(faults)))
    return tuple(
        Channel(
            name=channel.name,
            unit=channel.unit or "-",
            quantity="tacho" if channel.name == tacho else str(channel.quantity),
            unit_in_file=channel.unit_in_file,
        )
        for channel in source.channels
    )


_MOST_LINES = 8  # of one fault; a table of features has a thousand columns
_NAMED = 3  # of the channels of more


def _gathered(faults: Sequence[str]) -> list[str]:
    """Faults, those of many channels in one.

    Examples
    --------
    >>> _gathered(["fs must be given", *(f"channel '{name}': unit must be given" for name in "ab")])
    ['fs must be given', "channel 'a': unit must be given", "channel 'b': unit must be given"]
    >>> _gathered([f"channel '{name}': unit must be given" for name in "abcdefghijkl"])
    ["channels 'a', 'b', 'c' and 9 more: unit must be given"]
    """
    channels: dict[str, list[str]] = {}
    for fault in faults:
        name, _, text = fault.removeprefix("channel ").partition(": ")
        if fault.startswith("channel '"):
            channels.setdefault(text, []).append(name)
    many = {text: names for text, names in channels.items() if len(names) > _MOST_LINES}
    kept = [fault for fault in faults if fault.partition(": ")[2] not in many]
    return kept + [
        f"channels {', '.join(names[:_NAMED])} and {len(names) - _NAMED} more: {text}"
        for text, names in many.items()
    ]


# --- files --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Header:
    """Content of a file, without its samples.

    Attributes
    ----------
    path : Path
        Absolute path.
    name : str
        Name in messages and manifest: the path below the folder that all files share.
    channels : tuple of Channel
        Channels in the form of the data set.
    sample_rate : float
        Sample rate [Hz].
    n_samples : int
        Number of samples per channel.
    conditions : mapping
        Manifest columns that the file declares, in SI.
    named : bool
        Whether file or caller name the channels.
    n_records : int
        Number of rows that are separate records, each of `n_samples`.
    empty : tuple of str
        Channels of NaN only, which are left out.
    """

    path: Path
    name: str
    channels: tuple[Channel, ...]
    sample_rate: float
    n_samples: int
    conditions: Mapping[str, float]
    named: bool = True
    n_records: int = 1
    empty: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.n_samples / self.sample_rate

    @property
    def length(self) -> str:
        """Length in readable units."""
        return f"{self.duration:.6g} s ({self.n_samples} samples)"


def read_headers(
    files: Sequence[str | Path], options: SourceOptions, tacho: str | None, *, jobs: int = 1
) -> tuple[Header, ...]:
    """Read the headers of all files; sorted by name.

    Raises
    ------
    DataError
        If a file is given twice, cannot be read, or lacks rate, unit or tacho; all at once.
    """
    paths = [Path(os.path.abspath(file)) for file in files]
    _refuse_twice(paths)
    names = _names(paths)
    order = sorted(range(len(paths)), key=lambda i: (Path(names[i]).parts, names[i]))
    items = [(paths[i], names[i]) for i in order]
    look = partial(_header, options, tacho)
    found = list(in_order(look, items, jobs=worth_workers(paths, jobs)))
    faults = [fault for fault in found if isinstance(fault, str)]
    if faults:
        raise refusal([line for fault in faults for line in fault.split("\n")])
    return tuple(header for header in found if isinstance(header, Header))


def worth_workers(paths: Sequence[Path], jobs: int) -> int:
    """Number of worker processes worth starting for these files; results do not depend on it."""
    size = sum(path.stat().st_size for path in paths if path.is_file())
    return min(jobs, len(paths)) if size > _WORTH_WORKERS else 1


def _refuse_twice(paths: Sequence[Path]) -> None:
    if not paths:
        raise DataError("0 files, must be >= 1; name those to import")
    counts = Counter(os.path.realpath(path) for path in paths)
    twice = [path for path, count in counts.items() if count > 1]
    if twice:
        raise DataError(
            f"{len(twice)} file(s) are given twice, must be once: {listed(twice)}; remove them"
        )


def _names(paths: Sequence[Path]) -> list[str]:
    """Path of each file below the folder that all share; bytes that are not UTF-8 as numbers."""
    base = os.path.commonpath([path.parent for path in paths])
    names = [path.relative_to(base).as_posix() for path in paths]
    return [os.fsencode(name).decode(errors="backslashreplace") for name in names]


def _header(options: SourceOptions, tacho: str | None, item: tuple[Path, str]) -> Header | str:
    """Header of a file, or its fault as text; runs in a worker."""
    path, name = item
    if path.is_dir():
        return f"{path} is a folder, must be a file; name the files in it"
    try:
        with open_source(path, options) as source:
            channels = channels_of_source(source, tacho)
            return Header(
                path=path,
                name=name,
                channels=channels,
                sample_rate=float(source.sample_rate or 0.0),
                n_samples=source.n_samples,
                n_records=source.n_records,
                empty=source.empty,
                conditions=dict(source.conditions),
                named=source.named or tacho is not None,
            )
    except DataError as error:
        return str(error)


# --- one kind -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ImportPlan:
    """Records to make from files.

    Attributes
    ----------
    headers : tuple of Header
        Files, sorted by name.
    channels : tuple of Channel
        Channels of every record.
    sample_rate : float
        Sample rate [Hz].
    n_samples : int
        Length of every record.
    starts : tuple of range
        First sample of every record, by file; the same in each of its rows that are records.
    """

    headers: tuple[Header, ...]
    channels: tuple[Channel, ...]
    sample_rate: float
    n_samples: int
    starts: tuple[range, ...]

    @property
    def n_records(self) -> int:
        """Number of records of all files."""
        pairs = zip(self.headers, self.starts, strict=True)
        return sum(header.n_records * len(starts) for header, starts in pairs)

    @property
    def left_over(self) -> tuple[float, ...]:
        """Time at the end of each file that fills no record [s]."""
        return tuple(
            header.n_records * (header.n_samples - starts[-1] - self.n_samples) / self.sample_rate
            for header, starts in zip(self.headers, self.starts, strict=True)
        )


def plan_records(headers: Sequence[Header], segment: float | None, overlap: float) -> ImportPlan:
    """Cut files into records of one length.

    Parameters
    ----------
    headers : sequence of Header
        Headers, sorted.
    segment : float or None
        Length of a record [s]; None for whole files, which must then be of one length.
    overlap : float
        Share of a record that the next one repeats, 0 <= overlap < 1.

    Raises
    ------
    DataError
        If files differ in rate, channels or length, are shorter than a segment, or a record is
        implausibly large; all at once.
    """
    faults = _bound_faults(segment, overlap)
    if faults:
        raise refusal(faults)
    headers = _numbered_alike(headers)
    faults = [*_rate_faults(headers), *_channel_faults(headers)]
    n_samples = headers[0].n_samples
    if segment is not None:
        n_samples = max(1, round(segment * headers[0].sample_rate))
    faults += _length_faults(headers, n_samples, segment)
    size = 4 * n_samples * len(headers[0].channels)
    if size > LARGEST_RECORD:
        faults.append(
            f"a record of {n_samples} samples has {size} byte, must be <= {LARGEST_RECORD}; cut "
            "the files into shorter ones with segment"
        )
    if faults:
        raise refusal(faults)
    step = max(1, round(n_samples * (1 - overlap)))
    return ImportPlan(
        headers=tuple(headers),
        channels=_common_channels(headers),
        sample_rate=headers[0].sample_rate,
        n_samples=n_samples,
        starts=tuple(range(0, header.n_samples - n_samples + 1, step) for header in headers),
    )


def _bound_faults(segment: float | None, overlap: float) -> list[str]:
    faults = []
    if segment is not None and not 0 < segment < float("inf"):
        faults.append(f"segment = {segment} s must be > 0 and finite; give the length of a record")
    if not 0 <= overlap < 1:
        faults.append(f"overlap = {overlap} must be >= 0 and < 1; give a part of the segment")
    if segment is None and overlap > 0:
        faults.append(f"overlap = {overlap} needs a segment; give its length, or leave it out")
    return faults


def _rate_faults(headers: Sequence[Header]) -> list[str]:
    first = headers[0].sample_rate
    if all(abs(header.sample_rate / first - 1) <= RATE_TOLERANCE for header in headers):
        return []
    kinds = _kinds({header.name: f"{header.sample_rate:.10g} Hz" for header in headers})
    return [
        f"all files must have the same sample rate: {kinds}; import each rate by itself, or "
        "resample_to one of them"
    ]


def _channel_faults(headers: Sequence[Header]) -> list[str]:
    alike = {header.name: _signature(header) for header in headers}
    if len(set(alike.values())) == 1:
        return []
    words = {
        header.name: ", ".join(f"{c.name} [{c.unit}]" for c in header.channels)
        for header in headers
    }
    return [
        f"all files must have the same channels: {_kinds(words)}; choose those that all have "
        "with channels, as new=old to rename; if the files have no names, name all there"
    ]


def _numbered_alike(headers: Sequence[Header]) -> Sequence[Header]:
    """Common names for unnamed channels, whose own names contain the stem of their file."""
    names = {tuple(channel.name for channel in header.channels) for header in headers}
    counts = {len(header.channels) for header in headers}
    if any(header.named for header in headers) or len(names) == 1 or len(counts) > 1:
        return headers
    common = [part.name for part in numbered("channel", counts.pop())]
    return [
        replace(
            header,
            channels=tuple(
                replace(channel, name=name)
                for channel, name in zip(header.channels, common, strict=True)
            ),
        )
        for header in headers
    ]


def _signature(header: Header) -> tuple[tuple[str, str, str], ...]:
    return tuple((channel.name, channel.unit, channel.quantity) for channel in header.channels)


def _length_faults(headers: Sequence[Header], n_samples: int, segment: float | None) -> list[str]:
    if segment is not None:
        short = [header for header in headers if header.n_samples < n_samples]
        if not short:
            return []
        least = min(short, key=lambda header: header.n_samples)
        return [
            f"{len(short)} of {len(headers)} files are shorter than the segment of {segment:g} s "
            f"({n_samples} samples), must be as long: {listed([h.name for h in short])}, the "
            f"shortest {least.name} with {least.length}; shorten the segment or leave them out"
        ]
    least = min(headers, key=lambda header: header.n_samples)
    most = max(headers, key=lambda header: header.n_samples)
    if least.n_samples == most.n_samples:
        return []
    return [
        f"whole files must have the same length: shortest {least.name} with {least.length}, "
        f"longest {most.name} with {most.length}; cut them with segment"
    ]


def _kinds(values: Mapping[str, Hashable]) -> str:
    """Text of the values and their owners, the most common first."""
    counts = Counter(values.values())
    return "; ".join(
        f"{value} in {listed([name for name, own in values.items() if own == value])}"
        for value, _ in counts.most_common()
    )


def _common_channels(headers: Sequence[Header]) -> tuple[Channel, ...]:
    """Channels of the first file; with a unit in the file only if all files agree on it."""
    return tuple(
        channel
        if len({header.channels[i].unit_in_file for header in headers}) == 1
        else replace(channel, unit_in_file="")
        for i, channel in enumerate(headers[0].channels)
    )
