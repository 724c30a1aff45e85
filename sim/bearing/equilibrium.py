"""Equilibrium of a journal bearing, for any rung of the film.

Non-dimensional like the film: the journal centre is over the clearance C, ``tau = omega t``, and
forces are in units of ``eta omega R^3 L / C^2``, so that the Sommerfeld number is
``S = 1 / (pi |F|)``.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..brief import brief
from ..film.solve import (
    FilmGeometry,
    FilmSolution,
    FilmState,
    FilmStatus,
)
from .bearing_status import BearingError, BearingStatus
from .film_force import (
    RUNGS,
    angles_around,
    at_rest,
    film_force,
    turn_by,
)
from .search import SearchResult, angle_between, search
from .short_bearing import short_attitude, short_eccentricity

Vector = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the load


@dataclass(frozen=True, kw_only=True)
class Equilibrium:
    """Equilibrium of a journal at a steady load.

    Attributes
    ----------
    geometry : FilmGeometry
        Geometry of the film, as passed.
    rung : str
        Rung of the film.
    load : numpy.ndarray [shape=(2,)]
        Force on the journal, balanced by the film.
    position : numpy.ndarray [shape=(2,)]
        Journal centre over C.
    tilt : tuple of float
        tilt_x, tilt_y as passed.
    mesh_angle : float
        Direction of the mesh's first line [rad]. Non-zero only for a plain, aligned bearing with
        the condition *reynolds*, whose mesh follows the line of centres: P = 0 is at
        the widest gap and would otherwise jump from line to line.
    film : FilmSolution
        Film in equilibrium, on that mesh.
    residual : float
        Residual force, over the load.
    iterations : int
        Number of film solutions.
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
        """Angle from load to journal centre, positive with the rotation, in (-pi, pi] [rad]."""
        return angle_between(self.load, self.position)

    @property
    def sommerfeld_number(self) -> float:
        """``S = eta N L D / W (R / C)^2`` with N in revolutions per second."""
        return sommerfeld_number(float(np.hypot(*self.load)))

    @property
    def state(self) -> FilmState:
        """State of the film, on its mesh."""
        x, y = turn_by(-self.mesh_angle) @ self.position
        return FilmState(
            x=float(x), y=float(y), x_rate=0.0, y_rate=0.0, tilt_x=self.tilt[0], tilt_y=self.tilt[1]
        )


def sommerfeld_number(load: float) -> float:
    """Sommerfeld number of a non-dimensional load, or load of a Sommerfeld number.

    Parameters
    ----------
    load : float
        Magnitude in units of ``eta omega R^3 L / C^2``, > 0; or a Sommerfeld number.

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
    """Position of the journal in equilibrium with a steady load.

    Parameters
    ----------
    geometry : FilmGeometry
        Any bore, grooves and condition supported by the rung.
    load : array_like [shape=(2,)]
        Force on the journal, in units of ``eta omega R^3 L / C^2``. A Sommerfeld number S is a
        load of ``1 / (pi S)``.
    rung : str
        ``"short"``, ``"long"``, ``"finite"`` or ``"direct"``.
    tilt : tuple of float
        Values of tilt_x and tilt_y, fixed while the centre moves.
    start : array_like [shape=(2,)], optional
        Start of the search; by default the position in a short bearing.
    tolerance : float
        Largest residual force, over the load.
    raise_on_failure : bool
        False: return the last position with its status instead.

    Returns
    -------
    Equilibrium
        Position, film and status.

    Raises
    ------
    BearingError
        No equilibrium was found; its status gives the cure.
    ValueError
        The load is zero or not finite, or there is no such rung.

    Notes
    -----
    Newton's method, with the analytic stiffness for the rung *direct*. Unknowns are the
    direction of the centre and the logit of its relative distance to contact; equations are the
    logarithm and the direction of the force: these are nearly linear from the lightest load to the
    thinnest film, where the force itself grows like ``(1 - e)^(-3/2)`` and a plain Newton step
    would leave the bore. Steps that do not reduce the residual are halved; if that does not help,
    the plain equations are used.

    Examples
    --------
    >>> found = equilibrium(FilmGeometry(length_to_diameter=1.0), [1.2, 0.0])
    >>> round(found.eccentricity_ratio, 2), round(math.degrees(found.attitude_angle))
    (0.4, 65)
    """
    w = _checked_load(load)
    if rung not in RUNGS:
        raise ValueError(f"rung = '{rung}' must be one of {', '.join(RUNGS)}")
    plain = geometry.bore is None and not geometry.grooves and tilt == (0.0, 0.0)
    plain = plain and geometry.inlet_fill == 1
    turned = plain and geometry.condition == "reynolds" and rung == "direct"
    force = film_force(geometry, rung, tilt, turned)
    room = _room(geometry, tilt)
    reach = partial(_reach, room) if np.ptp(room) else _plain_reach
    first = _short_position(geometry, w) if start is None else np.asarray(start, dtype=float)
    if np.min(room) > 0:
        found = search(force, reach, w, first, tolerance)
    else:
        found = SearchResult(first, math.inf, 0, BearingStatus.NO_ROOM)
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


def _checked_load(load: ArrayLike) -> Vector:
    w = np.asarray(load, dtype=float)
    if w.shape != (2,) or not np.all(np.isfinite(w)) or not np.any(w):
        raise ValueError(
            f"load = {load!r} must be two finite numbers, not both 0; the direction of the journal "
            "is that of its load"
        )
    return w


def _short_position(geometry: FilmGeometry, load: Vector) -> Vector:
    """Position in a short bearing, with its force reduced for the finite length."""
    square = geometry.length_to_diameter**2
    e = short_eccentricity(float(np.hypot(*load)) * (1 / square + 0.5))
    e = min(e, 0.99)
    direction: Vector = turn_by(short_attitude(e)) @ load / np.hypot(*load)
    return e * direction


def _film_at(
    geometry: FilmGeometry,
    rung: str,
    position: Vector,
    tilt: tuple[float, float],
    mesh_angle: float,
) -> FilmSolution:
    return RUNGS[rung].field(geometry, at_rest(turn_by(-mesh_angle) @ position, tilt))


def _plain_reach(angle: float) -> float:  # noqa: ARG001 - that of any direction
    return 1.0


def _room(geometry: FilmGeometry, tilt: tuple[float, float]) -> Vector:
    """Gap by angle with the centre in the middle; a tilted journal is nearest at an end."""
    bore = np.zeros(geometry.n_theta) if geometry.bore is None else geometry.bore
    angle = angles_around(geometry.n_theta)
    room: Vector = 1 + bore - 0.5 * np.abs(tilt[0] * np.cos(angle) + tilt[1] * np.sin(angle))
    return room


def _reach(room: Vector, direction: float) -> float:
    """Largest distance of the centre from the middle without contact."""
    cosine = np.cos(angles_around(room.size) - direction)
    ahead = cosine > 1e-6
    return float(np.min(room[ahead] / cosine[ahead]))


def at_eccentricity(
    geometry: FilmGeometry,
    eccentricity_ratio: float,
    *,
    angle: float = 0.0,
    rung: str = "direct",
) -> Equilibrium:
    """Film of a journal held at an eccentricity, and the load in equilibrium with it.

    Parameters
    ----------
    geometry : FilmGeometry
        Bearing and cavitation condition: ``"guembel"`` (half film), ``"reynolds"`` or
        ``"periodic"``.
    eccentricity_ratio : float
        Distance of the centres over C, 0 < e < 1 (larger if the bore is worn).
    angle : float
        Direction of the journal centre from the X axis [rad]; it matters for a bearing with grooves
        or a worn bore.
    rung : str
        ``"short"``, ``"long"``, ``"finite"`` or ``"direct"``.

    Returns
    -------
    Equilibrium
        As from :func:`equilibrium` for that load: `load`, `attitude_angle` and
        `sommerfeld_number`; valid for :func:`friction`, :func:`flow` and :func:`coefficients`.

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
    if rung not in RUNGS:
        raise ValueError(f"rung = '{rung}' must be one of {', '.join(RUNGS)}")
    plain = geometry.bore is None and not geometry.grooves
    mesh = angle if plain and geometry.condition == "reynolds" else 0.0
    position = eccentricity_ratio * np.array([math.cos(angle), math.sin(angle)])
    film = RUNGS[rung].field(geometry, at_rest(turn_by(-mesh) @ position, (0.0, 0.0)))
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


def checked_positive(name: str, value: float, unit: str) -> None:
    """Refuse a quantity that is not > 0 and finite."""
    if not 0 < value < math.inf:
        raise ValueError(f"{name} = {value} {unit} must be > 0 and finite")
