"""Rods elastic in tension and bending: the first axial and the first bending mode of each.

A point of the rod at s from its centre of mass, towards the crank pin, lies at

    r + (1 + u / L) s e + v w(s) g

with the stretch u between the eyes, the bow v in the middle relative to the line of the eyes, and
the shape w, the half sine of a pinned beam less its rigid-body part. Both shapes are independent of
the centre of mass, of the angle of the rod's axes and of each other, so that
Newton's equation of the rod is unchanged, Euler's has a variable inertia, and

    m_u (u'' - (L + u) b'^2) = -k_u u - c_u u' + sum F . e s / L,            m_u = J / L^2
    m_v (v'' - v b'^2) = -k_v v - c_v v' + sum (F . g w - M w'),
    ((J (1 + u / L)^2 + m_v v^2) b')' = sum (F . ((1 + u / L) s g - v w e) - M)

for forces F of the pins at both eyes and moments M against their turning. The axial force does
not reduce the bending stiffness: it stays below a tenth of Euler's load.

Source: Shabana (2020), Dynamics of Multibody Systems, floating frame of reference with mean axes.
"""

from typing import Any, NamedTuple

from ..jit import kernel
from .layout import BETA_RATE, BOW, BOW_RATE, CRANKPIN, FLEX, STRETCH, STRETCH_RATE, WRISTPIN
from .throw_motion import Rates


class Lever(NamedTuple):
    """Position of an eye from its rod's centre of mass, in the rod's axes, and mode shapes."""

    along: float  # [m]
    across: float  # [m]
    reach: float  # along the rod, per stretch
    shape: float  # across it, per bow
    slope: float  # turning of the eye, per bow [rad/m]


@kernel
def is_elastic(t: Any) -> bool:
    """Whether the rods are elastic."""
    found: bool = t.flex.shape[0] > 0
    return found


@kernel
def lever_of(joint: int, k: int, w: Any, row: int, t: Any) -> Any:
    """Lever of the eye at one end of a rod, see :class:`Lever`; for a rigid rod, without modes."""
    q = t.throws[k]
    arm = q.rod_arm if joint == CRANKPIN else -q.rod_centre
    if not is_elastic(t):
        return Lever(arm, 0.0, 0.0, 0.0, 0.0)
    f, y = t.flex[k], w.flex[row, k].y
    reach = arm / f.length
    shape = f.crank_shape if joint == CRANKPIN else f.wrist_shape
    slope = f.crank_slope if joint == CRANKPIN else f.wrist_slope
    return Lever(arm + reach * y[STRETCH], shape * y[BOW], reach, shape, slope)


@kernel
def from_bent_eye(
    offset: Any,
    joint: int,
    beta_rate: float,
    k: int,
    w: Any,
    row: int,
    t: Any,
    sin_b: float,
    cos_b: float,
) -> Any:
    """Offset of a pin, see :func:`.throw_motion.crank_offset`, from the eye of an elastic rod."""
    if not is_elastic(t):
        return offset
    d_x, d_y, v_x, v_y = offset
    y, at = w.flex[row, k].y, lever_of(joint, k, w, row, t)
    along = at.reach * y[STRETCH]
    along_rate = at.reach * y[STRETCH_RATE] - at.across * beta_rate
    across_rate = at.shape * y[BOW_RATE] + along * beta_rate
    return (
        d_x + along * cos_b - at.across * sin_b,
        d_y - along * sin_b - at.across * cos_b,
        v_x + along_rate * cos_b - across_rate * sin_b,
        v_y - along_rate * sin_b - across_rate * cos_b,
    )


@kernel
def eye_turn(joint: int, beta_rate: float, k: int, w: Any, row: int, t: Any) -> float:
    """Angular velocity of a joint's eye, in the sense of the rod's angle [rad/s]."""
    if not is_elastic(t):
        return beta_rate
    turn: float = beta_rate + lever_of(joint, k, w, row, t).slope * w.flex[row, k].y[BOW_RATE]
    return turn


@kernel
def inverse_inertia(k: int, w: Any, row: int, t: Any) -> float:
    """Inverse inertia of a deformed rod about its centre of mass [1/(kg m^2)]."""
    rigid: float = t.throws[k].inverse_rod_inertia
    if not is_elastic(t):
        return rigid
    f, y = t.flex[k], w.flex[row, k].y
    longer = 1.0 + y[STRETCH] / f.length
    bent: float = 1.0 / (longer * longer / rigid + y[BOW] * y[BOW] / f.inverse_bow_mass)
    return bent


@kernel
def flexed(
    k: int, w: Any, row: int, t: Any, rates: Any, pin: Any, wrist: Any, sin_b: float, cos_b: float
) -> Any:
    """Accelerations of a throw with elastic rod; those of the modes are stored in their row.

    `pin` and `wrist` are the loads on both eyes about their centres, and `rates` those of a rigid
    rod under these loads.
    """
    q, f, b = t.throws[k], t.flex[k], w.flex[row, k]
    y, turn = b.y, w.stage[row, k].y[BETA_RATE]
    crank, small = lever_of(CRANKPIN, k, w, row, t), lever_of(WRISTPIN, k, w, row, t)
    pin_along, pin_across = pin.y * sin_b - pin.x * cos_b, pin.x * sin_b + pin.y * cos_b
    wrist_along = wrist.y * sin_b - wrist.x * cos_b
    wrist_across = wrist.x * sin_b + wrist.y * cos_b
    longer = 1.0 + y[STRETCH] / f.length
    stretch_mass, bow_mass = 1.0 / f.inverse_stretch_mass, 1.0 / f.inverse_bow_mass
    more = (crank.along - q.rod_arm) * pin_across - crank.across * pin_along
    more += (small.along + q.rod_centre) * wrist_across - small.across * wrist_along
    more -= 2.0 * turn * stretch_mass * f.length * longer * y[STRETCH_RATE]
    more -= 2.0 * turn * bow_mass * y[BOW] * y[BOW_RATE]
    swing = (rates.beta / q.inverse_rod_inertia + more) * inverse_inertia(k, w, row, t)
    pulled = crank.reach * pin_along + small.reach * wrist_along
    pulled -= f.stretch_stiffness * y[STRETCH] + f.stretch_damping * y[STRETCH_RATE]
    pushed = crank.shape * pin_across + small.shape * wrist_across
    pushed -= crank.slope * pin.on_eye + small.slope * wrist.on_eye
    pushed -= f.bow_stiffness * y[BOW] + f.bow_damping * y[BOW_RATE]
    b.rate[STRETCH], b.rate[BOW] = y[STRETCH_RATE], y[BOW_RATE]
    b.rate[STRETCH_RATE] = pulled * f.inverse_stretch_mass + f.length * longer * turn * turn
    b.rate[BOW_RATE] = pushed * f.inverse_bow_mass + y[BOW] * turn * turn
    return Rates(rates.rod_x, rates.rod_y, swing, rates.piston_x, rates.piston_y, rates.tilt)


@kernel
def eye_acceleration(
    joint: int, k: int, w: Any, row: int, t: Any, sin_b: float, cos_b: float
) -> Any:
    """Acceleration (x, y) of an elastic rod's eye from its centre of mass, by the row's rates."""
    at, b = lever_of(joint, k, w, row, t), w.stage[row, k]
    turn, swing = b.y[BETA_RATE], b.rate[BETA_RATE]
    y, rate = w.flex[row, k].y, w.flex[row, k].rate
    along = at.reach * rate[STRETCH_RATE] - at.across * swing
    along -= turn * (2.0 * at.shape * y[BOW_RATE] + at.along * turn)
    across = at.shape * rate[BOW_RATE] + at.along * swing
    across += turn * (2.0 * at.reach * y[STRETCH_RATE] - at.across * turn)
    return across * sin_b - along * cos_b, across * cos_b + along * sin_b


@kernel
def mode_accelerations(
    joint: int,
    u_x: float,
    u_y: float,
    couple: float,
    k: int,
    w: Any,
    row: int,
    t: Any,
    sin_b: float,
    cos_b: float,
) -> Any:
    """Accelerations of stretch and bow from a force on an eye and a couple against its turning."""
    f, at = t.flex[k], lever_of(joint, k, w, row, t)
    stretch = at.reach * (u_y * sin_b - u_x * cos_b) * f.inverse_stretch_mass
    bow = (at.shape * (u_x * sin_b + u_y * cos_b) - at.slope * couple) * f.inverse_bow_mass
    return stretch, bow


@kernel
def clear_spin(k: int, w: Any, row: int) -> None:
    """Reset the modes' rates per crank acceleration; nothing for a rigid rod."""
    if w.flex.shape[1] > 0:
        b = w.flex[row, k]
        b.rate_per_turn[STRETCH] = b.rate_per_turn[BOW] = 0.0


@kernel
def push_modes(
    size: float, per_turn: float, stretch: float, bow: float, k: int, w: Any, row: int
) -> None:
    """Add a constraint force, and its part per crank acceleration, to the modes of its rod."""
    b = w.flex[row, k]
    b.rate[STRETCH_RATE] += size * stretch
    b.rate[BOW_RATE] += size * bow
    b.rate_per_turn[STRETCH] += per_turn * stretch
    b.rate_per_turn[BOW] += per_turn * bow


@kernel
def spun_up_rods(turning: float, w: Any, row: int, t: Any) -> None:
    """Add the effect of the crank's acceleration to the rates of all modes."""
    for k in range(t.flex.shape[0]):
        b = w.flex[row, k]
        for c in range(len(FLEX)):
            b.rate[len(FLEX) + c] += turning * b.rate_per_turn[c]
