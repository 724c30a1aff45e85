"""Main bearings carried by yielding casings, in all lanes; like ``moving_bearing`` for one."""

from typing import Any

from ..jit import kernel, kernel_noalias, subroutine
from ..mechanism.layout import PUSHES
from ..mechanism.moving_bearing import extrapolated, mode_response, settled
from .lane_layout import GIVE, HELD, LANES, MOVED, PUSH, REACH, REACT


@kernel
def _pushed(m: Any, left: Any, n: int, mode: int, lane: int) -> float:
    """Force of a throw on a mode."""
    own = 0.0
    for c in range(len(PUSHES)):
        own += m.modes[mode, PUSH + c, lane] * left.forces[c, n, lane]
    return 0.0 + own


@kernel
def _mean_acceleration(m: Any, mode: int, lane: int, force: float) -> float:
    k = m.modes
    q, v = k[mode, MOVED, lane], k[mode, MOVED + 1, lane]
    a: float = mode_response(
        force, q, v, k[mode, REACT, lane], k[mode, REACT + 1, lane], k[mode, REACT + 2, lane]
    )
    return a


@kernel
def _carry(m: Any, s: Any, mode: int, lane: int, force: float) -> None:
    """Add the acceleration of a mode to that of a bearing."""
    a = _mean_acceleration(m, mode, lane, force)
    s.bearing[0, lane] += m.modes[mode, GIVE, lane] * a
    s.bearing[1, lane] += m.modes[mode, GIVE + 1, lane] * a


@kernel
def _take_force(m: Any, s: Any, mode: int, lane: int, force: float) -> None:
    _carry(m, s, mode, lane, force)
    for row in range(MOVED + 4, MOVED + 2, -1):
        m.modes[mode, row, lane] = m.modes[mode, row - 1, lane]
    m.modes[mode, MOVED + 2, lane] = force


@kernel_noalias
def _push_mode(m: Any, s: Any, left: Any, n: int, mode: int) -> None:
    for lane in range(LANES):
        _take_force(m, s, mode, lane, _pushed(m, left, n, mode, lane))


@kernel_noalias
def _push_mode_together(throws: int, m: Any, s: Any, left: Any, n: int, mode: int) -> None:
    """Add the forces of a record's throws on the same modes."""
    for lane in range(LANES):
        s.pushed[lane] = _pushed(m, left, n, mode, lane)
    for first in range(0, LANES - throws + 1, throws):
        force = 0.0
        for lane in range(first, first + throws):
            force += s.pushed[lane]
        for lane in range(first, first + throws):
            s.pushed[lane] = force
    for lane in range(LANES):
        _take_force(m, s, mode, lane, s.pushed[lane])


@kernel_noalias
def _move_mode(m: Any, p: Any, s: Any, mode: int) -> None:
    """Advance a mode, and add its motion in the next step to the bearing."""
    k = m.modes
    for lane in range(LANES):
        pushed = k[mode, MOVED + 2, lane]
        late_x, late_y = s.late[0, lane], s.late[1, lane]
        held_x, held_y = k[mode, HELD, lane], k[mode, HELD + 1, lane]
        force = pushed + held_x * late_x + held_y * late_y
        q, v = k[mode, MOVED, lane], k[mode, MOVED + 1, lane]
        a = _mean_acceleration(m, mode, lane, force)
        k[mode, MOVED, lane] = mode_response(
            force, q, v, k[mode, REACH, lane], k[mode, REACH + 1, lane], k[mode, REACH + 2, lane]
        )
        k[mode, MOVED + 1, lane] = v + p.step[lane] * a
        ahead = extrapolated(pushed, k[mode, MOVED + 3, lane], k[mode, MOVED + 4, lane])
        _carry(m, s, mode, lane, ahead)


@kernel
def _settled(p: Any, s: Any, lane: int, assumed_x: float, assumed_y: float) -> Any:
    """Acceleration that a bearing would have if its load had assumed just this value."""
    x, y, b = s.bearing[0, lane], s.bearing[1, lane], p.blend
    return (
        settled(x, y, assumed_x, assumed_y, b[0, 0, lane], b[0, 1, lane]),
        settled(y, x, assumed_y, assumed_x, b[1, 1, lane], b[1, 0, lane]),
    )


@kernel
def _find_errors(p: Any, s: Any) -> None:
    """Error of the assumed acceleration; reset the bearing for the next step."""
    for lane in range(LANES):
        x, y = s.assumed[0, lane], s.assumed[1, lane]
        now_x, now_y = _settled(p, s, lane, x, y)
        s.late[0, lane], s.late[1, lane] = x - now_x, y - now_y
        s.bearing[0, lane] = s.bearing[1, lane] = 0.0


@kernel
def _assume(p: Any, s: Any) -> None:
    before = s.assumed_before
    for lane in range(LANES):
        x, y = s.assumed[0, lane], s.assumed[1, lane]
        next_x = extrapolated(x, before[0, 0, lane], before[1, 0, lane])
        next_y = extrapolated(y, before[0, 1, lane], before[1, 1, lane])
        before[1, 0, lane], before[1, 1, lane] = before[0, 0, lane], before[0, 1, lane]
        before[0, 0, lane], before[0, 1, lane] = x, y
        assumed_x, assumed_y = _settled(p, s, lane, next_x, next_y)
        s.assumed[0, lane], s.assumed[1, lane] = assumed_x, assumed_y
        p.machine[0, lane] = p.gravity[0, lane] + assumed_x
        p.machine[1, lane] = p.gravity[1, lane] + assumed_y
        s.bearing[0, lane] = s.bearing[1, lane] = 0.0


@subroutine
def move_bearings(p: Any, s: Any, m: Any, left: Any, n: int) -> None:
    """Add the casing's predicted acceleration to the weight for the next step."""
    for mode in range(p.modes):
        if p.throws > 1:
            _push_mode_together(p.throws, m, s, left, n, mode)
        else:
            _push_mode(m, s, left, n, mode)
    _find_errors(p, s)
    for mode in range(p.modes):
        _move_mode(m, p, s, mode)
    _assume(p, s)
