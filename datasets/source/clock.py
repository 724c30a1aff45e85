"""Time stamps of text files: dates and times of day, in whole nanoseconds."""

import re
from collections.abc import Callable, Iterable, Sequence
from datetime import date

import numpy as np
from numpy.typing import NDArray

_STAMP = re.compile(
    r"(?:(?:(?P<year>\d{4})(?P<mark>[-/.])(?P<month>\d{1,2})(?P=mark)(?P<day>\d{1,2})"
    r"|(?P<one>\d{1,2})(?P<between>[-/.])(?P<two>\d{1,2})(?P=between)(?P<year_last>\d{4}))"
    r"[T ]\s*)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,](?P<part>\d{1,9}))?"
    r"\s*(?P<zone>Z|(?P<sign>[-+])(?P<zone_hour>\d{2}):?(?P<zone_minute>\d{2})?)?",
    re.ASCII,
)
_UNIT = re.compile(r"(?=.*h)(?=.*m)(?:yyyy|yy|mm|dd|hh|h|ss|f+|s|z|[-/.,:T ])+", re.IGNORECASE)

_SECOND = 10**9  # ns
_DAY = 86_400 * _SECOND


def stamp_ns(text: str, *, month_first: bool = False) -> int | None:
    """Nanoseconds of a time stamp since midnight, or since the year 1 if it has a date.

    Parameters
    ----------
    text : str
        ``hh:mm:ss`` with up to nine decimals, optionally after a date (``2024-05-01``,
        ``01.05.2024``, ``01/05/2024``) and before a zone (``Z``, ``+02:00``).
    month_first : bool
        Whether the month comes first in dates that end in the year; dates with points have the day
        first.

    Returns
    -------
    int or None
        None if it is not a time stamp, or not a date of the calendar. With a zone it is UTC.

    Examples
    --------
    >>> stamp_ns("00:00:01.5"), stamp_ns("24:00:00"), stamp_ns("1.5")
    (1500000000, None, None)
    >>> stamp_ns("2024-05-01T02:00:00+02:00") == stamp_ns("01.05.2024 00:00:00")
    True
    """
    found = _STAMP.fullmatch(text.strip())
    if found is None:
        return None
    hour, minute, second = (int(found[name]) for name in ("hour", "minute", "second"))
    if hour > 23 or minute > 59 or second > 59:
        return None
    day = _day(found, month_first)
    if day is None:
        return None
    part = int((found["part"] or "").ljust(9, "0"))
    clock = (hour * 60 + minute) * 60 + second
    if found["sign"]:
        away = int(found["zone_hour"]) * 3600 + int(found["zone_minute"] or 0) * 60
        clock -= away if found["sign"] == "+" else -away
    return day * _DAY + clock * _SECOND + part


def is_stamp(text: str) -> bool:
    """Whether a text is a time stamp, with the day or the month first.

    Examples
    --------
    >>> [is_stamp(f"{day} 12:00:00") for day in ("23/11/2026", "11/23/2026", "23/23/2026")]
    [True, True, False]
    """
    return stamp_ns(text) is not None or stamp_ns(text, month_first=True) is not None


def months_first(first: str, last: str) -> bool | None:
    """Whether dates that end in the year begin with the month; None if undetermined.

    Parameters
    ----------
    first, last : str
        Stamps of one recording, the later one last. If they are of the same day, it does not
        matter.

    Examples
    --------
    >>> months_first("11/23/2026 23:59:59", "11/24/2026 00:00:01")
    True
    >>> months_first("05/06/2026 10:00:00", "05/06/2026 10:00:01")
    False
    >>> months_first("05/06/2026 23:59:59", "06/06/2026 00:00:01") is None
    True
    """
    stamps = (first, last)
    fits = [
        all(stamp_ns(text, month_first=m) is not None for text in stamps) for m in (False, True)
    ]
    found = [_STAMP.fullmatch(text.strip()) for text in stamps]
    days = {(m["one"], m["two"], m["year_last"]) for m in found if m}
    free = any(m is not None and m["between"] in ("/", "-") for m in found)
    if all(fits) and free and len(days) > 1:
        return None
    return fits == [False, True]


def _day(found: re.Match[str], month_first: bool) -> int | None:
    """Number of the date; 0 without one, None if the calendar has no such day."""
    if found["year"]:
        year, month, day = found["year"], found["month"], found["day"]
    elif found["year_last"]:
        year, one, two = found["year_last"], found["one"], found["two"]
        swapped = month_first and found["between"] != "."
        month, day = (one, two) if swapped else (two, one)
    else:
        return 0
    try:
        return date(int(year), int(month), int(day)).toordinal()
    except ValueError:
        return None


def stamp_resolution(cells: Iterable[str]) -> float:
    """Smallest resolution of some stamps, by their last digits [s].

    Examples
    --------
    >>> stamp_resolution(["12:00:00", "12:00:00.125"])
    0.001
    """
    digits = [len(m["part"] or "") for cell in cells if (m := _STAMP.fullmatch(cell.strip()))]
    return float(f"1e-{max(digits, default=0)}")


def is_stamp_pattern(text: str) -> bool:
    """Whether a unit is a pattern for the time, like ``hh:mm:ss.fff``.

    Examples
    --------
    >>> is_stamp_pattern("yyyy-mm-dd hh:mm:ss.fff"), is_stamp_pattern("mm/s"), is_stamp_pattern("h")
    (True, False, False)
    """
    return ":" in text and _UNIT.fullmatch(text) is not None


def stamp_seconds(
    cells: Callable[[int, int], Sequence[str]],
    refuse: Callable[[int, str], Exception],
    month_first: bool = False,
) -> Callable[[int, int], NDArray[np.float64]]:
    """Times since the first stamp [s], computed to the nanosecond before conversion to float.

    Parameters
    ----------
    cells : callable
        Stamps [start, stop).
    refuse : callable
        Returns the error for an index and a text that is no stamp.
    month_first : bool
        See :func:`stamp_ns`.

    Returns
    -------
    callable
        Seconds [start, stop); times of day continue past midnight, once.
    """
    [first_text] = cells(0, 1)
    first = stamp_ns(first_text, month_first=month_first)
    if first is None:
        raise refuse(0, first_text)

    def seconds(start: int, stop: int) -> NDArray[np.float64]:
        found = np.empty(stop - start)
        for i, text in enumerate(cells(start, stop)):
            value = stamp_ns(text, month_first=month_first)
            if value is None:
                raise refuse(start + i, text)
            apart = value - first
            # without a date, a time before the first one is of the next day
            found[i] = (apart % _DAY if first < _DAY else apart) / _SECOND
        return found

    return seconds
