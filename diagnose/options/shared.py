"""Shared by commands: types and values of options, exit codes, output as text or JSON.

Heavy imports stay inside the functions, so that ``--help`` answers at once.
"""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ..pages.plain_json import json_text

EXIT_FAILED, EXIT_BAD_INPUT, EXIT_WARNING, EXIT_ALARM, EXIT_UNFAMILIAR = 1, 2, 3, 4, 5


class PathType(click.Path):
    """A non-empty path: an empty one comes from an unset shell variable."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """As in :class:`click.ParamType`."""
        if str(value).strip() == "":
            self.fail("is empty, must be a path; name one", param, ctx)
        return super().convert(value, param, ctx)


class Share(click.FloatRange):
    """A number in a range, which excludes not-a-number."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """As in :class:`click.ParamType`."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value} must be >= {self.min:g} and <= {self.max:g}; try 0.25", param, ctx)
        return number


class Accuracy(Share):
    """A share for all quantities of a scene, or ``verdict=2%`` for the error of a wear estimate."""

    name = "accuracy"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """As in :class:`click.ParamType`: (whether for the verdict, share)."""
        if isinstance(value, tuple):
            return value
        text = str(value).strip()
        of_verdict = text.startswith("verdict=")
        number = text.removeprefix("verdict=")
        if number.endswith("%"):
            try:
                number = repr(float(number[:-1]) / 100)
            except ValueError:
                self.fail(f"{value} is no share; try 0.02, 2% or verdict=2%", param, ctx)
        return of_verdict, super().convert(number, param, ctx)


PATH = PathType(path_type=Path)
MOST_RECORDS = 10**8  # as wearstate.datasets.recipe.recipe, which is too heavy to import for --help
LARGEST_SEED = 2**63 - 1
json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print one JSON object on stdout; an error as one on stderr.",
)
points_option = click.option(
    "--interactive",
    is_flag=True,
    help="Make the page (.html) zoomable; tap a point for its settings.",
)

set_option = click.option(
    "--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value."
)

force_option = click.option("--force", is_flag=True, help="Replace an existing output.")


def _workers(_context: click.Context, _option: click.Parameter, given: int | None) -> int:
    from ...datasets.workers.local import cores

    return given or cores()


jobs_option = click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1),
    default=None,
    callback=_workers,
    help="Worker processes; all cores by default. The result does not depend on it.",
)

records_option = click.option(
    "-n",
    "--records",
    type=click.IntRange(1, MOST_RECORDS),
    default=None,
    help="Number of records; default: as in the recipe.",
)

seed_option = click.option(
    "--seed", type=click.IntRange(0, LARGEST_SEED), default=0, show_default=True
)

join_option = click.option(
    "--join",
    "joined",
    multiple=True,
    metavar="[VIEW=]FILE",
    help="Further tests of the same machines in the same states, used together; repeatable.",
)


def emit(value: dict[str, Any], as_json: bool, text: str) -> None:
    """Print a result, as JSON or as text."""
    click.echo(json_text({"schema_version": 1, **value}) if as_json else text)


def scene_of(name: str, pairs: Sequence[str]) -> Any:
    """The scene of a command with the values of ``--set``; reports the units of bare numbers."""
    from ...sim.scene.load import load_scene

    values = overrides_of(pairs)
    report_bare_units(name, values)
    return load_scene(name, values)


def report_bare_units(name: str, values: Mapping[str, Any]) -> None:
    """Report on stderr the units assumed for numbers without a unit."""
    from ...sim.parts.wording import si_unit
    from ...sim.scene.load import MACHINES, numbered, scene_table, scene_text
    from ...sim.scene.scene import Scene

    bare = {path: value for path, value in values.items() if not isinstance(value, str) and value}
    if not bare:
        return
    table = scene_table(scene_text(name), name)
    kind = MACHINES.get(str(table.get("machine")), Scene)
    for path, value in bare.items():
        unit = si_unit(kind, numbered(table, path))
        if unit:
            click.echo(f"{path} = {_bare_text(value, unit)}", err=True)


def _bare_text(value: float, unit: str) -> str:
    """An SI number with its unit, and in the usual unit.

    Examples
    --------
    >>> _bare_text(300, "rev/s"), _bare_text(0.002, "m"), _bare_text(5, "m/s^2")
    ('300 rev/s = 18,000 rpm', '0.002 m = 2 mm', '5 m/s^2')
    """
    from ..pages.si_text import si_text

    plain = f"{value:g} {unit}"
    usual = f"{60 * value:,.10g} rpm" if unit == "rev/s" else si_text(value, unit, 6)
    return plain if usual == plain else f"{plain} = {usual}"


def overrides_of(pairs: Sequence[str]) -> dict[str, Any]:
    """Values by path from ``path=value`` texts; one that reads as a number is converted."""
    values: dict[str, Any] = {}
    for pair in pairs:
        path, sign, text = pair.partition("=")
        if not sign or not path:
            raise click.BadParameter(f"'{pair}' must read PATH=VALUE", param_hint="--set")
        values[path.strip()] = _number_or_text(text.strip())
    return values


NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")


def _number_or_text(text: str) -> Any:
    """Python would also accept ``1_0`` and ``nan``, which are typing errors here."""
    if not NUMBER.fullmatch(text):
        return text
    whole = re.fullmatch("[-+]?[0-9]{1,18}", text)
    return int(text) if whole else float(text)


def as_options(text: str, command: click.Command | None) -> str:
    """Library messages name arguments; here they become options: ``fs = 0`` is ``--fs = 0``."""
    for param in command.params if command else ():
        option = next((name for name in param.opts if name.startswith("--")), "")
        word = option.removeprefix("--").replace("-", "_")
        for name in {word, param.name, *_OTHER_NAMES.get(option, ())} if option else ():
            text = _with_option(text, str(name), option)
    # an option to be given is written as it is typed
    return re.sub(r"\b(give|with|use) (--[\w-]+) = ", r"\1 \2 ", text)


_OTHER_NAMES = {"--speed-band": ("band_hz",)}
"""Names in functions below the command for the value of an option."""


def _with_option(text: str, word: str, option: str) -> str:
    if "_" in word:
        return re.sub(rf"(?<![\w'-]){word}(?![\w'])", option, text)
    # may be a plain word elsewhere
    others = r"(?:(?:--)?[\w-]+(?: = \w+)?(?:, | and ))*"
    begin = rf"(?:^|: |\b(?:give|with|use) {others})"
    place = rf"(?m)({begin}){word}(?= = | must | to | and | if |[;,)]|$)"
    return re.sub(rf"(; ){word}(?= = )", rf"\1{option}", re.sub(place, rf"\1{option}", text))
