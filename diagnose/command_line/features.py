"""The command `features`: feature tables, and the features that show the wear."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..options.help import command
from ..options.names import DATA
from ..options.outputs import (
    PAGE_SUFFIXES,
    TABLE_SUFFIXES,
    check_outputs,
)
from ..options.progress import progress_bar
from ..options.shared import (
    PATH,
    as_options,
    emit,
    force_option,
    jobs_option,
    join_option,
    json_option,
)
from ..options.source import (
    Numbers,
    bearing_option,
    exponential_option,
    speed_option,
)

_FEATURE_SETS = (
    "standard",
    "core",
    "complete",
)  # as wearstate.features.catalogue.catalogue.SetName


@command()
@click.argument("data", type=DATA, required=False)
@click.option("-o", "--output", type=PATH, help="Table to write (.parquet, .csv, .h5).")
@click.option(
    "--list", "listing", is_flag=True, help="List all features: unit, requirements, reference."
)
@click.option(
    "--set",
    "feature_set",
    type=click.Choice(_FEATURE_SETS),
    help="standard: the default for training; core: without the most expensive; complete: all.",
)
@click.option(
    "--only", multiple=True, metavar="NAMES", help="Only these features, separated by commas."
)
@click.option(
    "--rank",
    is_flag=True,
    help="Rank the features by how well they show the wear; -o is then a page or a table (.csv).",
)
@click.option(
    "--target",
    metavar="COLUMN",
    help="With --rank: severity or label to predict; default: the first severity.",
)
@join_option
@click.option("--machine", metavar="KIND", help="Kind of machine, for its ISO zone.")
@speed_option
@bearing_option
@exponential_option
@click.option(
    "--band",
    "bands",
    type=Numbers(),
    multiple=True,
    metavar="LOW,HIGH",
    help="Also compute the level of this band [Hz]; repeatable.",
)
@click.option(
    "--envelope-band", type=Numbers(), metavar="LOW,HIGH", help="Band of the envelope [Hz]."
)
@click.option(
    "--speed-band",
    "speed_band_hz",
    type=Numbers(),
    metavar="LOW,HIGH",
    help="Range in which to look for the shaft speed without a tacho [Hz].",
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
    jobs: int,
    force: bool,
    as_json: bool,
    **about: Any,
) -> None:
    """Compute the feature table of the data set DATA (.parquet, .csv or .h5), with a manifest.

    With --rank: which features separate the grades or follow the severity, alone and within each
    machine, and what they cost.
    """
    if target and not rank:
        raise click.UsageError("--target needs --rank")
    if listing:
        if data is not None or output is not None or rank:
            raise click.UsageError("--list takes no other option: it reads and writes no file")
        _emit_catalogue(feature_set or _FEATURE_SETS[-1], as_json)
        return
    if data is None or (output is None and not rank):
        raise click.UsageError("give DATA and --output, DATA and --rank, or --list")
    if only and feature_set:
        raise click.UsageError("give either --set or --only: names are searched in all sets")
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
        click.echo(f"absent (reasons: --json): {', '.join(absent)}", err=True)
    elif slow := [name for name, why in absent.items() if why.startswith("fs = ")]:
        click.echo(f"absent: {', '.join(slow)}: {absent[slow[0]]}", err=True)
    with progress_bar("features") as progress:
        table = feature_table(data, choice=choice, jobs=jobs, progress=progress)
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
    notes = dict(sum((Counter(excitation_notes(one, choice.settings)) for one in tests), Counter()))
    for note, count in notes.items():
        click.echo(f"{count} records: {note}", err=True)
    emit({**size, "absent": absent, "tests": notes}, as_json, text)


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
    """Print the ranking of a set's features and write it if requested."""
    from ..inspect.rank_text import rank_set, rank_table, rank_text, save_rank

    found = rank_set(data, table, choice, target=target)
    if output is not None:
        save_rank(found, output, force=force)
    files = [str(output)] if output is not None else []
    emit({**rank_table(found), "files": files}, as_json, "\n".join([rank_text(found), *files]))


def _emit_catalogue(feature_set: Any, as_json: bool) -> None:
    """Print the catalogue, one line per feature."""
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
