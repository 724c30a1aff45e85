"""Commands that show how far a model can be trusted: evaluate, blindspots."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ..options.help import command
from ..options.names import DATA, MODEL
from ..options.outputs import PAGE_SUFFIXES, check_outputs
from ..options.progress import progress_bar
from ..options.shared import (
    MOST_RECORDS,
    PATH,
    PathType,
    emit,
    force_option,
    jobs_option,
    join_option,
    json_option,
    overrides_of,
    seed_option,
    set_option,
)


@command()
@click.argument("model_file", metavar="MODEL", type=MODEL)
@click.argument("data", type=DATA, required=False)
@click.option(
    "--across-fidelity",
    is_flag=True,
    help="MODEL is a recipe: train on each of its rungs, judge on the best.",
)
@click.option(
    "-n",
    "--records",
    type=click.IntRange(20, MOST_RECORDS),
    default=None,
    help="With --across-fidelity: records for each rung; default: 120.",
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    help="With --across-fidelity: compare the rungs of this effect only.",
)
@set_option
@click.option(
    "--folder",
    type=PathType(path_type=Path, file_okay=False),
    help="Keep the data sets of --across-fidelity here, and reuse those already there.",
)
@click.option(
    "--split",
    metavar="NAME",
    help="Split stored in DATA (wearstate splits): judge on the whole of its test side.",
)
@click.option(
    "--retrain",
    multiple=True,
    metavar="NAME|all",
    help="Train again without this part of DATA and judge on it; repeatable.",
)
@join_option
@click.option("--trained-on", type=PATH, help="MODEL's training set, for the baselines.")
@click.option("--baseline", "healthy", type=PATH, help="Healthy records of DATA's machines.")
@click.option("--quick", is_flag=True, help="Leave out baselines that need third-party packages.")
@click.option(
    "--cache",
    type=PathType(path_type=Path, file_okay=False),
    help="Folder in which to keep features computed by third-party packages.",
)
@click.option("-o", "--output", type=PATH, help="Page, picture or JSON to write.")
@seed_option
@force_option
@jobs_option
@json_option
def evaluate(
    model_file: Path,
    data: Path | None,
    across_fidelity: bool,
    records: int | None,
    effects: Sequence[str],
    pairs: Sequence[str],
    folder: Path | None,
    output: Path | None,
    seed: int,
    force: bool,
    jobs: int,
    as_json: bool,
    **given: Any,
) -> None:
    """Judge MODEL on the machine draws of DATA that it has not seen.

    With --split: on the test side of this split of DATA. With --retrain: train as MODEL was
    trained, with other parts of DATA held out, and judge on these. With --across-fidelity: find
    the loss of accuracy when training on a cheaper model of the machine.
    """
    from ..class_model.file import CLASS_MODEL
    from ..wear_model.bundle import kind_of

    keys = ("split", "retrain", "joined", "trained_on", "healthy", "quick", "cache")
    named = [key for key in keys if given[key]]
    if across_fidelity:
        if data is not None:
            raise click.UsageError("--across-fidelity makes its own data: name a recipe only")
        if named or output:
            raise click.UsageError("--across-fidelity takes no option for judging on DATA")
        _judge_across(model_file, records or _ACROSS, effects, pairs, folder, seed, jobs, as_json)
        return
    if data is None:
        raise click.UsageError("Missing argument 'DATA'.")
    if records or effects or pairs or folder:
        raise click.UsageError("-n, --effect, --set and --folder need --across-fidelity")
    if given["retrain"] and (given["trained_on"] or given["split"]):
        raise click.UsageError(
            "--retrain trains on DATA with its own splits: --trained-on and --split do not apply; "
            "leave them out"
        )
    if given["retrain"] and given["joined"]:
        raise click.UsageError("--retrain has no joined views: leave out --join or --retrain")
    check_outputs([model_file, data], [(output, _EVALUATION)], force)
    if kind_of(model_file) == CLASS_MODEL:
        if named or output:
            raise click.UsageError("this option does not apply to a model of named conditions")
        _judge_classes(model_file, data, seed, jobs, as_json)
        return
    _judge(model_file, data, output, seed, jobs, force, as_json, given)


_EVALUATION = (".html", ".png", ".svg", ".pdf", ".json")


def _judge_classes(model_file: Path, data: Path, seed: int, jobs: int, as_json: bool) -> None:
    """Judge a model of named conditions."""
    from ..class_model.file import load_class_model
    from ..class_model.text import classes_text
    from ..class_model.train import evaluate_classes

    model = load_class_model(model_file)
    with progress_bar("features") as progress:
        result = evaluate_classes(model, data, seed=seed, jobs=jobs, progress=progress)
    emit(result, as_json, "\n".join(classes_text(result)))


def _judge(
    model_file: Path,
    data: Path,
    output: Path | None,
    seed: int,
    jobs: int,
    force: bool,
    as_json: bool,
    given: Mapping[str, Any],
) -> None:
    """Judge a finished model, or by splits; print text or JSON, and write a file if requested."""
    from ...datasets.audit.integrity import refuse_wrong_labels
    from ..evaluation.figure import save_evaluation
    from ..evaluation.protocol import evaluate_splits
    from ..evaluation.splits import ALL_SPLITS, case_of
    from ..evaluation.text import splits_text
    from ..wear_model.file import load_model
    from ..workflow.evaluate import evaluate as judge

    model = load_model(model_file)
    with progress_bar("features") as progress:
        ways: dict[str, Any] = {"quick": given["quick"], "cache": given["cache"]}
        ways |= {"seed": seed, "jobs": jobs, "progress": progress}
        if given["retrain"]:
            names = ALL_SPLITS if "all" in given["retrain"] else given["retrain"]
            refuse_wrong_labels(data)
            case = case_of(model, data, healthy=given["healthy"], **ways)
            result = evaluate_splits(case, names, say=lambda text: click.echo(text, err=True))
            if output is not None:
                save_evaluation(result, output, notice=model.notice, force=force)
            emit(result, as_json, splits_text(result))
            return
        ways |= {key: given[key] for key in ("trained_on", "split", "joined")}
        found = judge(model, data, baseline=given["healthy"], **ways)
    if output is not None:
        found.save(output, force=force)
    emit(found.result, as_json, found.text)


_ACROSS = 120  # records


def _judge_across(
    recipe: Path,
    records: int,
    effects: Sequence[str],
    pairs: Sequence[str],
    folder: Path | None,
    seed: int,
    jobs: int,
    as_json: bool,
) -> None:
    """Losses from training on cheaper rungs; the data sets are deleted unless a folder is given."""
    from tempfile import TemporaryDirectory

    from ..charts.across import RungSets, across_fidelity, across_table, across_text

    with TemporaryDirectory() as passing:
        sets = RungSets(
            str(recipe),
            records,
            folder or Path(passing),
            effects=effects,
            overrides=overrides_of(pairs),
            seed=seed,
            jobs=jobs,
            say=lambda text: click.echo(text, err=True),
        )
        found = across_fidelity(sets)
    emit(across_table(found), as_json, across_text(found))


@command()
@click.argument("model_file", metavar="MODEL", type=MODEL)
@click.option(
    "--recipe", metavar="RECIPE", help="Recipe that draws the machines; default: the model's own."
)
@click.option(
    "-n",
    "--machines",
    type=click.IntRange(1, 300),
    default=12,
    show_default=True,
    help="Machines simulated for each row.",
)
@click.option(
    "--budget",
    type=click.FloatRange(0, min_open=True),
    help="Time [s] after which no further row is started; repeat the command to continue.",
)
@click.option(
    "--background",
    type=PATH,
    help="Recording of the surroundings, added at three levels; its unit does not matter.",
)
@click.option(
    "--only",
    metavar="TEXT",
    multiple=True,
    help="Only rows whose name or shift contains TEXT, to judge them on more machines; repeatable.",
)
@click.option("-o", "--output", type=PATH, help="HTML page to write.")
@seed_option
@force_option
@json_option
def blindspots(
    model_file: Path,
    recipe: str | None,
    machines: int,
    budget: float | None,
    background: Path | None,
    only: tuple[str, ...],
    output: Path | None,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    """Measure the error of MODEL if an assumption of its recipe does not hold.

    The same simulated machines, unseen in training, are judged repeatedly: each value that the
    recipe holds fixed is shifted, each drawn value is moved beyond its range, and the signal is
    disturbed, one at a time. The table begins with the largest error without a caution. With -o,
    finished rows are kept in the folder of the page until all are done.
    """
    from ..blindspots.blindspots import file_hash, find_blind_spots, kept_rows, recipe_of, run_key
    from ..blindspots.signals import signal_rows
    from ..blindspots.text import blind_spots_table, blind_spots_text
    from ..class_model.file import CLASS_MODEL
    from ..pages.kept import part_file
    from ..pages.page import save_page
    from ..wear_model.bundle import kind_of
    from ..wear_model.file import load_model

    part = part_file(output)
    going_on = part is not None and part.exists() and not force
    inputs = [model_file, *([background] if background else [])]
    check_outputs(inputs, [(output, PAGE_SUFFIXES)], force or going_on)
    if kind_of(model_file) == CLASS_MODEL:
        raise click.UsageError(f"{model_file} is a model of named conditions; name a wear model")
    model = load_model(model_file)
    plan = recipe_of(model, recipe)
    if part is not None and force:
        part.unlink(missing_ok=True)
    heard = file_hash(background) if background else ""
    kept = kept_rows(part, run_key(file_hash(model_file), plan, machines, seed, heard))
    with progress_bar("rows") as progress:
        found = find_blind_spots(
            model,
            plan,
            machines=machines,
            seed=seed,
            budget=budget,
            signals=signal_rows(background),
            only=only,
            kept=kept,
            progress=progress,
        )
    table = blind_spots_table(found, model.card)
    if output is not None:
        from ..blindspots.page import blind_spots_html

        page = blind_spots_html(table, notice=model.notice)
        save_page(page, output, force=force or going_on)
        if not found.left:
            kept.drop()
    emit(table, as_json, blind_spots_text(table))
