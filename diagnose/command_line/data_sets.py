"""Commands about data sets: generate, merge, export, splits, audit."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import click

from ..options.help import command
from ..options.names import DATA, RECIPE
from ..options.outputs import DATA_SUFFIXES, check_outputs, refuse_unwritable
from ..options.progress import progress_bar
from ..options.shared import (
    EXIT_ALARM,
    EXIT_WARNING,
    LARGEST_SEED,
    NUMBER,
    PATH,
    Share,
    emit,
    force_option,
    jobs_option,
    json_option,
    records_option,
    seed_option,
)


@command()
@click.argument("recipe", type=RECIPE)
@records_option
@click.option("-o", "--output", type=PATH, required=True, help="Data set to write (.h5).")
@click.option(
    "--view",
    default="",
    metavar="NAME",
    help="Simulate this further test of the recipe instead of its main one.",
)
@click.option("--truth", is_flag=True, help="Also store forces and orbit.")
@click.option(
    "--twin",
    type=PATH,
    help="Calibrated scene (wearstate calibrate), from which half of the machines are drawn.",
)
@click.option(
    "--fidelity",
    type=click.Choice(["auto", "given"]),
    default=None,
    help="auto: cheapest rungs that meet the accuracy; given: as in the scene; default: as in the "
    "recipe.",
)
@seed_option
@jobs_option
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Simulate on the workers of a Dask cluster; the records do not depend on it.",
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
    fidelity: Literal["given", "auto"] | None,
    seed: int,
    jobs: int,
    scheduler: str | None,
    force: bool,
    as_json: bool,
) -> None:
    """Simulate a labelled data set from RECIPE (a built-in name or a TOML file).

    Repeat the same command to continue an interrupted run.
    """
    from dataclasses import asdict

    from ...datasets.generation.generate import generate as run
    from ...datasets.recipe.load import load_recipe

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
            jobs=jobs,
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


@command()
@click.argument("files", metavar="FILES…", nargs=-1, required=True, type=DATA)
@click.option("-o", "--output", type=PATH, required=True, help="Data set to write (.h5).")
@click.option(
    "--duplicates",
    type=click.Choice(["refuse", "drop"]),
    default="refuse",
    show_default=True,
    help="Treatment of records whose id and signal are already in an earlier data set.",
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
    """Merge data sets with the same channels and sample rate into one.

    Machines of different data sets stay apart; the column `source` names the data set of a record.
    """
    from dataclasses import asdict

    from ...datasets.convert.merge import merge_sets, merged_text

    check_outputs(files, [(output, DATA_SUFFIXES)], force)
    with progress_bar("merging") as progress:
        made = merge_sets(files, output, duplicates=duplicates, force=force, progress=progress)
    emit({**asdict(made), "path": str(made.path)}, as_json, merged_text(made))


@command()
@click.argument("data", type=DATA)
@click.option("-o", "--output", type=PATH, required=True, help="File or folder to write.")
@click.option(
    "--as",
    "kind",
    type=click.Choice(["h5", "parquet", "npz", "wav", "csv"]),
    help="Format; default: by the suffix of the output. wav and csv write a folder.",
)
@click.option("--signals", is_flag=True, help="Parquet: include the signals, as columns of lists.")
@click.option("--compress", is_flag=True, help=".h5 and .npz: smaller file with the same values.")
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
    """Export the data set DATA to Parquet, NumPy or HDF5, or to a folder of WAV or CSV files."""
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
@click.option("--name", help="Name of a single split to store; default: its kind.")
@click.option(
    "--bound",
    "bounds",
    multiple=True,
    metavar="COLUMN=LOW:HIGH",
    help="Bound of a region, in SI units; one end may be left out. Records within all bounds are "
    "the test side.",
)
@click.option(
    "--share",
    type=Share(0.01, 0.99),
    help="Fraction of machines held out for testing; time-…: fraction of each life to train on.",
)
@click.option(
    "--seed", type=click.IntRange(0, LARGEST_SEED), help="Seed of the choice of machines."
)
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
    """Show the splits stored in DATA, or add some; signals and manifest are not changed.

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
    """``column=low:high`` pairs; a missing end is infinite."""
    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        column, _, ends = text.partition("=")
        low, sign, high = (part.strip() for part in ends.partition(":"))
        good = all(not end or NUMBER.fullmatch(end) for end in (low, high))
        if not (column and sign and good and (low or high)) or column in found:
            raise click.BadParameter(
                f"'{text}' must read COLUMN=LOW:HIGH, once per column", param_hint="--bound"
            )
        found[column] = (float(low or -math.inf), float(high or math.inf))
    return found


@command()
@click.argument("paths", metavar="FILES…", nargs=-1, type=PATH)
@click.option(
    "--label",
    default="",
    metavar="COLUMN|FILE",
    help="Label to predict: a column, or a file of labels.",
)
@click.option(
    "--group", default="", metavar="COLUMN", help="Column that names the machine of each row."
)
@click.option(
    "--split", default="", metavar="NAME", help="Stored split, or column that holds train and test."
)
@click.option(
    "--nuisance",
    multiple=True,
    metavar="COLUMN",
    help="Column of a condition that must not be related to the label.",
)
@click.option(
    "--train", multiple=True, type=PATH, help="File of training rows, compared with --test."
)
@click.option("--test", multiple=True, type=PATH, help="File of test rows, compared with --train.")
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
    jobs: int,
    as_json: bool,
) -> None:
    """Find leaks, copies and unfit splits in data sets (.h5) and tables (.csv, .parquet).

    Columns are given by name, or by number from 1. Label and machines of data sets, and of tables
    of `wearstate features`, are known.
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
        found = run(paths, roles, train=train, test=test, jobs=jobs, progress=progress)
    emit(audit_table(found), as_json, audit_text(found))
    code = {"warning": EXIT_WARNING, "alarm": EXIT_ALARM}.get(found.verdict, 0) if fail_on else 0
    raise click.exceptions.Exit(0 if fail_on == "alarm" and code == EXIT_WARNING else code)
