"""Accelerations, forces and margins of all lanes: the equations of one throw, a lane each.

Joint by joint, each in a loop of its own over the lanes: what no lane has is passed over, and a
short loop leaves the processor room to begin the next lanes while the first wait for a square root.
What only some of the lanes have is told by numbers, not by branches, so that different machines lie
side by side.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ..contact.asperities import SEPARATION
from ..contact.law import ELASTIC_LINEAR, FRICTION_SMOOTH, LAW_KELVIN_VOIGT
from ..film.impedance_map import (
    RADIAL,
    TANGENTIAL,
    MapPlace,
    map_patches,
    map_place,
    map_tensor,
)
from ..film.short import short_resistance
from ..hydraulics.parameters import PRESSURE_CONSTANT, PRESSURE_TWO_LEVEL
from ..hydraulics.piston_pressure import two_level_pressure
from ..hydraulics.valves import ValveSide
from ..jit import NEAR, kernel, near_sine_cosine, sine_cosine, subroutine
from ..mechanism.layout import CONTACTS, GUIDE, OVERLAP_LIMIT, PUSHES, Machine
from ..mechanism.oiled_joint import (
    NEWTON_STEPS,
    FilmPull,
    film_gap,
    film_load,
    film_pull,
    newton_damping,
    newton_step,
    peaks_of,
)
from ..mechanism.throw_motion import (
    PinLoad,
    Pose,
    crank_load,
    crank_offset,
    dry_pin,
    free_motion,
    guide_end,
    held_wrist,
    motor_moment,
    seal_drag,
    wrist_offset,
)
from .fields import fields_of, put_fields

DRY, SHORT_FILM, MAPPED_FILM = range(3)
"""What is in the eyes of the crank pins."""

LANES = 16
"""Records side by side; the compiler does not lay fewer into vectors."""

MOVING, ALL_MOVING = 5, 7
"""Rows of a motion, see :data:`PLACES`: those that move in an ideal guide, and all."""

ROD_X, ROD_Y, BETA, PISTON_X, CRANK, PISTON_Y, TILT = range(ALL_MOVING)
"""Rows of positions, velocities and accelerations; those come last that an ideal guide holds."""

PLACES = (ROD_X, ROD_Y, BETA, PISTON_X, PISTON_Y, TILT)
"""Rows of the coordinates of ``BODY``."""

LANE_FORCES = ("pin_x", "pin_y", "guide_y", "piston_x", "seal_x", "guide_x")
"""Rows of the forces: of ``FORCES`` those that the casing feels, but for the valves'."""

_PIN_X, _PIN_Y, _GUIDE_Y, _FACE, _SEAL, _GUIDE_X = range(len(LANE_FORCES))

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


class OilLane(NamedTuple):
    """Numbers of the oil of a crank pin in a lane, as in ``OIL``."""

    short: float
    map: float
    shear: float
    filled: float
    radius: float
    wall_damping: float
    relaxing: float
    roughness: float
    peaks: float
    step: float
    offset: float
    roots: float
    angles: float
    gap_factor: float
    least_root: float
    per_root: float
    per_radian: float


NEVER = ContactLane(*[0.0] * len(ContactLane._fields))._replace(
    stiffness=1.0, clearance=1e9, speed_floor=1.0, friction_speed=1.0
)
"""Contact of a tight joint: one with so much room never touches, and asks for no change."""

MOST_MODES = 16
"""Of a casing that yields in lanes; one with more runs alone."""

PLAIN_LAWS = tuple(
    ContactLane._fields.index(name) for name in ("law", "elasticity", "friction_law")
)
"""Columns of a contact that are 0 where its laws are the plain ones: spring and dashpot, smooth
friction. A loop that knows needs one root and one division where the others need three and four."""

PLAN = np.dtype(
    [
        ("throw", "f8", (len(ThrowLane._fields), LANES)),
        ("contact", "f8", (3, len(ContactLane._fields), LANES)),
        ("throws", "i8"),  # of every record: they lie in lanes beside each other, in their order
        ("driven", "f8"),  # 1 where any lane's crank has a motor; of all others it turns evenly
        ("plain", "f8", 3),  # 1 where no lane's contact in a joint has other laws than the plain
        ("machine", "f8", (len(Machine._fields), LANES)),
        ("liquid", "f8", (len(LiquidLane._fields), LANES)),
        ("chamber", "f8", (len(ChamberLane._fields), LANES)),
        ("oil", "f8", (len(OilLane._fields), LANES)),
        ("valve", "f8", (2, len(ValveSide._fields), LANES)),  # suction, discharge
        ("share", "f8", (2, 3, LANES)),  # see valve_shares
        ("step", "f8", LANES),
        ("sixth", "f8", LANES),  # of the step
        ("weight", "f8", LANES),  # of a step's force in its mean, as the march of one weighs it
        ("modes", "i8"),  # of the casing that has most of them
        ("gravity", "f8", (2, LANES)),  # of a bearing at rest
        ("push", "f8", (MOST_MODES, len(PUSHES), LANES)),  # as ``Yielding``
        ("react", "f8", (MOST_MODES, 3, LANES)),
        ("reach", "f8", (MOST_MODES, 3, LANES)),
        ("give", "f8", (MOST_MODES, 2, LANES)),
        ("held", "f8", (MOST_MODES, 2, LANES)),
        ("blend", "f8", (2, 2, LANES)),
    ]
)
"""Numbers of all lanes, codes as numbers too; columns as the fields of the tuples above."""

STATE = np.dtype(
    [
        ("x0", "f8", (ALL_MOVING, LANES)),  # where the step began
        ("v0", "f8", (ALL_MOVING, LANES)),
        ("a0", "f8", (ALL_MOVING, LANES)),
        ("force0", "f8", (len(LANE_FORCES), LANES)),
        ("margin0", "f8", (CONTACTS, LANES)),
        ("approach0", "f8", (CONTACTS, LANES)),
        ("normal0", "f8", LANES),
        ("x", "f8", (ALL_MOVING, LANES)),  # the stage that was looked at last
        ("v", "f8", (ALL_MOVING, LANES)),
        ("a", "f8", (ALL_MOVING, LANES)),
        ("force", "f8", (len(LANE_FORCES), LANES)),
        ("margin", "f8", (CONTACTS, LANES)),
        ("approach", "f8", (CONTACTS, LANES)),
        ("normal", "f8", LANES),
        ("overlap", "f8", (3, LANES)),  # of crank pin, wrist pin and guide [m]
        ("turned", "f8", (4, LANES)),  # sine and cosine of the crank, then of the rod
        ("tilted", "f8", (2, LANES)),  # sine and cosine of a piston in a guide with play
        ("pressed", "f8", LANES),  # pressure on the piston
        ("pin", "f8", (4, LANES)),  # ``PinLoad`` of the crank pin
        ("wrist", "f8", (4, LANES)),  # and of a wrist pin with play
        ("moment", "f8", LANES),  # of all throws on the crank, in the lane of each
        ("lead", "f8", (2, LANES)),  # sine and cosine of the crank at the first throw
        ("guide", "f8", (3, LANES)),  # force of a guide with play (x, y), and its moment
        ("middle_v", "f8", (ALL_MOVING, LANES)),  # of the stages in the middle, added
        ("middle_a", "f8", (ALL_MOVING, LANES)),
        ("middle_force", "f8", (len(LANE_FORCES), LANES)),
        ("high", "f8", LANES),  # largest normal force of the step
        ("peak", "f8", LANES),  # of all steps
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
        ("film0", "f8", (2, LANES)),  # where the film lets the pin be, where the step began
        ("film_rate0", "f8", (2, LANES)),
        ("film", "f8", (2, LANES)),
        ("film_rate", "f8", (2, LANES)),
        ("middle_film", "f8", (2, LANES)),  # rates of the stages in the middle, added
        ("squeeze0", "f8", (2, LANES)),  # velocity of the film, where the next search begins
        ("squeeze", "f8", (2, LANES)),
        ("apart", "f8", (4, LANES)),  # see crank_offset
        ("rough", "f8", (2, LANES)),  # see peaks_of
        ("pull", "f8", (len(FilmPull._fields), LANES)),
        ("place", "f8", (len(MapPlace._fields), LANES)),
        ("patch", "f8", (4, LANES)),  # see map_patches
        ("settled", "f8", LANES),  # 1 where the film's velocity is found
        ("gap", "f8", LANES),  # least film
        ("carried", "f8", LANES),  # by touching peaks
        ("asks", "f8", LANES),  # 1 where a contact asks for a change within this step
        ("bad", "f8", LANES),  # status code of this step
        ("moved", "f8", (MOST_MODES, 3, LANES)),  # place, speed and force of the casing's modes
        ("pushed", "f8", LANES),  # force of a throw on one of them
        ("bearing", "f8", (2, LANES)),  # its acceleration with the casing
        ("past", "f8", (2, 2, LANES)),  # the same, one and two steps before
        ("felt", "f8", (2, LANES)),  # of it, by what turns
    ]
)
"""All lanes in the middle of their step. One record: the compiler lays a loop into vectors where it
sees that what it writes is not what it reads."""


@kernel
def _throw_of(p: Any, lane: int) -> Any:
    return fields_of(ThrowLane, p.throw, lane)


@kernel
def _contact_of(p: Any, j: int, lane: int) -> Any:
    return fields_of(ContactLane, p.contact[j], lane)


@kernel
def _as_told(c: Any, plain: bool) -> Any:
    """A contact, its laws known to the compiler where they are plain."""
    return ContactLane(
        float(LAW_KELVIN_VOIGT) if plain else c.law,
        float(ELASTIC_LINEAR) if plain else c.elasticity,
        c.stiffness,
        c.damping,
        c.hysteresis,
        c.clearance,
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
    """What the throws of the record in a lane share."""
    return fields_of(Machine, p.machine, lane)


@kernel
def _liquid_of(p: Any, lane: int) -> Any:
    return fields_of(LiquidLane, p.liquid, lane)


@kernel
def _pose_of(s: Any, lane: int) -> Any:
    x, v = s.x, s.v
    return Pose(
        x[ROD_X, lane],
        x[ROD_Y, lane],
        x[BETA, lane],
        x[PISTON_X, lane],
        x[PISTON_Y, lane],
        x[TILT, lane],
        v[ROD_X, lane],
        v[ROD_Y, lane],
        v[BETA, lane],
        v[PISTON_X, lane],
        v[PISTON_Y, lane],
        v[TILT, lane],
    )


@kernel
def beyond_limit(p: Any, s: Any, lane: int) -> bool:
    """Whether a lane's contacts have sunk in further than their laws hold."""
    q, o = _throw_of(p, lane), s.overlap
    pins = max(
        o[0, lane] - OVERLAP_LIMIT * q.crankpin_radius,
        o[1, lane] - OVERLAP_LIMIT * q.wristpin_radius,
    )
    most: float = max(pins, o[2, lane] - OVERLAP_LIMIT * q.guide_half_height)
    return most > 0.0


@subroutine
def _turn(p: Any, s: Any) -> None:
    """Sines and cosines in one loop: the compiler would unroll the short one of the rods alone."""
    wide = 0
    for lane in range(LANES):
        angle, swing = s.x[CRANK, lane] + p.throw[0, lane], s.x[BETA, lane]
        s.turned[0, lane], s.turned[1, lane] = sine_cosine(angle)
        s.turned[2, lane], s.turned[3, lane] = near_sine_cosine(swing)
        wide += not abs(swing) <= NEAR
    if wide > 0:  # rods swing more than this only where cranks are nearly as long
        for lane in range(LANES):
            s.turned[2, lane], s.turned[3, lane] = sine_cosine(s.x[BETA, lane])


@subroutine
def _press(p: Any, s: Any) -> None:
    """Pressures that follow from the crank angle."""
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
            _throw_of(p, lane),
            _as_told(_contact_of(p, 0, lane), plain),
            _pose_of(s, lane),
            s.v[CRANK, lane],
        )
        radius = q.crankpin_radius
        d_x, d_y, v_x, v_y = crank_offset(
            pose,
            omega,
            q,
            s.turned[0, lane],
            s.turned[1, lane],
            s.turned[2, lane],
            s.turned[3, lane],
        )
        spin = omega * radius + pose.beta_rate * (radius + c.clearance)
        pin, touch = dry_pin(
            d_x, d_y, v_x, v_y, spin, radius, s.touching[0, lane] != 0.0, s.impact[0, lane], c
        )
        s.margin[0, lane], s.approach[0, lane] = touch.margin, touch.approach
        s.overlap[0, lane], s.normal[lane] = touch.overlap, touch.normal
        put_fields(s.pin, lane, pin)


@kernel
def _oil_of(p: Any, lane: int) -> Any:
    return fields_of(OilLane, p.oil, lane)


@kernel
def _film_pull_of(s: Any, lane: int) -> Any:
    return fields_of(FilmPull, s.pull, lane)


@kernel
def _map_place_of(s: Any, lane: int) -> Any:
    return fields_of(MapPlace, s.place, lane)


@kernel
def _turns_of(s: Any, lane: int) -> Any:
    """Mean of the angular velocities of crank pin and eye, and their difference [rad/s]."""
    pin, eye = s.v[CRANK, lane], -s.v[BETA, lane]
    return 0.5 * (pin + eye), pin - eye


@subroutine
def _look_into_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        c = _contact_of(p, 0, lane)
        d_x, d_y, v_x, v_y = crank_offset(
            _pose_of(s, lane),
            s.v[CRANK, lane],
            _throw_of(p, lane),
            s.turned[0, lane],
            s.turned[1, lane],
            s.turned[2, lane],
            s.turned[3, lane],
        )
        put_fields(s.apart, lane, (d_x, d_y, v_x, v_y))
        s.overlap[0, lane] = math.sqrt(d_x * d_x + d_y * d_y) - c.clearance
        s.gap[lane] = film_gap(s.film[0, lane], s.film[1, lane], c)
        s.rough[0, lane] = s.rough[1, lane] = 0.0
    for lane in range(LANES):  # peaks seldom touch, and take a power of the library
        o = _oil_of(p, lane)
        if o.roughness > 0.0 and not s.gap[lane] >= SEPARATION * o.roughness:
            s.rough[0, lane], s.rough[1, lane] = peaks_of(s.gap[lane], o)


@subroutine
def _pull_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        mean, _ = _turns_of(s, lane)
        found = film_pull(
            s.film[0, lane],
            s.film[1, lane],
            s.apart[0, lane],
            s.apart[1, lane],
            s.apart[2, lane],
            s.apart[3, lane],
            mean,
            s.rough[0, lane],
            s.rough[1, lane],
            _contact_of(p, 0, lane),
            _oil_of(p, lane),
        )
        put_fields(s.pull, lane, found)
        s.settled[lane] = 0.0


@kernel
def _squeeze(
    s: Any, lane: int, r_xx: float, r_xy: float, r_yx: float, r_yy: float, damped: float
) -> None:
    """Take one of Newton's steps, but where it has settled, or is no number any more."""
    v_x, v_y = s.squeeze[0, lane], s.squeeze[1, lane]
    new_x, new_y, enough = newton_step(
        r_xx, r_xy, r_yx, r_yy, _film_pull_of(s, lane), v_x, v_y, damped
    )
    done = s.settled[lane] != 0.0
    s.squeeze[0, lane], s.squeeze[1, lane] = v_x if done else new_x, v_y if done else new_y
    s.settled[lane] = 1.0 if done or enough or new_x - new_x != 0.0 else 0.0


@subroutine
def _squeeze_short(p: Any, s: Any, damped: float) -> None:
    for lane in range(LANES):
        f, o = _film_pull_of(s, lane), _oil_of(p, lane)
        xx, xy, yy = short_resistance(f.x, f.y, s.squeeze[0, lane], s.squeeze[1, lane], o.filled)
        _squeeze(s, lane, o.short * xx, o.short * xy, o.short * xy, o.short * yy, damped)


@subroutine
def _squeeze_mapped(p: Any, s: Any, maps: Any, damped: float) -> None:
    """The map is looked up lane by lane: no vector can tell it from what is written."""
    for lane in range(LANES):
        f, o = _film_pull_of(s, lane), _oil_of(p, lane)
        found = map_place(o, o.roots, o.angles, f.x, f.y, s.squeeze[0, lane], s.squeeze[1, lane])
        put_fields(s.place, lane, found)
    for lane in range(LANES):
        if s.settled[lane] == 0.0 and p.oil[_MAP, lane] > 0.0:
            o, m = _oil_of(p, lane), _map_place_of(s, lane)
            begin, roots, angles = int(o.offset), int(o.roots), int(o.angles)
            c = maps[begin : begin + 3 * roots * angles].reshape(3, roots, angles)
            found = map_patches(c[RADIAL], c[TANGENTIAL], m.i, m.j, m.p, m.q)
            put_fields(s.patch, lane, found)
    for lane in range(LANES):
        o = _oil_of(p, lane)
        xx, xy, yx, yy = map_tensor(
            _map_place_of(s, lane),
            o.per_radian,
            s.patch[0, lane],
            s.patch[1, lane],
            s.patch[2, lane],
            s.patch[3, lane],
        )
        _squeeze(s, lane, o.map * xx, o.map * xy, o.map * yx, o.map * yy, damped)


_MAP = OilLane._fields.index("map")


@subroutine
def _load_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        mean, slip = _turns_of(s, lane)
        x, y, on_pin, on_eye, rate_x, rate_y, _, peaks = film_load(
            s.film[0, lane],
            s.film[1, lane],
            s.apart[0, lane],
            s.apart[1, lane],
            mean,
            slip,
            s.squeeze[0, lane],
            s.squeeze[1, lane],
            s.gap[lane],
            s.rough[0, lane],
            s.rough[1, lane],
            _film_pull_of(s, lane),
            _contact_of(p, 0, lane),
            _oil_of(p, lane),
        )
        put_fields(s.pin, lane, (x, y, on_pin, on_eye))
        s.film_rate[0, lane], s.film_rate[1, lane] = rate_x, rate_y
        s.carried[lane], s.normal[lane] = peaks, math.sqrt(x * x + y * y)


@subroutine
def _at_oiled_crankpin(p: Any, s: Any, maps: Any, mapped: bool) -> None:
    """Films are sought together, until the last has found its velocity."""
    _look_into_films(p, s)
    _pull_films(p, s)
    for step in range(NEWTON_STEPS):
        if mapped:
            _squeeze_mapped(p, s, maps, newton_damping(step))
        else:
            _squeeze_short(p, s, newton_damping(step))
        found = 0.0
        for lane in range(LANES):
            found += s.settled[lane]
        if found == LANES:
            break
    _load_films(p, s)


@subroutine
def _at_crankpin(p: Any, s: Any) -> None:
    _in_crankpin(p, s, False)


@subroutine
def _at_plain_crankpin(p: Any, s: Any) -> None:
    _in_crankpin(p, s, True)


@kernel
def _in_wristpin(p: Any, s: Any, plain: bool) -> None:
    """A tight one never touches."""
    for lane in range(LANES):
        q, pose = _throw_of(p, lane), _pose_of(s, lane)
        c = _as_told(_contact_of(p, 1, lane), plain)
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
    """Pistons in guides with play, before their ends are looked at."""
    for lane in range(LANES):
        s.tilted[0, lane], s.tilted[1, lane] = sine_cosine(s.x[TILT, lane])
        s.guide[0, lane] = s.guide[1, lane] = s.guide[2, lane] = s.overlap[2, lane] = 0.0


@kernel
def _in_guide(p: Any, s: Any, along: float, j: int, plain: bool) -> None:
    """One end of the pistons, whose upper corner is contact j; an ideal guide never touches."""
    for lane in range(LANES):
        drag, push, turn, upper, lower = guide_end(
            _pose_of(s, lane),
            _throw_of(p, lane),
            along,
            s.tilted[0, lane],
            s.tilted[1, lane],
            s.touching[j, lane] != 0.0,
            s.impact[j, lane],
            s.touching[j + 2, lane] != 0.0,
            s.impact[j + 2, lane],
            _as_told(_contact_of(p, 2, lane), plain),
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
    """Rods and pistons, and the forces on the casing."""
    a, force = s.a, s.force
    for lane in range(LANES):
        q, m, pose = _throw_of(p, lane), machine_of_lane(p, lane), _pose_of(s, lane)
        sin_b, cos_b, inv_px = s.turned[2, lane], s.turned[3, lane], q.inverse_piston_along
        pin = fields_of(PinLoad, s.pin, lane)
        wrist = fields_of(PinLoad, s.wrist, lane)
        guide_x, guide_y, guide_turn = s.guide[0, lane], s.guide[1, lane], s.guide[2, lane]
        on_face = -q.piston_area * s.pressed[lane]
        seal = seal_drag(pose.piston_x_rate, s.pressed[lane], q)
        free = free_motion(
            q, m, on_face + seal, inv_px, pin, wrist, guide_x, guide_y, guide_turn, sin_b, cos_b
        )
        # a factor of 1 or 0 changes no bit of what it keeps, and is no branch
        found, _, wrist_y = held_wrist(q, m, pose, free, inv_px, sin_b, cos_b, q.tight_wrist)
        a[ROD_X, lane], a[ROD_Y, lane], a[BETA, lane] = found.rod_x, found.rod_y, found.beta
        a[PISTON_X, lane], a[PISTON_Y, lane] = found.piston_x, found.piston_y
        a[TILT, lane] = found.tilt
        held_up = wrist.y + wrist_y + m.gravity_y * q.piston_mass
        force[_PIN_X, lane], force[_PIN_Y, lane] = pin.x, pin.y
        force[_GUIDE_X, lane], force[_GUIDE_Y, lane] = guide_x, guide_y + q.tight_guide * held_up
        force[_FACE, lane], force[_SEAL, lane] = on_face, seal


@kernel
def _crank_moment(p: Any, s: Any, lane: int) -> float:
    pin, sin_a, cos_a = s.pin, s.turned[0, lane], s.turned[1, lane]
    turn = pin[0, lane] * sin_a - pin[1, lane] * cos_a
    moment: float = pin[2, lane] + p.throw[1, lane] * turn
    return moment


@kernel
def _crank_rate(p: Any, s: Any, lane: int, moment: float, sin_a: float, cos_a: float) -> float:
    m = machine_of_lane(p, lane)
    load = crank_load(moment, sin_a, cos_a, m)
    rate: float = m.inverse_inertia * (motor_moment(s.v[CRANK, lane], m) + load)
    return rate


@subroutine
def _turn_crank(p: Any, s: Any) -> None:
    for lane in range(LANES):
        moment, sin_a, cos_a = _crank_moment(p, s, lane), s.turned[0, lane], s.turned[1, lane]
        s.a[CRANK, lane] = _crank_rate(p, s, lane, moment, sin_a, cos_a)


@subroutine
def _turn_crank_together(p: Any, s: Any) -> None:
    """Cranks of several throws, each of which has a copy: moved by what all do to it."""
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
    """Accelerations, forces and margins of all lanes; `share` of the step has passed."""
    _turn(p, s)
    if kind.breathing:
        _press_chambers(s, share)
    else:
        _press(p, s)
    if kind.oil != DRY:
        _at_oiled_crankpin(p, s, maps, kind.oil == MAPPED_FILM)
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
    _accelerate(p, s)
    if p.driven != 0.0 and p.throws > 1:
        _turn_crank_together(p, s)
    elif p.driven != 0.0:
        _turn_crank(p, s)
