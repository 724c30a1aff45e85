"""Data types of the readers: content of a file, declarations of the caller, and the result."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ...sim.output.sensor import rate_fault

LARGEST_INFLATED = 2**30
"""Largest plausible content of a compressed file [byte]: a larger one may be malicious."""

MOST_CHANNELS = 4096
"""Largest number of channels; with more, an array is an image or a table, not a recording."""

MOST_ROWS = 100_000
"""Largest number of rows of an array that are taken as records."""

_SHOWN = 24
"""Number of parts named in a message; the others are counted."""

DECLARED = "declared_samples"
"""Manifest column: number of samples that a file declares, if it holds fewer."""

Fetch = Callable[[int, int, tuple[int, ...]], NDArray[Any]]
"""Numbers as stored [shape=(n_rows, stop - start)], by start, stop and rows."""


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Channels, units and rate that a model expects, for what neither file nor caller declares.

    Attributes
    ----------
    source : str
        Origin, for messages.
    channels : tuple of str
        Names, in order.
    units : mapping
        Unit of each channel for which no other is declared.
    sample_rate : float
        Sample rate [Hz].
    """

    source: str
    channels: tuple[str, ...]
    units: Mapping[str, str]
    sample_rate: float


@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """Declarations of the caller about a file, and the selection to read.

    Parameters
    ----------
    variable : str or sequence of str, optional
        Array, data set or group to read if a file holds several; several of one length become
        channels of one recording. ``struct.field`` for a field. A pattern (``*_time``) that matches
        one name of the file names the channel by its letters.
    channels : sequence of str
        Channels to read, in order, under the names shown in a listing; ``new=old`` renames. If the
        file has no names, new names for all channels suffice.
    fs : float, optional
        Sample rate [Hz].
    unit : str or mapping, optional
        Unit of every channel, or by name of channel; a number before it is the value of one number
        of the file (``"0.5 mV"``). ``"FS"`` keeps integers as fractions of full scale. The name of
        a time column may have a unit of time.
    sensitivity : str or mapping, optional
        Sensitivity of the sensor on a channel in volts: ``"100 mV/g"``.
    full_scale : str or mapping, optional
        Value of the largest integer of a WAV file: ``"10 V"``, ``"50 g"``.
    delimiter, decimal : str, optional
        For a text file: ``","``, ``";"``, ``"tab"``, ``"space"``, …; ``"."`` or ``","``.
    header : int, optional
        Number of lines before the numbers of a text file; the last of them names the columns. 0:
        none.
    time_column : str or int, optional
        Name of the time column, or its number counted from 1; 0: there is none.
    dtype : str, optional
        For headerless binary: ``"<int16"``, ``">float32"``, …; ``<`` little-endian, ``>`` big.
    n_channels : int, optional
        For headerless binary.
    offset : int
        Bytes to skip in headerless binary.
    order : {"interleaved", "blocks"}, optional
        For binary and arrays: sample by sample (time down the rows), or channel by channel.
    record : int
        Index along the first axis of a three-dimensional array; or the row, if rows are records.
    rows : {"records"}, optional
        For text and two-dimensional arrays: every row is a record of one channel; for arrays with
        ``order="interleaved"`` every column. Several variables become channels.
    resample_to : float, optional
        Sample rate to bring the recording to [Hz].
    tacho : str, optional
        Channel that is resampled by the times of its edges.
    partial : bool
        Read the samples of a truncated WAV, TDMS or binary file.
    like : Profile, optional
        Channels, units and rate if not declared otherwise; a rate that differs is refused.

    Raises
    ------
    DataError
        If a value is out of bounds; all faults at once.

    Examples
    --------
    >>> SourceOptions(variable="x").variables
    ('x',)
    """

    variable: str | Sequence[str] | None = None
    channels: Sequence[str] = ()
    fs: float | None = None
    unit: str | Mapping[str, str] | None = None
    sensitivity: str | Mapping[str, str] | None = None
    full_scale: str | Mapping[str, str] | None = None
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    header: int | None = None
    time_column: str | int | None = None
    dtype: str | None = None
    n_channels: int | None = None
    offset: int = 0
    order: Literal["interleaved", "blocks"] | None = None
    record: int = 0
    rows: Literal["records"] | None = None
    resample_to: float | None = None
    tacho: str | None = None
    partial: bool = False
    like: Profile | None = None

    def __post_init__(self) -> None:
        faults = [text for wrong, text in _option_faults(self) if wrong]
        if faults:
            raise DataError("\n".join(faults))

    @property
    def variables(self) -> tuple[str, ...]:
        """Names requested; none if there is only one."""
        if self.variable is None:
            return ()
        return (self.variable,) if isinstance(self.variable, str) else tuple(self.variable)

    def per_channel(
        self, name: Literal["unit", "sensitivity", "full_scale"], channel: str
    ) -> str | None:
        """Declaration about one channel."""
        given: str | Mapping[str, str] | None = getattr(self, name)
        return given.get(channel) if isinstance(given, Mapping) else given


def _option_faults(o: SourceOptions) -> list[tuple[bool, str]]:
    rates = {"fs": o.fs, "resample_to": o.resample_to}
    bad = [
        rate_fault(name, rate, "give a sample rate in Hz")
        for name, rate in rates.items()
        if rate is not None
    ]
    return [
        *((bool(text), text) for text in bad),
        (
            o.decimal not in (None, ".", ","),
            f"decimal = {o.decimal!r} must be '.' or ','; choose one",
        ),
        (
            o.header is not None and o.header < 0,
            f"header = {o.header} must be >= 0; count the lines before the numbers",
        ),
        (
            o.n_channels is not None and not 1 <= o.n_channels <= MOST_CHANNELS,
            f"n_channels = {o.n_channels} must be >= 1 and <= {MOST_CHANNELS}; count them",
        ),
        (o.offset < 0, f"offset = {o.offset} byte must be >= 0; count the bytes to skip"),
        (
            o.order not in (None, "interleaved", "blocks"),
            f"order = {o.order!r} must be 'interleaved' or 'blocks'; choose one",
        ),
        (
            o.rows not in (None, "records"),
            f"rows = {o.rows!r} must be 'records'; leave it out if rows are not records",
        ),
        (o.record < 0, f"record = {o.record} must be >= 0; choose another"),
        (
            isinstance(o.time_column, int) and o.time_column < 0,
            f"time_column = {o.time_column} must be >= 0; count the columns from 1, 0 for none",
        ),
    ]


@dataclass(frozen=True, kw_only=True)
class PartChannel:
    """A channel as in the file: its name, and its unit if the file declares one."""

    name: str
    unit: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class FilePart:
    """Part of a file that can be one recording; none of its signal has been read.

    Attributes
    ----------
    name : str
        Name by which it is chosen; empty if the file holds nothing else.
    about : str
        Shape or length, for listings.
    channels : tuple of PartChannel
        Channels as in the file.
    named : bool
        Whether the names are the file's own.
    n_samples : int
        Number of samples per channel.
    fetch : callable
        Reads some samples of some channels, as numbers of the file.
    sample_rate : float, optional
        Sample rate declared by the file [Hz].
    rate_doubt : float
        Relative uncertainty of a printed rate; 0 if it is exact.
    rate_note : str
        Reason why an apparent rate in the file does not count.
    rate_seen : float, optional
        Number that would be the rate if it had a unit.
    bits : int
        Number of bits of integers over full scale; 0 for numbers without scaling.
    conditions : mapping
        Manifest columns that the file declares, in SI.
    known_as : str
        Data set whose documentation declares rate and unit; such a part is chosen first.
    extras : tuple of str
        Further names for which a unit may be declared: the time column.
    n_records : int
        Number of records of this layout, including this one.
    empty : tuple of str
        Channels of NaN only, which are left out.
    unread : mapping of str to str
        Columns of numbers in an unknown notation, with their content and the cure.
    """

    name: str
    about: str
    channels: tuple[PartChannel, ...]
    named: bool
    n_samples: int
    fetch: Fetch
    sample_rate: float | None = None
    rate_doubt: float = 0.0
    rate_note: str = ""
    rate_seen: float | None = None
    bits: int = 0
    conditions: Mapping[str, float] = field(default_factory=dict)
    known_as: str = ""
    extras: tuple[str, ...] = ()
    n_records: int = 1
    empty: tuple[str, ...] = ()
    unread: Mapping[str, str] = field(default_factory=dict)

    def row_as_record(self, row: int) -> "FilePart":
        """One channel as a separate recording, named like the others.

        Raises
        ------
        DataError
            If there is no such row.
        """
        count = len(self.channels)
        if row >= count:
            raise DataError(
                f"{self.name or 'the file'}: record = {row} must be >= 0 and < {count}, its rows; "
                "choose another"
            )
        own = self.channels[row]
        stem = own.name.removesuffix(f"_{row}") if count > 1 else own.name
        fetch = self.fetch

        def fetch_row(start: int, stop: int, rows: tuple[int, ...]) -> NDArray[Any]:
            return fetch(start, stop, tuple(row for _ in rows))

        return replace(
            self,
            about=f"({count} records of {self.n_samples})",
            channels=(replace(own, name=stem),),
            fetch=fetch_row,
            n_records=count,
        )


def _nothing() -> None:
    """Close nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contents:
    """Content of a file: parts that can be read, and descriptions of all else.

    ``wanted`` gives the cure if nothing can be chosen; ``close`` releases the file.
    """

    parts: tuple[FilePart, ...]
    others: tuple[str, ...] = ()
    close: Callable[[], None] = _nothing

    def listing(self) -> str:
        """Text of the content, for a message."""
        names = [f"{part.name or 'the file'} {part.about}" for part in self.parts]
        if not names:
            names = ["none"]
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        text = ", ".join(names[:_SHOWN]) + more
        if self.others:
            rest = len(self.others) - _SHOWN
            text += f" (not signals: {', '.join(self.others[:_SHOWN])}"
            text += f" and {rest} more)" if rest > 0 else ")"
        return text


@dataclass(frozen=True, kw_only=True)
class SourceChannel:
    """One channel of a source.

    Attributes
    ----------
    name : str
        Name, unique in its source.
    unit : str, optional
        Unit of the numbers returned by `Source.read`: SI, ``FS``, or None if nothing is declared
        and the numbers are the file's.
    quantity : str, optional
        ``acceleration``, …; None if no unit is declared.
    unit_in_file : str
        Unit as declared, before conversion.
    """

    name: str
    unit: str | None = None
    quantity: str | None = None
    unit_in_file: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """One recording in a file, read piece by piece.

    Attributes
    ----------
    path : Path
        The file.
    part : str
        Part of the file; empty if it holds one recording.
    channels : tuple of SourceChannel
        Channels with unique names.
    sample_rate : float, optional
        Sample rate [Hz]; None if neither file nor caller declares it.
    n_samples : int
        Number of samples per channel, >= 1.
    conditions : mapping
        Manifest columns that the file declares: ``speed_hz``, ``load_n``, in SI.
    undeclared : tuple of str
        Missing declarations, each with its cure.
    named : bool
        Whether file or caller name the channels.
    n_records : int
        Number of records of this layout in the file, including this one.
    empty : tuple of str
        Channels of NaN only, which are left out.

    Notes
    -----
    Only the requested samples are read, except from compressed MATLAB and NPZ files, which are
    decompressed completely (at most :data:`LARGEST_INFLATED`).
    """

    path: Path
    part: str
    channels: tuple[SourceChannel, ...]
    sample_rate: float | None
    n_samples: int
    conditions: Mapping[str, float]
    undeclared: tuple[str, ...]
    fetch: Fetch
    rows: tuple[int, ...]
    factors: tuple[float, ...]
    close: Callable[[], None] = _nothing
    named: bool = True
    n_records: int = 1
    empty: tuple[str, ...] = ()

    def read(self, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read some samples of all channels.

        Parameters
        ----------
        start, stop : int
            Samples [start, stop); to the end by default.

        Returns
        -------
        numpy.ndarray [shape=(n_channels, stop - start)]
            Samples in the units of `channels`.

        Raises
        ------
        DataError
            If the range is not within the recording, the file is damaged there, or a sample is not
            finite.
        """
        end = self.n_samples if stop is None else stop
        if not 0 <= start < end <= self.n_samples:
            raise DataError(
                f"{self.path}: samples {start} to {end} must be within 0 to {self.n_samples} and "
                "at least one; ask for others"
            )
        with np.errstate(over="ignore", invalid="ignore"):  # overflows are refused by name
            numbers = self.fetch(start, end, self.rows)
        if numbers.shape != (len(self.rows), end - start):
            raise DataError(
                f"{self.path}: has {numbers.shape[-1]} of the samples {start} to {end}, must have "
                f"{end - start}; the file has changed, take an intact copy"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            values = numbers.astype(np.float64)
            values *= np.array(self.factors)[:, None]
        self._refuse_gaps(values, start)
        return values

    def _refuse_gaps(self, values: NDArray[np.float64], start: int) -> None:
        if np.isfinite(values).all():
            return
        faults = []
        for channel, row in zip(self.channels, values, strict=True):
            bad = np.flatnonzero(~np.isfinite(row))
            if bad.size:
                faults.append(
                    f"{self.path}: channel '{channel.name}' is {row[bad[0]]} at index "
                    f"{start + bad[0]}, must be finite; cut or repair the gap"
                )
        raise DataError("\n".join(faults))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def cut(path: Path, size: int, needed: int, *, partial: bool = False) -> DataError:
    """Error about a file shorter than declared; `partial` if the existing samples can be read."""
    more = ", or read what is there with partial" if partial else ""
    return DataError(f"{path} has {size} byte, must be >= {needed}; take an intact copy{more}")


@contextmanager
def closed_on_failure(
    path: Path, file: Any, faults: type[Exception] | tuple[type[Exception], ...]
) -> Iterator[None]:
    """Close a file that cannot be read; errors of these kinds from its parser count as damage."""
    try:
        yield
    except DataError:
        file.close()
        raise
    except faults as error:
        file.close()
        raise damaged(path, error) from error


def damaged(path: Path, error: BaseException) -> DataError:
    """Error about a file that its parser could not read, in one line."""
    text = " ".join(str(error).split())[:200] or type(error).__name__
    return DataError(f"{path} cannot be read ({text}); take an intact copy")


_MAGIC = (
    (b"RIFF", "WAV", ".wav"),
    (b"RIFX", "WAV", ".wav"),
    (b"RF64", "WAV", ".wav"),
    (b"MATLAB ", "MATLAB", ".mat"),
    (b"\x89HDF\r\n\x1a\n", "HDF5", ".h5"),
    (b"\x93NUMPY", "NPY", ".npy"),
    (b"PK\x03\x04", "NPZ or ZIP", ".npz"),
    (b"TDSm", "TDMS", ".tdms"),
    (b"    -1", "UFF", ".uff"),
    (b"\x1f\x8b", "gzip", ""),
)


def foreign(path: Path, wanted: str) -> DataError:
    """Error about a file whose first bytes do not match its suffix."""
    with path.open("rb") as handle:
        head = handle.read(16)
    if not head:
        return DataError(f"{path} has 0 byte, must be a {wanted} file; take an intact copy")
    for magic, name, suffix in _MAGIC:
        if head.startswith(magic):
            cure = f"rename it to {path.stem}{suffix}" if suffix else "unpack it"
            return DataError(f"{path} is no {wanted} file but begins like {name}; {cure}")
    return DataError(f"{path} does not begin like a {wanted} file; check the suffix")
