"""Chambers with valves of all lanes: vectorised steps, and single ones where those fail."""

from typing import Any

from ..hydraulics.chamber import chamber_at_once, implicit_part
from ..hydraulics.liquid import air_volume
from ..hydraulics.valves import ValveSide, valve_shares
from ..jit import kernel, subroutine
from ..mechanism.layout import WITH_VAPOUR
from ..mechanism.march import step_chamber
from .fields import fields_of, put_fields
from .lane_layout import CHAMBER_COLUMNS, LANES, PISTON_X, ChamberLane


@kernel
def _chamber_of(p: Any, lane: int) -> Any:
    return fields_of(ChamberLane, p.chamber, lane)


@kernel
def _side_of(p: Any, side: int, lane: int) -> Any:
    return fields_of(ValveSide, p.valve[side], lane)


@kernel
def _valves_of(p: Any, lane: int) -> Any:
    a = p.share
    return (
        _side_of(p, 0, lane),
        (a[0, 0, lane], a[0, 1, lane], a[0, 2, lane]),
        _side_of(p, 1, lane),
        (a[1, 0, lane], a[1, 1, lane], a[1, 2, lane]),
    )


@kernel
def enter_chamber(lane: int, p: Any, s: Any, a: Any) -> None:
    """Start the chamber of a throw in its lane."""
    for side in range(2):
        shares = valve_shares(implicit_part(p.step[lane]), _side_of(p, side, lane))
        put_fields(p.share[side], lane, shares)
    for c in range(CHAMBER_COLUMNS):
        s.chamber[c, lane] = a.chambers[lane, c]


@kernel
def _air(p: Any, s: Any) -> None:
    for lane in range(LANES):
        s.air[lane] = air_volume(s.chamber[0, lane], _chamber_of(p, lane))


@kernel
def _side_by_side(p: Any, s: Any) -> None:
    before = s.chamber0
    for lane in range(LANES):
        for c in range(CHAMBER_COLUMNS):
            before[c, lane] = s.chamber[c, lane]
        for c in range(2):
            s.pressure0[c, lane] = s.pressure[c, lane]
    for lane in range(LANES):
        x, v = s.x[PISTON_X, lane], s.v[PISTON_X, lane]
        now = (
            before[0, lane],
            before[1, lane],
            before[2, lane],
            before[3, lane],
            before[4, lane],
            before[5, lane],
        )
        now, f_s, f_d, sure = chamber_at_once(
            now,
            s.air[lane],
            _chamber_of(p, lane),
            _valves_of(p, lane),
            p.step[lane],
            before[6, lane],
            before[7, lane],
            x,
            v,
        )
        put_fields(s.chamber, lane, (*now, x, v))
        s.pressure[0, lane], s.pressure[1, lane] = now[0], 2.0 * now[0] - before[0, lane]
        s.flow[0, lane], s.flow[1, lane] = f_s, f_d
        s.sure[lane], s.choked[lane] = (1.0 if sure else 0.0), 0.0


@subroutine
def step_chamber_alone(lane: int, p: Any, s: Any, a: Any) -> None:
    """Step the chamber of one lane by the general method."""
    chamber, one = a.chambers[lane], a.work.held[0]
    for c in range(CHAMBER_COLUMNS):
        chamber[c] = s.chamber0[c, lane]
    h, substeps = p.step[lane], a.throws[lane].substeps
    fault, before, after = step_chamber(
        chamber, one, a.liquid[lane], h, s.x[PISTON_X, lane], s.v[PISTON_X, lane], substeps
    )
    for c in range(CHAMBER_COLUMNS):
        s.chamber[c, lane] = chamber[c]
    s.pressure[0, lane], s.pressure[1, lane] = before, after
    s.flow[0, lane], s.flow[1, lane] = one.flow[2], one.flow[3]
    s.sure[lane], s.choked[lane] = 0.0, (1.0 if fault != 0 else 0.0)


@subroutine
def step_chambers(p: Any, s: Any, a: Any, code: Any) -> int:
    """Step all chambers along their pistons' paths; return how many needed the general method."""
    _air(p, s)
    _side_by_side(p, s)
    alone = 0
    for lane in range(LANES):
        if code[lane] != 0:
            s.sure[lane] = 1.0
        elif s.sure[lane] == 0.0 or a.throws[lane].substeps > 1:
            step_chamber_alone(lane, p, s, a)
            alone += 1
    return alone


@kernel
def count_vapour(s: Any, a: Any) -> None:
    """Count the lanes whose chamber holds vapour, all stepped by the general method."""
    for lane in range(LANES):
        a.counts[lane, WITH_VAPOUR] += s.sure[lane] == 0.0 and s.chamber[1, lane] > 0.0
