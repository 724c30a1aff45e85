"""Commands `chart` and `stability`: speed against accuracy, and where methods fail."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..options.help import command
from ..options.names import built_in, scene_argument
from ..options.outputs import (
    CHART_SUFFIXES,
    DATA_SUFFIXES,
    PAGE_SUFFIXES,
    PICTURE_SUFFIXES,
    check_interactive,
    check_outputs,
)
from ..options.progress import progress_bar
from ..options.shared import (
    EXIT_FAILED,
    PATH,
    Accuracy,
    Share,
    emit,
    force_option,
    jobs_option,
    json_option,
    overrides_of,
    points_option,
    report_bare_units,
    scene_of,
    seed_option,
    set_option,
)


@command()
@scene_argument
@set_option
@click.option("--map", "map_name", help="Draw one map only; default: all maps of the machine.")
@click.option("--size", type=click.IntRange(3, 60), help="Cells along each axis.")
@click.option(
    "--budget",
    type=Share(min=1.0, max=86_400.0),
    help="Time limit [s]; default: none. The scene's own methods run first; what is left is drawn "
    "as not run.",
)
@click.option(
    "-o", "--output", type=PATH, help="Page or picture to write (.html, .png, .svg or .pdf)."
)
@force_option
@json_option
def stability(
    scene_name: str,
    pairs: Sequence[str],
    map_name: str | None,
    size: int | None,
    budget: float | None,
    output: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Map where each method fails on SCENE, and how far the scene is from failure.

    Each cell is accurate, inaccurate or unstable, with a numerical or a physical cause; the scene
    is marked in every map.
    """
    from ..stability.atlas import atlas
    from ..stability.text import stability_table, stability_text

    check_outputs([scene_name], [(output, (*PAGE_SUFFIXES, *PICTURE_SUFFIXES))], force)
    machine = scene_of(scene_name, pairs)
    with progress_bar("running cells") as progress:
        maps = atlas(machine, name=map_name, budget=budget, size=size, progress=progress)
    files = [str(output)] if output is not None else []
    if output is not None:
        from ..stability.page import save_atlas

        save_atlas(machine, maps, output, force=force)
    text = "\n".join([stability_text(machine, maps), *files])
    emit({**stability_table(machine, maps), "files": files}, as_json, text)


@command()
@click.argument("subject", metavar="SCENE|DATA|RECIPE")
@set_option
@click.option(
    "--accuracy",
    type=Accuracy(1e-6, 0.5),
    default=None,
    help="Largest error allowed in each quantity; default: the scene's own. For a recipe: "
    "verdict=2%, the largest rise of the error of the wear estimate, in % of the limit.",
)
@click.option(
    "-n",
    "--records",
    type=click.IntRange(20, 10_000),
    default=None,
    help="For a recipe: records for each choice of rungs; default: 120.",
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    help="For a recipe: compare the rungs of this effect only.",
)
@click.option(
    "--folder",
    type=PATH,
    help="For a recipe: keep its data sets here, and continue from those already there.",
)
@click.option(
    "--budget",
    type=Share(1.0, 1e6),
    default=None,
    help="Time limit [s]; default: 90 for a scene, none for a data set. With -o, repeat the "
    "command to continue.",
)
@click.option(
    "-o", "--output", type=PATH, help="Chart to write (.html, .svg, .png, .pdf, .json, .csv)."
)
@click.option(
    "--apply", "applied", type=PATH, help="Write the recommended scene or recipe (.toml)."
)
@click.option(
    "--choice",
    type=click.Choice(["kept", "raised"]),
    default="kept",
    show_default=True,
    help="What --apply writes: the recommendation that keeps the rungs of the scene, or the one "
    "that may change them.",
)
@points_option
@seed_option
@jobs_option
@force_option
@json_option
def chart(
    subject: str,
    pairs: Sequence[str],
    accuracy: tuple[bool, float] | None,
    records: int | None,
    effects: Sequence[str],
    folder: Path | None,
    budget: float | None,
    output: Path | None,
    applied: Path | None,
    choice: str,
    interactive: bool,
    seed: int,
    jobs: int,
    force: bool,
    as_json: bool,
) -> None:
    """Chart cost against error: of the rungs of SCENE, or of features and models on DATA.

    SCENE: the error of its rungs and steps as written, the cheapest numerics that suffice if its
    rungs stay, and the cheapest rungs if they may change. Cheap information comes first; when the
    budget ends, or at Ctrl-C, the answer so far is given, and with -o the same command continues
    from there. DATA (.h5): features and models, cost against error. RECIPE with --accuracy
    verdict=2%: the cheaper rungs with which trained models still keep the verdict.
    """
    check_interactive(interactive, output)
    of_data = subject.endswith(DATA_SUFFIXES)
    of_verdict, share = accuracy if accuracy is not None else (False, None)
    if of_verdict and not of_data:
        if budget is not None or choice != "kept":
            raise click.UsageError("--budget and --choice are for a scene, not for a recipe")
        from .chart_run import verdict_chart_command

        assert share is not None
        found = verdict_chart_command(
            subject,
            overrides_of(pairs),
            accuracy=share,
            records=records or _VERDICT_RECORDS,
            effects=effects,
            folder=folder,
            output=output,
            applied=applied,
            seed=seed,
            jobs=jobs,
            force=force,
            interactive=interactive,
        )
        _emit_chart(found, [output, applied], as_json)
        return
    if records is not None or effects or folder is not None:
        raise click.UsageError("-n, --effect and --folder need --accuracy verdict=SHARE")
    if of_data and (pairs or accuracy is not None or applied):
        raise click.UsageError("--set, --accuracy and --apply are for a scene, not for a data set")
    if seed and not of_data:
        raise click.UsageError("--seed is for the models on a data set; a scene's chart draws none")
    if of_data:
        found = _data_chart(subject, budget, output, seed, jobs, force, interactive)
        _emit_chart(found, [output], as_json)
        return
    if subject in built_in("recipe"):
        raise click.UsageError(
            f"{subject} is a recipe: its chart takes --accuracy verdict=2%; or name its scene"
        )
    from .chart_run import scene_chart_command

    values = overrides_of(pairs)
    report_bare_units(subject, values)
    found, interrupted = scene_chart_command(
        subject,
        values,
        accuracy=share,
        budget=_CHART_BUDGET if budget is None else budget,
        output=output,
        applied=applied,
        choice=choice,
        jobs=jobs,
        force=force,
        interactive=interactive,
    )
    _emit_chart(found, [output, applied], as_json)
    if interrupted:
        resumed = "; the same command continues from there" if output else ""
        click.echo(f"interrupted: the measurements so far are shown{resumed}", err=True)
        raise click.exceptions.Exit(EXIT_FAILED)


_CHART_BUDGET = 90.0  # s, for a scene

_VERDICT_RECORDS = 120  # for each choice of rungs of a recipe


def _data_chart(
    subject: str,
    budget: float | None,
    output: Path | None,
    seed: int,
    jobs: int,
    force: bool,
    interactive: bool,
) -> Any:
    from ..charts.of_models import model_chart
    from ..charts.page import save_chart

    check_outputs([subject], [(output, CHART_SUFFIXES)], force)
    with progress_bar("measuring") as progress:
        found = model_chart(subject, seed=seed, budget=budget, jobs=jobs, progress=progress)
    if output is not None:
        save_chart(found, output, force=force, interactive=interactive)
    return found


def _emit_chart(found: Any, files: Sequence[Path | None], as_json: bool) -> None:
    from ..charts.chart import chart_table, chart_text

    written = [str(path) for path in files if path is not None]
    text = "\n".join([chart_text(found), *written])
    emit({**chart_table(found), "files": written}, as_json, text)
