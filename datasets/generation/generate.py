"""From a recipe to a labelled data set file.

Workers simulate, only this process writes. A killed run is resumed by the same call.
"""

import math
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...sim.machine.simulate import alike, simulates_together
from ...sim.output.recording import DataError, Recording
from ...sim.scene.scene import Scene, channels_of
from ...sim.wear.archard import grade
from ..file.attributes import Attributes
from ..file.lock import holding
from ..file.record import unfinished_attributes
from ..file.writer import DataSetWriter, LostError, WriteError, refuse_output
from ..recipe.load import load_recipe
from ..recipe.recipe import Recipe, condition_of, conditions_of
from ..recipe.records import LARGEST_SEED, Sample, overrides_text, sample_records
from ..recipe.severities import clearances, wear_limits
from ..recipe.table import MOST_RECORDS
from ..recipe.text import RecipeError
from ..split.stored import Drawn, default_splits, split_names
from ..workers.local import in_order
from ..workers.pool import WorkersError
from .fidelity_choice import FidelityChoice, choose, with_choice
from .work import NUMERICS, RecordJob, RecordOutcome, each_alone, numerics_of, simulated, together

_TOGETHER = 32
"""Largest batch of records: two per lane, all with the same number of steps; few enough for
memory."""

_REMAINDER = 16
"""Largest batch of the records that do not fill a batch of their kind: one per lane."""

_FEWEST = 5
"""Smallest batch that is worthwhile."""


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Result of a run of `generate`.

    Attributes
    ----------
    path : Path
        The file.
    n_records, n_groups : int
        Records and machines in it.
    n_resumed : int
        Records that an earlier, interrupted run had written.
    grades : dict of int to int
        Records of each grade; -1 unknown.
    failures : dict of str to int
        Records of each status other than ``ok``; their signal is zero.
    first_failures : tuple of str
        Error text of the first few failures of this run.
    n_clipped : int
        Records with saturated samples.
    fidelity : Choice or None
        Rungs chosen for the whole set, with the savings; None if they are as written.
    """

    path: Path
    n_records: int
    n_groups: int
    n_resumed: int
    grades: dict[int, int]
    failures: dict[str, int]
    first_failures: tuple[str, ...]
    n_clipped: int
    fidelity: FidelityChoice | None = None


class Stopped(KeyboardInterrupt):
    """A run was stopped by hand; the text says what is kept and how to resume."""


def generate(
    recipe: str | Path | Recipe,
    n: int | None,
    path: str | Path,
    *,
    view: str = "",
    seed: int = 0,
    jobs: int = 1,
    scheduler: str | None = None,
    force: bool = False,
    truth: bool = False,
    fidelity: Literal["given", "auto"] | None = None,
    progress: Callable[[int, int], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> Summary:
    """Simulate a labelled data set into a file.

    Parameters
    ----------
    recipe : str, Path or Recipe
        Built-in name, file, or a loaded recipe.
    n : int or None
        Records; None for the recipe's own number.
    path : str or Path
        File to write; ``<path>.part`` until finished. An unfinished file of the same call is
        resumed.
    view : str
        As for :func:`~.recipe.load.load_recipe`: record `i` of every view is of the same machine
        state.
    seed : int
        Seed of the data set, >= 0. Record `i` depends on recipe, seed and `i` alone.
    jobs : int
        Number of simulating processes, >= 1; at most one per record is started. Signal and manifest
        are the same for any number.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``, whose workers simulate instead of `jobs`
        local processes; the bytes are the same on processors of one kind.
    force : bool
        Replace an existing file and restart an unfinished one.
    truth : bool
        Store the hidden quantities of each record.
    fidelity : {"auto", "given"}, optional
        Cheapest rungs that meet the scene's accuracy, or rungs as written; by default as in the
        recipe, or else in its scene. Chosen once, and stored before the first record.
    progress : callable, optional
        Called with (records done, records in total) after each.
    say : callable, optional
        Called with a line about each pilot of the choice, and about workers.

    Returns
    -------
    Summary
        Counts of records, grades and failures.

    Raises
    ------
    RecipeError
        If the recipe has faults; nothing is written.
    DataError
        If the file exists, another run is writing it, an unfinished one belongs to another run,
        `jobs` is below one, there is no room, `scheduler` cannot be used, or every record failed
        (the file is kept for inspection).
    WorkersError, WriteError
        If workers or scheduler were lost, or the disk is full or failing. The records written stay
        in the unfinished file, and the same call resumes it.
    LostError
        If the unfinished file was deleted, moved or replaced; nothing is kept.
    OutputError
        If a file of that name has appeared meanwhile; the finished file keeps the name of the
        unfinished one.
    Stopped
        On a KeyboardInterrupt; records are kept as above.

    Notes
    -----
    A record whose simulation fails keeps its row, with its status and a signal of zeros.

    Examples
    --------
    >>> import tempfile
    >>> recipe = load_recipe("bilge-pump-small", {"duration": "0.25 s"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     generate(recipe, 2, Path(folder) / "data.h5").n_groups
    1
    """
    plan = recipe if isinstance(recipe, Recipe) else load_recipe(recipe, view=view)
    count = plan.table.records if n is None else n
    if jobs < 1:
        raise DataError(f"jobs = {jobs} must be >= 1; give the number of cores")
    _refuse_bounds(plan, count, seed)
    if scheduler is not None:
        from ..workers.cluster import refuse_scheduler

        refuse_scheduler(scheduler)
    output = Path(path).absolute()
    refuse_output(output, force)
    with holding(output, say):
        choice = _chosen(plan, path, fidelity=fidelity, seed=seed, force=force, say=say)
        plan = with_choice(plan, choice)
        tally = _Tally(count, choice)
        error = None if choice is None else choice.estimated_error
        work = partial(simulated, truth=truth, error=error)
        with (
            _writer(
                plan, count, path, seed=seed, force=force, truth=truth, choice=choice
            ) as writer,
            _with_resume_hint(writer),
        ):
            tally.n_resumed = int(np.count_nonzero(writer.done))
            samples = sample_records(plan, count, seed=seed, skip=writer.done.copy())
            jobs = min(jobs, max(1, count - tally.n_resumed))
            size = 1 if truth else _batch_size(plan.scene, count - tally.n_resumed, jobs)
            found = in_order(
                partial(each_alone, work) if size == 1 else partial(together, error=error),
                _batches(samples, size),
                jobs=jobs,
                scheduler=scheduler,
                say=say,
                watch=writer.refuse_lost,
            )
            with closing(found) as batches, _remembered_interrupt() as interrupted:
                for outcome in chain.from_iterable(batches):
                    if scheduler is not None and outcome.refused is not None:
                        _repeat_here(outcome, work)
                    writer.write(outcome.index, outcome.signal, outcome.row, outcome.truth)
                    tally.note(outcome)
                    if progress is not None:
                        progress(int(np.count_nonzero(writer.done)), count)
                    if interrupted.is_set():
                        raise KeyboardInterrupt
            rows = writer.manifest()
            _write_splits(writer, rows, plan, seed)
            writer.finish()
        return tally.summary(writer.path, rows)


@contextmanager
def _remembered_interrupt() -> Iterator[threading.Event]:
    """Remember a Ctrl-C: one that arrives in a callback of HDF5 or a finaliser would be lost.

    It is not reported as lost either: the run stops at the next record.
    """
    interrupted = threading.Event()

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        interrupted.set()
        signal.default_int_handler(number, frame)

    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield interrupted
        return
    usual = sys.unraisablehook

    def report(lost: "sys.UnraisableHookArgs") -> None:
        if not (interrupted.is_set() and lost.exc_type is KeyboardInterrupt):
            usual(lost)

    signal.signal(signal.SIGINT, on_interrupt)
    sys.unraisablehook = report
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.unraisablehook = usual


@contextmanager
def _with_resume_hint(writer: DataSetWriter) -> Iterator[None]:
    """Add to any error that stops a run what is kept, and how to resume."""
    try:
        yield
    except KeyboardInterrupt:
        raise Stopped(f"stopped; {_kept(writer)}") from None
    except LostError:  # says itself that nothing is kept
        raise
    except (WorkersError, WriteError) as error:
        raise type(error)(f"{error}; {_kept(writer)}") from error
    except DataError:
        writer.close()
        if not writer.done.any():  # workers that cannot be used: nothing has been written
            writer.part.unlink(missing_ok=True)
        raise


def _kept(writer: DataSetWriter) -> str:
    try:
        writer.refuse_lost()
    except LostError as error:
        return str(error)
    kept = np.count_nonzero(writer.done)
    return (
        f"{kept} of {len(writer.done)} records are kept in {writer.part.name}: repeat the command "
        "to go on"
    )


def _repeat_here(outcome: RecordOutcome, work: Callable[[RecordJob], RecordOutcome]) -> None:
    """Repeat a refused record here: a remote worker may only lack a file that the scene names."""
    if outcome.refused is not None and work(outcome.refused).refused is None:
        raise WorkersError(
            f"record {outcome.index} is refused by a worker ({outcome.fault}) and simulated here; "
            "give the workers the files that the scene names, under the same path"
        )


def _chosen(
    plan: Recipe,
    path: str | Path,
    *,
    fidelity: str | None,
    seed: int,
    force: bool,
    say: Callable[[str], None] | None,
) -> FidelityChoice | None:
    """The choice stored in an unfinished file, or a new one; None for rungs as written."""
    refuse_output(Path(path).absolute(), force)
    wanted = fidelity or plan.table.fidelity or plan.scene.fidelity
    if wanted == "given":
        return None
    begun = None if force else unfinished_attributes(path)
    if begun is None:
        return choose(plan, seed=seed, say=say)
    if not begun.fidelity:
        raise DataError(
            f"{path}.part: fidelity = 'given', must be 'auto' to go on with it; repeat the command "
            "that began it, or use force to start again"
        )
    return FidelityChoice.load(begun.fidelity)


def _refuse_bounds(plan: Recipe, count: int, seed: int) -> None:
    faults = []
    if not 1 <= count <= MOST_RECORDS:
        faults.append(f"n = {count} must be >= 1 and <= {MOST_RECORDS}; choose a number between")
    if not 0 <= seed <= LARGEST_SEED:
        faults.append(f"seed = {seed} must be >= 0 and <= {LARGEST_SEED}; choose another")
    if faults:
        raise RecipeError(plan.name, faults)


def _writer(
    plan: Recipe,
    count: int,
    path: str | Path,
    *,
    seed: int,
    force: bool,
    truth: bool,
    choice: FidelityChoice | None,
) -> DataSetWriter:
    return DataSetWriter(
        path,
        _attributes(plan, seed, truth, choice),
        n_records=count,
        n_samples=round(plan.scene.duration * plan.scene.sample_rate),
        columns={**plan.columns, **NUMERICS},
        splits=split_names(plan),
        force=force,
    )


def _write_splits(writer: DataSetWriter, rows: NDArray[np.void], plan: Recipe, seed: int) -> None:
    severity = plan.severity_columns[0]
    drawn = Drawn(columns=rows, severity=severity, recipe=plan, seed=seed)
    if not drawn.usable.size:
        return
    for name, split in default_splits(drawn).items():
        writer.write_split(name, split.sides(len(rows)), split.attribute())


def _attributes(plan: Recipe, seed: int, truth: bool, choice: FidelityChoice | None) -> Attributes:
    scene = plan.scene
    return Attributes(
        sample_rate=scene.sample_rate,
        channels=channels_of(scene),
        origin="simulated",
        tacho=scene.tacho.name if scene.tacho else None,
        severities=plan.severity_columns,
        recipe=plan.text,
        scene=plan.scene_text,
        overrides=overrides_text(plan),
        fidelity="" if choice is None else choice.dump(),
        seed=seed,
        truth=truth,
        **_limits(scene, plan.severity_columns[0]),
    )


def _limits(scene: Scene, severity: str) -> dict[str, Any]:
    wear = wear_limits(scene, severity)
    if wear is None:
        return {}
    return {
        "grade_edges": wear.grade_edges,
        "condemning_limit": wear.condemning,
        "limit_source": wear.source,
    }


def _batch_size(scene: Scene, todo: int, jobs: int) -> int:
    """Number of records that a worker simulates in parallel; it affects only time and memory."""
    each = math.ceil(todo / jobs)
    return min(_TOGETHER, each) if simulates_together(scene) and each >= _FEWEST else 1


def _batches(samples: Iterable[Sample], size: int) -> Iterator[tuple[RecordJob, ...]]:
    """Batches of records of one kind, except for the remainders of all kinds at the end."""
    waiting: dict[Hashable, list[RecordJob]] = {}
    for each in samples:
        kind = alike(each.scene) if size > 1 else None
        same = waiting.setdefault(kind, [])
        same.append(RecordJob(each.index, each.seed, each.row, each.scene))
        if len(same) == size:
            yield tuple(waiting.pop(kind))
    yield from _remaining_batches(waiting, min(size, _REMAINDER))


def _remaining_batches(
    waiting: dict[Hashable, list[RecordJob]], size: int
) -> Iterator[tuple[RecordJob, ...]]:
    """Batches of one kind as far as they are full, then of neighbouring kinds.

    Their order is that of the keys, in which properties that cost most when mixed come first; the
    most expensive kinds are first, so that workers end at about the same time.
    """
    left: list[RecordJob] = []
    for _, same in sorted(waiting.items(), key=_name_of, reverse=True):
        whole = len(same) // size * size
        yield from _pieces(same[:whole], size)
        left += same[whole:]
    yield from _pieces(left, size)


def _pieces(jobs: list[RecordJob], size: int) -> Iterator[tuple[RecordJob, ...]]:
    return (tuple(jobs[first : first + size]) for first in range(0, len(jobs), size))


def _name_of(waiting: tuple[Hashable, list[RecordJob]]) -> str:
    return str(waiting[0])


class _Tally:
    """Counters of a run."""

    def __init__(self, count: int, choice: FidelityChoice | None) -> None:
        self.count, self.choice = count, choice
        self.n_resumed = 0
        self.faults: list[tuple[int, str]] = []  # of the first records that failed

    def note(self, outcome: RecordOutcome) -> None:
        if outcome.fault:
            self.faults = sorted([*self.faults, (outcome.index, outcome.fault)])[:3]

    def summary(self, path: Path, rows: NDArray[np.void]) -> Summary:
        status = Counter(name.decode() for name in rows["status"].tolist())
        faults = tuple(f"record {index}: {fault}" for index, fault in self.faults)
        del status["ok"]
        if status.total() == self.count:
            raise DataError(
                f"{path}: 0 of {self.count} records are simulated, must be >= 1; "
                f"{faults[0] if faults else 'see the status column'}"
            )
        return Summary(
            path=path,
            n_records=self.count,
            n_groups=len(np.unique(rows["group"])),
            n_resumed=self.n_resumed,
            grades=dict(sorted(Counter(rows["grade"].tolist()).items())),
            failures=dict(status),
            first_failures=faults,
            n_clipped=int(np.count_nonzero(rows["clipped_samples"] > 0)),
            fidelity=self.choice,
        )


def save_solution(
    scene: Scene,
    solution: Recording,
    path: str | Path,
    *,
    seed: int,
    force: bool = False,
    truth: bool = False,
) -> None:
    """Write one simulated recording as a data set of one record.

    Parameters
    ----------
    scene : Scene
        Scene that was simulated.
    solution : Recording
        Result of the simulation.
    path : str or Path
        File to write.
    seed : int
        Seed of the simulation, stored with the record.
    force : bool
        Replace an existing file.
    truth : bool
        Also store the hidden quantities contained in the solution.

    Raises
    ------
    DataError
        If the file exists, or cannot be written.
    """
    severity = clearances(scene)
    primary = next(iter(severity), "")
    limits = _limits(scene, primary)
    row = {
        "record_id": "0",
        "seed": seed,
        "status": solution.status.name.lower(),
        **(conditions := {name: condition_of(scene, name) for name in conditions_of(scene)}),
        **severity,
        **numerics_of(solution),
    }
    if limits:
        row["grade"] = grade(severity[primary], limits["grade_edges"])
    head = Attributes(
        sample_rate=solution.sample_rate,
        channels=solution.channels,
        origin="simulated",
        tacho=solution.tacho,
        severities=tuple(severity),
        scene=scene.model_dump_json(),
        seed=seed,
        truth=truth,
        **limits,
    )
    columns = {**dict.fromkeys((*severity, *conditions), "<f8"), **NUMERICS}
    n_samples = solution.signal.shape[1]
    writer = DataSetWriter(
        path,
        head,
        n_records=1,
        n_samples=n_samples,
        columns=columns,
        force=force,
        resumable=False,
    )
    with writer:
        writer.write(0, solution.signal, row, solution.truth if truth else None)
        writer.finish()
