"""Main bearing carried by a yielding casing: prediction of its motion in the next step."""

from typing import Any

from ..jit import kernel
from .layout import FORCES, PUSHES, Machine, Tables


@kernel
def mode_response(
    force: float, place: float, speed: float, per_force: float, per_place: float, per_speed: float
) -> float:
    """Mean acceleration of a mode over a step, or its displacement or speed after it.

    Both are exact for a force that is constant over the step, for any ratio of step to period.
    """
    return per_force * force + per_place * place + per_speed * speed


@kernel
def settled(
    now: float, other: float, felt_now: float, felt_other: float, own: float, cross: float
) -> float:
    """Acceleration that a bearing would have if its load had assumed just this value [m/s^2].

    Masses carried by a bearing react to its acceleration at once:
    `a = a_0 - G a_assumed`, hence `a = (1 + G)^-1 a_0` for `a_assumed = a`. Computed from `a` as
    `a + (1 + G)^-1 G (a_assumed - a)`.

    Parameters
    ----------
    now, felt_now : float
        One direction: from the forces of the step, and as assumed by the mechanism in the step.
    other, felt_other : float
        The same for the other direction.
    own, cross : float
        Entries of `(1 + G)^-1 G`.
    """
    return now + own * (felt_now - now) + cross * (felt_other - other)


@kernel
def extrapolated(now: float, before: float, older: float) -> float:
    """Mean over the next step, extrapolated by the parabola through the last three means.

    Only the forces on the modes and the acceleration assumed by the mechanism are extrapolated: the
    modes' own vibration in the next step follows from their state. Extrapolating the bearing's
    acceleration including that vibration left up to 1.5 dB in the band of the highest modes at two
    steps per sample; linear extrapolation leaves up to 1.3 dB in such pumps, constant values up to
    4.5 (docs/decisions/024).
    """
    return 3.0 * (now - before) + older


@kernel
def _push_modes(y: Any, moved: Any, forces: Any, step: int, t: Any) -> None:
    """Force on every mode in a step, stored before those of the two preceding steps."""
    for mode in range(y.react.shape[0]):
        force = 0.0
        for k in range(y.push.shape[1]):
            own = 0.0
            for n in range(len(PUSHES)):
                own += y.push[mode, k, n] * forces[step, 1 + len(FORCES) * k + PUSHES[n]]
            force += own
        for n in range(t.bearing.shape[0]):
            first = 1 + len(FORCES) * y.push.shape[1] + 2 * n
            force += y.journal[mode, 0] * forces[step, first]
            force += y.journal[mode, 1] * forces[step, first + 1]
        moved[mode, 4], moved[mode, 3] = moved[mode, 3], moved[mode, 2]
        moved[mode, 2] = force


@kernel
def _carried(y: Any, moved: Any, ahead: bool) -> Any:
    """Acceleration of the bearing from the modes, in the last step or (`ahead`) the next one."""
    along, across = 0.0, 0.0
    for mode in range(y.react.shape[0]):
        r, force = y.react[mode], moved[mode, 2]
        if ahead:
            force = extrapolated(force, moved[mode, 3], moved[mode, 4])
        a = mode_response(force, moved[mode, 0], moved[mode, 1], r[0], r[1], r[2])
        along += y.give[mode, 0] * a
        across += y.give[mode, 1] * a
    return along, across


@kernel
def _move_modes(y: Any, moved: Any, late_x: float, late_y: float, h: float) -> None:
    """Advance the modes; a wrongly assumed acceleration of the bearing acts on them as a force."""
    for mode in range(y.react.shape[0]):
        r, to, q, v = y.react[mode], y.reach[mode], moved[mode, 0], moved[mode, 1]
        force = moved[mode, 2] + y.held[mode, 0] * late_x + y.held[mode, 1] * late_y
        moved[mode, 0] = mode_response(force, q, v, to[0], to[1], to[2])
        moved[mode, 1] = v + h * mode_response(force, q, v, r[0], r[1], r[2])


@kernel
def on_moving_bearing(
    y: Any, moved: Any, felt: Any, forces: Any, step: int, h: float, weight: Any, t: Any
) -> Any:
    """Tables for the next step, with the casing's acceleration added to the weight.

    In the frame of a moving bearing, every mass has its acceleration as additional weight. Forces
    are means over the last step; `weight` is that at rest, along and across; `felt` holds the
    acceleration assumed in the last step and the two before. The error of that assumption
    acts on the modes as a force, by the carried mass.
    """
    _push_modes(y, moved, forces, step, t)
    along, across = _carried(y, moved, False)
    b, was, before, older = y.blend, felt[0], felt[1], felt[2]
    now_x = settled(along, across, was[0], was[1], b[0, 0], b[0, 1])
    now_y = settled(across, along, was[1], was[0], b[1, 1], b[1, 0])
    _move_modes(y, moved, was[0] - now_x, was[1] - now_y, h)
    along, across = _carried(y, moved, True)
    next_x = extrapolated(was[0], before[0], older[0])
    next_y = extrapolated(was[1], before[1], older[1])
    older[0], older[1], before[0], before[1] = before[0], before[1], was[0], was[1]
    was[0] = settled(along, across, next_x, next_y, b[0, 0], b[0, 1])
    was[1] = settled(across, along, next_y, next_x, b[1, 1], b[1, 0])
    m = t.machine
    machine = Machine(
        weight[0] + was[0],
        weight[1] + was[1],
        m.inverse_inertia,
        m.static_moment,
        m.drive_moment,
        m.synchronous_speed,
        m.breakdown_moment,
        m.breakdown_slip,
        m.baumgarte,
    )
    return Tables(
        t.throws,
        t.contacts,
        t.liquid,
        t.oils,
        t.maps,
        t.bearing,
        t.bore,
        t.bore_oil,
        t.flex,
        machine,
    )
