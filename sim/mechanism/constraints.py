"""Constraint forces of ideal joints and links: one linear system for each throw."""

from typing import Any, NamedTuple

from ..contact.law import friction_force
from ..jit import kernel
from .elastic_rod import (
    clear_spin,
    eye_acceleration,
    eye_turn,
    from_bent_eye,
    inverse_inertia,
    is_elastic,
    lever_of,
    mode_accelerations,
    push_modes,
)
from .layout import (
    ALONG_X,
    ALONG_Y,
    AT_JOINT,
    BETA_RATE,
    BODY,
    CRANKPIN,
    JOINT_COMPLIANT,
    JOINT_IDEAL,
    JOINT_LINK,
    NORMAL_X,
    NORMAL_Y,
    PER_THROW,
    PIN_FORCE,
    PISTON_X_RATE,
    PISTON_Y_RATE,
    ROD_X_RATE,
    ROD_Y_RATE,
    RUBBING,
    SIZE,
    SIZE_PER_TURN,
    SPEED,
    TILT_RATE,
    VALVE_FORCES,
    WRIST_FORCE,
    WRISTPIN,
    pose_of,
)
from .throw_motion import crank_offset, held_back, polar, wrist_offset


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
    """Add the equations of one joint from number n on: the accelerations its constraints cancel.

    A link's force has friction across it, in compression on one side of the eye (`side` 1), in
    tension on the other (-1). Returns the number of the next equation.
    """
    q, m, b, c = t.throws[k], t.machine, w.stage[row, k], t.contacts[k, joint]
    omega, b_rate = w.crank[row, SPEED], b.y[BETA_RATE]
    if joint == CRANKPIN:
        rung, arm, radius, spin = q.crankpin_rung, q.rod_arm, q.crankpin_radius, omega
        offset = crank_offset(pose_of(b), omega, q, sin_a, cos_a, sin_b, cos_b)
        pull = q.crank_radius * omega * omega
        apart_x, apart_y = -pull * cos_a, -pull * sin_a
        turn_x, turn_y = -q.crank_radius * sin_a, q.crank_radius * cos_a
    else:
        rung, arm, radius, spin = q.wristpin_rung, -q.rod_centre, q.wristpin_radius, b.y[TILT_RATE]
        offset = wrist_offset(pose_of(b), q, sin_b, cos_b)
        apart_x, apart_y = b.rate[PISTON_X_RATE], b.rate[PISTON_Y_RATE]
        turn_x, turn_y = 0.0, 0.0
    swung_x = arm * (b.rate[BETA_RATE] * sin_b + b_rate * b_rate * cos_b)
    swung_y = arm * (b.rate[BETA_RATE] * cos_b - b_rate * b_rate * sin_b)
    if is_elastic(t):
        swung_x, swung_y = eye_acceleration(joint, k, w, row, t, sin_b, cos_b)
    apart_x -= b.rate[ROD_X_RATE] + swung_x
    apart_y -= b.rate[ROD_Y_RATE] + swung_y
    d_x, d_y, v_x, v_y = from_bent_eye(offset, joint, b_rate, k, w, row, t, sin_b, cos_b)
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
    eye = eye_turn(joint, b_rate, k, w, row, t)
    sliding = swing + radius * spin + (radius + c.clearance) * eye
    share = side * (friction_force(sliding, 1.0, c) - c.tangential_damping * sliding)
    w.place[n, AT_JOINT], w.place[n, RUBBING] = joint, share
    w.place[n, ALONG_X], w.place[n, ALONG_Y] = n_x - share * n_y, n_y + share * n_x
    w.place[n, NORMAL_X], w.place[n, NORMAL_Y] = n_x, n_y
    across = swing * swing / distance
    back = held_back(distance - c.clearance, speed, m)
    w.matrix[n, SIZE] = apart_x * n_x + apart_y * n_y + across + back
    w.matrix[n, SIZE_PER_TURN] = turn_x * n_x + turn_y * n_y
    return n + 1


class _Unit(NamedTuple):
    """Accelerations of a rod per unit of one constraint force [1/kg], [1/(kg m)]."""

    swing: float
    stretch: float  # of the modes; 0 for a rigid rod
    bow: float


@kernel
def _unit(j: int, k: int, w: Any, row: int, t: Any, sin_b: float, cos_b: float) -> Any:
    q, joint = t.throws[k], CRANKPIN if w.place[j, AT_JOINT] == CRANKPIN else WRISTPIN
    radius = q.crankpin_radius if joint == CRANKPIN else q.wristpin_radius
    couple = (radius + t.contacts[k, joint].clearance) * w.place[j, RUBBING]
    u_x, u_y = w.place[j, ALONG_X], w.place[j, ALONG_Y]
    at = lever_of(joint, k, w, row, t)
    turning = at.along * (u_x * sin_b + u_y * cos_b) - at.across * (u_y * sin_b - u_x * cos_b)
    swing = (turning - couple) * inverse_inertia(k, w, row, t)
    if not is_elastic(t):
        return _Unit(swing, 0.0, 0.0)
    stretch, bow = mode_accelerations(joint, u_x, u_y, couple, k, w, row, t, sin_b, cos_b)
    return _Unit(swing, stretch, bow)


@kernel
def _mobilities(
    n: int, k: int, w: Any, row: int, t: Any, sin_b: float, cos_b: float, inv_px: float
) -> None:
    """Fill in the effect of every unit constraint force on every equation."""
    q = t.throws[k]
    for j in range(n):
        u_x, u_y = w.place[j, ALONG_X], w.place[j, ALONG_Y]
        unit = _unit(j, k, w, row, t, sin_b, cos_b)
        for i in range(n):
            joint = CRANKPIN if w.place[i, AT_JOINT] == CRANKPIN else WRISTPIN
            at = lever_of(joint, k, w, row, t)
            along = at.reach * unit.stretch - at.across * unit.swing
            across = at.along * unit.swing + at.shape * unit.bow
            e_x = u_x * q.inverse_rod_mass + across * sin_b - along * cos_b
            e_y = u_y * q.inverse_rod_mass + across * cos_b + along * sin_b
            if w.place[j, AT_JOINT] == WRISTPIN and w.place[i, AT_JOINT] == WRISTPIN:
                e_x += u_x * inv_px
                e_y += u_y * q.inverse_piston_across
            w.matrix[i, j] = e_x * w.place[i, NORMAL_X] + e_y * w.place[i, NORMAL_Y]


@kernel
def _add_force(
    size: float, j: int, k: int, rate: Any, force: Any, w: Any, t: Any, unit: Any, inv_px: float
) -> Any:
    """Add constraint force j to a throw's rates and forces; return its friction moment."""
    q = t.throws[k]
    f_x, f_y, rub = (
        size * w.place[j, ALONG_X],
        size * w.place[j, ALONG_Y],
        size * w.place[j, RUBBING],
    )
    rate[ROD_X_RATE] += f_x * q.inverse_rod_mass
    rate[ROD_Y_RATE] += f_y * q.inverse_rod_mass
    rate[BETA_RATE] += size * unit.swing
    if w.place[j, AT_JOINT] == CRANKPIN:
        force[PIN_FORCE] += f_x
        force[PIN_FORCE + 1] += f_y
        return -q.crankpin_radius * rub
    force[WRIST_FORCE] += f_x
    force[WRIST_FORCE + 1] += f_y
    rate[PISTON_X_RATE] -= f_x * inv_px
    rate[PISTON_Y_RATE] -= f_y * q.inverse_piston_across
    rate[TILT_RATE] -= q.wristpin_radius * rub * q.inverse_piston_tilt
    return 0.0


@kernel
def constrain(
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
    """Add constraint forces of ideal joints and links; return their friction moment on the crank.

    Unknowns are forces along given directions at either end of the rod; the equations require the
    relative acceleration that keeps pin and eye together.
    """
    q, m, b = t.throws[k], t.machine, w.stage[row, k]
    least, at_pin, at_wrist, n = 1.0, 1.0, 1.0, 0
    for _ in range(4):  # until the friction of every link is on the side that its sign requires
        n = 0
        if q.crankpin_rung < JOINT_COMPLIANT:
            n = _equations(CRANKPIN, n, at_pin, k, w, row, t, sin_a, cos_a, sin_b, cos_b)
        if q.wristpin_rung < JOINT_COMPLIANT:
            n = _equations(WRISTPIN, n, at_wrist, k, w, row, t, sin_a, cos_a, sin_b, cos_b)
        _mobilities(n, k, w, row, t, sin_b, cos_b, inv_px)
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
        for c in range(VALVE_FORCES):
            b.force_per_turn[c] = 0.0
        clear_spin(k, w, row)
    moment, rubbing = 0.0, 0.0
    for j in range(n):
        unit = _unit(j, k, w, row, t, sin_b, cos_b)
        size, more = w.matrix[j, SIZE], w.matrix[j, SIZE_PER_TURN]
        moment += _add_force(size, j, k, b.rate, b.force, w, t, unit, inv_px)
        if per_turn:
            rubbing += _add_force(more, j, k, b.rate_per_turn, b.force_per_turn, w, t, unit, inv_px)
        if is_elastic(t):
            push_modes(size, more if per_turn else 0.0, unit.stretch, unit.bow, k, w, row)
    if per_turn:
        along, across = b.force_per_turn[PIN_FORCE], b.force_per_turn[PIN_FORCE + 1]
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
