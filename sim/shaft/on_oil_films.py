"""A shaft on its oil films: beam and films solved together.

The beam is condensed once to its bearings, where four numbers are left of it: height, side and
both slopes. In each bearing the film answers the position and the tilt of the journal with a force
and a moment, and Newton's method brings beam and films into balance, with the film's own
stiffness. A rigid journal under a force and a moment is the case of one bearing.

Axes are the shaft's: y up, z to the right looking forward, slopes ``y' = dy/dx`` and
``z' = dz/dx``, positive speed from y to z. Those of the film are turned: ``(X, Y) = -(y, z) / C``,
and the tilts are ``-(y', z') L / C``, all of the journal relative to the bore. Matrices of a
bearing are in the order y, z, y', z'.

Each bearing's heights refer to the journal: `offset` is the height of its centre when it lies at
the bottom of the bore, whose own centre is one radial clearance above.

What a film is worth on a shaft, on the built-in *propulsion-shaft* as built, with the stern bearing
worn down by 0.9 mm, and with a line bearing sagged by 1.2 mm; the largest differences from the film
*direct* on 144 x 33 nodes, that of the reactions over their mean:

================================  =========  ==========  ==================  =====
film                              reactions  least film  stiffness, damping  ms
================================  =========  ==========  ==================  =====
short                             5 %        83 %        106 %               19
finite, map, direct without tilt  4 %        22 %        6 %                 8-36
direct, 48 x 13                   0.1 %      1.1 %       3 %                 11
direct, 72 x 17                   0.1 %      0.5 %       3 %                 18
mass-conserving against direct    0.2 %      2 %         6 %                 4,000
================================  =========  ==========  ==================  =====

Without moments and tilt, reactions hold within 4 % and frequencies within 6 % (23 % on a line with
a heavier propeller), but the first bending modes lose their damping: 0.7 % of the critical instead
of 39 %. Against rigid supports the films, with their pedestals, move reactions by up to 6 %. The
last row has two axial grooves in every bearing. Times are of a processor, five bearings.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ..beam.beam import Beam
from ..beam.rotor import Support
from ..bearing.operate import JournalBearing
from ..bearing.short_bearing import short_attitude, short_eccentricity
from ..brief import brief
from ..film.direct import DIRECT_OK, direct_tilted_force
from ..film.direct_system import STATUS, DirectFilm
from ..film.impedance_map import ImpedanceMap, impedance_map, map_force
from ..film.rungs import FILM_RUNGS
from ..film.slopes import Coefficients, perturbation
from ..film.solve import FilmGeometry, FilmSolution, FilmState, FilmStatus, direct_film, worn_arc

Vector = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the load
_MOST_STEPS = 60  # a dozen from a fair start
_MOST_HALVINGS = 14
_STEEPEST = 1.0  # rise of the gap from an edge to the next node, over the gap there
_NEARLY = 1.5  # strength of films that a finer mesh may make up for
_NEAREST = 0.85  # of the way to contact in one step
_LEAST_ROOM = 1e-4  # over C; no mesh resolves a thinner film
_LEAST_SHARE = 0.01  # of the mean load: what a bearing counts as at the least
_MOST_START = 0.9  # eccentricity to start from
_START_TILT = 0.5  # of the room beside that
_DISPLACEMENT = 1e-5  # of the least gap
_RATE = 1e-5  # of the surface speed's share of a gap
_LOOSE = 1e-4  # of the load, on the way of a continuation
_STIFFEST = 10.0  # unit of force over the largest load: journals near the middle
_FIRST_RATIO = 8.0
_FASTER = 1.5
_LEAST_RATIO = 1.02
_CLOSE = 5e-3  # over C: nearer than this an end is taken to be in the way
_OPPOSITE = -0.5  # cosine of the places where the two ends touch

GRADIENT_STEP = 0.1
"""Of :func:`coefficient_gradients`, over the least gap [-]: some nodes of a mesh fill or empty on
the way."""


class ShaftFilmStatus(IntEnum):
    """How the search for the balance ended. Everything but OK carries a cure."""

    OK = 0
    OVERLOAD = 1
    EDGE_CONTACT = 2
    NO_ROOM = 3
    NO_CONVERGENCE = 4
    COARSE = 5

    @property
    def ok(self) -> bool:
        """True where the balance can be used."""
        return self is ShaftFilmStatus.OK

    @property
    def text(self) -> str:
        """One sentence with the cure."""
        return _STATUS_TEXT[self]


_STATUS_TEXT = {
    ShaftFilmStatus.OK: "done",
    ShaftFilmStatus.OVERLOAD: (
        "the film cannot carry the bearing's load with a gap that the mesh resolves; lower the "
        "bearing, or raise the viscosity, the speed or the length"
    ),
    ShaftFilmStatus.EDGE_CONTACT: (
        "the journal touches the edge of the bore; bring the slope of the bore nearer to that of "
        "the shaft, lower the bearing, or raise the viscosity or the speed"
    ),
    ShaftFilmStatus.NO_ROOM: (
        "the shaft bends so far that the journal touches both ends of the bore; bring the slope of "
        "the bore nearer to that of the shaft, or raise the clearance"
    ),
    ShaftFilmStatus.NO_CONVERGENCE: (
        "beam and films found no balance; give a start closer to it, refine the "
        "mesh, or lower a groove's feed pressure that outweighs the load"
    ),
    ShaftFilmStatus.COARSE: (
        "the film is too thin for the mesh, and the answer with it; raise n_theta or the number of "
        "refinements, or lower the load"
    ),
}


class ShaftFilmError(RuntimeError):
    """A shaft was not balanced on its films and the caller asked to be told so."""

    def __init__(self, status: ShaftFilmStatus, bearing: str) -> None:
        self.status = status
        self.bearing = bearing
        super().__init__(f"bearing '{bearing}': {status.name.lower()}: {status.text}")


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmBearing:
    """A journal bearing in its place on a shaft line.

    Attributes
    ----------
    name : str
    station : float
        Of the middle of its length, a node of the beam [m].
    bearing : JournalBearing
        As new.
    offset : float
        Height of the journal's centre when it lies at the bottom of the bore as new, positive up
        [m].
    side_offset : float
        Of the bore's centre along z [m].
    slope : tuple of float
        Of the bore, dy/dx and dz/dx [rad].
    wear_down : float
        By which the bottom has sunk, >= 0 [m].
    arc_clearance : float or None
        Of the journal in the arc that it has worn, over the bore's as new, > 0. None: the bore
        stays a circle, whose diametral clearance grows by the wear-down and whose centre sinks by
        half of it.

    Raises
    ------
    ValueError
        A number is not finite, the wear-down is negative, or the arc's clearance is not positive.

    Examples
    --------
    >>> new = JournalBearing(diameter=0.4, length=0.8, clearance=0.4e-3, viscosity=0.1)
    >>> worn = FilmBearing(name="stern", station=1.0, bearing=new, wear_down=0.2e-3)
    >>> round(worn.worn.clearance * 1e3, 6), round(worn.centre[0] * 1e3, 6)
    (0.5, 0.3)
    """

    name: str
    station: float
    bearing: JournalBearing
    offset: float = 0.0
    side_offset: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)
    wear_down: float = 0.0
    arc_clearance: float | None = None

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        numbers = {
            "station": (self.station, "m"),
            "offset": (self.offset, "m"),
            "side_offset": (self.side_offset, "m"),
            "slope[0]": (self.slope[0], "rad"),
            "slope[1]": (self.slope[1], "rad"),
        }
        problems = [
            f"{self.name}.{name} = {value} {unit} must be finite"
            for name, (value, unit) in numbers.items()
            if not math.isfinite(value)
        ]
        if not 0 <= self.wear_down < math.inf:
            problems.append(f"{self.name}.wear_down = {self.wear_down} m must be >= 0 and finite")
        if self.arc_clearance is not None and not 0 < self.arc_clearance < math.inf:
            problems.append(
                f"{self.name}.arc_clearance = {self.arc_clearance} must be > 0 and finite"
            )
        if problems:
            raise ValueError("; ".join(problems))

    @property
    def worn(self) -> JournalBearing:
        """The bearing with its present bore; its profile and the feed pressure stay in SI."""
        if self.wear_down == 0:
            return self.bearing
        if self.arc_clearance is not None:
            return self._with_arc(self.arc_clearance)
        clearance = self.bearing.clearance + self.wear_down / 2
        film, grown = self.bearing.film, clearance / self.bearing.clearance
        if film is not None:
            bore = None if film.bore is None else np.asarray(film.bore) / grown
            grooves = tuple(replace(g, pressure=g.pressure * grown**2) for g in film.grooves)
            film = replace(film, bore=bore, grooves=grooves)
        return replace(self.bearing, clearance=clearance, film=film)

    def _with_arc(self, clearance: float) -> JournalBearing:
        film = self.bearing.geometry
        depth = self.wear_down / self.bearing.clearance
        arc = worn_arc(depth, clearance, 0.0, film.n_theta)  # the film's X axis points down
        bore = arc if film.bore is None else np.maximum(film.bore, arc)
        return replace(self.bearing, film=replace(film, bore=bore))

    @property
    def bottom(self) -> float:
        """Way of the journal from the middle of the present bore down to its bottom [m]."""
        return self.bearing.clearance + self.wear_down - self.sunk

    @property
    def sunk(self) -> float:
        """By which the middle of the bore is lower than as new [m]."""
        return 0.0 if self.arc_clearance is not None else self.wear_down / 2

    @property
    def centre(self) -> tuple[float, float]:
        """Of the bore, y and z [m]."""
        return self.offset + self.bearing.clearance - self.sunk, self.side_offset


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamFilm:
    """A shaft at rest on its films.

    Attributes
    ----------
    bearings : tuple of FilmBearing
        As given, n of them.
    rung : str
    speed : float
        [rad/s]
    positions : numpy.ndarray [shape=(n, 2)]
        Journal's centre relative to the bore's, y and z [m].
    slopes : numpy.ndarray [shape=(n, 2)]
        Of the journal relative to the bore [rad].
    reactions : numpy.ndarray [shape=(n, 2)]
        Force of the film on the shaft, y and z [N].
    moments : numpy.ndarray [shape=(n, 2)]
        Of the film on the shaft, conjugate to y' and z' [N m].
    stiffness : numpy.ndarray [shape=(n, 4, 4)]
        Fall of force and moment by y, z, y', z' [N/m], [N/rad], [N m/m], [N m/rad]. Zero in what
        the rung leaves out.
    damping : numpy.ndarray [shape=(n, 4, 4)]
        The same by their rates, times a second.
    least_film : numpy.ndarray [shape=(n,)]
        [m]
    peak_pressure : numpy.ndarray [shape=(n,)]
        [Pa]
    films : tuple of FilmSolution
        Non-dimensional.
    geometries : tuple of FilmGeometry
        On which they were found: the mesh may have been doubled.
    pedestals : tuple of tuple of float
        Stiffness under each bore, y and z [N/m].
    give : numpy.ndarray [shape=(n, 2)]
        By which each bore's centre has moved on its pedestal, y and z [m].
    deflection : numpy.ndarray [shape=(4 * nodes,)]
        Of the beam, in its own order [m], [rad].
    residual : float
        Force or moment left over at the worst bearing, over its load, and over its load times its
        length; of a bearing with less than 1 % of the mean load, over that.
    iterations : int
        Newton steps.
    status : ShaftFilmStatus
    culprit : str
        The bearing that the status speaks of, or that of the largest residual.
    strength : float
        1, or without a balance by how much viscosity or speed would have to grow for that of the
        state shown, the last one found: positions, forces and matrices are those of the films
        there are in these places.
    """

    bearings: tuple[FilmBearing, ...]
    rung: str
    speed: float
    positions: Vector
    slopes: Vector
    reactions: Vector
    moments: Vector
    stiffness: Vector
    damping: Vector
    least_film: Vector
    peak_pressure: Vector
    films: tuple[FilmSolution, ...]
    geometries: tuple[FilmGeometry, ...]
    pedestals: tuple[tuple[float, float], ...]
    give: Vector
    deflection: Vector
    residual: float
    iterations: int
    status: ShaftFilmStatus
    culprit: str
    strength: float

    __repr__ = brief("bearings", "speed", "rung", "eccentricity_ratios", "status")

    @property
    def eccentricity_ratios(self) -> Vector:
        """What the film in the middle lacks of the radial clearance, over it [shape=(n,)].

        In a round bore the distance of the centres over the clearance.
        """
        ratios: Vector = np.hypot(*self.positions.T) / _clearances(self.bearings)
        for n, (geometry, place) in enumerate(zip(self.geometries, self.positions, strict=True)):
            if geometry.bore is not None:
                middle = np.array([*(-place / self.bearings[n].worn.clearance), 0.0, 0.0])
                ratios[n] = 1 - _room(geometry, False, middle)
        return ratios

    @property
    def middle_films(self) -> Vector:
        """Least film in the middle of each bearing's length [m, shape=(n,)]."""
        return np.asarray((1 - self.eccentricity_ratios) * _clearances(self.bearings))

    @property
    def unloaded(self) -> tuple[str, ...]:
        """Bearings that do not carry: pushed down, or by less than 1 % of the mean load."""
        up = self.reactions[:, 0]
        least = _LEAST_SHARE * float(np.mean(np.abs(up)))
        return tuple(b.name for b, r in zip(self.bearings, up, strict=True) if r < least)


def _clearances(bearings: Sequence[FilmBearing]) -> Vector:
    return np.array([b.worn.clearance for b in bearings])


def beam_film(
    beam: Beam,
    bearings: Sequence[FilmBearing],
    speed: float,
    *,
    rung: str = "direct",
    tilted: bool = True,
    pedestals: Sequence[tuple[float, float]] | None = None,
    start: BeamFilm | None = None,
    refinements: int = 2,
    tolerance: float = _TOLERANCE,
    raise_on_failure: bool = True,
) -> BeamFilm:
    """Balance of a shaft on its oil films.

    Parameters
    ----------
    beam : Beam
        With its loads; the station of every bearing is a node.
    bearings : sequence of FilmBearing
        In any order; each on its own node.
    speed : float
        Of the shaft, > 0 [rad/s].
    rung : str
        ``"direct"`` or ``"mass-conserving"``, which have the film of a tilted journal, or
        ``"short"``, ``"long"``, ``"finite"``, ``"map"``, for which the journal lies in the bearing
        as it does in the middle of the length, without a moment.
    tilted : bool
        False takes those two as well without tilt.
    pedestals : sequence of tuple of float, optional
        Stiffness under each bore along y and z [N/m], in the order of the bearings;
        ``math.inf`` is rigid, as all are by default. Offsets are those of the bores without load.
    start : BeamFilm, optional
        Of a case nearby with as many bearings.
    refinements : int
        How many times the mesh of a bearing may be doubled where its film is too thin for it, on
        the rung *direct*: round the bore, or along the length where the gap doubles between an
        edge and the next node.
    tolerance : float
        Of the residual.
    raise_on_failure : bool
        False returns the last state with its status instead.

    Returns
    -------
    BeamFilm
        Positions, reactions, coefficients and status.

    Raises
    ------
    ShaftFilmError
        No balance was found; names the bearing and the cure.
    ValueError
        A name or a node is taken twice, the speed is not above zero, there is no such rung, or a
        film has the condition *reynolds*.

    Notes
    -----
    With the beam condensed to its bearings, ``K`` and ``f``, the bores' places ``q0``, the
    journals' places in them ``u`` and the film's force ``R(u)``::

        K (q0 + u - R / pedestal) - f = R(u)

    Newton's method with ``dR/du`` of the film; a step goes at most 85 % of the way to contact in
    any bearing and is halved until the next one, by the same matrix, gets smaller (the natural
    test, which does not care for the units of forces and moments). Where that fails, the films
    are first made so stiff that they hold all journals in the middle, and weakened step by step.

    Laminar, isothermal, steady; the bearings are long enough apart that each acts on one node.

    References
    ----------
    Deuflhard (2011), Newton Methods for Nonlinear Problems, Springer,
    doi:10.1007/978-3-642-23899-4, for the natural test.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> steel = Section(length=8.0, outer_diameter=0.3, young=206e9, shear_modulus=79e9,
    ...                 density=7850.0)
    >>> beam = assemble_beam([steel], stations=(1.0, 4.0, 7.0), theory="euler-bernoulli")
    >>> bush = JournalBearing(diameter=0.3, length=0.3, clearance=0.2e-3, viscosity=0.05)
    >>> line = [FilmBearing(name=n, station=s, bearing=bush, offset=h)
    ...         for n, s, h in (("aft", 1.0, 0.0), ("middle", 4.0, -0.3e-3), ("forward", 7.0, 0.0))]
    >>> found = beam_film(beam, line, 2 * math.pi * 2)
    >>> (found.reactions[:, 0] / 1e3).round(1), found.residual < 1e-9
    (array([15.6, 12.3, 15.6]), True)
    """
    line = _line_of(beam, bearings, speed, pedestals)
    laws = [_law(rung, tilted, bearing) for bearing in line.bearings]
    _check_held(line, laws)
    first = _first_places(line, laws) if start is None else _places_of(start, line)
    found = _solve(line, laws, first, tolerance)
    for _ in range(refinements if rung == "direct" else 0):
        finer = [_finer(law, place) for law, place in _each(laws, found)]
        if not _may_be_refined(found) or finer == laws:
            break
        laws = finer
        again = _solve(line, laws, found.places, tolerance)
        found = again._replace(iterations=found.iterations + again.iterations)
    result = _result(line, laws, found, rung)
    if raise_on_failure and not result.status.ok:
        raise ShaftFilmError(result.status, result.culprit)
    return result


def supports(
    found: BeamFilm,
    *,
    moments: bool = True,
    housing_masses: Sequence[float] | None = None,
    pedestal_damping: Sequence[tuple[float, float]] | None = None,
) -> tuple[Support, ...]:
    """The films as supports of a rotor, about the balance.

    Parameters
    ----------
    found : BeamFilm
        Of :func:`beam_film`.
    moments : bool
        False leaves out what has to do with slopes; so do the rungs without tilt.
    housing_masses : sequence of float, optional
        That move with each bore [kg]; needed where the pedestals were not rigid.
    pedestal_damping : sequence of tuple of float, optional
        Under each bore along y and z [N s/m], by default none.

    Returns
    -------
    tuple of Support
        In the order of the bearings.

    Raises
    ------
    ValueError
        A pedestal is not rigid and there is no housing mass, or counts differ.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> steel = Section(length=4.0, outer_diameter=0.3, young=206e9, shear_modulus=79e9,
    ...                 density=7850.0)
    >>> beam = assemble_beam([steel], stations=(1.0, 3.0), theory="euler-bernoulli")
    >>> bush = JournalBearing(diameter=0.3, length=0.3, clearance=0.2e-3, viscosity=0.05)
    >>> line = [FilmBearing(name=n, station=s, bearing=bush) for n, s in (("a", 1.0), ("b", 3.0))]
    >>> aft, _ = supports(beam_film(beam, line, 2 * math.pi * 2))
    >>> aft.name, aft.stiffness.shape, bool(aft.damping[0, 0] > 0)
    ('a', (4, 4), True)
    """
    count = len(found.bearings)
    damping = [(0.0, 0.0)] * count if pedestal_damping is None else list(pedestal_damping)
    masses = [None] * count if housing_masses is None else list(housing_masses)
    for name, values in (("housing_masses", masses), ("pedestal_damping", damping)):
        if len(values) != count:
            raise ValueError(
                f"{name} has {len(values)} entries and must have {count}, one for each bearing"
            )
    tilts = moments and bool(np.any(found.stiffness[:, 2:]))
    return tuple(_support(found, n, 4 if tilts else 2, masses[n], damping[n]) for n in range(count))


def _support(
    found: BeamFilm, n: int, size: int, mass: float | None, damping: tuple[float, float]
) -> Support:
    bearing, pedestal = found.bearings[n], found.pedestals[n]
    film = Support(
        name=bearing.name,
        station=bearing.station,
        stiffness=found.stiffness[n, :size, :size],
        damping=found.damping[n, :size, :size],
    )
    if min(pedestal) == math.inf:
        return film
    if mass is None or max(pedestal) == math.inf:
        raise ValueError(
            f"bearing '{bearing.name}' on a pedestal of {pedestal} N/m must have a housing mass "
            "and a pedestal that gives both ways; give housing_masses, or rigid pedestals"
        )
    return replace(film, housing_mass=mass, pedestal_stiffness=pedestal, pedestal_damping=damping)


# --- how a balance follows small changes


def journal_shifts(
    beam: Beam, found: BeamFilm, *, bores: Vector, forces: Vector, gives: Vector
) -> Vector:
    """How far the journals shift in their bores when something changes a little, to first order.

    Parameters
    ----------
    beam : Beam
        With which the balance was found.
    found : BeamFilm
    bores : numpy.ndarray [shape=(p, n, 4)]
        By which the bores move, y, z [m] and y', z' [rad].
    forces : numpy.ndarray [shape=(p, n, 4)]
        By which the films push more with the journals where they are [N], [N m].
    gives : numpy.ndarray [shape=(p, n, 4)]
        By which the pedestals give more under the forces there are [m], zero for the slopes.

    Returns
    -------
    numpy.ndarray [shape=(p, n, 4)]
        Of the journals relative to the bores, y, z [m] and y', z' [rad].

    Notes
    -----
    The balance of :func:`beam_film`, differentiated: with the films' stiffness ``S``, the beam's
    ``K`` and the pedestals' flexibility ``P``,
    ``(K + K P S + S) du = (1 + K P) dR - K (dq0 + dg)``.

    Examples
    --------
    A whole line that rises takes its journals along:

    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> steel = Section(length=4.0, outer_diameter=0.3, young=206e9, shear_modulus=79e9,
    ...                 density=7850.0)
    >>> beam = assemble_beam([steel], stations=(1.0, 3.0), theory="euler-bernoulli")
    >>> bush = JournalBearing(diameter=0.3, length=0.3, clearance=0.2e-3, viscosity=0.05)
    >>> line = [FilmBearing(name=n, station=s, bearing=bush) for n, s in (("a", 1.0), ("b", 3.0))]
    >>> rise, none = np.zeros((1, 2, 4)), np.zeros((1, 2, 4))
    >>> rise[..., 0] = 1e-3
    >>> found = beam_film(beam, line, 2 * math.pi * 2)
    >>> shift = journal_shifts(beam, found, bores=rise, forces=none, gives=none)
    >>> bool(np.abs(shift).max() < 1e-12)
    True
    """
    count = 4 * len(found.bearings)
    stiffness = _condensed(beam, _nodes(beam, found.bearings))[0]
    flexibility: Vector = np.pad(1 / np.array(found.pedestals), ((0, 0), (0, 2))).ravel()
    films = np.zeros((count, count))
    for n, own in enumerate(found.stiffness):
        films[4 * n : 4 * n + 4, 4 * n : 4 * n + 4] = own
    share = np.eye(count) + stiffness * flexibility
    moved, pushed = (bores + gives).reshape(-1, count), forces.reshape(-1, count)
    right = pushed @ share.T - moved @ stiffness.T
    shifts = np.linalg.solve(stiffness + share @ films, right.T).T.reshape(bores.shape)
    return np.asarray(shifts, dtype=float)


def coefficient_gradients(found: BeamFilm, *, step: float = GRADIENT_STEP) -> tuple[Vector, Vector]:
    """How the films' stiffness and damping change as the journals shift in their bores.

    Parameters
    ----------
    found : BeamFilm
    step : float
        Of the central differences, over the least gap of each film [-]. The coefficients of the
        rung *direct* jump by a per cent as nodes of its mesh fill and empty; with the default, over
        several of them, its gradients are within a tenth of those of 384 nodes round the bore.

    Returns
    -------
    stiffness, damping : numpy.ndarray [shape=(n, 4, 4, 4)]
        By the shift along y, z [1/m], y', z' [1/rad], the second axis; matrices as in
        :class:`BeamFilm`. Zero along what the rung leaves out.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> steel = Section(length=4.0, outer_diameter=0.3, young=206e9, shear_modulus=79e9,
    ...                 density=7850.0)
    >>> beam = assemble_beam([steel], stations=(1.0, 3.0), theory="euler-bernoulli")
    >>> bush = JournalBearing(diameter=0.3, length=0.3, clearance=0.2e-3, viscosity=0.05)
    >>> line = [FilmBearing(name=n, station=s, bearing=bush) for n, s in (("a", 1.0), ("b", 3.0))]
    >>> stiffness, _ = coefficient_gradients(beam_film(beam, line, 2 * math.pi * 2))
    >>> bool(stiffness[0, 0, 0, 0] < 0)  # the journal rises from the bottom: the film gets softer
    True
    """
    pairs = [
        _own_gradients(found, n, geometry, step) for n, geometry in enumerate(found.geometries)
    ]
    stiffness, damping = (np.array(side) for side in zip(*pairs, strict=True))
    return stiffness, damping


def _own_gradients(
    found: BeamFilm, n: int, geometry: FilmGeometry, step: float
) -> tuple[Vector, Vector]:
    bearing = found.bearings[n]
    own = bearing.worn
    tilted = bool(np.any(found.stiffness[n, 2:]))
    law = _law_on(found.rung, tilted, geometry)
    scale = -own.clearance / np.array([1.0, 1.0, own.length, own.length])
    place = np.concatenate([found.positions[n], found.slopes[n]]) / scale
    reach = step * _room(geometry, tilted, place)
    stiffness, damping = np.zeros((4, 4, 4)), np.zeros((4, 4, 4))
    units = own.force_unit(found.speed) * own.clearance / np.outer(scale, scale)
    for axis in range(4 if tilted else 2):
        ends = []
        for side in (-1, 1):
            there = place.copy()
            there[axis] += side * reach
            law.load(there, _AT_REST)
            ends.append(law.coefficients(there))
        width = 2 * reach * scale[axis]
        stiffness[axis] = (ends[1].stiffness - ends[0].stiffness) * units / width
        damping[axis] = (ends[1].damping - ends[0].damping) * units / width / found.speed
    return stiffness, damping


# --- the beam, condensed to its bearings


class _Line(NamedTuple):
    """Beam and bores; the order within a bearing is y, z, y', z', of a film X, Y and the tilts."""

    bearings: tuple[FilmBearing, ...]
    speed: float
    stiffness: Vector  # of the beam at the bearings (4 b, 4 b)
    pull: Vector  # of the beam on the journals, each in the middle of its bore (4 b,)
    bores: Vector  # their places without load (4 b,)
    pedestals: tuple[tuple[float, float], ...]
    flexibility: Vector  # of the pedestals (4 b,)
    scale: Vector  # a journal's place by the film's coordinates (4 b,)
    work: Vector  # unit of force times that of length (4 b,)
    spread: Callable[[Vector], Vector]  # places at the bearings -> deflection of the whole beam


def _line_of(
    beam: Beam,
    bearings: Sequence[FilmBearing],
    speed: float,
    pedestals: Sequence[tuple[float, float]] | None,
) -> _Line:
    if not 0 < speed < math.inf:
        raise ValueError(
            f"speed = {speed} rad/s must be > 0 and finite; a film needs a turning shaft"
        )
    nodes = _nodes(beam, bearings)
    stiffness, load, spread = _condensed(beam, nodes)
    own, stiff = [b.worn for b in bearings], _checked_pedestals(bearings, pedestals)
    bores = np.array([[*b.centre, *b.slope] for b in bearings]).ravel()
    scale = -np.array([[b.clearance] * 2 + [b.clearance / b.length] * 2 for b in own]).ravel()
    work = np.repeat([b.force_unit(speed) * b.clearance for b in own], 4)
    return _Line(
        bearings=tuple(bearings),
        speed=speed,
        stiffness=stiffness,
        pull=load - stiffness @ bores,
        bores=bores,
        pedestals=stiff,
        flexibility=np.pad(1 / np.array(stiff), ((0, 0), (0, 2))).ravel(),
        scale=scale,
        work=work,
        spread=spread,
    )


def _nodes(beam: Beam, bearings: Sequence[FilmBearing]) -> list[int]:
    if not bearings:
        raise ValueError("bearings = () must hold at least one; a shaft needs something to lie on")
    nodes = [beam.node(b.station) for b in bearings]
    for what, values in (("name", [b.name for b in bearings]), ("node of the beam", nodes)):
        if len(set(values)) < len(values):
            raise ValueError(
                f"bearings have the {what}s {values} and must differ in it; rename or move one"
            )
    return nodes


def _condensed(
    beam: Beam, nodes: Sequence[int]
) -> tuple[Vector, Vector, Callable[[Vector], Vector]]:
    """Stiffness and load at the bearings, and how the rest of the beam follows."""
    kept = (4 * np.array(nodes)[:, None] + np.array([0, 2, 1, 3])).ravel()
    count = beam.stiffness.shape[0]
    rest = np.setdiff1d(np.arange(count), kept)
    rows = beam.stiffness.tocsc()
    own, across = rows[kept][:, kept].toarray(), rows[rest][:, kept].toarray()
    load = np.asarray(beam.load, dtype=float)
    if rest.size == 0:
        still, shape = np.zeros(0), np.zeros((0, kept.size))
    else:
        factors = splu(rows[rest][:, rest].tocsc())
        still, shape = factors.solve(load[rest]), factors.solve(across)

    def spread(places: Vector) -> Vector:
        deflection = np.empty(count)
        deflection[kept] = places
        deflection[rest] = still - shape @ places
        return deflection

    stiffness = own - across.T @ shape
    return 0.5 * (stiffness + stiffness.T), load[kept] - across.T @ still, spread


def _checked_pedestals(
    bearings: Sequence[FilmBearing], pedestals: Sequence[tuple[float, float]] | None
) -> tuple[tuple[float, float], ...]:
    if pedestals is None:
        return ((math.inf, math.inf),) * len(bearings)
    if len(pedestals) != len(bearings):
        raise ValueError(
            f"pedestals has {len(pedestals)} entries and must have {len(bearings)}, one for each "
            "bearing; math.inf is rigid"
        )
    for bearing, pair in zip(bearings, pedestals, strict=True):
        if not min(pair) > 0:
            raise ValueError(
                f"pedestals of '{bearing.name}' = {min(pair)} N/m must be > 0; math.inf is rigid"
            )
    return tuple((float(y), float(z)) for y, z in pedestals)


# --- films


class _Load(NamedTuple):
    """Of a film on its journal: F_X, F_Y and the moments."""

    value: Vector
    ok: bool


class _Law(NamedTuple):
    """How the film of one bearing answers a place (X, Y, tilt_x, tilt_y) and its rates."""

    geometry: FilmGeometry
    tilted: bool
    load: Callable[[Vector, Vector], _Load]
    coefficients: Callable[[Vector], Coefficients]  # at the place of the last load
    solution: Callable[[Vector], FilmSolution]


_AT_REST = np.zeros(4)
_RUNGS = {rung.name: rung for rung in FILM_RUNGS}


def _law(rung: str, tilted: bool, bearing: FilmBearing) -> _Law:
    geometry = bearing.worn.geometry
    if geometry.condition == "reynolds":
        raise ValueError(
            f"{bearing.name}.film.condition = 'reynolds' must be 'periodic' or 'guembel'; its line "
            "without pressure jumps from node to node as the journal turns"
        )
    if rung not in _RUNGS:
        raise ValueError(f"rung = '{rung}' must be one of {', '.join(_RUNGS)}")
    return _law_on(rung, tilted, geometry)


def _law_on(rung: str, tilted: bool, geometry: FilmGeometry) -> _Law:
    if rung == "direct":
        return _direct_law(geometry, tilted)
    if rung == "map":
        load = partial(_map_load, impedance_map(geometry))
        return _any_law(geometry, False, load, rung)
    tilted = tilted and _RUNGS[rung].tilted
    return _any_law(geometry, tilted, partial(_rung_load, rung, geometry, tilted), rung)


def _direct_law(geometry: FilmGeometry, tilted: bool) -> _Law:
    work = direct_film(geometry, tilted=tilted)
    return _Law(
        geometry=geometry,
        tilted=tilted,
        load=partial(_direct_load, work, tilted),
        coefficients=partial(_direct_coefficients, work, tilted),
        solution=partial(_solution, "direct", geometry, tilted),
    )


def _any_law(
    geometry: FilmGeometry, tilted: bool, load: Callable[[Vector, Vector], _Load], field: str
) -> _Law:
    return _Law(
        geometry=geometry,
        tilted=tilted,
        load=load,
        coefficients=partial(_displaced, geometry, tilted, load),
        solution=partial(_solution, field, geometry, tilted),
    )


def _state(tilted: bool, place: Vector, rates: Vector = _AT_REST) -> FilmState:
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
    """4 x 4, zero where the film knows no tilt."""
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
    """Central differences; of the tilt only where the film knows it."""
    step = _DISPLACEMENT * _room(geometry, tilted, place)
    stiffness, damping = np.zeros((4, 4)), np.zeros((4, 4))
    for axis in range(4 if tilted else 2):
        way = np.zeros(4)
        way[axis] = 1.0
        ends = [load(place + side * step * way, _AT_REST).value for side in (-1, 1)]
        stiffness[:, axis] = (ends[0] - ends[1]) / (2 * step)
        ends = [load(place, side * _RATE * way).value for side in (-1, 1)]
        damping[:, axis] = (ends[0] - ends[1]) / (2 * _RATE)
    return Coefficients(stiffness, damping)


def _gaps(geometry: FilmGeometry, tilted: bool, place: Vector) -> Vector:
    """At both ends, over C (2, n_theta)."""
    half = 0.5 * place[2:] if tilted else np.zeros(2)
    bore = 1.0 if geometry.bore is None else 1.0 + np.asarray(geometry.bore)
    return bore - np.array([place[:2] - half, place[:2] + half]) @ _turns(geometry.n_theta)


def _turns(count: int) -> Vector:
    angle = 2 * math.pi * np.arange(count) / count
    return np.array([np.cos(angle), np.sin(angle)])


def _room(geometry: FilmGeometry, tilted: bool, place: Vector) -> float:
    return float(np.min(_gaps(geometry, tilted, place)))


def _way(law: _Law, place: Vector, step: Vector) -> float:
    """Share of the step at which the journal would touch."""
    now = _gaps(law.geometry, law.tilted, place)
    loss = now - _gaps(law.geometry, law.tilted, place + step)
    closing = loss > 0
    return float(np.min(now[closing] / loss[closing])) if closing.any() else math.inf


# --- balance


class _Found(NamedTuple):
    places: Vector  # (b, 4), as the films see them
    loads: Vector  # of the films (b, 4)
    residual: float
    iterations: int
    status: ShaftFilmStatus
    culprit: int
    strength: float = 1.0  # of films that are balanced here, over those there are


class _Now(NamedTuple):
    """A trial and what is left over there."""

    places: Vector  # (b, 4)
    loads: Vector  # (b, 4)
    left: Vector  # (4 b,), in the units of the films
    ok: bool


class _System(NamedTuple):
    """Beam and pedestals in the units of the films: ``A u + a - (1 + A P) g``."""

    line: _Line
    laws: list[_Law]
    beam: Vector  # A (4 b, 4 b)
    pull: Vector  # -a (4 b,)
    share: Vector  # 1 + A P (4 b, 4 b)


def _system(line: _Line, laws: list[_Law], strength: float) -> _System:
    """With all films, and pedestals along with them, made stronger by a factor."""
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


def _each(laws: Sequence[_Law], found: _Found) -> list[tuple[_Law, Vector]]:
    return list(zip(laws, found.places, strict=True))


def _evaluate(system: _System, places: Vector) -> _Now:
    answers = [law.load(place, _AT_REST) for law, place in zip(system.laws, places, strict=True)]
    loads = np.array([answer.value for answer in answers])
    left = system.beam @ places.ravel() - system.pull - system.share @ loads.ravel()
    return _Now(places, loads, left, all(answer.ok for answer in answers))


def _solve(line: _Line, laws: list[_Law], start: Vector, tolerance: float) -> _Found:
    """Newton from the start, and where that fails by way of stronger films."""
    found = _newton(_system(line, laws, 1.0), start, tolerance)
    if found.status.ok:
        return found
    other = _weakened(line, laws, tolerance)
    return other._replace(iterations=found.iterations + other.iterations)


def _weakened(line: _Line, laws: list[_Law], tolerance: float) -> _Found:
    """From films that hold the journals in the middle to those there are, as far as it goes."""
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


def _near_the_middle(line: _Line, laws: list[_Law]) -> tuple[Vector, float]:
    """Places off the middle by about a tenth of the clearance, and the films that have them so."""
    pull = (line.scale * line.pull / line.work).reshape(-1, 4)
    strength = max(1.0, _STIFFEST * float(np.max(np.abs(pull))))
    places = np.zeros((len(laws), 4))
    for n, law in enumerate(laws):
        places[n, :2] = _short_place(law.geometry.length_to_diameter, pull[n, :2] / strength)
    return places, strength


def _newton(system: _System, places: Vector, tolerance: float) -> _Found:
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
    return min(_room(law.geometry, law.tilted, place) for law, place in laws)


def _matrix(system: _System, now: _Now) -> Vector:
    films = np.zeros_like(system.beam)
    for n, (law, place) in enumerate(zip(system.laws, now.places, strict=True)):
        films[4 * n : 4 * n + 4, 4 * n : 4 * n + 4] = law.coefficients(place).stiffness
    matrix: Vector = system.beam + system.share @ films
    return matrix


def _step(system: _System, now: _Now, matrix: Vector) -> _Now | None:
    """The next place, or none where no step brings the balance closer."""
    try:
        backward = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return None
    step = -(backward @ now.left)
    by_bearing = step.reshape(-1, 4)
    laws = list(zip(system.laws, now.places, by_bearing, strict=True))
    share = min(1.0, _NEAREST * min(_way(law, place, own) for law, place, own in laws))
    weight = np.repeat([1 / _room(w.geometry, w.tilted, place) for w, place, _ in laws], 4)
    size = float(np.linalg.norm(weight * step))
    for _ in range(_MOST_HALVINGS):
        trial = _evaluate(system, now.places + share * by_bearing)
        if trial.ok:
            after = float(np.linalg.norm(weight * (backward @ trial.left)))
            if after <= (1 - share / 4) * size:
                return trial
        share *= 0.5
    return None


def _residuals(system: _System, now: _Now) -> Vector:
    """Force and moment left over, over the load of each bearing (b,)."""
    unit = system.line.work[::4] / -system.line.scale[::4]
    load = np.hypot(*now.loads[:, :2].T) * unit
    load = np.maximum(load, max(_LEAST_SHARE * float(np.mean(load)), np.finfo(float).tiny))
    left = now.left.reshape(-1, 4) * (unit / load)[:, None]
    residuals: Vector = np.maximum(np.hypot(*left[:, :2].T), np.hypot(*left[:, 2:].T))
    return residuals


def _ended(system: _System, now: _Now, steps: int, status: ShaftFilmStatus | None) -> _Found:
    residuals = _residuals(system, now) if now.ok else np.full(len(system.laws), math.inf)
    worst = int(np.argmax(residuals))
    residual = float(residuals[worst])
    if status is None:
        status, worst = _diagnosis(system, now, worst)
    return _Found(
        places=now.places,
        loads=now.loads,
        residual=residual,
        iterations=steps,
        status=status,
        culprit=worst,
    )


def _diagnosis(system: _System, now: _Now, worst: int) -> tuple[ShaftFilmStatus, int]:
    """Which bearing is in the way, and how."""
    rooms = [
        _gaps(law.geometry, law.tilted, place)
        for law, place in zip(system.laws, now.places, strict=True)
    ]
    nearest = int(np.argmin([np.min(room) for room in rooms]))
    ends = rooms[nearest].min(axis=1)
    if np.min(ends) > _CLOSE:
        return ShaftFilmStatus.NO_CONVERGENCE, worst
    if np.max(ends) > _CLOSE:
        return ShaftFilmStatus.EDGE_CONTACT, nearest
    turns = _turns(rooms[nearest].shape[1]).T[rooms[nearest].argmin(axis=1)]
    opposite = float(turns[0] @ turns[1]) < _OPPOSITE
    return (ShaftFilmStatus.NO_ROOM if opposite else ShaftFilmStatus.OVERLOAD), nearest


def _may_be_refined(found: _Found) -> bool:
    """Whether there is a balance, or a finer mesh might carry an edge that this one does not."""
    edge = found.status is ShaftFilmStatus.EDGE_CONTACT
    return found.status.ok or (edge and found.strength < _NEARLY)


def _finer(law: _Law, place: Vector) -> _Law:
    """The same film on a mesh twice as fine where this one is too coarse, or itself."""
    geometry, bore = law.geometry, law.geometry.bore
    if law.solution(place).status is FilmStatus.COARSE:
        if bore is not None:  # linear between the nodes
            bore = np.stack([bore, 0.5 * (bore + np.roll(bore, -1))], axis=1).ravel()
        geometry = replace(geometry, n_theta=2 * geometry.n_theta, bore=bore)
    ends = _gaps(geometry, law.tilted, place)
    least = ends.min()
    line = int(ends.min(axis=0).argmin())
    if np.ptp(ends[:, line]) > _STEEPEST * least * (geometry.n_z - 1):
        geometry = replace(geometry, n_z=2 * geometry.n_z - 1)
    return law if geometry is law.geometry else _direct_law(geometry, law.tilted)


# --- where to start


def _check_held(line: _Line, laws: Sequence[_Law]) -> None:
    if len(laws) == 1 and not laws[0].tilted:
        raise ValueError(
            f"bearing '{line.bearings[0].name}' alone must resist tilt; take the rung 'direct' "
            "with tilt, or give the shaft a second bearing"
        )


def _places_of(start: BeamFilm, line: _Line) -> Vector:
    if len(start.bearings) != len(line.bearings):
        raise ValueError(
            f"start has {len(start.bearings)} bearings and must have {len(line.bearings)}; start "
            "from a state of the same line"
        )
    own = np.hstack([start.positions, start.slopes])
    lengths = [b.bearing.length for b in start.bearings]
    clearances = _clearances(start.bearings)
    own[:, 2:] *= np.array(lengths)[:, None]
    places: Vector = -own / clearances[:, None]
    return places


def _first_places(line: _Line, laws: Sequence[_Law]) -> Vector:
    """Each journal where a short film carries what a bearing without film would, tilted less."""
    reactions, slopes = _pinned(line)
    places = np.zeros((len(laws), 4))
    for n, (law, bearing) in enumerate(zip(laws, line.bearings, strict=True)):
        own = bearing.worn
        load = reactions[n] / own.force_unit(line.speed)
        places[n, :2] = _first_place(law.geometry, bearing, load)
        tilt = -slopes[n] * own.length / own.clearance
        most = 2 * _START_TILT * _room(law.geometry, False, places[n])
        places[n, 2:] = tilt * min(1.0, most / max(float(np.hypot(*tilt)), 1e-12))
    return places


def _first_place(geometry: FilmGeometry, bearing: FilmBearing, load: Vector) -> Vector:
    """Of a short bearing: in the circle of the worn arc, if the bore has room for it there."""
    ratio = geometry.length_to_diameter
    if bearing.wear_down > 0 and (own := bearing.arc_clearance) is not None:
        lower = bearing.wear_down / bearing.bearing.clearance + 1 - own
        place = np.array([lower, 0.0]) + own * _short_place(ratio, load * own**2)
        if _room(geometry, False, np.pad(place, (0, 2))) > 0:
            return np.asarray(place)
    return _short_place(ratio, load)


def _short_place(length_to_diameter: float, load: Vector) -> Vector:
    """Of a short bearing, its force lowered as a finite length does."""
    size = float(np.hypot(*load))
    if size == 0:
        return np.zeros(2)
    e = min(short_eccentricity(size * (length_to_diameter**-2 + 0.5)), _MOST_START)
    angle = math.atan2(load[1], load[0]) + short_attitude(e)
    return e * np.array([math.cos(angle), math.sin(angle)])


def _pinned(line: _Line) -> tuple[Vector, Vector]:
    """Reactions and slopes relative to the bores of a beam pinned at their bottoms (b, 2)."""
    count = len(line.bearings)
    places = np.arange(4 * count).reshape(-1, 4)
    held, free = places[:, :2].ravel(), places[:, 2:].ravel()
    down = np.array([[-b.bottom, 0.0] for b in line.bearings]).ravel()
    right = line.pull[free] - line.stiffness[np.ix_(free, held)] @ down
    slopes = np.linalg.lstsq(line.stiffness[np.ix_(free, free)], right)[0]
    reactions = line.stiffness[np.ix_(held, held)] @ down
    reactions += line.stiffness[np.ix_(held, free)] @ slopes - line.pull[held]
    return reactions.reshape(-1, 2), slopes.reshape(-1, 2)


# --- result


def _result(line: _Line, laws: list[_Law], found: _Found, rung: str) -> BeamFilm:
    own = [b.worn for b in line.bearings]
    films = tuple(law.solution(place) for law, place in _each(laws, found))
    status, culprit = found.status, found.culprit
    coarse = [n for n, film in enumerate(films) if film.status is FilmStatus.COARSE]
    if status.ok and coarse:
        status, culprit = ShaftFilmStatus.COARSE, coarse[0]
    stiffness, damping = _matrices(line, laws, found)
    force = line.work * found.loads.ravel() / line.scale
    give = -line.flexibility * force
    relative = line.scale * found.places.ravel()
    pairs = list(zip(own, films, strict=True))
    return BeamFilm(
        bearings=line.bearings,
        rung=rung,
        speed=line.speed,
        positions=relative.reshape(-1, 4)[:, :2],
        slopes=relative.reshape(-1, 4)[:, 2:],
        reactions=force.reshape(-1, 4)[:, :2],
        moments=force.reshape(-1, 4)[:, 2:],
        stiffness=stiffness,
        damping=damping,
        least_film=np.array([b.clearance * f.min_thickness for b, f in pairs]),
        peak_pressure=np.array([_peak(b, line.speed, f) for b, f in pairs]),
        films=films,
        geometries=tuple(law.geometry for law in laws),
        pedestals=line.pedestals,
        give=give.reshape(-1, 4)[:, :2],
        deflection=line.spread(line.bores + relative + give),
        residual=found.residual,
        iterations=found.iterations,
        status=status,
        culprit=line.bearings[culprit].name,
        strength=found.strength,
    )


def _peak(bearing: JournalBearing, speed: float, film: FilmSolution) -> float:
    area = bearing.diameter / 2 * bearing.length
    return float(film.pressure.max()) * bearing.force_unit(speed) / area


def _matrices(line: _Line, laws: list[_Law], found: _Found) -> tuple[Vector, Vector]:
    """Stiffness and damping in SI (b, 4, 4)."""
    stiffness, damping = [], []
    for n, (law, place) in enumerate(_each(laws, found)):
        own = slice(4 * n, 4 * n + 4)
        if not law.load(place, _AT_REST).ok:
            stiffness.append(np.zeros((4, 4)))
            damping.append(np.zeros((4, 4)))
            continue
        film = law.coefficients(place)
        units = line.work[own.start] / np.outer(line.scale[own], line.scale[own])
        stiffness.append(film.stiffness * units)
        damping.append(film.damping * units / line.speed)
    return np.array(stiffness), np.array(damping)
