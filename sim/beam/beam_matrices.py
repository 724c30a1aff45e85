"""Mesh and matrices of a beam: elements, stiffness, mass, gyroscopic moments, loads."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from .beam_parts import Disc, DistributedLoad, Elements, PointLoad, Section

Vector = NDArray[np.float64]
Index = NDArray[np.int64]

Sparse = Any  # scipy.sparse.csc_array; scipy has no types
SAME = 1e-9  # of the shaft's length: closer stations are merged


def cowper_coefficient(poisson: float, diameter_ratio: float = 0.0) -> float:
    """Shear coefficient k of a solid or hollow circle.

    Parameters
    ----------
    poisson : float
        Ratio in (-1, 0.5].
    diameter_ratio : float
        Inner over outer diameter, in [0, 1).

    Returns
    -------
    float
        Shear area over the area, k.

    Raises
    ------
    ValueError
        An argument is out of range.

    References
    ----------
    Cowper (1966), Journal of Applied Mechanics 33(2), 335-340, doi:10.1115/1.3625046.

    Examples
    --------
    >>> round(cowper_coefficient(0.3), 4), round(cowper_coefficient(0.3, 0.999999), 4)
    (0.8864, 0.5306)
    """
    if not -1 < poisson <= 0.5:
        raise ValueError(f"poisson = {poisson} must be in (-1, 0.5]; metals have about 0.3")
    if not 0 <= diameter_ratio < 1:
        raise ValueError(f"diameter_ratio = {diameter_ratio} must be in [0, 1); inner over outer")
    square = (1 + diameter_ratio**2) ** 2
    hollow = (20 + 12 * poisson) * diameter_ratio**2
    return 6 * (1 + poisson) * square / ((7 + 6 * poisson) * square + hollow)


# --- mesh


def merged(ends: Vector, named: list[tuple[str, float]]) -> Vector:
    """Rising stations, each once; the ends of sections take precedence."""
    slack = SAME * ends[-1]
    others = np.array([station for _, station in named], dtype=float)
    if others.size:
        nearest = np.abs(others[:, None] - ends).min(axis=1)
        others = np.sort(others[nearest > slack])
        others = others[np.diff(others, prepend=-math.inf) > slack]
    return np.sort(np.concatenate([ends, others]))


def mesh_nodes(
    ends: Vector, named: list[tuple[str, float]], longest_element: float | None
) -> Vector:
    """Stations of the nodes [m]: named ones, ends, and intermediate ones."""
    nodes = merged(ends, named)
    if longest_element is None:
        return nodes
    gaps = np.diff(nodes)
    # rounding must not add an element to a gap of a whole number of elements
    counts = np.maximum(1, np.ceil(gaps / longest_element * (1 - SAME))).astype(int)
    owner = np.repeat(np.arange(gaps.size), counts)
    step = np.arange(owner.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(nodes[owner] + gaps[owner] * (step / counts[owner]), nodes[-1])


def mesh_elements(
    nodes: Vector,
    ends: Vector,
    sections: Sequence[Section],
    loads: Sequence[PointLoad | DistributedLoad],
    theory: str,
    shear_coefficient: float | str | None,
    gravity: float,
) -> Elements:
    """Elements between the nodes, each with its section and its share of the loads."""
    length, middle = np.diff(nodes), (nodes[:-1] + nodes[1:]) / 2
    of = np.searchsorted(ends, middle) - 1
    bending = np.array([section.bending_stiffness for section in sections])[of]
    mass = np.array([section.density * section.area for section in sections])[of]
    rotary = np.array([section.density * section.second_moment for section in sections])[of]
    shear_ratio = np.zeros(length.size)
    if theory == "timoshenko":
        area = np.array([_shear_stiffness(section, shear_coefficient) for section in sections])[of]
        shear_ratio = 12 * bending / (area * length**2)
    up, side = -mass * gravity, np.zeros(length.size)
    for load in loads:
        if isinstance(load, DistributedLoad):
            under = (load.start < middle) & (middle < load.end)
            up, side = up + load.up * under, side + load.side * under
    return Elements(
        length=length,
        bending=bending,
        mass=mass,
        rotary=np.zeros(length.size) if theory == "euler-bernoulli" else rotary,
        shear_ratio=shear_ratio,
        up=up,
        side=side,
    )


def _shear_stiffness(section: Section, shear_coefficient: float | str | None) -> float:
    """``k G A`` [N]."""
    if shear_coefficient == "cowper":
        ratio = section.inner_diameter / section.outer_diameter
        k = cowper_coefficient(section.poisson, ratio)
    else:
        assert isinstance(shear_coefficient, (int, float))  # checked with the other arguments
        k = float(shear_coefficient)
    return k * section.shear_modulus * section.area


# --- matrices of one plane, [shape=(n_elements, 4, 4)], of (w1, slope1, w2, slope2)


def _plane_matrix(rows: Sequence[Sequence[Any]], length: Vector) -> Vector:
    """Symmetric matrices from the upper triangle, the slopes scaled by the element's length."""
    full = np.empty((length.size, 4, 4))
    for i, row in enumerate(rows):
        for j, value in enumerate(row, start=i):
            full[:, i, j] = full[:, j, i] = value * length ** (i % 2 + j % 2)
    return full


def _plane_stiffness(e: Elements) -> Vector:
    s = e.shear_ratio
    rows: list[list[Any]] = [[12.0, 6.0, -12.0, 6.0], [4 + s, -6.0, 2 - s], [12.0, -6.0], [4 + s]]
    scale: Vector = e.bending / (e.length**3 * (1 + s))
    return scale[:, None, None] * _plane_matrix(rows, e.length)


def _plane_mass(e: Elements) -> Vector:
    """Mass matrix of the translation."""
    s = e.shear_ratio
    ends, turns = 312 + 588 * s + 280 * s**2, 44 + 77 * s + 35 * s**2
    across, skewed = 108 + 252 * s + 140 * s**2, 26 + 63 * s + 35 * s**2
    own, other = 8 + 14 * s + 7 * s**2, 6 + 14 * s + 7 * s**2
    rows = [[ends, turns, across, -skewed], [own, skewed, -other], [ends, -turns], [own]]
    scale = e.mass * e.length / (840 * (1 + s) ** 2)
    return scale[:, None, None] * _plane_matrix(rows, e.length)


def _plane_rotary(e: Elements) -> Vector:
    """Mass matrix of the rotation about a diameter."""
    s = e.shear_ratio
    turns, own, other = 3 - 15 * s, 4 + 5 * s + 10 * s**2, -1 - 5 * s + 5 * s**2
    rows: list[list[Any]] = [
        [36.0, turns, -36.0, turns],
        [own, -turns, other],
        [36.0, -turns],
        [own],
    ]
    scale: Vector = e.rotary / (30 * e.length * (1 + s) ** 2)
    return scale[:, None, None] * _plane_matrix(rows, e.length)


# --- assembly


def _sparse(n_dof: int, parts: Sequence[tuple[Any, Any, Any]]) -> Sparse:
    """Sum of (rows, columns, values) of any shapes; exact zeros are dropped."""
    rows, columns, values = (np.concatenate([np.ravel(p[k]) for p in parts]) for k in range(3))
    matrix = coo_array((values, (rows, columns)), shape=(n_dof, n_dof)).tocsc()
    matrix.eliminate_zeros()
    return matrix


def _block(n_elements: int, rows: int, columns: int) -> tuple[Index, Index]:
    """Indices of a plane matrix: `rows` and `columns` are 0 for the plane of y, 2 for that of z."""
    local = np.array([0, 1, 4, 5])
    first = 4 * np.arange(n_elements)[:, None, None]
    shape = (n_elements, 4, 4)
    i = np.broadcast_to(first + rows + local[:, None], shape)
    j = np.broadcast_to(first + columns + local, shape)
    return i, j


def _both_planes(plane: Vector) -> list[tuple[Any, Any, Any]]:
    return [(*_block(len(plane), start, start), plane) for start in (0, 2)]


def stiffness_matrix(e: Elements) -> Sparse:
    """Stiffness of both planes, four coordinates per node."""
    return _sparse(4 * (e.length.size + 1), _both_planes(_plane_stiffness(e)))


def mass_matrix(nodes: Vector, e: Elements, discs: Sequence[Disc]) -> Sparse:
    """Mass matrix including the rotary inertia of elements and discs."""
    parts: list[tuple[Any, Any, Any]] = _both_planes(_plane_mass(e) + _plane_rotary(e))
    for disc in discs:
        moved = disc.mass + disc.entrained_mass
        turned = disc.diametral_inertia + disc.entrained_diametral
        at = _first_dof(nodes, disc.station) + np.arange(4)
        parts.append((at, at, [moved, turned, moved, turned]))
    return _sparse(4 * nodes.size, parts)


def gyroscopic_matrix(nodes: Vector, e: Elements, discs: Sequence[Disc]) -> Sparse:
    """Coupling of the two planes, over the speed."""
    polar = 2 * _plane_rotary(e)  # a circle's polar moment is twice that about a diameter
    parts: list[tuple[Any, Any, Any]] = [
        (*_block(len(polar), 0, 2), polar),
        (*_block(len(polar), 2, 0), -polar),
    ]
    for disc in discs:
        turn = _first_dof(nodes, disc.station) + np.array([1, 3])
        parts.append((turn, turn[::-1], [disc.polar_inertia, -disc.polar_inertia]))
    return _sparse(4 * nodes.size, parts)


def steady_load(
    nodes: Vector,
    e: Elements,
    discs: Sequence[Disc],
    loads: Sequence[PointLoad | DistributedLoad],
    gravity: float,
) -> Vector:
    """Weight and given loads at every coordinate."""
    load = np.zeros((nodes.size, 4))
    for column, spread in ((0, e.up), (2, e.side)):
        force, moment = spread * e.length / 2, spread * e.length**2 / 12
        load[:-1, column] += force
        load[1:, column] += force
        load[:-1, column + 1] += moment
        load[1:, column + 1] -= moment
    flat = load.ravel()
    for disc in discs:
        flat[_first_dof(nodes, disc.station)] += disc.buoyancy - disc.mass * gravity
    for point in loads:
        if isinstance(point, PointLoad):
            first = _first_dof(nodes, point.station)
            flat[first : first + 4] += point.up, point.moment_up, point.side, point.moment_side
    return flat


def _first_dof(nodes: Vector, station: float) -> int:
    return 4 * int(np.argmin(np.abs(nodes - station)))


def cut_forces(
    e: Elements, deflection: Vector, slope: Vector, spread: Vector
) -> tuple[Vector, Vector]:
    """Shear and moment at both ends of every element, [shape=(2 n_elements,)]."""
    ends = np.stack([deflection[:-1], slope[:-1], deflection[1:], slope[1:]], axis=1)
    force = np.einsum("eij,ej->ei", _plane_stiffness(e), ends)
    even, turn = spread * e.length / 2, spread * e.length**2 / 12
    force -= np.stack([even, turn, even, -turn], axis=1)
    shear = np.stack([force[:, 0], -force[:, 2]], axis=1)
    moment = np.stack([-force[:, 1], force[:, 3]], axis=1)
    return shear.ravel(), moment.ravel()
