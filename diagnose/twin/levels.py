"""Quantities that a calibration compares: crank-angle map, spectrum, crank angles of knocks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...features.catalogue.analysis import Settings
from ...features.rotation import order
from ...features.signal.spectrum import decibel
from ...sim.output.recording import DataError, Recording

Float = NDArray[np.float64]

SETTINGS = Settings()
"""Angle bins and bands of the map, as for the standard features."""
LINE_STEP = 0.012
"""Ratio of adjacent points of the spectrum, minus one: a mode of one per cent damping is two points
wide."""
LEAST_RATE = 5000.0
"""Lowest sample rate [Hz]: slower recordings have fewer lines than the map has bands."""
LOWEST, HIGHEST = 90.0, 9500.0
"""Ends of the spectrum [Hz]: only crank orders below, the converter's filter above."""
LINES = 8192
"""Window length of the spectrum [samples]."""

KNOCK_EDGES = (200.0, 1000.0, 3000.0, 9500.0)
"""Edges of the bands in which knocks are located [Hz], as far as the sample rate allows."""
KNOCK_TOP = 0.4
"""Upper end of the knock bands over the sample rate, below the converter's filter."""
KNOCK_BINS, KNOCK_WINDOW = 120, 128
"""Angle bins per revolution, and window length [samples]: 3 degrees, and 2 ms at half height."""
DEAD_CENTRES = (0, 180)
BEFORE, AFTER = 20, 70
"""Range around a dead centre in which the pressure reverses and the pin changes sides [deg]."""
SHARES = (0.15, 0.5, 0.85)
"""Cumulative shares of the energy there, whose crank angles are used."""


@dataclass(frozen=True, kw_only=True)
class LevelLayout:
    """Layout of the levels of one recording in a row.

    Attributes
    ----------
    channels : tuple of str
    sample_rate : float
        [Hz]
    """

    channels: tuple[str, ...]
    sample_rate: float

    @property
    def edges(self) -> Float:
        """Edges of the bands of the map [Hz]."""
        return SETTINGS.map_edges(self.sample_rate)

    @property
    def knock_edges(self) -> tuple[float, ...]:
        """Edges of the bands in which knocks are located [Hz]."""
        top = min(KNOCK_EDGES[-1], KNOCK_TOP * self.sample_rate)
        return (*(edge for edge in KNOCK_EDGES[:-1] if 1.5 * edge <= top), top)

    @property
    def points(self) -> Float:
        """Frequencies of the spectrum [Hz]."""
        top = min(HIGHEST, 0.37 * self.sample_rate)
        count = int(np.log(top / LOWEST) / LINE_STEP)
        found: Float = LOWEST * np.exp(LINE_STEP * np.arange(count + 1))
        return found

    def map_of(self, levels: Float) -> Float:
        """Map of rows of levels [dB, shape=(..., n_channels, angle_bins, n_bands)]."""
        shape = (len(self.channels), SETTINGS.angle_bins, len(self.edges) - 1)
        return levels[..., : np.prod(shape)].reshape(*levels.shape[:-1], *shape)

    def spectrum_of(self, levels: Float) -> Float:
        """Spectrum of rows of levels [dB, shape=(..., n_channels, n_points)]."""
        count = len(self.channels) * len(self.points)
        part = levels[..., -self.n_knocks - count : -self.n_knocks]
        return part.reshape(*levels.shape[:-1], len(self.channels), -1)

    def levels_of(self, rows: Float) -> Float:
        """Map and spectrum of rows [dB, shape=(..., n_levels)]."""
        return rows[..., : -self.n_knocks]

    def knocks_of(self, rows: Float) -> Float:
        """Crank angles of knocks [deg, shape=(..., n_knocks)]."""
        return rows[..., -self.n_knocks :]

    @property
    def n_knocks(self) -> int:
        """Number of crank angles in each row."""
        bands = len(self.knock_edges) - 1
        return len(self.channels) * bands * len(DEAD_CENTRES) * len(SHARES)


def layout_of(recording: Recording) -> LevelLayout:
    """Layout of a recording's levels."""
    return LevelLayout(channels=recording.vibration_names, sample_rate=recording.sample_rate)


def levels_of(recording: Recording) -> Float:
    """Map and spectrum [dB] and crank angles of knocks [deg] of a recording [shape=(n,)].

    Raises
    ------
    DataError
        The recording has no tacho with one pulse per revolution, is shorter than two revolutions,
        or has a sample rate below `LEAST_RATE`.
    """
    pulses = pulses_of(recording)
    signals, fs = recording.vibration, recording.sample_rate
    if fs < LEAST_RATE:
        who = recording.source or "recording"
        raise DataError(f"{who}: sample rate = {fs:g} Hz must be >= {LEAST_RATE:g}; record faster")
    phase = order.shaft_phase(pulses, signals.shape[-1], fs)
    layout = layout_of(recording)
    energy = order.crank_angle_map(
        signals, fs, phase, edges=layout.edges, angle_bins=SETTINGS.angle_bins
    )
    fine = order.crank_angle_map(
        signals, fs, phase, edges=layout.knock_edges, angle_bins=KNOCK_BINS, nperseg=KNOCK_WINDOW
    )
    parts = decibel(energy), _spectrum(signals, layout), _knocks(fine)
    return np.concatenate([part.ravel() for part in parts])


def _knocks(energy: Float) -> Float:
    """Crank angles at which shares of the energy around each dead centre are reached [deg].

    Input: energy over the angle [shape=(n_channels, KNOCK_BINS, n_bands)]; output
    [shape=(n_centres, n_channels, n_bands, n_shares)].
    """
    width = 360 // KNOCK_BINS
    inside = np.arange(-BEFORE // width, AFTER // width)
    ends = width * (np.arange(len(inside) + 1) + inside[0])
    found = []
    for centre in DEAD_CENTRES:
        part = energy[:, (centre // width + inside) % KNOCK_BINS].swapaxes(1, 2)
        grown = np.cumsum(part, axis=-1) / part.sum(axis=-1, keepdims=True)
        rows = [np.interp(SHARES, [0, *row], ends) for row in grown.reshape(-1, len(inside))]
        found.append(rows)
    return np.array(found)


def speed_of(recording: Recording) -> float:
    """Mean speed between the first and the last pulse of the tacho [Hz]."""
    pulses = pulses_of(recording)
    return float((pulses.size - 1) / (pulses[-1] - pulses[0]))


def pulses_of(recording: Recording) -> Float:
    """Times of the pulses of the tacho [s]."""
    tacho = recording.tacho_signal
    who = recording.source or "recording"
    if tacho is None or recording.pulses_per_revolution != 1:
        raise DataError(f"{who}: a tacho with one pulse per revolution is missing; record one")
    pulses = order.pulse_times(tacho, recording.sample_rate)
    if pulses.size < 3:
        raise DataError(f"{who}: {pulses.size} pulses must be >= 3; give a longer recording")
    return pulses


def _spectrum(signals: NDArray[np.float32], layout: LevelLayout) -> Float:
    """Welch's density at the points [dB, shape=(n_channels, n_points)]."""
    from scipy.signal import welch

    length = min(LINES, signals.shape[-1])
    lines, density = welch(signals, layout.sample_rate, nperseg=length, noverlap=3 * length // 4)
    return np.stack([np.interp(layout.points, lines, row) for row in decibel(density)])
