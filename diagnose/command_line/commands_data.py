"""Commands about data: recipes, data sets, measured files, splits, audit, features."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import click

from .command_help import HelpfulGroup, command
from .command_names import DATA, FILE, RECIPE
from .command_options import (
    DATA_SUFFIXES,
    EXIT_ALARM,
    EXIT_FAILED,
    EXIT_WARNING,
    LARGEST_SEED,
    MOST_RECORDS,
    NUMBER,
    PAGE_SUFFIXES,
    PATH,
    PICTURE_SUFFIXES,
    TABLE_SUFFIXES,
    Share,
    as_options,
    check_outputs,
    declared_source,
    emit,
    force_option,
    jobs_option,
    join_option,
    json_option,
    progress_bar,
    refuse_unwritable,
    seed_option,
    source_options,
    told_of_channels,
    worker_count,
)

_CARD = (*PAGE_SUFFIXES, ".md")


@click.group(cls=HelpfulGroup)
def recipe() -> None:
    """What data sets are drawn from: list, show, check, preview, explain."""


@recipe.command("list")
@json_option
def recipe_list(as_json: bool) -> None:
    """Names and descriptions of the built-in recipes."""
    from ...datasets.recipe.text import read_recipe, recipe_names

    found = {name: read_recipe(name).table.get("description", "") for name in recipe_names()}
    width = max(map(len, found))
    emit({"recipes": found}, as_json, "\n".join(f"{n:{width}}  {d}" for n, d in found.items()))


@recipe.command("show")
@click.argument("name", metavar="RECIPE", type=RECIPE)
@click.option("--whole", is_flag=True, help="With all that it extends.")
def recipe_show(name: str, whole: bool) -> None:
    """TOML text of a recipe: copy it, change it, check it."""
    from ...datasets.recipe.text import read_recipe, recipe_text

    click.echo(read_recipe(name).text if whole else recipe_text(name), nl=False)


@recipe.command("check")
@click.argument("file", metavar="RECIPE", type=RECIPE)
@json_option
def recipe_check(file: str, as_json: bool) -> None:
    """Check a recipe against its scene; every fault, and warnings of what is hardly meant."""
    from ...datasets.recipe.foreign_draws import draw_doubts
    from ...datasets.recipe.recipe import STRATA, limit_faults, load_recipe, sample_records
    from ...datasets.recipe.text import RecipeError, read_recipe
    from ...sim.machine.simulate import check
    from ...sim.scene.plausibility import scene_doubts

    checked = load_recipe(file)
    for view in checked.table.views:
        check(load_recipe(file, view=view).scene)
    if faults := limit_faults(checked):
        raise RecipeError(checked.name, faults)
    doubts: dict[str, str] = {}  # each with the first record that has it
    for sample in sample_records(checked, STRATA):
        check(sample.scene)
        for doubt in scene_doubts(sample.scene):
            doubts.setdefault(doubt.check, f"record {sample.index}: {doubt.text}")
    warnings = draw_doubts(checked, read_recipe(file).inherited) + list(doubts.values())
    told = f", {len(warnings)} warning(s)" if warnings else ""
    lines = [f"{checked.name}: no fault{told}", *(f"warning: {text}" for text in warnings)]
    table = {"recipe": checked.name, "faults": [], "warnings": warnings}
    emit(table, as_json, "\n".join(lines))


@recipe.command("explain")
@click.argument("key", metavar="[KEY]", required=False, default="")
@json_option
def recipe_explain(key: str, as_json: bool) -> None:
    """What every key of a recipe means: unit, range, default; KEY as severity.low."""
    from ..inspect.keys import explained, found_recipe_keys, keys_table

    found = found_recipe_keys(key)
    emit(keys_table([found]), as_json, explained(found))


_records_option = click.option(
    "-n",
    "--records",
    type=click.IntRange(1, MOST_RECORDS),
    default=None,
    help="Records; the recipe's by default.",
)


@recipe.command("preview")
@click.argument("name", metavar="RECIPE", type=RECIPE)
@_records_option
@click.option("--plot", type=PATH, help="Picture of the draws to write (.png, .svg or .pdf).")
@seed_option
@jobs_option
@force_option
@json_option
def recipe_preview(
    name: str,
    records: int | None,
    plot: Path | None,
    seed: int,
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """What RECIPE (a built-in name or a TOML file) would make: draws, labels, time and size."""
    from ...datasets.recipe.recipe import load_recipe
    from ..inspect.recipe_preview import preview, preview_figure, preview_text

    check_outputs([name], [(plot, PICTURE_SUFFIXES)], force)
    found = preview(load_recipe(name), records, seed=seed, cores=worker_count(jobs))
    if plot is not None:
        from ..pages.picture import save_picture

        save_picture(preview_figure(found), plot, force=force)
    files = [str(plot)] if plot else []
    words = "\n".join([preview_text(found.table), *files])
    emit({**found.table, "files": files}, as_json, words)


@command()
@click.argument("recipe", type=RECIPE)
@_records_option
@click.option("-o", "--output", type=PATH, required=True, help="Data set to write (.h5).")
@click.option(
    "--view", default="", metavar="NAME", help="One of the recipe's further tests of each state."
)
@click.option("--truth", is_flag=True, help="Also store forces and orbit.")
@click.option(
    "--twin",
    type=PATH,
    help="Calibrated scene (wearstate calibrate): every other machine is drawn as this one.",
)
@click.option(
    "--fidelity",
    type=click.Choice(["auto", "given"]),
    default=None,
    help="Least rungs that the accuracy needs, or as written; what the recipe says by default.",
)
@seed_option
@jobs_option
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Simulate on the workers of a Dask cluster instead; the same bytes.",
)
@force_option
@json_option
def generate(
    recipe: str,
    records: int | None,
    output: Path,
    view: str,
    truth: bool,
    twin: Path | None,
    fidelity: Literal["auto", "given"] | None,
    seed: int,
    jobs: int | None,
    scheduler: str | None,
    force: bool,
    as_json: bool,
) -> None:
    """Simulate a labelled data set from RECIPE (a built-in name or a TOML file).

    An interrupted run goes on where it stopped when the same command is repeated.
    """
    from dataclasses import asdict

    from ...datasets.generation.generate import generate as run
    from ...datasets.recipe.recipe import load_recipe

    if scheduler is not None and jobs is not None:
        raise click.UsageError("--jobs is for this machine, not for the workers of --scheduler")
    check_outputs([recipe], [(output, DATA_SUFFIXES)], force)
    with progress_bar("simulating") as progress:
        summary = run(
            recipe if twin is None else load_recipe(recipe, view=view, twin=twin),
            records,
            output,
            view=view,
            seed=seed,
            jobs=worker_count(jobs),
            scheduler=scheduler,
            force=force,
            truth=truth,
            fidelity=fidelity,
            progress=progress,
            say=lambda text: click.echo(text, err=True),
        )
    value = {**asdict(summary), "path": str(summary.path)}
    emit(value, as_json, _generated_text(summary))


def _generated_text(summary: Any) -> str:
    grades = ", ".join(f"{count} of grade {grade}" for grade, count in summary.grades.items())
    lines = [
        f"{summary.path}: {summary.n_records} simulated records of {summary.n_groups} machine "
        f"draws ({grades})"
    ]
    if summary.fidelity is not None:
        lines.append(f"  fidelity: {summary.fidelity.text}")
    if summary.n_resumed:
        lines.append(f"  {summary.n_resumed} of them from an earlier, interrupted run")
    lines += [f"  {count} failed: {status}" for status, count in summary.failures.items()]
    lines += [f"    {text}" for text in summary.first_failures]
    if summary.n_clipped:
        lines.append(f"  {summary.n_clipped} hold saturated samples, as a real sensor would")
    return "\n".join(lines)


class _Segment(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.3 on
    """A time with or without its unit, or ``whole``, which is None."""

    name = "segment"

    def convert(self, value: Any, param: Any, ctx: Any) -> float | None:
        from ...sim.scene.parts import to_si

        text = str(value).strip()
        if text == "whole":
            return None
        try:
            return to_si(f"{text} s" if NUMBER.fullmatch(text) else text, "time")
        except ValueError as error:
            self.fail(f"{value!r} {error}; or write whole", param, ctx)


@command("import")
@click.argument("files", metavar="FILES…", nargs=-1, required=True, type=PATH)
@click.option("-o", "--output", type=PATH, help="Data set to write (.h5).")
@click.option("--list", "only_list", is_flag=True, help="Show what is in FILES; write nothing.")
@source_options
@click.option("--labels", type=PATH, help="CSV with a column 'file' and one for every label.")
@click.option(
    "--label", "pairs", multiple=True, metavar="NAME=VALUE", help="The same label for all files."
)
@click.option("--speed", help="Shaft speed of all files, like '1500 rpm'.")
@click.option(
    "--severity", multiple=True, metavar="LABEL", help="Label [m] that says how worn it is."
)
@click.option(
    "--limits", metavar="SCENE|LENGTHS", help="Grades: of a scene, or '0.1 mm, 0.2 mm, 0.3 mm'."
)
@click.option(
    "--group-by",
    type=click.Choice(["file", "folder", "column"]),
    help="What is one machine: column 'group' of the labels if it is there, else the file.",
)
@click.option(
    "--segment",
    type=_Segment(),
    default="whole",
    metavar="SECONDS|whole",
    help="Cut the files into records of this length.",
)
@click.option(
    "--overlap", type=Share(0, 0.99), default=0.0, help="Part of a record the next one repeats."
)
@click.option("--place", multiple=True, metavar="CHANNEL=TEXT", help="Where a channel is.")
@click.option(
    "--direction", multiple=True, metavar="CHANNEL=TEXT", help="Which way it points or pushes."
)
@jobs_option
@force_option
@json_option
def import_files(
    files: Sequence[Path],
    output: Path | None,
    only_list: bool,
    limits: str | None,
    jobs: int | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Bring measured FILES into one data set: WAV, MATLAB, CSV, HDF5, NPY, UFF58, TDMS, binary.

    Rate and units are declared, by the files or here, or refused: they are never guessed.
    """
    from ...datasets.measured.data_set import import_recordings
    from ...datasets.measured.labels import read_limits
    from ...datasets.measured.recording import list_contents
    from ..inspect.import_text import contents_text, empty_text, imported_table, imported_text

    if only_list:
        found = list_contents(files, declared_source(given))
        emit({"files": found}, as_json, contents_text(found))
        return
    if output is None:
        raise click.UsageError("-o/--output must name the data set to write; or ask for --list")
    check_outputs(
        [*files, *filter(None, [given["labels"]])], [(output, DATA_SUFFIXES)], given["force"]
    )
    labels = _labels(given)
    with progress_bar("importing") as progress:
        summary = import_recordings(
            files,
            output,
            options=declared_source(given),
            labels=labels,
            limits=read_limits(limits, labels.severities) if limits else None,
            places=told_of_channels(given["place"], "--place"),
            directions=told_of_channels(given["direction"], "--direction"),
            jobs=worker_count(jobs),
            progress=progress,
            **{name: given[name] for name in _IMPORT_OPTIONS},
        )
    if left_out := empty_text(summary):
        click.echo(f"left out, nothing but NaN: {left_out}", err=True)
    emit(imported_table(summary), as_json, imported_text(summary))


@command()
@click.argument("files", metavar="FILES…", nargs=-1, required=True, type=DATA)
@click.option("-o", "--output", type=PATH, required=True, help="Data set to write (.h5).")
@click.option(
    "--duplicates",
    type=click.Choice(["refuse", "drop"]),
    default="refuse",
    show_default=True,
    help="Records whose id and signal an earlier data set has.",
)
@force_option
@json_option
def merge(
    files: Sequence[Path],
    output: Path,
    duplicates: Literal["refuse", "drop"],
    force: bool,
    as_json: bool,
) -> None:
    """Write the records of several data sets with the same channels and rate as one.

    Machines of different data sets stay apart; the column `source` tells where a record is from.
    """
    from dataclasses import asdict

    from ...datasets.convert.merge import merge_sets, merged_text

    check_outputs(files, [(output, DATA_SUFFIXES)], force)
    with progress_bar("merging") as progress:
        made = merge_sets(files, output, duplicates=duplicates, force=force, progress=progress)
    emit({**asdict(made), "path": str(made.path)}, as_json, merged_text(made))


_IMPORT_OPTIONS = (
    *("tacho", "pulses_per_revolution", "group_by"),
    *("segment", "overlap", "force"),
)


def _labels(given: Mapping[str, Any]) -> Any:
    """Labels of a table and of words."""
    from ...datasets.measured.labels import read_labels

    constants: dict[str, str] = {}
    speed = [f"speed_hz={given['speed']}"] if given["speed"] else []
    for pair in (*given["pairs"], *speed):
        name, sign, value = (part.strip() for part in pair.partition("="))
        if not sign or not name or name in constants:
            raise click.BadParameter(
                f"'{pair}' must read NAME=VALUE, once for a name", param_hint="--label"
            )
        constants[name] = value
    return read_labels(given["labels"], constants, given["severity"])


class _Numbers(click.ParamType):  # type: ignore[type-arg]
    """Numbers parted by commas."""

    name = "numbers"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return tuple(float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} must be numbers parted by commas", param, ctx)


_speed_option = click.option(
    "--speed-hz",
    type=float,
    help="Shaft speed [Hz] where there is no tacho; by default the one stored in the file.",
)


class _Bearing(_Numbers):
    """Rollers, two lengths and an angle, each with or without its unit."""

    name = "bearing"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        from ...sim.scene.parts import to_si

        if not isinstance(value, str):
            return value
        parts = [part.strip() for part in value.split(",")]
        with_unit = [not NUMBER.fullmatch(part) for part in parts[1:3]]
        if any(with_unit) and not all(with_unit):
            self.fail(f"{value!r} must give both diameters with their unit, or neither", param, ctx)
        try:
            parts[1:3] = [
                str(to_si(part, "length")) if unit else part
                for part, unit in zip(parts[1:3], with_unit, strict=True)
            ]
        except ValueError as error:
            self.fail(f"{value!r} {error}", param, ctx)
        if len(parts) > 3:
            parts[3] = parts[3].removesuffix("deg").removesuffix("°")
        return super().convert(",".join(parts), param, ctx)


_bearing_option = click.option(
    "--bearing",
    type=_Bearing(),
    metavar="N,d,D[,DEG]",
    help="Rollers, their diameter, pitch diameter, contact angle: for its fault lines.",
)

_exponential_option = click.option(
    "--exponential",
    type=Share(1e-6, 1.0),
    default=1.0,
    help="Impact test: window sunk to this at the end of a block, 1: none; damping is corrected.",
)

_KINDS = (  # as wearstate.diagnose.pictures.kinds, which is too heavy to import for --help
    *("auto", "waveform", "spectrum", "waterfall", "orders"),
    *("angle", "envelope", "frf", "orbit"),
)

_PLOT_OPTIONS = ("draw", "force_channel", "speed_hz", "bearing")


@command()
@click.argument("file", type=FILE, required=False)
@click.option("--fft", "of_fft", is_flag=True, help="Who computes Fourier transforms, timed here.")
@click.option(
    "--verify", "check", is_flag=True, help="Check every record of a data set; exit 1 on a fault."
)
@click.option("--card", type=PATH, help="Page about a data set to write (.html or .md).")
@click.option("--licence", default="not stated", show_default=True, help="Of the data, for --card.")
@click.option("--plot", type=PATH, help="Picture of a recording to write (.png, .svg or .pdf).")
@click.option(
    "--interactive", is_flag=True, help="Write --plot as a page (.html) to zoom and measure in."
)
@click.option("--kind", type=click.Choice(_KINDS), help="What to plot; by default all it supports.")
@click.option("--draw", multiple=True, metavar="NAME", help="Channel to plot; all by default.")
@click.option("--force-channel", metavar="NAME", help="Force of a transfer function to plot.")
@_speed_option
@_bearing_option
@_exponential_option
@source_options
@force_option
@json_option
def info(
    file: Path | None,
    of_fft: bool,
    check: bool,
    card: Path | None,
    licence: str,
    plot: Path | None,
    interactive: bool,
    kind: str | None,
    tacho: str | None,
    pulses_per_revolution: int,
    force: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """What a data set, recording or model is, checked; and pictures of a recording."""
    from ..inspect.info import (
        describe,
        describe_fft,
        description_text,
        fft_text,
        picture_text,
        plot_file,
    )

    wanted = {name: given.pop(name) for name in _PLOT_OPTIONS}
    exponential = given.pop("exponential")
    if of_fft == (file is not None):
        raise click.UsageError("give either a FILE or --fft")
    if file is not None and (check or card is not None):
        _about_set(file, check, card, licence, force, as_json)
        return
    if plot is None and (kind or interactive or any(wanted.values())):
        raise click.UsageError("what to plot is given, but no --plot to write it to")
    if file is None:
        facts = describe_fft()
        emit(facts, as_json, fft_text(facts))
        return
    check_outputs([file], [(plot, PAGE_SUFFIXES if interactive else PICTURE_SUFFIXES)], force)
    read: dict[str, Any] = {"tacho": tacho, "pulses_per_revolution": pulses_per_revolution}
    described = describe(file, declared_source(given), **read)
    text = description_text(described)
    if plot is not None:
        described["plot"] = plot_file(
            file,
            plot,
            declared_source(given),
            kind=kind or _KINDS[0],
            exponential=exponential,
            interactive=interactive,
            force=force,
            **read,
            **wanted,
        )
        text += f"\n{picture_text(described['plot'])}"
    emit(described, as_json, text)


def _about_set(
    file: Path, check: bool, card: Path | None, licence: str, force: bool, as_json: bool
) -> None:
    """Check a data set, write its card, or both; a card of an unsound one is not written."""
    from ...datasets.audit.integrity import check_set, checked_table, checked_text

    check_outputs([file], [(card, _CARD)], force)
    found: dict[str, Any] = {}
    words = []
    if check:
        with progress_bar("checking") as progress:
            found = checked_table(check_set(file, progress=progress))
        words.append(checked_text(found))
    if card is not None and found.get("sound", True):
        from ..inspect.card import write_card

        write_card(file, card, licence=licence, force=force)
        found["card"] = str(card)
        words.append(str(card))
    emit(found, as_json, "\n".join(words))
    raise click.exceptions.Exit(0 if found.get("sound", True) else EXIT_FAILED)


@command()
@click.argument("data", type=DATA)
@click.option("-o", "--output", type=PATH, required=True, help="File or folder to write.")
@click.option(
    "--as",
    "kind",
    type=click.Choice(["h5", "parquet", "npz", "wav", "csv"]),
    help="By the suffix of the output by default; wav and csv are folders.",
)
@click.option("--signals", is_flag=True, help="Parquet: signals too, as columns of lists.")
@click.option("--compress", is_flag=True, help=".h5 and .npz: smaller, with the same values.")
@force_option
@json_option
def export(
    data: Path,
    output: Path,
    kind: str | None,
    signals: bool,
    compress: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Write the data set DATA as Parquet, NumPy or HDF5 file, or as folder of WAV or CSV files."""
    from dataclasses import asdict

    from ...datasets.convert.export import export_set, exported_text

    refuse_unwritable(output)
    with progress_bar("exporting") as progress:
        made = export_set(
            data,
            output,
            kind=kind,
            signals=signals,
            compress=compress,
            force=force,
            progress=progress,
        )
    emit({**asdict(made), "path": str(made.path)}, as_json, exported_text(made))


_SPLITS = (  # as wearstate.datasets.split.stored, which is too heavy to import for --help
    *("machine", "speed", "load", "severity", "geometry"),
    *("time-same-machines", "time-other-machines", "region"),
)


@command()
@click.argument("data", type=DATA)
@click.option("--add", "kinds", multiple=True, type=click.Choice(_SPLITS), help="Split to store.")
@click.option("--defaults", is_flag=True, help="Store every split that the records allow.")
@click.option("--name", help="To store one split under; its kind by default.")
@click.option(
    "--bound",
    "bounds",
    multiple=True,
    metavar="COLUMN=LOW:HIGH",
    help="Of a region, in SI; one end may be left out. Records within all bounds are tested.",
)
@click.option(
    "--share",
    type=Share(0.01, 0.99),
    help="Of the machines that is tested; of time-…: of a life that is trained on.",
)
@click.option("--seed", type=click.IntRange(0, LARGEST_SEED), help="Of the choice of machines.")
@force_option
@json_option
def splits(
    data: Path,
    kinds: Sequence[str],
    defaults: bool,
    name: str | None,
    bounds: Sequence[str],
    share: float | None,
    seed: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Splits stored in the data set DATA, and further ones; signal and manifest stay as they are.

    With --force, a split of the same name is replaced.
    """
    from ...datasets.file.record import DataSet
    from ...datasets.split.stored import default_splits, drawn_of, make_split, store_splits
    from ..inspect.audit_text import splits_table, splits_text

    if name and len(kinds) != 1:
        raise click.UsageError("--name is for one split: give --add once")
    if not kinds and (bounds or share is not None or seed is not None):
        raise click.UsageError("--bound, --share and --seed need --add")
    with DataSet(data) as opened:
        drawn = drawn_of(opened) if kinds or defaults else None
    if drawn is not None:
        ranges = _bounds(bounds)
        made = list(default_splits(drawn).values()) if defaults else []
        made += [
            make_split(drawn, kind, name=name, bounds=ranges, share=share, seed=seed)
            for kind in kinds
        ]
        store_splits(data, made, force=force)
    with DataSet(data) as opened:
        value = splits_table(opened)
    emit(value, as_json, splits_text(value))


def _bounds(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """``column=low:high`` pairs; an end that is left out is infinite."""
    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        column, _, ends = text.partition("=")
        low, sign, high = (part.strip() for part in ends.partition(":"))
        good = all(not end or NUMBER.fullmatch(end) for end in (low, high))
        if not (column and sign and good and (low or high)) or column in found:
            raise click.BadParameter(
                f"'{text}' must read COLUMN=LOW:HIGH, once for a column", param_hint="--bound"
            )
        found[column] = (float(low or -math.inf), float(high or math.inf))
    return found


@command()
@click.argument("paths", metavar="FILES…", nargs=-1, type=PATH)
@click.option("--label", default="", metavar="COLUMN|FILE", help="What is to be told apart.")
@click.option("--group", default="", metavar="COLUMN", help="Machine of each row.")
@click.option(
    "--split", default="", metavar="NAME", help="Stored split, or column with train and test."
)
@click.option(
    "--nuisance",
    multiple=True,
    metavar="COLUMN",
    help="Condition that must not follow the label.",
)
@click.option("--train", multiple=True, type=PATH, help="File that trains, against --test.")
@click.option("--test", multiple=True, type=PATH, help="File that tests, against --train.")
@click.option(
    "--fail-on",
    type=click.Choice(["warning", "alarm"]),
    help="Exit 3 at a warning, 4 at an alarm; alarm: only 4.",
)
@jobs_option
@json_option
def audit(
    paths: Sequence[Path],
    label: str,
    group: str,
    split: str,
    nuisance: Sequence[str],
    train: Sequence[Path],
    test: Sequence[Path],
    fail_on: str | None,
    jobs: int | None,
    as_json: bool,
) -> None:
    """Leaks, copies and unfit splits in data sets (.h5) and tables (.csv, .parquet).

    Columns are named, or counted from 1. Data sets and tables of `wearstate features` know their
    label and machines.
    """
    from ...datasets.audit.audit import audit as run
    from ...datasets.audit.table import Roles
    from ..inspect.audit_text import audit_table, audit_text

    if bool(train) != bool(test):
        raise click.UsageError("--train and --test go together: give both")
    if not paths and not train:
        raise click.UsageError("give FILES, or --train and --test")
    roles = Roles(label=label, group=group, split=split, nuisance=tuple(nuisance))
    with progress_bar("reading records") as progress:
        found = run(
            paths, roles, train=train, test=test, jobs=worker_count(jobs), progress=progress
        )
    emit(audit_table(found), as_json, audit_text(found))
    code = {"warning": EXIT_WARNING, "alarm": EXIT_ALARM}.get(found.verdict, 0) if fail_on else 0
    raise click.exceptions.Exit(0 if fail_on == "alarm" and code == EXIT_WARNING else code)


_FEATURE_SETS = (
    "standard",
    "core",
    "complete",
)  # as wearstate.features.catalogue.catalogue.SetName


@command()
@click.argument("data", type=DATA, required=False)
@click.option("-o", "--output", type=PATH, help="Table (.parquet, .csv, .h5).")
@click.option("--list", "listing", is_flag=True, help="What there is: unit, needs, reference.")
@click.option(
    "--set",
    "feature_set",
    type=click.Choice(_FEATURE_SETS),
    help="What models are trained on (default); all but the dearest; everything.",
)
@click.option("--only", multiple=True, metavar="NAMES", help="Only these, parted by commas.")
@click.option(
    "--rank", is_flag=True, help="Which features tell the wear; -o is a page or a table (.csv)."
)
@click.option(
    "--target",
    metavar="COLUMN",
    help="Of --rank: severity or label to be told; the first severity by default.",
)
@join_option
@click.option("--machine", metavar="KIND", help="Kind of machine, for its ISO zone.")
@_speed_option
@_bearing_option
@_exponential_option
@click.option(
    "--band", "bands", type=_Numbers(), multiple=True, metavar="LOW,HIGH", help="Band level [Hz]."
)
@click.option(
    "--envelope-band", type=_Numbers(), metavar="LOW,HIGH", help="Band of the envelope [Hz]."
)
@click.option(
    "--speed-band",
    "speed_band_hz",
    type=_Numbers(),
    metavar="LOW,HIGH",
    help="Where the speed is looked for without a tacho [Hz].",
)
@jobs_option
@force_option
@json_option
def features(
    data: Path | None,
    output: Path | None,
    listing: bool,
    feature_set: str | None,
    only: Sequence[str],
    rank: bool,
    target: str | None,
    joined: Sequence[str],
    jobs: int | None,
    force: bool,
    as_json: bool,
    **about: Any,
) -> None:
    """Feature table of the data set DATA (.parquet, .csv or .h5), manifest beside it.

    With --rank: which features separate the grades or follow the severity, alone and within each
    machine, and what they cost.
    """
    if target and not rank:
        raise click.UsageError("--target is of --rank")
    if listing:
        if data is not None or output is not None or rank:
            raise click.UsageError("--list stands alone: it reads and writes no file")
        _emit_catalogue(feature_set or _FEATURE_SETS[-1], as_json)
        return
    if data is None or (output is None and not rank):
        raise click.UsageError("give DATA and --output, DATA and --rank, or --list")
    if only and feature_set:
        raise click.UsageError("give either --set or --only: names are looked for in every set")
    from ...datasets.file.views import views_of
    from ..feature_rows.feature_table import (
        absent_in,
        choice_of,
        excitation_notes,
        feature_table,
        save_table,
    )

    views = views_of(joined)
    sources = [data, *(view.path for view in views)]
    check_outputs(sources, [(output, _RANKED if rank else TABLE_SUFFIXES)], force)
    names = [name.strip() for part in only for name in part.split(",")]
    wanted: Any = feature_set or _FEATURE_SETS[0]
    choice = replace(choice_of(wanted, names, **about), views=views)
    command = click.get_current_context().command
    absent = {name: as_options(why, command) for name, why in absent_in(data, choice).items()}
    if feature_set and absent:
        click.echo(f"absent, as --json explains: {', '.join(absent)}", err=True)
    elif slow := [name for name, why in absent.items() if why.startswith("fs = ")]:
        click.echo(f"absent: {', '.join(slow)}: {absent[slow[0]]}", err=True)
    with progress_bar("features") as progress:
        table = feature_table(data, choice=choice, jobs=worker_count(jobs), progress=progress)
    if rank:
        _emit_rank(data, table, choice, target, output, force, as_json)
        return
    assert output is not None  # asked for above
    save_table(table, output, force=force)
    for text in table.lacking_words:
        click.echo(f"{text}: its values are empty there", err=True)
    size = {"path": str(output), "records": len(table.values), "features": len(table.names)}
    text = f"{output}: {size['records']} records, {size['features']} features"
    tests = sources if any("frf" in name for name in table.names) else []
    told = dict(sum((Counter(excitation_notes(one, choice.settings)) for one in tests), Counter()))
    for note, count in told.items():
        click.echo(f"{count} records: {note}", err=True)
    emit({**size, "absent": absent, "tests": told}, as_json, text)


_RANKED = (*PAGE_SUFFIXES, ".csv")


def _emit_rank(
    data: Path,
    table: Any,
    choice: Any,
    target: str | None,
    output: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """What the features of a set tell, printed and, if so wished, written."""
    from ..inspect.rank_text import rank_set, rank_table, rank_text, save_rank

    found = rank_set(data, table, choice, target=target)
    if output is not None:
        save_rank(found, output, force=force)
    files = [str(output)] if output is not None else []
    emit({**rank_table(found), "files": files}, as_json, "\n".join([rank_text(found), *files]))


def _emit_catalogue(feature_set: Any, as_json: bool) -> None:
    """The catalogue, one line a feature."""
    from ...features.catalogue.row import catalogue

    rows = catalogue(feature_set)
    columns = ("name", "unit", "set", "needs", "reference")
    widths = [max(len(row[c]) for row in rows) for c in columns[:-1]]
    lines = [columns, *(tuple(row[c] for c in columns) for row in rows)]
    text = "\n".join(
        "  ".join([*(cell.ljust(w) for cell, w in zip(line, widths, strict=False)), line[-1]])
        for line in lines
    )
    emit({"features": list(rows)}, as_json, text)
