"""Noise floor of a recording: how loud it is where the turn is quiet, against familiar machines.

A knock rings down within a small part of a turn. What the quietest angles still show in every band
is the noise of sensor, cable and surroundings, or another machine near by.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..feature_rows.physical import columns_of

Float = NDArray[np.float64]

NOISY_SHARE = 0.01
"""Of familiar recordings: that may be cautioned for their noise floor."""

_QUIET = 0.1  # of all angles are quieter than what counts as the floor: single cells scatter
_USUAL = 0.998  # of familiar recordings have less in a band than its ceiling
_BANDS = 2  # that must show it: one alone may be a resonance that rings all round
_NEVER = -1e4  # dB: no signal is so far below another


class NoiseFloor(NamedTuple):
    """Floor of a recording beside that of familiar ones.

    Attributes
    ----------
    channel : str
    excess_db : float
        Level of the floor above the loudest usual one [dB]; negative below it.
    """

    channel: str
    excess_db: float


def noise_floors(names: Sequence[str], rows: Float) -> dict[str, Float]:
    """Level of the quiet angles of every channel that has a crank-angle map.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]

    Returns
    -------
    dict of str to numpy.ndarray [shape=(n, n_bands)]
        By channel, in every band [dB].

    Examples
    --------
    >>> names = [f"a.angle_{i:03d}_{i + 90:03d}.band_50_66.level_db" for i in (0, 90, 180, 270)]
    >>> noise_floors(names, np.array([[3.0, -7.0, 9.0, 1.0]]))["a"].tolist()
    [[-7.0]]
    """
    return {
        channel: _quiet_cells(rows[:, columns.cells], columns.angles)
        for channel, columns in columns_of(tuple(names)).items()
        if columns.cells
    }


def _quiet_cells(cells: Float, angles: int) -> Float:
    levels = cells.reshape(len(cells), angles, -1)
    return np.asarray(np.sort(levels, axis=1)[:, int(_QUIET * angles)])


def floors_in(names: Sequence[str]) -> int:
    """Number of floors of all channels and bands."""
    maps = [columns for columns in columns_of(tuple(names)).values() if columns.cells]
    return sum(len(columns.cells) // columns.angles for columns in maps)


def fit_ceiling(names: Sequence[str], rows: Float) -> Float:
    """Loudest usual floor of every channel and band [dB, shape=(n_channels * n_bands,)]."""
    floors = [np.zeros((len(rows), 0)), *noise_floors(names, rows).values()]
    return np.asarray(np.quantile(np.hstack(floors), _USUAL, axis=0))


def floor_excess(names: Sequence[str], rows: Float, ceiling: Float) -> dict[str, Float]:
    """How far the floor of each channel is above the loudest usual one.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
    ceiling : numpy.ndarray [shape=(n_channels * n_bands,)]
        Of :func:`fit_ceiling` [dB].

    Returns
    -------
    dict of str to numpy.ndarray [shape=(n,)]
        By channel [dB]: in all but one band it is less.

    Examples
    --------
    >>> names = [f"a.angle_000_360.band_{f}_{2 * f}.level_db" for f in (50, 100, 200)]
    >>> floor_excess(names, np.array([[9.0, 4.0, 2.0]]), np.zeros(3))["a"].tolist()
    [4.0]
    """
    found, start = {}, 0
    for channel, floor in noise_floors(names, rows).items():
        bands = floor.shape[1]
        over = np.sort(floor - ceiling[start : start + bands], axis=1)
        found[channel], start = over[:, -min(_BANDS, bands)], start + bands
    return found


def loudest_floor(names: Sequence[str], rows: Float, ceiling: Float) -> Float:
    """Excess of the noisiest channel [dB, shape=(n,)]; very low where none has a map."""
    found = floor_excess(names, rows, ceiling)
    return np.asarray(np.max([np.full(len(rows), _NEVER), *found.values()], axis=0))


def noisiest(names: Sequence[str], row: Float, ceiling: Float) -> NoiseFloor | None:
    """Channel of a recording whose floor is the loudest beside the usual; None without a map.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]
    ceiling : numpy.ndarray [shape=(n_channels * n_bands,)]
        Of :func:`fit_ceiling` [dB].
    """
    found = floor_excess(names, row[None, :], ceiling)
    each = [NoiseFloor(channel, float(excess[0])) for channel, excess in found.items()]
    return max(each, key=lambda floor: floor.excess_db, default=None)


def usual_excess(excess: Float) -> float:
    """Excess that all but :data:`NOISY_SHARE` of familiar recordings stay below [dB].

    Parameters
    ----------
    excess : numpy.ndarray [shape=(n,)]
        Of machines that had no part in the ceiling, of :func:`loudest_floor` [dB].
    """
    return max(float(np.quantile(excess, 1 - NOISY_SHARE, method="higher")), 0.0)
