"""The beam condensed to its bearings: height, side and both slopes of each."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ..beam.beam import Beam
from .film_bearing import FilmBearing

Vector = NDArray[np.float64]


class CondensedLine(NamedTuple):
    """Beam and bores; the order within a bearing is y, z, y', z', for a film X, Y and the tilts."""

    bearings: tuple[FilmBearing, ...]
    speed: float
    stiffness: Vector  # of the beam at the bearings (4 b, 4 b)
    pull: Vector  # of the beam on the journals, each in the middle of its bore (4 b,)
    bores: Vector  # positions of the unloaded bores (4 b,)
    pedestals: tuple[tuple[float, float], ...]
    flexibility: Vector  # of the pedestals (4 b,)
    scale: Vector  # journal position per film coordinate (4 b,)
    work: Vector  # unit of force times that of length (4 b,)
    spread: Callable[[Vector], Vector]  # displacements at bearings -> deflection of the beam


def condensed_line(
    beam: Beam,
    bearings: Sequence[FilmBearing],
    speed: float,
    pedestals: Sequence[tuple[float, float]] | None,
) -> CondensedLine:
    """Condense beam and bores of a rotating shaft; raises ValueError for arguments out of range."""
    if not 0 < speed < math.inf:
        raise ValueError(
            f"speed = {speed} rad/s must be > 0 and finite; a film needs a turning shaft"
        )
    nodes = bearing_nodes(beam, bearings)
    stiffness, load, spread = condensed(beam, nodes)
    own, stiff = [b.worn for b in bearings], _checked_pedestals(bearings, pedestals)
    bores = np.array([[*b.centre, *b.slope] for b in bearings]).ravel()
    scale = -np.array([[b.clearance] * 2 + [b.clearance / b.length] * 2 for b in own]).ravel()
    work = np.repeat([b.force_unit(speed) * b.clearance for b in own], 4)
    return CondensedLine(
        bearings=tuple(bearings),
        speed=speed,
        stiffness=stiffness,
        pull=load - stiffness @ bores,
        bores=bores,
        pedestals=stiff,
        flexibility=np.pad(1 / np.array(stiff), ((0, 0), (0, 2))).ravel(),
        scale=scale,
        work=work,
        spread=spread,
    )


def bearing_nodes(beam: Beam, bearings: Sequence[FilmBearing]) -> list[int]:
    """Beam nodes of the bearings; raises ValueError if two share a name or a node."""
    if not bearings:
        raise ValueError("bearings = () must hold at least one; a shaft needs a support")
    nodes = [beam.node(b.station) for b in bearings]
    for what, values in (("name", [b.name for b in bearings]), ("node of the beam", nodes)):
        if len(set(values)) < len(values):
            raise ValueError(
                f"bearings have the {what}s {values} and must differ in it; rename or move one"
            )
    return nodes


def condensed(
    beam: Beam, nodes: Sequence[int]
) -> tuple[Vector, Vector, Callable[[Vector], Vector]]:
    """Stiffness and load at the bearings, and the expansion to the rest of the beam."""
    kept = (4 * np.array(nodes)[:, None] + np.array([0, 2, 1, 3])).ravel()
    count = beam.stiffness.shape[0]
    rest = np.setdiff1d(np.arange(count), kept)
    rows = beam.stiffness.tocsc()
    own, across = rows[kept][:, kept].toarray(), rows[rest][:, kept].toarray()
    load = np.asarray(beam.load, dtype=float)
    if rest.size == 0:
        still, shape = np.zeros(0), np.zeros((0, kept.size))
    else:
        factors = splu(rows[rest][:, rest].tocsc())
        still, shape = factors.solve(load[rest]), factors.solve(across)

    def spread(places: Vector) -> Vector:
        deflection = np.empty(count)
        deflection[kept] = places
        deflection[rest] = still - shape @ places
        return deflection

    stiffness = own - across.T @ shape
    return 0.5 * (stiffness + stiffness.T), load[kept] - across.T @ still, spread


def _checked_pedestals(
    bearings: Sequence[FilmBearing], pedestals: Sequence[tuple[float, float]] | None
) -> tuple[tuple[float, float], ...]:
    if pedestals is None:
        return ((math.inf, math.inf),) * len(bearings)
    if len(pedestals) != len(bearings):
        raise ValueError(
            f"pedestals has {len(pedestals)} entries and must have {len(bearings)}, one for each "
            "bearing; math.inf is rigid"
        )
    for bearing, pair in zip(bearings, pedestals, strict=True):
        if not min(pair) > 0:
            raise ValueError(
                f"pedestals of '{bearing.name}' = {min(pair)} N/m must be > 0; math.inf is rigid"
            )
    return tuple((float(y), float(z)) for y, z in pedestals)
