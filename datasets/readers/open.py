"""Measured recordings in files of many formats: one reader per suffix, one way to open them all.

A reader lists what a file holds (:class:`~.source.part.Contents`); here one part is chosen, and
rate, channels and units are settled between file and caller. Units are declared by the file or
by the caller and converted, or refused; they are never guessed from the numbers.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError, missing_file
from ...sim.output.sensor import rate_fault
from ...sim.parts.wording import nearest
from ..source.channel_units import FULL_SCALE, ChannelUnit, parse_sensitivity, parse_unit
from ..source.empty import without_empty
from ..source.part import (
    MOST_CHANNELS,
    Contents,
    FilePart,
    PartChannel,
    Profile,
    Source,
    SourceChannel,
    SourceOptions,
)
from ..source.resampled import resampled
from .flat import npy_contents, npz_contents, raw_contents
from .hdf5 import hdf5_contents
from .mat import mat_contents
from .tdms import tdms_contents
from .text import text_contents
from .uff import uff_contents
from .wav import wav_contents

__all__ = [
    "READERS",
    "Source",
    "SourceChannel",
    "SourceOptions",
    "list_sources",
    "open_records",
    "open_source",
]


@dataclass(frozen=True, kw_only=True)
class Reader:
    """How one format is read.

    Attributes
    ----------
    name : str
        Of the format.
    contents : callable
        Lists what a file holds.
    options : frozenset of str
        Options beyond those of every format that it understands.
    """

    name: str
    contents: Callable[[Path, SourceOptions], Contents]
    options: frozenset[str] = frozenset()


_EVERY = {"channels", "fs", "unit", "sensitivity", "resample_to", "tacho", "like"}
_ARRAY = frozenset({"variable", "order", "record", "rows"})
_TEXT = Reader(
    name="text",
    contents=text_contents,
    options=frozenset({"delimiter", "decimal", "header", "time_column", "rows", "record"}),
)
_RAW = Reader(
    name="headerless binary",
    contents=raw_contents,
    options=frozenset({"dtype", "n_channels", "offset", "order", "partial"}),
)
_HDF5 = Reader(name="HDF5", contents=hdf5_contents, options=_ARRAY)
_UFF = Reader(name="UFF", contents=uff_contents, options=frozenset({"variable"}))

READERS: dict[str, Reader] = {
    ".wav": Reader(name="WAV", contents=wav_contents, options=frozenset({"full_scale", "partial"})),
    ".mat": Reader(name="MATLAB", contents=mat_contents, options=_ARRAY),
    ".csv": _TEXT,
    ".tsv": _TEXT,
    ".txt": _TEXT,
    ".h5": _HDF5,
    ".hdf5": _HDF5,
    ".npy": Reader(name="NPY", contents=npy_contents, options=_ARRAY - {"variable"}),
    ".npz": Reader(name="NPZ", contents=npz_contents, options=_ARRAY),
    ".uff": _UFF,
    ".unv": _UFF,
    ".uf": _UFF,
    ".tdms": Reader(
        name="TDMS", contents=tdms_contents, options=frozenset({"variable", "partial"})
    ),
    ".bin": _RAW,
    ".raw": _RAW,
}
"""Suffix -> reader; a declared ``dtype`` makes any file headerless binary."""


def open_source(path: str | Path, options: SourceOptions | None = None) -> Source:
    r"""Open the one recording of a file, or the one that the options choose.

    Parameters
    ----------
    path : str or Path
        WAV, MATLAB 4 to 7.3, CSV/TSV, HDF5, NPY, NPZ, UFF58, TDMS, or headerless binary.
    options : SourceOptions, optional
        What the file does not declare, and what of it is wanted.

    Returns
    -------
    Source
        To be closed. A rate that the file prints with few digits, as a step or as times, is the
        whole number of hertz that they allow, where they allow just one. Rate and units that
        nobody declares are None and named in `undeclared`.

    Raises
    ------
    DataError
        The file is missing, damaged or of a format not known; it holds several recordings and
        none is chosen (with the list of what is inside); an option does not fit it, contradicts
        what it declares, or names what it does not hold.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "pump.csv"
    ...     _ = file.write_text("time [s],acc [g]\n0.00,1\n0.01,2\n0.02,3\n")
    ...     with open_source(file) as source:
    ...         source.sample_rate, source.channels[0].unit, source.read(1, 3)
    (100.0, 'm/s^2', array([[19.6133 , 29.41995]]))
    """
    given = options or SourceOptions()
    file = Path(path)
    contents = _contents(file, given)
    try:
        return _opened(file, contents, given, given.record)
    except BaseException:
        contents.close()
        raise


def open_records(path: str | Path, options: SourceOptions | None = None) -> tuple[Source, ...]:
    """Open all records of a file: its rows where they are records, else the one there is.

    Parameters
    ----------
    path, options
        As for :func:`open_source`; `record` is left aside where rows are records.

    Returns
    -------
    tuple of Source
        Closing one closes all: they share the file.

    Raises
    ------
    DataError
        As :func:`open_source`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(Path(folder) / "x.npy", np.ones((3, 50)))
    ...     found = open_records(Path(folder) / "x.npy", SourceOptions(rows="records", fs=9.0))
    ...     len(found), found[0].n_samples, found[0].channels[0].name
    (3, 50, 'x')
    """
    given = options or SourceOptions()
    if given.rows is None:
        return (open_source(path, given),)
    file = Path(path)
    contents = _contents(file, given)
    try:
        first = _opened(file, contents, given, 0)
        rest = range(1, first.n_records)
        return (first, *(_opened(file, contents, given, record) for record in rest))
    except BaseException:
        contents.close()
        raise


def _opened(file: Path, contents: Contents, given: SourceOptions, record: int) -> Source:
    part = without_empty(_chosen(file, contents, given, record))
    _refuse_unread(file, part, given)
    return resampled(_settled(file, part, given, contents.close), given.resample_to, given.tacho)


def list_sources(path: str | Path, options: SourceOptions | None = None) -> tuple[Source, ...]:
    """Everything in a file that could be a recording, for listings; all to be closed.

    Parameters
    ----------
    path, options
        As for :func:`open_source`; `channels`, `variable` and what is per channel are left aside.

    Returns
    -------
    tuple of Source
        May be empty. Closing one closes all: they share the file.

    Raises
    ------
    DataError
        The file is missing, damaged or of a format not known.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "two.npz"
    ...     np.savez(file, a=np.ones(5), b=np.ones((3, 7)))
    ...     [(source.part, len(source.channels)) for source in list_sources(file)]
    [('a', 1), ('b', 3)]
    """
    given = options or SourceOptions()
    file = Path(path)
    plain = replace(
        given, like=None, variable=None, channels=(), unit=None, sensitivity=None, full_scale=None
    )
    contents = _contents(file, given)
    try:
        parts = [_of_record(file, part, given, 0) for part in contents.parts]
        return tuple(_settled(file, part, plain, contents.close) for part in parts)
    except BaseException:
        contents.close()
        raise


def _refuse_unread(file: Path, part: FilePart, options: SourceOptions) -> None:
    """Numbers must not be left out like words, unless the channels are chosen without them."""
    wanted = _wanted(options)
    chosen = {_split(entry)[1] or entry for entry in wanted}
    told = [text for name, text in part.unread.items() if not wanted or name in chosen]
    if told:
        raise DataError("\n".join(f"{file}: {text}" for text in told))


def _contents(file: Path, options: SourceOptions) -> Contents:
    reader = _RAW if options.dtype is not None else READERS.get(file.suffix.lower())
    if reader is None:
        if not file.exists():
            raise DataError(missing_file(file))
        raise DataError(
            f"{file}: suffix '{file.suffix}' must be one of {', '.join(READERS)}; convert the "
            "file, or give dtype and n_channels of headerless binary"
        )
    _refuse_options(file, reader, options)
    if not file.is_file():
        raise DataError(missing_file(file))
    if file.stat().st_size == 0:
        raise DataError(f"{file} has 0 byte, must be a {reader.name} file; take an intact copy")
    return reader.contents(file, options)


def _refuse_options(file: Path, reader: Reader, options: SourceOptions) -> None:
    default = SourceOptions()
    known = _EVERY | reader.options
    wrong = [
        f"{file}: {field.name} = {getattr(options, field.name)!r} does not fit {reader.name} "
        "files; leave it out"
        for field in fields(SourceOptions)
        if field.name not in known and getattr(options, field.name) != getattr(default, field.name)
    ]
    if wrong:
        raise DataError("\n".join(wrong))


# --- which part


def _of_record(file: Path, part: FilePart, options: SourceOptions, record: int) -> FilePart:
    """The part, or one of its rows where these are records."""
    if options.rows is None:
        return part
    try:
        return part.row_as_record(record)
    except DataError as error:
        raise DataError(f"{file}: {error}") from None


def _chosen(file: Path, contents: Contents, options: SourceOptions, record: int) -> FilePart:
    names = [part.name for part in contents.parts]
    asked = options.variables or _named_by_channels(names, options)
    wanted = [_fitting(file, pattern, names) for pattern in asked]
    if wanted:
        missing = [name for name in wanted if name not in names]
        if missing:
            raise DataError(
                f"{file}: variable = {', '.join(map(repr, missing))} must be one of its arrays: "
                f"{contents.listing()}{nearest(missing[0], names) if names else ''}"
            )
        found = [contents.parts[names.index(name)] for name in wanted]
        found = [_of_record(file, part, options, record) for part in found]
        pairs = zip(found, asked, strict=True)
        return _merged(file, [_by_pattern(part, pattern) for part, pattern in pairs])
    known = [part for part in contents.parts if part.known_as]
    if len(known) == 1:
        return _of_record(file, known[0], options, record)
    if len(names) == 1:
        return _of_record(file, contents.parts[0], options, record)
    if not names:
        raise DataError(
            f"{file} holds no recording that can be read: {contents.listing()}; export one"
        )
    raise DataError(
        f"{file} holds {len(names)}: variable must be one of its arrays: {contents.listing()}; "
        "choose with variable, once for each channel where each is an array"
    )


def _wanted(options: SourceOptions) -> Sequence[str]:
    """Channels that the caller names, else the profile; none for all."""
    return options.channels or (options.like.channels if options.like else ())


def _named_by_channels(names: Sequence[str], options: SourceOptions) -> tuple[str, ...]:
    """Arrays that the channels to be read are named after, where every channel is one."""
    wanted = _wanted(options)
    arrays = [entry if entry in names else _split(entry)[1] or entry for entry in wanted]
    return tuple(arrays) if len(names) > 1 and set(arrays) <= set(names) else ()


def _fitting(file: Path, pattern: str, names: Sequence[str]) -> str:
    """The one name that fits a pattern; a name is a pattern that fits itself."""
    if pattern in names:
        return pattern
    found = [name for name in names if fnmatchcase(name, pattern)]
    if len(found) > 1:
        raise DataError(
            f"{file}: variable = {pattern!r} fits {', '.join(found)}, must fit one; narrow it"
        )
    return found[0] if found else pattern


def _by_pattern(part: FilePart, pattern: str) -> FilePart:
    """A part under what its name has in common with those of other files: the pattern's letters."""
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
    """Of several arrays each gives its name to its channel, or to all of them with theirs."""
    channel = part.channels[row]
    if part.named and len(part.channels) > 1:
        return replace(channel, name=f"{part.name}.{channel.name}")
    return channel


# --- what its numbers mean


def _settled(
    file: Path, part: FilePart, options: SourceOptions, close: Callable[[], None]
) -> Source:
    """Part and options together; every fault at once."""
    faults: list[str] = []
    missing: list[str] = []
    rate = _rate(part, options, faults, missing)
    like = options.like
    _refuse_unlike(rate, options, faults)
    whose = "" if options.channels or like is None else f" (of {like.source})"
    rows, names = _rows(part, _wanted(options), faults, whose)
    _refuse_strangers(part, options, names, faults)
    meanings = [
        _meaning(part, row, name, options, faults, missing)
        for row, name in zip(rows, names, strict=True)
    ]
    if part.n_samples < 1:
        faults.append(f"{part.name or 'the recording'} has 0 samples, must be >= 1; take another")
    if faults:
        raise DataError("\n".join(f"{file}: {fault}" for fault in faults))
    return Source(
        path=file,
        part=part.name,
        channels=tuple(channel for channel, _ in meanings),
        named=part.named or bool(options.channels),
        n_records=part.n_records,
        empty=part.empty,
        sample_rate=rate,
        n_samples=part.n_samples,
        conditions=part.conditions,
        undeclared=tuple(missing),
        fetch=part.fetch,
        rows=tuple(rows),
        factors=tuple(factor for _, factor in meanings),
        close=close,
    )


def _rate(
    part: FilePart, options: SourceOptions, faults: list[str], missing: list[str]
) -> float | None:
    given = options.fs
    declared = None if part.sample_rate is None else _whole(part.sample_rate, part.rate_doubt)
    if declared is not None and (fault := rate_fault("sample_rate", declared, _OTHER_RATE)):
        faults.append(fault)
        return None
    if declared is None:
        if given is None and options.like is not None:
            _refuse_other_rate(part, options.like, faults)
            return options.like.sample_rate
        if given is None:
            note = f" ({part.rate_note})" if part.rate_note else ""
            missing.append(f"fs must be given; the file does not declare the sample rate{note}")
        return given
    if given is None or given == declared:
        return declared
    if abs(given - declared) <= part.rate_doubt * declared:
        return given  # the file prints the same rate with fewer digits
    faults.append(
        f"fs = {given:.10g} Hz must be {declared:.10g} Hz, as declared"
        f"{f' ({part.known_as})' if part.known_as else ''}; leave it out"
    )
    return None


def _refuse_other_rate(part: FilePart, like: Profile, faults: list[str]) -> None:
    """The rate of a profile must not stand for another that the file seems to have."""
    if part.rate_seen is not None and abs(part.rate_seen / like.sample_rate - 1) > _SAME_RATE:
        faults.append(
            f"sample rate = {like.sample_rate:.10g} Hz of {like.source} stands for what the file "
            f"does not declare, but {part.rate_note}"
        )


def _refuse_unlike(rate: float | None, options: SourceOptions, faults: list[str]) -> None:
    """Refuse a rate that is not the profile's, unless the caller asks for one."""
    if options.like is None or rate is None or options.resample_to is not None:
        return
    wanted = options.like.sample_rate
    if abs(rate / wanted - 1) > _SAME_RATE:
        cure = f"give --resample-to {wanted:.10g}"
        if rate < wanted:
            cure = "record as fast: a higher rate adds no band to samples that are there"
        faults.append(
            f"sample rate = {rate:.10g} Hz must be {wanted:.10g} Hz, as in {options.like.source}; "
            f"{cure}"
        )


_SAME_RATE = 1e-5  # relative, as of rates that printed times tell
_OTHER_RATE = "take an intact copy, or correct the unit of the time"


def _whole(rate: float, doubt: float) -> float:
    """The only whole number of hertz that the printed digits allow, else the rate as it is."""
    if not math.isfinite(rate) or math.ceil(rate * (1 - doubt)) != math.floor(rate * (1 + doubt)):
        return rate
    return float(math.ceil(rate * (1 - doubt)))


def _rows(
    part: FilePart, wanted: Sequence[str], faults: list[str], whose: str
) -> tuple[list[int], list[str]]:
    """Which rows of the part, under which names; `whose` the wanted ones are, for messages."""
    there = [channel.name for channel in part.channels]
    rows, names = list(range(len(there))), list(there)
    if len(there) > MOST_CHANNELS or not there:
        faults.append(f"has {len(there)} channels, must be >= 1 and <= {MOST_CHANNELS}; split it")
        return [], []
    shown = [e if e in there else _split(e)[1] or e for e in wanted]
    if dead := [name for name in shown if name in part.empty]:
        faults += [
            f"channel {n!r} holds nothing but NaN, must hold numbers; leave it" for n in dead
        ]
        return [], []
    if wanted and not part.named and not all(name in there for name in shown):
        names = list(wanted)
        if len(names) != len(there):
            many = "the one channel" if len(there) == 1 else f"all {len(there)} channels"
            faults.append(
                f"channels = {', '.join(names)}{whose} must name {many}, "
                f"which the file leaves unnamed, or choose of {', '.join(there[:_SHOWN_NAMES])} as "
                "new=old"
            )
            return [], []
    elif wanted:
        pairs = [(e, e) if e in there or "=" not in e else _split(e) for e in wanted]
        unknown = [old for _, old in pairs if old not in there]
        faults += [f"has no channel {old!r}{nearest(old, there)}" for old in unknown]
        if unknown:
            return [], []
        rows, names = [there.index(old) for _, old in pairs], [new for new, _ in pairs]
    twice = sorted({name for name in names if names.count(name) > 1 or not name})
    if twice:
        cure = "choose with variable" if part.named and not wanted else "give channels other names"
        faults.append(f"channel names {twice} must be unique and not empty; {cure}")
    return rows, names


_SHOWN_NAMES = 8


def _split(entry: str) -> tuple[str, str]:
    new, _, old = entry.partition("=")
    return new, old


def _refuse_strangers(
    part: FilePart, options: SourceOptions, names: Sequence[str], faults: list[str]
) -> None:
    """What is declared by name must be about a channel that is there, or was."""
    known = {*names, *(channel.name for channel in part.channels), *part.extras, *part.empty}
    for what in _MEANINGS:
        given = getattr(options, what)
        for name in given if isinstance(given, Mapping) else ():
            if name not in known:
                faults.append(f"{what} of {name!r} has no channel{nearest(name, sorted(known))}")


_MEANINGS: tuple[Literal["unit", "sensitivity", "full_scale"], ...] = (
    "unit",
    "sensitivity",
    "full_scale",
)
"""Options that say what a number is worth."""


def _meaning(
    part: FilePart,
    row: int,
    name: str,
    options: SourceOptions,
    faults: list[str],
    missing: list[str],
) -> tuple[SourceChannel, float]:
    """Channel in SI and factor to it."""
    declared = part.channels[row].unit
    given = options.per_channel("unit", name)
    blank = SourceChannel(name=name, unit_in_file=declared or "")
    if declared is not None and given is not None and _differ(declared, given):
        known = f" ({part.known_as})" if part.known_as else ""
        faults.append(
            f"channel '{name}': unit = {given} must be {declared}{known}, as declared; leave it out"
        )
        return blank, 1.0
    try:
        text = given if given is not None else declared
        if text is None and options.like is not None and part.bits == 0:
            text = options.like.units.get(name)
        unit, origin = _unit_of(part, text, options.per_channel("full_scale", name))
        unit, origin = _sensed(unit, origin, options.per_channel("sensitivity", name))
    except LookupError as error:
        missing.append(f"channel '{name}': {error.args[0]}")
        return blank, 1.0
    except ValueError as error:
        told = (options.per_channel(what, name) for what in _MEANINGS)
        # what the file says wrongly can still be listed, and be replaced by the caller
        quiet = all(text is None for text in told)
        (missing if quiet else faults).append(f"channel '{name}': {error}")
        return blank, 1.0
    channel = SourceChannel(
        name=name, unit=unit.symbol, quantity=unit.quantity, unit_in_file=origin
    )
    return channel, unit.factor


def _differ(declared: str, given: str) -> bool:
    """Two declarations contradict each other; one that nobody understands does not."""
    try:
        known = parse_unit(declared)
    except ValueError:
        return False
    try:
        return known != parse_unit(given)
    except ValueError:
        return True


def _unit_of(part: FilePart, text: str | None, full_scale: str | None) -> tuple[ChannelUnit, str]:
    """Meaning of a number of the file, and the words for it."""
    if part.bits == 0:
        if full_scale is not None:
            raise ValueError(
                f"full_scale = {full_scale!r} does not fit floats, which stand for themselves; "
                "give unit"
            )
        if text is None:
            raise LookupError("unit must be given; the file does not declare it")
        return parse_unit(text), text
    steps = 2.0 ** (part.bits - 1)
    if full_scale is None and text is None:
        raise LookupError(
            f"full_scale must be given ('10 V', '50 g': what an integer of {steps:.0f} is worth), "
            "or unit 'FS'; the file does not declare it"
        )
    unit = parse_unit(full_scale or text or "")
    if full_scale is None and unit.symbol != FULL_SCALE:
        raise ValueError(
            f"unit = {text!r} does not say what an integer is worth; give full_scale like '50 g', "
            f"the worth of {steps:.0f}, or unit 'FS'"
        )
    origin = f"{full_scale} full scale" if full_scale is not None else FULL_SCALE
    return replace(unit, factor=unit.factor / steps), origin


def _sensed(unit: ChannelUnit, origin: str, sensitivity: str | None) -> tuple[ChannelUnit, str]:
    """What the sensor measured, of a channel in volts."""
    if sensitivity is None:
        return unit, origin
    sensor = parse_sensitivity(sensitivity)
    if unit.quantity != "voltage":
        raise ValueError(
            f"sensitivity = {sensitivity!r} needs a channel in V, is in {origin}; leave it out"
        )
    return replace(sensor, factor=sensor.factor * unit.factor), f"{origin} at {sensitivity}"
