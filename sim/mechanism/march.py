"""March over the steps: mechanism, chambers, lines and a yielding casing in turn."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.chamber import chamber_step
from ..hydraulics.parameters import PRESSURE_CHAMBER
from ..jit import kernel, subroutine
from ..piping.coupling import begin_pair, seek_pair
from ..piping.pipe import advance_pipe
from .crank_step import contact_margin, step_of_record
from .equations import derivative_of_record
from .layout import (
    ANGLE,
    BETA,
    CONTACTS,
    CRANKPIN,
    FLEX,
    FORCES,
    GAPS,
    IN_TENSION,
    JOINT_COMPLIANT,
    NO_CHANGE,
    OVERLAP_LIMIT,
    PER_THROW,
    PISTON_X,
    PISTON_X_RATE,
    SPEED,
    VALVE_FORCES,
    WITH_VAPOUR,
    WRISTPIN,
)
from .main_bearing import journal_margin
from .moving_bearing import on_moving_bearing


@kernel
def step_chamber(
    chamber: Any, held: Any, liquid: Any, h: float, x: float, v: float, substeps: int
) -> Any:
    """Step one chamber along its piston's path; return fault and pressures of the next step.

    That pressure [Pa] is extrapolated: the mechanism steps first.
    """
    last = chamber[0]
    fault = chamber_step(chamber, held.flow, liquid, h, chamber[6], chamber[7], x, v, substeps)
    chamber[6], chamber[7] = x, v
    return fault, chamber[0], 2.0 * chamber[0] - last


@kernel
def _step_chambers(w: Any, i: int, h: float, t: Any, chamber: Any, forces: Any, step: int) -> int:
    """Step every chamber along its piston's path; set its pressure for the next step."""
    fault = 0
    for k in range(t.throws.shape[0]):
        q, b, held = t.throws[k], w.stage[i, k], w.held[k]
        if q.pressure_rung != PRESSURE_CHAMBER:
            continue
        x, v = b.y[PISTON_X], b.y[PISTON_X_RATE]
        own, before, after = step_chamber(chamber[k], held, t.liquid[k], h, x, v, q.substeps)
        fault += own
        held.pressure[0], held.pressure[1] = before, after
        f = 1 + len(FORCES) * k
        forces[step, f + VALVE_FORCES] = held.flow[2] / h
        forces[step, f + VALVE_FORCES + 1] = held.flow[3] / h
    return fault


@kernel
def _try_chambers(w: Any, i: int, h: float, t: Any, chamber: Any, shared: Any) -> Any:
    """Step every chamber at the lines' trial pressures; return fault, and both volumes.

    The trials hold the result; volumes [m^3] as in ``CHAMBER_FLOWS``, summed over the throws.
    """
    fault, suction, discharge = 0, 0.0, 0.0
    for k in range(t.throws.shape[0]):
        b, liquid, trial, flow = w.stage[i, k], t.liquid[k], shared.trials[k], w.held[k].flow
        liquid.suction = shared.pairs[0].pressure[0]
        liquid.discharge = shared.pairs[0].pressure[1]
        for c in range(6):
            trial[c] = chamber[k, c]
        x, v, substeps = b.y[PISTON_X], b.y[PISTON_X_RATE], t.throws[k].substeps
        fault += chamber_step(trial, flow, liquid, h, chamber[k, 6], chamber[k, 7], x, v, substeps)
        suction += flow[0]
        discharge += flow[1]
    return fault, suction, discharge


@subroutine
def _step_chambers_and_lines(
    w: Any, i: int, h: float, t: Any, chamber: Any, shared: Any, forces: Any, step: int
) -> int:
    """Step all chambers and both lines together; set the pressures for the next step."""
    lines, pair = shared.lines, shared.pairs[0]
    pipes, states = lines.pipes, lines.states
    nodes = (lines.suction_nodes, lines.discharge_nodes)
    begin_pair(pair, pipes, states)
    fault, drawn, pushed, found = 0, 0.0, 0.0, False
    while not found and fault == 0:
        fault, drawn, pushed = _try_chambers(w, i, h, t, chamber, shared)
        found = seek_pair(pair, drawn / h, -pushed / h, pipes, states, nodes, h)
    advance_pipe(pair.pressure[0], drawn / h, pipes[0], states[0], nodes[0], h)
    advance_pipe(pair.pressure[1], -pushed / h, pipes[1], states[1], nodes[1], h)
    for k in range(t.throws.shape[0]):
        held, b, f = w.held[k], w.stage[i, k], 1 + len(FORCES) * k
        last, now = chamber[k, 0], shared.trials[k, 0]
        held.pressure[0], held.pressure[1] = now, 2.0 * now - last
        for c in range(6):
            chamber[k, c] = shared.trials[k, c]
        chamber[k, 6], chamber[k, 7] = b.y[PISTON_X], b.y[PISTON_X_RATE]
        forces[step, f + VALVE_FORCES] = held.flow[2] / h
        forces[step, f + VALVE_FORCES + 1] = held.flow[3] / h
    return fault


@kernel
def _fault(w: Any, i: int) -> int:
    total = w.crank[i, ANGLE] + w.crank[i, SPEED]
    for k in range(w.stage.shape[1]):
        b = w.stage[i, k]
        for c in range(PER_THROW):
            total += b.y[c]
        if b.overlap > OVERLAP_LIMIT:
            return 2
        if abs(b.y[BETA]) > 1.5:  # rad
            return 3
    for n in range(w.journal.shape[1]):
        journal = w.journal[i, n]
        for c in range(4):
            total += journal.y[c]
        if journal.overlap > OVERLAP_LIMIT:
            return 2
    for k in range(w.flex.shape[1]):
        for c in range(2 * len(FLEX)):
            total += w.flex[i, k].y[c]
    return 0 if math.isfinite(total) else 1


class MarchRecord(NamedTuple):
    """Record of a run; the last seven have one row if they are not needed."""

    turns: NDArray[np.float64]  # (n_steps + 1, 2): crank angle and speed
    forces: NDArray[np.float64]  # (n_steps, 1 + n_throws * len(FORCES))
    states: NDArray[np.float64]  # (n_steps + 1, n_throws, PER_THROW)
    chambers: NDArray[np.float64]  # (n_steps + 1, n_throws, 8)
    gaps: NDArray[np.float64]  # (n_steps + 1, n_throws, len(GAPS))
    ends: NDArray[np.float64]  # (n_steps + 1, 2): pressures of the lines at the pump
    journal: NDArray[np.float64]  # (n_steps + 1, 4): as JOURNAL's y
    bore_gaps: NDArray[np.float64]  # (n_steps + 1, 2): as JOURNAL's gaps
    flex: NDArray[np.float64]  # (n_steps + 1, n_throws, 4): as ROD_STATE's y


class Tally(NamedTuple):
    """Counts of a run, see :data:`CHANGES`."""

    counts: NDArray[np.int64]  # (5,)
    peak: NDArray[np.float64]  # (1,): largest normal force


@kernel
def _is_compliant(q: Any, j: int) -> Any:
    rung = q.crankpin_rung if j == CRANKPIN else q.wristpin_rung if j == WRISTPIN else q.guide_rung
    return rung == JOINT_COMPLIANT


@kernel
def begin(w: Any, t: Any, chamber: Any) -> bool:
    """Set the initial contacts and chambers; return whether there are chambers."""
    chambered = False
    for k in range(t.throws.shape[0]):
        q, b, held = t.throws[k], w.stage[0, k], w.held[k]
        chambered |= q.pressure_rung == PRESSURE_CHAMBER
        chamber[k, 6], chamber[k, 7] = b.y[PISTON_X], b.y[PISTON_X_RATE]
        held.pressure[0] = held.pressure[1] = chamber[k, 0]
        for j in range(CONTACTS):
            for row in range(5):
                w.stage[row, k].margin[j] = NO_CHANGE
            if _is_compliant(q, j):  # closed is what would close if it were open
                held.touching[j] = 1 if contact_margin(k, j, w, 0, t) < 0.0 else 0
    for n in range(w.journal.shape[1]):
        w.journal_held[n].touching = 1 if journal_margin(w, 0, t) < 0.0 else 0
    return chambered


@kernel
def _keep(w: Any, i: int, chamber: Any, states: Any, r: Any, row: int) -> None:
    for side in range(states.shape[0]):
        r.ends[row, side] = states[side].mean
    r.turns[row, 0], r.turns[row, 1] = w.crank[i, ANGLE], w.crank[i, SPEED]
    for k in range(chamber.shape[0]):
        if r.states.shape[0] > 1:
            for c in range(PER_THROW):
                r.states[row, k, c] = w.stage[i, k].y[c]
        if r.chambers.shape[0] > 1:
            for c in range(chamber.shape[1]):
                r.chambers[row, k, c] = chamber[k, c]
        if r.gaps.shape[0] > 1:
            for c in range(len(GAPS)):
                r.gaps[row, k, c] = w.stage[i, k].gaps[c]
    if r.journal.shape[0] > 1:
        for c in range(4):
            r.journal[row, c] = w.journal[i, 0].y[c]
    if r.bore_gaps.shape[0] > 1:
        for c in range(2):
            r.bore_gaps[row, c] = w.journal[i, 0].gaps[c]
    if r.flex.shape[0] > 1:
        for k in range(w.flex.shape[1]):
            for c in range(2 * len(FLEX)):
                r.flex[row, k, c] = w.flex[i, k].y[c]


@kernel
def integrate(
    h: float,
    t: Any,
    y: Any,
    moved: Any,
    felt: Any,
    w: Any,
    chamber: Any,
    shared: Any,
    r: Any,
    tally: Any,
) -> Any:
    """March from row 0 of the scratch; return status code and number of steps."""
    weight = (t.machine.gravity_x, t.machine.gravity_y)
    chambered = begin(w, t, chamber)
    i, fresh = 0, False
    # the films at the start are those of its derivative
    if r.gaps.shape[0] > 1 or r.bore_gaps.shape[0] > 1:
        derivative_of_record(w, i, 0.0, t)
    lines = shared.lines
    _keep(w, i, chamber, lines.states, r, 0)
    for step in range(r.forces.shape[0]):
        i, fresh = step_of_record(w, i, h, fresh, False, t, r.forces, step, tally)
        code = _fault(w, i)
        if chambered:
            if lines.pipes.shape[0] > 0:
                choked = _step_chambers_and_lines(w, i, h, t, chamber, shared, r.forces, step)
            else:
                choked = _step_chambers(w, i, h, t, chamber, r.forces, step)
            if choked != 0:
                code = 4
            fresh = False  # the step used an extrapolated pressure, which is known better now
        for k in range(t.throws.shape[0]):
            tally.counts[IN_TENSION] += w.stage[i, k].link < 0.0
            tally.counts[WITH_VAPOUR] += chamber[k, 1] > 0.0
        if y.react.shape[0] > 0:
            t = on_moving_bearing(y, moved, felt, r.forces, step, h, weight, t)
            fresh = False
        _keep(w, i, chamber, lines.states, r, step + 1)
        if code != 0:
            return code, step + 1
    return 0, r.forces.shape[0]
