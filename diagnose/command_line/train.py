"""Commands that make a model: calibrate a scene, train, and a demonstration of the workflow."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..options.help import command
from ..options.names import DATA, RECIPE, SCENE
from ..options.outputs import MODEL_SUFFIXES, SCENE_SUFFIXES, check_outputs
from ..options.progress import progress_bar
from ..options.shared import (
    PATH,
    PathType,
    Share,
    emit,
    force_option,
    jobs_option,
    join_option,
    json_option,
    seed_option,
)


@command()
@click.argument("scene", type=SCENE)
@click.argument("recordings", type=PATH, nargs=-1, required=True)
@click.option("-o", "--output", type=PATH, required=True, help="Scene to write (.toml).")
@click.option(
    "--unknown",
    "unknown",
    multiple=True,
    metavar="NAME",
    help="Path or choice of the recipe to estimate, * for any; repeatable. Default: all.",
)
@click.option(
    "--recipe",
    type=RECIPE,
    default=None,
    help="Recipe that specifies the unknown values of such machines and their ranges; default: the "
    "standard one.",
)
@click.option(
    "--budget",
    type=click.FloatRange(1, 86_400),
    default=None,
    metavar="SECONDS",
    help="Processor time on a typical core; determines how many machines are simulated.",
)
@seed_option
@jobs_option
@force_option
@json_option
def calibrate(
    scene: str,
    recordings: Sequence[Path],
    output: Path,
    unknown: Sequence[str],
    recipe: str | None,
    budget: float | None,
    seed: int,
    jobs: int,
    force: bool,
    as_json: bool,
) -> None:
    """Estimate the unknown values of the pump SCENE from healthy RECORDINGS of it.

    Writes the calibrated scene, and the distribution of its numbers next to it, from which records
    can be generated. Recordings that no machine of the scene could have made are refused.
    """
    from ..twin.calibration import PRIOR
    from ..twin.calibration import calibrate as run

    check_outputs([scene, *recordings], [(output, SCENE_SUFFIXES)], force)
    with progress_bar("simulating") as progress:
        found = run(
            scene,
            recordings,
            recipe=recipe or PRIOR,
            unknown=unknown,
            budget_s=budget,
            seed=seed,
            jobs=jobs,
            progress=progress,
        )
    found.save(output, force=force)
    emit({**found.table, "files": [str(output)]}, as_json, f"{found.text}\n{output}")


@command()
@click.argument("data", type=DATA)
@click.option("-o", "--output", type=PATH, required=True, help="Model to write (.wsm).")
@click.option(
    "--target",
    metavar="COLUMN",
    default=None,
    help="Severity to train for, or label of named conditions; default: the first severity.",
)
@click.option(
    "--held-out",
    type=Share(0, 0.9),
    default=0.25,
    show_default=True,
    help="Share of the machine draws held out of training, to judge the model.",
)
@click.option(
    "--split",
    metavar="NAME",
    help="Split stored in DATA (wearstate splits): train on its training side only.",
)
@click.option(
    "--baseline",
    "healthy",
    type=PATH,
    help="Healthy records of DATA's machines: the model compares each machine with its new state.",
)
@click.option(
    "--refuse",
    multiple=True,
    type=DATA,
    help="Data set that the model must refuse (pins in oil, another fault or machine); repeatable.",
)
@click.option(
    "--features",
    multiple=True,
    metavar="SET|NAMES|FILE",
    help="Features to train on: a set (standard, core, complete), names, or a text file of names. "
    "Cross-validation chooses among several, or among all sets (select).",
)
@click.option(
    "--budget-ms",
    type=click.FloatRange(0, min_open=True),
    default=None,
    help="Time that a prediction may take, without its features [ms]; default: 5.",
)
@join_option
@seed_option
@jobs_option
@force_option
@json_option
def train(
    data: Path,
    output: Path,
    target: str | None,
    held_out: float,
    split: str | None,
    healthy: Path | None,
    refuse: Sequence[Path],
    features: Sequence[str],
    budget_ms: float | None,
    joined: Sequence[str],
    seed: int,
    jobs: int,
    force: bool,
    as_json: bool,
) -> None:
    """Train a wear model on a labelled data set and judge it on held-out machine draws.

    With --join: on several tests of each machine state together; each feature is named after its
    view. If the target names conditions instead of a severity: a model that names the condition,
    judged with each recording left out in turn.
    """
    from ...datasets.audit.integrity import refuse_shared, refuse_wrong_labels
    from ...datasets.file.views import views_of
    from ..class_model.train import names_classes
    from ..evaluation.evaluate import score
    from ..evaluation.text import features_text, refusal_lines, score_lines
    from ..feature_rows.feature_choice import choice_in, choices_of, costs_ms
    from ..feature_rows.noted import partly_noted
    from ..healthy_reference.healthy import references
    from ..healthy_reference.transfer_reference import healthy_transfer
    from ..nameplate.cautions import untrained_wear
    from ..wear_model.file import save_model
    from ..wear_model.train import train_model

    views = views_of(joined)
    inputs = [data, *refuse, *(view.path for view in views), *([healthy] if healthy else [])]
    check_outputs(inputs, [(output, MODEL_SUFFIXES)], force)
    source = click.get_current_context().get_parameter_source("held_out")
    shared = source is not click.core.ParameterSource.DEFAULT
    if shared and split:
        raise click.UsageError("--split determines what is held out: leave out --held-out")
    choices = tuple(replace(choice, views=views) for choice in choices_of(features))
    if target is not None and names_classes(data, target):
        if len(choices) > 1:
            raise click.UsageError("--features must name one set for a model of named conditions")
        if healthy or budget_ms or shared or split or views or refuse:
            raise click.UsageError(
                f"--baseline, --budget-ms, --held-out, --join, --refuse and --split are for a "
                f"severity; {target} names conditions, and every recording is left out in turn"
            )
        _train_classes(data, output, target, choices[0], seed, jobs, force, as_json)
        return
    refuse_wrong_labels(data)
    refuse_shared(data, refuse)
    with progress_bar("features") as progress:
        model, table, test = train_model(
            data,
            target=target,
            held_out=held_out,
            split=split,
            seed=seed,
            jobs=jobs,
            budget_ms=budget_ms,
            baseline=healthy,
            refuse=refuse,
            choices=choices,
            progress=progress,
        )
        reference = None
        if healthy is not None:
            reference, _ = references(
                table,
                data,
                healthy,
                choice=choice_in(model.card.feature_choice),
                jobs=jobs,
                progress=progress,
            )
    save_model(model, output, force=force)
    result = score(model, table, test, references=reference) if len(test) else {}
    trained = model.card.trained_on
    head = f"{output}: trained on {trained.records} records of {trained.draws} machine draws"
    costs = costs_ms(data, choices, healthy_transfer(healthy, choices))
    left_out = [f"  left out: {text}" for text in table.lacking_words]
    left_out += [f"  not used: {text}" for text in partly_noted(table.manifest)]
    lines = [
        head,
        *left_out,
        *features_text(model.card, choices, costs),
        *refusal_lines(model.card),
        *score_lines(result, model.card),
    ]
    if model.notice:
        lines.append(f"Notice: {model.notice}.")
    lines += [f"Caution: {text}." for text in untrained_wear(model.card)]
    chosen = {**model.card.feature_choice.table(), "ms_per_record": costs}
    value = {
        "path": str(output),
        "trained_on": trained.table(),
        "features": chosen,
        "strangers": [rates.table() for rates in model.card.strangers],
        "held_out": result,
    }
    emit(value, as_json, "\n".join(lines))


def _train_classes(
    data: Path,
    output: Path,
    target: str,
    choice: Any,
    seed: int,
    jobs: int,
    force: bool,
    as_json: bool,
) -> None:
    """A model of named conditions, judged with whole recordings left out."""
    from ..class_model.file import save_class_model
    from ..class_model.text import classes_text
    from ..class_model.train import train_classes

    with progress_bar("features") as progress:
        model, result = train_classes(
            data, target=target, choice=choice, seed=seed, jobs=jobs, progress=progress
        )
    save_class_model(model, output, force=force)
    head = (
        f"{output}: trained on {model.card.records} records of {result['recordings']} "
        f"recordings, to distinguish {', '.join(model.classes)}"
    )
    notice = [f"Notice: {model.notice}."] if model.notice else []
    value = {"path": str(output), "target": target, "left_out": result, "notice": model.notice}
    emit(value, as_json, "\n".join([head, *classes_text(result), *notice]))


@command()
@click.option(
    "--folder",
    type=PathType(path_type=Path, file_okay=False),
    default=Path("demo"),
    show_default=True,
    help="Folder for its files: new, empty, or that of an earlier demo, whose files are replaced.",
)
@seed_option
@jobs_option
@json_option
def demo(folder: Path, seed: int, jobs: int, as_json: bool) -> None:
    """Run the whole workflow on a small example: simulate, features, train, evaluate, report."""
    from ..evaluation.text import score_lines
    from ..workflow.demo import run_demo

    with progress_bar("simulating and learning") as progress:
        result = run_demo(
            folder,
            seed=seed,
            jobs=jobs,
            progress=progress,
            say=lambda text: click.echo(text, err=True),
        )
    text = "\n".join([*score_lines(result["held_out"], result["card"]), "", result["text"]])
    emit({key: result[key] for key in ("files", "held_out", "report", "seconds")}, as_json, text)
