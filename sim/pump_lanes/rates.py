"""Accelerations, forces and margins of all lanes: the equations of one throw in each lane.

Each joint has its own loop over the lanes: joints that no lane has are skipped, and a short loop
lets the processor start the next lanes while the first wait for a square root. Differences between
lanes are expressed by numbers, not by branches, so that different machines can run in parallel.
"""

from typing import Any

from ..contact.law import ELASTIC_LINEAR, FRICTION_SMOOTH, LAW_KELVIN_VOIGT
from ..hydraulics.parameters import PRESSURE_CONSTANT, PRESSURE_TWO_LEVEL
from ..hydraulics.piston_pressure import two_level_pressure
from ..jit import NEAR, kernel, near_sine_cosine, sine_cosine, subroutine
from ..mechanism.layout import GUIDE, OVERLAP_LIMIT, Machine
from ..mechanism.throw_motion import (
    PinLoad,
    crank_load,
    crank_offset,
    dry_pin,
    free_motion,
    guide_end,
    held_wrist,
    motor_moment,
    seal_drag,
    slot_moment,
    worn_eye,
    wrist_offset,
)
from .fields import fields_of, put_fields
from .lane_films import at_oiled_crankpin
from .lane_layout import (
    BETA,
    CRANK,
    DRY,
    FACE_FORCE,
    GUIDE_X_FORCE,
    GUIDE_Y_FORCE,
    LANES,
    MAPPED_FILM,
    PIN_X_FORCE,
    PIN_Y_FORCE,
    PISTON_X,
    PISTON_Y,
    ROD_X,
    ROD_Y,
    SEAL_FORCE,
    TILT,
    ContactLane,
    LiquidLane,
    contact_of,
    lane_pose,
    throw_of,
)


@kernel
def _with_laws(c: Any, plain: bool) -> Any:
    """Contact whose laws are known to the compiler if they are plain."""
    return ContactLane(
        float(LAW_KELVIN_VOIGT) if plain else c.law,
        float(ELASTIC_LINEAR) if plain else c.elasticity,
        c.stiffness,
        c.damping,
        c.hysteresis,
        c.clearance,
        c.slot,
        c.speed_floor,
        c.release,
        float(FRICTION_SMOOTH) if plain else c.friction_law,
        c.friction,
        c.friction_speed,
        c.friction_dead_speed,
        c.tangential_damping,
    )


@kernel
def machine_of_lane(p: Any, lane: int) -> Any:
    """Quantities shared by the throws of the record in a lane."""
    return fields_of(Machine, p.machine, lane)


@kernel
def _liquid_of(p: Any, lane: int) -> Any:
    return fields_of(LiquidLane, p.liquid, lane)


@kernel
def beyond_limit(p: Any, s: Any, lane: int) -> bool:
    """Whether a lane's contacts exceed the penetration limit of their laws."""
    q, o = throw_of(p, lane), s.overlap
    pins = max(
        o[0, lane] - OVERLAP_LIMIT * q.crankpin_radius,
        o[1, lane] - OVERLAP_LIMIT * q.wristpin_radius,
    )
    most: float = max(pins, o[2, lane] - OVERLAP_LIMIT * q.guide_half_height)
    return most > 0.0


@subroutine
def _turn(p: Any, s: Any) -> None:
    """Compute sines and cosines in one loop: the compiler would unroll a short one for the rods."""
    wide = 0
    for lane in range(LANES):
        angle, swing = s.x[CRANK, lane] + p.throw[0, lane], s.x[BETA, lane]
        s.turned[0, lane], s.turned[1, lane] = sine_cosine(angle)
        s.turned[2, lane], s.turned[3, lane] = near_sine_cosine(swing)
        wide += not abs(swing) <= NEAR
    if wide > 0:  # rods swing this far only with cranks nearly as long
        for lane in range(LANES):
            s.turned[2, lane], s.turned[3, lane] = sine_cosine(s.x[BETA, lane])


@subroutine
def _press(p: Any, s: Any) -> None:
    """Pressures by crank angle."""
    for lane in range(LANES):
        h = _liquid_of(p, lane)
        level = two_level_pressure(s.x[CRANK, lane] + p.throw[0, lane], h.suction, h.discharge, h)
        level = level if h.rung == PRESSURE_TWO_LEVEL else 0.0
        s.pressed[lane] = h.discharge if h.rung == PRESSURE_CONSTANT else level


@subroutine
def _press_chambers(s: Any, share: float) -> None:
    for lane in range(LANES):
        before, after = s.pressure[0, lane], s.pressure[1, lane]
        s.pressed[lane] = before + share * (after - before)


@kernel
def _in_crankpin(p: Any, s: Any, plain: bool) -> None:
    for lane in range(LANES):
        q, c, pose, omega = (
            throw_of(p, lane),
            _with_laws(contact_of(p, 0, lane), plain),
            lane_pose(s, lane),
            s.v[CRANK, lane],
        )
        radius = q.crankpin_radius
        sin_b, cos_b = s.turned[2, lane], s.turned[3, lane]
        centred = crank_offset(pose, omega, q, s.turned[0, lane], s.turned[1, lane], sin_b, cos_b)
        (d_x, d_y, v_x, v_y), along = worn_eye(centred, pose.beta_rate, sin_b, cos_b, c)
        spin = omega * radius + pose.beta_rate * (radius + c.clearance)
        pin, touch = dry_pin(
            d_x, d_y, v_x, v_y, spin, radius, s.touching[0, lane] != 0.0, s.impact[0, lane], c
        )
        s.margin[0, lane], s.approach[0, lane] = touch.margin, touch.approach
        s.overlap[0, lane], s.normal[lane] = touch.overlap, touch.normal
        put_fields(s.pin, lane, slot_moment(pin, along, sin_b, cos_b))


@subroutine
def _at_crankpin(p: Any, s: Any) -> None:
    _in_crankpin(p, s, False)


@subroutine
def _at_plain_crankpin(p: Any, s: Any) -> None:
    _in_crankpin(p, s, True)


@kernel
def _in_wristpin(p: Any, s: Any, plain: bool) -> None:
    """Contact of the wrist pins; an ideal one never touches."""
    for lane in range(LANES):
        q, pose = throw_of(p, lane), lane_pose(s, lane)
        c = _with_laws(contact_of(p, 1, lane), plain)
        radius = q.wristpin_radius
        d_x, d_y, v_x, v_y = wrist_offset(pose, q, s.turned[2, lane], s.turned[3, lane])
        spin = pose.tilt_rate * radius + pose.beta_rate * (radius + c.clearance)
        pin, touch = dry_pin(
            d_x, d_y, v_x, v_y, spin, radius, s.touching[1, lane] != 0.0, s.impact[1, lane], c
        )
        s.margin[1, lane], s.approach[1, lane] = touch.margin, touch.approach
        s.overlap[1, lane], s.normal[lane] = touch.overlap, max(s.normal[lane], touch.normal)
        put_fields(s.wrist, lane, pin)


@subroutine
def _at_wristpin(p: Any, s: Any) -> None:
    _in_wristpin(p, s, False)


@subroutine
def _at_plain_wristpin(p: Any, s: Any) -> None:
    _in_wristpin(p, s, True)


@subroutine
def _tilt(s: Any) -> None:
    """Tilt of pistons in guides with play, before their ends are computed."""
    for lane in range(LANES):
        s.tilted[0, lane], s.tilted[1, lane] = sine_cosine(s.x[TILT, lane])
        s.guide[0, lane] = s.guide[1, lane] = s.guide[2, lane] = s.overlap[2, lane] = 0.0


@kernel
def _in_guide(p: Any, s: Any, along: float, j: int, plain: bool) -> None:
    """One end of the pistons, whose upper corner is contact j; an ideal guide never touches."""
    for lane in range(LANES):
        drag, push, turn, upper, lower = guide_end(
            lane_pose(s, lane),
            throw_of(p, lane),
            along,
            s.tilted[0, lane],
            s.tilted[1, lane],
            s.touching[j, lane] != 0.0,
            s.impact[j, lane],
            s.touching[j + 2, lane] != 0.0,
            s.impact[j + 2, lane],
            _with_laws(contact_of(p, 2, lane), plain),
        )
        s.margin[j, lane], s.approach[j, lane] = upper.margin, upper.approach
        s.margin[j + 2, lane], s.approach[j + 2, lane] = lower.margin, lower.approach
        s.guide[0, lane] += drag
        s.guide[1, lane] += push
        s.guide[2, lane] += turn
        s.normal[lane] = max(s.normal[lane], upper.normal)
        s.overlap[2, lane] = max(s.overlap[2, lane], max(upper.overlap, lower.overlap))


@subroutine
def _rear(p: Any, s: Any) -> None:
    _in_guide(p, s, -1.0, GUIDE, False)


@subroutine
def _front(p: Any, s: Any) -> None:
    _in_guide(p, s, 1.0, GUIDE + 1, False)


@subroutine
def _plain_rear(p: Any, s: Any) -> None:
    _in_guide(p, s, -1.0, GUIDE, True)


@subroutine
def _plain_front(p: Any, s: Any) -> None:
    _in_guide(p, s, 1.0, GUIDE + 1, True)


@subroutine
def _accelerate(p: Any, s: Any) -> None:
    """Accelerations of rods and pistons, and the forces on the casing."""
    a, force = s.a, s.force
    for lane in range(LANES):
        q, m, pose = throw_of(p, lane), machine_of_lane(p, lane), lane_pose(s, lane)
        sin_b, cos_b, inv_px = s.turned[2, lane], s.turned[3, lane], q.inverse_piston_along
        pin = fields_of(PinLoad, s.pin, lane)
        wrist = fields_of(PinLoad, s.wrist, lane)
        guide_x, guide_y, guide_turn = s.guide[0, lane], s.guide[1, lane], s.guide[2, lane]
        on_face = -q.piston_area * s.pressed[lane]
        seal = seal_drag(pose.piston_x_rate, s.pressed[lane], q)
        free = free_motion(
            q, m, on_face + seal, inv_px, pin, wrist, guide_x, guide_y, guide_turn, sin_b, cos_b
        )
        # a factor of 1 or 0 preserves all bits and avoids a branch
        found, _, wrist_y = held_wrist(q, m, pose, free, inv_px, sin_b, cos_b, q.tight_wrist)
        a[ROD_X, lane], a[ROD_Y, lane], a[BETA, lane] = found.rod_x, found.rod_y, found.beta
        a[PISTON_X, lane], a[PISTON_Y, lane] = found.piston_x, found.piston_y
        a[TILT, lane] = found.tilt
        held_up = wrist.y + wrist_y + m.gravity_y * q.piston_mass
        force[PIN_X_FORCE, lane], force[PIN_Y_FORCE, lane] = pin.x, pin.y
        force[GUIDE_X_FORCE, lane], force[GUIDE_Y_FORCE, lane] = (
            guide_x,
            guide_y + q.tight_guide * held_up,
        )
        force[FACE_FORCE, lane], force[SEAL_FORCE, lane] = on_face, seal


@kernel
def _crank_moment(p: Any, s: Any, lane: int) -> float:
    pin, sin_a, cos_a = s.pin, s.turned[0, lane], s.turned[1, lane]
    turn = pin[0, lane] * sin_a - pin[1, lane] * cos_a
    moment: float = pin[2, lane] + p.throw[1, lane] * turn
    return moment


@kernel
def _crank_rate(p: Any, s: Any, lane: int, moment: float, sin_a: float, cos_a: float) -> float:
    m = machine_of_lane(p, lane)
    load = crank_load(moment, sin_a, cos_a, 0.0, 0.0, m)
    rate: float = m.inverse_inertia * (motor_moment(s.v[CRANK, lane], m) + load)
    return rate


@subroutine
def _turn_crank(p: Any, s: Any) -> None:
    for lane in range(LANES):
        moment, sin_a, cos_a = _crank_moment(p, s, lane), s.turned[0, lane], s.turned[1, lane]
        s.a[CRANK, lane] = _crank_rate(p, s, lane, moment, sin_a, cos_a)


@subroutine
def _turn_crank_together(p: Any, s: Any) -> None:
    """Acceleration of the cranks of several throws, which share one crank but have copies of it."""
    n = p.throws
    for lane in range(LANES):
        s.moment[lane] = _crank_moment(p, s, lane)
    for first in range(0, LANES - n + 1, n):
        total = s.moment[first]
        for lane in range(first + 1, first + n):
            total += s.moment[lane]
        for lane in range(first, first + n):
            s.moment[lane] = total
            s.lead[0, lane], s.lead[1, lane] = s.turned[0, first], s.turned[1, first]
    for lane in range(LANES):
        sin_a, cos_a = s.lead[0, lane], s.lead[1, lane]
        s.a[CRANK, lane] = _crank_rate(p, s, lane, s.moment[lane], sin_a, cos_a)


@kernel
def rates(p: Any, s: Any, share: float, kind: Any, maps: Any) -> None:
    """Accelerations, forces and margins of all lanes, `share` of the step having passed."""
    loads(p, s, share, kind, maps)
    accelerate(p, s)


@kernel
def loads(p: Any, s: Any, share: float, kind: Any, maps: Any) -> None:
    """Loads of joints and liquid, and margins, of all lanes."""
    _turn(p, s)
    if kind.chambers:
        _press_chambers(s, share)
    else:
        _press(p, s)
    if kind.oil != DRY:
        at_oiled_crankpin(p, s, maps, kind.oil == MAPPED_FILM)
    elif p.plain[0] != 0.0:
        _at_plain_crankpin(p, s)
    else:
        _at_crankpin(p, s)
    if kind.wrist and p.plain[1] != 0.0:
        _at_plain_wristpin(p, s)
    elif kind.wrist:
        _at_wristpin(p, s)
    if kind.guide:
        _tilt(s)
        if p.plain[2] != 0.0:
            _plain_rear(p, s)
            _plain_front(p, s)
        else:
            _rear(p, s)
            _front(p, s)


@kernel
def accelerate(p: Any, s: Any) -> None:
    """Accelerations and forces of all lanes under the present loads."""
    _accelerate(p, s)
    if p.driven != 0.0 and p.throws > 1:
        _turn_crank_together(p, s)
    elif p.driven != 0.0:
        _turn_crank(p, s)
