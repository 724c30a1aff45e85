"""Steps of all lanes: Runge-Kutta side by side; contacts and chambers a lane at a time."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel, subroutine
from ..pump.hydraulics import PRESSURE_CHAMBER
from ..pump.slider_crank import (
    CONTACTS,
    FORCES,
    HELD,
    NO_CHANGE,
    OVERLAP_LIMIT,
    PER_THROW,
    STAGE,
    WITH_VAPOUR,
    Tables,
    Tally,
    Work,
    begin,
    breathe,
    derivative_of_record,
    mean_of_stages,
    step_of_record,
)
from .rates import COORDINATES, FORCES_IN_LANES, LANES, machine_of_lane, rates


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


class Stretch(NamedTuple):
    """What a stretch of steps leaves behind."""

    turns: NDArray[np.float64]  # (n, 2, LANES): at the ends of the steps
    forces: NDArray[np.float64]  # (n, 1 + len(FORCES), LANES)
    chambers: NDArray[np.float64]  # (n, LANES, 8)
    code: NDArray[np.int64]  # (LANES,): of the first step that failed
    done: NDArray[np.int64]  # (LANES,): steps up to it


@kernel
def _tables_of(lane: int, p: Any, a: Any) -> Any:
    return Tables(
        a.throws[lane], a.contacts[lane], a.liquid[lane], a.oils, a.maps, machine_of_lane(p, lane)
    )


@kernel
def _to_record(lane: int, row: Any, held: Any, w: Any, i: int) -> None:
    """Copy a lane into row i of the march of one record."""
    b, one = w.stage[i, 0], w.held[0]
    for c in range(PER_THROW):
        b.y[c], b.rate[c] = row.y[c, lane], row.rate[c, lane]
    w.crank[i, 0], w.crank[i, 1] = row.y[12, lane], row.y[13, lane]
    w.crank[i, 2], w.crank[i, 3], w.crank[i, 4] = (
        row.rate[12, lane],
        row.rate[13, lane],
        row.force[7, lane],
    )
    for n in range(7):
        b.force[n] = row.force[n, lane]
    for j in range(CONTACTS):
        b.margin[j], b.approach[j] = row.margin[j, lane], row.approach[j, lane]
        one.touching[j], one.impact[j] = int(held.touching[j, lane]), held.impact[j, lane]
    b.normal, b.overlap = row.normal[lane], row.overlap[lane]
    one.pressure[0], one.pressure[1] = held.pressure[0, lane], held.pressure[1, lane]


@kernel
def _from_record(lane: int, row: Any, held: Any, w: Any, i: int) -> None:
    """Copy row i of the march of one record into a lane."""
    b, one = w.stage[i, 0], w.held[0]
    for c in range(PER_THROW):
        row.y[c, lane], row.rate[c, lane] = b.y[c], b.rate[c]
    row.y[12, lane], row.y[13, lane] = w.crank[i, 0], w.crank[i, 1]
    row.rate[12, lane], row.rate[13, lane], row.force[7, lane] = (
        w.crank[i, 2],
        w.crank[i, 3],
        w.crank[i, 4],
    )
    for n in range(7):
        row.force[n, lane] = b.force[n]
    for j in range(CONTACTS):
        row.margin[j, lane], row.approach[j, lane] = b.margin[j], b.approach[j]
        held.touching[j, lane], held.impact[j, lane] = float(one.touching[j]), one.impact[j]
    row.normal[lane], row.overlap[lane] = b.normal, b.overlap
    held.pressure[0, lane], held.pressure[1, lane] = one.pressure[0], one.pressure[1]


@subroutine
def _step_alone(lane: int, p: Any, rows: Any, i: int, held: Any, a: Any, k: Any, n: int) -> None:
    """Take step n of one lane by the march of one record, which cuts it at its contacts."""
    w, h, t = a.work, p.step[lane], _tables_of(lane, p, a)
    for row in range(1, 5):  # another lane may have touched where this one cannot
        for j in range(CONTACTS):
            w.stage[row, 0].margin[j] = NO_CHANGE
    _to_record(lane, rows[i], held, w, 0)
    for c in range(a.forces.shape[1]):
        a.forces[0, c] = 0.0
    end, fresh = step_of_record(w, 0, h, True, t, a.forces, 0, Tally(a.counts[lane], a.peak[lane]))
    if not fresh:
        derivative_of_record(w, end, 0.0, t)
    _from_record(lane, rows[1 - i], held, w, end)
    for c in range(a.forces.shape[1]):
        k.forces[n, c, lane] = a.forces[0, c]


@subroutine
def enter_lane(lane: int, p: Any, rows: Any, i: int, held: Any, a: Any) -> None:
    """Begin a record in a lane: contacts that are closed from the start, and its chamber."""
    w, t = a.work, _tables_of(lane, p, a)
    _to_record(lane, rows[i], held, w, 0)
    begin(w, t, a.chambers[lane])
    for row in range(5):
        _from_record(lane, rows[row], held, w, 0)
        for j in range(CONTACTS):
            rows[row].margin[j, lane] = NO_CHANGE
    for c in range(5):
        a.counts[lane, c] = 0
    a.peak[lane, 0] = 0.0


@subroutine
def _advance(rows: Any, to: int, start: int, share: float, slope: int, p: Any) -> None:
    here, before, rate = rows[to], rows[start], rows[slope]
    for c in range(COORDINATES):
        for lane in range(LANES):
            here.y[c, lane] = before.y[c, lane] + share * p.step[lane] * rate.rate[c, lane]


@subroutine
def _finish(rows: Any, i: int, p: Any, k: Any, n: int) -> None:
    """State at the end of the step from row i, and the mean forces over it."""
    end, first, second, third, last = rows[1 - i], rows[i], rows[2], rows[3], rows[4]
    for c in range(COORDINATES):
        for lane in range(LANES):
            mean = mean_of_stages(
                first.rate[c, lane], second.rate[c, lane], third.rate[c, lane], last.rate[c, lane]
            )
            end.y[c, lane] = first.y[c, lane] + p.step[lane] / 6.0 * mean
    for c in range(FORCES_IN_LANES):
        column = 0 if c == FORCES_IN_LANES - 1 else 1 + c
        for lane in range(LANES):
            h = p.step[lane]
            k.forces[n, column, lane] = (
                h
                / (6.0 * h)
                * mean_of_stages(
                    first.force[c, lane],
                    second.force[c, lane],
                    third.force[c, lane],
                    last.force[c, lane],
                )
            )


@kernel
def _failed(y: Any, overlap: Any, lane: int) -> float:
    """Status code of the end of a step, as the march of one record judges it."""
    total = y[12, lane] + y[13, lane]
    total += y[0, lane] + y[1, lane] + y[2, lane] + y[3, lane] + y[4, lane] + y[5, lane]
    total += y[6, lane] + y[7, lane] + y[8, lane] + y[9, lane] + y[10, lane] + y[11, lane]
    lost = 0.0 if total - total == 0.0 else 1.0
    turned = 3.0 if abs(y[2, lane]) > 1.5 else lost  # rad
    return 2.0 if overlap[lane] > OVERLAP_LIMIT else turned


@subroutine
def _judge(row: Any, held: Any) -> int:
    """Which lanes ask for a cut, and which have failed; how many of either."""
    m, found = row.margin, 0
    for lane in range(LANES):
        least = min(
            min(min(m[0, lane], m[1, lane]), min(m[2, lane], m[3, lane])),
            min(m[4, lane], m[5, lane]),
        )
        held.asks[lane] = 1.0 if least < 0.0 else 0.0
        held.bad[lane] = _failed(row.y, row.overlap, lane)
    for lane in range(LANES):
        found += held.asks[lane] != 0.0 or held.bad[lane] != 0.0
    return found


@subroutine
def _mend(p: Any, rows: Any, i: int, held: Any, a: Any, k: Any, step: int) -> None:
    """Take the step again in the lanes that ask for it; leave those behind that fail in it."""
    for lane in range(LANES):
        if k.code[lane] != 0:
            continue
        if held.asks[lane] != 0.0:
            _step_alone(lane, p, rows, i, held, a, k, step)
            held.bad[lane] = _failed(rows[1 - i].y, rows[1 - i].overlap, lane)
        if held.bad[lane] != 0.0:
            k.code[lane], k.done[lane] = int(held.bad[lane]), step + 1


@kernel
def _keep_peaks(rows: Any, i: int, a: Any) -> None:
    for lane in range(LANES):
        high = max(rows[i].normal[lane], max(rows[2].normal[lane], rows[3].normal[lane]))
        a.peak[lane, 0] = max(a.peak[lane, 0], high)


@subroutine
def _lanes_breathe(rows: Any, i: int, p: Any, held: Any, a: Any, k: Any, n: int) -> None:
    one = a.work.held[0]
    for lane in range(LANES):
        q = a.throws[lane, 0]
        if q.pressure_rung != PRESSURE_CHAMBER or k.code[lane] != 0:
            continue
        y, h = rows[i].y, p.step[lane]
        fault, before, after = breathe(
            a.chambers[lane, 0], one, a.liquid[lane, 0], h, y[3, lane], y[9, lane], q.substeps
        )
        if fault != 0:
            k.code[lane], k.done[lane] = 4, n + 1
        held.pressure[0, lane], held.pressure[1, lane] = before, after
        k.forces[n, 8, lane], k.forces[n, 9, lane] = one.flow[2] / h, one.flow[3] / h
        a.counts[lane, WITH_VAPOUR] += a.chambers[lane, 0, 1] > 0.0
        for c in range(8):
            k.chambers[n, lane, c] = a.chambers[lane, 0, c]


@subroutine
def march(
    play: bool,
    breathing: bool,
    n: int,
    p: Any,
    rows: Any,
    i: int,
    held: Any,
    a: Any,
    k: Any,
) -> int:
    """Take n steps of all lanes, of one kind, from row i; the row in which they end."""
    fresh = False
    for step in range(n):
        if not fresh:
            rates(p, rows[i], held, 0.0, play)
        _advance(rows, 2, i, 0.5, i, p)
        rates(p, rows[2], held, 0.5, play)
        _advance(rows, 3, i, 0.5, 2, p)
        rates(p, rows[3], held, 0.5, play)
        _advance(rows, 4, i, 1.0, 3, p)
        rates(p, rows[4], held, 1.0, play)
        _finish(rows, i, p, k, step)
        rates(p, rows[1 - i], held, 1.0, play)
        _keep_peaks(rows, i, a)
        if _judge(rows[1 - i], held) > 0:
            _mend(p, rows, i, held, a, k, step)
        i = 1 - i
        fresh = not breathing
        if breathing:
            _lanes_breathe(rows, i, p, held, a, k, step)
        for lane in range(LANES):
            k.turns[step, 0, lane], k.turns[step, 1, lane] = (
                rows[i].y[12, lane],
                rows[i].y[13, lane],
            )
    return i


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
