"""The command `sweep`: variation of numbers of a scene."""

from collections.abc import Sequence
from pathlib import Path

import click

from ..options.help import command
from ..options.names import scene_argument
from ..options.outputs import (
    CHART_SUFFIXES,
    check_interactive,
    check_outputs,
)
from ..options.progress import progress_bar
from ..options.shared import (
    EXIT_FAILED,
    PATH,
    Share,
    emit,
    force_option,
    jobs_option,
    json_option,
    overrides_of,
    points_option,
    report_bare_units,
    seed_option,
    set_option,
)

_SUFFIXES = (*CHART_SUFFIXES, ".htm")


@command()
@scene_argument
@click.option(
    "--over",
    multiple=True,
    required=True,
    metavar="PATH=VALUES",
    help="Values, as A..B, A..B/N or A,B,C with a unit at the end; repeatable. The last is the "
    "change to detect.",
)
@set_option
@click.option(
    "--show",
    multiple=True,
    metavar="NAME,…",
    help="Features or true values of the simulation to show; * and ? match as in a shell.",
)
@click.option(
    "--points",
    type=click.IntRange(2, 1000),
    default=5,
    show_default=True,
    help="Points of a range A..B that is given without /N.",
)
@click.option(
    "--starts",
    type=click.IntRange(1, 1000),
    default=5,
    show_default=True,
    help="Recordings at each point, each with its own start angle, noise and random forces.",
)
@click.option(
    "--confidence",
    type=Share(0.5, 0.9999),
    default=0.95,
    show_default=True,
    help="Probability of detecting a change, and of reporting none if there is none.",
)
@click.option(
    "-o",
    "--output",
    type=PATH,
    help="Page, table or picture to write (.html, .csv, .json, .png, .svg).",
)
@points_option
@seed_option
@jobs_option
@force_option
@json_option
def sweep(
    scene_name: str,
    over: Sequence[str],
    pairs: Sequence[str],
    show: Sequence[str],
    points: int,
    starts: int,
    confidence: float,
    output: Path | None,
    interactive: bool,
    seed: int,
    jobs: int,
    force: bool,
    as_json: bool,
) -> None:
    """Vary numbers of SCENE: find which feature shows a change, from which size, and where first.

    The last --over is the change to detect, such as a clearance; those before it are conditions,
    such as the speed. With -o, runs are kept in the folder of the output until all are done: after
    Ctrl-C the same command continues. The CSV has one row for each point and start, in SI units.
    """
    from ..pages.kept import part_file
    from ..sweep.axes import SweepError
    from ..sweep.page import save_sweep
    from ..sweep.sweep import kept_runs, measure, sweep_of, sweep_plan
    from ..sweep.text import sweep_table, sweep_text

    check_interactive(interactive, output)
    part = part_file(output)
    going_on = part is not None and part.exists() and not force
    check_outputs([scene_name], [(output, _SUFFIXES)], force or going_on)
    values = overrides_of(pairs)
    report_bare_units(scene_name, values)
    plan = sweep_plan(
        scene_name,
        over,
        given=values,
        show=[name for text in show for name in text.split(",") if name.strip()],
        points=points,
        starts=starts,
        seed=seed,
        confidence=confidence,
    )
    if part is not None and force:
        part.unlink(missing_ok=True)
    kept = kept_runs(part, plan)
    interrupted = False
    try:
        with progress_bar("simulating") as progress:
            measure(plan, kept, jobs=jobs, progress=progress)
    except KeyboardInterrupt:
        interrupted = True
    found = sweep_of(plan, kept)
    if found.finished and all(run.fault for run in found.outcomes.values()):
        kept.drop()
        raise SweepError([f"no run succeeded: {fault}" for fault in found.faults])
    if output is not None and found.outcomes:
        save_sweep(found, output, force=force or going_on, interactive=interactive)
        if found.finished:
            kept.drop()
    files = [str(output)] if output is not None and found.outcomes else []
    text = "\n".join([sweep_text(found), *files])
    emit({**sweep_table(found), "files": files}, as_json, text)
    if interrupted:
        resumed = "; the same command continues from there" if output else ""
        click.echo(f"interrupted: the simulations so far are shown{resumed}", err=True)
        raise click.exceptions.Exit(EXIT_FAILED)
