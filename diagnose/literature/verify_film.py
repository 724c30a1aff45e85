"""Literature checks of oil films: pressures, forces, and a film that conserves its mass."""

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ...sim.bearing.coefficients import flow, friction
from ...sim.bearing.equilibrium import equilibrium, sommerfeld_number
from ...sim.film.mass_conserving import mass_conserving, oil_in_gap, oil_volume
from ...sim.film.solve import (
    FilmGeometry,
    FilmSolution,
    FilmState,
    Groove,
    dufrane_scar,
    solve_direct,
    solve_long,
)


@cache
def _cavitated() -> dict[str, float]:
    """The stored mass-conserving field, in SI; 25 nodes over the length, so the groove ends on one.

    The force is that on the shell.
    """
    radius, length, clearance = 0.05, 0.08, 150e-6
    scale = 0.01 * 2 * math.pi * 50 * (radius / clearance) ** 2
    groove = Groove(
        angle=math.pi / 2, width=math.radians(15), length_share=0.75, pressure=70e3 / scale
    )
    geometry = FilmGeometry(length_to_diameter=0.8, n_theta=100, n_z=25, grooves=(groove,))
    state = FilmState(x=0.5, y=0.0)
    film = mass_conserving(geometry, state)
    fill = np.zeros_like(film.pressure) if film.fill is None else film.fill
    right, up = -film.force * (scale * radius * length)
    volume = radius * length * clearance * oil_volume(oil_in_gap(geometry, state, fill))
    values = {
        "highest pressure [Pa]": scale * film.pressure.max(),
        "force on the shell [N]": math.hypot(right, up),
        "horizontal force on the shell [N]": right,
        "vertical force on the shell [N]": up,
        "oil volume [m^3]": volume,
    }
    for angle in _CAVITATED_AT:
        node = round(angle / 3.6)
        values[f"mid pressure at {angle} degrees [Pa]"] = scale * film.pressure[node, 12]
        values[f"mid film fraction at {angle} degrees"] = fill[node, 12]
    return values


def _cavitated_value(name: str) -> float:
    return float(_cavitated()[name])


_CAVITATED_AT = (0, 18, 36, 90, 108, 126, 162, 180, 198, 216, 270, 288, 324, 342)
"""Angles of the stored field from the journal's eccentricity [degrees], nodes of its mesh."""

_FILLED_AT = (36, 126, 162, 180)
"""Those in the ruptured film."""


_FILM_LINES, _FILM_NODES = 144, 33  # mesh error of the force below 0.3 %
_LONG_LINES = 360
_FINITE = {
    "Sommerfeld number": "number",
    "attitude [deg]": "attitude",
    "friction variable": "friction",
    "flow variable": "flow",
    "mean over peak pressure": "share",
}
_CARRIED = {
    "Sommerfeld number": "number",
    "attitude [deg]": "attitude",
    "peak pressure": "peak",
    "moment over load": "moment",
}
_ECCENTRICITIES = (0.1, 0.2, 0.4, 0.6, 0.8, 0.9)
_SCARS = ((1.0, 0.5, 0.4), (1.0, 0.7, 0.3), (0.5, 0.5, 0.4))  # L/D, eccentricity, deepest
_TILTS = (0.0, 0.2, 0.4)  # of the gap at an end, over C


def _film_geometry(
    length_to_diameter: float,
    *,
    condition: str = "periodic",
    bore: NDArray[np.float64] | None = None,
) -> FilmGeometry:
    return FilmGeometry(
        length_to_diameter=length_to_diameter,
        n_theta=_FILM_LINES,
        n_z=_FILM_NODES,
        condition=condition,
        bore=bore,
    )


def _carried(film: FilmSolution, direction: float) -> dict[str, float]:
    """Load quantities of a film whose journal centre lies in the given direction [rad]."""
    force = math.hypot(*film.force)
    attitude = direction - math.atan2(-film.force[1], -film.force[0])
    peak = float(film.pressure.max())
    return {
        "number": sommerfeld_number(force),
        "attitude": math.degrees(math.remainder(attitude, 2 * math.pi)),
        "peak": peak,
        "share": 0.5 * force / peak,  # the load is on L D, the force on L R
        "moment": 2 * math.hypot(*film.moment) / force,  # of the half length
    }


@cache
def _finite_bearing(length_to_diameter: float, eccentricity: float) -> dict[str, float]:
    geometry = _film_geometry(length_to_diameter, condition="reynolds")
    film = solve_direct(geometry, FilmState(x=eccentricity, y=0.0))
    found = equilibrium(geometry, -film.force, start=(eccentricity, 0.0))
    rubbed = friction(found) / math.hypot(*film.force)
    return {**_carried(film, 0.0), "friction": rubbed, "flow": flow(found).through}


@cache
def _infinite_bearing(eccentricity: float) -> dict[str, float]:
    """Friction and flow by hand: the bearing's own functions are of a film on a mesh."""
    geometry = FilmGeometry(length_to_diameter=1.0, n_theta=_LONG_LINES, condition="reynolds")
    film = solve_long(geometry, FilmState(x=eccentricity, y=0.0))
    step = 2 * math.pi / _LONG_LINES
    pressure, angle = film.pressure[:, 0], step * np.arange(_LONG_LINES)
    shear = 2 * math.pi / math.sqrt(1 - eccentricity**2)
    shear -= 0.5 * step * float(np.sum(pressure * eccentricity * np.sin(angle)))
    widest = _LONG_LINES // 2
    gap = 1 - eccentricity * math.cos(angle[widest] + 0.5 * step)
    rise = float(pressure[widest + 1] - pressure[widest]) / step
    return {
        **_carried(film, 0.0),
        "friction": shear / math.hypot(*film.force),
        "flow": 2 * math.pi * (gap / 2 - gap**3 * rise / 12),
    }


@cache
def _worn_bearing(length_to_diameter: float, eccentricity: float, depth: float) -> dict[str, float]:
    """Film with the scar in the direction of the load, found by iteration."""
    geometry = _film_geometry(length_to_diameter, bore=dufrane_scar(depth, 0.0, _FILM_LINES))

    def at(direction: float) -> dict[str, float]:
        x, y = eccentricity * math.cos(direction), eccentricity * math.sin(direction)
        return _carried(solve_direct(geometry, FilmState(x=x, y=y)), direction)

    def beside(direction: float) -> float:
        return math.radians(at(direction)["attitude"]) - direction

    return at(float(brentq(beside, 0.1, 1.5, xtol=1e-5)))


@cache
def _tilted_journal(tilt: float) -> dict[str, float]:
    """Ends at 1 + (0.5 +- tilt) cos(theta): twice that tilt over the length."""
    geometry = _film_geometry(1.0)
    film = solve_direct(geometry, FilmState(x=-0.5, y=0.0, tilt_x=-2 * tilt))
    return _carried(film, math.pi)


def _film_value(case: Callable[..., dict[str, float]], quantity: str, *args: float) -> float:
    return case(*args)[quantity]


def film_checks() -> dict[str, Callable[[], float]]:
    """Checks of films without mass balance: plain, worn and tilted bores."""
    table: dict[str, Callable[[], float]] = {}
    for quantity, key in _FINITE.items():
        for e in _ECCENTRICITIES:
            for ratio in (1.0, 0.5):
                name = f"Raimondi-Boyd: L/D {ratio:g}, eccentricity {e:g}, {quantity}"
                table[name] = partial(_film_value, _finite_bearing, key, ratio, e)
            name = f"infinite bearing: eccentricity {e:g}, {quantity}"
            table[name] = partial(_film_value, _infinite_bearing, key, e)
    for quantity, key in _CARRIED.items():
        for tilt in _TILTS:
            if tilt > 0 or key != "moment":
                name = f"tilted journal: L/D 1, eccentricity 0.5, tilt {tilt:g}, {quantity}"
                table[name] = partial(_film_value, _tilted_journal, key, tilt)
        for ratio, e, deepest in _SCARS if key != "moment" else ():
            for depth in (step / 10 for step in range(round(10 * deepest) + 1)):
                where = f"L/D {ratio:g}, eccentricity {e:g}, wear {depth:g}"
                name = f"worn bearing: {where}, {quantity}"
                table[name] = partial(_film_value, _worn_bearing, key, ratio, e, depth)
    return table


def cavitation_checks() -> dict[str, Callable[[], float]]:
    """Checks of a film that conserves its mass."""
    return {
        f"mass-conserving film: {name}": partial(_cavitated_value, name)
        for name in (
            "highest pressure [Pa]",
            "force on the shell [N]",
            "horizontal force on the shell [N]",
            "vertical force on the shell [N]",
            "oil volume [m^3]",
            *(f"mid pressure at {a} degrees [Pa]" for a in _CAVITATED_AT if a not in _FILLED_AT),
            *(f"mid film fraction at {a} degrees" for a in _FILLED_AT),
        )
    }
