"""Alignment of a shaft line as text."""

import math
from collections.abc import Sequence

from ...sim.alignment.alignment import AlignmentLine, LineState, check, influence
from ...sim.alignment.calibration import Calibration, CalibrationStatus
from ...sim.alignment.jacking import Jacking
from ...sim.alignment.move_programme import Block
from .align import Alignment

_TINY = 5e-6  # m: moves below the last digit shown
_MISLEADS = 0.02  # of the reaction: a larger error of jacking is misleading


def align_text(found: Alignment) -> str:
    """Alignment for a terminal, in mm, kN, MPa and mm/m."""
    blocks = [headline(found), *(_state_text(state) for state in found.states)]
    blocks.append(_influence_text(found))
    if found.calibration is not None:
        blocks.append(_calibration_text(found.calibration, found.margin))
    if found.quiet is not None:
        blocks.append(found.quiet.text)
    if found.jacking is not None:
        blocks.append(jacking_text(found.jacking, found.states[0].condition.name))
    return "\n\n".join(blocks)


def headline(found: Alignment) -> str:
    """Number of limits that are not met, in one sentence."""
    n, unmet = len(found.line.seats), len(found.unmet)
    names = ", ".join(state.condition.name for state in found.states)
    lifted = dict.fromkeys(name for state in found.states for name in state.lifted)
    says = [f"{unmet} of the limits {'is' if unmet == 1 else 'are'} not met" if unmet else _WITHIN]
    if lifted:
        says.append(f"lifted: {', '.join(lifted)}")
    weight = found.line.beam.weight / 1e3
    return f"{found.name}: {n} bearings, {weight:.1f} kN, {names}: {'; '.join(says)}"


_WITHIN = "every limit is met"
COLUMN_HEADS = ("bearing", "station", "offset", "reaction", "share", "pressure", "slope", "limits")
UNITS_OF_COLUMNS = ("", "m", "mm", "kN", "%", "MPa", "mm/m", "kN; MPa; mm/m")


def _state_text(state: LineState) -> str:
    rows = [
        COLUMN_HEADS,
        UNITS_OF_COLUMNS,
        *(bearing_row(state, i) for i in range(len(state.line.seats))),
    ]
    verdicts = ["verdict", "", *(bearing_verdict(state, name) for name in state.line.names)]
    whole = state.reactions.sum() / 1e3
    table = _columns([(*row, verdict) for row, verdict in zip(rows, verdicts, strict=True)])
    return f"{state.condition.name}, {whole:.1f} kN on the bearings\n{table}"


def bearing_row(state: LineState, i: int) -> tuple[str, ...]:
    """Cells of a bearing in one condition, under `COLUMN_HEADS`."""
    seat, load = state.line.seats[i], float(state.reactions[i])
    return (
        seat.name,
        f"{seat.station:.2f}",
        fixed_digits(1e3 * seat.offset, 2),
        _kilonewton(state, i),
        fixed_digits(100 * load / float(state.reactions.sum()), 1),
        fixed_digits(float(state.pressures[i]) / 1e6, 2),
        fixed_digits(1e3 * float(state.relative_slopes[i]), 3),
        _limits_text(state.line, i),
    )


def _limits_text(line: AlignmentLine, i: int) -> str:
    seat = line.seats[i]
    low = f">= {seat.least_load / 1e3:.3g}" if seat.least_load else ""
    high = f"<= {seat.most_load / 1e3:.3g}" if math.isfinite(seat.most_load) else ""
    pressure = f"<= {seat.most_pressure / 1e6:.3g}" if math.isfinite(seat.most_pressure) else "-"
    slope = f"+-{1e3 * seat.most_slope:.3g}" if math.isfinite(seat.most_slope) else "-"
    return f"{f'{low} {high}'.strip() or '-'}; {pressure}; {slope}"


def bearing_verdict(state: LineState, name: str) -> str:
    """Quantities of a bearing beyond their limits, in words."""
    bad = [limit for limit in check(state) if limit.bearing == name and not limit.met]
    words = ["lifted"] if name in state.lifted else []
    words += [
        f"{limit.quantity} too {_WORDS[limit.quantity][limit.value > limit.most]}"
        for limit in bad
        if not (words and limit.quantity == "reaction")
    ]
    return ", ".join(words) or "ok"


_WORDS = {
    "reaction": ("small", "large"),
    "mean pressure": ("small", "large"),
    "slope": ("steep, nose down", "steep, nose up"),
}


def _kilonewton(state: LineState, i: int) -> str:
    """A reaction with digits to a hundredth of the line's mean."""
    mean = float(state.reactions.mean()) / 1e3
    return fixed_digits(float(state.reactions[i]) / 1e3, 1 if mean >= 10 else 2 if mean >= 1 else 3)


def fixed_digits(value: float, digits: int) -> str:
    """A number without negative zeros; a dash for NaN."""
    return "-" if math.isnan(value) else f"{round(value, digits) + 0.0:.{digits}f}"


def _columns(rows: Sequence[Sequence[str]]) -> str:
    """Aligned text columns; the first and those of words are left-aligned."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    left = {0} | {k for k, head in enumerate(rows[0]) if head in ("limits", "verdict", "of")}
    return "\n".join(
        "  ".join(
            cell.ljust(width) if k in left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    )


def _influence_text(found: Alignment) -> str:
    state = found.states[0]
    matrix = influence(found.line, state) / 1e6
    rows = [("", *found.line.names)]
    rows += [
        (name, *(fixed_digits(value, 2) for value in row))
        for name, row in zip(found.line.names, matrix.tolist(), strict=True)
    ]
    head = "influence: change of reaction per mm rise of the bearing in the column, kN/mm"
    if not state.contact.all():
        head += f"\nwith the points in contact of {state.condition.name}"
        head += "; a lifted bearing has none" if state.lifted else ""
    return f"{head}\n{_columns(rows)}"


def _calibration_text(found: Calibration, margin: float) -> str:
    lines = [f"calibration: {found.status.text}"]
    if found.status is not CalibrationStatus.WITHIN:
        lines += move_lines(found)
    lines += [f"  {text}" for text in margin_lines(found, margin)]
    if found.status is CalibrationStatus.WITHIN:
        return "\n".join(lines)
    lines += [f"  not met: {limit.text}" for limit in found.unmet]
    lines += [f"  blocked by: {text}" for text in block_texts(found.blocks)]
    if found.moved:
        lines += ["", "reactions before -> after, kN", _columns(reactions_before_after(found))]
    return "\n".join(lines)


def block_texts(blocks: Sequence[Block]) -> list[str]:
    """One line for each block; contact of a bearing in several conditions is combined."""
    lifting: dict[str, list[str]] = {}
    for block in blocks:
        if block.quantity == "contact":
            lifting.setdefault(block.bearing, []).append(block.condition)
    texts = [block.text for block in blocks if block.quantity != "contact"]
    return texts + [
        f"bearing '{name}', {', '.join(conditions)}: it cannot pull"
        for name, conditions in lifting.items()
    ]


def move_lines(found: Calibration) -> list[str]:
    """A line for each move and turn."""
    lines = []
    for name, move, turn in zip(found.line.names, found.moves, found.turns, strict=True):
        if abs(move) > _TINY:
            lines.append(f"  {'raise' if move > 0 else 'lower'} {name} by {abs(1e3 * move):.2f} mm")
        if abs(turn) > _TINY:
            lines.append(f"  turn the bore of {name} by {1e3 * turn:+.3f} mm/m")
    if not lines and not found.status.ok:
        lines.append("  no move within the bounds brings the limits nearer")
    return lines


def margin_lines(found: Calibration, asked: float) -> list[str]:
    """Margin of the line after the moves, if one was requested or a limit is just reached."""
    if not found.status.ok:
        return []
    kept = f"{100 * found.margin:.3g} %"
    if asked > found.margin:
        return [f"a margin of {100 * asked:.3g} % of each limit cannot be kept; {kept} is"]
    if asked:
        return [f"every limit is kept with a margin of {kept}"]
    names = list(dict.fromkeys(limit.bearing for limit in found.touched))
    if not names:
        return []
    return [
        f"on a limit after the moves: {', '.join(names)}; --margin 0.1 keeps 10 % of it away from "
        "every limit"
    ]


def reactions_before_after(found: Calibration) -> list[tuple[str, ...]]:
    """Cells of the reactions before and after the moves."""
    rows = [("bearing", *(state.condition.name for state in found.before))]
    for i, name in enumerate(found.line.names):
        cells = (
            f"{_kilonewton(old, i)} -> {_kilonewton(new, i)}"
            for old, new in zip(found.before, found.after, strict=True)
        )
        rows.append((name, *cells))
    return rows


def jacking_text(found: Jacking, condition: str) -> str:
    """Reaction of a bearing by jacking next to it, in words."""
    lines = [
        f"jack beside {found.bearing} at {found.station:.3g} m, {condition}",
        f"  {found.first_slope / 1e6:.3g} kN/mm at first, {found.second_slope / 1e6:.3g} kN/mm "
        f"once the bearing is free at {1e3 * found.free_lift:.3g} mm and "
        f"{found.free_load / 1e3:.1f} kN",
        f"  second line at no lift {found.zero_load / 1e3:.1f} kN x correction factor "
        f"{found.correction_factor:.3f} = {found.estimate / 1e3:.1f} kN; the line has "
        f"{found.reaction / 1e3:.1f} kN there",
    ]
    if found.others:
        off = abs(found.estimate - found.reaction) > _MISLEADS * found.reaction
        judged = "is misleading" if off else "is hardly affected"
        lines.append(
            f"  contact changes at {', '.join(found.others)} on the way: the test {judged}"
        )
    return "\n".join(lines)
