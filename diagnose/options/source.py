"""Options that declare a measured file: channels, rates, speed, bearing, window."""

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click

from .shared import NUMBER, PATH, Share


def source_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options for a measured file, the same for every command that reads one."""

    @wraps(command)
    def with_profile(*args: Any, like: Path | None = None, **given: Any) -> Any:
        return command(*args, **_filled(like, given))

    found: Callable[..., Any] = with_profile
    for option in reversed(_SOURCE_OPTIONS):
        found = option(found)
    return found


def _filled(like: Path | None, given: dict[str, Any]) -> dict[str, Any]:
    """Options for a file, with those of a profile added; the caller's take precedence."""
    if like is None:
        return {**given, "like": None}
    from ..wear_model.like import read_profile

    profile, tacho, pulses = read_profile(like)
    filled = dict(given)
    if filled["tacho"] is None:
        filled["tacho"] = tacho
    asked = click.get_current_context().get_parameter_source("pulses_per_revolution")
    if asked is click.core.ParameterSource.DEFAULT and filled["tacho"] is not None:
        filled["pulses_per_revolution"] = pulses
    return {**filled, "like": profile}


_SOURCE_OPTIONS = (
    click.option(
        "--like",
        type=PATH,
        metavar="MODEL|JSON",
        help="Take channels, units, rate and tacho from a model or the output of `info --json`.",
    ),
    click.option("--fs", type=float, help="Sample rate [Hz], if the file has none."),
    click.option(
        "--unit",
        multiple=True,
        metavar="[CHANNEL=]UNIT",
        help="Unit of a channel, or of all others, if the file declares none.",
    ),
    click.option(
        "--sensitivity",
        multiple=True,
        metavar="[CHANNEL=]TEXT",
        help="Sensitivity of the sensor on a channel in volts, e.g. '100 mV/g'.",
    ),
    click.option(
        "--full-scale",
        multiple=True,
        metavar="[CHANNEL=]TEXT",
        help="Value of the largest integer of a WAV file, e.g. '10 V'.",
    ),
    click.option(
        "--channels",
        multiple=True,
        metavar="NAME,…",
        help="Channels to read, in order; NEW=OLD renames one. If the file has no names: the "
        "names of all.",
    ),
    click.option(
        "--variable",
        multiple=True,
        help="Array, data set or group to read, if the file holds several; repeatable: several "
        "of one length become channels.",
    ),
    click.option("--tacho", help="Name of the tacho channel."),
    click.option(
        "--pulses-per-revolution",
        type=click.IntRange(1),
        default=1,
        show_default=True,
        help="Pulses of the tacho per revolution.",
    ),
    click.option(
        "--record",
        type=click.IntRange(0),
        default=0,
        help="Record to read, counted from 0, if there are several.",
    ),
    click.option(
        "--rows",
        type=click.Choice(["records"]),
        help="Read each row of an array or a text file as a record of one channel.",
    ),
    click.option("--delimiter", help="Delimiter of a text file: ',', ';', tab or space."),
    click.option("--decimal", type=click.Choice([".", ","]), help="Decimal mark of a text file."),
    click.option(
        "--header", type=click.IntRange(0), help="Number of lines above the numbers of a text file."
    ),
    click.option(
        "--time-column", help="Name or number (from 1) of the time column; 0: there is none."
    ),
    click.option("--dtype", help="Number type of headerless binary, e.g. '<int16', '>float32'."),
    click.option(
        "--n-channels", type=click.IntRange(1), help="Number of channels of headerless binary."
    ),
    click.option(
        "--offset", type=click.IntRange(0), default=0, help="Bytes to skip in headerless binary."
    ),
    click.option(
        "--order",
        type=click.Choice(["interleaved", "blocks"]),
        help="Order of binary and arrays: sample by sample, or channel by channel.",
    ),
    click.option(
        "--partial",
        is_flag=True,
        help="Read the existing samples of a WAV, TDMS or binary file that was cut short.",
    ),
    click.option(
        "--resample-to", type=float, metavar="HZ", help="Resample measured files to this rate."
    ),
)


def declared_source(given: Mapping[str, Any]) -> Any:
    """Options for a measured file, in the form of the library."""
    from ...datasets.source.part import SourceOptions

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
    *("fs", "record", "rows", "delimiter", "decimal", "header"),
    *("dtype", "n_channels", "offset", "order", "resample_to", "partial", "like"),
)


def _each_channel(texts: Sequence[str], option: str) -> Any:
    """``channel=value`` for one channel, ``value`` for the others; None without any."""
    from ...datasets.measured.plan import EachChannel

    named: dict[str, str] = {}
    others: list[str] = []
    for text in texts:
        name, sign, value = text.rpartition("=")
        if not value.strip() or (sign and not name) or name in named:
            raise click.BadParameter(
                f"'{text}' must read [CHANNEL=]VALUE, once per channel", param_hint=option
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


def texts_by_channel(texts: Sequence[str], option: str) -> dict[str, str]:
    """Texts by channel from ``channel=text``, once per channel."""
    texts_of: dict[str, str] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if not name.strip() or not value.strip() or name in texts_of:
            raise click.BadParameter(
                f"'{text}' must read CHANNEL=TEXT, once per channel", param_hint=option
            )
        texts_of[name] = value
    return texts_of


class Numbers(click.ParamType):  # type: ignore[type-arg]
    """Numbers separated by commas."""

    name = "numbers"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Text to a tuple of floats."""
        if not isinstance(value, str):
            return value
        try:
            return tuple(float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} must be numbers separated by commas", param, ctx)


speed_option = click.option(
    "--speed-hz",
    type=float,
    help="Shaft speed [Hz] if there is no tacho; default: the one stored in the file.",
)


class BearingNumbers(Numbers):
    """Rollers, two lengths and an angle, each with or without its unit."""

    name = "bearing"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Text to numbers: lengths in metres, the angle in degrees."""
        from ...sim.parts.units import to_si

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


bearing_option = click.option(
    "--bearing",
    type=BearingNumbers(),
    metavar="N,d,D[,DEG]",
    help="Rolling bearing, for its fault frequencies: number and diameter of the rollers, pitch "
    "diameter, contact angle.",
)

exponential_option = click.option(
    "--exponential",
    type=Share(1e-6, 1.0),
    default=1.0,
    help="Impact test: value of the exponential window at the end of a block, 1 for none; damping "
    "is corrected for it.",
)
