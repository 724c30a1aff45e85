"""Steps of a single record out of its lanes, by the march of one."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel, subroutine
from ..mechanism.crank_step import step_of_record
from ..mechanism.equations import derivative_of_record
from ..mechanism.layout import (
    CONTACTS,
    FORCES,
    MAIN_BEARING,
    NO_CHANGE,
    OVERLAP_LIMIT,
    ROD_MODES,
    Tables,
    Work,
    scratch,
)
from ..mechanism.march import Tally, begin
from .chambers import enter_chamber
from .lane_layout import BETA, CRANK, LANE_FORCES, LANES, PLACES
from .rates import machine_of_lane


class Alone(NamedTuple):
    """Tables and scratch memory of the march of one record, by lane."""

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
    counts: NDArray[np.int64]  # (LANES, 5): except vapour, in the lane of the first throw
    peak: NDArray[np.float64]  # (LANES, 1): in the lane of the first throw


def alone(t: Tables, maps: NDArray[np.float64]) -> Alone:
    """Allocate the march of one record, with the throws of these tables and the maps of all."""
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


@kernel
def _tables_of(lane: int, p: Any, a: Any) -> Any:
    """Tables of the record whose first throw is in a lane."""
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
    """Copy a record's step into the march of one: its start into row 0, its end into row 1."""
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
    end = w.stage[1, k]  # of the trial step
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
    """Copy row i of the march of one record into its lanes, as their current stage."""
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
def step_alone(lane: int, p: Any, s: Any, a: Any, left: Any, step: int, chambered: bool) -> None:
    """Take a step of one record by the march of one, which cuts it at contact changes.

    It starts from the trial step of the lanes, except for chambers, which used another pressure.
    """
    w, h, t = a.work, p.step[lane], _tables_of(lane, p, a)
    for row in range(1, 5):  # another record may have left values that this one does not set
        for k in range(p.throws):
            for j in range(CONTACTS):
                w.stage[row, k].margin[j] = NO_CHANGE
    if chambered:  # the films' search starts from the same point too
        for k in range(p.throws):
            for c in range(2):
                s.squeeze[c, lane + k] = s.squeeze0[c, lane + k]
    _to_record(lane, s, w)
    tally = Tally(a.counts[lane], a.peak[lane])
    for c in range(a.forces.shape[1]):
        a.forces[0, c] = 0.0
    end, fresh = step_of_record(w, 0, h, True, not chambered, t, a.forces, 0, tally)
    for k in range(p.throws):  # as found at the end of the step
        s.gap[lane + k], s.carried[lane + k] = w.stage[end, k].gaps[0], w.stage[end, k].gaps[2]
    if not fresh and not chambered:  # chambers are stepped first
        derivative_of_record(w, end, 0.0, t)
    _from_record(lane, s, w, end)
    for k in range(p.throws):
        for c in range(len(LANE_FORCES)):
            left.forces[c, step, lane + k] = a.forces[0, 1 + len(FORCES) * k + _FORCE[c]]
        beyond = w.stage[end, k].overlap > OVERLAP_LIMIT
        s.bad[lane + k] = failed(s, beyond, lane + k)


@subroutine
def enter_lane(lane: int, p: Any, s: Any, a: Any, oiled: bool) -> None:
    """Start a record in lanes from this one on: initial contacts and chambers."""
    w, t = a.work, _tables_of(lane, p, a)
    _to_record(lane, s, w)
    begin(w, t, a.chambers[lane : lane + p.throws])
    for k in range(p.throws):
        for j in range(CONTACTS):
            s.margin0[j, lane + k] = NO_CHANGE
        for c in range(5):
            a.counts[lane + k, c] = 0
        a.peak[lane + k, 0] = 0.0
    for _ in range(2 if oiled else 1):  # as in the march of one, which keeps the first films
        derivative_of_record(w, 0, 0.0, t)
    _from_record(lane, s, w, 0)
    for k in range(p.throws):
        enter_chamber(lane + k, p, s, a)


@kernel
def failed(s: Any, beyond: bool, lane: int) -> float:
    """Status code of the end of a step, by the criteria of the march of one record."""
    x, v = s.x, s.v
    total = x[0, lane] + x[1, lane] + x[2, lane] + x[3, lane] + x[4, lane] + x[5, lane] + x[6, lane]
    total += v[0, lane] + v[1, lane] + v[2, lane] + v[3, lane] + v[4, lane] + v[5, lane]
    total += v[6, lane]
    lost = 0.0 if total - total == 0.0 else 1.0
    turned = 3.0 if abs(x[BETA, lane]) > 1.5 else lost  # rad
    return 2.0 if beyond else turned
