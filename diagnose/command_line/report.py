"""The command `report`: verdict on one recording or many, and the exit code."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click

from ..options.help import command
from ..options.names import DATA, MODEL
from ..options.outputs import PAGE_SUFFIXES, check_outputs
from ..options.progress import progress_bar
from ..options.shared import (
    EXIT_ALARM,
    EXIT_BAD_INPUT,
    EXIT_UNFAMILIAR,
    EXIT_WARNING,
    PATH,
    emit,
    force_option,
    join_option,
    json_option,
    overrides_of,
    report_bare_units,
    seed_option,
)
from ..options.source import declared_source, source_options
from ..pages.plain_json import json_text

_FAIL_ON_HELP = "Exit 3 at a warning, 4 at an alarm, 5 when unfamiliar; alarm: only 4 and 5."


@command()
@click.argument("source", metavar="RECORDING|FOLDER", type=DATA)
@click.option("--model", "model_file", type=MODEL, required=True, help="Wear model (.wsm).")
@click.option("--baseline", "healthy", type=PATH, help="Healthy recordings of the machine (.h5).")
@join_option
@click.option("-o", "--output", type=PATH, help="HTML page to write.")
@click.option(
    "--interactive",
    is_flag=True,
    help="Zoom and cursors in the page: the curves of one recording, or the trends of many.",
)
@click.option("--machine", metavar="KIND", help="Kind of machine, for its ISO zone.")
@click.option(
    "--scene",
    metavar="SCENE|TOML",
    help="Nameplate of the machine: geometry, load, oil; default: that of the data set.",
)
@click.option(
    "--set",
    "pairs",
    multiple=True,
    metavar="PATH=VALUE",
    help="Replace a value of the nameplate, e.g. load.static='4 kN +- 5 %'.",
)
@click.option(
    "--twin",
    type=PATH,
    metavar="SCENE",
    help="Calibrated scene of this machine (wearstate calibrate): gives a second estimate.",
)
@click.option(
    "--also",
    type=PATH,
    metavar="MODEL",
    help="Second wear model, of other assumptions (bilge-pump-oiled): shown next to this one; "
    "where they disagree, the larger estimate counts.",
)
@click.option(
    "--trend", is_flag=True, help="For many recordings: wear over time and remaining life."
)
@click.option(
    "--dates",
    metavar="names|mtime|CSV|COLUMN",
    help="Times for --trend: from file names (names), from the files (mtime), from a table "
    "file,date or file,hours, or from a column of hours in the data set (operating_hours).",
)
@click.option(
    "--growth",
    type=click.Choice(["linear", "log"]),
    default="linear",
    show_default=True,
    help="Growth of the wear: linear for abrasion, log for damage that accelerates itself.",
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
    """Assess RECORDING: wear grade and wear with its interval, or why there is none.

    For a FOLDER, or a data set without --record: a table of all recordings, the most urgent first;
    with --json one object per line. Exit 2 if nothing could be judged; with --fail-on and many
    recordings, the code of the worst: alarm, warning, bad input, unfamiliar. If the recordings have
    times, only the latest of each machine counts.
    """
    from ...datasets.file.views import views_of
    from ..class_model.file import CLASS_MODEL
    from ..healthy_reference.healthy import Baselines
    from ..nameplate.nameplate import nameplate_of
    from ..report.verdict import known_machine
    from ..wear_model.bundle import kind_of
    from ..wear_model.file import load_model

    views = views_of(given["joined"])
    optional = [path for path in (healthy, given["also"]) if path]
    inputs = [source, model_file, *(view.path for view in views), *optional]
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
            "--also": given["also"],
            "--trend": given["trend"],
            "--dates": given["dates"],
        }
        wrong = [option for option, value in wear.items() if value]
        if wrong:
            raise click.UsageError(
                f"{model_file} is a model of named conditions, without wear: leave out "
                f"{', '.join(wrong)}, or name a wear model"
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
    if many and given["also"]:
        raise click.UsageError("--also is for one recording: name one, or choose a --record")
    if given["interactive"]:
        _check_interactive(output, many and not (given["trend"] or given["dates"]))
    if views and source.is_dir():
        raise click.UsageError("--join completes a recording or a data set: name one, not a folder")
    usual = model.card.trained_on.scene
    values = overrides_of(pairs)
    if scene is not None:
        report_bare_units(scene, values)
    plate = nameplate_of(source, scene, values, usual=usual)
    ways = (output, machine, as_json, force, given, views)
    task = _ReportTask(source, model_file, model, baselines, plate, *ways)
    verdicts = _report_many(task) if many else _report_one(task)
    raise click.exceptions.Exit(report_exit(verdicts, fail_on))


def _check_interactive(output: Path | None, untimed: bool) -> None:
    """Refuse curves without a page, for many recordings without trend, or without data."""
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
    """Whether the source is a folder, or a data set without a chosen record."""
    from ..report.batch import record_count

    origin = click.get_current_context().get_parameter_source("record")
    chosen = origin is not click.core.ParameterSource.DEFAULT
    return source.is_dir() or (not chosen and record_count(source) > 1)


def _report_class(source: Path, model_file: Path, given: Mapping[str, Any], as_json: bool) -> None:
    """Print the condition of recordings; as JSON each at once. Exit 2 if none can be judged."""
    from ...datasets.measured.recording import read_recording
    from ..class_model.file import load_class_model
    from ..class_model.text import naming_text, namings_summary
    from ..class_model.train import name_all
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
    """Inputs of both kinds of report."""

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


def _report_one(task: _ReportTask) -> list[_Verdict]:
    """Report on one recording."""
    from ...datasets.measured.recording import read_recording, with_views
    from ..workflow.report import judged

    recording = read_recording(
        task.source,
        declared_source(task.given),
        tacho=task.given["tacho"],
        pulses_per_revolution=task.given["pulses_per_revolution"],
    )
    heard = with_views(recording, task.source, task.given["record"], task.views)
    found = judged(
        heard,
        task.model,
        baselines=task.baselines,
        plate=task.plate,
        machine=task.machine,
        twin=_opinion(task, heard),
        also=task.given["also"],
        files={"recording": task.source, "model": task.model_file},
    )
    table, text = found.table, found.text
    if task.output is not None:
        found.save(task.output, force=task.force, interactive=task.given["interactive"])
        table["html"] = str(task.output)
        text += f"\nPage        {task.output}"
    click.echo(json_text(table) if task.as_json else text)
    other = table["other_model"]
    relied_on = other["grade"] if other and other["relied_on"] else found.estimate.grade
    return [(table["estimate"]["verdict"], relied_on)]


def _opinion(task: _ReportTask, heard: Any) -> Any:
    """Estimate of the twin for a recording, if one was named."""
    from ..twin.opinion import second_opinion

    if not task.given["twin"]:
        return None
    wear, seed = task.model.card.severity, task.given["seed"]
    with progress_bar("simulating") as progress:
        return second_opinion(task.given["twin"], heard, wear=wear, seed=seed, progress=progress)


def _report_many(task: _ReportTask) -> list[_Verdict]:
    """Report on a folder or data set; as JSON one line each, as soon as it is judged."""
    from ..pages.page import save_page
    from ..report.batch import HOURS, judge_all, recordings_in
    from ..report.text import batch_text

    given = task.given
    dates = given["dates"]
    if given["trend"] and dates is None:
        dates = "names" if task.source.is_dir() else HOURS
    healthy = task.baselines and Path(task.baselines.source)
    others = [path for path in (task.output, task.model_file, Path(dates or ""), healthy) if path]
    with (
        recordings_in(
            task.source,
            declared_source(given),
            tacho=given["tacho"],
            pulses_per_revolution=given["pulses_per_revolution"],
            leave_out=others,
            views=task.views,
        ) as items,
        progress_bar("judging") as progress,
    ):
        batch = judge_all(
            task.source,
            items,
            task.model,
            model_file=task.model_file,
            baselines=task.baselines,
            plate=task.plate,
            dates=dates,
            growth=given["growth"],
            seed=given["seed"],
            on_result=(lambda line: click.echo(json_text(line))) if task.as_json else None,
            progress=progress,
        )
        if task.output is not None:
            from ..report.page import batch_html

            page = batch_html(
                batch,
                task.model,
                machine=task.machine,
                baselines=task.baselines,
                plate=task.plate,
                interactive=given["interactive"],
            )
            save_page(page, task.output, force=task.force)
    if not task.as_json:
        click.echo(batch_text(batch) + (f"\nPage        {task.output}" if task.output else ""))
    return [(row.estimate.verdict, row.estimate.grade) for row in batch.current]


def report_exit(verdicts: Sequence[_Verdict], fail_on: str | None) -> int:
    """Exit code: bad input if nothing was judged; otherwise as requested by --fail-on."""
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
