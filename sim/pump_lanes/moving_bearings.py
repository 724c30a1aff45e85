"""Main bearings that yielding casings carry along, of all lanes; see ``moving_bearing`` of one."""

from typing import Any

from ..jit import kernel, kernel_apart, subroutine
from ..mechanism.layout import PUSHES
from ..mechanism.moving_bearing import carried_on, of_mode, settled
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
    a: float = of_mode(
        force, q, v, k[mode, REACT, lane], k[mode, REACT + 1, lane], k[mode, REACT + 2, lane]
    )
    return a


@kernel
def _carry(m: Any, s: Any, mode: int, lane: int, force: float) -> None:
    """Add to a bearing's acceleration that of a mode."""
    a = _mean_acceleration(m, mode, lane, force)
    s.bearing[0, lane] += m.modes[mode, GIVE, lane] * a
    s.bearing[1, lane] += m.modes[mode, GIVE + 1, lane] * a


@kernel
def _take_force(m: Any, s: Any, mode: int, lane: int, force: float) -> None:
    _carry(m, s, mode, lane, force)
    for row in range(MOVED + 4, MOVED + 2, -1):
        m.modes[mode, row, lane] = m.modes[mode, row - 1, lane]
    m.modes[mode, MOVED + 2, lane] = force


@kernel_apart
def _push_mode(m: Any, s: Any, left: Any, n: int, mode: int) -> None:
    for lane in range(LANES):
        _take_force(m, s, mode, lane, _pushed(m, left, n, mode, lane))


@kernel_apart
def _push_mode_together(throws: int, m: Any, s: Any, left: Any, n: int, mode: int) -> None:
    """The throws of a record push on the same modes."""
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


@kernel_apart
def _move_mode(m: Any, p: Any, s: Any, mode: int) -> None:
    """Mode after the step, and how it carries the bearing in the next one."""
    k = m.modes
    for lane in range(LANES):
        pushed = k[mode, MOVED + 2, lane]
        late_x, late_y = s.late[0, lane], s.late[1, lane]
        held_x, held_y = k[mode, HELD, lane], k[mode, HELD + 1, lane]
        force = pushed + held_x * late_x + held_y * late_y
        q, v = k[mode, MOVED, lane], k[mode, MOVED + 1, lane]
        a = _mean_acceleration(m, mode, lane, force)
        k[mode, MOVED, lane] = of_mode(
            force, q, v, k[mode, REACH, lane], k[mode, REACH + 1, lane], k[mode, REACH + 2, lane]
        )
        k[mode, MOVED + 1, lane] = v + p.step[lane] * a
        ahead = carried_on(pushed, k[mode, MOVED + 3, lane], k[mode, MOVED + 4, lane])
        _carry(m, s, mode, lane, ahead)


@kernel
def _settled(p: Any, s: Any, lane: int, felt_x: float, felt_y: float) -> Any:
    """Acceleration of a bearing had what it carries felt just that."""
    x, y, b = s.bearing[0, lane], s.bearing[1, lane], p.blend
    return (
        settled(x, y, felt_x, felt_y, b[0, 0, lane], b[0, 1, lane]),
        settled(y, x, felt_y, felt_x, b[1, 1, lane], b[1, 0, lane]),
    )


@kernel
def _find_late(p: Any, s: Any) -> None:
    """By how much what was felt was ahead of the bearing, which begins the next step."""
    for lane in range(LANES):
        x, y = s.felt[0, lane], s.felt[1, lane]
        now_x, now_y = _settled(p, s, lane, x, y)
        s.late[0, lane], s.late[1, lane] = x - now_x, y - now_y
        s.bearing[0, lane] = s.bearing[1, lane] = 0.0


@kernel
def _feel(p: Any, s: Any) -> None:
    before = s.felt_before
    for lane in range(LANES):
        x, y = s.felt[0, lane], s.felt[1, lane]
        next_x = carried_on(x, before[0, 0, lane], before[1, 0, lane])
        next_y = carried_on(y, before[0, 1, lane], before[1, 1, lane])
        before[1, 0, lane], before[1, 1, lane] = before[0, 0, lane], before[0, 1, lane]
        before[0, 0, lane], before[0, 1, lane] = x, y
        felt_x, felt_y = _settled(p, s, lane, next_x, next_y)
        s.felt[0, lane], s.felt[1, lane] = felt_x, felt_y
        p.machine[0, lane] = p.gravity[0, lane] + felt_x
        p.machine[1, lane] = p.gravity[1, lane] + felt_y
        s.bearing[0, lane] = s.bearing[1, lane] = 0.0


@subroutine
def move_bearings(p: Any, s: Any, m: Any, left: Any, n: int) -> None:
    """What turns is heavier in the next step by how the casing accelerates its bearing."""
    for mode in range(p.modes):
        if p.throws > 1:
            _push_mode_together(p.throws, m, s, left, n, mode)
        else:
            _push_mode(m, s, left, n, mode)
    _find_late(p, s)
    for mode in range(p.modes):
        _move_mode(m, p, s, mode)
    _feel(p, s)
