"""Meaning of the numbers of a part: rate, channels and units, from file and caller together."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from ...sim.output.recording import DataError
from ...sim.output.sensor import rate_fault
from ...sim.parts.wording import nearest
from .channel_units import FULL_SCALE, ChannelUnit, parse_sensitivity, parse_unit
from .chosen import new_and_old, wanted_channels
from .part import MOST_CHANNELS, FilePart, Profile, Source, SourceChannel, SourceOptions


def refuse_unread(file: Path, part: FilePart, options: SourceOptions) -> None:
    """Refuse unreadable numbers, unless the channels are chosen without them."""
    wanted = wanted_channels(options)
    chosen = {new_and_old(entry)[1] or entry for entry in wanted}
    faults = [text for name, text in part.unread.items() if not wanted or name in chosen]
    if faults:
        raise DataError("\n".join(f"{file}: {text}" for text in faults))


def settled_source(
    file: Path, part: FilePart, options: SourceOptions, close: Callable[[], None]
) -> Source:
    """Source from a part and the options; all faults at once."""
    faults: list[str] = []
    missing: list[str] = []
    rate = _rate(part, options, faults, missing)
    like = options.like
    _refuse_unlike(rate, options, faults)
    whose = "" if options.channels or like is None else f" (of {like.source})"
    rows, names = _rows(part, wanted_channels(options), faults, whose)
    _refuse_unknown_names(part, options, names, faults)
    meanings = [
        _meaning(part, row, name, options, faults, missing)
        for row, name in zip(rows, names, strict=True)
    ]
    if part.n_samples < 1:
        faults.append(f"{part.name or 'the recording'} has 0 samples, must be >= 1; take another")
    if faults:
        raise DataError("\n".join(f"{file}: {fault}" for fault in faults))
    return Source(
        path=file,
        part=part.name,
        channels=tuple(channel for channel, _ in meanings),
        named=part.named or bool(options.channels),
        n_records=part.n_records,
        empty=part.empty,
        sample_rate=rate,
        n_samples=part.n_samples,
        conditions=part.conditions,
        undeclared=tuple(missing),
        fetch=part.fetch,
        rows=tuple(rows),
        factors=tuple(factor for _, factor in meanings),
        close=close,
    )


def _rate(
    part: FilePart, options: SourceOptions, faults: list[str], missing: list[str]
) -> float | None:
    given = options.fs
    declared = None if part.sample_rate is None else _whole(part.sample_rate, part.rate_doubt)
    if declared is not None and (fault := rate_fault("sample_rate", declared, _OTHER_RATE)):
        faults.append(fault)
        return None
    if declared is None:
        if given is None and options.like is not None:
            _refuse_other_rate(part, options.like, faults)
            return options.like.sample_rate
        if given is None:
            note = f" ({part.rate_note})" if part.rate_note else ""
            missing.append(f"fs must be given; the file does not declare the sample rate{note}")
        return given
    if given is None or given == declared:
        return declared
    if abs(given - declared) <= part.rate_doubt * declared:
        return given  # the file prints the same rate with fewer digits
    faults.append(
        f"fs = {given:.10g} Hz must be {declared:.10g} Hz, as declared"
        f"{f' ({part.known_as})' if part.known_as else ''}; leave it out"
    )
    return None


def _refuse_other_rate(part: FilePart, like: Profile, faults: list[str]) -> None:
    """Refuse to replace a different rate that the file seems to have by that of a profile."""
    if part.rate_seen is not None and abs(part.rate_seen / like.sample_rate - 1) > _SAME_RATE:
        faults.append(
            f"sample rate = {like.sample_rate:.10g} Hz of {like.source} stands for what the file "
            f"does not declare, but {part.rate_note}"
        )


def _refuse_unlike(rate: float | None, options: SourceOptions, faults: list[str]) -> None:
    """Refuse a rate that differs from the profile's, unless the caller requests one."""
    if options.like is None or rate is None or options.resample_to is not None:
        return
    wanted = options.like.sample_rate
    if abs(rate / wanted - 1) > _SAME_RATE:
        cure = f"give --resample-to {wanted:.10g}"
        if rate < wanted:
            cure = "record at that rate: resampling upwards adds no bandwidth"
        faults.append(
            f"sample rate = {rate:.10g} Hz must be {wanted:.10g} Hz, as in {options.like.source}; "
            f"{cure}"
        )


_SAME_RATE = 1e-5  # relative, as for rates derived from printed times
_OTHER_RATE = "take an intact copy, or correct the unit of the time"


def _whole(rate: float, doubt: float) -> float:
    """The only whole number of hertz that the printed digits allow, or else the rate unchanged."""
    if not math.isfinite(rate) or math.ceil(rate * (1 - doubt)) != math.floor(rate * (1 + doubt)):
        return rate
    return float(math.ceil(rate * (1 - doubt)))


def _rows(
    part: FilePart, wanted: Sequence[str], faults: list[str], whose: str
) -> tuple[list[int], list[str]]:
    """Rows of the part to read, and their names; `whose` is the origin of names, for messages."""
    there = [channel.name for channel in part.channels]
    rows, names = list(range(len(there))), list(there)
    if len(there) > MOST_CHANNELS or not there:
        faults.append(f"has {len(there)} channels, must be >= 1 and <= {MOST_CHANNELS}; split it")
        return [], []
    shown = [e if e in there else new_and_old(e)[1] or e for e in wanted]
    if dead := [name for name in shown if name in part.empty]:
        faults += [
            f"channel {n!r} holds nothing but NaN, must hold numbers; leave it" for n in dead
        ]
        return [], []
    if wanted and not part.named and not all(name in there for name in shown):
        names = list(wanted)
        if len(names) != len(there):
            many = "the one channel" if len(there) == 1 else f"all {len(there)} channels"
            faults.append(
                f"channels = {', '.join(names)}{whose} must name {many}, "
                f"which the file leaves unnamed, or choose of {', '.join(there[:_SHOWN_NAMES])} as "
                "new=old"
            )
            return [], []
    elif wanted:
        pairs = [(e, e) if e in there or "=" not in e else new_and_old(e) for e in wanted]
        unknown = [old for _, old in pairs if old not in there]
        faults += [f"has no channel {old!r}{nearest(old, there)}" for old in unknown]
        if unknown:
            return [], []
        rows, names = [there.index(old) for _, old in pairs], [new for new, _ in pairs]
    twice = sorted({name for name in names if names.count(name) > 1 or not name})
    if twice:
        cure = "choose with variable" if part.named and not wanted else "give channels other names"
        faults.append(f"channel names {twice} must be unique and not empty; {cure}")
    return rows, names


_SHOWN_NAMES = 8


def _refuse_unknown_names(
    part: FilePart, options: SourceOptions, names: Sequence[str], faults: list[str]
) -> None:
    """Refuse declarations for names that are not channels, now or before renaming."""
    known = {*names, *(channel.name for channel in part.channels), *part.extras, *part.empty}
    for what in _MEANINGS:
        given = getattr(options, what)
        for name in given if isinstance(given, Mapping) else ():
            if name not in known:
                faults.append(f"{what} of {name!r} has no channel{nearest(name, sorted(known))}")


_MEANINGS: tuple[Literal["unit", "sensitivity", "full_scale"], ...] = (
    "unit",
    "sensitivity",
    "full_scale",
)
"""Options that declare the value of a number."""


def _meaning(
    part: FilePart,
    row: int,
    name: str,
    options: SourceOptions,
    faults: list[str],
    missing: list[str],
) -> tuple[SourceChannel, float]:
    """Channel in SI and the factor to it."""
    declared = part.channels[row].unit
    given = options.per_channel("unit", name)
    blank = SourceChannel(name=name, unit_in_file=declared or "")
    if declared is not None and given is not None and _differ(declared, given):
        known = f" ({part.known_as})" if part.known_as else ""
        faults.append(
            f"channel '{name}': unit = {given} must be {declared}{known}, as declared; leave it out"
        )
        return blank, 1.0
    try:
        text = given if given is not None else declared
        if text is None and options.like is not None and part.bits == 0:
            text = options.like.units.get(name)
        unit, origin = _unit_of(part, text, options.per_channel("full_scale", name))
        unit, origin = _sensed(unit, origin, options.per_channel("sensitivity", name))
    except LookupError as error:
        missing.append(f"channel '{name}': {error.args[0]}")
        return blank, 1.0
    except ValueError as error:
        stated = (options.per_channel(what, name) for what in _MEANINGS)
        # a wrong declaration in the file can still be listed, and be replaced by the caller
        quiet = all(text is None for text in stated)
        (missing if quiet else faults).append(f"channel '{name}': {error}")
        return blank, 1.0
    channel = SourceChannel(
        name=name, unit=unit.symbol, quantity=unit.quantity, unit_in_file=origin
    )
    return channel, unit.factor


def _differ(declared: str, given: str) -> bool:
    """Whether two declarations contradict each other; one that cannot be parsed does not."""
    try:
        known = parse_unit(declared)
    except ValueError:
        return False
    try:
        return known != parse_unit(given)
    except ValueError:
        return True


def _unit_of(part: FilePart, text: str | None, full_scale: str | None) -> tuple[ChannelUnit, str]:
    """Unit of a number of the file, and its text."""
    if part.bits == 0:
        if full_scale is not None:
            raise ValueError(
                f"full_scale = {full_scale!r} does not fit floats, which stand for themselves; "
                "give unit"
            )
        if text is None:
            raise LookupError("unit must be given; the file does not declare it")
        return parse_unit(text), text
    steps = 2.0 ** (part.bits - 1)
    if full_scale is None and text is None:
        raise LookupError(
            f"full_scale must be given ('10 V', '50 g': what an integer of {steps:.0f} is worth), "
            "or unit 'FS'; the file does not declare it"
        )
    unit = parse_unit(full_scale or text or "")
    if full_scale is None and unit.symbol != FULL_SCALE:
        raise ValueError(
            f"unit = {text!r} does not say what an integer is worth; give full_scale like '50 g', "
            f"the worth of {steps:.0f}, or unit 'FS'"
        )
    origin = f"{full_scale} full scale" if full_scale is not None else FULL_SCALE
    return replace(unit, factor=unit.factor / steps), origin


def _sensed(unit: ChannelUnit, origin: str, sensitivity: str | None) -> tuple[ChannelUnit, str]:
    """Quantity that the sensor measured, for a channel in volts."""
    if sensitivity is None:
        return unit, origin
    sensor = parse_sensitivity(sensitivity)
    if unit.quantity != "voltage":
        raise ValueError(
            f"sensitivity = {sensitivity!r} needs a channel in V, is in {origin}; leave it out"
        )
    return replace(sensor, factor=sensor.factor * unit.factor), f"{origin} at {sensitivity}"
