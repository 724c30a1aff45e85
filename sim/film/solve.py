"""Oil film of a journal bearing: geometry, state, and solvers that give its pressure.

Non-dimensional as in Ma, Lu, Chen (2010), the orbit paper: angle theta from the X axis, length z
in [-1/2, 1/2] over L, gap ``H = 1 - X cos - Y sin`` over C (plus tilt and bore), time
``tau = omega t``, pressure ``p = eta omega (R/C)^2 P`` and

    d/dtheta(H^3 dP/dtheta) + (R/L)^2 d/dz(H^3 dP/dz) = 6 dH/dtheta + 12 dH/dtau

with P = 0 at both ends. The film acts on the journal with ``F = -∬ P (cos, sin) dtheta dz``, in
newtons ``eta omega R^3 L / C^2 F``. Inertia of the oil, turbulence and heat are left out.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ..brief import brief
from .direct import DIRECT_ITERATIONS, DIRECT_TOUCH, direct_tilted_force, residual, start_from
from .direct import direct_force as direct_force
from .direct_system import ITERATIONS, STATUS, DirectFilm, empty_direct_film
from .line import CONDITION_CODES, FIXED, line_force
from .over_relaxed import (
    PAPER_RELAXATION,
    RELAX_DIVERGED,
    RELAX_LIMIT,
    RELAX_STALLED,
    relaxed_force,
)
from .short import short_force
from .starved import starved_force

Array = NDArray[np.float64]

LEAST_CELLS = 4.0
"""Least number of cells over the arc where the gap is below twice its least value; a mesh with
fewer is :attr:`FilmStatus.COARSE`.
With four, the force on the standard mesh is within 5 % of the converged one, measured."""

_LEAST_NODES = 5  # of a mesh each way: two cells on either side of the middle
_ROUND = 1e-9  # tolerance of an angle or a length: a node on the edge of a groove belongs to it


class FilmStatus(Enum):
    """How a film solution ended; the value is a sentence with the cure."""

    OK = "done"
    COARSE = (
        "the narrow gap spans too few cells of the mesh and the force may be off by over 5 %; "
        "raise n_theta, or keep the eccentricity lower"
    )
    TOUCH = (
        "the journal touches the bore, so there is no film; lower the eccentricity or the tilt, "
        "or let a contact law carry the wall"
    )
    ITERATIONS = (
        "the cavitated region did not settle; start from a solution nearby, or change the mesh"
    )
    DIVERGED = "over-relaxation diverged; lower the relaxation factor below 2, or solve directly"
    STALLED = (
        "over-relaxation has stalled, at rounding or from a factor that overshoots; "
        "raise the tolerance, lower the relaxation factor, or solve directly"
    )
    SWEEPS = (
        "over-relaxation reached its limit of sweeps; allow more sweeps, raise the "
        "tolerance, or solve directly"
    )
    STARVED = (
        "no oil can enter the film; give it a groove, an end under pressure, or the condition "
        "'reynolds' that supplies the widest gap"
    )


@dataclass(frozen=True, kw_only=True)
class Groove:
    """Axial groove, centred in the length, held at its feed pressure.

    Mesh nodes within it are held, at least the nearest line and the middle.

    Attributes
    ----------
    angle, width : float
        Middle and extent along the circumference [rad].
    length_share : float
        Share of the bearing's length, in (0, 1].
    pressure : float
        Non-dimensional feed pressure P >= 0.
    """

    angle: float
    width: float
    length_share: float = 1.0
    pressure: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmGeometry:
    """What does not change while the journal moves: bearing, mesh, cavitation condition.

    Attributes
    ----------
    length_to_diameter : float
        L / D > 0.
    n_theta, n_z : int
        Nodes round the circle; over the length, both ends included, odd. At least 5 each.
    condition : str
        ``"guembel"`` (full film, negative pressure dropped), ``"reynolds"`` (p = 0 at the line of
        nodes nearest to the widest gap, P >= 0 with complementarity elsewhere) or ``"periodic"``
        (complementarity round the whole circle, the paper's double Reynolds condition).
    bore : numpy.ndarray [shape=(n_theta,)] or None
        Extra gap at the nodes over C, positive where the bore is worn, of any profile
        (:func:`dufrane_scar`); between nodes it is linear.
    grooves : tuple of Groove
    inlet_fill : float
        Share of the widest gap that the oil brought in fills, in (0, 1]; below 1 the film of an
        aligned journal begins where that oil fills the narrowing gap (:mod:`.film.starved`).

    Raises
    ------
    ValueError
        Values out of range, all of them at once.

    Examples
    --------
    >>> FilmGeometry(length_to_diameter=-1.0, n_z=16)
    Traceback (most recent call last):
        ...
    ValueError: length_to_diameter = -1.0 must be > 0; n_z = 16 must be odd and >= 5, so that a \
line of nodes lies in the middle
    """

    length_to_diameter: float
    n_theta: int = 72
    n_z: int = 17
    condition: str = "periodic"
    bore: Array | None = None
    grooves: tuple[Groove, ...] = ()
    inlet_fill: float = 1.0

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        problems = [*_mesh_problems(self), *_bore_problems(self)]
        for place, groove in enumerate(self.grooves):
            problems += _groove_problems(f"grooves[{place}]", groove)
        problems += _inlet_problems(self)
        if problems:
            raise ValueError("; ".join(problems))


@dataclass(frozen=True, kw_only=True)
class FilmState:
    """Position and velocity of the journal: centre and tilt over C, rates by tau.

    The axis lies at ``(x + z tilt_x, y + z tilt_y)``, with z from -1/2 to 1/2.

    Attributes
    ----------
    x, y : float
        Place of the journal's centre over the radial clearance C.
    x_rate, y_rate : float
        Its change with tau, the angle that the shaft has turned [1/rad].
    tilt_x, tilt_y : float
        Slope of the axis times the length, over C.
    tilt_x_rate, tilt_y_rate : float
        Their change with tau [1/rad].
    """

    x: float
    y: float
    x_rate: float = 0.0
    y_rate: float = 0.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0
    tilt_x_rate: float = 0.0
    tilt_y_rate: float = 0.0

    @property
    def tilted(self) -> bool:
        """Whether the journal is tilted or tilting."""
        return any((self.tilt_x, self.tilt_y, self.tilt_x_rate, self.tilt_y_rate))


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmSolution:
    """Pressure of a film and what follows from it; non-dimensional.

    Attributes
    ----------
    pressure : numpy.ndarray [shape=(n_theta, n_z)]
    force : numpy.ndarray [shape=(2,)]
        Force on the journal.
    moment : numpy.ndarray [shape=(2,)]
        ``-∬ P z (cos, sin)`` with z over L: it opposes the tilt (tilt_x, tilt_y).
    min_thickness : float
        Least gap over C, ends included.
    cavitated_share : float
        Share of the inner nodes without pressure that no groove holds.
    status : FilmStatus
    residual : float
        :func:`.film.direct.residual`, over the largest pressure.
    iterations : int
        Number of solves or sweeps.
    fill : numpy.ndarray [shape=(n_theta, n_z)] or None
        Film fraction, if the solver has one.
    """

    pressure: Array
    force: Array
    moment: Array
    min_thickness: float
    cavitated_share: float
    status: FilmStatus
    residual: float
    iterations: int
    fill: Array | None = None

    __repr__ = brief()


# --- geometry


def worn_arc(depth: float, clearance: float, angle: float, n_theta: int) -> Array:
    """Extra gap of a bore with a circular arc worn into it.

    Parameters
    ----------
    depth : float
        Deepest wear over C, >= 0.
    clearance : float
        Clearance of the journal in the arc, over C, > 0: near 0 the journal fits the arc, at 1 the
        arc is as wide as the bore.
    angle : float
        Middle of the arc from the X axis [rad].
    n_theta : int
        Nodes round the circle.

    Returns
    -------
    numpy.ndarray [shape=(n_theta,)]
        ``max(0, (depth + 1 - clearance) cos(theta - angle) - (1 - clearance))`` over C: zero
        outside of the arc. With a clearance above 1 the arc goes all round.

    Raises
    ------
    ValueError
        A number is out of range.

    Notes
    -----
    From the middle of the bore, the arc's circle of radius ``R + clearance C`` has its own middle
    ``depth + 1 - clearance`` lower, for gaps that are small compared with R.

    Examples
    --------
    >>> worn_arc(2.0, 0.5, 0.0, 8).round(3)
    array([2.   , 1.268, 0.   , 0.   , 0.   , 0.   , 0.   , 1.268])
    """
    if not 0 <= depth < math.inf:
        raise ValueError(f"depth = {depth} must be >= 0 and finite (wear depth over C)")
    if not 0 < clearance < math.inf:
        raise ValueError(f"clearance = {clearance} must be > 0 and finite (over C)")
    return _other_circle(depth + 1.0 - clearance, 1.0 - clearance, angle, n_theta)


def _other_circle(lower: float, smaller: float, angle: float, n_theta: int) -> Array:
    """Gap beyond the bore of a circle with a lower middle and a smaller clearance."""
    theta = 2 * math.pi * np.arange(n_theta) / n_theta
    return np.maximum(0.0, lower * np.cos(theta - angle) - smaller)


def dufrane_scar(depth: float, angle: float, n_theta: int) -> Array:
    """Extra gap of a bore in which a shaft has worn its own circle.

    Parameters
    ----------
    depth : float
        Deepest wear over C, in [0, 2).
    angle : float
        Middle of the scar from the X axis [rad].
    n_theta : int
        Nodes round the circle.

    Returns
    -------
    numpy.ndarray [shape=(n_theta,)]
        ``max(0, depth - 1 + cos(theta - angle))`` over C: zero outside of the scar. An arc of
        :func:`worn_arc` with the clearance `depth`.

    Raises
    ------
    ValueError
        The depth is out of range.

    References
    ----------
    Dufrane, Kannel, McCloskey (1983), J. Lubrication Technology 105(3), 346-352.

    Examples
    --------
    >>> dufrane_scar(0.4, 0.0, 8).round(3)
    array([0.4  , 0.107, 0.   , 0.   , 0.   , 0.   , 0.   , 0.107])
    """
    if not 0 <= depth < 2:
        raise ValueError(f"depth = {depth} must be in [0, 2) (wear depth over C)")
    return _other_circle(1.0, 1.0 - depth, angle, n_theta)


def direct_film(geometry: FilmGeometry, *, tilted: bool = False) -> DirectFilm:
    """Create the workspace of the direct solver :func:`.film.direct.direct_force`.

    Parameters
    ----------
    geometry : FilmGeometry
    tilted : bool
        Whether the journal may tilt; if so, the whole length is solved instead of half of it.

    Examples
    --------
    >>> work = direct_film(FilmGeometry(length_to_diameter=0.5))
    >>> f_x, f_y = direct_force(work, 0.6, 0.0, 0.0, 0.0)
    >>> round(f_x, 3), round(f_y, 3)
    (-0.66, 0.739)
    """
    held, pressure = groove_nodes(geometry)
    n = geometry.n_theta
    bore = np.zeros(n) if geometry.bore is None else np.asarray(geometry.bore, dtype=np.float64)
    return empty_direct_film(
        geometry.length_to_diameter,
        bore,
        held,
        pressure,
        condition=CONDITION_CODES[geometry.condition],
        mirrored=not tilted,
        inlet_fill=geometry.inlet_fill,
    )


def starved_film(geometry: FilmGeometry, *, tilted: bool) -> DirectFilm:
    """Create the workspace of :func:`.film.starved.starved_force`.

    Raises
    ------
    ValueError
        The journal is tilted: the front of a starved film is straight.
    """
    if tilted:
        raise ValueError(
            f"inlet_fill = {geometry.inlet_fill} must be 1 for a tilted journal, as the front is "
            "straight; set the tilt to 0 or the fill to 1"
        )
    return direct_film(geometry)


def groove_nodes(geometry: FilmGeometry) -> tuple[NDArray[np.int8], Array]:
    """Nodes that grooves hold (1, else 0), and the pressure there [shape=(n_theta, n_z)]."""
    shape = (geometry.n_theta, geometry.n_z)
    held, pressure = np.zeros(shape, dtype=np.int8), np.zeros(shape)
    theta = 2 * math.pi * np.arange(shape[0]) / shape[0]
    z = np.linspace(-0.5, 0.5, shape[1])
    for groove in geometry.grooves:
        away = np.abs((theta - groove.angle + math.pi) % (2 * math.pi) - math.pi)
        lines = away <= max(0.5 * groove.width, float(away.min())) + _ROUND
        reach = np.abs(z) <= 0.5 * groove.length_share + _ROUND
        reach[0] = reach[-1] = False  # the ends are open
        nodes = np.ix_(lines, reach)
        held[nodes], pressure[nodes] = 1, groove.pressure
    return held, pressure


def film_gap(geometry: FilmGeometry, state: FilmState) -> Array:
    """Gap over C at the nodes [shape=(n_theta, n_z)]; negative where the journal cuts the bore.

    Parameters
    ----------
    geometry : FilmGeometry
        Bearing and mesh.
    state : FilmState
        Position of the journal.

    Returns
    -------
    numpy.ndarray [shape=(n_theta, n_z)]
        At the nodes, over C.

    Examples
    --------
    >>> gap = film_gap(FilmGeometry(length_to_diameter=1.0), FilmState(x=0.6, y=0.0, tilt_x=0.2))
    >>> gap[0, [0, 8, -1]].round(3)
    array([0.5, 0.4, 0.3])
    """
    theta = 2 * math.pi * np.arange(geometry.n_theta)[:, None] / geometry.n_theta
    z = np.linspace(-0.5, 0.5, geometry.n_z)
    gap = 1.0 - (state.x + z * state.tilt_x) * np.cos(theta)
    gap = gap - (state.y + z * state.tilt_y) * np.sin(theta)
    return gap if geometry.bore is None else gap + np.asarray(geometry.bore)[:, None]


# --- rungs


def solve_short(geometry: FilmGeometry, state: FilmState) -> FilmSolution:
    """Short film (Ocvirk): no pressure flow along the circumference, Guembel's condition.

    Parameters
    ----------
    geometry : FilmGeometry
        Plain bore without grooves.
    state : FilmState
        Aligned journal.

    Returns
    -------
    FilmSolution
        Pressure and force, with a status.

    Raises
    ------
    ValueError
        Tilt, bore or grooves are given.

    Examples
    --------
    >>> geometry = FilmGeometry(length_to_diameter=0.1)
    >>> solve_short(geometry, FilmState(x=0.5, y=0.0)).force.round(5)
    array([-0.01778,  0.02418])
    """
    _require("short", geometry, state, plain=True)
    least = 1.0 - math.hypot(state.x, state.y)
    if least <= 0:
        return _touch(geometry, least)
    force = short_force(geometry.length_to_diameter, state.x, state.y, state.x_rate, state.y_rate)
    theta = 2 * math.pi * np.arange(geometry.n_theta) / geometry.n_theta
    drive = (state.x_rate + state.y / 2) * np.cos(theta)
    drive += (state.y_rate - state.x / 2) * np.sin(theta)
    gap = film_gap(geometry, state)[:, 0]
    mean = 4 * geometry.length_to_diameter**2 * np.maximum(0.0, drive) / gap**3
    return FilmSolution(
        pressure=mean[:, None] * _parabola(geometry),
        force=np.array(force),
        moment=np.zeros(2),
        min_thickness=least,
        cavitated_share=float(np.mean(mean <= 0)),
        status=FilmStatus.OK,
        residual=0.0,
        iterations=1,
    )


def solve_long(geometry: FilmGeometry, state: FilmState) -> FilmSolution:
    """Long film (Sommerfeld): no flow to the ends.

    Guembel's condition fixes the pressure by p = 0 at the widest gap. A film that is squeezed
    without being dragged may have no cavitated line: ``FilmStatus.ITERATIONS``.

    Parameters
    ----------
    geometry : FilmGeometry
        Its ``n_z`` does not matter.
    state : FilmState
        Aligned journal.

    Returns
    -------
    FilmSolution
        Pressure and force, with a status.

    Raises
    ------
    ValueError
        Tilt is given.

    Examples
    --------
    >>> geometry = FilmGeometry(length_to_diameter=1.0, n_theta=360, condition="reynolds")
    >>> force = solve_long(geometry, FilmState(x=0.6, y=0.0)).force
    >>> round(1 / (math.pi * math.hypot(*force)), 4)  # Sommerfeld number
    0.0389
    """
    return _solve_line(geometry, state, long=True)


def solve_finite(geometry: FilmGeometry, state: FilmState) -> FilmSolution:
    """Film of finite length with a parabola along it: a one-dimensional problem.

    Parameters
    ----------
    geometry : FilmGeometry
        Grooves are assumed to be as long as the bearing.
    state : FilmState
        Aligned journal.

    Returns
    -------
    FilmSolution
        Pressure and force, with a status.

    Raises
    ------
    ValueError
        Tilt is given.

    Notes
    -----
    See :mod:`.film.line`.

    Examples
    --------
    >>> geometry = FilmGeometry(length_to_diameter=0.5)
    >>> solve_finite(geometry, FilmState(x=0.6, y=0.0)).force.round(2)
    array([-0.66,  0.74])
    """
    return _solve_line(geometry, state, long=False)


def solve_direct(
    geometry: FilmGeometry, state: FilmState, start: FilmSolution | None = None
) -> FilmSolution:
    """Film of finite length on the mesh, by active sets and banded elimination.

    Parameters
    ----------
    geometry : FilmGeometry
        Any bore, grooves and condition.
    state : FilmState
        May be tilted.
    start : FilmSolution, optional
        A nearby solution on the same mesh: its cavitated region is the first guess.

    Returns
    -------
    FilmSolution
        Pressure and force, with a status.

    Raises
    ------
    ValueError
        `start` has another mesh.

    Notes
    -----
    See :mod:`.film.direct`; :func:`mesh_error` estimates the mesh error.

    Examples
    --------
    >>> film = solve_direct(FilmGeometry(length_to_diameter=1.0), FilmState(x=0.5, y=0.0))
    >>> film.status.value, film.min_thickness, round(film.cavitated_share, 2)
    ('done', 0.5, 0.35)
    """
    if geometry.inlet_fill < 1:
        return _solve_starved(geometry, state)
    work = direct_film(geometry, tilted=state.tilted)
    if start is not None:
        _require_mesh(geometry, start)
        start_from(work, start.pressure)
    force = direct_tilted_force(
        work,
        state.x,
        state.y,
        state.x_rate,
        state.y_rate,
        state.tilt_x,
        state.tilt_y,
        state.tilt_x_rate,
        state.tilt_y_rate,
    )
    return _mesh_solution(geometry, state, work, force)


def _solve_starved(geometry: FilmGeometry, state: FilmState) -> FilmSolution:
    work = starved_film(geometry, tilted=state.tilted)
    force = starved_force(work, state.x, state.y, state.x_rate, state.y_rate)
    return _mesh_solution(geometry, state, work, force)


def solve_relaxed(
    geometry: FilmGeometry,
    state: FilmState,
    start: FilmSolution | None = None,
    *,
    relaxation: float = PAPER_RELAXATION,
    tolerance: float = 1e-5,
    most_sweeps: int = 20_000,
) -> FilmSolution:
    """Film of finite length by over-relaxation, as the orbit paper does.

    Parameters
    ----------
    geometry : FilmGeometry
    state : FilmState
        Aligned journal.
    start : FilmSolution, optional
        On the same mesh: its pressure is the first guess.
    relaxation : float
        Factor; 1.96 in the paper.
    tolerance : float
        Sum of changes in a sweep over the sum of pressures.
    most_sweeps : int

    Raises
    ------
    ValueError
        Tilt is given, or `start` has another mesh.

    Examples
    --------
    >>> film = solve_relaxed(FilmGeometry(length_to_diameter=1.0), FilmState(x=0.5, y=0.0))
    >>> film.status.value, 100 < film.iterations < 400
    ('done', True)
    """
    _require("relaxed", geometry, state, plain=False)
    work = direct_film(geometry, tilted=True)  # over the whole length, as in the paper
    if start is not None:
        _require_mesh(geometry, start)
        start_from(work, start.pressure)
    force = relaxed_force(
        work,
        state.x,
        state.y,
        state.x_rate,
        state.y_rate,
        relaxation,
        tolerance,
        most_sweeps,
    )
    return _mesh_solution(geometry, state, work, force)


# --- mesh error


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshError:
    """Mesh error of a direct solve, by Richardson's extrapolation.

    Attributes
    ----------
    force : numpy.ndarray [shape=(2,)]
        Extrapolated to zero spacing.
    relative : float
        Estimated error of the force on the mesh of the geometry, over the force.
    """

    force: Array
    relative: float


def mesh_error(geometry: FilmGeometry, state: FilmState) -> MeshError:
    """Estimate the mesh error of :func:`solve_direct` by a solve on every second node.

    Parameters
    ----------
    geometry : FilmGeometry
        With an even ``n_theta``, and an ``n_z`` one more than a multiple of four, so that every
        second node forms a mesh.
    state : FilmState
        Position of the journal.

    Returns
    -------
    MeshError
        Error of the force.

    Raises
    ------
    ValueError
        The mesh cannot be halved, or a solve failed.

    Notes
    -----
    The force converges with the square of the spacing (asserted in the tests), so a third of the
    difference is left. It jumps a little as nodes enter and leave the film: the estimate is good
    to a factor of about two. Groove edges off the nodes of both meshes spoil it.

    Examples
    --------
    >>> error = mesh_error(FilmGeometry(length_to_diameter=1.0), FilmState(x=0.5, y=0.0))
    >>> 0.001 < error.relative < 0.01
    True
    """
    n, k = geometry.n_theta, geometry.n_z
    if n % 2 or (k - 1) % 4 or n // 2 < _LEAST_NODES:
        raise ValueError(
            f"n_theta = {n} and n_z = {k} must be even and >= 10, and one more than a multiple "
            "of 4; only such a mesh can be halved"
        )
    bore = None if geometry.bore is None else np.asarray(geometry.bore)[::2]
    half = replace(geometry, n_theta=n // 2, n_z=(k + 1) // 2, bore=bore)
    fine, coarse = solve_direct(geometry, state), solve_direct(half, state)
    for solution in (fine, coarse):
        if solution.status not in (FilmStatus.OK, FilmStatus.COARSE):
            raise ValueError(f"no mesh error to estimate: {solution.status.value}")
    left = (fine.force - coarse.force) / 3.0
    force = fine.force + left
    return MeshError(force=force, relative=float(np.hypot(*left) / np.hypot(*force)))


# --- helpers


def _mesh_problems(geometry: FilmGeometry) -> list[str]:
    problems = []
    if not 0 < geometry.length_to_diameter < math.inf:
        problems.append(f"length_to_diameter = {geometry.length_to_diameter} must be > 0")
    if geometry.n_theta < _LEAST_NODES:
        problems.append(f"n_theta = {geometry.n_theta} must be >= {_LEAST_NODES}; 72 is usual")
    if geometry.n_z < _LEAST_NODES or geometry.n_z % 2 == 0:
        problems.append(
            f"n_z = {geometry.n_z} must be odd and >= {_LEAST_NODES}, "
            "so that a line of nodes lies in the middle"
        )
    if geometry.condition not in CONDITION_CODES:
        problems.append(
            f"condition = '{geometry.condition}' must be one of {', '.join(CONDITION_CODES)}"
        )
    return problems


def _bore_problems(geometry: FilmGeometry) -> list[str]:
    if geometry.bore is None:
        return []
    bore = np.asarray(geometry.bore)
    if bore.shape != (geometry.n_theta,):
        return [
            f"bore has the shape {bore.shape} and must have ({geometry.n_theta},); "
            "interpolate the profile to the nodes of the mesh"
        ]
    if not np.all(np.isfinite(bore)):
        return ["bore must be finite; fill the gaps of the measured profile"]
    return []


def _groove_problems(name: str, groove: Groove) -> list[str]:
    problems = []
    if not math.isfinite(groove.angle):
        problems.append(f"{name}.angle = {groove.angle} rad must be finite")
    if not 0 < groove.width < 2 * math.pi:
        problems.append(f"{name}.width = {groove.width} rad must be in (0, 2 pi)")
    if not 0 < groove.length_share <= 1:
        problems.append(f"{name}.length_share = {groove.length_share} must be in (0, 1]")
    if not 0 <= groove.pressure < math.inf:
        problems.append(f"{name}.pressure = {groove.pressure} must be >= 0, the ends being at 0")
    return problems


def _inlet_problems(geometry: FilmGeometry) -> list[str]:
    fill = geometry.inlet_fill
    if not 0 < fill <= 1:
        return [f"inlet_fill = {fill} must be in (0, 1]; at 1 the film is flooded"]
    if fill == 1:
        return []
    problems = []
    if geometry.grooves:
        problems.append(
            f"inlet_fill = {fill} must be 1 with grooves, which are full; remove them or the fill"
        )
    if geometry.condition == "guembel":
        problems.append(
            f"inlet_fill = {fill} must be 1 with 'guembel', whose film is full all round; set "
            "condition = 'periodic'"
        )
    return problems


def _require(name: str, geometry: FilmGeometry, state: FilmState, *, plain: bool) -> None:
    problems = []
    if state.tilted:
        problems.append("tilt")
    if plain and geometry.bore is not None:
        problems.append("bore profile")
    if plain and geometry.grooves:
        problems.append("grooves")
    if geometry.inlet_fill < 1:
        problems.append("starved inlet")
    if problems:
        raise ValueError(f"film '{name}' has no {' or '.join(problems)}; use the film 'direct'")


def _require_mesh(geometry: FilmGeometry, start: FilmSolution) -> None:
    mesh = (geometry.n_theta, geometry.n_z)
    if start.pressure.shape != mesh:
        raise ValueError(
            f"start has a mesh of {start.pressure.shape} and must have {mesh}; "
            "start from a solution of the same geometry, or pass no start"
        )


def _parabola(geometry: FilmGeometry) -> Array:
    return 1.5 * (1.0 - 4.0 * np.linspace(-0.5, 0.5, geometry.n_z) ** 2)


def _solve_line(geometry: FilmGeometry, state: FilmState, *, long: bool) -> FilmSolution:
    _require("long" if long else "finite", geometry, state, plain=False)
    work = direct_film(geometry)
    gap = film_gap(geometry, state)
    least = _least_gap(geometry, state, gap)
    if least <= 0:
        return _touch(geometry, least)
    force = line_force(work, state.x, state.y, state.x_rate, state.y_rate, int(long))
    mean = work.line[:, 3] / (1.0 if long else work.line_share)
    status = FilmStatus.OK if np.any(np.array(force)) or not mean.any() else FilmStatus.ITERATIONS
    if status is FilmStatus.OK:
        status = _resolved(gap, least)
    shape = np.ones(geometry.n_z) if long else _parabola(geometry)
    return FilmSolution(
        pressure=mean[:, None] * shape,
        force=np.array(force),
        moment=np.zeros(2),
        min_thickness=least,
        cavitated_share=float(np.mean((mean <= 0) & (work.line[:, 4] != FIXED))),
        status=status,
        residual=0.0,
        iterations=1,
    )


def _mesh_solution(
    geometry: FilmGeometry, state: FilmState, work: DirectFilm, force: tuple[float, float]
) -> FilmSolution:
    least = float(work.measure[0])
    code = int(work.outcome[STATUS])
    if code == DIRECT_TOUCH:
        return _touch(geometry, least)
    inner = work.pressure[:, 1:-1] <= 0
    return FilmSolution(
        pressure=work.pressure.copy(),
        force=np.array(force),
        moment=work.measure[3:5].copy(),
        min_thickness=least,
        cavitated_share=float(np.mean(inner & (work.fixed[:, 1:-1] == 0))),
        status=_STATUS.get(code, _resolved(film_gap(geometry, state), least)),
        residual=_residual(work),
        iterations=int(work.outcome[ITERATIONS]),
    )


def _residual(work: DirectFilm) -> float:
    """Residual of the current field; the kernel's own if negative pressure was dropped."""
    if work.condition == CONDITION_CODES["guembel"]:
        return float(work.measure[2])
    return float(residual(work))


def _least_gap(geometry: FilmGeometry, state: FilmState, gap: Array) -> float:
    """Least gap of an aligned journal: at the nodes, or between two on the line of centres."""
    least = 1.0 - math.hypot(state.x, state.y)
    if geometry.bore is not None:
        theta = 2 * math.pi * np.arange(geometry.n_theta) / geometry.n_theta
        here = math.atan2(state.y, state.x)
        least += float(np.interp(here, theta, geometry.bore, period=2 * math.pi))
    return min(least, float(gap.min()))


def _resolved(gap: Array, least: float) -> FilmStatus:
    """Status by the number of cells across the narrow gap, at every node of the length."""
    narrow = np.count_nonzero(gap < 2.0 * least, axis=0)
    at = int(np.argmin(gap.min(axis=0)))
    return FilmStatus.COARSE if narrow[at] < LEAST_CELLS else FilmStatus.OK


def _touch(geometry: FilmGeometry, least: float) -> FilmSolution:
    """Solution without film or force, with the reason."""
    return FilmSolution(
        pressure=np.zeros((geometry.n_theta, geometry.n_z)),
        force=np.zeros(2),
        moment=np.zeros(2),
        min_thickness=least,
        cavitated_share=1.0,
        status=FilmStatus.TOUCH,
        residual=0.0,
        iterations=0,
    )


_STATUS = {
    DIRECT_ITERATIONS: FilmStatus.ITERATIONS,
    RELAX_DIVERGED: FilmStatus.DIVERGED,
    RELAX_STALLED: FilmStatus.STALLED,
    RELAX_LIMIT: FilmStatus.SWEEPS,
}
"""Code of the kernels -> status; the mesh distinguishes done from coarse."""
