"""How a run ended, and what helps where it failed. Knows no physics."""

from enum import IntEnum


class Status(IntEnum):
    """How a run ended. Everything but OK carries a cure."""

    OK = 0
    DIVERGED = 1
    OVERLAP = 2
    LOCKED = 3
    CHAMBER = 4
    STEP = 5
    UNRESOLVED = 6
    VAPOUR = 7
    VALVE_OPEN = 8
    SQUEEZE = 9
    THIN_FILM = 10
    OVERLOAD = 11
    TOUCH = 12
    WALL = 13
    NO_PRESSURE = 14
    TOO_MANY_STEPS = 15
    LINE_OVERLOAD = 16
    LINE_EDGE = 17
    LINE_BALANCE = 18
    LINE_COARSE = 19
    LINE_MOTION = 20
    LINE_UNSTABLE = 21

    @property
    def ok(self) -> bool:
        """True where the run can be used."""
        return self is Status.OK

    @property
    def text(self) -> str:
        """One sentence with the cure."""
        return _STATUS_TEXT[self]

    def __str__(self) -> str:
        """Name and cure in words.

        Examples
        --------
        >>> print(Status.TOO_MANY_STEPS)
        too many steps: the adaptive integrator used up its steps; raise numerics.tolerance or \
shorten duration
        """
        name = self.name.lower().replace("_", " ")
        return name if self.ok else f"{name}: {self.text}"


_STATUS_TEXT = {
    Status.OK: "done",
    Status.DIVERGED: "the state is no longer finite; shorten numerics.step",
    Status.OVERLAP: (
        "a joint's penetration exceeds a tenth of its pin radius, beyond the contact law; "
        "raise joint.crankpin.stiffness or lower the speed"
    ),
    Status.LOCKED: "the rod stands across the stroke; lengthen rod.length or lower the clearance",
    Status.CHAMBER: (
        "the cylinder pressure left all bounds, or the piston took up the whole chamber; "
        "raise pressure.dead_volume or shorten numerics.step"
    ),
    Status.STEP: (
        "the step is too long for the contact; shorten numerics.step, or lower "
        "stiffness and damping of the joint"
    ),
    Status.UNRESOLVED: (
        "a joint's clearance is smaller than its stiffness resolves; raise the stiffness, "
        "or set the joint's rung to 'ideal'"
    ),
    Status.VAPOUR: (
        "the pressure falls below that of the vapour, which the rung 'heads' does not know; "
        "set pressure.rung = 'chamber', shorten the suction line, or lower the speed; where only "
        "knocks do it, pressure.flow = 'two-harmonic' feels none"
    ),
    Status.VALVE_OPEN: (
        "a valve does not close in its idle stroke; raise the valve's stiffness or preload_lift, "
        "or lower the speed"
    ),
    Status.SQUEEZE: (
        "the step is too long for the squeeze stiffness of the film; shorten numerics.step, or set "
        "numerics.integrator = 'adaptive'"
    ),
    Status.THIN_FILM: (
        "the journal came nearer to the shell than the film's mesh or map resolves; lower load or "
        "unbalance, refine film.n_theta, or give bearing.wall a contact law"
    ),
    Status.OVERLOAD: (
        "no film of this bearing carries the load that rests on the journal; lower load.static, or "
        "raise speed, oil.viscosity or bearing.length"
    ),
    Status.TOUCH: (
        "the journal touches its shell; lower load or unbalance, or give bearing.wall a contact law"
    ),
    Status.WALL: (
        "the journal sinks into its shell by more than a tenth of the clearance, beyond the "
        "contact law; raise bearing.wall.stiffness"
    ),
    Status.NO_PRESSURE: (
        "the film solver found no pressure at some steps; set film.rung = 'map', or raise "
        "film.n_theta"
    ),
    Status.TOO_MANY_STEPS: (
        "the adaptive integrator used up its steps; raise numerics.tolerance or shorten duration"
    ),
    Status.LINE_OVERLOAD: (
        "the film of a bearing cannot carry what the line puts on it; lower the bearing's offset, "
        "or raise oil viscosity, speed or the bearing's length"
    ),
    Status.LINE_EDGE: (
        "the shaft touches the edge of a bearing; bring the slope of its bore nearer to that of "
        "the shaft, lower its offset, or raise its diametral_clearance"
    ),
    Status.LINE_BALANCE: (
        "shaft and oil films found no balance; bring the offsets nearer to a fair line, or raise "
        "film.n_theta and film.n_z"
    ),
    Status.LINE_COARSE: (
        "the film of a bearing is too thin for its mesh; raise film.n_theta, or lower the "
        "bearing's offset"
    ),
    Status.LINE_MOTION: (
        "the journal would move by more than its film is thick, beyond the linear response; lower "
        "unbalance, blade_rate or turbulence"
    ),
    Status.LINE_UNSTABLE: (
        "the line is unstable on its films and would whirl without bound; load the bearings more "
        "evenly, or lower the speed"
    ),
}


class SimulationError(RuntimeError):
    """A run ended in a status other than OK and the caller asked to be told so."""

    def __init__(self, status: Status, where: str) -> None:
        self.status = status
        super().__init__(f"{where}: {status}")
