"""Commands about the wear: train, evaluate, report, and the demonstration of it all."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import click

from ..pages.plain_json import json_text
from .command_help import command
from .command_names import DATA, MODEL, RECIPE, SCENE
from .command_options import (
    EXIT_ALARM,
    EXIT_BAD_INPUT,
    EXIT_UNFAMILIAR,
    EXIT_WARNING,
    MODEL_SUFFIXES,
    MOST_RECORDS,
    PAGE_SUFFIXES,
    PATH,
    SCENE_SUFFIXES,
    PathType,
    Share,
    check_outputs,
    declared_source,
    emit,
    force_option,
    jobs_option,
    join_option,
    json_option,
    overrides_of,
    progress_bar,
    seed_option,
    source_options,
    tell_bare,
    worker_count,
)

_FAIL_ON_HELP = "Exit 3 at a warning, 4 at an alarm, 5 when unfamiliar; alarm: only 4 and 5."


@command()
@click.argument("scene", type=SCENE)
@click.argument("recordings", type=PATH, nargs=-1, required=True)
@click.option("-o", "--output", type=PATH, required=True, help="Scene to write (.toml).")
@click.option(
    "--unknown",
    "unknown",
    multiple=True,
    metavar="NAME",
    help="What to estimate, a path or choice of the recipe, * for any; repeat it. All by default.",
)
@click.option(
    "--recipe",
    type=RECIPE,
    default=None,
    help="What is unknown of such machines, and how widely; the standard one by default.",
)
@click.option(
    "--budget",
    type=click.FloatRange(1, 86_400),
    default=None,
    metavar="SECONDS",
    help="Time of a usual core; decides how many machines are simulated.",
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
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Estimate what is unknown of the pump SCENE from healthy RECORDINGS of it.

    Writes the calibrated scene, and beside it what is known of its numbers, to generate records
    from. Recordings that no machine of the scene could have made are refused.
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
            jobs=worker_count(jobs),
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
    help="Severity to train for, or label of named conditions; the first severity by default.",
)
@click.option(
    "--held-out",
    type=Share(0, 0.9),
    default=0.25,
    show_default=True,
    help="Share of the machine draws kept out of training, to judge the model.",
)
@click.option(
    "--split",
    metavar="NAME",
    help="Split that DATA holds (wearstate splits): learn from its training side alone.",
)
@click.option(
    "--baseline",
    "healthy",
    type=PATH,
    help="Healthy records of DATA's machines: a model that is told how each was when new.",
)
@click.option(
    "--refuse",
    multiple=True,
    type=DATA,
    help="Data set that the model must refuse: pins in oil, another fault or machine; repeatable.",
)
@click.option(
    "--features",
    multiple=True,
    metavar="SET|NAMES|FILE",
    help="Train on this set (standard, core, complete), these names or those in a text file. Of "
    "several, or of select (all sets), folds choose.",
)
@click.option(
    "--budget-ms",
    type=click.FloatRange(0, min_open=True),
    default=None,
    help="Time that a prediction may take, beside its features [ms]; 5 by default.",
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
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Train a wear model on a labelled data set and judge it on held-out machine draws.

    With --join: on several tests of each machine state together, the features of each named by
    its view. Where the target names conditions instead of a severity: a model that tells which,
    judged with every recording left out in turn.
    """
    from ...datasets.file.views import views_of
    from ..class_model.train import names_classes
    from ..evaluation.evaluate import score
    from ..evaluation.text import features_text, refusal_lines, score_lines
    from ..feature_rows.feature_choice import choice_in, choices_of, costs_ms
    from ..feature_rows.healthy import references
    from ..feature_rows.transfer_reference import healthy_transfer
    from ..wear_model.file import save_model
    from ..wear_model.train import train_model

    views = views_of(joined)
    inputs = [data, *refuse, *(view.path for view in views), *([healthy] if healthy else [])]
    check_outputs(inputs, [(output, MODEL_SUFFIXES)], force)
    source = click.get_current_context().get_parameter_source("held_out")
    shared = source is not click.core.ParameterSource.DEFAULT
    if shared and split:
        raise click.UsageError("--split says what is held out: leave --held-out away")
    choices = tuple(replace(choice, views=views) for choice in choices_of(features))
    if target is not None and names_classes(data, target):
        if len(choices) > 1:
            raise click.UsageError("--features must name one set for a model of named conditions")
        if healthy or budget_ms or shared or split or views or refuse:
            raise click.UsageError(
                f"--baseline, --budget-ms, --held-out, --join, --refuse and --split are for a "
                f"severity; {target} names conditions, and every recording is left out in turn"
            )
        _train_classes(data, output, target, choices[0], seed, worker_count(jobs), force, as_json)
        return
    with progress_bar("features") as progress:
        model, table, test = train_model(
            data,
            target=target,
            held_out=held_out,
            split=split,
            seed=seed,
            jobs=worker_count(jobs),
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
                jobs=worker_count(jobs),
                progress=progress,
            )
    save_model(model, output, force=force)
    result = score(model, table, test, references=reference) if len(test) else {}
    trained = model.card.trained_on
    head = f"{output}: trained on {trained.records} records of {trained.draws} machine draws"
    costs = costs_ms(data, choices, healthy_transfer(healthy, choices))
    left_out = [f"  left out: {text}" for text in table.lacking_words]
    lines = [
        head,
        *left_out,
        *features_text(model.card, choices, costs),
        *refusal_lines(model.card),
        *score_lines(result, model.card),
    ]
    if model.notice:
        lines.append(f"Notice: {model.notice}.")
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
    from ..class_model.train import classes_text, train_classes

    with progress_bar("features") as progress:
        model, result = train_classes(
            data, target=target, choice=choice, seed=seed, jobs=jobs, progress=progress
        )
    save_class_model(model, output, force=force)
    head = (
        f"{output}: trained on {model.card.records} records of {result['recordings']} "
        f"recordings, to tell {', '.join(model.classes)}"
    )
    notice = [f"Notice: {model.notice}."] if model.notice else []
    value = {"path": str(output), "target": target, "left_out": result, "notice": model.notice}
    emit(value, as_json, "\n".join([head, *classes_text(result), *notice]))


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
    help="Of every rung, with --across-fidelity; 120 by default.",
)
@click.option("--effect", "effects", multiple=True, help="With --across-fidelity: only this one.")
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option(
    "--folder",
    type=PathType(path_type=Path, file_okay=False),
    help="Keep the data sets of --across-fidelity, and use those that are there.",
)
@click.option(
    "--split",
    metavar="NAME",
    help="Split that DATA holds (wearstate splits): judge on all of its test side.",
)
@click.option(
    "--retrain",
    multiple=True,
    metavar="NAME|all",
    help="Train and judge anew with this part of DATA held out; may be repeated.",
)
@join_option
@click.option("--trained-on", type=PATH, help="MODEL's training set, for the baselines.")
@click.option("--baseline", "healthy", type=PATH, help="Healthy records of DATA's machines.")
@click.option("--quick", is_flag=True, help="Leave out baselines that need packages of others.")
@click.option(
    "--cache",
    type=PathType(path_type=Path, file_okay=False),
    help="Folder in which features of such packages are kept.",
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
    jobs: int | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Judge MODEL on the machine draws of DATA that it has not seen.

    With --split: on what this split of DATA tests. With --retrain: train as MODEL was trained, with
    other parts of DATA held out, and judge on these. With --across-fidelity: what training on a
    cheaper model of the machine costs.
    """
    from ..class_model.file import CLASS_MODEL
    from ..wear_model.bundle import kind_of

    keys = ("split", "retrain", "joined", "trained_on", "healthy", "quick", "cache")
    named = [key for key in keys if given[key]]
    if across_fidelity:
        if data is not None:
            raise click.UsageError("--across-fidelity makes its own data: name a recipe only")
        if named or output:
            raise click.UsageError("--across-fidelity takes no option of a judgement on DATA")
        _judge_across(model_file, records or _ACROSS, effects, pairs, folder, seed, jobs, as_json)
        return
    if data is None:
        raise click.UsageError("Missing argument 'DATA'.")
    if records or effects or pairs or folder:
        raise click.UsageError("-n, --effect, --set and --folder need --across-fidelity")
    if given["retrain"] and (given["trained_on"] or given["split"]):
        raise click.UsageError(
            "--retrain trains on DATA, by splits of its own: --trained-on and --split have no "
            "meaning with it"
        )
    if given["retrain"] and given["joined"]:
        raise click.UsageError("--retrain knows no joined views: leave --join or --retrain out")
    check_outputs([model_file, data], [(output, _EVALUATION)], force)
    if kind_of(model_file) == CLASS_MODEL:
        if named or output:
            raise click.UsageError("a model of named conditions takes no such option")
        _judge_classes(model_file, data, seed, worker_count(jobs), as_json)
        return
    _judge(model_file, data, output, seed, worker_count(jobs), force, as_json, given)


_EVALUATION = (".html", ".png", ".svg", ".pdf", ".json")


def _judge_classes(model_file: Path, data: Path, seed: int, jobs: int, as_json: bool) -> None:
    """Of a model of named conditions."""
    from ..class_model.file import load_class_model
    from ..class_model.train import classes_text, evaluate_classes

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
    """Of a finished model, or by splits; text or JSON, and a file if asked for."""
    from ..evaluation.figure import save_evaluation
    from ..evaluation.splits import ALL_SPLITS, case_of, evaluate_splits
    from ..evaluation.text import splits_text
    from ..wear_model.file import load_model
    from ..workflow.evaluate import evaluate as judge

    model = load_model(model_file)
    with progress_bar("features") as progress:
        ways: dict[str, Any] = {"quick": given["quick"], "cache": given["cache"]}
        ways |= {"seed": seed, "jobs": jobs, "progress": progress}
        if given["retrain"]:
            names = ALL_SPLITS if "all" in given["retrain"] else given["retrain"]
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
    jobs: int | None,
    as_json: bool,
) -> None:
    """Losses of training on cheaper rungs; the data sets vanish unless a folder is given."""
    from tempfile import TemporaryDirectory

    from ..charts.across import across_fidelity, across_table, across_text

    with TemporaryDirectory() as passing:
        found = across_fidelity(
            str(recipe),
            records,
            folder or Path(passing),
            effects=effects,
            overrides=overrides_of(pairs),
            seed=seed,
            jobs=worker_count(jobs),
            say=lambda text: click.echo(text, err=True),
        )
    emit(across_table(found), as_json, across_text(found))


@command()
@click.argument("source", metavar="RECORDING|FOLDER", type=DATA)
@click.option("--model", "model_file", type=MODEL, required=True, help="Wear model (.wsm).")
@click.option("--baseline", "healthy", type=PATH, help="Healthy recordings of the machine (.h5).")
@join_option
@click.option("-o", "--output", type=PATH, help="HTML page to write.")
@click.option(
    "--interactive",
    is_flag=True,
    help="Of one recording: curves to zoom and measure in the page; of many: their trends.",
)
@click.option("--machine", metavar="KIND", help="Kind of machine, for its ISO zone.")
@click.option(
    "--scene",
    metavar="SCENE|TOML",
    help="The machine's nameplate: geometry, load, oil. A data set's own by default.",
)
@click.option(
    "--set",
    "pairs",
    multiple=True,
    metavar="PATH=VALUE",
    help="Replace a value of the nameplate, as load.static='4 kN +- 5 %'.",
)
@click.option(
    "--twin",
    type=PATH,
    metavar="SCENE",
    help="Calibrated scene of this machine (wearstate calibrate): estimates the wear as well.",
)
@click.option("--trend", is_flag=True, help="Of many recordings: severity over time, life left.")
@click.option(
    "--dates",
    metavar="names|mtime|CSV|COLUMN",
    help="Times for --trend: in file names, of files, a table file,date or file,hours, or a column "
    "of hours in the data set (operating_hours).",
)
@click.option(
    "--growth",
    type=click.Choice(["linear", "log"]),
    default="linear",
    show_default=True,
    help="Of the wear over time: abrasive, or damage that feeds itself.",
)
@seed_option
@source_options
@click.option("--fail-on", type=click.Choice(["warning", "alarm"]), help=_FAIL_ON_HELP)
@force_option
@json_option
def report(
    source: Path,
    model_file: Path,
    healthy: Path | None,
    output: Path | None,
    machine: str | None,
    scene: str | None,
    pairs: Sequence[str],
    fail_on: str | None,
    force: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """The verdict on RECORDING: wear grade and severity with interval, or why there is none.

    Of a FOLDER, or a data set without --record: a table of all recordings, the most urgent first;
    with --json one object a line. Exit 2 if nothing could be judged; with --fail-on, of many
    recordings, the code of the worst: alarm, warning, bad input, unfamiliar. With times, only the
    latest of a machine counts.
    """
    from ...datasets.file.views import views_of
    from ..class_model.file import CLASS_MODEL
    from ..feature_rows.healthy import Baselines
    from ..nameplate.nameplate import nameplate_of
    from ..report.verdict import known_machine
    from ..wear_model.bundle import kind_of
    from ..wear_model.file import load_model

    views = views_of(given["joined"])
    inputs = [source, model_file, *(view.path for view in views), *([healthy] if healthy else [])]
    check_outputs(inputs, [(output, PAGE_SUFFIXES)], force)
    known_machine(machine)
    if kind_of(model_file) == CLASS_MODEL:
        wear = {
            "--baseline": healthy,
            "-o": output,
            "--interactive": given["interactive"],
            "--machine": machine,
            "--scene": scene,
            "--set": pairs,
            "--fail-on": fail_on,
            "--join": given["joined"],
            "--twin": given["twin"],
            "--trend": given["trend"],
            "--dates": given["dates"],
        }
        wrong = [option for option, value in wear.items() if value]
        if wrong:
            raise click.UsageError(
                f"{model_file} names conditions and knows no wear: leave {', '.join(wrong)} out, "
                "or name a wear model"
            )
        _report_class(source, model_file, given, as_json)
        return
    model = load_model(model_file)
    baselines = Baselines(healthy, model.card) if healthy else None
    many = _holds_many(source)
    if not many and (given["trend"] or given["dates"]):
        raise click.UsageError("--trend and --dates are for a folder or a data set of many records")
    if many and given["twin"]:
        raise click.UsageError("--twin is for one recording: name one, or choose a --record")
    if given["interactive"]:
        _check_interactive(output, many and not (given["trend"] or given["dates"]))
    if views and source.is_dir():
        raise click.UsageError("--join completes a recording or a data set: name one, not a folder")
    usual = model.card.trained_on.scene
    values = overrides_of(pairs)
    if scene is not None:
        tell_bare(scene, values)
    plate = nameplate_of(source, scene, values, usual=usual)
    ways = (output, machine, as_json, force, given, views)
    told = _ReportTask(source, model_file, model, baselines, plate, *ways)
    verdicts = _report_many(told) if many else _report_one(told)
    raise click.exceptions.Exit(report_exit(verdicts, fail_on))


def _check_interactive(output: Path | None, untimed: bool) -> None:
    """Refuse curves where there is no page, many recordings without trend, or nothing to draw."""
    from ..pages.embed import require_bokeh

    if output is None:
        raise click.UsageError("--interactive adds curves to the page: name one with -o")
    if untimed:
        raise click.UsageError(
            "--interactive is for one recording or a trend: name one, choose a --record, or add "
            "--trend"
        )
    require_bokeh()


def _holds_many(source: Path) -> bool:
    """Whether a folder, or a data set of which no record is chosen."""
    from ..report.batch import record_count

    asked = click.get_current_context().get_parameter_source("record")
    chosen = asked is not click.core.ParameterSource.DEFAULT
    return source.is_dir() or (not chosen and record_count(source) > 1)


def _report_class(source: Path, model_file: Path, given: Mapping[str, Any], as_json: bool) -> None:
    """The condition in recordings; of JSON each as soon as it is told. Exit 2 where none can be."""
    from ...datasets.measured.recording import read_recording
    from ..class_model.file import load_class_model
    from ..class_model.train import name_all, naming_text, namings_summary
    from ..report.batch import recordings_in

    model = load_class_model(model_file)
    tacho = {key: given[key] for key in ("tacho", "pulses_per_revolution")}
    if not _holds_many(source):
        naming = model.estimate(read_recording(source, declared_source(given), **tacho))
        notice = f"\nNotice: {model.notice}." if model.notice else ""
        emit({**naming.as_dict(), "notice": model.notice}, as_json, naming_text(naming) + notice)
        verdicts = {naming.verdict}
    else:
        verdicts, lines = set(), []
        namings = []
        with recordings_in(
            source, declared_source(given), **tacho, leave_out=[model_file]
        ) as items:
            for name, naming in name_all(items, model):
                verdicts.add(naming.verdict)
                namings.append(naming)
                lines.append(f"{name}: {naming_text(naming)}")
                if as_json:
                    emit({"recording": name, **naming.as_dict()}, as_json, "")
        if not as_json:
            click.echo("\n".join([f"{source.name}: {namings_summary(namings)}", *lines]))
        if model.notice:
            click.echo(f"Notice: {model.notice}.", err=as_json)
    if verdicts == {"unusable"}:
        raise click.exceptions.Exit(EXIT_BAD_INPUT)


class _ReportTask(NamedTuple):
    """What both kinds of report are given."""

    source: Path
    model_file: Path
    model: Any
    baselines: Any
    plate: Any
    output: Path | None
    machine: str | None
    as_json: bool
    force: bool
    given: Mapping[str, Any]
    views: Sequence[Any]


_Verdict = tuple[str, int | None]
"""Verdict and grade."""


def _report_one(told: _ReportTask) -> list[_Verdict]:
    """Report on one recording."""
    from ...datasets.measured.recording import read_recording, with_views
    from ..workflow.report import judged

    recording = read_recording(
        told.source,
        declared_source(told.given),
        tacho=told.given["tacho"],
        pulses_per_revolution=told.given["pulses_per_revolution"],
    )
    heard = with_views(recording, told.source, told.given["record"], told.views)
    found = judged(
        heard,
        told.model,
        baselines=told.baselines,
        plate=told.plate,
        machine=told.machine,
        twin=_opinion(told, heard),
        files={"recording": told.source, "model": told.model_file},
    )
    table, text = found.table, found.text
    if told.output is not None:
        found.save(told.output, force=told.force, interactive=told.given["interactive"])
        table["html"] = str(told.output)
        text += f"\nPage        {told.output}"
    click.echo(json_text(table) if told.as_json else text)
    return [(table["estimate"]["verdict"], found.estimate.grade)]


def _opinion(told: _ReportTask, heard: Any) -> Any:
    """What the twin says of a recording, if one was named."""
    from ..twin.opinion import second_opinion

    if not told.given["twin"]:
        return None
    wear, seed = told.model.card.severity, told.given["seed"]
    with progress_bar("simulating") as progress:
        return second_opinion(told.given["twin"], heard, wear=wear, seed=seed, progress=progress)


def _report_many(told: _ReportTask) -> list[_Verdict]:
    """Report on a folder or data set; of JSON one line each, as soon as it is judged."""
    from ..pages.page import save_page
    from ..report.batch import HOURS, judge_all, recordings_in
    from ..report.text import batch_text

    given = told.given
    dates = given["dates"]
    if given["trend"] and dates is None:
        dates = "names" if told.source.is_dir() else HOURS
    healthy = told.baselines and Path(told.baselines.source)
    others = [path for path in (told.output, told.model_file, Path(dates or ""), healthy) if path]
    with (
        recordings_in(
            told.source,
            declared_source(given),
            tacho=given["tacho"],
            pulses_per_revolution=given["pulses_per_revolution"],
            leave_out=others,
            views=told.views,
        ) as items,
        progress_bar("judging") as progress,
    ):
        batch = judge_all(
            told.source,
            items,
            told.model,
            model_file=told.model_file,
            baselines=told.baselines,
            plate=told.plate,
            dates=dates,
            growth=given["growth"],
            seed=given["seed"],
            tell=(lambda line: click.echo(json_text(line))) if told.as_json else None,
            progress=progress,
        )
        if told.output is not None:
            from ..report.page import batch_html

            page = batch_html(
                batch,
                told.model,
                machine=told.machine,
                baselines=told.baselines,
                plate=told.plate,
                interactive=given["interactive"],
            )
            save_page(page, told.output, force=told.force)
    if not told.as_json:
        click.echo(batch_text(batch) + (f"\nPage        {told.output}" if told.output else ""))
    return [(row.verdict, row.grade) for row in batch.current]


def report_exit(verdicts: Sequence[_Verdict], fail_on: str | None) -> int:
    """Nothing judged is bad input, asked or not; else only what --fail-on asks for."""
    from ..learning.grades import ALARM_GRADE, WARNING_GRADE

    if all(verdict == "unusable" for verdict, _ in verdicts):
        return EXIT_BAD_INPUT
    if fail_on is None:
        return 0
    worst = max((grade for _, grade in verdicts if grade is not None), default=0)
    if worst >= ALARM_GRADE:
        return EXIT_ALARM
    if fail_on == "warning" and worst >= WARNING_GRADE:
        return EXIT_WARNING
    if any(verdict == "unusable" for verdict, _ in verdicts):
        return EXIT_BAD_INPUT
    return EXIT_UNFAMILIAR if any(verdict == "unfamiliar" for verdict, _ in verdicts) else 0


@command()
@click.argument("model_file", metavar="MODEL", type=MODEL)
@click.option("--recipe", metavar="RECIPE", help="Draws the machines; the model's own by default.")
@click.option(
    "-n",
    "--machines",
    type=click.IntRange(1, 300),
    default=12,
    show_default=True,
    help="Simulated for every row.",
)
@click.option(
    "--budget",
    type=click.FloatRange(0, min_open=True),
    help="Seconds after which no further row is begun; repeat the command to go on.",
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
    help="Rows whose name or shift contains TEXT, to look closer with more machines; repeatable.",
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
    """What MODEL takes for granted: its error where one thing differs from its recipe.

    The same simulated machines, which it was not trained on, are judged again with each value that
    the recipe holds fixed shifted, each drawn one beyond its range, and the signal disturbed. The
    worst is first: the largest error without a caution. With -o, finished rows are kept beside the
    page until all are done.
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
        raise click.UsageError(f"{model_file} names conditions, no wear; name a wear model")
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


@command()
@click.option(
    "--folder",
    type=PathType(path_type=Path, file_okay=False),
    default=Path("demo"),
    show_default=True,
    help="Where its files go: new, empty, or an earlier demo's, whose files are replaced.",
)
@seed_option
@jobs_option
@json_option
def demo(folder: Path, seed: int, jobs: int | None, as_json: bool) -> None:
    """The whole job, small: simulate, features, train, evaluate, report."""
    from ..evaluation.text import score_lines
    from .demo import run_demo

    with progress_bar("simulating and learning") as progress:
        result = run_demo(
            folder,
            seed=seed,
            jobs=worker_count(jobs),
            progress=progress,
            say=lambda text: click.echo(text, err=True),
        )
    text = "\n".join([*score_lines(result["held_out"], result["card"]), "", result["text"]])
    emit({key: result[key] for key in ("files", "held_out", "report", "seconds")}, as_json, text)
