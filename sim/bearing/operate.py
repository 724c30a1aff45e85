"""A bearing at its operating point, in SI units."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..brief import brief
from ..film.slopes import Coefficients
from ..film.solve import FilmGeometry
from .coefficients import coefficients, flow, friction
from .equilibrium import Equilibrium, at_eccentricity, checked_positive, equilibrium
from .whirl import Threshold, Whirl, whirl

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class JournalBearing:
    """A bearing in SI units.

    Attributes
    ----------
    diameter, length : float
        Size of the bearing [m].
    clearance : float
        Radial clearance, bore radius minus journal radius [m].
    viscosity : float
        Dynamic viscosity [Pa s].
    film : FilmGeometry, optional
        Mesh, condition, bore and grooves, with the same L / D; by default a plain bearing.

    Raises
    ------
    ValueError
        A number is not above zero, or the film has another L / D.
    """

    diameter: float
    length: float
    clearance: float
    viscosity: float
    film: FilmGeometry | None = None

    def __post_init__(self) -> None:
        for name, unit in (
            ("diameter", "m"),
            ("length", "m"),
            ("clearance", "m"),
            ("viscosity", "Pa s"),
        ):
            checked_positive(f"bearing.{name}", getattr(self, name), unit)
        ratio = self.length / self.diameter
        if self.film is not None and not math.isclose(
            self.film.length_to_diameter, ratio, rel_tol=1e-9
        ):
            raise ValueError(
                f"film.length_to_diameter = {self.film.length_to_diameter:g} must be "
                f"length / diameter = {ratio:g}; give the film that ratio"
            )

    @property
    def geometry(self) -> FilmGeometry:
        """Geometry of the film."""
        if self.film is not None:
            return self.film
        return FilmGeometry(length_to_diameter=self.length / self.diameter)

    def force_unit(self, speed: float) -> float:
        """``eta omega R^3 L / C^2``, the unit of the non-dimensional force [N]."""
        radius = self.diameter / 2
        return self.viscosity * speed * radius**3 * self.length / self.clearance**2


@dataclass(frozen=True, kw_only=True)
class OperatingPoint:
    """A bearing at a speed and a load, in SI units.

    Attributes
    ----------
    equilibrium : Equilibrium
        Non-dimensional equilibrium.
    load : numpy.ndarray [shape=(2,)]
        Force on the journal [N].
    sommerfeld_number : float
    eccentricity_ratio : float
    attitude_angle : float
        Angle from the load to the journal centre [rad].
    position : numpy.ndarray [shape=(2,)]
        Journal centre [m].
    least_film : float
        Least film thickness [m].
    peak_pressure : float
        Largest film pressure [Pa].
    friction_moment : float
        Friction moment on the journal [N m].
    power_loss : float
        Power loss [W].
    through_flow, side_flow : float
        Flow past the widest gap, and out of both ends [m^3/s].
    stiffness : numpy.ndarray [shape=(2, 2) or (4, 4)]
        For X, Y [N/m], with the tilt also for the slopes of the axis: [N/rad], [N m/m], [N m/rad].
    damping : numpy.ndarray [shape=(2, 2) or (4, 4)]
        The same, units times a second.
    whirl : Whirl
        Mesh errors of the coefficients and of the threshold, and coefficients of the finer meshes.
    threshold : Threshold
        Threshold of a rigid rotor, from `whirl`; `stiffness` and `mass` are over the load.
    critical_mass : float
        Rotor mass per bearing above which it whirls at this speed and load [kg], or may
        whirl if not ``whirl.resolved``; inf only if certainly no mass whirls. Its relative
        error is twice ``whirl.speed_error``.
    """

    equilibrium: Equilibrium
    load: Vector
    sommerfeld_number: float
    eccentricity_ratio: float
    attitude_angle: float
    position: Vector
    least_film: float
    peak_pressure: float
    friction_moment: float
    power_loss: float
    through_flow: float
    side_flow: float
    stiffness: Vector
    damping: Vector
    whirl: Whirl
    threshold: Threshold
    critical_mass: float

    __repr__ = brief(
        "eccentricity_ratio", "attitude_angle", "sommerfeld_number", "least_film", "peak_pressure"
    )


def operate(
    bearing: JournalBearing,
    *,
    speed: float,
    load: ArrayLike | None = None,
    eccentricity_ratio: float | None = None,
    rung: str = "direct",
    slope: tuple[float, float] = (0.0, 0.0),
    tilt_coefficients: bool = False,
) -> OperatingPoint:
    """Operating point of a steadily loaded bearing, in SI units.

    Parameters
    ----------
    bearing : JournalBearing
        Bearing in SI units.
    speed : float
        Journal speed, positive from X to Y [rad/s].
    load : array_like [shape=(2,)], optional
        Force on the journal [N]; this or `eccentricity_ratio`.
    eccentricity_ratio : float, optional
        Eccentricity of the journal on the X axis, without slope; the load follows.
    rung : str
        Rung of the film.
    slope : tuple of float
        Slope of the journal's axis in the bearing, in the planes XZ and YZ [rad].
    tilt_coefficients : bool
        Whether to add moments and slopes to stiffness and damping.

    Returns
    -------
    OperatingPoint
        In SI units.

    Raises
    ------
    BearingError
        No film can carry the load, or no equilibrium was found.
    ValueError
        The speed is not above zero, the load is zero, or not exactly one of load and eccentricity
        is given.

    Notes
    -----
    Isothermal and laminar. A groove's pressure is part of the film and non-dimensional, in units
    of ``eta omega (R / C)^2``.

    Examples
    --------
    >>> bearing = JournalBearing(diameter=0.1, length=0.1, clearance=50e-6, viscosity=0.1)
    >>> point = operate(bearing, speed=2 * math.pi * 20, load=[100e3, 0.0])
    >>> round(point.sommerfeld_number, 3), round(point.eccentricity_ratio, 2)
    (0.2, 0.47)
    >>> held = operate(bearing, speed=2 * math.pi * 20, eccentricity_ratio=0.47)
    >>> bool(abs(np.hypot(*held.load) / 100e3 - 1) < 0.02)
    True
    """
    checked_positive("speed", speed, "rad/s")
    unit = bearing.force_unit(speed)
    c, length = bearing.clearance, bearing.length
    if (load is None) == (eccentricity_ratio is None):
        raise ValueError("load and eccentricity_ratio: one of them must be given, not both")
    if eccentricity_ratio is not None:
        if slope != (0.0, 0.0):
            raise ValueError(f"slope = {slope} rad must be 0 with eccentricity_ratio; give a load")
        found = at_eccentricity(bearing.geometry, eccentricity_ratio, rung=rung)
    else:
        found = equilibrium(
            bearing.geometry,
            np.asarray(load, dtype=float) / unit,
            rung=rung,
            tilt=(slope[0] * length / c, slope[1] * length / c),
        )
    method = "analytic" if rung == "direct" else "displacement"
    film = coefficients(found, method=method, tilt=tilt_coefficients)
    limit = whirl(found)
    newton = float(np.hypot(*found.load)) * unit
    moment = friction(found) * unit * c  # eta omega R^2 L / C times R
    oil = flow(found)
    flow_unit = bearing.diameter / 2 * c * speed / (2 * math.pi) * length
    film = _in_metres(film, length)
    return OperatingPoint(
        equilibrium=found,
        load=found.load * unit,
        sommerfeld_number=found.sommerfeld_number,
        eccentricity_ratio=found.eccentricity_ratio,
        attitude_angle=found.attitude_angle,
        position=c * found.position,
        least_film=c * found.film.min_thickness,
        peak_pressure=float(found.film.pressure.max()) * unit / (bearing.diameter / 2 * length),
        friction_moment=moment,
        power_loss=moment * speed,
        through_flow=oil.through * flow_unit,
        side_flow=oil.side * flow_unit,
        stiffness=film.stiffness * unit / c,
        damping=film.damping * unit / (c * speed),
        whirl=limit,
        threshold=limit.threshold,
        critical_mass=limit.threshold.mass * newton / (c * speed**2),
    )


def _in_metres(c: Coefficients, length: float) -> Coefficients:
    """Coefficients for slopes and moments instead of tilts and moments over the length."""
    scale = np.ones(c.stiffness.shape[0])
    scale[2:] = length
    both = np.outer(scale, scale)
    return Coefficients(c.stiffness * both, c.damping * both)
