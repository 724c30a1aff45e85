"""Joint forces and accelerations of one throw, in scalar form.

Nothing here reads or writes a table of states: a march passes the numbers of one throw at one
instant and gets numbers back. So the march of one record (:mod:`.mechanism.march`) and that of
many in parallel (``sim.pump_lanes``) use the same equations and give identical bytes.
Values are selected rather than branched upon where the vectorised march needs it.
"""

import math
from typing import Any, NamedTuple

from ..contact.law import LAW_KELVIN_VOIGT, RELEASE_AT_ZERO_FORCE, friction_force, normal_force
from ..jit import kernel, sine_cosine


class Pose(NamedTuple):
    """Coordinates and rates of a throw [m, rad, m/s, rad/s]; see ``BODY``."""

    rod_x: float
    rod_y: float
    beta: float
    piston_x: float
    piston_y: float
    tilt: float
    rod_x_rate: float
    rod_y_rate: float
    beta_rate: float
    piston_x_rate: float
    piston_y_rate: float
    tilt_rate: float


class PinLoad(NamedTuple):
    """Load of a joint: force on the rod or the piston [N], moments on pin and eye [N m]."""

    x: float
    y: float
    on_pin: float
    on_eye: float


class Touch(NamedTuple):
    """State of one contact: normal force [N], overlap [m], and the criteria of its change."""

    normal: float
    overlap: float
    margin: float  # see _margin [N]
    approach: float  # [m/s]


class Rates(NamedTuple):
    """Accelerations of a throw, and its effect on crank and casing."""

    rod_x: float
    rod_y: float
    beta: float
    piston_x: float
    piston_y: float
    tilt: float


@kernel
def crank_offset(
    p: Any, omega: float, q: Any, sin_a: float, cos_a: float, sin_b: float, cos_b: float
) -> Any:
    """Crank pin relative to its eye's centre (x, y) [m], and velocity (x, y) [m/s]."""
    turn = omega * q.crank_radius
    swing = p.beta_rate * q.rod_arm
    return (
        q.crank_radius * cos_a - p.rod_x + q.rod_arm * cos_b,
        q.crank_radius * sin_a - p.rod_y - q.rod_arm * sin_b,
        -turn * sin_a - p.rod_x_rate - swing * sin_b,
        turn * cos_a - p.rod_y_rate - swing * cos_b,
    )


@kernel
def wrist_offset(p: Any, q: Any, sin_b: float, cos_b: float) -> Any:
    """Wrist pin relative to its eye's centre (x, y) [m], and velocity (x, y) [m/s]."""
    swing = p.beta_rate * q.rod_centre
    return (
        p.piston_x - p.rod_x - q.rod_centre * cos_b,
        p.piston_y - p.rod_y + q.rod_centre * sin_b,
        p.piston_x_rate - p.rod_x_rate + swing * sin_b,
        p.piston_y_rate - p.rod_y_rate + swing * cos_b,
    )


@kernel
def worn_eye(offset: Any, beta_rate: float, sin_b: float, cos_b: float, c: Any) -> Any:
    """Offset of the crank pin, see :func:`crank_offset`, from the nearest centre of a worn eye.

    A pin that has worn into one side of its eye, towards the wrist pin, can move in two half
    circles and the area between them: their centres lie on a line along the rod, as long as
    the contact's `slot`. Also returns the centre's distance along that line [m].
    """
    d_x, d_y, v_x, v_y = offset
    along = min(max(d_x * cos_b - d_y * sin_b, 0.0), c.slot)
    swing = along * beta_rate
    nearest = (d_x - along * cos_b, d_y + along * sin_b, v_x + swing * sin_b, v_y + swing * cos_b)
    return nearest, along


@kernel
def slot_moment(pin: Any, along: float, sin_b: float, cos_b: float) -> Any:
    """Load of a pin whose force acts at a distance along the rod from its eye's centre [m]."""
    turning = along * (pin.x * sin_b + pin.y * cos_b)
    return PinLoad(pin.x, pin.y, pin.on_pin, pin.on_eye + turning)


@kernel
def polar(d_x: float, d_y: float, v_x: float, v_y: float) -> Any:
    """Length, its rate, and direction; a centred pin gets the stroke's direction, not NaN."""
    distance = math.sqrt(d_x * d_x + d_y * d_y)
    off_centre = distance > 0.0
    inverse = 1.0 / (distance if off_centre else 1.0)
    n_x, n_y = d_x * inverse if off_centre else 1.0, d_y * inverse
    return distance, v_x * n_x + v_y * n_y, n_x, n_y


@kernel
def margin(overlap: float, force: float, touching: bool, c: Any) -> Any:
    """Positive while the contact stays unchanged, negative once it should change [N]."""
    elastic = c.stiffness * overlap
    sticky = c.law == LAW_KELVIN_VOIGT and c.release == RELEASE_AT_ZERO_FORCE
    open_ = -min(elastic, force) if sticky else -elastic
    closed = force if sticky else elastic
    return closed if touching else open_


@kernel
def link_drag(d_x: float, d_y: float, v_x: float, v_y: float, spin: float, c: Any) -> Any:
    """Viscous force on the rod along a link's end (x, y), and its share between the surfaces.

    The contact's damping resists the swing of the link, `tangential_damping` the sliding.
    """
    _, _, n_x, n_y = polar(d_x, d_y, v_x, v_y)
    swing = v_y * n_x - v_x * n_y
    sliding = c.tangential_damping * (swing + spin)
    drag = c.damping * swing + sliding
    return -drag * n_y, drag * n_x, sliding


@kernel
def pin_touch(
    d_x: float, d_y: float, v_x: float, v_y: float, touching: bool, impact: float, c: Any
) -> Any:
    """State of the contact between a pin and its eye, and its normal."""
    distance, speed, n_x, n_y = polar(d_x, d_y, v_x, v_y)
    overlap = distance - c.clearance
    law = normal_force(overlap, speed, impact, c)
    return Touch(law, overlap, margin(overlap, law, touching, c), speed), n_x, n_y


@kernel
def dry_pin(
    d_x: float,
    d_y: float,
    v_x: float,
    v_y: float,
    spin: float,
    radius: float,
    touching: bool,
    impact: float,
    c: Any,
) -> Any:
    """Load of a pin with clearance on its rod, and the state of the contact.

    `spin` is the sliding velocity from rotation alone [m/s].
    """
    touch, n_x, n_y = pin_touch(d_x, d_y, v_x, v_y, touching, impact, c)
    law = touch.normal if touching else 0.0
    sliding = friction_force(v_y * n_x - v_x * n_y + spin, law, c)
    rub = sliding if touching else 0.0
    load = PinLoad(
        law * n_x - rub * n_y, law * n_y + rub * n_x, -radius * rub, (radius + c.clearance) * rub
    )
    return load, Touch(law, touch.overlap, touch.margin, touch.approach)


@kernel
def seal_drag(speed: float, pressure: float, q: Any) -> Any:
    """Coulomb friction of a piston's rings or packing, along x on the piston [N].

    They are pressed on by their tension and by the gauge pressure in the cylinder.
    """
    pressed = q.seal_friction + q.seal_friction_area * abs(pressure)
    sharp = q.seal_friction_speed
    return -pressed * speed / math.sqrt(speed * speed + sharp * sharp + _REST)


_REST = 1e-30  # [m^2/s^2]: avoids division by zero in a record of zeros, which has no seal


@kernel
def corner(
    p: Any, q: Any, along: float, side: float, sin_t: float, cos_t: float, clearance: float
) -> Any:
    """Overlap of a piston's corner with its guide, its rate, and the corner from the wrist pin.

    `along` and `side` are -1 or 1: rear or front, lower or upper.
    """
    reach, across = along * q.guide_half_length, side * q.guide_half_height
    r_x = reach * cos_t - across * sin_t
    r_y = reach * sin_t + across * cos_t
    overlap = side * (p.piston_y + r_y) - q.guide_half_height - clearance
    return overlap, side * (p.piston_y_rate + p.tilt_rate * r_x), r_x, r_y


@kernel
def corner_margin(
    p: Any, q: Any, along: float, side: float, touching: bool, impact: float, c: Any
) -> float:
    """Margin of one corner in its guide, see :func:`margin` [N]."""
    sin_t, cos_t = sine_cosine(p.tilt)
    overlap, speed, _, _ = corner(p, q, along, side, sin_t, cos_t, c.clearance)
    found: float = margin(overlap, normal_force(overlap, speed, impact, c), touching, c)
    return found


@kernel
def guide_end(
    p: Any,
    q: Any,
    along: float,
    sin_t: float,
    cos_t: float,
    upper_touches: bool,
    upper_impact: float,
    lower_touches: bool,
    lower_impact: float,
    c: Any,
) -> Any:
    """Force of a guide on one end of the piston (x, y), its moment on it, and its two contacts.

    A guide with clearance holds an end at its upper or its lower corner, never at both. Force
    and friction are those of the corner in contact, or of the deeper one if neither is.
    """
    at_upper, speed_u, x_u, y_u = corner(p, q, along, 1.0, sin_t, cos_t, c.clearance)
    at_lower, speed_l, x_l, y_l = corner(p, q, along, -1.0, sin_t, cos_t, c.clearance)
    lower = lower_touches or (at_lower > at_upper and not upper_touches)
    overlap, speed = at_lower if lower else at_upper, speed_l if lower else speed_u
    touching = lower_touches or upper_touches
    force = normal_force(overlap, speed, lower_impact if lower else upper_impact, c)
    law = force if touching else 0.0
    push = law if lower else -law
    r_x, r_y = x_l if lower else x_u, y_l if lower else y_u
    sliding = friction_force(p.piston_x_rate - p.tilt_rate * r_y, law, c)
    drag = -sliding if touching else 0.0
    own = margin(overlap, force, touching, c)
    away, leaving = at_upper if lower else at_lower, speed_u if lower else speed_l
    open_force = c.stiffness * away + c.damping * leaving if c.law == LAW_KELVIN_VOIGT else 0.0
    other = margin(away, open_force, False, c)
    upper = Touch(law, at_upper, other if lower else own, speed_u)
    return (
        drag,
        push,
        r_x * push - r_y * drag,
        upper,
        Touch(law, at_lower, own if lower else other, speed_l),
    )


@kernel
def free_motion(
    q: Any,
    m: Any,
    along: float,
    inv_px: float,
    pin: Any,
    wrist: Any,
    guide_x: float,
    guide_y: float,
    guide_moment: float,
    sin_b: float,
    cos_b: float,
) -> Any:
    """Accelerations under the applied loads, before any constraint force.

    `along` is the force of liquid and seal on the piston along the stroke [N].
    `inv_px` is the inverse mass of the piston along the stroke, its liquid included [1/kg].
    """
    rod_x = pin.x + wrist.x - m.gravity_x * q.rod_mass
    rod_y = pin.y + wrist.y - m.gravity_y * q.rod_mass
    rod_b = q.rod_arm * (pin.x * sin_b + pin.y * cos_b) - pin.on_eye
    rod_b -= q.rod_centre * (wrist.x * sin_b + wrist.y * cos_b) + wrist.on_eye
    return Rates(
        rod_x * q.inverse_rod_mass,
        rod_y * q.inverse_rod_mass,
        rod_b * q.inverse_rod_inertia,
        (along - m.gravity_x * q.piston_mass - wrist.x + guide_x) * inv_px,
        (guide_y - m.gravity_y * q.piston_mass - wrist.y) * q.inverse_piston_across,
        (wrist.on_pin + guide_moment) * q.inverse_piston_tilt,
    )


@kernel
def held_wrist(
    q: Any, m: Any, p: Any, free: Any, inv_px: float, sin_b: float, cos_b: float, holds: float
) -> Any:
    """Accelerations and force on the rod (x, y) if an ideal wrist pin joins rod and piston.

    Its two constraints in closed form, used with a worn crank pin. `holds` is 1, or 0 without
    such a pin.
    """
    d_x, d_y, v_x, v_y = wrist_offset(p, q, sin_b, cos_b)
    inv_m, inv_j = q.inverse_rod_mass, q.inverse_rod_inertia
    swing, lag = q.rod_centre * p.beta_rate * p.beta_rate, q.rod_centre * free.beta
    need_x = free.piston_x - free.rod_x + lag * sin_b + swing * cos_b + held_back(d_x, v_x, m)
    need_y = free.piston_y - free.rod_y + lag * cos_b - swing * sin_b + held_back(d_y, v_y, m)
    turning = q.rod_centre * q.rod_centre * inv_j
    a_xx = inv_m + inv_px + turning * sin_b * sin_b
    a_yy = inv_m + q.inverse_piston_across + turning * cos_b * cos_b
    a_xy = turning * sin_b * cos_b
    inverse = holds / (a_xx * a_yy - a_xy * a_xy)
    f_x = (a_yy * need_x - a_xy * need_y) * inverse
    f_y = (a_xx * need_y - a_xy * need_x) * inverse
    rates = Rates(
        free.rod_x + f_x * inv_m,
        free.rod_y + f_y * inv_m,
        free.beta - q.rod_centre * (f_x * sin_b + f_y * cos_b) * inv_j,
        free.piston_x - f_x * inv_px,
        free.piston_y - f_y * q.inverse_piston_across,
        free.tilt,
    )
    return rates, f_x, f_y


@kernel
def held_back(distance: float, speed: float, m: Any) -> Any:
    """Baumgarte's term: acceleration that corrects a drifting constraint [m/s^2]."""
    return m.baumgarte * (2.0 * speed + m.baumgarte * distance)


@kernel
def motor_moment(speed: float, m: Any) -> Any:
    """Moment of the drive at a crank speed [N m]: constant part plus Kloss's curve.

    ``2 M_b / (s / s_b + s_b / s)`` with the slip s of an asynchronous motor, breakdown moment M_b
    at the slip s_b. Source: Kloss (1929); Boldea and Nasar, The Induction Machine Handbook.
    """
    powered = m.breakdown_moment != 0.0
    slip = 1.0 - speed / (m.synchronous_speed if powered else 1.0)
    both = slip * slip + m.breakdown_slip * m.breakdown_slip
    pull = 2.0 * m.breakdown_moment * slip * m.breakdown_slip / (both if powered else 1.0)
    return m.drive_moment + pull


@kernel
def crank_load(moment: float, sin_a: float, cos_a: float, a_x: float, a_y: float, m: Any) -> Any:
    """Moment on the crank including the weight of its own unbalance [N m].

    `a_x` and `a_y` are the acceleration of its journal [m/s^2].
    """
    return moment + m.static_moment * ((m.gravity_x + a_x) * sin_a - (m.gravity_y + a_y) * cos_a)
