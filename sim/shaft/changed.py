"""Small changes of a shaft line: its films, its transfer functions, and their derivatives.

Changes are given as one row of numbers for each bearing; any unknown of a line is a sum of such
rows. The shaft itself does not change, so that it is condensed to its bearings once for
each frequency, free of all supports: films, housings and pedestals are joined to it afterwards, and
the derivative of a transfer function with respect to anything in them is a product of two of its
columns, ``dH = -y' dZ x``.

==================  ======================================================================
quantity            in a row
==================  ======================================================================
bore                rise along y, z [m], turn of y', z' [rad]
clearance           natural logarithm of a factor
viscosity           natural logarithm of a factor
pedestal            the same of the stiffness along y, z
pedestal_damping    the same of the damping along y, z
film_stiffness      4 x 4, added to the film's, in units of :func:`film_sizes`
film_damping        the same
==================  ======================================================================
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..beam.beam import Beam
from ..beam.rotor import Rotor
from ..scene.shaft import ShaftScene
from ..shaft_films.film_bearing import FilmBearing
from ..shaft_films.on_oil_films import BeamFilm, beam_film
from ..shaft_films.small_changes import GRADIENT_STEP, coefficient_gradients, journal_shifts
from ..shaft_response.places import Place
from ..shaft_response.receptance import receptance
from .at_rest import film_bearings
from .line_beam import running_beam

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

_COLUMNS = {
    "bore": slice(0, 4),
    "clearance": slice(4, 5),
    "viscosity": slice(5, 6),
    "pedestal": slice(6, 8),
    "pedestal_damping": slice(8, 10),
    "film_stiffness": slice(10, 26),
    "film_damping": slice(26, 42),
}

QUANTITIES = tuple(_COLUMNS)
"""Quantities of a bearing that may change."""

WIDTH = 42
"""Length of a bearing's row."""

_COORDINATES = ("y", "z", "slope_y", "slope_z")


# --- changes


def no_change(bearings: int) -> Vector:
    """Rows of zeros [shape=(bearings, 42)]."""
    return np.zeros((bearings, WIDTH))


def unit_change(bearings: int, bearing: int, quantity: str, entry: int = 0) -> Vector:
    """Change one number of one bearing by one.

    Parameters
    ----------
    bearings : int
        Number of bearings of the line.
    bearing : int
        Index of the bearing, from aft.
    quantity : str
        One of :data:`QUANTITIES`.
    entry : int
        Index in the quantity; matrices row by row.

    Returns
    -------
    numpy.ndarray [shape=(bearings, 42)]

    Raises
    ------
    ValueError
        There is no such quantity.

    Examples
    --------
    >>> unit_change(4, 2, "viscosity")[2].nonzero()[0].tolist()
    [5]
    """
    if quantity not in _COLUMNS:
        raise ValueError(f"quantity = {quantity!r} must be one of {', '.join(QUANTITIES)}")
    rows = no_change(bearings)
    rows[bearing, _COLUMNS[quantity].start + entry] = 1.0
    return rows


def part_of(change: Vector, quantity: str) -> Vector:
    """Select a quantity of all bearings [shape=(..., n, size)]."""
    return change[..., _COLUMNS[quantity]]


# --- the line


@dataclass(frozen=True, kw_only=True, eq=False)
class LineModel:
    """A shaft line with the data for its transfer functions.

    Attributes
    ----------
    beam : Beam
        Beam with all steady loads.
    bearings : tuple of FilmBearing
        n bearings, from aft.
    rung : str
        Rung of the films.
    housing_masses : numpy.ndarray [shape=(n,)]
        Masses of the housings [kg].
    pedestals, pedestal_damping : numpy.ndarray [shape=(n, 2)]
        Stiffness and damping along y and z [N/m], [N s/m].
    damping_ratio : float
    damping_band : tuple of float, optional
        Damping of the shaft's material, as in :class:`.beam.rotor.Rotor`.
    """

    beam: Beam
    bearings: tuple[FilmBearing, ...]
    rung: str
    housing_masses: Vector
    pedestals: Vector
    pedestal_damping: Vector
    damping_ratio: float
    damping_band: tuple[float, float] | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bearings, from aft."""
        return tuple(bearing.name for bearing in self.bearings)

    def changed(self, change: Vector) -> "LineModel":
        """Line with changed bearings; changes of film coefficients are left to :func:`transfer`.

        Parameters
        ----------
        change : numpy.ndarray [shape=(n, 42)]

        Returns
        -------
        LineModel
        """
        return replace(
            self,
            bearings=tuple(map(_changed, self.bearings, change)),
            pedestals=self.pedestals * np.exp(part_of(change, "pedestal")),
            pedestal_damping=self.pedestal_damping * np.exp(part_of(change, "pedestal_damping")),
        )


def _changed(bearing: FilmBearing, row: Vector) -> FilmBearing:
    up, side, turn_up, turn_side = (float(v) for v in part_of(row, "bore"))
    own = bearing.bearing
    return replace(
        bearing,
        bearing=replace(
            own,
            clearance=own.clearance * math.exp(float(part_of(row, "clearance")[0])),
            viscosity=own.viscosity * math.exp(float(part_of(row, "viscosity")[0])),
        ),
        offset=bearing.offset + up,
        side_offset=bearing.side_offset + side,
        slope=(bearing.slope[0] + turn_up, bearing.slope[1] + turn_side),
    )


def line_model(scene: ShaftScene) -> LineModel:
    """Line of a scene in its running state.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    LineModel

    Raises
    ------
    ValueError
        As in :func:`.line_beam.shaft_beam`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> line_model(load_scene("shaft-rig")).names
    ('aft', 'second', 'third', 'forward')
    """
    housings = [bearing.housing for bearing in scene.bearings]
    ratio = scene.shaft.damping_ratio
    return LineModel(
        beam=running_beam(scene),
        bearings=film_bearings(scene),
        rung=scene.film.rung,
        housing_masses=np.array([h.mass for h in housings]),
        pedestals=np.array([(h.stiffness_up, h.stiffness_side) for h in housings]),
        pedestal_damping=np.array([(h.damping_up, h.damping_side) for h in housings]),
        damping_ratio=ratio,
        damping_band=scene.shaft.damping_band if ratio > 0 else None,
    )


def rest(model: LineModel, speed: float, *, start: BeamFilm | None = None) -> BeamFilm:
    """Equilibrium of the line on its films.

    Parameters
    ----------
    model : LineModel
    speed : float
        Shaft speed [rad/s].
    start : BeamFilm, optional
        Equilibrium of a similar line.

    Returns
    -------
    BeamFilm

    Raises
    ------
    ShaftFilmError
        There is no equilibrium.
    """
    return beam_film(
        model.beam,
        model.bearings,
        speed,
        rung=model.rung,
        pedestals=[(float(up), float(side)) for up, side in model.pedestals],
        start=start,
    )


def film_sizes(film: BeamFilm) -> tuple[Vector, Vector]:
    """Reference values of a film's stiffness and damping.

    Parameters
    ----------
    film : BeamFilm

    Returns
    -------
    stiffness, damping : numpy.ndarray [shape=(n, 4, 4)]
        Root mean square of the four coefficients of y and z; for slopes multiplied by the length of
        the bearing over the root of twelve, the lever of a uniform pressure.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> film_sizes(rest(line_model(load_scene("shaft-rig")), 62.8))[0].shape
    (4, 4, 4)
    """
    lengths = np.array([bearing.bearing.length for bearing in film.bearings])
    lever = np.ones((lengths.size, 4))
    lever[:, 2:] = lengths[:, None] / math.sqrt(12)
    levers = lever[:, :, None] * lever[:, None, :]
    sizes = [
        np.sqrt(np.mean(np.square(own[:, :2, :2]), axis=(1, 2)))[:, None, None] * levers
        for own in (film.stiffness, film.damping)
    ]
    return sizes[0], sizes[1]


# --- slopes of the films


def coefficient_slopes(
    model: LineModel, film: BeamFilm, directions: Vector, *, step: float = GRADIENT_STEP
) -> tuple[Vector, Vector]:
    """Derivatives of the films' stiffness and damping for changes of the line.

    Parameters
    ----------
    model : LineModel
    film : BeamFilm
        Equilibrium of the line.
    directions : numpy.ndarray [shape=(p, n, 42)]
        Changes of the line.
    step : float
        See :func:`.small_changes.coefficient_gradients`.

    Returns
    -------
    stiffness, damping : numpy.ndarray [shape=(p, n, 4, 4)]

    Notes
    -----
    A film's force is ``eta C^-2 r(u / C, u' L / C)``: its stiffness is proportional to the
    viscosity, to the clearance to the power -3 for a fixed position in the clearance, and depends
    on that position.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> model = line_model(load_scene("shaft-rig"))
    >>> film = rest(model, 62.8)
    >>> stiffness, _ = coefficient_slopes(model, film, unit_change(4, 2, "bore")[None])
    >>> bool(stiffness[0, 2, 0, 0] > 0 > stiffness[0, 1, 0, 0])  # load goes over to what rises
    True
    """
    shifts = _shifts(model, film, directions)
    clearance = part_of(directions, "clearance")
    places = np.concatenate([film.positions, film.slopes], axis=1)
    within = shifts - clearance * places
    gradients = coefficient_gradients(film, step=step)
    own = [np.einsum("pnd,ndab->pnab", within, gradient) for gradient in gradients]
    scaled = (part_of(directions, "viscosity") - 3 * clearance)[..., None]
    extra = [part_of(directions, f"film_{name}") for name in ("stiffness", "damping")]
    sums = [
        along + scaled * now + added.reshape(along.shape) * size
        for along, now, added, size in zip(
            own, (film.stiffness, film.damping), extra, film_sizes(film), strict=True
        )
    ]
    return sums[0], sums[1]


def _shifts(model: LineModel, film: BeamFilm, directions: Vector) -> Vector:
    """Displacements of the journals in their bores (p, n, 4)."""
    push = np.concatenate([film.reactions, film.moments], axis=1)
    places = np.concatenate([film.positions, film.slopes], axis=1)
    clearance = part_of(directions, "clearance")
    held = (clearance * places)[..., None]  # keeps the position in the clearance
    forces = (part_of(directions, "viscosity") - 2 * clearance) * push
    forces += (film.stiffness @ held)[..., 0]
    bores = part_of(directions, "bore").copy()
    bores[..., 0] += clearance[..., 0] * [b.bearing.clearance for b in model.bearings]
    gives = np.zeros_like(bores)
    gives[..., :2] = part_of(directions, "pedestal") * film.reactions / model.pedestals
    return journal_shifts(model.beam, film, bores=bores, forces=forces, gives=gives)


# --- transfer functions


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeLine:
    """A shaft without supports, condensed to its bearings and the places of forces and responses.

    Attributes
    ----------
    frequencies : numpy.ndarray [shape=(n_lines,)]
        Frequencies [Hz].
    speed : float
        Shaft speed [rad/s].
    stiffness : numpy.ndarray [shape=(n_lines, m, m)]
        Dynamic stiffness, force over displacement; the four coordinates of each bearing come first.
    forces, responses : numpy.ndarray [shape=(n_force,)], [shape=(n_resp,)]
        Coordinates; those of the housings, y and z of each, follow those of the shaft.
    """

    frequencies: Vector
    speed: float
    stiffness: Complex
    forces: NDArray[np.int64]
    responses: NDArray[np.int64]

    def pushed(self, force: int) -> "FreeLine":
        """The same with only one of its forces."""
        return replace(self, forces=self.forces[[force]])


def free_line(
    model: LineModel,
    frequencies: ArrayLike,
    *,
    speed: float,
    forces: Sequence[Place],
    responses: Sequence[Place],
) -> FreeLine:
    """Condense the shaft for a test: once for all changes of its bearings.

    Parameters
    ----------
    model : LineModel
    frequencies : array_like [shape=(n_lines,)]
        Frequencies > 0 [Hz].
    speed : float
        Shaft speed [rad/s].
    forces, responses : sequence of place
        ``(bearing or station, coordinate)`` or ``(bearing, "y" or "z", "housing")``.

    Returns
    -------
    FreeLine

    Raises
    ------
    ValueError
        A place is unknown, or a frequency is not above zero.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> model = line_model(load_scene("shaft-rig"))
    >>> free_line(model, [20.0, 40.0], speed=62.8, forces=[("second", "y")],
    ...           responses=[("third", "y", "housing")]).stiffness.shape
    (2, 16, 16)
    """
    hertz = np.asarray(frequencies, dtype=float)
    if not (hertz > 0).all():
        raise ValueError(f"frequency = {hertz.min():g} Hz must be > 0; a free shaft has no support")
    shaft = Rotor(
        beam=model.beam, damping_ratio=model.damping_ratio, damping_band=model.damping_band
    )
    own = [shaft.dof(b.station, name) for b in model.bearings for name in _COORDINATES]
    places = [_resolved(model, shaft, place) for place in (*forces, *responses)]
    kept = list(dict.fromkeys([*own, *(dof for dof, housing in places if not housing)]))
    flexibility = receptance(shaft, hertz, kept, kept, speed=speed)
    numbers = [len(kept) + number if housing else kept.index(number) for number, housing in places]
    return FreeLine(
        frequencies=hertz,
        speed=speed,
        stiffness=np.asarray(np.linalg.inv(flexibility), dtype=np.complex128),
        forces=np.array(numbers[: len(forces)], dtype=np.int64),
        responses=np.array(numbers[len(forces) :], dtype=np.int64),
    )


def _resolved(model: LineModel, shaft: Rotor, place: Place) -> tuple[int, bool]:
    """Coordinate of the beam, or index of a housing coordinate, and whether it is one of these."""
    if not isinstance(place, tuple):
        raise ValueError(f"place = {place!r} must be named, as ('stern', 'y', 'housing')")
    where, coordinate, *part = place
    if isinstance(where, str) and where not in model.names:
        raise ValueError(f"place = '{where}' must be a bearing: {', '.join(model.names)}")
    if part == ["housing"]:
        if coordinate not in ("y", "z") or not isinstance(where, str):
            raise ValueError(f"place = {place} must be of a bearing's housing along y or z")
        return 2 * model.names.index(where) + "yz".index(coordinate), True
    station = where
    if isinstance(where, str):
        station = model.bearings[model.names.index(where)].station
    return shaft.dof(station, coordinate), False


class ChangedTransfer(NamedTuple):
    """Accelerances, and the data for their derivatives."""

    value: Complex  # [(m/s^2)/N] (n_lines, n_resp, n_force)
    right: Complex  # displacement of every coordinate per force (n_lines, m + 2 n, n_force)
    left: Complex  # of every response per force on every coordinate (n_lines, n_resp, m + 2 n)


def transfer(
    model: LineModel, film: BeamFilm, line: FreeLine, change: Vector | None = None
) -> ChangedTransfer:
    """Accelerance from the forces of a test to its responses.

    Parameters
    ----------
    model : LineModel
    film : BeamFilm
        Equilibrium at the speed of the test.
    line : FreeLine
        Result of :func:`free_line`.
    change : numpy.ndarray [shape=(n, 42)], optional
        Change of the film's coefficients only; other changes are in the model.

    Returns
    -------
    ChangedTransfer

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> model = line_model(load_scene("shaft-rig"))
    >>> line = free_line(model, [20.0, 40.0], speed=62.8, forces=[("second", "y")],
    ...                  responses=[("third", "y", "housing")])
    >>> transfer(model, rest(model, 62.8), line).value.shape
    (2, 1, 1)
    """
    omega = 2 * math.pi * line.frequencies
    films = _film_impedance(film, omega, change)
    whole = _joined(model, films, line, omega)
    flexibility = np.asarray(np.linalg.inv(whole), dtype=np.complex128)
    right = flexibility[:, :, line.forces]
    left = flexibility[:, line.responses, :]
    value = -(omega[:, None, None] ** 2) * right[:, line.responses]
    return ChangedTransfer(value=value, right=right, left=left)


def _film_impedance(film: BeamFilm, omega: Vector, change: Vector | None) -> Complex:
    """``K + i w C`` of every film (n_lines, n, 4, 4)."""
    stiffness, damping = film.stiffness, film.damping
    if change is not None:
        sizes = film_sizes(film)
        stiffness, damping = (
            own + part_of(change, f"film_{name}").reshape(own.shape) * size
            for own, name, size in (
                (stiffness, "stiffness", sizes[0]),
                (damping, "damping", sizes[1]),
            )
        )
    found: Complex = stiffness + 1j * omega[:, None, None, None] * damping
    return found


def _joined(model: LineModel, films: Complex, line: FreeLine, omega: Vector) -> Complex:
    """Dynamic stiffness of shaft, films and housings (n_lines, m + 2 n, m + 2 n)."""
    m, n = line.stiffness.shape[1], len(model.bearings)
    whole = np.zeros((omega.size, m + 2 * n, m + 2 * n), dtype=np.complex128)
    whole[:, :m, :m] = line.stiffness
    for i in range(n):
        shaft, housing = slice(4 * i, 4 * i + 4), slice(m + 2 * i, m + 2 * i + 2)
        whole[:, shaft, shaft] += films[:, i]
        whole[:, shaft, housing] -= films[:, i, :, :2]
        whole[:, housing, shaft] -= films[:, i, :2, :]
        whole[:, housing, housing] += films[:, i, :2, :2]
    pedestal = model.pedestals + 1j * omega[:, None, None] * model.pedestal_damping
    pedestal = pedestal - omega[:, None, None] ** 2 * model.housing_masses[:, None]
    at = np.arange(m, m + 2 * n)
    whole[:, at, at] += pedestal.reshape(omega.size, -1)
    return whole


def transfer_slopes(
    model: LineModel,
    line: FreeLine,
    found: ChangedTransfer,
    films: tuple[Vector, Vector],
    directions: Vector,
) -> Complex:
    """Derivatives of an accelerance for changes of the line.

    Parameters
    ----------
    model : LineModel
    line : FreeLine
    found : Transfer
        Result of :func:`transfer`.
    films : tuple of numpy.ndarray
        Derivatives of the films' coefficients from :func:`coefficient_slopes` at the test's speed.
    directions : numpy.ndarray [shape=(p, n, 42)]

    Returns
    -------
    numpy.ndarray [shape=(p, n_lines, n_resp, n_force)]
        Derivatives [(m/s^2)/N].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> model = line_model(load_scene("shaft-rig"))
    >>> line = free_line(model, [20.0, 40.0], speed=62.8, forces=[("second", "y")],
    ...                  responses=[("third", "y", "housing")])
    >>> film, ways = rest(model, 62.8), unit_change(4, 2, "pedestal")[None]
    >>> slopes = coefficient_slopes(model, film, ways)
    >>> transfer_slopes(model, line, transfer(model, film, line), slopes, ways).shape
    (1, 2, 1, 1)
    """
    omega = 2 * math.pi * line.frequencies
    m, n = line.stiffness.shape[1], len(model.bearings)
    right, housed = _parted(found.right.swapaxes(1, 2), m, n)
    left, seen = _parted(found.left, m, n)
    # both factors of a product (n_lines, n_resp, n_force, n 4 4), computed once for all directions
    pairs = left[:, :, None, :, :, None] * right[:, None, :, :, None, :]
    pairs = pairs.reshape(*pairs.shape[:3], -1)
    turn = 1j * omega[:, None, None, None]
    stiffness, damping = (slope.reshape(slope.shape[0], -1).T for slope in films)
    change = pairs @ stiffness + turn * (pairs @ damping)
    own = seen[:, :, None, :] * housed[:, None, :, :]
    spring = part_of(directions, "pedestal") * model.pedestals
    damper = part_of(directions, "pedestal_damping") * model.pedestal_damping
    change += own @ spring.reshape(len(directions), -1).T
    change += turn * (own @ damper.reshape(len(directions), -1).T)
    # from the accelerance's -w^2 and dH = -y dZ x
    return np.asarray(np.moveaxis(omega[:, None, None, None] ** 2 * change, -1, 0))


def _parted(motion: Complex, m: int, n: int) -> tuple[Complex, Complex]:
    """Journals relative to their housings (..., n, 4), and the housings (..., 2 n)."""
    journals = motion[..., : 4 * n].reshape(*motion.shape[:-1], n, 4).copy()
    housings = motion[..., m:]
    journals[..., :2] -= housings.reshape(*motion.shape[:-1], n, 2)
    return journals, housings
