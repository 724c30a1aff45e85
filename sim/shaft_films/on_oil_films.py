"""A shaft on its oil films: beam and films solved together.

The beam is condensed once to four coordinates at each bearing: height, side and both slopes. The
film of a bearing responds to the position and the tilt of the journal with a force and a moment,
and Newton's method finds the equilibrium of beam and films, using the film's own
stiffness. A rigid journal under a force and a moment is the case of one bearing.

Axes are the shaft's: y up, z to the right looking forward, slopes ``y' = dy/dx`` and
``z' = dz/dx``, positive speed from y to z. Those of the film are rotated: ``(X, Y) = -(y, z) / C``,
and the tilts are ``-(y', z') L / C``, all of the journal relative to the bore. Matrices of a
bearing are in the order y, z, y', z'.

Each bearing's height refers to the journal: `offset` is the height of its centre when it lies at
the bottom of the bore, whose own centre is one radial clearance higher.

Effect of the film model on the built-in *propulsion-shaft* as built, with the stern bearing
worn down by 0.9 mm, and with a line bearing sagged by 1.2 mm: largest differences from the film
*direct* on 144 x 33 nodes, reactions over their mean:

================================  =========  ==========  ==================  =====
film                              reactions  least film  stiffness, damping  ms
================================  =========  ==========  ==================  =====
short                             5 %        83 %        106 %               19
finite, map, direct without tilt  4 %        22 %        6 %                 8-36
direct, 48 x 13                   0.1 %      1.1 %       3 %                 11
direct, 72 x 17                   0.1 %      0.5 %       3 %                 18
mass-conserving against direct    0.2 %      2 %         6 %                 4,000
================================  =========  ==========  ==================  =====

Without moments and tilt, reactions are within 4 % and frequencies within 6 % (23 % on a line with
a heavier propeller), but the first bending modes lose their damping: 0.7 % of critical instead
of 39 %. Compared with rigid supports, films with their pedestals change reactions by up to 6 %. The
last row has two axial grooves in every bearing. Times are processor times for five bearings.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..beam.beam import Beam
from ..beam.rotor import Support
from ..bearing.operate import JournalBearing
from ..brief import brief
from ..film.solve import FilmGeometry, FilmSolution, FilmStatus
from .balance import LEAST_SHARE, Balance, may_be_refined, solve_balance
from .film_bearing import FilmBearing, clearances_of
from .laws import AT_REST, FilmLaw, finer_law, law_of, least_gap
from .line import CondensedLine, condensed_line
from .start import first_places
from .status import ShaftFilmError, ShaftFilmStatus

Vector = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the load


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamFilm:
    """A shaft in equilibrium on its films.

    Attributes
    ----------
    bearings : tuple of FilmBearing
        As passed, n of them.
    rung : str
    speed : float
        Shaft speed [rad/s].
    positions : numpy.ndarray [shape=(n, 2)]
        Journal's centre relative to the bore's, y and z [m].
    slopes : numpy.ndarray [shape=(n, 2)]
        Slopes of the journal relative to the bore [rad].
    reactions : numpy.ndarray [shape=(n, 2)]
        Force of the film on the shaft, y and z [N].
    moments : numpy.ndarray [shape=(n, 2)]
        Moment of the film on the shaft, conjugate to y' and z' [N m].
    stiffness : numpy.ndarray [shape=(n, 4, 4)]
        Negative derivatives of force and moment by y, z, y', z' [N/m], [N/rad], [N m/m], [N m/rad].
        Zero for what the rung neglects.
    damping : numpy.ndarray [shape=(n, 4, 4)]
        The same for their rates, units times a second.
    least_film : numpy.ndarray [shape=(n,)]
        Least film thickness [m].
    peak_pressure : numpy.ndarray [shape=(n,)]
        Largest film pressure [Pa].
    films : tuple of FilmSolution
        Film solutions, non-dimensional.
    geometries : tuple of FilmGeometry
        Geometries of the films: the mesh may have been refined.
    pedestals : tuple of tuple of float
        Stiffness under each bore, y and z [N/m].
    give : numpy.ndarray [shape=(n, 2)]
        Displacement of each bore's centre on its pedestal, y and z [m].
    deflection : numpy.ndarray [shape=(4 * nodes,)]
        Deflection of the beam, in its own order [m], [rad].
    residual : float
        Residual force or moment at the worst bearing, over its load, and over its load times its
        length; for a bearing with less than 1 % of the mean load, over that load.
    iterations : int
        Number of Newton steps.
    status : ShaftFilmStatus
    culprit : str
        Bearing that the status refers to, or that of the largest residual.
    strength : float
        1; or, without an equilibrium, the factor by which viscosity or speed would have to grow for
        an equilibrium in the state shown, the last one found: positions, forces and matrices are
        those of the actual films in these positions.
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
        """Eccentricity ratios from the film in the middle of the length [shape=(n,)].

        One minus the least film there over the radial clearance; in a round bore the distance of
        the centres over the clearance.
        """
        ratios: Vector = np.hypot(*self.positions.T) / clearances_of(self.bearings)
        for n, (geometry, place) in enumerate(zip(self.geometries, self.positions, strict=True)):
            if geometry.bore is not None:
                middle = np.array([*(-place / self.bearings[n].worn.clearance), 0.0, 0.0])
                ratios[n] = 1 - least_gap(geometry, False, middle)
        return ratios

    @property
    def middle_films(self) -> Vector:
        """Least film in the middle of each bearing's length [m, shape=(n,)]."""
        return np.asarray((1 - self.eccentricity_ratios) * clearances_of(self.bearings))

    @property
    def unloaded(self) -> tuple[str, ...]:
        """Bearings that do not carry: loaded downwards, or by less than 1 % of the mean load."""
        up = self.reactions[:, 0]
        least = LEAST_SHARE * float(np.mean(np.abs(up)))
        return tuple(b.name for b, r in zip(self.bearings, up, strict=True) if r < least)


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
    """Equilibrium of a shaft on its oil films.

    Parameters
    ----------
    beam : Beam
        Beam with its loads; the station of every bearing is a node.
    bearings : sequence of FilmBearing
        In any order; each on its own node.
    speed : float
        Shaft speed > 0 [rad/s].
    rung : str
        ``"direct"`` or ``"mass-conserving"``, which support a tilted journal, or
        ``"short"``, ``"long"``, ``"finite"``, ``"map"``, for which the journal is aligned at its
        position in the middle of the length, without a moment.
    tilted : bool
        False: neglect the tilt for those two rungs as well.
    pedestals : sequence of tuple of float, optional
        Stiffness under each bore along y and z [N/m], in the order of the bearings;
        ``math.inf`` is rigid, as all are by default. Offsets are those of the bores without load.
    start : BeamFilm, optional
        Result for a similar case with the same number of bearings.
    refinements : int
        Number of times the mesh of a bearing may be doubled if its film is too thin for it, with
        the rung *direct*: round the bore, or along the length if the gap doubles between an
        edge and the next node.
    tolerance : float
        Tolerance of the residual.
    raise_on_failure : bool
        False: return the last state with its status instead.

    Returns
    -------
    BeamFilm
        Positions, reactions, coefficients and status.

    Raises
    ------
    ShaftFilmError
        No equilibrium was found; the message names the bearing and the cure.
    ValueError
        A name or a node is used twice, the speed is not above zero, there is no such rung, or a
        film has the condition *reynolds*.

    Notes
    -----
    With the beam condensed to its bearings, ``K`` and ``f``, the bores' positions ``q0``, the
    journals' positions in them ``u`` and the film's force ``R(u)``::

        K (q0 + u - R / pedestal) - f = R(u)

    Newton's method with ``dR/du`` of the film; a step is limited to 85 % of the distance to contact
    in any bearing and halved until the next one, by the same matrix, gets smaller (the natural
    test, which is independent of the units of forces and moments). If that fails, the films
    are first made so stiff that they hold all journals in the middle, and weakened step by step.

    Laminar, isothermal, steady; the bearings are far enough apart that each acts on one node.

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
    line = condensed_line(beam, bearings, speed, pedestals)
    laws = [law_of(rung, tilted, bearing) for bearing in line.bearings]
    _check_held(line, laws)
    first = first_places(line, laws) if start is None else _places_of(start, line)
    found = solve_balance(line, laws, first, tolerance)
    for _ in range(refinements if rung == "direct" else 0):
        finer = [finer_law(law, place) for law, place in zip(laws, found.places, strict=True)]
        if not may_be_refined(found) or finer == laws:
            break
        laws = finer
        again = solve_balance(line, laws, found.places, tolerance)
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
    """Films as supports of a rotor, about the equilibrium.

    Parameters
    ----------
    found : BeamFilm
        Result of :func:`beam_film`.
    moments : bool
        False: omit all coefficients of slopes, as rungs without tilt do.
    housing_masses : sequence of float, optional
        Masses that move with each bore [kg]; needed unless the pedestals are rigid.
    pedestal_damping : sequence of tuple of float, optional
        Damping under each bore along y and z [N s/m], by default none.

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
            "and a pedestal flexible in both directions; give housing_masses, or rigid pedestals"
        )
    return replace(film, housing_mass=mass, pedestal_stiffness=pedestal, pedestal_damping=damping)


def _check_held(line: CondensedLine, laws: Sequence[FilmLaw]) -> None:
    if len(laws) == 1 and not laws[0].tilted:
        raise ValueError(
            f"bearing '{line.bearings[0].name}' alone must resist tilt; use the rung 'direct' "
            "with tilt, or give the shaft a second bearing"
        )


def _places_of(start: BeamFilm, line: CondensedLine) -> Vector:
    if len(start.bearings) != len(line.bearings):
        raise ValueError(
            f"start has {len(start.bearings)} bearings and must have {len(line.bearings)}; start "
            "from a state of the same line"
        )
    own = np.hstack([start.positions, start.slopes])
    lengths = [b.bearing.length for b in start.bearings]
    clearances = clearances_of(start.bearings)
    own[:, 2:] *= np.array(lengths)[:, None]
    places: Vector = -own / clearances[:, None]
    return places


def _result(line: CondensedLine, laws: list[FilmLaw], found: Balance, rung: str) -> BeamFilm:
    own = [b.worn for b in line.bearings]
    films = tuple(law.solution(place) for law, place in zip(laws, found.places, strict=True))
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


def _matrices(line: CondensedLine, laws: list[FilmLaw], found: Balance) -> tuple[Vector, Vector]:
    """Stiffness and damping in SI (b, 4, 4)."""
    stiffness, damping = [], []
    for n, (law, place) in enumerate(zip(laws, found.places, strict=True)):
        own = slice(4 * n, 4 * n + 4)
        if not law.load(place, AT_REST).ok:
            stiffness.append(np.zeros((4, 4)))
            damping.append(np.zeros((4, 4)))
            continue
        film = law.coefficients(place)
        units = line.work[own.start] / np.outer(line.scale[own], line.scale[own])
        stiffness.append(film.stiffness * units)
        damping.append(film.damping * units / line.speed)
    return np.array(stiffness), np.array(damping)
