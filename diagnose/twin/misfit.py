"""Whether the recordings could be of any machine of the ensemble, and where they could not.

A level that no machine of the scene shows is no matter of its numbers: it is another machine, a
wrong channel, a wrong geometry.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .levels import LevelLayout

Float = NDArray[np.float64]

LEAST_SCATTER = 1.0
"""Added to the scatter of a level [dB]: models of machines agree with machines no better."""
MAP_NUGGET = 0.05
"""Part of a level's variance that belongs to each recording alone."""
SPECTRUM_NUGGET = 1.0
"""The same of the spectrum: so large that a spectrum far out along what the members differ in, as
that of noise or of a quiet machine, is far from them too."""
VIEWS = 3
"""Map, spectrum and change over a turn: the worst of three shares is as rare as thrice it says."""
TAIL = 0.1
"""Farthest members, whose mean excess continues the distribution of distances beyond them."""
MAP_EXCESS, SPECTRUM_EXCESS = 0.9, 1.15
"""That excess at the least, in distances from the median to the edge of the farthest members: a
hundred members may lack the rare machines that are far out. Mean of 780 machines simulated apart
from six ensembles."""
LEAST_P = 0.02
"""Of a machine of the scene, below which recordings are refused."""
FAR_BETTER = 5.0
"""Times as likely with the channels in another order, or of another kind: then they are."""
LEAST_REGIME_P = 0.01
"""Of a machine of the scene, below which another lubrication is believed. Together with `LEAST_P`
at most three of a hundred machines of the scene are refused."""
OILED = "bilge-pump-oiled"
"""Recipe with the lubrications of a crank pin."""
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
        Share of the scene's machines that are as far from the others, by map or by spectrum, or
        that change as little over a turn.
    channel : str
        Where it is worst.
    band_hz : tuple of float
    angle_deg : tuple of float
    level_db : float
        There, above what the nearest machine shows; below it where negative.
    order : tuple of str
        Channels in the order in which they would fit far better; empty where there is none.
    regime : str
        Lubrication of the crank pin that they sound like; empty where it is that of the scene.
    regime_p : float
        Share of the scene's machines that sound as much like it.
    even : bool
        It is by how little they change over a turn, as noise does, that they are worst.
    """

    p: float
    channel: str
    band_hz: tuple[float, float]
    angle_deg: tuple[float, float]
    level_db: float
    order: tuple[str, ...] = ()
    regime: str = ""
    regime_p: float = 1.0
    even: bool = False

    @property
    def refused(self) -> bool:
        """Whether no calibration mends it."""
        return self.p < LEAST_P or bool(self.order or self.regime)

    @property
    def text(self) -> str:
        """Where it is worst, in words."""
        if self.even:
            return (
                "levels change less over a turn of the crank than those of any machine of this "
                f"scene, as noise does (p = {self.p:.2g})"
            )
        low, high = (f"{each / 1000:.2g}" for each in self.band_hz)
        side = "above" if self.level_db > 0 else "below"
        return (
            f"{self.channel}, {low} to {high} kHz, crank angle {self.angle_deg[0]:.0f} to "
            f"{self.angle_deg[1]:.0f} deg: {abs(self.level_db):.1f} dB {side} the nearest machine "
            f"of this scene (p = {self.p:.2g})"
        )


def misfit(layout: LevelLayout, rows: Float, observed: Float) -> Misfit:
    """Distance of recordings from an ensemble, against that of its own members.

    Parameters
    ----------
    layout : LevelLayout
    rows : ndarray [shape=(n, n_runs, n_levels)]
        Of the members.
    observed : ndarray [shape=(n_runs, n_levels)]
        Of the recordings.

    Notes
    -----
    Of map and spectrum each the predictive variance of a Gaussian process with a linear kernel,
    left out one by one for the members.
    """
    channels = layout.channels
    found = _judged(layout, rows, observed, range(len(channels)))
    if found.p > DOUBT:
        return found
    for order in itertools.permutations(range(len(channels))):
        if far_better(_judged(layout, rows, observed, order), found):
            return replace(found, order=tuple(channels[i] for i in order))
    return found


def far_better(other: Misfit, found: Misfit) -> bool:
    """Whether recordings fit elsewhere, and far better than where they were looked for."""
    return other.p > max(LEAST_P, FAR_BETTER * found.p)


def tail_share(own: Float, here: float, least_excess: float = 0.0) -> float:
    """Share of distances that are as large; beyond the largest ones by an exponential tail.

    Its scale is the mean excess of the largest tenth, or `least_excess` times the distance from the
    median to them where that is more.

    Examples
    --------
    >>> own = np.arange(100.0)
    >>> round(tail_share(own, 50.0), 2), round(tail_share(own, 110.0), 3)
    (0.5, 0.002)
    """
    middle, edge = np.quantile(own, (0.5, 1 - TAIL))
    if here <= edge:
        return max(TAIL, float((own >= here).mean()))
    excess = max((own[own > edge] - edge).mean(), least_excess * (edge - middle))
    return TAIL * float(np.exp(-(here - edge) / excess))


def _judged(layout: LevelLayout, rows: Float, observed: Float, order: Sequence[int]) -> Misfit:
    """Misfit with the channels in an order, of the view that it is worse in."""
    places = list(order)
    map_p, map_left = _distance(
        layout.map_of(rows), layout.map_of(observed)[:, places], MAP_NUGGET, MAP_EXCESS
    )
    p, left = _distance(
        layout.spectrum_of(rows),
        layout.spectrum_of(observed)[:, places],
        SPECTRUM_NUGGET,
        SPECTRUM_EXCESS,
    )
    even = tail_share(
        -_swing(layout.map_of(rows)), -float(_swing(layout.map_of(observed))), MAP_EXCESS
    )
    of_all = min(1.0, VIEWS * min(map_p, p, even))
    if min(map_p, p) <= even:
        return _worst(layout, map_left, of_all) if map_p <= p else _line(layout, left, of_all)
    return replace(_worst(layout, map_left, of_all), even=True)


def _swing(levels: Float) -> Float:
    """How much levels change over a turn: noise that knows no crank changes least [log dB]."""
    return np.asarray(np.log(levels.std(axis=-2).mean(axis=(-3, -2, -1))))


def _distance(members: Float, here: Float, part: float, least_excess: float) -> tuple[float, Float]:
    """Share of members as far from the others, and what is left of the recordings [dB]."""
    flat = np.concatenate([members, here[np.newaxis]]).reshape(len(members) + 1, -1)
    scatter = np.sqrt(flat[:-1].var(axis=0) + LEAST_SCATTER**2)
    scaled = (flat - flat[:-1].mean(axis=0)) / scatter
    products = scaled @ scaled[:-1].T / scaled.shape[1]
    inner, last = products[:-1], products[-1]
    nugget = part * np.mean(np.diag(inner))
    inverse = np.linalg.inv(inner + nugget * np.eye(len(inner)))
    weights = inverse @ last
    own = np.log(1 / np.diag(inverse))
    distance = np.log((scaled[-1] ** 2).mean() + nugget - last @ weights)
    left = (scaled[-1] - weights @ scaled[:-1]) * scatter
    return tail_share(own, float(distance), least_excess), left.reshape(here.shape)


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


def _line(layout: LevelLayout, residual: Float, p: float) -> Misfit:
    """Channel and band of the map whose lines have the largest residual of all runs together."""
    edges, points = layout.edges, layout.points
    bands = np.searchsorted(edges, points, side="right") - 1
    inside = [i for i in range(len(edges) - 1) if (bands == i).any()]
    means = residual.mean(axis=0)
    cells = np.stack([means[:, bands == i].mean(axis=-1) for i in inside], axis=-1)
    channel, place = np.unravel_index(np.argmax(np.abs(cells)), cells.shape)
    band = inside[int(place)]
    return Misfit(
        p=p,
        channel=layout.channels[channel],
        band_hz=(float(edges[band]), float(edges[band + 1])),
        angle_deg=(0.0, 360.0),
        level_db=float(cells[channel, place]),
    )


def refusal(scene: str, files: Sequence[str], found: Misfit) -> str:
    """Why recordings are refused."""
    who = ", ".join(files) or "recordings"
    if found.order:
        return (
            f"{who}: channels must be in the order of the scene {scene}; they fit far better as "
            f"{', '.join(found.order)} (p = {found.p:.2g} as they are); check which sensor is which"
        )
    if found.regime:
        return (
            f"{who}: p = {found.regime_p:.3g} must be >= {LEAST_REGIME_P:g}, or the crank pin is "
            f"not dry as in the scene {scene}: it sounds as if it ran in oil, most like "
            f"{found.regime}; take recipe {OILED}, set joint.crankpin.rung, or check the pressures"
        )
    return (
        f"{who}: p = {found.p:.3g} must be >= {LEAST_P:g}, or no "
        f"machine of the scene {scene} sounds so: {found.text}; check channels and their order, "
        "throws, geometry, conditions, and whether it is this machine"
    )
