"""The crank mechanism of one to N throws with clearance in its joints, compiled.

Bodies: the crank (one angle ``a``), and per throw a rod (centre of mass ``x_r, y_r`` and angle
``b``) and a piston (``x, y`` and tilt ``t``). Axes: x along the stroke from the crank centre to
the cylinder, y across it. The rod points from the wrist pin to the crank pin along
``e = (-cos b, sin b)``; ``g = de/db = (sin b, cos b)``.

A joint is one of four things. *Ideal*: two constraint forces. *Link*: one constraint force along
a massless link as long as the radial clearance, with friction at its ends; the pin never leaves
its eye, and a link in tension says that it would. *Compliant*: the contact force of a law where
the pin overlaps its eye, nothing in free flight. *Oiled*: a film on a yielding wall, without events
(:mod:`.oiled_joint`). An ideal guide holds ``y = t = 0``; a compliant
one has a clearance on either side and touches the piston at its four corners.

For a pin at ``d`` from the centre of its eye, with direction ``n`` and ``t`` a quarter turn
further, the force on the rod is ``F_n n + F_t t``, where ``F_t`` follows the sliding velocity
``v_t = d' . t + r_pin w_pin + r_eye b'`` (the rod turns at ``-b'``), so that friction takes energy
out: the printed signs of the source paper put it in. Newton's and Euler's equations of each body
are explicit but for the constraint forces, which solve a linear system of up to four unknowns per
throw; drift is held by Baumgarte's terms. With a motor the crank's acceleration enters every
throw's constraints linearly, so that it too comes out in closed form.

Classical Runge-Kutta with a fixed step; a step in which a contact closes or opens is cut there, so
the order is kept across contact. Forces are recorded as means over the step, that is as exact
impulses, whatever the contacts did in between. A chamber with valves is stepped after the
mechanism, which feels its pressure extrapolated from the two steps before (second order). Where
the throws share two lines, all chambers are tried over a step until the pressures at the lines'
ends agree with what the pump draws (:mod:`wearstate.sim.piping.coupling`).

Sources: Xia, Zhang, Yu, Zhu (2017), Ship Science and Technology 39(1), 51-55; Baumgarte (1972),
doi:10.1016/0045-7825(72)90018-7.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.law import LAW_CONSTANT_LOSS, friction_force
from ..hydraulics.chamber import chamber_step
from ..hydraulics.parameters import PRESSURE_CHAMBER
from ..hydraulics.piston_pressure import line_pressure
from ..jit import kernel, sine_cosine, subroutine
from ..output.status import Status
from ..piping.coupling import PAIR, begin_pair, seek_pair
from ..piping.pipe import PIPE, PIPE_STATE, advance_pipe
from .oiled_joint import oiled_joint
from .throw_motion import (
    PinLoad,
    Pose,
    corner_margin,
    crank_load,
    crank_offset,
    dry_pin,
    free_motion,
    guide_end,
    held_back,
    held_wrist,
    link_drag,
    motor_moment,
    pin_touch,
    polar,
    seal_drag,
    wrist_offset,
)

JOINT_IDEAL, JOINT_LINK, JOINT_COMPLIANT, JOINT_OILED = 0, 1, 2, 3
"""From `JOINT_COMPLIANT` on a joint is a force that follows from the motion."""

THROW = np.dtype(
    [
        ("phase", "f8"),  # crank angle of this throw over that of the crank [rad]
        ("crank_radius", "f8"),
        ("rod_centre", "f8"),  # wrist pin to centre of mass [m]
        ("rod_arm", "f8"),  # centre of mass to crank-pin eye [m]
        ("rod_mass", "f8"),
        ("inverse_rod_mass", "f8"),
        ("inverse_rod_inertia", "f8"),  # about its centre of mass [1/(kg m^2)]
        ("piston_mass", "f8"),
        ("inverse_piston_across", "f8"),  # 0 in an ideal guide [1/kg]
        ("inverse_piston_tilt", "f8"),  # about the wrist pin; 0 in an ideal guide [1/(kg m^2)]
        ("piston_area", "f8"),
        ("seal_friction", "f8"),  # by the seal's tension [N]
        ("seal_friction_area", "f8"),  # more of it per pressure [N/Pa]
        ("seal_friction_speed", "f8"),  # that regularises its sign [m/s]
        ("crankpin_rung", "i8"),
        ("wristpin_rung", "i8"),
        ("guide_rung", "i8"),
        ("crankpin_radius", "f8"),
        ("wristpin_radius", "f8"),
        ("guide_half_length", "f8"),
        ("guide_half_height", "f8"),
        ("pressure_rung", "i8"),
        ("substeps", "i8"),  # of the chamber
    ]
)
"""One throw, in SI."""

CRANKPIN, WRISTPIN, GUIDE = 0, 1, 2
"""Columns of the contact table, one row per throw."""

CONTACTS = 6
"""Places of contact per throw: crank pin, wrist pin, and the guide's corners, rear and front,
upper then lower."""


class Machine(NamedTuple):
    """What the throws share, in SI."""

    gravity_x: float
    gravity_y: float
    inverse_inertia: float  # of everything that turns; 0 is constant speed
    static_moment: float  # unbalance of the crank along the first throw [kg m]
    drive_moment: float  # constant part [N m]
    synchronous_speed: float  # of the motor, at the crank [rad/s]
    breakdown_moment: float  # largest moment of the motor [N m]; 0 is none
    breakdown_slip: float
    baumgarte: float  # decay rate of constraint drift [1/s]


BODY = ("rod_x", "rod_y", "beta", "piston_x", "piston_y", "tilt")
"""Coordinates of a throw [m, rad]; the state holds these, then their rates."""

PER_THROW = 2 * len(BODY)

ROD_X, ROD_Y, BETA, PISTON_X, PISTON_Y, TILT = range(len(BODY))
ROD_X_RATE, ROD_Y_RATE, BETA_RATE, PISTON_X_RATE, PISTON_Y_RATE, TILT_RATE = range(
    len(BODY), PER_THROW
)
"""Columns of a throw's state."""

FORCES = (
    "pin_x",
    "pin_y",
    "wrist_x",
    "wrist_y",
    "guide_x",
    "guide_y",
    "piston_x",
    "seal_x",
    "suction_valve",
    "discharge_valve",
)
"""Mean forces of a throw over a step [N]: crank pin on rod, wrist pin on rod, guide on piston
(friction along x, push along y), liquid on piston, seal on piston, each valve on the casing along
the stroke.
Before them stands the drive moment [N m]."""

_PIN, _WRIST, _GUIDE, _FACE, _SEAL, _VALVES = 0, 2, 4, 6, 7, 8  # first columns of FORCES

FILM = ("crankpin_x", "crankpin_y", "wristpin_x", "wristpin_y")
"""Where the films of a throw let its pins be, from the centres of their eyes [m]."""

GAPS = ("crankpin_gap", "wristpin_gap", "crankpin_peaks", "wristpin_peaks")
"""Least gap of each film [m], and what its touching peaks carry [N]; a joint without oil has 0."""

OVERLAP_LIMIT = 0.1  # of the pin radius: small-penetration contact laws end there
_MOST_CUTS = 8  # contact changes within one step and throw before the rest is taken as it is
NO_CHANGE = 1.0  # margin of a contact that cannot change [N]


class Tables(NamedTuple):
    """Everything that the kernel is told."""

    throws: NDArray[Any]  # (n_throws,) of THROW
    contacts: NDArray[Any]  # (n_throws, 3) of CONTACT
    liquid: NDArray[Any]  # (n_throws,) of HYDRAULIC
    oils: NDArray[Any]  # (n_throws, 2) of OIL
    maps: NDArray[np.float64]  # coefficients of all films that are maps, one after the other
    machine: Machine


class Yielding(NamedTuple):
    """A casing whose modes carry the main bearing along; without any mode it is at rest."""

    push: NDArray[np.float64]  # (n_modes, n_throws, len(PUSHES)): modal force per force
    react: NDArray[np.float64]  # (n_modes, 3): mean acceleration over a step, per force in it and
    reach: NDArray[np.float64]  # (n_modes, 3): place after it, per place and speed before it
    give: NDArray[np.float64]  # (n_modes, 2): shape at the bearing, along and across [kg^-0.5]
    held: NDArray[np.float64]  # (n_modes, 2): pushes back by what it carries [kg^0.5]
    blend: NDArray[np.float64]  # (2, 2): what that makes of its acceleration, see `settled`


PUSHES = tuple(
    FORCES.index(name)
    for name in (
        "pin_x",
        "pin_y",
        "guide_y",
        "piston_x",
        "seal_x",
        "guide_x",
        "suction_valve",
        "discharge_valve",
    )
)
"""Columns of FORCES that push on the casing, in the order in which they are added up."""

AT_REST = Yielding(
    push=np.zeros((0, 1, len(PUSHES))),
    react=np.zeros((0, 3)),
    reach=np.zeros((0, 3)),
    give=np.zeros((0, 2)),
    held=np.zeros((0, 2)),
    blend=np.zeros((2, 2)),
)
"""A bearing that does not move."""


STAGE = np.dtype(
    [
        ("y", "f8", PER_THROW),
        ("rate", "f8", PER_THROW),
        ("force", "f8", len(FORCES)),
        ("margin", "f8", CONTACTS),
        ("approach", "f8", CONTACTS),
        ("normal", "f8"),  # largest normal force
        ("overlap", "f8"),  # largest overlap over the pin radius
        ("link", "f8"),  # least force in a link: negative is tension
        ("rate_per_turn", "f8", PER_THROW),  # per crank acceleration
        ("force_per_turn", "f8", len(FORCES)),
        ("film", "f8", len(FILM)),
        ("film_rate", "f8", len(FILM)),
        ("gaps", "f8", len(GAPS)),
    ]
)
"""One throw at one stage of a step."""

HELD = np.dtype(
    [
        ("touching", "i8", CONTACTS),  # 0 or 1
        ("impact", "f8", CONTACTS),  # speed at which each contact closed
        ("pressure", "f8", 2),  # of the chamber, at both ends of the step
        ("flow", "f8", 4),  # of the chamber's valves, see chamber_step
        ("squeeze", "f8", (2, 2)),  # last velocity of each film, where the next search begins
    ]
)
"""What one throw remembers from step to step."""

ANGLE, SPEED, ANGLE_RATE, SPEED_RATE, MOMENT = range(5)
"""Columns of the crank's stages."""


AT_JOINT, ALONG_X, ALONG_Y, RUBBING, NORMAL_X, NORMAL_Y = range(6)
"""Columns of the place of a constraint force: its joint, its direction with the share that rubs
across it, and the normal along which its equation stands."""

SIZE, SIZE_PER_TURN = 4, 5
"""Right sides of the constraint equations, and after elimination the constraint forces: at constant
crank speed, and per crank acceleration."""


class Work(NamedTuple):
    """Scratch of the march; nothing is allocated in its loop.

    Rows 0 and 1 are the ends of the step in turn, rows 2 to 4 the stages between them.
    """

    crank: NDArray[np.float64]  # (5, 5)
    stage: NDArray[Any]  # (5, n_throws) of STAGE
    held: NDArray[Any]  # (n_throws,) of HELD
    moment: NDArray[np.float64]  # (2,): on the crank, and per crank acceleration
    matrix: NDArray[np.float64]  # (4, 6): constraint equations with two right sides, see SIZE
    place: NDArray[np.float64]  # (4, 6): of each constraint force, see AT_JOINT


class LinePair(NamedTuple):
    """Suction and discharge line of all throws, in this order; without any row there are none."""

    pipes: NDArray[np.void]  # (2,) of PIPE
    states: NDArray[np.void]  # (2,) of PIPE_STATE
    suction_nodes: NDArray[np.float64]
    discharge_nodes: NDArray[np.float64]


class _Shared(NamedTuple):
    """The lines with the scratch of their coupling."""

    lines: Any  # of LinePair
    pairs: NDArray[np.void]  # (1,) of PAIR
    trials: NDArray[np.float64]  # (n_throws, 6): chambers at the end of a step that is tried


@kernel
def _pose(b: Any) -> Any:
    y = b.y
    return Pose(y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11])


@kernel
def _contact_margin(k: int, j: int, w: Any, row: int, t: Any) -> Any:
    """Margin of one contact alone, for the search of its change."""
    q, p, omega = t.throws[k], _pose(w.stage[row, k]), w.crank[row, SPEED]
    touching, impact = w.held[k].touching[j] != 0, w.held[k].impact[j]
    if j > WRISTPIN:
        along, side = _corner_place(j - GUIDE)
        return corner_margin(p, q, along, side, touching, impact, t.contacts[k, GUIDE])
    sin_b, cos_b = sine_cosine(p.beta)
    if j == CRANKPIN:
        sin_a, cos_a = sine_cosine(w.crank[row, ANGLE] + q.phase)
        d_x, d_y, v_x, v_y = crank_offset(p, omega, q, sin_a, cos_a, sin_b, cos_b)
    else:
        d_x, d_y, v_x, v_y = wrist_offset(p, q, sin_b, cos_b)
    touch, _, _ = pin_touch(d_x, d_y, v_x, v_y, touching, impact, t.contacts[k, j])
    return touch.margin


@kernel
def _corner_place(number: int) -> Any:
    """Along and across of a corner of the piston: rear and front, upper then lower."""
    return (1.0 if number & 1 else -1.0), (1.0 if number < 2 else -1.0)


@kernel
def _oiled(
    joint: int,
    d_x: float,
    d_y: float,
    v_x: float,
    v_y: float,
    pin_turn: float,
    k: int,
    b: Any,
    held: Any,
    t: Any,
) -> Any:
    """Load of a pin on the rod through oil, and the size of its force."""
    n = 2 * joint
    f_x, f_y, on_pin, on_eye, rate_x, rate_y, gap, peaks = oiled_joint(
        b.film[n],
        b.film[n + 1],
        d_x,
        d_y,
        v_x,
        v_y,
        pin_turn,
        -b.y[BETA_RATE],
        held.squeeze[joint],
        t.contacts[k, joint],
        t.oils[k, joint],
        t.maps,
    )
    b.film_rate[n], b.film_rate[n + 1] = rate_x, rate_y
    b.gaps[joint], b.gaps[2 + joint] = gap, peaks
    return PinLoad(f_x, f_y, on_pin, on_eye), math.sqrt(f_x * f_x + f_y * f_y)


@kernel
def _pin_load(
    joint: int,
    rung: int,
    radius: float,
    offset: Any,
    pin_turn: float,
    k: int,
    b: Any,
    held: Any,
    t: Any,
) -> Any:
    """Load of a pin on the rod by any rung that is a force, what presses, and the overlap.

    A link's load is its viscous part; the pin of an ideal joint has none.
    """
    if rung == JOINT_IDEAL:
        return PinLoad(0.0, 0.0, 0.0, 0.0), 0.0, 0.0
    d_x, d_y, v_x, v_y = offset
    c = t.contacts[k, joint]
    if rung == JOINT_OILED:
        load, peak = _oiled(joint, d_x, d_y, v_x, v_y, pin_turn, k, b, held, t)
        return load, peak, math.sqrt(d_x * d_x + d_y * d_y) - c.clearance
    spin = pin_turn * radius + b.y[BETA_RATE] * (radius + c.clearance)
    if rung == JOINT_LINK:
        f_x, f_y, rub = link_drag(d_x, d_y, v_x, v_y, spin, c)
        return PinLoad(f_x, f_y, -radius * rub, (radius + c.clearance) * rub), 0.0, 0.0
    touching = held.touching[joint] != 0
    load, touch = dry_pin(d_x, d_y, v_x, v_y, spin, radius, touching, held.impact[joint], c)
    b.margin[joint], b.approach[joint] = touch.margin, touch.approach
    return load, touch.normal, touch.overlap


@kernel
def _guide(p: Any, q: Any, b: Any, held: Any, c: Any) -> Any:
    """Force of a guide with clearance on the piston (x, y, turning), peak normal force, overlap."""
    f_x, f_y, moment, peak, deepest = 0.0, 0.0, 0.0, 0.0, 0.0
    sin_t, cos_t = sine_cosine(p.tilt)
    for end in range(2):
        i, j = GUIDE + end, GUIDE + 2 + end  # upper and lower corner
        drag, push, turn, upper, lower = guide_end(
            p,
            q,
            2.0 * end - 1.0,
            sin_t,
            cos_t,
            held.touching[i] != 0,
            held.impact[i],
            held.touching[j] != 0,
            held.impact[j],
            c,
        )
        b.margin[i], b.approach[i] = upper.margin, upper.approach
        b.margin[j], b.approach[j] = lower.margin, lower.approach
        f_x, f_y, moment = f_x + drag, f_y + push, moment + turn
        peak = max(peak, upper.normal)
        deepest = max(max(deepest, upper.overlap), lower.overlap)
    return f_x, f_y, moment, peak, deepest


@kernel
def _pressure(k: int, w: Any, row: int, share: float, t: Any) -> Any:
    """Pressure on the piston, and the mass of the liquid that moves with it."""
    q, held = t.throws[k], w.held[k]
    if q.pressure_rung == PRESSURE_CHAMBER:
        before, after = held.pressure[0], held.pressure[1]
        return before + share * (after - before), 0.0
    angle = w.crank[row, ANGLE] + q.phase
    return line_pressure(angle, w.crank[row, SPEED], w.stage[row, k].y[PISTON_X_RATE], t.liquid[k])


@kernel
def _throw(k: int, w: Any, row: int, share: float, t: Any) -> None:
    """Rates and forces of one throw at constant crank speed, and per crank acceleration."""
    q, m, b, held = t.throws[k], t.machine, w.stage[row, k], w.held[k]
    p, omega = _pose(b), w.crank[row, SPEED]
    sin_a, cos_a = sine_cosine(w.crank[row, ANGLE] + q.phase)
    sin_b, cos_b = sine_cosine(p.beta)
    pressure, added = _pressure(k, w, row, share, t)
    on_face, inv_px = -q.piston_area * pressure, 1.0 / (q.piston_mass + added)
    at_crank = crank_offset(p, omega, q, sin_a, cos_a, sin_b, cos_b)
    pin, peak, overlap = _pin_load(
        CRANKPIN, q.crankpin_rung, q.crankpin_radius, at_crank, omega, k, b, held, t
    )
    overlap_ratio = overlap / q.crankpin_radius if q.crankpin_rung != JOINT_IDEAL else 0.0
    wrist, guide_x, guide_y, guide_moment = PinLoad(0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
    if q.wristpin_rung != JOINT_IDEAL:
        at_wrist = wrist_offset(p, q, sin_b, cos_b)
        wrist, normal, overlap = _pin_load(
            WRISTPIN, q.wristpin_rung, q.wristpin_radius, at_wrist, p.tilt_rate, k, b, held, t
        )
        peak, overlap_ratio = max(peak, normal), max(overlap_ratio, overlap / q.wristpin_radius)
    if q.guide_rung == JOINT_COMPLIANT:
        guide_x, guide_y, guide_moment, normal, overlap = _guide(
            p, q, b, held, t.contacts[k, GUIDE]
        )
        peak, overlap_ratio = max(peak, normal), max(overlap_ratio, overlap / q.guide_half_height)
    seal = seal_drag(p.piston_x_rate, pressure, q)
    rates = free_motion(
        q, m, on_face + seal, inv_px, pin, wrist, guide_x, guide_y, guide_moment, sin_b, cos_b
    )
    wrist_x, wrist_y = wrist.x, wrist.y
    if q.crankpin_rung >= JOINT_COMPLIANT and q.wristpin_rung == JOINT_IDEAL:
        rates, wrist_x, wrist_y = held_wrist(q, m, p, rates, inv_px, sin_b, cos_b, 1.0)
    for i in range(len(BODY)):
        b.rate[i] = b.y[len(BODY) + i]
    b.rate[ROD_X_RATE], b.rate[ROD_Y_RATE], b.rate[BETA_RATE] = rates.rod_x, rates.rod_y, rates.beta
    b.rate[PISTON_X_RATE], b.rate[PISTON_Y_RATE] = rates.piston_x, rates.piston_y
    b.rate[TILT_RATE] = rates.tilt
    b.force[_PIN], b.force[_PIN + 1] = pin.x, pin.y
    b.force[_WRIST], b.force[_WRIST + 1] = wrist_x, wrist_y
    b.normal, b.overlap, b.link = peak, overlap_ratio, 0.0
    crank_moment = pin.on_pin
    if q.crankpin_rung < JOINT_COMPLIANT or q.wristpin_rung == JOINT_LINK:
        crank_moment += _constrain(k, w, row, t, sin_a, cos_a, sin_b, cos_b, inv_px)
    pin_x, pin_y = b.force[_PIN], b.force[_PIN + 1]
    w.moment[0] += crank_moment + q.crank_radius * (pin_x * sin_a - pin_y * cos_a)
    b.force[_FACE], b.force[_SEAL] = on_face - added * b.rate[PISTON_X_RATE], seal
    if q.guide_rung != JOINT_COMPLIANT:  # what holds the piston up
        guide_y = b.force[_WRIST + 1] + m.gravity_y * q.piston_mass
    b.force[_GUIDE], b.force[_GUIDE + 1] = guide_x, guide_y
    if q.crankpin_rung < JOINT_COMPLIANT and m.inverse_inertia > 0.0:
        b.force_per_turn[_FACE] = -added * b.rate_per_turn[PISTON_X_RATE]
        if q.guide_rung != JOINT_COMPLIANT:
            b.force_per_turn[_GUIDE + 1] = b.force_per_turn[_WRIST + 1]


@kernel
def _equations(
    joint: int,
    n: int,
    side: float,
    k: int,
    w: Any,
    row: int,
    t: Any,
    sin_a: float,
    cos_a: float,
    sin_b: float,
    cos_b: float,
) -> int:
    """Equations of one joint from number n on: what its constraint forces must accelerate.

    A link's force has friction across it, on one side of the eye in compression (`side` 1), on
    the other in tension (-1). Returns the number of the next equation.
    """
    q, m, b, c = t.throws[k], t.machine, w.stage[row, k], t.contacts[k, joint]
    omega, b_rate = w.crank[row, SPEED], b.y[BETA_RATE]
    if joint == CRANKPIN:
        rung, arm, radius, spin = q.crankpin_rung, q.rod_arm, q.crankpin_radius, omega
        d_x, d_y, v_x, v_y = crank_offset(_pose(b), omega, q, sin_a, cos_a, sin_b, cos_b)
        pull = q.crank_radius * omega * omega
        apart_x, apart_y = -pull * cos_a, -pull * sin_a
        turn_x, turn_y = -q.crank_radius * sin_a, q.crank_radius * cos_a
    else:
        rung, arm, radius, spin = q.wristpin_rung, -q.rod_centre, q.wristpin_radius, b.y[TILT_RATE]
        d_x, d_y, v_x, v_y = wrist_offset(_pose(b), q, sin_b, cos_b)
        apart_x, apart_y = b.rate[PISTON_X_RATE], b.rate[PISTON_Y_RATE]
        turn_x, turn_y = 0.0, 0.0
    apart_x -= b.rate[ROD_X_RATE] + arm * (b.rate[BETA_RATE] * sin_b + b_rate * b_rate * cos_b)
    apart_y -= b.rate[ROD_Y_RATE] + arm * (b.rate[BETA_RATE] * cos_b - b_rate * b_rate * sin_b)
    if rung == JOINT_IDEAL:
        for i in range(2):  # along x, then along y
            x, y = 1.0 - i, 1.0 * i
            w.place[n + i, AT_JOINT], w.place[n + i, RUBBING] = joint, 0.0
            w.place[n + i, ALONG_X], w.place[n + i, ALONG_Y] = x, y
            w.place[n + i, NORMAL_X], w.place[n + i, NORMAL_Y] = x, y
        w.matrix[n, SIZE] = apart_x + held_back(d_x, v_x, m)
        w.matrix[n + 1, SIZE] = apart_y + held_back(d_y, v_y, m)
        w.matrix[n, SIZE_PER_TURN], w.matrix[n + 1, SIZE_PER_TURN] = turn_x, turn_y
        return n + 2
    distance, speed, n_x, n_y = polar(d_x, d_y, v_x, v_y)
    swing = v_y * n_x - v_x * n_y
    sliding = swing + radius * spin + (radius + c.clearance) * b_rate
    share = side * (friction_force(sliding, 1.0, c) - c.tangential_damping * sliding)
    w.place[n, AT_JOINT], w.place[n, RUBBING] = joint, share
    w.place[n, ALONG_X], w.place[n, ALONG_Y] = n_x - share * n_y, n_y + share * n_x
    w.place[n, NORMAL_X], w.place[n, NORMAL_Y] = n_x, n_y
    across = swing * swing / distance
    back = held_back(distance - c.clearance, speed, m)
    w.matrix[n, SIZE] = apart_x * n_x + apart_y * n_y + across + back
    w.matrix[n, SIZE_PER_TURN] = turn_x * n_x + turn_y * n_y
    return n + 1


@kernel
def _unit_swing(j: int, k: int, w: Any, t: Any, sin_b: float, cos_b: float) -> Any:
    """Angular acceleration of the rod per unit of constraint force j."""
    q, crank = t.throws[k], w.place[j, AT_JOINT] == CRANKPIN
    arm = q.rod_arm if crank else -q.rod_centre
    radius = q.crankpin_radius if crank else q.wristpin_radius
    eye = radius + t.contacts[k, CRANKPIN if crank else WRISTPIN].clearance
    along = w.place[j, ALONG_X] * sin_b + w.place[j, ALONG_Y] * cos_b
    return (arm * along - eye * w.place[j, RUBBING]) * q.inverse_rod_inertia


@kernel
def _mobilities(n: int, k: int, w: Any, t: Any, sin_b: float, cos_b: float, inv_px: float) -> None:
    """What every unit constraint force does to every equation."""
    q = t.throws[k]
    for j in range(n):
        u_x, u_y = w.place[j, ALONG_X], w.place[j, ALONG_Y]
        swing = _unit_swing(j, k, w, t, sin_b, cos_b)
        for i in range(n):
            reach = q.rod_arm if w.place[i, AT_JOINT] == CRANKPIN else -q.rod_centre
            e_x = u_x * q.inverse_rod_mass + reach * swing * sin_b
            e_y = u_y * q.inverse_rod_mass + reach * swing * cos_b
            if w.place[j, AT_JOINT] == WRISTPIN and w.place[i, AT_JOINT] == WRISTPIN:
                e_x += u_x * inv_px
                e_y += u_y * q.inverse_piston_across
            w.matrix[i, j] = e_x * w.place[i, NORMAL_X] + e_y * w.place[i, NORMAL_Y]


@kernel
def _add_force(
    size: float, j: int, k: int, rate: Any, force: Any, w: Any, t: Any, swing: float, inv_px: float
) -> Any:
    """Add constraint force j to rates and forces of a throw; its friction's moment on the crank."""
    q = t.throws[k]
    f_x, f_y, rub = (
        size * w.place[j, ALONG_X],
        size * w.place[j, ALONG_Y],
        size * w.place[j, RUBBING],
    )
    rate[ROD_X_RATE] += f_x * q.inverse_rod_mass
    rate[ROD_Y_RATE] += f_y * q.inverse_rod_mass
    rate[BETA_RATE] += size * swing
    if w.place[j, AT_JOINT] == CRANKPIN:
        force[_PIN] += f_x
        force[_PIN + 1] += f_y
        return -q.crankpin_radius * rub
    force[_WRIST] += f_x
    force[_WRIST + 1] += f_y
    rate[PISTON_X_RATE] -= f_x * inv_px
    rate[PISTON_Y_RATE] -= f_y * q.inverse_piston_across
    rate[TILT_RATE] -= q.wristpin_radius * rub * q.inverse_piston_tilt
    return 0.0


@kernel
def _constrain(
    k: int,
    w: Any,
    row: int,
    t: Any,
    sin_a: float,
    cos_a: float,
    sin_b: float,
    cos_b: float,
    inv_px: float,
) -> Any:
    """Add the constraint forces of ideal joints and links; their friction's moment on the crank.

    Unknowns are forces along given directions at either end of the rod; the equations ask the
    relative acceleration of pin and eye to be what keeps them together.
    """
    q, m, b = t.throws[k], t.machine, w.stage[row, k]
    least, at_pin, at_wrist, n = 1.0, 1.0, 1.0, 0
    for _ in range(4):  # until every link has its friction on the side that its sign asks for
        n = 0
        if q.crankpin_rung < JOINT_COMPLIANT:
            n = _equations(CRANKPIN, n, at_pin, k, w, row, t, sin_a, cos_a, sin_b, cos_b)
        if q.wristpin_rung < JOINT_COMPLIANT:
            n = _equations(WRISTPIN, n, at_wrist, k, w, row, t, sin_a, cos_a, sin_b, cos_b)
        _mobilities(n, k, w, t, sin_b, cos_b, inv_px)
        _eliminate(w, n)
        least, was_pin, was_wrist = 1.0, at_pin, at_wrist
        if q.crankpin_rung == JOINT_LINK:  # the first equation
            least = min(least, w.matrix[0, SIZE])
            at_pin = -1.0 if w.matrix[0, SIZE] < 0.0 else 1.0
        if q.wristpin_rung == JOINT_LINK:  # the last one
            least = min(least, w.matrix[n - 1, SIZE])
            at_wrist = -1.0 if w.matrix[n - 1, SIZE] < 0.0 else 1.0
        if at_pin == was_pin and at_wrist == was_wrist:
            break
    b.link = min(least, 0.0)
    per_turn = m.inverse_inertia > 0.0 and q.crankpin_rung < JOINT_COMPLIANT
    if per_turn:
        for c in range(len(BODY), PER_THROW):
            b.rate_per_turn[c] = 0.0
        for c in range(_VALVES):
            b.force_per_turn[c] = 0.0
    moment, rubbing = 0.0, 0.0
    for j in range(n):
        swing = _unit_swing(j, k, w, t, sin_b, cos_b)
        moment += _add_force(w.matrix[j, SIZE], j, k, b.rate, b.force, w, t, swing, inv_px)
        if per_turn:
            more = w.matrix[j, SIZE_PER_TURN]
            rubbing += _add_force(
                more, j, k, b.rate_per_turn, b.force_per_turn, w, t, swing, inv_px
            )
    if per_turn:
        along, across = b.force_per_turn[_PIN], b.force_per_turn[_PIN + 1]
        w.moment[1] += rubbing + q.crank_radius * (along * sin_a - across * cos_a)
    return moment


@kernel
def _eliminate(w: Any, n: int) -> None:
    """Gauss elimination in place; the solutions replace columns 4 and 5."""
    for i in range(n):
        inverse = 1.0 / w.matrix[i, i]
        for r in range(i + 1, n):
            factor = w.matrix[r, i] * inverse
            for column in range(i + 1, n):
                w.matrix[r, column] -= factor * w.matrix[i, column]
            w.matrix[r, SIZE] -= factor * w.matrix[i, SIZE]
            w.matrix[r, SIZE_PER_TURN] -= factor * w.matrix[i, SIZE_PER_TURN]
    for i in range(n - 1, -1, -1):
        for column in range(i + 1, n):
            w.matrix[i, SIZE] -= w.matrix[i, column] * w.matrix[column, SIZE]
            w.matrix[i, SIZE_PER_TURN] -= w.matrix[i, column] * w.matrix[column, SIZE_PER_TURN]
        w.matrix[i, SIZE] /= w.matrix[i, i]
        w.matrix[i, SIZE_PER_TURN] /= w.matrix[i, i]


@kernel
def derivative_of_record(w: Any, row: int, share: float, t: Any) -> None:
    """Rates, forces and margins at the state of a row; `share` of the step has passed."""
    m = t.machine
    w.moment[0] = w.moment[1] = 0.0
    for k in range(t.throws.shape[0]):
        _throw(k, w, row, share, t)
    w.crank[row, ANGLE_RATE], w.crank[row, SPEED_RATE] = w.crank[row, SPEED], 0.0
    sin_a, cos_a = sine_cosine(w.crank[row, ANGLE] + t.throws[0].phase)
    load = crank_load(w.moment[0], sin_a, cos_a, m)
    w.crank[row, MOMENT] = -load
    if m.inverse_inertia == 0.0:
        return
    drive = motor_moment(w.crank[row, SPEED], m)
    turning = m.inverse_inertia * (drive + load) / (1.0 - m.inverse_inertia * w.moment[1])
    w.crank[row, SPEED_RATE] = turning
    w.crank[row, MOMENT] = drive
    for k in range(t.throws.shape[0]):
        if t.throws[k].crankpin_rung >= JOINT_COMPLIANT:
            continue
        b = w.stage[row, k]
        for c in range(len(BODY), PER_THROW):
            b.rate[c] += turning * b.rate_per_turn[c]
        for c in range(_VALVES):
            b.force[c] += turning * b.force_per_turn[c]


@kernel
def _hermite(
    before: float, rate_before: float, after: float, rate_after: float, h: float, s: float
) -> float:
    """Cubic through both ends of a step, a fraction s into it."""
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * before + s * h * rate_before) + s * s * (
        (1.0 + 2.0 * r) * after - r * h * rate_after
    )


@kernel
def _interpolate(k: int, w: Any, i: int, h: float, s: float) -> None:
    """State of crank and one throw a fraction s into the step from row i, into row 2."""
    y, z = w.crank, 1 - i
    for c in range(2):
        y[2, c] = _hermite(y[i, c], y[i, 2 + c], y[z, c], y[z, 2 + c], h, s)
    here, before, after = w.stage[2, k], w.stage[i, k], w.stage[z, k]
    for c in range(PER_THROW):
        here.y[c] = _hermite(before.y[c], before.rate[c], after.y[c], after.rate[c], h, s)


@kernel
def _locate_change(k: int, j: int, w: Any, i: int, h: float, t: Any) -> Any:
    """Fraction of the step at which one contact changes: Illinois on the dense output."""
    low, high = 0.0, 1.0
    f_low, f_high = w.stage[i, k].margin[j], w.stage[1 - i, k].margin[j]
    share = 0.5
    while f_low <= 0.0:  # changed just now, at rounding: it must hold before it changes again
        if share < 1e-4:
            return 0.0  # it never holds: it asks for the change at once
        _interpolate(k, w, i, h, share)
        low, f_low = share, _contact_margin(k, j, w, 2, t)
        share *= 0.5
    for _ in range(60):
        s = high - f_high * (high - low) / (f_high - f_low)
        _interpolate(k, w, i, h, s)
        f = _contact_margin(k, j, w, 2, t)
        if f > 0.0:
            low, f_low = s, f
            f_high *= 0.5
        else:
            high, f_high = s, f
            f_low *= 0.5
        if abs(f) < 1e-9:
            return s
        if high - low < 1e-12:
            break
    return high


@kernel
def _first_change(w: Any, i: int, h: float, locate: bool, t: Any) -> Any:
    """Earliest contact that asks for a change within the step: when, throw (-1: none), contact."""
    first, throw, contact = 1.0, -1, 0
    for k in range(t.throws.shape[0]):
        after = w.stage[1 - i, k]
        for j in range(CONTACTS):
            if after.margin[j] < 0.0:
                share = _locate_change(k, j, w, i, h, t) if locate else 1.0
                if throw < 0 or share < first:
                    first, throw, contact = share, k, j
    return first, throw, contact


@kernel
def _advance(w: Any, row: int, i: int, share: float, slope: int) -> None:
    """State of a row: that of row i moved along the rates of row `slope` over `share` [s]."""
    for c in range(2):
        w.crank[row, c] = w.crank[i, c] + share * w.crank[slope, 2 + c]
    for k in range(w.stage.shape[1]):
        here, start, rate = w.stage[row, k], w.stage[i, k], w.stage[slope, k]
        for c in range(PER_THROW):
            here.y[c] = start.y[c] + share * rate.rate[c]
        for c in range(len(FILM)):
            here.film[c] = start.film[c] + share * rate.film_rate[c]


@kernel
def mean_of_stages(first: float, middle: float, last: float) -> float:
    """Six times the weighted mean of the four stages of a step, `middle` the sum of two."""
    return first + 2.0 * middle + last


@kernel
def _finish(w: Any, i: int, h: float) -> None:
    """State at the end of the step from row i, by the weighted mean of the four rates."""
    sixth, y = h / 6.0, w.crank
    for c in range(2):
        rate = mean_of_stages(y[i, 2 + c], y[2, 2 + c] + y[3, 2 + c], y[4, 2 + c])
        y[1 - i, c] = y[i, c] + sixth * rate
    for k in range(w.stage.shape[1]):
        end, a, b = w.stage[1 - i, k], w.stage[i, k], w.stage[2, k]
        c_, d = w.stage[3, k], w.stage[4, k]
        for c in range(PER_THROW):
            end.y[c] = a.y[c] + sixth * mean_of_stages(a.rate[c], b.rate[c] + c_.rate[c], d.rate[c])
        for c in range(len(FILM)):
            rate = mean_of_stages(a.film_rate[c], b.film_rate[c] + c_.film_rate[c], d.film_rate[c])
            end.film[c] = a.film[c] + sixth * rate


@kernel
def _stages(w: Any, i: int, h: float, passed: float, whole: float, fresh: bool, t: Any) -> None:
    """Runge-Kutta from row i to the other over `h`, with the contacts held as they are.

    `passed` of the `whole` step lie behind. The derivative at the start is made anew unless it is
    `fresh`; that at the end is left for the next step.
    """
    for stage in range(1 if fresh else 0, 5):
        row, share = i, 0.0
        if stage == 4:
            row, share = 1 - i, 1.0
            _finish(w, i, h)
        elif stage > 0:
            row = 1 + stage
            share = 1.0 if stage == 3 else 0.5
            _advance(w, row, i, share * h, i if stage == 1 else stage)
        derivative_of_record(w, row, (passed + share * h) / whole, t)


@kernel
def _flip(k: int, j: int, w: Any, i: int, t: Any) -> int:
    """Open or close one contact; 1 where it closed more slowly than its law's floor."""
    held = w.held[k]
    held.touching[j] = 1 - held.touching[j]
    if held.touching[j] == 0:
        return 0
    held.impact[j] = max(w.stage[i, k].approach[j], 0.0)
    c = t.contacts[k, min(j, GUIDE)]
    return 1 if c.law != LAW_CONSTANT_LOSS and held.impact[j] < c.speed_floor else 0


@kernel
def _change(throw: int, contact: int, w: Any, i: int, t: Any, tally: Any) -> None:
    """Change a contact, and all that ask for it at the same instant.

    Both corners of a piston that stands straight do: one of them left for later would be late by
    what is left of the step.
    """
    for k in range(t.throws.shape[0]):
        for j in range(CONTACTS):
            if (k == throw and j == contact) or w.stage[i, k].margin[j] < 0.0:
                tally.counts[CHANGES] += 1
                tally.counts[FLOORED] += _flip(k, j, w, i, t)


@kernel
def _record_forces(w: Any, i: int, weight: float, forces: Any, step: int, tally: Any) -> None:
    """Add the impulse of one part of the step to the step's mean forces."""
    y = w.crank
    forces[step, 0] += weight * mean_of_stages(
        y[i, MOMENT], y[2, MOMENT] + y[3, MOMENT], y[4, MOMENT]
    )
    for k in range(w.stage.shape[1]):
        a, b, c, d = w.stage[i, k], w.stage[2, k], w.stage[3, k], w.stage[4, k]
        f = 1 + len(FORCES) * k
        for n in range(_VALVES):
            forces[step, f + n] += weight * mean_of_stages(
                a.force[n], b.force[n] + c.force[n], d.force[n]
            )
        tally.peak[0] = max(tally.peak[0], max(a.normal, max(b.normal, c.normal)))


@kernel
def step_of_record(
    w: Any, i: int, h: float, fresh: bool, tried: bool, t: Any, forces: Any, step: int, tally: Any
) -> Any:
    """One whole step, cut wherever a contact closes or opens.

    A step that was `tried` without a cut stands in the other row, and a contact asks for one.
    Returns the row it ended in, and whether that row's derivative is fresh.
    """
    left, taken, cuts, k, j = h, h, 0, -1, 0
    while left > 0.0:
        if not tried:
            _stages(w, i, taken, h - left, h, fresh, t)
        fresh, tried = True, False
        if k < 0:  # not yet cut
            locate = cuts < _MOST_CUTS * t.throws.shape[0]
            share, k, j = _first_change(w, i, taken, locate, t)
            if k >= 0 and locate:
                taken *= share
                cuts += 1
                continue
            tally.counts[NOT_LOCATED] += k >= 0
        _record_forces(w, i, taken / (6.0 * h), forces, step, tally)
        i = 1 - i
        if k >= 0:
            _change(k, j, w, i, t, tally)
            fresh, k = False, -1
        left = 0.0 if taken == left else left - taken
        taken = left
    return i, fresh


@kernel
def breathe(
    chamber: Any, held: Any, liquid: Any, h: float, x: float, v: float, substeps: int
) -> Any:
    """Step one chamber along its piston's path: fault, and its pressure at both ends of the next.

    The pressure [Pa] is extrapolated: the mechanism steps first.
    """
    last = chamber[0]
    fault = chamber_step(chamber, held.flow, liquid, h, chamber[6], chamber[7], x, v, substeps)
    chamber[6], chamber[7] = x, v
    return fault, chamber[0], 2.0 * chamber[0] - last


@kernel
def _breathe(w: Any, i: int, h: float, t: Any, chamber: Any, forces: Any, step: int) -> int:
    """Step every chamber along its piston's path; its pressure for the next step."""
    fault = 0
    for k in range(t.throws.shape[0]):
        q, b, held = t.throws[k], w.stage[i, k], w.held[k]
        if q.pressure_rung != PRESSURE_CHAMBER:
            continue
        x, v = b.y[PISTON_X], b.y[PISTON_X_RATE]
        own, before, after = breathe(chamber[k], held, t.liquid[k], h, x, v, q.substeps)
        fault += own
        held.pressure[0], held.pressure[1] = before, after
        f = 1 + len(FORCES) * k
        forces[step, f + _VALVES] = held.flow[2] / h
        forces[step, f + _VALVES + 1] = held.flow[3] / h
    return fault


@kernel
def _try_chambers(w: Any, i: int, h: float, t: Any, chamber: Any, shared: Any) -> Any:
    """Step every chamber under the lines' pressures that are tried: fault, and both volumes.

    The trials hold the outcome; volumes [m^3] as of ``CHAMBER_FLOWS``, of all throws.
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
def _breathe_on_lines(
    w: Any, i: int, h: float, t: Any, chamber: Any, shared: Any, forces: Any, step: int
) -> int:
    """Step all chambers and both lines together; pressures for the next step."""
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
        forces[step, f + _VALVES] = held.flow[2] / h
        forces[step, f + _VALVES + 1] = held.flow[3] / h
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
    return 0 if math.isfinite(total) else 1


CHANGES, NOT_LOCATED, FLOORED, IN_TENSION, WITH_VAPOUR = range(5)
"""What a run counts: contacts that closed or opened; steps with more than could be located;
closings below the law's speed floor; steps with a link in tension; steps with vapour."""


class _Record(NamedTuple):
    """What a run leaves behind; the last four have one row where they are not needed."""

    turns: NDArray[np.float64]  # (n_steps + 1, 2): crank angle and speed
    forces: NDArray[np.float64]  # (n_steps, 1 + n_throws * len(FORCES))
    states: NDArray[np.float64]  # (n_steps + 1, n_throws, PER_THROW)
    chambers: NDArray[np.float64]  # (n_steps + 1, n_throws, 8)
    gaps: NDArray[np.float64]  # (n_steps + 1, n_throws, len(GAPS))
    ends: NDArray[np.float64]  # (n_steps + 1, 2): pressures of the lines at the pump


class Tally(NamedTuple):
    """What a run counts, see :data:`CHANGES`."""

    counts: NDArray[np.int64]  # (5,)
    peak: NDArray[np.float64]  # (1,): largest normal force


@kernel
def _is_compliant(q: Any, j: int) -> Any:
    rung = q.crankpin_rung if j == CRANKPIN else q.wristpin_rung if j == WRISTPIN else q.guide_rung
    return rung == JOINT_COMPLIANT


@kernel
def begin(w: Any, t: Any, chamber: Any) -> bool:
    """Contacts closed from the start, chambers; true where any chamber breathes."""
    breathing = False
    for k in range(t.throws.shape[0]):
        q, b, held = t.throws[k], w.stage[0, k], w.held[k]
        breathing |= q.pressure_rung == PRESSURE_CHAMBER
        chamber[k, 6], chamber[k, 7] = b.y[PISTON_X], b.y[PISTON_X_RATE]
        held.pressure[0] = held.pressure[1] = chamber[k, 0]
        for j in range(CONTACTS):
            for row in range(5):
                w.stage[row, k].margin[j] = NO_CHANGE
            if _is_compliant(q, j):  # closed is what would close if it were open
                held.touching[j] = 1 if _contact_margin(k, j, w, 0, t) < 0.0 else 0
    return breathing


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


@kernel
def of_mode(
    force: float, place: float, speed: float, per_force: float, per_place: float, per_speed: float
) -> float:
    """Mean acceleration of a mode over a step, or its place after it.

    Both are exact for a force that is even over the step, however far the mode turns in it.
    """
    return per_force * force + per_place * place + per_speed * speed


@kernel
def settled(
    now: float, other: float, felt_now: float, felt_other: float, own: float, cross: float
) -> float:
    """Acceleration of a bearing had what it carries felt just that [m/s^2].

    What is held to a bearing pushes back by its mass as soon as it feels an acceleration:
    `a = a_0 - G a_felt`, and `a = (1 + G)^-1 a_0` had it felt that. Here it is from what was felt:
    `a + (1 + G)^-1 G (a_felt - a)`.

    Parameters
    ----------
    now, felt_now : float
        One way: by the forces of the step, and what the mechanism felt in it.
    other, felt_other : float
        The same of the other way.
    own, cross : float
        Entries of `(1 + G)^-1 G`.
    """
    return now + own * (felt_now - now) + cross * (felt_other - other)


@kernel
def carried_on(now: float, before: float, earlier: float) -> float:
    """Acceleration over the next step, along the parabola through the last three [m/s^2].

    Held as it was it would lag by a step, and feed the casing (0.6 dB across a bilge pump's stroke
    at 20 us); along a line it leaves twice as much in the bands of the knocks as it does.
    """
    return 3.0 * (now - before) + earlier


@kernel
def _on_moving_bearing(
    y: Any, moved: Any, ridden: Any, forces: Any, step: int, h: float, weight: Any, t: Any
) -> Any:
    """Tables for the next step: what turns is heavier by how the casing accelerates its bearing.

    In the frame of a bearing that moves, every mass feels its acceleration as more weight. Forces
    are means over the step before; `weight` is that at rest, along and across; `ridden` holds what
    was felt in it, and the bearing's acceleration in the two steps before that. What felt another
    acceleration than the bearing had pushes on the modes by its mass times what it was late by.
    """
    along, across = 0.0, 0.0
    for mode in range(y.react.shape[0]):
        force = 0.0
        for k in range(y.push.shape[1]):
            own = 0.0
            for n in range(len(PUSHES)):
                own += y.push[mode, k, n] * forces[step, 1 + len(FORCES) * k + PUSHES[n]]
            force += own
        r = y.react[mode]
        a = of_mode(force, moved[mode, 0], moved[mode, 1], r[0], r[1], r[2])
        moved[mode, 2] = force
        along += y.give[mode, 0] * a
        across += y.give[mode, 1] * a
    b, was, last, older = y.blend, ridden[0], ridden[1], ridden[2]
    now_x = settled(along, across, was[0], was[1], b[0, 0], b[0, 1])
    now_y = settled(across, along, was[1], was[0], b[1, 1], b[1, 0])
    late_x, late_y = was[0] - now_x, was[1] - now_y
    for mode in range(y.react.shape[0]):
        r, to, q, v = y.react[mode], y.reach[mode], moved[mode, 0], moved[mode, 1]
        force = moved[mode, 2] + y.held[mode, 0] * late_x + y.held[mode, 1] * late_y
        moved[mode, 0] = of_mode(force, q, v, to[0], to[1], to[2])
        moved[mode, 1] = v + h * of_mode(force, q, v, r[0], r[1], r[2])
    felt_x, felt_y = carried_on(now_x, last[0], older[0]), carried_on(now_y, last[1], older[1])
    older[0], older[1] = last[0], last[1]
    last[0], last[1], was[0], was[1] = now_x, now_y, felt_x, felt_y
    m = t.machine
    machine = Machine(
        weight[0] + felt_x,
        weight[1] + felt_y,
        m.inverse_inertia,
        m.static_moment,
        m.drive_moment,
        m.synchronous_speed,
        m.breakdown_moment,
        m.breakdown_slip,
        m.baumgarte,
    )
    return Tables(t.throws, t.contacts, t.liquid, t.oils, t.maps, machine)


@kernel
def _integrate(
    h: float,
    t: Any,
    y: Any,
    moved: Any,
    ridden: Any,
    w: Any,
    chamber: Any,
    shared: Any,
    r: Any,
    tally: Any,
) -> Any:
    """March from row 0 of the scratch; returns status code and steps done."""
    weight = (t.machine.gravity_x, t.machine.gravity_y)
    breathing = begin(w, t, chamber)
    i, fresh = 0, False
    if r.gaps.shape[0] > 1:  # the films of the start are those of its derivative
        derivative_of_record(w, i, 0.0, t)
    lines = shared.lines
    _keep(w, i, chamber, lines.states, r, 0)
    for step in range(r.forces.shape[0]):
        i, fresh = step_of_record(w, i, h, fresh, False, t, r.forces, step, tally)
        code = _fault(w, i)
        if breathing:
            if lines.pipes.shape[0] > 0:
                choked = _breathe_on_lines(w, i, h, t, chamber, shared, r.forces, step)
            else:
                choked = _breathe(w, i, h, t, chamber, r.forces, step)
            if choked != 0:
                code = 4
            fresh = False  # the step felt an extrapolated pressure, the next one knows better
        for k in range(t.throws.shape[0]):
            tally.counts[IN_TENSION] += w.stage[i, k].link < 0.0
            tally.counts[WITH_VAPOUR] += chamber[k, 1] > 0.0
        if y.react.shape[0] > 0:
            t = _on_moving_bearing(y, moved, ridden, r.forces, step, h, weight, t)
            fresh = False
        _keep(w, i, chamber, lines.states, r, step + 1)
        if code != 0:
            return code, step + 1
    return 0, r.forces.shape[0]


@dataclass(frozen=True, kw_only=True)
class CrankTally:
    """How a run of the mechanism went.

    Attributes
    ----------
    steps : int
        That were taken.
    step : float
        [s]
    status : Status
        How the run ended.
    peak_normal_force : float
        Largest contact force met inside the steps [N].
    contact_changes, cuts_refused : int
        Closings plus openings; steps with more than could be located.
    floored_closings : int
        Contacts that closed more slowly than the speed floor of their law.
    tension_steps : int
        Steps at whose end a massless link was in tension: contact would be lost.
    vapour_steps : int
        Steps, summed over throws, at whose end a chamber held vapour.
    parted_steps, unsettled_steps : tuple of int
        Steps in which suction and discharge line held vapour; steps in which no pressure was found
        at which they give what the pump draws, and the rest was booked.
    """

    steps: int
    step: float
    peak_normal_force: float
    status: Status = Status.OK
    contact_changes: int = 0
    cuts_refused: int = 0
    floored_closings: int = 0
    tension_steps: int = 0
    vapour_steps: int = 0
    parted_steps: tuple[int, ...] = ()
    unsettled_steps: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class CrankRun(CrankTally):
    """A run of the mechanism with all its steps.

    Attributes
    ----------
    turns : numpy.ndarray [shape=(n_steps + 1, 2)]
        Crank angle [rad] and speed [rad/s] at the ends of the steps.
    forces : numpy.ndarray [shape=(n_steps, 1 + 9 n_throws)]
        Drive moment [N m], then per throw the columns of :data:`FORCES` [N], means over each step.
    bodies : numpy.ndarray [shape=(n_steps + 1, n_throws, 12)] or None
        Columns as :data:`BODY`, then their rates, at the ends of the steps; the state in the
        middle of a step, to which its forces belong, is the mean of two rows. None where not kept.
    chambers : numpy.ndarray [shape=(n_steps + 1, n_throws, 6)] or None
        Columns as ``CHAMBER_STATE``; None where nothing breathes.
    gaps : numpy.ndarray [shape=(n_steps + 1, n_throws, 4)] or None
        Columns as :data:`GAPS`, at the starts of the steps' last stage; None where no pin is oiled.
    ends : numpy.ndarray [shape=(n_steps + 1, 2)] or None
        Pressure [Pa] of suction and discharge line at the pump, means over the steps before; None
        where no line is modelled.
    """

    turns: NDArray[np.float64]
    forces: NDArray[np.float64]
    bodies: NDArray[np.float64] | None
    chambers: NDArray[np.float64] | None
    gaps: NDArray[np.float64] | None = None
    ends: NDArray[np.float64] | None = None

    def force(self, name: str, throw: int = 0) -> NDArray[np.float64]:
        """One column of the forces, by its name in :data:`FORCES` [N]."""
        return self.forces[:, 1 + len(FORCES) * throw + FORCES.index(name)]


_NO_LINES = LinePair(
    pipes=np.zeros(0, PIPE),
    states=np.zeros(0, PIPE_STATE),
    suction_nodes=np.zeros((4, 1)),
    discharge_nodes=np.zeros((4, 1)),
)


def run_mechanism(
    t: Tables,
    *,
    angle: float,
    speed: float,
    bodies: NDArray[np.float64],
    step: float,
    n_steps: int,
    chambers: NDArray[np.float64] | None = None,
    films: NDArray[np.float64] | None = None,
    lines: LinePair | None = None,
    casing: Yielding = AT_REST,
    keep_states: bool = True,
) -> CrankRun:
    """Integrate the mechanism with contact in its clearances.

    Parameters
    ----------
    t : Tables
        Validated by the scene; a kernel trusts it.
    angle, speed : float
        Of the crank at the start [rad], [rad/s].
    bodies : numpy.ndarray [shape=(n_throws, 12)]
        Columns as :data:`BODY`, then their rates. What ideal joints and links hold together must
        be together.
    step : float
        [s]
    n_steps : int
        Steps to take.
    chambers : numpy.ndarray [shape=(n_throws, 6)], optional
        State of the chambers at the start.
    films : numpy.ndarray [shape=(n_throws, 4)], optional
        Columns as :data:`FILM`, at the start; inside the clearances.
    lines : LinePair, optional
        Shared by the chambers of all throws, each of which then breathes; replaced by their state
        at the end.
    casing : Yielding
        On which the main bearing moves; bodies are seen from there.
    keep_states : bool
        Keep the bodies at the ends of all steps.

    Returns
    -------
    CrankRun
        Cut off at the step in which it failed where the status is not OK.
    """
    n = len(t.throws)
    rows = n_steps + 1 if keep_states else 1
    breathing = bool(np.any(t.throws["pressure_rung"] == PRESSURE_CHAMBER))
    oiled = bool(
        np.any(t.throws["crankpin_rung"] == JOINT_OILED)
        or np.any(t.throws["wristpin_rung"] == JOINT_OILED)
    )
    w = Work(
        crank=np.zeros((5, 5)),
        stage=np.zeros((5, n), STAGE),
        held=np.zeros(n, HELD),
        moment=np.zeros(2),
        matrix=np.zeros((4, 6)),
        place=np.zeros((4, 6)),
    )
    shared = _Shared(
        lines=_NO_LINES if lines is None else lines,
        pairs=np.zeros(1, PAIR),
        trials=np.zeros((n, 6)),
    )
    if lines is not None:  # the pressures before and after the valves are those of the lines
        t = t._replace(liquid=t.liquid.copy())
    w.crank[0, ANGLE], w.crank[0, SPEED] = angle, speed
    w.stage["y"][0] = bodies
    if films is not None:
        w.stage["film"][0] = films
    chamber = np.zeros((n, 8))
    if chambers is not None:
        chamber[:, :6] = chambers
    r = _Record(
        turns=np.empty((n_steps + 1, 2)),
        forces=np.zeros((n_steps, 1 + n * len(FORCES))),
        states=np.empty((rows, n, PER_THROW)),
        chambers=np.empty((n_steps + 1 if breathing else 1, n, 8)),
        gaps=np.zeros((n_steps + 1 if oiled else 1, n, len(GAPS))),
        ends=np.zeros((n_steps + 1 if lines else 1, 2)),
    )
    tally = Tally(counts=np.zeros(5, np.int64), peak=np.zeros(1))
    moved, ridden = np.zeros((len(casing.react), 3)), np.zeros((3, 2))
    code, done = _integrate(step, t, casing, moved, ridden, w, chamber, shared, r, tally)
    return CrankRun(
        steps=done,
        turns=r.turns[: done + 1],
        forces=r.forces[:done],
        bodies=r.states[: done + 1] if keep_states else None,
        chambers=r.chambers[: done + 1, :, :6] if breathing else None,
        gaps=r.gaps[: done + 1] if oiled else None,
        ends=r.ends[: done + 1] if lines else None,
        step=step,
        status=Status(code),
        peak_normal_force=float(tally.peak[0]),
        contact_changes=int(tally.counts[CHANGES]),
        cuts_refused=int(tally.counts[NOT_LOCATED]),
        floored_closings=int(tally.counts[FLOORED]),
        tension_steps=int(tally.counts[IN_TENSION]),
        vapour_steps=int(tally.counts[WITH_VAPOUR]),
        parted_steps=tuple(int(steps) for steps in shared.lines.states["parted"]),
        unsettled_steps=tuple(int(steps) for steps in shared.lines.states["unsettled"]),
    )
