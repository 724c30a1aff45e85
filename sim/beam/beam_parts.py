"""Components of a beam: sections, discs, loads, and the elements between its nodes."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Section:
    """A piece of the shaft of one material and one cross-section.

    Attributes
    ----------
    length : float
        Length [m].
    outer_diameter, inner_diameter : float
        Diameters [m]; 0 <= inner < outer.
    young, shear_modulus : float
        Elastic moduli [Pa].
    density : float
        Density [kg/m^3].

    Examples
    --------
    >>> section = Section(length=1.0, outer_diameter=0.2, young=2.11e11, shear_modulus=8.12e10,
    ...                   density=7810.0)
    >>> round(section.bending_stiffness / 1e6, 3)  # MN m^2
    16.572
    """

    length: float
    outer_diameter: float
    inner_diameter: float = 0.0
    young: float
    shear_modulus: float
    density: float

    @property
    def area(self) -> float:
        """Area of the cross-section [m^2]."""
        return math.pi / 4 * (self.outer_diameter**2 - self.inner_diameter**2)

    @property
    def second_moment(self) -> float:
        """Second moment of the cross-section about a diameter [m^4]."""
        return math.pi / 64 * (self.outer_diameter**4 - self.inner_diameter**4)

    @property
    def bending_stiffness(self) -> float:
        """Bending stiffness E I [N m^2]."""
        return self.young * self.second_moment

    @property
    def poisson(self) -> float:
        """Poisson's ratio E / 2 G - 1."""
        return self.young / (2 * self.shear_modulus) - 1


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A rigid body on the shaft: propeller, coupling, wheel.

    Attributes
    ----------
    station : float
        Position [m].
    mass : float
        Mass [kg].
    polar_inertia, diametral_inertia : float
        About the shaft's axis and about a diameter through the station [kg m^2].
    entrained_mass : float
        Mass of the water that moves with it [kg]: inertia without weight.
    entrained_polar, entrained_diametral : float
        The same for rotation [kg m^2]. The water is assumed not to spin with the body, so it has
        no gyroscopic moment, and `entrained_polar` is not used in bending: it is kept here with
        the propeller's other data.
    buoyancy : float
        Upward force [N]; it reduces the weight.
    """

    station: float
    mass: float
    polar_inertia: float = 0.0
    diametral_inertia: float = 0.0
    entrained_mass: float = 0.0
    entrained_polar: float = 0.0
    entrained_diametral: float = 0.0
    buoyancy: float = 0.0


@dataclass(frozen=True, kw_only=True)
class PointLoad:
    """Steady force and moment at a station.

    Attributes
    ----------
    station : float
        Position [m].
    up, side : float
        Force along y and z [N].
    moment_up, moment_side : float
        Moment that increases slope_y and slope_z [N m].
    """

    station: float
    up: float = 0.0
    side: float = 0.0
    moment_up: float = 0.0
    moment_side: float = 0.0


@dataclass(frozen=True, kw_only=True)
class DistributedLoad:
    """Steady force spread evenly over part of the shaft.

    Attributes
    ----------
    start, end : float
        Stations [m], start < end.
    up, side : float
        Force per length along y and z [N/m].
    """

    start: float
    end: float
    up: float = 0.0
    side: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Elements:
    """Elements between neighbouring stations; the fields are [shape=(n - 1,)].

    Attributes
    ----------
    length : numpy.ndarray
        Length [m].
    bending, mass, rotary : numpy.ndarray
        E I [N m^2], rho A [kg/m], rho I [kg m]; the last is zero if the theory has none.
    shear_ratio : numpy.ndarray
        ``12 E I / (k G A L^2)``; zero if the theory has no shear.
    up, side : numpy.ndarray
        Steady load including the shaft's own weight [N/m].
    """

    length: Vector
    bending: Vector
    mass: Vector
    rotary: Vector
    shear_ratio: Vector
    up: Vector
    side: Vector
