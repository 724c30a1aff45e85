"""Alignment of a shaft line: what each bearing carries, and which bearing must move by how much.

The beam is held in its vertical plane at the support points of its seats. With all of them held,
the reactions are an affine function of the points' heights, and that one condensation of the beam
(one banded factorisation) serves everything else: elastic supports in series, points that lift,
other conditions, moves. Heights are positive upward, and a reaction is positive when it carries.

A point never pulls: reaction >= 0, gap >= 0, and one of the two is zero. The reactions minimise
the complementary energy among all that balance the loads; that energy is strictly convex in them,
so they are unique.

Reference: Vulic (2008), Shafting alignment: computational improvement; Murawski (2005), Shaft line
alignment analysis taking ship construction flexibility and deformations into consideration,
Marine Structures 18(1), 62-84, doi:10.1016/j.marstruc.2005.05.002.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

from ..beam.beam import Beam, PointLoad
from ..brief import brief

Vector = NDArray[np.float64]
Index = NDArray[np.int64]

_BAND = 3  # half bandwidth of one plane: two coordinates a node, neighbours only
NO_LOAD = 1e-9  # of the whole load: below this a reaction is rounding
_NO_GAP = 1e-12  # m
MET = 1e-6  # of a limit: no gauge sees it
_MOST_POINTS = 100  # of one seat
FEWEST_POINTS = 2  # points that a shaft can rest on


class AlignmentError(ValueError):
    """A line of bearings that cannot be, or a question that has no answer on it."""


@dataclass(frozen=True, kw_only=True)
class Seat:
    """A bearing as the alignment sees it.

    Attributes
    ----------
    name : str
    station : float
        Of the middle of the bearing [m].
    offset : float
        Height of the bottom of the bore there [m].
    slope : float
        Of the bore, against the line of reference [rad]: slope boring.
    stiffness : float
        Of the whole bearing with its foundation [N/m], > 0; infinite where it does not yield.
    length, diameter : float
        Of the bearing [m], both > 0 for a mean pressure; the length also for several points.
    points : int
        Support points, each in the middle of its share of the length, with its share of the
        stiffness.
    least_load, most_load : float
        Limits of the reaction [N].
    most_pressure : float
        Limit of the mean pressure on the projected area [Pa].
    most_slope : float
        Limit of the slope of the shaft against the bore, either way [rad].
    least_move, most_move : float
        How far the bearing may be lowered (<= 0) and raised (>= 0) [m].
    least_turn, most_turn : float
        How far the bore may be turned (<= 0, >= 0) [rad].
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
        """Projected [m^2]; zero where the bearing's size is not given."""
        return self.length * self.diameter

    @property
    def highest_load(self) -> float:
        """What the limits of load and of mean pressure leave [N]."""
        if not math.isfinite(self.most_pressure):
            return self.most_load
        return min(self.most_load, self.most_pressure * self.area)

    @property
    def point_stations(self) -> tuple[float, ...]:
        """Of the support points, from aft [m]."""
        share = self.length / self.points
        return tuple(self.station + (k - (self.points - 1) / 2) * share for k in range(self.points))


def seat_stations(seats: Iterable[Seat]) -> tuple[float, ...]:
    """Where the beam must have nodes: the middle and the support points of every seat.

    Examples
    --------
    >>> seat_stations([Seat(name="stern tube", station=2.0, length=1.0, points=2)])
    (2.0, 1.75, 2.25)
    """
    return tuple(dict.fromkeys(at for seat in seats for at in (seat.station, *seat.point_stations)))


@dataclass(frozen=True, kw_only=True)
class Condition:
    """A state of the ship in which the line must be within its limits.

    Attributes
    ----------
    name : str
        "cold", "hot", "running", ...
    rises : tuple of float
        How far each bearing stands above its offset [m]: thermal rise, hull deflection, lift of
        the journal on its film. Empty: none.
    slopes : tuple of float
        What the hull's deflection adds to the slope of each bore [rad]. Empty: nothing.
    loads : tuple of PointLoad
        Beyond those of the beam: the moment of the propeller's eccentric thrust, gear forces.
        Their stations must be nodes; the sideways parts have no part here.
    """

    name: str
    rises: tuple[float, ...] = ()
    slopes: tuple[float, ...] = ()
    loads: tuple[PointLoad, ...] = ()


AS_SET = Condition(name="as set")
"""Nothing but the offsets."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AlignmentLine:
    """A beam on its seats.

    Attributes
    ----------
    beam : Beam
        With nodes at all `seat_stations`.
    seats : tuple of Seat
        From aft forward, with two support points or more.

    Raises
    ------
    AlignmentError
        A seat is out of its range, out of order, or on no node; all faults at once.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0], theory="euler-bernoulli")
    >>> seats = tuple(Seat(name=f"{s}", station=s) for s in (0.0, 1.0, 2.0))
    >>> state = reactions(AlignmentLine(beam=beam, seats=seats))
    >>> (state.reactions / beam.weight).round(4).tolist()
    [0.1875, 0.625, 0.1875]
    """

    beam: Beam
    seats: tuple[Seat, ...]

    __repr__ = brief("names")

    def __post_init__(self) -> None:
        faults = list(_line_faults(self.beam, self.seats))
        if faults:
            raise AlignmentError("\n".join(faults))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the seats, from aft."""
        return tuple(seat.name for seat in self.seats)

    def seat(self, name: str) -> int:
        """Index of a seat.

        Raises
        ------
        AlignmentError
            There is no such seat.
        """
        if name not in self.names:
            raise AlignmentError(
                f"bearing = '{name}' must be one of {', '.join(self.names)}; choose one of them"
            )
        return self.names.index(name)

    @cached_property
    def held(self) -> "HeldLine":
        """The beam condensed to its support points."""
        return _condense(self.beam, self.seats)

    def moved(
        self, moves: Mapping[str, float] | ArrayLike = (), turns: ArrayLike = ()
    ) -> "AlignmentLine":
        """The line with its bearings moved.

        Parameters
        ----------
        moves : mapping of str to float, or array_like [shape=(n,)]
            Upward [m]; names that are left out stay.
        turns : array_like [shape=(n,)], optional
            Of the bores [rad].

        Returns
        -------
        AlignmentLine
        """
        up, turn = per_seat(self, moves, "moves"), per_seat(self, turns, "turns")
        seats = tuple(
            replace(seat, offset=seat.offset + float(m), slope=seat.slope + float(t))
            for seat, m, t in zip(self.seats, up, turn, strict=True)
        )
        line = AlignmentLine(beam=self.beam, seats=seats)
        line.__dict__["held"] = self.held  # heights have no part in it
        return line


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldLine:
    """The beam with all its support points held: reactions and deflection over their heights.

    Attributes
    ----------
    stations : numpy.ndarray [shape=(p,)]
        Of the support points [m].
    owner : numpy.ndarray [shape=(p,)]
        Seat of each point.
    stiffness : numpy.ndarray [shape=(p,)]
        Of each point's seat share [N/m], infinite where rigid.
    influence : numpy.ndarray [shape=(p, p)]
        Change of reaction by height, all others held [N/m].
    lines : numpy.ndarray [shape=(2 n, p)]
        Deflection and slope of every node by height.
    """

    stations: Vector
    owner: Index
    stiffness: Vector
    influence: Vector
    lines: Vector
    _factor: Vector
    _coupling: Vector  # free coordinates by held ones
    _held: Index
    _free: Index

    def carry(self, load: Vector) -> tuple[Vector, Vector]:
        """Reactions (p,) and deflection (2 n,) under a load (2 n,) with all heights zero."""
        line = np.zeros(load.size)
        line[self._free] = cho_solve_banded((self._factor, False), load[self._free])
        return self._coupling.T @ line[self._free] - load[self._held], line


@dataclass(frozen=True, kw_only=True, eq=False)
class LineState:
    """A line at rest.

    Attributes
    ----------
    line : AlignmentLine
    condition : Condition
    reactions : numpy.ndarray [shape=(n,)]
        Of the bearings, upward on the shaft [N].
    point_reactions : numpy.ndarray [shape=(p,)]
        Of the support points [N], in the order of ``line.held.stations``.
    gaps : numpy.ndarray [shape=(p,)]
        Between the shaft and the bottom of the bore [m].
    slopes : numpy.ndarray [shape=(n,)]
        Of the shaft at the stations of the bearings [rad].
    relative_slopes : numpy.ndarray [shape=(n,)]
        The same against the bores [rad].
    deflections, rotations : numpy.ndarray [shape=(n_nodes,)]
        Of the shaft [m], [rad].
    """

    line: AlignmentLine
    condition: Condition
    reactions: Vector
    point_reactions: Vector
    gaps: Vector
    slopes: Vector
    relative_slopes: Vector
    deflections: Vector
    rotations: Vector

    __repr__ = brief("condition", "reactions", "lifted")

    @property
    def lifted(self) -> tuple[str, ...]:
        """Bearings that carry nothing at any of their points."""
        held = self.line.held
        touching = set(held.owner[self.contact].tolist())
        return tuple(name for i, name in enumerate(self.line.names) if i not in touching)

    @property
    def contact(self) -> NDArray[np.bool_]:
        """Points that the shaft lies on [shape=(p,)]."""
        return self.gaps <= _NO_GAP

    @property
    def pressures(self) -> Vector:
        """Mean, on the projected area [shape=(n,)], [Pa]; NaN where the size is not given."""
        area = np.array([seat.area or math.nan for seat in self.line.seats])
        pressures: Vector = self.reactions / area
        return pressures

    @property
    def edge_pressures(self) -> Vector:
        """Mean over the most loaded point's share of each bearing [shape=(n,)], [Pa]."""
        worst = np.zeros(len(self.line.seats))
        np.maximum.at(worst, self.line.held.owner, self.point_reactions)
        share = [seat.area / seat.points or math.nan for seat in self.line.seats]
        pressures: Vector = worst / np.array(share)
        return pressures

    @cached_property
    def _forces(self) -> Any:
        q = np.zeros(self.line.beam.n_dof)
        q[0::4], q[1::4] = self.deflections, self.rotations
        return self.line.beam.moments_and_shear(q)

    @property
    def cut_stations(self) -> Vector:
        """Where `moments` and `shear` are, each inner node twice [m]."""
        stations: Vector = self._forces.stations
        return stations

    @property
    def moments(self) -> Vector:
        """Bending moment at `cut_stations`, positive where the shaft sags [N m]."""
        moments: Vector = self._forces.moment_up
        return moments

    @property
    def shear(self) -> Vector:
        """Upward forces aft of each of `cut_stations` [N]."""
        shear: Vector = self._forces.shear_up
        return shear


def reactions(
    line: AlignmentLine, condition: Condition = AS_SET, *, unilateral: bool = True
) -> LineState:
    """Reactions, deflection and slopes of a line at rest.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.
    condition : Condition
        State of the ship.
    unilateral : bool
        False lets the bearings pull, as most class calculations do; a negative reaction then
        says that the bearing lifts.

    Returns
    -------
    LineState
        Reactions, deflection and slopes.

    Raises
    ------
    AlignmentError
        The condition does not fit the line, or the loads tip the shaft off its supports.

    Examples
    --------
    The middle bearing of three stands too low to be reached:

    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0], theory="euler-bernoulli")
    >>> seats = [Seat(name=n, station=s, offset=h) for n, s, h in (
    ...     ("aft", 0.0, 0.0), ("middle", 1.0, -2e-3), ("forward", 2.0, 0.0))]
    >>> state = reactions(AlignmentLine(beam=beam, seats=tuple(seats)))
    >>> state.lifted, (state.reactions / beam.weight).round(4).tolist()
    (('middle',), [0.5, 0.0, 0.5])
    """
    held = line.held
    dead, sag = held.carry(vertical_load(line, condition))
    heights = point_heights(line, condition)
    if unilateral:
        rest = come_to_rest(held, dead, heights)
    else:
        rest = _on(held, dead, heights, np.ones(dead.size, dtype=bool))
    return _state(line, condition, heights, rest, sag)


def influence(line: AlignmentLine, state: LineState | None = None) -> Vector:
    """Change of each bearing's reaction when a bearing is raised.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.
    state : LineState, optional
        Points that it lifts stay away; by default all are in contact.

    Returns
    -------
    numpy.ndarray [shape=(n, n)]
        [N/m], symmetric; row i is the reaction of bearing i. Rows and their first moments add up
        to zero: raising and turning the whole line changes nothing.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0], theory="euler-bernoulli")
    >>> seats = tuple(Seat(name=f"{s}", station=s) for s in (0.0, 1.0, 2.0))
    >>> unit = bar.bending_stiffness  # over the cube of a span of 1 m
    >>> (influence(AlignmentLine(beam=beam, seats=seats)) / unit).round(6).tolist()
    [[1.5, -3.0, 1.5], [-3.0, 6.0, -3.0], [1.5, -3.0, 1.5]]
    """
    held = line.held
    contact = np.ones(held.stations.size, dtype=bool) if state is None else state.contact
    change = held.influence @ following(held, contact)[0]
    change[~contact] = 0.0
    gather = gather_points(line)
    return _symmetric(gather @ change @ gather.T)


# --- limits


@dataclass(frozen=True, kw_only=True)
class Check:
    """One quantity of one bearing in one condition, against its limits.

    Attributes
    ----------
    bearing, condition : str
    quantity : str
        "reaction" [N], "mean pressure" [Pa] or "slope" [rad].
    value, least, most : float
    """

    bearing: str
    condition: str
    quantity: str
    value: float
    least: float
    most: float

    @property
    def shortfall(self) -> float:
        """How far the value is out of its limits, zero within [unit of the quantity]."""
        return max(self.least - self.value, self.value - self.most, 0.0)

    @property
    def met(self) -> bool:
        """True where the value is within its limits, to rounding."""
        bound = self.least if self.value < self.least else self.most
        return self.shortfall <= MET * abs(bound)

    @property
    def text(self) -> str:
        """Quantity, value and bound."""
        unit, scale = LIMIT_UNITS[self.quantity]
        low = self.value < self.least
        sign, bound = (">=", self.least) if low else ("<=", self.most)
        value = 0.0 if abs(self.value) < MET * abs(bound) else self.value
        return (
            f"bearing '{self.bearing}', {self.condition}: {self.quantity} = "
            f"{value * scale:.4g} {unit} must be {sign} {bound * scale:.4g} {unit}"
        )


LIMIT_UNITS = {
    "reaction": ("kN", 1e-3),
    "mean pressure": ("MPa", 1e-6),
    "slope": ("mm/m", 1e3),
    "move": ("mm", 1e3),
}
"""Of a quantity, for people, and how many there are in one of SI."""


def check(state: LineState) -> tuple[Check, ...]:
    """Every limit of every bearing against a state; bearings without a limit give none.

    Parameters
    ----------
    state : LineState
        Of :func:`reactions`.

    Returns
    -------
    tuple of Check
        In the order of the bearings.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0], theory="euler-bernoulli")
    >>> seats = [Seat(name=n, station=s, least_load=300.0) for n, s in (("aft", 0), ("fore", 1))]
    >>> state = reactions(AlignmentLine(beam=beam, seats=tuple(seats)))
    >>> [limit.text for limit in check(state) if not limit.met]
    ["bearing 'aft', as set: reaction = 0 kN must be >= 0.3 kN"]
    """
    return tuple(
        Check(bearing=seat.name, condition=state.condition.name, **row)
        for i, seat in enumerate(state.line.seats)
        for row in _limit_rows(seat, state, i)
    )


def _limit_rows(seat: Seat, state: LineState, i: int) -> Iterator[dict[str, Any]]:
    load = float(state.reactions[i])
    if seat.least_load > 0 or math.isfinite(seat.most_load):
        low, high = seat.least_load or -math.inf, seat.most_load  # it cannot pull anyway
        yield {"quantity": "reaction", "value": load, "least": low, "most": high}
    if math.isfinite(seat.most_pressure):
        value, most = load / seat.area, seat.most_pressure
        yield {"quantity": "mean pressure", "value": value, "least": -math.inf, "most": most}
    if math.isfinite(seat.most_slope):
        value, most = float(state.relative_slopes[i]), seat.most_slope
        yield {"quantity": "slope", "value": value, "least": -most, "most": most}


def span_loads(line: AlignmentLine) -> Vector:
    """What each bearing would carry if the shaft were hinged at every bearing.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        [N]; they add up to the whole load. Half of each neighbouring span, and the overhangs
        with the lever of their span. A share of it is a usual least load of a bearing.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0], theory="euler-bernoulli")
    >>> seats = tuple(Seat(name=f"{s}", station=s) for s in (0.0, 1.0, 2.0))
    >>> (span_loads(AlignmentLine(beam=beam, seats=seats)) / beam.weight).round(6).tolist()
    [0.25, 0.5, 0.25]
    """
    e, at = line.beam.elements, line.beam.stations
    seats = np.array([seat.station for seat in line.seats])
    load = line.beam.load.reshape(-1, 4)[:, :2].copy()
    even = e.up * e.length**2 / 12  # an even load's end moments carry nothing between hinges
    load[:-1, 1] -= even
    load[1:, 1] += even
    span = np.clip(np.searchsorted(seats, at, side="right") - 1, 0, seats.size - 2)
    reach = np.diff(seats)[span]
    forward = (at - seats[span]) / reach
    carried = np.zeros(seats.size)
    np.add.at(carried, span, -load[:, 0] * (1 - forward) + load[:, 1] / reach)
    np.add.at(carried, span + 1, -load[:, 0] * forward - load[:, 1] / reach)
    return carried


# --- the beam, condensed


def _condense(beam: Beam, seats: Sequence[Seat]) -> HeldLine:
    points = [(at, number) for number, seat in enumerate(seats) for at in seat.point_stations]
    held = np.array([2 * beam.node(at) for at, _ in points])
    size = 2 * beam.stations.size
    free = np.setdiff1d(np.arange(size), held)
    row, column, value = _upright(beam)
    place = np.full(size, -1)
    place[free] = np.arange(free.size)
    inner = (place[row] >= 0) & (place[column] >= place[row])  # the upper triangle
    band = np.zeros((_BAND + 1, free.size))
    i, j = place[row[inner]], place[column[inner]]
    band[_BAND + i - j, j] = value[inner]
    factor = cholesky_banded(band)
    plane = np.zeros((size, held.size))
    order = np.full(size, -1)
    order[held] = np.arange(held.size)
    outer = order[column] >= 0
    plane[row[outer], order[column[outer]]] = value[outer]
    coupling = plane[free]
    lines = np.zeros((size, held.size))
    lines[held, np.arange(held.size)] = 1.0
    lines[free] = -cho_solve_banded((factor, False), coupling)
    return HeldLine(
        stations=np.array([at for at, _ in points]),
        owner=np.array([number for _, number in points]),
        stiffness=np.array([seats[k].stiffness / seats[k].points for _, k in points]),
        influence=_symmetric(plane[held] + coupling.T @ lines[free]),
        lines=lines,
        _factor=factor,
        _coupling=coupling,
        _held=held,
        _free=free,
    )


def _upright(beam: Beam) -> tuple[Index, Index, Vector]:
    """Stiffness of the vertical plane as triplets, coordinates y and slope of each node."""
    k = beam.stiffness.tocoo()
    row, column = k.coords
    plane = (row % 4 < 2) & (column % 4 < 2)
    row, column = row[plane].astype(np.int64), column[plane].astype(np.int64)
    return row // 4 * 2 + row % 4, column // 4 * 2 + column % 4, k.data[plane]


def _symmetric(matrix: Vector) -> Vector:
    symmetric: Vector = (matrix + matrix.T) / 2
    return symmetric


def vertical_load(line: AlignmentLine, condition: Condition) -> Vector:
    """Forces and moments of the beam and the condition in the vertical plane [shape=(2 n,)]."""
    beam = line.beam
    load = beam.load.reshape(-1, 4)[:, :2].copy()
    for point in condition.loads:
        try:
            node = beam.node(point.station)
        except ValueError as error:
            raise AlignmentError(f"load of condition '{condition.name}': {error}") from None
        load[node] += point.up, point.moment_up
    flat: Vector = load.ravel()
    return flat


def gather_points(line: AlignmentLine) -> Vector:
    """(n, p): sums the points of each seat."""
    owner = line.held.owner
    gather: Vector = (owner == np.arange(len(line.seats))[:, None]).astype(float)
    return gather


def lever_arms(line: AlignmentLine) -> Vector:
    """(p,): forward of the middle of the seat [m]."""
    middle = np.array([seat.station for seat in line.seats])
    arms: Vector = line.held.stations - middle[line.held.owner]
    return arms


def point_heights(line: AlignmentLine, condition: Condition) -> Vector:
    """Of the bottoms of the bores at the support points, (p,) [m]."""
    rise = per_seat(line, condition.rises, f"rises of condition '{condition.name}'")
    turn = per_seat(line, condition.slopes, f"slopes of condition '{condition.name}'")
    middle = rise + [seat.offset for seat in line.seats]
    slope = turn + [seat.slope for seat in line.seats]
    owner = line.held.owner
    heights: Vector = middle[owner] + slope[owner] * lever_arms(line)
    return heights


# --- contact


def following(held: HeldLine, contact: NDArray[np.bool_]) -> tuple[Vector, Vector]:
    """T and G of the shaft's heights at the points, ``y = T h - G dead``.

    A rigid point in contact stands at its height; the others balance their springs, those off
    contact nothing: ``(A + k) y = k h - dead``.
    """
    spring = np.where(contact, held.stiffness, 0.0)
    rigid = np.isinf(spring)
    loose = ~rigid
    follow = np.diag(rigid.astype(float))
    give = np.zeros_like(follow)
    if loose.any():
        k = np.diag(spring[loose])
        inner = held.influence[np.ix_(loose, loose)] + k
        known = np.hstack([k, -held.influence[np.ix_(loose, rigid)], np.eye(k.shape[0])])
        solved = np.linalg.solve(inner, known)
        n, m = int(loose.sum()), int(rigid.sum())
        follow[np.ix_(loose, loose)] = solved[:, :n]
        follow[np.ix_(loose, rigid)] = solved[:, n : n + m]
        give[np.ix_(loose, loose)] = solved[:, n + m :]
    return follow, give


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """Reactions and the shaft's height at the points, and which of them are in contact."""

    force: Vector
    height: Vector
    contact: NDArray[np.bool_]


def _on(held: HeldLine, dead: Vector, heights: Vector, contact: NDArray[np.bool_]) -> Rest:
    follow, give = following(held, contact)
    y = follow @ heights - give @ dead
    force = dead + held.influence @ y
    force[~contact] = 0.0
    return Rest(force=force, height=y, contact=contact)


def come_to_rest(held: HeldLine, dead: Vector, heights: Vector) -> Rest:
    """Rest on points that only push: a primal active set on the reactions.

    It starts from the two outermost points, which carry every load they can carry, and then takes
    in the point that the shaft sinks into most, letting go those that would pull on the way. The
    complementary energy falls in each round, so that no set of points comes twice.
    """
    least = -NO_LOAD * float(np.abs(dead).sum())
    rest = _on(held, dead, heights, np.ones(dead.size, dtype=bool))
    if rest.force.min() >= least:
        return rest
    force = _two_point_start(held, dead)
    contact = force > 0
    contact[[0, -1]] = True
    for _ in range(10 * dead.size):
        rest, contact, force = _let_go(held, dead, heights, contact, force, least)
        gap = np.where(contact, 0.0, rest.height - heights)
        if gap.min() >= -_NO_GAP:
            return rest
        contact = contact.copy()
        contact[int(np.argmin(gap))] = True
    raise AlignmentError(
        "which bearings lift could not be settled; two support points may stand too close: give "
        "them a finite stiffness, or fewer points"
    )


def _two_point_start(held: HeldLine, dead: Vector) -> Vector:
    """Reactions of the first and the last point alone."""
    s = held.stations
    load, moment = float(dead.sum()), float(dead @ s)
    if not load > 0 or not s[0] * load <= moment <= s[-1] * load:
        where = f"at {moment / load:.4g} m" if load > 0 else "upward"
        raise AlignmentError(
            f"resultant of the loads = {load / 1e3:.4g} kN {where} must act downward between the "
            f"first support at {s[0]:.4g} m and the last at {s[-1]:.4g} m, or the shaft tips; add "
            "a support or mend the loads"
        )
    force = np.zeros(s.size)
    force[-1] = (moment - load * s[0]) / (s[-1] - s[0])
    force[0] = load - force[-1]
    return force


def _let_go(
    held: HeldLine,
    dead: Vector,
    heights: Vector,
    contact: NDArray[np.bool_],
    force: Vector,
    least: float,
) -> tuple[Rest, NDArray[np.bool_], Vector]:
    """Rest on the points in contact less those that come to pull on the way from `force`."""
    while True:
        rest = _on(held, dead, heights, contact)
        pulls = contact & (rest.force < least)
        if not pulls.any() or contact.sum() == FEWEST_POINTS:
            return rest, contact, np.maximum(rest.force, 0.0)
        way = force[pulls] / (force[pulls] - rest.force[pulls])
        force = force + way.min() * (rest.force - force)
        first = np.flatnonzero(pulls)[int(np.argmin(way))]
        contact = contact.copy()
        contact[first] = False
        force[~contact] = 0.0


def _state(
    line: AlignmentLine, condition: Condition, heights: Vector, rest: Rest, sag: Vector
) -> LineState:
    held = line.held
    q = sag + held.lines @ rest.height
    slopes = q[[2 * line.beam.node(seat.station) + 1 for seat in line.seats]]
    bores = per_seat(line, condition.slopes, "slopes") + [seat.slope for seat in line.seats]
    return LineState(
        line=line,
        condition=condition,
        reactions=gather_points(line) @ rest.force,
        point_reactions=rest.force,
        gaps=np.where(rest.contact, 0.0, rest.height - heights),
        slopes=slopes,
        relative_slopes=slopes - bores,
        deflections=q[0::2],
        rotations=q[1::2],
    )


# --- checks


def per_seat(line: AlignmentLine, values: Any, name: str) -> Vector:
    """One number for each seat, from a mapping, a sequence, or nothing."""
    n = len(line.seats)
    if isinstance(values, Mapping):
        array = np.zeros(n)
        for key, value in values.items():
            array[line.seat(key)] = value
    else:
        array = np.asarray(values, dtype=float)
        array = np.zeros(n) if array.size == 0 else array
    if array.shape != (n,) or not np.isfinite(array).all():
        raise AlignmentError(
            f"{name} = {array.tolist()} must be {n} finite numbers, one for each bearing; give "
            f"them for {', '.join(line.names)}"
        )
    return array


def _line_faults(beam: Beam, seats: Sequence[Seat]) -> Iterator[str]:
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
        yield f"{place}: points = {seat.points} must be from 1 to {_MOST_POINTS}; about 10 will do"
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
            f"{seat.least_load:g} N; mend one of the limits"
        )
    if not seat.most_slope > 0:
        yield f"most_slope = {seat.most_slope:g} rad must be > 0; leave it out for none"
    for low, high in (("least_move", "most_move"), ("least_turn", "most_turn")):
        if not getattr(seat, low) <= 0 <= getattr(seat, high) or not math.isfinite(
            getattr(seat, high) - getattr(seat, low)
        ):
            yield (
                f"{low} = {getattr(seat, low):g} and {high} = {getattr(seat, high):g} must be "
                "<= 0 and >= 0 and finite; zero where the bearing stays"
            )


def _node_faults(beam: Beam, seat: Seat) -> Iterator[str]:
    for station in seat_stations([seat]):
        try:
            beam.node(station)
        except ValueError as error:
            yield str(error)
