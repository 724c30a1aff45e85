"""Steps of all lanes side by side; those in which a contact changes, a lane at a time."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel, subroutine
from ..pump.hydraulics import GATHERED
from ..pump.slider_crank import (
    CONTACTS,
    FORCES,
    GUIDE,
    HELD,
    NO_CHANGE,
    OVERLAP_LIMIT,
    STAGE,
    Tables,
    Tally,
    Work,
    begin,
    derivative_of_record,
    mean_of_stages,
    step_of_record,
)
from .chambers import breathe_alone, count_vapour, enter_chamber, lanes_breathe
from .rates import (
    ALL_MOVING,
    BETA,
    CRANK,
    LANE_FORCES,
    LANES,
    MOVING,
    PLACES,
    beyond_limit,
    machine_of_lane,
    rates,
)


class Alone(NamedTuple):
    """What the march of one record is told and works on, by lane."""

    throws: NDArray[Any]  # (LANES, 1) of THROW
    contacts: NDArray[Any]  # (LANES, 1, 3) of CONTACT
    liquid: NDArray[Any]  # (LANES, 1) of HYDRAULIC
    oils: NDArray[Any]  # (1, 2) of OIL, of no lane
    maps: NDArray[np.float64]
    work: Work
    chambers: NDArray[np.float64]  # (LANES, 1, 8)
    forces: NDArray[np.float64]  # (1, 1 + len(FORCES)): of one step
    counts: NDArray[np.int64]  # (LANES, 5)
    peak: NDArray[np.float64]  # (LANES, 1)


STRETCH = 64
"""Steps that are taken at once: what they leave fits a processor's second cache."""

# one step more, or the columns would lie where the processor confuses them, multiples of 4096
LEFT = np.dtype(
    [
        ("turns", "f8", (2, STRETCH + 1, LANES)),  # angle and speed at the ends of the steps
        ("forces", "f8", (len(LANE_FORCES) + 2, STRETCH + 1, LANES)),  # the valves' last
        ("chambers", "f8", (len(GATHERED), STRETCH + 1, LANES)),
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
    return Tables(
        a.throws[lane], a.contacts[lane], a.liquid[lane], a.oils, a.maps, machine_of_lane(p, lane)
    )


@kernel
def _to_record(lane: int, s: Any, w: Any) -> None:
    """Copy a lane's step into the march of one record: its beginning into row 0, its end into 1."""
    b, one = w.stage[0, 0], w.held[0]
    for c in range(len(PLACES)):
        b.y[c], b.y[len(PLACES) + c] = s.x0[PLACES[c], lane], s.v0[PLACES[c], lane]
        b.rate[c], b.rate[len(PLACES) + c] = s.v0[PLACES[c], lane], s.a0[PLACES[c], lane]
    w.crank[0, 0], w.crank[0, 1] = s.x0[CRANK, lane], s.v0[CRANK, lane]
    w.crank[0, 2], w.crank[0, 3], w.crank[0, 4] = s.v0[CRANK, lane], s.a0[CRANK, lane], 0.0
    end = w.stage[1, 0]  # of the step as it was tried
    for c in range(len(PLACES)):
        end.y[c], end.y[len(PLACES) + c] = s.x[PLACES[c], lane], s.v[PLACES[c], lane]
        end.rate[c], end.rate[len(PLACES) + c] = s.v[PLACES[c], lane], s.a[PLACES[c], lane]
    w.crank[1, 0], w.crank[1, 1] = s.x[CRANK, lane], s.v[CRANK, lane]
    w.crank[1, 2], w.crank[1, 3] = s.v[CRANK, lane], s.a[CRANK, lane]
    for n in range(len(LANE_FORCES)):
        b.force[_FORCE[n]] = s.force0[n, lane]
    for j in range(CONTACTS):
        b.margin[j], b.approach[j] = s.margin0[j, lane], s.approach0[j, lane]
        end.margin[j] = s.margin[j, lane]
        one.touching[j], one.impact[j] = int(s.touching[j, lane]), s.impact[j, lane]
    b.normal = s.normal0[lane]
    one.pressure[0], one.pressure[1] = s.pressure0[0, lane], s.pressure0[1, lane]


@kernel
def _from_record(lane: int, s: Any, w: Any, i: int) -> None:
    """Copy row i of the march of one record into a lane, as the stage looked at last."""
    b, one = w.stage[i, 0], w.held[0]
    for c in range(len(PLACES)):
        s.x[PLACES[c], lane], s.v[PLACES[c], lane] = b.y[c], b.y[len(PLACES) + c]
        s.a[PLACES[c], lane] = b.rate[len(PLACES) + c]
    s.x[CRANK, lane], s.v[CRANK, lane] = w.crank[i, 0], w.crank[i, 1]
    s.a[CRANK, lane] = w.crank[i, 3]
    for n in range(len(LANE_FORCES)):
        s.force[n, lane] = b.force[_FORCE[n]]
    for j in range(CONTACTS):
        s.margin[j, lane], s.approach[j, lane] = b.margin[j], b.approach[j]
        s.touching[j, lane], s.impact[j, lane] = float(one.touching[j]), one.impact[j]
    s.normal[lane] = b.normal
    s.pressure[0, lane], s.pressure[1, lane] = one.pressure[0], one.pressure[1]


_FORCE = tuple(FORCES.index(name) for name in LANE_FORCES)


@subroutine
def _step_alone(lane: int, p: Any, s: Any, a: Any, k: Any, n: int, breathing: bool) -> bool:
    """Take step n of one lane by the march of one record, which cuts it at its contacts.

    It begins with what lanes have tried, but for chambers: theirs ended under the pressure found.
    Returns whether a contact is beyond its law at the end.
    """
    w, h, t, left = a.work, p.step[lane], _tables_of(lane, p, a), k.left[0]
    for row in range(1, 5):  # another lane may have touched where this one cannot
        for j in range(CONTACTS):
            w.stage[row, 0].margin[j] = NO_CHANGE
    _to_record(lane, s, w)
    tally = Tally(a.counts[lane], a.peak[lane])
    for c in range(a.forces.shape[1]):
        a.forces[0, c] = 0.0
    end, fresh = step_of_record(w, 0, h, True, not breathing, t, a.forces, 0, tally)
    if not fresh:
        derivative_of_record(w, end, 0.0, t)
    _from_record(lane, s, w, end)
    for c in range(len(LANE_FORCES)):
        left.forces[c, n, lane] = a.forces[0, 1 + _FORCE[c]]
    beyond: bool = w.stage[end, 0].overlap > OVERLAP_LIMIT
    return beyond


@subroutine
def enter_lane(lane: int, p: Any, s: Any, a: Any) -> None:
    """Begin a record in a lane: contacts that are closed from the start, and its chamber."""
    w, t = a.work, _tables_of(lane, p, a)
    _to_record(lane, s, w)
    begin(w, t, a.chambers[lane])
    for j in range(CONTACTS):
        w.stage[0, 0].margin[j] = s.margin0[j, lane] = NO_CHANGE
    _from_record(lane, s, w, 0)
    enter_chamber(lane, p, s, a)
    for c in range(5):
        a.counts[lane, c] = 0
    a.peak[lane, 0] = 0.0


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


@subroutine
def _to_second_stage(p: Any, s: Any, kind: Any) -> None:
    """Keep where the step begins; its first rates lead to the second stage."""
    wrist, guide, _ = kind
    _begin(p, s, 0, MOVING)
    _keep_contacts(s, 0, 1)
    if wrist:
        _keep_contacts(s, 1, GUIDE)
    if guide:
        _begin(p, s, MOVING, ALL_MOVING)
        _keep_contacts(s, GUIDE, CONTACTS)
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
def _to_third_stage(p: Any, s: Any, across: bool) -> None:
    _to_third(p, s, 0, MOVING)
    if across:
        _to_third(p, s, MOVING, ALL_MOVING)
    for lane in range(LANES):
        for c in range(len(LANE_FORCES)):
            s.middle_force[c, lane] = s.force[c, lane]
        s.high[lane] = max(s.normal0[lane], s.normal[lane])


@subroutine
def _to_last_stage(p: Any, s: Any, across: bool) -> None:
    _to_last(p, s, 0, MOVING)
    if across:
        _to_last(p, s, MOVING, ALL_MOVING)
    for lane in range(LANES):
        for c in range(len(LANE_FORCES)):
            s.middle_force[c, lane] += s.force[c, lane]
        s.high[lane] = max(s.high[lane], s.normal[lane])


@subroutine
def _to_end(p: Any, s: Any, left: Any, n: int, across: bool) -> None:
    """State at the end of step n, and the mean forces over it."""
    _end(p, s, 0, MOVING)
    if across:
        _end(p, s, MOVING, ALL_MOVING)
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
        # what a step that is cut would have come to is no force of the run
        s.peak[lane] = max(s.peak[lane], 0.0 if least < 0.0 else s.high[lane])
        failed = _failed(s, beyond_limit(p, s, lane), lane)
        s.bad[lane] = _CHOKED if s.choked[lane] != 0.0 else failed
    for lane in range(LANES):
        found += s.asks[lane] != 0.0 or s.bad[lane] != 0.0
    return found


@subroutine
def _mend(breathing: bool, p: Any, s: Any, a: Any, k: Any, step: int) -> int:
    """Take the step again in the lanes that ask for it; leave those behind that fail in it.

    Returns how many have taken it again.
    """
    again = 0
    for lane in range(LANES):
        if k.code[lane] != 0:
            continue
        if s.asks[lane] != 0.0:
            again += 1
            s.bad[lane] = _failed(s, _step_alone(lane, p, s, a, k, step, breathing), lane)
            if breathing:
                breathe_alone(lane, p, s, a)
                s.bad[lane] = _CHOKED if s.choked[lane] != 0.0 else s.bad[lane]
        if s.bad[lane] != 0.0:
            k.code[lane], k.done[lane] = int(s.bad[lane]), step + 1
    return again


_CHOKED = 4.0  # status code of a chamber that has failed


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
def march(kind: Any, n: int, p: Any, s: Any, a: Any, k: Any) -> None:
    """Take n steps of all lanes, of one kind.

    Chambers are stepped before the rates at the end of a step are made, which so feel the pressure
    that is found, not the extrapolated one. What asks for a cut does not depend on it.
    """
    _, across, breathing = kind
    left = k.left[0]
    rates(p, s, 0.0, kind)
    for step in range(n):
        _to_second_stage(p, s, kind)
        rates(p, s, 0.5, kind)
        _to_third_stage(p, s, across)
        rates(p, s, 0.5, kind)
        _to_last_stage(p, s, across)
        rates(p, s, 1.0, kind)
        _to_end(p, s, left, step, across)
        with_care = lanes_breathe(p, s, a, k.code) if breathing else 0
        rates(p, s, 0.0, kind)
        if _judge(p, s) > 0:
            again = _mend(breathing, p, s, a, k, step)
            if breathing and again > 0:
                with_care += again
                rates(p, s, 0.0, kind)
        if breathing:
            _keep_chambers(p, s, left, step)
            if with_care > 0:
                count_vapour(s, a)
        _keep_turns(s, left, step)


def alone(t: Tables) -> Alone:
    """Room for the march of one record, of a lane at a time."""
    return Alone(
        throws=np.zeros((LANES, 1), t.throws.dtype),
        contacts=np.zeros((LANES, 1, 3), t.contacts.dtype),
        liquid=np.zeros((LANES, 1), t.liquid.dtype),
        oils=t.oils[:1].copy(),
        maps=t.maps,
        work=Work(
            crank=np.zeros((5, 5)),
            stage=np.zeros((5, 1), STAGE),
            held=np.zeros(1, HELD),
            moment=np.zeros(2),
            matrix=np.zeros((4, 6)),
            place=np.zeros((4, 6)),
        ),
        chambers=np.zeros((LANES, 1, 8)),
        forces=np.zeros((1, 1 + len(FORCES))),
        counts=np.zeros((LANES, 5), np.int64),
        peak=np.zeros((LANES, 1)),
    )
