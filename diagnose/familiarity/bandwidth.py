"""Whether a channel's band ends below that of the training, due to a filter or a loose mounting.

A knock is short and therefore excites all bands. If the highest band is far quieter than the lower
ones suggest, the channel was cut off. The noise level cannot show this: a clean sensor is quiet
there as well, but not during a knock.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..feature_rows.physical import Columns, columns_of

Float = NDArray[np.float64]

CUT_OFF_SHARE = 0.005
"""Share of familiar recordings that may get this caution, per channel."""

_STILL = 1e-6  # dB^2: middle bands that vary less are constant
_MIDDLE = (0.2, 0.4)  # of the highest frequency: bands compared with the highest one


class UsualTops(NamedTuple):
    """Expected level of the highest band, given the middle ones, for channels with a map.

    Attributes
    ----------
    offset, slope : numpy.ndarray [shape=(n_channels,)]
        ``top = offset + slope * middle`` [dB].
    most : numpy.ndarray [shape=(n_channels,)]
        Shortfall of the highest band that few familiar recordings exceed [dB].
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
        Lower edge of that band.
    lacking_db, most_db : float
        Shortfall relative to the expected level, and its limit [dB].
    """

    channel: str
    edge_hz: float
    lacking_db: float
    most_db: float


def fit_tops(names: Sequence[str], rows: Float) -> UsualTops:
    """Fit the expected level of each channel's highest band to the middle ones.

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
        Rows of familiar recordings.

    Returns
    -------
    UsualTops
        Least-squares fit; a constant if the middle bands do not vary.

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
        Names of the features.
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
    """Channels with a crank-angle map and enough bands."""
    return {
        channel: columns
        for channel, columns in columns_of(tuple(names)).items()
        if columns.cells and len(columns.bands) > 1 and _middle(columns)
    }


def _middle(columns: Columns) -> list[int]:
    """Indices of the middle bands."""
    highest = columns.edges[-1][1]
    low, high = (share * highest for share in _MIDDLE)
    return [i for i, (a, b) in enumerate(columns.edges[:-1]) if low <= a and b <= high]


def _levels(columns: Columns, rows: Float) -> tuple[Float, Float]:
    """Total level of the middle bands, and level of the highest [dB, shape=(n,)]."""
    bands = rows[:, columns.bands]
    middle = 10 * np.log10((10 ** (bands[:, _middle(columns)] / 10)).sum(axis=1))
    return middle, bands[:, -1]
