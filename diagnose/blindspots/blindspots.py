"""What a wear model takes for granted: the same machines again, with one thing shifted a row.

Every machine is drawn from the model's recipe, under a seed that no data set has by custom, and
judged as a user's recording would be: its conditions and its nameplate are known, where the model
asks for them.
"""

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ... import __version__
from ...datasets.recipe.load import load_recipe
from ...datasets.recipe.recipe import Recipe, condition_of
from ...datasets.recipe.records import Sample, sample_records
from ...datasets.recipe.text import recipe_names
from ...sim.machine.simulate import simulate_many
from ...sim.output.recording import DataError, Recording
from ...sim.scene.scene import Scene, SceneError, channels_of
from ..feature_rows.model_card import ModelCard
from ..machines.registry import presentation_of
from ..nameplate.cautions import recording_context
from ..nameplate.nameplate import Nameplate
from ..pages.kept import Kept
from ..wear_model.verdict import Estimate
from .rows import SceneRow, scene_rows
from .scores import ShiftRow, ShiftVerdict, answer_of, row_of
from .signals import SignalRow, signal_rows

OWN_SEEDS = 2**62
"""Added to the seed: data sets are made with small ones, so that no machine was trained on."""

BASELINE = "as trained"

Progress = Callable[[int, int], None]


class Model(Protocol):
    """What is asked of a model."""

    @property
    def card(self) -> ModelCard:
        """What it was trained on."""

    @property
    def noted(self) -> tuple[str, ...]:
        """Conditions that it takes as inputs."""

    def estimate(
        self,
        recording: Recording,
        baseline: None = None,
        conditions: Mapping[str, Any] | None = None,
        told: tuple[str, ...] = (),
    ) -> Estimate:
        """What it says of a recording."""


@dataclass(frozen=True, kw_only=True)
class BlindSpots:
    """What came out.

    Attributes
    ----------
    recipe : str
        Name.
    baseline : Row
        As trained.
    rows : tuple of ShiftRow
        Those done, in the order in which they were made.
    left : tuple of str
        Keys of those that time did not suffice for.
    """

    recipe: str
    baseline: ShiftRow
    rows: tuple[ShiftRow, ...]
    left: tuple[str, ...]


def recipe_of(model: Model, name: str | None = None) -> Recipe:
    """Recipe that a model's machines are drawn from, checked against its inputs.

    Parameters
    ----------
    model : Model
    name : str, optional
        Built-in recipe or file; by default the one that the model's card names.

    Returns
    -------
    Recipe

    Raises
    ------
    DataError
        The model names no recipe that is built in, is referenced or reads several tests, or the
        recipe makes other recordings than it reads.
    """
    card = model.card
    faults = []
    if card.mode != "cold":
        faults.append("mode = 'referenced' must be 'cold'; train one without --baseline")
    if card.views:
        faults.append(f"views = {', '.join(card.views)} must be none; train one without --join")
    known = card.trained_on.recipe
    if name is None and known not in recipe_names():
        what = f"recipe = '{known}' is not built in" if known else "it was trained on no recipe"
        faults.append(f"{what}; name its file: --recipe RECIPE.toml")
    if faults:
        raise DataError("\n".join(f"the model: {fault}" for fault in faults))
    recipe = load_recipe(name or known)
    if recipe.scene.fidelity == "auto":  # a choice of rungs is no part of the question
        recipe = load_recipe(name or known, {"fidelity": "given"})
    _refuse_other_inputs(recipe, card)
    return recipe


def _refuse_other_inputs(recipe: Recipe, card: ModelCard) -> None:
    made = {
        "severity": (card.severity, card.severity in recipe.severity_columns),
        "sample_rate": (
            card.sample_rate_hz,
            recipe.scene.sample_rate == card.sample_rate_hz,
        ),
        "channels": (
            ", ".join(channel.name for channel in card.channels),
            [(c.name, c.unit) for c in channels_of(recipe.scene)]
            == [(c.name, c.unit) for c in card.channels],
        ),
    }
    faults = [
        f"{recipe.name}: its records have another {what} than the model reads, {wanted}; name the "
        f"recipe that it was trained on: --recipe"
        for what, (wanted, fits) in made.items()
        if not fits
    ]
    if faults:
        raise DataError("\n".join(faults))


@dataclass(frozen=True, kw_only=True)
class _Machines:
    """The few machines of every row, and their recordings as trained."""

    recipe: Recipe
    model: Model
    samples: Sequence[Sample]
    seed: int

    @cached_property
    def column(self) -> str:
        return self.model.card.severity

    @cached_property
    def recordings(self) -> dict[int, Recording]:
        """As trained, by machine; those whose simulation fails are missing."""
        found = self.recorded([(s.scene, s.seed) for s in self.samples])
        return {
            sample.group: each
            for sample, each in zip(self.samples, found, strict=True)
            if isinstance(each, Recording)
        }

    def recorded(self, jobs: Sequence[tuple[Scene, int]]) -> list[Recording | str]:
        """Recordings of scenes with their seeds, or why there is none."""
        found = dict(simulate_many(jobs))
        return [self._told(jobs[n][0], found[n]) for n in range(len(jobs))]

    def _told(self, scene: Scene, solution: Recording | SceneError) -> Recording | str:
        if isinstance(solution, SceneError):
            return "; ".join(solution.faults)
        if not solution.status.ok:
            return solution.status.text
        noted = {name: condition_of(scene, name) for name in self.model.noted}
        if solution.tacho is None:
            noted["speed_hz"] = condition_of(scene, "speed_hz")
        return replace(solution, row=noted, numerics={})  # a model is told what was noted alone

    def judged(self, recording: Recording, scene: Scene, sample: Sample) -> ShiftVerdict:
        """What the model says of a recording of a machine whose nameplate is known."""
        sizes = frozenset(presentation_of(scene).sizes)
        plate = Nameplate(scene=scene, set_paths=sizes, assumed=True)
        context = recording_context(plate, recording, self.model.card)
        estimate = self.model.estimate(recording, **context)
        return answer_of(estimate, sample.group, float(sample.row[self.column]))


def _samples(recipe: Recipe, machines: int, seed: int) -> list[Sample]:
    """One record of each machine, of one early and the next late in its life where it has one."""
    per = recipe.table.records_per_group
    skip = np.ones(machines * per, dtype=bool)
    skip[[group * per + group % per for group in range(machines)]] = False
    drawn = sample_records(recipe, machines * per, seed=(seed + OWN_SEEDS) % 2**63, skip=skip)
    return list(drawn)


_Outcome = tuple[Sample, Scene, Recording | str]
"""A machine, its scene with the shift, and its recording or why there is none."""


def _baseline(machines: _Machines) -> Iterator[_Outcome]:
    for sample in machines.samples:
        known = machines.recordings.get(sample.group)
        outcome = known if known is not None else "its simulation fails as trained"
        yield sample, sample.scene, outcome


def _of_scene(machines: _Machines, row: SceneRow) -> Iterator[_Outcome]:
    taken: list[tuple[Sample, Scene]] = []
    for sample in machines.samples:
        try:
            taken.append((sample, row.applied(machines.recipe, sample)))
        except SceneError as error:
            yield sample, sample.scene, "; ".join(error.faults)
    found = machines.recorded([(scene, sample.seed) for sample, scene in taken])
    for (sample, scene), outcome in zip(taken, found, strict=True):
        yield sample, scene, outcome


def _of_signal(machines: _Machines, row: SignalRow) -> Iterator[_Outcome]:
    for sample in machines.samples:
        recording = machines.recordings.get(sample.group)
        if recording is None:
            continue
        word = hashlib.sha256(f"{row.name} {row.shift}".encode()).digest()
        key = [machines.seed, sample.group, int.from_bytes(word[:4])]
        try:
            speed = condition_of(sample.scene, "speed_hz")
            yield sample, sample.scene, row.apply(recording, speed, np.random.default_rng(key))
        except DataError as error:
            yield sample, sample.scene, str(error)


@dataclass(frozen=True)
class _Task:
    """A row to be made."""

    row: ShiftRow
    outcomes: Callable[[_Machines], Iterator[_Outcome]]


def _tasks(scenes: Sequence[SceneRow], signals: Sequence[SignalRow]) -> list[_Task]:
    """The baseline first, then the cheap rows of the signal, then those of the scene."""

    def empty(name: str, shift: str, kind: str, why: str) -> ShiftRow:
        return ShiftRow(name=name, shift=shift, kind=kind, why=why, said=())

    tasks = [_Task(empty(BASELINE, "", BASELINE, ""), _baseline)]
    for signal in signals:
        row = empty(signal.name, signal.shift, "sensor", signal.why)
        tasks.append(_Task(row, partial(_of_signal, row=signal)))
    for scene in scenes:
        row = empty(scene.name, scene.shift, scene.kind, scene.why)
        tasks.append(_Task(row, partial(_of_scene, row=scene)))
    return tasks


def _chosen(tasks: Sequence[_Task], only: Sequence[str]) -> list[_Task]:
    """The baseline, and the rows of which one of the texts is a part; all without a text."""
    baseline, *others = tasks
    wanted = [text for text in only if not any(text in task.row.key for task in others)]
    if wanted:
        names = ", ".join(dict.fromkeys(task.row.name for task in others))
        raise DataError(f"only = {', '.join(wanted)}: no row is called so; there are {names}")
    return [baseline, *(t for t in others if not only or any(text in t.row.key for text in only))]


def kept_rows(path: Path | None, key: str) -> Kept[ShiftRow]:
    """Finished rows in a file beside the output.

    Parameters
    ----------
    path : Path or None
        None keeps nothing.
    key : str
        Of :func:`run_key`.

    Raises
    ------
    DataError
        The file is damaged, or of another run.
    """
    return Kept(
        path,
        key,
        table_of=ShiftRow.as_dict,
        piece_of=row_of,
        depends="another model, recipe, number of machines, seed or version",
    )


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def run_key(model_hash: str, recipe: Recipe, machines: int, seed: int, background: str) -> str:
    """Hash of all that the rows depend on."""
    parts = [__version__, model_hash, recipe.text, recipe.scene_text, background]
    overrides = dict(recipe.overrides)
    text = json.dumps([*parts, overrides, machines, seed], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def find_blind_spots(
    model: Model,
    recipe: Recipe,
    *,
    machines: int = 12,
    seed: int = 0,
    budget: float | None = None,
    scenes: Sequence[SceneRow] | None = None,
    signals: Sequence[SignalRow] | None = None,
    only: Sequence[str] = (),
    kept: Kept[ShiftRow] | None = None,
    progress: Progress | None = None,
) -> BlindSpots:
    """Judge a model on the same machines, with one thing shifted at a time.

    Parameters
    ----------
    model : Model
    recipe : Recipe
        As of :func:`recipe_of`.
    machines : int
        Drawn; one record of each, >= 1.
    seed : int
        Of the draws and of noise, >= 0.
    budget : float, optional
        Seconds after which no further row is begun; the baseline always is.
    scenes, signals : sequences of rows, optional
        Of the scene and of the signal; all by default.
    only : sequence of str, optional
        Parts of the rows' keys, "kind: name shift"; without it all rows are made.
    kept : Kept, optional
        Rows of an earlier run; finished ones are added.
    progress : callable, optional
        Called with (rows done, rows in all) after each.

    Returns
    -------
    BlindSpots

    Raises
    ------
    DataError
        No machine could be simulated as trained, or no row is called so.
    """
    end = None if budget is None else time.monotonic() + budget
    store = kept_rows(None, "") if kept is None else kept
    samples = _samples(recipe, machines, seed)
    fleet = _Machines(recipe=recipe, model=model, samples=samples, seed=seed)
    every = _tasks(
        scene_rows(recipe) if scenes is None else scenes,
        signal_rows() if signals is None else signals,
    )
    tasks = _chosen(every, only)
    for done, task in enumerate(tasks, start=1):
        late = end is not None and time.monotonic() >= end and task is not tasks[0]
        if task.row.key not in store and not late:
            store[task.row.key] = _made(task, fleet)
        if progress is not None:
            progress(done, len(tasks))
    baseline, *others = tasks
    if not store[baseline.row.key].said:
        fault = next(iter(store[baseline.row.key].faults), "")
        raise DataError(f"{recipe.name}: 0 of {machines} machines can be simulated ({fault})")
    keys = [task.row.key for task in others]
    return BlindSpots(
        recipe=recipe.name,
        baseline=store[baseline.row.key],
        rows=tuple(store[key] for key in keys if key in store),
        left=tuple(key for key in keys if key not in store),
    )


def _made(task: _Task, fleet: _Machines) -> ShiftRow:
    said, faults = [], []
    for sample, scene, outcome in task.outcomes(fleet):
        if isinstance(outcome, str):
            faults.append(outcome)
        else:
            said.append(fleet.judged(outcome, scene, sample))
    empty = task.row
    return ShiftRow(
        name=empty.name,
        shift=empty.shift,
        kind=empty.kind,
        why=empty.why,
        said=tuple(said),
        faults=tuple(dict.fromkeys(faults)),
    )
