"""Tables and states of the lanes, as the kernels use them."""

from typing import Any, NamedTuple

import numpy as np

from ..film.map_look_up import MapPlace
from ..hydraulics.valves import ValveSide
from ..jit import kernel
from ..mechanism.layout import CONTACTS, PUSHES, Machine
from ..mechanism.oiled_joint import FilmPull
from ..mechanism.throw_motion import Pose
from .fields import fields_of

DRY, SHORT_FILM, MAPPED_FILM = range(3)
"""Models of the crank pins' eyes."""

LANES = 16
"""Number of lanes; the compiler does not vectorise fewer."""

MOVING, ALL_MOVING = 5, 7
"""Rows of a motion, see :data:`PLACES`: without those of an ideal guide, and all."""

ROD_X, ROD_Y, BETA, PISTON_X, CRANK, PISTON_Y, TILT = range(ALL_MOVING)
"""Rows of positions, velocities and accelerations; those held by an ideal guide come last."""

PLACES = (ROD_X, ROD_Y, BETA, PISTON_X, PISTON_Y, TILT)
"""Rows of the coordinates of ``BODY``."""

LANE_FORCES = ("pin_x", "pin_y", "guide_y", "piston_x", "seal_x", "guide_x")
"""Rows of the forces: those of ``FORCES`` on the casing, except the valves'."""

PIN_X_FORCE, PIN_Y_FORCE, GUIDE_Y_FORCE, FACE_FORCE, SEAL_FORCE, GUIDE_X_FORCE = range(
    len(LANE_FORCES)
)

CHAMBER_COLUMNS = 8
"""Columns of a chamber: ``CHAMBER_STATE``, then position and velocity of its piston."""


class ThrowLane(NamedTuple):
    """Parameters of a throw in a lane, as in ``THROW``."""

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
    tight_wrist: float  # 1 if an ideal wrist pin joins rod and piston, else 0
    tight_guide: float  # 1 if an ideal guide supports the piston, else 0


class ContactLane(NamedTuple):
    """Parameters of a contact in a lane, as in ``CONTACT``."""

    law: float
    elasticity: float
    stiffness: float
    damping: float
    hysteresis: float
    clearance: float
    slot: float
    speed_floor: float
    release: float
    friction_law: float
    friction: float
    friction_speed: float
    friction_dead_speed: float
    tangential_damping: float


class LiquidLane(NamedTuple):
    """Parameters of a pressure in a lane, as in ``HYDRAULIC``."""

    rung: float
    suction: float
    discharge: float
    fall_delay: float
    fall_angle: float
    rise_delay: float
    rise_angle: float


class ChamberLane(NamedTuple):
    """Parameters of a chamber in a lane, as in ``HYDRAULIC``; its valves are ``ValveSide``."""

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
    """Parameters of the oil of a crank pin in a lane, as in ``OIL``."""

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
"""Clearance of an ideal joint: so large that it never touches or changes."""

MOST_MODES = 16
"""Most modes of a casing that yields in lanes; one with more runs alone."""

PUSH, REACT, REACH, GIVE, HELD, MOVED, _MODE_ROWS = np.cumsum(
    [0, len(PUSHES), 3, 3, 2, 2, 5]
).tolist()
"""First rows of a mode's parameters, as in ``Yielding``, and of its position, speed and last three
forces."""

CASING = np.dtype([("modes", "f8", (MOST_MODES, _MODE_ROWS, LANES))])
"""Modes of the casings of all lanes, parameters and state of each in one block: the compiler
vectorises a loop over lanes only if it knows the distance of what it reads from what it writes."""

PLAIN_LAWS = tuple(
    ContactLane._fields.index(name) for name in ("law", "elasticity", "friction_law")
)
"""Columns of a contact that are 0 for the plain laws: spring and dashpot, smooth
friction. A loop for these needs one root and one division instead of three and four."""

PLAN = np.dtype(
    [
        ("throw", "f8", (len(ThrowLane._fields), LANES)),
        ("contact", "f8", (3, len(ContactLane._fields), LANES)),
        ("throws", "i8"),  # of every record: they lie in adjacent lanes, in their order
        ("driven", "f8"),  # 1 if any lane's crank has a motor; else all speeds are constant
        ("plain", "f8", 3),  # 1 if all lanes' contacts in a joint have the plain laws
        ("machine", "f8", (len(Machine._fields), LANES)),
        ("liquid", "f8", (len(LiquidLane._fields), LANES)),
        ("chamber", "f8", (len(ChamberLane._fields), LANES)),
        ("oil", "f8", (len(OilLane._fields), LANES)),
        ("valve", "f8", (2, len(ValveSide._fields), LANES)),  # suction, discharge
        ("share", "f8", (2, 3, LANES)),  # see valve_shares
        ("step", "f8", LANES),
        ("sixth", "f8", LANES),  # of the step
        ("weight", "f8", LANES),  # of a step's force in its mean, as in the march of one record
        ("modes", "i8"),  # of the casing with the most modes
        ("gravity", "f8", (2, LANES)),  # of a bearing at rest
        ("blend", "f8", (2, 2, LANES)),  # as ``Yielding``
    ]
)
"""Parameters of all lanes, codes as floats too; columns as the fields of the tuples above."""

STATE = np.dtype(
    [
        ("x0", "f8", (ALL_MOVING, LANES)),  # at the start of the step
        ("v0", "f8", (ALL_MOVING, LANES)),
        ("a0", "f8", (ALL_MOVING, LANES)),
        ("force0", "f8", (len(LANE_FORCES), LANES)),
        ("margin0", "f8", (CONTACTS, LANES)),
        ("approach0", "f8", (CONTACTS, LANES)),
        ("normal0", "f8", LANES),
        ("x", "f8", (ALL_MOVING, LANES)),  # at the current stage
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
        ("moment", "f8", LANES),  # of all throws on the crank, in each throw's lane
        ("lead", "f8", (2, LANES)),  # sine and cosine of the crank at the first throw
        ("guide", "f8", (3, LANES)),  # force of a guide with play (x, y), and its moment
        ("middle_v", "f8", (ALL_MOVING, LANES)),  # sum over the middle stages
        ("middle_a", "f8", (ALL_MOVING, LANES)),
        ("middle_force", "f8", (len(LANE_FORCES), LANES)),
        ("high", "f8", LANES),  # largest normal force of the step
        ("peak", "f8", LANES),  # of all steps
        ("touching", "f8", (CONTACTS, LANES)),  # 0 or 1
        ("impact", "f8", (CONTACTS, LANES)),
        ("pressure0", "f8", (2, LANES)),  # on the piston at both ends of a chamber's step
        ("pressure", "f8", (2, LANES)),  # the same, for the current step
        ("chamber0", "f8", (CHAMBER_COLUMNS, LANES)),  # at the start of the step
        ("chamber", "f8", (CHAMBER_COLUMNS, LANES)),
        ("air", "f8", LANES),  # of the chamber at the start of the step
        ("flow", "f8", (2, LANES)),  # impulses of the valves
        ("sure", "f8", LANES),  # 1 if the vectorised step of the chambers is valid
        ("choked", "f8", LANES),  # 1 if a chamber has failed
        ("film0", "f8", (2, LANES)),  # film position of the pin at the start of the step
        ("film_rate0", "f8", (2, LANES)),
        ("film", "f8", (2, LANES)),
        ("film_rate", "f8", (2, LANES)),
        ("middle_film", "f8", (2, LANES)),  # rates, sum over the middle stages
        ("squeeze0", "f8", (2, LANES)),  # velocity of the film, start of the next search
        ("squeeze", "f8", (2, LANES)),
        ("offset", "f8", (4, LANES)),  # see crank_offset
        ("rough", "f8", (2, LANES)),  # see peaks_of
        ("pull", "f8", (len(FilmPull._fields), LANES)),
        ("place", "f8", (len(MapPlace._fields), LANES)),
        ("patch", "f8", (4, LANES)),  # see map_patches
        ("settled", "f8", LANES),  # 1 if the film's velocity has converged
        ("gap", "f8", LANES),  # least film
        ("carried", "f8", LANES),  # by asperities
        ("asks", "f8", LANES),  # 1 if a contact needs a change within this step
        ("bad", "f8", LANES),  # status code of this step
        ("pushed", "f8", LANES),  # force of a throw on a mode of the casing
        ("bearing", "f8", (2, LANES)),  # its acceleration, zero between steps
        ("assumed", "f8", (2, LANES)),  # acceleration of the bearing in the mechanism's step
        ("assumed_before", "f8", (2, 2, LANES)),  # one and two steps before
        ("late", "f8", (2, LANES)),  # assumed minus actual acceleration
    ]
)
"""All lanes in the middle of their step. One record: the compiler vectorises a loop if it
sees that what it writes is not what it reads."""


@kernel
def throw_of(p: Any, lane: int) -> Any:
    """Parameters of the throw of a lane."""
    return fields_of(ThrowLane, p.throw, lane)


@kernel
def contact_of(p: Any, j: int, lane: int) -> Any:
    """Parameters of one contact of a lane."""
    return fields_of(ContactLane, p.contact[j], lane)


@kernel
def lane_pose(s: Any, lane: int) -> Any:
    """Coordinates and rates of a lane."""
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
def oil_of(p: Any, lane: int) -> Any:
    """Parameters of the oil in the crank pin of a lane."""
    return fields_of(OilLane, p.oil, lane)
