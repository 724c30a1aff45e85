"""Crank whose journal has play in its main bearings: its motion, and its effect on the throws.

The bearings are lumped into one, in the plane of the throws: the crank moves parallel to itself.
With the journal's position u from the centre of its bore, relative to the casing, the crank's mass
m and the eccentricity e of its centre of mass along the first throw, at crank angle a,

    m (u'' - e w^2 (cos a, sin a) + e w' (-sin a, cos a)) = -sum F - N - m g

where F are the forces of the pins on their rods and N that of the journal on its bore, by the same
laws as for a pin: contact and friction, or oil. The moments of both act on the crank about the
journal's centre, and so does that of its own weight, with the gravity g + u''.
"""

import math
from typing import Any

from ..jit import kernel
from .layout import JOINT_OILED, NO_CHANGE, PIN_FORCE, SPEED, SPEED_RATE
from .oiled_joint import oiled_joint
from .throw_motion import dry_pin, pin_touch


@kernel
def is_journal(k: int, t: Any) -> bool:
    """Whether a contact index is the crank's journal, which follows all throws."""
    found: bool = k == t.throws.shape[0]
    return found


@kernel
def with_play(offset: Any, w: Any, row: int, t: Any) -> Any:
    """Offset of a crank pin, see :func:`.throw_motion.crank_offset`, with the journal's play."""
    if t.bearing.shape[0] == 0:
        return offset
    d_x, d_y, v_x, v_y = offset
    u = w.journal[row, 0].y
    return d_x + u[0], d_y + u[1], v_x + u[2], v_y + u[3]


@kernel
def journal_margin(w: Any, row: int, t: Any) -> float:
    """Margin of the journal's contact, for locating its change [N]."""
    if t.bearing[0].rung == JOINT_OILED:
        return NO_CHANGE
    u, held = w.journal[row, 0].y, w.journal_held[0]
    touch, _, _ = pin_touch(u[0], u[1], u[2], u[3], held.touching != 0, held.impact, t.bore[0])
    margin: float = touch.margin
    return margin


@kernel
def _on_bore(w: Any, row: int, t: Any) -> float:
    """Store the journal's force on its bore in its row; return the moment on the crank [N m]."""
    b, journal, held = t.bearing[0], w.journal[row, 0], w.journal_held[0]
    u, s, omega = journal.y, journal.film, w.crank[row, SPEED]
    if b.rung == JOINT_OILED:
        f_x, f_y, moment, _, rate_x, rate_y, gap, peaks = oiled_joint(
            s[0],
            s[1],
            u[0],
            u[1],
            u[2],
            u[3],
            omega,
            0.0,
            held.squeeze,
            t.bore[0],
            t.bore_oil[0],
            t.maps,
        )
        journal.film_rate[0], journal.film_rate[1] = rate_x, rate_y
        journal.gaps[0], journal.gaps[1] = gap, peaks
        journal.force[0], journal.force[1] = f_x, f_y
        journal.margin, journal.normal = NO_CHANGE, math.sqrt(f_x * f_x + f_y * f_y)
        overlap = math.sqrt(u[0] * u[0] + u[1] * u[1]) - t.bore[0].clearance
        journal.overlap = overlap / b.radius
        turning: float = moment
        return turning
    load, touch = dry_pin(
        u[0],
        u[1],
        u[2],
        u[3],
        omega * b.radius,
        b.radius,
        held.touching != 0,
        held.impact,
        t.bore[0],
    )
    journal.force[0], journal.force[1] = load.x, load.y
    journal.margin, journal.approach = touch.margin, touch.approach
    journal.normal, journal.overlap = touch.normal, touch.overlap / b.radius
    rubbing: float = load.on_pin
    return rubbing


@kernel
def journal_motion(w: Any, row: int, t: Any, sin_a: float, cos_a: float) -> Any:
    """Acceleration of the journal (x, y) [m/s^2] at constant crank speed; adds to the moments.

    The crank's acceleration w' adds `e w' (sin a, -cos a)`, see :func:`spun_up`.
    """
    b, omega = t.bearing[0], w.crank[row, SPEED]
    w.moment[0] += _on_bore(w, row, t)
    w.moment[1] += t.machine.static_moment * b.eccentricity
    push_x, push_y = -w.journal[row, 0].force[0], -w.journal[row, 0].force[1]
    for k in range(t.throws.shape[0]):
        push_x -= w.stage[row, k].force[PIN_FORCE]
        push_y -= w.stage[row, k].force[PIN_FORCE + 1]
    flung = b.eccentricity * omega * omega
    return (
        push_x * b.inverse_mass - t.machine.gravity_x + flung * cos_a,
        push_y * b.inverse_mass - t.machine.gravity_y + flung * sin_a,
    )


@kernel
def spun_up(w: Any, row: int, t: Any, a_x: float, a_y: float, sin_a: float, cos_a: float) -> None:
    """Rates of the journal from its acceleration at constant speed and the crank's acceleration."""
    journal = w.journal[row, 0]
    swung = t.bearing[0].eccentricity * w.crank[row, SPEED_RATE]
    journal.rate[0], journal.rate[1] = journal.y[2], journal.y[3]
    journal.rate[2], journal.rate[3] = a_x + swung * sin_a, a_y - swung * cos_a
