"""Oil films of journal bearings: equilibrium, coefficients, whirl threshold, friction and flow.

:func:`operate` computes in SI a bearing at a speed, under a load or at a given eccentricity;
the other functions are non-dimensional, like the charts of the literature.

Examples
--------
>>> from wearstate import film
>>> bearing = film.JournalBearing(diameter=0.1, length=0.05, clearance=1e-4, viscosity=0.02)
>>> point = film.operate(bearing, speed=157.0, load=(0.0, -2000.0))
>>> round(point.eccentricity_ratio, 2), round(point.power_loss)
(0.61, 250)
"""

from .sim.bearing.bearing_status import BearingError
from .sim.bearing.coefficients import Flow, coefficients, flow, friction
from .sim.bearing.equilibrium import Equilibrium, at_eccentricity, equilibrium, sommerfeld_number
from .sim.bearing.operate import JournalBearing, OperatingPoint, operate
from .sim.bearing.short_bearing import (
    short_attitude,
    short_coefficients,
    short_eccentricity,
    short_load,
)
from .sim.bearing.whirl import Threshold, Whirl, stability, whirl
from .sim.film.impedance_map import ImpedanceMap, impedance_map
from .sim.film.mass_conserving import mass_conserving
from .sim.film.rungs import FILM_RUNGS
from .sim.film.slopes import Coefficients
from .sim.film.solve import (
    FilmGeometry,
    FilmSolution,
    FilmState,
    Groove,
    dufrane_scar,
    film_gap,
    mesh_error,
    solve_direct,
    solve_finite,
    solve_long,
    solve_short,
)
from .sim.journal.load import load
from .sim.journal.mass_orbit import MassOrbit, mass_orbit

__all__ = [
    "FILM_RUNGS",
    "BearingError",
    "Coefficients",
    "Equilibrium",
    "FilmGeometry",
    "FilmSolution",
    "FilmState",
    "Flow",
    "Groove",
    "ImpedanceMap",
    "JournalBearing",
    "MassOrbit",
    "OperatingPoint",
    "Threshold",
    "Whirl",
    "at_eccentricity",
    "coefficients",
    "dufrane_scar",
    "equilibrium",
    "film_gap",
    "flow",
    "friction",
    "impedance_map",
    "load",
    "mass_conserving",
    "mass_orbit",
    "mesh_error",
    "operate",
    "short_attitude",
    "short_coefficients",
    "short_eccentricity",
    "short_load",
    "solve_direct",
    "solve_finite",
    "solve_long",
    "solve_short",
    "sommerfeld_number",
    "stability",
    "whirl",
]
