"""One row of the catalogue: name, unit, needs, function and reference; labels common to many."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..signal.envelope import FaultLine
from ..signal.statistics import Real
from .analysis import FAULTS, Analysis, Settings

Float = NDArray[np.float64]
Scope = Literal["channel", "housing", "path", "pair", "shaft", "orbit", "frf", "cylinder"]

WELCH = "Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73"
RANDOM_DATA = "Bendat, Piersol, Random Data, 4th ed. (2010), chapter 9"
ROLLING_BEARING = "Randall, Antoni, Mech. Syst. Signal Process. 25 (2011) 485-520"
EWINS = "Ewins, Modal Testing, 2nd ed. (2000)"


@dataclass(frozen=True, kw_only=True)
class Feature:
    """One row of the catalogue.

    Parameters
    ----------
    name : str
        What it is, unique in the catalogue.
    unit : str
        Unit of its values; "x" stands for the unit of the signal.
    needs : tuple of str
        What it cannot be had without, keys of `needs.NEEDS`; nothing but a vibration by default.
    uses : tuple of str
        What else it takes into account where it is there; ``tacho`` alone has a meaning.
    scope : {"channel", "housing", "path", "pair", "shaft", "orbit", "frf", "cylinder"}
        Whether it exists once per channel, per acceleration, per path from a force to a channel
        that is none, per pair of channels, per record, per orbit, per test, or per cylinder
        pressure.
    labels : callable
        ``labels(settings, fs)`` names its values within one of these.
    function : callable
        ``function(analysis)`` gives them [shape=(n_channels, …), (n_paths, …), (n_pairs, …) or
        (…)].
    reference : str
        Where it is defined.

    Examples
    --------
    >>> from wearstate.features.catalogue.standard_rows import CATALOGUE
    >>> [feature.unit for feature in CATALOGUE if feature.name == "kurtosis"]
    ['-']
    """

    name: str
    unit: str
    needs: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    scope: Scope = "channel"
    labels: Callable[[Settings, float], tuple[str, ...]]
    function: Callable[[Analysis], NDArray[Any]]
    reference: str


def named(*labels: str) -> Callable[[Settings, float], tuple[str, ...]]:
    """Labels that no setting changes."""
    return lambda _settings, _fs: labels


def band_names(edges: Float) -> tuple[str, ...]:
    """Bands as text, in whole hertz."""
    bounds = np.rint(edges).astype(int)
    return tuple(f"band_{a}_{b}" for a, b in pairwise(bounds))


def order_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    """Levels of the orders of the settings."""
    return tuple(
        f"order_{int(k):02d}.level_db" if k == int(k) else f"order_{k:g}.level_db"
        for k in settings.orders
    )


def stacked(*columns: Real) -> Float:
    """Values of one channel side by side [shape=(n_channels, n_values)]."""
    return np.stack([np.asarray(column, dtype=np.float64) for column in columns], axis=-1)


def scores(lines: list[list[FaultLine | None]]) -> Float:
    """Scores of fault lines by channel, 0 where none was found [shape=(n_channels, n_faults)]."""
    return np.array([[line.score if line is not None else 0.0 for line in row] for row in lines])


def fault_labels(prefix: str, part: str) -> Callable[[Settings, float], tuple[str, ...]]:
    """One part of every fault of rolling bearings."""
    return named(*(f"{prefix}_{fault}.{part}" for fault in FAULTS))
