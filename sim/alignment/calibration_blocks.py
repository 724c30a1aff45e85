"""Limits and bounds that prevent a load calibration."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .alignment import AlignmentLine, LineState, check, reactions
from .move_programme import (
    FEASIBLE,
    MILLIMETRES,
    STILL_MOVE,
    Block,
    optimum_of,
    programme_of,
    response_of,
    solution_of,
    widened,
)
from .seats import Seat


def with_seats(line: AlignmentLine, seats: tuple[Seat, ...]) -> AlignmentLine:
    """Line with other limits or bounds, which do not affect the shaft."""
    other = AlignmentLine(beam=line.beam, seats=seats)
    other.__dict__["held"] = line.held
    return other


def blocks_of(
    line: AlignmentLine, before: Sequence[LineState], seconds: float
) -> tuple[Block, ...]:
    """Blocks: bounds of moves, first for bearings that move at all; else limits."""
    seats = line.seats
    reach = max(response_of(state).widest for state in before) / (5 * MILLIMETRES)
    moving = np.array([seat.least_move < seat.most_move for seat in seats])
    for may in (moving, np.ones_like(moving)):
        free = _with_wide_moves(line, may, reach)
        found = _widening(line, free, before, seconds) if may.any() else ()
        if found:
            return found
    return _conflict(free, before, seconds)


def _with_wide_moves(line: AlignmentLine, may: NDArray[np.bool_], reach: float) -> AlignmentLine:
    """Line with wide bounds for the moves that may be widened."""
    seats = tuple(
        replace(seat, least_move=-reach + seat.least_move, most_move=reach + seat.most_move)
        if wide
        else seat
        for seat, wide in zip(line.seats, may, strict=True)
    )
    return with_seats(line, seats)


def _widening(
    line: AlignmentLine, free: AlignmentLine, before: Sequence[LineState], seconds: float
) -> tuple[Block, ...]:
    """Least widening of the bounds of moves with which every limit can be met."""
    programme = programme_of(free, before, elastic=False)
    n, size = programme.n, programme.least.size
    wide = widened(programme, 2 * n, np.inf, whole=False)
    rows = np.zeros((2 * n, size + 2 * n))
    rows[:, : 2 * n] = np.eye(2 * n)
    rows[:, size:] = -np.eye(2 * n)
    bounds = [seat.most_move for seat in line.seats] + [-seat.least_move for seat in line.seats]
    wide = replace(
        wide,
        matrix=np.vstack([wide.matrix, rows]),
        bound=np.append(wide.bound, MILLIMETRES * np.array(bounds)),
        meaning=(*wide.meaning, *[None] * (2 * n)),
    )
    _, best = optimum_of(wide, (np.arange(size + 2 * n) >= size).astype(float), seconds)
    if best is None:
        return ()
    excess = best.x[size:] / MILLIMETRES
    return tuple(
        _move_block(line.seats[k % n], excess[k], upper=bool(k < n))
        for k in np.flatnonzero(excess > STILL_MOVE)
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
    """Limits that no moves meet together: those that would have to change, and their opponents.

    Opponents are the rows with a multiplier at the least violation.
    """
    programme = programme_of(free, before, elastic=True)
    violation = programme.slack.astype(float)
    settled, best = optimum_of(programme, violation, seconds)
    if best is None:
        return ()
    moves, turns, _ = solution_of(settled, best.x)
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
        if meaning is not None and multiplier < -FEASIBLE
    ]
    return tuple(dict.fromkeys([*give, *against]))
