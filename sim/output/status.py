"""How a run ended, with the cure of a failure; independent of the physics."""

from enum import IntEnum
from typing import Self


class Ending(IntEnum):
    """How something ended: a code, zero if the result is usable, and a sentence with the cure."""

    text: str

    def __new__(cls, code: int, text: str = "") -> Self:
        """Create a member; from its code alone, for the look-up."""
        member = int.__new__(cls, code)
        member._value_, member.text = code, text
        return member

    @property
    def ok(self) -> bool:
        """Whether it ended without failure."""
        return self == 0


class Status(Ending):
    """How a run ended. Every status except OK includes a cure."""

    OK = 0, "done"
    DIVERGED = 1, "the state is no longer finite; shorten numerics.step"
    OVERLAP = (
        2,
        "a joint's penetration exceeds a tenth of its pin radius, beyond the contact law; "
        "raise joint.crankpin.stiffness or lower the speed",
    )
    LOCKED = 3, "the rod is perpendicular to the stroke; lengthen rod.length or lower the clearance"
    CHAMBER = (
        4,
        "the cylinder pressure left all bounds, or the piston filled the whole chamber; "
        "raise pressure.dead_volume or shorten numerics.step",
    )
    STEP = (
        5,
        "the step is too long for the contact; shorten numerics.step, or lower "
        "stiffness and damping of the joint",
    )
    UNRESOLVED = (
        6,
        "a joint's clearance is smaller than its stiffness resolves; raise the stiffness, "
        "or set the joint's rung to 'ideal'",
    )
    VAPOUR = (
        7,
        "the pressure falls below the vapour pressure, which the rung 'heads' does not model; "
        "set pressure.rung = 'chamber', shorten the suction line, or lower the speed; if only "
        "knocks cause it, set pressure.flow = 'two-harmonic'",
    )
    VALVE_OPEN = (
        8,
        "a valve does not close in its idle stroke; raise the valve's stiffness or preload_lift, "
        "or lower the speed",
    )
    SQUEEZE = (
        9,
        "the step is too long for the squeeze stiffness of the film; shorten numerics.step, or set "
        "numerics.integrator = 'adaptive'",
    )
    THIN_FILM = (
        10,
        "the journal came nearer to the shell than the film's mesh or map resolves; lower load or "
        "unbalance, refine film.n_theta, or give bearing.wall a contact law",
    )
    OVERLOAD = (
        11,
        "the steady load on the journal exceeds the capacity of its film; lower load.static, or "
        "raise speed, oil.viscosity or bearing.length",
    )
    TOUCH = (
        12,
        "the journal touches its shell; lower load or unbalance, or give bearing.wall a contact "
        "law",
    )
    WALL = (
        13,
        "the journal sinks into its shell by more than a tenth of the clearance, beyond the "
        "contact law; raise bearing.wall.stiffness",
    )
    NO_PRESSURE = (
        14,
        "the film solver found no pressure at some steps; set film.rung = 'map', or raise "
        "film.n_theta",
    )
    TOO_MANY_STEPS = (
        15,
        "the adaptive integrator reached its limit of steps; raise numerics.tolerance, or shorten "
        "duration",
    )
    LINE_OVERLOAD = (
        16,
        "the film of a bearing cannot carry its load from the line; lower the bearing's offset, "
        "or raise oil viscosity, speed or the bearing's length",
    )
    LINE_EDGE = (
        17,
        "the shaft touches the edge of a bearing; bring the slope of its bore nearer to that of "
        "the shaft, lower its offset, or raise its diametral_clearance",
    )
    LINE_BALANCE = (
        18,
        "shaft and oil films found no equilibrium; bring the offsets nearer to a fair line, or "
        "raise film.n_theta and film.n_z",
    )
    LINE_COARSE = (
        19,
        "the film of a bearing is too thin for its mesh; raise film.n_theta, or lower the "
        "bearing's offset",
    )
    LINE_MOTION = (
        20,
        "the journal would move by more than its film thickness, beyond the linear response; lower "
        "unbalance, blade_rate or turbulence",
    )
    LINE_UNSTABLE = (
        21,
        "the line is unstable on its films and would whirl without bound; load the bearings more "
        "evenly, or lower the speed",
    )
    SLENDER = (
        22,
        "the force along an elastic rod softens its bending; raise rod.section_radius or "
        "rod.section_area, or set rod.rung = 'rigid'",
    )

    def __str__(self) -> str:
        """Name and cure in words.

        Examples
        --------
        >>> print(Status.TOO_MANY_STEPS)
        too many steps: the adaptive integrator reached its limit of steps; raise \
numerics.tolerance, or shorten duration
        """
        name = self.name.lower().replace("_", " ")
        return name if self.ok else f"{name}: {self.text}"


class SimulationError(RuntimeError):
    """A run failed, and the caller asked for an error."""

    def __init__(self, status: Status, where: str) -> None:
        self.status = status
        self.where = where
        super().__init__(f"{where}: {status}")

    def __reduce__(self) -> tuple[type[Self], tuple[Status, str]]:
        """How it leaves a worker process."""
        return type(self), (self.status, self.where)
