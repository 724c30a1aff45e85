"""Level of each channel expected from the shape of its signal and the speed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.views import MARK
from ...sim.output.recording import Recording
from ..feature_rows.physical import level_channels, level_rows, shape_rows
from .fault import QualityFault

Float = NDArray[np.float64]

_QUIET = 1 / 30  # of the least trained level: neither wear nor speed makes a channel that quiet
_LEVEL_PENALTY = 30.0  # of a ridge on about a hundred standardised coordinates


@dataclass(frozen=True, kw_only=True)
class Levels:
    """Regression of the level of each channel on the shape of its signal and the speed.

    Attributes
    ----------
    centre, spread : numpy.ndarray [shape=(n_shapes,)]
        Mean and standard deviation of the coordinates of
        :func:`wearstate.diagnose.feature_rows.physical.shape_rows`.
    weight : numpy.ndarray [shape=(n_channels, n_shapes)]
        Slopes [dB].
    offset : numpy.ndarray [shape=(n_channels,)]
        Intercepts [dB re 1 x].
    size : numpy.ndarray [shape=(n_channels,)]
        Standard deviation of the residual on machines left out of the fit [dB].
    least : numpy.ndarray [shape=(n_channels,)]
        Lowest level of the training recordings [dB re 1 x].
    """

    centre: Float
    spread: Float
    weight: Float
    offset: Float
    size: Float
    least: Float

    def excess(self, names: Sequence[str], rows: Float) -> Float:
        """Level above the expected one [dB] [shape=(n, n_channels)]."""
        standard = np.clip((shape_rows(names, rows) - self.centre) / self.spread, -3.0, 3.0)
        return level_rows(names, rows) - (standard @ self.weight.T + self.offset)


def fit_levels(
    names: Sequence[str], rows: Float, folds: Sequence[tuple[NDArray[np.intp], NDArray[np.intp]]]
) -> Levels:
    """Fit the expected levels of training recordings.

    Parameters
    ----------
    names : sequence of str
        Feature names.
    rows : numpy.ndarray [shape=(n, n_features)]
    folds : sequence of (numpy.ndarray, numpy.ndarray)
        Records for fitting and for testing.

    Returns
    -------
    Levels
    """
    size = np.zeros((len(rows), len(level_channels(names))))
    for train, test in folds:
        size[test] = _levels(names, rows[train]).excess(names, rows[test])
    return replace(_levels(names, rows), size=np.sqrt((size**2).mean(axis=0)))


def _levels(names: Sequence[str], rows: Float) -> Levels:
    from sklearn.linear_model import Ridge

    inputs, level = shape_rows(names, rows), level_rows(names, rows)
    if not level.size or not inputs.size:  # no levels, or nothing to predict them from
        return _plain_levels(inputs, level)
    centre, spread = inputs.mean(axis=0), inputs.std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    ridge = Ridge(_LEVEL_PENALTY).fit((inputs - centre) / spread, level)
    return Levels(
        centre=centre,
        spread=spread,
        weight=np.atleast_2d(ridge.coef_),
        offset=np.atleast_1d(ridge.intercept_),
        size=np.zeros(level.shape[1]),
        least=level.min(axis=0),
    )


def _plain_levels(inputs: Float, level: Float) -> Levels:
    """Mean levels, for features that hold no shape."""
    shapes = inputs.shape[1]
    return Levels(
        centre=np.zeros(shapes),
        spread=np.ones(shapes),
        weight=np.zeros((level.shape[1], shapes)),
        offset=level.mean(axis=0),
        size=np.zeros(level.shape[1]),
        least=level.min(axis=0),
    )


def quiet_faults(
    recording: Recording, names: Sequence[str], row: Float, levels: Levels
) -> tuple[QualityFault, ...]:
    """Find channels so quiet that they can hold nothing but noise.

    Parameters
    ----------
    recording : Recording
    names : sequence of str
        Feature names.
    row : numpy.ndarray [shape=(n_features,)]
    levels : Levels

    Returns
    -------
    tuple of QualityFault
    """
    found = level_rows(names, row[None, :])[0]
    units = recording.units
    for view, each in recording.joined.items():
        units |= {f"{view}{MARK}{name}": unit for name, unit in each.units.items()}
    return tuple(
        QualityFault(
            kind="dead",
            channel=channel,
            text=f"channel {channel} has an rms of {10 ** (level / 20):.3g} {units[channel]}, must "
            f"be >= {10 ** (least / 20) * _QUIET:.3g} {units[channel]}: it is dead; check sensor "
            "and cable",
        )
        for channel, level, least in zip(level_channels(names), found, levels.least, strict=True)
        if level < least + 20 * np.log10(_QUIET)
    )
