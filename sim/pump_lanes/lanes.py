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
    NO_CHANGE,
    NOT_LOCATED,
    PER_THROW,
    WITH_VAPOUR,
    CrankRun,
    Tables,
)
from ..scene.pump import PumpScene
from .march import Stretch, alone, enter_lane, march
from .rates import (
    HELD_LANES,
    LANES,
    NEVER,
    PLAN,
    ROW,
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
        and rung != "heads"
    )
    if not known:
        return None
    return JOINT_COMPLIANT in (wristpin, guide), rung == "chamber"


_STRETCH = 1024  # steps: what they leave fits a processor's cache


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
    ahead, lanes = iter(longest), _Lanes(kind, jobs)
    while lanes.fill(ahead):
        lanes.go_on()
        yield from lanes.ended()


class _Lanes:
    """All lanes, what their runs are at, and what they have left behind so far."""

    def __init__(self, kind: tuple[bool, bool], jobs: Sequence[LaneJob]) -> None:
        self._play, self._breathing = kind
        self._jobs = jobs
        self._plan = np.zeros(1, PLAN)
        self._rows = np.zeros(5, ROW)
        self._rows["margin"] = NO_CHANGE
        self._held = np.zeros(1, HELD_LANES)
        self._row = 0
        self._number = np.full(LANES, -1)  # of the job in each lane
        self._at = np.zeros(LANES, np.int64)  # steps taken of it
        self._left = np.zeros(LANES, np.int64)
        self._alone = alone(jobs[0].tables)
        names = (
            *_ALWAYS,
            *(_WITH_PLAY if self._play else ()),
            *(_BREATHING if self._breathing else ()),
        )
        self._columns = np.array([1 + FORCES.index(name) for name in names])
        self._kept = Stretch(
            turns=np.zeros((_STRETCH, 2, LANES)),
            forces=np.zeros((_STRETCH, 1 + len(FORCES), LANES)),
            chambers=np.zeros((_STRETCH, LANES, 8)),
            code=np.ones(LANES, np.int64),
            done=np.zeros(LANES, np.int64),
        )
        most = max(job.n_steps for job in jobs)
        self._past = _Past(
            turns=np.empty((LANES, most + 1, 2)),
            forces=np.empty((LANES, len(names), most)),
            chambers=np.empty((LANES, most + 1 if self._breathing else 1, 1, 8)),
        )

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
        row, plan, held = self._rows[self._row], self._plan[0], self._held[0]
        a.throws[lane], a.contacts[lane], a.liquid[lane] = t.throws, t.contacts, t.liquid
        a.chambers[lane, 0] = 0.0
        a.chambers[lane, 0, :6] = start.chambers[0]
        q = t.throws[0]
        tight = (q["wristpin_rung"] == JOINT_IDEAL, q["guide_rung"] == JOINT_IDEAL)
        plan["throw"][:-2, lane] = _numbers(q, ThrowLane._fields[:-2])
        plan["throw"][-2:, lane] = tight
        for joint in range(3):
            plan["contact"][joint, :, lane] = _numbers(t.contacts[0, joint], ContactLane._fields)
        for joint in map(int, np.flatnonzero(tight) + 1):
            plan["contact"][joint, :, lane] = NEVER
        plan["machine"][:, lane] = t.machine
        plan["liquid"][:, lane] = _numbers(t.liquid[0], LiquidLane._fields)
        plan["step"][lane] = job.step
        for name in ("touching", "impact", "pressure"):
            held[name][:, lane] = 0.0
        for name in ("rate", "force", "approach"):
            row[name][:, lane] = 0.0
        row["y"][:PER_THROW, lane] = start.bodies[0]
        row["y"][PER_THROW:, lane] = start.angle, start.speed
        enter_lane(lane, plan, self._rows, self._row, held, a)
        self._past.turns[lane, 0] = start.angle, start.speed
        self._past.chambers[lane, 0] = a.chambers[lane]
        self._kept.code[lane] = 0
        self._number[lane], self._at[lane], self._left[lane] = number, 0, job.n_steps

    def go_on(self) -> None:
        """March until the first run ends, or as far as is kept at once."""
        busy = self._number >= 0
        n = int(min(_STRETCH, self._left[busy].min()))
        self._kept.done[:] = n
        self._row = march(
            self._play,
            self._breathing,
            n,
            self._plan[0],
            self._rows,
            self._row,
            self._held[0],
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
            columns=tuple(map(int, self._columns)),
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
