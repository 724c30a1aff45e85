"""Feature rows reduced to properties that machines of one kind share.

These are the distribution of the energy over the revolution, over wide bands and over the orders,
and how impulsive the signal is. They do not depend on the level, which speed, load and sensor
determine, and little on the exact resonances of the casing. Narrow bands are the opposite, and the
most informative on the wear. :func:`moved_rows` shows how far even wide bands follow a resonance.
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

_WIDE_BANDS = 5  # of a spectrum of 20: three bands either side, while modes shift by one
_ANGLE_STEP = 2  # every second bin of a profile is kept, after smoothing over one either side
_LEAST_FACTOR = 1e-3  # a dead channel has 0
_SILENCE = 1e-12  # mean square that avoids the logarithm of zero
_SPEED = "shaft.speed_hz"
_CONDITIONS = (_SPEED, "shaft.speed_variation")


@dataclass(kw_only=True)
class Columns:
    """Columns of the features of one channel, pair, shaft or orbit.

    Attributes
    ----------
    level, bands, orders, spiky, again, other : list of int
        Levels of :data:`LEVELS`; band levels from low to high; order levels; shape factors and
        kurtoses; features that the crank-angle map already contains, which would count twice; the
        others except the speed.
    edges : list of (float, float)
        Edges of the bands [Hz].
    cells : list of int
        Levels of the crank-angle map, angle by angle, from low to high band.
    angles : int
        Number of its angles.
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
        if cell:  # ordered by angle, then by band
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
    """Feature rows in physical coordinates.

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    rows : numpy.ndarray [shape=(n, n_features)]

    Returns
    -------
    numpy.ndarray [shape=(n, n_physical)]
        Per channel: energy over the crank angle in decibels re its mean, smoothed; energy in five
        wide, overlapping bands and of the orders, in decibels re their sum and mean; logarithms of
        the shape factors and kurtoses; all others except level and speed unchanged.

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
    """Description of the physical coordinates.

    Attributes
    ----------
    owner : numpy.ndarray [shape=(n_physical,)]
        Channel, pair, shaft or orbit.
    kind : numpy.ndarray [shape=(n_physical,)]
        ``profile``, ``wide``, ``orders``, ``spiky``, ``orbit`` or ``other``.
    """

    owner: NDArray[np.str_]
    kind: NDArray[np.str_]


def coordinates_of(names: Sequence[str]) -> Coordinates:
    """Owner and kind of each physical coordinate.

    Parameters
    ----------
    names : sequence of str
        Names of the features.

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
    """Feature rows of machines with spectra shifted in frequency.

    Parameters
    ----------
    names, rows
        As in :func:`physical_rows`.
    factor : float or numpy.ndarray [shape=(n,)]
        Factor of all frequencies, for each row.
    cells : bool
        Whether to shift the spectra at each crank angle as well.

    Returns
    -------
    numpy.ndarray [shape=(n, n_features)]
        Band levels of a spectrum shifted by the factor, interpolated in the logarithm of the
        frequency and held constant beyond the ends; all other features unchanged.

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
    """One feature row at all positions of the once-per-turn mark.

    Parameters
    ----------
    names : sequence of str
        Names of the features.
    row : numpy.ndarray [shape=(n_features,)]

    Returns
    -------
    numpy.ndarray [shape=(n_angles, n_features)]
        Crank-angle maps of all channels rotated by zero, one, … of their angles, as with a mark
        that is late by as much; a single row without a map.

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
    """Spectra [shape=(n, n_bands)] shifted by steps of the log frequency [shape=(n,)]."""
    middle = np.log(edges).mean(axis=1)
    place = np.interp(middle - steps[:, None], middle, np.arange(len(middle)))
    below = np.minimum(place.astype(np.intp), max(len(middle) - 2, 0))
    above = np.minimum(below + 1, len(middle) - 1)
    first = np.take_along_axis(levels, below, axis=1)
    return np.asarray(first + (place - below) * (np.take_along_axis(levels, above, axis=1) - first))


def _edges_of(name: str) -> tuple[float, float]:
    found = re.search(_BAND, name)
    assert found is not None  # the name of a cell ends with that of a band
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
    """Relative energy over the angle, smoothed periodically."""
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
    """Level-independent features that predict the level of each channel.

    Parameters
    ----------
    names, rows
        As in :func:`physical_rows`.

    Returns
    -------
    numpy.ndarray [shape=(n, n_shapes)]
        Physical coordinates of every channel with a level, except `other`, and the logarithm of the
        speed, if known.

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
    """Feature rows at other levels of the channels.

    Parameters
    ----------
    names, rows
        As in :func:`physical_rows`.
    excess_db : numpy.ndarray [shape=(n, n_channels)]
        Level to be subtracted from each channel of :func:`level_channels` [dB].

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
