"""Static and dynamic characteristics of a journal bearing, for any rung of the film.

Non-dimensional as the film: the journal centre is over the clearance C, ``tau = omega t``, and a
force is of ``eta omega R^3 L / C^2``, so that the Sommerfeld number is ``S = 1 / (pi |F|)``.
Stiffness and damping are ``K = -dF/dx`` and ``C = -dF/dx'``; with the tilt they are 4 x 4, in the
order X, Y, tilt_x, tilt_y. :func:`operate` speaks in SI.

============  ====================================================================================
coefficients  by
============  ====================================================================================
analytic      perturbation of the equations of the rung *direct*, the film's rim between the nodes:
              one factorisation
mesh          the same with the rim on the nodes: exact slopes of the mesh's own force
displacement  central differences of any rung, eight forces (sixteen with the tilt)
============  ====================================================================================
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..brief import brief
from .direct import DIRECT_OK, STATUS, DirectFilm, direct_tilted_force
from .rungs import FILM_RUNGS
from .slopes import Coefficients, perturbation
from .solve import (
    FilmGeometry,
    FilmSolution,
    FilmState,
    FilmStatus,
    direct_film,
    film_gap,
    starved_film,
)
from .starved import starved_force

Vector = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the load
_MOST_ITERATIONS = 60  # a handful from a fair start
_MOST_HALVINGS = 12
_LONGEST_STEP = 2.0  # of the logit of the eccentricity: a factor of 7 in the gap
_LEAST_ROOM = 1e-4  # of the way to contact; no mesh resolves a thinner film
_DISPLACEMENT = 1e-5  # of the least gap: rounding 1e-10, truncation less
_RATE = 1e-5  # of the surface speed's share of a gap
_REACH_STEP = 1e-6  # rad
_LEAST_LOGIT = -math.log(_LEAST_ROOM)
_OPPOSED = 0.8  # cosine: within 37 degrees of the load
_NEAREST = 0.9  # of the way to contact in one plain step

WHIRL_TOLERANCE = 0.03
"""Error of a threshold's speed that is let pass: a damping of 5 % changes it by more."""


class BearingStatus(IntEnum):
    """How the search for an equilibrium ended. Everything but OK carries a cure."""

    OK = 0
    OVERLOAD = 1
    NO_CONVERGENCE = 2
    NO_ROOM = 3
    COARSE = 4

    @property
    def ok(self) -> bool:
        """True where the equilibrium can be used."""
        return self is BearingStatus.OK

    @property
    def text(self) -> str:
        """One sentence with the cure."""
        return _STATUS_TEXT[self]


_STATUS_TEXT = {
    BearingStatus.OK: "done",
    BearingStatus.OVERLOAD: (
        "the film cannot carry this load with a gap that the mesh resolves; lower the load or the "
        "tilt, or raise the viscosity, the speed or the length"
    ),
    BearingStatus.NO_CONVERGENCE: (
        "no equilibrium was found; lower a groove's feed pressure that outweighs the load, choose "
        "condition = 'periodic', refine n_theta and n_z, or give a start closer to it"
    ),
    BearingStatus.NO_ROOM: (
        "the tilted journal touches the bore in every position; lower the tilt below 2 C from end "
        "to end"
    ),
    BearingStatus.COARSE: (
        "the film at the equilibrium is too thin for the mesh, and the position with it; raise "
        "n_theta, or lower the load"
    ),
}


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
        x, y = _turn(-self.mesh_angle) @ self.position
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


# --- short bearing, closed forms


def short_load(eccentricity_ratio: float) -> float:
    """Load of Ocvirk's short bearing, half film, over ``(L / D)^2``.

    Parameters
    ----------
    eccentricity_ratio : float
        0 <= e < 1.

    Returns
    -------
    float
        ``e sqrt(pi^2 (1 - e^2) + 16 e^2) / (1 - e^2)^2``.

    Raises
    ------
    ValueError
        The eccentricity ratio is outside [0, 1).

    Examples
    --------
    >>> round(1 / (math.pi * short_load(0.266298)) / 0.3**2, 3)  # Friswell et al., 5.5.1
    3.571
    """
    e = _eccentricity(eccentricity_ratio, least=0.0)
    return e * math.sqrt(math.pi**2 * (1 - e**2) + 16 * e**2) / (1 - e**2) ** 2


def short_attitude(eccentricity_ratio: float) -> float:
    """Attitude angle of Ocvirk's short bearing, half film [rad].

    ``tan phi = pi sqrt(1 - e^2) / (4 e)``, from pi/2 at the centre to 0 at the wall.

    Parameters
    ----------
    eccentricity_ratio : float
        From 0 to below 1.

    Returns
    -------
    float
        From the load to the journal centre [rad].

    Examples
    --------
    >>> round(math.degrees(short_attitude(0.266298)), 2)
    70.62
    """
    e = _eccentricity(eccentricity_ratio, least=0.0)
    return math.atan2(math.pi * math.sqrt(1 - e**2), 4 * e)


def short_eccentricity(load: float) -> float:
    """Eccentricity ratio of Ocvirk's short bearing: the inverse of :func:`short_load`.

    Parameters
    ----------
    load : float
        Non-dimensional, over ``(L / D)^2``, >= 0.

    Returns
    -------
    float
        0 <= e < 1.

    Raises
    ------
    ValueError
        The load is negative or not finite.

    Examples
    --------
    >>> round(short_eccentricity(1 / (math.pi * 3.571429 * 0.3**2)), 5)
    0.2663
    """
    if not 0 <= load < math.inf:
        raise ValueError(f"load = {load} must be >= 0 and finite; give its magnitude")
    if load == 0:
        return 0.0
    logit = math.log(load / math.pi) / 2  # about right at both ends
    for _ in range(_MOST_ITERATIONS):
        e = 1 / (1 + math.exp(-logit))
        root = math.pi**2 * (1 - e**2) + 16 * e**2
        slope = 1 + (16 - math.pi**2) * e**2 / root + 4 * e**2 / (1 - e**2)
        step = math.log(short_load(e) / load) / (slope * (1 - e))
        logit -= step
        if abs(step) < 1e-14 * max(1.0, abs(logit)):
            break
    return 1 / (1 + math.exp(-logit))


def short_coefficients(eccentricity_ratio: float) -> Coefficients:
    """Eight coefficients of Ocvirk's short bearing, half film: ``k C / W``, ``c C omega / W``.

    Parameters
    ----------
    eccentricity_ratio : float
        0 < e < 1.

    Returns
    -------
    Coefficients [shape=(2, 2)]
        X along the load, Y a quarter turn further in the sense of rotation.

    Raises
    ------
    ValueError
        The eccentricity ratio is outside (0, 1).

    Notes
    -----
    With ``p = pi^2``, ``q = 1 - e^2`` and ``h = (p q + 16 e^2)^(-3/2)``::

        Kxx = 4 h (p (1 + 2 e^2) + 32 e^2 (1 + e^2) / q)       Kyy = 4 h (p (2 - e^2) + 16 e^2)
        Kxy =  pi h (p q (1 + 2 e^2) + 32 e^2 (1 + e^2)) / (e sqrt q)
        Kyx = -pi h (p q^2 - 16 e^4) / (e sqrt q)
        Cxx = 2 pi h (p q^2 + 48 e^2) / (e sqrt q)
        Cyy = 2 pi h sqrt(q) (p (1 + 2 e^2) - 16 e^2) / e
        Cxy = Cyx = 8 h (p (1 + 2 e^2) - 16 e^2)

    Valid for L / D up to about 1/2 and e up to about 0.7.

    References
    ----------
    Friswell, Penny, Garvey, Lees (2010), Dynamics of Rotating Machines, Cambridge University
    Press, 177-181; its u is -Y here, its v is X.

    Examples
    --------
    >>> c = short_coefficients(0.266298)
    >>> [round(float(k) * 525 / 1e-4 / 1e6, 3) for k in c.stiffness.ravel()]  # MN/m
    [8.815, 25.06, -16.394, 12.808]
    """
    e = _eccentricity(eccentricity_ratio, least=np.nextafter(0.0, 1.0))
    p, q = math.pi**2, 1 - e**2
    h = (p * q + 16 * e**2) ** -1.5
    side = math.pi * h / (e * math.sqrt(q))
    bend = p * (1 + 2 * e**2)
    wall = 32 * e**2 * (1 + e**2)
    direct, cross = bend + wall / q, side * (bend * q + wall)
    stiffness = [[4 * h * direct, cross], [side * (16 * e**4 - p * q**2), 0.0]]
    stiffness[1][1] = 4 * h * (p * (2 - e**2) + 16 * e**2)
    coupled = 8 * h * (bend - 16 * e**2)
    across = 2 * side * q * (bend - 16 * e**2)
    damping = [[2 * side * (p * q**2 + 48 * e**2), coupled], [coupled, across]]
    return Coefficients(np.array(stiffness), np.array(damping))


def _eccentricity(value: float, *, least: float) -> float:
    if not least <= value < 1:
        bound = "[0, 1)" if least == 0 else "(0, 1)"
        raise ValueError(
            f"eccentricity_ratio = {value} must be in {bound}; it is the distance of the centres "
            "over the radial clearance"
        )
    return value


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
    >>> from .solve import FilmGeometry
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


def _turn(angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def _short_position(geometry: FilmGeometry, load: Vector) -> Vector:
    """Where a short bearing would carry the load, its force lowered as a finite length does."""
    square = geometry.length_to_diameter**2
    e = short_eccentricity(float(np.hypot(*load)) * (1 / square + 0.5))
    e = min(e, 0.99)
    direction: Vector = _turn(short_attitude(e)) @ load / np.hypot(*load)
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
    return _Force(film.force, _displaced(geometry, state, rung, _PLACES[:2], _DISPLACEMENT), True)


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
        (at(position - aside) - at(position + aside)) / (2 * _DISPLACEMENT)
        for aside in _DISPLACEMENT * np.eye(2)
    ]
    force = at(position)
    return _Force(force, np.array(columns).T, bool(work.outcome[STATUS] == DIRECT_OK))


def _turned_force(work: DirectFilm, tilt: tuple[float, float], position: Vector) -> _Force:
    """On a mesh along the line of centres, which turns with the journal, and with it the force."""
    e = float(np.hypot(*position))
    along = _direct_force(work, tilt, np.array([e, 0.0]))
    stiffness = along.stiffness.copy()
    stiffness[:, 1] = [along.force[1] / e, -along.force[0] / e]
    turn = _turn(math.atan2(position[1], position[0]))
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
    return _RUNGS[rung].field(geometry, _at_rest(_turn(-mesh_angle) @ position, tilt))


def _plain_reach(angle: float) -> float:  # noqa: ARG001 - that of any direction
    return 1.0


def _room(geometry: FilmGeometry, tilt: tuple[float, float]) -> Vector:
    """Gap by the angle with the centre in the middle; a tilted journal is nearest at an end."""
    bore = np.zeros(geometry.n_theta) if geometry.bore is None else geometry.bore
    angle = _angles(geometry.n_theta)
    room: Vector = 1 + bore - 0.5 * np.abs(tilt[0] * np.cos(angle) + tilt[1] * np.sin(angle))
    return room


def _angles(count: int) -> Vector:
    return 2 * math.pi * np.arange(count) / count


def _reach(room: Vector, direction: float) -> float:
    """Largest distance of the centre from the middle before the journal touches."""
    cosine = np.cos(_angles(room.size) - direction)
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
    for direction in _angles(8)
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
    while evaluations < _MOST_ITERATIONS and now.ok and np.any(now.force) and _finite(now):
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
    of_place = _turn(place[1]) @ np.array([[e * (1 - share), de], [0.0, e]])
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
    film = _RUNGS[rung].field(geometry, _at_rest(_turn(-mesh) @ position, (0.0, 0.0)))
    status = _STATUS_OF_FILM.get(film.status, BearingStatus.NO_CONVERGENCE)
    if not status.ok:
        raise BearingError(status, f"eccentricity ratio {eccentricity_ratio:g}")
    return Equilibrium(
        geometry=geometry,
        rung=rung,
        load=-(_turn(mesh) @ film.force),
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


class _Place(NamedTuple):
    """One of the four ways in which a journal can move."""

    name: str
    rate: str
    tilt: int


_PLACES = (
    _Place("x", "x_rate", 0),
    _Place("y", "y_rate", 0),
    _Place("tilt_x", "tilt_x_rate", 1),
    _Place("tilt_y", "tilt_y_rate", 1),
)


def coefficients(
    found: Equilibrium, *, method: str = "analytic", tilt: bool = False
) -> Coefficients:
    """Stiffness and damping of the film about an equilibrium.

    Parameters
    ----------
    found : Equilibrium
        Of :func:`equilibrium` or :func:`at_eccentricity`.
    method : str
        ``"analytic"`` or ``"mesh"`` (rung *direct* only), or ``"displacement"``.
    tilt : bool
        Adds the moments and the tilt.

    Returns
    -------
    Coefficients [shape=(2, 2) or (4, 4)]
        Forces and moments fall by ``stiffness @ (X, Y, tilt_x, tilt_y)`` and by ``damping @``
        their rates by tau. Over the magnitude of the load they are ``k C / W`` and
        ``c C omega / W``.

    Raises
    ------
    ValueError
        There is no such method, or it is asked of a rung whose equations it does not know.

    Notes
    -----
    *analytic* holds the film's rim where it is, between the nodes, and *mesh* at the nodes
    (:mod:`.film.slopes`): the first is near the film's own coefficients, the second the exact
    slopes of the mesh's force, as *displacement* has them but for its truncation. With *guembel*
    all nodes are solved for, and count as far as the pressure is above zero. Under *reynolds*
    P = 0 stays where the widest gap is at rest.

    Damping is symmetric, except with *guembel*.

    Error by the mesh, of the largest coefficient of its kind, at worst of S from 0.05 to 1, L / D
    1/2 and 1, with and without two grooves: 0.7 % on 72 x 17 nodes, 0.16 % on 144 x 33 (*mesh*:
    5 % and 1.3 %). :func:`whirl` states it for the bearing at hand.

    Examples
    --------
    >>> found = equilibrium(FilmGeometry(length_to_diameter=0.5), [0.5, 0.0])
    >>> own = coefficients(found, method="mesh")
    >>> displaced = coefficients(found, method="displacement")
    >>> bool(np.allclose(own.stiffness, displaced.stiffness, rtol=1e-6))
    True
    """
    if method not in _METHODS:
        raise ValueError(f"method = '{method}' must be one of {', '.join(_METHODS)}")
    if method != "displacement" and found.geometry.inlet_fill < 1:
        raise ValueError(
            f"method = '{method}' of inlet_fill = {found.geometry.inlet_fill} must be "
            "'displacement'; the front of a starved film moves with the journal"
        )
    if method != "displacement" and found.rung != "direct":
        raise ValueError(
            f"method = '{method}' of rung '{found.rung}' must be 'displacement'; only the rung "
            "'direct' has its equations taken apart"
        )
    own = _METHODS[method](found, tilt)
    turn = np.kron(np.eye(2 if tilt else 1), _turn(found.mesh_angle))
    return Coefficients(turn @ own.stiffness @ turn.T, turn @ own.damping @ turn.T)


def _by_perturbation(resolved: bool, found: Equilibrium, tilt: bool) -> Coefficients:
    state = found.state
    work = direct_film(found.geometry, tilted=tilt or found.tilt != (0.0, 0.0))
    tilts = (state.tilt_x, state.tilt_y, 0.0, 0.0)
    direct_tilted_force(work, state.x, state.y, 0.0, 0.0, *tilts)
    own = perturbation(work, state, resolved=resolved)
    return own if tilt else Coefficients(own.stiffness[:2, :2], own.damping[:2, :2])


def _by_displacement(found: Equilibrium, tilt: bool) -> Coefficients:
    places = _PLACES if tilt else _PLACES[:2]
    rates = tuple(place._replace(name=place.rate) for place in places)
    state, room = found.state, found.film.min_thickness
    geometry, rung = found.geometry, found.rung
    return Coefficients(
        _displaced(geometry, state, rung, places, _DISPLACEMENT * room),
        _displaced(geometry, state, rung, rates, _RATE),
    )


_METHODS: dict[str, Callable[[Equilibrium, bool], Coefficients]] = {
    "analytic": partial(_by_perturbation, True),
    "mesh": partial(_by_perturbation, False),
    "displacement": _by_displacement,
}


def _displaced(
    geometry: FilmGeometry, state: FilmState, rung: str, places: tuple[_Place, ...], step: float
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


def friction(found: Equilibrium) -> float:
    """Friction on the journal, of ``eta omega R^2 L / C``.

    Parameters
    ----------
    found : Equilibrium
        Of :func:`equilibrium` or :func:`at_eccentricity`.

    Returns
    -------
    float
        Divided by the magnitude of the load it is the friction variable ``(R / C) f``.

    Notes
    -----
    Shear of the journal's surface, ``eta U / h + (h / 2) dp/dx`` over the whole circumference, so
    ``∬ (1/H + (H/2) dP/dtheta) dtheta dz``; where the film is ruptured the first part stays, as
    though the streaks of oil filled the gap. The second part is taken by parts, where it is exact
    for the mesh: with the gap's wedge, ``-∬ (P/2) dH/dtheta``. Taking the first part on the
    pressurised region alone gives 0.55 to 0.67 of this.

    Examples
    --------
    >>> found = equilibrium(
    ...     FilmGeometry(length_to_diameter=1.0, condition="reynolds"),
    ...     [sommerfeld_number(0.121), 0.0],
    ... )
    >>> round(friction(found) * math.pi * 0.121, 2)  # Raimondi and Boyd: 3.22
    3.22
    """
    gap, face = _gaps(found)
    n, k = gap.shape
    lengths = _trapezoid(k)
    shear = float(np.sum(lengths / gap)) * 2 * math.pi / n
    wedge = face - np.roll(face, 1, axis=0)
    drag: float = shear - 0.5 * float(np.sum(lengths * found.film.pressure * wedge))
    return drag


@dataclass(frozen=True, kw_only=True)
class Flow:
    """Oil through a bearing, of ``R C N L`` with N in revolutions per second.

    Attributes
    ----------
    through : float
        Along the circumference past the widest gap.
    side : float
        Out of both ends together.
    """

    through: float
    side: float


def flow(found: Equilibrium) -> Flow:
    """Flow through the widest section and out of the ends.

    Parameters
    ----------
    found : Equilibrium
        Of :func:`equilibrium` or :func:`at_eccentricity`.

    Returns
    -------
    Flow
        Of ``R C N L``.

    Notes
    -----
    Along the circumference ``2 pi ∫ (H/2 - H^3/12 dP/dtheta) dz``, at the face behind the line of
    the widest gap where the film begins there, else the mean over both its faces; out of the ends
    ``-(pi/6) (R/L)^2 ∫ H^3 dP/dz dtheta`` with the slope of a parabola through three nodes.
    Without eccentricity the first is pi, and the second nothing.

    Examples
    --------
    >>> found = equilibrium(
    ...     FilmGeometry(length_to_diameter=1.0, condition="reynolds"),
    ...     [sommerfeld_number(0.121), 0.0],
    ... )
    >>> oil = flow(found)  # Raimondi and Boyd: 4.33 and 0.680
    >>> round(oil.through, 2), round(oil.side / oil.through, 2)
    (4.33, 0.68)
    """
    gap, face = _gaps(found)
    n, k = gap.shape
    pressure = found.film.pressure
    step = 2 * math.pi / n
    rise = (np.roll(pressure, -1, axis=0) - pressure) / step
    section = 2 * math.pi * (face / 2 - face**3 * rise / 12) @ _trapezoid(k)
    line = int(np.argmax(gap[:, k // 2]))
    opens = not np.any(pressure[line] > 0)
    through = section[line] if opens else 0.5 * (section[line] + section[line - 1])
    factor = math.pi / 6 * 0.25 / found.geometry.length_to_diameter**2 * step
    return Flow(through=float(through), side=factor * _end_slopes(pressure, gap))


def _end_slopes(pressure: Vector, gap: Vector) -> float:
    """Sum of H^3 |dP/dz| over the nodes of both ends."""
    length_step = 1.0 / (pressure.shape[1] - 1)
    first = (4 * pressure[:, 1] - pressure[:, 2]) / (2 * length_step)
    last = (4 * pressure[:, -2] - pressure[:, -3]) / (2 * length_step)
    return float(gap[:, 0] ** 3 @ first + gap[:, -1] ** 3 @ last)


def _gaps(found: Equilibrium) -> tuple[Vector, Vector]:
    """H at the nodes and at the faces behind them (n_theta, n_z)."""
    state, geometry = found.state, found.geometry
    z = np.linspace(-0.5, 0.5, geometry.n_z)
    behind = _angles(geometry.n_theta) + math.pi / geometry.n_theta
    face = 1 - np.outer(np.cos(behind), state.x + z * state.tilt_x)
    face -= np.outer(np.sin(behind), state.y + z * state.tilt_y)
    if geometry.bore is not None:
        face += 0.5 * (geometry.bore + np.roll(geometry.bore, -1))[:, None]
    return film_gap(geometry, state), face


def _trapezoid(count: int) -> Vector:
    weights = np.full(count, 1.0 / (count - 1))
    weights[[0, -1]] *= 0.5
    return weights


# --- stability


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """Where a rigid rotor on its bearings begins to whirl.

    Attributes
    ----------
    stiffness : float
        Equivalent stiffness at the threshold, in the unit of the stiffness given.
    whirl_ratio : float
        Frequency of the whirl over that of the rotation; 0 where no speed is unstable.
    mass : float
        ``m C omega^2 / W`` at the threshold, for coefficients over the load: the rotor's mass for
        each bearing is stable below; inf where no speed is unstable.
    """

    stiffness: float
    whirl_ratio: float
    mass: float

    @property
    def speed(self) -> float:
        """``omega sqrt(C / g)`` at the threshold of a rotor whose weight is the load."""
        return math.sqrt(self.mass)


def stability(c: Coefficients) -> Threshold:
    """Threshold of a rigid rotor from its eight coefficients, by Routh and Hurwitz.

    Parameters
    ----------
    c : Coefficients [shape=(2, 2) or more]
        Over the load, as tables print them; of a larger matrix the forces by the centre.

    Returns
    -------
    Threshold
        Speed, frequency and mass.

    Raises
    ------
    ValueError
        The damping is not positive definite: no film at rest has such a one.

    Notes
    -----
    At the threshold ``m x'' + C x' + K x = 0`` has a circular frequency ``lambda omega``::

        kappa = (Kxx Cyy + Kyy Cxx - Kxy Cyx - Kyx Cxy) / (Cxx + Cyy)
        lambda^2 = ((Kxx - kappa) (Kyy - kappa) - Kxy Kyx) / (Cxx Cyy - Cxy Cyx)
        m C omega^2 / W = kappa / lambda^2

    The rotor is symmetric and its tilt left out; coefficients belong to one Sommerfeld number,
    which itself depends on the speed.

    Examples
    --------
    >>> threshold = stability(short_coefficients(0.3))
    >>> [round(v, 4) for v in (threshold.whirl_ratio, threshold.speed)]
    [0.5194, 2.6058]
    """
    kappa, square = _neutral(c)
    if square <= 0:
        return Threshold(stiffness=kappa, whirl_ratio=0.0, mass=math.inf)
    return Threshold(stiffness=kappa, whirl_ratio=math.sqrt(square), mass=max(0.0, kappa / square))


def _neutral(c: Coefficients) -> tuple[float, float]:
    """Equivalent stiffness and square of the whirl ratio at the threshold."""
    (kxx, kxy), (kyx, kyy) = c.stiffness[:2, :2]
    (cxx, cxy), (cyx, cyy) = c.damping[:2, :2]
    determinant = cxx * cyy - cxy * cyx
    if not (cxx + cyy > 0 and determinant > 0):
        raise ValueError(
            f"damping of determinant {determinant:g} must be positive definite; give the "
            "coefficients of a film about its equilibrium"
        )
    kappa = (kxx * cyy + kyy * cxx - kxy * cyx - kyx * cxy) / (cxx + cyy)
    square = ((kxx - kappa) * (kyy - kappa) - kxy * kyx) / determinant
    return float(kappa), float(square)


@dataclass(frozen=True, kw_only=True)
class Whirl:
    """Where a rotor begins to whirl, and how far the mesh lets that be known.

    Attributes
    ----------
    threshold : Threshold
        Of the coefficients over the load; where the mesh cannot tell whether there is a threshold
        at all, the least mass that may whirl.
    coefficients : Coefficients [shape=(2, 2)]
        Over the load, extrapolated from the two finest meshes.
    stiffness_error, damping_error : float
        By how much the extrapolation has changed the finest mesh's coefficients, at the most, of
        the largest of its kind.
    speed_error : float
        Of `threshold.speed`, relative; 0 where no speed is unstable and the mesh leaves no doubt,
        inf where it cannot tell, NaN where only one mesh was looked at.
    n_theta, n_z : int
        Of the finest mesh.
    """

    threshold: Threshold
    coefficients: Coefficients
    stiffness_error: float
    damping_error: float
    speed_error: float
    n_theta: int
    n_z: int

    __repr__ = brief("resolved", "stiffness_error", "damping_error", "speed_error")

    @property
    def resolved(self) -> bool:
        """Whether it is known that there is a threshold, or that there is none."""
        return self.speed_error < math.inf


def whirl(found: Equilibrium, *, tolerance: float = WHIRL_TOLERANCE) -> Whirl:
    """Threshold of a rigid rotor, on meshes as fine as its error asks for.

    Parameters
    ----------
    found : Equilibrium
        On the coarsest of the meshes.
    tolerance : float
        Of the threshold's speed, > 0.

    Returns
    -------
    Whirl
        Its error is above the tolerance where twice the finest mesh would have more than
        288 x 65 nodes.

    Raises
    ------
    ValueError
        The tolerance is not above zero.

    Notes
    -----
    The coefficients' error is of second order (:mod:`.film.slopes`): those of a mesh and of one of
    half its width give better ones, and the change is the error stated. Of the threshold it is
    that of ``W / (m C omega^2)``, which passes through zero where the last speed becomes stable;
    there the relative error of the speed has no bound, and meshes are halved until the sign is
    sure or they end. Other rungs than *direct* are looked at on their one mesh.

    Two meshes take some 6 times the time of the first alone, a third 60 to 100 times.

    Examples
    --------
    >>> found = equilibrium(FilmGeometry(length_to_diameter=0.5), [0.5, 0.0])
    >>> limit = whirl(found)
    >>> round(limit.threshold.speed, 2), limit.speed_error < 0.01
    (2.55, True)
    """
    _checked_positive("tolerance", tolerance, "of the speed")
    load = float(np.hypot(*found.load))
    exact = found.rung == "direct" and found.geometry.inlet_fill == 1
    own = coefficients(found, method="analytic" if exact else "displacement").per_load(load)
    geometry = found.geometry
    told = Whirl(
        threshold=stability(own),
        coefficients=own,
        stiffness_error=math.nan,
        damping_error=math.nan,
        speed_error=math.nan,
        n_theta=geometry.n_theta,
        n_z=geometry.n_z,
    )
    place = found.position
    while exact and not told.speed_error <= tolerance:
        geometry = doubled(geometry)
        finer = equilibrium(
            geometry, found.load, tilt=found.tilt, start=place, raise_on_failure=False
        )
        if not finer.status.ok:
            break
        fine, place = coefficients(finer).per_load(load), finer.position
        told, own = _extrapolated(own, fine, geometry), fine
        if 2 * geometry.n_theta > _FINEST[0] or 2 * geometry.n_z - 1 > _FINEST[1]:
            break
    return told


_FINEST = (288, 65)


def doubled(geometry: FilmGeometry) -> FilmGeometry:
    """The same film on a mesh of half the width both ways; a bore is linear between its nodes."""
    bore = geometry.bore
    if bore is not None:
        bore = np.stack([bore, 0.5 * (bore + np.roll(bore, -1))], axis=1).ravel()
    return replace(geometry, n_theta=2 * geometry.n_theta, n_z=2 * geometry.n_z - 1, bore=bore)


def _extrapolated(coarse: Coefficients, fine: Coefficients, geometry: FilmGeometry) -> Whirl:
    """By Richardson from two meshes, the finer of half the width."""
    changes = [(b - a) / 3 for a, b in zip(coarse, fine, strict=True)]
    best = Coefficients(*(b + change for b, change in zip(fine, changes, strict=True)))
    errors = [
        float(np.abs(change).max() / np.abs(own).max())
        for own, change in zip(best, changes, strict=True)
    ]
    inverse = _inverse_mass(best)
    doubt = abs(inverse - _inverse_mass(fine))
    threshold, error = stability(best), 0.0
    if inverse - doubt > 0:
        error = math.sqrt(inverse / (inverse - doubt)) - 1
    elif inverse + doubt > 0:
        threshold, error = replace(threshold, mass=1 / (inverse + doubt)), math.inf
    return Whirl(
        threshold=threshold,
        coefficients=best,
        stiffness_error=errors[0],
        damping_error=errors[1],
        speed_error=error,
        n_theta=geometry.n_theta,
        n_z=geometry.n_z,
    )


def _inverse_mass(c: Coefficients) -> float:
    """W / (m C omega^2) at the threshold, below zero where no speed is unstable."""
    kappa, square = _neutral(c)
    return square / kappa if kappa > 0 else math.inf


# --- in SI


@dataclass(frozen=True, kw_only=True, eq=False)
class JournalBearing:
    """A bearing in SI.

    Attributes
    ----------
    diameter, length : float
        Of the bearing [m].
    clearance : float
        Radial, bore radius less journal radius [m].
    viscosity : float
        Dynamic [Pa s].
    film : FilmGeometry, optional
        Mesh, condition, bore and grooves, with the same L / D; by default a plain bearing.

    Raises
    ------
    ValueError
        A number is not above zero, or the film has another L / D.
    """

    diameter: float
    length: float
    clearance: float
    viscosity: float
    film: FilmGeometry | None = None

    def __post_init__(self) -> None:
        for name, unit in (
            ("diameter", "m"),
            ("length", "m"),
            ("clearance", "m"),
            ("viscosity", "Pa s"),
        ):
            _checked_positive(f"bearing.{name}", getattr(self, name), unit)
        ratio = self.length / self.diameter
        if self.film is not None and not math.isclose(
            self.film.length_to_diameter, ratio, rel_tol=1e-9
        ):
            raise ValueError(
                f"film.length_to_diameter = {self.film.length_to_diameter:g} must be "
                f"length / diameter = {ratio:g}; give the film that ratio"
            )

    @property
    def geometry(self) -> FilmGeometry:
        """Of the film."""
        if self.film is not None:
            return self.film
        return FilmGeometry(length_to_diameter=self.length / self.diameter)

    def force_unit(self, speed: float) -> float:
        """``eta omega R^3 L / C^2``, the unit of the non-dimensional force [N]."""
        radius = self.diameter / 2
        return self.viscosity * speed * radius**3 * self.length / self.clearance**2


@dataclass(frozen=True, kw_only=True)
class OperatingPoint:
    """A bearing at a speed and a load, in SI.

    Attributes
    ----------
    equilibrium : Equilibrium
        Non-dimensional.
    load : numpy.ndarray [shape=(2,)]
        Force on the journal [N].
    sommerfeld_number : float
    eccentricity_ratio : float
    attitude_angle : float
        From the load to the journal centre [rad].
    position : numpy.ndarray [shape=(2,)]
        Journal centre [m].
    least_film : float
        [m]
    peak_pressure : float
        [Pa]
    friction_moment : float
        On the journal [N m].
    power_loss : float
        [W]
    through_flow, side_flow : float
        Past the widest gap, and out of both ends [m^3/s].
    stiffness : numpy.ndarray [shape=(2, 2) or (4, 4)]
        Of X, Y [N/m], with the tilt also of the slopes of the axis: [N/rad], [N m/m], [N m/rad].
    damping : numpy.ndarray [shape=(2, 2) or (4, 4)]
        The same times a second.
    whirl : Whirl
        Errors of the coefficients and of the threshold by the mesh, and the finer meshes' own.
    threshold : Threshold
        Of a rigid rotor, from `whirl`; `stiffness` and `mass` are over the load.
    critical_mass : float
        Rotor mass for each bearing above which it whirls at this speed and load [kg], or may
        whirl where not ``whirl.resolved``; inf only where it is sure that none does. Its relative
        error is twice ``whirl.speed_error``.
    """

    equilibrium: Equilibrium
    load: Vector
    sommerfeld_number: float
    eccentricity_ratio: float
    attitude_angle: float
    position: Vector
    least_film: float
    peak_pressure: float
    friction_moment: float
    power_loss: float
    through_flow: float
    side_flow: float
    stiffness: Vector
    damping: Vector
    whirl: Whirl
    threshold: Threshold
    critical_mass: float

    __repr__ = brief(
        "eccentricity_ratio", "attitude_angle", "sommerfeld_number", "least_film", "peak_pressure"
    )


def operate(
    bearing: JournalBearing,
    *,
    speed: float,
    load: ArrayLike | None = None,
    eccentricity_ratio: float | None = None,
    rung: str = "direct",
    slope: tuple[float, float] = (0.0, 0.0),
    tilt_coefficients: bool = False,
) -> OperatingPoint:
    """All that a steadily loaded bearing shows, in SI.

    Parameters
    ----------
    bearing : JournalBearing
        In SI.
    speed : float
        Of the journal, turning from X to Y [rad/s].
    load : array_like [shape=(2,)], optional
        Force on the journal [N]; this or `eccentricity_ratio`.
    eccentricity_ratio : float, optional
        At which the journal is held on the X axis, without slope; the load follows.
    rung : str
        Of the film.
    slope : tuple of float
        Of the journal's axis in the bearing, in the planes XZ and YZ [rad].
    tilt_coefficients : bool
        Adds moments and slopes to stiffness and damping.

    Returns
    -------
    OperatingPoint
        In SI.

    Raises
    ------
    BearingError
        No film can carry the load, or no equilibrium was found.
    ValueError
        The speed is not above zero, the load is zero, or not exactly one of load and eccentricity
        is given.

    Notes
    -----
    Isothermal and laminar. A groove's pressure is part of the film and non-dimensional, of
    ``eta omega (R / C)^2``.

    Examples
    --------
    >>> bearing = JournalBearing(diameter=0.1, length=0.1, clearance=50e-6, viscosity=0.1)
    >>> point = operate(bearing, speed=2 * math.pi * 20, load=[100e3, 0.0])
    >>> round(point.sommerfeld_number, 3), round(point.eccentricity_ratio, 2)
    (0.2, 0.47)
    >>> held = operate(bearing, speed=2 * math.pi * 20, eccentricity_ratio=0.47)
    >>> bool(abs(np.hypot(*held.load) / 100e3 - 1) < 0.02)
    True
    """
    _checked_positive("speed", speed, "rad/s")
    unit = bearing.force_unit(speed)
    c, length = bearing.clearance, bearing.length
    if (load is None) == (eccentricity_ratio is None):
        raise ValueError("load and eccentricity_ratio: one of them must be given, not both")
    if eccentricity_ratio is not None:
        if slope != (0.0, 0.0):
            raise ValueError(f"slope = {slope} rad must be 0 with eccentricity_ratio; give a load")
        found = at_eccentricity(bearing.geometry, eccentricity_ratio, rung=rung)
    else:
        found = equilibrium(
            bearing.geometry,
            np.asarray(load, dtype=float) / unit,
            rung=rung,
            tilt=(slope[0] * length / c, slope[1] * length / c),
        )
    method = "analytic" if rung == "direct" else "displacement"
    film = coefficients(found, method=method, tilt=tilt_coefficients)
    limit = whirl(found)
    newton = float(np.hypot(*found.load)) * unit
    moment = friction(found) * unit * c  # eta omega R^2 L / C times R
    oil = flow(found)
    flow_unit = bearing.diameter / 2 * c * speed / (2 * math.pi) * length
    film = _in_metres(film, length)
    return OperatingPoint(
        equilibrium=found,
        load=found.load * unit,
        sommerfeld_number=found.sommerfeld_number,
        eccentricity_ratio=found.eccentricity_ratio,
        attitude_angle=found.attitude_angle,
        position=c * found.position,
        least_film=c * found.film.min_thickness,
        peak_pressure=float(found.film.pressure.max()) * unit / (bearing.diameter / 2 * length),
        friction_moment=moment,
        power_loss=moment * speed,
        through_flow=oil.through * flow_unit,
        side_flow=oil.side * flow_unit,
        stiffness=film.stiffness * unit / c,
        damping=film.damping * unit / (c * speed),
        whirl=limit,
        threshold=limit.threshold,
        critical_mass=limit.threshold.mass * newton / (c * speed**2),
    )


def _in_metres(c: Coefficients, length: float) -> Coefficients:
    """By slopes instead of tilts over the length, of moments instead of shares of the length."""
    scale = np.ones(c.stiffness.shape[0])
    scale[2:] = length
    both = np.outer(scale, scale)
    return Coefficients(c.stiffness * both, c.damping * both)


def _checked_positive(name: str, value: float, unit: str) -> None:
    if not 0 < value < math.inf:
        raise ValueError(f"{name} = {value} {unit} must be > 0 and finite")
