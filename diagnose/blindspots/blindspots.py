"""Sensitivity of a wear model to its assumptions: the same machines with one property changed.

Every machine is drawn from the model's recipe, with a seed that data sets do not use, and judged
like a user's recording: conditions and nameplate are known if the model needs them.
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
"""Added to the seed: data sets use small seeds, so that no machine was in the training."""

BASELINE = "as trained"

Progress = Callable[[int, int], None]


class Model(Protocol):
    """Required interface of a model."""

    @property
    def card(self) -> ModelCard:
        """Card with its training data."""

    @property
    def noted(self) -> tuple[str, ...]:
        """Conditions that are inputs of the model."""

    def estimate(
        self,
        recording: Recording,
        baseline: None = None,
        conditions: Mapping[str, Any] | None = None,
        told: tuple[str, ...] = (),
    ) -> Estimate:
        """Estimate for a recording."""


@dataclass(frozen=True, kw_only=True)
class BlindSpots:
    """Result of the sensitivity study.

    Attributes
    ----------
    recipe : str
        Name of the recipe.
    baseline : ShiftRow
        Row without a change.
    rows : tuple of ShiftRow
        Finished rows, in the order in which they were run.
    left : tuple of str
        Keys of rows for which time did not suffice.
    """

    recipe: str
    baseline: ShiftRow
    rows: tuple[ShiftRow, ...]
    left: tuple[str, ...]


def recipe_of(model: Model, name: str | None = None) -> Recipe:
    """Recipe from which a model's machines are drawn, checked against its inputs.

    Parameters
    ----------
    model : Model
    name : str, optional
        Built-in recipe or file; by default that of the model's card.

    Returns
    -------
    Recipe

    Raises
    ------
    DataError
        The model names no built-in recipe, is referenced or needs several tests, or the recordings
        of the recipe do not fit its inputs.
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
    if recipe.scene.fidelity == "auto":  # keep the rungs fixed
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
        f"{recipe.name}: its records have another {what} than the model needs, {wanted}; name the "
        f"recipe of its training: --recipe"
        for what, (wanted, fits) in made.items()
        if not fits
    ]
    if faults:
        raise DataError("\n".join(faults))


@dataclass(frozen=True, kw_only=True)
class _Machines:
    """The machines of every row, and their recordings without a change."""

    recipe: Recipe
    model: Model
    samples: Sequence[Sample]
    seed: int

    @cached_property
    def column(self) -> str:
        return self.model.card.severity

    @cached_property
    def recordings(self) -> dict[int, Recording]:
        """Recordings without a change, by machine; without failed simulations."""
        found = self.recorded([(s.scene, s.seed) for s in self.samples])
        return {
            sample.group: each
            for sample, each in zip(self.samples, found, strict=True)
            if isinstance(each, Recording)
        }

    def recorded(self, jobs: Sequence[tuple[Scene, int]]) -> list[Recording | str]:
        """Recordings of scenes with their seeds, or the reason for a failure."""
        found = dict(simulate_many(jobs))
        return [self._checked(jobs[n][0], found[n]) for n in range(len(jobs))]

    def _checked(self, scene: Scene, solution: Recording | SceneError) -> Recording | str:
        if isinstance(solution, SceneError):
            return "; ".join(solution.faults)
        if not solution.status.ok:
            return solution.status.text
        noted = {name: condition_of(scene, name) for name in self.model.noted}
        if solution.tacho is None:
            noted["speed_hz"] = condition_of(scene, "speed_hz")
        return replace(solution, row=noted, numerics={})  # the model sees only noted conditions

    def judged(self, recording: Recording, scene: Scene, sample: Sample) -> ShiftVerdict:
        """Verdict of the model on a recording of a machine with known nameplate."""
        sizes = frozenset(presentation_of(scene).sizes)
        plate = Nameplate(scene=scene, set_paths=sizes, assumed=True)
        context = recording_context(plate, recording, self.model.card)
        estimate = self.model.estimate(recording, **context)
        return answer_of(estimate, sample.group, float(sample.row[self.column]))


def _samples(recipe: Recipe, machines: int, seed: int) -> list[Sample]:
    """One record of each machine, at alternating stages of life if there are several."""
    per = recipe.table.records_per_group
    skip = np.ones(machines * per, dtype=bool)
    skip[[group * per + group % per for group in range(machines)]] = False
    drawn = sample_records(recipe, machines * per, seed=(seed + OWN_SEEDS) % 2**63, skip=skip)
    return list(drawn)


_Outcome = tuple[Sample, Scene, Recording | str]
"""A machine, its changed scene, and its recording or the reason for a failure."""


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
    """A row to be run."""

    row: ShiftRow
    outcomes: Callable[[_Machines], Iterator[_Outcome]]


def _tasks(scenes: Sequence[SceneRow], signals: Sequence[SignalRow]) -> list[_Task]:
    """Tasks: the baseline, then the cheap rows of the signal, then those of the scene."""

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
    """The baseline, and the rows whose key contains one of the texts; all rows without texts."""
    baseline, *others = tasks
    wanted = [text for text in only if not any(text in task.row.key for task in others)]
    if wanted:
        names = ", ".join(dict.fromkeys(task.row.name for task in others))
        raise DataError(f"only = {', '.join(wanted)}: no row has this name; there are {names}")
    return [baseline, *(t for t in others if not only or any(text in t.row.key for text in only))]


def kept_rows(path: Path | None, key: str) -> Kept[ShiftRow]:
    """Finished rows, kept in a file next to the output.

    Parameters
    ----------
    path : Path or None
        None: nothing is kept.
    key : str
        From :func:`run_key`.

    Raises
    ------
    DataError
        The file is damaged, or belongs to another run.
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
    """Judge a model on the same machines, with one property changed at a time.

    Parameters
    ----------
    model : Model
    recipe : Recipe
        From :func:`recipe_of`.
    machines : int
        Number of drawn machines, >= 1; one record of each.
    seed : int
        Seed of the draws and of noise, >= 0.
    budget : float, optional
        Time after which no further row is started [s]; the baseline is always run.
    scenes, signals : sequences of rows, optional
        Rows of the scene and of the signal; by default all.
    only : sequence of str, optional
        Parts of the rows' keys, "kind: name shift"; by default all rows are run.
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
        No machine could be simulated without a change, or no row has the name.
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
