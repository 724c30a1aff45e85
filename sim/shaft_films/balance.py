"""Newton's method for the equilibrium of beam and films, with continuation from stronger films."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .laws import AT_REST, FilmLaw, directions, edge_gaps, least_gap, share_to_contact
from .line import CondensedLine
from .start import short_place
from .status import ShaftFilmStatus

Vector = NDArray[np.float64]

_MOST_STEPS = 60  # a dozen from a fair start
_MOST_HALVINGS = 14
_NEARLY = 1.5  # strength of films up to which a finer mesh may help
_NEAREST = 0.85  # of the distance to contact in one step
_LEAST_ROOM = 1e-4  # over C: no mesh resolves a thinner film
LEAST_SHARE = 0.01  # of the mean load: least reference load of a bearing
_LOOSE = 1e-4  # of the load, during a continuation
_STIFFEST = 10.0  # unit of force over the largest load: journals near the middle
_FIRST_RATIO = 8.0
_FASTER = 1.5
_LEAST_RATIO = 1.02
_CLOSE = 5e-3  # over C: an end nearer than this counts as touching
_OPPOSITE = -0.5  # cosine between the positions where the two ends touch


class Balance(NamedTuple):
    """Result of a search for the equilibrium."""

    places: Vector  # (b, 4), in film coordinates
    loads: Vector  # of the films (b, 4)
    residual: float
    iterations: int
    status: ShaftFilmStatus
    culprit: int
    strength: float = 1.0  # factor on the films in equilibrium here, over the actual ones


class _Trial(NamedTuple):
    """A trial with its residual."""

    places: Vector  # (b, 4)
    loads: Vector  # (b, 4)
    left: Vector  # (4 b,), residual in the units of the films
    ok: bool


class _System(NamedTuple):
    """Beam and pedestals in the units of the films: ``A u + a - (1 + A P) g``."""

    line: CondensedLine
    laws: list[FilmLaw]
    beam: Vector  # A (4 b, 4 b)
    pull: Vector  # -a (4 b,)
    share: Vector  # 1 + A P (4 b, 4 b)


def _system(line: CondensedLine, laws: list[FilmLaw], strength: float) -> _System:
    """Beam and films in film units, with films and pedestals made stronger by a factor."""
    work = strength * line.work
    beam = line.scale[:, None] * line.stiffness * line.scale / work[:, None]
    give = line.flexibility * line.work / line.scale**2
    return _System(
        line=line,
        laws=laws,
        beam=beam,
        pull=line.scale * line.pull / work,
        share=np.eye(work.size) + strength * beam * give,
    )


def _evaluate(system: _System, places: Vector) -> _Trial:
    answers = [law.load(place, AT_REST) for law, place in zip(system.laws, places, strict=True)]
    loads = np.array([answer.value for answer in answers])
    left = system.beam @ places.ravel() - system.pull - system.share @ loads.ravel()
    return _Trial(places, loads, left, all(answer.ok for answer in answers))


def solve_balance(
    line: CondensedLine, laws: list[FilmLaw], start: Vector, tolerance: float
) -> Balance:
    """Newton's method from the start, and if that fails, with continuation from stronger films."""
    found = _newton(_system(line, laws, 1.0), start, tolerance)
    if found.status.ok:
        return found
    other = _weakened(line, laws, tolerance)
    return other._replace(iterations=found.iterations + other.iterations)


def _weakened(line: CondensedLine, laws: list[FilmLaw], tolerance: float) -> Balance:
    """Continuation from films that hold the journals in the middle to the actual ones."""
    places, strength = _near_the_middle(line, laws)
    wanted, ratio, spent, last = strength, _FIRST_RATIO, 0, None
    while True:
        aim = tolerance if wanted == 1.0 else _LOOSE
        found = _newton(_system(line, laws, wanted), places, aim)
        spent += found.iterations
        if found.status.ok:
            last, places, strength = found, found.places, wanted
            ratio **= _FASTER
        else:
            ratio = math.sqrt(ratio)
        if strength == 1.0 or ratio < _LEAST_RATIO:
            break
        wanted = max(1.0, strength / ratio)
    if strength > 1.0 and last is not None:
        system = _system(line, laws, 1.0)
        residual = float(np.max(_residuals(system, _evaluate(system, places))))
        found = last._replace(
            residual=residual, status=found.status, culprit=found.culprit, strength=strength
        )
    return found._replace(iterations=spent)


def _near_the_middle(line: CondensedLine, laws: list[FilmLaw]) -> tuple[Vector, float]:
    """Positions off the middle by about a tenth of the clearance, and film strengths for them."""
    pull = (line.scale * line.pull / line.work).reshape(-1, 4)
    strength = max(1.0, _STIFFEST * float(np.max(np.abs(pull))))
    places = np.zeros((len(laws), 4))
    for n, law in enumerate(laws):
        places[n, :2] = short_place(law.geometry.length_to_diameter, pull[n, :2] / strength)
    return places, strength


def _newton(system: _System, places: Vector, tolerance: float) -> Balance:
    now = _evaluate(system, places)
    steps = 0
    while now.ok and steps < _MOST_STEPS:
        residuals = _residuals(system, now)
        if np.max(residuals) <= tolerance:
            return _ended(system, now, steps, ShaftFilmStatus.OK)
        if _least_room(system, now.places) < _LEAST_ROOM:
            break
        matrix = _matrix(system, now)
        following = _step(system, now, matrix)
        steps += 1
        if following is None:
            break
        now = following
    return _ended(system, now, steps, None)


def _least_room(system: _System, places: Vector) -> float:
    laws = zip(system.laws, places, strict=True)
    return min(least_gap(law.geometry, law.tilted, place) for law, place in laws)


def _matrix(system: _System, now: _Trial) -> Vector:
    films = np.zeros_like(system.beam)
    for n, (law, place) in enumerate(zip(system.laws, now.places, strict=True)):
        films[4 * n : 4 * n + 4, 4 * n : 4 * n + 4] = law.coefficients(place).stiffness
    matrix: Vector = system.beam + system.share @ films
    return matrix


def _step(system: _System, now: _Trial, matrix: Vector) -> _Trial | None:
    """Next trial, or None if no step reduces the residual."""
    try:
        backward = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return None
    step = -(backward @ now.left)
    by_bearing = step.reshape(-1, 4)
    laws = list(zip(system.laws, now.places, by_bearing, strict=True))
    share = min(1.0, _NEAREST * min(share_to_contact(law, place, own) for law, place, own in laws))
    weight = np.repeat([1 / least_gap(w.geometry, w.tilted, place) for w, place, _ in laws], 4)
    size = float(np.linalg.norm(weight * step))
    for _ in range(_MOST_HALVINGS):
        trial = _evaluate(system, now.places + share * by_bearing)
        if trial.ok:
            after = float(np.linalg.norm(weight * (backward @ trial.left)))
            if after <= (1 - share / 4) * size:
                return trial
        share *= 0.5
    return None


def _residuals(system: _System, now: _Trial) -> Vector:
    """Residual force and moment over the load of each bearing (b,)."""
    unit = system.line.work[::4] / -system.line.scale[::4]
    load = np.hypot(*now.loads[:, :2].T) * unit
    load = np.maximum(load, max(LEAST_SHARE * float(np.mean(load)), np.finfo(float).tiny))
    left = now.left.reshape(-1, 4) * (unit / load)[:, None]
    residuals: Vector = np.maximum(np.hypot(*left[:, :2].T), np.hypot(*left[:, 2:].T))
    return residuals


def _ended(system: _System, now: _Trial, steps: int, status: ShaftFilmStatus | None) -> Balance:
    residuals = _residuals(system, now) if now.ok else np.full(len(system.laws), math.inf)
    worst = int(np.argmax(residuals))
    residual = float(residuals[worst])
    if status is None:
        status, worst = _diagnosis(system, now, worst)
    return Balance(
        places=now.places,
        loads=now.loads,
        residual=residual,
        iterations=steps,
        status=status,
        culprit=worst,
    )


def _diagnosis(system: _System, now: _Trial, worst: int) -> tuple[ShaftFilmStatus, int]:
    """Bearing that prevents an equilibrium, and the reason."""
    rooms = [
        edge_gaps(law.geometry, law.tilted, place)
        for law, place in zip(system.laws, now.places, strict=True)
    ]
    nearest = int(np.argmin([np.min(room) for room in rooms]))
    ends = rooms[nearest].min(axis=1)
    if np.min(ends) > _CLOSE:
        return ShaftFilmStatus.NO_CONVERGENCE, worst
    if np.max(ends) > _CLOSE:
        return ShaftFilmStatus.EDGE_CONTACT, nearest
    turns = directions(rooms[nearest].shape[1]).T[rooms[nearest].argmin(axis=1)]
    opposite = float(turns[0] @ turns[1]) < _OPPOSITE
    return (ShaftFilmStatus.NO_ROOM if opposite else ShaftFilmStatus.OVERLOAD), nearest


def may_be_refined(found: Balance) -> bool:
    """Whether there is an equilibrium, or a finer mesh might help with an edge."""
    edge = found.status is ShaftFilmStatus.EDGE_CONTACT
    return found.status.ok or (edge and found.strength < _NEARLY)
