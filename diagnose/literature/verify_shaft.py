"""Literature checks of shafts: rotors, roots of beams, reactions on equal spans."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ...sim.alignment.alignment import AlignmentLine, influence, reactions
from ...sim.alignment.seats import Seat, seat_stations
from ...sim.beam.beam import assemble_beam
from ...sim.beam.beam_parts import Disc, Section
from ...sim.beam.modes import RotorModes, modes
from ...sim.beam.rotor import Rotor, Support


@dataclass(frozen=True, kw_only=True)
class _PublishedRotor:
    """Steel shaft of 1.5 m, 50 mm thick, with discs of (station, outer diameter), 70 mm thick."""

    stiffness: tuple[tuple[float, float], tuple[float, float]]  # y, z [N/m]
    damping: float = 0.0  # along y and z [N s/m]
    discs: tuple[tuple[float, float], ...] = ((0.5, 0.28), (1.0, 0.35))  # [m]
    stations: tuple[float, float] = (0.0, 1.5)  # of the supports [m]
    unit: str = "rad/s"  # of its printed frequencies
    rows: tuple[tuple[int, str, tuple[int, ...]], ...]  # speed [rpm], quantity, modes


_ROTORS = {
    "5.9.1": _PublishedRotor(
        stiffness=((1e6, 0.0), (0.0, 1e6)),
        rows=((0, "frequency", (1, 3, 5)), (4000, "frequency", (1, 2, 3, 4, 5))),
    ),
    "5.9.2": _PublishedRotor(
        stiffness=((0.8e6, 0.0), (0.0, 1e6)), rows=((0, "frequency", (1, 2, 3, 4, 5)),)
    ),
    "5.9.3": _PublishedRotor(
        stiffness=((0.2e6, 0.0), (0.0, 1e6)),
        unit="Hz",
        rows=((4000, "frequency", (1, 2, 3, 4, 5, 6)),),
    ),
    "5.9.4": _PublishedRotor(
        stiffness=((1e6, 0.5e6), (0.5e6, 1e6)),
        unit="Hz",
        rows=((0, "frequency", (1, 2, 3, 4, 5, 6)),),
    ),
    "5.9.5": _PublishedRotor(
        stiffness=((1e6, 0.0), (0.0, 1e6)),
        damping=3e3,
        unit="Hz",
        rows=(
            (0, "undamped frequency", (1, 3, 5)),
            (0, "frequency", (1, 3)),
            (4000, "undamped frequency", (1, 2, 3, 4, 5)),
        ),
    ),
    "5.9.9": _PublishedRotor(
        stiffness=((1e7, 0.0), (0.0, 1e7)),
        discs=((1.5, 0.35),),
        stations=(0.0, 1.0),
        rows=((0, "frequency", (1, 3, 5)), (4000, "frequency", (1, 2, 3, 4, 5, 6))),
    ),
}
"""Examples of Friswell et al. 2010, six elements each."""

_BEAM_ROOTS = {"pinned-pinned": 3, "clamped-free": 4, "clamped-clamped": 3, "clamped-pinned": 3}
"""Ends -> modes compared."""

_BEAM_ELEMENTS = 120  # (11 / 120)^4 / 2880 = 3e-8 of the last root


def _published_disc(station: float, outer: float) -> Disc:
    width, inner, density = 0.07, 0.05, 7810.0
    mass = density * math.pi / 4 * (outer**2 - inner**2) * width
    square = outer**2 + inner**2
    return Disc(
        station=station,
        mass=mass,
        polar_inertia=mass / 8 * square,
        diametral_inertia=mass / 48 * (3 * square + 4 * width**2),
    )


@cache
def _published_modes(name: str, speed_rpm: int) -> RotorModes:
    rotor = _ROTORS[name]
    shaft = Section(
        length=1.5, outer_diameter=0.05, young=211e9, shear_modulus=81.2e9, density=7810.0
    )
    beam = assemble_beam(
        [shaft],
        discs=[_published_disc(*disc) for disc in rotor.discs],
        longest_element=0.25,
        shear_coefficient="cowper",
    )
    supports = tuple(
        Support(
            name=f"{station:g} m",
            station=station,
            stiffness=rotor.stiffness,
            damping=rotor.damping * np.eye(2),
        )
        for station in rotor.stations
    )
    return modes(Rotor(beam=beam, supports=supports), speed_rpm * math.pi / 30)


def _published_frequency(name: str, speed_rpm: int, quantity: str, mode: int) -> float:
    found = _published_modes(name, speed_rpm)
    undamped = quantity == "undamped frequency"
    hertz = (found.undamped_frequency_hz if undamped else found.frequency_hz)[mode - 1]
    return float(hertz if _ROTORS[name].unit == "Hz" else 2 * math.pi * hertz)


@cache
def _beam_roots(ends: str) -> NDArray[np.float64]:
    """Roots beta L of a thin bar of 1 m [shape=(4,)]."""
    bar = Section(length=1.0, outer_diameter=0.01, young=2e11, shear_modulus=8e10, density=8e3)
    beam = assemble_beam([bar], longest_element=1 / _BEAM_ELEMENTS, theory="euler-bernoulli")
    first, last = ends.split("-")
    held = {"pinned": ["y"], "clamped": ["y", "slope_y"], "free": []}
    fixed = [beam.dof(0.0, c) for c in held[first]] + [beam.dof(1.0, c) for c in held[last]]
    plane = np.flatnonzero(np.arange(beam.n_dof) % 4 < 2)
    free = np.setdiff1d(plane, fixed)
    stiffness, mass = (m.toarray()[np.ix_(free, free)] for m in (beam.stiffness, beam.mass))
    highest = (free.size - 4, free.size - 1)
    inverse = linalg.eigh(mass, stiffness, eigvals_only=True, subset_by_index=highest)[::-1]
    roots: NDArray[np.float64] = (bar.density * bar.area / bar.bending_stiffness / inverse) ** 0.25
    return roots


def _beam_root(ends: str, mode: int) -> float:
    return float(_beam_roots(ends)[mode - 1])


@cache
def _equal_spans(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reactions over a span's load and influence over E I / L^3, ten elements in a span."""
    bar = Section(length=n - 1.0, outer_diameter=0.1, young=2e11, shear_modulus=8e10, density=8e3)
    seats = tuple(Seat(name=f"{i}", station=float(i)) for i in range(n))
    beam = assemble_beam(
        [bar], stations=seat_stations(seats), longest_element=0.1, theory="euler-bernoulli"
    )
    line = AlignmentLine(beam=beam, seats=seats)
    span = beam.weight / (n - 1)
    return reactions(line).reactions / span, influence(line) / bar.bending_stiffness


def _equal_reaction(n: int, i: int) -> float:
    return float(_equal_spans(n)[0][i - 1])


def _equal_influence(n: int, i: int, j: int) -> float:
    return float(_equal_spans(n)[1][i - 1, j - 1])


def alignment_checks() -> dict[str, Callable[[], float]]:
    """Checks of reactions and influence coefficients on equal spans."""
    table: dict[str, Callable[[], float]] = {}
    for n, half in ((3, 2), (4, 2), (5, 3), (6, 3)):  # the other half is the mirror
        for i in range(1, half + 1):
            name = f"equal spans: {n} supports, "
            table[f"{name}reaction {i} over the load of a span"] = partial(_equal_reaction, n, i)
            for j in range(1, n + 1):
                row = f"{name}influence of {j} on {i} times L^3/EI"
                table[row] = partial(_equal_influence, n, i, j)
    return table


def shaft_checks() -> dict[str, Callable[[], float]]:
    """Checks of roots of beams and of natural frequencies of rotors."""
    table: dict[str, Callable[[], float]] = {
        f"beam {ends}: root {mode}": partial(_beam_root, ends, mode)
        for ends, count in _BEAM_ROOTS.items()
        for mode in range(1, count + 1)
    }
    for name, rotor in _ROTORS.items():
        for speed_rpm, quantity, numbers in rotor.rows:
            for mode in numbers:
                row = f"rotor after Friswell, {name}, {speed_rpm} rpm: {quantity} {mode}"
                table[f"{row} [{rotor.unit}]"] = partial(
                    _published_frequency, name, speed_rpm, quantity, mode
                )
    return table
