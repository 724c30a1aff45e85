"""Whether the recordings fit any machine of the ensemble, and where they do not.

A level that no machine of the scene shows is not a question of its parameters: it means another
machine, a wrong channel or a wrong geometry.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .levels import LevelLayout

Float = NDArray[np.float64]

LEAST_SCATTER = 1.0
"""Added to the scatter of a level [dB]: models agree with real machines no better."""
MAP_NUGGET = 0.05
"""Share of a level's variance that is specific to each recording."""
SPECTRUM_NUGGET = 1.0
"""The same for the spectrum: so large that a spectrum that is extreme along directions in which the
members differ, such as that of noise or of a quiet machine, is also far from them."""
VIEWS = 3
"""Map, spectrum and change over a revolution: Bonferroni factor of the smallest of three shares."""
TAIL = 0.1
"""Share of farthest members, whose mean excess extrapolates the distribution of distances."""
MAP_EXCESS, SPECTRUM_EXCESS = 0.9, 1.15
"""Smallest mean excess, over the distance from the median to the edge of the farthest members: a
hundred members may lack rare extreme machines. Mean of 780 machines simulated in addition to six
ensembles."""
LEAST_P = 0.02
"""P-value of a machine of the scene, below which recordings are refused."""
FAR_BETTER = 5.0
"""Ratio of p-values above which another channel order, or another kind of machine, is assumed."""
LEAST_REGIME_P = 0.01
"""P-value of a machine of the scene, below which another lubrication is assumed. Together with
`LEAST_P` at most three of a hundred machines of the scene are refused."""
OILED = "bilge-pump-oiled"
"""Recipe with the lubrications of a crank pin."""
DOUBT = 0.2
"""P-value above which the order of channels is not questioned."""
SECTORS = 12
"""Sectors of the crank angle in texts."""


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """Distance between recordings and the machines of the scene.

    Attributes
    ----------
    p : float
        Share of the scene's machines that are as far from the others, by map or by spectrum, or
        that change as little over a revolution.
    channel : str
        Channel with the largest misfit.
    band_hz : tuple of float
    angle_deg : tuple of float
    level_db : float
        Level there relative to the nearest machine.
    order : tuple of str
        Order of channels with a far better fit; empty if there is none.
    regime : str
        Lubrication of the crank pin that they resemble; empty if it is that of the scene.
    regime_p : float
        Share of the scene's machines that resemble it as much.
    even : bool
        The largest misfit is that they change too little over a revolution, like noise.
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
        """Whether the recordings must be refused."""
        return self.p < LEAST_P or bool(self.order or self.regime)

    @property
    def text(self) -> str:
        """The largest misfit in words."""
        if self.even:
            return (
                "levels change less over a crank revolution than those of any machine of this "
                f"scene, like noise (p = {self.p:.2g})"
            )
        low, high = (f"{each / 1000:.2g}" for each in self.band_hz)
        side = "above" if self.level_db > 0 else "below"
        return (
            f"{self.channel}, {low} to {high} kHz, crank angle {self.angle_deg[0]:.0f} to "
            f"{self.angle_deg[1]:.0f} deg: {abs(self.level_db):.1f} dB {side} the nearest machine "
            f"of this scene (p = {self.p:.2g})"
        )


def misfit(layout: LevelLayout, rows: Float, observed: Float) -> Misfit:
    """Distance of recordings from an ensemble, relative to that of its own members.

    Parameters
    ----------
    layout : LevelLayout
    rows : ndarray [shape=(n, n_runs, n_levels)]
        Levels of the members.
    observed : ndarray [shape=(n_runs, n_levels)]
        Levels of the recordings.

    Notes
    -----
    The distance is the predictive variance of a Gaussian process with a linear kernel, separately
    for map and spectrum; for the members it is computed by leaving each one out.
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
    """Whether recordings fit an alternative, and far better than the assumption."""
    return other.p > max(LEAST_P, FAR_BETTER * found.p)


def tail_share(own: Float, value: float, least_excess: float = 0.0) -> float:
    """Share of distances that are as large as a value, with an exponential tail.

    The scale of the tail is the mean excess of the largest tenth, but at least `least_excess` times
    the distance from the median to these.

    Examples
    --------
    >>> own = np.arange(100.0)
    >>> round(tail_share(own, 50.0), 2), round(tail_share(own, 110.0), 3)
    (0.5, 0.002)
    """
    middle, edge = np.quantile(own, (0.5, 1 - TAIL))
    if value <= edge:
        return max(TAIL, float((own >= value).mean()))
    excess = max((own[own > edge] - edge).mean(), least_excess * (edge - middle))
    return TAIL * float(np.exp(-(value - edge) / excess))


def _judged(layout: LevelLayout, rows: Float, observed: Float, order: Sequence[int]) -> Misfit:
    """Misfit with the channels in a given order, for the view with the smallest share."""
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
    """Change of levels over a revolution [log dB]; smallest for noise unrelated to the crank."""
    return np.asarray(np.log(levels.std(axis=-2).mean(axis=(-3, -2, -1))))


def _distance(
    members: Float, observed: Float, part: float, least_excess: float
) -> tuple[float, Float]:
    """Share of members as far from the others, and residual of the recordings [dB]."""
    flat = np.concatenate([members, observed[np.newaxis]]).reshape(len(members) + 1, -1)
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
    return tail_share(own, float(distance), least_excess), left.reshape(observed.shape)


def _worst(layout: LevelLayout, residual: Float, p: float) -> Misfit:
    """Cell of channel, band and sector with the largest mean residual over the runs [dB]."""
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
    """Channel and band whose lines have the largest mean residual over the runs."""
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
    """Message on the refusal of recordings."""
    who = ", ".join(files) or "recordings"
    if found.order:
        return (
            f"{who}: channels must be in the order of the scene {scene}; they fit far better as "
            f"{', '.join(found.order)} (p = {found.p:.2g} as they are); check which sensor is which"
        )
    if found.regime:
        return (
            f"{who}: p = {found.regime_p:.3g} must be >= {LEAST_REGIME_P:g}, or the crank pin is "
            f"not dry as in the scene {scene}: it seems to run in oil, most likely "
            f"{found.regime}; take recipe {OILED}, set joint.crankpin.rung, or check the pressures"
        )
    return (
        f"{who}: p = {found.p:.3g} must be >= {LEAST_P:g}, or no "
        f"machine of the scene {scene} fits: {found.text}; check channels and their order, "
        "throws, geometry, conditions, and whether it is this machine"
    )
