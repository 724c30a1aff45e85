"""Rates, forces and margins of all lanes: the equations of one throw, a lane each.

What has no play in a record's wrist pin or guide is told by numbers, not by branches, so that
different machines lie side by side.
"""

from typing import Any, NamedTuple

import numpy as np

from ..jit import kernel, sine_cosine, subroutine
from ..pump.hydraulics import (
    PRESSURE_CHAMBER,
    PRESSURE_CONSTANT,
    PRESSURE_TWO_LEVEL,
    ValveSide,
    two_level_pressure,
)
from ..pump.slider_crank import CONTACTS, GUIDE, Machine
from ..pump.throw_motion import (
    PinLoad,
    Pose,
    crank_load,
    crank_offset,
    dry_pin,
    free_motion,
    guide_corner,
    held_wrist,
    motor_moment,
    seal_drag,
    wrist_offset,
)

LANES = 16
"""Records side by side; the compiler does not lay fewer into vectors."""

COORDINATES = 14
"""Columns of a state: those of a throw, then crank angle and speed."""

FORCES_IN_LANES = 9
"""Columns of the forces: those of a throw without its valves, then the drive moment."""

CHAMBER_COLUMNS = 8
"""Of a chamber: ``CHAMBER_STATE``, then position and velocity of its piston."""


class ThrowLane(NamedTuple):
    """Numbers of a throw in a lane, as in ``THROW``."""

    phase: float
    crank_radius: float
    rod_centre: float
    rod_arm: float
    rod_mass: float
    inverse_rod_mass: float
    inverse_rod_inertia: float
    piston_mass: float
    inverse_piston_across: float
    inverse_piston_tilt: float
    piston_area: float
    seal_friction: float
    seal_friction_area: float
    seal_friction_speed: float
    crankpin_radius: float
    wristpin_radius: float
    guide_half_length: float
    guide_half_height: float
    inverse_piston_along: float  # [1/kg]
    tight_wrist: float  # 1 where an ideal wrist pin holds rod and piston together, else 0
    tight_guide: float  # 1 where an ideal guide holds the piston up, else 0


class ContactLane(NamedTuple):
    """Numbers of a contact in a lane, as in ``CONTACT``."""

    law: float
    elasticity: float
    stiffness: float
    damping: float
    hysteresis: float
    clearance: float
    speed_floor: float
    release: float
    friction_law: float
    friction: float
    friction_speed: float
    friction_dead_speed: float
    tangential_damping: float


class LiquidLane(NamedTuple):
    """Numbers of a pressure in a lane, as in ``HYDRAULIC``."""

    rung: float
    suction: float
    discharge: float
    fall_delay: float
    fall_angle: float
    rise_delay: float
    rise_angle: float


class ChamberLane(NamedTuple):
    """Numbers of a chamber in a lane, as in ``HYDRAULIC``; its valves are ``ValveSide``."""

    suction: float
    discharge: float
    area: float
    crank_radius: float
    rod_length: float
    dead_volume: float
    bulk_modulus: float
    air_fraction: float
    air_power: float
    vapour: float


NEVER = ContactLane(*[0.0] * len(ContactLane._fields))._replace(
    stiffness=1.0, clearance=1e9, speed_floor=1.0, friction_speed=1.0
)
"""Contact of a tight joint: one with so much room never touches, and asks for no change."""

PLAN = np.dtype(
    [
        ("throw", "f8", (len(ThrowLane._fields), LANES)),
        ("contact", "f8", (3, len(ContactLane._fields), LANES)),
        ("machine", "f8", (len(Machine._fields), LANES)),
        ("liquid", "f8", (len(LiquidLane._fields), LANES)),
        ("chamber", "f8", (len(ChamberLane._fields), LANES)),
        ("valve", "f8", (2, len(ValveSide._fields), LANES)),  # suction, discharge
        ("share", "f8", (2, 3, LANES)),  # see valve_shares
        ("step", "f8", LANES),
        ("sixth", "f8", LANES),  # of the step
        ("weight", "f8", LANES),  # of a step's force in its mean, as the march of one weighs it
    ]
)
"""Numbers of all lanes, codes as numbers too; columns as the fields of the tuples above."""

STATE = np.dtype(
    [
        ("y0", "f8", (COORDINATES, LANES)),  # where the step began
        ("rate0", "f8", (COORDINATES, LANES)),
        ("force0", "f8", (FORCES_IN_LANES, LANES)),
        ("margin0", "f8", (CONTACTS, LANES)),
        ("approach0", "f8", (CONTACTS, LANES)),
        ("normal0", "f8", LANES),
        ("y", "f8", (COORDINATES, LANES)),  # the stage that was looked at last
        ("rate", "f8", (COORDINATES, LANES)),
        ("force", "f8", (FORCES_IN_LANES, LANES)),
        ("margin", "f8", (CONTACTS, LANES)),
        ("approach", "f8", (CONTACTS, LANES)),
        ("normal", "f8", LANES),
        ("overlap", "f8", (3, LANES)),  # of crank pin, wrist pin and guide [m]
        ("middle_rate", "f8", (COORDINATES, LANES)),  # of the stages in the middle, added
        ("middle_force", "f8", (FORCES_IN_LANES, LANES)),
        ("high", "f8", LANES),  # largest normal force of the step
        ("touching", "f8", (CONTACTS, LANES)),  # 0 or 1
        ("impact", "f8", (CONTACTS, LANES)),
        ("pressure0", "f8", (2, LANES)),  # on the piston at both ends of the step, of a chamber
        ("pressure", "f8", (2, LANES)),  # the same, of the step that is being looked at
        ("chamber0", "f8", (CHAMBER_COLUMNS, LANES)),  # where the step began
        ("chamber", "f8", (CHAMBER_COLUMNS, LANES)),
        ("air", "f8", LANES),  # of the chamber where the step began
        ("flow", "f8", (2, LANES)),  # impulses of the valves
        ("sure", "f8", LANES),  # 1 where the chambers' step side by side is good
        ("choked", "f8", LANES),  # 1 where a chamber has failed
        ("asks", "f8", LANES),  # 1 where a contact asks for a change within this step
        ("bad", "f8", LANES),  # status code of this step
    ]
)
"""All lanes in the middle of their step. One record: the compiler lays a loop into vectors where it
sees that what it writes is not what it reads."""


@kernel
def _throw_of(p: Any, lane: int) -> Any:
    a = p.throw
    return ThrowLane(
        a[0, lane],
        a[1, lane],
        a[2, lane],
        a[3, lane],
        a[4, lane],
        a[5, lane],
        a[6, lane],
        a[7, lane],
        a[8, lane],
        a[9, lane],
        a[10, lane],
        a[11, lane],
        a[12, lane],
        a[13, lane],
        a[14, lane],
        a[15, lane],
        a[16, lane],
        a[17, lane],
        a[18, lane],
        a[19, lane],
        a[20, lane],
    )


@kernel
def _contact_of(p: Any, j: int, lane: int) -> Any:
    a = p.contact
    return ContactLane(
        a[j, 0, lane],
        a[j, 1, lane],
        a[j, 2, lane],
        a[j, 3, lane],
        a[j, 4, lane],
        a[j, 5, lane],
        a[j, 6, lane],
        a[j, 7, lane],
        a[j, 8, lane],
        a[j, 9, lane],
        a[j, 10, lane],
        a[j, 11, lane],
        a[j, 12, lane],
    )


@kernel
def machine_of_lane(p: Any, lane: int) -> Any:
    """What the throws of the record in a lane share."""
    a = p.machine
    return Machine(
        a[0, lane],
        a[1, lane],
        a[2, lane],
        a[3, lane],
        a[4, lane],
        a[5, lane],
        a[6, lane],
        a[7, lane],
        a[8, lane],
    )


@kernel
def _liquid_of(p: Any, lane: int) -> Any:
    a = p.liquid
    return LiquidLane(
        a[0, lane], a[1, lane], a[2, lane], a[3, lane], a[4, lane], a[5, lane], a[6, lane]
    )


@kernel
def _pose_of(y: Any, lane: int) -> Any:
    return Pose(
        y[0, lane],
        y[1, lane],
        y[2, lane],
        y[3, lane],
        y[4, lane],
        y[5, lane],
        y[6, lane],
        y[7, lane],
        y[8, lane],
        y[9, lane],
        y[10, lane],
        y[11, lane],
    )


@kernel
def _pressure(angle: float, h: Any, before: float, after: float, share: float) -> float:
    """Pressure on the piston of any rung that lanes know [Pa]."""
    level = two_level_pressure(angle, h.suction, h.discharge, h)
    level = level if h.rung == PRESSURE_TWO_LEVEL else 0.0
    level = h.discharge if h.rung == PRESSURE_CONSTANT else level
    return before + share * (after - before) if h.rung == PRESSURE_CHAMBER else level


@kernel
def _wrist_load(pose: Any, q: Any, p: Any, s: Any, sin_b: float, cos_b: float, lane: int) -> Any:
    """Load of the wrist pin, and the state of its contact; a tight one never touches."""
    c, radius = _contact_of(p, 1, lane), q.wristpin_radius
    d_x, d_y, v_x, v_y = wrist_offset(pose, q, sin_b, cos_b)
    spin = pose.tilt_rate * radius + pose.beta_rate * (radius + c.clearance)
    load, touch = dry_pin(
        d_x, d_y, v_x, v_y, spin, radius, s.touching[1, lane] != 0.0, s.impact[1, lane], c
    )
    s.margin[1, lane], s.approach[1, lane] = touch.margin, touch.approach
    return load, touch


@kernel
def _guide_load(pose: Any, q: Any, p: Any, s: Any, lane: int) -> Any:
    """Force of the guide (x, y, turning), what presses, and the overlap."""
    c = _contact_of(p, 2, lane)
    # written out: the compiler lays no loop within its loop of lanes into vectors
    one = _at_corner(pose, q, c, s, GUIDE, -1.0, 1.0, lane)
    two = _at_corner(pose, q, c, s, GUIDE + 1, 1.0, 1.0, lane)
    three = _at_corner(pose, q, c, s, GUIDE + 2, -1.0, -1.0, lane)
    four = _at_corner(pose, q, c, s, GUIDE + 3, 1.0, -1.0, lane)
    normal = max(max(max(0.0, one[3]), two[3]), max(three[3], four[3]))
    deepest = max(max(max(0.0, one[4]), two[4]), max(three[4], four[4]))
    return (
        one[0] + two[0] + three[0] + four[0],
        one[1] + two[1] + three[1] + four[1],
        one[2] + two[2] + three[2] + four[2],
        normal,
        deepest,
    )


@kernel
def _at_corner(
    pose: Any, q: Any, c: Any, s: Any, j: int, along: float, side: float, lane: int
) -> Any:
    drag, push, turn, touch = guide_corner(
        pose, q, along, side, s.touching[j, lane] != 0.0, s.impact[j, lane], c
    )
    s.margin[j, lane], s.approach[j, lane] = touch.margin, touch.approach
    return drag, push, turn, touch.normal, touch.overlap


@kernel
def overlap_of_lane(p: Any, s: Any, lane: int) -> float:
    """Largest overlap of a lane, over the radius of its pin or half the height of its guide."""
    q, o = _throw_of(p, lane), s.overlap
    pins = max(o[0, lane] / q.crankpin_radius, o[1, lane] / q.wristpin_radius)
    largest: float = max(pins, o[2, lane] / q.guide_half_height)
    return largest


@kernel
def rates(p: Any, s: Any, share: float, play: bool) -> None:
    """Rates, forces and margins of all lanes at their state; `share` of the step has passed.

    `play` beside the crank pin's: without any, half the work.
    """
    if play:
        _rates_with_play(p, s, share)
    else:
        _rates_without(p, s, share)


@subroutine
def _rates_with_play(p: Any, s: Any, share: float) -> None:
    _rates(p, s, share, True)


@subroutine
def _rates_without(p: Any, s: Any, share: float) -> None:
    _rates(p, s, share, False)


@kernel
def _rates(p: Any, s: Any, share: float, play: bool) -> None:
    y, rate, force = s.y, s.rate, s.force
    for lane in range(LANES):
        q, m, c = _throw_of(p, lane), machine_of_lane(p, lane), _contact_of(p, 0, lane)
        pose, angle, omega = _pose_of(y, lane), y[12, lane], y[13, lane]
        sin_a, cos_a = sine_cosine(angle + q.phase)
        sin_b, cos_b = sine_cosine(pose.beta)
        pressure = _pressure(
            angle + q.phase,
            _liquid_of(p, lane),
            s.pressure[0, lane],
            s.pressure[1, lane],
            share,
        )
        on_face, inv_px = -q.piston_area * pressure, q.inverse_piston_along
        d_x, d_y, v_x, v_y = crank_offset(pose, omega, q, sin_a, cos_a, sin_b, cos_b)
        radius = q.crankpin_radius
        spin = omega * radius + pose.beta_rate * (radius + c.clearance)
        pin, touch = dry_pin(
            d_x,
            d_y,
            v_x,
            v_y,
            spin,
            radius,
            s.touching[0, lane] != 0.0,
            s.impact[0, lane],
            c,
        )
        s.margin[0, lane], s.approach[0, lane] = touch.margin, touch.approach
        s.overlap[0, lane], peak = touch.overlap, touch.normal
        wrist, guide_x, guide_y, guide_moment = PinLoad(0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
        if play:
            wrist, touch = _wrist_load(pose, q, p, s, sin_b, cos_b, lane)
            s.overlap[1, lane], peak = touch.overlap, max(peak, touch.normal)
            guide_x, guide_y, guide_moment, normal, overlap = _guide_load(pose, q, p, s, lane)
            s.overlap[2, lane], peak = overlap, max(peak, normal)
        seal = seal_drag(pose.piston_x_rate, pressure, q)
        free = free_motion(
            q, m, on_face + seal, inv_px, pin, wrist, guide_x, guide_y, guide_moment, sin_b, cos_b
        )
        # a factor of 1 or 0 changes no bit of what it keeps, and is no branch
        rates, wrist_x, wrist_y = held_wrist(q, m, pose, free, inv_px, sin_b, cos_b, q.tight_wrist)
        wrist_x, wrist_y = wrist.x + wrist_x, wrist.y + wrist_y
        guide_y += q.tight_guide * (wrist_y + m.gravity_y * q.piston_mass)
        rate[0, lane], rate[1, lane], rate[2, lane] = (
            pose.rod_x_rate,
            pose.rod_y_rate,
            pose.beta_rate,
        )
        rate[3, lane], rate[4, lane] = pose.piston_x_rate, pose.piston_y_rate
        rate[5, lane] = pose.tilt_rate
        rate[6, lane], rate[7, lane], rate[8, lane] = rates.rod_x, rates.rod_y, rates.beta
        rate[9, lane], rate[10, lane], rate[11, lane] = (
            rates.piston_x,
            rates.piston_y,
            rates.tilt,
        )
        force[0, lane], force[1, lane], force[2, lane], force[3, lane] = (
            pin.x,
            pin.y,
            wrist_x,
            wrist_y,
        )
        force[4, lane], force[5, lane], force[6, lane] = guide_x, guide_y, on_face
        force[7, lane] = seal
        s.normal[lane] = peak
        moment = pin.on_pin + q.crank_radius * (pin.x * sin_a - pin.y * cos_a)
        load = crank_load(moment, sin_a, cos_a, m)
        drive = motor_moment(omega, m)
        rate[12, lane], rate[13, lane] = omega, m.inverse_inertia * (drive + load)
        force[FORCES_IN_LANES - 1, lane] = -load if m.inverse_inertia == 0.0 else drive
