"""Newton search for the position in which the film carries a load.

The steps are taken in the logit of the way to contact and the direction, or in the plane.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .bearing_status import BearingStatus
from .film_force import (
    FilmForce,
    angles_around,
    turn_by,
)
from .short_bearing import MOST_ITERATIONS

Vector = NDArray[np.float64]

_MOST_HALVINGS = 12
_LONGEST_STEP = 2.0  # of the logit of the eccentricity: a factor of 7 in the gap
_LEAST_ROOM = 1e-4  # of the distance to contact: no mesh resolves a thinner film
_REACH_STEP = 1e-6  # rad
_LEAST_LOGIT = -math.log(_LEAST_ROOM)
_OPPOSED = 0.8  # cosine: within 37 degrees of the load
_NEAREST = 0.9  # of the distance to contact in one plain step


class SearchResult(NamedTuple):
    """Position of the journal, force left over per load, film evaluations, and how it ended."""

    position: Vector
    residual: float
    iterations: int
    status: BearingStatus


def angle_between(first: Vector, second: Vector) -> float:
    """Angle from the first to the second, in (-pi, pi] [rad]."""
    cross = first[0] * second[1] - first[1] * second[0]
    return math.atan2(cross, float(first @ second))


def search(
    force: Callable[[Vector], FilmForce],
    reach: Callable[[float], float],
    load: Vector,
    start: Vector,
    tolerance: float,
) -> SearchResult:
    """Newton's method from the start; if that fails, from all round the bore."""
    spent, best = 0, None
    for place in (_polar(start, reach), *_PLACES_TO_TRY):
        for path in (_log_path, _plain_path):
            found = _newton(force, reach, load, _cartesian(place, reach), tolerance, path)
            spent += found.iterations
            best = found if best is None or found.residual < best.residual else best
            if found.status in (BearingStatus.OK, BearingStatus.OVERLOAD):
                return found._replace(iterations=spent)
    assert best is not None  # there is a start
    return best._replace(iterations=spent)


_PLACES_TO_TRY = tuple(
    np.array([math.log(share / (1 - share)), direction])
    for share in (0.1, 0.9, 0.5)
    for direction in angles_around(8)
)


def _newton(
    force: Callable[[Vector], FilmForce],
    reach: Callable[[float], float],
    load: Vector,
    position: Vector,
    tolerance: float,
    path: "_Path",
) -> SearchResult:
    """Newton's method; each step is halved until it brings the force closer."""
    now, evaluations = force(position), 1
    status = BearingStatus.NO_CONVERGENCE
    # a rung far outside its validity may lose its stiffness to rounding
    while evaluations < MOST_ITERATIONS and now.ok and np.any(now.force) and _finite(now):
        if _residual(now, load) <= tolerance:
            status = BearingStatus.OK
            break
        if _polar(position, reach)[0] > _LEAST_LOGIT:
            status = _at_the_wall(now, load)
            break
        move, distance = path(now, load, position, reach)
        before, fraction = distance(now), 1.0
        for _ in range(_MOST_HALVINGS):
            trial = move(fraction)
            after = force(trial)
            evaluations += 1
            if after.ok and distance(after) < before:
                break
            fraction *= 0.5
        else:
            break
        position, now = trial, after
    return SearchResult(position, _residual(now, load), evaluations, status)


def _finite(now: FilmForce) -> bool:
    return bool(np.all(np.isfinite(now.stiffness)) and np.all(np.isfinite(now.force)))


def _residual(now: FilmForce, load: Vector) -> float:
    if not now.ok:
        return math.inf
    return float(np.hypot(*(now.force + load)) / np.hypot(*load))


def _at_the_wall(now: FilmForce, load: Vector) -> BearingStatus:
    """Status at the wall: a film that opposes the load and is still too weak cannot carry it."""
    size = float(np.hypot(*now.force))
    against = -float(now.force @ load) / size / float(np.hypot(*load))
    weak = against > _OPPOSED and size < float(np.hypot(*load))
    return BearingStatus.OVERLOAD if weak else BearingStatus.NO_CONVERGENCE


_Path = Callable[
    [FilmForce, Vector, Vector, Callable[[float], float]],
    tuple[Callable[[float], Vector], Callable[[FilmForce], float]],
]
"""(force, load, position, reach) -> position for a share of the step, and the residual to lower."""


def _log_path(
    now: FilmForce, load: Vector, position: Vector, reach: Callable[[float], float]
) -> tuple[Callable[[float], Vector], Callable[[FilmForce], float]]:
    place = _polar(position, reach)
    step = _log_step(now, load, place, reach)

    def move(fraction: float) -> Vector:
        return _cartesian(place + fraction * step, reach)

    def distance(trial: FilmForce) -> float:
        return float(np.hypot(*_log_residual(trial.force, load)))

    return move, distance


def _plain_path(
    now: FilmForce, load: Vector, position: Vector, reach: Callable[[float], float]
) -> tuple[Callable[[float], Vector], Callable[[FilmForce], float]]:
    step = np.linalg.lstsq(now.stiffness, now.force + load)[0]

    def move(fraction: float) -> Vector:
        aim = position + fraction * step
        direction = math.atan2(aim[1], aim[0])
        share = float(np.hypot(*position)) / reach(math.atan2(position[1], position[0]))
        most = (share + _NEAREST * (1 - share)) * reach(direction)
        away = float(np.hypot(*aim))
        return aim if away <= most else aim * (most / away)

    def distance(trial: FilmForce) -> float:
        return _residual(trial, load)

    return move, distance


def _polar(position: Vector, reach: Callable[[float], float]) -> Vector:
    """Logit of the relative distance to contact, and direction [rad]."""
    direction = math.atan2(position[1], position[0])
    share = float(np.hypot(*position)) / reach(direction)
    share = min(max(share, 1e-9), 1 - 1e-9)
    return np.array([math.log(share / (1 - share)), direction])


def _cartesian(place: Vector, reach: Callable[[float], float]) -> Vector:
    e = reach(place[1]) / (1 + math.exp(-place[0]))
    return np.array([e * math.cos(place[1]), e * math.sin(place[1])])


def _log_residual(force: Vector, load: Vector) -> Vector:
    """Logarithm of the force over the load, and its angle from the opposite direction."""
    size = float(np.hypot(*force))
    if size == 0:
        return np.array([math.inf, 0.0])
    return np.array([math.log(size / float(np.hypot(*load))), angle_between(-load, force)])


def _log_step(
    now: FilmForce, load: Vector, place: Vector, reach: Callable[[float], float]
) -> Vector:
    """Newton step of the logit and the direction, limited to the range of the linearisation."""
    fx, fy = now.force
    of_force = np.array([[fx, fy], [-fy, fx]]) / (fx * fx + fy * fy)
    share = 1 / (1 + math.exp(-place[0]))
    e = share * reach(place[1])
    widening = reach(place[1] + _REACH_STEP) - reach(place[1] - _REACH_STEP)
    de = share * widening / (2 * _REACH_STEP)
    of_place = turn_by(place[1]) @ np.array([[e * (1 - share), de], [0.0, e]])
    jacobian = of_force @ now.stiffness @ of_place
    step: Vector = np.linalg.lstsq(jacobian, _log_residual(now.force, load))[0]
    step /= max(abs(step[0]) / _LONGEST_STEP, abs(step[1]), 1.0)
    return step
