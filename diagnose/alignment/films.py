"""Effect of an alignment on the oil films of its bearings: stiffness, tilt, pressure, by speed.

References
----------
Zhang, Suo (2020), Research on the influence of shafting alignment condition on transverse vibration
transmission characteristics, Ship Science and Technology 42(6), 65-70,
doi:10.3404/j.issn.1672-7649.2020.06.013, section 2.1 and figure 5.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...sim.bearing.operate import JournalBearing
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.changed import free_line, line_model, rest, transfer
from ...sim.shaft_films.on_oil_films import BeamFilm
from ...sim.shaft_films.status import ShaftFilmError
from ...sim.shaft_response.places import Place
from ..pages.page import short_name
from ..pages.picture import PAGE_WIDTH, PageImage, page_image
from ..shaft_tests.before_after import turned_scene
from ..shaft_tests.measured_tests import LineTest

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

SPEEDS = (0.75, 1.0, 1.25)
"""Speeds at which films are shown, over that of the scene [-]."""

_SHOWN_PANELS = 6  # bearings of a picture
_BAND, _LINES = (5.0, 400.0), 400  # of computed transfer functions without a test [Hz]


@dataclass(frozen=True, kw_only=True, eq=False)
class LineFilms:
    """Films of a line as set, or after moves, at one speed.

    Attributes
    ----------
    after : bool
        Whether the moves are applied.
    speed_hz : float
    film : BeamFilm or None
        None if the line has no equilibrium on its films.
    """

    after: bool
    speed_hz: float
    film: BeamFilm | None


def film_states(
    scene: ShaftScene,
    moves: Mapping[str, float] | None = None,
    turns: Mapping[str, float] | None = None,
    *,
    speeds: Sequence[float] = SPEEDS,
) -> tuple[LineFilms, ...]:
    """Films of a line before and after moves, at several speeds.

    Parameters
    ----------
    scene : ShaftScene
    moves, turns : mapping of str to float, optional
        Bearing -> upward move [m] and rotation of its bore [rad]; by default nothing moves.
    speeds : sequence of float
        Speeds over that of the scene [-].

    Returns
    -------
    tuple of LineFilms
        As set at all speeds, then after the moves, if any.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> states = film_states(load_scene("shaft-rig"), {"third": 1e-4}, speeds=(1.0,))
    >>> [state.after for state in states]
    [False, True]
    """
    shifted = any((moves or {}).values()) or any((turns or {}).values())
    kinds: list[tuple[bool, ShaftScene]] = [(False, scene)]
    if shifted:
        kinds.append((True, moved_scene(scene, moves or {}, turns or {})))
    found = []
    for after, one in kinds:
        model, start = line_model(one), None
        for share in speeds:
            speed = share * scene.drive.speed
            try:
                start = rest(model, math.tau * speed, start=start)
            except ShaftFilmError:
                start = None
            found.append(LineFilms(after=after, speed_hz=speed, film=start))
    return tuple(found)


def moved_scene(
    scene: ShaftScene, moves: Mapping[str, float], turns: Mapping[str, float]
) -> ShaftScene:
    """Scene with its bearings moved and its bores turned.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(moved_scene(load_scene("shaft-rig"), {"third": 1e-4}, {}).bearings[2].offset, 9)
    -0.00015
    """
    turned = turned_scene(scene, turns)
    bearings = tuple(
        bearing.model_copy(update={"offset": bearing.offset + moves.get(bearing.name, 0.0)})
        for bearing in turned.bearings
    )
    return turned.model_copy(update={"bearings": bearings})


def film_rows(states: Sequence[LineFilms]) -> list[dict[str, Any]]:
    """One row for each bearing, speed and alignment, in SI, ready for JSON."""
    return [
        {
            "bearing": bearing.name,
            "after": state.after,
            "speed_hz": state.speed_hz,
            "load_n": float(np.hypot(*film.reactions[i])),
            "tilt_up_rad": float(film.slopes[i, 0]),
            "tilt_side_rad": float(film.slopes[i, 1]),
            "eccentricity": float(film.eccentricity_ratios[i]),
            "least_film_m": float(film.least_film[i]),
            "peak_pressure_pa": float(film.peak_pressure[i]),
            "stiffness_up_n_per_m": float(film.stiffness[i, 0, 0]),
            "stiffness_side_n_per_m": float(film.stiffness[i, 1, 1]),
            "damping_up_ns_per_m": float(film.damping[i, 0, 0]),
            "damping_side_ns_per_m": float(film.damping[i, 1, 1]),
        }
        for state in states
        if (film := state.film) is not None
        for i, bearing in enumerate(film.bearings)
    ]


FILM_HEAD = (
    ("bearing", ""),
    ("speed", "1/min"),
    ("load", "kN"),
    ("tilt up", "mm/m"),
    ("tilt side", "mm/m"),
    ("least film", "µm"),
    ("stiffness up", "kN/mm"),
    ("stiffness side", "kN/mm"),
    ("damping up", "kN s/m"),
)
"""Names and units of the columns of :func:`film_cells`."""

_CELLS = (
    ("load_n", 1e-3, ".3g"),
    ("tilt_up_rad", 1e3, ".3f"),
    ("tilt_side_rad", 1e3, ".3f"),
    ("least_film_m", 1e6, ".1f"),
    ("stiffness_up_n_per_m", 1e-6, ".3g"),
    ("stiffness_side_n_per_m", 1e-6, ".3g"),
    ("damping_up_ns_per_m", 1e-3, ".4g"),
)


def film_cells(states: Sequence[LineFilms]) -> list[tuple[str, ...]]:
    """Rows of a table as text: before the moves → after them.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> [row, *_] = film_cells(film_states(load_scene("shaft-rig"), speeds=(1.0,)))
    >>> row[:3]
    ('aft', '600', '0.611')
    """
    rows = film_rows(states)
    later = {(row["bearing"], row["speed_hz"]): row for row in rows if row["after"]}
    cells = []
    for row in rows:
        if row["after"]:
            continue
        other = later.get((row["bearing"], row["speed_hz"]))
        texts = [_change(row, other, *cell) for cell in _CELLS]
        cells.append((row["bearing"], f"{60 * row['speed_hz']:.0f}", *texts))
    order = list(dict.fromkeys(row[0] for row in cells))
    return sorted(cells, key=lambda row: (order.index(row[0]), float(row[1])))


def _change(
    row: Mapping[str, Any], other: Mapping[str, Any] | None, key: str, factor: float, form: str
) -> str:
    before = f"{factor * row[key]:{form}}"
    if other is None:
        return before
    return f"{before} → {factor * other[key]:{form}}"


def resting(states: Sequence[LineFilms]) -> list[str]:
    """A sentence for each state in which the line has no equilibrium on its films."""
    return [
        f"{'after the moves' if state.after else 'as set'}, {60 * state.speed_hz:.0f} 1/min: the "
        "line has no equilibrium on its films"
        for state in states
        if state.film is None
    ]


def pressure_images(states: Sequence[LineFilms]) -> list[PageImage]:
    """Film pressure over the unrolled bore, one picture per bearing, as set next to after moves.

    The states at the middle speed are drawn.
    """
    rows = [state for state in _at_one_speed(states) if state.film is not None]
    films = [state.film for state in rows if state.film is not None]
    count = min(len(films[0].bearings) if films else 0, _SHOWN_PANELS)
    return [page_image(_bearing_figure(rows, films, i)) for i in range(count)]


def _bearing_figure(rows: Sequence[LineFilms], films: Sequence[BeamFilm], i: int) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, 2.7), layout="constrained")
    panels = figure.subplots(1, len(rows), squeeze=False, sharey=True)[0]
    highest = max(float(film.peak_pressure[i]) for film in films)
    for axes, state, film in zip(panels, rows, films, strict=True):
        image = _draw_pressure(axes, film, i, highest)
        axes.set_title("after" if state.after else "as set", fontsize=9)
    figure.colorbar(image, ax=list(panels), label="MPa")
    panels[0].set_ylabel("angle from the bottom [deg]", fontsize=9)
    figure.suptitle(short_name(films[0].bearings[i].name, 40), fontsize=10)
    return figure


def _at_one_speed(states: Sequence[LineFilms]) -> list[LineFilms]:
    """States at the middle speed."""
    speeds = sorted({state.speed_hz for state in states})
    middle = speeds[len(speeds) // 2]
    return [state for state in states if state.speed_hz == middle]


def _draw_pressure(axes: Any, film: BeamFilm, i: int, highest: float) -> Any:
    """Draw pressure over length and angle, which counts from the bottom with the rotation."""
    pressure = np.asarray(film.films[i].pressure)
    unit = _pressure_unit(film.bearings[i].worn, film.speed)
    shifted = np.roll(pressure, pressure.shape[0] // 2, axis=0) * unit / 1e6
    half = 1e3 * film.bearings[i].bearing.length / 2
    image = axes.imshow(
        shifted, origin="lower", aspect="auto", extent=(-half, half, -180, 180), cmap="viridis",
        vmin=0.0, vmax=max(highest / 1e6, 1e-12),
    )  # fmt: skip
    axes.set(xlabel="along [mm]", yticks=[-180, -90, 0, 90, 180])
    return image


def _pressure_unit(bearing: JournalBearing, speed: float) -> float:
    return bearing.force_unit(speed) / (bearing.diameter / 2 * bearing.length)


# --- transfer functions before and after


def transfer_images(
    scene: ShaftScene,
    moves: Mapping[str, float] | None = None,
    turns: Mapping[str, float] | None = None,
    *,
    measured: LineTest | None = None,
) -> list[PageImage]:
    """Accelerances of the housings, one picture each: measured, as set, and after the moves.

    Parameters
    ----------
    scene : ShaftScene
        The line as set, or as estimated from its tests.
    moves, turns : mapping of str to float, optional
        Proposed moves and turns.
    measured : LineTest, optional
        Test whose force, responses and lines are used; by default the force acts on the aftmost
        journal, upward, and no coherence is drawn.

    Raises
    ------
    ShaftFilmError
        The line has no equilibrium on its films as set.
    """
    plan = _plan(scene, measured)
    curves = _curves(scene, moves or {}, turns or {}, plan)
    shown = range(min(len(plan.responses), _SHOWN_PANELS))
    return [page_image(_response_figure(plan, curves, measured, k)) for k in shown]


def _response_figure(
    plan: "_Plan", curves: Sequence[tuple[str, str, Any]], measured: LineTest | None, k: int
) -> Any:
    from matplotlib.figure import Figure

    rows = 1 if measured is None else 2
    figure = Figure(figsize=(PAGE_WIDTH, 3.2 + 1.2 * (rows - 1)), layout="constrained")
    ratios = [3, 1][:rows]
    panels = figure.subplots(rows, 1, squeeze=False, sharex=True, height_ratios=ratios)[:, 0]
    _draw_response(panels, plan, curves, measured, k)
    panels[0].set_ylabel("accelerance [dB re 1 (m/s²)/N]", fontsize=9)
    panels[0].set_title(
        f"{_response_name(plan.responses[k])}, pushing {_response_name(plan.force)}", fontsize=9
    )
    panels[-1].set_xlabel("frequency [Hz]")
    if measured is not None:
        panels[1].set_ylabel("coherence")
    panels[0].legend(fontsize=8)
    return figure


def _draw_response(
    column: Any,
    plan: "_Plan",
    curves: Sequence[tuple[str, str, Any]],
    measured: LineTest | None,
    k: int,
) -> None:
    """Draw level and coherence of one response, or only the level without a measurement."""
    level = column[0]
    if measured is not None:
        value = measured.transfer.value[:, k]
        level.plot(plan.frequencies, _level(value), ".", ms=2.5, color="#7a828b", label="measured")
        column[1].plot(plan.frequencies, measured.coherence[:, k], color="#7a828b", lw=0.8)
        column[1].set(ylim=(0, 1.02), xlabel="frequency [Hz]")
    for label, colour, curve in curves:
        level.plot(plan.frequencies, _level(curve[:, k]), color=colour, lw=0.9, label=label)
    level.set_title(_response_name(plan.responses[k]), fontsize=9)
    for axes in column:
        axes.grid(alpha=0.3)


class _Plan(NamedTuple):
    frequencies: Vector
    speed: float
    force: Place
    responses: tuple[Place, ...]


def _plan(scene: ShaftScene, measured: LineTest | None) -> _Plan:
    if measured is not None:
        own = measured.transfer
        return _Plan(own.frequencies, own.speed, own.force, own.responses)
    force = scene.bearings[0].name, "y"
    responses: tuple[Place, ...] = tuple((b.name, "y", "housing") for b in scene.bearings)
    hertz = np.linspace(*_BAND, _LINES)
    return _Plan(hertz, math.tau * scene.drive.speed, force, responses)


def _curves(
    scene: ShaftScene, moves: Mapping[str, float], turns: Mapping[str, float], plan: _Plan
) -> list[tuple[str, str, Complex]]:
    """Label, colour and accelerances of the line as set and, if anything moves, after moves."""
    first = line_model(scene)
    line = free_line(
        first, plan.frequencies, speed=plan.speed, forces=[plan.force], responses=plan.responses
    )
    kinds = [("model, as set", "#1f5a94", first)]
    if any(moves.values()) or any(turns.values()):
        other = line_model(moved_scene(scene, moves, turns))
        kinds.append(("model, after the moves", "#b3541e", other))
    return [
        (label, colour, transfer(model, rest(model, plan.speed), line).value[..., 0])
        for label, colour, model in kinds
    ]


def _level(value: Complex) -> Vector:
    return np.asarray(20 * np.log10(np.abs(value) + 1e-300))


def _response_name(place: Place) -> str:
    assert isinstance(place, tuple)
    where, axis, *part = place
    what = f"{where:g} m" if isinstance(where, float) else short_name(str(where), 18)
    return f"{'housing of ' if part else ''}{what} {'up' if axis == 'y' else 'sideways'}"
