"""Force of the film on a journal at rest, and its stiffness, for every rung of the film."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..film.direct import DIRECT_OK, direct_tilted_force
from ..film.direct_system import STATUS, DirectFilm
from ..film.rungs import FILM_RUNGS
from ..film.slopes import perturbation
from ..film.solve import (
    FilmGeometry,
    FilmState,
    FilmStatus,
    direct_film,
    starved_film,
)
from ..film.starved import starved_force

Vector = NDArray[np.float64]

DISPLACEMENT = 1e-5  # of the least gap: rounding 1e-10, truncation smaller
RUNGS = {rung.name: rung for rung in FILM_RUNGS if rung.bearing}


def turn_by(angle: float) -> Vector:
    """Rotation matrix [shape=(2, 2)]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def angles_around(count: int) -> Vector:
    """Angles of the lines of a mesh [rad] [shape=(count,)]."""
    return 2 * math.pi * np.arange(count) / count


class FilmForce(NamedTuple):
    """Force of the film on a journal at rest, its stiffness, and whether the film was found."""

    force: Vector
    stiffness: Vector
    ok: bool


def film_force(
    geometry: FilmGeometry, rung: str, tilt: tuple[float, float], turned: bool
) -> Callable[[Vector], FilmForce]:
    """Force and stiffness as a function of the position of the journal."""
    if rung != "direct":
        return partial(_any_force, geometry, rung, tilt)
    if geometry.inlet_fill < 1:
        return partial(_starved_force, starved_film(geometry, tilted=any(tilt)))
    work = direct_film(geometry, tilted=tilt != (0.0, 0.0))
    return partial(_turned_force if turned else _direct_force, work, tilt)


def _any_force(
    geometry: FilmGeometry, rung: str, tilt: tuple[float, float], position: Vector
) -> FilmForce:
    state = at_rest(position, tilt)
    film = RUNGS[rung].field(geometry, state)
    if film.status not in (FilmStatus.OK, FilmStatus.COARSE):
        return FilmForce(film.force, np.zeros((2, 2)), False)
    return FilmForce(
        film.force, displaced_film(geometry, state, rung, JOURNAL_MOTIONS[:2], DISPLACEMENT), True
    )


def _direct_force(work: DirectFilm, tilt: tuple[float, float], position: Vector) -> FilmForce:
    x, y = position
    force = np.array(direct_tilted_force(work, x, y, 0.0, 0.0, *tilt, 0.0, 0.0))
    ok = work.outcome[STATUS] == DIRECT_OK
    if not ok:
        return FilmForce(force, np.zeros((2, 2)), False)
    stiffness = perturbation(work, at_rest(position, tilt)).stiffness
    return FilmForce(force, stiffness[:2, :2], True)


def _starved_force(work: DirectFilm, position: Vector) -> FilmForce:
    """Stiffness by central differences, since the front of the oil moves with the journal."""

    def at(place: Vector) -> Vector:
        return np.array(starved_force(work, float(place[0]), float(place[1]), 0.0, 0.0))

    columns = [
        (at(position - aside) - at(position + aside)) / (2 * DISPLACEMENT)
        for aside in DISPLACEMENT * np.eye(2)
    ]
    force = at(position)
    return FilmForce(force, np.array(columns).T, bool(work.outcome[STATUS] == DIRECT_OK))


def _turned_force(work: DirectFilm, tilt: tuple[float, float], position: Vector) -> FilmForce:
    """Force on a mesh along the line of centres, which turns with the journal."""
    e = float(np.hypot(*position))
    along = _direct_force(work, tilt, np.array([e, 0.0]))
    stiffness = along.stiffness.copy()
    stiffness[:, 1] = [along.force[1] / e, -along.force[0] / e]
    turn = turn_by(math.atan2(position[1], position[0]))
    return FilmForce(turn @ along.force, turn @ stiffness @ turn.T, along.ok)


def at_rest(position: Vector, tilt: tuple[float, float]) -> FilmState:
    """Film of a journal that does not move from a position."""
    return FilmState(x=float(position[0]), y=float(position[1]), tilt_x=tilt[0], tilt_y=tilt[1])


class JournalMotion(NamedTuple):
    """One of the four motions of a journal."""

    name: str
    rate: str
    tilt: int


JOURNAL_MOTIONS = (
    JournalMotion("x", "x_rate", 0),
    JournalMotion("y", "y_rate", 0),
    JournalMotion("tilt_x", "tilt_x_rate", 1),
    JournalMotion("tilt_y", "tilt_y_rate", 1),
)


def displaced_film(
    geometry: FilmGeometry,
    state: FilmState,
    rung: str,
    places: tuple[JournalMotion, ...],
    step: float,
) -> Vector:
    """Decrease of force and moment with each of the motions, by central differences."""
    columns = []
    for place in places:
        ends = []
        for side in (-step, step):
            moved = replace(state, **{place.name: getattr(state, place.name) + side})
            film = RUNGS[rung].field(geometry, moved)
            ends.append(np.concatenate([film.force, film.moment])[: len(places)])
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.array(columns).T
