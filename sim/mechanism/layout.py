"""Tables, states and scratch memory of the crank mechanism's kernels."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from .throw_motion import Pose

JOINT_IDEAL, JOINT_LINK, JOINT_COMPLIANT, JOINT_OILED = 0, 1, 2, 3
"""Joint models from `JOINT_COMPLIANT` on are forces that follow from the motion."""

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
        ("seal_friction", "f8"),  # from the seal's tension [N]
        ("seal_friction_area", "f8"),  # additional, per pressure [N/Pa]
        ("seal_friction_speed", "f8"),  # regularises its sign [m/s]
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
"""Contacts per throw: crank pin, wrist pin, and the guide's corners, rear and front,
upper then lower."""


MAIN_BEARING = np.dtype(
    [
        ("inverse_mass", "f8"),  # of all that turns on it [1/kg]
        ("eccentricity", "f8"),  # of its centre of mass, along the first throw [m]
        ("radius", "f8"),  # of the journal [m]
        ("rung", "i8"),  # JOINT_COMPLIANT or JOINT_OILED
    ]
)
"""Main bearings with play, lumped into one; a crank without play has none."""


ROD_MODES = np.dtype(
    [
        ("length", "f8"),  # between the eyes [m]
        ("inverse_stretch_mass", "f8"),  # [1/kg]
        ("inverse_bow_mass", "f8"),
        ("stretch_stiffness", "f8"),
        ("bow_stiffness", "f8"),
        ("stretch_damping", "f8"),
        ("bow_damping", "f8"),
        ("crank_shape", "f8"),  # motion of the crank pin's eye across the rod, per bow
        ("wrist_shape", "f8"),
        ("crank_slope", "f8"),  # its turning [rad/m]
        ("wrist_slope", "f8"),
    ]
)
"""Modes of an elastic rod, see :mod:`.elastic_rod`; rigid rods have none."""

FLEX = ("stretch", "bow")
"""Coordinates of an elastic rod: stretch between its eyes, bow in the middle [m]; the state holds
these, then their rates."""

STRETCH, BOW, STRETCH_RATE, BOW_RATE = range(2 * len(FLEX))
"""Columns of an elastic rod's state."""


class Machine(NamedTuple):
    """Quantities shared by the throws, in SI."""

    gravity_x: float
    gravity_y: float
    inverse_inertia: float  # of everything that turns; 0: constant speed
    static_moment: float  # unbalance of the crank along the first throw [kg m]
    drive_moment: float  # constant part [N m]
    synchronous_speed: float  # of the motor, at the crank [rad/s]
    breakdown_moment: float  # largest moment of the motor [N m]; 0: none
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
The drive moment [N m] comes before them."""

CRANK_FORCES = ("main_x", "main_y")
"""Mean force over a step of a journal with play on its main bearing [N], after the throws'."""


def force_column(name: str, throw: int, n_throws: int) -> int:
    """Index of a force of a throw, counted from 0, or of the crank, among a run's columns."""
    if name in CRANK_FORCES:
        return 1 + len(FORCES) * n_throws + CRANK_FORCES.index(name)
    return 1 + len(FORCES) * throw + FORCES.index(name)


PIN_FORCE, WRIST_FORCE, GUIDE_FORCE, FACE_FORCE, SEAL_FORCE, VALVE_FORCES = (
    0,
    2,
    4,
    6,
    7,
    8,
)  # first columns of FORCES

FILM = ("crankpin_x", "crankpin_y", "wristpin_x", "wristpin_y")
"""Film positions of a throw's pins, from the centres of their eyes [m]."""

GAPS = ("crankpin_gap", "wristpin_gap", "crankpin_peaks", "wristpin_peaks")
"""Least gap of each film [m], and force of its asperities [N]; 0 for a joint without oil."""

OVERLAP_LIMIT = 0.1  # of the pin radius: limit of small-penetration contact laws

NO_CHANGE = 1.0  # margin of a contact that cannot change [N]


class Tables(NamedTuple):
    """All inputs of the kernel."""

    throws: NDArray[Any]  # (n_throws,) of THROW
    contacts: NDArray[Any]  # (n_throws, 3) of CONTACT
    liquid: NDArray[Any]  # (n_throws,) of HYDRAULIC
    oils: NDArray[Any]  # (n_throws, 2) of OIL
    maps: NDArray[np.float64]  # coefficients of all films that are maps, one after the other
    bearing: NDArray[Any]  # (0 or 1,) of MAIN_BEARING
    bore: NDArray[Any]  # (0 or 1,) of CONTACT: its journal in its bore
    bore_oil: NDArray[Any]  # (0 or 1,) of OIL
    flex: NDArray[Any]  # (0 or n_throws,) of ROD_MODES
    machine: Machine


class Yielding(NamedTuple):
    """A casing whose modes carry the main bearing; without modes it is at rest."""

    push: NDArray[np.float64]  # (n_modes, n_throws, len(PUSHES)): modal force per force
    react: NDArray[np.float64]  # mean acceleration over a step, per force and
    reach: NDArray[np.float64]  # displacement after it, per displacement and speed before it
    give: NDArray[np.float64]  # (n_modes, 2): shape at the bearing, along and across [kg^-0.5]
    held: NDArray[np.float64]  # modal reaction of the carried masses [kg^0.5]
    journal: NDArray[np.float64]  # (n_modes, 2): modal force per force of CRANK_FORCES
    blend: NDArray[np.float64]  # feedback of the acceleration, see `settled`


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
"""Columns of FORCES that act on the casing, in the order of summation."""

AT_REST = Yielding(
    push=np.zeros((0, 1, len(PUSHES))),
    react=np.zeros((0, 3)),
    reach=np.zeros((0, 3)),
    give=np.zeros((0, 2)),
    held=np.zeros((0, 2)),
    journal=np.zeros((0, 2)),
    blend=np.zeros((2, 2)),
)
"""Casing at rest."""

STAGE = np.dtype(
    [
        ("y", "f8", PER_THROW),
        ("rate", "f8", PER_THROW),
        ("force", "f8", len(FORCES)),
        ("margin", "f8", CONTACTS),
        ("approach", "f8", CONTACTS),
        ("normal", "f8"),  # largest normal force
        ("overlap", "f8"),  # largest overlap over the pin radius
        ("link", "f8"),  # least force in a link; negative: tension
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
"""State of one throw that is carried from step to step."""

JOURNAL = np.dtype(
    [
        ("y", "f8", 4),  # journal from the centre of its bore (x, y) [m], and velocity [m/s]
        ("rate", "f8", 4),
        ("force", "f8", 2),  # on the bearing (x, y) [N]
        ("margin", "f8"),
        ("approach", "f8"),
        ("normal", "f8"),
        ("overlap", "f8"),  # over the journal's radius
        ("film", "f8", 2),  # film position of the journal [m]
        ("film_rate", "f8", 2),
        ("gaps", "f8", 2),  # least gap of the film [m], and force of its asperities [N]
    ]
)
"""The journal of a crank in main bearings with play, at one stage of a step."""

JOURNAL_HELD = np.dtype([("touching", "i8"), ("impact", "f8"), ("squeeze", "f8", 2)])
"""State of the journal that is carried from step to step, like :data:`HELD`."""

ROD_STATE = np.dtype(
    [
        ("y", "f8", 2 * len(FLEX)),
        ("rate", "f8", 2 * len(FLEX)),
        ("rate_per_turn", "f8", len(FLEX)),  # of the rates, per crank acceleration
    ]
)
"""An elastic rod at one stage of a step."""

ANGLE, SPEED, ANGLE_RATE, SPEED_RATE, MOMENT = range(5)
"""Columns of the crank's stages."""

AT_JOINT, ALONG_X, ALONG_Y, RUBBING, NORMAL_X, NORMAL_Y = range(6)
"""Columns of a constraint force's place: its joint, its direction with the friction share
across it, and the normal of its equation."""

SIZE, SIZE_PER_TURN = 4, 5
"""Right-hand sides of the constraint equations, after elimination the constraint forces: at
constant crank speed, and per crank acceleration."""


class Work(NamedTuple):
    """Scratch memory of the march; nothing is allocated in its loop.

    Rows 0 and 1 alternate as ends of the step, rows 2 to 4 are the stages between them.
    """

    crank: NDArray[np.float64]  # (5, 5)
    stage: NDArray[Any]  # (5, n_throws) of STAGE
    held: NDArray[Any]  # (n_throws,) of HELD
    moment: NDArray[np.float64]  # (2,): on the crank, and per crank acceleration
    matrix: NDArray[np.float64]  # (4, 6): constraint equations with two right sides, see SIZE
    place: NDArray[np.float64]  # (4, 6): of each constraint force, see AT_JOINT
    journal: NDArray[Any]  # (5, 0 or 1) of JOURNAL
    journal_held: NDArray[Any]  # (0 or 1,) of JOURNAL_HELD
    flex: NDArray[Any]  # (5, 0 or n_throws) of ROD_STATE


def scratch(n_throws: int, n_bearings: int = 0, n_elastic: int = 0) -> Work:
    """Scratch memory of a march, all zeros."""
    return Work(
        crank=np.zeros((5, 5)),
        stage=np.zeros((5, n_throws), STAGE),
        held=np.zeros(n_throws, HELD),
        moment=np.zeros(2),
        matrix=np.zeros((4, 6)),
        place=np.zeros((4, 6)),
        journal=np.zeros((5, n_bearings), JOURNAL),
        journal_held=np.zeros(n_bearings, JOURNAL_HELD),
        flex=np.zeros((5, n_elastic), ROD_STATE),
    )


class LinePair(NamedTuple):
    """Suction and discharge line of all throws, in this order; without rows there are none."""

    pipes: NDArray[np.void]  # (2,) of PIPE
    states: NDArray[np.void]  # (2,) of PIPE_STATE
    suction_nodes: NDArray[np.float64]
    discharge_nodes: NDArray[np.float64]


class SharedLines(NamedTuple):
    """The lines with the scratch memory of their coupling."""

    lines: Any  # of LinePair
    pairs: NDArray[np.void]  # (1,) of PAIR
    trials: NDArray[np.float64]  # chambers at the end of a trial step


@kernel
def pose_of(b: Any) -> Any:
    """State of a throw at a stage, by the names of its columns."""
    y = b.y
    return Pose(y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11])


CHANGES, NOT_LOCATED, FLOORED, IN_TENSION, WITH_VAPOUR = range(5)
"""Counts of a run: contacts that closed or opened; steps with more than could be located;
closings below the law's speed floor; steps with a link in tension; steps with vapour."""
