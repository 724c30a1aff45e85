"""Whether the recordings could be of any machine of the ensemble, and where they could not.

A level that no machine of the scene shows is no matter of its numbers: it is another machine, a
wrong channel, a wrong geometry.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from .levels import LevelLayout

Float = NDArray[np.float64]

LEAST_SCATTER = 1.0
"""Added to the scatter of a level [dB]: models of machines agree with machines no better."""
NUGGET = 0.05
"""Part of a level's variance that belongs to each recording alone."""
LEAST_P = 0.005
"""Of a machine of the scene, below which recordings are refused."""
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
    """

    p: float
    channel: str
    band_hz: tuple[float, float]
    angle_deg: tuple[float, float]
    level_db: float

    @property
    def refused(self) -> bool:
        """Whether no calibration mends it."""
        return self.p < LEAST_P

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
    maps = layout.map_of(np.concatenate([rows, observed[np.newaxis]]))
    flat = maps.reshape(len(maps), -1)
    scatter = np.sqrt(flat[:-1].var(axis=0) + LEAST_SCATTER**2)
    scaled = (flat - flat[:-1].mean(axis=0)) / scatter
    products = scaled @ scaled[:-1].T / scaled.shape[1]
    inner, last = products[:-1], products[-1]
    inverse = np.linalg.inv(inner + NUGGET * np.mean(np.diag(inner)) * np.eye(len(inner)))
    weights = inverse @ last
    own = np.log(1 / np.diag(inverse))
    here = np.log((scaled[-1] ** 2).mean() + NUGGET * np.mean(np.diag(inner)) - last @ weights)
    p = float(ndtr(-(here - own.mean()) / own.std()))
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
    return (
        f"{', '.join(files) or 'recordings'}: p = {found.p:.2g} must be >= {LEAST_P:g}, or no "
        f"machine of the scene {scene} sounds so: {found.text}; check channels and their order, "
        "throws, geometry, conditions, and whether it is this machine"
    )
