"""The line of the independent propulsion shaft: ROSS's beam on films of `foreign_tilted_film`.

Mass, stiffness, damping and gyroscopic matrices are those of ROSS's `Rotor` of Timoshenko elements
and discs (tried with ROSS 2.3.0); the four numbers of a node are taken in the order up, side,
slope up, slope side. Influence numbers of the bearings' places are the Schur complement of ROSS's
stiffness matrix. Journals lie where

    K_b (c + r - F(r) / k) - f_b = F(r),

with c the bores, k their pedestals, F the films' forces and moments at r, by Newton's method.
Stations count from aft; up and side turn into each other in the direction of rotation. All is
simulated.
"""

import contextlib
import io
import warnings
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import pi

import numpy as np
from foreign_line_draws import (
    BEARINGS,
    BUOYANCY,
    COUPLING_BENDING,
    COUPLING_STIFFNESS,
    DAMPING_BAND,
    DAMPING_RATIO,
    DENSITY,
    DISCS,
    GRAVITY,
    OIL_DENSITY,
    OIL_HEAT,
    SECTIONS,
    SHEAR,
    THRUST_HEIGHT,
    THRUST_SIDE,
    WATER,
    YOUNG,
    Conditions,
    Machine,
    viscosity,
)
from foreign_tilted_film import Bore, Film, solve_film

ELEMENT = 0.4  # longest [m]
N_PSI, N_Z = 72, (12, 8, 8, 8, 8)
GROOVE = 2 * pi * 2 / 72  # half its width [rad]
HEAT_KEPT, HOTTEST = 0.5, 20.0  # share of the friction that the leaking oil takes, [K]


class NoBalanceError(RuntimeError):
    """Beam and films found no balance."""


# --- beam


@dataclass(frozen=True, kw_only=True)
class Beam:
    """ROSS's matrices, four numbers a node; SI.

    Attributes
    ----------
    stations : numpy.ndarray [shape=(n,)]
    mass, stiffness, damping, gyroscopic : numpy.ndarray [shape=(4 n, 4 n)]
    weight : numpy.ndarray [shape=(4 n,)]
    """

    stations: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    gyroscopic: np.ndarray
    weight: np.ndarray

    def at(self, station: float) -> int:
        """First number of the node there."""
        return 4 * int(np.argmin(np.abs(self.stations - station)))


@cache
def beam() -> Beam:
    """The bare shaft with its discs."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")  # ROSS and its libraries talk at import
        import ross

        steel = ross.Material("forged", rho=DENSITY, E=YOUNG, G_s=SHEAR)
        stations = _stations()
        low, high = (2 * pi * f for f in DAMPING_BAND)
        beta = 2 * DAMPING_RATIO / (low + high)
        pieces = [
            ross.ShaftElement(
                L=length,
                idl=0.0,
                odl=_diameter(x),
                material=steel,
                alpha=beta * low * high,
                beta=beta,
            )
            for x, length in zip(stations, np.diff(stations), strict=False)
        ]
        nodes = [int(np.argmin(np.abs(stations - x))) for x in DISCS[:, 0]]
        discs = [
            ross.DiskElement(n=n, m=m, Id=across, Ip=polar)
            for n, (_, m, across, polar, _) in zip(nodes, DISCS, strict=True)
        ]
        water = ross.DiskElement(n=nodes[0], m=WATER[0], Id=WATER[1], Ip=0.0)
        rotor = ross.Rotor(pieces, [*discs, water], [])
        found = [rotor.M(), rotor.K(0.0), rotor.C(0.0), rotor.G()]
    mass, stiffness, damping, gyroscopic = (_four(each) for each in found)
    weight = -GRAVITY * mass @ np.tile([1.0, 0, 0, 0], len(stations))
    weight[4 * nodes[0]] += BUOYANCY + GRAVITY * WATER[0]  # water has no weight in water
    return Beam(
        stations=stations,
        mass=mass,
        stiffness=stiffness,
        damping=damping,
        gyroscopic=gyroscopic,
        weight=weight,
    )


def _stations() -> np.ndarray:
    ends = np.cumsum([0.0, *(length for length, _ in SECTIONS)])
    fixed = np.unique(np.round([*ends, *DISCS[:, 0], *BEARINGS[:, 0]], 9))
    pieces = [
        np.linspace(a, b, int(np.ceil((b - a) / ELEMENT - 1e-9)), endpoint=False)
        for a, b in pairwise(fixed)
    ]
    return np.concatenate([*pieces, fixed[-1:]])


def _diameter(station: float) -> float:
    """Of the section that begins at or before a station."""
    ends = np.cumsum([length for length, _ in SECTIONS])
    return SECTIONS[int(np.searchsorted(ends, station + 1e-6))][1]


def _four(matrix: np.ndarray) -> np.ndarray:
    """From ROSS's x, y, z, turn about x, about y, about z: x, y and their slopes."""
    n = len(matrix) // 6
    turn = np.zeros((4, 6))
    turn[0, 0] = turn[1, 1] = turn[2, 4] = 1.0
    turn[3, 3] = -1.0
    every = np.kron(np.eye(n), turn)
    return every @ matrix @ every.T


# --- bearings


def bores(machine: Machine, run: Conditions, on: frozenset[str]) -> list[Bore]:
    """Of all bearings; the aft one is worn down.

    A bore that stays a circle has its bottom lower and the same top. A scar has a radius between
    that of the journal (Dufrane et al. 1983, turned at rest) and that of the bore (worn while the
    journal rides at changing attitudes), and leaves the rest of the bore as it was.
    """
    psi = 2 * pi * np.arange(N_PSI) / N_PSI
    side = np.minimum(np.abs(psi - pi / 2), np.abs(psi - 3 * pi / 2))
    grooved = side < GROOVE * 1.01 if "grooves" in on else np.zeros(N_PSI, dtype=bool)
    found = []
    for i, (_, diameter, length, _, _) in enumerate(BEARINGS):
        gap, depth = np.full(N_PSI, machine.clearance[i] / 2), run.wear_down if i == 0 else 0.0
        if "scar" in on:
            own = machine.scar * gap
            gap = np.maximum(gap, own - (gap - own + depth) * np.cos(psi))
        else:
            gap = gap + depth / 2 * (1 - np.cos(psi))
        found.append(Bore(radius=diameter / 2, length=length, gap=gap, grooved=grooved, n_z=N_Z[i]))
    return found


def bore_places(machine: Machine, run: Conditions, on: frozenset[str]) -> np.ndarray:
    """Middle and slope of the bores as new [shape=(5, 4)], hot and on a bent hull."""
    x = BEARINGS[:, 0]
    share = (x - x[0]) / (x[-1] - x[0])
    place = np.zeros((5, 4))
    place[:, 0] = machine.clearance / 2 + BEARINGS[:, 4] + run.hull * 4 * share * (1 - share)
    place[:, 2] = run.hull * 4 * (1 - 2 * share) / (x[-1] - x[0])
    place[2, 0] -= run.sag
    if "bores" in on:
        place[:, 1] += machine.side_offset
        place[:, 2:] += machine.slope
    return place


def pedestals(machine: Machine, on: frozenset[str], what: str = "stiffness") -> np.ndarray:
    """Stiffness or damping under the housings [shape=(5, 2, 2)]."""
    columns = machine.housing[:, 1:3] if what == "stiffness" else machine.housing[:, 3:5]
    angle = machine.principal if "housing" in on else np.zeros(5)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.einsum("ijb,bj,kjb->bik", turn, columns, turn)


# --- the line at rest


@dataclass(frozen=True, kw_only=True)
class Rest:
    """A line on its films.

    Attributes
    ----------
    places : numpy.ndarray [shape=(5, 4)]
        Of the journals from the middle of the bores as new: up, side, slopes.
    films : list of Film
    warmer : numpy.ndarray [shape=(5,)]
        Films than the oil noted [K].
    """

    places: np.ndarray
    films: list[Film]
    warmer: np.ndarray


def coupling_spring(machine: Machine, on: frozenset[str]) -> np.ndarray:
    """What the coupling adds to the stiffness of the shaft's last node [shape=(4,)]."""
    values = [COUPLING_STIFFNESS] * 2 + [COUPLING_BENDING] * 2
    return np.array(values) if "coupling" in on else np.zeros(4)


def steady_load(machine: Machine, run: Conditions, on: frozenset[str]) -> np.ndarray:
    """Weight, thrust and coupling on the shaft [shape=(4 n,)]."""
    shaft = beam()
    load = shaft.weight.copy()
    aft, forward = shaft.at(DISCS[0, 0]), shaft.at(DISCS[-1, 0])
    load[aft + 2] -= run.thrust * THRUST_HEIGHT
    load[aft + 3] -= run.thrust * THRUST_SIDE
    angle = machine.coupling_direction if "coupling" in on else 0.0
    pull = COUPLING_STIFFNESS * run.coupling_offset
    load[forward : forward + 2] += pull * np.array([np.cos(angle), np.sin(angle)])
    if "coupling" in on:
        # the motor stands at the height of the shaft's end in hot, straight bearings
        level = BEARINGS[-1, 4] + BEARINGS[-1, 3] / 2
        load[forward] += COUPLING_STIFFNESS * level
        load[forward + 2] += COUPLING_BENDING * machine.coupling_angle
    return load


def balance(machine: Machine, run: Conditions, on: frozenset[str]) -> Rest:
    """Journals, films and beam in balance; heated films take a few rounds.

    Raises
    ------
    NoBalanceError
        A journal touches its bore, or no balance was found.
    """
    problem = _Line(machine, run, on)
    warmer = np.zeros(5)
    found = problem.solve(problem.first(), warmer)
    for _ in range(4 if "thermal" in on else 0):
        heat = [
            HEAT_KEPT * film.friction / (OIL_DENSITY * OIL_HEAT * max(film.leakage, 1e-9))
            for film in found[1]
        ]
        warmer = 0.5 * (warmer + np.minimum(heat, HOTTEST))
        found = problem.solve(found[0], warmer)
    return Rest(places=found[0].reshape(5, 4), films=found[1], warmer=warmer)


class _Line:
    """The balance as a function of the journals' places r [shape=(20,)]."""

    def __init__(self, machine: Machine, run: Conditions, on: frozenset[str]) -> None:
        shaft = beam()
        held = np.concatenate([shaft.at(x) + np.arange(4) for x in BEARINGS[:, 0]])
        free = np.setdiff1d(np.arange(len(shaft.weight)), held)
        stiffness, load = shaft.stiffness.copy(), steady_load(machine, run, on)
        end = shaft.at(DISCS[-1, 0]) + np.arange(4)
        stiffness[end, end] += coupling_spring(machine, on)
        onto = np.linalg.solve(stiffness[np.ix_(free, free)], stiffness[np.ix_(free, held)])
        self.stiffness = stiffness[np.ix_(held, held)] - stiffness[np.ix_(held, free)] @ onto
        self.load = load[held] - onto.T @ load[free]
        self.bores, self.run = bores(machine, run, on), run
        self.middle = bore_places(machine, run, on).ravel()
        self.give = np.zeros((20, 20))
        for i, each in enumerate(pedestals(machine, on)):
            self.give[4 * i : 4 * i + 2, 4 * i : 4 * i + 2] = np.linalg.inv(each)

    def first(self) -> np.ndarray:
        """Journals a third of the way down in their bores."""
        place = np.zeros((5, 4))
        for r, bore in zip(place, self.bores, strict=True):
            bottom, top = bore.gap[N_PSI // 2], bore.gap[0]
            r[0] = (top - bottom) / 2 - 0.3 * (top + bottom) / 2
            r[1] = 0.1 * top
        return place.ravel()

    def films(self, place: np.ndarray, warmer: np.ndarray, share: float, filled) -> list | None:
        oils = share * np.array([viscosity(self.run.temperature + k) for k in warmer])
        found = []
        for i, bore in enumerate(self.bores):
            film = solve_film(
                bore, oils[i], 2 * pi * self.run.speed_hz, place[4 * i : 4 * i + 4], filled[i]
            )
            if film is None:
                return None
            found.append(film)
        return found

    def solve(self, place: np.ndarray, warmer: np.ndarray):
        """Places and films, if need be by way of thicker oil."""
        for shares in ((1.0,), (8.0, 4.0, 2.0, 1.4, 1.0), (64.0, 30.0, 15.0, 8.0, 5.0, 3.0)):
            found = (place, [None] * 5)
            for share in (*shares, *((2.0, 1.6, 1.3, 1.1, 1.0) if shares[-1] > 1 else ())):
                found = self.newton(found[0], warmer, share)
                if found is None:
                    break
            if found is not None:
                return found
            place = self.first()
        raise NoBalanceError(f"no balance of {self.run}")

    def newton(self, place: np.ndarray, warmer: np.ndarray, share: float):
        films = self.films(place, warmer, share, [None] * 5)
        for _ in range(60):
            if films is None:
                return None
            force = np.concatenate([film.force for film in films])
            softened = np.zeros((20, 20))
            for i, film in enumerate(films):
                softened[4 * i : 4 * i + 4, 4 * i : 4 * i + 4] = film.stiffness
            left = self.stiffness @ (self.middle + place - self.give @ force) - self.load - force
            if np.abs(left).max() < 1e-3:  # [N] and [N m], of tens of kilonewtons
                return place, films
            slope = self.stiffness @ (np.eye(20) + self.give @ softened) + softened
            step = -np.linalg.solve(slope, left)
            step *= min(1.0, 0.7 * self.room(place, step))
            filled = [film.filled for film in films]
            films = self.films(place + step, warmer, share, filled)
            place = place + step
        return None

    def room(self, place: np.ndarray, step: np.ndarray) -> float:
        """Share of the step at which a journal would touch."""
        psi = 2 * pi * np.arange(N_PSI) / N_PSI
        look = np.array([np.cos(psi), np.sin(psi)])
        least = np.inf
        for i, bore in enumerate(self.bores):
            for z in (-bore.length / 2, bore.length / 2):
                r, d = (v[4 * i : 4 * i + 2] + z * v[4 * i + 2 : 4 * i + 4] for v in (place, step))
                gap, closing = bore.gap - r @ look, d @ look
                least = min(least, (gap / np.maximum(closing, 1e-15)).min())
        return least
