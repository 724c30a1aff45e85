"""Noise floor of a recording: how loud it is where the turn is quiet, against familiar machines.

A knock rings down within a small part of a turn. What the quietest angles still show in every band
is the noise of sensor, cable and surroundings, or another machine near by. More of it than any
familiar recording has hides what a sound machine shows; less of it takes nothing away, so a model
sees a cleaner recording with the least noise that it knows.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..feature_rows.physical import Columns, columns_of

Float = NDArray[np.float64]

NOISY_SHARE = 0.01
"""Of familiar recordings: that may be cautioned for their noise floor."""

_QUIET = 0.1  # of all angles are quieter than what counts as the floor: single cells scatter
_USUAL = 0.998  # of familiar recordings have less in a band than its ceiling
_BANDS = 2  # that must show it: one alone may be a resonance that rings all round
_NEVER = -1e4  # dB: no signal is so far below another
_CLEANEST = 0.02  # of familiar recordings have less noise than what counts as the least usual
_QUIET_BANDS = 0.25  # of the bands of a channel without a map have nothing but noise in them
_ROUNDING = 1e-6  # dB


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


def swing_of_turn(names: Sequence[str], row: Float) -> float:
    """By how much the level swings within a turn, as knocks make it.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]

    Returns
    -------
    float
        Loudest less quietest angle of a channel's crank-angle map, the median of its bands, of the
        channel where that is most [dB]; 0 without a map.

    Examples
    --------
    >>> names = [f"a.angle_{i:03d}_{i + 180:03d}.band_50_66.level_db" for i in (0, 180)]
    >>> swing_of_turn(names, np.array([3.0, -27.0])), swing_of_turn(["a.rms"], np.ones(1))
    (30.0, 0.0)
    """
    maps = [columns for columns in columns_of(tuple(names)).values() if columns.cells]
    swings = [np.ptp(row[each.cells].reshape(each.angles, -1), axis=0) for each in maps]
    return max((float(np.median(swing)) for swing in swings), default=0.0)


def floors_in(names: Sequence[str]) -> int:
    """Number of floors of all channels and bands."""
    maps = [columns for columns in columns_of(tuple(names)).values() if columns.cells]
    return sum(len(columns.cells) // columns.angles for columns in maps)


def fit_least(names: Sequence[str], rows: Float) -> Float:
    """Least usual noise of every channel.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
        Of familiar recordings.

    Returns
    -------
    numpy.ndarray [shape=(n_levels,)]
        [dB]: of a channel with a crank-angle map the floor of every band, of another that has
        bands the density, per hertz, that a quarter of them stay below.

    Examples
    --------
    >>> names = ["a.band_50_60.level_db", "a.band_60_80.level_db"]
    >>> fit_least(names, np.array([[-20.0, 13.01], [-20.0, 13.01]])).round(1).tolist()
    [-22.5]
    """
    noise = [np.zeros((len(rows), 0)), *_noise_levels(names, rows).values()]
    return np.asarray(np.quantile(np.hstack(noise), _CLEANEST, axis=0))


def lifted_rows(names: Sequence[str], rows: Float, least: Float) -> Float:
    """Feature rows as they would be with the least usual noise, where they have less.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
    least : numpy.ndarray [shape=(n_levels,)]
        Of :func:`fit_least` [dB].

    Returns
    -------
    numpy.ndarray [shape=(n, n_features)]
        The mean square that a channel lacks is added to the cells of its map, band by band, or to
        its bands, by their width: so little that a knock does not feel it. Rows that lack none are
        as they were.

    Examples
    --------
    >>> names = [f"a.angle_{i:03d}_{i + 90:03d}.band_50_66.level_db" for i in (0, 90, 180, 270)]
    >>> rows = np.array([[-60.0, 3.0, -50.0, -20.0]])
    >>> lifted_rows(names, rows, np.array([-27.0])).round(1).tolist()
    [[-27.0, 3.0, -27.0, -19.2]]
    """
    lifted, start = rows.copy(), 0
    noise = _noise_levels(names, rows)
    for channel, columns in columns_of(tuple(names)).items():
        if channel not in noise:
            continue
        own = noise[channel]
        wanted = least[start : start + own.shape[1]]
        start += own.shape[1]
        missing = np.where(own < wanted - _ROUNDING, 10 ** (wanted / 10) - 10 ** (own / 10), 0.0)
        if columns.cells:
            where, missing = columns.cells, np.tile(missing, columns.angles)
        else:
            where, missing = columns.bands, missing * _widths(columns)
        levels = rows[:, where]
        raised = 10 * np.log10(10 ** (levels / 10) + missing)
        lifted[:, where] = np.where(missing > 0, raised, levels)
    return lifted


def _noise_levels(names: Sequence[str], rows: Float) -> dict[str, Float]:
    """Noise of every channel [dB, shape=(n, n_levels)], as of :func:`fit_least`."""
    found = noise_floors(names, rows)
    return {
        channel: found[channel] if columns.cells else _density(rows[:, columns.bands], columns)
        for channel, columns in columns_of(tuple(names)).items()
        if columns.cells or columns.bands
    }


def _density(levels: Float, columns: Columns) -> Float:
    """Of the quieter bands, per hertz [dB, shape=(n, 1)]."""
    density = levels - 10 * np.log10(_widths(columns))
    return np.asarray(np.quantile(density, _QUIET_BANDS, axis=1))[:, None]


def _widths(columns: Columns) -> Float:
    return np.array([high - low for low, high in columns.edges])


def noise_levels_in(names: Sequence[str]) -> int:
    """Number of levels of :func:`fit_least`."""
    return sum(level.shape[1] for level in _noise_levels(names, np.zeros((1, len(names)))).values())


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
