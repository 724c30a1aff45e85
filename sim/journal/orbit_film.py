"""Films identified by an integer code, and their force on the journal."""

import math
from typing import NamedTuple

import numpy as np

from ..film.direct_system import DirectFilm
from ..film.impedance_map import ImpedanceMap
from ..film.map_look_up import MapTable, map_force
from ..film.short import short_force
from ..film.solve import FilmGeometry, direct_film
from ..film.starved import solved_force
from ..jit import kernel

FILM_NONE, FILM_SHORT, FILM_MAP, FILM_DIRECT = range(4)


class OrbitFilm(NamedTuple):
    """Film identified by an integer code; parts that the code does not use are empty."""

    code: int  # FILM_*
    length_to_diameter: float
    last_eccentricity: float
    table: MapTable
    work: DirectFilm


_NO_TABLE = MapTable(np.zeros((3, 1, 4, 4)), 1, 1.0, 0.5, 1.0, 1.0, 1.0)


def _no_work() -> DirectFilm:
    return direct_film(FilmGeometry(length_to_diameter=1.0, n_theta=8, n_z=5))


def no_film() -> OrbitFilm:
    """No film: the effect is absent."""
    return OrbitFilm(FILM_NONE, 1.0, math.inf, _NO_TABLE, _no_work())


def short_film(length_to_diameter: float, *, last_eccentricity: float = 0.9999) -> OrbitFilm:
    """Short-bearing film in closed form (Ocvirk, half film).

    Parameters
    ----------
    length_to_diameter : float
        L / D; the formula overestimates the force of bearings longer than about 1/2.
    last_eccentricity : float
        End of the film, < 1; a run ends there with a status.
    """
    return OrbitFilm(FILM_SHORT, length_to_diameter, last_eccentricity, _NO_TABLE, _no_work())


def map_film(impedance: ImpedanceMap, length_to_diameter: float) -> OrbitFilm:
    """Film from an impedance map of a bearing with that L / D."""
    return OrbitFilm(
        FILM_MAP, length_to_diameter, impedance.last_eccentricity, impedance.table, _no_work()
    )


def solved_film(geometry: FilmGeometry, *, last_eccentricity: float = 0.995) -> OrbitFilm:
    """Film solved at every call, starting from the last call.

    The workspace belongs to this value, so use it in one run at a time.
    """
    return OrbitFilm(
        FILM_DIRECT,
        geometry.length_to_diameter,
        last_eccentricity,
        _NO_TABLE,
        direct_film(geometry),
    )


@kernel
def film_force(
    film: OrbitFilm, x: float, y: float, x_rate: float, y_rate: float
) -> tuple[float, float]:
    """Force of any film.

    Beyond its last eccentricity the journal is moved back to it: this occurs at trial points of an
    integrator, and in contact with a wall.
    """
    square = x * x + y * y
    if square > film.last_eccentricity * film.last_eccentricity:
        back = film.last_eccentricity / math.sqrt(square)
        x, y = x * back, y * back
    f_x = f_y = 0.0
    if film.code == FILM_MAP:
        f_x, f_y = map_force(film.table, x, y, x_rate, y_rate)
    elif film.code == FILM_SHORT:
        f_x, f_y = short_force(film.length_to_diameter, x, y, x_rate, y_rate)
    elif film.code == FILM_DIRECT:
        f_x, f_y = solved_force(film.work, x, y, x_rate, y_rate)
    return f_x, f_y
