"""Universal file format, data set 58: time records in ASCII or binary, read in pieces.

Implemented here because existing libraries hold the whole file in memory and end a binary set at
numbers that happen to look like the end mark. The layout is that of the SDRL description of data
sets 58, 58b and 164.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from ..source.part import Contents, FilePart, PartChannel, SourceOptions, cut, foreign
from ..source.time_column import even_rate, printed_resolution
from .flat import Flat
from .text_lines import Lines, index_lines

_MARK = b"    -1"
_LONGEST_LINE = 1024  # byte; 80 by the standard
_MOST_SETS = 10_000
_HEADER_LINES = 11
_TIME_RESPONSE, _GENERAL = 1, 0
_TIME = 17
_KINDS = {
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response function",
    5: "transmissibility",
    6: "coherence",
    7: "auto correlation",
    8: "cross correlation",
    9: "power spectral density",
    10: "energy spectral density",
    12: "spectrum",
}
_AXES = {1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}
_SI = {8: "m", 11: "m/s", 12: "m/s^2", 9: "N", 13: "N", 15: "Pa"}
"""SI unit of a quantity by the code of specific data types."""

_LENGTH_POWER = {8: 1, 11: 1, 12: 1, 9: 0, 13: 0, 15: -2}
_FORCE_POWER = {8: 0, 11: 0, 12: 0, 9: 1, 13: 1, 15: 1}
_SINGLE, _DOUBLE = 13, 20  # characters of a printed number


_Run = Callable[[int, int], NDArray[np.float64]]
"""Samples [start, stop) of one set."""


@dataclass(frozen=True, kw_only=True)
class _Set:
    """One data set 58: its header, and the location of its numbers."""

    name: str
    unit: str
    quantity: int
    kind: int
    abscissa: int
    real: bool
    double: bool
    even: bool
    count: int
    step: float
    step_doubt: float
    lines: Lines | None = None
    begin: int = 0
    order: str = "<"

    @property
    def is_time_record(self) -> bool:
        return self.real and (
            self.kind == _TIME_RESPONSE or (self.kind == _GENERAL and self.abscissa == _TIME)
        )

    @property
    def per_sample(self) -> int:
        """Numbers stored per sample: an unevenly spaced one is preceded by its time."""
        return 1 if self.even else 2

    @property
    def widths(self) -> tuple[int, ...]:
        """Widths of the numbers of a line [characters]."""
        if not self.double:
            return (_SINGLE,) * 6
        return (_DOUBLE,) * 4 if self.even else (_SINGLE, _DOUBLE) * 2

    @property
    def per_line(self) -> int:
        """Count of numbers in a full line."""
        return len(self.widths)


def uff_contents(path: Path, options: SourceOptions) -> Contents:
    """Time records of a universal file; those of one length and rate are one recording.

    Raises
    ------
    DataError
        If it is not a universal file, truncated, or a header contradicts its numbers.
    """
    del options
    size = path.stat().st_size
    sets: list[_Set] = []
    others: list[str] = []
    scales: tuple[float, float] | None = None
    with path.open("rb") as handle:
        if not handle.readline(_LONGEST_LINE).rstrip() == _MARK:
            raise foreign(path, "UFF")
        handle.seek(0)
        while (kind := _next_set(path, handle)) is not None:
            if len(sets) + len(others) > _MOST_SETS:
                raise DataError(f"{path} holds > {_MOST_SETS} sets, too many; split it")
            number = kind[:6].strip()
            if number == b"164":
                scales = _unit_system(path, handle)
            elif number == b"58":
                found = _read_set(path, handle, kind, size)
                if found.is_time_record:
                    sets.append(found)
                else:
                    others.append(_about(found))
            else:
                others.append(f"set {number.decode('latin-1')}")
            _skip_to_mark(path, handle)
    return Contents(parts=_parts(path, sets, scales), others=tuple(dict.fromkeys(others)))


def _about(item: _Set) -> str:
    return f"{item.name} {_KINDS.get(item.kind, f'function of type {item.kind}')}"


def _next_set(path: Path, handle: BinaryIO) -> bytes | None:
    """Line with the number of the next set, None at the end of the file."""
    while line := handle.readline(_LONGEST_LINE):
        if line.rstrip() == _MARK:
            head = handle.readline(_LONGEST_LINE)
            if not head.strip():
                raise DataError(f"{path} ends within a set; take an intact copy")
            return head.rstrip(b"\r\n")
        if line.strip():
            raise DataError(
                f"{path} has {line[:20]!r} between two sets, must have the mark -1; take an intact "
                "copy"
            )
    return None


def _skip_to_mark(path: Path, handle: BinaryIO) -> None:
    while line := handle.readline(_LONGEST_LINE):
        if line.rstrip() == _MARK:
            return
    raise DataError(f"{path} ends within a set; take an intact copy")


def _unit_system(path: Path, handle: BinaryIO) -> tuple[float, float]:
    """Metres and newtons per unit of the file, from data set 164."""
    handle.readline(_LONGEST_LINE)
    factors = [
        float(token.replace(b"D", b"E"))
        for token in handle.readline(_LONGEST_LINE).split()
        if _is_float(token)
    ]
    if len(factors) < 2 or not all(math.isfinite(f) and f > 0 for f in factors[:2]):
        raise DataError(
            f"{path}: set 164 has the factors {factors}, must have >= 2 that are > 0; take an "
            "intact copy"
        )
    # the file's numbers are SI times the factor
    return 1.0 / factors[0], 1.0 / factors[1]


def _is_float(token: bytes) -> bool:
    try:
        float(token.replace(b"D", b"E"))
    except ValueError:
        return False
    return b"_" not in token


def _read_set(path: Path, handle: BinaryIO, kind: bytes, size: int) -> _Set:
    head = [handle.readline(_LONGEST_LINE).rstrip(b"\r\n") for _ in range(_HEADER_LINES)]
    item = _header(path, [line.decode("utf-8", errors="replace") for line in head])
    if kind[6:7].lower() == b"b":
        return _binary(path, handle, item, kind, size)
    return _printed(path, handle, item) if item.is_time_record else item


def _header(path: Path, head: list[str]) -> _Set:
    """Set described by the eleven lines before the numbers."""
    form, abscissa, ordinate = head[6], head[7], head[8]
    code, count, even = (_integer(path, form, 10 * i, 10) for i in range(3))
    if code not in (2, 4, 5, 6) or count < 1 or even not in (0, 1):
        raise DataError(
            f"{path}: a set of type {code}, {count} values and spacing {even} must be of type 2, "
            "4, 5 or 6, >= 1 value and spacing 0 or 1; take an intact copy"
        )
    step_text = form[43:56].strip()
    step = _number(path, step_text) if even else 0.0
    return _Set(
        name=_name(head[5], head[0]),
        unit=_label(ordinate[47:67]),
        quantity=_integer(path, ordinate, 0, 10),
        kind=_integer(path, head[5], 0, 5),
        abscissa=_integer(path, abscissa, 0, 10),
        real=code in (2, 4),
        double=code in (4, 6),
        even=even == 1,
        count=count,
        step=step,
        step_doubt=_doubt(step_text, step),
    )


def _integer(path: Path, line: str, start: int, width: int) -> int:
    text = line[start : start + width].strip()
    try:
        return int(text or "0")
    except ValueError:
        raise DataError(
            f"{path}: {text[:20]!r} in a header of set 58 must be a whole number; take an "
            "intact copy"
        ) from None


def _number(path: Path, text: str) -> float:
    try:
        return float(text.replace("D", "E"))
    except ValueError:
        raise DataError(
            f"{path}: {text[:20]!r} in a header of set 58 must be a number; take an intact copy"
        ) from None


def _doubt(text: str, step: float) -> float:
    """Relative uncertainty of a printed step: half its last digit."""
    return 0.5 * printed_resolution([text]) / step if math.isfinite(step) and step > 0 else 0.0


def _label(text: str) -> str:
    label = text.strip()
    return "" if label.upper() == "NONE" else label


def _name(identification: str, description: str) -> str:
    """Node and degree of freedom of the response; the description if it has neither."""
    entity = _label(identification[31:41])
    node, direction = identification[41:51].strip(), identification[51:55].strip()
    if entity:
        return entity
    if node not in ("", "0") and direction.lstrip("-").isdigit():
        axis = _AXES.get(abs(int(direction)))
        sign = "-" if direction.startswith("-") else "+"
        return f"{node}:{sign}{axis}" if axis else node
    return _label(description[:80]) or "channel"


def _binary(path: Path, handle: BinaryIO, item: _Set, kind: bytes, size: int) -> _Set:
    """A set 58b: its numbers are skipped by their declared size, whatever they look like."""
    line, begin = kind.decode("latin-1"), handle.tell()
    order, form = _integer(path, line, 7, 6), _integer(path, line, 13, 6)
    length = _integer(path, line, 31, 12)
    if length < 0 or begin + length > size:
        raise cut(path, size, begin + max(length, 1))
    handle.seek(begin + length)
    _refuse_no_mark(path, handle)
    if not item.is_time_record:
        return item
    if order not in (1, 2) or form != 2:
        raise DataError(
            f"{path}: byte order {order} and number format {form} must be 1 or 2, and 2 (IEEE "
            "754); export it again"
        )
    wanted = item.count * item.per_sample * (8 if item.double else 4)
    # storage of the time with double precision is not standardised
    if length != wanted or (item.double and not item.even):
        raise DataError(
            f"{path}: {item.name} has {length} byte for {item.count} value(s), must have {wanted}; "
            "take an intact copy, or export it evenly spaced"
        )
    return replace(item, begin=begin, order="<" if order == 1 else ">")


def _refuse_no_mark(path: Path, handle: BinaryIO) -> None:
    """Check the mark after the binary numbers, on the same or the next line; do not consume it."""
    place = handle.tell()
    line = handle.readline(_LONGEST_LINE)
    if not line.strip():
        place, line = handle.tell(), handle.readline(_LONGEST_LINE)
    if line.rstrip() != _MARK:
        raise DataError(
            f"{path} has no mark -1 behind the binary numbers that it declares; take an intact copy"
        )
    handle.seek(place)


def _printed(path: Path, handle: BinaryIO, item: _Set) -> _Set:
    """A set in ASCII: as many lines as its numbers fill."""
    begin = end = handle.tell()
    wanted = -(-item.count * item.per_sample // item.per_line)
    for found in range(wanted):
        line = handle.readline(_LONGEST_LINE)
        if not line.strip() or line.rstrip() == _MARK:
            raise DataError(
                f"{path}: {item.name} has {found} lines of numbers, must have {wanted} for "
                f"{item.count} value(s); take an intact copy"
            )
        end = handle.tell()
    return replace(item, lines=index_lines(path, begin, 0, end))


# --- sets to parts


def _parts(
    path: Path, sets: Sequence[_Set], scales: tuple[float, float] | None
) -> tuple[FilePart, ...]:
    """One part of all sets if they fit together; otherwise one for each."""
    fetches = [_fetcher(path, item) for item in sets]
    rates = [_rate(path, item) for item in sets]
    channels = [PartChannel(name=item.name, unit=_unit(item, scales)) for item in sets]
    names = _unique([item.name for item in sets])
    singles = tuple(
        FilePart(
            name=name,
            about=f"(1, {item.count})",
            channels=(channel,),
            named=True,
            n_samples=item.count,
            fetch=partial(_stacked, [fetch]),
            sample_rate=rate[0],
            rate_doubt=rate[1],
        )
        for name, item, channel, fetch, rate in zip(
            names, sets, channels, fetches, rates, strict=True
        )
    )
    alike = len({(item.count, rate[0]) for item, rate in zip(sets, rates, strict=True)}) == 1
    if not alike or len({item.name for item in sets}) < len(sets):
        return singles
    whole = replace(
        singles[0],
        name="",
        about=f"({len(sets)}, {sets[0].count})",
        channels=tuple(channels),
        fetch=partial(_stacked, fetches),
    )
    return (whole,)


def _stacked(
    runs: Sequence[_Run], start: int, stop: int, rows: tuple[int, ...]
) -> NDArray[np.float64]:
    return np.stack([runs[row](start, stop) for row in rows])


def _unique(names: Sequence[str]) -> list[str]:
    """Names, with a number added to repeated ones."""
    return [
        name if names.count(name) == 1 else f"{name}#{names[: i + 1].count(name)}"
        for i, name in enumerate(names)
    ]


def _unit(item: _Set, scales: tuple[float, float] | None) -> str | None:
    """Unit by the label, or else by the quantity and the file's unit system (data set 164)."""
    if item.unit:
        return item.unit
    if scales is None or item.quantity not in _SI:
        return None
    length, force = scales
    factor = length ** _LENGTH_POWER[item.quantity] * force ** _FORCE_POWER[item.quantity]
    return f"{factor!r} {_SI[item.quantity]}"


def _rate(path: Path, item: _Set) -> tuple[float, float]:
    """Sample rate and its relative uncertainty."""
    if item.even:
        if not (math.isfinite(item.step) and item.step > 0):
            raise DataError(
                f"{path}: {item.name} has a step of {item.step} s, must be > 0 and finite; take an "
                "intact copy"
            )
        return 1.0 / item.step, item.step_doubt
    times = partial(_values, item, _numbers(path, item), 0)
    last = float(times(item.count - 1, item.count)[0])
    # five digits are printed after the first
    resolution = 10.0 ** (math.floor(math.log10(abs(last))) - 5) if last and item.lines else 0.0
    clock = even_rate(path, item.name, times, item.count, resolution)
    return 1.0 / clock.step, clock.doubt


def _fetcher(path: Path, item: _Set) -> _Run:
    return partial(_values, item, _numbers(path, item), item.per_sample - 1)


def _values(item: _Set, numbers: _Run, which: int, start: int, stop: int) -> NDArray[np.float64]:
    """Ordinates or abscissas of some samples."""
    stride = item.per_sample
    return numbers(start * stride, stop * stride)[which::stride]


def _numbers(path: Path, item: _Set) -> _Run:
    """Numbers of a set as stored, including abscissas."""
    if item.lines is not None:
        return partial(_from_lines, path, item, item.lines)
    flat = Flat(
        place=path,
        offset=item.begin,
        code=f"{item.order}f{8 if item.double else 4}",
        n_channels=1,
        n_samples=item.count * item.per_sample,
        interleaved=False,
    )
    return partial(_from_bytes, flat)


def _from_bytes(flat: Flat, start: int, stop: int) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore"):  # a signalling NaN is refused by name later
        return np.asarray(flat.fetch(start, stop, (0,))[0], dtype=np.float64)


def _from_lines(path: Path, item: _Set, lines: Lines, start: int, stop: int) -> NDArray[np.float64]:
    per_line = item.per_line
    first, last = start // per_line, -(-stop // per_line)
    rows = lines.read(first, last)
    total = item.count * item.per_sample
    wanted = min(last * per_line, total) - first * per_line
    tokens = b" ".join(rows).replace(b"D", b"E").split()
    if len(tokens) != wanted:  # numbers of full width leave no blank between them
        tokens = [cell for row in rows for cell in _cells(row, item.widths)]
    try:
        found = np.array(tokens, dtype="S32").astype(np.float64)
    except ValueError as error:
        raise DataError(f"{path}: {item.name} holds {error}, must be numbers; correct it") from None
    if len(found) != wanted:
        raise DataError(
            f"{path}: {item.name} has {len(found)} numbers in lines {first} to {last} of it, must "
            f"have {wanted}; take an intact copy"
        )
    return found[start - first * per_line : stop - first * per_line]


def _cells(row: bytes, widths: Sequence[int]) -> list[bytes]:
    """Numbers of one line by their columns."""
    ends = np.cumsum(widths).tolist()
    line = row.rstrip().replace(b"D", b"E")
    cells = [line[end - width : end] for end, width in zip(ends, widths, strict=True)]
    return [cell for cell in cells if cell.strip()]
