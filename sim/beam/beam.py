"""A shaft as a beam in two planes: finite elements with two nodes, assembled once, sparse.

x runs along the shaft from aft, y up, z to starboard; the shaft turns from y to z. Every node has
four coordinates, in the order y, slope_y, z, slope_z, and node k starts at coordinate 4 k. A slope
is the rotation of the cross-section, dy/dx or dz/dx without shear; the moments conjugate
to the slopes are called up and side after their planes.

================  ======  ===============  ===========================================
theory            shear   rotary, gyro     valid
================  ======  ===============  ===========================================
euler-bernoulli   no      discs only       wave lengths above about 10 diameters
rayleigh          no      discs and shaft  little gain without shear
timoshenko        yes     discs and shaft  wave lengths above about 2 diameters
================  ======  ===============  ===========================================

Without shear the frequency of a wave of ten diameters is 5 % high, of thirty 0.5 %.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..brief import brief
from .beam_matrices import (
    SAME,
    Sparse,
    cut_forces,
    gyroscopic_matrix,
    mass_matrix,
    merged,
    mesh_elements,
    mesh_nodes,
    steady_load,
    stiffness_matrix,
)
from .beam_parts import Disc, DistributedLoad, Elements, PointLoad, Section

Vector = NDArray[np.float64]
STANDARD_GRAVITY = 9.80665
"""Acceleration of gravity [m/s^2] (CGPM 1901)."""

THEORIES = ("euler-bernoulli", "rayleigh", "timoshenko")
"""Beam theories, in the order of what they include."""

COORDINATES = ("y", "slope_y", "z", "slope_z")
"""Coordinates of one node, in order."""

_NEAREST = 1e-4  # of the shaft's length: with an element this short, reactions are accurate to 1e-7
_MOST_NODES = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class InternalForces:
    """Bending moment and shear along the shaft, for plotting.

    Every station except the first and the last appears twice, for just aft and just forward of it,
    since a force makes the shear jump and a moment the bending moment.

    Attributes
    ----------
    stations : numpy.ndarray [shape=(2 n - 2,)]
        Stations [m].
    moment_up, moment_side : numpy.ndarray [shape=(2 n - 2,)]
        ``E I y''`` [N m]: positive where the shaft sags, with tension below.
    shear_up, shear_side : numpy.ndarray [shape=(2 n - 2,)]
        ``dM/dx`` [N]: the sum of all upward forces aft of the station.
    """

    stations: Vector
    moment_up: Vector
    moment_side: Vector
    shear_up: Vector
    shear_side: Vector


@dataclass(frozen=True, kw_only=True, eq=False)
class Beam:
    """A shaft free of all supports: ``M q'' + Omega G q' + K q = f``.

    Attributes
    ----------
    stations : numpy.ndarray [shape=(n,)]
        Stations of the nodes, rising from 0 at the aft end [m].
    mass, stiffness, gyroscopic : scipy.sparse.csc_array [shape=(4 n, 4 n)]
        Symmetric, symmetric, skew. The gyroscopic one is multiplied by the speed [rad/s].
    load : numpy.ndarray [shape=(4 n,)]
        Steady forces and moments, including gravity.
    weight : float
        Weight of shaft and discs, less buoyancy [N].
    elements : Elements
    sections, discs, loads : tuple
        As passed.
    theory : str
    shear_coefficient : float or str or None
        As passed.
    gravity : float
        Gravity [m/s^2].
    """

    stations: Vector
    mass: Sparse
    stiffness: Sparse
    gyroscopic: Sparse
    load: Vector
    weight: float
    elements: Elements
    sections: tuple[Section, ...]
    discs: tuple[Disc, ...]
    loads: tuple[PointLoad | DistributedLoad, ...]
    theory: str
    shear_coefficient: float | str | None
    gravity: float

    __repr__ = brief("length", "weight", "n_dof", "stations", "theory")

    @property
    def length(self) -> float:
        """Length of the shaft [m]."""
        return float(self.stations[-1])

    @property
    def n_dof(self) -> int:
        """Number of coordinates, four for each node."""
        return 4 * self.stations.size

    @property
    def downward_load(self) -> float:
        """Total load of the bearings: the weight and every given load [N]."""
        return -float(self.load[0::4].sum())

    def node(self, station: float) -> int:
        """Index of the node at a station.

        Raises
        ------
        ValueError
            There is no node; the message gives the nearest.
        """
        nearest = int(np.argmin(np.abs(self.stations - station)))
        if not abs(self.stations[nearest] - station) <= 2 * SAME * self.length:
            raise ValueError(
                f"station = {station:g} m is no node, the nearest is {self.stations[nearest]:g} m; "
                "add it to `stations` of assemble_beam"
            )
        return nearest

    def dof(self, station: float, coordinate: str) -> int:
        """Index of a coordinate of the node at a station.

        Parameters
        ----------
        station : float
            Station [m].
        coordinate : str
            "y", "slope_y", "z" or "slope_z".

        Raises
        ------
        ValueError
            There is no node at the station, or no such coordinate.
        """
        if coordinate not in COORDINATES:
            raise ValueError(f"coordinate = '{coordinate}' must be one of {', '.join(COORDINATES)}")
        return 4 * self.node(station) + COORDINATES.index(coordinate)

    def moments_and_shear(self, deflection: ArrayLike) -> InternalForces:
        """Bending moment and shear of a deflected shaft at rest.

        Parameters
        ----------
        deflection : array_like [shape=(4 n,)]
            Displacement of every coordinate [m], [rad], for example from a static solution.

        Returns
        -------
        InternalForces
            Includes the steady load inside the elements: exact at the nodes.

        Raises
        ------
        ValueError
            The deflection has another shape.
        """
        q = np.asarray(deflection, dtype=float)
        if q.shape != (self.n_dof,):
            raise ValueError(
                f"deflection of shape {q.shape} must be ({self.n_dof},); give every coordinate"
            )
        e = self.elements
        shear_up, moment_up = cut_forces(e, q[0::4], q[1::4], e.up)
        shear_side, moment_side = cut_forces(e, q[2::4], q[3::4], e.side)
        return InternalForces(
            stations=np.repeat(self.stations, 2)[1:-1],
            moment_up=moment_up,
            moment_side=moment_side,
            shear_up=shear_up,
            shear_side=shear_side,
        )


def assemble_beam(
    sections: Sequence[Section],
    *,
    discs: Sequence[Disc] = (),
    loads: Sequence[PointLoad | DistributedLoad] = (),
    stations: Sequence[float] = (),
    longest_element: float | None = None,
    theory: str = "timoshenko",
    shear_coefficient: float | str | None = None,
    gravity: float = STANDARD_GRAVITY,
) -> Beam:
    """Mass, stiffness, gyroscopic matrix and steady load of a stepped shaft.

    Parameters
    ----------
    sections : sequence of Section
        From aft forward; the first begins at station 0.
    discs, loads : sequence
        Each at its own station; loads are steady.
    stations : sequence of float
        Further nodes: bearings, sensors, places of forces [m].
    longest_element : float, optional
        Largest length of the elements [m]; by default nodes are only at named stations.
    theory : str
        One of ``THEORIES``.
    shear_coefficient : float or str
        Share k in (0, 1] of the cross-section that carries the shear, or "cowper" for
        Cowper's of each section; required for *timoshenko*, ignored for the others.
    gravity : float
        Downward gravity [m/s^2].

    Returns
    -------
    Beam
        Sparse matrices and the load.

    Raises
    ------
    ValueError
        Something is out of range, off the shaft, or too close to something else; all faults
        together, each with the value, the bound and a cure.

    Notes
    -----
    The element's deflection is a cubic and its slope a quadratic that satisfy the equations of the
    unloaded beam, so that the nodes of a static solution are exact for any mesh, also under
    uniform loads, of which each node gets ``(q L / 2, +-q L^2 / 12)``. Mass, rotary inertia and
    gyroscopic matrix use the same shapes (consistent). Natural frequencies converge from above:
    by ``(beta h)^4 / 1440`` with elements of length h and the wave number beta; *timoshenko* adds
    at most ``s (beta h)^2 / 24``, with the ratio of shear to bending
    ``s = E I beta^2 / (k G A)``. Rounding grows with the inverse cube of the shortest element over
    the shaft, which therefore is bounded below.

    Cowper's coefficient of a hollow circle, with m the inner over the outer diameter, is
    ``6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2)``. Line-shafting
    programs often take k = 1.

    References
    ----------
    Nelson (1980), A finite rotating shaft element using Timoshenko beam theory, Journal of
    Mechanical Design 102(4), 793-803, doi:10.1115/1.3254824. Friswell, Penny, Garvey, Lees (2010),
    Dynamics of Rotating Machines, Cambridge University Press, 5.4. Cowper (1966), Journal of
    Applied Mechanics 33(2), 335-340, doi:10.1115/1.3625046.

    Examples
    --------
    A bar of 1 m pinned at its ends sinks in the middle by 5 W L^3 / (384 E I):

    >>> bar = Section(length=1.0, outer_diameter=0.02, young=2e11, shear_modulus=8e10,
    ...               density=7800.0)
    >>> beam = assemble_beam([bar], stations=[0.5], theory="euler-bernoulli")
    >>> free = np.setdiff1d(np.arange(beam.n_dof), [beam.dof(s, c) for s in (0, 1) for c in "yz"])
    >>> q = np.linalg.solve(beam.stiffness[free][:, free].toarray(), beam.load[free])
    >>> middle = q[list(free).index(beam.dof(0.5, "y"))]
    >>> round(float(middle / (-5 * beam.weight / (384 * bar.bending_stiffness))), 9)
    1.0
    """
    faults = list(_faults(sections, discs, loads, stations, longest_element, gravity))
    faults += _theory_faults(theory, shear_coefficient)
    if faults:
        raise ValueError("\n".join(faults))
    ends = np.cumsum([0.0, *(section.length for section in sections)])
    nodes = mesh_nodes(ends, _named_stations(discs, loads, stations), longest_element)
    elements = mesh_elements(nodes, ends, sections, loads, theory, shear_coefficient, gravity)
    load = steady_load(nodes, elements, discs, loads, gravity)
    own = float(elements.mass @ elements.length) * gravity
    return Beam(
        stations=nodes,
        mass=mass_matrix(nodes, elements, discs),
        stiffness=stiffness_matrix(elements),
        gyroscopic=gyroscopic_matrix(nodes, elements, discs),
        load=load,
        weight=own + sum(disc.mass * gravity - disc.buoyancy for disc in discs),
        elements=elements,
        sections=tuple(sections),
        discs=tuple(discs),
        loads=tuple(loads),
        theory=theory,
        shear_coefficient=shear_coefficient,
        gravity=gravity,
    )


# --- checks


def _faults(
    sections: Sequence[Section],
    discs: Sequence[Disc],
    loads: Sequence[PointLoad | DistributedLoad],
    stations: Sequence[float],
    longest_element: float | None,
    gravity: float,
) -> Iterator[str]:
    if not sections:
        yield "sections is empty, must hold at least one; give the shaft's pieces from aft"
    found = [f for i, s in enumerate(sections) for f in _section_faults(f"sections[{i}]", s)]
    yield from found
    for i, disc in enumerate(discs):
        yield from _disc_faults(f"discs[{i}]", disc)
    for i, load in enumerate(loads):
        yield from _load_faults(f"loads[{i}]", load)
    if not math.isfinite(gravity):
        yield f"gravity = {gravity} m/s^2 must be finite; the earth has {STANDARD_GRAVITY}"
    if longest_element is not None and not longest_element > 0:
        yield f"longest_element = {longest_element} m must be > 0; leave it out for no bound"
        found.append("")
    if sections and not found:
        yield from _place_faults(sections, discs, loads, stations, longest_element)


def _section_faults(name: str, section: Section) -> Iterator[str]:
    for quantity, unit in (
        ("length", "m"),
        ("outer_diameter", "m"),
        ("young", "Pa"),
        ("shear_modulus", "Pa"),
        ("density", "kg/m^3"),
    ):
        value = getattr(section, quantity)
        if not 0 < value < math.inf:
            yield f"{name}.{quantity} = {value} {unit} must be > 0 and finite; check the unit"
    if not 0 <= section.inner_diameter < section.outer_diameter:
        yield (
            f"{name}.inner_diameter = {section.inner_diameter} m must be >= 0 and < "
            f"outer_diameter = {section.outer_diameter} m; 0 is a solid shaft"
        )


def _disc_faults(name: str, disc: Disc) -> Iterator[str]:
    for quantity, unit in (
        ("mass", "kg"),
        ("polar_inertia", "kg m^2"),
        ("diametral_inertia", "kg m^2"),
        ("entrained_mass", "kg"),
        ("entrained_polar", "kg m^2"),
        ("entrained_diametral", "kg m^2"),
        ("buoyancy", "N"),
    ):
        value = getattr(disc, quantity)
        if not 0 <= value < math.inf:
            yield f"{name}.{quantity} = {value} {unit} must be >= 0 and finite; check the unit"
    if disc.polar_inertia > 2 * (1 + 1e-6) * disc.diametral_inertia:  # printed numbers are rounded
        yield (
            f"{name}.polar_inertia = {disc.polar_inertia} kg m^2 must be <= 2 diametral_inertia = "
            f"{2 * disc.diametral_inertia} kg m^2, that of the flattest disc; check which is which"
        )


def _load_faults(name: str, load: PointLoad | DistributedLoad) -> Iterator[str]:
    quantities = [("up", "N/m"), ("side", "N/m")]
    if isinstance(load, PointLoad):
        quantities = [("up", "N"), ("side", "N"), ("moment_up", "N m"), ("moment_side", "N m")]
    elif not load.start < load.end:
        yield f"{name}.start = {load.start} m must be < end = {load.end} m; exchange them"
    for quantity, unit in quantities:
        value = getattr(load, quantity)
        if not math.isfinite(value):
            yield f"{name}.{quantity} = {value} {unit} must be finite; leave out absent loads"


def _place_faults(
    sections: Sequence[Section],
    discs: Sequence[Disc],
    loads: Sequence[PointLoad | DistributedLoad],
    stations: Sequence[float],
    longest_element: float | None,
) -> Iterator[str]:
    ends = np.cumsum([0.0, *(section.length for section in sections)])
    length = float(ends[-1])
    named = _named_stations(discs, loads, stations)
    slack = SAME * length
    off = [(n, s) for n, s in named if not -slack <= s <= length + slack]
    for name, station in off:
        yield f"{name} = {station} m must be in [0, {length:g}] m, on the shaft; move it"
    if off:
        return
    nodes = merged(ends, named)
    for left, right in pairwise(nodes):
        if right - left < _NEAREST * length:
            yield (
                f"stations {left:.9g} m and {right:.9g} m are {right - left:.3g} m apart, must be "
                f"one or >= {_NEAREST:g} of the shaft's length = {_NEAREST * length:.3g} m; "
                "move one onto the other"
            )
    if longest_element is not None and length / longest_element + nodes.size > _MOST_NODES:
        yield (
            f"longest_element = {longest_element} m must be >= {length / _MOST_NODES:.3g} m, for "
            f"{_MOST_NODES} nodes at most; a fifth of the least wave length is enough"
        )


def _theory_faults(theory: str, shear_coefficient: float | str | None) -> Iterator[str]:
    if theory not in THEORIES:
        yield f"theory = '{theory}' must be one of {', '.join(THEORIES)}"
    if theory != "timoshenko" or shear_coefficient == "cowper":
        return
    if not isinstance(shear_coefficient, (int, float)) or not 0 < shear_coefficient <= 1:
        yield (
            f"shear_coefficient = {shear_coefficient!r} must be in (0, 1] or 'cowper'; a form "
            "factor above 1 is its inverse, and 1 takes the whole cross-section"
        )


# --- mesh


def _named_stations(
    discs: Sequence[Disc],
    loads: Sequence[PointLoad | DistributedLoad],
    stations: Sequence[float],
) -> list[tuple[str, float]]:
    """Name in a message and station of everything that needs a node."""
    named = [(f"stations[{i}]", float(station)) for i, station in enumerate(stations)]
    named += [(f"discs[{i}].station", disc.station) for i, disc in enumerate(discs)]
    for i, load in enumerate(loads):
        places = ("station",) if isinstance(load, PointLoad) else ("start", "end")
        named += [(f"loads[{i}].{place}", getattr(load, place)) for place in places]
    return named
