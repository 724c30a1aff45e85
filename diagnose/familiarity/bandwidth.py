"""Whether a channel's band ends below where it did in training: by a filter, or a loose mounting.

A knock is short, so it sounds in all bands. A channel whose highest band is far quieter than those
below suggest was cut off, which no level of noise tells: a clean sensor is quiet there as well,
but not during a knock.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..feature_rows.physical import Columns, columns_of

Float = NDArray[np.float64]

CUT_OFF_SHARE = 0.005
"""Of familiar recordings, in each channel: that may be cautioned for it."""

_STILL = 1e-6  # dB^2: a middle that varies less is constant
_MIDDLE = (0.2, 0.4)  # of the highest frequency, which the highest band is held against


class UsualTops(NamedTuple):
    """Level of the highest band to expect from the middle ones, of channels with a map.

    Attributes
    ----------
    offset, slope : numpy.ndarray [shape=(n_channels,)]
        ``top = offset + slope * middle`` [dB].
    most : numpy.ndarray [shape=(n_channels,)]
        How far the highest band of few familiar recordings is below that [dB].
    """

    offset: Float
    slope: Float
    most: Float


class CutOff(NamedTuple):
    """A channel that lacks its highest band.

    Attributes
    ----------
    channel : str
    edge_hz : float
        Where that band begins.
    lacking_db, most_db : float
        How far it is below what is to be expected, and may be [dB].
    """

    channel: str
    edge_hz: float
    lacking_db: float
    most_db: float


def fit_tops(names: Sequence[str], rows: Float) -> UsualTops:
    """Learn what the highest band of each channel is beside the middle ones.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
        Of familiar recordings.

    Returns
    -------
    UsualTops
        By least squares; a level where the middle never varies.

    Examples
    --------
    >>> names = ["a.band_200_400.level_db", "a.band_400_1000.level_db"]
    >>> names += [f"a.angle_{i:03d}_{i + 180:03d}.band_200_1000.level_db" for i in (0, 180)]
    >>> rows = np.array([[0.0, -5.0, 0, 0], [10.0, 0.0, 0, 0]])
    >>> [part.round(6).tolist() for part in fit_tops(names, rows)[:2]]
    [[-5.0], [0.5]]
    """
    offset, slope, most = np.zeros((3, len(_knocking(names))))
    for i, columns in enumerate(_knocking(names).values()):
        middle, top = _levels(columns, rows)
        spread = middle - middle.mean()
        slope[i] = float(spread @ top) / max(float(spread @ spread), _STILL * len(rows))
        offset[i] = float(top.mean() - slope[i] * middle.mean())
        short = offset[i] + slope[i] * middle - top
        most[i] = max(float(np.quantile(short, 1.0 - CUT_OFF_SHARE, method="higher")), 0.0)
    return UsualTops(offset, slope, most)


def cut_off(names: Sequence[str], row: Float, usual: UsualTops) -> list[CutOff]:
    """Channels of a recording that lack their highest band.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]
    usual : UsualTops
    """
    found = []
    for (channel, columns), offset, slope, most in zip(
        _knocking(names).items(), *usual, strict=True
    ):
        middle, top = _levels(columns, row[None, :])
        lacking = float(offset + slope * middle[0] - top[0])
        if lacking > most:
            found.append(CutOff(channel, columns.edges[-1][0], lacking, float(most)))
    return found


def tops_in(names: Sequence[str]) -> int:
    """Number of channels of :class:`UsualTops`."""
    return len(_knocking(names))


def _knocking(names: Sequence[str]) -> dict[str, Columns]:
    """Channels that have a crank-angle map, and bands enough."""
    return {
        channel: columns
        for channel, columns in columns_of(tuple(names)).items()
        if columns.cells and len(columns.bands) > 1 and _middle(columns)
    }


def _middle(columns: Columns) -> list[int]:
    """Places of the middle bands among all."""
    highest = columns.edges[-1][1]
    low, high = (share * highest for share in _MIDDLE)
    return [i for i, (a, b) in enumerate(columns.edges[:-1]) if low <= a and b <= high]


def _levels(columns: Columns, rows: Float) -> tuple[Float, Float]:
    """Of the middle bands together, and of the highest [dB, shape=(n,)]."""
    bands = rows[:, columns.bands]
    middle = 10 * np.log10((10 ** (bands[:, _middle(columns)] / 10)).sum(axis=1))
    return middle, bands[:, -1]
