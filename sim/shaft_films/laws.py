"""Film of one bearing for the equilibrium: load, stiffness, damping, and remaining gap."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..film.direct import DIRECT_OK, direct_tilted_force
from ..film.direct_system import STATUS, DirectFilm
from ..film.impedance_map import ImpedanceMap, impedance_map
from ..film.map_look_up import map_force
from ..film.rungs import FILM_RUNGS
from ..film.slopes import Coefficients, perturbation
from ..film.solve import FilmGeometry, FilmSolution, FilmState, FilmStatus, direct_film
from .film_bearing import FilmBearing

Vector = NDArray[np.float64]

_STEEPEST = 1.0  # increase of the gap from an edge to the next node, over the gap there
_DISPLACEMENT = 1e-5  # step of a position, of the least gap
_RATE = 1e-5  # step of a rate, of the surface speed's share of a gap


class _Load(NamedTuple):
    """Load of a film on its journal: F_X, F_Y and the moments."""

    value: Vector
    ok: bool


class FilmLaw(NamedTuple):
    """Film of one bearing as a function of the position (X, Y, tilt_x, tilt_y) and its rates."""

    geometry: FilmGeometry
    tilted: bool
    load: Callable[[Vector, Vector], _Load]
    coefficients: Callable[[Vector], Coefficients]  # at the position of the last load
    solution: Callable[[Vector], FilmSolution]


AT_REST = np.zeros(4)
_RUNGS = {rung.name: rung for rung in FILM_RUNGS}


def law_of(rung: str, tilted: bool, bearing: FilmBearing) -> FilmLaw:
    """Film of a worn bearing; raises ValueError for a film unsuitable for the equilibrium."""
    geometry = bearing.worn.geometry
    if geometry.condition == "reynolds":
        raise ValueError(
            f"{bearing.name}.film.condition = 'reynolds' must be 'periodic' or 'guembel'; its line "
            "without pressure jumps from node to node as the journal turns"
        )
    if rung not in _RUNGS:
        raise ValueError(f"rung = '{rung}' must be one of {', '.join(_RUNGS)}")
    return law_on(rung, tilted, geometry)


def law_on(rung: str, tilted: bool, geometry: FilmGeometry) -> FilmLaw:
    """Film of a rung on a geometry."""
    if rung == "direct":
        return _direct_law(geometry, tilted)
    if rung == "map":
        load = partial(_map_load, impedance_map(geometry))
        return _any_law(geometry, False, load, rung)
    tilted = tilted and _RUNGS[rung].tilted
    return _any_law(geometry, tilted, partial(_rung_load, rung, geometry, tilted), rung)


def _direct_law(geometry: FilmGeometry, tilted: bool) -> FilmLaw:
    work = direct_film(geometry, tilted=tilted)
    return FilmLaw(
        geometry=geometry,
        tilted=tilted,
        load=partial(_direct_load, work, tilted),
        coefficients=partial(_direct_coefficients, work, tilted),
        solution=partial(_solution, "direct", geometry, tilted),
    )


def _any_law(
    geometry: FilmGeometry, tilted: bool, load: Callable[[Vector, Vector], _Load], field: str
) -> FilmLaw:
    return FilmLaw(
        geometry=geometry,
        tilted=tilted,
        load=load,
        coefficients=partial(_displaced, geometry, tilted, load),
        solution=partial(_solution, field, geometry, tilted),
    )


def _state(tilted: bool, place: Vector, rates: Vector = AT_REST) -> FilmState:
    x, y, tilt_x, tilt_y = (float(v) for v in place)
    x_rate, y_rate, tilt_x_rate, tilt_y_rate = (float(v) for v in rates)
    plain = FilmState(x=x, y=y, x_rate=x_rate, y_rate=y_rate)
    if not tilted:
        return plain
    return replace(
        plain, tilt_x=tilt_x, tilt_y=tilt_y, tilt_x_rate=tilt_x_rate, tilt_y_rate=tilt_y_rate
    )


def _solution(rung: str, geometry: FilmGeometry, tilted: bool, place: Vector) -> FilmSolution:
    return _RUNGS[rung].field(geometry, _state(tilted, place))


def _direct_load(work: DirectFilm, tilted: bool, place: Vector, rates: Vector) -> _Load:
    x, y, tilt_x, tilt_y = place
    x_rate, y_rate, tilt_x_rate, tilt_y_rate = rates
    if not tilted:
        tilt_x = tilt_y = tilt_x_rate = tilt_y_rate = 0.0
    force = direct_tilted_force(
        work, x, y, x_rate, y_rate, tilt_x, tilt_y, tilt_x_rate, tilt_y_rate
    )
    return _Load(np.array([*force, *work.measure[3:5]]), bool(work.outcome[STATUS] == DIRECT_OK))


def _direct_coefficients(work: DirectFilm, tilted: bool, place: Vector) -> Coefficients:
    return _widened(perturbation(work, _state(tilted, place)))


def _widened(own: Coefficients) -> Coefficients:
    """Extend 2 x 2 to 4 x 4 matrices, with zeros for a film without tilt."""
    if own.stiffness.shape[0] == 4:
        return own
    return Coefficients(np.pad(own.stiffness, (0, 2)), np.pad(own.damping, (0, 2)))


def _rung_load(
    name: str, geometry: FilmGeometry, tilted: bool, place: Vector, rates: Vector
) -> _Load:
    film = _RUNGS[name].field(geometry, _state(tilted, place, rates))
    ok = film.status in (FilmStatus.OK, FilmStatus.COARSE)
    return _Load(np.concatenate([film.force, film.moment]), ok)


def _map_load(table: ImpedanceMap, place: Vector, rates: Vector) -> _Load:
    force = map_force(table.table, place[0], place[1], rates[0], rates[1])
    ok = math.hypot(place[0], place[1]) <= table.last_eccentricity
    return _Load(np.array([*force, 0.0, 0.0]), ok)


def _displaced(
    geometry: FilmGeometry,
    tilted: bool,
    load: Callable[[Vector, Vector], _Load],
    place: Vector,
) -> Coefficients:
    """Coefficients by central differences; for the tilt only if the film supports it."""
    step = _DISPLACEMENT * least_gap(geometry, tilted, place)
    stiffness, damping = np.zeros((4, 4)), np.zeros((4, 4))
    for axis in range(4 if tilted else 2):
        way = np.zeros(4)
        way[axis] = 1.0
        ends = [load(place + side * step * way, AT_REST).value for side in (-1, 1)]
        stiffness[:, axis] = (ends[0] - ends[1]) / (2 * step)
        ends = [load(place, side * _RATE * way).value for side in (-1, 1)]
        damping[:, axis] = (ends[0] - ends[1]) / (2 * _RATE)
    return Coefficients(stiffness, damping)


def edge_gaps(geometry: FilmGeometry, tilted: bool, place: Vector) -> Vector:
    """Gaps at both ends, over C (2, n_theta)."""
    half = 0.5 * place[2:] if tilted else np.zeros(2)
    bore = 1.0 if geometry.bore is None else 1.0 + np.asarray(geometry.bore)
    return bore - np.array([place[:2] - half, place[:2] + half]) @ directions(geometry.n_theta)


def directions(count: int) -> Vector:
    """Directions of the nodes round the bore (2, count)."""
    angle = 2 * math.pi * np.arange(count) / count
    return np.array([np.cos(angle), np.sin(angle)])


def least_gap(geometry: FilmGeometry, tilted: bool, place: Vector) -> float:
    """Least gap at the ends, over C."""
    return float(np.min(edge_gaps(geometry, tilted, place)))


def share_to_contact(law: FilmLaw, place: Vector, step: Vector) -> float:
    """Share of the step at which the journal would touch the bore."""
    now = edge_gaps(law.geometry, law.tilted, place)
    loss = now - edge_gaps(law.geometry, law.tilted, place + step)
    closing = loss > 0
    return float(np.min(now[closing] / loss[closing])) if closing.any() else math.inf


def finer_law(law: FilmLaw, place: Vector) -> FilmLaw:
    """The same film on a mesh twice as fine if this one is too coarse, else itself."""
    geometry, bore = law.geometry, law.geometry.bore
    if law.solution(place).status is FilmStatus.COARSE:
        if bore is not None:  # linear between the nodes
            bore = np.stack([bore, 0.5 * (bore + np.roll(bore, -1))], axis=1).ravel()
        geometry = replace(geometry, n_theta=2 * geometry.n_theta, bore=bore)
    ends = edge_gaps(geometry, law.tilted, place)
    least = ends.min()
    line = int(ends.min(axis=0).argmin())
    if np.ptp(ends[:, line]) > _STEEPEST * least * (geometry.n_z - 1):
        geometry = replace(geometry, n_z=2 * geometry.n_z - 1)
    return law if geometry is law.geometry else _direct_law(geometry, law.tilted)
