"""Time stamps of text files: ISO dates and times of day, in whole nanoseconds."""

import re
from collections.abc import Callable, Iterable, Sequence
from datetime import date

import numpy as np
from numpy.typing import NDArray

_STAMP = re.compile(
    r"(?:(?:(?P<year>\d{4})(?P<mark>[-/.])(?P<month>\d{1,2})(?P=mark)(?P<day>\d{1,2})"
    r"|(?P<day_first>\d{1,2})\.(?P<month_then>\d{1,2})\.(?P<year_last>\d{4}))[T ]\s*)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,](?P<part>\d{1,9}))?"
    r"\s*(?P<zone>Z|(?P<sign>[-+])(?P<zone_hour>\d{2}):?(?P<zone_minute>\d{2})?)?",
    re.ASCII,
)
_UNIT = re.compile(r"(?=.*h)(?=.*m)(?:yyyy|yy|mm|dd|hh|h|ss|f+|s|z|[-/.,:T ])+", re.IGNORECASE)

_SECOND = 10**9  # ns
_DAY = 86_400 * _SECOND


def stamp_ns(text: str) -> int | None:
    """Nanoseconds of a time stamp, from midnight, or from the year 1 where it has a date.

    Parameters
    ----------
    text : str
        ``hh:mm:ss`` with up to nine decimals, behind a date (``2024-05-01``, ``01.05.2024``) or
        none, before a zone (``Z``, ``+02:00``) or none.

    Returns
    -------
    int or None
        None where it is no time stamp, or no date of the calendar. With a zone it is UTC.

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
    day = _day(found)
    if day is None:
        return None
    part = int((found["part"] or "").ljust(9, "0"))
    clock = (hour * 60 + minute) * 60 + second
    if found["sign"]:
        away = int(found["zone_hour"]) * 3600 + int(found["zone_minute"] or 0) * 60
        clock -= away if found["sign"] == "+" else -away
    return day * _DAY + clock * _SECOND + part


def _day(found: re.Match[str]) -> int | None:
    """Number of the date, 0 without one, None where the calendar has no such day."""
    year = found["year"] or found["year_last"]
    if year is None:
        return 0
    month, day = found["month"] or found["month_then"], found["day"] or found["day_first"]
    try:
        return date(int(year), int(month), int(day)).toordinal()
    except ValueError:
        return None


def stamp_resolution(cells: Iterable[str]) -> float:
    """Value of the last digit that any of some stamps has [s].

    Examples
    --------
    >>> stamp_resolution(["12:00:00", "12:00:00.125"])
    0.001
    """
    digits = [len(m["part"] or "") for cell in cells if (m := _STAMP.fullmatch(cell.strip()))]
    return float(f"1e-{max(digits, default=0)}")


def is_stamp_pattern(text: str) -> bool:
    """Whether a unit only says how the time is written, like ``hh:mm:ss.fff``.

    Examples
    --------
    >>> is_stamp_pattern("yyyy-mm-dd hh:mm:ss.fff"), is_stamp_pattern("mm/s"), is_stamp_pattern("h")
    (True, False, False)
    """
    return ":" in text and _UNIT.fullmatch(text) is not None


def stamp_seconds(
    cells: Callable[[int, int], Sequence[str]], refuse: Callable[[int, str], Exception]
) -> Callable[[int, int], NDArray[np.float64]]:
    """Times of stamps since the first one [s], exact to the nanosecond before they are floats.

    Parameters
    ----------
    cells : callable
        Stamps [start, stop).
    refuse : callable
        Error about an index and a text that is no stamp.

    Returns
    -------
    callable
        Seconds [start, stop); times of day go on behind midnight, once.
    """
    [first_text] = cells(0, 1)
    first = stamp_ns(first_text)
    if first is None:
        raise refuse(0, first_text)

    def seconds(start: int, stop: int) -> NDArray[np.float64]:
        found = np.empty(stop - start)
        for i, text in enumerate(cells(start, stop)):
            value = stamp_ns(text)
            if value is None:
                raise refuse(start + i, text)
            apart = value - first
            # without a date, what is before the first one is of the next day
            found[i] = (apart % _DAY if first < _DAY else apart) / _SECOND
        return found

    return seconds
