"""Commands for measured files: import them, show their content."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ..options.help import command
from ..options.names import FILE
from ..options.outputs import DATA_SUFFIXES, PAGE_SUFFIXES, PICTURE_SUFFIXES, check_outputs
from ..options.progress import progress_bar
from ..options.shared import (
    EXIT_FAILED,
    NUMBER,
    PATH,
    Share,
    as_options,
    emit,
    force_option,
    jobs_option,
    json_option,
)
from ..options.source import (
    bearing_option,
    declared_source,
    exponential_option,
    source_options,
    speed_option,
    texts_by_channel,
)

_CARD = (*PAGE_SUFFIXES, ".md")


class _Segment(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.3 on
    """A time with or without its unit, or ``whole``, which is None."""

    name = "segment"

    def convert(self, value: Any, param: Any, ctx: Any) -> float | None:
        from ...sim.parts.units import to_si

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
@click.option("--list", "only_list", is_flag=True, help="Show the content of FILES; write nothing.")
@source_options
@click.option("--labels", type=PATH, help="CSV with a column 'file' and one column for each label.")
@click.option(
    "--label", "pairs", multiple=True, metavar="NAME=VALUE", help="Label given to all files."
)
@click.option("--speed", help="Shaft speed of all files, e.g. '1500 rpm'.")
@click.option(
    "--severity", multiple=True, metavar="LABEL", help="Label column holding the wear in metres."
)
@click.option(
    "--limits",
    metavar="SCENE|LENGTHS",
    help="Limits of the grades: those of a scene, or lengths, e.g. '0.1 mm, 0.2 mm, 0.3 mm'.",
)
@click.option(
    "--group-by",
    type=click.Choice(["file", "folder", "column"]),
    help="What identifies a machine; default: column 'group' of the labels if there is one, or "
    "else the file.",
)
@click.option(
    "--segment",
    type=_Segment(),
    default="whole",
    metavar="SECONDS|whole",
    help="Cut the files into records of this length.",
)
@click.option(
    "--overlap",
    type=Share(0, 0.99),
    default=0.0,
    help="Fraction of each record that the next one repeats.",
)
@click.option(
    "--place", multiple=True, metavar="CHANNEL=TEXT", help="Position of a channel on the machine."
)
@click.option(
    "--direction",
    multiple=True,
    metavar="CHANNEL=TEXT",
    help="Direction in which a sensor points or a force pushes.",
)
@jobs_option
@force_option
@json_option
def import_files(
    files: Sequence[Path],
    output: Path | None,
    only_list: bool,
    limits: str | None,
    jobs: int,
    as_json: bool,
    **given: Any,
) -> None:
    """Convert measured FILES into one data set: WAV, MATLAB, CSV, HDF5, NPY, UFF58, TDMS, binary.

    Sample rate and units come from the files or from the options; they are never guessed.
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
        raise click.UsageError("-o/--output must name the data set to write; or use --list")
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
            places=texts_by_channel(given["place"], "--place"),
            directions=texts_by_channel(given["direction"], "--direction"),
            jobs=jobs,
            progress=progress,
            **{name: given[name] for name in _IMPORT_OPTIONS},
        )
    if left_out := empty_text(summary):
        click.echo(f"left out, nothing but NaN: {left_out}", err=True)
    emit(imported_table(summary), as_json, imported_text(summary))


_IMPORT_OPTIONS = (
    *("tacho", "pulses_per_revolution", "group_by"),
    *("segment", "overlap", "force"),
)


def _labels(given: Mapping[str, Any]) -> Any:
    """Labels from a table and from constants."""
    from ...datasets.measured.labels import read_labels

    constants: dict[str, str] = {}
    speed = [f"speed_hz={given['speed']}"] if given["speed"] else []
    for pair in (*given["pairs"], *speed):
        name, sign, value = (part.strip() for part in pair.partition("="))
        if not sign or not name or name in constants:
            raise click.BadParameter(
                f"'{pair}' must read NAME=VALUE, once per name", param_hint="--label"
            )
        constants[name] = value
    return read_labels(given["labels"], constants, given["severity"])


_KINDS = (  # as wearstate.diagnose.pictures.kinds, which is too heavy to import for --help
    *("auto", "waveform", "spectrum", "waterfall", "orders"),
    *("angle", "envelope", "frf", "orbit"),
)

_PLOT_OPTIONS = ("draw", "force_channel", "speed_hz", "bearing")


@command()
@click.argument("file", type=FILE, required=False)
@click.option("--fft", "of_fft", is_flag=True, help="Show and time the FFT backend.")
@click.option(
    "--verify", "check", is_flag=True, help="Check every record of a data set; exit 1 on a fault."
)
@click.option("--card", type=PATH, help="Page about a data set to write (.html or .md).")
@click.option(
    "--licence", default="not stated", show_default=True, help="Licence of the data, for --card."
)
@click.option("--plot", type=PATH, help="Picture of a recording to write (.png, .svg or .pdf).")
@click.option(
    "--interactive", is_flag=True, help="Write --plot as a page (.html) with zoom and cursors."
)
@click.option(
    "--kind",
    type=click.Choice(_KINDS),
    help="What to plot; default: all that the recording supports.",
)
@click.option("--draw", multiple=True, metavar="NAME", help="Channel to plot; default: all.")
@click.option("--force-channel", metavar="NAME", help="Force of a transfer function to plot.")
@speed_option
@bearing_option
@exponential_option
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
    """Describe and check a data set, recording or model; plot a recording."""
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
        raise click.UsageError("plot options need --plot, the picture to write")
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
        command = click.get_current_context().command
        text += f"\n{as_options(picture_text(described['plot']), command)}"
    emit(described, as_json, text)


def _about_set(
    file: Path, check: bool, card: Path | None, licence: str, force: bool, as_json: bool
) -> None:
    """Check a data set, write its card, or both; no card is written of an unsound one."""
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
