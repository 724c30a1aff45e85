"""Steps of all lanes in parallel; those with a contact change, one record at a time."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.chamber import GATHERED
from ..jit import kernel, subroutine
from ..mechanism.crank_step import mean_of_stages
from ..mechanism.layout import (
    CONTACTS,
    GUIDE,
)
from .chambers import count_vapour, step_chamber_alone, step_chambers
from .lane_layout import (
    ALL_MOVING,
    CRANK,
    DRY,
    LANE_FORCES,
    LANES,
    MOVING,
)
from .moving_bearings import move_bearings
from .one_lane import failed, step_alone
from .rates import accelerate, beyond_limit, loads, rates

STRETCH = 64
"""Steps taken together: their results fit a processor's second cache."""

# one step more: columns at multiples of 4096 bytes would conflict in the cache
LEFT = np.dtype(
    [
        ("turns", "f8", (2, STRETCH + 1, LANES)),  # angle and speed at the ends of the steps
        ("forces", "f8", (len(LANE_FORCES) + 2, STRETCH + 1, LANES)),  # the valves' last
        ("chambers", "f8", (len(GATHERED), STRETCH + 1, LANES)),
        ("gaps", "f8", (2, STRETCH + 1, LANES)),  # of the films, and force of their asperities
    ]
)
"""Results of a stretch of steps; one record, like ``STATE``."""


class Stretch(NamedTuple):
    """Results of a stretch of steps, and how it ended."""

    left: NDArray[Any]  # (1,) of LEFT
    code: NDArray[np.int64]  # (LANES,): of the first step that failed
    done: NDArray[np.int64]  # (LANES,): steps up to it


# Loops over rows inside loops over lanes, although lanes are contiguous: the compiler vectorises
# the outer loop, and would unroll a short inner one over lanes.


@kernel
def _begin(p: Any, s: Any, first: int, rows: int) -> None:
    """Save the start of the step; its rates lead to the second stage."""
    for lane in range(LANES):
        h = 0.5 * p.step[lane]
        for c in range(first, rows):
            x, v, a = s.x[c, lane], s.v[c, lane], s.a[c, lane]
            s.x0[c, lane], s.v0[c, lane], s.a0[c, lane] = x, v, a
            s.x[c, lane], s.v[c, lane] = x + h * v, v + h * a


@kernel
def _to_third(p: Any, s: Any, first: int, rows: int) -> None:
    for lane in range(LANES):
        h = 0.5 * p.step[lane]
        for c in range(first, rows):
            v, a = s.v[c, lane], s.a[c, lane]
            s.middle_v[c, lane], s.middle_a[c, lane] = v, a
            s.x[c, lane], s.v[c, lane] = s.x0[c, lane] + h * v, s.v0[c, lane] + h * a


@kernel
def _to_last(p: Any, s: Any, first: int, rows: int) -> None:
    for lane in range(LANES):
        h = p.step[lane]
        for c in range(first, rows):
            v, a = s.v[c, lane], s.a[c, lane]
            s.middle_v[c, lane] += v
            s.middle_a[c, lane] += a
            s.x[c, lane], s.v[c, lane] = s.x0[c, lane] + h * v, s.v0[c, lane] + h * a


@kernel
def _end(p: Any, s: Any, first: int, rows: int) -> None:
    for lane in range(LANES):
        sixth = p.sixth[lane]
        for c in range(first, rows):
            v = mean_of_stages(s.v0[c, lane], s.middle_v[c, lane], s.v[c, lane])
            a = mean_of_stages(s.a0[c, lane], s.middle_a[c, lane], s.a[c, lane])
            s.x[c, lane] = s.x0[c, lane] + sixth * v
            s.v[c, lane] = s.v0[c, lane] + sixth * a


@kernel
def _begin_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        h = 0.5 * p.step[lane]
        for c in range(2):
            x, v = s.film[c, lane], s.film_rate[c, lane]
            s.film0[c, lane], s.film_rate0[c, lane] = x, v
            s.squeeze0[c, lane] = s.squeeze[c, lane]
            s.film[c, lane] = x + h * v


@kernel
def _films_to_third(p: Any, s: Any) -> None:
    for lane in range(LANES):
        h = 0.5 * p.step[lane]
        for c in range(2):
            s.middle_film[c, lane] = s.film_rate[c, lane]
            s.film[c, lane] = s.film0[c, lane] + h * s.film_rate[c, lane]


@kernel
def _films_to_last(p: Any, s: Any) -> None:
    for lane in range(LANES):
        for c in range(2):
            s.middle_film[c, lane] += s.film_rate[c, lane]
            s.film[c, lane] = s.film0[c, lane] + p.step[lane] * s.film_rate[c, lane]


@kernel
def _end_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        for c in range(2):
            rate = mean_of_stages(
                s.film_rate0[c, lane], s.middle_film[c, lane], s.film_rate[c, lane]
            )
            s.film[c, lane] = s.film0[c, lane] + p.sixth[lane] * rate


@subroutine
def _to_second_stage(p: Any, s: Any, kind: Any) -> None:
    """Save the start of the step; its rates lead to the second stage."""
    _begin(p, s, 0, MOVING)
    _keep_contacts(s, 0, 1)
    if kind.wrist:
        _keep_contacts(s, 1, GUIDE)
    if kind.guide:
        _begin(p, s, MOVING, ALL_MOVING)
        _keep_contacts(s, GUIDE, CONTACTS)
    if kind.oil != DRY:
        _begin_films(p, s)
    for lane in range(LANES):
        for c in range(len(LANE_FORCES)):
            s.force0[c, lane] = s.force[c, lane]
        s.normal0[lane] = s.normal[lane]


@kernel
def _keep_contacts(s: Any, first: int, end: int) -> None:
    for lane in range(LANES):
        for j in range(first, end):
            s.margin0[j, lane], s.approach0[j, lane] = s.margin[j, lane], s.approach[j, lane]


@subroutine
def _to_third_stage(p: Any, s: Any, across: bool, oiled: bool) -> None:
    _to_third(p, s, 0, MOVING)
    if across:
        _to_third(p, s, MOVING, ALL_MOVING)
    if oiled:
        _films_to_third(p, s)
    for lane in range(LANES):
        for c in range(len(LANE_FORCES)):
            s.middle_force[c, lane] = s.force[c, lane]
        s.high[lane] = max(s.normal0[lane], s.normal[lane])


@subroutine
def _to_last_stage(p: Any, s: Any, across: bool, oiled: bool) -> None:
    _to_last(p, s, 0, MOVING)
    if across:
        _to_last(p, s, MOVING, ALL_MOVING)
    if oiled:
        _films_to_last(p, s)
    for lane in range(LANES):
        for c in range(len(LANE_FORCES)):
            s.middle_force[c, lane] += s.force[c, lane]
        s.high[lane] = max(s.high[lane], s.normal[lane])


@subroutine
def _to_end(p: Any, s: Any, left: Any, n: int, across: bool, oiled: bool) -> None:
    """Compute the state at the end of step n, and the mean forces over it."""
    _end(p, s, 0, MOVING)
    if across:
        _end(p, s, MOVING, ALL_MOVING)
    if oiled:
        _end_films(p, s)
    for lane in range(LANES):
        weight = p.weight[lane]
        for c in range(len(LANE_FORCES)):
            left.forces[c, n, lane] = weight * mean_of_stages(
                s.force0[c, lane], s.middle_force[c, lane], s.force[c, lane]
            )


@subroutine
def _check_step(p: Any, s: Any) -> int:
    """Find lanes that need a cut, and lanes that failed; return their total number."""
    m, found = s.margin, 0
    for lane in range(LANES):
        least = min(
            min(min(m[0, lane], m[1, lane]), min(m[2, lane], m[3, lane])),
            min(m[4, lane], m[5, lane]),
        )
        s.asks[lane] = 1.0 if least < 0.0 else 0.0
    if p.throws > 1:
        _share_cuts(p, s)
    for lane in range(LANES):
        # forces of a step that will be cut are not forces of the run
        s.peak[lane] = max(s.peak[lane], 0.0 if s.asks[lane] != 0.0 else s.high[lane])
        code = failed(s, beyond_limit(p, s, lane), lane)
        s.bad[lane] = _CHOKED if s.choked[lane] != 0.0 else code
    for lane in range(LANES):
        found += s.asks[lane] != 0.0 or s.bad[lane] != 0.0
    return found


@kernel
def _share_cuts(p: Any, s: Any) -> None:
    """Cut the step of all throws of a record if a contact of one throw needs it."""
    n = p.throws
    for first in range(0, LANES - n + 1, n):
        asks = 0.0
        for lane in range(first, first + n):
            asks = max(asks, s.asks[lane])
        for lane in range(first, first + n):
            s.asks[lane] = asks


@subroutine
def _repeat_steps(chambered: bool, p: Any, s: Any, a: Any, k: Any, step: int) -> int:
    """Repeat the step of records that need a cut; stop those that fail in it.

    Returns the number of repeated steps.
    """
    again, n = 0, p.throws
    for first in range(0, LANES - n + 1, n):
        if k.code[first] != 0:
            continue
        if s.asks[first] != 0.0:
            again += 1
            step_alone(first, p, s, a, k.left[0], step, chambered)
            for lane in range(first, first + n if chambered else first):
                step_chamber_alone(lane, p, s, a)
                s.bad[lane] = _CHOKED if s.choked[lane] != 0.0 else s.bad[lane]
        code = _code_of_record(first, n, s)
        if code != 0:
            for lane in range(first, first + n):
                k.code[lane], k.done[lane] = code, step + 1
    return again


@kernel
def _code_of_record(first: int, n: int, s: Any) -> int:
    """Status code of all throws in the order of the march of one record: chambers, then bodies."""
    code = 0
    for lane in range(first, first + n):
        own = int(s.bad[lane])
        if own == int(_CHOKED):
            return own
        if code <= _LOST:  # the first throw beyond its limits
            code = max(code, own)
    return code


_LOST, _CHOKED = 1, 4.0  # status codes of a non-finite state, and of a failed chamber


@subroutine
def _keep_chambers(p: Any, s: Any, left: Any, n: int) -> None:
    for lane in range(LANES):
        left.forces[_SUCTION, n, lane] = s.flow[0, lane] / p.step[lane]
        left.forces[_SUCTION + 1, n, lane] = s.flow[1, lane] / p.step[lane]
        left.chambers[0, n, lane] = s.chamber[_VAPOUR, lane]
        left.chambers[1, n, lane] = s.chamber[_SUCTION_LIFT, lane]
        left.chambers[2, n, lane] = s.chamber[_DISCHARGE_LIFT, lane]


_SUCTION = len(LANE_FORCES)
_VAPOUR, _SUCTION_LIFT, _DISCHARGE_LIFT = GATHERED


@subroutine
def _keep_turns(s: Any, left: Any, n: int) -> None:
    for lane in range(LANES):
        left.turns[0, n, lane], left.turns[1, n, lane] = s.x[CRANK, lane], s.v[CRANK, lane]


@subroutine
def _keep_gaps(s: Any, left: Any, n: int) -> None:
    for lane in range(LANES):
        left.gaps[0, n, lane], left.gaps[1, n, lane] = s.gap[lane], s.carried[lane]


@subroutine
def march(kind: Any, n: int, p: Any, s: Any, m: Any, a: Any, k: Any) -> None:
    """Take n steps of all lanes of one kind.

    Chambers are stepped before the rates at the end of a step are computed, which so use the actual
    instead of the extrapolated pressure. Contact changes do not depend on that, nor on the motion
    of bearings on a yielding casing, for which the accelerations wait.
    """
    across, chambered = kind.guide, kind.chambers
    left, oiled = k.left[0], kind.oil != DRY
    for step in range(n):
        _to_second_stage(p, s, kind)
        rates(p, s, 0.5, kind, a.maps)
        _to_third_stage(p, s, across, oiled)
        rates(p, s, 0.5, kind, a.maps)
        _to_last_stage(p, s, across, oiled)
        rates(p, s, 1.0, kind, a.maps)
        _to_end(p, s, left, step, across, oiled)
        with_care = step_chambers(p, s, a, k.code) if chambered else 0
        loads(p, s, 0.0, kind, a.maps)
        found = _check_step(p, s)
        if found > 0 or not kind.yields:
            accelerate(p, s)
        if found > 0:
            again = _repeat_steps(chambered, p, s, a, k, step)
            if chambered:
                with_care += again
            if again > 0 and (chambered or kind.yields) and not oiled:
                loads(p, s, 0.0, kind, a.maps)
                accelerate(p, s)
        if oiled:
            _keep_gaps(s, left, step)
            if chambered:  # as in the march of one: films at the actual pressure
                rates(p, s, 0.0, kind, a.maps)
        if chambered:
            _keep_chambers(p, s, left, step)
            if with_care > 0:
                count_vapour(s, a)
        _keep_turns(s, left, step)
        if kind.yields:
            move_bearings(p, s, m, left, step)
            accelerate(p, s)
