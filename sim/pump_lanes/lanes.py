"""The crank mechanism of many records side by side, compiled.

Records that differ only in their numbers take the same steps through the same arithmetic: laid side
by side, a lane each, the compiler does four at a time and hides what one waits for. The equations
are those of :mod:`.throw_motion`, so are the bytes: a lane's result does not depend on its place,
its neighbours or how many there are, and equals that of the record alone.

A step in which a contact of a lane changes is taken again for that lane by the march of one record,
which cuts it. A chamber with valves is stepped lane by lane. A failed lane is left behind.

Lanes are for one throw whose crank pin has clearance without oil, whose wrist pin and guide are
ideal or have clearance, under a pressure that follows from the crank angle, or a chamber.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import subroutine
from ..output.status import Status
from ..pump.setup import Start, joint_rungs
from ..pump.slider_crank import (
    CHANGES,
    FLOORED,
    FORCES,
    JOINT_COMPLIANT,
    JOINT_IDEAL,
    NOT_LOCATED,
    PER_THROW,
    WITH_VAPOUR,
    CrankRun,
    Tables,
)
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import PIPED_RUNGS
from .march import Stretch, alone, enter_lane, march
from .rates import (
    LANES,
    NEVER,
    PLAN,
    STATE,
    ContactLane,
    LiquidLane,
    ThrowLane,
)

_ALWAYS = ("pin_x", "pin_y", "guide_y", "piston_x")
_WITH_PLAY = ("guide_x",)
_BREATHING = ("suction_valve", "discharge_valve")
"""Forces of a throw on its casing: what is kept of every run, of those with play, of chambers."""


@dataclass(frozen=True, kw_only=True)
class LaneJob:
    """One run of the mechanism, as ``run_mechanism`` is told it."""

    tables: Tables
    start: Start
    step: float
    n_steps: int


def lane_kind(scene: PumpScene) -> tuple[bool, bool] | None:
    """Play beside the crank pin's, and whether a chamber breathes: lanes of one kind run together.

    None of a mechanism that lanes do not know.
    """
    crankpin, wristpin, guide = joint_rungs(scene, 0)
    rung = scene.pressures(0).rung
    known = (
        crankpin == JOINT_COMPLIANT
        and wristpin in (JOINT_IDEAL, JOINT_COMPLIANT)
        and rung not in ("heads", *PIPED_RUNGS)
    )
    if not known:
        return None
    return JOINT_COMPLIANT in (wristpin, guide), rung == "chamber"


_STRETCH = 512  # steps: what they leave fits a processor's cache


def run_lanes(jobs: Sequence[LaneJob], kind: tuple[bool, bool]) -> Iterator[tuple[int, CrankRun]]:
    """Run mechanisms of one kind side by side.

    Parameters
    ----------
    jobs : sequence of LaneJob
        Taken as lanes become free.
    kind : tuple of bool
        Of all of them, see :func:`lane_kind`.

    Yields
    ------
    number : int
        Of the job; in the order in which runs end.
    run : CrankRun
        Without bodies, with the forces on the casing alone. Its arrays are the lane's: they hold
        until the next run is asked for.
    """
    if not jobs:
        return
    longest = sorted(range(len(jobs)), key=lambda n: -jobs[n].n_steps)  # the last lanes end alike
    room = _spare_room.pop() if _spare_room else np.empty(0)
    ahead, lanes = iter(longest), _Lanes(kind, jobs, room)
    try:
        while lanes.fill(ahead):
            lanes.go_on()
            yield from lanes.ended()
    finally:
        _spare_room[:] = [lanes.room]


_spare_room: list[NDArray[np.float64]] = []
"""Of the last run of lanes: memory that is new costs as much time as what is written into it."""


class _Lanes:
    """All lanes, what their runs are at, and what they have left behind so far."""

    def __init__(
        self, kind: tuple[bool, bool], jobs: Sequence[LaneJob], room: NDArray[np.float64]
    ) -> None:
        self._play, self._breathing = kind
        self._jobs = jobs
        self._plan = np.zeros(1, PLAN)
        self._state = np.zeros(1, STATE)
        self._number = np.full(LANES, -1)  # of the job in each lane
        self._at = np.zeros(LANES, np.int64)  # steps taken of it
        self._left = np.zeros(LANES, np.int64)
        self._alone = alone(jobs[0].tables)
        names = (
            *_ALWAYS,
            *(_WITH_PLAY if self._play else ()),
            *(_BREATHING if self._breathing else ()),
        )
        self._columns = np.array([FORCES.index(name) for name in names])
        self._kept = Stretch(
            turns=np.zeros((_STRETCH, 2, LANES)),
            forces=np.zeros((_STRETCH, len(FORCES), LANES)),
            chambers=np.zeros((_STRETCH, LANES, 8)),
            code=np.ones(LANES, np.int64),
            done=np.zeros(LANES, np.int64),
        )
        most = max(job.n_steps for job in jobs)
        self.room, self._past = _past(most, len(names), self._breathing, room)

    def fill(self, ahead: Iterator[int]) -> bool:
        """Put the next jobs into free lanes; False where all is done."""
        for lane in np.flatnonzero(self._number < 0):
            number = next(ahead, None)
            if number is None:
                break
            self._enter(int(lane), number)
        return bool(np.any(self._number >= 0))

    def _enter(self, lane: int, number: int) -> None:
        job = self._jobs[number]
        t, a, start = job.tables, self._alone, job.start
        state, plan = self._state[0], self._plan[0]
        a.throws[lane], a.contacts[lane], a.liquid[lane] = t.throws, t.contacts, t.liquid
        a.chambers[lane, 0] = 0.0
        a.chambers[lane, 0, :6] = start.chambers[0]
        q = t.throws[0]
        tight = (q["wristpin_rung"] == JOINT_IDEAL, q["guide_rung"] == JOINT_IDEAL)
        plan["throw"][:-3, lane] = _numbers(q, ThrowLane._fields[:-3])
        plan["throw"][-3:, lane] = 1.0 / q["piston_mass"], *tight
        for joint in range(3):
            plan["contact"][joint, :, lane] = _numbers(t.contacts[0, joint], ContactLane._fields)
        for joint in map(int, np.flatnonzero(tight) + 1):
            plan["contact"][joint, :, lane] = NEVER
        plan["machine"][:, lane] = t.machine
        plan["liquid"][:, lane] = _numbers(t.liquid[0], LiquidLane._fields)
        plan["step"][lane], plan["sixth"][lane] = job.step, job.step / 6.0
        plan["weight"][lane] = job.step / (6.0 * job.step)
        for name in state.dtype.names:
            state[name][..., lane] = 0.0
        state["y0"][:PER_THROW, lane] = start.bodies[0]
        state["y0"][PER_THROW:, lane] = start.angle, start.speed
        enter_lane(lane, plan, state, a)
        self._past.turns[lane, 0] = start.angle, start.speed
        self._past.chambers[lane, 0] = a.chambers[lane]
        self._kept.code[lane] = 0
        self._number[lane], self._at[lane], self._left[lane] = number, 0, job.n_steps

    def go_on(self) -> None:
        """March until the first run ends, or as far as is kept at once."""
        busy = self._number >= 0
        n = int(min(_STRETCH, self._left[busy].min()))
        self._kept.done[:] = n
        march(
            self._play,
            self._breathing,
            n,
            self._plan[0],
            self._state[0],
            self._alone,
            self._kept,
        )
        take(self._kept, self._columns, n, self._at, self._past, self._breathing)
        done = np.where(busy, self._kept.done, 0)
        self._at += done
        self._left -= done

    def ended(self) -> Iterator[tuple[int, CrankRun]]:
        """Runs at their end, taken out of their lanes."""
        over = (self._number >= 0) & ((self._left == 0) | (self._kept.code != 0))
        if not over.any():
            return
        for lane in map(int, np.flatnonzero(over)):
            yield int(self._number[lane]), self._run(lane)
            self._number[lane], self._at[lane], self._kept.code[lane] = -1, 0, 1

    def _run(self, lane: int) -> CrankRun:
        n, past, counts = int(self._at[lane]), self._past, self._alone.counts[lane]
        return CrankRun(
            turns=past.turns[lane, : n + 1],
            forces=past.forces[lane, :, :n].T,
            columns=tuple(int(column) + 1 for column in self._columns),
            bodies=None,
            chambers=past.chambers[lane, : n + 1, :, :6] if self._breathing else None,
            step=float(self._plan["step"][0, lane]),
            peak_normal_force=float(self._alone.peak[lane, 0]),
            status=Status(int(self._kept.code[lane])),
            contact_changes=int(counts[CHANGES]),
            cuts_refused=int(counts[NOT_LOCATED]),
            floored_closings=int(counts[FLOORED]),
            vapour_steps=int(counts[WITH_VAPOUR]),
        )


class _Past(NamedTuple):
    """What the runs in the lanes have left behind."""

    turns: NDArray[np.float64]  # (LANES, n + 1, 2)
    forces: NDArray[np.float64]  # (LANES, n_kept, n)
    chambers: NDArray[np.float64]  # (LANES, n + 1, 1, 8); one row where nothing breathes


def _past(
    most: int, n_kept: int, breathing: bool, room: NDArray[np.float64]
) -> tuple[NDArray[np.float64], _Past]:
    """Room for `most` steps of all lanes, the old one where it is large enough, and its parts."""
    shapes = (
        (LANES, most + 1, 2),
        (LANES, n_kept, most),
        (LANES, most + 1 if breathing else 1, 1, 8),
    )
    ends = np.cumsum([math.prod(shape) for shape in shapes])
    if room.size < ends[-1]:
        room = np.empty(ends[-1])
    parts = np.split(room[: ends[-1]], ends[:-1])
    return room, _Past(*(part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)))


@subroutine
def take(k: Any, columns: Any, n: int, at: Any, past: Any, breathing: bool) -> None:
    """Add the last n steps of every lane to its past."""
    for lane in range(LANES):
        begin, steps = at[lane], min(n, k.done[lane])
        for j in range(columns.size):
            for i in range(steps):
                past.forces[lane, j, begin + i] = k.forces[i, columns[j], lane]
        for i in range(steps):
            past.turns[lane, begin + 1 + i, 0] = k.turns[i, 0, lane]
            past.turns[lane, begin + 1 + i, 1] = k.turns[i, 1, lane]
            if breathing:
                for c in range(8):
                    past.chambers[lane, begin + 1 + i, 0, c] = k.chambers[i, lane, c]


def _numbers(record: Any, names: Sequence[str]) -> list[float]:
    return [float(record[name]) for name in names]
