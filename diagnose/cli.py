"""The command line. Commands call library functions and hold no physics.

Results go to stdout, progress and talk to stderr. Exit codes: 0 done, 1 failed, 2 bad input (also
where no recording can be judged); with ``report --fail-on``: 3 warning, 4 alarm, 5 unfamiliar.
Heavy imports stay inside the commands, so that ``--help`` answers at once.
"""

import json
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

import click

from .. import __version__

EXIT_FAILED, EXIT_BAD_INPUT, EXIT_WARNING, EXIT_ALARM, EXIT_UNFAMILIAR = 1, 2, 3, 4, 5

_FAIL_ON_HELP = "Exit 3 at a warning, 4 at an alarm, 5 when unfamiliar; alarm: only 4 and 5."
_ALIGN_FAIL_ON_HELP = (
    "Exit 3 where a limit is not met, 4 where a bearing lifts or no moves help; alarm: only 4."
)


class _Group(click.Group):
    """Turns the library's own errors into one message and an exit code."""

    def invoke(self, context: click.Context) -> Any:
        try:
            return super().invoke(context)
        except (ValueError, RuntimeError) as error:
            if not type(error).__module__.startswith(__name__.split(".")[0]):
                raise  # not ours: a defect, with its traceback
            command = self.get_command(context, context.invoked_subcommand or "")
            click.echo(f"Error: {_as_options(str(error), command)}", err=True)
            bad_input = isinstance(error, ValueError)
            raise click.exceptions.Exit(EXIT_BAD_INPUT if bad_input else EXIT_FAILED) from None
        except KeyboardInterrupt as error:
            if not str(error):
                raise  # click says that it ends
            click.echo(f"\n{error}", err=True)  # below the ^C of the terminal
            raise click.exceptions.Exit(EXIT_FAILED) from None
        except BrokenPipeError:
            raise  # the reader of stdout has gone: click ends quietly
        except OSError as error:
            # files are written under another name first, which says nothing to the caller
            text = re.sub(r"\.part(\.new)?\b", "", str(error))
            click.echo(f"Error: {text}; check path, rights and space", err=True)
            raise click.exceptions.Exit(EXIT_BAD_INPUT) from None
        except MemoryError:
            click.echo("Error: out of memory; use fewer jobs or shorter recordings", err=True)
            raise click.exceptions.Exit(EXIT_FAILED) from None


def _as_options(text: str, command: click.Command | None) -> str:
    """The library speaks of arguments, here they are options: ``fs = 0`` is ``--fs = 0``."""
    for param in command.params if command else ():
        option = next((name for name in param.opts if name.startswith("--")), "")
        word = option.removeprefix("--").replace("-", "_")
        if "_" in word:
            text = re.sub(rf"(?<![\w'-]){word}(?![\w'])", option, text)
        elif word:  # may be a plain word elsewhere
            place = rf"(?m)(^|: |\b(?:give|with|use) ){word}(?= = | must | to | and | if |[;,)]|$)"
            text = re.sub(place, rf"\1{option}", text)
    return text


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; ends the process with its exit code."""
    cli.main(args=None if arguments is None else list(arguments), prog_name="wearstate")


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="wearstate")
def cli() -> None:
    """Condition monitoring built around physics.

    Simulate a machine that wears, make labelled data sets, train a wear estimate, and report on
    a recording.
    """


class _PathType(click.Path):
    """A path that is not empty: an empty one is a shell variable gone wrong."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if str(value).strip() == "":
            self.fail("is empty, must be a path; name one", param, ctx)
        return super().convert(value, param, ctx)


class _Share(click.FloatRange):
    """A number in a range; not-a-number is in none."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value} must be >= {self.min:g} and <= {self.max:g}; try 0.25", param, ctx)
        return number


_PATH = _PathType(path_type=Path)
_MOST_RECORDS = 10**8  # as wearstate.datasets.recipe, which is too heavy to import for --help
_LARGEST_SEED = 2**63 - 1

_json_option = click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
_force_option = click.option("--force", is_flag=True, help="Replace an existing output.")
_jobs_option = click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1),
    default=None,
    help="Worker processes; all cores by default. The result does not depend on it.",
)
_seed_option = click.option(
    "--seed", type=click.IntRange(0, _LARGEST_SEED), default=0, show_default=True
)


def _source_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about a measured file, the same for every command that reads one."""
    for option in reversed(_SOURCE_OPTIONS):
        command = option(command)
    return command


_SOURCE_OPTIONS = (
    click.option("--fs", type=float, help="Sample rate [Hz], where the file has none."),
    click.option(
        "--unit",
        multiple=True,
        metavar="[CHANNEL=]UNIT",
        help="Unit of a channel, or of all others, where the file declares none.",
    ),
    click.option(
        "--sensitivity",
        multiple=True,
        metavar="[CHANNEL=]TEXT",
        help="Of the sensor on a channel in volts: '100 mV/g'.",
    ),
    click.option(
        "--full-scale",
        multiple=True,
        metavar="[CHANNEL=]TEXT",
        help="What the largest integer of a WAV file is worth: '10 V'.",
    ),
    click.option(
        "--channels",
        multiple=True,
        metavar="NAME,…",
        help="Channels wanted, in order, NEW=OLD to rename; where the file names none, all names.",
    ),
    click.option(
        "--variable", multiple=True, help="Array, data set or group, where the file holds several."
    ),
    click.option("--tacho", help="Name of the tacho channel."),
    click.option(
        "--pulses-per-revolution",
        type=click.IntRange(1),
        default=1,
        show_default=True,
        help="Of the tacho.",
    ),
    click.option("--record", type=click.IntRange(0), default=0, help="Of several, counted from 0."),
    click.option("--delimiter", help="Of a text file: ',', ';', tab, space."),
    click.option("--decimal", type=click.Choice([".", ","]), help="Of a text file."),
    click.option(
        "--header", type=click.IntRange(0), help="Lines above the numbers of a text file."
    ),
    click.option("--time-column", help="Name or number (from 1) of the times; 0: there is none."),
    click.option("--dtype", help="Of headerless binary: '<int16', '>float32'."),
    click.option("--n-channels", type=click.IntRange(1), help="Of headerless binary."),
    click.option(
        "--offset", type=click.IntRange(0), default=0, help="Bytes to skip in headerless binary."
    ),
    click.option(
        "--order",
        type=click.Choice(["interleaved", "blocks"]),
        help="Of binary and arrays: sample by sample, or channel by channel.",
    ),
    click.option(
        "--resample-to", type=float, metavar="HZ", help="Bring measured files to this lower rate."
    ),
)


def _declared(given: Mapping[str, Any]) -> Any:
    """Options about a measured file, as the library takes them."""
    from ..datasets.sources import SourceOptions

    column = given["time_column"]
    return SourceOptions(
        variable=given["variable"] or None,
        channels=tuple(name for text in given["channels"] for name in text.split(",")),
        unit=_each_channel(given["unit"], "--unit"),
        sensitivity=_each_channel(given["sensitivity"], "--sensitivity"),
        full_scale=_each_channel(given["full_scale"], "--full-scale"),
        time_column=int(column) if column is not None and column.isdecimal() else column,
        **{name: given[name] for name in _PLAIN_OPTIONS},
    )


_PLAIN_OPTIONS = (
    *("fs", "record", "delimiter", "decimal", "header"),
    *("dtype", "n_channels", "offset", "order", "resample_to"),
)


def _each_channel(texts: Sequence[str], option: str) -> Any:
    """``channel=value`` for one channel, ``value`` for the others; None without any."""
    from ..datasets.import_plan import EachChannel

    named: dict[str, str] = {}
    others: list[str] = []
    for text in texts:
        name, sign, value = text.rpartition("=")
        if not value.strip() or (sign and not name) or name in named:
            raise click.BadParameter(
                f"'{text}' must read [CHANNEL=]VALUE, once for a channel", param_hint=option
            )
        if sign:
            named[name] = value
        else:
            others.append(value)
    if len(others) > 1:
        raise click.BadParameter(
            f"{', '.join(map(repr, others))} cannot all be for every channel; write CHANNEL=VALUE",
            param_hint=option,
        )
    return EachChannel(named, others=others[0] if others else None) if texts else None


def _emit(value: dict[str, Any], as_json: bool, text: str) -> None:
    """Print a result, as JSON or as text."""
    click.echo(_json_text({"schema_version": 1, **value}) if as_json else text)


def _json_text(value: Mapping[str, Any]) -> str:
    """Strict JSON: what is not finite is null, what has no JSON form is a defect."""
    return json.dumps(_plain(value), allow_nan=False)


def _plain(value: Any) -> Any:
    """Python's own types, from numpy's and from tuples; null for a number that is not finite."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if hasattr(value, "tolist"):  # of numpy
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _workers(jobs: int | None) -> int:
    from ..datasets.workers import cores

    return jobs or cores()


_DATA, _MODEL, _PAGE = (".h5", ".hdf5"), (".wsm",), (".html", ".htm")
_CARD = (*_PAGE, ".md")
_CHART = (".svg", ".png", ".pdf", ".html", ".json", ".csv")
_PICTURE, _TABLE = (".png", ".svg", ".pdf"), (".parquet", ".csv", ".h5")

_Output = tuple[Path | None, tuple[str, ...]]
"""A file to write, None where it was not asked for, and the suffixes it may have."""


def _check_outputs(inputs: Sequence[Path | str], outputs: Sequence[_Output], force: bool) -> None:
    """Refuse outputs that cannot or must not be written, before any work.

    Raises
    ------
    DataError
        An output has the wrong suffix, is a folder or in none, exists and `force` is not given,
        or is the same file as an input or another output: that one `force` does not override.
    """
    from ..datasets.record import DataError

    wanted = [(path, suffixes) for path, suffixes in outputs if path is not None]
    paths = [path for path, _ in wanted]
    faults = [fault for path, suffixes in wanted for fault in _name_faults(path, suffixes)]
    faults += [
        f"{path} is also an input, must be another file; choose another name"
        for path in paths
        if any(_same_file(path, Path(source)) for source in inputs)
    ]
    faults += [
        f"{path} is given for two outputs, must be one; choose another name"
        for number, path in enumerate(paths)
        if any(_same_file(path, other) for other in paths[:number])
    ]
    if not faults and not force:
        faults = [
            f"{path} exists; choose another name or use --force to replace it"
            for path in paths
            if path.exists()
        ]
    if faults:
        raise DataError("\n".join(faults))


def _name_faults(path: Path, suffixes: tuple[str, ...]) -> list[str]:
    if path.is_dir():
        return [f"{path} is a folder; name a file in it"]
    if path.suffix not in suffixes:
        return [f"{path}: suffix {path.suffix!r} must be one of {', '.join(suffixes)}; rename it"]
    if not path.parent.is_dir():
        return [f"{path.parent} is no folder; create it"]
    return []


def _same_file(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return one.samefile(other)  # also by another link
    return one.resolve() == other.resolve()


@contextmanager
def _progress(what: str) -> Iterator[Callable[[int, int], None] | None]:
    """Progress bar on stderr where a person watches; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    rate = TextColumn("{task.fields[rate]}")
    with Progress(*columns, rate, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None, rate="")

        def update(done: int, total: int) -> None:
            speed = bar.tasks[task].speed  # of the last half minute
            text = f"{speed:.3g}/s" if speed else ""
            bar.update(task, completed=done, total=total, rate=text)

        yield update


def _overrides(pairs: Sequence[str]) -> dict[str, Any]:
    """``path=value`` pairs; a value that reads as a number is one."""
    values: dict[str, Any] = {}
    for pair in pairs:
        path, sign, text = pair.partition("=")
        if not sign or not path:
            raise click.BadParameter(f"'{pair}' must read PATH=VALUE", param_hint="--set")
        values[path.strip()] = _number_or_text(text.strip())
    return values


_NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")


def _number_or_text(text: str) -> Any:
    """Python would also read ``1_0`` and ``nan`` as numbers; a person has mistyped them."""
    if not _NUMBER.fullmatch(text):
        return text
    whole = re.fullmatch("[-+]?[0-9]{1,18}", text)
    return int(text) if whole else float(text)


# --- scenes -------------------------------------------------------------------------------------


@cli.group()
def scene() -> None:
    """The machines: list, show, check."""


@scene.command("list")
@_json_option
def scene_list(as_json: bool) -> None:
    """Names and descriptions of the built-in scenes."""
    from ..sim.scene import load_scene, scene_names

    scenes = {name: load_scene(name).description for name in scene_names()}
    _emit({"scenes": scenes}, as_json, "\n".join(f"{n:24} {d}" for n, d in scenes.items()))


@scene.command("show")
@click.argument("name")
def scene_show(name: str) -> None:
    """TOML text of a scene: copy it, change it, check it."""
    from ..sim.parts import SceneError
    from ..sim.scene import scene_table, scene_text

    text = scene_text(name)
    if not isinstance(scene_table(text, name).get("machine"), str):
        raise SceneError(name, ["machine is missing, must be a text; this file is no scene"])
    click.echo(text, nl=False)


@scene.command("check")
@click.argument("file")
@_json_option
def scene_check(file: str, as_json: bool) -> None:
    """Check a scene file; every fault at once."""
    from ..sim.assemble import check
    from ..sim.scene import load_scene

    checked = load_scene(file)
    check(checked)
    _emit({"scene": checked.name, "faults": []}, as_json, f"{checked.name}: no fault")


# --- recipes ------------------------------------------------------------------------------------


@cli.group()
def recipe() -> None:
    """What data sets are drawn from: list, show, check, preview."""


@recipe.command("list")
@_json_option
def recipe_list(as_json: bool) -> None:
    """Names and descriptions of the built-in recipes."""
    from ..datasets.recipe_file import read_recipe, recipe_names

    found = {name: read_recipe(name).table.get("description", "") for name in recipe_names()}
    _emit({"recipes": found}, as_json, "\n".join(f"{n:26} {d}" for n, d in found.items()))


@recipe.command("show")
@click.argument("name")
@click.option("--whole", is_flag=True, help="With all that it extends.")
def recipe_show(name: str, whole: bool) -> None:
    """TOML text of a recipe: copy it, change it, check it."""
    from ..datasets.recipe_file import read_recipe, recipe_text

    click.echo(read_recipe(name).text if whole else recipe_text(name), nl=False)


@recipe.command("check")
@click.argument("file")
@_json_option
def recipe_check(file: str, as_json: bool) -> None:
    """Check a recipe against its scene; every fault at once."""
    from ..datasets.recipe import STRATA, load_recipe, sample_records
    from ..sim.assemble import check

    checked = load_recipe(file)
    for sample in sample_records(checked, STRATA):
        check(sample.scene)
    _emit({"recipe": checked.name, "faults": []}, as_json, f"{checked.name}: no fault")


@recipe.command("preview")
@click.argument("name")
@click.option(
    "-n",
    "--records",
    type=click.IntRange(1, _MOST_RECORDS),
    default=None,
    help="Records; the recipe's by default.",
)
@click.option("--plot", type=_PATH, help="Picture of the draws to write (.png, .svg or .pdf).")
@_seed_option
@_jobs_option
@_force_option
@_json_option
def recipe_preview(
    name: str,
    records: int | None,
    plot: Path | None,
    seed: int,
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """What NAME (a built-in recipe or a TOML file) would make: draws, labels, time and size."""
    from ..datasets.recipe import load_recipe
    from .recipe_text import preview, preview_figure, preview_text

    _check_outputs([name], [(plot, _PICTURE)], force)
    found = preview(load_recipe(name), records, seed=seed, cores=_workers(jobs))
    if plot is not None:
        from .panel import save_picture

        save_picture(preview_figure(found), plot)
    files = [str(plot)] if plot else []
    words = "\n".join([preview_text(found.table), *files])
    _emit({**found.table, "files": files}, as_json, words)


# --- simulation and data sets -------------------------------------------------------------------


@cli.command()
@click.argument("scene_name", metavar="SCENE")
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option("-o", "--output", type=_PATH, help="Recording to write (.h5).")
@click.option("--plot", type=_PATH, help="Picture to write (.png, .svg or .pdf).")
@click.option("--truth", is_flag=True, help="Also store forces and orbit.")
@_seed_option
@_force_option
@_json_option
def simulate(
    scene_name: str,
    pairs: Sequence[str],
    output: Path | None,
    plot: Path | None,
    truth: bool,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    """Simulate one recording of SCENE (a built-in name or a TOML file)."""
    from ..datasets.generate import save_solution
    from ..datasets.quantities import resolved, with_estimate
    from ..sim.assemble import simulate as run
    from ..sim.scene import load_scene

    _check_outputs([scene_name], [(output, _DATA), (plot, _PICTURE)], force)
    machine, resolution = resolved(load_scene(scene_name, _overrides(pairs)))
    solution = run(machine, seed=seed, truth=truth or plot is not None)
    if resolution is not None:
        solution = with_estimate(solution, resolution)
        click.echo(f"fidelity: {resolution.text}", err=True)
    if output is not None:
        save_solution(machine, solution, output, seed=seed, force=force, truth=truth)
    if plot is not None:
        from .plots import plot_simulation

        plot_simulation(machine, solution, plot)
    vibration = [
        (channel, float(row.std()))
        for channel, row in zip(solution.channels, solution.signal, strict=True)
        if channel.quantity != "tacho"
    ]
    rms = {channel.name: value for channel, value in vibration}
    shown = ", ".join(f"{channel.name} {value:.3g} {channel.unit}" for channel, value in vibration)
    files = [str(path) for path in (output, plot) if path]
    for warning in solution.warnings:
        click.echo(f"warning: {warning}", err=True)
    _emit(
        {
            "scene": machine.name,
            "rms": rms,
            "numerics": solution.numerics,
            "warnings": list(solution.warnings),
            "files": files,
        },
        as_json,
        "\n".join([f"{machine.name} (simulated): {shown} rms about the mean", *files]),
    )


@cli.command()
@click.argument("recipe")
@click.option(
    "-n",
    "--records",
    type=click.IntRange(1, _MOST_RECORDS),
    default=None,
    help="Records; the recipe's by default.",
)
@click.option("-o", "--output", type=_PATH, required=True, help="Data set to write (.h5).")
@click.option("--truth", is_flag=True, help="Also store forces and orbit.")
@click.option(
    "--fidelity",
    type=click.Choice(["auto", "given"]),
    default=None,
    help="Least rungs that the accuracy needs, or as written; what the recipe says by default.",
)
@_seed_option
@_jobs_option
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Simulate on the workers of a Dask cluster instead; the same bytes.",
)
@_force_option
@_json_option
def generate(
    recipe: str,
    records: int | None,
    output: Path,
    truth: bool,
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

    from ..datasets.generate import generate as run

    if scheduler is not None and jobs is not None:
        raise click.UsageError("--jobs is for this machine, not for the workers of --scheduler")
    _check_outputs([recipe], [(output, _DATA)], force)
    with _progress("simulating") as progress:
        summary = run(
            recipe,
            records,
            output,
            seed=seed,
            jobs=_workers(jobs),
            scheduler=scheduler,
            force=force,
            truth=truth,
            fidelity=fidelity,
            progress=progress,
            say=lambda text: click.echo(text, err=True),
        )
    value = {**asdict(summary), "path": str(summary.path)}
    _emit(value, as_json, _generated_text(summary))


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


class _Segment(click.ParamType[float | None]):
    """A time with or without its unit, or ``whole``, which is None."""

    name = "segment"

    def convert(self, value: Any, param: Any, ctx: Any) -> float | None:
        from ..sim.parts import to_si

        text = str(value).strip()
        if text == "whole":
            return None
        try:
            return to_si(f"{text} s" if _NUMBER.fullmatch(text) else text, "time")
        except ValueError as error:
            self.fail(f"{value!r} {error}; or write whole", param, ctx)


@cli.command("import")
@click.argument("files", metavar="FILES…", nargs=-1, required=True, type=_PATH)
@click.option("-o", "--output", type=_PATH, help="Data set to write (.h5).")
@click.option("--list", "only_list", is_flag=True, help="Show what is in FILES; write nothing.")
@_source_options
@click.option("--labels", type=_PATH, help="CSV with a column 'file' and one for every label.")
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
    "--overlap", type=_Share(0, 0.99), default=0.0, help="Part of a record the next one repeats."
)
@_jobs_option
@_force_option
@_json_option
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
    from ..datasets.import_set import import_recordings
    from ..datasets.importers import list_contents
    from ..datasets.labels import read_limits
    from .import_text import contents_text, imported_table, imported_text

    if only_list:
        found = list_contents(files, _declared(given))
        _emit({"files": found}, as_json, contents_text(found))
        return
    if output is None:
        raise click.UsageError("-o/--output must name the data set to write; or ask for --list")
    _check_outputs([*files, *filter(None, [given["labels"]])], [(output, _DATA)], given["force"])
    labels = _labels(given)
    with _progress("importing") as progress:
        summary = import_recordings(
            files,
            output,
            options=_declared(given),
            labels=labels,
            limits=read_limits(limits, labels.severities) if limits else None,
            jobs=_workers(jobs),
            progress=progress,
            **{name: given[name] for name in _IMPORT_OPTIONS},
        )
    _emit(imported_table(summary), as_json, imported_text(summary))


_IMPORT_OPTIONS = (
    *("tacho", "pulses_per_revolution", "group_by"),
    *("segment", "overlap", "force"),
)


def _labels(given: Mapping[str, Any]) -> Any:
    """Labels of a table and of words."""
    from ..datasets.labels import read_labels

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


class _Numbers(click.ParamType[tuple[float, ...]]):
    """Numbers parted by commas."""

    name = "numbers"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return tuple(float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} must be numbers parted by commas", param, ctx)


_KINDS = (  # as wearstate.diagnose.signal_plots, which is too heavy to import for --help
    *("auto", "waveform", "spectrum", "waterfall", "orders"),
    *("angle", "envelope", "frf", "orbit"),
)
_PLOT_OPTIONS = ("draw", "force_channel", "speed_hz", "bearing")


@cli.command()
@click.argument("file", type=_PATH, required=False)
@click.option("--fft", "of_fft", is_flag=True, help="Who computes Fourier transforms, timed here.")
@click.option(
    "--verify", "check", is_flag=True, help="Check every record of a data set; exit 1 on a fault."
)
@click.option("--card", type=_PATH, help="Page about a data set to write (.html or .md).")
@click.option("--licence", default="not stated", show_default=True, help="Of the data, for --card.")
@click.option("--plot", type=_PATH, help="Picture of a recording to write (.png, .svg or .pdf).")
@click.option("--kind", type=click.Choice(_KINDS), help="What to plot; by default all it supports.")
@click.option("--draw", multiple=True, metavar="NAME", help="Channel to plot; all by default.")
@click.option("--force-channel", metavar="NAME", help="Force of a transfer function to plot.")
@click.option("--speed-hz", type=float, help="Shaft speed [Hz], where the file has none.")
@click.option(
    "--bearing",
    type=_Numbers(),
    metavar="N,d,D[,DEG]",
    help="Rollers, their diameter, pitch diameter, contact angle: for its fault lines.",
)
@_source_options
@_force_option
@_json_option
def info(
    file: Path | None,
    of_fft: bool,
    check: bool,
    card: Path | None,
    licence: str,
    plot: Path | None,
    kind: str | None,
    tacho: str | None,
    pulses_per_revolution: int,
    force: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """What a data set, recording or model is, checked; and pictures of a recording."""
    from .info import describe, describe_fft, description_text, fft_text, picture_text, plot_file

    wanted = {name: given.pop(name) for name in _PLOT_OPTIONS}
    if of_fft == (file is not None):
        raise click.UsageError("give either a FILE or --fft")
    if file is not None and (check or card is not None):
        _about_set(file, check, card, licence, force, as_json)
        return
    if plot is None and (kind or any(wanted.values())):
        raise click.UsageError("what to plot is given, but no --plot to write it to")
    if file is None:
        facts = describe_fft()
        _emit(facts, as_json, fft_text(facts))
        return
    _check_outputs([file], [(plot, _PICTURE)], force)
    read: dict[str, Any] = {"tacho": tacho, "pulses_per_revolution": pulses_per_revolution}
    described = describe(file, _declared(given), **read)
    text = description_text(described)
    if plot is not None:
        described["plot"] = plot_file(
            file, plot, _declared(given), kind=kind or _KINDS[0], **read, **wanted
        )
        text += f"\n{picture_text(described['plot'])}"
    _emit(described, as_json, text)


def _about_set(
    file: Path, check: bool, card: Path | None, licence: str, force: bool, as_json: bool
) -> None:
    """Check a data set, write its card, or both; a card of an unsound one is not written."""
    from ..datasets.check import check_set, checked_table, checked_text

    _check_outputs([file], [(card, _CARD)], force)
    found: dict[str, Any] = {}
    words = []
    if check:
        with _progress("checking") as progress:
            found = checked_table(check_set(file, progress=progress))
        words.append(checked_text(found))
    if card is not None and found.get("sound", True):
        from .card import write_card

        write_card(file, card, licence=licence)
        found["card"] = str(card)
        words.append(str(card))
    _emit(found, as_json, "\n".join(words))
    raise click.exceptions.Exit(0 if found.get("sound", True) else EXIT_FAILED)


@cli.command()
@click.argument("data", type=_PATH)
@click.option("-o", "--output", type=_PATH, required=True, help="File or folder to write.")
@click.option(
    "--as",
    "kind",
    type=click.Choice(["h5", "parquet", "npz", "wav", "csv"]),
    help="By the suffix of the output by default; wav and csv are folders.",
)
@click.option("--signals", is_flag=True, help="Parquet: signals too, as columns of lists.")
@click.option("--compress", is_flag=True, help=".h5 and .npz: smaller, with the same values.")
@_force_option
@_json_option
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

    from ..datasets.export import export_set, exported_text

    with _progress("exporting") as progress:
        made = export_set(
            data,
            output,
            kind=kind,
            signals=signals,
            compress=compress,
            force=force,
            progress=progress,
        )
    _emit({**asdict(made), "path": str(made.path)}, as_json, exported_text(made))


_SPLITS = (  # as wearstate.datasets.split_file, which is too heavy to import for --help
    *("machine", "speed", "load", "severity", "geometry"),
    *("time-same-machines", "time-other-machines", "region"),
)


@cli.command()
@click.argument("data", type=_PATH)
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
    type=_Share(0.01, 0.99),
    help="Of the machines that is tested; of time-…: of a life that is trained on.",
)
@click.option("--seed", type=click.IntRange(0, _LARGEST_SEED), help="Of the choice of machines.")
@_force_option
@_json_option
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
    from ..datasets.record import DataSet
    from ..datasets.split_file import default_splits, drawn_of, make_split, store_splits
    from .audit_text import splits_table, splits_text

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
    _emit(value, as_json, splits_text(value))


def _bounds(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """``column=low:high`` pairs; an end that is left out is infinite."""
    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        column, _, ends = text.partition("=")
        low, sign, high = (part.strip() for part in ends.partition(":"))
        good = all(not end or _NUMBER.fullmatch(end) for end in (low, high))
        if not (column and sign and good and (low or high)) or column in found:
            raise click.BadParameter(
                f"'{text}' must read COLUMN=LOW:HIGH, once for a column", param_hint="--bound"
            )
        found[column] = (float(low or -math.inf), float(high or math.inf))
    return found


@cli.command()
@click.argument("paths", metavar="FILES…", nargs=-1, type=_PATH)
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
@click.option("--train", multiple=True, type=_PATH, help="File that trains, against --test.")
@click.option("--test", multiple=True, type=_PATH, help="File that tests, against --train.")
@click.option(
    "--fail-on",
    type=click.Choice(["warning", "alarm"]),
    help="Exit 3 at a warning, 4 at an alarm; alarm: only 4.",
)
@_jobs_option
@_json_option
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
    from ..datasets.audit import audit as run
    from ..datasets.audit_table import Roles
    from .audit_text import audit_table, audit_text

    if bool(train) != bool(test):
        raise click.UsageError("--train and --test go together: give both")
    if not paths and not train:
        raise click.UsageError("give FILES, or --train and --test")
    roles = Roles(label=label, group=group, split=split, nuisance=tuple(nuisance))
    with _progress("reading records") as progress:
        found = run(paths, roles, train=train, test=test, jobs=_workers(jobs), progress=progress)
    _emit(audit_table(found), as_json, audit_text(found))
    code = {"warning": EXIT_WARNING, "alarm": EXIT_ALARM}.get(found.verdict, 0) if fail_on else 0
    raise click.exceptions.Exit(0 if fail_on == "alarm" and code == EXIT_WARNING else code)


_FEATURE_SETS = ("standard", "core", "complete")  # as wearstate.features.catalogue.SetName


@cli.command()
@click.argument("data", type=_PATH, required=False)
@click.option("-o", "--output", type=_PATH, help="Table (.parquet, .csv, .h5).")
@click.option("--list", "listing", is_flag=True, help="What there is: unit, needs, reference.")
@click.option(
    "--set",
    "feature_set",
    type=click.Choice(_FEATURE_SETS),
    help="What models are trained on (default); all but the dearest; everything.",
)
@click.option("--only", multiple=True, metavar="NAMES", help="Only these, parted by commas.")
@click.option("--machine", metavar="KIND", help="Kind of machine, for its ISO zone.")
@click.option("--speed-hz", type=float, help="Nominal shaft speed [Hz].")
@click.option(
    "--bearing",
    type=_Numbers(),
    metavar="N,d,D[,DEG]",
    help="Rollers, their diameter, pitch diameter, contact angle: for its fault lines.",
)
@click.option(
    "--band", "bands", type=_Numbers(), multiple=True, metavar="LOW,HIGH", help="Band level [Hz]."
)
@click.option(
    "--envelope-band", type=_Numbers(), metavar="LOW,HIGH", help="Band of the envelope [Hz]."
)
@click.option(
    "--speed-band",
    type=_Numbers(),
    metavar="LOW,HIGH",
    help="Where the speed is looked for without a tacho [Hz].",
)
@_jobs_option
@_force_option
@_json_option
def features(
    data: Path | None,
    output: Path | None,
    listing: bool,
    feature_set: str | None,
    only: Sequence[str],
    jobs: int | None,
    force: bool,
    as_json: bool,
    **about: Any,
) -> None:
    """Feature table of the data set DATA (.parquet, .csv or .h5), manifest beside it."""
    if listing:
        if data is not None or output is not None:
            raise click.UsageError("--list stands alone: it reads and writes no file")
        _emit_catalogue(feature_set or _FEATURE_SETS[-1], as_json)
        return
    if data is None or output is None:
        raise click.UsageError("give DATA and --output, or --list")
    if only and feature_set:
        raise click.UsageError("give either --set or --only: names are looked for in every set")
    from .tabulate import absent_in, choice_of, feature_table, save_table

    _check_outputs([data], [(output, _TABLE)], force)
    names = [name.strip() for part in only for name in part.split(",")]
    about["speed_band_hz"] = about.pop("speed_band")
    wanted: Any = feature_set or _FEATURE_SETS[0]
    choice = choice_of(wanted, names, **about)
    absent = absent_in(data, choice)
    if feature_set and absent:
        click.echo(f"absent, as --json explains: {', '.join(absent)}", err=True)
    with _progress("features") as progress:
        table = feature_table(data, choice=choice, jobs=_workers(jobs), progress=progress)
    save_table(table, output)
    size = {"path": str(output), "records": len(table.values), "features": len(table.names)}
    text = f"{output}: {size['records']} records, {size['features']} features"
    _emit({**size, "absent": absent}, as_json, text)


def _emit_catalogue(feature_set: Any, as_json: bool) -> None:
    """The catalogue, one line a feature."""
    from ..features.table import catalogue

    rows = catalogue(feature_set)
    columns = ("name", "unit", "set", "needs", "reference")
    widths = [max(len(row[c]) for row in rows) for c in columns[:-1]]
    lines = [columns, *(tuple(row[c] for c in columns) for row in rows)]
    text = "\n".join(
        "  ".join([*(cell.ljust(w) for cell, w in zip(line, widths, strict=False)), line[-1]])
        for line in lines
    )
    _emit({"features": list(rows)}, as_json, text)


# --- models -------------------------------------------------------------------------------------


@cli.command()
@click.argument("data", type=_PATH)
@click.option("-o", "--output", type=_PATH, required=True, help="Model to write (.wsm).")
@click.option(
    "--target",
    metavar="COLUMN",
    default=None,
    help="Severity to train for, or label of named conditions; the first severity by default.",
)
@click.option(
    "--held-out",
    type=_Share(0, 0.9),
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
    type=_PATH,
    help="Healthy records of DATA's machines: a model that is told how each was when new.",
)
@click.option(
    "--budget-ms",
    type=click.FloatRange(0, min_open=True),
    default=None,
    help="Time that a prediction may take, beside its features [ms]; 5 by default.",
)
@_seed_option
@_jobs_option
@_force_option
@_json_option
def train(
    data: Path,
    output: Path,
    target: str | None,
    held_out: float,
    split: str | None,
    healthy: Path | None,
    budget_ms: float | None,
    seed: int,
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Train a wear model on a labelled data set and judge it on held-out machine draws.

    Where the target names conditions instead of a severity: a model that tells which, judged with
    every recording left out in turn.
    """
    from .evaluate import score
    from .evaluate_text import score_lines
    from .healthy import references
    from .modelfile import save_model
    from .own import names_classes
    from .tabulate import feature_table
    from .train import train_model

    inputs = [data] if healthy is None else [data, healthy]
    _check_outputs(inputs, [(output, _MODEL)], force)
    source = click.get_current_context().get_parameter_source("held_out")
    shared = source is not click.core.ParameterSource.DEFAULT
    if shared and split:
        raise click.UsageError("--split says what is held out: leave --held-out away")
    if target is not None and names_classes(data, target):
        if healthy or budget_ms or shared or split:
            raise click.UsageError(
                f"--baseline, --budget-ms, --held-out and --split are for a severity; {target} "
                "names conditions, and every recording is left out in turn"
            )
        _train_classes(data, output, target, seed, _workers(jobs), force, as_json)
        return
    with _progress("features") as progress:
        model, table, test = train_model(
            data,
            target=target,
            held_out=held_out,
            split=split,
            seed=seed,
            jobs=_workers(jobs),
            budget_ms=budget_ms,
            baseline=healthy,
            progress=progress,
        )
        reference = None
        if healthy is not None:
            known = feature_table(healthy, jobs=_workers(jobs), progress=progress)
            reference = references(table, known, healthy)
    save_model(model, output, force=force)
    result = score(model, table, test, references=reference) if len(test) else {}
    trained = model.card["trained_on"]
    head = f"{output}: trained on {trained['records']} records of {trained['draws']} machine draws"
    lines = [head, *score_lines(result, model.card)]
    if model.notice:
        lines.append(f"Notice: {model.notice}.")
    value = {"path": str(output), "trained_on": trained, "held_out": result}
    _emit(value, as_json, "\n".join(lines))


def _train_classes(
    data: Path, output: Path, target: str, seed: int, jobs: int, force: bool, as_json: bool
) -> None:
    """A model of named conditions, judged with whole recordings left out."""
    from .own import classes_text, train_classes
    from .ownfile import save_class_model

    with _progress("features") as progress:
        model, result = train_classes(data, target=target, seed=seed, jobs=jobs, progress=progress)
    save_class_model(model, output, force=force)
    head = (
        f"{output}: trained on {model.card['records']} records of {result['recordings']} "
        f"recordings, to tell {', '.join(model.classes)}"
    )
    notice = [f"Notice: {model.notice}."] if model.notice else []
    value = {"path": str(output), "target": target, "left_out": result, "notice": model.notice}
    _emit(value, as_json, "\n".join([head, *classes_text(result), *notice]))


@cli.command()
@click.argument("model_file", metavar="MODEL", type=_PATH)
@click.argument("data", type=_PATH, required=False)
@click.option(
    "--across-fidelity",
    is_flag=True,
    help="MODEL is a recipe: train on each of its rungs, judge on the best.",
)
@click.option(
    "-n",
    "--records",
    type=click.IntRange(20, _MOST_RECORDS),
    default=None,
    help="Of every rung, with --across-fidelity; 120 by default.",
)
@click.option("--effect", "effects", multiple=True, help="With --across-fidelity: only this one.")
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option(
    "--folder",
    type=_PathType(path_type=Path, file_okay=False, exists=True),
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
@click.option("--trained-on", type=_PATH, help="MODEL's training set, for the baselines.")
@click.option("--baseline", "healthy", type=_PATH, help="Healthy records of DATA's machines.")
@click.option("--quick", is_flag=True, help="Leave out baselines that need packages of others.")
@click.option(
    "--cache",
    type=_PathType(path_type=Path, file_okay=False, exists=True),
    help="Folder in which features of such packages are kept.",
)
@click.option("-o", "--output", type=_PATH, help="Page, picture or JSON to write.")
@_seed_option
@_force_option
@_jobs_option
@_json_option
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
    from .bundle import kind_of
    from .ownfile import CLASS_MODEL

    keys = ("split", "retrain", "trained_on", "healthy", "quick", "cache")
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
    _check_outputs([model_file, data], [(output, _EVALUATION)], force)
    if kind_of(model_file) == CLASS_MODEL:
        if named or output:
            raise click.UsageError("a model of named conditions takes no such option")
        _judge_classes(model_file, data, seed, _workers(jobs), as_json)
        return
    _judge(model_file, data, output, seed, _workers(jobs), as_json, given)


_EVALUATION = (".html", ".png", ".svg", ".pdf", ".json")


def _judge_classes(model_file: Path, data: Path, seed: int, jobs: int, as_json: bool) -> None:
    """Of a model of named conditions."""
    from .own import classes_text, evaluate_classes
    from .ownfile import load_class_model

    model = load_class_model(model_file)
    with _progress("features") as progress:
        result = evaluate_classes(model, data, seed=seed, jobs=jobs, progress=progress)
    _emit(result, as_json, "\n".join(classes_text(result)))


def _judge(
    model_file: Path,
    data: Path,
    output: Path | None,
    seed: int,
    jobs: int,
    as_json: bool,
    given: Mapping[str, Any],
) -> None:
    """Of a finished model, or by splits; text or JSON, and a file if asked for."""
    from .evaluate import evaluate_model
    from .evaluate_figure import save_evaluation
    from .evaluate_splits import ALL_SPLITS, case_of, evaluate_splits, one_split
    from .evaluate_text import score_lines, splits_text
    from .modelfile import load_model

    model = load_model(model_file)
    shared = {key: given[key] for key in ("healthy", "quick", "cache")}
    with _progress("features") as progress:
        ways: dict[str, Any] = {**shared, "seed": seed, "jobs": jobs, "progress": progress}
        if given["retrain"]:
            names = ALL_SPLITS if "all" in given["retrain"] else given["retrain"]
            case = case_of(model, data, **ways)
            result = evaluate_splits(case, names, say=lambda text: click.echo(text, err=True))
            whole, text = result, splits_text(result)
        else:
            ways |= {"trained_on": given["trained_on"], "split": given["split"]}
            result = evaluate_model(model, data, **ways)
            whole = one_split(result, model, data, seed)
            text = "\n".join(score_lines(result, model.card))
    if output is not None:
        save_evaluation(whole, output, notice=model.notice)
    _emit(result, as_json, text)


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

    from .across import across_fidelity, across_table, across_text

    with TemporaryDirectory() as passing:
        found = across_fidelity(
            str(recipe),
            records,
            folder or Path(passing),
            effects=effects,
            overrides=_overrides(pairs),
            seed=seed,
            jobs=_workers(jobs),
            say=lambda text: click.echo(text, err=True),
        )
    _emit(across_table(found), as_json, across_text(found))


@cli.command()
@click.argument("source", metavar="RECORDING|FOLDER", type=_PATH)
@click.option("--model", "model_file", type=_PATH, required=True)
@click.option("--baseline", "healthy", type=_PATH, help="Healthy recordings of the machine (.h5).")
@click.option("-o", "--output", type=_PATH, help="HTML page to write.")
@click.option("--machine", metavar="KIND", help="Kind of machine, for its ISO zone.")
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
@_seed_option
@_source_options
@click.option("--fail-on", type=click.Choice(["warning", "alarm"]), help=_FAIL_ON_HELP)
@_force_option
@_json_option
def report(
    source: Path,
    model_file: Path,
    healthy: Path | None,
    output: Path | None,
    machine: str | None,
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
    from .bundle import kind_of
    from .healthy import Baselines
    from .modelfile import load_model
    from .ownfile import CLASS_MODEL
    from .report import known_machine

    inputs = [source, model_file, *([healthy] if healthy else [])]
    _check_outputs(inputs, [(output, _PAGE)], force)
    known_machine(machine)
    if kind_of(model_file) == CLASS_MODEL:
        wear = {
            "--baseline": healthy,
            "-o": output,
            "--machine": machine,
            "--fail-on": fail_on,
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
    told = _Told(source, model_file, model, baselines, output, machine, as_json, given)
    verdicts = _report_many(told) if many else _report_one(told)
    raise click.exceptions.Exit(_report_exit(verdicts, fail_on))


def _holds_many(source: Path) -> bool:
    """Whether a folder, or a data set of which no record is chosen."""
    from .report_batch import record_count

    asked = click.get_current_context().get_parameter_source("record")
    chosen = asked is not click.core.ParameterSource.DEFAULT
    return source.is_dir() or (not chosen and record_count(source) > 1)


def _report_class(source: Path, model_file: Path, given: Mapping[str, Any], as_json: bool) -> None:
    """The condition in recordings, each as soon as it is told; exit 2 where none can be."""
    from ..datasets.importers import read_recording
    from .own import name_all, naming_text
    from .ownfile import load_class_model
    from .report_batch import recordings_in

    model = load_class_model(model_file)
    tacho = {key: given[key] for key in ("tacho", "pulses_per_revolution")}
    if not _holds_many(source):
        naming = model.estimate(read_recording(source, _declared(given), **tacho))
        notice = f"\nNotice: {model.notice}." if model.notice else ""
        _emit({**naming.as_dict(), "notice": model.notice}, as_json, naming_text(naming) + notice)
        verdicts = {naming.verdict}
    else:
        verdicts = set()
        with recordings_in(source, _declared(given), **tacho, leave_out=[model_file]) as items:
            for name, naming in name_all(items, model):
                verdicts.add(naming.verdict)
                _emit(
                    {"recording": name, **naming.as_dict()},
                    as_json,
                    f"{name}: {naming_text(naming)}",
                )
        if model.notice:
            click.echo(f"Notice: {model.notice}.", err=as_json)
    if verdicts == {"unusable"}:
        raise click.exceptions.Exit(EXIT_BAD_INPUT)


class _Told(NamedTuple):
    """What both kinds of report are given."""

    source: Path
    model_file: Path
    model: Any
    baselines: Any
    output: Path | None
    machine: str | None
    as_json: bool
    given: Mapping[str, Any]


_Verdict = tuple[str, int | None]
"""Verdict and grade."""


def _report_one(told: _Told) -> list[_Verdict]:
    """Report on one recording."""
    from ..datasets.importers import read_recording
    from .report import report_table, save_page
    from .report_text import report_text

    recording = read_recording(
        told.source,
        _declared(told.given),
        tacho=told.given["tacho"],
        pulses_per_revolution=told.given["pulses_per_revolution"],
    )
    baseline = told.baselines.of(recording.row) if told.baselines else None
    estimate = told.model.estimate(recording, baseline)
    table = report_table(
        recording,
        told.model,
        estimate,
        machine=told.machine,
        baseline=baseline,
        files={"recording": told.source, "model": told.model_file},
    )
    if told.output is not None:
        from .report_page import report_html

        page = report_html(table, recording, told.model, baseline=baseline)
        save_page(page, told.output)
        table["html"] = str(told.output)
    text = report_text(table) + (f"\nPage        {told.output}" if told.output else "")
    click.echo(_json_text(table) if told.as_json else text)
    return [(estimate.verdict, estimate.grade)]


def _report_many(told: _Told) -> list[_Verdict]:
    """Report on a folder or data set; of JSON one line each, as soon as it is judged."""
    from .report import save_page
    from .report_batch import HOURS, judge_all, recordings_in
    from .report_text import batch_text

    given = told.given
    dates = given["dates"]
    if given["trend"] and dates is None:
        dates = "names" if told.source.is_dir() else HOURS
    healthy = told.baselines and Path(told.baselines.source)
    others = [path for path in (told.output, told.model_file, Path(dates or ""), healthy) if path]
    with (
        recordings_in(
            told.source,
            _declared(given),
            tacho=given["tacho"],
            pulses_per_revolution=given["pulses_per_revolution"],
            leave_out=others,
        ) as items,
        _progress("judging") as progress,
    ):
        batch = judge_all(
            told.source,
            items,
            told.model,
            model_file=told.model_file,
            baselines=told.baselines,
            dates=dates,
            growth=given["growth"],
            seed=given["seed"],
            tell=(lambda line: click.echo(_json_text(line))) if told.as_json else None,
            progress=progress,
        )
        if told.output is not None:
            from .report_page import batch_html

            page = batch_html(batch, told.model, machine=told.machine, baselines=told.baselines)
            save_page(page, told.output)
    if not told.as_json:
        click.echo(batch_text(batch) + (f"\nPage        {told.output}" if told.output else ""))
    return [(row.verdict, row.grade) for row in batch.current]


def _report_exit(verdicts: Sequence[_Verdict], fail_on: str | None) -> int:
    """Nothing judged is bad input, asked or not; else only what --fail-on asks for."""
    from .grades import ALARM_GRADE, WARNING_GRADE

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


@cli.command()
@click.argument("scene_name", metavar="SCENE")
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option(
    "--condition",
    type=click.Choice(["cold", "hot", "running", "all"]),
    default="all",
    show_default=True,
    help="In which the limits must hold.",
)
@click.option("--calibrate/--no-calibrate", default=True, show_default=True, help="Look for moves.")
@click.option(
    "--prefer",
    type=click.Choice(["least", "fewest"]),
    default="least",
    show_default=True,
    help="Least sum of moves, or fewest bearings moved.",
)
@click.option("--jack", metavar="BEARING", help="Jacking test beside this bearing.")
@click.option(
    "--test",
    "rig_test",
    type=click.Choice(["hammer", "shaker"]),
    help="Simulated test of the running shaft before and after the moves.",
)
@click.option("--push", metavar="BEARING", help="Where --test pushes the shaft up; aftmost.")
@click.option("--test-plot", type=_PATH, help="Picture of --test to write.")
@_seed_option
@click.option("--plot", type=_PATH, help="Picture to write (.png, .svg or .pdf).")
@click.option("-o", "--output", type=_PATH, help="HTML page to write.")
@click.option("--fail-on", type=click.Choice(["warning", "alarm"]), help=_ALIGN_FAIL_ON_HELP)
@_force_option
@_json_option
def align(
    scene_name: str,
    pairs: Sequence[str],
    condition: str,
    calibrate: bool,
    prefer: str,
    jack: str | None,
    rig_test: str | None,
    push: str | None,
    test_plot: Path | None,
    seed: int,
    plot: Path | None,
    output: Path | None,
    fail_on: str | None,
    force: bool,
    as_json: bool,
) -> None:
    """Bearing loads of the shaft line SCENE, and the moves that bring them within limits."""
    from ..sim.scene import load_scene
    from .align import align as judge
    from .align import align_table, align_text, save_figure, save_html

    if rig_test is None and (push or test_plot or seed):
        raise click.UsageError("--push, --test-plot and --seed need --test")
    if rig_test is not None and not calibrate:
        raise click.UsageError("--test compares before and after the moves: it needs --calibrate")
    outputs = [(plot, _PICTURE), (output, _PAGE), (test_plot, _PICTURE)]
    _check_outputs([scene_name], outputs, force)
    scene = load_scene(scene_name, _overrides(pairs))
    found = judge(scene, condition=condition, mend=calibrate, prefer=prefer, jack=jack)
    if plot is not None:
        save_figure(found, plot)
    if output is not None:
        save_html(found, output)
    tested, words = _tested(scene, found.calibration, rig_test, push, test_plot, seed)
    files = [str(path) for path, _ in outputs if path and path.exists()]
    text = "\n".join([align_text(found), *words, *files])
    _emit({**align_table(found), "test": tested, "files": files}, as_json, text)
    levels = {"warning": EXIT_WARNING, "alarm": EXIT_ALARM}
    code = levels.get(found.verdict, 0) if fail_on else 0
    raise click.exceptions.Exit(0 if fail_on == "alarm" and code == EXIT_WARNING else code)


def _tested(
    scene: Any,
    calibration: Any,
    kind: str | None,
    push: str | None,
    picture: Path | None,
    seed: int,
) -> tuple[dict[str, Any] | None, list[str]]:
    """Table and text of the simulated test before and after the moves, if one was asked for."""
    if kind is None:
        return None, []
    from .rig import calibrated_test, rig_figure, rig_table, rig_text

    result = calibrated_test(scene, calibration, kind, push=push, seed=seed)
    if result is None:
        return None, ["", "no test: nothing moves, so nothing changes"]
    if picture is not None:
        rig_figure(result).savefig(picture, dpi=110)
    return rig_table(result), ["", rig_text(result)]


@cli.command()
@click.argument("scene_name", metavar="SCENE")
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option("--map", "map_name", help="One map only; all that the machine has by default.")
@click.option("--size", type=click.IntRange(3, 60), help="Cells along either axis.")
@click.option(
    "--budget",
    type=_Share(min=1.0, max=86_400.0),
    help="Seconds; what it leaves no time for is drawn as not run. None by default.",
)
@click.option("-o", "--output", type=_PATH, help="Picture to write (.png, .svg or .pdf).")
@_force_option
@_json_option
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
    """Where each method fails on SCENE: stable, wrong or unstable, by its method or physically."""
    from ..sim.scene import load_scene
    from .stability import save_figure, stability_table, stability_text
    from .stability_maps import atlas

    _check_outputs([scene_name], [(output, _PICTURE)], force)
    machine = load_scene(scene_name, _overrides(pairs))
    with _progress("running cells") as progress:
        maps = atlas(machine, name=map_name, budget=budget, size=size, progress=progress)
    files = [str(output)] if output is not None else []
    if output is not None:
        save_figure(machine, maps, output)
    text = "\n".join([stability_text(machine, maps), *files])
    _emit({**stability_table(machine, maps), "files": files}, as_json, text)


@cli.command()
@click.argument("subject", metavar="SCENE|DATA")
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option(
    "--accuracy",
    type=_Share(1e-6, 0.5),
    default=None,
    help="Error that every quantity may carry; the scene's own by default.",
)
@click.option(
    "--budget",
    type=_Share(1.0, 1e6),
    default=None,
    help="Seconds after which nothing further is begun.",
)
@click.option("-o", "--output", type=_PATH, help="Chart (.svg, .png, .pdf, .html, .json, .csv).")
@_seed_option
@_jobs_option
@_force_option
@_json_option
def chart(
    subject: str,
    pairs: Sequence[str],
    accuracy: float | None,
    budget: float | None,
    output: Path | None,
    seed: int,
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Speed against accuracy: of the rungs and steps of SCENE, or the diagnosis on DATA (.h5)."""
    from .chart import chart_table, chart_text, scene_chart

    _check_outputs([subject], [(output, _CHART)], force)
    of_data = subject.endswith(_DATA)
    if of_data and (pairs or accuracy is not None):
        raise click.UsageError("--set and --accuracy are for a scene, not for a data set")
    if seed and not of_data:
        raise click.UsageError("--seed is of the models on a data set; a scene's chart draws none")
    with _progress("measuring") as progress:
        if of_data:
            from .chart_models import model_chart

            found = model_chart(
                subject, seed=seed, budget=budget, jobs=_workers(jobs), progress=progress
            )
        else:
            from ..sim.scene import load_scene

            machine = load_scene(subject, _overrides(pairs))
            found = scene_chart(machine, accuracy=accuracy, budget=budget, progress=progress)
    if output is not None:
        from .chart_figure import save_chart

        save_chart(found, output)
    files = [str(output)] if output is not None else []
    _emit({**chart_table(found), "files": files}, as_json, "\n".join([chart_text(found), *files]))


@cli.command()
@_json_option
def verify(as_json: bool) -> None:
    """Every literature check: expected, obtained, tolerance, source. Exit 1 if one fails."""
    from dataclasses import asdict

    from .verify import run_checks

    results = run_checks()
    failed = sum(not result.passed for result in results)
    lines = [f"{'check':44} {'expected':>14} {'obtained':>14} {'tolerance':>10}  source"]
    lines += [
        f"{r.name:44} {r.expected:14.8g} {r.obtained:14.8g} {r.tolerance:10.2g}  "
        f"{'' if r.passed else 'FAILED '}[{r.trust}] {r.source}"
        for r in results
    ]
    lines.append(f"{len(results) - failed} passed, {failed} failed")
    checks = [{**asdict(r), "passed": r.passed} for r in results]
    _emit({"checks": checks, "failed": failed}, as_json, "\n".join(lines))
    raise click.exceptions.Exit(EXIT_FAILED if failed else 0)


@cli.command()
@click.option(
    "--folder",
    type=_PathType(path_type=Path, file_okay=False),
    default=Path("demo"),
    show_default=True,
    help="Where its files go: new, empty, or an earlier demo's, whose files are replaced.",
)
@_seed_option
@_jobs_option
@_json_option
def demo(folder: Path, seed: int, jobs: int | None, as_json: bool) -> None:
    """The whole job, small: simulate, features, train, evaluate, report."""
    from .demo import run_demo
    from .evaluate_text import score_lines

    with _progress("simulating and learning") as progress:
        result = run_demo(
            folder,
            seed=seed,
            jobs=_workers(jobs),
            progress=progress,
            say=lambda text: click.echo(text, err=True),
        )
    text = "\n".join([*score_lines(result["held_out"], result["card"]), "", result["text"]])
    _emit({key: result[key] for key in ("files", "held_out", "report", "seconds")}, as_json, text)
