"""The run of `chart` on a scene or a recipe: measure, continue, write."""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from ...datasets.recipe.text import recipe_names, toml_text
from ...sim.atomic import write_whole
from ...sim.fidelity.study import Search
from ...sim.scene.load import load_scene, numbered, scene_table, scene_text
from ...sim.scene.scene import Scene, SceneError
from ..charts.across import RungSets
from ..charts.chart import RECOMMENDED, Chart
from ..charts.decision import KEPT, RAISED
from ..charts.of_scene import (
    chart_of,
    kept_runs,
    measure,
    scene_search,
)
from ..charts.scene_edit import apply_changes
from ..charts.sentences import where_it_stands
from ..charts.verdict import verdict_chart
from ..options.outputs import CHART_SUFFIXES, SCENE_SUFFIXES, check_outputs
from ..options.progress import time_bar
from ..pages.kept import part_file

_QUESTIONS = {"kept": KEPT, "raised": RAISED}


def scene_chart_command(
    subject: str,
    given: Mapping[str, Any],
    *,
    accuracy: float | None,
    budget: float,
    output: Path | None,
    applied: Path | None,
    choice: str,
    jobs: int,
    force: bool,
    interactive: bool,
) -> tuple[Chart, bool]:
    """Measure a scene and write the requested files.

    Parameters
    ----------
    subject : str
        Built-in scene, or file.
    given : mapping of str to object
        Values that replace its own.
    accuracy : float or None
        Accuracy [-]; None for that of the scene.
    budget : float
        Time limit [s].
    output, applied : Path or None
        Chart; scene with the recommendation.
    choice : str
        ``kept`` or ``raised``: which recommendation is applied.
    jobs : int
    force : bool
        Replace existing files, and start from the beginning.
    interactive : bool
        For a page: points that can be tapped.

    Returns
    -------
    chart : Chart
    interrupted : bool
        Whether the user interrupted the run; the chart holds the measurements so far.
    """
    part = part_file(output)
    going_on = part is not None and part.exists() and not force
    outputs = [(output, CHART_SUFFIXES), (applied, SCENE_SUFFIXES)]
    check_outputs([subject], outputs, force or going_on)
    table = scene_table(scene_text(subject), subject)
    given = {numbered(table, path): value for path, value in given.items()}
    scene = load_scene(subject, given)
    if part is not None and force:
        part.unlink(missing_ok=True)
    kept = kept_runs(part, scene)
    search = scene_search(scene, accuracy=accuracy, jobs=jobs, kept=kept)
    interrupted = False
    try:
        with _watched(search, scene, jobs, budget):
            measure(search, budget=budget)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        kept.save()
    found = chart_of(scene, search.result())
    if output is not None:
        from ..charts.page import save_chart

        save_chart(found, output, force=force or going_on, interactive=interactive)
        if not found.unfinished:
            kept.drop()
    if applied is not None:
        _apply(subject, scene, given, found, choice, applied, force or going_on)
    return found, interrupted


def verdict_chart_command(
    subject: str,
    given: Mapping[str, Any],
    *,
    accuracy: float,
    records: int,
    effects: Sequence[str],
    folder: Path | None,
    output: Path | None,
    applied: Path | None,
    seed: int,
    jobs: int,
    force: bool,
    interactive: bool,
) -> Chart:
    """Measure the value of a recipe's rungs for the verdict and write the requested files.

    Parameters
    ----------
    subject : str
        Built-in recipe, or file.
    given : mapping of str to object
        Values of its scene.
    accuracy : float
        Rise of the error over the condemning limit.
    records : int
        Records for each choice of rungs.
    effects : sequence of str
        Effects to compare.
    folder : Path or None
        Folder that keeps the data sets; without it they are deleted.
    output, applied : Path or None
        Chart; recipe with the recommendation.
    seed, jobs : int
    force : bool
        Replace existing files.
    interactive : bool
        For a page: points that can be tapped.

    Returns
    -------
    Chart
    """
    check_outputs([subject], [(output, CHART_SUFFIXES), (applied, SCENE_SUFFIXES)], force)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as passing:
        sets = RungSets(
            subject,
            records,
            folder or Path(passing),
            effects=effects,
            overrides=given,
            seed=seed,
            jobs=jobs,
            say=lambda text: click.echo(text, err=True),
        )
        found = verdict_chart(sets, accuracy)
    if output is not None:
        from ..charts.page import save_chart

        save_chart(found, output, force=force, interactive=interactive)
    if applied is not None:
        [chosen] = found.choices
        table = {
            "name": f"{found.name}-for-the-verdict",
            "extends": _seen_from(applied, subject),
            "fixed": {**given, **chosen.changes},
        }
        text = f"# wearstate chart {subject}: {chosen.sentence}\n\n{toml_text(table)}"
        write_whole(applied, text.encode(), force=force)
    return found


def _seen_from(applied: Path, recipe: str) -> str:
    """Name of a recipe as written in another file."""
    return recipe if recipe in recipe_names() else os.path.relpath(recipe, applied.parent)


def _apply(
    subject: str,
    scene: Scene,
    given: Mapping[str, Any],
    found: Chart,
    choice: str,
    path: Path,
    force: bool,
) -> None:
    chosen = next((c for c in found.choices if c.question == _QUESTIONS[choice]), None)
    if chosen is None or chosen.status not in RECOMMENDED:
        why = "is none" if chosen is None else f"is none: {chosen.status}"
        fault = f"recommendation '{choice}' {why}; give more --budget, or write the scene by hand"
        raise SceneError(scene.name, [fault])
    note = f"wearstate chart {scene.name}, {chosen.question}: {chosen.sentence}"
    apply_changes(subject, scene, given, chosen.changes, path, note=note, force=force)


@contextmanager
def _watched(search: Search, scene: Scene, jobs: int, budget: float) -> Iterator[None]:
    """Show the answer so far on stderr, and on a terminal a bar with the time left."""
    with time_bar() as show:
        search.report = _Progress(search, scene, jobs, budget, show)
        yield


class _Progress:
    """Called before each measurement; reports what is known by then."""

    def __init__(
        self,
        search: Search,
        scene: Scene,
        jobs: int,
        budget: float,
        show: Callable[[str, float, float], None] | None,
    ) -> None:
        self.search, self.scene, self.jobs, self.budget = search, scene, jobs, budget
        self.show = show
        self.begin = time.perf_counter()
        self.answers = 0

    def __call__(self, what: str) -> None:
        gone = time.perf_counter() - self.begin
        done, total = self.search.progress()
        self._answer(gone)
        if self.show is not None:
            left = min(max(self.budget - gone, 0.0), self.search.remaining() / self.jobs)
            self.show(f"{what} ({done} of {total})", gone, left)

    def _answer(self, gone: float) -> None:
        """The scene against its own numerics, then against the best rungs; each once."""
        if self.answers == _ANSWERS or self.search.progress(at_all=True)[0] == 0:
            return
        found = self.search.result()
        if self.answers == 0 or found.raised is not None:
            self.answers = _ANSWERS if found.raised is not None else 1
            click.echo(f"after {gone:.0f} s: {where_it_stands(self.scene, found)}", err=True)


_ANSWERS = 2
