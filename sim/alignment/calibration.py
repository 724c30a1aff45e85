"""Load calibration: the least moves of the bearings that bring a shaft line within its limits.

A mixed-integer linear programme over the moves, with a switch for every support point that may
lift, in all conditions at once; the line is then solved anew with the moves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from ..brief import brief
from .alignment import (
    AS_SET,
    LIMIT_UNITS,
    MET,
    AlignmentError,
    AlignmentLine,
    Check,
    Condition,
    LineState,
    Seat,
    check,
    following,
    gather_points,
    lever_arms,
    point_heights,
    reactions,
    vertical_load,
)

Vector = NDArray[np.float64]
Index = NDArray[np.int64]
_Solution = tuple[Vector, Vector, Vector]
"""Moves [m], turns [rad], promised reactions [N]."""

_MM = 1e3  # mm in a metre: the programme's lengths are near one
_RESERVE = 1e-6  # of a mean load: a limit is met to rounding and more
_FEASIBLE = 1e-9  # of HiGHS for a linear programme, well inside the reserve
_LOOSE = 2e-7  # of HiGHS for a mixed one, which is 1e-7, and a little
_PROMISE = 1e-6  # of a mean load, between the programme and the line solved anew
_STILL = 1e-9  # m, of a move; nobody makes a smaller one
_PREFER = ("least", "fewest")
_TARGETS = ("limits", "even")
_EVEN = 1e-2  # of the least sum of squares, spent on smaller moves
_NEARLY = 0.999  # of a margin that would leave one load only
_JUST = 5e-3  # of a limit: nearer is on it
_HALVINGS = 6  # of a margin that cannot be kept: to 1/64 of it


class CalibrationStatus(IntEnum):
    """How a calibration ended. Everything but WITHIN and DONE carries a cure."""

    WITHIN = 0
    DONE = 1
    INFEASIBLE = 2
    UNRESOLVED = 3

    @property
    def ok(self) -> bool:
        """True where every limit is met after the moves."""
        return self in (CalibrationStatus.WITHIN, CalibrationStatus.DONE)

    @property
    def text(self) -> str:
        """One sentence with the cure."""
        return _CALIBRATION_TEXT[self]


_CALIBRATION_TEXT = {
    CalibrationStatus.WITHIN: "every limit is met; nothing moves",
    CalibrationStatus.DONE: "the moves bring every reaction, pressure and slope within its limits",
    CalibrationStatus.INFEASIBLE: (
        "no moves within their bounds bring every limit; widen one of what blocks"
    ),
    CalibrationStatus.UNRESOLVED: (
        "the search did not settle; give close support points a finite stiffness, fewer points, "
        "or more seconds"
    ),
}


@dataclass(frozen=True, kw_only=True)
class Block:
    """A bound that keeps a calibration from meeting every limit.

    Attributes
    ----------
    bearing : str
    condition : str
        Empty for the bound of a move, which holds in all.
    quantity : str
        "move" [m], "reaction" [N], "mean pressure" [Pa], "slope" [rad], or "contact".
    bound : float
    upper : bool
        True where the quantity must not be more, False where it must not be less.
    needed : float
        Where the bound would have to be; NaN where it stands against the others but need not
        give itself.
    """

    bearing: str
    condition: str
    quantity: str
    bound: float
    upper: bool
    needed: float = math.nan

    @property
    def text(self) -> str:
        """In words."""
        where = f"bearing '{self.bearing}'" + (f", {self.condition}" if self.condition else "")
        if self.quantity == "contact":
            return f"{where}: it cannot pull"
        unit, scale = LIMIT_UNITS[self.quantity]
        sign = "<=" if self.upper else ">="
        bound = f"{where}: {self.quantity} {sign} {scale * self.bound:.4g} {unit}"
        if math.isnan(self.needed):
            return bound
        return f"{bound} would have to be {scale * self.needed:.4g} {unit}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """Bearing moves that mend an alignment.

    Attributes
    ----------
    status : CalibrationStatus
    line : AlignmentLine
        Before the moves.
    moves, turns : numpy.ndarray [shape=(n,)]
        Upward [m], and of the bores [rad].
    before, after : tuple of LineState
        One for each condition. `after` is solved anew with the moves in the line.
    promised : numpy.ndarray [shape=(n_conditions, n)]
        Reactions that the programme counted on [N].
    unmet : tuple of Check
        Limits that the moves do not bring, as they stand after the moves.
    margin : float
        Of each limit, that the moves keep away from it.
    blocks : tuple of Block
        Where there is no way: the bounds of moves that would have to be wider, by the least sum;
        if that helps not, the limits that are at odds with each other whatever the moves.
    """

    status: CalibrationStatus
    line: AlignmentLine
    moves: Vector
    turns: Vector
    before: tuple[LineState, ...]
    after: tuple[LineState, ...]
    promised: Vector
    unmet: tuple[Check, ...]
    blocks: tuple[Block, ...]
    margin: float = 0.0

    __repr__ = brief("status", "moved", "total_move")

    @property
    def touched(self) -> tuple[Check, ...]:
        """Limits that the moves bring just within, so that little would break them again."""
        if not self.moved:
            return ()
        near = [_tightened(state.line, _JUST) for state in self.after]
        strict = [
            limit
            for line, state in zip(near, self.after, strict=True)
            for limit in check(replace(state, line=line))
            if not limit.met
        ]
        unmet = {(u.condition, u.bearing, u.quantity) for u in self.unmet}
        return tuple(c for c in strict if (c.condition, c.bearing, c.quantity) not in unmet)

    @property
    def total_move(self) -> float:
        """Sum of all moves without their signs [m]."""
        return float(np.abs(self.moves).sum())

    @property
    def moved(self) -> tuple[str, ...]:
        """Bearings that move or turn."""
        stir = (np.abs(self.moves) > _STILL) | (np.abs(self.turns) > _STILL)
        return tuple(name for name, far in zip(self.line.names, stir, strict=True) if far)

    @property
    def residual(self) -> float:
        """Largest difference of promised and obtained reactions, of a bearing's mean load."""
        return _difference(self.promised, self.after)


def calibrate(
    line: AlignmentLine,
    conditions: Sequence[Condition] = (AS_SET,),
    *,
    prefer: str = "least",
    target: str = "limits",
    margin: float = 0.0,
    seconds: float = 20.0,
) -> Calibration:
    """The moves of the bearings that bring every limit in every condition.

    Parameters
    ----------
    line : AlignmentLine
        With limits, and bounds of the moves, in its seats.
    conditions : sequence of Condition
        In which the limits must hold.
    prefer : str
        "least" has the least sum of moves, "fewest" the least number of bearings moved and then
        the least sum. Among equals the largest move is least.
    target : str
        "limits" moves as little as the limits ask; "even" moves, whether a limit is met or not,
        until the squares of the reactions' distances from their mean have the least sum over
        bearings and conditions, within a hundredth, by the least moves that do so.
    margin : float
        Distance that the line must keep from every limit, as a share of the limit, >= 0 and < 1.
        Where the moves cannot keep it, but can keep the limits, they keep as much of it as they
        can, to a sixty-fourth of it.
    seconds : float
        For each of the few programmes to solve.

    Returns
    -------
    Calibration
        Where no moves bring every limit: those that bring the unmet ones nearest, with what
        blocks. In any case nothing is unmet after the moves that was met before.

    Raises
    ------
    AlignmentError
        There is no condition, two have one name, `prefer` or `target` is unknown, `margin` is no
        share, "fewest" is asked for together with "even", or a condition does not fit the line.

    Notes
    -----
    A turn counts as the move of the bore's edge. With every point in contact, reactions and slopes
    are affine in the moves; a point that lifts by g is as if its seat stood higher by g and
    carried nothing. So for each point that may lift, ``r >= 0``, ``g >= 0`` and a switch that
    closes one of them: a mixed-integer linear programme, solved by HiGHS; without such points a
    linear one. Points may lift where their seat has several, or needs no least load. With the
    switches as found, the programme is solved once more as a linear one. If there is no solution,
    the unmet limits become elastic and their sum of violations, each over the mean load or the
    limit of the slope, is made least. What blocks is found by making the bounds of the moves
    elastic instead, of bearings that move at all before the others; if that helps not, by making
    the limits elastic without bounds of the moves, whose multipliers name what stands against.

    References
    ----------
    Huangfu and Hall (2018), Parallelizing the dual revised simplex method, Mathematical
    Programming Computation 10, 119-142, doi:10.1007/s12532-017-0130-5.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=7800)
    >>> beam = assemble_beam([bar], stations=[1.0], theory="euler-bernoulli")
    >>> seats = tuple(Seat(name=n, station=s, offset=h, least_load=200.0, most_move=2e-3)
    ...               for n, s, h in (("aft", 0, 0), ("middle", 1, -1e-3), ("forward", 2, 0)))
    >>> found = calibrate(AlignmentLine(beam=beam, seats=seats))
    >>> found.status.name, found.moved, (1e3 * found.moves).round(3).tolist()
    ('DONE', ('middle',), [0.0, 0.906, 0.0])
    """
    _check_question(conditions, prefer, target, margin)
    before = tuple(reactions(line, condition) for condition in conditions)
    ask = _Ask(prefer=prefer, target=target, seconds=seconds)
    possible = min(margin, _widest_margin(line))
    found = _calibrated(line, before, ask, possible)
    if margin == 0 or found.status.ok:
        return found
    plain = _calibrated(line, before, ask, 0.0)
    return _with_most_margin(plain, line, before, ask, possible) if plain.status.ok else plain


@dataclass(frozen=True, kw_only=True)
class _Ask:
    """What is asked of a calibration, but for its margin."""

    prefer: str
    target: str
    seconds: float


def _with_most_margin(
    plain: Calibration,
    line: AlignmentLine,
    before: tuple[LineState, ...],
    ask: _Ask,
    wanted: float,
) -> Calibration:
    """The calibration that keeps as much of a margin as can be, by halving."""
    best, least, most = plain, 0.0, wanted
    for _ in range(_HALVINGS):
        margin = (least + most) / 2
        found = _calibrated(line, before, ask, margin)
        if found.status.ok:
            best, least = found, margin
        else:
            most = margin
    return best


def _calibrated(
    line: AlignmentLine, before: tuple[LineState, ...], ask: _Ask, margin: float
) -> Calibration:
    still = np.zeros(len(line.seats))
    asked = _tightened(line, margin)
    before_asked = tuple(replace(state, line=asked) for state in before)
    kept = all(limit.met for state in before_asked for limit in check(state))
    if kept and ask.target == "limits":
        status = CalibrationStatus.WITHIN
        return _calibration(status, line, before, still, still, _loads_of(before), margin)
    solution = _wanted_moves(asked, before_asked, ask)
    status = CalibrationStatus.DONE
    if solution is None:
        solution = _nearest(asked, before_asked, ask.seconds)
        status = CalibrationStatus.INFEASIBLE
    if solution is None:
        return _unresolved(line, before)
    found = _calibration(status, asked, before_asked, *solution, margin)
    if not _confirmed(found):
        return _unresolved(line, before)
    if found.status is CalibrationStatus.INFEASIBLE:
        return replace(found, blocks=_blocks(asked, before_asked, ask.seconds))
    return _with_limits_of(found, line)


def _wanted_moves(line: AlignmentLine, before: Sequence[LineState], ask: _Ask) -> _Solution | None:
    if ask.target == "even":
        return _even_moves(line, before, ask.seconds)
    return _least_moves(line, before, ask.prefer, ask.seconds)


def _tightened(line: AlignmentLine, margin: float) -> AlignmentLine:
    """The line with every limit nearer by a share of itself."""
    if margin == 0:
        return line
    seats = tuple(
        replace(
            seat,
            least_load=seat.least_load * (1 + margin),
            most_load=seat.most_load * (1 - margin),
            most_pressure=seat.most_pressure * (1 - margin),
            most_slope=seat.most_slope * (1 - margin),
        )
        for seat in line.seats
    )
    return _with_seats(line, seats)


def _widest_margin(line: AlignmentLine) -> float:
    """The largest margin that leaves every bearing a load between its limits."""
    return _NEARLY * min(
        (seat.highest_load - seat.least_load) / (seat.highest_load + seat.least_load)
        if math.isfinite(seat.highest_load) and seat.highest_load > 0
        else 1.0
        for seat in line.seats
    )


def _with_seats(line: AlignmentLine, seats: tuple[Seat, ...]) -> AlignmentLine:
    """The line with other limits or bounds, which bend no shaft."""
    other = AlignmentLine(beam=line.beam, seats=seats)
    other.__dict__["held"] = line.held
    return other


def _with_limits_of(found: Calibration, line: AlignmentLine) -> Calibration:
    """A calibration found with nearer limits, its states judged by those of the line again."""

    def judged(state: LineState) -> LineState:
        seats = tuple(
            replace(plain, offset=seat.offset, slope=seat.slope)
            for plain, seat in zip(line.seats, state.line.seats, strict=True)
        )
        return replace(state, line=_with_seats(state.line, seats))

    return replace(
        found,
        line=line,
        before=tuple(map(judged, found.before)),
        after=tuple(map(judged, found.after)),
    )


def _check_question(
    conditions: Sequence[Condition], prefer: str, target: str, margin: float
) -> None:
    names = [condition.name for condition in conditions]
    faults = []
    if not names or len(set(names)) < len(names):
        faults.append(
            f"conditions = {', '.join(names) or 'none'} must be at least one, each named once; "
            "give them other names"
        )
    for name, value, known in (("prefer", prefer, _PREFER), ("target", target, _TARGETS)):
        if value not in known:
            faults.append(f"{name} = '{value}' must be one of {', '.join(known)}; choose one")
    if not 0 <= margin < 1:
        faults.append(f"margin = {margin:g} must be >= 0 and < 1; give it as a share of each limit")
    if prefer == "fewest" and target == "even":
        faults.append(
            "prefer = 'fewest' must be 'least' with target = 'even', which may move every bearing; "
            "choose one of the two"
        )
    if faults:
        raise AlignmentError("\n".join(faults))


def _loads_of(states: Sequence[LineState]) -> Vector:
    return np.array([state.reactions for state in states])


def _difference(promised: Vector, after: Sequence[LineState]) -> float:
    got = _loads_of(after)
    return float(np.abs(promised - got).max() / np.abs(got).mean())


def _calibration(
    status: CalibrationStatus,
    line: AlignmentLine,
    before: tuple[LineState, ...],
    moves: Vector,
    turns: Vector,
    promised: Vector,
    margin: float = 0.0,
) -> Calibration:
    moved = line.moved(moves, turns)
    after = tuple(reactions(moved, state.condition) for state in before)
    unmet = tuple(limit for state in after for limit in check(state) if not limit.met)
    if status is CalibrationStatus.INFEASIBLE and not unmet:
        status = CalibrationStatus.DONE
    return Calibration(
        status=status,
        line=line,
        moves=moves,
        turns=turns,
        before=before,
        after=after,
        promised=promised,
        unmet=unmet,
        blocks=(),
        margin=margin,
    )


def _unresolved(line: AlignmentLine, before: tuple[LineState, ...]) -> Calibration:
    still = np.zeros(len(line.seats))
    return _calibration(CalibrationStatus.UNRESOLVED, line, before, still, still, _loads_of(before))


def _confirmed(found: Calibration) -> bool:
    """The moves, put into the line, do as promised and spoil nothing."""
    if found.residual > _PROMISE or (found.status is CalibrationStatus.DONE and found.unmet):
        return False
    met = {
        (limit.condition, limit.bearing, limit.quantity)
        for state in found.before
        for limit in check(state)
        if limit.met
    }
    return not any((u.condition, u.bearing, u.quantity) in met for u in found.unmet)


# --- the programme of a calibration


@dataclass(frozen=True, kw_only=True, eq=False)
class _Response:
    """A condition with all points in contact, affine in x = (moves, turns, gaps).

    Moves and gaps count in mm, a turn as the move of the bore's edge in mm. A point that lifts is
    as if its seat stood higher by the gap.
    """

    state: LineState
    loads: Vector  # (p, 1 + 2 n + p), the constant first [N]
    slopes: Vector  # (n, 1 + 2 n + p), against the bores [rad]
    widest: float  # bound of a gap [mm]
    whole: float  # sum of all reactions [N]


def _response(state: LineState) -> _Response:
    line, held = state.line, state.line.held
    dead, sag = held.carry(vertical_load(line, state.condition))
    heights = point_heights(line, state.condition)
    follow, give = following(held, np.ones(dead.size, dtype=bool))
    gather = gather_points(line)
    edge = _edges(line)
    raised = (
        np.hstack([gather.T, gather.T * (lever_arms(line)[:, None] / edge), np.eye(dead.size)])
        / _MM
    )
    y = np.column_stack([follow @ heights - give @ dead, follow @ raised])
    loads = held.influence @ y
    loads[:, 0] += dead
    nodes = [2 * line.beam.node(seat.station) + 1 for seat in line.seats]
    slopes = held.lines[nodes] @ y
    slopes[:, 0] += sag[nodes] - (state.slopes - state.relative_slopes)
    n = len(line.seats)
    slopes[:, 1 + n : 1 + 2 * n] -= np.diag(1 / edge / _MM)
    return _Response(
        state=state,
        loads=loads,
        slopes=slopes,
        widest=_widest_gap(state, dead, heights),
        whole=float(dead.sum()),
    )


def _edges(line: AlignmentLine) -> Vector:
    """Lever of a turn: half the bore, or a metre where its length is not given [m]."""
    return np.array([seat.length / 2 or 1.0 for seat in line.seats])


def _widest_gap(state: LineState, dead: Vector, heights: Vector) -> float:
    """Bound of any gap that is looked for [mm].

    A generous multiple of what could open one: the spread of the heights, the moves, and the sag
    of the shaft where one point is taken away. A wider bound would let a switch that is 1e-6 off
    a whole number pass a gap that matters.
    """
    seats = state.line.seats
    sag = float((np.abs(dead) / np.diag(state.line.held.influence)).max())
    moves = max(seat.most_move - seat.least_move for seat in seats)
    turns = max((seat.most_turn - seat.least_turn) * seat.length for seat in seats)
    reach = float(np.ptp(heights)) + moves + turns + sag
    return _MM * (10 * reach + 4 * float(state.gaps.max()))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Row:
    """``row (1, x) <= bound``."""

    row: Vector  # (1 + 2 n + p,), the constant first
    bound: float
    meaning: Block
    elastic: bool


def _limit_row(row: Vector, now: float, unit: float, meaning: Block, elastic: bool) -> _Row:
    """A limit as a row that must not be above its bound, with a little reserve.

    What is met stays met: then the bound is no lower than where the row stands.
    """
    sign = 1.0 if meaning.upper else -1.0
    bound, now = sign * meaning.bound / unit, sign * now / unit
    met = now - bound <= MET * abs(bound)
    reserved = max(bound - _RESERVE, now) if met else bound - _RESERVE
    return _Row(row=sign * row / unit, bound=reserved, meaning=meaning, elastic=elastic and not met)


def _limits_of(response: _Response, unit: float, elastic: bool) -> list[_Row]:
    """Rows of the limits of one condition."""
    state, rows = response.state, []
    loads = gather_points(state.line) @ response.loads
    for i, seat in enumerate(state.line.seats):
        load, slope = float(state.reactions[i]), float(state.relative_slopes[i])
        area = seat.area or 1.0
        for quantity, bound, upper, row, now, scale in (
            ("reaction", seat.least_load or -math.inf, False, loads[i], load, unit),
            ("reaction", seat.most_load, True, loads[i], load, unit),
            ("mean pressure", seat.most_pressure, True, loads[i] / area, load / area, unit / area),
            ("slope", -seat.most_slope, False, response.slopes[i], slope, seat.most_slope),
            ("slope", seat.most_slope, True, response.slopes[i], slope, seat.most_slope),
        ):
            if math.isfinite(bound):
                meaning = Block(
                    bearing=seat.name,
                    condition=state.condition.name,
                    quantity=quantity,
                    bound=bound,
                    upper=upper,
                )
                rows.append(_limit_row(row, now, scale, meaning, elastic))
    return rows


@dataclass(frozen=True, kw_only=True, eq=False)
class _Programme:
    """``matrix x <= bound`` and ``least <= x <= most``.

    The columns are the moves up, the moves down, the turns up, the turns down, for each condition
    its gaps and then their switches (1: in contact), and a slack for each elastic row.
    """

    n: int
    matrix: Vector
    bound: Vector
    least: Vector
    most: Vector
    switch: NDArray[np.bool_]  # columns that must be whole
    slack: NDArray[np.bool_]  # columns
    meaning: tuple[Block | None, ...]  # of the rows; none for an elastic one
    responses: tuple[_Response, ...]

    @property
    def moving(self) -> Vector:
        """Cost of the moves."""
        cost = np.zeros(self.least.size)
        cost[: 4 * self.n] = 1.0
        return cost


def _programme(line: AlignmentLine, before: Sequence[LineState], *, elastic: bool) -> _Programme:
    n, p, m = len(line.seats), line.held.stations.size, len(before)
    responses = tuple(_response(state) for state in before)
    unit = float(np.mean([state.reactions for state in before]))
    limits = [(c, row) for c in range(m) for row in _limits_of(responses[c], unit, elastic)]
    n_slack = sum(row.elastic for _, row in limits)
    size = 4 * n + 2 * m * p + n_slack
    matrix, bound, meaning = [], [], []
    slack = 4 * n + 2 * m * p
    for c, limit in limits:
        full = _spread(limit.row[1:], n, p, c, size)
        if limit.elastic:
            full[slack] = -1.0
            slack += 1
        matrix.append(full)
        bound.append(limit.bound - limit.row[0])
        meaning.append(None if limit.elastic else limit.meaning)
    for c, response in enumerate(responses):
        rows, bounds = _contact_rows(response, unit, c, size)
        matrix += rows
        bound += bounds
        meaning += [block for block in _contact_blocks(line, response) for _ in range(3)]
    least, most, switch = _columns(line, responses, elastic, n_slack)
    return _Programme(
        n=n,
        matrix=np.array(matrix),
        bound=np.array(bound),
        least=least,
        most=most,
        switch=switch,
        slack=np.arange(size) >= size - n_slack,
        meaning=tuple(meaning),
        responses=responses,
    )


def _spread(row: Vector, n: int, p: int, c: int, size: int) -> Vector:
    """Row over moves, turns and gaps of condition c, over all columns."""
    full = np.zeros(size)
    full[:n], full[n : 2 * n] = row[:n], -row[:n]
    full[2 * n : 3 * n], full[3 * n : 4 * n] = row[n : 2 * n], -row[n : 2 * n]
    first = 4 * n + 2 * c * p
    full[first : first + p] = row[2 * n :]
    return full


def _contact_rows(
    response: _Response, unit: float, c: int, size: int
) -> tuple[list[Vector], list[float]]:
    """For each point: it does not pull, off contact it carries nothing, in contact no gap."""
    p = response.loads.shape[0]
    n = len(response.state.line.seats)
    rows, bounds = [], []
    for j in range(p):
        gap = 4 * n + 2 * c * p + j
        force = _spread(response.loads[j, 1:], n, p, c, size) / unit
        dead = response.loads[j, 0] / unit
        carries, apart = force * unit / response.whole, np.zeros(size)
        carries[gap + p] = -1.0
        apart[gap], apart[gap + p] = 1 / response.widest, 1.0
        rows += [-force, carries, apart]
        bounds += [dead, -dead * unit / response.whole, 1.0]
    return rows, bounds


def _contact_blocks(line: AlignmentLine, response: _Response) -> list[Block]:
    return [
        Block(
            bearing=line.names[owner],
            condition=response.state.condition.name,
            quantity="contact",
            bound=0.0,
            upper=False,
        )
        for owner in line.held.owner
    ]


def _columns(
    line: AlignmentLine, responses: Sequence[_Response], elastic: bool, n_slack: int
) -> tuple[Vector, Vector, NDArray[np.bool_]]:
    """Least and most of every column, and which are switches."""
    edge, seats = _edges(line), line.seats
    reach: Vector = _MM * np.array(
        [
            [seat.most_move for seat in seats],
            [-seat.least_move for seat in seats],
            [seat.most_turn * lever for seat, lever in zip(seats, edge, strict=True)],
            [-seat.least_turn * lever for seat, lever in zip(seats, edge, strict=True)],
        ]
    )
    least: list[Vector] = [np.zeros(4 * len(seats))]
    most: list[Vector] = list(reach)
    switch: list[NDArray[np.bool_]] = [np.zeros(4 * len(seats), dtype=bool)]
    for response in responses:
        free = _may_lift(response.state, elastic)[line.held.owner]
        least += [np.zeros(free.size), np.where(free, 0.0, 1.0)]
        most += [np.where(free, response.widest, 0.0), np.ones(free.size)]
        switch += [np.zeros(free.size, dtype=bool), free]
    least.append(np.zeros(n_slack))
    most.append(np.full(n_slack, np.inf))
    switch.append(np.zeros(n_slack, dtype=bool))
    return np.concatenate(least), np.concatenate(most), np.concatenate(switch)


def _may_lift(state: LineState, elastic: bool) -> NDArray[np.bool_]:
    """Seats any of whose points may lift: those that need no load, or have others to carry it."""
    return np.array(
        [
            seat.points > 1
            or seat.least_load <= 0
            or (elastic and float(load) < seat.least_load * (1 - MET))
            for seat, load in zip(state.line.seats, state.reactions, strict=True)
        ]
    )


def _least_moves(
    line: AlignmentLine, before: Sequence[LineState], prefer: str, seconds: float
) -> _Solution | None:
    """The moves that bring every limit, or None."""
    programme = _programme(line, before, elastic=False)
    if prefer == "fewest":
        programme, count = _counting(programme)
    else:
        count = programme.moving
    found = _solve(programme, count, seconds)
    if found is None:
        return None
    return _smallest(_settled(programme, count, found.x, seconds), seconds)


def _even_moves(
    line: AlignmentLine, before: Sequence[LineState], seconds: float
) -> _Solution | None:
    """The moves that keep every limit with reactions nearest to their mean, or None."""
    programme, apart = _evening(_programme(line, before, elastic=False))
    settled, best = _optimum(programme, apart, seconds)
    if best is None:
        return None
    return _smallest(_capped(settled, apart, best.fun * (1 + _EVEN) + _RESERVE), seconds)


def _evening(programme: _Programme) -> tuple[_Programme, Vector]:
    """With a column above the square of each reaction's distance from the mean, and their sum.

    A column lies above tangents of the parabola: a linear programme knows no squares.
    """
    n, p, size = programme.n, programme.responses[0].loads.shape[0], programme.least.size
    count = n * len(programme.responses)
    wide = _widened(programme, count, np.inf, whole=False)
    gather = gather_points(programme.responses[0].state.line)
    rows, bounds = [], []
    for c, response in enumerate(programme.responses):
        for i, load in enumerate(gather @ response.loads * n / response.whole):
            row = np.append(_spread(load[1:], n, p, c, size), np.zeros(count))
            for at in _TANGENTS:
                tangent = 2 * at * row
                tangent[size + c * n + i] = -1.0
                rows.append(tangent)
                bounds.append(at**2 - 2 * at * (load[0] - 1.0))
    evened = replace(
        wide,
        matrix=np.vstack([wide.matrix, rows]),
        bound=np.append(wide.bound, bounds),
        meaning=(*wide.meaning, *[None] * len(rows)),
    )
    return evened, (np.arange(size + count) >= size).astype(float)


_TANGENTS = np.concatenate([side * np.geomspace(0.02, 4.0, 16) for side in (-1, 1)])
"""Distances from the mean reaction, over it, where the tangents touch."""


def _nearest(line: AlignmentLine, before: Sequence[LineState], seconds: float) -> _Solution | None:
    """The moves that bring the unmet limits nearest; None without an answer."""
    programme = _programme(line, before, elastic=True)
    violation = programme.slack.astype(float)
    settled, best = _optimum(programme, violation, seconds)
    if best is None:
        return None
    return _smallest(_capped(settled, violation, best.fun + _RESERVE), seconds)


def _optimum(programme: _Programme, cost: Vector, seconds: float) -> tuple[_Programme, Any]:
    """The programme with its switches settled, and its solution or None."""
    found = _solve(programme, cost, seconds)
    if found is None:
        return programme, None
    settled = _settled(programme, cost, found.x, seconds)
    return settled, _solve(settled, cost, seconds)


def _solve(programme: _Programme, cost: Vector, seconds: float) -> Any:
    mixed = bool(programme.switch.any())
    options: dict[str, float] = {"time_limit": seconds}
    if not mixed:  # the mixed one only has to find the switches
        options["primal_feasibility_tolerance"] = _FEASIBLE
        options["dual_feasibility_tolerance"] = _FEASIBLE
    result = linprog(
        cost,
        A_ub=programme.matrix,
        b_ub=programme.bound,
        bounds=np.column_stack([programme.least, programme.most]),
        integrality=programme.switch.astype(int) if mixed else None,
        options=options,
    )
    return result if result.status == 0 else None


def _settled(programme: _Programme, cost: Vector, x: Vector, seconds: float) -> _Programme:
    """With the switches as found, no longer mixed; loose where they only fit to tolerance."""
    least, most = programme.least.copy(), programme.most.copy()
    least[programme.switch] = most[programme.switch] = np.round(x[programme.switch])
    switch = np.zeros_like(programme.switch)
    settled = replace(programme, least=least, most=most, switch=switch)
    if not programme.switch.any() or _solve(settled, cost, seconds) is not None:
        return settled
    return replace(settled, bound=settled.bound + _LOOSE)


def _capped(programme: _Programme, cost: Vector, most: float) -> _Programme:
    return replace(
        programme,
        matrix=np.vstack([programme.matrix, cost]),
        bound=np.append(programme.bound, most),
        meaning=(*programme.meaning, None),
    )


def _widened(programme: _Programme, n: int, most: float, whole: bool) -> _Programme:
    """With n columns more."""
    return replace(
        programme,
        matrix=np.hstack([programme.matrix, np.zeros((programme.bound.size, n))]),
        least=np.append(programme.least, np.zeros(n)),
        most=np.append(programme.most, np.full(n, most)),
        switch=np.append(programme.switch, np.full(n, whole)),
        slack=np.append(programme.slack, np.zeros(n, dtype=bool)),
    )


def _travel(programme: _Programme) -> Vector:
    """(n, columns): how far each bearing moves, with the turn of its edge."""
    eye = np.eye(programme.n)
    travel = np.zeros((programme.n, programme.least.size))
    travel[:, : 4 * programme.n] = np.hstack([eye, eye, eye, eye])
    return travel


def _counting(programme: _Programme) -> tuple[_Programme, Vector]:
    """With a switch for each bearing that moves, and the cost that counts them."""
    n, size = programme.n, programme.least.size
    wide = _widened(programme, n, 1.0, whole=True)
    rows = _travel(wide)
    rows[:, size:] = -np.diag(programme.most[: 4 * n].reshape(4, n).sum(axis=0) + _RESERVE)
    counted = replace(
        wide,
        matrix=np.vstack([wide.matrix, rows]),
        bound=np.append(wide.bound, np.zeros(n)),
        meaning=(*wide.meaning, *[None] * n),
    )
    return counted, (np.arange(size + n) >= size).astype(float)


def _smallest(settled: _Programme, seconds: float) -> _Solution | None:
    """Least sum of moves, and of those the least largest move."""
    found = _solve(settled, settled.moving, seconds)
    if found is None:
        return None
    capped = _capped(settled, settled.moving, found.fun * (1 + _RESERVE) + _RESERVE)
    size = capped.least.size
    wide = _widened(capped, 1, np.inf, whole=False)
    rows = _travel(wide)
    rows[:, -1] = -1.0
    even = replace(
        wide,
        matrix=np.vstack([wide.matrix, rows]),
        bound=np.append(wide.bound, np.zeros(settled.n)),
        meaning=(*wide.meaning, *[None] * settled.n),
    )
    last = _solve(even, (np.arange(size + 1) == size).astype(float), seconds)
    return _read(settled, found.x if last is None else last.x[:size])


def _read(programme: _Programme, x: Vector) -> _Solution:
    n, p = programme.n, programme.responses[0].loads.shape[0]
    line = programme.responses[0].state.line
    up, down, turn_up, turn_down = x[: 4 * n].reshape(4, n)
    gather = gather_points(line)
    promised = []
    for c, response in enumerate(programme.responses):
        first = 4 * n + 2 * c * p
        own = np.concatenate([[1.0], up - down, turn_up - turn_down, x[first : first + p]])
        promised.append(gather @ response.loads @ own)
    moves, turns = (up - down) / _MM, (turn_up - turn_down) / _MM / _edges(line)
    return moves, turns, np.array(promised)


def _blocks(line: AlignmentLine, before: Sequence[LineState], seconds: float) -> tuple[Block, ...]:
    """What would have to give: bounds of moves, of those that move at all first; else limits."""
    seats = line.seats
    reach = max(_response(state).widest for state in before) / (5 * _MM)
    moving = np.array([seat.least_move < seat.most_move for seat in seats])
    for may in (moving, np.ones_like(moving)):
        free = _with_wide_moves(line, may, reach)
        found = _widening(line, free, before, seconds) if may.any() else ()
        if found:
            return found
    return _conflict(free, before, seconds)


def _with_wide_moves(line: AlignmentLine, may: NDArray[np.bool_], reach: float) -> AlignmentLine:
    """The line with wide bounds of the moves where they may be wide."""
    seats = tuple(
        replace(seat, least_move=-reach + seat.least_move, most_move=reach + seat.most_move)
        if wide
        else seat
        for seat, wide in zip(line.seats, may, strict=True)
    )
    return _with_seats(line, seats)


def _widening(
    line: AlignmentLine, free: AlignmentLine, before: Sequence[LineState], seconds: float
) -> tuple[Block, ...]:
    """The least widening of the bounds of moves with which every limit can be met."""
    programme = _programme(free, before, elastic=False)
    n, size = programme.n, programme.least.size
    wide = _widened(programme, 2 * n, np.inf, whole=False)
    rows = np.zeros((2 * n, size + 2 * n))
    rows[:, : 2 * n] = np.eye(2 * n)
    rows[:, size:] = -np.eye(2 * n)
    bounds = [seat.most_move for seat in line.seats] + [-seat.least_move for seat in line.seats]
    wide = replace(
        wide,
        matrix=np.vstack([wide.matrix, rows]),
        bound=np.append(wide.bound, _MM * np.array(bounds)),
        meaning=(*wide.meaning, *[None] * (2 * n)),
    )
    _, best = _optimum(wide, (np.arange(size + 2 * n) >= size).astype(float), seconds)
    if best is None:
        return ()
    excess = best.x[size:] / _MM
    return tuple(
        _move_block(line.seats[k % n], excess[k], upper=bool(k < n))
        for k in np.flatnonzero(excess > _STILL)
    )


def _move_block(seat: Seat, excess: float, *, upper: bool) -> Block:
    bound = seat.most_move if upper else seat.least_move
    needed = bound + float(excess if upper else -excess)
    return Block(
        bearing=seat.name, condition="", quantity="move", bound=bound, upper=upper, needed=needed
    )


def _conflict(
    free: AlignmentLine, before: Sequence[LineState], seconds: float
) -> tuple[Block, ...]:
    """Limits that no moves bring together: those that would have to give, and what stands against.

    The latter are the rows with a multiplier where the violation is least.
    """
    programme = _programme(free, before, elastic=True)
    violation = programme.slack.astype(float)
    settled, best = _optimum(programme, violation, seconds)
    if best is None:
        return ()
    moves, turns, _ = _read(settled, best.x)
    moved = free.moved(moves, turns)
    give = [
        Block(
            bearing=limit.bearing,
            condition=limit.condition,
            quantity=limit.quantity,
            bound=limit.most if limit.value > limit.most else limit.least,
            upper=limit.value > limit.most,
            needed=limit.value,
        )
        for state in before
        for limit in check(reactions(moved, state.condition))
        if not limit.met
    ]
    against = [
        meaning
        for meaning, multiplier in zip(settled.meaning, best.ineqlin.marginals, strict=True)
        if meaning is not None and multiplier < -_FEASIBLE
    ]
    return tuple(dict.fromkeys([*give, *against]))
