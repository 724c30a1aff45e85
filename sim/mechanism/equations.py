"""Equations of motion of all throws: forces of the joints, constraints, accelerations."""

import math
from typing import Any

from ..hydraulics.parameters import PRESSURE_CHAMBER
from ..hydraulics.piston_pressure import line_pressure
from ..jit import kernel, sine_cosine
from .constraints import constrain
from .elastic_rod import eye_turn, flexed, from_bent_eye, is_elastic, spun_up_rods
from .layout import (
    ANGLE,
    ANGLE_RATE,
    BETA_RATE,
    BODY,
    CRANKPIN,
    FACE_FORCE,
    GUIDE,
    GUIDE_FORCE,
    JOINT_COMPLIANT,
    JOINT_IDEAL,
    JOINT_LINK,
    JOINT_OILED,
    MOMENT,
    PER_THROW,
    PIN_FORCE,
    PISTON_X_RATE,
    PISTON_Y_RATE,
    ROD_X_RATE,
    ROD_Y_RATE,
    SEAL_FORCE,
    SPEED,
    SPEED_RATE,
    TILT_RATE,
    VALVE_FORCES,
    WRIST_FORCE,
    WRISTPIN,
    pose_of,
)
from .main_bearing import journal_motion, spun_up, with_play
from .oiled_joint import oiled_joint
from .throw_motion import (
    PinLoad,
    crank_load,
    crank_offset,
    dry_pin,
    free_motion,
    guide_end,
    held_wrist,
    link_drag,
    motor_moment,
    seal_drag,
    slot_moment,
    worn_eye,
    wrist_offset,
)


@kernel
def _oiled(
    joint: int,
    d_x: float,
    d_y: float,
    v_x: float,
    v_y: float,
    pin_turn: float,
    eye: float,
    k: int,
    b: Any,
    held: Any,
    t: Any,
) -> Any:
    """Load of an oiled pin on the rod, and the magnitude of its force."""
    n = 2 * joint
    f_x, f_y, on_pin, on_eye, rate_x, rate_y, gap, peaks = oiled_joint(
        b.film[n],
        b.film[n + 1],
        d_x,
        d_y,
        v_x,
        v_y,
        pin_turn,
        -eye,
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
    eye: float,
    k: int,
    b: Any,
    held: Any,
    t: Any,
) -> Any:
    """Load of a pin on the rod for rungs with a force, the normal force, and the overlap.

    `eye` is the angular velocity of its eye, in the sense of the rod's angle [rad/s]. A link's load
    is its viscous part; an ideal joint has none.
    """
    if rung == JOINT_IDEAL:
        return PinLoad(0.0, 0.0, 0.0, 0.0), 0.0, 0.0
    d_x, d_y, v_x, v_y = offset
    c = t.contacts[k, joint]
    if rung == JOINT_OILED:
        load, peak = _oiled(joint, d_x, d_y, v_x, v_y, pin_turn, eye, k, b, held, t)
        return load, peak, math.sqrt(d_x * d_x + d_y * d_y) - c.clearance
    spin = pin_turn * radius + eye * (radius + c.clearance)
    if rung == JOINT_LINK:
        f_x, f_y, rub = link_drag(d_x, d_y, v_x, v_y, spin, c)
        return PinLoad(f_x, f_y, -radius * rub, (radius + c.clearance) * rub), 0.0, 0.0
    touching = held.touching[joint] != 0
    load, touch = dry_pin(d_x, d_y, v_x, v_y, spin, radius, touching, held.impact[joint], c)
    b.margin[joint], b.approach[joint] = touch.margin, touch.approach
    return load, touch.normal, touch.overlap


@kernel
def _guide(p: Any, q: Any, b: Any, held: Any, c: Any) -> Any:
    """Force of a guide with clearance on the piston (x, y, moment), peak normal force, overlap."""
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
    """Pressure on the piston, and the mass of the liquid that moves with the piston."""
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
    p, omega = pose_of(b), w.crank[row, SPEED]
    sin_a, cos_a = sine_cosine(w.crank[row, ANGLE] + q.phase)
    sin_b, cos_b = sine_cosine(p.beta)
    pressure, added = _pressure(k, w, row, share, t)
    on_face, inv_px = -q.piston_area * pressure, 1.0 / (q.piston_mass + added)
    centred = with_play(crank_offset(p, omega, q, sin_a, cos_a, sin_b, cos_b), w, row, t)
    centred = from_bent_eye(centred, CRANKPIN, p.beta_rate, k, w, row, t, sin_b, cos_b)
    at_crank, along = worn_eye(centred, p.beta_rate, sin_b, cos_b, t.contacts[k, CRANKPIN])
    eye = eye_turn(CRANKPIN, p.beta_rate, k, w, row, t)
    at_eye, peak, overlap = _pin_load(
        CRANKPIN, q.crankpin_rung, q.crankpin_radius, at_crank, omega, eye, k, b, held, t
    )
    pin = slot_moment(at_eye, along, sin_b, cos_b)
    overlap_ratio = overlap / q.crankpin_radius if q.crankpin_rung != JOINT_IDEAL else 0.0
    wrist, guide_x, guide_y, guide_moment = PinLoad(0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
    if q.wristpin_rung != JOINT_IDEAL:
        at_wrist = wrist_offset(p, q, sin_b, cos_b)
        at_wrist = from_bent_eye(at_wrist, WRISTPIN, p.beta_rate, k, w, row, t, sin_b, cos_b)
        eye = eye_turn(WRISTPIN, p.beta_rate, k, w, row, t)
        wrist, normal, overlap = _pin_load(
            WRISTPIN, q.wristpin_rung, q.wristpin_radius, at_wrist, p.tilt_rate, eye, k, b, held, t
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
    if is_elastic(t):
        rates = flexed(k, w, row, t, rates, at_eye, wrist, sin_b, cos_b)
    wrist_x, wrist_y = wrist.x, wrist.y
    held_alone = q.crankpin_rung >= JOINT_COMPLIANT and not is_elastic(t)
    if held_alone and q.wristpin_rung == JOINT_IDEAL:
        rates, wrist_x, wrist_y = held_wrist(q, m, p, rates, inv_px, sin_b, cos_b, 1.0)
    for i in range(len(BODY)):
        b.rate[i] = b.y[len(BODY) + i]
    b.rate[ROD_X_RATE], b.rate[ROD_Y_RATE], b.rate[BETA_RATE] = rates.rod_x, rates.rod_y, rates.beta
    b.rate[PISTON_X_RATE], b.rate[PISTON_Y_RATE] = rates.piston_x, rates.piston_y
    b.rate[TILT_RATE] = rates.tilt
    b.force[PIN_FORCE], b.force[PIN_FORCE + 1] = pin.x, pin.y
    b.force[WRIST_FORCE], b.force[WRIST_FORCE + 1] = wrist_x, wrist_y
    b.normal, b.overlap, b.link = peak, overlap_ratio, 0.0
    crank_moment = pin.on_pin
    constrained = q.crankpin_rung < JOINT_COMPLIANT or q.wristpin_rung == JOINT_LINK
    if constrained or (is_elastic(t) and q.wristpin_rung == JOINT_IDEAL):
        crank_moment += constrain(k, w, row, t, sin_a, cos_a, sin_b, cos_b, inv_px)
    pin_x, pin_y = b.force[PIN_FORCE], b.force[PIN_FORCE + 1]
    w.moment[0] += crank_moment + q.crank_radius * (pin_x * sin_a - pin_y * cos_a)
    b.force[FACE_FORCE], b.force[SEAL_FORCE] = on_face - added * b.rate[PISTON_X_RATE], seal
    if q.guide_rung != JOINT_COMPLIANT:  # support of the piston by an ideal guide
        guide_y = b.force[WRIST_FORCE + 1] + m.gravity_y * q.piston_mass
    b.force[GUIDE_FORCE], b.force[GUIDE_FORCE + 1] = guide_x, guide_y
    if q.crankpin_rung < JOINT_COMPLIANT and m.inverse_inertia > 0.0:
        b.force_per_turn[FACE_FORCE] = -added * b.rate_per_turn[PISTON_X_RATE]
        if q.guide_rung != JOINT_COMPLIANT:
            b.force_per_turn[GUIDE_FORCE + 1] = b.force_per_turn[WRIST_FORCE + 1]


@kernel
def derivative_of_record(w: Any, row: int, share: float, t: Any) -> None:
    """Rates, forces and margins for the state of a row, `share` of the step having passed."""
    m = t.machine
    w.moment[0] = w.moment[1] = 0.0
    for k in range(t.throws.shape[0]):
        _throw(k, w, row, share, t)
    w.crank[row, ANGLE_RATE], w.crank[row, SPEED_RATE] = w.crank[row, SPEED], 0.0
    sin_a, cos_a = sine_cosine(w.crank[row, ANGLE] + t.throws[0].phase)
    a_x, a_y = 0.0, 0.0
    if t.bearing.shape[0] > 0:
        a_x, a_y = journal_motion(w, row, t, sin_a, cos_a)
        spun_up(w, row, t, a_x, a_y, sin_a, cos_a)
    load = crank_load(w.moment[0], sin_a, cos_a, a_x, a_y, m)
    w.crank[row, MOMENT] = -load
    if m.inverse_inertia == 0.0:
        return
    drive = motor_moment(w.crank[row, SPEED], m)
    turning = m.inverse_inertia * (drive + load) / (1.0 - m.inverse_inertia * w.moment[1])
    w.crank[row, SPEED_RATE] = turning
    w.crank[row, MOMENT] = drive
    if t.bearing.shape[0] > 0:
        spun_up(w, row, t, a_x, a_y, sin_a, cos_a)
    spun_up_rods(turning, w, row, t)
    for k in range(t.throws.shape[0]):
        if t.throws[k].crankpin_rung >= JOINT_COMPLIANT:
            continue
        b = w.stage[row, k]
        for c in range(len(BODY), PER_THROW):
            b.rate[c] += turning * b.rate_per_turn[c]
        for c in range(VALVE_FORCES):
            b.force[c] += turning * b.force_per_turn[c]
