"""Vocabulary of the readers: what a file holds, what the caller declares, what comes of both."""

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
"""Largest believable content of a compressed file [byte]: beyond it a small file is a trap."""

MOST_CHANNELS = 4096
"""Beyond it an array is an image or a table, not a recording."""

MOST_ROWS = 100_000
"""Rows believed of one array to be records."""

_SHOWN = 24
"""Parts that a message names before it counts the rest."""

DECLARED = "declared_samples"
"""Manifest column: samples that a file declares, where it holds fewer of them."""

Fetch = Callable[[int, int, tuple[int, ...]], NDArray[Any]]
"""Numbers as the file holds them [shape=(n_rows, stop - start)], by start, stop and rows."""


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Recordings as a model wants them, for what neither file nor caller says.

    Attributes
    ----------
    source : str
        Where it is from, for messages.
    channels : tuple of str
        Names, in order.
    units : mapping
        Of channels whose unit nobody else declares.
    sample_rate : float
        [Hz]
    """

    source: str
    channels: tuple[str, ...]
    units: Mapping[str, str]
    sample_rate: float


@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """What the caller declares about a file that does not say it, and what of it is wanted.

    Parameters
    ----------
    variable : str or sequence of str, optional
        Array, data set or group to read, where a file holds several; several of one length
        become channels of one recording. ``struct.field`` for a field. A pattern (``*_time``) that
        fits one name of the file names the channel by its letters.
    channels : sequence of str
        Those wanted, in order, under the names that a listing shows; ``new=old`` renames. Where the
        file names none, new names for all of them will do.
    fs : float, optional
        Sample rate [Hz].
    unit : str or mapping, optional
        Unit of every channel, or by name of channel; a number before it is what one number of the
        file is worth (``"0.5 mV"``). ``"FS"`` leaves integers as parts of full scale. The name
        of a time column may have one of time.
    sensitivity : str or mapping, optional
        Of the sensor on a channel in volts: ``"100 mV/g"``.
    full_scale : str or mapping, optional
        What the largest integer of a WAV file is worth: ``"10 V"``, ``"50 g"``.
    delimiter, decimal : str, optional
        Of a text file: ``","``, ``";"``, ``"tab"``, ``"space"``, …; ``"."`` or ``","``.
    header : int, optional
        Lines before the numbers of a text file; the last of them names the columns. 0: none.
    time_column : str or int, optional
        Name of the column of times, or its number counted from 1; 0: there is none.
    dtype : str, optional
        Of headerless binary: ``"<int16"``, ``">float32"``, …; ``<`` little-endian, ``>`` big.
    n_channels : int, optional
        Of headerless binary.
    offset : int
        Bytes to skip in headerless binary.
    order : {"interleaved", "blocks"}, optional
        Of binary and of arrays: sample by sample (time down the rows), or channel by channel.
    record : int
        Of an array of three dimensions, the index along the first; of rows that are records, the
        row.
    rows : {"records"}, optional
        Of text and of arrays of two dimensions: every row is a record of one channel; of arrays
        every column with ``order="interleaved"``. Several variables become channels.
    resample_to : float, optional
        Sample rate to bring the recording to [Hz].
    tacho : str, optional
        Channel that is resampled by the times of its edges.
    partial : bool
        Of a WAV, TDMS or binary file that is cut short, read the samples that are there.
    like : Profile, optional
        Channels, units and rate where nothing else says them; a rate that differs is refused.

    Raises
    ------
    DataError
        A value is out of its bounds; all faults at once.

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
        """Names asked for; none: the only one there is."""
        if self.variable is None:
            return ()
        return (self.variable,) if isinstance(self.variable, str) else tuple(self.variable)

    def per_channel(
        self, name: Literal["unit", "sensitivity", "full_scale"], channel: str
    ) -> str | None:
        """What is declared about one channel."""
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
            f"rows = {o.rows!r} must be 'records'; leave it out for rows that are none",
        ),
        (o.record < 0, f"record = {o.record} must be >= 0; choose another"),
        (
            isinstance(o.time_column, int) and o.time_column < 0,
            f"time_column = {o.time_column} must be >= 0; count the columns from 1, 0 for none",
        ),
    ]


@dataclass(frozen=True, kw_only=True)
class PartChannel:
    """A channel as the file has it: its name, and its unit where the file declares one."""

    name: str
    unit: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class FilePart:
    """Something in a file that can be one recording; nothing of its signal is read yet.

    Attributes
    ----------
    name : str
        By which it is chosen; empty where the file holds nothing else.
    about : str
        Shape or length, for listings.
    channels : tuple of PartChannel
        As the file has them.
    named : bool
        The names are the file's own.
    n_samples : int
        Per channel.
    fetch : callable
        Reads some samples of some channels, numbers as the file holds them.
    sample_rate : float, optional
        As the file declares it [Hz].
    rate_doubt : float
        Relative uncertainty of a printed rate; 0 where it is exact.
    rate_note : str
        Why the file does not declare a rate though it seems to.
    rate_seen : float, optional
        Number that would be the rate if it had a unit.
    bits : int
        Of integers over full scale, 0 for numbers that stand for themselves.
    conditions : mapping
        Manifest columns that the file declares, in SI.
    known_as : str
        Data set whose documentation declares rate and unit; such a part is chosen first.
    extras : tuple of str
        Further names that a unit may be declared for: the column of times.
    n_records : int
        Records of this layout beside each other, this one among them.
    empty : tuple of str
        Channels of NaN alone, which are left out.
    unread : mapping of str to str
        Columns of numbers in an unknown notation -> what they hold, and the cure.
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
        """One channel as a recording of its own, named like the others.

        Raises
        ------
        DataError
            There is no such row.
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
    """All that a file holds: parts that can be read, and words about what cannot.

    ``wanted`` says what to do where nothing can be chosen; ``close`` releases the file.
    """

    parts: tuple[FilePart, ...]
    others: tuple[str, ...] = ()
    close: Callable[[], None] = _nothing

    def listing(self) -> str:
        """What is inside, for a message."""
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
        Unique in its source.
    unit : str, optional
        Of the numbers that `Source.read` gives: SI, ``FS``, or None where nothing is declared and
        the numbers are the file's.
    quantity : str, optional
        ``acceleration``, …; None where no unit is declared.
    unit_in_file : str
        What was declared, before conversion.
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
        What in the file; empty where it holds one recording.
    channels : tuple of SourceChannel
        Names unique.
    sample_rate : float, optional
        [Hz]; None where neither file nor caller declares it.
    n_samples : int
        Per channel, >= 1.
    conditions : mapping
        Manifest columns that the file declares: ``speed_hz``, ``load_n``, in SI.
    undeclared : tuple of str
        What is missing before the numbers mean something, each with its cure.
    named : bool
        File or caller name the channels.
    n_records : int
        Records of this layout in the file, this one among them.
    empty : tuple of str
        Channels of NaN alone, which are left out.

    Notes
    -----
    Only the samples asked for are read, except of compressed MATLAB and NPZ files, which are
    inflated whole (at most :data:`LARGEST_INFLATED`).
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
            In the units of `channels`.

        Raises
        ------
        DataError
            The range is not within the recording, the file is damaged there, or a sample is not
            finite.
        """
        end = self.n_samples if stop is None else stop
        if not 0 <= start < end <= self.n_samples:
            raise DataError(
                f"{self.path}: samples {start} to {end} must be within 0 to {self.n_samples} and "
                "at least one; ask for others"
            )
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by name
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
                    f"{start + bad[0]}, must be finite; cut or mend the gap"
                )
        raise DataError("\n".join(faults))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def cut(path: Path, size: int, needed: int, *, partial: bool = False) -> DataError:
    """Error about a file shorter than it says; `partial` where what is there can be read."""
    more = ", or read what is there with partial" if partial else ""
    return DataError(f"{path} has {size} byte, must be >= {needed}; take an intact copy{more}")


@contextmanager
def closed_on_failure(
    path: Path, file: Any, faults: type[Exception] | tuple[type[Exception], ...]
) -> Iterator[None]:
    """Close a file that cannot be read; what its parser raises, of these kinds, is damage."""
    try:
        yield
    except DataError:
        file.close()
        raise
    except faults as error:
        file.close()
        raise damaged(path, error) from error


def damaged(path: Path, error: BaseException) -> DataError:
    """Error about a file on which a parser has given up, in one line."""
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
    """Error about a file that does not begin as its suffix says."""
    with path.open("rb") as handle:
        head = handle.read(16)
    if not head:
        return DataError(f"{path} has 0 byte, must be a {wanted} file; take an intact copy")
    for magic, name, suffix in _MAGIC:
        if head.startswith(magic):
            cure = f"rename it to {path.stem}{suffix}" if suffix else "unpack it"
            return DataError(f"{path} is no {wanted} file but begins like {name}; {cure}")
    return DataError(f"{path} does not begin like a {wanted} file; check the suffix")
