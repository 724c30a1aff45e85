"""Start of the search for the equilibrium."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..bearing.short_bearing import short_attitude, short_eccentricity
from ..film.solve import FilmGeometry
from .film_bearing import FilmBearing
from .laws import FilmLaw, least_gap
from .line import CondensedLine

Vector = NDArray[np.float64]

_MOST_START = 0.9  # largest eccentricity of a start
_START_TILT = 0.5  # of the remaining gap


def first_places(line: CondensedLine, laws: Sequence[FilmLaw]) -> Vector:
    """Positions where short films carry the reactions without films, with limited tilt."""
    reactions, slopes = _pinned(line)
    places = np.zeros((len(laws), 4))
    for n, (law, bearing) in enumerate(zip(laws, line.bearings, strict=True)):
        own = bearing.worn
        load = reactions[n] / own.force_unit(line.speed)
        places[n, :2] = _first_place(law.geometry, bearing, load)
        tilt = -slopes[n] * own.length / own.clearance
        most = 2 * _START_TILT * least_gap(law.geometry, False, places[n])
        places[n, 2:] = tilt * min(1.0, most / max(float(np.hypot(*tilt)), 1e-12))
    return places


def _first_place(geometry: FilmGeometry, bearing: FilmBearing, load: Vector) -> Vector:
    """Position in a short bearing: in the circle of the worn arc, if the bore has room for it."""
    ratio = geometry.length_to_diameter
    if bearing.wear_down > 0 and (own := bearing.arc_clearance) is not None:
        lower = bearing.wear_down / bearing.bearing.clearance + 1 - own
        place = np.array([lower, 0.0]) + own * short_place(ratio, load * own**2)
        if least_gap(geometry, False, np.pad(place, (0, 2))) > 0:
            return np.asarray(place)
    return short_place(ratio, load)


def short_place(length_to_diameter: float, load: Vector) -> Vector:
    """Position in a short bearing, with its force reduced for the finite length."""
    size = float(np.hypot(*load))
    if size == 0:
        return np.zeros(2)
    e = min(short_eccentricity(size * (length_to_diameter**-2 + 0.5)), _MOST_START)
    angle = math.atan2(load[1], load[0]) + short_attitude(e)
    return e * np.array([math.cos(angle), math.sin(angle)])


def _pinned(line: CondensedLine) -> tuple[Vector, Vector]:
    """Reactions and slopes relative to the bores for a beam pinned at their bottoms (b, 2)."""
    count = len(line.bearings)
    places = np.arange(4 * count).reshape(-1, 4)
    held, free = places[:, :2].ravel(), places[:, 2:].ravel()
    down = np.array([[-b.bottom, 0.0] for b in line.bearings]).ravel()
    right = line.pull[free] - line.stiffness[np.ix_(free, held)] @ down
    slopes = np.linalg.lstsq(line.stiffness[np.ix_(free, free)], right)[0]
    reactions = line.stiffness[np.ix_(held, held)] @ down
    reactions += line.stiffness[np.ix_(held, free)] @ slopes - line.pull[held]
    return reactions.reshape(-1, 2), slopes.reshape(-1, 2)
