"""Static equilibria of a plain journal over the load: a table.

The load is in units of ``eta omega R^3 L / C^2``, lengths are over the radial clearance C, as in
:mod:`.bearing.equilibrium`. A plain bore is rotationally symmetric, so that one curve serves
every direction of the load; the same holds for a scar at a fixed angle from the load. The
tabulated quantities, the logit of the eccentricity ratio over the largest one in the bore and the
attitude angle, over the logarithm of the load, are nearly linear from the lightest load to the
thinnest film.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from ..film.solve import FilmGeometry, dufrane_scar
from .equilibrium import equilibrium

Vector = NDArray[np.float64]

_LEAST_LOAD = 1e-3  # eccentricity ratio 0.001: below it the film is linear
_MOST_ECCENTRICITY = 0.97  # beyond it the usual mesh is too coarse for the thinnest film
_KNOTS_PER_DECADE = 7  # of the load: position within 0.3 % of the clearance, like its mesh


@dataclass(frozen=True, kw_only=True, eq=False)
class RestCurve:
    """Static equilibria of a bearing that are the same for every direction of its load.

    Attributes
    ----------
    most_load : float
        End of the table [-]; linear extrapolation beyond both ends.
    spline : CubicSpline
        Logarithm of the load -> logit of the eccentricity ratio over `farthest`, attitude angle
        [rad].
    farthest : float
        Largest eccentricity ratio in the bore: 1 plus the depth of a scar.
    """

    most_load: float
    spline: CubicSpline
    farthest: float = 1.0

    def position(self, load: ArrayLike) -> Vector:
        """Position of the journal's centre.

        Parameters
        ----------
        load : array_like [shape=(..., 2)]
            Load on the journal, in units of ``eta omega R^3 L / C^2``, not zero.

        Returns
        -------
        numpy.ndarray [shape=(..., 2)]
            Position over the radial clearance.

        Examples
        --------
        >>> curve = rest_curve(FilmGeometry(length_to_diameter=0.6), "short")
        >>> across = curve.position([0.0, 0.5])
        >>> bool(np.allclose(curve.position([0.5, 0.0]), [across[1], -across[0]]))
        True
        """
        load = np.asarray(load, dtype=float)
        place = np.log(np.hypot(load[..., 0], load[..., 1]))
        within = np.clip(place, self.spline.x[0], self.spline.x[-1])
        found = self.spline(within) + self.spline(within, 1) * (place - within)[..., None]
        radius = self.farthest / (1 + np.exp(-found[..., 0]))
        angle = np.arctan2(load[..., 1], load[..., 0]) + found[..., 1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def rest_curve(
    geometry: FilmGeometry, rung: str = "direct", *, scar: float = 0.0, turned: float = 0.0
) -> RestCurve:
    """Curve of a plain bearing, or of one worn under its load, from static equilibria.

    Parameters
    ----------
    geometry : FilmGeometry
        With a round bore and no grooves.
    rung : str
        Rung of :func:`.bearing.equilibrium.equilibrium`; "direct" for a scar.
    scar : float
        Depth of the scar over C, in [0, 1), as in :func:`.film.solve.dufrane_scar`.
    turned : float
        Angle of its middle from the load [rad].

    Returns
    -------
    RestCurve
        Cached for each film.

    Raises
    ------
    ValueError
        The bore is not round or has grooves: the position then depends on the direction of the
        load. Or there is a scar, which the rung does not support.

    Examples
    --------
    >>> from wearstate.sim.bearing.equilibrium import equilibrium
    >>> film = FilmGeometry(length_to_diameter=0.6, n_theta=36, n_z=9)
    >>> apart = rest_curve(film).position([1.7, 0.0]) - equilibrium(film, [1.7, 0.0]).position
    >>> bool(abs(apart).max() < 3e-3)
    True
    """
    if geometry.bore is not None or geometry.grooves:
        raise ValueError(
            "bore and grooves must be absent: a scar or a groove makes the position of the journal "
            "depend on the direction of the load; use wearstate.film.equilibrium for one load"
        )
    if scar and rung != "direct":
        raise ValueError(f"rung = {rung!r} does not support a scar; use 'direct'")
    size = (geometry.length_to_diameter, geometry.n_theta, geometry.n_z)
    return _curve(*size, str(geometry.condition), rung, scar, turned, geometry.inlet_fill)


@lru_cache(maxsize=64)
def _curve(
    length_to_diameter: float,
    n_theta: int,
    n_z: int,
    condition: str,
    rung: str,
    scar: float,
    turned: float,
    inlet_fill: float,
) -> RestCurve:
    film = FilmGeometry(
        length_to_diameter=length_to_diameter,
        n_theta=n_theta,
        n_z=n_z,
        condition=condition,
        bore=dufrane_scar(scar, turned, n_theta) if scar else None,
        inlet_fill=inlet_fill,
    )
    farthest = 1.0 + scar
    loads, places = [], []
    load = _LEAST_LOAD
    while True:
        found = equilibrium(film, [load, 0.0], rung=rung, raise_on_failure=False)
        eccentricity = found.eccentricity_ratio / farthest
        if not found.status.ok or eccentricity > _MOST_ECCENTRICITY:
            break
        loads.append(math.log(load))
        places.append([math.log(eccentricity / (1 - eccentricity)), found.attitude_angle])
        load *= 10 ** (1 / _KNOTS_PER_DECADE)
    spline = CubicSpline(np.array(loads), np.array(places))
    return RestCurve(most_load=math.exp(loads[-1]), spline=spline, farthest=farthest)
