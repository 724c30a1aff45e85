"""Whether the recordings could be of any machine of the ensemble, and where they could not.

A level that no machine of the scene shows is no matter of its numbers: it is another machine, a
wrong channel, a wrong geometry.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from .levels import LevelLayout

Float = NDArray[np.float64]

LEAST_SCATTER = 1.0
"""Added to the scatter of a level [dB]: models of machines agree with machines no better."""
NUGGET = 0.05
"""Part of a level's variance that belongs to each recording alone."""
LEAST_P = 0.02
"""Of a machine of the scene, below which recordings are refused."""
OTHER_ORDER = 5.0
"""Times as likely with the channels in another order: then they are."""
DOUBT = 0.2
"""Of recordings that fit no worse than this the order of channels is not asked."""
SECTORS = 12
"""Of the crank angle, for words."""


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """How far recordings are from what machines of the scene can show.

    Attributes
    ----------
    p : float
        Share of the scene's machines that are as far from the others.
    channel : str
        Where it is worst.
    band_hz : tuple of float
    angle_deg : tuple of float
    level_db : float
        There, above what the nearest machine shows; below it where negative.
    order : tuple of str
        Channels in the order in which they would fit far better; empty where there is none.
    """

    p: float
    channel: str
    band_hz: tuple[float, float]
    angle_deg: tuple[float, float]
    level_db: float
    order: tuple[str, ...] = ()

    @property
    def refused(self) -> bool:
        """Whether no calibration mends it."""
        return self.p < LEAST_P or bool(self.order)

    @property
    def text(self) -> str:
        """Where it is worst, in words."""
        low, high = (f"{each / 1000:.2g}" for each in self.band_hz)
        side = "above" if self.level_db > 0 else "below"
        return (
            f"{self.channel}, {low} to {high} kHz, crank angle {self.angle_deg[0]:.0f} to "
            f"{self.angle_deg[1]:.0f} deg: {abs(self.level_db):.1f} dB {side} the nearest machine "
            f"of this scene (p = {self.p:.2g})"
        )


def misfit(layout: LevelLayout, rows: Float, observed: Float) -> Misfit:
    """Distance of recordings from the span of an ensemble, against that of its own members.

    Parameters
    ----------
    layout : LevelLayout
    rows : ndarray [shape=(n, n_runs, n_levels)]
        Of the members.
    observed : ndarray [shape=(n_runs, n_levels)]
        Of the recordings.

    Notes
    -----
    The predictive variance of a Gaussian process with a linear kernel, left out one by one for the
    members; their logarithms are taken as normal.
    """
    members, here = layout.map_of(rows), layout.map_of(observed)
    found = _distance(layout, members, here)
    if found.p > DOUBT:
        return found
    for order in itertools.permutations(range(len(layout.channels))):
        if _distance(layout, members, here[:, list(order)]).p > OTHER_ORDER * found.p:
            return replace(found, order=tuple(layout.channels[i] for i in order))
    return found


def _distance(layout: LevelLayout, members: Float, here: Float) -> Misfit:
    """Misfit of maps, with the channels as they stand."""
    maps = np.concatenate([members, here[np.newaxis]])
    flat = maps.reshape(len(maps), -1)
    scatter = np.sqrt(flat[:-1].var(axis=0) + LEAST_SCATTER**2)
    scaled = (flat - flat[:-1].mean(axis=0)) / scatter
    products = scaled @ scaled[:-1].T / scaled.shape[1]
    inner, last = products[:-1], products[-1]
    nugget = NUGGET * np.mean(np.diag(inner))
    inverse = np.linalg.inv(inner + nugget * np.eye(len(inner)))
    weights = inverse @ last
    own = np.log(1 / np.diag(inverse))
    distance = np.log((scaled[-1] ** 2).mean() + nugget - last @ weights)
    p = float(ndtr(-(distance - own.mean()) / own.std()))
    left = (scaled[-1] - weights @ scaled[:-1]) * scatter
    return _worst(layout, left.reshape(maps.shape[1:]), p)


def _worst(layout: LevelLayout, residual: Float, p: float) -> Misfit:
    """Cell of channel, band and sector with the largest residual of all runs together [dB]."""
    runs, channels, bins, bands = residual.shape
    cells = residual.reshape(runs, channels, SECTORS, bins // SECTORS, bands).mean(axis=(0, 3))
    channel, sector, band = np.unravel_index(np.argmax(np.abs(cells)), cells.shape)
    edges = layout.edges
    width = 360 / SECTORS
    return Misfit(
        p=p,
        channel=layout.channels[channel],
        band_hz=(float(edges[band]), float(edges[band + 1])),
        angle_deg=(float(sector * width), float((sector + 1) * width)),
        level_db=float(cells[channel, sector, band]),
    )


def refusal(scene: str, files: Sequence[str], found: Misfit) -> str:
    """Why recordings are refused."""
    who = ", ".join(files) or "recordings"
    if found.order:
        return (
            f"{who}: channels must be in the order of the scene {scene}; they fit far better as "
            f"{', '.join(found.order)} (p = {found.p:.2g} as they are); check which sensor is which"
        )
    return (
        f"{who}: p = {found.p:.2g} must be >= {LEAST_P:g}, or no "
        f"machine of the scene {scene} sounds so: {found.text}; check channels and their order, "
        "throws, geometry, conditions, and whether it is this machine"
    )
