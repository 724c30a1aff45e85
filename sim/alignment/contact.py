"""Contact of a line that is held at points: which of them bear, and with what force."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded

from .seats import FEWEST_POINTS, AlignmentError

Vector = NDArray[np.float64]
Index = NDArray[np.int64]

NO_LOAD = 1e-9  # of the whole load: below this a reaction is rounding
NO_GAP = 1e-12  # m


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldLine:
    """The beam with all its support points held: reactions and deflection over their heights.

    Attributes
    ----------
    stations : numpy.ndarray [shape=(p,)]
        Of the support points [m].
    owner : numpy.ndarray [shape=(p,)]
        Seat of each point.
    stiffness : numpy.ndarray [shape=(p,)]
        Of each point's seat share [N/m], infinite where rigid.
    influence : numpy.ndarray [shape=(p, p)]
        Change of reaction by height, all others held [N/m].
    lines : numpy.ndarray [shape=(2 n, p)]
        Deflection and slope of every node by height.
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
    """T and G of the shaft's heights at the points, ``y = T h - G dead``.

    A rigid point in contact stands at its height; the others balance their springs, those off
    contact nothing: ``(A + k) y = k h - dead``.
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
    """Reactions and the shaft's height at the points, and which of them are in contact."""

    force: Vector
    height: Vector
    contact: NDArray[np.bool_]


def rest_on(held: HeldLine, dead: Vector, heights: Vector, contact: NDArray[np.bool_]) -> Rest:
    """Rest with the given points in contact and the others free, whatever the signs."""
    follow, give = following(held, contact)
    y = follow @ heights - give @ dead
    force = dead + held.influence @ y
    force[~contact] = 0.0
    return Rest(force=force, height=y, contact=contact)


def come_to_rest(held: HeldLine, dead: Vector, heights: Vector) -> Rest:
    """Rest on points that only push: a primal active set on the reactions.

    It starts from the two outermost points, which carry every load they can carry, and then takes
    in the point that the shaft sinks into most, letting go those that would pull on the way. The
    complementary energy falls in each round, so that no set of points comes twice.
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
        "which bearings lift could not be settled; two support points may stand too close: give "
        "them a finite stiffness, or fewer points"
    )


def _two_point_start(held: HeldLine, dead: Vector) -> Vector:
    """Reactions of the first and the last point alone."""
    s = held.stations
    load, moment = float(dead.sum()), float(dead @ s)
    if not load > 0 or not s[0] * load <= moment <= s[-1] * load:
        where = f"at {moment / load:.4g} m" if load > 0 else "upward"
        raise AlignmentError(
            f"resultant of the loads = {load / 1e3:.4g} kN {where} must act downward between the "
            f"first support at {s[0]:.4g} m and the last at {s[-1]:.4g} m, or the shaft tips; add "
            "a support or mend the loads"
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
    """Rest on the points in contact less those that come to pull on the way from `force`."""
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
