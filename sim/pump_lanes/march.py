"""Steps of all lanes side by side; those in which a contact changes, a lane at a time."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.chamber import GATHERED
from ..jit import kernel, subroutine
from ..mechanism.crank_step import mean_of_stages, step_of_record
from ..mechanism.equations import derivative_of_record
from ..mechanism.layout import (
    CONTACTS,
    FORCES,
    GUIDE,
    MAIN_BEARING,
    NO_CHANGE,
    OVERLAP_LIMIT,
    ROD_MODES,
    Tables,
    Work,
    scratch,
)
from ..mechanism.march import Tally, begin
from .chambers import breathe_alone, count_vapour, enter_chamber, lanes_breathe
from .lane_layout import (
    ALL_MOVING,
    BETA,
    CRANK,
    DRY,
    LANE_FORCES,
    LANES,
    MOVING,
    PLACES,
)
from .moving_bearings import move_bearings
from .rates import accelerate, beyond_limit, loads, machine_of_lane, rates


class Alone(NamedTuple):
    """What the march of one record is told and works on, by lane."""

    throws: NDArray[Any]  # (LANES,) of THROW
    contacts: NDArray[Any]  # (LANES, 3) of CONTACT
    liquid: NDArray[Any]  # (LANES,) of HYDRAULIC
    oils: NDArray[Any]  # (LANES, 2) of OIL
    maps: NDArray[np.float64]  # of all runs
    bearing: NDArray[Any]  # (0,): no lane has play in its main bearings
    bore: NDArray[Any]  # (0,)
    bore_oil: NDArray[Any]  # (0,)
    flex: NDArray[Any]  # (0,): no lane has elastic rods
    work: Work
    chambers: NDArray[np.float64]  # (LANES, 8)
    forces: NDArray[np.float64]  # (1, 1 + n_throws * len(FORCES)): of one step
    counts: NDArray[np.int64]  # (LANES, 5): but for vapour, in the lane of the first throw
    peak: NDArray[np.float64]  # (LANES, 1): in the lane of the first throw


STRETCH = 64
"""Steps that are taken at once: what they leave fits a processor's second cache."""

# one step more, or the columns would lie where the processor confuses them, multiples of 4096
LEFT = np.dtype(
    [
        ("turns", "f8", (2, STRETCH + 1, LANES)),  # angle and speed at the ends of the steps
        ("forces", "f8", (len(LANE_FORCES) + 2, STRETCH + 1, LANES)),  # the valves' last
        ("chambers", "f8", (len(GATHERED), STRETCH + 1, LANES)),
        ("gaps", "f8", (2, STRETCH + 1, LANES)),  # of the films, and what their peaks carry
    ]
)
"""What a stretch of steps leaves behind; one record, as ``STATE`` is."""


class Stretch(NamedTuple):
    """What a stretch of steps leaves behind, and how it ended."""

    left: NDArray[Any]  # (1,) of LEFT
    code: NDArray[np.int64]  # (LANES,): of the first step that failed
    done: NDArray[np.int64]  # (LANES,): steps up to it


@kernel
def _tables_of(lane: int, p: Any, a: Any) -> Any:
    """Of the record whose first throw is in a lane."""
    own = slice(lane, lane + p.throws)
    return Tables(
        a.throws[own],
        a.contacts[own],
        a.liquid[own],
        a.oils[own],
        a.maps,
        a.bearing,
        a.bore,
        a.bore_oil,
        a.flex,
        machine_of_lane(p, lane),
    )


@kernel
def _to_record(lane: int, s: Any, w: Any) -> None:
    """Copy a record's step into the march of one: its beginning into row 0, its end into 1."""
    w.crank[0, 0], w.crank[0, 1] = s.x0[CRANK, lane], s.v0[CRANK, lane]
    w.crank[0, 2], w.crank[0, 3], w.crank[0, 4] = s.v0[CRANK, lane], s.a0[CRANK, lane], 0.0
    w.crank[1, 0], w.crank[1, 1] = s.x[CRANK, lane], s.v[CRANK, lane]
    w.crank[1, 2], w.crank[1, 3] = s.v[CRANK, lane], s.a[CRANK, lane]
    for k in range(w.held.shape[0]):
        _throw_to_record(lane + k, k, s, w)


@kernel
def _throw_to_record(lane: int, k: int, s: Any, w: Any) -> None:
    b, one = w.stage[0, k], w.held[k]
    for c in range(len(PLACES)):
        b.y[c], b.y[len(PLACES) + c] = s.x0[PLACES[c], lane], s.v0[PLACES[c], lane]
        b.rate[c], b.rate[len(PLACES) + c] = s.v0[PLACES[c], lane], s.a0[PLACES[c], lane]
    end = w.stage[1, k]  # of the step as it was tried
    for c in range(len(PLACES)):
        end.y[c], end.y[len(PLACES) + c] = s.x[PLACES[c], lane], s.v[PLACES[c], lane]
        end.rate[c], end.rate[len(PLACES) + c] = s.v[PLACES[c], lane], s.a[PLACES[c], lane]
    for n in range(len(LANE_FORCES)):
        b.force[_FORCE[n]] = s.force0[n, lane]
    for j in range(CONTACTS):
        b.margin[j], b.approach[j] = s.margin0[j, lane], s.approach0[j, lane]
        end.margin[j] = s.margin[j, lane]
        one.touching[j], one.impact[j] = int(s.touching[j, lane]), s.impact[j, lane]
    for c in range(2):
        b.film[c], b.film_rate[c] = s.film0[c, lane], s.film_rate0[c, lane]
        one.squeeze[0, c] = s.squeeze[c, lane]
    b.normal = s.normal0[lane]
    one.pressure[0], one.pressure[1] = s.pressure0[0, lane], s.pressure0[1, lane]


@kernel
def _from_record(lane: int, s: Any, w: Any, i: int) -> None:
    """Copy row i of the march of one record into its lanes, as the stage looked at last."""
    for k in range(w.held.shape[0]):
        s.x[CRANK, lane + k], s.v[CRANK, lane + k] = w.crank[i, 0], w.crank[i, 1]
        s.a[CRANK, lane + k] = w.crank[i, 3]
        _throw_from_record(lane + k, k, s, w, i)


@kernel
def _throw_from_record(lane: int, k: int, s: Any, w: Any, i: int) -> None:
    b, one = w.stage[i, k], w.held[k]
    for c in range(len(PLACES)):
        s.x[PLACES[c], lane], s.v[PLACES[c], lane] = b.y[c], b.y[len(PLACES) + c]
        s.a[PLACES[c], lane] = b.rate[len(PLACES) + c]
    for n in range(len(LANE_FORCES)):
        s.force[n, lane] = b.force[_FORCE[n]]
    for j in range(CONTACTS):
        s.margin[j, lane], s.approach[j, lane] = b.margin[j], b.approach[j]
        s.touching[j, lane], s.impact[j, lane] = float(one.touching[j]), one.impact[j]
    for c in range(2):
        s.film[c, lane], s.film_rate[c, lane] = b.film[c], b.film_rate[c]
        s.squeeze[c, lane] = one.squeeze[0, c]
    s.normal[lane] = b.normal
    s.pressure[0, lane], s.pressure[1, lane] = one.pressure[0], one.pressure[1]


_FORCE = tuple(FORCES.index(name) for name in LANE_FORCES)


@subroutine
def _step_alone(lane: int, p: Any, s: Any, a: Any, left: Any, step: int, breathing: bool) -> None:
    """Take a step of one record by the march of one, which cuts it at its contacts.

    It begins with what lanes have tried, but for chambers: theirs ended under the pressure found.
    """
    w, h, t = a.work, p.step[lane], _tables_of(lane, p, a)
    for row in range(1, 5):  # another record may have touched where this one cannot
        for k in range(p.throws):
            for j in range(CONTACTS):
                w.stage[row, k].margin[j] = NO_CHANGE
    if breathing:  # of films too the search begins where it began
        for k in range(p.throws):
            for c in range(2):
                s.squeeze[c, lane + k] = s.squeeze0[c, lane + k]
    _to_record(lane, s, w)
    tally = Tally(a.counts[lane], a.peak[lane])
    for c in range(a.forces.shape[1]):
        a.forces[0, c] = 0.0
    end, fresh = step_of_record(w, 0, h, True, not breathing, t, a.forces, 0, tally)
    for k in range(p.throws):  # as the end of the step found them
        s.gap[lane + k], s.carried[lane + k] = w.stage[end, k].gaps[0], w.stage[end, k].gaps[2]
    if not fresh and not breathing:  # chambers are stepped first
        derivative_of_record(w, end, 0.0, t)
    _from_record(lane, s, w, end)
    for k in range(p.throws):
        for c in range(len(LANE_FORCES)):
            left.forces[c, step, lane + k] = a.forces[0, 1 + len(FORCES) * k + _FORCE[c]]
        beyond = w.stage[end, k].overlap > OVERLAP_LIMIT
        s.bad[lane + k] = _failed(s, beyond, lane + k)


@subroutine
def enter_lane(lane: int, p: Any, s: Any, a: Any, oiled: bool) -> None:
    """Begin a record in lanes from this one on: contacts closed from the start, and chambers."""
    w, t = a.work, _tables_of(lane, p, a)
    _to_record(lane, s, w)
    begin(w, t, a.chambers[lane : lane + p.throws])
    for k in range(p.throws):
        for j in range(CONTACTS):
            s.margin0[j, lane + k] = NO_CHANGE
        for c in range(5):
            a.counts[lane + k, c] = 0
        a.peak[lane + k, 0] = 0.0
    for _ in range(2 if oiled else 1):  # as the march of one does, which keeps the first films
        derivative_of_record(w, 0, 0.0, t)
    _from_record(lane, s, w, 0)
    for k in range(p.throws):
        enter_chamber(lane + k, p, s, a)


# Rows within lanes, though lanes lie side by side: the compiler lays the outer loop into vectors,
# and would unroll an inner one of so few turns instead.


@kernel
def _begin(p: Any, s: Any, first: int, rows: int) -> None:
    """Keep where the step begins; its first rates lead to the second stage."""
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
    """Keep where the step begins; its first rates lead to the second stage."""
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
    """State at the end of step n, and the mean forces over it."""
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


@kernel
def _failed(s: Any, beyond: bool, lane: int) -> float:
    """Status code of the end of a step, as the march of one record judges it."""
    x, v = s.x, s.v
    total = x[0, lane] + x[1, lane] + x[2, lane] + x[3, lane] + x[4, lane] + x[5, lane] + x[6, lane]
    total += v[0, lane] + v[1, lane] + v[2, lane] + v[3, lane] + v[4, lane] + v[5, lane]
    total += v[6, lane]
    lost = 0.0 if total - total == 0.0 else 1.0
    turned = 3.0 if abs(x[BETA, lane]) > 1.5 else lost  # rad
    return 2.0 if beyond else turned


@subroutine
def _judge(p: Any, s: Any) -> int:
    """Which lanes ask for a cut, and which have failed; how many of either."""
    m, found = s.margin, 0
    for lane in range(LANES):
        least = min(
            min(min(m[0, lane], m[1, lane]), min(m[2, lane], m[3, lane])),
            min(m[4, lane], m[5, lane]),
        )
        s.asks[lane] = 1.0 if least < 0.0 else 0.0
    if p.throws > 1:
        _ask_together(p, s)
    for lane in range(LANES):
        # what a step that is cut would have come to is no force of the run
        s.peak[lane] = max(s.peak[lane], 0.0 if s.asks[lane] != 0.0 else s.high[lane])
        failed = _failed(s, beyond_limit(p, s, lane), lane)
        s.bad[lane] = _CHOKED if s.choked[lane] != 0.0 else failed
    for lane in range(LANES):
        found += s.asks[lane] != 0.0 or s.bad[lane] != 0.0
    return found


@kernel
def _ask_together(p: Any, s: Any) -> None:
    """A contact of one throw cuts the step of all throws of its record."""
    n = p.throws
    for first in range(0, LANES - n + 1, n):
        asks = 0.0
        for lane in range(first, first + n):
            asks = max(asks, s.asks[lane])
        for lane in range(first, first + n):
            s.asks[lane] = asks


@subroutine
def _mend(breathing: bool, p: Any, s: Any, a: Any, k: Any, step: int) -> int:
    """Take the step again in the records that ask for it; leave those behind that fail in it.

    Returns how many have taken it again.
    """
    again, n = 0, p.throws
    for first in range(0, LANES - n + 1, n):
        if k.code[first] != 0:
            continue
        if s.asks[first] != 0.0:
            again += 1
            _step_alone(first, p, s, a, k.left[0], step, breathing)
            for lane in range(first, first + n if breathing else first):
                breathe_alone(lane, p, s, a)
                s.bad[lane] = _CHOKED if s.choked[lane] != 0.0 else s.bad[lane]
        code = _code_of_record(first, n, s)
        if code != 0:
            for lane in range(first, first + n):
                k.code[lane], k.done[lane] = code, step + 1
    return again


@kernel
def _code_of_record(first: int, n: int, s: Any) -> int:
    """Status code of all throws, as the march of one record judges: chambers first, then bodies."""
    code = 0
    for lane in range(first, first + n):
        own = int(s.bad[lane])
        if own == int(_CHOKED):
            return own
        if code <= _LOST:  # the first throw that is beyond its limits
            code = max(code, own)
    return code


_LOST, _CHOKED = 1, 4.0  # status codes of a state that is no number, and of a failed chamber


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
    """Take n steps of all lanes, of one kind.

    Chambers are stepped before the rates at the end of a step are made, which so feel the pressure
    that is found, not the extrapolated one. What asks for a cut does not depend on it, nor on what
    a casing that yields does to the bearings: with one the accelerations wait for that.
    """
    across, breathing = kind.guide, kind.breathing
    left, oiled = k.left[0], kind.oil != DRY
    for step in range(n):
        _to_second_stage(p, s, kind)
        rates(p, s, 0.5, kind, a.maps)
        _to_third_stage(p, s, across, oiled)
        rates(p, s, 0.5, kind, a.maps)
        _to_last_stage(p, s, across, oiled)
        rates(p, s, 1.0, kind, a.maps)
        _to_end(p, s, left, step, across, oiled)
        with_care = lanes_breathe(p, s, a, k.code) if breathing else 0
        loads(p, s, 0.0, kind, a.maps)
        found = _judge(p, s)
        if found > 0 or not kind.yields:
            accelerate(p, s)
        if found > 0:
            again = _mend(breathing, p, s, a, k, step)
            if breathing:
                with_care += again
            if again > 0 and (breathing or kind.yields) and not oiled:
                loads(p, s, 0.0, kind, a.maps)
                accelerate(p, s)
        if oiled:
            _keep_gaps(s, left, step)
            if breathing:  # the march of one seeks its films anew under the pressure that it found
                rates(p, s, 0.0, kind, a.maps)
        if breathing:
            _keep_chambers(p, s, left, step)
            if with_care > 0:
                count_vapour(s, a)
        _keep_turns(s, left, step)
        if kind.yields:
            move_bearings(p, s, m, left, step)
            accelerate(p, s)


def alone(t: Tables, maps: NDArray[np.float64]) -> Alone:
    """Room for the march of one record, with the throws of these tables; maps of all."""
    n = len(t.throws)
    return Alone(
        throws=np.zeros(LANES, t.throws.dtype),
        contacts=np.zeros((LANES, 3), t.contacts.dtype),
        liquid=np.zeros(LANES, t.liquid.dtype),
        oils=np.zeros((LANES, 2), t.oils.dtype),
        maps=maps,
        bearing=np.zeros(0, MAIN_BEARING),
        bore=np.zeros(0, t.contacts.dtype),
        bore_oil=np.zeros(0, t.oils.dtype),
        flex=np.zeros(0, ROD_MODES),
        work=scratch(n),
        chambers=np.zeros((LANES, 8)),
        forces=np.zeros((1, 1 + n * len(FORCES))),
        counts=np.zeros((LANES, 5), np.int64),
        peak=np.zeros((LANES, 1)),
    )
