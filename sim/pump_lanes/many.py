"""Recordings of many pumps: in parallel lanes where possible, the others one by one.

A recording has the same bytes either way; only the time differs.
"""

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple, cast

from ..output.recording import Recording
from ..pump.gathering import GATHERED_TRUTH, Gathering
from ..pump.recording import recording_of, refused_run, simulate_pump
from ..pump.run_plan import LimitError, RunPlan, planned
from ..pump.scene_run import needs_integration
from ..pump_setup.films import start_films
from ..pump_setup.tables import tables_and_start
from ..pump_setup.yielding import yielding_of
from ..scene.pump import PumpScene
from ..scene.scene import Scene, SceneError
from .lanes import LaneJob, LaneKind, lane_columns, lane_kind, run_lanes

_FEWEST = 5
"""Fewest records for which lanes are used; below, one after the other is as fast."""


class _Job(NamedTuple):
    number: int
    seed: int
    plan: RunPlan


class _Known(NamedTuple):
    """Truth requested for a recording."""

    whole: bool
    gathered: bool  # that of GATHERED_TRUTH


def simulate_pumps(
    jobs: Sequence[tuple[Scene, int]], truth: Collection[str] = ()
) -> Iterator[tuple[int, Recording | SceneError]]:
    """Simulate recordings of pumps.

    Parameters
    ----------
    jobs : sequence of (Scene, int)
        Scene and seed of each.
    truth : collection of str
        Names of the requested truth. What is not in :data:`GATHERED_TRUTH` needs a record to run
        alone.

    Yields
    ------
    number : int
        Number of the job; every job is returned once, in any order.
    recording : Recording or SceneError
        As from :func:`.recording.simulate_pump` with `raise_on_failure` false; or why a scene is
        refused.
    """
    kinds: dict[LaneKind, list[_Job]] = {}
    available = not set(truth) - set(GATHERED_TRUTH)
    known = _Known(whole=not available, gathered=available and bool(truth))
    for number, (scene, seed) in enumerate(jobs):
        pump = cast(PumpScene, scene)
        try:
            kind = _kind_of(pump) if available else None
            plan = planned(pump) if kind else None
        except LimitError as error:
            yield number, refused_run(pump, error)
            continue
        except SceneError as error:
            yield number, error
            continue
        if kind is None or plan is None:
            yield number, _alone(pump, seed, known)
            continue
        kinds.setdefault(kind, []).append(_Job(number, seed, plan))
    for kind, group in _pooled(kinds):
        yield from _together(group, kind, known)


def pumps_alike(scene: Scene) -> tuple[bool, int, LaneKind] | None:
    """Properties that records best run together share; None for a scene that runs alone.

    What costs most when mixed comes first: records with and without chambers never share lanes, and
    a lane that ends early, because its record has fewer steps per sample, stays empty.
    """
    pump = cast(PumpScene, scene)
    kind = _kind_of(pump)
    try:
        return None if kind is None else (kind.chambers, planned(pump).factor, kind)
    except SceneError:  # reported when it is simulated
        return None


def _kind_of(scene: Scene) -> LaneKind | None:
    pump = cast(PumpScene, scene)
    return lane_kind(pump) if pump.running and needs_integration(pump) else None


def _pooled(kinds: dict[LaneKind, list[_Job]]) -> list[tuple[LaneKind, list[_Job]]]:
    """Groups of one kind; those that would leave lanes empty are merged into one."""
    large = [(kind, group) for kind, group in kinds.items() if len(group) >= kind.records]
    small: dict[tuple[bool, int, int], list[tuple[LaneKind, list[_Job]]]] = {}
    for kind, group in kinds.items():
        if len(group) < kind.records:
            small.setdefault((kind.chambers, kind.throws, kind.oil), []).append((kind, group))
    for (chambered, throws, oil), pool in small.items():
        kind = LaneKind(
            wrist=any(kind.wrist for kind, _ in pool),
            guide=any(kind.guide for kind, _ in pool),
            chambers=chambered,
            throws=throws,
            oil=oil,
            yields=any(kind.yields for kind, _ in pool),
        )
        large.append((kind, [job for _, group in pool for job in group]))
    return large


def _alone(scene: PumpScene, seed: int, known: _Known) -> Recording | SceneError:
    try:
        return simulate_pump(scene, seed, known.whole, False, gathered_truth=known.gathered)
    except SceneError as error:
        return error


def _together(
    group: list[_Job], kind: LaneKind, known: _Known
) -> Iterator[tuple[int, Recording | SceneError]]:
    if len(group) * kind.throws < _FEWEST:
        for job in group:
            yield job.number, _alone(job.plan.scene, job.seed, known)
        return
    columns, begun = lane_columns(kind), {}

    def gathering(n: int) -> Gathering:
        begun[n] = Gathering(group[n].plan, group[n].seed, columns, truth=known.gathered)
        return begun[n]

    for n, run in run_lanes([lane_job(job.plan) for job in group], kind, gathering):
        yield group[n].number, recording_of(begun.pop(n), run)


def lane_job(plan: RunPlan) -> LaneJob:
    """Lane job of a planned recording whose :func:`.lanes.lane_kind` is not None."""
    tables, start = tables_and_start(plan.scene, plan.step, plan.first_angle)
    films = start_films(tables, start.bodies, plan.first_angle, start.journal)
    return LaneJob(
        tables=tables,
        start=start,
        step=plan.step,
        n_steps=plan.n_steps,
        films=films,
        casing=yielding_of(plan.scene, plan.step),
    )
