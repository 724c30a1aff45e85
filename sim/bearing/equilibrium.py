"""Equilibrium of a journal bearing, for any rung of the film.

Non-dimensional as the film: the journal centre is over the clearance C, ``tau = omega t``, and a
force is of ``eta omega R^3 L / C^2``, so that the Sommerfeld number is ``S = 1 / (pi |F|)``.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..brief import brief
from ..film.direct import DIRECT_OK, direct_tilted_force
from ..film.direct_system import STATUS, DirectFilm
from ..film.rungs import FILM_RUNGS
from ..film.slopes import perturbation
from ..film.solve import (
    FilmGeometry,
    FilmSolution,
    FilmState,
    FilmStatus,
    direct_film,
    starved_film,
)
from ..film.starved import starved_force
from ..output.status import Ending
from .short_bearing import MOST_ITERATIONS, short_attitude, short_eccentricity

Vector = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the load
_MOST_HALVINGS = 12
_LONGEST_STEP = 2.0  # of the logit of the eccentricity: a factor of 7 in the gap
_LEAST_ROOM = 1e-4  # of the way to contact; no mesh resolves a thinner film
DISPLACEMENT = 1e-5  # of the least gap: rounding 1e-10, truncation less
_REACH_STEP = 1e-6  # rad
_LEAST_LOGIT = -math.log(_LEAST_ROOM)
_OPPOSED = 0.8  # cosine: within 37 degrees of the load
_NEAREST = 0.9  # of the way to contact in one plain step


class BearingStatus(Ending):
    """How the search for an equilibrium ended. Everything but OK carries a cure."""

    OK = 0, "done"
    OVERLOAD = (
        1,
        "the film cannot carry this load with a gap that the mesh resolves; lower the load or the "
        "tilt, or raise the viscosity, the speed or the length",
    )
    NO_CONVERGENCE = (
        2,
        "no equilibrium was found; lower a groove's feed pressure that outweighs the load, choose "
        "condition = 'periodic', refine n_theta and n_z, or give a start closer to it",
    )
    NO_ROOM = (
        3,
        "the tilted journal touches the bore in every position; lower the tilt below 2 C from end "
        "to end",
    )
    COARSE = (
        4,
        "the film at the equilibrium is too thin for the mesh, and the position with it; raise "
        "n_theta, or lower the load",
    )


class BearingError(RuntimeError):
    """An equilibrium was not found and the caller asked to be told so."""

    def __init__(self, status: BearingStatus, where: str) -> None:
        self.status = status
        super().__init__(f"{where}: {status.name.lower()}: {status.text}")


@dataclass(frozen=True, kw_only=True)
class Equilibrium:
    """Where a journal at a steady load comes to rest.

    Attributes
    ----------
    geometry : FilmGeometry
        Of the film, as given.
    rung : str
        Of the film.
    load : numpy.ndarray [shape=(2,)]
        Force on the journal that the film balances.
    position : numpy.ndarray [shape=(2,)]
        Journal centre over C.
    tilt : tuple of float
        tilt_x, tilt_y as given.
    mesh_angle : float
        Direction of the mesh's first line [rad]. Not zero only for a plain, aligned bearing with
        the condition *reynolds*, whose mesh is laid along the line of centres: P = 0 stands at
        the widest gap and would else jump from line to line.
    film : FilmSolution
        At the equilibrium, on that mesh.
    residual : float
        Force left over, of the load.
    iterations : int
        Film solutions that were needed.
    status : BearingStatus
    """

    geometry: FilmGeometry
    rung: str
    load: Vector
    position: Vector
    tilt: tuple[float, float]
    mesh_angle: float
    film: FilmSolution
    residual: float
    iterations: int
    status: BearingStatus

    __repr__ = brief("eccentricity_ratio", "attitude_angle", "sommerfeld_number", "rung", "status")

    @property
    def eccentricity_ratio(self) -> float:
        """Distance of the centres over C."""
        return float(np.hypot(*self.position))

    @property
    def attitude_angle(self) -> float:
        """From the load to the journal centre, positive with the rotation, in (-pi, pi] [rad]."""
        return _angle_between(self.load, self.position)

    @property
    def sommerfeld_number(self) -> float:
        """``S = eta N L D / W (R / C)^2`` with N in revolutions per second."""
        return sommerfeld_number(float(np.hypot(*self.load)))

    @property
    def state(self) -> FilmState:
        """Of the film, on its mesh."""
        x, y = turn_by(-self.mesh_angle) @ self.position
        return FilmState(
            x=float(x), y=float(y), x_rate=0.0, y_rate=0.0, tilt_x=self.tilt[0], tilt_y=self.tilt[1]
        )


def sommerfeld_number(load: float) -> float:
    """Sommerfeld number of a non-dimensional load, and the load of a Sommerfeld number.

    Parameters
    ----------
    load : float
        Magnitude, of ``eta omega R^3 L / C^2``, > 0; or a Sommerfeld number.

    Returns
    -------
    float
        ``S = 1 / (pi F)``, equal to ``eta N L D / W (R / C)^2``; or F.

    Raises
    ------
    ValueError
        The argument is not above zero.

    Examples
    --------
    >>> round(sommerfeld_number(1.2), 4), round(sommerfeld_number(sommerfeld_number(1.2)), 4)
    (0.2653, 1.2)
    """
    if not load > 0:
        raise ValueError(f"load = {load} must be > 0; without load there is no Sommerfeld number")
    return 1 / (math.pi * load)


# --- equilibrium


def equilibrium(
    geometry: FilmGeometry,
    load: ArrayLike,
    *,
    rung: str = "direct",
    tilt: tuple[float, float] = (0.0, 0.0),
    start: ArrayLike | None = None,
    tolerance: float = _TOLERANCE,
    raise_on_failure: bool = True,
) -> Equilibrium:
    """Position of the journal in which the film balances a steady load.

    Parameters
    ----------
    geometry : FilmGeometry
        Any bore, grooves and condition that the rung knows.
    load : array_like [shape=(2,)]
        Force on the journal, of ``eta omega R^3 L / C^2``. A Sommerfeld number S is a load of
        ``1 / (pi S)``.
    rung : str
        ``"short"``, ``"long"``, ``"finite"`` or ``"direct"``.
    tilt : tuple of float
        Values of tilt_x and tilt_y, held while the centre moves.
    start : array_like [shape=(2,)], optional
        Position to start from; by default that of a short bearing.
    tolerance : float
        Of the force left over, of the load.
    raise_on_failure : bool
        False returns the last position with its status instead.

    Returns
    -------
    Equilibrium
        Position, film and status.

    Raises
    ------
    BearingError
        No equilibrium was found; its status names the cure.
    ValueError
        The load is zero or not finite, or there is no such rung.

    Notes
    -----
    Newton's method, with the analytic stiffness where the rung is *direct*. Unknowns are the
    direction of the centre and the logit of its way to contact, equations are the logarithm and
    the direction of the force: these are nearly straight from the lightest load to the thinnest
    film, where the force itself grows like ``(1 - e)^(-3/2)`` and a plain Newton step would leave
    the bore. Steps that do not bring the force closer are halved; where that does not help, the
    plain equations are taken.

    Examples
    --------
    >>> found = equilibrium(FilmGeometry(length_to_diameter=1.0), [1.2, 0.0])
    >>> round(found.eccentricity_ratio, 2), round(math.degrees(found.attitude_angle))
    (0.4, 65)
    """
    w = _checked_load(load)
    if rung not in _RUNGS:
        raise ValueError(f"rung = '{rung}' must be one of {', '.join(_RUNGS)}")
    plain = geometry.bore is None and not geometry.grooves and tilt == (0.0, 0.0)
    plain = plain and geometry.inlet_fill == 1
    turned = plain and geometry.condition == "reynolds" and rung == "direct"
    force = _force_of(geometry, rung, tilt, turned)
    room = _room(geometry, tilt)
    reach = partial(_reach, room) if np.ptp(room) else _plain_reach
    first = _short_position(geometry, w) if start is None else np.asarray(start, dtype=float)
    if np.min(room) > 0:
        found = _seek(force, reach, w, first, tolerance)
    else:
        found = _Found(first, math.inf, 0, BearingStatus.NO_ROOM)
    angle = math.atan2(found.position[1], found.position[0]) if turned else 0.0
    result = Equilibrium(
        geometry=geometry,
        rung=rung,
        load=w,
        position=found.position,
        tilt=tilt,
        mesh_angle=angle,
        film=_film_at(geometry, rung, found.position, tilt, angle),
        residual=found.residual,
        iterations=found.iterations,
        status=found.status,
    )
    if result.status.ok and result.film.status is FilmStatus.COARSE:
        result = replace(result, status=BearingStatus.COARSE)
    if raise_on_failure and not result.status.ok:
        raise BearingError(result.status, f"load = ({w[0]:g}, {w[1]:g}) on rung '{rung}'")
    return result


_RUNGS = {rung.name: rung for rung in FILM_RUNGS if rung.bearing}


def _checked_load(load: ArrayLike) -> Vector:
    w = np.asarray(load, dtype=float)
    if w.shape != (2,) or not np.all(np.isfinite(w)) or not np.any(w):
        raise ValueError(
            f"load = {load!r} must be two finite numbers, not both 0; the direction of the journal "
            "is that of its load"
        )
    return w


def _angle_between(first: Vector, second: Vector) -> float:
    """From the first to the second, in (-pi, pi] [rad]."""
    cross = first[0] * second[1] - first[1] * second[0]
    return math.atan2(cross, float(first @ second))


def turn_by(angle: float) -> Vector:
    """Matrix that turns a vector [shape=(2, 2)]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def _short_position(geometry: FilmGeometry, load: Vector) -> Vector:
    """Where a short bearing would carry the load, its force lowered as a finite length does."""
    square = geometry.length_to_diameter**2
    e = short_eccentricity(float(np.hypot(*load)) * (1 / square + 0.5))
    e = min(e, 0.99)
    direction: Vector = turn_by(short_attitude(e)) @ load / np.hypot(*load)
    return e * direction


class _Force(NamedTuple):
    """Of the film on a journal at rest, and its stiffness."""

    force: Vector
    stiffness: Vector
    ok: bool


class _Found(NamedTuple):
    position: Vector
    residual: float
    iterations: int
    status: BearingStatus


def _force_of(
    geometry: FilmGeometry, rung: str, tilt: tuple[float, float], turned: bool
) -> Callable[[Vector], _Force]:
    """Force and stiffness by the position of the journal."""
    if rung != "direct":
        return partial(_any_force, geometry, rung, tilt)
    if geometry.inlet_fill < 1:
        return partial(_starved_force, starved_film(geometry, tilted=any(tilt)))
    work = direct_film(geometry, tilted=tilt != (0.0, 0.0))
    return partial(_turned_force if turned else _direct_force, work, tilt)


def _any_force(
    geometry: FilmGeometry, rung: str, tilt: tuple[float, float], position: Vector
) -> _Force:
    state = _at_rest(position, tilt)
    film = _RUNGS[rung].field(geometry, state)
    if film.status not in (FilmStatus.OK, FilmStatus.COARSE):
        return _Force(film.force, np.zeros((2, 2)), False)
    return _Force(
        film.force, displaced_film(geometry, state, rung, JOURNAL_MOTIONS[:2], DISPLACEMENT), True
    )


def _direct_force(work: DirectFilm, tilt: tuple[float, float], position: Vector) -> _Force:
    x, y = position
    force = np.array(direct_tilted_force(work, x, y, 0.0, 0.0, *tilt, 0.0, 0.0))
    ok = work.outcome[STATUS] == DIRECT_OK
    if not ok:
        return _Force(force, np.zeros((2, 2)), False)
    stiffness = perturbation(work, _at_rest(position, tilt)).stiffness
    return _Force(force, stiffness[:2, :2], True)


def _starved_force(work: DirectFilm, position: Vector) -> _Force:
    """With the stiffness by central differences: the front moves with the journal."""

    def at(place: Vector) -> Vector:
        return np.array(starved_force(work, float(place[0]), float(place[1]), 0.0, 0.0))

    columns = [
        (at(position - aside) - at(position + aside)) / (2 * DISPLACEMENT)
        for aside in DISPLACEMENT * np.eye(2)
    ]
    force = at(position)
    return _Force(force, np.array(columns).T, bool(work.outcome[STATUS] == DIRECT_OK))


def _turned_force(work: DirectFilm, tilt: tuple[float, float], position: Vector) -> _Force:
    """On a mesh along the line of centres, which turns with the journal, and with it the force."""
    e = float(np.hypot(*position))
    along = _direct_force(work, tilt, np.array([e, 0.0]))
    stiffness = along.stiffness.copy()
    stiffness[:, 1] = [along.force[1] / e, -along.force[0] / e]
    turn = turn_by(math.atan2(position[1], position[0]))
    return _Force(turn @ along.force, turn @ stiffness @ turn.T, along.ok)


def _at_rest(position: Vector, tilt: tuple[float, float]) -> FilmState:
    return FilmState(x=float(position[0]), y=float(position[1]), tilt_x=tilt[0], tilt_y=tilt[1])


def _film_at(
    geometry: FilmGeometry,
    rung: str,
    position: Vector,
    tilt: tuple[float, float],
    mesh_angle: float,
) -> FilmSolution:
    return _RUNGS[rung].field(geometry, _at_rest(turn_by(-mesh_angle) @ position, tilt))


def _plain_reach(angle: float) -> float:  # noqa: ARG001 - that of any direction
    return 1.0


def _room(geometry: FilmGeometry, tilt: tuple[float, float]) -> Vector:
    """Gap by the angle with the centre in the middle; a tilted journal is nearest at an end."""
    bore = np.zeros(geometry.n_theta) if geometry.bore is None else geometry.bore
    angle = angles_around(geometry.n_theta)
    room: Vector = 1 + bore - 0.5 * np.abs(tilt[0] * np.cos(angle) + tilt[1] * np.sin(angle))
    return room


def angles_around(count: int) -> Vector:
    """Of the lines of a mesh [rad, shape=(count,)]."""
    return 2 * math.pi * np.arange(count) / count


def _reach(room: Vector, direction: float) -> float:
    """Largest distance of the centre from the middle before the journal touches."""
    cosine = np.cos(angles_around(room.size) - direction)
    ahead = cosine > 1e-6
    return float(np.min(room[ahead] / cosine[ahead]))


def _seek(
    force: Callable[[Vector], _Force],
    reach: Callable[[float], float],
    load: Vector,
    start: Vector,
    tolerance: float,
) -> _Found:
    """Newton from the start, and only where that fails from all round the bore."""
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
    force: Callable[[Vector], _Force],
    reach: Callable[[float], float],
    load: Vector,
    position: Vector,
    tolerance: float,
    path: "_Path",
) -> _Found:
    """Newton's method, each step halved until it brings the force closer."""
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
    return _Found(position, _residual(now, load), evaluations, status)


def _finite(now: _Force) -> bool:
    return bool(np.all(np.isfinite(now.stiffness)) and np.all(np.isfinite(now.force)))


def _residual(now: _Force, load: Vector) -> float:
    if not now.ok:
        return math.inf
    return float(np.hypot(*(now.force + load)) / np.hypot(*load))


def _at_the_wall(now: _Force, load: Vector) -> BearingStatus:
    """A film that opposes the load and is too weak at the wall itself will not carry it."""
    size = float(np.hypot(*now.force))
    against = -float(now.force @ load) / size / float(np.hypot(*load))
    weak = against > _OPPOSED and size < float(np.hypot(*load))
    return BearingStatus.OVERLOAD if weak else BearingStatus.NO_CONVERGENCE


_Path = Callable[
    [_Force, Vector, Vector, Callable[[float], float]],
    tuple[Callable[[float], Vector], Callable[[_Force], float]],
]
"""Force, load, position, reach -> position by the share of a step, and what it is to lower."""


def _log_path(
    now: _Force, load: Vector, position: Vector, reach: Callable[[float], float]
) -> tuple[Callable[[float], Vector], Callable[[_Force], float]]:
    place = _polar(position, reach)
    step = _log_step(now, load, place, reach)

    def move(fraction: float) -> Vector:
        return _cartesian(place + fraction * step, reach)

    def distance(trial: _Force) -> float:
        return float(np.hypot(*_log_residual(trial.force, load)))

    return move, distance


def _plain_path(
    now: _Force, load: Vector, position: Vector, reach: Callable[[float], float]
) -> tuple[Callable[[float], Vector], Callable[[_Force], float]]:
    step = np.linalg.lstsq(now.stiffness, now.force + load)[0]

    def move(fraction: float) -> Vector:
        aim = position + fraction * step
        direction = math.atan2(aim[1], aim[0])
        share = float(np.hypot(*position)) / reach(math.atan2(position[1], position[0]))
        most = (share + _NEAREST * (1 - share)) * reach(direction)
        away = float(np.hypot(*aim))
        return aim if away <= most else aim * (most / away)

    def distance(trial: _Force) -> float:
        return _residual(trial, load)

    return move, distance


def _polar(position: Vector, reach: Callable[[float], float]) -> Vector:
    """Logit of the way to contact, and direction [rad]."""
    direction = math.atan2(position[1], position[0])
    share = float(np.hypot(*position)) / reach(direction)
    share = min(max(share, 1e-9), 1 - 1e-9)
    return np.array([math.log(share / (1 - share)), direction])


def _cartesian(place: Vector, reach: Callable[[float], float]) -> Vector:
    e = reach(place[1]) / (1 + math.exp(-place[0]))
    return np.array([e * math.cos(place[1]), e * math.sin(place[1])])


def _log_residual(force: Vector, load: Vector) -> Vector:
    """Logarithm of the force over the load, and the angle that it is out of line."""
    size = float(np.hypot(*force))
    if size == 0:
        return np.array([math.inf, 0.0])
    return np.array([math.log(size / float(np.hypot(*load))), _angle_between(-load, force)])


def _log_step(now: _Force, load: Vector, place: Vector, reach: Callable[[float], float]) -> Vector:
    """Newton step of the logit and the direction, no longer than what a tangent can tell."""
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


def at_eccentricity(
    geometry: FilmGeometry,
    eccentricity_ratio: float,
    *,
    angle: float = 0.0,
    rung: str = "direct",
) -> Equilibrium:
    """Film of a journal that is held at an eccentricity, and the load that would hold it there.

    Parameters
    ----------
    geometry : FilmGeometry
        Bearing and cavitation condition: ``"guembel"`` (half film), ``"reynolds"`` or
        ``"periodic"``.
    eccentricity_ratio : float
        Distance of the centres over C, 0 < e < 1 (further where the bore is worn).
    angle : float
        Direction of the journal centre from the X axis [rad]; it matters in a bearing with grooves
        or a worn bore.
    rung : str
        ``"short"``, ``"long"``, ``"finite"`` or ``"direct"``.

    Returns
    -------
    Equilibrium
        As :func:`equilibrium` finds it for that load: `load`, `attitude_angle` and
        `sommerfeld_number`; :func:`friction`, :func:`flow` and :func:`coefficients` take it.

    Raises
    ------
    BearingError
        The mesh does not resolve so thin a film, or the journal touches the bore.
    ValueError
        The eccentricity is not above zero, or there is no such rung.

    Examples
    --------
    Raimondi and Boyd, L / D = 1, e = 0.6: S = 0.121, attitude angle 51 degrees.

    >>> held = at_eccentricity(FilmGeometry(length_to_diameter=1.0, condition="reynolds"), 0.6)
    >>> round(held.sommerfeld_number, 3), round(math.degrees(held.attitude_angle))
    (0.122, 51)
    """
    if not 0 < eccentricity_ratio < 2:
        raise ValueError(
            f"eccentricity_ratio = {eccentricity_ratio} must be > 0 and < 2; it is the distance of "
            "the centres over the radial clearance"
        )
    if rung not in _RUNGS:
        raise ValueError(f"rung = '{rung}' must be one of {', '.join(_RUNGS)}")
    plain = geometry.bore is None and not geometry.grooves
    mesh = angle if plain and geometry.condition == "reynolds" else 0.0
    position = eccentricity_ratio * np.array([math.cos(angle), math.sin(angle)])
    film = _RUNGS[rung].field(geometry, _at_rest(turn_by(-mesh) @ position, (0.0, 0.0)))
    status = _STATUS_OF_FILM.get(film.status, BearingStatus.NO_CONVERGENCE)
    if not status.ok:
        raise BearingError(status, f"eccentricity ratio {eccentricity_ratio:g}")
    return Equilibrium(
        geometry=geometry,
        rung=rung,
        load=-(turn_by(mesh) @ film.force),
        position=position,
        tilt=(0.0, 0.0),
        mesh_angle=mesh,
        film=film,
        residual=0.0,
        iterations=film.iterations,
        status=status,
    )


_STATUS_OF_FILM = {
    FilmStatus.OK: BearingStatus.OK,
    FilmStatus.COARSE: BearingStatus.COARSE,
    FilmStatus.TOUCH: BearingStatus.NO_ROOM,
}


# --- stiffness and damping


class JournalMotion(NamedTuple):
    """One of the four ways in which a journal can move."""

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
    """Fall of force and moment by each of the places, by central differences."""
    columns = []
    for place in places:
        ends = []
        for side in (-step, step):
            moved = replace(state, **{place.name: getattr(state, place.name) + side})
            film = _RUNGS[rung].field(geometry, moved)
            ends.append(np.concatenate([film.force, film.moment])[: len(places)])
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.array(columns).T


# --- friction, flow


def checked_positive(name: str, value: float, unit: str) -> None:
    """Refuse a quantity that is not > 0 and finite."""
    if not 0 < value < math.inf:
        raise ValueError(f"{name} = {value} {unit} must be > 0 and finite")
