"""Load calibration: the least moves of the bearings that bring a shaft line within its limits.

A mixed-integer linear programme over the moves, with a switch for every support point that may
lift, for all conditions together; the line is then solved again with the moves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..brief import brief
from ..output.status import Ending
from .alignment import AS_SET, AlignmentLine, Check, Condition, LineState, check, reactions
from .calibration_blocks import blocks_of, with_seats
from .move_programme import STILL_MOVE, Block, MoveSolution, even_moves, least_moves, nearest_moves
from .seats import AlignmentError

Vector = NDArray[np.float64]

_PROMISE = 1e-6  # of a mean load: largest difference of the programme from the line solved again

_PREFER = ("least", "fewest")
_TARGETS = ("limits", "even")

_NEARLY = 0.999  # of a margin that would leave a single admissible load
_JUST = 5e-3  # of a limit: a quantity closer than this is at the limit
_HALVINGS = 6  # of a margin that cannot be kept: down to 1/64 of it


class CalibrationStatus(Ending):
    """How a calibration ended. Every status except WITHIN and DONE includes a cure."""

    WITHIN = 0, "every limit is met; nothing moves"
    DONE = 1, "the moves bring every reaction, pressure and slope within its limits"
    INFEASIBLE = 2, "no moves within their bounds meet every limit; widen one of the blocks"
    UNRESOLVED = (
        3,
        "the search did not settle; give close support points a finite stiffness, fewer points, "
        "or more seconds",
    )

    @property
    def ok(self) -> bool:
        """Whether every limit is met after the moves."""
        return self in (CalibrationStatus.WITHIN, CalibrationStatus.DONE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """Bearing moves that correct an alignment.

    Attributes
    ----------
    status : CalibrationStatus
    line : AlignmentLine
        Line before the moves.
    moves, turns : numpy.ndarray [shape=(n,)]
        Upward moves [m], and turns of the bores [rad].
    before, after : tuple of LineState
        One state for each condition. `after` is solved again with the moves in the line.
    promised : numpy.ndarray [shape=(n_conditions, n)]
        Reactions expected by the programme [N].
    unmet : tuple of Check
        Limits still violated after the moves.
    margin : float
        Share of each limit that the moves keep as a margin.
    blocks : tuple of Block
        If there is no solution: the bounds of moves that would have to be wider, with the least
        sum; if that does not help, the limits that are in conflict for any moves.
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
        """Limits that are just met after the moves, so that a small change would violate them."""
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
        """Sum of the absolute moves [m]."""
        return float(np.abs(self.moves).sum())

    @property
    def moved(self) -> tuple[str, ...]:
        """Bearings that move or turn."""
        stir = (np.abs(self.moves) > STILL_MOVE) | (np.abs(self.turns) > STILL_MOVE)
        return tuple(name for name, far in zip(self.line.names, stir, strict=True) if far)

    @property
    def residual(self) -> float:
        """Largest difference of expected and obtained reactions, over a bearing's mean load."""
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
    """Find the moves of the bearings that meet every limit in every condition.

    Parameters
    ----------
    line : AlignmentLine
        With limits, and bounds of the moves, in its seats.
    conditions : sequence of Condition
        Conditions in which the limits must hold.
    prefer : str
        "least": the least sum of moves; "fewest": the least number of bearings moved, and then
        the least sum. Among equals the largest move is minimised.
    target : str
        "limits": moves as little as the limits require; "even": moves, even if all limits are met,
        until the sum of squared differences between reactions and their mean, over
        bearings and conditions, is within a hundredth of its minimum, by the least moves.
    margin : float
        Distance that the line must keep from every limit, as a share of the limit, >= 0 and < 1.
        If the moves cannot keep it but can meet the limits, they keep as much of it as
        possible, down to a sixty-fourth.
    seconds : float
        Time limit for each of the few programmes.

    Returns
    -------
    Calibration
        If no moves meet every limit: those that come closest, with the blocks. In any case no
        limit that was met before is violated after the moves.

    Raises
    ------
    AlignmentError
        There is no condition, two have one name, `prefer` or `target` is unknown, `margin` is not a
        share, "fewest" is combined with "even", or a condition does not fit the line.

    Notes
    -----
    A turn counts as the move of the bore's edge. With every point in contact, reactions and slopes
    are affine in the moves; a point that lifts by g acts as if its seat were higher by g, without
    load. So for each point that may lift, ``r >= 0``, ``g >= 0`` and a switch that
    sets one of them to zero: a mixed-integer linear programme, solved by HiGHS; without such points
    a linear one. Points may lift if their seat has several, or needs no least load. With the
    switches found, the programme is solved once more as a linear one. If there is no solution,
    the unmet limits become elastic and their sum of violations, each over the mean load or the
    limit of the slope, is minimised. Blocks are found by making the bounds of the moves
    elastic instead, first for bearings that move at all; if that does not help, by making
    the limits elastic without bounds of the moves, where multipliers identify the conflicts.

    References
    ----------
    Huangfu and Hall (2018), Parallelizing the dual revised simplex method, Mathematical
    Programming Computation 10, 119-142, doi:10.1007/s12532-017-0130-5.

    Examples
    --------
    >>> from wearstate.sim.alignment.seats import Seat
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
    """Options of a calibration except its margin."""

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
    """Calibration that keeps as much of a margin as possible, by halving."""
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
        solution = nearest_moves(asked, before_asked, ask.seconds)
        status = CalibrationStatus.INFEASIBLE
    if solution is None:
        return _unresolved(line, before)
    found = _calibration(status, asked, before_asked, *solution, margin)
    if not _confirmed(found):
        return _unresolved(line, before)
    if found.status is CalibrationStatus.INFEASIBLE:
        return replace(found, blocks=blocks_of(asked, before_asked, ask.seconds))
    return _with_limits_of(found, line)


def _wanted_moves(
    line: AlignmentLine, before: Sequence[LineState], ask: _Ask
) -> MoveSolution | None:
    if ask.target == "even":
        return even_moves(line, before, ask.seconds)
    return least_moves(line, before, ask.prefer, ask.seconds)


def _tightened(line: AlignmentLine, margin: float) -> AlignmentLine:
    """Line with every limit reduced by a share of itself."""
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
    return with_seats(line, seats)


def _widest_margin(line: AlignmentLine) -> float:
    """Largest margin that leaves every bearing a load between its limits."""
    return _NEARLY * min(
        (seat.highest_load - seat.least_load) / (seat.highest_load + seat.least_load)
        if math.isfinite(seat.highest_load) and seat.highest_load > 0
        else 1.0
        for seat in line.seats
    )


def _with_limits_of(found: Calibration, line: AlignmentLine) -> Calibration:
    """Calibration found with tighter limits, with its states checked against the line's own."""

    def with_own_limits(state: LineState) -> LineState:
        seats = tuple(
            replace(plain, offset=seat.offset, slope=seat.slope)
            for plain, seat in zip(line.seats, state.line.seats, strict=True)
        )
        return replace(state, line=with_seats(state.line, seats))

    return replace(
        found,
        line=line,
        before=tuple(map(with_own_limits, found.before)),
        after=tuple(map(with_own_limits, found.after)),
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
    """Whether the moves, applied to the line, act as expected and violate nothing new."""
    if found.residual > _PROMISE or (found.status is CalibrationStatus.DONE and found.unmet):
        return False
    met = {
        (limit.condition, limit.bearing, limit.quantity)
        for state in found.before
        for limit in check(state)
        if limit.met
    }
    return not any((u.condition, u.bearing, u.quantity) in met for u in found.unmet)
