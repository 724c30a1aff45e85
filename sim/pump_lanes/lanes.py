"""Crank mechanisms of many records in parallel, compiled.

Records that differ only in their parameters need the same arithmetic. Placed side by side, one per
lane, the compiler computes four at a time and overlaps their waiting times. The equations are those
of :mod:`.throw_motion`, and the bytes too: a lane's result does not depend on its position,
its neighbours or their number, and equals that of the record alone.

A step in which a contact of a lane changes is repeated for that lane by the march of one record,
which cuts it; so is that of a chamber whose pressure or valves are not found at once. A failed lane
stops.

Lanes are for throws whose crank pin has clearance, dry or oiled, whose wrist pin and guide are
ideal or have clearance, with a pressure by crank angle, or a chamber. Each throw has
a lane; those of a record are adjacent, and each has a copy of the crank.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.chamber import GATHERED
from ..hydraulics.valves import ValveSide
from ..jit import kernel, subroutine
from ..mechanism.crank_run import CrankTally
from ..mechanism.layout import (
    CHANGES,
    FLOORED,
    FORCES,
    JOINT_COMPLIANT,
    JOINT_IDEAL,
    JOINT_OILED,
    NOT_LOCATED,
    WITH_VAPOUR,
    Machine,
    Tables,
    Yielding,
)
from ..output.status import Status
from ..pump_setup.films import runs_on_a_map
from ..pump_setup.joints import JOINT_CODES, has_main_play, joint_parts, joint_rungs
from ..pump_setup.tables import Start
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import PIPED_RUNGS
from .lane_layout import (
    CASING,
    CRANK,
    DRY,
    GIVE,
    HELD,
    LANE_FORCES,
    LANES,
    MAPPED_FILM,
    MOST_MODES,
    MOVED,
    NEVER,
    PLACES,
    PLAIN_LAWS,
    PLAN,
    PUSH,
    REACH,
    REACT,
    SHORT_FILM,
    STATE,
    ChamberLane,
    ContactLane,
    LiquidLane,
    OilLane,
    ThrowLane,
)
from .march import LEFT, STRETCH, Stretch, march
from .one_lane import alone, enter_lane

Float = NDArray[np.float64]


class LaneKind(NamedTuple):
    """Properties of lanes that run together, in addition to play in their crank pins.

    Those that cost most when mixed come first.
    """

    chambers: bool  # chambers with valves
    throws: int  # per record, in adjacent lanes
    oil: int  # models of the crank pins' eyes, see ``MAPPED_FILM``
    guide: bool  # play in guides
    wrist: bool  # play in wrist pins
    yields: bool  # casings that carry their bearings along

    @property
    def records(self) -> int:
        """Number of records that the lanes hold."""
        return LANES // self.throws


@dataclass(frozen=True, kw_only=True)
class LaneJob:
    """One run of the mechanism, with the arguments of ``run_mechanism``."""

    tables: Tables
    start: Start
    step: float
    n_steps: int
    films: Float
    casing: Yielding


def lane_kind(scene: PumpScene) -> LaneKind | None:
    """Kind of lane of a scene; None for a mechanism that lanes do not support."""
    throws = range(len(scene.throws))
    crankpins, wristpins, guides = zip(*(joint_rungs(scene, k) for k in throws), strict=True)
    rungs = {scene.pressures(k).rung for k in throws}
    known = (
        len(throws) <= LANES
        and not has_main_play(scene)
        and scene.rod.rung == "rigid"
        and set(crankpins) in ({JOINT_COMPLIANT}, {JOINT_OILED})
        and {JOINT_IDEAL, JOINT_COMPLIANT}.issuperset(wristpins)
        and rungs.isdisjoint(("heads", *PIPED_RUNGS))
        and (len(rungs) == 1 or "chamber" not in rungs)  # all have chambers or none
    )
    oils = {_oil_of(joint_parts(scene, k)[0]) for k in throws}
    yields = scene.casing.rung == "yielding"
    # a film's search would start from another point than alone
    if yields and (oils != {DRY} or len(scene.casing.modes) > MOST_MODES):
        return None
    if not known or len(oils) > 1:
        return None
    return LaneKind(
        chambers="chamber" in rungs,
        throws=len(throws),
        oil=oils.pop(),
        guide=JOINT_COMPLIANT in guides,
        wrist=JOINT_COMPLIANT in wristpins,
        yields=yields,
    )


def _oil_of(crankpin: Any) -> int:
    if JOINT_CODES[crankpin.rung] != JOINT_OILED:
        return DRY
    return MAPPED_FILM if runs_on_a_map(crankpin) else SHORT_FILM


_ROOM = 8192  # steps of a lane that are passed on together


class Steps(Protocol):
    """Receiver of the steps of a run; it must not keep the arrays it gets."""

    def add(self, turns: Float, forces: Float, chambers: Float | None, gaps: Float | None) -> None:
        """Like :meth:`.Gathering.add`, with forces of :func:`lane_columns`."""


_INVERSE_INERTIA = Machine._fields.index("inverse_inertia")
_VALVES = ("suction_valve", "discharge_valve")


def _kept_rows(kind: LaneKind) -> tuple[int, ...]:
    """Rows of forces kept for lanes of a kind: those on the casing and the piston."""
    always = len(LANE_FORCES) - 1  # the last is friction in the guide
    friction = (always,) * kind.guide
    return (*range(always), *friction, *(always + 1, always + 2) * kind.chambers)


def lane_columns(kind: LaneKind) -> tuple[int, ...]:
    """Columns of a run's forces that lanes of a kind keep, by throw."""
    names = (*LANE_FORCES, *_VALVES)
    return tuple(
        1 + len(FORCES) * throw + FORCES.index(names[row])
        for throw in range(kind.throws)
        for row in _kept_rows(kind)
    )


def run_lanes(
    jobs: Sequence[LaneJob], kind: LaneKind, steps: Callable[[int], Steps]
) -> Iterator[tuple[int, CrankTally]]:
    """Run mechanisms of one kind in parallel.

    Parameters
    ----------
    jobs : sequence of LaneJob
        Started as lanes become free.
    kind : LaneKind
        Properties that any of them has; unused ones only cost time. Either all
        have chambers or none, and all have the same number of throws.
    steps : callable
        Called with the number of a job that starts; returns the receiver of its steps.

    Yields
    ------
    number : int
        Number of the job, in the order in which runs end.
    run : CrankTally
        Counts of the run, after all its steps were passed on.
    """
    if not jobs:
        return
    longest = sorted(range(len(jobs)), key=lambda n: -jobs[n].n_steps)  # to end together
    ahead, lanes = iter(longest), _Lanes(kind, jobs, steps)
    while lanes.fill(ahead):
        lanes.advance()
        yield from lanes.ended()


class _Lanes:
    """All lanes, the progress of their runs, and steps not yet passed on.

    A run has a lane for each of its throws; the first lane identifies it.
    """

    def __init__(
        self, kind: LaneKind, jobs: Sequence[LaneJob], steps: Callable[[int], Steps]
    ) -> None:
        self._kind, self._chambered, self._throws = kind, kind.chambers, kind.throws
        self._oiled = kind.oil != DRY
        self._firsts = range(0, LANES - kind.throws + 1, kind.throws)  # first lane of every run
        self._jobs, self._steps = jobs, steps
        self._receivers: dict[int, Steps] = {}  # by lane
        self._plan = np.zeros(1, PLAN)
        self._plan["throws"] = kind.throws
        self._state = np.zeros(1, STATE)
        self._casing = np.zeros(1, CASING)
        self._number = np.full(LANES, -1)  # job in each lane
        self._at = np.zeros(LANES, np.int64)  # its steps taken and not yet passed on
        self._left = np.zeros(LANES, np.int64)
        self._offsets, maps = _maps_of(jobs)
        self._alone = alone(jobs[0].tables, maps)
        self._columns = np.array(_kept_rows(kind))
        self._kept = Stretch(
            left=np.zeros(1, LEFT),
            code=np.ones(LANES, np.int64),
            done=np.zeros(LANES, np.int64),
        )
        self._past = _Past(
            turns=np.empty((LANES, 2, _ROOM + 1)),
            forces=np.empty((LANES, len(self._columns), _ROOM)),
            chambers=np.empty((LANES, len(GATHERED), _ROOM + 1 if self._chambered else 1)),
            gaps=np.zeros((LANES, 2, _ROOM + 1 if self._oiled else 1)),
        )

    def fill(self, ahead: Iterator[int]) -> bool:
        """Put the next jobs into free lanes; return False when all are done."""
        for lane in self._firsts:
            if self._number[lane] >= 0:
                continue
            number = next(ahead, None)
            if number is None:
                break
            self._enter(lane, number)
        return bool(np.any(self._number >= 0))

    def _enter(self, first: int, number: int) -> None:
        """Start a run in lanes from the first on."""
        job, plan, own = self._jobs[number], self._plan[0], slice(first, first + self._throws)
        for throw in range(self._throws):
            self._lay(first + throw, job, throw)
        plan["driven"] = plan["machine"][_INVERSE_INERTIA].any()
        plan["plain"] = ~plan["contact"][:, PLAIN_LAWS].any(axis=(1, 2))
        enter_lane(first, plan, self._state[0], self._alone, self._kind.oil != DRY)
        self._kept.code[own], self._number[own] = 0, number
        self._at[own], self._left[own] = 0, job.n_steps
        self._receivers[first] = self._steps(number)

    def _lay(self, lane: int, job: LaneJob, throw: int) -> None:
        """Write a throw and its initial state into its lane."""
        t, a, start = job.tables, self._alone, job.start
        state, plan = self._state[0], self._plan[0]
        q, liquid = t.throws[throw], t.liquid[throw]
        a.throws[lane], a.contacts[lane], a.liquid[lane] = q, t.contacts[throw], liquid
        a.chambers[lane] = 0.0
        a.chambers[lane, :6] = start.chambers[throw]
        tight = (q["wristpin_rung"] == JOINT_IDEAL, q["guide_rung"] == JOINT_IDEAL)
        plan["throw"][:-3, lane] = _numbers(q, ThrowLane._fields[:-3])
        plan["throw"][-3:, lane] = 1.0 / q["piston_mass"], *tight
        for joint in range(3):
            plan["contact"][joint, :, lane] = _numbers(
                t.contacts[throw, joint], ContactLane._fields
            )
        for joint in map(int, np.flatnonzero(tight) + 1):
            plan["contact"][joint, :, lane] = NEVER
        plan["machine"][:, lane] = t.machine
        plan["gravity"][:, lane] = t.machine.gravity_x, t.machine.gravity_y
        self._lay_casing(lane, job.casing, throw)
        plan["liquid"][:, lane] = _numbers(liquid, LiquidLane._fields)
        plan["chamber"][:, lane] = _numbers(liquid, ChamberLane._fields)
        for n, side in enumerate(("suction", "discharge")):
            names = [f"{side}_{name}" for name in ValveSide._fields]
            plan["valve"][n, :, lane] = _numbers(liquid, names)
        plan["step"][lane], plan["sixth"][lane] = job.step, job.step / 6.0
        plan["weight"][lane] = job.step / (6.0 * job.step)
        for name in state.dtype.names:
            state[name][..., lane] = 0.0
        state["x0"][PLACES, lane], state["v0"][PLACES, lane] = start.bodies[throw].reshape(2, -1)
        state["x0"][CRANK, lane], state["v0"][CRANK, lane] = start.angle, start.speed
        a.oils[lane] = t.oils[throw]
        a.oils[lane]["offset"] += self._offsets[t.maps.tobytes()]
        plan["oil"][:, lane] = _numbers(a.oils[lane, 0], OilLane._fields)
        state["film0"][:, lane] = job.films[throw, :2]
        self._past.turns[lane, :, 0] = start.angle, start.speed
        self._past.chambers[lane, :, 0] = start.chambers[throw, list(GATHERED)]

    def _lay_casing(self, lane: int, casing: Yielding, throw: int) -> None:
        """Write a casing into the lane of a throw; one at rest has no mode."""
        plan, n = self._plan[0], len(casing.react)
        plan["modes"] = max(plan["modes"], n)
        modes = self._casing["modes"][0, :, :, lane]  # a view
        modes[:] = 0.0
        modes[:n, PUSH:REACT] = casing.push[:, throw] if n else 0.0
        modes[:n, REACT:REACH], modes[:n, REACH:GIVE] = casing.react, casing.reach
        modes[:n, GIVE:HELD], modes[:n, HELD:MOVED] = casing.give, casing.held
        plan["blend"][..., lane] = casing.blend

    def advance(self) -> None:
        """March until the first run ends, or a lane's buffer is full."""
        march_lanes(
            self._kind,
            self._plan[0],
            self._state[0],
            self._casing[0],
            self._alone,
            self._kept,
            self._columns,
            self._at,
            self._left,
            self._past,
        )
        if np.any(self._at == _ROOM):  # all together, or one lane after the other would be full
            for first in self._firsts:
                if self._at[first]:
                    self._pass_on(first)

    def _pass_on(self, first: int) -> None:
        n, past, own = int(self._at[first]), self._past, slice(first, first + self._throws)
        chambers = past.chambers[own, :, : n + 1].transpose(2, 0, 1) if self._chambered else None
        columns = past.forces.shape[1]
        rows = slice(columns * own.start, columns * own.stop)
        forces = past.forces.reshape(-1, _ROOM)[rows, :n]  # throw by throw
        gaps = past.gaps[own, :, : n + 1].transpose(2, 0, 1) if self._oiled else None
        self._receivers[first].add(past.turns[first, :, : n + 1].T, forces, chambers, gaps)
        past.turns[own, :, 0] = past.turns[own, :, n]
        if self._chambered:
            past.chambers[own, :, 0] = past.chambers[own, :, n]
        if self._oiled:
            past.gaps[own, :, 0] = past.gaps[own, :, n]
        self._at[own] = 0

    def ended(self) -> Iterator[tuple[int, CrankTally]]:
        """Remove completed runs from their lanes."""
        over = (self._number >= 0) & ((self._left == 0) | (self._kept.code != 0))
        if not over.any():
            return
        for first in self._firsts:
            if not over[first]:
                continue
            if self._at[first]:
                self._pass_on(first)
            yield int(self._number[first]), self._tally(first)
            own = slice(first, first + self._throws)
            self._number[own], self._kept.code[own] = -1, 1

    def _tally(self, first: int) -> CrankTally:
        own = slice(first, first + self._throws)
        counts = self._alone.counts[own].sum(axis=0)
        job = self._jobs[int(self._number[first])]
        peak = max(self._alone.peak[first, 0], self._state["peak"][0, own].max())
        return CrankTally(
            steps=job.n_steps - int(self._left[first]),
            step=float(self._plan["step"][0, first]),
            peak_normal_force=float(peak),
            status=Status(int(self._kept.code[first])),
            contact_changes=int(counts[CHANGES]),
            cuts_refused=int(counts[NOT_LOCATED]),
            floored_closings=int(counts[FLOORED]),
            vapour_steps=int(counts[WITH_VAPOUR]),
        )


class _Past(NamedTuple):
    """Buffered steps of the lanes that were not yet passed on."""

    turns: Float  # (LANES, 2, _ROOM + 1)
    forces: Float  # (LANES, n_kept, _ROOM)
    chambers: Float  # one step without chambers
    gaps: Float  # of the films, and force of asperities; one step without films


@subroutine
def march_lanes(
    kind: Any,
    p: Any,
    s: Any,
    m: Any,
    a: Any,
    k: Any,
    columns: Any,
    at: Any,
    left: Any,
    past: Any,
) -> None:
    """March all lanes until a run ends or fails, or a lane's buffer is full.

    Compiled as a whole: passing these tables from Python costs as much as a hundred steps.
    """
    while True:
        n = STRETCH
        for lane in range(LANES):
            if k.code[lane] == 0:
                n = min(n, left[lane], _ROOM - at[lane])
        if n == 0:
            return
        for lane in range(LANES):
            k.done[lane] = n if k.code[lane] == 0 else 0
        march(kind, n, p, s, m, a, k)
        _take(k, columns, at, past, kind)
        failed = False
        for lane in range(LANES):
            at[lane] += k.done[lane]
            left[lane] -= k.done[lane]
            failed = failed or (k.done[lane] > 0 and k.code[lane] != 0)
        if failed:
            return


@subroutine
def _take(k: Any, columns: Any, at: Any, past: Any, kind: Any) -> None:
    """Append every lane's last steps to its buffer; a column's block fits the innermost cache."""
    left, n = k.left[0], 0
    for lane in range(LANES):
        n = max(n, k.done[lane])
    for j in range(columns.size):
        _lay_out(left.forces, columns[j], n, at, 0, past.forces, j)
    for c in range(2):
        _lay_out(left.turns, c, n, at, 1, past.turns, c)
    if kind.chambers:
        for c in range(len(GATHERED)):
            _lay_out(left.chambers, c, n, at, 1, past.chambers, c)
    if kind.oil != DRY:
        for c in range(2):
            _lay_out(left.gaps, c, n, at, 1, past.gaps, c)


@kernel
def _lay_out(steps: Any, column: int, n: int, at: Any, begin: int, rows: Any, row: int) -> None:
    """Write a column of n steps into a row of every lane.

    Four lanes at once: data read together for one serve its neighbours. A lane with fewer
    steps, because it failed or is empty, gets excess values that are never read.
    """
    for lane in range(0, LANES, 4):
        a, b = np.uint64(at[lane] + begin), np.uint64(at[lane + 1] + begin)  # not negative
        c, d = np.uint64(at[lane + 2] + begin), np.uint64(at[lane + 3] + begin)
        for i in range(np.uint64(n)):
            rows[lane, row, a + i] = steps[column, i, lane]
            rows[lane + 1, row, b + i] = steps[column, i, lane + 1]
            rows[lane + 2, row, c + i] = steps[column, i, lane + 2]
            rows[lane + 3, row, d + i] = steps[column, i, lane + 3]


def _maps_of(jobs: Sequence[LaneJob]) -> tuple[dict[bytes, int], Float]:
    """Maps of all films, each once, concatenated; and the offset of each table's maps."""
    offsets: dict[bytes, int] = {}
    found, size = [], 0
    for job in jobs:
        key = job.tables.maps.tobytes()
        if key not in offsets:
            offsets[key] = size
            found.append(job.tables.maps)
            size += job.tables.maps.size
    return offsets, np.concatenate(found)


def _numbers(record: Any, names: Sequence[str]) -> list[float]:
    return [float(record[name]) for name in names]
