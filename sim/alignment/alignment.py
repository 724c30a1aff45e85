"""Alignment of a shaft line: bearing loads, and their dependence on bearing heights.

The beam is held in its vertical plane at the support points of its seats. With all of them held,
the reactions are an affine function of the points' heights. That one condensation of the beam
(one banded factorisation) serves all other cases: elastic supports in series, points that lift,
other conditions, moves. Heights and supporting reactions are positive upward.

A point never pulls: reaction >= 0, gap >= 0, and one of the two is zero. The reactions minimise
the complementary energy among all that balance the loads; that energy is strictly convex in them,
so they are unique.

Reference: Vulic (2008), Shafting alignment: computational improvement; Murawski (2005), Shaft line
alignment analysis taking ship construction flexibility and deformations into consideration,
Marine Structures 18(1), 62-84, doi:10.1016/j.marstruc.2005.05.002.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

from ..beam.beam import Beam
from ..beam.beam_parts import PointLoad
from ..brief import brief
from .contact import NO_GAP, HeldLine, Rest, come_to_rest, following, rest_on
from .seats import AlignmentError, Seat, line_faults

Vector = NDArray[np.float64]
Index = NDArray[np.int64]

_BAND = 3  # half bandwidth of one plane: two coordinates per node, coupled to neighbours only
MET = 1e-6  # of a limit: below any gauge's resolution


@dataclass(frozen=True, kw_only=True)
class Condition:
    """State of the ship in which the line must be within its limits.

    Attributes
    ----------
    name : str
        "cold", "hot", "running", ...
    rises : tuple of float
        Height of each bearing above its offset [m]: thermal rise, hull deflection, lift of
        the journal on its film. Empty: none.
    slopes : tuple of float
        Additional slope of each bore from the hull's deflection [rad]. Empty: none.
    loads : tuple of PointLoad
        In addition to those of the beam: the moment of the propeller's eccentric thrust, gear
        forces. Their stations must be nodes; sideways components are ignored.
    """

    name: str
    rises: tuple[float, ...] = ()
    slopes: tuple[float, ...] = ()
    loads: tuple[PointLoad, ...] = ()


AS_SET = Condition(name="as set")
"""The offsets alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AlignmentLine:
    """A beam on its seats.

    Attributes
    ----------
    beam : Beam
        With nodes at all `seat_stations`.
    seats : tuple of Seat
        From aft forward, with at least two support points.

    Raises
    ------
    AlignmentError
        A seat is out of range, out of order, or not at a node; all faults together.

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
        faults = list(line_faults(self.beam, self.seats))
        if faults:
            raise AlignmentError("\n".join(faults))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the seats, from aft."""
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
                f"bearing = '{name}' must be one of {', '.join(self.names)}; choose one"
            )
        return self.names.index(name)

    @cached_property
    def held(self) -> "HeldLine":
        """Beam condensed to its support points."""
        return _condense(self.beam, self.seats)

    def moved(
        self, moves: Mapping[str, float] | ArrayLike = (), turns: ArrayLike = ()
    ) -> "AlignmentLine":
        """Line with its bearings moved.

        Parameters
        ----------
        moves : mapping of str to float, or array_like [shape=(n,)]
            Upward [m]; bearings not named stay.
        turns : array_like [shape=(n,)], optional
            Turns of the bores [rad].

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
        line.__dict__["held"] = self.held  # independent of the heights
        return line


@dataclass(frozen=True, kw_only=True, eq=False)
class LineState:
    """Equilibrium of a line.

    Attributes
    ----------
    line : AlignmentLine
    condition : Condition
    reactions : numpy.ndarray [shape=(n,)]
        Reactions of the bearings, upward on the shaft [N].
    point_reactions : numpy.ndarray [shape=(p,)]
        Reactions of the support points [N], in the order of ``line.held.stations``.
    gaps : numpy.ndarray [shape=(p,)]
        Gaps between the shaft and the bottom of the bore [m].
    slopes : numpy.ndarray [shape=(n,)]
        Slopes of the shaft at the stations of the bearings [rad].
    relative_slopes : numpy.ndarray [shape=(n,)]
        Slopes of the shaft relative to the bores [rad].
    deflections, rotations : numpy.ndarray [shape=(n_nodes,)]
        Deflection of the shaft [m], [rad].
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
        """Bearings without load at all of their points."""
        held = self.line.held
        touching = set(held.owner[self.contact].tolist())
        return tuple(name for i, name in enumerate(self.line.names) if i not in touching)

    @property
    def contact(self) -> NDArray[np.bool_]:
        """Points in contact with the shaft [shape=(p,)]."""
        return self.gaps <= NO_GAP

    @property
    def pressures(self) -> Vector:
        """Mean pressures on the projected area [shape=(n,)], [Pa]; NaN if the size is not given."""
        area = np.array([seat.area or math.nan for seat in self.line.seats])
        pressures: Vector = self.reactions / area
        return pressures

    @property
    def edge_pressures(self) -> Vector:
        """Mean pressures on the share of each bearing's most loaded point [shape=(n,)], [Pa]."""
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
        """Stations of `moments` and `shear`, each inner node twice [m]."""
        stations: Vector = self._forces.stations
        return stations

    @property
    def moments(self) -> Vector:
        """Bending moments at `cut_stations`, positive where the shaft sags [N m]."""
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
    """Reactions, deflection and slopes of a line in equilibrium.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.
    condition : Condition
        State of the ship.
    unilateral : bool
        False: allow tension, like most class calculations; a negative reaction then indicates
        that the bearing lifts.

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
        rest = rest_on(held, dead, heights, np.ones(dead.size, dtype=bool))
    return _state(line, condition, heights, rest, sag)


def influence(line: AlignmentLine, state: LineState | None = None) -> Vector:
    """Change of each bearing's reaction per rise of a bearing.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.
    state : LineState, optional
        Points that are lifted in this state stay free; by default all are in contact.

    Returns
    -------
    numpy.ndarray [shape=(n, n)]
        Influence numbers [N/m], symmetric; row i is the reaction of bearing i. Rows and their first
        moments sum to zero: raising and turning the whole line changes nothing.

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
    """One quantity of one bearing in one condition, with its limits.

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
        """Violation of the limits, zero within them [unit of the quantity]."""
        return max(self.least - self.value, self.value - self.most, 0.0)

    @property
    def met(self) -> bool:
        """Whether the value is within its limits, to rounding."""
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
"""Display unit of a quantity, and its factor from SI."""


def check(state: LineState) -> tuple[Check, ...]:
    """Check a state against every limit of every bearing; bearings without limits have no checks.

    Parameters
    ----------
    state : LineState
        Result of :func:`reactions`.

    Returns
    -------
    tuple of Check
        Checks in the order of the bearings.

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
        low, high = seat.least_load or -math.inf, seat.most_load  # no tension anyway
        yield {"quantity": "reaction", "value": load, "least": low, "most": high}
    if math.isfinite(seat.most_pressure):
        value, most = load / seat.area, seat.most_pressure
        yield {"quantity": "mean pressure", "value": value, "least": -math.inf, "most": most}
    if math.isfinite(seat.most_slope):
        value, most = float(state.relative_slopes[i]), seat.most_slope
        yield {"quantity": "slope", "value": value, "least": -most, "most": most}


def span_loads(line: AlignmentLine) -> Vector:
    """Load of each bearing for a shaft hinged at every bearing.

    Parameters
    ----------
    line : AlignmentLine
        Beam and seats.

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Loads [N]; they sum to the total load. Half of each neighbouring span, and the overhangs
        by the lever of their span. A share of this is a usual least load of a bearing.

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
    even = e.up * e.length**2 / 12  # a uniform load's end moments have no effect between hinges
    load[:-1, 1] -= even
    load[1:, 1] += even
    span = np.clip(np.searchsorted(seats, at, side="right") - 1, 0, seats.size - 2)
    reach = np.diff(seats)[span]
    forward = (at - seats[span]) / reach
    carried = np.zeros(seats.size)
    np.add.at(carried, span, -load[:, 0] * (1 - forward) + load[:, 1] / reach)
    np.add.at(carried, span + 1, -load[:, 0] * forward - load[:, 1] / reach)
    return carried


# --- condensation of the beam


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
    """Matrix (n, p) that sums the points of each seat."""
    owner = line.held.owner
    gather: Vector = (owner == np.arange(len(line.seats))[:, None]).astype(float)
    return gather


def lever_arms(line: AlignmentLine) -> Vector:
    """Lever arms (p,) of the points, forward of the middle of the seat [m]."""
    middle = np.array([seat.station for seat in line.seats])
    arms: Vector = line.held.stations - middle[line.held.owner]
    return arms


def point_heights(line: AlignmentLine, condition: Condition) -> Vector:
    """Heights of the bottoms of the bores at the support points, (p,) [m]."""
    rise = per_seat(line, condition.rises, f"rises of condition '{condition.name}'")
    turn = per_seat(line, condition.slopes, f"slopes of condition '{condition.name}'")
    middle = rise + [seat.offset for seat in line.seats]
    slope = turn + [seat.slope for seat in line.seats]
    owner = line.held.owner
    heights: Vector = middle[owner] + slope[owner] * lever_arms(line)
    return heights


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


def per_seat(line: AlignmentLine, values: Any, name: str) -> Vector:
    """One number for each seat, from a mapping, a sequence, or an empty value."""
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
