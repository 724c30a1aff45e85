"""Jacking test next to a bearing: load on the jack over lift, and the bearing's reaction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..beam.beam import Beam, assemble_beam
from ..beam.beam_parts import DistributedLoad, PointLoad
from ..brief import brief
from .alignment import (
    AS_SET,
    AlignmentLine,
    Condition,
    LineState,
    per_seat,
    point_heights,
    reactions,
    vertical_load,
)
from .contact import NO_LOAD, Rest, come_to_rest, following
from .seats import FEWEST_POINTS, AlignmentError, Seat

Vector = NDArray[np.float64]
_BESIDE = 1e-9  # m
_FIRST_LIFT = 1e-5  # m, start of a search by doubling
_LONGEST_LIFT = 1.0  # m
_LIFT_ERROR = 1e-10  # of the lift
_JACK = "jack"


@dataclass(frozen=True, kw_only=True, eq=False)
class Jacking:
    """Simulated jacking test next to a bearing.

    Attributes
    ----------
    bearing : str
    station : float
        Position of the jack [m].
    lifts, loads : numpy.ndarray [shape=(k,)]
        Lift of the shaft at the jack from its rest [m], and load on the jack [N].
    first_slope, second_slope : float
        Slope of the load over the lift, before the bearing unloads and after it has come
        free [N/m].
    free_lift, free_load : float
        Point where the bearing comes free [m], [N].
    zero_load : float
        Load of the second line, extrapolated to zero lift [N].
    correction_factor : float
        Reaction of the bearing over `zero_load`, from the flexibility of the line without the
        bearing: that of the shaft at the jack for a force at the jack, over that for a force at the
        bearing.
    reaction : float
        Reaction of the bearing in the line [N].
    others : tuple of str
        Other bearings that lift or touch before this one comes free, or at the same lift: then
        `estimate` is inaccurate.
    """

    bearing: str
    station: float
    lifts: Vector
    loads: Vector
    first_slope: float
    second_slope: float
    free_lift: float
    free_load: float
    zero_load: float
    correction_factor: float
    reaction: float
    others: tuple[str, ...]

    __repr__ = brief("bearing", "reaction", "correction_factor", "free_lift", "others")

    @property
    def estimate(self) -> float:
        """Reaction estimated by a jacking test: correction factor times `zero_load` [N]."""
        return self.correction_factor * self.zero_load


def jacking(
    line: AlignmentLine,
    bearing: str,
    condition: Condition = AS_SET,
    *,
    station: float | None = None,
    n_lifts: int = 41,
) -> Jacking:
    """Load over lift of a jack next to a bearing, and the reaction estimated from it.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.
    bearing : str
        Name of the seat.
    condition : Condition
        State of the ship.
    station : float, optional
        Position of the jack, a node outside all bearings [m]; by default the one nearest the
        bearing.
    n_lifts : int
        Points of the curve, >= 2, from rest to twice the lift at which the bearing comes free.

    Returns
    -------
    Jacking
        Load over lift, and the reaction.

    Raises
    ------
    AlignmentError
        There is no such bearing, it has no load, the station is no node or inside a bearing,
        or the bearing never comes free.

    Notes
    -----
    Friction is neglected: lifting and lowering give the same curve. On the second line the bearing
    has no load; extrapolated to zero lift, the jack would hold the shaft at the jack as high as the
    bearing's reaction R does now, so that ``R f_jb = F f_jj`` with f the flexibility without
    jack and bearing.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0, 1.1], theory="euler-bernoulli")
    >>> seats = tuple(Seat(name=f"{s}", station=s) for s in (0.0, 1.0, 2.0))
    >>> test = jacking(AlignmentLine(beam=beam, seats=seats), "1.0")
    >>> test.station, round(test.estimate / beam.weight, 6), round(test.correction_factor, 4)
    (1.1, 0.625, 0.9945)
    """
    if n_lifts < FEWEST_POINTS:
        raise AlignmentError(f"n_lifts = {n_lifts} must be >= {FEWEST_POINTS}; 41 is usual")
    number = line.seat(bearing)
    rest = reactions(line, condition)
    if not rest.reactions[number] > NO_LOAD * rest.reactions.sum():
        raise AlignmentError(
            f"reaction of bearing '{bearing}' = 0 kN must be > 0 to be jacked; raise the bearing"
        )
    at = _jack_station(line, number) if station is None else station
    test = _with_jack(line, rest, number, at)
    free = _free_lift(test, bearing)
    lifts = np.linspace(0.0, 2 * free, n_lifts)
    after = _jacked(test, free)
    second = _stiffness_at(test, after.contact)
    load = float(after.force[test.jack])
    return Jacking(
        bearing=bearing,
        station=at,
        lifts=lifts,
        loads=np.array([_jacked(test, lift).force[test.jack] for lift in lifts]),
        first_slope=_stiffness_at(test, test.contact),
        second_slope=second,
        free_lift=free,
        free_load=load,
        zero_load=load - second * free,
        correction_factor=_correction(test, after.contact),
        reaction=float(rest.reactions[number]),
        others=_changed(test, after.contact),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Test:
    """A line with a jack; arrays are over its points, one more than the line's."""

    line: AlignmentLine  # with the jack among its seats
    dead: Vector
    heights: Vector  # that of the jack: where it touches the shaft at rest
    share: Vector  # of the bearing's reaction on its points
    contact: NDArray[np.bool_]  # at rest, with the jack
    jack: int

    @property
    def own(self) -> NDArray[np.bool_]:
        """Points of the bearing in contact at rest."""
        return self.share > 0


def _with_jack(line: AlignmentLine, rest: LineState, number: int, station: float) -> _Test:
    jack = Seat(name=_JACK, station=station)
    seats = tuple(sorted([*line.seats, jack], key=lambda seat: seat.station))
    jacked = AlignmentLine(beam=line.beam, seats=seats)
    at = int(np.flatnonzero(jacked.held.owner == jacked.seat(_JACK))[0])
    own = line.held.owner == number
    share = np.where(own, rest.point_reactions, 0.0) / rest.reactions[number]
    height = float(rest.deflections[line.beam.node(station)])
    return _Test(
        line=jacked,
        dead=jacked.held.carry(vertical_load(line, rest.condition))[0],
        heights=np.insert(point_heights(line, rest.condition), at, height),
        share=np.insert(np.where(share > NO_LOAD, share, 0.0), at, 0.0),
        contact=np.insert(rest.contact, at, True),
        jack=at,
    )


def _jack_station(line: AlignmentLine, number: int) -> float:
    """Nearest node outside every bearing."""
    at, middle = line.beam.stations, line.seats[number].station
    inside = np.zeros(at.size, dtype=bool)
    for seat in line.seats:
        inside |= np.abs(at - seat.station) <= seat.length / 2 + _BESIDE
    if inside.all():
        raise AlignmentError(
            f"bearing '{line.names[number]}' has no node next to it for a jack; add one in "
            "`stations` of assemble_beam"
        )
    outside = at[~inside]
    return float(outside[int(np.argmin(np.abs(outside - middle)))])


def _jacked(test: _Test, lift: float) -> Rest:
    heights = test.heights.copy()
    heights[test.jack] += lift
    return come_to_rest(test.line.held, test.dead, heights)


def _free_lift(test: _Test, bearing: str) -> float:
    """Least lift at which no point of the bearing is in contact [m]."""
    low, high = 0.0, _FIRST_LIFT
    while _jacked(test, high).contact[test.own].any():
        low, high = high, 2 * high
        if high > _LONGEST_LIFT:
            raise AlignmentError(
                f"bearing '{bearing}' does not come free within a lift of {_LONGEST_LIFT:g} m; "
                "place the jack nearer to it"
            )
    while high - low > _LIFT_ERROR * high:
        middle = (low + high) / 2
        if _jacked(test, middle).contact[test.own].any():
            low = middle
        else:
            high = middle
    return high


def _stiffness_at(test: _Test, contact: NDArray[np.bool_]) -> float:
    held = test.line.held
    return float((held.influence @ following(held, contact)[0])[test.jack, test.jack])


def _correction(test: _Test, contact: NDArray[np.bool_]) -> float:
    without = contact.copy()
    without[test.jack] = False
    give = following(test.line.held, without)[1][test.jack]
    return float(give[test.jack] / (give @ test.share))


def _changed(test: _Test, contact: NDArray[np.bool_]) -> tuple[str, ...]:
    """Other bearings with a point whose contact differs from that at rest."""
    owner = test.line.held.owner
    own = set(owner[test.own].tolist())
    changed = set(owner[contact != test.contact].tolist()) - own
    return tuple(test.line.names[i] for i in sorted(changed))


# --- gap and sag


@dataclass(frozen=True, kw_only=True)
class Flange:
    """Two open flanges facing each other.

    Attributes
    ----------
    station : float
        Position of the coupling [m].
    sag : float
        Height of the forward flange above the aft one [m].
    angle : float
        Opening angle of the faces at the top [rad].
    heights, slopes : tuple of float
        Height and slope of the aft and the forward flange [m], [rad].
    """

    station: float
    sag: float
    angle: float
    heights: tuple[float, float]
    slopes: tuple[float, float]

    def gap(self, diameter: float) -> float:
        """Opening at the top minus opening at the bottom, for a flange diameter [m]."""
        return self.angle * diameter


def gap_and_sag(
    line: AlignmentLine,
    cuts: Sequence[float],
    supports: Sequence[Seat] = (),
    condition: Condition = AS_SET,
) -> tuple[Flange, ...]:
    """Gap and sag of the flanges of an open line for which the coupled line has its offsets.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.
    cuts : sequence of float
        Positions of the open couplings [m], inside the shaft.
    supports : sequence of Seat
        Temporary supports while the line is open.
    condition : Condition
        Its rises and slopes apply to the bearings, its loads to the pieces.

    Returns
    -------
    tuple of Flange
        From aft.

    Raises
    ------
    AlignmentError
        A cut is off the shaft, or a piece does not rest on its supports; its stations are given.

    Notes
    -----
    Each piece rests on its own bearings and supports. A disc or a point load at a cut is shared
    equally by both pieces, like a pair of flanges.

    Examples
    --------
    Two equal halves on two bearings each droop towards each other and open at the bottom:

    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=4.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0, 2.0, 3.0], theory="euler-bernoulli")
    >>> seats = tuple(Seat(name=f"{s}", station=s) for s in (0.0, 1.0, 3.0, 4.0))
    >>> (flange,) = gap_and_sag(AlignmentLine(beam=beam, seats=seats), [2.0])
    >>> abs(round(1e3 * flange.sag, 9)), round(1e3 * flange.gap(0.2), 4)
    (0.0, -0.0714)
    """
    beam = line.beam
    ends = [0.0, *sorted(cuts), beam.length]
    if not all(low < high for low, high in pairwise(ends)):
        raise AlignmentError(
            f"cuts = {list(cuts)} m must lie inside the shaft of {beam.length:g} m, each once; "
            "choose stations of couplings"
        )
    seats = [*_in_condition(line, condition), *supports]
    loads = [*_nodal_loads(beam), *condition.loads]
    pieces = [_piece(beam, seats, loads, low, high) for low, high in pairwise(ends)]
    return tuple(
        _flange(cut, aft, forward)
        for cut, (aft, forward) in zip(ends[1:-1], pairwise(pieces), strict=True)
    )


def _in_condition(line: AlignmentLine, condition: Condition) -> list[Seat]:
    """Seats at the heights and slopes of the condition."""
    rises = per_seat(line, condition.rises, f"rises of condition '{condition.name}'")
    turns = per_seat(line, condition.slopes, f"slopes of condition '{condition.name}'")
    return list(line.moved(rises, turns).seats)


def _nodal_loads(beam: Beam) -> list[PointLoad]:
    """Loads on the nodes in addition to the uniform loads of the elements."""
    e, force = beam.elements, beam.load.reshape(-1, 4)[:, :2].copy()
    for nodes, turn in ((slice(None, -1), 1.0), (slice(1, None), -1.0)):
        force[nodes, 0] -= e.up * e.length / 2
        force[nodes, 1] -= turn * e.up * e.length**2 / 12
    return [
        PointLoad(station=float(at), up=float(up), moment_up=float(moment))
        for at, (up, moment) in zip(beam.stations, force, strict=True)
    ]


def _piece(
    beam: Beam, seats: Sequence[Seat], loads: Sequence[PointLoad], low: float, high: float
) -> LineState:
    """Equilibrium of the piece between two cuts; its stations count from `low`."""
    own = [
        replace(seat, station=seat.station - low)
        for seat in seats
        if low < seat.station < high or seat.station in {0.0, beam.length} & {low, high}
    ]
    try:
        part = _part(beam, loads, low, high)
        seats = tuple(sorted(own, key=lambda seat: seat.station))
        return reactions(AlignmentLine(beam=part, seats=seats), Condition(name="open"))
    except ValueError as error:
        raise AlignmentError(
            f"piece from {low:g} to {high:g} m, with stations from its aft end: {error}"
        ) from None


def _part(beam: Beam, loads: Sequence[PointLoad], low: float, high: float) -> Beam:
    """Beam between two nodes, under the uniform loads of its elements and the nodal ones."""
    e, at = beam.elements, beam.stations - low
    first, last = beam.node(low), beam.node(high)
    even = [
        DistributedLoad(start=float(at[k]), end=float(at[k + 1]), up=float(e.up[k]))
        for k in range(first, last)
    ]
    nodal = [
        replace(
            load, station=load.station - low, up=half * load.up, moment_up=half * load.moment_up
        )
        for load in loads
        if low <= load.station <= high
        for half in [0.5 if load.station in (low, high) and 0 < load.station < beam.length else 1.0]
    ]
    ends = np.cumsum([0.0, *(section.length for section in beam.sections)])
    lengths = np.minimum(ends[1:], high) - np.maximum(ends[:-1], low)
    return assemble_beam(
        [
            replace(section, length=float(length))
            for section, length in zip(beam.sections, lengths, strict=True)
            if length > _BESIDE
        ],
        loads=[*even, *nodal],
        stations=at[first : last + 1].tolist(),
        theory=beam.theory,
        shear_coefficient=beam.shear_coefficient,
        gravity=0.0,  # gravity is in the loads
    )


def _flange(cut: float, aft: LineState, forward: LineState) -> Flange:
    heights = float(aft.deflections[-1]), float(forward.deflections[0])
    slopes = float(aft.rotations[-1]), float(forward.rotations[0])
    return Flange(
        station=cut,
        sag=heights[1] - heights[0],
        angle=slopes[0] - slopes[1],
        heights=heights,
        slopes=slopes,
    )
