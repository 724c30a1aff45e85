"""Contact of a line on its support points: which are in contact, and their forces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded

from .seats import FEWEST_POINTS, AlignmentError

Vector = NDArray[np.float64]
Index = NDArray[np.int64]

NO_LOAD = 1e-9  # of the whole load: smaller reactions are rounding
NO_GAP = 1e-12  # m


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldLine:
    """Beam with all its support points held: reactions and deflection as functions of the heights.

    Attributes
    ----------
    stations : numpy.ndarray [shape=(p,)]
        Positions of the support points [m].
    owner : numpy.ndarray [shape=(p,)]
        Seat of each point.
    stiffness : numpy.ndarray [shape=(p,)]
        Stiffness of each point's share of its seat [N/m], infinite if rigid.
    influence : numpy.ndarray [shape=(p, p)]
        Change of reaction per height, all others held [N/m].
    lines : numpy.ndarray [shape=(2 n, p)]
        Deflection and slope of every node per height.
    """

    stations: Vector
    owner: Index
    stiffness: Vector
    influence: Vector
    lines: Vector
    _factor: Vector
    _coupling: Vector  # free coordinates by held ones
    _held: Index
    _free: Index

    def carry(self, load: Vector) -> tuple[Vector, Vector]:
        """Reactions (p,) and deflection (2 n,) under a load (2 n,) with all heights zero."""
        line = np.zeros(load.size)
        line[self._free] = cho_solve_banded((self._factor, False), load[self._free])
        return self._coupling.T @ line[self._free] - load[self._held], line


def following(held: HeldLine, contact: NDArray[np.bool_]) -> tuple[Vector, Vector]:
    """Matrices T and G of the shaft's heights at the points, ``y = T h - G dead``.

    A rigid point in contact is at its height; the others are in equilibrium with their springs, or
    free without contact: ``(A + k) y = k h - dead``.
    """
    spring = np.where(contact, held.stiffness, 0.0)
    rigid = np.isinf(spring)
    loose = ~rigid
    follow = np.diag(rigid.astype(float))
    give = np.zeros_like(follow)
    if loose.any():
        k = np.diag(spring[loose])
        inner = held.influence[np.ix_(loose, loose)] + k
        known = np.hstack([k, -held.influence[np.ix_(loose, rigid)], np.eye(k.shape[0])])
        solved = np.linalg.solve(inner, known)
        n, m = int(loose.sum()), int(rigid.sum())
        follow[np.ix_(loose, loose)] = solved[:, :n]
        follow[np.ix_(loose, rigid)] = solved[:, n : n + m]
        give[np.ix_(loose, loose)] = solved[:, n + m :]
    return follow, give


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """Reactions and heights of the shaft at the points, and which of them are in contact."""

    force: Vector
    height: Vector
    contact: NDArray[np.bool_]


def rest_on(held: HeldLine, dead: Vector, heights: Vector, contact: NDArray[np.bool_]) -> Rest:
    """Equilibrium with the given points in contact and the others free, ignoring the signs."""
    follow, give = following(held, contact)
    y = follow @ heights - give @ dead
    force = dead + held.influence @ y
    force[~contact] = 0.0
    return Rest(force=force, height=y, contact=contact)


def come_to_rest(held: HeldLine, dead: Vector, heights: Vector) -> Rest:
    """Equilibrium on unilateral points: a primal active set on the reactions.

    It starts from the two outermost points, which can carry any downward load, and then adds
    the point with the largest penetration, dropping points that would pull on the way. The
    complementary energy falls in each round, so that no set of points repeats.
    """
    least = -NO_LOAD * float(np.abs(dead).sum())
    rest = rest_on(held, dead, heights, np.ones(dead.size, dtype=bool))
    if rest.force.min() >= least:
        return rest
    force = _two_point_start(held, dead)
    contact = force > 0
    contact[[0, -1]] = True
    for _ in range(10 * dead.size):
        rest, contact, force = _let_go(held, dead, heights, contact, force, least)
        gap = np.where(contact, 0.0, rest.height - heights)
        if gap.min() >= -NO_GAP:
            return rest
        contact = contact.copy()
        contact[int(np.argmin(gap))] = True
    raise AlignmentError(
        "the lifting bearings could not be determined; two support points may be too close: give "
        "them a finite stiffness, or fewer points"
    )


def _two_point_start(held: HeldLine, dead: Vector) -> Vector:
    """Reactions with only the first and the last point."""
    s = held.stations
    load, moment = float(dead.sum()), float(dead @ s)
    if not load > 0 or not s[0] * load <= moment <= s[-1] * load:
        where = f"at {moment / load:.4g} m" if load > 0 else "upward"
        raise AlignmentError(
            f"resultant of the loads = {load / 1e3:.4g} kN {where} must act downward between the "
            f"first support at {s[0]:.4g} m and the last at {s[-1]:.4g} m, or the shaft tips; add "
            "a support or correct the loads"
        )
    force = np.zeros(s.size)
    force[-1] = (moment - load * s[0]) / (s[-1] - s[0])
    force[0] = load - force[-1]
    return force


def _let_go(
    held: HeldLine,
    dead: Vector,
    heights: Vector,
    contact: NDArray[np.bool_],
    force: Vector,
    least: float,
) -> tuple[Rest, NDArray[np.bool_], Vector]:
    """Equilibrium on the points in contact, dropping those that begin to pull from `force` on."""
    while True:
        rest = rest_on(held, dead, heights, contact)
        pulls = contact & (rest.force < least)
        if not pulls.any() or contact.sum() == FEWEST_POINTS:
            return rest, contact, np.maximum(rest.force, 0.0)
        way = force[pulls] / (force[pulls] - rest.force[pulls])
        force = force + way.min() * (rest.force - force)
        first = np.flatnonzero(pulls)[int(np.argmin(way))]
        contact = contact.copy()
        contact[first] = False
        force[~contact] = 0.0
