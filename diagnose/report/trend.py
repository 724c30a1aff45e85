"""Severity over time: a robust line since the last maintenance, and the remaining life."""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...sim.output.recording import DataError

Float = NDArray[np.float64]
Clock = Literal["operating", "calendar"]
Growth = Literal["linear", "log"]

FEWEST_POINTS = 5
"""Fewest recordings since the last maintenance: two for the line, three for its scatter."""

_LONGEST_MOMENT_H: dict[Clock, float] = {"operating": 0.0, "calendar": 1.0}
"""Longest span that counts as one moment [h]: copied files have times seconds apart."""

_SOME_TIME: dict[Clock, str] = {"operating": "some time", "calendar": "more than an hour"}

LONGEST_REACH = 3.0
"""Largest extrapolation of a line, in multiples of the time observed."""

ASSUMPTIONS: dict[Growth, str] = {
    "linear": "wear continues at the present rate, as long as load, speed and lubrication stay "
    "the same (Archard: the worn depth grows with pressure and sliding distance)",
    "log": "wear keeps growing by the same share in equal times, as self-accelerating damage does",
}
"""Assumption behind an extrapolation."""

_DRAWS = 400  # of the bootstrap: a 5 % quantile to about 1 %
_MOST_POINTS = 100  # of a line: the number of pairs grows quadratically, so more points are grouped
_AROUND_STEP = 3  # recordings on either side that show a step
_STEP_SIZE = 4.0  # standard deviations: not once in 10,000 recordings by chance
_LEAST_STEP = 0.1  # of the severity: a smaller drop is no repair
_MAD = 1.4826  # standard deviation of normal scatter over its median absolute deviation
_SMALLEST = 0.1  # of the median severity: lower bound of the value to which scatter is proportional


@dataclass(frozen=True, kw_only=True)
class Outlook:
    """Time from the last recording until the condemning limit is reached.

    Attributes
    ----------
    clock : {"operating", "calendar"}
        Kind of the hours.
    rate : float
        Growth of the severity [m/h]; for growth "log" at the last recording.
    remaining_low_h, remaining_h, remaining_high_h : float or None
        Early end, median and late end of the remaining time [h]; None if beyond `reach_h` or if
        the limit is never reached.
    reach_h : float
        Largest extrapolation of the line [h].
    coverage : float
        Nominal coverage of the band.
    text : str
        The outlook in a sentence.
    assumption : str
        Assumption behind the extrapolation.
    """

    clock: Clock
    rate: float
    remaining_low_h: float | None
    remaining_h: float | None
    remaining_high_h: float | None
    reach_h: float
    coverage: float
    text: str
    assumption: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Trend:
    """Recordings of one machine in order of time, and the line through the last of them.

    Attributes
    ----------
    time_h, severity, low, high : numpy.ndarray [shape=(n,)]
        [h], [m]
    starts : tuple of int
        First recording of each period between two maintenances; the first is 0.
    ahead_h : numpy.ndarray [shape=(n_line,)]
        Times of the line [h], from the last start into the future; empty without a line.
    line, line_low, line_high : numpy.ndarray [shape=(n_line,)]
        [m]
    outlook : Outlook or None
    reason : str
        Why there is no outlook; empty if there is one.
    clock : {"operating", "calendar"}
        Kind of the hours; calendar hours count from 1970.
    coverage : float
        Nominal coverage of the intervals and of the band.
    """

    time_h: Float
    severity: Float
    low: Float
    high: Float
    starts: tuple[int, ...]
    ahead_h: Float
    line: Float
    line_low: Float
    line_high: Float
    outlook: Outlook | None
    reason: str
    clock: Clock
    coverage: float

    @property
    def maintenances_h(self) -> Float:
        """Times of maintenance [h]: halfway between the recordings before and after."""
        first = list(self.starts[1:])
        before = [i - 1 for i in first]
        return np.asarray((self.time_h[before] + self.time_h[first]) / 2)


def fit_trend(
    time_h: ArrayLike,
    severity: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    *,
    limit: float,
    clock: Clock = "operating",
    growth: Growth = "linear",
    coverage: float = 0.9,
    seed: int = 0,
) -> Trend:
    """Fit a line through the severities of one machine since its last maintenance.

    Parameters
    ----------
    time_h : array_like [shape=(n,)]
        Operating hours or calendar times [h], in any order.
    severity, low, high : array_like [shape=(n,)]
        Estimates with their intervals [m], > 0.
    limit : float
        Condemning limit [m].
    clock : {"operating", "calendar"}
        Kind of `time_h`.
    growth : {"linear", "log"}
        Line through the severity (abrasive wear at a steady load) or through its logarithm
        (self-accelerating damage).
    coverage : float
        Coverage of the intervals, and of the band of the remaining life.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    Trend

    Raises
    ------
    DataError
        The numbers of times and severities differ, or a value is not finite or not > 0.

    Notes
    -----
    The line is that of Theil and Sen (median of the slopes of all pairs): a third of the recordings
    may be outliers. A lasting drop of the severity counts as maintenance, and a new line starts
    there.

    The band comes from a bootstrap: the recordings' scatter about the line (as a share of the line)
    is drawn anew, together with one factor for the whole machine, because the estimates of one
    machine share an error. That factor covers the part of the estimates' intervals that the scatter
    does not. The band is valid only under the assumed growth: it does not include a change of load,
    speed or oil after the last recording.

    References
    ----------
    J. F. Archard, "Contact and rubbing of flat surfaces", J. Appl. Phys. 24 (1953) 981-988,
    doi:10.1063/1.1721448; P. K. Sen, "Estimates of the regression coefficient based on Kendall's
    tau", J. Am. Stat. Assoc. 63 (1968) 1379-1389, doi:10.1080/01621459.1968.10480934.

    Examples
    --------
    >>> hours = np.arange(10) * 500.0
    >>> wear = 1e-4 + 2e-8 * hours
    >>> found = fit_trend(hours, wear, 0.98 * wear, 1.02 * wear, limit=3.1e-4)
    >>> found.outlook.remaining_low_h < 6000 < found.outlook.remaining_high_h
    True
    """
    points = _checked(time_h, severity, low, high)
    points = points[:, np.argsort(points[0], kind="stable")]
    starts = _starts(np.log(points[1]))
    last = points[:, starts[-1] :]
    shared = dict(zip(("time_h", "severity", "low", "high"), points, strict=True))
    n, span = last.shape[1], float(last[0, -1] - last[0, 0])
    if n < FEWEST_POINTS or span <= _LONGEST_MOMENT_H[clock]:
        brief = n > 1 and span <= _LONGEST_MOMENT_H[clock]
        lack = "recordings of one moment only" if brief else f"{n} usable recordings"
        since = "" if len(starts) == 1 else " since the last maintenance"
        return Trend(
            **shared,
            starts=starts,
            **{name: np.empty(0) for name in ("ahead_h", "line", "line_low", "line_high")},
            outlook=None,
            reason=f"{lack}{since}, must be >= {FEWEST_POINTS} over {_SOME_TIME[clock]}; record "
            "again, or give the times at which they were recorded",
            clock=clock,
            coverage=coverage,
        )
    lines = _lines(last, growth, coverage, np.random.default_rng(seed))
    outlook = _outlook(lines, last[0, -1], span, limit, clock, growth, coverage)
    ahead = np.linspace(last[0, 0], last[0, -1] + _shown_ahead(outlook, span), 60)
    values = lines.at(ahead)
    tail = 50 * (1 - coverage)
    return Trend(
        **shared,
        starts=starts,
        ahead_h=ahead,
        line=lines.best(ahead),
        line_low=np.percentile(values, tail, axis=0),
        line_high=np.percentile(values, 100 - tail, axis=0),
        outlook=outlook,
        reason="",
        clock=clock,
        coverage=coverage,
    )


def _checked(time_h: ArrayLike, severity: ArrayLike, low: ArrayLike, high: ArrayLike) -> Float:
    """The four as rows [shape=(4, n)]."""
    rows = [np.asarray(values, dtype=np.float64) for values in (time_h, severity, low, high)]
    if len({row.shape for row in rows}) != 1 or rows[0].ndim != 1 or rows[0].size == 0:
        shapes = ", ".join(str(row.shape) for row in rows)
        raise DataError(
            f"time_h, severity, low, high have shapes {shapes}, must be one (n,) with n >= 1; "
            "give one time and one interval for each estimate"
        )
    points = np.stack(rows)
    wrong = ~np.isfinite(points).all(axis=0) | (points[1:] <= 0).any(axis=0)
    if wrong.any():
        i = int(np.flatnonzero(wrong)[0])
        raise DataError(
            f"recording {i} of a trend: time, severity, interval = {points[:, i].tolist()} must be "
            "finite, the severities > 0 m; leave it out"
        )
    return points


# --- maintenance


def _starts(level: Float) -> tuple[int, ...]:
    """First recordings of the periods between maintenances, from logarithms of the severity."""
    if level.size < 2 + 2:
        return (0,)
    moves = np.diff(level)
    scatter = _MAD * float(np.median(np.abs(moves - np.median(moves)))) / math.sqrt(2)
    found = [0]
    bound = -max(_LEAST_STEP, _STEP_SIZE * scatter)
    while (step := _next_start(level, found[-1], bound)) is not None:
        found.append(step)
    return tuple(found)


def _next_start(level: Float, start: int, bound: float) -> int | None:
    """First step down after a start, at the steepest of the recordings that show it."""
    shown = [i for i in range(start + 1, level.size - 1) if _step(level, start, i) < bound]
    if not shown:
        return None
    near = [i for i in shown if i < shown[0] + _AROUND_STEP]
    return min(near, key=lambda i: float(level[i] - level[i - 1]))


def _step(level: Float, start: int, i: int) -> float:
    """Rise of a few recordings from i on over those before; insensitive to one outlier."""
    before, after = level[max(start, i - _AROUND_STEP) : i], np.sort(level[i : i + _AROUND_STEP])
    return float(after[1] - np.median(before))


# --- lines and remaining life


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lines:
    """Lines of a bootstrap; the first is that of the recordings themselves."""

    slope: Float
    offset: Float
    factor: Float  # of the whole machine
    origin: float  # [h]
    growth: Growth

    def best(self, time: Float) -> Float:
        """Severity by the line of the recordings themselves [m, shape=(len(time),)]."""
        return np.asarray(self.at(time)[0])

    def at(self, time: Float) -> Float:
        """Severity by every line [m, shape=(n_lines, len(time))]."""
        values = self.offset[:, None] + self.slope[:, None] * (time - self.origin)
        return (np.exp(values) if self.growth == "log" else values) * self.factor[:, None]

    def reached(self, limit: float) -> Float:
        """When each line reaches a severity [h, shape=(n_lines,)]; inf if it does not grow."""
        aim = limit / self.factor
        aim = np.log(aim) if self.growth == "log" else aim
        grows = self.slope > 0
        late = (aim - self.offset) / np.where(grows, self.slope, 1.0)
        never = np.where(aim > self.offset, math.inf, -math.inf)
        return np.asarray(self.origin + np.where(grows, late, never))


def _lines(points: Float, growth: Growth, coverage: float, rng: np.random.Generator) -> _Lines:
    time, severity = _grouped(points[0], points[1])
    origin = float(time[-1])
    value = np.log(severity) if growth == "log" else severity
    slope, offset = _theil_sen(time - origin, value[None])
    line = offset + slope * (time - origin)
    size = (
        np.maximum(line, _SMALLEST * np.median(value)) if growth == "linear" else np.ones(len(line))
    )
    n = len(time)
    rest = (value - line) / size * math.sqrt(n / (n - 2))
    drawn = line + size * rng.choice(rest, (_DRAWS, n))
    slopes, offsets = _theil_sen(time - origin, drawn)
    return _Lines(
        slope=np.append(slope, slopes),
        offset=np.append(offset, offsets),
        factor=np.append(1.0, _factors(points[1:], rest, coverage, rng)),
        origin=origin,
        growth=growth,
    )


def _grouped(time: Float, severity: Float) -> tuple[Float, Float]:
    """Group neighbouring points if there are too many for all pairs; medians of the severity."""
    if len(time) <= _MOST_POINTS:
        return time, severity
    bounds = np.array_split(np.arange(len(time)), _MOST_POINTS)
    pairs = [(time[part].mean(), np.median(severity[part])) for part in bounds]
    return np.array([t for t, _ in pairs]), np.array([s for _, s in pairs])


def _theil_sen(time: Float, values: Float) -> tuple[Float, Float]:
    """Slopes and offsets [shape=(k,)] of k lines [shape=(k, n)], vectorized unlike scipy's."""
    first, second = np.triu_indices(len(time), 1)
    gap = time[second] - time[first]
    distinct = gap > 0
    rise = values[:, second[distinct]] - values[:, first[distinct]]
    slope = np.median(rise / gap[distinct], axis=1)
    return slope, np.median(values - slope[:, None] * time, axis=1)


def _factors(severities: Float, rest: Float, coverage: float, rng: np.random.Generator) -> Float:
    """Common error factors of all estimates of one machine [shape=(_DRAWS,)].

    They follow two halves of a log-normal distribution that cover the intervals, minus the scatter
    from recording to recording.
    """
    estimate, low, high = severities
    z = NormalDist().inv_cdf((1 + coverage) / 2)
    scatter = _MAD * float(np.median(np.abs(rest)))
    sides = [
        math.sqrt(max((float(np.median(np.log(ratio))) / z) ** 2 - scatter**2, 0.0))
        for ratio in (np.maximum(estimate / low, 1), np.maximum(high / estimate, 1))
    ]
    drawn = rng.standard_normal(_DRAWS)
    return np.exp(drawn * np.where(drawn < 0, sides[0], sides[1]))


def _outlook(
    lines: _Lines,
    last: float,
    span: float,
    limit: float,
    clock: Clock,
    growth: Growth,
    coverage: float,
) -> Outlook:
    left = np.maximum(lines.reached(limit) - last, 0.0)
    reach = LONGEST_REACH * span
    tail = 50 * (1 - coverage)
    # "lower" returns one of the values: infinities cannot be interpolated
    low, median, high = np.percentile(left, [tail, 50, 100 - tail], method="lower").tolist()
    bounded = [value if value <= reach else None for value in (low, median, high)]
    rate = float(lines.slope[0])
    rate *= float(lines.best(np.array([last]))[0]) if growth == "log" else 1.0
    return Outlook(
        clock=clock,
        rate=rate,
        remaining_low_h=bounded[0],
        remaining_h=bounded[1],
        remaining_high_h=bounded[2],
        reach_h=reach,
        coverage=coverage,
        text=_sentence(bounded, reach, clock, coverage),
        assumption=ASSUMPTIONS[growth],
    )


def _sentence(bounded: Sequence[float | None], reach: float, clock: Clock, coverage: float) -> str:
    low, median, high = bounded
    share = f"{100 * coverage:.0f} %"
    if low is None:
        return (
            f"the condemning limit is not reached within {span_words(reach, clock)}, "
            f"{LONGEST_REACH:g} times the time observed; later times cannot be predicted"
        )
    if median == 0:
        return "the condemning limit is reached" + (
            "" if high == 0 else f", or will be within {span_words(high, clock)}" if high else ""
        )
    likely = "" if median is None else f", most likely after {span_words(median, clock)}"
    if high is None:
        sure = f"not reached within {span_words(low, clock)}"
        early = sure if low > 0 else "perhaps reached already"
        return f"the condemning limit is {early}{likely}; the latest time cannot be predicted"
    return f"the condemning limit is reached in {_range_words(low, high, clock)} ({share}){likely}"


def _range_words(low: float, high: float, clock: Clock) -> str:
    """Two lengths of time, with the unit only once if it is the same."""
    first, last = span_words(low, clock), span_words(high, clock)
    number, _, unit = first.partition(" ")
    return f"{number if last.endswith(f' {unit}') else first} to {last}"


def _shown_ahead(outlook: Outlook, span: float) -> float:
    """Range of a picture beyond the last recording [h]."""
    late = outlook.remaining_high_h or outlook.remaining_h
    if outlook.remaining_h == 0:
        return 0.1 * span
    return min(1.1 * late, outlook.reach_h) if late else 0.5 * span


def span_words(hours: float, clock: Clock = "calendar") -> str:
    """A length of time in words, with two figures.

    Examples
    --------
    >>> span_words(30), span_words(24 * 40), span_words(24 * 400), span_words(1234, "operating")
    ('30 h', '40 days', '13 months', '1200 h of operation')
    """
    if clock == "operating":
        return f"{_two_figures(hours)} h of operation"
    if hours < 72:
        return f"{_two_figures(hours)} h"
    if hours < 24 * 92:
        return f"{_two_figures(hours / 24)} days"
    months = hours / (24 * 365.25 / 12)
    return f"{_two_figures(months)} months" if months < 48 else f"{_two_figures(months / 12)} years"


def _two_figures(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}" if value < 1e5 else f"{float(f'{value:.2g}'):.0f}"


# --- when a recording was made

_DATE = re.compile(
    r"(?<!\d)(\d{4})[-_.]?(\d\d)[-_.]?(\d\d)(?:[T_ -]?(\d\d)[-:.h]?(\d\d)(?:[-:.]?(\d\d))?)?(?!\d)"
)
_DAY_FIRST = re.compile(r"(?<!\d)(\d\d)\.(\d\d)\.(\d{4})(?!\d)")  # with dots the day is first


def date_in(text: str) -> datetime | None:
    """Date and, if present, time in a file name or a cell, taken as UTC.

    The year comes first, or the day with dots between (``01.03.2024``, without a time).

    Examples
    --------
    >>> date_in("pump3_2024-03-01_0830.wav").isoformat()
    '2024-03-01T08:30:00+00:00'
    >>> date_in("run 12.wav") is None
    True
    """
    for match in _DATE.finditer(text):
        try:
            year, month, day, *clock = (int(part) for part in match.groups(default="0"))
            hour, minute, second = clock
            return datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:  # numbers that are no date
            continue
    for match in _DAY_FIRST.finditer(text):
        try:
            day, month, year = (int(part) for part in match.groups())
            return datetime(year, month, day, tzinfo=UTC)
        except ValueError:
            continue
    return None


def hours_of(moment: datetime) -> float:
    """Calendar hours since 1970 [h]."""
    return moment.timestamp() / 3600


def read_dates(path: Path) -> dict[str, float]:
    """Times of recordings from a table of two columns, ``file`` and ``date`` or ``hours``.

    Parameters
    ----------
    path : Path
        CSV with a heading; dates begin with the year.

    Returns
    -------
    dict
        File name -> time [h]; dates count from 1970.

    Raises
    ------
    DataError
        The file or a column is missing, a date cannot be read, a name occurs twice; all at once.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as handle:
            rows = list(csv.reader(handle))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(
            f"{path} cannot be read ({error}); name a CSV file with columns file,date"
        ) from error
    heading = [cell.strip().lower() for cell in rows[0]] if rows else []
    if len(heading) < 2 or heading[0] != "file" or heading[1] not in ("date", "hours"):
        raise DataError(
            f"{path}: heading = {','.join(heading)!r} must be file,date or file,hours; correct it"
        )
    times: dict[str, float] = {}
    faults: list[str] = []
    for number, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        name, value = row[0].strip(), _time_in(row[1] if len(row) > 1 else "", heading[1])
        if value is None:
            faults.append(f"{path}: line {number}: {row[1:2]} must be a {heading[1]}; correct it")
        elif name in times:
            faults.append(
                f"{path}: line {number}: {name} occurs twice, must occur once; delete one"
            )
        else:
            times[name] = value
    if faults:
        raise DataError("\n".join(faults))
    return times


def _time_in(cell: str, kind: str) -> float | None:
    if kind == "date":
        moment = date_in(cell)
        return None if moment is None else hours_of(moment)
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
