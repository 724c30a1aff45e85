"""The alignment of a shaft line: as a table for JSON, as text, as a picture, as one HTML page."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...sim.alignment.alignment import (
    AlignmentError,
    AlignmentLine,
    Check,
    Condition,
    LineState,
    check,
    influence,
    reactions,
)
from ...sim.alignment.calibration import Calibration, CalibrationStatus, calibrate
from ...sim.alignment.jacking import Jacking, jacking
from ...sim.alignment.move_programme import Block
from ...sim.brief import brief
from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.on_oil_films import ShaftFilmError
from ...sim.shaft.recording import alignment_conditions, alignment_line
from ..pages.page import render, save_page, short_name
from ..pages.picture import PageImage, drawn_alone, page_image, save_picture
from ..shaft_tests.before_after import EXPECTED, BeforeAfter, rig_text
from ..shaft_tests.measured_tests import LineTest
from ..shaft_tests.rig_figure import rig_figure
from ..shaft_tests.sag_report import SagReport, next_texts, sag_images, sag_rows
from .films import (
    FILM_HEAD,
    LineFilms,
    film_cells,
    film_rows,
    film_states,
    pressure_images,
    resting,
    transfer_images,
)
from .margins import jack_cells, jack_rows, margin_cells, margin_rows
from .quiet_moves import QuietMoves, quiet_moves

ALIGN_SCHEMA = 1

_BEFORE, _AFTER, _LIMIT = "#1f5a94", "#b3541e", "#7a828b"
_TINY = 5e-6  # m, of a move: less than the last digit shown
_MISLEADS = 0.02  # of a reaction, when jacking says another


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment:
    """What `wearstate align` found, before it is put in words.

    Attributes
    ----------
    scene : ShaftScene
    line : AlignmentLine
    states : tuple of LineState
        One for each condition, as the line is set.
    calibration : Calibration or None
    jacking : Jacking or None
        In the first condition.
    margin : float
        Share of each limit that was asked for as a distance from it.
    quiet : QuietMoves or None
        What the moves do to the vibration, where that was the target.
    """

    scene: ShaftScene
    line: AlignmentLine
    states: tuple[LineState, ...]
    calibration: Calibration | None
    jacking: Jacking | None
    margin: float = 0.0
    quiet: QuietMoves | None = None

    __repr__ = brief("name", "verdict")

    @property
    def name(self) -> str:
        """Of the scene."""
        return self.scene.name

    @property
    def proposed(self) -> tuple[dict[str, float], dict[str, float]]:
        """Moves [m] and turns [rad] by bearing; empty where none are proposed."""
        found = self.calibration
        if found is None or not found.moved:
            return {}, {}
        names = found.line.names
        moves, turns = (
            dict(zip(names, map(float, values), strict=True))
            for values in (found.moves, found.turns)
        )
        return moves, turns

    @property
    def unmet(self) -> tuple[Check, ...]:
        """Limits that the line, as it is set, does not keep."""
        return tuple(limit for state in self.states for limit in check(state) if not limit.met)

    @property
    def verdict(self) -> str:
        """``within``; ``alarm`` where a bearing lifts or no moves help; else ``warning``."""
        stuck = self.calibration is not None and not self.calibration.status.ok
        if stuck or any(state.lifted for state in self.states):
            return "alarm"
        return "warning" if self.unmet else "within"


def align(
    scene: Scene,
    *,
    condition: str = "all",
    mend: bool = True,
    prefer: str = "least",
    target: str = "limits",
    margin: float = 0.0,
    jack: str | None = None,
) -> Alignment:
    """Judge the alignment of a scene, and find the moves that mend it.

    Parameters
    ----------
    scene : Scene
        Of the machine propulsion-shaft.
    condition : str
        A name of the scene's conditions, or "all".
    mend : bool
        Look for moves.
    prefer, target : str
        As of :func:`wearstate.sim.alignment.calibration.calibrate`; the target "vibration" is that
        of :func:`wearstate.diagnose.alignment.quiet_moves.quiet_moves`.
    margin : float
        As of :func:`wearstate.sim.alignment.calibration.calibrate`.
    jack : str, optional
        Bearing to jack.

    Returns
    -------
    Alignment
        States, moves and verdict.

    Raises
    ------
    AlignmentError
        The scene is no shaft line, its line cannot rest, or a name is unknown.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> align(load_scene("propulsion-shaft")).verdict
    'within'
    """
    if not isinstance(scene, Scene):
        raise AlignmentError(f"scene = {scene!r} must be a scene; wearstate.load_scene reads one")
    if not isinstance(scene, ShaftScene):
        raise AlignmentError(
            f"machine of scene '{scene.name}' = '{scene.machine}' must be 'propulsion-shaft'; "
            "only a shaft line has an alignment"
        )
    line, conditions = _line_of(scene), _conditions_of(scene, condition)
    states = tuple(reactions(line, one) for one in conditions)
    calibration = quiet = None
    if mend:
        aim = "limits" if target == "vibration" else target
        calibration = calibrate(line, conditions, prefer=prefer, target=aim, margin=margin)
    if calibration is not None and target == "vibration":
        quiet = quiet_moves(scene, calibration, margin=margin)
        calibration = quiet.calibration
    return Alignment(
        scene=scene,
        line=line,
        states=states,
        calibration=calibration,
        jacking=jacking(line, jack, conditions[0]) if jack is not None else None,
        margin=margin,
        quiet=quiet,
    )


def _line_of(scene: ShaftScene) -> AlignmentLine:
    try:
        return alignment_line(scene)
    except ValueError as error:  # of the beam: stations that do not go together
        raise AlignmentError(f"scene '{scene.name}': {error}") from None


def _conditions_of(scene: ShaftScene, name: str) -> list[Condition]:
    found = alignment_conditions(scene)
    if name == "all":
        return list(found.values())
    if name not in found:
        raise AlignmentError(
            f"condition = '{name}' must be 'all' or one of {', '.join(found)}; choose one of them"
        )
    return [found[name]]


# --- JSON


def align_table(found: Alignment) -> dict[str, Any]:
    """Everything `wearstate align` says, in SI, ready for JSON.

    Returns
    -------
    dict
        ``schema_version``, ``scene``, ``verdict``, ``bearings``, ``conditions`` (the line as it
        is set), ``influence_n_per_m``, ``margins``, ``jacks``, ``films`` at three speeds,
        ``calibration``, ``vibration`` and ``jacking``, the last three null where not asked for.
    """
    return {
        "schema_version": ALIGN_SCHEMA,
        "scene": found.name,
        "verdict": found.verdict,
        "weight_n": found.line.beam.weight,
        "bearings": [_seat_row(found.line, i) for i in range(len(found.line.seats))],
        "conditions": [_state_rows(state) for state in found.states],
        "influence_n_per_m": influence(found.line, found.states[0]).tolist(),
        "margins": margin_rows(found.states, _after(found)),
        "jacks": jack_rows(found.states, found.calibration),
        "films": film_rows(film_states(found.scene, *found.proposed)),
        "calibration": _calibration_table(found.calibration),
        "vibration": None if found.quiet is None else _quiet_table(found.quiet),
        "jacking": None if found.jacking is None else _jacking_table(found.jacking),
    }


def _after(found: Alignment) -> tuple[LineState, ...]:
    moved = found.calibration is not None and found.calibration.moved
    return found.calibration.after if found.calibration is not None and moved else ()


def _seat_row(line: AlignmentLine, i: int) -> dict[str, Any]:
    seat = line.seats[i]
    return {
        "name": seat.name,
        "station_m": seat.station,
        "offset_m": seat.offset,
        "slope_rad": seat.slope,
        "points": seat.points,
        "least_load_n": seat.least_load,
        "most_load_n": seat.highest_load,
        "most_pressure_pa": seat.most_pressure,
        "most_slope_rad": seat.most_slope,
        "least_move_m": seat.least_move,
        "most_move_m": seat.most_move,
    }


def _state_rows(state: LineState) -> dict[str, Any]:
    unmet = [limit for limit in check(state) if not limit.met]
    owner = state.line.held.owner
    whole = float(state.reactions.sum())
    return {
        "name": state.condition.name,
        "load_n": whole,
        "bearings": [
            {
                "name": name,
                "reaction_n": float(state.reactions[i]),
                "share": float(state.reactions[i]) / whole,
                "point_reactions_n": state.point_reactions[owner == i].tolist(),
                "mean_pressure_pa": float(state.pressures[i]),
                "edge_pressure_pa": float(state.edge_pressures[i]),
                "slope_rad": float(state.relative_slopes[i]),
                "lifted": name in state.lifted,
                "unmet": [limit.text for limit in unmet if limit.bearing == name],
            }
            for i, name in enumerate(state.line.names)
        ],
    }


def _calibration_table(found: Calibration | None) -> dict[str, Any] | None:
    if found is None:
        return None
    names = found.line.names
    return {
        "status": found.status.name.lower(),
        "text": found.status.text,
        "moves_m": dict(zip(names, found.moves.tolist(), strict=True)),
        "turns_rad": dict(zip(names, found.turns.tolist(), strict=True)),
        "total_move_m": found.total_move,
        "conditions": [_state_rows(state) for state in found.after],
        "unmet": [limit.text for limit in found.unmet],
        "blocks": [block.text for block in found.blocks],
        "margin": found.margin,
        "touched": [limit.text for limit in found.touched],
    }


def _quiet_table(found: QuietMoves) -> dict[str, Any]:
    return {
        "text": found.text,
        "before_rms_m_per_s2": found.before.tolist(),
        "after_rms_m_per_s2": found.after.tolist(),
    }


def _jacking_table(found: Jacking) -> dict[str, Any]:
    return {
        "bearing": found.bearing,
        "station_m": found.station,
        "lifts_m": found.lifts.tolist(),
        "loads_n": found.loads.tolist(),
        "first_slope_n_per_m": found.first_slope,
        "second_slope_n_per_m": found.second_slope,
        "free_lift_m": found.free_lift,
        "free_load_n": found.free_load,
        "zero_load_n": found.zero_load,
        "correction_factor": found.correction_factor,
        "estimate_n": found.estimate,
        "reaction_n": found.reaction,
        "others": list(found.others),
    }


# --- text


def align_text(found: Alignment) -> str:
    """The same for a terminal, in mm, kN, MPa and mm/m."""
    blocks = [_headline(found), *(_state_text(state) for state in found.states)]
    blocks.append(_influence_text(found))
    if found.calibration is not None:
        blocks.append(_calibration_text(found.calibration, found.margin))
    if found.quiet is not None:
        blocks.append(found.quiet.text)
    if found.jacking is not None:
        blocks.append(_jacking_text(found.jacking, found.states[0].condition.name))
    return "\n\n".join(blocks)


def _headline(found: Alignment) -> str:
    n, unmet = len(found.line.seats), len(found.unmet)
    names = ", ".join(state.condition.name for state in found.states)
    lifted = dict.fromkeys(name for state in found.states for name in state.lifted)
    says = [f"{unmet} of the limits {'is' if unmet == 1 else 'are'} not met" if unmet else _WITHIN]
    if lifted:
        says.append(f"lifted: {', '.join(lifted)}")
    weight = found.line.beam.weight / 1e3
    return f"{found.name}: {n} bearings, {weight:.1f} kN, {names}: {'; '.join(says)}"


_WITHIN = "every limit is met"
_HEAD = ("bearing", "station", "offset", "reaction", "share", "pressure", "slope", "limits")
_UNIT = ("", "m", "mm", "kN", "%", "MPa", "mm/m", "kN; MPa; mm/m")


def _state_text(state: LineState) -> str:
    rows = [_HEAD, _UNIT, *(_bearing_row(state, i) for i in range(len(state.line.seats)))]
    verdicts = ["verdict", "", *(_verdict(state, name) for name in state.line.names)]
    whole = state.reactions.sum() / 1e3
    table = _columns([(*row, verdict) for row, verdict in zip(rows, verdicts, strict=True)])
    return f"{state.condition.name}, {whole:.1f} kN on the bearings\n{table}"


def _bearing_row(state: LineState, i: int) -> tuple[str, ...]:
    seat, load = state.line.seats[i], float(state.reactions[i])
    return (
        seat.name,
        f"{seat.station:.2f}",
        _fixed(1e3 * seat.offset, 2),
        _kilonewton(state, i),
        _fixed(100 * load / float(state.reactions.sum()), 1),
        _fixed(float(state.pressures[i]) / 1e6, 2),
        _fixed(1e3 * float(state.relative_slopes[i]), 3),
        _limits_text(state.line, i),
    )


def _limits_text(line: AlignmentLine, i: int) -> str:
    seat = line.seats[i]
    low = f">= {seat.least_load / 1e3:.3g}" if seat.least_load else ""
    high = f"<= {seat.most_load / 1e3:.3g}" if math.isfinite(seat.most_load) else ""
    pressure = f"<= {seat.most_pressure / 1e6:.3g}" if math.isfinite(seat.most_pressure) else "-"
    slope = f"+-{1e3 * seat.most_slope:.3g}" if math.isfinite(seat.most_slope) else "-"
    return f"{f'{low} {high}'.strip() or '-'}; {pressure}; {slope}"


def _verdict(state: LineState, name: str) -> str:
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
    """A reaction with digits that tell a hundredth of the line's mean."""
    mean = float(state.reactions.mean()) / 1e3
    return _fixed(float(state.reactions[i]) / 1e3, 1 if mean >= 10 else 2 if mean >= 1 else 3)


def _fixed(value: float, digits: int) -> str:
    """A number without a minus in front of zeros; a dash where there is none."""
    return "-" if math.isnan(value) else f"{round(value, digits) + 0.0:.{digits}f}"


def _columns(rows: Sequence[Sequence[str]]) -> str:
    """Text columns, the first and those after the last number to the left."""
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
        (name, *(_fixed(value, 2) for value in row))
        for name, row in zip(found.line.names, matrix.tolist(), strict=True)
    ]
    head = "influence: change of reaction per mm that the bearing above rises, kN/mm"
    if not state.contact.all():
        head += f"\nwith the points in contact of {state.condition.name}"
        head += "; a lifted bearing has none" if state.lifted else ""
    return f"{head}\n{_columns(rows)}"


def _calibration_text(found: Calibration, margin: float) -> str:
    lines = [f"calibration: {found.status.text}"]
    if found.status is not CalibrationStatus.WITHIN:
        lines += _move_lines(found)
    lines += [f"  {text}" for text in _margin_lines(found, margin)]
    if found.status is CalibrationStatus.WITHIN:
        return "\n".join(lines)
    lines += [f"  not met: {limit.text}" for limit in found.unmet]
    lines += [f"  blocked by: {text}" for text in _block_texts(found.blocks)]
    if found.moved:
        lines += ["", "reactions before -> after, kN", _columns(_before_after(found))]
    return "\n".join(lines)


def _block_texts(blocks: Sequence[Block]) -> list[str]:
    """One line for each block; contact of a bearing in several conditions is one."""
    lifting: dict[str, list[str]] = {}
    for block in blocks:
        if block.quantity == "contact":
            lifting.setdefault(block.bearing, []).append(block.condition)
    texts = [block.text for block in blocks if block.quantity != "contact"]
    return texts + [
        f"bearing '{name}', {', '.join(conditions)}: it cannot pull"
        for name, conditions in lifting.items()
    ]


def _move_lines(found: Calibration) -> list[str]:
    lines = []
    for name, move, turn in zip(found.line.names, found.moves, found.turns, strict=True):
        if abs(move) > _TINY:
            lines.append(f"  {'raise' if move > 0 else 'lower'} {name} by {abs(1e3 * move):.2f} mm")
        if abs(turn) > _TINY:
            lines.append(f"  turn the bore of {name} by {1e3 * turn:+.3f} mm/m")
    if not lines and not found.status.ok:
        lines.append("  no move within its bounds brings them nearer")
    return lines


def _margin_lines(found: Calibration, asked: float) -> list[str]:
    """How far from the limits the line is after the moves, where that was asked or is nothing."""
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


def _before_after(found: Calibration) -> list[tuple[str, ...]]:
    rows = [("bearing", *(state.condition.name for state in found.before))]
    for i, name in enumerate(found.line.names):
        cells = (
            f"{_kilonewton(old, i)} -> {_kilonewton(new, i)}"
            for old, new in zip(found.before, found.after, strict=True)
        )
        rows.append((name, *cells))
    return rows


def _jacking_text(found: Jacking, condition: str) -> str:
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
        judged = "misleads" if off else "is hardly touched"
        lines.append(
            f"  contact changes at {', '.join(found.others)} on the way: the test {judged}"
        )
    return "\n".join(lines)


# --- picture and page


def align_figure(found: Alignment) -> Any:
    """Deflection with the bearings, bending moment and reactions, as set and after the moves.

    Returns
    -------
    matplotlib.figure.Figure
        Of the first condition; reactions of all.
    """
    from matplotlib.figure import Figure

    rows = 4 if found.jacking is not None else 3
    figure = Figure(figsize=(10, 3 * rows), layout="constrained")
    names = ", ".join(state.condition.name for state in found.states)
    figure.suptitle(f"{short_name(found.name, 60)}: alignment (computed), {names}")
    axes = figure.subplots(rows, 1)
    _draw_deflection(axes[0], found)
    _draw_moment(axes[1], found)
    _draw_reactions(axes[2], found)
    if found.jacking is not None:
        _draw_jacking(axes[3], found.jacking)
    return figure


def align_images(found: Alignment) -> list[PageImage]:
    """The panels of :func:`align_figure` as pictures of a page."""
    draws = [_draw_deflection, _draw_moment, _draw_reactions]
    images = [drawn_alone(partial(draw, found=found), height=3.4) for draw in draws]
    if found.jacking is not None:
        images.append(drawn_alone(partial(_draw_jacking, found=found.jacking), height=3.4))
    return images


def save_figure(found: Alignment, path: Path, *, force: bool = True) -> None:
    """Draw :func:`align_figure` into a .png, .svg or .pdf file."""
    save_picture(align_figure(found), path, force=force)


def _drawn(found: Alignment) -> list[tuple[LineState, str, str]]:
    """States of the first condition with label and colour: as set, and mended."""
    name = found.states[0].condition.name
    drawn = [(found.states[0], f"{name}, as set", _BEFORE)]
    if found.calibration is not None and found.calibration.moved:
        drawn.append((found.calibration.after[0], f"{name}, after the moves", _AFTER))
    return drawn


def _draw_deflection(axes: Any, found: Alignment) -> None:
    for state, label, colour in _drawn(found):
        axes.plot(state.line.beam.stations, 1e3 * state.deflections, color=colour, label=label)
        for seat, rise in zip(state.line.seats, _rises(state), strict=True):
            half = max(seat.length / 2, 0.01 * state.line.beam.length)
            height = np.array([seat.offset + rise - seat.slope * half])
            ends = 1e3 * np.concatenate([height, height + 2 * half * seat.slope])
            middle = np.array([seat.station - half, seat.station + half])
            axes.plot(middle, ends, color=colour, lw=4, alpha=0.5, solid_capstyle="butt")
    for seat in found.line.seats:
        name, place = short_name(seat.name, 20), (seat.station, 1.02)
        axes.annotate(name, place, color=_NAMES, **_above(axes))
    # names stand below the title
    pad = 62.0 if _is_narrow(axes) else 18.0
    _finish(axes, "height [mm]", "Shaft and bottoms of the bores", pad=pad)


def _is_narrow(axes: Any) -> bool:
    """Whether names of bearings side by side would overlap."""
    return bool(axes.get_figure().get_figwidth() < _ROOM_FOR_NAMES)


_ROOM_FOR_NAMES = 8.0  # [inch]
_NAMES = "#49535e"


def _above(axes: Any) -> dict[str, Any]:
    """How names stand above the axes, slanted where they have no room."""
    place = {"xycoords": ("data", "axes fraction"), "fontsize": 8}
    return place | ({"rotation": 35, "ha": "left"} if _is_narrow(axes) else {"ha": "center"})


def _rises(state: LineState) -> Sequence[float]:
    return state.condition.rises or [0.0] * len(state.line.seats)


def _draw_moment(axes: Any, found: Alignment) -> None:
    for state, label, colour in _drawn(found):
        axes.plot(state.cut_stations, state.moments / 1e3, color=colour, label=label)
    axes.axhline(0, color="black", lw=0.6)
    _finish(axes, "moment [kN m]", "Bending moment, positive where the shaft sags")


def _draw_reactions(axes: Any, found: Alignment) -> None:
    """Bars of every condition, as set and after; dashes at the limits."""
    n, mended = len(found.line.seats), found.calibration
    pairs = [(state, _BEFORE) for state in found.states]
    if mended is not None and mended.moved:
        pairs = [p for old, new in zip(mended.before, mended.after, strict=True)
                 for p in ((old, _BEFORE), (new, _AFTER))]  # fmt: skip
    width = 0.8 / len(pairs)
    for k, (state, colour) in enumerate(pairs):
        at = np.arange(n) - 0.4 + (k + 0.5) * width
        axes.bar(at, state.reactions / 1e3, 0.9 * width, color=colour)
        for x, load in zip(at, state.reactions / 1e3, strict=True):
            axes.annotate(f" {state.condition.name}", (x, load), **_ABOVE)
    for i, seat in enumerate(found.line.seats):
        for bound in (seat.least_load, seat.highest_load):
            if 0 < bound < math.inf:
                axes.hlines(bound / 1e3, i - 0.45, i + 0.45, color=_LIMIT, ls="--", lw=1)
    highest = max(float(state.reactions.max()) for state, _ in pairs)
    axes.set_ylim(0, 1.35 * highest / 1e3)  # limits far above it say little
    axes.legend(handles=_meanings(pairs), fontsize=8, loc="upper right", ncols=3)
    slant = {"rotation": 25, "ha": "right"} if _is_narrow(axes) else {}
    names = [short_name(name, 20) for name in found.line.names]
    axes.set_xticks(range(n), names, fontsize=9, **slant)
    axes.set(ylabel="reaction [kN]", title="Reactions")
    axes.grid(axis="y", alpha=0.3)


def _meanings(pairs: Sequence[tuple[LineState, str]]) -> list[Any]:
    """What the colours of the bars and the dashes mean."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    names = {_BEFORE: "as set", _AFTER: "after the moves"}
    colours = dict.fromkeys(colour for _, colour in pairs)
    bars = [Patch(color=colour, label=names[colour]) for colour in colours]
    return [*bars, Line2D([], [], color=_LIMIT, ls="--", lw=1, label="limit")]


_ABOVE = {"rotation": 90, "fontsize": 8, "ha": "center", "va": "bottom"}


def _draw_jacking(axes: Any, found: Jacking) -> None:
    lift = 1e3 * found.lifts
    axes.plot(lift, found.loads / 1e3, color=_BEFORE, label=f"jack at {found.station:.3g} m")
    second = found.zero_load + found.second_slope * found.lifts
    axes.plot(lift, second / 1e3, "--", color=_LIMIT, label="second line, drawn back")
    axes.plot(1e3 * found.free_lift, found.free_load / 1e3, "o", color=_AFTER, label="comes free")
    axes.set(
        xlabel="lift [mm]", ylabel="load [kN]", title=f"Jacking of {short_name(found.bearing)}"
    )
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


def _finish(axes: Any, label: str, title: str, *, pad: float = 6.0) -> None:
    axes.set(xlabel="station from aft [m]", ylabel=label)
    axes.set_title(title, pad=pad)
    axes.grid(alpha=0.3)
    axes.margins(x=0.02)
    axes.legend(fontsize=8)


def align_html(
    found: Alignment,
    tested: BeforeAfter | None = None,
    *,
    measured: SagReport | None = None,
    note: str = "",
) -> str:
    """One self-contained page: verdict, tables, picture, moves, and a simulated test of them.

    Parameters
    ----------
    found : Alignment
    tested : BeforeAfter, optional
        Of :func:`wearstate.diagnose.shaft_tests.before_after.calibrated_test`.
    measured : SagReport, optional
        What measured tests say; `found` is then of the line where they put it.
    note : str
        Why there is no test, where one was asked for.

    Returns
    -------
    str
        HTML.
    """
    moves, turns = found.proposed
    films = film_states(found.scene, moves, turns)
    return render(
        "align.html.j2",
        found=found,
        films=_films(films),
        transfers=_transfers(found, moves, turns, measured),
        margin_rows=margin_cells(margin_rows(found.states, _after(found))),
        jack_rows=jack_cells(jack_rows(found.states, found.calibration)),
        colour=_COLOURS[found.verdict],
        headline=_headline(found),
        states=[_state_cells(state) for state in found.states],
        head=_HEAD,
        unit=_UNIT,
        influence=influence(found.line, found.states[0]) / 1e6,
        blocks=_block_texts(found.calibration.blocks) if found.calibration else [],
        moves=_move_lines(found.calibration) if found.calibration else [],
        before_after=_before_after(found.calibration) if found.calibration else [],
        jack=_jacking_text(found.jacking, found.states[0].condition.name) if found.jacking else "",
        images=align_images(found),
        margins=_margin_lines(found.calibration, found.margin) if found.calibration else [],
        tested=None if tested is None else _tested(tested),
        measured=None if measured is None else _measured(measured),
        note=note,
        fixed=_fixed,
    )


_COLOURS = {"within": "#3a923a", "warning": "#e07b00", "alarm": "#c03a2b"}


def _state_cells(state: LineState) -> dict[str, Any]:
    return {
        "name": state.condition.name,
        "load": f"{state.reactions.sum() / 1e3:.1f}",
        "rows": [
            (_bearing_row(state, i), _verdict(state, name))
            for i, name in enumerate(state.line.names)
        ],
    }


def _tested(result: BeforeAfter) -> dict[str, Any]:
    """A simulated test for the page: its heading, summary, picture and peaks."""
    heading, *_ = rig_text(result).splitlines()
    rows = [
        (
            peak.channel,
            peak.verdict,
            f"{peak.frequency_before:.1f}",
            f"{peak.level_before:.1f}",
            f"{peak.change:+.1f}",
            f"{peak.interval[0]:+.1f} … {peak.interval[1]:+.1f}",
            f"{peak.model_change:+.1f}",
            EXPECTED[peak.expected],
        )
        for peak in result.changes
    ]
    return {
        "heading": heading,
        "summary": result.summary,
        "rows": rows,
        "images": [
            page_image(rig_figure(result, channels=[name], title=False))
            for name in result.before.channels
        ],
    }


def _films(states: Sequence[LineFilms]) -> dict[str, Any]:
    """Oil films for the page; without a picture where the line does not rest."""
    rests = any(state.film is not None for state in states)
    return {
        "head": FILM_HEAD,
        "rows": film_cells(states),
        "faults": resting(states),
        "images": pressure_images(states) if rests else [],
    }


def _transfers(
    found: Alignment,
    moves: Mapping[str, float],
    turns: Mapping[str, float],
    measured: SagReport | None,
) -> list[PageImage]:
    """Pictures of transfer functions, one for each measured test, else one of the model."""
    tests: Sequence[LineTest | None] = (measured.tests if measured else ()) or (None,)
    try:
        return [
            image
            for test in tests
            for image in transfer_images(found.scene, moves, turns, measured=test)
        ]
    except ShaftFilmError:  # said beside the table of the films
        return []


def _measured(report: SagReport) -> dict[str, Any]:
    """Sags by measured tests, for the page."""
    head, *rows = sag_rows(report)
    return {
        "headline": report.headline,
        "plausible": report.posterior.plausible,
        "head": head,
        "rows": rows,
        "tests": [*report.doubts, *report.sources],
        "next": next_texts(report),
        "images": sag_images(report),
    }


def save_html(
    found: Alignment,
    path: Path,
    tested: BeforeAfter | None = None,
    *,
    measured: SagReport | None = None,
    note: str = "",
    force: bool = True,
) -> None:
    """Write :func:`align_html` whole, or not at all."""
    save_page(align_html(found, tested, measured=measured, note=note), path, force=force)
