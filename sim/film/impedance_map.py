"""Impedance map of a film: its force for any position and velocity, interpolated.

With ``V = (X' + Y/2, Y' - X/2)`` the right-hand side of Reynolds' equation for a round bore is
``-12 (V_x cos + V_y sin)``. If no oil is fed under pressure and the film ruptures at
the pressure of the ends, every cavitation condition is homogeneous: the pressure of
``a V`` is ``a`` times that of V, a >= 0. The force is then ``|V|`` times a function of eccentricity
and the angle between V and the line of centres, and, with grooves, of the attitude of that line. A
worn bore drags oil into its own wedge whatever V is: its force is not homogeneous, and it has no
such map.

Towards the wall that function has a boundary layer: a velocity along the wall has the same effect
as a velocity towards it that is smaller by the root of the gap. Lubrication theory of a parabolic
gap ``g (1 + theta^2 / 2 g)``, ``g = 1 - eccentricity``, gives the scales. The axes of the table are
``sqrt(g)`` and the angle of ``(V_r, sqrt(1 - eps^2) V_t)``, and its entries

    F_r / (G |V|), F_t / (G |V| sqrt(1 - eps^2)), P_max sqrt(1 - eps^2) / (G |V|)

with that scaled V and ``G = 3 sqrt(2) pi g^(-3/2) / (1 + 2 g (D/L)^2)``, the squeeze force of a
long film near the wall, joined to that of a short one (half as large times (L/D)^2 / g). All three
stay bounded and smooth up to contact. Interpolation is by cubic B-splines (C2).

Sources: Childs, Moes, van Leeuwen (1977), J. Lubrication Technology 99(2), 198-210,
doi:10.1115/1.3453019, for the reduction; the scaling is derived here.
"""

import hashlib
import io
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..atomic import sealed, unsealed, write_whole
from ..brief import brief
from ..jit import cache_folder, kernel
from .direct import DIRECT_OK, direct_force
from .direct_system import STATUS, DirectFilm
from .map_look_up import TANGENTIAL, MapTable, map_force, map_scales
from .solve import FilmGeometry, direct_film

LAST_ECCENTRICITY = 0.995
"""Default end of maps: beyond, five degrees of arc are wider than the narrow gap."""

_SAMPLES = 1000  # random states to estimate a map's error
_LEVELS = 3  # numbers of knots tried for a plain bore, each twice as fine
_PLAIN_KNOTS = (33, 49)  # over sqrt(g), over half a turn of V
_GROOVED_KNOTS = (17, 32)  # over sqrt(g), over a whole turn of V; doubling them gains only a third
_ATTITUDES = 36  # knots over the attitude with grooves, at mesh nodes if the numbers divide


@dataclass(frozen=True, kw_only=True)
class MapError:
    """Error of the map's force against direct solves on the same mesh, over the direct force.

    Attributes
    ----------
    median, most, worst : float
        Median, 95th percentile and maximum over random states, evenly spread in
        ``sqrt(1 - eccentricity)`` and in the scaled angle of V.
    """

    median: float
    most: float
    worst: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpedanceMap:
    """Film of one geometry as a table.

    Attributes
    ----------
    table : MapTable
        For :func:`map_force` and :func:`map_peak`.
    last_eccentricity : float
        End of the table. Beyond it the kernels return the force at the end: callers must check.
    accuracy : float
        Requested accuracy.
    interpolation : MapError
        Interpolation error: with the line of centres on a node of the mesh, where the table is
        exact at its knots.
    turned : MapError
        With the line of centres anywhere: adds the effect of the mesh as the journal turns.
    """

    table: MapTable
    last_eccentricity: float
    accuracy: float
    interpolation: MapError
    turned: MapError

    __repr__ = brief("knots", "last_eccentricity", "accuracy")

    @property
    def accurate(self) -> bool:
        """Whether 95 % of the states interpolate within the requested accuracy."""
        return self.interpolation.most <= self.accuracy

    @property
    def knots(self) -> tuple[int, ...]:
        """Number of table entries along the attitude, the root of the gap, and the angle of V."""
        return self.table.coefficients.shape[1:]

    def force(
        self, x: float, y: float, x_rate: float = 0.0, y_rate: float = 0.0
    ) -> tuple[float, float]:
        """Force on the journal, see :func:`map_force`; raises beyond the table.

        Raises
        ------
        ValueError
            The eccentricity is larger than `last_eccentricity`.
        """
        if not math.hypot(x, y) <= self.last_eccentricity:
            raise ValueError(
                f"eccentricity = {math.hypot(x, y):.6g} must be <= {self.last_eccentricity:g}, the "
                "last of this map; build the map with a larger last_eccentricity and a finer mesh"
            )
        fx, fy = map_force(self.table, x, y, x_rate, y_rate)
        return fx, fy


# --- building


@kernel
def _solve_line(
    work: DirectFilm, x: float, y: float, n_x: float, n_y: float, velocity: Any, values: Any
) -> int:
    """F_r, F_t, P_max for velocities V (along, across the line of centres); return the failures."""
    failures = 0
    n, k = work.pressure.shape
    for j in range(velocity.shape[0]):
        along, across = velocity[j, 0], velocity[j, 1]
        v_x, v_y = along * n_x - across * n_y, along * n_y + across * n_x
        f_x, f_y = direct_force(work, x, y, v_x - 0.5 * y, v_y + 0.5 * x)
        failures += work.outcome[STATUS] != DIRECT_OK
        peak = 0.0
        for p in range(n):
            for q in range(k):
                peak = max(peak, work.pressure[p, q])
        values[j, 0] = f_x * n_x + f_y * n_y
        values[j, 1] = f_y * n_x - f_x * n_y
        values[j, 2] = peak
    return failures


def _scaled_solves(
    work: DirectFilm,
    table: MapTable,
    eccentricity: float,
    attitude: float,
    angles: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Table values at one position of the journal for scaled angles of V, (n, 3)."""
    n_x, n_y = math.cos(attitude), math.sin(attitude)
    _, stretch, scale = map_scales(table, eccentricity)
    velocity = np.column_stack([np.cos(angles), np.sin(angles) / stretch])
    values = np.empty((len(angles), 3))
    failures = _solve_line(work, eccentricity * n_x, eccentricity * n_y, n_x, n_y, velocity, values)
    if failures:
        raise ValueError(
            f"eccentricity = {eccentricity:.6g} at {math.degrees(attitude):.4g} deg must leave a "
            "gap that the direct solver can carry; lower last_eccentricity, or check the bore"
        )
    return values / (scale * np.array([1.0, stretch, 1.0 / stretch]))


def _spline_coefficients(values: NDArray[np.float64], axis: int, ends: str) -> NDArray[np.float64]:
    """Cubic B-splines through values at even knots along an axis.

    `ends`: ``"free"`` (not a knot), ``"even"`` or ``"odd"`` about both ends, each with one
    coefficient beyond each end; ``"periodic"`` with one before and two behind.
    """
    data = np.moveaxis(values, axis, 0)
    n = len(data)
    rows = np.arange(n)
    if ends == "periodic":
        matrix = np.zeros((n, n))
        for shift, weight in ((-1, 1 / 6), (0, 2 / 3), (1, 1 / 6)):
            np.add.at(matrix, (rows, (rows + shift) % n), weight)
        flat: Any = np.linalg.solve(matrix, data.reshape(n, -1))[np.arange(-1, n + 2) % n]
        return np.moveaxis(flat.reshape(n + 3, *data.shape[1:]), 0, axis)
    matrix = np.zeros((n + 2, n + 2))
    for shift, weight in ((0, 1 / 6), (1, 2 / 3), (2, 1 / 6)):
        matrix[rows + 1, rows + shift] = weight
    edge = {"free": (1, -4, 6, -4, 1), "even": (1, 0, -1), "odd": (1, 0, 1)}[ends]
    matrix[0, : len(edge)] = edge
    matrix[-1, -len(edge) :] = edge
    right = np.zeros((n + 2, data[0].size))
    right[1:-1] = data.reshape(n, -1)
    flat = np.linalg.solve(matrix, right)
    return np.moveaxis(flat.reshape(n + 2, *data.shape[1:]), 0, axis)


def _blank_table(
    geometry: FilmGeometry, knots: tuple[int, int, int], last_eccentricity: float
) -> MapTable:
    """Create a table's scales with knots over attitude, root and angle, without coefficients."""
    attitudes, roots, angles = knots
    plain = attitudes == 1
    root = math.sqrt(1 - last_eccentricity)
    return MapTable(
        coefficients=np.zeros((3, 1, 4, 4)),
        mirrored=int(plain),
        gap_factor=2 / geometry.length_to_diameter**2,
        least_root=root,
        per_root=(roots - 1) / (1 - root),
        per_radian=(angles - 1) / math.pi if plain else angles / (2 * math.pi),
        per_attitude=attitudes / (2 * math.pi),
    )


def _build_table(
    geometry: FilmGeometry, knots: tuple[int, int, int], last_eccentricity: float
) -> MapTable:
    """Solve directly at all knots, warm along the angle of V, and fit the splines."""
    attitudes, roots, angles = knots
    table = _blank_table(geometry, knots, last_eccentricity)
    work = direct_film(geometry)
    values = np.empty((3, attitudes, roots, angles))
    turn = np.arange(angles) / table.per_radian
    for k in range(attitudes):
        for i in range(roots):
            root = 1 - i / table.per_root
            solved = _scaled_solves(work, table, 1 - root**2, k / table.per_attitude, turn)
            values[:, k, i] = solved.T
    if table.mirrored:
        parts = [
            _spline_coefficients(values[what], 2, "odd" if what == TANGENTIAL else "even")
            for what in range(3)
        ]
    else:
        around = _spline_coefficients(values, 1, "periodic")
        parts = list(_spline_coefficients(around, 3, "periodic"))
    coefficients = _spline_coefficients(np.array(parts), 2, "free")
    return table._replace(coefficients=np.ascontiguousarray(coefficients))


def _measure(geometry: FilmGeometry, table: MapTable, *, turned: bool) -> MapError:
    """Error of the force at random states against direct solves on the map's own mesh."""
    random = np.random.default_rng(0)
    work = direct_film(geometry)
    roots = random.uniform(table.least_root, 1, _SAMPLES)
    angles = random.uniform(0, 2 * math.pi, _SAMPLES)
    attitudes = random.uniform(0, 2 * math.pi, _SAMPLES)
    if not turned:
        step = 2 * math.pi / geometry.n_theta
        attitudes = np.zeros(_SAMPLES) if table.mirrored else np.floor(attitudes / step) * step
    errors = np.empty(_SAMPLES)
    for n in range(_SAMPLES):
        eccentricity = 1 - roots[n] ** 2
        _, stretch, scale = map_scales(table, eccentricity)
        here = _scaled_solves(work, table, eccentricity, attitudes[n], angles[n : n + 1])[0]
        n_x, n_y = math.cos(attitudes[n]), math.sin(attitudes[n])
        along, across = math.cos(angles[n]), math.sin(angles[n]) / stretch
        x, y = eccentricity * n_x, eccentricity * n_y
        v_x, v_y = along * n_x - across * n_y, along * n_y + across * n_x
        f_x, f_y = map_force(table, x, y, v_x - 0.5 * y, v_y + 0.5 * x)
        radial, tangential = scale * here[0], scale * stretch * here[1]
        true_x, true_y = radial * n_x - tangential * n_y, radial * n_y + tangential * n_x
        errors[n] = math.hypot(f_x - true_x, f_y - true_y) / math.hypot(true_x, true_y)
    median, most, worst = np.quantile(errors, [0.5, 0.95, 1.0])
    return MapError(median=float(median), most=float(most), worst=float(worst))


def _refined(
    geometry: FilmGeometry, last_eccentricity: float, accuracy: float
) -> tuple[MapTable, MapError]:
    """Return the coarsest table that is accurate, else the finest tried."""
    if geometry.grooves:
        table = _build_table(geometry, (_ATTITUDES, *_GROOVED_KNOTS), last_eccentricity)
        return table, _measure(geometry, table, turned=False)
    for level in range(_LEVELS):
        roots, angles = ((n - 1) * 2**level + 1 for n in _PLAIN_KNOTS)
        table = _build_table(geometry, (1, roots, angles), last_eccentricity)
        error = _measure(geometry, table, turned=False)
        if error.most <= accuracy:
            break
    return table, error


def impedance_map(
    geometry: FilmGeometry,
    *,
    last_eccentricity: float = LAST_ECCENTRICITY,
    accuracy: float = 5e-3,
    cached: bool = True,
) -> ImpedanceMap:
    """Map of a film, from the cache or built from direct solves.

    Parameters
    ----------
    geometry : FilmGeometry
        A round bore gives a map over two variables; grooves at the pressure of the ends add a
        third.
    last_eccentricity : float
        End of the table, in (0, 1).
    accuracy : float
        Error of the force for 95 % of the states; the knots of a plain bore are doubled
        up to twice to reach it. See :attr:`ImpedanceMap.accurate`.
    cached : bool
        Read and write the map in the cache folder of the kernels, under a hash of the arguments
        and of all sources of ``sim``.

    Returns
    -------
    ImpedanceMap
        Includes its measured errors.

    Raises
    ------
    ValueError
        A groove is fed under pressure, the bore is not round, an argument is out of range, or
        the journal touches the bore within `last_eccentricity`.

    Notes
    -----
    A worn bore would add ``1 / |V|`` as a parameter, and so would feed pressure; tilt would add two
    angles and two rates. Such maps cost more solves than the orbits that would use them. A film
    that conserves oil has a memory and no map.

    Examples
    --------
    >>> film = FilmGeometry(length_to_diameter=0.5, n_theta=36, n_z=9)
    >>> plain = impedance_map(film, last_eccentricity=0.9, cached=False)
    >>> f_x, f_y = plain.force(0.6, 0.0)
    >>> round(math.degrees(math.atan2(f_y, -f_x)))  # attitude angle
    48
    """
    _check(geometry, last_eccentricity, accuracy)
    path = _cache_path(geometry, last_eccentricity, accuracy) if cached else None
    found = _read(path) if path is not None else None
    if found is None:
        table, interpolation = _refined(geometry, last_eccentricity, accuracy)
        found = ImpedanceMap(
            table=table,
            last_eccentricity=last_eccentricity,
            accuracy=accuracy,
            interpolation=interpolation,
            turned=_measure(geometry, table, turned=True),
        )
        if path is not None:
            _write(path, found)
    return found


def _check(geometry: FilmGeometry, last_eccentricity: float, accuracy: float) -> None:
    wrong = [
        f"grooves[{n}].pressure = {groove.pressure:g} must be 0 for a map, because the force is "
        "not proportional to the velocity; use the direct film"
        for n, groove in enumerate(geometry.grooves)
        if groove.pressure != 0
    ]
    if geometry.bore is not None and np.ptp(geometry.bore) > 0:
        wrong.append(
            f"bore spans {np.ptp(geometry.bore):g} of the clearance and must be round for a map: "
            "the wedge of a worn bore drags oil at any velocity; use the direct film"
        )
    if geometry.inlet_fill < 1:
        wrong.append(
            f"inlet_fill = {geometry.inlet_fill:g} must be 1 for a map, because the front of a "
            "starved film depends on the velocity; use the direct film"
        )
    if not 0 < last_eccentricity < 1:
        wrong.append(
            f"last_eccentricity = {last_eccentricity:g} must be in (0, 1); the force is unbounded "
            "at 1"
        )
    if not accuracy > 0:
        wrong.append(f"accuracy = {accuracy:g} must be > 0; try 5e-3")
    if wrong:
        raise ValueError("\n".join(wrong))


# --- cache


def _cache_path(geometry: FilmGeometry, last_eccentricity: float, accuracy: float) -> Path | None:
    folder = cache_folder()  # its name is the hash of the sources
    if folder is None:
        return None
    digest = hashlib.sha256()
    numbers = (geometry.length_to_diameter, last_eccentricity, accuracy)
    grooves = [(g.angle, g.width, g.length_share) for g in geometry.grooves]
    text = (geometry.n_theta, geometry.n_z, geometry.condition, numbers, grooves)
    digest.update(repr(text).encode())
    if geometry.bore is not None:
        digest.update(np.asarray(geometry.bore, dtype="<f8").tobytes())
    return folder / f"map-{digest.hexdigest()[:24]}.npz"


def _write(path: Path, found: ImpedanceMap) -> None:
    """Write the file whole or not at all; failing to write the cache is no error."""
    table = found.table._asdict()
    coefficients = table.pop("coefficients")
    content = io.BytesIO()
    np.savez(
        content,
        coefficients=coefficients,
        scales=np.array(list(table.values()), dtype=np.float64),
        ends=np.array([found.last_eccentricity, found.accuracy]),
        errors=np.array([_numbers(found.interpolation), _numbers(found.turned)]),
    )
    try:
        write_whole(path, sealed(content.getvalue()), force=True)
    except OSError:
        return


def _numbers(error: MapError) -> tuple[float, float, float]:
    return error.median, error.most, error.worst


def _read(path: Path) -> ImpedanceMap | None:
    """Read a map; None if there is no such file or its content is damaged."""
    try:
        content = unsealed(path.read_bytes())
    except OSError:
        return None
    if content is None:
        return None
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        parts = {name: stored[name] for name in stored.files}
    mirrored, *scales = (float(value) for value in parts["scales"])
    interpolation, turned = (
        MapError(median=float(a), most=float(b), worst=float(c)) for a, b, c in parts["errors"]
    )
    last, accuracy = (float(value) for value in parts["ends"])
    return ImpedanceMap(
        table=MapTable(np.ascontiguousarray(parts["coefficients"]), int(mirrored), *scales),
        last_eccentricity=last,
        accuracy=accuracy,
        interpolation=interpolation,
        turned=turned,
    )
