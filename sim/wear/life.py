"""A joint over its life: wear at a rate that depends on the clearance, running in, maintenance.

Worn volume grows as ``dV/dt = k r(t) P(V)`` with the specific wear rate k, the sliding power P at
the present clearance, and ``r = 1 + a exp(-t / t_r)`` while a new surface runs in. P is
tabulated and linear between its knots, so that the equation has a closed form: no time step, and
no error except that of the table, which falls with the square of the knots' distance.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import lambertw

from .archard import Float

MOST_EVENTS = 10_000
"""Most events of one history: a machine repaired more often wears out within hours."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WearLaw:
    """Wear speed of a joint as a function of its wear.

    Attributes
    ----------
    volume : numpy.ndarray [shape=(n,)]
        Worn volume at the knots [m^3], rising.
    power : numpy.ndarray [shape=(n,)]
        Contact force times sliding speed at the knots, mean over operation [W], > 0.
    severity_of, volume_of : callable
        From worn volume to severity [m], and back.

    Raises
    ------
    ValueError
        The knots do not rise, or there is no sliding at one of them; all faults together.

    Examples
    --------
    A bush that gains 1 m of clearance per m^2 times m of volume, under 1 kW of sliding:

    >>> law = WearLaw(
    ...     volume=np.array([0.0, 1e-3]),
    ...     power=np.array([1e3, 1e3]),
    ...     severity_of=lambda volume: volume,
    ...     volume_of=lambda severity: severity,
    ... )
    >>> round(law.grown(0.0, 1e-7), 12)
    0.0001
    """

    volume: Float
    power: Float
    severity_of: Callable[[float], float]
    volume_of: Callable[[float], float]

    def __post_init__(self) -> None:
        """Refuse a law without a solution."""
        faults = []
        if self.volume.size < 2 or not (np.diff(self.volume) > 0).all():
            faults.append(f"volume = {_few(self.volume)} m^3 must be two or more that rise")
        if not (np.isfinite(self.power).all() and (self.power > 0).all()):
            faults.append(
                f"power = {_few(self.power)} W must be > 0 at every knot; a joint without "
                "sliding has no life to simulate: load it, or end at a smaller severity"
            )
        if faults:
            raise ValueError("; ".join(faults))

    def work(self, volume: float) -> float:
        """``k int r dt`` from the first knot to a volume [m^2 s/N]."""
        i = self._segment(self.volume, volume)
        below, power = volume - self.volume[i], self.power[i]
        return float(self._ticks[i] + below / power * _log1p_over(self._slopes[i] * below / power))

    def grown(self, volume: float, work: float) -> float:
        """Volume after additional ``k int r dt`` [m^3]; extrapolated linearly beyond the table."""
        reached = self.work(volume) + work
        i = self._segment(self._ticks, reached)
        after = reached - self._ticks[i]
        gained = self.power[i] * after * _expm1_over(self._slopes[i] * after)
        return float(self.volume[i] + gained)

    def power_at(self, volume: float) -> float:
        """Sliding power at a worn volume [W]."""
        i = self._segment(self.volume, volume)
        return float(self.power[i] + self._slopes[i] * (volume - self.volume[i]))

    @cached_property
    def _slopes(self) -> Float:
        return np.asarray(np.diff(self.power) / np.diff(self.volume))

    @cached_property
    def _ticks(self) -> Float:
        """Work at the knots."""
        steps, begin = np.diff(self.volume), self.power[:-1]
        parts = [
            step / power * _log1p_over(slope * step / power)
            for step, power, slope in zip(steps, begin, self._slopes, strict=True)
        ]
        return np.concatenate([[0.0], np.cumsum(parts)])

    def _segment(self, knots: Float, value: float) -> int:
        """Index of the knot before a value; the end segments extend beyond the table."""
        return min(max(bisect_right(knots, value) - 1, 0), len(knots) - 2)


def _few(values: Float) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _log1p_over(x: float) -> float:
    """``ln(1 + x) / x``, 1 at 0."""
    return math.log1p(x) / x if x else 1.0


def _expm1_over(x: float) -> float:
    """``(exp(x) - 1) / x``, 1 at 0."""
    return math.expm1(x) / x if x else 1.0


@dataclass(frozen=True, kw_only=True)
class RunningIn:
    """Faster wear of a new surface, by ``excess * exp(-t / time)``.

    Attributes
    ----------
    excess : float
        Initial excess over the steady rate [-], 0 <= excess <= 100.
    time : float
        Time in which the excess falls to 1/e [s], > 0.
    """

    excess: float = 0.0
    time: float = 1.0

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        faults = []
        if not 0 <= self.excess <= _EXCESS_MOST:
            faults.append(f"excess = {self.excess} must be >= 0 and <= {_EXCESS_MOST:g}")
        if not self.time > 0:
            faults.append(f"time = {self.time} s must be > 0; set excess = 0 for no running in")
        if faults:
            raise ValueError("; ".join(faults))

    def equivalent(self, age: float) -> float:
        """Time at the steady rate with the same wear as the first `age` of a surface [s]."""
        return age - self.excess * self.time * math.expm1(-age / self.time)

    def age(self, equivalent: float) -> float:
        """Age of a surface from that steady time: the inverse, by Lambert's function [s]."""
        rest = equivalent / self.time - self.excess
        return self.time * (rest + float(lambertw(self.excess * math.exp(-rest)).real))


_EXCESS_MOST = 100.0  # a surface that wears a hundred times faster is not running in but failing


@dataclass(frozen=True, kw_only=True)
class Maintenance:
    """Maintenance of a joint: action and interval.

    Attributes
    ----------
    restores : float
        Share of the worn volume that it restores, 0 < share <= 1; 1 is a renewal: a new surface
        with a clearance of its own, which runs in again.
    every : float or None
        Operating time between two actions, counted from the machine's first start [s].
    at : float or None
        Severity at which the action is due [m]. Give one of the two.
    """

    restores: float
    every: float | None = None
    at: float | None = None

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        faults = []
        if not 0 < self.restores <= 1:
            faults.append(f"restores = {self.restores} must be > 0 and <= 1; 1 renews")
        if (self.every is None) == (self.at is None):
            faults.append(f"every = {self.every} and at = {self.at} must be one of them; keep one")
        if self.every is not None and not self.every > 0:
            faults.append(f"every = {self.every} s must be > 0; lengthen it")
        if faults:
            raise ValueError("; ".join(faults))


class _Piece(NamedTuple):
    """A period of operation between two events."""

    begin: float  # [s]
    volume: float  # at its start [m^3]
    as_new: float  # volume when the surface was new [m^3]
    born: float  # start of the surface's life [s]
    events: int  # before it


@dataclass(frozen=True, kw_only=True, eq=False)
class LifeHistory:
    """Wear of one machine over operating time; from :func:`life_history`.

    Attributes
    ----------
    law : WearLaw
    wear_rate : float
        Specific wear rate of this machine [m^2/N].
    running_in : RunningIn
    pieces : tuple
        Periods between events, from the start on.
    crossings : tuple of float
        Times at which the limit is reached from below [s].
    limit : float
        Condemning severity [m].
    """

    law: WearLaw
    wear_rate: float
    running_in: RunningIn
    pieces: tuple[_Piece, ...]
    crossings: tuple[float, ...]
    limit: float

    def volume(self, time: float) -> float:
        """Worn volume after an operating time [m^3]; at an event, after it."""
        return _volume_at(self.law, self.wear_rate, self.running_in, self._piece(time), time)

    def severity(self, time: float) -> float:
        """Severity after an operating time [m]."""
        return self.law.severity_of(self.volume(time))

    def rate(self, time: float) -> float:
        """Rate of wear by volume [m^3/s]."""
        age = time - self._piece(time).born
        fresh = 1 + self.running_in.excess * math.exp(-age / self.running_in.time)
        return self.wear_rate * fresh * self.law.power_at(self.volume(time))

    def events(self, time: float) -> int:
        """Number of repairs and renewals so far."""
        return self._piece(time).events

    def remaining(self, time: float) -> float:
        """Operating time until the limit is next reached [s].

        0 at and beyond the limit; NaN if maintenance keeps the machine below it throughout the
        period that was looked ahead.
        """
        if self.severity(time) >= self.limit:
            return 0.0
        return next((cross - time for cross in self.crossings if cross >= time), math.nan)

    def share(self, time: float) -> float:
        """Age of the surface over its age at the next renewal, planned or after failure [-].

        NaN if no renewal occurs in the period that was looked ahead.
        """
        born = self._piece(time).born
        renewed = next((piece.born for piece in self.pieces if piece.born > time), math.nan)
        return (time - born) / (renewed - born)

    def _piece(self, time: float) -> _Piece:
        place = bisect_right(self.pieces, time, key=lambda piece: piece.begin) - 1
        return self.pieces[max(place, 0)]


def life_history(
    law: WearLaw,
    wear_rate: float,
    *,
    as_new: Iterable[float],
    limit: float,
    end: float,
    until: float,
    running_in: RunningIn | None = None,
    maintenance: Sequence[Maintenance] = (),
) -> LifeHistory:
    """Wear of one machine over its life, including maintenance.

    Parameters
    ----------
    law : WearLaw
        Law of the joint.
    wear_rate : float
        Specific wear rate of this machine [m^2/N], >= 0.
    as_new : iterable of float
        Severity of the first surface and of the following ones [m]; as many as needed.
    limit : float
        Condemning severity [m].
    end : float
        Severity at which the joint fails and is renewed [m], >= limit.
    until : float
        Operating time to cover [s], > 0.
    running_in : RunningIn, optional
        None: new surfaces wear like old ones.
    maintenance : sequence of Maintenance
        Maintenance rules; several due together are all applied in this order.

    Returns
    -------
    LifeHistory
        Simulated ten times as long, to find when the limit is next reached and the surface next
        renewed.

    Raises
    ------
    ValueError
        Bounds are in the wrong order, or there are more than 10,000 events; all faults together.

    Examples
    --------
    A bush under 1 kW that fails at 0.3 mm, each new one with 0.1 mm:

    >>> from itertools import repeat
    >>> law = WearLaw(
    ...     volume=np.array([0.0, 1e-6]),
    ...     power=np.array([1e3, 1e3]),
    ...     severity_of=lambda volume: 200 * volume,
    ...     volume_of=lambda severity: severity / 200,
    ... )
    >>> life = life_history(
    ...     law, 1e-15, as_new=repeat(1e-4), limit=2e-4, end=3e-4, until=2e6
    ... )
    >>> [round(life.severity(time) * 1e3, 3) for time in (0.0, 5e5, 9.9e5, 1.5e6)]
    [0.1, 0.2, 0.298, 0.2]
    >>> round(life.remaining(2.5e5)), life.remaining(7e5), life.events(1.5e6)
    (250000, 0.0, 1)
    """
    running_in = RunningIn() if running_in is None else running_in
    _refuse_life(wear_rate, limit, end, until, maintenance)
    plan = _Plan(law, wear_rate, running_in, tuple(maintenance), end, iter(as_new))
    horizon = _AHEAD * until
    pieces = tuple(_pieces(plan, limit, until, horizon))
    return LifeHistory(
        law=law,
        wear_rate=wear_rate,
        running_in=running_in,
        pieces=pieces,
        crossings=tuple(_crossings(plan, pieces, law.volume_of(limit), horizon)),
        limit=limit,
    )


class _Plan(NamedTuple):
    """Input of a history."""

    law: WearLaw
    wear_rate: float
    running_in: RunningIn
    maintenance: tuple[Maintenance, ...]
    end: float
    as_new: Iterator[float]


def _refuse_life(
    wear_rate: float,
    limit: float,
    end: float,
    until: float,
    maintenance: Sequence[Maintenance],
) -> None:
    faults = []
    if not 0 <= wear_rate < math.inf:
        faults.append(f"wear_rate = {wear_rate} m^2/N must be finite and >= 0")
    if not 0 < limit <= end:
        faults.append(f"limit = {limit} m must be > 0 and <= end = {end} m; lower it or raise end")
    if not 0 < until < math.inf:
        faults.append(f"until = {until} s must be > 0 and finite")
    faults += [
        f"maintenance.{i}.at = {rule.at} m must be < end = {end} m, where the joint fails; lower it"
        for i, rule in enumerate(maintenance)
        if rule.at is not None and not rule.at < end
    ]
    if faults:
        raise ValueError("; ".join(faults))


def _pieces(plan: _Plan, limit: float, until: float, horizon: float) -> Iterator[_Piece]:
    """Periods until everything in the requested time is known, or the horizon is reached."""
    new = plan.law.volume_of(next(plan.as_new))
    piece = _Piece(begin=0.0, volume=new, as_new=new, born=0.0, events=0)
    crossed = renewed = False
    while True:
        yield piece
        time, rules = _next_event(plan, piece)
        past = time > until
        crossed |= past and _reached(plan, piece, plan.law.volume_of(limit)) <= time
        renewed |= past and any(rule.restores == 1 for rule in rules)
        if time > horizon:
            return
        if piece.events + len(rules) > MOST_EVENTS:
            raise ValueError(
                f"maintenance = {MOST_EVENTS} events by {time:.3g} s, must be fewer; renew less "
                "often, or lower the wear rate"
            )
        piece = _after_event(plan, piece, time, rules)
        if crossed and renewed:
            yield piece
            return


_AHEAD = 10.0  # times the operating time to cover: how far maintenance is simulated

_RENEWAL = Maintenance(restores=1.0, every=math.inf)  # after a failure


def _next_event(plan: _Plan, piece: _Piece) -> tuple[float, list[Maintenance]]:
    """Time and actions of the next event; infinity for none."""
    due = [(_reached(plan, piece, plan.law.volume_of(plan.end)), _RENEWAL)]
    for rule in plan.maintenance:
        if rule.at is not None:
            due.append((_reached(plan, piece, plan.law.volume_of(rule.at)), rule))
        elif rule.every is not None:
            number = math.floor(piece.begin / rule.every * (1 + _ROUNDING)) + 1
            due.append((number * rule.every, rule))
    time = min(when for when, _ in due)
    return time, [rule for when, rule in due if when <= time * (1 + _ROUNDING)]


_ROUNDING = 1e-12  # of a time: actions due within it are done together


def _after_event(plan: _Plan, piece: _Piece, time: float, rules: Sequence[Maintenance]) -> _Piece:
    """Period after an event."""
    volume = _volume_at(plan.law, plan.wear_rate, plan.running_in, piece, time)
    new, born = piece.as_new, piece.born
    for rule in rules:
        if rule.restores == 1:
            new, born = plan.law.volume_of(next(plan.as_new)), time
            volume = new
        else:
            volume = new + (1 - rule.restores) * (volume - new)
    return _Piece(time, volume, new, born, piece.events + len(rules))


def _volume_at(
    law: WearLaw, wear_rate: float, running_in: RunningIn, piece: _Piece, time: float
) -> float:
    steady = running_in.equivalent(time - piece.born)
    steady -= running_in.equivalent(piece.begin - piece.born)
    return law.grown(piece.volume, wear_rate * steady)


def _reached(plan: _Plan, piece: _Piece, volume: float) -> float:
    """Time at which a volume is reached without maintenance [s]; infinity if never."""
    work = plan.law.work(volume) - plan.law.work(piece.volume)
    if work <= 0:
        return piece.begin
    if plan.wear_rate == 0:
        return math.inf
    before = plan.running_in.equivalent(piece.begin - piece.born)
    return piece.born + plan.running_in.age(before + work / plan.wear_rate)


def _crossings(
    plan: _Plan, pieces: Sequence[_Piece], volume: float, horizon: float
) -> Iterator[float]:
    """Times within the periods at which a volume is reached from below."""
    ends = [later.begin for _, later in pairwise(pieces)]
    for piece, end in zip(pieces, [*ends, horizon], strict=True):
        time = _reached(plan, piece, volume)
        if piece.volume < volume and time <= end:
            yield time
