"""Noise floor of a recording: its level at quiet crank angles, compared with familiar machines.

A knock decays within a small part of a revolution. The level at the quietest angles in every band
is noise of sensor, cable and surroundings, or of another machine nearby. More noise than in any
familiar recording hides the signature of the machine. Less noise does no harm: the model sees a
cleaner recording with the lowest noise of its training.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..feature_rows.physical import Columns, columns_of

Float = NDArray[np.float64]

NOISY_SHARE = 0.01
"""Share of familiar recordings that may get a caution for their noise floor."""

_QUIET = 0.1  # quantile over the angles that counts as floor: single cells scatter
_USUAL = 0.998  # quantile of familiar recordings that is the ceiling of a band
_BANDS = 2  # fewest noisy bands: a single one may be a resonance without decay
_NEVER = -1e4  # dB: below any level difference
_CLEANEST = 0.02  # quantile of familiar recordings that is the lowest usual noise
_QUIET_BANDS = 0.25  # share of bands of a channel without a map that contain only noise
_ROUNDING = 1e-6  # dB


class NoiseFloor(NamedTuple):
    """Noise floor of a recording relative to that of familiar ones.

    Attributes
    ----------
    channel : str
    excess_db : float
        Level of the floor above the loudest usual one [dB]; negative below it.
    """

    channel: str
    excess_db: float


def noise_floors(names: Sequence[str], rows: Float) -> dict[str, Float]:
    """Level at the quiet angles of every channel with a crank-angle map.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]

    Returns
    -------
    dict of str to numpy.ndarray [shape=(n, n_bands)]
        Channel -> level in every band [dB].

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
    """Variation of the level within a revolution, as caused by knocks.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]

    Returns
    -------
    float
        Range over the angles of the crank-angle map, median over the bands, maximum over the
        channels [dB]; 0 without a map.

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
    """Lowest usual noise of every channel.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
        Rows of familiar recordings.

    Returns
    -------
    numpy.ndarray [shape=(n_levels,)]
        For a channel with a crank-angle map the floor of every band, for another with bands the
        first quartile of their density per hertz [dB].

    Examples
    --------
    >>> names = ["a.band_50_60.level_db", "a.band_60_80.level_db"]
    >>> fit_least(names, np.array([[-20.0, 13.01], [-20.0, 13.01]])).round(1).tolist()
    [-22.5]
    """
    noise = [np.zeros((len(rows), 0)), *_noise_levels(names, rows).values()]
    return np.asarray(np.quantile(np.hstack(noise), _CLEANEST, axis=0))


def lifted_rows(names: Sequence[str], rows: Float, least: Float) -> Float:
    """Raise the noise in feature rows to the lowest usual level.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
    least : numpy.ndarray [shape=(n_levels,)]
        From :func:`fit_least` [dB].

    Returns
    -------
    numpy.ndarray [shape=(n, n_features)]
        The missing mean square of a channel is added to the cells of its map, band by band, or to
        its bands, in proportion to their width; knocks are hardly affected. Rows with enough noise
        are unchanged.

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
    """Noise of every channel [dB, shape=(n, n_levels)], as in :func:`fit_least`."""
    found = noise_floors(names, rows)
    return {
        channel: found[channel] if columns.cells else _density(rows[:, columns.bands], columns)
        for channel, columns in columns_of(tuple(names)).items()
        if columns.cells or columns.bands
    }


def _density(levels: Float, columns: Columns) -> Float:
    """Level per hertz of the quieter bands [dB, shape=(n, 1)]."""
    density = levels - 10 * np.log10(_widths(columns))
    return np.asarray(np.quantile(density, _QUIET_BANDS, axis=1))[:, None]


def _widths(columns: Columns) -> Float:
    return np.array([high - low for low, high in columns.edges])


def noise_levels_in(names: Sequence[str]) -> int:
    """Number of levels of :func:`fit_least`."""
    return sum(level.shape[1] for level in _noise_levels(names, np.zeros((1, len(names)))).values())


def fit_ceiling(names: Sequence[str], rows: Float) -> Float:
    """Highest usual floor of every channel and band [dB, shape=(n_channels * n_bands,)]."""
    floors = [np.zeros((len(rows), 0)), *noise_floors(names, rows).values()]
    return np.asarray(np.quantile(np.hstack(floors), _USUAL, axis=0))


def floor_excess(names: Sequence[str], rows: Float, ceiling: Float) -> dict[str, Float]:
    """Excess of each channel's floor over the highest usual one.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
    ceiling : numpy.ndarray [shape=(n_channels * n_bands,)]
        From :func:`fit_ceiling` [dB].

    Returns
    -------
    dict of str to numpy.ndarray [shape=(n,)]
        Channel -> second largest excess over the bands [dB].

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
    """Excess of the noisiest channel [dB, shape=(n,)]; very low if none has a map."""
    found = floor_excess(names, rows, ceiling)
    return np.asarray(np.max([np.full(len(rows), _NEVER), *found.values()], axis=0))


def noisiest(names: Sequence[str], row: Float, ceiling: Float) -> NoiseFloor | None:
    """Channel of a recording with the largest excess of its floor; None without a map.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]
    ceiling : numpy.ndarray [shape=(n_channels * n_bands,)]
        From :func:`fit_ceiling` [dB].
    """
    found = floor_excess(names, row[None, :], ceiling)
    each = [NoiseFloor(channel, float(excess[0])) for channel, excess in found.items()]
    return max(each, key=lambda floor: floor.excess_db, default=None)


def usual_excess(excess: Float) -> float:
    """Excess that only :data:`NOISY_SHARE` of familiar recordings reach [dB].

    Parameters
    ----------
    excess : numpy.ndarray [shape=(n,)]
        From :func:`loudest_floor`, for machines not used for the ceiling [dB].
    """
    return max(float(np.quantile(excess, 1 - NOISY_SHARE, method="higher")), 0.0)
