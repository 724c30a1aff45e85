"""Seats of a shaft line: its bearings, and checks of them."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..beam.beam import Beam

_MOST_POINTS = 100  # of one seat
FEWEST_POINTS = 2  # points that a shaft needs to rest on


class AlignmentError(ValueError):
    """An impossible line of bearings, or a problem without a solution on it."""


@dataclass(frozen=True, kw_only=True)
class Seat:
    """A bearing in the alignment model.

    Attributes
    ----------
    name : str
    station : float
        Position of the middle of the bearing [m].
    offset : float
        Height of the bottom of the bore there [m].
    slope : float
        Slope of the bore relative to the line of reference [rad]: slope boring.
    stiffness : float
        Stiffness of the whole bearing with its foundation [N/m], > 0; infinite if rigid.
    length, diameter : float
        Size of the bearing [m], both > 0 for a mean pressure; the length also for several points.
    points : int
        Number of support points, each in the middle of its share of the length, with its share of
        the stiffness.
    least_load, most_load : float
        Limits of the reaction [N].
    most_pressure : float
        Limit of the mean pressure on the projected area [Pa].
    most_slope : float
        Limit of the slope of the shaft relative to the bore, in both directions [rad].
    least_move, most_move : float
        Allowed lowering (<= 0) and raising (>= 0) of the bearing [m].
    least_turn, most_turn : float
        Allowed turn of the bore (<= 0, >= 0) [rad].
    """

    name: str
    station: float
    offset: float = 0.0
    slope: float = 0.0
    stiffness: float = math.inf
    length: float = 0.0
    diameter: float = 0.0
    points: int = 1
    least_load: float = 0.0
    most_load: float = math.inf
    most_pressure: float = math.inf
    most_slope: float = math.inf
    least_move: float = 0.0
    most_move: float = 0.0
    least_turn: float = 0.0
    most_turn: float = 0.0

    @property
    def area(self) -> float:
        """Projected area [m^2]; zero if the bearing's size is not given."""
        return self.length * self.diameter

    @property
    def highest_load(self) -> float:
        """Largest load by the limits of load and of mean pressure [N]."""
        if not math.isfinite(self.most_pressure):
            return self.most_load
        return min(self.most_load, self.most_pressure * self.area)

    @property
    def point_stations(self) -> tuple[float, ...]:
        """Stations of the support points, from aft [m]."""
        share = self.length / self.points
        return tuple(self.station + (k - (self.points - 1) / 2) * share for k in range(self.points))


def seat_stations(seats: Iterable[Seat]) -> tuple[float, ...]:
    """Stations where the beam needs nodes: the middle and the support points of every seat.

    Examples
    --------
    >>> seat_stations([Seat(name="stern tube", station=2.0, length=1.0, points=2)])
    (2.0, 1.75, 2.25)
    """
    return tuple(dict.fromkeys(at for seat in seats for at in (seat.station, *seat.point_stations)))


def line_faults(beam: Beam, seats: Sequence[Seat]) -> Iterator[str]:
    """All faults of the seats of a line, as sentences."""
    names = [seat.name for seat in seats]
    for name in dict.fromkeys(name for name in names if names.count(name) > 1):
        yield f"bearing '{name}' is given {names.count(name)} times, must be once; rename one"
    found = [fault for seat in seats for fault in _seat_faults(beam, seat)]
    yield from found
    if found:
        return
    at = [station for seat in seats for station in seat.point_stations]
    if len(at) < FEWEST_POINTS:
        least = FEWEST_POINTS
        yield f"support points = {len(at)} must be >= {least}, or the shaft tips; add a bearing"
    elif not np.all(np.diff(at) > 0):
        yield (
            f"support points at {', '.join(f'{s:.4g}' for s in at)} m must rise from aft forward "
            "without a tie; order the bearings, and let none reach into another"
        )


def _seat_faults(beam: Beam, seat: Seat) -> Iterator[str]:
    place = f"bearing '{seat.name}'"
    for key in ("station", "offset", "slope"):
        value = getattr(seat, key)
        if not math.isfinite(value):
            yield f"{place}: {key} = {value} must be finite; give a number"
    yield from (f"{place}: {fault}" for fault in _range_faults(seat))
    if not 1 <= seat.points <= _MOST_POINTS:
        yield f"{place}: points = {seat.points} must be from 1 to {_MOST_POINTS}; 10 are enough"
    elif seat.points > 1 and not seat.length > 0:
        yield f"{place}: length = {seat.length:g} m must be > 0 with several points; give it"
    else:
        yield from (f"{place}: {fault}" for fault in _node_faults(beam, seat))


def _range_faults(seat: Seat) -> Iterator[str]:
    if not seat.stiffness > 0:
        yield f"stiffness = {seat.stiffness:g} N/m must be > 0; leave it out for a rigid one"
    for key in ("length", "diameter"):
        value = getattr(seat, key)
        if not 0 <= value < math.inf:
            yield f"{key} = {value:g} m must be >= 0 and finite"
    if not 0 <= seat.least_load < math.inf:
        yield f"least_load = {seat.least_load:g} N must be >= 0; a bearing cannot pull"
    if not seat.most_pressure > 0:
        yield f"most_pressure = {seat.most_pressure:g} Pa must be > 0; leave it out for none"
    elif math.isfinite(seat.most_pressure) and not seat.area > 0:
        yield "most_pressure needs length and diameter; give both"
    elif not seat.highest_load >= seat.least_load:
        yield (
            f"most_load with most_pressure = {seat.highest_load:g} N must be >= least_load = "
            f"{seat.least_load:g} N; correct one of the limits"
        )
    if not seat.most_slope > 0:
        yield f"most_slope = {seat.most_slope:g} rad must be > 0; leave it out for none"
    for low, high in (("least_move", "most_move"), ("least_turn", "most_turn")):
        if not getattr(seat, low) <= 0 <= getattr(seat, high) or not math.isfinite(
            getattr(seat, high) - getattr(seat, low)
        ):
            yield (
                f"{low} = {getattr(seat, low):g} and {high} = {getattr(seat, high):g} must be "
                "<= 0 and >= 0 and finite; zero for a fixed bearing"
            )


def _node_faults(beam: Beam, seat: Seat) -> Iterator[str]:
    for station in seat_stations([seat]):
        try:
            beam.node(station)
        except ValueError as error:
            yield str(error)
