"""Help of the commands: first contact, examples, options in groups, and hints on usage errors."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

FIRST_CONTACT = """wearstate: condition monitoring built around physics. Three ways to begin:

Assess your own recording (a wear model is trained once, see below):
  wearstate import rig.wav --like pump.wsm --unit g -o measured.h5  channels as the model has them
  wearstate report measured.h5 --model pump.wsm -o report.html      grade, wear, what to do

Make a labelled data set, and train on it:
  wearstate generate bilge-pump-small -o data.h5                    simulated machines that wear
  wearstate train data.h5 -o pump.wsm                               judged on unseen machines

Simulate a machine:
  wearstate scene new pump -o mine.toml                             the shortest scene that runs
  wearstate simulate mine.toml --plot mine.png                      one recording of it
  wearstate chart mine.toml -o chart.html                           which models it needs

wearstate demo does it all in a minute; wearstate --help lists the commands, and
wearstate COMMAND --help explains each with examples.
"""

_SOURCE = "Measured file"
_OUTPUT = "Output"
_RUN = "Running"
_GROUPS: dict[str, tuple[str, ...]] = {
    _SOURCE: (
        *("like", "fs", "unit", "sensitivity", "full_scale", "channels", "variable", "tacho"),
        *("pulses_per_revolution", "record", "rows", "delimiter", "decimal", "header"),
        *("time_column", "dtype", "n_channels", "offset", "order", "partial", "resample_to"),
    ),
    _OUTPUT: (
        *("output", "plot", "test_plot", "card", "licence", "applied", "choice", "folder"),
        *("truth", "compress", "fail_on", "force", "as_json"),
    ),
    _RUN: ("seed", "jobs", "scheduler", "budget"),
}
"""Parameters below each heading; all others come first, below "Options"."""

EXAMPLES: dict[str, tuple[str, ...]] = {
    "scene list": ("wearstate scene list", "wearstate scene list --json"),
    "scene show": (
        "wearstate scene show bilge-pump > mine.toml",
        "wearstate scene show shaft-rig",
    ),
    "scene check": (
        "wearstate scene check mine.toml",
        'wearstate scene check bilge-pump --set drive.speed="400 rpm" --deep',
    ),
    "scene explain": (
        "wearstate scene explain pump.pressure.rung",
        "wearstate scene explain bilge-pump joint.crankpin",
    ),
    "scene schema": (
        "wearstate scene schema pump -o pump.json",
        "wearstate scene schema shaft",
    ),
    "scene new": (
        "wearstate scene new pump -o mine.toml",
        "wearstate scene new shaft -o line.toml --force",
    ),
    "simulate": (
        "wearstate simulate bilge-pump --plot pump.png",
        "wearstate simulate mine.toml --set joint.crankpin.diametral_clearance=0.2mm -o rec.h5",
    ),
    "frf": (
        "wearstate frf bilge-pump --plot casing.png",
        "wearstate frf shaft-rig --low 10 --high 500 -o line.csv",
    ),
    "align": (
        "wearstate align propulsion-shaft --set bearings.2.sag=1.6mm -o alignment.html",
        "wearstate align shaft-rig --target even --margin 0.1",
    ),
    "stability": (
        "wearstate stability journal-bearing -o atlas.html",
        "wearstate stability bilge-pump --size 10 --budget 60",
    ),
    "chart": (
        "wearstate chart bilge-pump --set duration=0.8 --budget 120 -o chart.html",
        "wearstate chart data.h5 -o models.html",
    ),
    "sweep": (
        "wearstate sweep bilge-pump --over drive.speed=200..400rpm/3 \\",
        "  --over joint.crankpin.diametral_clearance=.1,.2,.3mm -o sweep.html",
        "wearstate sweep shaft-rig --over bearings.third.sag=0..0.5mm/4",
    ),
    "verify": ("wearstate verify", "wearstate verify --json"),
    "recipe list": ("wearstate recipe list", "wearstate recipe list --json"),
    "recipe show": (
        "wearstate recipe show bilge-pump-small > mine.toml",
        "wearstate recipe show bilge-pump-small --whole",
    ),
    "recipe check": ("wearstate recipe check mine.toml", "wearstate recipe check bilge-pump-small"),
    "recipe explain": ("wearstate recipe explain", "wearstate recipe explain severity.low"),
    "recipe preview": (
        "wearstate recipe preview bilge-pump-small",
        "wearstate recipe preview mine.toml -n 2000 --plot draws.png",
    ),
    "generate": (
        "wearstate generate bilge-pump-small -o data.h5",
        "wearstate generate mine.toml -n 2000 --seed 7 -j 2 -o data.h5",
    ),
    "import": (
        "wearstate import rig.wav --channels acc,key --unit g --tacho key -o measured.h5",
        "wearstate import bearing.mat --list",
    ),
    "merge": (
        "wearstate merge monday.h5 tuesday.h5 -o both.h5",
        "wearstate merge a.h5 b.h5 --duplicates drop -o both.h5",
    ),
    "info": (
        "wearstate info data.h5 --verify --card card.html",
        "wearstate info recording.wav --unit g --plot recording.png",
    ),
    "export": (
        "wearstate export data.h5 -o data.parquet --signals",
        "wearstate export data.h5 --as wav -o folder",
    ),
    "splits": (
        "wearstate splits data.h5",
        "wearstate splits data.h5 --add speed --add machine",
    ),
    "audit": (
        "wearstate audit data.h5",
        "wearstate audit --train train.csv --test test.csv --label grade --fail-on warning",
    ),
    "features": (
        "wearstate features data.h5 -o features.csv",
        "wearstate features data.h5 --rank -o rank.html",
    ),
    "calibrate": (
        "wearstate calibrate mine-sheet.toml healthy.h5 -o mine.toml",
        "wearstate calibrate bilge-pump slow.h5 fast.h5 --unknown 'casing.modes.*' -o mine.toml",
    ),
    "train": (
        "wearstate train data.h5 -o pump.wsm",
        "wearstate train data.h5 --baseline healthy.h5 --held-out 0.3 -o pump.wsm",
    ),
    "evaluate": (
        "wearstate evaluate pump.wsm other.h5 --trained-on data.h5 -o judged.html",
        "wearstate evaluate pump.wsm data.h5 --retrain speed",
    ),
    "report": (
        "wearstate report recording.h5 --model pump.wsm -o report.html",
        "wearstate report folder --model pump.wsm --trend -o trend.html",
    ),
    "blindspots": (
        "wearstate blindspots pump.wsm -o blindspots.html",
        "wearstate blindspots pump.wsm --only casing.modes -n 80",
    ),
    "demo": ("wearstate demo", "wearstate demo --folder trial"),
    "completion": (
        'eval "$(wearstate completion bash)"',
        "wearstate completion fish > ~/.config/fish/completions/wearstate.fish",
    ),
}
"""Example lines by command."""


class HelpfulCommand(click.Command):
    """A command with examples, options in groups, and a hint if an output lacks its option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As in click; usage errors get a hint."""
        given = list(args)  # click consumes them one by one
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            if hint := self._hint(ctx, error, given):
                raise click.UsageError(
                    f"{error.format_message().rstrip('.')}; {hint}", ctx
                ) from None
            raise

    def _hint(self, ctx: click.Context, error: click.UsageError, args: list[str]) -> str:
        """Hint on how to name an output that lacks its option, or where a model comes from."""
        if isinstance(error, click.BadParameter) and not isinstance(error, click.MissingParameter):
            return ""  # its value is wrong, and the error says so
        param = getattr(error, "param", None)
        missing = None if param is None else param.name
        if missing == "model_file":
            return "train one on a labelled data set: wearstate train DATA -o model.wsm"
        if missing not in (None, "output") or "output" not in {each.name for each in self.params}:
            return ""
        try:
            _, extra, _ = self.make_parser(ctx).parse_args(list(args))
        except click.UsageError:
            return ""
        bare = [text for text in extra if Path(text).suffix]
        return f"the output is named by its option: -o {bare[-1]}" if bare else ""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Examples, then the options by group."""
        lines = EXAMPLES.get(ctx.command_path.partition(" ")[2], ())
        if lines:
            with formatter.section("Examples"):
                for line in lines:
                    formatter.write(f"{'':{formatter.current_indent}}{line}\n")
        for heading, rows in self._grouped(ctx).items():
            with formatter.section(heading):
                formatter.write_dl(rows)

    def _grouped(self, ctx: click.Context) -> dict[str, list[tuple[str, str]]]:
        groups: dict[str, list[tuple[str, str]]] = {"Options": [], **{g: [] for g in _GROUPS}}
        heading_of = {name: heading for heading, names in _GROUPS.items() for name in names}
        for param in self.params:
            row = param.get_help_record(ctx) if isinstance(param, click.Option) else None
            if row is not None:
                groups[heading_of.get(param.name or "", "Options")].append(row)
        shown = {heading: rows for heading, rows in groups.items() if rows} or {"Options": []}
        option = self.get_help_option(ctx)
        if option is not None and (row := option.get_help_record(ctx)) is not None:
            shown[list(shown)[-1]].append(row)
        return shown


def command(name: str | None = None) -> Callable[[Callable[..., Any]], HelpfulCommand]:
    """Decorator that makes a function a command with this help."""
    return click.command(name, cls=HelpfulCommand)


class HelpfulGroup(click.Group):
    """A group of commands with this help."""

    command_class = HelpfulCommand
