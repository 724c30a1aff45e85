"""Run of the crank mechanism: from tables and start to states, forces and status."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.parameters import PRESSURE_CHAMBER
from ..output.status import Status
from ..piping.coupling import PAIR
from ..piping.pipe import PIPE, PIPE_STATE
from .layout import (
    ANGLE,
    AT_REST,
    CHANGES,
    FLEX,
    FLOORED,
    FORCES,
    GAPS,
    IN_TENSION,
    JOINT_OILED,
    NOT_LOCATED,
    PER_THROW,
    SPEED,
    WITH_VAPOUR,
    LinePair,
    SharedLines,
    Tables,
    Yielding,
    force_column,
    scratch,
)
from .march import MarchRecord, Tally, integrate


@dataclass(frozen=True, kw_only=True)
class CrankTally:
    """Status and counts of a run of the mechanism.

    Attributes
    ----------
    steps : int
        Number of steps taken.
    step : float
        Integration step [s].
    status : Status
        How the run ended.
    peak_normal_force : float
        Largest contact force within the steps [N].
    contact_changes, cuts_refused : int
        Closings plus openings; steps with more changes than could be located.
    floored_closings : int
        Contacts that closed more slowly than their law's speed floor.
    tension_steps : int
        Steps that end with a massless link in tension, where contact would be lost.
    vapour_steps : int
        Steps, summed over throws, that end with vapour in a chamber.
    parted_steps, unsettled_steps : tuple of int
        Steps in which suction and discharge line held vapour; steps in which no line pressure
        matched the flow that the pump draws, and the rest was booked as an error.
    """

    steps: int
    step: float
    peak_normal_force: float
    status: Status = Status.OK
    contact_changes: int = 0
    cuts_refused: int = 0
    floored_closings: int = 0
    tension_steps: int = 0
    vapour_steps: int = 0
    parted_steps: tuple[int, ...] = ()
    unsettled_steps: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class CrankRun(CrankTally):
    """A run of the mechanism with all its steps.

    Attributes
    ----------
    turns : numpy.ndarray [shape=(n_steps + 1, 2)]
        Crank angle [rad] and speed [rad/s] at the ends of the steps.
    forces : numpy.ndarray [shape=(n_steps, 1 + 10 n_throws)]
        Drive moment [N m], then per throw the columns of :data:`FORCES` [N], means over each step;
        with play in the main bearings two more, :data:`CRANK_FORCES`.
    bodies : numpy.ndarray [shape=(n_steps + 1, n_throws, 12)] or None
        Columns as :data:`BODY`, then their rates, at the ends of the steps; the mean of two rows is
        the state in the middle of a step, where its forces apply. None if not kept.
    chambers : numpy.ndarray [shape=(n_steps + 1, n_throws, 6)] or None
        Columns as ``CHAMBER_STATE``; None without chambers.
    gaps : numpy.ndarray [shape=(n_steps + 1, n_throws, 4)] or None
        Columns as :data:`GAPS`, at the starts of the steps' last stage; None without oiled pins.
    ends : numpy.ndarray [shape=(n_steps + 1, 2)] or None
        Pressure [Pa] of suction and discharge line at the pump, means over the preceding steps;
        None if no line is modelled.
    journal : numpy.ndarray [shape=(n_steps + 1, 4)] or None
        Position of the crank's journal from the centre of its bore (x, y) [m], and velocity [m/s],
        at the ends of the steps; None without play in the main bearings or if states are not kept.
    bore_gaps : numpy.ndarray [shape=(n_steps + 1, 2)] or None
        Least gap of the film of the main bearings [m], and force of its asperities [N], like
        `gaps`; None without oil.
    flex : numpy.ndarray [shape=(n_steps + 1, n_throws, 4)] or None
        Stretch and bow of every rod [m], then their rates, as :data:`FLEX`, at the ends of the
        steps; None if rods are rigid or states are not kept.
    """

    turns: NDArray[np.float64]
    forces: NDArray[np.float64]
    bodies: NDArray[np.float64] | None
    chambers: NDArray[np.float64] | None
    gaps: NDArray[np.float64] | None = None
    ends: NDArray[np.float64] | None = None
    journal: NDArray[np.float64] | None = None
    bore_gaps: NDArray[np.float64] | None = None
    flex: NDArray[np.float64] | None = None

    def force(self, name: str, throw: int = 0) -> NDArray[np.float64]:
        """One column of the forces by its name in :data:`FORCES` or :data:`CRANK_FORCES` [N]."""
        n_throws = (self.forces.shape[1] - 1) // len(FORCES)
        return self.forces[:, force_column(name, throw, n_throws)]


_NO_LINES = LinePair(
    pipes=np.zeros(0, PIPE),
    states=np.zeros(0, PIPE_STATE),
    suction_nodes=np.zeros((4, 1)),
    discharge_nodes=np.zeros((4, 1)),
)


def run_mechanism(
    t: Tables,
    *,
    angle: float,
    speed: float,
    bodies: NDArray[np.float64],
    step: float,
    n_steps: int,
    chambers: NDArray[np.float64] | None = None,
    films: NDArray[np.float64] | None = None,
    journal: NDArray[np.float64] | None = None,
    flex: NDArray[np.float64] | None = None,
    lines: LinePair | None = None,
    casing: Yielding = AT_REST,
    keep_states: bool = True,
) -> CrankRun:
    """Integrate the mechanism with contact in its clearances.

    Parameters
    ----------
    t : Tables
        Validated by the scene, not checked again.
    angle, speed : float
        Crank angle [rad] and speed [rad/s] at the start.
    bodies : numpy.ndarray [shape=(n_throws, 12)]
        Columns as :data:`BODY`, then their rates. Ideal joints and links must be closed.
    step : float
        Integration step [s].
    n_steps : int
        Number of steps to take.
    chambers : numpy.ndarray [shape=(n_throws, 6)], optional
        State of the chambers at the start.
    films : numpy.ndarray [shape=(n_throws, 4)], optional
        Columns as :data:`FILM`, at the start; within the clearances.
    journal : numpy.ndarray [shape=(6,)], optional
        Position of the crank's journal from the centre of its bore (x, y) [m], velocity [m/s], and
        film position [m], at the start, if the main bearings have play.
    flex : numpy.ndarray [shape=(n_throws, 4)], optional
        Stretch and bow of every elastic rod [m], then their rates, at the start; default 0.
    lines : LinePair, optional
        Lines shared by the chambers of all throws, which all need a chamber; replaced by their
        state at the end.
    casing : Yielding
        Casing that carries the main bearing; bodies are described relative to the bearing.
    keep_states : bool
        Keep the bodies at the ends of all steps.

    Returns
    -------
    CrankRun
        Truncated at the step that failed if the status is not OK.
    """
    n = len(t.throws)
    rows = n_steps + 1 if keep_states else 1
    chambered = bool(np.any(t.throws["pressure_rung"] == PRESSURE_CHAMBER))
    oiled = bool(
        np.any(t.throws["crankpin_rung"] == JOINT_OILED)
        or np.any(t.throws["wristpin_rung"] == JOINT_OILED)
    )
    w = scratch(n, len(t.bearing), len(t.flex))
    shared = SharedLines(
        lines=_NO_LINES if lines is None else lines,
        pairs=np.zeros(1, PAIR),
        trials=np.zeros((n, 6)),
    )
    if lines is not None:  # the pressures before and after the valves are those of the lines
        t = t._replace(liquid=t.liquid.copy())
    w.crank[0, ANGLE], w.crank[0, SPEED] = angle, speed
    w.stage["y"][0] = bodies
    if films is not None:
        w.stage["film"][0] = films
    if journal is not None and len(t.bearing):
        w.journal["y"][0, 0], w.journal["film"][0, 0] = journal[:4], journal[4:]
    if flex is not None:
        w.flex["y"][0] = flex
    chamber = np.zeros((n, 8))
    if chambers is not None:
        chamber[:, :6] = chambers
    r = MarchRecord(
        turns=np.empty((n_steps + 1, 2)),
        forces=np.zeros((n_steps, 1 + n * len(FORCES) + 2 * len(t.bearing))),
        states=np.empty((rows, n, PER_THROW)),
        chambers=np.empty((n_steps + 1 if chambered else 1, n, 8)),
        gaps=np.zeros((n_steps + 1 if oiled else 1, n, len(GAPS))),
        ends=np.zeros((n_steps + 1 if lines else 1, 2)),
        journal=np.empty((rows if len(t.bearing) else 1, 4)),
        bore_gaps=np.empty((n_steps + 1 if np.any(t.bearing["rung"] == JOINT_OILED) else 1, 2)),
        flex=np.empty((rows if len(t.flex) else 1, n, 2 * len(FLEX))),
    )
    tally = Tally(counts=np.zeros(5, np.int64), peak=np.zeros(1))
    moved, felt = np.zeros((len(casing.react), 5)), np.zeros((3, 2))
    code, done = integrate(step, t, casing, moved, felt, w, chamber, shared, r, tally)
    return CrankRun(
        steps=done,
        turns=r.turns[: done + 1],
        forces=r.forces[:done],
        bodies=r.states[: done + 1] if keep_states else None,
        chambers=r.chambers[: done + 1, :, :6] if chambered else None,
        gaps=r.gaps[: done + 1] if oiled else None,
        ends=r.ends[: done + 1] if lines else None,
        journal=r.journal[: done + 1] if keep_states and len(t.bearing) else None,
        bore_gaps=r.bore_gaps[: done + 1] if len(r.bore_gaps) > 1 else None,
        flex=r.flex[: done + 1] if keep_states and len(t.flex) else None,
        step=step,
        status=Status(code),
        peak_normal_force=float(tally.peak[0]),
        contact_changes=int(tally.counts[CHANGES]),
        cuts_refused=int(tally.counts[NOT_LOCATED]),
        floored_closings=int(tally.counts[FLOORED]),
        tension_steps=int(tally.counts[IN_TENSION]),
        vapour_steps=int(tally.counts[WITH_VAPOUR]),
        parted_steps=tuple(int(steps) for steps in shared.lines.states["parted"]),
        unsettled_steps=tuple(int(steps) for steps in shared.lines.states["unsettled"]),
    )
