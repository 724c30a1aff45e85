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
        Name, unique in the catalogue.
    unit : str
        Unit of its values; "x" stands for the unit of the signal.
    needs : tuple of str
        Requirements, keys of `needs.NEEDS`; by default only a vibration.
    uses : tuple of str
        Optional inputs that are used if available; only ``tacho`` has a meaning.
    scope : {"channel", "housing", "path", "pair", "shaft", "orbit", "frf", "cylinder"}
        Whether it exists once per channel, per acceleration, per path from a force to another
        channel, per pair of channels, per record, per orbit, per test, or per cylinder pressure.
    labels : tuple of str, or callable
        Names of the values within one of these, or ``labels(settings, fs)`` that gives them; by
        default one value, with the name of the feature.
    function : callable
        ``function(analysis)`` computes the values [shape=(n_channels, …), (n_paths, …), (n_pairs,
        …) or (…)].
    reference : str
        Source of the definition.

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
    labels: tuple[str, ...] | Callable[[Settings, float], tuple[str, ...]] = ()
    function: Callable[[Analysis], NDArray[Any]]
    reference: str

    def labels_for(self, settings: Settings, fs: float) -> tuple[str, ...]:
        """Labels at some settings and a sample rate [Hz]."""
        if callable(self.labels):
            return self.labels(settings, fs)
        return self.labels or (self.name,)


def band_names(edges: Float) -> tuple[str, ...]:
    """Names of bands, in whole hertz."""
    bounds = np.rint(edges).astype(int)
    return tuple(f"band_{a}_{b}" for a, b in pairwise(bounds))


def order_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    """Labels of the levels of the orders in the settings."""
    return tuple(
        f"order_{int(k):02d}.level_db" if k == int(k) else f"order_{k:g}.level_db"
        for k in settings.orders
    )


def stacked(*columns: Real) -> Float:
    """Columns of values, side by side for each channel [shape=(n_channels, n_values)]."""
    return np.stack([np.asarray(column, dtype=np.float64) for column in columns], axis=-1)


def scores(lines: list[list[FaultLine | None]]) -> Float:
    """Scores of fault lines by channel, 0 if none was found [shape=(n_channels, n_faults)]."""
    return np.array([[line.score if line is not None else 0.0 for line in row] for row in lines])


def fault_labels(prefix: str, part: str) -> tuple[str, ...]:
    """Labels of one part for every fault of rolling bearings."""
    return tuple(f"{prefix}_{fault}.{part}" for fault in FAULTS)
