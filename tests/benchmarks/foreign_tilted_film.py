"""Oil film between a tilted journal and a bore of any profile; nothing is from `wearstate.sim`.

Linear triangles on a mesh of right angles, psi from up in the direction of rotation and z along
the bearing, and the pressure that solves the variational inequality p >= 0,

    int h^3 / (12 mu) grad p . grad (v - p) >= int (U/2 h d(v - p)/dx - h' (v - p)),  v >= 0,

which is Reynolds' condition: the film ends where pressure and its slope are zero (Kinderlehrer and
Stampacchia 1980, ch. VII). It is found by the primal-dual active set (Hintermueller, Ito, Kunisch
2002, doi:10.1137/S1052623401383558). The gap is

    h = bore(psi) - (y + z y') cos psi - (s + z s') sin psi

for a journal at height y and to the side s of the bore's middle, with slopes y' and s'. Stiffness
and damping are the exact derivatives on the film that is filled: its edge moves by second order.
A groove along the bearing holds no pressure.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

MOST_SETS = 60


@dataclass(frozen=True, kw_only=True)
class Bore:
    """A bearing's bore; SI.

    Attributes
    ----------
    radius, length : float
    gap : numpy.ndarray [shape=(n_psi,)]
        Around a journal in the middle, at psi = 2 pi i / n_psi.
    grooved : numpy.ndarray of bool [shape=(n_psi,)]
    n_z : int
        Elements along the length, even.
    """

    radius: float
    length: float
    gap: np.ndarray
    grooved: np.ndarray
    n_z: int

    @property
    def nodes(self) -> np.ndarray:
        """Along the length, without the two ends."""
        return self.length * (np.arange(1, self.n_z) / self.n_z - 0.5)


@dataclass(frozen=True, kw_only=True)
class Film:
    """What a film does to its journal: order y, s, y', s'.

    Attributes
    ----------
    force : numpy.ndarray [shape=(4,)]
        On the journal, with moments [N], [N m].
    stiffness, damping : numpy.ndarray [shape=(4, 4)]
        By how much that falls with position and velocity.
    filled : numpy.ndarray of bool
        Nodes under pressure.
    leakage, friction : float
        Out of both ends [m^3/s]; power sheared in the whole gap [W].
    """

    force: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    filled: np.ndarray
    leakage: float
    friction: float


class _Mesh:
    """Directions of motion at nodes and triangles, and how edges join nodes."""

    def __init__(self, bore: Bore) -> None:
        n, rows = len(bore.gap), bore.n_z - 1
        self.along, self.across = 2 * np.pi * bore.radius / n, bore.length / bore.n_z
        psi, z = 2 * np.pi * np.arange(n) / n, bore.nodes
        self.move = _moves(psi[:, None], z[None, :])  # (4, n, rows)
        third = np.array([1 / 3, 2 / 3])  # of the way to the next node: centroids
        ends = bore.length * (np.arange(bore.n_z) / bore.n_z - 0.5)
        places = [
            (psi[:, None] + 2 * np.pi / n * s, ends[None, :] + self.across * s) for s in third
        ]
        self.tri_move = np.array([_moves(*place) for place in places])  # (2, 4, n, n_z)
        following = np.roll(bore.gap, -1)
        self.tri_bore = np.array([bore.gap + s * (following - bore.gap) for s in third])[..., None]
        self.index = np.arange(n * rows).reshape(n, rows)

    def round_edges(self, tri: np.ndarray) -> np.ndarray:
        """Of both triangles at each edge round the circle, halved [shape=(n, rows)]."""
        return 0.5 * (tri[0][:, 1:] + tri[1][:, :-1])

    def end_edges(self, tri: np.ndarray) -> np.ndarray:
        """Of both triangles at each edge along the bearing, halved [shape=(n, n_z)]."""
        return 0.5 * (tri[1] + np.roll(tri[0], 1, axis=0))

    def operator(self, tri: np.ndarray) -> csc_array:
        """Stiffness matrix of a flow conductance given on the triangles."""
        round_, ends = self.round_edges(tri), self.end_edges(tri)
        round_, ends = round_ * self.across / self.along, ends * self.along / self.across
        diagonal = round_ + np.roll(round_, 1, axis=0) + ends[:, :-1] + ends[:, 1:]
        following = np.roll(self.index, -1, axis=0)
        one = np.concatenate([self.index.ravel(), self.index[:, :-1].ravel()])
        other = np.concatenate([following.ravel(), self.index[:, 1:].ravel()])
        value = -np.concatenate([round_.ravel(), ends[:, 1:-1].ravel()])
        size = self.index.size
        upper = csc_array((value, (one, other)), shape=(size, size))
        return (upper + upper.T + diags_array(diagonal.ravel())).tocsc()

    def wedge(self, tri: np.ndarray) -> np.ndarray:
        """What a gap given on the triangles drags into each node, per half the surface speed."""
        carried = self.round_edges(tri) * self.across
        return (np.roll(carried, 1, axis=0) - carried).ravel()


def _moves(psi: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Change of the gap by y, s, y', s'."""
    up, side = -np.cos(psi) + 0 * z, -np.sin(psi) + 0 * z
    return np.array([up, side, z * up, z * side])


def solve_film(
    bore: Bore, viscosity: float, speed: float, place: np.ndarray, filled: np.ndarray | None = None
) -> Film | None:
    """Film of a journal at rest in a place y, s, y', s'; none where it touches the bore.

    Parameters
    ----------
    bore : Bore
    viscosity, speed : float
        [Pa s], [rad/s]
    place : numpy.ndarray [shape=(4,)]
    filled : numpy.ndarray, optional
        Where to start from.
    """
    mesh = _Mesh(bore)
    gap = mesh.tri_bore + np.tensordot(place, mesh.tri_move, axes=(0, 1))
    edge = np.array([place[:2] + z * place[2:] for z in (-bore.length / 2, bore.length / 2)])
    psi = 2 * np.pi * np.arange(len(bore.gap)) / len(bore.gap)
    if min(gap.min(), (bore.gap - edge @ np.array([np.cos(psi), np.sin(psi)])).min()) <= 0:
        return None
    half = speed * bore.radius / 2
    conductance = gap**3 / (12 * viscosity)
    matrix, source = mesh.operator(conductance), half * mesh.wedge(gap)
    free = np.repeat(~bore.grooved, bore.n_z - 1)
    found = _active_set(matrix, source, free, free if filled is None else filled & free)
    if found is None:
        return None
    pressure, filled, solve = found
    cell = mesh.along * mesh.across
    simpson = (2 / 3) * (1 + np.arange(1, bore.n_z) % 2)  # the pressure is a parabola along z
    arms = (mesh.move * cell * simpson).reshape(4, -1)  # force on the journal per pressure
    squeeze = -(mesh.move * cell).reshape(4, -1)
    rates = [
        half * mesh.wedge(mesh.tri_move[:, k])
        - mesh.operator(3 * gap**2 / (12 * viscosity) * mesh.tri_move[:, k]) @ pressure
        for k in range(4)
    ]
    changes = solve(np.array([*rates, *squeeze]).T)
    ends = mesh.end_edges(conductance) * mesh.along / mesh.across
    by_node = pressure.reshape(mesh.index.shape)
    return Film(
        force=arms @ pressure,
        stiffness=-arms @ changes[:, :4],
        damping=-arms @ changes[:, 4:],
        filled=filled,
        leakage=float((ends[:, 0] * by_node[:, 0] + ends[:, -1] * by_node[:, -1]).sum()),
        friction=float((viscosity * (2 * half) ** 2 / gap).sum() * cell / 2),
    )


def _active_set(matrix, source, free, filled):
    """Pressure, where it is above zero, and a solver for small changes on that set."""
    for _ in range(MOST_SETS):
        rows = np.flatnonzero(filled)
        if not rows.size:
            return None
        factor = splu(matrix[rows][:, rows])
        pressure = np.zeros(len(source))
        pressure[rows] = factor.solve(source[rows])
        lack = matrix @ pressure - source  # below zero where a dry node would be filled
        after = free & np.where(filled, pressure > 0, lack < -1e-12 * np.abs(source).max())
        if (after == filled).all():
            break
        filled = after
    else:
        return None

    def solve(right: np.ndarray) -> np.ndarray:
        changes = np.zeros_like(right)
        changes[rows] = factor.solve(np.ascontiguousarray(right[rows]))
        return changes

    return pressure, filled, solve
