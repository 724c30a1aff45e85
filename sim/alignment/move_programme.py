"""Mixed-integer programme of a load calibration: its rows, and the moves found."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from .alignment import (
    LIMIT_UNITS,
    MET,
    AlignmentLine,
    LineState,
    gather_points,
    lever_arms,
    point_heights,
    vertical_load,
)
from .contact import following

Vector = NDArray[np.float64]

MoveSolution = tuple[Vector, Vector, Vector]
"""Moves [m], turns [rad], expected reactions [N]."""

MILLIMETRES = 1e3  # mm per metre: the programme's lengths are near one
_RESERVE = 1e-6  # of a mean load: margin for rounding and tolerances
FEASIBLE = 1e-9  # HiGHS's tolerance for a linear programme, well inside the reserve
_LOOSE = 2e-7  # HiGHS's tolerance for a mixed one, 1e-7, with some margin

STILL_MOVE = 1e-9  # m: smaller moves count as none

_EVEN = 1e-2  # of the least sum of squares, traded for smaller moves


@dataclass(frozen=True, kw_only=True)
class Block:
    """A bound that prevents a calibration from meeting every limit.

    Attributes
    ----------
    bearing : str
    condition : str
        Empty for the bound of a move, which applies to all conditions.
    quantity : str
        "move" [m], "reaction" [N], "mean pressure" [Pa], "slope" [rad], or "contact".
    bound : float
    upper : bool
        True for an upper, False for a lower bound.
    needed : float
        Required value of the bound; NaN if it conflicts with others but need not change
        itself.
    """

    bearing: str
    condition: str
    quantity: str
    bound: float
    upper: bool
    needed: float = math.nan

    @property
    def text(self) -> str:
        """Description in words."""
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
class _Response:
    """A condition with all points in contact, affine in x = (moves, turns, gaps).

    Moves and gaps are in mm, a turn as the move of the bore's edge in mm. A point that lifts acts
    as if its seat were higher by the gap.
    """

    state: LineState
    loads: Vector  # (p, 1 + 2 n + p), the constant first [N]
    slopes: Vector  # relative to the bores [rad]
    widest: float  # bound of a gap [mm]
    whole: float  # sum of all reactions [N]


def response_of(state: LineState) -> _Response:
    """Response of a state of the line to moves and turns of its seats."""
    line, held = state.line, state.line.held
    dead, sag = held.carry(vertical_load(line, state.condition))
    heights = point_heights(line, state.condition)
    follow, give = following(held, np.ones(dead.size, dtype=bool))
    gather = gather_points(line)
    edge = _edges(line)
    raised = (
        np.hstack([gather.T, gather.T * (lever_arms(line)[:, None] / edge), np.eye(dead.size)])
        / MILLIMETRES
    )
    y = np.column_stack([follow @ heights - give @ dead, follow @ raised])
    loads = held.influence @ y
    loads[:, 0] += dead
    nodes = [2 * line.beam.node(seat.station) + 1 for seat in line.seats]
    slopes = held.lines[nodes] @ y
    slopes[:, 0] += sag[nodes] - (state.slopes - state.relative_slopes)
    n = len(line.seats)
    slopes[:, 1 + n : 1 + 2 * n] -= np.diag(1 / edge / MILLIMETRES)
    return _Response(
        state=state,
        loads=loads,
        slopes=slopes,
        widest=_widest_gap(state, dead, heights),
        whole=float(dead.sum()),
    )


def _edges(line: AlignmentLine) -> Vector:
    """Lever of a turn: half the bore, or a metre if its length is not given [m]."""
    return np.array([seat.length / 2 or 1.0 for seat in line.seats])


def _widest_gap(state: LineState, dead: Vector, heights: Vector) -> float:
    """Bound of any gap in the search [mm].

    A generous multiple of all that could open one: the spread of the heights, the moves, and the
    sag of the shaft with one point removed. With a wider bound, a switch that is 1e-6 off
    a whole number would allow a significant gap.
    """
    seats = state.line.seats
    sag = float((np.abs(dead) / np.diag(state.line.held.influence)).max())
    moves = max(seat.most_move - seat.least_move for seat in seats)
    turns = max((seat.most_turn - seat.least_turn) * seat.length for seat in seats)
    reach = float(np.ptp(heights)) + moves + turns + sag
    return MILLIMETRES * (10 * reach + 4 * float(state.gaps.max()))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Row:
    """``row (1, x) <= bound``."""

    row: Vector  # (1 + 2 n + p,), the constant first
    bound: float
    meaning: Block
    elastic: bool


def _limit_row(row: Vector, now: float, unit: float, meaning: Block, elastic: bool) -> _Row:
    """A limit as a row with an upper bound, with a small reserve.

    A limit that is met stays met: the bound is then not below the present value.
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
class MoveProgramme:
    """``matrix x <= bound`` and ``least <= x <= most``.

    The columns are the moves up, the moves down, the turns up, the turns down, for each condition
    its gaps and then their switches (1: in contact), and a slack for each elastic row.
    """

    n: int
    matrix: Vector
    bound: Vector
    least: Vector
    most: Vector
    switch: NDArray[np.bool_]  # integer columns
    slack: NDArray[np.bool_]  # columns
    meaning: tuple[Block | None, ...]  # of the rows; None for an elastic one
    responses: tuple[_Response, ...]

    @property
    def moving(self) -> Vector:
        """Cost of the moves."""
        cost = np.zeros(self.least.size)
        cost[: 4 * self.n] = 1.0
        return cost


def programme_of(
    line: AlignmentLine, before: Sequence[LineState], *, elastic: bool
) -> MoveProgramme:
    """Rows and columns of a calibration in all conditions together, with elastic limits or not."""
    n, p, m = len(line.seats), line.held.stations.size, len(before)
    responses = tuple(response_of(state) for state in before)
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
    return MoveProgramme(
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
    """Spread a row over moves, turns and gaps of condition c to all columns."""
    full = np.zeros(size)
    full[:n], full[n : 2 * n] = row[:n], -row[:n]
    full[2 * n : 3 * n], full[3 * n : 4 * n] = row[n : 2 * n], -row[n : 2 * n]
    first = 4 * n + 2 * c * p
    full[first : first + p] = row[2 * n :]
    return full


def _contact_rows(
    response: _Response, unit: float, c: int, size: int
) -> tuple[list[Vector], list[float]]:
    """Rows for each point: no tension, no load without contact, no gap in contact."""
    p = response.loads.shape[0]
    n = len(response.state.line.seats)
    rows, bounds = [], []
    for j in range(p):
        gap = 4 * n + 2 * c * p + j
        force = _spread(response.loads[j, 1:], n, p, c, size) / unit
        dead = response.loads[j, 0] / unit
        carries, no_gap = force * unit / response.whole, np.zeros(size)
        carries[gap + p] = -1.0
        no_gap[gap], no_gap[gap + p] = 1 / response.widest, 1.0
        rows += [-force, carries, no_gap]
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
    reach: Vector = MILLIMETRES * np.array(
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
    """Seats with points that may lift: those that need no load, or have others to carry it."""
    return np.array(
        [
            seat.points > 1
            or seat.least_load <= 0
            or (elastic and float(load) < seat.least_load * (1 - MET))
            for seat, load in zip(state.line.seats, state.reactions, strict=True)
        ]
    )


def least_moves(
    line: AlignmentLine, before: Sequence[LineState], prefer: str, seconds: float
) -> MoveSolution | None:
    """Least moves that meet every limit, or None."""
    programme = programme_of(line, before, elastic=False)
    if prefer == "fewest":
        programme, count = _counting(programme)
    else:
        count = programme.moving
    found = _solve(programme, count, seconds)
    if found is None:
        return None
    return _smallest(_settled(programme, count, found.x, seconds), seconds)


def even_moves(
    line: AlignmentLine, before: Sequence[LineState], seconds: float
) -> MoveSolution | None:
    """Moves that keep every limit with reactions nearest to their mean, or None."""
    programme, cost = _evening(programme_of(line, before, elastic=False))
    settled, best = optimum_of(programme, cost, seconds)
    if best is None:
        return None
    return _smallest(_capped(settled, cost, best.fun * (1 + _EVEN) + _RESERVE), seconds)


def _evening(programme: MoveProgramme) -> tuple[MoveProgramme, Vector]:
    """Add a column for each reaction's squared difference from the mean; and the cost of their sum.

    A column is bounded from below by tangents of the parabola, to keep the programme linear.
    """
    n, p, size = programme.n, programme.responses[0].loads.shape[0], programme.least.size
    count = n * len(programme.responses)
    wide = widened(programme, count, np.inf, whole=False)
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
"""Differences from the mean reaction, over the mean, at the points of tangency."""


def nearest_moves(
    line: AlignmentLine, before: Sequence[LineState], seconds: float
) -> MoveSolution | None:
    """Moves that come closest to the unmet limits; None without a solution."""
    programme = programme_of(line, before, elastic=True)
    violation = programme.slack.astype(float)
    settled, best = optimum_of(programme, violation, seconds)
    if best is None:
        return None
    return _smallest(_capped(settled, violation, best.fun + _RESERVE), seconds)


def optimum_of(programme: MoveProgramme, cost: Vector, seconds: float) -> tuple[MoveProgramme, Any]:
    """Programme with fixed switches, and its solution or None."""
    found = _solve(programme, cost, seconds)
    if found is None:
        return programme, None
    settled = _settled(programme, cost, found.x, seconds)
    return settled, _solve(settled, cost, seconds)


def _solve(programme: MoveProgramme, cost: Vector, seconds: float) -> Any:
    mixed = bool(programme.switch.any())
    options: dict[str, float] = {"time_limit": seconds}
    if not mixed:  # the mixed one only has to find the switches
        options["primal_feasibility_tolerance"] = FEASIBLE
        options["dual_feasibility_tolerance"] = FEASIBLE
    result = linprog(
        cost,
        A_ub=programme.matrix,
        b_ub=programme.bound,
        bounds=np.column_stack([programme.least, programme.most]),
        integrality=programme.switch.astype(int) if mixed else None,
        options=options,
    )
    return result if result.status == 0 else None


def _settled(programme: MoveProgramme, cost: Vector, x: Vector, seconds: float) -> MoveProgramme:
    """Fix the switches as found; loosen rows that they satisfy only to tolerance."""
    least, most = programme.least.copy(), programme.most.copy()
    least[programme.switch] = most[programme.switch] = np.round(x[programme.switch])
    switch = np.zeros_like(programme.switch)
    settled = replace(programme, least=least, most=most, switch=switch)
    if not programme.switch.any() or _solve(settled, cost, seconds) is not None:
        return settled
    return replace(settled, bound=settled.bound + _LOOSE)


def _capped(programme: MoveProgramme, cost: Vector, most: float) -> MoveProgramme:
    return replace(
        programme,
        matrix=np.vstack([programme.matrix, cost]),
        bound=np.append(programme.bound, most),
        meaning=(*programme.meaning, None),
    )


def widened(programme: MoveProgramme, n: int, most: float, whole: bool) -> MoveProgramme:
    """Add n columns."""
    return replace(
        programme,
        matrix=np.hstack([programme.matrix, np.zeros((programme.bound.size, n))]),
        least=np.append(programme.least, np.zeros(n)),
        most=np.append(programme.most, np.full(n, most)),
        switch=np.append(programme.switch, np.full(n, whole)),
        slack=np.append(programme.slack, np.zeros(n, dtype=bool)),
    )


def _travel(programme: MoveProgramme) -> Vector:
    """Matrix (n, columns) of each bearing's travel, including the turn of its edge."""
    eye = np.eye(programme.n)
    travel = np.zeros((programme.n, programme.least.size))
    travel[:, : 4 * programme.n] = np.hstack([eye, eye, eye, eye])
    return travel


def _counting(programme: MoveProgramme) -> tuple[MoveProgramme, Vector]:
    """Add a switch for each bearing that moves, and the cost that counts them."""
    n, size = programme.n, programme.least.size
    wide = widened(programme, n, 1.0, whole=True)
    rows = _travel(wide)
    rows[:, size:] = -np.diag(programme.most[: 4 * n].reshape(4, n).sum(axis=0) + _RESERVE)
    counted = replace(
        wide,
        matrix=np.vstack([wide.matrix, rows]),
        bound=np.append(wide.bound, np.zeros(n)),
        meaning=(*wide.meaning, *[None] * n),
    )
    return counted, (np.arange(size + n) >= size).astype(float)


def _smallest(settled: MoveProgramme, seconds: float) -> MoveSolution | None:
    """Least sum of moves, and among those the least largest move."""
    found = _solve(settled, settled.moving, seconds)
    if found is None:
        return None
    capped = _capped(settled, settled.moving, found.fun * (1 + _RESERVE) + _RESERVE)
    size = capped.least.size
    wide = widened(capped, 1, np.inf, whole=False)
    rows = _travel(wide)
    rows[:, -1] = -1.0
    even = replace(
        wide,
        matrix=np.vstack([wide.matrix, rows]),
        bound=np.append(wide.bound, np.zeros(settled.n)),
        meaning=(*wide.meaning, *[None] * settled.n),
    )
    last = _solve(even, (np.arange(size + 1) == size).astype(float), seconds)
    return solution_of(settled, found.x if last is None else last.x[:size])


def solution_of(programme: MoveProgramme, x: Vector) -> MoveSolution:
    """Moves, turns and expected reactions of a programme's solution."""
    n, p = programme.n, programme.responses[0].loads.shape[0]
    line = programme.responses[0].state.line
    up, down, turn_up, turn_down = x[: 4 * n].reshape(4, n)
    gather = gather_points(line)
    promised = []
    for c, response in enumerate(programme.responses):
        first = 4 * n + 2 * c * p
        own = np.concatenate([[1.0], up - down, turn_up - turn_down, x[first : first + p]])
        promised.append(gather @ response.loads @ own)
    moves, turns = (up - down) / MILLIMETRES, (turn_up - turn_down) / MILLIMETRES / _edges(line)
    return moves, turns, np.array(promised)
