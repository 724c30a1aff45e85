"""Feature rows brought down to what one machine of a kind shares with the next.

Where its energy lies in the turn, in which wide bands, how it spreads over the orders, how spiky
the signal is: none of that hangs on the level, which speed, load and sensor decide, and little on
where exactly the casing resonates. Narrow bands are the opposite, and say most about the wear.
How far even wide bands follow a resonance is told by :func:`moved_rows`.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.views import MARK

Float = NDArray[np.float64]

LEVELS = ("rms", "peak", "peak_to_peak")
"""Features in the unit of the channel."""

_WIDE_BANDS = 5  # of a spectrum of 20: each three bands either way, where modes move by one
_ANGLE_STEP = 2  # bins of a profile between two kept ones, after smoothing over one either way
_LEAST_FACTOR = 1e-3  # a dead channel has 0
_SILENCE = 1e-12  # mean square beside which nothing is heard
_SPEED = "shaft.speed_hz"
_CONDITIONS = (_SPEED, "shaft.speed_variation")


@dataclass(kw_only=True)
class Columns:
    """Where the features of one channel, pair, shaft or orbit stand in a row.

    Attributes
    ----------
    level, bands, orders, spiky, again, other : list of int
        Levels of :data:`LEVELS`; band levels from low to high; order levels; shape factors and
        kurtoses; what the crank-angle map says already, where a trait would count twice; all the
        rest but the speed.
    edges : list of (float, float)
        Of the bands [Hz].
    cells : list of int
        Levels of the crank-angle map, angle by angle, from low to high band.
    angles : int
        Its angles.
    """

    level: list[int] = field(default_factory=list)
    bands: list[int] = field(default_factory=list)
    orders: list[int] = field(default_factory=list)
    spiky: list[int] = field(default_factory=list)
    again: list[int] = field(default_factory=list)
    other: list[int] = field(default_factory=list)
    edges: list[tuple[float, float]] = field(default_factory=list)
    cells: list[int] = field(default_factory=list)
    angles: int = 0


@lru_cache(maxsize=16)
def columns_of(names: tuple[str, ...]) -> dict[str, Columns]:
    """Columns of every owner of features, in the order of the row.

    Examples
    --------
    >>> columns_of(("a.rms", "a.band_50_66.level_db", "shaft.speed_hz"))["a"].bands
    [1]
    """
    owners: dict[str, Columns] = {}
    seen: dict[str, set[str]] = {}
    for i, name in enumerate(names):
        owner, _, label = name.partition(".")
        columns = owners.setdefault(owner, Columns())
        if name.rpartition(MARK)[2] in _CONDITIONS:
            continue
        band = re.fullmatch(_BAND, label)
        cell = re.fullmatch(_CELL, label)
        if band:
            columns.edges.append((float(band[1]), float(band[2])))
        if cell:  # the row has them angle by angle, bands rising
            seen.setdefault(owner, set()).add(cell[1])
            columns.angles = len(seen[owner])
        _list_of(columns, label).append(i)
    return owners


_BAND = r"band_(\d+)_(\d+)\.level_db"
_CELL = rf"(angle_\d+_\d+)\.{_BAND}"

_LISTS = (
    (_BAND, "bands"),
    (_CELL, "cells"),
    (r"order_[0-9.]+\.level_db", "orders"),
    ("|".join(LEVELS), "level"),
    (r".*kurtosis|.*factor", "spiky"),
    (r"(angle_harmonic|dead_centre)_.*", "again"),
    (r".*", "other"),
)


def _list_of(columns: Columns, label: str) -> list[int]:
    """The list that a feature belongs to."""
    name = next(name for pattern, name in _LISTS if re.fullmatch(pattern, label))
    found: list[int] = getattr(columns, name)
    return found


def physical_rows(names: Sequence[str], rows: Float) -> Float:
    """Feature rows in the physical space.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]

    Returns
    -------
    numpy.ndarray [shape=(n, n_physical)]
        Per channel: energy over the crank angle in decibels of its mean, smoothed; energy in five
        wide, overlapping bands and of the orders, in decibels of their sum and mean; logarithms of
        the shape factors and kurtoses; everything else but level and speed as it is.

    Examples
    --------
    >>> names = ["a.rms", "a.order_01.level_db", "a.order_02.level_db", "a.kurtosis"]
    >>> physical_rows(names, np.array([[7.0, 3.0, 1.0, 1.0]])).tolist()
    [[1.0, -1.0, 0.0]]
    """
    owners = columns_of(tuple(names))
    parts = [part for columns in owners.values() for part in _parts(columns, rows).values()]
    return np.hstack(parts) if parts else np.zeros((len(rows), 0))


@dataclass(frozen=True, kw_only=True)
class Coordinates:
    """What the physical coordinates are of.

    Attributes
    ----------
    owner : numpy.ndarray [shape=(n_physical,)]
        Channel, pair, shaft or orbit.
    kind : numpy.ndarray [shape=(n_physical,)]
        Way of looking at it: ``profile``, ``wide``, ``orders``, ``spiky``, ``orbit``, ``other``.
    """

    owner: NDArray[np.str_]
    kind: NDArray[np.str_]


def coordinates_of(names: Sequence[str]) -> Coordinates:
    """Owner and kind of each physical coordinate.

    Parameters
    ----------
    names : sequence of str
        Of the features.

    Returns
    -------
    Coordinates

    Examples
    --------
    >>> coordinates_of(["a.order_01.level_db", "a.order_02.level_db", "a.kurtosis"]).kind.tolist()
    ['orders', 'orders', 'spiky']
    """
    row = np.zeros((1, len(names)))
    found = [
        (owner, "orbit" if owner.rpartition(MARK)[2] == "orbit" else kind)
        for owner, columns in columns_of(tuple(names)).items()
        for kind, part in _parts(columns, row).items()
        for _ in range(part.shape[1])
    ]
    owner, kind = np.array(found, dtype=np.str_).reshape(-1, 2).T
    return Coordinates(owner=owner, kind=kind)


def moved_rows(
    names: Sequence[str], rows: Float, factor: float | Float, *, cells: bool = False
) -> Float:
    """Feature rows of machines whose spectra stand at other frequencies.

    Parameters
    ----------
    names, rows
        As of :func:`physical_rows`.
    factor : float or numpy.ndarray [shape=(n,)]
        Of all frequencies, of each row.
    cells : bool
        Whether the spectra at each crank angle move as well.

    Returns
    -------
    numpy.ndarray [shape=(n, n_features)]
        Band levels as read off a spectrum moved by the factor, interpolated in the logarithm of the
        frequency and held beyond the ends; all other features as they are.

    Examples
    --------
    >>> names = ["a.band_50_100.level_db", "a.band_100_200.level_db", "a.band_200_400.level_db"]
    >>> moved_rows(names, np.array([[0.0, 6.0, 0.0]]), 2.0).tolist()
    [[0.0, 0.0, 6.0]]
    """
    moved = rows.copy()
    steps = np.log(np.broadcast_to(factor, len(rows)))
    for columns in columns_of(tuple(names)).values():
        if columns.bands:
            moved[:, columns.bands] = _moved(rows[:, columns.bands], columns.edges, steps)
        if cells and columns.cells:
            bands = len(columns.cells) // columns.angles
            edges = [_edges_of(names[i]) for i in columns.cells[:bands]]
            spectra = rows[:, columns.cells].reshape(len(rows) * columns.angles, bands)
            turned = _moved(spectra, edges, np.repeat(steps, columns.angles))
            moved[:, columns.cells] = turned.reshape(len(rows), -1)
    return moved


def turned_rows(names: Sequence[str], row: Float) -> Float:
    """One feature row as it would be with the mark of the turn elsewhere.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]

    Returns
    -------
    numpy.ndarray [shape=(n_angles, n_features)]
        The crank-angle maps of all channels turned on by none, one, … of their angles, which is a
        mark that came so much late; a single row where there is no map.

    Examples
    --------
    >>> names = [f"a.angle_{i:03d}_{i + 90:03d}.band_50_66.level_db" for i in (0, 90, 180, 270)]
    >>> turned_rows(names, np.array([3.0, -7.0, 9.0, 1.0]))[1].tolist()
    [1.0, 3.0, -7.0, 9.0]
    """
    maps = [columns for columns in columns_of(tuple(names)).values() if columns.cells]
    turned = np.repeat(row[None, :], max((each.angles for each in maps), default=1), axis=0)
    for each in maps:
        levels = row[each.cells].reshape(each.angles, -1)
        for step in range(each.angles):
            turned[step, each.cells] = np.roll(levels, step, axis=0).ravel()
    return turned


def _moved(levels: Float, edges: Sequence[tuple[float, float]], steps: Float) -> Float:
    """Spectra [shape=(n, n_bands)] moved by steps of the log frequency [shape=(n,)]."""
    middle = np.log(edges).mean(axis=1)
    place = np.interp(middle - steps[:, None], middle, np.arange(len(middle)))
    below = np.minimum(place.astype(np.intp), max(len(middle) - 2, 0))
    above = np.minimum(below + 1, len(middle) - 1)
    first = np.take_along_axis(levels, below, axis=1)
    return np.asarray(first + (place - below) * (np.take_along_axis(levels, above, axis=1) - first))


def _edges_of(name: str) -> tuple[float, float]:
    found = re.search(_BAND, name)
    assert found is not None  # a cell's name ends in that of a band
    return float(found[1]), float(found[2])


def _parts(columns: Columns, rows: Float) -> dict[str, Float]:
    """Coordinates of one owner, by kind."""
    parts = {}
    if columns.cells:
        bands = len(columns.cells) // columns.angles
        energy = 10 ** (rows[:, columns.cells] / 10)
        profile = energy.reshape(len(rows), columns.angles, bands).sum(axis=2)
        parts["profile"] = _profile(profile)
    if len(columns.bands) >= _WIDE_BANDS:
        parts["wide"] = _wide(rows[:, columns.bands])
    if columns.orders:
        levels = rows[:, columns.orders]
        parts["orders"] = levels - levels.mean(axis=1, keepdims=True)
    if columns.spiky:
        parts["spiky"] = np.log(np.maximum(rows[:, columns.spiky], _LEAST_FACTOR))
    if columns.other:
        parts["other"] = rows[:, columns.other]
    return parts


def _profile(energy: Float) -> Float:
    """Energy over the angle, relative, smoothed round the circle."""
    level = 10 * np.log10(energy / _total(energy, np.mean) + _SILENCE)
    around = np.roll(level, 1, axis=1) + np.roll(level, -1, axis=1)
    return np.asarray((level / 2 + around / 4)[:, ::_ANGLE_STEP])


def _wide(levels: Float) -> Float:
    """Shares of the energy in wide bands that overlap by half."""
    energy = 10 ** (levels / 10)
    share = energy @ _wide_weights(levels.shape[1]) / _total(energy, np.sum)
    return np.asarray(10 * np.log10(share + _SILENCE))


@lru_cache(maxsize=16)
def _wide_weights(bands: int) -> Float:
    """Part of each narrow band in each wide one [shape=(bands, 5)]."""
    place = np.linspace(0, bands - 1, _WIDE_BANDS)
    reach = np.abs(np.arange(bands)[:, None] - place) / (place[1] - place[0])
    return np.asarray(np.clip(1 - reach, 0, 1))


def _total(energy: Float, how: Callable[..., Float]) -> Float:
    return np.maximum(how(energy, axis=1, keepdims=True), np.finfo(float).tiny)


def shape_rows(names: Sequence[str], rows: Float) -> Float:
    """What tells the level to expect of each channel, itself free of every level.

    Parameters
    ----------
    names, rows
        As of :func:`physical_rows`.

    Returns
    -------
    numpy.ndarray [shape=(n, n_shapes)]
        The physical coordinates of every channel that has a level, but for `other`; and the
        logarithm of the speed, where there is one.

    Examples
    --------
    >>> names = ["a.rms", "a.kurtosis", "a_over_b.rms_ratio_db", "shaft.speed_hz"]
    >>> shape_rows(names, np.array([[7.0, 1.0, 3.0, 1.0]])).tolist()
    [[0.0, 0.0]]
    """
    owners = columns_of(tuple(names))
    parts = [
        part
        for columns in owners.values()
        if columns.level
        for part in _parts(replace(columns, other=[]), rows).values()
    ]
    if _SPEED in names:
        parts.append(np.log(np.maximum(rows[:, [names.index(_SPEED)]], _LEAST_FACTOR)))
    return np.hstack(parts) if parts else np.zeros((len(rows), 0))


def level_rows(names: Sequence[str], rows: Float) -> Float:
    """Level of every channel that has one [dB re 1 x, shape=(n, n_channels)].

    Examples
    --------
    >>> level_rows(["a.rms", "a.peak"], np.array([[10.0, 30.0]])).tolist()
    [[20.0]]
    """
    first = [columns.level[0] for columns in columns_of(tuple(names)).values() if columns.level]
    return np.asarray(20 * np.log10(np.maximum(rows[:, first], _SILENCE)))


def levelled_rows(names: Sequence[str], rows: Float, excess_db: Float) -> Float:
    """Feature rows as they would be at other levels of the channels.

    Parameters
    ----------
    names, rows
        As of :func:`physical_rows`.
    excess_db : numpy.ndarray [shape=(n, n_channels)]
        To take away from each channel of :func:`level_channels` [dB].

    Returns
    -------
    numpy.ndarray [shape=(n, n_features)]

    Examples
    --------
    >>> names = ["a.rms", "a.band_50_100.level_db", "a.kurtosis"]
    >>> levelled_rows(names, np.array([[10.0, 3.0, 2.0]]), np.array([[20.0]])).tolist()
    [[1.0, -17.0, 2.0]]
    """
    levelled = rows.copy()
    owners = [columns for columns in columns_of(tuple(names)).values() if columns.level]
    for columns, excess in zip(owners, excess_db.T, strict=True):
        levelled[:, columns.level] *= 10 ** (-excess[:, None] / 20)
        levelled[:, [*columns.bands, *columns.orders, *columns.cells]] -= excess[:, None]
    return levelled


def level_channels(names: Sequence[str]) -> tuple[str, ...]:
    """Channels of :func:`level_rows`, in its order."""
    return tuple(owner for owner, columns in columns_of(tuple(names)).items() if columns.level)
